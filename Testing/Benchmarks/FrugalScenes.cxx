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
  double bounds[6];
  medium->GetBounds(bounds);
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
  return { bounds[0] + best[0] * h[0], bounds[2] + best[1] * h[1], bounds[4] + best[2] * h[2],
    radius * smallest, power };
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
    const std::size_t room =
      static_cast<std::size_t>(at[0] / pitch + rooms * (at[1] / pitch + rooms * (at[2] / pitch)));
    return walls == 1 && (doors[room] >> axis & 1) ? 1. : wall;
  };
}

#ifdef BENCH_WITH_READERS
/** The file's image, cut or thinned out to `most` voxels per axis around a point. */
Image Read(const std::string& path, int most, const int* around = nullptr)
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
    const int middle = around ? around[d] : dims[d] / 2;
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
    scenes.push_back({ name, false, make });
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
      [r, most]() -> Image
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
} // namespace frugal
