// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkOpticalMediumFilter
 * @brief   optical medium of a scalar volume: where light may go
 *
 * Turns a scalar volume S into the two point arrays that vtkLightDiffusionFilter
 * reads, float32 each:
 *
 *   DiffusionCoefficient  D       = beta ell                       [length]
 *   Absorption            sigma_a = (1 - beta) / ell               [1/length]
 *
 * (or another absorption, see AbsorptionMapping). "length" is the unit of the
 * image's spacing. beta in [0, 1] says how freely light passes ("selective
 * mapping": D. Murray, Legible Visualization of Semi-Transparent Objects using
 * Light Transport, thesis, Bordeaux 2018, section 4.2.2), ell is a length of the
 * scene, so that refining or coarsening the grid does not change the physics.
 *
 * The stages, mirrored by the code:
 *
 * 1. Read S (one component, any scalar type). NaN, declared no-data values and
 *    points hidden by vtkGhostType become walls: D = 0, sigma_a = 1/ell.
 * 2. beta from S itself or from the length of a gradient:
 *      FromTransferFunction          beta = f(S)
 *      FromScalarGradient            beta = exp(-(|grad S| / sigma)^2)
 *      FromTransferFunctionGradient  beta = exp(-(|grad f(S)| / sigma)^2)
 *    with f = DiffusionFunction, sigma = GradientScale, and 1 - beta in place of
 *    beta when DiffusionComplement is on. GradientFunction Rational takes
 *    1 / (1 + (|grad S| / sigma)^2) for the exponential.
 * 3. The gradient is that of a local linear fit with Gaussian weights of
 *    standard deviation DerivativeScale (Knutsson, Westin: Normalized and
 *    differential convolution, CVPR 1993): exact for a linear S everywhere,
 *    borders included; in the interior it is the derivative of the smoothed S;
 *    walls have weight 0, so nothing leaks out of them. It is in world lengths,
 *    anisotropic spacing included; an axis with a single point has no gradient.
 * 4. sigma = 0 is chosen from the data, see GradientScale.
 * 5. beta is floored by BetaFloor, then D and sigma_a follow.
 *
 * The input's arrays pass through (the same objects); the image keeps its
 * extent, which need not start at 0, and its direction matrix. The filter asks
 * upstream for the whole extent. Field data of the output says how the medium
 * was made: OpticalMedium.GradientScale and OpticalMedium.DiffusionLength.
 *
 * This filter is not for radiometry: beta is a design choice that guides light
 * through structures. Measured scattering coefficients can go to
 * vtkLightDiffusionFilter directly, as arrays.
 *
 * Bad input gives one error (what, value, expected) and an empty output.
 *
 * @sa vtkLightSeedFilter vtkLightDiffusionFilter
 */
#ifndef vtkOpticalMediumFilter_h
#define vtkOpticalMediumFilter_h

#include "vtkImageAlgorithm.h"
#include "vtkLightTransportFiltersModule.h" // for the export macro

#include <string> // for messages
#include <vector> // for the no-data values

class vtkDataArray;
class vtkPiecewiseFunction;

