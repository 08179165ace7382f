// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Medium.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <vector>

namespace lighttransport
{
namespace
{
constexpr std::int64_t MaximumSamples = 1 << 20;
constexpr std::int64_t MinimumSamples = 64;
constexpr double NeighbourhoodSpacings = 20.;
constexpr double FlatFraction = 0.01;
constexpr std::int64_t ReadLength = 4096;
constexpr int MapSteps = 4;

/** Reorders the samples. */
double Quantile(std::vector<float>& samples, double fraction)
{
  const auto at = samples.begin() + static_cast<std::ptrdiff_t>(fraction * (samples.size() - 1));
  std::nth_element(samples.begin(), at, samples.end());
  return *at;
}

/** The rule on positive samples. */
double RobustScale(std::vector<float>& samples, double quantile)
{
  return std::sqrt(2.) * 1.4826 * Quantile(samples, quantile);
}

/** A stride that meets every row, column and slice in turn. */
std::int64_t SampleStride(const Grid& grid)
{
  std::int64_t stride = (grid.size() + MaximumSamples - 1) / MaximumSamples;
  while (stride > 1 &&
    (std::gcd(stride, std::int64_t(grid.dims[0])) > 1 ||
      std::gcd(stride, std::int64_t(grid.dims[1])) > 1))
  {
    ++stride;
  }
  return std::max<std::int64_t>(stride, 1);
}
} // namespace

//------------------------------------------------------------------------------
double ChooseGradientScale(
  const Grid& grid, const float* gradients, const std::array<int, 3>& point)
{
  // What varies, in the whole volume.
  std::vector<float> samples;
  const std::int64_t stride = SampleStride(grid);
  samples.reserve(static_cast<std::size_t>(grid.size() / stride + 1));
  for (std::int64_t i = 0; i < grid.size(); i += stride)
  {
    if (gradients[i] > 0.f)
    {
      samples.push_back(gradients[i]);
    }
  }
  if (samples.empty())
  {
    return 0.;
  }
  const double flat = FlatFraction * Quantile(samples, 0.999);

  if (point[0] >= 0)
  {
    std::array<int, 3> first;
    std::array<int, 3> last;
    const double h = grid.smallestSpacing();
    for (int a = 0; a < 3; ++a)
    {
      const double reach = std::min(NeighbourhoodSpacings * h / grid.spacing[a], 1e9);
      first[a] = static_cast<int>(std::max<double>(point[a] - std::floor(reach), 0.));
      last[a] = static_cast<int>(std::min<double>(point[a] + std::floor(reach), grid.dims[a] - 1));
    }
    std::vector<float> near;
    for (int k = first[2]; k <= last[2]; ++k)
    {
      for (int j = first[1]; j <= last[1]; ++j)
      {
        const float* row = gradients + grid.index(0, j, k);
        std::copy_if(row + first[0], row + last[0] + 1, std::back_inserter(near),
          [flat](float g) { return g > flat; });
      }
    }
    if (static_cast<std::int64_t>(near.size()) >= MinimumSamples)
    {
      return RobustScale(near, 0.5);
    }
  }
  samples.erase(
    std::remove_if(samples.begin(), samples.end(), [flat](float g) { return !(g > flat); }),
    samples.end());
  return samples.empty() ? 0. : RobustScale(samples, 0.25);
}

//------------------------------------------------------------------------------
MediumReport ComputeMedium(const Grid& grid, const ValueReader& signal, const ValueRange& range,
  const ValueReader& absorption, const MediumParameters& parameters, float* D, float* sigma_a,
  const ParallelFor& parallel, const ProgressFunction& progress)
{
  MediumReport report;
  const double mapFrom = parameters.useGradient ? 0.7 : 0.;

  // Stage 3: |grad S| in units of (range of S) / (smallest spacing), where it is
  // of the order of 1 whatever the units are. It stands in D; -1 marks walls.
  double inverseScale = 0.; // 1 / sigma in those units; 0: beta is 1
  if (parameters.useGradient)
  {
    Grid unitGrid = grid;
    const double h = grid.smallestSpacing();
    for (double& spacing : unitGrid.spacing)
    {
      spacing /= h;
    }
    const double spread = range.max > range.min ? range.max - range.min : 1.;
    const GradientMagnitude gradient(unitGrid, parameters.derivativeScale / h);
    const auto partly = [&](double fraction) { return !progress || progress(mapFrom * fraction); };
    if (!gradient.compute(signal, range.min, 1. / spread, D, parallel, partly))
    {
      report.cancelled = true;
      return report;
    }
    // Stage 4.
    report.gradientScale = parameters.gradientScale;
    double sigma = std::max(parameters.gradientScale / spread * h, 1e-30);
    if (parameters.gradientScale == 0.)
    {
      sigma = ChooseGradientScale(grid, D, parameters.scalePoint);
      report.gradientScale = sigma * spread / h;
    }
    inverseScale = sigma > 0. ? 1. / sigma : 0.;
  }

  // Stage 5: beta, D, sigma_a.
  const double ell = parameters.ell;
  const double inverseReach2 =
    parameters.reach > 0. ? 1. / parameters.reach / parameters.reach : 0.;
  const double albedoFactor =
    (1. - parameters.albedo) / (3. * (1. - parameters.albedo * parameters.anisotropy));
  std::atomic<std::int64_t> walls{ 0 };
  const auto map = [&](std::int64_t begin, std::int64_t end)
  {
    std::vector<double> beta(static_cast<std::size_t>(std::min(ReadLength, end - begin)));
    std::vector<double> given(parameters.absorption == AbsorptionRule::Function ? beta.size() : 0);
    std::int64_t myWalls = 0;
    for (std::int64_t i = begin; i < end; i += ReadLength)
    {
      const std::int64_t n = std::min(ReadLength, end - i);
      if (parameters.useGradient)
      {
        for (std::int64_t l = 0; l < n; ++l)
        {
          const double g = D[i + l];
          const double x = std::min(g * inverseScale, 1e6); // beyond, beta is 0 anyway
          beta[l] = g < 0.        ? std::nan("")
            : parameters.rational ? 1. / (1. + x * x)
                                  : std::exp(-std::min(x * x, 1e4));
        }
      }
      else
      {
        signal(i, n, beta.data());
      }
      if (!given.empty())
      {
        absorption(i, n, given.data());
      }
      for (std::int64_t l = 0; l < n; ++l)
      {
        if (std::isnan(beta[l]))
        {
          D[i + l] = 0.f;
          sigma_a[i + l] = static_cast<float>(1. / ell);
          ++myWalls;
          continue;
        }
        const double b =
          std::max(parameters.complement ? 1. - beta[l] : beta[l], parameters.betaFloor);
        const double d = b * ell;
        double absorbed = 0.;
        switch (parameters.absorption)
        {
          case AbsorptionRule::Complement:
            absorbed = (1. - b) / ell;
            break;
          case AbsorptionRule::Albedo:
            absorbed = albedoFactor / d;
            break;
          case AbsorptionRule::Function:
            absorbed = given[l];
            break;
        }
        D[i + l] = static_cast<float>(d);
        sigma_a[i + l] = static_cast<float>(absorbed + d * inverseReach2);
      }
    }
    walls += myWalls;
  };
  for (int step = 0; step < MapSteps; ++step)
  {
    if (progress && !progress(mapFrom + (1. - mapFrom) * step / MapSteps))
    {
      report.cancelled = true;
      return report;
    }
    const std::int64_t first = grid.size() * step / MapSteps;
    const std::int64_t last = grid.size() * (step + 1) / MapSteps;
    parallel(
      last - first, [&](std::int64_t begin, std::int64_t end) { map(first + begin, first + end); });
  }
  report.numberOfWalls = walls;
  report.cancelled = progress && !progress(1.);
  return report;
}
} // namespace lighttransport
