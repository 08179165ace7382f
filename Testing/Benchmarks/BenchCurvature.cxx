// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The numbers of Module/Documentation/curvature.md, as tables of Markdown:
 *
 *   bench-curvature [-n 256] [-D FOLDER_OF_MESHES]
 *
 * 1. time of vtkVolumeCurvatureFilter per voxel, by type, derivative scale and arrays
 *    asked for, against a pass that only reads the input and writes the outputs; its
 *    memory beyond these;
 * 2. time of vtkSurfaceCurvatureFilter and vtkCurvatures, and how rough they are, on
 *    the meshes found in the folder;
 *
 * medians of three runs. The exit code is 0 whatever the times are.
 */
#include "LightTransportTesting.h"

#include "vtkLightTransportArrays.h"
#include "vtkSurfaceCurvatureFilter.h"
#include "vtkVolumeCurvatureFilter.h"

#include "vtkCurvatures.h"
#include "vtkFloatArray.h"
#include "vtkIdList.h"
#include "vtkImageData.h"
#include "vtkMath.h"
#include "vtkNew.h"
#include "vtkPLYReader.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkSMPTools.h"
#include "vtkSmartPointer.h"
#include "vtkTriangle.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#if defined(__GLIBC__)
#include <malloc.h>
#endif

namespace
{
double medianSeconds(const std::function<void()>& work)
{
  std::vector<double> seconds;
  for (int run = 0; run < 3; ++run)
  {
    const auto begin = std::chrono::steady_clock::now();
    work();
    seconds.push_back(
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  std::sort(seconds.begin(), seconds.end());
  return seconds[1];
}

/** MiB of /proc/self/status; 0 where there is none. */
double memory(const std::string& name)
{
  std::ifstream file("/proc/self/status");
  std::string line;
  while (std::getline(file, line))
  {
    if (line.compare(0, name.size(), name) == 0)
    {
      return std::atof(line.c_str() + name.size() + 1) / 1024.;
    }
  }
  return 0.;
}

/** MiB at the peak of some work beyond what was there before. */
double peak(const std::function<void()>& work)
{
  std::ofstream("/proc/self/clear_refs") << "5";
  const double before = memory("VmRSS");
  work();
  return memory("VmHWM") - before;
}

/** A noisy ball, grey 0 to 200; a third of it missing where asked for. */
vtkSmartPointer<vtkImageData> makeVolume(int n, int type, bool holes = false)
{
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(n, n, n);
  image->AllocateScalars(type, 1);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-3., 3.);
  vtkDataArray* scalars = image->GetPointData()->GetScalars();
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    const vtkIdType at[3] = { i % n, i / n % n, i / n / n };
    const double x = double(at[0]) / n - .5;
    const double y = double(at[1]) / n - .5;
    const double z = double(at[2]) / n - .5;
    scalars->SetComponent(i, 0,
      100. - 90. * std::tanh(40. * (std::sqrt(x * x + y * y + z * z) - .3)) + uniform(random));
    if (holes && x < -1. / 6.)
    {
      scalars->SetComponent(i, 0, std::numeric_limits<double>::quiet_NaN());
    }
  }
  return image;
}

/** What any filter has to do: read the values, write fresh arrays. */
double floorSeconds(vtkImageData* image, int arrays)
{
  const vtkIdType size = image->GetNumberOfPoints();
  const auto* bytes = static_cast<const unsigned char*>(image->GetScalarPointer());
  const int bytesPerValue = image->GetScalarSize();
  return medianSeconds(
    [&]()
    {
      std::vector<vtkNew<vtkFloatArray>> out(static_cast<std::size_t>(arrays));
      std::vector<float*> values;
      for (auto& array : out)
      {
        array->SetNumberOfTuples(size);
        values.push_back(array->GetPointer(0));
      }
      vtkSMPTools::For(0, size, 1 << 16,
        [&](vtkIdType begin, vtkIdType end)
        {
          unsigned int sum = 0;
          for (vtkIdType i = begin * bytesPerValue; i < end * bytesPerValue; ++i)
          {
            sum += bytes[i];
          }
          for (float* array : values)
          {
            std::fill(array + begin, array + end, static_cast<float>(sum));
          }
        });
    });
}

void volumes(int n)
{
  std::printf(
    "\n%d^3 points, %d threads; ns per point\n\n", n, vtkSMPTools::GetEstimatedNumberOfThreads());
  std::printf("| type | scale/h | arrays | ns | bytes/point | the bytes alone, ns | quotient | MiB "
              "beyond the arrays |\n");
  std::printf("|---|---|---|---|---|---|---|---|\n");
  struct Case
  {
    const char* name;
    int type;
    double scale;
    bool all;
    bool holes;
  };
  const Case cases[] = { { "uint8", VTK_UNSIGNED_CHAR, 1., true, false },
    { "uint8", VTK_UNSIGNED_CHAR, 1., false, false },
    { "uint8", VTK_UNSIGNED_CHAR, 2., false, false }, { "int16", VTK_SHORT, 1., true, false },
    { "float32", VTK_FLOAT, 1., true, false },
    { "float32, a third missing", VTK_FLOAT, 1., true, true },
    { "float64", VTK_DOUBLE, 1., true, false }, { "float64", VTK_DOUBLE, 2., true, false } };
  for (const Case& c : cases)
  {
    auto image = makeVolume(n, c.type, c.holes);
    const auto update = [&]()
    {
      vtkNew<vtkVolumeCurvatureFilter> filter;
      filter->SetInputData(image);
      filter->SetDerivativeScale(c.scale);
      filter->SetComputePrincipalCurvatures(c.all);
      filter->SetComputeGaussianCurvature(c.all);
      filter->Update();
    };
    const double seconds = medianSeconds(update);
    const int arrays = c.all ? 4 : 1;
    const double least = floorSeconds(image, arrays);
    const double points = double(image->GetNumberOfPoints());
    const double beyond = peak(update) - 4. * arrays * points / (1 << 20);
    std::printf("| %s | %g | %s | %.1f | %d | %.2f | %.1f | %.1f |\n", c.name, c.scale,
      c.all ? "all four" : "mean", 1e9 * seconds / points, image->GetScalarSize() + 4 * arrays,
      1e9 * least / points, seconds / least, beyond);
    std::fflush(stdout);
  }
}

double quantile(std::vector<double> values, double fraction)
{
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(fraction * (values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/** |H(p) - median of H around p| times the mean edge: how rough a curvature is. */
std::vector<double> roughness(vtkPolyData* mesh, vtkDataArray* mean, double edge)
{
  std::vector<double> rough;
  vtkNew<vtkIdList> cells;
  vtkNew<vtkIdList> points;
  for (vtkIdType p = 0; p < mesh->GetNumberOfPoints(); ++p)
  {
    std::vector<double> around;
    mesh->GetPointCells(p, cells);
    for (vtkIdType c = 0; c < cells->GetNumberOfIds(); ++c)
    {
      mesh->GetCellPoints(cells->GetId(c), points);
      for (vtkIdType q = 0; q < points->GetNumberOfIds(); ++q)
      {
        if (points->GetId(q) != p)
        {
          around.push_back(mean->GetComponent(points->GetId(q), 0));
        }
      }
    }
    if (!around.empty())
    {
      rough.push_back(edge * std::abs(mean->GetComponent(p, 0) - quantile(around, .5)));
    }
  }
  return rough;
}

/** The integrals of K and of |K| over 4 pi: the former is 1 on what is closed as a sphere. */
std::array<double, 2> totals(vtkPolyData* mesh, vtkDataArray* gaussian)
{
  std::array<double, 2> sums{ { 0., 0. } };
  vtkNew<vtkIdList> points;
  for (vtkIdType c = 0; c < mesh->GetNumberOfCells(); ++c)
  {
    mesh->GetCellPoints(c, points);
    double corners[3][3];
    for (int i = 0; i < 3; ++i)
    {
      mesh->GetPoint(points->GetId(i), corners[i]);
    }
    const double area = vtkTriangle::TriangleArea(corners[0], corners[1], corners[2]);
    for (int i = 0; i < 3; ++i)
    {
      const double K = gaussian->GetComponent(points->GetId(i), 0);
      sums[0] += area / 3. * K / (4. * vtkMath::Pi());
      sums[1] += area / 3. * std::abs(K) / (4. * vtkMath::Pi());
    }
  }
  return sums;
}

void meshes(const std::string& folder)
{
  std::printf(
    "\nMeshes: time per point; |H| and its difference to the median of the points around, "
    "both times the mean edge; the integrals of K and |K|\n\n");
  std::printf(
    "| mesh | points | filter | us/point | |H| 50, 90, 99 %% | largest | roughness 50, 90, "
    "99 %% | K / 4 pi | |K| / 4 pi |\n|---|---|---|---|---|---|---|---|---|\n");
  for (const char* name : { "bunny.ply", "turbineblade.ply", "cortex_left.ply" })
  {
    vtkNew<vtkPLYReader> reader;
    reader->SetFileName((folder + "/" + name).c_str());
    reader->Update();
    vtkPolyData* mesh = reader->GetOutput();
    if (mesh->GetNumberOfPoints() == 0)
    {
      continue;
    }
    mesh->BuildLinks();
    double length = 0.;
    vtkIdType edges = 0;
    vtkNew<vtkIdList> points;
    for (vtkIdType c = 0; c < mesh->GetNumberOfCells(); ++c)
    {
      mesh->GetCellPoints(c, points);
      for (vtkIdType i = 0; i < points->GetNumberOfIds(); ++i, ++edges)
      {
        double a[3];
        double b[3];
        mesh->GetPoint(points->GetId(i), a);
        mesh->GetPoint(points->GetId((i + 1) % points->GetNumberOfIds()), b);
        length += std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
      }
    }
    const double edge = length / double(edges);
    for (int kind = 0; kind < 3; ++kind)
    {
      vtkSmartPointer<vtkPolyData> output;
      const double seconds = medianSeconds(
        [&]()
        {
          if (kind == 0)
          {
            vtkNew<vtkCurvatures> filter;
            filter->SetInputData(mesh);
            filter->SetCurvatureTypeToMean();
            filter->Update();
            output = filter->GetOutput();
          }
          else
          {
            vtkNew<vtkSurfaceCurvatureFilter> filter;
            filter->SetInputData(mesh);
            filter->SetRadius(kind == 1 ? 0. : 4. * edge);
            filter->Update();
            output = filter->GetOutput();
          }
        });
      vtkDataArray* mean = output->GetPointData()->GetArray(
        kind == 0 ? "Mean_Curvature" : vtkLightTransportArrays::MeanCurvature);
      std::vector<double> H;
      for (vtkIdType i = 0; i < mean->GetNumberOfTuples(); ++i)
      {
        H.push_back(edge * std::abs(mean->GetComponent(i, 0)));
      }
      const std::vector<double> rough = roughness(mesh, mean, edge);
      vtkNew<vtkCurvatures> stock;
      stock->SetInputData(mesh);
      stock->SetCurvatureTypeToGaussian();
      stock->Update();
      const std::array<double, 2> total = totals(mesh,
        kind == 0 ? stock->GetOutput()->GetPointData()->GetArray("Gauss_Curvature")
                  : output->GetPointData()->GetArray(vtkLightTransportArrays::GaussianCurvature));
      static const char* const names[3] = { "vtkCurvatures", "two rings", "radius 4 edges" };
      std::printf(
        "| %s | %lld | %s | %.2f | %.3f, %.3f, %.3f | %.3g | %.3f, %.3f, %.3f | %.2f | %.0f |\n",
        name, static_cast<long long>(mesh->GetNumberOfPoints()), names[kind],
        1e6 * seconds / double(mesh->GetNumberOfPoints()), quantile(H, .5), quantile(H, .9),
        quantile(H, .99), *std::max_element(H.begin(), H.end()), quantile(rough, .5),
        quantile(rough, .9), quantile(rough, .99), total[0], total[1]);
    }
  }
}
} // namespace

int main(int argc, char* argv[])
{
#if defined(__GLIBC__)
  mallopt(M_MMAP_THRESHOLD, 1 << 20); // arrays are fresh pages, in each run
#endif
  int n = 256;
  std::string folder;
  for (int i = 1; i + 1 < argc; i += 2)
  {
    const std::string option = argv[i];
    if (option == "-n")
    {
      n = std::max(8, std::atoi(argv[i + 1]));
    }
    else if (option == "-D")
    {
      folder = argv[i + 1];
    }
  }
  volumes(n);
  if (!folder.empty())
  {
    meshes(folder);
  }
  return 0;
}
