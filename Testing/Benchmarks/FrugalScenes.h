// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The scenes that bench-frugal judges errors on: procedural ones, and real ones where their
 * files are there. Each is an image with DiffusionCoefficient, Absorption and Source.
 */
#ifndef FrugalScenes_h
#define FrugalScenes_h

#include "vtkImageData.h"
#include "vtkSmartPointer.h"

#include <functional>
#include <string>
#include <vector>

namespace frugal
{
struct Seed
{
  double x, y, z; ///< world coordinates
  double radius, power;
};

struct Scene
{
  /** May add to the name. Null where the file of a real scene is not there. */
  using Make = std::function<vtkSmartPointer<vtkImageData>(std::string& name)>;
  std::string name;
  bool real = false;
  Make make;
  int boundary = 0; ///< of vtkLightDiffusionFilter
};

/**
 * The scenes that the estimate of the error was tuned on; procedural ones have about n^3 voxels,
 * real ones at most `most` per axis.
 */
std::vector<Scene> Scenes(int n, int most, const std::string& data);
/**
 * 24 procedural scenes and 16 real ones, all drawn at random: shape, size, spacing, mapping,
 * contrast, absorption, border, crop and lights. Each seed is another set, unseen until judged.
 */
std::vector<Scene> RandomScenes(unsigned seed, int n, int most, const std::string& data);

/** `medium` (DiffusionCoefficient, Absorption) with the seeds' Source. */
vtkSmartPointer<vtkImageData> WithSeeds(vtkImageData* medium, const std::vector<Seed>& seeds);

/** thorax_ct, a light in the aorta at voxel (137, 115, 90) (numerics.md 6); null without the file.
 */
vtkSmartPointer<vtkImageData> Aorta(const std::string& data);
/** A bent tube of radius 4 through n^3 voxels of absorbing tissue, lit inside. */
vtkSmartPointer<vtkImageData> Tube(int n);
/** Clear matter with little absorption: light everywhere. */
vtkSmartPointer<vtkImageData> Open(int n);
/** Blobs and vessels of a gradient mapping, without light: its medium, for seeds of one's own. */
vtkSmartPointer<vtkImageData> Tissue(int n, double albedo, double floor);
} // namespace frugal

#endif
