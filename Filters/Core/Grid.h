// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Grid_h
#define LightTransport_Core_Grid_h

#include <algorithm>
#include <array>
#include <cstdint>

namespace lighttransport
{
/**
 * A box of voxels, x fastest. Values stand at voxel centres, which lie
 * `spacing` (length units, > 0) apart; the box ends half a spacing beyond the
 * outermost centres.
 */
struct Grid
{
  std::array<int, 3> dims{ { 0, 0, 0 } };
  std::array<double, 3> spacing{ { 1., 1., 1. } };

  std::int64_t size() const { return static_cast<std::int64_t>(dims[0]) * dims[1] * dims[2]; }
  std::int64_t index(int i, int j, int k) const
  {
    return i + dims[0] * (j + static_cast<std::int64_t>(dims[1]) * k);
  }
  double voxelVolume() const { return spacing[0] * spacing[1] * spacing[2]; }
  /** Of the axes that have more than one voxel, or of all if none has. */
  double smallestSpacing() const
  {
    double smallest = 0.;
    for (int a = 0; a < 3; ++a)
    {
      if (dims[a] > 1 && !(smallest > 0. && smallest <= spacing[a]))
      {
        smallest = spacing[a];
      }
    }
    return smallest > 0. ? smallest : *std::min_element(spacing.begin(), spacing.end());
  }
};
} // namespace lighttransport

#endif
