// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightTransportPolyDataMapper.h"

#include "VolumeExtinction.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportCompat.h"
#include "vtkLightTransportPolyDataMapperVisibility.h"
#include "vtkVisibilityFactorFilter.h"

#include "vtkActor.h"
#include "vtkAlgorithm.h"
#include "vtkAlgorithmOutput.h"
#include "vtkCamera.h"
#include "vtkCommand.h"
#include "vtkDataArray.h"
#include "vtkExecutive.h"
#include "vtkGPUVolumeRayCastMapper.h"
#include "vtkImageData.h"
#include "vtkLight.h"
#include "vtkLightCollection.h"
#include "vtkMath.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkOpenGLHelper.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkPointData.h"
#include "vtkProp3D.h"
#include "vtkRenderer.h"
#include "vtkShaderProgram.h"
#include "vtkSmartPointer.h"
#include "vtkTextureObject.h"
#include "vtkTrivialProducer.h"
#include "vtkVersion.h"
#include "vtkVolume.h"

// GLEW or glad, by VTK's version.
#include LIGHTTRANSPORT_GL_HEADER

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

vtkStandardNewMacro(vtkLightTransportPolyDataMapper);

namespace
{
constexpr int MostExactLights = 4;
constexpr int MostTextures = 7;

/** The filter's own error, which is told as the mapper's. */
class Collector : public vtkCommand
{
public:
  static Collector* New() { return new Collector; }
  void Execute(vtkObject*, unsigned long, void* data) override
  {
    this->text = static_cast<const char*>(data);
  }
  std::string text;
};

/** One texture of half floats, linear between its texels; false where the GPU has no room. */
bool Upload(vtkTextureObject* texture, vtkOpenGLRenderWindow* window, const int n[3],
  std::vector<float>& rgba)
{
  while (glGetError() != GL_NO_ERROR)
  {
  }
  texture->ReleaseGraphicsResources(window);
  texture->SetContext(window);
  texture->ResetFormatAndType();
  texture->SetInternalFormat(GL_RGBA16F);
  texture->SetWrapS(vtkTextureObject::ClampToEdge);
  texture->SetWrapT(vtkTextureObject::ClampToEdge);
  texture->SetWrapR(vtkTextureObject::ClampToEdge);
  texture->SetMinificationFilter(vtkTextureObject::Linear);
  texture->SetMagnificationFilter(vtkTextureObject::Linear);
  if (!texture->Create3DFromRaw(n[0], n[1], n[2], 4, VTK_FLOAT, rgba.data()) ||
    glGetError() == GL_OUT_OF_MEMORY)
  {
    texture->ReleaseGraphicsResources(window);
    return false;
  }
  return true;
}

/** Components [first, first + 4) of an array, times a factor each; 0 where there are none. */
void Gather(vtkDataArray* array, int first, const double factors[4], std::vector<float>& rgba)
{
  const vtkIdType points = array->GetNumberOfTuples();
  const int components = array->GetNumberOfComponents();
  rgba.assign(4 * static_cast<std::size_t>(points), 0.f);
  for (vtkIdType i = 0; i < points; ++i)
  {
    for (int c = first; c < std::min(first + 4, components); ++c)
    {
      const double value = array->GetComponent(i, c);
      rgba[4 * static_cast<std::size_t>(i) + (c - first)] =
        std::isfinite(value) ? static_cast<float>(factors[c - first] * value) : 0.f;
    }
  }
}
//------------------------------------------------------------------------------
/**
 * A visibility in a window: all mappers that show it there share its sweeps and textures.
 */
class SharedVisibility
{
public:
  vtkSmartPointer<vtkAlgorithm> Producer;
  int Port = 0;
  vtkSmartPointer<vtkProp3D> Volume;
  vtkOpenGLRenderWindow* Window = nullptr; // compared, never used

  // The frame's.
  int Textures = 0;          // of harmonics
  std::vector<int> Channels; // of each light that is on: its exact field, or -1
  int Exact = 0;
  std::string Defines;
  vtkNew<vtkMatrix4x4> WorldToGC;
  vtkNew<vtkMatrix4x4> WorldToDC;

