// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * What the light looks like, by numbers: colours and opacities in closed form,
 * the place of the light for grids that differ in every way from the volume's,
 * both signs, both scales, the projections, Illuminate, FluxDirection.
 */
#include "VolumeMapperScene.h"

#include "vtkMatrix3x3.h"
#include "vtkPlane.h"
#include "vtkTransform.h"

using namespace lighttransport::testing;

namespace
{
constexpr int N = 20;
constexpr double L = N - 1;

/** A volume without opacity: all that is seen is light. */
vtkSmartPointer<vtkImageData> emptyVolume()
{
  auto image = makeGrid(N, N, N);
  setScalars(image, [](const Point&) { return 0.; });
  image->GetPointData()->GetScalars()->SetTuple1(0, 100.); // a range
  return image;
}

void makeTransparent(LitScene& scene)
{
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(0., 0.);
  scene.opacity->AddPoint(100., 0.);
}

/** The colour of thick light is the colour map's, for either sign and any decade. */
void testColors(Suite& suite)
{
  LitScene scene(emptyVolume());
  makeTransparent(scene);
  scene.look({ 0., -1., 0. }, true);
  vtkLightFieldProperty* light = scene.mapper->GetLightFieldProperty();
  vtkNew<vtkPiecewiseFunction> solid;
  solid->AddPoint(0., 1.);
  solid->AddPoint(1., 1.);
  light->SetLightOpacityFunction(solid);
  light->SetLightOpacity(1.);
  auto image = makeGrid(N, N, N);
  for (const double sign : { 1., -1. })
  {
    for (const double decade : { 0., -1.5, -3., -5.5 })
    {
      const double value = sign * std::pow(10., decade);
      setFluence(image, [&](const Point& p) { return p[0] == 0. && p[2] == 0. ? 1. : value; });
      scene.mapper->SetLightFieldData(image);
      const Color seen = pixel(scene.capture(), 32, 32);
      double expected[3];
      (sign > 0. ? light->GetPositiveColorMap() : light->GetNegativeColorMap())
        ->GetColor(1. + decade / 6., expected);
      for (int c = 0; c < 3; ++c)
      {
        LT_CHECK_NEAR(suite, seen[c], 255. * expected[c], 1.6);
      }
    }
  }
  LT_CHECK(suite, scene.mapper->GetNumberOfShaderBuilds() == 1);
}

/** 1 - (1 - o)^(path / unit) of the light's colour over the background, whatever the steps. */
void testOpacity(Suite& suite)
{
  LitScene scene(emptyVolume());
  makeTransparent(scene);
  scene.look({ 0., -1., 0. }, true);
  scene.renderer->SetBackground(0., 0., 1.);
  vtkLightFieldProperty* light = scene.mapper->GetLightFieldProperty();
  useGreyLight(light);
  auto image = makeGrid(N, N, N);
  setFluence(image, [](const Point&) { return 3.; });
  scene.mapper->SetLightFieldData(image);
  for (const double opacity : { .2, .5, .9 })
  {
    for (const double unit : { L, 2. * L })
    {
      for (const float step : { .1F, .4F })
      {
        for (const double strength : { 1., .5 })
        {
          light->SetLightOpacity(opacity);
          light->SetLightOpacityUnitDistance(unit);
          light->SetStrength(strength);
          scene.mapper->SetSampleDistance(step);
          const Color seen = pixel(scene.capture(), 32, 32);
          // VTK takes L / step samples, one more or less.
          const double a = 1. - std::pow(1. - strength * opacity, L / unit);
          const double tolerance =
            1. + 255. * 1.5 * step / unit * -std::log(1. - strength * opacity);
          LT_CHECK_NEAR(suite, seen[0], 255. * a, tolerance);
          LT_CHECK_NEAR(suite, seen[2], 255., 1.);
        }
      }
    }
  }
}

/** One decade is one step of the grey ramp; the linear scale is linear. */
void testScales(Suite& suite)
{
  LitScene scene(emptyVolume(), 140, 140);
  makeTransparent(scene);
  scene.look({ 0., -1., 0. }, true); // x to the right
  vtkLightFieldProperty* light = scene.mapper->GetLightFieldProperty();
  useGreyLight(light);
  // Seven slabs along x, the strongest on the right.
  auto image = makeGrid(7 * 4, 2, 2);
  image->SetSpacing(L / 28., L, L);
  image->SetOrigin(L / 56., 0., 0.);
  const auto slab = [](double x) { return std::min(6, static_cast<int>(x / (L / 7.))); };
  setFluence(image, [&](const Point& p) { return std::pow(10., slab(p[0]) - 6.); });
  scene.mapper->SetLightFieldData(image);
  const auto center = [&](int i)
  {
    scene.renderer->SetWorldPoint((i + .5) * L / 7., 0., L / 2., 1.);
    scene.renderer->WorldToDisplay();
    return static_cast<int>(scene.renderer->GetDisplayPoint()[0]);
  };
  const auto check = [&](const std::function<double(int)>& t)
  {
    const Picture picture = scene.capture();
    for (int i = 0; i < 7; ++i)
    {
      LT_CHECK_NEAR(suite, pixel(picture, center(i), 70)[0], 255. * t(i), 1.6);
    }
  };
  check([](int i) { return i / 6.; });
  light->SetDecades(3.);
  check([](int i) { return std::max(0., (i - 3) / 3.); });
  light->SetWindow(1e-4, 1e-2);
  check([](int i) { return std::min(1., std::max(0., (i - 2) / 2.)); });
  light->SetScaleToLinear();
  light->SetWindow(0., .2);
  check([](int i) { return std::min(1., std::pow(10., i - 6.) / .2); });
  light->AutomaticWindowOn();
  check([](int i) { return std::pow(10., i - 6.); });
  LT_CHECK(suite, scene.mapper->GetNumberOfShaderBuilds() == 1);
  LT_CHECK(suite, scene.mapper->GetNumberOfLightFieldUploads() == 1);
}

/** Where the brightness has its centre, in pixels; and how much of it there is. */
Point centroid(vtkImageData* picture)
{
  int d[3];
  picture->GetDimensions(d);
  double sum = 0.;
  double x = 0.;
  double y = 0.;
  for (int j = 0; j < d[1]; ++j)
  {
    for (int i = 0; i < d[0]; ++i)
    {
      const double w = pixel(picture, i, j)[0];
      sum += w;
      x += w * (i + .5);
      y += w * (j + .5);
    }
  }
  return { x / std::max(sum, 1.), y / std::max(sum, 1.), sum };
}

/** A light at a known point near a corner is seen there, from all sides. */
void testPlaces(Suite& suite)
{
  const double turned[9] = { 0., -1., 0., .8, 0., -.6, .6, 0., .8 };
  const double mirrored[9] = { 0., 0., 1., 0., -1., 0., 1., 0., 0. };
  for (int config = 0; config < 6; ++config)
  {
    auto volume = makeGrid(14, 18, 11);
    volume->SetSpacing(1., .8, 1.3);
    volume->SetOrigin(-3., 10., 20.);
    auto field = makeGrid(N, N, N);
    // Fields cover the volume and more; all grids but the first differ from it.
    if (config == 0)
    {
      field->CopyStructure(volume);
    }
    if (config >= 2)
    {
      volume->SetExtent(5, 18, -4, 13, 2, 12);
      volume->SetDirectionMatrix(turned);
    }
    double b[6];
    volume->GetBounds(b);
    if (config >= 1)
    {
      field->SetExtent(-7, 22, 3, 26, 1, 31);
      double spacing = 0.;
      for (int a = 0; a < 3; ++a)
      {
        spacing = std::max(spacing, (b[2 * a + 1] - b[2 * a]) / 20.);
      }
      field->SetSpacing(spacing, 1.1 * spacing, .9 * spacing);
      if (config >= 3)
      {
        field->SetDirectionMatrix(config == 4 ? mirrored : turned);
      }
      // Its middle to the volume's middle.
      double c[3];
      field->SetOrigin(0., 0., 0.);
      field->TransformContinuousIndexToPhysicalPoint(7.5, 14.5, 16., c);
      field->SetOrigin(
        (b[0] + b[1]) / 2. - c[0], (b[2] + b[3]) / 2. - c[1], (b[4] + b[5]) / 2. - c[2]);
    }
    setScalars(volume, [](const Point&) { return 0.; });
    volume->GetPointData()->GetScalars()->SetTuple1(0, 100.);

    // A point of the volume near the corner of its last index.
    int e[6];
    volume->GetExtent(e);
    double place[3];
    volume->TransformContinuousIndexToPhysicalPoint(
      e[0] + .75 * (e[1] - e[0]), e[2] + .7 * (e[3] - e[2]), e[4] + .7 * (e[5] - e[4]), place);
    setFluence(field,
      [&](const Point& p)
      {
        const double d = std::hypot(p[0] - place[0], p[1] - place[1], p[2] - place[2]);
        return std::exp(-d * d / 2.);
      });

    LitScene scene(volume, 120, 120);
    makeTransparent(scene);
    useGreyLight(scene.mapper->GetLightFieldProperty());
    scene.mapper->GetLightFieldProperty()->SetScaleToLinear();
    scene.mapper->GetLightFieldProperty()->SetLightOpacity(.3);
    vtkNew<vtkPiecewiseFunction> ramp; // weak light must not hide the strong
    ramp->AddPoint(0., 0.);
    ramp->AddPoint(1., 1.);
    scene.mapper->GetLightFieldProperty()->SetLightOpacityFunction(ramp);
    scene.mapper->SetLightFieldData(field);
    double seen[4] = { place[0], place[1], place[2], 1. };
    if (config == 5)
    {
      vtkNew<vtkTransform> transform;
      transform->RotateWXYZ(40., 1., 2., 3.);
      transform->Scale(1.5, 1.5, 1.5);
      transform->Translate(3., -2., 1.);
      scene.volume->SetUserTransform(transform);
      transform->GetMatrix()->MultiplyPoint(seen, seen);
    }
    for (const Point& from :
      { Point{ 0., -1., 0. }, Point{ -1., 0., 0. }, Point{ 0., 0., 1. }, Point{ 1., .7, -.4 } })
    {
      scene.look(from, config % 2 == 0);
      const Picture picture = scene.capture();
      scene.renderer->SetWorldPoint(seen);
      scene.renderer->WorldToDisplay();
      const double* display = scene.renderer->GetDisplayPoint();
      const Point center = centroid(picture);
      const std::string name = "grids " + std::to_string(config) + ": ";
      suite.check(center[2] > 1000., name + "light is seen", __FILE__, __LINE__);
      suite.check(std::hypot(center[0] - display[0], center[1] - display[1]) < 1.5,
        name + "light at " + std::to_string(center[0]) + ", " + std::to_string(center[1]) +
          ", expected " + std::to_string(display[0]) + ", " + std::to_string(display[1]),
        __FILE__, __LINE__);
    }
  }
}

/** There is no light outside the field's own domain, half a spacing beyond its points. */
void testDomain(Suite& suite)
{
  LitScene scene(emptyVolume(), 100, 100);
  makeTransparent(scene);
  scene.look({ 0., -1., 0. }, true);
  useGreyLight(scene.mapper->GetLightFieldProperty());
  auto image = makeGrid(3, 3, 3); // points 4, 8, 12: domain 2 to 14
  image->SetSpacing(4., 4., 4.);
  image->SetOrigin(4., 4., 4.);
  setFluence(image, [](const Point&) { return 1.; });
  scene.mapper->SetLightFieldData(image);
  const Picture picture = scene.capture();
  for (const double x : { 1.6, 2.4, 13.6, 14.4 })
  {
    scene.renderer->SetWorldPoint(x, 8., 8., 1.);
    scene.renderer->WorldToDisplay();
    const double* d = scene.renderer->GetDisplayPoint();
    const double seen = pixel(picture, static_cast<int>(d[0]), static_cast<int>(d[1]))[0];
    LT_CHECK_NEAR(suite, seen, x > 2. && x < 14. ? 255. : 0., 1.5);
  }
}

/** Huge, tiny and 16-bit fields look the same. */
void testPrecision(Suite& suite)
{
  LitScene scene(emptyVolume());
  makeTransparent(scene);
  auto image = makeGrid(N, N, N);
  const auto phi = [](const Point& p) {
    return glow(p, { 5., 5., 5. }, .8) - glow(p, { 14., 10., 12. }, .8);
  };
  setFluence<vtkDoubleArray>(image, phi);
  scene.mapper->SetFloatFieldLimit(1 << 20);
  scene.mapper->SetLightFieldData(image);
  const Picture reference = scene.capture();
  writePicture(suite, reference, "VolumeMapperPrecision");
  LT_CHECK(suite, regionMean(reference, 0, 0, 63, 63)[0] > 5.);
  for (const double power : { 1e-30, 1e30, 1e-200, 1e200 })
  {
    setFluence<vtkDoubleArray>(image, [&](const Point& p) { return power * phi(p); });
    LT_CHECK(suite, difference(reference, scene.capture()).largest <= 1.);
    LT_CHECK_CLOSE(suite, scene.mapper->GetLightFieldMaximum() / power, 2., .2);
  }
  scene.mapper->SetFloatFieldLimit(0);
  setFluence<vtkDoubleArray>(image, phi);
  LT_CHECK(suite, difference(reference, scene.capture()).largest <= 2.);
}

/** Tissue takes the light's colour by o; unlit tissue fades by TissueOpacity. */
void testTissue(Suite& suite)
{
  auto volume = makeGrid(N, N, N);
  setScalars(volume, [](const Point&) { return 100.; });
  volume->GetPointData()->GetScalars()->SetTuple1(0, 0.);
  LitScene scene(volume);
  scene.look({ 0., -1., 0. }, true);
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(0., 1.);
  scene.opacity->AddPoint(100., 1.);
  scene.color->RemoveAllPoints();
  scene.color->AddRGBPoint(0., 0., 1., 0.);
  scene.color->AddRGBPoint(100., 0., 1., 0.);
  vtkLightFieldProperty* light = scene.mapper->GetLightFieldProperty();
  useGreyLight(light);
  light->SetLightOpacity(.6);
  auto image = makeGrid(N, N, N);
  setFluence(image, [](const Point&) { return 1.; });
  scene.mapper->SetLightFieldData(image);
  Color seen = pixel(scene.capture(), 32, 32);
  LT_CHECK_NEAR(suite, seen[0], 255. * .6, 1.5);
  LT_CHECK_NEAR(suite, seen[1], 255., 1.5);
  light->SetStrength(.5);
  seen = pixel(scene.capture(), 32, 32);
  LT_CHECK_NEAR(suite, seen[0], 255. * .3, 1.5);

  // Illuminate: the strongest light makes white of bright tissue, and not more.
  light->SetStrength(1.);
  light->SetModeToIlluminate();
  seen = pixel(scene.capture(), 32, 32);
  LT_CHECK_NEAR(suite, seen[1], 255., 1.5);
  LT_CHECK_NEAR(suite, seen[0], 0., 1.5);
  // A millionth of it leaves half of the colour, at full opacity of the tissue.
  light->SetTissueOpacity(1.);
  light->SetWindow(10., 100.);
  seen = pixel(scene.capture(), 32, 32);
  LT_CHECK_NEAR(suite, seen[1], 127.5, 1.5);
  // Halfway in the window: 0.5 + 3.5 / 2 of a dark green, 0.2.
  scene.color->RemoveAllPoints();
  scene.color->AddRGBPoint(0., 0., .2, 0.);
  light->SetWindow(.1, 10.);
  seen = pixel(scene.capture(), 32, 32);
  LT_CHECK_NEAR(suite, seen[1], 255. * .2 * 2.25, 1.5);

  // Unlit tissue, in front of a blue background: N samples of half the opacity.
  light->SetModeToOverlay();
  light->SetWindow(10., 100.);
  light->SetLightOpacity(0.);
  vtkNew<vtkPiecewiseFunction> ramp;
  ramp->AddPoint(0., 0.);
  ramp->AddPoint(1., 1.);
  light->SetLightOpacityFunction(ramp);
  light->SetTissueOpacity(.5);
  scene.renderer->SetBackground(0., 0., 1.);
  scene.mapper->SetSampleDistance(static_cast<float>(L / 3.999));
  seen = pixel(scene.capture(), 32, 32);
  // 3 or 4 samples.
  LT_CHECK(suite, seen[2] > 255. / 16. - 2. && seen[2] < 255. / 8. + 2.);
}

/** Projections: the strongest light along the ray; the light of the projected sample. */
void testProjections(Suite& suite)
{
  auto volume = makeGrid(N, N, N);
  // The brightest tissue lies in the plane y = 15, the darkest in y = 4.
  setScalars(volume, [](const Point& p) { return p[1] == 15. ? 100. : p[1] == 4. ? 0. : 50.; });
  LitScene scene(volume);
  scene.look({ 0., -1., 0. }, true);
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(0., 1.);
  scene.color->RemoveAllPoints();
  scene.color->AddRGBPoint(0., 0., .2, 0.);
  scene.mapper->SetSampleDistance(.25F);
  vtkLightFieldProperty* light = scene.mapper->GetLightFieldProperty();
  useGreyLight(light);
  light->SetScaleToLinear();
  auto image = makeGrid(N, N, N);
  setFluence(image, [](const Point& p) { return p[1] > 9.5 ? .5 : p[1] > 6.5 ? 1. : .25; });
  scene.mapper->SetLightFieldData(image);
  for (const bool maximum : { true, false })
  {
    scene.mapper->SetBlendMode(maximum ? vtkVolumeMapper::MAXIMUM_INTENSITY_BLEND
                                       : vtkVolumeMapper::MINIMUM_INTENSITY_BLEND);
    light->SetModeToOverlay();
    light->SetLightOpacity(.999);
    LT_CHECK_NEAR(suite, pixel(scene.capture(), 32, 32)[0], 255., 2.);
    light->SetLightOpacity(.5);
    Color seen = pixel(scene.capture(), 32, 32);
    LT_CHECK_NEAR(suite, seen[0], 127.5, 2.);
    LT_CHECK_NEAR(suite, seen[1], 127.5 + .1 * 255., 2.);
    light->SetModeToIlluminate();
    seen = pixel(scene.capture(), 32, 32);
    LT_CHECK_NEAR(suite, seen[1], 255. * .2 * (.5 + 3.5 * (maximum ? .5 : .25)), 2.);
  }
  // A slice: the light over it by its opacity.
  vtkNew<vtkPlane> plane;
  plane->SetOrigin(0., 12., 0.);
  plane->SetNormal(0., 1., 0.);
  scene.property->SetSliceFunction(plane);
  scene.mapper->SetBlendMode(vtkVolumeMapper::SLICE_BLEND);
  light->SetModeToOverlay();
  Color seen = pixel(scene.capture(), 32, 32);
  LT_CHECK_NEAR(suite, seen[0], .5 * .5 * 255., 2.);
  LT_CHECK_NEAR(suite, seen[1], .5 * .5 * 255. + .5 * .2 * 255., 2.);
}

/** |components| to RGB, the magnitude to brightness. */
void testFlux(Suite& suite)
{
  LitScene scene(emptyVolume());
  makeTransparent(scene);
  scene.look({ 0., -1., 0. }, true);
  vtkLightFieldProperty* light = scene.mapper->GetLightFieldProperty();
  useGreyLight(light);
  light->SetModeToFluxDirection();
  auto image = makeGrid(N, N, N);
  scene.mapper->SetLightFieldData(image);
  for (int axis = 0; axis < 3; ++axis)
  {
    for (const double sign : { 1., -1. })
    {
      setFlux(image,
        [&](const Point&)
        {
          Point e = { 0., 0., 0. };
          e[axis] = 3. * sign;
          return e;
        });
      const Color seen = pixel(scene.capture(), 32, 32);
      for (int c = 0; c < 3; ++c)
      {
        LT_CHECK_NEAR(suite, seen[c], c == axis ? 255. : 0., 1.6);
      }
    }
  }
  // Half the direction in y; three decades down: 0.3 + 0.7 / 2.
  setFlux(image,
    [](const Point& p)
    {
      const double s = p[0] == 0. && p[2] == 0. ? 1. : 1e-3;
      return Point{ s * .8, s * .4, 0. };
    });
  const Color seen = pixel(scene.capture(), 32, 32);
  LT_CHECK_NEAR(suite, seen[0], 255. * .65, 1.6);
  LT_CHECK_NEAR(suite, seen[1], 127.5 * .65, 1.6);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  if (!canRender())
  {
    return Suite::skipped();
  }
  KeepDisplay keep;
  testColors(suite);
  testOpacity(suite);
  testScales(suite);
  testPlaces(suite);
  testDomain(suite);
  testPrecision(suite);
  testTissue(suite);
  testProjections(suite);
  testFlux(suite);
  LT_CHECK(suite, openGLErrors().empty());
  return suite.result();
}
