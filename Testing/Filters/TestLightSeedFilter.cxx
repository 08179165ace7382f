// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkLightSeedFilter: spheres in world space, paint, strokes, re-injection, bad input.
#include "LightTransportFilterTesting.h"

#include "vtkCallbackCommand.h"
#include "vtkCellArray.h"
#include "vtkCellData.h"
#include "vtkDoubleArray.h"
#include "vtkFloatArray.h"
#include "vtkLightSeedFilter.h"
#include "vtkLightTransportArrays.h"
#include "vtkMatrix3x3.h"
#include "vtkOpticalMediumFilter.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkRTAnalyticSource.h"
#include "vtkTrivialProducer.h"

#include <array>
#include <limits>

using namespace lighttransport::testing;
using Filter = vtkLightSeedFilter;
using Image = vtkSmartPointer<vtkImageData>;

namespace
{
const double NaN = std::numeric_limits<double>::quiet_NaN();
const double Infinity = std::numeric_limits<double>::infinity();
using Point = std::array<double, 3>;

double zero(int, int, int)
{
  return 0.;
}

/** 12 x 10 x 8 voxels, anisotropic, extents not from 0, turned if asked. */
Image scene(bool turned)
{
  Image image = makeImage(12, 10, 8, VTK_SHORT, zero);
  image->SetExtent(5, 16, -3, 6, 0, 7);
  image->SetSpacing(1., 0.5, 2.);
  image->SetOrigin(100., -20., 7.);
  if (turned)
  {
    image->SetDirectionMatrix(0., -1., 0., 0.6, 0., -0.8, 0.8, 0., 0.6);
  }
  return image;
}

vtkDataArray* qOf(vtkAlgorithm* filter)
{
  return pointArray(filter, vtkLightTransportArrays::Source);
}

double volumeOf(vtkImageData* image)
{
  const double* h = image->GetSpacing();
  return h[0] * h[1] * h[2];
}

/** World coordinates of continuous indices counted from the first voxel. */
Point world(vtkImageData* image, double i, double j, double k)
{
  const int* extent = image->GetExtent();
  const double index[3] = { i + extent[0], j + extent[2], k + extent[4] };
  Point point;
  image->TransformContinuousIndexToPhysicalPoint(index, point.data());
  return point;
}

vtkIdType at(int i, int j, int k)
{
  return i + 12 * (j + 10 * k);
}

double largestDifference(vtkDataArray* a, vtkDataArray* b)
{
  double difference = a && b && a->GetNumberOfTuples() == b->GetNumberOfTuples() ? 0. : Infinity;
  for (vtkIdType i = 0; difference < Infinity && i < a->GetNumberOfTuples(); ++i)
  {
    difference = std::max(difference, std::abs(a->GetComponent(i, 0) - b->GetComponent(i, 0)));
  }
  return difference;
}

void spheres(Suite& suite)
{
  vtkNew<vtkFloatArray> straight;
  for (bool turned : { false, true })
  {
    Image image = scene(turned);
    vtkNew<Filter> filter;
    filter->SetInputData(image);
    // One voxel (a radius below 0.25), a ball inside, and one that leaves the volume.
    LT_CHECK(suite, filter->AddSphere(world(image, 3.2, 4.1, 5.3).data(), 0.24, 6.) == 0);
    filter->Update();
    LT_CHECK_CLOSE(suite, qOf(filter)->GetComponent(at(3, 4, 5), 0), 6., 1e-6);
    LT_CHECK_CLOSE(suite, sumOf(qOf(filter)), 6., 1e-6);
    const Point ball = world(image, 7.3, 5.2, 3.9);
    LT_CHECK(suite, filter->AddSphere(ball[0], ball[1], ball[2], 1.7, -2.) == 1);
    LT_CHECK(suite, filter->AddSphere(world(image, 0., -1., 7.9).data(), 2.5, 1.) == 2);
    filter->Update();
    LT_CHECK_NEAR(suite, sumOf(qOf(filter)) * volumeOf(image), 5., 1e-5);
    LT_CHECK_NEAR(suite, filter->GetTotalPower(), 5., 1e-6);
    LT_CHECK(suite, qOf(filter)->GetDataType() == VTK_FLOAT);

    // Directions and offsets do not matter: distances do.
    if (turned)
    {
      const double largest = std::abs(straight->GetRange()[1]);
      LT_CHECK_NEAR(suite, largestDifference(straight, qOf(filter)), 0., 1e-5 * largest);
    }
    straight->DeepCopy(qOf(filter));

    // The grid and its arrays pass through.
    vtkImageData* output = filter->GetOutput();
    LT_CHECK(suite, output->GetPointData()->GetScalars() == image->GetPointData()->GetScalars());
    LT_CHECK(suite, std::equal(output->GetExtent(), output->GetExtent() + 6, image->GetExtent()));
    LT_CHECK(suite, output->GetDirectionMatrix()->GetElement(1, 0) == (turned ? 0.6 : 0.));
    LT_CHECK(suite, image->GetPointData()->GetNumberOfArrays() == 1);

    // Their list.
    LT_CHECK(suite, filter->GetNumberOfSpheres() == 3);
    Point center;
    filter->GetSphereCenter(1, center.data());
    LT_CHECK(suite, center == ball && filter->GetSphereRadius(1) == 1.7);
    LT_CHECK(suite, filter->GetSpherePower(1) == -2. && std::isnan(filter->GetSpherePower(3)));
    const vtkMTimeType time = filter->GetMTime();
    filter->SetSphere(1, ball.data(), 1.7, -2.);
    LT_CHECK(suite, filter->GetMTime() == time);
    filter->SetSphere(1, ball.data(), 1.7, 4.);
    filter->RemoveSphere(0);
    filter->Update();
    LT_CHECK_NEAR(suite, filter->GetTotalPower(), 5., 1e-6);
    LT_CHECK(suite, filter->GetSpherePower(0) == 4.);
    filter->RemoveAllSpheres();
    LT_CHECK_FAILS(suite, filter, "fewer than one source", "expected at least one");
  }

  // A seed may sit in a volume of one voxel, or of one slice.
  Image single = makeImage(1, 1, 1, VTK_FLOAT, zero);
  vtkNew<Filter> filter;
  filter->SetInputData(single);
  filter->AddSphere(0.2, 0.1, -0.4, 3., 5.);
  filter->Update();
  LT_CHECK(suite, qOf(filter)->GetComponent(0, 0) == 5.);

  // Many at once.
  Image large = makeImage(64, 64, 64, VTK_UNSIGNED_CHAR, zero);
  vtkNew<Filter> many;
  many->SetInputData(large);
  for (int n = 0; n < 5000; ++n)
  {
    many->AddSphere((n * 7) % 64, (n * 13) % 64, (n * 29) % 64, 1.5, 1.);
  }
  many->Update();
  LT_CHECK_NEAR(suite, many->GetTotalPower(), 5000., 1e-3);
}

void paint(Suite& suite)
{
  Image image = scene(true);
  vtkNew<Filter> filter;
  filter->SetInputData(image);
  LT_CHECK(suite, filter->GetPaintedImage() == nullptr);

  // The same grid: gain times weight, any type, on top of a sphere.
  Image painted = scene(true);
  painted->GetPointData()->GetScalars()->SetComponent(at(2, 3, 4), 0, -7.);
  painted->GetPointData()->GetScalars()->SetComponent(at(5, 3, 4), 0, 3.);
  filter->SetPaintedImageData(painted);
  filter->SetPaintedGain(0.5);
  filter->AddSphere(world(image, 2., 3., 4.).data(), 0., 1.);
  filter->Update();
  LT_CHECK(suite, filter->GetPaintedImage() == painted);
  LT_CHECK(suite, qOf(filter)->GetComponent(at(2, 3, 4), 0) == -2.5);
  LT_CHECK(suite, qOf(filter)->GetComponent(at(5, 3, 4), 0) == 1.5);
  LT_CHECK_NEAR(suite, filter->GetTotalPower(), -1., 1e-6);

  // Persistent painting: the output is the next painted image, by its Source array.
  Image kept = Image::Take(vtkImageData::New());
  kept->DeepCopy(filter->GetOutput());
  filter->SetPaintedImageData(kept);
  filter->SetPaintedGain(1.);
  filter->SetSphere(0, world(image, 8., 8., 1.).data(), 0., 2.);
  filter->Update();
  LT_CHECK(suite, qOf(filter)->GetComponent(at(2, 3, 4), 0) == -2.5);
  LT_CHECK(suite, qOf(filter)->GetComponent(at(8, 8, 1), 0) == 2.);
  // A named array instead.
  filter->SetPaintedArrayName("ImageScalars");
  filter->Update();
  LT_CHECK(suite, qOf(filter)->GetComponent(at(2, 3, 4), 0) == 0.);
  filter->SetPaintedArrayName("nothing");
  LT_CHECK_FAILS(suite, filter, "painted image", "\"nothing\"", "weights");
  filter->SetPaintedArrayName(nullptr);
  filter->SetPaintedImageData(nullptr);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());
  LT_CHECK_NEAR(suite, filter->GetTotalPower(), 2., 1e-6);

