// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A medium and its sources for tests and benchmarks of the diffusion core, and the operator
 * again, written as the equations say and independently of the solver.
 */
#ifndef DiffusionScene_h
#define DiffusionScene_h

#include "Core/Diffusion.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

namespace lighttransport
{
namespace testing
{
/** What light moves through, and where it starts. */
template <class T>
struct MediumAndSource
{
  Grid grid;
  std::vector<T> D, sigma_a, q;
  std::vector<std::uint8_t> outside; ///< may be empty: nothing
  Boundary boundary = Boundary::Robin;
  double refractiveIndexRatio = 1.;

  MediumAndSource(std::array<int, 3> dims, std::array<double, 3> spacing)
  {
    this->grid.dims = dims;
    this->grid.spacing = spacing;
    const std::size_t n = static_cast<std::size_t>(this->grid.size());
    this->D.assign(n, T(1));
    this->sigma_a.assign(n, T(0));
    this->q.assign(n, T(0));
  }

  std::size_t index(int i, int j, int k) const
  {
    return static_cast<std::size_t>(this->grid.index(i, j, k));
  }

  DiffusionMedium<T> medium() const
  {
    DiffusionMedium<T> m;
    m.grid = this->grid;
    m.D = this->D.data();
    m.sigma_a = this->sigma_a.data();
    m.outside = this->outside.empty() ? nullptr : this->outside.data();
    m.boundary = this->boundary;
    m.refractiveIndexRatio = this->refractiveIndexRatio;
    return m;
  }
};

struct DiffusionScene : MediumAndSource<double>
{
  std::vector<double> phi;

  DiffusionScene(std::array<int, 3> dims, std::array<double, 3> spacing)
    : DiffusionScene(MediumAndSource<double>(dims, spacing))
  {
  }
  explicit DiffusionScene(MediumAndSource<double> scene)
    : MediumAndSource<double>(std::move(scene))
    , phi(this->q.size(), 0.)
  {
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

  /** D, which is none outside. */
  double conducts(std::size_t i) const
  {
    return !this->outside.empty() && this->outside[i] ? 0. : this->D[i];
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
          const double D = this->conducts(ci);
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
                const double sum = D + this->conducts(o);
                const double Df = sum > 0. ? 2. * D * this->conducts(o) / sum : 0.;
                r += Df * (this->phi[o] - this->phi[ci]) / (h * h);
              }
              else if (this->boundary == Boundary::Absorbing)
              {
                r -= D * this->phi[ci] / (0.5 * h) / h;
              }
              else if (this->boundary == Boundary::Robin)
              {
                // phi_face = u phi / (1 + u) from continuity of the current, d = h/2; u may be huge
                const double u = 2. * A * D / (0.5 * h);
                const double drop = this->phi[ci] / (1. + u);
                r -= D * drop / (0.5 * h) / h;
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

inline double Largest(const std::vector<double>& values)
{
  double most = 0.;
  for (const double v : values)
  {
    most = std::max(most, std::abs(v));
  }
  return most;
}

inline double LargestDifference(const std::vector<double>& a, const std::vector<double>& b)
{
  double most = 0.;
  for (std::size_t i = 0; i < a.size(); ++i)
  {
    most = std::max(most, std::abs(a[i] - b[i]));
  }
  return most;
}

/** |phi - exact| / |exact|, of Euclid's norm; |phi| where nothing is to be. */
inline double RelativeL2(const std::vector<double>& phi, const std::vector<double>& exact)
{
  double wrong = 0.;
  double all = 0.;
  for (std::size_t i = 0; i < phi.size(); ++i)
  {
    wrong += (phi[i] - exact[i]) * (phi[i] - exact[i]);
    all += exact[i] * exact[i];
  }
  return all > 0. ? std::sqrt(wrong / all) : std::sqrt(wrong);
}

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
