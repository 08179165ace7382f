// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightTransportPolyDataMapper.h"

#include "VolumeVisibility.h"
#include "vtkLightTransportCompat.h"
#include "vtkLightTransportPolyDataMapperVisibility.h"
#include "vtkLightTransportVisibility.h"

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

  int Resolution = 128;
  VolumeVisibility Visibility{ true };

  // The frame's.
  std::vector<int> Fields; // of each light that is on: its exact field, or -1
  std::string Defines;
  vtkNew<vtkMatrix4x4> WorldToGC;
  vtkNew<vtkMatrix4x4> WorldToDC;

  static std::shared_ptr<SharedVisibility> Find(vtkAlgorithm* producer, int port, vtkProp3D* volume,
    int resolution, vtkOpenGLRenderWindow* window);

  std::string Prepare(vtkRenderer* renderer);
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
  shared->Visibility.SetConnection(producer, port);
  all.push_back(shared);
  return shared;
}

//------------------------------------------------------------------------------
std::string SharedVisibility::Prepare(vtkRenderer* renderer)
{
  VolumeVisibility::Needs needs;
  needs.resolution = this->Resolution;
  needs.mean = true;
  if (!this->Producer)
  {
    needs.volume = vtkVolume::SafeDownCast(this->Volume);
    needs.mapper =
      needs.volume ? vtkGPUVolumeRayCastMapper::SafeDownCast(needs.volume->GetMapper()) : nullptr;
    if (!needs.mapper || needs.mapper->GetNumberOfInputConnections(0) < 1)
    {
      return "there is no visibility and " +
        std::string(needs.mapper ? "the volume's mapper has no input"
                                 : "the volume has no vtkGPUVolumeRayCastMapper") +
        ", expected a visibility or a volume to compute it from";
    }
    needs.mapper->GetInputAlgorithm()->Update();
    if (!vtkImageData::SafeDownCast(needs.mapper->GetDataSetInput()))
    {
      return "the volume is no image, expected a vtkImageData";
    }
  }

  this->WorldToDC->Identity();
  if (this->Volume)
  {
    vtkMatrix4x4::Invert(this->Volume->GetMatrix(), this->WorldToDC);
  }
  // In the order in which VTK numbers them: those that are on.
  this->Fields.clear();
  vtkCollectionSimpleIterator iterator;
  renderer->GetLights()->InitTraversal(iterator);
  while (vtkLight* light = renderer->GetLights()->GetNextLight(iterator))
  {
    if (!light->GetSwitch())
    {
      continue;
    }
    this->Fields.push_back(-1);
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
    std::array<double, 4> out;
    this->WorldToDC->MultiplyPoint(position, out.data());
    this->Fields.back() = static_cast<int>(needs.lights.size());
    needs.lights.push_back(out);
  }
  std::string problem = this->Visibility.Prepare(this->Window, needs);
  if (!problem.empty())
  {
    return problem;
  }
  vtkMatrix4x4::Multiply4x4(this->Visibility.GetDataToGrid(), this->WorldToDC, this->WorldToGC);
  std::ostringstream defines;
  defines << this->Visibility.Defines() << "//";
  for (int& field : this->Fields)
  {
    field = field < this->Visibility.NumberOfExactLights() ? field : -1;
    defines << " " << field; // another shader for another choice of fields
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
  return this->Internal->Shared ? this->Internal->Shared->Visibility.Uploads : 0;
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
  }
  this->Superclass::RenderPieceStart(renderer, actor);
}

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::RenderPieceFinish(vtkRenderer* renderer, vtkActor* actor)
{
  this->Superclass::RenderPieceFinish(renderer, actor);
  if (this->Internal->Active)
  {
    this->Internal->Shared->Visibility.Deactivate();
  }
}

//------------------------------------------------------------------------------
void vtkLightTransportPolyDataMapper::ReleaseGraphicsResources(vtkWindow* window)
{
  if (this->Internal->Shared)
  {
    this->Internal->Shared->Visibility.Release(window);
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
    const std::vector<int>& fields = internal.Shared->Fields;
    // The colour of each light, under another name, times its visibility. VTK puts its own
    // lighting in the tag's place.
    std::ostringstream before;
    std::ostringstream after;
    before << "  vec3 ltPlace = vertexVC.xyz + in_ltStrengths.z * normalVCVSOutput;\n"
              "  ambientColor *= ltOcclusion(ltPlace);\n";
    for (int i = 0; i < count; ++i)
    {
      const int field = i < static_cast<int>(fields.size()) ? fields[i] : -1;
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
             << " * ltVisibility(ltPlace, normalize(" << l << "), ltReach" << i << ", " << field
             << ");\n#define lightColor" << i << " ltColor" << i << "\n";
      after << "#undef lightColor" << i << "\n";
    }
    std::string source = shaders[vtkShader::Fragment]->GetSource();
    if (!vtkShaderProgram::Substitute(source, "//VTK::Light::Dec",
          "//VTK::Light::Dec\n" + internal.Defines + vtkLightTransportVisibility +
            vtkLightTransportPolyDataMapperVisibility) ||
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
  internal.Shared->Visibility.SetUniforms(program);
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
