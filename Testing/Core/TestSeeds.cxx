// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// Light sources on a grid: the power is kept, spheres are round and move smoothly.
#include "LightTransportTesting.h"
#include "ThreadedFor.h"

#include "Core/Seeds.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>

using namespace lighttransport;
using testing::Suite;

namespace
{
const double Pi = 3.14159265358979323846;

using Density = std::vector<float>;

Density compute(const Grid& grid, const std::vector<SphereSource>& spheres,
  const std::vector<ImageSource>& images = {}, SourceReport* report = nullptr,
  const ParallelFor& parallel = SerialFor)
{
  Density q(grid.size(), -1.f);
  const SourceReport found = ComputeSources(grid, spheres, images, q.data(), parallel, nullptr);
  if (report)
  {
    *report = found;
  }
  return q;
}

double powerOf(const Grid& grid, const Density& q)
{
  return std::accumulate(q.begin(), q.end(), 0.) * grid.voxelVolume();
}

std::int64_t lit(const Density& q)
{
  return std::count_if(q.begin(), q.end(), [](float v) { return v != 0.f; });
}

void power(Suite& suite)
{
  const unsigned int seed = 3;
  std::cout << "random seed " << seed << "\n";
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0., 1.);
  for (const Grid& grid : { Grid{ { { 24, 31, 17 } }, { { 1., 1., 1. } } },
         Grid{ { { 24, 31, 17 } }, { { 0.3, 1.7, 5. } } },
         Grid{ { { 1, 31, 17 } }, { { 2., 1., 1. } } },
         Grid{ { { 1, 1, 1 } }, { { 1e-3, 1., 2. } } } })
  {
    // Anywhere in the domain and beyond, any radius: the whole power lies inside.
    double worst = 0.;
    std::vector<SphereSource> all;
    double total = 0.;
    double magnitude = 0.;
    for (int n = 0; n < 300; ++n)
    {
      SphereSource sphere;
      for (int a = 0; a < 3; ++a)
      {
        sphere.center[a] = -1.5 + uniform(random) * (grid.dims[a] + 2.);
      }
      sphere.radius = 6. * uniform(random) * uniform(random) * grid.smallestSpacing();
      sphere.power = uniform(random) < 0.3 ? -7. * uniform(random) : 3. * uniform(random);
      if (MeetsDomain(grid, sphere))
      {
        const Density q = compute(grid, { sphere });
        worst = std::max(worst, std::abs(powerOf(grid, q) / sphere.power - 1.));
        all.push_back(sphere);
        total += sphere.power;
        magnitude += std::abs(sphere.power);
      }
    }
    LT_CHECK(suite, all.size() > 5);
    LT_CHECK_NEAR(suite, worst, 0., 1e-7);
    // All at once; whatever the threads.
    SourceReport report;
    const Density q = compute(grid, all, {}, &report);
    LT_CHECK_NEAR(suite, powerOf(grid, q), total, 1e-7 * magnitude);
    LT_CHECK_NEAR(suite, report.power, powerOf(grid, q), 1e-12 * magnitude);
    LT_CHECK(suite, q == compute(grid, all, {}, nullptr, testing::ThreadedFor(3)));
    // A source and its negative cancel.
    std::vector<SphereSource> both;
    for (SphereSource sphere : all)
    {
      both.push_back(sphere);
      sphere.power = -sphere.power;
      both.push_back(sphere);
    }
    double left = 0.;
    double largest = 0.;
    for (float v : compute(grid, both))
    {
      left = std::max<double>(left, std::abs(v));
    }
    for (float v : q)
    {
      largest = std::max<double>(largest, std::abs(v));
    }
    LT_CHECK(suite, left <= 1e-12 * largest);
  }
}

