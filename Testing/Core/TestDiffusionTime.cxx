// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** Time steps: exact decay of eigenmodes, bounds, positivity, the steady state reached. */
#include "DiffusionScene.h"
#include "LightTransportTesting.h"
#include "ThreadedFor.h"

#include <chrono>
#include <random>
#include <thread>

using namespace lighttransport;
using lighttransport::testing::DiffusionScene;
using lighttransport::testing::Suite;

namespace
{
const double Pi = std::acos(-1.);

/** A cosine between mirrors is an eigenvector: each step multiplies it by a known factor. */
void eigenmode(Suite& suite)
{
  const int n = 24;
  const double h = 0.5;
  const double D = 0.8;
  const double sigma = 0.3;
  DiffusionScene scene({ { n, 1, 6 } }, { { h, 1., 1. } });
  scene.boundary = Boundary::ZeroFlux;
  scene.D.assign(scene.D.size(), D);
  scene.sigma_a.assign(scene.D.size(), sigma);
  const double k = 3.;
  const auto mode = [&](double x, double, double) { return std::cos(k * Pi * x / (n * h)); };
  const double lambda = sigma + D * (2. - 2. * std::cos(Pi * k / n)) / (h * h);

  DiffusionSolver solver;
  LT_CHECK(suite, solver.setMedium(scene.medium()).reason == StopReason::Converged);
  DiffusionControl control;
  control.tolerance = 1e-13;
  const double bound = solver.positivityBound();
  LT_CHECK_CLOSE(suite, bound, 1. / (2. * D / (h * h) + 2. * D + sigma), 1e-6);
  LT_CHECK_CLOSE(suite, solver.stabilityBound(), 2. / (4. * D / (h * h) + 4. * D + sigma), 1e-6);

  const int steps = 7;
  scene.fill(scene.phi, mode);
  DiffusionReport report = solver.stepExplicit(
    static_cast<const double*>(nullptr), scene.phi.data(), steps, bound, control);
  LT_CHECK(suite, report.reason == StopReason::MaxIterations && report.iterations == steps);
  double factor = std::pow(1. - lambda * bound, steps);
  LT_CHECK_NEAR(suite,
    scene.worst([&](double x, double y, double z) { return factor * mode(x, y, z); }), 0., 1e-6);

  for (const double cdt : { 0.1 * bound, 50. * bound, 1e5 * bound })
  {
    scene.fill(scene.phi, mode);
    report = solver.stepImplicit(
      static_cast<const double*>(nullptr), scene.phi.data(), steps, cdt, control);
    factor = std::pow(1. + lambda * cdt, -steps);
    LT_CHECK_NEAR(suite,
      scene.worst([&](double x, double y, double z) { return factor * mode(x, y, z); }), 0., 1e-6);
  }
  // the shift of the implicit steps is gone again
  scene.q.assign(scene.q.size(), 1.);
  scene.phi.assign(scene.phi.size(), 0.);
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK_NEAR(suite, scene.worst([&](double, double, double) { return 1. / sigma; }), 0., 1e-6);
}

DiffusionScene randomScene(unsigned int seed, std::array<int, 3> dims, double decades)
{
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0., 1.);
  DiffusionScene scene(dims, { { 1., 1.5, 0.8 } });
  for (std::size_t i = 0; i < scene.D.size(); ++i)
  {
    scene.D[i] = std::pow(10., -decades * uniform(random));
    scene.sigma_a[i] = 0.1 * uniform(random);
    scene.q[i] = uniform(random) < 0.02 ? 1. : 0.;
  }
  return scene;
}

