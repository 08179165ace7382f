// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Volume.h"

#include "vtkDataArray.h"
#include "vtkMath.h"
#include "vtkMatrix4x4.h"
#include "vtkPointData.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

namespace lightvolume
{
namespace
{
// Reverse one axis of the scalars in place, element by element of any type.
void ReverseAxis(vtkImageData* image, int axis)
{
  int dims[3];
  image->GetDimensions(dims);
  vtkDataArray* scalars = image->GetPointData()->GetScalars();
  const std::size_t element =
    static_cast<std::size_t>(scalars->GetDataTypeSize()) * scalars->GetNumberOfComponents();
  auto* data = static_cast<unsigned char*>(scalars->GetVoidPointer(0));
  const std::size_t stride[3] = { element, element * dims[0],
    element * static_cast<std::size_t>(dims[0]) * dims[1] };
  // Runs that lie together in memory are swapped as one.
  const std::size_t run = stride[axis];
  const std::size_t block = run * dims[axis];
  const std::size_t total = stride[2] * dims[2];
  for (std::size_t start = 0; start < total; start += block)
  {
    for (int a = 0, b = dims[axis] - 1; a < b; ++a, --b)
    {
      std::swap_ranges(
        data + start + a * run, data + start + (a + 1) * run, data + start + b * run);
    }
  }
}
} // namespace

Affine Identity()
{
  return { { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 } };
}

std::array<double, 3> Apply(const Affine& m, double i, double j, double k)
{
  std::array<double, 3> p;
  for (int r = 0; r < 3; ++r)
  {
    p[r] = m[4 * r] * i + m[4 * r + 1] * j + m[4 * r + 2] * k + m[4 * r + 3];
  }
  return p;
}

Affine NegateXY(const Affine& m)
{
  Affine n = m;
  for (int c = 0; c < 8; ++c)
  {
    n[c] = n[c] == 0. ? 0. : -n[c];
  }
  return n;
}

std::array<double, 3> Volume::World(double i, double j, double k) const
{
  return Apply(
    this->FileToWorld, i - this->FirstIndex[0], j - this->FirstIndex[1], k - this->FirstIndex[2]);
}

std::array<double, 3> Volume::Voxel(const std::array<double, 3>& world) const
{
  double inverse[16];
  vtkMatrix4x4::Invert(this->FileToWorld.data(), inverse);
  Affine m;
  std::copy(inverse, inverse + 16, m.begin());
  std::array<double, 3> p = Apply(m, world[0], world[1], world[2]);
  for (int a = 0; a < 3; ++a)
  {
    p[a] += this->FirstIndex[a];
  }
  return p;
}

std::string FormatNumber(double value)
{
  char text[32];
  // Survey coordinates: metres, not millions of them.
  const bool large = std::abs(value) >= 1e5 && std::abs(value) < 1e12;
  std::snprintf(text, sizeof text, large ? "%.1f" : "%.6g", value);
  return text;
}

std::string FormatPoint(const double p[3])
{
  return "(" + FormatNumber(p[0]) + ", " + FormatNumber(p[1]) + ", " + FormatNumber(p[2]) + ")";
}

void Place(Volume& volume, const Affine& fileToWorld, bool upright)
{
  int dims[3];
  volume.Image->GetDimensions(dims);
  double spacing[3];
  double axes[3][3]; // axes[a]: unit vector of the file's axis a
  for (int a = 0; a < 3; ++a)
  {
    double column[3] = { fileToWorld[a], fileToWorld[4 + a], fileToWorld[8 + a] };
    spacing[a] = vtkMath::Norm(column);
    if (!(spacing[a] > 0.) || !std::isfinite(spacing[a]) || !std::isfinite(fileToWorld[4 * a + 3]))
    {
      throw Error("spacing along axis " + std::to_string(a) + " is " + FormatNumber(spacing[a]) +
        " and the origin " + FormatNumber(fileToWorld[4 * a + 3]) +
        "; expected a positive spacing and finite numbers");
    }
    for (int r = 0; r < 3; ++r)
    {
      axes[a][r] = column[r] / spacing[a];
    }
  }

  // Nearest orthonormal axes (polar decomposition), around the middle of the volume.
  double matrix[3][3];
  double rotation[3][3];
  for (int r = 0; r < 3; ++r)
  {
    for (int a = 0; a < 3; ++a)
    {
      matrix[r][a] = axes[a][r];
    }
  }
  double worst = 0.; // largest |cosine| between two axes
  for (int a = 0; a < 3; ++a)
  {
    worst = std::max(worst, std::abs(vtkMath::Dot(axes[a], axes[(a + 1) % 3])));
  }
  if (worst > std::sin(vtkMath::RadiansFromDegrees(5.)))
  {
    throw Error("the axes are sheared: the angle between two of them is " +
      FormatNumber(vtkMath::DegreesFromRadians(std::acos(std::min(worst, 1.)))) +
      " degrees; expected 90 +- 5 (resample the file on a rectangular grid first)");
  }
  const bool leftHanded = vtkMath::Determinant3x3(matrix) < 0.;
  vtkMath::Orthogonalize3x3(matrix, rotation);

  Affine rigid = fileToWorld;
  double mid[3] = { (dims[0] - 1) / 2., (dims[1] - 1) / 2., (dims[2] - 1) / 2. };
  const std::array<double, 3> centre = Apply(fileToWorld, mid[0], mid[1], mid[2]);
  for (int r = 0; r < 3; ++r)
  {
    rigid[4 * r + 3] = centre[r];
    for (int a = 0; a < 3; ++a)
    {
      // Polar decomposition leaves dust of 1e-17 in an exact rotation: keep the file's
      // numbers where they are already orthonormal.
      const double direction = worst < 1e-6 ? matrix[r][a] : rotation[r][a];
      rigid[4 * r + a] = direction * spacing[a];
      rigid[4 * r + 3] -= rigid[4 * r + a] * mid[a];
    }
  }
  if (worst >= 1e-6)
  {
    double shift = 0.;
    for (int corner = 0; corner < 8; ++corner)
    {
      const double i = corner & 1 ? dims[0] - 1 : 0;
      const double j = corner & 2 ? dims[1] - 1 : 0;
      const double k = corner & 4 ? dims[2] - 1 : 0;
      const auto a = Apply(fileToWorld, i, j, k);
      const auto b = Apply(rigid, i, j, k);
      shift = std::max(shift, vtkMath::Distance2BetweenPoints(a.data(), b.data()));
    }
    shift = std::sqrt(shift);
    if (shift > 0.01 * std::min({ spacing[0], spacing[1], spacing[2] }))
    {
      volume.Notes.push_back("the axes are not quite at right angles; the nearest ones that are "
                             "move no voxel by more than " +
        FormatNumber(shift) + " " + volume.Unit);
    }
  }
  else
  {
    rigid = fileToWorld;
  }
  volume.FileToWorld = rigid;
  volume.Dimensions = { { dims[0], dims[1], dims[2] } };

  double direction[3][3];
  double origin[3] = { rigid[3], rigid[7], rigid[11] };
  for (int r = 0; r < 3; ++r)
  {
    for (int a = 0; a < 3; ++a)
    {
      direction[r][a] = rigid[4 * r + a] / spacing[a];
    }
  }
  // The world axis that each axis is closest to, and whether it runs against it.
  bool against[3];
  int vertical = 2;
  for (int a = 0; a < 3; ++a)
  {
    int dominant = 0;
    for (int r = 1; r < 3; ++r)
    {
      if (std::abs(direction[r][a]) > std::abs(direction[dominant][a]))
      {
        dominant = r;
      }
    }
    against[a] = direction[dominant][a] < 0.;
    vertical = dominant == 2 ? a : vertical;
  }
  bool reverse[3] = { false, false, false };
  reverse[vertical] = upright && against[vertical];
  if (leftHanded != reverse[vertical])
  {
    // One more, to be right-handed: an axis that runs against the world's; failing that, the
    // slowest that is left.
    int axis = upright && vertical == 2 ? 1 : 2;
    for (int a = 2; a >= 0; --a)
    {
      if (against[a] && !(upright && a == vertical))
      {
        axis = a;
      }
    }
    reverse[axis] = true;
  }
  for (int axis = 0; axis < 3; ++axis)
  {
    if (!reverse[axis])
    {
      continue;
    }
    ReverseAxis(volume.Image, axis);
    for (int r = 0; r < 3; ++r)
    {
      origin[r] += direction[r][axis] * spacing[axis] * (dims[axis] - 1);
      direction[r][axis] = direction[r][axis] == 0. ? 0. : -direction[r][axis];
    }
    volume.Flipped[axis] = true;
  }
  volume.Image->SetSpacing(spacing);
  volume.Image->SetOrigin(origin);
  // As a whole: changing the matrix it holds would leave the image's transforms as they were.
  double elements[9];
  for (int r = 0; r < 3; ++r)
  {
    std::copy(direction[r], direction[r] + 3, elements + 3 * r);
  }
  volume.Image->SetDirectionMatrix(elements);
}

} // namespace lightvolume
