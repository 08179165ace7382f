// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkVisibilityFactorFilter.h"

#include "Core/Buffer.h"
#include "Core/Kernel.h"
#include "Core/Visibility.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportImage.h"
#include "vtkLightTransportInternal.h"

#include "vtkDataArray.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkMath.h"
#include "vtkMatrix3x3.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPointData.h"
#include "vtkScalarsToColors.h"
#include "vtkSmartPointer.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkUnsignedCharArray.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <new>
#include <sstream>
#include <utility>
#include <vector>

vtkStandardNewMacro(vtkVisibilityFactorFilter);
vtkCxxSetObjectMacro(vtkVisibilityFactorFilter, ScalarOpacity, vtkPiecewiseFunction);
vtkCxxSetObjectMacro(vtkVisibilityFactorFilter, GradientOpacity, vtkPiecewiseFunction);
vtkCxxSetObjectMacro(vtkVisibilityFactorFilter, TransferFunction2D, vtkImageData);
vtkCxxSetObjectMacro(vtkVisibilityFactorFilter, Color, vtkScalarsToColors);

namespace
{
using namespace lighttransport;
namespace image = vtkLightTransportImage;

constexpr double OpaqueDepth = 20.; // over the smallest spacing
constexpr double LongestTable = 65536.;
constexpr int TableSize = 16384;
constexpr double ColourFloor = 0.1;

double Now()
{
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/** A function of the scalar, tabulated: at each whole number, or between entries. */
class Table
{
public:
  template <class F>
  Table(double low, double high, bool whole, const F& f)
    : first(low)
  {
    const bool short_ = whole && high - low < LongestTable;
    const int n = short_ ? static_cast<int>(high - low) + 1 : TableSize + 1;
    this->perScalar = short_ ? 1. : (high > low ? TableSize / (high - low) : 0.);
    for (int i = 0; i < n; ++i)
    {
      const double t = static_cast<double>(i) / TableSize;
      this->values.push_back(f(short_ ? low + i : low * (1. - t) + high * t));
    }
  }
  double operator()(double scalar) const
  {
    const double last = static_cast<double>(this->values.size()) - 1.;
    const double at = std::min(std::max((scalar - this->first) * this->perScalar, 0.), last);
    const std::size_t i = std::min(static_cast<std::size_t>(at), this->values.size() - 1);
    const std::size_t next = std::min(i + 1, this->values.size() - 1);
    return this->values[i] + (at - static_cast<double>(i)) * (this->values[next] - this->values[i]);
  }

private:
  double first = 0.;
  double perScalar = 1.;
  std::vector<double> values;
};

/** RGBA of a 2-D transfer function, linear between pixels, clamped to them. */
class Table2D
{
public:
  explicit Table2D(vtkImageData* function)
  {
    function->GetDimensions(this->dims);
    vtkDataArray* scalars = function->GetPointData()->GetScalars();
    const double scale = scalars->GetDataType() == VTK_UNSIGNED_CHAR ? 1. / 255. : 1.;
    this->values.resize(std::size_t(4) * this->dims[0] * this->dims[1]);
    for (std::size_t i = 0; i < this->values.size(); ++i)
    {
      const auto tuple = static_cast<vtkIdType>(i / 4);
      this->values[i] = scale * scalars->GetComponent(tuple, static_cast<int>(i % 4));
    }
  }
  /** At (u, v) in [0, 1]. */
  void at(double u, double v, double rgba[4]) const
  {
    const double place[2] = { u, v };
    int low[2];
    int high[2];
    double w[2];
    for (int a = 0; a < 2; ++a)
    {
      const double x = std::min(std::max(place[a] * this->dims[a] - 0.5, 0.), this->dims[a] - 1.);
      low[a] = static_cast<int>(x);
      high[a] = std::min(low[a] + 1, this->dims[a] - 1);
      w[a] = x - low[a];
    }
    for (int c = 0; c < 4; ++c)
    {
      const auto pixel = [&](int i, int j)
      { return this->values[4 * (i + std::size_t(this->dims[0]) * j) + c]; };
      const double below = (1. - w[0]) * pixel(low[0], low[1]) + w[0] * pixel(high[0], low[1]);
      const double above = (1. - w[0]) * pixel(low[0], high[1]) + w[0] * pixel(high[0], high[1]);
      rgba[c] = (1. - w[1]) * below + w[1] * above;
    }
  }

private:
  int dims[3] = { 0, 0, 0 };
  std::vector<double> values;
};

/** Nodes outside [0, 1], or no nodes: a message, else nothing. */
std::string FunctionProblem(vtkPiecewiseFunction* function, const char* name)
{
  std::ostringstream text;
  if (function->GetSize() == 0)
  {
    text << name << " has no points, expected a function";
  }
  for (int i = 0; i < function->GetSize() && text.str().empty(); ++i)
  {
    double node[4];
    function->GetNodeValue(i, node);
    if (!std::isfinite(node[0]) || !(node[1] >= 0. && node[1] <= 1.))
    {
      text << name << " has the value " << node[1] << " at " << node[0]
           << ", expected values in [0, 1]";
    }
  }
  return text.str();
}

/** The length of the gradient as VTK's GPU mapper measures it, a row at a time. */
class GradientRow
{
public:
  GradientRow(const Grid& g, const ValueReader& r)
    : grid(g)
    , read(r)
    , rows(5 * std::size_t(g.dims[0]))
  {
    const double mean = (g.spacing[0] + g.spacing[1] + g.spacing[2]) / 3.;
    for (int a = 0; a < 3; ++a)
    {
      this->scale[a] = mean / g.spacing[a];
    }
  }
  void compute(std::int64_t row, const double* here, double* length)
  {
    const int nx = this->grid.dims[0];
    const int j = static_cast<int>(row % this->grid.dims[1]);
    const int k = static_cast<int>(row / this->grid.dims[1]);
    const int at[4][2] = { { std::max(j - 1, 0), k },
      { std::min(j + 1, this->grid.dims[1] - 1), k }, { j, std::max(k - 1, 0) },
      { j, std::min(k + 1, this->grid.dims[2] - 1) } };
    for (int r = 0; r < 4; ++r)
    {
      this->read(
        this->grid.index(0, at[r][0], at[r][1]), nx, this->rows.data() + std::ptrdiff_t(r) * nx);
    }
    for (int i = 0; i < nx; ++i)
    {
      const double differences[3] = { here[std::min(i + 1, nx - 1)] - here[std::max(i - 1, 0)],
        this->rows[std::size_t(nx) + i] - this->rows[i],
        this->rows[std::size_t(3) * nx + i] - this->rows[std::size_t(2) * nx + i] };
      double sum = 0.;
      for (int a = 0; a < 3; ++a)
      {
        const double d = differences[a] * this->scale[a];
        sum += std::isnan(d) ? 0. : d * d;
      }
      length[i] = std::sqrt(sum);
    }
  }

private:
  const Grid& grid;
  const ValueReader& read;
  std::vector<double> rows;
  double scale[3];
};

/** Overlap of the coarse voxel `at` of m with the n fine ones: first voxel and weights. */
int Overlap(int at, int m, int n, std::vector<double>& weights)
{
  const double low = static_cast<double>(at) * n / m;
  const double high = static_cast<double>(at + 1) * n / m;
  const int first = std::min(static_cast<int>(low), n - 1);
  weights.clear();
  for (int i = first; i < n && i < high; ++i)
  {
    weights.push_back((std::min(high, i + 1.) - std::max(low, double(i))) / (high - low));
  }
  return first;
}

/** The mean over coarse voxels that cover the same domain. */
void Coarsen(
  const Grid& fine, const float* in, const Grid& coarse, float* out, const ParallelFor& parallel)
{
  const std::int64_t rows = static_cast<std::int64_t>(coarse.dims[1]) * coarse.dims[2];
  ForRows(parallel, rows, fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      std::vector<double> x;
      std::vector<double> y;
      std::vector<double> z;
      for (std::int64_t row = begin; row < end; ++row)
      {
        const int J = static_cast<int>(row % coarse.dims[1]);
        const int K = static_cast<int>(row / coarse.dims[1]);
        const int j0 = Overlap(J, coarse.dims[1], fine.dims[1], y);
        const int k0 = Overlap(K, coarse.dims[2], fine.dims[2], z);
        for (int I = 0; I < coarse.dims[0]; ++I)
        {
          const int i0 = Overlap(I, coarse.dims[0], fine.dims[0], x);
          double sum = 0.;
          for (std::size_t k = 0; k < z.size(); ++k)
          {
            for (std::size_t j = 0; j < y.size(); ++j)
            {
              const float* from =
                in + fine.index(i0, j0 + static_cast<int>(j), k0 + static_cast<int>(k));
              double line = 0.;
              for (std::size_t i = 0; i < x.size(); ++i)
              {
                line += x[i] * static_cast<double>(from[i]);
              }
              sum += z[k] * y[j] * line;
            }
          }
          out[coarse.index(I, J, K)] = static_cast<float>(sum);
        }
      }
    });
}

struct Light
{
  bool positional = false;
  std::array<double, 3> at{ { 0., 0., 1. } };
  bool operator==(const Light& other) const
  {
    return this->positional == other.positional && this->at == other.at;
  }
};
} // namespace

