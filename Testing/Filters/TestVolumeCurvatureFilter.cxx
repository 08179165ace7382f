// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkVolumeCurvatureFilter: scalar types, oriented images, what is missing, bad input.
// The numbers are tested in Core, TestCurvature.
#include "LightTransportFilterTesting.h"

#include "vtkBitArray.h"
#include "vtkCallbackCommand.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkLightTransportArrays.h"
#include "vtkMatrix3x3.h"
#include "vtkUnsignedCharArray.h"
#include "vtkVolumeCurvatureFilter.h"

#include <limits>

using namespace lighttransport::testing;
using Filter = vtkVolumeCurvatureFilter;
using Image = vtkSmartPointer<vtkImageData>;

namespace
{
const double NaN = std::numeric_limits<double>::quiet_NaN();
const double Infinity = std::numeric_limits<double>::infinity();
const double Spacing[3] = { 0.5, 0.6, 0.4 };

/** A ball about the middle, radius about 4, in grey 0 to 120; values in between. */
double ball(int i, int j, int k)
{
  const double x = (i - 14.7) * Spacing[0];
  const double y = (j - 13.1) * Spacing[1];
  const double z = (k - 17.6) * Spacing[2];
  return 60. - 55. * std::tanh((std::sqrt(x * x + y * y + z * z) - 4.) / 1.5);
}

double radius(int i, int j, int k)
{
  const double x = (i - 14.7) * Spacing[0];
  const double y = (j - 13.1) * Spacing[1];
  const double z = (k - 17.6) * Spacing[2];
  return std::sqrt(x * x + y * y + z * z);
}

Image ballImage(int type)
{
  Image image = makeImage(30, 27, 35, type,
    [type](int i, int j, int k)
    {
      const double value = ball(i, j, k);
      const bool fraction = type == VTK_FLOAT || type == VTK_DOUBLE;
      return fraction ? value : std::round(value);
    });
  image->SetSpacing(Spacing[0], Spacing[1], Spacing[2]);
  return image;
}

/** The largest |k R - 1| near the ball's surface, in the interior. */
double errorOfBall(vtkAlgorithm* filter, const char* name)
{
  vtkDataArray* array = pointArray(filter, name);
  double error = array ? 0. : Infinity;
  for (vtkIdType at = 0; array && at < array->GetNumberOfTuples(); ++at)
  {
    const int i = int(at % 30);
    const int j = int(at / 30 % 27);
    const int k = int(at / (30 * 27));
    const double r = radius(i, j, k);
    if (std::abs(r - 4.) < 0.6)
    {
      error = std::max(error, std::abs(array->GetComponent(at, 0) * r - 1.));
    }
  }
  return error;
}

double largestDifference(vtkDataArray* a, vtkDataArray* b)
{
  double difference = a && b && a->GetNumberOfTuples() == b->GetNumberOfTuples() ? 0. : Infinity;
  for (vtkIdType i = 0; difference < Infinity && i < a->GetNumberOfTuples(); ++i)
  {
    difference = std::max(difference, std::abs(a->GetComponent(i, 0) - b->GetComponent(i, 0)));
  }
  return difference;
}

void types(Suite& suite)
{
  for (int type : { VTK_CHAR, VTK_SIGNED_CHAR, VTK_UNSIGNED_CHAR, VTK_SHORT, VTK_UNSIGNED_SHORT,
         VTK_INT, VTK_UNSIGNED_INT, VTK_LONG, VTK_LONG_LONG, VTK_ID_TYPE, VTK_FLOAT, VTK_DOUBLE })
  {
    vtkNew<Filter> filter;
    filter->SetInputData(ballImage(type));
    filter->SetDerivativeScale(0.8);
    filter->Update();
    const bool fraction = type == VTK_FLOAT || type == VTK_DOUBLE;
    // Grey levels are rounded: 0.29 of noise, in an edge of 37 grey per length.
    LT_CHECK_NEAR(suite, errorOfBall(filter, vtkLightTransportArrays::PrincipalCurvature1), 0.,
      fraction ? 0.03 : 0.12);
    LT_CHECK_NEAR(suite, errorOfBall(filter, vtkLightTransportArrays::PrincipalCurvature2), 0.,
      fraction ? 0.03 : 0.12);
    LT_CHECK_NEAR(suite, errorOfBall(filter, vtkLightTransportArrays::MeanCurvature), 0.,
      fraction ? 0.03 : 0.12);
  }
  // One of several components, by name; the arrays of the input pass through.
  Image image = ballImage(VTK_DOUBLE);
  vtkNew<vtkDoubleArray> three;
  three->SetName("Three");
  three->SetNumberOfComponents(3);
  three->SetNumberOfTuples(image->GetNumberOfPoints());
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    const double value = image->GetPointData()->GetScalars()->GetComponent(i, 0);
    three->SetTuple3(i, 7., -value, i % 5);
  }
  image->GetPointData()->AddArray(three);
  vtkNew<Filter> filter;
  filter->SetInputData(image);
  filter->SetInputArrayToProcess(0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, "Three");
  filter->SetComponent(1);
  filter->InsideIsBrightOff();
  filter->Update();
  LT_CHECK_NEAR(suite, errorOfBall(filter, vtkLightTransportArrays::MeanCurvature), 0., 0.03);
  LT_CHECK(suite, filter->GetOutput()->GetPointData()->GetArray("Three") == three.Get());
  LT_CHECK(suite,
    filter->GetOutput()->GetPointData()->GetScalars() == image->GetPointData()->GetScalars());
}

