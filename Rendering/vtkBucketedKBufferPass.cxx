// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBucketedKBufferPass.h"

#include "vtkBucketedKBufferBlend.h"
#include "vtkBucketedKBufferData.h"
#include "vtkBucketedKBufferList.h"
#include "vtkBucketedKBufferRead.h"
#include "vtkBucketedKBufferStore.h"
#include "vtkLightTransportCompat.h"

#include "vtkDualDepthPeelingPass.h"
#include "vtkInformation.h"
#include "vtkInformationIntegerKey.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkOpenGLActor.h"
#include "vtkOpenGLError.h"
#include "vtkOpenGLFramebufferObject.h"
#include "vtkOpenGLQuadHelper.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkOpenGLRenderer.h"
#include "vtkOpenGLShaderCache.h"
#include "vtkOpenGLState.h"
#include "vtkProp.h"
#include "vtkProperty.h"
#include "vtkRenderState.h"
#include "vtkRenderStepsPass.h"
#include "vtkRenderer.h"
#include "vtkShaderProgram.h"
#include "vtkSmartPointer.h"
#include "vtkTextureObject.h"
#include "vtkTextureUnitManager.h"
#include "vtkTranslucentPass.h"
#include "vtkVersion.h"
#include "vtkWeakPointer.h"

// GLEW or glad, by VTK's version.
#include LIGHTTRANSPORT_GL_HEADER

#include <algorithm>
#include <array>
#include <string>
#include <unordered_map>
#include <vector>

namespace
{
/** VTK writes #version 150, until 9.6 at least; all of these are part of OpenGL 4.3. */
const char* const Extensions = "#extension GL_ARB_shader_storage_buffer_object : require\n"
                               "#extension GL_ARB_shading_language_420pack : require\n"
                               "#extension GL_ARB_shading_language_packing : require\n"
                               "#extension GL_ARB_shader_bit_encoding : require\n";

constexpr GLuint EndOfList = 0xFFFFFFFFU;

/** A shader storage buffer and where it is bound; see vtkBucketedKBufferData.glsl. */
class StorageBuffer
{
public:
  explicit StorageBuffer(GLuint binding)
    : Binding(binding)
  {
  }
  StorageBuffer(const StorageBuffer&) = delete;
  StorageBuffer& operator=(const StorageBuffer&) = delete;

  /** At least so many bytes; what was in it is lost where it grows. */
  void Reserve(vtkTypeInt64 bytes)
  {
    if (this->Id == 0)
    {
      glGenBuffers(1, &this->Id);
    }
    if (this->Bytes < bytes)
    {
      glBindBuffer(GL_SHADER_STORAGE_BUFFER, this->Id);
      glBufferData(
        GL_SHADER_STORAGE_BUFFER, static_cast<GLsizeiptr>(bytes), nullptr, GL_DYNAMIC_COPY);
      this->Bytes = bytes;
    }
  }
  /** As a texture buffer, on a texture unit. */
  void BindTexture(vtkOpenGLState* state, int unit, GLenum format)
  {
    if (this->Texture == 0)
    {
      glGenTextures(1, &this->Texture);
    }
    state->vtkglActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
    glBindTexture(GL_TEXTURE_BUFFER, this->Texture);
    glTexBuffer(GL_TEXTURE_BUFFER, format, this->Id);
  }
  void Bind() const { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, this->Binding, this->Id); }
  void Unbind() const { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, this->Binding, 0); }
  void Fill(vtkTypeInt64 offset, vtkTypeInt64 bytes, GLuint value) const
  {
    glBindBuffer(GL_SHADER_STORAGE_BUFFER, this->Id);
    glClearBufferSubData(GL_SHADER_STORAGE_BUFFER, GL_R32UI, static_cast<GLintptr>(offset),
      static_cast<GLsizeiptr>(bytes), GL_RED_INTEGER, GL_UNSIGNED_INT, &value);
  }
  GLuint Read(int index) const
  {
    GLuint value = 0;
    glBindBuffer(GL_SHADER_STORAGE_BUFFER, this->Id);
    glGetBufferSubData(
      GL_SHADER_STORAGE_BUFFER, index * GLintptr(sizeof(GLuint)), sizeof(GLuint), &value);
    return value;
  }
  void Release()
  {
    if (this->Id != 0)
    {
      glDeleteBuffers(1, &this->Id);
    }
    if (this->Texture != 0)
    {
      glDeleteTextures(1, &this->Texture);
    }
    this->Id = 0;
    this->Texture = 0;
    this->Bytes = 0;
  }

  vtkTypeInt64 Bytes = 0;

private:
  GLuint Binding;
  GLuint Id = 0;
  GLuint Texture = 0;
};

enum Counters
{
  NodesAsked = 0,
  FragmentsListed = 1,
  FragmentsMerged = 2,
  NumberOfCounters = 4
};

