// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightTransportVolumeMapper.h"

#include "VolumeCurvature.h"
#include "VolumeLighting.h"
#include "vtkLightFieldProperty.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportCompat.h"
#include "vtkLightTransportVisibility.h"
#include "vtkLightTransportVolumeMapperDec.h"
#include "vtkLightTransportVolumeMapperLighting.h"
#include "vtkLightTransportVolumeMapperLightingDec.h"
#include "vtkLightTransportVolumeMapperLightingEnd.h"
#include "vtkLightTransportVolumeMapperRay.h"
#include "vtkLightTransportVolumeMapperRayBegin.h"
#include "vtkLightTransportVolumeMapperRayEnd.h"
#include "vtkLightTransportVolumeMapperSampleAfter.h"
#include "vtkLightTransportVolumeMapperSampleBefore.h"

#include "vtkAlgorithm.h"
#include "vtkAlgorithmOutput.h"
#include "vtkCellData.h"
#include "vtkColorTransferFunction.h"
#include "vtkDataArray.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationObjectBaseVectorKey.h"
#include "vtkLight.h"
#include "vtkLightCollection.h"
#include "vtkMath.h"
#include "vtkMatrix4x4.h"
#include "vtkMultiVolume.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkOpenGLRenderPass.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPointData.h"
#include "vtkRectilinearGrid.h"
#include "vtkRenderer.h"
#include "vtkSMPThreadLocal.h"
#include "vtkSMPTools.h"
#include "vtkShaderProgram.h"
#include "vtkShaderProperty.h"
#include "vtkSmartPointer.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkTextureObject.h"
#include "vtkTrivialProducer.h"
#include "vtkVersion.h"
#include "vtkVolume.h"
#include "vtkVolumeInputHelper.h"
#include "vtkVolumeLightingProperty.h"
#include "vtkVolumeProperty.h"
#include "vtkVolumeTexture.h"

// GLEW or glad, by VTK's version.
#include LIGHTTRANSPORT_GL_HEADER

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

namespace
{
/** Entries of a colour map's table. */
constexpr int MapSize = 2048;

/** LT_BLEND of the shader parts; NoLight: the superclass's picture. */
enum BlendClass
{
  NoLight = -1,
  Along = 0,
  Slice = 1,
  Maximum = 2,
  Minimum = 3
};

//------------------------------------------------------------------------------
BlendClass blendClass(int blendMode)
{
  switch (blendMode)
  {
    case vtkVolumeMapper::COMPOSITE_BLEND:
    case vtkVolumeMapper::ISOSURFACE_BLEND:
      return Along;
    case vtkVolumeMapper::SLICE_BLEND:
      return Slice;
    case vtkVolumeMapper::MAXIMUM_INTENSITY_BLEND:
      return Maximum;
    case vtkVolumeMapper::MINIMUM_INTENSITY_BLEND:
      return Minimum;
    default:
      return NoLight;
  }
}

//------------------------------------------------------------------------------
std::string dimensionsAsString(const int dimensions[3])
{
  std::ostringstream text;
  text << dimensions[0] << " x " << dimensions[1] << " x " << dimensions[2];
  return text.str();
}

//------------------------------------------------------------------------------
/** A field's values as floats, scaled so that the largest magnitude is 'top'. */
struct ScaledField
{
  std::vector<float> values;
  double maximum = 0.; // magnitude, in the field's unit
  bool finite = true;
};

//------------------------------------------------------------------------------
template <typename T>
void readMagnitudes(const T* values, vtkIdType tuples, int components, ScaledField& field)
{
  struct Partial
  {
    double maximum = 0.;
    bool finite = true;
  };
  vtkSMPThreadLocal<Partial> partials;
  vtkSMPTools::For(0, tuples, 65536,
    [&](vtkIdType begin, vtkIdType end)
    {
      Partial& partial = partials.Local();
      for (vtkIdType i = begin; i < end; ++i)
      {
        double magnitude = 0.;
        for (int c = 0; c < components; ++c)
        {
          // hypot neither overflows nor underflows.
          const auto value = static_cast<double>(values[i * components + c]);
          magnitude = components == 1 ? std::abs(value) : std::hypot(magnitude, value);
          partial.finite = partial.finite && std::isfinite(value);
        }
        partial.maximum = std::max(partial.maximum, magnitude);
      }
    });
  for (const Partial& partial : partials)
  {
    field.maximum = std::max(field.maximum, partial.maximum);
    field.finite = field.finite && partial.finite;
  }
}

//------------------------------------------------------------------------------
template <typename T>
void readScaled(const T* values, vtkIdType count, double top, ScaledField& field)
{
  field.values.resize(count);
  vtkSMPTools::For(0, count, 65536,
    [&](vtkIdType begin, vtkIdType end)
    {
      for (vtkIdType i = begin; i < end; ++i)
      {
        field.values[i] = static_cast<float>(static_cast<double>(values[i]) / field.maximum * top);
      }
    });
}

//------------------------------------------------------------------------------
/**
 * VTK's shading takes six lights and writes beyond the end of its arrays with more (9.1 to 9.6,
 * SetLightingShaderParameters): for the time of a render it sees the first six. Can go when VTK
 * bounds them.
 */
class SixLights
{
public:
  SixLights(vtkRenderer* renderer, vtkVolume* volume)
  {
    vtkLightCollection* lights = renderer->GetLights();
    if (!volume->GetProperty()->GetShade() || lights->GetNumberOfItems() <= 6)
    {
      return;
    }
    vtkNew<vtkLightCollection> first;
    vtkCollectionSimpleIterator iterator;
    lights->InitTraversal(iterator);
    while (vtkLight* light = lights->GetNextLight(iterator))
    {
      if (light->GetSwitch() && first->GetNumberOfItems() < 6)
      {
        first->AddItem(light);
      }
    }
    this->Renderer = renderer;
    this->Few = first;
    this->All = lights;
  }
  void Hide()
  {
    if (this->Renderer)
    {
      this->Renderer->SetLightCollection(this->Few);
    }
  }
  ~SixLights()
  {
    if (this->Renderer)
    {
      this->Renderer->SetLightCollection(this->All);
    }
  }
  SixLights(const SixLights&) = delete;
  SixLights& operator=(const SixLights&) = delete;

private:
  vtkRenderer* Renderer = nullptr;
  vtkSmartPointer<vtkLightCollection> Few;
  vtkSmartPointer<vtkLightCollection> All;
};

//------------------------------------------------------------------------------
/** The whole pipeline upstream of a port; false where it fails. */
bool updateWhole(vtkAlgorithm* producer, int port, vtkMTimeType& pipelineTime)
{
  auto* executive = vtkStreamingDemandDrivenPipeline::SafeDownCast(producer->GetExecutive());
  if (!executive)
  {
    producer->Update(port);
    return producer->GetOutputDataObject(port) != nullptr;
  }
  if (!executive->UpdateInformation())
  {
    return false;
  }
  pipelineTime = executive->GetPipelineMTime();
  vtkInformation* info = executive->GetOutputInformation(port);
  if (info && info->Has(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT()))
  {
    info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_EXTENT(),
      info->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT()), 6);
  }
  return executive->Update(port) != 0;
}
} // namespace

