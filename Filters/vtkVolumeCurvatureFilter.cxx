// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkVolumeCurvatureFilter.h"

#include "Core/Curvature.h"
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
#include "vtkPointData.h"
#include "vtkUnsignedCharArray.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <sstream>
#include <string>

vtkStandardNewMacro(vtkVolumeCurvatureFilter);

namespace
{
constexpr double LongestDerivative = 32.; // smallest spacings; its cost grows with it
constexpr double SmallestSpacing = 1e-15; // curvatures, and their product, in float32
constexpr double LargestSpacing = 1e15;
constexpr double QuantisationNoise = 0.29; // of whole numbers, 1/sqrt(12)

} // namespace

//------------------------------------------------------------------------------
vtkVolumeCurvatureFilter::vtkVolumeCurvatureFilter()
{
  this->SetInputArrayToProcess(
    0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, vtkDataSetAttributes::SCALARS);
}

//------------------------------------------------------------------------------
void vtkVolumeCurvatureFilter::AddNoDataValue(double value)
{
  this->NoDataValues.push_back(value);
  this->Modified();
}

//------------------------------------------------------------------------------
void vtkVolumeCurvatureFilter::RemoveAllNoDataValues()
{
  if (!this->NoDataValues.empty())
  {
    this->NoDataValues.clear();
    this->Modified();
  }
}

//------------------------------------------------------------------------------
double vtkVolumeCurvatureFilter::GetNoDataValue(int i) const
{
  return i >= 0 && i < this->GetNumberOfNoDataValues() ? this->NoDataValues[i]
                                                       : std::numeric_limits<double>::quiet_NaN();
}

//------------------------------------------------------------------------------
int vtkVolumeCurvatureFilter::RequestUpdateExtent(
  vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  vtkLightTransportImage::RequestWholeExtents(inputs, 1);
  return 1;
}

