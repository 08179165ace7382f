// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// Gradients by normalized convolution: closed forms, holes, thin grids.
#include "LightTransportTesting.h"
#include "ThreadedFor.h"

#include "Core/Gradient.h"

#include <limits>
#include <random>

using namespace lighttransport;
using testing::Suite;

namespace
{
const double NaN = std::numeric_limits<double>::quiet_NaN();

using Values = std::vector<double>;

ValueReader readerOf(const Values& values)
{
  return [&values](std::int64_t begin, std::int64_t n, double* out)
  { std::copy_n(values.begin() + begin, n, out); };
}

template <class F>
Values sample(const Grid& grid, const F& f)
{
  Values values;
  for (int k = 0; k < grid.dims[2]; ++k)
  {
    for (int j = 0; j < grid.dims[1]; ++j)
    {
      for (int i = 0; i < grid.dims[0]; ++i)
      {
        values.push_back(f(i * grid.spacing[0], j * grid.spacing[1], k * grid.spacing[2]));
      }
    }
  }
  return values;
}

std::vector<float> gradient(const Grid& grid, const Values& values, double sigma,
  const ParallelFor& parallel = SerialFor, double reference = 0., double factor = 1.)
{
  std::vector<float> magnitude(values.size(), -2.f);
  GradientMagnitude(grid, sigma)
    .compute(readerOf(values), reference, factor, magnitude.data(), parallel, nullptr);
  return magnitude;
}

double worst(const std::vector<float>& got, double expected)
{
  double error = 0.;
  for (float g : got)
  {
    error = g < 0.f ? error : std::max(error, std::abs(g - expected));
  }
  return error;
}

void linear(Suite& suite)
{
  const double g[3] = { 3., -2., 0.5 };
  const double length = std::sqrt(9. + 4. + 0.25);
  const auto ramp = [&](double x, double y, double z)
  { return 100. + g[0] * x + g[1] * y + g[2] * z; };
  for (const auto& dims :
    { std::array<int, 3>{ { 40, 37, 35 } }, { { 7, 5, 9 } }, { { 2, 3, 2 } }, { { 33, 2, 17 } } })
  {
    const Grid grid{ dims, { { 0.7, 1.1, 2.5 } } };
    const Values values = sample(grid, ramp);
    for (double sigma : { 0., 0.2, 0.7, 1.5, 4., 1e6 })
    {
      LT_CHECK_NEAR(suite, worst(gradient(grid, values, sigma), length), 0., 2e-6 * length);
      // The same wherever a reference is taken from, and with an offset of 1e9 in the data.
      LT_CHECK_NEAR(
        suite, worst(gradient(grid, values, sigma, SerialFor, 120.), length), 0., 2e-6 * length);
    }
  }
  // A thin axis has no gradient: what is left of the ramp counts.
  const Grid flat{ { { 12, 1, 9 } }, { { 0.7, 1.1, 2.5 } } };
  LT_CHECK_NEAR(suite, worst(gradient(flat, sample(flat, ramp), 1.), std::sqrt(9.25)), 0., 1e-5);
  const Grid line{ { { 1, 12, 1 } }, { { 0.7, 1.1, 2.5 } } };
  LT_CHECK_NEAR(suite, worst(gradient(line, sample(line, ramp), 1.), 2.), 0., 1e-5);
  const Grid point{ { { 1, 1, 1 } }, { { 0.7, 1.1, 2.5 } } };
  LT_CHECK(suite, gradient(point, sample(point, ramp), 1.)[0] == 0.f);
}

void curved(Suite& suite)
{
  // The smoothed x^2 has the slope 2x, but for the border.
  const Grid grid{ { { 40, 20, 20 } }, { { 0.5, 0.5, 0.8 } } };
  const Values square = sample(grid, [](double x, double, double) { return x * x; });
  const GradientMagnitude kernel(grid, 1.);
  const std::vector<float> g = gradient(grid, square, 1.);
  double error = 0.;
  for (int i = kernel.reach(0); i < grid.dims[0] - kernel.reach(0); ++i)
  {
    error = std::max(error, std::abs(g[grid.index(i, 0, 7)] - 2. * 0.5 * i));
  }
  LT_CHECK_NEAR(suite, error, 0., 1e-5);

  // A wave's slope is damped as a Gaussian damps it, exp(-k^2 sigma^2 / 2); the
  // kernel ends at 3 sigma, which costs a percent.
  const double k = 0.5;
  const double sigma = 1.5;
  const Values wave = sample(grid, [k](double x, double, double) { return std::sin(k * x); });
  const std::vector<float> damped = gradient(grid, wave, sigma);
  const double peak =
    *std::max_element(damped.begin() + grid.index(9, 9, 9), damped.begin() + grid.index(31, 9, 9));
  LT_CHECK_CLOSE(suite, peak, k * std::exp(-0.5 * k * k * sigma * sigma), 0.03);

  // A central difference where sigma is 0.
  const std::vector<float> plain = gradient(grid, wave, 0.);
  LT_CHECK_CLOSE(
    suite, plain[grid.index(20, 5, 5)], std::abs(std::sin(k * 10.5) - std::sin(k * 9.5)), 1e-5);
}

void holes(Suite& suite)
{
  const Grid grid{ { { 33, 30, 27 } }, { { 0.7, 1.1, 2.5 } } };
  const auto ramp = [](double x, double y, double z) { return 7. + 3. * x - 2. * y + 0.5 * z; };
  const double length = std::sqrt(13.25);
  const unsigned int seed = 7;
  std::cout << "random seed " << seed << "\n";
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0., 1.);

