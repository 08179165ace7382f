// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "VolumeReader.h"

#include "DicomReader.h"
#include "NiftiIO.h"
#include "RawData.h"
#include "SegyReader.h"
#include "TextHeaderReaders.h"
#include "VdbIO.h"
#include "VtkErrors.h"

#include "vtkCellData.h"
#include "vtkDataArray.h"
#include "vtkImageExtractComponents.h"
#include "vtkMatrix3x3.h"
#include "vtkPointData.h"
#include "vtkXMLImageDataReader.h"

#include <cmath>
#include <cstring>
#include <fstream>
#include <new>
#include <sstream>

#include <sys/stat.h>

namespace lightvolume
{
namespace
{
bool EndsWith(const std::string& text, const char* end)
{
  const std::size_t n = std::strlen(end);
  return text.size() >= n && text.compare(text.size() - n, n, end) == 0;
}

// Point data as it is; cell data becomes points at the cells' centres.
Volume ReadVti(const std::string& path, const std::string& arrayName, int component)
{
  VtkErrors errors;
  vtkNew<vtkXMLImageDataReader> reader;
  errors.Watch(reader);
  if (!reader->CanReadFile(path.c_str()))
  {
    throw Error("'" + path + "' is not a VTK image file (.vti)");
  }
  reader->SetFileName(path.c_str());
  reader->Update();
  vtkImageData* output = reader->GetOutput();
  if (errors.Any() || output->GetNumberOfPoints() < 1)
  {
    throw Error("cannot read '" + path + "'" +
      (errors.Any() ? errors.Because() : std::string(": it holds no points")));
  }
  const auto choose = [&arrayName](vtkDataSetAttributes* data) -> vtkDataArray*
  {
    if (!arrayName.empty())
    {
      return data->GetArray(arrayName.c_str());
    }
    if (data->GetScalars())
    {
      return data->GetScalars();
    }
    return data->GetNumberOfArrays() > 0 ? data->GetArray(0) : nullptr;
  };
  Volume volume;
  volume.Format = "VTK image";
  vtkDataArray* array = choose(output->GetPointData());
  bool cells = false;
  if (!array)
  {
    array = choose(output->GetCellData());
    cells = array != nullptr;
  }
  if (!array)
  {
    throw Error("'" + path + "' has no " +
      (arrayName.empty() ? std::string("numeric array") : "array '" + arrayName + "'") +
      " on its points or cells");
  }
  int extent[6];
  double spacing[3];
  output->GetExtent(extent);
  output->GetSpacing(spacing);
  double first[3] = { double(extent[0]), double(extent[2]), double(extent[4]) };
  int dims[3] = { extent[1] - extent[0] + 1, extent[3] - extent[2] + 1, extent[5] - extent[4] + 1 };
  if (cells)
  {
    for (int a = 0; a < 3; ++a)
    {
      dims[a] = std::max(dims[a] - 1, 1);
      first[a] += .5;
    }
    volume.Notes.push_back("cell data, taken at the cells' centres");
  }
  if (component < 0 || component >= array->GetNumberOfComponents())
  {
    throw Error("--component is " + std::to_string(component) + "; array '" +
      (array->GetName() ? array->GetName() : "") + "' of '" + path + "' has components 0 to " +
      std::to_string(array->GetNumberOfComponents() - 1));
  }
  if (array->GetNumberOfComponents() > 1)
  {
    volume.Notes.push_back("component " + std::to_string(component) + " of " +
      std::to_string(array->GetNumberOfComponents()) + " (--component chooses another)");
  }
  volume.Image = vtkSmartPointer<vtkImageData>::New();
  volume.Image->SetDimensions(dims);
  volume.Image->GetPointData()->SetScalars(array);
  if (array->GetNumberOfComponents() > 1)
  {
    vtkNew<vtkImageExtractComponents> extract;
    extract->SetInputData(volume.Image);
    extract->SetComponents(component);
    extract->Update();
    volume.Image = extract->GetOutput();
  }
  double origin[3];
  output->TransformContinuousIndexToPhysicalPoint(first, origin);
  Affine m = Identity();
  for (int r = 0; r < 3; ++r)
  {
    for (int a = 0; a < 3; ++a)
    {
      m[4 * r + a] = output->GetDirectionMatrix()->GetElement(r, a) * spacing[a];
    }
    m[4 * r + 3] = origin[r];
  }
  volume.FirstIndex = { { extent[0], extent[2], extent[4] } };
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

// Infinite values would poison every gradient: named here, where the voxel can be.
template <typename T>
void RefuseInfinity(const Volume& volume, const T* values, const std::string& path)
{
  const vtkIdType n = volume.Image->GetNumberOfPoints();
  for (vtkIdType id = 0; id < n; ++id)
  {
    if (std::isinf(values[id]))
    {
      const int* dims = volume.Dimensions.data();
      int index[3] = { static_cast<int>(id % dims[0]), static_cast<int>(id / dims[0] % dims[1]),
        static_cast<int>(id / dims[0] / dims[1]) };
      double voxel[3];
      for (int a = 0; a < 3; ++a)
      {
        voxel[a] = (volume.Flipped[a] ? dims[a] - 1 - index[a] : index[a]) + volume.FirstIndex[a];
      }
      throw Error("'" + path + "' has an infinite value at voxel " + FormatPoint(voxel) +
        "; expected finite values, or NaN for no data");
    }
  }
}

Volume Dispatch(const std::string& path, const ReadOptions& options)
{
  struct stat status;
  if (stat(path.c_str(), &status) != 0)
  {
    throw Error("cannot open '" + path + "': " + std::strerror(errno));
  }
  if (S_ISDIR(status.st_mode))
  {
    return ReadDicom(path, true, options.Component);
  }
  if (status.st_size == 0)
  {
    throw Error("'" + path + "' is empty");
  }
  const std::string lower = LowerCase(path);
  if (EndsWith(lower, ".nii") || EndsWith(lower, ".nii.gz") || EndsWith(lower, ".hdr") ||
    EndsWith(lower, ".hdr.gz"))
  {
    return ReadNifti(path, options.Frame, options.Component);
  }
  if (EndsWith(lower, ".mha") || EndsWith(lower, ".mhd"))
  {
    return ReadMetaImage(path, options.Frame, options.Component);
  }
  if (EndsWith(lower, ".nrrd") || EndsWith(lower, ".nhdr"))
  {
    return ReadNrrd(path, options.Frame, options.Component);
  }
  if (EndsWith(lower, ".dcm") || EndsWith(lower, ".ima"))
  {
    return ReadDicom(path, false, options.Component);
  }
  if (EndsWith(lower, ".vti"))
  {
    return ReadVti(path, options.Array, options.Component);
  }
  if (EndsWith(lower, ".sgy") || EndsWith(lower, ".segy"))
  {
    return ReadSegy(path, options.InlineByte, options.CrosslineByte, options.ZScale);
  }
  if (EndsWith(lower, ".vdb"))
  {
    return ReadVdb(path, options.Array, AvailableMemory() / 8.);
  }
  const std::size_t slash = path.find_last_of('/');
  const std::size_t dot = path.find_last_of('.');
  const bool hasExtension = dot != std::string::npos && (slash == std::string::npos || dot > slash);
  throw Error("'" + path + "' has " +
    (hasExtension ? "the extension '" + path.substr(dot) + "'" : std::string("no extension")) +
    "; expected .nii, .nii.gz, .hdr, .mha, .mhd, .nrrd, .nhdr, .vti, .sgy, .segy, .vdb, .dcm or a "
    "folder of DICOM files");
}
} // namespace

double AvailableMemory()
{
  std::ifstream info("/proc/meminfo");
  std::string line;
  while (std::getline(info, line))
  {
    std::istringstream words(line);
    std::string name;
    double kilobytes = 0.;
    if (words >> name >> kilobytes && name == "MemAvailable:")
    {
      return kilobytes * 1024.;
    }
  }
  return 1e12;
}

Volume ReadVolume(const std::string& path, const ReadOptions& options)
{
  try
  {
    Volume volume = Dispatch(path, options);
    vtkDataArray* scalars = volume.Image->GetPointData()->GetScalars();
    if (!scalars->GetName() || !scalars->GetName()[0])
    {
      scalars->SetName("Scalars");
    }
    if (scalars->GetDataType() == VTK_FLOAT)
    {
      RefuseInfinity(volume, static_cast<const float*>(scalars->GetVoidPointer(0)), path);
    }
    else if (scalars->GetDataType() == VTK_DOUBLE)
    {
      RefuseInfinity(volume, static_cast<const double*>(scalars->GetVoidPointer(0)), path);
    }
    return volume;
  }
  catch (const std::bad_alloc&)
  {
    throw Error("'" + path + "' does not fit into the memory of this machine");
  }
}

} // namespace lightvolume
