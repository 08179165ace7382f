// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkSurfaceCurvatureFilter: closed forms on irregular triangulations with the observed
// order, beside vtkCurvatures; units, strips and polygons, what is missing, bad input.
#include "LightTransportFilterTesting.h"

#include "vtkLightTransportArrays.h"
#include "vtkSurfaceCurvatureFilter.h"

#include "vtkCallbackCommand.h"
#include "vtkCellArray.h"
#include "vtkCurvatures.h"
#include "vtkFloatArray.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"

#include <array>
#include <cstdio>
#include <functional>
#include <limits>
#include <random>

using namespace lighttransport::testing;
using Filter = vtkSurfaceCurvatureFilter;

namespace
{
const double NaN = std::numeric_limits<double>::quiet_NaN();
const double Pi = 3.14159265358979323846;

struct Place
{
  std::array<double, 3> p;
  double k1, k2;
};
/** (u, v) in [0, 1)^2, v outward of u. */
using Surface = std::function<Place(double u, double v)>;

Place sphere(double u, double v)
{
  const double a = 2. * Pi * u;
  const double b = 2. * (v - 0.5);
  return { { { std::cos(b) * std::cos(a), std::cos(b) * std::sin(a), std::sin(b) } }, 1., 1. };
}
Place cylinder(double u, double v)
{
  const double a = 2. * Pi * u;
  return { { { std::cos(a), std::sin(a), 3. * v } }, 1., 0. };
}
Place torus(double u, double v)
{
  const double a = 2. * Pi * u;
  const double b = 2. * Pi * v;
  const double q = 2. + std::cos(b);
  return { { { q * std::cos(a), q * std::sin(a), std::sin(b) } }, 1., std::cos(b) / q };
}
Place saddle(double u, double v)
{
  // z = (x^2 - y^2) / 2: curvatures from its Monge form.
  const double x = 2. * u - 1.;
  const double y = 2. * v - 1.;
  const double w2 = 1. + x * x + y * y;
  const double mean = -((1. + y * y) - (1. + x * x)) / (2. * w2 * std::sqrt(w2));
  const double gaussian = -1. / (w2 * w2);
  const double root = std::sqrt(mean * mean - gaussian);
  return { { { x, y, 0.5 * (x * x - y * y) } }, mean + root, mean - root };
}

struct Mesh
{
  vtkSmartPointer<vtkPolyData> data;
  std::vector<double> k1, k2; ///< NaN at a rim
};

/** n x n points, moved at random within their cells, diagonals drawn at random. */
Mesh irregular(const Surface& surface, int n, bool aroundU, bool aroundV, double jitter, int m = 0)
{
  m = m ? m : n;
  std::mt19937 random(17);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  Mesh mesh;
  mesh.data = vtkSmartPointer<vtkPolyData>::New();
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkCellArray> cells;
  for (int j = 0; j < m; ++j)
  {
    for (int i = 0; i < n; ++i)
    {
      const double u = (i + jitter * uniform(random)) / (aroundU ? n : n - 1);
      const double v = (j + jitter * uniform(random)) / (aroundV ? m : m - 1);
      const Place place = surface(u, v);
      points->InsertNextPoint(place.p.data());
      const bool rim = (!aroundU && (i < 3 || i >= n - 3)) || (!aroundV && (j < 3 || j >= m - 3));
      mesh.k1.push_back(rim ? NaN : place.k1);
      mesh.k2.push_back(rim ? NaN : place.k2);
    }
  }
  for (int j = 0; j < (aroundV ? m : m - 1); ++j)
  {
    for (int i = 0; i < (aroundU ? n : n - 1); ++i)
    {
      const vtkIdType a = i + n * j;
      const vtkIdType b = (i + 1) % n + n * j;
      const vtkIdType c = (i + 1) % n + n * ((j + 1) % m);
      const vtkIdType d = i + n * ((j + 1) % m);
      const bool flip = jitter > 0. && uniform(random) > 0.;
      const vtkIdType first[3] = { a, b, flip ? d : c };
      const vtkIdType second[3] = { flip ? b : a, c, d };
      cells->InsertNextCell(3, first);
      cells->InsertNextCell(3, second);
    }
  }
  mesh.data->SetPoints(points);
  mesh.data->SetPolys(cells);
  return mesh;
}

vtkDataArray* arrayOf(vtkAlgorithm* filter, const char* name)
{
  return vtkPolyData::SafeDownCast(filter->GetOutputDataObject(0))->GetPointData()->GetArray(name);
}

struct Error
{
  double largest = 0., rms = 0.;
};

Error errorOf(const Mesh& mesh, vtkDataArray* mean, vtkDataArray* gaussian)
{
  Error error;
  int count = 0;
  for (std::size_t i = 0; mean && gaussian && i < mesh.k1.size(); ++i)
  {
    if (!std::isnan(mesh.k1[i]))
    {
      const double e =
        std::max(std::abs(mean->GetComponent(i, 0) - 0.5 * (mesh.k1[i] + mesh.k2[i])),
          std::abs(gaussian->GetComponent(i, 0) - mesh.k1[i] * mesh.k2[i]));
      error.largest = std::max(error.largest, e);
      error.rms += e * e;
      ++count;
    }
  }
  error.rms = std::sqrt(error.rms / std::max(count, 1));
  return error;
}

Error errorOfVtk(const Mesh& mesh)
{
  vtkNew<vtkCurvatures> curvatures[2];
  for (int c = 0; c < 2; ++c)
  {
    curvatures[c]->SetInputData(mesh.data);
    c == 0 ? curvatures[c]->SetCurvatureTypeToMean() : curvatures[c]->SetCurvatureTypeToGaussian();
    curvatures[c]->Update();
  }
  return errorOf(
    mesh, arrayOf(curvatures[0], "Mean_Curvature"), arrayOf(curvatures[1], "Gauss_Curvature"));
}

void orders(Suite& suite)
{
  struct Case
  {
    const char* name;
    Surface surface;
    bool aroundU, aroundV;
  };
  const Case cases[] = { { "sphere", sphere, true, false }, { "cylinder", cylinder, true, false },
    { "torus", torus, true, true }, { "saddle", saddle, false, false } };
  std::printf("surface   mesh       error of mean and Gaussian, rms (max), n = 24, 48, 96    order"
              "   vtkCurvatures at 96\n");
  for (const Case& c : cases)
  {
    for (double jitter : { 0., 0.7 })
    {
      Error errors[3];
      Error vtk;
      for (int level = 0; level < 3; ++level)
      {
        const Mesh mesh = irregular(c.surface, 24 << level, c.aroundU, c.aroundV, jitter);
        vtkNew<Filter> filter;
        filter->SetInputData(mesh.data);
        filter->Update();
        errors[level] = errorOf(mesh, arrayOf(filter, vtkLightTransportArrays::MeanCurvature),
          arrayOf(filter, vtkLightTransportArrays::GaussianCurvature));
        if (level == 2)
        {
          const Suite::WithoutTraps without;
          vtk = errorOfVtk(mesh);
          // The principal curvatures agree with mean and Gaussian.
          vtkDataArray* k1 = arrayOf(filter, vtkLightTransportArrays::PrincipalCurvature1);
          vtkDataArray* k2 = arrayOf(filter, vtkLightTransportArrays::PrincipalCurvature2);
          double difference = 0.;
          for (std::size_t i = 0; i < mesh.k1.size(); ++i)
          {
            if (!std::isnan(mesh.k1[i]))
            {
              // Where k1 = k2 their difference is the root of an error.
              difference = std::max(difference, std::abs(k1->GetComponent(i, 0) - mesh.k1[i]));
              difference = std::max(difference, std::abs(k2->GetComponent(i, 0) - mesh.k2[i]));
            }
          }
          LT_CHECK(suite, difference < 0.1);
        }
      }
      const double order = std::log2(errors[1].rms / errors[2].rms);
      std::printf("%-9s %-9s  %.5f (%.4f)  %.5f (%.4f)  %.5f (%.4f)  %5.2f   %.4f (%.3f)\n", c.name,
        jitter > 0. ? "irregular" : "regular", errors[0].rms, errors[0].largest, errors[1].rms,
        errors[1].largest, errors[2].rms, errors[2].largest, order, vtk.rms, vtk.largest);
      LT_CHECK(suite, order > 1.7);
      LT_CHECK(suite, errors[2].largest < 0.03);
      LT_CHECK(suite, jitter == 0. || errors[2].rms < 0.2 * vtk.rms);
    }
  }
}

void units(Suite& suite)
{
  const Mesh mesh = irregular(torus, 40, true, true, 0.7);
  vtkNew<Filter> filter;
  filter->SetInputData(mesh.data);
  filter->Update();
  for (double unit : { 1e-9, 1e9 })
  {
    vtkNew<vtkPolyData> scaled;
    scaled->DeepCopy(mesh.data);
    for (vtkIdType i = 0; i < scaled->GetNumberOfPoints(); ++i)
    {
      double p[3];
      mesh.data->GetPoint(i, p);
      scaled->GetPoints()->SetPoint(i, p[0] * unit, p[1] * unit, p[2] * unit);
    }
    vtkNew<Filter> other;
    other->SetInputData(scaled);
    other->Update();
    double error = 0.;
    for (vtkIdType i = 0; i < scaled->GetNumberOfPoints(); ++i)
    {
      error = std::max(error,
        std::abs(unit * arrayOf(other, vtkLightTransportArrays::MeanCurvature)->GetComponent(i, 0) -
          arrayOf(filter, vtkLightTransportArrays::MeanCurvature)->GetComponent(i, 0)));
    }
    LT_CHECK_NEAR(suite, error, 0., 1e-6);
  }
  // The other side: signs and order change, exactly.
  vtkNew<Filter> flipped;
  flipped->SetInputData(mesh.data);
  flipped->FlipNormalsOn();
  flipped->Update();
  bool same = true;
  for (vtkIdType i = 0; i < mesh.data->GetNumberOfPoints(); ++i)
  {
    same = same &&
      std::abs(arrayOf(filter, vtkLightTransportArrays::PrincipalCurvature1)->GetComponent(i, 0) +
        arrayOf(flipped, vtkLightTransportArrays::PrincipalCurvature2)->GetComponent(i, 0)) < 1e-5;
  }
  LT_CHECK(suite, same);
}

void cellsOfAllKinds(Suite& suite)
{
  // The same points as triangles, quadrilaterals and strips.
  const int n = 40;
  const Mesh mesh = irregular(torus, n, true, true, 0.);
  vtkNew<vtkCellArray> quads;
  vtkNew<vtkCellArray> strips;
  for (int j = 0; j < n; ++j)
  {
    strips->InsertNextCell(2 * (n + 1));
    for (int i = 0; i <= n; ++i)
    {
      strips->InsertCellPoint(i % n + n * ((j + 1) % n));
      strips->InsertCellPoint(i % n + n * j);
      if (i < n)
      {
        const vtkIdType ids[4] = { i + n * j, (i + 1) % n + n * j, (i + 1) % n + n * ((j + 1) % n),
          i + n * ((j + 1) % n) };
        quads->InsertNextCell(4, ids);
      }
    }
  }
  for (int kind = 0; kind < 2; ++kind)
  {
    vtkNew<vtkPolyData> data;
    data->SetPoints(mesh.data->GetPoints());
    kind == 0 ? data->SetPolys(quads) : data->SetStrips(strips);
    vtkNew<Filter> filter;
    filter->SetInputData(data);
    filter->Update();
    const Error error = errorOf(mesh, arrayOf(filter, vtkLightTransportArrays::MeanCurvature),
      arrayOf(filter, vtkLightTransportArrays::GaussianCurvature));
    LT_CHECK(suite, error.largest < 0.06); // second order: 0.035 at 48, as printed above
  }
}

void noise(Suite& suite)
{
  // A rough sphere: a larger radius averages.
  Mesh mesh = irregular(sphere, 96, true, false, 0.5);
  std::mt19937 random(2);
  std::normal_distribution<double> normal(1., 0.001);
  for (vtkIdType i = 0; i < mesh.data->GetNumberOfPoints(); ++i)
  {
    double p[3];
    mesh.data->GetPoint(i, p);
    const double r = normal(random);
    mesh.data->GetPoints()->SetPoint(i, r * p[0], r * p[1], r * p[2]);
  }
  double before = 0.;
  std::printf("a sphere of radius 1 with noise of 0.1 %%, edges of about 0.04\n");
  for (double radius : { 0., 0.15, 0.3 })
  {
    vtkNew<Filter> filter;
    filter->SetInputData(mesh.data);
    filter->SetRadius(radius);
    filter->Update();
    double sum = 0.;
    int count = 0;
    vtkDataArray* mean = arrayOf(filter, vtkLightTransportArrays::MeanCurvature);
    for (std::size_t i = 0; i < mesh.k1.size(); ++i)
    {
      // Away from the rim by the largest radius.
      double p[3];
      mesh.data->GetPoint(i, p);
      if (std::abs(p[2]) < 0.5)
      {
        sum += std::pow(mean->GetComponent(i, 0) - 1., 2.);
        ++count;
      }
    }
    const double rms = std::sqrt(sum / count);
    std::printf("radius %.2f: rms error of the mean curvature %.4f\n", radius, rms);
    LT_CHECK(suite, before == 0. || rms < before / 2.);
    before = rms;
  }
}

void missing(Suite& suite)
{
  Mesh mesh = irregular(sphere, 40, true, false, 0.3);
  const vtkIdType lost = 20 * 40 + 7;
  const vtkIdType alone = mesh.data->GetPoints()->InsertNextPoint(9., 9., 9.);
  mesh.data->GetPoints()->SetPoint(lost, NaN, 0., 0.);
  vtkNew<Filter> filter;
  filter->SetInputData(mesh.data);
  filter->ComputeGaussianCurvatureOff();
  filter->ComputePrincipalCurvaturesOff();
  filter->Update();
  LT_CHECK(suite, arrayOf(filter, vtkLightTransportArrays::GaussianCurvature) == nullptr);
  LT_CHECK(suite, arrayOf(filter, vtkLightTransportArrays::PrincipalCurvature1) == nullptr);
  vtkDataArray* mean = arrayOf(filter, vtkLightTransportArrays::MeanCurvature);
  LT_CHECK(suite, mean->GetComponent(lost, 0) == 0. && mean->GetComponent(alone, 0) == 0.);
  // Around the hole, and at the rim: one-sided, but still a sphere.
  double error = 0.;
  for (vtkIdType i = 0; i < alone; ++i)
  {
    error = i == lost ? error : std::max(error, std::abs(mean->GetComponent(i, 0) - 1.));
  }
  LT_CHECK_NEAR(suite, error, 0., 0.15);

  // A flat sheet, a single triangle, points on top of each other: numbers.
  vtkNew<vtkPolyData> data;
  vtkNew<vtkPoints> points;
  for (int i = 0; i < 12; ++i)
  {
    const int row = i / 2;
    points->InsertNextPoint(i < 3 ? i % 2 : 5., i < 3 ? row : 5., 0.);
  }
  vtkNew<vtkCellArray> cells;
  for (vtkIdType i = 0; i < 12; i += 3)
  {
    const vtkIdType ids[3] = { i, i + 1, i + 2 };
    cells->InsertNextCell(3, ids);
  }
  data->SetPoints(points);
  data->SetPolys(cells);
  filter->SetInputData(data);
  filter->Update();
  double range[2] = { 1., 1. };
  arrayOf(filter, vtkLightTransportArrays::MeanCurvature)->GetRange(range);
  LT_CHECK(suite, range[0] == 0. && range[1] == 0.);
}

/** Lines, points, degenerate triangles and a fin on an edge: numbers, and nothing changes far off.
 */
void untidy(Suite& suite)
{
  const int n = 48;
  const Mesh mesh = irregular(torus, n, true, true, 0.5);
  vtkNew<Filter> clean;
  clean->SetInputData(mesh.data);
  clean->Update();
  const Mesh other = irregular(torus, n, true, true, 0.5);
  vtkPolyData* data = other.data;
  const vtkIdType at = 5 + n * 5; // where it is untidy
  const vtkIdType size = data->GetNumberOfPoints();
  double p[3];
  data->GetPoint(at, p);
  const vtkIdType tip = data->GetPoints()->InsertNextPoint(p[0], p[1], p[2] + 0.5);
  const vtkIdType far = data->GetPoints()->InsertNextPoint(9., 9., 9.);
  vtkNew<vtkCellArray> cells;
  cells->DeepCopy(data->GetPolys());
  const vtkIdType degenerate[5][3] = { { at, at, at + 1 }, { at, at, at }, { at, at + 1, tip },
    { at + 1, at, tip }, { at, at + 1, at + 2 } };
  for (const auto& triangle : degenerate)
  {
    cells->InsertNextCell(3, triangle);
  }
  data->SetPolys(cells);
  vtkNew<vtkCellArray> lines;
  const vtkIdType line[3] = { 0, size / 2, far };
  lines->InsertNextCell(3, line);
  data->SetLines(lines);
  vtkNew<vtkCellArray> vertices;
  vertices->InsertNextCell(1, &far);
  data->SetVerts(vertices);
  vtkNew<vtkFloatArray> own;
  own->SetName("Own");
  own->SetNumberOfTuples(data->GetNumberOfPoints());
  own->Fill(3.);
  data->GetPointData()->AddArray(own);
  vtkNew<Filter> filter;
  filter->SetInputData(data);
  filter->Update();
  LT_CHECK(suite, filter->GetOutput()->GetPointData()->GetArray("Own") == own.Get());
  LT_CHECK(suite, filter->GetOutput()->GetNumberOfLines() == 1);
  for (const char* name :
    { vtkLightTransportArrays::PrincipalCurvature1, vtkLightTransportArrays::PrincipalCurvature2,
      vtkLightTransportArrays::MeanCurvature, vtkLightTransportArrays::GaussianCurvature })
  {
    vtkDataArray* before = arrayOf(clean, name);
    vtkDataArray* after = arrayOf(filter, name);
    LT_CHECK(suite, after && after->GetNumberOfTuples() == size + 2);
    bool finite = true;
    double change = 0.;
    for (vtkIdType i = 0; i < size; ++i)
    {
      finite = finite && std::isfinite(after->GetComponent(i, 0));
      const int u = std::abs(int(i % n) - 5);
      const int v = std::abs(int(i / n) - 5);
      // Beyond three rings around the edge, the fit's two and the normals'.
      if (std::min(u, n - u) > 5 || std::min(v, n - v) > 5)
      {
        change = std::max(change, std::abs(after->GetComponent(i, 0) - before->GetComponent(i, 0)));
      }
    }
    LT_CHECK(suite, finite && std::isfinite(after->GetComponent(tip, 0)));
    LT_CHECK(suite, after->GetComponent(far, 0) == 0.); // in no polygon
    // The same fits, in lengths divided by a mesh of another size.
    LT_CHECK_NEAR(suite, change, 0., 1e-4);
  }
}

void checkPolyDataFails(Suite& suite, Filter* filter, const char* words, int line)
{
  const std::vector<std::string> errors = errorsOfUpdate(filter);
  suite.check(errors.size() == 1 && errors[0].find(words) != std::string::npos,
    std::string("one error with \"") + words + "\"", __FILE__, line);
  suite.check(filter->GetOutput()->GetNumberOfPoints() == 0, "an empty output", __FILE__, line);
}

void badInput(Suite& suite)
{
  vtkNew<Filter> filter;
  filter->SetInputData(vtkNew<vtkPolyData>());
  checkPolyDataFails(suite, filter, "no points", __LINE__);
  Mesh mesh = irregular(torus, 12, true, true, 0.);
  vtkNew<vtkPolyData> lines;
  lines->SetPoints(mesh.data->GetPoints());
  filter->SetInputData(lines);
  checkPolyDataFails(suite, filter, "no polygons", __LINE__);
  filter->SetInputData(mesh.data);
  filter->SetRadius(-1.);
  checkPolyDataFails(suite, filter, "Radius is -1", __LINE__);
  filter->SetRadius(NaN);
  checkPolyDataFails(suite, filter, "Radius is", __LINE__);
  filter->SetRadius(0.);
  filter->ComputeMeanCurvatureOff();
  filter->ComputeGaussianCurvatureOff();
  filter->ComputePrincipalCurvaturesOff();
  checkPolyDataFails(suite, filter, "expected one of them on", __LINE__);
  filter->ComputeMeanCurvatureOn();
  const vtkIdType ids[3] = { 0, 1, 144 };
  mesh.data->GetPolys()->InsertNextCell(3, ids);
  mesh.data->Modified();
  filter->Modified();
  checkPolyDataFails(suite, filter, "indices of 0 to 143", __LINE__);

  Mesh whole = irregular(torus, 48, true, true, 0.);
  filter->SetInputData(whole.data);
  vtkNew<vtkCallbackCommand> stop;
  stop->SetCallback(
    [](vtkObject* caller, unsigned long, void*, void*)
    {
      auto* algorithm = vtkAlgorithm::SafeDownCast(caller);
      if (algorithm->GetProgress() > 0.3)
      {
        algorithm->SetAbortExecute(1);
      }
    });
  filter->AddObserver(vtkCommand::ProgressEvent, stop);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());
  LT_CHECK(suite, filter->GetOutput()->GetNumberOfPoints() == 0);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  orders(suite);
  units(suite);
  cellsOfAllKinds(suite);
  noise(suite);
  missing(suite);
  untidy(suite);
  allowFloatingPointExceptions();
  badInput(suite);
  return suite.result();
}
