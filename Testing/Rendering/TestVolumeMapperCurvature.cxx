// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Opacity that follows curvature and depth, against closed forms: layers of an
 * isosurface, media, a field of curvature on its own grid, the turn
 * of the normal along the ray, depth; and what leaves the superclass's picture.
 */
#include "VolumeMapperScene.h"

#include "vtkActor.h"
#include "vtkBucketedKBufferPass.h"
#include "vtkContourValues.h"
#include "vtkCurvatureOpacityFunction.h"
#include "vtkMatrix3x3.h"
#include "vtkPlaneSource.h"
#include "vtkPolyDataMapper.h"
#include "vtkProperty.h"
#include "vtkTrivialProducer.h"
#include "vtkVolumeCurvatureFilter.h"
#include "vtkVolumeCurvatureProperty.h"
#include "vtkVolumeLightingProperty.h"

#include <array>
#include <cstdio>

using namespace lighttransport::testing;
using Function = vtkCurvatureOpacityFunction;

namespace
{
constexpr int N = 33;
constexpr int Size = 65;
constexpr double Pixel = 32. / Size; // where 32 units are seen

/** White, one opacity for everything; what is drawn is then the opacity of the ray. */
void makeWhite(LitScene& scene, double opacity)
{
  scene.color->RemoveAllPoints();
  scene.color->AddRGBPoint(0., 1., 1., 1.);
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(-1000., opacity);
  scene.opacity->AddPoint(1000., opacity);
  scene.property->SetScalarOpacityUnitDistance(1.);
}

void showIsosurfaces(LitScene& scene, const std::vector<double>& values)
{
  scene.mapper->SetBlendModeToIsoSurface();
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    scene.property->GetIsoSurfaceValues()->SetValue(int(i), values[i]);
  }
}

/** Seen along +z, a square of n x n units in the window; parallel. */
void lookAlongZ(LitScene& scene, double n, bool parallel = true)
{
  scene.look({ 0., 0., -1. }, parallel);
  scene.renderer->GetActiveCamera()->SetParallelScale(n / 2.);
}

/** A constant function. */
vtkSmartPointer<Function> constant(double value)
{
  auto function = vtkSmartPointer<Function>::New();
  function->SetKindToProduct();
  vtkNew<vtkPiecewiseFunction> flat;
  flat->AddPoint(0., value);
  flat->AddPoint(1., value);
  function->SetCurvatureFunction(flat);
  return function;
}

vtkSmartPointer<vtkImageData> volumeOf(const std::function<double(const Point&)>& f)
{
  auto image = makeGrid(N, N, N);
  setScalars(image, f);
  return image;
}

double slopeOfZ(const Point& p)
{
  return p[2];
}

double red(vtkImageData* picture, int x, int y)
{
  return pixel(picture, x, y)[0];
}

/** What the superclass draws stays: no property, no strength, no function, projections. */
void stays(Suite& suite)
{
  const auto image = volumeOf([](const Point& p) { return ball(p, { 16., 16., 16. }, 14.); });
  for (int blend : { vtkVolumeMapper::COMPOSITE_BLEND, vtkVolumeMapper::ISOSURFACE_BLEND,
         vtkVolumeMapper::MAXIMUM_INTENSITY_BLEND, vtkVolumeMapper::AVERAGE_INTENSITY_BLEND })
  {
    StockScene stock(image);
    stock.mapper->SetBlendMode(blend);
    stock.property->GetIsoSurfaceValues()->SetValue(0, 40.);
    const Picture expected = stock.capture();
    LitScene scene(image);
    scene.mapper->SetBlendMode(blend);
    scene.property->GetIsoSurfaceValues()->SetValue(0, 40.);
    LT_CHECK(suite, difference(expected, scene.capture()).largest == 0.);
    vtkNew<vtkVolumeCurvatureProperty> property;
    scene.mapper->SetCurvatureProperty(property);
    LT_CHECK(suite, scene.mapper->GetCurvatureProperty() == property.Get());
    const bool along =
      blend == vtkVolumeMapper::COMPOSITE_BLEND || blend == vtkVolumeMapper::ISOSURFACE_BLEND;
    LT_CHECK(suite, (difference(expected, scene.capture()).largest > 4.) == along);
    property->SetStrength(0.);
    LT_CHECK(suite, difference(expected, scene.capture()).largest == 0.);
    property->SetStrength(1.);
    property->SetOpacityFunction(constant(1.));
    LT_CHECK(suite, difference(expected, scene.capture()).largest <= 1.);
    property->SetOpacityFunction(nullptr);
    LT_CHECK(suite, difference(expected, scene.capture()).largest == 0.);
    LT_CHECK(suite, openGLErrors().empty());
  }
}