//------------------------------------------------------------------------------
int vtkVolumeCurvatureFilter::RequestData(
  vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkImageData* input = vtkImageData::GetData(inputs[0]);
  vtkImageData* output = vtkImageData::GetData(outputs);
  this->ComputedNoiseLevel = 0.;
  this->ComputedGradientThreshold = 0.;
  output->Initialize();
  std::string problem;
  try
  {
    problem = this->Compute(input, this->GetInputArrayToProcess(0, inputs), output);
  }
  catch (const std::bad_alloc&)
  {
    problem = "not enough memory for the float arrays of " +
      std::to_string(input->GetNumberOfPoints()) + " points that are asked for";
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
std::string vtkVolumeCurvatureFilter::Compute(
  vtkImageData* input, vtkDataArray* scalars, vtkImageData* output)
{
  using namespace lighttransport;
  namespace image = vtkLightTransportImage;

  // Input and parameters.
  std::string problem = image::Problem(input);
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
  if (!(spacing >= SmallestSpacing && spacing <= LargestSpacing))
  {
    text << "the smallest spacing of the image is " << spacing << ", expected " << SmallestSpacing
         << " to " << LargestSpacing << ", for which curvatures fit into float32";
    return text.str();
  }
  const double sigma = this->DerivativeScale < 0. ? spacing : this->DerivativeScale;
  if (!(sigma <= LongestDerivative * spacing))
  {
    text << "DerivativeScale is " << this->DerivativeScale << ", expected at most "
         << LongestDerivative << " times the smallest spacing, " << spacing;
    return text.str();
  }
  if (!std::isfinite(this->NoiseLevel))
  {
    text << "NoiseLevel is " << this->NoiseLevel << ", expected a finite value";
    return text.str();
  }
  if (!this->ComputePrincipalCurvatures && !this->ComputeMeanCurvature &&
    !this->ComputeGaussianCurvature)
  {
    return "ComputePrincipalCurvatures, ComputeMeanCurvature and ComputeGaussianCurvature are all "
           "off, expected one of them on";
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
  const int type = scalars->GetDataType();
  const double epsilon = type == VTK_FLOAT ? std::numeric_limits<float>::epsilon()
    : type == VTK_DOUBLE                   ? std::numeric_limits<double>::epsilon()
                                           : 0.;
  CurvatureParameters parameters;
  parameters.reference = range.min / 2. + range.max / 2.;
  parameters.largest = range.max - parameters.reference;
  parameters.rounding = 0.5 * epsilon * std::max(std::abs(range.min), std::abs(range.max));
  parameters.noise = this->NoiseLevel;
  if (this->NoiseLevel < 0.)
  {
    parameters.noise = EstimateNoise(grid, values, parameters.reference, parameters.largest);
    parameters.noise = std::max(parameters.noise, epsilon == 0. ? QuantisationNoise : 0.);
  }
  parameters.insideIsHigh = this->InsideIsBright;
  parameters.singlePrecision = epsilon == 0. && scalars->GetDataTypeSize() <= 2;

  // Stages 2 to 4.
  vtkNew<vtkFloatArray> arrays[4];
  const char* const names[4] = { vtkLightTransportArrays::PrincipalCurvature1,
    vtkLightTransportArrays::PrincipalCurvature2, vtkLightTransportArrays::MeanCurvature,
    vtkLightTransportArrays::GaussianCurvature };
  const bool wanted[4] = { this->ComputePrincipalCurvatures, this->ComputePrincipalCurvatures,
    this->ComputeMeanCurvature, this->ComputeGaussianCurvature };
  float* fields[4] = {};
  for (int a = 0; a < 4; ++a)
  {
    if (wanted[a])
    {
      arrays[a]->SetName(names[a]);
      arrays[a]->SetNumberOfTuples(size);
      fields[a] = arrays[a]->GetPointer(0);
    }
  }
  const LevelSetCurvature curvature(grid, sigma);
  const CurvatureReport report = curvature.compute(values, parameters,
    { fields[0], fields[1], fields[2], fields[3] }, parallel, image::Progress(this, 0.1, 1.));
  if (report.cancelled)
  {
    return {}; // aborted: an empty output, no error
  }
  this->ComputedNoiseLevel = parameters.noise;
  this->ComputedGradientThreshold = report.threshold;

  output->ShallowCopy(input);
  for (int a = 0; a < 4; ++a)
  {
    if (wanted[a])
    {
      output->GetPointData()->AddArray(arrays[a]);
    }
  }
  vtkLightTransportImage::AddFieldValues(output, "VolumeCurvature.DerivativeScale", { sigma });
  vtkLightTransportImage::AddFieldValues(
    output, "VolumeCurvature.NoiseLevel", { parameters.noise });
  vtkLightTransportImage::AddFieldValues(
    output, "VolumeCurvature.GradientThreshold", { report.threshold });
  return {};
}

//------------------------------------------------------------------------------
void vtkVolumeCurvatureFilter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "ComputePrincipalCurvatures: " << this->ComputePrincipalCurvatures << "\n";
  os << indent << "ComputeMeanCurvature: " << this->ComputeMeanCurvature << "\n";
  os << indent << "ComputeGaussianCurvature: " << this->ComputeGaussianCurvature << "\n";
  os << indent << "DerivativeScale: " << this->DerivativeScale << "\n";
  os << indent << "InsideIsBright: " << this->InsideIsBright << "\n";
  os << indent << "NoiseLevel: " << this->NoiseLevel << "\n";
  os << indent << "ComputedNoiseLevel: " << this->ComputedNoiseLevel << "\n";
  os << indent << "ComputedGradientThreshold: " << this->ComputedGradientThreshold << "\n";
  os << indent << "Component: " << this->Component << "\n";
  os << indent << "NoDataValues:";
  for (double value : this->NoDataValues)
  {
    os << " " << value;
  }
  os << "\n";
}
