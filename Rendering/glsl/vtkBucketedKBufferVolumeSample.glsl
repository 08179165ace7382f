// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, in a volume's shader: a segment ends where the sample lies
// behind the next surface. Serves VTK::Shading::Impl, before it.
while (ltNextSurface < ltSurfaces && g_currentT >= ltSurfaceStep[ltNextSurface])
{
  ltStoreSegment(in_scale, in_bias);
  ++ltNextSurface;
}
