// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Measures what Module/Documentation/time.md says about steps in time:
 *
 *   bench-time [FOLDER]
 *
 * prints its numbers and leaves there, or in Testing/Temporary of its build, stability.csv (bounds
 * of r = c dt / h by the formulas and measured with the solvers' own steps), grid.csv (the thesis's
 * figure 3.6 and the staggered grid's answer) and front.csv (a front in 1-D), which bench-time.py
 * draws. It also times implicit steps in a constant medium against iterations.
 */
#include "CollocatedMoments.h"
#include "Core/FirstMoment.h"
#include "DiffusionScene.h"
#include "LightTransportTesting.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iostream>
#include <random>
#include <string>

using namespace lighttransport;
using lighttransport::testing::CollocatedMoments;
using lighttransport::testing::DiffusionScene;

namespace
{
const double* const NoSource = nullptr;

double normOf(const std::vector<double>& values)
{
  double sum = 0.;
  for (const double v : values)
  {
    sum += v * v;
  }
  return std::sqrt(sum);
}

/** beta and albedo as the thesis has them (g = 0), h = 1: D = beta, sigma_a = (1-alpha)/(3 beta).
 */
DiffusionScene homogeneous(int n, double beta, double alpha)
{
  DiffusionScene scene({ { n, n, n } }, { { 1., 1., 1. } });
  scene.boundary = Boundary::ZeroFlux;
  scene.D.assign(scene.D.size(), beta);
  scene.sigma_a.assign(scene.D.size(), (1. - alpha) / (3. * beta));
  return scene;
}

/** r at which the step operator's spectral radius is 1: power iteration on (phi - step phi) / r. */
double measuredStable(double beta, double alpha)
{
  DiffusionScene scene = homogeneous(20, beta, alpha);
  DiffusionSolver solver;
  solver.setMedium(scene.medium());
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1., 1.);
  for (double& phi : scene.phi)
  {
    phi = uniform(random);
  }
  const double r = 0.5 * solver.stabilityBound();
  double largest = 0.;
  for (int i = 0; i < 300; ++i)
  {
    const double norm = normOf(scene.phi);
    for (double& phi : scene.phi)
    {
      phi /= norm;
    }
    const std::vector<double> before = scene.phi;
    solver.stepExplicit(NoSource, scene.phi.data(), 1, r, DiffusionControl());
    for (std::size_t v = 0; v < before.size(); ++v)
    {
      scene.phi[v] = (before[v] - scene.phi[v]) / r;
    }
    largest = normOf(scene.phi);
  }
  return 2. / largest;
}

/** r at which a step leaves nothing in a voxel that was lit alone. */
double measuredPositive(double beta, double alpha)
{
  DiffusionScene scene = homogeneous(5, beta, alpha);
  DiffusionSolver solver;
  solver.setMedium(scene.medium());
  const std::size_t lit = static_cast<std::size_t>(scene.grid.index(2, 2, 2));
  scene.phi[lit] = 1.;
  const double r = 0.5 * solver.positivityBound();
  solver.stepExplicit(NoSource, scene.phi.data(), 1, r, DiffusionControl());
  return r / (1. - scene.phi[lit]);
}

/** The largest growth per step of |phi| over the last half of 2000 first-moment steps. */
double momentGrowth(FirstMomentSolver& solver, DiffusionScene& scene, double r)
{
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-1., 1.);
  for (double& phi : scene.phi)
  {
    phi = uniform(random);
  }
  solver.step(NoSource, scene.phi.data(), 1000, r, DiffusionControl());
  const double before = normOf(scene.phi);
  solver.step(NoSource, scene.phi.data(), 1000, r, DiffusionControl());
  return before > 1e-200 ? std::pow(normOf(scene.phi) / before, 1e-3) : 0.;
}

double thesisBound(double beta, double alpha)
{
  return 6. * beta / (72. * beta * beta + 9. * beta + 2. * (1. - alpha));
}