  // Without a producer: of what the volume's mapper draws.
  int Resolution = 128;
  std::vector<double> DrawnKey;
  std::string DrawnProblem;
  vtkNew<vtkImageData> Drawn;
  vtkNew<vtkVisibilityFactorFilter> Own;

  // Exact fields.
  vtkNew<vtkImageData> Medium; // the extinction alone
  vtkSmartPointer<vtkDataArray> Extinction;
  vtkNew<vtkVisibilityFactorFilter> Filter;
  std::vector<std::array<double, 4>> FilterLights;

  // On the GPU.
  vtkNew<vtkTextureObject> Harmonics[MostTextures];
  vtkNew<vtkTextureObject> ExactTexture;
  vtkSmartPointer<vtkDataArray> UploadedHarmonics;
  vtkMTimeType UploadedHarmonicsTime = 0;
  vtkSmartPointer<vtkDataArray> UploadedExact;
  vtkMTimeType UploadedExactTime = 0;
  int Uploads = 0;

  SharedVisibility()
  {
    this->Filter->SphericalHarmonicsOff();
    this->Filter->SetInputData(this->Medium);
    this->Own->SetInputData(this->Drawn);
    this->Own->OutputExtinctionOn();
  }

  static std::shared_ptr<SharedVisibility> Find(vtkAlgorithm* producer, int port, vtkProp3D* volume,
    int resolution, vtkOpenGLRenderWindow* window);

  void Release(vtkWindow* window)
  {
    for (auto& texture : this->Harmonics)
    {
      texture->ReleaseGraphicsResources(window);
    }
    this->ExactTexture->ReleaseGraphicsResources(window);
    this->UploadedHarmonics = nullptr;
    this->UploadedExact = nullptr;
  }

