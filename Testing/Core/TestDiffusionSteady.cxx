// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** The steady state against closed forms, manufactured solutions and invariants. */
#include "DiffusionScene.h"
#include "LightTransportTesting.h"
#include "ThreadedFor.h"

#include <random>

using namespace lighttransport;
using lighttransport::testing::DiffusionScene;
using lighttransport::testing::Suite;

namespace
{
const double Pi = std::acos(-1.);

/** Order observed between two resolutions a factor 2 apart. */
double order(double coarse, double fine)
{
  return std::log2(coarse / fine);
}

/** A uniform source between two parallel borders, on each axis and boundary. */
void slab(Suite& suite)
{
  for (int axis = 0; axis < 3; ++axis)
  {
    for (const Boundary boundary : { Boundary::Robin, Boundary::Absorbing, Boundary::ZeroFlux })
    {
      for (const double eta : { 1., 1.4 })
      {
        const double L = 3.;
        const double D = 0.4;
        const double sigma = 0.7;
        const double mu = std::sqrt(sigma / D);
        const double twoA =
          boundary == Boundary::Robin ? 2. * BoundaryFactor(eta) : 0.; // Absorbing: A = 0
        const auto exact = [&](double x)
        {
          if (boundary == Boundary::ZeroFlux)
          {
            return 2. / sigma;
          }
          return 2. / sigma *
            (1. -
              std::cosh(mu * (x - L / 2)) /
                (std::cosh(mu * L / 2) + twoA * D * mu * std::sinh(mu * L / 2)));
        };
        double error[2];
        for (int level = 0; level < 2; ++level)
        {
          std::array<int, 3> dims{ { 1, 1, 1 } };
          std::array<double, 3> spacing{ { 0.3, 0.2, 0.5 } };
          dims[axis] = 40 << level;
          spacing[axis] = L / dims[axis];
          DiffusionScene scene(dims, spacing);
          scene.boundary = boundary;
          scene.refractiveIndexRatio = eta;
          scene.fill(scene.D, [&](double, double, double) { return D; });
          scene.fill(scene.sigma_a, [&](double, double, double) { return sigma; });
          scene.fill(scene.q, [&](double, double, double) { return 2.; });
          const DiffusionReport report = scene.solve(1e-12);
          LT_CHECK(suite, report.reason == StopReason::Converged);
          error[level] = scene.worst(
            [&](double x, double y, double z) {
              return exact(axis == 0 ? x : axis == 1 ? y : z);
            });
          LT_CHECK_CLOSE(suite, report.absorbed + report.escaped, report.emitted, 1e-9);
          // the flux through the border is what escapes: D phi' there, closed form
          if (boundary == Boundary::ZeroFlux)
          {
            LT_CHECK_NEAR(suite, report.escaped, 0., 1e-12);
          }
        }
        std::cout << "slab, axis " << axis << ", boundary " << static_cast<int>(boundary)
                  << ", eta " << eta << ": " << error[0] << ", " << error[1] << "\n";
        LT_CHECK(suite, error[1] < 1e-3);
        LT_CHECK(suite, boundary == Boundary::ZeroFlux || order(error[0], error[1]) > 1.85);
      }
    }
  }
}

/** sin sin sin with phi = 0 walls, anisotropic spacing: second order. */
void eigenfunction(Suite& suite)
{
  const double D = 0.5;
  const double sigma = 2.;
  const auto exact = [](double x, double y, double z)
  { return std::sin(Pi * x) * std::sin(Pi * y) * std::sin(Pi * z); };
  double error[2];
  for (int level = 0; level < 2; ++level)
  {
    const std::array<int, 3> dims{ { 12 << level, 16 << level, 20 << level } };
    DiffusionScene scene(dims, { { 1. / dims[0], 1. / dims[1], 1. / dims[2] } });
    scene.boundary = Boundary::Absorbing;
    scene.D.assign(scene.D.size(), D);
    scene.sigma_a.assign(scene.D.size(), sigma);
    scene.fill(scene.q,
      [&](double x, double y, double z) { return (sigma + 3. * D * Pi * Pi) * exact(x, y, z); });
    LT_CHECK(suite, scene.solve().reason == StopReason::Converged);
    error[level] = scene.worst(exact);
  }
  LT_CHECK(suite, error[1] < 4e-3);
  LT_CHECK_NEAR(suite, order(error[0], error[1]), 2., 0.15);
}

/**
 * A manufactured solution with varying D: div(D grad phi) = D lap phi + grad D . grad phi.
 * With the minus sign of the thesis's eq. 4.3, the answer does not even converge.
 */
void manufactured(Suite& suite)
{
  const auto D = [](double x, double y, double z)
  { return 1. + 0.6 * std::sin(2. * x + 1.) * std::cos(3. * y) * std::cos(z); };
  const auto exact = [](double x, double y, double z)
  { return 2. + std::cos(Pi * x) * std::cos(2. * Pi * y) * std::cos(Pi * z); };
  const double sigma = 1.5;
  const auto source = [&](double sign)
  {
    return [=](double x, double y, double z)
    {
      const double dDx = 1.2 * std::cos(2. * x + 1.) * std::cos(3. * y) * std::cos(z);
      const double dDy = -1.8 * std::sin(2. * x + 1.) * std::sin(3. * y) * std::cos(z);
      const double dDz = -0.6 * std::sin(2. * x + 1.) * std::cos(3. * y) * std::sin(z);
      const double px = -Pi * std::sin(Pi * x) * std::cos(2. * Pi * y) * std::cos(Pi * z);
      const double py = -2. * Pi * std::cos(Pi * x) * std::sin(2. * Pi * y) * std::cos(Pi * z);
      const double pz = -Pi * std::cos(Pi * x) * std::cos(2. * Pi * y) * std::sin(Pi * z);
      const double laplacian = -6. * Pi * Pi * (exact(x, y, z) - 2.);
      return -(D(x, y, z) * laplacian + sign * (dDx * px + dDy * py + dDz * pz)) +
        sigma * exact(x, y, z);
    };
  };
  for (const double sign : { 1., -1. })
  {
    double error[2];
    for (int level = 0; level < 2; ++level)
    {
      const std::array<int, 3> dims{ { 14 << level, 24 << level, 12 << level } };
      DiffusionScene scene(dims, { { 1. / dims[0], 1. / dims[1], 1. / dims[2] } });
      scene.boundary = Boundary::ZeroFlux;
      scene.fill(scene.D, D);
      scene.sigma_a.assign(scene.D.size(), sigma);
      scene.fill(scene.q, source(sign));
      LT_CHECK(suite, scene.solve().reason == StopReason::Converged);
      error[level] = scene.worst(exact);
    }
    std::cout << "sign " << sign << ": errors " << error[0] << ", " << error[1] << ", order "
              << order(error[0], error[1]) << "\n";
    if (sign > 0.)
    {
      LT_CHECK_NEAR(suite, order(error[0], error[1]), 2., 0.2);
      LT_CHECK(suite, error[1] < 0.01);
    }
    else
    {
      LT_CHECK(suite, error[1] > 0.1 && order(error[0], error[1]) < 0.2);
    }
  }
}

/** A point source in (nearly) infinite space: exp(-mu r) / (4 pi D r), Ishimaru 1978. */
void pointSource(Suite& suite)
{
  const double sigma = 0.1;
  const double D = 1. / (3. * (sigma + 10.));
  const auto fluence = [&](int perUnit, double r)
  {
    const int n = 5 * perUnit + 1;
    const double h = 1. / perUnit;
    DiffusionScene scene({ { n, n, n } }, { { h, h, h } });
    scene.D.assign(scene.D.size(), D);
    scene.sigma_a.assign(scene.D.size(), sigma);
    const int c = n / 2;
    scene.q[scene.index(c, c, c)] = 1. / (h * h * h);
    LT_CHECK(suite, scene.solve().reason == StopReason::Converged);
    // along an axis and along a diagonal of a face, in the mean: less of the grid's direction
    const int steps = static_cast<int>(std::lround(r * perUnit));
    return scene.phi[scene.index(c + steps, c, c)];
  };
  const double coarse = fluence(8, 1.);
  const double fine = fluence(16, 1.);
  LT_CHECK_CLOSE(suite, fine, .4229226, 0.01);
  // second order: extrapolated, the grid's error is gone and the border's (2.5 away) is left
  LT_CHECK_CLOSE(suite, fine + (fine - coarse) / 3., .4229226, 0.003);
  LT_CHECK_CLOSE(suite, fluence(16, .25), 6.241656, 0.03);
}

/** Linear in q, exactly odd, independent of units, of threads and of the axes' order. */
void invariants(Suite& suite)
{
  const unsigned int seed = 20;
  std::cout << "seed " << seed << "\n";
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0., 1.);
  const std::array<int, 3> dims{ { 17, 12, 9 } };
  DiffusionScene base(dims, { { 1., 0.7, 1.9 } });
  for (std::size_t i = 0; i < base.D.size(); ++i)
  {
    base.D[i] = std::pow(10., -4. * uniform(random));
    base.sigma_a[i] = 0.05 * uniform(random);
  }
  DiffusionScene a = base;
  DiffusionScene b = base;
  DiffusionScene both = base;
  a.q[a.index(4, 5, 6)] = 1.;
  b.q[a.index(13, 3, 2)] = -0.7;
  for (std::size_t i = 0; i < base.q.size(); ++i)
  {
    both.q[i] = 3. * a.q[i] + b.q[i];
  }
  LT_CHECK(suite, a.solve(1e-13).reason == StopReason::Converged);
  b.solve(1e-13);
  both.solve(1e-13);
  LT_CHECK(suite, a.residual() <= 1.1e-13); // the equations' own, in double
  double largest = 0.;
  double error = 0.;
  for (std::size_t i = 0; i < base.q.size(); ++i)
  {
    largest = std::max(largest, std::abs(both.phi[i]));
    error = std::max(error, std::abs(both.phi[i] - 3. * a.phi[i] - b.phi[i]));
  }
  LT_CHECK_NEAR(suite, error / largest, 0., 1e-10);

