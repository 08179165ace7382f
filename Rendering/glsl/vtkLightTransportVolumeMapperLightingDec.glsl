// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: lighting, declarations    Stage: fragment
// Tag:     VTK::ComputeLighting::Dec, before it.
// Needs:   LT_LIGHTS how many lights, LT_LIGHT_TEXTURE 1 if they are in a texture, LT_POSITIONAL
//          1 if one of them has a place, LT_SHADOW (0 none, 1 precomputed, 2 ray traced),
//          LT_ENVIRONMENT 1 if there is one, LT_PBR 1 for PhysicallyBased, LT_ISOTROPIC 1 if the
//          phase function is; vtkLightTransportVisibility.glsl before it; from VTK's declarations
//          the uniforms of the volume's geometry.
// Defines: pure functions of the shading and the look-ups of visibility. Positions are TC, the
//          volume's texture coordinates, or VC, those of the visibility's grid; directions and
//          normals are WC, the world's, or DC, those of the data (the harmonics').

// Five texels a light: 0 direction to it or place, and whether it has one; 1 diffuse colour, and the
// cosine of the cone's half angle; 2 specular colour, and the spot's exponent; 3 the spot's axis;
// 4 attenuation.
#if LT_LIGHTS > 0
#if LT_LIGHT_TEXTURE
uniform sampler2D in_ltLights;
#define ltLightTexel(light, row) texelFetch(in_ltLights, ivec2(row, light), 0)
#else
uniform vec4 in_ltLights[5 * LT_LIGHTS];
#define ltLightTexel(light, row) in_ltLights[5 * (light) + (row)]
#endif
#endif

uniform float in_ltLightingStrength;
uniform float in_ltShadowStrength;
uniform float in_ltAnisotropy;
uniform vec4 in_ltGradientThreshold; // of each component
uniform float in_ltOcclusionStrength;
uniform vec2 in_ltMaterial; // roughness, metallic

#if LT_HARMONICS > 0
// Linear in the texels as stored: coefficients for each texture, then a constant in x. Of each
// light without a field of its own; rows 0 to 2 of the environment are red, green and blue, of
// each the four coefficients of the light that arrives, a column a stored value.
#if LT_LIGHTS > LT_EXACT && !LT_LIGHT_TEXTURE
uniform vec4 in_ltLightHarmonics[(LT_LIGHTS - LT_EXACT) * (LT_HARMONICS + 1)];
#endif
#endif
#if LT_ENVIRONMENT
#if LT_HARMONICS > 2
#define LT_ENVIRONMENT_VALUES 9
#elif LT_HARMONICS > 0
#define LT_ENVIRONMENT_VALUES 4
#else
#define LT_ENVIRONMENT_VALUES 0
#endif
uniform vec4 in_ltEnvironment[3 * (LT_ENVIRONMENT_VALUES + 1)];
uniform vec3 in_ltEnvironmentMost; // its brightest radiance
#endif

#if LT_EXACT_TEXTURES > 0 || LT_HARMONICS > 0
#define LT_LOOKS_UP 1
uniform mat4 in_ltDatasetToVC;
mat4 g_ltTCToVC;
#else
#define LT_LOOKS_UP 0
#endif

uniform mat4 in_ltWorldToData; // directions; in the rotation's place, of length about 1
mat3 g_ltGradientToWC;         // differences of neighbours -> gradient, per world length
vec3 g_ltViewWC;               // to the eye; the same all along a ray
#if LT_POSITIONAL
mat4 g_ltTCToWC;
#endif
uniform float in_ltSurfaceOffset; // steps of the visibility's grid
uniform mat4 in_ltWorldToSteps;   // of directions
mat3 g_ltWCToTC;                  // of directions
vec3 g_ltTowardsEye;              // the surface offset along the view
float g_ltSamplesTowardsEye;      // sample distances in it

// That many steps along a direction of length 1.
vec3 ltOffset(vec3 direction)
{
  return direction *
    (in_ltSurfaceOffset / max(length(mat3(in_ltWorldToSteps) * direction), 1e-30));
}

// Affine maps, once per ray. TCToData is TC -> data coordinates.
void ltInitLighting(mat4 TCToData)
{
  mat4 TCToWC = in_volumeMatrix[0] * TCToData;
  mat3 linear = mat3(TCToWC);
  // Columns: from a voxel to the next. A gradient is a covector: inverse transposed.
  vec3 a = linear[0] * in_cellStep[0].x;
  vec3 b = linear[1] * in_cellStep[0].y;
  vec3 c = linear[2] * in_cellStep[0].z;
  mat3 cofactors = mat3(cross(b, c), cross(c, a), cross(a, b));
  float determinant = dot(a, cofactors[0]);
  g_ltGradientToWC = cofactors * (0.5 / (determinant == 0.0 ? 1.0 : determinant));
  g_ltViewWC = -normalize(linear * g_dirStep);
#if LT_LOOKS_UP
  g_ltTCToVC = in_ltDatasetToVC * TCToData;
#endif
#if LT_POSITIONAL
  g_ltTCToWC = TCToWC;
#endif
  g_ltWCToTC = inverse(linear);
  g_ltTowardsEye = ltOffset(g_ltViewWC);
  g_ltSamplesTowardsEye =
    length(mat3(in_inverseVolumeMatrix[0]) * g_ltTowardsEye) / in_sampleDistance;
}

