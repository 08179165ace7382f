// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Which voxels light reaches, so that a solve need not touch the others.
 *
 *   1. A front starts from the sources and foretells -ln(|phi| / max |phi|), the cost of a voxel:
 *      along one axis light decays per voxel by the e^-c for which
 *      2 (cosh c - 1) = sigma_a h^2 / D_f, and from voxel to voxel the cost T follows
 *      sum over the axes of ((T - T_d) / c_d)^2 = 1 (fast marching, Sethian 1996, with an untidy
 *      queue, Yatziv, Bartesaghi and Sapiro 2006). It takes no more than `limit` voxels at a time:
 *      what is lost through the sides of a vessel it does not foresee. A first look, over every
 *      fourth voxel, tells within a per cent of a solve where light fills open matter.
 *   2. The field solved for on these voxels, with 0 beyond, tells the true costs: dark voxels
 *      are given up, and the front goes on from where the rim is too bright. At a cut one voxel
 *      ahead phi is lower than it would be without it, by 1 - e^-2c in matter that goes on.
 *   3. The region has come to its end when the front has nowhere to go.
 *
 * The arrays take 5 bytes per voxel where the front was, and nothing elsewhere. Rows, cut at whole
 * pairs, and not the tiles of an OpenVDB tree: where light stays in a tube, tiles of 8^3 hold three
 * times as many voxels, and a tree's topology takes longer to grow than all of the solve
 * (bench-diffusion --sections region).
 */
#ifndef LightTransport_Core_ActiveRegion_h
#define LightTransport_Core_ActiveRegion_h

#include "Core/Buffer.h"
#include "Core/Diffusion.h"

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

namespace lighttransport
{
template <class T>
class ActiveRegion
{
public:
  /** `threshold`, in (0, 1): of the largest |phi|, what may be cut off. The medium is checked. */
  ActiveRegion(const DiffusionMedium<T>& medium, double threshold);

  /**
   * Starts the front at all voxels with a source. False where light is certain to fill the volume:
   * more than the part `largest` of it are sources, or of every fourth voxel a front takes more.
   */
  template <class Q>
  bool start(const Q* q, double largest, const ParallelFor& parallelFor);

  /**
   * Lets the front take up to `limit` voxels, and up to `more` where it foretells by then that
   * these bring it to its end; true where it has come there.
   */
  bool advance(std::int64_t limit, std::int64_t more = 0);
  /** How many it took the last time. */
  std::int64_t taken() const { return this->numberTaken; }
  /** Whether that went beyond what the last field was solved for on, by more than a few voxels. */
  bool grown() const;

  /** The region: a span for each row of the box, from its first tile to its last. */
  std::vector<Span> spans() const { return this->spansOf(this->hull); }
  /** The voxels that are lit. */
  std::int64_t lit() const { return this->numberLit; }
  /** Of the spans the number of voxels. */
  std::int64_t size() const;
  /** The spans that the last field was solved for on. */
  std::vector<Span> domain() const { return this->spansOf(this->solved); }

  struct Rim
  {
    double leaked = 0.; ///< power through the rim
    /** How many voxels will be lit in the end, from how their number grew with the cost. */
    double expected = 0.;
    /** Voxels at the rim and what would come back to them, a source: the error that the cut makes.
     */
    std::vector<std::pair<std::int64_t, double>> missing;
    double beyond = 0.; ///< the Euclidean norm of what is cut off, relative to that of phi
  };
  /**
   * Takes the true costs from phi, solved for on spans() with 0 beyond, gives dark voxels up where
   * that is asked for and makes ready for advance() from the rim.
   */
  Rim learn(const double* phi, bool giveUp);

private:
  /** How a voxel came to its cost. */
  enum State : std::uint8_t
  {
    Unknown, ///< not at all
    Trial,   ///< foretold, in the queue
    Lit,     ///< part of the region
    Dark     ///< solved for and given up
  };
  bool open(std::int64_t i) const
  {
    return !(this->medium.outside && this->medium.outside[i]) &&
      static_cast<double>(this->medium.D[i]) > 1e-150;
  }
  using Index = std::array<int, 3>;
  Index at(std::int64_t i) const
  {
    const std::array<int, 3>& n = this->medium.grid.dims;
    const std::int64_t row = i / n[0];
    const int k = static_cast<int>(row / n[1]);
    return { { static_cast<int>(i - row * n[0]),
      static_cast<int>(row - static_cast<std::int64_t>(n[1]) * k), k } };
  }
  /** 2 (cosh c - 1) of the step from i to its neighbour j along axis d. */
  double damping(std::int64_t i, std::int64_t j, int d) const;
  /** c of that step. */
  double step(std::int64_t i, std::int64_t j, int d) const;
  /** The cost of voxel j from its lit neighbours. */
  double foretell(std::int64_t j, const Index& at) const;
  void push(std::int64_t i, double cost);
  bool fills(double largest) const;
  /**
   * How many voxels will be lit at the largest cost, of `all` at `cost` and `half` at half of it:
   * N(c) grows as c in a vessel, as c^3 in open matter.
   */
  double grow(double cost, std::int64_t all, std::int64_t half) const;
  /** Foretells the neighbours of a lit voxel. */
  void spread(std::int64_t i, const Index& at);
  void widen(const Index& at);
  /**
   * Rows are taken up together and spans are even: cells of the first coarse grid are whole,
   * without which the cycle may be ten times slower.
   */
  static constexpr int Tile = 2;
  std::vector<Span> spansOf(const std::vector<Span>& tiles) const;
  std::size_t tileRow(int j, int k) const
  {
    return static_cast<std::size_t>(j / Tile) +
      static_cast<std::size_t>(k / Tile) * static_cast<std::size_t>(this->tilesAlongY);
  }

  DiffusionMedium<T> medium;
  std::int64_t stride[3];
  double perArea[3]; // 1 / h^2; 0 along an axis of one voxel
  double budget;     // the largest cost
  Buffer<float> cost;
  Buffer<std::uint8_t> state;
  int tilesAlongY;
  std::vector<Span> hull, solved; // of voxels, for each row of tiles
  std::int64_t numberLit = 0;
  std::int64_t numberTaken = 0;
  std::int64_t outgrown = 0; // voxels beyond `solved`
  std::vector<std::int64_t> sources;
  std::vector<std::vector<std::int64_t>> queue; // by cost, in steps of QueueStep
};
} // namespace lighttransport

#endif
