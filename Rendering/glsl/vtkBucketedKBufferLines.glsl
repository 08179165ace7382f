// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, blending stage: feature lines of a layer. Each kind of line is
// where a function f of the surface is 0; its distance from the pixel's centre is
// |f| / |grad f|, with the gradient per pixel from the four neighbours on the surface:
// so lines are as wide as is asked for in pixels, and antialiased. Defined before:
// vtkBucketedKBufferCurvature.glsl.
//
// W is the derivative of the outward normal (see vtkBucketedKBufferTensor.glsl), here
// in 1/pixel; v points to the eye.

uniform usamplerBuffer ltTensors;

struct ltFeature
{
  vec3 position; // VC
  vec3 normal;   // VC, outward
  mat3 w;        // VC, in 1/footprint
  bool complete;
};

ltFeature ltFeatureAt(ivec2 p, int place)
{
  ltSurfacePoint s = ltPointAt(p, uint(place));
  uvec4 t = texelFetch(ltTensors, place);
  vec2 a = unpackHalf2x16(t.x);
  vec2 b = unpackHalf2x16(t.y);
  vec2 c = unpackHalf2x16(t.z);
  ltFeature f;
  f.position = s.position;
  f.normal = s.normal;
  f.w = mat3(a.x, a.y, b.x, a.y, b.y, c.x, b.x, c.x, c.y);
  f.complete = ltComplete(t.w);
  return f;
}

// How much of a pixel a line of a width (pixels) covers, at a distance from its middle.
float ltCoverage(float distance, float width)
{
  return clamp(0.5 * width + 0.5 - distance, 0.0, 1.0) * min(width, 1.0);
}

// Distance in pixels of f's zero, f and its values right, up, left and down.
float ltZeroDistance(float f, vec4 around)
{
  vec2 gradient = 0.5 * (around.xy - around.zw);
  return abs(f) / max(length(gradient), 1e-8);
}

// The towards-the-eye part of the surface's tangents, and how far it is turned away.
float ltRadialCurvature(ltFeature f)
{
  vec3 v = ltViewVC(f.position);
  vec3 n = dot(f.normal, v) < 0.0 ? -f.normal : f.normal;
  vec3 w = v - dot(v, n) * n;
  // Of the side that is seen: a surface seen from inside is curved the other way.
  float side = dot(f.normal, v) < 0.0 ? -1.0 : 1.0;
  return side * dot(w, f.w * w) / max(dot(w, w), 1e-6);
}

// Eigenvalues (larger magnitude first) and the first one's direction in tangents.
vec2 ltPrincipal(ltFeature f, out vec3 direction)
{
  vec3 t1 = normalize(abs(f.normal.x) > 0.5 ? vec3(f.normal.y, -f.normal.x, 0.0)
                                            : vec3(0.0, f.normal.z, -f.normal.y));
  vec3 t2 = cross(f.normal, t1);
  float a = dot(t1, f.w * t1);
  float b = dot(t1, f.w * t2);
  float d = dot(t2, f.w * t2);
  float mean = 0.5 * (a + d);
  float half_ = sqrt(0.25 * (a - d) * (a - d) + b * b);
  float first = mean >= 0.0 ? mean + half_ : mean - half_;
  vec2 e = abs(first - a) > abs(first - d) ? vec2(b, first - a) : vec2(first - d, b);
  e = dot(e, e) > 1e-16 ? normalize(e) : vec2(1.0, 0.0);
  direction = e.x * t1 + e.y * t2;
  return vec2(first, 2.0 * mean - first);
}

// The third derivatives along the surface: W's change along x and y of the screen
// becomes its change along a tangent g of unit length in footprints.
float ltThird(mat3 wx, mat3 wy, vec3 px, vec3 py, vec3 g)
{
  // g = a px + b py, by least squares
  float xx = dot(px, px);
  float xy = dot(px, py);
  float yy = dot(py, py);
  float det = max(xx * yy - xy * xy, 1e-12);
  float gx = dot(g, px);
  float gy = dot(g, py);
  float a = (yy * gx - xy * gy) / det;
  float b = (xx * gy - xy * gx) / det;
  return a * dot(g, wx * g) + b * dot(g, wy * g);
}

