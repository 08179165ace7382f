// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "VolumeVisibility.h"

#include "VolumeExtinction.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportCompat.h"

#include "vtkAlgorithm.h"
#include "vtkCommand.h"
#include "vtkExecutive.h"
#include "vtkGPUVolumeRayCastMapper.h"
#include "vtkMath.h"
#include "vtkObjectFactory.h"
#include "vtkOpenGLRenderWindow.h"
#include "vtkPointData.h"
#include "vtkSMPTools.h"
#include "vtkShaderProgram.h"
#include "vtkVolume.h"

// GLEW or glad, by VTK's version.
#include LIGHTTRANSPORT_GL_HEADER

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace
{
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

/** The filter's error, or nothing. */
std::string errorOfUpdate(vtkAlgorithm* filter)
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

/** Of a camera that pans, the headlight stays but for rounding. */
bool same(const std::array<double, 4>& a, const std::array<double, 4>& b)
{
  const double scale = std::hypot(a[0], a[1], a[2]);
  bool result = a[3] == b[3];
  for (int i = 0; i < 3; ++i)
  {
    result = result && std::abs(a[i] - b[i]) <= 1e-9 * scale;
  }
  return result;
}

std::string dimensionsAsString(const int n[3])
{
  return std::to_string(n[0]) + " x " + std::to_string(n[1]) + " x " + std::to_string(n[2]);
}
} // namespace

//------------------------------------------------------------------------------
void VolumeVisibility::SetConnection(vtkAlgorithm* producer, int port)
{
  this->Producer = producer;
  this->Port = port;
}

//------------------------------------------------------------------------------
int VolumeVisibility::BandOf(int component)
{
  return static_cast<int>(std::sqrt(static_cast<double>(component) + .5));
}

//------------------------------------------------------------------------------
std::string VolumeVisibility::FindImage(const Needs& needs, vtkImageData*& image)
{
  if (this->Producer)
  {
    this->Producer->Update(this->Port);
    image = vtkImageData::SafeDownCast(this->Producer->GetOutputDataObject(this->Port));
    return image && image->GetNumberOfPoints() > 0
      ? std::string()
      : "the visibility from " + std::string(this->Producer->GetClassName()) +
        " is empty, expected an image of a vtkVisibilityFactorFilter";
  }
  const std::vector<double> key =
    VolumeExtinctionKey(needs.mapper, needs.volume, needs.resolution, needs.colored);
  if (key != this->DrawnKey)
  {
    this->DrawnKey = key;
    this->DrawnProblem =
      VolumeExtinction(needs.mapper, needs.volume, needs.resolution, needs.colored, this->Drawn);
    this->Drawn->Modified();
  }
  image = this->Drawn;
  return this->DrawnProblem;
}

//------------------------------------------------------------------------------
/** `order` < 0: no harmonics. */
std::string VolumeVisibility::Compute(
  vtkImageData* image, vtkDataArray* extinction, const Needs& needs, int lights, int order)
{
  if (extinction != this->MediumArray || image->GetMTime() > this->Medium->GetMTime() ||
    extinction->GetMTime() > this->Medium->GetMTime())
  {
    this->Medium->Initialize();
    this->Medium->CopyStructure(image);
    this->Medium->GetPointData()->AddArray(extinction);
    this->Medium->Modified();
    this->MediumArray = extinction;
  }
  vtkVisibilityFactorFilter* filter = this->Filter;
  filter->SetInputData(this->Medium);
  filter->SetRGBExtinction(extinction->GetNumberOfComponents() == 3);
  filter->SeparateLightsOn();
  filter->SetSphericalHarmonics(order >= 0);
  if (order >= 0)
  {
    filter->SetOrder(order);
  }
  if (filter->GetNumberOfLights() > lights)
  {
    filter->RemoveAllLights(); // their fields are kept
  }
  this->FilterLights.resize(static_cast<std::size_t>(lights), { { 0., 0., 0., -1. } });
  for (int i = 0; i < lights; ++i)
  {
    std::array<double, 4>& light = this->FilterLights[i];
    light = same(needs.lights[i], light) ? light : needs.lights[i];
    if (filter->GetNumberOfLights() == i)
    {
      filter->AddDirectionalLight(0., 0., 1.);
    }
    light[3] != 0. ? filter->SetLightPosition(i, light[0], light[1], light[2])
                   : filter->SetLightDirection(i, light[0], light[1], light[2]);
  }
  const std::string problem = errorOfUpdate(filter);
  return problem.empty() && filter->GetOutput()->GetNumberOfPoints() == 0
    ? "the visibility was not computed"
    : problem;
}

