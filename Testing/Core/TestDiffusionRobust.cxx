// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Hard media: the answer's residual is recomputed here, from the equations, and
 * the iterations are bounded. Then what has no answer, and what stops early.
 */
#include "Core/Coarse.h"
#include "Core/FirstMoment.h"
#include "HardMedia.h"
#include "LightTransportTesting.h"

#include <limits>
#include <random>

using namespace lighttransport;
using lighttransport::testing::DiffusionScene;
using lighttransport::testing::Suite;

namespace
{
void expectSolved(Suite& suite, const std::string& name, DiffusionScene& scene, int iterations,
  double tolerance = 1e-8)
{
  const DiffusionReport report = scene.solve(tolerance);
  const double residual = scene.residual();
  double least = 0.;
  double most = 0.;
  for (const double phi : scene.phi)
  {
    least = std::min(least, phi);
    most = std::max(most, phi);
  }
  std::cout << name << ": " << ToString(report.reason) << ", " << report.iterations
            << " iterations, residual " << report.residual << " (here " << residual << "), min/max "
            << least / most << ", balance "
            << (report.absorbed + report.escaped) / report.emitted - 1. << " " << report.message
            << "\n";
  suite.check(report.reason == StopReason::Converged, name + " converges", __FILE__, __LINE__);
  suite.check(report.iterations <= iterations, name + ": iterations", __FILE__, __LINE__);
  suite.check(residual <= 1.1 * tolerance, name + ": the equations hold", __FILE__, __LINE__);
  suite.check(-least <= tolerance * most, name + ": positive", __FILE__, __LINE__);
  LT_CHECK_CLOSE(suite, report.absorbed + report.escaped, report.emitted, 1e-6);
}

void hardMedia(Suite& suite)
{
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(0., 1.);
  std::cout << "seed 11\n";
  for (const double decades : { 2., 4., 6., 8. })
  {
    DiffusionScene scene({ { 31, 37, 29 } }, { { 1., 1., 1. } });
    for (std::size_t i = 0; i < scene.D.size(); ++i)
    {
      scene.D[i] = std::pow(10., -decades * uniform(random));
      scene.sigma_a[i] = 1e-3 * (1. - scene.D[i]);
    }
    scene.q[scene.index(15, 15, 15)] = 1.;
    expectSolved(
      suite, "noise over " + std::to_string(decades) + " decades", scene, decades > 4. ? 150 : 60);
  }
  {
    DiffusionScene scene({ { 32, 32, 32 } }, { { 1., 1., 1. } });
    scene.fill(scene.D,
      [](double x, double y, double z) {
        return (static_cast<int>(x) + static_cast<int>(y) + static_cast<int>(z)) % 2 ? 1e-8 : 1.;
      });
    scene.sigma_a.assign(scene.q.size(), 1e-4);
    scene.q[scene.index(16, 16, 16)] = 1.;
    expectSolved(suite, "checkerboard 1e8", scene, 60);
  }
  {
    DiffusionScene scene({ { 32, 32, 32 } }, { { 1., 1., 1. } });
    scene.fill(scene.D, [](double x, double, double) { return x < 15. ? 1. : 1e-8; });
    scene.q[scene.index(8, 16, 16)] = 1.;
    expectSolved(suite, "one face 1e8", scene, 30);
  }
  {
    // nothing but the corridor's ends lets light out
    DiffusionScene scene(lighttransport::testing::WindingCorridor(33, 1e-6));
    expectSolved(suite, "winding corridor", scene, 40); // two corridors in one coarse voxel
  }
  for (const double ratio : { 10., 1000. })
  {
    DiffusionScene scene({ { 20, 24, 28 } }, { { 1., ratio, 1. } });
    for (std::size_t i = 0; i < scene.D.size(); ++i)
    {
      scene.D[i] = std::pow(10., -2. * uniform(random));
      scene.sigma_a[i] = 1e-3;
    }
    scene.q[scene.index(10, 12, 14)] = 1.;
    expectSolved(suite, "spacing 1:" + std::to_string(ratio), scene, 60);
  }
  for (const std::array<int, 3>& dims : { std::array<int, 3>{ { 1, 1, 101 } },
         std::array<int, 3>{ { 97, 1, 89 } }, std::array<int, 3>{ { 2, 3, 5 } },
         std::array<int, 3>{ { 53, 2, 3 } }, std::array<int, 3>{ { 1, 1, 1 } } })
  {
    DiffusionScene scene(dims, { { 1., 1., 1. } });
    for (std::size_t i = 0; i < scene.D.size(); ++i)
    {
      scene.D[i] = 0.01 + uniform(random);
    }
    scene.sigma_a.assign(scene.q.size(), 0.01);
    scene.q[scene.q.size() / 2] = 1.;
    expectSolved(suite,
      std::to_string(dims[0]) + "x" + std::to_string(dims[1]) + "x" + std::to_string(dims[2]),
      scene, 30);
  }
  {
    // almost no way out: sigma_a 1e-12 between mirrors; phi = power / (sigma_a V) everywhere
    DiffusionScene scene({ { 16, 16, 16 } }, { { 1., 1., 1. } });
    scene.boundary = Boundary::ZeroFlux;
    scene.sigma_a.assign(scene.q.size(), 1e-8);
    scene.D[scene.index(12, 12, 12)] = 0.5; // not constant, which is solved at once
    scene.q[scene.index(3, 4, 5)] = 1.;
    expectSolved(suite, "nearly singular", scene, 30);
    LT_CHECK_CLOSE(suite, scene.phi[0], 1e8 / 4096., 1e-5);
    // Four decades less, and phi is 2e8 times q: double's rounding of A phi is above the
    // tolerance. The reason says so, and the answer is right all the same.
    scene.sigma_a.assign(scene.q.size(), 1e-12);
    scene.phi.assign(scene.q.size(), 0.);
    const DiffusionReport report = scene.solve(1e-8);
    LT_CHECK(suite, report.reason == StopReason::Breakdown);
    LT_CHECK(suite, report.residual > 1e-8 && report.residual < 1e-4);
    LT_CHECK_CLOSE(suite, scene.phi[0], 1e12 / 4096., 1e-5);
  }
  for (const double power : { 1e-100, 1e-30, 1e30, 1e100 })
  {
    DiffusionScene scene({ { 12, 12, 12 } }, { { 1., 1., 1. } });
    scene.sigma_a.assign(scene.q.size(), 0.1);
    scene.q[scene.index(6, 6, 6)] = power;
    scene.q[scene.index(2, 2, 2)] = power;
    const DiffusionReport report = scene.solve(1e-8);
    LT_CHECK(suite, report.reason == StopReason::Converged);
    LT_CHECK_CLOSE(suite, report.absorbed + report.escaped, 2. * power, 1e-6);
  }
}

void noAnswer(Suite& suite)
{
  DiffusionScene scene({ { 8, 8, 8 } }, { { 1., 1., 1. } });
  scene.boundary = Boundary::ZeroFlux;
  scene.q[scene.index(2, 2, 2)] = 1.;
  DiffusionReport report = scene.solve();
  LT_CHECK(suite, report.reason == StopReason::NoSteadyState && report.iterations == 0);
  LT_CHECK(suite, report.message.find("absorption") != std::string::npos);

  // balanced sources have one, up to a constant, which is taken such that the mean is 0
  scene.q[scene.index(6, 5, 4)] = -1.;
  report = scene.solve();
  LT_CHECK(suite, report.reason == StopReason::Converged);
  LT_CHECK(suite, scene.residual() < 1e-6);
  double mean = 0.;
  for (const double phi : scene.phi)
  {
    mean += phi;
  }
  LT_CHECK_NEAR(suite, mean, 0., 1e-9);

  // a closed room in an open world
  DiffusionScene room({ { 9, 9, 9 } }, { { 1., 1., 1. } });
  room.fill(room.D,
    [](double x, double y, double z)
    {
      const double d = std::max(std::max(std::abs(x - 4.5), std::abs(y - 4.5)), std::abs(z - 4.5));
      return d > 1.2 && d < 2.2 ? 0. : 1.;
    });
  room.q[room.index(4, 4, 4)] = 1.;
  report = room.solve();
  LT_CHECK(suite, report.reason == StopReason::NoSteadyState);
  LT_CHECK(suite, report.message.find("(4, 4, 4)") != std::string::npos);
  room.q.assign(room.q.size(), 0.);
  room.q[room.index(0, 0, 0)] = 1.;
  LT_CHECK(suite, room.solve().reason == StopReason::Converged);
  LT_CHECK(suite, room.phi[room.index(4, 4, 4)] == 0.);
  // a source inside the wall itself
  room.q[room.index(6, 4, 4)] = 1.;
  LT_CHECK(suite, room.solve().reason == StopReason::NoSteadyState);

  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  for (const double bad : { nan, inf, -1. })
  {
    DiffusionScene wrong({ { 4, 5, 6 } }, { { 1., 1., 1. } });
    wrong.D[wrong.index(1, 2, 3)] = bad;
    report = wrong.solve();
    LT_CHECK(suite, report.reason == StopReason::BadInput);
    LT_CHECK(suite, report.message.find("diffusion coefficient") != std::string::npos);
    LT_CHECK(suite, report.message.find("(1, 2, 3)") != std::string::npos);
    wrong.D[wrong.index(1, 2, 3)] = 1.;
    wrong.sigma_a[wrong.index(3, 4, 5)] = bad;
    report = wrong.solve();
    LT_CHECK(suite, report.reason == StopReason::BadInput);
    LT_CHECK(suite, report.message.find("absorption") != std::string::npos);
  }
}

void stops(Suite& suite)
{
  DiffusionScene scene({ { 24, 24, 24 } }, { { 1., 1., 1. } });
  scene.sigma_a.assign(scene.q.size(), 1e-3);
  scene.D[scene.index(20, 20, 20)] = 0.5; // a constant medium is solved at once
  scene.q[scene.index(5, 6, 7)] = 1.;
  // more than double can give: an honest stop, the best answer kept
  DiffusionReport report = scene.solve(1e-19);
  LT_CHECK(
    suite, report.reason == StopReason::Breakdown || report.reason == StopReason::MaxIterations);
  LT_CHECK(suite, report.residual < 1e-13);
  LT_CHECK(suite, report.iterations < 100);

  DiffusionSolver solver;
  solver.setMedium(scene.medium());
  DiffusionControl control;
  control.maxIterations = 2;
  scene.phi.assign(scene.phi.size(), 0.);
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::MaxIterations && report.iterations == 2);
  LT_CHECK(suite, report.residual > control.tolerance && report.residual < 1.);
  control.maxIterations = 100;
  double last = -1.;
  bool rising = true;
  control.progress = [&](double fraction)
  {
    rising = rising && fraction >= last - 0.05 && fraction <= 1.;
    last = fraction;
    return fraction < 0.3;
  };
  scene.phi.assign(scene.phi.size(), 0.);
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Cancelled && report.iterations > 0);
  LT_CHECK(suite, rising);
  // going on from there
  control.progress = nullptr;
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged);
  const int remaining = report.iterations;
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged && report.iterations == 0);
  scene.phi.assign(scene.phi.size(), 0.);
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, remaining < report.iterations);
}