//------------------------------------------------------------------------------
/** The depth of what is bound for reading, as a format that it can be copied to. */
bool readsStencilToo()
{
  GLint stencil = 0;
  GLint type = 0;
  GLint object = 0;
  glGetIntegerv(GL_READ_FRAMEBUFFER_BINDING, &object);
  const GLenum attachment = object == 0 ? GL_STENCIL : GL_STENCIL_ATTACHMENT;
  glGetFramebufferAttachmentParameteriv(
    GL_READ_FRAMEBUFFER, attachment, GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE, &type);
  if (type != GL_NONE)
  {
    glGetFramebufferAttachmentParameteriv(
      GL_READ_FRAMEBUFFER, attachment, GL_FRAMEBUFFER_ATTACHMENT_STENCIL_SIZE, &stencil);
  }
  return stencil > 0;
}

//------------------------------------------------------------------------------
/** vtkTextureObject's name for the depth that is bound for reading; -1: there is none. */
int depthFormatRead()
{
  GLint object = 0;
  GLint type = 0;
  glGetIntegerv(GL_READ_FRAMEBUFFER_BINDING, &object);
  const GLenum attachment = object == 0 ? GL_DEPTH : GL_DEPTH_ATTACHMENT;
  glGetFramebufferAttachmentParameteriv(
    GL_READ_FRAMEBUFFER, attachment, GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE, &type);
  if (type == GL_NONE)
  {
    return -1;
  }
  GLint bits = 0;
  GLint component = 0;
  glGetFramebufferAttachmentParameteriv(
    GL_READ_FRAMEBUFFER, attachment, GL_FRAMEBUFFER_ATTACHMENT_DEPTH_SIZE, &bits);
  glGetFramebufferAttachmentParameteriv(
    GL_READ_FRAMEBUFFER, attachment, GL_FRAMEBUFFER_ATTACHMENT_COMPONENT_TYPE, &component);
  if (component == GL_FLOAT)
  {
    return vtkTextureObject::Float32;
  }
  return bits <= 16 ? vtkTextureObject::Fixed16
                    : (bits <= 24 ? vtkTextureObject::Fixed24 : vtkTextureObject::Fixed32);
}

//------------------------------------------------------------------------------
/** What the picture is drawn into. */
struct Target
{
  bool clamps = true; // holds colours in [0,1]
  bool plain = false; // 8 bits, one sample, linear: blended in the shader, rounded once
};

Target targetBound()
{
  Target target;
  GLint object = 0;
  GLint buffer = 0;
  glGetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &object);
  glGetIntegerv(GL_DRAW_BUFFER0, &buffer);
  if (object == 0 || buffer < GL_COLOR_ATTACHMENT0 || buffer > GL_COLOR_ATTACHMENT0 + 15)
  {
    return target;
  }
  const auto attachment = static_cast<GLenum>(buffer);
  const auto ask = [attachment](GLenum what)
  {
    GLint value = 0;
    glGetFramebufferAttachmentParameteriv(GL_DRAW_FRAMEBUFFER, attachment, what, &value);
    return value;
  };
  if (ask(GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) == GL_NONE)
  {
    return target;
  }
  GLint samples = 0;
  GLint readObject = 0;
  glGetIntegerv(GL_SAMPLE_BUFFERS, &samples);
  glGetIntegerv(GL_READ_FRAMEBUFFER_BINDING, &readObject);
  target.clamps = ask(GL_FRAMEBUFFER_ATTACHMENT_COMPONENT_TYPE) != GL_FLOAT;
  target.plain = target.clamps && samples == 0 && readObject == object &&
    ask(GL_FRAMEBUFFER_ATTACHMENT_RED_SIZE) == 8 &&
    ask(GL_FRAMEBUFFER_ATTACHMENT_ALPHA_SIZE) == 8 && glIsEnabled(GL_FRAMEBUFFER_SRGB) == GL_FALSE;
  return target;
}

//------------------------------------------------------------------------------
std::string define(const char* name, int value)
{
  return std::string("#define ") + name + " " + std::to_string(value) + "\n";
}
} // namespace

//------------------------------------------------------------------------------
/** The pass as a step of the internal sequence; its owner outlives it. */
class vtkBucketedKBufferPass::vtkTranslucentStep : public vtkRenderPass
{
public:
  static vtkTranslucentStep* New();
  vtkTypeMacro(vtkTranslucentStep, vtkRenderPass);

  void Render(const vtkRenderState* s) override
  {
    this->Owner->RenderTranslucent(s);
    this->NumberOfRenderedProps = this->Owner->NumberOfRenderedProps;
  }

  vtkBucketedKBufferPass* Owner = nullptr;
};

//------------------------------------------------------------------------------
class vtkBucketedKBufferPass::vtkInternals
{
public:
  vtkSmartPointer<vtkRenderPass> TranslucentPass = vtkSmartPointer<vtkTranslucentPass>::New();
  vtkNew<vtkRenderStepsPass> Steps;
  vtkNew<vtkTranslucentStep> Step;
  vtkSmartPointer<vtkDualDepthPeelingPass> Fallback;
  std::string Told; // the reason for the fallback, once told

