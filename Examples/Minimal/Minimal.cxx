// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A lamp inside a volume, from the data to the picture: Minimal [picture.png]
 */
#include "vtkLightDiffusionFilter.h"
#include "vtkLightSeedFilter.h"
#include "vtkLightTransportEGLRenderWindow.h"
#include "vtkLightTransportVolumeMapper.h"
#include "vtkOpticalMediumFilter.h"

#include "vtkColorTransferFunction.h"
#include "vtkNew.h"
#include "vtkPNGWriter.h"
#include "vtkPiecewiseFunction.h"
#include "vtkRTAnalyticSource.h"
#include "vtkRenderWindow.h"
#include "vtkRenderer.h"
#include "vtkVolume.h"
#include "vtkVolumeProperty.h"
#include "vtkWindowToImageFilter.h"

#include <iostream>

int main(int argc, char* argv[])
{
  vtkLightTransportEGLRenderWindow::UseIfHeadless(); // works without a screen, too

  vtkNew<vtkRTAnalyticSource> data; // any volume with scalars
  data->SetWholeExtent(-24, 24, -24, 24, -24, 24);

  vtkNew<vtkOpticalMediumFilter> medium; // edges of the data stop light
  medium->SetInputConnection(data->GetOutputPort());
  medium->SetReach(10.); // and in the open it fades by e over this length

  vtkNew<vtkLightSeedFilter> lamps; // centre, radius, power
  lamps->SetInputConnection(medium->GetOutputPort());
  lamps->AddSphere(0., 0., 0., 2., 1.);

  vtkNew<vtkLightDiffusionFilter> light; // the array "Fluence"
  light->SetInputConnection(lamps->GetOutputPort());

  vtkNew<vtkLightTransportVolumeMapper> mapper; // the volume with its light
  mapper->SetInputConnection(data->GetOutputPort());
  mapper->SetLightFieldConnection(light->GetOutputPort());

  vtkNew<vtkColorTransferFunction> color;
  color->AddRGBPoint(40., .1, .15, .2);
  color->AddRGBPoint(280., .8, .85, .9);
  vtkNew<vtkPiecewiseFunction> opacity;
  opacity->AddPoint(100., 0.);
  opacity->AddPoint(280., .05);
  vtkNew<vtkVolume> volume;
  volume->SetMapper(mapper);
  volume->GetProperty()->SetColor(color);
  volume->GetProperty()->SetScalarOpacity(opacity);

  vtkNew<vtkRenderer> renderer;
  renderer->AddVolume(volume);
  vtkNew<vtkRenderWindow> window;
  window->SetOffScreenRendering(1);
  window->SetSize(300, 300);
  window->AddRenderer(renderer);
  window->Render(); // solves, and would again after a change upstream

  if (argc > 1)
  {
    vtkNew<vtkWindowToImageFilter> grab;
    grab->SetInput(window);
    vtkNew<vtkPNGWriter> writer;
    writer->SetInputConnection(grab->GetOutputPort());
    writer->SetFileName(argv[1]);
    writer->Write();
  }
  std::cout << light->GetStopReasonAsString() << " after " << light->GetNumberOfIterationsUsed()
            << " iterations; power emitted " << light->GetEmittedPower() << ", absorbed "
            << light->GetAbsorbedPower() << ", escaped " << light->GetEscapedPower() << "\n";
  return light->GetStopReason() == vtkLightDiffusionFilter::Converged ? 0 : 1;
}