// kinds: occluding, suggestive, ridges and valleys, demarcating; widths in pixels, 0: off.
float ltLineCoverage(ltSurfacePoint s, ivec2 p, int place, uint style)
{
  vec4 widths = texelFetch(ltParameters, 4 * int(style) + 1);
  // The least curvature of a line, and the least change of it, above the normals' rounding.
  float unit = ltFootprintAt(s.position.z) / ltCurvatureScale;
  float threshold = texelFetch(ltParameters, 4 * int(style)).w;
  float strength = threshold * unit;
  float change = max(threshold * unit * unit, 2e-5);
  ltFeature f = ltFeatureAt(p, place);
  vec3 v = ltViewVC(s.position);
  float facing = dot(f.normal, v);
  ltFeature o[4];
  vec4 facings;
  vec4 radials;
  bool allComplete = f.complete;
  for (int side = 0; side < 4; ++side)
  {
    int at = s.at[side] < 0 ? place : s.at[side];
    o[side] = ltFeatureAt(s.at[side] < 0 ? p : p + ltSides[side], at);
    facings[side] = dot(o[side].normal, ltViewVC(o[side].position));
    radials[side] = ltRadialCurvature(o[side]);
    allComplete = allComplete && o[side].complete;
  }
  float coverage = 0.0;

  // Occluding contours, n . v = 0, and where the surface ends.
  float contour = ltCoverage(ltZeroDistance(facing, facings), widths.x);
  contour = s.complete ? contour : min(widths.x, 1.0);
  coverage = max(coverage, contour);

  // Suggestive contours (DeCarlo et al. 2003): the radial curvature is 0 and grows towards
  // the eye. Not where the surface is seen straight on, where there is no such direction.
  float radial = ltRadialCurvature(f);
  vec3 tangent = v - dot(v, f.normal) * f.normal;
  vec2 gradient = 0.5 * (radials.xy - radials.zw);
  float growth = dot(gradient, tangent.xy) / max(length(tangent.xy), 1e-6);
  bool suggests = growth > change && abs(facing) > 0.05 && abs(facing) < 0.97;
  float suggestive = ltCoverage(ltZeroDistance(radial, radials), widths.y);
  coverage = max(coverage, suggests && allComplete ? suggestive : 0.0);

  // Ridges and valleys: the larger principal curvature is extreme along its direction.
  vec3 direction;
  vec2 principal = ltPrincipal(f, direction);
  vec2 step_ = direction.xy;
  float along = length(step_);
  step_ /= max(along, 1e-6);
  vec4 firsts;
  for (int side = 0; side < 4; ++side)
  {
    firsts[side] = dot(direction, o[side].w * direction);
  }
  float plus = step_.x * step_.x * (step_.x > 0.0 ? firsts.x : firsts.z) +
    step_.y * step_.y * (step_.y > 0.0 ? firsts.y : firsts.w);
  float minus = step_.x * step_.x * (step_.x > 0.0 ? firsts.z : firsts.x) +
    step_.y * step_.y * (step_.y > 0.0 ? firsts.w : firsts.y);
  float signed_ = principal.x < 0.0 ? -1.0 : 1.0;
  float bend = signed_ * (plus - 2.0 * principal.x + minus);
  float peak = 0.5 * (plus - minus) * signed_ / min(bend, -1e-8);
  bool extreme = bend < -4e-6 && abs(principal.x) > strength &&
    abs(principal.x) > 1.5 * abs(principal.y);
  coverage = max(coverage,
    extreme && allComplete && along > 0.1 ? ltCoverage(abs(peak), widths.z) : 0.0);

  // Demarcating curves (Kolomenkin et al. 2008): no curvature along the direction in which
  // it changes most: the strongest inflection from valley to ridge.
  mat3 wx = 0.5 * (o[0].w - o[2].w);
  mat3 wy = 0.5 * (o[1].w - o[3].w);
  float footprint = ltFootprintAt(s.position.z);
  vec3 px = 0.5 * (o[0].position - o[2].position) / footprint;
  vec3 py = 0.5 * (o[1].position - o[3].position) / footprint;
  vec3 t1 = normalize(px - dot(px, f.normal) * f.normal + 1e-12);
  vec3 t2 = cross(f.normal, t1);
  float most = 0.0;
  vec3 g = t1;
  for (int k = 0; k < 12; ++k)
  {
    float angle = 3.14159265 * float(k) / 12.0;
    vec3 candidate = cos(angle) * t1 + sin(angle) * t2;
    float third = ltThird(wx, wy, px, py, candidate);
    bool better = abs(third) > abs(most);
    most = better ? third : most;
    g = better ? candidate : g;
  }
  float curvature = dot(g, f.w * g);
  float distance = abs(curvature) / max(abs(most), 1e-8) * length(g.xy);
  bool demarcates = abs(most) > change;
  coverage = max(coverage, demarcates && allComplete ? ltCoverage(distance, widths.w) : 0.0);
  return coverage;
}
