// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, neighbour stage (compute): each fragment's neighbour on
// the same surface in the pixels around. Of the fragments i of a pixel and j of the
// next one in the bucket of their shape,
//   epsilon(i, j) = (1 - n_i . n_j) + |z_i - z_j|^2,   z in footprints of a pixel
// (Carnecky et al. 2013; Murray et al. 2016). i and j are neighbours if each is the
// other's best (the reverse check). One thread looks right and up, and writes both
// ends. Defined before: vtkBucketedKBufferPixel.glsl, LT_ROOM.

layout(local_size_x = 64) in;
layout(std430, binding = 1) coherent buffer ltNeighborBlock { uint ltNeighbor[]; };

uniform int ltFirstRow;
uniform int ltLastRow; // one more

float ltBackError[LT_ROOM]; // of the other pixel's fragments: their best so far
int ltBack[LT_ROOM];
int ltForth[LT_ROOM];

// Loops test at their end: SIMD machines run a body once more, for nothing, where the
// test comes first.
void ltMatch(uvec2 here, uvec2 there, uint shift)
{
  int first = int(here.x);
  int count = int(here.y);
  int firstThere = int(there.x);
  int countThere = int(there.y);
  int slot = 0;
  do
  {
    uvec2 bucket = texelFetch(ltBuckets, first + slot).xy;
    ivec2 range = ivec2(int(bucket.y & 255u), int((bucket.y >> 8u) & 255u));
    ivec2 other = ltFindBucket(firstThere, countThere, bucket.x);
    if (bucket.y != 0u && other.x <= other.y)
    {
      int i = range.x;
      do
      {
        uvec2 record = texelFetch(ltRecords, first + i).xy;
        float z = uintBitsToFloat(record.x);
        float inverse = 1.0 / ltFootprintAt(z);
        vec3 n = ltUnpackNormal(record.y);
        float best = 1e30;
        int bestJ = -1;
        int j = other.x;
        do
        {
          uvec2 candidate = texelFetch(ltRecords, firstThere + j).xy;
          float dz = (z - uintBitsToFloat(candidate.x)) * inverse;
          float epsilon = 1.0 - dot(n, ltUnpackNormal(candidate.y)) + dz * dz;
          epsilon = record.y == LT_NO_NORMAL || candidate.y == LT_NO_NORMAL ? 1e30 : epsilon;
          bool better = epsilon < best;
          best = better ? epsilon : best;
          bestJ = better ? j : bestJ;
          bool back = i == range.x || epsilon < ltBackError[j];
          ltBackError[j] = back ? epsilon : ltBackError[j];
          ltBack[j] = back ? i : ltBack[j];
          ++j;
        } while (j <= other.y);
        ltForth[i] = bestJ;
        ++i;
      } while (i <= range.y);
      i = range.x;
      do
      {
        int j = ltForth[i];
        if (j >= 0 && ltBack[j] == i)
        {
          atomicOr(ltNeighbor[first + i], uint(j + 1) << shift);
          atomicOr(ltNeighbor[firstThere + j], uint(i + 1) << (shift + 16u));
        }
        ++i;
      } while (i <= range.y);
    }
    ++slot;
  } while (slot < count);
}

void main()
{
  int column = int(gl_GlobalInvocationID.x);
  int row = ltFirstRow + int(gl_GlobalInvocationID.y);
  if (column >= ltSize.x || row >= ltLastRow)
  {
    return;
  }
  int pixel = row * ltSize.x + column;
  uvec2 here = texelFetch(ltPixels, pixel).xy;
  for (int side = 0; side < 2; ++side)
  {
    bool inside = side == 0 ? column + 1 < ltSize.x : row + 1 < ltLastRow;
    uvec2 there = texelFetch(ltPixels, inside ? pixel + (side == 0 ? 1 : ltSize.x) : pixel).xy;
    if (inside && here.y > 0u && there.y > 0u)
    {
      ltMatch(here, there, uint(side) * 8u);
    }
  }
}