void grids(Suite& suite)
{
  // Where the image lies and how it is turned does not matter to the numbers.
  vtkNew<Filter> filter;
  filter->SetInputData(ballImage(VTK_DOUBLE));
  filter->Update();
  Image turned = ballImage(VTK_DOUBLE);
  vtkNew<vtkMatrix3x3> direction;
  const double m[9] = { 0.36, 0.48, -0.8, -0.8, 0.6, 0., 0.48, 0.64, 0.6 };
  direction->DeepCopy(m);
  turned->SetDirectionMatrix(direction);
  turned->SetOrigin(100., -50., 3.);
  turned->SetExtent(-5, 24, 3, 29, 7, 41);
  vtkNew<Filter> other;
  other->SetInputData(turned);
  other->Update();
  for (const char* name :
    { vtkLightTransportArrays::PrincipalCurvature1, vtkLightTransportArrays::PrincipalCurvature2,
      vtkLightTransportArrays::MeanCurvature, vtkLightTransportArrays::GaussianCurvature })
  {
    LT_CHECK(suite, largestDifference(pointArray(filter, name), pointArray(other, name)) == 0.);
  }
  const int* extent = other->GetOutput()->GetExtent();
  LT_CHECK(suite, extent[0] == -5 && extent[5] == 41);
  LT_CHECK(suite, other->GetOutput()->GetDirectionMatrix()->GetElement(1, 0) == -0.8);

  // Gaussian is the product, in 1/length^2.
  LT_CHECK_NEAR(suite,
    pointArray(filter, vtkLightTransportArrays::GaussianCurvature)
      ->GetComponent(14 + 30 * (13 + 27 * 28), 0),
    std::pow(radius(14, 13, 28), -2.), 0.002);

  // Degenerate grids give numbers.
  for (const auto& dims : { std::array<int, 3>{ { 1, 1, 1 } }, { { 30, 1, 1 } }, { { 1, 5, 9 } },
         { { 2, 2, 2 } }, { { 9, 8, 1 } } })
  {
    Image thin = makeImage(dims[0], dims[1], dims[2], VTK_FLOAT, ball);
    filter->SetInputData(thin);
    filter->Update();
    vtkDataArray* k1 = pointArray(filter, vtkLightTransportArrays::PrincipalCurvature1);
    bool finite = k1 && k1->GetNumberOfTuples() == thin->GetNumberOfPoints();
    for (vtkIdType i = 0; finite && i < k1->GetNumberOfTuples(); ++i)
    {
      finite = std::isfinite(k1->GetComponent(i, 0));
    }
    LT_CHECK(suite, finite);
  }

  // A constant has curvature 0, whatever it is and in whatever type.
  for (int type : { VTK_UNSIGNED_CHAR, VTK_FLOAT, VTK_DOUBLE })
  {
    filter->SetInputData(makeImage(9, 8, 7, type, [](int, int, int) { return 77.7; }));
    filter->Update();
    double range[2] = { 1., 1. };
    pointArray(filter, vtkLightTransportArrays::MeanCurvature)->GetRange(range);
    LT_CHECK(suite, range[0] == 0. && range[1] == 0.);
  }
}