//------------------------------------------------------------------------------
struct vtkVisibilityFactorFilter::State
{
  std::vector<Light> lights;

  // Stages 1 and 2.
  std::string extinctionKey;
  Grid grid;
  std::array<std::array<double, 3>, 3> axes{};
  std::vector<Buffer<float>> sigma_t; // one, or red, green, blue
  VisibilityScratch scratch[3];
  // Stage 3.
  std::string harmonicsKey;
  vtkSmartPointer<vtkFloatArray> harmonics;
  // Stage 4.
  struct Field
  {
    Light light;
    vtkSmartPointer<vtkFloatArray> values;
  };
  std::string fieldsKey;
  std::vector<Field> fields;
  vtkSmartPointer<vtkFloatArray> visibility; // of all lights, where it is asked for

  void forget()
  {
    this->extinctionKey.clear();
    this->sigma_t.clear();
    for (VisibilityScratch& one : this->scratch)
    {
      one = VisibilityScratch();
    }
    this->forgetHarmonics();
    this->forgetFields();
  }
  void forgetHarmonics()
  {
    this->harmonicsKey.clear();
    this->harmonics = nullptr;
  }
  void forgetFields()
  {
    this->fieldsKey.clear();
    this->fields.clear();
    this->visibility = nullptr;
  }
};

