// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, geometry stage, in the fragment shader of every
// translucent prop. Serves VTK::DepthPeeling::Dec; VTK::DepthPeeling::Impl calls
// ltStore. Defined before: vtkBucketedKBufferData.glsl.

uniform sampler2D ltOpaqueDepth; // DC, of this viewport
uniform int ltWidth;             // of the viewport, in pixels
uniform int ltCapacity;          // of the buffers, in nodes

uniform int ltStyle;
uniform int ltShape;             // the prop's first
uniform int ltThin;              // 1: points or wireframe

// A fragment on an opaque surface is in front of it, as with GL_LEQUAL: half a
// step of a 24-bit depth buffer.
const float ltDepthTolerance = 3.0e-8;

#if LT_STYLE
// From a normal that was turned to the eye.
uint ltOutwardNormal(vec3 n)
{
  return dot(n, n) > 0.0 ? ltPackNormal(gl_FrontFacing ? n : -n) : LT_NO_NORMAL;
}
#endif

// One counter for all would be waited for; each of 8 hands out 64 nodes in turn.
uint ltNextNode(ivec2 p)
{
  int tile = ((p.x >> 4) + 3 * (p.y >> 4)) & 7;
  uint n = imageAtomicAdd(ltCounter, 16 * (1 + tile), 1u);
  return (n >> 6u << 9u) | uint(tile << 6) | (n & 63u);
}

void ltStore(vec4 color, float depthDC, uint shape, uint normalVC)
{
  ivec2 p = ivec2(gl_FragCoord.xy);
  depthDC = clamp(depthDC, 0.0, 1.0);
  if (depthDC > texelFetch(ltOpaqueDepth, p, 0).r + ltDepthTolerance)
  {
    return;
  }
  uint node = ltNextNode(p);
  if (node >= uint(ltCapacity))
  {
    return; // the stage is run again with room for all
  }
  color.a = clamp(color.a, 0.0, 1.0);
  color.rgb = clamp(color.rgb, 0.0, 65504.0); // what half floats hold
  imageStore(ltColor, int(node), color);
#if LT_STYLE
  shape = (uint(ltShape) + shape) & 0xFFFFFFu;
  imageStore(ltSurface, int(node),
    uvec4(uint(ltStyle) << 24u | shape, ltThin != 0 ? LT_NO_NORMAL : normalVC, 0u, 0u));
#endif
  uint next = imageAtomicExchange(ltHead, p.y * ltWidth + p.x, node);
  imageStore(ltLink, int(node), uvec4(next, floatBitsToUint(depthDC) << 1 | uint(ltThin), 0u, 0u));
}