  // OpenGL objects, of one window
  vtkWeakPointer<vtkOpenGLRenderWindow> Window;
  StorageBuffer Heads{ 0 };
  StorageBuffer Links{ 1 };
  StorageBuffer Colors{ 2 };
  StorageBuffer Surfaces{ 3 };
  StorageBuffer CounterBuffer{ 4 };
  vtkSmartPointer<vtkTextureObject> OpaqueDepth;
  int OpaqueDepthFormat = -1;
  vtkSmartPointer<vtkOpenGLFramebufferObject> DepthTarget;
  vtkSmartPointer<vtkTextureObject> TargetColor;
  vtkSmartPointer<vtkOpenGLFramebufferObject> GeometryTarget;
  std::unique_ptr<vtkOpenGLQuadHelper> Blend;
  std::string BlendKey;
  vtkTypeInt64 LargestBlock = 0; // GL_MAX_SHADER_STORAGE_BLOCK_SIZE
  vtkTypeInt64 MostTexels = 0;   // GL_MAX_TEXTURE_BUFFER_SIZE

  // of this frame
  int Size[2] = { 0, 0 };
  int Origin[2] = { 0, 0 };
  vtkTypeInt64 Capacity = 0; // nodes
  bool Style = false;
  bool FloatColor = false;
  Target Into;
  std::unordered_map<vtkProp*, int> Shapes; // first shape of a prop
  vtkTypeInt64 Merged = -1;                 // -1: to be read
  std::string FailedTag;

  std::vector<int> Units; // texture units in use

  // between frames
  int Bands = 1;
  bool ShaderStyle = false;
  bool ShaderFloatColor = false;
  vtkTimeStamp ShaderTime;

  int BitsPerFragment() const
  {
    return 32 + 32 + (this->FloatColor ? 128 : 64) + (this->Style ? 64 : 0);
  }
  std::array<StorageBuffer*, 5> Buffers()
  {
    return { &this->Heads, &this->Links, &this->Colors, &this->Surfaces, &this->CounterBuffer };
  }
  std::string Defines(int room) const
  {
    return define("LT_READ_TARGET", this->Into.plain) +
      std::string("#define LT_NONE 0xFFFFFFFFu\n#define LT_NO_NORMAL 0x80008000u\n") +
      define("LT_STYLE", this->Style) + define("LT_FLOAT_COLOR", this->FloatColor) +
      define("LT_ROOM", room);
  }
  void ReserveNodes(vtkTypeInt64 nodes)
  {
    this->Links.Reserve(nodes * 8);
    this->Colors.Reserve(nodes * (this->FloatColor ? 16 : 8));
    if (this->Style)
    {
      this->Surfaces.Reserve(nodes * 8);
    }
    this->Capacity = nodes;
  }
  void BindForReading(vtkOpenGLRenderWindow* window, vtkShaderProgram* program)
  {
    struct Reader
    {
      StorageBuffer* buffer;
      const char* name;
      GLenum format;
    };
    const GLenum color = this->FloatColor ? GL_RGBA32F : GL_RGBA16F;
    for (const Reader& r : { Reader{ &this->Heads, "ltHeads", GL_R32UI },
           Reader{ &this->Links, "ltLinks", GL_RG32UI }, Reader{ &this->Colors, "ltColors", color },
           Reader{ &this->Surfaces, "ltSurfaces", GL_RG32UI } })
    {
      if (r.buffer->Bytes > 0 && program->IsUniformUsed(r.name))
      {
        this->Units.push_back(window->GetState()->GetTextureUnitManager()->Allocate());
        r.buffer->BindTexture(window->GetState(), this->Units.back(), r.format);
        program->SetUniformi(r.name, this->Units.back());
      }
    }
  }
  void FreeUnits(vtkOpenGLRenderWindow* window)
  {
    for (const int unit : this->Units)
    {
      window->GetState()->vtkglActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
      glBindTexture(GL_TEXTURE_BUFFER, 0);
      window->GetState()->GetTextureUnitManager()->Free(unit);
    }
    this->Units.clear();
  }
  void Release(vtkWindow* window);
  std::string WhyNot(vtkOpenGLRenderWindow* window);
  void CopyOpaqueDepth(vtkOpenGLRenderWindow* window);
  vtkTypeInt64 MostNodes(vtkTypeInt64 memoryLimit) const;
};

vtkStandardNewMacro(vtkBucketedKBufferPass::vtkTranslucentStep);
vtkStandardNewMacro(vtkBucketedKBufferPass);

//------------------------------------------------------------------------------
void vtkBucketedKBufferPass::vtkInternals::Release(vtkWindow* window)
{
  for (StorageBuffer* buffer : this->Buffers())
  {
    buffer->Release();
  }
  for (auto* texture : { &this->OpaqueDepth, &this->TargetColor })
  {
    if (*texture)
    {
      (*texture)->ReleaseGraphicsResources(window);
      *texture = nullptr;
    }
  }
  for (auto* target : { &this->DepthTarget, &this->GeometryTarget })
  {
    if (*target)
    {
      (*target)->ReleaseGraphicsResources(window);
      *target = nullptr;
    }
  }
  this->OpaqueDepthFormat = -1;
  this->Blend.reset();
  this->BlendKey.clear();
  this->Capacity = 0;
  this->Merged = std::max<vtkTypeInt64>(this->Merged, 0);
  this->Window = nullptr;
}