  std::string Prepare(vtkRenderer* renderer);

private:
  void FindLights(vtkRenderer* renderer, bool exact, vtkMatrix4x4* worldToData);
  std::string UpdateExact(vtkImageData* image);
  std::string FindImage(vtkImageData*& image);
};

//------------------------------------------------------------------------------
std::shared_ptr<SharedVisibility> SharedVisibility::Find(vtkAlgorithm* producer, int port,
  vtkProp3D* volume, int resolution, vtkOpenGLRenderWindow* window)
{
  // Rendering has one thread.
  static std::vector<std::weak_ptr<SharedVisibility>> all;
  all.erase(std::remove_if(all.begin(), all.end(),
              [](const std::weak_ptr<SharedVisibility>& one) { return one.expired(); }),
    all.end());
  for (const std::weak_ptr<SharedVisibility>& one : all)
  {
    std::shared_ptr<SharedVisibility> shared = one.lock();
    if (shared->Producer == producer && shared->Port == port && shared->Volume == volume &&
      shared->Resolution == resolution && shared->Window == window)
    {
      return shared;
    }
  }
  auto shared = std::make_shared<SharedVisibility>();
  shared->Producer = producer;
  shared->Port = port;
  shared->Volume = volume;
  shared->Resolution = resolution;
  shared->Window = window;
  all.push_back(shared);
  return shared;
}

//------------------------------------------------------------------------------
/** In the order in which VTK numbers them: those that are on. */
void SharedVisibility::FindLights(vtkRenderer* renderer, bool exact, vtkMatrix4x4* worldToData)
{
  this->Channels.clear();
  std::vector<std::array<double, 4>> lights;
  vtkCollectionSimpleIterator iterator;
  renderer->GetLights()->InitTraversal(iterator);
  while (vtkLight* light = renderer->GetLights()->GetNextLight(iterator))
  {
    if (!light->GetSwitch())
    {
      continue;
    }
    this->Channels.push_back(-1);
    if (!exact || !light->LightTypeIsSceneLight() ||
      static_cast<int>(lights.size()) == MostExactLights)
    {
      continue;
    }
    double position[4] = { 0., 0., 0., 1. };
    double focus[3];
    light->GetTransformedPosition(position);
    light->GetTransformedFocalPoint(focus);
    if (!light->GetPositional())
    {
      vtkMath::Subtract(position, focus, position);
      position[3] = 0.;
      if (vtkMath::Normalize(position) == 0.)
      {
        continue;
      }
    }
    double out[4];
    worldToData->MultiplyPoint(position, out);
    this->Channels.back() = static_cast<int>(lights.size());
    lights.push_back({ { out[0], out[1], out[2], position[3] } });
  }
  this->Exact = static_cast<int>(lights.size());
  if (lights == this->FilterLights)
  {
    return;
  }
  // The filter keeps the fields of the lights that stay.
  if (lights.size() != this->FilterLights.size())
  {
    this->Filter->RemoveAllLights();
    for (std::size_t i = 0; i < lights.size(); ++i)
    {
      this->Filter->AddDirectionalLight(0., 0., 1.);
    }
  }
  for (int i = 0; i < this->Exact; ++i)
  {
    const std::array<double, 4>& l = lights[i];
    l[3] != 0. ? this->Filter->SetLightPosition(i, l[0], l[1], l[2])
               : this->Filter->SetLightDirection(i, l[0], l[1], l[2]);
  }
  this->FilterLights = lights;
}

//------------------------------------------------------------------------------
/** The filter's error, or nothing. */
std::string ErrorOfUpdate(vtkAlgorithm* filter)
{
  vtkNew<Collector> collector;
  vtkNew<Collector> silent; // the executive's own
  const unsigned long own = filter->AddObserver(vtkCommand::ErrorEvent, collector);
  const unsigned long other = filter->GetExecutive()->AddObserver(vtkCommand::ErrorEvent, silent);
  filter->Update();
  filter->RemoveObserver(own);
  filter->GetExecutive()->RemoveObserver(other);
  return collector->text;
}

//------------------------------------------------------------------------------
std::string SharedVisibility::UpdateExact(vtkImageData* image)
{
  vtkDataArray* extinction = image->GetPointData()->GetArray(vtkLightTransportArrays::Extinction);
  if (extinction != this->Extinction || image->GetMTime() > this->Medium->GetMTime())
  {
    this->Medium->Initialize();
    this->Medium->CopyStructure(image);
    this->Medium->GetPointData()->AddArray(extinction);
    this->Extinction = extinction;
  }
  return ErrorOfUpdate(this->Filter);
}

//------------------------------------------------------------------------------
std::string SharedVisibility::FindImage(vtkImageData*& image)
{
  if (this->Producer)
  {
    this->Producer->Update(this->Port);
    image = vtkImageData::SafeDownCast(this->Producer->GetOutputDataObject(this->Port));
    return image && image->GetNumberOfPoints() > 0
      ? std::string()
      : "the visibility of " + std::string(this->Producer->GetClassName()) +
        " is empty, expected an image of a vtkVisibilityFactorFilter";
  }
  auto* volume = vtkVolume::SafeDownCast(this->Volume);
  auto* mapper = volume ? vtkGPUVolumeRayCastMapper::SafeDownCast(volume->GetMapper()) : nullptr;
  if (!mapper || mapper->GetNumberOfInputConnections(0) < 1)
  {
    return "there is no visibility and " +
      std::string(mapper ? "the volume's mapper has no input"
                         : "the volume has no vtkGPUVolumeRayCastMapper") +
      ", expected a visibility or a volume to compute it from";
  }
  mapper->GetInputAlgorithm()->Update();
  if (!vtkImageData::SafeDownCast(mapper->GetDataSetInput()))
  {
    return "the volume is no image, expected a vtkImageData";
  }
  const std::vector<double> key = VolumeExtinctionKey(mapper, volume, this->Resolution);
  if (key != this->DrawnKey)
  {
    this->DrawnKey = key;
    this->DrawnProblem = VolumeExtinction(mapper, volume, this->Resolution, this->Drawn);
    this->Drawn->Modified();
  }
  if (!this->DrawnProblem.empty())
  {
    return this->DrawnProblem;
  }
  const std::string problem = ErrorOfUpdate(this->Own);
  image = this->Own->GetOutput();
  return problem.empty() && image->GetNumberOfPoints() == 0 ? "the visibility was not computed"
                                                            : problem;
}

//------------------------------------------------------------------------------
std::string SharedVisibility::Prepare(vtkRenderer* renderer)
{
  vtkOpenGLRenderWindow* window = this->Window;
  vtkImageData* image = nullptr;
  std::string missing = this->FindImage(image);
  if (!missing.empty())
  {
    return missing;
  }
  const auto arrayOf = [image](const char* name)
  {
    vtkDataArray* array = image->GetPointData()->GetArray(name);
    return array && array->GetNumberOfTuples() == image->GetNumberOfPoints() ? array : nullptr;
  };
  vtkDataArray* harmonics = arrayOf(vtkLightTransportArrays::VisibilitySH);
  vtkDataArray* extinction = arrayOf(vtkLightTransportArrays::Extinction);
  if (!harmonics && !extinction)
  {
    return std::string("the visibility has neither of the point arrays \"") +
      vtkLightTransportArrays::VisibilitySH + "\" and \"" + vtkLightTransportArrays::Extinction +
      "\", expected one of them, as vtkVisibilityFactorFilter gives them";
  }
  int order = 0;
  if (harmonics)
  {
    const int components = harmonics->GetNumberOfComponents();
    order = static_cast<int>(std::lround(std::sqrt(static_cast<double>(components)))) - 1;
    if ((order + 1) * (order + 1) != components || order > 4)
    {
      return std::string("the array \"") + vtkLightTransportArrays::VisibilitySH + "\" has " +
        std::to_string(components) + " components, expected 1, 4, 9, 16 or 25";
    }
  }
  if (extinction && extinction->GetNumberOfComponents() != 1)
  {
    return std::string("the array \"") + vtkLightTransportArrays::Extinction + "\" has " +
      std::to_string(extinction->GetNumberOfComponents()) + " components, expected 1";
  }
  int n[3];
  image->GetDimensions(n);
  const int limit = vtkTextureObject::GetMaximumTextureSize3D(window);
  if (limit > 0 && *std::max_element(n, n + 3) > limit)
  {
    return "the visibility has " + std::to_string(n[0]) + " x " + std::to_string(n[1]) + " x " +
      std::to_string(n[2]) + " points, expected at most " + std::to_string(limit) +
      " along each axis, the limit of this GPU's 3-D textures";
  }

  // Places and directions.
  vtkNew<vtkMatrix4x4> worldToData;
  if (this->Volume)
  {
    vtkMatrix4x4::Invert(this->Volume->GetMatrix(), worldToData);
  }
  vtkNew<vtkMatrix4x4> indexToGC;
  const int* extent = image->GetExtent();
  for (int a = 0; a < 3; ++a)
  {
    indexToGC->SetElement(a, a, 1. / n[a]);
    indexToGC->SetElement(a, 3, (0.5 - extent[2 * a]) / n[a]);
  }
  vtkNew<vtkMatrix4x4> dataToGC;
  vtkMatrix4x4::Multiply4x4(indexToGC, image->GetPhysicalToIndexMatrix(), dataToGC);
  vtkMatrix4x4::Multiply4x4(dataToGC, worldToData, this->WorldToGC);
  this->WorldToDC->DeepCopy(worldToData);

  // Textures.
  window->MakeCurrent();
  std::vector<float> rgba;
  this->Textures = harmonics ? (harmonics->GetNumberOfComponents() + 3) / 4 : 0;
  if (harmonics &&
    (this->UploadedHarmonics != harmonics || this->UploadedHarmonicsTime != harmonics->GetMTime()))
  {
    double window5[5];
    vtkVisibilityFactorFilter::GetWindow(order, window5);
    ++this->Uploads;
    for (int t = 0; t < this->Textures; ++t)
    {
      double factors[4];
      for (int c = 0; c < 4; ++c)
      {
        const int band = static_cast<int>(std::sqrt(4. * t + c + 0.5));
        factors[c] = band < 5 ? window5[band] : 0.;
      }
      Gather(harmonics, 4 * t, factors, rgba);
      if (!Upload(this->Harmonics[t], window, n, rgba))
      {
        return "the GPU has no room for the harmonics of " + std::to_string(n[0]) + " x " +
          std::to_string(n[1]) + " x " + std::to_string(n[2]) +
          " points; take a larger ResolutionFactor or a lower order";
      }
    }
    this->UploadedHarmonics = harmonics;
    this->UploadedHarmonicsTime = harmonics->GetMTime();
  }
  this->FindLights(renderer, extinction != nullptr, worldToData);
  if (this->Exact > 0)
  {
    const std::string problem = this->UpdateExact(image);
    if (!problem.empty())
    {
      return "the visibility of the lights could not be computed: " + problem;
    }
    vtkDataArray* exact =
      this->Filter->GetOutput()->GetPointData()->GetArray(vtkLightTransportArrays::Visibility);
    if (this->UploadedExact != exact || this->UploadedExactTime != exact->GetMTime())
    {
      const double factors[4] = { 1., 1., 1., 1. };
      Gather(exact, 0, factors, rgba);
      ++this->Uploads;
      if (!Upload(this->ExactTexture, window, n, rgba))
      {
        return "the GPU has no room for the visibility of " + std::to_string(n[0]) + " x " +
          std::to_string(n[1]) + " x " + std::to_string(n[2]) +
          " points; take a larger ResolutionFactor";
      }
      this->UploadedExact = exact;
      this->UploadedExactTime = exact->GetMTime();
    }
  }

  std::ostringstream defines;
  defines << "#define LT_HARMONICS " << this->Textures << "\n#define LT_EXACT " << this->Exact
          << "\n//";
  for (int channel : this->Channels)
  {
    defines << " " << channel; // another shader for another choice of channels
  }
  this->Defines = defines.str() + "\n";
  return {};
}
} // namespace

