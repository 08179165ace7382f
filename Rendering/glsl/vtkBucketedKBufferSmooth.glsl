// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, curvature stage (compute), for lines only: the tensors averaged
// with those of the neighbours. The normals of a mesh are interpolated, so their derivative
// jumps from triangle to triangle, and the derivative of that, which lines are made of,
// would show the mesh. Defined before: vtkBucketedKBufferCurvature.glsl.

layout(local_size_x = 64) in;
layout(rgba32ui, binding = 0) writeonly uniform uimageBuffer ltTensor;

uniform usamplerBuffer ltTensors; // before

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
    int place = int(here.x + i);
    uvec4 own = texelFetch(ltTensors, place);
    uint neighbors = own.w;
    vec4 sum = vec4(0.0);
    vec2 rest = vec2(0.0);
    float weight = 0.0;
    for (int side = -1; side < 4; ++side)
    {
      int n = side < 0 ? 1 : int((neighbors >> uint(8 * max(side, 0))) & 255u);
      int at = side < 0 || n == 0 ? place : ltFirsts[max(side, 0)] + n - 1;
      uvec4 t = texelFetch(ltTensors, at);
      float use = n > 0 && ltComplete(t.w) ? 1.0 : 0.0;
      sum += use * vec4(unpackHalf2x16(t.x), unpackHalf2x16(t.y));
      rest += use * unpackHalf2x16(t.z);
      weight += use;
    }
    sum /= max(weight, 1.0);
    rest /= max(weight, 1.0);
    imageStore(ltTensor, int(place), uvec4(packHalf2x16(sum.xy), packHalf2x16(sum.zw), packHalf2x16(rest), own.w));
  }
}
