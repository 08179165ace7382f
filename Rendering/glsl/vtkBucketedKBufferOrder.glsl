// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, ordering stage (compute): the nearest fragments of a pixel,
// ordered by shape and then by depth, and the buckets of the shapes (Murray et al.
// 2016, "Z reordering", "Bucket creation"). Defined before:
// vtkBucketedKBufferPixel.glsl, vtkBucketedKBufferList.glsl, LT_SINGLE_BUCKET.

layout(local_size_x = 64) in;
layout(std430, binding = 4) coherent buffer ltCounterBlock { uint ltCounter[]; };
layout(std430, binding = 5) writeonly buffer ltPixelBlock { uvec4 ltPixel[]; };
layout(std430, binding = 6) writeonly buffer ltRecordBlock { uvec2 ltRecord[]; };
layout(std430, binding = 7) writeonly buffer ltNodeBlock { uint ltNode[]; };
layout(std430, binding = 0) writeonly buffer ltBucketBlock { uvec2 ltBucket[]; };
layout(std430, binding = 1) writeonly buffer ltNeighborBlock { uint ltNeighbor[]; };

uniform int ltFirstRow;
uniform int ltLastRow; // one more
uniform int ltLayers;

uint ltShapes[LT_ROOM]; // ordered
uint ltRanks[LT_ROOM];

void main()
{
  uvec2 p = gl_GlobalInvocationID.xy + uvec2(0u, uint(ltFirstRow));
  if (p.x >= uint(ltSize.x) || p.y >= uint(ltLastRow))
  {
    return;
  }
  uint pixel = p.y * uint(ltSize.x) + p.x;
  ltGather(pixel, ltLayers);

  uint first = 0u;
  if (ltCount > 0)
  {
    first = atomicAdd(ltCounter[1], uint(ltCount));
  }
  uvec2 tail = uvec2(0u);
  if (ltTailCount > 0u)
  {
    atomicAdd(ltCounter[2], ltTailCount);
    vec4 layer = ltTailLayer();
    tail = uvec2(packHalf2x16(layer.rg), packHalf2x16(layer.ba));
  }
  ltPixel[pixel] = uvec4(first, uint(ltCount), tail);

  // By shape; of one shape the order of depth stays.
  for (int j = 0; j < ltCount; ++j)
  {
#if LT_SINGLE_BUCKET
    uint shape = 0u;
#else
    uint shape = ltGetSurface(ltNodes[j]).x;
#endif
    int i = j;
    while (i > 0 && shape < ltShapes[i - 1])
    {
      ltShapes[i] = ltShapes[i - 1];
      ltRanks[i] = ltRanks[i - 1];
      --i;
    }
    ltShapes[i] = shape;
    ltRanks[i] = uint(j);
  }
  for (int i = 0; i < ltCount; ++i)
  {
    uint rank = ltRanks[i];
    uint node = ltNodes[rank];
    uint at = first + uint(i);
    ltRecord[at] =
      uvec2(floatBitsToUint(ltDepthDCToZ(ltDepths[rank] >> 1u)), ltGetSurface(node).y);
    ltNode[at] = node | rank << 26u;
    ltBucket[at] = LT_NO_BUCKET;
    ltNeighbor[at] = 0u;
  }
  uvec2 taken = uvec2(0u); // slots, as bits
  int begin = 0;
  for (int i = 0; i < ltCount; ++i)
  {
    if (i + 1 == ltCount || ltShapes[i + 1] != ltShapes[i])
    {
      uint slot = ltSlot(ltShapes[i], uint(ltCount));
      while (((slot < 32u ? taken.x >> slot : taken.y >> (slot - 32u)) & 1u) != 0u)
      {
        slot = slot + 1u == uint(ltCount) ? 0u : slot + 1u;
      }
      taken |= slot < 32u ? uvec2(1u << slot, 0u) : uvec2(0u, 1u << (slot - 32u));
      ltBucket[first + slot] = uvec2(ltShapes[i], uint(begin) | uint(i) << 8u | 1u << 16u);
      begin = i + 1;
    }
  }
}
