// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "FrugalScenes.h"

#include "vtkLightSeedFilter.h"
#include "vtkLightTransportArrays.h"
#include "vtkOpticalMediumFilter.h"

#ifdef BENCH_WITH_READERS
#include "VolumeReader.h"
#endif

#include "vtkExtractVOI.h"
#include "vtkFloatArray.h"
#include "vtkNew.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPointData.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace frugal
{
namespace
{
using Image = vtkSmartPointer<vtkImageData>;
/** Of a voxel's indices divided by the number of voxels: 0 .. 1. */
using Function = std::function<double(double x, double y, double z)>;

Image MakeImage(std::array<int, 3> dims, std::array<double, 3> spacing)
{
  Image image = Image::New();
  image->SetDimensions(dims.data());
  image->SetSpacing(spacing.data());
  return image;
}

vtkSmartPointer<vtkFloatArray> Sample(vtkImageData* image, const char* name, const Function& f)
{
  auto array = vtkSmartPointer<vtkFloatArray>::New();
  array->SetName(name);
  array->SetNumberOfTuples(image->GetNumberOfPoints());
  int dims[3];
  image->GetDimensions(dims);
  vtkIdType at = 0;
  for (int k = 0; k < dims[2]; ++k)
  {
    for (int j = 0; j < dims[1]; ++j)
    {
      for (int i = 0; i < dims[0]; ++i)
      {
        array->SetValue(at++,
          static_cast<float>(f((i + 0.5) / dims[0], (j + 0.5) / dims[1], (k + 0.5) / dims[2])));
      }
    }
  }
  return array;
}

/** D and sigma_a as given. */
Image Medium(std::array<int, 3> dims, std::array<double, 3> spacing, const Function& D,
  const std::function<double(double D)>& sigma_a)
{
  Image image = MakeImage(dims, spacing);
  auto d = Sample(image, vtkLightTransportArrays::DiffusionCoefficient, D);
  auto s = vtkSmartPointer<vtkFloatArray>::New();
  s->SetName(vtkLightTransportArrays::Absorption);
  s->SetNumberOfTuples(d->GetNumberOfTuples());
  for (vtkIdType i = 0; i < d->GetNumberOfTuples(); ++i)
  {
    s->SetValue(i, static_cast<float>(sigma_a(static_cast<double>(d->GetValue(i)))));
  }
  image->GetPointData()->AddArray(d);
  image->GetPointData()->AddArray(s);
  return image;
}

/** Through vtkOpticalMediumFilter. */
Image Mapped(vtkImageData* scalars, const std::function<void(vtkOpticalMediumFilter*)>& set)
{
  vtkNew<vtkOpticalMediumFilter> filter;
  filter->SetInputData(scalars);
  set(filter);
  filter->Update();
  Image image = Image::New();
  image->ShallowCopy(filter->GetOutput());
  return image;
}

/** A light in the middle of what transmits best around (x, y, z), parts of the box. */
Seed At(vtkImageData* medium, double x, double y, double z, double radius = 1.5, double power = 1.)
{
  int dims[3];
  double h[3];
  medium->GetDimensions(dims);
  medium->GetSpacing(h);
  vtkDataArray* D = medium->GetPointData()->GetArray(vtkLightTransportArrays::DiffusionCoefficient);
  const double part[3] = { x, y, z };
  int at[3], best[3] = { 0, 0, 0 };
  double most = -1.;
  int from[3], to[3];
  for (int d = 0; d < 3; ++d)
  {
    const int c = std::min(dims[d] - 1, static_cast<int>(part[d] * dims[d]));
    from[d] = std::max(0, c - 4);
    to[d] = std::min(dims[d] - 1, c + 4);
  }
  for (at[2] = from[2]; at[2] <= to[2]; ++at[2])
  {
    for (at[1] = from[1]; at[1] <= to[1]; ++at[1])
    {
      for (at[0] = from[0]; at[0] <= to[0]; ++at[0])
      {
        const double v =
          D->GetTuple1(at[0] + dims[0] * (at[1] + static_cast<vtkIdType>(dims[1]) * at[2]));
        if (v > most)
        {
          most = v;
          std::copy(at, at + 3, best);
        }
      }
    }
  }
  const double smallest = std::min(h[0], std::min(h[1], h[2]));
  const int* extent = medium->GetExtent();
  double world[3];
  medium->TransformIndexToPhysicalPoint(
    extent[0] + best[0], extent[2] + best[1], extent[4] + best[2], world);
  return { world[0], world[1], world[2], radius * smallest, power };
}

double Smoothstep(double a, double b, double t)
{
  const double u = std::min(1., std::max(0., (t - a) / (b - a)));
  return u * u * (3. - 2. * u);
}

/** A body with blobs and vessels, scalars 0 .. 255, some noise. */
Image TissueScalars(int n, double noise)
{
  Image image = MakeImage({ { n, n, n } }, { { 1., 1., 1. } });
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0., noise);
  image->GetPointData()->SetScalars(Sample(image, "S",
    [&](double x, double y, double z)
    {
      const double r = std::hypot(x - .5, std::hypot(y - .5, z - .5));
      double s = 90. * Smoothstep(.47, .44, r);
      s += 60. * Smoothstep(.16, .13, std::hypot(x - .35, std::hypot(y - .4, z - .5)));
      s -= 50. * Smoothstep(.14, .12, std::hypot(x - .65, std::hypot(y - .55, z - .45)));
      const double vessel =
        std::hypot(y - .5 - .15 * std::sin(7. * x), z - .55 - .12 * std::cos(5. * x));
      s += 120. * Smoothstep(.06, .04, vessel);
      return s + normal(random);
    }));
  return image;
}

/** Distance from the axis of a bent tube along x, in parts of the box. */
double Bent(double x, double y, double z)
{
  return std::hypot(y - .5 - .2 * std::sin(6. * x), z - .5 - .2 * std::cos(6. * x));
}

/** Corridors of `width` voxels between walls of one: a wall between two rooms may have a door. */
Function Labyrinth(int n, int width, double wall, unsigned seed)
{
  const int pitch = width + 1;
  const int rooms = (n + pitch - 1) / pitch + 1;
  std::mt19937 random(seed);
  std::vector<unsigned char> doors(static_cast<std::size_t>(rooms) * rooms * rooms);
  for (unsigned char& door : doors)
  {
    door = static_cast<unsigned char>(random() & 7u);
  }
  return [=](double x, double y, double z)
  {
    const int at[3] = { static_cast<int>(x * n), static_cast<int>(y * n), static_cast<int>(z * n) };
    int walls = 0;
    int axis = 0;
    for (int d = 0; d < 3; ++d)
    {
      if (at[d] % pitch == width)
      {
        ++walls;
        axis = d;
      }
    }
    if (walls == 0)
    {
      return 1.;
    }
    const auto along = [&](int d) { return static_cast<std::size_t>(at[d] / pitch); };
    const std::size_t across = static_cast<std::size_t>(rooms);
    const std::size_t room = along(0) + across * (along(1) + across * along(2));
    return walls == 1 && (doors[room] >> axis & 1) ? 1. : wall;
  };
}

#ifdef BENCH_WITH_READERS
/** The file's image, cut to `most` voxels per axis around a voxel, or a point in parts of it. */
Image Read(
  const std::string& path, int most, const int* around = nullptr, const double* part = nullptr)
{
  Image image;
  try
  {
    image = lightvolume::ReadVolume(path, {}).Image;
  }
  catch (const lightvolume::Error&)
  {
    return nullptr;
  }
  int dims[3];
  image->GetDimensions(dims);
  const int* extent = image->GetExtent();
  int voi[6];
  for (int d = 0; d < 3; ++d)
  {
    const int middle =
      around ? around[d] : static_cast<int>((part ? part[d] : .5) * static_cast<double>(dims[d]));
    const int from = std::max(0, std::min(dims[d] - most, middle - most / 2));
    voi[2 * d] = extent[2 * d] + from;
    voi[2 * d + 1] = extent[2 * d] + std::min(dims[d], from + most) - 1;
  }
  vtkNew<vtkExtractVOI> cut;
  cut->SetInputData(image);
  cut->SetVOI(voi);
  cut->Update();
  image = cut->GetOutput();
  return image;
}
#endif
} // namespace

