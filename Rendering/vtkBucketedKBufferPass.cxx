// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBucketedKBufferPass.h"

#include "KBuffer.h"
#include "vtkBucketedKBufferData.h"
#include "vtkBucketedKBufferExtensions.h"
#include "vtkBucketedKBufferFlatNormal.h"
#include "vtkBucketedKBufferStore.h"
#include "vtkBucketedKBufferVolumeDec.h"
#include "vtkBucketedKBufferVolumeSample.h"
#include "vtkCurvatureOpacityPolyDataMapper.h"
#include "vtkCurvatureOpacityProperty.h"

#include "vtkCompositeDataSet.h"
#include "vtkDualDepthPeelingPass.h"
#include "vtkInformation.h"
#include "vtkInformationIntegerKey.h"
#include "vtkMapper.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkOpenGLActor.h"
#include "vtkOpenGLError.h"
#include "vtkOpenGLGPUVolumeRayCastMapper.h"
#include "vtkOpenGLHelper.h"
#include "vtkOpenGLPolyDataMapper.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkOpenGLRenderer.h"
#include "vtkOpenGLState.h"
#include "vtkPolyData.h"
#include "vtkProp.h"
#include "vtkPropCollection.h"
#include "vtkProperty.h"
#include "vtkRenderState.h"
#include "vtkRenderStepsPass.h"
#include "vtkShaderProgram.h"
#include "vtkSmartPointer.h"
#include "vtkTextureObject.h"
#include "vtkTranslucentPass.h"
#include "vtkVersion.h"
#include "vtkVolume.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <unordered_map>
#include <vector>

using lighttransport::KBuffer;

namespace
{
constexpr int MostShapes = 1 << 24;
constexpr std::size_t MostStyles = 255;

/** Set without vtkObject::Modified, which an application may answer by rendering again. */
struct ActorAccess : vtkActor
{
  static void setForceTranslucent(vtkActor* actor, bool on)
  {
    actor->*(&ActorAccess::ForceTranslucent) = on;
  }
};

struct MapperAccess : vtkOpenGLPolyDataMapper
{
  /** Whether lines or points are being drawn. */
  static bool drawsThin(vtkOpenGLPolyDataMapper* mapper)
  {
    const vtkOpenGLHelper* drawn = mapper->*(&MapperAccess::LastBoundBO);
    return drawn && drawn->PrimitiveType != PrimitiveTris &&
      drawn->PrimitiveType != PrimitiveTriStrips;
  }
};
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
  vtkSmartPointer<vtkCurvatureOpacityProperty> Property =
    vtkSmartPointer<vtkCurvatureOpacityProperty>::New();
  vtkNew<vtkRenderStepsPass> Steps;
  vtkNew<vtkTranslucentStep> Step;
  vtkSmartPointer<vtkDualDepthPeelingPass> Fallback;
  std::string Told; // the reason for the fallback, once told

  KBuffer Buffer;
  std::unordered_map<vtkProp*, int> Shapes; // first shape of a prop
  int NextShape = 0;
  std::string FailedTag;
  vtkTypeInt64 Merged = 0; // -1: to be read

  vtkSmartPointer<vtkRenderPass> VolumetricPass; // of the steps, VTK's
  std::vector<vtkProp*> Volumes;                 // that are drawn among the surfaces, this frame
  std::vector<vtkActor*> Taken;                  // opaque ones that are stylised, this frame
  std::vector<vtkProp*> Strangers;               // of these, whose shaders are not ours
  int Shadings = 0;                              // calls of SetShaderParameters
  int Rendered = 0;                              // props, in the geometry stage

  // between frames
  int Bands = 1;
  std::string ShaderKey;
  vtkTimeStamp ShaderTime;

  void Release(vtkWindow* window)
  {
    this->Buffer.Release(window);
    this->Merged = std::max<vtkTypeInt64>(this->Merged, 0);
  }
  void FindShapes(vtkProp** props, int count);
  void FindVolumes(vtkProp** props, int count);
  void TakeOpaque(vtkProp** props, int count);
  void GiveBackOpaque();
  void DrawGeometry(const vtkRenderState* s, bool first);
};

