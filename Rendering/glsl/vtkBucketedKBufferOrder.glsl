// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, ordering stage (compute): the nearest fragments of a pixel,
// ordered by shape and then by depth, and the buckets of the shapes (Murray et al.
// 2016, "Z reordering", "Bucket creation"). Defined before:
// vtkBucketedKBufferPixel.glsl, vtkBucketedKBufferList.glsl, LT_SINGLE_BUCKET.

layout(local_size_x = 64) in;
layout(rgba32ui, binding = 0) writeonly uniform uimageBuffer ltPixel;
layout(rg32ui, binding = 1) writeonly uniform uimageBuffer ltRecord;
layout(r32ui, binding = 2) writeonly uniform uimageBuffer ltNode;
layout(r32ui, binding = 3) writeonly uniform uimageBuffer ltBucket;
layout(r32ui, binding = 4) coherent uniform uimageBuffer ltCounter;

uniform int ltLayers;

uint ltNormals[LT_ROOM]; // of a rank
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
    first = imageAtomicAdd(ltCounter, 1, uint(ltCount));
  }
  uvec2 tail = uvec2(0u);
  if (ltTailCount > 0u)
  {
    imageAtomicAdd(ltCounter, 2, ltTailCount);
    vec4 layer = ltTailLayer();
    tail = uvec2(packHalf2x16(layer.rg), packHalf2x16(layer.ba));
  }
  uint buckets = 0u;
  if (ltCount > 0)
  {
#if LT_DENSE
#define LT_ITEM(i) ltKeys[i] = 0xFFFFFFFFu;
    LT_EACH
#undef LT_ITEM
#endif
    int rank = 0;
    do
    {
      uvec2 surface = ltGetSurface(ltNodes[rank]);
      ltNormals[rank] = surface.y;
#if LT_SINGLE_BUCKET
      uint shape = 0u;
#else
      uint shape = surface.x & 0xFFFFFFu;
#endif
      uint key = shape << 6u | uint(rank);
      int i = rank;
#if !LT_DENSE
      while (i > 0 && key < ltKeys[i - 1])
      {
        ltKeys[i] = ltKeys[i - 1];
        --i;
      }
#endif
      ltKeys[i] = key;
      ++rank;
    } while (rank < ltCount);
#if LT_DENSE
#define LT_EXCHANGE(i, j)                                                                          \
  {                                                                                                \
    uint a = ltKeys[i], b = ltKeys[j];                                                             \
    ltKeys[i] = min(a, b);                                                                         \
    ltKeys[j] = max(a, b);                                                                         \
  }
    LT_NETWORK
#undef LT_EXCHANGE
#endif
    uint before = 0xFFFFFFFFu;
    uint i = 0u;
    do
    {
      uint key = ltKeys[i];
      uint of = key & 63u;
      uint node = ltNodes[of];
      int at = int(first + i);
      imageStore(ltRecord, at,
        uvec4(floatBitsToUint(ltDepthDCToZ(ltDepths[of] >> 1u)), ltNormals[of], 0u, 0u));
      imageStore(ltNode, int(first + of), uvec4(node | i << 26u));
      if (key >> 6u != before)
      {
        imageStore(ltBucket, int(first + buckets), uvec4((key & ~63u) | i));
        ++buckets;
        before = key >> 6u;
      }
      ++i;
    } while (i < uint(ltCount));
  }
  imageStore(ltPixel, int(pixel), uvec4(first, uint(ltCount) | buckets << 8u, tail));
}
