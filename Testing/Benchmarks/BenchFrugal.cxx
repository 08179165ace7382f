// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * What a solve that is no better than the scene requires costs, and how wrong it is, through the
 * filter as a user runs it:
 *
 *   bench-frugal [--output FOLDER] [--sections grid,region,filled,warm,cancel,target,budget,
 *     knobs] [--size 64] [--most 96] [--repeat 5] [--threads 2] [--data FOLDER] [--only WORD]
 *     [--seed 0] [--sizes 128,256] [--moments N] [--errors 0: times alone, of region]
 *
 *   target  SetTargetError over all scenes: is the target met, is the estimate near the truth?
 *   budget  SetTimeBudget over all scenes and four larger ones: is it kept, is the estimate right?
 *   grid    SetCoarseningFactor over all scenes: the error of a coarser grid
 *   region  an active region against the full solve: a tube, the aorta of thorax_ct, open matter
 *   filled  what the search for a region costs where light fills the volume, of --size
 *   warm    one seed of eight moved in a converged 128^3 field: 20 moves
 *   cancel  how soon a solve returns that is told to stop, at random moments, on grids of --sizes
 *   knobs   time against error for every knob, on two media
 *
 * "All scenes" are those that the estimate was tuned on, or, with --seed above 0, 40 others drawn
 * at random, held out.
 *
 * Prints tables of Markdown and leaves the numbers as CSV in FOLDER. Errors are against a solve on
 * the full grid to 1e-12 with the result in double: p95 is the 95th percentile of
 * |phi - phi*| / |phi*| over the voxels within six decades of the largest |phi*|, L2 the relative
 * Euclidean norm. Times are of the filter's Update(), medians of the repeats.
 */
#include "FrugalScenes.h"

#include "vtkLightDiffusionFilter.h"
#include "vtkLightSeedFilter.h"
#include "vtkLightTransportArrays.h"

#include "vtkCommand.h"
#include "vtkDataArray.h"
#include "vtkDataObject.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkNew.h"
#include "vtkObject.h"
#include "vtkPointData.h"
#include "vtkSMPTools.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

using namespace frugal;

