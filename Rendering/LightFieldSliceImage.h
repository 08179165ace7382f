// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The colours of one slice: anatomy below, light above. Private to
 * vtkLightFieldSlices.
 */
#ifndef LightFieldSliceImage_h
#define LightFieldSliceImage_h

#include "LightFieldSliceFrame.h"

#include "vtkType.h"

#include <vector>

class vtkDataArray;
class vtkImageData;
class vtkLightFieldProperty;
class vtkPolyData;

namespace lighttransport
{
/**
 * A point array of an image at any world point: trilinear between points, constant
 * in the outer half of the border voxels. NaN points have no weight; where the
 * nearest point is NaN there is no value.
 */
class FieldSampler
{
public:
  FieldSampler() = default;
  FieldSampler(vtkImageData* image, vtkDataArray* array);

  explicit operator bool() const { return this->Array != nullptr; }
  vtkDataArray* GetArray() const { return this->Array; }

  /** False outside of the image's domain, and where there is no value. */
  bool Sample(const Vector3& world, int components, double* values) const;

private:
  vtkDataArray* Array = nullptr;
  int Extent[6] = { 0, -1, 0, -1, 0, -1 };
  vtkIdType Stride[3] = { 1, 0, 0 };
  double WorldToIndex[3][4] = {};
};

/** How grey values become grey: or, for colours, that they are shown as they are. */
struct AnatomyLook
{
  vtkDataArray* array = nullptr;
  bool isColor = false;
  int component = 0;
  double black = 0.;
  double white = 1.;
};

/** The property's colours as a table over its position t, and what is needed to use it. */
struct LightLook
{
  FieldSampler field; // Fluence, or Flux in mode FluxDirection; may be empty
  int mode = 0;
  double window[2] = { 0., 0. };
  bool hasWindow = false;
  vtkLightFieldProperty* property = nullptr;
  std::vector<double> positive; // RGBA, 4 per entry
  std::vector<double> negative;

  /** Fills the tables for a field whose largest magnitude is maximum. */
  void Tabulate(double maximum);
  /** Colour and opacity at position t. */
  const double* At(double t, bool isNegative) const;
};

/** Percentiles of the finite values of a component, from at most a million of them. */
void RobustRange(vtkDataArray* array, int component, double low, double high, double range[2]);

/** The RGB picture of a slice, as wide and high as the finer of the two grids asks for. */
void FillSlice(vtkImageData* picture, const SliceFrame& frame, vtkImageData* anatomy,
  const AnatomyLook& anatomyLook, vtkImageData* light, const LightLook& lightLook);

/** What the arrows of a slice are made from. */
struct ArrowLook
{
  FieldSampler flux;
  double largest = 0.; // magnitude of the flux, in the whole field
  double decades = 6.;
  bool uniform = false;
  double cell = 1.; // world length of the square that an arrow fits in
};

/** Four points and two cells per arrow; see vtkLightFieldSlices::GetArrows. */
void FillArrows(vtkPolyData* arrows, const SliceFrame& frame, const ArrowLook& look);
} // namespace lighttransport

#endif