//------------------------------------------------------------------------------
/** Adds the shader parts when the superclass builds its shader, and sets uniforms. */
class vtkLightTransportVolumeMapper::vtkShaderPass : public vtkOpenGLRenderPass
{
public:
  static vtkShaderPass* New();
  vtkTypeMacro(vtkShaderPass, vtkOpenGLRenderPass);

  // Not a pass that draws.
  void Render(const vtkRenderState*) override {}

  bool PreReplaceShaderValues(std::string& vertexShader, std::string& geometryShader,
    std::string& fragmentShader, vtkAbstractMapper* mapper, vtkProp* prop) override;
  bool SetShaderParameters(vtkShaderProgram* program, vtkAbstractMapper* mapper, vtkProp* prop,
    vtkOpenGLVertexArrayObject* VAO) override;
  vtkMTimeType GetShaderStageMTime() override { return this->StageTime; }

  vtkLightTransportVolumeMapper* Mapper = nullptr; // owns this
  vtkTimeStamp StageTime;                          // a new mode is a new shader
};

//------------------------------------------------------------------------------
class vtkLightTransportVolumeMapper::vtkInternals
{
public:
  vtkSmartPointer<vtkLightFieldProperty> Property = vtkSmartPointer<vtkLightFieldProperty>::New();

  // 1. the pipeline
  vtkSmartPointer<vtkAlgorithm> Producer;
  int Port = 0;
  bool ProducerFailed = false;
  vtkMTimeType FailedPipelineTime = 0;
  vtkSmartPointer<vtkImageData> Field;

  // 2. what is on the GPU
  vtkNew<vtkTextureObject> FieldTexture;
  vtkNew<vtkTextureObject> MapTexture;
  vtkSmartPointer<vtkDataArray> UploadedArray; // kept, so that its address is not used again
  vtkMTimeType UploadedArrayTime = 0;
  int UploadedDimensions[3] = { 0, 0, 0 };
  bool UploadedGood = false;
  double Maximum = 0.; // magnitude
  double Top = 1.;     // what the maximum is on the GPU
  vtkMTimeType UploadedMapTime = 0;
  vtkOpenGLRenderWindow* Window = nullptr; // of the textures; compared, never used

  // 3. the shader
  vtkNew<vtkShaderPass> Pass;
  VolumeLighting Lighting;
  bool HasField = false; // this frame's
  bool HasLighting = false;
  std::string ShaderHead; // the preprocessor's symbols
  std::string FailedTag;
  vtkMTimeType FailedShaderTime = 0;

