// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "VolumeExtinction.h"

#include "vtkVisibilityFactorFilter.h"

#include "vtkCollection.h"
#include "vtkColorTransferFunction.h"
#include "vtkContourValues.h"
#include "vtkDataArray.h"
#include "vtkFloatArray.h"
#include "vtkGPUVolumeRayCastMapper.h"
#include "vtkImageData.h"
#include "vtkMatrix3x3.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPlane.h"
#include "vtkPlaneCollection.h"
#include "vtkPointData.h"
#include "vtkSMPTools.h"
#include "vtkSmartPointer.h"
#include "vtkVolume.h"
#include "vtkVolumeProperty.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>

namespace
{
constexpr int TableSize = 4096;
/** An opacity of 1 has no extinction; this is 9.2 unit distances of optical depth each. */
constexpr double MostOpaque = .9999;

//------------------------------------------------------------------------------
/** A function of a value in [lo, hi], sampled; constant beyond. */
struct Table
{
  double lo = 0.;
  double scale = 0.; // entries per unit of the value
  std::vector<double> entries;

  Table() = default;
  Table(vtkPiecewiseFunction* function, double lowest, double highest)
    : lo(lowest)
    , scale(highest > lowest ? (TableSize - 1) / (highest - lowest) : 0.)
    , entries(TableSize)
  {
    function->GetTable(lowest, std::max(highest, lowest), TableSize, this->entries.data());
  }
  double operator()(double value) const
  {
    const double x = (value - this->lo) * this->scale + .5;
    // Also false for a NaN.
    const int i = x > 0. ? (x < TableSize - 1. ? static_cast<int>(x) : TableSize - 1) : 0;
    return this->entries[i];
  }
};

//------------------------------------------------------------------------------
/** The volume's scalars as the mapper takes them. */
struct Scalars
{
  vtkImageData* image = nullptr;
  vtkSmartPointer<vtkDataArray> array;
  int dimensions[3] = { 0, 0, 0 };
  double first[3] = { 0., 0., 0. }; // index of the first value: of a point, or a cell's middle
};

bool findScalars(vtkGPUVolumeRayCastMapper* mapper, Scalars& scalars)
{
  scalars.image = vtkImageData::SafeDownCast(mapper->GetDataSetInput());
  if (!scalars.image)
  {
    return false;
  }
  int cellFlag = 0;
  scalars.array = vtkAbstractMapper::GetScalars(scalars.image, mapper->GetScalarMode(),
    mapper->GetArrayAccessMode(), mapper->GetArrayId(), mapper->GetArrayName(), cellFlag);
  int extent[6];
  scalars.image->GetExtent(extent);
  const bool cells = cellFlag == 1;
  vtkIdType count = 1;
  for (int a = 0; a < 3; ++a)
  {
    scalars.dimensions[a] = extent[2 * a + 1] - extent[2 * a] + (cells ? 0 : 1);
    scalars.first[a] = extent[2 * a] + (cells ? .5 : 0.);
    count *= scalars.dimensions[a];
  }
  return scalars.array && count > 0 && scalars.array->GetNumberOfTuples() == count;
}

//------------------------------------------------------------------------------
/** A colour of a value in [lo, hi], sampled; constant beyond. */
struct ColorTable
{
  double lo = 0.;
  double scale = 0.;
  std::vector<double> entries;

