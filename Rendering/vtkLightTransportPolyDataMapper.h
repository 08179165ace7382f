// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkLightTransportPolyDataMapper
 * @brief   surfaces in and around a volume, in the volume's shadow
 *
 * A vtkPolyDataMapper whose lights are weighted, light by light and fragment by
 * fragment, by the visibility of a volume (vtkVisibilityFactorFilter): a mesh in a
 * head is shadowed by the tissue between it and each light.
 *
 *   colour = ambient A + sum over the lights i of v_i (diffuse_i + specular_i)
 *
 * with VTK's own terms, Gouraud, Phong or physically based; v_i is 1 - ShadowStrength
 * (1 - visibility towards the light), A the same of the mean visibility. Where the
 * image has the point arrays
 *
 *   Extinction     the first eight lights, the camera's included, have exact fields
 *                  of their own (one sweep when one of them moves); of red, green and
 *                  blue (RGBExtinction), the first four, in colours,
 *   VisibilitySH   all other lights are looked up in the harmonics, through their
 *                  window: softer, for nothing. Without this array they are computed
 *                  from Extinction where they are needed.
 *
 * Fragments beside the volume look along the ray to the light where it enters the
 * volume: the volume's shadow falls on a floor, too.
 *
 * The volume says where its shadows are:
 *
 * @code
 *   mapper->SetVolume(volume);   // a vtkVolume that a vtkGPUVolumeRayCastMapper draws
 * @endcode
 *
 * computes them from what that mapper draws, opacities, masks, cropping and clipping
 * included, whenever it changes. Or a visibility of one's own, which other mappers can
 * share, SetVisibilityConnection of vtkLightTransportVolumeMapper among them:
 *
 * @code
 *   vtkNew<vtkVisibilityFactorFilter> visibility;   // of the volume and its opacity
 *   visibility->OutputExtinctionOn();
 *   mapper->SetVisibilityConnection(visibility->GetOutputPort());
 * @endcode
 *
 * Mappers with the same connection and volume share sweeps and textures in a window.
 *
 * A problem is reported once, by vtkErrorMacro, and the surface then drawn without shadows. The
 * picture is VTK's own, to the pixel, without a visibility and volume and with ShadowStrength and
 * AmbientOcclusion 0.
 *
 * Not for: shadows that surfaces cast (vtkShadowMapPass), composite data (the
 * superclass has none).
 *
 * @sa vtkVisibilityFactorFilter vtkLightTransportVolumeMapper
 */
#ifndef vtkLightTransportPolyDataMapper_h
#define vtkLightTransportPolyDataMapper_h

#include "vtkLightTransportRenderingModule.h" // for the export macro
#include "vtkOpenGLPolyDataMapper.h"

#include <memory> // for the implementation

class vtkAlgorithmOutput;
class vtkImageData;
class vtkProp3D;

class VTKLIGHTTRANSPORTRENDERING_EXPORT vtkLightTransportPolyDataMapper
  : public vtkOpenGLPolyDataMapper
{
public:
  static vtkLightTransportPolyDataMapper* New();
  vtkTypeMacro(vtkLightTransportPolyDataMapper, vtkOpenGLPolyDataMapper);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The visibility: an image with the point arrays VisibilitySH (1, 4, 9, 16 or 25
   * components, or three times as many), Extinction (one or three), or both. A connection is
   * updated when a frame is drawn. nullptr (default): the volume's, or, without one, VTK's picture.
   */
  void SetVisibilityConnection(vtkAlgorithmOutput* output);
  void SetVisibilityData(vtkImageData* image);
  ///@}

  ///@{
  /**
   * The volume in whose shadow the surface lies. Its matrix places the visibility in the
   * world (without a volume its coordinates are the world's); without a visibility of
   * one's own it is computed from what the mapper of this vtkVolume draws. Default
   * nullptr. The prop is kept alive.
   */
  void SetVolume(vtkProp3D* volume);
  vtkProp3D* GetVolume();
  ///@}

  ///@{
  /**
   * The visibility that is computed here has about this number to the power of three of
   * points at most: the volume's own, or every second, third... of them along the axes on
   * which they are closest. At least 8, default 128.
   */
  vtkSetClampMacro(VisibilityResolution, int, 8, VTK_INT_MAX);
  vtkGetMacro(VisibilityResolution, int);
  ///@}

  ///@{
  /** How dark a shadow is, in [0, 1] (clamped); default 1, as dark as the optical depth says. */
  vtkSetClampMacro(ShadowStrength, double, 0., 1.);
  vtkGetMacro(ShadowStrength, double);
  ///@}

  ///@{
  /** How much the mean visibility darkens the ambient term, in [0, 1] (clamped); default 1. */
  vtkSetClampMacro(AmbientOcclusion, double, 0., 1.);
  vtkGetMacro(AmbientOcclusion, double);
  ///@}

  ///@{
  /**
   * How far before the surface, along its normal, visibility is looked up: a world
   * length, >= 0 (clamped), default 0. For a surface that was extracted from the same
   * volume, whose first layer else shadows it: one or two voxels.
   */
  vtkSetClampMacro(SurfaceOffset, double, 0., VTK_DOUBLE_MAX);
  vtkGetMacro(SurfaceOffset, double);
  ///@}

  /**
   * How often the visibility was uploaded, for all mappers that share it: nothing is when nothing
   * changed.
   */
  int GetNumberOfVisibilityUploads();

  void RenderPieceStart(vtkRenderer* renderer, vtkActor* actor) override;
  void RenderPieceFinish(vtkRenderer* renderer, vtkActor* actor) override;
  void ReleaseGraphicsResources(vtkWindow* window) override;

protected:
  vtkLightTransportPolyDataMapper();
  ~vtkLightTransportPolyDataMapper() override;

  bool GetNeedToRebuildShaders(
    vtkOpenGLHelper& primitive, vtkRenderer* renderer, vtkActor* actor) override;
  void ReplaceShaderLight(
    std::map<vtkShader::Type, vtkShader*> shaders, vtkRenderer* renderer, vtkActor* actor) override;
  void SetMapperShaderParameters(
    vtkOpenGLHelper& primitive, vtkRenderer* renderer, vtkActor* actor) override;

  double ShadowStrength = 1.;
  double AmbientOcclusion = 1.;
  double SurfaceOffset = 0.;
  int VisibilityResolution = 128;

private:
  class Implementation;
  std::unique_ptr<Implementation> Internal;

  void ReportOnce(const std::string& problem);

  vtkLightTransportPolyDataMapper(const vtkLightTransportPolyDataMapper&) = delete;
  void operator=(const vtkLightTransportPolyDataMapper&) = delete;
};

#endif
