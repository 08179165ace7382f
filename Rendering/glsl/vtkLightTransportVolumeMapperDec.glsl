// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: declarations    Stage: fragment
// Tag:     VTK::ComputeLighting::Dec, before it.
// Needs:   LT_MODE (0 Overlay, 1 Illuminate, 2 FluxDirection), LT_BLEND (0 composite
//          and isosurface, 1 slice, 2 maximum, 3 minimum intensity); from VTK's
//          declarations in_sampleDistance.
// Defines: the functions and globals lt...; positions are TC, the texture
//          coordinates of the volume (as g_dataPos), or FC, those of the field.

#if LT_MODE == 2
#define ltFieldValue vec3
#define ltFetch(positionFC) textureLod(in_ltField, positionFC, 0.0).xyz
#define ltMagnitude(field) length(field)
#else
#define ltFieldValue float
#define ltFetch(positionFC) textureLod(in_ltField, positionFC, 0.0).x
#define ltMagnitude(field) abs(field)
#endif

uniform sampler3D in_ltField; // phi or E over the field's maximum
uniform sampler2D in_ltMap;   // over t: rgb colour, a how lit; row 0 phi > 0, row 1 phi < 0; nearest
uniform mat4 in_ltDatasetToFC;
uniform int in_ltLogarithmic;
uniform vec2 in_ltWindow;      // t = slope * (log2) |field| + offset
uniform float in_ltStrength;
uniform float in_ltLightOpacity; // of how lit 1, over the unit distance
uniform float in_ltInverseUnitDistance;
uniform float in_ltTissueOpacity;

mat4 g_ltTCToFC;

void ltInitField(mat4 TCToData)
{
  g_ltTCToFC = in_ltDatasetToFC * TCToData;
}

// The field at a sample; 0 outside the field's own domain.
ltFieldValue ltField(vec3 positionTC)
{
  vec3 positionFC = (g_ltTCToFC * vec4(positionTC, 1.0)).xyz;
  bool inside = positionFC == clamp(positionFC, vec3(0.0), vec3(1.0));
  return inside ? ltFetch(positionFC) : ltFieldValue(0.0);
}

// t, the place of a magnitude in the window.
float ltPosition(float magnitude)
{
  float x = in_ltLogarithmic != 0 ? log2(max(magnitude, 1e-37)) : magnitude;
  return clamp(in_ltWindow.x * x + in_ltWindow.y, 0.0, 1.0);
}

// Straight colour, and how lit in [0,1].
vec4 ltLight(ltFieldValue field)
{
  float magnitude = ltMagnitude(field);
  float t = ltPosition(magnitude);
#if LT_MODE == 2
  vec4 light = textureLod(in_ltMap, vec2(t, 0.25), 0.0);
  vec3 direction = abs(field) / max(magnitude, 1e-37);
  float strongest = max(max(direction.x, direction.y), max(direction.z, 1e-3));
  light.rgb = (0.3 + 0.7 * t) * direction / strongest;
#else
  vec4 light = textureLod(in_ltMap, vec2(t, field < 0.0 ? 0.75 : 0.25), 0.0);
#endif
  light.a = t > 0.0 ? light.a : 0.0;
  return light;
}

#if LT_MODE == 1
// The premultiplied colour of tissue in the light, and how lit in [0,1].
vec3 ltIlluminate(vec4 tissue, float phi, out float lit)
{
  lit = phi > 0.0 ? ltPosition(phi) : 0.0;
  float factor = mix(1.0, 0.5 + 3.5 * lit, in_ltStrength);
  return min(factor * tissue.rgb, max(tissue.rgb, vec3(tissue.a)));
}
#endif

#if LT_BLEND == 0 || LT_BLEND == 1
// The sample lies between before and after (both premultiplied, front to back);
// returns what takes the place of after.
vec4 ltCompose(vec4 before, vec4 after, ltFieldValue field)
{
  vec4 tissue = after - before;
#if LT_MODE == 1
  float lit;
  tissue.rgb = ltIlluminate(tissue, field, lit);
#else
  vec4 light = ltLight(field);
  float lit = light.a;
  light.a *= in_ltStrength * in_ltLightOpacity;
  tissue.rgb = mix(tissue.rgb, tissue.a * light.rgb, light.a);
#endif
#if LT_BLEND == 0
  tissue *= 1.0 + in_ltStrength * (1.0 - lit) * (in_ltTissueOpacity - 1.0);
#endif
#if LT_MODE != 1
#if LT_BLEND == 0
  // N layers of the N-th part of the unit distance hide as much as the whole.
  light.a = 1.0 - exp2(log2(1.0 - light.a) * in_sampleDistance * in_ltInverseUnitDistance);
#endif
  tissue += (1.0 - before.a - tissue.a) * light.a * vec4(light.rgb, 1.0);
#endif
  return before + tissue;
}
#else
ltFieldValue g_ltProjected; // the field to be shown of this ray
float g_ltProjectedMagnitude;

// The projection with the ray's light.
vec4 ltComposeProjection(vec4 projection)
{
#if LT_MODE == 1
  float lit;
  return vec4(ltIlluminate(projection, g_ltProjected, lit), projection.a);
#else
  vec4 light = ltLight(g_ltProjected);
  light.a *= in_ltStrength * in_ltLightOpacity;
  return mix(projection, vec4(light.rgb, 1.0), light.a);
#endif
}
#endif

