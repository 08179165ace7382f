// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "DicomReader.h"

#ifndef LIGHTVOLUME_DICOM

namespace lightvolume
{
Volume ReadDicom(const std::string& path, bool, int)
{
  throw Error("cannot read '" + path +
    "': this light-volume was built without vtk-dicom (install libvtk-dicom-dev and build again)");
}
} // namespace lightvolume

#else

#include "VtkErrors.h"

#include "vtkDICOMDirectory.h"
#include "vtkDICOMItem.h"
#include "vtkDICOMMetaData.h"
#include "vtkDICOMReader.h"
#include "vtkErrorCode.h"
#include "vtkImageExtractComponents.h"
#include "vtkIntArray.h"
#include "vtkMatrix4x4.h"
#include "vtkPointData.h"
#include "vtkStringArray.h"

#include <algorithm>
#include <cmath>

namespace lightvolume
{
Volume ReadDicom(const std::string& path, bool folder, int component)
{
  Volume volume;
  volume.Format = "DICOM";
  volume.Unit = "mm";
  volume.IsRAS = true;
  VtkErrors errors;
  vtkNew<vtkDICOMReader> reader;
  errors.Watch(reader);
  if (folder)
  {
    vtkNew<vtkDICOMDirectory> directory;
    errors.Watch(directory);
    directory->SetDirectoryName(path.c_str());
    directory->RequirePixelDataOn();
    directory->Update(1); // 1: down to the images
    int best = -1;
    int series = directory->GetNumberOfSeries();
    vtkIdType most = 0;
    for (int s = 0; s < series; ++s)
    {
      vtkIdType images = directory->GetFileNamesForSeries(s)->GetNumberOfValues();
      if (images == 1)
      {
        // One file may hold a whole volume.
        images = std::max<vtkIdType>(
          1, directory->GetMetaDataForSeries(s)->Get(DC::NumberOfFrames).AsInt());
      }
      if (images > most)
      {
        most = images;
        best = s;
      }
    }
    if (best < 0)
    {
      throw Error("'" + path +
        "' holds no DICOM images; expected a folder with at least one series" + errors.Because());
    }
    if (series > 1)
    {
      const std::string name =
        directory->GetSeriesRecord(best).Get(DC::SeriesDescription).AsString();
      volume.Notes.push_back("the largest of " + std::to_string(series) +
        " series: " + std::to_string(most) + " images" + (name.empty() ? "" : ", '" + name + "'"));
    }
    reader->SetFileNames(directory->GetFileNamesForSeries(best));
  }
  else
  {
    reader->SetFileName(path.c_str());
  }
  reader->SetMemoryRowOrderToFileNative();
  reader->AutoRescaleOn();
  reader->Update();
  vtkImageData* output = reader->GetOutput();
  if (reader->GetErrorCode() != vtkErrorCode::NoError || output->GetNumberOfPoints() < 1 ||
    !output->GetPointData()->GetScalars())
  {
    throw Error("cannot read the DICOM images of '" + path + "'" + errors.Because());
  }
  if (reader->GetStackIDs()->GetNumberOfValues() > 1)
  {
    volume.Notes.push_back("the series holds " +
      std::to_string(reader->GetStackIDs()->GetNumberOfValues()) + " stacks: the first is read");
  }
  // The slices should be evenly spaced: the reader takes the mean.
  vtkDICOMMetaData* meta = reader->GetMetaData();
  vtkIntArray* order = reader->GetFileIndexArray();
  std::vector<double> steps;
  double previous[3] = { 0, 0, 0 };
  for (vtkIdType i = 0; i < order->GetNumberOfTuples() && meta->GetNumberOfInstances() > 1; ++i)
  {
    const vtkDICOMValue position =
      meta->Get(static_cast<int>(order->GetComponent(i, 0)), DC::ImagePositionPatient);
    if (position.GetNumberOfValues() < 3)
    {
      break;
    }
    const double p[3] = { position.GetDouble(0), position.GetDouble(1), position.GetDouble(2) };
    if (i > 0)
    {
      steps.push_back(std::sqrt((p[0] - previous[0]) * (p[0] - previous[0]) +
        (p[1] - previous[1]) * (p[1] - previous[1]) + (p[2] - previous[2]) * (p[2] - previous[2])));
    }
    std::copy(p, p + 3, previous);
  }
  if (!steps.empty())
  {
    const auto range = std::minmax_element(steps.begin(), steps.end());
    if (*range.second > *range.first * 1.05 + 1e-6)
    {
      volume.Notes.push_back("the slices are unevenly spaced, " + FormatNumber(*range.first) +
        " to " + FormatNumber(*range.second) + " mm: some may be missing");
    }
  }
  const int components = output->GetNumberOfScalarComponents();
  if (component < 0 || component >= components)
  {
    throw Error("--component is " + std::to_string(component) + "; '" + path +
      "' has components 0 to " + std::to_string(components - 1));
  }
  double spacing[3];
  double origin[3];
  output->GetSpacing(spacing);
  output->GetOrigin(origin);
  vtkNew<vtkImageExtractComponents> extract;
  extract->SetInputData(output);
  extract->SetComponents(component);
  extract->Update();
  volume.Image = extract->GetOutput();

  const vtkMatrix4x4* patient = reader->GetPatientMatrix();
  Affine m = Identity();
  for (int r = 0; r < 3; ++r)
  {
    m[4 * r + 3] = patient->GetElement(r, 3);
    for (int a = 0; a < 3; ++a)
    {
      m[4 * r + a] = patient->GetElement(r, a) * spacing[a];
      m[4 * r + 3] += patient->GetElement(r, a) * origin[a];
    }
  }
  volume.Notes.push_back("LPS coordinates of the files converted to RAS");
  try
  {
    Place(volume, NegateXY(m));
  }
  catch (const Error& error)
  {
    throw Error("'" + path + "': " + error.what());
  }
  return volume;
}

} // namespace lightvolume

#endif