//------------------------------------------------------------------------------
/** Why this window cannot be drawn to; empty if it can. */
std::string vtkBucketedKBufferPass::vtkInternals::WhyNot(vtkOpenGLRenderWindow* window)
{
  GLint major = 0;
  GLint minor = 0;
  glGetIntegerv(GL_MAJOR_VERSION, &major);
  glGetIntegerv(GL_MINOR_VERSION, &minor);
  if (10 * major + minor < 43)
  {
    return "OpenGL is " + std::to_string(major) + "." + std::to_string(minor) +
      ", expected 4.3 or later";
  }
  if (this->LargestBlock == 0)
  {
    GLint64 largest = 0;
    glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &largest);
    GLint texels = 0;
    glGetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &texels);
    this->LargestBlock = largest;
    this->MostTexels = texels;
  }
  const vtkTypeInt64 most = std::min(this->LargestBlock / 4, this->MostTexels);
  if (vtkTypeInt64(this->Size[0]) * this->Size[1] > most)
  {
    return "the viewport has " + std::to_string(this->Size[0]) + " x " +
      std::to_string(this->Size[1]) + " pixels, expected at most " + std::to_string(most) +
      " on this GPU";
  }
  (void)window;
  return std::string();
}

//------------------------------------------------------------------------------
vtkTypeInt64 vtkBucketedKBufferPass::vtkInternals::MostNodes(vtkTypeInt64 memoryLimit) const
{
  // Node numbers end before LT_NONE, and are compared with an int.
  const vtkTypeInt64 byBlock =
    std::min(this->LargestBlock / (this->FloatColor ? 16 : 8), this->MostTexels);
  const vtkTypeInt64 byLimit = memoryLimit / (this->BitsPerFragment() / 8);
  return std::max<vtkTypeInt64>(
    1024, std::min(std::min(byBlock, byLimit), vtkTypeInt64(VTK_INT_MAX)));
}

//------------------------------------------------------------------------------
/** Copies the depth of what is bound into OpaqueDepth; far away where there is none. */
void vtkBucketedKBufferPass::vtkInternals::CopyOpaqueDepth(vtkOpenGLRenderWindow* window)
{
  vtkOpenGLState* state = window->GetState();
  const int read = depthFormatRead();
  const int format = read < 0 ? vtkTextureObject::Float32 : read;
  // 24 and 8 bits in one, or depth alone: blits ask for the same format.
  const int key = format + (read >= 0 && readsStencilToo() ? 100 : 0);
  if (!this->OpaqueDepth || this->OpaqueDepthFormat != key)
  {
    this->OpaqueDepth = vtkSmartPointer<vtkTextureObject>::New();
    this->OpaqueDepth->SetContext(window);
    if (key >= 100)
    {
      this->OpaqueDepth->AllocateDepthStencil(this->Size[0], this->Size[1]);
    }
    else
    {
      this->OpaqueDepth->AllocateDepth(this->Size[0], this->Size[1], format);
    }
    this->OpaqueDepth->SetWrapS(vtkTextureObject::ClampToEdge);
    this->OpaqueDepth->SetWrapT(vtkTextureObject::ClampToEdge);
    this->OpaqueDepth->SetMinificationFilter(vtkTextureObject::Nearest);
    this->OpaqueDepth->SetMagnificationFilter(vtkTextureObject::Nearest);
    this->OpaqueDepthFormat = key;
    this->DepthTarget = nullptr;
  }
  else
  {
    this->OpaqueDepth->Resize(this->Size[0], this->Size[1]);
  }
  state->PushFramebufferBindings();
  if (!this->DepthTarget)
  {
    this->DepthTarget = vtkSmartPointer<vtkOpenGLFramebufferObject>::New();
    this->DepthTarget->SetContext(window);
    this->DepthTarget->Bind();
    this->DepthTarget->AddDepthAttachment(this->OpaqueDepth);
    this->DepthTarget->DeactivateDrawBuffers();
    this->DepthTarget->DeactivateReadBuffer();
    state->PopFramebufferBindings();
    state->PushFramebufferBindings();
  }
  this->DepthTarget->Bind(vtkOpenGLFramebufferObject::GetDrawMode());
  state->vtkglDisable(GL_SCISSOR_TEST);
  if (read < 0)
  {
    state->vtkglDepthMask(GL_TRUE);
    state->vtkglClearDepth(1.0);
    state->vtkglClear(GL_DEPTH_BUFFER_BIT);
  }
  else
  {
    state->vtkglBlitFramebuffer(this->Origin[0], this->Origin[1], this->Origin[0] + this->Size[0],
      this->Origin[1] + this->Size[1], 0, 0, this->Size[0], this->Size[1], GL_DEPTH_BUFFER_BIT,
      GL_NEAREST);
  }
  state->PopFramebufferBindings();
}

