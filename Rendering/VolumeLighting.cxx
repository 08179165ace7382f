// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "VolumeLighting.h"

#include "VolumeExtinction.h"
#include "vtkLightTransportCompat.h"
#include "vtkVisibilityFactorFilter.h"

#include "vtkAbstractMapper.h"
#include "vtkAlgorithm.h"
#include "vtkAlgorithmOutput.h"
#include "vtkCommand.h"
#include "vtkDataArray.h"
#include "vtkGPUVolumeRayCastMapper.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkLight.h"
#include "vtkLightCollection.h"
#include "vtkMath.h"
#include "vtkObjectFactory.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkOpenGLRenderer.h"
#include "vtkPBRIrradianceTexture.h"
#include "vtkPointData.h"
#include "vtkRenderer.h"
#include "vtkSMPTools.h"
#include "vtkShaderProgram.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkTexture.h"
#include "vtkVolume.h"
#include "vtkVolumeProperty.h"

// GLEW or glad, by VTK's version.
#include LIGHTTRANSPORT_GL_HEADER

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace
{
/** More lights than this, and they come from a texture. */
constexpr int MostUniformLights = 32;
constexpr int TexelsPerLight = 5;

/** Names of the arrays of vtkVisibilityFactorFilter. */
constexpr const char* HarmonicsName = "VisibilitySH";
constexpr const char* ExactName = "Visibility";
constexpr const char* ExtinctionName = "Extinction";

int bandOf(int component)
{
  return static_cast<int>(std::sqrt(static_cast<double>(component) + .5));
}

/** Errors of the filter become the mapper's. */
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

bool isBlack(const double rgb[3])
{
  return rgb[0] <= 0. && rgb[1] <= 0. && rgb[2] <= 0.;
}

std::string dimensionsAsString(const int n[3])
{
  std::ostringstream text;
  text << n[0] << " x " << n[1] << " x " << n[2];
  return text.str();
}

/** One texture of bytes, linear between its texels; false where the GPU has no room. */
bool createTexture(vtkTextureObject* texture, vtkOpenGLRenderWindow* window, const int n[3],
  int components, unsigned char* bytes)
{
  while (glGetError() != GL_NO_ERROR)
  {
  }
  texture->ReleaseGraphicsResources(window);
  texture->SetContext(window);
  texture->ResetFormatAndType();
  texture->SetInternalFormat(components == 1 ? GL_R8 : GL_RGBA8);
  texture->SetWrapS(vtkTextureObject::ClampToEdge);
  texture->SetWrapT(vtkTextureObject::ClampToEdge);
  texture->SetWrapR(vtkTextureObject::ClampToEdge);
  texture->SetMinificationFilter(vtkTextureObject::Linear);
  texture->SetMagnificationFilter(vtkTextureObject::Linear);
  if (!texture->Create3DFromRaw(n[0], n[1], n[2], components, VTK_UNSIGNED_CHAR, bytes) ||
    glGetError() == GL_OUT_OF_MEMORY)
  {
    texture->ReleaseGraphicsResources(window);
    return false;
  }
  return true;
}

unsigned char toByte(double x)
{
  // Also 0 for a NaN.
  return static_cast<unsigned char>(x > 0. ? (x < 1. ? x * 255. + .5 : 255.) : 0.);
}
} // namespace

//------------------------------------------------------------------------------
VolumeLighting::VolumeLighting() = default;
VolumeLighting::~VolumeLighting() = default;

//------------------------------------------------------------------------------
void VolumeLighting::SetVisibilityConnection(vtkAlgorithmOutput* output)
{
  this->Producer = output ? output->GetProducer() : nullptr;
  this->Port = output ? output->GetIndex() : 0;
  this->Visibility = nullptr;
  this->Exact = nullptr;
  this->Filter = nullptr;
  this->ExtinctionKey.clear();
}

//------------------------------------------------------------------------------
/** All that are on, in the world's coordinates; those to be exact come first. */
void VolumeLighting::CollectLights(vtkRenderer* renderer)
{
  this->Lights.clear();
  vtkLightCollection* lights = renderer->GetLights();
  vtkCollectionSimpleIterator iterator;
  lights->InitTraversal(iterator);
  while (vtkLight* source = lights->GetNextLight(iterator))
  {
    if (!source->GetSwitch())
    {
      continue;
    }
    Light light;
    const double intensity = source->GetIntensity();
    for (int c = 0; c < 3; ++c)
    {
      light.diffuse[c] = intensity * source->GetDiffuseColor()[c];
      light.specular[c] = intensity * source->GetSpecularColor()[c];
    }
    if (isBlack(light.diffuse) && isBlack(light.specular))
    {
      continue;
    }
    light.scene = source->LightTypeIsSceneLight() != 0;
    light.positional = source->GetPositional() != 0;
    double position[3];
    double focus[3];
    source->GetTransformedPosition(position);
    source->GetTransformedFocalPoint(focus);
    vtkMath::Subtract(focus, position, light.axis);
    vtkMath::Normalize(light.axis);
    for (int a = 0; a < 3; ++a)
    {
      light.place[a] = light.positional ? position[a] : -light.axis[a];
    }
    if (light.positional)
    {
      // As VTK has it, a cone of more than 90 degrees is none.
      light.cone = source->GetConeAngle() <= 90.
        ? std::cos(vtkMath::RadiansFromDegrees(source->GetConeAngle()))
        : -2.;
      light.exponent = source->GetExponent();
      source->GetAttenuationValues(light.attenuation);
    }
    this->Lights.push_back(light);
  }
  std::stable_sort(this->Lights.begin(), this->Lights.end(),
    [](const Light& a, const Light& b) { return a.scene && !b.scene; });
}

