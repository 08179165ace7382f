// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightTransportCompat.h"
// The line above and the next must come before any other OpenGL header.
#include LIGHTTRANSPORT_GL_HEADER

#include "vtkLightTransportEGLRenderWindow.h"

#include "vtkGenericRenderWindowInteractor.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkRect.h"
#include "vtkRenderer.h"
#include "vtkRendererCollection.h"
#include "vtkVersion.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <sstream>
#include <vector>

#ifdef LIGHTTRANSPORT_HAS_EGL
#define EGL_NO_X11
#include <EGL/egl.h>
#include <EGL/eglext.h>
#endif

#ifdef LIGHTTRANSPORT_HAS_EGL
namespace
{
bool HasWord(const char* words, const char* word)
{
  const std::string all = words ? std::string(" ") + words + " " : std::string();
  return all.find(std::string(" ") + word + " ") != std::string::npos;
}

std::string ErrorName(EGLint error)
{
  switch (error)
  {
    case EGL_SUCCESS:
      return "no error code";
    case EGL_NOT_INITIALIZED:
      return "EGL_NOT_INITIALIZED";
    case EGL_BAD_ALLOC:
      return "EGL_BAD_ALLOC";
    case EGL_BAD_ATTRIBUTE:
      return "EGL_BAD_ATTRIBUTE";
    case EGL_BAD_CONFIG:
      return "EGL_BAD_CONFIG";
    case EGL_BAD_MATCH:
      return "EGL_BAD_MATCH";
    case EGL_BAD_PARAMETER:
      return "EGL_BAD_PARAMETER";
    case EGL_BAD_ACCESS:
      return "EGL_BAD_ACCESS";
    default:
      break;
  }
  std::ostringstream text;
  text << "EGL error 0x" << std::hex << error;
  return text.str();
}

std::vector<EGLDeviceEXT> Devices()
{
  const char* extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  const auto queryDevices =
    reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
  const bool canEnumerate =
    HasWord(extensions, "EGL_EXT_device_enumeration") || HasWord(extensions, "EGL_EXT_device_base");
  EGLint count = 0;
  if (!canEnumerate || !queryDevices || !queryDevices(0, nullptr, &count) || count < 1)
  {
    return {};
  }
  std::vector<EGLDeviceEXT> devices(count);
  queryDevices(count, devices.data(), &count);
  devices.resize(count);
  return devices;
}

/** What was current in this thread before; current again at the end of the scope. */
class CurrentContextKeeper
{
public:
  CurrentContextKeeper() = default;
  ~CurrentContextKeeper()
  {
    if (this->Context != EGL_NO_CONTEXT)
    {
      eglMakeCurrent(this->Display, this->Draw, this->Read, this->Context);
    }
  }
  CurrentContextKeeper(const CurrentContextKeeper&) = delete;
  void operator=(const CurrentContextKeeper&) = delete;

private:
  EGLContext Context = eglGetCurrentContext();
  EGLDisplay Display = eglGetCurrentDisplay();
  EGLSurface Draw = eglGetCurrentSurface(EGL_DRAW);
  EGLSurface Read = eglGetCurrentSurface(EGL_READ);
};

/**
 * An EGL display on which contexts can be made, with how. Shared by all windows
 * of the same device index, kept until the process ends.
 */
class Platform
{
public:
  /** Tries once per device index, and remembers failures as well. */
  static const Platform& Get(int deviceIndex)
  {
    static std::mutex mutex;
    static std::map<int, Platform> platforms;
    const std::lock_guard<std::mutex> lock(mutex);
    const auto found = platforms.find(deviceIndex);
    if (found != platforms.end())
    {
      return found->second;
    }
    Platform& platform = platforms[deviceIndex];
    platform.Find(deviceIndex);
    return platform;
  }

  bool IsUsable() const { return this->Display != EGL_NO_DISPLAY; }
  const std::string& GetReason() const { return this->Reason; }
  const std::string& GetName() const { return this->Name; }
  EGLDisplay GetDisplay() const { return this->Display; }