class VTKLIGHTTRANSPORTFILTERS_EXPORT vtkOpticalMediumFilter : public vtkImageAlgorithm
{
public:
  static vtkOpticalMediumFilter* New();
  vtkTypeMacro(vtkOpticalMediumFilter, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  /** Where beta comes from. */
  enum DiffusionMappings
  {
    /** beta = f(S): light passes where the function is 1. */
    FromTransferFunction = 0,
    /** beta = exp(-(|grad S|/sigma)^2): light passes inside, edges stop it. */
    FromScalarGradient = 1,
    /** The same of f(S): only the edges that the function shows stop light. */
    FromTransferFunctionGradient = 2
  };

  /** How beta falls with the gradient's length (Perona and Malik 1990). */
  enum GradientFunctions
  {
    /** exp(-(|grad S|/sigma)^2): keeps sharp edges. */
    Exponential = 0,
    /** 1 / (1 + (|grad S|/sigma)^2): prefers wide regions, lets more pass. */
    Rational = 1
  };

  /** Where sigma_a comes from. */
  enum AbsorptionMappings
  {
    /** sigma_a = (1 - beta) / ell: what does not pass is absorbed. */
    FromComplement = 0,
    /** sigma_a = (1 - albedo) / (3 (1 - albedo g) D); an albedo of 1 absorbs nothing. */
    FromAlbedo = 1,
    /** sigma_a = AbsorptionFunction(S), in 1/length. */
    FromFunction = 2
  };

  ///@{
  /**
   * Where beta comes from; default FromScalarGradient.
   * FromTransferFunction and FromTransferFunctionGradient need DiffusionFunction.
   */
  vtkSetMacro(DiffusionMapping, int);
  vtkGetMacro(DiffusionMapping, int);
  void SetDiffusionMappingToFromTransferFunction()
  {
    this->SetDiffusionMapping(FromTransferFunction);
  }
  void SetDiffusionMappingToFromScalarGradient() { this->SetDiffusionMapping(FromScalarGradient); }
  void SetDiffusionMappingToFromTransferFunctionGradient()
  {
    this->SetDiffusionMapping(FromTransferFunctionGradient);
  }
  ///@}

  ///@{
  /**
   * Take 1 - beta for beta, before the floor: light passes where the function
   * is 0, or along edges. Default off.
   */
  vtkSetMacro(DiffusionComplement, bool);
  vtkGetMacro(DiffusionComplement, bool);
  vtkBooleanMacro(DiffusionComplement, bool);
  ///@}

  ///@{
  /**
   * f, a function of the scalar with values in [0, 1] (values outside are an
   * error); often the volume's opacity. Default none.
   */
  virtual void SetDiffusionFunction(vtkPiecewiseFunction* function);
  vtkGetObjectMacro(DiffusionFunction, vtkPiecewiseFunction);
  ///@}

  ///@{
  /** How beta falls with the gradient's length; default Exponential. */
  vtkSetMacro(GradientFunction, int);
  vtkGetMacro(GradientFunction, int);
  ///@}

  ///@{
  /**
   * sigma, in scalar units per length (1/length for FromTransferFunctionGradient):
   * beta is 1/e (1/2 for Rational) where the gradient has this length. Finite,
   * >= 0.
   * The default 0 chooses it from the data: 2.1 times the median gradient of what
   * varies in the neighbourhood of ScalePoint (Black et al.: Robust anisotropic
   * diffusion, 1998; the rule is in Filters/Core/Medium.h), or, without one, 2.1
   * times the lower quartile of what varies in the whole volume. It follows when
   * the scalars or the lengths are rescaled. Too small, and noise stops light
   * after a few voxels; too large, and light passes through weak edges. Near the
   * point where light starts the choice is better: set ScalePoint.
   */
  vtkSetMacro(GradientScale, double);
  vtkGetMacro(GradientScale, double);
  ///@}

  /**
   * The sigma that the last update used: GradientScale, or what was chosen from
   * the data. 0 before the first update, for FromTransferFunction, and where
   * nothing varies.
   */
  vtkGetMacro(ComputedGradientScale, double);

  ///@{
  /**
   * A point in world coordinates near which the gradient scale is chosen,
   * usually the seed. It must lie inside the volume. Default none.
   */
  void SetScalePoint(double x, double y, double z);
  void SetScalePoint(const double point[3]) VTK_SIZEHINT(3)
  {
    this->SetScalePoint(point[0], point[1], point[2]);
  }
  vtkGetVector3Macro(ScalePoint, double);
  void ClearScalePoint();
  vtkGetMacro(HasScalePoint, bool);
  ///@}

  ///@{
  /**
   * Standard deviation, a length, of the Gaussian weights of the derivative.
   * Negative (the default, -1) means the smallest spacing of the axes that have
   * more than one point; 0 means plain central differences (one-sided at
   * borders and walls). At most 32 of those spacings.
   */
  vtkSetMacro(DerivativeScale, double);
  vtkGetMacro(DerivativeScale, double);
  ///@}

  ///@{
  /**
   * ell, the length of D = beta ell. Finite, >= 0; the default 0 means the
   * smallest spacing of the input's axes that have more than one point. Set it
   * when the same scene is solved on grids of different spacing.
   */
  vtkSetMacro(DiffusionLength, double);
  vtkGetMacro(DiffusionLength, double);
  ///@}

  ///@{
  /**
   * beta is never below this, in (0, 1]; default 1e-6. Walls alone have D = 0.
   */
  vtkSetMacro(BetaFloor, double);
  vtkGetMacro(BetaFloor, double);
  ///@}

  ///@{
  /** Where sigma_a comes from; default FromComplement. */
  vtkSetMacro(AbsorptionMapping, int);
  vtkGetMacro(AbsorptionMapping, int);
  void SetAbsorptionMappingToFromComplement() { this->SetAbsorptionMapping(FromComplement); }
  void SetAbsorptionMappingToFromAlbedo() { this->SetAbsorptionMapping(FromAlbedo); }
  void SetAbsorptionMappingToFromFunction() { this->SetAbsorptionMapping(FromFunction); }
  ///@}

  ///@{
  /**
   * sigma_a as a function of the scalar, in 1/length, >= 0, for FromFunction.
   * Default none.
   */
  virtual void SetAbsorptionFunction(vtkPiecewiseFunction* function);
  vtkGetObjectMacro(AbsorptionFunction, vtkPiecewiseFunction);
  ///@}

  ///@{
  /**
   * alpha = sigma_s / (sigma_a + sigma_s), in [0, 1], for FromAlbedo; default
   * 0.99. 1: nothing is absorbed; 0: sigma_a = 1/(3D).
   */
  vtkSetMacro(Albedo, double);
  vtkGetMacro(Albedo, double);
  ///@}

  ///@{
  /**
   * g, the mean cosine of the scattering angle, in (-1, 1), for FromAlbedo;
   * default 0 (isotropic).
   */
  vtkSetMacro(Anisotropy, double);
  vtkGetMacro(Anisotropy, double);
  ///@}

  ///@{
  /**
   * L, a length: sigma_a grows by D/L^2, so that light in an open corridor fades
   * by e over L, whatever the absorption mapping. Finite, >= 0; the default 0
   * adds nothing.
   */
  vtkSetMacro(Reach, double);
  vtkGetMacro(Reach, double);
  ///@}

  ///@{
  /** Component of the scalars that is read, >= 0; default 0. */
  vtkSetMacro(Component, int);
  vtkGetMacro(Component, int);
  ///@}

  ///@{
  /**
   * Scalar values that mean "no data": walls, as NaN. A value is compared in the
   * scalars' own type. Declaring an infinity makes it legal. Default none.
   */
  void AddNoDataValue(double value);
  void RemoveAllNoDataValues();
  int GetNumberOfNoDataValues() const { return static_cast<int>(this->NoDataValues.size()); }
  double GetNoDataValue(int i) const;
  ///@}

  vtkMTimeType GetMTime() override;

protected:
  vtkOpticalMediumFilter();
  ~vtkOpticalMediumFilter() override;

  int RequestUpdateExtent(
    vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*) override;
  int RequestData(
    vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs) override;

  int DiffusionMapping = FromScalarGradient;
  int GradientFunction = Exponential;
  bool DiffusionComplement = false;
  vtkPiecewiseFunction* DiffusionFunction = nullptr;
  double GradientScale = 0.;
  double ComputedGradientScale = 0.;
  double ScalePoint[3] = { 0., 0., 0. };
  bool HasScalePoint = false;
  double DerivativeScale = -1.;
  double DiffusionLength = 0.;
  double BetaFloor = 1e-6;
  int AbsorptionMapping = FromComplement;
  vtkPiecewiseFunction* AbsorptionFunction = nullptr;
  double Albedo = 0.99;
  double Anisotropy = 0.;
  double Reach = 0.;
  int Component = 0;
  std::vector<double> NoDataValues;

private:
  /** What is wrong, or nothing. */
  std::string FindParameterProblem() const;
  std::string Compute(vtkImageData* input, vtkDataArray* scalars, vtkImageData* output);

  vtkOpticalMediumFilter(const vtkOpticalMediumFilter&) = delete;
  void operator=(const vtkOpticalMediumFilter&) = delete;
};

#endif