//------------------------------------------------------------------------------
vtkVisibilityFactorFilter::vtkVisibilityFactorFilter()
  : ExtinctionArrayName(vtkLightTransportArrays::Extinction)
  , Kept(new State)
{
  this->SetInputArrayToProcess(
    0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, vtkDataSetAttributes::SCALARS);
}

//------------------------------------------------------------------------------
vtkVisibilityFactorFilter::~vtkVisibilityFactorFilter()
{
  this->SetScalarOpacity(nullptr);
  this->SetGradientOpacity(nullptr);
  this->SetTransferFunction2D(nullptr);
  this->SetColor(nullptr);
}

//------------------------------------------------------------------------------
vtkMTimeType vtkVisibilityFactorFilter::GetMTime()
{
  vtkMTimeType time = this->Superclass::GetMTime();
  vtkObject* objects[4] = { this->ScalarOpacity, this->GradientOpacity, this->TransferFunction2D,
    this->Color };
  for (vtkObject* object : objects)
  {
    time = object ? std::max(time, object->GetMTime()) : time;
  }
  return time;
}

//------------------------------------------------------------------------------
int vtkVisibilityFactorFilter::AddDirectionalLight(double x, double y, double z)
{
  this->Kept->lights.push_back({ false, { { x, y, z } } });
  this->Modified();
  return this->GetNumberOfLights() - 1;
}

//------------------------------------------------------------------------------
int vtkVisibilityFactorFilter::AddPositionalLight(double x, double y, double z)
{
  this->Kept->lights.push_back({ true, { { x, y, z } } });
  this->Modified();
  return this->GetNumberOfLights() - 1;
}

