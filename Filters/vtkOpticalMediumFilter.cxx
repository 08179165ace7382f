// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkOpticalMediumFilter.h"

#include "Core/Medium.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportImage.h"
#include "vtkLightTransportInternal.h"

#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPointData.h"
#include "vtkUnsignedCharArray.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <sstream>
#include <string>

vtkStandardNewMacro(vtkOpticalMediumFilter);
vtkCxxSetObjectMacro(vtkOpticalMediumFilter, DiffusionFunction, vtkPiecewiseFunction);
vtkCxxSetObjectMacro(vtkOpticalMediumFilter, AbsorptionFunction, vtkPiecewiseFunction);

namespace
{
constexpr double LargestFloat = std::numeric_limits<float>::max();
constexpr double SmallestFloat = std::numeric_limits<float>::min();
constexpr double LongestTable = 65536.;
constexpr double LongestDerivative = 32.; // smallest spacings; its cost grows with it

/** The function's nodes outside [low, high], or none of them: a message, else nothing. */
std::string FunctionProblem(vtkPiecewiseFunction* function, const char* name, const char* mapping,
  double low, double high, const char* expected)
{
  std::ostringstream text;
  if (!function || function->GetSize() == 0)
  {
    text << name << " is " << (function ? "without points" : "not set") << ", expected a function "
         << "for the mapping " << mapping;
    return text.str();
  }
  for (int i = 0; i < function->GetSize(); ++i)
  {
    double node[4];
    function->GetNodeValue(i, node);
    if (!std::isfinite(node[0]) || !(node[1] >= low && node[1] <= high))
    {
      text << name << " has the value " << node[1] << " at " << node[0] << ", expected "
           << expected;
      return text.str();
    }
  }
  return {};
}

/** f(S): from a table where S is a whole number of a short range, else by the function. */
lighttransport::ValueReader Composed(vtkPiecewiseFunction* function,
  const lighttransport::ValueReader& read, const lighttransport::ValueRange& range, bool whole)
{
  std::vector<double> table;
  if (whole && range.max - range.min < LongestTable)
  {
    table.resize(static_cast<std::size_t>(range.max - range.min) + 1);
    for (std::size_t i = 0; i < table.size(); ++i)
    {
      table[i] = function->GetValue(range.min + static_cast<double>(i));
    }
  }
  return
    [function, read, table, min = range.min](std::int64_t begin, std::int64_t n, double* values)
  {
    read(begin, n, values);
    for (std::int64_t l = 0; l < n; ++l)
    {
      if (!std::isnan(values[l]))
      {
        values[l] = table.empty() ? function->GetValue(values[l])
                                  : table[static_cast<std::size_t>(values[l] - min)];
      }
    }
  };
}

} // namespace

//------------------------------------------------------------------------------
vtkOpticalMediumFilter::vtkOpticalMediumFilter()
{
  this->SetInputArrayToProcess(
    0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, vtkDataSetAttributes::SCALARS);
}

//------------------------------------------------------------------------------
vtkOpticalMediumFilter::~vtkOpticalMediumFilter()
{
  this->SetDiffusionFunction(nullptr);
  this->SetAbsorptionFunction(nullptr);
}

