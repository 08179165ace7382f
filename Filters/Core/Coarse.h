// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The steady diffusion of Diffusion.h on a coarser grid, with the physics of the full one: D and
 * sigma_a are not resampled, since a wall of one voxel would leak. Instead, per cell of
 * f x f x f voxels,
 *
 *   1. a face is a network of resistors from one cell's middle to the next one's: the voxels'
 *      h^2/D in series along each of the f^2 lines, these in parallel (no exchange between
 *      lines: a lower bound of the conductance), or the voxels of each layer in parallel, these
 *      in series (full exchange: an upper bound); three parts of the first, one of the second. A
 *      border face is one end of such a network in series with the border's own resistance.
 *   2. a sink counts by what light is left at its voxel: psi, what two sweeps of the full
 *      equations without source make of 1, relative to the best voxel of the cell (an absorbing
 *      wall keeps none of the light that falls on it); strong ones by more, so that light is
 *      damped as much per length on cells as on voxels.
 *   3. a source is given to the eight cells around its voxel by the weights of 4.
 *   4. a voxel's phi is psi times the eight cells' around it, along each axis by the balance of
 *      flux on the line that joins their middles; then sweeps of the full grid's equations.
 *   5. the residual that the full equations have left, restricted by the transpose of 4. and
 *      solved for on the cells, corrects phi. This is a two-grid method whose full grid is never
 *      assembled: the corrections shrink about fivefold each, and tell the error that is left.
 *
 * Axes are coarsened until a cell is about as long along each: f voxels of the finest axis.
 * Memory: 12 bytes per voxel and the coarse solver's.
 */
#ifndef LightTransport_Core_Coarse_h
#define LightTransport_Core_Coarse_h

#include "Core/Diffusion.h"

namespace lighttransport
{
class CoarseDiffusion
{
public:
  explicit CoarseDiffusion(ParallelFor parallelFor = SerialFor);

  /**
   * factor: 1 .. 8 voxels of the finest axis per cell; 1 is the full grid itself. The medium's
   * arrays must outlive the solves. Answers BadInput as DiffusionSolver::setMedium does.
   * In haste, psi is told from each voxel alone, and solve makes no sweeps and no corrections for
   * which control.timeBudget is too short: a third of the time of the least that is done otherwise,
   * for a field that may be wrong by its own order. Its estimated error is then 1, a guess.
   */
  template <class T>
  DiffusionReport setMedium(const DiffusionMedium<T>& medium, int factor, bool inHaste = false,
    const ProgressFunction& progress = {});

  /**
   * phi: in, with fromPhi, the start; out, the answer reached. Without a named error or a time
   * budget, three corrections are made. The report's estimated errors are against the full grid's
   * answer, its powers the full grid's; its residual is that of the full grid's equations before
   * the last correction, negative (not known) where haste left no time for one. MaxIterations where
   * the corrections do not reach control.targetError, or, without one, control.tolerance: phi is
   * then the best so far. phi keeps the sign of sources that have but one.
   */
  template <class Q>
  DiffusionReport solve(
    const Q* q, double* phi, const DiffusionControl& control, bool fromPhi = false);

  const Grid& grid() const { return this->fine; }
  std::int64_t bytes() const;

private:
  template <class T>
  DiffusionReport prepare(const DiffusionMedium<T>& medium, int factor, bool inHaste);
  template <class Q>
  void correct(const Q* q, double* phi, const DiffusionControl& control, bool fromPhi,
    DiffusionReport& report);
  /** Row r of the medium as floats: D in parts of the largest, sigma_a as it stands in A. */
  void load(std::int64_t row, float* D, float* s) const;
  int cells(int d, int cell) const
  {
    return std::min(this->factors[d], this->fine.dims[d] - cell * this->factors[d]);
  }
  /** The cell beside its own that voxel i takes part in; may lie beyond the box. */
  int neighbour(int d, int i) const
  {
    const int cell = i / this->factors[d];
    return cell + (2 * (i - cell * this->factors[d]) + 1 > this->cells(d, cell) ? 1 : -1);
  }
  /** The part of voxel p of m that lies below its cell's middle. */
  static float low(int p, int m)
  {
    return std::min(1.f, std::max(0.f, 0.5f * static_cast<float>(m) - static_cast<float>(p)));
  }
  void facesAlongX(DiffusionOperator& C);
  void facesAcross(int d, DiffusionOperator& C);
  void sinks(DiffusionOperator& C);
  struct Around; // a row's faces
  void equations(Around& a, std::int64_t row) const;
  template <class Action>
  void forEquations(
    const double* phi, std::int64_t begin, std::int64_t end, const Action& action) const;
  template <class Q>
  double residual(const Q* q, const double* phi, double* out) const;
  /** A sweep of the full equations, red then black. */
  template <class Q>
  void relax(const Q* q, double* phi) const;
  /** phi += what the cells' x is on the voxels */
  void prolong(const double* x, double* phi) const;
  /** |phi - before| / |phi|: the 95th percentile within six decades of the largest, and L2. */
  struct Change
  {
    double p95 = 0., l2 = 0.;
  };
  Change compare(const double* before, const double* phi) const;
  template <class Q>
  void balance(const Q* q, const double* phi, DiffusionReport& report) const;
  /** False, with NoSteadyState, where walls close light in that a cell would let out. */
  template <class T, class Q>
  bool escapes(const DiffusionMedium<T>& medium, const Q* q, DiffusionReport& report) const;
  template <class Q>
  void restrict(const Q* q, double* b) const;

  WatchedFor parallelFor;
  Grid fine, coarse;
  std::array<int, 3> factors{ { 1, 1, 1 } };
  bool hasty = false;
  bool anyWall = false;
  int shift = 0; // of factors[0], a power of 2 as all
  DiffusionMedium<float> floatMedium;
  DiffusionMedium<double> doubleMedium;
  double scale = 1.;
  double largestD = 1.;
  std::array<float, 3> perD{ { 0.f, 0.f, 0.f } }; // conductance in A of D = largestD between voxels
  std::array<float, 3> beyond{ { 0.f, 0.f, 0.f } }; // the border's resistance, in h^2 / largestD
  std::array<Buffer<std::uint8_t>, 3> w;            // weight of the neighbouring cell, /255
  Buffer<std::uint8_t> psi;                         // /255
  DiffusionSolver solver;
  Buffer<double> cellSource, cellPhi, before; // of the last solve, for the next
};
} // namespace lighttransport

#endif