// 4 pi times the phase function; theta is between the directions of travel.
float ltPhase(float cosTheta)
{
#if LT_ISOTROPIC
  return 1.0;
#else
  float g = in_ltAnisotropy;
  float s = inversesqrt(1.0 + g * g - 2.0 * g * cosTheta);
  return (1.0 - g * g) * s * s * s;
#endif
}

// What a surface with normal n makes of light from l: reflected radiance per intensity and colour
// of the light, the cosine included. v is to the eye.
void ltReflect(vec3 n, vec3 l, vec3 v, vec3 color, int component, out vec3 diffuse,
  out vec3 specular)
{
  float nDotL = max(dot(n, l), 0.0);
  vec3 h = normalize(l + v);
  float nDotH = max(dot(n, h), 0.0);
#if LT_PBR
  // pi times the terms of VTK's surfaces: intensity 1 lights a white surface to 1.
  float roughness = max(in_ltMaterial.x, 0.05);
  float a2 = roughness * roughness;
  float nDotV = max(abs(dot(n, v)), 1e-3);
  float hDotL = clamp(dot(h, l), 0.0, 1.0);
  vec3 F0 = mix(vec3(0.04), color, in_ltMaterial.y);
  float x = 1.0 - hDotL;
  vec3 F = F0 + (1.0 - F0) * (x * x * x * x * x);
  float a4 = a2 * a2;
  float d = (nDotH * a4 - nDotH) * nDotH + 1.0;
  float D = a4 / (d * d); // times pi
  float V = 0.5 /
    max(nDotL * sqrt(a4 + nDotV * (nDotV - a4 * nDotV)) +
          nDotV * sqrt(a4 + nDotL * (nDotL - a4 * nDotL)), 1e-5);
  diffuse = nDotL * in_diffuse[component] * (1.0 - in_ltMaterial.y) * (1.0 - F) * color;
  specular = nDotL * D * V * F;
#else
  diffuse = nDotL * in_diffuse[component] * color;
  specular = (nDotL > 0.0 && nDotH > 0.0 ? pow(nDotH, in_shininess[component]) : 0.0) *
    in_specular[component] * vec3(1.0);
#endif
}

#if LT_LIGHTS > 0
// Where light comes from, and which part of its intensity arrives without the volume.
vec3 ltTowards(int light, vec3 positionWC, out float intensity, out float reach)
{
  vec4 place = ltLightTexel(light, 0);
  intensity = 1.0;
  reach = 1e30;
#if LT_POSITIONAL
  if (place.w != 0.0)
  {
    vec3 l = place.xyz - positionWC;
    reach = max(length(l), 1e-20);
    l /= reach;
    vec3 attenuation = ltLightTexel(light, 4).xyz;
    intensity = 1.0 /
      max(attenuation.x + reach * (attenuation.y + reach * attenuation.z), 1e-20);
    float cone = ltLightTexel(light, 1).w;
    float cosine = -dot(l, ltLightTexel(light, 3).xyz);
    intensity *= cone < -1.0
      ? 1.0
      : (cosine >= cone ? pow(max(cosine, 1e-20), ltLightTexel(light, 2).w) : 0.0);
    return l;
  }
#endif
  return place.xyz;
}
#endif

#if LT_HARMONICS > 0
#if LT_LIGHTS > LT_EXACT
// Visibility of a light without a field of its own, 0 the first of them.
float ltVisibilityOf(int light, vec3 l, vec4 texels[LT_HARMONICS])
{
#if LT_LIGHT_TEXTURE
  return ltVisibilityTowards(normalize(mat3(in_ltWorldToData) * l), texels);
#else
#if LT_POSITIONAL
  if (in_ltLights[5 * (light + LT_EXACT)].w != 0.0)
  {
    return ltVisibilityTowards(normalize(mat3(in_ltWorldToData) * l), texels);
  }
#endif
  float v = in_ltLightHarmonics[light * (LT_HARMONICS + 1) + LT_HARMONICS].x;
  for (int t = 0; t < LT_HARMONICS; ++t)
  {
    v += dot(in_ltLightHarmonics[light * (LT_HARMONICS + 1) + t], texels[t]);
  }
  return clamp(v, 0.0, 1.0);
#endif
}
#endif
#endif

#if LT_ENVIRONMENT
// Coefficients (band 0 and 1) of the light that arrives from the environment, of one colour.
#if LT_ENVIRONMENT_VALUES > 0
vec4 ltArriving(int color, vec4 texels[LT_HARMONICS])
{
  int first = color * (LT_ENVIRONMENT_VALUES + 1);
  vec4 sum = in_ltEnvironment[first + LT_ENVIRONMENT_VALUES];
  for (int i = 0; i < 4; ++i)
  {
    sum += texels[0][i] * in_ltEnvironment[first + i];
  }
#if LT_ENVIRONMENT_VALUES > 4
  for (int i = 0; i < 4; ++i)
  {
    sum += texels[1][i] * in_ltEnvironment[first + 4 + i];
  }
  sum += texels[2].x * in_ltEnvironment[first + 8];
#endif
  return sum;
}
#else
#define ltArriving(color, texels) in_ltEnvironment[color]
#endif
#endif

// VTK's own function, under another name.
#define computeLighting ltStockLighting