//------------------------------------------------------------------------------
class vtkLightTransportPolyDataMapper::Implementation
{
public:
  vtkSmartPointer<vtkAlgorithm> Producer;
  int Port = 0;
  vtkSmartPointer<vtkProp3D> Volume;
  std::string Reported;

  std::shared_ptr<SharedVisibility> Shared;
  bool Active = false;
  std::string Defines;                                 // the frame's
  std::map<const vtkOpenGLHelper*, std::string> Built; // with which each primitive was
};

//------------------------------------------------------------------------------
vtkLightTransportPolyDataMapper::vtkLightTransportPolyDataMapper()
  : Internal(new Implementation)
{
}

//------------------------------------------------------------------------------
vtkLightTransportPolyDataMapper::~vtkLightTransportPolyDataMapper() = default;

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::SetVisibilityConnection(vtkAlgorithmOutput* output)
{
  this->Internal->Producer = output ? output->GetProducer() : nullptr;
  this->Internal->Port = output ? output->GetIndex() : 0;
  this->Internal->Reported.clear();
}

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::SetVisibilityData(vtkImageData* image)
{
  if (!image)
  {
    this->SetVisibilityConnection(nullptr);
    return;
  }
  vtkNew<vtkTrivialProducer> producer;
  producer->SetOutput(image);
  this->SetVisibilityConnection(producer->GetOutputPort());
}

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::SetVolume(vtkProp3D* volume)
{
  this->Internal->Volume = volume;
}