  ColorTable() = default;
  ColorTable(vtkVolumeProperty* property, int function, double lowest, double highest)
    : lo(lowest)
    , scale(highest > lowest ? (TableSize - 1) / (highest - lowest) : 0.)
    , entries(static_cast<std::size_t>(3) * TableSize)
  {
    const double high = std::max(highest, lowest);
    if (property->GetColorChannels(function) == 3)
    {
      property->GetRGBTransferFunction(function)->GetTable(
        lowest, high, TableSize, this->entries.data());
    }
    else
    {
      property->GetGrayTransferFunction(function)->GetTable(
        lowest, high, TableSize, this->entries.data(), 3);
      for (std::size_t i = 0; i < this->entries.size(); ++i)
      {
        this->entries[i] = this->entries[i / 3 * 3];
      }
    }
  }
  const double* operator()(double value) const
  {
    const double x = (value - this->lo) * this->scale + .5;
    const int i = x > 0. ? (x < TableSize - 1. ? static_cast<int>(x) : TableSize - 1) : 0;
    return &this->entries[static_cast<std::size_t>(3) * i];
  }
};

double extinctionOf(double alpha, double unitDistance)
{
  return alpha > 0. ? -std::log1p(-std::min(alpha, MostOpaque)) / unitDistance : 0.;
}

/** What the volume's property makes of values: opacity per unit distance. */
struct Classifier
{
  int components = 1;
  bool independent = false;
  int opacityComponent = 0; // of dependent ones
  double unitDistance[4] = { 1., 1., 1., 1. };
  // VTK does not normalise four dependent components: a stored value of 1 is the range's end.
  double ofRange = 0.;
  double weights[4] = { 1., 1., 1., 1. };
  double ranges[4][2] = {};
  Table opacity[4];
  bool byGradient[4] = { false, false, false, false };
  Table gradientOpacity[4];
  vtkImageData* transfer2D[4] = { nullptr, nullptr, nullptr, nullptr };
  Table sigma; // of one component without gradients and labels, in opacity's place
  bool colored = false;
  ColorTable color[4];
  std::vector<std::array<double, 2>> isosurfaces; // value, optical depth across
  double spacing[3] = { 1., 1., 1. };

  // masks
  vtkSmartPointer<vtkDataArray> mask;
  bool labels = false;
  double blend = 1.;
  std::map<int, Table> labelOpacity;
  std::map<int, vtkColorTransferFunction*> labelColor;

  bool needsGradient() const
  {
    return std::any_of(this->byGradient, this->byGradient + 4, [](bool b) { return b; });
  }

