// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A plain vtkRenderWindow draws without a display: colours at known places, size
 * changes, two windows, closing and reopening, contexts of several windows kept
 * apart, no OpenGL error.
 *
 * With -W FILE it only writes a picture to FILE, by X if there is a DISPLAY:
 * CompareWithXvfb.cmake compares the two.
 */
#include "LightTransportRenderingTesting.h"

#include "vtkActor.h"
#include "vtkCallbackCommand.h"
#include "vtkCamera.h"
#include "vtkGenericRenderWindowInteractor.h"
#include "vtkPlaneSource.h"
#include "vtkPolyDataMapper.h"
#include "vtkProperty.h"
#include "vtkRenderWindowInteractor.h"
#include "vtkRenderer.h"
#include "vtkSphereSource.h"
#include "vtkTextActor.h"
#include "vtkTextProperty.h"
#include "vtkWindowToImageFilter.h"

#include <thread>

using namespace lighttransport::testing;

namespace
{
/** An unlit square over the middle half of the view, in parallel projection. */
void addSquare(vtkRenderer* renderer, double r, double g, double b)
{
  vtkNew<vtkPlaneSource> plane; // from -.5 to .5 at z = 0
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(plane->GetOutputPort());
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  actor->GetProperty()->SetColor(r, g, b);
  actor->GetProperty()->LightingOff();
  renderer->AddActor(actor);
  vtkCamera* camera = renderer->GetActiveCamera();
  camera->ParallelProjectionOn();
  camera->SetParallelScale(1.);
  camera->SetPosition(0., 0., 5.);
  camera->SetClippingRange(1., 10.);
}

bool is(const Color& color, double r, double g, double b)
{
  return color[0] == r && color[1] == g && color[2] == b;
}

/** Red square on blue: the middle half is exactly red, the rest exactly blue. */
void checkSquare(Suite& suite, vtkImageData* picture)
{
  int d[3];
  picture->GetDimensions(d);
  const int half = d[1] / 4; // the square's half side in pixels
  const int cx = d[0] / 2;
  const int cy = d[1] / 2;
  LT_CHECK(suite,
    is(regionMean(picture, cx - half + 1, cy - half + 1, cx + half - 2, cy + half - 2), 255, 0, 0));
  LT_CHECK(suite, is(regionMean(picture, 0, 0, d[0] - 1, cy - half - 2), 0, 0, 255));
  LT_CHECK(suite, is(regionMean(picture, 0, cy + half + 1, d[0] - 1, d[1] - 1), 0, 0, 255));
  LT_CHECK(suite, is(regionMean(picture, 0, 0, cx - half - 2, d[1] - 1), 0, 0, 255));
  LT_CHECK(suite, is(regionMean(picture, cx + half + 1, 0, d[0] - 1, d[1] - 1), 0, 0, 255));
}

void testDrawing(Suite& suite)
{
  vtkNew<vtkRenderer> renderer;
  renderer->SetBackground(0., 0., 1.);
  addSquare(renderer, 1., 0., 0.);
  vtkNew<vtkRenderWindow> window;
  LT_CHECK(suite, window->IsA("vtkLightTransportEGLRenderWindow"));
  LT_CHECK(suite, window->SupportsOpenGL() == 1);
  window->SetSize(120, 80);
  window->AddRenderer(renderer);
  const Picture first = capture(window);
  checkSquare(suite, first);
  LT_CHECK(suite, openGLErrors().empty());

  // Other sizes, larger and smaller.
  for (const auto& size : { std::array<int, 2>{ 200, 160 }, std::array<int, 2>{ 40, 60 } })
  {
    window->SetSize(size[0], size[1]);
    const Picture picture = capture(window);
    int d[3];
    picture->GetDimensions(d);
    LT_CHECK(suite, d[0] == size[0] && d[1] == size[1]);
    checkSquare(suite, picture);
  }
  window->SetSize(120, 80);

  // Off-screen or not is one and the same here.
  window->SetOffScreenRendering(1);
  checkSquare(suite, capture(window));
  window->SetOffScreenRendering(0);
  checkSquare(suite, capture(window));
  window->SetShowWindow(true);
  LT_CHECK(suite, !window->GetShowWindow());
  LT_CHECK(suite, difference(capture(window), first).largest == 0.);
  LT_CHECK(suite, openGLErrors().empty());

  // VTK's own way to a picture, and depth.
  vtkNew<vtkWindowToImageFilter> grab;
  grab->SetInput(window);
  grab->Update();
  LT_CHECK(suite, difference(grab->GetOutput(), first).largest == 0.);
  LT_CHECK_NEAR(suite, window->GetZbufferDataAtPoint(60, 40), 4. / 9., 1e-5);
  LT_CHECK(suite, window->GetZbufferDataAtPoint(2, 2) == 1.f);

  // Closed and reopened, twice.
  for (int i = 0; i < 2; ++i)
  {
    window->Finalize();
    LT_CHECK(suite, difference(capture(window), first).largest == 0.);
  }
  LT_CHECK(suite, openGLErrors().empty());
}

void testTwoWindows(Suite& suite)
{
  vtkNew<vtkRenderer> rendererA;
  rendererA->SetBackground(0., 0., 1.);
  addSquare(rendererA, 1., 0., 0.);
  vtkNew<vtkRenderWindow> a;
  a->SetSize(100, 100);
  a->AddRenderer(rendererA);
  const Picture before = capture(a);
  {
    vtkNew<vtkRenderer> rendererB;
    rendererB->SetBackground(0., 1., 0.);
    vtkNew<vtkRenderWindow> b;
    b->SetSize(60, 60);
    b->AddRenderer(rendererB);
    LT_CHECK(suite, is(regionMean(capture(b), 0, 0, 59, 59), 0, 255, 0));
    LT_CHECK(suite, b->IsCurrent() && !a->IsCurrent());
    LT_CHECK(suite, difference(capture(a), before).largest == 0.);
    LT_CHECK(suite, a->IsCurrent() && !b->IsCurrent());
    LT_CHECK(suite, is(regionMean(capture(b), 0, 0, 59, 59), 0, 255, 0));
  }
  LT_CHECK(suite, difference(capture(a), before).largest == 0.);
  LT_CHECK(suite, openGLErrors().empty());

  // A renderer that moves to another window takes its props along.
  a->RemoveRenderer(rendererA);
  vtkNew<vtkRenderWindow> c;
  c->SetSize(100, 100);
  c->AddRenderer(rendererA);
  LT_CHECK(suite, difference(capture(c), before).largest == 0.);
}

/** A context released here may be used by another thread. */
void testThread(Suite& suite)
{
  vtkNew<vtkRenderer> renderer;
  renderer->SetBackground(0., 0., 1.);
  addSquare(renderer, 1., 0., 0.);
  vtkNew<vtkRenderWindow> window;
  window->SetSize(100, 100);
  window->AddRenderer(renderer);
  const Picture here = capture(window);
  window->ReleaseCurrent();
  LT_CHECK(suite, !window->IsCurrent());
  Picture there;
  std::thread other(
    [&]
    {
      there = capture(window);
      window->ReleaseCurrent();
    });
  other.join();
  LT_CHECK(suite, difference(here, there).largest == 0.);
}

void testInteractor(Suite& suite)
{
  vtkNew<vtkRenderer> renderer;
  vtkNew<vtkRenderWindow> window;
  window->SetSize(50, 50);
  window->AddRenderer(renderer);
  vtkNew<vtkRenderWindowInteractor> interactor;
  LT_CHECK(suite, interactor->IsA("vtkGenericRenderWindowInteractor"));
  interactor->SetRenderWindow(window);
  interactor->Initialize();
  interactor->Start(); // returns: there are no events to wait for
  LT_CHECK(suite, window->GetNeverRendered() == 0);
}

/** Twenty windows opened, drawn and closed: each frees its context. */
void testManyWindows(Suite& suite)
{
  for (int i = 0; i < 20; ++i)
  {
    vtkNew<vtkRenderer> renderer;
    renderer->SetBackground(0., 0., 1.);
    addSquare(renderer, 1., 0., 0.);
    vtkNew<vtkRenderWindow> window;
    window->SetSize(64, 64);
    window->AddRenderer(renderer);
    checkSquare(suite, capture(window));
  }
}

/** Without any renderer, before any rendering, and after StopUsing. */
void testCorners(Suite& suite)
{
  {
    vtkNew<vtkRenderWindow> window;
    unsigned char* pixels = window->GetPixelData(0, 0, 3, 3, 1); // before there is a context
    LT_CHECK(suite, std::all_of(pixels, pixels + 48, [](unsigned char p) { return p == 0; }));
    delete[] pixels;
    window->Finalize();
    window->Render(); // no renderer
    LT_CHECK(suite, window->GetSize()[0] == 300 && window->GetSize()[1] == 300);
    LT_CHECK(suite, std::string(window->ReportCapabilities()).find("OpenGL") == 0);
  }
  {
    vtkNew<vtkRenderWindow> window;
    window->SetDeviceIndex(99); // no such device: the next stage serves
    window->Render();
    LT_CHECK(suite, vtkLightTransportEGLRenderWindow::SafeDownCast(window)->GetGenericContext());
  }
  vtkLightTransportEGLRenderWindow::StopUsing();
  {
    vtkSmartPointer<vtkRenderWindow> window = vtkSmartPointer<vtkRenderWindow>::New();
    LT_CHECK(suite, !window->IsA("vtkLightTransportEGLRenderWindow"));
  }
  LT_CHECK(suite, vtkLightTransportEGLRenderWindow::UseForAllWindows());
  LT_CHECK(suite, vtkLightTransportEGLRenderWindow::UseIfHeadless());
}

/** Lights, text and lines: all that could differ from one window system to another. */
void writeScene(const std::string& path)
{
  vtkNew<vtkSphereSource> sphere;
  sphere->SetThetaResolution(32);
  sphere->SetPhiResolution(32);
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(sphere->GetOutputPort());
  vtkNew<vtkActor> actor;
  actor->SetMapper(mapper);
  actor->GetProperty()->SetColor(.9, .6, .2);
  actor->GetProperty()->SetSpecular(.5);
  actor->GetProperty()->EdgeVisibilityOn();
  vtkNew<vtkTextActor> text;
  text->SetInput("EGL = X");
  text->SetPosition(10, 10);
  text->GetTextProperty()->SetFontSize(20);
  vtkNew<vtkRenderer> renderer;
  renderer->SetBackground(.1, .2, .3);
  renderer->AddActor(actor);
  renderer->AddActor(text);
  vtkNew<vtkRenderWindow> window;
  window->SetSize(200, 200);
  window->AddRenderer(renderer);
  std::cout << window->GetClassName() << "\n";
  writePicture(capture(window), path);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  if (!canRender())
  {
    return Suite::skipped();
  }
  if (argc == 3 && std::string(argv[1]) == "-W")
  {
    writeScene(argv[2]);
    return 0;
  }
  // With a DISPLAY a plain window is VTK's own; the rest is tested headless.
  const char* display = std::getenv("DISPLAY");
  if (display && *display)
  {
    vtkNew<vtkRenderWindow> window;
    LT_CHECK(suite, !window->IsA("vtkLightTransportEGLRenderWindow"));
  }
  if (!vtkLightTransportEGLRenderWindow::IsAvailable())
  {
    return Suite::skipped();
  }
  vtkLightTransportEGLRenderWindow::UseForAllWindows();
  LT_CHECK(suite, vtkLightTransportEGLRenderWindow::GetReasonUnavailable().empty());
  testDrawing(suite);
  testTwoWindows(suite);
  testThread(suite);
  testInteractor(suite);
  testManyWindows(suite);
  testCorners(suite);
  return suite.result();
}
