
// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: ray ends    Stage: fragment
// Tag:     VTK::Shading::Exit, after it; g_fragColor is the projection.
#if LT_BLEND == 2 || LT_BLEND == 3
g_fragColor = ltComposeProjection(g_fragColor);
#endif
