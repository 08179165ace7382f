// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Measures what Module/Documentation/visibility.md says:
 *
 *   bench-visibility [FOLDER [--data FOLDER] [SECTION ...]]
 *
 * leaving tables in FOLDER (Testing/Temporary of its build by default), with the sections (all by
 * default)
 *   times    seconds by size, order and number of directions, beside casting a ray per voxel
 *            and direction (as the kernel of a ray caster would: single precision, trilinear,
 *            a step per voxel), timed on a part of the voxels; visibility-times.csv; and the
 *            whole filter, with each of VTK's ways to run threads
 *   lights   milliseconds of the field of one known light
 *   rays     the error of v against rays cast in the same directions, by scene and resolution;
 *            visibility-rays.csv
 *   errors   the error of v read from the harmonics in other directions, by scene, order,
 *            directions and resolution, raw and through the window; visibility-errors.csv
 *   edge     the width of a shadow's edge by distance, beside short characteristics;
 *            visibility-edge.csv
 */
#include "Core/Visibility.h"
#include "LightTransportTesting.h"
#include "VisibilityReference.h"

#include "vtkDataArray.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkImageResize.h"
#include "vtkLightTransportArrays.h"
#include "vtkNIFTIImageReader.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkSMPTools.h"
#include "vtkVisibilityFactorFilter.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <random>
#include <string>
#include <vector>

using namespace lighttransport;