  // Another grid: axis-aligned in the world, finer, and larger than the volume. A weight that
  // is linear in the world is met at the voxels' centres.
  Image other = Image::Take(vtkImageData::New());
  other->SetExtent(-40, 40, -35, 45, 3, 79);
  other->SetSpacing(0.5, 0.5, 0.5);
  const Point middle = world(image, 5.5, 4.5, 3.5);
  other->SetOrigin(middle[0], middle[1] - 2.5, middle[2] - 20.5);
  vtkNew<vtkDoubleArray> weights;
  weights->SetNumberOfTuples(other->GetNumberOfPoints());
  for (vtkIdType n = 0; n < weights->GetNumberOfTuples(); ++n)
  {
    double p[3];
    other->GetPoint(n, p);
    weights->SetValue(n, 3. + 0.1 * (p[0] - middle[0]) - 0.2 * p[1] + 0.05 * p[2]);
  }
  other->GetPointData()->SetScalars(weights);
  filter->RemoveAllSpheres();
  filter->SetPaintedImageData(other);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());
  double worst = 0.;
  for (int k = 0; k < 8; ++k)
  {
    for (int j = 0; j < 10; ++j)
    {
      for (int i = 0; i < 12; ++i)
      {
        const Point p = world(image, i, j, k);
        const double expected = 3. + 0.1 * (p[0] - middle[0]) - 0.2 * p[1] + 0.05 * p[2];
        worst = std::max(worst, std::abs(qOf(filter)->GetComponent(at(i, j, k), 0) - expected));
      }
    }
  }
  LT_CHECK_NEAR(suite, worst, 0., 1e-5);
}

