// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "KBuffer.h"

#include "vtkBucketedKBufferBlend.h"
#include "vtkBucketedKBufferCurvature.h"
#include "vtkBucketedKBufferExtensions.h"
#include "vtkBucketedKBufferLines.h"
#include "vtkBucketedKBufferList.h"
#include "vtkBucketedKBufferMatch.h"
#include "vtkBucketedKBufferOrder.h"
#include "vtkBucketedKBufferPixel.h"
#include "vtkBucketedKBufferRead.h"
#include "vtkBucketedKBufferSmooth.h"
#include "vtkBucketedKBufferStyle.h"
#include "vtkBucketedKBufferTensor.h"
#include "vtkCurvatureOpacityFunction.h"
#include "vtkCurvatureOpacityProperty.h"

#include "vtkBoundingBox.h"
#include "vtkCamera.h"
#include "vtkColorTransferFunction.h"
#include "vtkImageData.h"
#include "vtkMatrix4x4.h"
#include "vtkOpenGLFramebufferObject.h"
#include "vtkOpenGLQuadHelper.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkOpenGLShaderCache.h"
#include "vtkOpenGLState.h"
#include "vtkPiecewiseFunction.h"
#include "vtkProp.h"
#include "vtkRenderer.h"
#include "vtkShaderProgram.h"
#include "vtkTextureObject.h"
#include "vtkTextureUnitManager.h"

#include <algorithm>

namespace lighttransport
{
namespace
{
constexpr GLuint EndOfList = 0xFFFFFFFFU;

/**
 * Macros for shaders: LT_ITEM of 0 to n - 1, and LT_EXCHANGE of the pairs of Batcher's
 * odd-even merge sort (1968), for a power of 2.
 */
std::string sortingNetwork(int n)
{
  std::string each = "#define LT_EACH";
  for (int i = 0; i < n; ++i)
  {
    each += " LT_ITEM(" + std::to_string(i) + ")";
  }
  std::string network = "\n#define LT_NETWORK";
  for (int p = 1; p < n; p *= 2)
  {
    for (int k = p; k > 0; k /= 2)
    {
      for (int j = k % p; j + k < n; j += 2 * k)
      {
        for (int i = j; i < std::min(j + k, n - k); ++i)
        {
          if (i / (2 * p) == (i + k) / (2 * p))
          {
            network += " LT_EXCHANGE(" + std::to_string(i) + "," + std::to_string(i + k) + ")";
          }
        }
      }
    }
  }
  return each + network + "\n";
}
} // namespace

//------------------------------------------------------------------------------
KBuffer::KBuffer() = default;
KBuffer::~KBuffer() = default;

//------------------------------------------------------------------------------
std::vector<TexelBuffer*> KBuffer::All()
{
  return { &this->Heads, &this->Links, &this->Colors, &this->Surfaces, &this->Counter,
    &this->Pixels, &this->Records, &this->NodeList, &this->Buckets, &this->Tensors,
    &this->SmoothTensors, &this->ShadingTable, &this->OpacityTable, &this->ParameterTable };
}

//------------------------------------------------------------------------------
void KBuffer::Release(vtkWindow* window)
{
  for (TexelBuffer* buffer : this->All())
  {
    buffer->Release();
  }
  this->Order[0].Release();
  this->Order[1].Release();
  this->Match.Release();
  this->Tensor.Release();
  this->Smooth.Release();
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
  this->Quads[0].reset();
  this->Quads[1].reset();
  this->Tables.clear();
  this->Capacity = 0;
  this->MostTexels = 0;
  this->Window = nullptr;
}

//------------------------------------------------------------------------------
std::string KBuffer::WhyNot()
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
  if (this->MostTexels == 0)
  {
    GLint texels = 0;
    glGetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &texels);
    this->MostTexels = texels;
  }
  if (vtkTypeInt64(this->Now.size[0]) * this->Now.size[1] > this->MostTexels)
  {
    return "the viewport has " + std::to_string(this->Now.size[0]) + " x " +
      std::to_string(this->Now.size[1]) + " pixels, expected at most " +
      std::to_string(this->MostTexels) + " on this GPU";
  }
  return std::string();
}