vtkSmartPointer<vtkImageData> WithSeeds(vtkImageData* medium, const std::vector<Seed>& seeds)
{
  vtkNew<vtkLightSeedFilter> filter;
  filter->SetInputData(medium);
  for (const Seed& seed : seeds)
  {
    filter->AddSphere(seed.x, seed.y, seed.z, seed.radius, seed.power);
  }
  filter->Update();
  Image image = Image::New();
  image->ShallowCopy(filter->GetOutput());
  return image;
}

vtkSmartPointer<vtkImageData> Aorta(const std::string& data)
{
#ifdef BENCH_WITH_READERS
  Image image = Read(data + "/thorax_ct.vti", 1000);
  if (!image)
  {
    return nullptr;
  }
  vtkNew<vtkPiecewiseFunction> function;
  function->AddPoint(90., 0.);
  function->AddPoint(110., 1.);
  Image medium = Mapped(image,
    [&](vtkOpticalMediumFilter* f)
    {
      f->SetDiffusionMappingToFromTransferFunction();
      f->SetDiffusionFunction(function);
    });
  double h[3], origin[3];
  image->GetSpacing(h);
  image->GetOrigin(origin);
  return WithSeeds(medium,
    { { origin[0] + 137. * h[0], origin[1] + 115. * h[1], origin[2] + 90. * h[2], 3., 1. } });
#else
  (void)data;
  return nullptr;
#endif
}