//------------------------------------------------------------------------------
void vtkVisibilityFactorFilter::SetLight(int light, bool positional, double x, double y, double z)
{
  if (light < 0 || light >= this->GetNumberOfLights())
  {
    vtkErrorMacro(<< "there is no light " << light << ", expected 0 to "
                  << this->GetNumberOfLights() - 1 << ".");
    return;
  }
  const Light set{ positional, { { x, y, z } } };
  if (!(this->Kept->lights[light] == set))
  {
    this->Kept->lights[light] = set;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkVisibilityFactorFilter::SetLightDirection(int light, double x, double y, double z)
{
  this->SetLight(light, false, x, y, z);
}

//------------------------------------------------------------------------------
void vtkVisibilityFactorFilter::SetLightPosition(int light, double x, double y, double z)
{
  this->SetLight(light, true, x, y, z);
}

//------------------------------------------------------------------------------
void vtkVisibilityFactorFilter::RemoveAllLights()
{
  if (!this->Kept->lights.empty())
  {
    this->Kept->lights.clear();
    this->Modified();
  }
}

//------------------------------------------------------------------------------
int vtkVisibilityFactorFilter::GetNumberOfLights() const
{
  return static_cast<int>(this->Kept->lights.size());
}

//------------------------------------------------------------------------------
void vtkVisibilityFactorFilter::GetTransportColor(const double rgb[3], double shares[3])
{
  double sum = 0.;
  for (int c = 0; c < 3; ++c)
  {
    shares[c] = 1. - std::min(std::max(rgb[c], 0.), 1.) + ColourFloor;
    sum += shares[c];
  }
  for (int c = 0; c < 3; ++c)
  {
    shares[c] *= 3. / sum;
  }
}

//------------------------------------------------------------------------------
void vtkVisibilityFactorFilter::GetWindow(int order, double factors[5])
{
  std::fill(factors, factors + 5, 0.);
  const std::vector<double> window =
    VisibilityWindow(std::min(std::max(order, 0), HighestVisibilityOrder));
  std::copy(window.begin(), window.end(), factors);
}

//------------------------------------------------------------------------------
void vtkVisibilityFactorFilter::GetHarmonics(
  int order, const double direction[3], double values[25])
{
  lighttransport::SphericalHarmonics(std::min(std::max(order, 0), HighestVisibilityOrder),
    { { direction[0], direction[1], direction[2] } }, values);
}

//------------------------------------------------------------------------------
std::string vtkVisibilityFactorFilter::FindParameterProblem() const
{
  std::ostringstream text;
  if (this->Order < 0 || this->Order > HighestVisibilityOrder)
  {
    text << "Order is " << this->Order << ", expected 0 to " << HighestVisibilityOrder;
  }
  else if (this->NumberOfDirections < 0)
  {
    text << "NumberOfDirections is " << this->NumberOfDirections
         << ", expected at least 1, or 0 to have it chosen by the order";
  }
  else if (!(this->Radius >= 0. && std::isfinite(this->Radius)))
  {
    text << "Radius is " << this->Radius << ", expected a finite length >= 0";
  }
  else if (this->ResolutionFactor < 1)
  {
    text << "ResolutionFactor is " << this->ResolutionFactor << ", expected at least 1";
  }
  else if (!(this->ScalarOpacityUnitDistance > 0. &&
             std::isfinite(this->ScalarOpacityUnitDistance)))
  {
    text << "ScalarOpacityUnitDistance is " << this->ScalarOpacityUnitDistance
         << ", expected a finite length > 0";
  }
  else if (this->TransferFunction2D)
  {
    vtkDataArray* scalars = this->TransferFunction2D->GetPointData()->GetScalars();
    if (!scalars || scalars->GetNumberOfComponents() != 4 ||
      this->TransferFunction2D->GetDimensions()[2] != 1)
    {
      text << "TransferFunction2D has " << (scalars ? scalars->GetNumberOfComponents() : 0)
           << " components and " << this->TransferFunction2D->GetDimensions()[2]
           << " slices, expected one slice of RGBA";
    }
  }
  else if (this->ScalarOpacity)
  {
    text << FunctionProblem(this->ScalarOpacity, "ScalarOpacity");
    if (text.str().empty() && this->GradientOpacity)
    {
      text << FunctionProblem(this->GradientOpacity, "GradientOpacity");
    }
    if (text.str().empty() && this->RGBExtinction && !this->Color)
    {
      text << "Color is not set, expected the colour of the scalar for RGBExtinction";
    }
  }
  for (std::size_t i = 0; i < this->Kept->lights.size() && text.str().empty(); ++i)
  {
    const Light& light = this->Kept->lights[i];
    double largest = 0.;
    bool finite = true;
    for (double x : light.at)
    {
      finite = finite && std::isfinite(x);
      largest = finite ? std::max(largest, std::abs(x)) : largest;
    }
    if (!finite || !(light.positional || largest > 0.))
    {
      text << "light " << i << " has the " << (light.positional ? "position " : "direction ")
           << light.at[0] << " " << light.at[1] << " " << light.at[2] << ", expected "
           << (light.positional ? "finite coordinates" : "a finite vector other than 0");
    }
  }
  return text.str();
}

//------------------------------------------------------------------------------
namespace
{
/** The grid of a resolution factor over the same domain. */
void CoarseDims(const int dims[3], int factor, int coarse[3])
{
  for (int a = 0; a < 3; ++a)
  {
    coarse[a] = static_cast<int>((static_cast<std::int64_t>(dims[a]) + factor - 1) / factor);
  }
}
} // namespace

//------------------------------------------------------------------------------
int vtkVisibilityFactorFilter::RequestInformation(
  vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  using Pipeline = vtkStreamingDemandDrivenPipeline;
  vtkInformation* in = inputs[0]->GetInformationObject(0);
  vtkInformation* out = outputs->GetInformationObject(0);
  if (this->ResolutionFactor <= 1 || !in->Has(Pipeline::WHOLE_EXTENT()))
  {
    return 1;
  }
  int extent[6];
  in->Get(Pipeline::WHOLE_EXTENT(), extent);
  const int dims[3] = { extent[1] - extent[0] + 1, extent[3] - extent[2] + 1,
    extent[5] - extent[4] + 1 };
  int coarse[3];
  CoarseDims(dims, this->ResolutionFactor, coarse);
  double spacing[3] = { 1., 1., 1. };
  double origin[3] = { 0., 0., 0. };
  double directions[9] = { 1., 0., 0., 0., 1., 0., 0., 0., 1. };
  if (in->Has(vtkDataObject::SPACING()))
  {
    in->Get(vtkDataObject::SPACING(), spacing);
  }
  if (in->Has(vtkDataObject::ORIGIN()))
  {
    in->Get(vtkDataObject::ORIGIN(), origin);
  }
  if (in->Has(vtkDataObject::DIRECTION()))
  {
    in->Get(vtkDataObject::DIRECTION(), directions);
  }
  for (int a = 0; a < 3; ++a)
  {
    if (coarse[a] < 1)
    {
      return 1; // an empty image: RequestData says so
    }
    // From the first point to the first coarse one, along this axis.
    const double wide = spacing[a] * dims[a] / coarse[a];
    const double shift = extent[2 * a] * spacing[a] + 0.5 * (wide - spacing[a]);
    for (int w = 0; w < 3; ++w)
    {
      origin[w] += directions[3 * w + a] * shift;
    }
    spacing[a] = wide;
    extent[2 * a] = 0;
    extent[2 * a + 1] = coarse[a] - 1;
  }
  out->Set(Pipeline::WHOLE_EXTENT(), extent, 6);
  out->Set(vtkDataObject::SPACING(), spacing, 3);
  out->Set(vtkDataObject::ORIGIN(), origin, 3);
  return 1;
}

//------------------------------------------------------------------------------
int vtkVisibilityFactorFilter::RequestUpdateExtent(
  vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  image::RequestWholeExtents(inputs, 1);
  return 1;
}

//------------------------------------------------------------------------------
int vtkVisibilityFactorFilter::RequestData(
  vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkImageData* input = vtkImageData::GetData(inputs[0]);
  vtkImageData* output = vtkImageData::GetData(outputs);
  this->ExtinctionSeconds = this->HarmonicsSeconds = this->LightsSeconds = 0.;
  output->Initialize();
  std::string problem;
  try
  {
    problem = this->Compute(input, inputs, output);
  }
  catch (const std::bad_alloc&)
  {
    std::ostringstream text;
    const double voxels = static_cast<double>(input->GetNumberOfPoints()) /
      std::pow(static_cast<double>(this->ResolutionFactor), 3.);
    text << "not enough memory for Order " << this->Order << " with a ResolutionFactor of "
         << this->ResolutionFactor << ", expected about "
         << std::ceil(4e-6 * voxels * (this->RGBExtinction ? 3. : 1.) *
              (NumberOfHarmonics(this->Order) + 3. +
                (this->SeparateLights ? 1. : 2.) * this->GetNumberOfLights()))
         << " MB free. Take a lower order or a larger factor";
    problem = text.str();
    this->Kept->forget();
  }
  if (!problem.empty())
  {
    output->Initialize();
    vtkErrorMacro(<< problem << ".");
    return 0;
  }
  return 1;
}

//------------------------------------------------------------------------------
std::string vtkVisibilityFactorFilter::Compute(
  vtkImageData* input, vtkInformationVector** inputs, vtkImageData* output)
{
  std::string problem = image::Problem(input);
  if (problem.empty())
  {
    problem = this->FindParameterProblem();
  }
  // Stages 1 and 2.
  if (problem.empty())
  {
    problem = this->ComputeExtinction(input, inputs);
  }
  if (!problem.empty())
  {
    return problem;
  }
  State& kept = *this->Kept;
  const ParallelFor parallel = vtkLightTransportParallelFor();
  const auto channels = static_cast<int>(kept.sigma_t.size());
  const vtkIdType size = kept.grid.size();

  // Stage 3.
  const bool wanted = this->SphericalHarmonics || this->AmbientOcclusion;
  const int order = this->SphericalHarmonics ? this->Order : 0;
  const int coefficients = NumberOfHarmonics(order);
  const int directions =
    this->NumberOfDirections > 0 ? this->NumberOfDirections : DefaultNumberOfDirections(order);
  std::ostringstream harmonicsKey;
  harmonicsKey.precision(17);
  harmonicsKey << order << " " << directions << " " << this->Radius << " " << kept.extinctionKey;
  if (!wanted)
  {
    kept.forgetHarmonics();
  }
  else if (kept.harmonicsKey != harmonicsKey.str())
  {
    const double began = Now();
    kept.forgetHarmonics();
    auto harmonics = vtkSmartPointer<vtkFloatArray>::New();
    harmonics->SetName(vtkLightTransportArrays::VisibilitySH);
    harmonics->SetNumberOfComponents(channels * coefficients);
    harmonics->SetNumberOfTuples(size);
    const DirectionSet set = MakeDirections(directions, 2 * order);
    for (int c = 0; c < channels; ++c)
    {
      const double from = 0.1 + 0.7 * c / channels;
      if (!VisibilitySH({ kept.grid, kept.sigma_t[c].data(), this->Radius }, kept.axes, set, order,
            harmonics->GetPointer(0) + std::ptrdiff_t(c) * coefficients,
            std::int64_t(channels) * coefficients, parallel,
            image::Progress(this, from, from + 0.7 / channels)))
      {
        return {}; // aborted: an empty output, no error
      }
    }
    kept.harmonics = harmonics;
    kept.harmonicsKey = harmonicsKey.str();
    this->HarmonicsSeconds = Now() - began;
  }

  // Stage 4: the lights that changed, each in an array of its own.
  const auto lights = static_cast<int>(kept.lights.size());
  std::ostringstream fieldsKey;
  fieldsKey.precision(17);
  fieldsKey << this->Radius << " " << kept.extinctionKey;
  if (kept.fieldsKey != fieldsKey.str())
  {
    kept.forgetFields();
    kept.fieldsKey = fieldsKey.str();
  }
  kept.fields.resize(static_cast<std::size_t>(lights));
  const double beganLights = Now();
  bool swept = false;
  for (int l = 0; l < lights; ++l)
  {
    const Light& light = kept.lights[l];
    if (kept.fields[l].values && kept.fields[l].light == light)
    {
      continue;
    }
    // Along the grid's axes, from the first voxel's centre.
    std::array<double, 3> at{};
    if (light.positional)
    {
      double index[3];
      image::WorldToIndex(input, light.at.data(), index);
      for (int a = 0; a < 3; ++a)
      {
        const double h = input->GetSpacing()[a];
        at[a] = index[a] * h - 0.5 * (kept.grid.spacing[a] - h);
      }
    }
    else
    {
      double largest = 0.;
      for (double x : light.at)
      {
        largest = std::max(largest, std::abs(x));
      }
      for (int a = 0; a < 3; ++a)
      {
        for (int w = 0; w < 3; ++w)
        {
          at[a] += kept.axes[a][w] * (light.at[w] / largest);
        }
      }
    }
    // Never the array that somebody holds: it is theirs to keep. One that nobody does spares the
    // time in which the system finds memory, twice that of a sweep.
    vtkSmartPointer<vtkFloatArray> field = std::move(kept.fields[l].values);
    if (!field || field->GetReferenceCount() > 1)
    {
      field = vtkSmartPointer<vtkFloatArray>::New();
    }
    field->SetName((vtkLightTransportArrays::Visibility + std::to_string(l)).c_str());
    field->SetNumberOfComponents(channels);
    field->SetNumberOfTuples(size);
    for (int c = 0; c < channels; ++c)
    {
      float* v = field->GetPointer(0) + c;
      const VisibilityMedium medium{ kept.grid, kept.sigma_t[c].data(), this->Radius };
      const ProgressFunction progress =
        image::Progress(this, 0.8 + 0.2 * l / lights, 0.8 + 0.2 * (l + 1) / lights);
      if (!(light.positional
              ? VisibilityTowardsPoint(medium, at, v, channels, parallel, progress)
              : VisibilityTowards(medium, at, v, channels, parallel, progress, &kept.scratch[c])))
      {
        return {};
      }
    }
    field->Modified();
    kept.fields[l] = { light, field };
    kept.visibility = nullptr;
    swept = true;
  }
  if (lights == 0 || this->SeparateLights)
  {
    kept.visibility = nullptr;
  }
  else if (!(kept.visibility && kept.visibility->GetNumberOfComponents() == channels * lights))
  {
    kept.visibility = vtkSmartPointer<vtkFloatArray>::New();
    kept.visibility->SetName(vtkLightTransportArrays::Visibility);
    kept.visibility->SetNumberOfComponents(channels * lights);
    kept.visibility->SetNumberOfTuples(size);
    float* to = kept.visibility->GetPointer(0);
    ForRows(parallel, size, size * channels * lights,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (int l = 0; l < lights; ++l)
        {
          const float* from = kept.fields[l].values->GetPointer(0);
          for (std::int64_t i = begin; i < end; ++i)
          {
            for (int c = 0; c < channels; ++c)
            {
              to[(i * lights + l) * channels + c] = from[i * channels + c];
            }
          }
        }
      });
  }
  if (swept)
  {
    this->LightsSeconds = Now() - beganLights;
  }

  // The output.
  if (this->ResolutionFactor == 1)
  {
    output->ShallowCopy(input);
  }
  else
  {
    output->SetDimensions(kept.grid.dims.data());
    output->SetSpacing(kept.grid.spacing.data());
    output->SetDirectionMatrix(input->GetDirectionMatrix());
    double index[3];
    double origin[3];
    for (int a = 0; a < 3; ++a)
    {
      index[a] =
        input->GetExtent()[2 * a] + 0.5 * (kept.grid.spacing[a] / input->GetSpacing()[a] - 1.);
    }
    input->TransformContinuousIndexToPhysicalPoint(index, origin);
    output->SetOrigin(origin);
  }
  if (this->SphericalHarmonics)
  {
    output->GetPointData()->AddArray(kept.harmonics);
  }
  if (this->AmbientOcclusion)
  {
    vtkNew<vtkFloatArray> mean;
    mean->SetName(vtkLightTransportArrays::AmbientOcclusion);
    mean->SetNumberOfComponents(channels);
    mean->SetNumberOfTuples(size);
    const float* from = kept.harmonics->GetPointer(0);
    float* to = mean->GetPointer(0);
    const auto scale = static_cast<float>(1. / std::sqrt(4. * vtkMath::Pi()));
    ForRows(parallel, size, size * channels,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t i = begin * channels; i < end * channels; ++i)
        {
          to[i] = std::min(std::max(from[i * coefficients] * scale, 0.f), 1.f);
        }
      });
    output->GetPointData()->AddArray(mean);
  }
  if (lights > 0 && !this->SeparateLights)
  {
    output->GetPointData()->AddArray(kept.visibility);
  }
  for (int l = 0; l < lights && this->SeparateLights; ++l)
  {
    output->GetPointData()->AddArray(kept.fields[l].values);
  }
  if (this->OutputExtinction)
  {
    vtkNew<vtkFloatArray> extinction;
    extinction->SetName(vtkLightTransportArrays::Extinction);
    extinction->SetNumberOfComponents(channels);
    extinction->SetNumberOfTuples(size);
    for (int c = 0; c < channels; ++c)
    {
      const float* from = kept.sigma_t[c].data();
      float* to = extinction->GetPointer(0) + c;
      for (vtkIdType i = 0; i < size; ++i)
      {
        to[i * channels] = from[i];
      }
    }
    output->GetPointData()->AddArray(extinction);
  }
  return {};
}