  /** RGBA. */
  const float* lookUp2D(int c, double value, double gradient) const
  {
    vtkImageData* function = this->transfer2D[c];
    int size[3];
    function->GetDimensions(size);
    const double range = this->ranges[c][1] - this->ranges[c][0];
    const double steepest = .25 * range;
    const double x = range > 0. ? (value - this->ranges[c][0]) / range : 0.;
    const double y = steepest > 0. ? gradient / steepest : 0.;
    const auto index = [](double t, int n)
    { return t > 0. ? (t < 1. ? static_cast<int>(t * n) : n - 1) : 0; };
    return static_cast<const float*>(
      function->GetScalarPointer(index(x, size[0]), index(y, size[1]), 0));
  }
  double opacityOf(int c, double value, double gradient) const
  {
    if (this->transfer2D[c])
    {
      return this->lookUp2D(c, value, gradient)[3];
    }
    const double a = this->opacity[c](value);
    return this->byGradient[c] ? a * this->gradientOpacity[c](gradient) : a;
  }
};

void prepareMask(vtkGPUVolumeRayCastMapper* mapper, vtkVolumeProperty* property,
  const Scalars& scalars, Classifier& classifier)
{
  vtkImageData* mask = mapper->GetMaskInput();
  vtkDataArray* values = mask ? mask->GetPointData()->GetScalars() : nullptr;
  if (!values || values->GetNumberOfTuples() != scalars.array->GetNumberOfTuples())
  {
    return;
  }
  classifier.mask = values;
  classifier.labels = mapper->GetMaskType() == vtkGPUVolumeRayCastMapper::LabelMapMaskType;
  classifier.blend = mapper->GetMaskBlendFactor();
  if (classifier.labels)
  {
    double range[2];
    values->GetRange(range);
    for (int label = 1; label <= static_cast<int>(std::min(range[1], 1024.)); ++label)
    {
      if (vtkPiecewiseFunction* function = property->GetLabelScalarOpacity(label))
      {
        classifier.labelOpacity.emplace(
          label, Table(function, classifier.ranges[0][0], classifier.ranges[0][1]));
      }
      if (vtkColorTransferFunction* color = property->GetLabelColor(label))
      {
        classifier.labelColor.emplace(label, color);
      }
    }
  }
}

Classifier makeClassifier(vtkGPUVolumeRayCastMapper* mapper, vtkVolumeProperty* property,
  const Scalars& scalars, bool colored)
{
  Classifier classifier;
  classifier.colored = colored;
  scalars.image->GetSpacing(classifier.spacing);
  classifier.components = std::min(scalars.array->GetNumberOfComponents(), 4);
  classifier.independent = classifier.components > 1 && property->GetIndependentComponents();
  classifier.opacityComponent = classifier.independent ? 0 : classifier.components - 1;
  const bool twoDimensional = property->GetTransferFunctionMode() == vtkVolumeProperty::TF_2D;
  const int functions = classifier.independent ? classifier.components : 1;
  for (int c = 0; c < classifier.components; ++c)
  {
    scalars.array->GetFiniteRange(classifier.ranges[c], c);
  }
  for (int f = 0; f < functions; ++f)
  {
    const double* range =
      classifier.ranges[classifier.independent ? f : classifier.opacityComponent];
    classifier.weights[f] = property->GetComponentWeight(f);
    classifier.unitDistance[f] = property->GetScalarOpacityUnitDistance(
      classifier.independent ? f : classifier.opacityComponent);
    vtkImageData* function = twoDimensional ? property->GetTransferFunction2D(f) : nullptr;
    if (function && function->GetScalarType() == VTK_FLOAT &&
      function->GetNumberOfScalarComponents() == 4 && function->GetNumberOfPoints() > 0)
    {
      classifier.transfer2D[f] = function;
      classifier.byGradient[f] = true;
      continue;
    }
    classifier.opacity[f] = Table(property->GetScalarOpacity(f), range[0], range[1]);
    if (colored)
    {
      classifier.color[f] = ColorTable(
        property, f, classifier.ranges[f][0], classifier.ranges[f][1]); // of the first component
    }
    if (!twoDimensional && property->HasGradientOpacity(f) &&
      !property->GetDisableGradientOpacity(f))
    {
      classifier.byGradient[f] = true;
      classifier.gradientOpacity[f] =
        Table(property->GetGradientOpacity(f), 0., .25 * (range[1] - range[0]));
    }
  }
  if (classifier.components == 4 && !classifier.independent)
  {
    switch (scalars.array->GetDataType())
    {
      case VTK_UNSIGNED_CHAR:
      case VTK_SIGNED_CHAR:
      case VTK_UNSIGNED_SHORT:
      case VTK_SHORT:
        classifier.ofRange = 1. / scalars.array->GetDataTypeMax();
        break;
      case VTK_FLOAT:
        classifier.ofRange = 1.;
        break;
      default:
        break;
    }
  }
  prepareMask(mapper, property, scalars, classifier);
  if (classifier.components == 1 && !classifier.byGradient[0] && !classifier.labels)
  {
    classifier.sigma = classifier.opacity[0];
    for (double& entry : classifier.sigma.entries)
    {
      entry = extinctionOf(entry, classifier.unitDistance[0]);
    }
  }
  if (mapper->GetBlendMode() == vtkVolumeMapper::ISOSURFACE_BLEND)
  {
    vtkContourValues* contours = property->GetIsoSurfaceValues();
    for (int i = 0; i < contours->GetNumberOfContours(); ++i)
    {
      const double value = contours->GetValue(i);
      const double alpha = std::min(property->GetScalarOpacity(0)->GetValue(value), MostOpaque);
      classifier.isosurfaces.push_back({ { value, alpha > 0. ? -std::log1p(-alpha) : 0. } });
    }
  }
  return classifier;
}

//------------------------------------------------------------------------------
/** What cropping and clipping leave, by the point's index. */
struct Cuts
{
  bool cropping = false;
  double planes[6] = {};
  int flags = 0;
  std::vector<std::array<double, 4>> halfSpaces; // of the index: >= 0 is kept
  std::array<double, 12> indexToData = {};

