
// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: after a sample    Stage: fragment
// Tag:     VTK::Shading::Impl, after it, inside the loop along the ray.
// Needs:   the part before the sample; g_dataPos is still the sample's place.
#if LT_FIELD
if (!g_skip)
{
#if LT_BLEND == 0 || LT_BLEND == 1
  g_fragColor = ltCompose(lt_before, g_fragColor, ltField(g_dataPos));
#elif LT_MODE == 1
#if LT_BLEND == 2
  bool lt_projected = lt_first || lt_before != l_maxValue;
#else
  bool lt_projected = lt_first || lt_before != l_minValue;
#endif
  if (lt_projected)
  {
    g_ltProjected = ltField(g_dataPos);
  }
#else
  ltFieldValue lt_field = ltField(g_dataPos);
  float lt_magnitude = ltMagnitude(lt_field);
  if (lt_magnitude > g_ltProjectedMagnitude)
  {
    g_ltProjected = lt_field;
    g_ltProjectedMagnitude = lt_magnitude;
  }
#endif
}
#endif

#if LT_DEFERRED
if (!g_skip && !lt_hit)
{
  float lt_gain = g_fragColor.a - lt_before.a;
  if (g_fragColor.a >= 0.5)
  {
    // Between the samples, so that the surface is no staircase of them.
    lt_hit = true;
    lt_hitTC = g_dataPos - (g_fragColor.a - 0.5) / max(lt_gain, 1e-6) * g_dirStep;
  }
  else if (lt_gain > lt_hitGain)
  {
    lt_hitGain = lt_gain;
    lt_hitTC = g_dataPos;
  }
}
#endif

#if LT_SKIPS
// On to the next sample that shows something: lighting is dear, and a sample without opacity
// changes nothing. The tag below ends this loop where it would end the outer one, which then
// ends as well.
while (computeOpacity(vec4(texture3D(in_volume[0], g_dataPos + g_dirStep)[LT_OPACITY_COMPONENT] *
           in_volume_scale[0][LT_OPACITY_COMPONENT] +
         in_volume_bias[0][LT_OPACITY_COMPONENT])) <= 0.0)
{
  g_dataPos += g_dirStep;
  //VTK::Terminate::Impl
}
#endif