void shape(Suite& suite)
{
  const Grid grid{ { { 40, 30, 20 } }, { { 1., 1.5, 2. } } };

  // A radius below half the smallest spacing: the nearest voxel alone.
  for (double radius : { 0., 0.1, 0.49 })
  {
    const Density q = compute(grid, { { { { 7.4, 8.6, 9.49 } }, radius, 6. } });
    LT_CHECK(suite, lit(q) == 1);
    LT_CHECK_CLOSE(suite, q[grid.index(7, 9, 9)], 2., 1e-7);
  }
  // On the domain's border and in its corner it still counts; beyond it does not.
  LT_CHECK(suite, lit(compute(grid, { { { { -0.5, 29.5, 19.5 } }, 0., 1. } })) == 1);
  LT_CHECK(suite, MeetsDomain(grid, { { { -0.5, 29.5, 19.5 } }, 0., 1. }));
  LT_CHECK(suite, !MeetsDomain(grid, { { { -0.51, 3., 3. } }, 0., 1. }));
  LT_CHECK(suite, !MeetsDomain(grid, { { { 3., 29.7, 3. } }, 0.49, 1. }));
  // A sphere that enters from outside does: 2 voxels of 1.5 outside, radius 3.
  LT_CHECK(suite, MeetsDomain(grid, { { { 3., 31.4, 3. } }, 3., 1. }));
  LT_CHECK(suite, !MeetsDomain(grid, { { { 3., 31.6, 3. } }, 3., 1. }));
  LT_CHECK(suite, lit(compute(grid, { { { { 3., 31.49, 3. } }, 3., 1. } })) >= 1);

  // The fractions sum up to about the ball's volume; inside they are 1, outside 0.
  for (double radius : { 3., 6.5, 9. })
  {
    const SphereSource sphere{ { { 19.3, 14.8, 9.6 } }, radius, 1. };
    double volume = 0.;
    bool bounds = true;
    for (int k = 0; k < grid.dims[2]; ++k)
    {
      for (int j = 0; j < grid.dims[1]; ++j)
      {
        for (int i = 0; i < grid.dims[0]; ++i)
        {
          const double d = std::hypot(i - 19.3, 1.5 * (j - 14.8), 2. * (k - 9.6));
          const double fraction = InsideFraction(grid, sphere, i, j, k);
          const double diagonal = 0.5 * std::sqrt(1. + 2.25 + 4.);
          bounds = bounds && (d > radius - diagonal || fraction == 1.) &&
            (d < radius + diagonal || fraction == 0.);
          volume += fraction * grid.voxelVolume();
        }
      }
    }
    LT_CHECK(suite, bounds);
    // A ramp of width w about R holds 1 + w^2 / (4 R^2) times the ball: second order.
    LT_CHECK_CLOSE(suite, volume, 4. / 3. * Pi * radius * radius * radius,
      0.25 * (1. + 2.25 + 4.) / (radius * radius));
    // Its centre of mass is the centre, and q at the centre is power / volume.
    const Density q = compute(grid, { sphere });
    double centroid[3] = { 0., 0., 0. };
    for (std::int64_t n = 0; n < grid.size(); ++n)
    {
      centroid[0] += q[n] * grid.voxelVolume() * (n % 40);
      centroid[1] += q[n] * grid.voxelVolume() * (n / 40 % 30);
      const std::int64_t k = n / 1200;
      centroid[2] += q[n] * grid.voxelVolume() * k;
    }
    LT_CHECK_NEAR(suite, centroid[0], 19.3, 0.02);
    LT_CHECK_NEAR(suite, centroid[1], 14.8, 0.02);
    LT_CHECK_NEAR(suite, centroid[2], 9.6, 0.02);
    LT_CHECK_CLOSE(suite, q[grid.index(19, 15, 10)], 1. / volume, 1e-6);
  }

  // It moves smoothly: a shift of 1/100 voxel changes at most a few hundredths of the power.
  const Grid cube{ { { 20, 20, 20 } }, { { 1., 1., 1. } } };
  Density before;
  double jump = 0.;
  for (int step = 0; step <= 200; ++step)
  {
    const double x = 8. + 0.01 * step;
    const Density q = compute(cube, { { { { x, 9.3, 9.9 } }, 2., 1. } });
    double change = 0.;
    for (std::size_t n = 0; n < before.size(); ++n)
    {
      change += std::abs(q[n] - before[n]);
    }
    jump = std::max(jump, change);
    before = q;
  }
  LT_CHECK(suite, jump < 0.02);

  // Where it leaves the volume, what is inside carries all: half a ball, twice the density.
  const Density whole = compute(cube, { { { { 9.5, 9.5, 9.5 } }, 4., 1. } });
  const Density half = compute(cube, { { { { -0.5, 9.5, 9.5 } }, 4., 1. } });
  LT_CHECK_CLOSE(suite, half[cube.index(0, 9, 9)], 2. * whole[cube.index(9, 9, 9)], 1e-6);

  // float32 cannot hold these: the sphere is named.
  SourceReport report;
  const SphereSource fine{ { { 3., 3., 3. } }, 0., 1. };
  for (double bad : { 1e39, -1e300, 1e-40 })
  {
    compute(cube, { fine, { { { 5., 5., 5. } }, 0., bad } }, {}, &report);
    LT_CHECK(suite, report.badSphere == 1);
  }
  const Grid tiny{ { { 20, 20, 20 } }, { { 1e-200, 1e-200, 1e-200 } } };
  compute(tiny, { fine }, {}, &report);
  LT_CHECK(suite, report.badSphere == 0);
  compute(
    cube, { { { { 3., 3., 3. } }, 0., 3e38 }, { { { 3., 3., 3. } }, 0., 3e38 } }, {}, &report);
  LT_CHECK(suite, report.badVoxel == cube.index(3, 3, 3));
}

