// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: curvature, declarations    Stage: fragment
// Tag:     VTK::ComputeLighting::Dec, before it.
// Needs:   the geometry of rays; LTC_FIELD (1: a field of curvature, 0: the turn of the normal along the ray),
//          LTC_SURFACES (1: isosurface blending), LTC_COMPONENT of the volume; from VTK's
//          declarations in_cellSpacing, in_sampleDistance, in_volume, g_dirStep.
// Defines: ltcInitRay, ltcCompose; positions are TC, the texture coordinates of the
//          volume (as g_dataPos), or FC, those of the field.

uniform sampler2D in_ltcTable; // f over |kappa| (x) and z (y)
uniform vec4 in_ltcDepth;      // z of a place in the data's coordinates
uniform float in_ltcScale;     // what curvature is multiplied with in the tanh
uniform float in_ltcStrength;

vec4 g_ltcDepth; // z of a place in TC
#if LTC_FIELD
uniform sampler3D in_ltcField; // mean curvature, scaled
uniform mat4 in_ltcDatasetToFC;
mat4 g_ltcTCToFC;
#endif

void ltcInitRay()
{
  mat4 TCToData = ltTCToData();
  g_ltcDepth = in_ltcDepth * TCToData;
#if LTC_FIELD
  g_ltcTCToFC = in_ltcDatasetToFC * TCToData;
#endif
}

#if !LTC_FIELD
// The direction of the gradient, by central differences, along the data's axes; its
// length is 1, or 0 where nothing varies.
vec3 ltcNormal(vec3 positionTC)
{
  vec3 step = 1.0 / vec3(textureSize(in_volume[0], 0));
  vec3 low;
  vec3 high;
  for (int axis = 0; axis < 3; ++axis)
  {
    vec3 offset = vec3(0.0);
    offset[axis] = step[axis];
    low[axis] = textureLod(in_volume[0], positionTC - offset, 0.0)[LTC_COMPONENT];
    high[axis] = textureLod(in_volume[0], positionTC + offset, 0.0)[LTC_COMPONENT];
  }
  vec3 gradient = (high - low) / in_cellSpacing[0];
  float squared = dot(gradient, gradient);
  return squared > 1e-20 ? gradient * inversesqrt(squared) : vec3(0.0);
}
#endif

// |kappa| at a sample, in [0, 1].
float ltcCurvature(vec3 positionTC)
{
#if LTC_FIELD
  vec3 positionFC = (g_ltcTCToFC * vec4(positionTC, 1.0)).xyz;
  bool inside = positionFC == clamp(positionFC, vec3(0.0), vec3(1.0));
  float x = inside ? abs(textureLod(in_ltcField, positionFC, 0.0).x) : 0.0;
#else
  // Between half a smallest spacing before and behind, whatever the sample distance.
  float along = min(in_cellSpacing[0].x, min(in_cellSpacing[0].y, in_cellSpacing[0].z));
  vec3 offset = 0.5 * along / in_sampleDistance * g_dirStep;
  vec3 before = ltcNormal(positionTC - offset);
  vec3 behind = ltcNormal(positionTC + offset);
  bool both = dot(before, before) > 0.0 && dot(behind, behind) > 0.0;
  float x = both ? distance(before, behind) / along : 0.0;
#endif
  x *= in_ltcScale;
  return x > 8.0 ? 1.0 : tanh(x);
}

// The sample lies between before and after (both premultiplied, front to back);
// returns what takes the place of after.
vec4 ltcCompose(vec4 before, vec4 after, vec3 positionTC)
{
  float alpha = (after.a - before.a) / max(1.0 - before.a, 1e-6);
  if (alpha <= 0.0)
  {
    return after;
  }
  float kappa = ltcCurvature(positionTC);
  float z = clamp(dot(g_ltcDepth, vec4(positionTC, 1.0)), 0.0, 1.0);
  vec2 size = vec2(textureSize(in_ltcTable, 0));
  float f = textureLod(in_ltcTable, (vec2(kappa, z) * (size - 1.0) + 0.5) / size, 0.0).x;
  f = mix(1.0, f, in_ltcStrength);
#if LTC_SURFACES
  return before + (after - before) * f;
#else
  alpha = min(alpha, 0.999);
  return before + (after - before) * ((1.0 - pow(1.0 - alpha, f)) / alpha);
#endif
}