namespace
{
using Vector = std::array<double, 3>;
using Values = std::vector<float>;
const std::array<Vector, 3> Straight = { { { { 1., 0., 0. } }, { { 0., 1., 0. } },
  { { 0., 0., 1. } } } };

void parallel(std::int64_t n, const RangeBody& body)
{
  auto range = [&body](vtkIdType begin, vtkIdType end) { body(begin, end); };
  vtkSMPTools::For(0, n, range);
}

double now()
{
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct Scene
{
  std::string name;
  Grid grid;
  Values sigma_t;
};

Scene sample(const char* name, int n, const std::function<double(double, double, double)>& f)
{
  // Coordinates from -1 to 1; the domain is 2 long, whatever n.
  Scene scene{ name, { { { n, n, n } }, { { 2. / n, 2. / n, 2. / n } } }, {} };
  for (int k = 0; k < n; ++k)
  {
    for (int j = 0; j < n; ++j)
    {
      for (int i = 0; i < n; ++i)
      {
        scene.sigma_t.push_back(static_cast<float>(
          f((2. * i + 1.) / n - 1., (2. * j + 1.) / n - 1., (2. * k + 1.) / n - 1.)));
      }
    }
  }
  return scene;
}

/** The MR head on n^3 voxels, opacity rising from `low` to `high` grey. */
Scene head(const char* name, const std::string& data, int n, double low, double high, double alpha)
{
  Scene scene{ name, {}, {} };
  const std::string file = data + "/mr_head.nii.gz";
  if (data.empty() || !std::ifstream(file).good())
  {
    return scene;
  }
  vtkNew<vtkNIFTIImageReader> reader;
  reader->SetFileName(file.c_str());
  vtkNew<vtkImageResize> resize;
  resize->SetInputConnection(reader->GetOutputPort());
  resize->SetOutputDimensions(n, n, n);
  resize->Update();
  vtkImageData* image = resize->GetOutput();
  image->GetDimensions(scene.grid.dims.data());
  image->GetSpacing(scene.grid.spacing.data());
  vtkDataArray* scalars = image->GetPointData()->GetScalars();
  const double unit = 1.; // mm
  for (vtkIdType i = 0; i < scalars->GetNumberOfTuples(); ++i)
  {
    const double t = (scalars->GetComponent(i, 0) - low) / (high - low);
    scene.sigma_t.push_back(
      static_cast<float>(-std::log1p(-alpha * std::min(1., std::max(0., t))) / unit));
  }
  return scene;
}

std::vector<Scene> scenes(int n, const std::string& data)
{
  const double h = 2. / n;
  std::vector<Scene> all;
  all.push_back(sample("box", n, [](double, double, double) { return 1.; }));
  all.push_back(sample("ball", n,
    [h](double x, double y, double z)
    {
      const double r = std::sqrt(x * x + y * y + z * z);
      return 3. * std::min(1., std::max(0., (0.7 - r) / h + 0.5));
    }));
  all.push_back(sample("opaque ball", n,
    [h](double x, double y, double z)
    {
      const double r = std::sqrt(x * x + y * y + z * z);
      return 20. / h * std::min(1., std::max(0., (0.5 - r) / h + 0.5));
    }));
  all.push_back(sample("half-space", n, [](double x, double, double) { return x < 0. ? 2. : 0.; }));
  all.push_back(sample("thin occluder", n,
    [h](double x, double y, double z)
    {
      return std::abs(z - 0.5 * h) < 0.6 * h && std::max(std::abs(x), std::abs(y)) < 0.5 ? 5. / h
                                                                                         : 0.;
    }));
  all.push_back(sample("checkerboard", n,
    [](double x, double y, double z)
    {
      const auto cell = [](double t) { return static_cast<int>(std::floor(4. * (t + 1.))); };
      return (cell(x) + cell(y) + cell(z)) % 2 != 0 ? 2. : 0.;
    }));
  for (const Scene& scene : { head("head, translucent", data, n, 30., 100., 0.03),
         head("head, opaque skin", data, n, 30., 50., 0.9999) })
  {
    if (!scene.sigma_t.empty())
    {
      all.push_back(scene);
    }
  }
  return all;
}

/** Mean over blocks of factor^3 voxels (n is a multiple of it). */
Scene coarsened(const Scene& fine, int factor)
{
  Scene coarse = fine;
  for (int a = 0; a < 3; ++a)
  {
    coarse.grid.dims[a] = fine.grid.dims[a] / factor;
    coarse.grid.spacing[a] = fine.grid.spacing[a] * factor;
  }
  coarse.sigma_t.assign(coarse.grid.size(), 0.f);
  for (int k = 0; k < fine.grid.dims[2]; ++k)
  {
    for (int j = 0; j < fine.grid.dims[1]; ++j)
    {
      for (int i = 0; i < fine.grid.dims[0]; ++i)
      {
        coarse.sigma_t[coarse.grid.index(i / factor, j / factor, k / factor)] +=
          fine.sigma_t[fine.grid.index(i, j, k)] / static_cast<float>(factor * factor * factor);
      }
    }
  }
  return coarse;
}

/** Linear between the voxels of a grid that is `factor` coarser than the one of the index. */
double interpolated(const Grid& grid, const float* values, std::int64_t stride, int factor,
  const std::array<int, 3>& voxel)
{
  double sum = 0.;
  int low[3];
  double w[3];
  for (int a = 0; a < 3; ++a)
  {
    const double at = std::min(std::max((voxel[a] + 0.5) / factor - 0.5, 0.), grid.dims[a] - 1.);
    low[a] = std::min(static_cast<int>(at), grid.dims[a] - 2);
    w[a] = at - low[a];
  }
  for (int corner = 0; corner < 8; ++corner)
  {
    double weight = 1.;
    int at[3];
    for (int a = 0; a < 3; ++a)
    {
      const int high = (corner >> a) & 1;
      at[a] = low[a] + high;
      weight *= high ? w[a] : 1. - w[a];
    }
    if (weight > 0.)
    {
      sum += weight * static_cast<double>(values[stride * grid.index(at[0], at[1], at[2])]);
    }
  }
  return sum;
}

struct Error
{
  double sum = 0.;
  double squares = 0.;
  double worst = 0.;
  double outside = 0.; // beyond [0, 1]
  std::int64_t count = 0;
  void add(double value, double expected)
  {
    const double e = std::abs(value - expected);
    this->sum += e;
    this->squares += e * e;
    this->worst = std::max(this->worst, e);
    this->outside = std::max(this->outside, std::max(-value, value - 1.));
    ++this->count;
  }
  double mean() const { return this->sum / static_cast<double>(this->count); }
  double psnr() const
  {
    return -10. * std::log10(this->squares / static_cast<double>(this->count));
  }
};

/** A ray as a ray caster's kernel has it: single precision, a step per smallest spacing. */
float castFast(const Scene& scene, const std::array<int, 3>& voxel, const Vector& w)
{
  const Grid& grid = scene.grid;
  const double step = grid.smallestSpacing();
  float at[3];
  float d[3];
  int steps = 1 << 30;
  for (int a = 0; a < 3; ++a)
  {
    d[a] = static_cast<float>(w[a] * step / grid.spacing[a]);
    at[a] = static_cast<float>(voxel[a]) + 0.5f * d[a];
    const float room = d[a] > 0.f ? grid.dims[a] - 1.001f - at[a] : at[a];
    if (d[a] != 0.f)
    {
      steps = std::min(steps, static_cast<int>(std::max(0.f, room / std::abs(d[a]))));
    }
  }
  const std::int64_t dy = grid.dims[0];
  const std::int64_t dz = dy * grid.dims[1];
  float sum = 0.f;
  for (int s = 0; s < steps; ++s)
  {
    const int i = static_cast<int>(at[0]);
    const int j = static_cast<int>(at[1]);
    const int k = static_cast<int>(at[2]);
    const float x = at[0] - i;
    const float y = at[1] - j;
    const float z = at[2] - k;
    const float* p = scene.sigma_t.data() + grid.index(i, j, k);
    const auto line = [&](std::int64_t o) { return p[o] + x * (p[o + 1] - p[o]); };
    const auto plane = [&](std::int64_t o) { return line(o) + y * (line(o + dy) - line(o)); };
    sum += plane(0) + z * (plane(dz) - plane(0));
    for (int a = 0; a < 3; ++a)
    {
      at[a] += d[a];
    }
  }
  return std::exp(-sum * static_cast<float>(step));
}

double secondsOfSweeps(const Scene& scene, int order, int directions, int repeat)
{
  const DirectionSet set = MakeDirections(directions, 2 * order);
  Values sh(static_cast<std::size_t>(scene.grid.size()) * NumberOfHarmonics(order));
  std::vector<double> seconds;
  for (int r = 0; r < repeat; ++r)
  {
    const double began = now();
    VisibilitySH({ scene.grid, scene.sigma_t.data(), 0. }, Straight, set, order, sh.data(),
      NumberOfHarmonics(order), parallel, nullptr);
    seconds.push_back(now() - began);
  }
  std::sort(seconds.begin(), seconds.end());
  return seconds[seconds.size() / 2];
}

/** Casting rays from every `skip`th voxel, times `skip`; their projection is not counted. */
double secondsOfRays(const Scene& scene, int directions, int skip)
{
  const DirectionSet set = MakeDirections(directions, 0);
  const std::int64_t rows = static_cast<std::int64_t>(scene.grid.dims[1]) * scene.grid.dims[2];
  std::vector<float> sums(static_cast<std::size_t>(rows));
  const double began = now();
  parallel((rows + skip - 1) / skip,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t part = begin; part < end; ++part)
      {
        const std::int64_t row = std::min(part * skip + part % skip, rows - 1);
        const int j = static_cast<int>(row % scene.grid.dims[1]);
        const int k = static_cast<int>(row / scene.grid.dims[1]);
        float sum = 0.f;
        for (int i = 0; i < scene.grid.dims[0]; ++i)
        {
          for (const Vector& w : set.directions)
          {
            sum += castFast(scene, { { i, j, k } }, w);
          }
        }
        sums[static_cast<std::size_t>(row)] = sum;
      }
    });
  return (now() - began) * skip;
}