/** N layers: 1 - (1 - alpha f)^N; a medium: the transmittance to the power f. */
void layersAndMedium(Suite& suite)
{
  // Concentric spheres at three values: six layers behind each other in the middle.
  const auto image =
    volumeOf([](const Point& p) { return std::hypot(p[0] - 16., p[1] - 16., p[2] - 16.); });
  LitScene scene(image, Size, Size);
  makeWhite(scene, 0.3);
  showIsosurfaces(scene, { 5., 9., 13. });
  lookAlongZ(scene, 32.);
  vtkNew<vtkVolumeCurvatureProperty> property;
  property->SetOpacityFunction(constant(0.5));
  scene.mapper->SetCurvatureProperty(property);
  Picture picture = scene.capture();
  const int pixelsPer = 2; // a unit is 2 pixels; the middle is 32
  LT_CHECK_NEAR(suite, red(picture, 32, 32), 255. * (1. - std::pow(0.85, 6.)), 1.);
  LT_CHECK_NEAR(suite, red(picture, 32 + 7 * pixelsPer, 32), 255. * (1. - std::pow(0.85, 4.)), 1.);
  LT_CHECK_NEAR(suite, red(picture, 32, 32 - 11 * pixelsPer), 255. * (1. - std::pow(0.85, 2.)), 1.);
  LT_CHECK(suite, red(picture, 32 + 15 * pixelsPer, 32) == 0.);
  property->SetStrength(0.5); // f = 0.75
  LT_CHECK_NEAR(suite, red(scene.capture(), 32, 32), 255. * (1. - std::pow(0.775, 6.)), 1.);

  // A homogeneous medium: the same with half the extinction, whatever the sample distance.
  LitScene medium(volumeOf([](const Point&) { return 50.; }), Size, Size);
  makeWhite(medium, 0.05);
  lookAlongZ(medium, 32.);
  medium.mapper->SetSampleDistance(0.25F);
  const double whole = red(medium.capture(), 32, 32);
  medium.mapper->SetCurvatureProperty(property);
  property->SetStrength(1.);
  const double half = red(medium.capture(), 32, 32);
  LT_CHECK_NEAR(suite, half, 255. * (1. - std::sqrt(1. - whole / 255.)), 1.5);
  medium.mapper->SetSampleDistance(1.F);
  LT_CHECK_NEAR(suite, red(medium.capture(), 32, 32), half, 3.);
  LT_CHECK(suite, openGLErrors().empty());
}

/** A plane facing the camera, its curvature a ramp of the field: f at each pixel. */
void field(Suite& suite)
{
  LitScene scene(volumeOf(slopeOfZ), Size, Size);
  makeWhite(scene, 0.8);
  showIsosurfaces(scene, { 15.5 });
  lookAlongZ(scene, 32.);
  vtkNew<vtkVolumeCurvatureProperty> property;
  property->SetCurvatureScale(4.);
  scene.mapper->SetCurvatureProperty(property);

  // H = 0.02 (x - 10) on grids of their own: coarser, turned by 90 degrees, smaller.
  for (int turned = 0; turned < 2; ++turned)
  {
    auto curvature = vtkSmartPointer<vtkImageData>::New();
    curvature->SetDimensions(15, 13, 14);
    curvature->SetSpacing(2.5, 2.5, 2.5);
    if (turned)
    {
      vtkNew<vtkMatrix3x3> direction;
      const double m[9] = { 0., -1., 0., 1., 0., 0., 0., 0., 1. };
      direction->DeepCopy(m);
      curvature->SetDirectionMatrix(direction);
      curvature->SetOrigin(31., -1., -1.);
    }
    else
    {
      curvature->SetOrigin(-1., 1., -1.);
    }
    vtkNew<vtkDoubleArray> mean;
    mean->SetName(vtkLightTransportArrays::MeanCurvature);
    for (vtkIdType i = 0; i < curvature->GetNumberOfPoints(); ++i)
    {
      mean->InsertNextValue(0.02 * (curvature->GetPoint(i)[0] - 10.));
    }
    curvature->GetPointData()->AddArray(mean);
    vtkNew<vtkTrivialProducer> producer;
    producer->SetOutput(curvature);
    scene.mapper->SetCurvatureFieldConnection(producer->GetOutputPort());
    const Picture picture = scene.capture();
    double error = 0.;
    for (int i = 6; i < 58; ++i)
    {
      // Which way x runs in the picture: the camera looks along +z with y up.
      const double x = 16. - (i - 32) * Pixel;
      const double c = std::tanh(4. * 2. * std::abs(0.02 * (x - 10.)));
      const double f = 0.05 + 0.9 * (1. - (1. - c) * (1. - c));
      error = std::max(error, std::abs(red(picture, i, 32) - 255. * 0.8 * f));
    }
    LT_CHECK_NEAR(suite, error, 0., 2.5);
  }
  LT_CHECK(suite, openGLErrors().empty());
}