  DiffusionScene minus = a;
  minus.phi.assign(minus.phi.size(), 0.);
  for (double& q : minus.q)
  {
    q = -q;
  }
  minus.solve(1e-13);
  double sum = 0.;
  for (std::size_t i = 0; i < base.q.size(); ++i)
  {
    sum = std::max(sum, std::abs(minus.phi[i] + a.phi[i]));
  }
  LT_CHECK(suite, sum == 0.);
  DiffusionScene cancelled = base;
  const DiffusionReport none = cancelled.solve();
  LT_CHECK(suite, none.reason == StopReason::Converged && none.iterations == 0);

  // lengths times u: D u, sigma_a / u, q / u leave phi
  for (const double u : { 1e-9, 1e3, 1e9 })
  {
    DiffusionScene scaled = a;
    scaled.phi.assign(scaled.phi.size(), 0.);
    for (std::size_t i = 0; i < base.q.size(); ++i)
    {
      scaled.D[i] *= u;
      scaled.sigma_a[i] /= u;
      scaled.q[i] /= u;
    }
    for (double& h : scaled.grid.spacing)
    {
      h *= u;
    }
    LT_CHECK(suite, scaled.solve(1e-13).reason == StopReason::Converged);
    double difference = 0.;
    for (std::size_t i = 0; i < base.q.size(); ++i)
    {
      difference = std::max(difference, std::abs(scaled.phi[i] - a.phi[i]) / a.phi[i]);
    }
    LT_CHECK_NEAR(suite, difference, 0., 1e-5);
  }

