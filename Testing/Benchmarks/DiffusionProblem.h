// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * What bench-diffusion solves, the operator in double as the equations have it
 * (independent of every solver that is measured), and the judges: the residual
 * and the errors that all competitors are held to.
 */
#ifndef DiffusionProblem_h
#define DiffusionProblem_h

#include "Core/Diffusion.h"

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace lighttransport
{
namespace benchmark
{
/** Robin (index-matched) or absorbing border, spacing 1 along every axis. */
struct Problem
{
  std::string name;
  Grid grid;
  Boundary boundary = Boundary::Robin;
  std::vector<float> D;       ///< voxels
  std::vector<float> sigma_a; ///< 1/voxels
  std::vector<float> q;       ///< a point source of power 1
  std::int64_t seed = 0;
  bool constant = false; ///< D = 1, sigma_a = 0

  DiffusionMedium<float> medium() const;
};

/** Two of them are issue 3's. floor 1e-4 with albedo .99 and 1e-6 with .999. */
struct MediumRecipe
{
  double contrast; ///< 0: constant
  double albedo;
};

/**
 * A procedural volume of n^3 voxels: a body with blobs of tissue and vessels, texture, and white
 * noise in every voxel. The shapes scale with n, while edges and noise keep their widths in
 * voxels, as in images of finer resolution.
 */
std::vector<float> MakeVolume(int n, const ParallelFor& parallelFor);

/**
 * D = exp(-(|grad S| / sigma)^2), at least 1 / contrast, of the volume S;
 * sigma_a = (1 - albedo) / (3 D). One voxel of open tissue emits.
 * Constant: D = 1 with a border of 0, and no need of S.
 */
Problem MakeProblem(
  int n, const std::vector<float>& S, const MediumRecipe& recipe, const ParallelFor& parallelFor);

/** The face between two voxels' D, spacing 1. */
inline double FaceConductance(double a, double b)
{
  return 2. * a * b / (a + b);
}

/** What a border face of a voxel takes away, per phi; A = 1. */
inline double BorderSink(double D, Boundary boundary)
{
  return boundary == Boundary::Robin  ? D / (0.5 + 2. * D)
    : boundary == Boundary::Absorbing ? D / 0.5
                                      : 0.;
}

/** |q - A phi| / |q| in double; r, where given, receives q - A phi. */
double Residual(
  const Problem& problem, const double* phi, double* r, const ParallelFor& parallelFor);

/** To |q - A phi| / |q| <= 1e-12 or what double reaches, by iterative refinement. */
std::vector<double> ReferenceSolution(
  const Problem& problem, double& residual, const ParallelFor& parallelFor);

struct Errors
{
  double p95 = std::nan("");        ///< 95th percentile of |phi - phi*| / |phi*| over ...
  double relativeL2 = std::nan(""); ///< |phi - phi*| / |phi*|
};
/** ... the voxels in which phi* is within 6 decades of its maximum. */
Errors FindErrors(const double* phi, const std::vector<double>& reference);
} // namespace benchmark
} // namespace lighttransport

#endif
