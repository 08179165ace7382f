// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: lighting    Stage: fragment
// Tag:     VTK::ComputeLighting::Dec, after it.
// Needs:   the declarations of the lighting; LT_MIXED 1 for a strength between 0 and 1,
//          LT_GRADIENT_OPACITY, LT_TRANSFER_2D 1 where the volume has these, LT_COMPONENTS how
//          many, LT_INDEPENDENT, LT_BLEND_ISOSURFACE, LT_CONTOURS how many, LT_CROPPING, LT_CLIPPING, LT_MASK (0 none, 1 binary, 2 labels),
//          LT_DEFERRED; VTK's g_dataPos, computeOpacity, computeGradient.
// Defines: computeLighting, which VTK's computeColor calls, in the place of VTK's.
#undef computeLighting

// Gradient of a component, in its unit per world length.
vec3 ltGradient(vec3 positionTC, int component)
{
  vec3 x = vec3(in_cellStep[0].x, 0.0, 0.0);
  vec3 y = vec3(0.0, in_cellStep[0].y, 0.0);
  vec3 z = vec3(0.0, 0.0, in_cellStep[0].z);
  vec3 after = vec3(texture3D(in_volume[0], positionTC + x)[component],
    texture3D(in_volume[0], positionTC + y)[component],
    texture3D(in_volume[0], positionTC + z)[component]);
  vec3 before = vec3(texture3D(in_volume[0], positionTC - x)[component],
    texture3D(in_volume[0], positionTC - y)[component],
    texture3D(in_volume[0], positionTC - z)[component]);
  float range = in_scalarsRange[component].y - in_scalarsRange[component].x;
  return g_ltGradientToWC * ((after - before) * (in_volume_scale[0][component] * range));
}

#if LT_SHADOW == 2
// Whether clipping, cropping and a binary mask leave a place.
bool ltIsThere(vec3 positionTC)
{
#if LT_CLIPPING
  vec4 positionWC = clip_texToObjMat * vec4(positionTC, 1.0);
  for (int i = 0; i < clip_numPlanes; i += 6)
  {
    vec3 origin = vec3(in_clippingPlanes[i + 1], in_clippingPlanes[i + 2], in_clippingPlanes[i + 3]);
    vec3 normal = vec3(in_clippingPlanes[i + 4], in_clippingPlanes[i + 5], in_clippingPlanes[i + 6]);
    if (dot(origin - positionWC.xyz, normal) > 0.0)
    {
      return false;
    }
  }
#endif
#if LT_CROPPING
  if (in_croppingFlags[computeRegion(croppingPlanesTexture, positionTC)] == 0)
  {
    return false;
  }
#endif
#if LT_MASK == 1
  if (texture3D(in_mask, positionTC).r <= 0.0)
  {
    return false;
  }
#endif
  return true;
}

vec4 ltScalarAt(vec3 positionTC)
{
  vec4 scalar = texture3D(in_volume[0], positionTC) * in_volume_scale[0] + in_volume_bias[0];
#if LT_COMPONENTS == 1
  scalar = vec4(scalar.r);
#endif
  return scalar;
}

// What matter of this opacity lets through, in colours by its own (Kniss's transport colour).
#if LT_RGB
vec3 ltColorOf(vec4 scalar, int component); // where VTK's tables are declared
vec3 ltPasses(float opacity, vec3 color)
{
  vec3 shares = 1.1 - clamp(color, 0.0, 1.0);
  shares *= 3.0 / (shares.r + shares.g + shares.b);
  return pow(vec3(max(1.0 - opacity, 0.0)), shares);
}
#define LT_COLOR_OF(scalar, component) ltColorOf(scalar, component)
#else
#define ltPasses(opacity, color) (1.0 - (opacity))
#define LT_COLOR_OF(scalar, component) vec3(0.0)
#endif

