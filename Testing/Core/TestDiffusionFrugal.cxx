// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** Only what the scene requires: active regions, named errors, budgets, cancelling. */
#include "Core/FirstMoment.h"
#include "Core/SlowError.h"
#include "DiffusionScene.h"
#include "LightTransportTesting.h"
#include "ThreadedFor.h"

#include <algorithm>
#include <chrono>
#include <random>
#include <thread>

using namespace lighttransport;
using lighttransport::testing::DiffusionScene;
using lighttransport::testing::Percentile95;
using lighttransport::testing::Suite;

namespace
{
/** A bent tube in absorbing tissue. */
DiffusionScene tube(int n, double wall, double radius = 2.5)
{
  DiffusionScene scene({ { n, n, n } }, { { 1., 1., 1. } });
  const auto inside = [n, radius](double x, double y, double z)
  {
    const double cy = n * (0.5 + 0.2 * std::sin(x * 6. / n));
    const double cz = n * (0.5 + 0.2 * std::cos(x * 6. / n));
    return std::hypot(y - cy, z - cz) < radius;
  };
  scene.fill(scene.D, [&](double x, double y, double z) { return inside(x, y, z) ? 1. : wall; });
  scene.fill(scene.sigma_a,
    [&](double x, double y, double z) { return inside(x, y, z) ? 1e-3 : 1. - wall; });
  scene.fill(scene.q,
    [&](double x, double y, double z)
    {
      return std::hypot(x - n * 0.4,
               std::hypot(
                 y - n * (0.5 + 0.2 * std::sin(2.4)), z - n * (0.5 + 0.2 * std::cos(2.4)))) < 2.
        ? 1.
        : 0.;
    });
  return scene;
}

void activeRegion(Suite& suite)
{
  for (const double sign : { 1., -1. })
  {
    DiffusionScene full = tube(96, 1e-4);
    full.q[full.index(30, 48, 70)] = sign; // somewhere else, of either sign
    DiffusionScene active = full;
    const DiffusionReport whole = full.solve(1e-9);
    DiffusionSolver solver;
    DiffusionControl control;
    control.tolerance = 1e-9;
    const DiffusionReport report =
      solver.solveActive(active.medium(), active.q.data(), active.phi.data(), control, 1e-7);
    const double error = Percentile95(active.phi, full.phi);
    std::cout << "tube: " << report.activeFraction << " of the voxels, " << report.fineApplications
              << " instead of " << whole.fineApplications << " full applications, error " << error
              << ", leaked " << report.leaked << "\n";
    LT_CHECK(suite, report.reason == StopReason::Converged);
    LT_CHECK(suite, report.activeFraction < 0.25);
    LT_CHECK(suite, report.fineApplications < 0.5 * whole.fineApplications);
    LT_CHECK(suite, error < 1e-2);
    LT_CHECK_NEAR(
      suite, report.absorbed + report.escaped + report.leaked - report.emitted, 0., 1e-6);
    // far below the error of the answer
    LT_CHECK(suite, std::abs(report.leaked) < 1e-4 * std::abs(report.emitted));
    LT_CHECK(suite, report.bytes < whole.bytes / 2);
    // flux is defined everywhere
    std::vector<double> E(3 * active.phi.size(), 7.);
    solver.flux(active.phi.data(), E.data());
    LT_CHECK(suite, E[0] == 0. && E[1] == 0. && E[2] == 0.);
  }
  {
    // Tiles in a chain are what coarse grids of a region close off: the cycle then is far too
    // long in places, and float no longer sees that it is positive.
    DiffusionScene full = tube(64, 1e-4, 4.);
    full.q.assign(full.q.size(), 0.);
    full.q[full.index(25, 40, 22)] = 1.;
    DiffusionScene active = full;
    full.solve(1e-9);
    DiffusionSolver solver;
    DiffusionControl control;
    const DiffusionReport report =
      solver.solveActive(active.medium(), active.q.data(), active.phi.data(), control, 1e-7);
    std::cout << "wide tube: " << ToString(report.reason) << ", " << report.iterations
              << " iterations\n";
    LT_CHECK(suite, report.reason == StopReason::Converged);
    LT_CHECK(suite, Percentile95(active.phi, full.phi) < 1e-2);
  }
  {
    // light that fills the volume: the full solve, and little lost on the way there
    DiffusionScene full({ { 48, 48, 48 } }, { { 1., 1., 1. } });
    full.sigma_a.assign(full.q.size(), 1e-4);
    full.D[full.index(40, 40, 40)] = 0.5; // not constant, which is solved at once
    full.q[full.index(24, 24, 24)] = 1.;
    DiffusionScene active = full;
    const DiffusionReport whole = full.solve(1e-8);
    DiffusionSolver solver;
    DiffusionControl control;
    const DiffusionReport report =
      solver.solveActive(active.medium(), active.q.data(), active.phi.data(), control);
    std::cout << "open: " << report.fineApplications << " instead of " << whole.fineApplications
              << "\n";
    LT_CHECK(suite, report.reason == StopReason::Converged && report.activeFraction == 1.);
    LT_CHECK(suite, report.fineApplications < 1.2 * whole.fineApplications);
    LT_CHECK_NEAR(suite, Percentile95(active.phi, full.phi), 0., 1e-4);
  }
  {
    // nowhere to go, no light, bad input: as the full solve
    DiffusionScene scene({ { 40, 8, 8 } }, { { 1., 1., 1. } });
    DiffusionSolver solver;
    DiffusionControl control;
    DiffusionReport report =
      solver.solveActive(scene.medium(), scene.q.data(), scene.phi.data(), control);
    LT_CHECK(suite, report.reason == StopReason::Converged);
    scene.boundary = Boundary::ZeroFlux;
    scene.q[7] = 1.;
    report = solver.solveActive(scene.medium(), scene.q.data(), scene.phi.data(), control);
    LT_CHECK(suite, report.reason == StopReason::NoSteadyState);
    scene.D[2000] = -1.;
    report = solver.solveActive(scene.medium(), scene.q.data(), scene.phi.data(), control);
    LT_CHECK(suite, report.reason == StopReason::BadInput);
  }
}

/** The error that was named is met, and the estimate is near the truth. */
void targetError(Suite& suite)
{
  std::mt19937 random(31);
  std::uniform_real_distribution<double> uniform(0., 1.);
  std::cout << "seed 31\n";
  int met = 0;
  int near = 0;
  int all = 0;
  for (int kind = 0; kind < 4; ++kind)
  {
    DiffusionScene scene = tube(40, kind % 2 ? 1e-2 : 1e-4);
    if (kind >= 2)
    {
      for (double& D : scene.D)
      {
        D *= std::pow(10., -uniform(random));
      }
      scene.sigma_a.assign(scene.q.size(), kind == 2 ? 1e-2 : 1e-3);
    }
    DiffusionScene exact = scene;
    exact.solve(1e-12);
    DiffusionSolver solver;
    solver.setMedium(scene.medium());
    for (const double target : { 0.1, 0.03, 0.01, 1e-3 })
    {
      DiffusionControl control;
      control.tolerance = 1e-12;
      control.targetError = target;
      scene.phi.assign(scene.phi.size(), 0.);
      const DiffusionReport report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
      const double error = Percentile95(scene.phi, exact.phi);
      std::cout << "kind " << kind << ", target " << target << ": " << report.iterations
                << " iterations, error " << error << ", estimated " << report.estimatedError
                << "\n";
      LT_CHECK(suite, report.reason == StopReason::Converged);
      ++all;
      met += error <= target;
      near += report.estimatedError >= error / 3. && report.estimatedError <= error * 3.;
    }
  }
  std::cout << met << " of " << all << " targets met, " << near << " estimates within 3\n";
  LT_CHECK(suite, met >= 0.9 * all);
  LT_CHECK(suite, near >= 0.9 * all);
}

/** No wrong sign in a rough answer, and no iteration for that: 0 is nearer to the exact answer. */
void signs(Suite& suite)
{
  // rooms of three voxels between walls of one, some with a door
  const int n = 40;
  DiffusionScene scene({ { n, n, n } }, { { 1., 1., 1. } });
  std::mt19937 random(5);
  std::cout << "seed 5\n";
  std::vector<unsigned> doors(1000);
  for (unsigned& door : doors)
  {
    door = static_cast<unsigned>(random());
  }
  for (int k = 0; k < n; ++k)
  {
    for (int j = 0; j < n; ++j)
    {
      for (int i = 0; i < n; ++i)
      {
        const int walls = (i % 4 == 3) + (j % 4 == 3) + (k % 4 == 3);
        const int axis = i % 4 == 3 ? 0 : j % 4 == 3 ? 1 : 2;
        const std::size_t room = static_cast<std::size_t>(i / 4 + 10 * (j / 4 + 10 * (k / 4)));
        const bool open = walls == 0 || (walls == 1 && (doors[room] >> axis & 1u));
        scene.D[scene.index(i, j, k)] = open ? 1. : 1e-6;
        scene.sigma_a[scene.index(i, j, k)] = open ? 1e-4 : 0.1;
      }
    }
  }
  scene.q[scene.index(21, 21, 21)] = 1.;
  DiffusionControl control;
  control.targetError = 0.3;
  // With a source of the other sign, too weak to be seen, nothing is said about signs.
  DiffusionScene both = scene;
  both.q[both.index(2, 2, 2)] = -1e-30;
  DiffusionReport reports[2];
  double least[2];
  DiffusionScene* const scenes[2] = { &both, &scene };
  for (int i = 0; i < 2; ++i)
  {
    DiffusionSolver solver;
    solver.setMedium(scenes[i]->medium());
    reports[i] = solver.solveSteady(scenes[i]->q.data(), scenes[i]->phi.data(), control);
    least[i] = *std::min_element(scenes[i]->phi.begin(), scenes[i]->phi.end()) /
      *std::max_element(scenes[i]->phi.begin(), scenes[i]->phi.end());
    std::cout << "least of the largest " << least[i] << ", " << reports[i].iterations
              << " iterations\n";
    LT_CHECK(suite, reports[i].reason == StopReason::Converged);
  }
  LT_CHECK(suite, least[0] < -1e-7 && least[1] >= 0.);
  LT_CHECK(suite, reports[0].iterations == reports[1].iterations);
  LT_CHECK_NEAR(suite, reports[1].residual / scene.residual(), 1., 1e-6);
}

/** What a preconditioner does not see of an error, told from conjugate gradients' own numbers. */
void slowComponents(Suite& suite)
{
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1., 1.);
  std::cout << "seed 7\n";
  // the part of the slow components in the error, their eigenvalue of B A
  const double kinds[4][2] = { { 0., 1. }, { .3, .1 }, { .3, .02 }, { 1., .05 } };
  for (const auto& kind : kinds)
  {
    // B A is diagonal: most eigenvalues are near 1, a tenth of them near theta
    std::vector<double> lambda(400), e(400), z(400), p(400, 0.);
    for (std::size_t i = 0; i < e.size(); ++i)
    {
      const bool slow = i % 10 == 0;
      lambda[i] = (slow ? kind[1] : 1.) * (1. + .1 * uniform(random));
      e[i] = uniform(random) * (slow ? 3. : 1.) * (slow ? kind[0] : 1.);
    }
    SlowError told;
    double most = 1.;
    for (int k = 0; k < 8; ++k)
    {
      double rz = 0., energy = 0., before = 0.;
      for (std::size_t i = 0; i < e.size(); ++i)
      {
        before += z[i] * z[i];
        z[i] = lambda[i] * e[i];
        rz += z[i] * z[i];
      }
      const double factor = told.factor(rz);
      most = std::max(most, factor);
      LT_CHECK(suite, factor >= 1. && factor < 1.3 / kind[1]); // no component is slower
      for (std::size_t i = 0; i < e.size(); ++i)
      {
        p[i] = z[i] + (k ? rz / before * p[i] : 0.);
        energy += p[i] * lambda[i] * p[i];
      }
      const double alpha = rz / energy;
      for (std::size_t i = 0; i < e.size(); ++i)
      {
        e[i] -= alpha * p[i];
      }
      told.add(alpha, rz, k == 0);
    }
    std::cout << "slow part " << kind[0] << " of " << kind[1] << ": " << most << "\n";
    LT_CHECK(suite, kind[1] == 1. || most > 1.8);
  }
}

