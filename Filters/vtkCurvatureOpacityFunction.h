// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkCurvatureOpacityFunction
 * @brief   opacity as a function of curvature and depth
 *
 * The 2-D transfer function of Mean Curvature Transparency (D. Murray, Legible
 * Visualization of Semi-Transparent Objects using Light Transport, thesis,
 * Bordeaux 2018, section 2.4.2): curved parts of a surface carry its shape and are
 * drawn opaque, flat ones are looked through. Shared by vtkCurvatureOpacityFilter
 * and whatever draws with it; data only, no OpenGL.
 *
 *   opacity = f(|kappa|, z)     in [0, 1], 0 transparent, 1 opaque
 *
 *   kappa = -tanh(s (k1 + k2))  dimensionless, in [-1, 1]: -1 convex, 1 concave,
 *                               0 flat, from the principal curvatures with outward
 *                               normals (sphere of radius R: k1 = k2 = 1/R) and a
 *                               length s, see Kappa(). Both signs are crucial to
 *                               grasp a shape, so f takes |kappa|.
 *   z                           depth in [0, 1], 0 the nearest and 1 the farthest;
 *                               the caller says what of, or gives another quantity.
 *
 * Kinds of f, with lo = MinimumOpacity, hi = MaximumOpacity, c = |kappa|:
 *
 *   FocusFront     lo + (hi - lo) (1 - (1-c)^2 (1-z)^3)   figure 2.9, and 2.10 (a), (c):
 *                  flat and near is clear, curved is opaque; opacity grows quickly with
 *                  depth, which hides what lies behind
 *   WideDepth      lo + (hi - lo) (1 - (1-c) (1 - z^2))   figure 2.9, and 2.10 (b): less
 *                  focus in front, shape over a wider range of depth
 *   FrontOpaque    lo + (hi - lo) (1 - (1-c)^2) (1 - z)   figure 2.10 (d): the front is
 *                  more opaque than what is distant
 *   CurvatureOnly  lo + (hi - lo) (1 - (1-c)^2)           the same at all depths
 *   Product        CurvatureFunction(c) * DepthFunction(z), 1 for one that is not set
 *   Table          an image, interpolated bilinearly
 *
 * The thesis prints its functions as pictures without numbers: the formulas are
 * ours, made to do what its text says of each.
 *
 * Arguments outside their range are clamped to it, a NaN gives opacity 0, and
 * values outside [0, 1] are clamped.
 *
 * @sa vtkCurvatureOpacityFilter vtkVolumeCurvatureFilter
 */
#ifndef vtkCurvatureOpacityFunction_h
#define vtkCurvatureOpacityFunction_h

#include "vtkLightTransportFiltersModule.h" // for the export macro
#include "vtkObject.h"

#include <string> // for messages

class vtkDataArray;
class vtkImageData;
class vtkPiecewiseFunction;

class VTKLIGHTTRANSPORTFILTERS_EXPORT vtkCurvatureOpacityFunction : public vtkObject
{
public:
  static vtkCurvatureOpacityFunction* New();
  vtkTypeMacro(vtkCurvatureOpacityFunction, vtkObject);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  /** Where the opacity comes from; the formulas are above. */
  enum Kinds
  {
    FocusFront = 0,
    WideDepth = 1,
    FrontOpaque = 2,
    CurvatureOnly = 3,
    Product = 4,
    Table = 5
  };

  ///@{
  /**
   * Where the opacity comes from; default CurvatureOnly, whose flat parts are clear at any
   * depth: of the presets it is what shows most behind the front on assemblies, meshes and
   * isosurfaces (Module/Documentation/transparency.md). Other numbers are a Problem.
   */
  vtkSetMacro(Kind, int);
  vtkGetMacro(Kind, int);
  void SetKindToFocusFront() { this->SetKind(FocusFront); }
  void SetKindToWideDepth() { this->SetKind(WideDepth); }
  void SetKindToFrontOpaque() { this->SetKind(FrontOpaque); }
  void SetKindToCurvatureOnly() { this->SetKind(CurvatureOnly); }
  void SetKindToProduct() { this->SetKind(Product); }
  void SetKindToTable() { this->SetKind(Table); }
  const char* GetKindAsString() const;
  ///@}

