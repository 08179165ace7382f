// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass: what the geometry stage writes.
// Defined before: LT_STYLE (1: shape and normal are kept), LT_FLOAT_COLOR, LT_NONE,
// LT_NO_NORMAL.
//
// A node is one fragment of the translucent geometry:
//   ltLink[node]     x: the pixel's next node (LT_NONE: none), y: bits of the depth in DC << 1 | thin
//   ltColor[node]    RGBA, not premultiplied, half or float
//   ltSurface[node]  x: style << 24 | shape, y: outward normal in VC (LT_NO_NORMAL: none)

// Buffers behind images: Mesa's llvmpipe writes those many times faster than storage buffers,
// which are also limited in size.

layout(r32ui, binding = 0) coherent uniform uimageBuffer ltHead;
layout(rg32ui, binding = 1) uniform uimageBuffer ltLink;
#if LT_FLOAT_COLOR
layout(rgba32f, binding = 2) writeonly uniform imageBuffer ltColor;
#else
layout(rgba16f, binding = 2) writeonly uniform imageBuffer ltColor;
#endif
#if LT_STYLE
layout(rg32ui, binding = 3) writeonly uniform uimageBuffer ltSurface;
#endif
// 1: fragments in pixels' lists, 2: fragments merged into tails, 16 (1 + t): nodes asked for
// in tiles of number t.
layout(r32ui, binding = 4) coherent uniform uimageBuffer ltCounter;

// Unit vectors on an octahedron, 16 bits a coordinate (Cigolle et al. 2014).
uint ltPackNormal(vec3 n)
{
  n /= abs(n.x) + abs(n.y) + abs(n.z);
  vec2 side = vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
  vec2 e = n.z >= 0.0 ? n.xy : (1.0 - abs(n.yx)) * side;
  return packSnorm2x16(e);
}
