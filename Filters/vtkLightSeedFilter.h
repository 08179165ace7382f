// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkLightSeedFilter
 * @brief   light sources on the grid of an image: spheres, paint, strokes
 *
 * Adds to the image of port 0, which gives the grid, the float32 point array
 *
 *   Source  q, emitted power density of either sign   [power/length^3]
 *
 * "length" is the unit of the image's spacing, "power" any unit: fluence comes
 * out in power/length^2. Positive sources light, negative ones darken ("dam").
 * q is the sum of:
 *
 * 1. Spheres (AddSphere): a centre in world coordinates, a radius and a power,
 *    spread evenly over the sphere. A voxel at the sphere's surface takes part
 *    by the fraction of it that lies inside (to first order, from the distance
 *    of its centre), so that light moves smoothly as a seed does. A radius below
 *    half the smallest spacing lights one voxel, the one whose centre is nearest.
 *    The power is kept: sum(q) * voxel volume = power, to float rounding,
 *    whatever the radius. **Also where the sphere leaves the volume**: the voxels
 *    inside then carry the whole power. A sphere wholly outside is an error.
 * 2. The painted image (port 1, optional): weights of either sign, times
 *    PaintedGain. On another grid it is averaged over each voxel of port 0 (linear
 *    interpolation; 0 outside its own domain).
 * 3. Strokes (port 2, optional): the lines (and vertices) of a vtkPolyData, tubes
 *    of light. The point or cell arrays "Radius" and "Power" give a stroke's
 *    radius (interpolated along it) and power, spread evenly along its length;
 *    a Power array of the points that varies along a stroke makes the power per
 *    length vary in proportion, and the stroke's power is then its mean along
 *    the length. The part inside the volume carries the whole power; a stroke
 *    wholly outside is an error.
 * 4. Re-injection (port 3, optional): where an earlier Fluence exceeds
 *    ReinjectionThreshold, q grows by ReinjectionGain times that fluence. Another
 *    grid is resampled as in 2.
 *
 * Persistent painting: give a copy of an earlier output back as the painted
 * image; its Source array is taken as the weights (see PaintedArrayName).
 *
 * At least one source is needed: a sphere, a stroke, a painted image or an
 * earlier fluence. Port 0's arrays pass through (the same objects), the extent
 * and the direction matrix are kept, and every image is asked for as a whole.
 * Changing a source does not make the filters upstream run again.
 *
 * Bad input gives one error (what, value, expected) and an empty output: NaN or
 * infinity in any source, a density that float32 cannot hold, a source outside.
 *
 * Negative, painted and re-injected sources are those of D. Murray, Legible
 * Visualization of Semi-Transparent Objects using Light Transport, thesis,
 * Bordeaux 2018, section 4.2.5.
 *
 * @sa vtkOpticalMediumFilter vtkLightDiffusionFilter
 */
#ifndef vtkLightSeedFilter_h
#define vtkLightSeedFilter_h

#include "vtkImageAlgorithm.h"
#include "vtkLightTransportFiltersModule.h" // for the export macro

#include <array>  // for the spheres
#include <string> // for messages
#include <vector> // for the spheres

class vtkPolyData;

