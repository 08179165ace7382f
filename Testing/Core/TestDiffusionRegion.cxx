// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Active regions against the solve on the whole volume: what was cut off must not show within six
 * decades, power must be accounted for, and light that fills the volume must end up on it.
 */
#include "DiffusionScene.h"
#include "LightTransportTesting.h"
#include "ThreadedFor.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <random>
#include <string>

using namespace lighttransport;
using lighttransport::testing::DiffusionScene;
using lighttransport::testing::Percentile95;
using lighttransport::testing::RelativeL2;
using lighttransport::testing::Suite;

namespace
{
struct Expected
{
  double least = 0., most = 1.; ///< of the active fraction
  double error = 1e-2;
  double largest = 0.25; ///< region
};

/** Solves on the region and on the volume, to `tolerance`, and compares. */
DiffusionReport compare(
  Suite& suite, const std::string& name, const DiffusionScene& scene, const Expected& expected)
{
  const DiffusionMedium<double> medium = scene.medium();
  DiffusionControl control;
  control.tolerance = 1e-9;
  std::vector<double> whole(scene.q.size(), 0.);
  {
    DiffusionSolver solver;
    LT_CHECK(suite, solver.setMedium(medium).reason == StopReason::Converged);
    LT_CHECK(suite,
      solver.solveSteady(scene.q.data(), whole.data(), control).reason == StopReason::Converged);
  }
  control.largestRegion = expected.largest;
  control.regionSearch = 10.;                  // small volumes: a search costs more than it gains
  std::vector<double> phi(scene.q.size(), 3.); // what was there before does not matter
  DiffusionSolver solver;
  DiffusionReport report = solver.solveActive(medium, scene.q.data(), phi.data(), control, 1e-7);
  double power = 0.;
  for (const double q : scene.q)
  {
    power += std::abs(q) * scene.grid.voxelVolume();
  }
  const double error = Percentile95(phi, whole);
  const double l2 = RelativeL2(phi, whole);
  const double lost = report.absorbed + report.escaped + report.leaked - report.emitted;
  std::cout << name << ": " << ToString(report.reason) << ", " << 100. * report.activeFraction
            << " %, " << report.iterations << " iterations, p95 " << error << ", L2 " << l2
            << ", leaked " << report.leaked / power << "\n";
  LT_CHECK(suite, report.reason == StopReason::Converged);
  LT_CHECK(
    suite, report.activeFraction >= expected.least && report.activeFraction <= expected.most);
  LT_CHECK(suite, error <= expected.error);
  LT_CHECK(suite, l2 <= 1e-3);
  LT_CHECK_NEAR(suite, lost / power, 0., 1e-6);
  LT_CHECK(suite, std::abs(report.leaked) <= 1e-3 * power);
  // the flux is the volume's where the field is, and nothing where it is not
  std::vector<float> E(3 * phi.size(), 7.f);
  solver.flux(phi.data(), E.data());
  bool dark = true;
  for (std::size_t i = 0; i < phi.size(); ++i)
  {
    dark =
      dark && (phi[i] != 0. || report.activeFraction == 1. || std::abs(E[3 * i]) < 1e-3f * power);
  }
  LT_CHECK(suite, dark);
  return report;
}

/** A vessel along a curve in [0, 1]^3 (x given, y and z of x), in tissue. */
DiffusionScene vessel(
  std::array<int, 3> dims, double radius, double inside, double wall, double sigma)
{
  DiffusionScene scene(dims, { { 1., 1., 1. } });
  const auto in = [&](double x, double y, double z)
  {
    const double t = x / dims[0];
    return std::hypot(y - dims[1] * (.5 + .25 * std::sin(5. * t)),
             z - dims[2] * (.5 + .25 * std::cos(5. * t))) < radius;
  };
  scene.fill(scene.D, [&](double x, double y, double z) { return in(x, y, z) ? 1. : wall; });
  scene.fill(
    scene.sigma_a, [&](double x, double y, double z) { return in(x, y, z) ? inside : sigma; });
  return scene;
}

void light(DiffusionScene& scene, double x, double power)
{
  const double t = x / scene.grid.dims[0];
  const int j = static_cast<int>(scene.grid.dims[1] * (.5 + .25 * std::sin(5. * t)));
  const int k = static_cast<int>(scene.grid.dims[2] * (.5 + .25 * std::cos(5. * t)));
  scene.q[scene.index(static_cast<int>(x), j, k)] += power;
}

void vessels(Suite& suite)
{
  {
    DiffusionScene scene = vessel({ { 64, 48, 48 } }, 3., 1e-3, 1e-4, 1.);
    light(scene, 26., 1.);
    compare(suite, "vessel", scene, { 0., 0.1 });
    scene.sigma_a.assign(scene.sigma_a.size(), 0.);
    DiffusionScene clear = scene; // nothing absorbs: light goes through every wall
    compare(suite, "nothing absorbs", clear, { 1., 1. });
  }
  {
    // clear inside, black outside: lost through the sides alone, which no front foresees
    DiffusionScene scene = vessel({ { 96, 44, 44 } }, 4., 0., 1e-3, 1.);
    light(scene, 20., 1.);
    compare(suite, "aorta", scene, { 0., 0.2 });
  }
  {
    // far apart, of opposite signs, one a thousand times weaker
    DiffusionScene scene = vessel({ { 96, 32, 32 } }, 2.5, 0.05, 1e-4, 1.);
    light(scene, 10., 1.);
    light(scene, 84., -1e-3);
    compare(suite, "two lights", scene, { 0., 0.12 });
    scene.q[scene.index(50, 3, 3)] = 1e-2; // and one in the dark
    compare(suite, "one in the dark", scene, { 0., 0.12 });
  }
  {
    DiffusionScene scene = vessel({ { 64, 32, 32 } }, 3., 1e-2, 1e-4, 1.);
    light(scene, 30., 1.);
    DiffusionScene turned = scene;
    for (double& q : turned.q)
    {
      q = -q;
    }
    DiffusionSolver solver;
    DiffusionControl control;
    solver.solveActive(scene.medium(), scene.q.data(), scene.phi.data(), control);
    solver.solveActive(turned.medium(), turned.q.data(), turned.phi.data(), control);
    double worst = 0.;
    for (std::size_t i = 0; i < scene.phi.size(); ++i)
    {
      worst = std::max(worst, std::abs(scene.phi[i] + turned.phi[i]));
    }
    LT_CHECK(suite, worst == 0.);
  }
}

void borders(Suite& suite)
{
  for (const Boundary boundary : { Boundary::Robin, Boundary::ZeroFlux, Boundary::Absorbing })
  {
    DiffusionScene scene({ { 40, 40, 41 } }, { { 1., 2., 0.5 } });
    scene.boundary = boundary;
    scene.sigma_a.assign(scene.q.size(), 2.);
    scene.D.back() = 0.9; // what is constant is solved at once
    scene.q[scene.index(0, 20, 40)] = 1.;
    compare(suite, "at the border", scene, { 0., 0.5 });
  }
  {
    // beside a wall of one voxel without an opening
    DiffusionScene scene({ { 40, 38, 38 } }, { { 1., 1., 1. } });
    scene.sigma_a.assign(scene.q.size(), 2.);
    scene.fill(scene.D, [](double x, double, double) { return x > 20. && x < 21. ? 0. : 1.; });
    scene.q[scene.index(19, 15, 15)] = 1.;
    compare(suite, "beside a wall", scene, { 0., 0.5 });
  }
  {
    // a closed chamber, with and without a way for light to end there
    DiffusionScene scene({ { 40, 30, 30 } }, { { 1., 1., 1. } });
    scene.fill(scene.D,
      [](double x, double y, double z)
      {
        const double r =
          std::max(std::abs(x - 12.), std::max(std::abs(y - 12.), std::abs(z - 12.)));
        return r > 5. && r < 6. ? 0. : 1.;
      });
    scene.sigma_a.assign(scene.q.size(), 1e-3);
    scene.q[scene.index(13, 12, 12)] = 1.;
    const DiffusionReport report = compare(suite, "chamber", scene, { 0., 0.05, 1e-6 });
    LT_CHECK(suite, report.leaked == 0.);
    scene.sigma_a.assign(scene.q.size(), 0.);
    DiffusionSolver solver;
    DiffusionControl control;
    LT_CHECK(suite,
      solver.solveActive(scene.medium(), scene.q.data(), scene.phi.data(), control).reason ==
        StopReason::NoSteadyState);
    scene.q[scene.index(9, 10, 14)] = -1.;
    compare(suite, "chamber, balanced", scene, { 1., 1., 1e-6 });
  }
  {
    // no part of the domain
    DiffusionScene scene({ { 32, 32, 32 } }, { { 1., 1., 1. } });
    scene.sigma_a.assign(scene.q.size(), 0.1);
    scene.outside.assign(scene.q.size(), 0);
    for (std::size_t i = 0; i < scene.outside.size(); ++i)
    {
      scene.outside[i] = (i / 32) % 32 > 15 ? 1 : 0;
    }
    scene.q[scene.index(4, 4, 4)] = 1.;
    scene.D.assign(scene.D.size(), 0.01);
    compare(suite, "half outside", scene, { 0., 0.25 });
  }
}

void thin(Suite& suite)
{
  for (const std::array<int, 3> dims : { std::array<int, 3>{ { 400, 1, 1 } },
         std::array<int, 3>{ { 1, 1, 401 } }, std::array<int, 3>{ { 1, 90, 70 } },
         std::array<int, 3>{ { 90, 70, 1 } }, std::array<int, 3>{ { 60, 2, 61 } } })
  {
    DiffusionScene scene(dims, { { 1., 1., 1. } });
    scene.sigma_a.assign(scene.q.size(), 0.5);
    scene.D[0] = 0.9; // what is constant is solved at once
    const std::int64_t middle = scene.grid.index(dims[0] / 2, dims[1] / 2, dims[2] / 2);
    scene.q[static_cast<std::size_t>(middle)] = 1.;
    DiffusionScene full = scene;
    full.solve(1e-11);
    DiffusionSolver solver;
    DiffusionControl control;
    control.tolerance = 1e-11;
    control.largestRegion = 0.9;
    control.regionSearch = 10.;
    const DiffusionReport report =
      solver.solveActive(scene.medium(), scene.q.data(), scene.phi.data(), control);
    std::cout << dims[0] << " " << dims[1] << " " << dims[2] << ": " << report.activeFraction
              << " of the voxels\n";
    LT_CHECK(suite, report.reason == StopReason::Converged && report.activeFraction < 0.9);
    LT_CHECK(suite, Percentile95(scene.phi, full.phi) < 1e-2);
    if (full.phi.size() < 500)
    {
      // along a line phi decays by e^-c per voxel with 2 (cosh c - 1) = sigma_a h^2 / D
      const double c = std::acosh(1.25);
      const std::size_t m = static_cast<std::size_t>(middle);
      LT_CHECK_CLOSE(suite, scene.phi[m + 12] / scene.phi[m], std::exp(-12. * c), 1e-6);
    }
  }
}

void open(Suite& suite)
{
  DiffusionScene scene({ { 40, 40, 40 } }, { { 1., 1., 1. } });
  scene.fill(scene.D,
    [](double x, double y, double z) { return .6 + .4 * std::sin(.5 * x) * std::cos(.4 * y + z); });
  scene.sigma_a.assign(scene.q.size(), 1e-4);
  scene.q[scene.index(20, 18, 16)] = 1.;
  compare(suite, "open", scene, { 1., 1., 1e-4 });
  DiffusionSolver solver;
  DiffusionControl control;
  control.regionOrNothing = true;
  scene.phi.assign(scene.phi.size(), 3.);
  DiffusionReport report =
    solver.solveActive(scene.medium(), scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::MaxIterations && report.activeFraction == 1.);
  LT_CHECK(
    suite, std::all_of(scene.phi.begin(), scene.phi.end(), [](double v) { return v == 0.; }));
  LT_CHECK(suite, report.fineApplications < 5.); // of about 45
  // a light of 40 voxels' reach in corridors: no straight way
  scene.fill(scene.D,
    [](double x, double y, double z)
    {
      const int i = static_cast<int>(x), j = static_cast<int>(y), k = static_cast<int>(z);
      const bool wall = i % 8 == 7 && (j + 3 * (i / 8)) % 20 > 5;
      return wall || (k % 10 == 9 && i % 16 > 3) ? 1e-6 : 1.;
    });
  scene.fill(scene.sigma_a, [](double, double, double) { return 1. / 1600.; });
  compare(suite, "corridors", scene, { 1., 1., 1e-4 });
}

/** The estimate holds what the cut costs, where the solve itself is nearly exact. */
void cuts(Suite& suite)
{
  DiffusionScene scenes[] = { vessel({ { 64, 40, 40 } }, 3., 1e-3, 1e-4, 1.),
    vessel({ { 64, 44, 44 } }, 4., 0., 1e-3, 1.), vessel({ { 64, 40, 40 } }, 3., 0.1, 0.1, 1.) };
  for (DiffusionScene& scene : scenes)
  {
    light(scene, 26., 1.);
    light(scene, 30., -0.4);
    DiffusionScene full = scene;
    full.solve(1e-12);
    for (const double threshold : { 1e-7, 1e-8, 1e-9 })
    {
      DiffusionSolver solver;
      DiffusionControl control;
      control.tolerance = 1e-11;
      control.timeBudget = 100.;
      control.regionSearch = 10.;
      control.largestRegion = 0.9;
      const DiffusionReport report =
        solver.solveActive(scene.medium(), scene.q.data(), scene.phi.data(), control, threshold);
      const double error = Percentile95(scene.phi, full.phi);
      const double l2 = RelativeL2(scene.phi, full.phi);
      std::cout << "cut at " << threshold << ": " << error << ", estimated "
                << report.estimatedError << ", L2 " << l2 << ", estimated "
                << report.estimatedErrorL2 << ", " << report.activeFraction << "\n";
      LT_CHECK(suite, report.activeFraction < 1. && report.reason == StopReason::Converged);
      LT_CHECK(
        suite, report.estimatedError > error / 4. && report.estimatedError < 4. * error + 1e-10);
      LT_CHECK(suite, report.estimatedErrorL2 > l2 / 2. && report.estimatedErrorL2 < 2. * l2);
    }
  }
}

void extremes(Suite& suite)
{
  {
    // in walls: closed, and nearly so; and close to each other, of both signs
    DiffusionScene scene = vessel({ { 48, 32, 32 } }, 3., 1e-2, 1e-4, 1.);
    light(scene, 20., 1.);
    const std::size_t closed = scene.index(30, 3, 3);
    scene.D[closed] = 0.;
    scene.q[closed] = 0.5;
    scene.q[scene.index(12, 2, 2)] = 0.5;
    compare(suite, "in walls", scene, { 0., 0.2 });
    light(scene, 21., -1.);
    light(scene, 23., -1e-4);
    compare(suite, "both signs", scene, { 0., 0.2 });
  }
  {
    // a vessel that the mask cuts
    DiffusionScene scene = vessel({ { 48, 32, 32 } }, 3., 1e-2, 1e-4, 1.);
    light(scene, 20., 1.);
    scene.outside.assign(scene.q.size(), 0);
    for (int i = 36; i < 48; ++i)
    {
      for (int row = 0; row < 32 * 32; ++row)
      {
        scene.outside[static_cast<std::size_t>(i + 48 * row)] = 1;
      }
    }
    compare(suite, "masked", scene, { 0., 0.2 });
  }
  for (const Boundary boundary : { Boundary::Robin, Boundary::ZeroFlux, Boundary::Absorbing })
  {
    // nothing absorbs: light ends at the border, or nowhere
    DiffusionScene scene = vessel({ { 40, 24, 24 } }, 3., 0., 1e-3, 0.);
    scene.boundary = boundary;
    light(scene, 20., 1.);
    if (boundary != Boundary::ZeroFlux)
    {
      compare(suite, "no sink", scene, { 0., 1., 1e-2 });
      continue;
    }
    DiffusionSolver solver;
    const DiffusionReport report =
      solver.solveActive(scene.medium(), scene.q.data(), scene.phi.data(), DiffusionControl());
    LT_CHECK(suite, report.reason == StopReason::NoSteadyState);
  }
  for (const double h : { 1e-3, 1e3 })
  {
    DiffusionScene scene = vessel({ { 40, 24, 24 } }, 3., 1e-2, 1e-4, 1.);
    scene.grid.spacing = { { 1., 1., h } };
    light(scene, 20., 1.);
    compare(suite, "flat voxels", scene, { 0., 1., 1e-2, 0.9 });
  }
  // told to stop at each question in turn: never a wrong word, never a NaN
  DiffusionScene scene = vessel({ { 64, 40, 40 } }, 3., 1e-3, 1e-4, 1.);
  light(scene, 26., 1.);
  DiffusionControl control;
  control.regionSearch = 10.;
  int cancelled = 0;
  for (int last = 0; last < 200; ++last)
  {
    int asked = 0;
    control.progress = [&](double) { return asked++ < last; };
    DiffusionSolver solver;
    const DiffusionReport report =
      solver.solveActive(scene.medium(), scene.q.data(), scene.phi.data(), control);
    LT_CHECK(suite,
      std::all_of(scene.phi.begin(), scene.phi.end(), [](double v) { return std::isfinite(v); }));
    LT_CHECK(
      suite, report.reason == (asked > last ? StopReason::Cancelled : StopReason::Converged));
    if (asked <= last)
    {
      break;
    }
    ++cancelled;
  }
  std::cout << "cancelled at each of " << cancelled << " questions\n";
  LT_CHECK(suite, cancelled > 5 && cancelled < 100);
}

/** Walls, decades and spacings drawn at random: always the same answer as on the whole. */
void anything(Suite& suite)
{
  std::mt19937 random(17);
  std::uniform_real_distribution<double> uniform(0., 1.);
  std::cout << "seed 17\n";
  int regions = 0;
  for (int scene = 0; scene < 12; ++scene)
  {
    const auto upTo = [&](int n) { return static_cast<int>(uniform(random) * n); };
    DiffusionScene any({ { 12 + upTo(20), 12 + upTo(20), 12 + upTo(20) } },
      { { 1., 0.5 + uniform(random), 0.5 + 2. * uniform(random) } });
    const double decades = 4. * uniform(random);
    const double albedo = 1. - std::pow(10., -1.5 * uniform(random));
    const double walls = scene % 3 == 0 ? 0.1 : 0.;
    for (std::size_t i = 0; i < any.D.size(); ++i)
    {
      any.D[i] = uniform(random) < walls ? 0. : std::pow(10., -decades * uniform(random));
      any.sigma_a[i] = (1. - albedo) / (3. * std::max(any.D[i], 1e-4));
    }
    for (int lights = 1 + upTo(3); lights > 0; --lights)
    {
      any.q[static_cast<std::size_t>(uniform(random) * static_cast<double>(any.q.size()))] +=
        std::pow(10., -3. * uniform(random)) * (uniform(random) < 0.3 ? -1. : 1.);
    }
    any.boundary = static_cast<Boundary>(scene % 3);
    const DiffusionReport report = compare(suite, "anything", any, { 0., 1., 1e-2, 1. });
    regions += report.activeFraction < 1. ? 1 : 0;
  }
  LT_CHECK(suite, regions > 6);
}

void control(Suite& suite)
{
  DiffusionScene scene = vessel({ { 64, 40, 40 } }, 3., 1e-3, 1e-4, 1.);
  light(scene, 26., 1.);
  DiffusionScene full = scene;
  full.solve(1e-11);
  for (const double target : { 0.1, 0.01, 1e-3, 1e-4 })
  {
    DiffusionSolver solver;
    DiffusionControl control;
    control.tolerance = 1e-12;
    control.targetError = target;
    control.regionOrNothing = true;
    control.regionSearch = 1.;
    const DiffusionReport report =
      solver.solveActive(scene.medium(), scene.q.data(), scene.phi.data(), control);
    const double error = Percentile95(scene.phi, full.phi);
    std::cout << "target " << target << ": " << error << ", estimated " << report.estimatedError
              << ", " << report.iterations << " iterations\n";
    LT_CHECK(suite, report.reason == StopReason::Converged && report.activeFraction < 0.1);
    LT_CHECK(suite, error <= target);
    LT_CHECK(suite, RelativeL2(scene.phi, full.phi) <= target);
    LT_CHECK(suite, report.estimatedError > 0. && report.estimatedError <= target);
  }
  // float arrays; shown as it comes; cancelled; late
  std::vector<float> D(scene.D.begin(), scene.D.end());
  std::vector<float> sigma(scene.sigma_a.begin(), scene.sigma_a.end());
  std::vector<float> q(scene.q.begin(), scene.q.end());
  DiffusionMedium<float> medium;
  medium.grid = scene.grid;
  medium.D = D.data();
  medium.sigma_a = sigma.data();
  DiffusionSolver solver;
  DiffusionControl control;
  int shown = 0;
  control.intermediateInterval = 0.;
  control.intermediate = [&](const double* phi)
  { shown += std::isfinite(phi[0]) && std::isfinite(phi[scene.phi.size() - 1]) ? 1 : 0; };
  DiffusionReport report = solver.solveActive(medium, q.data(), scene.phi.data(), control);
  LT_CHECK(suite, shown > 2 && report.reason == StopReason::Converged);
  LT_CHECK(suite, Percentile95(scene.phi, full.phi) < 1e-3); // of float's walls
  report = solver.solveActive(medium, scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, Percentile95(scene.phi, full.phi) < 1e-3);
  int asked = 0;
  control.progress = [&](double) { return ++asked < 3; };
  report = solver.solveActive(medium, q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Cancelled);
  LT_CHECK(suite,
    std::all_of(scene.phi.begin(), scene.phi.end(), [](double v) { return std::isfinite(v); }));
  control.progress = nullptr;
  control.timeBudget = 1e-6;
  report = solver.solveActive(medium, q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::MaxIterations && report.estimatedError > 0.);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  vessels(suite);
  borders(suite);
  thin(suite);
  open(suite);
  cuts(suite);
  extremes(suite);
  anything(suite);
  control(suite);
  return suite.result();
}
