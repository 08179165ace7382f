// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkVolumeCurvatureFilter
 * @brief   curvatures of the level sets of a scalar volume
 *
 * Adds to a scalar volume S up to four point arrays, float32 each, of the surface
 * S = constant that passes through the point:
 *
 *   PrincipalCurvature1   k1             [1/length]     the larger
 *   PrincipalCurvature2   k2             [1/length]     the smaller
 *   MeanCurvature         (k1 + k2) / 2  [1/length]
 *   GaussianCurvature     k1 k2          [1/length^2]
 *
 * "length" is the unit of the image's spacing. Sign: outward normals, so that a
 * sphere of radius R has k1 = k2 = 1/R, mean 1/R and Gaussian 1/R^2, a cylinder
 * mean 1/(2R), and the torus (2, 1) a Gaussian in [-1, 1/3]. Outward is towards low
 * values, n = -grad S / |grad S|: what is bright is inside (InsideIsBright).
 *
 * The stages, mirrored by the code (equations: Filters/Core/Curvature.h):
 *
 * 1. Read S (one component, any scalar type). NaN, declared no-data values and
 *    points hidden by vtkGhostType are left out of all fits; their curvature is 0.
 *    They change nothing beyond the kernel's reach, and beside them the fit takes
 *    what there is: a wall has no curvature of its own.
 * 2. Gradient g and Hessian H of polynomials fitted around the point with Gaussian
 *    weights of standard deviation DerivativeScale, in world lengths: exact for
 *    quadratic functions in any spacing, borders included.
 * 3. G = -P H P / |g| with P = I - n n^T (Kindlmann, Whitaker, Tasdizen, Moeller:
 *    Curvature-based transfer functions for direct volume rendering, IEEE
 *    Visualization 2003), whose eigenvalues on the tangent plane are k1 and k2.
 *    Second order in the spacing, also beside borders and what is missing, where the
 *    error is about ten times that of the interior.
 * 4. Where |g| is no more than what noise makes of it there is no level set: see
 *    NoiseLevel. Flat and constant regions have curvature 0.
 *
 * |k| is at most 2 / (smallest spacing): smaller spheres fit between the points. An
 * axis with a single point has no derivative, so that a slice gives the curvature
 * of its level curves as k1 or k2, and 0 as the other.
 *
 * A direction matrix does not change curvatures. The input's arrays pass through
 * (the same objects). The filter asks upstream for the whole extent; it needs the
 * arrays that it makes and a few tiles per thread. Field data of the output says
 * how they were made: VolumeCurvature.DerivativeScale, .NoiseLevel and
 * .GradientThreshold.
 *
 * This filter is not for surfaces that are extracted already (vtkSurfaceCurvatureFilter
 * is), nor for segmentations: the steps of a mask have the curvature of steps, unless
 * DerivativeScale is several voxels.
 *
 * Bad input gives one error (what, value, expected) and an empty output.
 *
 * @sa vtkCurvatureOpacityFilter vtkSurfaceCurvatureFilter
 */
#ifndef vtkVolumeCurvatureFilter_h
#define vtkVolumeCurvatureFilter_h

#include "vtkImageAlgorithm.h"
#include "vtkLightTransportFiltersModule.h" // for the export macro

#include <string> // for messages
#include <vector> // for the no-data values

class vtkDataArray;

class VTKLIGHTTRANSPORTFILTERS_EXPORT vtkVolumeCurvatureFilter : public vtkImageAlgorithm
{
public:
  static vtkVolumeCurvatureFilter* New();
  vtkTypeMacro(vtkVolumeCurvatureFilter, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /** Which arrays to make; default all. What is off costs neither memory nor time. */
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
   * Standard deviation, a length, of the Gaussian weights. Negative (the default,
   * -1) means the smallest spacing of the axes that have more than one point; 0
   * means the narrowest kernel, nearly central differences. At most 32 of those
   * spacings. Noise in the curvature falls with its 3.5th power, and so does what is
   * seen of features smaller than it: 1.5 to 2 spacings suit most scans.
   */
  vtkSetMacro(DerivativeScale, double);
  vtkGetMacro(DerivativeScale, double);
  ///@}

  ///@{
  /**
   * Outward is towards low values, where bright things are of interest (default
   * on); off: towards high values, for dark things. Off changes the sign of k1, k2
   * and their mean, and their order.
   */
  vtkSetMacro(InsideIsBright, bool);
  vtkGetMacro(InsideIsBright, bool);
  vtkBooleanMacro(InsideIsBright, bool);
  ///@}

  ///@{
  /**
   * Standard deviation of the noise of S, in its unit, finite. A gradient of less
   * than 3 times what the kernel leaves of it counts as flat, of more than 6 times
   * as a surface, with a smooth passage. Negative (the default, -1) estimates it
   * from the data (Immerkaer 1996; not below the quantisation of whole numbers); 0
   * leaves only what rounding makes.
   */
  vtkSetMacro(NoiseLevel, double);
  vtkGetMacro(NoiseLevel, double);
  ///@}

  ///@{
  /** What the last update used: the noise of S, and the |g| below which all is flat. */
  vtkGetMacro(ComputedNoiseLevel, double);
  vtkGetMacro(ComputedGradientThreshold, double);
  ///@}

  ///@{
  /** Component of the scalars that is read, >= 0; default 0. */
  vtkSetMacro(Component, int);
  vtkGetMacro(Component, int);
  ///@}

  ///@{
  /**
   * Scalar values that mean "no data", as NaN. A value is compared in the scalars'
   * own type. Declaring an infinity makes it legal. Default none.
   */
  void AddNoDataValue(double value);
  void RemoveAllNoDataValues();
  int GetNumberOfNoDataValues() const { return static_cast<int>(this->NoDataValues.size()); }
  double GetNoDataValue(int i) const;
  ///@}

protected:
  vtkVolumeCurvatureFilter();
  ~vtkVolumeCurvatureFilter() override = default;

  int RequestUpdateExtent(
    vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*) override;
  int RequestData(
    vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs) override;

  bool ComputePrincipalCurvatures = true;
  bool ComputeMeanCurvature = true;
  bool ComputeGaussianCurvature = true;
  double DerivativeScale = -1.;
  bool InsideIsBright = true;
  double NoiseLevel = -1.;
  double ComputedNoiseLevel = 0.;
  double ComputedGradientThreshold = 0.;
  int Component = 0;
  std::vector<double> NoDataValues;

private:
  /** What is wrong, or nothing. */
  std::string Compute(vtkImageData* input, vtkDataArray* scalars, vtkImageData* output);

  vtkVolumeCurvatureFilter(const vtkVolumeCurvatureFilter&) = delete;
  void operator=(const vtkVolumeCurvatureFilter&) = delete;
};

#endif
