// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A folder of DICOM files, or one multi-frame file (vtk-dicom): the largest series of the
 * folder, sorted, rescaled, placed by its patient matrix, LPS turned into RAS.
 */
#ifndef LightVolume_DicomReader_h
#define LightVolume_DicomReader_h

#include "Volume.h"

namespace lightvolume
{
Volume ReadDicom(const std::string& path, bool folder, int component);

} // namespace lightvolume

#endif
