// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Visibility by casting a ray per voxel and direction, the reference for the sweeps:
 * sigma_t trilinear between voxel centres and constant beyond the outermost, the
 * domain ending half a spacing there; the midpoint rule with steps of at most
 * `step` of the smallest spacing.
 */
#ifndef VisibilityReference_h
#define VisibilityReference_h

#include "Core/Grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace lighttransport
{
namespace testing
{
/** sigma_t at a place (lengths from the first voxel's centre) of the domain. */
inline double sigmaAt(const Grid& grid, const float* sigma_t, const std::array<double, 3>& place)
{
  int low[3];
  double w[3];
  for (int a = 0; a < 3; ++a)
  {
    const double last = grid.dims[a] - 1.;
    const double at = std::min(std::max(place[a] / grid.spacing[a], 0.), last);
    low[a] = std::min(static_cast<int>(at), std::max(grid.dims[a] - 2, 0));
    w[a] = at - low[a];
  }
  const std::int64_t dx = grid.dims[0] > 1 ? 1 : 0;
  const std::int64_t dy = grid.dims[1] > 1 ? grid.dims[0] : 0;
  const std::int64_t dz =
    grid.dims[2] > 1 ? static_cast<std::int64_t>(grid.dims[0]) * grid.dims[1] : 0;
  const float* s = sigma_t + grid.index(low[0], low[1], low[2]);
  const auto line = [&](std::int64_t at) { return s[at] + w[0] * (s[at + dx] - s[at]); };
  const auto plane = [&](std::int64_t at) { return line(at) + w[1] * (line(at + dy) - line(at)); };
  return plane(0) + w[2] * (plane(dz) - plane(0));
}

/** v of a place into a direction of length 1, up to `length`, the radius or the light. */
inline double castVisibility(const Grid& grid, const float* sigma_t,
  const std::array<double, 3>& place, const std::array<double, 3>& w, double step = 0.1,
  double length = std::numeric_limits<double>::infinity())
{
  double first = 0.;
  double last = length;
  for (int a = 0; a < 3; ++a)
  {
    const double low = -0.5 * grid.spacing[a] - place[a];
    const double high = (grid.dims[a] - 0.5) * grid.spacing[a] - place[a];
    if (w[a] != 0.)
    {
      first = std::max(first, std::min(low / w[a], high / w[a]));
      last = std::min(last, std::max(low / w[a], high / w[a]));
    }
    else if (low > 0. || high < 0.)
    {
      return 1.;
    }
  }
  if (!(first < last))
  {
    return 1.;
  }
  const double smallest = grid.smallestSpacing();
  const int steps = std::max(1, static_cast<int>(std::ceil((last - first) / (step * smallest))));
  const double du = (last - first) / steps;
  double sum = 0.;
  for (int i = 0; i < steps; ++i)
  {
    const double u = first + (i + 0.5) * du;
    sum +=
      sigmaAt(grid, sigma_t, { { place[0] + u * w[0], place[1] + u * w[1], place[2] + u * w[2] } });
  }
  return std::exp(-sum * du);
}
} // namespace testing
} // namespace lighttransport

#endif
