// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportPolyDataMapper    Part: visibility    Stage: fragment
// Tag:     VTK::Light::Dec, after it.
// Needs:   LT_HARMONICS how many textures of spherical harmonics there are (0, 1, 3, 4, 7 for none
//          and the orders up to 1, 2, 3, 4), LT_EXACT how many lights have a field of their own.
// Defines: ltVisibility, ltOcclusion. Positions are view coordinates or GC, those of the
//          visibility's grid, from 0 to 1 over its domain; directions are the view's, or DC, those
//          of the data (the harmonics').

uniform mat4 in_ltViewToGC;
uniform mat4 in_ltViewToDC; // of directions: a rotation
uniform vec3 in_ltStrengths; // shadows, ambient occlusion; z: offset along the normal, a length

#if LT_EXACT > 0
uniform sampler3D in_ltExact; // visibility of one light a channel
#endif
#if LT_HARMONICS > 0
uniform sampler3D in_ltVisibility0; // windowed coefficients
#endif
#if LT_HARMONICS > 1
uniform sampler3D in_ltVisibility1;
uniform sampler3D in_ltVisibility2;
#endif
#if LT_HARMONICS > 3
uniform sampler3D in_ltVisibility3;
#endif
#if LT_HARMONICS > 4
uniform sampler3D in_ltVisibility4;
uniform sampler3D in_ltVisibility5;
uniform sampler3D in_ltVisibility6;
#endif

#if LT_HARMONICS > 0
// sum v_lm Y_lm(d), d of length 1.
float ltHarmonics(vec3 p, vec3 d)
{
  vec4 c = textureLod(in_ltVisibility0, p, 0.0);
  float v = dot(c, vec4(0.28209479, 0.48860251 * d.yzx));
#if LT_HARMONICS > 1
  vec4 second = textureLod(in_ltVisibility1, p, 0.0);
  vec4 third = textureLod(in_ltVisibility2, p, 0.0);
  float xy = d.x * d.x - d.y * d.y;
  float zz = d.z * d.z;
  v += dot(second,
    vec4(1.09254843 * d.x * d.y, 1.09254843 * d.y * d.z, 0.31539157 * (3.0 * zz - 1.0),
      1.09254843 * d.x * d.z));
  v += third.x * 0.54627422 * xy;
#endif
#if LT_HARMONICS > 3
  vec4 fourth = textureLod(in_ltVisibility3, p, 0.0);
  float a = 0.59004359 * d.y * (3.0 * d.x * d.x - d.y * d.y);
  float b = 0.59004359 * d.x * (d.x * d.x - 3.0 * d.y * d.y);
  v += dot(third.yzw,
    vec3(a, 2.89061144 * d.x * d.y * d.z, 0.45704580 * d.y * (5.0 * zz - 1.0)));
  v += dot(fourth,
    vec4(0.37317633 * d.z * (5.0 * zz - 3.0), 0.45704580 * d.x * (5.0 * zz - 1.0),
      1.44530572 * d.z * xy, b));
#endif
#if LT_HARMONICS > 4
  vec4 fifth = textureLod(in_ltVisibility4, p, 0.0);
  vec4 sixth = textureLod(in_ltVisibility5, p, 0.0);
  v += dot(fifth,
    vec4(2.50334294 * d.x * d.y * xy, 3.0 * d.z * a, 0.94617470 * d.x * d.y * (7.0 * zz - 1.0),
      0.66904654 * d.y * d.z * (7.0 * zz - 3.0)));
  v += dot(sixth,
    vec4(0.10578555 * (35.0 * zz * zz - 30.0 * zz + 3.0),
      0.66904654 * d.x * d.z * (7.0 * zz - 3.0), 0.47308735 * xy * (7.0 * zz - 1.0),
      3.0 * d.z * b));
  v += textureLod(in_ltVisibility6, p, 0.0).x * 0.62583574 *
    (d.x * d.x * (d.x * d.x - 3.0 * d.y * d.y) - d.y * d.y * (3.0 * d.x * d.x - d.y * d.y));
#endif
  return v;
}
#endif

// What the volume lets through of the light that lies `reach` away in the direction l (of length
// 1). `channel` is its own field's, or negative. Beside the volume the look-up moves on to where
// the ray meets it, if it does.
float ltVisibility(vec3 position, vec3 l, float reach, int channel)
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
    return 1.0;
  }
  p += enter * d;
  float v = 1.0;
#if LT_EXACT > 0
  if (channel >= 0)
  {
    v = textureLod(in_ltExact, p, 0.0)[channel];
  }
#endif
#if LT_HARMONICS > 0
  if (channel < 0)
  {
    v = ltHarmonics(p, normalize(mat3(in_ltViewToDC) * l));
  }
#endif
  return 1.0 - in_ltStrengths.x * (1.0 - clamp(v, 0.0, 1.0));
}

// What of the ambient term is left; 1 beside the volume.
float ltOcclusion(vec3 position)
{
#if LT_HARMONICS > 0
  vec3 p = (in_ltViewToGC * vec4(position, 1.0)).xyz;
  if (all(greaterThanEqual(p, vec3(0.0))) && all(lessThanEqual(p, vec3(1.0))))
  {
    float mean = textureLod(in_ltVisibility0, p, 0.0).x * 0.28209479;
    return 1.0 - in_ltStrengths.y * (1.0 - clamp(mean, 0.0, 1.0));
  }
#endif
  return 1.0;
}
