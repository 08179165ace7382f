// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * vtkBucketedKBufferPass in numbers:
 *
 *   bench-transparency [-w 512] [-f 5] [-d FOLDER] [-o FILE.csv] [-s speed|memory|buckets]
 *                      [-n OBJECTS]
 *
 * Three tables of Markdown, and all numbers in FILE.csv:
 *
 * speed    a surface of alpha 0.4, turbineblade.ply of FOLDER (199 034 triangles) or
 *          a torus of 200 000 without it: VTK's default average, its exact
 *          vtkDualDepthPeelingPass and ours, in turn in one run, w^2 pixels,
 *          medians of f frames; largest and mean difference from peeling
 * memory   bits per fragment by what is on, and of all buffers per pixel of the frame
 * buckets  figure 2.12 of Murray's thesis: 32 layers over the whole window, of 1 to
 *          32 objects (or OBJECTS alone) in random order; curvature with the buckets
 *          and with one only
 *
 * The exit code is 0 whatever the times are: another machine, other times.
 */
#include "LightTransportRenderingTesting.h"

#include "vtkActor.h"
#include "vtkBucketedKBufferPass.h"
#include "vtkCamera.h"
#include "vtkCellArray.h"
#include "vtkCurvatureOpacityProperty.h"
#include "vtkDualDepthPeelingPass.h"
#include "vtkOpenGLRenderer.h"
#include "vtkPLYReader.h"
#include "vtkParametricFunctionSource.h"
#include "vtkParametricTorus.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkPolyDataMapper.h"
#include "vtkProperty.h"
#include "vtkRenderStepsPass.h"
#include "vtkRenderer.h"
#include "vtkTranslucentPass.h"

#include <chrono>
#include <cstdio>
#include <fstream>
#include <random>
#include <vector>

using namespace lighttransport::testing;