vtkSmartPointer<vtkImageData> Tube(int n)
{
  const double radius = 4. / n;
  Image medium = Medium(
    { { n, n, n } }, { { 1., 1., 1. } },
    [=](double x, double y, double z) { return Bent(x, y, z) < radius ? 1. : 1e-4; },
    [](double D) { return D == 1. ? 1e-3 : 1. - D; });
  return WithSeeds(
    medium, { { n * .4, n * (.5 + .2 * std::sin(2.4)), n * (.5 + .2 * std::cos(2.4)), 2., 1. } });
}

vtkSmartPointer<vtkImageData> Open(int n)
{
  Image medium = Medium(
    { { n, n, n } }, { { 1., 1., 1. } },
    [](double x, double y, double z)
    { return .6 + .4 * std::sin(20. * x) * std::cos(15. * y + 9. * z); },
    [](double) { return 1e-4; });
  return WithSeeds(medium, { { n * .5, n * .45, n * .4, 2., 1. } });
}

vtkSmartPointer<vtkImageData> Tissue(int n, double albedo, double floor)
{
  return Mapped(TissueScalars(n, 1.5),
    [&](vtkOpticalMediumFilter* f)
    {
      f->SetDiffusionMappingToFromScalarGradient();
      f->SetBetaFloor(floor);
      f->SetAbsorptionMappingToFromAlbedo();
      f->SetAlbedo(albedo);
    });
}