//------------------------------------------------------------------------------
/** In the data's coordinates, in which the filter computes. */
void VolumeLighting::SetFilterLights(vtkVolume* volume, int exactLights)
{
  vtkNew<vtkMatrix4x4> worldToData;
  vtkMatrix4x4::Invert(volume->GetMatrix(), worldToData);
  std::vector<std::array<double, 4>> lights;
  for (int i = 0; i < exactLights; ++i)
  {
    const Light& light = this->Lights[i];
    const double in[4] = { light.place[0], light.place[1], light.place[2],
      light.positional ? 1. : 0. };
    double out[4];
    worldToData->MultiplyPoint(in, out);
    const double length = light.positional ? 1. : std::max(vtkMath::Norm(out), 1e-300);
    lights.push_back({ { out[0] / length, out[1] / length, out[2] / length, in[3] } });
  }
  if (lights == this->FilterLights &&
    this->Filter->GetNumberOfLights() == static_cast<int>(lights.size()))
  {
    return;
  }
  bool same = lights.size() == this->FilterLights.size() &&
    this->Filter->GetNumberOfLights() == static_cast<int>(lights.size());
  for (std::size_t i = 0; same && i < lights.size(); ++i)
  {
    same = lights[i][3] == this->FilterLights[i][3];
  }
  if (!same)
  {
    this->Filter->RemoveAllLights();
  }
  for (std::size_t i = 0; i < lights.size(); ++i)
  {
    const auto& l = lights[i];
    if (!same)
    {
      l[3] != 0. ? this->Filter->AddPositionalLight(l[0], l[1], l[2])
                 : this->Filter->AddDirectionalLight(l[0], l[1], l[2]);
    }
    else if (l != this->FilterLights[i])
    {
      l[3] != 0. ? this->Filter->SetLightPosition(static_cast<int>(i), l[0], l[1], l[2])
                 : this->Filter->SetLightDirection(static_cast<int>(i), l[0], l[1], l[2]);
    }
  }
  this->FilterLights = lights;
}

//------------------------------------------------------------------------------
std::string VolumeLighting::UpdateConnection(vtkVolume* volume, int exactLights)
{
  const auto isGood = [](vtkImageData* image, const char* name)
  {
    vtkDataArray* array = image ? image->GetPointData()->GetArray(name) : nullptr;
    return array && array->GetNumberOfTuples() == image->GetNumberOfPoints() &&
      image->GetNumberOfPoints() > 0;
  };
  this->Producer->Update(this->Port);
  auto* image = vtkImageData::SafeDownCast(this->Producer->GetOutputDataObject(this->Port));
  this->Visibility = nullptr;
  this->Exact = nullptr;
  if (!isGood(image, HarmonicsName))
  {
    return std::string("The visibility from ") + this->Producer->GetClassName() +
      " has no point array \"" + HarmonicsName +
      "\" with a tuple per point, expected that of a vtkVisibilityFactorFilter; the volume is lit "
      "without shadows.";
  }
  const int components = image->GetPointData()->GetArray(HarmonicsName)->GetNumberOfComponents();
  this->Order = bandOf(components - 1);
  if ((this->Order + 1) * (this->Order + 1) != components || this->Order > 4)
  {
    return std::string("The visibility's array \"") + HarmonicsName + "\" has " +
      std::to_string(components) +
      " components, expected 1, 4, 9, 16 or 25; the volume is lit without shadows.";
  }
  this->Visibility = image;
  if (exactLights > 0 && isGood(image, ExtinctionName))
  {
    if (!this->Filter)
    {
      this->Filter = vtkSmartPointer<vtkVisibilityFactorFilter>::New();
      this->Filter->SphericalHarmonicsOff();
      this->FilterLights.clear();
    }
    this->Filter->SetInputData(image);
    this->SetFilterLights(volume, exactLights);
    this->Filter->Update();
    this->Exact = this->Filter->GetOutput();
  }
  return std::string();
}

//------------------------------------------------------------------------------
std::string VolumeLighting::UpdateVisibility(vtkGPUVolumeRayCastMapper* mapper, vtkVolume* volume,
  int exactLights, bool harmonics, bool occlusion)
{
  if (this->Producer)
  {
    return this->UpdateConnection(volume, exactLights);
  }
  std::vector<double> key =
    VolumeExtinctionKey(mapper, volume, this->Property->GetVisibilityResolution());
  if (key != this->ExtinctionKey || !this->Filter)
  {
    this->ExtinctionKey = key;
    this->ExtinctionProblem =
      VolumeExtinction(mapper, volume, this->Property->GetVisibilityResolution(), this->Extinction);
    this->Extinction->Modified();
  }
  this->Visibility = nullptr;
  this->Exact = nullptr;
  if (!this->ExtinctionProblem.empty())
  {
    return this->ExtinctionProblem;
  }
  if (!this->Filter)
  {
    this->Filter = vtkSmartPointer<vtkVisibilityFactorFilter>::New();
    this->Filter->SetInputData(this->Extinction);
    this->FilterLights.clear();
  }
  // Ambient occlusion alone needs the mean alone.
  const int order = harmonics ? this->Property->GetVisibilityOrder() : 0;
  this->Filter->SetSphericalHarmonics(harmonics || occlusion);
  if (harmonics || occlusion)
  {
    this->Filter->SetOrder(order);
  }
  this->SetFilterLights(volume, exactLights);
  vtkNew<Collector> collector;
  const unsigned long tag = this->Filter->AddObserver(vtkCommand::ErrorEvent, collector);
  vtkDataArray* before = this->UploadedHarmonics;
  this->Filter->Update();
  this->Filter->RemoveObserver(tag);
  vtkImageData* output = this->Filter->GetOutput();
  vtkPointData* data = output->GetPointData();
  if (!collector->text.empty() || output->GetNumberOfPoints() == 0)
  {
    return "The visibility could not be computed; the volume is lit without shadows. " +
      collector->text;
  }
  if (harmonics || occlusion)
  {
    this->Order = order;
    this->Visibility = output;
    this->NumberOfComputations += data->GetArray(HarmonicsName) != before ? 1 : 0;
  }
  if (exactLights > 0)
  {
    this->Exact = output;
  }
  return std::string();
}

