// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Gradient_h
#define LightTransport_Core_Gradient_h

#include "Core/Grid.h"
#include "Core/Parallel.h"

#include <array>
#include <vector>

namespace lighttransport
{
/**
 * Gives the values [begin, begin + n) of a volume as doubles, whatever they are
 * stored as. NaN means no data. Called from several threads at once.
 */
using ValueReader = std::function<void(std::int64_t begin, std::int64_t n, double* values)>;

/** What a pass over the values of a volume finds. */
struct ValueRange
{
  double min = 0.; ///< of the finite values; 0 if there is none
  double max = 0.;
  std::int64_t numberOfFinite = 0;
  std::int64_t numberOfNaN = 0;
  std::int64_t firstNaN = -1;      ///< index of the first NaN, or -1
  std::int64_t firstInfinite = -1; ///< index of the first infinity, or -1
};
ValueRange FindValueRange(std::int64_t size, const ValueReader& read, const ParallelFor& parallel);

/**
 * Length of the gradient of sampled values, by normalized differential
 * convolution (Knutsson, Westin: Normalized and differential convolution, CVPR
 * 1993): at each voxel a linear function is fitted to the values around it by
 * least squares, with the weights
 *
 *   exp(-|x|^2 / (2 sigma^2))  cut off at 3 sigma (at least one voxel) per axis,
 *                              0 beyond the border and where there is no data,
 *
 * and its slope is the gradient. Linear functions come out exact everywhere. In
 * the interior it is a Gaussian derivative, separable; at a border the weights
 * still are a product, so that it stays separable with other kernels; near
 * missing values a 3x3 system of the weights' moments is solved, whose
 * degenerate directions (a voxel without neighbours along them) give 0.
 *
 * sigma is a length. It is taken per axis as at least a sixth of the spacing,
 * where the fit is the central difference to 1e-7.
 */
class GradientMagnitude
{
public:
  GradientMagnitude(const Grid& grid, double sigma);

  /**
   * magnitude[i] = |grad(values)| * factor, and -1 where the value is NaN.
   * `reference` is subtracted from the values first (any value near them: it
   * keeps digits and changes nothing else). Needs a few tiles of memory per
   * thread. False if `progress` (may be empty) asked to stop.
   */
  bool compute(const ValueReader& read, double reference, double factor, float* magnitude,
    const ParallelFor& parallel, const ProgressFunction& progress) const;

  /** Voxels by which the kernel reaches out along an axis. */
  int reach(int axis) const { return this->axes[axis].radius; }

private:
  /** The kernels of one axis, `2 radius + 1` taps for each position along it. */
  struct Axis
  {
    int radius = 0;
    double unit = 1.;           ///< length in which offsets are measured here
    std::vector<double> weight; ///< Gaussian, not normalised, by |offset|
    std::vector<double> smooth; ///< sums to 1 at each position
    std::vector<double> slope;  ///< slope of the fit, per length
    std::vector<double> offset; ///< offsets in `unit`
    const double* smoothAt(int i) const { return &smooth[std::size_t(i) * (2 * radius + 1)]; }
    const double* slopeAt(int i) const { return &slope[std::size_t(i) * (2 * radius + 1)]; }
  };
  struct Tile;

  void computeTile(const ValueReader& read, double reference, double factor, float* magnitude,
    int j0, int j1, int k0, int k1) const;
  void fitWhole(Tile& tile, int k, double factor, float* magnitude) const;
  void fitHoles(Tile& tile, int k, double factor, float* magnitude) const;

  Grid grid;
  std::array<Axis, 3> axes;
};
} // namespace lighttransport

#endif