/**
 * Fields on the way: at the rate of the rule, by a clock of the test's own; finite and nearer to
 * the answer from one to the next; and after a cancel the one that was shown last.
 */
void intermediate(Suite& suite)
{
  // 40 steps of a second each: step k is judged when k - 1 seconds are told
  DiffusionScene scene({ { 12, 10, 9 } }, { { 1., 1., 1. } });
  scene.sigma_a.assign(scene.q.size(), 1e-2);
  scene.D[7] = 0.5;
  scene.q[200] = 1.;
  DiffusionSolver solver;
  FirstMomentSolver moment;
  solver.setMedium(scene.medium());
  moment.setMedium(scene.medium());
  constexpr int steps = 40;
  const double bound = solver.positivityBound();
  for (const double interval : { 0., 1., 3., 5., 12.5, 39., 40. })
  {
    for (int kind = 0; kind < 4; ++kind)
    {
      DiffusionControl control;
      control.tolerance = 1e-13;
      double seconds = 0.;
      int shown = 0;
      control.progress = [&](double fraction)
      {
        // implicit steps tell parts of a step as well; its last part comes after it was shown
        seconds = std::floor(steps * fraction + 1e-9);
        return true;
      };
      control.clock = [&] { return seconds; };
      control.intermediateInterval = interval;
      control.intermediate = [&](const double* phi) { shown += phi[200] > 0. ? 1 : 0; };
      std::vector<double> phi(scene.phi.size(), 0.);
      const DiffusionReport report = kind == 0
        ? solver.stepExplicit(scene.q.data(), phi.data(), steps, bound, control)
        : kind == 1 ? solver.stepLocal(scene.q.data(), phi.data(), steps, 1., control)
        : kind == 2 ? solver.stepImplicit(scene.q.data(), phi.data(), steps, bound, control)
                    : static_cast<DiffusionReport>(moment.step(
                        scene.q.data(), phi.data(), steps, moment.courantBound(), control));
      LT_CHECK(suite, report.reason == StopReason::MaxIterations);
      const int expected =
        interval == 0. ? steps : static_cast<int>((steps - 1) / std::ceil(interval));
      suite.check(shown == expected,
        "kind " + std::to_string(kind) + ", every " + std::to_string(interval) +
          " s: " + std::to_string(shown) + " of " + std::to_string(expected),
        __FILE__, __LINE__);
    }
  }

  // steady: each is nearer to the answer
  DiffusionScene hard = tube(40, 1e-5);
  DiffusionSolver steady;
  steady.setMedium(hard.medium());
  DiffusionControl exactly;
  exactly.tolerance = 1e-13;
  std::vector<double> answer(hard.phi.size(), 0.);
  steady.solveSteady(hard.q.data(), answer.data(), exactly);
  std::vector<double> errors;
  DiffusionControl control;
  control.intermediateInterval = 0.;
  std::vector<double> shown;
  bool finite = true;
  std::size_t stopAt = 0;
  bool stop = false;
  control.intermediate = [&](const double* phi)
  {
    shown.assign(phi, phi + answer.size());
    double wrong = 0.;
    double all = 0.;
    for (std::size_t i = 0; i < answer.size(); ++i)
    {
      finite = finite && std::isfinite(phi[i]);
      wrong += (phi[i] - answer[i]) * (phi[i] - answer[i]);
      all += answer[i] * answer[i];
    }
    errors.push_back(std::sqrt(wrong / all));
    stop = errors.size() == stopAt;
  };
  control.progress = [&](double) { return !stop; };
  const DiffusionReport report = steady.solveSteady(hard.q.data(), hard.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged && finite && errors.size() >= 4);
  for (std::size_t i = 1; i < errors.size(); ++i)
  {
    LT_CHECK(suite, errors[i] < errors[i - 1]);
  }
  std::cout << "shown after each iteration: L2 error " << errors.front() << " to " << errors.back()
            << "\n";
  for (const std::size_t at : { std::size_t(1), std::size_t(3) })
  {
    errors.clear();
    stopAt = at;
    hard.phi.assign(hard.phi.size(), 0.);
    const DiffusionReport cancelled = steady.solveSteady(hard.q.data(), hard.phi.data(), control);
    stop = false;
    LT_CHECK(suite, cancelled.reason == StopReason::Cancelled);
    LT_CHECK(suite, cancelled.iterations == static_cast<int>(at));
    LT_CHECK(suite, hard.phi == shown);
    LT_CHECK(suite, !cancelled.message.empty());
    LT_CHECK_CLOSE(suite, cancelled.residual, hard.residual(), 0.02);
  }
}

