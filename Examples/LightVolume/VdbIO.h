// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * OpenVDB in and out. All of OpenVDB's templates are in VdbIO.cxx: that file alone takes
 * half a minute to compile.
 */
#ifndef LightVolume_VdbIO_h
#define LightVolume_VdbIO_h

#include "Volume.h"

namespace lightvolume
{
/**
 * A float (or double, int, bool) grid as a dense volume: its active bounding box, the
 * background outside active voxels. gridName empty: the first grid that will do.
 */
Volume ReadVdb(const std::string& path, const std::string& gridName, double maximumVoxels);

/**
 * A float grid with the image's transform: index = image index; zeros are not stored.
 * Several arrays become several grids.
 */
void WriteVdb(const std::string& path, vtkImageData* image, const std::vector<std::string>& arrays);

/** "" where this build has no OpenVDB. */
std::string OpenVdbVersion();

} // namespace lightvolume

#endif