/** On a sphere of radius R the normal turns by sin(theta) / R along the ray. */
void alongRay(Suite& suite)
{
  const double R = 12.;
  LitScene scene(
    volumeOf([](const Point& p) { return std::hypot(p[0] - 16., p[1] - 16., p[2] - 16.); }), Size,
    Size);
  makeWhite(scene, 0.9);
  showIsosurfaces(scene, { R });
  lookAlongZ(scene, 32.);
  scene.mapper->SetSampleDistance(0.1F);
  vtkNew<vtkVolumeCurvatureProperty> property;
  property->SetCurvatureScale(R);
  scene.mapper->SetCurvatureProperty(property);
  const Picture picture = scene.capture();
  double error = 0.;
  for (int i = 12; i < 53; ++i)
  {
    const double b = std::abs((i - 32) * Pixel);
    const double c = std::tanh(R * (b / R) / R);
    const double layer = 0.9 * (0.05 + 0.9 * (1. - (1. - c) * (1. - c)));
    error =
      std::max(error, std::abs(red(picture, i, 32) - 255. * (1. - (1. - layer) * (1. - layer))));
  }
  // Two percent, of the step between sample and surface and of the central differences.
  LT_CHECK_NEAR(suite, error, 0., 5.);
  // In other units of length it is the same picture.
  auto large =
    volumeOf([](const Point& p) { return std::hypot(p[0] - 16., p[1] - 16., p[2] - 16.); });
  large->SetSpacing(1000., 1000., 1000.);
  LitScene other(large, Size, Size);
  makeWhite(other, 0.9);
  showIsosurfaces(other, { R });
  lookAlongZ(other, 32000.);
  other.mapper->SetSampleDistance(100.F);
  vtkNew<vtkVolumeCurvatureProperty> scaled;
  scaled->SetCurvatureScale(1000. * R);
  other.mapper->SetCurvatureProperty(scaled);
  LT_CHECK(suite, difference(picture, other.capture()).mean < 0.5);
  LT_CHECK(suite, openGLErrors().empty());
}

