// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Curvature on the screen against closed forms: sphere and torus from several
 * distances, at several resolutions, from either side; outlines; and that the
 * stylisation, off by default, depends neither on the order of actors, on bands
 * nor on the unit of length.
 */
#include "KBufferScene.h"

#include "vtkColorTransferFunction.h"
#include "vtkCurvatureOpacityFunction.h"
#include "vtkCurvatureOpacityProperty.h"
#include "vtkParametricFunctionSource.h"
#include "vtkParametricTorus.h"
#include "vtkPiecewiseFunction.h"
#include "vtkReverseSense.h"
#include "vtkSphereSource.h"
#include "vtkTransform.h"
#include "vtkTransformPolyDataFilter.h"

using namespace lighttransport::testing;

namespace
{
/** Grey shows kappa: 0 is -1, 255 is 1. */
void showKappa(vtkCurvatureOpacityProperty* property)
{
  vtkNew<vtkPiecewiseFunction> grey;
  grey->AddPoint(-1., 0.);
  grey->AddPoint(1., 1.);
  property->SetShadingFunction(grey);
  property->CurvatureShadingOn();
}

double kappaOf(unsigned char grey)
{
  return 2. * grey / 255. - 1.;
}

/** White whatever the light, but lit, so that normals are the mesh's. */
vtkSmartPointer<vtkActor> whiteActor(vtkAlgorithm* source)
{
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(source->GetOutputPort());
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  actor->GetProperty()->SetAmbient(1.);
  actor->GetProperty()->SetDiffuse(0.);
  actor->ForceTranslucentOn();
  return actor;
}

vtkSmartPointer<vtkSphereSource> fineSphere(double radius)
{
  auto sphere = vtkSmartPointer<vtkSphereSource>::New();
  sphere->SetRadius(radius);
  sphere->SetThetaResolution(160);
  sphere->SetPhiResolution(120);
  return sphere;
}

/** kappa where the sphere of 'radius' at 'distance' is seen at n . v > 0.3, off the outline. */
void checkSphere(Suite& suite, const std::string& name, KBufferScene& scene, double radius,
  double distance, double expected)
{
  const auto pixels = scene.capture();
  const int* size = scene.window->GetActualSize();
  vtkCamera* camera = scene.renderer->GetActiveCamera();
  const double pi = 3.14159265358979;
  const double perPixel = camera->GetParallelProjection()
    ? 2. * camera->GetParallelScale() / size[1]
    : 2. * std::tan(camera->GetViewAngle() * pi / 360.) / size[1];
  int inside = 0;
  double worst = 0.;
  for (int row = 0; row < size[1]; ++row)
  {
    for (int column = 0; column < size[0]; ++column)
    {
      const double x = (column + .5 - .5 * size[0]) * perPixel;
      const double y = (row + .5 - .5 * size[1]) * perPixel;
      // sine of the angle between normal and ray
      const double sine = camera->GetParallelProjection()
        ? std::hypot(x, y) / radius
        : distance * std::sin(std::atan(std::hypot(x, y))) / radius;
      const double apart = camera->GetParallelProjection() ? 1. : distance;
      if (sine > std::min(std::sqrt(1. - .3 * .3), 1. - 2. * perPixel * apart / radius))
      {
        continue;
      }
      ++inside;
      const double kappa = kappaOf(pixels[4 * (std::size_t(row) * size[0] + column)]);
      worst = std::max(worst, std::abs(kappa - expected));
    }
  }
  suite.check(inside > 100 && worst <= .05 * std::abs(expected),
    name + ": kappa is off by " + std::to_string(worst) + ", expected " + std::to_string(expected) +
      " at " + std::to_string(inside) + " pixels",
    __FILE__, __LINE__);
}

void testSphere(Suite& suite)
{
  const double radius = 2.;
  const double scale = .5; // s (k1 + k2) = 0.5
  const double expected = -std::tanh(scale * 2. / radius);
  for (const int size : { 64, 150, 300 })
  {
    for (const double distance : { 8., 20. })
    {
      for (const int sense : { 0, 1, 2 }) // as it is, from inside, turned inside out
      {
        if (size != 150 && sense > 0)
        {
          continue;
        }
        KBufferScene scene(size, size);
        scene.renderer->SetBackground(0., 0., 0.);
        auto sphere = fineSphere(radius);
        vtkNew<vtkReverseSense> reverse;
        reverse->SetInputConnection(sphere->GetOutputPort());
        reverse->ReverseNormalsOn();
        reverse->ReverseCellsOn();
        auto actor = whiteActor(sense == 2 ? static_cast<vtkAlgorithm*>(reverse) : sphere.Get());
        if (sense == 1)
        {
          actor->GetProperty()->FrontfaceCullingOn();
        }
        scene.renderer->AddActor(actor);
        vtkCamera* camera = scene.renderer->GetActiveCamera();
        camera->ParallelProjectionOff();
        camera->SetFocalPoint(0., 0., 0.);
        camera->SetPosition(0., 0., distance);
        scene.renderer->ResetCameraClippingRange();
        showKappa(scene.pass->GetCurvatureOpacityProperty());
        scene.pass->SetCurvatureScale(scale);
        if (sense == 1)
        {
          // The far side's outline is nearer to the axis.
          camera->SetParallelScale(1.05 * radius);
          camera->ParallelProjectionOn();
        }
        checkSphere(suite,
          "sphere, " + std::to_string(size) + " pixels, distance " + std::to_string(distance) +
            ", sense " + std::to_string(sense),
          scene, radius, distance, sense == 2 ? -expected : expected);
        LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());
      }
    }
  }
}