namespace
{
struct Options
{
  std::string output; // build/dev/frugal, beside the folder of the program
  std::vector<std::string> sections{ "grid", "region", "filled", "warm", "cancel", "target",
    "budget", "knobs" };
  std::string data = "../shared/data";
  std::string only;
  int size = 64;
  int most = 96;
  int repeat = 5;
  int threads = 2;
  bool errors = true;                 // of section region: they take an exact solve
  int seed = 0;                       // of random scenes; 0: the fixed ones
  std::vector<int> sizes{ 128, 256 }; // of `cancel`
  int moments = -1;                   // of `cancel`; 120, 70 or 12, by the size
  bool has(const char* section) const
  {
    return std::find(this->sections.begin(), this->sections.end(), section) != this->sections.end();
  }
};

double now()
{
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double median(std::vector<double> values)
{
  if (values.empty())
  {
    return std::nan("");
  }
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

struct Errors
{
  double p95 = std::nan("");
  double l2 = std::nan("");
};

vtkDataArray* Fluence(vtkLightDiffusionFilter* filter)
{
  return filter->GetOutput()->GetPointData()->GetArray(vtkLightTransportArrays::Fluence);
}

std::vector<double> Values(vtkLightDiffusionFilter* filter)
{
  vtkDataArray* array = Fluence(filter);
  std::vector<double> values(array ? static_cast<std::size_t>(array->GetNumberOfTuples()) : 0);
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    values[i] = array->GetComponent(static_cast<vtkIdType>(i), 0);
  }
  return values;
}

Errors Compare(vtkLightDiffusionFilter* filter, const std::vector<double>& exact)
{
  const std::vector<double> phi = Values(filter);
  Errors errors;
  if (phi.size() != exact.size())
  {
    return errors;
  }
  double largest = 0.;
  for (const double v : exact)
  {
    largest = std::max(largest, std::abs(v));
  }
  std::vector<float> ratios;
  double wrong = 0.;
  double all = 0.;
  for (std::size_t i = 0; i < phi.size(); ++i)
  {
    const double e = std::abs(phi[i] - exact[i]);
    const double v = std::abs(exact[i]);
    wrong += e * e;
    all += v * v;
    if (v >= 1e-6 * largest && v > 0.)
    {
      ratios.push_back(static_cast<float>(e / v));
    }
  }
  if (!ratios.empty())
  {
    auto at = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() * 95 / 100);
    std::nth_element(ratios.begin(), at, ratios.end());
    errors.p95 = static_cast<double>(*at);
  }
  errors.l2 = all > 0. ? std::sqrt(wrong / all) : std::sqrt(wrong);
  return errors;
}

using Setter = std::function<void(vtkLightDiffusionFilter*)>;

struct Run
{
  double seconds = 0.;
  Errors errors;
  vtkSmartPointer<vtkLightDiffusionFilter> filter;
};

/** A new filter each time: nothing is kept from the last run. */
Run Solve(vtkImageData* scene, const Setter& set, int repeat, const std::vector<double>* exact,
  int boundary = vtkLightDiffusionFilter::Robin)
{
  Run run;
  std::vector<double> seconds;
  for (int i = 0; i < repeat; ++i)
  {
    run.filter = vtkSmartPointer<vtkLightDiffusionFilter>::New();
    run.filter->SetInputData(scene);
    run.filter->SetBoundary(boundary);
    set(run.filter);
    const double began = now();
    run.filter->Update();
    seconds.push_back(now() - began);
  }
  run.seconds = median(seconds);
  if (exact)
  {
    run.errors = Compare(run.filter, *exact);
  }
  return run;
}

std::vector<double> Exact(vtkImageData* scene, int boundary = vtkLightDiffusionFilter::Robin)
{
  const Run run = Solve(
    scene,
    [](vtkLightDiffusionFilter* f)
    {
      f->SetTolerance(1e-12);
      f->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
    },
    1, nullptr, boundary);
  return Values(run.filter);
}

/** Comma-separated values, each line on disk at once. */
class Table
{
public:
  Table(const Options& options, const char* name, const char* head)
    : file(options.output + "/" + name + ".csv")
  {
    this->file << head << std::endl;
  }
  template <class... Values>
  void add(const Values&... values)
  {
    std::ostringstream line;
    line.precision(9);
    const char* comma = "";
    ((line << comma << values, comma = ","), ...);
    this->file << line.str() << std::endl;
  }

private:
  std::ofstream file;
};

std::vector<Scene> Chosen(const Options& options)
{
  std::vector<Scene> chosen;
  for (Scene& scene : options.seed > 0
      ? RandomScenes(static_cast<unsigned>(options.seed), options.size, options.most, options.data)
      : Scenes(options.size, options.most, options.data))
  {
    if (scene.name.find(options.only) != std::string::npos)
    {
      chosen.push_back(scene);
    }
  }
  return chosen;
}

std::string Rounded(double value)
{
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::string Quoted(const std::string& text)
{
  return '"' + text + '"';
}

//------------------------------------------------------------------------------
void MeasureTargets(const Options& options)
{
  Table csv(options, "frugal-target",
    "scene,target,p95,l2,estimated,estimated_l2,seconds,default_seconds,factor,active,iterations,"
    "voxels,met,within_3");
  std::printf("\n## SetTargetError\n\n"
              "| scene | target | p95 | estimate | L2 | estimate | chosen: grid, region, "
              "iterations | s | default's s |\n|---|---|---|---|---|---|---|---|---|\n");
  struct Sum
  {
    int all = 0, met = 0, near = 0, near2 = 0;
    std::vector<double> quotients;
  };
  std::map<std::string, Sum> sums;
  int scenes = 0;
  for (Scene& scene : Chosen(options))
  {
    const vtkSmartPointer<vtkImageData> image = scene.make(scene.name);
    if (!image)
    {
      std::printf("| %s | no file | | | | | | | |\n", scene.name.c_str());
      continue;
    }
    ++scenes;
    const std::vector<double> exact = Exact(image, scene.boundary);
    const Run full = Solve(
      image, [](vtkLightDiffusionFilter*) {}, 1, nullptr, scene.boundary);
    for (const double target : { .3, .1, .03, .01, .001 })
    {
      const Run run = Solve(
        image, [&](vtkLightDiffusionFilter* f) { f->SetTargetError(target); }, 1, &exact,
        scene.boundary);
      vtkLightDiffusionFilter* f = run.filter;
      const double estimate = f->GetEstimatedError();
      const double estimate2 = f->GetEstimatedErrorL2();
      const bool hit = run.errors.p95 <= target;
      const bool close = estimate >= run.errors.p95 / 3. && estimate <= 3. * run.errors.p95;
      const bool close2 = estimate2 >= run.errors.l2 / 3. && estimate2 <= 3. * run.errors.l2;
      for (const std::string& of :
        { std::string("all"), std::string(scene.real ? "real" : "procedural"), Rounded(target) })
      {
        Sum& sum = sums[of];
        ++sum.all;
        sum.met += hit;
        sum.near += close;
        sum.near2 += close2;
        sum.quotients.push_back(full.seconds / run.seconds);
      }
      std::printf(
        "| %s | %g | %.1e%s | %.1e%s | %.1e | %.1e%s | 1/%d, %.0f %%, %d | %.3f | %.3f |\n",
        scene.name.c_str(), target, run.errors.p95, hit ? "" : " **missed**", estimate,
        close ? "" : " **off**", run.errors.l2, estimate2, close2 ? "" : " off",
        f->GetUsedCoarseningFactor(), 100. * f->GetActiveFraction(), f->GetNumberOfIterationsUsed(),
        run.seconds, full.seconds);
      csv.add(Quoted(scene.name), target, run.errors.p95, run.errors.l2, estimate, estimate2,
        run.seconds, full.seconds, f->GetUsedCoarseningFactor(), f->GetActiveFraction(),
        f->GetNumberOfIterationsUsed(), exact.size(), hit, close);
      std::fflush(stdout);
    }
  }
  std::printf("\n%d scenes.\n\n| solves | number | target met, %% | estimate within 3 of the p95, "
              "%% | of the L2, %% | times faster than the default |\n|---|---|---|---|---|---|\n",
    scenes);
  for (auto& [name, sum] : sums)
  {
    const double part = 100. / sum.all;
    std::printf("| %s | %d | %.1f | %.1f | %.1f | %.2f |\n", name.c_str(), sum.all, part * sum.met,
      part * sum.near, part * sum.near2, median(sum.quotients));
  }
  std::fflush(stdout);
}

struct Place
{
  std::string name;
  std::function<vtkSmartPointer<vtkImageData>()> make;
};

std::vector<Place> Places(const Options& options)
{
  return { { "tube, 128³", [] { return Tube(128); } },
    { "thorax_ct, aorta, 256²·133", [&] { return Aorta(options.data); } },
    { "open, 128³", [] { return Open(128); } } };
}

void MeasureBudgets(const Options& options)
{
  Table csv(options, "frugal-budget",
    "scene,budget,seconds,p95,l2,estimated,estimated_l2,factor,active,iterations,voxels,within_3,"
    "kept,floor,message");
  std::printf("\n## SetTimeBudget\n\n"
              "| scene | budget, s | s | p95 | estimate | L2 | estimate | chosen: grid, region, "
              "iterations |\n|---|---|---|---|---|---|---|---|\n");
  struct Sum
  {
    int all = 0, kept = 0, below = 0, told = 0, guessed = 0, near = 0, near10 = 0, near2 = 0;
    double most = 0.;
  };
  std::map<std::string, Sum> sums;
  const auto measure = [&](const std::string& name, vtkImageData* image, int boundary,
                         const std::vector<double>& exact, double budget, int repeat)
  {
    const Run run = Solve(
      image, [&](vtkLightDiffusionFilter* f) { f->SetTimeBudget(budget); }, repeat, &exact,
      boundary);
    vtkLightDiffusionFilter* f = run.filter;
    const double estimate = f->GetEstimatedError();
    const double estimate2 = f->GetEstimatedErrorL2();
    const std::string message = f->GetMessage();
    const bool guess = message.find("guess") != std::string::npos;
    const bool below = message.find("below the floor") != std::string::npos;
    const auto within = [](double told, double truth, double factor)
    { return told >= truth / factor && told <= truth * factor; };
    const bool close = within(estimate, run.errors.p95, 3.);
    // Within 10 % or 10 ms of it.
    const bool kept = run.seconds <= budget + std::max(.1 * budget, .01);
    for (const std::string& of : { std::string("all"), Rounded(budget) + " s" })
    {
      Sum& sum = sums[of];
      ++sum.all;
      sum.kept += kept;
      sum.below += below;
      sum.guessed += guess;
      sum.told += !guess;
      sum.near += !guess && close;
      sum.near10 += !guess && within(estimate, run.errors.p95, 10.);
      sum.near2 += !guess && within(estimate2, run.errors.l2, 3.);
      sum.most = std::max(sum.most, below ? 0. : run.seconds - budget);
    }
    std::printf("| %s | %.3f | %.3f%s | %.1e | %.1e%s | %.1e | %.1e | 1/%d, %.0f %%, %d |\n",
      name.c_str(), budget, run.seconds,
      below    ? " (floor)"
        : kept ? ""
               : " **over**",
      run.errors.p95, estimate,
      guess     ? " (a guess)"
        : close ? ""
                : " **off**",
      run.errors.l2, estimate2, f->GetUsedCoarseningFactor(), 100. * f->GetActiveFraction(),
      f->GetNumberOfIterationsUsed());
    csv.add(Quoted(name), budget, run.seconds, run.errors.p95, run.errors.l2, estimate, estimate2,
      f->GetUsedCoarseningFactor(), f->GetActiveFraction(), f->GetNumberOfIterationsUsed(),
      exact.size(), close, kept, below, Quoted(message));
    std::fflush(stdout);
  };
  std::vector<Place> places = Places(options);
  places.push_back({ "tissue, 128³", [] {
                      return WithSeeds(Tissue(128, .99, 1e-4), { { 45., 51., 64., 2., 1. } });
                    } });
  for (const Place& place : places)
  {
    const vtkSmartPointer<vtkImageData> image =
      place.name.find(options.only) == std::string::npos ? nullptr : place.make();
    if (image)
    {
      const std::vector<double> exact = Exact(image);
      for (const double budget : { .05, .1, .2, .5, 1. })
      {
        measure(place.name, image, 0, exact, budget, 1);
      }
    }
  }
  for (Scene& scene : Chosen(options))
  {
    const vtkSmartPointer<vtkImageData> image = scene.make(scene.name);
    if (image)
    {
      const std::vector<double> exact = Exact(image, scene.boundary);
      for (const double budget : { .02, .05, .1, .2, .5, 1. })
      {
        measure(scene.name, image, scene.boundary, exact, budget, 1);
      }
    }
  }
  std::printf("\n| solves | number | budget kept (+10 %% or 10 ms), %% | below the floor, and said "
              "so | most beyond it, ms | a guess | else: estimate within 3 of the p95, %% | within "
              "10 | of the L2 within 3 |\n|---|---|---|---|---|---|---|---|---|\n");
  for (auto& [name, sum] : sums)
  {
    const double part = 100. / std::max(1, sum.told);
    std::printf("| %s | %d | %.1f | %d | %.0f | %d | %.1f | %.1f | %.1f |\n", name.c_str(), sum.all,
      100. * sum.kept / sum.all, sum.below, 1e3 * sum.most, sum.guessed, part * sum.near,
      part * sum.near10, part * sum.near2);
  }
  std::fflush(stdout);
}

//------------------------------------------------------------------------------
void MeasureGrids(const Options& options)
{
  Table csv(options, "frugal-grid", "scene,factor,seconds,p95,l2,estimated,bytes_per_voxel,voxels");
  std::printf("\n## SetCoarseningFactor\n\n"
              "| scene | s: 1, 2, 4 | p95: 2, 4 | estimated | L2: 2, 4 | bytes / voxel: 1, 2, 4 |\n"
              "|---|---|---|---|---|---|\n");
  for (Scene& scene : Chosen(options))
  {
    const vtkSmartPointer<vtkImageData> image = scene.make(scene.name);
    if (!image)
    {
      continue;
    }
    const std::vector<double> exact = Exact(image, scene.boundary);
    const double voxels = static_cast<double>(exact.size());
    Run runs[3];
    for (int i = 0; i < 3; ++i)
    {
      const int factor = 1 << i;
      runs[i] = Solve(
        image, [&](vtkLightDiffusionFilter* f) { f->SetCoarseningFactor(factor); }, options.repeat,
        &exact, scene.boundary);
      csv.add(Quoted(scene.name), factor, runs[i].seconds, runs[i].errors.p95, runs[i].errors.l2,
        runs[i].filter->GetEstimatedError(),
        static_cast<double>(runs[i].filter->GetBytes()) / voxels, exact.size());
    }
    std::printf(
      "| %s | %.3f, %.3f, %.3f | %.2g, %.2g | %.2g, %.2g | %.2g, %.2g | %.0f, %.0f, %.0f |\n",
      scene.name.c_str(), runs[0].seconds, runs[1].seconds, runs[2].seconds, runs[1].errors.p95,
      runs[2].errors.p95, runs[1].filter->GetEstimatedError(), runs[2].filter->GetEstimatedError(),
      runs[1].errors.l2, runs[2].errors.l2,
      static_cast<double>(runs[0].filter->GetBytes()) / voxels,
      static_cast<double>(runs[1].filter->GetBytes()) / voxels,
      static_cast<double>(runs[2].filter->GetBytes()) / voxels);
    std::fflush(stdout);
  }
}

//------------------------------------------------------------------------------
void MeasureRegions(const Options& options)
{
  Table csv(options, "frugal-region",
    "scene,run,seconds,p95,l2,active,iterations,applications,times_faster,voxels");
  std::printf("\n## SetActiveRegion\n\n"
              "| scene | run | s | times faster | p95 | L2 | active | iterations | bytes / voxel "
              "|\n|---|---|---|---|---|---|---|---|---|\n");
  const std::vector<Place> places = Places(options);
  for (const Place& place : places)
  {
    if (place.name.find(options.only) == std::string::npos)
    {
      continue;
    }
    const vtkSmartPointer<vtkImageData> image = place.make();
    if (!image)
    {
      std::printf("| %s | no file | | | | | | | |\n", place.name.c_str());
      continue;
    }
    image->GetFieldData()->Initialize(); // KeepSolutions then solves for the sum
    const std::vector<double> exact = options.errors ? Exact(image) : std::vector<double>();
    const double voxels = static_cast<double>(image->GetNumberOfPoints());
    struct Way
    {
      const char* name;
      std::size_t against; // the way whose time is divided by this one's
      Setter set;
    };
    const auto to = [](double target, bool region) -> Setter
    {
      return [=](vtkLightDiffusionFilter* f)
      {
        f->SetTargetError(target);
        f->SetActiveRegion(region);
        f->SetKeepSolutions(!region); // then never on a region
      };
    };
    const Way ways[] = { { "full, tolerance 1e-8 (default)", 0, [](vtkLightDiffusionFilter*) {} },
      { "full, target 0.1 %", 0, to(.001, false) }, { "full, target 1 %", 0, to(.01, false) },
      { "region, tolerance 1e-8", 0, [](vtkLightDiffusionFilter* f) { f->SetActiveRegion(true); } },
      { "region, target 0.1 %", 1, to(.001, true) }, { "region, target 1 %", 2, to(.01, true) },
      { "target 1 %", 2, [](vtkLightDiffusionFilter* f) { f->SetTargetError(.01); } } };
    // In turn, so that quotients mean something on a busy machine.
    std::vector<std::vector<double>> seconds(std::size(ways));
    std::vector<std::vector<double>> quotients(std::size(ways));
    std::vector<Run> last(std::size(ways));
    for (int i = 0; i < options.repeat; ++i)
    {
      for (std::size_t w = 0; w < std::size(ways); ++w)
      {
        last[w] = Solve(
          image, ways[w].set, 1, options.errors && i + 1 == options.repeat ? &exact : nullptr);
        seconds[w].push_back(last[w].seconds);
        quotients[w].push_back(seconds[ways[w].against].back() / last[w].seconds);
      }
    }
    for (std::size_t w = 0; w < std::size(ways); ++w)
    {
      vtkLightDiffusionFilter* f = last[w].filter;
      std::printf("| %s | %s | %.3f | %.2f | %.1e | %.1e | %.1f %% | %d | %.0f |\n",
        place.name.c_str(), ways[w].name, median(seconds[w]), median(quotients[w]),
        last[w].errors.p95, last[w].errors.l2, 100. * f->GetActiveFraction(),
        f->GetNumberOfIterationsUsed(), static_cast<double>(f->GetBytes()) / voxels);
      csv.add(Quoted(place.name), Quoted(ways[w].name), median(seconds[w]), last[w].errors.p95,
        last[w].errors.l2, f->GetActiveFraction(), f->GetNumberOfIterationsUsed(),
        f->GetFineGridApplications(), median(quotients[w]), voxels);
    }
    std::fflush(stdout);
  }
  std::printf(
    "\nTimes faster: a region, and what a target chooses, than the solve on all voxels asked for "
    "the same; others than the full solve to 1e-8.\n");
}

//------------------------------------------------------------------------------
/** What it costs to find out that light fills the volume: a region must not cost more than 10 %. */
void MeasureFilled(const Options& options)
{
  Table csv(options, "frugal-filled", "scene,size,run,seconds,against,cost,active,iterations");
  std::printf(
    "\n## Light that fills the volume: the search for a region\n\n"
    "| scene | full, s | SetActiveRegion | active | full to 1 %%, s | SetTargetError(0.01) "
    "| active |\n|---|---|---|---|---|---|---|\n");
  const char* const names[] = { "blobs, albedo 0.99, 1 light", "blobs, albedo 0.999, 4",
    "layers, spacing 1 1 1, albedo 0.99", "labyrinth, corridors 6",
    "labyrinth, corridors 3, wall 1e", "noise over 2", "body, noise 1.5, albedo 0.99,",
    "constant D 1, sigma_a 0.001" };
  const int n = options.size;
  std::vector<Scene> scenes = { { "open matter", false, [n](std::string&) { return Open(n); } },
    { "tissue, albedo 0.999", false, [n](std::string&) {
       return WithSeeds(Tissue(n, .999, 1e-4), { { .35 * n, .4 * n, .5 * n, 2., 1. } });
     } } };
  for (Scene& scene : Scenes(n, 0, ""))
  {
    if (std::any_of(std::begin(names), std::end(names),
          [&](const char* name) { return scene.name.find(name) == 0; }))
    {
      scenes.push_back(scene);
    }
  }
  for (Scene& scene : scenes)
  {
    if (scene.name.find(options.only) == std::string::npos)
    {
      continue;
    }
    const vtkSmartPointer<vtkImageData> image = scene.make(scene.name);
    image->GetFieldData()->Initialize(); // KeepSolutions then solves for the sum
    const Setter ways[] = { [](vtkLightDiffusionFilter*) {},
      [](vtkLightDiffusionFilter* f) { f->SetActiveRegion(true); },
      [](vtkLightDiffusionFilter* f)
      {
        f->SetTargetError(.01);
        f->SetKeepSolutions(true); // never on a region
      },
      [](vtkLightDiffusionFilter* f) { f->SetTargetError(.01); } };
    // In turn, so that quotients mean something on a busy machine.
    std::vector<double> seconds[4], cost[4];
    Run last[4];
    for (int i = 0; i < options.repeat; ++i)
    {
      for (std::size_t w = 0; w < 4; ++w)
      {
        last[w] = Solve(image, ways[w], 1, nullptr);
        seconds[w].push_back(last[w].seconds);
        cost[w].push_back(last[w].seconds / seconds[w / 2 * 2].back() - 1.);
      }
    }
    const auto active = [&](int w) { return 100. * last[w].filter->GetActiveFraction(); };
    std::printf("| %s, %d³ | %.3f | %+.1f %% | %.1f %% | %.3f | %+.1f %% | %.1f %% |\n",
      scene.name.c_str(), n, median(seconds[0]), 100. * median(cost[1]), active(1),
      median(seconds[2]), 100. * median(cost[3]), active(3));
    for (std::size_t w = 0; w < 4; ++w)
    {
      csv.add(Quoted(scene.name), n, w, median(seconds[w]), median(seconds[w / 2 * 2]),
        median(cost[w]), last[w].filter->GetActiveFraction(),
        last[w].filter->GetNumberOfIterationsUsed());
    }
    std::fflush(stdout);
  }
  std::printf("\nMedians of what is added to the same solve without a search, in turn with it.\n");
}

//------------------------------------------------------------------------------
void MeasureWarmStarts(const Options& options)
{
  Table csv(options, "frugal-warm",
    "medium,move,seconds,pipeline_seconds,l2,p95,iterations,estimated,estimated_l2");
  std::printf("\n## One seed of eight moved in a converged 128³ field, 20 moves\n\n"
              "| medium | s, median (most) | with the seeds' filter | L2, median (most) | p95, "
              "median (most) | iterations |\n|---|---|---|---|---|---|\n");
  const double media[2][2] = { { .99, 1e-4 }, { .999, 1e-6 } };
  for (const auto& recipe : media)
  {
    const int n = 128;
    const vtkSmartPointer<vtkImageData> medium = Tissue(n, recipe[0], recipe[1]);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(.2 * n, .8 * n);
    vtkNew<vtkLightSeedFilter> seeds;
    seeds->SetInputData(medium);
    for (int i = 0; i < 8; ++i)
    {
      const double at[3] = { uniform(random), uniform(random), uniform(random) };
      seeds->AddSphere(at, 2., 1.);
    }
    vtkNew<vtkLightDiffusionFilter> warm;
    warm->SetInputConnection(seeds->GetOutputPort());
    warm->SetContinue(true);
    warm->Update(); // converged, to the default tolerance
    vtkNew<vtkLightDiffusionFilter> full;
    full->SetInputConnection(seeds->GetOutputPort());
    full->SetContinue(true);
    full->SetTolerance(1e-10);
    full->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
    std::vector<double> seconds, pipeline, l2, p95, iterations;
    for (int move = 0; move < 20; ++move)
    {
      const double at[3] = { uniform(random), uniform(random), uniform(random) };
      // As a user drags: from a field converged to the default tolerance.
      warm->SetTargetError(0.);
      warm->Update();
      seeds->SetSphere(move % 8, at, 2., 1.);
      warm->SetTargetError(.01);
      const double began = now();
      seeds->Update();
      const double seeded = now();
      warm->Update();
      const double ended = now();
      full->Update();
      const Errors errors = Compare(warm, Values(full));
      seconds.push_back(ended - seeded);
      pipeline.push_back(ended - began);
      l2.push_back(errors.l2);
      p95.push_back(errors.p95);
      iterations.push_back(warm->GetNumberOfIterationsUsed());
      csv.add(Quoted("tissue, albedo " + std::to_string(recipe[0])), move, seconds.back(),
        pipeline.back(), errors.l2, errors.p95, iterations.back(), warm->GetEstimatedError(),
        warm->GetEstimatedErrorL2());
    }
    const auto most = [](const std::vector<double>& v)
    { return *std::max_element(v.begin(), v.end()); };
    std::printf(
      "| albedo %g, contrast %.0e | %.4f (%.4f) | %.4f | %.1e (%.1e) | %.1e (%.1e) | %.0f "
      "|\n",
      recipe[0], 1. / recipe[1], median(seconds), most(seconds), median(pipeline), median(l2),
      most(l2), median(p95), most(p95), median(iterations));
    std::fflush(stdout);
  }
}

//------------------------------------------------------------------------------
/** One way of solving, as MeasureCancelling stops it. */
struct Way
{
  std::string name;
  Setter set;
  bool random = false; ///< stopped at random moments, besides having its questions timed
};

/** Asks to stop once it is wished; the longest time between two questions. */
class Watcher : public vtkCommand
{
public:
  static Watcher* New() { return new Watcher; }
  void begin()
  {
    this->last = now();
    this->longest = 0.;
    this->where = 0.;
  }
  void end(double fraction) { this->tick(fraction); }
  void Execute(vtkObject* caller, unsigned long, void*) override
  {
    auto* algorithm = static_cast<vtkAlgorithm*>(caller);
    this->tick(algorithm->GetProgress());
    if (this->wish)
    {
      algorithm->SetAbortExecute(1);
    }
  }
  std::atomic<bool> wish{ false };
  double longest = 0., where = 0.;

private:
  void tick(double fraction)
  {
    const double at = now();
    if (at - this->last > this->longest)
    {
      this->longest = at - this->last;
      this->where = fraction;
    }
    this->last = at;
  }
  double last = 0.;
};

/**
 * How long after a wish to stop is a solve over? At moments drawn at random, and by the longest
 * time that it goes without asking, in every way of solving.
 */
void MeasureCancelling(const Options& options)
{
  Table csv(options, "frugal-cancel", "way,voxels,asked,took");
  std::printf(
    "\n## Cancelling: ms until a solve from darkness returns, at moments drawn at random\n\n"
    "| size, way | a whole solve, s | longest time unasked, ms (at progress) | stopped | "
    "median | 95 %% | most | with a finite field |\n|---|---|---|---|---|---|---|---|\n");
  const auto steps = [](int mode, int number)
  {
    return [=](vtkLightDiffusionFilter* f)
    {
      f->SetMode(mode);
      f->SetNumberOfSteps(number);
    };
  };
  using Filter = vtkLightDiffusionFilter;
  std::mt19937 random(static_cast<unsigned>(7 + options.seed));
  for (const int n : options.sizes)
  {
    const vtkSmartPointer<vtkImageData> image =
      WithSeeds(Tissue(n, .99, 1e-4), { { .35 * n, .4 * n, .5 * n, 2., 1. } });
    const std::vector<Way> ways{
      { "steady", [](Filter*) {}, true },
      { "explicit", steps(Filter::Explicit, 40), true },
      { "steady, Flux", [](Filter* f) { f->ComputeFluxOn(); } },
      { "local steps",
        [&](Filter* f)
        {
          steps(Filter::Explicit, 20)(f);
          f->LocalTimeStepOn();
        } },
      { "implicit",
        [&](Filter* f)
        {
          steps(Filter::Implicit, 2)(f);
          f->SetCourantNumber(1000.);
        } },
      { "implicit, second order",
        [&](Filter* f)
        {
          steps(Filter::Implicit, 2)(f);
          f->SetCourantNumber(1000.);
          f->SetImplicitScheme(Filter::SecondOrder);
        } },
      { "first moment",
        [&](Filter* f)
        {
          steps(Filter::Explicit, 10)(f);
          f->SetModel(Filter::FirstMoment);
        } },
      { "Perona-Malik",
        [&](Filter* f)
        {
          steps(Filter::Explicit, 20)(f);
          f->SetModel(Filter::AnisotropicDiffusion);
          f->SetInputArrayToProcess(
            0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, "DiffusionCoefficient");
        } },
      { "kept solutions", [](Filter* f) { f->KeepSolutionsOn(); } },
      { "coarser by 2", [](Filter* f) { f->SetCoarseningFactor(2); } },
      { "coarser by 4", [](Filter* f) { f->SetCoarseningFactor(4); } },
      { "active region", [](Filter* f) { f->ActiveRegionOn(); } },
      { "target 1e-2", [](Filter* f) { f->SetTargetError(.01); } },
      { "budget 0.1 s", [](Filter* f) { f->SetTimeBudget(.1); } },
      { "budget 2 s", [](Filter* f) { f->SetTimeBudget(2.); } },
    };
    for (const Way& way : ways)
    {
      if (way.name.find(options.only) == std::string::npos ||
        (n > 300 && way.name != "steady" && way.name != "explicit"))
      {
        continue;
      }
      const auto solve = [&](vtkLightDiffusionFilter* filter, Watcher* watcher)
      {
        filter->SetInputData(image);
        way.set(filter);
        filter->AddObserver(vtkCommand::ProgressEvent, watcher);
        watcher->begin();
        filter->Update();
        watcher->end(2.);
      };
      std::vector<double> whole, longest;
      double where = 0.;
      for (int i = 0; i < std::min(3, options.repeat); ++i)
      {
        vtkNew<vtkLightDiffusionFilter> filter;
        vtkNew<Watcher> watcher;
        const double began = now();
        solve(filter, watcher);
        whole.push_back(now() - began);
        if (longest.empty() || watcher->longest > *std::max_element(longest.begin(), longest.end()))
        {
          where = watcher->where;
        }
        longest.push_back(watcher->longest);
      }
      const double seconds = median(whole);
      std::vector<double> took;
      int shown = 0;
      int cancelled = 0;
      const int moments = !way.random ? 0
        : options.moments >= 0        ? options.moments
        : n <= 128                    ? 120
        : n <= 256                    ? 70
                                      : 12;
      std::uniform_real_distribution<double> moment(0., seconds);
      for (int i = 0; i < 2 * moments && cancelled < moments; ++i)
      {
        vtkNew<vtkLightDiffusionFilter> filter;
        vtkNew<Watcher> watcher;
        double asked = 0.;
        const double wait = moment(random);
        std::thread user(
          [&]
          {
            std::this_thread::sleep_for(std::chrono::duration<double>(wait));
            asked = now();
            watcher->wish = true;
          });
        solve(filter, watcher);
        const double ended = now();
        user.join();
        if (filter->GetStopReason() == vtkLightDiffusionFilter::Cancelled)
        {
          ++cancelled;
          took.push_back(1e3 * (ended - asked));
          csv.add(Quoted(way.name), std::int64_t(n) * n * n, wait, 1e-3 * took.back());
          auto* field = vtkFloatArray::SafeDownCast(Fluence(filter));
          shown += field && field->GetNumberOfTuples() == image->GetNumberOfPoints() &&
            std::all_of(field->GetPointer(0), field->GetPointer(0) + field->GetNumberOfTuples(),
              [](float v) { return std::isfinite(v); });
        }
      }
      std::sort(took.begin(), took.end());
      std::printf("| %d³, %s | %.3f | %.0f (%.2f) | %d | %.0f | %.0f | %.0f | %d |\n", n,
        way.name.c_str(), seconds, 1e3 * *std::max_element(longest.begin(), longest.end()), where,
        cancelled, median(took), took.empty() ? 0. : took[(took.size() - 1) * 95 / 100],
        took.empty() ? 0. : took.back(), shown);
      std::fflush(stdout);
    }
  }
}

//------------------------------------------------------------------------------
void MeasureKnobs(const Options& options)
{
  Table csv(
    options, "frugal-knobs", "scene,knob,value,seconds,p95,l2,estimated,bytes_per_voxel,voxels");
  std::printf(
    "\n## Time against error, every knob, 128³\n\n"
    "| scene | knob | value | s | p95 | L2 | bytes / voxel |\n|---|---|---|---|---|---|---|\n");
  const int n = 2 * options.size;
  struct Place
  {
    std::string name;
    vtkSmartPointer<vtkImageData> image;
  };
  const vtkSmartPointer<vtkImageData> tissue = Tissue(n, .99, 1e-4);
  const Place places[] = { { "tissue", WithSeeds(tissue, { { .35 * n, .4 * n, .5 * n, 2., 1. } }) },
    { "tube", Tube(n) } };
  using Set = std::function<void(vtkLightDiffusionFilter*, double)>;
  struct Knob
  {
    const char* name;
    std::vector<double> values;
    Set set;
  };
  const Knob knobs[] = {
    { "Tolerance", { 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9 },
      [](vtkLightDiffusionFilter* f, double v) { f->SetTolerance(v); } },
    { "TargetError", { .3, .1, .03, .01, 3e-3, 1e-3, 1e-4 },
      [](vtkLightDiffusionFilter* f, double v) { f->SetTargetError(v); } },
    { "TimeBudget", { .02, .04, .08, .16, .32 },
      [](vtkLightDiffusionFilter* f, double v) { f->SetTimeBudget(v); } },
    { "CoarseningFactor", { 1., 2., 4. },
      [](vtkLightDiffusionFilter* f, double v) { f->SetCoarseningFactor(static_cast<int>(v)); } },
    { "ActiveThreshold", { 1e-4, 1e-5, 1e-6, 1e-7, 1e-8 },
      [](vtkLightDiffusionFilter* f, double v)
      {
        f->SetActiveRegion(true);
        f->SetActiveThreshold(v);
      } },
    { "OutputPrecision", { 0., 1. },
      [](vtkLightDiffusionFilter* f, double v) { f->SetOutputPrecision(static_cast<int>(v)); } },
    { "ComputeFlux", { 0., 1. },
      [](vtkLightDiffusionFilter* f, double v) { f->SetComputeFlux(v > 0.); } },
  };
  for (const Place& place : places)
  {
    const std::vector<double> exact = Exact(place.image);
    for (const Knob& knob : knobs)
    {
      for (const double value : knob.values)
      {
        const Run run = Solve(
          place.image, [&](vtkLightDiffusionFilter* f) { knob.set(f, value); }, options.repeat,
          &exact);
        const double bytes =
          static_cast<double>(run.filter->GetBytes()) / static_cast<double>(exact.size());
        std::printf("| %s | %s | %g | %.3f | %.1e | %.1e | %.0f |\n", place.name.c_str(), knob.name,
          value, run.seconds, run.errors.p95, run.errors.l2, bytes);
        csv.add(place.name, knob.name, value, run.seconds, run.errors.p95, run.errors.l2,
          run.filter->GetEstimatedError(), bytes, exact.size());
        std::fflush(stdout);
      }
    }
  }
}

std::vector<std::string> split(const char* text)
{
  std::vector<std::string> parts;
  std::istringstream in(text);
  std::string part;
  while (std::getline(in, part, ','))
  {
    parts.push_back(part);
  }
  return parts;
}

bool Parse(int argc, char* argv[], Options& options)
{
  for (int i = 1; i + 1 < argc; i += 2)
  {
    const std::string option = argv[i];
    const char* value = argv[i + 1];
    if (option == "--output")
    {
      options.output = value;
    }
    else if (option == "--sections")
    {
      options.sections = split(value);
    }
    else if (option == "--data")
    {
      options.data = value;
    }
    else if (option == "--only")
    {
      options.only = value;
    }
    else if (option == "--size")
    {
      options.size = std::atoi(value);
    }
    else if (option == "--most")
    {
      options.most = std::atoi(value);
    }
    else if (option == "--repeat")
    {
      options.repeat = std::atoi(value);
    }
    else if (option == "--sizes")
    {
      options.sizes.clear();
      for (const std::string& size : split(value))
      {
        options.sizes.push_back(std::atoi(size.c_str()));
      }
    }
    else if (option == "--moments")
    {
      options.moments = std::atoi(value);
    }
    else if (option == "--seed")
    {
      options.seed = std::atoi(value);
    }
    else if (option == "--errors")
    {
      options.errors = std::atoi(value) != 0;
    }
    else if (option == "--threads")
    {
      options.threads = std::atoi(value);
    }
    else
    {
      return false;
    }
  }
  return argc % 2 == 1 && options.size >= 16 && options.most >= 16 && options.repeat > 0 &&
    options.threads > 0;
}
} // namespace

int main(int argc, char* argv[])
{
  Options options;
  if (!Parse(argc, argv, options))
  {
    std::fprintf(stderr,
      "usage: bench-frugal [--output FOLDER] [--sections "
      "grid,region,filled,warm,cancel,target,budget,knobs]\n"
      "  [--size 64] [--most 96] [--repeat 5] [--threads 2] [--data FOLDER] [--only WORD]\n"
      "  [--seed 0] [--sizes 128,256] [--moments N] [--errors 1]\n");
    return 2;
  }
  if (options.output.empty())
  {
    options.output =
      (std::filesystem::absolute(argv[0]).parent_path().parent_path() / "frugal").string();
  }
  std::filesystem::create_directories(options.output);
  vtkSMPTools::Initialize(options.threads);
  vtkObject::SetGlobalWarningDisplay(
    std::getenv("WARN") ? 1 : 0); // a budget that is used up is no surprise here
  std::printf("# bench-frugal\n\n%d threads, medians of %d.\n", options.threads, options.repeat);
  const std::pair<const char*, void (*)(const Options&)> sections[] = {
    { "warm", MeasureWarmStarts }, { "cancel", MeasureCancelling }, { "region", MeasureRegions },
    { "filled", MeasureFilled }, { "grid", MeasureGrids }, { "knobs", MeasureKnobs },
    { "target", MeasureTargets }, { "budget", MeasureBudgets }
  };
  for (const auto& section : sections)
  {
    if (options.has(section.first))
    {
      section.second(options);
    }
  }
  return 0;
}
