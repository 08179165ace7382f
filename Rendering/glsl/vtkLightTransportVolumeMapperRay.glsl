// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
// Class:   vtkLightTransportVolumeMapper    Part: geometry of rays    Stage: fragment
// Tag:     VTK::ComputeLighting::Dec, before it and before all other parts.
// Needs:   from VTK's declarations in_textureDatasetMatrix, in_cellToPoint.
// Defines: ltTCToData, once however often it is included; TC are the volume's texture coordinates, as g_dataPos.

#ifndef LT_RAY
#define LT_RAY
// Affine: TC -> coordinates of the data. VTK's TC have half a voxel less at either end for
// point data; in_cellToPoint (a scale and a shift) undoes that.
mat4 ltTCToData()
{
  vec3 scale = vec3(in_cellToPoint[0][0][0], in_cellToPoint[0][1][1], in_cellToPoint[0][2][2]);
  // A single slice of points has no extent, and a scale of 0.
  scale = mix(vec3(1.0) / max(scale, vec3(1e-20)), vec3(0.0), equal(scale, vec3(0.0)));
  mat4 pointToCell = mat4(1.0);
  pointToCell[0][0] = scale.x;
  pointToCell[1][1] = scale.y;
  pointToCell[2][2] = scale.z;
  pointToCell[3].xyz = -scale * in_cellToPoint[0][3].xyz;
  return in_textureDatasetMatrix[0] * pointToCell;
}
#endif