  bool any() const { return this->cropping || !this->halfSpaces.empty(); }
  bool keeps(const double index[3]) const
  {
    for (const auto& h : this->halfSpaces)
    {
      if (h[0] * index[0] + h[1] * index[1] + h[2] * index[2] + h[3] < 0.)
      {
        return false;
      }
    }
    if (!this->cropping)
    {
      return true;
    }
    int region = 0;
    for (int a = 0, step = 1; a < 3; ++a, step *= 3)
    {
      const double* m = &this->indexToData[4 * a];
      const double x = m[0] * index[0] + m[1] * index[1] + m[2] * index[2] + m[3];
      region += step * (x < this->planes[2 * a] ? 0 : x < this->planes[2 * a + 1] ? 1 : 2);
    }
    return (this->flags >> region & 1) != 0;
  }
};

Cuts makeCuts(vtkGPUVolumeRayCastMapper* mapper, vtkVolume* volume, vtkImageData* image)
{
  Cuts cuts;
  vtkMatrix4x4* indexToData = image->GetIndexToPhysicalMatrix();
  for (int i = 0; i < 12; ++i)
  {
    cuts.indexToData[i] = indexToData->GetElement(i / 4, i % 4);
  }
  cuts.cropping = mapper->GetCropping() != 0;
  mapper->GetCroppingRegionPlanes(cuts.planes);
  cuts.flags = mapper->GetCroppingRegionFlags();
  if (vtkPlaneCollection* planes = mapper->GetClippingPlanes())
  {
    vtkNew<vtkMatrix4x4> indexToWorld;
    vtkMatrix4x4::Multiply4x4(volume->GetMatrix(), indexToData, indexToWorld);
    for (int i = 0; i < planes->GetNumberOfItems(); ++i)
    {
      const double* n = planes->GetItem(i)->GetNormal();
      const double* o = planes->GetItem(i)->GetOrigin();
      std::array<double, 4> h = { { 0., 0., 0., 0. } };
      for (int column = 0; column < 4; ++column)
      {
        for (int row = 0; row < 3; ++row)
        {
          h[column] +=
            n[row] * (indexToWorld->GetElement(row, column) - (column == 3 ? o[row] : 0.));
        }
      }
      cuts.halfSpaces.push_back(h);
    }
  }
  return cuts;
}

//------------------------------------------------------------------------------
/** A value, or a quarter of the way to its neighbours: side -1, 0, 1. */
struct Place
{
  int index[3];
  int side[3];
};

/** sigma_t of what is drawn, averaged over blocks of values. */
template <typename T>
struct Worker
{
  const T* values;
  const Scalars& scalars;
  const Classifier& classifier;
  const Cuts& cuts;
  bool interpolates;
  int steps[3];
  int coarse[3];
  float* sigma_t;    // one value, or three
  double axes[3][3]; // world vector from a value to the next, along each grid axis

  /** |grad S| times the mean spacing, as VTK's gradient opacity has it. */
  double gradient(const Place& p, int c) const
  {
    const int* n = this->scalars.dimensions;
    const int(&index)[3] = p.index;
    double sum = 0.;
    double spacings = 0.;
    for (int a = 0; a < 3; ++a)
    {
      int lower[3] = { index[0], index[1], index[2] };
      int upper[3] = { index[0], index[1], index[2] };
      lower[a] = std::max(index[a] - 1, 0);
      upper[a] = std::min(index[a] + 1, n[a] - 1);
      const double length = std::hypot(this->axes[a][0], this->axes[a][1], this->axes[a][2]);
      const double d =
        this->at(upper[0], upper[1], upper[2], c) - this->at(lower[0], lower[1], lower[2], c);
      sum += length > 0. ? .25 * d * d / (length * length) : 0.;
      spacings += length;
    }
    return std::sqrt(sum) * spacings / 3.;
  }