/** A medium: curvature from a field, from the ray and depth, each against its integral. */
void dense(Suite& suite)
{
  vtkNew<vtkVolumeCurvatureProperty> property;
  const double alpha = 0.05;                  // of a unit of length
  const double sigma = -std::log(1. - alpha); // extinction
  const auto curved = [](double c) { return 0.05 + 0.9 * (1. - (1. - c) * (1. - c)); };

  // A field of H = 0.02 x in all of it: the transmittance to the power f.
  LitScene scene(volumeOf([](const Point&) { return 50.; }), Size, Size);
  makeWhite(scene, alpha);
  lookAlongZ(scene, 32.);
  scene.mapper->SetSampleDistance(0.25F);
  const double whole = red(scene.capture(), 32, 32);
  LT_CHECK_NEAR(suite, whole, 255. * (1. - std::exp(-32. * sigma)), 4.);
  auto field = makeGrid(N, N, N);
  vtkNew<vtkDoubleArray> mean;
  mean->SetName(vtkLightTransportArrays::MeanCurvature);
  for (vtkIdType i = 0; i < field->GetNumberOfPoints(); ++i)
  {
    mean->InsertNextValue(-0.02 * field->GetPoint(i)[0]);
  }
  field->GetPointData()->AddArray(mean);
  vtkNew<vtkTrivialProducer> producer;
  producer->SetOutput(field);
  scene.mapper->SetCurvatureFieldConnection(producer->GetOutputPort());
  property->SetCurvatureScale(1.5);
  scene.mapper->SetCurvatureProperty(property);
  Picture picture = scene.capture();
  double error = 0.;
  for (int i = 4; i < 60; ++i)
  {
    const double x = 16. - (i - 32) * Pixel;
    const double f = curved(std::tanh(1.5 * 2. * 0.02 * x));
    error =
      std::max(error, std::abs(red(picture, i, 32) - 255. * (1. - std::pow(1. - whole / 255., f))));
  }
  LT_CHECK_NEAR(suite, error, 0., 2.);

  // Nearest is opaque: the mean of 0.95 (1 - z) over depth, where all is curved.
  property->GetOpacityFunction()->SetKindToFrontOpaque();
  property->GetOpacityFunction()->SetMinimumOpacity(0.);
  property->SetCurvatureScale(1e6);
  LT_CHECK_NEAR(
    suite, red(scene.capture(), 40, 32), 255. * (1. - std::pow(1. - whole / 255., 0.95 / 2.)), 2.);

  // Along the ray: |kappa| = tanh(s b / r^2) at the distances b of the ray and r of the sample
  // from the middle of spheres; the medium is a shell, 6 < r < 13.
  const double s = 12.;
  LitScene shells(
    volumeOf([](const Point& p) { return std::hypot(p[0] - 16., p[1] - 16., p[2] - 16.); }), Size,
    Size);
  makeWhite(shells, alpha);
  shells.opacity->RemoveAllPoints();
  for (const auto& node : std::vector<std::array<double, 2>>{
         { { 5.5, 0. } }, { { 6.5, alpha } }, { { 12.5, alpha } }, { { 13.5, 0. } } })
  {
    shells.opacity->AddPoint(node[0], node[1]);
  }
  lookAlongZ(shells, 32.);
  shells.mapper->SetSampleDistance(0.5F);
  vtkNew<vtkVolumeCurvatureProperty> along;
  along->SetCurvatureScale(s);
  shells.mapper->SetCurvatureProperty(along);
  picture = shells.capture();
  error = 0.;
  double largest = 0.;
  for (int i = 8; i < 57; ++i)
  {
    const double b = std::abs((i - 32) * Pixel);
    double depth = 0.;
    const double step = 0.02;
    for (double z = -15.; z < 15.; z += step)
    {
      const double r = std::hypot(b, z);
      const double a =
        alpha * std::min(std::min(std::max(r - 5.5, 0.), 1.), std::min(std::max(13.5 - r, 0.), 1.));
      depth -= std::log(1. - a) * curved(std::tanh(s * b / r / r)) * step;
    }
    const double expected = 255. * (1. - std::exp(-depth));
    error = std::max(error, std::abs(red(picture, i, 32) - expected));
    largest = std::max(largest, expected);
  }
  std::printf("a shell by the turn of the normal: off by %.1f of %.1f\n", error, largest);
  LT_CHECK_NEAR(suite, error, 0., 5.);

  // The same as the second of two dependent components, which makes the opacity.
  auto two = makeGrid(N, N, N);
  vtkNew<vtkFloatArray> pair;
  pair->SetNumberOfComponents(2);
  for (vtkIdType i = 0; i < two->GetNumberOfPoints(); ++i)
  {
    const double* p = two->GetPoint(i);
    pair->InsertNextTuple2(50. + p[0], std::hypot(p[0] - 16., p[1] - 16., p[2] - 16.));
  }
  two->GetPointData()->SetScalars(pair);
  LitScene dependent(two, Size, Size);
  dependent.property->IndependentComponentsOff();
  dependent.color->RemoveAllPoints();
  dependent.color->AddRGBPoint(0., 1., 1., 1.);
  dependent.property->SetScalarOpacity(shells.opacity);
  dependent.property->SetScalarOpacityUnitDistance(1.);
  lookAlongZ(dependent, 32.);
  dependent.mapper->SetSampleDistance(0.5F);
  dependent.mapper->SetCurvatureProperty(along);
  LT_CHECK(suite, difference(picture, dependent.capture()).largest <= 2.);
  LT_CHECK(suite, openGLErrors().empty());
}

