// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkBucketedKBufferPass, blending stage with stylisation: the fragment shader of a
// quad over the viewport. Defined before: vtkBucketedKBufferCurvature.glsl, LT_ROOM, LT_LINES (1:
// vtkBucketedKBufferLines.glsl too).

in vec2 texCoord;
#if LT_WRITE_DEPTH
uniform sampler2D ltOpaqueDepth; // DC; becomes that of the nearest opaque layer
#endif
#if LT_READ_TARGET
uniform sampler2D ltTarget; // what is behind, premultiplied; else blended by the machine
#endif

uniform vec2 ltDepthRange;      // of the function's z: distances of 0 and of 1
uniform samplerBuffer ltShading; // of a style: factors of RGB at 256 kappas in [-1,1]; A: next R
uniform samplerBuffer ltOpacity; // of a style: 63^2 cells over |kappa| and z, four corners each

#if LT_ONE_STYLE
vec4 ltSwitches;
#endif

// -1 convex, 0 flat, 1 concave; a missing neighbour is -1, a contour.
float ltKappa(bool complete, float trace)
{
  return complete ? -tanh(clamp(ltCurvatureScale * trace, -10.0, 10.0)) : -1.0;
}

float ltDepthOf(float z)
{
  return clamp((-z - ltDepthRange.x) / (ltDepthRange.y - ltDepthRange.x), 0.0, 1.0);
}

// Radiance scaling of Vergne et al. 2010 (their equation of sigma): delta is the
// reflectance of a light at the eye, n . v; where it is the invariant point nothing
// changes, above it convex parts become brighter and concave ones darker.
float ltRadianceScale(float kappa, float delta, float strength)
{
  const float alpha0 = 0.2;
  float e = exp(kappa * strength);
  return (alpha0 * e + delta * (1.0 - alpha0 * (1.0 + e))) /
    (alpha0 + delta * (e - alpha0 * (1.0 + e)));
}

vec4 ltStylise(vec4 color, uint style, ltSurfacePoint s, float trace, ivec2 p, uint place)
{
#if LT_ONE_STYLE
  vec4 switches = ltSwitches;
#else
  vec4 switches = texelFetch(ltParameters, 4 * int(style));
#endif
  float kappa = ltKappa(s.complete, trace);
  vec3 result = color.rgb;
  float alpha = color.a;
#if LT_SHADE
  float shade = 255.0 * (0.5 + 0.5 * kappa);
  int below = min(int(shade), 254);
  vec4 texel = texelFetch(ltShading, 256 * int(style) + below);
  vec3 factor = vec3(mix(texel.r, texel.a, shade - float(below)));
#if LT_SHADE_COLORS
  vec3 next = texelFetch(ltShading, 256 * int(style) + below + 1).rgb;
  factor = mix(texel.rgb, next, shade - float(below));
#endif
  result *= switches.x > 0.0 ? factor : vec3(1.0);
#endif
#if LT_RADIANCE
  float delta = clamp(abs(dot(s.normal, ltViewVC(s.position))), 0.0, 1.0);
  result *= switches.z > 0.0 ? ltRadianceScale(kappa, delta, switches.z) : 1.0;
#endif
#if LT_OPACITY
  vec2 at = vec2(abs(kappa), ltDepthOf(s.position.z)) * 63.0;
  ivec2 cell = min(ivec2(at), ivec2(62));
  vec4 corners = texelFetch(ltOpacity, (63 * int(style) + cell.y) * 63 + cell.x);
  at -= vec2(cell);
  vec2 pair = mix(corners.xy, corners.zw, at.y);
  alpha = switches.y > 0.0 ? mix(pair.x, pair.y, at.x) : alpha;
#endif
#if LT_LINES
  vec4 line = texelFetch(ltParameters, 4 * int(style) + 2);
  float coverage = ltLineCoverage(s, p, int(place), style) * line.a;
  // The line is a layer over this one.
  float lined = coverage + (1.0 - coverage) * alpha;
  result = (coverage * line.rgb + (1.0 - coverage) * alpha * result) / max(lined, 1e-6);
  alpha = lined;
#endif
  return vec4(result, alpha);
}

void main()
{
  ivec2 p = ivec2(texCoord * vec2(ltSize));
  int pixel = p.y * ltSize.x + p.x;
  uvec4 here = texelFetch(ltPixels, pixel);
  if (here.y == 0u && here.w == 0u)
  {
    discard;
  }
  ltLookAround(p);
#if LT_ONE_STYLE
  ltSwitches = texelFetch(ltParameters, 0);
#endif
  vec3 color = vec3(0.0);
  float transparency = 1.0;
#if LT_WRITE_DEPTH
  float depth = texelFetch(ltOpaqueDepth, p, 0).r;
#endif
  int count = ltFragments(here.xy);
  for (int rank = 0; rank < count; ++rank)
  {
    uint item = texelFetch(ltNodeList, int(here.x) + rank).x;
    uint i = item >> 26u;
    uint place = here.x + i;
    uint node = item & 0x3FFFFFFu;
    vec4 c = ltGetColor(node);
#if LT_ONE_STYLE
    uint style = 0u;
#else
    uint style = ltGetSurface(node).x >> 24u;
#endif
    ltSurfacePoint s = ltPointAt(p, place);
    vec3 t1;
    vec3 t2;
    vec3 w = ltShapeOperator(s, p, place, texelFetch(ltNeighbors, int(place)).x, t1, t2);
    vec4 styled = ltStylise(c, style, s, w.x + w.z, p, place);
    c = s.styled ? styled : c;

#if LT_WRITE_DEPTH
    depth = c.a > 0.998 ? min(depth, ltZToDepthDC(s.position.z)) : depth;
#endif
    color += transparency * c.a * c.rgb;
    transparency *= 1.0 - c.a;
  }
  vec4 tail = vec4(unpackHalf2x16(here.z), unpackHalf2x16(here.w));
  color += transparency * tail.a * tail.rgb;
  transparency *= 1.0 - tail.a;
  vec4 result = vec4(color, 1.0 - transparency);
#if LT_READ_TARGET
  result += transparency * texelFetch(ltTarget, p, 0);
#endif
#if LT_WRITE_DEPTH
  gl_FragDepth = depth;
#endif
  gl_FragData[0] = result;
}
