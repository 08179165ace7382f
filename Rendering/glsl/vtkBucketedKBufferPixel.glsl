// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass with stylisation: the ordered fragments of a pixel p, and
// how they are found. Defined before: vtkBucketedKBufferRead.glsl (for ltUnpackNormal
// too).
//
//   ltPixels[p]          x: first fragment, y: how many | how many buckets << 8,
//                        zw: the tail's RGBA (half)
//   ltNodeList[first+r]  of rank r in depth: node | i << 26
//   ltRecords[first+i]   in order of shape, then of depth. x: bits of z in VC, y: outward
//                        normal in VC
//   ltBucketList[first+b] in order of shape: shape << 6 | the bucket's first i
//   ltNeighbors[first+i] i + 1 of the neighbour on the same surface, 0: missing:
//                        right | up << 8 | left << 16 | down << 24
// A bucket is a range. Murray et al. find it in a hash table, by shape mod k; in order, the
// buckets of two pixels are found by going along both.

uniform usamplerBuffer ltPixels;
uniform usamplerBuffer ltRecords;
uniform usamplerBuffer ltNodeList;
uniform usamplerBuffer ltBucketList;
uniform usamplerBuffer ltNeighbors;

uniform ivec2 ltSize;      // of the viewport, in pixels
uniform ivec2 ltRows;      // first and one past the last that there are fragments of
uniform int ltParallel;    // 1: parallel projection
uniform vec4 ltPixelToVC;  // p * xy + zw: at z = -1, or where the projection is parallel
uniform vec2 ltDepthToVC;  // the last two of the third row of VC to DC
uniform float ltFootprint; // size of a pixel, at distance 1 if not parallel

int ltFragments(uvec2 pixel)
{
  return int(pixel.y & 255u);
}

int ltBuckets(uvec2 pixel)
{
  return int(pixel.y >> 8u);
}

float ltDepthDCToZ(uint depthBits)
{
  float zDC = 2.0 * uintBitsToFloat(depthBits) - 1.0;
  return ltParallel != 0 ? (zDC - ltDepthToVC.y) / ltDepthToVC.x
                         : -ltDepthToVC.y / (zDC + ltDepthToVC.x);
}

float ltZToDepthDC(float z)
{
  float zDC = ltParallel != 0 ? z * ltDepthToVC.x + ltDepthToVC.y
                              : -ltDepthToVC.y / z - ltDepthToVC.x;
  return clamp(0.5 * zDC + 0.5, 0.0, 1.0);
}

vec3 ltPositionVC(ivec2 p, float z)
{
  vec2 xy = vec2(p) * ltPixelToVC.xy + ltPixelToVC.zw;
  return vec3(ltParallel != 0 ? xy : -z * xy, z);
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