void wanted(Suite& suite)
{
  vtkNew<Filter> filter;
  filter->SetInputData(ballImage(VTK_SHORT));
  filter->ComputePrincipalCurvaturesOff();
  filter->ComputeGaussianCurvatureOff();
  filter->Update();
  LT_CHECK(suite, pointArray(filter, vtkLightTransportArrays::MeanCurvature) != nullptr);
  LT_CHECK(suite, pointArray(filter, vtkLightTransportArrays::PrincipalCurvature1) == nullptr);
  LT_CHECK(suite, pointArray(filter, vtkLightTransportArrays::PrincipalCurvature2) == nullptr);
  LT_CHECK(suite, pointArray(filter, vtkLightTransportArrays::GaussianCurvature) == nullptr);
  vtkFieldData* field = filter->GetOutput()->GetFieldData();
  vtkDataArray* scale = field->GetArray("VolumeCurvature.DerivativeScale");
  LT_CHECK(suite, scale && scale->GetComponent(0, 0) == 0.4); // the smallest spacing
  vtkDataArray* noise = field->GetArray("VolumeCurvature.NoiseLevel");
  LT_CHECK(suite, noise && noise->GetComponent(0, 0) >= 0.29); // of whole numbers
  LT_CHECK(suite, filter->GetComputedNoiseLevel() >= 0.29);
  LT_CHECK(suite, filter->GetComputedGradientThreshold() > 0.);
  // Known noise moves the threshold, and what lies below it is flat.
  const double before = filter->GetComputedGradientThreshold();
  filter->SetNoiseLevel(4. * filter->GetComputedNoiseLevel());
  filter->Update();
  LT_CHECK_CLOSE(suite, filter->GetComputedGradientThreshold(), 4. * before, 1e-6);
  filter->SetNoiseLevel(1e6);
  filter->Update();
  double range[2] = { 1., 1. };
  pointArray(filter, vtkLightTransportArrays::MeanCurvature)->GetRange(range);
  LT_CHECK(suite, range[0] == 0. && range[1] == 0.);
}

void missing(Suite& suite)
{
  // NaN, a no-data value and hidden points are the same thing.
  Image nan = ballImage(VTK_DOUBLE);
  Image noData = ballImage(VTK_DOUBLE);
  Image hidden = ballImage(VTK_DOUBLE);
  hidden->AllocatePointGhostArray();
  for (vtkIdType i = 0; i < nan->GetNumberOfPoints(); ++i)
  {
    if (i % 30 < 10)
    {
      nan->GetPointData()->GetScalars()->SetComponent(i, 0, NaN);
      noData->GetPointData()->GetScalars()->SetComponent(i, 0, -2048.);
      hidden->GetPointGhostArray()->SetValue(i, vtkDataSetAttributes::HIDDENPOINT);
    }
  }
  vtkNew<Filter> filters[3];
  filters[0]->SetInputData(nan);
  filters[1]->SetInputData(noData);
  filters[1]->AddNoDataValue(-2048.);
  filters[2]->SetInputData(hidden);
  LT_CHECK(suite, filters[1]->GetNumberOfNoDataValues() == 1);
  for (auto& filter : filters)
  {
    filter->SetNoiseLevel(0.);
    filter->Update();
    vtkDataArray* k1 = pointArray(filter, vtkLightTransportArrays::PrincipalCurvature1);
    LT_CHECK(suite,
      largestDifference(k1, pointArray(filters[0], vtkLightTransportArrays::PrincipalCurvature1)) <
        1e-6);
    double error = 0.;
    bool zero = true;
    for (vtkIdType at = 0; at < k1->GetNumberOfTuples(); ++at)
    {
      const double r = radius(int(at % 30), int(at / 30 % 27), int(at / (30 * 27)));
      if (at % 30 < 10)
      {
        zero = zero && k1->GetComponent(at, 0) == 0.;
      }
      else if (std::abs(r - 4.) < 0.6)
      {
        error = std::max(error, std::abs(k1->GetComponent(at, 0) * r - 1.));
      }
    }
    LT_CHECK(suite, zero);
    // One-sided beside the wall, in an edge four points wide.
    LT_CHECK_NEAR(suite, error, 0., 0.2);
  }
}