Stroke strokeOf(
  std::vector<std::array<double, 3>> points, const std::vector<double>& radius, double power)
{
  Stroke stroke;
  stroke.points = std::move(points);
  stroke.radius = radius;
  stroke.power.assign(stroke.points.size(), power);
  return stroke;
}

void strokes(Suite& suite)
{
  const Grid grid{ { { 24, 25, 40 } }, { { 1., 1., 0.5 } } };
  const auto densityOf = [&](const Stroke& stroke)
  {
    std::vector<SphereSource> spheres;
    LT_CHECK(suite, StrokeToSpheres(grid, stroke, spheres));
    return compute(grid, spheres);
  };

  // Along z: every slice well inside carries the same power; in all it is the stroke's.
  const Density tube = densityOf(
    strokeOf({ { { 11.2, 12.4, 3.7 } }, { { 11.2, 12.4, 9. } }, { { 11.2, 12.4, 35.1 } } },
      { 2., 2., 2. }, 5.));
  LT_CHECK_NEAR(suite, powerOf(grid, tube), 5., 1e-6);
  const auto slicePower = [&](const Density& q, int k)
  {
    return std::accumulate(
             q.begin() + grid.index(0, 0, k), q.begin() + grid.index(0, 0, k) + 600, 0.) *
      grid.voxelVolume();
  };
  for (int k = 12; k < 27; ++k)
  {
    LT_CHECK_CLOSE(suite, slicePower(tube, k), 5. / 31.4, 0.01);
  }

  // Half of it outside: the inside carries all, evenly.
  const Density cut =
    densityOf(strokeOf({ { { 11., 12., -1000. } }, { { 11., 12., 19.5 } } }, { 1., 1. }, 5.));
  LT_CHECK_NEAR(suite, powerOf(grid, cut), 5., 1e-6);
  LT_CHECK_CLOSE(suite, slicePower(cut, 8), slicePower(cut, 12), 0.03);
  LT_CHECK(suite, slicePower(cut, 23) == 0.);

  // No length: one sphere. A widening stroke keeps its power. A stroke may be a point wide.
  const std::array<double, 3> here{ { 5., 6., 7. } };
  LT_CHECK(suite, lit(densityOf(strokeOf({ here, here, here }, { 0., 0., 0. }, 2.))) == 1);
  LT_CHECK(suite, lit(densityOf(strokeOf({ here }, { 0. }, 2.))) == 1);
  LT_CHECK_NEAR(suite, powerOf(grid, densityOf(strokeOf({ here }, { 2. }, 2.))), 2., 1e-6);
  const Density cone =
    densityOf(strokeOf({ { { 3., 3., 3. } }, { { 20., 20., 30. } } }, { 0., 5. }, -2.));
  LT_CHECK_NEAR(suite, powerOf(grid, cone), -2., 1e-6);
  const Density thin =
    densityOf(strokeOf({ { { 3., 3., 3. } }, { { 3., 3., 9. } } }, { 0., 0. }, 1.));
  LT_CHECK(suite, lit(thin) == 7);

  // A power that varies: in proportion along the stroke, the mean in all.
  Stroke graded = strokeOf({ { { 11., 12., 2. } }, { { 11., 12., 36. } } }, { 0., 0. }, 0.);
  graded.power = { 0., 4. };
  const Density ramp = densityOf(graded);
  LT_CHECK_NEAR(suite, powerOf(grid, ramp), 2., 1e-6);
  LT_CHECK_CLOSE(suite, slicePower(ramp, 28) / slicePower(ramp, 10), 26. / 8., 0.05);

  // Outside: nothing is added.
  std::vector<SphereSource> spheres;
  LT_CHECK(suite,
    !StrokeToSpheres(
      grid, strokeOf({ { { 50., 0., 0. } }, { { 60., 0., 0. } } }, { 2., 2. }, 1.), spheres));
  LT_CHECK(suite, !StrokeToSpheres(grid, strokeOf({ { { 50., 0., 0. } } }, { 2. }, 1.), spheres));
  LT_CHECK(suite, spheres.empty());
  // Far beyond on both sides, and quick all the same.
  LT_CHECK(suite,
    StrokeToSpheres(
      grid, strokeOf({ { { 5., 5., -1e12 } }, { { 5., 5., 1e12 } } }, { 2., 2. }, 1.), spheres));
  LT_CHECK(suite, spheres.size() < 1000);
}

