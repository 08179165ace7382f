// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** The extinction of what a volume mapper draws: what shadows are computed from. Private. */
#ifndef VolumeExtinction_h
#define VolumeExtinction_h

#include "vtkType.h" // for vtkMTimeType

#include <string>
#include <vector>

class vtkGPUVolumeRayCastMapper;
class vtkImageData;
class vtkVolume;

/**
 * Values per point of the grid along each axis, so that this has at most 1.25 resolution^3 points:
 * 1, then more first where the values are closest.
 */
void VolumeExtinctionSteps(const int n[3], const double spacing[3], int resolution, int steps[3]);

/** Everything on which VolumeExtinction depends, to be compared: equal, no need to compute. */
std::vector<double> VolumeExtinctionKey(
  vtkGPUVolumeRayCastMapper* mapper, vtkVolume* volume, int resolution, bool colored);

/**
 * The array "Extinction" (float, 1/length of the data's coordinates) of the volume as the mapper
 * would composite it: scalar and gradient opacity or 2-D transfer functions, components, masks,
 * cropping and clipping, sigma_t = -ln(1 - opacity) / unit distance, the opacity at most 0.9999.
 * Of isosurfaces: as dense where one passes between two points as makes the depth of the opacity
 * of its value, across it.
 * A mean over each point of the grid, whose steps are VolumeExtinctionSteps': of the values in a
 * step, or of interpolated ones between neighbours, as thin layers need it that are drawn
 * interpolated. Around it a margin of one transparent step: what lies at the border can be
 * seen from outside. NaN is transparent. `colored`: of red, green and blue, by the colour that is
 * drawn (vtkVisibilityFactorFilter::GetTransportColor). Returns what is wrong with the input, or
 * nothing.
 */
std::string VolumeExtinction(vtkGPUVolumeRayCastMapper* mapper, vtkVolume* volume, int resolution,
  bool colored, vtkImageData* result);

#endif
