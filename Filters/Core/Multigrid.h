// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The discrete diffusion operator and a multigrid cycle that approximates its
 * inverse.
 *
 * The operator acts on one value per voxel of a box:
 *
 *   (A x)_i = sum over the six neighbours j of g_ij (x_i - x_j)  +  s_i x_i
 *
 * with conductances g_ij = g_ji >= 0 on the faces and a sink s_i >= 0 (absorption
 * and what leaves through the border): a symmetric M-matrix. Keeping the sink
 * apart from the diagonal, instead of the diagonal itself, keeps every small
 * eigenvalue exact to rounding: nothing is ever subtracted from the conductances.
 *
 * The hierarchy follows the physics, not the algebra:
 *   1. Coarsening joins 2 voxels along each axis whose mean conductance is within
 *      a factor of the largest one (so strong anisotropy is semi-coarsened).
 *   2. A coarse face is a network of resistors from centre to centre: half the
 *      inner faces on either side, in series with the faces between, those in
 *      parallel. A voxel's faces go to the coarse columns that the voxel is put
 *      between. The coarse operator keeps seven points.
 *   3. The prolongation puts a voxel, along each axis, between its parent and its
 *      parent's neighbour by the balance of flux along the line that joins them, and
 *      lowers it by what its own sink takes; a coarse sink is what is felt of the
 *      sinks through those lines. The restriction is the transpose. Where all of a coarse
 *      voxel's lines are closed but light still comes round a corner, its correction would
 *      be far too long: its diagonal is raised to a part of the diagonal of P^T A P.
 *   4. Smoothing is Gauss-Seidel by colour, red-black before and black-red after the
 *      coarse correction, twice each. After a red-black sweep only red voxels have a
 *      residual, and only they need a correction.
 *   5. The second and the third grid take two steps of conjugate gradients around their own
 *      cycle (Notay and Vassilevski 2008, a K-cycle), so that what a coarse operator over- or
 *      underestimates is scaled right. The cycle is then not quite linear: whoever uses
 *      it as a preconditioner takes a flexible method.
 *
 * All steps before the coarse correction are one pass over the memory, all steps after it
 * another: rows of a tile go through the steps in a skewed wave, each step a plane behind
 * the one before (Wolf and Lam 1991; see skew in the source). That is what makes two
 * sweeps cost hardly more than one.
 *
 * Alcouffe, Brandt, Dendy and Painter 1981 (SIAM J. Sci. Stat. Comput. 2, 430)
 * introduced conductance-weighted transfers for strongly varying coefficients.
 */
#ifndef LightTransport_Core_Multigrid_h
#define LightTransport_Core_Multigrid_h

#include "Core/Buffer.h"
#include "Core/Parallel.h"

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <vector>

namespace lighttransport
{
/** The values [begin, end) of a row that belong to the domain. */
struct Span
{
  int begin = 0;
  int end = 0;
};

/** One grid of the hierarchy: A's coefficients there. */
struct DiffusionOperator
{
  std::array<int, 3> dims{ { 0, 0, 0 } };
  /** g[d][i]: the face between voxel i and its next along axis d; 0 on the last. */
  std::array<Buffer<float>, 3> g;
  Buffer<float> s;
  Buffer<float> zeros; // a row, read in place of rows outside

  /**
   * Where g and s are not stored: writes a row's, g[0] of its last value 0. The kernels then
   * keep a few planes of them in the cache, which costs arithmetic and saves 16 bytes per value.
   */
  using ComputeRow = std::function<void(std::int64_t row, float* const g[3], float* s)>;
  ComputeRow compute;

  /**
   * Where the domain is a part of the box: its rows, and the span of each row of the box.
   * Coefficients and vectors are 0 elsewhere and their memory is not touched there. Empty: all.
   */
  std::vector<std::int64_t> activeRows;
  std::vector<Span> spans;
  std::int64_t activeSize = 0; ///< values within the spans
  Pages pages = Pages::Large;  ///< Small where the domain is a part of the box

