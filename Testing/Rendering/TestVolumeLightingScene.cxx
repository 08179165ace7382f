// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The lit volume among others: the light field over it, translucent surfaces around
 * it, viewports, tone mapping, picking; a visibility of one's own; bad input.
 */
#include "VolumeMapperScene.h"

#include "vtkActor.h"
#include "vtkCellData.h"
#include "vtkHardwareSelector.h"
#include "vtkLight.h"
#include "vtkOpenGLRenderer.h"
#include "vtkPlaneSource.h"
#include "vtkPolyDataMapper.h"
#include "vtkProperty.h"
#include "vtkRenderStepsPass.h"
#include "vtkSelection.h"
#include "vtkSphereSource.h"
#include "vtkToneMappingPass.h"
#include "vtkTrivialProducer.h"
#include "vtkUnsignedCharArray.h"
#include "vtkVisibilityFactorFilter.h"
#include "vtkVolumeLightingProperty.h"

#include <limits>

using namespace lighttransport::testing;

namespace
{
constexpr int N = 32;
const Point Middle = { 15.5, 15.5, 15.5 };

/** Two balls, the upper one (z) in the way of light from above. */
vtkSmartPointer<vtkImageData> makeBalls()
{
  auto image = makeGrid(N, N, N);
  setScalars(image,
    [](const Point& p)
    {
      const double upper = std::hypot(p[0] - 15.5, p[1] - 15.5, p[2] - 24.) - 5.;
      const double lower = std::hypot(p[0] - 15.5, p[1] - 15.5, p[2] - 9.) - 8.;
      return 50. - 30. * std::min(std::max(std::min(upper, lower), -1.), 1.);
    });
  return image;
}

struct SceneOfBalls : LitScene
{
  explicit SceneOfBalls(vtkImageData* image, int size = 64)
    : LitScene(image, size, size)
  {
    this->color->RemoveAllPoints();
    this->color->AddRGBPoint(0., .9, .9, .9);
    this->opacity->RemoveAllPoints();
    this->opacity->AddPoint(45., 0.);
    this->opacity->AddPoint(55., .6);
    this->property->SetAmbient(.1);
    this->property->SetDiffuse(.9);
    this->property->SetSpecular(0.);
    this->renderer->AutomaticLightCreationOff();
    this->sun->SetLightTypeToSceneLight();
    this->sun->SetPosition(-12., 0., 100.);
    this->sun->SetFocalPoint(0., 0., 0.);
    this->renderer->AddLight(this->sun);
    this->mapper->SetLightingProperty(this->lighting);
    this->look({ -1., -.3, .35 }, true);
    this->renderer->GetActiveCamera()->Zoom(1.8);
  }
  double at(vtkImageData* picture, const Point& p)
  {
    this->renderer->SetWorldPoint(p[0], p[1], p[2], 1.);
    this->renderer->WorldToDisplay();
    const double* d = this->renderer->GetDisplayPoint();
    const int x = static_cast<int>(d[0]);
    const int y = static_cast<int>(d[1]);
    return regionMean(picture, x - 1, y - 1, x + 1, y + 1)[1];
  }
  vtkNew<vtkLight> sun;
  vtkNew<vtkVolumeLightingProperty> lighting;
};

Color meanOf(vtkImageData* picture)
{
  int size[3];
  picture->GetDimensions(size);
  return regionMean(picture, 0, 0, size[0] - 1, size[1] - 1);
}

/** The upper ball's shadow on the lower one, as rays find it and as the baseline has it. */
void pictures(Suite& suite)
{
  SceneOfBalls scene(makeBalls(), 160);
  const auto at = [&](vtkImageData* picture, const Point& p) { return scene.at(picture, p); };
  const Point top = { 13.5, 14., 16.5 };      // of the lower ball, below the upper one
  const Point shoulder = { 8.5, 10.6, 10.5 }; // of the lower ball, beside it
  const Picture shadowed = scene.capture();
  LT_CHECK(suite, at(shadowed, shoulder) > 2. * at(shadowed, top));
  scene.lighting->SetShadowModeToNoShadows();
  const Picture bright = scene.capture();
  LT_CHECK(suite, at(bright, top) > 2. * at(shadowed, top));
  LT_CHECK(suite, at(shadowed, shoulder) > .5 * at(bright, shoulder));
  scene.lighting->SetShadowModeToRayTraced();
  const Difference d = difference(shadowed, scene.capture());
  std::cout << "precomputed against traced: mean " << d.mean << ", largest " << d.largest << "\n";
  LT_CHECK(suite, d.mean < 1.);
  scene.lighting->SetShadowModeToPrecomputed();
  compareWithBaseline(suite, shadowed, "VolumeLightingShadow");
  scene.lighting->SetEnvironmentStrength(.6);
  scene.property->SetAmbient(0.);
  scene.sun->SetIntensity(.5);
  compareWithBaseline(suite, scene.capture(), "VolumeLightingEnvironment");
  scene.lighting->SetDeferred(true);
  const Picture firstHit = scene.capture();
  writePicture(suite, firstHit, "VolumeLightingFirstHit");
  // Opaque surfaces: the first hit is what is seen.
  scene.lighting->SetDeferred(false);
  LT_CHECK(suite, difference(firstHit, scene.capture()).mean < 8.);
}

/** A light field over the lit volume: warm where it is, shadowed elsewhere. */
void withLightField(Suite& suite)
{
  SceneOfBalls scene(makeBalls());
  const Picture without = scene.capture();
  auto field = makeGrid(N, N, N);
  setFluence(field, [](const Point& p) { return glow(p, { 15.5, 15.5, 24. }, .8); });
  scene.mapper->SetLightFieldData(field);
  scene.mapper->GetLightFieldProperty()->SetDecades(3.);
  const Picture with = scene.capture();
  writePicture(suite, with, "VolumeLightingField");
  const Color upper = regionMean(with, 28, 46, 35, 52);
  LT_CHECK(suite, upper[0] - upper[2] > 30.);
  // Illuminate: transparent samples may be passed over again.
  scene.mapper->GetLightFieldProperty()->SetModeToIlluminate();
  scene.mapper->GetLightFieldProperty()->SetStrength(.01);
  scene.mapper->GetLightFieldProperty()->SetTissueOpacity(1.);
  LT_CHECK(suite, difference(without, scene.capture()).mean < 1.5);
  scene.mapper->SetLightFieldData(nullptr);
  LT_CHECK(suite, difference(without, scene.capture()).largest == 0.);
}

void withGeometry(Suite& suite)
{
  SceneOfBalls scene(makeBalls());
  auto observer = observe(scene.mapper);
  const Picture plain = scene.capture();
  vtkNew<vtkSphereSource> sphere;
  sphere->SetCenter(Middle.data());
  sphere->SetRadius(20.);
  sphere->SetThetaResolution(24);
  sphere->SetPhiResolution(24);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(sphere->GetOutputPort());
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  actor->GetProperty()->SetColor(0., 1., 0.);
  actor->GetProperty()->LightingOff();
  scene.renderer->AddActor(actor);
  const Color hidden = pixel(scene.capture(), 32, 18);
  LT_CHECK(suite, hidden[0] == 0. && hidden[1] > 200.);

  // Peeled: the volume lies between the two layers of the sphere, .3 each.
  actor->GetProperty()->SetOpacity(.3);
  scene.renderer->SetUseDepthPeeling(1);
  scene.renderer->SetUseDepthPeelingForVolumes(true);
  scene.renderer->SetMaximumNumberOfPeels(8);
  const Picture peeled = scene.capture();
  writePicture(suite, peeled, "VolumeLightingPeeled");
  const Color volume = regionMean(plain, 30, 16, 34, 20);
  const Color mixed = regionMean(peeled, 30, 16, 34, 20);
  LT_CHECK_NEAR(suite, mixed[0], .7 * volume[0], 6.);
  LT_CHECK_NEAR(suite, mixed[1], .7 * volume[1] + .3 * 255., 8.);
  LT_CHECK(suite, observer->all().empty());
  scene.renderer->SetUseDepthPeeling(0);
  scene.renderer->SetUseDepthPeelingForVolumes(false);
  scene.renderer->RemoveActor(actor);
  LT_CHECK(suite, difference(plain, scene.capture()).largest == 0.);

  // Picking is the stock mapper's.
  vtkNew<vtkHardwareSelector> selector;
  selector->SetRenderer(scene.renderer);
  selector->SetArea(30, 16, 34, 20);
  vtkSmartPointer<vtkSelection> selection;
  selection.TakeReference(selector->Select());
  LT_CHECK(suite, selection && selection->GetNumberOfNodes() == 1);
  LT_CHECK(suite, difference(plain, scene.capture()).largest == 0.);

  // Two viewports of one volume.
  vtkNew<vtkRenderWindow> window;
  window->SetMultiSamples(0);
  window->SetSize(128, 64);
  for (int i = 0; i < 2; ++i)
  {
    vtkNew<vtkRenderer> part;
    part->SetViewport(.5 * i, 0., .5 * (i + 1), 1.);
    part->AddVolume(scene.volume);
    part->AutomaticLightCreationOff();
    part->AddLight(scene.sun);
    part->SetActiveCamera(scene.renderer->GetActiveCamera());
    window->AddRenderer(part);
  }
  const Picture both = capture(window);
  double largest = 0.;
  for (int y = 0; y < 64; ++y)
  {
    for (int x = 0; x < 128; ++x)
    {
      largest = std::max(largest, std::abs(pixel(both, x, y)[1] - pixel(plain, x % 64, y)[1]));
    }
  }
  LT_CHECK(suite, largest <= 1.);
  LT_CHECK(suite, observer->all().empty());
  scene.mapper->ReleaseGraphicsResources(window);
}

/**
 * A translucent plane within a homogeneous block, peeled: what lies before it, it, and what lies
 * behind, in this order; and with the plane before and behind the block.
 */
void geometryWithin(Suite& suite)
{
  auto image = makeGrid(N, N, N);
  setScalars(image, [](const Point&) { return 100.; });
  SceneOfBalls scene(image, 32);
  scene.property->SetAmbient(1.);
  scene.property->SetDiffuse(0.);
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(0., .04);
  scene.lighting->SetAmbientOcclusion(0.);
  scene.mapper->SetSampleDistance(.25F);
  scene.look({ -1., 0., 0. }, true);
  vtkNew<vtkPlaneSource> plane;
  plane->SetOrigin(0., -40., -40.);
  plane->SetPoint1(0., 40., -40.);
  plane->SetPoint2(0., -40., 40.);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(plane->GetOutputPort());
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  actor->GetProperty()->SetColor(0., 1., 0.);
  actor->GetProperty()->LightingOff();
  actor->GetProperty()->SetOpacity(.4);
  scene.renderer->AddActor(actor);
  scene.renderer->SetUseDepthPeeling(1);
  scene.renderer->SetUseDepthPeelingForVolumes(true);
  scene.renderer->SetMaximumNumberOfPeels(8);
  const double sigma = -std::log(.96);
  for (const double x : { -10., 7.75, 15.5, 23.25, 41. })
  {
    actor->SetPosition(x, 0., 0.);
    scene.renderer->ResetCameraClippingRange();
    const Color c = pixel(scene.capture(), 16, 16);
    const double before = std::min(std::max(x, 0.), N - 1.);
    const double front = std::exp(-sigma * before);
    const double back = std::exp(-sigma * (N - 1. - before));
    const double volume = .9 * (1. - front) + front * .6 * .9 * (1. - back);
    std::cout << "plane at " << x << ": " << c[0] / 255. << " " << c[1] / 255. << ", closed form "
              << volume << " " << volume + front * .4 << "\n";
    LT_CHECK_NEAR(suite, c[0] / 255., volume, .015);
    LT_CHECK_NEAR(suite, c[1] / 255., volume + front * .4, .015);
  }
  scene.renderer->RemoveActor(actor);
}

/** Radiance of 1 to 8: not clamped before the tone mapping, and linear. */
void toneMapping(Suite& suite)
{
  SceneOfBalls scene(makeBalls());
  scene.property->SetAmbient(0.);
  scene.window->Render(); // 9.1 leaves a window black whose first frame has a pass
  vtkNew<vtkRenderStepsPass> steps;
  vtkNew<vtkToneMappingPass> tone;
  tone->SetToneMappingType(vtkToneMappingPass::Exponential);
  tone->SetExposure(.03F);
  tone->SetDelegatePass(steps);
  scene.renderer->SetPass(tone);
  const auto radiance = [&](double intensity)
  {
    scene.sun->SetIntensity(intensity);
    const Picture picture = scene.capture();
    const double p = scene.at(picture, { 13., 14., 28. }) / 255.;
    // The pass takes and gives the 2.2th root of what it maps, 1 - exp(-exposure L).
    return std::pow(-std::log(1. - std::min(std::pow(p, 2.2), .998)) / .03, 1. / 2.2);
  };
  const double one = radiance(1.);
  const double four = radiance(4.);
  const double eight = radiance(8.);
  std::cout << "radiance " << one << ", of 4 " << four << ", of 8 " << eight << "\n";
  LT_CHECK(suite, one > .05 && eight > 1.2);
  LT_CHECK_CLOSE(suite, four, 4. * one, .06);
  LT_CHECK_CLOSE(suite, eight, 8. * one, .06);
  tone->ReleaseGraphicsResources(scene.window);
  scene.renderer->SetPass(nullptr);
  LT_CHECK(suite, openGLErrors().empty());
}

/** The filter's own output in place of the mapper's. */
void connection(Suite& suite)
{
  SceneOfBalls scene(makeBalls());
  auto observer = observe(scene.mapper);
  const Picture own = scene.capture();
  vtkNew<vtkVisibilityFactorFilter> filter;
  filter->SetInputData(scene.mapper->GetInput());
  filter->SetScalarOpacity(scene.opacity);
  filter->SetOutputExtinction(true);
  scene.mapper->SetVisibilityConnection(filter->GetOutputPort());
  const Difference exact = difference(own, scene.capture());
  std::cout << "connection: mean difference " << exact.mean << "\n";
  LT_CHECK(suite, exact.mean < .5);
  filter->SetOutputExtinction(false);
  const Picture soft = scene.capture();
  LT_CHECK(suite, difference(own, soft).mean > .5 && difference(own, soft).mean < 12.);
  filter->SetOrder(1);
  scene.capture();
  filter->SetOrder(4);
  LT_CHECK(suite, difference(own, scene.capture()).mean < difference(own, soft).mean);
  LT_CHECK(suite, observer->all().empty());

  vtkNew<vtkImageData> wrong;
  wrong->DeepCopy(scene.mapper->GetInput());
  vtkNew<vtkTrivialProducer> producer;
  producer->SetOutput(wrong);
  scene.mapper->SetVisibilityConnection(producer->GetOutputPort());
  scene.capture();
  scene.capture();
  LT_CHECK(suite, observer->errors.size() == 1 && observer->hasError("VisibilitySH"));
  vtkNew<vtkFloatArray> odd;
  odd->SetName("VisibilitySH");
  odd->SetNumberOfComponents(5);
  odd->SetNumberOfTuples(wrong->GetNumberOfPoints());
  odd->FillValue(1.F);
  wrong->GetPointData()->AddArray(odd);
  scene.capture();
  LT_CHECK(suite, observer->errors.size() == 2 && observer->hasError("5 components"));
  scene.mapper->SetVisibilityConnection(nullptr);
  LT_CHECK(suite, difference(own, scene.capture()).largest == 0.);
}

/** Opaque or transparent everywhere, a slice, a voxel, NaN, no unit distance: a picture. */
void extremes(Suite& suite)
{
  for (const double opacity : { 0., 1. })
  {
    SceneOfBalls scene(makeBalls());
    auto observer = observe(scene.mapper);
    scene.opacity->RemoveAllPoints();
    scene.opacity->AddPoint(0., opacity);
    scene.lighting->SetEnvironmentStrength(.3);
    const Color mean = meanOf(scene.capture());
    LT_CHECK(suite, opacity == 0. ? mean[0] == 0. : mean[0] > 20.);
    LT_CHECK(suite, observer->all().empty());
  }
  const int shapes[][3] = { { 16, 16, 1 }, { 2, 2, 2 }, { 1, 16, 16 }, { 40, 3, 2 } };
  for (const auto& n : shapes)
  {
    auto image = makeGrid(n[0], n[1], n[2]);
    setScalars(image, [](const Point&) { return 100.; });
    SceneOfBalls scene(image);
    auto observer = observe(scene.mapper);
    scene.lighting->SetEnvironmentStrength(.3);
    scene.capture();
    LT_CHECK(suite, observer->all().empty());
  }
  auto image = makeBalls();
  image->SetSpacing(.5, 2., 1.);
  {
    const Suite::WithoutTraps untrapped;
    for (vtkIdType i = 0; i < image->GetNumberOfPoints(); i += 7)
    {
      image->GetPointData()->GetScalars()->SetTuple1(i, std::numeric_limits<double>::quiet_NaN());
    }
    SceneOfBalls scene(image);
    auto observer = observe(scene.mapper);
    LT_CHECK(suite, meanOf(scene.capture())[0] > 1.);
    LT_CHECK(suite, observer->all().empty());
  }
  // A volume of cells, of doubles, of bits of other types.
  auto cells = makeGrid(N + 1, N + 1, N + 1);
  vtkNew<vtkDoubleArray> values;
  values->SetName("Cells");
  values->SetNumberOfTuples(cells->GetNumberOfCells());
  for (vtkIdType i = 0; i < cells->GetNumberOfCells(); ++i)
  {
    values->SetValue(i, i % N < N / 2 ? 0. : 100.);
  }
  cells->GetCellData()->SetScalars(values);
  SceneOfBalls scene(cells);
  auto observer = observe(scene.mapper);
  scene.mapper->SetScalarModeToUseCellData();
  const Color mean = meanOf(scene.capture());
  LT_CHECK(suite, mean[0] > 3.);
  LT_CHECK(suite, observer->all().empty());
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
  KeepDisplay keep;
  pictures(suite);
  withLightField(suite);
  withGeometry(suite);
  geometryWithin(suite);
  toneMapping(suite);
  connection(suite);
  extremes(suite);
  LT_CHECK(suite, openGLErrors().empty());
  return suite.result();
}