//------------------------------------------------------------------------------
vtkTypeInt64 KBuffer::MostNodes(vtkTypeInt64 memoryLimit) const
{
  // A fragment's neighbours are written as four texels.
  const vtkTypeInt64 byTexels = this->MostTexels / (this->Now.style ? 4 : 1);
  const vtkTypeInt64 byLimit = memoryLimit / (this->BitsPerFragment() / 8);
  // Node numbers have 26 bits in ltNodes.
  return std::max<vtkTypeInt64>(1024, std::min(std::min(byTexels, byLimit), vtkTypeInt64(1) << 26));
}

//------------------------------------------------------------------------------
void KBuffer::ReserveNodes(vtkTypeInt64 nodes)
{
  this->Links.Reserve(nodes * 8);
  this->Colors.Reserve(nodes * (this->Now.floatColor ? 16 : 8));
  if (this->Now.style)
  {
    this->Surfaces.Reserve(nodes * 8);
  }
  this->Capacity = nodes;
}

//------------------------------------------------------------------------------
void KBuffer::ReleaseNodes()
{
  for (TexelBuffer* buffer : { &this->Links, &this->Colors, &this->Surfaces, &this->Records,
         &this->NodeList, &this->Buckets, &this->Tensors, &this->SmoothTensors })
  {
    buffer->Release();
  }
  this->Capacity = 0;
}

//------------------------------------------------------------------------------
int KBuffer::BitsPerFragment() const
{
  const int list = 32 + 32 + (this->Now.floatColor ? 128 : 64); // next, depth, colour
  // shape, normal; then z, normal, node, bucket; the neighbours are where next was
  const int style = this->Now.style ? 32 + 32 + 32 + 32 + 32 + 32 : 0;
  return list + style + (this->Now.lines ? 128 + 128 : 0);
}

//------------------------------------------------------------------------------
vtkTypeInt64 KBuffer::Bytes()
{
  vtkTypeInt64 bytes = 0;
  for (const TexelBuffer* buffer : this->All())
  {
    bytes += buffer->Bytes;
  }
  return bytes;
}

//------------------------------------------------------------------------------
std::string KBuffer::Defines(int room) const
{
  return std::string("#define LT_NONE 0xFFFFFFFFu\n#define LT_NO_NORMAL 0x80008000u\n") +
    define("LT_STYLE", this->Now.style) + define("LT_FLOAT_COLOR", this->Now.floatColor) +
    define("LT_LINES", this->Now.lines) + define("LT_ROOM", room);
}

//------------------------------------------------------------------------------
int KBuffer::Room() const
{
  int room = 8;
  while (room < this->Now.layers)
  {
    room *= 2;
  }
  return room;
}

//------------------------------------------------------------------------------
/** 1 where the pixels' lists are long: a third of the room on average, as measured. */
int KBuffer::Dense() const
{
  const vtkTypeInt64 pixels = vtkTypeInt64(this->Now.size[0]) * (this->Rows[1] - this->Rows[0]);
  return 3 * this->Fragments > this->Room() * pixels ? 1 : 0;
}

//------------------------------------------------------------------------------
GLenum KBuffer::ColorFormat() const
{
  return this->Now.floatColor ? GL_RGBA32F : GL_RGBA16F;
}

//------------------------------------------------------------------------------
void KBuffer::BindForReading(const Uniforms& uniforms)
{
  struct Reader
  {
    TexelBuffer* buffer;
    const char* name;
    GLenum format;
  };
  vtkOpenGLState* state = this->Window->GetState();
  for (const Reader& r :
    { Reader{ &this->Heads, "ltHeads", GL_R32UI }, Reader{ &this->Links, "ltLinks", GL_RG32UI },
      Reader{ &this->Colors, "ltColors", this->ColorFormat() },
      Reader{ &this->Surfaces, "ltSurfaces", GL_RG32UI },
      Reader{ &this->Pixels, "ltPixels", GL_RGBA32UI },
      Reader{ &this->Records, "ltRecords", GL_RG32UI },
      Reader{ &this->NodeList, "ltNodeList", GL_R32UI },
      Reader{ &this->Buckets, "ltBucketList", GL_R32UI },
      Reader{ &this->Links, "ltNeighbors", GL_R32UI },
      Reader{
        this->LatestTensors ? this->LatestTensors : &this->Tensors, "ltTensors", GL_RGBA32UI },
      Reader{ &this->ShadingTable, "ltShading", GL_RGBA32F },
      Reader{ &this->OpacityTable, "ltOpacity", GL_RGBA32F },
      Reader{ &this->ParameterTable, "ltParameters", GL_RGBA32F } })
  {
    if (r.buffer->Bytes > 0 && uniforms.Has(r.name))
    {
      this->Units.push_back(state->GetTextureUnitManager()->Allocate());
      r.buffer->BindTexture(state, this->Units.back(), r.format);
      uniforms.Set(r.name, this->Units.back());
    }
  }
}