std::vector<Scene> Scenes(int n, int most, const std::string& data)
{
  std::vector<Scene> scenes;
  const auto add = [&](const std::string& name, const std::function<Image()>& make) {
    scenes.push_back({ name, false, [make](std::string&) { return make(); } });
  };
  const std::array<double, 3> one{ { 1., 1., 1. } };
  const std::array<int, 3> cube{ { n, n, n } };

  // tubes: radius, wall, reach
  const double tubes[6][3] = { { 1.5, 1e-4, 30. }, { 2.5, 1e-4, 15. }, { 2.5, 1e-2, 30. },
    { 5., 1e-3, 10. }, { 5., 1e-6, 100. }, { 8., 1e-2, 5. } };
  for (const auto& t : tubes)
  {
    const double radius = t[0], wall = t[1], reach = t[2];
    char name[64];
    std::snprintf(name, sizeof name, "tube r%g, wall %.0e, reach %g", radius, wall, reach);
    add(name,
      [=]
      {
        Image m = Medium(
          cube, one,
          [=](double x, double y, double z) { return Bent(x, y, z) * n < radius ? 1. : wall; },
          [=](double D) { return 1. - D + D / (reach * reach); });
        return WithSeeds(m, { At(m, .4, .5 + .2 * std::sin(2.4), .5 + .2 * std::cos(2.4)) });
      });
  }
  // noise: log-uniform D over so many decades, albedo
  const double noises[5][2] = { { 1., .9 }, { 1., .999 }, { 2., .99 }, { 4., .99 }, { 3., .9999 } };
  for (const auto& t : noises)
  {
    const double decades = t[0], albedo = t[1];
    char name[64];
    std::snprintf(name, sizeof name, "noise over %g decades, albedo %g", decades, albedo);
    add(name,
      [=]
      {
        std::mt19937 random(11);
        std::uniform_real_distribution<double> uniform(0., 1.);
        Image m = Medium(
          cube, one,
          [&](double, double, double) { return std::pow(10., -decades * uniform(random)); },
          [=](double D) { return (1. - albedo) / (3. * D); });
        return WithSeeds(m, { At(m, .3, .6, .5) });
      });
  }
  // smooth blobs: D between .05 and 1, albedo; lights
  const double blobs[5][2] = { { .9, 1 }, { .99, 1 }, { .999, 1 }, { .99, 8 }, { .999, -4 } };
  for (const auto& t : blobs)
  {
    const double albedo = t[0];
    const int lights = static_cast<int>(t[1]);
    char name[64];
    std::snprintf(name, sizeof name, "blobs, albedo %g, %d light%s%s", albedo, std::abs(lights),
      std::abs(lights) > 1 ? "s" : "", lights < 0 ? " of both signs" : "");
    add(name,
      [=]
      {
        Image m = Medium(
          cube, one,
          [](double x, double y, double z)
          {
            const double s = std::sin(9. * x + 1.) * std::sin(11. * y) * std::sin(8. * z + 2.);
            return .05 + .95 * Smoothstep(-.3, .3, s);
          },
          [=](double D) { return (1. - albedo) / (3. * D); });
        std::vector<Seed> seeds;
        for (int i = 0; i < std::abs(lights); ++i)
        {
          const double sign = lights < 0 && i % 2 ? -.7 : 1.;
          seeds.push_back(At(m, .2 + .6 * ((i * 5) % 8) / 8., .25 + .5 * ((i * 3) % 8) / 8.,
            .3 + .4 * (i % 3) / 2., 1.5, sign * (1. + .2 * i)));
        }
        return WithSeeds(m, seeds);
      });
  }
  // labyrinths: width, wall
  const double mazes[4][3] = { { 3., 1e-6, 1e-4 }, { 3., 0., 1e-3 }, { 2., 1e-4, 1e-3 },
    { 6., 1e-3, 1e-3 } };
  for (const auto& t : mazes)
  {
    const int width = static_cast<int>(t[0]);
    const double wall = t[1], sigma = t[2];
    char name[64];
    std::snprintf(name, sizeof name, "labyrinth, corridors %d, wall %.0e", width, wall);
    add(name,
      [=]
      {
        Image m = Medium(cube, one, Labyrinth(n, width, wall, 3),
          [=](double D) { return sigma + (D < 1. ? .1 : 0.); });
        return WithSeeds(m, { At(m, .5, .5, .5) });
      });
  }
  // layers, also of voxels that are not cubes
  const double layers[4][2] = { { 1., .99 }, { 4., .99 }, { .25, .999 }, { 1., .9 } };
  for (const auto& t : layers)
  {
    const double hz = t[0], albedo = t[1];
    char name[64];
    std::snprintf(name, sizeof name, "layers, spacing 1 1 %g, albedo %g", hz, albedo);
    add(name,
      [=]
      {
        Image m = Medium(
          { { n, n, hz > 1. ? n / 2 : n } }, { { 1., 1., hz } },
          [](double x, double, double z)
          {
            const double at = z + .1 * std::sin(5. * x);
            return std::pow(10., -1.5 + 1.5 * std::sin(25. * at));
          },
          [=](double D) { return (1. - albedo) / (3. * D); });
        return WithSeeds(m, { At(m, .5, .5, .45) });
      });
  }
  // constant: D, sigma_a
  const double constants[5][3] = { { 1., 0., 0. }, { 1., 1e-3, 0. }, { .33, .01, 0. },
    { .1, .01, 1. }, { 1., .1, 0. } };
  for (const auto& t : constants)
  {
    const double D = t[0], sigma = t[1];
    const bool dam = t[2] > 0.;
    char name[64];
    std::snprintf(name, sizeof name, "constant D %g, sigma_a %g%s", D, sigma, dam ? ", a dam" : "");
    add(name,
      [=]
      {
        Image m = Medium(
          { { n, n - 7, n - 11 } }, one, [=](double, double, double) { return D; },
          [=](double) { return sigma; });
        std::vector<Seed> seeds{ At(m, .5, .4, .5) };
        if (dam)
        {
          seeds.push_back(At(m, .7, .5, .5, 3., -.5));
        }
        return WithSeeds(m, seeds);
      });
  }
  // a body, by the gradient of its scalars: noise, albedo, floor
  const double bodies[4][3] = { { 1.5, .99, 1e-4 }, { 1.5, .999, 1e-6 }, { 4., .99, 1e-4 },
    { 0., .9, 1e-3 } };
  for (const auto& t : bodies)
  {
    const double noise = t[0], albedo = t[1], floor = t[2];
    char name[64];
    std::snprintf(name, sizeof name, "body, noise %g, albedo %g, floor %.0e", noise, albedo, floor);
    add(name,
      [=]
      {
        Image m = Mapped(TissueScalars(n, noise),
          [=](vtkOpticalMediumFilter* f)
          {
            f->SetDiffusionMappingToFromScalarGradient();
            f->SetBetaFloor(floor);
            f->SetAbsorptionMappingToFromAlbedo();
            f->SetAlbedo(albedo);
          });
        return WithSeeds(m, { At(m, .35, .4, .5), At(m, .65, .55, .45, 2., .5) });
      });
  }
#ifdef BENCH_WITH_READERS
  // real data: file, voxel, gradient scale (> 0) or transfer function's ends, reach
  struct Real
  {
    const char* name;
    std::string path;
    int voxel[3];
    double from, to; // transfer function; from == to: the gradient mapping
    double reach;
    double albedo; // 0: complement
  };
  const std::string ch2 = "/usr/share/mricron/templates/ch2.nii.gz";
  const Real reals[] = {
    { "thorax_ct, aorta, 90-110", data + "/thorax_ct.vti", { 137, 115, 90 }, 90., 110., 0., 0. },
    { "thorax_ct, aorta, reach 30", data + "/thorax_ct.vti", { 137, 115, 90 }, 90., 110., 30., 0. },
    { "thorax_ct, gradient", data + "/thorax_ct.vti", { 137, 115, 90 }, 0., 0., 0., .99 },
    { "ch2, ventricle, gradient", ch2, { 84, 126, 90 }, 0., 0., 0., 0. },
    { "ch2, ventricle, 75-50", ch2, { 84, 126, 90 }, 75., 50., 20., 0. },
    { "ch2, gradient, albedo .999", ch2, { 84, 126, 90 }, 0., 0., 0., .999 },
    { "bonsai, 30-60", data + "/bonsai.nii.gz", { 128, 128, 128 }, 30., 60., 40., 0. },
    { "bonsai, gradient", data + "/bonsai.nii.gz", { 128, 100, 60 }, 0., 0., 0., .99 },
    { "engine, 60-100", data + "/engine.nii.gz", { 128, 128, 60 }, 60., 100., 30., 0. },
    { "engine, gradient", data + "/engine.nii.gz", { 128, 128, 60 }, 0., 0., 0., .9 },
    { "ct_avm, gradient", data + "/ct_avm.nii.gz", { 0, 0, 0 }, 0., 0., 0., .99 },
    { "mr_head, gradient", data + "/mr_head.nii.gz", { 128, 128, 60 }, 0., 0., 0., .99 },
    { "mr_head, gradient, complement", data + "/mr_head.nii.gz", { 128, 120, 70 }, 0., 0., 20.,
      0. },
    { "f3 seismic, gradient", data + "/f3_crop.sgy", { 0, 0, 0 }, 0., 0., 0., .99 },
    { "f3 seismic, gradient, reach", data + "/f3_crop.sgy", { 0, 0, 0 }, 0., 0., 0., .999 },
  };
  for (const Real& r : reals)
  {
    scenes.push_back({ r.name, true,
      [r, most](std::string&) -> Image
      {
        const bool any = r.voxel[0] + r.voxel[1] + r.voxel[2] > 0;
        Image image = Read(r.path, most, any ? r.voxel : nullptr);
        if (!image)
        {
          return nullptr;
        }
        vtkNew<vtkPiecewiseFunction> function;
        function->AddPoint(std::min(r.from, r.to), r.from <= r.to ? 0. : 1.);
        function->AddPoint(std::max(r.from, r.to), r.from <= r.to ? 1. : 0.);
        Image m = Mapped(image,
          [&](vtkOpticalMediumFilter* f)
          {
            f->SetReach(r.reach);
            if (r.from != r.to)
            {
              f->SetDiffusionMappingToFromTransferFunction();
              f->SetDiffusionFunction(function);
            }
            if (r.albedo > 0.)
            {
              f->SetAbsorptionMappingToFromAlbedo();
              f->SetAlbedo(r.albedo);
            }
          });
        return WithSeeds(m, { At(m, .5, .5, .5) });
      } });
  }
#else
  (void)data, (void)most;
#endif
  return scenes;
}
//------------------------------------------------------------------------------
// Scenes drawn at random: none of them is known before it is judged.