/** Along the axis, parallel: k1 = 1/r, k2 = cos v / (R + r cos v), cos v = (rho - R) / r. */
void testTorus(Suite& suite)
{
  const double R = 2.;
  const double r = 1.;
  const double scale = 1.; // kappa from 0.18 on: 8 bits tell 2 %
  for (const int size : { 100, 260 })
  {
    for (const double parallelScale : { 3.2, 5. })
    {
      KBufferScene scene(size, size);
      scene.renderer->SetBackground(0., 0., 0.);
      vtkNew<vtkParametricTorus> torus;
      torus->SetRingRadius(R);
      torus->SetCrossSectionRadius(r);
      vtkNew<vtkParametricFunctionSource> source;
      source->SetParametricFunction(torus);
      source->SetUResolution(200);
      source->SetVResolution(120);
      scene.renderer->AddActor(whiteActor(source));
      vtkCamera* camera = scene.renderer->GetActiveCamera();
      camera->SetFocalPoint(0., 0., 0.);
      camera->SetPosition(0., 0., 10.);
      camera->SetParallelScale(parallelScale);
      showKappa(scene.pass->GetCurvatureOpacityProperty());
      scene.pass->SetCurvatureScale(scale);
      const auto pixels = scene.capture();
      double worst = 0.;
      int inside = 0;
      for (int row = 0; row < size; ++row)
      {
        for (int column = 0; column < size; ++column)
        {
          const double x = (column + .5 - .5 * size) * 2. * parallelScale / size;
          const double y = (row + .5 - .5 * size) * 2. * parallelScale / size;
          const double cosine = (std::hypot(x, y) - R) / r;
          if (std::abs(cosine) > .9)
          {
            continue;
          }
          ++inside;
          const double expected = -std::tanh(scale * (1. / r + cosine / (R + r * cosine)));
          const double kappa = kappaOf(pixels[4 * (std::size_t(row) * size + column)]);
          worst = std::max(worst, std::abs(kappa / expected - 1.));
        }
      }
      suite.check(inside > 500 && worst < .05,
        "torus, " + std::to_string(size) + " pixels: kappa is off by " +
          std::to_string(100. * worst) + " %",
        __FILE__, __LINE__);
    }
  }
}

/** Outlines and open edges are -1, and nothing else is; without light, flat normals do. */
void testOutline(Suite& suite)
{
  for (const bool lit : { true, false })
  {
    KBufferScene scene(60, 60);
    Layer square;
    square.box = { .25, .75, .25, .75 };
    square.color = { 1., 1., 1., 1. };
    square.tilt = .6;
    auto actor = makeLayer(square);
    actor->ForceTranslucentOn();
    actor->GetProperty()->SetLighting(lit);
    actor->GetProperty()->SetAmbient(1.);
    actor->GetProperty()->SetDiffuse(0.);
    scene.renderer->AddActor(actor);
    scene.renderer->SetBackground(1., 0., 0.);
    showKappa(scene.pass->GetCurvatureOpacityProperty());
    const auto pixels = scene.capture();
    int wrong = 0;
    for (int row = 15; row < 45; ++row)
    {
      for (int column = 15; column < 45; ++column)
      {
        const bool edge = row == 15 || row == 44 || column == 15 || column == 44;
        const int grey = pixels[4 * (row * 60 + column) + 1];
        wrong += edge ? grey != 0 : std::abs(grey - 127.5) > 1.;
      }
    }
    suite.check(wrong == 0,
      std::to_string(wrong) + " pixels of a square are wrong, lit " + std::to_string(lit), __FILE__,
      __LINE__);
  }
}

