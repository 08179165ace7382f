
// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: ray begins    Stage: fragment
// Tag:     VTK::Shading::Init, after it.
#if LT_FIELD && (LT_BLEND == 2 || LT_BLEND == 3)
g_ltProjected = ltFieldValue(0.0);
g_ltProjectedMagnitude = 0.0;
#endif
#if LT_DEFERRED
bool lt_hit = false;
vec3 lt_hitTC = g_dataPos;
float lt_hitGain = 0.0;
#endif
