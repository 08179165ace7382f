// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * light-volume: reads a volume, lets light flow through a structure inside it, and writes
 * pictures, the light field, the lit region and a report.
 *
 *   1. options, output folder: refused before anything is done
 *   2. read the volume; place the seeds in it
 *   3. medium -> sources -> diffusion, on the volume's grid or a coarser one
 *   4. files, each under its own name only when it is whole
 *   5. pictures, report
 *
 * Exit code: 0, or 1 after an error, or 2 where the solver did not reach its tolerance (all files
 * are written then, and say so).
 */
#include "NiftiIO.h"
#include "Options.h"
#include "Pictures.h"
#include "Presets.h"
#include "Progress.h"
#include "Report.h"
#include "VdbIO.h"
#include "VolumeReader.h"
#include "VtkErrors.h"

#include "vtkLightDiffusionFilter.h"
#include "vtkLightSeedFilter.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportVersion.h"
#include "vtkOpticalMediumFilter.h"

#include "vtkCellArray.h"
#include "vtkDoubleArray.h"
#include "vtkFloatArray.h"
#include "vtkMatrix3x3.h"
#include "vtkPointData.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkVersion.h"
#include "vtkXMLImageDataWriter.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <map>
#include <new>

namespace lightvolume
{
namespace
{
// A seed as it lies in the world.
struct PlacedSeed
{
  std::string Text;
  std::array<double, 3> World;
  std::array<double, 3> Voxel;
  double Radius;
  double Power;
};

std::string Name(const std::string& path)
{
  std::string plain = path;
  while (plain.size() > 1 && plain.back() == '/')
  {
    plain.pop_back();
  }
  return plain.substr(plain.find_last_of('/') + 1);
}

std::string Fixed(double value, int decimals)
{
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

// Three digits: for what is read, not computed with.
std::string Rounded(double value)
{
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

std::string DescribeSpace(const Volume& volume)
{
  return (volume.IsRAS ? "RAS" : "world") + (volume.Unit == "unit" ? "" : " " + volume.Unit);
}

/** What is called world or voxel, in the volume's terms; outside: an Error with the bounds. */
void PlacePoint(const Volume& volume, const Point& point, const std::string& option,
  const std::string& text, std::array<double, 3>& world, std::array<double, 3>& voxel)
{
  voxel = point.IsVoxel ? point.Position : volume.Voxel(point.Position);
  world = point.IsVoxel ? volume.World(voxel[0], voxel[1], voxel[2]) : point.Position;
  bool inside = true;
  double last[3];
  for (int a = 0; a < 3; ++a)
  {
    last[a] = volume.FirstIndex[a] + volume.Dimensions[a] - 1.;
    // The domain ends half a voxel beyond the outermost centres; a rounding beyond is inside.
    inside =
      inside && voxel[a] >= volume.FirstIndex[a] - .5 - 1e-6 && voxel[a] <= last[a] + .5 + 1e-6;
  }
  if (inside)
  {
    return;
  }
  double lo[3];
  double hi[3];
  for (int corner = 0; corner < 8; ++corner)
  {
    double c[3];
    for (int a = 0; a < 3; ++a)
    {
      c[a] = (corner >> a) & 1 ? last[a] + .5 : volume.FirstIndex[a] - .5;
    }
    const std::array<double, 3> w = volume.World(c[0], c[1], c[2]);
    for (int a = 0; a < 3; ++a)
    {
      lo[a] = corner == 0 ? w[a] : std::min(lo[a], w[a]);
      hi[a] = corner == 0 ? w[a] : std::max(hi[a], w[a]);
    }
  }
  const double first[3] = { double(volume.FirstIndex[0]), double(volume.FirstIndex[1]),
    double(volume.FirstIndex[2]) };
  throw Error(option + " '" + text + "' lies outside the volume: " +
    (point.IsVoxel ? "voxel " + FormatPoint(voxel.data())
                   : DescribeSpace(volume) + " " + FormatPoint(world.data()) + " is voxel " +
          FormatPoint(voxel.data())) +
    "; expected voxels " + FormatPoint(first) + " to " + FormatPoint(last) + ", that is " +
    DescribeSpace(volume) + " within " + FormatPoint(lo) + " to " + FormatPoint(hi));
}

/** Block means on a grid N times coarser; no data where a block has none. */
vtkSmartPointer<vtkImageData> Coarsen(const Volume& volume, int factor)
{
  int dims[3];
  double spacing[3];
  double origin[3];
  volume.Image->GetDimensions(dims);
  volume.Image->GetSpacing(spacing);
  int coarse[3];
  double step[3];
  double first[3];
  for (int a = 0; a < 3; ++a)
  {
    const int n = std::min(factor, dims[a]);
    coarse[a] = (dims[a] + n - 1) / n;
    step[a] = spacing[a] * n;
    first[a] = (n - 1) / 2.;
  }
  volume.Image->TransformContinuousIndexToPhysicalPoint(first, origin);
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(coarse);
  image->SetSpacing(step);
  image->SetOrigin(origin);
  image->SetDirectionMatrix(volume.Image->GetDirectionMatrix());
  image->AllocateScalars(VTK_FLOAT, 1);
  vtkDataArray* scalars = volume.Image->GetPointData()->GetScalars();
  image->GetPointData()->GetScalars()->SetName(scalars->GetName());
  auto* to = static_cast<float*>(image->GetScalarPointer());
  for (int k = 0; k < coarse[2]; ++k)
  {
    for (int j = 0; j < coarse[1]; ++j)
    {
      for (int i = 0; i < coarse[0]; ++i)
      {
        double sum = 0.;
        int count = 0;
        for (int c = k * factor; c < std::min((k + 1) * factor, dims[2]); ++c)
        {
          for (int b = j * factor; b < std::min((j + 1) * factor, dims[1]); ++b)
          {
            for (int a = i * factor; a < std::min((i + 1) * factor, dims[0]); ++a)
            {
              const double v = scalars->GetComponent(
                a + static_cast<vtkIdType>(dims[0]) * (b + static_cast<vtkIdType>(dims[1]) * c), 0);
              if (std::isfinite(v) &&
                std::find(volume.NoData.begin(), volume.NoData.end(), v) == volume.NoData.end())
              {
                sum += v;
                ++count;
              }
            }
          }
        }
        *to++ =
          count > 0 ? static_cast<float>(sum / count) : std::numeric_limits<float>::quiet_NaN();
      }
    }
  }
  return image;
}

vtkSmartPointer<vtkPiecewiseFunction> MakeFunction(const Curve& curve)
{
  auto function = vtkSmartPointer<vtkPiecewiseFunction>::New();
  for (const CurvePoint& p : curve)
  {
    function->AddPoint(p.Value, p.Number);
  }
  return function;
}

vtkSmartPointer<vtkPolyData> MakeStrokes(
  const Volume& volume, const std::vector<Stroke>& strokes, double defaultRadius, Json& report)
{
  auto lines = vtkSmartPointer<vtkPolyData>::New();
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkCellArray> cells;
  vtkNew<vtkDoubleArray> radius;
  vtkNew<vtkDoubleArray> power;
  radius->SetName("Radius");
  power->SetName("Power");
  for (const Stroke& stroke : strokes)
  {
    cells->InsertNextCell(static_cast<int>(stroke.Points.size()));
    Json entry;
    entry["given"] = stroke.Text;
    for (const Point& point : stroke.Points)
    {
      std::array<double, 3> world;
      std::array<double, 3> voxel;
      PlacePoint(volume, point, "--stroke", stroke.Text, world, voxel);
      cells->InsertCellPoint(points->InsertNextPoint(world.data()));
      radius->InsertNextValue(stroke.Radius < 0. ? defaultRadius : stroke.Radius);
      power->InsertNextValue(stroke.Power);
      entry["world"].Append(Json::List(world));
    }
    entry["radius"] = stroke.Radius < 0. ? defaultRadius : stroke.Radius;
    entry["power"] = stroke.Power;
    report.Append(entry);
  }
  lines->SetPoints(points);
  lines->SetLines(cells);
  lines->GetPointData()->AddArray(radius);
  lines->GetPointData()->AddArray(power);
  return lines;
}

struct LitRegion
{
  std::vector<std::uint8_t> Labels; // in the order of volume.Image
  double Fluence = 0.;              // the threshold
  double Voxels = 0.;
};

/** Where the fluence, linear between the points of its grid, is above the threshold. */
LitRegion FindLitRegion(const Volume& volume, vtkImageData* light, int factor, double threshold)
{
  vtkDataArray* fluence = light->GetPointData()->GetArray(vtkLightTransportArrays::Fluence);
  double range[2];
  fluence->GetRange(range);
  LitRegion region;
  region.Fluence = threshold * range[1];
  const auto& dims = volume.Dimensions;
  int coarse[3];
  light->GetDimensions(coarse);
  region.Labels.assign(static_cast<std::size_t>(volume.Image->GetNumberOfPoints()), 0);
  if (!(range[1] > 0.))
  {
    return region;
  }
  // Neighbours and weight of each fine index along each axis.
  struct Place
  {
    int Lower;
    int Upper;
    double Weight;
  };
  std::vector<Place> places[3];
  for (int a = 0; a < 3; ++a)
  {
    const int n = std::min(factor, dims[a]);
    for (int i = 0; i < dims[a]; ++i)
    {
      const double x = std::clamp((i + .5) / n - .5, 0., coarse[a] - 1.);
      const int lower = static_cast<int>(x);
      places[a].push_back({ lower, std::min(lower + 1, coarse[a] - 1), x - lower });
    }
  }
  const auto at = [&](int i, int j, int k)
  {
    return fluence->GetComponent(
      i + static_cast<vtkIdType>(coarse[0]) * (j + static_cast<vtkIdType>(coarse[1]) * k), 0);
  };
  std::size_t n = 0;
  for (int k = 0; k < dims[2]; ++k)
  {
    const Place& z = places[2][k];
    for (int j = 0; j < dims[1]; ++j)
    {
      const Place& y = places[1][j];
      for (int i = 0; i < dims[0]; ++i, ++n)
      {
        const Place& x = places[0][i];
        double value = 0.;
        if (factor == 1)
        {
          value = at(i, j, k);
        }
        else
        {
          const auto row = [&](int jj, int kk)
          { return (1. - x.Weight) * at(x.Lower, jj, kk) + x.Weight * at(x.Upper, jj, kk); };
          const auto plane = [&](int kk)
          { return (1. - y.Weight) * row(y.Lower, kk) + y.Weight * row(y.Upper, kk); };
          value = (1. - z.Weight) * plane(z.Lower) + z.Weight * plane(z.Upper);
        }
        if (value > region.Fluence)
        {
          region.Labels[n] = 1;
          region.Voxels += 1.;
        }
      }
    }
  }
  return region;
}

Json DescribeCurve(const Curve& curve)
{
  Json list;
  for (const CurvePoint& p : curve)
  {
    Json entry;
    entry.Append(p.Value);
    entry.Append(p.Number);
    if (p.HasColor)
    {
      entry.Append(Json::List(p.Color));
    }
    list.Append(entry);
  }
  return list;
}

Json DescribeParameters(const Options& o, const Look& look)
{
  Json p;
  p["preset"] = look.Preset;
  p["preset_reason"] = look.Why.empty() ? Json("--preset") : Json(look.Why);
  p["array"] = o.Read.Array;
  p["component"] = o.Read.Component;
  p["frame"] = o.Read.Frame;
  p["null_values"] = Json::List(o.NullValues);
  p["z_scale"] = o.Read.ZScale;
  p["inline_byte"] = o.Read.InlineByte;
  p["crossline_byte"] = o.Read.CrosslineByte;
  p["paint"] = o.Paint;
  p["paint_gain"] = o.PaintGain;
  p["mapping"] = look.Mapping;
  p["diffusion_tf"] = DescribeCurve(o.DiffusionCurve);
  p["complement"] = o.Complement;
  p["gradient_scale"] = o.GradientScale;
  p["length"] = o.Length;
  p["beta_floor"] = o.BetaFloor;
  p["gradient_scale_factor"] = look.GradientScaleFactor;
  p["absorption"] = look.Absorption;
  p["absorption_function"] = DescribeCurve(o.AbsorptionCurve);
  p["albedo"] = look.Albedo;
  p["anisotropy"] = o.Anisotropy;
  p["reach"] = look.Reach;
  p["model"] = o.Model;
  p["mode"] = o.Mode;
  p["steps"] = o.Steps;
  p["courant"] = o.Courant;
  p["boundary"] = o.Boundary;
  p["refractive_index"] = o.RefractiveIndex;
  p["tolerance"] = o.Tolerance;
  p["iterations"] = o.Iterations;
  p["coarsen"] = o.Coarsen;
  p["view"] = o.View;
  p["tf"] = DescribeCurve(o.TransferFunction);
  p["camera"] = Json::List(o.Camera);
  p["key_light"] = Json::List(o.KeyLight);
  p["shadow_strength"] = o.ShadowStrength;
  p["up"] = o.Up;
  p["size"] = Json::List(o.Size);
  p["decades"] = o.Decades;
  p["strength"] = o.Strength;
  p["light_opacity"] = look.LightOpacity;
  p["tissue_opacity"] = look.TissueOpacity;
  p["title"] = o.Title;
  p["pictures"] = Json::List(o.Pictures);
  p["render"] = o.Render;
  p["threshold"] = o.Threshold;
  p["files"] = Json::List(o.Files);
  return p;
}

Json DescribeVersions()
{
  Json v;
  v["LightTransport"] = vtkLightTransportVersion::GetLightTransportVersion();
  v["VTK"] = vtkVersion::GetVTKVersion();
  if (!OpenVdbVersion().empty())
  {
    v["OpenVDB"] = OpenVdbVersion();
  }
  return v;
}

int Run(Options options)
{
  Progress progress(options.Quiet);
  PrepareFolder(options.Out);
  const auto wants = [&options](const char* file)
  { return std::find(options.Files.begin(), options.Files.end(), file) != options.Files.end(); };
  if (wants("vdb") && OpenVdbVersion().empty())
  {
    progress.Say("note: built without OpenVDB: no fluence.vdb");
    options.Files.erase(std::find(options.Files.begin(), options.Files.end(), "vdb"));
  }
  options.Render = options.Render && !options.Pictures.empty();
  if (options.Render)
  {
    const std::string why = Pictures::WhyNot();
    if (!why.empty())
    {
      throw Error("cannot make pictures: " + why + "; --no-render works without OpenGL");
    }
  }
  if (options.Title.empty())
  {
    options.Title = Name(options.Input);
  }

  // Read.
  progress.Begin("read");
  Volume volume = ReadVolume(options.Input, options.Read);
  volume.NoData.insert(volume.NoData.end(), options.NullValues.begin(), options.NullValues.end());
  const Statistics statistics = Measure(volume);
  Volume paint;
  if (!options.Paint.empty())
  {
    ReadOptions read;
    read.ZScale = options.Read.ZScale;
    paint = ReadVolume(options.Paint, read);
  }
  progress.End();
  vtkDataArray* scalars = volume.Image->GetPointData()->GetScalars();
  double spacing[3];
  volume.Image->GetSpacing(spacing);
  const auto& dims = volume.Dimensions;
  const double voxelVolume = spacing[0] * spacing[1] * spacing[2];
  progress.Say(Name(options.Input) + ": " + volume.Format + ", " + std::to_string(dims[0]) + " x " +
    std::to_string(dims[1]) + " x " + std::to_string(dims[2]) + " " +
    scalars->GetDataTypeAsString() + ", spacing " + FormatPoint(spacing) + ", coordinates " +
    DescribeSpace(volume) + ", values " + FormatNumber(statistics.Minimum) + " to " +
    FormatNumber(statistics.Maximum));
  for (const std::string& note : volume.Notes)
  {
    progress.Say("  note: " + note);
  }
  const Look look = ChooseLook(volume, statistics, options);
  if (!look.Why.empty())
  {
    progress.Say("preset " + look.Preset + ": " + look.Why);
  }

  if (!options.NeedsSolve())
  {
    Pictures pictures(volume, statistics, look, options);
    const std::string folder = options.Out + (options.Out.back() == '/' ? "" : "/");
    std::string list;
    for (const std::string& kind : options.Pictures)
    {
      progress.Begin("draw " + kind);
      WriteWhole(
        folder + kind + ".png", [&](const std::string& path) { pictures.Write(kind, path); });
      progress.End();
      list += " " + kind + ".png";
    }
    progress.Say("in " + folder + ":" + list);
    return 0;
  }

  // Does the solve fit? Arrays, solver and pictures take about this much per voxel.
  constexpr double bytesPerVoxel = 140.;
  const double voxels = static_cast<double>(volume.Image->GetNumberOfPoints());
  const double available = AvailableMemory();
  const double needed = voxels / std::pow(options.Coarsen, 3) * bytesPerVoxel;
  if (needed > available)
  {
    throw Error("solving on " + FormatNumber(voxels / std::pow(options.Coarsen, 3)) +
      " voxels takes about " + FormatNumber(needed / 1e9) + " GB and " +
      FormatNumber(available / 1e9) + " GB are free; try --coarsen " +
      std::to_string(
        static_cast<int>(std::ceil(std::cbrt(voxels * bytesPerVoxel / (.8 * available))))));
  }

  // Seeds.
  Json report;
  const double defaultRadius = 2. * std::min({ spacing[0], spacing[1], spacing[2] });
  if (options.Seeds.empty() && options.Strokes.empty() && options.Paint.empty())
  {
    Seed seed;
    std::string how;
    const std::array<double, 3> middle = DefaultSeed(volume, statistics, how);
    seed.Center.IsVoxel = true;
    seed.Text = "@";
    for (int a = 0; a < 3; ++a)
    {
      const double file = volume.Flipped[a] ? dims[a] - 1. - middle[a] : middle[a];
      seed.Center.Position[a] = std::round(file) + volume.FirstIndex[a];
      seed.Text += (a ? "," : "") + FormatNumber(seed.Center.Position[a]);
    }
    options.Seeds.push_back(seed);
    progress.Say("no --seed: one in " + how);
    report["default_seed"] = how;
  }
  std::vector<PlacedSeed> seeds;
  for (const Seed& seed : options.Seeds)
  {
    PlacedSeed placed;
    placed.Text = seed.Text;
    placed.Radius = seed.Radius < 0. ? defaultRadius : seed.Radius;
    placed.Power = seed.Power;
    PlacePoint(volume, seed.Center, "--seed", seed.Text, placed.World, placed.Voxel);
    seeds.push_back(placed);
    progress.Say("seed: " + DescribeSpace(volume) + " " + FormatPoint(placed.World.data()) +
      ", voxel " + FormatPoint(placed.Voxel.data()) + ", radius " + FormatNumber(placed.Radius) +
      ", power " + FormatNumber(placed.Power));
    Json entry;
    entry["given"] = placed.Text;
    entry["world"] = Json::List(placed.World);
    entry["voxel"] = Json::List(placed.Voxel);
    entry["radius"] = placed.Radius;
    entry["power"] = placed.Power;
    report["seeds"].Append(entry);
  }

  // Medium.
  VtkErrors errors;
  vtkNew<vtkOpticalMediumFilter> medium;
  vtkNew<vtkLightSeedFilter> sources;
  vtkNew<vtkLightDiffusionFilter> diffusion;
  for (vtkAlgorithm* filter : { static_cast<vtkAlgorithm*>(medium),
         static_cast<vtkAlgorithm*>(sources), static_cast<vtkAlgorithm*>(diffusion) })
  {
    errors.Watch(filter);
  }
  vtkSmartPointer<vtkImageData> grid = volume.Image;
  if (options.Coarsen > 1)
  {
    progress.Begin("coarsen");
    grid = Coarsen(volume, options.Coarsen);
    progress.End();
  }
  medium->SetInputData(grid);
  static const std::map<std::string, int> mappings = {
    { "gradient", vtkOpticalMediumFilter::FromScalarGradient },
    { "transfer", vtkOpticalMediumFilter::FromTransferFunction },
    { "transfer-gradient", vtkOpticalMediumFilter::FromTransferFunctionGradient }
  };
  medium->SetDiffusionMapping(mappings.at(look.Mapping));
  medium->SetDiffusionFunction(!options.DiffusionCurve.empty()
      ? MakeFunction(options.DiffusionCurve)
      : look.Passage ? look.Passage
                     : look.Opacity);
  medium->SetDiffusionComplement(options.Complement);
  medium->SetGradientScale(options.GradientScale);
  // The noise is measured where the light starts.
  std::array<double, 3> focus = { { 0, 0, 0 } };
  bool haveFocus = false;
  for (const PlacedSeed& seed : seeds)
  {
    if (!haveFocus && seed.Power > 0.)
    {
      focus = seed.World;
      haveFocus = true;
    }
  }
  // The length belongs to the scene: a coarser grid does not change it.
  const double finest = std::min({ spacing[0], spacing[1], spacing[2] });
  const double length = options.Length > 0. ? options.Length : finest;
  medium->SetDiffusionLength(length);
  medium->SetBetaFloor(options.BetaFloor);
  medium->SetAbsorptionMapping(look.Absorption == "albedo" ? vtkOpticalMediumFilter::FromAlbedo
      : look.Absorption == "function"                      ? vtkOpticalMediumFilter::FromFunction
                                      : vtkOpticalMediumFilter::FromComplement);
  if (!options.AbsorptionCurve.empty())
  {
    medium->SetAbsorptionFunction(MakeFunction(options.AbsorptionCurve));
  }
  medium->SetAlbedo(look.Albedo);
  medium->SetAnisotropy(options.Anisotropy);
  medium->SetReach(look.Reach);
  if (options.Coarsen == 1)
  {
    for (const double value : volume.NoData)
    {
      medium->AddNoDataValue(value);
    }
  }

  // Sources.
  sources->SetInputConnection(medium->GetOutputPort());
  for (const PlacedSeed& seed : seeds)
  {
    sources->AddSphere(seed.World.data(), seed.Radius, seed.Power);
  }
  if (!options.Strokes.empty())
  {
    const auto strokes = MakeStrokes(volume, options.Strokes, defaultRadius, report["strokes"]);
    sources->SetStrokesData(strokes);
    if (!haveFocus)
    {
      strokes->GetPoint(0, focus.data());
      haveFocus = true;
    }
  }
  if (paint.Image)
  {
    sources->SetPaintedImageData(paint.Image);
    sources->SetPaintedGain(options.PaintGain);
  }
  if (haveFocus)
  {
    medium->SetScalePoint(focus.data());
  }

  // Diffusion.
  diffusion->SetInputConnection(sources->GetOutputPort());
  diffusion->SetModel(options.Model == "anisotropic" ? vtkLightDiffusionFilter::AnisotropicDiffusion
                                                     : vtkLightDiffusionFilter::Diffusion);
  diffusion->SetMode(options.Mode == "steady" ? vtkLightDiffusionFilter::Steady
      : options.Mode == "explicit"            ? vtkLightDiffusionFilter::Explicit
                                              : vtkLightDiffusionFilter::Implicit);
  diffusion->SetBoundary(options.Boundary == "robin" ? vtkLightDiffusionFilter::Robin
      : options.Boundary == "zeroflux"               ? vtkLightDiffusionFilter::ZeroFlux
                                                     : vtkLightDiffusionFilter::Absorbing);
  diffusion->SetRefractiveIndexRatio(options.RefractiveIndex);
  diffusion->SetTolerance(options.Tolerance);
  diffusion->SetMaximumNumberOfIterations(options.Iterations);
  diffusion->SetNumberOfSteps(options.Steps);
  diffusion->SetCourantNumber(options.Courant);
  const auto pictured = [&options](const char* kind)
  {
    return options.Render &&
      std::find(options.Pictures.begin(), options.Pictures.end(), kind) != options.Pictures.end();
  };
  diffusion->SetComputeFlux(pictured("flux") || pictured("arrows"));

  const auto stage = [&](const char* name, vtkAlgorithm* filter)
  {
    progress.Begin(name, filter);
    filter->Update();
    const double seconds = progress.End();
    if (errors.Any())
    {
      throw Error(errors.First());
    }
    return seconds;
  };
  double seconds = stage("medium", medium);
  double sigma = medium->GetComputedGradientScale();
  const bool chosen = options.GradientScale == 0. && sigma > 0.;
  if (chosen && look.GradientScaleFactor != 1.)
  {
    medium->SetGradientScale(look.GradientScaleFactor * sigma);
    seconds += stage("medium", medium);
    sigma = medium->GetComputedGradientScale();
  }
  // The Perona-Malik model has one of its own: the same.
  diffusion->SetGradientScale(sigma > 0. ? sigma : options.GradientScale);
  progress.Say("medium: " + Fixed(seconds, 2) + " s" +
    (sigma > 0. ? ", gradient scale " + FormatNumber(sigma) +
          (chosen ? " (" + FormatNumber(look.GradientScaleFactor) + " of what the data shows)" : "")
                : ""));
  stage("sources", sources);
  seconds = stage("solve", diffusion);
  vtkImageData* light = diffusion->GetOutput();
  const int reason = diffusion->GetStopReason();
  const bool steady = options.Mode == "steady";
  const bool converged = reason == vtkLightDiffusionFilter::Converged ||
    (!steady && reason == vtkLightDiffusionFilter::MaxIterations);
  const std::string residual =
    diffusion->GetResidual() < 0. ? "not known" : FormatNumber(diffusion->GetResidual());
  progress.Say("solve: " + Fixed(seconds, 2) + " s, " + diffusion->GetStopReasonAsString() + ", " +
    std::to_string(diffusion->GetNumberOfIterationsUsed()) + " iterations, residual " + residual +
    "; power emitted " + FormatNumber(diffusion->GetEmittedPower()) + ", absorbed " +
    FormatNumber(diffusion->GetAbsorbedPower()) + ", escaped " +
    FormatNumber(diffusion->GetEscapedPower()));
  if (!converged)
  {
    std::cerr << "light-volume: warning: the solver stopped with "
              << diffusion->GetStopReasonAsString() << ", residual " << residual
              << ", expected at most " << options.Tolerance << " " << diffusion->GetMessage()
              << "\n";
  }

  // The lit region.
  const LitRegion region = FindLitRegion(volume, light, options.Coarsen, options.Threshold);
  const double litVolume = region.Voxels * voxelVolume;
  const bool millimetres = volume.Unit == "mm";
  const std::string litText = millimetres ? Rounded(litVolume / 1000.) + " ml"
                                          : Rounded(litVolume) + " " + volume.Unit + "^3";
  progress.Say("lit region: " + litText + " (" + Fixed(region.Voxels, 0) + " voxels) above " +
    FormatNumber(options.Threshold) + " of the maximum");

  // Files.
  std::vector<std::string> written;
  const std::string folder = options.Out + (options.Out.back() == '/' ? "" : "/");
  const auto write =
    [&](const std::string& name, const std::function<void(const std::string&)>& writer)
  {
    progress.Begin("write " + name);
    WriteWhole(folder + name, writer);
    progress.End();
    written.push_back(name);
  };
  vtkNew<vtkImageData> field;
  field->CopyStructure(light);
  field->GetFieldData()->ShallowCopy(light->GetFieldData());
  std::vector<std::string> arrays = { vtkLightTransportArrays::Fluence };
  for (const char* name : { vtkLightTransportArrays::Fluence, vtkLightTransportArrays::Flux })
  {
    if (vtkDataArray* array = light->GetPointData()->GetArray(name))
    {
      field->GetPointData()->AddArray(array);
    }
  }
  field->GetPointData()->SetActiveScalars(vtkLightTransportArrays::Fluence);
  if (wants("vti"))
  {
    write("fluence.vti",
      [&](const std::string& path)
      {
        VtkErrors problems;
        vtkNew<vtkXMLImageDataWriter> writer;
        problems.Watch(writer);
        writer->SetInputData(field);
        writer->SetFileName(path.c_str());
        writer->SetDataModeToAppended();
        writer->EncodeAppendedDataOff();
        writer->SetCompressorTypeToZLib();
        writer->SetCompressionLevel(1); // fluence hardly shrinks: be quick about it
        if (!writer->Write() || problems.Any())
        {
          throw Error("cannot write '" + path + "'" + problems.Because());
        }
      });
  }
  if (wants("vdb"))
  {
    write("fluence.vdb", [&](const std::string& path) { WriteVdb(path, field, arrays); });
  }
  if (wants("nii"))
  {
    if (!millimetres && !volume.IsRAS)
    {
      progress.Say("  note: lit.nii.gz lies in world coordinates, which are not RAS here");
    }
    write("lit.nii.gz",
      [&](const std::string& path)
      {
        WriteNiftiLabels(path, volume, region.Labels,
          "light-volume: fluence above " + FormatNumber(region.Fluence));
      });
  }

  // Pictures. Should OpenGL fail, the report is written all the same.
  std::string noPicture;
  if (options.Render)
  {
    Pictures pictures(volume, statistics, look, options);
    std::array<double, 3> middle = focus;
    if (!haveFocus)
    {
      volume.Image->GetCenter(middle.data());
    }
    pictures.SetLight(light, middle);
    const bool named = volume.Unit != "unit";
    std::vector<std::string> caption;
    for (const PlacedSeed& seed : seeds)
    {
      if (caption.size() < 4)
      {
        caption.push_back(std::string(seed.Power < 0. ? "dark" : "light") + " at " +
          FormatPoint(seed.World.data()) + " " + DescribeSpace(volume) + ", power " +
          FormatNumber(seed.Power));
      }
    }
    for (const Stroke& stroke : options.Strokes)
    {
      if (caption.size() < 5)
      {
        caption.push_back("a stroke through " + std::to_string(stroke.Points.size()) +
          " points, power " + FormatNumber(stroke.Power));
      }
    }
    if (paint.Image)
    {
      caption.push_back("painted: " + Name(options.Paint));
    }
    const std::string unit = named ? " " + volume.Unit : "";
    const std::string edges =
      sigma > 0. ? Rounded(sigma) + (named ? "/" + volume.Unit : "") : std::string();
    caption.push_back(
      (options.Model == "anisotropic"
          ? "Perona-Malik, edges of " + edges + ", " + std::to_string(options.Steps) + " steps"
          : "mapping " + look.Mapping + (edges.empty() ? "" : " " + edges) + ", reach " +
            Rounded(look.Reach) + unit) +
      "; lit: " + litText);
    pictures.SetCaption(caption);
    try
    {
      for (const std::string& kind : options.Pictures)
      {
        write(kind + ".png", [&](const std::string& path) { pictures.Write(kind, path); });
      }
    }
    catch (const Error& error)
    {
      noPicture = error.what();
    }
  }

  // Report.
  report["program"] = "light-volume";
  report["versions"] = DescribeVersions();
  Json given;
  given.Append("light-volume");
  given.Append(options.Input);
  for (const auto& option : options.Given)
  {
    given.Append(option.first);
    if (!option.second.empty())
    {
      given.Append(option.second);
    }
  }
  report["command"] = given;
  Json& input = report["input"];
  input["path"] = options.Input;
  input["format"] = volume.Format;
  input["dimensions"] = Json::List(dims);
  input["first_index"] = Json::List(volume.FirstIndex);
  input["axes"] = Json::List(volume.AxisNames);
  input["spacing"] = Json::List(spacing);
  input["unit"] = volume.Unit;
  input["world"] = volume.IsRAS ? "RAS" : "file";
  input["voxel_to_world"] = Json::List(volume.FileToWorld);
  input["type"] = scalars->GetDataTypeAsString();
  input["minimum"] = statistics.Minimum;
  input["maximum"] = statistics.Maximum;
  input["no_data_fraction"] = statistics.NoDataFraction;
  input["notes"] = Json::List(volume.Notes);
  report["parameters"] = DescribeParameters(options, look);
  Json& made = report["medium"];
  made["gradient_scale"] = sigma;
  made["diffusion_length"] = length;
  Json& solver = report["solver"];
  int size[3];
  light->GetDimensions(size);
  solver["grid"] = Json::List(size);
  solver["stop_reason"] = diffusion->GetStopReasonAsString();
  solver["message"] = diffusion->GetMessage();
  solver["reached_tolerance"] = reason == vtkLightDiffusionFilter::Converged;
  solver["iterations"] = diffusion->GetNumberOfIterationsUsed();
  solver["residual"] = diffusion->GetResidual();
  solver["seconds"] = diffusion->GetSolveSeconds();
  solver["bytes"] = static_cast<double>(diffusion->GetBytes());
  solver["bytes_per_voxel"] =
    static_cast<double>(diffusion->GetBytes()) / static_cast<double>(light->GetNumberOfPoints());
  solver["source_power"] = sources->GetTotalPower();
  solver["emitted_power"] = diffusion->GetEmittedPower();
  solver["absorbed_power"] = diffusion->GetAbsorbedPower();
  solver["escaped_power"] = diffusion->GetEscapedPower();
  double range[2] = { 0., 0. };
  light->GetPointData()->GetArray(vtkLightTransportArrays::Fluence)->GetRange(range);
  solver["fluence_minimum"] = range[0];
  solver["fluence_maximum"] = range[1];
  Json& lit = report["lit_region"];
  lit["threshold"] = options.Threshold;
  lit["fluence_threshold"] = region.Fluence;
  lit["voxels"] = region.Voxels;
  lit["volume"] = litVolume;
  lit["unit"] = volume.Unit + "^3";
  lit["ml"] = millimetres ? Json(litVolume / 1000.) : Json();
  std::map<std::string, double> total; // a stage may have run twice
  for (const auto& time : progress.Stages())
  {
    report["seconds"][time.first] = total[time.first] += time.second;
  }
  written.push_back("report.json");
  report["files"] = Json::List(written);
  WriteWhole(folder + "report.json",
    [&report](const std::string& path)
    {
      std::ofstream file(path);
      file << report.Write() << "\n" << std::flush;
      if (!file)
      {
        throw Error("cannot write '" + path + "'");
      }
    });
  std::string list;
  for (const std::string& name : written)
  {
    list += " " + name;
  }
  progress.Say("in " + folder + ":" + list);
  if (!noPicture.empty())
  {
    throw Error(noPicture);
  }
  return converged ? 0 : 2;
}
} // namespace
} // namespace lightvolume

int main(int argc, char* argv[])
{
  using namespace lightvolume;
  try
  {
    const Options options = ParseOptions(std::vector<std::string>(argv + 1, argv + argc));
    if (options.Help)
    {
      std::cout << HelpText();
      return 0;
    }
    if (options.Version)
    {
      std::cout << "light-volume " << vtkLightTransportVersion::GetLightTransportVersion()
                << " (VTK " << vtkVersion::GetVTKVersion()
                << (OpenVdbVersion().empty() ? "" : ", OpenVDB " + OpenVdbVersion()) << ")\n";
      return 0;
    }
    return Run(options);
  }
  catch (const std::bad_alloc&)
  {
    std::cerr << "light-volume: error: not enough memory; --coarsen 2 needs an eighth\n";
  }
  catch (const std::exception& error)
  {
    std::cerr << "light-volume: error: " << error.what() << "\n";
  }
  return 1;
}
