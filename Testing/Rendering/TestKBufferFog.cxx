// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Surfaces and a volume in one picture of vtkBucketedKBufferPass: a homogeneous volume
 * crossed by quads, by closed form within 1/255, straight and tilted, with stylisation, in
 * bands, with the light-transport mapper; volumes where the pass has nothing to do; nothing
 * jumps when the camera turns.
 */
#include "KBufferScene.h"

#include "vtkColorTransferFunction.h"
#include "vtkCurvatureOpacityProperty.h"
#include "vtkImageData.h"
#include "vtkLightTransportVolumeMapper.h"
#include "vtkOpenGLGPUVolumeRayCastMapper.h"
#include "vtkPiecewiseFunction.h"
#include "vtkVolume.h"
#include "vtkVolumeProperty.h"

using namespace lighttransport::testing;

namespace
{
const double Opacity = .9; // over the unit length
const Rgba Fog = { .9, .5, .2, 0. };

/** The same everywhere in [0,1]^2 x [-.5,.5]. */
vtkSmartPointer<vtkVolume> fogVolume(vtkGPUVolumeRayCastMapper* mapper, double step)
{
  vtkNew<vtkImageData> image;
  image->SetDimensions(9, 9, 9);
  image->SetOrigin(-1., -1., -.5);
  image->SetSpacing(3. / 8., 3. / 8., 1. / 8.);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  std::fill_n(static_cast<unsigned char*>(image->GetScalarPointer()), 9 * 9 * 9, 100);
  mapper->SetInputData(image);
  mapper->AutoAdjustSampleDistancesOff();
  mapper->SetSampleDistance(static_cast<float>(step));
  vtkNew<vtkColorTransferFunction> color;
  color->AddRGBPoint(0., Fog[0], Fog[1], Fog[2]);
  vtkNew<vtkPiecewiseFunction> opacity;
  opacity->AddPoint(0., Opacity);
  opacity->AddPoint(255., Opacity);
  auto volume = vtkSmartPointer<vtkVolume>::New();
  volume->SetMapper(mapper);
  volume->GetProperty()->SetColor(color);
  volume->GetProperty()->SetScalarOpacity(opacity);
  volume->GetProperty()->SetScalarOpacityUnitDistance(1.);
  return volume;
}

/** Fog from z to 'lower' as a layer. */
Layer fogBetween(double upper, double lower)
{
  Layer layer;
  layer.z = .5 * (upper + lower);
  layer.color = Fog;
  layer.color[3] = 1. - std::pow(1. - Opacity, std::max(upper - lower, 0.));
  return layer;
}

/** At x, the layers and the fog between them, over the background. */
Rgba expectedAt(std::vector<Layer> layers, double x, const Rgba& background)
{
  for (Layer& layer : layers)
  {
    layer.z += layer.tilt * x;
    layer.tilt = 0.;
  }
  std::sort(layers.begin(), layers.end(), [](const Layer& a, const Layer& b) { return a.z > b.z; });
  std::vector<Layer> all = layers;
  double upper = .5;
  for (const Layer& layer : layers)
  {
    if (std::abs(layer.z) < .5)
    {
      all.push_back(fogBetween(upper, layer.z));
      upper = layer.z;
    }
  }
  all.push_back(fogBetween(upper, -.5));
  return over(all, x, background);
}

double worst(KBufferScene& scene, const std::vector<Layer>& layers)
{
  const auto pixels = scene.capture();
  const int* size = scene.window->GetActualSize();
  double largest = 0.;
  for (int column = 0; column < size[0]; ++column)
  {
    const Rgba expected =
      expectedAt(layers, scene.x(column), { toByte(.2), toByte(.4), toByte(.1), 1. });
    for (int row = 0; row < size[1]; ++row)
    {
      for (int c = 0; c < 3; ++c)
      {
        const double value = pixels[4 * (std::size_t(row) * size[0] + column) + c];
        largest = std::max(largest, std::abs(value - 255. * expected[c]));
      }
    }
  }
  return largest;
}

std::vector<Layer> threeQuads(double tilt)
{
  std::vector<Layer> layers(3);
  layers[0].z = .25;
  layers[0].color = { .1, .8, .3, .4 };
  layers[1].z = -.05;
  layers[1].color = { .9, .1, .2, .5 };
  layers[1].tilt = tilt;
  layers[2].z = -.3;
  layers[2].color = { .2, .2, .9, .6 };
  return layers;
}

void testClosedForm(Suite& suite)
{
  enum Way
  {
    Straight,
    Tilted,
    InFrontAndBehind,
    Styled,
    Banded,
    OurMapper
  };
  for (const Way way : { Straight, Tilted, InFrontAndBehind, Styled, Banded, OurMapper })
  {
    KBufferScene scene(20, 15);
    auto layers = threeQuads(way == Tilted ? .35 : 0.);
    if (way == InFrontAndBehind)
    {
      layers[0].z = 2.;
      layers[2].z = -2.;
    }
    scene.add(layers);
    vtkSmartPointer<vtkGPUVolumeRayCastMapper> mapper;
    if (way == OurMapper)
    {
      mapper = vtkSmartPointer<vtkLightTransportVolumeMapper>::New();
    }
    else
    {
      mapper = vtkSmartPointer<vtkOpenGLGPUVolumeRayCastMapper>::New();
    }
    scene.renderer->AddVolume(fogVolume(mapper, .0005));
    if (way == Styled)
    {
      vtkNew<vtkPiecewiseFunction> one;
      one->AddPoint(-1., 1.);
      one->AddPoint(1., 1.);
      scene.pass->GetCurvatureOpacityProperty()->SetShadingFunction(one);
      scene.pass->GetCurvatureOpacityProperty()->CurvatureShadingOn();
    }
    if (way == Banded)
    {
      scene.pass->SetMemoryLimit(1 << 20);
      scene.window->SetSize(100, 75);
      mapper->SetSampleDistance(.004F);
      scene.add(randomLayers(12, 3, .0001, .0002)); // many, all but invisible
    }
    const double d = worst(scene, layers);
    suite.check(d <= (way == Banded ? 2.5 : 1.),
      "way " + std::to_string(way) + ": " + std::to_string(d) + "/255 from the closed form",
      __FILE__, __LINE__);
    LT_CHECK(suite, way != Banded || scene.pass->GetNumberOfBands() > 1);
    LT_CHECK(suite, worst(scene, layers) == d); // the next frame is the same
    LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());
  }
}

