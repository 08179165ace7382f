// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Frame time and quality of vtkLightTransportVolumeMapper's lighting with three
 * scene lights, against the stock mapper shaded by the same three, and against
 * rays traced in the shader, all in one run:
 *
 *   bench-lighting [-n 64] [-w 512] [-f 5] [-d FOLDER]
 *   bench-lighting --psnr A.png B.png
 *   bench-lighting --moves 64 128 256     what a light or the opacity that changes costs
 *
 * n^3 points, w^2 pixels, medians of f frames between which the camera turns a
 * little. With a folder, the volume and the pictures are written there, for
 * bench-lighting.sh, which has VTK 9.2's secondary rays draw the same scene; the
 * quality is that of the medium alone there (no gradient is a surface), which is
 * what those rays compute. The exit code is 0 whatever the times are.
 */
#include "BenchVolume.h"
#include "LightTransportRenderingTesting.h"

#include "vtkCamera.h"
#include "vtkColorTransferFunction.h"
#include "vtkLight.h"
#include "vtkLightTransportVolumeMapper.h"
#include "vtkOpenGLGPUVolumeRayCastMapper.h"
#include "vtkPiecewiseFunction.h"
#include "vtkRenderer.h"
#include "vtkSmartPointer.h"
#include "vtkVolume.h"
#include "vtkVolumeLightingProperty.h"
#include "vtkVolumeProperty.h"
#include "vtkXMLImageDataWriter.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <vector>

using namespace lighttransport::testing;

namespace
{
struct View
{
  vtkNew<vtkRenderWindow> window;
  vtkNew<vtkRenderer> renderer;
  vtkNew<vtkVolume> volume;

  View(
    vtkGPUVolumeRayCastMapper* mapper, vtkImageData* image, vtkVolumeProperty* property, int pixels)
  {
    mapper->SetInputData(image);
    mapper->AutoAdjustSampleDistancesOff();
    mapper->SetSampleDistance(static_cast<float>(image->GetSpacing()[0]));
    this->volume->SetMapper(mapper);
    this->volume->SetProperty(property);
    this->renderer->AddVolume(this->volume);
    this->window->SetSize(pixels, pixels);
    this->window->AddRenderer(this->renderer);
    this->window->SetMultiSamples(0);
    const double lights[3][6] = { { -1., .5, 1., 1., .9, .8 }, { 1., 1., .2, .5, .6, 1. },
      { 0., -1., .5, .6, .6, .6 } };
    for (const auto& l : lights)
    {
      vtkNew<vtkLight> light;
      light->SetLightTypeToSceneLight();
      light->SetPosition(l[0], l[1], l[2]);
      light->SetFocalPoint(0., 0., 0.);
      light->SetColor(l[3], l[4], l[5]);
      light->SetIntensity(.6);
      this->renderer->AddLight(light);
    }
    this->renderer->ResetCamera();
    this->renderer->GetActiveCamera()->Azimuth(30.);
    this->renderer->GetActiveCamera()->Elevation(20.);
    this->renderer->GetActiveCamera()->Zoom(1.6);
    this->renderer->ResetCameraClippingRange();
  }