  // A third of the values is missing: the ramp is still exact, and marked where missing.
  Values values = sample(grid, ramp);
  for (double& value : values)
  {
    value = uniform(random) < 0.33 ? NaN : value;
  }
  const std::vector<float> g = gradient(grid, values, 1.5);
  LT_CHECK_NEAR(suite, worst(g, length), 0., 1e-5 * length);
  bool marked = true;
  for (std::size_t i = 0; i < g.size(); ++i)
  {
    marked = marked && std::isnan(values[i]) == (g[i] == -1.f);
  }
  LT_CHECK(suite, marked);

  // A hole far away changes nothing; close by, a constant stays flat up to the wall.
  Values noisy(values.size());
  for (double& value : noisy)
  {
    value = uniform(random);
  }
  const std::vector<float> before = gradient(grid, noisy, 0.7);
  noisy[grid.index(16, 15, 13)] = NaN;
  const std::vector<float> after = gradient(grid, noisy, 0.7);
  const GradientMagnitude kernel(grid, 0.7);
  double far = 0.;
  bool finite = true;
  for (int k = 0; k < grid.dims[2]; ++k)
  {
    for (int j = 0; j < grid.dims[1]; ++j)
    {
      for (int i = 0; i < grid.dims[0]; ++i)
      {
        const std::int64_t at = grid.index(i, j, k);
        finite = finite && std::isfinite(after[at]);
        if (std::abs(i - 16) > kernel.reach(0) || std::abs(j - 15) > kernel.reach(1) ||
          std::abs(k - 13) > kernel.reach(2))
        {
          far = std::max<double>(far, std::abs(after[at] - before[at]));
        }
      }
    }
  }
  LT_CHECK(suite, finite);
  LT_CHECK_NEAR(suite, far, 0., 1e-6);
  const Values constant =
    sample(grid, [](double x, double y, double) { return x + y > 20. ? NaN : 1234.5; });
  LT_CHECK_NEAR(suite, worst(gradient(grid, constant, 2.), 0.), 0., 1e-6);

  // Directions in which a voxel has no neighbours give nothing.
  const Values threads = sample(grid,
    [&](double x, double y, double z)
    {
      return int(std::lround(y / 1.1)) % 9 == 4 && int(std::lround(z / 2.5)) % 9 == 4
        ? ramp(x, y, z)
        : NaN;
    });
  LT_CHECK_NEAR(suite, worst(gradient(grid, threads, 1.), 3.), 0., 1e-5);
  Values lonely(values.size(), NaN);
  lonely[grid.index(3, 4, 5)] = 8.;
  LT_CHECK(suite, gradient(grid, lonely, 1.)[grid.index(3, 4, 5)] == 0.f);
  LT_CHECK(suite, gradient(grid, Values(values.size(), NaN), 1.)[0] == -1.f);
}

void invariance(Suite& suite)
{
  const Grid grid{ { { 50, 37, 41 } }, { { 0.7, 1.1, 0.9 } } };
  const Values values = sample(grid,
    [](double x, double y, double z)
    { return x > 17. && y > 20. ? NaN : std::sin(x) * std::cos(0.7 * y + 0.3 * z); });
  const std::vector<float> g = gradient(grid, values, 1.);
  LT_CHECK(suite, g == gradient(grid, values, 1., testing::ThreadedFor(3)));

  // Other units of length.
  Grid large = grid;
  for (double& h : large.spacing)
  {
    h *= 1024.;
  }
  LT_CHECK(suite, g == gradient(large, values, 1024., SerialFor, 0., 1024.));

  // Mirrored along an axis.
  Values mirrored(values.size());
  for (std::int64_t i = 0; i < grid.size(); ++i)
  {
    const std::int64_t row = i / grid.dims[0] * grid.dims[0];
    mirrored[row + grid.dims[0] - 1 - (i - row)] = values[i];
  }
  const std::vector<float> m = gradient(grid, mirrored, 1.);
  double error = 0.;
  for (std::int64_t i = 0; i < grid.size(); ++i)
  {
    const std::int64_t row = i / grid.dims[0] * grid.dims[0];
    error = std::max<double>(error, std::abs(m[row + grid.dims[0] - 1 - (i - row)] - g[i]));
  }
  LT_CHECK_NEAR(suite, error, 0., 1e-6);

  // Asked to stop.
  std::vector<float> magnitude(values.size());
  int calls = 0;
  LT_CHECK(suite,
    !GradientMagnitude(grid, 1.).compute(readerOf(values), 0., 1., magnitude.data(), SerialFor,
      [&calls](double) { return ++calls < 3; }));
  LT_CHECK(suite, calls == 3);
}

void range(Suite& suite)
{
  Values values(10000, 3.);
  values[9000] = -5.;
  values[50] = 70.;
  values[7000] = values[8000] = NaN;
  for (const ParallelFor& parallel : { ParallelFor(SerialFor), testing::ThreadedFor(4) })
  {
    ValueRange found = FindValueRange(10000, readerOf(values), parallel);
    LT_CHECK(suite, found.min == -5. && found.max == 70.);
    LT_CHECK(suite, found.numberOfNaN == 2 && found.firstNaN == 7000);
    LT_CHECK(suite, found.numberOfFinite == 9998 && found.firstInfinite == -1);
    Values infinite = values;
    infinite[6000] = infinite[9999] = -std::numeric_limits<double>::infinity();
    found = FindValueRange(10000, readerOf(infinite), parallel);
    LT_CHECK(suite, found.firstInfinite == 6000 && found.min == -5.);
  }
  const Values none(10, NaN);
  LT_CHECK(suite, FindValueRange(10, readerOf(none), SerialFor).min == 0.);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  linear(suite);
  curved(suite);
  holes(suite);
  invariance(suite);
  range(suite);
  return suite.result();
}