/** Three planes: depth 1/4, 1/2, 3/4 of the volume, from before and from behind. */
void depth(Suite& suite)
{
  LitScene scene(volumeOf(slopeOfZ), Size, Size);
  makeWhite(scene, 0.9);
  showIsosurfaces(scene, { 8., 16., 24. });
  scene.mapper->SetSampleDistance(0.25F);
  vtkNew<vtkVolumeCurvatureProperty> property;
  property->GetOpacityFunction()->SetKindToFrontOpaque();
  property->GetOpacityFunction()->SetMinimumOpacity(0.);
  scene.mapper->SetCurvatureProperty(property);
  // All of it curved: a field of one curvature.
  auto curvature = makeGrid(2, 2, 2);
  curvature->SetSpacing(32., 32., 32.);
  vtkNew<vtkFloatArray> mean;
  mean->SetName(vtkLightTransportArrays::MeanCurvature);
  for (int i = 0; i < 8; ++i)
  {
    mean->InsertNextValue(100.F);
  }
  curvature->GetPointData()->AddArray(mean);
  vtkNew<vtkTrivialProducer> producer;
  producer->SetOutput(curvature);
  scene.mapper->SetCurvatureFieldConnection(producer->GetOutputPort());
  property->SetCurvatureScale(1.);
  double clear = 1.;
  for (double z : { 0.25, 0.5, 0.75 })
  {
    clear *= 1. - 0.9 * 0.95 * (1. - z);
  }
  for (bool parallel : { true, false })
  {
    for (double side : { -1., 1. })
    {
      scene.look({ 0., 0., side }, parallel);
      LT_CHECK_NEAR(suite, red(scene.capture(), 32, 32), 255. * (1. - clear), 2.);
    }
  }
  // Only the middle plane is opaque enough to be seen, and the actor's scale does not matter.
  scene.volume->SetScale(3., 3., 3.);
  scene.volume->RotateZ(40.);
  scene.look({ 0., 0., 1. }, true);
  LT_CHECK_NEAR(suite, red(scene.capture(), 32, 32), 255. * (1. - clear), 2.);
  LT_CHECK(suite, openGLErrors().empty());
}

/** An image that is turned by its direction matrix, and the camera with it: the same picture. */
void oriented(Suite& suite)
{
  Picture pictures[2];
  for (int turned = 0; turned < 2; ++turned)
  {
    auto image = makeGrid(N, 25, 21);
    image->SetSpacing(1., 1.2, 1.5);
    vtkNew<vtkFloatArray> array;
    for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
    {
      double p[3]; // before it is turned
      image->GetPoint(i, p);
      array->InsertNextValue(
        static_cast<float>(std::hypot(p[0] - 15., 1.3 * (p[1] - 14.), p[2] - 16.)));
    }
    image->GetPointData()->SetScalars(array);
    if (turned)
    {
      // x becomes y, y becomes -x.
      vtkNew<vtkMatrix3x3> direction;
      const double m[9] = { 0., -1., 0., 1., 0., 0., 0., 0., 1. };
      direction->DeepCopy(m);
      image->SetDirectionMatrix(direction);
    }
    LitScene scene(image, Size, Size);
    makeWhite(scene, 0.6);
    showIsosurfaces(scene, { 6., 10. });
    scene.mapper->SetSampleDistance(0.2F);
    vtkNew<vtkVolumeCurvatureFilter> filter;
    filter->SetInputData(image);
    filter->InsideIsBrightOff();
    vtkNew<vtkVolumeCurvatureProperty> property;
    property->GetOpacityFunction()->SetKindToWideDepth();
    scene.mapper->SetCurvatureProperty(property);
    scene.mapper->SetCurvatureFieldConnection(filter->GetOutputPort());
    scene.look(turned ? Point{ .6, -1., .5 } : Point{ -1., -.6, .5 }, true);
    pictures[turned] = scene.capture();
  }
  const Difference apart = difference(pictures[0], pictures[1]);
  LT_CHECK(suite, apart.mean < 0.5 && apart.fractionDiffering < 0.01);
  LT_CHECK(suite, regionMean(pictures[0], 0, 0, Size - 1, Size - 1)[0] > 10.);
}