vtkStandardNewMacro(vtkBucketedKBufferPass::vtkTranslucentStep);
vtkStandardNewMacro(vtkBucketedKBufferPass);

//------------------------------------------------------------------------------
/** Numbers for the shapes of all actors, and the styles in use. */
void vtkBucketedKBufferPass::vtkInternals::FindShapes(vtkProp** props, int count)
{
  KBuffer& buffer = this->Buffer;
  this->Shapes.clear();
  this->NextShape = 0;
  buffer.Styles.assign(1, this->Property);
  vtkNew<vtkPropCollection> actors;
  for (int i = 0; i < count; ++i)
  {
    props[i]->GetActors(actors);
  }
  vtkCollectionSimpleIterator it;
  actors->InitTraversal(it);
  while (vtkProp* prop = actors->GetNextProp(it))
  {
    auto* actor = vtkActor::SafeDownCast(prop);
    vtkMapper* mapper = actor ? actor->GetMapper() : nullptr;
    vtkIdType shapes = 1;
    if (auto* own = vtkCurvatureOpacityPolyDataMapper::SafeDownCast(mapper))
    {
      vtkCurvatureOpacityProperty* property = own->GetCurvatureOpacityProperty();
      if (std::find(buffer.Styles.begin(), buffer.Styles.end(), property) == buffer.Styles.end() &&
        buffer.Styles.size() < MostStyles)
      {
        buffer.Styles.emplace_back(property);
      }
      // The array is looked at when it is drawn: no more shapes than cells.
      if (!own->GetShapeIdArray().empty() && own->GetInput())
      {
        shapes = own->GetInput()->GetNumberOfCells();
      }
    }
    else if (mapper)
    {
      // A block's shape is the number of its first cell; see PostReplaceShaderValues.
      if (auto* blocks = vtkCompositeDataSet::SafeDownCast(mapper->GetInputDataObject(0, 0)))
      {
        shapes = blocks->GetNumberOfCells();
      }
    }
    this->Shapes[prop] = this->NextShape;
    shapes = std::min<vtkIdType>(std::max<vtkIdType>(shapes, 1), MostShapes - 1);
    this->NextShape = (this->NextShape + static_cast<int>(shapes)) % MostShapes;
  }
  KBuffer::Settings& now = buffer.Now;
  now.style = now.lines = now.shade = now.shadeColors = now.opacity = now.radiance = false;
  for (const auto& style : buffer.Styles)
  {
    now.style = now.style || style->HasEffect();
    now.lines = now.lines || style->HasLines();
    now.shade = now.shade || style->GetCurvatureShading();
    now.shadeColors = now.shadeColors || style->GetShadingColors();
    now.opacity = now.opacity || style->GetCurvatureOpacity();
    now.radiance = now.radiance || style->GetRadianceScaling() > 0.;
  }
}

//------------------------------------------------------------------------------
/** The volumes, if there are surfaces to be among and all of their mappers can do it. */
void vtkBucketedKBufferPass::vtkInternals::FindVolumes(vtkProp** props, int count)
{
  this->Volumes.clear();
  bool all = std::any_of(props, props + count,
    [](vtkProp* prop) { return prop->HasTranslucentPolygonalGeometry() != 0; });
  for (int i = 0; all && i < count; ++i)
  {
    if (auto* volume = vtkVolume::SafeDownCast(props[i]))
    {
      auto* mapper = vtkOpenGLGPUVolumeRayCastMapper::SafeDownCast(volume->GetMapper());
      all = mapper && mapper->GetImageSampleDistance() == 1.F && !mapper->GetRenderToImage() &&
        !mapper->GetUseDepthPass();
      this->Volumes.push_back(volume);
    }
  }
  if (!all)
  {
    this->Volumes.clear();
  }
}

