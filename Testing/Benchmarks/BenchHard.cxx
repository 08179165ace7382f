// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Hard media: the solver, which takes to aggregation (Core/Aggregation.h) where the multigrid
 * stalls, and the multigrid alone, in turn.
 *
 *   bench-hard [--data FOLDER] [--only NAME] [--repeat 3] [--threads 2] [--tolerance 1e-6]
 *     [--asked N]
 *
 * Prints a table of Markdown: medians of the repeats, set-up included, and the quotient's; at most
 * 500 iterations. "layers" are 300 random layered media of contrast 1e4 to 1e10, with holes and
 * voxels that are not cubes, at 1e-6 and 1e-8. --asked: instead, the longest time that the solve of
 * a labyrinth of N^3 voxels, aggregation's set-up and all, goes without asking its progress.
 * --data has thorax_ct.vti; without, no aorta.
 */
#include "FrugalScenes.h"

#include "Core/Diffusion.h"
#include "HardMedia.h"
#include "vtkLightTransportInternal.h"

#include "vtkDataArray.h"
#include "vtkImageData.h"
#include "vtkLightTransportArrays.h"
#include "vtkPointData.h"
#include "vtkSMPTools.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

using namespace lighttransport;

namespace
{
using Scene = testing::MediumAndSource<float>;

struct Result
{
  double seconds = 0., bytes = 0.;
  DiffusionReport report;
};

Result Solve(const Scene& scene, double tolerance, bool aggregation, const ParallelFor& loop)
{
  std::vector<double> phi(scene.q.size(), 0.);
  DiffusionControl control;
  control.tolerance = tolerance;
  control.aggregation = aggregation;
  const auto began = std::chrono::steady_clock::now();
  Result result;
  DiffusionSolver solver(loop);
  solver.setMedium(scene.medium());
  result.report = solver.solveSteady(scene.q.data(), phi.data(), control);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  result.bytes = static_cast<double>(result.report.bytes) / static_cast<double>(scene.grid.size());
  return result;
}

/** Rooms of `width` voxels a side, walls of one, doors in half of them. */
Scene Labyrinth(int n, int width, float wall, float sigma)
{
  Scene scene({ { n, n, n } }, { { 1., 1., 1. } });
  const int pitch = width + 1;
  const int rooms = (n + pitch - 1) / pitch;
  std::mt19937 random(3);
  std::vector<unsigned int> doors(static_cast<std::size_t>(rooms) * rooms * rooms);
  for (unsigned int& door : doors)
  {
    door = random() & 7u;
  }
  for (std::int64_t i = 0; i < scene.grid.size(); ++i)
  {
    const int at[3] = { static_cast<int>(i % n), static_cast<int>(i / n % n),
      static_cast<int>(i / n / n) };
    int walls = 0;
    int axis = 0;
    for (int d = 0; d < 3; ++d)
    {
      walls += at[d] % pitch == width;
      axis = at[d] % pitch == width ? d : axis;
    }
    const int room = at[0] / pitch + rooms * (at[1] / pitch + rooms * (at[2] / pitch));
    const bool open =
      walls == 0 || (walls == 1 && (doors[static_cast<std::size_t>(room)] >> axis & 1u));
    scene.D[static_cast<std::size_t>(i)] = open ? 1.f : wall;
    scene.sigma_a[static_cast<std::size_t>(i)] = sigma + (open ? 0.f : 0.1f);
  }
  const int middle = n / 2 / pitch * pitch;
  scene.q[scene.index(middle, middle, middle)] = 1.f;
  return scene;
}

Scene FromImage(vtkImageData* image)
{
  Scene scene({ { 1, 1, 1 } }, { { 1., 1., 1. } });
  image->GetDimensions(scene.grid.dims.data());
  image->GetSpacing(scene.grid.spacing.data());
  const auto read = [&](const char* name)
  {
    vtkDataArray* array = image->GetPointData()->GetArray(name);
    std::vector<float> values(static_cast<std::size_t>(scene.grid.size()));
    for (vtkIdType i = 0; i < static_cast<vtkIdType>(values.size()); ++i)
    {
      values[static_cast<std::size_t>(i)] = static_cast<float>(array->GetTuple1(i));
    }
    return values;
  };
  scene.D = read(vtkLightTransportArrays::DiffusionCoefficient);
  scene.sigma_a = read(vtkLightTransportArrays::Absorption);
  scene.q = read(vtkLightTransportArrays::Source);
  return scene;
}

double Median(std::vector<double> values)
{
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void Compare(const std::string& name, const Scene& scene, double tolerance, int repeat,
  const ParallelFor& loop)
{
  std::vector<double> ours, alone, quotients;
  Result one, two;
  for (int i = 0; i < repeat; ++i)
  {
    one = Solve(scene, tolerance, true, loop);
    two = Solve(scene, tolerance, false, loop);
    ours.push_back(one.seconds);
    alone.push_back(two.seconds);
    quotients.push_back(two.seconds / one.seconds);
  }
  const auto iterations = [](const Result& result)
  {
    return std::to_string(result.report.iterations) +
      (result.report.reason == StopReason::Converged
          ? ""
          : std::string(" (") + ToString(result.report.reason) + ")");
  };
  std::printf("| %s | %.0e | %s | %.3f | %.0f | %s | %.3f | %.0f | %.1f |\n", name.c_str(),
    tolerance, iterations(one).c_str(), Median(ours), one.bytes, iterations(two).c_str(),
    Median(alone), two.bytes, Median(quotients));
  std::fflush(stdout);
}

void CompareLayers(double tolerance, const ParallelFor& loop)
{
  int solved[2] = { 0, 0 };
  int most[2] = { 0, 0 };
  double seconds[2] = { 0., 0. };
  for (unsigned int seed = 0; seed < 300; ++seed)
  {
    const Scene scene = testing::Layers<float>(seed, 16 + static_cast<int>(seed % 12), 6.);
    for (int alone = 0; alone < 2; ++alone)
    {
      const Result result = Solve(scene, tolerance, alone == 0, loop);
      solved[alone] += result.report.reason == StopReason::Converged;
      most[alone] = std::max(most[alone], result.report.iterations);
      seconds[alone] += result.seconds;
    }
  }
  std::printf("| 300 layered media | %.0e | %d solved, at most %d | %.2f in all | | %d solved, at "
              "most %d | %.2f in all | | %.1f |\n",
    tolerance, solved[0], most[0], seconds[0], solved[1], most[1], seconds[1],
    seconds[1] / seconds[0]);
  std::fflush(stdout);
}
void LongestUnasked(int n, double tolerance, const ParallelFor& loop)
{
  const Scene scene = Labyrinth(n, 1, 1e-6f, 1e-4f);
  using Clock = std::chrono::steady_clock;
  Clock::time_point last = Clock::now();
  const Clock::time_point began = last;
  double longest = 0.;
  double at = 0.;
  const auto ask = [&](double)
  {
    const Clock::time_point here = Clock::now();
    const double passed = std::chrono::duration<double>(here - last).count();
    if (passed > longest)
    {
      longest = passed;
      at = std::chrono::duration<double>(here - began).count();
    }
    last = here;
    return true;
  };
  std::vector<double> phi(scene.q.size(), 0.);
  DiffusionControl control;
  control.tolerance = tolerance;
  control.maxIterations = 30;
  control.progress = ask;
  DiffusionSolver solver(loop);
  solver.setMedium(scene.medium(), ask);
  const DiffusionReport report = solver.solveSteady(scene.q.data(), phi.data(), control);
  ask(1.);
  std::printf("labyrinth of 1, walls 1e-6, %d³: %.1f s, %d iterations, %s, residual %.1e; longest "
              "time unasked %.0f ms, at %.1f s\n",
    n, std::chrono::duration<double>(Clock::now() - began).count(), report.iterations,
    ToString(report.reason), report.residual, 1e3 * longest, at);
}
} // namespace

int main(int argc, char* argv[])
{
  std::string data, only;
  int repeat = 3;
  int threads = 2;
  int asked = 0;
  double tolerance = 1e-6;
  for (int i = 1; i + 1 < argc; i += 2)
  {
    const std::string option = argv[i];
    const char* value = argv[i + 1];
    data = option == "--data" ? value : data;
    only = option == "--only" ? value : only;
    repeat = option == "--repeat" ? std::max(1, std::atoi(value)) : repeat;
    threads = option == "--threads" ? std::max(1, std::atoi(value)) : threads;
    asked = option == "--asked" ? std::atoi(value) : asked;
    tolerance = option == "--tolerance" ? std::atof(value) : tolerance;
  }
  vtkSMPTools::Initialize(threads);
  const ParallelFor loop = vtkLightTransportParallelFor();
  if (asked > 0)
  {
    LongestUnasked(asked, tolerance, loop);
    return 0;
  }
  const auto wanted = [&](const std::string& name) { return name.find(only) != std::string::npos; };
  std::printf(
    "| scene | tolerance | iterations | s | bytes per voxel | multigrid alone: iterations "
    "| s | bytes per voxel | times faster |\n|---|---|---|---|---|---|---|---|---|\n");
  if (wanted("aorta"))
  {
    if (const vtkSmartPointer<vtkImageData> image = frugal::Aorta(data))
    {
      Compare("thorax_ct, aorta, 256²·133", FromImage(image), tolerance, repeat, loop);
    }
  }
  if (wanted("winding"))
  {
    Compare(
      "one winding corridor, 33²·3", testing::WindingCorridor(33, 1e-6f), tolerance, repeat, loop);
    Compare("one winding corridor, 257²·3", testing::WindingCorridor(257, 1e-6f), tolerance, repeat,
      loop);
  }
  if (wanted("labyrinth"))
  {
    Compare(
      "labyrinth of 1, walls 1e-6, 96³", Labyrinth(96, 1, 1e-6f, 1e-4f), tolerance, repeat, loop);
    Compare(
      "labyrinth of 1, walls 1e-8, 96³", Labyrinth(96, 1, 1e-8f, 1e-6f), tolerance, repeat, loop);
    Compare(
      "labyrinth of 2, walls 1e-4, 96³", Labyrinth(96, 2, 1e-4f, 1e-3f), tolerance, repeat, loop);
    Compare(
      "labyrinth of 3, walls 1e-6, 96³", Labyrinth(96, 3, 1e-6f, 1e-4f), tolerance, repeat, loop);
  }
  if (wanted("tissue"))
  {
    Compare("tissue, contrast 1e4, 128³",
      FromImage(frugal::WithSeeds(frugal::Tissue(128, .99, 1e-4), { { 45., 51., 64., 2., 1. } })),
      tolerance, repeat, loop);
  }
  if (wanted("layers"))
  {
    CompareLayers(1e-6, loop);
    CompareLayers(1e-8, loop);
  }
  return 0;
}
