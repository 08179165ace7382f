// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** Diffusion on a coarser grid: what must be exact, what must be near, what must be refused. */
#include "Core/Coarse.h"
#include "DiffusionScene.h"
#include "LightTransportTesting.h"
#include "ThreadedFor.h"

#include <algorithm>
#include <random>

using namespace lighttransport;
using lighttransport::testing::DiffusionScene;
using lighttransport::testing::Percentile95;
using lighttransport::testing::Suite;

namespace
{
DiffusionScene blobs(std::array<int, 3> dims, std::array<double, 3> spacing, double sigma)
{
  DiffusionScene scene(dims, spacing);
  const double X = dims[0] * spacing[0];
  scene.fill(scene.D,
    [X](double x, double y, double z)
    { return .1 + .4 * (1. + std::sin(15. * x / X) * std::cos(11. * y / X + 7. * z / X)); });
  scene.sigma_a.assign(scene.q.size(), sigma);
  scene.q[scene.index(dims[0] / 3, dims[1] / 2, dims[2] / 2)] = 1.;
  return scene;
}

DiffusionReport solve(DiffusionScene& scene, int factor, const DiffusionControl& control = {},
  const ParallelFor& parallelFor = SerialFor)
{
  CoarseDiffusion coarse(parallelFor);
  DiffusionReport report = coarse.setMedium(scene.medium(), factor);
  return report.reason == StopReason::Converged
    ? coarse.solve(scene.q.data(), scene.phi.data(), control)
    : report;
}

/** Cells of one voxel are the voxels: the full grid's answer, at every border. */
void identity(Suite& suite)
{
  for (const Boundary boundary : { Boundary::Robin, Boundary::ZeroFlux, Boundary::Absorbing })
  {
    DiffusionScene scene = blobs({ { 13, 10, 9 } }, { { 1., .7, 2. } }, .02);
    scene.boundary = boundary;
    scene.refractiveIndexRatio = 1.4;
    DiffusionScene full = scene;
    full.solve(1e-12);
    LT_CHECK(suite, solve(scene, 1).reason == StopReason::Converged);
    LT_CHECK_NEAR(suite, Percentile95(scene.phi, full.phi), 0., 1e-5);
  }
}

/** A wall of one voxel, at even and odd positions, lets nothing through on any grid. */
void walls(Suite& suite)
{
  for (const int factor : { 2, 4 })
  {
    for (int position = 8; position < 12; ++position)
    {
      DiffusionScene scene({ { 24, 12, 11 } }, { { 1., 1., 1. } });
      scene.sigma_a.assign(scene.q.size(), 1e-3);
      for (int k = 0; k < 11; ++k)
      {
        for (int j = 0; j < 12; ++j)
        {
          scene.D[scene.index(position, j, k)] = 0.;
        }
      }
      scene.q[scene.index(4, 5, 6)] = 1.;
      // three corrections, which is not the tolerance
      const DiffusionReport report = solve(scene, factor);
      LT_CHECK(suite, report.reason == StopReason::MaxIterations && report.residual > 1e-8);
      LT_CHECK(suite, report.estimatedError >= 0. && !report.message.empty());
      double dark = 0.;
      double lit = 0.;
      for (int k = 0; k < 11; ++k)
      {
        for (int j = 0; j < 12; ++j)
        {
          for (int i = 0; i < 24; ++i)
          {
            double& most = i < position ? lit : dark;
            most = std::max(most, std::abs(scene.phi[scene.index(i, j, k)]));
          }
        }
      }
      LT_CHECK(suite, lit > 0.01 && dark <= 1e-12 * lit);
    }
  }
}

void accuracy(Suite& suite)
{
  for (const double sigma : { 1e-3, .05 })
  {
    DiffusionScene full = blobs({ { 37, 32, 29 } }, { { 1., 1., 1. } }, sigma);
    DiffusionScene two = full;
    DiffusionScene four = full;
    full.solve(1e-11);
    const DiffusionReport report = solve(two, 2);
    const DiffusionReport rough = solve(four, 4);
    const double error2 = Percentile95(two.phi, full.phi);
    const double error4 = Percentile95(four.phi, full.phi);
    std::cout << "sigma_a " << sigma << ": errors " << error2 << " (estimated "
              << report.estimatedError << "), " << error4 << " (" << rough.estimatedError << ")\n";
    LT_CHECK(suite, error2 < 0.01 && error4 < 0.4 && error2 < error4);
    LT_CHECK(suite, report.estimatedError > error2 / 5. && report.estimatedError < 5. * error2);
    LT_CHECK(suite, report.bytes < 50 * full.grid.size());
    // emitted = absorbed + escaped, as far as the field is right
    LT_CHECK_NEAR(suite, report.emitted, 1., 1e-12);
    LT_CHECK_NEAR(suite, report.absorbed + report.escaped, report.emitted, 0.02);
    // linear in q, and no scale of length is special
    DiffusionScene other = two;
    const double h = 1e-3;
    other.grid.spacing = { { h, h, h } };
    for (std::size_t i = 0; i < other.q.size(); ++i)
    {
      other.D[i] *= h;
      other.sigma_a[i] /= h;
      other.q[i] *= -1.;
    }
    solve(other, 2);
    double worst = 0.;
    for (std::size_t i = 0; i < other.q.size(); ++i)
    {
      worst = std::max(worst, std::abs(other.phi[i] / h + two.phi[i]) / two.phi[i]);
    }
    LT_CHECK_NEAR(suite, worst, 0., 1e-3);
    // nor does the number of threads matter
    DiffusionScene threads = full;
    solve(threads, 2, {}, lighttransport::testing::ThreadedFor(3));
    LT_CHECK_NEAR(suite, Percentile95(threads.phi, two.phi), 0., 1e-6);
  }
}

/** The named error is met with an honest estimate; an earlier field is a start. */
void named(Suite& suite)
{
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0., 1.);
  std::cout << "seed 3\n";
  for (int kind = 0; kind < 3; ++kind)
  {
    DiffusionScene full = blobs({ { 36, 36, 36 } }, { { 1., 1., 1. } }, kind == 1 ? .03 : 3e-3);
    for (double& D : full.D)
    {
      D *= kind == 2 ? std::pow(10., -uniform(random)) : 1.;
    }
    DiffusionScene scene = full;
    full.solve(1e-12);
    CoarseDiffusion coarse;
    coarse.setMedium(scene.medium(), 2);
    for (const double target : { .1, .01, .001 })
    {
      DiffusionControl control;
      control.targetError = target;
      const DiffusionReport report = coarse.solve(scene.q.data(), scene.phi.data(), control);
      const double error = Percentile95(scene.phi, full.phi);
      std::cout << "kind " << kind << ", target " << target << ": error " << error << ", estimated "
                << report.estimatedError << "\n";
      LT_CHECK(suite, report.reason == StopReason::Converged && error <= target);
      LT_CHECK(suite, report.estimatedError >= error / 3. && report.estimatedError <= 3. * error);
    }
    // a light moves: what is known stays
    scene.q[scene.index(12, 18, 18)] = 0.;
    scene.q[scene.index(20, 22, 10)] = 1.;
    full.q = scene.q;
    full.solve(1e-12);
    DiffusionControl control;
    control.targetError = .01;
    const DiffusionReport report = coarse.solve(scene.q.data(), scene.phi.data(), control, true);
    LT_CHECK(suite, report.reason == StopReason::Converged);
    LT_CHECK(suite, Percentile95(scene.phi, full.phi) <= .01);
    control.targetError = 0.;
    control.timeBudget = 1e-9;
    const DiffusionReport hasty = coarse.solve(scene.q.data(), scene.phi.data(), control);
    LT_CHECK(suite, hasty.reason == StopReason::MaxIterations && hasty.estimatedError > 0.);
    LT_CHECK(suite, hasty.message.find("budget") != std::string::npos);
    // without a correction nobody knows the residual, with or without a budget
    for (const double budget : { 1e-9, 0. })
    {
      control.timeBudget = budget;
      CoarseDiffusion preview;
      preview.setMedium(scene.medium(), 4, true);
      const DiffusionReport guess = preview.solve(scene.q.data(), scene.phi.data(), control);
      LT_CHECK(suite, guess.reason == StopReason::MaxIterations && guess.residual < 0.);
      LT_CHECK(suite, guess.message.find("guess") != std::string::npos);
    }
  }
}