//------------------------------------------------------------------------------
VolumeVisibility::Channel VolumeVisibility::ChannelOf(
  vtkDataArray* array, int component, int count, int stride)
{
  Channel channel;
  channel.array = array;
  channel.time = array->GetMTime();
  channel.component = component;
  channel.count = count;
  channel.stride = stride;
  return channel;
}

//------------------------------------------------------------------------------
template <typename T>
void VolumeVisibility::Pack(const Channel& channel, vtkIdType points, T* to, int stride)
{
  vtkDataArray* array = channel.array;
  const int components = array->GetNumberOfComponents();
  const auto* floats = array->GetDataType() == VTK_FLOAT && array->HasStandardMemoryLayout()
    ? static_cast<const float*>(array->GetVoidPointer(0))
    : nullptr;
  constexpr auto top = static_cast<float>(std::numeric_limits<T>::max());
  const auto factor = static_cast<float>(top / (channel.scale * channel.count));
  const auto offset = static_cast<float>(.5 - top * channel.shift / channel.scale);
  vtkSMPTools::For(0, points, 65536,
    [&](vtkIdType begin, vtkIdType end)
    {
      for (vtkIdType i = begin; i < end; ++i)
      {
        float sum = 0.F;
        for (int k = 0, c = channel.component; k < channel.count; ++k, c += channel.stride)
        {
          sum +=
            floats ? floats[i * components + c] : static_cast<float>(array->GetComponent(i, c));
        }
        // Also 0 for a NaN.
        const float value = factor * sum + offset;
        to[i * stride] = static_cast<T>(value > 0.F ? (value < top ? value : top) : 0.F);
      }
    });
}

//------------------------------------------------------------------------------
/** Linear between its texels; false where the GPU has no room. `keep`: channels may change. */
bool VolumeVisibility::Upload(vtkOpenGLRenderWindow* window, Texture& texture, const int n[3],
  std::vector<Channel> channels, bool keep)
{
  if (channels.size() == 3)
  {
    channels.push_back(channels.back()); // GPUs pad three to four
  }
  const auto count = static_cast<int>(channels.size());
  const bool fits = texture.object->GetHandle() && texture.channels.size() == channels.size() &&
    std::equal(n, n + 3, texture.size);
  const vtkIdType points = static_cast<vtkIdType>(n[0]) * n[1] * n[2];
  std::vector<bool> changed(channels.size(), true);
  for (int c = 0; c < count && fits; ++c)
  {
    changed[c] = channels[c].array != texture.channels[c].array ||
      channels[c].time != texture.channels[c].time ||
      channels[c].component != texture.channels[c].component ||
      channels[c].count != texture.channels[c].count;
  }
  if (std::find(changed.begin(), changed.end(), true) == changed.end())
  {
    return true;
  }
  const std::size_t bytes = static_cast<std::size_t>(points) * count * (this->Wide ? 2 : 1);
  if (texture.bytes.size() != bytes)
  {
    texture.bytes.assign(bytes, 0);
    changed.assign(channels.size(), true);
  }
  for (int c = 0; c < count; ++c)
  {
    if (changed[c] && this->Wide)
    {
      Pack(channels[c], points, reinterpret_cast<unsigned short*>(texture.bytes.data()) + c, count);
    }
    else if (changed[c])
    {
      Pack(channels[c], points, texture.bytes.data() + c, count);
    }
  }
  ++this->Uploads;
  vtkTextureObject* object = texture.object;
  texture.channels = std::move(channels);
  std::copy_n(n, 3, texture.size);
  const int type = this->Wide ? VTK_UNSIGNED_SHORT : VTK_UNSIGNED_CHAR;
  if (fits)
  {
    object->Activate();
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glTexSubImage3D(GL_TEXTURE_3D, 0, 0, 0, 0, n[0], n[1], n[2],
      object->GetFormat(type, count, false), object->GetDataType(type), texture.bytes.data());
    object->Deactivate();
  }
  else
  {
    while (glGetError() != GL_NO_ERROR)
    {
    }
    object->ReleaseGraphicsResources(window);
    object->SetContext(window);
    object->ResetFormatAndType();
    const int narrow[4] = { GL_R8, GL_RG8, 0, GL_RGBA8 };
    const int wide[4] = { GL_R16, GL_RG16, 0, GL_RGBA16 };
    object->SetInternalFormat((this->Wide ? wide : narrow)[count - 1]);
    object->SetWrapS(vtkTextureObject::ClampToEdge);
    object->SetWrapT(vtkTextureObject::ClampToEdge);
    object->SetWrapR(vtkTextureObject::ClampToEdge);
    object->SetMinificationFilter(vtkTextureObject::Linear);
    object->SetMagnificationFilter(vtkTextureObject::Linear);
    if (!object->Create3DFromRaw(n[0], n[1], n[2], count, type, texture.bytes.data()) ||
      glGetError() == GL_OUT_OF_MEMORY)
    {
      object->ReleaseGraphicsResources(window);
      texture.channels.clear();
      return false;
    }
  }
  if (!keep)
  {
    texture.bytes = std::vector<unsigned char>();
  }
  return true;
}

