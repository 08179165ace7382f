// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "LightFieldSliceImage.h"

#include "vtkCellArray.h"
#include "vtkDataArray.h"
#include "vtkImageData.h"
#include "vtkLightFieldProperty.h"
#include "vtkMath.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkSMPTools.h"

#include <algorithm>
#include <cmath>

namespace lighttransport
{
namespace
{
constexpr int TableSize = 1024;
// Samples along the longest side: enough that a coarse slice shows no texels, and
// no more than a screen has.
constexpr int FewestSamples = 256;
constexpr int MostSamples = 1024;

unsigned char ToByte(double value)
{
  return static_cast<unsigned char>(std::min(255., std::max(0., 255. * value + 0.5)));
}

/** Where x lies between points first and last: the lower one, and the weight of the next. */
void Bracket(double x, int first, int last, int& low, double& weight)
{
  const double clamped = std::min<double>(last, std::max<double>(first, x));
  low = std::min(last, static_cast<int>(std::floor(clamped)));
  weight = clamped - low;
  if (low == last && last > first)
  {
    --low;
    weight = 1.;
  }
}

/** The voxels of one slice as doubles, and linear interpolation between them. */
class Plane
{
public:
  Plane(const SliceFrame& frame, vtkImageData* image, const AnatomyLook& look)
    : Width(frame.size[0])
    , Height(frame.size[1])
    , Components(look.isColor ? 3 : 1)
    , Values(static_cast<std::size_t>(Width) * Height * Components)
  {
    const int* extent = image->GetExtent();
    int ijk[3];
    ijk[frame.normalAxis] = frame.index;
    std::size_t n = 0;
    for (int v = 0; v < this->Height; ++v)
    {
      ijk[frame.axisV] =
        frame.flipV ? extent[2 * frame.axisV + 1] - v : extent[2 * frame.axisV] + v;
      for (int u = 0; u < this->Width; ++u)
      {
        ijk[frame.axisU] =
          frame.flipU ? extent[2 * frame.axisU + 1] - u : extent[2 * frame.axisU] + u;
        const vtkIdType id = image->ComputePointId(ijk);
        for (int c = 0; c < this->Components; ++c)
        {
          this->Values[n++] = look.array->GetComponent(id, look.isColor ? c : look.component);
        }
      }
    }
  }