//------------------------------------------------------------------------------
std::string vtkVisibilityFactorFilter::ComputeExtinction(
  vtkImageData* input, vtkInformationVector** inputs)
{
  std::ostringstream text;
  const bool classify = this->ScalarOpacity || this->TransferFunction2D;
  vtkDataArray* scalars = classify
    ? this->GetInputArrayToProcess(0, inputs)
    : input->GetPointData()->GetArray(this->ExtinctionArrayName.c_str());
  if (!scalars && !classify)
  {
    text << "neither ScalarOpacity nor TransferFunction2D is set and the image has no point "
         << "array \"" << this->ExtinctionArrayName << "\", expected one of the three";
    return text.str();
  }
  std::string wrong =
    vtkLightTransportImage::ScalarsProblem(this, input, scalars, classify ? this->Component : 0);
  if (!wrong.empty())
  {
    return wrong;
  }
  const std::string name = scalars->GetName() ? scalars->GetName() : "scalars";
  const int channels = this->RGBExtinction ? 3 : 1;
  if (!classify && scalars->GetNumberOfComponents() != channels)
  {
    text << "the array \"" << name << "\" has " << scalars->GetNumberOfComponents()
         << " components, expected " << channels
         << (this->RGBExtinction ? ", red, green and blue, for RGBExtinction" : "");
    return text.str();
  }
  const Grid fine = image::GridOf(input);
  const double opaque = OpaqueDepth / fine.smallestSpacing();
  if (!(opaque < 1e30))
  {
    text << "the smallest spacing is " << fine.smallestSpacing()
         << ", expected a length above 2e-29";
    return text.str();
  }

  // Is it what was kept?
  std::ostringstream key;
  key.precision(17);
  vtkObject* objects[6] = { this->ScalarOpacity, this->TransferFunction2D, this->GradientOpacity,
    this->RGBExtinction ? this->Color : nullptr, scalars, input->GetPointGhostArray() };
  for (vtkObject* object : objects)
  {
    key << object << " " << (object ? object->GetMTime() : 0) << " ";
  }
  key << this->ScalarOpacityUnitDistance << " " << this->Component << " " << channels << " "
      << this->ResolutionFactor;
  for (int a = 0; a < 9; ++a)
  {
    key << " " << input->GetDirectionMatrix()->GetData()[a];
  }
  for (int a = 0; a < 3; ++a)
  {
    key << " " << fine.dims[a] << " " << fine.spacing[a] << " " << input->GetOrigin()[a] << " "
        << input->GetExtent()[2 * a];
  }
  State& kept = *this->Kept;
  if (kept.extinctionKey == key.str())
  {
    return {};
  }
  const double began = Now();
  kept.forget();

  const ParallelFor parallel = vtkLightTransportParallelFor();
  std::vector<Buffer<float>> sigma_t(static_cast<std::size_t>(channels));
  for (Buffer<float>& channel : sigma_t)
  {
    channel.allocate(fine.size());
  }
  const std::int64_t rows = static_cast<std::int64_t>(fine.dims[1]) * fine.dims[2];
  const int nx = fine.dims[0];

  // What the array holds.
  std::vector<ValueReader> readers;
  std::vector<ValueRange> ranges;
  for (int c = 0; c < (classify ? 1 : channels); ++c)
  {
    readers.push_back(
      image::Reader(scalars, classify ? this->Component : c, {}, input->GetPointGhostArray()));
    ranges.push_back(FindValueRange(fine.size(), readers.back(), parallel));
    const ValueRange& range = ranges.back();
    if (range.firstInfinite >= 0)
    {
      text << "the array \"" << name << "\" holds an infinity at point " << range.firstInfinite
           << ", expected finite values or NaN";
      return text.str();
    }
    if (!classify && range.min < 0.)
    {
      text << "the array \"" << name << "\" holds the extinction " << range.min
           << ", expected values >= 0";
      return text.str();
    }
    if (!(range.max / 4. - range.min / 4. <= std::numeric_limits<double>::max() / 8.))
    {
      text << "the array \"" << name << "\" reaches from " << range.min << " to " << range.max
           << ", expected a range that a double can hold";
      return text.str();
    }
  }

  // Stage 1.
  if (!classify)
  {
    ForRows(parallel, rows, fine.size(),
      [&](std::int64_t begin, std::int64_t end)
      {
        std::vector<double> values(static_cast<std::size_t>(nx));
        for (std::int64_t row = begin; row < end; ++row)
        {
          for (int c = 0; c < channels; ++c)
          {
            readers[c](row * nx, nx, values.data());
            float* out = sigma_t[c].data() + row * nx;
            for (int i = 0; i < nx; ++i)
            {
              out[i] = static_cast<float>(std::isnan(values[i]) ? 0. : std::min(values[i], opaque));
            }
          }
        }
      });
  }
  else
  {
    const ValueRange& range = ranges[0];
    const double width = range.max - range.min;
    const bool whole = scalars->GetDataType() != VTK_FLOAT && scalars->GetDataType() != VTK_DOUBLE;
    const bool two = this->TransferFunction2D != nullptr;
    const bool gradients = two || this->GradientOpacity;
    std::unique_ptr<Table2D> both(two ? new Table2D(this->TransferFunction2D) : nullptr);
    const double unit = this->ScalarOpacityUnitDistance;
    const auto extinctionOf = [opaque, unit](double alpha)
    { return alpha < 1. ? std::min(-std::log1p(-std::max(alpha, 0.)) / unit, opaque) : opaque; };
    const Table table(range.min, range.max, whole,
      [&](double s)
      {
        const double alpha = two ? 0. : this->ScalarOpacity->GetValue(s);
        return gradients ? alpha : extinctionOf(alpha);
      });
    const Table gradientTable(0., 0.25 * width, false,
      [&](double g)
      { return this->GradientOpacity && !two ? this->GradientOpacity->GetValue(g) : 1.; });
    std::vector<Table> shares;
    for (int c = 0; c < 3 && this->RGBExtinction && !two; ++c)
    {
      shares.emplace_back(range.min, range.max, whole,
        [&](double s)
        {
          double rgb[3];
          double share[3];
          this->Color->GetColor(s, rgb);
          vtkVisibilityFactorFilter::GetTransportColor(rgb, share);
          return share[c];
        });
    }
    ForRows(parallel, rows, fine.size(),
      [&](std::int64_t begin, std::int64_t end)
      {
        std::vector<double> values(static_cast<std::size_t>(nx));
        std::vector<double> lengths(static_cast<std::size_t>(nx));
        GradientRow gradient(fine, readers[0]);
        for (std::int64_t row = begin; row < end; ++row)
        {
          readers[0](row * nx, nx, values.data());
          if (gradients)
          {
            gradient.compute(row, values.data(), lengths.data());
          }
          for (int i = 0; i < nx; ++i)
          {
            double share[3] = { 1., 1., 1. };
            double s = 0.;
            if (std::isnan(values[i]))
            {
              // nothing is known here: transparent
            }
            else if (two)
            {
              double rgba[4];
              both->at(width > 0. ? (values[i] - range.min) / width : 0.,
                width > 0. ? std::min(lengths[i] / (0.25 * width), 1.) : 0., rgba);
              s = extinctionOf(rgba[3]);
              vtkVisibilityFactorFilter::GetTransportColor(rgba, share);
            }
            else
            {
              s = gradients ? extinctionOf(table(values[i]) * gradientTable(lengths[i]))
                            : table(values[i]);
              for (std::size_t c = 0; c < shares.size(); ++c)
              {
                share[c] = shares[c](values[i]);
              }
            }
            for (int c = 0; c < channels; ++c)
            {
              sigma_t[c][row * nx + i] = static_cast<float>(channels > 1 ? share[c] * s : s);
            }
          }
        }
      });
  }

  // Stage 2.
  kept.grid = fine;
  CoarseDims(fine.dims.data(), this->ResolutionFactor, kept.grid.dims.data());
  for (int a = 0; a < 3; ++a)
  {
    kept.grid.spacing[a] = fine.spacing[a] * fine.dims[a] / kept.grid.dims[a];
    for (int w = 0; w < 3; ++w)
    {
      kept.axes[a][w] = input->GetDirectionMatrix()->GetElement(w, a);
    }
  }
  if (this->ResolutionFactor > 1)
  {
    for (Buffer<float>& channel : sigma_t)
    {
      Buffer<float> coarse(kept.grid.size());
      Coarsen(fine, channel.data(), kept.grid, coarse.data(), parallel);
      channel = std::move(coarse);
    }
  }
  kept.sigma_t = std::move(sigma_t);
  kept.extinctionKey = key.str();
  this->ExtinctionSeconds = Now() - began;
  this->UpdateProgress(0.1);
  return {};
}