/**
 * The matrix, column by column, from what an explicit step makes of one lit voxel: symmetric, no
 * face below 0, no row whose sinks are: an M-matrix, so that light cannot turn negative.
 */
void signs(Suite& suite)
{
  std::mt19937 random(12);
  std::cout << "seed 12\n";
  std::uniform_real_distribution<double> uniform(0., 1.);
  for (const Boundary boundary : { Boundary::Robin, Boundary::ZeroFlux, Boundary::Absorbing })
  {
    DiffusionScene scene({ { 5, 4, 3 } }, { { 1., 0.3, 20. } });
    scene.boundary = boundary;
    for (std::size_t i = 0; i < scene.D.size(); ++i)
    {
      scene.D[i] = uniform(random) < 0.1 ? 0. : std::pow(10., -8. * uniform(random));
      scene.sigma_a[i] = uniform(random) < 0.3 ? 0. : std::pow(10., -6. * uniform(random));
    }
    DiffusionSolver solver;
    solver.setMedium(scene.medium());
    const double cdt = solver.positivityBound();
    const std::size_t n = scene.q.size();
    std::vector<std::vector<double>> columns;
    for (std::size_t i = 0; i < n; ++i)
    {
      std::vector<double> phi(n, 0.);
      phi[i] = 1.;
      solver.stepExplicit(
        static_cast<const double*>(nullptr), phi.data(), 1, cdt, DiffusionControl());
      columns.push_back(phi); // 1 - c dt A
    }
    bool symmetric = true;
    bool positive = true;
    bool lossy = true;
    bool connected = false;
    for (std::size_t i = 0; i < n; ++i)
    {
      double sum = 0.;
      for (std::size_t j = 0; j < n; ++j)
      {
        symmetric = symmetric && std::abs(columns[i][j] - columns[j][i]) <= 1e-15;
        positive = positive && columns[i][j] >= 0.; // off the diagonal: -c dt A
        connected = connected || (i != j && columns[i][j] > 0.);
        sum += columns[i][j];
      }
      lossy = lossy && sum <= 1. + 1e-14;
    }
    LT_CHECK(suite, symmetric);
    LT_CHECK(suite, positive);
    LT_CHECK(suite, lossy);
    LT_CHECK(suite, connected);
  }
}