//------------------------------------------------------------------------------
/** Four coefficients a texture, each scaled to its own range in bytes. */
bool VolumeLighting::UploadHarmonics(vtkOpenGLRenderWindow* window)
{
  vtkDataArray* array = this->Visibility->GetPointData()->GetArray(HarmonicsName);
  if (this->UploadedHarmonics == array && this->UploadedHarmonicsTime == array->GetMTime())
  {
    return this->TexturesUsed > 0;
  }
  this->UploadedHarmonics = array;
  this->UploadedHarmonicsTime = array->GetMTime();
  this->TexturesUsed = 0;
  int n[3];
  this->Visibility->GetDimensions(n);
  const int components = array->GetNumberOfComponents();
  const vtkIdType points = array->GetNumberOfTuples();
  this->Scale.assign(4 * MaxTextures, 0.);
  this->Shift.assign(4 * MaxTextures, 0.);
  for (int c = 0; c < components; ++c)
  {
    double range[2];
    array->GetFiniteRange(range, c);
    this->Shift[c] = range[0];
    this->Scale[c] = std::max(range[1] - range[0], 1e-12);
  }
  ++this->NumberOfUploads;
  std::vector<unsigned char> bytes;
  const int textures = (components + 3) / 4;
  const auto* floats = array->GetDataType() == VTK_FLOAT && array->HasStandardMemoryLayout()
    ? static_cast<const float*>(array->GetVoidPointer(0))
    : nullptr;
  for (int t = 0; t < textures; ++t)
  {
    const int here = std::min(components - 4 * t, 4);
    const int channels = here == 1 ? 1 : 4;
    bytes.assign(static_cast<std::size_t>(points) * channels, 0);
    vtkSMPTools::For(0, points, 65536,
      [&](vtkIdType begin, vtkIdType end)
      {
        for (vtkIdType i = begin; i < end; ++i)
        {
          for (int k = 0; k < here; ++k)
          {
            const int c = 4 * t + k;
            const double value = floats ? floats[i * components + c] : array->GetComponent(i, c);
            bytes[i * channels + k] = toByte((value - this->Shift[c]) / this->Scale[c]);
          }
        }
      });
    if (!createTexture(this->HarmonicsTextures[t], window, n, channels, bytes.data()))
    {
      return false;
    }
  }
  this->TexturesUsed = textures;
  return true;
}

//------------------------------------------------------------------------------
/** The visibility of one light a channel, or the mean visibility in the last. */
bool VolumeLighting::UploadExact(vtkOpenGLRenderWindow* window, int exactLights, bool occlusion)
{
  vtkImageData* image = this->Exact ? this->Exact : this->Visibility;
  vtkDataArray* exact =
    exactLights > 0 ? this->Exact->GetPointData()->GetArray(ExactName) : nullptr;
  // Harmonics of order 0 are the mean times sqrt(4 pi).
  vtkDataArray* mean =
    occlusion ? this->Visibility->GetPointData()->GetArray(HarmonicsName) : nullptr;
  if ((exactLights > 0 && (!exact || exact->GetNumberOfComponents() < exactLights)) ||
    (mean && mean->GetNumberOfTuples() != image->GetNumberOfPoints()))
  {
    return false;
  }
  if (this->ExactUsed && this->UploadedExact == exact && this->UploadedOcclusion == mean &&
    (!exact || this->UploadedExactTime == exact->GetMTime()) &&
    (!mean || this->UploadedOcclusionTime == mean->GetMTime()))
  {
    return true;
  }
  this->UploadedExact = exact;
  this->UploadedExactTime = exact ? exact->GetMTime() : 0;
  this->UploadedOcclusion = mean;
  this->UploadedOcclusionTime = mean ? mean->GetMTime() : 0;
  int n[3];
  image->GetDimensions(n);
  const vtkIdType points = image->GetNumberOfPoints();
  std::vector<unsigned char> bytes(static_cast<std::size_t>(points) * 4, 255);
  const int own = exact ? exact->GetNumberOfComponents() : 0;
  const auto floatsOf = [](vtkDataArray* array)
  {
    return array && array->GetDataType() == VTK_FLOAT && array->HasStandardMemoryLayout()
      ? static_cast<const float*>(array->GetVoidPointer(0))
      : nullptr;
  };
  const float* fast = floatsOf(exact);
  vtkSMPTools::For(0, points, 65536,
    [&](vtkIdType begin, vtkIdType end)
    {
      for (vtkIdType i = begin; i < end; ++i)
      {
        for (int c = 0; c < std::min(own, 4); ++c)
        {
          bytes[4 * i + c] = toByte(fast ? fast[i * own + c] : exact->GetComponent(i, c));
        }
        if (mean)
        {
          bytes[4 * i + 3] = toByte(mean->GetComponent(i, 0) / std::sqrt(4. * vtkMath::Pi()));
        }
      }
    });
  ++this->NumberOfUploads;
  this->ExactUsed = createTexture(this->ExactTexture, window, n, 4, bytes.data());
  return this->ExactUsed;
}

