// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkCurvatureOpacityFilter.h"

#include "vtkCurvatureOpacityFunction.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportImage.h"
#include "vtkLightTransportInternal.h"

#include "vtkDataSet.h"
#include "vtkDataSetAttributes.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
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
#include <vector>

vtkStandardNewMacro(vtkCurvatureOpacityFilter);
vtkCxxSetObjectMacro(vtkCurvatureOpacityFilter, OpacityFunction, vtkCurvatureOpacityFunction);

namespace
{
constexpr int ProgressSteps = 16;
} // namespace

//------------------------------------------------------------------------------
vtkCurvatureOpacityFilter::vtkCurvatureOpacityFilter()
{
  vtkNew<vtkCurvatureOpacityFunction> function;
  this->SetOpacityFunction(function);
  this->SetInputArrayToProcess(
    0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, vtkLightTransportArrays::MeanCurvature);
  this->SetInputArrayToProcess(
    1, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, vtkDataSetAttributes::SCALARS);
}

//------------------------------------------------------------------------------
vtkCurvatureOpacityFilter::~vtkCurvatureOpacityFilter()
{
  this->SetOpacityFunction(nullptr);
}

//------------------------------------------------------------------------------
vtkMTimeType vtkCurvatureOpacityFilter::GetMTime()
{
  const vtkMTimeType time = this->Superclass::GetMTime();
  return this->OpacityFunction ? std::max(time, this->OpacityFunction->GetMTime()) : time;
}

//------------------------------------------------------------------------------
int vtkCurvatureOpacityFilter::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkDataSet");
  return 1;
}