/** The MR head where it is there, else the checkerboard. */
Scene typical(int n, const std::string& data)
{
  Scene scene = head("head, translucent", data, n, 30., 100., 0.03);
  return scene.sigma_t.empty() ? scenes(n, data)[5] : scene;
}

void times(const std::string& folder, const std::string& data)
{
  std::ofstream csv(folder + "/visibility-times.csv");
  csv << "size,order,directions,seconds,rays\n";
  std::printf("\nSeconds of VisibilitySH on %d threads, medians of 5, beside rays in the same "
              "directions\n\n| size | order | directions | sweeps | ns per voxel and direction | "
              "rays | times faster |\n|---|---|---|---|---|---|---|\n",
    vtkSMPTools::GetEstimatedNumberOfThreads());
  struct Row
  {
    int size, order, directions, repeat;
  };
  double rays = 0.;
  int cast[2] = { 0, 0 };
  for (const Row& row :
    { Row{ 64, 0, 64, 5 }, Row{ 64, 2, 64, 5 }, Row{ 64, 4, 144, 5 }, Row{ 128, 2, 64, 5 },
      Row{ 128, 0, 64, 5 }, Row{ 128, 1, 64, 5 }, Row{ 128, 3, 64, 5 }, Row{ 128, 4, 64, 3 },
      Row{ 128, 2, 32, 5 }, Row{ 128, 2, 144, 3 }, Row{ 128, 4, 144, 3 }, Row{ 256, 2, 64, 1 } })
  {
    const Scene scene = typical(row.size, data);
    const double seconds = secondsOfSweeps(scene, row.order, row.directions, row.repeat);
    if (cast[0] != row.size || cast[1] != row.directions)
    {
      const int skip = row.size == 64 ? 16 : row.size == 128 ? 256 : 4096;
      rays = secondsOfRays(scene, row.directions, skip);
      cast[0] = row.size;
      cast[1] = row.directions;
    }
    const double work = static_cast<double>(scene.grid.size()) * row.directions;
    std::printf("| %d³ | %d | %d | %.3f | %.2f | %.1f | %.0f |\n", row.size, row.order,
      row.directions, seconds, 1e9 * seconds / work, rays, rays / seconds);
    std::fflush(stdout);
    csv << row.size << "," << row.order << "," << row.directions << "," << seconds << "," << rays
        << "\n";
  }
}

