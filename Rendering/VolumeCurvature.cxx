// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "VolumeCurvature.h"

#include "vtkCurvatureOpacityFunction.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportCompat.h"
#include "vtkLightTransportVolumeMapperCurvatureAfter.h"
#include "vtkLightTransportVolumeMapperCurvatureBefore.h"
#include "vtkLightTransportVolumeMapperCurvatureDec.h"
#include "vtkLightTransportVolumeMapperRay.h"

#include "vtkAlgorithm.h"
#include "vtkAlgorithmOutput.h"
#include "vtkCamera.h"
#include "vtkDataArray.h"
#include "vtkDataSet.h"
#include "vtkFloatArray.h"
#include "vtkGPUVolumeRayCastMapper.h"
#include "vtkInformation.h"
#include "vtkInformationObjectBaseVectorKey.h"
#include "vtkObjectFactory.h"
#include "vtkOpenGLRenderPass.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkPointData.h"
#include "vtkRenderer.h"
#include "vtkShaderProgram.h"
#include "vtkVolume.h"
#include "vtkVolumeProperty.h"

// GLEW or glad, by VTK's version.
#include LIGHTTRANSPORT_GL_HEADER

#include <algorithm>
#include <cmath>
#include <sstream>
#include <vector>

namespace
{
constexpr int TableSize = 64;              // a side; the functions are smooth
constexpr double AlongRayScale = 1. / 50.; // of the volume's diagonal
constexpr double SmallestLength = 1e-30;
} // namespace

//------------------------------------------------------------------------------
class VolumeCurvature::Pass : public vtkOpenGLRenderPass
{
public:
  static Pass* New();
  vtkTypeMacro(Pass, vtkOpenGLRenderPass);

  // Not a pass that draws.
  void Render(const vtkRenderState*) override {}

  bool PreReplaceShaderValues(std::string&, std::string&, std::string& fragmentShader,
    vtkAbstractMapper* mapper, vtkProp*) override
  {
    if (mapper != this->Mapper)
    {
      return true;
    }
    const std::string parts[3][3] = {
      { "//VTK::ComputeLighting::Dec",
        std::string(vtkLightTransportVolumeMapperRay) + this->Owner->Head +
          vtkLightTransportVolumeMapperCurvatureDec,
        "" },
      { "//VTK::Base::Init", "", "\n  ltcInitRay();\n" },
      { "//VTK::Shading::Impl", vtkLightTransportVolumeMapperCurvatureBefore,
        std::string("\n") + vtkLightTransportVolumeMapperCurvatureAfter },
    };
    this->FailedTag.clear();
    std::string source = fragmentShader;
    for (int part = 0; part < 3; ++part)
    {
      const std::string& tag = parts[part][0];
      if (!vtkShaderProgram::Substitute(
            source, tag, parts[part][1] + tag + parts[part][2], part == 2))
      {
        // The shader stays as it was.
        this->FailedTag = tag;
        return true;
      }
    }
    fragmentShader = source;
    return true;
  }

  bool SetShaderParameters(vtkShaderProgram* program, vtkAbstractMapper* mapper, vtkProp*,
    vtkOpenGLVertexArrayObject*) override
  {
    if (mapper == this->Mapper && program && this->FailedTag.empty())
    {
      this->Owner->SetUniforms(program);
    }
    return true;
  }

  vtkMTimeType GetShaderStageMTime() override { return this->StageTime; }

  VolumeCurvature* Owner = nullptr;
  vtkAbstractMapper* Mapper = nullptr; // of this frame
  vtkTimeStamp StageTime;
  std::string FailedTag;
};
vtkStandardNewMacro(VolumeCurvature::Pass);

//------------------------------------------------------------------------------
VolumeCurvature::VolumeCurvature()
  : ShaderPass(vtkSmartPointer<Pass>::New())
{
  this->ShaderPass->Owner = this;
}

//------------------------------------------------------------------------------
VolumeCurvature::~VolumeCurvature() = default;

//------------------------------------------------------------------------------
const std::string& VolumeCurvature::FailedTag() const
{
  return this->ShaderPass->FailedTag;
}