//------------------------------------------------------------------------------
vtkBucketedKBufferPass::vtkBucketedKBufferPass()
  : Internals(new vtkInternals)
{
  this->Internals->Step->Owner = this;
  this->Internals->Steps->SetTranslucentPass(this->Internals->Step);
  this->SetActiveDrawBuffers(1);
}

//------------------------------------------------------------------------------
vtkBucketedKBufferPass::~vtkBucketedKBufferPass()
{
  vtkInternals& self = *this->Internals;
  if (self.Window)
  {
    self.Window->MakeCurrent();
    self.Release(self.Window);
  }
}

//------------------------------------------------------------------------------
void vtkBucketedKBufferPass::SetTranslucentPass(vtkRenderPass* pass)
{
  vtkInternals& self = *this->Internals;
  if (self.TranslucentPass != pass)
  {
    self.TranslucentPass = pass;
    if (!pass)
    {
      self.TranslucentPass = vtkSmartPointer<vtkTranslucentPass>::New();
    }
    this->Modified();
  }
}

//------------------------------------------------------------------------------
vtkRenderPass* vtkBucketedKBufferPass::GetTranslucentPass()
{
  return this->Internals->TranslucentPass;
}

//------------------------------------------------------------------------------
void vtkBucketedKBufferPass::Render(const vtkRenderState* s)
{
  if (s->GetRenderer()->GetPass() == this)
  {
    this->RenderEverything(s);
  }
  else
  {
    this->RenderTranslucent(s);
  }
}

//------------------------------------------------------------------------------
void vtkBucketedKBufferPass::RenderEverything(const vtkRenderState* s)
{
  auto* renderer = vtkOpenGLRenderer::SafeDownCast(s->GetRenderer());
  if (renderer->GetSelector())
  {
    // Colours are identities then: VTK's own way.
    vtkSmartPointer<vtkBucketedKBufferPass> self = this;
    renderer->SetPass(nullptr);
    renderer->DeviceRender();
    renderer->SetPass(this);
    return;
  }
  this->Internals->Steps->Render(s);
  this->NumberOfRenderedProps = this->Internals->Steps->GetNumberOfRenderedProps();
}

//------------------------------------------------------------------------------
void vtkBucketedKBufferPass::RenderFallback(const vtkRenderState* s, const std::string& reason)
{
  vtkInternals& self = *this->Internals;
  this->UsedFallback = true;
  if (self.Told != reason)
  {
    self.Told = reason;
    vtkWarningMacro("vtkDualDepthPeelingPass draws the translucent surfaces: " << reason << ".");
  }
  if (!self.Fallback)
  {
    self.Fallback = vtkSmartPointer<vtkDualDepthPeelingPass>::New();
  }
  self.Fallback->SetTranslucentPass(self.TranslucentPass);
  self.Fallback->SetMaximumNumberOfPeels(this->NumberOfLayers);
  self.Fallback->SetOcclusionRatio(0.);
  self.Fallback->Render(s);
  this->NumberOfRenderedProps = self.Fallback->GetNumberOfRenderedProps();
}