//------------------------------------------------------------------------------
std::string VolumeVisibility::Prepare(vtkOpenGLRenderWindow* window, const Needs& needs)
{
  this->ExactLights = this->ExactTextures = this->HarmonicsTextures = 0;
  this->Colored = false;
  this->DefinesOfFrame.clear();
  if (this->Last != window)
  {
    this->Release(this->Last);
    this->Last = window;
  }

  // What there is.
  vtkImageData* image = nullptr;
  std::string problem = this->FindImage(needs, image);
  if (!problem.empty())
  {
    return problem;
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
      "\" with a tuple per point, expected one of them, as vtkVisibilityFactorFilter gives them";
  }
  int order = -1;
  int colors = 1; // of the harmonics
  if (harmonics)
  {
    const int components = harmonics->GetNumberOfComponents();
    // Of three colours 3 (order + 1)^2, which is no square.
    colors = components % 3 == 0 && components != 9 ? 3 : 1;
    order = BandOf(components / colors - 1);
    if (colors * (order + 1) * (order + 1) != components || order > 4)
    {
      return std::string("the visibility's array \"") + vtkLightTransportArrays::VisibilitySH +
        "\" has " + std::to_string(components) +
        " components, expected 1, 4, 9, 16 or 25, or three times as many";
    }
  }
  const int channels = extinction ? extinction->GetNumberOfComponents() : 1;
  if (channels != 1 && channels != 3)
  {
    return std::string("the visibility's array \"") + vtkLightTransportArrays::Extinction +
      "\" has " + std::to_string(channels) + " components, expected 1, or 3 for colours";
  }
  int n[3];
  image->GetDimensions(n);
  const int limit = vtkTextureObject::GetMaximumTextureSize3D(window);
  if (limit > 0 && *std::max_element(n, n + 3) > limit)
  {
    return "the visibility has " + dimensionsAsString(n) + " points, expected at most " +
      std::to_string(limit) + " along each axis, the limit of this GPU's 3-D textures";
  }

  // What is missing is computed.
  const auto wanted = static_cast<int>(needs.lights.size());
  const int lights =
    extinction ? std::min(wanted, channels == 3 ? MostColoredLights : MostLights) : 0;
  const bool directions = needs.harmonics || wanted > lights;
  const bool computes = !harmonics && (directions || needs.mean);
  vtkPointData* computed = nullptr;
  if (lights > 0 || computes)
  {
    problem = this->Compute(
      image, extinction, needs, lights, computes ? (directions ? needs.order : 0) : -1);
    if (!problem.empty())
    {
      return "the visibility could not be computed: " + problem;
    }
    computed = this->Filter->GetOutput()->GetPointData();
  }
  if (computes)
  {
    harmonics = computed->GetArray(vtkLightTransportArrays::VisibilitySH);
    order = directions ? needs.order : 0;
    colors = channels;
    this->Computations += harmonics != this->Computed ? 1 : 0;
    this->Computed = harmonics;
  }

  // On the GPU: the harmonics, of three colours their mean.
  window->MakeCurrent();
  bool room = true;
  this->Order = order;
  vtkVisibilityFactorFilter::GetWindow(order, this->Window);
  if (directions)
  {
    const int coefficients = (order + 1) * (order + 1);
    const int textures = (coefficients + 3) / 4;
    for (int t = 0; t < textures && room; ++t)
    {
      std::vector<Channel> four;
      Texture& texture = this->Harmonics[t];
      for (int c = 4 * t; c < std::min(4 * t + 4, coefficients); ++c)
      {
        four.push_back(ChannelOf(harmonics, c, colors, coefficients));
        const bool known = four.size() <= texture.channels.size() &&
          texture.channels[four.size() - 1].array == harmonics &&
          texture.channels[four.size() - 1].time == harmonics->GetMTime();
        if (!known)
        {
          double range[2] = { VTK_DOUBLE_MAX, VTK_DOUBLE_MIN };
          for (int k = 0; k < colors; ++k)
          {
            double one[2];
            harmonics->GetFiniteRange(one, c + k * coefficients);
            range[0] = std::min(range[0], one[0]);
            range[1] = k > 0 ? std::max(range[1], one[1]) : one[1];
          }
          this->Shift[c] = range[0];
          this->Scale[c] = std::max(range[1] - range[0], 1e-12);
        }
        four.back().shift = this->Shift[c];
        four.back().scale = this->Scale[c];
      }
      room = this->Upload(window, texture, n, four, false);
    }
    this->HarmonicsTextures = textures;
  }

  // The lights' fields, and the mean where it is not in the harmonics.
  const bool mean = needs.mean && !directions;
  std::vector<std::vector<Channel>> exact;
  for (int l = 0; l < lights; ++l)
  {
    vtkDataArray* field =
      computed->GetArray((vtkLightTransportArrays::Visibility + std::to_string(l)).c_str());
    if (channels == 3 || l % 4 == 0)
    {
      exact.emplace_back();
    }
    for (int c = 0; c < channels; ++c)
    {
      exact.back().push_back(ChannelOf(field, c));
    }
  }
  if (mean)
  {
    if (exact.empty() || (channels == 1 && exact.back().size() == 4))
    {
      exact.emplace_back();
    }
    Channel channel = ChannelOf(harmonics, 0, colors, (order + 1) * (order + 1));
    channel.scale = std::sqrt(4. * vtkMath::Pi());
    (channels == 3 ? exact.front() : exact.back()).push_back(channel);
  }
  for (std::size_t t = 0; t < exact.size() && room; ++t)
  {
    room = this->Upload(window, this->Exact[t], n, exact[t], true);
  }
  if (!room)
  {
    this->Release(window);
    this->Last = window;
    this->HarmonicsTextures = 0;
    return "the GPU has no room for the visibility of " + dimensionsAsString(n) +
      " points, expected a coarser one (VisibilityResolution, ResolutionFactor) or a lower order";
  }
  this->ExactLights = lights;
  this->ExactTextures = static_cast<int>(exact.size());
  this->Colored = channels == 3;

  vtkNew<vtkMatrix4x4> indexToGrid;
  const int* extent = image->GetExtent();
  for (int a = 0; a < 3; ++a)
  {
    indexToGrid->SetElement(a, a, 1. / n[a]);
    indexToGrid->SetElement(a, 3, (.5 - extent[2 * a]) / n[a]);
  }
  vtkMatrix4x4::Multiply4x4(indexToGrid, image->GetPhysicalToIndexMatrix(), this->DataToGrid);
  const auto define = [this](const char* name, int value)
  { this->DefinesOfFrame += std::string("#define ") + name + " " + std::to_string(value) + "\n"; };
  define("LT_EXACT", this->ExactLights);
  define("LT_EXACT_TEXTURES", this->ExactTextures);
  define("LT_RGB", this->Colored);
  define("LT_HARMONICS", this->HarmonicsTextures);
  define("LT_MEAN", !needs.mean ? 0 : mean ? 1 : 2);
  return {};
}

