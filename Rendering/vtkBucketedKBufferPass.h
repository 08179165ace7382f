// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBucketedKBufferPass
 * @brief   exact order-independent transparency of many layers
 *
 * Translucent surfaces blended in their right order at every pixel, whatever
 * the order of the actors, in one pass over the geometry. The fragments of a
 * pixel are kept, so that each can be seen together with its neighbours on the
 * same shape: what the bucketed k-buffer of Murray, Baril and Granier, "Shape
 * Depiction for Transparent Objects with Bucketed k-Buffer" (Eurographics
 * Symposium on Rendering, 2016) is for.
 *
 * @code
 *   vtkNew<vtkBucketedKBufferPass> pass;
 *   renderer->SetPass(pass);          // draws all the rest by VTK's own passes
 * @endcode
 *
 * or as the translucent step of another sequence, where it draws nothing else:
 *
 * @code
 *   vtkNew<vtkRenderStepsPass> steps;
 *   steps->SetTranslucentPass(pass);
 *   toneMapping->SetDelegatePass(steps);
 *   renderer->SetPass(toneMapping);
 * @endcode
 *
 * Each frame runs through these stages:
 *
 * 1. the opaque depth is copied, so that fragments behind it are left out;
 * 2. geometry: the translucent props are drawn once by their own mappers, with
 *    all that these can do (textures, vertex colours, edges, physically based
 *    shading, clipping); each fragment becomes a node of its pixel's list. If
 *    the nodes do not fit, the buffers grow and the stage is run again; if they
 *    fit into no buffer (GL_MAX_TEXTURE_BUFFER_SIZE, MemoryLimit), the
 *    viewport is drawn in as many horizontal bands as needed;
 * 3. order (compute): the NumberOfLayers nearest nodes of each pixel are sorted by
 *    depth (Batcher's network), what is behind them is merged into one layer; with
 *    stylisation they are then ordered by shape, and the shapes' buckets are listed;
 * 4. neighbours (compute, with stylisation only): in the four pixels around, the
 *    fragment of the same shape with the least
 *      epsilon = (1 - n . n') + |z - z'|^2,   z in footprints of a pixel
 *    if each is the other's best. Only the shape's bucket is searched, found by going
 *    along the two pixels' lists at once. For lines, the curvature tensors too;
 * 5. blending: curvature from the neighbours and stylisation
 *    (vtkCurvatureOpacityProperty), then front to back "over" (Porter and Duff 1984).
 *
 * A shape is an actor, a block of a composite, or a value of an array
 * (vtkCurvatureOpacityPolyDataMapper, whose own property then counts).
 *
 * The thesis (Murray 2018, section 2.3.2) draws the geometry twice, to keep 16
 * bits of depth and 16 of shape in one atomic word. Lists need one pass, full
 * 32-bit depths and memory only for the fragments that exist.
 *
 * Exactness: the result does not depend on the order of actors or of triangles,
 * to the bit. Fragments of equal depth are ordered by what they show. The merged
 * tail of n fragments has opacity 1 - prod(1 - alpha_i) and colour
 * sum(alpha_i c_i) / sum(alpha_i), in integer sums (colours above 16 count as
 * 16; 65536 fragments at most), and GetNumberOfMergedFragments says how many
 * there were.
 *
 * The picture is blended over the target as premultiplied colour, so that a
 * transparent background stays so. Colours may exceed 1, as highlights do, until the
 * picture clamps their sum.
 *
 * Needs OpenGL 4.3, no fragment interlock. Where that is missing, or the viewport
 * has more pixels than a buffer can hold, it says so once and lets
 * vtkDualDepthPeelingPass draw, with as many layers.
 *
 * Lines and points (cells as well as representations) are layers at their own depth, with
 * their width and opacity, and have no curvature. A point or an edge that several triangles
 * of a wireframe draw counts once; so do thin fragments of one pixel within four units in
 * the last place of their depth.
 *
 * Opaque actors that are to be stylised are drawn as layers of opacity 1, and write their
 * depth: see vtkCurvatureOpacityProperty. Without stylisation VTK draws them, and where a
 * volume is there that cannot be among the surfaces.
 *
 * Other props take part if they give their parts their property keys, as VTK's text and
 * image slices do (vtkImageSlice::ForceTranslucentOn; VTK draws other slices with what is
 * opaque). Those that do not are drawn after the layers, in front of them, by the
 * TranslucentPass. 2-D actors are drawn by VTK.
 *
 * Physically based and image-based shading are the mapper's and work as they are; tone
 * mapping takes the sequence above; ambient occlusion of the opaque surfaces is
 * @code
 *   ssao->SetDelegatePass(opaquePass);
 *   steps->SetOpaquePass(ssao);
 * @endcode
 *
 * Volumes among the surfaces: where the renderer's pass is this one, and both are
 * there, what a ray gathers between two surfaces becomes a fragment of its own, so that
 * each hides what is behind it. For mappers that are vtkOpenGLGPUVolumeRayCastMapper
 * (ours too) with an ImageSampleDistance of 1; with any other, volumes are drawn after
 * the surfaces as VTK does by default. N surfaces in a volume are up to 2 N + 1 layers.
 * Several volumes may lie behind one another; where two overlap, the segments of each are
 * in order, but one is drawn over the other as a whole between two surfaces.
 *
 * Not for: antialiasing (like VTK's own translucent passes it samples once per pixel).
 * Hardware selection is VTK's own.
 *
 * @sa vtkCurvatureOpacityProperty vtkCurvatureOpacityPolyDataMapper vtkDualDepthPeelingPass
 * vtkOrderIndependentTranslucentPass
 */
#ifndef vtkBucketedKBufferPass_h
#define vtkBucketedKBufferPass_h

#include "vtkLightTransportRenderingModule.h" // for the export macro
#include "vtkOpenGLRenderPass.h"

#include <memory> // for the implementation

class vtkCurvatureOpacityProperty;

class VTKLIGHTTRANSPORTRENDERING_EXPORT vtkBucketedKBufferPass : public vtkOpenGLRenderPass
{
public:
  static vtkBucketedKBufferPass* New();
  vtkTypeMacro(vtkBucketedKBufferPass, vtkOpenGLRenderPass);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  /** Not to be called by users. */
  void Render(const vtkRenderState* s) override;
  void ReleaseGraphicsResources(vtkWindow* window) override;

  ///@{
  /**
   * How many fragments of a pixel are blended exactly, from 1 to 64 (clamped);
   * those behind are merged. 16 by default. Memory does not depend on it.
   */
  vtkSetClampMacro(NumberOfLayers, int, 1, 64);
  vtkGetMacro(NumberOfLayers, int);
  ///@}

  /** How a fragment's colour is kept. */
  enum ColorPrecisions
  {
    Half = 0,
    Float = 1
  };

  ///@{
  /**
   * Half (default): 16 bits a channel, RGBA, which 32 layers in an 8-bit picture
   * do not tell from Float, 32 bits a channel.
   */
  vtkSetClampMacro(ColorPrecision, int, Half, Float);
  vtkGetMacro(ColorPrecision, int);
  void SetColorPrecisionToHalf() { this->SetColorPrecision(Half); }
  void SetColorPrecisionToFloat() { this->SetColorPrecision(Float); }
  ///@}

  ///@{
  /**
   * Most bytes of GPU memory for fragments, at least 1 MiB (clamped). Where a
   * frame needs more, it is drawn in bands, each a pass over the geometry.
   * Default: 1 GiB.
   */
  vtkSetClampMacro(MemoryLimit, vtkTypeInt64, 1 << 20, VTK_TYPE_INT64_MAX);
  vtkGetMacro(MemoryLimit, vtkTypeInt64);
  ///@}

  ///@{
  /**
   * How curvature changes colour and opacity, for all mappers but
   * vtkCurvatureOpacityPolyDataMapper, which have their own. Never nullptr: setting
   * nullptr makes a default one, which changes nothing.
   */
  void SetCurvatureOpacityProperty(vtkCurvatureOpacityProperty* property);
  vtkCurvatureOpacityProperty* GetCurvatureOpacityProperty();
  ///@}

  ///@{
  /**
   * The length s of kappa = -tanh(s (k1 + k2)), in the world's unit: a sphere of radius
   * 2 s has kappa = -0.76. Larger values show fainter curvature. 0 (default): from the
   * scene, a fortieth of the diagonal of what is translucent. Clamped to be >= 0.
   */
  vtkSetClampMacro(CurvatureScale, double, 0., VTK_DOUBLE_MAX);
  vtkGetMacro(CurvatureScale, double);
  ///@}

  ///@{
  /**
   * How many times the curvature is averaged with that of the neighbours before lines are
   * made of it, from 0 to 64 (clamped); 8 (default) is a width of about two pixels. More
   * for coarse meshes, whose triangles show otherwise. Nothing else is smoothed.
   */
  vtkSetClampMacro(LineSmoothing, int, 0, 64);
  vtkGetMacro(LineSmoothing, int);
  ///@}

  ///@{
  /**
   * Search for neighbours among all fragments of a pixel, as if they were one shape:
   * the brute force of Carnecky et al. 2013, for comparison. Off by default.
   */
  vtkSetMacro(SingleBucket, bool);
  vtkGetMacro(SingleBucket, bool);
  vtkBooleanMacro(SingleBucket, bool);
  ///@}

  ///@{
  /**
   * Draws the translucent props; a vtkTranslucentPass by default, and for nullptr.
   */
  virtual void SetTranslucentPass(vtkRenderPass* pass);
  vtkRenderPass* GetTranslucentPass();
  ///@}

  ///@{
  /**
   * Of the last frame: fragments kept, those that were merged into tails, bands,
   * passes over the translucent geometry, bytes of all buffers, and bits per
   * fragment.
   */
  vtkGetMacro(NumberOfFragments, vtkTypeInt64);
  vtkTypeInt64 GetNumberOfMergedFragments();
  vtkGetMacro(NumberOfBands, int);
  vtkGetMacro(NumberOfGeometryPasses, int);
  vtkTypeInt64 GetMemoryInBytes();
  int GetBitsPerFragment();
  ///@}

  ///@{
  /**
   * Measure the stages, 1 to 5 as numbered above: slower, since each is waited for. 0
   * for other numbers, and where a frame was not measured. Off by default.
   */
  vtkSetMacro(MeasureStages, bool);
  vtkGetMacro(MeasureStages, bool);
  vtkBooleanMacro(MeasureStages, bool);
  double GetStageMilliseconds(int stage);
  ///@}

  /**
   * Whether the last frame was drawn by vtkDualDepthPeelingPass for want of
   * OpenGL 4.3.
   */
  vtkGetMacro(UsedFallback, bool);

  ///@{
  /** Not to be called by users: what the translucent props' shaders get. */
  bool PreReplaceShaderValues(std::string& vertexShader, std::string& geometryShader,
    std::string& fragmentShader, vtkAbstractMapper* mapper, vtkProp* prop) override;
  bool PostReplaceShaderValues(std::string& vertexShader, std::string& geometryShader,
    std::string& fragmentShader, vtkAbstractMapper* mapper, vtkProp* prop) override;
  bool SetShaderParameters(vtkShaderProgram* program, vtkAbstractMapper* mapper, vtkProp* prop,
    vtkOpenGLVertexArrayObject* VAO = nullptr) override;
  vtkMTimeType GetShaderStageMTime() override;
  ///@}

protected:
  vtkBucketedKBufferPass();
  ~vtkBucketedKBufferPass() override;

  int NumberOfLayers = 16;
  int ColorPrecision = Half;
  vtkTypeInt64 MemoryLimit = vtkTypeInt64(1) << 30;
  vtkTypeInt64 NumberOfFragments = 0;
  double CurvatureScale = 0.;
  int LineSmoothing = 8;
  bool SingleBucket = false;
  bool MeasureStages = false;
  int NumberOfBands = 0;
  int NumberOfGeometryPasses = 0;
  bool UsedFallback = false;

private:
  class vtkInternals;
  class vtkTranslucentStep;
  friend class vtkTranslucentStep;
  std::unique_ptr<vtkInternals> Internals;

  void RenderEverything(const vtkRenderState* s);
  void RenderTranslucent(const vtkRenderState* s);
  void RenderFallback(const vtkRenderState* s, const std::string& reason);
  bool RenderBand(const vtkRenderState* s, int first, int last);

  vtkBucketedKBufferPass(const vtkBucketedKBufferPass&) = delete;
  void operator=(const vtkBucketedKBufferPass&) = delete;
};

#endif
