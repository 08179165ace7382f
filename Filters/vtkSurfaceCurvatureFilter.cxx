// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkSurfaceCurvatureFilter.h"

#include "Core/SurfaceCurvature.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportImage.h"
#include "vtkLightTransportInternal.h"

#include "vtkCellArray.h"
#include "vtkFloatArray.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <sstream>

vtkStandardNewMacro(vtkSurfaceCurvatureFilter);

namespace
{
/** Appends a polygon, turned over where the normals are flipped; false for a bad index. */
bool AddPolygon(lighttransport::SurfaceMesh& mesh, vtkIdType n, const vtkIdType* ids, bool flip)
{
  for (vtkIdType i = 0; i < n; ++i)
  {
    const vtkIdType id = ids[flip ? n - 1 - i : i];
    if (id < 0 || id >= mesh.numberOfPoints())
    {
      return false;
    }
    mesh.corners.push_back(id);
  }
  mesh.offsets.push_back(static_cast<std::int64_t>(mesh.corners.size()));
  return true;
}
} // namespace

//------------------------------------------------------------------------------
int vtkSurfaceCurvatureFilter::RequestData(
  vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkPolyData* input = vtkPolyData::GetData(inputs[0]);
  vtkPolyData* output = vtkPolyData::GetData(outputs);
  output->Initialize();
  std::string problem;
  try
  {
    problem = this->Compute(input, output);
  }
  catch (const std::bad_alloc&)
  {
    problem = "not enough memory for the neighbourhoods of " +
      std::to_string(input->GetNumberOfPoints()) + " points";
  }
  if (!problem.empty())
  {
    output->Initialize();
    vtkErrorMacro(<< problem << ".");
    return 0;
  }
  return 1;
}

//------------------------------------------------------------------------------
std::string vtkSurfaceCurvatureFilter::Compute(vtkPolyData* input, vtkPolyData* output)
{
  using namespace lighttransport;
  std::ostringstream text;
  const vtkIdType size = input->GetNumberOfPoints();
  if (size < 1)
  {
    return "the surface has no points, expected a surface with polygons";
  }
  if (input->GetNumberOfPolys() + input->GetNumberOfStrips() < 1)
  {
    text << "the surface has " << size
         << " points and no polygons, expected polygons or triangle strips";
    return text.str();
  }
  if (!(this->Radius >= 0. && std::isfinite(this->Radius)))
  {
    text << "Radius is " << this->Radius << ", expected a finite length >= 0";
    return text.str();
  }
  if (!this->ComputePrincipalCurvatures && !this->ComputeMeanCurvature &&
    !this->ComputeGaussianCurvature)
  {
    return "ComputePrincipalCurvatures, ComputeMeanCurvature and ComputeGaussianCurvature are all "
           "off, expected one of them on";
  }

  SurfaceMesh mesh;
  mesh.points.resize(3 * static_cast<std::size_t>(size));
  for (vtkIdType i = 0; i < size; ++i)
  {
    input->GetPoint(i, &mesh.points[3 * i]);
  }
  mesh.offsets.push_back(0);
  bool good = true;
  vtkIdType n = 0;
  const vtkIdType* ids = nullptr;
  vtkCellArray* polys = input->GetPolys();
  for (vtkIdType cell = 0; cell < polys->GetNumberOfCells(); ++cell)
  {
    polys->GetCellAtId(cell, n, ids);
    good = good && AddPolygon(mesh, n, ids, this->FlipNormals);
  }
  vtkCellArray* strips = input->GetStrips();
  for (vtkIdType cell = 0; cell < strips->GetNumberOfCells(); ++cell)
  {
    strips->GetCellAtId(cell, n, ids);
    for (vtkIdType i = 0; i + 2 < n; ++i)
    {
      good = good && AddPolygon(mesh, 3, ids + i, this->FlipNormals != (i % 2 == 1));
    }
  }
  if (!good)
  {
    text << "a polygon has a corner that is no point, expected indices of 0 to " << size - 1;
    return text.str();
  }

  vtkNew<vtkFloatArray> arrays[4];
  const char* const names[4] = { vtkLightTransportArrays::PrincipalCurvature1,
    vtkLightTransportArrays::PrincipalCurvature2, vtkLightTransportArrays::MeanCurvature,
    vtkLightTransportArrays::GaussianCurvature };
  const bool wanted[4] = { this->ComputePrincipalCurvatures, this->ComputePrincipalCurvatures,
    this->ComputeMeanCurvature, this->ComputeGaussianCurvature };
  float* fields[4] = {};
  for (int a = 0; a < 4; ++a)
  {
    if (wanted[a])
    {
      arrays[a]->SetName(names[a]);
      arrays[a]->SetNumberOfTuples(size);
      fields[a] = arrays[a]->GetPointer(0);
    }
  }
  if (!ComputeSurfaceCurvature(mesh, this->Radius, { fields[0], fields[1], fields[2], fields[3] },
        vtkLightTransportParallelFor(), vtkLightTransportImage::Progress(this, 0.1, 1.)))
  {
    return {}; // aborted: an empty output, no error
  }
  output->ShallowCopy(input);
  for (int a = 0; a < 4; ++a)
  {
    if (wanted[a])
    {
      output->GetPointData()->AddArray(arrays[a]);
    }
  }
  return {};
}

//------------------------------------------------------------------------------
void vtkSurfaceCurvatureFilter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "ComputePrincipalCurvatures: " << this->ComputePrincipalCurvatures << "\n";
  os << indent << "ComputeMeanCurvature: " << this->ComputeMeanCurvature << "\n";
  os << indent << "ComputeGaussianCurvature: " << this->ComputeGaussianCurvature << "\n";
  os << indent << "Radius: " << this->Radius << "\n";
  os << indent << "FlipNormals: " << this->FlipNormals << "\n";
}
