// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "VdbIO.h"

#ifndef LIGHTVOLUME_OPENVDB

namespace lightvolume
{
Volume ReadVdb(const std::string& path, const std::string&, double)
{
  throw Error("cannot read '" + path +
    "': this light-volume was built without OpenVDB (install libopenvdb-dev and build again)");
}
void WriteVdb(const std::string& path, vtkImageData*, const std::vector<std::string>&)
{
  throw Error("cannot write '" + path +
    "': this light-volume was built without OpenVDB (install libopenvdb-dev and build again)");
}
std::string OpenVdbVersion()
{
  return {};
}
} // namespace lightvolume

#else

#include "vtkFloatArray.h"
#include "vtkMatrix3x3.h"
#include "vtkPointData.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>

#include <fstream>

namespace lightvolume
{
namespace
{
using Dense = openvdb::tools::Dense<float, openvdb::tools::LayoutXYZ>;

template <typename GridType>
bool CopyGrid(const openvdb::GridBase::ConstPtr& base, const openvdb::CoordBBox& box, float* to)
{
  const auto grid = openvdb::gridConstPtrCast<GridType>(base);
  if (!grid)
  {
    return false;
  }
  Dense dense(box, to);
  openvdb::tools::copyToDense(grid->tree(), dense);
  return true;
}

bool IsReadable(const openvdb::GridBase& grid)
{
  return grid.isType<openvdb::FloatGrid>() || grid.isType<openvdb::DoubleGrid>() ||
    grid.isType<openvdb::Int32Grid>() || grid.isType<openvdb::BoolGrid>();
}
} // namespace

Volume ReadVdb(const std::string& path, const std::string& gridName, double maximumVoxels)
{
  if (!std::ifstream(path).good())
  {
    throw Error("cannot open '" + path + "'");
  }
  openvdb::initialize();
  openvdb::GridBase::ConstPtr grid;
  std::string names;
  try
  {
    openvdb::io::File file(path);
    file.setCopyMaxBytes(0);
    file.open(false); // no delayed loading: a short file shows now
    const openvdb::GridPtrVecPtr all = file.readAllGridMetadata();
    for (const auto& meta : *all)
    {
      const std::string name = meta->getName();
      names += (names.empty() ? "'" : ", '") + name + "'";
      if (!grid && (gridName.empty() ? IsReadable(*meta) : name == gridName))
      {
        grid = file.readGrid(name);
      }
    }
    file.close();
  }
  catch (const std::exception& error)
  {
    throw Error("cannot read '" + path + "': " + error.what());
  }
  if (!grid)
  {
    throw Error("'" + path + "' has no " +
      (gridName.empty() ? "float, double, int or bool grid" : "grid '" + gridName + "'") +
      "; it has " + (names.empty() ? "none" : names));
  }
  if (!IsReadable(*grid))
  {
    throw Error("grid '" + grid->getName() + "' of '" + path + "' has type " + grid->valueType() +
      "; expected float, double, int or bool");
  }
  const openvdb::CoordBBox box = grid->evalActiveVoxelBoundingBox();
  if (box.empty())
  {
    throw Error("grid '" + grid->getName() + "' of '" + path + "' has no active voxels");
  }
  if (!grid->transform().isLinear())
  {
    throw Error("grid '" + grid->getName() + "' of '" + path +
      "' has a perspective transform; expected a linear one");
  }
  const openvdb::Coord size = box.dim();
  const double voxels = static_cast<double>(size.x()) * size.y() * size.z();
  if (voxels > maximumVoxels)
  {
    throw Error("grid '" + grid->getName() + "' of '" + path + "' spans " +
      std::to_string(size.x()) + " x " + std::to_string(size.y()) + " x " +
      std::to_string(size.z()) + " voxels; as a dense volume that does not fit into memory");
  }
  Volume volume;
  volume.Format = "OpenVDB";
  volume.Notes.push_back("grid '" + grid->getName() + "', active bounding box from (" +
    std::to_string(box.min().x()) + ", " + std::to_string(box.min().y()) + ", " +
    std::to_string(box.min().z()) + ")");
  if (grid->getGridClass() == openvdb::GRID_LEVEL_SET)
  {
    volume.Notes.push_back("a level set: the values are signed distances");
  }
  volume.Image = vtkSmartPointer<vtkImageData>::New();
  volume.Image->SetDimensions(size.x(), size.y(), size.z());
  volume.Image->AllocateScalars(VTK_FLOAT, 1);
  auto* to = static_cast<float*>(volume.Image->GetScalarPointer());
  if (!CopyGrid<openvdb::FloatGrid>(grid, box, to) &&
    !CopyGrid<openvdb::DoubleGrid>(grid, box, to) && !CopyGrid<openvdb::Int32Grid>(grid, box, to))
  {
    CopyGrid<openvdb::BoolGrid>(grid, box, to);
  }
  const openvdb::Vec3d origin = grid->indexToWorld(box.min());
  Affine m = Identity();
  for (int a = 0; a < 3; ++a)
  {
    openvdb::Coord next = box.min();
    next[a] += 1;
    const openvdb::Vec3d step = grid->indexToWorld(next) - origin;
    for (int r = 0; r < 3; ++r)
    {
      m[4 * r + a] = step[r];
    }
    m[4 * a + 3] = origin[a];
  }
  volume.FirstIndex = { { box.min().x(), box.min().y(), box.min().z() } };
  try
  {
    Place(volume, m);
  }
  catch (const Error& error)
  {
    throw Error("'" + path + "': " + error.what());
  }
  return volume;
}

void WriteVdb(const std::string& path, vtkImageData* image, const std::vector<std::string>& arrays)
{
  openvdb::initialize();
  int extent[6];
  image->GetExtent(extent);
  double origin[3];
  double spacing[3];
  image->GetOrigin(origin);
  image->GetSpacing(spacing);
  const vtkMatrix3x3* direction = image->GetDirectionMatrix();
  // OpenVDB multiplies rows: the transform is the transpose of the usual one.
  openvdb::Mat4R matrix = openvdb::Mat4R::identity();
  for (int r = 0; r < 3; ++r)
  {
    for (int a = 0; a < 3; ++a)
    {
      matrix(a, r) = direction->GetElement(r, a) * spacing[a];
    }
    matrix(3, r) = origin[r];
  }
  const openvdb::CoordBBox box(openvdb::Coord(extent[0], extent[2], extent[4]),
    openvdb::Coord(extent[1], extent[3], extent[5]));
  openvdb::GridPtrVec grids;
  for (const std::string& name : arrays)
  {
    auto* array = vtkFloatArray::SafeDownCast(image->GetPointData()->GetArray(name.c_str()));
    if (!array || array->GetNumberOfComponents() != 1)
    {
      throw Error("cannot write '" + path + "': no float array '" + name + "'");
    }
    const auto grid = openvdb::FloatGrid::create(0.F);
    grid->setName(name);
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(matrix));
    Dense dense(box, array->GetPointer(0));
    openvdb::tools::copyFromDense(dense, grid->tree(), 0.F);
    grids.push_back(grid);
  }
  try
  {
    openvdb::io::File file(path);
    file.write(grids);
    file.close();
  }
  catch (const std::exception& error)
  {
    throw Error("cannot write '" + path + "': " + error.what());
  }
}

std::string OpenVdbVersion()
{
  return openvdb::getLibraryVersionString();
}

} // namespace lightvolume

#endif
