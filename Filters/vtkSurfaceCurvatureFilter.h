// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkSurfaceCurvatureFilter
 * @brief   curvatures at the points of a polygonal surface
 *
 * Adds to polydata up to four point arrays, float32 each, with the names, units and
 * signs of vtkVolumeCurvatureFilter:
 *
 *   PrincipalCurvature1   k1             [1/length]     the larger
 *   PrincipalCurvature2   k2             [1/length]     the smaller
 *   MeanCurvature         (k1 + k2) / 2  [1/length]
 *   GaussianCurvature     k1 k2          [1/length^2]
 *
 * A sphere of radius R has k1 = k2 = 1/R. Outward is the side from which the corners
 * of polygons are counterclockwise (vtkPolyDataNormals can make this consistent);
 * FlipNormals takes the other side.
 *
 * A cubic polynomial is fitted to the points of two rings of polygons around each
 * point (Cazals and Pouget 2005; Filters/Core/SurfaceCurvature.h has the equations).
 * That is second order, on irregular triangulations too, in any unit of length.
 * vtkCurvatures, which sums angles over areas, does not converge on irregular
 * triangulations, and its principal curvatures compare a curvature with a bare 0.1:
 * Module/Documentation/curvature.md has the figures.
 *
 * Polygons of any number of corners and triangle strips make the surface; points in
 * neither get 0. Points that lie at the same place without being the same are not
 * connected: vtkCleanPolyData first. Creases and edges have a large, finite
 * curvature that grows as the mesh is refined.
 *
 * Bad input gives one error (what, value, expected) and an empty output.
 *
 * @sa vtkVolumeCurvatureFilter vtkCurvatureOpacityFilter
 */
#ifndef vtkSurfaceCurvatureFilter_h
#define vtkSurfaceCurvatureFilter_h

#include "vtkLightTransportFiltersModule.h" // for the export macro
#include "vtkPolyDataAlgorithm.h"

#include <string> // for messages

class VTKLIGHTTRANSPORTFILTERS_EXPORT vtkSurfaceCurvatureFilter : public vtkPolyDataAlgorithm
{
public:
  static vtkSurfaceCurvatureFilter* New();
  vtkTypeMacro(vtkSurfaceCurvatureFilter, vtkPolyDataAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /** Which arrays to make; default all. */
  vtkSetMacro(ComputePrincipalCurvatures, bool);
  vtkGetMacro(ComputePrincipalCurvatures, bool);
  vtkBooleanMacro(ComputePrincipalCurvatures, bool);
  vtkSetMacro(ComputeMeanCurvature, bool);
  vtkGetMacro(ComputeMeanCurvature, bool);
  vtkBooleanMacro(ComputeMeanCurvature, bool);
  vtkSetMacro(ComputeGaussianCurvature, bool);
  vtkGetMacro(ComputeGaussianCurvature, bool);
  vtkBooleanMacro(ComputeGaussianCurvature, bool);
  ///@}

  ///@{
  /**
   * Radius of the neighbourhood, a finite length >= 0. The default 0 takes two rings
   * of polygons, which a larger radius extends (to at most 512 points): it averages
   * the noise of scanned surfaces, and features smaller than it.
   */
  vtkSetMacro(Radius, double);
  vtkGetMacro(Radius, double);
  ///@}

  ///@{
  /** Outward is the side from which corners are clockwise; default off. */
  vtkSetMacro(FlipNormals, bool);
  vtkGetMacro(FlipNormals, bool);
  vtkBooleanMacro(FlipNormals, bool);
  ///@}

protected:
  vtkSurfaceCurvatureFilter() = default;
  ~vtkSurfaceCurvatureFilter() override = default;

  int RequestData(
    vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs) override;

  bool ComputePrincipalCurvatures = true;
  bool ComputeMeanCurvature = true;
  bool ComputeGaussianCurvature = true;
  double Radius = 0.;
  bool FlipNormals = false;

private:
  std::string Compute(vtkPolyData* input, vtkPolyData* output);

  vtkSurfaceCurvatureFilter(const vtkSurfaceCurvatureFilter&) = delete;
  void operator=(const vtkSurfaceCurvatureFilter&) = delete;
};

#endif