/** Growth per step of the thesis's eq. 4.8 in a medium of two betas; sign -1 is as printed. */
double thesisGrowth(double low, double alpha, double sign, double r)
{
  constexpr int n = 16;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0., 1.);
  std::vector<double> beta(static_cast<std::size_t>(n * n * n));
  std::vector<double> phi(beta.size());
  for (std::size_t i = 0; i < beta.size(); ++i)
  {
    beta[i] = uniform(random) < 0.5 ? low : 1.;
    phi[i] = uniform(random) - 0.5;
  }
  const auto index = [](int i, int j, int k)
  {
    const auto inside = [](int a)
    { return static_cast<std::size_t>(std::min(std::max(a, 0), n - 1)); };
    return inside(i) + n * (inside(j) + n * inside(k));
  };
  double growth = 0.;
  constexpr int measured = 1500; // after as many that let the fastest mode win
  for (int step = 0; step < 2 * measured; ++step)
  {
    const std::vector<double> p = phi;
    for (int k = 0; k < n; ++k)
    {
      for (int j = 0; j < n; ++j)
      {
        for (int i = 0; i < n; ++i)
        {
          const std::size_t c = index(i, j, k);
          const std::size_t next[3] = { index(i + 1, j, k), index(i, j + 1, k),
            index(i, j, k + 1) };
          const std::size_t last[3] = { index(i - 1, j, k), index(i, j - 1, k),
            index(i, j, k - 1) };
          double value = p[c] * (1. - r * (1. - alpha) / (3. * beta[c]));
          for (int d = 0; d < 3; ++d)
          {
            value += r * beta[c] * (p[next[d]] + p[last[d]] - 2. * p[c]);
            value += sign * 0.25 * r * (beta[next[d]] - beta[last[d]]) * (p[next[d]] - p[last[d]]);
          }
          phi[c] = value;
        }
      }
    }
    const double norm = normOf(phi);
    growth += step >= measured ? std::log(norm / normOf(p)) : 0.;
    for (double& v : phi)
    {
      v /= norm;
    }
  }
  return std::exp(growth / measured);
}

void stability(const std::string& folder)
{
  std::ofstream csv(folder + "/stability.csv");
  csv << "alpha,beta,thesis,stable,positive,measured stable,measured positive,first moment\n";
  double worst[2] = { 0., 0. };
  double growth = 0.;
  for (const double alpha : { 0., 0.9, 0.999 })
  {
    for (int i = 0; i <= 40; ++i)
    {
      const double beta = std::pow(10., -2. + 0.05 * i);
      const double stable = 6. * beta / (36. * beta * beta + 1. - alpha);
      const double positive = 3. * beta / (18. * beta * beta + 1. - alpha);
      csv << alpha << "," << beta << "," << thesisBound(beta, alpha) << "," << stable << ","
          << positive;
      if (i % 5 == 0)
      {
        const double measured[2] = { measuredStable(beta, alpha), measuredPositive(beta, alpha) };
        worst[0] = std::max(worst[0], std::abs(measured[0] / stable - 1.));
        worst[1] = std::max(worst[1], std::abs(measured[1] / positive - 1.));
        csv << "," << measured[0] << "," << measured[1];
      }
      else
      {
        csv << ",,";
      }
      DiffusionScene scene = homogeneous(12, beta, alpha);
      FirstMomentSolver moment;
      moment.setMedium(scene.medium());
      if (i % 20 == 0)
      {
        growth = std::max(growth, momentGrowth(moment, scene, moment.courantBound()));
      }
      csv << "," << moment.stabilityBound() << "\n";
    }
  }
  std::cout << "stable r measured within " << 100. * worst[0]
            << " % of 6b/(36b^2+1-a), positive r within " << 100. * worst[1]
            << " % of 3b/(18b^2+1-a)\n"
            << "first moment at r = 1: growth per step at most " << growth << "\n";
  for (const double alpha : { 0.9, 0.999, 1. })
  {
    for (const double low : { 0.1, 0.01 })
    {
      const double r = std::min(thesisBound(low, alpha), thesisBound(1., alpha));
      std::cout << "eq. 4.8 in a random medium of beta " << low << " and 1, albedo " << alpha
                << ", at the r of eq. 4.9 (" << r << "): growth per step "
                << thesisGrowth(low, alpha, -1., r) << " as printed, "
                << thesisGrowth(low, alpha, 1., r) << " with + grad D . grad phi\n";
    }
  }
}

/** One voxel lit, as in the thesis's figure 3.6, on common points and on the staggered grid. */
void grid(const std::string& folder)
{
  const int n = 33;
  const double sigma_a = 0.02;
  const double sigma_t = 0.5;
  DiffusionScene scene({ { n, n, 1 } }, { { 1., 1., 1. } });
  scene.boundary = Boundary::Absorbing;
  scene.D.assign(scene.D.size(), 1. / (3. * sigma_t));
  scene.sigma_a.assign(scene.D.size(), sigma_a);
  scene.q[scene.q.size() / 2] = 1.;
  CollocatedMoments thesis(n);
  FirstMomentSolver solver;
  solver.setMedium(scene.medium());
  for (int i = 0; i < 150; ++i)
  {
    thesis.step(scene.q, sigma_a, sigma_t, 0.1);
  }
  solver.step(scene.q.data(), scene.phi.data(), 150, 0.1, DiffusionControl());
  std::ofstream csv(folder + "/grid.csv");
  csv << "collocated,staggered\n";
  for (std::size_t i = 0; i < scene.phi.size(); ++i)
  {
    csv << thesis.phi[i] << "," << scene.phi[i] << "\n";
  }
}