/**
 * Three translucent squares in a homogeneous medium, each seen through what lies before it,
 * by VTK's depth peeling for volumes and by the k-buffer.
 */
void betweenSurfaces(Suite& suite)
{
  LitScene scene(volumeOf([](const Point&) { return 50.; }), 17, 17);
  makeWhite(scene, 0.05);
  scene.mapper->SetSampleDistance(0.05F);
  scene.renderer->SetUseDepthPeeling(true);
  scene.renderer->SetUseDepthPeelingForVolumes(true);
  scene.renderer->SetMaximumNumberOfPeels(20);
  scene.renderer->SetOcclusionRatio(0.);
  scene.window->SetAlphaBitPlanes(true);
  const double places[3] = { 5., 13., 22. };
  for (int i = 0; i < 3; ++i)
  {
    vtkNew<vtkPlaneSource> square;
    square->SetOrigin(-40., -40., places[i]);
    square->SetPoint1(80., -40., places[i]);
    square->SetPoint2(-40., 80., places[i]);
    vtkNew<vtkPolyDataMapper> mapper;
    mapper->SetInputConnection(square->GetOutputPort());
    vtkNew<vtkActor> actor;
    actor->SetMapper(mapper);
    actor->GetProperty()->LightingOff();
    actor->GetProperty()->SetColor(i == 0, i == 1, i == 2);
    actor->GetProperty()->SetOpacity(0.4);
    scene.renderer->AddActor(actor);
  }
  vtkNew<vtkVolumeCurvatureProperty> property;
  property->SetOpacityFunction(constant(0.5));
  vtkNew<vtkBucketedKBufferPass> pass;
  for (int kind = 0; kind < 4; ++kind)
  {
    // By VTK's depth peeling and by the k-buffer, as it is and with half the extinction.
    const bool curved = kind % 2 == 1;
    scene.renderer->SetPass(kind < 2 ? nullptr : pass.Get());
    scene.mapper->SetCurvatureProperty(curved ? property.Get() : nullptr);
    for (double side : { -1., 1. })
    {
      scene.look({ 0., 0., side }, true);
      Color expected = { 0., 0., 0. };
      double clear = 1.;
      double at = side < 0. ? 0. : 32.;
      for (int step = 0; step < 4; ++step)
      {
        const int i = side < 0. ? step : 2 - step;
        const double next = step == 3 ? (side < 0. ? 32. : 0.) : places[i];
        const double through = std::pow(0.95, std::abs(next - at) * (curved ? 0.5 : 1.));
        at = next;
        for (double& channel : expected)
        {
          channel += clear * (1. - through) * 255.;
        }
        clear *= through;
        if (step < 3)
        {
          expected[i] += clear * 0.4 * 255.;
          clear *= 0.6;
        }
      }
      const Picture picture = scene.capture();
      for (int c = 0; c < 3; ++c)
      {
        LT_CHECK_NEAR(suite, pixel(picture, 8, 8)[c], expected[c], 1.5);
      }
    }
  }
  LT_CHECK(suite, openGLErrors().empty());
}

/** A camera that turns by small steps changes the picture by small steps. */
void turning(Suite& suite)
{
  LitScene scene(
    volumeOf([](const Point& p) { return std::hypot(p[0] - 16., p[1] - 16., p[2] - 13.); }), Size,
    Size);
  makeWhite(scene, 0.4);
  showIsosurfaces(scene, { 5., 10. });
  scene.mapper->SetSampleDistance(0.4F);
  vtkNew<vtkVolumeCurvatureProperty> property;
  property->GetOpacityFunction()->SetKindToWideDepth();
  scene.mapper->SetCurvatureProperty(property);
  scene.look({ -1., -.6, .5 });
  Picture before = scene.capture();
  double largest = 0.;
  double sum = 0.;
  const int steps = 10;
  for (int i = 0; i < steps; ++i)
  {
    // Through the diagonals of the box, where its nearest corner changes.
    scene.renderer->GetActiveCamera()->Azimuth(3.);
    const Picture now = scene.capture();
    const double change = difference(before, now).mean;
    largest = std::max(largest, change);
    sum += change;
    before = now;
  }
  std::printf("3 degrees change the mean by %.3f, at most %.3f\n", sum / steps, largest);
  LT_CHECK(suite, sum > 0. && largest < 2. * sum / steps);
}