  DiffusionScene threaded({ { 64, 33, 31 } }, { { 1., 1., 1. } });
  threaded.sigma_a.assign(threaded.q.size(), 0.01);
  threaded.q[40000] = 1.;
  DiffusionScene serial = threaded;
  threaded.solve(1e-8, lighttransport::testing::ThreadedFor(3));
  serial.solve(1e-8);
  LT_CHECK(suite, threaded.phi == serial.phi);
}

void fresnel(Suite& suite)
{
  LT_CHECK(suite, DiffuseFresnelReflectance(1.) == 0. && BoundaryFactor(1.) == 1.);
  // Internal diffuse reflectance of n = 1.5: 0.5963 (Judd 1942, J. Res. NBS 29, 329)
  LT_CHECK_NEAR(suite, DiffuseFresnelReflectance(1.5), 0.5963, 5e-4);
  for (const double eta : { 1.2, 1.3, 1.4, 1.6 })
  {
    const double fit = -1.440 / (eta * eta) + 0.710 / eta + 0.668 + 0.0636 * eta;
    LT_CHECK_NEAR(suite, DiffuseFresnelReflectance(eta), fit, 0.01);
    // radiance reciprocity: eta^2 (1 - F inside) = 1 - F outside
    LT_CHECK_NEAR(suite, eta * eta * (1. - DiffuseFresnelReflectance(eta)),
      1. - DiffuseFresnelReflectance(1. / eta), 1e-5);
  }
}