//------------------------------------------------------------------------------
void KBuffer::FreeUnits()
{
  vtkOpenGLState* state = this->Window->GetState();
  for (const int unit : this->Units)
  {
    state->vtkglActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
    glBindTexture(GL_TEXTURE_BUFFER, 0);
    state->GetTextureUnitManager()->Free(unit);
  }
  this->Units.clear();
}

//------------------------------------------------------------------------------
void KBuffer::SetGeometry(const Uniforms& uniforms) const
{
  uniforms.Set("ltRows", this->Rows);
  uniforms.Set("ltSize", std::array<int, 2>{ this->Now.size[0], this->Now.size[1] });
  uniforms.Set("ltParallel", this->Parallel);
  uniforms.Set("ltPixelToVC", this->PixelToVC);
  uniforms.Set("ltDepthToVC", this->DepthToVC);
  uniforms.Set("ltFootprint", this->Footprint);
}

//------------------------------------------------------------------------------
void KBuffer::CopyTarget()
{
  this->CopyDepth();
  const auto width = static_cast<unsigned int>(this->Now.size[0]);
  const auto height = static_cast<unsigned int>(this->Now.size[1]);
  vtkOpenGLState* state = this->Window->GetState();
  if (!this->TargetColor)
  {
    this->TargetColor = vtkSmartPointer<vtkTextureObject>::New();
    this->TargetColor->SetContext(this->Window);
    this->TargetColor->Allocate2D(width, height, 4, VTK_UNSIGNED_CHAR);
  }
  this->TargetColor->Resize(width, height);
  if (!this->GeometryTarget)
  {
    this->GeometryTarget = vtkSmartPointer<vtkOpenGLFramebufferObject>::New();
    this->GeometryTarget->SetContext(this->Window);
    state->PushFramebufferBindings();
    this->GeometryTarget->Bind();
    this->GeometryTarget->AddColorAttachment(0, this->TargetColor);
    state->PopFramebufferBindings();
  }
  if (this->Now.into.plain)
  {
    this->CopyColor();
  }
  this->Heads.Reserve(vtkTypeInt64(width) * height * 4);
  this->Counter.Reserve(NumberOfCounters * 4);
  this->Counter.Fill(0, NumberOfCounters * 4, 0);
  if (this->Now.style)
  {
    this->Pixels.Reserve(vtkTypeInt64(width) * height * 16);
    this->FillTables();
  }
}