  double at(int i, int j, int k, int c) const
  {
    const int* n = this->scalars.dimensions;
    const vtkIdType p = (static_cast<vtkIdType>(k) * n[1] + j) * n[0] + i;
    return static_cast<double>(this->values[p * this->scalars.array->GetNumberOfComponents() + c]);
  }

  /** Interpolated, as it is drawn. */
  double valueAt(const Place& p, int c) const
  {
    double sum = 0.;
    for (int corner = 0; corner < 8; ++corner)
    {
      double weight = 1.;
      int index[3];
      for (int a = 0; a < 3; ++a)
      {
        const bool aside = (corner >> a & 1) != 0;
        weight *= p.side[a] == 0 ? (aside ? 0. : 1.) : aside ? .25 : .75;
        index[a] = aside
          ? std::min(std::max(p.index[a] + p.side[a], 0), this->scalars.dimensions[a] - 1)
          : p.index[a];
      }
      if (weight > 0.)
      {
        sum += weight * this->at(index[0], index[1], index[2], c);
      }
    }
    return sum;
  }

  /** Opacity of a component's value over its unit distance. */
  double opacity(const Place& p, int component, int function) const
  {
    const Classifier& f = this->classifier;
    double value = this->valueAt(p, component);
    if (std::isnan(value))
    {
      return 0.;
    }
    if (f.ofRange > 0.)
    {
      const double* range = f.ranges[component];
      value = range[0] + (range[1] - range[0]) * f.ofRange * value;
    }
    // Dependent components have their gradient from the first.
    return f.opacityOf(function, value,
      f.byGradient[function] ? this->gradient(p, f.independent ? component : 0) : 0.);
  }

  /** An isosurface's depth over the length on which it passes between neighbours. */
  double surfaces(const Place& p) const
  {
    const double here = this->at(p.index[0], p.index[1], p.index[2], 0);
    double sigma = 0.;
    for (const auto& isosurface : this->classifier.isosurfaces)
    {
      double squares = 0.;
      for (int a = 0; a < 3; ++a)
      {
        double crossings = 0.;
        for (const int side : { -1, 1 })
        {
          int at[3] = { p.index[0], p.index[1], p.index[2] };
          at[a] += side;
          if (at[a] < 0 || at[a] >= this->scalars.dimensions[a])
          {
            continue;
          }
          const double there = this->at(at[0], at[1], at[2], 0);
          if ((here < isosurface[0]) != (there < isosurface[0]) && std::isfinite(here + there))
          {
            // Most of it belongs to the nearer of the two points.
            crossings += 1. - (isosurface[0] - here) / (there - here);
          }
        }
        squares +=
          crossings * crossings / (this->classifier.spacing[a] * this->classifier.spacing[a]);
      }
      sigma += isosurface[1] * std::sqrt(squares);
    }
    return sigma;
  }

  double sigma(const Place& p) const
  {
    const Classifier& f = this->classifier;
    if (!f.labels && this->label(p) <= 0.)
    {
      return 0.;
    }
    if (!f.isosurfaces.empty())
    {
      return this->surfaces(p);
    }
    if (!f.sigma.entries.empty())
    {
      const double value = this->valueAt(p, 0);
      return std::isnan(value) ? 0. : f.sigma(value);
    }
    if (f.independent)
    {
      // As VTK composites them, over a short distance.
      double total = 0.;
      double squares = 0.;
      for (int c = 0; c < f.components; ++c)
      {
        const double s = extinctionOf(this->opacity(p, c, c), f.unitDistance[c]);
        total += s * f.weights[c];
        squares += f.weights[c] > 0. ? s * s : 0.;
      }
      return total > 0. ? squares / total : 0.;
    }
    double alpha = this->opacity(p, f.opacityComponent, 0);
    if (f.labels)
    {
      const auto own = f.labelOpacity.find(static_cast<int>(this->label(p)));
      alpha +=
        own != f.labelOpacity.end() ? f.blend * (own->second(this->valueAt(p, 0)) - alpha) : 0.;
    }
    return extinctionOf(alpha, f.unitDistance[0]);
  }