/** Anything at all: what is said to be solved is, and nothing that comes out is not a number. */
void honest(Suite& suite)
{
  const unsigned int seed = 13;
  std::cout << "seed " << seed << "\n";
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0., 1.);
  std::uniform_int_distribution<int> length(1, 9);
  int solved = 0;
  int refused = 0;
  double mostNegative = 0.;
  for (int run = 0; run < 400; ++run)
  {
    const auto power = [&](double decades)
    { return std::pow(10., decades * (2. * uniform(random) - 1.)); };
    DiffusionScene scene({ { length(random), length(random), length(random) } },
      { { power(4.), power(4.), power(4.) } });
    scene.boundary = static_cast<Boundary>(run % 3);
    const double contrast = 20. * uniform(random);
    const double absorbing = 10. * uniform(random);
    const double unit = power(6.);
    for (std::size_t i = 0; i < scene.q.size(); ++i)
    {
      const double kind = uniform(random);
      // every tenth medium is constant, the others may have walls and denormals
      scene.D[i] = run % 10 == 0 ? unit
        : kind < 0.02            ? 0.
        : kind < 0.04            ? 1e-310
                                 : unit * std::pow(10., -contrast * uniform(random));
      scene.sigma_a[i] = run % 10 == 0 ? 0.01 / unit
        : kind > 0.7                   ? std::pow(10., -absorbing * uniform(random)) / unit
                                       : 0.;
      scene.q[i] = uniform(random) < 0.1 ? std::abs(power(30.)) : 0.;
    }
    const double tolerance = std::pow(10., -2. - 12. * uniform(random));
    const DiffusionReport report = scene.solve(tolerance);
    double least = 0.;
    double most = 0.;
    bool finite = true;
    for (const double phi : scene.phi)
    {
      finite = finite && std::isfinite(phi);
      least = std::min(least, phi);
      most = std::max(most, phi);
    }
    const std::string name = "medium " + std::to_string(run) + ": " + ToString(report.reason);
    suite.check(finite, name + ", finite", __FILE__, __LINE__);
    if (report.reason == StopReason::Converged)
    {
      ++solved;
      const bool dark = most == 0.; // without a source
      const double residual = dark ? 0. : scene.residual();
      suite.check(residual <= tolerance * (1. + 1e-3) + 1e-15,
        name + ", but the residual is " + std::to_string(residual / tolerance) + " tolerances",
        __FILE__, __LINE__);
      suite.check(-least <= tolerance * most, name + ", positive", __FILE__, __LINE__);
      mostNegative = std::max(mostNegative, dark ? 0. : -least / (tolerance * most));
    }
    refused += report.reason == StopReason::NoSteadyState;
  }
  std::cout << solved << " of 400 solved, " << refused
            << " without a steady state, most negative: " << mostNegative << " tolerances\n";
  LT_CHECK(suite, solved > 200 && refused > 50);
}

