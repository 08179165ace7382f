// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkVisibilityFactorFilter in a pipeline: opacity to extinction, closed forms,
// directions of the image, what is kept, bad input.
#include "LightTransportFilterTesting.h"

#include "vtkVisibilityFactorFilter.h"

#include "vtkFloatArray.h"
#include "vtkLookupTable.h"
#include "vtkMatrix3x3.h"
#include "vtkPiecewiseFunction.h"
#include "vtkUnsignedCharArray.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

using namespace lighttransport::testing;

namespace
{
constexpr double Pi = 3.14159265358979323846;
constexpr double NaN = std::numeric_limits<double>::quiet_NaN();
constexpr double Infinity = std::numeric_limits<double>::infinity();

vtkSmartPointer<vtkPiecewiseFunction> line(double x0, double y0, double x1, double y1)
{
  auto function = vtkSmartPointer<vtkPiecewiseFunction>::New();
  function->AddPoint(x0, y0);
  function->AddPoint(x1, y1);
  return function;
}

/** The array "Extinction" for the scalars. */
vtkSmartPointer<vtkImageData> named(vtkSmartPointer<vtkImageData> image)
{
  image->GetPointData()->GetScalars()->SetName("Extinction");
  return image;
}

double at(vtkAlgorithm* filter, const char* name, int i, int j, int k, int component = 0)
{
  vtkDataArray* array = pointArray(filter, name);
  auto* image = vtkImageData::SafeDownCast(filter->GetOutputDataObject(0));
  int index[3] = { i, j, k };
  return array ? array->GetComponent(image->ComputePointId(index), component) : NaN;
}

/** sigma_t = -ln(1 - alpha) / unit, for every type of scalars. */
void extinction(Suite& suite)
{
  for (int type : { VTK_SIGNED_CHAR, VTK_UNSIGNED_CHAR, VTK_SHORT, VTK_UNSIGNED_SHORT, VTK_INT,
         VTK_FLOAT, VTK_DOUBLE, VTK_LONG_LONG })
  {
    vtkNew<vtkVisibilityFactorFilter> filter;
    auto image = makeImage(5, 4, 3, type, [](int i, int j, int k) { return 20 * i + 2 * j + k; });
    image->SetSpacing(0.5, 0.5, 0.5);
    filter->SetInputData(image);
    filter->SetScalarOpacity(line(0., 0., 100., 0.8));
    filter->SetScalarOpacityUnitDistance(2.5);
    filter->SphericalHarmonicsOff();
    filter->OutputExtinctionOn();
    LT_CHECK(suite, errorsOfUpdate(filter).empty());
    double worst = 0.;
    for (int i = 0; i < 5; ++i)
    {
      const double expected = -std::log(1. - 0.008 * (20 * i + 2)) / 2.5;
      worst = std::max(worst, std::abs(at(filter, "Extinction", i, 1, 0) - expected));
    }
    LT_CHECK_NEAR(suite, worst, 0., 1e-6);
  }

  // Gradient opacity: along x the two neighbours differ by 20, the axis is as long as the mean.
  vtkNew<vtkVisibilityFactorFilter> filter;
  auto ramp = makeImage(5, 4, 3, VTK_FLOAT, [](int i, int, int) { return 10. * i; });
  filter->SetInputData(ramp);
  filter->SetScalarOpacity(line(0., 0.5, 100., 0.5));
  filter->SetGradientOpacity(line(0., 0., 10., 1.)); // up to a quarter of the range, 40
  filter->OutputExtinctionOn();
  filter->SphericalHarmonicsOff();
  filter->Update();
  LT_CHECK_NEAR(suite, at(filter, "Extinction", 2, 1, 1), -std::log(0.5), 1e-5);
  // The same as a 2-D function of one column, half of it opaque to 0.5 above the middle.
  vtkNew<vtkImageData> two;
  two->SetDimensions(1, 2, 1);
  two->AllocateScalars(VTK_FLOAT, 4);
  two->GetPointData()->GetScalars()->Fill(0.);
  two->GetPointData()->GetScalars()->SetComponent(1, 3, 0.5);
  filter->SetTransferFunction2D(two);
  filter->Update();
  LT_CHECK_NEAR(suite, at(filter, "Extinction", 2, 1, 1), -std::log(0.5), 1e-5);
  auto flat = makeImage(5, 4, 3, VTK_FLOAT, [](int i, int, int) { return i == 0 ? 40. : 0.; });
  filter->SetInputData(flat);
  filter->Update();
  LT_CHECK_NEAR(suite, at(filter, "Extinction", 3, 1, 1), 0., 1e-6);

  // Opaque is a depth of 20 over the smallest spacing, and transparent where nothing is known.
  vtkNew<vtkVisibilityFactorFilter> holes;
  auto image = makeImage(6, 5, 4, VTK_FLOAT, [](int i, int, int) { return i == 3 ? NaN : 1.; });
  image->SetSpacing(0.5, 1., 2.);
  vtkNew<vtkUnsignedCharArray> ghosts;
  ghosts->SetName(vtkDataSetAttributes::GhostArrayName());
  ghosts->SetNumberOfTuples(image->GetNumberOfPoints());
  ghosts->Fill(0.);
  ghosts->SetComponent(0, 0, vtkDataSetAttributes::HIDDENPOINT);
  image->GetPointData()->AddArray(ghosts);
  holes->SetInputData(image);
  holes->SetScalarOpacity(line(0., 0., 1., 1.));
  holes->OutputExtinctionOn();
  {
    const Suite::WithoutTraps quiet;
    LT_CHECK(suite, errorsOfUpdate(holes).empty());
  }
  LT_CHECK_NEAR(suite, at(holes, "Extinction", 0, 0, 0), 0., 0.);
  LT_CHECK_NEAR(suite, at(holes, "Extinction", 1, 0, 0), 40., 1e-5);
  LT_CHECK_NEAR(suite, at(holes, "Extinction", 3, 0, 0), 0., 0.);
}

void closedForms(Suite& suite)
{
  // The centre of a ball of optical radius tau: e^-tau in band 0 and 0 elsewhere.
  const int n = 41;
  const double radius = 18.;
  const double tau = 0.9;
  vtkNew<vtkVisibilityFactorFilter> ball;
  ball->SetInputData(named(makeImage(n, n, n, VTK_FLOAT,
    [&](int i, int j, int k)
    {
      // Voxels that the surface cuts hold their part of it.
      const double r =
        std::sqrt(std::pow(i - 20., 2) + std::pow(j - 20., 2) + std::pow(k - 20., 2));
      return tau / radius * std::min(1., std::max(0., radius + 0.5 - r));
    })));
  ball->SetOrder(4);
  ball->AmbientOcclusionOn();
  LT_CHECK(suite, errorsOfUpdate(ball).empty());
  LT_CHECK_NEAR(
    suite, at(ball, "VisibilitySH", 20, 20, 20), std::sqrt(4. * Pi) * std::exp(-tau), 0.01);
  for (int c = 1; c < 25; ++c)
  {
    LT_CHECK_NEAR(suite, at(ball, "VisibilitySH", 20, 20, 20, c), 0., 0.005);
  }
  LT_CHECK_NEAR(suite, at(ball, "AmbientOcclusion", 20, 20, 20), std::exp(-tau), 0.003);

  // Opaque everywhere: nothing is seen, but through the outermost half voxel nearly nothing.
  vtkNew<vtkVisibilityFactorFilter> opaque;
  opaque->SetInputData(makeImage(12, 9, 7, VTK_UNSIGNED_CHAR, [](int, int, int) { return 200.; }));
  opaque->SetScalarOpacity(line(0., 1., 255., 1.));
  opaque->AddDirectionalLight(1., 0., 0.);
  LT_CHECK(suite, errorsOfUpdate(opaque).empty());
  LT_CHECK_NEAR(suite, at(opaque, "VisibilitySH", 5, 4, 3), 0., 1e-7);
  LT_CHECK_NEAR(suite, at(opaque, "Visibility", 11, 4, 3), std::exp(-10.), 1e-6);
  LT_CHECK_NEAR(suite, at(opaque, "Visibility", 10, 4, 3), 0., 1e-12);
  // Transparent everywhere, with a radius or without.
  for (double r : { 0., 3. })
  {
    opaque->SetScalarOpacity(line(0., 0., 255., 0.));
    opaque->SetRadius(r);
    LT_CHECK(suite, errorsOfUpdate(opaque).empty());
    LT_CHECK_NEAR(suite, at(opaque, "VisibilitySH", 5, 4, 3), std::sqrt(4. * Pi), 2e-6);
    LT_CHECK_NEAR(suite, at(opaque, "VisibilitySH", 0, 0, 0, 5), 0., 2e-6);
    LT_CHECK_NEAR(suite, at(opaque, "Visibility", 0, 4, 3), 1., 0.);
  }
}

/** A turned image sees the same in world directions; its extent need not start at 0. */
void directions(Suite& suite)
{
  const auto slab = [](int i, int, int) { return i > 4 ? 0.3 : 0.; };
  vtkNew<vtkVisibilityFactorFilter> straight;
  straight->SetInputData(named(makeImage(11, 10, 9, VTK_FLOAT, slab)));
  straight->AddDirectionalLight(1., 0.2, 0.1);
  straight->AddPositionalLight(25., 4., 4.);
  straight->Update();
  // Index axes x, y, z along the world's y, z, x.
  vtkNew<vtkVisibilityFactorFilter> turned;
  auto image = named(makeImage(11, 10, 9, VTK_FLOAT, slab));
  image->SetDirectionMatrix(0., 0., 1., 1., 0., 0., 0., 1., 0.);
  image->SetExtent(3, 13, -2, 7, 1, 9);
  image->SetOrigin(100., 0., 0.);
  turned->SetInputData(image);
  turned->AddDirectionalLight(0.1, 1., 0.2);
  // From the first point, 100 + 1, 3, -2, by 4, 25, 4.
  turned->AddPositionalLight(105., 28., 2.);
  LT_CHECK(suite, errorsOfUpdate(turned).empty());
  LT_CHECK(suite, turned->GetOutput()->GetExtent()[0] == 3);
  for (int c = 0; c < 2; ++c)
  {
    double worst = 0.;
    for (vtkIdType p = 0; p < image->GetNumberOfPoints(); ++p)
    {
      worst = std::max(worst,
        std::abs(pointArray(straight, "Visibility")->GetComponent(p, c) -
          pointArray(turned, "Visibility")->GetComponent(p, c)));
    }
    LT_CHECK_NEAR(suite, worst, 0., 1e-5);
  }
  // The slab lies towards the world's x (then y): that is Y_1,1 (then Y_1,-1).
  const double x = at(straight, "VisibilitySH", 2, 5, 4, 3);
  LT_CHECK(suite, x < -0.3);
  LT_CHECK_NEAR(suite, at(straight, "VisibilitySH", 2, 5, 4, 1), 0., 0.1);
  LT_CHECK_NEAR(suite, at(turned, "VisibilitySH", 5, 3, 5, 1), x, 0.05);
  LT_CHECK_NEAR(suite, at(turned, "VisibilitySH", 5, 3, 5, 3), 0., 0.1);
}

void resolution(Suite& suite)
{
  // The coarse grid covers the same domain, keeps the optical depth, and is where it was.
  vtkNew<vtkVisibilityFactorFilter> filter;
  auto image = named(makeImage(21, 14, 9, VTK_FLOAT, [](int, int, int) { return 0.1; }));
  image->SetSpacing(0.5, 1., 2.);
  image->SetExtent(2, 22, 0, 13, -1, 7);
  image->SetDirectionMatrix(0., 1., 0., -1., 0., 0., 0., 0., 1.);
  filter->SetInputData(image);
  filter->SetResolutionFactor(4);
  filter->OutputExtinctionOn();
  filter->AddDirectionalLight(0., -1., 0.); // index x
  filter->AddPositionalLight(0., -3000., 0.);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());
  vtkImageData* out = filter->GetOutput();
  const int* dims = out->GetDimensions();
  LT_CHECK(suite, dims[0] == 6 && dims[1] == 4 && dims[2] == 3);
  const double* spacing = out->GetSpacing();
  LT_CHECK_NEAR(suite, spacing[0] * 6., 21. * 0.5, 1e-12);
  const double corner[3] = { -0.5, -0.5, -0.5 };
  const double fineCorner[3] = { 1.5, -0.5, -1.5 };
  double a[3];
  double b[3];
  out->TransformContinuousIndexToPhysicalPoint(corner, a);
  image->TransformContinuousIndexToPhysicalPoint(fineCorner, b);
  LT_CHECK_NEAR(
    suite, std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]) + std::abs(a[2] - b[2]), 0., 1e-12);
  LT_CHECK_NEAR(suite, at(filter, "Extinction", 3, 2, 1), 0.1, 1e-7);
  LT_CHECK_NEAR(suite, at(filter, "Visibility", 2, 2, 1), std::exp(-0.1 * 3.5 * spacing[0]), 1e-6);
  LT_CHECK(suite,
    std::abs(at(filter, "Visibility", 2, 2, 1, 1) - std::exp(-0.1 * 3.5 * spacing[0])) < 1e-3);
  LT_CHECK(suite, pointArray(filter, "Extinction")->GetNumberOfTuples() == 6 * 4 * 3);
  // Larger than the image: one voxel.
  filter->SetResolutionFactor(100);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());
  LT_CHECK(suite, out->GetNumberOfPoints() == 1);
}

