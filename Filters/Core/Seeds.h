// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Seeds_h
#define LightTransport_Core_Seeds_h

#include "Core/Gradient.h"
#include "Core/Grid.h"
#include "Core/Parallel.h"

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

namespace lighttransport
{
/** A ball of light. */
struct SphereSource
{
  std::array<double, 3> center{ { 0., 0., 0. } }; ///< continuous voxel indices, 0 = first centre
  double radius = 0.;                             ///< length, >= 0
  double power = 0.;                              ///< either sign
};

/**
 * Does the sphere meet the grid's domain, which ends half a spacing beyond the
 * outermost centres? One that only touches it from outside does not; a radius
 * below half the smallest spacing counts as a point, which may lie on the border.
 */
bool MeetsDomain(const Grid& grid, const SphereSource& sphere);

/**
 * The fraction of a voxel that lies inside a sphere, to first order: from the
 * distance d of its centre, the radius R and the width w = sum_a |n_a| h_a of the
 * voxel in the direction n of the sphere's centre,
 *
 *   clamp(1/2 + (R - d) / w, 0, 1)     (w = smallest spacing at d = 0).
 */
double InsideFraction(const Grid& grid, const SphereSource& sphere, int i, int j, int k);

/** A polyline with a radius and a power (of the whole stroke) at each of its points. */
struct Stroke
{
  std::vector<std::array<double, 3>> points; ///< continuous voxel indices
  std::vector<double> radius;                ///< length, >= 0
  std::vector<double> power;                 ///< equal values: spread evenly
};

/**
 * Appends the stroke as spheres along it: one for each voxel that it crosses, with
 * its exact length, where the radius is below half the smallest spacing, else at
 * most half the smallest spacing (or a quarter of the radius) apart. Only those
 * that meet the domain count; the power per length is that of the points,
 * interpolated, over the length that counts: equal powers P make P in all. A
 * stroke of no length is one sphere with its mean power. False, and nothing is
 * added, if no part of it meets the domain.
 */
bool StrokeToSpheres(const Grid& grid, const Stroke& stroke, std::vector<SphereSource>& spheres);

/** Voxel indices of one grid to those of another: offset + sum_a index[a] column[a]. */
struct IndexMap
{
  std::array<double, 3> offset{ { 0., 0., 0. } };
  std::array<std::array<double, 3>, 3> column{ { { { 1., 0., 0. } }, { { 0., 1., 0. } },
    { { 0., 0., 1. } } } };
};

/**
 * Values on a grid, added as transfer(value). On the sources' grid itself they
 * are read by `read`; with another grid they are `values`, taken linearly between
 * centres, constant in the outer half voxel and 0 beyond, and averaged over each
 * voxel of the sources' grid (up to 64 samples along an axis, as the spacings
 * ask).
 */
struct ImageSource
{
  ValueReader read;
  const float* values = nullptr; ///< other grid; not null then
  Grid grid;                     ///< other grid
  IndexMap map;                  ///< from the sources' grid to the other
  std::function<double(double)> transfer;
};

struct SourceReport
{
  bool cancelled = false;
  /** First sphere whose density float32 cannot hold, or -1. */
  std::int64_t badSphere = -1;
  /** First voxel whose density float32 cannot hold, or -1. */
  std::int64_t badVoxel = -1;
  double power = 0.; ///< sum of q times voxel volume
};

/**
 * q, power/length^3: the sum of the sources.
 *
 * A sphere's power is shared among the voxels of the grid in proportion to
 * InsideFraction, so that the sum of what it adds, times the voxel volume, is its
 * power, also where it leaves the domain. A sphere with a radius below half the
 * smallest spacing, or one that no voxel of the grid takes part in, gives all to
 * the voxel whose centre is nearest. Each sphere must meet the domain.
 *
 * Summed in double, one slice at a time, in the order of the sources: the result
 * does not depend on the threads. Costs the spheres' bounding boxes.
 */
SourceReport ComputeSources(const Grid& grid, const std::vector<SphereSource>& spheres,
  const std::vector<ImageSource>& images, float* q, const ParallelFor& parallel,
  const ProgressFunction& progress);
} // namespace lighttransport

#endif
