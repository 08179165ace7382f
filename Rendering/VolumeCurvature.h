// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** The curvature of vtkLightTransportVolumeMapper: its opacity's modulation. Private. */
#ifndef VolumeCurvature_h
#define VolumeCurvature_h

#include "vtkImageData.h" // for smart pointers
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkSmartPointer.h"
#include "vtkTextureObject.h"
#include "vtkVolumeCurvatureProperty.h"

#include <string>

class vtkAlgorithm;
class vtkAlgorithmOutput;
class vtkDataArray;
class vtkGPUVolumeRayCastMapper;
class vtkOpenGLRenderWindow;
class vtkRenderer;
class vtkShaderProgram;
class vtkVolume;
class vtkWindow;

/**
 * A frame: Begin() brings field and table up to date and to the GPU and hangs a render pass on
 * the volume, behind those that are there, so that its shader parts are the innermost around a
 * sample; End() takes it off.
 */
class VolumeCurvature
{
public:
  VolumeCurvature();
  ~VolumeCurvature();

  vtkSmartPointer<vtkVolumeCurvatureProperty> Property; // nullptr: no modulation

  /** An image with MeanCurvature; nullptr: the turn of the normal along the ray. */
  void SetFieldConnection(vtkAlgorithmOutput* output);

  /**
   * True if there is a modulation in this frame, which End() has to finish. What is wrong with
   * the field or the function is told in `problem`, each time.
   */
  bool Begin(vtkGPUVolumeRayCastMapper* mapper, vtkRenderer* renderer, vtkVolume* volume,
    std::string& problem);
  void End(vtkVolume* volume);

  /** The shader's tag that was missing when it was last built, or nothing. */
  const std::string& FailedTag() const;
  void Release(vtkWindow* window);

private:
  class Pass;

  std::string PrepareField(vtkOpenGLRenderWindow* window);
  void UploadTable(vtkOpenGLRenderWindow* window);
  void ComputeDepth(vtkGPUVolumeRayCastMapper* mapper, vtkRenderer* renderer, vtkVolume* volume);
  void SetUniforms(vtkShaderProgram* program);

  vtkSmartPointer<vtkAlgorithm> Producer;
  int Port = 0;
  vtkSmartPointer<vtkImageData> Field;

  vtkSmartPointer<Pass> ShaderPass;
  vtkNew<vtkTextureObject> FieldTexture;
  vtkNew<vtkTextureObject> TableTexture;
  vtkOpenGLRenderWindow* Window = nullptr; // of the textures; compared, never used
  vtkSmartPointer<vtkDataArray> UploadedArray;
  vtkMTimeType UploadedArrayTime = 0;
  std::string UploadProblem;
  vtkMTimeType UploadedTableTime = 0;
  double Largest = 1.;     // of the field's |mean curvature|, which is 1 on the GPU
  double FieldsScale = 0.; // s chosen from the field

  // this frame's
  std::string Head;
  bool HasField = false;
  float Scale = 0.F;
  float Depth[4] = { 0.F, 0.F, 0.F, 0.F };
  vtkNew<vtkMatrix4x4> DatasetToFC;
};

#endif
