// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_SurfaceCurvature_h
#define LightTransport_Core_SurfaceCurvature_h

#include "Core/Curvature.h"
#include "Core/Parallel.h"

#include <cstdint>
#include <vector>

namespace lighttransport
{
/** Polygons with their corners counterclockwise seen from outside. */
struct SurfaceMesh
{
  std::vector<double> points;        ///< x, y, z of each
  std::vector<std::int64_t> offsets; ///< of each polygon in corners, and the end: one more
  std::vector<std::int64_t> corners; ///< indices of points
  std::int64_t numberOfPoints() const { return static_cast<std::int64_t>(points.size() / 3); }
};

/**
 * Curvatures at the points of a mesh, with outward normals as LevelSetCurvature's,
 * by fitting a polynomial to the points around (Cazals, Pouget: Estimating
 * differential quantities using polynomial fitting of osculating jets, CAGD 2005):
 *
 *   z = c + a x + b y + (A x^2 + 2 B x y + C y^2) / 2 + cubic terms
 *
 * over the tangent plane of the point's normal (Max: Weights for computing vertex
 * normals from facet normals, JGT 1999), least squares with weights that fall
 * smoothly to the neighbourhood's rim and with the angle between normals. With
 * w^2 = 1 + a^2 + b^2:
 *
 *   mean = -((1 + b^2) A - 2 a b B + (1 + a^2) C) / (2 w^3),  Gaussian = (A C - B^2) / w^4.
 *
 * The neighbourhood is the point's two rings of polygons, or all that is connected
 * to it within the radius, if this is larger. Fewer than 14 neighbours leave the
 * cubic terms out, fewer than 6 give 0. Second order for two rings, whatever the
 * triangulation; at a rim one-sided. A crease has a curvature of about its angle
 * over its neighbourhood's size. Points that are not finite, or in no polygon, get 0
 * and are nobody's neighbours.
 *
 * radius: a length, 0 for two rings. At most 512 neighbours are taken.
 */
bool ComputeSurfaceCurvature(const SurfaceMesh& mesh, double radius, const CurvatureFields& fields,
  const ParallelFor& parallel, const ProgressFunction& progress);
} // namespace lighttransport

#endif