  /** Of red, green and blue. */
  void shares(const Place& p, double result[3]) const
  {
    const Classifier& f = this->classifier;
    double rgb[3] = { 0., 0., 0. };
    double total = 0.;
    for (int c = 0; c < (f.independent ? f.components : 1); ++c)
    {
      // As VTK mixes them, by opacity and weight.
      const double weight = f.independent ? f.weights[c] * this->opacity(p, c, c) : 1.;
      const double value = this->valueAt(p, c);
      for (int channel = 0; channel < 3; ++channel)
      {
        const double own = f.components == 4 && !f.independent
          ? this->valueAt(p, channel) * (f.ofRange > 0. ? f.ofRange : 1.)
          : f.transfer2D[c]
          ? static_cast<double>(f.lookUp2D(c, value, this->gradient(p, c))[channel])
          : f.color[c](value)[channel];
        rgb[channel] += weight * own;
      }
      total += weight;
    }
    const auto label =
      f.labels ? f.labelColor.find(static_cast<int>(this->label(p))) : f.labelColor.end();
    if (label != f.labelColor.end())
    {
      double own[3];
      label->second->GetColor(this->valueAt(p, 0), own);
      for (int channel = 0; channel < 3; ++channel)
      {
        rgb[channel] += f.blend * (total * own[channel] - rgb[channel]);
      }
    }
    for (double& channel : rgb)
    {
      channel = total > 0. ? channel / total : 0.;
    }
    vtkVisibilityFactorFilter::GetTransportColor(rgb, result);
  }

  double label(const Place& p) const
  {
    const int* n = this->scalars.dimensions;
    return this->classifier.mask
      ? this->classifier.mask->GetComponent(
          (static_cast<vtkIdType>(p.index[2]) * n[1] + p.index[1]) * n[0] + p.index[0], 0)
      : 1.;
  }

  /** Adds what is at a place. */
  void add(const Place& p, double sum[3]) const
  {
    if (this->cuts.any())
    {
      double index[3];
      for (int a = 0; a < 3; ++a)
      {
        index[a] = p.index[a] + .25 * p.side[a] + this->scalars.first[a];
      }
      if (!this->cuts.keeps(index))
      {
        return;
      }
    }
    const double s = this->sigma(p);
    if (s > 0. && this->classifier.colored)
    {
      double share[3];
      this->shares(p, share);
      for (int c = 0; c < 3; ++c)
      {
        sum[c] += s * share[c];
      }
    }
    else
    {
      sum[0] += s;
    }
  }

  void operator()(vtkIdType begin, vtkIdType end) const
  {
    const int* n = this->scalars.dimensions;
    const int channels = this->classifier.colored ? 3 : 1;
    // Two places along an axis, of two values or between the neighbours of one.
    int places[3];
    double perBlock = 1.;
    for (int a = 0; a < 3; ++a)
    {
      places[a] = this->steps[a] == 1 && n[a] > 1 && this->interpolates ? 2 : this->steps[a];
      perBlock /= places[a];
    }
    for (vtkIdType row = begin; row < end; ++row)
    {
      const int block[3] = { 0, static_cast<int>(row % this->coarse[1]),
        static_cast<int>(row / this->coarse[1]) };
      for (int ci = 0; ci < this->coarse[0]; ++ci)
      {
        double sum[3] = { 0., 0., 0. };
        const vtkIdType places3 = static_cast<vtkIdType>(places[0]) * places[1] * places[2];
        for (vtkIdType place = 0; place < places3; ++place)
        {
          const int offset[3] = { static_cast<int>(place % places[0]),
            static_cast<int>(place / places[0] % places[1]),
            static_cast<int>(place / places[0] / places[1]) };
          Place p;
          bool inside = true;
          for (int a = 0; a < 3; ++a)
          {
            const bool between = this->steps[a] == 1 && places[a] == 2;
            // The first block of each axis is the margin's, before the volume; the last ones may
            // reach beyond it. There is nothing.
            const int first = ((a == 0 ? ci : block[a]) - 1) * this->steps[a];
            p.index[a] = first + (between ? 0 : offset[a]);
            p.side[a] = between ? 2 * offset[a] - 1 : 0;
            inside = inside && p.index[a] >= 0 && p.index[a] < n[a];
          }
          if (inside)
          {
            this->add(p, sum);
          }
        }
        for (int c = 0; c < channels; ++c)
        {
          this->sigma_t[(row * this->coarse[0] + ci) * channels + c] =
            static_cast<float>(sum[c] * perBlock);
        }
      }
    }
  }
};

template <typename T>
void compute(const T* values, const Scalars& scalars, const Classifier& classifier,
  const Cuts& cuts, bool interpolates, const int steps[3], const int coarse[3],
  const double axes[3][3], float* sigma_t)
{
  Worker<T> worker{ values, scalars, classifier, cuts, interpolates,
    { steps[0], steps[1], steps[2] }, { coarse[0], coarse[1], coarse[2] }, sigma_t, {} };
  std::copy(&axes[0][0], &axes[0][0] + 9, &worker.axes[0][0]);
  vtkSMPTools::For(0, static_cast<vtkIdType>(coarse[1]) * coarse[2], worker);
}
} // namespace

