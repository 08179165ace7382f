// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkLightTransportEGLRenderWindow
 * @brief   render window that needs no X server
 *
 * An off-screen OpenGL window made with EGL, on a GPU or on Mesa's llvmpipe. It
 * is for machines without a display, where VTK's X window aborts the program.
 * It is not for windows that a person should see.
 *
 * One call, before the first window is made,
 *
 *   vtkLightTransportEGLRenderWindow::UseIfHeadless();
 *
 * and from then on every plain vtkRenderWindow of the process is one of these
 * if DISPLAY is unset or empty; with a DISPLAY nothing changes. In Python
 * `import lighttransport` makes the call. Interactors made from then on are
 * vtkGenericRenderWindowInteractor, which needs no X either: events come from
 * the program, Start() returns at once.
 *
 * The stages, each tried in turn until one works:
 * 1. display: each EGL device from DeviceIndex on (EGL_EXT_platform_device),
 *    then surfaceless (EGL_MESA_platform_surfaceless), then the default display;
 * 2. context: OpenGL core 4.6, 4.5, 4.3, 3.3, 3.2, without a surface if the
 *    display allows it (EGL_KHR_surfaceless_context), else on a 1 x 1 pbuffer:
 *    VTK draws into framebuffer objects of its own anyway.
 *
 * Where no stage works (no EGL when this library was built, no EGL driver) the
 * window still exists: rendering reports one error that says why, draws
 * nothing, and every pixel read from it is 0. IsAvailable() tells beforehand.
 *
 * EGL displays are shared by the process and are never terminated, since
 * another library may be using the same one.
 */
#ifndef vtkLightTransportEGLRenderWindow_h
#define vtkLightTransportEGLRenderWindow_h

#include "vtkLightTransportRenderingModule.h" // for the export macro
#include "vtkOpenGLRenderWindow.h"

#include <memory> // for std::unique_ptr
#include <string> // for std::string

class VTKLIGHTTRANSPORTRENDERING_EXPORT vtkLightTransportEGLRenderWindow
  : public vtkOpenGLRenderWindow
{
public:
  static vtkLightTransportEGLRenderWindow* New();
  vtkTypeMacro(vtkLightTransportEGLRenderWindow, vtkOpenGLRenderWindow);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * Make every vtkRenderWindow created from now on a window of this class: if
   * there is no DISPLAY, or always. Returns whether it is so. Cheap, and
   * harmless to repeat; touches no EGL.
   */
  static bool UseIfHeadless();
  static bool UseForAllWindows();
  ///@}

  /**
   * Undo UseIfHeadless() or UseForAllWindows() for windows created from now on.
   */
  static void StopUsing();

  /**
   * Whether an EGL context can be made on this machine. The first call tries.
   */
  static bool IsAvailable();

  /**
   * Why IsAvailable() is false, with what was tried; empty if it is true.
   */
  static std::string GetReasonUnavailable();

  ///@{
  /**
   * The window's life. Initialize() makes the context current and loads OpenGL;
   * Finalize() releases the graphics resources and destroys the context. Either
   * may be called repeatedly; rendering after Finalize() makes a new context.
   */
  void Initialize() override;
  void Finalize() override;
  ///@}

  ///@{
  /**
   * Drawing; without a context the first of these reports why, once per window,
   * and all of them do nothing.
   */
  void Render() override;
  void Start() override;
  void End() override;
  void Frame() override;
  ///@}

  ///@{
  /**
   * Pixels and depth; without a context all that is read is 0, and nothing is
   * written.
   */
  using vtkOpenGLRenderWindow::GetZbufferData;
  using vtkOpenGLRenderWindow::SetPixelData;
  using vtkOpenGLRenderWindow::SetRGBACharPixelData;
  using vtkOpenGLRenderWindow::SetRGBAPixelData;
  using vtkOpenGLRenderWindow::SetZbufferData;
  int GetZbufferData(int x1, int y1, int x2, int y2, float* z) override;
  int SetZbufferData(int x1, int y1, int x2, int y2, float* z) override;
  int SetPixelData(
    int x1, int y1, int x2, int y2, unsigned char* data, int front, int right) override;
  int SetRGBAPixelData(
    int x1, int y1, int x2, int y2, float* data, int front, int blend, int right) override;
  int SetRGBACharPixelData(
    int x1, int y1, int x2, int y2, unsigned char* data, int front, int blend, int right) override;
  ///@}

  ///@{
  /**
   * Making the context current or not in the calling thread.
   */
  void MakeCurrent() override;
  void ReleaseCurrent() override;
  bool IsCurrent() override;
  void PushContext() override;
  void PopContext() override;
  ///@}

  ///@{
  /**
   * There is no screen: setting these has no effect, the window stays hidden
   * and off-screen.
   */
  void SetShowWindow(bool show) override;
  void SetUseOffScreenBuffers(bool use) override;
  ///@}

  void ReleaseGraphicsResources(vtkWindow* window) override;
  int GetNumberOfDevices() override;
  const char* ReportCapabilities() override;
  int SupportsOpenGL() override;
  void* GetGenericContext() override;
  int* GetScreenSize() VTK_SIZEHINT(2) override;
  /** Of the buffers that are rendered to; there is no other. vtkHardwareSelector asks. */
  int GetColorBufferSizes(int* rgba) override;
  void WaitForCompletion() override;

protected:
  vtkLightTransportEGLRenderWindow();
  ~vtkLightTransportEGLRenderWindow() override;

  void OpenGLInitContext() override;
  void CreateAWindow() override;
  void DestroyWindow() override;
  int ReadPixels(
    const vtkRecti& rect, int front, int format, int type, void* data, int right) override;
  void BlitDisplayFramebuffersToHardware() override;

private:
  vtkLightTransportEGLRenderWindow(const vtkLightTransportEGLRenderWindow&) = delete;
  void operator=(const vtkLightTransportEGLRenderWindow&) = delete;

  class vtkInternals;
  std::unique_ptr<vtkInternals> Internals;
};

#endif
