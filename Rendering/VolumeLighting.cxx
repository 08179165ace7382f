// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "VolumeLighting.h"

#include "VolumeExtinction.h"
#include "vtkLightTransportCompat.h"
#include "vtkVisibilityFactorFilter.h"

#include "vtkAbstractMapper.h"
#include "vtkAlgorithmOutput.h"
#include "vtkCommand.h"
#include "vtkContourValues.h"
#include "vtkDataArray.h"
#include "vtkGPUVolumeRayCastMapper.h"
#include "vtkImageData.h"
#include "vtkLight.h"
#include "vtkLightCollection.h"
#include "vtkMath.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkOpenGLRenderer.h"
#include "vtkPBRIrradianceTexture.h"
#include "vtkPointData.h"
#include "vtkRenderer.h"
#include "vtkSMPTools.h"
#include "vtkShaderProgram.h"
#include "vtkTexture.h"
#include "vtkVolume.h"
#include "vtkVolumeProperty.h"

// GLEW or glad, by VTK's version.
#include LIGHTTRANSPORT_GL_HEADER

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <sstream>

namespace
{
/** More lights than this, and they come from a texture. */
constexpr int MostUniformLights = 32;
constexpr int TexelsPerLight = 5;

bool isBlack(const double rgb[3])
{
  return rgb[0] <= 0. && rgb[1] <= 0. && rgb[2] <= 0.;
}
} // namespace

//------------------------------------------------------------------------------
VolumeLighting::VolumeLighting() = default;
VolumeLighting::~VolumeLighting() = default;