namespace
{
/** Numbers that are the same everywhere: std's distributions are not. */
class Draw
{
public:
  explicit Draw(unsigned seed)
    : engine(seed)
  {
  }
  double uniform(double from, double to)
  {
    return from + (to - from) * (static_cast<double>(this->engine()) / 4294967296.);
  }
  double logarithmic(double from, double to)
  {
    return std::exp(this->uniform(std::log(from), std::log(to)));
  }
  int integer(int from, int to)
  {
    return std::min(to, static_cast<int>(std::floor(this->uniform(from, to + 1.))));
  }
  bool chance(double part) { return this->uniform(0., 1.) < part; }

private:
  std::mt19937 engine;
};

/** Lights anywhere, most of them where matter is clear; some with a dark one among them. */
std::vector<Seed> RandomLights(Draw& draw, vtkImageData* medium, std::string& name)
{
  const int number = draw.chance(.4) ? 1 : draw.integer(2, 6);
  const bool both = number > 1 && draw.chance(.4);
  name += ", " + std::to_string(number) + (number > 1 ? " lights" : " light") +
    (both ? " of both signs" : "");
  std::vector<Seed> seeds;
  for (int i = 0; i < number; ++i)
  {
    const double x = draw.uniform(.15, .85);
    const double y = draw.uniform(.15, .85);
    const double z = draw.uniform(.15, .85);
    const double radius = draw.uniform(1., 4.);
    const double power = draw.uniform(.3, 2.) * (both && i % 2 ? -.8 : 1.);
    seeds.push_back(At(medium, x, y, z, radius, power));
  }
  return seeds;
}

/** D and sigma_a from one of several recipes; D is between `least` and 1 parts of `length`. */
std::function<double(double)> RandomAbsorption(Draw& draw, double length, std::string& name)
{
  char text[64];
  if (draw.chance(.5))
  {
    const double rest = draw.logarithmic(1e-4, .2);
    std::snprintf(text, sizeof text, ", albedo 1 - %.1g", rest);
    name += text;
    return [=](double D) { return rest / (3. * D); };
  }
  const double reach = draw.logarithmic(5., 200.) * length;
  std::snprintf(text, sizeof text, ", reach %.2g", reach);
  name += text;
  return [=](double D) { return (1. - D / length) / length + D / (reach * reach); };
}

/** A random D in (0, 1] of a kind that the fixed scenes do not have. */
Function RandomShape(Draw& draw, std::string& name)
{
  const double wall = draw.logarithmic(1e-6, .1);
  char text[64];
  std::snprintf(text, sizeof text, ", wall %.1g", wall);
  const int kind = draw.integer(0, 6);
  struct Ball
  {
    double x, y, z, r, value;
  };
  if (kind == 0) // a tree of vessels
  {
    struct Piece
    {
      double a[3], b[3], r;
    };
    std::vector<Piece> pieces;
    double radius = draw.uniform(.04, .1);
    std::vector<std::array<double, 3>> tips{ { { .5, .5, .05 } } };
    for (int level = 0; level < 5; ++level, radius *= .75)
    {
      std::vector<std::array<double, 3>> next;
      for (const std::array<double, 3>& tip : tips)
      {
        for (int branch = 0; branch < (level ? 2 : 1); ++branch)
        {
          std::array<double, 3> end;
          for (int d = 0; d < 3; ++d)
          {
            end[static_cast<std::size_t>(d)] = std::min(.98,
              std::max(.02,
                tip[static_cast<std::size_t>(d)] + draw.uniform(-.25, .25) + (d == 2 ? .15 : 0.)));
          }
          pieces.push_back({ { tip[0], tip[1], tip[2] }, { end[0], end[1], end[2] }, radius });
          next.push_back(end);
        }
      }
      tips = next;
    }
    name += "vessels" + std::string(text);
    return [=](double x, double y, double z)
    {
      const double p[3] = { x, y, z };
      for (const Piece& piece : pieces)
      {
        double along = 0., length = 0., far = 0.;
        for (int d = 0; d < 3; ++d)
        {
          const double e = piece.b[d] - piece.a[d];
          along += (p[d] - piece.a[d]) * e;
          length += e * e;
        }
        along = std::min(1., std::max(0., along / std::max(length, 1e-12)));
        for (int d = 0; d < 3; ++d)
        {
          const double e = p[d] - piece.a[d] - along * (piece.b[d] - piece.a[d]);
          far += e * e;
        }
        if (far < piece.r * piece.r)
        {
          return 1.;
        }
      }
      return wall;
    };
  }
  std::vector<Ball> balls(static_cast<std::size_t>(draw.integer(8, 60)));
  for (Ball& ball : balls)
  {
    ball.x = draw.uniform(0., 1.);
    ball.y = draw.uniform(0., 1.);
    ball.z = draw.uniform(0., 1.);
    ball.r = draw.uniform(.05, .2);
    ball.value = std::pow(wall, draw.uniform(0., 1.));
  }
  if (kind == 1 || kind == 2) // a foam: clear cells and their walls; or cells of any D
  {
    const double thick = draw.uniform(.02, .06);
    name += kind == 1 ? "foam" + std::string(text) : "grains" + std::string(text);
    return [=](double x, double y, double z)
    {
      double first = 9., second = 9., value = 1.;
      for (const Ball& ball : balls)
      {
        const double r = std::hypot(x - ball.x, std::hypot(y - ball.y, z - ball.z));
        if (r < first)
        {
          second = first;
          first = r;
          value = ball.value;
        }
        else
        {
          second = std::min(second, r);
        }
      }
      return kind == 2 ? value : (second - first < thick ? wall : 1.);
    };
  }
  if (kind == 3) // balls in matter, clear or dense
  {
    const bool clear = draw.chance(.5);
    name += (clear ? "clear balls" : "dense balls") + std::string(text);
    return [=](double x, double y, double z)
    {
      const bool inside = std::any_of(balls.begin(), balls.end(),
        [&](const Ball& b) { return std::hypot(x - b.x, std::hypot(y - b.y, z - b.z)) < b.r; });
      return inside == clear ? 1. : wall;
    };
  }
  if (kind == 4) // shells with a hole
  {
    const double number = draw.uniform(3., 8.);
    const double hole = draw.uniform(.02, .2);
    name += "shells" + std::string(text);
    return [=](double x, double y, double z)
    {
      const double r = std::hypot(x - .5, std::hypot(y - .5, z - .5));
      const bool shell = std::fmod(number * 2. * r, 1.) < .2;
      return shell && std::hypot(x - .5, y - .5) > hole ? wall : 1.;
    };
  }
  // waves: log D smooth, or cut off
  struct Wave
  {
    double k[3], phase, weight;
  };
  std::vector<Wave> waves(12);
  for (Wave& wave : waves)
  {
    const double k = draw.logarithmic(4., 60.);
    double direction[3], norm = 0.;
    for (double& c : direction)
    {
      c = draw.uniform(-1., 1.);
      norm += c * c;
    }
    for (int d = 0; d < 3; ++d)
    {
      wave.k[d] = k * direction[d] / std::sqrt(norm + 1e-9);
    }
    wave.phase = draw.uniform(0., 6.28);
    wave.weight = 1. / std::sqrt(k);
  }
  const bool cut = kind == 6;
  name += (cut ? "islands" : "waves") + std::string(text);
  return [=](double x, double y, double z)
  {
    double sum = 0., weights = 0.;
    for (const Wave& w : waves)
    {
      sum += w.weight * std::sin(w.k[0] * x + w.k[1] * y + w.k[2] * z + w.phase);
      weights += w.weight * w.weight;
    }
    const double t = sum / std::sqrt(2. * weights); // about -2 .. 2
    return cut ? (t > 0. ? 1. : wall) : std::pow(wall, 1. - Smoothstep(-1.5, 1.5, t));
  };
}

Image RandomProcedural(Draw draw, int n, std::string& name)
{
  std::array<int, 3> dims;
  std::array<double, 3> spacing{ { 1., 1., 1. } };
  const bool stretched = draw.chance(.4);
  double smallest = 1.;
  for (std::size_t d = 0; d < 3; ++d)
  {
    dims[d] = draw.integer(n / 2, n + n / 4);
    spacing[d] = stretched ? draw.logarithmic(.4, 3.) : 1.;
    smallest = d ? std::min(smallest, spacing[d]) : spacing[d];
  }
  const Function shape = RandomShape(draw, name);
  Image medium;
  if (draw.chance(.3)) // scalars, with noise, and a mapping by their gradient
  {
    const double noise = draw.uniform(0., 6.);
    Image scalars = MakeImage(dims, spacing);
    scalars->GetPointData()->SetScalars(Sample(scalars, "S",
      [&](double x, double y, double z)
      { return 40. * -std::log10(shape(x, y, z)) + draw.uniform(-noise, noise); }));
    const double rest = draw.logarithmic(1e-4, .2);
    const double floor = draw.logarithmic(1e-6, 1e-3);
    const bool albedo = draw.chance(.6);
    const double reach = draw.chance(.5) ? draw.logarithmic(5., 100.) : 0.;
    medium = Mapped(scalars,
      [&](vtkOpticalMediumFilter* f)
      {
        f->SetDiffusionMappingToFromScalarGradient();
        f->SetBetaFloor(floor);
        f->SetReach(reach);
        if (albedo)
        {
          f->SetAbsorptionMappingToFromAlbedo();
          f->SetAlbedo(1. - rest);
        }
      });
    name += ", by its gradient";
  }
  else
  {
    const std::function<double(double)> absorption = RandomAbsorption(draw, smallest, name);
    medium = Medium(
      dims, spacing, [&](double x, double y, double z) { return smallest * shape(x, y, z); },
      absorption);
  }
  Image image = WithSeeds(medium, RandomLights(draw, medium, name));
  char text[96];
  std::snprintf(text, sizeof text, ", %d %d %d", dims[0], dims[1], dims[2]);
  name += text;
  if (stretched)
  {
    std::snprintf(text, sizeof text, " of %.2g %.2g %.2g", spacing[0], spacing[1], spacing[2]);
    name += text;
  }
  return image;
}

#ifdef BENCH_WITH_READERS
Image RandomReal(Draw draw, int most, const std::string& path, std::string& name)
{
  double at[3];
  for (double& part : at)
  {
    part = draw.uniform(.2, .8);
  }
  Image image = Read(path, draw.integer(most / 2, most), nullptr, at);
  if (!image)
  {
    return nullptr;
  }
  vtkDataArray* scalars = image->GetPointData()->GetScalars();
  std::vector<double> values(static_cast<std::size_t>(scalars->GetNumberOfTuples()));
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    values[i] = scalars->GetComponent(static_cast<vtkIdType>(i), 0);
  }
  std::sort(values.begin(), values.end());
  const auto percentile = [&](double part)
  { return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))]; };
  const double middle = percentile(draw.uniform(.2, .9));
  const double width =
    std::max(1e-3, draw.uniform(.02, .3) * (percentile(.995) - percentile(.005)));
  const bool dark = draw.chance(.3); // dark matter is the clear one
  const bool window = draw.chance(.5);
  const bool albedo = draw.chance(.5);
  const double rest = draw.logarithmic(1e-4, .2);
  const double reach = draw.chance(.6) ? draw.logarithmic(8., 150.) : 0.;
  const double floor = draw.logarithmic(1e-6, 1e-3);
  const double sharper = draw.logarithmic(.5, 2.);
  vtkNew<vtkPiecewiseFunction> function;
  function->AddPoint(middle - .5 * width, dark ? 1. : 0.);
  function->AddPoint(middle + .5 * width, dark ? 0. : 1.);
  Image medium = Mapped(image,
    [&](vtkOpticalMediumFilter* f)
    {
      f->SetBetaFloor(floor);
      f->SetReach(reach);
      if (window)
      {
        f->SetDiffusionMappingToFromTransferFunction();
        f->SetDiffusionFunction(function);
      }
      else
      {
        f->SetDiffusionMappingToFromScalarGradient();
        f->Update();
        f->SetGradientScale(sharper * f->GetComputedGradientScale());
      }
      if (albedo)
      {
        f->SetAbsorptionMappingToFromAlbedo();
        f->SetAlbedo(1. - rest);
      }
    });
  char text[96];
  if (window)
  {
    std::snprintf(
      text, sizeof text, ", window %.3g +- %.2g%s", middle, .5 * width, dark ? " dark" : "");
  }
  else
  {
    std::snprintf(text, sizeof text, ", gradient x %.2g", sharper);
  }
  name += text;
  if (albedo)
  {
    std::snprintf(text, sizeof text, ", albedo 1 - %.1g", rest);
    name += text;
  }
  if (reach > 0.)
  {
    std::snprintf(text, sizeof text, ", reach %.2g", reach);
    name += text;
  }
  return WithSeeds(medium, RandomLights(draw, medium, name));
}
#endif
} // namespace

