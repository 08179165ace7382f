
// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: ray ends    Stage: fragment
// Tag:     VTK::Shading::Exit, after it; g_fragColor is the projection.
#if LT_FIELD && (LT_BLEND == 2 || LT_BLEND == 3)
g_fragColor = ltComposeProjection(g_fragColor);
#endif
#if LT_DEFERRED
// The ray's colour, as far as it has one, lit where it was hit.
if (g_fragColor.a > 0.0)
{
  vec3 lt_lit = ltLit(g_fragColor.rgb / g_fragColor.a, 1.0, 0, lt_hitTC) * g_fragColor.a;
  g_fragColor.rgb = mix(g_fragColor.rgb, lt_lit, in_ltLightingStrength);
}
#endif