void colours(Suite& suite)
{
  vtkNew<vtkVisibilityFactorFilter> filter;
  filter->SetInputData(
    makeImage(9, 9, 9, VTK_FLOAT, [](int i, int, int) { return i < 4 ? 0. : 1.; }));
  filter->SetScalarOpacity(line(0., 0.2, 1., 0.2));
  vtkNew<vtkLookupTable> colour;
  colour->SetNumberOfTableValues(2);
  colour->SetTableRange(0., 1.);
  colour->SetTableValue(0, 0.5, 0.5, 0.5);
  colour->SetTableValue(1, 1., 0., 0.);
  filter->SetColor(colour);
  filter->RGBExtinctionOn();
  filter->OutputExtinctionOn();
  filter->AmbientOcclusionOn();
  filter->AddDirectionalLight(0., 0., 1.);
  filter->AddDirectionalLight(1., 0., 0.);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());
  LT_CHECK(suite, pointArray(filter, "VisibilitySH")->GetNumberOfComponents() == 27);
  LT_CHECK(suite, pointArray(filter, "Visibility")->GetNumberOfComponents() == 6);
  LT_CHECK(suite, pointArray(filter, "AmbientOcclusion")->GetNumberOfComponents() == 3);
  const double sigma = -std::log(0.8);
  double mean = 0.;
  for (int c = 0; c < 3; ++c)
  {
    LT_CHECK_NEAR(suite, at(filter, "Extinction", 0, 4, 4, c), sigma, 1e-6); // grey stays grey
    mean += at(filter, "Extinction", 8, 4, 4, c) / 3.;
  }
  LT_CHECK_NEAR(suite, mean, sigma, 1e-6);
  // Red passes red.
  LT_CHECK_NEAR(suite, at(filter, "Extinction", 8, 4, 4, 0), sigma * 3. * 0.1 / 2.3, 1e-5);
  LT_CHECK(suite, at(filter, "Visibility", 0, 4, 4, 3) > 2. * at(filter, "Visibility", 0, 4, 4, 4));
  LT_CHECK_NEAR(suite, at(filter, "Visibility", 0, 4, 4, 0), std::exp(-4.5 * sigma), 1e-5);
  LT_CHECK(
    suite, at(filter, "VisibilitySH", 8, 4, 4, 0) > 1.2 * at(filter, "VisibilitySH", 8, 4, 4, 9));

  // The same from an array of three components.
  vtkNew<vtkImageData> image;
  image->SetDimensions(9, 9, 9);
  vtkNew<vtkFloatArray> rgb;
  rgb->SetName("Extinction");
  rgb->SetNumberOfComponents(3);
  rgb->SetNumberOfTuples(729);
  rgb->Fill(0.1);
  rgb->FillComponent(2, 0.);
  image->GetPointData()->AddArray(rgb);
  vtkNew<vtkVisibilityFactorFilter> direct;
  direct->SetInputData(image);
  direct->RGBExtinctionOn();
  direct->AddDirectionalLight(0., 1., 0.);
  LT_CHECK(suite, errorsOfUpdate(direct).empty());
  LT_CHECK_NEAR(suite, at(direct, "Visibility", 4, 4, 4, 1), std::exp(-0.45), 1e-6);
  LT_CHECK_NEAR(suite, at(direct, "Visibility", 4, 4, 4, 2), 1., 0.);
}

