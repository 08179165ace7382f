// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Precomputed against ray-traced shadows on the gallery's volumes, where these are
 * there: two lights with exact fields, then with a headlight in the harmonics, which
 * see less sharply.
 */
#include "VolumeMapperScene.h"

#include "vtkLight.h"
#include "vtkNIFTIImageReader.h"
#include "vtkVolumeLightingProperty.h"
#include "vtkXMLImageDataReader.h"

using namespace lighttransport::testing;

namespace
{
struct Data
{
  const char* name;
  Point from;
  std::vector<std::array<double, 2>> opacity; // value, opacity
};

double psnr(vtkImageData* a, vtkImageData* b)
{
  int size[3];
  a->GetDimensions(size);
  double squares = 0.;
  for (int y = 0; y < size[1]; ++y)
  {
    for (int x = 0; x < size[0]; ++x)
    {
      for (int c = 0; c < 3; ++c)
      {
        const double d = pixel(a, x, y)[c] - pixel(b, x, y)[c];
        squares += d * d;
      }
    }
  }
  return 10. * std::log10(255. * 255. * 3. * size[0] * size[1] / std::max(squares, 1e-9));
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
  // The opacities of Examples/LightVolume/lighting-gallery.sh; the head is another one.
  const std::vector<Data> all = {
    { "mr_head.nii.gz", { .7, .9, .3 }, { { 28, 0 }, { 50, .15 }, { 80, .5 }, { 150, .8 } } },
    { "thorax_ct.vti", { .3, 1., -.1 },
      { { 98, 0 }, { 108, .03 }, { 125, .12 }, { 150, .3 }, { 170, .7 }, { 255, .9 } } },
    { "engine.nii.gz", { -1., -.7, .6 }, { { 40, 0 }, { 75, .1 }, { 150, .2 }, { 180, .9 } } },
    { "bonsai.nii.gz", { .3, -1., .25 },
      { { 28, 0 }, { 40, .3 }, { 70, .5 }, { 90, .6 }, { 200, .8 } } },
  };
  int shown = 0;
  for (const Data& data : all)
  {
    const std::string name = data.name;
    if (!suite.hasData(name))
    {
      continue;
    }
    ++shown;
    vtkSmartPointer<vtkImageData> image;
    const std::string path = suite.data + "/" + name;
    if (name.find(".vti") != std::string::npos)
    {
      vtkNew<vtkXMLImageDataReader> reader;
      reader->SetFileName(path.c_str());
      reader->Update();
      image = reader->GetOutput();
    }
    else
    {
      vtkNew<vtkNIFTIImageReader> reader;
      reader->SetFileName(path.c_str());
      reader->Update();
      image = reader->GetOutput();
    }
    LitScene scene(image, 72, 72);
    scene.mapper->SetSampleDistance(static_cast<float>(image->GetSpacing()[0]));
    scene.opacity->RemoveAllPoints();
    for (const auto& p : data.opacity)
    {
      scene.opacity->AddPoint(p[0], p[1]);
    }
    scene.property->SetAmbient(.2);
    scene.property->SetDiffuse(.8);
    scene.look(data.from);
    scene.renderer->GetActiveCamera()->Zoom(1.5);
    scene.renderer->ResetCameraClippingRange();
    const Point places[] = { { -900., 900., 1200. }, { 1500., -300., 300. } };
    for (const Point& place : places)
    {
      vtkNew<vtkLight> sun;
      sun->SetLightTypeToSceneLight();
      sun->SetPosition(place.data());
      sun->SetFocalPoint(0., 0., 0.);
      sun->SetIntensity(.7);
      scene.renderer->AddLight(sun);
    }
    vtkNew<vtkLight> head;
    head->SetLightTypeToHeadlight();
    head->SetIntensity(.3);
    scene.renderer->AddLight(head);
    vtkNew<vtkVolumeLightingProperty> lighting;
    scene.mapper->SetLightingProperty(lighting);
    const auto traced = [&]
    {
      lighting->SetShadowModeToRayTraced();
      const Picture picture = scene.capture();
      lighting->SetShadowModeToPrecomputed();
      return picture;
    };
    const Picture all = traced();
    const Picture precomputed = scene.capture();
    lighting->SetNumberOfExactLights(0);
    const double soft = psnr(scene.capture(), all);
    lighting->SetNumberOfExactLights(4);
    lighting->SetShadowModeToNoShadows();
    const double none = psnr(scene.capture(), all);
    head->SwitchOff();
    const Picture suns = traced();
    const double exact = psnr(scene.capture(), suns);
    const double both = psnr(precomputed, all);
    std::cout << name << ": exact lights " << exact << " dB, with a headlight " << both
              << ", all in harmonics " << soft << ", without shadows " << none << "\n";
    suite.check(
      exact >= 30., name + ": exact " + std::to_string(exact) + " dB", __FILE__, __LINE__);
    suite.check(both >= 27., name + ": all " + std::to_string(both) + " dB", __FILE__, __LINE__);
    LT_CHECK(suite, soft > none + 2.);
    writePicture(suite, precomputed, "VolumeLighting-" + name);
  }
  return shown > 0 ? suite.result() : Suite::skipped();
}
