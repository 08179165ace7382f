// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The solvers that bench-diffusion sets beside the project's own. Each is
 * compiled in where CMake found it; none is a dependency of the module.
 */
#ifndef DiffusionCompetitors_h
#define DiffusionCompetitors_h

#include "DiffusionProblem.h"

namespace lighttransport
{
namespace benchmark
{
/** One solve. A negative number means unknown. */
struct Run
{
  std::string failure;   ///< empty where there is an answer
  double assemble = -1.; ///< seconds to bring D and sigma_a into the solver's form, if it is told
  double setup = 0.;     ///< seconds, without assemble
  double solve = 0.;     ///< seconds
  double again = -1.;    ///< seconds of a second set-up and solve, in memory that the first left
  double cpu = -1.;      ///< CPU seconds of both, all threads: nearly blind to others' load
  int iterations = -1;
  double applications = -1.; ///< of the operator on the finest grid
  double bytes = -1.;        ///< beyond the input arrays
  double residual = -1.;     ///< judged by Residual()
  Errors errors;
  double seconds() const { return this->setup + this->solve; }
};

/**
 * Eigen's ConjugateGradient with IncompleteCholesky (natural ordering), double, one thread. The
 * matrix's assembly counts as assemble.
 */
Run SolveEigen(const Problem& problem, double tolerance, std::vector<double>& phi);

/**
 * OpenVDB's tools::poisson::solve, staggered: only for constant problems.
 * Copying in and out counts as assemble.
 */
Run SolveOpenVDB(const Problem& problem, double tolerance, int threads, std::vector<double>& phi);

/**
 * Grows a MaskTree from the problem's seed into what is lit, a voxel at a time, until nothing is
 * new. Returns how many voxels its leaves have in all; `seconds` is the growing's time.
 */
double GrowOpenVDB(const Problem& problem, const std::vector<std::uint8_t>& lit, double& seconds);
} // namespace benchmark
} // namespace lighttransport

#endif
