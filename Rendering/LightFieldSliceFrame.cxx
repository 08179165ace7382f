// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "LightFieldSliceFrame.h"

#include "vtkImageData.h"
#include "vtkMatrix3x3.h"

#include <algorithm>
#include <cmath>

namespace lighttransport
{
namespace
{
// Patient axes, as in RAS.
constexpr int Right = 0;
constexpr int Anterior = 1;
constexpr int Superior = 2;
constexpr char Letters[3][2] = { { 'L', 'R' }, { 'P', 'A' }, { 'I', 'S' } };

/** The volume axis that each patient axis is closest to (as a whole), and its sign there. */
struct PatientAxes
{
  std::array<int, 3> axis;
  std::array<bool, 3> positive;
};

PatientAxes AssignAxes(vtkMatrix3x3* direction, bool worldIsLPS)
{
  const double worldToRAS[3] = { worldIsLPS ? -1. : 1., worldIsLPS ? -1. : 1., 1. };
  std::array<int, 3> order = { 0, 1, 2 };
  std::array<int, 3> best = order;
  double largest = -1.;
  do
  {
    double sum = 0.;
    for (int patient = 0; patient < 3; ++patient)
    {
      sum += std::abs(direction->GetElement(patient, order[patient]));
    }
    if (sum > largest + 1e-9) // of equals, the first: a tie must not depend on rounding
    {
      largest = sum;
      best = order;
    }
  } while (std::next_permutation(order.begin(), order.end()));
  PatientAxes axes;
  axes.axis = best;
  for (int patient = 0; patient < 3; ++patient)
  {
    axes.positive[patient] =
      direction->GetElement(patient, best[patient]) * worldToRAS[patient] > 0.;
  }
  return axes;
}

Vector3 Cross(const Vector3& a, const Vector3& b)
{
  return { a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0] };
}
} // namespace

//------------------------------------------------------------------------------
SliceFrame OrientSlice(vtkImageData* image, int slice, const SliceConvention& convention)
{
  SliceFrame frame;
  if (!convention.orientationKnown)
  {
    const int axes[3][3] = { { 2, 0, 1 }, { 1, 0, 2 }, { 0, 1, 2 } };
    frame.normalAxis = axes[slice][0];
    frame.axisU = axes[slice][1];
    frame.axisV = axes[slice][2];
    return frame;
  }
  const PatientAxes axes = AssignAxes(image->GetDirectionMatrix(), convention.worldIsLPS);
  // Which patient axis is normal, which points to the right of the screen and
  // with which sign, which one upwards.
  const int normal[3] = { Superior, Anterior, Right };
  const int horizontal[3] = { Right, Right, Anterior };
  const int vertical[3] = { Anterior, Superior, Superior };
  const bool positiveIsRight = slice != 2 && convention.neurological;
  const int h = horizontal[slice];
  const int v = vertical[slice];
  frame.normalAxis = axes.axis[normal[slice]];
  frame.axisU = axes.axis[h];
  frame.axisV = axes.axis[v];
  frame.flipU = axes.positive[h] != positiveIsRight;
  frame.flipV = !axes.positive[v];
  frame.marks = { Letters[h][positiveIsRight ? 0 : 1], Letters[h][positiveIsRight ? 1 : 0],
    Letters[v][0], Letters[v][1] };
  const int n = normal[slice];
  frame.normalMarks = { Letters[n][axes.positive[n] ? 0 : 1],
    Letters[n][axes.positive[n] ? 1 : 0] };
  return frame;
}

//------------------------------------------------------------------------------
void PlaceSlice(SliceFrame& frame, vtkImageData* image, const double voxel[3])
{
  const int* extent = image->GetExtent();
  const double* spacing = image->GetSpacing();
  frame.index = static_cast<int>(std::lround(voxel[frame.normalAxis]));
  const int axes[2] = { frame.axisU, frame.axisV };
  const bool flips[2] = { frame.flipU, frame.flipV };
  double corner[3];
  corner[frame.normalAxis] = frame.index;
  double ends[2];
  for (int side = 0; side < 2; ++side)
  {
    const int axis = axes[side];
    const double low = extent[2 * axis] - 0.5;
    const double high = extent[2 * axis + 1] + 0.5;
    frame.size[side] = extent[2 * axis + 1] - extent[2 * axis] + 1;
    frame.length[side] = frame.size[side] * std::abs(spacing[axis]);
    corner[axis] = flips[side] ? high : low;
    ends[side] = flips[side] ? low : high;
  }
  frame.origin = IndexToWorld(image, corner);
  double right[3] = { corner[0], corner[1], corner[2] };
  double up[3] = { corner[0], corner[1], corner[2] };
  right[frame.axisU] = ends[0];
  up[frame.axisV] = ends[1];
  const Vector3 rightWorld = IndexToWorld(image, right);
  const Vector3 upWorld = IndexToWorld(image, up);
  for (int c = 0; c < 3; ++c)
  {
    frame.alongS[c] = rightWorld[c] - frame.origin[c];
    frame.alongT[c] = upWorld[c] - frame.origin[c];
  }
  const double lengthS = std::sqrt(Dot(frame.alongS, frame.alongS));
  const double lengthT = std::sqrt(Dot(frame.alongT, frame.alongT));
  for (int c = 0; c < 3; ++c)
  {
    frame.right[c] = frame.alongS[c] / lengthS;
    frame.up[c] = frame.alongT[c] / lengthT;
  }
  frame.toViewer = Cross(frame.right, frame.up);
}

//------------------------------------------------------------------------------
void NearestVoxel(vtkImageData* image, const double world[3], double voxel[3])
{
  image->TransformPhysicalPointToContinuousIndex(world, voxel);
  const int* extent = image->GetExtent();
  for (int axis = 0; axis < 3; ++axis)
  {
    const double low = extent[2 * axis];
    const double high = extent[2 * axis + 1];
    // Halves go down, whatever the rounding of the transform made of them.
    const double nearest = std::ceil(voxel[axis] - 0.5 - 1e-9);
    voxel[axis] = std::min(high, std::max(low, nearest));
  }
}

//------------------------------------------------------------------------------
Vector3 IndexToWorld(vtkImageData* image, const double index[3])
{
  Vector3 world;
  image->TransformContinuousIndexToPhysicalPoint(index[0], index[1], index[2], world.data());
  return world;
}
} // namespace lighttransport
