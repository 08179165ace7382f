// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// Visibility by sweeps: harmonics, window and directions; closed forms; rays cast one by one.
#include "LightTransportTesting.h"
#include "ThreadedFor.h"
#include "VisibilityReference.h"

#include "Core/Visibility.h"

#include <random>
#include <vector>

using namespace lighttransport;
using testing::Suite;

namespace
{
using Vector = std::array<double, 3>;
using Values = std::vector<float>;
constexpr double Pi = 3.14159265358979323846;
const std::array<Vector, 3> Straight = { { { { 1., 0., 0. } }, { { 0., 1., 0. } },
  { { 0., 0., 1. } } } };

double dot(const Vector& a, const Vector& b)
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** sigma_t as a function of the voxel. */
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
        values.push_back(static_cast<float>(f(i, j, k)));
      }
    }
  }
  return values;
}

Values towards(const Grid& grid, const Values& sigma_t, const Vector& w)
{
  Values v(sigma_t.size(), -1.f);
  VisibilityTowards({ grid, sigma_t.data(), 0. }, w, v.data(), 1, SerialFor, nullptr);
  return v;
}

Values coefficients(const Grid& grid, const Values& sigma_t, int order, int directions)
{
  Values sh(sigma_t.size() * NumberOfHarmonics(order), -1.f);
  VisibilitySH({ grid, sigma_t.data(), 0. }, Straight, MakeDirections(directions, 2 * order), order,
    sh.data(), NumberOfHarmonics(order), SerialFor, nullptr);
  return sh;
}

void harmonics(Suite& suite)
{
  const double length = std::sqrt(0.09 + 0.25 + 0.36);
  const double x = 0.3 / length;
  const double y = -0.5 / length;
  const double z = 0.6 / length;
  double Y[81];
  SphericalHarmonics(8, { { x, y, z } }, Y);
  // Tabulated polynomials.
  LT_CHECK_NEAR(suite, Y[0], std::sqrt(1. / (4. * Pi)), 1e-14);
  LT_CHECK_NEAR(suite, Y[1], std::sqrt(3. / (4. * Pi)) * y, 1e-14);
  LT_CHECK_NEAR(suite, Y[2], std::sqrt(3. / (4. * Pi)) * z, 1e-14);
  LT_CHECK_NEAR(suite, Y[3], std::sqrt(3. / (4. * Pi)) * x, 1e-14);
  LT_CHECK_NEAR(suite, Y[4], 0.5 * std::sqrt(15. / Pi) * x * y, 1e-14);
  LT_CHECK_NEAR(suite, Y[5], 0.5 * std::sqrt(15. / Pi) * y * z, 1e-14);
  LT_CHECK_NEAR(suite, Y[6], 0.25 * std::sqrt(5. / Pi) * (3. * z * z - 1.), 1e-14);
  LT_CHECK_NEAR(suite, Y[7], 0.5 * std::sqrt(15. / Pi) * x * z, 1e-14);
  LT_CHECK_NEAR(suite, Y[8], 0.25 * std::sqrt(15. / Pi) * (x * x - y * y), 1e-14);
  LT_CHECK_NEAR(suite, Y[9], 0.25 * std::sqrt(17.5 / Pi) * y * (3. * x * x - y * y), 1e-14);
  LT_CHECK_NEAR(
    suite, Y[20], 3. / 16. / std::sqrt(Pi) * (35. * z * z * z * z - 30. * z * z + 3.), 1e-14);
  // Addition theorem, and on an axis.
  for (int l = 0; l <= 8; ++l)
  {
    double sum = 0.;
    for (int m = -l; m <= l; ++m)
    {
      sum += Y[l * (l + 1) + m] * Y[l * (l + 1) + m];
    }
    LT_CHECK_NEAR(suite, sum, (2. * l + 1.) / (4. * Pi), 1e-13);
  }
  SphericalHarmonics(8, { { 0., 0., 1. } }, Y);
  for (int l = 0; l <= 8; ++l)
  {
    for (int m = -l; m <= l; ++m)
    {
      LT_CHECK_NEAR(
        suite, Y[l * (l + 1) + m], m == 0 ? std::sqrt((2. * l + 1.) / (4. * Pi)) : 0., 1e-14);
    }
  }
}