/** -D phi' at the voxels of a slab with Robin borders, its border voxels too. */
void flux(Suite& suite)
{
  const double L = 3.;
  const double D = 0.4;
  const double sigma = 0.7;
  const double mu = std::sqrt(sigma / D);
  for (int axis = 0; axis < 3; ++axis)
  {
    std::array<int, 3> dims{ { 2, 2, 2 } };
    dims[axis] = 120;
    std::array<double, 3> spacing{ { 1., 1., 1. } };
    spacing[axis] = L / dims[axis];
    // a far border across: nearly one-dimensional needs mirrors, which Robin is not; take one voxel
    for (int d = 0; d < 3; ++d)
    {
      dims[d] = d == axis ? dims[d] : 1;
    }
    DiffusionScene scene(dims, spacing);
    scene.D.assign(scene.D.size(), D);
    scene.sigma_a.assign(scene.D.size(), sigma);
    scene.q.assign(scene.D.size(), 2.);
    DiffusionSolver solver;
    LT_CHECK(suite, solver.setMedium(scene.medium()).reason == StopReason::Converged);
    DiffusionControl control;
    solver.solveSteady(scene.q.data(), scene.phi.data(), control);
    std::vector<double> E(3 * scene.phi.size());
    solver.flux(scene.phi.data(), E.data());
    double worst = 0.;
    double across = 0.;
    for (std::size_t i = 0; i < scene.phi.size(); ++i)
    {
      const double x = (static_cast<double>(i) + 0.5) * L / 120.;
      const double exact = 2. / sigma * D * mu * std::sinh(mu * (x - L / 2)) /
        (std::cosh(mu * L / 2) + 2. * D * mu * std::sinh(mu * L / 2));
      worst = std::max(worst, std::abs(E[3 * i + axis] - exact));
      across = std::max(across, std::abs(E[3 * i + (axis + 1) % 3]));
    }
    LT_CHECK_NEAR(suite, worst, 0., 1e-3);
    LT_CHECK(suite, across == 0.);
  }
}
/** Noise over three decades with a source of either sign, at 33 x 40 x 44 or other sizes. */
DiffusionScene noise(const std::array<int, 3>& dims, Boundary boundary)
{
  DiffusionScene scene(dims, { { 0.7, 1., 1.1 } });
  scene.boundary = boundary;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> decades(-3., 0.);
  for (std::size_t i = 0; i < scene.D.size(); ++i)
  {
    scene.D[i] = std::pow(10., decades(random));
    scene.sigma_a[i] = 1e-2 * std::pow(10., decades(random));
  }
  scene.q[scene.q.size() / 3] = 1.;
  scene.q[scene.q.size() / 2] = -0.2;
  return scene;
}