#if LT_BLEND_ISOSURFACE
// From a sample to the next, each surface between them once.
ltVisible ltPassesAt(vec3 positionTC, inout float last)
{
  ltVisible passes = ltVisible(1.0);
  vec4 scalar = ltScalarAt(positionTC);
  float range = in_scalarsRange[0].y - in_scalarsRange[0].x;
  for (int i = 0; i < LT_CONTOURS; ++i)
  {
    float s = (in_isosurfacesValues[i] - in_scalarsRange[0].x) / range;
    if ((last < s) != (scalar.r < s) && ltIsThere(positionTC))
    {
      passes *= ltPasses(computeOpacity(vec4(s)), LT_COLOR_OF(vec4(s), 0));
    }
  }
  last = scalar.r;
  return passes;
}
#else
// Over a sample distance.
ltVisible ltPassesAt(vec3 positionTC)
{
  if (!ltIsThere(positionTC))
  {
    return ltVisible(1.0);
  }
  vec4 scalar = ltScalarAt(positionTC);
#if LT_TRANSFER_2D
  for (int c = 0; c < (LT_INDEPENDENT ? LT_COMPONENTS : 1); ++c)
  {
    g_gradients_0[c] = computeGradient(positionTC, c, in_volume[0], 0);
  }
#endif
#if LT_COMPONENTS > 1 && LT_INDEPENDENT
  float total = 0.0;
  float squares = 0.0;
  vec3 color = vec3(0.0);
  for (int c = 0; c < LT_COMPONENTS; ++c)
  {
    float opacity = computeOpacity(scalar, c);
#if LT_GRADIENT_OPACITY
    opacity *= computeGradientOpacity(computeGradient(positionTC, c, in_volume[0], 0), c);
#endif
    total += opacity * in_componentWeight[c];
    squares += in_componentWeight[c] > 0.0 ? opacity * opacity : 0.0;
    color += opacity * in_componentWeight[c] * LT_COLOR_OF(scalar, c);
  }
  // as VTK composites them
  return total > 0.0 ? ltPasses(min(squares / total, 1.0), color / total) : ltVisible(1.0);
#else
  float opacity = computeOpacity(scalar);
  vec3 color = LT_COLOR_OF(scalar, 0);
#if LT_GRADIENT_OPACITY
  opacity *= computeGradientOpacity(computeGradient(positionTC, 0, in_volume[0], 0));
#endif
#if LT_MASK == 2
  float label = texture3D(in_mask, positionTC).r * in_mask_scale + in_mask_bias;
  label = in_labelMapNumLabels > 0
    ? floor(label * in_labelMapNumLabels) / in_labelMapNumLabels
    : 0.0;
  if (label != 0.0)
  {
    vec4 own = texture2D(in_labelMapTransfer, vec2(scalar.r, label));
    opacity = mix(opacity, own.a, in_maskBlendFactor);
    color = mix(color, own.rgb, in_maskBlendFactor);
  }
#endif
  return ltPasses(opacity, color);
#endif
}
#endif

// What gets through from a place towards l, as far as `reach`: midpoint rule.
ltVisible ltTransmittance(vec3 positionTC, vec3 l, float reach)
{
  vec3 perLengthTC = g_ltWCToTC * l;
  vec3 toFaces = (step(vec3(0.0), perLengthTC) - positionTC) /
    mix(perLengthTC, vec3(1e-20), equal(perLengthTC, vec3(0.0)));
  float end = min(min(reach, toFaces.x), min(toFaces.y, toFaces.z));
  // The sample distance is one of the data's coordinates, as VTK's rays have it.
  float stepWC = in_sampleDistance / length(mat3(in_inverseVolumeMatrix[0]) * l);
  ltVisible transmittance = ltVisible(1.0);
#if LT_TRANSFER_2D
  vec4 gradients[4];
  for (int c = 0; c < (LT_INDEPENDENT ? LT_COMPONENTS : 1); ++c)
  {
    gradients[c] = g_gradients_0[c];
  }
#endif
#if LT_BLEND_ISOSURFACE
  float last = ltScalarAt(positionTC).r;
#endif
  for (float t = 0.5 * stepWC; t < end && dot(transmittance, ltVisible(1.0)) > 0.002; t += stepWC)
  {
#if LT_BLEND_ISOSURFACE
    transmittance *= ltPassesAt(positionTC + t * perLengthTC, last);
#else
    transmittance *= ltPassesAt(positionTC + t * perLengthTC);
#endif
  }
#if LT_TRANSFER_2D
  for (int c = 0; c < (LT_INDEPENDENT ? LT_COMPONENTS : 1); ++c)
  {
    g_gradients_0[c] = gradients[c];
  }
#endif
  return transmittance;
}
#endif