//------------------------------------------------------------------------------
/** Uniforms, or a texture of a row a light. */
void VolumeLighting::UploadLights(vtkOpenGLRenderWindow* window)
{
  std::vector<float> texels(static_cast<std::size_t>(TexelsPerLight) * 4 * this->Capacity, 0.F);
  for (std::size_t i = 0; i < this->Lights.size(); ++i)
  {
    const Light& light = this->Lights[i];
    float* t = &texels[TexelsPerLight * 4 * i];
    for (int a = 0; a < 3; ++a)
    {
      t[a] = static_cast<float>(light.place[a]);
      t[4 + a] = static_cast<float>(light.diffuse[a]);
      t[8 + a] = static_cast<float>(light.specular[a]);
      t[12 + a] = static_cast<float>(light.axis[a]);
      t[16 + a] = static_cast<float>(light.attenuation[a]);
    }
    t[3] = light.positional ? 1.F : 0.F;
    t[7] = static_cast<float>(light.cone);
    t[11] = static_cast<float>(light.exponent);
  }
  // What pads the array is black, and somewhere.
  for (int i = static_cast<int>(this->Lights.size()); i < this->Capacity; ++i)
  {
    texels[TexelsPerLight * 4 * i + 2] = 1.F;
  }
  if (texels == this->UploadedLights && (!this->LightsInTexture || this->LightTexture->GetHandle()))
  {
    return;
  }
  this->UploadedLights = texels;
  if (this->LightsInTexture)
  {
    vtkTextureObject* texture = this->LightTexture;
    texture->ReleaseGraphicsResources(window);
    texture->SetContext(window);
    texture->SetInternalFormat(GL_RGBA32F);
    texture->SetMinificationFilter(vtkTextureObject::Nearest);
    texture->SetMagnificationFilter(vtkTextureObject::Nearest);
    texture->Create2DFromRaw(TexelsPerLight, this->Capacity, 4, VTK_FLOAT, texels.data());
  }
}

//------------------------------------------------------------------------------
namespace
{
/** Mean linear colours of blocks of an image, at most `most` of them along either axis. */
struct SmallImage
{
  int n[2] = { 0, 0 };
  std::vector<double> rgb;
};

SmallImage shrink(vtkImageData* image, int mostX, int mostY, bool sRGB)
{
  SmallImage result;
  vtkDataArray* values = image ? image->GetPointData()->GetScalars() : nullptr;
  int size[3] = { 0, 0, 0 };
  if (image)
  {
    image->GetDimensions(size);
  }
  if (!values || size[0] < 1 || size[1] < 1 ||
    values->GetNumberOfTuples() < static_cast<vtkIdType>(size[0]) * size[1])
  {
    return result;
  }
  const int components = values->GetNumberOfComponents();
  const int type = values->GetDataType();
  const bool integral = type != VTK_FLOAT && type != VTK_DOUBLE;
  const double unit = integral ? 1. / std::max(values->GetDataTypeMax(), 1.) : 1.;
  result.n[0] = std::min(size[0], mostX);
  result.n[1] = std::min(size[1], mostY);
  result.rgb.assign(3 * static_cast<std::size_t>(result.n[0]) * result.n[1], 0.);
  for (int y = 0; y < result.n[1]; ++y)
  {
    const int y0 = y * size[1] / result.n[1];
    const int y1 = (y + 1) * size[1] / result.n[1];
    for (int x = 0; x < result.n[0]; ++x)
    {
      const int x0 = x * size[0] / result.n[0];
      const int x1 = (x + 1) * size[0] / result.n[0];
      double* sum = &result.rgb[3 * (static_cast<std::size_t>(y) * result.n[0] + x)];
      for (int v = y0; v < y1; ++v)
      {
        for (int u = x0; u < x1; ++u)
        {
          for (int c = 0; c < 3; ++c)
          {
            const double value = unit *
              values->GetComponent(
                static_cast<vtkIdType>(v) * size[0] + u, components >= 3 ? c : 0);
            if (std::isfinite(value) && value > 0.)
            {
              sum[c] += sRGB ? std::pow(value, 2.2) : value;
            }
          }
        }
      }
      for (int c = 0; c < 3; ++c)
      {
        sum[c] /= static_cast<double>(x1 - x0) * (y1 - y0);
      }
    }
  }
  return result;
}
} // namespace