//------------------------------------------------------------------------------
void VolumeCurvature::SetFieldConnection(vtkAlgorithmOutput* output)
{
  this->Producer = output ? output->GetProducer() : nullptr;
  this->Port = output ? output->GetIndex() : 0;
  this->Field = nullptr;
}

//------------------------------------------------------------------------------
bool VolumeCurvature::Begin(
  vtkGPUVolumeRayCastMapper* mapper, vtkRenderer* renderer, vtkVolume* volume, std::string& problem)
{
  problem.clear();
  const int blend = mapper->GetBlendMode();
  if (!this->Property || this->Property->GetStrength() <= 0. ||
    !this->Property->GetOpacityFunction() || renderer->GetSelector() || mapper->GetUseDepthPass() ||
    (blend != vtkVolumeMapper::COMPOSITE_BLEND && blend != vtkVolumeMapper::ISOSURFACE_BLEND))
  {
    return false;
  }
  problem = this->Property->GetOpacityFunction()->GetProblem();
  if (!problem.empty())
  {
    problem = "OpacityFunction of the curvature: " + problem + "; the volume is drawn without it.";
    return false;
  }
  auto* window = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow());
  window->MakeCurrent();
  if (this->Window != window)
  {
    this->Release(this->Window);
    this->Window = window;
  }
  this->HasField = this->Producer != nullptr;
  if (this->HasField)
  {
    problem = this->PrepareField(window);
    if (!problem.empty())
    {
      problem += "; the volume is drawn without curvature.";
      return false;
    }
  }
  this->UploadTable(window);
  this->ComputeDepth(mapper, renderer, volume);

  double s = this->Property->GetCurvatureScale();
  if (this->HasField)
  {
    s = s > 0. ? s : this->FieldsScale;
    this->Scale = static_cast<float>(2. * s * this->Largest);
  }
  else
  {
    const double diagonal = vtkDataSet::SafeDownCast(mapper->GetDataObjectInput())->GetLength();
    this->Scale = static_cast<float>(s > 0. ? s : AlongRayScale * diagonal);
  }

  // Where opacity comes from: the last of dependent components.
  auto* input = vtkDataSet::SafeDownCast(mapper->GetDataObjectInput());
  vtkDataArray* scalars = input ? input->GetPointData()->GetScalars() : nullptr;
  const int components = scalars ? scalars->GetNumberOfComponents() : 1;
  const bool independent = volume->GetProperty()->GetIndependentComponents() != 0;
  std::ostringstream head;
  head << "#define LTC_FIELD " << this->HasField << "\n#define LTC_SURFACES "
       << (blend == vtkVolumeMapper::ISOSURFACE_BLEND) << "\n#define LTC_COMPONENT "
       << (independent ? 0 : std::min(components, 4) - 1) << "\n";
  if (this->Head != head.str())
  {
    this->Head = head.str();
    this->ShaderPass->StageTime.Modified();
  }

  vtkInformation* keys = volume->GetPropertyKeys();
  if (!keys)
  {
    vtkNew<vtkInformation> made;
    volume->SetPropertyKeys(made);
    keys = made;
  }
  // The superclass takes the number of its draw buffers from the last pass.
  unsigned int buffers = 1;
  if (const int passes = keys->Length(vtkOpenGLRenderPass::RenderPasses()))
  {
    auto* last =
      vtkOpenGLRenderPass::SafeDownCast(vtkOpenGLRenderPass::RenderPasses()->Get(keys, passes - 1));
    buffers = last ? last->GetActiveDrawBuffers() : buffers;
  }
  this->ShaderPass->SetActiveDrawBuffers(buffers);
  this->ShaderPass->Mapper = mapper;
  keys->Append(vtkOpenGLRenderPass::RenderPasses(), this->ShaderPass);
  return true;
}

//------------------------------------------------------------------------------
void VolumeCurvature::End(vtkVolume* volume)
{
  vtkInformation* keys = volume->GetPropertyKeys();
  keys->Remove(vtkOpenGLRenderPass::RenderPasses(), this->ShaderPass);
  if (keys->Length(vtkOpenGLRenderPass::RenderPasses()) == 0)
  {
    keys->Remove(vtkOpenGLRenderPass::RenderPasses());
  }
  if (this->HasField)
  {
    this->FieldTexture->Deactivate();
  }
  this->TableTexture->Deactivate();
}

