// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Private to vtkBucketedKBufferPass: the buffers, textures and programs of a k-buffer
 * in one window, and the stages that touch nothing but these.
 */
#ifndef KBuffer_h
#define KBuffer_h

#include "KBufferResources.h"

#include "vtkNew.h"
#include "vtkSmartPointer.h"
#include "vtkWeakPointer.h"

#include <array>
#include <chrono>
#include <memory>
#include <string>
#include <utility>
#include <vector>

class vtkCurvatureOpacityProperty;
class vtkMatrix4x4;
class vtkOpenGLFramebufferObject;
class vtkOpenGLQuadHelper;
class vtkOpenGLRenderWindow;
class vtkProp;
class vtkRenderer;
class vtkTextureObject;
class vtkWindow;

namespace lighttransport
{
class KBuffer
{
public:
  enum Counters
  {
    FragmentsListed = 1,
    FragmentsMerged = 2,
    FirstNodeCounter = 16, // see vtkBucketedKBufferStore.glsl
    NodeCounters = 8,
    NodesInTurn = 64,
    NumberOfCounters = 16 * (1 + NodeCounters)
  };

  /** What a frame is drawn with; set before the stages. */
  struct Settings
  {
    int size[2] = { 0, 0 };   // of the viewport, in pixels
    int origin[2] = { 0, 0 }; // in the window
    int layers = 16;
    bool style = false;
    bool lines = false;
    bool shade = false; // whether any style does
    bool shadeColors = false;
    bool opacity = false;
    bool radiance = false;
    bool floatColor = false;
    bool writeDepth = false; // of opaque layers
    bool singleBucket = false;
    PictureTarget into;
    int smoothing = 0; // of the curvature, for lines
    double curvatureScale = 1.;
  };

  KBuffer();
  ~KBuffer();
  KBuffer(const KBuffer&) = delete;
  KBuffer& operator=(const KBuffer&) = delete;

  Settings Now;
  std::vector<vtkSmartPointer<vtkCurvatureOpacityProperty>> Styles; // 0: the pass's
  vtkWeakPointer<vtkOpenGLRenderWindow> Window;

  void Release(vtkWindow* window);

  /** Why this window cannot be drawn to; empty if it can. */
  std::string WhyNot();

  /** Most nodes that fit into a buffer and into so many bytes. */
  vtkTypeInt64 MostNodes(vtkTypeInt64 memoryLimit) const;
  void ReserveNodes(vtkTypeInt64 nodes);
  void ReleaseNodes();
  vtkTypeInt64 Capacity = 0;   // nodes
  vtkTypeInt64 Fragments = 0;  // of the band
  vtkTypeInt64 NodesAsked = 0; // room for all of them: some more

  int BitsPerFragment() const;
  vtkTypeInt64 Bytes();

  /** The lines that the shaders share. */
  std::string Defines(int room) const;

  // Stages; see vtkBucketedKBufferPass.h.
  void CopyTarget(); // 1: depth and colour of what is bound
  void SetCamera(vtkRenderer* renderer, vtkProp** props, int count);
  /** Notes the time since the last mark as a stage's; waits for OpenGL first. */
  void Mark(int stage);
  bool Measure = false;
  std::array<double, 6> Milliseconds{}; // by stage

  double SceneLength = 1.;                      // diagonal of what is translucent
  void BeginGeometry(int low, int high);        // 2: clears, binds
  void ResetMasks();                            // that nothing but the lists is written
  void BeginVolume();                           // what is there already can be read
  void EndGeometry();                           // then Fragments and NodesAsked are known
  std::string OrderAndMatch(int low, int high); // 3, 4
  bool Blend(int first, int last);              // 5
  void Unbind();
  TexelBuffer Counter;

  vtkSmartPointer<vtkTextureObject> OpaqueDepth;
  vtkNew<vtkMatrix4x4> DCToVC; // transposed

private:
  TexelBuffer Heads;
  TexelBuffer Links; // then the neighbours
  TexelBuffer Colors;
  TexelBuffer Surfaces;
  // with stylisation
  TexelBuffer Pixels;
  TexelBuffer Records;
  TexelBuffer NodeList;
  TexelBuffer Buckets;
  TexelBuffer Tensors;
  TexelBuffer SmoothTensors;
  TexelBuffer* LatestTensors = nullptr;
  TexelBuffer ShadingTable; // see vtkBucketedKBufferStyle.glsl
  TexelBuffer OpacityTable;
  TexelBuffer ParameterTable;
  ComputeProgram Order[2]; // for short lists, for long ones
  ComputeProgram Match;
  ComputeProgram Tensor;
  ComputeProgram Smooth;
  int OpaqueDepthFormat = -1;
  vtkSmartPointer<vtkOpenGLFramebufferObject> DepthTarget;
  vtkSmartPointer<vtkTextureObject> TargetColor;
  vtkSmartPointer<vtkOpenGLFramebufferObject> GeometryTarget;
  std::unique_ptr<vtkOpenGLQuadHelper> Quads[2]; // likewise
  std::string QuadKeys[2];
  std::vector<std::pair<vtkCurvatureOpacityProperty*, vtkMTimeType>> Tables; // what is in them
  std::vector<int> Units;                                                    // texture units in use
  vtkTypeInt64 MostTexels = 0; // GL_MAX_TEXTURE_BUFFER_SIZE

  // the camera, see vtkBucketedKBufferPixel.glsl
  int Parallel = 0;
  std::array<float, 4> PixelToVC{};
  std::array<float, 2> DepthToVC{};
  std::array<float, 2> DepthRange{};
  std::array<int, 2> Rows{}; // of the band
  float Footprint = 1.F;

  std::chrono::steady_clock::time_point LastMark;

  std::vector<TexelBuffer*> All();
  int Room() const;
  int Dense() const;
  GLenum ColorFormat() const;
  void CopyDepth();
  void CopyColor();
  void FillTables();
  void BindForReading(const Uniforms& uniforms);
  void FreeUnits();
  void SetGeometry(const Uniforms& uniforms) const;
};
} // namespace lighttransport

#endif
