// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightTransportImage.h"

#include "vtkLightTransportCompat.h"

#include "vtkAlgorithm.h"
#include "vtkArrayDispatch.h"
#include "vtkDataSetAttributes.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkMatrix3x3.h"
#include "vtkNew.h"
#include "vtkSmartPointer.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkUnsignedCharArray.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <type_traits>

namespace vtkLightTransportImage
{
namespace
{
/** The no-data values that the type can hold, in the type. */
template <class T>
std::vector<T> InType(const std::vector<double>& values)
{
  std::vector<T> typed;
  for (double value : values)
  {
    if (std::is_floating_point<T>::value)
    {
      if (std::isinf(value) ||
        std::abs(value) <= static_cast<double>(std::numeric_limits<T>::max()))
      {
        typed.push_back(static_cast<T>(value));
      }
    }
    else if (value >= static_cast<double>(std::numeric_limits<T>::lowest()) &&
      value < std::ldexp(1., std::numeric_limits<T>::digits) && value == std::floor(value))
    {
      typed.push_back(static_cast<T>(value));
    }
  }
  return typed;
}

struct MakeReader
{
  int Component;
  const std::vector<double>* NoData;
  const unsigned char* Ghosts;
  vtkSmartPointer<vtkDataArray> Keep;
  lighttransport::ValueReader Reader;