//------------------------------------------------------------------------------
void vtkBucketedKBufferPass::RenderTranslucent(const vtkRenderState* s)
{
  vtkInternals& self = *this->Internals;
  vtkRenderer* renderer = s->GetRenderer();
  this->NumberOfRenderedProps = 0;
  this->NumberOfFragments = 0;
  this->NumberOfBands = 0;
  this->NumberOfGeometryPasses = 0;
  this->UsedFallback = false;
  self.Merged = 0;
  if (renderer->GetSelector())
  {
    self.TranslucentPass->Render(s);
    return;
  }
  vtkProp** props = s->GetPropArray();
  const int numberOfProps = s->GetPropArrayCount();
  if (std::none_of(props, props + numberOfProps,
        [](vtkProp* prop) { return prop->HasTranslucentPolygonalGeometry() != 0; }))
  {
    return;
  }

  auto* window = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow());
  if (self.Window != window)
  {
    if (self.Window)
    {
      self.Window->MakeCurrent();
      self.Release(self.Window);
      window->MakeCurrent();
    }
    self.Window = window;
  }
  vtkOpenGLClearErrorMacro();
  if (s->GetFrameBuffer() == nullptr)
  {
    renderer->GetTiledSizeAndOrigin(&self.Size[0], &self.Size[1], &self.Origin[0], &self.Origin[1]);
  }
  else
  {
    s->GetWindowSize(self.Size);
    self.Origin[0] = 0;
    self.Origin[1] = 0;
  }
  if (self.Size[0] < 1 || self.Size[1] < 1)
  {
    return;
  }
  const std::string whyNot = self.WhyNot(window);
  if (!whyNot.empty())
  {
    this->RenderFallback(s, whyNot);
    return;
  }

  self.FloatColor = this->ColorPrecision == Float;
  self.Into = targetBound();
  if (self.ShaderStyle != self.Style || self.ShaderFloatColor != self.FloatColor)
  {
    self.ShaderStyle = self.Style;
    self.ShaderFloatColor = self.FloatColor;
    self.ShaderTime.Modified();
  }

  vtkOpenGLState* state = window->GetState();
  vtkOpenGLState::ScopedglViewport viewportSaver(state);
  vtkOpenGLState::ScopedglScissor scissorSaver(state);
  vtkOpenGLState::ScopedglEnableDisable scissorTestSaver(state, GL_SCISSOR_TEST);
  vtkOpenGLState::ScopedglEnableDisable depthTestSaver(state, GL_DEPTH_TEST);
  vtkOpenGLState::ScopedglEnableDisable blendSaver(state, GL_BLEND);
  vtkOpenGLState::ScopedglEnableDisable multisampleSaver(state, GL_MULTISAMPLE);
  vtkOpenGLState::ScopedglEnableDisable cullSaver(state, GL_CULL_FACE);
  vtkOpenGLState::ScopedglBlendFuncSeparate blendFunctionSaver(state);
  vtkOpenGLState::ScopedglDepthMask depthMaskSaver(state);
  vtkOpenGLState::ScopedglColorMask colorMaskSaver(state);
  state->vtkglDisable(GL_MULTISAMPLE);

  // 1. the opaque depth
  self.CopyOpaqueDepth(window);

  // 2. geometry, 3. blending
  self.Heads.Reserve(vtkTypeInt64(self.Size[0]) * self.Size[1] * 4);
  self.CounterBuffer.Reserve(NumberOfCounters * 4);
  self.CounterBuffer.Fill(0, NumberOfCounters * 4, 0);
  const vtkTypeInt64 most = self.MostNodes(this->MemoryLimit);
  if (self.Capacity > most)
  {
    self.Links.Release();
    self.Colors.Release();
    self.Surfaces.Release();
    self.Capacity = 0;
  }
  self.ReserveNodes(
    std::min(most, std::max(self.Capacity, vtkTypeInt64(self.Size[0]) * self.Size[1] * 2 + 1024)));
  if (!self.TargetColor)
  {
    self.TargetColor = vtkSmartPointer<vtkTextureObject>::New();
    self.TargetColor->SetContext(window);
    self.TargetColor->Allocate2D(self.Size[0], self.Size[1], 4, VTK_UNSIGNED_CHAR);
  }
  self.TargetColor->Resize(self.Size[0], self.Size[1]);
  if (!self.GeometryTarget)
  {
    self.GeometryTarget = vtkSmartPointer<vtkOpenGLFramebufferObject>::New();
    self.GeometryTarget->SetContext(window);
    state->PushFramebufferBindings();
    self.GeometryTarget->Bind();
    self.GeometryTarget->AddColorAttachment(0, self.TargetColor);
    state->PopFramebufferBindings();
  }

  if (self.Into.plain)
  {
    // What is there already; the geometry stage writes no colour.
    state->PushFramebufferBindings();
    GLint buffer = 0;
    glGetIntegerv(GL_DRAW_BUFFER0, &buffer);
    GLint readBuffer = 0;
    glGetIntegerv(GL_READ_BUFFER, &readBuffer);
    glReadBuffer(static_cast<GLenum>(buffer));
    self.GeometryTarget->Bind(vtkOpenGLFramebufferObject::GetDrawMode());
    self.GeometryTarget->ActivateDrawBuffers(1);
    state->vtkglDisable(GL_SCISSOR_TEST);
    state->vtkglColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    state->vtkglBlitFramebuffer(self.Origin[0], self.Origin[1], self.Origin[0] + self.Size[0],
      self.Origin[1] + self.Size[1], 0, 0, self.Size[0], self.Size[1], GL_COLOR_BUFFER_BIT,
      GL_NEAREST);
    glReadBuffer(static_cast<GLenum>(readBuffer));
    state->PopFramebufferBindings();
  }

  self.Shapes.clear();
  for (int i = 0; i < numberOfProps; ++i)
  {
    self.Shapes[props[i]] = i;
    // vtkOpenGLActor leaves the depth mask alone.
    vtkInformation* keys = props[i]->GetPropertyKeys();
    if (!keys)
    {
      vtkNew<vtkInformation> made;
      props[i]->SetPropertyKeys(made);
      keys = made;
    }
    keys->Set(vtkOpenGLActor::GLDepthMaskOverride(), -1);
  }
  this->PreRender(s);

  // As many bands as the last frame needed; one that has no room is halved.
  std::vector<std::array<int, 2>> bands;
  const int startBands = std::min(self.Bands, self.Size[1]);
  for (int b = startBands; b > 0; --b)
  {
    bands.push_back({ static_cast<int>(vtkTypeInt64(self.Size[1]) * (b - 1) / startBands),
      static_cast<int>(vtkTypeInt64(self.Size[1]) * b / startBands) });
  }
  while (!bands.empty())
  {
    const std::array<int, 2> band = bands.back();
    bands.pop_back();
    if (this->RenderBand(s, band[0], band[1]))
    {
      ++this->NumberOfBands;
      continue;
    }
    const int middle = (band[0] + band[1]) / 2;
    bands.push_back({ middle, band[1] });
    bands.push_back({ band[0], middle });
  }
  self.Bands = this->NumberOfBands > 1 ? this->NumberOfBands : 1;
  self.Merged = -1;

  this->PostRender(s);
  for (int i = 0; i < numberOfProps; ++i)
  {
    props[i]->GetPropertyKeys()->Remove(vtkOpenGLActor::GLDepthMaskOverride());
  }
  for (StorageBuffer* buffer : self.Buffers())
  {
    buffer->Unbind();
  }
  glBindBuffer(GL_SHADER_STORAGE_BUFFER, 0);
  if (!self.FailedTag.empty())
  {
    vtkErrorMacro("A shader has no " << self.FailedTag << " (VTK " << vtkVersion::GetVTKVersion()
                                     << ", or a replacement of a vtkShaderProperty took it away); "
                                        "its translucent prop is not drawn.");
    self.FailedTag.clear();
  }
  vtkOpenGLCheckErrorMacro("failed after Render");
}