/** vtkVisibilityFactorFilter's own times, the memory of its result included. */
void filters(const std::string& data)
{
  std::printf(
    "\nSeconds of vtkVisibilityFactorFilter at 128³, order 2, 64 directions, medians of "
    "5\n\n| SMP back end | to the border | within a radius of 10 voxels |\n|---|---|---|\n");
  const Scene scene = typical(128, data);
  vtkNew<vtkImageData> image;
  image->SetDimensions(128, 128, 128);
  image->SetSpacing(scene.grid.spacing[0], scene.grid.spacing[1], scene.grid.spacing[2]);
  vtkNew<vtkFloatArray> sigma_t;
  sigma_t->SetName(vtkLightTransportArrays::Extinction);
  sigma_t->SetNumberOfTuples(image->GetNumberOfPoints());
  std::copy(scene.sigma_t.begin(), scene.sigma_t.end(), sigma_t->GetPointer(0));
  image->GetPointData()->AddArray(sigma_t);
  for (const char* backend : { "TBB", "STDThread", "Sequential" })
  {
    if (!vtkSMPTools::SetBackend(backend))
    {
      continue;
    }
    std::printf("| %s |", backend);
    for (const double radius : { 0., 10. * scene.grid.smallestSpacing() })
    {
      std::vector<double> seconds;
      for (int r = 0; r < 5; ++r)
      {
        vtkNew<vtkVisibilityFactorFilter> filter;
        filter->SetInputData(image);
        filter->SetRadius(radius);
        filter->Update();
        seconds.push_back(filter->GetHarmonicsSeconds());
      }
      std::sort(seconds.begin(), seconds.end());
      std::printf(" %.3f |", seconds[2]);
    }
    std::printf("\n");
  }
  vtkSMPTools::SetBackend("TBB");
}

void lights(const std::string& data)
{
  std::printf("\nMilliseconds of the field of one known light, best of 10\n\n"
              "| size | along x | along y | along z | oblique | at a place outside | inside |\n"
              "|---|---|---|---|---|---|---|\n");
  for (int n : { 64, 128, 256 })
  {
    const Scene scene = typical(n, data);
    const VisibilityMedium medium{ scene.grid, scene.sigma_t.data(), 0. };
    Values v(scene.sigma_t.size());
    std::printf("| %d³ |", n);
    const auto best = [&](const auto& run)
    {
      double least = 1e9;
      for (int r = 0; r < (n > 128 ? 3 : 10); ++r)
      {
        const double began = now();
        run();
        least = std::min(least, now() - began);
      }
      std::printf(" %.1f |", 1e3 * least);
    };
    for (const Vector& w : { Vector{ { 1., 0.1, 0.2 } }, Vector{ { 0.2, -1., 0.1 } },
           Vector{ { 0.1, 0.2, 1. } }, Vector{ { 1., 1., 1. } } })
    {
      best([&] { VisibilityTowards(medium, w, v.data(), 1, parallel, nullptr); });
    }
    const double side = n * scene.grid.spacing[0];
    for (const Vector& place : { Vector{ { -0.3 * side, 0.4 * side, 1.2 * side } },
           Vector{ { 0.3 * side, 0.4 * side, 0.5 * side } } })
    {
      best([&] { VisibilityTowardsPoint(medium, place, v.data(), 1, parallel, nullptr); });
    }
    std::printf("\n");
  }
}

