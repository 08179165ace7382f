// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass with stylisation: the ordered fragments of a pixel p, and
// how they are found. Defined before: vtkBucketedKBufferRead.glsl (for ltUnpackNormal
// too).
//
//   ltPixels[p]          x: first fragment, y: how many, zw: the tail's RGBA (half)
//   ltRecords[first+i]   x: bits of z in VC, y: outward normal in VC
//   ltNodes[first+i]     node | rank in depth << 26
//   ltBuckets[first+s]   x: style << 24 | shape, y: first i | last i << 8 | 1 << 16;
//                        y = 0: no bucket. The pixel's hash table, open addressing.
//   ltNeighbors[first+i] i + 1 of the neighbour on the same surface, 0: missing:
//                        right | up << 8 | left << 16 | down << 24
// Fragments are ordered by shape, then by depth: a bucket is a range.

uniform usamplerBuffer ltPixels;
uniform usamplerBuffer ltRecords;
uniform usamplerBuffer ltNodeList;
uniform usamplerBuffer ltBuckets;
uniform usamplerBuffer ltNeighbors;

uniform ivec2 ltSize;      // of the viewport, in pixels
uniform int ltParallel;    // 1: parallel projection
uniform vec4 ltProjection; // x, y: VC to DC, zw: of the projection's centre
uniform vec2 ltDepthToVC;  // the last two of the third row of VC to DC
uniform float ltFootprint; // size of a pixel, at distance 1 if not parallel

#define LT_NO_BUCKET uvec2(0u)

// shape mod slots. Actors are numbered one after the other: no collisions among as many
// as there are slots. By floats, exact below 2^24: SIMD machines divide integers slowly.
uint ltSlot(uint shape, uint slots)
{
  int n = int(slots);
  int s = int(shape & 0xFFFFFFu);
  int rest = s - n * int(float(s) / float(n));
  rest += rest < 0 ? n : 0;
  return uint(rest >= n ? rest - n : rest);
}

// First i and last i of a shape's fragments in the pixel; x > y: there are none.
ivec2 ltFindBucket(int first, int count, uint shape)
{
  int slot = int(ltSlot(shape, uint(count)));
  ivec2 range = ivec2(1, 0);
  int tries = 0;
  bool again;
  do
  {
    uvec2 bucket = texelFetch(ltBuckets, first + slot).xy;
    bool found = bucket.x == shape && bucket.y != 0u;
    range = found ? ivec2(int(bucket.y & 255u), int((bucket.y >> 8u) & 255u)) : range;
    slot = slot + 1 == count ? 0 : slot + 1;
    ++tries;
    again = !found && bucket.y != 0u && tries < count;
  } while (again);
  return range;
}

float ltDepthDCToZ(uint depthBits)
{
  float zDC = 2.0 * uintBitsToFloat(depthBits) - 1.0;
  return ltParallel != 0 ? (zDC - ltDepthToVC.y) / ltDepthToVC.x
                         : -ltDepthToVC.y / (zDC + ltDepthToVC.x);
}

vec3 ltPositionVC(ivec2 p, float z)
{
  vec2 dc = (vec2(p) + 0.5) / vec2(ltSize) * 2.0 - 1.0;
  vec2 xy = ltParallel != 0 ? (dc - ltProjection.zw) / ltProjection.xy
                            : -z * (dc + ltProjection.zw) / ltProjection.xy;
  return vec3(xy, z);
}

// Length of a pixel's side at z.
float ltFootprintAt(float z)
{
  return ltParallel != 0 ? ltFootprint : ltFootprint * max(-z, 1e-30);
}

// Towards the eye, in VC.
vec3 ltViewVC(vec3 position)
{
  return ltParallel != 0 ? vec3(0.0, 0.0, 1.0) : normalize(-position);
}
