// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "DiffusionCompetitors.h"

#include "Core/Watched.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>

namespace lighttransport
{
namespace benchmark
{
Run SolveEigen(const Problem& problem, double tolerance, std::vector<double>& phi)
{
  Run run;
  double began = now();
  const std::array<int, 3>& n = problem.grid.dims;
  const int size = static_cast<int>(problem.grid.size());
  const int stride[3] = { 1, n[0], n[0] * n[1] };
  // The lower triangle, by columns.
  Eigen::SparseMatrix<double> A(size, size);
  A.reserve(Eigen::VectorXi::Constant(size, 4));
  Eigen::VectorXd b(size);
  for (int i = 0; i < size; ++i)
  {
    const int at[3] = { i % n[0], i / n[0] % n[1], i / stride[2] };
    const double D = static_cast<double>(problem.D[static_cast<std::size_t>(i)]);
    double diagonal = static_cast<double>(problem.sigma_a[static_cast<std::size_t>(i)]);
    double above[3] = { 0., 0., 0. };
    for (int d = 0; d < 3; ++d)
    {
      for (int side = -1; side <= 1; side += 2)
      {
        if (at[d] + side < 0 || at[d] + side >= n[d])
        {
          diagonal += BorderSink(D, problem.boundary);
          continue;
        }
        const int next = i + side * stride[d];
        const double g =
          FaceConductance(D, static_cast<double>(problem.D[static_cast<std::size_t>(next)]));
        diagonal += g;
        above[d] = side > 0 ? g : above[d];
      }
    }
    A.insert(i, i) = diagonal;
    for (int d = 0; d < 3; ++d)
    {
      if (above[d] > 0.)
      {
        A.insert(i + stride[d], i) = -above[d];
      }
    }
    b[i] = static_cast<double>(problem.q[static_cast<std::size_t>(i)]);
  }
  A.makeCompressed();
  run.assemble = now() - began;

  began = now();
  Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower,
    Eigen::IncompleteCholesky<double, Eigen::Lower, Eigen::NaturalOrdering<int>>>
    solver;
  solver.setTolerance(tolerance);
  solver.compute(A);
  run.setup = now() - began;
  began = now();
  const Eigen::VectorXd x = solver.solve(b);
  run.solve = now() - began;
  run.iterations = static_cast<int>(solver.iterations());
  phi.assign(x.data(), x.data() + size);
  if (solver.info() != Eigen::Success)
  {
    run.failure = "Eigen did not converge";
  }
  return run;
}
} // namespace benchmark
} // namespace lighttransport