namespace
{
struct Options
{
  int pixels = 512;
  int frames = 5;
  int objects = 0;
  std::string data = "../shared/data";
  std::string output;
  std::string section;
};

std::ofstream csv;

void note(
  const std::string& section, const std::string& what, const std::string& unit, double value)
{
  if (csv.is_open())
  {
    csv << section << "," << what << "," << unit << "," << value << "\n";
  }
}

double median(std::vector<double> values)
{
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

struct View
{
  vtkNew<vtkRenderWindow> window;
  vtkNew<vtkRenderer> renderer;
  std::vector<double> times;

  explicit View(int pixels)
  {
    this->window->SetMultiSamples(0);
    this->window->SetSize(pixels, pixels);
    this->window->AddRenderer(this->renderer);
    this->renderer->SetBackground(1., 1., 1.);
  }
  void frame(bool count)
  {
    const auto begin = std::chrono::steady_clock::now();
    this->window->Render();
    // Reading a pixel waits for the GPU.
    vtkNew<vtkUnsignedCharArray> pixel;
    this->window->GetPixelData(0, 0, 0, 0, 0, pixel);
    if (count)
    {
      this->times.push_back(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
          .count());
    }
  }
};

//------------------------------------------------------------------------------
vtkSmartPointer<vtkAlgorithm> makeSurface(const Options& options, std::string& name)
{
  const std::string file = options.data + "/turbineblade.ply";
  if (std::ifstream(file).good())
  {
    auto reader = vtkSmartPointer<vtkPLYReader>::New();
    reader->SetFileName(file.c_str());
    name = "turbineblade.ply";
    return reader;
  }
  vtkNew<vtkParametricTorus> torus;
  auto source = vtkSmartPointer<vtkParametricFunctionSource>::New();
  source->SetParametricFunction(torus);
  source->SetUResolution(500);
  source->SetVResolution(200);
  name = "a torus";
  return source;
}

void measureSpeed(const Options& options)
{
  std::string name;
  auto surface = makeSurface(options, name);
  surface->Update();
  View views[3] = { View(options.pixels), View(options.pixels), View(options.pixels) };
  const char* names[3] = { "VTK's average", "vtkDualDepthPeelingPass", "vtkBucketedKBufferPass" };
  vtkNew<vtkBucketedKBufferPass> pass;
  pass->SetNumberOfLayers(32);
  vtkNew<vtkRenderStepsPass> steps;
  vtkNew<vtkDualDepthPeelingPass> peeling;
  vtkNew<vtkTranslucentPass> translucent;
  peeling->SetTranslucentPass(translucent);
  peeling->SetMaximumNumberOfPeels(100);
  peeling->SetOcclusionRatio(0.);
  steps->SetTranslucentPass(peeling);
  views[1].renderer->SetPass(steps);
  views[2].renderer->SetPass(pass);
  for (View& view : views)
  {
    vtkNew<vtkPolyDataMapper> mapper;
    mapper->SetInputConnection(surface->GetOutputPort());
    vtkNew<vtkActor> actor;
    actor->SetMapper(mapper);
    actor->GetProperty()->SetOpacity(.4);
    view.renderer->AddActor(actor);
    view.renderer->ResetCamera();
    view.renderer->GetActiveCamera()->Azimuth(30.);
    view.renderer->ResetCameraClippingRange();
    view.frame(false); // compiles and uploads
  }
  for (int f = 0; f < options.frames; ++f)
  {
    for (View& view : views)
    {
      view.frame(true);
    }
  }
  const Picture exact = capture(views[1].window);
  std::printf("%s, alpha 0.4, %d^2 pixels, medians of %d frames\n\n", name.c_str(), options.pixels,
    options.frames);
  std::printf("| pass | ms | peeling / this | differs from peeling by at most | mean |\n"
              "|---|---|---|---|---|\n");
  for (int i = 0; i < 3; ++i)
  {
    const Difference d = difference(capture(views[i].window), exact);
    const double ms = median(views[i].times);
    std::printf("| %s | %.0f | %.1f | %.0f/255 | %.2f |\n", names[i], ms,
      median(views[1].times) / ms, d.largest, d.mean);
    note("speed", names[i], "ms", ms);
  }
  std::printf("\n%lld fragments, most layers blended %d, merged %lld\n\n",
    static_cast<long long>(pass->GetNumberOfFragments()), pass->GetNumberOfLayers(),
    static_cast<long long>(pass->GetNumberOfMergedFragments()));
  pass->MeasureStagesOn();
  views[2].times.clear();
  views[2].frame(true);
  std::printf("copy %.0f, geometry %.0f, blending %.0f ms, each waited for, of %.0f\n\n",
    pass->GetStageMilliseconds(1), pass->GetStageMilliseconds(2), pass->GetStageMilliseconds(5),
    views[2].times[0]);
}

//------------------------------------------------------------------------------
/** 32 squares over the whole window at random depths, of some objects. */
void addLayers(vtkRenderer* renderer, int objects)
{
  constexpr int Layers = 32;
  std::mt19937 random(12);
  std::vector<int> order(Layers);
  for (int i = 0; i < Layers; ++i)
  {
    order[i] = i;
  }
  std::shuffle(order.begin(), order.end(), random);
  for (int o = 0; o < objects; ++o)
  {
    vtkNew<vtkPoints> points;
    vtkNew<vtkCellArray> cells;
    for (int i = o; i < Layers; i += objects)
    {
      const double z = .25 * order[i];
      const vtkIdType first = points->InsertNextPoint(-2., -2., z);
      points->InsertNextPoint(2., -2., z);
      points->InsertNextPoint(2., 2., z);
      points->InsertNextPoint(-2., 2., z);
      const vtkIdType quad[4] = { first, first + 1, first + 2, first + 3 };
      cells->InsertNextCell(4, quad);
    }
    vtkNew<vtkPolyData> data;
    data->SetPoints(points);
    data->SetPolys(cells);
    vtkNew<vtkPolyDataMapper> mapper;
    mapper->SetInputData(data);
    vtkNew<vtkActor> actor;
    actor->SetMapper(mapper);
    actor->GetProperty()->SetColor(.2 + .02 * o, .5, .8 - .02 * o);
    actor->GetProperty()->SetOpacity(.1);
    renderer->AddActor(actor);
  }
  vtkCamera* camera = renderer->GetActiveCamera();
  camera->ParallelProjectionOn();
  camera->SetPosition(0., 0., 20.);
  camera->SetFocalPoint(0., 0., 0.);
  camera->SetParallelScale(1.);
  camera->SetClippingRange(1., 30.);
}

struct Times
{
  double frame = 0.;
  double stages[6] = { 0., 0., 0., 0., 0., 0. };
};

/** One frame to warm up; few frames are enough: these are long. Milliseconds. */
Times layersTime(const Options& options, int objects, bool style, bool singleBucket)
{
  View view(options.pixels);
  vtkNew<vtkBucketedKBufferPass> pass;
  pass->SetNumberOfLayers(32);
  pass->SetSingleBucket(singleBucket);
  pass->MeasureStagesOn();
  vtkCurvatureOpacityProperty* property = pass->GetCurvatureOpacityProperty();
  property->SetCurvatureShading(style);
  property->SetCurvatureOpacity(style);
  view.renderer->SetPass(pass);
  addLayers(view.renderer, objects);
  view.frame(false);
  std::vector<double> stages[6];
  for (int f = 0; f < std::min(options.frames, 3); ++f)
  {
    view.frame(true);
    for (int i = 1; i < 6; ++i)
    {
      stages[i].push_back(pass->GetStageMilliseconds(i));
    }
  }
  Times times;
  times.frame = median(view.times);
  for (int i = 1; i < 6; ++i)
  {
    times.stages[i] = median(stages[i]);
  }
  return times;
}

void measureBuckets(const Options& options)
{
  const Times plain = layersTime(options, 32, false, false);
  std::printf(
    "32 layers of %d^2 pixels; %.0f ms without curvature\n\n", options.pixels, plain.frame);
  std::printf("| objects | frame ms | geometry | order | search | blending | search: brute force / "
              "buckets | frame |\n|---|---|---|---|---|---|---|---|\n");
  note("buckets", "plain frame", "ms", plain.frame);
  const Times brute = layersTime(options, 1, true, true);
  const auto row = [&](const std::string& name, const Times& t)
  {
    std::printf("| %s | %.0f | %.0f | %.0f | %.0f | %.0f | %.1f | %.1f |\n", name.c_str(), t.frame,
      t.stages[2], t.stages[3], t.stages[4], t.stages[5], brute.stages[4] / t.stages[4],
      brute.frame / t.frame);
    std::fflush(stdout);
    note("buckets", name + " frame", "ms", t.frame);
    const char* stages[6] = { "", "copy", "geometry", "order", "search", "blending" };
    for (int i = 1; i < 6; ++i)
    {
      note("buckets", name + " " + stages[i], "ms", t.stages[i]);
    }
  };
  row("brute force", brute);
  for (const int objects : { 1, 2, 3, 4, 5, 8, 12, 16, 24, 32 })
  {
    if (options.objects == 0 || options.objects == objects)
    {
      row(std::to_string(objects), layersTime(options, objects, true, false));
    }
  }
  std::printf("\n");
}

//------------------------------------------------------------------------------
void measureMemory()
{
  std::printf("| kept | half: bits per fragment | float | all buffers, 32 layers everywhere, half: "
              "bytes per pixel |\n|---|---|---|---|\n");
  for (const int kept : { 0, 1, 2 })
  {
    int bits[2] = { 0, 0 };
    double perPixel = 0.;
    for (const int precision : { 0, 1 })
    {
      View view(64);
      vtkNew<vtkBucketedKBufferPass> pass;
      pass->SetNumberOfLayers(32);
      pass->SetColorPrecision(precision);
      pass->GetCurvatureOpacityProperty()->SetCurvatureShading(kept == 1);
      pass->GetCurvatureOpacityProperty()->SetRidgesAndValleys(kept == 2);
      view.renderer->SetPass(pass);
      addLayers(view.renderer, 4);
      view.frame(false);
      bits[precision] = pass->GetBitsPerFragment();
      perPixel = precision == 0 ? double(pass->GetMemoryInBytes()) / (64. * 64.) : perPixel;
    }
    const char* name = kept == 0 ? "transparency" : kept == 1 ? "curvature" : "lines";
    std::printf("| %s | %d | %d | %.0f |\n", name, bits[0], bits[1], perPixel);
    note("memory", std::string(name) + " half", "bits", bits[0]);
    note("memory", std::string(name) + " float", "bits", bits[1]);
  }
  std::printf("\nThe thesis has 128 bits per fragment, of 16-bit depths and 8-bit colours, for "
              "every layer of every pixel; here a fragment that is not there takes none.\n\n");
}
} // namespace

int main(int argc, char* argv[])
{
  Options options;
  for (int i = 1; i + 1 < argc; i += 2)
  {
    const std::string name = argv[i];
    const std::string value = argv[i + 1];
    if (name == "-w")
    {
      options.pixels = std::max(16, std::atoi(value.c_str()));
    }
    else if (name == "-f")
    {
      options.frames = std::max(1, std::atoi(value.c_str()));
    }
    else if (name == "-n")
    {
      options.objects = std::atoi(value.c_str());
    }
    else if (name == "-d" || name == "-o" || name == "-s")
    {
      (name == "-d" ? options.data : name == "-o" ? options.output : options.section) = value;
    }
    else
    {
      std::fprintf(stderr, "unknown option %s; see the head of BenchTransparency.cxx\n", argv[i]);
      return 1;
    }
  }
  if (!canRender())
  {
    return Suite::skipped();
  }
  if (!options.output.empty())
  {
    csv.open(options.output);
    csv << "section,what,unit,value\n";
  }
  const auto wanted = [&](const char* section)
  { return options.section.empty() || options.section == section; };
  if (wanted("speed"))
  {
    measureSpeed(options);
  }
  if (wanted("memory"))
  {
    measureMemory();
  }
  if (wanted("buckets"))
  {
    measureBuckets(options);
  }
  return 0;
}