//------------------------------------------------------------------------------
vtkProp3D* vtkLightTransportPolyDataMapper::GetVolume()
{
  return this->Internal->Volume;
}

//------------------------------------------------------------------------------
int vtkLightTransportPolyDataMapper::GetNumberOfVisibilityUploads()
{
  return this->Internal->Shared ? this->Internal->Shared->Uploads : 0;
}

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::ReportOnce(const std::string& problem)
{
  if (this->Internal->Reported != problem)
  {
    this->Internal->Reported = problem;
    if (!problem.empty())
    {
      vtkErrorMacro(<< problem << "; the surface is drawn without the volume's shadows.");
    }
  }
}

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::RenderPieceStart(vtkRenderer* renderer, vtkActor* actor)
{
  Implementation& internal = *this->Internal;
  internal.Active = false;
  internal.Defines.clear();
  if ((internal.Producer || internal.Volume) &&
    (this->ShadowStrength > 0. || this->AmbientOcclusion > 0.))
  {
    internal.Shared = SharedVisibility::Find(internal.Producer, internal.Port, internal.Volume,
      this->VisibilityResolution, vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow()));
    const std::string problem = internal.Shared->Prepare(renderer);
    this->ReportOnce(problem);
    internal.Active = problem.empty();
  }
  if (internal.Active)
  {
    internal.Defines = internal.Shared->Defines;
    for (int t = 0; t < internal.Shared->Textures; ++t)
    {
      internal.Shared->Harmonics[t]->Activate();
    }
    if (internal.Shared->Exact > 0)
    {
      internal.Shared->ExactTexture->Activate();
    }
  }
  this->Superclass::RenderPieceStart(renderer, actor);
}

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::RenderPieceFinish(vtkRenderer* renderer, vtkActor* actor)
{
  this->Superclass::RenderPieceFinish(renderer, actor);
  Implementation& internal = *this->Internal;
  if (internal.Active)
  {
    for (int t = 0; t < internal.Shared->Textures; ++t)
    {
      internal.Shared->Harmonics[t]->Deactivate();
    }
    if (internal.Shared->Exact > 0)
    {
      internal.Shared->ExactTexture->Deactivate();
    }
  }
}

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::ReleaseGraphicsResources(vtkWindow* window)
{
  if (this->Internal->Shared)
  {
    this->Internal->Shared->Release(window);
    this->Internal->Shared = nullptr;
  }
  this->Internal->Active = false;
  this->Internal->Built.clear();
  this->Superclass::ReleaseGraphicsResources(window);
}