//------------------------------------------------------------------------------
/** The depth of what is bound; far away where there is none. */
void KBuffer::CopyDepth()
{
  vtkOpenGLState* state = this->Window->GetState();
  const int* size = this->Now.size;
  const int* origin = this->Now.origin;
  const DepthSource source = DepthSource::Bound();
  const bool none = source.format < 0;
  // 24 and 8 bits in one, or depth alone: blits ask for the same format.
  const int key = none ? 0 : source.format + (source.stencil ? 100 : 0);
  if (!this->OpaqueDepth || this->OpaqueDepthFormat != key)
  {
    this->OpaqueDepth = vtkSmartPointer<vtkTextureObject>::New();
    this->OpaqueDepth->SetContext(this->Window);
    if (source.stencil)
    {
      this->OpaqueDepth->AllocateDepthStencil(size[0], size[1]);
    }
    else
    {
      this->OpaqueDepth->AllocateDepth(
        size[0], size[1], none ? static_cast<int>(vtkTextureObject::Float32) : source.format);
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
    this->OpaqueDepth->Resize(size[0], size[1]);
  }
  if (!this->DepthTarget)
  {
    state->PushFramebufferBindings();
    this->DepthTarget = vtkSmartPointer<vtkOpenGLFramebufferObject>::New();
    this->DepthTarget->SetContext(this->Window);
    this->DepthTarget->Bind();
    this->DepthTarget->AddDepthAttachment(this->OpaqueDepth);
    this->DepthTarget->DeactivateDrawBuffers();
    this->DepthTarget->DeactivateReadBuffer();
    state->PopFramebufferBindings();
  }
  state->PushFramebufferBindings();
  this->DepthTarget->Bind(vtkOpenGLFramebufferObject::GetDrawMode());
  state->vtkglDisable(GL_SCISSOR_TEST);
  if (none)
  {
    state->vtkglDepthMask(GL_TRUE);
    state->vtkglClearDepth(1.0);
    state->vtkglClear(GL_DEPTH_BUFFER_BIT);
  }
  else
  {
    state->vtkglBlitFramebuffer(origin[0], origin[1], origin[0] + size[0], origin[1] + size[1], 0,
      0, size[0], size[1], GL_DEPTH_BUFFER_BIT, GL_NEAREST);
  }
  state->PopFramebufferBindings();
}

//------------------------------------------------------------------------------
/** What is in the picture already; the geometry stage writes no colour. */
void KBuffer::CopyColor()
{
  vtkOpenGLState* state = this->Window->GetState();
  const int* size = this->Now.size;
  const int* origin = this->Now.origin;
  state->PushFramebufferBindings();
  GLint drawBuffer = 0;
  GLint readBuffer = 0;
  glGetIntegerv(GL_DRAW_BUFFER0, &drawBuffer);
  glGetIntegerv(GL_READ_BUFFER, &readBuffer);
  glReadBuffer(static_cast<GLenum>(drawBuffer));
  this->GeometryTarget->Bind(vtkOpenGLFramebufferObject::GetDrawMode());
  this->GeometryTarget->ActivateDrawBuffers(1);
  state->vtkglDisable(GL_SCISSOR_TEST);
  state->vtkglColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  state->vtkglBlitFramebuffer(origin[0], origin[1], origin[0] + size[0], origin[1] + size[1], 0, 0,
    size[0], size[1], GL_COLOR_BUFFER_BIT, GL_NEAREST);
  glReadBuffer(static_cast<GLenum>(readBuffer));
  state->PopFramebufferBindings();
}

//------------------------------------------------------------------------------
/** How z in VC follows from depth, and what the scene measures. */
void KBuffer::SetCamera(vtkRenderer* renderer, vtkProp** props, int count)
{
  vtkCamera* camera = renderer->GetActiveCamera();
  vtkMatrix4x4* p = camera->GetProjectionTransformMatrix(renderer->GetTiledAspectRatio(), -1., 1.);
  this->Parallel = camera->GetParallelProjection() != 0;
  const int column = this->Parallel ? 3 : 2;
  const auto at = [p](int row, int col) { return static_cast<float>(p->GetElement(row, col)); };
  const float sign = this->Parallel ? -1.F : 1.F;
  for (int i = 0; i < 2; ++i)
  {
    const auto pixels = static_cast<float>(this->Now.size[i]);
    this->PixelToVC[i] = 2.F / pixels / at(i, i);
    this->PixelToVC[i + 2] = (1.F / pixels - 1.F + sign * at(i, column)) / at(i, i);
  }
  this->DepthToVC = { at(2, 2), at(2, 3) };
  this->Footprint = static_cast<float>(2. / (p->GetElement(1, 1) * this->Now.size[1]));
  vtkMatrix4x4::Invert(p, this->DCToVC);
  this->DCToVC->Transpose();

  vtkBoundingBox box;
  for (int i = 0; i < count; ++i)
  {
    const double* bounds = props[i]->GetBounds();
    if (bounds && bounds[0] <= bounds[1] && props[i]->HasTranslucentPolygonalGeometry())
    {
      box.AddBounds(bounds);
    }
  }
  this->DepthRange = { 0.F, 1.F };
  this->SceneLength = 1.;
  if (!box.IsValid())
  {
    return;
  }
  // The distances of the box's corners along the line of sight.
  const double length = std::max(box.GetDiagonalLength(), 1e-30);
  double nearest = VTK_DOUBLE_MAX;
  double farthest = -VTK_DOUBLE_MAX;
  vtkMatrix4x4* view = camera->GetViewTransformMatrix();
  for (int corner = 0; corner < 8; ++corner)
  {
    double point[4] = { 0., 0., 0., 1. };
    box.GetCorner(corner, point);
    point[3] = 1.;
    view->MultiplyPoint(point, point);
    nearest = std::min(nearest, -point[2]);
    farthest = std::max(farthest, -point[2]);
  }
  const double widen = farthest - nearest > 1e-6 * length ? 0. : .5 * length;
  this->DepthRange = { static_cast<float>(nearest - widen), static_cast<float>(farthest + widen) };
  this->SceneLength = length;
}

//------------------------------------------------------------------------------
/** The styles' functions as textures, made again where one has changed. */
void KBuffer::FillTables()
{
  std::vector<std::pair<vtkCurvatureOpacityProperty*, vtkMTimeType>> now;
  for (const auto& style : this->Styles)
  {
    now.emplace_back(style, style->GetMTime());
  }
  if (this->ShadingTable.Bytes > 0 && now == this->Tables)
  {
    return;
  }
  this->Tables = now;
  constexpr int Shades = 256; // as in vtkBucketedKBufferStyle.glsl
  constexpr int Opacities = 64;
  std::vector<float> shading;
  std::vector<float> opacity;
  std::vector<float> parameters;
  for (vtkCurvatureOpacityProperty* style : this->Styles)
  {
    for (int i = 0; i < Shades; ++i)
    {
      const double kappa = -1. + 2. * i / (Shades - 1);
      const double factor = style->GetShadingFunction()->GetValue(kappa);
      double rgb[3] = { 1., 1., 1. };
      if (style->GetShadingColors())
      {
        style->GetShadingColors()->GetColor(kappa, rgb);
      }
      for (const double c : rgb)
      {
        shading.push_back(static_cast<float>(factor * c));
      }
      shading.push_back(
        static_cast<float>(style->GetShadingFunction()->GetValue(kappa + 2. / (Shades - 1))));
    }
    vtkNew<vtkImageData> table;
    style->GetOpacityFunction()->ExportTable(table, Opacities, Opacities);
    const auto* values = static_cast<const float*>(table->GetScalarPointer());
    for (int y = 0; y + 1 < Opacities; ++y)
    {
      for (int x = 0; x + 1 < Opacities; ++x)
      {
        const float* corner = values + y * Opacities + x;
        opacity.insert(
          opacity.end(), { corner[0], corner[1], corner[Opacities], corner[Opacities + 1] });
      }
    }
    const auto row = style->GetParameters();
    parameters.insert(parameters.end(), row.begin(), row.end());
  }
  this->ShadingTable.Upload(shading);
  this->OpacityTable.Upload(opacity);
  this->ParameterTable.Upload(parameters);
}

//------------------------------------------------------------------------------
/** For rows low to high - 1: empty lists, and a target for nothing but the lists. */
void KBuffer::BeginGeometry(int low, int high)
{
  vtkOpenGLState* state = this->Window->GetState();
  const vtkTypeInt64 width = this->Now.size[0];
  this->Rows = { low, high };
  this->Heads.Fill(low * width * 4, (high - low) * width * 4, EndOfList);
  this->Counter.Fill(4 * FragmentsListed, 4, 0);
  this->Counter.Fill(4 * FirstNodeCounter, 4 * (NumberOfCounters - FirstNodeCounter), 0);
  this->Heads.BindImage(0, GL_R32UI);
  this->Links.BindImage(1, GL_RG32UI);
  this->Colors.BindImage(2, this->ColorFormat());
  if (this->Now.style)
  {
    this->Surfaces.BindImage(3, GL_RG32UI);
  }
  this->Counter.BindImage(4, GL_R32UI);
  state->PushFramebufferBindings();
  this->GeometryTarget->Bind();
  this->GeometryTarget->ActivateDrawBuffers(1);
  state->vtkglViewport(0, 0, this->Now.size[0], this->Now.size[1]);
  state->vtkglEnable(GL_SCISSOR_TEST);
  state->vtkglScissor(0, low, this->Now.size[0], high - low);
  this->ResetMasks();
  this->OpaqueDepth->Activate();
}

//------------------------------------------------------------------------------
void KBuffer::ResetMasks()
{
  vtkOpenGLState* state = this->Window->GetState();
  state->vtkglDisable(GL_DEPTH_TEST);
  state->vtkglDisable(GL_BLEND);
  state->vtkglDepthMask(GL_FALSE);
  state->vtkglColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
}

//------------------------------------------------------------------------------
void KBuffer::BeginVolume()
{
  vtkOpenGLState* state = this->Window->GetState();
  glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
  // The mapper copies the depth from what is bound for reading, and draws its box.
  this->DepthTarget->Bind(vtkOpenGLFramebufferObject::GetReadMode());
  state->vtkglEnable(GL_CULL_FACE);
  state->vtkglCullFace(GL_BACK);
}

//------------------------------------------------------------------------------
void KBuffer::EndGeometry()
{
  this->OpaqueDepth->Deactivate();
  this->Window->GetState()->PopFramebufferBindings();
  glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT |
    GL_TEXTURE_FETCH_BARRIER_BIT);
  this->Fragments = 0;
  this->NodesAsked = 0;
  for (int i = 0; i < NodeCounters; ++i)
  {
    const vtkTypeInt64 asked = this->Counter.Read(FirstNodeCounter * (1 + i));
    this->Fragments += asked;
    const vtkTypeInt64 turns = (asked + NodesInTurn - 1) / NodesInTurn;
    this->NodesAsked = std::max(this->NodesAsked, turns * NodesInTurn * NodeCounters);
  }
}