//------------------------------------------------------------------------------
void vtkVisibilityFactorFilter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "ScalarOpacity: " << this->ScalarOpacity << "\n";
  os << indent << "ScalarOpacityUnitDistance: " << this->ScalarOpacityUnitDistance << "\n";
  os << indent << "GradientOpacity: " << this->GradientOpacity << "\n";
  os << indent << "TransferFunction2D: " << this->TransferFunction2D << "\n";
  os << indent << "ExtinctionArrayName: " << this->ExtinctionArrayName << "\n";
  os << indent << "Component: " << this->Component << "\n";
  os << indent << "RGBExtinction: " << this->RGBExtinction << "\n";
  os << indent << "Color: " << this->Color << "\n";
  os << indent << "Order: " << this->Order << "\n";
  os << indent << "NumberOfDirections: " << this->NumberOfDirections << "\n";
  os << indent << "Radius: " << this->Radius << "\n";
  os << indent << "ResolutionFactor: " << this->ResolutionFactor << "\n";
  os << indent << "SphericalHarmonics: " << this->SphericalHarmonics << "\n";
  os << indent << "AmbientOcclusion: " << this->AmbientOcclusion << "\n";
  os << indent << "OutputExtinction: " << this->OutputExtinction << "\n";
  os << indent << "SeparateLights: " << this->SeparateLights << "\n";
  os << indent << "Lights:";
  for (const Light& light : this->Kept->lights)
  {
    os << (light.positional ? " at " : " towards ") << light.at[0] << " " << light.at[1] << " "
       << light.at[2] << ";";
  }
  os << "\n";
  os << indent << "ExtinctionSeconds: " << this->ExtinctionSeconds << "\n";
  os << indent << "HarmonicsSeconds: " << this->HarmonicsSeconds << "\n";
  os << indent << "LightsSeconds: " << this->LightsSeconds << "\n";
}