  /** False, and nothing to destroy, where it fails; the context is current where not. */
  bool CreateContext(EGLContext& context, EGLSurface& surface) const
  {
    const EGLint version[] = { EGL_CONTEXT_MAJOR_VERSION, this->Major, EGL_CONTEXT_MINOR_VERSION,
      this->Minor, EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE };
    surface = EGL_NO_SURFACE;
    eglBindAPI(EGL_OPENGL_API);
    context = eglCreateContext(this->Display, this->Config, EGL_NO_CONTEXT, version);
    if (context == EGL_NO_CONTEXT)
    {
      return false;
    }
    if (!this->Surfaceless)
    {
      const EGLint size[] = { EGL_WIDTH, 1, EGL_HEIGHT, 1, EGL_NONE };
      surface = eglCreatePbufferSurface(this->Display, this->Config, size);
    }
    if ((this->Surfaceless || surface != EGL_NO_SURFACE) &&
      eglMakeCurrent(this->Display, surface, surface, context))
    {
      return true;
    }
    this->DestroyContext(context, surface);
    return false;
  }

  void DestroyContext(EGLContext& context, EGLSurface& surface) const
  {
    eglBindAPI(EGL_OPENGL_API);
    if (eglGetCurrentContext() == context)
    {
      eglMakeCurrent(this->Display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    }
    if (surface != EGL_NO_SURFACE)
    {
      eglDestroySurface(this->Display, surface);
      surface = EGL_NO_SURFACE;
    }
    eglDestroyContext(this->Display, context);
    context = EGL_NO_CONTEXT;
  }

private:
  /** Stage 1: displays in the order of preference. */
  void Find(int deviceIndex)
  {
    const CurrentContextKeeper keeper;
    const char* extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    const auto getPlatformDisplay = reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(
      eglGetProcAddress("eglGetPlatformDisplayEXT"));
    std::ostringstream tried;
    if (getPlatformDisplay && HasWord(extensions, "EGL_EXT_platform_device"))
    {
      const std::vector<EGLDeviceEXT> devices = Devices();
      for (std::size_t i = deviceIndex < 0 ? 0 : deviceIndex; i < devices.size(); ++i)
      {
        const std::string name = "device " + std::to_string(i);
        if (this->Try(
              getPlatformDisplay(EGL_PLATFORM_DEVICE_EXT, devices[i], nullptr), name, tried))
        {
          return;
        }
      }
    }
    if (getPlatformDisplay && HasWord(extensions, "EGL_MESA_platform_surfaceless") &&
      this->Try(getPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr),
        "surfaceless", tried))
    {
      return;
    }
    if (this->Try(eglGetDisplay(EGL_DEFAULT_DISPLAY), "default display", tried))
    {
      return;
    }
    this->Reason = "EGL was tried on: " + tried.str();
  }

  /** Stage 2: a context of the highest version that the display gives. */
  bool Try(EGLDisplay display, const std::string& name, std::ostringstream& tried)
  {
    tried << (tried.str().empty() ? "" : "; ") << name << " (";
    EGLint major = 0;
    EGLint minor = 0;
    if (display == EGL_NO_DISPLAY || !eglInitialize(display, &major, &minor))
    {
      tried << "not there, " << ErrorName(eglGetError()) << ")";
      return false;
    }
    if (!eglBindAPI(EGL_OPENGL_API))
    {
      tried << "has no desktop OpenGL)";
      return false;
    }
    const char* extensions = eglQueryString(display, EGL_EXTENSIONS);
    this->Surfaceless = HasWord(extensions, "EGL_KHR_surfaceless_context");
    const EGLint surfaceType = this->Surfaceless ? 0 : EGL_PBUFFER_BIT;
    const EGLint wanted[] = { EGL_SURFACE_TYPE, surfaceType, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT,
      EGL_RED_SIZE, 8, EGL_GREEN_SIZE, 8, EGL_BLUE_SIZE, 8, EGL_ALPHA_SIZE, 8, EGL_NONE };
    EGLint count = 0;
    if (!eglChooseConfig(display, wanted, &this->Config, 1, &count) || count < 1)
    {
      tried << "has no 8-bit RGBA configuration)";
      return false;
    }
    const int versions[][2] = { { 4, 6 }, { 4, 5 }, { 4, 3 }, { 3, 3 }, { 3, 2 } };
    this->Display = display;
    for (const auto& version : versions)
    {
      this->Major = version[0];
      this->Minor = version[1];
      EGLContext context;
      EGLSurface surface;
      if (this->CreateContext(context, surface))
      {
        this->DestroyContext(context, surface);
        this->Name = name;
        return true;
      }
    }
    this->Display = EGL_NO_DISPLAY;
    tried << "gives no core OpenGL 3.2 or later, " << ErrorName(eglGetError()) << ")";
    return false;
  }

