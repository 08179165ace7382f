// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Private to the module: from VTK's images to the kernels' grids and readers.
 */
#ifndef vtkLightTransportImage_h
#define vtkLightTransportImage_h

#include "Core/Gradient.h"
#include "Core/Grid.h"
#include "Core/Parallel.h"

#include <initializer_list>
#include <string>
#include <vector>

class vtkAlgorithm;
class vtkDataArray;
class vtkDataObject;
class vtkImageData;
class vtkInformationVector;

namespace vtkLightTransportImage
{
/**
 * What is wrong with the image's geometry ("what, value, expected"), or nothing.
 * It needs a voxel, a positive finite spacing, a finite origin and directions
 * that are orthonormal to 1e-3.
 */
std::string Problem(vtkImageData* image);

/**
 * What is wrong with the point array that an algorithm reads one component of, or nothing: is it
 * there (null if not), has it a tuple per point and that component?
 */
std::string ScalarsProblem(
  vtkAlgorithm* algorithm, vtkImageData* image, vtkDataArray* scalars, int component);

/** The image's points as voxels. */
lighttransport::Grid GridOf(vtkImageData* image);

/** Same extent, spacing, origin and directions, to 1e-6 of a voxel over the whole grid. */
bool SameGeometry(vtkImageData* a, vtkImageData* b);

/**
 * Continuous indices of a world point, counted from the first point of the
 * image's extent: 0 is its first voxel's centre.
 */
void WorldToIndex(vtkImageData* image, const double world[3], double index[3]);

/** Does the index lie in the image's domain, half a voxel beyond the outer centres? */
bool Inside(const lighttransport::Grid& grid, const double index[3]);

/** The image's domain as "x0 x1, y0 y1, z0 z1" in world coordinates. */
std::string DomainAsString(vtkImageData* image);

/**
 * Reads one component of an array. NaN, values equal to one of `noData` (in the
 * array's own type) and points hidden by `ghosts` (may be null) read as NaN. The
 * array must outlive the reader.
 */
lighttransport::ValueReader Reader(vtkDataArray* array, int component,
  const std::vector<double>& noData = {}, vtkDataArray* ghosts = nullptr);

/** Asks the whole extent of every connection of every image port. */
void RequestWholeExtents(vtkInformationVector** inputs, int numberOfPorts);

/** Adds the values as an array of the field data, so that a saved file says how it was made. */
void AddFieldValues(vtkDataObject* data, const char* name, std::initializer_list<double> values);

/** Reports the algorithm's progress between two fractions; false once it is to abort. */
lighttransport::ProgressFunction Progress(vtkAlgorithm* algorithm, double from, double to);
} // namespace vtkLightTransportImage

#endif
