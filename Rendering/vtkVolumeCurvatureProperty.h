// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkVolumeCurvatureProperty
 * @brief   how a volume's opacity follows curvature and depth
 *
 * Set on a vtkLightTransportVolumeMapper, it multiplies the opacity of each sample
 * by f(|kappa|, z) (D. Murray, Legible Visualization of Semi-Transparent Objects
 * using Light Transport, thesis, Bordeaux 2018, sections 2.4.2 and 3.1.1):
 *
 *   kappa  = -tanh(s (k1 + k2))  the level set's curvature, where the mapper has a
 *                                curvature field (vtkVolumeCurvatureFilter)
 *   |kappa| = tanh(s |dn|/dl)    else: the turn of the normal n along the ray per
 *                                length (Bruckner and Groeller, Style transfer
 *                                functions, 2007). On a sphere of radius R seen at
 *                                the angle theta to its normal it is sin(theta)/R:
 *                                0 in the middle, 1/R at the contour. It depends on
 *                                the view, needs nothing precomputed, and has the
 *                                noise of second differences.
 *   z       depth along the direction of view, 0 at the volume's nearest corner, 1
 *           at its farthest; it turns with the camera, continuously
 *   f       a vtkCurvatureOpacityFunction
 *
 * Isosurface blending: each layer has the opacity alpha f. Composite blending: the
 * extinction is multiplied, 1 - (1 - alpha)^f, so that the picture does not depend on
 * the sample distance; an opacity of 1 counts as 0.999. Other blend modes and
 * hardware selection are left alone.
 *
 * What it is good for: isosurfaces, of which few lie behind each other, and bounded
 * media. A dense volume blends a hundred samples a ray, whose level sets have
 * little to do with what the eye sees as surfaces; the thesis found it of little use
 * there, and so do we: it acts like a gradient opacity. The default function is
 * therefore CurvatureOnly, which empties homogeneous and flat regions (curvature 0,
 * opacity 0.05) and leaves edges and folds; the functions with depth fill the back.
 *
 * Changes never rebuild a shader, but for curvature that comes or goes.
 *
 * @sa vtkLightTransportVolumeMapper vtkCurvatureOpacityFunction vtkVolumeCurvatureFilter
 */
#ifndef vtkVolumeCurvatureProperty_h
#define vtkVolumeCurvatureProperty_h

#include "vtkLightTransportRenderingModule.h" // for the export macro
#include "vtkObject.h"

class vtkCurvatureOpacityFunction;

class VTKLIGHTTRANSPORTRENDERING_EXPORT vtkVolumeCurvatureProperty : public vtkObject
{
public:
  static vtkVolumeCurvatureProperty* New();
  vtkTypeMacro(vtkVolumeCurvatureProperty, vtkObject);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /** f; default CurvatureOnly. nullptr: no modulation. */
  virtual void SetOpacityFunction(vtkCurvatureOpacityFunction* function);
  vtkGetObjectMacro(OpacityFunction, vtkCurvatureOpacityFunction);
  ///@}

  ///@{
  /**
   * s, a length of the data's unit, >= 0; negative and NaN become 0. The default 0
   * chooses it: with a field as vtkCurvatureOpacityFilter does, from the data; along
   * the ray a fiftieth of the volume's diagonal.
   */
  virtual void SetCurvatureScale(double scale);
  vtkGetMacro(CurvatureScale, double);
  ///@}

  ///@{
  /** In [0, 1], clamped: 0 the superclass's picture, 1 (default) the whole effect. */
  virtual void SetStrength(double strength);
  vtkGetMacro(Strength, double);
  ///@}

  vtkMTimeType GetMTime() override;

protected:
  vtkVolumeCurvatureProperty();
  ~vtkVolumeCurvatureProperty() override;

  vtkCurvatureOpacityFunction* OpacityFunction = nullptr;
  double CurvatureScale = 0.;
  double Strength = 1.;

private:
  vtkVolumeCurvatureProperty(const vtkVolumeCurvatureProperty&) = delete;
  void operator=(const vtkVolumeCurvatureProperty&) = delete;
};

#endif
