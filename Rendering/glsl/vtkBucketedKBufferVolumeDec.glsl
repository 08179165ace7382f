// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, geometry stage, in the fragment shader of a volume: what the
// ray gathers between two surfaces becomes a node of the pixel's list, as if it were a
// fragment. Serves VTK::ComputeLighting::Dec, before it. Defined before:
// vtkBucketedKBufferStore.glsl, LT_VOLUME_SURFACES; VTK's WindowToNDC (later),
// ip_inverseTextureDataAdjusted, in_inverseVolumeMatrix, in_inverseModelViewMatrix,
// in_inverseProjectionMatrix.

vec4 WindowToNDC(const float xCoord, const float yCoord, const float zCoord);

uint ltSurfaceBits[LT_VOLUME_SURFACES];  // of the depths in DC, in order
float ltSurfaceStep[LT_VOLUME_SURFACES]; // where along the ray, in steps
int ltSurfaces = 0;
int ltNextSurface = 0;

// The surfaces of the pixel; more than there is room for: the nearest.
void ltFindSurfaces()
{
  uint node = imageLoad(ltHead, int(gl_FragCoord.y) * ltWidth + int(gl_FragCoord.x)).x;
  while (node != LT_NONE && node < uint(ltCapacity))
  {
    uvec2 link = imageLoad(ltLink, int(node)).xy;
    uint bits = link.y >> 1u;
    int i = ltSurfaces;
    ltSurfaces = min(ltSurfaces + 1, LT_VOLUME_SURFACES);
    i = min(i, LT_VOLUME_SURFACES);
    while (i > 0 && bits < ltSurfaceBits[i - 1])
    {
      if (i < LT_VOLUME_SURFACES)
      {
        ltSurfaceBits[i] = ltSurfaceBits[i - 1];
      }
      --i;
    }
    if (i < LT_VOLUME_SURFACES)
    {
      ltSurfaceBits[i] = bits;
    }
    // Where nothing is drawn llvmpipe reads zeros, round and round, which uses up the
    // iterations that it allows to all loops together.
    node = link.x == node ? LT_NONE : link.x;
  }
  // As VTK finds where a ray ends: DC -> texture coordinates, then along the step.
  for (int i = 0; i < ltSurfaces; ++i)
  {
    vec4 place = WindowToNDC(gl_FragCoord.x, gl_FragCoord.y, uintBitsToFloat(ltSurfaceBits[i]));
    place = ip_inverseTextureDataAdjusted * in_inverseVolumeMatrix[0] * in_inverseModelViewMatrix *
      in_inverseProjectionMatrix * place;
    ltSurfaceStep[i] =
      dot(place.xyz / place.w - g_dataPos, g_dirStep) / max(dot(g_dirStep, g_dirStep), 1e-30);
  }
  ltNextSurface = 0;
}

// What the ray has gathered since the last node, in front of the next surface, with
// the mapper's final colour correction.
void ltStoreSegment(float scale, float bias)
{
  float a = g_fragColor.a;
  if (a > 0.0)
  {
    uint bits = ltNextSurface > 0 ? ltSurfaceBits[ltNextSurface - 1] + 1u
                                  : floatBitsToUint(clamp(gl_FragCoord.z, 0.0, 1.0));
    if (ltNextSurface < ltSurfaces)
    {
      uint next = ltSurfaceBits[ltNextSurface];
      bits = next > 0u ? min(bits, next - 1u) : 0u;
    }
    vec3 color = g_fragColor.rgb / a * scale + bias;
    ltStore(vec4(color, a), uintBitsToFloat(bits), 0u, LT_NO_NORMAL);
  }
  g_fragColor = vec4(0.0);
}

