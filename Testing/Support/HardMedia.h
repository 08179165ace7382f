// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** Media that a geometric coarse grid does not see, for tests and for bench-hard. */
#ifndef HardMedia_h
#define HardMedia_h

#include "DiffusionScene.h"

#include <cmath>
#include <random>

namespace lighttransport
{
namespace testing
{
/**
 * One corridor of a voxel that winds through the middle of n x n x 3 voxels, between mirrors; light
 * starts at one end.
 */
template <class T>
MediumAndSource<T> WindingCorridor(int n, T wall)
{
  MediumAndSource<T> scene({ { n, n, 3 } }, { { 1., 1., 1. } });
  scene.boundary = Boundary::ZeroFlux;
  for (int k = 0; k < 3; ++k)
  {
    for (int j = 0; j < n; ++j)
    {
      for (int i = 0; i < n; ++i)
      {
        const bool open = k == 1 && (j % 2 == 1 || i == ((j / 2) % 2 ? 1 : n - 2));
        scene.D[scene.index(i, j, k)] = open ? T(1) : wall;
      }
    }
  }
  scene.sigma_a.assign(scene.q.size(), static_cast<T>(1e-4));
  scene.q[scene.index(1, 1, 1)] = T(1);
  return scene;
}

/**
 * Wavy layers of n x n + 3 x n voxels, in most of which parts of the dark ones are cut out; the
 * contrast is 4 to 4 + `decades` decades, the spacing along z 0.1 to 10.
 */
template <class T>
MediumAndSource<T> Layers(unsigned int seed, int n, double decades)
{
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0., 1.);
  const double hz = std::pow(10., 1. - 2. * uniform(random));
  const double contrast = std::pow(10., -4. - decades * uniform(random));
  const double layer = 5. + 20. * uniform(random);
  MediumAndSource<T> scene({ { n, n + 3, n } }, { { 1., 1., hz } });
  scene.outside.assign(scene.q.size(), 0);
  const std::size_t m = static_cast<std::size_t>(n);
  for (std::size_t i = 0; i < scene.q.size(); ++i)
  {
    const double x = static_cast<double>(i % m) / n;
    const double y = static_cast<double>(i / m % (m + 3)) / n;
    const double z = static_cast<double>(i / (m * (m + 3))) / n;
    const double wave = std::sin(layer * (z + 0.1 * std::sin(5. * x) + 0.05 * y));
    scene.D[i] = static_cast<T>(wave > 0. ? contrast : 1.);
    scene.sigma_a[i] =
      static_cast<T>((seed % 2 == 0 ? 1e-7 : 1e-3) / static_cast<double>(scene.D[i]));
    scene.outside[i] = seed % 3 != 0 && wave > 0.6;
  }
  const std::size_t lamp = scene.q.size() / 2 + m / 2;
  scene.outside[lamp] = 0;
  scene.q[lamp] = T(1);
  return scene;
}
} // namespace testing
} // namespace lighttransport

#endif
