// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A volume as every reader of this program hands it over: one scalar component on
 * a vtkImageData whose direction matrix is a rotation, and how it lies in the world.
 *
 * World coordinates are RAS (x to the patient's right-to-left axis' end R, y to A,
 * z to S: each grows towards that letter) in millimetres where the file says how the
 * patient lies, and the file's own coordinates where it does not.
 */
#ifndef LightVolume_Volume_h
#define LightVolume_Volume_h

#include "vtkImageData.h"
#include "vtkSmartPointer.h"

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

namespace lightvolume
{
/** One line for the user: what, its value, what was expected. */
class Error : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};

/** A 4x4 matrix, row by row, whose last row is 0 0 0 1. */
using Affine = std::array<double, 16>;

Affine Identity();
std::array<double, 3> Apply(const Affine& m, double i, double j, double k);
/** The same with the first two rows negated: LPS to RAS and back. */
Affine NegateXY(const Affine& m);

struct Volume
{
  vtkSmartPointer<vtkImageData> Image;
  std::string Format;        // "NIfTI", "SEG-Y", ...
  bool IsRAS = false;        // world is RAS in mm
  std::string Unit = "unit"; // of world coordinates and spacing: "mm", "m", ...
  /** Centre of the file's voxel (i, j, k) -> world. */
  Affine FileToWorld = Identity();
  /** The file's dimensions; those of Image are the same. */
  std::array<int, 3> Dimensions = { { 0, 0, 0 } };
  /** The image's axis runs against the file's (an image of its own is right-handed). */
  std::array<bool, 3> Flipped = { { false, false, false } };
  /** Index of the file's first voxel: not zero for a VTI or a VDB. */
  std::array<int, 3> FirstIndex = { { 0, 0, 0 } };
  std::array<std::string, 3> AxisNames = { { "i", "j", "k" } };
  /** Values that mean "nothing was measured here". NaN always does. */
  std::vector<double> NoData;
  /** What the reader did that the file does not say: conversions, choices. */
  std::vector<std::string> Notes;

  /** World position of the file's voxel. */
  std::array<double, 3> World(double i, double j, double k) const;
  /** The file's voxel at a world position, as real numbers. */
  std::array<double, 3> Voxel(const std::array<double, 3>& world) const;
};

/**
 * Place volume.Image (spacing, origin, direction; extent from 0) by an affine that maps
 * (i, j, k), counted from 0, to the world, and remember it in FileToWorld.
 *
 * 1. Zero, negative or non-finite columns: an Error.
 * 2. Axes that are not at right angles: up to 5 degrees the nearest orthonormal axes with
 *    a note that gives the largest displacement; beyond, an Error (resample the file).
 * 3. A left-handed triple (VTK 9.1's volume mapper draws nothing then): one axis of the
 *    data is reversed, which leaves every voxel where it was.
 * 4. With `upright` the axis along world z is made to run upwards, too.
 */
void Place(Volume& volume, const Affine& fileToWorld, bool upright = false);

std::string FormatNumber(double value);
std::string FormatPoint(const double p[3]);

} // namespace lightvolume

#endif