  double milliseconds()
  {
    const auto begin = std::chrono::steady_clock::now();
    this->window->Render();
    // Reading a pixel waits for the GPU.
    vtkNew<vtkUnsignedCharArray> pixel;
    this->window->GetPixelData(0, 0, 0, 0, 0, pixel);
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
      .count();
  }
  double median(int frames)
  {
    this->milliseconds(); // compiles and uploads
    std::vector<double> times;
    for (int f = 0; f < frames; ++f)
    {
      this->renderer->GetActiveCamera()->Azimuth(f % 2 ? -.2 : .2);
      times.push_back(this->milliseconds());
    }
    std::sort(times.begin(), times.end());
    return times[times.size() / 2];
  }
};

/**
 * Milliseconds of what each frame does beside drawing, in a picture of 8^2 pixels: the difference
 * to one whose lights stand.
 */
int measureMoves(const std::vector<int>& sizes)
{
  std::printf("Milliseconds more than a frame in which nothing changed, medians\n\n"
              "| points | headlight turns | 2 lights | 5 lights | in colours, 1 | opacity changes, "
              "exact | and harmonics |\n|---|---|---|---|---|---|---|\n");
  for (const int n : sizes)
  {
    auto image = makeVolume(n);
    vtkNew<vtkColorTransferFunction> color;
    color->AddRGBPoint(0., 1., .9, .8);
    vtkNew<vtkPiecewiseFunction> opacity;
    opacity->AddPoint(0., 0.);
    opacity->AddPoint(255., .15);
    vtkNew<vtkVolumeProperty> property;
    property->SetColor(color);
    property->SetScalarOpacity(opacity);
    property->SetScalarOpacityUnitDistance(.1);
    property->SetAmbient(0.);
    vtkNew<vtkLightTransportVolumeMapper> lit;
    vtkNew<vtkVolumeLightingProperty> lighting;
    lighting->SetVisibilityResolution(n);
    lit->SetLightingProperty(lighting);
    View view(lit, image, property, 8);
    const auto median = [&](const std::function<void(int)>& change)
    {
      view.milliseconds();
      view.milliseconds();
      std::vector<double> times;
      for (int f = 0; f < (n > 128 ? 3 : 9); ++f)
      {
        change(f);
        times.push_back(view.milliseconds());
      }
      std::sort(times.begin(), times.end());
      return times[times.size() / 2];
    };
    const auto turn = [&](int) { view.renderer->GetActiveCamera()->Azimuth(1.); };
    const auto lights = [&](int count)
    {
      view.renderer->RemoveAllLights();
      for (int i = 0; i < count; ++i)
      {
        vtkNew<vtkLight> light;
        light->SetLightTypeToCameraLight();
        light->SetPosition(.3 * i, .2 * i, 1.);
        view.renderer->AddLight(light);
      }
      return median(turn);
    };
    lighting->SetNumberOfExactLights(0);
    const double standing = lights(1);
    lighting->SetNumberOfExactLights(8);
    std::printf("| %d^3 | %.1f | %.1f | %.1f |", n, lights(1) - standing, lights(2) - standing,
      lights(5) - standing);
    lighting->SetColoredShadows(true);
    std::printf(" %.1f |", lights(1) - standing);
    lighting->SetColoredShadows(false);
    lights(1);
    const auto edit = [&](int f) { opacity->AddPoint(255., .15 + .001 * (f % 2)); };
    const double exact = median(edit) - standing;
    lighting->SetNumberOfExactLights(0);
    std::printf(" %.0f | %.0f |\n", exact, median(edit) - standing);
    std::fflush(stdout);
  }
  return 0;
}

int compareFiles(const char* a, const char* b)
{
  vtkNew<vtkPNGReader> readers[2];
  readers[0]->SetFileName(a);
  readers[1]->SetFileName(b);
  readers[0]->Update();
  readers[1]->Update();
  std::printf("%.1f\n", psnr(readers[0]->GetOutput(), readers[1]->GetOutput()));
  return 0;
}
} // namespace