/** The faces of a rough solve are computed when they are read: the same operator, less memory. */
void frugal(Suite& suite)
{
  for (const Boundary boundary : { Boundary::Robin, Boundary::Absorbing, Boundary::ZeroFlux })
  {
    if (lighttransport::testing::LookingForRaces && boundary != Boundary::Robin)
    {
      continue; // it changes the sinks, not the order of work
    }
    DiffusionScene scene = noise({ { 33, 40, 44 } }, boundary);
    const double size = static_cast<double>(scene.grid.size());
    DiffusionSolver solver(lighttransport::testing::ThreadedFor(3));
    DiffusionControl control;
    control.tolerance = 1e-4;
    LT_CHECK(suite, solver.setMedium(scene.medium()).reason == StopReason::Converged);
    const DiffusionReport rough = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
    std::cout << "frugal: " << static_cast<double>(rough.bytes) / size << " bytes per voxel, "
              << rough.iterations << " iterations\n";
    LT_CHECK(suite, rough.reason == StopReason::Converged);
    LT_CHECK(suite, static_cast<double>(rough.bytes) <= 32. * size);
    LT_CHECK_CLOSE(suite, scene.residual(), rough.residual, 1e-6);
    LT_CHECK(suite, scene.residual() <= 1e-4);
    // on with a sharper tolerance, and then with steps, which need the faces again
    control.tolerance = 1e-9;
    const DiffusionReport sharp = solver.solveSteady(scene.q.data(), scene.phi.data(), control);
    LT_CHECK(suite, sharp.reason == StopReason::Converged);
    LT_CHECK(suite, scene.residual() <= 1e-9);
    std::vector<double> computed(3 * scene.D.size());
    solver.flux(scene.phi.data(), computed.data());
    DiffusionScene other = noise({ { 33, 40, 44 } }, boundary);
    DiffusionSolver fresh(SerialFor);
    fresh.setMedium(other.medium());
    std::vector<double> stored(computed.size());
    fresh.flux(scene.phi.data(), stored.data());
    double difference = 0.;
    double largest = 0.;
    for (std::size_t i = 0; i < stored.size(); ++i)
    {
      difference = std::max(difference, std::abs(stored[i] - computed[i]));
      largest = std::max(largest, std::abs(stored[i]));
    }
    LT_CHECK(suite, difference <= 1e-6 * largest);
    control.tolerance = 1e-6;
    const DiffusionReport steps =
      solver.stepExplicit(scene.q.data(), scene.phi.data(), 2, solver.positivityBound(), control);
    LT_CHECK(suite, steps.reason == StopReason::Converged);
  }
}

/** Tiles are an order of work, nothing more: long, flat and odd boxes converge as well. */
void tiles(Suite& suite)
{
  for (const std::array<int, 3>& dims : { std::array<int, 3>{ { 37, 61, 29 } },
         std::array<int, 3>{ { 5, 7, 1201 } }, std::array<int, 3>{ { 5, 1201, 7 } },
         std::array<int, 3>{ { 1201, 5, 7 } }, std::array<int, 3>{ { 190, 190, 1 } },
         std::array<int, 3>{ { 1, 190, 190 } }, std::array<int, 3>{ { 3, 130, 100 } } })
  {
    DiffusionScene scene = noise(dims, Boundary::Robin);
    const DiffusionReport report = scene.solve(1e-8, lighttransport::testing::ThreadedFor(3));
    std::cout << "tiles: " << dims[0] << " x " << dims[1] << " x " << dims[2] << ", "
              << report.iterations << " iterations\n";
    LT_CHECK(suite, report.reason == StopReason::Converged);
    LT_CHECK(suite, scene.residual() <= 1e-8);
    LT_CHECK(suite, report.iterations <= 25);
    if (lighttransport::testing::LookingForRaces)
    {
      continue;
    }
    DiffusionScene alone = noise(dims, Boundary::Robin);
    alone.solve(1e-8);
    LT_CHECK(suite, alone.phi == scene.phi); // whatever the threads
  }
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  frugal(suite);
  tiles(suite);
  if (lighttransport::testing::LookingForRaces)
  {
    return suite.result();
  }
  slab(suite);
  eigenfunction(suite);
  manufactured(suite);
  pointSource(suite);
  invariants(suite);
  fresnel(suite);
  flux(suite);
  return suite.result();
}
