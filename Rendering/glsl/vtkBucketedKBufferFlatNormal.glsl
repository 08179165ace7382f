// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, geometry stage: the normal of a triangle where VTK makes
// none, towards the eye. Called at VTK::UniformFlow::Impl.

uniform mat4 ltDCToVC;
uniform vec2 ltViewport; // in pixels

vec3 ltFlatNormal()
{
  vec3 dc = 2.0 * vec3(gl_FragCoord.xy / ltViewport, gl_FragCoord.z) - 1.0;
  vec4 h = ltDCToVC * vec4(dc, 1.0);
  vec3 positionVC = h.xyz / h.w;
  return cross(dFdx(positionVC), dFdy(positionVC));
}