//------------------------------------------------------------------------------
std::string VolumeCurvature::PrepareField(vtkOpenGLRenderWindow* window)
{
  this->Producer->Update(this->Port);
  vtkDataObject* output = this->Producer->GetOutputDataObject(this->Port);
  this->Field = vtkImageData::SafeDownCast(output);
  std::ostringstream problem;
  if (!this->Field || this->Field->GetNumberOfPoints() == 0)
  {
    problem << "The curvature field from " << this->Producer->GetClassName() << " is "
            << (this->Field ? "empty" : "no image") << ", expected a vtkImageData with \""
            << vtkLightTransportArrays::MeanCurvature << "\"";
    return problem.str();
  }
  vtkDataArray* array =
    this->Field->GetPointData()->GetArray(vtkLightTransportArrays::MeanCurvature);
  if (!array || array->GetNumberOfComponents() != 1 ||
    array->GetNumberOfTuples() != this->Field->GetNumberOfPoints())
  {
    problem << "The curvature field has no point array \"" << vtkLightTransportArrays::MeanCurvature
            << "\" with one component and a value for each of its "
            << this->Field->GetNumberOfPoints() << " points, expected what "
            << "vtkVolumeCurvatureFilter makes";
    return problem.str();
  }
  const double determinant = this->Field->GetIndexToPhysicalMatrix()->Determinant();
  if (!std::isfinite(determinant) || determinant == 0.)
  {
    return "The curvature field's geometry can't be inverted, expected finite spacings > 0";
  }
  int extent[6];
  int dimensions[3];
  this->Field->GetExtent(extent);
  this->Field->GetDimensions(dimensions);
  if (this->UploadedArray != array || this->UploadedArrayTime != array->GetMTime())
  {
    this->UploadedArray = array;
    this->UploadedArrayTime = array->GetMTime();
    this->UploadProblem.clear();
    const vtkIdType size = array->GetNumberOfTuples();
    std::vector<float> values(static_cast<std::size_t>(size));
    double largest = 0.;
    for (vtkIdType i = 0; i < size; ++i)
    {
      const double value = array->GetComponent(i, 0);
      largest = std::isfinite(value) ? std::max(largest, std::abs(value)) : largest;
    }
    this->Largest = largest > SmallestLength ? largest : 1.;
    for (vtkIdType i = 0; i < size; ++i)
    {
      const double value = array->GetComponent(i, 0);
      values[i] = std::isfinite(value) ? static_cast<float>(value / this->Largest) : 0.F;
    }
    this->FieldsScale = vtkCurvatureOpacityFunction::ChooseCurvatureScale(array);

    const int limit = vtkTextureObject::GetMaximumTextureSize3D(window);
    vtkTextureObject* texture = this->FieldTexture;
    texture->ReleaseGraphicsResources(window);
    texture->SetContext(window);
    texture->ResetFormatAndType();
    texture->SetInternalFormat(GL_R16F);
    texture->SetWrapS(vtkTextureObject::ClampToEdge);
    texture->SetWrapT(vtkTextureObject::ClampToEdge);
    texture->SetWrapR(vtkTextureObject::ClampToEdge);
    texture->SetMinificationFilter(vtkTextureObject::Linear);
    texture->SetMagnificationFilter(vtkTextureObject::Linear);
    while (glGetError() != GL_NO_ERROR)
    {
    }
    if ((limit > 0 && *std::max_element(dimensions, dimensions + 3) > limit) ||
      !texture->Create3DFromRaw(
        dimensions[0], dimensions[1], dimensions[2], 1, VTK_FLOAT, values.data()) ||
      glGetError() == GL_OUT_OF_MEMORY)
    {
      texture->ReleaseGraphicsResources(window);
      problem << "The curvature field has " << dimensions[0] << " x " << dimensions[1] << " x "
              << dimensions[2] << " points, for which the GPU has no room (at most " << limit
              << " along an axis)";
      this->UploadProblem = problem.str();
    }
  }
  // index -> FC: texel i has its centre at (i + 1/2) / n.
  vtkNew<vtkMatrix4x4> indexToFC;
  for (int a = 0; a < 3; ++a)
  {
    const double n = dimensions[a];
    indexToFC->SetElement(a, a, 1. / n);
    indexToFC->SetElement(a, 3, (.5 - extent[2 * a]) / n);
  }
  vtkMatrix4x4::Multiply4x4(indexToFC, this->Field->GetPhysicalToIndexMatrix(), this->DatasetToFC);
  return this->UploadProblem;
}

