// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkLightTransportVolumeMapper
 * @brief   GPU ray casting of a volume with a light field in it
 *
 * The picture of vtkOpenGLGPUVolumeRayCastMapper and, woven into its ray march
 * sample by sample, a light field: the fluence or the flux that
 * vtkLightDiffusionFilter computes, or any image with such an array. How it
 * looks is set on a vtkLightFieldProperty, which several mappers may share.
 *
 * @code
 *   mapper->SetInputConnection(reader->GetOutputPort());           // the volume
 *   mapper->SetLightFieldConnection(diffusion->GetOutputPort());   // its light
 *   mapper->GetLightFieldProperty()->SetStrength(0.8);
 * @endcode
 *
 * The light field has its own grid: coarser, shifted, turned (direction matrix)
 * against the volume's, smaller or larger; where it ends (half a spacing beyond
 * its outermost points) there is no light. It lives in the volume's data
 * coordinates, so it moves with the vtkVolume. It is not one of the mapper's
 * input ports, which are all volumes: the mapper brings its pipeline up to date
 * itself while it renders, so that a changed seed upstream and a Render() are
 * enough.
 *
 * Each frame runs through these stages:
 *
 * 1. update the light field's pipeline; check what comes out
 * 2. upload the field, scaled to a maximum of 1, if its array changed, and the
 *    colour maps, a small table, if the property changed
 * 3. hang a vtkOpenGLRenderPass on the volume for the time of this render: it
 *    adds the shader parts of Rendering/glsl to the superclass's shader when
 *    that is built, and sets samplers and uniforms on every frame
 * 4. render as the superclass does
 *
 * Replacements that users put on the volume's vtkShaderProperty stay theirs and
 * work together with this. The phi stored is interpolated, and the logarithm
 * taken per sample, which is right where phi spans decades from voxel to voxel.
 *
 * By blend mode:
 * - composite and isosurface: see vtkLightFieldProperty's modes
 * - slice: the light is laid over the slice
 * - maximum and minimum intensity: Overlay and FluxDirection show the strongest
 *   light along the ray over the projection; Illuminate takes the light at the
 *   sample that was projected
 * - average and additive: the light has no place there and is left out
 *
 * A shader is built for a new mode, for what makes the superclass build one, and
 * when light comes or goes (a strength to or from 0), then mostly from the cache;
 * colours, windows, strengths, opacities and fields are uniforms and textures.
 *
 * Also without light, exactly the superclass's picture: Strength 0, no light
 * field, a field of zeros, hardware selection (the light can't be picked), a
 * vtkMultiVolume and UseDepthPass (one warning each). What is wrong with a light
 * field (no such array, wrong number of components, NaN, larger than the GPU's
 * 3-D textures, its producer failed) is one error per cause, and the picture
 * without light.
 *
 * With a vtkVolumeLightingProperty the volume is also lit, with shadows, by the
 * renderer's lights and environment:
 *
 * @code
 *   vtkNew<vtkVolumeLightingProperty> lighting;
 *   mapper->SetLightingProperty(lighting);
 * @endcode
 *
 * Composite and isosurface blending have all of it; in the other blend modes, and for rectilinear
 * grids, lighting is left out. The visibility (vtkVisibilityFactorFilter) is computed from what the
 * mapper draws: opacities by scalar and gradient, 2-D transfer functions, components, masks,
 * cropping and clipping planes, isosurfaces; when one of these changes, when a light
 * with an exact field moves (its own field alone; a headlight with its camera), not for
 * colours. Lighting
 * comes first, then the light field over it. Samples without opacity are passed
 * over before they cost anything, so that a lit frame is often faster than VTK's
 * shaded one. Lights are where they are with respect to the world: the volume may
 * move. Picking sees the stock picture.
 *
 * With a vtkVolumeCurvatureProperty opacity follows curvature and depth, in
 * composite and isosurface blending, below the light: see there. The shadows are
 * those of the volume without it.
 *
 * Not for: solving (see vtkLightDiffusionFilter) and surfaces.
 *
 * @sa vtkLightFieldProperty vtkVolumeLightingProperty vtkVolumeCurvatureProperty
 * @sa vtkLightDiffusionFilter
 * @sa vtkVisibilityFactorFilter vtkLightFieldSlices
 */
#ifndef vtkLightTransportVolumeMapper_h
#define vtkLightTransportVolumeMapper_h

#include "vtkLightTransportRenderingModule.h" // for the export macro
#include "vtkOpenGLGPUVolumeRayCastMapper.h"

#include <memory> // for the implementation

class vtkAlgorithmOutput;
class vtkImageData;
class vtkLightFieldProperty;
class vtkVolumeCurvatureProperty;
class vtkVolumeLightingProperty;

class VTKLIGHTTRANSPORTRENDERING_EXPORT vtkLightTransportVolumeMapper
  : public vtkOpenGLGPUVolumeRayCastMapper
{
public:
  static vtkLightTransportVolumeMapper* New();
  vtkTypeMacro(vtkLightTransportVolumeMapper, vtkOpenGLGPUVolumeRayCastMapper);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The light field: an image with the point array "Fluence" (one component) or,
   * for FluxDirection, "Flux" (three), of any numeric type. A connection is
   * updated by the mapper. nullptr: no light. Default: none.
   * Setting it does not count as a modification of the mapper, which would
   * rebuild the shader.
   */
  virtual void SetLightFieldConnection(vtkAlgorithmOutput* output);
  virtual void SetLightFieldData(vtkImageData* image);
  ///@}

  /** The field last shown, or nullptr. */
  vtkImageData* GetLightFieldData();

  ///@{
  /** How the light is shown; never nullptr: setting nullptr makes a default one. */
  virtual void SetLightFieldProperty(vtkLightFieldProperty* property);
  vtkLightFieldProperty* GetLightFieldProperty();
  ///@}

  ///@{
  /**
   * How the volume is lit, shadows included; nullptr (default): as VTK shades it.
   * Several mappers may share one.
   * Setting it does not count as a modification of the mapper.
   */
  virtual void SetLightingProperty(vtkVolumeLightingProperty* property);
  vtkVolumeLightingProperty* GetLightingProperty();
  ///@}

  /**
   * A visibility of one's own: an image with the point array "VisibilitySH" of a
   * vtkVisibilityFactorFilter and, for exact shadows, "Extinction" (OutputExtinctionOn),
   * in colours where it is RGBExtinction's. nullptr (default): the mapper computes it from what it
   * draws, masks, cropping and clipping included, whenever that changes.
   */
  virtual void SetVisibilityConnection(vtkAlgorithmOutput* output);

  ///@{
  /**
   * How opacity follows curvature and depth; nullptr (default): it does not. The
   * curvature is that of a field with the point array "MeanCurvature", as
   * vtkVolumeCurvatureFilter makes it of the volume (its own grid, in the volume's
   * data coordinates, updated by the mapper); without one, the turn of the normal
   * along the ray.
   */
  virtual void SetCurvatureProperty(vtkVolumeCurvatureProperty* property);
  vtkVolumeCurvatureProperty* GetCurvatureProperty();
  virtual void SetCurvatureFieldConnection(vtkAlgorithmOutput* output);
  ///@}

  ///@{
  /**
   * Fields of at most this many bytes as 32-bit floats are kept so on the GPU,
   * others in 16-bit floats, which hold nine decades below the maximum at 3 digits
   * and draw faster. Default: 0, all in 16 bits. Holds from the next upload on.
   */
  vtkSetMacro(FloatFieldLimit, vtkTypeInt64);
  vtkGetMacro(FloatFieldLimit, vtkTypeInt64);
  ///@}

  /** As in the superclass; remembered to know how large a texture is needed. */
  void SetPartitions(unsigned short x, unsigned short y, unsigned short z);

  /** Largest magnitude of the field last uploaded; 0 without one. */
  double GetLightFieldMaximum();

  ///@{
  /** What has been done so far, for tests and for profiling. */
  vtkGetMacro(NumberOfLightFieldUploads, int);
  vtkGetMacro(NumberOfColorMapUploads, int);
  vtkGetMacro(NumberOfShaderBuilds, int);
  int GetNumberOfVisibilityUploads();
  int GetNumberOfVisibilityComputations();
  ///@}

  void ReleaseGraphicsResources(vtkWindow* window) override;

protected:
  vtkLightTransportVolumeMapper();
  ~vtkLightTransportVolumeMapper() override;

  void GPURender(vtkRenderer* renderer, vtkVolume* volume) override;

  vtkTypeInt64 FloatFieldLimit = 0;
  int NumberOfLightFieldUploads = 0;
  int NumberOfColorMapUploads = 0;
  int NumberOfShaderBuilds = 0;

private:
  class vtkInternals;
  class vtkShaderPass;
  friend class vtkShaderPass;
  std::unique_ptr<vtkInternals> Internals;

  bool VolumeFits(vtkRenderer* renderer);
  bool IsInBlocks();
  bool CanBeLit(vtkRenderer* renderer, vtkVolume* volume);
  bool PrepareField(vtkRenderer* renderer);
  void ReportOnce(const std::string& problem);
  /** As the superclass, opacity following curvature where it is to. */
  void RenderWithCurvature(vtkRenderer* renderer, vtkVolume* volume);

  vtkLightTransportVolumeMapper(const vtkLightTransportVolumeMapper&) = delete;
  void operator=(const vtkLightTransportVolumeMapper&) = delete;
};

#endif