//------------------------------------------------------------------------------
/** Opaque surfaces of a style with effect are drawn as layers in this frame. */
void vtkBucketedKBufferPass::vtkInternals::TakeOpaque(vtkProp** props, int count)
{
  vtkNew<vtkPropCollection> actors;
  for (int i = 0; i < count; ++i)
  {
    props[i]->GetActors(actors);
  }
  vtkCollectionSimpleIterator it;
  actors->InitTraversal(it);
  while (vtkProp* prop = actors->GetNextProp(it))
  {
    auto* actor = vtkActor::SafeDownCast(prop);
    vtkMapper* mapper = actor ? actor->GetMapper() : nullptr;
    if (!mapper || actor->GetForceOpaque() || actor->GetForceTranslucent() ||
      actor->GetProperty()->GetRepresentation() != VTK_SURFACE || !actor->HasOpaqueGeometry() ||
      actor->HasTranslucentPolygonalGeometry())
    {
      continue;
    }
    auto* own = vtkCurvatureOpacityPolyDataMapper::SafeDownCast(mapper);
    const bool styled =
      (own ? own->GetCurvatureOpacityProperty() : this->Property.Get())->HasEffect();
    auto* data = vtkPolyData::SafeDownCast(mapper->GetInputDataObject(0, 0));
    if (styled && (!data || data->GetNumberOfPolys() + data->GetNumberOfStrips() > 0))
    {
      ActorAccess::setForceTranslucent(actor, true);
      this->Taken.push_back(actor);
    }
  }
}

//------------------------------------------------------------------------------
void vtkBucketedKBufferPass::vtkInternals::GiveBackOpaque()
{
  for (vtkActor* actor : this->Taken)
  {
    ActorAccess::setForceTranslucent(actor, false);
  }
  this->Taken.clear();
}

//------------------------------------------------------------------------------
/**
 * Props of other classes than vtkActor's are drawn one by one at first: where none of our
 * shaders is used, the prop gives its parts no property keys, and VTK has to draw it.
 */
void vtkBucketedKBufferPass::vtkInternals::DrawGeometry(const vtkRenderState* s, bool first)
{
  std::vector<vtkProp*> props;
  std::vector<vtkProp*> single;
  for (int i = 0; i < s->GetPropArrayCount(); ++i)
  {
    vtkProp* prop = s->GetPropArray()[i];
    const bool known =
      prop->IsA("vtkAssembly") || !std::strcmp(prop->GetClassName(), "vtkOpenGLActor");
    if (first && !known && prop->HasTranslucentPolygonalGeometry())
    {
      single.push_back(prop);
    }
    else if (std::find(this->Strangers.begin(), this->Strangers.end(), prop) ==
      this->Strangers.end())
    {
      props.push_back(prop);
    }
  }
  vtkRenderState some(s->GetRenderer());
  some.SetFrameBuffer(s->GetFrameBuffer());
  some.SetRequiredKeys(s->GetRequiredKeys());
  some.SetPropArrayAndCount(props.data(), static_cast<int>(props.size()));
  this->TranslucentPass->Render(&some);
  int rendered = this->TranslucentPass->GetNumberOfRenderedProps();
  for (vtkProp* prop : single)
  {
    this->Buffer.ResetMasks();
    some.SetPropArrayAndCount(&prop, 1);
    const int before = this->Shadings;
    this->TranslucentPass->Render(&some);
    const int drawn = this->TranslucentPass->GetNumberOfRenderedProps();
    rendered += drawn;
    if (drawn > 0 && this->Shadings == before)
    {
      this->Strangers.push_back(prop);
    }
  }
  this->Rendered = rendered;
}

//------------------------------------------------------------------------------
vtkBucketedKBufferPass::vtkBucketedKBufferPass()
  : Internals(new vtkInternals)
{
  this->Internals->Step->Owner = this;
  this->Internals->Steps->SetTranslucentPass(this->Internals->Step);
  this->Internals->VolumetricPass = this->Internals->Steps->GetVolumetricPass();
  this->SetActiveDrawBuffers(1);
}