  std::string LastProblem;
  std::string LastLightingProblem;
  VolumeCurvature Curvature;
  std::string LastCurvatureProblem;
  bool WarnedMultiVolume = false;
  bool WarnedDepthPass = false;
  unsigned short Partitions[3] = { 1, 1, 1 };

  // uniforms of this frame
  double Window2[2] = { 0., 0. };
  double InverseUnitDistance = 1.;
  vtkNew<vtkMatrix4x4> DatasetToFC;

  std::string CheckArray(vtkImageData* image, int mode, vtkDataArray*& array);
  std::string Upload(
    vtkOpenGLRenderWindow* window, vtkDataArray* array, const int dimensions[3], bool half);
  bool UploadMapIfChanged(vtkOpenGLRenderWindow* window);
  void ComputeDatasetToFC();
  void Release(vtkWindow* window);
};

vtkStandardNewMacro(vtkLightTransportVolumeMapper::vtkShaderPass);
vtkStandardNewMacro(vtkLightTransportVolumeMapper);

//------------------------------------------------------------------------------
bool vtkLightTransportVolumeMapper::vtkShaderPass::PreReplaceShaderValues(
  std::string&, std::string&, std::string& fragmentShader, vtkAbstractMapper* mapper, vtkProp*)
{
  if (mapper != this->Mapper)
  {
    return true;
  }
  ++this->Mapper->NumberOfShaderBuilds;
  vtkInternals& self = *this->Mapper->Internals;

  // What a sample is made of, in the order in which it is computed.
  std::string declarations = self.ShaderHead + vtkLightTransportVolumeMapperRay;
  std::string initialization = "\n";
  std::string lighting;
  std::string colorEnd;
  if (self.HasField)
  {
    declarations += vtkLightTransportVolumeMapperDec;
    initialization += "  ltInitField(ltTCToData());\n";
  }
  if (self.HasLighting)
  {
    declarations += vtkLightTransportVisibility;
    declarations += vtkLightTransportVolumeMapperLightingDec;
    lighting = vtkLightTransportVolumeMapperLighting;
    colorEnd = std::string("\n") + vtkLightTransportVolumeMapperLightingEnd;
    initialization += "  ltInitLighting(ltTCToData());\n";
  }

  struct Part
  {
    const char* tag;
    std::string before;
    std::string after;
    bool all; // also where a user's replacement repeats the tag
  };
  const Part parts[] = {
    { "//VTK::ComputeLighting::Dec", declarations, "\n" + lighting, false },
    { "//VTK::ComputeColor::Dec", "", colorEnd, false },
    { "//VTK::Base::Init", "", initialization, false },
    { "//VTK::Shading::Init", "", vtkLightTransportVolumeMapperRayBegin, true },
    { "//VTK::Shading::Impl", vtkLightTransportVolumeMapperSampleBefore,
      vtkLightTransportVolumeMapperSampleAfter, true },
    { "//VTK::Shading::Exit", "", vtkLightTransportVolumeMapperRayEnd, true },
  };

  std::string source = fragmentShader;
  for (const Part& part : parts)
  {
    if (!vtkShaderProgram::Substitute(
          source, part.tag, part.before + part.tag + part.after, part.all))
    {
      // The shader stays the superclass's.
      self.FailedTag = part.tag;
      return true;
    }
  }
  self.FailedTag.clear();
  fragmentShader = source;
  return true;
}

//------------------------------------------------------------------------------
bool vtkLightTransportVolumeMapper::vtkShaderPass::SetShaderParameters(
  vtkShaderProgram* program, vtkAbstractMapper* mapper, vtkProp*, vtkOpenGLVertexArrayObject*)
{
  if (mapper != this->Mapper || !program)
  {
    return true;
  }
  vtkInternals& self = *this->Mapper->Internals;
  if (!self.FailedTag.empty())
  {
    return true;
  }
  if (self.HasLighting)
  {
    self.Lighting.SetUniforms(program);
  }
  if (!self.HasField)
  {
    return true;
  }
  vtkLightFieldProperty* property = self.Property;
  if (!program->IsUniformUsed("in_ltField"))
  {
    self.FailedTag = "uniform in_ltField";
    return true;
  }

  self.FieldTexture->Activate();
  program->SetUniformi("in_ltField", self.FieldTexture->GetTextureUnit());
  self.MapTexture->Activate();
  program->SetUniformi("in_ltMap", self.MapTexture->GetTextureUnit());

  // t = slope * x + offset with x = |field| or log2 |field|, as stored. The
  // differences are taken here in double.
  const bool log = property->GetScale() == vtkLightFieldProperty::Logarithmic;
  const auto position = [&](double magnitude)
  {
    return log ? std::log2(magnitude) - std::log2(self.Maximum) + std::log2(self.Top)
               : magnitude / self.Maximum * self.Top;
  };
  const double lo = position(self.Window2[0]);
  const double slope = 1. / (position(self.Window2[1]) - lo);
  const float window[2] = { static_cast<float>(slope), static_cast<float>(-slope * lo) };
  program->SetUniform2f("in_ltWindow", window);
  program->SetUniformi("in_ltLogarithmic", log ? 1 : 0);

  program->SetUniformf("in_ltStrength", static_cast<float>(property->GetStrength()));
  // An opacity of 1 has no logarithm.
  program->SetUniformf(
    "in_ltLightOpacity", static_cast<float>(std::min(property->GetLightOpacity(), .999)));
  program->SetUniformf("in_ltInverseUnitDistance", static_cast<float>(self.InverseUnitDistance));
  program->SetUniformf("in_ltTissueOpacity", static_cast<float>(property->GetTissueOpacity()));

  vtkNew<vtkMatrix4x4> columnMajor;
  vtkMatrix4x4::Transpose(self.DatasetToFC, columnMajor);
  program->SetUniformMatrix("in_ltDatasetToFC", columnMajor);
  return true;
}