/**
 * Wavy layers with parts cut out: where all of a fine voxel belongs to one coarse one, nothing of
 * it may leak to the other. What did, 6e-8 of the clear layers' faces, was negative and more than
 * the dark ones have: then the preconditioner is indefinite, and the solve ends NotFinite. A lamp
 * in the dark is found in one step, and the next direction is the same again but for rounding: a
 * solve that goes along the rounding ends Diverged.
 */
void layers(Suite& suite)
{
  int solved = 0;
  for (int run = 0; run < 60; ++run)
  {
    DiffusionScene scene(
      lighttransport::testing::Layers<double>(static_cast<unsigned int>(run), 16 + run % 12, 4.));
    DiffusionSolver solver;
    LT_CHECK(suite, solver.setMedium(scene.medium()).reason == StopReason::Converged);
    DiffusionControl control;
    control.tolerance = 1e-8;
    control.maxIterations = 100;
    const DiffusionReport report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
    suite.check(
      report.reason == StopReason::Converged || report.reason == StopReason::MaxIterations,
      "layers " + std::to_string(run) + ": " + ToString(report.reason) + ", " + report.message,
      __FILE__, __LINE__);
    solved += report.reason == StopReason::Converged;
  }
  std::cout << solved << " of 60 layered media solved\n";
  LT_CHECK(suite, solved == 60);
}

