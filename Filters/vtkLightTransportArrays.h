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
/**
 * Field data of vtkLightSeedFilter's output, a tuple per sphere: the centre as continuous voxel
 * indices from the extent's first point, the radius (length) and the power.
 */
constexpr const char* LightSeeds = "LightSeeds";
} // namespace vtkLightTransportArrays

#endif