//------------------------------------------------------------------------------
void VolumeExtinctionSteps(const int n[3], const double spacing[3], int resolution, int steps[3])
{
  std::fill(steps, steps + 3, 1);
  const double most = 1.25 * resolution * resolution * resolution;
  const auto blocks = [&](int a) { return (n[a] + steps[a] - 1) / steps[a]; };
  while (1. * blocks(0) * blocks(1) * blocks(2) > most)
  {
    // The closest next.
    int axis = -1;
    for (int a = 0; a < 3; ++a)
    {
      const bool closer = axis < 0 ||
        std::abs(spacing[a]) * steps[a] < std::abs(spacing[axis]) * steps[axis] * (1. - 1e-9);
      axis = blocks(a) > 1 && closer ? a : axis;
    }
    ++steps[axis];
  }
}

//------------------------------------------------------------------------------
std::vector<double> VolumeExtinctionKey(
  vtkGPUVolumeRayCastMapper* mapper, vtkVolume* volume, int resolution, bool colored)
{
  std::vector<double> key;
  const auto object = [&](vtkObject* o)
  {
    key.push_back(static_cast<double>(reinterpret_cast<std::uintptr_t>(o)));
    key.push_back(o ? static_cast<double>(o->GetMTime()) : 0.);
  };
  vtkVolumeProperty* property = volume->GetProperty();
  Scalars scalars;
  if (!findScalars(mapper, scalars))
  {
    return key;
  }
  object(scalars.image);
  object(scalars.array);
  key.push_back(resolution);
  key.push_back(colored);
  key.push_back(mapper->GetBlendMode() == vtkVolumeMapper::ISOSURFACE_BLEND);
  if (key.back() != 0.)
  {
    vtkContourValues* contours = property->GetIsoSurfaceValues();
    key.insert(
      key.end(), contours->GetValues(), contours->GetValues() + contours->GetNumberOfContours());
  }
  key.push_back(property->GetIndependentComponents());
  key.push_back(property->GetTransferFunctionMode());
  key.push_back(property->GetInterpolationType() != VTK_NEAREST_INTERPOLATION);
  const int components = std::min(scalars.array->GetNumberOfComponents(), 4);
  for (int c = 0; c < components; ++c)
  {
    key.push_back(property->GetComponentWeight(c));
    key.push_back(property->GetScalarOpacityUnitDistance(c));
    object(property->GetScalarOpacity(c));
    object(property->HasGradientOpacity(c) ? property->GetGradientOpacity(c) : nullptr);
    object(property->GetTransferFunction2D(c));
    if (colored)
    {
      object(property->GetColorChannels(c) == 3
          ? static_cast<vtkObject*>(property->GetRGBTransferFunction(c))
          : property->GetGrayTransferFunction(c));
    }
  }
  if (vtkImageData* mask = mapper->GetMaskInput())
  {
    object(mask);
    key.push_back(mapper->GetMaskType());
    key.push_back(mapper->GetMaskBlendFactor());
    if (vtkDataArray* labels = mask->GetPointData()->GetScalars())
    {
      const int highest = static_cast<int>(std::min(labels->GetRange()[1], 1024.));
      for (int label = 1; label <= highest; ++label)
      {
        object(property->GetLabelScalarOpacity(label));
        object(colored ? property->GetLabelColor(label) : nullptr);
      }
    }
  }
  const Cuts cuts = makeCuts(mapper, volume, scalars.image);
  key.push_back(cuts.cropping);
  if (cuts.cropping)
  {
    key.push_back(cuts.flags);
    key.insert(key.end(), cuts.planes, cuts.planes + 6);
  }
  for (const auto& h : cuts.halfSpaces)
  {
    key.insert(key.end(), h.begin(), h.end());
  }
  return key;
}