/** What ends before it is solved is no less honest: signs, residual, reason. */
void early(Suite& suite)
{
  std::mt19937 random(21);
  std::cout << "seed 21\n";
  std::uniform_real_distribution<double> uniform(0., 1.);
  DiffusionScene scene({ { 11, 12, 13 } }, { { 1., 1., 1. } });
  for (std::size_t i = 0; i < scene.q.size(); ++i)
  {
    scene.D[i] = std::pow(10., -6. * uniform(random));
    scene.sigma_a[i] = 1e-3;
  }
  scene.q[scene.index(2, 3, 4)] = 1.;
  DiffusionSolver solver;
  solver.setMedium(scene.medium());
  bool negative = false;
  for (const double sign : { 1., -1. })
  {
    scene.q[scene.index(2, 3, 4)] = sign;
    for (int iterations = 1; iterations < 12; ++iterations)
    {
      DiffusionControl control;
      control.maxIterations = iterations;
      std::fill(scene.phi.begin(), scene.phi.end(), 0.);
      const DiffusionReport report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
      double wrong = 0.;
      double largest = 0.;
      bool dark = false;
      for (const double phi : scene.phi)
      {
        wrong = std::max(wrong, -sign * phi);
        largest = std::max(largest, sign * phi);
        dark = dark || phi == 0.;
      }
      negative = negative || dark; // was made 0
      LT_CHECK(suite, report.reason == StopReason::MaxIterations);
      LT_CHECK(suite, wrong <= 1e-8 * largest);
      LT_CHECK_CLOSE(suite, report.residual, scene.residual(), 1e-6);
    }
  }
  LT_CHECK(suite, negative);

  // steps whose solves do not end are not "all made"
  DiffusionControl control;
  control.maxIterations = 2;
  std::fill(scene.phi.begin(), scene.phi.end(), 0.);
  DiffusionReport report = solver.stepImplicit(
    scene.q.data(), scene.phi.data(), 3, 1e4 * solver.positivityBound(), control);
  LT_CHECK(suite, report.reason == StopReason::Breakdown);
  LT_CHECK(suite, report.message.find("step 1 of 3") != std::string::npos);

  // A region's rim is no sink: light that hardly decays on its way is not solved where it starts,
  // and light in a closed room has no steady state there either.
  for (const double absorption : { 0., 1e-5 })
  {
    DiffusionScene corridor({ { 1, 600, 1 } }, { { 1., 1., 1. } });
    corridor.boundary = Boundary::ZeroFlux;
    corridor.D[590] = absorption > 0. ? .5 : 0.;
    corridor.sigma_a.assign(corridor.q.size(), absorption);
    corridor.sigma_a[599] = 1.;
    corridor.q[20] = 1.;
    DiffusionSolver active;
    DiffusionControl all;
    report =
      active.solveActive(corridor.medium(), corridor.q.data(), corridor.phi.data(), all, 1e-3);
    LT_CHECK(suite,
      report.reason == (absorption > 0. ? StopReason::Converged : StopReason::NoSteadyState));
    LT_CHECK(suite, std::abs(report.leaked) <= 1e-2);
    LT_CHECK_CLOSE(suite, report.absorbed + report.leaked, absorption > 0. ? 1. : 0., 1e-6);
  }

  // a first-moment step in which nearly all light is absorbed still says how much
  {
    DiffusionScene dense({ { 8, 1, 1 } }, { { 1., 1., 1. } });
    dense.boundary = Boundary::ZeroFlux;
    for (std::size_t i = 0; i < 8; ++i)
    {
      dense.D[i] = i % 2 ? 1. : 1e-9;
      dense.sigma_a[i] = 1. / (3. * dense.D[i]);
      dense.phi[i] = 1.;
    }
    FirstMomentSolver moment;
    moment.setMedium(dense.medium());
    const double cdt = 1e5 * moment.courantBound();
    LT_CHECK(suite, moment.stabilityBound() > cdt);
    const FirstMomentReport powers =
      moment.step(static_cast<const double*>(nullptr), dense.phi.data(), 3, cdt, control);
    LT_CHECK_CLOSE(suite, powers.storedEnergy, -8., 1e-4);
    LT_CHECK_CLOSE(suite, powers.absorbedEnergy, -powers.storedEnergy, 1e-9);
  }

  // where nothing can change, steps change nothing
  DiffusionScene lone({ { 1, 1, 1 } }, { { 1., 1., 1. } });
  lone.boundary = Boundary::ZeroFlux;
  DiffusionSolver of;
  of.setMedium(lone.medium());
  for (const double cdt : { of.positivityBound(), of.stabilityBound() })
  {
    lone.phi[0] = 2.;
    of.stepExplicit(static_cast<const double*>(nullptr), lone.phi.data(), 9, cdt, control);
    LT_CHECK_CLOSE(suite, lone.phi[0], 2., 1e-12);
  }

  // outside the domain nothing starts, and nothing is left from before
  scene.outside.assign(scene.q.size(), 0);
  scene.outside[scene.index(5, 6, 7)] = 1;
  solver.setMedium(scene.medium());
  control.maxIterations = 100;
  std::fill(scene.phi.begin(), scene.phi.end(), 3.);
  report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged);
  LT_CHECK(suite, scene.phi[scene.index(5, 6, 7)] == 0.);
  scene.q[scene.index(5, 6, 7)] = 2.;
  const auto refused = [&](const DiffusionReport& answer)
  {
    LT_CHECK(suite, answer.reason == StopReason::BadInput);
    LT_CHECK(suite, answer.message.find("(5, 6, 7), outside") != std::string::npos);
  };
  refused(solver.solveSteady(scene.q.data(), scene.phi.data(), control));
  refused(solver.stepLocal(scene.q.data(), scene.phi.data(), 3, 1., control));
  refused(solver.stepImplicit(scene.q.data(), scene.phi.data(), 3, 1., control));
  refused(
    solver.stepExplicit(scene.q.data(), scene.phi.data(), 3, solver.positivityBound(), control));
}

