// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: before a sample    Stage: fragment
// Tag:     VTK::Shading::Impl, before it, inside the loop along the ray.
// Defines: what the part after the sample compares with.
#if LT_DEFERRED || (LT_FIELD && (LT_BLEND == 0 || LT_BLEND == 1))
vec4 lt_before = g_fragColor;
#elif LT_FIELD && LT_MODE == 1
bool lt_first = l_firstValue;
#if LT_BLEND == 2
vec4 lt_before = l_maxValue;
#else
vec4 lt_before = l_minValue;
#endif
#endif
