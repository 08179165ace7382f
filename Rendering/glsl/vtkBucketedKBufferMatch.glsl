// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, neighbour stage (compute): each fragment's neighbour on
// the same surface in the pixels around. Of the fragments i of a pixel and j of
// the next one in the bucket of their shape,
//   epsilon(i, j) = (1 - n_i . n_j) + |z_i - z_j|^2,   z in footprints of a pixel
// (Carnecky et al. 2013; Murray et al. 2016). i and j are neighbours if each is the
// other's best (the reverse check). One thread looks right and up, and writes both
// ends. Defined before: vtkBucketedKBufferPixel.glsl, LT_ROOM.

layout(local_size_x = 64) in;
layout(r8ui, binding = 5) writeonly uniform uimageBuffer ltNeighbor; // its bytes, 0 before

float ltBackError[LT_ROOM]; // of the other pixel's fragments: their best so far
int ltBack[LT_ROOM];
int ltForth[LT_ROOM];

// Loops test at their end: SIMD machines run a body once more, for nothing, where the
// test comes first.
void ltMatch(uvec2 here, uvec2 there, int side)
{
  int first = int(here.x);
  int count = ltFragments(here);
  int buckets = ltBuckets(here);
  int firstThere = int(there.x);
  int countThere = ltFragments(there);
  int bucketsThere = ltBuckets(there);
  // Both in order of shape: along both at once.
  int b = 0;
  int c = 0;
  uint bucket = texelFetch(ltBucketList, first).x;
  uint other = texelFetch(ltBucketList, firstThere).x;
  bool more;
  do
  {
    bool same;
    ivec2 range;
    ivec2 rangeThere;
    {
      same = bucket >> 6u == other >> 6u;
      bool step_ = bucket >> 6u <= other >> 6u;
      bool stepThere = bucket >> 6u >= other >> 6u;
      b += step_ ? 1 : 0;
      c += stepThere ? 1 : 0;
      range.x = int(bucket & 63u);
      rangeThere.x = int(other & 63u);
      bucket = texelFetch(ltBucketList, first + min(b, buckets - 1)).x;
      other = texelFetch(ltBucketList, firstThere + min(c, bucketsThere - 1)).x;
      range.y = b < buckets ? int(bucket & 63u) - 1 : count - 1;
      rangeThere.y = c < bucketsThere ? int(other & 63u) - 1 : countThere - 1;
      more = b < buckets && c < bucketsThere;
    }
    if (same)
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
        int j = rangeThere.x;
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
        } while (j <= rangeThere.y);
        ltForth[i] = bestJ;
        ++i;
      } while (i <= range.y);
      i = range.x;
      do
      {
        int j = ltForth[i];
        if (j >= 0 && ltBack[max(j, 0)] == i)
        {
          imageStore(ltNeighbor, 4 * (first + i) + side, uvec4(j + 1));
          imageStore(ltNeighbor, 4 * (firstThere + j) + side + 2, uvec4(i + 1));
        }
        ++i;
      } while (i <= range.y);
    }
  } while (more);
}

void main()
{
  int column = int(gl_GlobalInvocationID.x);
  int row = ltRows.x + int(gl_GlobalInvocationID.y);
  if (column >= ltSize.x || row >= ltRows.y)
  {
    return;
  }
  int pixel = row * ltSize.x + column;
  uvec2 here = texelFetch(ltPixels, pixel).xy;
  for (int side = 0; side < 2; ++side)
  {
    bool inside = side == 0 ? column + 1 < ltSize.x : row + 1 < ltRows.y;
    uvec2 there = texelFetch(ltPixels, inside ? pixel + (side == 0 ? 1 : ltSize.x) : pixel).xy;
    if (inside && here.y > 0u && there.y > 0u)
    {
      ltMatch(here, there, side);
    }
  }
}
