// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkCurvatureOpacityFunction.h"

#include "vtkLightTransportArrays.h"

#include "vtkDataArray.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPointData.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <vector>

vtkStandardNewMacro(vtkCurvatureOpacityFunction);
vtkCxxSetObjectMacro(vtkCurvatureOpacityFunction, CurvatureFunction, vtkPiecewiseFunction);
vtkCxxSetObjectMacro(vtkCurvatureOpacityFunction, DepthFunction, vtkPiecewiseFunction);
vtkCxxSetObjectMacro(vtkCurvatureOpacityFunction, TableImage, vtkImageData);

namespace
{
constexpr vtkIdType MaximumSamples = 1 << 20;

double Clamp01(double value)
{
  return std::min(std::max(value, 0.), 1.);
}

/** A factor of Product: 1 where there is no function. */
double Factor(vtkPiecewiseFunction* function, double x)
{
  return function ? function->GetValue(x) : 1.;
}

vtkDataArray* ScalarsOf(vtkImageData* image)
{
  return image ? image->GetPointData()->GetScalars() : nullptr;
}

/** What is wrong with a factor of Product, or nothing. */
std::string FactorProblem(vtkPiecewiseFunction* function, const char* name)
{
  std::ostringstream text;
  for (int i = 0; function && i < function->GetSize(); ++i)
  {
    double node[4];
    function->GetNodeValue(i, node);
    if (!std::isfinite(node[0]) || !(node[1] >= 0. && node[1] <= 1.))
    {
      text << name << " has the value " << node[1] << " at " << node[0]
           << ", expected values in [0, 1]";
      return text.str();
    }
  }
  if (function && function->GetSize() == 0)
  {
    text << name << " is without points, expected a function with values in [0, 1]";
  }
  return text.str();
}
} // namespace

//------------------------------------------------------------------------------
vtkCurvatureOpacityFunction::~vtkCurvatureOpacityFunction()
{
  this->SetCurvatureFunction(nullptr);
  this->SetDepthFunction(nullptr);
  this->SetTableImage(nullptr);
}

//------------------------------------------------------------------------------
const char* vtkCurvatureOpacityFunction::GetKindAsString() const
{
  static const char* const names[] = { "FocusFront", "WideDepth", "FrontOpaque", "CurvatureOnly",
    "Product", "Table" };
  return this->Kind >= FocusFront && this->Kind <= Table ? names[this->Kind] : "(unknown)";
}

//------------------------------------------------------------------------------
vtkMTimeType vtkCurvatureOpacityFunction::GetMTime()
{
  vtkMTimeType time = this->Superclass::GetMTime();
  for (vtkObject* part : { static_cast<vtkObject*>(this->CurvatureFunction),
         static_cast<vtkObject*>(this->DepthFunction), static_cast<vtkObject*>(this->TableImage),
         static_cast<vtkObject*>(ScalarsOf(this->TableImage)) })
  {
    time = part ? std::max(time, part->GetMTime()) : time;
  }
  return time;
}

//------------------------------------------------------------------------------
double vtkCurvatureOpacityFunction::Kappa(double k1, double k2, double s)
{
  return -std::tanh(s * (k1 + k2));
}

//------------------------------------------------------------------------------
double vtkCurvatureOpacityFunction::ChooseCurvatureScale(vtkDataArray* mean)
{
  const vtkIdType size = mean->GetNumberOfTuples();
  const vtkIdType stride = std::max<vtkIdType>(1, size / MaximumSamples) | 1;
  std::vector<double> samples;
  double largest = 0.;
  for (vtkIdType i = 0; i < size; i += stride)
  {
    const double value = 2. * std::abs(mean->GetComponent(i, 0));
    if (std::isfinite(value) && value > 0.)
    {
      samples.push_back(value);
      largest = std::max(largest, value);
    }
  }
  // What rounding makes of a plane is not curved.
  samples.erase(std::remove_if(samples.begin(), samples.end(),
                  [largest](double value) { return value < 1e-6 * largest; }),
    samples.end());
  if (samples.empty())
  {
    return 0.;
  }
  const auto at = samples.begin() + static_cast<std::ptrdiff_t>(0.75 * (samples.size() - 1));
  std::nth_element(samples.begin(), at, samples.end());
  return std::atanh(0.5) / *at;
}

//------------------------------------------------------------------------------
double vtkCurvatureOpacityFunction::Evaluate(double kappa, double depth) const
{
  if (std::isnan(kappa) || std::isnan(depth))
  {
    return 0.;
  }
  const double c = std::min(std::abs(kappa), 1.);
  const double z = Clamp01(depth);
  const double flat = 1. - c;
  const double near = 1. - z;
  double t = 0.;
  switch (this->Kind)
  {
    case FocusFront:
      t = 1. - flat * flat * near * near * near;
      break;
    case WideDepth:
      t = 1. - flat * (1. - z * z);
      break;
    case FrontOpaque:
      t = (1. - flat * flat) * near;
      break;
    case CurvatureOnly:
      t = 1. - flat * flat;
      break;
    case Product:
      return Clamp01(Factor(this->CurvatureFunction, c) * Factor(this->DepthFunction, z));
    case Table:
      return this->EvaluateTable(c, z);
    default:
      return 0.;
  }
  return Clamp01(this->MinimumOpacity + (this->MaximumOpacity - this->MinimumOpacity) * t);
}

