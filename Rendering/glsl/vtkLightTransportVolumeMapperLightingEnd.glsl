// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: end of the lighting    Stage: fragment
// Tag:     VTK::ComputeColor::Dec, after it.
// Needs:   VTK's colour tables, which are declared there.
// Defines: ltColorOf, which the shadow rays call.
#undef clamp

#if LT_SHADOW == 2 && LT_RGB
// The colour of a component's scalar, as VTK looks it up.
vec3 ltColorOf(vec4 scalar, int component)
{
#if LT_TRANSFER_2D
  return texture2D(in_transfer2D_0[0], vec2(scalar.r, g_gradients_0[0].w)).rgb;
#elif LT_COMPONENTS == 4 && !LT_INDEPENDENT
  return scalar.rgb;
#else
#if LT_INDEPENDENT && LT_COMPONENTS > 1
  if (component == 1)
  {
    return texture2D(in_colorTransferFunc_0[1], vec2(scalar[1], 0.0)).rgb;
  }
#endif
#if LT_INDEPENDENT && LT_COMPONENTS > 2
  if (component == 2)
  {
    return texture2D(in_colorTransferFunc_0[2], vec2(scalar[2], 0.0)).rgb;
  }
#endif
#if LT_INDEPENDENT && LT_COMPONENTS > 3
  if (component == 3)
  {
    return texture2D(in_colorTransferFunc_0[3], vec2(scalar[3], 0.0)).rgb;
  }
#endif
  return texture2D(in_colorTransferFunc_0[0], vec2(scalar[0], 0.0)).rgb;
#endif
}
#endif