//------------------------------------------------------------------------------
/** For rows low to high - 1; what went wrong, or empty. */
std::string KBuffer::OrderAndMatch(int low, int high)
{
  const vtkTypeInt64 listed = std::max<vtkTypeInt64>(this->Fragments, 1);
  this->Records.Reserve(listed * 8);
  this->NodeList.Reserve(listed * 4);
  this->Buckets.Reserve(listed * 4);
  this->Window->GetShaderCache()->ReleaseCurrentShader();
  this->Pixels.BindImage(0, GL_RGBA32UI);
  this->Records.BindImage(1, GL_RG32UI);
  this->NodeList.BindImage(2, GL_R32UI);
  this->Buckets.BindImage(3, GL_R32UI);
  this->Counter.BindImage(4, GL_R32UI);
  const std::string head = "#version 430 core\n" + this->Defines(this->Room()) +
    sortingNetwork(this->Room()) + define("LT_DENSE", this->Dense()) +
    define("LT_SINGLE_BUCKET", this->Now.singleBucket) + vtkBucketedKBufferRead +
    vtkBucketedKBufferPixel;
  const auto run = [&](ComputeProgram& program, int stage, const std::string& body)
  {
    std::string problem = program.Use(head + body);
    if (problem.empty())
    {
      const Uniforms uniforms(program);
      this->BindForReading(uniforms);
      this->SetGeometry(uniforms);
      uniforms.Set("ltLayers", this->Now.layers);
      glDispatchCompute(
        static_cast<GLuint>((this->Now.size[0] + 63) / 64), static_cast<GLuint>(high - low), 1);
      glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT |
        GL_BUFFER_UPDATE_BARRIER_BIT);
      this->FreeUnits();
    }
    glUseProgram(0);
    this->Mark(stage);
    return problem;
  };
  std::string problem = run(
    this->Order[this->Dense()], 3, std::string(vtkBucketedKBufferList) + vtkBucketedKBufferOrder);
  if (problem.empty())
  {
    // The lists have been read: their place is the neighbours'.
    this->Links.Fill(0, this->Fragments * 4, 0);
    this->Links.BindImage(5, GL_R8UI);
    problem = run(this->Match, 4, vtkBucketedKBufferMatch);
  }
  if (problem.empty() && this->Now.lines)
  {
    this->Tensors.Reserve(listed * 16);
    this->SmoothTensors.Reserve(listed * 16);
    this->LatestTensors = &this->Tensors;
    this->Tensors.BindImage(0, GL_RGBA32UI);
    problem =
      run(this->Tensor, 4, std::string(vtkBucketedKBufferCurvature) + vtkBucketedKBufferTensor);
    for (int i = 0; i < this->Now.smoothing && problem.empty(); ++i)
    {
      TexelBuffer* next =
        this->LatestTensors == &this->Tensors ? &this->SmoothTensors : &this->Tensors;
      next->BindImage(0, GL_RGBA32UI);
      problem =
        run(this->Smooth, 4, std::string(vtkBucketedKBufferCurvature) + vtkBucketedKBufferSmooth);
      this->LatestTensors = next;
    }
  }
  return problem;
}

