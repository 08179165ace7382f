// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * vtkBucketedKBufferPass with a volume among the surfaces: three squares in a
 * homogeneous medium against the closed form, from both sides, in perspective, in a
 * second viewport, with stylisation, an opaque square, two volumes; what falls back.
 */
#include "VolumeMapperScene.h"

#include "vtkActor.h"
#include "vtkBucketedKBufferPass.h"
#include "vtkCurvatureOpacityProperty.h"
#include "vtkPlaneSource.h"
#include "vtkPolyDataMapper.h"
#include "vtkProperty.h"
#include "vtkSphereSource.h"

using namespace lighttransport::testing;

namespace
{
constexpr int N = 33;
const double Places[3] = { 5., 13., 22. };

vtkSmartPointer<vtkActor> square(double z, double r, double g, double b, double opacity)
{
  vtkNew<vtkPlaneSource> source;
  source->SetOrigin(-40., -40., z);
  source->SetPoint1(80., -40., z);
  source->SetPoint2(-40., 80., z);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(source->GetOutputPort());
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  actor->GetProperty()->LightingOff();
  actor->GetProperty()->SetColor(r, g, b);
  actor->GetProperty()->SetOpacity(opacity);
  return actor;
}

/** Over [0, 32]^3, white, an opacity of 0.05 per unit of length. */
vtkSmartPointer<vtkImageData> medium()
{
  auto image = makeGrid(N, N, N);
  setScalars(image, [](const Point&) { return 50.; });
  return image;
}

void makeWhite(LitScene& scene)
{
  scene.color->RemoveAllPoints();
  scene.color->AddRGBPoint(0., 1., 1., 1.);
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(0., 0.05);
  scene.property->SetScalarOpacityUnitDistance(1.);
  scene.mapper->SetSampleDistance(0.05F);
}

/** Of the ray along z, from the side that is looked from; opaque: blue is. */
Color expected(double side, bool opaque = false)
{
  Color color = { 0., 0., 0. };
  double clear = 1.;
  double at = side < 0. ? 0. : 32.;
  for (int step = 0; step < 4; ++step)
  {
    const int i = side < 0. ? step : 2 - step;
    const double next = step == 3 ? (side < 0. ? 32. : 0.) : Places[i];
    const double through = std::pow(0.95, std::abs(next - at));
    at = next;
    for (double& channel : color)
    {
      channel += clear * (1. - through) * 255.;
    }
    clear *= through;
    if (step < 3)
    {
      const double alpha = opaque && i == 2 ? 1. : 0.4;
      color[i] += clear * alpha * 255.;
      clear *= 1. - alpha;
    }
  }
  return color;
}

void check(Suite& suite, vtkImageData* picture, int x, int y, const Color& color, int line)
{
  for (int c = 0; c < 3; ++c)
  {
    const double value = pixel(picture, x, y)[c];
    suite.check(std::abs(value - color[c]) <= 1.,
      "channel " + std::to_string(c) + " is " + std::to_string(value) + ", expected " +
        std::to_string(color[c]) + " +- 1",
      __FILE__, line);
  }
}

void squares(Suite& suite)
{
  LitScene scene(medium(), 17, 17);
  makeWhite(scene);
  vtkSmartPointer<vtkActor> actors[3];
  for (int i : { 1, 2, 0 })
  {
    actors[i] = square(Places[i], i == 0, i == 1, i == 2, 0.4);
    scene.renderer->AddActor(actors[i]);
  }
  vtkNew<vtkBucketedKBufferPass> pass;
  scene.renderer->SetPass(pass);
  for (double side : { -1., 1. })
  {
    scene.look({ 0., 0., side }, true);
    check(suite, scene.capture(), 8, 8, expected(side), __LINE__);
    LT_CHECK(suite, !pass->GetUsedFallback());
    // In perspective, far away: nearly the same ray. From inside the volume no more than runs.
    scene.look({ 0., 0., side });
    scene.renderer->GetActiveCamera()->SetViewAngle(1.);
    scene.renderer->ResetCamera();
    check(suite, scene.capture(), 8, 8, expected(side), __LINE__);
  }

  // Stylisation: the squares are flat, their middle stays as it is.
  scene.look({ 0., 0., -1. }, true);
  vtkNew<vtkCurvatureOpacityProperty> style;
  style->CurvatureShadingOn();
  pass->SetCurvatureOpacityProperty(style);
  check(suite, scene.capture(), 8, 8, expected(-1.), __LINE__);
  pass->SetCurvatureOpacityProperty(nullptr);

  // An opaque square hides what is behind it, from either side.
  actors[2]->GetProperty()->SetOpacity(1.);
  check(suite, scene.capture(), 8, 8, expected(-1., true), __LINE__);
  scene.look({ 0., 0., 1. }, true);
  check(suite, scene.capture(), 8, 8, expected(1., true), __LINE__);
  actors[2]->GetProperty()->SetOpacity(0.4);

  // The right half of a window; the left one has no volume.
  scene.look({ 0., 0., -1. }, true);
  scene.window->SetSize(34, 17);
  scene.renderer->SetViewport(0.5, 0., 1., 1.);
  vtkNew<vtkRenderer> left;
  left->SetViewport(0., 0., 0.5, 1.);
  scene.window->AddRenderer(left);
  check(suite, scene.capture(), 25, 8, expected(-1.), __LINE__);
  LT_CHECK(suite, openGLErrors().empty());
}

/** Two spheres in a ball of varying opacity: what VTK's depth peeling of both draws. */
void peeling(Suite& suite)
{
  auto image = makeGrid(N, N, N);
  setScalars(image, [](const Point& p) { return ball(p, { 16., 16., 16. }, 15.); });
  LitScene scene(image, 100, 100);
  scene.mapper->SetSampleDistance(0.1F);
  for (int i = 0; i < 2; ++i)
  {
    vtkNew<vtkSphereSource> source;
    source->SetCenter(12. + 8. * i, 16., 14. + 4. * i);
    source->SetRadius(8.);
    source->SetThetaResolution(40);
    source->SetPhiResolution(40);
    vtkNew<vtkPolyDataMapper> mapper;
    mapper->SetInputConnection(source->GetOutputPort());
    vtkNew<vtkActor> actor;
    actor->SetMapper(mapper);
    actor->GetProperty()->SetColor(i, 1. - i, 0.5);
    actor->GetProperty()->SetOpacity(0.35);
    scene.renderer->AddActor(actor);
  }
  scene.look({ -1., -.6, .5 });
  const Picture stock = scene.capture();
  vtkNew<vtkBucketedKBufferPass> pass;
  scene.renderer->SetPass(pass);
  const Picture ours = scene.capture();
  scene.renderer->SetPass(nullptr);
  scene.renderer->SetUseDepthPeeling(true);
  scene.renderer->SetUseDepthPeelingForVolumes(true);
  scene.renderer->SetMaximumNumberOfPeels(20);
  scene.renderer->SetOcclusionRatio(0.);
  scene.window->SetAlphaBitPlanes(true);
  const Picture peeled = scene.capture();
  const Difference apart = difference(ours, peeled);
  std::cout << "to depth peeling: mean " << apart.mean << ", largest " << apart.largest
            << "; VTK's default: mean " << difference(stock, peeled).mean << "\n";
  // They end segments at other samples: a sample is 0.01 of opacity at most.
  LT_CHECK(suite, apart.mean < 0.2 && apart.largest <= 4.);
  LT_CHECK(suite, difference(stock, peeled).mean > 1.);
  LT_CHECK(suite, openGLErrors().empty());
}

void others(Suite& suite)
{
  LitScene scene(medium(), 17, 17);
  makeWhite(scene);
  scene.look({ 0., 0., -1. }, true);
  const Picture alone = scene.capture();
  vtkNew<vtkBucketedKBufferPass> pass;
  scene.renderer->SetPass(pass);
  // Without surfaces: VTK's own volumetric pass.
  LT_CHECK(suite, difference(alone, scene.capture()).largest <= 1.);

  // A surface before, one behind: over and under the whole volume.
  auto before = square(-10., 1., 0., 0., 0.4);
  auto behind = square(40., 0., 1., 0., 0.4);
  scene.renderer->AddActor(before);
  scene.renderer->AddActor(behind);
  scene.look({ 0., 0., -1. }, true);
  const double through = std::pow(0.95, 32.);
  const double white = 0.6 * (1. - through);
  check(suite, scene.capture(), 8, 8,
    { 255. * (0.4 + white), 255. * (white + 0.6 * through * 0.4), 255. * white }, __LINE__);

  // Projections and isosurfaces go with the surfaces too; nothing is wrong with GL.
  for (int blend : { vtkVolumeMapper::MAXIMUM_INTENSITY_BLEND, vtkVolumeMapper::ISOSURFACE_BLEND,
         vtkVolumeMapper::ADDITIVE_BLEND })
  {
    scene.mapper->SetBlendMode(blend);
    scene.capture();
    LT_CHECK(suite, openGLErrors().empty());
  }
  scene.mapper->SetBlendModeToComposite();

  // What can't be drawn among the surfaces is drawn after them, as VTK does.
  scene.mapper->SetImageSampleDistance(2.F);
  LT_CHECK(suite, scene.capture() != nullptr);
  scene.mapper->SetImageSampleDistance(1.F);

  // Few layers: what is behind them is merged, and nothing gets lost.
  pass->SetNumberOfLayers(2);
  const Color merged = pixel(scene.capture(), 8, 8);
  LT_CHECK(suite, merged[0] > 200. && pass->GetNumberOfMergedFragments() > 0);
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
  squares(suite);
  peeling(suite);
  others(suite);
  return suite.result();
}
