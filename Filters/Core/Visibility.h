// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Visibility_h
#define LightTransport_Core_Visibility_h

#include "Core/Buffer.h"
#include "Core/Grid.h"
#include "Core/Parallel.h"

#include <array>
#include <cstdint>
#include <vector>

namespace lighttransport
{
/**
 * Visibility of what lies beyond the medium, seen from a point p into a direction
 * w (the direction TOWARDS which one looks, hence towards the light):
 *
 *   v(p, w) = exp(-int_0^R sigma_t(p + u w) du)   in [0, 1],  R = the border, or `radius`
 *
 * (Ritschel: Fast GPU-based visibility computation for natural illumination of
 * volume data sets, Eurographics 2007; Kronander et al.: Efficient visibility
 * encoding for dynamic illumination in direct volume rendering, IEEE TVCG 18(3),
 * 2012; thesis of D. Murray, Bordeaux 2018, equation 1.17.)
 *
 * The grid is swept plane by plane, away from the light, along the axis along which
 * the direction crosses most voxels. The optical depths stand on a lattice that
 * shears with the direction (for a point light: that opens with the distance), so
 * that each of its rays meets all planes and depth is added up along the ray
 * itself: only sigma_t is interpolated on the way (bilinearly in each plane,
 * trapezoidal rule between planes), and v once, at the end, from the four rays
 * around the voxel. Nothing diffuses, however far the sweep goes. The medium ends half
 * a spacing beyond the outermost voxels and is there as dense as they are; rays beyond
 * do not count for the outermost voxels, to which those within are continued.
 */
struct VisibilityMedium
{
  Grid grid;
  const float* sigma_t = nullptr; ///< 1/length, finite, >= 0; a sum over the grid must not overflow
  double radius = 0.;             ///< length after which nothing occludes any more; 0: none
};

/** (order + 1)^2 */
constexpr int NumberOfHarmonics(int order)
{
  return (order + 1) * (order + 1);
}
constexpr int HighestVisibilityOrder = 4;

/**
 * Real orthonormal spherical harmonics Y_lm of the unit vector w, l <= order (0 to 8),
 * index l (l + 1) + m; no Condon-Shortley sign, so that Y_1 = sqrt(3 / (4 pi)) (y, z, x)
 * and Y_00 = 1 / sqrt(4 pi).
 */
void SphericalHarmonics(int order, const std::array<double, 3>& w, double* Y);

/**
 * The window with which visibility is read: factors k_l, l = 0 to order, of
 *
 *   v(w) = sum_l k_l sum_m v_lm Y_lm(w).
 *
 * They belong to the kernel sum_l (2 l + 1) / (4 pi) k_l P_l(cos) that, among the
 * polynomials of this degree that are nowhere negative on the sphere, has the
 * largest mean cosine (G. Szego: Orthogonal polynomials, AMS 1939, section 7.72):
 * an average with it stays in [0, 1] without a clamp. k_0 = 1; order 1: 1/3; order 2:
 * 1/sqrt(3), 1/5.
 */
std::vector<double> VisibilityWindow(int order);

/**
 * Directions w_i with weights > 0 that integrate over the sphere: a spherical
 * Fibonacci set (Swinbank, Purser: Fibonacci grids, Q. J. R. Meteorol. Soc. 132,
 * 2006), and the weights nearest to 4 pi / n for which the sum of w_i Y_lm is
 * sqrt(4 pi) for l = 0 and 0 for 0 < l <= degree.
 */
struct DirectionSet
{
  std::vector<std::array<double, 3>> directions;
  std::vector<double> weights;
  int degree = 0; ///< what these weights reach
};
/** The largest degree up to `degree` for which all weights are positive. n >= 1. */
DirectionSet MakeDirections(int n, int degree);
/** The number of directions with which an order is computed by default. */
int DefaultNumberOfDirections(int order);

/** What sweeps along x need, kept from one to the next through the same medium: saves half of them.
 */
struct VisibilityScratch
{
  Buffer<float> transposed; // of sigma_t
  Buffer<float> across;     // of v
};

/**
 * v of every voxel towards a light in the direction w (grid axes, any length > 0),
 * written every `stride` floats. False if `progress` (may be empty) asked to stop.
 */
bool VisibilityTowards(const VisibilityMedium& medium, const std::array<double, 3>& w, float* v,
  std::int64_t stride, const ParallelFor& parallel, const ProgressFunction& progress,
  VisibilityScratch* scratch = nullptr);

/**
 * v of every voxel towards a light at a place (lengths along the grid's axes from
 * the first voxel's centre), inside or outside. The medium's radius is not looked
 * at: what occludes lies between the voxel and the light.
 */
bool VisibilityTowardsPoint(const VisibilityMedium& medium, const std::array<double, 3>& place,
  float* v, std::int64_t stride, const ParallelFor& parallel, const ProgressFunction& progress);

/**
 * The coefficients of v(p, .) on the harmonics up to `order` (0 to
 * HighestVisibilityOrder), NumberOfHarmonics(order) values side by side per voxel, every `stride`
 * floats:
 *
 *   v_lm = sum_i weight_i v(p, w_i) Y_lm(w_i).
 *
 * The directions are the world's; row a of `axes` (orthonormal) is the direction of
 * grid axis a in the world. Takes memory for two planes per direction beside the
 * result, and a transposed copy of sigma_t. Throws std::bad_alloc.
 */
bool VisibilitySH(const VisibilityMedium& medium, const std::array<std::array<double, 3>, 3>& axes,
  const DirectionSet& directions, int order, float* sh, std::int64_t stride,
  const ParallelFor& parallel, const ProgressFunction& progress);
} // namespace lighttransport

#endif
