// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Precomputed against ray-traced shadows on the gallery's volumes, where these are
 * there: two lights that stand and one at the camera, with fields of their own, or
 * looked up in the harmonics, which see less sharply. The table is that of
 * Module/Documentation/lighting.md.
 */
#include "../Rendering/VolumeMapperScene.h"
#include "VolumeReader.h"

#include "vtkLight.h"
#include "vtkVolumeLightingProperty.h"

#include <algorithm>
#include <cstdio>

using namespace lighttransport::testing;

namespace
{
struct Data
{
  const char* name;
  Point from;
  std::vector<std::array<double, 2>> opacity; // value, opacity; seismic: of the .995 quantile
  double ambient = .2;
};

/** Amplitudes: the value below which all but a 200th lie, either sign. */
double largest(vtkImageData* image)
{
  vtkDataArray* array = image->GetPointData()->GetScalars();
  std::vector<double> values(static_cast<std::size_t>(array->GetNumberOfTuples()));
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    values[i] = std::abs(array->GetComponent(static_cast<vtkIdType>(i), 0));
  }
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(.995 * values.size());
  std::nth_element(values.begin(), at, values.end());
  return *at;
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
  // As Examples/LightVolume/lighting-gallery.sh draws them; the head is another one.
  const std::vector<Data> all = {
    { "mr_head.nii.gz", { .7, .9, .3 }, { { 28, 0 }, { 50, .15 }, { 80, .5 }, { 150, .8 } } },
    { "thorax_ct.vti", { .3, 1., -.1 },
      { { 98, 0 }, { 108, .03 }, { 125, .12 }, { 150, .3 }, { 170, .7 }, { 255, .9 } } },
    { "engine.nii.gz", { -1., -.7, .6 }, { { 40, 0 }, { 75, .1 }, { 150, .2 }, { 180, .9 } } },
    { "bonsai.nii.gz", { .3, -1., .25 },
      { { 28, 0 }, { 40, .3 }, { 70, .5 }, { 90, .6 }, { 200, .8 } } },
    { "f3_crop.sgy", { .6, -.8, .5 },
      { { -1, .6 }, { -.5, .06 }, { -.2, 0 }, { .2, 0 }, { .5, .06 }, { 1, .6 } } },
  };
  std::printf(
    "| volume | two lights, exact | in the harmonics | with a headlight, exact | that in the "
    "harmonics | all in the harmonics | order 4 | no shadows |\n"
    "|---|---|---|---|---|---|---|---|\n");
  int shown = 0;
  for (const Data& data : all)
  {
    const std::string name = data.name;
    if (!suite.hasData(name))
    {
      continue;
    }
    ++shown;
    auto image = vtkSmartPointer<vtkImageData>::New();
    double unit = 1.;
    try
    {
      image->ShallowCopy(lightvolume::ReadVolume(suite.data + "/" + name, {}).Image);
    }
    catch (const lightvolume::Error& error)
    {
      std::cout << error.what() << "\n"; // built without the reader of this format
      continue;
    }
    image->SetOrigin(0., 0., 0.); // survey coordinates are too large for floats
    if (name == "f3_crop.sgy")
    {
      unit = largest(image);
    }
    LitScene scene(image, 72, 72);
    scene.mapper->SetSampleDistance(
      static_cast<float>(*std::min_element(image->GetSpacing(), image->GetSpacing() + 3)));
    scene.opacity->RemoveAllPoints();
    for (const auto& p : data.opacity)
    {
      scene.opacity->AddPoint(unit * p[0], p[1]);
    }
    scene.property->SetScalarOpacityUnitDistance(image->GetLength() / 250.);
    scene.color->AddRGBPoint(-unit, .5, .6, .8);
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
      Picture picture = scene.capture();
      lighting->SetShadowModeToPrecomputed();
      return picture;
    };
    const auto against = [&](vtkImageData* reference, int exactLights)
    {
      lighting->SetNumberOfExactLights(exactLights);
      return psnr(scene.capture(), reference);
    };
    const Picture reference = traced();
    const Picture precomputed = scene.capture();
    const double exact = psnr(precomputed, reference);
    const double mixed = against(reference, 2);
    const double soft = against(reference, 0);
    lighting->SetVisibilityOrder(4);
    const double fine = against(reference, 0);
    lighting->SetVisibilityOrder(2);
    lighting->SetShadowModeToNoShadows();
    const double none = against(reference, 8);
    head->SwitchOff();
    const Picture suns = traced();
    const double fixedExact = psnr(scene.capture(), suns);
    const double fixedSoft = against(suns, 0);
    std::printf("| %s | %.1f | %.1f | %.1f | %.1f | %.1f | %.1f | %.1f |\n", data.name, fixedExact,
      fixedSoft, exact, mixed, soft, fine, none);
    std::fflush(stdout);
    const auto check = [&](bool ok, const std::string& what, double value)
    { suite.check(ok, name + ": " + what + " " + std::to_string(value), __FILE__, __LINE__); };
    check(fixedExact >= 30., "two lights, exact", fixedExact);
    check(exact >= 30., "with a headlight, exact", exact);
    check(soft > none + 1. && fine > soft + 1., "harmonics", soft);
    LT_CHECK(suite, openGLErrors().empty());
    writePicture(suite, precomputed, "VolumeLighting-" + name.substr(0, name.find('.')));
  }
  return shown > 0 ? suite.result() : Suite::skipped();
}