//------------------------------------------------------------------------------
std::string VolumeExtinction(vtkGPUVolumeRayCastMapper* mapper, vtkVolume* volume, int resolution,
  bool colored, vtkImageData* result)
{
  result->Initialize();
  Scalars scalars;
  if (!findScalars(mapper, scalars))
  {
    return "the volume has no image with scalars to compute visibility from";
  }
  if (!scalars.array->HasStandardMemoryLayout())
  {
    vtkNew<vtkFloatArray> copy;
    copy->DeepCopy(scalars.array);
    scalars.array = copy;
  }
  vtkVolumeProperty* property = volume->GetProperty();
  for (int c = 0; c < std::min(scalars.array->GetNumberOfComponents(), 4); ++c)
  {
    if (!(property->GetScalarOpacityUnitDistance(c) > 0.))
    {
      return "ScalarOpacityUnitDistance is " +
        std::to_string(property->GetScalarOpacityUnitDistance(c)) + ", expected > 0";
    }
  }
  const Classifier classifier = makeClassifier(mapper, property, scalars, colored);
  const Cuts cuts = makeCuts(mapper, volume, scalars.image);

  const int* n = scalars.dimensions;
  int steps[3];
  VolumeExtinctionSteps(n, scalars.image->GetSpacing(), resolution, steps);
  int coarse[3];
  double origin[3];
  double spacing[3];
  double axes[3][3];
  vtkMatrix4x4* indexToData = scalars.image->GetIndexToPhysicalMatrix();
  for (int a = 0; a < 3; ++a)
  {
    coarse[a] = (n[a] + steps[a] - 1) / steps[a] + 2;
    spacing[a] = scalars.image->GetSpacing()[a] * steps[a];
    origin[a] = indexToData->GetElement(a, 3);
    for (int b = 0; b < 3; ++b)
    {
      origin[a] +=
        indexToData->GetElement(a, b) * (scalars.first[b] + .5 * (steps[b] - 1) - steps[b]);
      axes[b][a] = indexToData->GetElement(a, b);
    }
  }
  vtkNew<vtkFloatArray> sigma_t;
  sigma_t->SetName("Extinction");
  sigma_t->SetNumberOfComponents(colored ? 3 : 1);
  const vtkIdType points = static_cast<vtkIdType>(coarse[0]) * coarse[1] * coarse[2];
  sigma_t->SetNumberOfTuples(points);
  switch (scalars.array->GetDataType())
  {
    vtkTemplateMacro(compute(static_cast<const VTK_TT*>(scalars.array->GetVoidPointer(0)), scalars,
      classifier, cuts, property->GetInterpolationType() != VTK_NEAREST_INTERPOLATION, steps,
      coarse, axes, sigma_t->GetPointer(0)));
    default:
      return "the volume's scalars are no numbers";
  }
  result->SetDimensions(coarse);
  result->SetOrigin(origin);
  result->SetSpacing(spacing);
  result->SetDirectionMatrix(scalars.image->GetDirectionMatrix());
  result->GetPointData()->SetScalars(sigma_t);
  return std::string();
}