//------------------------------------------------------------------------------
/** Rows first to last - 1; false, and nothing drawn, where the nodes don't fit. */
bool vtkBucketedKBufferPass::RenderBand(const vtkRenderState* s, int first, int last)
{
  vtkInternals& self = *this->Internals;
  auto* window = vtkOpenGLRenderWindow::SafeDownCast(s->GetRenderer()->GetRenderWindow());
  vtkOpenGLState* state = window->GetState();
  const int width = self.Size[0];

  // 2. geometry
  vtkTypeInt64 nodes = 0;
  while (true)
  {
    self.Heads.Fill(
      vtkTypeInt64(first) * width * 4, vtkTypeInt64(last - first) * width * 4, EndOfList);
    self.CounterBuffer.Fill(NodesAsked, 4, 0);
    for (StorageBuffer* buffer : self.Buffers())
    {
      buffer->Bind();
    }
    state->PushFramebufferBindings();
    self.GeometryTarget->Bind();
    self.GeometryTarget->ActivateDrawBuffers(1);
    state->vtkglViewport(0, 0, width, self.Size[1]);
    state->vtkglEnable(GL_SCISSOR_TEST);
    state->vtkglScissor(0, first, width, last - first);
    state->vtkglDisable(GL_DEPTH_TEST);
    state->vtkglDisable(GL_BLEND);
    state->vtkglDepthMask(GL_FALSE);
    state->vtkglColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    self.OpaqueDepth->Activate();
    self.TranslucentPass->Render(s);
    ++this->NumberOfGeometryPasses;
    self.OpaqueDepth->Deactivate();
    state->PopFramebufferBindings();
    glMemoryBarrier(
      GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT);

    nodes = self.CounterBuffer.Read(NodesAsked);
    if (nodes <= self.Capacity)
    {
      break;
    }
    const vtkTypeInt64 most = self.MostNodes(this->MemoryLimit);
    if (nodes <= most)
    {
      self.ReserveNodes(std::min(most, nodes + nodes / 8));
    }
    else if (last - first > 1)
    {
      return false;
    }
    else
    {
      vtkErrorMacro("A row of " << width << " pixels has " << nodes
                                << " fragments, more than MemoryLimit or the GPU has room for ("
                                << self.Capacity << "); some are left out.");
      break;
    }
  }
  this->NumberOfFragments += nodes;
  this->NumberOfRenderedProps = self.TranslucentPass->GetNumberOfRenderedProps();

  // 3. blending
  int room = 8;
  while (room < this->NumberOfLayers)
  {
    room *= 2;
  }
  const std::string key = self.Defines(room);
  if (!self.Blend || self.BlendKey != key)
  {
    const std::string source = std::string("//VTK::System::Dec\n") + Extensions +
      "//VTK::Output::Dec\n" + key + vtkBucketedKBufferRead + vtkBucketedKBufferList +
      vtkBucketedKBufferBlend;
    self.Blend = std::make_unique<vtkOpenGLQuadHelper>(window, nullptr, source.c_str(), nullptr);
    self.BlendKey = key;
  }
  else
  {
    window->GetShaderCache()->ReadyShaderProgram(self.Blend->Program);
  }
  if (!self.Blend->Program)
  {
    return true; // VTK has said why
  }
  state->vtkglViewport(self.Origin[0], self.Origin[1], width, self.Size[1]);
  state->vtkglScissor(self.Origin[0], self.Origin[1] + first, width, last - first);
  // Blending in 8 bits rounds more than once.
  if (self.Into.plain)
  {
    state->vtkglDisable(GL_BLEND);
    self.TargetColor->Activate();
    self.Blend->Program->SetUniformi("ltTarget", self.TargetColor->GetTextureUnit());
  }
  else
  {
    state->vtkglEnable(GL_BLEND);
  }
  state->vtkglDisable(GL_CULL_FACE);
  state->vtkglColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  state->vtkglBlendFuncSeparate(GL_ONE, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
  self.BindForReading(window, self.Blend->Program);
  self.Blend->Program->SetUniformi("ltLayers", this->NumberOfLayers);
  self.Blend->Program->SetUniform2i("ltSize", self.Size);
  self.Blend->Render();
  self.FreeUnits(window);
  self.TargetColor->Deactivate();
  return true;
}

//------------------------------------------------------------------------------
bool vtkBucketedKBufferPass::PostReplaceShaderValues(std::string& /*vertexShader*/,
  std::string& /*geometryShader*/, std::string& fragmentShader, vtkAbstractMapper* /*mapper*/,
  vtkProp* /*prop*/)
{
  vtkInternals& self = *this->Internals;
  const auto substitute = [&](const char* tag, const std::string& with)
  {
    if (!vtkShaderProgram::Substitute(fragmentShader, tag, with, false))
    {
      self.FailedTag = tag;
    }
  };
  substitute("//VTK::System::Dec", std::string("//VTK::System::Dec\n") + Extensions);
  substitute(
    "//VTK::DepthPeeling::Dec", self.Defines(1) + vtkBucketedKBufferData + vtkBucketedKBufferStore);
  // Where the mapper has set the depth itself, the tag is gone.
  vtkShaderProgram::Substitute(
    fragmentShader, "//VTK::Depth::Impl", "gl_FragDepth = gl_FragCoord.z;\n", false);
  substitute(
    "//VTK::DepthPeeling::Impl", "ltStore(gl_FragData[0], gl_FragDepth, 0u, LT_NO_NORMAL);\n");
  return true;
}

//------------------------------------------------------------------------------
bool vtkBucketedKBufferPass::SetShaderParameters(vtkShaderProgram* program,
  vtkAbstractMapper* /*mapper*/, vtkProp* prop, vtkOpenGLVertexArrayObject* /*VAO*/)
{
  vtkInternals& self = *this->Internals;
  program->SetUniformi("ltOpaqueDepth", self.OpaqueDepth->GetTextureUnit());
  program->SetUniformi("ltWidth", self.Size[0]);
  program->SetUniformi("ltCapacity", static_cast<int>(self.Capacity));
  program->SetUniformi("ltClampColor", self.Into.clamps);
  auto* actor = vtkActor::SafeDownCast(prop);
  program->SetUniformi(
    "ltThin", actor && actor->GetProperty()->GetRepresentation() != VTK_SURFACE ? 1 : 0);
  if (program->IsUniformUsed("ltShape"))
  {
    const auto shape = self.Shapes.find(prop);
    program->SetUniformi("ltShape", shape == self.Shapes.end() ? 0 : shape->second);
  }
  return true;
}

//------------------------------------------------------------------------------
vtkMTimeType vtkBucketedKBufferPass::GetShaderStageMTime()
{
  return this->Internals->ShaderTime;
}

//------------------------------------------------------------------------------
vtkTypeInt64 vtkBucketedKBufferPass::GetNumberOfMergedFragments()
{
  vtkInternals& self = *this->Internals;
  if (self.Merged < 0)
  {
    self.Merged = 0;
    if (self.Window)
    {
      self.Window->MakeCurrent();
      glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
      self.Merged = self.CounterBuffer.Read(FragmentsMerged);
      glBindBuffer(GL_SHADER_STORAGE_BUFFER, 0);
    }
  }
  return self.Merged;
}

//------------------------------------------------------------------------------
vtkTypeInt64 vtkBucketedKBufferPass::GetMemoryInBytes()
{
  vtkTypeInt64 bytes = 0;
  for (const StorageBuffer* buffer : this->Internals->Buffers())
  {
    bytes += buffer->Bytes;
  }
  return bytes;
}

//------------------------------------------------------------------------------
int vtkBucketedKBufferPass::GetBitsPerFragment()
{
  this->Internals->FloatColor = this->ColorPrecision == Float;
  return this->Internals->BitsPerFragment();
}

//------------------------------------------------------------------------------
void vtkBucketedKBufferPass::ReleaseGraphicsResources(vtkWindow* window)
{
  vtkInternals& self = *this->Internals;
  if (self.Window && self.Window == window)
  {
    self.Window->MakeCurrent();
    self.Release(window);
  }
  self.TranslucentPass->ReleaseGraphicsResources(window);
  self.Steps->ReleaseGraphicsResources(window);
  if (self.Fallback)
  {
    self.Fallback->ReleaseGraphicsResources(window);
  }
}

//------------------------------------------------------------------------------
void vtkBucketedKBufferPass::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "NumberOfLayers: " << this->NumberOfLayers << "\n";
  os << indent << "ColorPrecision: " << (this->ColorPrecision == Float ? "Float" : "Half") << "\n";
  os << indent << "MemoryLimit: " << this->MemoryLimit << "\n";
  os << indent << "NumberOfFragments: " << this->NumberOfFragments << "\n";
  os << indent << "NumberOfBands: " << this->NumberOfBands << "\n";
  os << indent << "NumberOfGeometryPasses: " << this->NumberOfGeometryPasses << "\n";
  os << indent << "UsedFallback: " << this->UsedFallback << "\n";
  os << indent << "TranslucentPass: " << this->Internals->TranslucentPass.Get() << "\n";
}
