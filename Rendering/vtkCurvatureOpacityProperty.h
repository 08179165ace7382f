// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkCurvatureOpacityProperty
 * @brief   how the curvature of a surface changes its colour and opacity
 *
 * What vtkBucketedKBufferPass does with a fragment, given its curvature: shared by
 * a pass and by any number of vtkCurvatureOpacityPolyDataMapper. All is off by
 * default: the picture is then plain transparency. It touches no GL.
 *
 * The curvature is measured on the screen from a fragment's neighbours on the same
 * surface (Murray, Baril and Granier 2016):
 *
 *   kappa = -tanh(s (k1 + k2))   in [-1,1]: -1 convex, 0 flat, 1 concave
 *
 * with principal curvatures k1, k2 for outward normals in 1/length of the world (a
 * sphere of radius R has k1 = k2 = 1/R, from inside too) and the length s of
 * vtkBucketedKBufferPass::SetCurvatureScale. Outward is where the mesh's normals
 * point, or without normals where its triangles turn counterclockwise. Where a
 * neighbour is missing, at an outline or an edge of the surface, kappa is -1.
 *
 * A fragment of colour c and opacity alpha becomes, in this order:
 *
 * 1. CurvatureShading: c * ShadingFunction(kappa) * ShadingColors(kappa)
 *    (mean curvature shading, Kindlmann et al. 2003; section 2.4.2 of Murray's thesis)
 * 2. RadianceScaling r: c * sigma(kappa, n . v) of Vergne et al. 2010
 * 3. CurvatureOpacity: alpha = OpacityFunction(|kappa|, depth), in place of the
 *    surface's own; depth is 0 at the nearest and 1 at the farthest point of the
 *    bounds of what is translucent
 *
 * 4. lines, a layer over this one
 *
 * Points, lines and wireframes have no curvature and stay as they are.
 *
 * Opaque actors take part too, as layers of opacity 1, where the pass is the renderer's own;
 * vtkActor::ForceOpaqueOn keeps one out of it. In somebody else's sequence of passes the
 * opaque step comes first: there vtkActor::ForceTranslucentOn lets one take part.
 *
 * @sa vtkBucketedKBufferPass vtkCurvatureOpacityPolyDataMapper
 */
#ifndef vtkCurvatureOpacityProperty_h
#define vtkCurvatureOpacityProperty_h

#include "vtkLightTransportRenderingModule.h" // for the export macro
#include "vtkObject.h"
#include "vtkSmartPointer.h" // for the functions

#include <array> // for the parameters

class vtkColorTransferFunction;
class vtkCurvatureOpacityFunction;
class vtkPiecewiseFunction;

class VTKLIGHTTRANSPORTRENDERING_EXPORT vtkCurvatureOpacityProperty : public vtkObject
{
public:
  static vtkCurvatureOpacityProperty* New();
  vtkTypeMacro(vtkCurvatureOpacityProperty, vtkObject);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /** Shade by curvature; off by default. */
  vtkSetMacro(CurvatureShading, bool);
  vtkGetMacro(CurvatureShading, bool);
  vtkBooleanMacro(CurvatureShading, bool);
  ///@}

  ///@{
  /**
   * Factor of the colour over kappa in [-1,1]. Default, and for nullptr: bright
   * convexities and dark concavities as in figure 2.8 (a) of the thesis, 1.5 at -1,
   * 1 at 0, 0.25 at 1.
   */
  void SetShadingFunction(vtkPiecewiseFunction* function);
  vtkPiecewiseFunction* GetShadingFunction();
  ///@}

  ///@{
  /**
   * A further factor per channel over kappa in [-1,1], for curvature in colours.
   * Default: nullptr, white.
   */
  void SetShadingColors(vtkColorTransferFunction* colors);
  vtkColorTransferFunction* GetShadingColors();
  ///@}

  ///@{
  /** Opacity by curvature and depth; off by default. */
  vtkSetMacro(CurvatureOpacity, bool);
  vtkGetMacro(CurvatureOpacity, bool);
  vtkBooleanMacro(CurvatureOpacity, bool);
  ///@}

  ///@{
  /** The opacity over |kappa| and depth; setting nullptr makes a default one. */
  void SetOpacityFunction(vtkCurvatureOpacityFunction* function);
  vtkCurvatureOpacityFunction* GetOpacityFunction();
  ///@}

  ///@{
  /**
   * Strength of radiance scaling, in [0,10] (clamped): 0 (default) is none, 0.5 plain to see, 2 a
   * drawing. The light of its reflectance is at the eye; the invariant point is 0.2.
   */
  vtkSetClampMacro(RadianceScaling, double, 0., 10.);
  vtkGetMacro(RadianceScaling, double);
  ///@}

  ///@{
  /**
   * Lines on the surface, of every layer, off by default:
   * - occluding contours, where the surface turns away from the eye (n . v = 0) or ends;
   * - suggestive contours (DeCarlo et al. 2003), where it nearly does: the curvature
   *   towards the eye is 0 and grows;
   * - ridges and valleys: the stronger principal curvature is extreme along its direction;
   * - demarcating curves (Kolomenkin et al. 2008), the inflections between those: no
   *   curvature along the direction in which it changes most.
   * The last three need the second derivatives of normals: they want smooth meshes, and
   * vtkBucketedKBufferPass::SetLineSmoothing.
   */
  vtkSetMacro(OccludingContours, bool);
  vtkGetMacro(OccludingContours, bool);
  vtkBooleanMacro(OccludingContours, bool);
  vtkSetMacro(SuggestiveContours, bool);
  vtkGetMacro(SuggestiveContours, bool);
  vtkBooleanMacro(SuggestiveContours, bool);
  vtkSetMacro(RidgesAndValleys, bool);
  vtkGetMacro(RidgesAndValleys, bool);
  vtkBooleanMacro(RidgesAndValleys, bool);
  vtkSetMacro(DemarcatingCurves, bool);
  vtkGetMacro(DemarcatingCurves, bool);
  vtkBooleanMacro(DemarcatingCurves, bool);
  ///@}

  ///@{
  /** Width of the lines in pixels, antialiased; from 0.1 to 32 (clamped), 1.5 by default. */
  vtkSetClampMacro(LineWidth, double, .1, 32.);
  vtkGetMacro(LineWidth, double);
  ///@}

  ///@{
  /** Colour of the lines, not lit; black by default. */
  vtkSetVector3Macro(LineColor, double);
  vtkGetVector3Macro(LineColor, double);
  ///@}

  ///@{
  /** Opacity of the lines over their layer, in [0,1] (clamped); 1 by default. */
  vtkSetClampMacro(LineOpacity, double, 0., 1.);
  vtkGetMacro(LineOpacity, double);
  ///@}

  ///@{
  /**
   * The least curvature k of a ridge or valley as s k, with the length s of
   * vtkBucketedKBufferPass::SetCurvatureScale, and of suggestive contours and demarcating
   * curves the least change of curvature as s^2 dk/dx. 0.5 by default; 0 shows all, noise
   * too. Clamped to be >= 0.
   */
  vtkSetClampMacro(LineThreshold, double, 0., VTK_DOUBLE_MAX);
  vtkGetMacro(LineThreshold, double);
  ///@}

  /** Whether anything is on, and whether lines are. */
  bool HasEffect();
  bool HasLines();

  /** For vtkBucketedKBufferPass: the row of its table, 4 texels of RGBA. */
  std::array<float, 16> GetParameters();

  /** Also changes with the functions. */
  vtkMTimeType GetMTime() override;

protected:
  vtkCurvatureOpacityProperty();
  ~vtkCurvatureOpacityProperty() override;

  bool CurvatureShading = false;
  bool CurvatureOpacity = false;
  double RadianceScaling = 0.;
  bool OccludingContours = false;
  bool SuggestiveContours = false;
  bool RidgesAndValleys = false;
  bool DemarcatingCurves = false;
  double LineWidth = 1.5;
  double LineColor[3] = { 0., 0., 0. };
  double LineOpacity = 1.;
  double LineThreshold = .5;

private:
  vtkSmartPointer<vtkPiecewiseFunction> ShadingFunction;
  vtkSmartPointer<vtkColorTransferFunction> ShadingColors;
  vtkSmartPointer<vtkCurvatureOpacityFunction> OpacityFunction;

  vtkCurvatureOpacityProperty(const vtkCurvatureOpacityProperty&) = delete;
  void operator=(const vtkCurvatureOpacityProperty&) = delete;
};

#endif
