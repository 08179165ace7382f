// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A second approximate inverse of the diffusion operator, for media that the geometric hierarchy
 * (Multigrid.h) does not see: corridors of a voxel, layers beside layers, holes. A coarse voxel
 * there joins what is not connected; here only voxels that are connected are joined, at the price
 * of a set-up of some ten cycles and of coarse matrices that have to be stored.
 *
 *   1. Voxels are joined in pairs, pairs of pairs and pairs of these, each with the neighbour that
 *      it is tied to most strongly (Notay 2010, Electron. Trans. Numer. Anal. 37, 123). A set G is
 *      accepted while
 *        max over v of  v' M (v - mean) / v' A_G v  <=  quality / 2,   the mean weighted by M,
 *      where M is the diagonal of A, and A_G the part of A within G, with G's sinks: what is lost
 *      by taking G for one is then bounded, whatever the medium is (Napov and Notay 2012, SIAM J.
 *      Sci. Comput. 34, A1079).
 *   2. Voxels whose sink is a good part of their diagonal are left to the smoother (ibid.).
 *   3. The coarse operator is P' A P, with P = 1 on each set: again faces >= 0 and sinks >= 0, in
 *      rows of a general graph, on which the same is done again.
 *   4. Two steps of conjugate gradients on each coarse grid (Notay and Vassilevski 2008, Numer.
 *      Linear Algebra Appl. 15, 473: a K-cycle), the second only where the first leaves much; the
 *      coarsest is solved directly. The cycle is not quite linear.
 *   5. The finest grid is smoothed as in Multigrid.h, the others by Gauss-Seidel, forwards before
 *      and backwards after the correction, within chunks of rows that do not see each other's
 *      changes: so that results do not depend on the threads.
 */
#ifndef LightTransport_Core_Aggregation_h
#define LightTransport_Core_Aggregation_h

#include "Core/Buffer.h"
#include "Core/Multigrid.h"
#include "Core/Parallel.h"

#include <cstdint>
#include <deque>
#include <vector>

namespace lighttransport
{
class Aggregation
{
public:
  /**
   * Builds the hierarchy for A, which must be stored for as long as this takes; false where even
   * large sets need more than so many bytes. parallelFor may throw, to give up: then release.
   * Throws std::bad_alloc.
   */
  bool setup(const DiffusionOperator& A, std::int64_t bytes, const ParallelFor& parallelFor);
  void release();
  bool empty() const { return this->parent.empty(); }

  /** As Multigrid::cycle. */
  void cycle(const DiffusionOperator& A, const float* b, float* x, const ParallelFor& parallelFor,
    const RowBody& done);

  std::int64_t bytes() const;
  int numberOfLevels() const { return static_cast<int>(this->levels.size()) + 1; }

private:
  /**
   * A coarse grid: (A x)_i = sum over row i of g (x_i - x_j) + s_i x_i. One value more than rows
   * is readable in x: 0.
   */
  struct Level
  {
    std::int32_t rows = 0;
    Buffer<std::int64_t> start;
    Buffer<std::int32_t> column; // rising in each row
    Buffer<float> g, s, diagonal;
    Buffer<float> x, b, r, first, firstImage; // see solveCoarse
    Buffer<std::int32_t> parent;              // on the next grid; -1: none
    std::vector<double> factor;               // of the coarsest, Cholesky's
    std::int64_t bytes() const;
  };
  /** Adds a level; not, and answers false, where it would have more than so many bytes. */
  template <class Graph>
  bool coarsen(const Graph& graph, double quality, std::int64_t bytes, Buffer<std::int32_t>& parent,
    const ParallelFor& parallelFor);
  /** levels[l].x ~ A^-1 levels[l].b, which is spoilt. */
  void solveCoarse(std::size_t l, const ParallelFor& parallelFor);
  /** One cycle: x ~ A^-1 levels[l].b. */
  void cycleCoarse(std::size_t l, float* x, const ParallelFor& parallelFor);
  void factorise(Level& level) const;

  Buffer<std::int32_t> parent; // of each voxel on the first coarse grid; -1: none
  std::deque<Level> levels;
};
} // namespace lighttransport

#endif