  std::int64_t size() const
  {
    return static_cast<std::int64_t>(this->dims[0]) * this->dims[1] * this->dims[2];
  }
  std::int64_t numberOfRows() const
  {
    return this->spans.empty() ? static_cast<std::int64_t>(this->dims[1]) * this->dims[2]
                               : static_cast<std::int64_t>(this->activeRows.size());
  }
  std::int64_t row(std::int64_t t) const
  {
    return this->spans.empty() ? t : this->activeRows[static_cast<std::size_t>(t)];
  }
  Span span(std::int64_t row) const
  {
    return this->spans.empty() ? Span{ 0, this->dims[0] }
                               : this->spans[static_cast<std::size_t>(row)];
  }
  void allocate(const std::array<int, 3>& n, Pages size = Pages::Large);
  bool isStored() const { return !this->compute; }
  /** Gives the memory of g and s back; from now on they are computed. Not with spans. */
  void forget(ComputeRow how);
  /** Restricts the domain to the spans; before the coefficients are written. */
  void restrictTo(std::vector<Span> rowSpans);
  std::int64_t bytes() const;
};

/** body(row, begin of its values, their number) for each row of the domain, in parallel. */
using RowBody = std::function<void(std::int64_t row, std::int64_t begin, int n)>;
void ForEachRow(const DiffusionOperator& A, const ParallelFor& parallelFor, const RowBody& body);
/** The sum of what the rows return, in an order that threads do not change. */
using RowSum = std::function<double(std::int64_t row, std::int64_t begin, int n)>;
double SumEachRow(const DiffusionOperator& A, const ParallelFor& parallelFor, const RowSum& row);

/** Gives a voxel with neither face nor sink the sink `s`, so that nothing divides by zero. */
void CloseIsolated(DiffusionOperator& A, float s, const ParallelFor& parallelFor);

/**
 * body(stage, row) for each row of the domain and each stage, as if the stages came one after the
 * other, in one pass over the memory. A stage may read the row itself and its four neighbours as
 * the stage before left them, and write what the stage before has read: two fields in turn.
 */
void ForEachStage(const DiffusionOperator& A, int stages, const ParallelFor& parallelFor,
  const std::function<void(int stage, std::int64_t row)>& body);

/** z = r / diagonal */
void DivideByDiagonal(
  const DiffusionOperator& A, const float* r, float* z, const ParallelFor& parallelFor);

/** y = A x and returns x . y; in float, with the sum in double. */
double Apply(const DiffusionOperator& A, const float* x, float* y, const ParallelFor& parallelFor);

/** p = z + beta p and y = A z + beta y, which is A p as long as y was; returns p . y. */
double Advance(const DiffusionOperator& A, const float* z, float beta, float* p, float* y,
  const ParallelFor& parallelFor);

/**
 * whole + sign w, in 255ths, is the weight of a voxel (w = here) or of a face (the mean of here and
 * there) for a coarse row. In whole numbers: 1 - w/255 in float is -6e-8 where w is 255 (fused
 * multiply-add), and a coarse face or sink made of that is negative at high contrast.
 */
struct MultigridWeights
{
  const std::uint8_t *here, *there;
  int whole, sign;
};

/** The weights along the lines of a row's red voxels x = 2 I + odd, at I. */
struct MultigridLine
{
  const std::uint8_t *wx, *wy, *wz, *kept;
  /** Along x: is it halved? Then voxel x lies between I and I + (odd ? 1 : -1). */
  bool halved;
  int odd;
};

/** What stands between the smoothing before and after it: the correction on a coarser grid. */
struct CoarseCorrection
{
  /**
   * Takes in the residual of a row: r is 0 but on red voxels, i + j + k even, of the row's span,
   * and the first of nine rows with that pitch, the others for work.
   */
  std::function<void(std::int64_t row, float* r, std::size_t pitch)> restrictRow;
  std::function<void()> solve;
  /** Adds the correction to a row's red voxels; black ones are relaxed next, whatever they are. */
  std::function<void(std::int64_t row, float* x)> prolongRow;
};

/**
 * x ~ A^-1 b from zero: `sweeps` red-black sweeps of Gauss-Seidel, the correction, as many
 * black-red ones. The rows that two threads restrict at a time are six or more rows apart.
 */
void SmoothAround(const DiffusionOperator& A, int sweeps, const float* b, float* x,
  const CoarseCorrection* correction, const ParallelFor& parallelFor, const RowBody& done);

class Multigrid
{
public:
  /** Builds the hierarchy for A, stored or not, which must outlive it. */
  void setup(const DiffusionOperator& A, const ParallelFor& parallelFor);
  void release();

  /**
   * One cycle from zero: x ~ A^-1 b. Both have a value per voxel of A, with one readable value
   * before and after (Buffer has that). `done`, where given, is called for each row as soon as
   * x is final there, while the row is in the cache.
   */
  void cycle(const float* b, float* x, const ParallelFor& parallelFor, const RowBody& done = {});

  /** Smoothing sweeps before and after each coarse correction; default 2. */
  int sweeps = 2;

