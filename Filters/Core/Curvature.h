// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Curvature_h
#define LightTransport_Core_Curvature_h

#include "Core/Gradient.h"
#include "Core/Grid.h"
#include "Core/Parallel.h"

#include <array>
#include <vector>

namespace lighttransport
{
/** Where the curvatures go, one float per voxel each; a null is not computed. */
struct CurvatureFields
{
  float* principal1 = nullptr; ///< k1 >= k2, 1/length
  float* principal2 = nullptr;
  float* mean = nullptr;     ///< (k1 + k2) / 2
  float* gaussian = nullptr; ///< k1 k2, 1/length^2
};

struct CurvatureParameters
{
  double reference = 0.;        ///< subtracted from the values first, any value near them
  double largest = 0.;          ///< of |value - reference|
  double rounding = 0.;         ///< error of a value as it is stored, 0 when exact
  double noise = 0.;            ///< standard deviation of the values' noise, >= 0
  bool insideIsHigh = true;     ///< the normal is -grad S / |grad S|; false: its opposite
  bool singlePrecision = false; ///< compute in float: for values of at most 16 bits
};

struct CurvatureReport
{
  bool cancelled = false;
  double threshold = 0.;          ///< below this |grad S| there is no surface
  std::int64_t numberOfFlat = 0;  ///< voxels below it; their curvature is 0
  std::int64_t numberOfHoles = 0; ///< voxels without a value; their curvature is 0
};

/**
 * Curvatures of the level sets of sampled values (Kindlmann, Whitaker, Tasdizen,
 * Moeller: Curvature-based transfer functions for direct volume rendering, IEEE
 * Visualization 2003, section 3):
 *
 *   n = -g/|g|,   G = grad n^T = -P H P / |g|,   P = I - n n^T,
 *
 * g and H the gradient and the Hessian; k1 >= k2 are the eigenvalues of G in the
 * tangent plane. They are taken there, from the 2x2 matrix of H on two tangents,
 * and not from trace and norm of G as in the paper: k1 - k2 of a sphere would be
 * the root of a rounding error. Spheres of high values have k1 = k2 = 1/R.
 *
 * g and H are those of polynomials, fitted to the values around a voxel by least
 * squares with the weights of GradientMagnitude, exp(-|x|^2 / (2 sigma^2)) cut off at
 * 3 sigma: exact for quadratic functions, second order for others. The fit separates
 * into one kernel per axis. In the interior these are Gaussian derivatives. At a
 * border the window of an axis stays as long as it is and moves inwards, its sigma
 * growing to twice the length at the border itself; the second derivative is that of a
 * cubic polynomial there, for one-sided fits of quadratic ones are of first order. Twice
 * the length is what keeps its noise at that of the quadratic fit.
 *
 * Where values are missing a 20x20 system of the weights' moments is solved, for a
 * cubic polynomial in space, whose terms of third order are held back as far as the
 * noise asks for it; directions without enough values give 0. What is missing thus
 * reaches nobody beyond the kernel, and does not bend the level sets beside it.
 *
 * Where the gradient is no more than rounding and noise make it there is no level
 * set to speak of: |g| <= 3 noise_g gives 0, |g| >= 6 noise_g the full value, with
 * a smooth passage between; noise_g is what the kernels leave of the values' noise,
 * at borders too. |k| is at most 2/h, h the smallest spacing: smaller spheres fit
 * between voxels; both are shrunk alike.
 */
class LevelSetCurvature
{
public:
  /**
   * sigma is a length, taken per axis as at least 0.4 of the spacing, where the fit
   * is through three points to 1e-3. The kernel reaches out by at least two voxels.
   */
  LevelSetCurvature(const Grid& grid, double sigma);

  /** Needs a few tiles of memory per thread, whatever the size of the volume. */
  CurvatureReport compute(const ValueReader& read, const CurvatureParameters& parameters,
    const CurvatureFields& fields, const ParallelFor& parallel,
    const ProgressFunction& progress) const;

  /** Voxels by which the kernel reaches out along an axis; at a border twice that inwards. */
  int reach(int axis) const { return this->axes[axis].radius; }

  /** Standard deviation of a component of g, the largest, where the values' is 1. */
  double gradientNoise() const;

private:
  /** The kernels of one axis: `taps` values for each of its `size` positions. */
  struct Axis
  {
    int size = 0;
    int radius = 0;
    int taps = 0;               ///< 2 radius + 1, or all there are
    bool narrow = false;        ///< in the interior the outermost taps are 0, and left out
    std::vector<double> weight; ///< Gaussian, not normalised, for the fit beside holes
    std::vector<double> smooth; ///< value of the linear fit
    std::vector<double> slope;  ///< first derivative of the quadratic fit, per unit
    std::vector<double> curve;  ///< second derivative of the cubic fit, per unit^2
    double unit = 1.;           ///< smallest spacing / spacing: from voxels to lengths

    /** The first voxel of a position's window, which lies inside. */
    int start(int i) const
    {
      const int last = this->size - this->taps;
      return i < this->radius ? 0 : i - this->radius < last ? i - this->radius : last;
    }
    /** Taps to leave out at either end. */
    int skip(int i) const
    {
      return this->narrow && i >= this->radius && i < this->size - this->radius;
    }
    /** Deviation of the fit's value and slope at a position where the values' is 1. */
    std::array<double, 2> noise(int i) const;
  };
  template <class Real>
  struct Tile;

  template <class Real>
  CurvatureReport computeAs(const ValueReader& read, const CurvatureParameters& parameters,
    const CurvatureFields& fields, const ParallelFor& parallel,
    const ProgressFunction& progress) const;
  template <class Real>
  void fitAround(
    const Tile<Real>& tile, int i, int j, int k, double noise, double derivatives[9]) const;

  Grid grid;
  double h; ///< smallest spacing: the unit of length inside
  std::array<Axis, 3> axes;
};

/**
 * Standard deviation of the noise of sampled values, from a sample of them: the
 * median of |N S| / (0.6745 * 6), N the difference of two second differences along
 * two axes (Immerkaer, Fast noise variance estimation, 1996), which no plane, ridge
 * or straight edge along an axis excites; the second difference where a single axis
 * is long enough. Values that do not vary are left out; 0 if they are more than
 * four fifths: a mask has no noise. Noise that is correlated between neighbours is
 * underestimated. `reference` and `largest` as in CurvatureParameters.
 */
double EstimateNoise(const Grid& grid, const ValueReader& read, double reference, double largest);
} // namespace lighttransport

#endif