/** Random voxels of a grid. */
std::vector<std::array<int, 3>> pick(const Grid& grid, int n, unsigned int seed)
{
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0., 0.999999);
  std::vector<std::array<int, 3>> voxels(static_cast<std::size_t>(n));
  for (std::array<int, 3>& voxel : voxels)
  {
    for (int a = 0; a < 3; ++a)
    {
      voxel[a] = static_cast<int>(uniform(random) * grid.dims[a]);
    }
  }
  return voxels;
}

Vector placeOf(const Grid& grid, const std::array<int, 3>& voxel)
{
  return { { voxel[0] * grid.spacing[0], voxel[1] * grid.spacing[1], voxel[2] * grid.spacing[2] } };
}

void rays(const std::string& folder, const std::string& data)
{
  std::ofstream csv(folder + "/visibility-rays.csv");
  csv << "scene,size,factor,mean,worst,psnr\n";
  std::printf("\nError of v against rays cast finely in the same 32 directions, 150 voxels each: "
              "mean, worst\n\n| scene | 32³ | 64³ | 128³ | 128³, factor 2 | 128³, factor 4 |\n"
              "|---|---|---|---|---|---|\n");
  const std::vector<Vector> set = MakeDirections(32, 0).directions;
  struct Column
  {
    int size, factor;
  };
  const Column columns[] = { { 32, 1 }, { 64, 1 }, { 128, 1 }, { 128, 2 }, { 128, 4 } };
  std::vector<std::string> lines;
  for (const Column& column : columns)
  {
    const std::vector<Scene> all = scenes(column.size, data);
    lines.resize(all.size());
    for (std::size_t s = 0; s < all.size(); ++s)
    {
      const Scene used = coarsened(all[s], column.factor);
      const std::vector<std::array<int, 3>> voxels = pick(all[s].grid, 150, 7);
      Error error;
      std::vector<float> v(used.sigma_t.size());
      std::vector<double> expected(voxels.size());
      for (const Vector& w : set)
      {
        VisibilityTowards(
          { used.grid, used.sigma_t.data(), 0. }, w, v.data(), 1, parallel, nullptr);
        parallel(static_cast<std::int64_t>(voxels.size()),
          [&](std::int64_t begin, std::int64_t end)
          {
            for (std::int64_t q = begin; q < end; ++q)
            {
              expected[q] = testing::castVisibility(
                all[s].grid, all[s].sigma_t.data(), placeOf(all[s].grid, voxels[q]), w, 0.2);
            }
          });
        for (std::size_t q = 0; q < voxels.size(); ++q)
        {
          error.add(interpolated(used.grid, v.data(), 1, column.factor, voxels[q]), expected[q]);
        }
      }
      char text[64];
      std::snprintf(text, sizeof(text), " %.4f, %.2f |", error.mean(), error.worst);
      lines[s] += text;
      csv << "\"" << all[s].name << "\"," << column.size << "," << column.factor << ","
          << error.mean() << "," << error.worst << "," << error.psnr() << "\n";
      if (column.factor == 4)
      {
        std::printf("| %s |%s\n", all[s].name.c_str(), lines[s].c_str());
      }
    }
  }
}