  ///@{
  /** lo of the first four kinds, in [0, 1]; default 0.05: flat parts are still seen. */
  vtkSetMacro(MinimumOpacity, double);
  vtkGetMacro(MinimumOpacity, double);
  ///@}

  ///@{
  /** hi of the first four kinds, in [0, 1]; default 0.95. Below lo inverts the function. */
  vtkSetMacro(MaximumOpacity, double);
  vtkGetMacro(MaximumOpacity, double);
  ///@}

  ///@{
  /** A factor of the opacity over |kappa| in [0, 1], for Product. Default none: 1. */
  virtual void SetCurvatureFunction(vtkPiecewiseFunction* function);
  vtkGetObjectMacro(CurvatureFunction, vtkPiecewiseFunction);
  ///@}

  ///@{
  /** A factor of the opacity over z in [0, 1], for Product. Default none: 1. */
  virtual void SetDepthFunction(vtkPiecewiseFunction* function);
  vtkGetObjectMacro(DepthFunction, vtkPiecewiseFunction);
  ///@}

  ///@{
  /**
   * The opacity over |kappa| (x) and z (y), for Table: an image of one slice as
   * for vtkVolumeProperty::SetTransferFunction2D; its last component (the alpha of
   * RGBA) is read, integer types as fractions of their largest value. Its first
   * point along an axis is at 0 and its last at 1, whatever its spacing; an axis
   * with a single point is constant. Default none.
   */
  virtual void SetTableImage(vtkImageData* image);
  vtkGetObjectMacro(TableImage, vtkImageData);
  ///@}

  /** f(|kappa|, z). Any number of threads may ask at once. */
  double Evaluate(double kappa, double depth) const;

  /**
   * Writes f as an image: points of |kappa| along x and of z along y (2 or more
   * each), the first at 0 and the last at 1, one float32 component "Opacity". Its
   * pixels, x fastest, are a texture: with linear filtering and clamped edges, f is
   * at the coordinates ((|kappa| (points - 1) + 0.5) / points, likewise for z).
   */
  void ExportTable(vtkImageData* image, int numberOfCurvatures = 64, int numberOfDepths = 64) const;

  /**
   * What is wrong ("what, value, expected"), or an empty string. Those who use the
   * function ask first; Evaluate gives 0 where it cannot be evaluated.
   */
  std::string GetProblem() const;

  /**
   * -tanh(s (k1 + k2)), see above. s is a length, in the unit whose inverse k1 and
   * k2 have, so the unit does not matter.
   */
  static double Kappa(double k1, double k2, double s);

  /**
   * The s of which |kappa| is 1/2 at the upper quartile of |k1 + k2| of what is curved
   * at all, from an array of mean curvatures; 0 where nothing is.
   */
  static double ChooseCurvatureScale(vtkDataArray* meanCurvature);

  vtkMTimeType GetMTime() override;

protected:
  vtkCurvatureOpacityFunction() = default;
  ~vtkCurvatureOpacityFunction() override;

  int Kind = CurvatureOnly;
  double MinimumOpacity = 0.05;
  double MaximumOpacity = 0.95;
  vtkPiecewiseFunction* CurvatureFunction = nullptr;
  vtkPiecewiseFunction* DepthFunction = nullptr;
  vtkImageData* TableImage = nullptr;

private:
  double EvaluateTable(double c, double z) const;

  vtkCurvatureOpacityFunction(const vtkCurvatureOpacityFunction&) = delete;
  void operator=(const vtkCurvatureOpacityFunction&) = delete;
};

#endif