std::vector<Scene> RandomScenes(unsigned seed, int n, int most, const std::string& data)
{
  std::vector<Scene> scenes;
  Draw seeds(seed);
  const auto next = [&] { return static_cast<unsigned>(seeds.uniform(0., 4e9)); };
  const auto add = [&](const std::string& what, bool real, const Scene::Make& make)
  {
    // most images end as the filter's default has it
    const int boundary = seeds.chance(.7) ? 0 : seeds.integer(1, 2);
    const char* const ends[] = { "", "mirrors ", "black borders " };
    scenes.push_back({ std::to_string(seed) + "." + std::to_string(scenes.size() + 1) + " " +
        ends[boundary] + what,
      real, make, boundary });
  };
  for (int i = 0; i < 24; ++i)
  {
    const Draw draw(next());
    add("", false, [=](std::string& name) { return RandomProcedural(draw, n, name); });
  }
#ifdef BENCH_WITH_READERS
  const std::string templates = "/usr/share/mricron/templates/";
  const std::pair<const char*, std::string> files[] = { { "thorax_ct", data + "/thorax_ct.vti" },
    { "ct_avm", data + "/ct_avm.nii.gz" }, { "mr_head", data + "/mr_head.nii.gz" },
    { "engine", data + "/engine.nii.gz" }, { "bonsai", data + "/bonsai.nii.gz" },
    { "f3", data + "/f3_crop.sgy" }, { "volve", data + "/volve_velocity.sgy" },
    { "ch2better", templates + "ch2better.nii.gz" }, { "ch2", templates + "ch2.nii.gz" },
    { "inia19", templates + "inia19-t1-brain.nii.gz" } };
  for (int i = 0; i < 16; ++i)
  {
    const auto& file = files[static_cast<std::size_t>(i) % std::size(files)];
    const Draw draw(next());
    const std::string path = file.second;
    add(file.first, true, [=](std::string& name) { return RandomReal(draw, most, path, name); });
  }
#else
  (void)data, (void)most;
#endif
  return scenes;
}
} // namespace frugal