  /** At (s, t) of the frame; NaN where the nearest voxel is NaN. */
  double At(double s, double t, int c) const
  {
    int u;
    int v;
    double wu;
    double wv;
    Bracket(s * this->Width - 0.5, 0, this->Width - 1, u, wu);
    Bracket(t * this->Height - 0.5, 0, this->Height - 1, v, wv);
    const int u1 = std::min(u + 1, this->Width - 1);
    const int v1 = std::min(v + 1, this->Height - 1);
    const double values[4] = { this->Get(u, v, c), this->Get(u1, v, c), this->Get(u, v1, c),
      this->Get(u1, v1, c) };
    const double weights[4] = { (1 - wu) * (1 - wv), wu * (1 - wv), (1 - wu) * wv, wu * wv };
    const double nearest = values[(wu > 0.5 ? 1 : 0) + (wv > 0.5 ? 2 : 0)];
    if (std::isnan(nearest))
    {
      return nearest;
    }
    double sum = 0.;
    double weight = 0.;
    for (int n = 0; n < 4; ++n)
    {
      if (weights[n] > 0. && !std::isnan(values[n]))
      {
        sum += weights[n] * values[n];
        weight += weights[n];
      }
    }
    return sum / weight;
  }

private:
  double Get(int u, int v, int c) const
  {
    return this->Values[(static_cast<std::size_t>(v) * this->Width + u) * this->Components + c];
  }
  int Width;
  int Height;
  int Components;
  std::vector<double> Values;
};

/** Lays the light over a colour, as the volume mapper's Overlay does with a sample. */
void AddLight(const LightLook& look, const Vector3& world, double rgb[3])
{
  double value[3] = { 0., 0., 0. };
  const bool isFlux = look.mode == vtkLightFieldProperty::FluxDirection;
  const bool has = look.hasWindow && look.field && look.field.Sample(world, isFlux ? 3 : 1, value);
  if (!has)
  {
    return;
  }
  const double magnitude = isFlux ? vtkMath::Norm(value) : value[0];
  const double t = look.property->GetPosition(magnitude, look.window);
  const double* color = look.At(t, magnitude < 0.);
  for (int c = 0; c < 3; ++c)
  {
    const double light =
      isFlux ? (magnitude > 0. ? t * std::abs(value[c]) / magnitude : 0.) : color[c];
    rgb[c] += color[3] * (light - rgb[c]);
  }
}
} // namespace

//------------------------------------------------------------------------------
FieldSampler::FieldSampler(vtkImageData* image, vtkDataArray* array)
  : Array(array)
{
  image->GetExtent(this->Extent);
  this->Stride[1] = this->Extent[1] - this->Extent[0] + 1;
  this->Stride[2] = this->Stride[1] * (this->Extent[3] - this->Extent[2] + 1);
  vtkMatrix4x4* matrix = image->GetPhysicalToIndexMatrix();
  for (int row = 0; row < 3; ++row)
  {
    for (int column = 0; column < 4; ++column)
    {
      this->WorldToIndex[row][column] = matrix->GetElement(row, column);
    }
  }
}

//------------------------------------------------------------------------------
bool FieldSampler::Sample(const Vector3& world, int components, double* values) const
{
  int low[3];
  double weight[3];
  vtkIdType base = 0;
  vtkIdType nearest = 0;
  vtkIdType step[3];
  for (int axis = 0; axis < 3; ++axis)
  {
    const double* row = this->WorldToIndex[axis];
    const double x = row[0] * world[0] + row[1] * world[1] + row[2] * world[2] + row[3];
    const int first = this->Extent[2 * axis];
    const int last = this->Extent[2 * axis + 1];
    // The border itself belongs to the domain, whatever the transform's rounding.
    if (!(x >= first - 0.5 - 1e-6 && x <= last + 0.5 + 1e-6))
    {
      return false;
    }
    Bracket(x, first, last, low[axis], weight[axis]);
    base += (low[axis] - first) * this->Stride[axis];
    step[axis] = last > first ? this->Stride[axis] : 0;
    nearest += weight[axis] > 0.5 ? step[axis] : 0;
  }
  for (int c = 0; c < components; ++c)
  {
    if (std::isnan(this->Array->GetComponent(base + nearest, c)))
    {
      return false;
    }
    double sum = 0.;
    double weights = 0.;
    for (int corner = 0; corner < 8; ++corner)
    {
      double w = 1.;
      vtkIdType id = base;
      for (int axis = 0; axis < 3; ++axis)
      {
        const bool upper = (corner >> axis & 1) != 0;
        w *= upper ? weight[axis] : 1. - weight[axis];
        id += upper ? step[axis] : 0;
      }
      if (w > 0.)
      {
        const double value = this->Array->GetComponent(id, c);
        if (!std::isnan(value))
        {
          sum += w * value;
          weights += w;
        }
      }
    }
    values[c] = sum / weights;
  }
  return true;
}

//------------------------------------------------------------------------------
void LightLook::Tabulate(double maximum)
{
  this->hasWindow = this->property->GetEffectiveWindow(maximum, this->window);
  this->mode = this->property->GetMode();
  this->positive.assign(4 * TableSize, 0.);
  this->negative.assign(4 * TableSize, 0.);
  if (!this->hasWindow)
  {
    return;
  }
  const bool linear = this->property->GetScale() == vtkLightFieldProperty::Linear;
  for (int n = 0; n < TableSize; ++n)
  {
    const double t = n / (TableSize - 1.);
    const double value = linear ? this->window[0] + t * (this->window[1] - this->window[0])
                                : this->window[0] * std::pow(this->window[1] / this->window[0], t);
    this->property->MapValue(value, maximum, &this->positive[4 * n]);
    this->property->MapValue(-value, maximum, &this->negative[4 * n]);
  }
}

//------------------------------------------------------------------------------
const double* LightLook::At(double t, bool isNegative) const
{
  const int n = static_cast<int>(std::lround(t * (TableSize - 1)));
  return (isNegative ? this->negative : this->positive).data() + 4 * n;
}

//------------------------------------------------------------------------------
void RobustRange(vtkDataArray* array, int component, double low, double high, double range[2])
{
  const vtkIdType count = array->GetNumberOfTuples();
  // An odd step, so that images with sides of a power of two are not sampled in columns.
  const vtkIdType step = count <= 1000000 ? 1 : (count / 1000000) | 1;
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(count / step + 1));
  for (vtkIdType id = 0; id < count; id += step)
  {
    const double value = array->GetComponent(id, component);
    if (std::isfinite(value))
    {
      values.push_back(value);
    }
  }
  range[0] = 0.;
  range[1] = 1.;
  if (values.empty())
  {
    return;
  }
  const double quantiles[2] = { low, high };
  for (int end = 0; end < 2; ++end)
  {
    const auto position = values.begin() +
      static_cast<std::ptrdiff_t>(std::lround(quantiles[end] * (values.size() - 1.)));
    std::nth_element(values.begin(), position, values.end());
    range[end] = *position;
  }
  if (range[0] == range[1]) // mostly one value: what else there is decides
  {
    const auto ends = std::minmax_element(values.begin(), values.end());
    range[0] = *ends.first;
    range[1] = *ends.second;
  }
}

