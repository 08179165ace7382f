// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkVolumeLightingProperty
 * @brief   how a volume is lit: shadows, shading model, phase function, environment
 *
 * The parameters of vtkLightTransportVolumeMapper's lighting; several mappers may
 * share one object. A mapper without one draws VTK's own shading. What is lit is
 * said by the vtkVolumeProperty, as always (colour, and the ambient, diffuse and
 * specular coefficients and the specular power of its components), by what by the
 * renderer: its lights and its environment texture. Shade of the vtkVolumeProperty
 * has no say here.
 *
 * The light that a sample with the colour c sends to the eye (Murray, thesis,
 * Bordeaux 2018, equation 1.15; the factor v is that of its section "Shadowing
 * and Visibility"):
 *
 *   L = ambient c A + sum over the lights i of v_i I_i L_i + E
 *   I = w BRDF (n . l_i) + (1 - w) diffuse c 4 pi P(cos theta)
 *
 * - v_i: the fraction of the light i that the volume lets through to the sample
 *   (ShadowMode), v_i = 1 - ShadowStrength (1 - exp(-optical depth)).
 * - w: how much of a surface the sample is: 0 where the gradient of the data is
 *   less than half of GradientThreshold, 1 from twice the threshold on, smooth
 *   between.
 * - BRDF: BlinnPhong, diffuse c + specular s (n . h)^power / (n . l), with VTK's
 *   lights, whose intensity 1 lights a white surface to 1; PhysicallyBased,
 *   the terms of VTK's surfaces (GGX, Smith, Schlick) with Roughness and Metallic.
 *   The normal n is that of the gradient, turned to the eye.
 * - P: the phase function of Henyey and Greenstein (Astrophysical Journal 93, 1941)
 *   with the mean cosine Anisotropy; as in VTK 9.2, its mean over directions counts
 *   as 1, so that isotropic scattering has the brightness of a surface that faces
 *   the light.
 * - A: 1 - AmbientOcclusion (1 - mean of v over all directions).
 * - E: the environment's light by its spherical harmonics up to order 2, times the
 *   visibility's; EnvironmentStrength times the renderer's environment texture,
 *   or without one a white surround. Where it is 1 everywhere and nothing occludes,
 *   E is diffuse c, exactly.
 *
 * Everything is added up linearly and not clamped before the picture is: more than
 * one strong light wants a vtkToneMappingPass.
 *
 * Changes of ShadowMode, ShadingModel and Deferred, of whether Strength is 0, 1 or
 * between and of whether EnvironmentStrength and AmbientOcclusion are 0 build a
 * shader (mostly taken from a cache); others are uniforms.
 *
 * This class is not for the light inside a volume: that is vtkLightFieldProperty.
 *
 * @sa vtkLightTransportVolumeMapper vtkVisibilityFactorFilter
 */
#ifndef vtkVolumeLightingProperty_h
#define vtkVolumeLightingProperty_h

#include "vtkLightTransportRenderingModule.h" // for the export macro
#include "vtkObject.h"

class VTKLIGHTTRANSPORTRENDERING_EXPORT vtkVolumeLightingProperty : public vtkObject
{
public:
  static vtkVolumeLightingProperty* New();
  vtkTypeMacro(vtkVolumeLightingProperty, vtkObject);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  enum ShadowModes
  {
    NoShadows = 0,
    Precomputed = 1,
    RayTraced = 2
  };
  enum ShadingModels
  {
    BlinnPhong = 0,
    PhysicallyBased = 1
  };

  ///@{
  /**
   * From 0 (VTK's picture, to the pixel) to 1 (default): between, the two are mixed
   * sample by sample. Clamped.
   */
  void SetStrength(double strength);
  vtkGetMacro(Strength, double);
  ///@}

  ///@{
  /**
   * Where a light's visibility comes from. Precomputed (default): from fields that
   * are computed when the volume or its transfer functions change, and for exact lights
   * (NumberOfExactLights) when these move with respect to the volume. RayTraced: a ray from each
   * sample to each light, the slow reference (of a volume drawn in partitions: as Precomputed);
   * ambient occlusion and environment are then as in Precomputed. NoShadows: nothing occludes,
   * neither lights nor environment.
   */
  void SetShadowMode(int mode);
  vtkGetMacro(ShadowMode, int);
  void SetShadowModeToNoShadows() { this->SetShadowMode(NoShadows); }
  void SetShadowModeToPrecomputed() { this->SetShadowMode(Precomputed); }
  void SetShadowModeToRayTraced() { this->SetShadowMode(RayTraced); }
  const char* GetShadowModeAsString();
  ///@}

  ///@{
  /**
   * How dark a shadow is, in [0,1] (clamped), 1 (default) as dark as the optical
   * depth says. Less keeps what lies deep in an opaque volume legible.
   */
  void SetShadowStrength(double strength);
  vtkGetMacro(ShadowStrength, double);
  ///@}

  ///@{
  /**
   * Whether shadows take the colour of what the light passed: red behind red matter
   * (vtkVisibilityFactorFilter's RGBExtinction, of the colours that are drawn). Three
   * times the work; then changes of colour compute anew. For exact lights and
   * RayTraced; others are looked up as without. Default off.
   */
  vtkSetMacro(ColoredShadows, bool);
  vtkGetMacro(ColoredShadows, bool);
  vtkBooleanMacro(ColoredShadows, bool);
  ///@}

  ///@{
  /** The surfaces' reflection; BlinnPhong by default. */
  void SetShadingModel(int model);
  vtkGetMacro(ShadingModel, int);
  void SetShadingModelToBlinnPhong() { this->SetShadingModel(BlinnPhong); }
  void SetShadingModelToPhysicallyBased() { this->SetShadingModel(PhysicallyBased); }
  const char* GetShadingModelAsString();
  ///@}

  ///@{
  /** Of PhysicallyBased, in [0,1] (clamped): 0 a mirror, 1 chalk; default 0.5. */
  void SetRoughness(double roughness);
  vtkGetMacro(Roughness, double);
  ///@}

  ///@{
  /** Of PhysicallyBased, in [0,1] (clamped): 0 (default) dielectric, 1 metal. */
  void SetMetallic(double metallic);
  vtkGetMacro(Metallic, double);
  ///@}

  ///@{
  /**
   * Mean cosine g of the phase function, clamped to [-0.95, 0.95]; 0 (default)
   * isotropic, > 0 forward: bright against the light.
   */
  void SetAnisotropy(double g);
  vtkGetMacro(Anisotropy, double);
  ///@}

  ///@{
  /**
   * |grad S| above which a sample is a surface: units of the data per world length,
   * of the component that is shaded. 0 (default): 1/40 of the component's range per
   * the smallest spacing. A huge one makes everything a medium, a tiny one
   * everything a surface. Negative or non-finite values are refused with an error.
   */
  void SetGradientThreshold(double threshold);
  vtkGetMacro(GradientThreshold, double);
  ///@}

  ///@{
  /**
   * How far before a surface, along its normal, visibility is looked up: in steps of
   * the visibility's grid in that direction, in [0,10] (clamped), default 3. With 0 the first layer
   * of voxels already shadows the surface that it is, as single scattering in a cloud has it:
   * opaque surfaces then have half their brightness. So does, towards the eye, what is opaque
   * within this length (from an optical depth of 1 on, fully from 4 on), such as a cut through
   * dense matter.
   */
  void SetSurfaceOffset(double voxels);
  vtkGetMacro(SurfaceOffset, double);
  ///@}

  ///@{
  /** How much the surroundings darken the ambient term, in [0,1] (clamped); default 1. */
  void SetAmbientOcclusion(double strength);
  vtkGetMacro(AmbientOcclusion, double);
  ///@}

  ///@{
  /**
   * Factor on the environment's radiance; 0 (default): no environment. Negative or
   * non-finite values are refused with an error.
   */
  void SetEnvironmentStrength(double strength);
  vtkGetMacro(EnvironmentStrength, double);
  ///@}

  ///@{
  /**
   * Off (default): every sample is lit. On, the cheap mode: the ray's colour is
   * composited unlit and lit once, at its first hit, where its opacity first exceeds
   * a half (or where it grew most, if it never does). Composite blending only.
   */
  vtkSetMacro(Deferred, bool);
  vtkGetMacro(Deferred, bool);
  vtkBooleanMacro(Deferred, bool);
  ///@}

  ///@{
  /**
   * Precomputed: this many of the lights get exact fields of their own, 0 to 8
   * (clamped; 4 with ColoredShadows), 8 by default; of more lights, scene lights
   * (vtkLight's SceneLight) come first, then the others in the renderer's order. A
   * field is computed when its light moves with respect to the volume: that of a
   * headlight in each frame in which the camera turns (milliseconds at 128 points
   * along an axis, 20 at 256). Lights beyond are looked up in the spherical harmonics:
   * softer, and nothing is computed when they move. 0 is for slow computers and large
   * VisibilityResolutions.
   */
  void SetNumberOfExactLights(int number);
  vtkGetMacro(NumberOfExactLights, int);
  ///@}

  ///@{
  /**
   * Order of the spherical harmonics, 1 to 4 (clamped), 2 by default. Each order
   * costs memory and look-ups: 1, 3, 4 and 7 textures of four bytes per point.
   */
  void SetVisibilityOrder(int order);
  vtkGetMacro(VisibilityOrder, int);
  ///@}

  ///@{
  /**
   * The visibility's grid has about this number to the power of three of points at most
   * (up to a quarter more): the volume's own, or every second, third... of them along the
   * axes on which they are closest. At least 8, 128 by default.
   */
  void SetVisibilityResolution(int points);
  vtkGetMacro(VisibilityResolution, int);
  ///@}

protected:
  vtkVolumeLightingProperty() = default;
  ~vtkVolumeLightingProperty() override = default;

  double Strength = 1.;
  int ShadowMode = Precomputed;
  double ShadowStrength = 1.;
  int ShadingModel = BlinnPhong;
  double Roughness = .5;
  double Metallic = 0.;
  double Anisotropy = 0.;
  double GradientThreshold = 0.;
  double SurfaceOffset = 3.;
  double AmbientOcclusion = 1.;
  double EnvironmentStrength = 0.;
  bool Deferred = false;
  int NumberOfExactLights = 8;
  bool ColoredShadows = false;
  int VisibilityOrder = 2;
  int VisibilityResolution = 128;

private:
  void SetClamped(double& member, double value, double lo, double hi, const char* name);
  void SetNonNegative(double& member, double value, const char* name);
  void SetChoice(int& member, int value, int highest, const char* name, const char* expected);

  vtkVolumeLightingProperty(const vtkVolumeLightingProperty&) = delete;
  void operator=(const vtkVolumeLightingProperty&) = delete;
};

#endif