/** A light that moves leaves the rest as it is; the results are those of a new filter. */
void kept(Suite& suite)
{
  auto image = makeImage(24, 20, 17, VTK_UNSIGNED_CHAR,
    [](int i, int j, int k) { return (i * 7 + j * 5 + k * 3) % 100; });
  vtkNew<vtkVisibilityFactorFilter> filter;
  filter->SetInputData(image);
  filter->SetScalarOpacity(line(0., 0., 100., 0.2));
  filter->AddDirectionalLight(0., 0., 1.);
  filter->AddPositionalLight(-3., 4., 5.);
  filter->Update();
  LT_CHECK(suite,
    filter->GetExtinctionSeconds() > 0. && filter->GetHarmonicsSeconds() > 0. &&
      filter->GetLightsSeconds() > 0.);
  vtkSmartPointer<vtkDataArray> harmonics = pointArray(filter, "VisibilitySH");
  vtkSmartPointer<vtkDataArray> before = pointArray(filter, "Visibility");
  const double first = before->GetComponent(1000, 0);
  filter->SetLightDirection(0, 1., 1., 0.);
  filter->Update();
  LT_CHECK(suite,
    filter->GetExtinctionSeconds() == 0. && filter->GetHarmonicsSeconds() == 0. &&
      filter->GetLightsSeconds() > 0.);
  LT_CHECK(suite, pointArray(filter, "VisibilitySH") == harmonics);
  LT_CHECK(suite, before->GetComponent(1000, 0) == first); // an output that was kept stays
  LT_CHECK(suite, pointArray(filter, "Visibility")->GetComponent(1000, 0) != first);
  LT_CHECK(suite,
    pointArray(filter, "Visibility")->GetComponent(1000, 1) == before->GetComponent(1000, 1));
  // Opacity, order, a third light, the radius.
  filter->GetScalarOpacity()->AddPoint(50., 0.3);
  filter->AddDirectionalLight(-1., 0.5, 0.);
  filter->SetOrder(1);
  filter->SetRadius(4.);
  filter->Update();
  LT_CHECK(suite, filter->GetExtinctionSeconds() > 0.);
  vtkNew<vtkVisibilityFactorFilter> fresh;
  fresh->SetInputData(image);
  fresh->SetScalarOpacity(filter->GetScalarOpacity());
  fresh->AddDirectionalLight(1., 1., 0.);
  fresh->AddPositionalLight(-3., 4., 5.);
  fresh->AddDirectionalLight(-1., 0.5, 0.);
  fresh->SetOrder(1);
  fresh->SetRadius(4.);
  fresh->Update();
  for (const char* name : { "Visibility", "VisibilitySH" })
  {
    vtkDataArray* a = pointArray(filter, name);
    vtkDataArray* b = pointArray(fresh, name);
    bool same = a && b && a->GetNumberOfComponents() == b->GetNumberOfComponents();
    for (vtkIdType i = 0; same && i < a->GetNumberOfTuples(); ++i)
    {
      for (int c = 0; c < a->GetNumberOfComponents(); ++c)
      {
        same = same && a->GetComponent(i, c) == b->GetComponent(i, c);
      }
    }
    LT_CHECK(suite, same);
  }
  // Nothing is recomputed where nothing changed.
  filter->Modified();
  filter->Update();
  LT_CHECK(suite,
    filter->GetExtinctionSeconds() == 0. && filter->GetHarmonicsSeconds() == 0. &&
      filter->GetLightsSeconds() == 0.);
  // An array per light: the same values; that of a light that stays is the same object.
  vtkSmartPointer<vtkDataArray> together = pointArray(filter, "Visibility");
  filter->SeparateLightsOn();
  filter->Update();
  LT_CHECK(suite, !pointArray(filter, "Visibility") && filter->GetLightsSeconds() == 0.);
  vtkSmartPointer<vtkDataArray> apart[3];
  for (int l = 0; l < 3; ++l)
  {
    apart[l] = pointArray(filter, ("Visibility" + std::to_string(l)).c_str());
    bool same = apart[l] && apart[l]->GetNumberOfComponents() == 1;
    for (vtkIdType i = 0; same && i < together->GetNumberOfTuples(); ++i)
    {
      same = apart[l]->GetComponent(i, 0) == together->GetComponent(i, l);
    }
    LT_CHECK(suite, same);
  }
  filter->SetLightPosition(1, -3., 4., 6.);
  filter->Update();
  LT_CHECK(suite, pointArray(filter, "Visibility0") == apart[0]);
  LT_CHECK(suite, pointArray(filter, "Visibility1") != apart[1]);
  LT_CHECK(suite, pointArray(filter, "Visibility2") == apart[2]);
  filter->SeparateLightsOff();
  // Without lights there is no array of theirs.
  filter->RemoveAllLights();
  filter->Update();
  LT_CHECK(suite, !pointArray(filter, "Visibility"));
}

