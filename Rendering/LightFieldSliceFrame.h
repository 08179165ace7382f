// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Which axes of a volume a slice shows, which way round, and where the slice
 * lies in the world. Private to vtkLightFieldSlices; pure functions.
 */
#ifndef LightFieldSliceFrame_h
#define LightFieldSliceFrame_h

#include <array>
#include <string>

class vtkImageData;

namespace lighttransport
{
using Vector3 = std::array<double, 3>;

/** What the world's axes are in the patient, and which way slices are shown. */
struct SliceConvention
{
  bool orientationKnown = false;
  bool worldIsLPS = false; // else RAS
  bool neurological = false;
};

/**
 * One slice. In its plane (s, t) in [0,1]^2 run from the left lower to the right
 * upper corner of what is on screen, borders of the outermost voxels included.
 */
struct SliceFrame
{
  int normalAxis = 2;            // of the volume: 0 = i, 1 = j, 2 = k
  int axisU = 0;                 // the one that is horizontal on screen
  int axisV = 1;                 // vertical
  bool flipU = false;            // whether its index grows to the left
  bool flipV = false;            // downwards
  std::string marks;             // letters at left, right, bottom, top; empty if unknown
  std::string normalMarks;       // letters at the lower and the upper end of the normal axis' index
  int size[2] = { 1, 1 };        // voxels along U and V
  double length[2] = { 1., 1. }; // world lengths along U and V
  int index = 0;                 // of the slice along the normal axis
  Vector3 origin = {};           // world point of s = t = 0
  Vector3 alongS = {};           // world vector from s = 0 to s = 1
  Vector3 alongT = {};
  Vector3 right = {}; // unit vectors
  Vector3 up = {};
  Vector3 toViewer = {};

  Vector3 At(double s, double t) const
  {
    Vector3 world;
    for (int c = 0; c < 3; ++c)
    {
      world[c] = this->origin[c] + s * this->alongS[c] + t * this->alongT[c];
    }
    return world;
  }
};

/** Axes, flips and letters of slice number 0 (axial), 1 (coronal) or 2 (sagittal). */
SliceFrame OrientSlice(vtkImageData* image, int slice, const SliceConvention& convention);

/** Puts an oriented slice through the voxel nearest to the world point. */
void PlaceSlice(SliceFrame& frame, vtkImageData* image, const double voxel[3]);

/** The voxel nearest to a world point, clamped into the image's extent. */
void NearestVoxel(vtkImageData* image, const double world[3], double voxel[3]);

/** World position of a continuous index. */
Vector3 IndexToWorld(vtkImageData* image, const double index[3]);

inline double Dot(const Vector3& a, const Vector3& b)
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
} // namespace lighttransport

#endif
