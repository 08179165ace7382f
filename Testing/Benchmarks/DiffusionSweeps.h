// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** The yardsticks of bench-diffusion: STREAM's triad, a plain Jacobi sweep, fresh memory. */
#ifndef DiffusionSweeps_h
#define DiffusionSweeps_h

#include "Core/Buffer.h"
#include "DiffusionProblem.h"

#include <utility>

namespace lighttransport
{
namespace benchmark
{
/** a = b + 3 c on three arrays of doubles (McCalpin's STREAM): 24 bytes per element. */
class Triad
{
public:
  Triad(std::int64_t n, const ParallelFor& parallelFor);
  /** Seconds of one pass. */
  double pass(const ParallelFor& parallelFor);
  double bytes() const { return 24. * static_cast<double>(this->a.size()); }

private:
  std::vector<double> a, b, c;
};

/**
 * phi' = (q + sum g phi_neighbour) / diagonal in float, with precomputed faces and
 * reciprocal diagonal: a sweep must move 3 faces, diagonal, q and phi in, phi out,
 * 28 bytes per voxel.
 */
class Jacobi
{
public:
  Jacobi(const Problem& problem, const ParallelFor& parallelFor);
  void sweep(const ParallelFor& parallelFor);
  const Buffer<float>& phi() const { return this->from; }
  static constexpr double BytesPerVoxel = 28.;

private:
  const Problem& problem;
  Buffer<float> g[3];
  Buffer<float> inverse;
  Buffer<float> from, to;
  Buffer<float> zeros;
};

enum class TouchedPages
{
  Small,
  Large,    ///< MADV_HUGEPAGE, as the solver's buffers
  Populated ///< and MADV_POPULATE_WRITE
};

/**
 * Seconds to map so many bytes and write to each 4 KiB of them for the first time, and to write
 * all of them once more; -1, -1 where the system does not offer that.
 */
std::pair<double, double> TouchSeconds(
  std::size_t bytes, TouchedPages pages, const ParallelFor& parallelFor);
} // namespace benchmark
} // namespace lighttransport

#endif
