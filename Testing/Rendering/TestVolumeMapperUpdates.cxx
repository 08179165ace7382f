// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Only what changed is done again: changes upstream need no more than a Render,
 * colours and strengths rebuild no shader and upload no field, a moved seed
 * uploads no volume.
 */
#include "LightSource.h"

using namespace lighttransport::testing;

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  if (!canRender())
  {
    return Suite::skipped();
  }
  KeepDisplay keep;
  auto image = makeGrid(20, 20, 20);
  setScalars(image, [](const Point& p) { return ball(p, { 9.5, 9.5, 9.5 }, 9.); });
  LitScene scene(image);
  vtkNew<LightSource> source;
  scene.mapper->SetLightFieldConnection(source->GetOutputPort());
  vtkSmartPointer<vtkLightFieldProperty> light = scene.mapper->GetLightFieldProperty();
  auto* mapper = scene.mapper.Get();

  int rebuilds = 0; // UpdateShaderEvent is not sent on frames that build a shader
  class Frames : public vtkCommand
  {
  public:
    static Frames* New() { return new Frames; }
    void Execute(vtkObject*, unsigned long, void*) override { ++this->reused; }
    int reused = 0;
  };
  vtkNew<Frames> frames;
  mapper->AddObserver(vtkCommand::UpdateShaderEvent, frames);

  Picture last = scene.capture();
  LT_CHECK(suite, source->Runs == 1);
  LT_CHECK(suite, mapper->GetNumberOfShaderBuilds() == 1);
  LT_CHECK(suite, mapper->GetNumberOfLightFieldUploads() == 1);
  LT_CHECK(suite, mapper->GetNumberOfColorMapUploads() == 1);
  LT_CHECK(suite, mapper->GetLightFieldData() == source->GetOutput());
  // The volume's memory is emptied without a word to VTK: were it ever uploaded
  // again, the tissue would vanish.
  auto pristine = vtkSmartPointer<vtkImageData>::New();
  pristine->DeepCopy(image);
  auto* grey = static_cast<float*>(image->GetScalarPointer());
  std::fill(grey, grey + image->GetNumberOfPoints(), 0.F);
  const vtkMTimeType mapperTime = mapper->GetMTime();

  const auto step = [&](const char* what, bool changes, int fields, int maps)
  {
    const int reused = frames->reused;
    const int fieldsBefore = mapper->GetNumberOfLightFieldUploads();
    const int mapsBefore = mapper->GetNumberOfColorMapUploads();
    const int builds = mapper->GetNumberOfShaderBuilds();
    const Picture now = scene.capture();
    const auto check = [&](bool ok, const std::string& name)
    { suite.check(ok, std::string(what) + ": " + name, __FILE__, __LINE__); };
    check((difference(last, now).largest > 2.) == changes, "the picture changes or not");
    check(mapper->GetNumberOfLightFieldUploads() - fieldsBefore == fields, "field uploads");
    check(mapper->GetNumberOfColorMapUploads() - mapsBefore == maps, "colour map uploads");
    check(mapper->GetNumberOfShaderBuilds() == builds, "no shader is built");
    check(frames->reused == reused + 1, "the shader is used again");
    rebuilds += mapper->GetNumberOfShaderBuilds() - builds;
    last = now;
  };

  step("nothing", false, 0, 0);
  scene.renderer->GetActiveCamera()->Azimuth(5.);
  step("camera", true, 0, 0);
  source->SetPlace(12., 6., 9.);
  step("seed", true, 1, 0);
  LT_CHECK(suite, source->Runs == 2);
  light->SetStrength(.5);
  step("strength", true, 0, 0);
  light->SetDecades(2.);
  step("decades", true, 0, 0);
  light->SetWindow(.01, .5);
  step("window", true, 0, 0);
  light->SetScaleToLinear();
  step("scale", true, 0, 0);
  light->SetScaleToLogarithmic();
  light->AutomaticWindowOn();
  light->SetDecades(6.);
  step("automatic window", true, 0, 0);
  light->SetTissueOpacity(.9);
  step("tissue opacity", true, 0, 0);
  light->SetLightOpacity(.3);
  step("light opacity", true, 0, 0);
  light->SetLightOpacityUnitDistance(3.);
  step("unit distance", true, 0, 0);
  light->GetPositiveColorMap()->AddRGBPoint(.5, 0., 1., 0.);
  step("a point of the colour map", true, 0, 1);
  vtkNew<vtkColorTransferFunction> map;
  map->AddRGBPoint(0., 1., 0., 1.);
  light->SetPositiveColorMap(map);
  step("another colour map", true, 0, 1);
  vtkNew<vtkPiecewiseFunction> opacity;
  opacity->AddPoint(0., 1.);
  light->SetLightOpacityFunction(opacity);
  step("opacity function", true, 0, 1);
  vtkNew<vtkLightFieldProperty> other;
  mapper->SetLightFieldProperty(other);
  step("another property", true, 0, 1);
  mapper->SetLightFieldProperty(light);
  step("the first property again", true, 0, 1);
  auto field = makeGrid(20, 20, 20);
  setFluence(field, [](const Point& p) { return glow(p, { 5., 5., 14. }, 1.); });
  mapper->SetLightFieldData(field);
  step("another field", true, 1, 0);
  field->SetOrigin(1., 2., 0.);
  step("the field moved", true, 0, 0);
  LT_CHECK(suite, mapper->GetMTime() == mapperTime);

  // The tissue is still there.
  StockScene stock(pristine);
  stock.renderer->SetActiveCamera(scene.renderer->GetActiveCamera());
  light->SetStrength(0.);
  LT_CHECK(suite, difference(stock.capture(), scene.capture()).largest == 0.);
  LT_CHECK(suite, regionMean(stock.capture(), 0, 0, 63, 63)[0] > 1.);
  light->SetStrength(1.);
  scene.window->Render();
  LT_CHECK(suite, mapper->GetNumberOfShaderBuilds() == 2); // once back from the stock shader

  // What has to build one does; the superclass's own never leaves the light out.
  light->SetModeToIlluminate();
  scene.window->Render();
  LT_CHECK(suite, mapper->GetNumberOfShaderBuilds() == 3);
  scene.property->ShadeOn();
  scene.window->Render();
  LT_CHECK(suite, mapper->GetNumberOfShaderBuilds() == 4);
  scene.window->Render();
  LT_CHECK(suite, mapper->GetNumberOfShaderBuilds() == 4);
  LT_CHECK(suite, rebuilds == 0);

  // Without a light field: as the stock mapper.
  mapper->SetLightFieldConnection(nullptr);
  stock.property->ShadeOn();
  LT_CHECK(suite, difference(stock.capture(), scene.capture()).largest == 0.);
  LT_CHECK(suite, mapper->GetLightFieldData() == nullptr);
  mapper->SetLightFieldProperty(nullptr);
  LT_CHECK(suite, mapper->GetLightFieldProperty() != nullptr);
  LT_CHECK(suite, openGLErrors().empty());
  return suite.result();
}
