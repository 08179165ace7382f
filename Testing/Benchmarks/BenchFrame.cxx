// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Frame time of vtkLightTransportVolumeMapper against the stock mapper, both in
 * one run and in turn, medians of several frames:
 *
 *   bench-frame [-n 128] [-w 512] [-f 5] [-m MODE]
 *
 * n^3 points of volume and of light field, a window of w^2 pixels, f frames.
 * A table of Markdown: mode, shading, milliseconds of either, their quotient, and
 * the quotient of the processor time, which a busy machine disturbs less (with a
 * GPU it says nothing).
 * The exit code is 0 whatever the times are: another machine, other times.
 */
#include "BenchVolume.h"
#include "LightTransportRenderingTesting.h"

#include "vtkCamera.h"
#include "vtkColorTransferFunction.h"
#include "vtkFloatArray.h"
#include "vtkLightFieldProperty.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportVolumeMapper.h"
#include "vtkOpenGLGPUVolumeRayCastMapper.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPointData.h"
#include "vtkRenderer.h"
#include "vtkSmartPointer.h"
#include "vtkVolume.h"
#include "vtkVolumeProperty.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <utility>
#include <vector>

using namespace lighttransport::testing;

namespace
{
/** exp(-mu r) / r about a point off the centre, and its flux. */
vtkSmartPointer<vtkImageData> makeLight(vtkImageData* volume)
{
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->CopyStructure(volume);
  vtkNew<vtkFloatArray> fluence;
  fluence->SetName(vtkLightTransportArrays::Fluence);
  fluence->SetNumberOfTuples(image->GetNumberOfPoints());
  vtkNew<vtkFloatArray> flux;
  flux->SetName(vtkLightTransportArrays::Flux);
  flux->SetNumberOfComponents(3);
  flux->SetNumberOfTuples(image->GetNumberOfPoints());
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    double p[3];
    image->GetPoint(i, p);
    const double d[3] = { p[0] - .3, p[1], p[2] };
    const double r = .02 + std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    const double phi = std::exp(-8. * r) / r;
    fluence->SetValue(i, static_cast<float>(phi));
    flux->SetTuple3(i, phi * d[0] / r, phi * d[1] / r, phi * d[2] / r);
  }
  image->GetPointData()->AddArray(fluence);
  image->GetPointData()->AddArray(flux);
  return image;
}

struct View
{
  vtkNew<vtkRenderWindow> window;
  vtkNew<vtkRenderer> renderer;
  vtkNew<vtkVolume> volume;
  vtkSmartPointer<vtkGPUVolumeRayCastMapper> mapper;

  View(vtkSmartPointer<vtkGPUVolumeRayCastMapper> m, vtkImageData* image,
    vtkVolumeProperty* property, int pixels)
    : mapper(std::move(m))
  {
    this->mapper->SetInputData(image);
    this->mapper->AutoAdjustSampleDistancesOff();
    this->mapper->SetSampleDistance(static_cast<float>(image->GetSpacing()[0]));
    this->volume->SetMapper(this->mapper);
    this->volume->SetProperty(property);
    this->renderer->AddVolume(this->volume);
    this->window->SetSize(pixels, pixels);
    this->window->AddRenderer(this->renderer);
    this->window->SetMultiSamples(0);
    this->renderer->ResetCamera();
    this->renderer->GetActiveCamera()->Azimuth(30.);
    this->renderer->GetActiveCamera()->Elevation(20.);
    this->renderer->GetActiveCamera()->Zoom(1.6);
    this->renderer->ResetCameraClippingRange();
  }

  double processorSeconds = 0.; // of the last frame, all threads

  double milliseconds()
  {
    const std::clock_t processorBegin = std::clock();
    const auto begin = std::chrono::steady_clock::now();
    this->window->Render();
    // Reading a pixel waits for the GPU.
    vtkNew<vtkUnsignedCharArray> pixel;
    this->window->GetPixelData(0, 0, 0, 0, 0, pixel);
    const double wall =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    this->processorSeconds = static_cast<double>(std::clock() - processorBegin) / CLOCKS_PER_SEC;
    return wall;
  }
};

double median(std::vector<double> values)
{
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}
} // namespace

int main(int argc, char* argv[])
{
  int n = 128;
  int pixels = 512;
  int frames = 5;
  int onlyMode = -1;
  for (int i = 1; i + 1 < argc; i += 2)
  {
    const std::string option = argv[i];
    const int value = std::atoi(argv[i + 1]);
    (option == "-n" ? n : option == "-w" ? pixels : option == "-f" ? frames : onlyMode) = value;
  }
  if (!canRender())
  {
    return Suite::skipped();
  }

  auto image = makeVolume(n);
  auto light = makeLight(image);
  vtkNew<vtkColorTransferFunction> color;
  color->AddRGBPoint(0., 0., 0., 0.);
  color->AddRGBPoint(255., 1., .9, .8);
  vtkNew<vtkPiecewiseFunction> opacity;
  opacity->AddPoint(0., 0.);
  opacity->AddPoint(255., .15); // rays go all the way through, with light or not
  vtkNew<vtkVolumeProperty> property;
  property->SetColor(color);
  property->SetScalarOpacity(opacity);
  property->SetScalarOpacityUnitDistance(.1);
  property->SetInterpolationTypeToLinear();

  auto lit = vtkSmartPointer<vtkLightTransportVolumeMapper>::New();
  lit->SetLightFieldData(light);
  View stockView(vtkSmartPointer<vtkOpenGLGPUVolumeRayCastMapper>::New(), image, property, pixels);
  View litView(lit, image, property, pixels);

  stockView.milliseconds();
  std::printf("%d^3 points, %d^2 pixels, median of %d frames, %s\n\n", n, pixels, frames,
    reinterpret_cast<const char*>(glGetString(GL_RENDERER)));
  std::printf(
    "| mode | shaded | stock ms | lit ms | lit / stock | processor |\n|---|---|---|---|---|---|\n");
  for (const bool shade : { false, true })
  {
    property->SetShade(shade);
    for (int mode = vtkLightFieldProperty::Overlay; mode <= vtkLightFieldProperty::FluxDirection;
         ++mode)
    {
      if (onlyMode >= 0 && mode != onlyMode)
      {
        continue;
      }
      lit->GetLightFieldProperty()->SetMode(mode);
      // The first frames compile and upload.
      stockView.milliseconds();
      litView.milliseconds();
      std::vector<double> stockTimes;
      std::vector<double> litTimes;
      std::vector<double> ratios;
      std::vector<double> processorRatios;
      for (int f = 0; f < frames; ++f)
      {
        stockTimes.push_back(stockView.milliseconds());
        litTimes.push_back(litView.milliseconds());
        ratios.push_back(litTimes.back() / stockTimes.back());
        processorRatios.push_back(litView.processorSeconds / stockView.processorSeconds);
      }
      std::printf("| %s | %s | %.0f | %.0f | %.2f | %.2f |\n",
        lit->GetLightFieldProperty()->GetModeAsString(), shade ? "yes" : "no", median(stockTimes),
        median(litTimes), median(ratios), median(processorRatios));
      std::fflush(stdout);
    }
  }
  return 0;
}