int main(int argc, char* argv[])
{
  int n = 64;
  int pixels = 512;
  int frames = 5;
  std::string folder;
  if (argc == 4 && std::string(argv[1]) == "--psnr")
  {
    return compareFiles(argv[2], argv[3]);
  }
  if (argc > 1 && std::string(argv[1]) == "--moves")
  {
    std::vector<int> sizes;
    for (int i = 2; i < argc; ++i)
    {
      sizes.push_back(std::atoi(argv[i]));
    }
    return canRender() ? measureMoves(sizes) : Suite::skipped();
  }
  for (int i = 1; i + 1 < argc; i += 2)
  {
    const std::string option = argv[i];
    if (option == "-d")
    {
      folder = argv[i + 1];
      continue;
    }
    (option == "-n" ? n : option == "-w" ? pixels : frames) = std::atoi(argv[i + 1]);
  }
  if (!canRender())
  {
    return Suite::skipped();
  }
  auto image = makeVolume(n);
  vtkNew<vtkColorTransferFunction> color;
  color->AddRGBPoint(0., 0., 0., 0.);
  color->AddRGBPoint(255., 1., .9, .8);
  vtkNew<vtkPiecewiseFunction> opacity;
  opacity->AddPoint(0., 0.);
  opacity->AddPoint(255., .15);
  vtkNew<vtkVolumeProperty> property;
  property->SetColor(color);
  property->SetScalarOpacity(opacity);
  property->SetScalarOpacityUnitDistance(.1);
  property->SetInterpolationTypeToLinear();
  property->ShadeOn();

  vtkNew<vtkOpenGLGPUVolumeRayCastMapper> stock;
  vtkNew<vtkLightTransportVolumeMapper> lit;
  vtkNew<vtkVolumeLightingProperty> lighting;
  lit->SetLightingProperty(lighting);
  View stockView(stock, image, property, pixels);
  View litView(lit, image, property, pixels);

  struct Mode
  {
    const char* name;
    std::function<void()> set;
  };
  const std::vector<Mode> modes = {
    { "no shadows", [&] { lighting->SetShadowModeToNoShadows(); } },
    { "precomputed", [&] { lighting->SetShadowModeToPrecomputed(); } },
    { "precomputed, no ambient occlusion", [&] { lighting->SetAmbientOcclusion(0.); } },
    { "precomputed, harmonics alone", [&] { lighting->SetNumberOfExactLights(0); } },
    { "precomputed, environment",
      [&]
      {
        lighting->SetNumberOfExactLights(4);
        lighting->SetAmbientOcclusion(1.);
        lighting->SetEnvironmentStrength(.5);
      } },
    { "precomputed, first hit",
      [&]
      {
        lighting->SetEnvironmentStrength(0.);
        lighting->DeferredOn();
      } },
    { "ray traced",
      [&]
      {
        lighting->DeferredOff();
        lighting->SetShadowModeToRayTraced();
      } },
  };
  const double shaded = stockView.median(frames);
  std::printf("%d^3 points, %d^2 pixels, three lights, medians of %d frames, %s\n\n", n, pixels,
    frames, reinterpret_cast<const char*>(glGetString(GL_RENDERER)));
  std::printf(
    "| lighting | ms | of stock's |\n|---|---|---|\n| stock, shaded | %.0f | 1 |\n", shaded);
  for (const Mode& mode : modes)
  {
    mode.set();
    const double ms = litView.median(std::string(mode.name) == "ray traced" ? 1 : frames);
    std::printf("| %s | %.0f | %.2f |\n", mode.name, ms, ms / shaded);
    std::fflush(stdout);
  }

  // What VTK 9.2's secondary rays compute: isotropic scattering, no surfaces.
  property->SetAmbient(0.);
  property->SetDiffuse(1.);
  property->SetSpecular(0.);
  lighting->SetGradientThreshold(1e9);
  const Picture reference = capture(litView.window);
  lighting->SetShadowModeToPrecomputed();
  const Picture precomputed = capture(litView.window);
  lighting->SetNumberOfExactLights(0);
  const Picture harmonics = capture(litView.window);
  std::printf(
    "\nOf the medium alone, against ray traced: precomputed %.1f dB, from harmonics %.1f dB\n",
    psnr(precomputed, reference), psnr(harmonics, reference));
  if (!folder.empty())
  {
    writePicture(reference, folder + "/reference.png");
    writePicture(precomputed, folder + "/precomputed.png");
    writePicture(harmonics, folder + "/harmonics.png");
    vtkNew<vtkXMLImageDataWriter> writer;
    writer->SetInputData(image);
    writer->SetFileName((folder + "/volume.vti").c_str());
    writer->Write();
  }
  return 0;
}