//------------------------------------------------------------------------------
/** Rows first to last - 1 of the picture; false where the shader was not built. */
bool KBuffer::Blend(int first, int last)
{
  vtkOpenGLState* state = this->Window->GetState();
  const int* size = this->Now.size;
  const int* origin = this->Now.origin;
  this->Counter.BindImage(4, GL_R32UI);
  std::unique_ptr<vtkOpenGLQuadHelper>& quad = this->Quads[this->Dense()];
  const std::string key = this->Defines(this->Room()) +
    define("LT_READ_TARGET", this->Now.into.plain) + define("LT_SHADE", this->Now.shade) +
    define("LT_OPACITY", this->Now.opacity) + define("LT_RADIANCE", this->Now.radiance) +
    define("LT_DENSE", this->Dense()) + define("LT_WRITE_DEPTH", this->Now.writeDepth) +
    define("LT_ONE_STYLE", this->Styles.size() == 1) +
    define("LT_SHADE_COLORS", this->Now.shadeColors);
  if (!quad || this->QuadKeys[this->Dense()] != key)
  {
    const std::string body = this->Now.style
      ? std::string(vtkBucketedKBufferPixel) + std::string(vtkBucketedKBufferCurvature) +
        (this->Now.lines ? vtkBucketedKBufferLines : "") + vtkBucketedKBufferStyle
      : std::string(vtkBucketedKBufferList) + vtkBucketedKBufferBlend;
    const std::string source = std::string("//VTK::System::Dec\n") + vtkBucketedKBufferExtensions +
      "//VTK::Output::Dec\n" + key + sortingNetwork(this->Room()) + vtkBucketedKBufferRead + body;
    quad = std::make_unique<vtkOpenGLQuadHelper>(this->Window, nullptr, source.c_str(), nullptr);
    this->QuadKeys[this->Dense()] = key;
  }
  else
  {
    this->Window->GetShaderCache()->ReadyShaderProgram(quad->Program);
  }
  vtkShaderProgram* program = quad->Program;
  if (!program)
  {
    return false;
  }
  state->vtkglViewport(origin[0], origin[1], size[0], size[1]);
  state->vtkglEnable(GL_SCISSOR_TEST);
  state->vtkglScissor(origin[0], origin[1] + first, size[0], last - first);
  state->vtkglDisable(GL_CULL_FACE);
  state->vtkglColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  state->vtkglBlendFuncSeparate(GL_ONE, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE_MINUS_SRC_ALPHA);

  const Uniforms uniforms(program);
  std::vector<vtkTextureObject*> textures;
  const auto activate = [&](const char* name, vtkTextureObject* texture)
  {
    texture->Activate();
    uniforms.Set(name, texture->GetTextureUnit());
    textures.push_back(texture);
  };
  if (this->Now.into.plain)
  {
    // Blending in 8 bits would round more than once.
    state->vtkglDisable(GL_BLEND);
    activate("ltTarget", this->TargetColor);
  }
  else
  {
    state->vtkglEnable(GL_BLEND);
  }
  this->BindForReading(uniforms);
  this->SetGeometry(uniforms);
  uniforms.Set("ltLayers", this->Now.layers);
  if (this->Now.style)
  {
    uniforms.Set("ltCurvatureScale", static_cast<float>(this->Now.curvatureScale));
    uniforms.Set("ltDepthRange", this->DepthRange);
    if (this->Now.writeDepth)
    {
      activate("ltOpaqueDepth", this->OpaqueDepth);
      state->vtkglEnable(GL_DEPTH_TEST);
      state->vtkglDepthFunc(GL_ALWAYS);
      state->vtkglDepthMask(GL_TRUE);
    }
  }
  quad->Render();
  for (vtkTextureObject* texture : textures)
  {
    texture->Deactivate();
  }
  this->FreeUnits();
  return true;
}

//------------------------------------------------------------------------------
void KBuffer::Mark(int stage)
{
  if (this->Measure)
  {
    glFinish();
    const auto now = std::chrono::steady_clock::now();
    this->Milliseconds[stage] +=
      std::chrono::duration<double, std::milli>(now - this->LastMark).count();
    this->LastMark = now;
  }
}

//------------------------------------------------------------------------------
void KBuffer::Unbind()
{
  for (GLuint unit = 0; unit < 6; ++unit)
  {
    glBindImageTexture(unit, 0, 0, GL_FALSE, 0, GL_READ_ONLY, GL_R32UI);
  }
  glBindBuffer(GL_TEXTURE_BUFFER, 0);
}
} // namespace lighttransport
