// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Presets.h"

#include "vtkDataArray.h"
#include "vtkPointData.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lightvolume
{
namespace
{
constexpr int Bins = 1024;

bool IsNoData(const Volume& volume, double value)
{
  return !std::isfinite(value) ||
    std::find(volume.NoData.begin(), volume.NoData.end(), value) != volume.NoData.end();
}

// The threshold that separates two classes best (N. Otsu, IEEE Trans. SMC 9, 1979).
double Otsu(const std::vector<double>& histogram, double minimum, double maximum)
{
  double total = 0.;
  double sum = 0.;
  for (std::size_t b = 0; b < histogram.size(); ++b)
  {
    total += histogram[b];
    sum += histogram[b] * static_cast<double>(b);
  }
  double below = 0.;
  double belowSum = 0.;
  double best = -1.;
  double at = 0.;
  for (std::size_t b = 0; b + 1 < histogram.size(); ++b)
  {
    below += histogram[b];
    belowSum += histogram[b] * static_cast<double>(b);
    if (below <= 0. || below >= total)
    {
      continue;
    }
    const double difference = belowSum / below - (sum - belowSum) / (total - below);
    const double variance = below * (total - below) * difference * difference;
    if (variance > best)
    {
      best = variance;
      at = static_cast<double>(b) + 1.;
    }
  }
  return minimum + (maximum - minimum) * at / static_cast<double>(histogram.size());
}

void Color(vtkColorTransferFunction* f, double value, unsigned int rgb)
{
  f->AddRGBPoint(
    value, ((rgb >> 16) & 255U) / 255., ((rgb >> 8) & 255U) / 255., (rgb & 255U) / 255.);
}
} // namespace

double Statistics::Quantile(double fraction, double above) const
{
  const double width = (this->Maximum - this->Minimum) / Bins;
  if (!(width > 0.))
  {
    return this->Minimum;
  }
  const int first = std::clamp(static_cast<int>((above - this->Minimum) / width), 0, Bins - 1);
  double total = 0.;
  for (int b = first; b < Bins; ++b)
  {
    total += this->Histogram[b];
  }
  double sum = 0.;
  for (int b = first; b < Bins; ++b)
  {
    sum += this->Histogram[b];
    if (sum >= fraction * total)
    {
      return this->Minimum + (b + .5) * width;
    }
  }
  return this->Maximum;
}

Statistics Measure(const Volume& volume)
{
  vtkDataArray* scalars = volume.Image->GetPointData()->GetScalars();
  const vtkIdType n = scalars->GetNumberOfTuples();
  Statistics s;
  s.Minimum = std::numeric_limits<double>::infinity();
  s.Maximum = -s.Minimum;
  vtkIdType nothing = 0;
  for (vtkIdType i = 0; i < n; ++i)
  {
    const double v = scalars->GetComponent(i, 0);
    if (IsNoData(volume, v))
    {
      ++nothing;
      continue;
    }
    s.Minimum = std::min(s.Minimum, v);
    s.Maximum = std::max(s.Maximum, v);
  }
  if (nothing == n)
  {
    throw Error("the volume holds no data: every value is NaN or declared no data (--null)");
  }
  s.NoDataFraction = static_cast<double>(nothing) / static_cast<double>(n);
  s.Histogram.assign(Bins, 0.);
  const double scale = s.Maximum > s.Minimum ? Bins / (s.Maximum - s.Minimum) : 0.;
  for (vtkIdType i = 0; i < n; ++i)
  {
    const double v = scalars->GetComponent(i, 0);
    if (!IsNoData(volume, v))
    {
      s.Histogram[std::min(Bins - 1, static_cast<int>((v - s.Minimum) * scale))] += 1.;
    }
  }
  s.Threshold = Otsu(s.Histogram, s.Minimum, s.Maximum);
  double above = 0.;
  for (int b = 0; b < Bins; ++b)
  {
    above +=
      s.Minimum + (b + .5) * (s.Maximum - s.Minimum) / Bins > s.Threshold ? s.Histogram[b] : 0.;
  }
  s.AboveThreshold = above / static_cast<double>(n - nothing);
  return s;
}

Look ChooseLook(const Volume& volume, const Statistics& s, const Options& options)
{
  Look look;
  look.Color = vtkSmartPointer<vtkColorTransferFunction>::New();
  look.Opacity = vtkSmartPointer<vtkPiecewiseFunction>::New();
  const double range = s.Maximum > s.Minimum ? s.Maximum - s.Minimum : 1.;
  const bool signedValues = s.IsSigned();

  look.Preset = options.Preset;
  if (look.Preset == "auto")
  {
    if (volume.Format == "SEG-Y")
    {
      look.Preset = "seismic";
      look.Why = "SEG-Y";
    }
    else if (s.Minimum <= -500. && s.Minimum >= -4096. && s.Maximum > 200.)
    {
      look.Preset = "ct";
      look.Why = "values from " + FormatNumber(s.Minimum) + " look like Hounsfield units";
    }
    else if (signedValues)
    {
      look.Preset = "seismic";
      look.Why = "values of either sign";
    }
    else if (s.AboveThreshold < .25)
    {
      look.Preset = "ct";
      look.Why = "most of the volume is empty";
    }
    else
    {
      look.Preset = "mr";
      look.Why = "no sign of CT or of seismic data";
    }
  }

  // How far light carries where nothing stops it.
  double widths[3];
  double mean = 0.;
  int axes = 0;
  volume.Image->GetSpacing(widths);
  for (int a = 0; a < 3; ++a)
  {
    if (volume.Dimensions[a] > 1)
    {
      mean += widths[a] * volume.Dimensions[a];
      ++axes;
    }
  }
  look.Reach = axes > 0 ? mean / axes / 6. : 0.;

  if (look.Preset == "seismic" && signedValues)
  {
    // Amplitudes: blue, grey, red around zero, opaque where strong.
    const double top =
      std::max(std::abs(s.Quantile(.995, s.Minimum)), std::abs(s.Quantile(.005, s.Minimum)));
    Color(look.Color, -top, 0x2166ac);
    Color(look.Color, -.5 * top, 0x67a9cf);
    Color(look.Color, 0., 0xd9d9d9);
    Color(look.Color, .5 * top, 0xef8a62);
    Color(look.Color, top, 0xb2182b);
    look.Opacity->AddPoint(-top, .6);
    look.Opacity->AddPoint(-.5 * top, .06);
    look.Opacity->AddPoint(-.2 * top, 0.);
    look.Opacity->AddPoint(.2 * top, 0.);
    look.Opacity->AddPoint(.5 * top, .06);
    look.Opacity->AddPoint(top, .6);
    look.Shade = false;
    look.TissueOpacity = .25;
    // Along the positive reflectors.
    look.Mapping = "transfer";
    look.Passage = vtkSmartPointer<vtkPiecewiseFunction>::New();
    look.Passage->AddPoint(.2 * top, 0.);
    look.Passage->AddPoint(.45 * top, 1.);
  }
  else if (look.Preset == "seismic")
  {
    const double lo = s.Quantile(.01, s.Minimum);
    const double hi = std::max(s.Quantile(.99, s.Minimum), lo + 1e-6 * range);
    const unsigned int colors[5] = { 0x313695, 0x74add1, 0xd9d9c0, 0xf46d43, 0xa50026 };
    for (int i = 0; i < 5; ++i)
    {
      Color(look.Color, lo + (hi - lo) * i / 4., colors[i]);
    }
    look.Opacity->AddPoint(lo, .004);
    look.Opacity->AddPoint(hi, .02);
    look.GradientOpacity = vtkSmartPointer<vtkPiecewiseFunction>::New();
    look.GradientOpacity->AddPoint(0., .5);
    look.GradientOpacity->AddPoint(.04 * range, 3.);
    look.Shade = false;
    look.GradientScaleFactor = .55;
    look.Absorption = "albedo";
  }
  else if (look.Preset == "ct")
  {
    const double skin = s.Threshold;
    const double tissue = s.Quantile(.5, s.Threshold);
    const double bone = std::max(s.Quantile(.97, s.Threshold), tissue + .05 * range);
    Color(look.Color, s.Minimum, 0x000000);
    Color(look.Color, skin, 0x6e4a3a);
    Color(look.Color, tissue, 0xa8705a);
    Color(look.Color, .5 * (tissue + bone), 0xd9b48c);
    Color(look.Color, bone, 0xf2ead8);
    look.Opacity->AddPoint(skin - .02 * range, 0.);
    look.Opacity->AddPoint(skin + .02 * range, .02);
    look.Opacity->AddPoint(tissue, .03);
    look.Opacity->AddPoint(.7 * bone + .3 * tissue, .12);
    look.Opacity->AddPoint(bone, .45);
    look.GradientOpacity = vtkSmartPointer<vtkPiecewiseFunction>::New();
    look.GradientOpacity->AddPoint(0., .15);
    look.GradientOpacity->AddPoint(.08 * range, 1.);
    look.TissueOpacity = .6;
    look.GradientScaleFactor = .55;
    look.Absorption = "albedo";
  }
  else
  {
    // A solid with its folds, under a veil of skin: the brightest, fat, is hardly seen.
    const auto q = [&s](double fraction) { return s.Quantile(fraction, s.Threshold); };
    Color(look.Color, s.Minimum, 0x000000);
    Color(look.Color, .8 * s.Threshold + .2 * s.Minimum, 0x3c4c5c);
    Color(look.Color, q(.35), 0x8797a6);
    Color(look.Color, q(.78), 0xb4bcc2);
    Color(look.Color, q(.96), 0xe8e4da);
    look.Opacity->AddPoint(q(.07), 0.);
    look.Opacity->AddPoint(q(.38), .05);
    look.Opacity->AddPoint(q(.75), .15);
    look.Opacity->AddPoint(q(.90), .15);
    look.Opacity->AddPoint(std::max(q(.965), q(.90) + .02 * range), .02);
    look.Opacity->AddPoint(s.Maximum + .02 * range, 0.);
    look.TissueOpacity = .15;
    look.GradientScaleFactor = .55;
    look.Absorption = "albedo";
  }

  if (!options.TransferFunction.empty())
  {
    look.Opacity->RemoveAllPoints();
    look.GradientOpacity = nullptr;
    bool colors = false;
    for (const CurvePoint& p : options.TransferFunction)
    {
      look.Opacity->AddPoint(p.Value, p.Number);
      colors = colors || p.HasColor;
    }
    if (colors)
    {
      look.Color->RemoveAllPoints();
      for (const CurvePoint& p : options.TransferFunction)
      {
        if (p.HasColor)
        {
          look.Color->AddRGBPoint(p.Value, p.Color[0], p.Color[1], p.Color[2]);
        }
      }
    }
  }
  if (!options.Mapping.empty())
  {
    look.Mapping = options.Mapping;
  }
  if (options.GradientScaleFactor >= 0.)
  {
    look.GradientScaleFactor = options.GradientScaleFactor;
  }
  if (!options.Absorption.empty())
  {
    look.Absorption = options.Absorption;
  }
  if (options.Albedo >= 0.)
  {
    look.Albedo = options.Albedo;
  }
  if (options.Reach >= 0.)
  {
    look.Reach = options.Reach;
  }
  if (options.LightOpacity >= 0.)
  {
    look.LightOpacity = options.LightOpacity;
  }
  if (options.TissueOpacity >= 0.)
  {
    look.TissueOpacity = options.TissueOpacity;
  }
  return look;
}

std::array<double, 3> DefaultSeed(const Volume& volume, const Statistics& s, std::string& how)
{
  // 1. Block means on a grid of at most 96 points along an axis.
  const auto& dims = volume.Dimensions;
  int step[3];
  int size[3];
  for (int a = 0; a < 3; ++a)
  {
    step[a] = std::max(1, (dims[a] + 95) / 96);
    size[a] = std::max(1, dims[a] / step[a]);
  }
  vtkDataArray* scalars = volume.Image->GetPointData()->GetScalars();
  const auto at = [&size](int i, int j, int k)
  {
    return static_cast<std::size_t>(i) +
      static_cast<std::size_t>(size[0]) * (j + static_cast<std::size_t>(size[1]) * k);
  };
  const std::size_t n = at(0, 0, size[2]);
  std::vector<double> mean(n, std::numeric_limits<double>::quiet_NaN());
  for (int k = 0; k < size[2]; ++k)
  {
    for (int j = 0; j < size[1]; ++j)
    {
      for (int i = 0; i < size[0]; ++i)
      {
        double sum = 0.;
        int count = 0;
        for (int c = 0; c < step[2]; ++c)
        {
          for (int b = 0; b < step[1]; ++b)
          {
            for (int a = 0; a < step[0]; ++a)
            {
              const vtkIdType id = i * step[0] + a +
                static_cast<vtkIdType>(dims[0]) *
                  (j * step[1] + b + static_cast<vtkIdType>(dims[1]) * (k * step[2] + c));
              const double v = scalars->GetComponent(id, 0);
              if (!IsNoData(volume, v))
              {
                sum += v;
                ++count;
              }
            }
          }
        }
        if (count > 0)
        {
          mean[at(i, j, k)] = sum / count;
        }
      }
    }
  }
  // Signed: the strongest that is not at the border, the nearer the middle the better.
  if (s.IsSigned())
  {
    how = "the strongest positive value near the middle";
    std::array<double, 3> strongest = { { (dims[0] - 1) / 2., (dims[1] - 1) / 2.,
      (dims[2] - 1) / 2. } };
    double best = 0.;
    for (int k = 0; k < size[2]; ++k)
    {
      for (int j = 0; j < size[1]; ++j)
      {
        for (int i = 0; i < size[0]; ++i)
        {
          const int position[3] = { i, j, k };
          double near = 1.;
          for (int a = 0; a < 3; ++a)
          {
            near -= std::pow((position[a] + .5) / size[a] * 2. - 1., 2) / 3.;
          }
          const double score = near * mean[at(i, j, k)];
          if (score > best)
          {
            best = score;
            for (int a = 0; a < 3; ++a)
            {
              strongest[a] = position[a] * step[a] + (step[a] - 1) / 2.;
            }
          }
        }
      }
    }
    return strongest;
  }
  how = "the middle of the widest even region";
  // 2. Edges: a difference to a neighbour above a tenth of the range of what is not air, which
  // is below the threshold.
  const double range = s.Quantile(.98, s.Threshold) - s.Threshold;
  const double edge = .12 * (range > 0. ? range : 1.);
  constexpr float far = 1e6F;
  std::vector<float> distance(n, far);
  for (int k = 0; k < size[2]; ++k)
  {
    for (int j = 0; j < size[1]; ++j)
    {
      for (int i = 0; i < size[0]; ++i)
      {
        const double v = mean[at(i, j, k)];
        bool blocked = !std::isfinite(v) || v < s.Threshold;
        const int position[3] = { i, j, k };
        for (int a = 0; a < 3 && !blocked; ++a)
        {
          if (size[a] < 3)
          {
            continue; // a thin axis has no inside
          }
          for (int d = -1; d <= 1; d += 2)
          {
            int q[3] = { i, j, k };
            q[a] = position[a] + d;
            if (q[a] < 0 || q[a] >= size[a])
            {
              blocked = true; // the border of the volume
              continue;
            }
            blocked = blocked || !(std::abs(mean[at(q[0], q[1], q[2])] - v) < edge);
          }
        }
        distance[at(i, j, k)] = blocked ? 0.F : far;
      }
    }
  }
  // 3. City-block distance to an edge in lengths, in two sweeps.
  double spacing[3];
  volume.Image->GetSpacing(spacing);
  float h[3];
  for (int a = 0; a < 3; ++a)
  {
    h[a] = static_cast<float>(spacing[a] * step[a]);
  }
  const auto relax = [&](int i, int j, int k, int d)
  {
    float& here = distance[at(i, j, k)];
    const int position[3] = { i, j, k };
    for (int a = 0; a < 3; ++a)
    {
      int q[3] = { i, j, k };
      q[a] = position[a] + d;
      if (q[a] >= 0 && q[a] < size[a])
      {
        here = std::min(here, distance[at(q[0], q[1], q[2])] + h[a]);
      }
    }
  };
  for (int k = 0; k < size[2]; ++k)
  {
    for (int j = 0; j < size[1]; ++j)
    {
      for (int i = 0; i < size[0]; ++i)
      {
        relax(i, j, k, -1);
      }
    }
  }
  for (int k = size[2] - 1; k >= 0; --k)
  {
    for (int j = size[1] - 1; j >= 0; --j)
    {
      for (int i = size[0] - 1; i >= 0; --i)
      {
        relax(i, j, k, 1);
      }
    }
  }
  // 4. The farthest; of equals the one nearest to the middle. Where all is edges, the middle, or
  // the valid voxel nearest to it.
  std::array<double, 3> best = { { (dims[0] - 1) / 2., (dims[1] - 1) / 2., (dims[2] - 1) / 2. } };
  float widest = 0.F;
  double nearest = std::numeric_limits<double>::infinity();
  const bool edgesOnly =
    std::none_of(distance.begin(), distance.end(), [](float d) { return d > 0.F && d < far; });
  for (int k = 0; k < size[2]; ++k)
  {
    for (int j = 0; j < size[1]; ++j)
    {
      for (int i = 0; i < size[0]; ++i)
      {
        const float d = distance[at(i, j, k)];
        const int position[3] = { i, j, k };
        double off = 0.;
        for (int a = 0; a < 3; ++a)
        {
          const double x = (position[a] - (size[a] - 1) / 2.) * h[a];
          off += x * x;
        }
        const bool candidate = edgesOnly ? std::isfinite(mean[at(i, j, k)]) : d < far;
        const bool better =
          edgesOnly ? off < nearest : d > widest || (d == widest && off < nearest);
        if (candidate && better)
        {
          widest = d;
          nearest = off;
          for (int a = 0; a < 3; ++a)
          {
            best[a] = position[a] * step[a] + (step[a] - 1) / 2.;
          }
        }
      }
    }
  }
  return best;
}

} // namespace lightvolume
