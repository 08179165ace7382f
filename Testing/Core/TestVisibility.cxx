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

Values coefficients(const Grid& grid, const Values& sigma_t, int order, int directions,
  double radius = 0., const ParallelFor& parallel = SerialFor)
{
  Values sh(sigma_t.size() * NumberOfHarmonics(order), -1.f);
  VisibilitySH({ grid, sigma_t.data(), radius }, Straight, MakeDirections(directions, 2 * order),
    order, sh.data(), NumberOfHarmonics(order), parallel, nullptr);
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
  // Along a face, from within: no light leaks in from beside the box.
  for (int a = 0; a < 2; ++a)
  {
    for (double slope : { -0.03, -0.11, -0.4 })
    {
      // The light lies high and away from the face at the upper end of the axis a.
      Vector w{ { 0., 0., 1. } };
      w[a] = slope;
      const Values v = towards(grid, box, w);
      double worst = 0.;
      for (int k = 0; k < grid.dims[2]; ++k)
      {
        const int i = a == 0 ? grid.dims[0] - 1 : 4;
        const int j = a == 1 ? grid.dims[1] - 1 : 7;
        const double up = (grid.dims[2] - 0.5 - k) * 2.;
        const double across = (grid.dims[a] - 0.5) * grid.spacing[a] / -slope;
        const double expected = std::exp(-s * std::min(up, across) * std::sqrt(1. + slope * slope));
        worst = std::max(worst, std::abs(v[grid.index(i, j, k)] - expected));
      }
      LT_CHECK_NEAR(suite, worst, 0., 0.015);
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

Vector unit(const Vector& w)
{
  const double length = std::sqrt(dot(w, w));
  return { { w[0] / length, w[1] / length, w[2] / length } };
}

/** Layers: the depth is that of the distance along the ray, whatever the angle. */
void layers(Suite& suite)
{
  // A half-space x < 15.5 voxels, seen from the middle of a wide grid.
  const Grid grid{ { { 40, 61, 61 } }, { { 0.7, 1., 0.8 } } };
  const Values half = sample(grid, [](int i, int, int) { return i < 16 ? 0.11 : 0.; });
  // A plate of one voxel, and the same mass within one plane.
  const Values plate = sample(grid, [](int i, int, int) { return i == 20 ? 0.6 : 0.; });
  for (const Vector& direction : { Vector{ { -1., 0.1, 0.2 } }, Vector{ { -1., -0.9, 0.3 } },
         Vector{ { -1., 0.5, -0.6 } }, Vector{ { -0.8, 1., 0.1 } } })
  {
    const Vector w = unit(direction);
    const Values v = towards(grid, half, w);
    const Values u = towards(grid, plate, w);
    double worst[2] = { 0., 0. };
    for (int i = 6; i < 40; ++i)
    {
      const double inside = std::min(i + 0.5, 16.) * 0.7;
      // Only where the ray leaves through the face x = 0.
      const double aside = (i + 0.5) * 0.7 * std::max(std::abs(w[1]), std::abs(w[2]) / 0.8) / -w[0];
      if (aside < 29. && (i < 14 || i > 17))
      {
        worst[0] =
          std::max(worst[0], std::abs(v[grid.index(i, 30, 30)] - std::exp(-0.11 * inside / -w[0])));
      }
      if (aside < 29. && std::abs(i - 20) > 1)
      {
        const double expected = i > 20 ? std::exp(-0.6 * 0.7 / -w[0]) : 1.;
        worst[1] = std::max(worst[1], std::abs(u[grid.index(i, 30, 30)] - expected));
      }
    }
    // The voxels' linear interpolation rounds the face; nothing of it grows with the distance.
    LT_CHECK_NEAR(suite, worst[0], 0., 0.005);
    LT_CHECK_NEAR(suite, worst[1], 0., 0.03);
  }

  // A ball, from its centre.
  const int n = 49;
  const Grid cube{ { { n, n, n } }, { { 0.5, 0.5, 0.5 } } };
  const Values ball = sample(cube,
    [](int i, int j, int k)
    {
      const double r = std::hypot(i - 24., std::hypot(j - 24., k - 24.));
      return 0.2 * std::min(1., std::max(0., 20.5 - r)); // radius 20 voxels, tau = 2
    });
  const Values sh = coefficients(cube, ball, 4, 144);
  const float* centre = sh.data() + 25 * cube.index(24, 24, 24);
  LT_CHECK_NEAR(suite, centre[0], std::sqrt(4. * Pi) * std::exp(-2.), 0.01);
  for (int c = 1; c < 25; ++c)
  {
    LT_CHECK_NEAR(suite, centre[c], 0., 0.004);
  }
}

/** A shadow stays as wide as its occluder, however far it falls: nothing diffuses. */
void sharp(Suite& suite)
{
  const Grid grid{ { { 40, 40, 120 } }, { { 1., 1., 1. } } };
  const Values bar =
    sample(grid, [](int i, int, int k) { return k == 115 && i >= 10 && i < 14 ? 50. : 0.; });
  const Vector w{ { 0.07, 0., 1. } };
  const Values v = towards(grid, bar, w);
  double before = 0.;
  for (int k : { 110, 60, 4 })
  {
    double shadow = 0.;
    float darkest = 1.f;
    double second = 0.;
    double first = 0.;
    for (int i = 0; i < 40; ++i)
    {
      const double dark = 1. - v[grid.index(i, 20, k)];
      const double x = i + 0.07 * (115 - k);
      shadow += dark;
      first += dark * x;
      second += dark * x * x;
      darkest = std::min(darkest, v[grid.index(i, 20, k)]);
    }
    const double mean = first / shadow;
    const double width = std::sqrt(second / shadow - mean * mean);
    // Where an edge lies is known to half a ray, and stays where it is.
    LT_CHECK_NEAR(suite, mean, 11.5, 0.5);
    LT_CHECK(suite, k == 110 || std::abs(mean - before) < 0.01);
    before = mean;
    LT_CHECK(suite, darkest < 1e-3f);
    // 3 between its outer voxels; beyond them a depth of 50 (1 - t): 1 - 1/50 on either side.
    LT_CHECK_NEAR(suite, shadow, 4.96, 0.1);
    LT_CHECK_NEAR(suite, width, shadow / std::sqrt(12.), 0.15);
  }
}

/** Voxels of random extinction, and a checkerboard: the mean error of v. */
void checkerboard(Suite& suite)
{
  const Grid grid{ { { 40, 36, 32 } }, { { 1., 1., 1. } } };
  const Values board =
    sample(grid, [](int i, int j, int k) { return (i / 8 + j / 8 + k / 8) % 2 ? 0.1 : 0.; });
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0., 0.9999);
  double sum = 0.;
  int count = 0;
  for (const Vector& w : MakeDirections(24, 2).directions)
  {
    const Values v = towards(grid, board, w);
    for (int q = 0; q < 40; ++q)
    {
      const int i = static_cast<int>(uniform(random) * grid.dims[0]);
      const int j = static_cast<int>(uniform(random) * grid.dims[1]);
      const int k = static_cast<int>(uniform(random) * grid.dims[2]);
      sum += std::abs(v[grid.index(i, j, k)] -
        testing::castVisibility(grid, board.data(), { { double(i), double(j), double(k) } }, w));
      ++count;
    }
  }
  std::cout << "mean error on a checkerboard: " << sum / count << "\n";
  LT_CHECK(suite, sum / count < 0.01);
}

void invariants(Suite& suite)
{
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(0., 0.2);
  const Grid grid{ { { 21, 18, 24 } }, { { 1., 0.9, 1.3 } } };
  Values sigma_t(grid.size());
  for (float& s : sigma_t)
  {
    s = static_cast<float>(uniform(random));
  }
  const Vector w{ { 0.4, -0.7, 0.5 } };
  const Values v = towards(grid, sigma_t, w);

  // Lengths scaled, extinction scaled back.
  Grid large = grid;
  Values thin = sigma_t;
  for (double& h : large.spacing)
  {
    h *= 8.;
  }
  for (float& s : thin)
  {
    s /= 8.f;
  }
  const Values scaled = towards(large, thin, w);
  // Mirrored along y; the three axes exchanged in a circle.
  Values mirror(sigma_t.size());
  const Grid circle{ { { grid.dims[2], grid.dims[0], grid.dims[1] } },
    { { grid.spacing[2], grid.spacing[0], grid.spacing[1] } } };
  Values turned(sigma_t.size());
  const auto forEach = [&](const auto& f)
  {
    for (int k = 0; k < grid.dims[2]; ++k)
    {
      for (int j = 0; j < grid.dims[1]; ++j)
      {
        for (int i = 0; i < grid.dims[0]; ++i)
        {
          f(grid.index(i, j, k), grid.index(i, grid.dims[1] - 1 - j, k), circle.index(k, i, j));
        }
      }
    }
  };
  forEach(
    [&](std::int64_t here, std::int64_t there, std::int64_t round)
    {
      mirror[there] = sigma_t[here];
      turned[round] = sigma_t[here];
    });
  const Values outermost = sample(grid,
    [&grid](int i, int j, int k)
    {
      return i % (grid.dims[0] - 1) == 0 || j % (grid.dims[1] - 1) == 0 ||
        k % (grid.dims[2] - 1) == 0;
    });
  const Values mirrored = towards(grid, mirror, { { w[0], -w[1], w[2] } });
  const Values round = towards(circle, turned, { { w[2], w[0], w[1] } });
  // A light very far away is a direction.
  Values far(sigma_t.size());
  VisibilityTowardsPoint(
    { grid, sigma_t.data(), 0. }, { { 4e6, -7e6, 5e6 } }, far.data(), 1, SerialFor, nullptr);
  // So far that nothing but its direction is left, and directions of any length.
  for (const double length : { 1e30, 1e300 })
  {
    Values there(sigma_t.size());
    VisibilityTowardsPoint({ grid, sigma_t.data(), 0. },
      { { length * w[0], length * w[1], length * w[2] } }, there.data(), 1, SerialFor, nullptr);
    const double small = 1. / length;
    LT_CHECK(
      suite, there == towards(grid, sigma_t, { { small * w[0], small * w[1], small * w[2] } }));
  }
  double worst[4] = { 0., 0., 0., 0. };
  double mean = 0.;
  forEach(
    [&](std::int64_t here, std::int64_t there, std::int64_t at)
    {
      const double value = v[here];
      worst[0] = std::max(worst[0], std::abs(value - scaled[here]));
      worst[1] = std::max(worst[1], std::abs(value - mirrored[there]));
      // At the border, values that would leave [0, 1] are cut off along one axis after the other.
      worst[outermost[here] > 0.f ? 3 : 2] =
        std::max(worst[outermost[here] > 0.f ? 3 : 2], std::abs(value - round[at]));
      mean += std::abs(value - far[here]) / static_cast<double>(v.size());
    });
  LT_CHECK_NEAR(suite, worst[0], 0., 2e-6);
  LT_CHECK_NEAR(suite, worst[1], 0., 2e-6);
  LT_CHECK_NEAR(suite, worst[2], 0., 2e-6);
  LT_CHECK_NEAR(suite, worst[3], 0., 0.1);
  LT_CHECK_NEAR(suite, mean, 0., 0.01); // its lattice lies elsewhere between the voxels

  // However it is split.
  const Values sh = coefficients(grid, sigma_t, 2, 64);
  LT_CHECK(suite, sh == coefficients(grid, sigma_t, 2, 64, 0., testing::ThreadedFor(3)));
  const Grid big{ { { 70, 66, 64 } }, { { 1., 1., 1. } } };
  const Values many =
    sample(big, [](int i, int j, int k) { return ((i * 31 + j * 17 + k * 7) % 10) * 0.01; });
  LT_CHECK(suite,
    coefficients(big, many, 1, 12, 9.5) ==
      coefficients(big, many, 1, 12, 9.5, testing::ThreadedFor(4)));
  const Vector place{ { 20., 30., 100. } };
  Values serial(many.size());
  Values threaded(many.size());
  VisibilityTowardsPoint({ big, many.data(), 0. }, place, serial.data(), 1, SerialFor, nullptr);
  VisibilityTowardsPoint(
    { big, many.data(), 0. }, place, threaded.data(), 1, testing::ThreadedFor(3), nullptr);
  LT_CHECK(suite, serial == threaded);

  // Read through the window, v lies in [0, 1] whatever the direction.
  for (int order = 1; order <= HighestVisibilityOrder; ++order)
  {
    // Opaque sheets, where raw harmonics ring.
    const Values sheets =
      sample(grid, [](int i, int j, int k) { return i % 7 == 3 || j + k == 20 ? 30. : 0.; });
    const Values c = coefficients(grid, sheets, order, DefaultNumberOfDirections(order));
    const std::vector<double> k = VisibilityWindow(order);
    double lowest[2] = { 1., 1. };
    double highest[2] = { 0., 0. };
    for (const Vector& direction : MakeDirections(50, 1).directions)
    {
      double Y[25];
      SphericalHarmonics(order, direction, Y);
      for (std::int64_t voxel = 0; voxel < grid.size(); voxel += 7)
      {
        double raw = 0.;
        double read = 0.;
        for (int l = 0; l <= order; ++l)
        {
          for (int m = -l; m <= l; ++m)
          {
            const int at = l * (l + 1) + m;
            const double term = c[voxel * NumberOfHarmonics(order) + at] * Y[at];
            raw += term;
            read += k[l] * term;
          }
        }
        lowest[0] = std::min(lowest[0], raw);
        highest[0] = std::max(highest[0], raw);
        lowest[1] = std::min(lowest[1], read);
        highest[1] = std::max(highest[1], read);
      }
    }
    LT_CHECK(suite, lowest[1] >= -1e-5 && highest[1] <= 1. + 1e-5);
    LT_CHECK(suite, lowest[0] < -0.02); // and needs it
  }
}

void radius(Suite& suite)
{
  // In a box: up to the radius, or to the border where that is nearer.
  const Grid grid{ { { 30, 26, 22 } }, { { 1., 0.8, 1.5 } } };
  const double s = 0.06;
  const Values box = sample(grid, [s](int, int, int) { return s; });
  for (const Vector& direction : { Vector{ { 0., 0., 1. } }, Vector{ { -1., 0., 0. } },
         Vector{ { 0.5, 0.3, -0.8 } }, Vector{ { -0.9, 0.4, 0.2 } } })
  {
    const Vector w = unit(direction);
    for (double r : { 0.3, 2.5, 6., 11.3 })
    {
      Values v(box.size(), -1.f);
      VisibilityTowards({ grid, box.data(), r }, w, v.data(), 1, SerialFor, nullptr);
      LT_CHECK_NEAR(
        suite, v[grid.index(15, 13, 11)], std::exp(-s * std::min(r, 10.)), r < 10. ? 2e-6 : 0.06);
      const Vector p{ { 15., 13. * 0.8, 11. * 1.5 } };
      LT_CHECK_NEAR(suite, v[grid.index(15, 13, 11)],
        testing::castVisibility(grid, box.data(), p, w, 0.05, r), 0.003);
    }
    // Far enough, it is as if there were none.
    const Values all = towards(grid, box, w);
    Values v(box.size(), -1.f);
    VisibilityTowards({ grid, box.data(), 1e4 }, w, v.data(), 1, SerialFor, nullptr);
    LT_CHECK(suite, v == all);
    // What is kept from one sweep to the next changes nothing.
    VisibilityScratch scratch;
    for (int time = 0; time < 2; ++time)
    {
      v.assign(v.size(), -1.f);
      VisibilityTowards({ grid, box.data(), 0. }, w, v.data(), 1, SerialFor, nullptr, &scratch);
      LT_CHECK(suite, v == all);
    }
  }
  // Around a wall: seen from closer than the radius, not from beyond.
  const Values wall = sample(grid, [](int i, int, int) { return i == 20 ? 100. : 0.; });
  Values v(box.size(), -1.f);
  VisibilityTowards(
    { grid, wall.data(), 6. }, { { 1., 0.1, 0. } }, v.data(), 1, SerialFor, nullptr);
  LT_CHECK_NEAR(suite, v[grid.index(16, 13, 11)], 0., 1e-6);
  LT_CHECK_NEAR(suite, v[grid.index(11, 13, 11)], 1., 1e-6);
  const Values sh = coefficients(grid, box, 1, 48, 3.);
  LT_CHECK_NEAR(
    suite, sh[4 * grid.index(15, 13, 11)], std::sqrt(4. * Pi) * std::exp(-s * 3.), 1e-4);
}

void cancel(Suite& suite)
{
  const Grid grid{ { { 20, 20, 20 } }, { { 1., 1., 1. } } };
  const Values box = sample(grid, [](int, int, int) { return 0.1; });
  Values v(box.size());
  Values sh(box.size() * 9);
  for (int calls : { 1, 3, 5 })
  {
    int left = calls;
    double last = 0.;
    const ProgressFunction stop = [&](double fraction)
    {
      last = fraction;
      return --left > 0;
    };
    const VisibilityMedium medium{ grid, box.data(), 0. };
    LT_CHECK(suite,
      !VisibilitySH(medium, Straight, MakeDirections(64, 4), 2, sh.data(), 9, SerialFor, stop));
    LT_CHECK(suite, left == 0 && last > 0. && last < 0.2);
    left = calls;
    LT_CHECK(suite, !VisibilityTowards(medium, { { 1., 0., 0. } }, v.data(), 1, SerialFor, stop));
    LT_CHECK(suite, left == 0);
    left = calls;
    LT_CHECK(
      suite, !VisibilityTowardsPoint(medium, { { 1., 0., 0. } }, v.data(), 1, SerialFor, stop));
    LT_CHECK(suite, left == 0);
  }
  double last = 0.;
  LT_CHECK(suite,
    VisibilitySH({ grid, box.data(), 0. }, Straight, MakeDirections(64, 4), 2, sh.data(), 9,
      SerialFor,
      [&last](double fraction)
      {
        const bool grows = fraction > last && fraction <= 1.;
        last = fraction;
        return grows;
      }));
  LT_CHECK_NEAR(suite, last, 1., 1e-12);
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
  layers(suite);
  sharp(suite);
  checkerboard(suite);
  invariants(suite);
  radius(suite);
  cancel(suite);
  return suite.result();
}