vtkSmartPointer<vtkPolyData> polyData(const std::vector<Point>& points, int verts)
{
  auto data = vtkSmartPointer<vtkPolyData>::New();
  vtkNew<vtkPoints> coordinates;
  coordinates->SetDataTypeToDouble();
  for (const Point& point : points)
  {
    coordinates->InsertNextPoint(point.data());
  }
  data->SetPoints(coordinates);
  vtkNew<vtkCellArray> lines;
  vtkNew<vtkCellArray> vertices;
  for (int v = 0; v < verts; ++v)
  {
    vertices->InsertNextCell(1);
    vertices->InsertCellPoint(v);
  }
  lines->InsertNextCell(static_cast<int>(points.size()) - verts);
  for (int p = verts; p < static_cast<int>(points.size()); ++p)
  {
    lines->InsertCellPoint(p);
  }
  data->SetVerts(vertices);
  data->SetLines(lines);
  return data;
}

void addArray(vtkDataSetAttributes* to, const char* name, const std::vector<double>& values)
{
  vtkNew<vtkDoubleArray> array;
  array->SetName(name);
  for (double value : values)
  {
    array->InsertNextValue(value);
  }
  to->AddArray(array);
}

void strokes(Suite& suite)
{
  Image image = scene(true);
  vtkNew<Filter> filter;
  filter->SetInputData(image);
  // Along the first axis, one voxel wide: the defaults.
  auto line =
    polyData({ world(image, 2., 3., 4.), world(image, 6., 3., 4.), world(image, 9., 3., 4.) }, 0);
  filter->SetStrokesData(line);
  filter->Update();
  LT_CHECK(suite, filter->GetStrokes() == line);
  LT_CHECK_NEAR(suite, filter->GetTotalPower(), 1., 1e-6);
  for (int i = 3; i < 9; ++i)
  {
    LT_CHECK_CLOSE(suite, qOf(filter)->GetComponent(at(i, 3, 4), 0), 1. / 7., 1e-5);
  }
  LT_CHECK(suite, qOf(filter)->GetComponent(at(5, 4, 4), 0) == 0.);

  // Arrays on points; other names; the defaults replaced.
  addArray(line->GetPointData(), "Power", { -3., -3., -3. });
  addArray(line->GetPointData(), "Radius", { 1., 0.5, 1. });
  line->Modified();
  filter->Update();
  LT_CHECK_NEAR(suite, filter->GetTotalPower(), -3., 1e-6);
  LT_CHECK(suite, qOf(filter)->GetComponent(at(3, 4, 4), 0) < 0.);
  filter->SetPowerArrayName("Watt");
  filter->SetRadiusArrayName("Reach");
  filter->SetDefaultStrokePower(4.);
  filter->SetDefaultStrokeRadius(0.7);
  filter->Update();
  LT_CHECK_NEAR(suite, filter->GetTotalPower(), 4., 1e-6);

  // On cells: the vertices are numbered first.
  auto both = polyData({ world(image, 1., 1., 1.), world(image, 2., 8., 1.),
                         world(image, 2., 3., 4.), world(image, 9., 3., 4.) },
    2);
  addArray(both->GetCellData(), "Watt", { 1., 2., 4. });
  addArray(both->GetCellData(), "Reach", { 0., 0., 0. });
  filter->SetStrokesData(both);
  filter->Update();
  LT_CHECK_NEAR(suite, filter->GetTotalPower(), 7., 1e-6);
  LT_CHECK_CLOSE(suite, qOf(filter)->GetComponent(at(1, 1, 1), 0), 1., 1e-6);
  LT_CHECK_CLOSE(suite, qOf(filter)->GetComponent(at(2, 8, 1), 0), 2., 1e-6);
  LT_CHECK_CLOSE(suite, qOf(filter)->GetComponent(at(5, 3, 4), 0), 4. / 7., 1e-5);

  // The part inside carries all; wholly outside is an error; so is a polydata without lines.
  auto leaving = polyData({ world(image, 2., 3., 4.), world(image, 60., 3., 4.) }, 0);
  filter->SetStrokesData(leaving);
  filter->Update();
  LT_CHECK_NEAR(suite, filter->GetTotalPower(), 4., 1e-6);
  filter->SetStrokesData(polyData({ world(image, 20., 3., 4.), world(image, 60., 3., 4.) }, 0));
  LT_CHECK_FAILS(suite, filter, "stroke 0", "outside", "expected it to meet");
  vtkNew<vtkPolyData> none;
  filter->SetStrokesData(none);
  LT_CHECK_FAILS(suite, filter, "fewer than one source", "0 strokes");
}

