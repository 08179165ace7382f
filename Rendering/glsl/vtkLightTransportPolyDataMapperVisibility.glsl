// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportPolyDataMapper    Part: visibility    Stage: fragment
// Tag:     VTK::Light::Dec, after it.
// Needs:   vtkLightTransportVisibility.glsl before it.
// Defines: ltVisibility, ltOcclusion. Positions are view coordinates or GC, those of the
//          visibility's grid, from 0 to 1 over its domain; directions are the view's, or DC, those
//          of the data (the harmonics').

uniform mat4 in_ltViewToGC;
uniform mat4 in_ltViewToDC; // of directions: a rotation
uniform vec3 in_ltStrengths; // shadows, ambient occlusion; z: offset along the normal, a length

// What the volume lets through of the light that lies `reach` away in the direction l (of length
// 1). `light` is the number of its field, or negative. Beside the volume the look-up moves on to
// where the ray meets it, if it does.
ltVisible ltVisibility(vec3 position, vec3 l, float reach, int light)
{
  vec3 p = (in_ltViewToGC * vec4(position, 1.0)).xyz;
  vec3 d = mat3(in_ltViewToGC) * l;
  vec3 inverse = 1.0 / mix(d, vec3(1e-20), lessThan(abs(d), vec3(1e-20)));
  vec3 a = -p * inverse;
  vec3 b = (1.0 - p) * inverse;
  vec3 low = min(a, b);
  vec3 high = max(a, b);
  float enter = max(max(low.x, low.y), max(low.z, 0.0));
  float leave = min(high.x, min(high.y, high.z));
  if (leave <= enter || enter >= reach)
  {
    return ltVisible(1.0);
  }
  p += enter * d;
  ltVisible v = ltVisible(1.0);
#if LT_EXACT > 0
  if (light >= 0)
  {
    vec4 fields[LT_EXACT_TEXTURES];
    ltFetchExact(p, fields);
    v = ltExactOf(light, fields);
  }
#endif
#if LT_HARMONICS > 0
  if (light < 0)
  {
    vec4 texels[LT_HARMONICS];
    ltFetchHarmonics(p, texels);
    v = ltVisible(ltVisibilityTowards(normalize(mat3(in_ltViewToDC) * l), texels));
  }
#endif
  return 1.0 - in_ltStrengths.x * (1.0 - v);
}

// What of the ambient term is left; 1 beside the volume.
float ltOcclusion(vec3 position)
{
#if LT_MEAN > 0
  vec3 p = (in_ltViewToGC * vec4(position, 1.0)).xyz;
  if (all(greaterThanEqual(p, vec3(0.0))) && all(lessThanEqual(p, vec3(1.0))))
  {
#if LT_MEAN == 1
    vec4 texels[LT_EXACT_TEXTURES];
    ltFetchExact(p, texels);
#else
    vec4 texels[LT_HARMONICS];
    ltFetchHarmonics(p, texels);
#endif
    return 1.0 - in_ltStrengths.y * (1.0 - ltMeanOf(texels));
  }
#endif
  return 1.0;
}
