// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** The lighting of vtkLightTransportVolumeMapper: lights, visibility, environment. Private. */
#ifndef VolumeLighting_h
#define VolumeLighting_h

#include "vtkImageData.h" // for smart pointers
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkSmartPointer.h"
#include "vtkTextureObject.h"
#include "vtkVolumeLightingProperty.h"

#include <array>
#include <string>
#include <vector>

class vtkAlgorithm;
class vtkAlgorithmOutput;
class vtkDataArray;
class vtkGPUVolumeRayCastMapper;
class vtkLight;
class vtkOpenGLRenderWindow;
class vtkRenderer;
class vtkShaderProgram;
class vtkTexture;
class vtkVisibilityFactorFilter;
class vtkVolume;

/**
 * A frame: Prepare() brings the visibility up to date and to the GPU, Defines() says for which
 * shader, SetUniforms() gives it its numbers, Deactivate() ends.
 */
class VolumeLighting
{
public:
  VolumeLighting();
  ~VolumeLighting();

  vtkSmartPointer<vtkVolumeLightingProperty> Property; // nullptr: VTK's own shading

  /** An image with VisibilitySH, and maybe Extinction, in place of what is computed here. */
  void SetVisibilityConnection(vtkAlgorithmOutput* output);

  /**
   * False if the picture is VTK's own. `skips`: transparent samples may be passed over;
   * `partitioned`: the volume is drawn in blocks. A problem that leaves the volume without shadows
   * is told in `problem`.
   */
  bool Prepare(vtkGPUVolumeRayCastMapper* mapper, vtkRenderer* renderer, vtkVolume* volume,
    bool hasField, bool skips, bool partitioned, std::string& problem);

  /** The preprocessor's symbols; another text is another shader. */
  const std::string& Defines() const { return this->DefinesOfFrame; }
  void SetUniforms(vtkShaderProgram* program);
  void Deactivate();
  void Release(vtkWindow* window);

  int NumberOfUploads = 0;
  int NumberOfComputations = 0; // of the harmonics

  /** The visibility last used, or nullptr. */
  vtkImageData* GetVisibility() const { return this->Visibility; }

private:
  struct Light
  {
    bool scene = false;
    bool positional = false;
    double place[3] = { 0., 0., 1. }; // world: position, or direction towards it
    double diffuse[3] = { 1., 1., 1. };
    double specular[3] = { 1., 1., 1. };
    double cone = -2.; // cosine
    double exponent = 1.;
    double axis[3] = { 0., 0., -1. };
    double attenuation[3] = { 1., 0., 0. };
  };
  /** A direction of the environment's texture with its solid angle and linear colour. */
  struct Radiance
  {
    double direction[3];
    double solidAngle;
    double rgb[3];
  };

  void CollectLights(vtkRenderer* renderer);
  std::string UpdateVisibility(vtkGPUVolumeRayCastMapper* mapper, vtkVolume* volume,
    int exactLights, bool harmonics, bool occlusion);
  std::string UpdateConnection(vtkVolume* volume, int exactLights);
  void SetFilterLights(vtkVolume* volume, int exactLights);
  bool UploadHarmonics(vtkOpenGLRenderWindow* window);
  bool UploadExact(vtkOpenGLRenderWindow* window, int exactLights, bool occlusion);
  void UploadLights(vtkOpenGLRenderWindow* window);
  void ReadEnvironment(vtkRenderer* renderer);
  void ProjectEnvironment(vtkRenderer* renderer, int values);
  double AutomaticThreshold(vtkGPUVolumeRayCastMapper* mapper, vtkVolume* volume, int component);

  std::vector<Light> Lights; // the exact ones first
  int ExactLights = 0;
  int Capacity = 0;
  bool LightsInTexture = false;

  // CPU
  vtkNew<vtkImageData> Extinction;
  vtkSmartPointer<vtkVisibilityFactorFilter> Filter;
  std::vector<double> ExtinctionKey;
  std::string ExtinctionProblem;
  std::vector<std::array<double, 4>> FilterLights;
  vtkSmartPointer<vtkAlgorithm> Producer;
  int Port = 0;
  vtkSmartPointer<vtkImageData> Visibility; // with VisibilitySH
  vtkSmartPointer<vtkImageData> Exact;      // with Visibility; the same grid
  int Order = 0;

  // GPU
  static constexpr int MaxTextures = 7;
  vtkNew<vtkTextureObject> HarmonicsTextures[MaxTextures];
  vtkNew<vtkTextureObject> ExactTexture;
  vtkNew<vtkTextureObject> LightTexture;
  vtkOpenGLRenderWindow* Window = nullptr; // compared, never used
  vtkSmartPointer<vtkDataArray> UploadedHarmonics;
  vtkMTimeType UploadedHarmonicsTime = 0;
  vtkSmartPointer<vtkDataArray> UploadedExact;
  vtkMTimeType UploadedExactTime = 0;
  vtkSmartPointer<vtkDataArray> UploadedOcclusion;
  vtkMTimeType UploadedOcclusionTime = 0;
  std::vector<float> UploadedLights;
  int TexturesUsed = 0;
  bool ExactUsed = false;
  std::vector<double> Scale; // stored value -> coefficient, per component
  std::vector<double> Shift;

  // the frame's
  std::string DefinesOfFrame;
  vtkNew<vtkMatrix4x4> DatasetToVC;
  vtkNew<vtkMatrix4x4> WorldToData;
  float SurfaceOffset[2] = { 0.F, 0.F }; // world, data
  float Thresholds[4] = { 1.F, 1.F, 1.F, 1.F };
  std::vector<Radiance> Environment;
  vtkTexture* EnvironmentSource = nullptr; // compared, never used
  vtkMTimeType EnvironmentTime = 0;
  std::vector<float> EnvironmentUniform;
  float EnvironmentMost[3] = { 0.F, 0.F, 0.F };
};

#endif