class VTKLIGHTTRANSPORTFILTERS_EXPORT vtkLightSeedFilter : public vtkImageAlgorithm
{
public:
  static vtkLightSeedFilter* New();
  vtkTypeMacro(vtkLightSeedFilter, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * Add a sphere of light: centre in world coordinates, radius >= 0 in length,
   * power of either sign. Returns its index.
   */
  int AddSphere(const double center[3], double radius, double power) VTK_SIZEHINT(center, 3)
  {
    return this->AddSphere(center[0], center[1], center[2], radius, power);
  }
  int AddSphere(double x, double y, double z, double radius, double power);
  ///@}

  ///@{
  /** Change sphere i; an index that does not exist is an error and changes nothing. */
  void SetSphere(int i, const double center[3], double radius, double power) VTK_SIZEHINT(center, 3)
  {
    this->SetSphere(i, center[0], center[1], center[2], radius, power);
  }
  void SetSphere(int i, double x, double y, double z, double radius, double power);
  ///@}

  ///@{
  /** Remove one sphere (those behind it move up) or all. */
  void RemoveSphere(int i);
  void RemoveAllSpheres();
  ///@}

  ///@{
  /** The spheres as they were given; NaN where the index does not exist. */
  int GetNumberOfSpheres() const { return static_cast<int>(this->Spheres.size()); }
  void GetSphereCenter(int i, double center[3]) const VTK_SIZEHINT(center, 3);
  double GetSphereRadius(int i) const;
  double GetSpherePower(int i) const;
  ///@}

  ///@{
  /** Painted image, port 1, optional. */
  void SetPaintedImageConnection(vtkAlgorithmOutput* output)
  {
    this->SetInputConnection(1, output);
  }
  void SetPaintedImageData(vtkImageData* image);
  vtkImageData* GetPaintedImage();
  ///@}

  ///@{
  /** Painted strokes, port 2, optional. */
  void SetStrokesConnection(vtkAlgorithmOutput* output) { this->SetInputConnection(2, output); }
  void SetStrokesData(vtkPolyData* strokes);
  vtkPolyData* GetStrokes();
  ///@}

  ///@{
  /** Image with an earlier Fluence array, port 3, optional. */
  void SetFluenceConnection(vtkAlgorithmOutput* output) { this->SetInputConnection(3, output); }
  void SetFluenceData(vtkImageData* image);
  vtkImageData* GetFluence();
  ///@}

  ///@{
  /**
   * q per unit of painted weight, in power/length^3 (a weight of an earlier
   * Source has that unit already: gain 1). Finite, either sign; default 1.
   */
  vtkSetMacro(PaintedGain, double);
  vtkGetMacro(PaintedGain, double);
  ///@}

  ///@{
  /**
   * Point array of the painted image that holds the weights (its first
   * component). Default empty: "Source" if it has one, else its active scalars.
   */
  vtkSetStringMacro(PaintedArrayName);
  vtkGetStringMacro(PaintedArrayName);
  ///@}

  ///@{
  /** Arrays of the strokes, on points or cells; defaults "Radius" and "Power". */
  vtkSetStringMacro(RadiusArrayName);
  vtkGetStringMacro(RadiusArrayName);
  vtkSetStringMacro(PowerArrayName);
  vtkGetStringMacro(PowerArrayName);
  ///@}

  ///@{
  /**
   * Radius and power of strokes that have no such array: >= 0, default 0 (one
   * voxel wide); and either sign, default 1.
   */
  vtkSetMacro(DefaultStrokeRadius, double);
  vtkGetMacro(DefaultStrokeRadius, double);
  vtkSetMacro(DefaultStrokePower, double);
  vtkGetMacro(DefaultStrokePower, double);
  ///@}

  ///@{
  /**
   * Fluence above this value is re-injected, in power/length^2; finite, default
   * 0: all that is positive.
   */
  vtkSetMacro(ReinjectionThreshold, double);
  vtkGetMacro(ReinjectionThreshold, double);
  ///@}

  ///@{
  /**
   * q per re-injected fluence, in 1/length; finite, default 1. A gain near or
   * above the absorption makes repeated re-injection grow without bound.
   */
  vtkSetMacro(ReinjectionGain, double);
  vtkGetMacro(ReinjectionGain, double);
  ///@}

  /** Sum of q times voxel volume of the last update, in power. */
  vtkGetMacro(TotalPower, double);

protected:
  vtkLightSeedFilter();
  ~vtkLightSeedFilter() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;
  int RequestUpdateExtent(
    vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*) override;
  int RequestData(
    vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs) override;

  struct Sphere
  {
    std::array<double, 3> Center;
    double Radius;
    double Power;
  };
  std::vector<Sphere> Spheres;
  double PaintedGain = 1.;
  char* PaintedArrayName = nullptr;
  char* RadiusArrayName = nullptr;
  char* PowerArrayName = nullptr;
  double DefaultStrokeRadius = 0.;
  double DefaultStrokePower = 1.;
  double ReinjectionThreshold = 0.;
  double ReinjectionGain = 1.;
  double TotalPower = 0.;

private:
  /** What is wrong, or nothing. */
  std::string FindParameterProblem() const;
  std::string Compute(vtkImageData* input, vtkImageData* painted, vtkPolyData* strokes,
    vtkImageData* fluence, vtkImageData* output);

  vtkLightSeedFilter(const vtkLightSeedFilter&) = delete;
  void operator=(const vtkLightSeedFilter&) = delete;
};

#endif
