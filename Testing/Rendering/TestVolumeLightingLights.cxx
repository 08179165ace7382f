// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Light comes from where the lights are, of every kind and number, whichever way the
 * volume is turned; only what changed is computed and uploaded again.
 */
#include "VolumeMapperScene.h"

#include "vtkLight.h"
#include "vtkLightCollection.h"
#include "vtkTexture.h"
#include "vtkVisibilityFactorFilter.h"
#include "vtkVolumeLightingProperty.h"

using namespace lighttransport::testing;

namespace
{
constexpr int N = 24;
constexpr int Size = 48;
const Point Middle = { 11.5, 11.5, 11.5 };

vtkSmartPointer<vtkImageData> makeBall()
{
  auto image = makeGrid(N, N, N);
  setScalars(image, [](const Point& p) { return ball(p, Middle, 9.); });
  return image;
}

/** An opaque white ball without ambient light, seen along -x: y to the left, z up. */
struct LightScene : LitScene
{
  LightScene()
    : LitScene(makeBall(), Size, Size)
  {
    this->color->RemoveAllPoints();
    this->color->AddRGBPoint(0., 1., 1., 1.);
    this->opacity->RemoveAllPoints();
    this->opacity->AddPoint(10., 0.);
    this->opacity->AddPoint(15., .9);
    this->property->SetAmbient(0.);
    this->property->SetDiffuse(1.);
    this->property->SetSpecular(0.);
    this->renderer->AutomaticLightCreationOff();
    this->mapper->SetLightingProperty(this->lighting);
    this->volume->SetOrigin(Middle.data());
    this->look({ -1., 0., 0. }, true);
  }
  vtkLight* add(const Point& position, bool positional = false)
  {
    vtkNew<vtkLight> light;
    light->SetLightTypeToSceneLight();
    light->SetPosition(position.data());
    light->SetFocalPoint(Middle.data());
    light->SetPositional(positional);
    light->SetConeAngle(180.);
    this->renderer->AddLight(light);
    return light;
  }
  vtkNew<vtkVolumeLightingProperty> lighting;
};

/** Means of the left, right, lower and upper part of the ball. */
struct Sides
{
  explicit Sides(vtkImageData* p)
    : left(regionMean(p, 8, 16, 17, 31))
    , right(regionMean(p, 30, 16, 39, 31))
    , lower(regionMean(p, 16, 8, 31, 17))
    , upper(regionMean(p, 16, 30, 31, 39))
  {
  }
  Color left, right, lower, upper;
};

/** From each side, turned volume or not, exact or not, in each mode: that side is bright. */
void directions(Suite& suite)
{
  LightScene scene;
  vtkLight* light = scene.add({ 0., 0., 0. });
  for (const int mode : { 0, 1, 2 })
  {
    scene.lighting->SetShadowMode(mode);
    for (const int exact : { 4, 0 })
    {
      scene.lighting->SetNumberOfExactLights(exact);
      for (const double turn : { 0., 70. })
      {
        scene.volume->SetOrientation(turn, .5 * turn, 0.);
        for (const bool positional : { false, true })
        {
          light->SetPositional(positional);
          const auto at = [&](double y, double z)
          {
            light->SetPosition(Middle[0] - 20., Middle[1] + 60. * y, Middle[2] + 60. * z);
            return Sides(scene.capture());
          };
          const Sides fromLeft = at(1., 0.);
          const Sides fromRight = at(-1., 0.);
          const Sides fromAbove = at(0., 1.);
          LT_CHECK(suite, fromLeft.left[0] > 40. && fromLeft.left[0] > 2. * fromLeft.right[0]);
          LT_CHECK(suite, fromRight.right[0] > 40. && fromRight.right[0] > 2. * fromRight.left[0]);
          LT_CHECK(suite, fromAbove.upper[0] > 40. && fromAbove.upper[0] > 2. * fromAbove.lower[0]);
          LT_CHECK_NEAR(suite, fromAbove.left[0], fromAbove.right[0], 6.);
        }
      }
    }
  }
}

/** Colours add up; a cone ends; distance fades; the camera's light goes with it. */
void kinds(Suite& suite)
{
  LightScene scene;
  vtkLight* red = scene.add({ -30., 80., 11.5 });
  red->SetColor(1., 0., 0.);
  vtkLight* blue = scene.add({ -30., -60., 11.5 });
  blue->SetColor(0., 0., .5);
  const Sides both(scene.capture());
  LT_CHECK(suite, both.left[0] > 40. && both.left[0] > 3. * both.left[2]);
  LT_CHECK(suite, both.right[2] > 20. && both.right[2] > 3. * both.right[0]);
  LT_CHECK(suite, both.left[1] == 0. && both.right[1] == 0.);

  // A spot on the upper half: below its cone it is dark.
  scene.renderer->RemoveAllLights();
  vtkLight* spot = scene.add({ -40., 11.5, 17. }, true);
  spot->SetFocalPoint(11.5, 11.5, 17.);
  const Picture wide = scene.capture();
  spot->SetConeAngle(5.);
  const Picture narrow = scene.capture();
  LT_CHECK(suite, pixel(wide, 24, 18)[0] > 60. && pixel(narrow, 24, 18)[0] == 0.);
  LT_CHECK_NEAR(suite, pixel(narrow, 24, 34)[0], pixel(wide, 24, 34)[0], 3.);
  LT_CHECK(suite, pixel(narrow, 24, 34)[0] > 60.);
  spot->SetExponent(200.);
  const Picture soft = scene.capture();
  LT_CHECK(suite, pixel(soft, 24, 26)[0] < .8 * pixel(narrow, 24, 26)[0]);
  spot->SetConeAngle(180.);
  spot->SetAttenuationValues(0., 1. / 45., 0.); // 1/2 at twice 45
  const double near = pixel(scene.capture(), 24, 34)[0];
  spot->SetPosition(-85., 11.5, 17.);
  const double far = pixel(scene.capture(), 24, 34)[0];
  LT_CHECK_CLOSE(suite, far / near, .5, .15); // it also comes in flatter

  // Specular light, Blinn and Phong's and the physically based terms'.
  scene.renderer->RemoveAllLights();
  vtkLight* lamp = scene.add({ -60., 11.5, 11.5 });
  lamp->SetIntensity(.4);
  const double dull = pixel(scene.capture(), 24, 24)[0];
  scene.property->SetSpecular(.5);
  LT_CHECK(suite, pixel(scene.capture(), 24, 24)[0] > dull + 20.);
  scene.lighting->SetShadingModelToPhysicallyBased();
  scene.property->SetSpecular(0.);
  const double rough = pixel(scene.capture(), 24, 24)[0];
  scene.lighting->SetRoughness(.3);
  LT_CHECK(suite, pixel(scene.capture(), 24, 24)[0] > rough + 10.);
  scene.lighting->SetShadingModelToBlinnPhong();

  // No light at all is dark; the headlight is in front, wherever the camera is.
  scene.renderer->RemoveAllLights();
  double range[2];
  scene.capture()->GetScalarRange(range);
  LT_CHECK(suite, range[1] == 0.);
  vtkNew<vtkLight> head;
  head->SetLightTypeToHeadlight();
  scene.renderer->AddLight(head);
  for (const Point& from : { Point{ -1., 0., 0. }, Point{ .5, 1., .3 } })
  {
    scene.look(from, true);
    const Sides lit(scene.capture());
    LT_CHECK(suite, lit.left[0] > 30. && std::abs(lit.left[0] - lit.right[0]) < 8.);
  }
}

/** n lights of 1/n are one light, up to numbers that need a texture. */
void numbers(Suite& suite)
{
  for (const int exact : { 0, 4 })
  {
    LightScene scene;
    scene.property->ShadeOn(); // VTK has room for six
    scene.lighting->SetNumberOfExactLights(exact);
    auto observer = observe(scene.mapper);
    Picture one;
    for (const int n : { 1, 3, 7, 13, 45 })
    {
      scene.renderer->RemoveAllLights();
      for (int i = 0; i < n; ++i)
      {
        vtkLight* light = scene.add({ -40., 50., 40. });
        light->SetIntensity(.8 / n);
      }
      const Picture picture = scene.capture();
      LT_CHECK(suite, scene.renderer->GetLights()->GetNumberOfItems() == n);
      if (n == 1)
      {
        one = picture;
        LT_CHECK(suite, Sides(one).left[0] > 40.);
        continue;
      }
      const Difference d = difference(one, picture);
      // Of many only four are exact, and the others soft.
      suite.check(exact == 0 || n <= 4 ? d.largest <= 3. : d.mean < 12.,
        std::to_string(n) + " lights differ by " + std::to_string(d.largest), __FILE__, __LINE__);
    }
    LT_CHECK(suite, observer->all().empty());
  }
}

/** What is computed, uploaded and built, by what changed. */
void updates(Suite& suite)
{
  LightScene scene;
  vtkLight* sun = scene.add({ -40., 50., 40. });
  vtkNew<vtkLight> head;
  head->SetLightTypeToHeadlight();
  head->SetIntensity(.3);
  scene.renderer->AddLight(head);
  scene.property->SetAmbient(.2);
  auto* mapper = scene.mapper.Get();
  Picture last = scene.capture();
  LT_CHECK(suite, mapper->GetNumberOfVisibilityComputations() == 1);
  const auto step = [&](const char* what, bool changes, int computations, int uploads)
  {
    const int c = mapper->GetNumberOfVisibilityComputations();
    const int u = mapper->GetNumberOfVisibilityUploads();
    const int b = mapper->GetNumberOfShaderBuilds();
    const Picture now = scene.capture();
    const auto check = [&](bool ok, const std::string& name)
    { suite.check(ok, std::string(what) + ": " + name, __FILE__, __LINE__); };
    check((difference(last, now).largest > 2.) == changes,
      "the picture changes by " + std::to_string(difference(last, now).largest));
    check(mapper->GetNumberOfVisibilityComputations() - c == computations,
      "computations " + std::to_string(mapper->GetNumberOfVisibilityComputations() - c));
    check(mapper->GetNumberOfVisibilityUploads() - u == uploads,
      "uploads " + std::to_string(mapper->GetNumberOfVisibilityUploads() - u));
    check(mapper->GetNumberOfShaderBuilds() == b, "no shader is built");
    last = now;
  };
  step("nothing", false, 0, 0);
  scene.renderer->GetActiveCamera()->Azimuth(20.);
  step("camera, and with it the headlight", true, 0, 1);
  scene.renderer->GetActiveCamera()->Dolly(1.1);
  step("the camera's distance", false, 0, 0);
  scene.lighting->SetNumberOfExactLights(1);
  scene.capture();
  last = scene.capture();
  scene.renderer->GetActiveCamera()->Azimuth(10.);
  step("camera, with the headlight in the harmonics", true, 0, 0);
  scene.lighting->SetNumberOfExactLights(8);
  scene.capture();
  last = scene.capture();
  sun->SetColor(1., .4, .1);
  step("a light's colour", true, 0, 0);
  sun->SetIntensity(.5);
  step("a light's intensity", true, 0, 0);
  head->SetIntensity(.6);
  step("the headlight's", true, 0, 0);
  sun->SetPosition(-40., -50., 40.);
  step("an exact light moved", true, 0, 1);
  scene.lighting->SetShadowStrength(.5);
  step("shadow strength", true, 0, 0);
  scene.lighting->SetAmbientOcclusion(.2);
  step("ambient occlusion", true, 0, 0);
  scene.lighting->SetSurfaceOffset(.5);
  step("surface offset", true, 0, 0);
  scene.lighting->SetGradientThreshold(1000.);
  step("gradient threshold", true, 0, 0);
  scene.volume->SetPosition(0., 3., 0.);
  step("the volume moved", true, 0, 0);
  scene.volume->SetOrientation(0., 0., 40.);
  step("the volume turned, and the light by that", true, 0, 1);
  const int before = mapper->GetNumberOfVisibilityComputations();
  scene.opacity->AddPoint(15., .05);
  scene.capture();
  LT_CHECK(suite, mapper->GetNumberOfVisibilityComputations() == before + 1);
  scene.color->AddRGBPoint(0., .2, .9, .3);
  scene.capture();
  LT_CHECK(suite, mapper->GetNumberOfVisibilityComputations() == before + 1);
  scene.mapper->CroppingOn();
  scene.mapper->SetCroppingRegionPlanes(4., 16., 4., 16., 4., 16.);
  last = scene.capture();
  LT_CHECK(suite, mapper->GetNumberOfVisibilityComputations() == before + 2);

  // The environment: a texture that turns is a uniform.
  scene.opacity->AddPoint(15., .9);
  vtkNew<vtkFloatArray> radiance;
  radiance->SetNumberOfComponents(3);
  radiance->SetNumberOfTuples(16 * 8);
  for (int i = 0; i < 128; ++i)
  {
    radiance->SetTuple3(i, i / 16 >= 4 ? 1. : .05, .3, i / 16 < 4 ? 1. : .05); // red above (+y)
  }
  vtkNew<vtkImageData> image;
  image->SetDimensions(16, 8, 1);
  image->GetPointData()->SetScalars(radiance);
  vtkNew<vtkTexture> sky;
  sky->SetInputData(image);
  scene.renderer->SetEnvironmentTexture(sky);
  scene.lighting->SetEnvironmentStrength(1.);
  last = scene.capture();
  scene.renderer->SetEnvironmentUp(0., 0., -1.);
  scene.renderer->SetEnvironmentRight(0., 1., 0.);
  step("the environment turned", true, 0, 0);
  image->Modified();
  radiance->FillValue(.4F);
  image->Modified();
  step("the environment's texture", true, 0, 0);
  LT_CHECK(suite, openGLErrors().empty());
}

/** Red above, blue below, green beside: the ball shows it, turned or not. */
void environment(Suite& suite)
{
  LightScene scene;
  vtkNew<vtkFloatArray> radiance;
  radiance->SetNumberOfComponents(3);
  radiance->SetNumberOfTuples(32 * 16);
  for (int i = 0; i < 512; ++i)
  {
    // VTK's maps: the first row is -up, the middle column the direction `right`.
    const int row = i / 32;
    const double up = -std::cos(3.14159265 * (row + .5) / 16.);
    const double right =
      std::cos(3.14159265 * (2. * (i % 32 + .5) / 32. - 1.)) * std::sqrt(1. - up * up);
    radiance->SetTuple3(i, std::max(up, 0.), std::max(right, 0.), std::max(-up, 0.));
  }
  vtkNew<vtkImageData> image;
  image->SetDimensions(32, 16, 1);
  image->GetPointData()->SetScalars(radiance);
  vtkNew<vtkTexture> sky;
  sky->SetInputData(image);
  scene.renderer->SetEnvironmentTexture(sky);
  scene.renderer->SetEnvironmentUp(0., 0., 1.);
  scene.renderer->SetEnvironmentRight(0., 1., 0.); // to the left in the picture
  scene.lighting->SetEnvironmentStrength(1.);
  for (const int mode : { 0, 1 })
  {
    scene.lighting->SetShadowMode(mode);
    for (const double turn : { 0., 50. })
    {
      scene.volume->SetOrientation(turn, turn, 0.);
      const Sides s(scene.capture());
      LT_CHECK(suite, s.upper[0] > 30. && s.upper[0] > 2. * s.upper[2]);
      LT_CHECK(suite, s.lower[2] > 30. && s.lower[2] > 2. * s.lower[0]);
      LT_CHECK(suite, s.left[1] > 25. && s.left[1] > 1.7 * s.right[1]);
    }
  }
  // A cube map, its faces one colour each: +z is above here.
  vtkNew<vtkTexture> cube;
  cube->CubeMapOn();
  vtkNew<vtkImageData> faces[6];
  for (int f = 0; f < 6; ++f)
  {
    faces[f]->SetDimensions(4, 4, 1);
    vtkNew<vtkFloatArray> even;
    even->SetNumberOfComponents(3);
    even->SetNumberOfTuples(16);
    for (int i = 0; i < 16; ++i)
    {
      even->SetTuple3(i, f == 4, f == 2, f == 5);
    }
    faces[f]->GetPointData()->SetScalars(even);
    cube->SetInputDataObject(f, faces[f]);
  }
  scene.renderer->SetEnvironmentTexture(cube);
  scene.renderer->SetEnvironmentUp(0., 1., 0.);
  scene.renderer->SetEnvironmentRight(1., 0., 0.);
  const Sides s(scene.capture());
  LT_CHECK(suite, s.upper[0] > 30. && s.upper[0] > 2. * s.upper[2]);
  LT_CHECK(suite, s.lower[2] > 30. && s.lower[2] > 2. * s.lower[0]);
  LT_CHECK(suite, s.left[1] > 30. && s.left[1] > 2. * s.right[1]);
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
  directions(suite);
  kinds(suite);
  numbers(suite);
  updates(suite);
  environment(suite);
  LT_CHECK(suite, openGLErrors().empty());
  return suite.result();
}