//------------------------------------------------------------------------------
void FillSlice(vtkImageData* picture, const SliceFrame& frame, vtkImageData* anatomy,
  const AnatomyLook& anatomyLook, vtkImageData* light, const LightLook& lightLook)
{
  // The finest sample that either grid has in this plane.
  const double* spacing = anatomy->GetSpacing();
  double finest = std::min(spacing[frame.axisU], spacing[frame.axisV]);
  if (light)
  {
    const double* lightSpacing = light->GetSpacing();
    finest = std::min({ finest, lightSpacing[0], lightSpacing[1], lightSpacing[2] });
  }
  const double longest = std::max(frame.length[0], frame.length[1]);
  const double samples =
    std::min<double>(MostSamples, std::max<double>(FewestSamples, longest / finest));
  int size[2];
  for (int side = 0; side < 2; ++side)
  {
    size[side] = std::max(1, static_cast<int>(std::lround(samples * frame.length[side] / longest)));
  }
  picture->SetDimensions(size[0], size[1], 1);
  picture->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
  unsigned char* pixels = static_cast<unsigned char*>(picture->GetScalarPointer());

  const Plane plane(frame, anatomy, anatomyLook);
  const double range = anatomyLook.white - anatomyLook.black;
  vtkSMPTools::For(0, size[1],
    [&](vtkIdType begin, vtkIdType end)
    {
      for (vtkIdType row = begin; row < end; ++row)
      {
        const double t = (row + 0.5) / size[1];
        for (int column = 0; column < size[0]; ++column)
        {
          const double s = (column + 0.5) / size[0];
          double rgb[3];
          for (int c = 0; c < 3; ++c)
          {
            if (c > 0 && !anatomyLook.isColor)
            {
              rgb[c] = rgb[0];
              continue;
            }
            const double value = plane.At(s, t, c);
            const double scaled = anatomyLook.isColor ? value / 255.
              : range != 0.                           ? (value - anatomyLook.black) / range
                                                      : (value > anatomyLook.black      ? 1.
                                                            : value < anatomyLook.black ? 0.
                                                                                        : 0.5);
            // NaN fails both comparisons of the clamp and would stay: it is black.
            rgb[c] = std::isnan(scaled) ? 0. : std::min(1., std::max(0., scaled));
          }
          AddLight(lightLook, frame.At(s, t), rgb);
          unsigned char* pixel = pixels + 3 * (row * size[0] + column);
          for (int c = 0; c < 3; ++c)
          {
            pixel[c] = ToByte(rgb[c]);
          }
        }
      }
    });
  picture->Modified();
}

//------------------------------------------------------------------------------
void FillArrows(vtkPolyData* arrows, const SliceFrame& frame, const ArrowLook& look)
{
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkCellArray> shafts;
  vtkNew<vtkCellArray> heads;
  int count[2];
  for (int side = 0; side < 2; ++side)
  {
    count[side] = std::max(1, static_cast<int>(std::floor(frame.length[side] / look.cell + 1e-9)));
  }
  for (int row = 0; row < count[1]; ++row)
  {
    for (int column = 0; column < count[0]; ++column)
    {
      // A grid of squares centred in the slice.
      const double s = 0.5 + (column - 0.5 * (count[0] - 1)) * look.cell / frame.length[0];
      const double t = 0.5 + (row - 0.5 * (count[1] - 1)) * look.cell / frame.length[1];
      const Vector3 center = frame.At(s, t);
      Vector3 flux;
      if (!(look.largest > 0.) || !look.flux.Sample(center, 3, flux.data()))
      {
        continue;
      }
      const double x = Dot(flux, frame.right);
      const double y = Dot(flux, frame.up);
      const double inPlane = std::hypot(x, y);
      const double strength =
        inPlane > 0. ? 1. + std::log10(inPlane / look.largest) / look.decades : 0.;
      if (!(strength > 0.))
      {
        continue;
      }
      // Down to a tenth of its length an arrow still shows which way it points.
      const double length = 0.9 * look.cell * (look.uniform ? 1. : std::max(0.1, strength));
      const double head = std::min(0.4 * length, 0.3 * look.cell);
      const auto add = [&](double along, double across)
      {
        double point[3];
        for (int c = 0; c < 3; ++c)
        {
          point[c] = center[c] +
            (along * (x * frame.right[c] + y * frame.up[c]) +
              across * (x * frame.up[c] - y * frame.right[c])) /
              inPlane;
        }
        return points->InsertNextPoint(point);
      };
      const vtkIdType shaft[2] = { add(-0.5 * length, 0.), add(0.5 * length, 0.) };
      const vtkIdType triangle[3] = { shaft[1], add(0.5 * length - head, 0.5 * head),
        add(0.5 * length - head, -0.5 * head) };
      shafts->InsertNextCell(2, shaft);
      heads->InsertNextCell(3, triangle);
    }
  }
  arrows->Initialize();
  arrows->SetPoints(points);
  arrows->SetLines(shafts);
  arrows->SetPolys(heads);
}
} // namespace lighttransport