//------------------------------------------------------------------------------
void VolumeVisibility::SetUniforms(vtkShaderProgram* program)
{
  const auto sampler = [&](const std::string& name, vtkTextureObject* texture)
  {
    if (program->IsUniformUsed(name.c_str()))
    {
      texture->Activate();
      program->SetUniformi(name.c_str(), texture->GetTextureUnit());
    }
  };
  for (int t = 0; t < this->ExactTextures; ++t)
  {
    sampler("in_ltExact" + std::to_string(t), this->Exact[t].object);
  }
  for (int t = 0; t < this->HarmonicsTextures; ++t)
  {
    sampler("in_ltHarmonics" + std::to_string(t), this->Harmonics[t].object);
  }
  if (program->IsUniformUsed("in_ltHarmonicsScale"))
  {
    float scale[MostTextures][4] = {};
    float shift[MostTextures][4] = {};
    for (int c = 0; c < (this->Order + 1) * (this->Order + 1); ++c)
    {
      scale[c / 4][c % 4] = static_cast<float>(this->GetWindow(c) * this->Scale[c]);
      shift[c / 4][c % 4] = static_cast<float>(this->GetWindow(c) * this->Shift[c]);
    }
    program->SetUniform4fv("in_ltHarmonicsScale", this->HarmonicsTextures, scale);
    program->SetUniform4fv("in_ltHarmonicsShift", this->HarmonicsTextures, shift);
  }
}

//------------------------------------------------------------------------------
void VolumeVisibility::Deactivate()
{
  for (Texture& texture : this->Exact)
  {
    texture.object->Deactivate();
  }
  for (Texture& texture : this->Harmonics)
  {
    texture.object->Deactivate();
  }
}

//------------------------------------------------------------------------------
void VolumeVisibility::Release(vtkWindow* window)
{
  const auto release = [window](Texture& texture)
  {
    texture.object->ReleaseGraphicsResources(window);
    texture.channels.clear();
    texture.bytes = std::vector<unsigned char>();
  };
  std::for_each(this->Exact, this->Exact + MostExactTextures, release);
  std::for_each(this->Harmonics, this->Harmonics + MostTextures, release);
  this->Last = nullptr;
}
