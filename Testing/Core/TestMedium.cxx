// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// Optical media from volumes: the formulas, and the gradient scale chosen from data.
#include "LightTransportTesting.h"
#include "ThreadedFor.h"

#include "Core/Medium.h"

#include <limits>
#include <random>

using namespace lighttransport;
using testing::Suite;

namespace
{
const double NaN = std::numeric_limits<double>::quiet_NaN();
const std::array<int, 3> Nowhere{ { -1, -1, -1 } };

ValueReader readerOf(const std::vector<double>& values)
{
  return [&values](std::int64_t begin, std::int64_t n, double* out)
  { std::copy_n(values.begin() + begin, n, out); };
}

void gradientScale(Suite& suite)
{
  // Evenly spread in (0, 1): the lowest 1 % is flat, so the median is .505 and the
  // lower quartile, which counts in a whole volume, .2575.
  const Grid grid{ { { 50, 50, 50 } }, { { 1., 1., 1. } } };
  std::vector<float> g(grid.size());
  for (std::size_t i = 0; i < g.size(); ++i)
  {
    g[i] = static_cast<float>((double((i * 7919) % g.size()) + 0.5) / double(g.size()));
  }
  const double expected = std::sqrt(2.) * 1.4826 * 0.2575;
  const double near = std::sqrt(2.) * 1.4826 * 0.505;
  LT_CHECK_CLOSE(suite, ChooseGradientScale(grid, g.data(), Nowhere), expected, 1e-3);

  // Flat regions and walls do not count, however many there are.
  std::vector<float> sparse(8 * g.size(), 0.f);
  for (std::size_t i = 0; i < g.size(); ++i)
  {
    sparse[8 * i] = g[i];
    sparse[8 * i + 1] = -1.f;
    sparse[8 * i + 2] = 1e-4f;
  }
  const Grid wide{ { { 400, 50, 50 } }, { { 1., 1., 1. } } };
  LT_CHECK_CLOSE(suite, ChooseGradientScale(wide, sparse.data(), Nowhere), expected, 5e-3);

  // It scales with the gradients.
  for (double factor : { 1. / 1048576., 1048576. })
  {
    std::vector<float> scaled = g;
    for (float& value : scaled)
    {
      value *= static_cast<float>(factor);
    }
    LT_CHECK_CLOSE(suite, ChooseGradientScale(grid, scaled.data(), Nowhere),
      factor * ChooseGradientScale(grid, g.data(), Nowhere), 1e-12);
  }

  // Near a point: two halves, one ten times as strong.
  std::vector<float> halves = g;
  for (std::int64_t i = grid.size() / 2; i < grid.size(); ++i)
  {
    halves[i] *= 0.1f;
  }
  const double strong = ChooseGradientScale(grid, halves.data(), { { 25, 25, 3 } });
  const double weak = ChooseGradientScale(grid, halves.data(), { { 25, 25, 47 } });
  LT_CHECK_CLOSE(suite, strong, near, 0.05);
  LT_CHECK_CLOSE(suite, weak, 0.1 * near, 0.1);
  // The neighbourhood is a length: with thick slices it holds fewer of them.
  const Grid thick{ { { 50, 50, 50 } }, { { 1., 1., 8. } } };
  LT_CHECK_CLOSE(suite, ChooseGradientScale(thick, halves.data(), { { 25, 25, 21 } }), near, 0.05);

  // Nothing near: the whole volume. Nothing at all: 0. All the same: their value.
  std::vector<float> corner(g.size(), 0.f);
  std::copy(g.begin(), g.begin() + 5000, corner.begin());
  LT_CHECK(suite,
    ChooseGradientScale(grid, corner.data(), { { 25, 25, 45 } }) ==
      ChooseGradientScale(grid, corner.data(), Nowhere));
  LT_CHECK(suite, ChooseGradientScale(grid, corner.data(), Nowhere) > 0.);
  LT_CHECK(
    suite, ChooseGradientScale(grid, std::vector<float>(g.size(), 0.f).data(), Nowhere) == 0.);
  LT_CHECK_CLOSE(suite,
    ChooseGradientScale(grid, std::vector<float>(g.size(), 3.f).data(), Nowhere),
    std::sqrt(2.) * 1.4826 * 3., 1e-6);
}

struct Medium
{
  std::vector<float> D;
  std::vector<float> sigma_a;
  MediumReport report;
};

Medium compute(const Grid& grid, const std::vector<double>& signal,
  const MediumParameters& parameters, const std::vector<double>& absorption = {},
  const ParallelFor& parallel = SerialFor)
{
  Medium medium;
  medium.D.resize(signal.size());
  medium.sigma_a.resize(signal.size());
  const ValueRange range = FindValueRange(grid.size(), readerOf(signal), parallel);
  medium.report = ComputeMedium(grid, readerOf(signal), range, readerOf(absorption), parameters,
    medium.D.data(), medium.sigma_a.data(), parallel, nullptr);
  return medium;
}

void formulas(Suite& suite)
{
  const Grid grid{ { { 5, 1, 1 } }, { { 2., 2., 2. } } };
  const std::vector<double> beta{ 0., 0.25, 0.75, 1., NaN };
  MediumParameters parameters;
  parameters.useGradient = false;
  parameters.ell = 4.;
  parameters.betaFloor = 1e-3;

  Medium medium = compute(grid, beta, parameters);
  const double D[4] = { 4e-3, 1., 3., 4. };
  const double complement[4] = { 0.999 / 4., 0.75 / 4., 0.25 / 4., 0. };
  for (int i = 0; i < 4; ++i)
  {
    LT_CHECK_CLOSE(suite, medium.D[i], D[i], 1e-6);
    LT_CHECK_CLOSE(suite, medium.sigma_a[i], complement[i], 1e-6);
  }
  // Walls.
  LT_CHECK(suite, medium.D[4] == 0.f && medium.sigma_a[4] == 0.25f);
  LT_CHECK(suite, medium.report.numberOfWalls == 1);

  parameters.absorption = AbsorptionRule::Albedo;
  for (double albedo : { 0., 0.9, 1. })
  {
    for (double g : { -0.5, 0., 0.75, 0.999999 })
    {
      parameters.albedo = albedo;
      parameters.anisotropy = g;
      medium = compute(grid, beta, parameters);
      for (int i = 0; i < 4; ++i)
      {
        // The definition: D = 1 / (3 (sigma_a + (1 - g) sigma_s)), with sigma_s from the albedo.
        const double sigma_a = medium.sigma_a[i];
        if (albedo == 1.)
        {
          LT_CHECK(suite, sigma_a == 0.);
        }
        else
        {
          const double sigma_s = albedo / (1. - albedo) * sigma_a;
          LT_CHECK_CLOSE(
            suite, 1. / (3. * (sigma_a + (1. - g) * sigma_s)), double(medium.D[i]), 1e-5);
        }
      }
    }
  }

  parameters.absorption = AbsorptionRule::Function;
  const std::vector<double> absorption{ 0., 1., 2., 3., 4. };
  medium = compute(grid, beta, parameters, absorption);
  LT_CHECK(suite, medium.sigma_a[0] == 0.f && medium.sigma_a[3] == 3.f);
  LT_CHECK(suite, medium.sigma_a[4] == 0.25f);

  // The reach, on top: D/L^2.
  parameters.reach = 10.;
  medium = compute(grid, beta, parameters, absorption);
  for (int i = 0; i < 4; ++i)
  {
    LT_CHECK_CLOSE(suite, medium.sigma_a[i], absorption[i] + D[i] / 100., 1e-6);
  }

  // The complement, before the floor.
  parameters.complement = true;
  medium = compute(grid, beta, parameters, absorption);
  LT_CHECK_CLOSE(suite, medium.D[0], 4., 1e-6);
  LT_CHECK_CLOSE(suite, medium.D[1], 3., 1e-6);
  LT_CHECK_CLOSE(suite, medium.D[3], 4e-3, 1e-6);
  LT_CHECK(suite, medium.D[4] == 0.f);
}

void gradients(Suite& suite)
{
  // A ramp of slope 5 with sigma = 10: beta = exp(-1/4) everywhere.
  const Grid grid{ { { 20, 9, 1 } }, { { 0.5, 2., 1e-9 } } };
  std::vector<double> ramp;
  for (int j = 0; j < 9; ++j)
  {
    for (int i = 0; i < 20; ++i)
    {
      ramp.push_back(-40. + 3. * (0.5 * i) + 4. * (2. * j));
    }
  }
  MediumParameters parameters;
  parameters.gradientScale = 10.;
  parameters.derivativeScale = 0.7;
  parameters.ell = 0.5;
  Medium medium = compute(grid, ramp, parameters);
  double worst = 0.;
  for (float d : medium.D)
  {
    worst = std::max(worst, std::abs(d - 0.5 * std::exp(-0.25)));
  }
  LT_CHECK_NEAR(suite, worst, 0., 1e-6);
  LT_CHECK(suite, medium.report.gradientScale == 10.);
  // A scale far below it closes everything, to the floor.
  parameters.gradientScale = 1e-300;
  medium = compute(grid, ramp, parameters);
  LT_CHECK(suite, *std::max_element(medium.D.begin(), medium.D.end()) == 0.5e-6f);

  // A constant lets everything pass, whatever scale is asked for.
  for (double scale : { 0., 1e-300, 1e300 })
  {
    parameters.gradientScale = scale;
    medium = compute(grid, std::vector<double>(180, 17.), parameters);
    LT_CHECK(suite, *std::min_element(medium.D.begin(), medium.D.end()) == 0.5f);
    LT_CHECK(suite, *std::max_element(medium.sigma_a.begin(), medium.sigma_a.end()) == 0.f);
    LT_CHECK(suite, medium.report.gradientScale == scale);
  }
  medium = compute(grid, std::vector<double>(180, NaN), parameters);
  LT_CHECK(suite, medium.report.numberOfWalls == 180);
}

/** Two noisy halves, apart by far more than the noise. */
std::vector<double> noisyHalves(const Grid& grid, double noise, double step)
{
  std::mt19937 random(11);
  std::normal_distribution<double> normal(0., noise);
  std::vector<double> values(grid.size());
  for (std::int64_t i = 0; i < grid.size(); ++i)
  {
    values[i] = normal(random) + (i % grid.dims[0] < grid.dims[0] / 2 ? 0. : step);
  }
  return values;
}

void chosen(Suite& suite)
{
  const Grid grid{ { { 40, 40, 40 } }, { { 1., 1., 1. } } };
  const std::vector<double> values = noisyHalves(grid, 2., 100.);
  MediumParameters parameters;
  const Medium medium = compute(grid, values, parameters);
  const double sigma = medium.report.gradientScale;
  std::cout << "chosen sigma " << sigma << " for noise 2, step 100\n";
  // Away from the step light passes; at the step it does not.
  double inside = 0.;
  double across = 0.;
  for (int k = 5; k < 35; ++k)
  {
    for (int j = 5; j < 35; ++j)
    {
      inside += medium.D[grid.index(10, j, k)] / 900.;
      across = std::max<double>(across, medium.D[grid.index(19, j, k)]);
    }
  }
  LT_CHECK(suite, inside > 0.5);
  LT_CHECK(suite, across < 1e-5);

  // Other units of the scalar or of length: the same medium.
  for (double factor : { 1e-6, 1e6 })
  {
    std::vector<double> scaled = values;
    for (double& value : scaled)
    {
      value = factor * value + 3. * factor;
    }
    const Medium other = compute(grid, scaled, parameters);
    LT_CHECK_CLOSE(suite, other.report.gradientScale, factor * sigma, 1e-5);
    double difference = 0.;
    for (std::size_t i = 0; i < other.D.size(); ++i)
    {
      difference = std::max<double>(difference, std::abs(other.D[i] - medium.D[i]));
    }
    LT_CHECK_NEAR(suite, difference, 0., 1e-5);
  }
  Grid fine = grid;
  fine.spacing = { { 1e-6, 1e-6, 1e-6 } };
  MediumParameters fineParameters = parameters;
  fineParameters.ell = fineParameters.derivativeScale = 1e-6;
  const Medium other = compute(fine, values, fineParameters);
  LT_CHECK_CLOSE(suite, other.report.gradientScale, 1e6 * sigma, 1e-6);

  // Threads change nothing.
  const Medium threaded = compute(grid, values, parameters, {}, testing::ThreadedFor(3));
  LT_CHECK(suite, threaded.D == medium.D && threaded.sigma_a == medium.sigma_a);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  gradientScale(suite);
  formulas(suite);
  gradients(suite);
  chosen(suite);
  return suite.result();
}
