// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass: what the geometry stage left on the GPU, read as texture
// buffers: Mesa's llvmpipe reads those many times faster than storage buffers.
// Defined before: LT_STYLE. See vtkBucketedKBufferData.glsl for the contents.

uniform usamplerBuffer ltHeads;
uniform usamplerBuffer ltLinks;
uniform samplerBuffer ltColors; // converts half to float
#if LT_STYLE
uniform usamplerBuffer ltSurfaces;
#endif

uint ltGetHead(uint pixel)
{
  return texelFetch(ltHeads, int(pixel)).x;
}

uvec2 ltGetLink(uint node)
{
  return texelFetch(ltLinks, int(node)).xy;
}

vec4 ltGetColor(uint node)
{
  return texelFetch(ltColors, int(node));
}

#if LT_STYLE
uvec2 ltGetSurface(uint node)
{
  return texelFetch(ltSurfaces, int(node)).xy;
}
#endif

vec3 ltUnpackNormal(uint bits)
{
  vec2 e = unpackSnorm2x16(bits);
  vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
  float t = max(-n.z, 0.0);
  n.x += n.x >= 0.0 ? -t : t;
  n.y += n.y >= 0.0 ? -t : t;
  return normalize(n);
}
