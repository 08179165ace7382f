// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkCurvatureOpacityFilter
 * @brief   opacity of a surface or an image from its curvature and depth
 *
 * Adds to a data set with curvatures (of vtkSurfaceCurvatureFilter for polydata, of
 * vtkVolumeCurvatureFilter for images) the point array "Opacity", float32 in [0, 1]:
 *
 *   kappa   = -tanh(s (k1 + k2)) = -tanh(2 s H)   H the mean curvature, s a length
 *   z       = (q - q0) / (q1 - q0)                 q the second quantity, see DepthSource
 *   opacity = f(|kappa|, z)                        f a vtkCurvatureOpacityFunction
 *
 * (D. Murray, Legible Visualization of Semi-Transparent Objects using Light
 * Transport, thesis, Bordeaux 2018, section 2.4.2). With MakeColors it also adds
 * "CurvatureOpacityColor", RGBA bytes, as active scalars: a vtkPolyDataMapper draws
 * these as they are, with depth peeling or vtkBucketedKBufferPass for the order.
 *
 * This gives opacity to points, once: a depth along a direction does not follow the
 * camera. vtkCurvatureOpacityPolyDataMapper and the volume mapper take curvature and
 * depth from each picture instead.
 *
 * Field data of the output: CurvatureOpacity.CurvatureScale and .DepthRange. The
 * input's arrays pass through. Bad input gives one error (what, value, expected) and
 * an empty output.
 *
 * @sa vtkCurvatureOpacityFunction vtkSurfaceCurvatureFilter vtkVolumeCurvatureFilter
 */
#ifndef vtkCurvatureOpacityFilter_h
#define vtkCurvatureOpacityFilter_h

#include "vtkLightTransportFiltersModule.h" // for the export macro
#include "vtkPassInputTypeAlgorithm.h"

#include <string> // for messages

class vtkCurvatureOpacityFunction;
class vtkDataArray;
class vtkDataSet;

class VTKLIGHTTRANSPORTFILTERS_EXPORT vtkCurvatureOpacityFilter : public vtkPassInputTypeAlgorithm
{
public:
  static vtkCurvatureOpacityFilter* New();
  vtkTypeMacro(vtkCurvatureOpacityFilter, vtkPassInputTypeAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  /** What the second argument of the function is. */
  enum DepthSources
  {
    /** z = 0 everywhere: curvature alone. */
    NoDepth = 0,
    /** q is the distance along Direction: a parallel view along it. */
    AlongDirection = 1,
    /** q is the distance from ViewPoint: a camera there. */
    FromViewPoint = 2,
    /**
     * q is a point array, or its first component, SetInputArrayToProcess(1, ...); by default
     * the active scalars.
     */
    FromArray = 3
  };

  ///@{
  /** The function; default CurvatureOnly. A null is an error. */
  virtual void SetOpacityFunction(vtkCurvatureOpacityFunction* function);
  vtkGetObjectMacro(OpacityFunction, vtkCurvatureOpacityFunction);
  ///@}

  ///@{
  /**
   * s, a length in the unit of the data, finite, >= 0: |kappa| is 0.76 for a sphere of
   * radius 2 s. The default 0 chooses it from the data, so that |kappa| is 0.5 at the
   * upper quartile of |k1 + k2| of what is curved at all; it then follows the unit.
   */
  vtkSetMacro(CurvatureScale, double);
  vtkGetMacro(CurvatureScale, double);
  ///@}

  /** The s that the last update used; 0 before the first and where nothing is curved. */
  vtkGetMacro(ComputedCurvatureScale, double);

  ///@{
  /** Where the second quantity q comes from; default NoDepth. */
  vtkSetMacro(DepthSource, int);
  vtkGetMacro(DepthSource, int);
  void SetDepthSourceToNoDepth() { this->SetDepthSource(NoDepth); }
  void SetDepthSourceToAlongDirection() { this->SetDepthSource(AlongDirection); }
  void SetDepthSourceToFromViewPoint() { this->SetDepthSource(FromViewPoint); }
  void SetDepthSourceToFromArray() { this->SetDepthSource(FromArray); }
  ///@}

  ///@{
  /** From the viewer into the scene, for AlongDirection; any length but 0. Default (0, 0, -1). */
  vtkSetVector3Macro(Direction, double);
  vtkGetVector3Macro(Direction, double);
  ///@}

  ///@{
  /** World coordinates of the eye, for FromViewPoint. Default the origin. */
  vtkSetVector3Macro(ViewPoint, double);
  vtkGetVector3Macro(ViewPoint, double);
  ///@}

  ///@{
  /**
   * q0 and q1: where z is 0 (near) and 1 (far). The default (0, 0), as any two equal
   * numbers, takes the range of q in the data. q1 < q0 turns the depth round.
   */
  vtkSetVector2Macro(DepthRange, double);
  vtkGetVector2Macro(DepthRange, double);
  ///@}

  ///@{
  /** Also make "CurvatureOpacityColor", RGBA bytes of Color and opacity; default off. */
  vtkSetMacro(MakeColors, bool);
  vtkGetMacro(MakeColors, bool);
  vtkBooleanMacro(MakeColors, bool);
  vtkSetVector3Macro(Color, double);
  vtkGetVector3Macro(Color, double);
  ///@}

  vtkMTimeType GetMTime() override;

protected:
  vtkCurvatureOpacityFilter();
  ~vtkCurvatureOpacityFilter() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;
  int RequestData(
    vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs) override;

  vtkCurvatureOpacityFunction* OpacityFunction = nullptr;
  double CurvatureScale = 0.;
  double ComputedCurvatureScale = 0.;
  int DepthSource = NoDepth;
  double Direction[3] = { 0., 0., -1. };
  double ViewPoint[3] = { 0., 0., 0. };
  double DepthRange[2] = { 0., 0. };
  bool MakeColors = false;
  double Color[3] = { 1., 1., 1. };

private:
  std::string Compute(
    vtkDataSet* input, vtkDataArray* mean, vtkDataArray* second, vtkDataSet* output);

  vtkCurvatureOpacityFilter(const vtkCurvatureOpacityFilter&) = delete;
  void operator=(const vtkCurvatureOpacityFilter&) = delete;
};

#endif