//------------------------------------------------------------------------------
/** The renderer's texture as a few directions; none: an even white. */
void VolumeLighting::ReadEnvironment(vtkRenderer* renderer)
{
  vtkTexture* texture = renderer->GetEnvironmentTexture();
  vtkMTimeType time = 0;
  if (texture)
  {
    for (int i = 0; i < (texture->GetCubeMap() ? 6 : 1); ++i)
    {
      if (vtkAlgorithm* source = texture->GetInputAlgorithm(i, 0))
      {
        source->Update();
      }
      vtkDataObject* image = texture->GetInputDataObject(i, 0);
      time = std::max(time, image ? image->GetMTime() : 0);
    }
    time = std::max(time, texture->GetMTime());
  }
  if (texture == this->EnvironmentSource && time == this->EnvironmentTime)
  {
    return;
  }
  this->EnvironmentSource = texture;
  this->EnvironmentTime = time;
  this->Environment.clear();
  if (!texture)
  {
    return;
  }
  // SetEnvironmentTexture(texture, isSRGB) keeps its flag with VTK's own irradiance.
  auto* own = vtkOpenGLRenderer::SafeDownCast(renderer);
  const bool sRGB =
    texture->GetUseSRGBColorSpace() || (own && own->GetEnvMapIrradiance()->GetConvertToLinear());
  const bool cube = texture->GetCubeMap();
  for (int face = 0; face < (cube ? 6 : 1); ++face)
  {
    const SmallImage image =
      shrink(vtkImageData::SafeDownCast(texture->GetInputDataObject(face, 0)), cube ? 16 : 64,
        cube ? 16 : 32, sRGB);
    for (int y = 0; y < image.n[1]; ++y)
    {
      for (int x = 0; x < image.n[0]; ++x)
      {
        Radiance r;
        if (cube)
        {
          // OpenGL's faces: +x, -x, +y, -y, +z, -z.
          const double s = 2. * (x + .5) / image.n[0] - 1.;
          const double t = 2. * (y + .5) / image.n[1] - 1.;
          const double axes[6][3] = { { 1., -t, -s }, { -1., -t, s }, { s, 1., t }, { s, -1., -t },
            { s, -t, 1. }, { -s, -t, -1. } };
          const double length = std::sqrt(1. + s * s + t * t);
          for (int a = 0; a < 3; ++a)
          {
            r.direction[a] = axes[face][a] / length;
          }
          r.solidAngle = 4. / (image.n[0] * image.n[1] * length * length * length);
        }
        else
        {
          // The first row is straight down, the middle column +x (VTK's equirectangular maps).
          const double theta = vtkMath::Pi() * (y + .5) / image.n[1];
          const double phi = vtkMath::Pi() * (2. * (x + .5) / image.n[0] - 1.);
          r.direction[0] = std::sin(theta) * std::cos(phi);
          r.direction[1] = -std::cos(theta);
          r.direction[2] = std::sin(theta) * std::sin(phi);
          r.solidAngle = 2. * vtkMath::Pi() / image.n[0] *
            (std::cos(vtkMath::Pi() * y / image.n[1]) -
              std::cos(vtkMath::Pi() * (y + 1) / image.n[1]));
        }
        std::copy_n(&image.rgb[3 * (static_cast<std::size_t>(y) * image.n[0] + x)], 3, r.rgb);
        this->Environment.push_back(r);
      }
    }
  }
  // The quadrature's sum is the sphere.
  double sum = 0.;
  for (const Radiance& r : this->Environment)
  {
    sum += r.solidAngle;
  }
  for (Radiance& r : this->Environment)
  {
    r.solidAngle *= 4. * vtkMath::Pi() / sum;
  }
}

//------------------------------------------------------------------------------
/**
 * The light that arrives, with coefficients k = 0 to 3, is linear in the visibility's:
 * int v L Y_k = sum_j v_j int Y_j Y_k L. This fills the shader's uniform with these
 * integrals, in the scale of the stored values; without any, with int Y_k L.
 */
void VolumeLighting::ProjectEnvironment(vtkRenderer* renderer, int values)
{
  const double strength = this->Property->GetEnvironmentStrength();
  const int columns = std::max(values, 1);
  std::vector<double> integrals(static_cast<std::size_t>(3) * columns * 4, 0.);
  const auto at = [&](int color, int j, int k) -> double&
  { return integrals[(static_cast<std::size_t>(color) * columns + j) * 4 + k]; };
  std::fill_n(this->EnvironmentMost, 3, 0.F);
  if (this->Environment.empty())
  {
    for (int color = 0; color < 3; ++color)
    {
      for (int k = 0; k < std::min(columns, 4); ++k)
      {
        at(color, k, k) = strength;
      }
      this->EnvironmentMost[color] = static_cast<float>(strength);
      if (values == 0)
      {
        at(color, 0, 0) = strength * std::sqrt(4. * vtkMath::Pi());
      }
    }
  }
  else
  {
    double up[3];
    double right[3];
    double front[3];
    renderer->GetEnvironmentUp(up);
    renderer->GetEnvironmentRight(right);
    vtkMath::Cross(right, up, front);
    for (const Radiance& r : this->Environment)
    {
      double d[3];
      for (int a = 0; a < 3; ++a)
      {
        d[a] = r.direction[0] * right[a] + r.direction[1] * up[a] + r.direction[2] * front[a];
      }
      const double world[4] = { d[0], d[1], d[2], 0. };
      double data[4];
      this->WorldToData->MultiplyPoint(world, data);
      vtkMath::Normalize(data);
      double Y[25];
      vtkVisibilityFactorFilter::GetHarmonics(2, data, Y);
      for (int color = 0; color < 3; ++color)
      {
        const double L = strength * r.rgb[color];
        this->EnvironmentMost[color] =
          std::max(this->EnvironmentMost[color], static_cast<float>(L));
        for (int j = 0; j < columns; ++j)
        {
          const double Yj = values == 0 ? 1. : Y[j];
          for (int k = 0; k < 4; ++k)
          {
            at(color, j, k) += r.solidAngle * L * Yj * Y[k];
          }
        }
      }
    }
  }
  // Per colour: a vec4 for each stored value, then the constant.
  this->EnvironmentUniform.assign(static_cast<std::size_t>(3) * (values + 1) * 4, 0.F);
  for (int color = 0; color < 3; ++color)
  {
    float* rows = &this->EnvironmentUniform[static_cast<std::size_t>(color) * (values + 1) * 4];
    for (int k = 0; k < 4; ++k)
    {
      double constant = values == 0 ? at(color, 0, k) : 0.;
      for (int j = 0; j < values; ++j)
      {
        rows[4 * j + k] = static_cast<float>(at(color, j, k) * this->Scale[j]);
        constant += at(color, j, k) * this->Shift[j];
      }
      rows[4 * values + k] = static_cast<float>(constant);
    }
  }
}