void directions(Suite& suite)
{
  for (int order = 0; order <= HighestVisibilityOrder; ++order)
  {
    // By default the harmonics are orthonormal in the sum: exact to twice the order.
    const DirectionSet set = MakeDirections(DefaultNumberOfDirections(order), 2 * order);
    LT_CHECK(suite, set.degree == 2 * order);
    std::vector<double> sum(NumberOfHarmonics(2 * order));
    std::vector<double> Y(sum.size());
    bool good = true;
    for (std::size_t i = 0; i < set.directions.size(); ++i)
    {
      good = good && set.weights[i] > 0. &&
        std::abs(dot(set.directions[i], set.directions[i]) - 1.) < 1e-14;
      SphericalHarmonics(2 * order, set.directions[i], Y.data());
      for (std::size_t c = 0; c < Y.size(); ++c)
      {
        sum[c] += set.weights[i] * Y[c];
      }
    }
    LT_CHECK(suite, good);
    LT_CHECK_NEAR(suite, sum[0], std::sqrt(4. * Pi), 1e-12);
    for (std::size_t c = 1; c < sum.size(); ++c)
    {
      LT_CHECK_NEAR(suite, sum[c], 0., 1e-12);
    }
  }
  // As much as few directions can have: never a negative weight.
  for (int n : { 1, 2, 3, 5, 9, 17, 30 })
  {
    const DirectionSet set = MakeDirections(n, 8);
    double sum = 0.;
    bool positive = true;
    for (double weight : set.weights)
    {
      sum += weight;
      positive = positive && weight > 0.;
    }
    LT_CHECK(suite, positive);
    LT_CHECK_NEAR(suite, sum, 4. * Pi, 1e-12);
  }
}

void window(Suite& suite)
{
  LT_CHECK_NEAR(suite, VisibilityWindow(1)[1], 1. / 3., 1e-12);
  LT_CHECK_NEAR(suite, VisibilityWindow(2)[1], 1. / std::sqrt(3.), 1e-12);
  LT_CHECK_NEAR(suite, VisibilityWindow(2)[2], 0.2, 1e-12);
  // The mean cosine is the largest root of P_3 (order 4), and of P_2 + P_3 (order 3).
  LT_CHECK_NEAR(suite, VisibilityWindow(4)[1], std::sqrt(0.6), 1e-12);
  LT_CHECK_NEAR(suite, VisibilityWindow(3)[1], (1. + std::sqrt(6.)) / 5., 1e-12);
  for (int order = 0; order <= HighestVisibilityOrder; ++order)
  {
    const std::vector<double> k = VisibilityWindow(order);
    LT_CHECK_NEAR(suite, k[0], 1., 1e-15);
    double lowest = 1.;
    for (int i = 0; i <= 2000; ++i)
    {
      const double t = -1. + i / 1000.;
      double legendre[2] = { 0., 1. };
      double kernel = 0.;
      for (int l = 0; l <= order; ++l)
      {
        kernel += (2. * l + 1.) * k[l] * legendre[1];
        const double next = ((2. * l + 1.) * t * legendre[1] - l * legendre[0]) / (l + 1.);
        legendre[0] = legendre[1];
        legendre[1] = next;
      }
      lowest = std::min(lowest, kernel);
    }
    LT_CHECK(suite, lowest > -1e-12);
  }
}