void reinjection(Suite& suite)
{
  Image image = scene(false);
  Image earlier = scene(false);
  vtkNew<vtkFloatArray> phi;
  phi->SetName(vtkLightTransportArrays::Fluence);
  phi->SetNumberOfTuples(earlier->GetNumberOfPoints());
  phi->Fill(0.);
  phi->SetValue(at(1, 2, 3), 5.f);
  phi->SetValue(at(2, 2, 3), 1.f);
  phi->SetValue(at(3, 2, 3), -8.f);
  earlier->GetPointData()->AddArray(phi);
  vtkNew<Filter> filter;
  filter->SetInputData(image);
  filter->SetFluenceData(earlier);
  filter->SetReinjectionGain(0.25);
  filter->SetReinjectionThreshold(1.);
  filter->Update();
  LT_CHECK(suite, filter->GetFluence() == earlier);
  LT_CHECK(suite, qOf(filter)->GetComponent(at(1, 2, 3), 0) == 1.25);
  LT_CHECK_NEAR(suite, sumOf(qOf(filter)), 1.25, 0.);
  filter->SetReinjectionThreshold(0.);
  filter->Update();
  LT_CHECK_NEAR(suite, sumOf(qOf(filter)), 1.5, 0.);
  filter->SetFluenceData(image);
  LT_CHECK_FAILS(suite, filter, "re-injection", "\"Fluence\"");
}