  EGLDisplay Display = EGL_NO_DISPLAY;
  EGLConfig Config = nullptr;
  EGLint Major = 0;
  EGLint Minor = 0;
  bool Surfaceless = false;
  std::string Name;
  std::string Reason;
};
} // namespace

/** The window's context. */
class vtkLightTransportEGLRenderWindow::vtkInternals
{
public:
  bool ErrorReported = false;
  std::string Reason;
  std::string PlatformName;

  static std::string WhyUnavailable() { return Platform::Get(0).GetReason(); }
  static int CountDevices() { return static_cast<int>(Devices().size()); }

  bool HasContext() const { return this->Context != EGL_NO_CONTEXT; }
  void* GetContext() const { return this->Context; }

  void Create(int deviceIndex)
  {
    this->Used = &Platform::Get(deviceIndex);
    this->PlatformName = this->Used->GetName();
    if (!this->Used->IsUsable())
    {
      this->Reason = this->Used->GetReason();
    }
    else if (!this->Used->CreateContext(this->Context, this->Surface))
    {
      this->Reason = "eglCreateContext failed: " + ErrorName(eglGetError());
    }
  }
  void Destroy()
  {
    if (this->HasContext())
    {
      this->Used->DestroyContext(this->Context, this->Surface);
    }
  }
  bool IsCurrent() const { return this->HasContext() && eglGetCurrentContext() == this->Context; }
  void MakeCurrent()
  {
    if (this->HasContext() && !this->IsCurrent())
    {
      eglBindAPI(EGL_OPENGL_API);
      eglMakeCurrent(this->Used->GetDisplay(), this->Surface, this->Surface, this->Context);
    }
  }
  void ReleaseCurrent()
  {
    if (this->IsCurrent())
    {
      eglMakeCurrent(this->Used->GetDisplay(), EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    }
  }
  void Push() { this->Stack.emplace_back(new CurrentContextKeeper); }
  void Pop()
  {
    if (!this->Stack.empty())
    {
      this->Stack.pop_back();
    }
  }

private:
  const Platform* Used = nullptr;
  EGLContext Context = EGL_NO_CONTEXT;
  EGLSurface Surface = EGL_NO_SURFACE;
  std::vector<std::unique_ptr<CurrentContextKeeper>> Stack;
};

#else // no EGL when this library was built: every window is one without a context

class vtkLightTransportEGLRenderWindow::vtkInternals
{
public:
  bool ErrorReported = false;
  std::string Reason = WhyUnavailable();
  std::string PlatformName;

