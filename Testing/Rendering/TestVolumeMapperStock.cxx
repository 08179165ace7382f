// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * In every configuration of the superclass: with strength 0 its picture to the
 * pixel; with light a shader that builds, no error, and a picture in which the
 * light shows where it has a meaning and nothing changed where it has none. A
 * field of light that does not touch the volume changes nothing.
 */
#include "VolumeMapperConfigurations.h"

#include "vtkActor.h"
#include "vtkHardwareSelector.h"
#include "vtkOpenGLRenderer.h"
#include "vtkPolyDataMapper.h"
#include "vtkProperty.h"
#include "vtkSelection.h"
#include "vtkShaderProperty.h"
#include "vtkSphereSource.h"

using namespace lighttransport::testing;

namespace
{
vtkSmartPointer<vtkImageData> fieldAt(const Point& place)
{
  auto image = makeGrid(12, 12, 12);
  image->SetSpacing(1.8, 1.8, 1.8);
  const auto shift = [&](const Point& p) { return glow(p, place, .5); };
  setFluence(image, shift);
  setFlux(image,
    [&](const Point& p) {
      return Point{ p[0] - place[0], p[1] - place[1], p[2] - place[2] };
    });
  return image;
}

/** Strength 0, then every mode; tells what went wrong by the configuration's name. */
void testConfigurations(Suite& suite)
{
  auto field = fieldAt({ 7., 8., 11. });
  for (const Configuration& c : configurations())
  {
    auto image = c.components == 1 ? oneComponent() : components(c.components);
    StockScene stock(image);
    LitScene lit(image);
    auto observer = observe(lit.mapper);
    stock.mapper->SetBlendMode(c.blend);
    lit.mapper->SetBlendMode(c.blend);
    c.apply(stock.mapper, stock.property, stock.renderer);
    c.apply(lit.mapper, lit.property, lit.renderer);
    lit.mapper->SetLightFieldData(field);

    const auto check = [&](bool ok, const std::string& what)
    { suite.check(ok, std::string(c.name) + ": " + what, __FILE__, __LINE__); };
    const Picture expected = stock.capture();
    const Color mean = regionMean(expected, 0, 0, 63, 63);
    check(mean[0] + mean[1] + mean[2] > .3, "the stock picture shows something");
    vtkLightFieldProperty* light = lit.mapper->GetLightFieldProperty();
    light->SetStrength(0.);
    check(difference(expected, lit.capture()).largest == 0., "strength 0 is the stock picture");
    light->SetStrength(1.);
    for (int mode = 0; mode < 3; ++mode)
    {
      light->SetMode(mode);
      const Picture picture = lit.capture();
      const double d = difference(expected, picture).largest;
      // 9.1 leaves this projection's opacity at 0, which has no colour to illuminate.
      const bool noOpacity =
        c.blend == vtkVolumeMapper::MINIMUM_INTENSITY_BLEND && c.components > 1 && mode == 1;
      check(noOpacity || (c.lightShows ? d > 3. : d == 0.),
        std::string(light->GetModeAsString()) + " differs by " + std::to_string(d));
      if (mode == 0)
      {
        const double warm = regionMean(picture, 20, 20, 43, 43)[0] -
          regionMean(picture, 20, 20, 43, 43)[2] - regionMean(expected, 20, 20, 43, 43)[0] +
          regionMean(expected, 20, 20, 43, 43)[2];
        check(!c.lightShows || warm > 3., "Overlay is warm by " + std::to_string(warm));
      }
    }
    light->SetStrength(0.);
    check(difference(expected, lit.capture()).largest == 0., "strength 0 again");
    // A field elsewhere is no light; the shader with light runs and changes nothing.
    light->SetMode(0);
    light->SetStrength(1.);
    light->SetTissueOpacity(1.);
    auto elsewhere = fieldAt({ 7., 8., 11. });
    elsewhere->SetOrigin(100., 100., 100.);
    lit.mapper->SetLightFieldData(elsewhere);
    const double d = difference(expected, lit.capture()).largest;
    check(d <= 1., "a field elsewhere differs by " + std::to_string(d));
    check(observer->errors.empty() && observer->warnings.empty(), observer->all());
    check(openGLErrors().empty(), "OpenGL error");
    if (std::string(c.name) == "composite shaded")
    {
      vtkNew<vtkImageData> none;
      lit.mapper->SetLightFieldData(nullptr);
      check(difference(expected, lit.capture()).largest == 0., "no field");
      setFluence(field, [](const Point&) { return 0.; });
      lit.mapper->SetLightFieldData(field);
      check(difference(expected, lit.capture()).largest == 0., "a field of zeros");
      check(observer->errors.empty(), observer->all());
      field = fieldAt({ 7., 8., 11. });
    }
  }
}

/** Clipped and cropped light is not seen. */
void testClipping(Suite& suite)
{
  LitScene scene(oneComponent());
  scene.look({ 0., -1., 0. }, true); // x to the right
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(0., 0.);
  auto field = makeGrid(N, N, N);
  setFluence(field, [](const Point&) { return 1.; });
  scene.mapper->SetLightFieldData(field);
  const Color whole = pixel(scene.capture(), 20, 32);
  LT_CHECK(suite, whole[0] > 200.);
  vtkNew<vtkPlane> plane;
  plane->SetOrigin(9.5, 0., 0.);
  plane->SetNormal(1., 0., 0.);
  scene.mapper->AddClippingPlane(plane);
  Picture picture = scene.capture();
  LT_CHECK(suite, pixel(picture, 20, 32)[0] == 0. && pixel(picture, 44, 32)[0] == whole[0]);
  scene.mapper->RemoveAllClippingPlanes();
  scene.mapper->CroppingOn();
  scene.mapper->SetCroppingRegionPlanes(0., 9.5, 0., 19., 0., 19.);
  scene.mapper->SetCroppingRegionFlagsToSubVolume();
  picture = scene.capture();
  LT_CHECK(suite, pixel(picture, 44, 32)[0] == 0. && pixel(picture, 20, 32)[0] == whole[0]);
}

/** Two viewports, two mappers in one of them, one mapper in both; resizing; another window. */
void testViews(Suite& suite)
{
  auto field = fieldAt({ 7., 8., 11. });
  LitScene a(oneComponent());
  a.mapper->SetLightFieldData(field);
  const Picture one = a.capture();

  vtkNew<vtkRenderWindow> window;
  window->SetMultiSamples(0);
  window->SetSize(128, 64);
  LitScene b(oneComponent());
  b.mapper->SetLightFieldData(field);
  vtkNew<vtkRenderer> left;
  left->SetViewport(0., 0., .5, 1.);
  left->AddVolume(b.volume);
  left->SetActiveCamera(a.renderer->GetActiveCamera());
  vtkNew<vtkRenderer> right;
  right->SetViewport(.5, 0., 1., 1.);
  right->AddVolume(b.volume);
  right->SetActiveCamera(a.renderer->GetActiveCamera());
  window->AddRenderer(left);
  window->AddRenderer(right);
  auto observer = observe(b.mapper);
  const Picture both = capture(window);
  double largest = 0.;
  for (int y = 0; y < 64; ++y)
  {
    for (int x = 0; x < 128; ++x)
    {
      for (int c = 0; c < 3; ++c)
      {
        largest = std::max(largest, std::abs(pixel(both, x, y)[c] - pixel(one, x % 64, y)[c]));
      }
    }
  }
  LT_CHECK(suite, largest <= 1.);
  LT_CHECK(suite, b.mapper->GetNumberOfLightFieldUploads() == 1);
  window->SetSize(60, 90);
  window->Render();
  window->SetSize(128, 64);
  LT_CHECK(suite, difference(both, capture(window)).largest <= 1.);

  // A second volume in the same renderer; its own light.
  b.volume->SetPosition(0., 0., 0.);
  vtkNew<vtkVolume> second;
  vtkNew<vtkLightTransportVolumeMapper> secondMapper;
  secondMapper->SetInputData(oneComponent());
  secondMapper->SetLightFieldData(fieldAt({ 12., 12., 12. }));
  secondMapper->GetLightFieldProperty()->SetPositiveColorMap(
    b.mapper->GetLightFieldProperty()->GetNegativeColorMap());
  second->SetMapper(secondMapper);
  second->SetProperty(b.property);
  second->SetPosition(22., 0., 0.);
  left->AddVolume(second);
  left->SetActiveCamera(nullptr);
  left->ResetCamera();
  auto observer2 = observe(secondMapper);
  writePicture(suite, capture(window), "VolumeMapperTwo");
  LT_CHECK(suite, observer->errors.empty() && observer2->errors.empty());

  // Another window takes the mapper over; resources of the first are given back.
  left->RemoveAllViewProps();
  right->RemoveAllViewProps();
  window->Render();
  LitScene c(oneComponent());
  c.renderer->RemoveAllViewProps();
  c.renderer->AddVolume(b.volume);
  c.renderer->SetActiveCamera(a.renderer->GetActiveCamera());
  LT_CHECK(suite, difference(one, c.capture()).largest <= 1.);
  LT_CHECK(suite, b.mapper->GetNumberOfLightFieldUploads() >= 2);
  c.window->Finalize();
  LT_CHECK(suite, difference(one, c.capture()).largest <= 1.);
  b.mapper->ReleaseGraphicsResources(c.window);
  LT_CHECK(suite, difference(one, c.capture()).largest <= 1.);
  LT_CHECK(suite, observer->all().empty());
  LT_CHECK(suite, openGLErrors().empty());
}

/** Geometry in and around the volume; peeling; render to image; picking. */
void testWithOthers(Suite& suite)
{
  auto field = fieldAt({ 7., 8., 11. });
  LitScene scene(oneComponent());
  scene.mapper->SetLightFieldData(field);
  auto observer = observe(scene.mapper);
  const Picture plain = scene.capture();

  vtkNew<vtkSphereSource> sphere;
  sphere->SetCenter(9.5, 9.5, 9.5);
  sphere->SetRadius(14.);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(sphere->GetOutputPort());
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  actor->GetProperty()->SetColor(0., 1., 0.);
  scene.renderer->AddActor(actor);
  const Color hidden = pixel(scene.capture(), 32, 32); // an opaque sphere around everything
  LT_CHECK(suite, hidden[0] == 0. && hidden[1] > 100.);
  actor->GetProperty()->SetOpacity(.3);
  scene.renderer->SetUseDepthPeeling(1);
  scene.renderer->SetUseDepthPeelingForVolumes(true);
  scene.renderer->SetMaximumNumberOfPeels(8);
  const Picture peeled = scene.capture();
  writePicture(suite, peeled, "VolumeMapperPeeled");
  const Color middle = pixel(peeled, 32, 32);
  LT_CHECK(suite, middle[0] > 40. && middle[1] > 20.);
  LT_CHECK(suite, observer->all().empty());
  scene.renderer->SetUseDepthPeeling(0);
  scene.renderer->SetUseDepthPeelingForVolumes(false);
  scene.renderer->RemoveActor(actor);
  LT_CHECK(suite, difference(plain, scene.capture()).largest == 0.);

  scene.mapper->RenderToImageOn();
  scene.window->Render();
  scene.mapper->RenderToImageOff();
  LT_CHECK(suite, difference(plain, scene.capture()).largest == 0.);

  // The light can't be picked; the volume can, as ever.
  vtkNew<vtkHardwareSelector> selector;
  selector->SetRenderer(scene.renderer);
  selector->SetArea(30, 30, 34, 34);
  vtkSmartPointer<vtkSelection> selection;
  selection.TakeReference(selector->Select());
  LT_CHECK(suite, selection && selection->GetNumberOfNodes() == 1);
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(0., 0.);
  LT_CHECK(suite, pixel(scene.capture(), 28, 34)[0] > 50.);
  selection.TakeReference(selector->Select());
  LT_CHECK(suite, selection && selection->GetNumberOfNodes() == 0);
  LT_CHECK(suite, observer->all().empty());
  LT_CHECK(suite, openGLErrors().empty());
}

/** Replacements of the user's own vtkShaderProperty work together with the light. */
void testUserReplacements(Suite& suite)
{
  auto field = fieldAt({ 7., 8., 11. });
  LitScene scene(oneComponent());
  auto observer = observe(scene.mapper);
  scene.mapper->SetLightFieldData(field);
  const Picture plain = scene.capture();
  vtkShaderProperty* shader = scene.volume->GetShaderProperty();
  shader->AddFragmentShaderReplacement(
    "//VTK::Base::Exit", true, "//VTK::Base::Exit\n  g_fragColor.g = 0.0;", false);
  Picture picture = scene.capture();
  Color before = regionMean(plain, 0, 0, 63, 63);
  Color after = regionMean(picture, 0, 0, 63, 63);
  LT_CHECK(suite, before[1] > 1. && after[1] == 0.);
  LT_CHECK_NEAR(suite, after[0], before[0], .01);
  shader->ClearAllFragmentShaderReplacements();
  shader->AddFragmentShaderReplacement(
    "//VTK::Shading::Impl", true, "{ g_dataPos += vec3(0.0);\n//VTK::Shading::Impl\n}", false);
  LT_CHECK(suite, difference(plain, scene.capture()).largest <= 1.);
  LT_CHECK(suite, observer->all().empty());

  // One that takes a tag away: one error that names it, and the picture without light.
  shader->ClearAllFragmentShaderReplacements();
  shader->AddFragmentShaderReplacement(
    "//VTK::Shading::Impl", true, "g_fragColor = vec4(0.0, 0.0, 1.0, 1.0);", false);
  for (int i = 0; i < 3; ++i)
  {
    picture = scene.capture();
    LT_CHECK(suite, pixel(picture, 32, 32)[2] == 255. && pixel(picture, 32, 32)[0] == 0.);
  }
  LT_CHECK(suite, observer->errors.size() == 1 && observer->hasError("//VTK::Shading::Impl"));
  LT_CHECK(suite, observer->hasError("VTK 9."));
  shader->ClearAllFragmentShaderReplacements();
  LT_CHECK(suite, difference(plain, scene.capture()).largest == 0.);
  LT_CHECK(suite, observer->errors.size() == 1);
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
  testConfigurations(suite);
  testClipping(suite);
  testViews(suite);
  testWithOthers(suite);
  testUserReplacements(suite);
  return suite.result();
}
