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

layout(std430, binding = 0) coherent buffer ltHeadBlock { uint ltHead[]; };
layout(std430, binding = 1) buffer ltLinkBlock { uvec2 ltLink[]; };
#if LT_FLOAT_COLOR
layout(std430, binding = 2) buffer ltColorBlock { uvec4 ltColor[]; };
#else
layout(std430, binding = 2) buffer ltColorBlock { uvec2 ltColor[]; };
#endif
#if LT_STYLE
layout(std430, binding = 3) buffer ltSurfaceBlock { uvec2 ltSurface[]; };
#endif
// 0: nodes asked for, 1: fragments in pixels' lists, 2: fragments merged into tails
layout(std430, binding = 4) coherent buffer ltCounterBlock { uint ltCounter[]; };

void ltSetColor(uint node, vec4 color)
{
#if LT_FLOAT_COLOR
  ltColor[node] = floatBitsToUint(color);
#else
  ltColor[node] = uvec2(packHalf2x16(color.rg), packHalf2x16(color.ba));
#endif
}

// Unit vectors on an octahedron, 16 bits a coordinate (Cigolle et al. 2014).
uint ltPackNormal(vec3 n)
{
  n /= abs(n.x) + abs(n.y) + abs(n.z);
  vec2 side = vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
  vec2 e = n.z >= 0.0 ? n.xy : (1.0 - abs(n.yx)) * side;
  return packSnorm2x16(e);
}