//------------------------------------------------------------------------------
/** The array that the mode shows; what is wrong with it, or nothing. */
std::string vtkLightTransportVolumeMapper::vtkInternals::CheckArray(
  vtkImageData* image, int mode, vtkDataArray*& array)
{
  const bool flux = mode == vtkLightFieldProperty::FluxDirection;
  const char* name = flux ? vtkLightTransportArrays::Flux : vtkLightTransportArrays::Fluence;
  const int components = flux ? 3 : 1;
  std::ostringstream problem;
  array = image->GetPointData()->GetArray(name);
  if (!array)
  {
    problem << "The light field has no point array \"" << name << "\"";
    if (image->GetCellData()->GetArray(name))
    {
      problem << " (a cell array of that name is there; vtkCellDataToPointData converts it)";
    }
    else if (flux)
    {
      problem << " (vtkLightDiffusionFilter makes one with SetComputeFlux(true))";
    }
    problem << "; the volume is drawn without light.";
  }
  else if (array->GetNumberOfComponents() != components)
  {
    problem << "The light field's array \"" << name << "\" has " << array->GetNumberOfComponents()
            << " components, expected " << components << "; the volume is drawn without light.";
  }
  else if (array->GetNumberOfTuples() != image->GetNumberOfPoints())
  {
    problem << "The light field's array \"" << name << "\" has " << array->GetNumberOfTuples()
            << " tuples, expected " << image->GetNumberOfPoints()
            << ", one per point; the volume is drawn without light.";
  }
  else
  {
    const double determinant = image->GetIndexToPhysicalMatrix()->Determinant();
    if (!std::isfinite(determinant) || determinant == 0.)
    {
      const double* spacing = image->GetSpacing();
      problem << "The light field's spacing is (" << spacing[0] << ", " << spacing[1] << ", "
              << spacing[2] << ") and its geometry can't be inverted, expected finite spacings > 0"
              << "; the volume is drawn without light.";
    }
  }
  return problem.str();
}

//------------------------------------------------------------------------------
std::string vtkLightTransportVolumeMapper::vtkInternals::Upload(
  vtkOpenGLRenderWindow* window, vtkDataArray* array, const int dimensions[3], bool half)
{
  // Anything but float and double in C order becomes double.
  vtkSmartPointer<vtkDataArray> values = array;
  if (!array->HasStandardMemoryLayout() ||
    (array->GetDataType() != VTK_FLOAT && array->GetDataType() != VTK_DOUBLE))
  {
    values.TakeReference(vtkDataArray::CreateDataArray(VTK_DOUBLE));
    values->DeepCopy(array);
  }
  const int components = values->GetNumberOfComponents();
  const vtkIdType tuples = values->GetNumberOfTuples();
  const bool isFloat = values->GetDataType() == VTK_FLOAT;

  ScaledField field;
  const auto* floats = static_cast<const float*>(values->GetVoidPointer(0));
  const auto* doubles = static_cast<const double*>(values->GetVoidPointer(0));
  isFloat ? readMagnitudes(floats, tuples, components, field)
          : readMagnitudes(doubles, tuples, components, field);
  this->Maximum = 0.;
  if (!field.finite)
  {
    return std::string("The light field's array \"") + array->GetName() +
      "\" has NaN or infinite values, expected finite ones; the volume is drawn without light.";
  }
  if (field.maximum == 0.)
  {
    return std::string(); // no light is not an error
  }

  // 2^15 puts the numbers of 16-bit floats with full precision, 2^-14 to 2^16,
  // where the decades below the maximum are.
  this->Top = half ? 32768. : 1.;
  isFloat ? readScaled(floats, tuples * components, this->Top, field)
          : readScaled(doubles, tuples * components, this->Top, field);

  while (glGetError() != GL_NO_ERROR)
  {
  }
  vtkTextureObject* texture = this->FieldTexture;
  texture->ReleaseGraphicsResources(window);
  texture->SetContext(window);
  texture->ResetFormatAndType();
  // Three channels are padded to four by GPUs, and slower than four on llvmpipe.
  texture->SetInternalFormat(
    components == 1 ? (half ? GL_R16F : GL_R32F) : (half ? GL_RGBA16F : GL_RGBA32F));
  texture->SetWrapS(vtkTextureObject::ClampToEdge);
  texture->SetWrapT(vtkTextureObject::ClampToEdge);
  texture->SetWrapR(vtkTextureObject::ClampToEdge);
  texture->SetMinificationFilter(vtkTextureObject::Linear);
  texture->SetMagnificationFilter(vtkTextureObject::Linear);
  if (!texture->Create3DFromRaw(
        dimensions[0], dimensions[1], dimensions[2], components, VTK_FLOAT, field.values.data()) ||
    glGetError() == GL_OUT_OF_MEMORY)
  {
    texture->ReleaseGraphicsResources(window);
    return "The GPU has no room for the light field of " + dimensionsAsString(dimensions) +
      " points; use a coarser one (vtkImageResize). The volume is drawn without light.";
  }
  this->Maximum = field.maximum;
  return std::string();
}

