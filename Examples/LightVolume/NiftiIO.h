// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * NIfTI-1 and NIfTI-2, single file or .hdr/.img, gzipped or not.
 *
 * Reading: the sform where its code is positive, else the qform, else the spacing alone
 * (then no RAS is claimed); units metre and micrometre become millimetres; scl_slope and
 * scl_inter are applied; of more than three dimensions one frame is taken.
 *
 * Writing: an 8-bit labelmap in the voxel order and with the affine of the volume it labels,
 * so that it lies on the input in any viewer.
 */
#ifndef LightVolume_NiftiIO_h
#define LightVolume_NiftiIO_h

#include "Volume.h"

#include <cstdint>

namespace lightvolume
{
Volume ReadNifti(const std::string& path, int frame, int component);

/** labels: in the voxel order of volume.Image. gzipped where the path ends in .gz. */
void WriteNiftiLabels(const std::string& path, const Volume& volume,
  const std::vector<std::uint8_t>& labels, const std::string& description);

} // namespace lightvolume

#endif
