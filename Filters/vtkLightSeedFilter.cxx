// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightSeedFilter.h"

#include "Core/Seeds.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportImage.h"
#include "vtkLightTransportInternal.h"

#include "vtkCellArray.h"
#include "vtkCellArrayIterator.h"
#include "vtkCellData.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkSmartPointer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <sstream>

vtkStandardNewMacro(vtkLightSeedFilter);

using namespace lighttransport;

namespace
{
constexpr int GridPort = 0;
constexpr int PaintPort = 1;
constexpr int StrokePort = 2;
constexpr int FluencePort = 3;
constexpr int NumberOfPorts = 4;
constexpr double LargestFloat = std::numeric_limits<float>::max();

bool IsFinite(const std::array<double, 3>& x)
{
  return std::isfinite(x[0]) && std::isfinite(x[1]) && std::isfinite(x[2]);
}

std::ostream& operator<<(std::ostream& os, const std::array<double, 3>& x)
{
  return os << x[0] << " " << x[1] << " " << x[2];
}

/** |a b| <= limit, without an overflow on the way. */
bool ProductFits(double a, double b, double limit)
{
  return a == 0. || b == 0. || std::abs(a) <= 1. || std::abs(b) <= limit / std::abs(a);
}

/** A value for each point or cell of the strokes: an array, or a constant. */
struct StrokeValues
{
  ValueReader Read;
  bool OnCells = false;
  double Constant = 0.;
  double at(vtkIdType point, vtkIdType cell) const
  {
    double value = this->Constant;
    if (this->Read)
    {
      this->Read(this->OnCells ? cell : point, 1, &value);
    }
    return value;
  }
};

/** The values from the array of that name, or the constant; a message if it is too short. */
std::string FindValues(
  vtkPolyData* strokes, const char* name, double constant, StrokeValues& values)
{
  values.Constant = constant;
  vtkDataArray* array = name ? strokes->GetPointData()->GetArray(name) : nullptr;
  if (!array && name)
  {
    array = strokes->GetCellData()->GetArray(name);
    values.OnCells = array != nullptr;
  }
  if (!array)
  {
    return {};
  }
  values.Read = vtkLightTransportImage::Reader(array, 0);
  const vtkIdType count =
    values.OnCells ? strokes->GetNumberOfCells() : strokes->GetNumberOfPoints();
  std::ostringstream text;
  if (array->GetNumberOfTuples() != count)
  {
    text << "the array \"" << name << "\" of the strokes has " << array->GetNumberOfTuples()
         << " tuples, expected " << count << ", one for each "
         << (values.OnCells ? "cell" : "point");
  }
  return text.str();
}

/** An image source and the memory that it reads. */
struct PreparedImage
{
  ImageSource Source;
  std::vector<float> Values;
};
} // namespace

//------------------------------------------------------------------------------
vtkLightSeedFilter::vtkLightSeedFilter()
{
  this->SetNumberOfInputPorts(NumberOfPorts);
  this->SetRadiusArrayName("Radius");
  this->SetPowerArrayName("Power");
}

//------------------------------------------------------------------------------
vtkLightSeedFilter::~vtkLightSeedFilter()
{
  this->SetPaintedArrayName(nullptr);
  this->SetRadiusArrayName(nullptr);
  this->SetPowerArrayName(nullptr);
}

//------------------------------------------------------------------------------
int vtkLightSeedFilter::AddSphere(double x, double y, double z, double radius, double power)
{
  this->Spheres.push_back({ { { x, y, z } }, radius, power });
  this->Modified();
  return this->GetNumberOfSpheres() - 1;
}

