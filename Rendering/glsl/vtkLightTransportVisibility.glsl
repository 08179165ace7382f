// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper, vtkLightTransportPolyDataMapper    Part: visibility
// Stage:   fragment
// Needs:   LT_EXACT how many lights have a field of their own, LT_EXACT_TEXTURES in how many
//          textures, LT_RGB 1 if in colours, LT_HARMONICS how many textures of spherical harmonics
//          there are (0, 1, 3, 4, 7 for none and the orders up to 1, 2, 3, 4), LT_MEAN where the
//          mean over directions is (0 nowhere, 1 with the fields, 2 in the harmonics).
// Defines: what visibility there is at a place of its grid, from 0 to 1 over the grid's domain.

#if LT_RGB
#define ltVisible vec3
#else
#define ltVisible float
#endif

#if LT_EXACT_TEXTURES > 0
uniform sampler3D in_ltExact0; // a light a channel, or a light a texture in colours
#endif
#if LT_EXACT_TEXTURES > 1
uniform sampler3D in_ltExact1;
#endif
#if LT_EXACT_TEXTURES > 2
uniform sampler3D in_ltExact2;
#endif
#if LT_EXACT_TEXTURES > 3
uniform sampler3D in_ltExact3;
#endif
#if LT_HARMONICS > 0
uniform sampler3D in_ltHarmonics0;
uniform vec4 in_ltHarmonicsScale[LT_HARMONICS]; // texel -> windowed coefficient
uniform vec4 in_ltHarmonicsShift[LT_HARMONICS];
#endif
#if LT_HARMONICS > 1
uniform sampler3D in_ltHarmonics1;
uniform sampler3D in_ltHarmonics2;
#endif
#if LT_HARMONICS > 3
uniform sampler3D in_ltHarmonics3;
#endif
#if LT_HARMONICS > 4
uniform sampler3D in_ltHarmonics4;
uniform sampler3D in_ltHarmonics5;
uniform sampler3D in_ltHarmonics6;
#endif

#if LT_EXACT_TEXTURES > 0
void ltFetchExact(vec3 position, out vec4 texels[LT_EXACT_TEXTURES])
{
  texels[0] = textureLod(in_ltExact0, position, 0.0);
#if LT_EXACT_TEXTURES > 1
  texels[1] = textureLod(in_ltExact1, position, 0.0);
#endif
#if LT_EXACT_TEXTURES > 2
  texels[2] = textureLod(in_ltExact2, position, 0.0);
#endif
#if LT_EXACT_TEXTURES > 3
  texels[3] = textureLod(in_ltExact3, position, 0.0);
#endif
}

// Of a light with a field of its own.
ltVisible ltExactOf(int light, vec4 texels[LT_EXACT_TEXTURES])
{
#if LT_RGB
  return texels[light].rgb;
#else
  return texels[light / 4][light % 4];
#endif
}

#if LT_MEAN == 1
float ltMeanOf(vec4 texels[LT_EXACT_TEXTURES])
{
#if LT_RGB && LT_EXACT > 0
  return texels[0].a;
#else
  return texels[LT_EXACT / 4][LT_EXACT % 4];
#endif
}
#endif
#endif

#if LT_HARMONICS > 0
// The stored texels.
void ltFetchHarmonics(vec3 position, out vec4 texels[LT_HARMONICS])
{
  texels[0] = textureLod(in_ltHarmonics0, position, 0.0);
#if LT_HARMONICS > 1
  texels[1] = textureLod(in_ltHarmonics1, position, 0.0);
  texels[2] = textureLod(in_ltHarmonics2, position, 0.0);
#endif
#if LT_HARMONICS > 3
  texels[3] = textureLod(in_ltHarmonics3, position, 0.0);
#endif
#if LT_HARMONICS > 4
  texels[4] = textureLod(in_ltHarmonics4, position, 0.0);
  texels[5] = textureLod(in_ltHarmonics5, position, 0.0);
  texels[6] = textureLod(in_ltHarmonics6, position, 0.0);
#endif
}

#if LT_MEAN == 2
// The mean over directions is v_00 Y_00.
float ltMeanOf(vec4 texels[LT_HARMONICS])
{
  return clamp(
    0.28209479 * (texels[0].x * in_ltHarmonicsScale[0].x + in_ltHarmonicsShift[0].x), 0.0, 1.0);
}
#endif

// Visibility in a direction of the data, d of length 1: all bands, windowed.
float ltVisibilityTowards(vec3 d, vec4 texels[LT_HARMONICS])
{
  vec4 c[LT_HARMONICS];
  for (int t = 0; t < LT_HARMONICS; ++t)
  {
    c[t] = texels[t] * in_ltHarmonicsScale[t] + in_ltHarmonicsShift[t];
  }
  float v = dot(c[0], vec4(0.28209479, 0.48860251 * d.yzx));
#if LT_HARMONICS > 1
  float xy = d.x * d.x - d.y * d.y;
  float zz = d.z * d.z;
  v += dot(c[1],
    vec4(1.09254843 * d.x * d.y, 1.09254843 * d.y * d.z, 0.31539157 * (3.0 * zz - 1.0),
      1.09254843 * d.x * d.z));
  v += c[2].x * 0.54627422 * xy;
#endif
#if LT_HARMONICS > 3
  float a = 0.59004359 * d.y * (3.0 * d.x * d.x - d.y * d.y);
  float b = 0.59004359 * d.x * (d.x * d.x - 3.0 * d.y * d.y);
  v += dot(
    c[2].yzw, vec3(a, 2.89061144 * d.x * d.y * d.z, 0.45704580 * d.y * (5.0 * zz - 1.0)));
  v += dot(c[3],
    vec4(0.37317633 * d.z * (5.0 * zz - 3.0), 0.45704580 * d.x * (5.0 * zz - 1.0),
      1.44530572 * d.z * xy, b));
#endif
#if LT_HARMONICS > 4
  v += dot(c[4],
    vec4(2.50334294 * d.x * d.y * xy, 3.0 * d.z * a, 0.94617470 * d.x * d.y * (7.0 * zz - 1.0),
      0.66904654 * d.y * d.z * (7.0 * zz - 3.0)));
  v += dot(c[5],
    vec4(0.10578555 * (35.0 * zz * zz - 30.0 * zz + 3.0),
      0.66904654 * d.x * d.z * (7.0 * zz - 3.0), 0.47308735 * xy * (7.0 * zz - 1.0),
      3.0 * d.z * b));
  v += c[6].x * 0.62583574 *
    (d.x * d.x * (d.x * d.x - 3.0 * d.y * d.y) - d.y * d.y * (3.0 * d.x * d.x - d.y * d.y));
#endif
  return clamp(v, 0.0, 1.0);
}
#endif