/**
 * As the camera turns a little, so changes the picture: the middle, and no frame differs
 * from the one before by much more than others do, as it would where something pops (but for
 * one step of 8 bits, which a homogeneous picture takes everywhere at once).
 */
void testTurning(Suite& suite)
{
  KBufferScene scene(60, 60);
  scene.add(threeQuads(.2));
  Layer cut; // through the others
  cut.tilt = 1.5;
  cut.z = -.75;
  cut.color = { .9, .9, .1, .3 };
  scene.add({ cut });
  vtkNew<vtkOpenGLGPUVolumeRayCastMapper> mapper;
  scene.renderer->AddVolume(fogVolume(mapper, .01));
  vtkCamera* camera = scene.renderer->GetActiveCamera();
  std::vector<unsigned char> before;
  double jump = 0.;
  std::vector<double> changes;
  for (int i = 0; i < 24; ++i)
  {
    const auto pixels = scene.capture();
    Color mean = { 0., 0., 0. };
    double change = 0.;
    for (std::size_t p = 0; p < pixels.size() && i > 0; ++p)
    {
      change += std::abs(double(pixels[p]) - before[p]) / static_cast<double>(pixels.size());
    }
    for (int row = 20; row < 40 && i > 0; ++row)
    {
      for (int column = 20; column < 40; ++column)
      {
        for (int c = 0; c < 3; ++c)
        {
          const std::size_t at = 4 * (std::size_t(row) * 60 + column) + c;
          mean[c] += (double(pixels[at]) - before[at]) / 400.;
        }
      }
    }
    for (const double m : mean)
    {
      jump = std::max(jump, std::abs(m));
    }
    if (i > 0)
    {
      changes.push_back(change);
    }
    before = pixels;
    camera->Azimuth(1.);
  }
  suite.check(jump < 2.5, "a degree's turn changes the middle by " + std::to_string(jump) + "/255",
    __FILE__, __LINE__);
  std::sort(changes.begin(), changes.end());
  suite.check(changes.back() < 2. * changes[changes.size() / 2] + 1. && changes.back() > 0.,
    "a degree's turn changes a channel by " + std::to_string(changes[changes.size() / 2]) +
      "/255 on average, and once by " + std::to_string(changes.back()),
    __FILE__, __LINE__);
  LT_CHECK(suite, openGLErrors().empty());
}

/** Two volumes one behind the other, surfaces in, between and around them. */
void testTwoVolumes(Suite& suite)
{
  for (const bool nearFirst : { false, true })
  {
    KBufferScene scene(20, 15);
    auto layers = threeQuads(0.);
    layers[0].z = 1.2; // in the nearer volume
    layers[2].z = .75; // between the two
    layers[1].z = -.05;
    scene.add(layers);
    for (const bool nearer : { nearFirst, !nearFirst })
    {
      vtkNew<vtkOpenGLGPUVolumeRayCastMapper> mapper;
      auto volume = fogVolume(mapper, .0005);
      volume->SetPosition(0., 0., nearer ? 1.5 : 0.);
      scene.renderer->AddVolume(volume);
    }
    std::vector<Layer> all = layers;
    for (const auto& part :
      { std::array<double, 2>{ 2., 1.2 }, { 1.2, 1. }, { .5, -.05 }, { -.05, -.5 } })
    {
      all.push_back(fogBetween(part[0], part[1]));
    }
    const double d = scene.differenceFromOver(scene.capture(), all, false);
    suite.check(d <= 1.,
      "two volumes, nearer first " + std::to_string(nearFirst) + ": " + std::to_string(d) +
        "/255 from the closed form",
      __FILE__, __LINE__);
    LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());
  }
}

/** No surfaces, other blend modes: as without the pass. */
void testVolumesAlone(Suite& suite)
{
  for (const bool projection : { false, true })
  {
    std::vector<unsigned char> pictures[2];
    for (const bool ours : { false, true })
    {
      KBufferScene scene(30, 30);
      vtkNew<vtkOpenGLGPUVolumeRayCastMapper> mapper;
      scene.renderer->AddVolume(fogVolume(mapper, .05));
      if (projection)
      {
        mapper->SetBlendModeToMaximumIntensity();
        Layer far;
        far.color = { .1, .8, .3, .4 };
        far.z = -2.;
        scene.add({ far });
      }
      if (!ours)
      {
        scene.peel();
      }
      pictures[ours] = scene.capture();
      LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());
    }
    LT_CHECK(suite, largestDifference(pictures[0], pictures[1]) <= 1);
  }
}
} // namespace

int main(int argc, char* argv[])
{
  if (!canRender())
  {
    return Suite::skipped();
  }
  Suite suite(argc, argv);
  testClosedForm(suite);
  testTurning(suite);
  testTwoVolumes(suite);
  testVolumesAlone(suite);
  LT_CHECK(suite, openGLDebugErrors() == 0);
  return suite.result();
}