//------------------------------------------------------------------------------
double VolumeLighting::AutomaticThreshold(
  vtkGPUVolumeRayCastMapper* mapper, vtkVolume* volume, int component)
{
  vtkImageData* image = vtkImageData::SafeDownCast(mapper->GetDataSetInput());
  int cellFlag = 0;
  vtkDataArray* scalars = vtkAbstractMapper::GetScalars(image, mapper->GetScalarMode(),
    mapper->GetArrayAccessMode(), mapper->GetArrayId(), mapper->GetArrayName(), cellFlag);
  if (!scalars || component >= scalars->GetNumberOfComponents())
  {
    return 1.;
  }
  double range[2];
  scalars->GetFiniteRange(range, component);
  const double* spacing = image->GetSpacing();
  const double scale = std::cbrt(std::abs(volume->GetMatrix()->Determinant()));
  const double smallest =
    std::min({ std::abs(spacing[0]), std::abs(spacing[1]), std::abs(spacing[2]) }) * scale;
  const double threshold = (range[1] - range[0]) / (40. * smallest);
  return threshold > 0. && std::isfinite(threshold) ? threshold : 1.;
}

//------------------------------------------------------------------------------
bool VolumeLighting::Prepare(vtkGPUVolumeRayCastMapper* mapper, vtkRenderer* renderer,
  vtkVolume* volume, bool hasField, bool skips, bool partitioned, std::string& problem)
{
  problem.clear();
  vtkVolumeLightingProperty* property = this->Property;
  vtkVolumeProperty* material = volume->GetProperty();
  const int blend = mapper->GetBlendMode();
  if (!property || property->GetStrength() <= 0. ||
    (blend != vtkVolumeMapper::COMPOSITE_BLEND && blend != vtkVolumeMapper::ISOSURFACE_BLEND) ||
    !vtkImageData::SafeDownCast(mapper->GetDataSetInput()))
  {
    return false;
  }
  auto* window = vtkOpenGLRenderWindow::SafeDownCast(renderer->GetRenderWindow());
  if (this->Window != window)
  {
    this->Release(this->Window);
    this->Window = window;
  }

  // What is needed: surfaces of an isosurface have no extinction that could shadow.
  this->CollectLights(renderer);
  const int lights = static_cast<int>(this->Lights.size());
  int components = 1;
  {
    int cellFlag = 0;
    if (vtkDataArray* scalars =
          vtkAbstractMapper::GetScalars(mapper->GetDataSetInput(), mapper->GetScalarMode(),
            mapper->GetArrayAccessMode(), mapper->GetArrayId(), mapper->GetArrayName(), cellFlag))
    {
      components = std::min(scalars->GetNumberOfComponents(), 4);
    }
  }
  const bool independent = components > 1 && material->GetIndependentComponents();
  double ambient = 0.;
  for (int c = 0; c < (independent ? components : 1); ++c)
  {
    ambient = std::max(ambient, material->GetAmbient(c));
  }
  int shadow = property->GetShadowMode();
  if (blend == vtkVolumeMapper::ISOSURFACE_BLEND && !this->Producer)
  {
    shadow = vtkVolumeLightingProperty::NoShadows;
  }
  if (shadow == vtkVolumeLightingProperty::RayTraced && partitioned)
  {
    shadow = vtkVolumeLightingProperty::Precomputed; // a ray sees its own block alone
  }
  const bool shadows = shadow != vtkVolumeLightingProperty::NoShadows;
  const bool precomputed =
    shadow == vtkVolumeLightingProperty::Precomputed && property->GetShadowStrength() > 0.;
  const bool environment = property->GetEnvironmentStrength() > 0.;
  const bool occlusion = shadows && property->GetAmbientOcclusion() > 0. && ambient > 0.;
  int exactLights = 0;
  while (precomputed && exactLights < std::min(lights, property->GetNumberOfExactLights()) &&
    this->Lights[exactLights].scene)
  {
    ++exactLights;
  }
  const bool harmonics = (precomputed && lights > exactLights) || (shadows && environment);

  // The visibility, on the CPU and on the GPU.
  bool hasHarmonics = false;
  bool hasExact = false;
  int occlusionFrom = 0;
  if (harmonics || occlusion || exactLights > 0)
  {
    problem = this->UpdateVisibility(mapper, volume, exactLights, harmonics, occlusion);
    if (this->Producer && !this->Exact)
    {
      exactLights = 0; // a connection without extinction: the harmonics have them all
    }
    if (problem.empty())
    {
      int n[3];
      (this->Visibility ? this->Visibility : this->Exact)->GetDimensions(n);
      const int limit = vtkTextureObject::GetMaximumTextureSize3D(window);
      if (limit > 0 && *std::max_element(n, n + 3) > limit)
      {
        problem = "The visibility has " + dimensionsAsString(n) + " points, expected at most " +
          std::to_string(limit) +
          " along each axis, the limit of this GPU's 3-D textures; the "
          "volume is lit without shadows.";
      }
      else
      {
        window->MakeCurrent();
        // The mean goes with the exact fields if no direction is needed.
        const bool meanWithExact = occlusion && !harmonics && !this->Producer && exactLights < 4;
        const bool needsHarmonics =
          this->Visibility && !meanWithExact && (harmonics || occlusion || exactLights < lights);
        hasHarmonics = needsHarmonics && this->UploadHarmonics(window);
        hasExact = (exactLights > 0 || meanWithExact) &&
          this->UploadExact(window, exactLights, meanWithExact);
        occlusionFrom = meanWithExact ? (hasExact ? 1 : 0) : occlusion && hasHarmonics ? 2 : 0;
        if (needsHarmonics != hasHarmonics || (exactLights > 0 && !hasExact))
        {
          problem = "The GPU has no room for the visibility of " + dimensionsAsString(n) +
            " points; set a smaller VisibilityResolution. The volume is lit with fewer shadows.";
        }
      }
    }
  }
  this->ExactLights = hasExact ? exactLights : 0;
  const int textures = hasHarmonics ? this->TexturesUsed : 0;

  // Directions and places.
  vtkMatrix4x4::Invert(volume->GetMatrix(), this->WorldToData);
  const double scale = std::cbrt(std::abs(volume->GetMatrix()->Determinant()));
  for (int i = 0; i < 9; ++i)
  {
    this->WorldToData->SetElement(
      i / 3, i % 3, this->WorldToData->GetElement(i / 3, i % 3) * (scale > 0. ? scale : 1.));
  }
  if (vtkImageData* grid = hasExact && this->Exact ? this->Exact : this->Visibility)
  {
    int extent[6];
    grid->GetExtent(extent);
    vtkNew<vtkMatrix4x4> indexToVC;
    for (int a = 0; a < 3; ++a)
    {
      const double n = extent[2 * a + 1] - extent[2 * a] + 1;
      indexToVC->SetElement(a, a, 1. / n);
      indexToVC->SetElement(a, 3, (.5 - extent[2 * a]) / n);
    }
    vtkMatrix4x4::Multiply4x4(indexToVC, grid->GetPhysicalToIndexMatrix(), this->DatasetToVC);
  }

  this->LightsInTexture = lights > MostUniformLights;
  // Exact up to 8, so that the shader's loop is unrolled; then in steps, padded with black.
  this->Capacity = lights <= 8 ? lights : (lights + 7) / 8 * 8;
  this->UploadLights(window);

  if (environment)
  {
    this->ReadEnvironment(renderer);
    this->ProjectEnvironment(renderer, textures > 2 ? 9 : textures > 0 ? 4 : 0);
  }

  // Of the grid that the resolution asks for, whether or not it was computed: all shadow modes
  // look from the same place.
  {
    vtkImageData* image = vtkImageData::SafeDownCast(mapper->GetDataSetInput());
    int n[3];
    image->GetDimensions(n);
    const double* spacing = image->GetSpacing();
    const int longest = *std::max_element(n, n + 3);
    const int resolution = property->GetVisibilityResolution();
    const int step = std::max(1, (longest + resolution - 1) / resolution);
    const double length = property->GetSurfaceOffset() * step *
      std::cbrt(std::abs(spacing[0] * spacing[1] * spacing[2]));
    this->SurfaceOffset[0] = static_cast<float>(length * scale);
    this->SurfaceOffset[1] = static_cast<float>(length);
  }
  const double given = property->GetGradientThreshold();
  for (int c = 0; c < 4; ++c)
  {
    this->Thresholds[c] = static_cast<float>(
      std::max(given > 0. ? given : this->AutomaticThreshold(mapper, volume, c), 1e-30));
  }

  // The shader.
  bool positional = false;
  for (const Light& light : this->Lights)
  {
    positional = positional || light.positional;
  }
  bool gradientOpacity = false;
  for (int c = 0; c < (independent ? components : 1); ++c)
  {
    gradientOpacity = gradientOpacity ||
      (material->HasGradientOpacity(c) && !material->GetDisableGradientOpacity(c));
  }
  const bool twoDimensional = material->GetTransferFunctionMode() == vtkVolumeProperty::TF_2D;
  const bool labels =
    mapper->GetMaskInput() && mapper->GetMaskType() == vtkGPUVolumeRayCastMapper::LabelMapMaskType;
  const bool deferred =
    property->GetDeferred() && blend == vtkVolumeMapper::COMPOSITE_BLEND && !hasField;
  std::ostringstream text;
  const auto define = [&](const char* name, int value)
  { text << "#define " << name << " " << value << "\n"; };
  define("LT_LIGHTS", this->Capacity);
  define("LT_LIGHT_TEXTURE", this->LightsInTexture);
  define("LT_POSITIONAL", positional);
  define("LT_SHADOW",
    property->GetShadowStrength() > 0. && (shadow != 1 || hasExact || hasHarmonics) ? shadow : 0);
  define("LT_EXACT", this->ExactLights);
  define("LT_HARMONICS", textures);
  define("LT_OCCLUSION", occlusionFrom);
  define("LT_ENVIRONMENT", environment);
  define("LT_PBR", property->GetShadingModel() == vtkVolumeLightingProperty::PhysicallyBased);
  define("LT_ISOTROPIC", property->GetAnisotropy() == 0.);
  define("LT_MIXED", property->GetStrength() < 1.);
  define("LT_GRADIENT_OPACITY", gradientOpacity && !twoDimensional);
  define("LT_LABEL_GRADIENT_OPACITY", material->HasLabelGradientOpacity() && !twoDimensional);
  define("LT_TRANSFER_2D", twoDimensional);
  define("LT_COMPONENTS", components);
  define("LT_INDEPENDENT", independent);
  define("LT_CROPPING", mapper->GetCropping() != 0);
  define("LT_CLIPPING", mapper->GetClippingPlanes() != nullptr);
  define("LT_MASK", mapper->GetMaskInput() ? (labels ? 2 : 1) : 0);
  define("LT_DEFERRED", deferred);
  define("LT_OPACITY_COMPONENT", components == 1 ? 0 : components == 2 ? 1 : 3);
  define("LT_SKIPS",
    skips && blend == vtkVolumeMapper::COMPOSITE_BLEND && !independent && !twoDimensional &&
      !labels);
  this->DefinesOfFrame = text.str();
  return true;
}