  template <class ArrayT>
  void operator()(ArrayT* array)
  {
    using T = typename ArrayT::ValueType;
    this->Reader = [array, component = this->Component, noData = InType<T>(*this->NoData),
                     ghosts = this->Ghosts,
                     keep = this->Keep](std::int64_t begin, std::int64_t n, double* values)
    {
      for (std::int64_t l = 0; l < n; ++l)
      {
        values[l] = static_cast<double>(array->GetTypedComponent(begin + l, component));
      }
      if (!noData.empty())
      {
        for (std::int64_t l = 0; l < n; ++l)
        {
          const T value = array->GetTypedComponent(begin + l, component);
          if (!std::isnan(values[l]) &&
            std::find(noData.begin(), noData.end(), value) != noData.end())
          {
            values[l] = std::numeric_limits<double>::quiet_NaN();
          }
        }
      }
      if (ghosts)
      {
        for (std::int64_t l = 0; l < n; ++l)
        {
          if (ghosts[begin + l] & vtkDataSetAttributes::HIDDENPOINT)
          {
            values[l] = std::numeric_limits<double>::quiet_NaN();
          }
        }
      }
    };
  }
};
} // namespace

//------------------------------------------------------------------------------
std::string Problem(vtkImageData* image)
{
  std::ostringstream text;
  const int* extent = image->GetExtent();
  const double* spacing = image->GetSpacing();
  const double* origin = image->GetOrigin();
  if (image->GetNumberOfPoints() < 1)
  {
    text << "the image is empty: extent " << extent[0] << " " << extent[1] << " " << extent[2]
         << " " << extent[3] << " " << extent[4] << " " << extent[5]
         << ", expected at least one point";
    return text.str();
  }
  for (int a = 0; a < 3; ++a)
  {
    if (!std::isfinite(spacing[a]) || spacing[a] <= 0.)
    {
      text << "the spacing of the image is " << spacing[0] << " " << spacing[1] << " " << spacing[2]
           << ", expected positive finite lengths";
      return text.str();
    }
    if (!std::isfinite(origin[a]))
    {
      text << "the origin of the image is " << origin[0] << " " << origin[1] << " " << origin[2]
           << ", expected finite coordinates";
      return text.str();
    }
  }
  const double* m = image->GetDirectionMatrix()->GetData();
  for (int a = 0; a < 3; ++a)
  {
    for (int b = 0; b < 3; ++b)
    {
      const double dot = m[a] * m[b] + m[3 + a] * m[3 + b] + m[6 + a] * m[6 + b];
      if (!std::isfinite(dot) || std::abs(dot - (a == b ? 1. : 0.)) > 1e-3)
      {
        text << "the direction matrix of the image is";
        for (int i = 0; i < 9; ++i)
        {
          text << " " << m[i];
        }
        text << ", expected orthonormal columns";
        return text.str();
      }
    }
  }
  return {};
}

//------------------------------------------------------------------------------
std::string ScalarsProblem(
  vtkAlgorithm* algorithm, vtkImageData* image, vtkDataArray* scalars, int component)
{
  std::ostringstream text;
  if (!scalars)
  {
    const char* name = algorithm->GetInputArrayInformation(0)->Get(vtkDataObject::FIELD_NAME());
    text << "the image has no point array "
         << (name ? std::string("\"") + name + "\"" : "of scalars")
         << ", expected active point scalars or one named by SetInputArrayToProcess";
    return text.str();
  }
  const std::string name = scalars->GetName() ? scalars->GetName() : "scalars";
  if (scalars->GetNumberOfTuples() != image->GetNumberOfPoints())
  {
    text << "the array \"" << name << "\" has " << scalars->GetNumberOfTuples()
         << " tuples, expected one for each of the " << image->GetNumberOfPoints() << " points";
  }
  else if (component < 0 || component >= scalars->GetNumberOfComponents())
  {
    text << "Component is " << component << ", expected 0 to "
         << scalars->GetNumberOfComponents() - 1 << " for the array \"" << name << "\"";
  }
  return text.str();
}

//------------------------------------------------------------------------------
lighttransport::Grid GridOf(vtkImageData* image)
{
  lighttransport::Grid grid;
  image->GetDimensions(grid.dims.data());
  image->GetSpacing(grid.spacing.data());
  return grid;
}

//------------------------------------------------------------------------------
void WorldToIndex(vtkImageData* image, const double world[3], double index[3])
{
  image->TransformPhysicalPointToContinuousIndex(world, index);
  for (int a = 0; a < 3; ++a)
  {
    index[a] -= image->GetExtent()[2 * a];
  }
}

//------------------------------------------------------------------------------
bool Inside(const lighttransport::Grid& grid, const double index[3])
{
  constexpr double slack = 1e-6;
  for (int a = 0; a < 3; ++a)
  {
    if (!(index[a] >= -0.5 - slack && index[a] <= grid.dims[a] - 0.5 + slack))
    {
      return false;
    }
  }
  return true;
}

//------------------------------------------------------------------------------
bool SameGeometry(vtkImageData* a, vtkImageData* b)
{
  int dimsA[3];
  int dimsB[3];
  a->GetDimensions(dimsA);
  b->GetDimensions(dimsB);
  if (!std::equal(dimsA, dimsA + 3, dimsB))
  {
    return false;
  }
  // Three corners and the first point at the same place.
  for (int corner = 0; corner < 4; ++corner)
  {
    double index[3];
    double world[3];
    for (int axis = 0; axis < 3; ++axis)
    {
      index[axis] = a->GetExtent()[2 * axis] + (corner == axis + 1 ? dimsA[axis] : 0);
    }
    a->TransformContinuousIndexToPhysicalPoint(index, world);
    WorldToIndex(b, world, index);
    for (int axis = 0; axis < 3; ++axis)
    {
      const double expected = corner == axis + 1 ? dimsA[axis] : 0;
      if (!(std::abs(index[axis] - expected) <= 1e-6))
      {
        return false;
      }
    }
  }
  return true;
}

//------------------------------------------------------------------------------
std::string DomainAsString(vtkImageData* image)
{
  double low[3] = { 0., 0., 0. };
  double high[3] = { 0., 0., 0. };
  const int* extent = image->GetExtent();
  for (int corner = 0; corner < 8; ++corner)
  {
    double index[3];
    double world[3];
    for (int a = 0; a < 3; ++a)
    {
      index[a] = (corner >> a) & 1 ? extent[2 * a + 1] + 0.5 : extent[2 * a] - 0.5;
    }
    image->TransformContinuousIndexToPhysicalPoint(index, world);
    for (int a = 0; a < 3; ++a)
    {
      low[a] = corner == 0 ? world[a] : std::min(low[a], world[a]);
      high[a] = corner == 0 ? world[a] : std::max(high[a], world[a]);
    }
  }
  std::ostringstream text;
  text << "x " << low[0] << " to " << high[0] << ", y " << low[1] << " to " << high[1] << ", z "
       << low[2] << " to " << high[2];
  return text.str();
}

//------------------------------------------------------------------------------
lighttransport::ValueReader Reader(
  vtkDataArray* array, int component, const std::vector<double>& noData, vtkDataArray* ghosts)
{
  MakeReader maker;
  maker.Component = component;
  maker.NoData = &noData;
  auto* hidden = vtkUnsignedCharArray::SafeDownCast(ghosts);
  maker.Ghosts = hidden ? hidden->GetPointer(0) : nullptr;
  maker.Keep = array;
  if (!vtkArrayDispatch::Dispatch::Execute(array, maker))
  {
    // Bits, implicit arrays: their readers share a buffer, so read a copy.
    vtkNew<vtkDoubleArray> copy;
    copy->DeepCopy(array);
    maker.Keep = copy;
    maker(copy.Get());
  }
  return maker.Reader;
}

//------------------------------------------------------------------------------
void RequestWholeExtents(vtkInformationVector** inputs, int numberOfPorts)
{
  using Pipeline = vtkStreamingDemandDrivenPipeline;
  for (int port = 0; port < numberOfPorts; ++port)
  {
    for (int i = 0; i < inputs[port]->GetNumberOfInformationObjects(); ++i)
    {
      vtkInformation* info = inputs[port]->GetInformationObject(i);
      if (info->Has(Pipeline::WHOLE_EXTENT()))
      {
        int extent[6];
        info->Get(Pipeline::WHOLE_EXTENT(), extent);
        info->Set(Pipeline::UPDATE_EXTENT(), extent, 6);
      }
    }
  }
}

//------------------------------------------------------------------------------
void AddFieldValues(vtkDataObject* data, const char* name, std::initializer_list<double> values)
{
  vtkNew<vtkDoubleArray> array;
  array->SetName(name);
  for (const double value : values)
  {
    array->InsertNextValue(value);
  }
  data->GetFieldData()->AddArray(array);
}

//------------------------------------------------------------------------------
lighttransport::ProgressFunction Progress(vtkAlgorithm* algorithm, double from, double to)
{
  return [algorithm, from, to](double fraction)
  {
    algorithm->UpdateProgress(from + (to - from) * fraction);
    return !vtkLightTransportCheckAbort(algorithm);
  };
}
} // namespace vtkLightTransportImage