/** Many spheres, some in others. */
void addSpheres(vtkRenderer* renderer, unsigned seed, double unit, unsigned shuffle)
{
  std::mt19937 random(seed);
  const auto uniform = [&random](double lo, double hi)
  { return lo + (hi - lo) * (random() / 4294967296.); };
  std::vector<vtkSmartPointer<vtkActor>> actors;
  for (int i = 0; i < 9; ++i)
  {
    vtkNew<vtkSphereSource> sphere;
    sphere->SetCenter(unit * uniform(.2, .8), unit * uniform(.2, .8), unit * uniform(-.3, .3));
    sphere->SetRadius(unit * uniform(.08, .4));
    sphere->SetThetaResolution(40);
    sphere->SetPhiResolution(30);
    vtkNew<vtkPolyDataMapper> mapper;
    mapper->SetInputConnection(sphere->GetOutputPort());
    auto actor = vtkSmartPointer<vtkActor>::New();
    actor->SetMapper(mapper);
    actor->GetProperty()->SetColor(uniform(0., 1.), uniform(0., 1.), uniform(0., 1.));
    actor->GetProperty()->SetOpacity(.4);
    actors.push_back(actor);
  }
  std::mt19937 order(shuffle);
  if (shuffle > 0)
  {
    std::shuffle(actors.begin(), actors.end(), order);
  }
  for (const auto& actor : actors)
  {
    renderer->AddActor(actor);
  }
}

void styleAll(vtkCurvatureOpacityProperty* property)
{
  property->CurvatureShadingOn();
  property->CurvatureOpacityOn();
  property->SetRadianceScaling(1.);
}

void testInvariance(Suite& suite)
{
  const unsigned seed = 3;
  std::cout << "seed " << seed << "\n";
  for (const int layers : { 32, 5 })
  {
    KBufferScene scene(90, 80);
    addSpheres(scene.renderer, seed, 1., 0);
    scene.pass->SetNumberOfLayers(layers);
    const auto plain = scene.capture();
    styleAll(scene.pass->GetCurvatureOpacityProperty());
    const auto expected = scene.capture();
    LT_CHECK(suite, largestDifference(plain, expected) > 50);
    for (const unsigned shuffle : { 1U, 2U })
    {
      KBufferScene shuffled(90, 80);
      addSpheres(shuffled.renderer, seed, 1., shuffle);
      shuffled.pass->SetNumberOfLayers(layers);
      styleAll(shuffled.pass->GetCurvatureOpacityProperty());
      LT_CHECK(suite, largestDifference(expected, shuffled.capture()) == 0);
    }
    // In bands.
    scene.pass->SetMemoryLimit(1 << 20);
    LT_CHECK(suite, largestDifference(expected, scene.capture()) == 0);
    LT_CHECK(suite, layers < 32 || scene.pass->GetNumberOfBands() >= 1);
    // Off again.
    vtkNew<vtkCurvatureOpacityProperty> none;
    scene.pass->SetCurvatureOpacityProperty(none);
    LT_CHECK(suite, largestDifference(plain, scene.capture()) == 0);
  }
  // In micrometres instead of metres: the scale is the scene's.
  std::vector<unsigned char> pictures[2];
  for (const double unit : { 1., 1e6 })
  {
    KBufferScene scene(90, 80);
    addSpheres(scene.renderer, seed, unit, 0);
    scene.renderer->GetActiveCamera()->ParallelProjectionOff();
    scene.renderer->ResetCamera();
    styleAll(scene.pass->GetCurvatureOpacityProperty());
    pictures[unit > 1.] = scene.capture();
  }
  int differing = 0;
  for (std::size_t i = 0; i < pictures[0].size(); ++i)
  {
    differing += std::abs(int(pictures[0][i]) - int(pictures[1][i])) > 4;
  }
  LT_CHECK(suite, differing < 90 * 80 * 4 / 200);
}