//------------------------------------------------------------------------------
void VolumeLighting::SetUniforms(vtkShaderProgram* program)
{
  vtkVolumeLightingProperty* property = this->Property;
  const auto set = [&](const char* name, double value)
  {
    if (program->IsUniformUsed(name))
    {
      program->SetUniformf(name, static_cast<float>(value));
    }
  };
  const auto sampler = [&](const std::string& name, vtkTextureObject* texture)
  {
    if (program->IsUniformUsed(name.c_str()))
    {
      texture->Activate();
      program->SetUniformi(name.c_str(), texture->GetTextureUnit());
    }
  };
  const auto vectors = [&](const char* name, const std::vector<float>& values)
  {
    if (program->IsUniformUsed(name) && !values.empty())
    {
      program->SetUniform4fv(name, static_cast<int>(values.size() / 4),
        reinterpret_cast<const float(*)[4]>(values.data()));
    }
  };
  const auto matrix = [&](const char* name, vtkMatrix4x4* value)
  {
    if (program->IsUniformUsed(name))
    {
      vtkNew<vtkMatrix4x4> columnMajor;
      vtkMatrix4x4::Transpose(value, columnMajor);
      program->SetUniformMatrix(name, columnMajor);
    }
  };

  set("in_ltLightingStrength", property->GetStrength());
  set("in_ltShadowStrength", property->GetShadowStrength());
  if (program->IsUniformUsed("in_ltSurfaceOffset"))
  {
    program->SetUniform2f("in_ltSurfaceOffset", this->SurfaceOffset);
  }
  set("in_ltAnisotropy", property->GetAnisotropy());
  set("in_ltOcclusionStrength", property->GetAmbientOcclusion());
  if (program->IsUniformUsed("in_ltMaterial"))
  {
    const float material[2] = { static_cast<float>(property->GetRoughness()),
      static_cast<float>(property->GetMetallic()) };
    program->SetUniform2f("in_ltMaterial", material);
  }
  if (program->IsUniformUsed("in_ltGradientThreshold"))
  {
    program->SetUniform4f("in_ltGradientThreshold", this->Thresholds);
  }
  sampler("in_ltExact", this->ExactTexture);
  for (int t = 0; t < MaxTextures; ++t)
  {
    sampler("in_ltHarmonics" + std::to_string(t), this->HarmonicsTextures[t]);
  }
  matrix("in_ltDatasetToVC", this->DatasetToVC);
  matrix("in_ltWorldToData", this->WorldToData);

  if (this->LightsInTexture)
  {
    sampler("in_ltLights", this->LightTexture);
  }
  else
  {
    vectors("in_ltLights", this->UploadedLights);
  }

  const int textures = this->TexturesUsed;
  if (program->IsUniformUsed("in_ltLightHarmonics") ||
    program->IsUniformUsed("in_ltHarmonicsScale"))
  {
    // Windowed, and linear in the stored values.
    std::vector<double> window(5, 0.);
    vtkVisibilityFactorFilter::GetWindow(this->Order, window.data());
    std::vector<float> scale(static_cast<std::size_t>(4) * textures, 0.F);
    std::vector<float> shift(scale.size(), 0.F);
    const int components = (this->Order + 1) * (this->Order + 1);
    for (int c = 0; c < components; ++c)
    {
      scale[c] = static_cast<float>(window[bandOf(c)] * this->Scale[c]);
      shift[c] = static_cast<float>(window[bandOf(c)] * this->Shift[c]);
    }
    vectors("in_ltHarmonicsScale", scale);
    vectors("in_ltHarmonicsShift", shift);
    std::vector<float> rows;
    for (int i = this->ExactLights; i < this->Capacity; ++i)
    {
      const std::size_t first = rows.size();
      rows.resize(first + static_cast<std::size_t>(4) * (textures + 1), 0.F);
      if (i >= static_cast<int>(this->Lights.size()))
      {
        continue;
      }
      const double* place = this->Lights[i].place;
      const double in[4] = { place[0], place[1], place[2], 0. };
      double data[4];
      this->WorldToData->MultiplyPoint(in, data);
      vtkMath::Normalize(data);
      double Y[25];
      vtkVisibilityFactorFilter::GetHarmonics(this->Order, data, Y);
      double constant = 0.;
      for (int c = 0; c < components; ++c)
      {
        rows[first + c] = static_cast<float>(Y[c] * scale[c]);
        constant += Y[c] * shift[c];
      }
      rows[first + static_cast<std::size_t>(4) * textures] = static_cast<float>(constant);
    }
    vectors("in_ltLightHarmonics", rows);
  }
  vectors("in_ltEnvironment", this->EnvironmentUniform);
  if (program->IsUniformUsed("in_ltEnvironmentMost"))
  {
    program->SetUniform3f("in_ltEnvironmentMost", this->EnvironmentMost);
  }
}

//------------------------------------------------------------------------------
void VolumeLighting::Deactivate()
{
  this->ExactTexture->Deactivate();
  this->LightTexture->Deactivate();
  for (auto& texture : this->HarmonicsTextures)
  {
    texture->Deactivate();
  }
}

//------------------------------------------------------------------------------
void VolumeLighting::Release(vtkWindow* window)
{
  this->ExactTexture->ReleaseGraphicsResources(window);
  this->LightTexture->ReleaseGraphicsResources(window);
  for (auto& texture : this->HarmonicsTextures)
  {
    texture->ReleaseGraphicsResources(window);
  }
  this->UploadedHarmonics = nullptr;
  this->UploadedExact = nullptr;
  this->UploadedOcclusion = nullptr;
  this->UploadedLights.clear();
  this->TexturesUsed = 0;
  this->ExactUsed = false;
  this->Window = nullptr;
}