void budget(Suite& suite)
{
  DiffusionScene scene = tube(48, 1e-6);
  DiffusionSolver solver;
  solver.setMedium(scene.medium());
  DiffusionControl control;
  control.timeBudget = 1e-6;
  DiffusionReport report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::MaxIterations);
  LT_CHECK(suite, report.message.find("budget") != std::string::npos);
  LT_CHECK(suite, report.estimatedError > 0. && report.iterations >= 1);

  int shown = 0;
  control.timeBudget = 0.;
  control.intermediateInterval = 0.;
  control.intermediate = [&](const double* phi) { shown += std::isfinite(phi[0]) ? 1 : 0; };
  scene.phi.assign(scene.phi.size(), 0.);
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, shown >= report.iterations - 1 && shown > 2);
}

/** Whatever the threads: the same field of a region, the same estimate, the same stop. */
void threads(Suite& suite)
{
  const DiffusionScene scene = tube(64, 1e-4, 10.);
  const auto solve = [&](const ParallelFor& parallelFor, bool active, std::vector<double>& phi)
  {
    phi = scene.phi;
    DiffusionSolver solver(parallelFor);
    DiffusionControl control;
    control.progress = [](double) { return true; };
    if (active)
    {
      control.largestRegion = 1.;
      control.regionSearch = 10.; // whether it pays or not
      return solver.solveActive(scene.medium(), scene.q.data(), phi.data(), control, 1e-3);
    }
    solver.setMedium(scene.medium());
    control.targetError = 0.03;
    return solver.solveSteady(scene.q.data(), phi.data(), control);
  };
  for (const bool active : { true, false })
  {
    std::vector<double> together;
    const DiffusionReport three = solve(lighttransport::testing::ThreadedFor(3), active, together);
    std::cout << "threads: " << three.activeFraction << " of the voxels\n";
    LT_CHECK(suite, three.reason == StopReason::Converged);
    LT_CHECK(suite, (three.activeFraction < 1.) == active);
    LT_CHECK(suite, three.activeFraction * 262144. > 32768.); // worth a thread
    if (!lighttransport::testing::LookingForRaces)
    {
      std::vector<double> alone;
      const DiffusionReport one = solve(SerialFor, active, alone);
      LT_CHECK(suite, three.estimatedError == one.estimatedError);
      LT_CHECK(suite, together == alone);
    }
  }
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  threads(suite);
  if (lighttransport::testing::LookingForRaces)
  {
    return suite.result();
  }
  activeRegion(suite);
  targetError(suite);
  signs(suite);
  slowComponents(suite);
  intermediate(suite);
  budget(suite);
  return suite.result();
}