void steadyReached(Suite& suite)
{
  std::cout << "seeds 5, 6\n";
  DiffusionScene steady = randomScene(5, { { 10, 9, 8 } }, 1.);
  steady.solve(1e-12);
  DiffusionSolver solver;
  solver.setMedium(steady.medium());
  DiffusionControl control;
  control.tolerance = 1e-9;
  const auto difference = [&](const std::vector<double>& phi)
  {
    double d = 0.;
    double m = 0.;
    for (std::size_t i = 0; i < phi.size(); ++i)
    {
      d = std::max(d, std::abs(phi[i] - steady.phi[i]));
      m = std::max(m, steady.phi[i]);
    }
    return d / m;
  };
  std::vector<double> phi(steady.phi.size(), 0.);
  DiffusionReport report =
    solver.stepExplicit(steady.q.data(), phi.data(), 20000, solver.positivityBound(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged && report.iterations < 20000);
  LT_CHECK_NEAR(suite, difference(phi), 0., 1e-6);
  phi.assign(phi.size(), 0.);
  report =
    solver.stepExplicit(steady.q.data(), phi.data(), 20000, solver.stabilityBound(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged);
  LT_CHECK_NEAR(suite, difference(phi), 0., 1e-6);
  phi.assign(phi.size(), 0.);
  report = solver.stepImplicit(
    steady.q.data(), phi.data(), 200, 1000. * solver.positivityBound(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged && report.residual <= control.tolerance);
  LT_CHECK_NEAR(suite, difference(phi), 0., 1e-6);
}

/** Positive fields stay positive up to the bound, at contrast 1e8; beyond stability: refused. */
void bounds(Suite& suite)
{
  DiffusionScene scene = randomScene(6, { { 13, 11, 7 } }, 8.);
  DiffusionSolver solver;
  solver.setMedium(scene.medium());
  DiffusionControl control;
  bool positive = true;
  for (int step = 0; step < 200; ++step)
  {
    solver.stepExplicit(scene.q.data(), scene.phi.data(), 1, solver.positivityBound(), control);
    for (const double phi : scene.phi)
    {
      positive = positive && phi >= 0.;
    }
  }
  LT_CHECK(suite, positive);
  const std::vector<double> before = scene.phi;
  const DiffusionReport refused = solver.stepExplicit(
    scene.q.data(), scene.phi.data(), 1, 1.01 * solver.stabilityBound(), control);
  LT_CHECK(suite, refused.reason == StopReason::BadInput);
  LT_CHECK(suite, refused.message.find("unstable") != std::string::npos);
  LT_CHECK(suite, scene.phi == before);

  // The bound is sharp on a homogeneous medium: the checkerboard mode, by power iteration.
  DiffusionScene plain({ { 16, 16, 16 } }, { { 1., 1., 1. } });
  plain.boundary = Boundary::ZeroFlux;
  plain.sigma_a.assign(plain.q.size(), 0.5);
  LT_CHECK(suite, solver.setMedium(plain.medium()).reason == StopReason::Converged);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1., 1.);
  for (double& phi : plain.phi)
  {
    phi = uniform(random);
  }
  const double cdt = 0.5 * solver.stabilityBound(); // phi - cdt A phi: the largest eigenvalue -> -1
  double growth = 0.;
  for (int i = 0; i < 400; ++i)
  {
    double before2 = 0.;
    double after2 = 0.;
    std::vector<double> old = plain.phi;
    solver.stepExplicit(static_cast<const double*>(nullptr), plain.phi.data(), 1, cdt, control);
    for (std::size_t v = 0; v < old.size(); ++v)
    {
      plain.phi[v] = (old[v] - plain.phi[v]) / cdt; // A phi
      before2 += old[v] * old[v];
      after2 += plain.phi[v] * plain.phi[v];
    }
    growth = std::sqrt(after2 / before2);
    for (double& phi : plain.phi)
    {
      phi /= std::sqrt(after2);
    }
  }
  LT_CHECK(suite, growth <= 2. / solver.stabilityBound() * (1. + 1e-6));
  LT_CHECK(suite, growth >= 0.98 * 2. / solver.stabilityBound());
}

void stored(Suite& suite)
{
  // Between mirrors and without absorption, what was there stays there.
  DiffusionScene scene = randomScene(8, { { 9, 8, 7 } }, 3.);
  scene.boundary = Boundary::ZeroFlux;
  scene.sigma_a.assign(scene.q.size(), 0.);
  scene.phi = scene.q;
  DiffusionSolver solver;
  solver.setMedium(scene.medium());
  DiffusionControl control;
  double before = 0.;
  double after = 0.;
  for (const double phi : scene.phi)
  {
    before += phi;
  }
  solver.stepExplicit(
    static_cast<const double*>(nullptr), scene.phi.data(), 500, solver.positivityBound(), control);
  for (const double phi : scene.phi)
  {
    after += phi;
  }
  LT_CHECK_CLOSE(suite, after, before, 1e-12);
  control.progress = [](double fraction) { return fraction < 4. / 500.; };
  const DiffusionReport report =
    solver.stepExplicit(scene.q.data(), scene.phi.data(), 500, solver.positivityBound(), control);
  LT_CHECK(suite, report.reason == StopReason::Cancelled && report.iterations == 4);
}
/** On an eigenmode: second order in time; a step far too large damps it all the same. */
void secondOrder(Suite& suite)
{
  const int n = 24;
  const double sigma = 0.3;
  DiffusionScene scene({ { n, 5, 1 } }, { { 0.5, 1., 1. } });
  scene.boundary = Boundary::ZeroFlux;
  scene.sigma_a.assign(scene.D.size(), sigma);
  const auto mode = [&](double x, double, double) { return std::cos(2. * Pi * x / (n * 0.5)); };
  const double lambda = sigma + (2. - 2. * std::cos(2. * Pi / n)) / 0.25;
  DiffusionSolver solver;
  LT_CHECK(suite, solver.setMedium(scene.medium()).reason == StopReason::Converged);
  DiffusionControl control;
  control.tolerance = 1e-13;
  const auto* none = static_cast<const double*>(nullptr);
  for (const bool second : { false, true })
  {
    control.implicitScheme = second ? ImplicitScheme::SecondOrder : ImplicitScheme::BackwardEuler;
    double before = 0.;
    for (const int steps : { 5, 10, 20, 40 })
    {
      const double time = 2. / lambda;
      scene.fill(scene.phi, mode);
      const DiffusionReport report =
        solver.stepImplicit(none, scene.phi.data(), steps, time / steps, control);
      LT_CHECK(suite, report.reason == StopReason::MaxIterations);
      const double error =
        scene.worst([&](double x, double y, double z) { return std::exp(-2.) * mode(x, y, z); });
      const double order = before > 0. ? std::log2(before / error) : 0.;
      std::cout << (second ? "SDIRK2 " : "backward Euler ") << steps << " steps: error " << error
                << (before > 0. ? ", order " + std::to_string(order) : std::string()) << "\n";
      if (steps == 40)
      {
        LT_CHECK_NEAR(suite, order, second ? 2. : 1., 0.1);
      }
      before = error;
    }
  }
  // one step: the scheme's factor R(z), which goes to 0 with z -> -infinity
  const double gamma = 1. - std::sqrt(0.5);
  for (const double z : { 0.1, 1., 30., 1e3, 1e6 })
  {
    scene.fill(scene.phi, mode);
    solver.stepImplicit(none, scene.phi.data(), 1, z / lambda, control);
    const double R = (1. - (1. - 2. * gamma) * z) / ((1. + gamma * z) * (1. + gamma * z));
    LT_CHECK_NEAR(suite,
      scene.worst([&](double x, double y, double w) { return R * mode(x, y, w); }), 0.,
      1e-6 * std::abs(R) + 1e-7); // float sinks
    LT_CHECK(suite, std::abs(R) < 1.2 * std::sqrt(2.) / (gamma * z) && std::abs(R) < 1.);
  }
  // and the steady state is said to be reached
  DiffusionScene lit = randomScene(9, { { 10, 9, 8 } }, 1.);
  DiffusionScene steady = lit;
  steady.solve(1e-12);
  solver.setMedium(lit.medium());
  control.tolerance = 1e-9;
  const DiffusionReport report = solver.stepImplicit(
    lit.q.data(), lit.phi.data(), 200, 1000. * solver.positivityBound(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged && report.residual <= control.tolerance);
  double worst = 0.;
  for (std::size_t i = 0; i < lit.phi.size(); ++i)
  {
    worst = std::max(worst, std::abs(lit.phi[i] - steady.phi[i]));
  }
  LT_CHECK_NEAR(suite, worst, 0., 1e-7);
}

/** Each voxel its own step: the same steady state, sooner, and stable at any contrast. */
void local(Suite& suite)
{
  DiffusionControl control;
  control.tolerance = 1e-8;
  for (const double decades : { 1., 2., 8. })
  {
    DiffusionScene steady = randomScene(10, { { 12, 11, 10 } }, decades);
    for (std::size_t i = 0; i < steady.D.size(); ++i)
    {
      steady.sigma_a[i] = 0.05 * steady.D[i]; // as from an albedo: what is clear absorbs little
    }
    steady.q[500] = 1.;
    const DiffusionScene dark = steady;
    steady.solve(1e-13);
    DiffusionSolver solver;
    solver.setMedium(dark.medium());
    const auto run = [&](bool localStep, std::vector<double>& phi)
    {
      phi = dark.phi;
      return localStep
        ? solver.stepLocal(dark.q.data(), phi.data(), 40000, 1., control)
        : solver.stepExplicit(dark.q.data(), phi.data(), 40000, solver.positivityBound(), control);
    };
    std::vector<double> phi;
    const DiffusionReport global = run(false, phi);
    const DiffusionReport own = run(true, phi);
    std::cout << "contrast 1e" << decades << ": " << own.iterations << " local steps, "
              << (global.reason == StopReason::Converged ? "" : "more than ") << global.iterations
              << " global ones, ratio " << double(global.iterations) / own.iterations << "\n";
    LT_CHECK(suite, own.reason == StopReason::Converged && own.residual <= 1.2e-8);
    LT_CHECK(suite, own.iterations * (decades > 1. ? 4 : 1) < global.iterations);
    double worst = 0.;
    double largest = 0.;
    bool positive = true;
    for (std::size_t i = 0; i < phi.size(); ++i)
    {
      worst = std::max(worst, std::abs(phi[i] - steady.phi[i]));
      largest = std::max(largest, steady.phi[i]);
      positive = positive && phi[i] >= 0.;
    }
    LT_CHECK_NEAR(suite, worst / largest, 0., decades > 2. ? 1e-4 : 1e-6);
    LT_CHECK(suite, positive);
    // never unstable: the maximum of |phi| over a random field does not grow
    std::mt19937 random(11);
    std::uniform_real_distribution<double> uniform(-1., 1.);
    for (double& value : phi)
    {
      value = uniform(random);
    }
    double before = 1.;
    bool bounded = true;
    for (int step = 0; step < 50; ++step)
    {
      solver.stepLocal(static_cast<const double*>(nullptr), phi.data(), 1, 1., control);
      double after = 0.;
      for (const double value : phi)
      {
        after = std::max(after, std::abs(value));
      }
      bounded = bounded && after <= before * (1. + 1e-12);
      before = after;
    }
    LT_CHECK(suite, bounded);
  }
  // what was reached is shown on the way; an error to aim at is a steady answer's, not a step's
  DiffusionScene shown = randomScene(12, { { 8, 7, 6 } }, 1.);
  DiffusionSolver stepper;
  stepper.setMedium(shown.medium());
  int seen = 0;
  control.intermediate = [&seen](const double*) { ++seen; };
  control.intermediateInterval = 0.;
  stepper.stepLocal(shown.q.data(), shown.phi.data(), 5, 1., control);
  LT_CHECK(suite, seen == 5);
  control = DiffusionControl();
  std::vector<double> strict = shown.phi;
  const double cdt = 20. * stepper.positivityBound();
  stepper.stepImplicit(shown.q.data(), strict.data(), 3, cdt, control);
  control.targetError = 0.3;
  control.timeBudget = 1e-9;
  stepper.stepImplicit(shown.q.data(), shown.phi.data(), 3, cdt, control);
  LT_CHECK(suite, strict == shown.phi);
  // a fraction that is none, and a medium that has no steady state
  DiffusionScene closed({ { 4, 4, 4 } }, { { 1., 1., 1. } });
  closed.boundary = Boundary::ZeroFlux;
  closed.q[3] = 1.;
  DiffusionSolver solver;
  solver.setMedium(closed.medium());
  LT_CHECK(suite,
    solver.stepLocal(closed.q.data(), closed.phi.data(), 1, 1.5, control).reason ==
      StopReason::BadInput);
  LT_CHECK(suite,
    solver.stepLocal(closed.q.data(), closed.phi.data(), 1, 1., control).reason ==
      StopReason::NoSteadyState);
}

/** On many voxels, steps go through the memory four at a time: to the bit what single ones do. */
void together(Suite& suite)
{
  for (const std::array<int, 3>& dims :
    { std::array<int, 3>{ { 83, 90, 71 } }, std::array<int, 3>{ { 20, 11, 2400 } },
      std::array<int, 3>{ { 30, 20000, 1 } }, std::array<int, 3>{ { 530000, 1, 1 } } })
  {
    DiffusionScene scene = randomScene(13, dims, 0.5);
    const ParallelFor threads = lighttransport::testing::ThreadedFor(3);
    DiffusionSolver solver(threads);
    solver.setMedium(scene.medium());
    for (const bool local : { false, true })
    {
      const double length = local ? 1. : solver.positivityBound();
      const auto step = [&](int steps, std::vector<double>& phi)
      {
        return local
          ? solver.stepLocal(scene.q.data(), phi.data(), steps, length, DiffusionControl())
          : solver.stepExplicit(scene.q.data(), phi.data(), steps, length, DiffusionControl());
      };
      std::vector<double> at = scene.phi;
      const DiffusionReport report = step(11, at); // 4, 4 and 3
      LT_CHECK(suite, report.reason == StopReason::MaxIterations && report.iterations == 11);
      if (lighttransport::testing::LookingForRaces)
      {
        break;
      }
      std::vector<double> singly = scene.phi;
      for (int i = 0; i < 11; ++i)
      {
        step(1, singly);
      }
      LT_CHECK(suite, at == singly);
    }
    if (lighttransport::testing::LookingForRaces)
    {
      continue;
    }
    // asked after each four, and the fourth is where it stops
    DiffusionControl control;
    std::vector<double> shown;
    control.intermediateInterval = 0.;
    control.intermediate = [&](const double* phi) { shown.assign(phi, phi + scene.phi.size()); };
    control.progress = [](double fraction) { return fraction < 8. / 100.; };
    std::vector<double> phi = scene.phi;
    const DiffusionReport report =
      solver.stepExplicit(scene.q.data(), phi.data(), 100, solver.positivityBound(), control);
    LT_CHECK(suite, report.reason == StopReason::Cancelled && report.iterations == 8);
    LT_CHECK(suite, shown == phi);
  }
}

/** Cancelled amid a step that takes long, phi is what it was before that step. */
void amidStep(Suite& suite)
{
  DiffusionScene scene({ { 128, 128, 65 } }, { { 1., 1., 1. } });
  scene.sigma_a.assign(scene.q.size(), 1e-2);
  scene.D[7] = 0.5;
  scene.q[100] = 1.;
  scene.phi.assign(scene.q.size(), 2.);
  bool slow = false;
  DiffusionSolver solver(
    [&slow](std::int64_t n, const RangeBody& body)
    {
      std::this_thread::sleep_for(std::chrono::milliseconds(slow ? 25 : 0));
      body(0, n);
    });
  solver.setMedium(scene.medium());
  const double bound = solver.positivityBound();
  slow = true;
  int calls = 0;
  DiffusionControl control;
  control.progress = [&calls](double) { return ++calls == 0; };
  const DiffusionReport report =
    solver.stepExplicit(scene.q.data(), scene.phi.data(), 1, bound, control);
  LT_CHECK(suite, report.reason == StopReason::Cancelled && report.iterations == 0 && calls == 1);
  LT_CHECK(suite, scene.phi == std::vector<double>(scene.q.size(), 2.));
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  together(suite);
  if (lighttransport::testing::LookingForRaces)
  {
    return suite.result();
  }
  eigenmode(suite);
  steadyReached(suite);
  bounds(suite);
  stored(suite);
  secondOrder(suite);
  local(suite);
  amidStep(suite);
  return suite.result();
}