//------------------------------------------------------------------------------
void vtkOpticalMediumFilter::SetScalePoint(double x, double y, double z)
{
  const double* p = this->ScalePoint;
  if (!this->HasScalePoint || p[0] != x || p[1] != y || p[2] != z)
  {
    this->HasScalePoint = true;
    this->ScalePoint[0] = x;
    this->ScalePoint[1] = y;
    this->ScalePoint[2] = z;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkOpticalMediumFilter::ClearScalePoint()
{
  if (this->HasScalePoint)
  {
    this->HasScalePoint = false;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkOpticalMediumFilter::AddNoDataValue(double value)
{
  this->NoDataValues.push_back(value);
  this->Modified();
}

//------------------------------------------------------------------------------
void vtkOpticalMediumFilter::RemoveAllNoDataValues()
{
  if (!this->NoDataValues.empty())
  {
    this->NoDataValues.clear();
    this->Modified();
  }
}

//------------------------------------------------------------------------------
double vtkOpticalMediumFilter::GetNoDataValue(int i) const
{
  return i >= 0 && i < this->GetNumberOfNoDataValues() ? this->NoDataValues[i]
                                                       : std::numeric_limits<double>::quiet_NaN();
}

//------------------------------------------------------------------------------
vtkMTimeType vtkOpticalMediumFilter::GetMTime()
{
  vtkMTimeType time = this->Superclass::GetMTime();
  for (vtkPiecewiseFunction* function : { this->DiffusionFunction, this->AbsorptionFunction })
  {
    time = function ? std::max(time, function->GetMTime()) : time;
  }
  return time;
}

//------------------------------------------------------------------------------
int vtkOpticalMediumFilter::RequestUpdateExtent(
  vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  vtkLightTransportImage::RequestWholeExtents(inputs, 1);
  return 1;
}

//------------------------------------------------------------------------------
std::string vtkOpticalMediumFilter::FindParameterProblem() const
{
  std::ostringstream text;
  const bool readsFunction = this->DiffusionMapping != FromScalarGradient;
  if (this->DiffusionMapping < FromTransferFunction ||
    this->DiffusionMapping > FromTransferFunctionGradient)
  {
    text << "DiffusionMapping is " << this->DiffusionMapping << ", expected 0 to 2";
  }
  else if (this->GradientFunction != Exponential && this->GradientFunction != Rational)
  {
    text << "GradientFunction is " << this->GradientFunction << ", expected 0 or 1";
  }
  else if (this->AbsorptionMapping < FromComplement || this->AbsorptionMapping > FromFunction)
  {
    text << "AbsorptionMapping is " << this->AbsorptionMapping << ", expected 0 to 2";
  }
  else if (!(this->GradientScale >= 0. && std::isfinite(this->GradientScale)))
  {
    text << "GradientScale is " << this->GradientScale << ", expected a finite value >= 0";
  }
  else if (!std::isfinite(this->DerivativeScale))
  {
    text << "DerivativeScale is " << this->DerivativeScale << ", expected a finite length";
  }
  else if (!(this->DiffusionLength >= 0. && std::isfinite(this->DiffusionLength)))
  {
    text << "DiffusionLength is " << this->DiffusionLength << ", expected a finite length >= 0";
  }
  else if (!(this->BetaFloor > 0. && this->BetaFloor <= 1.))
  {
    text << "BetaFloor is " << this->BetaFloor << ", expected a value in (0, 1]";
  }
  else if (!(this->Albedo >= 0. && this->Albedo <= 1.))
  {
    text << "Albedo is " << this->Albedo << ", expected a value in [0, 1]";
  }
  else if (!(this->Anisotropy > -1. && this->Anisotropy < 1.))
  {
    text << "Anisotropy is " << this->Anisotropy << ", expected a value in (-1, 1)";
  }
  else if (!(this->Reach >= 0. && std::isfinite(this->Reach)))
  {
    text << "Reach is " << this->Reach << ", expected a finite length >= 0";
  }
  else if (readsFunction)
  {
    text << FunctionProblem(this->DiffusionFunction, "DiffusionFunction",
      this->DiffusionMapping == FromTransferFunction ? "FromTransferFunction"
                                                     : "FromTransferFunctionGradient",
      0., 1., "values in [0, 1]");
  }
  if (text.str().empty() && this->AbsorptionMapping == FromFunction)
  {
    text << FunctionProblem(this->AbsorptionFunction, "AbsorptionFunction", "FromFunction", 0.,
      LargestFloat, "finite values >= 0");
  }
  return text.str();
}

//------------------------------------------------------------------------------
int vtkOpticalMediumFilter::RequestData(
  vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkImageData* input = vtkImageData::GetData(inputs[0]);
  vtkImageData* output = vtkImageData::GetData(outputs);
  this->ComputedGradientScale = 0.;
  output->Initialize();
  std::string problem;
  try
  {
    problem = this->Compute(input, this->GetInputArrayToProcess(0, inputs), output);
  }
  catch (const std::bad_alloc&)
  {
    problem = "not enough memory for two float arrays of " +
      std::to_string(input->GetNumberOfPoints()) + " points, " +
      std::to_string(input->GetNumberOfPoints() / (1 << 17)) + " MiB";
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
std::string vtkOpticalMediumFilter::Compute(
  vtkImageData* input, vtkDataArray* scalars, vtkImageData* output)
{
  using namespace lighttransport;
  namespace image = vtkLightTransportImage;

  // Input and parameters.
  std::string problem = image::Problem(input);
  if (problem.empty())
  {
    problem = this->FindParameterProblem();
  }
  if (!problem.empty())
  {
    return problem;
  }
  std::ostringstream text;
  const vtkIdType size = input->GetNumberOfPoints();
  problem = image::ScalarsProblem(this, input, scalars, this->Component);
  if (!problem.empty())
  {
    return problem;
  }
  const std::string name = scalars->GetName() ? scalars->GetName() : "scalars";

  const Grid grid = image::GridOf(input);
  const double spacing = grid.smallestSpacing();
  MediumParameters parameters;
  parameters.useGradient = this->DiffusionMapping != FromTransferFunction;
  parameters.complement = this->DiffusionComplement;
  parameters.rational = this->GradientFunction == Rational;
  parameters.gradientScale = this->GradientScale;
  parameters.derivativeScale = this->DerivativeScale < 0. ? spacing : this->DerivativeScale;
  if (parameters.derivativeScale > LongestDerivative * spacing)
  {
    text << "DerivativeScale is " << this->DerivativeScale << ", expected at most "
         << LongestDerivative << " times the smallest spacing, " << spacing;
    return text.str();
  }
  parameters.ell = this->DiffusionLength > 0. ? this->DiffusionLength : spacing;
  parameters.betaFloor = this->BetaFloor;
  parameters.absorption = this->AbsorptionMapping == FromAlbedo ? AbsorptionRule::Albedo
    : this->AbsorptionMapping == FromFunction                   ? AbsorptionRule::Function
                                                                : AbsorptionRule::Complement;
  parameters.albedo = this->Albedo;
  parameters.anisotropy = this->Anisotropy;
  parameters.reach = this->Reach;

  // What float32 can hold; logarithms cannot overflow.
  const double logEll = std::log(parameters.ell);
  const double logFloor = std::log(parameters.betaFloor);
  const double logMax = std::log(LargestFloat);
  if (!(logEll <= logMax && logEll + logFloor >= std::log(SmallestFloat) && -logEll <= logMax &&
        -logEll - logFloor <= logMax))
  {
    text << "DiffusionLength is " << parameters.ell << " and BetaFloor " << parameters.betaFloor
         << ", expected values for which D and the absorption fit into float32";
    return text.str();
  }
  if (parameters.reach > 0. && logEll - 2. * std::log(parameters.reach) > logMax)
  {
    text << "Reach is " << parameters.reach << " with a DiffusionLength of " << parameters.ell
         << ", expected a length whose absorption D/Reach^2 fits into float32";
    return text.str();
  }

  if (this->HasScalePoint && parameters.useGradient)
  {
    double index[3] = { 0., 0., 0. };
    const double* p = this->ScalePoint;
    const bool finite = std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
    if (finite)
    {
      image::WorldToIndex(input, p, index);
    }
    if (!finite || !image::Inside(grid, index))
    {
      text << "ScalePoint is " << p[0] << " " << p[1] << " " << p[2]
           << ", expected a point inside the volume: " << image::DomainAsString(input);
      return text.str();
    }
    for (int a = 0; a < 3; ++a)
    {
      parameters.scalePoint[a] =
        std::min(std::max(static_cast<int>(std::lround(index[a])), 0), grid.dims[a] - 1);
    }
  }

  // Stage 1: what the scalars hold.
  const ParallelFor parallel = vtkLightTransportParallelFor();
  const ValueReader values =
    image::Reader(scalars, this->Component, this->NoDataValues, input->GetPointGhostArray());
  const ValueRange range = FindValueRange(size, values, parallel);
  if (range.firstInfinite >= 0)
  {
    text << "the array \"" << name << "\" holds an infinity at point " << range.firstInfinite
         << ", expected finite values, NaN or declared no-data values";
    return text.str();
  }
  if (!(range.max / 4. - range.min / 4. <= std::numeric_limits<double>::max() / 8.))
  {
    text << "the array \"" << name << "\" reaches from " << range.min << " to " << range.max
         << ", expected a range that a double can hold";
    return text.str();
  }

  // Stage 2: the signal that is mapped or derived.
  const bool whole = scalars->GetDataType() != VTK_FLOAT && scalars->GetDataType() != VTK_DOUBLE;
  ValueReader signal = values;
  ValueRange signalRange = range;
  if (this->DiffusionMapping != FromScalarGradient)
  {
    signal = Composed(this->DiffusionFunction, values, range, whole);
    signalRange.min = 0.;
    signalRange.max = 1.;
  }
  ValueReader absorption;
  if (this->AbsorptionMapping == FromFunction)
  {
    absorption = Composed(this->AbsorptionFunction, values, range, whole);
  }

  // Stages 3 to 5.
  vtkNew<vtkFloatArray> D;
  D->SetName(vtkLightTransportArrays::DiffusionCoefficient);
  D->SetNumberOfTuples(size);
  vtkNew<vtkFloatArray> sigma_a;
  sigma_a->SetName(vtkLightTransportArrays::Absorption);
  sigma_a->SetNumberOfTuples(size);
  const MediumReport report = ComputeMedium(grid, signal, signalRange, absorption, parameters,
    D->GetPointer(0), sigma_a->GetPointer(0), parallel, image::Progress(this, 0.1, 1.));
  if (report.cancelled)
  {
    return {}; // aborted: an empty output, no error
  }
  this->ComputedGradientScale = report.gradientScale;

  output->ShallowCopy(input);
  output->GetPointData()->AddArray(D);
  output->GetPointData()->AddArray(sigma_a);
  vtkLightTransportImage::AddFieldValues(
    output, "OpticalMedium.GradientScale", { report.gradientScale });
  vtkLightTransportImage::AddFieldValues(
    output, "OpticalMedium.DiffusionLength", { parameters.ell });
  return {};
}

//------------------------------------------------------------------------------
void vtkOpticalMediumFilter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "DiffusionMapping: " << this->DiffusionMapping << "\n";
  os << indent << "GradientFunction: " << this->GradientFunction << "\n";
  os << indent << "DiffusionComplement: " << this->DiffusionComplement << "\n";
  os << indent << "DiffusionFunction: " << this->DiffusionFunction << "\n";
  os << indent << "GradientScale: " << this->GradientScale << "\n";
  os << indent << "ComputedGradientScale: " << this->ComputedGradientScale << "\n";
  os << indent << "ScalePoint: ";
  if (this->HasScalePoint)
  {
    os << this->ScalePoint[0] << " " << this->ScalePoint[1] << " " << this->ScalePoint[2] << "\n";
  }
  else
  {
    os << "(none)\n";
  }
  os << indent << "DerivativeScale: " << this->DerivativeScale << "\n";
  os << indent << "DiffusionLength: " << this->DiffusionLength << "\n";
  os << indent << "BetaFloor: " << this->BetaFloor << "\n";
  os << indent << "AbsorptionMapping: " << this->AbsorptionMapping << "\n";
  os << indent << "AbsorptionFunction: " << this->AbsorptionFunction << "\n";
  os << indent << "Albedo: " << this->Albedo << "\n";
  os << indent << "Anisotropy: " << this->Anisotropy << "\n";
  os << indent << "Reach: " << this->Reach << "\n";
  os << indent << "Component: " << this->Component << "\n";
  os << indent << "NoDataValues:";
  for (double value : this->NoDataValues)
  {
    os << " " << value;
  }
  os << "\n";
}
