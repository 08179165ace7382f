// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A constant medium is solved at once: against the equations, closed forms and the iterations,
 * which an empty mask of what is outside brings about.
 */
#include "DiffusionScene.h"
#include "LightTransportTesting.h"
#include "ThreadedFor.h"

#include <random>

using namespace lighttransport;
using lighttransport::testing::DiffusionScene;
using lighttransport::testing::Largest;
using lighttransport::testing::LargestDifference;
using lighttransport::testing::LookingForRaces;
using lighttransport::testing::Suite;

namespace
{
const Boundary Boundaries[] = { Boundary::Robin, Boundary::ZeroFlux, Boundary::Absorbing };

DiffusionScene sceneOf(std::array<int, 3> dims, std::array<double, 3> spacing, Boundary boundary,
  double D = 0.4, double sigma = 0.01)
{
  DiffusionScene scene(dims, spacing);
  scene.boundary = boundary;
  scene.refractiveIndexRatio = 1.4;
  scene.D.assign(scene.D.size(), D);
  scene.sigma_a.assign(scene.D.size(), sigma);
  std::mt19937 random(17);
  std::uniform_real_distribution<double> uniform(-0.2, 1.);
  for (double& q : scene.q)
  {
    q = uniform(random);
  }
  return scene;
}

/** The equations, as DiffusionScene has them, on shapes and spacings of all kinds. */
void equations(Suite& suite)
{
  double worst = 0.;
  for (const Boundary boundary : Boundaries)
  {
    for (const std::array<int, 3>& dims : { std::array<int, 3>{ { 1, 1, 1 } },
           std::array<int, 3>{ { 2, 1, 1 } }, std::array<int, 3>{ { 1, 97, 1 } },
           std::array<int, 3>{ { 1, 1, 513 } }, std::array<int, 3>{ { 31, 1, 30 } },
           std::array<int, 3>{ { 1, 16, 17 } }, std::array<int, 3>{ { 3, 5, 7 } },
           std::array<int, 3>{ { 34, 33, 9 } }, std::array<int, 3>{ { 2, 100, 3 } } })
    {
      for (const std::array<double, 3>& spacing : { std::array<double, 3>{ { 1., 0.7, 1.9 } },
             std::array<double, 3>{ { 1., 1000., 1. } }, std::array<double, 3>{ { 50., 1., 7. } } })
      {
        DiffusionScene scene = sceneOf(dims, spacing, boundary);
        const DiffusionReport report = scene.solve(1e-11);
        const double residual = scene.residual();
        const bool solved = report.reason == StopReason::Converged && residual <= 1.1e-11;
        std::string name = "boundary " + std::to_string(static_cast<int>(boundary));
        for (int d = 0; d < 3; ++d)
        {
          name += ", " + std::to_string(dims[d]) + " by " + std::to_string(spacing[d]);
        }
        suite.check(solved && report.iterations <= 2, name, __FILE__, __LINE__);
        LT_CHECK_CLOSE(suite, report.absorbed + report.escaped, report.emitted, 1e-9);
        worst = std::max(worst, residual);
      }
    }
  }
  std::cout << "largest residual " << worst << "\n";
}

/** A cosine between mirrors, a sine between dark walls: eigenvectors with known eigenvalues. */
void eigenvectors(Suite& suite)
{
  const double pi = std::acos(-1.);
  for (const Boundary boundary : { Boundary::ZeroFlux, Boundary::Absorbing })
  {
    const int n = 40;
    const double h = 0.3;
    DiffusionScene scene = sceneOf({ { n, 6, n } }, { { h, 1., h } }, boundary);
    const bool mirrors = boundary == Boundary::ZeroFlux;
    const auto mode = [&](double x, double, double z)
    {
      const double a = 3. * pi * x / (n * h);
      const double b = 8. * pi * z / (n * h);
      return mirrors ? std::cos(a) * std::cos(b) : std::sin(a) * std::sin(b);
    };
    const auto eigenvalue = [&](double k, double length, double step)
    { return 0.4 * std::pow(2. * std::sin(0.5 * k * pi * step / length) / step, 2.); };
    // between dark walls, one half wave along y
    const double lambda = 0.01 + eigenvalue(3., n * h, h) + eigenvalue(8., n * h, h) +
      (mirrors ? 0. : eigenvalue(1., 6., 1.));
    const auto exact = [&](double x, double y, double z)
    { return mode(x, y, z) * (mirrors ? 1. : std::sin(pi * y / 6.)); };
    scene.fill(scene.q, [&](double x, double y, double z) { return lambda * exact(x, y, z); });
    LT_CHECK(suite, scene.solve(1e-12).reason == StopReason::Converged);
    LT_CHECK_NEAR(suite, scene.worst(exact), 0., 1e-12);
  }
}

/** What iterations on stored faces answer; the same bounds, steps and flux. */
void iterations(Suite& suite)
{
  for (const Boundary boundary : Boundaries)
  {
    for (const std::array<int, 3>& dims :
      { std::array<int, 3>{ { 23, 20, 18 } }, std::array<int, 3>{ { 2, 1, 19 } } })
    {
      DiffusionScene scene = sceneOf(dims, { { 1., 0.7, 1.9 } }, boundary);
      const std::vector<std::uint8_t> nothing(scene.q.size(), 0);
      DiffusionMedium<double> masked = scene.medium();
      masked.outside = nothing.data();
      DiffusionSolver direct;
      DiffusionSolver iterative;
      LT_CHECK(suite, direct.setMedium(scene.medium()).reason == StopReason::Converged);
      LT_CHECK(suite, iterative.setMedium(masked).reason == StopReason::Converged);
      LT_CHECK(suite, direct.positivityBound() == iterative.positivityBound());
      LT_CHECK(suite, direct.stabilityBound() == iterative.stabilityBound());
      DiffusionControl control;
      control.tolerance = 1e-12;
      std::vector<double> one = scene.phi;
      std::vector<double> other = scene.phi;
      const DiffusionReport at = direct.solveSteady(scene.q.data(), one.data(), control);
      const DiffusionReport by = iterative.solveSteady(scene.q.data(), other.data(), control);
      LT_CHECK(suite, at.reason == StopReason::Converged && by.reason == StopReason::Converged);
      LT_CHECK_NEAR(suite, LargestDifference(one, other) / Largest(other), 0., 1e-9);
      LT_CHECK_CLOSE(suite, at.escaped, by.escaped, 1e-8);
      std::vector<double> E(3 * one.size());
      std::vector<double> F(3 * one.size());
      direct.flux(one.data(), E.data());
      iterative.flux(one.data(), F.data());
      LT_CHECK_NEAR(suite, LargestDifference(E, F) / Largest(F), 0., 1e-6); // float faces
      // a region of it is no less work than all of it
      std::vector<double> region = scene.phi;
      DiffusionSolver active;
      const DiffusionReport all =
        active.solveActive(scene.medium(), scene.q.data(), region.data(), control);
      LT_CHECK(suite, all.reason == StopReason::Converged && all.activeFraction == 1.);
      LT_CHECK(suite, region == one);
      // steps have the faces made, and a steady answer is the same afterwards
      direct.stepExplicit(scene.q.data(), one.data(), 3, direct.positivityBound(), control);
      iterative.stepExplicit(scene.q.data(), other.data(), 3, direct.positivityBound(), control);
      LT_CHECK_NEAR(suite, LargestDifference(one, other) / Largest(other), 0., 1e-9);
      for (const ImplicitScheme scheme :
        { ImplicitScheme::BackwardEuler, ImplicitScheme::SecondOrder })
      {
        control.implicitScheme = scheme;
        direct.stepImplicit(scene.q.data(), one.data(), 5, 10., control);
        iterative.stepImplicit(scene.q.data(), other.data(), 5, 10., control);
        LT_CHECK_NEAR(
          suite, LargestDifference(one, other) / Largest(other), 0., 1e-6); // float faces
      }
      const DiffusionReport again = direct.solveSteady(scene.q.data(), one.data(), control);
      LT_CHECK(suite, again.reason == StopReason::Converged);
      LT_CHECK_NEAR(suite, LargestDifference(one, region) / Largest(region), 0., 1e-11);
    }
  }
}

/** Implicit steps, all at once: each solves its equation, N are N, and they end where light does.
 */
void steps(Suite& suite)
{
  const double gamma = 1. - std::sqrt(0.5);
  const auto difference = [](const std::vector<double>& a, const std::vector<double>& b)
  { return LargestDifference(a, b) / Largest(b); };
  DiffusionControl control;
  control.tolerance = 1e-13;
  double worst = 0.;
  for (const Boundary boundary : Boundaries)
  {
    for (const std::array<int, 3>& dims : { std::array<int, 3>{ { 1, 1, 1 } },
           std::array<int, 3>{ { 1, 40, 1 } }, std::array<int, 3>{ { 23, 20, 18 } } })
    {
      for (const double cdt : { 1e-3, 1., 1e4 })
      {
        DiffusionScene scene = sceneOf(dims, { { 1., 0.7, 1.9 } }, boundary);
        for (std::size_t i = 0; i < scene.phi.size(); ++i)
        {
          scene.phi[i] = scene.q[scene.q.size() - 1 - i];
        }
        DiffusionSolver solver;
        solver.setMedium(scene.medium());
        const auto march = [&](std::vector<double> phi, ImplicitScheme scheme, int count, double by)
        {
          control.implicitScheme = scheme;
          solver.stepImplicit(scene.q.data(), phi.data(), count, by, control);
          return phi;
        };
        // backward Euler against its equation, written as a steady one with 1 / (c dt) more to
        // absorb
        const auto euler = [&](const std::vector<double>& from, double by)
        {
          DiffusionScene step = scene;
          step.phi = march(from, ImplicitScheme::BackwardEuler, 1, by);
          for (std::size_t i = 0; i < from.size(); ++i)
          {
            step.sigma_a[i] += 1. / by;
            step.q[i] += from[i] / by;
          }
          worst = std::max(worst, step.residual());
          return step.phi;
        };
        // SDIRK2 is two of these
        std::vector<double> first = euler(scene.phi, gamma * cdt);
        for (std::size_t i = 0; i < first.size(); ++i)
        {
          first[i] = scene.phi[i] + (1. - gamma) / gamma * (first[i] - scene.phi[i]);
        }
        LT_CHECK_NEAR(suite,
          difference(
            march(scene.phi, ImplicitScheme::SecondOrder, 1, cdt), euler(first, gamma * cdt)),
          0., 1e-11);
        for (const ImplicitScheme scheme :
          { ImplicitScheme::BackwardEuler, ImplicitScheme::SecondOrder })
        {
          std::vector<double> singly = scene.phi;
          for (int i = 0; i < 13; ++i)
          {
            singly = march(singly, scheme, 1, cdt);
          }
          LT_CHECK_NEAR(suite, difference(march(scene.phi, scheme, 13, cdt), singly), 0., 1e-11);
        }
      }
    }
  }
  std::cout << "largest residual of a step " << worst << "\n";
  LT_CHECK(suite, worst < 1e-12);

  // closed form: a cosine between mirrors decays by the schemes' factors, and the mean, where
  // nothing absorbs, grows by what is emitted
  const int n = 40;
  const double h = 0.3;
  DiffusionScene scene = sceneOf({ { n, 6, 5 } }, { { h, 1., 1. } }, Boundary::ZeroFlux, 0.4, 0.);
  scene.q.assign(scene.q.size(), 2.);
  DiffusionSolver solver;
  solver.setMedium(scene.medium());
  const double pi = std::acos(-1.);
  const double lambda = 0.4 * std::pow(2. * std::sin(1.5 * pi / n) / h, 2.);
  const auto mode = [&](double x, double, double) { return std::cos(3. * pi * x / (n * h)); };
  for (const double z : { 1e-6, 0.1, 3., 1e5 })
  {
    const double cdt = z / lambda;
    for (const bool second : { false, true })
    {
      control.implicitScheme = second ? ImplicitScheme::SecondOrder : ImplicitScheme::BackwardEuler;
      const double R = second ? (1. - (1. - 2. * gamma) * z) / ((1. + gamma * z) * (1. + gamma * z))
                              : 1. / (1. + z);
      scene.fill(scene.phi, mode);
      const DiffusionReport report =
        solver.stepImplicit(scene.q.data(), scene.phi.data(), 20, cdt, control);
      LT_CHECK(suite, report.reason == StopReason::MaxIterations && report.iterations == 1);
      const double mean = 20. * cdt * 2.;
      LT_CHECK_NEAR(suite,
        scene.worst(
          [&](double x, double y, double w) { return mean + std::pow(R, 20) * mode(x, y, w); }),
        0., 1e-12 * (1. + mean));
      LT_CHECK_CLOSE(suite, report.residual, 1., std::pow(R, 20) + 1e-9); // the mean is not steady
    }
  }

  // the steady state, reached in many steps or in long ones; said so only where it is
  DiffusionScene lit = sceneOf({ { 33, 32, 31 } }, { { 1., 1., 1. } }, Boundary::Robin);
  for (double& q : lit.q)
  {
    q = std::abs(q);
  }
  DiffusionScene steady = lit;
  steady.solve(1e-13);
  solver.setMedium(lit.medium());
  const double bound = solver.positivityBound();
  control = DiffusionControl();
  for (const bool second : { false, true })
  {
    control.implicitScheme = second ? ImplicitScheme::SecondOrder : ImplicitScheme::BackwardEuler;
    for (const int length : { 10, 1000 })
    {
      control.tolerance = 1e-11;
      const auto run = [&](int count)
      {
        lit.phi.assign(lit.phi.size(), 0.);
        return solver.stepImplicit(lit.q.data(), lit.phi.data(), count, length * bound, control);
      };
      DiffusionReport report = run(2);
      LT_CHECK(suite, report.reason == StopReason::MaxIterations && report.residual > 1e-5);
      LT_CHECK(suite, *std::min_element(lit.phi.begin(), lit.phi.end()) > 0.);
      report = run(100000 / length);
      LT_CHECK(suite, report.reason == StopReason::Converged && report.residual <= 1e-11);
      LT_CHECK_NEAR(suite, lit.residual(), report.residual, 1e-12);
      LT_CHECK_NEAR(suite, difference(lit.phi, steady.phi), 0., 1e-9);
      const std::vector<double> before = lit.phi;
      report = solver.stepImplicit(lit.q.data(), lit.phi.data(), 7, length * bound, control);
      LT_CHECK(suite, report.reason == StopReason::Converged && report.iterations == 0);
      LT_CHECK(suite, lit.phi == before);
      // more than double can give: by the reason, and the best there is
      control.tolerance = 1e-19;
      report = run(100000 / length);
      LT_CHECK(suite, report.reason == StopReason::Breakdown && report.residual < 1e-12);
      LT_CHECK_NEAR(suite, difference(lit.phi, steady.phi), 0., 1e-10);
    }
  }

  // cancelled: the field before; what is held: phi and a value more; beyond double: said
  control.tolerance = 1e-10;
  lit.phi.assign(lit.phi.size(), 0.25);
  const std::vector<double> before = lit.phi;
  control.progress = [](double fraction) { return fraction < 0.5; };
  DiffusionReport report = solver.stepImplicit(lit.q.data(), lit.phi.data(), 5, bound, control);
  LT_CHECK(suite, report.reason == StopReason::Cancelled && lit.phi == before);
  LT_CHECK(suite, report.residual < 0.);
  control.progress = nullptr;
  int shown = 0;
  control.intermediate = [&](const double* phi) { shown += phi[0] != 0.25 ? 1 : 0; };
  control.intermediateInterval = 0.;
  report = solver.stepImplicit(lit.q.data(), lit.phi.data(), 5, bound, control);
  LT_CHECK(suite, report.reason == StopReason::MaxIterations && shown == 1);
  LT_CHECK(suite, report.bytes < 18 * lit.grid.size());
  control.maxIterations = 0;
  report = solver.stepImplicit(lit.q.data(), lit.phi.data(), 5, bound, control);
  LT_CHECK(suite, report.reason == StopReason::Breakdown && !report.message.empty());
  control.maxIterations = 5;
  for (const double cdt : { 1e250, 1e305 })
  {
    scene.q.assign(scene.q.size(), 1e100);
    scene.phi.assign(scene.phi.size(), 1.);
    solver.setMedium(scene.medium());
    report = solver.stepImplicit(scene.q.data(), scene.phi.data(), 5, cdt, control);
    LT_CHECK(suite, report.reason == StopReason::NotFinite && scene.phi[0] == 1.);
  }
}

void reports(Suite& suite)
{
  DiffusionScene scene = sceneOf({ { 40, 41, 42 } }, { { 1., 1., 1. } }, Boundary::Robin);
  DiffusionSolver solver;
  const DiffusionReport set = solver.setMedium(scene.medium());
  LT_CHECK(suite, set.bytes < 4 * scene.grid.size()); // matrices of 20 x 20, and no faces
  DiffusionControl control;
  control.tolerance = 1e-10;
  DiffusionReport report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged && report.iterations == 1);
  LT_CHECK(suite, report.estimatedError < 0.);
  LT_CHECK(suite, report.bytes == 16 * scene.grid.size() + set.bytes); // phi and a value more
  const std::vector<double> answer = scene.phi;
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged && report.iterations == 0);
  LT_CHECK(suite, scene.phi == answer);
  // from somewhere else
  for (double& phi : scene.phi)
  {
    phi *= 3.;
  }
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged);
  LT_CHECK_NEAR(suite, LargestDifference(scene.phi, answer) / Largest(answer), 0., 1e-12);

  // an error that was asked for is told, and is the error
  control.targetError = 0.01;
  scene.phi.assign(scene.phi.size(), 0.);
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged);
  LT_CHECK(suite, report.estimatedError >= 0. && report.estimatedError < 1e-10);
  control.targetError = 0.;

  // cancelled at each of some points: what was there stays
  for (const int calls : { 1, 2, 3, 4 })
  {
    control.progress = [&](double fraction) { return fraction <= 1. && fraction < 0.3 * calls; };
    scene.phi.assign(scene.phi.size(), 0.25);
    report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
    LT_CHECK(suite, report.reason == (calls < 4 ? StopReason::Cancelled : StopReason::Converged));
    LT_CHECK(suite, (scene.phi == std::vector<double>(scene.phi.size(), 0.25)) == (calls < 4));
  }
  control.progress = nullptr;

  // nothing to do, no iteration allowed, more than double can give, no number
  control.maxIterations = 0;
  scene.phi.assign(scene.phi.size(), 0.);
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::MaxIterations && report.residual == 1.);
  control.maxIterations = 500;
  control.tolerance = 1e-19;
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Breakdown && report.residual < 1e-13);
  LT_CHECK(suite, report.iterations < 10);
  LT_CHECK_NEAR(suite, LargestDifference(scene.phi, answer) / Largest(answer), 0., 1e-11);
  const std::vector<double> dark(scene.q.size(), 0.);
  report = solver.solveSteady(dark.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged && Largest(scene.phi) == 0.);
  {
    const Suite::WithoutTraps quiet;
    scene.q[7] = std::numeric_limits<double>::infinity();
    report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
    LT_CHECK(suite, report.reason == StopReason::NotFinite);
  }
}