// The light that a place of this colour sends to the eye; the opacity is that over a sample distance.
vec3 ltLit(vec3 color, float opacity, int component, vec3 positionTC)
{
  vec3 gradient = ltGradient(positionTC, component);
  float magnitude = length(gradient);
  vec3 n = gradient / max(magnitude, 1e-20);
  float surface = smoothstep(0.5, 2.0, magnitude / in_ltGradientThreshold[component]);
  n = dot(n, g_ltViewWC) < 0.0 ? -n : n;

  // A surface is not shadowed by itself: what reaches it is looked up a little before it. Nor is
  // what is opaque within that length, such as a cut through dense matter.
#if LT_LOOKS_UP || LT_SHADOW == 2
  float depth = -log(max(1.0 - opacity, 1e-6)) * g_ltSamplesTowardsEye;
  vec3 before = mix(smoothstep(1.0, 4.0, depth) * g_ltTowardsEye, ltOffset(n), surface);
  vec3 beforeTC = positionTC + g_ltWCToTC * before;
#endif
#if LT_LOOKS_UP
  vec3 positionVC = (g_ltTCToVC * vec4(beforeTC, 1.0)).xyz;
#if LT_EXACT_TEXTURES > 0
  vec4 fields[LT_EXACT_TEXTURES];
  ltFetchExact(positionVC, fields);
#endif
#if LT_HARMONICS > 0
  vec4 texels[LT_HARMONICS];
  ltFetchHarmonics(positionVC, texels);
#endif
#endif

  float occlusion = 1.0;
#if LT_MEAN == 1
  occlusion = ltMeanOf(fields);
#elif LT_MEAN == 2
  occlusion = ltMeanOf(texels);
#endif
  vec3 sum = in_ambient[component] * color * mix(1.0, occlusion, in_ltOcclusionStrength);

#if LT_LIGHTS > 0
#if LT_POSITIONAL
  vec3 positionWC = (g_ltTCToWC * vec4(positionTC, 1.0)).xyz;
#else
  vec3 positionWC = vec3(0.0);
#endif
  for (int i = 0; i < LT_LIGHTS; ++i)
  {
    float intensity;
    float reach;
    vec3 l = ltTowards(i, positionWC, intensity, reach);
    ltVisible v = ltVisible(1.0);
#if LT_SHADOW == 2
    v = ltTransmittance(beforeTC, l, reach);
#elif LT_EXACT > 0 && LT_HARMONICS > 0 && LT_LIGHTS > LT_EXACT
    v = i < LT_EXACT ? ltExactOf(min(i, LT_EXACT - 1), fields)
                     : ltVisible(ltVisibilityOf(i - LT_EXACT, l, texels));
#elif LT_EXACT > 0
    v = ltExactOf(min(i, LT_EXACT - 1), fields);
#elif LT_HARMONICS > 0
    v = ltVisible(ltVisibilityOf(i, l, texels));
#endif
    ltVisible arriving = intensity * mix(ltVisible(1.0), v, in_ltShadowStrength);
    vec3 diffuse;
    vec3 specular;
    ltReflect(n, l, g_ltViewWC, color, component, diffuse, specular);
    vec3 scattered = in_diffuse[component] * ltPhase(-dot(l, g_ltViewWC)) * color;
    sum += arriving *
      (ltLightTexel(i, 1).rgb * mix(scattered, diffuse, surface) +
        ltLightTexel(i, 2).rgb * (surface * specular));
  }
#endif

#if LT_ENVIRONMENT
  // The cosine lobe over pi has the band factors 1, 2/3; the phase function 1, g.
  mat3 toData = mat3(in_ltWorldToData);
  vec4 lobe = vec4(0.28209479, 0.48860251 *
      (surface * 0.66666667 * (toData * n) -
        (1.0 - surface) * in_ltAnisotropy * (toData * g_ltViewWC)).yzx);
  vec3 around = vec3(dot(lobe, ltArriving(0, texels)), dot(lobe, ltArriving(1, texels)),
    dot(lobe, ltArriving(2, texels)));
  sum += in_diffuse[component] * color * clamp(around, vec3(0.0), in_ltEnvironmentMost);
#endif
  return sum;
}

vec4 computeLighting(vec4 color, int component, float label)
{
#if LT_GRADIENT_OPACITY || LT_LABEL_GRADIENT_OPACITY || LT_MIXED
  vec4 stock = ltStockLighting(color, component, label);
  color.a = stock.a;
#endif
#if !LT_DEFERRED
  vec3 lit = ltLit(color.rgb, color.a, component, g_dataPos);
#if LT_MIXED
  lit = mix(stock.rgb, lit, in_ltLightingStrength);
#endif
  color.rgb = lit;
#endif
  return color;
}

// VTK clamps the colour of a sample: not to 1, which is for the picture's end.
vec4 ltUnclamped(vec4 color, float lo, float hi)
{
  return vec4(max(color.rgb, vec3(lo)), clamp(color.a, lo, hi));
}
#define clamp(value, lo, hi) ltUnclamped(value, lo, hi)
