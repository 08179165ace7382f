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
layout(std430, binding = 0) writeonly buffer ltBucketBlock { uint ltBucket[]; };

uniform int ltLayers;

uint ltKeys[LT_ROOM]; // shape << 6 | rank in depth, ordered

void main()
{
  uvec2 p = gl_GlobalInvocationID.xy + uvec2(0u, uint(ltRows.x));
  if (p.x >= uint(ltSize.x) || p.y >= uint(ltRows.y))
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
  uint buckets = 0u;
  if (ltCount > 0)
  {
#define LT_ITEM(i) ltKeys[i] = 0xFFFFFFFFu;
    LT_EACH
#undef LT_ITEM
    int rank = 0;
    do
    {
#if LT_SINGLE_BUCKET
      uint shape = 0u;
#else
      uint shape = ltGetSurface(ltNodes[rank]).x & 0xFFFFFFu;
#endif
      ltKeys[rank] = shape << 6u | uint(rank);
      ++rank;
    } while (rank < ltCount);
#define LT_EXCHANGE(i, j)                                                                          \
  {                                                                                                \
    uint a = ltKeys[i], b = ltKeys[j];                                                             \
    ltKeys[i] = min(a, b);                                                                         \
    ltKeys[j] = max(a, b);                                                                         \
  }
    LT_NETWORK
#undef LT_EXCHANGE
    uint before = 0xFFFFFFFFu;
    uint i = 0u;
    do
    {
      uint key = ltKeys[i];
      uint of = key & 63u;
      uint node = ltNodes[of];
      ltRecord[first + i] =
        uvec2(floatBitsToUint(ltDepthDCToZ(ltDepths[of] >> 1u)), ltGetSurface(node).y);
      ltNode[first + of] = node | i << 26u;
      if (key >> 6u != before)
      {
        ltBucket[first + buckets] = (key & ~63u) | i;
        ++buckets;
        before = key >> 6u;
      }
      ++i;
    } while (i < uint(ltCount));
  }
  ltPixel[pixel] = uvec4(first, uint(ltCount) | buckets << 8u, tail);
}