void errors(const std::string& folder, const std::string& data)
{
  constexpr int n = 64;
  std::ofstream csv(folder + "/visibility-errors.csv");
  csv << "scene,order,directions,factor,raw mean,raw worst,raw psnr,clamped mean,clamped psnr,"
         "window mean,window worst,window psnr,raw outside,window outside\n";
  std::printf(
    "\nError of v from the harmonics, %d³, at 120 voxels in 96 directions other than the "
    "swept ones: mean, worst (all of them in visibility-errors.csv)\n\n"
    "| scene | order | directions | factor | raw | raw, clamped | through the window | raw "
    "leaves [0, 1] by | windowed |\n|---|---|---|---|---|---|---|---|---|\n",
    n);
  // Other directions: turned about an axis.
  std::vector<Vector> seen;
  for (const Vector& w : MakeDirections(96, 0).directions)
  {
    seen.push_back({ { w[2], 0.6 * w[0] - 0.8 * w[1], 0.8 * w[0] + 0.6 * w[1] } });
  }
  struct Row
  {
    int order, directions, factor;
  };
  std::vector<Row> rows;
  for (int order = 0; order <= HighestVisibilityOrder; ++order)
  {
    for (int directions : { 16, 32, 48, 64, 96, 144 })
    {
      rows.push_back({ order, directions, 1 });
    }
    rows.push_back({ order, DefaultNumberOfDirections(order), 2 });
    rows.push_back({ order, DefaultNumberOfDirections(order), 4 });
  }
  for (const Scene& scene : scenes(n, data))
  {
    const std::vector<std::array<int, 3>> voxels = pick(scene.grid, 120, 3);
    std::vector<double> expected(voxels.size() * seen.size());
    parallel(static_cast<std::int64_t>(voxels.size()),
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t q = begin; q < end; ++q)
        {
          for (std::size_t d = 0; d < seen.size(); ++d)
          {
            expected[q * seen.size() + d] = testing::castVisibility(
              scene.grid, scene.sigma_t.data(), placeOf(scene.grid, voxels[q]), seen[d], 0.25);
          }
        }
      });
    for (const Row& row : rows)
    {
      const Scene used = coarsened(scene, row.factor);
      const int N = NumberOfHarmonics(row.order);
      Values sh(used.sigma_t.size() * N);
      VisibilitySH({ used.grid, used.sigma_t.data(), 0. }, Straight,
        MakeDirections(row.directions, 2 * row.order), row.order, sh.data(), N, parallel, nullptr);
      const std::vector<double> window = VisibilityWindow(row.order);
      Error raw;
      Error clamped;
      Error read;
      std::vector<double> c(static_cast<std::size_t>(N));
      std::vector<double> Y(static_cast<std::size_t>(N));
      for (std::size_t q = 0; q < voxels.size(); ++q)
      {
        for (int i = 0; i < N; ++i)
        {
          c[i] = interpolated(used.grid, sh.data() + i, N, row.factor, voxels[q]);
        }
        for (std::size_t d = 0; d < seen.size(); ++d)
        {
          SphericalHarmonics(row.order, seen[d], Y.data());
          double a = 0.;
          double b = 0.;
          for (int l = 0; l <= row.order; ++l)
          {
            for (int i = l * l; i < (l + 1) * (l + 1); ++i)
            {
              a += c[i] * Y[i];
              b += window[l] * c[i] * Y[i];
            }
          }
          raw.add(a, expected[q * seen.size() + d]);
          clamped.add(std::min(1., std::max(0., a)), expected[q * seen.size() + d]);
          read.add(b, expected[q * seen.size() + d]);
        }
      }
      csv << "\"" << scene.name << "\"," << row.order << "," << row.directions << "," << row.factor
          << "," << raw.mean() << "," << raw.worst << "," << raw.psnr() << "," << clamped.mean()
          << "," << clamped.psnr() << "," << read.mean() << "," << read.worst << "," << read.psnr()
          << "," << raw.outside << "," << read.outside << "\n";
      // The rest is in the file.
      const bool common =
        row.factor == 1 && (row.order == 2 || row.order == 4) && row.directions == 32 * row.order;
      const bool all = scene.name == "head, translucent" &&
        (row.order == 2 || row.directions == DefaultNumberOfDirections(row.order));
      if (common || (row.order == 4 && row.directions == 144 && row.factor == 1) || all)
      {
        std::printf("| %s | %d | %d | %d | %.3f, %.2f | %.3f | %.3f, %.2f | %.2f | %.0e |\n",
          scene.name.c_str(), row.order, row.directions, row.factor, raw.mean(), raw.worst,
          clamped.mean(), read.mean(), read.worst, std::max(0., raw.outside),
          std::max(0., read.outside));
      }
    }
    std::fflush(stdout);
  }
}