/** The opacity is the function's, over depth too. */
void testOpacity(Suite& suite)
{
  KBufferScene scene;
  std::vector<Layer> layers = randomLayers(4, 9);
  scene.add(layers);
  vtkCurvatureOpacityProperty* property = scene.pass->GetCurvatureOpacityProperty();
  property->CurvatureOpacityOn();
  vtkNew<vtkPiecewiseFunction> ofDepth;
  ofDepth->AddPoint(0., .9);
  ofDepth->AddPoint(1., .1);
  property->GetOpacityFunction()->SetKindToProduct();
  property->GetOpacityFunction()->SetDepthFunction(ofDepth);
  const auto pixels = scene.capture();
  // The layers are at -4, -2, 0 and 2, the bounds' depths those of the first and last.
  for (Layer& layer : layers)
  {
    layer.color[3] = .9 - .8 * (2. - layer.z) / 6.;
  }
  LT_CHECK(suite, scene.differenceFromOver(pixels, layers, false) <= 1.5);

  // A function that is everywhere 1 shades nothing.
  KBufferScene same;
  same.add(layers);
  const auto plain = same.capture();
  vtkNew<vtkPiecewiseFunction> one;
  one->AddPoint(-1., 1.);
  one->AddPoint(1., 1.);
  same.pass->GetCurvatureOpacityProperty()->SetShadingFunction(one);
  same.pass->GetCurvatureOpacityProperty()->CurvatureShadingOn();
  LT_CHECK(suite, largestDifference(plain, same.capture()) <= 1);
  LT_CHECK(suite, same.pass->GetBitsPerFragment() == 320);
}
} // namespace

/** Mean-curvature shading in colours: of the flat middle that at kappa = 0. */
void testColors(Suite& suite)
{
  KBufferScene scene;
  Layer square;
  square.color = { 1., .5, 1., .6 };
  scene.add({ square });
  vtkNew<vtkColorTransferFunction> colors;
  colors->AddRGBPoint(-1., 1., 0., 0.);
  colors->AddRGBPoint(0., .2, .4, .8);
  colors->AddRGBPoint(1., 0., 0., 1.);
  scene.pass->GetCurvatureOpacityProperty()->SetShadingColors(colors);
  scene.pass->GetCurvatureOpacityProperty()->CurvatureShadingOn();
  const auto pixels = scene.capture();
  const double expected[3] = { .2, .5 * .4, .8 };
  const double background[3] = { toByte(.2), toByte(.4), toByte(.1) };
  for (int c = 0; c < 3; ++c)
  {
    LT_CHECK_NEAR(suite, double(pixels[4 * (15 * 40 + 20) + c]),
      255. * (.6 * expected[c] + .4 * background[c]), 1.);
  }
}

/** Radiance scaling leaves flat parts, brightens what is convex and faces the eye. */
void testRadianceScaling(Suite& suite)
{
  for (const bool flat : { true, false })
  {
    std::vector<unsigned char> pictures[2];
    for (const double strength : { 0., 1. })
    {
      KBufferScene scene(50, 50);
      Layer square;
      square.color = { 1., 1., 1., 1. };
      auto actor = flat ? makeLayer(square) : whiteActor(fineSphere(.4));
      actor->ForceTranslucentOn();
      actor->SetPosition(flat ? 0. : .5, flat ? 0. : .5, 0.);
      actor->GetProperty()->LightingOn();
      actor->GetProperty()->SetAmbient(.3);
      actor->GetProperty()->SetDiffuse(0.);
      scene.renderer->AddActor(actor);
      scene.pass->SetCurvatureScale(.1); // of the sphere: kappa = -tanh(0.5)
      scene.pass->GetCurvatureOpacityProperty()->SetRadianceScaling(strength);
      pictures[strength > 0.] = scene.capture();
    }
    const std::size_t middle = 4 * (25 * 50 + 25);
    const double expected = flat ? 1. : std::exp(std::tanh(.5)); // sigma at delta = 1
    LT_CHECK_NEAR(suite, double(pictures[1][middle]), expected * pictures[0][middle], 2.);
  }
}

int main(int argc, char* argv[])
{
  if (!canRender())
  {
    return Suite::skipped();
  }
  Suite suite(argc, argv);
  testSphere(suite);
  testTorus(suite);
  testOutline(suite);
  testInvariance(suite);
  testOpacity(suite);
  testColors(suite);
  testRadianceScaling(suite);
  LT_CHECK(suite, openGLDebugErrors() == 0);
  return suite.result();
}