//------------------------------------------------------------------------------
void vtkLightSeedFilter::SetSphere(int i, double x, double y, double z, double radius, double power)
{
  if (i < 0 || i >= this->GetNumberOfSpheres())
  {
    vtkErrorMacro("SetSphere: the index is " << i << ", expected 0 to "
                                             << this->GetNumberOfSpheres() - 1 << ".");
    return;
  }
  Sphere& sphere = this->Spheres[i];
  const std::array<double, 3> center{ { x, y, z } };
  if (sphere.Center != center || sphere.Radius != radius || sphere.Power != power)
  {
    sphere = { center, radius, power };
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightSeedFilter::RemoveSphere(int i)
{
  if (i < 0 || i >= this->GetNumberOfSpheres())
  {
    vtkErrorMacro("RemoveSphere: the index is " << i << ", expected 0 to "
                                                << this->GetNumberOfSpheres() - 1 << ".");
    return;
  }
  this->Spheres.erase(this->Spheres.begin() + i);
  this->Modified();
}

//------------------------------------------------------------------------------
void vtkLightSeedFilter::RemoveAllSpheres()
{
  if (!this->Spheres.empty())
  {
    this->Spheres.clear();
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightSeedFilter::GetSphereCenter(int i, double center[3]) const
{
  const bool exists = i >= 0 && i < this->GetNumberOfSpheres();
  for (int a = 0; a < 3; ++a)
  {
    center[a] = exists ? this->Spheres[i].Center[a] : std::numeric_limits<double>::quiet_NaN();
  }
}

//------------------------------------------------------------------------------
double vtkLightSeedFilter::GetSphereRadius(int i) const
{
  return i >= 0 && i < this->GetNumberOfSpheres() ? this->Spheres[i].Radius
                                                  : std::numeric_limits<double>::quiet_NaN();
}

//------------------------------------------------------------------------------
double vtkLightSeedFilter::GetSpherePower(int i) const
{
  return i >= 0 && i < this->GetNumberOfSpheres() ? this->Spheres[i].Power
                                                  : std::numeric_limits<double>::quiet_NaN();
}

//------------------------------------------------------------------------------
void vtkLightSeedFilter::SetPaintedImageData(vtkImageData* image)
{
  this->SetInputDataInternal(PaintPort, image);
}

//------------------------------------------------------------------------------
vtkImageData* vtkLightSeedFilter::GetPaintedImage()
{
  return this->GetNumberOfInputConnections(PaintPort) > 0
    ? vtkImageData::SafeDownCast(this->GetInputDataObject(PaintPort, 0))
    : nullptr;
}

//------------------------------------------------------------------------------
void vtkLightSeedFilter::SetStrokesData(vtkPolyData* strokes)
{
  this->SetInputDataInternal(StrokePort, strokes);
}

//------------------------------------------------------------------------------
vtkPolyData* vtkLightSeedFilter::GetStrokes()
{
  return this->GetNumberOfInputConnections(StrokePort) > 0
    ? vtkPolyData::SafeDownCast(this->GetInputDataObject(StrokePort, 0))
    : nullptr;
}

//------------------------------------------------------------------------------
void vtkLightSeedFilter::SetFluenceData(vtkImageData* image)
{
  this->SetInputDataInternal(FluencePort, image);
}

//------------------------------------------------------------------------------
vtkImageData* vtkLightSeedFilter::GetFluence()
{
  return this->GetNumberOfInputConnections(FluencePort) > 0
    ? vtkImageData::SafeDownCast(this->GetInputDataObject(FluencePort, 0))
    : nullptr;
}

//------------------------------------------------------------------------------
int vtkLightSeedFilter::FillInputPortInformation(int port, vtkInformation* info)
{
  info->Set(
    vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), port == StrokePort ? "vtkPolyData" : "vtkImageData");
  if (port != GridPort)
  {
    info->Set(vtkAlgorithm::INPUT_IS_OPTIONAL(), 1);
  }
  return 1;
}

//------------------------------------------------------------------------------
int vtkLightSeedFilter::RequestUpdateExtent(
  vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  vtkLightTransportImage::RequestWholeExtents(inputs, NumberOfPorts);
  return 1;
}

//------------------------------------------------------------------------------
int vtkLightSeedFilter::RequestData(
  vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkImageData* input = vtkImageData::GetData(inputs[GridPort]);
  vtkImageData* output = vtkImageData::GetData(outputs);
  this->TotalPower = 0.;
  output->Initialize();
  std::string problem;
  try
  {
    problem = this->Compute(input, vtkImageData::GetData(inputs[PaintPort]),
      vtkPolyData::GetData(inputs[StrokePort]), vtkImageData::GetData(inputs[FluencePort]), output);
  }
  catch (const std::bad_alloc&)
  {
    problem = "not enough memory for a float array of " +
      std::to_string(input->GetNumberOfPoints()) + " points, " +
      std::to_string(input->GetNumberOfPoints() / (1 << 18)) + " MiB";
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
std::string vtkLightSeedFilter::FindParameterProblem() const
{
  std::ostringstream text;
  if (!std::isfinite(this->PaintedGain))
  {
    text << "PaintedGain is " << this->PaintedGain << ", expected a finite value";
  }
  else if (!(this->DefaultStrokeRadius >= 0. && std::isfinite(this->DefaultStrokeRadius)))
  {
    text << "DefaultStrokeRadius is " << this->DefaultStrokeRadius
         << ", expected a finite length >= 0";
  }
  else if (!std::isfinite(this->DefaultStrokePower))
  {
    text << "DefaultStrokePower is " << this->DefaultStrokePower << ", expected a finite power";
  }
  else if (!std::isfinite(this->ReinjectionThreshold))
  {
    text << "ReinjectionThreshold is " << this->ReinjectionThreshold
         << ", expected a finite fluence";
  }
  else if (!std::isfinite(this->ReinjectionGain))
  {
    text << "ReinjectionGain is " << this->ReinjectionGain << ", expected a finite value";
  }
  return text.str();
}

namespace
{
//------------------------------------------------------------------------------
/** Strokes as spheres; a message if something is wrong. */
std::string PrepareStrokes(vtkPolyData* strokes, const StrokeValues& radii,
  const StrokeValues& powers, vtkImageData* image, const Grid& grid,
  std::vector<SphereSource>& spheres)
{
  // The cell arrays number the vertices first, then the lines.
  vtkIdType cell = 0;
  for (vtkCellArray* cells : { strokes->GetVerts(), strokes->GetLines() })
  {
    auto iterator = vtk::TakeSmartPointer(cells->NewIterator());
    for (iterator->GoToFirstCell(); !iterator->IsDoneWithTraversal(); iterator->GoToNextCell())
    {
      vtkIdType n;
      const vtkIdType* ids;
      iterator->GetCurrentCell(n, ids);
      Stroke stroke;
      for (vtkIdType p = 0; p < n; ++p)
      {
        if (ids[p] < 0 || ids[p] >= strokes->GetNumberOfPoints())
        {
          return "stroke " + std::to_string(cell) + " names point " + std::to_string(ids[p]) +
            ", expected 0 to " + std::to_string(strokes->GetNumberOfPoints() - 1);
        }
        std::array<double, 3> world;
        strokes->GetPoint(ids[p], world.data());
        const double radius = radii.at(ids[p], cell);
        const double power = powers.at(ids[p], cell);
        std::ostringstream text;
        if (!IsFinite(world))
        {
          text << "stroke " << cell << " has a point at " << world
               << ", expected finite coordinates";
        }
        else if (!(radius >= 0. && std::isfinite(radius)))
        {
          text << "stroke " << cell << " has the radius " << radius
               << ", expected a finite length >= 0";
        }
        else if (!std::isfinite(power))
        {
          text << "stroke " << cell << " has the power " << power << ", expected a finite power";
        }
        if (!text.str().empty())
        {
          return text.str();
        }
        std::array<double, 3> index;
        vtkLightTransportImage::WorldToIndex(image, world.data(), index.data());
        stroke.points.push_back(index);
        stroke.radius.push_back(radius);
        stroke.power.push_back(power);
      }
      if (n > 0 && !StrokeToSpheres(grid, stroke, spheres))
      {
        std::array<double, 3> world;
        strokes->GetPoint(ids[0], world.data());
        std::ostringstream text;
        text << "stroke " << cell << ", which begins at " << world
             << ", lies outside the volume, expected it to meet "
             << vtkLightTransportImage::DomainAsString(image);
        return text.str();
      }
      ++cell;
    }
  }
  return {};
}

//------------------------------------------------------------------------------
/** `what` names the image and the array in messages. */
std::string PrepareImage(vtkImageData* image, vtkDataArray* array, const std::string& what,
  double gain, const std::function<double(double)>& transfer, vtkImageData* target,
  PreparedImage& prepared)
{
  std::ostringstream text;
  const std::string problem = vtkLightTransportImage::Problem(image);
  if (!problem.empty())
  {
    text << what << ": " << problem;
    return text.str();
  }
  const vtkIdType size = image->GetNumberOfPoints();
  if (array->GetNumberOfTuples() != size)
  {
    text << what << " has " << array->GetNumberOfTuples()
         << " tuples, expected one for each of the " << size << " points";
    return text.str();
  }
  const ParallelFor parallel = vtkLightTransportParallelFor();
  const ValueReader read = vtkLightTransportImage::Reader(array, 0);
  const ValueRange range = FindValueRange(size, read, parallel);
  if (range.numberOfNaN > 0 || range.firstInfinite >= 0)
  {
    text << what << " holds " << (range.numberOfNaN > 0 ? "NaN" : "an infinity") << " at point "
         << (range.numberOfNaN > 0 ? range.firstNaN : range.firstInfinite)
         << ", expected finite values";
    return text.str();
  }
  const double largest = std::max(std::abs(range.min), std::abs(range.max));
  if (!ProductFits(largest, gain, LargestFloat) || largest > LargestFloat)
  {
    text << what << " reaches " << largest << " with a gain of " << gain
         << ", expected a density that float32 can hold";
    return text.str();
  }
  prepared.Source.transfer = transfer;
  prepared.Source.read = read;
  if (!vtkLightTransportImage::SameGeometry(image, target))
  {
    prepared.Values.resize(static_cast<std::size_t>(size));
    parallel(size,
      [&](std::int64_t begin, std::int64_t end)
      {
        std::vector<double> row(
          static_cast<std::size_t>(std::min<std::int64_t>(4096, end - begin)));
        for (std::int64_t i = begin; i < end; i += 4096)
        {
          const std::int64_t n = std::min<std::int64_t>(4096, end - i);
          read(i, n, row.data());
          std::transform(row.begin(), row.begin() + n, prepared.Values.begin() + i,
            [](double value) { return static_cast<float>(value); });
        }
      });
    prepared.Source.values = prepared.Values.data();
    prepared.Source.grid = vtkLightTransportImage::GridOf(image);
    for (int corner = 0; corner < 4; ++corner)
    {
      double index[3];
      double world[3];
      for (int a = 0; a < 3; ++a)
      {
        index[a] = target->GetExtent()[2 * a] + (corner == a + 1 ? 1 : 0);
      }
      target->TransformContinuousIndexToPhysicalPoint(index, world);
      vtkLightTransportImage::WorldToIndex(image, world, index);
      IndexMap& map = prepared.Source.map;
      for (int a = 0; a < 3; ++a)
      {
        if (corner == 0)
        {
          map.offset[a] = index[a];
        }
        else
        {
          map.column[corner - 1][a] = index[a] - map.offset[a];
        }
      }
    }
  }
  return {};
}
} // namespace

//------------------------------------------------------------------------------
std::string vtkLightSeedFilter::Compute(vtkImageData* input, vtkImageData* painted,
  vtkPolyData* strokes, vtkImageData* fluence, vtkImageData* output)
{
  namespace image = vtkLightTransportImage;
  std::ostringstream text;
  std::string problem = image::Problem(input);
  if (problem.empty())
  {
    problem = this->FindParameterProblem();
  }
  if (!problem.empty())
  {
    return problem;
  }
  const vtkIdType strokeCount =
    strokes ? strokes->GetNumberOfVerts() + strokes->GetNumberOfLines() : 0;
  if (this->Spheres.empty() && strokeCount == 0 && !painted && !fluence)
  {
    return "fewer than one source: 0 spheres, 0 strokes, no painted image, no earlier fluence, "
           "expected at least one of them";
  }

  // 1. Spheres.
  const Grid grid = image::GridOf(input);
  std::vector<SphereSource> spheres;
  for (int i = 0; i < this->GetNumberOfSpheres(); ++i)
  {
    const Sphere& sphere = this->Spheres[i];
    SphereSource source;
    source.radius = sphere.Radius;
    source.power = sphere.Power;
    const bool finite = IsFinite(sphere.Center) && std::isfinite(sphere.Power);
    if (!finite || !(sphere.Radius >= 0. && std::isfinite(sphere.Radius)))
    {
      text << "sphere " << i << " has the centre " << sphere.Center << ", the radius "
           << sphere.Radius << " and the power " << sphere.Power
           << ", expected finite values and a radius >= 0";
      return text.str();
    }
    image::WorldToIndex(input, sphere.Center.data(), source.center.data());
    if (!MeetsDomain(grid, source))
    {
      text << "sphere " << i << " at " << sphere.Center << " with the radius " << sphere.Radius
           << " lies outside the volume, expected it to meet " << image::DomainAsString(input);
      return text.str();
    }
    spheres.push_back(source);
  }

  // 3. Strokes.
  if (strokeCount > 0)
  {
    StrokeValues radii;
    StrokeValues powers;
    problem = FindValues(strokes, this->RadiusArrayName, this->DefaultStrokeRadius, radii);
    if (problem.empty())
    {
      problem = FindValues(strokes, this->PowerArrayName, this->DefaultStrokePower, powers);
    }
    if (problem.empty())
    {
      problem = PrepareStrokes(strokes, radii, powers, input, grid, spheres);
    }
    if (!problem.empty())
    {
      return problem;
    }
  }

  // 2. and 4. The images.
  PreparedImage prepared[2];
  if (painted)
  {
    vtkDataArray* array = nullptr;
    if (this->PaintedArrayName && *this->PaintedArrayName)
    {
      array = painted->GetPointData()->GetArray(this->PaintedArrayName);
    }
    else
    {
      array = painted->GetPointData()->GetArray(vtkLightTransportArrays::Source);
      array = array ? array : painted->GetPointData()->GetScalars();
    }
    if (!array)
    {
      text << "the painted image has no point array "
           << (this->PaintedArrayName && *this->PaintedArrayName
                  ? std::string("\"") + this->PaintedArrayName + "\""
                  : std::string("\"Source\" and no active scalars"))
           << ", expected its weights there";
      return text.str();
    }
    problem = PrepareImage(
      painted, array, "the painted image", this->PaintedGain,
      [gain = this->PaintedGain](double weight) { return gain * weight; }, input, prepared[0]);
  }
  if (fluence && problem.empty())
  {
    vtkDataArray* array = fluence->GetPointData()->GetArray(vtkLightTransportArrays::Fluence);
    if (!array)
    {
      return "the image for re-injection has no point array \"Fluence\", expected the output of "
             "vtkLightDiffusionFilter";
    }
    problem = PrepareImage(
      fluence, array, "the fluence for re-injection", this->ReinjectionGain,
      [gain = this->ReinjectionGain, threshold = this->ReinjectionThreshold](double phi)
      { return phi > threshold ? gain * phi : 0.; },
      input, prepared[1]);
  }
  if (!problem.empty())
  {
    return problem;
  }
  std::vector<ImageSource> images;
  for (const PreparedImage& one : prepared)
  {
    if (one.Source.transfer)
    {
      images.push_back(one.Source);
    }
  }

  // The sum.
  vtkNew<vtkFloatArray> q;
  q->SetName(vtkLightTransportArrays::Source);
  q->SetNumberOfTuples(input->GetNumberOfPoints());
  const SourceReport report = ComputeSources(grid, spheres, images, q->GetPointer(0),
    vtkLightTransportParallelFor(), image::Progress(this, 0., 1.));
  if (report.badSphere >= 0)
  {
    const bool isSphere = report.badSphere < this->GetNumberOfSpheres();
    text << (isSphere ? "sphere " + std::to_string(report.badSphere) : std::string("a stroke"))
         << " has the power " << spheres[report.badSphere].power << " in voxels of " << grid.spacing
         << ", expected a density that float32 can hold";
    return text.str();
  }
  if (report.badVoxel >= 0)
  {
    text << "the sources add up to more than " << LargestFloat << " at point " << report.badVoxel
         << ", expected a density that float32 can hold";
    return text.str();
  }
  if (report.cancelled)
  {
    return {}; // aborted: an empty output, no error
  }
  this->TotalPower = report.power;
  output->ShallowCopy(input);
  output->GetPointData()->AddArray(q);
  vtkNew<vtkDoubleArray> seeds;
  seeds->SetName(vtkLightTransportArrays::LightSeeds);
  seeds->SetNumberOfComponents(5);
  for (int i = 0; i < this->GetNumberOfSpheres(); ++i)
  {
    const SphereSource& sphere = spheres[i];
    const double tuple[5] = { sphere.center[0], sphere.center[1], sphere.center[2], sphere.radius,
      sphere.power };
    seeds->InsertNextTuple(tuple);
  }
  output->GetFieldData()->AddArray(seeds);
  return {};
}

//------------------------------------------------------------------------------
void vtkLightSeedFilter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Spheres: " << this->GetNumberOfSpheres() << "\n";
  for (const Sphere& sphere : this->Spheres)
  {
    os << indent.GetNextIndent() << "center " << sphere.Center << ", radius " << sphere.Radius
       << ", power " << sphere.Power << "\n";
  }
  const auto name = [](const char* text) { return text ? text : "(none)"; };
  os << indent << "PaintedGain: " << this->PaintedGain << "\n";
  os << indent << "PaintedArrayName: " << name(this->PaintedArrayName) << "\n";
  os << indent << "RadiusArrayName: " << name(this->RadiusArrayName) << "\n";
  os << indent << "PowerArrayName: " << name(this->PowerArrayName) << "\n";
  os << indent << "DefaultStrokeRadius: " << this->DefaultStrokeRadius << "\n";
  os << indent << "DefaultStrokePower: " << this->DefaultStrokePower << "\n";
  os << indent << "ReinjectionThreshold: " << this->ReinjectionThreshold << "\n";
  os << indent << "ReinjectionGain: " << this->ReinjectionGain << "\n";
  os << indent << "TotalPower: " << this->TotalPower << "\n";
}