  std::int64_t bytes() const;
  int numberOfLevels() const { return static_cast<int>(this->levels.size()) + 1; }

private:
  struct Level
  {
    DiffusionOperator A;             // empty on the finest, which is the caller's
    Buffer<float> x, b;              // empty on the finest: the caller's
    Buffer<float> first, firstImage; // see solveCoarse; empty where one cycle is enough
    std::array<bool, 3> halved{ { false, false, false } };
    // Of the red voxels alone, which are all that a cycle puts between coarse ones: voxel
    // x = 2 I + odd of a row is its value I.
    std::array<Buffer<std::uint8_t>, 3> w; // weight of the parent's neighbour, /255
    Buffer<std::uint8_t>
      kept; // of what comes in along the lines, the part that no sink takes, /255
    Buffer<std::uint8_t> noWeight; // a row of 0, along axes that are not halved
  };
  /**
   * What a level's set-up works with, on some planes of the grid: the weights of all voxels and
   * what is felt of their sinks, and A's coefficients where they are not stored.
   */
  class Slab
  {
  public:
    Slab(const DiffusionOperator& A, int planes);
    /** To the planes [first, last); the coefficients reach two below and one above. */
    void moveTo(int first, int last, const ParallelFor& parallelFor);
    /** From voxel o of the grid on. */
    const float* g(int d, std::int64_t o) const { return this->at(d, o); }
    const float* s(std::int64_t o) const { return this->at(3, o); }
    float* felt(std::int64_t o)
    {
      return this->feltSinks.data() + (o - this->firstRow * this->A.dims[0]);
    }
    const float* felt(std::int64_t o) const
    {
      return this->feltSinks.data() + (o - this->firstRow * this->A.dims[0]);
    }
    /** A row's weights of the three axes and, as the fourth, what is kept. */
    std::uint8_t* row(std::int64_t r, int which)
    {
      return this->weights.data() + (4 * (r - this->firstRow) + which) * this->A.dims[0];
    }
    const std::uint8_t* row(std::int64_t r, int which) const
    {
      return this->weights.data() + (4 * (r - this->firstRow) + which) * this->A.dims[0];
    }

  private:
    const float* at(int which, std::int64_t o) const
    {
      if (this->A.isStored())
      {
        return (which < 3 ? this->A.g[static_cast<std::size_t>(which)] : this->A.s).data() + o;
      }
      return this->faces[static_cast<std::size_t>(which)].data() + (o - this->firstValue);
    }
    const DiffusionOperator& A;
    std::array<Buffer<float>, 4> faces;
    Buffer<std::uint8_t> weights;
    Buffer<float> feltSinks;
    std::int64_t firstRow = 0;
    std::int64_t firstValue = 0; ///< of the faces
  };
  void cycle(
    std::size_t l, const float* b, float* x, const ParallelFor& parallelFor, const RowBody& done);
  /** levels[l].x ~ A^-1 levels[l].b, which is spoilt. */
  void solveCoarse(std::size_t l, const ParallelFor& parallelFor);
  const DiffusionOperator& operatorOf(std::size_t l) const
  {
    return l == 0 ? *this->finest : this->levels[l].A;
  }
  void coarsen(
    const DiffusionOperator& A, Level& fine, Level& coarse, const ParallelFor& parallelFor) const;
  /** A row's weights, of all its voxels. */
  void weighRow(const DiffusionOperator& A, const Level& fine, std::int64_t row, Slab& slab) const;

  using Weights = MultigridWeights;
  /** The fine rows, along y and z, that have to do with a coarse one. */
  struct Footprint
  {
    int first[3], last[3];
  };
  Footprint footprint(
    const Level& fine, const std::array<int, 3>& n, const int J[3], int along) const;
  /** Of the values from `at` on; where `ends`, with those at the other end of a face `along`. */
  void weigh(const DiffusionOperator& A, const Level& fine, const Slab& slab, const int at[3],
    const int J[3], int along, bool ends, Weights weights[3]) const;
  /**
   * out_C = sum over voxels f of P_fC v_f, without P's part for the sinks, on `length` values from
   * o on of a row of C. v is what is felt of the sinks, or the faces `along` >= 0, an axis that is
   * not halved.
   */
  void gather(const DiffusionOperator& A, const Level& fine, const Slab& slab,
    const DiffusionOperator& C, int along, std::int64_t row, std::int64_t o, int length,
    float* out) const;
  /** Raises coarse sinks where the diagonal is far below that of P^T A P, see 3. above. */
  void raise(const DiffusionOperator& A, const Level& fine, const Slab& slab, DiffusionOperator& C,
    std::int64_t row, std::int64_t o, int length) const;
  /** The coarse faces along an axis that is halved, see 2. above. */
  void gatherFaces(const DiffusionOperator& A, const Level& fine, const Slab& slab,
    const DiffusionOperator& C, int along, std::int64_t row, std::int64_t o, int length,
    float* out) const;
  MultigridLine lineOf(
    const DiffusionOperator& A, const Level& fine, const int at[3], std::int64_t row) const;
  /**
   * coarse.b += P^T r on the row's red voxels (black ones have no residual). r is a row of the
   * box, and the first of nine with that pitch, the others for work.
   */
  void restrictRow(const DiffusionOperator& A, const Level& fine, Level& coarse, std::int64_t row,
    float* r, std::size_t pitch) const;
  /** x += P coarse.x on the row's red voxels; black ones are relaxed next, whatever they are. */
  void prolongRow(const DiffusionOperator& A, const Level& fine, const Level& coarse,
    std::int64_t row, float* x) const;

  const DiffusionOperator* finest = nullptr;
  std::deque<Level> levels;
};
} // namespace lighttransport

#endif