void badInput(Suite& suite)
{
  vtkNew<Filter> filter;
  LT_CHECK(suite, std::isnan(filter->GetNoDataValue(0)));
  filter->SetInputData(vtkNew<vtkImageData>());
  LT_CHECK_FAILS(suite, filter, "empty", "expected");
  Image image = ballImage(VTK_FLOAT);
  filter->SetInputData(image);
  filter->SetComponent(1);
  LT_CHECK_FAILS(suite, filter, "Component is 1", "expected 0 to 0");
  filter->SetComponent(0);
  filter->SetDerivativeScale(13.);
  LT_CHECK_FAILS(suite, filter, "DerivativeScale is 13", "32 times");
  filter->SetDerivativeScale(NaN);
  LT_CHECK_FAILS(suite, filter, "DerivativeScale is");
  filter->SetDerivativeScale(-1.);
  filter->SetNoiseLevel(NaN);
  LT_CHECK_FAILS(suite, filter, "NoiseLevel is");
  filter->SetNoiseLevel(-1.);
  filter->ComputePrincipalCurvaturesOff();
  filter->ComputeGaussianCurvatureOff();
  filter->ComputeMeanCurvatureOff();
  LT_CHECK_FAILS(suite, filter, "ComputeMeanCurvature", "expected one");
  filter->ComputeMeanCurvatureOn();
  filter->SetInputArrayToProcess(0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, "No");
  LT_CHECK_FAILS(suite, filter, "\"No\"");
  filter->SetInputArrayToProcess(
    0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, vtkDataSetAttributes::SCALARS);

  vtkNew<vtkImageData> bare; // no scalars at all
  bare->SetDimensions(4, 4, 4);
  filter->SetInputData(bare);
  LT_CHECK_FAILS(suite, filter, "no point array", "expected");

  Image spoilt = ballImage(VTK_FLOAT);
  spoilt->SetSpacing(1., 0., 1.);
  filter->SetInputData(spoilt);
  LT_CHECK_FAILS(suite, filter, "spacing", "1 0 1");
  spoilt->SetSpacing(1., 1., -2.);
  LT_CHECK_FAILS(suite, filter, "spacing", "1 1 -2");
  spoilt->SetSpacing(1., NaN, 1.);
  LT_CHECK_FAILS(suite, filter, "spacing");
  spoilt->SetSpacing(1e-16, 1., 1.);
  LT_CHECK_FAILS(suite, filter, "smallest spacing", "1e-16");
  spoilt->SetSpacing(1., 1., 1.);
  vtkNew<vtkMatrix3x3> skew;
  skew->SetElement(0, 1, 0.5);
  spoilt->SetDirectionMatrix(skew);
  LT_CHECK_FAILS(suite, filter, "direction matrix");

  Image infinite = ballImage(VTK_FLOAT);
  infinite->GetPointData()->GetScalars()->SetComponent(123, 0, -Infinity);
  filter->SetInputData(infinite);
  LT_CHECK_FAILS(suite, filter, "infinity at point 123");
  filter->AddNoDataValue(-Infinity);
  filter->Update();
  LT_CHECK(suite, pointArray(filter, vtkLightTransportArrays::MeanCurvature) != nullptr);
  filter->RemoveAllNoDataValues();

  Image wide = makeImage(5, 5, 5, VTK_DOUBLE, [](int i, int, int) { return i ? 1e308 : -1e308; });
  filter->SetInputData(wide);
  LT_CHECK_FAILS(suite, filter, "reaches from");
  // All missing, and values close to what a double holds: numbers.
  for (double value : { NaN, 1e307 })
  {
    filter->SetInputData(makeImage(
      5, 5, 5, VTK_DOUBLE, [value](int i, int j, int) { return value * (i + j - 3) * 0.1; }));
    filter->Update();
    vtkDataArray* mean = pointArray(filter, vtkLightTransportArrays::MeanCurvature);
    LT_CHECK(suite, mean && std::isfinite(mean->GetComponent(62, 0)));
  }

  // Asked to stop: an empty output, no error.
  filter->SetInputData(image);
  vtkNew<vtkCallbackCommand> stop;
  stop->SetCallback(
    [](vtkObject* caller, unsigned long, void*, void*)
    {
      auto* algorithm = vtkAlgorithm::SafeDownCast(caller);
      if (algorithm->GetProgress() > 0.3)
      {
        algorithm->SetAbortExecute(1);
      }
    });
  const unsigned long tag = filter->AddObserver(vtkCommand::ProgressEvent, stop);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());
  LT_CHECK(suite, filter->GetOutput()->GetNumberOfPoints() == 0);
  filter->RemoveObserver(tag);
  filter->SetAbortExecute(0);
  filter->Modified();
  filter->Update();
  LT_CHECK(suite, filter->GetOutput()->GetNumberOfPoints() > 0);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  types(suite);
  grids(suite);
  wanted(suite);
  missing(suite);
  allowFloatingPointExceptions();
  badInput(suite);
  return suite.result();
}
