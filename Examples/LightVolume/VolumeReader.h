// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Reads a volume of any format of this program, told apart by its name:
 *
 *   .nii .nii.gz .hdr      NIfTI           RAS
 *   .mha .mhd              MetaImage       LPS turned into RAS
 *   .nrrd .nhdr            NRRD            LPS or LAS turned into RAS
 *   a folder, .dcm .ima    DICOM           LPS turned into RAS; the largest series
 *   .vti                   VTK image       as it is
 *   .sgy .segy             SEG-Y           CDP coordinates, minus time
 *   .vdb                   OpenVDB         as it is
 */
#ifndef LightVolume_VolumeReader_h
#define LightVolume_VolumeReader_h

#include "Volume.h"

namespace lightvolume
{
struct ReadOptions
{
  int Frame = 0;
  int Component = 0;
  std::string Array;     // VTI: point array; VDB: grid. Empty: the active or first one.
  int InlineByte = 0;    // SEG-Y
  int CrosslineByte = 0; // SEG-Y
  double ZScale = 1.;    // SEG-Y: world z per ms
};

/**
 * Throws an Error of one line when the file is missing, unreadable, truncated or of another
 * format, has a spacing of zero or an infinite value, or does not fit into memory.
 */
Volume ReadVolume(const std::string& path, const ReadOptions& options);

/** Bytes this machine can still give; a large number where that is not known. */
double AvailableMemory();

} // namespace lightvolume

#endif