/**
 * Steps of media so easy that a solve's first step leaves nothing but rounding. The recomputed
 * residual then has parts along that step's direction: a next one as long as if it had none never
 * ends.
 */
void easySteps(Suite& suite)
{
  int most = 0;
  for (int run = 0; run < 300; ++run)
  {
    std::mt19937 random(static_cast<unsigned int>(run));
    std::uniform_real_distribution<double> uniform(0., 1.);
    DiffusionScene scene({ { 1, 1 + run % 3, 20 + run % 50 } }, { { 1., 1., 1. } });
    for (std::size_t i = 0; i < scene.q.size(); ++i)
    {
      const double beta = uniform(random) < 0.9 ? 1e-4 : 1.;
      scene.D[i] = beta;
      scene.sigma_a[i] = 1. - beta;
    }
    scene.q[scene.q.size() / 3] = -1.;
    DiffusionSolver solver;
    solver.setMedium(scene.medium());
    DiffusionControl control;
    control.tolerance = std::pow(10., -6. - 6. * uniform(random));
    control.implicitScheme = ImplicitScheme::SecondOrder;
    const DiffusionReport report = solver.stepImplicit(
      scene.q.data(), scene.phi.data(), 2, 200. * solver.positivityBound(), control);
    most = std::max(most, report.iterations);
  }
  std::cout << "four solves of easy steps: at most " << most << " iterations\n";
  LT_CHECK(suite, most > 0 && most <= 60);
}