//------------------------------------------------------------------------------
double vtkCurvatureOpacityFunction::EvaluateTable(double c, double z) const
{
  vtkDataArray* scalars = ScalarsOf(this->TableImage);
  if (!scalars || scalars->GetNumberOfTuples() < 1)
  {
    return 0.;
  }
  int dims[3];
  this->TableImage->GetDimensions(dims);
  const double x = c * (dims[0] - 1);
  const double y = z * (dims[1] - 1);
  const int i0 = static_cast<int>(x);
  const int j0 = static_cast<int>(y);
  const int i1 = std::min(i0 + 1, dims[0] - 1);
  const int j1 = std::min(j0 + 1, dims[1] - 1);
  const int component = scalars->GetNumberOfComponents() - 1;
  const auto at = [&](int i, int j)
  { return scalars->GetComponent(vtkIdType(j) * dims[0] + i, component); };
  const double u = x - i0;
  const double v = y - j0;
  const double value = (1. - v) * ((1. - u) * at(i0, j0) + u * at(i1, j0)) +
    v * ((1. - u) * at(i0, j1) + u * at(i1, j1));
  const int type = scalars->GetDataType();
  const bool fraction = type == VTK_FLOAT || type == VTK_DOUBLE;
  return std::isnan(value) ? 0. : Clamp01(fraction ? value : value / scalars->GetDataTypeMax());
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityFunction::ExportTable(
  vtkImageData* image, int numberOfCurvatures, int numberOfDepths) const
{
  const int nc = std::max(numberOfCurvatures, 2);
  const int nz = std::max(numberOfDepths, 2);
  image->Initialize();
  image->SetDimensions(nc, nz, 1);
  image->SetSpacing(1. / (nc - 1), 1. / (nz - 1), 1.);
  vtkNew<vtkFloatArray> opacity;
  opacity->SetName(vtkLightTransportArrays::Opacity);
  opacity->SetNumberOfTuples(vtkIdType(nc) * nz);
  for (int j = 0; j < nz; ++j)
  {
    for (int i = 0; i < nc; ++i)
    {
      opacity->SetValue(vtkIdType(j) * nc + i,
        static_cast<float>(this->Evaluate(double(i) / (nc - 1), double(j) / (nz - 1))));
    }
  }
  image->GetPointData()->SetScalars(opacity);
}

//------------------------------------------------------------------------------
std::string vtkCurvatureOpacityFunction::GetProblem() const
{
  std::ostringstream text;
  if (this->Kind < FocusFront || this->Kind > Table)
  {
    text << "Kind is " << this->Kind << ", expected 0 to " << Table;
  }
  else if (this->Kind == Product)
  {
    text << FactorProblem(this->CurvatureFunction, "CurvatureFunction");
    if (text.str().empty())
    {
      text << FactorProblem(this->DepthFunction, "DepthFunction");
    }
  }
  else if (this->Kind == Table)
  {
    vtkDataArray* scalars = ScalarsOf(this->TableImage);
    const int* dims = this->TableImage ? this->TableImage->GetDimensions() : nullptr;
    if (!this->TableImage)
    {
      text << "TableImage is not set, expected an image of opacities for the kind Table";
    }
    else if (dims[0] < 1 || dims[1] < 1 || dims[2] != 1)
    {
      text << "TableImage has dimensions " << dims[0] << " " << dims[1] << " " << dims[2]
           << ", expected points along x and y and a single slice";
    }
    else if (!scalars || scalars->GetNumberOfTuples() != this->TableImage->GetNumberOfPoints())
    {
      text << "TableImage has no point scalars, expected an opacity for each point";
    }
  }
  else
  {
    const bool minimum = !(this->MinimumOpacity >= 0. && this->MinimumOpacity <= 1.);
    if (minimum || !(this->MaximumOpacity >= 0. && this->MaximumOpacity <= 1.))
    {
      text << (minimum ? "MinimumOpacity" : "MaximumOpacity") << " is "
           << (minimum ? this->MinimumOpacity : this->MaximumOpacity)
           << ", expected a value in [0, 1]";
    }
  }
  return text.str();
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityFunction::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Kind: " << this->GetKindAsString() << "\n";
  os << indent << "MinimumOpacity: " << this->MinimumOpacity << "\n";
  os << indent << "MaximumOpacity: " << this->MaximumOpacity << "\n";
  os << indent << "CurvatureFunction: " << this->CurvatureFunction << "\n";
  os << indent << "DepthFunction: " << this->DepthFunction << "\n";
  os << indent << "TableImage: " << this->TableImage << "\n";
}
