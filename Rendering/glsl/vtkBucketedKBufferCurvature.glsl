// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass: curvature of a surface at a fragment, from its neighbours
// (as Vergne et al. 2009, but in VC lengths). Defined before:
// vtkBucketedKBufferPixel.glsl.

uniform float ltCurvatureScale; // s, a length
uniform samplerBuffer ltParameters; // of a style: 4; vtkCurvatureOpacityProperty::GetParameters

struct ltSurfacePoint
{
  vec3 position; // VC
  vec3 normal;   // VC, outward
  bool styled;   // it has a normal
  bool complete; // all four neighbours are there
  ivec4 at;      // the neighbours' places in ltRecords; -1: missing
};

ltSurfacePoint ltPointAt(ivec2 p, uint place)
{
  ltSurfacePoint s;
  uvec2 record = texelFetch(ltRecords, int(place)).xy;
  s.position = ltPositionVC(p, uintBitsToFloat(record.x));
  s.normal = ltUnpackNormal(record.y);
  s.styled = record.y != LT_NO_NORMAL;
  s.complete = false;
  s.at = ivec4(-1);
  return s;
}

const ivec2 ltSides[4] = ivec2[4](ivec2(1, 0), ivec2(0, 1), ivec2(-1, 0), ivec2(0, -1));

ivec4 ltFirsts; // fragments of the pixels at ltSides

void ltLookAround(ivec2 p)
{
  for (int side = 0; side < 4; ++side)
  {
    ivec2 q = clamp(p + ltSides[side], ivec2(0), ltSize - 1);
    ltFirsts[side] = int(texelFetch(ltPixels, q.y * ltSize.x + q.x).x);
  }
}

bool ltComplete(uint neighbors)
{
  return (neighbors & 255u) > 0u && (neighbors & 0xFF00u) > 0u && (neighbors & 0xFF0000u) > 0u &&
    neighbors > 0xFFFFFFu;
}

// The derivative W of the normal along the surface, n(x + d) = n(x) + W d, by least
// squares over the neighbours, in tangents t1 and t2: xx, xy (symmetric part), yy. Its
// trace is k1 + k2: a sphere of radius R with outward normals has 2/R exactly, however
// large the pixels are.
vec3 ltShapeOperator(inout ltSurfacePoint s, ivec2 p, uint place, uint neighbors, out vec3 t1,
  out vec3 t2)
{
  t1 = normalize(abs(s.normal.x) > 0.5 ? vec3(s.normal.y, -s.normal.x, 0.0)
                                       : vec3(0.0, s.normal.z, -s.normal.y));
  t2 = cross(s.normal, t1);
  vec3 a = vec3(0.0); // sum of d d^T: xx, xy, yy
  vec4 b = vec4(0.0); // sum of dn d^T: xx, xy, yx, yy
  for (int side = 0; side < 4; ++side)
  {
    int i = int((neighbors >> uint(8 * side)) & 255u) - 1;
    int at = i < 0 ? int(place) : ltFirsts[side] + i;
    s.at[side] = i < 0 ? -1 : at;
    ltSurfacePoint o = ltPointAt(i < 0 ? p : p + ltSides[side], uint(at));
    vec3 d3 = o.position - s.position;
    vec3 n3 = o.normal - s.normal;
    vec2 d = vec2(dot(d3, t1), dot(d3, t2));
    vec2 n = vec2(dot(n3, t1), dot(n3, t2));
    a += vec3(d.x * d.x, d.x * d.y, d.y * d.y);
    b += vec4(n.x * d.x, n.x * d.y, n.y * d.x, n.y * d.y);
  }
  s.complete = ltComplete(neighbors);
  float det = a.x * a.z - a.y * a.y;
  if (det <= 1e-12 * (a.x + a.z) * (a.x + a.z))
  {
    return vec3(0.0);
  }
  // W = B A^-1
  float wxx = b.x * a.z - b.y * a.y;
  float wxy = b.y * a.x - b.x * a.y;
  float wyx = b.z * a.z - b.w * a.y;
  float wyy = b.w * a.x - b.z * a.y;
  return vec3(wxx, 0.5 * (wxy + wyx), wyy) / det;
}
