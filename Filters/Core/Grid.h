// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Grid_h
#define LightTransport_Core_Grid_h

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
};
} // namespace lighttransport

#endif