void degenerate(Suite& suite)
{
  const std::array<int, 3> grids[] = { { { 1, 1, 1 } }, { { 20, 1, 1 } }, { { 1, 1, 20 } },
    { { 1, 15, 20 } }, { { 15, 20, 1 } } };
  for (const std::array<int, 3>& dims : grids)
  {
    for (double r : { 0., 2.3 })
    {
      vtkNew<vtkVisibilityFactorFilter> filter;
      filter->SetInputData(
        named(makeImage(dims[0], dims[1], dims[2], VTK_FLOAT, [](int, int, int) { return 0.1; })));
      filter->SetRadius(r);
      filter->AddDirectionalLight(0., 0., 1e-200);
      filter->AddPositionalLight(0., 0., 0.);
      filter->AddPositionalLight(1e9, 1e9, 2e9);
      LT_CHECK(suite, errorsOfUpdate(filter).empty());
      const double v = std::exp(-0.1 * (r > 0. ? std::min(r, dims[2] - 0.5) : dims[2] - 0.5));
      LT_CHECK_NEAR(suite, at(filter, "Visibility", 0, 0, 0), v, 1e-5);
      LT_CHECK_NEAR(suite, at(filter, "Visibility", 0, 0, 0, 1), 1., 0.);
      const double sh = at(filter, "VisibilitySH", 0, 0, 0) / std::sqrt(4. * Pi);
      LT_CHECK(suite, sh > 0.2 && sh < 1.);
      const double far = at(filter, "Visibility", 0, 0, 0, 2);
      LT_CHECK(suite, far > 0.1 && far < 1.);
    }
  }
}

