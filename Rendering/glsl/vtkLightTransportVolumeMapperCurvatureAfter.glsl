// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: curvature, after a sample    Stage: fragment
// Tag:     VTK::Shading::Impl, after it, inside the loop along the ray.
// Needs:   the part before the sample; g_dataPos is still the sample's place.
if (!g_skip)
{
  g_fragColor = ltcCompose(ltc_before, g_fragColor, g_dataPos);
}
