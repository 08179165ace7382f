// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkVisibilityFactorFilter
 * @brief   how much light reaches each voxel of a volume, from every direction
 *
 * The visibility factor of a point p and a direction w, the direction towards
 * which one looks from p (towards the light),
 *
 *   v(p, w) = exp(-int_0^R sigma_t(p + u w) du)   in [0, 1],
 *
 * with R the volume's border or Radius, is what a shadow ray would return
 * (Ritschel: Fast GPU-based visibility computation for natural illumination of
 * volume data sets, Eurographics 2007; Kronander et al.: Efficient visibility
 * encoding for dynamic illumination in direct volume rendering, IEEE TVCG 18(3),
 * 2012; D. Murray, thesis, Bordeaux 2018, equation 1.17). It changes with the
 * volume and its opacity alone: any camera, and any number of lights, can read it.
 * Point arrays of the output, float32:
 *
 *   VisibilitySH      (Order + 1)^2 coefficients of v(p, .) on real orthonormal
 *                     spherical harmonics Y_lm without the Condon-Shortley sign,
 *                     index l (l + 1) + m, in world directions: Y_1 is
 *                     sqrt(3 / (4 pi)) (y, z, x), and a constant v gives
 *                     sqrt(4 pi) v in component 0. Raw: read it through the window
 *                     of GetWindow(), which keeps v in [0, 1].
 *   AmbientOcclusion  the mean of v over the sphere, in [0, 1]; when asked for.
 *   Visibility        v towards each of the known lights, a component per light:
 *                     exact shadows without ringing; where there are lights.
 *
 * The stages, mirrored by the code:
 *
 * 1. Extinction sigma_t, in 1/length ("length" is the unit of the image's spacing):
 *      with ScalarOpacity or TransferFunction2D, as volume mappers understand them:
 *        sigma_t = -ln(1 - alpha) / ScalarOpacityUnitDistance,
 *        alpha = ScalarOpacity(S) GradientOpacity(|grad S|), or of the 2-D function;
 *      else the point array named ExtinctionArrayName.
 *    An opacity of 1 is taken as an optical depth of 20 over the smallest spacing
 *    (e^-20 = 2e-9), and nothing is denser. NaN and points hidden by vtkGhostType
 *    are transparent.
 * 2. With a ResolutionFactor, sigma_t is averaged onto a coarser grid that covers the
 *    same domain: the output then has this grid and none of the input's arrays.
 *    Else the input's arrays pass through.
 * 3. One sweep of the grid per direction (Filters/Core/Visibility.h says how), on a
 *    lattice that shears with the direction, so that shadows stay sharp however far
 *    they reach. Projected on the harmonics on the way: nothing is kept per direction.
 * 4. One sweep per known light.
 *
 * Each stage is kept: a light that moves costs its own sweep, a change of the
 * opacity everything. The image keeps its extent and direction matrix; directions
 * and places of lights are the world's.
 *
 * With RGBExtinction there are three times as many components: see there.
 *
 * Float32 alone: VTK has no 16-bit floats that readers and filters would understand.
 * On the GPU the mappers keep fewer bits (volumes 8, surfaces 16); to save memory here,
 * take a ResolutionFactor of 2 (an eighth).
 *
 * This filter is not for scattered light: what was extinguished is gone. For that
 * see vtkLightDiffusionFilter.
 *
 * Bad input gives one error (what, value, expected) and an empty output.
 *
 * @sa vtkLightTransportVolumeMapper vtkLightTransportPolyDataMapper vtkLightDiffusionFilter
 */
#ifndef vtkVisibilityFactorFilter_h
#define vtkVisibilityFactorFilter_h

#include "vtkImageAlgorithm.h"
#include "vtkLightTransportFiltersModule.h" // for the export macro

#include <memory> // for what is kept between updates
#include <string> // for messages

class vtkImageData;
class vtkPiecewiseFunction;
class vtkScalarsToColors;

class VTKLIGHTTRANSPORTFILTERS_EXPORT vtkVisibilityFactorFilter : public vtkImageAlgorithm
{
public:
  static vtkVisibilityFactorFilter* New();
  vtkTypeMacro(vtkVisibilityFactorFilter, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * Opacity alpha as a function of the scalar, in [0, 1], such as a volume property's
   * GetScalarOpacity(). Default none: without it and without a 2-D function, the
   * array ExtinctionArrayName is read.
   */
  virtual void SetScalarOpacity(vtkPiecewiseFunction* function);
  vtkGetObjectMacro(ScalarOpacity, vtkPiecewiseFunction);
  ///@}

  ///@{
  /**
   * The length over which the opacity accumulates to alpha, as in vtkVolumeProperty;
   * finite, > 0, default 1.
   */
  vtkSetMacro(ScalarOpacityUnitDistance, double);
  vtkGetMacro(ScalarOpacityUnitDistance, double);
  ///@}

  ///@{
  /**
   * A factor in [0, 1] of the opacity, as a function of the gradient's length as
   * VTK's GPU mapper measures it: the difference of the two neighbours along each
   * axis, times the mean spacing over the axis'. Default none.
   */
  virtual void SetGradientOpacity(vtkPiecewiseFunction* function);
  vtkGetObjectMacro(GradientOpacity, vtkPiecewiseFunction);
  ///@}

  ///@{
  /**
   * A 2-D transfer function in the place of the two: RGBA of any type, x over the
   * range of the scalars, y over gradient lengths from 0 to a quarter of that range,
   * as in vtkVolumeProperty. Default none.
   */
  virtual void SetTransferFunction2D(vtkImageData* function);
  vtkGetObjectMacro(TransferFunction2D, vtkImageData);
  ///@}

  ///@{
  /**
   * The point array with sigma_t, in 1/length, >= 0, of one component (three for
   * RGBExtinction), read where no opacity is set. Default "Extinction".
   */
  vtkSetStdStringFromCharMacro(ExtinctionArrayName);
  vtkGetCharFromStdStringMacro(ExtinctionArrayName);
  ///@}

  ///@{
  /** Component of the scalars whose opacity is meant, >= 0; default 0. */
  vtkSetMacro(Component, int);
  vtkGetMacro(Component, int);
  ///@}

  ///@{
  /**
   * Extinction by colour, default off: shadows take the colour of what the light
   * passed. From a transfer function, Color gives it: with 1 - C for each channel,
   * sigma_c = 3 sigma_t (1 - C_c + 0.1) / sum (1 - C + 0.1), after the transport
   * colour of Kniss et al. (A model for volume lighting and modeling, IEEE TVCG 9(2),
   * 2003), scaled to keep the mean at sigma_t; grey stays grey. Else the extinction
   * array has three components. Then VisibilitySH has the coefficients of red, then
   * those of green, then those of blue; Visibility and AmbientOcclusion have red,
   * green, blue (per light).
   */
  vtkSetMacro(RGBExtinction, bool);
  vtkGetMacro(RGBExtinction, bool);
  vtkBooleanMacro(RGBExtinction, bool);
  ///@}

  ///@{
  /**
   * Colour of the scalar, for RGBExtinction: a volume property's
   * GetRGBTransferFunction(). Default none. A 2-D function brings its own.
   */
  virtual void SetColor(vtkScalarsToColors* function);
  vtkGetObjectMacro(Color, vtkScalarsToColors);
  ///@}

  ///@{
  /**
   * Highest band of the harmonics, 0 to 4, default 2: 1, 4, 9, 16 or 25
   * coefficients. 0 is the mean alone; 1 knows from which side light comes; more
   * make shadows narrower.
   */
  vtkSetMacro(Order, int);
  vtkGetMacro(Order, int);
  ///@}

  ///@{
  /**
   * How many directions are swept for the harmonics, evenly spread over the sphere,
   * with weights that make a constant exact. >= 0; the default 0 chooses by Order:
   * 32, 48, 64, 96, 144. Time grows with it; fewer than (2 Order + 1)^2 (and a few
   * more) let the bands mix.
   */
  vtkSetMacro(NumberOfDirections, int);
  vtkGetMacro(NumberOfDirections, int);
  ///@}

  ///@{
  /**
   * A length beyond which nothing occludes any more, for the harmonics and for
   * lights without a place. Finite, >= 0; the default 0 goes to the volume's border.
   */
  vtkSetMacro(Radius, double);
  vtkGetMacro(Radius, double);
  ///@}

  ///@{
  /**
   * Voxels of the input per voxel of the output and axis, >= 1; default 1. 2 takes an
   * eighth of memory and time. The output covers the input's domain, which ends half
   * a voxel beyond the outermost points of either.
   */
  vtkSetMacro(ResolutionFactor, int);
  vtkGetMacro(ResolutionFactor, int);
  ///@}

  ///@{
  /** Whether the output has VisibilitySH; default on. Off: for known lights alone. */
  vtkSetMacro(SphericalHarmonics, bool);
  vtkGetMacro(SphericalHarmonics, bool);
  vtkBooleanMacro(SphericalHarmonics, bool);
  ///@}

  ///@{
  /** Whether the output has AmbientOcclusion; default off. */
  vtkSetMacro(AmbientOcclusion, bool);
  vtkGetMacro(AmbientOcclusion, bool);
  vtkBooleanMacro(AmbientOcclusion, bool);
  ///@}

  ///@{
  /** Whether the output has Extinction, of stages 1 and 2; default off. */
  vtkSetMacro(OutputExtinction, bool);
  vtkGetMacro(OutputExtinction, bool);
  vtkBooleanMacro(OutputExtinction, bool);
  ///@}

  ///@{
  /**
   * Whether the known lights have an array each, Visibility0, Visibility1, ..., in the
   * place of Visibility; default off. On: those of lights that stay are the same
   * objects after an update, and nothing is copied for the one that moves.
   */
  vtkSetMacro(SeparateLights, bool);
  vtkGetMacro(SeparateLights, bool);
  vtkBooleanMacro(SeparateLights, bool);
  ///@}

  ///@{
  /**
   * Known lights, each with a component of Visibility of its own (three with
   * RGBExtinction), in the order of their making; the methods that add one return its
   * number. A directional light has the world direction towards it (of any length
   * > 0), a positional one a place in the world, in the volume or outside.
   */
  int AddDirectionalLight(double x, double y, double z);
  int AddPositionalLight(double x, double y, double z);
  void SetLightDirection(int light, double x, double y, double z);
  void SetLightPosition(int light, double x, double y, double z);
  void RemoveAllLights();
  int GetNumberOfLights() const;
  ///@}

  /**
   * The shares of red, green and blue in the extinction of what has this colour (0 to
   * 1), with the mean 1: see RGBExtinction.
   */
  static void GetTransportColor(const double rgb[3], double shares[3]);

  /**
   * The window with which VisibilitySH is read, a factor per band 0 to order (at most
   * 4; beyond 0): v(w) = sum_l k_l sum_m v_lm Y_lm(w) then lies in [0, 1]. It is the
   * non-negative kernel of that degree with the largest mean cosine (G. Szego:
   * Orthogonal polynomials, AMS 1939, section 7.72); order 2: 1, 1/sqrt(3), 1/5.
   */
  static void GetWindow(int order, double factors[5]);

  /**
   * Y_lm of a direction of length 1: sets the first (order + 1)^2 of the values (order
   * at most 4) and leaves the others alone.
   */
  static void GetHarmonics(int order, const double direction[3], double values[25]);

  ///@{
  /**
   * Seconds that the last update spent on the extinction, the harmonics and the
   * lights; 0 for what was kept.
   */
  vtkGetMacro(ExtinctionSeconds, double);
  vtkGetMacro(HarmonicsSeconds, double);
  vtkGetMacro(LightsSeconds, double);
  ///@}

  vtkMTimeType GetMTime() override;

protected:
  vtkVisibilityFactorFilter();
  ~vtkVisibilityFactorFilter() override;

  int RequestInformation(
    vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs) override;
  int RequestUpdateExtent(
    vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*) override;
  int RequestData(
    vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs) override;

  vtkPiecewiseFunction* ScalarOpacity = nullptr;
  vtkPiecewiseFunction* GradientOpacity = nullptr;
  vtkImageData* TransferFunction2D = nullptr;
  vtkScalarsToColors* Color = nullptr;
  double ScalarOpacityUnitDistance = 1.;
  std::string ExtinctionArrayName;
  int Component = 0;
  bool RGBExtinction = false;
  int Order = 2;
  int NumberOfDirections = 0;
  double Radius = 0.;
  int ResolutionFactor = 1;
  bool SphericalHarmonics = true;
  bool AmbientOcclusion = false;
  bool OutputExtinction = false;
  bool SeparateLights = false;
  double ExtinctionSeconds = 0.;
  double HarmonicsSeconds = 0.;
  double LightsSeconds = 0.;

private:
  struct State;

  /** What is wrong, or nothing. */
  std::string FindParameterProblem() const;
  std::string Compute(vtkImageData* input, vtkInformationVector** inputs, vtkImageData* output);
  std::string ComputeExtinction(vtkImageData* input, vtkInformationVector** inputs);
  void SetLight(int light, bool positional, double x, double y, double z);

  std::unique_ptr<State> Kept;

  vtkVisibilityFactorFilter(const vtkVisibilityFactorFilter&) = delete;
  void operator=(const vtkVisibilityFactorFilter&) = delete;
};

#endif