void hardCases(Suite& suite)
{
  // one voxel, a row, a slice, odd sizes
  const std::array<int, 3> sizes[] = { { { 1, 1, 1 } }, { { 1, 1, 17 } }, { { 9, 1, 1 } },
    { { 13, 11, 1 } }, { { 2, 2, 2 } }, { { 5, 3, 7 } } };
  for (const std::array<int, 3>& dims : sizes)
  {
    for (const int factor : { 2, 4 })
    {
      DiffusionScene full(dims, { { 1., 1., 1. } });
      full.sigma_a.assign(full.q.size(), .01);
      full.q[full.q.size() / 2] = 1.;
      DiffusionScene scene = full;
      full.solve(1e-12);
      DiffusionControl control;
      control.targetError = .01;
      const DiffusionReport report = solve(scene, factor, control);
      const double error = Percentile95(scene.phi, full.phi);
      LT_CHECK(suite,
        error <= .01 || (report.reason == StopReason::MaxIterations && std::isfinite(error)));
    }
  }
  // hidden voxels are walls; nothing starts there
  DiffusionScene scene = blobs({ { 12, 12, 12 } }, { { 1., 1., 1. } }, .01);
  scene.outside.assign(scene.q.size(), 0);
  for (int j = 0; j < 12; ++j)
  {
    for (int k = 0; k < 12; ++k)
    {
      scene.outside[scene.index(7, j, k)] = 1;
      scene.D[scene.index(7, j, k)] = std::nan("");
    }
  }
  CoarseDiffusion coarse;
  LT_CHECK(suite, coarse.setMedium(scene.medium(), 2).reason == StopReason::Converged);
  DiffusionControl named;
  named.targetError = .01;
  LT_CHECK(
    suite, coarse.solve(scene.q.data(), scene.phi.data(), named).reason == StopReason::Converged);
  LT_CHECK(suite, scene.phi[scene.index(5, 6, 6)] > 0.01);
  LT_CHECK(suite, std::abs(scene.phi[scene.index(9, 6, 6)]) < 1e-14);
  bool dark = true;
  for (std::size_t i = 0; i < scene.outside.size(); ++i)
  {
    dark = dark && (!scene.outside[i] || scene.phi[i] == 0.);
  }
  LT_CHECK(suite, dark);

  // A closed room beside open matter: a cell has both, and the open part's sinks.
  DiffusionScene room({ { 40, 3, 1 } }, { { 1., 1., 1. } });
  room.D[room.index(17, 0, 0)] = room.D[room.index(17, 1, 0)] = room.D[room.index(17, 2, 0)] = 0.;
  for (int i = 0; i < 17; ++i)
  {
    room.D[room.index(i, 2, 0)] = 0.;
  }
  room.boundary = Boundary::ZeroFlux;
  for (int i = 18; i < 40; ++i)
  {
    room.sigma_a[room.index(i, 1, 0)] = .1;
  }
  room.q[room.index(15, 1, 0)] = 1.;
  for (const int factor : { 1, 2, 4, 8 })
  {
    const DiffusionReport refused = solve(room, factor);
    LT_CHECK(suite, refused.reason == StopReason::NoSteadyState);
    LT_CHECK(suite, refused.message.find("(15, 1, 0)") != std::string::npos);
    LT_CHECK(suite, room.phi[room.index(15, 1, 0)] == 0.);
  }
  // with a hole it is a scene like others, and nothing of positive light is negative
  room.D[room.index(17, 1, 0)] = 1e-3;
  for (const int factor : { 1, 2, 4, 8 })
  {
    LT_CHECK(suite, solve(room, factor).reason != StopReason::NoSteadyState);
    LT_CHECK(suite, *std::min_element(room.phi.begin(), room.phi.end()) >= 0.);
    LT_CHECK(suite, room.phi[room.index(15, 1, 0)] > 0.);
  }

  // refused as the full grid refuses
  DiffusionScene bad = blobs({ { 8, 8, 8 } }, { { 1., 1., 1. } }, .01);
  bad.D[5] = -1.;
  const DiffusionReport report = solve(bad, 2);
  LT_CHECK(suite, report.reason == StopReason::BadInput);
  LT_CHECK(suite, report.message.find("(5, 0, 0)") != std::string::npos);
  DiffusionScene closed = blobs({ { 8, 8, 8 } }, { { 1., 1., 1. } }, 0.);
  closed.boundary = Boundary::ZeroFlux;
  LT_CHECK(suite, solve(closed, 2).reason == StopReason::NoSteadyState);
  DiffusionControl control;
  control.progress = [](double) { return false; };
  DiffusionScene cancelled = blobs({ { 16, 16, 16 } }, { { 1., 1., 1. } }, .01);
  LT_CHECK(suite, solve(cancelled, 2, control).reason == StopReason::Cancelled);
  // no light
  DiffusionScene night = blobs({ { 8, 8, 8 } }, { { 1., 1., 1. } }, .01);
  night.q.assign(night.q.size(), 0.);
  night.phi.assign(night.phi.size(), 3.);
  LT_CHECK(suite, solve(night, 2).reason == StopReason::Converged);
  LT_CHECK(suite,
    *std::max_element(night.phi.begin(), night.phi.end()) == 0. &&
      *std::min_element(night.phi.begin(), night.phi.end()) == 0.);
  // contrast of 1e8 across one face, tiny and huge lengths and powers
  for (const double h : { 1e-9, 1e9 })
  {
    DiffusionScene extreme({ { 16, 16, 16 } }, { { h, h, h } });
    extreme.fill(extreme.D, [h](double x, double, double) { return x < 8. * h ? h : 1e-8 * h; });
    extreme.sigma_a.assign(extreme.q.size(), .01 / h);
    extreme.q[extreme.index(4, 8, 8)] = h < 1. ? 1e30 : -1e-30;
    DiffusionScene full = extreme;
    full.solve(1e-12);
    DiffusionControl one;
    one.targetError = .01;
    LT_CHECK(suite, solve(extreme, 2, one).reason == StopReason::Converged);
    LT_CHECK(suite, Percentile95(extreme.phi, full.phi) <= .01);
  }
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  identity(suite);
  walls(suite);
  accuracy(suite);
  named(suite);
  hardCases(suite);
  return suite.result();
}