void pipeline(Suite& suite)
{
  // A changed seed: the medium is not made again, and its arrays are the same objects.
  vtkNew<vtkRTAnalyticSource> source;
  source->SetWholeExtent(-8, 9, -7, 8, -6, 9);
  vtkNew<vtkOpticalMediumFilter> medium;
  medium->SetInputConnection(source->GetOutputPort());
  vtkNew<Filter> seeds;
  seeds->SetInputConnection(medium->GetOutputPort());
  seeds->AddSphere(0., 0., 0., 2., 1.);
  int runs = 0;
  vtkNew<vtkCallbackCommand> counter;
  counter->SetClientData(&runs);
  counter->SetCallback(
    [](vtkObject*, unsigned long, void* client, void*) { ++*static_cast<int*>(client); });
  medium->AddObserver(vtkCommand::StartEvent, counter);
  seeds->Update();
  vtkDataArray* D = pointArray(seeds, vtkLightTransportArrays::DiffusionCoefficient);
  LT_CHECK(suite, runs == 1);
  LT_CHECK(suite, D && D == pointArray(medium, vtkLightTransportArrays::DiffusionCoefficient));
  for (int n = 0; n < 3; ++n)
  {
    seeds->SetSphere(0, double(n), 1., 2., 3., 4.);
    seeds->Update();
  }
  LT_CHECK(suite, runs == 1);
  LT_CHECK(suite, D == pointArray(seeds, vtkLightTransportArrays::DiffusionCoefficient));
  LT_CHECK_NEAR(suite, seeds->GetTotalPower(), 4., 1e-6);

  // Streamed: a part is asked for, the whole is made, painted image and fluence as well.
  vtkNew<vtkRTAnalyticSource> first;
  first->SetWholeExtent(-8, 9, -7, 8, -6, 9);
  vtkNew<vtkRTAnalyticSource> second;
  second->SetWholeExtent(-8, 9, -7, 8, -6, 9);
  vtkNew<Filter> part;
  part->SetInputConnection(first->GetOutputPort());
  part->SetPaintedImageConnection(second->GetOutputPort());
  const int some[6] = { 0, 2, -1, 1, 3, 3 };
  part->UpdateExtent(some);
  LT_CHECK(suite, part->GetOutput()->GetNumberOfPoints() == 18 * 16 * 16);
  LT_CHECK(suite, largestDifference(qOf(part), pointArray(second, "RTData")) == 0.);

  // Aborted: no error, nothing half done.
  vtkNew<vtkCallbackCommand> abort;
  abort->SetCallback(
    [](vtkObject* caller, unsigned long, void*, void* data)
    {
      if (*static_cast<double*>(data) > 0.3)
      {
        static_cast<vtkAlgorithm*>(caller)->SetAbortExecute(1);
      }
    });
  part->AddObserver(vtkCommand::ProgressEvent, abort);
  part->Modified();
  LT_CHECK(suite, errorsOfUpdate(part).empty());
  LT_CHECK(suite, part->GetOutput()->GetPointData()->GetNumberOfArrays() == 0);
}