//------------------------------------------------------------------------------
bool vtkLightTransportPolyDataMapper::GetNeedToRebuildShaders(
  vtkOpenGLHelper& primitive, vtkRenderer* renderer, vtkActor* actor)
{
  // First the superclass, which also remembers what it saw.
  const bool needed = this->Superclass::GetNeedToRebuildShaders(primitive, renderer, actor);
  std::string& built = this->Internal->Built[&primitive];
  const bool other = built != this->Internal->Defines;
  built = this->Internal->Defines;
  return needed || other;
}

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::ReplaceShaderLight(
  std::map<vtkShader::Type, vtkShader*> shaders, vtkRenderer* renderer, vtkActor* actor)
{
  const Implementation& internal = *this->Internal;
  const int complexity = this->PrimitiveInfo[this->LastBoundBO].LastLightComplexity;
  const int count = this->PrimitiveInfo[this->LastBoundBO].LastLightCount;
  if (internal.Active && complexity > 0 && count > 0)
  {
    const std::vector<int>& channels = internal.Shared->Channels;
    // The colour of each light, under another name, times its visibility. VTK puts its own
    // lighting in the tag's place.
    std::ostringstream before;
    std::ostringstream after;
    before << "  vec3 ltPlace = vertexVC.xyz + in_ltStrengths.z * normalVCVSOutput;\n"
              "  ambientColor *= ltOcclusion(ltPlace);\n";
    for (int i = 0; i < count; ++i)
    {
      const int channel = i < static_cast<int>(channels.size()) ? channels[i] : -1;
      const std::string l = "ltL" + std::to_string(i);
      const std::string direction = "-lightDirectionVC" + std::to_string(i);
      before << "  vec3 " << l << " = "
             << (complexity == 1 ? "vec3(0.0, 0.0, 1.0)" : direction.c_str()) << ";\n"
             << "  float ltReach" << i << " = 1e30;\n";
      if (complexity == 3)
      {
        before << "  if (lightPositional" << i << " != 0)\n  {\n    " << l << " = lightPositionVC"
               << i << " - ltPlace;\n    ltReach" << i << " = length(" << l << ");\n  }\n";
      }
      before << "  vec3 ltColor" << i << " = lightColor" << i
             << " * ltVisibility(ltPlace, normalize(" << l << "), ltReach" << i << ", " << channel
             << ");\n#define lightColor" << i << " ltColor" << i << "\n";
      after << "#undef lightColor" << i << "\n";
    }
    std::string source = shaders[vtkShader::Fragment]->GetSource();
    if (!vtkShaderProgram::Substitute(source, "//VTK::Light::Dec",
          "//VTK::Light::Dec\n" + internal.Defines + vtkLightTransportPolyDataMapperVisibility) ||
      !vtkShaderProgram::Substitute(
        source, "//VTK::Light::Impl", before.str() + "//VTK::Light::Impl\n" + after.str(), false))
    {
      this->ReportOnce(std::string("VTK ") + vtkVersion::GetVTKVersion() +
        " has no tag VTK::Light::Dec or VTK::Light::Impl in its fragment shader");
    }
    else
    {
      shaders[vtkShader::Fragment]->SetSource(source);
    }
  }
  this->Superclass::ReplaceShaderLight(shaders, renderer, actor);
}

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::SetMapperShaderParameters(
  vtkOpenGLHelper& primitive, vtkRenderer* renderer, vtkActor* actor)
{
  this->Superclass::SetMapperShaderParameters(primitive, renderer, actor);
  Implementation& internal = *this->Internal;
  vtkShaderProgram* program = primitive.Program;
  if (!internal.Active || !program->IsUniformUsed("in_ltStrengths"))
  {
    return;
  }
  const float strengths[3] = { static_cast<float>(this->ShadowStrength),
    static_cast<float>(this->AmbientOcclusion), static_cast<float>(this->SurfaceOffset) };
  program->SetUniform3f("in_ltStrengths", strengths);
  vtkNew<vtkMatrix4x4> viewToWorld;
  vtkMatrix4x4::Invert(renderer->GetActiveCamera()->GetModelViewTransformMatrix(), viewToWorld);
  const auto matrix = [&](const char* name, vtkMatrix4x4* fromWorld)
  {
    if (program->IsUniformUsed(name))
    {
      vtkNew<vtkMatrix4x4> fromView;
      vtkMatrix4x4::Multiply4x4(fromWorld, viewToWorld, fromView);
      fromView->Transpose(); // OpenGL's columns first
      program->SetUniformMatrix(name, fromView);
    }
  };
  matrix("in_ltViewToGC", internal.Shared->WorldToGC);
  matrix("in_ltViewToDC", internal.Shared->WorldToDC);
  const auto sampler = [&](const std::string& name, vtkTextureObject* texture)
  {
    if (program->IsUniformUsed(name.c_str()))
    {
      program->SetUniformi(name.c_str(), texture->GetTextureUnit());
    }
  };
  for (int t = 0; t < internal.Shared->Textures; ++t)
  {
    sampler("in_ltVisibility" + std::to_string(t), internal.Shared->Harmonics[t]);
  }
  sampler("in_ltExact", internal.Shared->ExactTexture);
}

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Visibility: " << this->Internal->Producer << "\n";
  os << indent << "Volume: " << this->Internal->Volume << "\n";
  os << indent << "ShadowStrength: " << this->ShadowStrength << "\n";
  os << indent << "AmbientOcclusion: " << this->AmbientOcclusion << "\n";
  os << indent << "VisibilityResolution: " << this->VisibilityResolution << "\n";
  os << indent << "SurfaceOffset: " << this->SurfaceOffset << "\n";
  os << indent << "VisibilityUploads: " << this->GetNumberOfVisibilityUploads() << "\n";
}
