// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** The visibility that mappers light with: kept up to date, on the CPU and on the GPU. Private. */
#ifndef VolumeVisibility_h
#define VolumeVisibility_h

#include "vtkDataArray.h" // for smart pointers
#include "vtkImageData.h"
#include "vtkMatrix4x4.h"
#include "vtkNew.h"
#include "vtkSmartPointer.h"
#include "vtkTextureObject.h"
#include "vtkVisibilityFactorFilter.h"

#include <array>
#include <string>
#include <vector>

class vtkAlgorithm;
class vtkGPUVolumeRayCastMapper;
class vtkOpenGLRenderWindow;
class vtkShaderProgram;
class vtkVolume;
class vtkWindow;

/**
 * Of what a volume's mapper draws, or of an image with VisibilitySH, Extinction or both: fields of
 * single lights, each swept again when it moves, and the harmonics or their mean, computed again
 * when the extinction changes. Prepare(), in each frame, brings them to the GPU, each channel of a
 * texture when it changed; glsl/vtkLightTransportVisibility.glsl reads them, Defines() before it.
 */
class VolumeVisibility
{
public:
  /** Lights with fields of their own, four a texture; in colours a texture each. */
  static constexpr int MostLights = 8;
  static constexpr int MostColoredLights = 4;
  static constexpr int MostExactTextures = 4;
  static constexpr int MostTextures = 7; // of harmonics

  /** 16 bits a value on the GPU, or 8. */
  explicit VolumeVisibility(bool wide)
    : Wide(wide)
  {
  }

  struct Needs
  {
    vtkGPUVolumeRayCastMapper* mapper = nullptr; // of what is drawn
    vtkVolume* volume = nullptr;
    int resolution = 128;
    bool colored = false;
    // Of these lights, in the data's coordinates: a place and 1, or the direction towards it and 0.
    std::vector<std::array<double, 4>> lights;
    bool harmonics = false; // of all directions
    int order = 2;
    bool mean = false; // over directions
  };

  /** In place of what is drawn. */
  void SetConnection(vtkAlgorithm* producer, int port);
  bool HasConnection() const { return this->Producer != nullptr; }

  /** What is wrong, or nothing; then there is what is needed. */
  std::string Prepare(vtkOpenGLRenderWindow* window, const Needs& needs);

  /** This many of the lights, the first ones, have fields. The others are in the harmonics. */
  int NumberOfExactLights() const { return this->ExactLights; }
  bool IsColored() const { return this->Colored; }
  /** Textures of harmonics, 0 to 7, and what is in them. */
  int NumberOfHarmonics() const { return this->HarmonicsTextures; }
  int GetOrder() const { return this->Order; }
  /** Coefficient c is scale * stored + shift, before the window. */
  double GetScale(int c) const { return this->Scale[c]; }
  double GetShift(int c) const { return this->Shift[c]; }
  /** The factor of a coefficient's band. */
  double GetWindow(int c) const { return this->Window[this->BandOf(c)]; }
  vtkMatrix4x4* GetDataToGrid() { return this->DataToGrid; } // 0 to 1 over the grid's domain

  const std::string& Defines() const { return this->DefinesOfFrame; }
  void SetUniforms(vtkShaderProgram* program);
  void Deactivate();
  void Release(vtkWindow* window);

  int Uploads = 0;
  int Computations = 0; // of harmonics

private:
  /** What a channel of a texture holds: (x - shift) / scale of the mean of some components. */
  struct Channel
  {
    vtkDataArray* array = nullptr; // beyond a frame compared, never used: times differ always
    vtkMTimeType time = 0;
    int component = 0;
    int count = 1;
    int stride = 1;
    double scale = 1.;
    double shift = 0.;
  };
  struct Texture
  {
    vtkNew<vtkTextureObject> object;
    std::vector<Channel> channels; // on the GPU
    int size[3] = { 0, 0, 0 };
    std::vector<unsigned char> bytes;
  };

  static int BandOf(int component);
  static Channel ChannelOf(vtkDataArray* array, int component, int count = 1, int stride = 1);
  std::string FindImage(const Needs& needs, vtkImageData*& image);
  std::string Compute(
    vtkImageData* image, vtkDataArray* extinction, const Needs& needs, int lights, int order);
  bool Upload(vtkOpenGLRenderWindow* window, Texture& texture, const int n[3],
    std::vector<Channel> channels, bool keep);
  template <typename T>
  static void Pack(const Channel& channel, vtkIdType points, T* to, int stride);

  bool Wide;
  vtkSmartPointer<vtkAlgorithm> Producer;
  int Port = 0;

  // CPU
  std::vector<double> DrawnKey;
  std::string DrawnProblem;
  vtkNew<vtkImageData> Drawn;
  vtkNew<vtkImageData> Medium; // the extinction alone
  vtkSmartPointer<vtkDataArray> MediumArray;
  vtkNew<vtkVisibilityFactorFilter> Filter;
  std::vector<std::array<double, 4>> FilterLights;
  vtkSmartPointer<vtkDataArray> Computed; // the harmonics

  // GPU
  vtkOpenGLRenderWindow* Last = nullptr; // compared, never used
  Texture Exact[MostExactTextures];
  Texture Harmonics[MostTextures];

  // the frame's
  int ExactLights = 0;
  int ExactTextures = 0;
  int HarmonicsTextures = 0;
  bool Colored = false;
  int Order = 0;
  double Scale[4 * MostTextures] = {};
  double Shift[4 * MostTextures] = {};
  double Window[5] = {};
  vtkNew<vtkMatrix4x4> DataToGrid;
  std::string DefinesOfFrame;
};

#endif