//------------------------------------------------------------------------------
void VolumeLighting::SetVisibilityConnection(vtkAlgorithmOutput* output)
{
  this->Visibility.SetConnection(
    output ? output->GetProducer() : nullptr, output ? output->GetIndex() : 0);
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
    if (vtkMath::Normalize(light.axis) == 0. && !light.positional)
    {
      continue; // from nowhere
    }
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
        rows[4 * j + k] = static_cast<float>(at(color, j, k) * this->Visibility.GetScale(j));
        constant += at(color, j, k) * this->Visibility.GetShift(j);
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

  // What is needed.
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
  if (shadow == vtkVolumeLightingProperty::RayTraced && partitioned)
  {
    shadow = vtkVolumeLightingProperty::Precomputed; // a ray sees its own block alone
  }
  const bool shadows = shadow != vtkVolumeLightingProperty::NoShadows;
  const bool precomputed =
    shadow == vtkVolumeLightingProperty::Precomputed && property->GetShadowStrength() > 0.;
  const bool environment = property->GetEnvironmentStrength() > 0.;
  const bool occlusion = shadows && property->GetAmbientOcclusion() > 0. && ambient > 0.;
  vtkMatrix4x4::Invert(volume->GetMatrix(), this->WorldToData);
  VolumeVisibility::Needs needs;
  needs.mapper = mapper;
  needs.volume = volume;
  needs.resolution = property->GetVisibilityResolution();
  needs.colored = property->GetColoredShadows();
  needs.order = property->GetVisibilityOrder();
  needs.mean = occlusion;
  const int exactLights = precomputed ? std::min(lights, property->GetNumberOfExactLights()) : 0;
  for (int i = 0; i < exactLights; ++i)
  {
    const Light& light = this->Lights[i];
    const double in[4] = { light.place[0], light.place[1], light.place[2],
      light.positional ? 1. : 0. };
    std::array<double, 4> out;
    this->WorldToData->MultiplyPoint(in, out.data());
    const double length = light.positional ? 1. : std::max(vtkMath::Norm(out.data()), 1e-300);
    needs.lights.push_back({ { out[0] / length, out[1] / length, out[2] / length, in[3] } });
  }
  needs.harmonics = (precomputed && lights > exactLights) || (shadows && environment);

  // The visibility, on the CPU and on the GPU.
  bool looksUp = needs.harmonics || needs.mean || exactLights > 0;
  if (looksUp)
  {
    problem = this->Visibility.Prepare(window, needs);
    if (!problem.empty())
    {
      problem[0] = static_cast<char>(std::toupper(problem[0]));
      problem += "; the volume is lit without shadows.";
      looksUp = false;
    }
  }
  const int textures = looksUp ? this->Visibility.NumberOfHarmonics() : 0;
  this->ExactLights = looksUp ? this->Visibility.NumberOfExactLights() : 0;

  // Directions and places.
  const double scale = std::cbrt(std::abs(volume->GetMatrix()->Determinant()));
  for (int i = 0; i < 9; ++i)
  {
    this->WorldToData->SetElement(
      i / 3, i % 3, this->WorldToData->GetElement(i / 3, i % 3) * (scale > 0. ? scale : 1.));
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
    int steps[3];
    VolumeExtinctionSteps(n, image->GetSpacing(), property->GetVisibilityResolution(), steps);
    vtkNew<vtkMatrix4x4> worldToIndex;
    vtkMatrix4x4::Invert(volume->GetMatrix(), worldToIndex);
    vtkMatrix4x4::Multiply4x4(image->GetPhysicalToIndexMatrix(), worldToIndex, this->WorldToSteps);
    for (int row = 0; row < 3; ++row)
    {
      for (int column = 0; column < 3; ++column)
      {
        this->WorldToSteps->SetElement(
          row, column, this->WorldToSteps->GetElement(row, column) / steps[row]);
      }
    }
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
  const bool casts = property->GetShadowStrength() > 0. &&
    (shadow == vtkVolumeLightingProperty::RayTraced || this->ExactLights > 0 || textures > 0);
  define("LT_SHADOW", casts ? shadow : 0);
  text << (looksUp
      ? this->Visibility.Defines()
      : std::string("#define LT_EXACT 0\n#define LT_EXACT_TEXTURES 0\n#define LT_HARMONICS 0\n"
                    "#define LT_MEAN 0\n#define LT_RGB ") +
        (casts && needs.colored ? "1\n" : "0\n"));
  define("LT_ENVIRONMENT", environment);
  define("LT_PBR", property->GetShadingModel() == vtkVolumeLightingProperty::PhysicallyBased);
  define("LT_ISOTROPIC", property->GetAnisotropy() == 0.);
  define("LT_MIXED", property->GetStrength() < 1.);
  define("LT_GRADIENT_OPACITY", gradientOpacity && !twoDimensional);
  define("LT_LABEL_GRADIENT_OPACITY", material->HasLabelGradientOpacity() && !twoDimensional);
  define("LT_TRANSFER_2D", twoDimensional);
  define("LT_COMPONENTS", components);
  define("LT_INDEPENDENT", independent);
  const bool isosurface = blend == vtkVolumeMapper::ISOSURFACE_BLEND;
  const int contours = material->GetIsoSurfaceValues()->GetNumberOfContours();
  define("LT_BLEND_ISOSURFACE", isosurface && contours > 0);
  define("LT_CONTOURS", isosurface ? contours : 0);
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
  set("in_ltSurfaceOffset", property->GetSurfaceOffset());
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
  this->Visibility.SetUniforms(program);
  matrix("in_ltDatasetToVC", this->Visibility.GetDataToGrid());
  matrix("in_ltWorldToData", this->WorldToData);
  matrix("in_ltWorldToSteps", this->WorldToSteps);

  if (this->LightsInTexture)
  {
    sampler("in_ltLights", this->LightTexture);
  }
  else
  {
    vectors("in_ltLights", this->UploadedLights);
  }

  const int textures = this->Visibility.NumberOfHarmonics();
  if (program->IsUniformUsed("in_ltLightHarmonics"))
  {
    // Windowed, and linear in the stored values.
    const int order = this->Visibility.GetOrder();
    const int components = (order + 1) * (order + 1);
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
      vtkVisibilityFactorFilter::GetHarmonics(order, data, Y);
      double constant = 0.;
      for (int c = 0; c < components; ++c)
      {
        const double y = this->Visibility.GetWindow(c) * Y[c];
        rows[first + c] = static_cast<float>(y * this->Visibility.GetScale(c));
        constant += y * this->Visibility.GetShift(c);
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
  this->Visibility.Deactivate();
  this->LightTexture->Deactivate();
}

//------------------------------------------------------------------------------
void VolumeLighting::Release(vtkWindow* window)
{
  this->Visibility.Release(window);
  this->LightTexture->ReleaseGraphicsResources(window);
  this->UploadedLights.clear();
  this->Window = nullptr;
}
