// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Medium_h
#define LightTransport_Core_Medium_h

#include "Core/Gradient.h"
#include "Core/Grid.h"
#include "Core/Parallel.h"

#include <array>
#include <cstdint>

namespace lighttransport
{
/**
 * The gradient scale sigma of beta = exp(-(g / sigma)^2), chosen from gradient
 * lengths g by the robust rule of Black, Sapiro, Marimont, Heeger: Robust
 * anisotropic diffusion, IEEE Trans. Image Processing 7(3), 1998: from the median
 * absolute deviation of the gradients,
 *
 *   sigma_e = 1.4826 median(g),   sigma = sqrt(2) sigma_e.
 *
 * The paper takes the deviation about the median length, which falls below the
 * noise itself where noise is all there is; here it is about 0, the median of the
 * gradients as vectors.
 * sigma_e separates the gradients of the bulk (noise, texture) from the outliers
 * (edges): with this sigma the flux g beta(g) has its maximum at sigma_e and falls
 * beyond. At the median gradient beta is 0.8. Only regions that vary count:
 * values at most 1 % of the 99.9 % quantile of the positive gradients do not, nor
 * do negative ones (walls).
 *
 * `point` (a voxel, or a negative first index for none) limits the samples to
 * the voxels within 20 smallest spacings of it along each axis, if at least 64
 * of them vary. Else at most about a million voxels of the whole volume are
 * looked at, and the lower quartile takes the median's place: of all that varies
 * in a volume, half and more may be edges. Where nothing varies the result is 0.
 * Scales with g.
 */
double ChooseGradientScale(
  const Grid& grid, const float* gradients, const std::array<int, 3>& point);

enum class AbsorptionRule
{
  Complement, ///< sigma_a = (1 - beta) / ell
  Albedo,     ///< sigma_a = (1 - alpha) / (3 (1 - alpha g) D)
  Function    ///< sigma_a given per voxel
};

/** See vtkOpticalMediumFilter for meaning and ranges; the caller has checked them. */
struct MediumParameters
{
  bool useGradient = true;
  bool complement = false;
  bool rational = false;     ///< beta = 1 / (1 + (g / sigma)^2) instead of the exponential
  double gradientScale = 0.; ///< sigma; 0: ChooseGradientScale
  std::array<int, 3> scalePoint{ { -1, -1, -1 } };
  double derivativeScale = 1.;
  double ell = 1.;
  double betaFloor = 1e-6;
  AbsorptionRule absorption = AbsorptionRule::Complement;
  double albedo = 0.99;
  double anisotropy = 0.;
  double reach = 0.; ///< 0: none
};

struct MediumReport
{
  bool cancelled = false;
  double gradientScale = 0.; ///< sigma that was used
  std::int64_t numberOfWalls = 0;
};

/**
 * D and sigma_a of the volume whose values `signal` gives: beta itself, or what
 * the gradient is taken of; NaN is a wall (D = 0, sigma_a = 1/ell). `range` is
 * that of the signal (or wider): it scales the arithmetic. `absorption` is read
 * for AbsorptionRule::Function only. Needs no memory of the volume's size: the
 * gradient stands in D's place until it is used.
 */
MediumReport ComputeMedium(const Grid& grid, const ValueReader& signal, const ValueRange& range,
  const ValueReader& absorption, const MediumParameters& parameters, float* D, float* sigma_a,
  const ParallelFor& parallel, const ProgressFunction& progress);
} // namespace lighttransport

#endif