/** With light and with a filter as producer; errors are one each, and the picture remains. */
void together(Suite& suite)
{
  const auto image = volumeOf([](const Point& p) { return ball(p, { 16., 16., 16. }, 14.); });
  StockScene stock(image);
  const Picture plain = stock.capture();
  LitScene scene(image);
  auto log = observe(scene.mapper);
  vtkNew<vtkVolumeCurvatureFilter> filter;
  filter->SetInputData(image);
  vtkNew<vtkVolumeCurvatureProperty> property;
  scene.mapper->SetCurvatureProperty(property);
  scene.mapper->SetCurvatureFieldConnection(filter->GetOutputPort());
  const Picture curved = scene.capture();
  LT_CHECK(suite, difference(plain, curved).mean > 1.);
  const int builds = scene.mapper->GetNumberOfShaderBuilds();
  property->GetOpacityFunction()->SetMinimumOpacity(0.5);
  LT_CHECK(suite, difference(curved, scene.capture()).mean > 0.3);

  auto light = makeGrid(12, 12, 12);
  light->SetSpacing(3., 3., 3.);
  setFluence(light, [](const Point& p) { return glow(p, { 16., 16., 16. }, .2); });
  scene.mapper->SetLightFieldData(light);
  scene.mapper->GetLightFieldProperty()->SetMode(vtkLightFieldProperty::Illuminate);
  const Picture lit = scene.capture();
  scene.mapper->SetCurvatureProperty(nullptr);
  const Picture litOnly = scene.capture();
  LT_CHECK(suite, difference(lit, litOnly).mean > 0.3 && difference(lit, curved).mean > 0.3);
  LT_CHECK(suite, builds == 0); // of the light's shader; there was none yet
  scene.mapper->SetLightFieldData(nullptr);
  LT_CHECK(suite, difference(plain, scene.capture()).largest == 0.);

  // With shadows: what curvature clears is not lit either.
  vtkNew<vtkVolumeLightingProperty> lighting;
  scene.mapper->SetLightingProperty(lighting);
  scene.property->ShadeOn();
  const Picture shadows = scene.capture();
  scene.mapper->SetCurvatureProperty(property);
  LT_CHECK(suite, difference(shadows, scene.capture()).mean > 0.3);
  property->SetOpacityFunction(constant(1.));
  LT_CHECK(suite, difference(shadows, scene.capture()).largest <= 1.);
  property->SetOpacityFunction(vtkSmartPointer<Function>::New());
  scene.mapper->SetLightingProperty(nullptr);
  scene.property->ShadeOff();
  scene.mapper->SetCurvatureProperty(property);
  LT_CHECK(suite, log->all().empty());

  // What is wrong is told once, and what is drawn is the superclass's picture.
  vtkNew<vtkTrivialProducer> producer;
  producer->SetOutput(light);
  scene.mapper->SetCurvatureFieldConnection(producer->GetOutputPort());
  LT_CHECK(suite, difference(plain, scene.capture()).largest == 0.);
  scene.capture();
  LT_CHECK(suite, log->errors.size() == 1 && log->hasError("MeanCurvature"));
  scene.mapper->SetCurvatureFieldConnection(nullptr);
  property->GetOpacityFunction()->SetKind(9);
  LT_CHECK(suite, difference(plain, scene.capture()).largest == 0.);
  LT_CHECK(suite, log->errors.size() == 2 && log->hasError("Kind is 9"));
  property->GetOpacityFunction()->SetKindToCurvatureOnly();
  LT_CHECK(suite, difference(plain, scene.capture()).mean > 1.);
  LT_CHECK(suite, log->errors.size() == 2);

  property->SetStrength(7.);
  LT_CHECK(suite, property->GetStrength() == 1.);
  property->SetCurvatureScale(-1.);
  LT_CHECK(suite, property->GetCurvatureScale() == 0.);
  LT_CHECK(suite, openGLErrors().empty());
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  if (!canRender())
  {
    return Suite::skipped();
  }
  const KeepDisplay keep;
  stays(suite);
  layersAndMedium(suite);
  field(suite);
  alongRay(suite);
  dense(suite);
  depth(suite);
  oriented(suite);
  betweenSurfaces(suite);
  turning(suite);
  together(suite);
  return suite.result();
}