void images(Suite& suite)
{
  const Grid grid{ { { 12, 10, 8 } }, { { 1., 1., 2. } } };
  std::vector<double> weights(grid.size());
  std::iota(weights.begin(), weights.end(), -400.);
  ImageSource same;
  same.read = [&weights](std::int64_t begin, std::int64_t n, double* out)
  { std::copy_n(weights.begin() + begin, n, out); };
  same.transfer = [](double w) { return 0.5 * w; };
  Density q = compute(grid, {}, { same });
  LT_CHECK(suite, q[0] == -200.f && q[7] == -196.5f && q[959] == 279.5f);
  q = compute(grid, { { { { 0., 0., 0. } }, 0., 2. } }, { same, same });
  LT_CHECK(suite, q[0] == -399.f && q[7] == -393.f);

  // On a shifted, coarser grid: a linear function is met between the centres, kept in the
  // outer half voxel, 0 beyond.
  const Grid coarse{ { { 4, 4, 4 } }, { { 2., 2., 3. } } };
  Density values(coarse.size());
  for (std::int64_t n = 0; n < coarse.size(); ++n)
  {
    values[n] = static_cast<float>(n % 4);
  }
  ImageSource other;
  other.values = values.data();
  other.grid = coarse;
  other.map.offset = { { -1., 0., 0. } };
  other.map.column = { { { { 0.5, 0., 0. } }, { { 0., 0.5, 0. } }, { { 0., 0., 2. / 3. } } } };
  other.transfer = [](double w) { return w; };
  q = compute(grid, {}, { other });
  const float expected[12] = { 0.f, 0.f, 0.f, 0.5f, 1.f, 1.5f, 2.f, 2.5f, 3.f, 3.f, 0.f, 0.f };
  for (int i = 0; i < 12; ++i)
  {
    LT_CHECK_NEAR(suite, q[grid.index(i, 3, 3)], expected[i], 1e-6);
  }
  LT_CHECK(suite, q[grid.index(6, 8, 3)] == 0.f && q[grid.index(6, 7, 3)] == 2.f);

  // On a grid twice as fine: the mean of the eight voxels, so that the power is kept.
  const Grid fine{ { { 24, 20, 16 } }, { { 0.5, 0.5, 1. } } };
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-1.f, 2.f);
  Density noise(fine.size());
  for (float& value : noise)
  {
    value = uniform(random);
  }
  ImageSource finer;
  finer.values = noise.data();
  finer.grid = fine;
  finer.map.offset = { { 0.5, 0.5, 0.5 } };
  finer.map.column = { { { { 2., 0., 0. } }, { { 0., 2., 0. } }, { { 0., 0., 2. } } } };
  finer.transfer = [](double w) { return w; };
  q = compute(grid, {}, { finer });
  LT_CHECK_CLOSE(suite, powerOf(grid, q), powerOf(fine, noise), 1e-6);
  double mean = 0.;
  for (int n = 0; n < 8; ++n)
  {
    mean += noise[fine.index(6 + n % 2, 8 + n / 2 % 2, 10 + n / 4)] / 8.;
  }
  LT_CHECK_NEAR(suite, q[grid.index(3, 4, 5)], mean, 1e-6);
  LT_CHECK(suite, q == compute(grid, {}, { finer }, nullptr, testing::ThreadedFor(3)));

  // Asked to stop.
  int calls = 0;
  LT_CHECK(suite,
    ComputeSources(
      grid, {}, { finer }, q.data(), SerialFor, [&calls](double) { return ++calls < 3; })
      .cancelled);
  LT_CHECK(suite, calls == 3);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  power(suite);
  shape(suite);
  strokes(suite);
  images(suite);
  return suite.result();
}
