// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: curvature, before a sample    Stage: fragment
// Tag:     VTK::Shading::Impl, before it, inside the loop along the ray.
vec4 ltc_before = g_fragColor;