//------------------------------------------------------------------------------
bool vtkLightTransportVolumeMapper::vtkInternals::UploadMapIfChanged(vtkOpenGLRenderWindow* window)
{
  // Exchanging a function for another one shows in the property's table time.
  const vtkMTimeType time = this->Property->GetTableMTime();
  if (this->UploadedMapTime == time && this->MapTexture->GetHandle())
  {
    return false;
  }
  this->UploadedMapTime = time;
  constexpr int size = MapSize;
  std::vector<float> table(2 * 4 * size);
  std::vector<double> colors(3 * size);
  std::vector<double> opacities(size);
  this->Property->GetLightOpacityFunction()->GetTable(0., 1., size, opacities.data());
  vtkColorTransferFunction* maps[2] = { this->Property->GetPositiveColorMap(),
    this->Property->GetNegativeColorMap() };
  for (int row = 0; row < 2; ++row)
  {
    maps[row]->GetTable(0., 1., size, colors.data());
    for (int i = 0; i < size; ++i)
    {
      float* texel = &table[4 * (row * size + i)];
      for (int c = 0; c < 3; ++c)
      {
        texel[c] = static_cast<float>(colors[3 * i + c]);
      }
      texel[3] = static_cast<float>(std::min(std::max(opacities[i], 0.), 1.));
    }
  }
  vtkTextureObject* texture = this->MapTexture;
  texture->SetContext(window);
  texture->SetWrapS(vtkTextureObject::ClampToEdge);
  texture->SetWrapT(vtkTextureObject::ClampToEdge);
  texture->SetMinificationFilter(vtkTextureObject::Nearest);
  texture->SetMagnificationFilter(vtkTextureObject::Nearest);
  // The nearest of many 8-bit entries costs half of a filtered look-up on llvmpipe.
  texture->SetInternalFormat(GL_RGBA8);
  texture->Create2DFromRaw(size, 2, 4, VTK_FLOAT, table.data());
  return true;
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::vtkInternals::ComputeDatasetToFC()
{
  // index -> FC: texel i has its centre at (i + 1/2) / n.
  int extent[6];
  this->Field->GetExtent(extent);
  vtkNew<vtkMatrix4x4> indexToFC;
  for (int a = 0; a < 3; ++a)
  {
    const double n = extent[2 * a + 1] - extent[2 * a] + 1;
    indexToFC->SetElement(a, a, 1. / n);
    indexToFC->SetElement(a, 3, (.5 - extent[2 * a]) / n);
  }
  vtkMatrix4x4::Multiply4x4(indexToFC, this->Field->GetPhysicalToIndexMatrix(), this->DatasetToFC);
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::vtkInternals::Release(vtkWindow* window)
{
  this->FieldTexture->ReleaseGraphicsResources(window);
  this->MapTexture->ReleaseGraphicsResources(window);
  this->UploadedArray = nullptr;
  this->UploadedArrayTime = 0;
  this->UploadedMapTime = 0;
  this->UploadedGood = false;
  this->Window = nullptr;
}

//------------------------------------------------------------------------------
vtkLightTransportVolumeMapper::vtkLightTransportVolumeMapper()
  : Internals(new vtkInternals)
{
  this->Internals->Pass->Mapper = this;
}

//------------------------------------------------------------------------------
vtkLightTransportVolumeMapper::~vtkLightTransportVolumeMapper() = default;

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::SetLightFieldConnection(vtkAlgorithmOutput* output)
{
  vtkInternals& self = *this->Internals;
  self.Producer = output ? output->GetProducer() : nullptr;
  self.Port = output ? output->GetIndex() : 0;
  self.ProducerFailed = false;
  self.Field = nullptr;
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::SetLightFieldData(vtkImageData* image)
{
  if (!image)
  {
    this->SetLightFieldConnection(nullptr);
    return;
  }
  vtkNew<vtkTrivialProducer> producer;
  producer->SetOutput(image);
  this->SetLightFieldConnection(producer->GetOutputPort());
}

//------------------------------------------------------------------------------
vtkImageData* vtkLightTransportVolumeMapper::GetLightFieldData()
{
  return this->Internals->Field;
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::SetLightFieldProperty(vtkLightFieldProperty* property)
{
  vtkInternals& self = *this->Internals;
  if (self.Property != property)
  {
    self.Property = property ? property : vtkSmartPointer<vtkLightFieldProperty>::New().Get();
    self.UploadedMapTime = 0;
  }
}

//------------------------------------------------------------------------------
vtkLightFieldProperty* vtkLightTransportVolumeMapper::GetLightFieldProperty()
{
  return this->Internals->Property;
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::SetLightingProperty(vtkVolumeLightingProperty* property)
{
  this->Internals->Lighting.Property = property;
}

//------------------------------------------------------------------------------
vtkVolumeLightingProperty* vtkLightTransportVolumeMapper::GetLightingProperty()
{
  return this->Internals->Lighting.Property;
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::SetVisibilityConnection(vtkAlgorithmOutput* output)
{
  this->Internals->Lighting.SetVisibilityConnection(output);
}

//------------------------------------------------------------------------------
int vtkLightTransportVolumeMapper::GetNumberOfVisibilityUploads()
{
  return this->Internals->Lighting.NumberOfUploads();
}

//------------------------------------------------------------------------------
int vtkLightTransportVolumeMapper::GetNumberOfVisibilityComputations()
{
  return this->Internals->Lighting.NumberOfComputations();
}

//------------------------------------------------------------------------------
double vtkLightTransportVolumeMapper::GetLightFieldMaximum()
{
  return this->Internals->Maximum;
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::SetPartitions(
  unsigned short x, unsigned short y, unsigned short z)
{
  this->Superclass::SetPartitions(x, y, z);
  this->Internals->Partitions[0] = x;
  this->Internals->Partitions[1] = y;
  this->Internals->Partitions[2] = z;
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::ReportOnce(const std::string& problem)
{
  if (this->Internals->LastProblem != problem)
  {
    this->Internals->LastProblem = problem;
    if (!problem.empty())
    {
      vtkErrorMacro(<< problem);
    }
  }
}

//------------------------------------------------------------------------------
bool vtkLightTransportVolumeMapper::VolumeFits(vtkRenderer* renderer)
{
  int dimensions[3] = { 0, 0, 0 };
  vtkDataSet* input = this->GetTransformedInput(0);
  if (auto* image = vtkImageData::SafeDownCast(input))
  {
    image->GetDimensions(dimensions);
  }
  else if (auto* grid = vtkRectilinearGrid::SafeDownCast(input))
  {
    grid->GetDimensions(dimensions);
  }
  const int limit = vtkTextureObject::GetMaximumTextureSize3D(
    vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow()));
  for (int a = 0; a < 3; ++a)
  {
    const int parts = std::max<int>(this->Internals->Partitions[a], 1);
    // Blocks share a layer of points.
    const int block = parts > 1 ? dimensions[a] / parts + 2 : dimensions[a];
    if (limit > 0 && block > limit)
    {
      std::ostringstream problem;
      problem << "The volume has " << dimensionsAsString(dimensions) << " points, expected at most "
              << limit
              << " along each axis, the limit of this GPU's 3-D textures; it is not drawn. "
              << "Resample it (vtkImageResize), cut it (vtkExtractVOI) or call SetPartitions.";
      this->ReportOnce(problem.str());
      return false;
    }
  }
  return true;
}

//------------------------------------------------------------------------------
bool vtkLightTransportVolumeMapper::CanBeLit(vtkRenderer* renderer, vtkVolume* volume)
{
  vtkInternals& self = *this->Internals;
  const bool hasField = self.Producer && self.Property->GetStrength() > 0.;
  vtkVolumeLightingProperty* lighting = self.Lighting.Property;
  const bool hasLighting = lighting && lighting->GetStrength() > 0.;
  if ((!hasField && !hasLighting) || renderer->GetSelector() ||
    blendClass(this->GetBlendMode()) == NoLight)
  {
    return false;
  }
  if (vtkMultiVolume::SafeDownCast(volume))
  {
    if (!self.WarnedMultiVolume)
    {
      self.WarnedMultiVolume = true;
      vtkWarningMacro("A vtkMultiVolume is drawn without light: give each volume a "
                      "vtkLightTransportVolumeMapper of its own.");
    }
    return false;
  }
  if (this->GetUseDepthPass())
  {
    if (!self.WarnedDepthPass)
    {
      self.WarnedDepthPass = true;
      vtkWarningMacro("UseDepthPass shows a contour without light; turn it off to see the light.");
    }
    return false;
  }
  if (!self.FailedTag.empty())
  {
    if (volume->GetShaderProperty()->GetShaderMTime() == self.FailedShaderTime)
    {
      return false;
    }
    self.FailedTag.clear();
  }
  return true;
}

//------------------------------------------------------------------------------
bool vtkLightTransportVolumeMapper::PrepareField(vtkRenderer* renderer)
{
  vtkInternals& self = *this->Internals;
  vtkLightFieldProperty* property = self.Property;
  if (!self.Producer || property->GetStrength() <= 0.)
  {
    return false;
  }

  // 1. the pipeline. One that failed is tried again when something upstream changed.
  vtkMTimeType pipelineTime = 0;
  if (self.ProducerFailed)
  {
    auto* executive = vtkStreamingDemandDrivenPipeline::SafeDownCast(self.Producer->GetExecutive());
    if (executive)
    {
      executive->UpdatePipelineMTime();
      if (executive->GetPipelineMTime() == self.FailedPipelineTime)
      {
        return false;
      }
    }
  }
  const bool updated = updateWhole(self.Producer, self.Port, pipelineTime);
  vtkDataObject* output = self.Producer->GetOutputDataObject(self.Port);
  self.Field = vtkImageData::SafeDownCast(output);
  self.ProducerFailed = !updated;
  self.FailedPipelineTime = pipelineTime;
  if (output && !self.Field)
  {
    this->ReportOnce(std::string("The light field is a ") + output->GetClassName() +
      ", expected a vtkImageData; the volume is drawn without light.");
    return false;
  }
  if (!updated || !self.Field || self.Field->GetNumberOfPoints() == 0)
  {
    this->ReportOnce(std::string("The light field from ") + self.Producer->GetClassName() +
      (updated ? " has no points" : " could not be computed") +
      "; the volume is drawn without light.");
    return false;
  }

  vtkDataArray* array = nullptr;
  std::string problem = self.CheckArray(self.Field, property->GetMode(), array);
  if (!problem.empty())
  {
    this->ReportOnce(problem);
    return false;
  }

  // 2. what changed goes to the GPU
  auto* window = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow());
  window->MakeCurrent();
  if (self.Window != window)
  {
    self.Release(self.Window);
    self.Window = window;
  }
  int dimensions[3];
  self.Field->GetDimensions(dimensions);
  if (self.UploadedArray != array || self.UploadedArrayTime != array->GetMTime() ||
    !std::equal(dimensions, dimensions + 3, self.UploadedDimensions))
  {
    self.UploadedArray = array;
    self.UploadedArrayTime = array->GetMTime();
    std::copy(dimensions, dimensions + 3, self.UploadedDimensions);
    const int limit = vtkTextureObject::GetMaximumTextureSize3D(window);
    if (limit > 0 && *std::max_element(dimensions, dimensions + 3) > limit)
    {
      std::ostringstream text;
      text << "The light field has " << dimensionsAsString(dimensions)
           << " points, expected at most " << limit
           << " along each axis, the limit of this GPU's 3-D textures; use a coarser one "
           << "(vtkImageResize). The volume is drawn without light.";
      problem = text.str();
      self.Maximum = 0.;
    }
    else
    {
      const vtkTypeInt64 bytes = 4 * vtkTypeInt64(array->GetNumberOfValues());
      problem = self.Upload(window, array, dimensions, bytes > this->FloatFieldLimit);
      ++this->NumberOfLightFieldUploads;
    }
    self.UploadedGood = problem.empty();
    this->ReportOnce(problem);
  }
  if (!self.UploadedGood || !property->GetEffectiveWindow(self.Maximum, self.Window2) ||
    !(self.Maximum > 0.))
  {
    return false;
  }
  this->ReportOnce(std::string());
  if (self.UploadMapIfChanged(window))
  {
    ++this->NumberOfColorMapUploads;
  }

  // 3. this frame's uniforms
  self.ComputeDatasetToFC();
  double unit = property->GetLightOpacityUnitDistance();
  if (unit == 0.)
  {
    unit = this->GetTransformedInput(0)->GetLength() / 50.;
  }
  self.InverseUnitDistance = unit > 0. ? 1. / unit : 1.;
  return true;
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::SetCurvatureProperty(vtkVolumeCurvatureProperty* property)
{
  this->Internals->Curvature.Property = property;
}

//------------------------------------------------------------------------------
vtkVolumeCurvatureProperty* vtkLightTransportVolumeMapper::GetCurvatureProperty()
{
  return this->Internals->Curvature.Property;
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::SetCurvatureFieldConnection(vtkAlgorithmOutput* output)
{
  this->Internals->Curvature.SetFieldConnection(output);
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::RenderWithCurvature(vtkRenderer* renderer, vtkVolume* volume)
{
  vtkInternals& self = *this->Internals;
  std::string problem;
  const bool curved =
    !vtkMultiVolume::SafeDownCast(volume) && self.Curvature.Begin(this, renderer, volume, problem);
  this->Superclass::GPURender(renderer, volume);
  if (curved)
  {
    self.Curvature.End(volume);
    const std::string& tag = self.Curvature.FailedTag();
    problem = tag.empty() ? tag
                          : "The shader has no " + tag +
        " (a replacement of the vtkShaderProperty took it away); the volume is drawn without "
        "curvature.";
  }
  if (self.LastCurvatureProblem != problem)
  {
    self.LastCurvatureProblem = problem;
    if (!problem.empty())
    {
      vtkErrorMacro(<< problem);
    }
  }
}

//------------------------------------------------------------------------------
/** What the last frame shows: SetPartitions of the superclass is not virtual. */
bool vtkLightTransportVolumeMapper::IsInBlocks()
{
  for (auto& input : this->AssembledInputs)
  {
    vtkVolumeTexture* texture = input.second.Texture;
    if (texture)
    {
      const auto& parts = texture->GetPartitions();
      if (parts[0] > 1 || parts[1] > 1 || parts[2] > 1)
      {
        return true;
      }
    }
  }
  return false;
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::GPURender(vtkRenderer* renderer, vtkVolume* volume)
{
  vtkInternals& self = *this->Internals;
  if (!this->VolumeFits(renderer))
  {
    return;
  }
  SixLights sixLights(renderer, volume);
  self.HasField = false;
  self.HasLighting = false;
  if (this->CanBeLit(renderer, volume))
  {
    self.HasField = this->PrepareField(renderer);
    std::string problem;
    // Light of the field shows where nothing else does.
    const bool skips =
      !self.HasField || self.Property->GetMode() == vtkLightFieldProperty::Illuminate;
    const bool partitioned =
      std::any_of(self.Partitions, self.Partitions + 3, [](int parts) { return parts > 1; }) ||
      this->IsInBlocks();
    self.HasLighting =
      self.Lighting.Prepare(this, renderer, volume, self.HasField, skips, partitioned, problem);
    if (self.HasLighting && problem != self.LastLightingProblem)
    {
      self.LastLightingProblem = problem;
      if (!problem.empty())
      {
        vtkErrorMacro(<< problem);
      }
    }
  }
  sixLights.Hide();
  if (!self.HasField && !self.HasLighting)
  {
    this->RenderWithCurvature(renderer, volume);
    return;
  }
  std::ostringstream head;
  head << "#define LT_FIELD " << self.HasField << "\n#define LT_LIGHTING " << self.HasLighting
       << "\n#define LT_MODE " << (self.HasField ? self.Property->GetMode() : -1)
       << "\n#define LT_BLEND " << blendClass(this->GetBlendMode()) << "\n"
       << (self.HasLighting ? self.Lighting.Defines()
                            : "#define LT_DEFERRED 0\n#define LT_SKIPS 0\n");
  if (self.ShaderHead != head.str())
  {
    self.ShaderHead = head.str();
    self.Pass->StageTime.Modified();
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
  self.Pass->SetActiveDrawBuffers(buffers);
  keys->Append(vtkOpenGLRenderPass::RenderPasses(), self.Pass);
  this->RenderWithCurvature(renderer, volume);
  keys->Remove(vtkOpenGLRenderPass::RenderPasses(), self.Pass);
  if (keys->Length(vtkOpenGLRenderPass::RenderPasses()) == 0)
  {
    keys->Remove(vtkOpenGLRenderPass::RenderPasses());
  }
  self.FieldTexture->Deactivate();
  self.MapTexture->Deactivate();
  self.Lighting.Deactivate();

  if (!self.FailedTag.empty())
  {
    self.FailedShaderTime = volume->GetShaderProperty()->GetShaderMTime();
    this->ReportOnce("The shader has no " + self.FailedTag + " (VTK " +
      vtkVersion::GetVTKVersion() +
      ", or a replacement of the vtkShaderProperty took it away); the volume is drawn without "
      "light.");
  }
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::ReleaseGraphicsResources(vtkWindow* window)
{
  this->Internals->Release(window);
  this->Internals->Lighting.Release(window);
  this->Internals->Curvature.Release(window);
  this->Superclass::ReleaseGraphicsResources(window);
}

//------------------------------------------------------------------------------
void vtkLightTransportVolumeMapper::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "LightFieldData: " << this->Internals->Field.Get() << "\n";
  os << indent << "LightFieldMaximum: " << this->Internals->Maximum << "\n";
  os << indent << "FloatFieldLimit: " << this->FloatFieldLimit << "\n";
  os << indent << "NumberOfLightFieldUploads: " << this->NumberOfLightFieldUploads << "\n";
  os << indent << "NumberOfColorMapUploads: " << this->NumberOfColorMapUploads << "\n";
  os << indent << "NumberOfShaderBuilds: " << this->NumberOfShaderBuilds << "\n";
  os << indent << "LightFieldProperty:\n";
  this->Internals->Property->PrintSelf(os, indent.GetNextIndent());
  os << indent << "LightingProperty: " << this->Internals->Lighting.Property.Get() << "\n";
}