  static std::string WhyUnavailable() { return "LightTransport was built without EGL"; }
  static int CountDevices() { return 0; }
  bool HasContext() const { return false; }
  void* GetContext() const { return nullptr; }
  void Create(int) {}
  void Destroy() {}
  bool IsCurrent() const { return false; }
  void MakeCurrent() {}
  void ReleaseCurrent() {}
  void Push() {}
  void Pop() {}
};
#endif

//------------------------------------------------------------------------------
namespace
{
VTK_CREATE_CREATE_FUNCTION(vtkLightTransportEGLRenderWindow)
VTK_CREATE_CREATE_FUNCTION(vtkGenericRenderWindowInteractor)

/** Gives the classes below in place of VTK's X ones, while it is registered. */
class vtkHeadlessFactory : public vtkObjectFactory
{
public:
  static vtkHeadlessFactory* New();
  vtkTypeMacro(vtkHeadlessFactory, vtkObjectFactory);
  const char* GetVTKSourceVersion() LIGHTTRANSPORT_FACTORY_CONST override
  {
    return VTK_SOURCE_VERSION;
  }
  const char* GetDescription() LIGHTTRANSPORT_FACTORY_CONST override
  {
    return "LightTransport: windows without a display";
  }

protected:
  vtkHeadlessFactory()
  {
    this->RegisterOverride("vtkRenderWindow", "vtkLightTransportEGLRenderWindow", "EGL window", 1,
      vtkObjectFactoryCreatevtkLightTransportEGLRenderWindow);
    this->RegisterOverride("vtkRenderWindowInteractor", "vtkGenericRenderWindowInteractor",
      "interactor without events of its own", 1,
      vtkObjectFactoryCreatevtkGenericRenderWindowInteractor);
  }
};
vtkStandardNewMacro(vtkHeadlessFactory);

/** The registered factory; VTK's list owns it. */
vtkHeadlessFactory* TheFactory = nullptr;

void EnableOtherFactories(bool enable)
{
  vtkObjectFactory::GetRegisteredFactories(); // SetAllEnableFlags needs the list to exist
  vtkObjectFactory::SetAllEnableFlags(enable, "vtkRenderWindow");
  vtkObjectFactory::SetAllEnableFlags(enable, "vtkRenderWindowInteractor");
}
} // namespace

vtkStandardNewMacro(vtkLightTransportEGLRenderWindow);

//------------------------------------------------------------------------------
bool vtkLightTransportEGLRenderWindow::UseIfHeadless()
{
#if !defined(_WIN32) && !defined(__APPLE__) // there VTK's windows need no X
  const char* display = std::getenv("DISPLAY");
  if (!display || !*display)
  {
    return vtkLightTransportEGLRenderWindow::UseForAllWindows();
  }
#endif
  return TheFactory != nullptr;
}

//------------------------------------------------------------------------------
bool vtkLightTransportEGLRenderWindow::UseForAllWindows()
{
  if (!TheFactory)
  {
    // The first enabled factory wins: those registered before are disabled here,
    // those registered later come after ours.
    EnableOtherFactories(false);
    vtkNew<vtkHeadlessFactory> factory;
    vtkObjectFactory::RegisterFactory(factory);
    TheFactory = factory;
  }
  return true;
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::StopUsing()
{
  if (TheFactory)
  {
    vtkObjectFactory::UnRegisterFactory(TheFactory);
    TheFactory = nullptr;
    EnableOtherFactories(true);
  }
}

//------------------------------------------------------------------------------
bool vtkLightTransportEGLRenderWindow::IsAvailable()
{
  return vtkInternals::WhyUnavailable().empty();
}

//------------------------------------------------------------------------------
std::string vtkLightTransportEGLRenderWindow::GetReasonUnavailable()
{
  return vtkInternals::WhyUnavailable();
}

//------------------------------------------------------------------------------
vtkLightTransportEGLRenderWindow::vtkLightTransportEGLRenderWindow()
  : Internals(new vtkInternals)
{
  this->ShowWindow = false;
  this->UseOffScreenBuffers = true;
}

//------------------------------------------------------------------------------
vtkLightTransportEGLRenderWindow::~vtkLightTransportEGLRenderWindow()
{
  this->vtkLightTransportEGLRenderWindow::Finalize();
  vtkCollectionSimpleIterator it;
  this->Renderers->InitTraversal(it);
  while (vtkRenderer* renderer = this->Renderers->GetNextRenderer(it))
  {
    renderer->SetRenderWindow(nullptr);
  }
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::Initialize()
{
  if (this->Initialized)
  {
    return;
  }
  if (!this->Internals->HasContext())
  {
    this->CreateAWindow();
  }
  if (!this->Internals->HasContext())
  {
    if (!this->Internals->ErrorReported)
    {
      this->Internals->ErrorReported = true;
      vtkErrorMacro("No OpenGL without a display: "
        << this->Internals->Reason << ". Nothing is drawn. Expected: an EGL driver "
        << "(Debian: libegl1 and libgl1-mesa-dri), or an X server and its DISPLAY.");
    }
    return;
  }
  this->MakeCurrent();
  vtkCollectionSimpleIterator it;
  this->Renderers->InitTraversal(it);
  while (vtkRenderer* renderer = this->Renderers->GetNextRenderer(it))
  {
    renderer->SetRenderWindow(nullptr);
    renderer->SetRenderWindow(this);
  }
  this->OpenGLInit();
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::Finalize()
{
  this->DestroyWindow();
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::CreateAWindow()
{
  this->Internals->Create(this->DeviceIndex);
  this->OwnContext = 1;
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::DestroyWindow()
{
  if (this->Internals->HasContext())
  {
    this->MakeCurrent();
    this->ReleaseGraphicsResources(this);
    this->Internals->Destroy();
  }
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::OpenGLInitContext()
{
#if LIGHTTRANSPORT_VTK_AT_LEAST(9, 4)
  // glad loads through a function that it is given.
#ifdef LIGHTTRANSPORT_HAS_EGL
  this->SetOpenGLSymbolLoader(
    [](void*, const char* name) -> VTKOpenGLAPIProc { return eglGetProcAddress(name); }, nullptr);
#endif
  this->Superclass::OpenGLInitContext();
#else
  this->ContextCreationTime.Modified();
  if (this->Initialized)
  {
    return;
  }
  // glewInit loads OpenGL, then looks for GLX and returns 4
  // (GLEW_ERROR_NO_GLX_DISPLAY), for there is no X: all that VTK needs is loaded.
  const GLenum noGLXDisplay = 4;
  glewExperimental = GL_TRUE;
  const GLenum result = glewInit();
  this->GlewInitValid = result == GLEW_OK || result == noGLXDisplay;
  if (!this->GlewInitValid || !(GLEW_VERSION_3_2 || GLEW_VERSION_3_1))
  {
    vtkErrorMacro("OpenGL 3.2 could not be loaded on EGL's "
      << this->Internals->PlatformName << ": glewInit returned " << result << ", expected 0 or 4.");
    return;
  }
  this->Initialized = true;

  GLfloat range[2] = { 1.f, 1.f };
  glGetFloatv(
    this->LineSmoothing ? GL_SMOOTH_LINE_WIDTH_RANGE : GL_ALIASED_LINE_WIDTH_RANGE, range);
  this->MaximumHardwareLineWidth = range[1];
#endif
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::Render()
{
  this->Initialize();
  if (this->Initialized)
  {
    this->Superclass::Render();
  }
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::Start()
{
  this->Initialize();
  if (this->Initialized)
  {
    this->Superclass::Start();
  }
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::End()
{
  if (this->Initialized)
  {
    this->Superclass::End();
  }
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::Frame()
{
  if (this->Initialized)
  {
    this->MakeCurrent();
    this->Superclass::Frame();
  }
}

//------------------------------------------------------------------------------
int vtkLightTransportEGLRenderWindow::GetZbufferData(int x1, int y1, int x2, int y2, float* z)
{
  if (this->Initialized)
  {
    return this->Superclass::GetZbufferData(x1, y1, x2, y2, z);
  }
  const std::size_t pixels =
    static_cast<std::size_t>(std::abs(x2 - x1) + 1) * (std::abs(y2 - y1) + 1);
  std::fill_n(z, pixels, 0.f);
  return VTK_ERROR;
}

//------------------------------------------------------------------------------
int vtkLightTransportEGLRenderWindow::SetZbufferData(int x1, int y1, int x2, int y2, float* z)
{
  return this->Initialized ? this->Superclass::SetZbufferData(x1, y1, x2, y2, z) : VTK_ERROR;
}

//------------------------------------------------------------------------------
int vtkLightTransportEGLRenderWindow::SetPixelData(
  int x1, int y1, int x2, int y2, unsigned char* data, int front, int right)
{
  return this->Initialized ? this->Superclass::SetPixelData(x1, y1, x2, y2, data, front, right)
                           : VTK_ERROR;
}

//------------------------------------------------------------------------------
int vtkLightTransportEGLRenderWindow::SetRGBAPixelData(
  int x1, int y1, int x2, int y2, float* data, int front, int blend, int right)
{
  return this->Initialized
    ? this->Superclass::SetRGBAPixelData(x1, y1, x2, y2, data, front, blend, right)
    : VTK_ERROR;
}

//------------------------------------------------------------------------------
int vtkLightTransportEGLRenderWindow::SetRGBACharPixelData(
  int x1, int y1, int x2, int y2, unsigned char* data, int front, int blend, int right)
{
  return this->Initialized
    ? this->Superclass::SetRGBACharPixelData(x1, y1, x2, y2, data, front, blend, right)
    : VTK_ERROR;
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::WaitForCompletion()
{
  if (this->Initialized)
  {
    this->Superclass::WaitForCompletion();
  }
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::MakeCurrent()
{
  this->Internals->MakeCurrent();
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::ReleaseCurrent()
{
  this->Internals->ReleaseCurrent();
}

//------------------------------------------------------------------------------
bool vtkLightTransportEGLRenderWindow::IsCurrent()
{
  return this->Internals->IsCurrent();
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::PushContext()
{
  this->Internals->Push();
  this->MakeCurrent();
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::PopContext()
{
  this->Internals->Pop();
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::SetShowWindow(bool vtkNotUsed(show)) {}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::SetUseOffScreenBuffers(bool vtkNotUsed(use)) {}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::BlitDisplayFramebuffersToHardware() {}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::ReleaseGraphicsResources(vtkWindow* window)
{
  if (this->Initialized)
  {
    this->Superclass::ReleaseGraphicsResources(window);
  }
}

//------------------------------------------------------------------------------
int vtkLightTransportEGLRenderWindow::ReadPixels(
  const vtkRecti& rect, int front, int format, int type, void* data, int right)
{
  if (this->Initialized)
  {
    return this->Superclass::ReadPixels(rect, front, format, type, data, right);
  }
  const std::size_t components = format == GL_RGBA ? 4 : format == GL_RGB ? 3 : 1;
  const std::size_t bytes = type == GL_FLOAT ? sizeof(float) : 1;
  std::memset(data, 0, components * bytes * rect.GetWidth() * rect.GetHeight());
  return VTK_ERROR;
}

//------------------------------------------------------------------------------
int vtkLightTransportEGLRenderWindow::GetNumberOfDevices()
{
  return vtkInternals::CountDevices();
}

//------------------------------------------------------------------------------
const char* vtkLightTransportEGLRenderWindow::ReportCapabilities()
{
  this->Initialize();
  return this->Initialized ? this->Superclass::ReportCapabilities() : "no OpenGL";
}

//------------------------------------------------------------------------------
int vtkLightTransportEGLRenderWindow::SupportsOpenGL()
{
  if (!IsAvailable())
  {
    this->OpenGLSupportMessage = GetReasonUnavailable();
    return 0;
  }
  return this->Superclass::SupportsOpenGL();
}

//------------------------------------------------------------------------------
void* vtkLightTransportEGLRenderWindow::GetGenericContext()
{
  return this->Internals->GetContext();
}

//------------------------------------------------------------------------------
int* vtkLightTransportEGLRenderWindow::GetScreenSize()
{
  // No screen; what VTK's own EGL window answers.
  this->ScreenSize[0] = 1920;
  this->ScreenSize[1] = 1080;
  return this->ScreenSize;
}

//------------------------------------------------------------------------------
int vtkLightTransportEGLRenderWindow::GetColorBufferSizes(int* rgba)
{
  if (!rgba || !this->Initialized)
  {
    return 0;
  }
  std::fill(rgba, rgba + 4, 8);
  return 32;
}

//------------------------------------------------------------------------------
void vtkLightTransportEGLRenderWindow::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "EGL platform: "
     << (this->Internals->HasContext() ? this->Internals->PlatformName : "(no context)") << "\n";
}
