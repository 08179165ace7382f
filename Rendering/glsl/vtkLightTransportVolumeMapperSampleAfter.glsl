
// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: after a sample    Stage: fragment
// Tag:     VTK::Shading::Impl, after it, inside the loop along the ray.
// Needs:   the part before the sample; g_dataPos is still the sample's place.
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
