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
 * g and H are those of a quadratic function, fitted to the values around a voxel
 * by least squares with the weights of GradientMagnitude, exp(-|x|^2 / (2 sigma^2))
 * cut off at 3 sigma. In the interior the fit separates into one kernel per axis:
 * Gaussian derivatives that are exact for quadratic functions. At a border the fits
 * of the axes are one-sided, and still exact for these. Where values are missing a
 * 10x10 system of the weights' moments is solved; directions without enough values
 * give 0. What is missing thus reaches nobody beyond the kernel, and does not bend
 * the level sets beside it.
 *
 * Where the gradient is no more than rounding and noise make it there is no level
 * set to speak of: |g| <= 3 noise_g gives 0, |g| >= 6 noise_g the full value, with
 * a smooth passage between; noise_g is what the kernels leave of the values' noise.
 * |k| is at most 2/h, h the smallest spacing: smaller spheres fit between voxels;
 * both are shrunk alike.
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

  /** Voxels by which the kernel reaches out along an axis. */
  int reach(int axis) const { return this->axes[axis].radius; }

  /** Standard deviation of a component of g, the largest, where the values' is 1. */
  double gradientNoise() const;

private:
  /** The kernels of one axis, `2 radius + 1` taps for each position along it. */
  struct Axis
  {
    int radius = 0;
    std::vector<double> weight; ///< Gaussian, not normalised, by |offset|
    std::vector<double> smooth; ///< value of the linear fit
    std::vector<double> slope;  ///< first derivative of the quadratic fit, per unit
    std::vector<double> curve;  ///< second derivative, per unit^2
    double unit = 1.;           ///< smallest spacing / spacing: from voxels to lengths
  };
  template <class Real>
  struct Tile;

  template <class Real>
  CurvatureReport computeAs(const ValueReader& read, const CurvatureParameters& parameters,
    const CurvatureFields& fields, const ParallelFor& parallel,
    const ProgressFunction& progress) const;
  template <class Real>
  void fitAround(const Tile<Real>& tile, int i, int j, int k, double derivatives[9]) const;

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