/**
 * Sources that cancel where nothing absorbs: mirrors alone, or rooms within walls beside others.
 * phi is fixed up to a constant, and rounding must not become one.
 */
void cancelling(Suite& suite)
{
  int solved = 0;
  const int runs = 120;
  for (int run = 0; run < runs; ++run)
  {
    std::mt19937 random(static_cast<unsigned int>(run));
    std::uniform_real_distribution<double> uniform(0., 1.);
    DiffusionScene scene({ { 5 + run % 7, 4 + run % 5, 1 + run % 6 } }, { { 1., 0.4, 1.7 } });
    scene.boundary = Boundary::ZeroFlux;
    const int n = scene.grid.dims[0];
    const double contrast = 5. * uniform(random);
    if (run % 3 == 2)
    {
      scene.outside.assign(scene.q.size(), 0);
    }
    const int wall = run % 3 == 0 ? n : 2;
    for (std::size_t i = 0; i < scene.q.size(); ++i)
    {
      const int x = static_cast<int>(i % static_cast<std::size_t>(n));
      scene.D[i] = x == wall && run % 3 == 1 ? 0. : std::pow(10., -contrast * uniform(random));
      if (!scene.outside.empty())
      {
        scene.outside[i] = x == wall;
      }
      scene.sigma_a[i] = x > wall ? 0.1 : 0.; // of the other room
    }
    scene.q[0] = 1.;
    scene.q[1 + static_cast<std::size_t>(n) * (scene.q.size() / static_cast<std::size_t>(n) - 1)] =
      -1.;
    DiffusionSolver solver;
    solver.setMedium(scene.medium());
    DiffusionControl control;
    control.maxIterations = 50;
    const DiffusionReport report = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
    const std::string name = "cancelling " + std::to_string(run) + ": " + ToString(report.reason);
    suite.check(report.reason == StopReason::Converged, name, __FILE__, __LINE__);
    double sum = 0.;
    double most = 0.;
    bool dark = true;
    for (std::size_t i = 0; i < scene.q.size(); ++i)
    {
      sum += scene.phi[i];
      most = std::max(most, std::abs(scene.phi[i]));
      dark =
        dark && (static_cast<int>(i % static_cast<std::size_t>(n)) <= wall || scene.phi[i] == 0.);
    }
    suite.check(dark, name + ", the other room is dark", __FILE__, __LINE__);
    suite.check(std::abs(sum) <= 1e-9 * most * static_cast<double>(scene.q.size()), name + ", mean",
      __FILE__, __LINE__);
    solved += report.reason == StopReason::Converged;
    // and the same medium solves another scene after that
    scene.q.assign(scene.q.size(), 0.);
    if (wall < n - 1)
    {
      scene.q[static_cast<std::size_t>(n) - 1] = 1.;
      const DiffusionReport next = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
      suite.check(next.reason == StopReason::Converged &&
          std::abs(next.absorbed + next.escaped - next.emitted) <= 1e-6 * next.emitted,
        name + ", then another", __FILE__, __LINE__);
    }
  }
  std::cout << solved << " of " << runs << " cancelling scenes solved\n";
}

