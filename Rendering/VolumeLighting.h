// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** The lighting of vtkLightTransportVolumeMapper: lights, visibility, environment. Private. */
#ifndef VolumeLighting_h
#define VolumeLighting_h

#include "VolumeVisibility.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkSmartPointer.h"
#include "vtkTextureObject.h"
#include "vtkVolumeLightingProperty.h"

#include <string>
#include <vector>

class vtkAlgorithmOutput;
class vtkGPUVolumeRayCastMapper;
class vtkLight;
class vtkOpenGLRenderWindow;
class vtkRenderer;
class vtkShaderProgram;
class vtkTexture;
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

  int NumberOfUploads() const { return this->Visibility.Uploads; }
  int NumberOfComputations() const { return this->Visibility.Computations; } // of the harmonics

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
  void UploadLights(vtkOpenGLRenderWindow* window);
  void ReadEnvironment(vtkRenderer* renderer);
  void ProjectEnvironment(vtkRenderer* renderer, int values);
  double AutomaticThreshold(vtkGPUVolumeRayCastMapper* mapper, vtkVolume* volume, int component);

  VolumeVisibility Visibility{ false };
  std::vector<Light> Lights; // the exact ones first
  int ExactLights = 0;
  int Capacity = 0;
  bool LightsInTexture = false;
  vtkNew<vtkTextureObject> LightTexture;
  vtkOpenGLRenderWindow* Window = nullptr; // compared, never used
  std::vector<float> UploadedLights;

  // the frame's
  std::string DefinesOfFrame;
  vtkNew<vtkMatrix4x4> WorldToData;
  vtkNew<vtkMatrix4x4> WorldToSteps; // of the visibility's grid
  float Thresholds[4] = { 1.F, 1.F, 1.F, 1.F };
  std::vector<Radiance> Environment;
  vtkTexture* EnvironmentSource = nullptr; // compared, never used
  vtkMTimeType EnvironmentTime = 0;
  std::vector<float> EnvironmentUniform;
  float EnvironmentMost[3] = { 0.F, 0.F, 0.F };
};

#endif