//------------------------------------------------------------------------------
int vtkCurvatureOpacityFilter::RequestData(
  vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkDataSet* input = vtkDataSet::GetData(inputs[0]);
  vtkDataSet* output = vtkDataSet::GetData(outputs);
  this->ComputedCurvatureScale = 0.;
  output->Initialize();
  std::string problem;
  try
  {
    problem = this->Compute(input, this->GetInputArrayToProcess(0, inputs),
      this->DepthSource == FromArray ? this->GetInputArrayToProcess(1, inputs) : nullptr, output);
  }
  catch (const std::bad_alloc&)
  {
    problem = "not enough memory for the opacity of " + std::to_string(input->GetNumberOfPoints()) +
      " points";
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
std::string vtkCurvatureOpacityFilter::Compute(
  vtkDataSet* input, vtkDataArray* mean, vtkDataArray* second, vtkDataSet* output)
{
  std::ostringstream text;
  const vtkIdType size = input->GetNumberOfPoints();
  if (size < 1)
  {
    return "the input has no points, expected a surface or an image with curvatures";
  }
  if (!mean)
  {
    text << "the input has no point array \""
         << this->GetInputArrayInformation(0)->Get(vtkDataObject::FIELD_NAME())
         << "\", expected the mean curvature of vtkSurfaceCurvatureFilter or "
            "vtkVolumeCurvatureFilter";
    return text.str();
  }
  if (this->DepthSource < NoDepth || this->DepthSource > FromArray)
  {
    text << "DepthSource is " << this->DepthSource << ", expected 0 to " << FromArray;
    return text.str();
  }
  if (this->DepthSource == FromArray && !second)
  {
    return "DepthSource is FromArray and the input has no such point array, expected one that "
           "SetInputArrayToProcess(1, ...) names";
  }
  for (vtkDataArray* array : { mean, second })
  {
    if (array && array->GetNumberOfTuples() != size)
    {
      text << "the array \"" << (array->GetName() ? array->GetName() : "") << "\" has "
           << array->GetNumberOfTuples() << " tuples, expected one for each of the " << size
           << " points";
      return text.str();
    }
  }
  if (mean->GetNumberOfComponents() != 1)
  {
    text << "the array \"" << (mean->GetName() ? mean->GetName() : "") << "\" has "
         << mean->GetNumberOfComponents() << " components, expected one, the mean curvature";
    return text.str();
  }
  if (!(this->CurvatureScale >= 0. && std::isfinite(this->CurvatureScale)))
  {
    text << "CurvatureScale is " << this->CurvatureScale << ", expected a finite length >= 0";
    return text.str();
  }
  double direction[3] = { this->Direction[0], this->Direction[1], this->Direction[2] };
  if (this->DepthSource == AlongDirection)
  {
    const double length = std::hypot(direction[0], direction[1], direction[2]);
    if (!(length > 0. && std::isfinite(length)))
    {
      text << "Direction is " << direction[0] << " " << direction[1] << " " << direction[2]
           << ", expected a finite vector other than 0";
      return text.str();
    }
    for (double& x : direction)
    {
      x /= length;
    }
  }
  for (double x : { this->ViewPoint[0], this->ViewPoint[1], this->ViewPoint[2], this->DepthRange[0],
         this->DepthRange[1] })
  {
    if (!std::isfinite(x))
    {
      text << "ViewPoint or DepthRange holds " << x << ", expected finite numbers";
      return text.str();
    }
  }
  if (!this->OpacityFunction)
  {
    return "OpacityFunction is not set, expected a vtkCurvatureOpacityFunction";
  }
  const std::string problem = this->OpacityFunction->GetProblem();
  if (!problem.empty())
  {
    return "OpacityFunction: " + problem;
  }

  // The second quantity, and its range.
  const auto quantity = [&](vtkIdType i)
  {
    double p[3] = { 0., 0., 0. };
    switch (this->DepthSource)
    {
      case AlongDirection:
        input->GetPoint(i, p);
        return direction[0] * p[0] + direction[1] * p[1] + direction[2] * p[2];
      case FromViewPoint:
        input->GetPoint(i, p);
        return std::hypot(
          p[0] - this->ViewPoint[0], p[1] - this->ViewPoint[1], p[2] - this->ViewPoint[2]);
      case FromArray:
        return second->GetComponent(i, 0);
      default:
        return 0.;
    }
  };
  double q0 = this->DepthRange[0];
  double q1 = this->DepthRange[1];
  if (this->DepthSource != NoDepth && q0 == q1)
  {
    q0 = std::numeric_limits<double>::infinity();
    q1 = -q0;
    for (vtkIdType i = 0; i < size; ++i)
    {
      const double q = quantity(i);
      if (std::isfinite(q))
      {
        q0 = std::min(q0, q);
        q1 = std::max(q1, q);
      }
    }
    if (!(q0 <= q1))
    {
      q0 = q1 = 0.;
    }
  }
  const double s = this->CurvatureScale > 0.
    ? this->CurvatureScale
    : vtkCurvatureOpacityFunction::ChooseCurvatureScale(mean);

  vtkNew<vtkFloatArray> opacity;
  opacity->SetName(vtkLightTransportArrays::Opacity);
  opacity->SetNumberOfTuples(size);
  float* values = opacity->GetPointer(0);
  const auto progress = vtkLightTransportImage::Progress(this, 0., 1.);
  for (int step = 0; step < ProgressSteps; ++step)
  {
    if (!progress(double(step) / ProgressSteps))
    {
      return {}; // aborted: an empty output, no error
    }
    const vtkIdType first = size * step / ProgressSteps;
    vtkLightTransportParallelFor()(size * (step + 1) / ProgressSteps - first,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t i = first + begin; i < first + end; ++i)
        {
          const double H = mean->GetComponent(i, 0);
          const double z = q0 == q1 ? 0. : (quantity(i) - q0) / (q1 - q0);
          values[i] = static_cast<float>(
            this->OpacityFunction->Evaluate(vtkCurvatureOpacityFunction::Kappa(H, H, s), z));
        }
      });
  }
  this->ComputedCurvatureScale = s;

  output->ShallowCopy(input);
  output->GetPointData()->AddArray(opacity);
  if (this->MakeColors)
  {
    vtkNew<vtkUnsignedCharArray> colors;
    colors->SetName("CurvatureOpacityColor");
    colors->SetNumberOfComponents(4);
    colors->SetNumberOfTuples(size);
    unsigned char rgba[4];
    for (int a = 0; a < 3; ++a)
    {
      rgba[a] =
        static_cast<unsigned char>(std::lround(255. * std::min(std::max(this->Color[a], 0.), 1.)));
    }
    for (vtkIdType i = 0; i < size; ++i)
    {
      rgba[3] = static_cast<unsigned char>(std::lround(255. * values[i]));
      colors->SetTypedTuple(i, rgba);
    }
    output->GetPointData()->SetScalars(colors);
  }
  vtkLightTransportImage::AddFieldValues(output, "CurvatureOpacity.CurvatureScale", { s });
  vtkLightTransportImage::AddFieldValues(output, "CurvatureOpacity.DepthRange", { q0, q1 });
  return {};
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityFilter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "OpacityFunction: " << this->OpacityFunction << "\n";
  os << indent << "CurvatureScale: " << this->CurvatureScale << "\n";
  os << indent << "ComputedCurvatureScale: " << this->ComputedCurvatureScale << "\n";
  os << indent << "DepthSource: " << this->DepthSource << "\n";
  os << indent << "Direction: " << this->Direction[0] << " " << this->Direction[1] << " "
     << this->Direction[2] << "\n";
  os << indent << "ViewPoint: " << this->ViewPoint[0] << " " << this->ViewPoint[1] << " "
     << this->ViewPoint[2] << "\n";
  os << indent << "DepthRange: " << this->DepthRange[0] << " " << this->DepthRange[1] << "\n";
  os << indent << "MakeColors: " << this->MakeColors << "\n";
  os << indent << "Color: " << this->Color[0] << " " << this->Color[1] << " " << this->Color[2]
     << "\n";
}