void badInput(Suite& suite)
{
  Image image = scene(false);
  vtkNew<Filter> filter;
  filter->SetInputData(image);
  const Point inside = world(image, 3., 3., 3.);
  filter->AddSphere(inside.data(), 1., 1.);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());

  // Spheres: outside, not finite, a negative radius, a density that float32 cannot hold.
  filter->AddSphere(100., 50., 10., 2., 1.);
  LT_CHECK_FAILS(suite, filter, "sphere 1 at 100 50 10", "radius 2", "outside",
    "x 104.5 to 116.5, y -21.75 to -16.75, z 6 to 22");
  for (double bad : { NaN, Infinity })
  {
    filter->SetSphere(1, bad, inside[1], inside[2], 1., 1.);
    LT_CHECK_FAILS(suite, filter, "sphere 1", "finite");
    filter->SetSphere(1, inside.data(), bad, 1.);
    LT_CHECK_FAILS(suite, filter, "sphere 1", "radius", "finite");
    filter->SetSphere(1, inside.data(), 1., bad);
    LT_CHECK_FAILS(suite, filter, "sphere 1", "power", "finite");
  }
  filter->SetSphere(1, inside.data(), -1., 1.);
  LT_CHECK_FAILS(suite, filter, "sphere 1", "radius -1", ">= 0");
  filter->SetSphere(1, inside.data(), 0., 1e39);
  LT_CHECK_FAILS(suite, filter, "sphere 1", "1e+39", "float32");
  filter->SetSphere(1, inside.data(), 0., 3e38);
  filter->AddSphere(inside.data(), 0., 3e38);
  LT_CHECK_FAILS(suite, filter, "add up", "point", "float32");
  filter->RemoveSphere(2);
  filter->RemoveSphere(1);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());

  // An index that does not exist changes nothing.
  vtkNew<MessageLog> log;
  filter->AddObserver(vtkCommand::ErrorEvent, log);
  filter->SetSphere(1, inside.data(), 1., 1.);
  filter->RemoveSphere(-1);
  LT_CHECK(suite, log->messages.size() == 2 && filter->GetNumberOfSpheres() == 1);
  filter->RemoveObservers(vtkCommand::ErrorEvent);

  // Images: NaN and infinity, geometry, sizes, gains.
  for (double bad : { NaN, Infinity, -Infinity })
  {
    Image painted = makeImage(
      4, 4, 4, VTK_DOUBLE, [bad](int i, int j, int k) { return i + j + k == 9 ? bad : 1.; });
    painted->SetOrigin(world(image, 1., 1., 1.).data());
    filter->SetPaintedImageData(painted);
    LT_CHECK_FAILS(
      suite, filter, "painted image", std::isnan(bad) ? "NaN at point 63" : "infinity at point 63");
  }
  filter->SetPaintedImageData(makeImage(2, 2, 2, VTK_DOUBLE, [](int, int, int) { return 1e39; }));
  LT_CHECK_FAILS(suite, filter, "painted image", "1e+39", "float32");
  Image painted = makeImage(2, 2, 2, VTK_DOUBLE, [](int, int, int) { return 1e30; });
  filter->SetPaintedImageData(painted);
  filter->SetPaintedGain(-1e20);
  LT_CHECK_FAILS(suite, filter, "painted image", "gain of -1e+20", "float32");
  for (double bad : { NaN, Infinity })
  {
    filter->SetPaintedGain(bad);
    LT_CHECK_FAILS(suite, filter, "PaintedGain", "finite");
  }
  filter->SetPaintedGain(1.);
  painted->SetSpacing(1., 0., 1.);
  LT_CHECK_FAILS(suite, filter, "painted image", "spacing", "positive");
  vtkNew<vtkImageData> empty;
  filter->SetPaintedImageData(empty);
  LT_CHECK_FAILS(suite, filter, "painted image", "expected");
  vtkNew<vtkImageData> bare;
  bare->SetDimensions(2, 2, 2);
  filter->SetPaintedImageData(bare);
  LT_CHECK_FAILS(suite, filter, "painted image", "no point array", "weights");
  filter->SetPaintedImageData(nullptr);

  Image earlier = scene(false);
  vtkNew<vtkFloatArray> phi;
  phi->SetName(vtkLightTransportArrays::Fluence);
  phi->SetNumberOfTuples(earlier->GetNumberOfPoints());
  phi->Fill(1.);
  phi->SetValue(17, static_cast<float>(NaN));
  earlier->GetPointData()->AddArray(phi);
  filter->SetFluenceData(earlier);
  LT_CHECK_FAILS(suite, filter, "re-injection", "NaN at point 17");
  phi->SetNumberOfTuples(3);
  LT_CHECK_FAILS(suite, filter, "re-injection", "3 tuples", "960");
  filter->SetFluenceData(nullptr);
  filter->SetReinjectionGain(NaN);
  LT_CHECK_FAILS(suite, filter, "ReinjectionGain", "finite");
  filter->SetReinjectionGain(1.);
  filter->SetReinjectionThreshold(Infinity);
  LT_CHECK_FAILS(suite, filter, "ReinjectionThreshold", "finite");
  filter->SetReinjectionThreshold(0.);

  // Strokes.
  auto line = polyData({ inside, world(image, 6., 3., 4.) }, 0);
  filter->SetStrokesData(line);
  addArray(line->GetPointData(), "Power", { 1., NaN });
  LT_CHECK_FAILS(suite, filter, "stroke 0", "power", "finite");
  addArray(line->GetPointData(), "Power", { 1., 1. });
  addArray(line->GetPointData(), "Radius", { 1., -2. });
  line->Modified();
  LT_CHECK_FAILS(suite, filter, "stroke 0", "radius -2", ">= 0");
  filter->SetStrokesData(polyData({ inside, { { 0., Infinity, 0. } } }, 0));
  LT_CHECK_FAILS(suite, filter, "stroke 0", "point at 0 inf 0", "finite");
  auto broken = polyData({ inside, world(image, 6., 3., 4.) }, 0);
  addArray(broken->GetPointData(), "Radius", { 1. });
  filter->SetStrokesData(broken);
  LT_CHECK_FAILS(suite, filter, "\"Radius\"", "has 1 tuples", "expected 2");
  broken->GetPointData()->RemoveArray("Radius");
  const vtkIdType beyond[2] = { 0, 2 };
  broken->GetLines()->InsertNextCell(2, beyond);
  filter->Modified();
  LT_CHECK_FAILS(suite, filter, "stroke 1 names point 2", "0 to 1");
  filter->SetStrokesData(nullptr);
  filter->SetDefaultStrokeRadius(-1.);
  LT_CHECK_FAILS(suite, filter, "DefaultStrokeRadius", ">= 0");
  filter->SetDefaultStrokeRadius(0.);
  filter->SetDefaultStrokePower(NaN);
  LT_CHECK_FAILS(suite, filter, "DefaultStrokePower", "finite");
  filter->SetDefaultStrokePower(1.);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());

  // The grid itself.
  for (double bad : { 0., -1., NaN, Infinity })
  {
    Image other = scene(false);
    other->SetSpacing(1., 1., bad);
    filter->SetInputData(other);
    LT_CHECK_FAILS(suite, filter, "spacing", "positive finite");
  }
  filter->SetInputData(empty);
  LT_CHECK_FAILS(suite, filter, "empty", "at least one point");
  filter->SetInputData(image);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());
  LT_CHECK_NEAR(suite, filter->GetTotalPower(), 1., 1e-6);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  spheres(suite);
  paint(suite);
  strokes(suite);
  reinjection(suite);
  pipeline(suite);
  allowFloatingPointExceptions();
  badInput(suite);
  return suite.result();
}