/** Mirrors and no absorption; nearly none; lengths and powers far from 1. */
void extremes(Suite& suite)
{
  DiffusionScene scene = sceneOf({ { 20, 17, 13 } }, { { 1., 1., 2. } }, Boundary::ZeroFlux);
  scene.sigma_a.assign(scene.q.size(), 0.);
  DiffusionReport report = scene.solve(1e-10);
  LT_CHECK(suite, report.reason == StopReason::NoSteadyState);
  scene.q.assign(scene.q.size(), 0.);
  scene.q[100] = 1.;
  scene.q[2000] = -1.;
  report = scene.solve(1e-10);
  double mean = 0.;
  for (const double phi : scene.phi)
  {
    mean += phi;
  }
  LT_CHECK(suite, report.reason == StopReason::Converged && scene.residual() <= 1.1e-10);
  LT_CHECK_NEAR(suite, mean, 0., 1e-9);

  // the mean is power / (sigma_a V): up to where phi's rounding is seen in A phi, and beyond
  for (const double sigma : { 1e-8, 1e-14 })
  {
    scene.sigma_a.assign(scene.q.size(), sigma);
    scene.q[2000] = 0.;
    scene.phi.assign(scene.q.size(), 0.);
    report = scene.solve(1e-7);
    LT_CHECK(
      suite, report.reason == (sigma > 1e-10 ? StopReason::Converged : StopReason::Breakdown));
    mean = 0.;
    for (const double phi : scene.phi)
    {
      mean += phi / static_cast<double>(scene.phi.size());
    }
    LT_CHECK_CLOSE(suite, mean, 1. / (sigma * 20. * 17. * 13.), 1e-9);
  }

  for (const double u : { 1e-9, 1e9 })
  {
    for (const double power : { 1e-100, 1e100 })
    {
      for (const Boundary boundary : Boundaries)
      {
        DiffusionScene far =
          sceneOf({ { 15, 16, 9 } }, { { u, 2. * u, u } }, boundary, 0.4 * u, 0.01 / u);
        for (double& q : far.q)
        {
          q = power * std::abs(q) / u;
        }
        const DiffusionReport solved = far.solve(1e-10);
        LT_CHECK(suite, solved.reason == StopReason::Converged);
        LT_CHECK(suite, far.residual() <= 1.1e-10 || power < 1.); // its squares underflow here
        LT_CHECK_CLOSE(suite, solved.absorbed + solved.escaped, solved.emitted, 1e-9);
        LT_CHECK(suite, *std::min_element(far.phi.begin(), far.phi.end()) > 0.);
      }
    }
  }
  // light that falls by many decades: nowhere negative beyond rounding
  DiffusionScene dense = sceneOf({ { 64, 8, 8 } }, { { 1., 1., 1. } }, Boundary::Robin, 0.1, 3.);
  dense.q.assign(dense.q.size(), 0.);
  dense.q[0] = 1.;
  LT_CHECK(suite, dense.solve(1e-10).reason == StopReason::Converged);
  LT_CHECK(
    suite, *std::min_element(dense.phi.begin(), dense.phi.end()) >= -1e-13 * Largest(dense.phi));
}

/** Whatever the threads, to the bit. */
void threads(Suite& suite)
{
  DiffusionScene one = sceneOf({ { 70, 33, 29 } }, { { 1., 1., 1. } }, Boundary::Robin);
  DiffusionScene three = one;
  LT_CHECK(suite, one.solve(1e-8).reason == StopReason::Converged);
  three.solve(1e-8, lighttransport::testing::ThreadedFor(3));
  LT_CHECK(suite, one.phi == three.phi);
  DiffusionSolver serial;
  DiffusionSolver threaded(lighttransport::testing::ThreadedFor(3));
  serial.setMedium(one.medium());
  threaded.setMedium(three.medium());
  serial.stepImplicit(one.q.data(), one.phi.data(), 7, 3., DiffusionControl());
  threaded.stepImplicit(three.q.data(), three.phi.data(), 7, 3., DiffusionControl());
  LT_CHECK(suite, one.phi == three.phi);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  threads(suite);
  if (LookingForRaces)
  {
    return suite.result();
  }
  equations(suite);
  eigenvectors(suite);
  iterations(suite);
  steps(suite);
  reports(suite);
  extremes(suite);
  return suite.result();
}