/**
 * A NaN appears in the field, once, while a solver works on it: it is seen, and never called
 * solved. The region solves on a field of its own, and implicit steps have the one before.
 */
void notFinite(Suite& suite)
{
  const Suite::WithoutTraps quiet;
  enum Kind
  {
    Steady,
    Constant,
    Explicit,
    Local,
    Implicit,
    SecondOrder,
    ImplicitConstant,
    Moment,
    Region,
    Coarse,
    End
  };
  for (const double bad :
    { std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e308 })
  {
    for (int kind = 0; kind < End; ++kind)
    {
      DiffusionScene scene({ { 12, 12, 12 } }, { { 1., 1., 1. } });
      scene.sigma_a.assign(scene.q.size(), kind == Region ? 1. : 1e-2);
      scene.D.assign(scene.q.size(), kind == Region ? 1e-2 : 1.);
      scene.D[5] = kind == Constant || kind == ImplicitConstant ? 1. : 0.3;
      scene.q[scene.index(5, 6, 7)] = 1.;
      DiffusionSolver solver;
      FirstMomentSolver moment;
      CoarseDiffusion coarse;
      solver.setMedium(scene.medium());
      moment.setMedium(scene.medium());
      coarse.setMedium(scene.medium(), 2);
      DiffusionControl control;
      control.tolerance = 1e-10;
      control.largestRegion = control.regionSearch = 1.;
      control.implicitScheme =
        kind == SecondOrder ? ImplicitScheme::SecondOrder : ImplicitScheme::BackwardEuler;
      double* phi = scene.phi.data();
      const std::size_t at = scene.index(5, 6, 7) + 1;
      int times = 0;
      control.progress = [&](double fraction)
      {
        // what is told the fraction of is a whole step or iteration: explicit ones stand in phi
        // after two of five
        if (times == 0 && (fraction > (kind == Coarse ? 0.05 : 0.3) || kind == Region))
        {
          phi[at] = bad;
          ++times;
        }
        return true;
      };
      const double* q = scene.q.data();
      const double cdt = (kind == Explicit ? 0.5 : 5.) * solver.positivityBound();
      const auto solve = [&]() -> DiffusionReport
      {
        switch (kind)
        {
          case Steady:
          case Constant:
            return solver.solveSteady(q, phi, control);
          case Explicit:
            return solver.stepExplicit(q, phi, 5, cdt, control);
          case Local:
            return solver.stepLocal(q, phi, 5, 1., control);
          case Moment:
            return moment.step(q, phi, 5, 0.5 * moment.courantBound(), control);
          case Region:
            return solver.solveActive(scene.medium(), q, phi, control, 1e-6);
          case Coarse:
            return coarse.solve(q, phi, control);
          default:
            return solver.stepImplicit(q, phi, 5, cdt, control);
        }
      };
      const DiffusionReport report = solve();
      const std::string name = "kind " + std::to_string(kind) + ", " + std::to_string(bad) + ": " +
        ToString(report.reason) + ", " + report.message;
      // what is too large for its square is no number either, where a norm is taken
      const bool kept = kind == Region || kind == Implicit;
      suite.check(times == 1, name + ": never there", __FILE__, __LINE__);
      suite.check(report.reason == (kind == Region ? StopReason::Converged : StopReason::NotFinite),
        name, __FILE__, __LINE__);
      suite.check(kind != Region || report.activeFraction < 1., name, __FILE__, __LINE__);
      suite.check(!kept ||
          std::all_of(scene.phi.begin(), scene.phi.end(),
            [](double v) { return std::isfinite(v) && v < 1e10; }),
        name + ": the field", __FILE__, __LINE__);
      suite.check(!kept || *std::max_element(scene.phi.begin(), scene.phi.end()) > 0.,
        name + ": dark", __FILE__, __LINE__);
    }
  }
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  signs(suite);
  honest(suite);
  layers(suite);
  early(suite);
  cancelling(suite);
  easySteps(suite);
  notFinite(suite);
  hardMedia(suite);
  noAnswer(suite);
  stops(suite);
  return suite.result();
}
