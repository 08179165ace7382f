// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Names of the point arrays that the filters write and read.
 * "length" is the unit of the image's spacing.
 */
#ifndef vtkLightTransportArrays_h
#define vtkLightTransportArrays_h

namespace vtkLightTransportArrays
{
/** D = 1 / (3 (sigma_a + sigma_s')), in length, >= 0. */
constexpr const char* DiffusionCoefficient = "DiffusionCoefficient";
/** sigma_a, in 1/length, >= 0. */
constexpr const char* Absorption = "Absorption";
/** q, emitted power density, in power/length^3, either sign. */
constexpr const char* Source = "Source";
/** phi, the integral of radiance over all directions, in power/length^2. */
constexpr const char* Fluence = "Fluence";
/** E = -D grad(phi), three world components, in power/length^2. */
constexpr const char* Flux = "Flux";
/** sigma_t, in 1/length, >= 0. */
constexpr const char* Extinction = "Extinction";
/** Coefficients of v(p, w) on real orthonormal spherical harmonics, index l (l + 1) + m. */
constexpr const char* VisibilitySH = "VisibilitySH";
/** Visibility towards known lights, a component each, in [0, 1]. */
constexpr const char* Visibility = "Visibility";
/** The mean of v over the sphere, in [0, 1]. */
constexpr const char* AmbientOcclusion = "AmbientOcclusion";
/**
 * Field data of vtkLightSeedFilter's output, a tuple per sphere: the centre as continuous voxel
 * indices from the extent's first point, the radius (length) and the power.
 */
constexpr const char* LightSeeds = "LightSeeds";
/**
 * Curvatures of surfaces or of a volume's level sets, outward normals: a sphere of radius R has
 * principal curvatures 1/R, their mean 1/R and their product 1/R^2.
 */
constexpr const char* PrincipalCurvature1 = "PrincipalCurvature1"; ///< the larger, 1/length
constexpr const char* PrincipalCurvature2 = "PrincipalCurvature2"; ///< the smaller, 1/length
constexpr const char* MeanCurvature = "MeanCurvature";             ///< (k1 + k2) / 2, 1/length
constexpr const char* GaussianCurvature = "GaussianCurvature";     ///< k1 k2, 1/length^2
/** In [0, 1], 1 is opaque. */
constexpr const char* Opacity = "Opacity";
} // namespace vtkLightTransportArrays

#endif