//------------------------------------------------------------------------------
void VolumeCurvature::UploadTable(vtkOpenGLRenderWindow* window)
{
  const vtkMTimeType time = this->Property->GetMTime();
  if (this->UploadedTableTime == time && this->TableTexture->GetHandle())
  {
    return;
  }
  this->UploadedTableTime = time;
  vtkNew<vtkImageData> table;
  this->Property->GetOpacityFunction()->ExportTable(table, TableSize, TableSize);
  auto* values = vtkFloatArray::SafeDownCast(table->GetPointData()->GetScalars());
  vtkTextureObject* texture = this->TableTexture;
  texture->SetContext(window);
  texture->SetInternalFormat(GL_R16F);
  texture->SetWrapS(vtkTextureObject::ClampToEdge);
  texture->SetWrapT(vtkTextureObject::ClampToEdge);
  texture->SetMinificationFilter(vtkTextureObject::Linear);
  texture->SetMagnificationFilter(vtkTextureObject::Linear);
  texture->Create2DFromRaw(TableSize, TableSize, 1, VTK_FLOAT, values->GetPointer(0));
}

//------------------------------------------------------------------------------
// The depth of a place p of the data is direction . (M p - eye), of which the range
// over the data's corners becomes [0, 1].
void VolumeCurvature::ComputeDepth(
  vtkGPUVolumeRayCastMapper* mapper, vtkRenderer* renderer, vtkVolume* volume)
{
  double direction[3];
  renderer->GetActiveCamera()->GetDirectionOfProjection(direction);
  vtkMatrix4x4* matrix = volume->GetMatrix();
  double row[4];
  for (int c = 0; c < 4; ++c)
  {
    row[c] = direction[0] * matrix->GetElement(0, c) + direction[1] * matrix->GetElement(1, c) +
      direction[2] * matrix->GetElement(2, c);
  }
  double bounds[6];
  vtkDataSet::SafeDownCast(mapper->GetDataObjectInput())->GetBounds(bounds);
  double near = VTK_DOUBLE_MAX;
  double far = VTK_DOUBLE_MIN;
  for (int corner = 0; corner < 8; ++corner)
  {
    double depth = row[3];
    for (int a = 0; a < 3; ++a)
    {
      depth += row[a] * bounds[2 * a + ((corner >> a) & 1)];
    }
    far = corner == 0 ? depth : std::max(far, depth);
    near = std::min(near, depth);
  }
  const double range = far - near > SmallestLength ? far - near : 1.;
  for (int c = 0; c < 4; ++c)
  {
    this->Depth[c] = static_cast<float>((row[c] - (c == 3 ? near : 0.)) / range);
  }
}

//------------------------------------------------------------------------------
void VolumeCurvature::SetUniforms(vtkShaderProgram* program)
{
  this->TableTexture->Activate();
  program->SetUniformi("in_ltcTable", this->TableTexture->GetTextureUnit());
  program->SetUniformf("in_ltcScale", this->Scale);
  program->SetUniformf("in_ltcStrength", static_cast<float>(this->Property->GetStrength()));
  program->SetUniform4f("in_ltcDepth", this->Depth);
  if (this->HasField)
  {
    this->FieldTexture->Activate();
    program->SetUniformi("in_ltcField", this->FieldTexture->GetTextureUnit());
    vtkNew<vtkMatrix4x4> columnMajor;
    vtkMatrix4x4::Transpose(this->DatasetToFC, columnMajor);
    program->SetUniformMatrix("in_ltcDatasetToFC", columnMajor);
  }
}

//------------------------------------------------------------------------------
void VolumeCurvature::Release(vtkWindow* window)
{
  this->FieldTexture->ReleaseGraphicsResources(window);
  this->TableTexture->ReleaseGraphicsResources(window);
  this->UploadedArray = nullptr;
  this->UploadedArrayTime = 0;
  this->UploadedTableTime = 0;
  this->UploadProblem.clear();
  this->Window = nullptr;
}
