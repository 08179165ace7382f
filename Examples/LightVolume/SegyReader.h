// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A post-stack 3-D SEG-Y file (segyio), as axes i = inline, j = crossline, k = time or depth.
 *
 * Traces are put at their inline and crossline numbers, whatever their order in the file;
 * line steps are the greatest common divisor of the numbers. World x and y are the CDP
 * coordinates, scaled by the coordinate scalar, where a plane fits them; world z is minus the
 * time in ms (or depth in the file's unit), so that down is down. One ms is drawn as one metre
 * unless the caller scales z.
 *
 * Nothing was measured (NaN): missing and dead traces, traces of zeros alone, samples of
 * -999.25 and of 1e30 and more, and non-finite ones.
 */
#ifndef LightVolume_SegyReader_h
#define LightVolume_SegyReader_h

#include "Volume.h"

namespace lightvolume
{
/** Header bytes (from 1) of the line numbers; 0: 189 and 193, else 9 and 21, else 5 and 21. */
Volume ReadSegy(const std::string& path, int inlineByte, int crosslineByte, double zScale);

} // namespace lightvolume

#endif
