// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, curvature stage (compute), for lines only: the derivative of
// the normal at each fragment as a tensor in VC, so that neighbours can compare.
// Defined before: vtkBucketedKBufferCurvature.glsl.
//
//   ltTensors[place]  xyz: W's xx, xy, xz, yy, yz, zz as half; w: neighbours, as in ltNeighbors

layout(local_size_x = 64) in;
layout(rgba32ui, binding = 0) writeonly uniform uimageBuffer ltTensor;

void main()
{
  ivec2 p = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, ltRows.x);
  if (p.x >= ltSize.x || p.y >= ltRows.y)
  {
    return;
  }
  uvec2 here = texelFetch(ltPixels, p.y * ltSize.x + p.x).xy;
  ltLookAround(p);
  for (uint i = 0u; i < uint(ltFragments(here)); ++i)
  {
    uint place = here.x + i;
    ltSurfacePoint s = ltPointAt(p, place);
    vec3 t1;
    vec3 t2;
    uint neighbors = texelFetch(ltNeighbors, int(place)).x;
    vec3 w = ltShapeOperator(s, p, place, neighbors, t1, t2);
    // In units of 1 / footprint, which half floats hold whatever the world's unit is.
    w *= ltFootprintAt(s.position.z);
    mat3 m = w.x * outerProduct(t1, t1) + w.z * outerProduct(t2, t2) +
      w.y * (outerProduct(t1, t2) + outerProduct(t2, t1));
    imageStore(ltTensor, int(place), uvec4(packHalf2x16(vec2(m[0][0], m[0][1])),
      packHalf2x16(vec2(m[0][2], m[1][1])), packHalf2x16(vec2(m[1][2], m[2][2])), neighbors));
  }
}
