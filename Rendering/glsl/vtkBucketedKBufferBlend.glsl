// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, blending stage without stylisation: the fragment shader
// of a quad over the viewport. Defined before: vtkBucketedKBufferRead.glsl,
// vtkBucketedKBufferList.glsl. The output is premultiplied.

layout(r32ui, binding = 4) coherent uniform uimageBuffer ltCounter;

in vec2 texCoord;
uniform ivec2 ltSize; // of the viewport, in pixels
uniform int ltLayers;
#if LT_READ_TARGET
uniform sampler2D ltTarget; // what is behind, premultiplied; else blended by the machine
#endif

void main()
{
  ivec2 p = ivec2(texCoord * vec2(ltSize));
  ltGather(uint(p.y * ltSize.x + p.x), ltLayers);
  if (ltCount == 0)
  {
    discard;
  }
  vec3 color = vec3(0.0);
  float transparency = 1.0;
  for (int i = 0; i < ltCount; ++i)
  {
    vec4 c = ltGetColor(ltNodes[i]);
    color += transparency * c.a * c.rgb;
    transparency *= 1.0 - c.a;
  }
  if (ltTailCount > 0u)
  {
    vec4 tail = ltTailLayer();
    color += transparency * tail.a * tail.rgb;
    transparency *= 1.0 - tail.a;
    imageAtomicAdd(ltCounter, 2, ltTailCount);
  }
  vec4 result = vec4(color, 1.0 - transparency);
#if LT_READ_TARGET
  result += transparency * texelFetch(ltTarget, p, 0);
#endif
  gl_FragData[0] = result;
}
