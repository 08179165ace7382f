// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A medium and its sources for tests of the diffusion core, and the operator
 * again, written as the equations say and independently of the solver.
 */
#ifndef DiffusionScene_h
#define DiffusionScene_h

#include "Core/Diffusion.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace lighttransport
{
namespace testing
{
struct DiffusionScene
{
  Grid grid;
  std::vector<double> D, sigma_a, q, phi;
  Boundary boundary = Boundary::Robin;
  double refractiveIndexRatio = 1.;

  DiffusionScene(std::array<int, 3> dims, std::array<double, 3> spacing)
  {
    this->grid.dims = dims;
    this->grid.spacing = spacing;
    const std::size_t n = static_cast<std::size_t>(this->grid.size());
    this->D.assign(n, 1.);
    this->sigma_a.assign(n, 0.);
    this->q.assign(n, 0.);
    this->phi.assign(n, 0.);
  }

  using Function = std::function<double(double x, double y, double z)>;
  /** Samples f at the voxel centres, which are at (i + 1/2) h. */
  void fill(std::vector<double>& values, const Function& f) const
  {
    std::size_t at = 0;
    for (int k = 0; k < this->grid.dims[2]; ++k)
    {
      for (int j = 0; j < this->grid.dims[1]; ++j)
      {
        for (int i = 0; i < this->grid.dims[0]; ++i)
        {
          values[at++] = f((i + 0.5) * this->grid.spacing[0], (j + 0.5) * this->grid.spacing[1],
            (k + 0.5) * this->grid.spacing[2]);
        }
      }
    }
  }

  DiffusionMedium<double> medium() const
  {
    DiffusionMedium<double> m;
    m.grid = this->grid;
    m.D = this->D.data();
    m.sigma_a = this->sigma_a.data();
    m.boundary = this->boundary;
    m.refractiveIndexRatio = this->refractiveIndexRatio;
    return m;
  }

  DiffusionReport solve(double tolerance = 1e-10, const ParallelFor& parallelFor = SerialFor)
  {
    DiffusionSolver solver(parallelFor);
    DiffusionReport report = solver.setMedium(this->medium());
    if (report.reason == StopReason::Converged)
    {
      DiffusionControl control;
      control.tolerance = tolerance;
      report = solver.solveSteady(this->q.data(), this->phi.data(), control);
    }
    return report;
  }

  /** |q - A phi| / |q|, with A as the equations have it. */
  double residual() const
  {
    const std::array<int, 3>& n = this->grid.dims;
    const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
    const double A = BoundaryFactor(this->refractiveIndexRatio);
    double rr = 0.;
    double qq = 0.;
    for (int k = 0; k < n[2]; ++k)
    {
      for (int j = 0; j < n[1]; ++j)
      {
        for (int i = 0; i < n[0]; ++i)
        {
          const int at[3] = { i, j, k };
          const std::int64_t c = this->grid.index(i, j, k);
          const std::size_t ci = static_cast<std::size_t>(c);
          double r = this->q[ci] - this->sigma_a[ci] * this->phi[ci];
          for (int d = 0; d < 3; ++d)
          {
            const double h = this->grid.spacing[d];
            for (int side = -1; side <= 1; side += 2)
            {
              if (n[d] == 1)
              {
                continue;
              }
              if (at[d] + side >= 0 && at[d] + side < n[d])
              {
                const std::size_t o = static_cast<std::size_t>(c + side * stride[d]);
                const double sum = this->D[ci] + this->D[o];
                const double Df = sum > 0. ? 2. * this->D[ci] * this->D[o] / sum : 0.;
                r += Df * (this->phi[o] - this->phi[ci]) / (h * h);
              }
              else if (this->boundary == Boundary::Absorbing)
              {
                r -= this->D[ci] * this->phi[ci] / (0.5 * h) / h;
              }
              else if (this->boundary == Boundary::Robin)
              {
                // phi_face = u phi / (1 + u) from continuity of the current, d = h/2; u may be huge
                const double u = 2. * A * this->D[ci] / (0.5 * h);
                const double drop = this->phi[ci] / (1. + u);
                r -= this->D[ci] * drop / (0.5 * h) / h;
              }
            }
          }
          rr += r * r;
          qq += this->q[ci] * this->q[ci];
        }
      }
    }
    return std::sqrt(rr / qq);
  }

  /** The largest |phi - exact| at the voxel centres. */
  double worst(const Function& exact) const
  {
    std::vector<double> expected(this->phi.size());
    this->fill(expected, exact);
    double e = 0.;
    for (std::size_t i = 0; i < expected.size(); ++i)
    {
      e = std::max(e, std::abs(expected[i] - this->phi[i]));
    }
    return e;
  }
};
/** 95th percentile of |phi - exact| / |exact| within six decades of the largest. */
inline double Percentile95(const std::vector<double>& phi, const std::vector<double>& exact)
{
  double largest = 0.;
  for (const double v : exact)
  {
    largest = std::max(largest, std::abs(v));
  }
  std::vector<double> errors;
  for (std::size_t i = 0; i < phi.size(); ++i)
  {
    if (std::abs(exact[i]) >= 1e-6 * largest)
    {
      errors.push_back(std::abs(phi[i] - exact[i]) / std::abs(exact[i]));
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors[errors.size() * 95 / 100];
}

} // namespace testing
} // namespace lighttransport

#endif