/** sigma_a = sigma_t' = sigma: phi = exp(-sigma ct) (f(x - ct/sqrt 3) + f(x + ct/sqrt 3)) / 2. */
void front(const std::string& folder)
{
  const int n = 200;
  const double h = 0.1;
  const double sigma = 0.1;
  const double time = 9.;
  const auto f = [](double x)
  { return std::abs(x) < 2. ? std::pow(std::cos(0.25 * std::acos(-1.) * x), 4) : 0.; };
  DiffusionScene scene({ { n, 1, 1 } }, { { h, 1., 1. } });
  scene.boundary = Boundary::ZeroFlux;
  scene.D.assign(scene.D.size(), 1. / (3. * sigma));
  scene.sigma_a.assign(scene.D.size(), sigma);
  scene.fill(scene.phi, [&](double x, double, double) { return f(x - 10.); });
  std::vector<double> diffused = scene.phi;
  FirstMomentSolver solver;
  solver.setMedium(scene.medium());
  const int steps = static_cast<int>(std::ceil(time / (0.9 * solver.courantBound())));
  solver.step(NoSource, scene.phi.data(), steps, time / steps, DiffusionControl());
  DiffusionSolver diffusion;
  diffusion.setMedium(scene.medium());
  DiffusionControl control;
  control.implicitScheme = ImplicitScheme::SecondOrder;
  diffusion.stepImplicit(NoSource, diffused.data(), 200, time / 200, control);
  std::ofstream csv(folder + "/front.csv");
  csv << "x,exact,first moment,diffusion\n";
  for (int i = 0; i < n; ++i)
  {
    const double x = (i + 0.5) * h - 10.;
    const double far = time / std::sqrt(3.);
    csv << x << "," << std::exp(-sigma * time) * 0.5 * (f(x - far) + f(x + far)) << ","
        << scene.phi[static_cast<std::size_t>(i)] << "," << diffused[static_cast<std::size_t>(i)]
        << "\n";
  }
}
/** 20 implicit steps at 64^3 in a constant medium: all at once, and by iterations. */
void implicitSteps()
{
  DiffusionScene scene = homogeneous(64, 0.5, 0.99);
  scene.boundary = Boundary::Robin;
  scene.q[static_cast<std::size_t>(scene.grid.index(20, 25, 30))] = 1.;
  const std::vector<std::uint8_t> nothing(scene.q.size(), 0);
  std::cout << "\n20 implicit steps in a constant medium, 64^3, one thread, medians of 9:\n"
            << "scheme, c dt / positivity bound, s at once, s by iterations, ratio, difference\n";
  for (const bool second : { false, true })
  {
    for (const double length : { 10., 1000. })
    {
      std::vector<double> fields[2];
      double seconds[2];
      for (std::size_t way = 0; way < 2; ++way)
      {
        DiffusionMedium<double> medium = scene.medium();
        medium.outside = way == 1 ? nothing.data() : nullptr; // then none is taken for constant
        DiffusionControl control;
        control.implicitScheme =
          second ? ImplicitScheme::SecondOrder : ImplicitScheme::BackwardEuler;
        std::vector<double> times;
        for (int i = 0; i < 9; ++i)
        {
          fields[way].assign(scene.q.size(), 0.);
          const auto began = std::chrono::steady_clock::now();
          DiffusionSolver solver;
          solver.setMedium(medium);
          solver.stepImplicit(
            scene.q.data(), fields[way].data(), 20, length * solver.positivityBound(), control);
          times.push_back(
            std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count());
        }
        std::sort(times.begin(), times.end());
        seconds[way] = times[times.size() / 2];
      }
      double most = 0.;
      double worst = 0.;
      for (std::size_t i = 0; i < scene.q.size(); ++i)
      {
        most = std::max(most, fields[1][i]);
        worst = std::max(worst, std::abs(fields[1][i] - fields[0][i]));
      }
      std::cout << (second ? "SDIRK2" : "backward Euler") << ", " << length << ", " << seconds[0]
                << ", " << seconds[1] << ", " << seconds[1] / seconds[0] << ", " << worst / most
                << "\n";
    }
  }
}
} // namespace

int main(int argc, char* argv[])
{
  const std::string folder = argc > 1 ? argv[1] : lighttransport::testing::temporaryFolder(argv[0]);
  stability(folder);
  grid(folder);
  front(folder);
  implicitSteps();
  return std::ofstream(folder + "/front.csv", std::ios::app).good() ? 0 : 1;
}
