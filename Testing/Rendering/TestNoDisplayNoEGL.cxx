// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * With neither X nor EGL a program goes on: one error per window that says why,
 * black pixels, no abort. EGL is taken away by pointing its loader at a driver
 * list that does not exist, before EGL is first called.
 */
#include "LightTransportRenderingTesting.h"

#include "vtkActor.h"
#include "vtkPolyDataMapper.h"
#include "vtkRenderWindowInteractor.h"
#include "vtkRenderer.h"
#include "vtkSphereSource.h"
#include "vtkTestErrorObserver.h"
#include "vtkWindowToImageFilter.h"

using namespace lighttransport::testing;

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  unsetenv("DISPLAY");
  setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent", 1);
  LT_CHECK(suite, vtkLightTransportEGLRenderWindow::UseIfHeadless());
  LT_CHECK(suite, !vtkLightTransportEGLRenderWindow::IsAvailable());
  const std::string reason = vtkLightTransportEGLRenderWindow::GetReasonUnavailable();
  LT_CHECK(suite, reason.find("EGL") != std::string::npos);
  LT_CHECK(suite, !canRender());

  vtkNew<vtkSphereSource> sphere;
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(sphere->GetOutputPort());
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  vtkNew<vtkRenderer> renderer;
  renderer->SetBackground(1., 1., 1.);
  renderer->AddActor(actor);
  vtkNew<vtkTest::ErrorObserver> errors;
  {
    vtkNew<vtkRenderWindow> window;
    window->AddObserver(vtkCommand::ErrorEvent, errors);
    window->SetSize(40, 30);
    window->AddRenderer(renderer);
    window->Render();
    LT_CHECK(suite, errors->GetError());
    LT_CHECK(suite, errors->GetErrorMessage().find(reason) != std::string::npos);
    LT_CHECK(suite, errors->GetErrorMessage().find("Expected:") != std::string::npos);

    errors->Clear();

    // Whatever a program does next neither crashes nor repeats the message.
    window->Render();
    const Color mean = regionMean(capture(window), 0, 0, 39, 29);
    LT_CHECK(suite, mean[0] == 0. && mean[1] == 0. && mean[2] == 0.);
    vtkNew<vtkWindowToImageFilter> grab;
    grab->SetInput(window);
    grab->Update();
    LT_CHECK(suite, grab->GetOutput()->GetNumberOfPoints() == 40 * 30);
    vtkNew<vtkRenderWindowInteractor> interactor;
    interactor->SetRenderWindow(window);
    interactor->Initialize();
    interactor->Start();
    window->SetSize(10, 10);
    window->WaitForCompletion();
    LT_CHECK(suite, window->GetZbufferDataAtPoint(1, 1) == 0.f);
    std::array<unsigned char, 12> pixels = {};
    window->SetPixelData(0, 0, 1, 1, pixels.data(), 1);
    window->Frame();
    LT_CHECK(suite, window->SupportsOpenGL() == 0);
    LT_CHECK(suite, std::string(window->ReportCapabilities()) == "no OpenGL");
    window->Finalize();
    LT_CHECK(suite, !errors->GetError());
  }
  return suite.result();
}