/** One sweep towards +z that interpolates v in the plane before: short characteristics. */
Values shortCharacteristics(const Scene& scene, double shift)
{
  const Grid& grid = scene.grid;
  const int nx = grid.dims[0];
  Values v(scene.sigma_t.size(), 1.f);
  const double length = std::sqrt(1. + shift * shift) * grid.spacing[2];
  for (int k = grid.dims[2] - 2; k >= 0; --k)
  {
    for (int j = 0; j < grid.dims[1]; ++j)
    {
      for (int i = 0; i < nx; ++i)
      {
        const double x = i + shift;
        const int low = std::min(std::max(static_cast<int>(std::floor(x)), 0), nx - 1);
        const int high = std::min(low + 1, nx - 1);
        const double w = std::min(std::max(x - low, 0.), 1.);
        const auto between = [&](const Values& from) {
          return (1. - w) * from[grid.index(low, j, k + 1)] + w * from[grid.index(high, j, k + 1)];
        };
        v[grid.index(i, j, k)] = static_cast<float>(between(v) *
          std::exp(-0.5 * length * (between(scene.sigma_t) + scene.sigma_t[grid.index(i, j, k)])));
      }
    }
  }
  return v;
}

void edge(const std::string& folder)
{
  std::ofstream csv(folder + "/visibility-edge.csv");
  csv << "distance,sheared,short\n";
  std::printf("\nWidth in voxels of the edge of an opaque half-plane's shadow (from 10 %% to 90 %% "
              "of v, averaged over slopes .05 to .95), by distance\n\n| distance, voxels | sheared "
              "lattice | short characteristics |\n|---|---|---|\n");
  Scene scene{ "edge", { { { 320, 1, 200 } }, { { 1., 1., 1. } } }, {} };
  scene.sigma_t.assign(scene.grid.size(), 0.f);
  for (int i = 250; i < 320; ++i)
  {
    scene.sigma_t[scene.grid.index(i, 0, 195)] = 100.f;
  }
  std::vector<int> distances = { 5, 10, 20, 40, 80, 120, 160 };
  std::vector<std::array<double, 2>> widths(distances.size());
  int slopes = 0;
  for (double shift = 0.05; shift < 1.; shift += 0.1)
  {
    Values fields[2] = { Values(scene.sigma_t.size()), shortCharacteristics(scene, shift) };
    VisibilityTowards({ scene.grid, scene.sigma_t.data(), 0. }, { { shift, 0., 1. } },
      fields[0].data(), 1, parallel, nullptr);
    ++slopes;
    for (std::size_t d = 0; d < distances.size(); ++d)
    {
      for (int f = 0; f < 2; ++f)
      {
        const auto at = [&](double level)
        {
          // v falls along x, over the edge at 250 - shift distance
          const float* row = fields[f].data() + scene.grid.index(0, 0, 195 - distances[d]);
          const int edgeAt = static_cast<int>(250 - shift * distances[d]);
          for (int i = std::max(edgeAt - 60, 0); i < edgeAt + 60; ++i)
          {
            if (row[i] >= level && row[i + 1] < level)
            {
              return i + (row[i] - level) / static_cast<double>(row[i] - row[i + 1]);
            }
          }
          return 0.;
        };
        widths[d][f] += at(0.1) - at(0.9);
      }
    }
  }
  for (std::size_t d = 0; d < distances.size(); ++d)
  {
    const double a = widths[d][0] / slopes;
    const double b = widths[d][1] / slopes;
    std::printf("| %d | %.2f | %.2f |\n", distances[d], a, b);
    csv << distances[d] << "," << a << "," << b << "\n";
  }
}
} // namespace

int main(int argc, char* argv[])
{
  std::string folder = lighttransport::testing::temporaryFolder(argv[0]);
  std::string data;
  std::vector<std::string> sections;
  for (int i = 1; i < argc; ++i)
  {
    const std::string argument = argv[i];
    if (argument == "--data" && i + 1 < argc)
    {
      data = argv[++i];
    }
    else if (i == 1)
    {
      folder = argument;
    }
    else
    {
      sections.push_back(argument);
    }
  }
  const auto wanted = [&](const char* name) {
    return sections.empty() || std::find(sections.begin(), sections.end(), name) != sections.end();
  };
  if (wanted("times"))
  {
    times(folder, data);
    filters(data);
  }
  if (wanted("lights"))
  {
    lights(data);
  }
  if (wanted("rays"))
  {
    rays(folder, data);
  }
  if (wanted("errors"))
  {
    errors(folder, data);
  }
  if (wanted("edge"))
  {
    edge(folder);
  }
  return 0;
}