//------------------------------------------------------------------------------
vtkBucketedKBufferPass::~vtkBucketedKBufferPass()
{
  vtkInternals& self = *this->Internals;
  if (self.Buffer.Window)
  {
    self.Buffer.Window->MakeCurrent();
    self.Release(self.Buffer.Window);
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
void vtkBucketedKBufferPass::SetCurvatureOpacityProperty(vtkCurvatureOpacityProperty* property)
{
  vtkInternals& self = *this->Internals;
  if (!property || self.Property != property)
  {
    self.Property = property;
    if (!property)
    {
      self.Property = vtkSmartPointer<vtkCurvatureOpacityProperty>::New();
    }
    this->Modified();
  }
}

//------------------------------------------------------------------------------
vtkCurvatureOpacityProperty* vtkBucketedKBufferPass::GetCurvatureOpacityProperty()
{
  return this->Internals->Property;
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
  vtkInternals& self = *this->Internals;
  self.TakeOpaque(s->GetPropArray(), s->GetPropArrayCount());
  self.FindVolumes(s->GetPropArray(), s->GetPropArrayCount());
  if (self.Volumes.empty() &&
    std::any_of(s->GetPropArray(), s->GetPropArray() + s->GetPropArrayCount(),
      [](vtkProp* prop) { return prop->IsA("vtkVolume"); }))
  {
    // VTK draws the volumes after all layers, in front of what is opaque.
    self.GiveBackOpaque();
  }
  self.Steps->SetVolumetricPass(self.Volumes.empty() ? self.VolumetricPass.Get() : nullptr);
  self.Steps->Render(s);
  self.Volumes.clear();
  self.GiveBackOpaque();
  this->NumberOfRenderedProps = self.Steps->GetNumberOfRenderedProps();
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
  self.Fallback->SetVolumetricPass(self.Volumes.empty() ? nullptr : self.VolumetricPass.Get());
  self.Fallback->SetMaximumNumberOfPeels(this->NumberOfLayers);
  self.Fallback->SetOcclusionRatio(0.);
  self.Fallback->Render(s);
  this->NumberOfRenderedProps = self.Fallback->GetNumberOfRenderedProps();
}

//------------------------------------------------------------------------------
void vtkBucketedKBufferPass::RenderTranslucent(const vtkRenderState* s)
{
  vtkInternals& self = *this->Internals;
  KBuffer& buffer = self.Buffer;
  KBuffer::Settings& now = buffer.Now;
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
  if (buffer.Window != window)
  {
    if (buffer.Window)
    {
      buffer.Window->MakeCurrent();
      self.Release(buffer.Window);
      window->MakeCurrent();
    }
    buffer.Window = window;
  }
  vtkOpenGLClearErrorMacro();
  if (s->GetFrameBuffer() == nullptr)
  {
    renderer->GetTiledSizeAndOrigin(&now.size[0], &now.size[1], &now.origin[0], &now.origin[1]);
  }
  else
  {
    s->GetWindowSize(now.size);
    now.origin[0] = 0;
    now.origin[1] = 0;
  }
  if (now.size[0] < 1 || now.size[1] < 1)
  {
    return;
  }
  self.FindShapes(props, numberOfProps);
  const std::string whyNot = buffer.WhyNot();
  if (!whyNot.empty())
  {
    this->RenderFallback(s, whyNot);
    return;
  }
  now.layers = this->NumberOfLayers;
  now.writeDepth = !self.Taken.empty();
  self.Strangers.clear();
  now.floatColor = this->ColorPrecision == Float;
  now.singleBucket = this->SingleBucket;
  now.smoothing = this->LineSmoothing;
  now.into = lighttransport::PictureTarget::Bound();
  if (now.style)
  {
    buffer.SetCamera(renderer, props, numberOfProps);
    now.curvatureScale =
      this->CurvatureScale > 0. ? this->CurvatureScale : buffer.SceneLength / 40.;
  }
  const std::string shaderKey =
    buffer.Defines(1) + (self.Volumes.empty() ? "" : std::to_string(now.layers));
  if (self.ShaderKey != shaderKey)
  {
    self.ShaderKey = shaderKey;
    self.ShaderTime.Modified();
  }

  {
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
    vtkOpenGLState::ScopedglDepthFunc depthFuncSaver(state);
    vtkOpenGLState::ScopedglColorMask colorMaskSaver(state);
    state->vtkglDisable(GL_MULTISAMPLE);

    // 1. what is there already
    buffer.Measure = this->MeasureStages;
    buffer.Milliseconds.fill(0.);
    buffer.Mark(0);
    buffer.CopyTarget();
    buffer.Mark(1);
    const vtkTypeInt64 most = buffer.MostNodes(this->MemoryLimit);
    if (buffer.Capacity > most)
    {
      buffer.ReleaseNodes();
    }
    buffer.ReserveNodes(std::min(
      most, std::max(buffer.Capacity, vtkTypeInt64(now.size[0]) * now.size[1] * 2 + 1024)));

    for (int i = 0; i < numberOfProps; ++i)
    {
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
    const int startBands = std::min(self.Bands, now.size[1]);
    for (int b = startBands; b > 0; --b)
    {
      bands.push_back({ static_cast<int>(vtkTypeInt64(now.size[1]) * (b - 1) / startBands),
        static_cast<int>(vtkTypeInt64(now.size[1]) * b / startBands) });
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
    self.Bands = std::max(this->NumberOfBands, 1);
    self.Merged = -1;

    this->PostRender(s);
    for (int i = 0; i < numberOfProps; ++i)
    {
      props[i]->GetPropertyKeys()->Remove(vtkOpenGLActor::GLDepthMaskOverride());
    }
    buffer.Unbind();
  }
  if (!self.Strangers.empty())
  {
    vtkRenderState others(renderer);
    others.SetFrameBuffer(s->GetFrameBuffer());
    others.SetRequiredKeys(s->GetRequiredKeys());
    others.SetPropArrayAndCount(self.Strangers.data(), static_cast<int>(self.Strangers.size()));
    self.TranslucentPass->Render(&others);
  }
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
  KBuffer& buffer = this->Internals->Buffer;
  vtkInternals& self = *this->Internals;
  // More rows on either side, for neighbours, and for the neighbours' neighbours.
  const int around = buffer.Now.style ? (buffer.Now.lines ? 2 + buffer.Now.smoothing : 1) : 0;
  const int low = std::max(first - around, 0);
  const int high = std::min(last + around, buffer.Now.size[1]);

  // 2. geometry
  while (true)
  {
    buffer.BeginGeometry(low, high);
    self.DrawGeometry(s, this->NumberOfGeometryPasses == 0);
    for (vtkProp* volume : this->Internals->Volumes)
    {
      buffer.BeginVolume();
      volume->RenderVolumetricGeometry(s->GetRenderer());
    }
    buffer.EndGeometry();
    ++this->NumberOfGeometryPasses;
    const vtkTypeInt64 nodes = buffer.NodesAsked;
    if (nodes <= buffer.Capacity)
    {
      break;
    }
    const vtkTypeInt64 most = buffer.MostNodes(this->MemoryLimit);
    if (nodes <= most)
    {
      buffer.ReserveNodes(std::min(most, nodes + nodes / 8));
    }
    else if (last - first > 1)
    {
      return false;
    }
    else
    {
      vtkErrorMacro("A row of " << buffer.Now.size[0] << " pixels has " << buffer.Fragments
                                << " fragments, more than MemoryLimit or the GPU has room for ("
                                << buffer.Capacity << "); some are left out.");
      buffer.Fragments = std::min(buffer.Fragments, buffer.Capacity);
      break;
    }
  }
  this->NumberOfFragments += buffer.Fragments;
  buffer.Mark(2);
  this->NumberOfRenderedProps = self.Rendered;

  // 3. order, 4. neighbours, 5. blending
  if (buffer.Now.style)
  {
    const std::string problem = buffer.OrderAndMatch(low, high);
    if (!problem.empty())
    {
      vtkErrorMacro("A compute shader " << problem);
      return true;
    }
  }
  buffer.Blend(first, last); // where its shader isn't built, VTK says why
  buffer.Mark(5);
  return true;
}

//------------------------------------------------------------------------------
// Volumes: VTK's tags are still there.
bool vtkBucketedKBufferPass::PreReplaceShaderValues(std::string& /*vertexShader*/,
  std::string& /*geometryShader*/, std::string& fragmentShader, vtkAbstractMapper* mapper,
  vtkProp* /*prop*/)
{
  if (!vtkVolumeMapper::SafeDownCast(mapper))
  {
    return true;
  }
  vtkInternals& self = *this->Internals;
  const std::string room = std::to_string(self.Buffer.Now.layers);
  const std::string store = "\nltStoreSegment(in_scale, in_bias);\n";
  const std::string parts[5][3] = {
    { "//VTK::System::Dec", "", std::string("\n") + vtkBucketedKBufferExtensions },
    { "//VTK::ComputeLighting::Dec",
      self.Buffer.Defines(1) + "#define LT_VOLUME_SURFACES " + room + "\n" +
        vtkBucketedKBufferData + vtkBucketedKBufferStore + vtkBucketedKBufferVolumeDec,
      "" },
    { "//VTK::Shading::Init", "", "\nltFindSurfaces();\n" },
    { "//VTK::Shading::Impl", vtkBucketedKBufferVolumeSample, "" },
    { "//VTK::Shading::Exit", "", store },
  };
  for (const auto& part : parts)
  {
    if (!vtkShaderProgram::Substitute(fragmentShader, part[0], part[1] + part[0] + part[2], false))
    {
      self.FailedTag = part[0];
    }
  }
  return true;
}

//------------------------------------------------------------------------------
bool vtkBucketedKBufferPass::PostReplaceShaderValues(std::string& /*vertexShader*/,
  std::string& /*geometryShader*/, std::string& fragmentShader, vtkAbstractMapper* mapper,
  vtkProp* /*prop*/)
{
  if (vtkVolumeMapper::SafeDownCast(mapper))
  {
    return true;
  }
  vtkInternals& self = *this->Internals;
  const auto substitute = [&](const char* tag, const std::string& with)
  {
    if (!vtkShaderProgram::Substitute(fragmentShader, tag, with, false))
    {
      self.FailedTag = tag;
    }
  };
  std::string declarations =
    self.Buffer.Defines(1) + vtkBucketedKBufferData + vtkBucketedKBufferStore;
  // Within the prop: a value of an array, or a composite's block, known by its first cell.
  std::string shape = "0u";
  std::string normal = "LT_NO_NORMAL";
  if (self.Buffer.Now.style)
  {
    auto* own = vtkCurvatureOpacityPolyDataMapper::SafeDownCast(mapper);
    if (own && own->HasShapeIds())
    {
      declarations += "uniform samplerBuffer ltShapeIds;\n";
      shape = "uint(texelFetch(ltShapeIds, gl_PrimitiveID + PrimitiveIDOffset).x)";
    }
    else if (mapper->IsA("vtkCompositeMapperHelper2"))
    {
      shape = "uint(PrimitiveIDOffset)";
    }
    if (fragmentShader.find("vec3 normalVCVSOutput = ") != std::string::npos)
    {
      normal = "ltOutwardNormal(normalVCVSOutput)"; // VTK has turned it to the eye
    }
    else
    {
      // Not lit: VTK makes no normal.
      declarations += vtkBucketedKBufferFlatNormal;
      substitute(
        "//VTK::UniformFlow::Impl", "vec3 ltFlat = ltFlatNormal();\n//VTK::UniformFlow::Impl");
      normal = "ltOutwardNormal(ltFlat)";
    }
  }
  substitute(
    "//VTK::System::Dec", std::string("//VTK::System::Dec\n") + vtkBucketedKBufferExtensions);
  substitute("//VTK::DepthPeeling::Dec", declarations);
  // Where the mapper has set the depth itself, the tag is gone.
  vtkShaderProgram::Substitute(
    fragmentShader, "//VTK::Depth::Impl", "gl_FragDepth = gl_FragCoord.z;\n", false);
  substitute("//VTK::DepthPeeling::Impl",
    "ltStore(gl_FragData[0], gl_FragDepth, " + shape + ", " + normal + ");\n");
  return true;
}

//------------------------------------------------------------------------------
bool vtkBucketedKBufferPass::SetShaderParameters(vtkShaderProgram* program,
  vtkAbstractMapper* mapper, vtkProp* prop, vtkOpenGLVertexArrayObject* /*VAO*/)
{
  vtkInternals& self = *this->Internals;
  KBuffer& buffer = self.Buffer;
  buffer.OpaqueDepth->Activate(); // a volume's uploads may have bound another one here
  program->SetUniformi("ltOpaqueDepth", buffer.OpaqueDepth->GetTextureUnit());
  program->SetUniformi("ltWidth", buffer.Now.size[0]);
  program->SetUniformi("ltCapacity", static_cast<int>(buffer.Capacity));

  ++self.Shadings;
  auto* polyData = vtkOpenGLPolyDataMapper::SafeDownCast(mapper);
  auto* actor = vtkActor::SafeDownCast(prop);
  const bool thin = (actor && actor->GetProperty()->GetRepresentation() != VTK_SURFACE) ||
    (polyData && MapperAccess::drawsThin(polyData));
  program->SetUniformi("ltThin", thin ? 1 : 0);
  if (!buffer.Now.style)
  {
    return true;
  }
  if (vtkVolumeMapper::SafeDownCast(mapper))
  {
    // Of no surface; without a normal nothing is styled.
    program->SetUniformi("ltStyle", 0);
    program->SetUniformi("ltShape", MostShapes - 1);
    return true;
  }
  unsigned int style = 0;
  if (auto* own = vtkCurvatureOpacityPolyDataMapper::SafeDownCast(mapper))
  {
    own->SetShapeIds(program);
    const auto found =
      std::find(buffer.Styles.begin(), buffer.Styles.end(), own->GetCurvatureOpacityProperty());
    style =
      found == buffer.Styles.end() ? 0 : static_cast<unsigned int>(found - buffer.Styles.begin());
  }
  auto shape = self.Shapes.find(prop);
  if (shape == self.Shapes.end())
  {
    shape = self.Shapes.emplace(prop, self.NextShape).first;
    self.NextShape = (self.NextShape + 1) % MostShapes;
  }
  program->SetUniformi("ltStyle", static_cast<int>(style));
  program->SetUniformi("ltShape", shape->second);
  if (program->IsUniformUsed("ltDCToVC"))
  {
    program->SetUniformMatrix("ltDCToVC", buffer.DCToVC);
    const float viewport[2] = { static_cast<float>(buffer.Now.size[0]),
      static_cast<float>(buffer.Now.size[1]) };
    program->SetUniform2f("ltViewport", viewport);
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
    if (self.Buffer.Window)
    {
      self.Buffer.Window->MakeCurrent();
      glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
      self.Merged = self.Buffer.Counter.Read(KBuffer::FragmentsMerged);
      glBindBuffer(GL_TEXTURE_BUFFER, 0);
    }
  }
  return self.Merged;
}

//------------------------------------------------------------------------------
vtkTypeInt64 vtkBucketedKBufferPass::GetMemoryInBytes()
{
  return this->Internals->Buffer.Bytes();
}

//------------------------------------------------------------------------------
double vtkBucketedKBufferPass::GetStageMilliseconds(int stage)
{
  return stage >= 1 && stage <= 5 ? this->Internals->Buffer.Milliseconds[stage] : 0.;
}

//------------------------------------------------------------------------------
int vtkBucketedKBufferPass::GetBitsPerFragment()
{
  return this->Internals->Buffer.BitsPerFragment();
}

//------------------------------------------------------------------------------
void vtkBucketedKBufferPass::ReleaseGraphicsResources(vtkWindow* window)
{
  vtkInternals& self = *this->Internals;
  if (self.Buffer.Window && self.Buffer.Window == window)
  {
    self.Buffer.Window->MakeCurrent();
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
  os << indent << "CurvatureScale: " << this->CurvatureScale << "\n";
  os << indent << "MeasureStages: " << this->MeasureStages << "\n";
  os << indent << "LineSmoothing: " << this->LineSmoothing << "\n";
  os << indent << "SingleBucket: " << this->SingleBucket << "\n";
  os << indent << "NumberOfFragments: " << this->NumberOfFragments << "\n";
  os << indent << "NumberOfBands: " << this->NumberOfBands << "\n";
  os << indent << "NumberOfGeometryPasses: " << this->NumberOfGeometryPasses << "\n";
  os << indent << "UsedFallback: " << this->UsedFallback << "\n";
  os << indent << "TranslucentPass: " << this->Internals->TranslucentPass.Get() << "\n";
  os << indent << "CurvatureOpacityProperty:\n";
  this->Internals->Property->PrintSelf(os, indent.GetNextIndent());
}