void closedForms(Suite& suite)
{
  // A box, along its axes: the depth to the border is that of the distance.
  const double s = 0.07;
  const Grid grid{ { { 9, 14, 11 } }, { { 0.5, 1., 2. } } };
  const Values box = sample(grid, [s](int, int, int) { return s; });
  for (int a = 0; a < 3; ++a)
  {
    for (double sign : { -1., 1. })
    {
      Vector w{ { 0., 0., 0. } };
      w[a] = 2. * sign; // of any length
      const Values v = towards(grid, box, w);
      double worst = 0.;
      for (int k = 0; k < grid.dims[2]; ++k)
      {
        for (int j = 0; j < grid.dims[1]; ++j)
        {
          for (int i = 0; i < grid.dims[0]; ++i)
          {
            const int at[3] = { i, j, k };
            const double voxels = sign > 0. ? grid.dims[a] - 0.5 - at[a] : at[a] + 0.5;
            const double expected = std::exp(-s * voxels * grid.spacing[a]);
            worst = std::max(worst, std::abs(v[grid.index(i, j, k)] - expected));
          }
        }
      }
      LT_CHECK_NEAR(suite, worst, 0., 1e-6);
    }
  }
  // Nothing there: exactly 1, and sqrt(4 pi) in band 0 alone.
  const Values empty(box.size(), 0.f);
  const Values v = towards(grid, empty, { { 0.3, -0.8, 0.2 } });
  LT_CHECK(suite, std::all_of(v.begin(), v.end(), [](float value) { return value == 1.f; }));
  const Values sh = coefficients(grid, empty, 2, 64);
  double worst = 0.;
  for (std::size_t i = 0; i < sh.size(); ++i)
  {
    worst = std::max(worst, std::abs(sh[i] - (i % 9 == 0 ? std::sqrt(4. * Pi) : 0.)));
  }
  LT_CHECK_NEAR(suite, worst, 0., 2e-6);
}

/** Single rays, towards directions and places, in a smooth medium. */
void rays(Suite& suite)
{
  const unsigned int seed = 11;
  std::cout << "random seed " << seed << "\n";
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1., 1.);
  const Grid grid{ { { 33, 28, 21 } }, { { 1., 0.8, 1.7 } } };
  const Values sigma_t = sample(grid,
    [](int i, int j, int k)
    {
      const double r = std::hypot(i - 16., std::hypot(0.8 * (j - 13.5), 1.7 * (k - 10.)));
      return r < 14. ? 0.06 * (1. + std::sin(0.5 * i) * std::cos(0.4 * j)) * (1. - r / 14.) : 0.;
    });
  double worst[2] = { 0., 0. };
  for (int n = 0; n < 30; ++n)
  {
    Vector w{ { uniform(random), uniform(random), uniform(random) } };
    const double length = std::sqrt(dot(w, w));
    for (double& component : w)
    {
      component /= length;
    }
    const Values v = towards(grid, sigma_t, w);
    // A place inside or outside.
    Vector light{ { 16. + 40. * uniform(random), 11. + 30. * uniform(random),
      17. + 40. * uniform(random) } };
    Values u(sigma_t.size(), -1.f);
    VisibilityTowardsPoint({ grid, sigma_t.data(), 0. }, light, u.data(), 1, SerialFor, nullptr);
    LT_CHECK(suite, *std::min_element(u.begin(), u.end()) >= 0.f);
    LT_CHECK(suite, *std::max_element(u.begin(), u.end()) <= 1.f);
    for (int q = 0; q < 100; ++q)
    {
      const int i = static_cast<int>((uniform(random) + 1.) * 16.49);
      const int j = static_cast<int>((uniform(random) + 1.) * 13.99);
      const int k = static_cast<int>((uniform(random) + 1.) * 10.49);
      const Vector p{ { i * grid.spacing[0], j * grid.spacing[1], k * grid.spacing[2] } };
      worst[0] = std::max(worst[0],
        std::abs(v[grid.index(i, j, k)] - testing::castVisibility(grid, sigma_t.data(), p, w)));
      Vector to{ { light[0] - p[0], light[1] - p[1], light[2] - p[2] } };
      const double distance = std::sqrt(dot(to, to));
      for (double& component : to)
      {
        component /= distance;
      }
      worst[1] = std::max(worst[1],
        std::abs(u[grid.index(i, j, k)] -
          testing::castVisibility(grid, sigma_t.data(), p, to, 0.1, distance)));
    }
  }
  std::cout << "worst error of a ray: " << worst[0] << " towards directions, " << worst[1]
            << " towards places\n";
  LT_CHECK(suite, worst[0] < 0.02);
  LT_CHECK(suite, worst[1] < 0.02);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  harmonics(suite);
  directions(suite);
  window(suite);
  closedForms(suite);
  rays(suite);
  return suite.result();
}