void badInput(Suite& suite)
{
  allowFloatingPointExceptions();
  auto image = makeImage(6, 5, 4, VTK_FLOAT, [](int i, int, int) { return i; });
  vtkNew<vtkVisibilityFactorFilter> filter;
  filter->SetInputData(image);
  LT_CHECK_FAILS(suite, filter.Get(), "neither ScalarOpacity", "Extinction");
  filter->SetScalarOpacity(line(0., 0., 5., 1.));
  filter->SetOrder(5);
  LT_CHECK_FAILS(suite, filter.Get(), "Order is 5", "0 to 4");
  filter->SetOrder(-1);
  LT_CHECK_FAILS(suite, filter.Get(), "Order is -1");
  filter->SetOrder(2);
  filter->SetNumberOfDirections(-3);
  LT_CHECK_FAILS(suite, filter.Get(), "NumberOfDirections is -3", "at least 1");
  filter->SetNumberOfDirections(0);
  filter->SetRadius(NaN);
  LT_CHECK_FAILS(suite, filter.Get(), "Radius is nan");
  filter->SetRadius(-1.);
  LT_CHECK_FAILS(suite, filter.Get(), "Radius is -1");
  filter->SetRadius(0.);
  filter->SetResolutionFactor(0);
  LT_CHECK_FAILS(suite, filter.Get(), "ResolutionFactor is 0");
  filter->SetResolutionFactor(1);
  for (double unit : { 0., -1., NaN, Infinity })
  {
    filter->SetScalarOpacityUnitDistance(unit);
    LT_CHECK_FAILS(suite, filter.Get(), "ScalarOpacityUnitDistance", "> 0");
  }
  filter->SetScalarOpacityUnitDistance(1.);
  filter->SetComponent(1);
  LT_CHECK_FAILS(suite, filter.Get(), "Component is 1", "0 to 0");
  filter->SetComponent(0);
  filter->RGBExtinctionOn();
  LT_CHECK_FAILS(suite, filter.Get(), "Color is not set");
  filter->RGBExtinctionOff();
  filter->GetScalarOpacity()->AddPoint(3., 1.5);
  LT_CHECK_FAILS(suite, filter.Get(), "ScalarOpacity has the value 1.5", "[0, 1]");
  vtkNew<vtkPiecewiseFunction> none;
  filter->SetScalarOpacity(none);
  LT_CHECK_FAILS(suite, filter.Get(), "ScalarOpacity has no points");
  filter->SetScalarOpacity(line(0., 0., 5., 1.));
  vtkNew<vtkImageData> empty2D;
  filter->SetTransferFunction2D(empty2D);
  LT_CHECK_FAILS(suite, filter.Get(), "TransferFunction2D", "RGBA");
  filter->SetTransferFunction2D(nullptr);

  // Lights.
  filter->AddDirectionalLight(0., 0., 0.);
  LT_CHECK_FAILS(suite, filter.Get(), "light 0", "other than 0");
  filter->SetLightPosition(0, NaN, 0., 0.);
  LT_CHECK_FAILS(suite, filter.Get(), "light 0", "finite coordinates");
  filter->SetLightPosition(0, 0., 0., 0.);
  vtkNew<MessageLog> log;
  filter->AddObserver(vtkCommand::ErrorEvent, log);
  filter->SetLightDirection(1, 1., 0., 0.);
  LT_CHECK(suite, log->messages.size() == 1);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());

  // Images and arrays.
  image->GetPointData()->GetScalars()->SetComponent(7, 0, Infinity);
  image->GetPointData()->GetScalars()->Modified();
  image->Modified();
  LT_CHECK_FAILS(suite, filter.Get(), "infinity at point 7");
  auto extinction = named(makeImage(6, 5, 4, VTK_FLOAT, [](int i, int, int) { return i - 1.; }));
  vtkNew<vtkVisibilityFactorFilter> direct;
  direct->SetInputData(extinction);
  LT_CHECK_FAILS(suite, direct.Get(), "extinction -1", ">= 0");
  direct->RGBExtinctionOn();
  LT_CHECK_FAILS(suite, direct.Get(), "1 components, expected 3");
  direct->SetInputData(makeImage(0, 5, 4, VTK_FLOAT, [](int, int, int) { return 0.; }));
  LT_CHECK_FAILS(suite, direct.Get(), "empty");
  auto flat = named(makeImage(6, 5, 4, VTK_FLOAT, [](int, int, int) { return 1.; }));
  flat->SetSpacing(1., 0., 1.);
  direct->SetInputData(flat);
  direct->RGBExtinctionOff();
  LT_CHECK_FAILS(suite, direct.Get(), "spacing");
  flat->SetSpacing(1e-32, 1e-32, 1e-32);
  LT_CHECK_FAILS(suite, direct.Get(), "smallest spacing", "2e-29");
  flat->SetSpacing(1., 1., 1.);
  LT_CHECK(suite, errorsOfUpdate(direct).empty());

  // Stopped half-way: no error, an empty output, and the next update is whole.
  class Stop : public vtkCommand
  {
  public:
    static Stop* New() { return new Stop; }
    void Execute(vtkObject* caller, unsigned long, void* progress) override
    {
      if (*static_cast<double*>(progress) > 0.4)
      {
        static_cast<vtkAlgorithm*>(caller)->SetAbortExecute(1);
      }
    }
  };
  vtkNew<Stop> stop;
  direct->AddDirectionalLight(0., 0., 1.);
  direct->SetOrder(1);
  const unsigned long tag = direct->AddObserver(vtkCommand::ProgressEvent, stop);
  LT_CHECK(suite, errorsOfUpdate(direct).empty());
  LT_CHECK(suite, direct->GetOutput()->GetNumberOfPoints() == 0);
  direct->RemoveObserver(tag);
  direct->SetAbortExecute(0);
  direct->Modified();
  LT_CHECK(suite, errorsOfUpdate(direct).empty());
  LT_CHECK_NEAR(suite, at(direct, "Visibility", 1, 1, 1), std::exp(-2.5), 1e-6);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  extinction(suite);
  closedForms(suite);
  directions(suite);
  resolution(suite);
  colours(suite);
  kept(suite);
  degenerate(suite);
  badInput(suite);
  return suite.result();
}
