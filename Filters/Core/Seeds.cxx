// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Seeds.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lighttransport
{
namespace
{
constexpr int ProgressSteps = 8;
constexpr double MostSamples = 64.;
constexpr double BorderSlack = 1e-6; // of a voxel
constexpr double LargestFloat = std::numeric_limits<float>::max();
constexpr double SmallestFloat = std::numeric_limits<float>::min();

bool IsPoint(const Grid& grid, const SphereSource& sphere)
{
  return sphere.radius < 0.5 * grid.smallestSpacing();
}

/** Voxels [first, last] that a sphere may reach, and its density at fraction 1. */
struct Footprint
{
  std::array<int, 3> first{ { 0, 0, 0 } };
  std::array<int, 3> last{ { -1, -1, -1 } };
  double density = 0.;
  bool single = false; ///< one voxel, `first`, takes all
  bool bad = false;    ///< float32 cannot hold the density
};

std::array<int, 3> NearestVoxel(const Grid& grid, const SphereSource& sphere)
{
  std::array<int, 3> nearest;
  for (int a = 0; a < 3; ++a)
  {
    nearest[a] = static_cast<int>(
      std::min<double>(std::max(std::floor(sphere.center[a] + 0.5), 0.), grid.dims[a] - 1));
  }
  return nearest;
}

Footprint FootprintOf(const Grid& grid, const SphereSource& sphere)
{
  Footprint footprint;
  double sum = 0.;
  if (!IsPoint(grid, sphere))
  {
    const double* h = grid.spacing.data();
    const double reach = sphere.radius + 0.5 * std::hypot(h[0], h[1], h[2]);
    for (int a = 0; a < 3; ++a)
    {
      const double c = sphere.center[a];
      footprint.first[a] =
        static_cast<int>(std::min<double>(std::max(std::ceil(c - reach / h[a]), 0.), grid.dims[a]));
      footprint.last[a] = static_cast<int>(
        std::max(std::min<double>(std::floor(c + reach / h[a]), grid.dims[a] - 1), -1.));
    }
    for (int k = footprint.first[2]; k <= footprint.last[2]; ++k)
    {
      for (int j = footprint.first[1]; j <= footprint.last[1]; ++j)
      {
        for (int i = footprint.first[0]; i <= footprint.last[0]; ++i)
        {
          sum += InsideFraction(grid, sphere, i, j, k);
        }
      }
    }
  }
  if (!(sum > 0.))
  {
    footprint.single = true;
    footprint.first = footprint.last = NearestVoxel(grid, sphere);
    sum = 1.;
  }
  if (sphere.power != 0.)
  {
    // In logarithms: the volume itself may leave the range of a double.
    const double size = std::log(std::abs(sphere.power)) - std::log(grid.spacing[0]) -
      std::log(grid.spacing[1]) - std::log(grid.spacing[2]) - std::log(sum);
    footprint.bad = size > std::log(LargestFloat) || size < std::log(SmallestFloat);
    footprint.density = footprint.bad ? 0. : (sphere.power < 0. ? -std::exp(size) : std::exp(size));
    const double volume = grid.voxelVolume();
    if (!footprint.bad && std::isnormal(volume))
    {
      footprint.density = sphere.power / volume / sum; // to the last digit
    }
  }
  return footprint;
}

double Interpolate(const ImageSource& image, const std::array<double, 3>& index)
{
  const Grid& grid = image.grid;
  std::array<int, 3> low;
  std::array<int, 3> high;
  std::array<double, 3> part;
  for (int a = 0; a < 3; ++a)
  {
    const double x = index[a];
    if (!(x >= -0.5 - BorderSlack && x <= grid.dims[a] - 0.5 + BorderSlack))
    {
      return 0.;
    }
    const double inside = std::min(std::max(x, 0.), grid.dims[a] - 1.);
    low[a] = std::min(static_cast<int>(inside), std::max(grid.dims[a] - 2, 0));
    high[a] = std::min(low[a] + 1, grid.dims[a] - 1);
    part[a] = inside - low[a];
  }
  const auto row = [&](int j, int k)
  {
    const double v0 = image.values[grid.index(low[0], j, k)];
    const double v1 = image.values[grid.index(high[0], j, k)];
    return v0 + part[0] * (v1 - v0);
  };
  const auto plane = [&](int k)
  {
    const double v0 = row(low[1], k);
    return v0 + part[1] * (row(high[1], k) - v0);
  };
  const double v0 = plane(low[2]);
  return v0 + part[2] * (plane(high[2]) - v0);
}

/** The mean of a voxel's samples on the image's grid. */
double Resample(
  const ImageSource& image, const std::array<int, 3>& samples, const std::array<int, 3>& voxel)
{
  double sum = 0.;
  std::array<int, 3> s;
  for (s[2] = 0; s[2] < samples[2]; ++s[2])
  {
    for (s[1] = 0; s[1] < samples[1]; ++s[1])
    {
      for (s[0] = 0; s[0] < samples[0]; ++s[0])
      {
        std::array<double, 3> index = image.map.offset;
        for (int a = 0; a < 3; ++a)
        {
          const double x = voxel[a] + (s[a] + 0.5) / samples[a] - 0.5;
          for (int b = 0; b < 3; ++b)
          {
            index[b] += x * image.map.column[a][b];
          }
        }
        sum += Interpolate(image, index);
      }
    }
  }
  return sum / (double(samples[0]) * samples[1] * samples[2]);
}

/** Samples along each axis of the sources' grid that miss no voxel of the image. */
std::array<int, 3> SamplesOf(const ImageSource& image)
{
  std::array<int, 3> samples{ { 1, 1, 1 } };
  for (int a = 0; a < 3; ++a)
  {
    double step = 0.;
    for (double component : image.map.column[a])
    {
      step = std::max(step, std::abs(component));
    }
    samples[a] = static_cast<int>(std::ceil(std::min(std::max(step - 1e-6, 1.), MostSamples)));
  }
  return samples;
}
/**
 * Where to cut the part of a segment, from + t along, into pieces: at the voxels'
 * faces where it is a voxel wide, so that each voxel takes its exact length, else
 * evenly.
 */
std::vector<double> CutsOf(const Grid& grid, const std::array<double, 3>& from,
  const std::array<double, 3>& along, const std::array<double, 2>& part, double length,
  double radius0, double radius1)
{
  std::vector<double> cuts{ part[0], part[1] };
  if (std::max(radius0, radius1) < 0.5 * grid.smallestSpacing())
  {
    for (int a = 0; a < 3; ++a)
    {
      const double begin = from[a] + part[0] * along[a];
      const double end = from[a] + part[1] * along[a];
      const double first = std::ceil(std::min(begin, end) - 0.5) + 0.5;
      for (int n = 0; n < grid.dims[a] + 3 && first + n < std::max(begin, end); ++n)
      {
        cuts.push_back((first + n - from[a]) / along[a]);
      }
    }
    std::sort(cuts.begin(), cuts.end());
    return cuts;
  }
  const double step = std::max(0.5 * grid.smallestSpacing(), 0.25 * std::min(radius0, radius1));
  const double pieces = std::max(1., std::ceil(length * (part[1] - part[0]) / step));
  cuts.clear();
  for (double c = 0.; c < pieces; c += 1.)
  {
    cuts.push_back(part[0] + (part[1] - part[0]) * c / pieces);
  }
  cuts.push_back(part[1]);
  return cuts;
}
} // namespace

//------------------------------------------------------------------------------
bool MeetsDomain(const Grid& grid, const SphereSource& sphere)
{
  double distance2 = 0.;
  bool outside = false;
  for (int a = 0; a < 3; ++a)
  {
    const double c = sphere.center[a];
    const double excess = std::max({ -0.5 - c, c - (grid.dims[a] - 0.5), 0. });
    outside = outside || excess > BorderSlack;
    distance2 += excess * grid.spacing[a] * excess * grid.spacing[a];
  }
  return !outside || (!IsPoint(grid, sphere) && distance2 < sphere.radius * sphere.radius);
}

//------------------------------------------------------------------------------
double InsideFraction(const Grid& grid, const SphereSource& sphere, int i, int j, int k)
{
  const double* h = grid.spacing.data();
  const double x = std::abs(i - sphere.center[0]) * h[0];
  const double y = std::abs(j - sphere.center[1]) * h[1];
  const double z = std::abs(k - sphere.center[2]) * h[2];
  const double d = std::sqrt(x * x + y * y + z * z);
  const double w = d > 0. ? (x * h[0] + y * h[1] + z * h[2]) / d : grid.smallestSpacing();
  return std::min(std::max(0.5 + (sphere.radius - d) / w, 0.), 1.);
}

//------------------------------------------------------------------------------
bool StrokeToSpheres(const Grid& grid, const Stroke& stroke, std::vector<SphereSource>& spheres)
{
  const std::size_t before = spheres.size();
  std::vector<double> lengths; // of the pieces, one for each new sphere
  double length = 0.;
  double counted = 0.;
  for (std::size_t p = 0; p + 1 < stroke.points.size(); ++p)
  {
    const auto& from = stroke.points[p];
    const auto& to = stroke.points[p + 1];
    std::array<double, 3> along;
    const double widest = std::max(stroke.radius[p], stroke.radius[p + 1]);
    double t0 = 0.; // the part of the segment that may meet the domain
    double t1 = 1.;
    for (int a = 0; a < 3; ++a)
    {
      along[a] = to[a] - from[a];
      const double low = -1. - widest / grid.spacing[a];
      const double high = grid.dims[a] + widest / grid.spacing[a];
      if (std::abs(along[a]) > 1e-9 * (high - low))
      {
        const double ta = (low - from[a]) / along[a];
        const double tb = (high - from[a]) / along[a];
        t0 = std::max(t0, std::min(ta, tb));
        t1 = std::min(t1, std::max(ta, tb));
      }
    }
    const double segment = std::hypot(
      along[0] * grid.spacing[0], along[1] * grid.spacing[1], along[2] * grid.spacing[2]);
    length += segment;
    if (!(segment > 0.) || t0 >= t1)
    {
      continue;
    }
    const std::vector<double> cuts =
      CutsOf(grid, from, along, { { t0, t1 } }, segment, stroke.radius[p], stroke.radius[p + 1]);
    for (std::size_t c = 0; c + 1 < cuts.size(); ++c)
    {
      const double t = 0.5 * (cuts[c] + cuts[c + 1]);
      SphereSource sphere;
      for (int a = 0; a < 3; ++a)
      {
        sphere.center[a] = from[a] + t * along[a];
      }
      sphere.radius = (1. - t) * stroke.radius[p] + t * stroke.radius[p + 1];
      sphere.power = (1. - t) * stroke.power[p] + t * stroke.power[p + 1];
      if (MeetsDomain(grid, sphere))
      {
        spheres.push_back(sphere);
        lengths.push_back(segment * (cuts[c + 1] - cuts[c]));
        counted += lengths.back();
      }
    }
  }
  if (!(length > 0.) && !stroke.points.empty())
  {
    SphereSource sphere;
    sphere.center = stroke.points.front();
    for (std::size_t p = 0; p < stroke.points.size(); ++p)
    {
      sphere.radius += stroke.radius[p] / static_cast<double>(stroke.points.size());
      sphere.power += stroke.power[p] / static_cast<double>(stroke.points.size());
    }
    if (MeetsDomain(grid, sphere))
    {
      spheres.push_back(sphere);
    }
    return spheres.size() > before;
  }
  for (std::size_t s = before; s < spheres.size(); ++s)
  {
    spheres[s].power *= lengths[s - before] / counted;
  }
  return spheres.size() > before;
}

//------------------------------------------------------------------------------
SourceReport ComputeSources(const Grid& grid, const std::vector<SphereSource>& spheres,
  const std::vector<ImageSource>& images, float* q, const ParallelFor& parallel,
  const ProgressFunction& progress)
{
  SourceReport report;

  // Where the spheres lie and how dense they are; then the spheres of each slice.
  std::vector<Footprint> footprints(spheres.size());
  parallel(static_cast<std::int64_t>(spheres.size()),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t s = begin; s < end; ++s)
      {
        footprints[s] = FootprintOf(grid, spheres[s]);
      }
    });
  const int slices = grid.dims[2];
  std::vector<std::vector<std::int64_t>> spheresOf(slices);
  for (std::size_t s = 0; s < spheres.size(); ++s)
  {
    if (footprints[s].bad)
    {
      report.badSphere = static_cast<std::int64_t>(s);
      return report;
    }
    for (int k = footprints[s].first[2]; k <= footprints[s].last[2]; ++k)
    {
      spheresOf[k].push_back(static_cast<std::int64_t>(s));
    }
  }
  std::vector<std::array<int, 3>> samples;
  samples.reserve(images.size());
  for (const ImageSource& image : images)
  {
    samples.push_back(SamplesOf(image));
  }

  const int nx = grid.dims[0];
  const int ny = grid.dims[1];
  std::vector<double> sums(slices, 0.);
  std::vector<std::int64_t> bad(slices, -1);
  const auto slice = [&](int k, std::vector<double>& plane, std::vector<double>& row)
  {
    std::fill(plane.begin(), plane.end(), 0.);
    for (std::int64_t s : spheresOf[k])
    {
      const Footprint& footprint = footprints[s];
      for (int j = footprint.first[1]; j <= footprint.last[1]; ++j)
      {
        for (int i = footprint.first[0]; i <= footprint.last[0]; ++i)
        {
          plane[i + std::int64_t(nx) * j] +=
            footprint.density * (footprint.single ? 1. : InsideFraction(grid, spheres[s], i, j, k));
        }
      }
    }
    for (std::size_t m = 0; m < images.size(); ++m)
    {
      for (int j = 0; j < ny; ++j)
      {
        double* out = plane.data() + std::int64_t(nx) * j;
        if (images[m].values)
        {
          for (int i = 0; i < nx; ++i)
          {
            row[i] = Resample(images[m], samples[m], { { i, j, k } });
          }
        }
        else
        {
          images[m].read(grid.index(0, j, k), nx, row.data());
        }
        for (int i = 0; i < nx; ++i)
        {
          out[i] += images[m].transfer(row[i]);
        }
      }
    }
    float* out = q + grid.index(0, 0, k);
    for (std::size_t i = 0; i < plane.size(); ++i)
    {
      if (!(std::abs(plane[i]) <= LargestFloat))
      {
        bad[k] = grid.index(0, 0, k) + static_cast<std::int64_t>(i);
        return;
      }
      out[i] = static_cast<float>(plane[i]);
      sums[k] += out[i];
    }
  };
  for (int step = 0; step < ProgressSteps; ++step)
  {
    if (progress && !progress(double(step) / ProgressSteps))
    {
      report.cancelled = true;
      return report;
    }
    const int first = static_cast<int>(std::int64_t(slices) * step / ProgressSteps);
    const int last = static_cast<int>(std::int64_t(slices) * (step + 1) / ProgressSteps);
    parallel(last - first,
      [&](std::int64_t begin, std::int64_t end)
      {
        std::vector<double> plane(static_cast<std::size_t>(nx) * ny);
        std::vector<double> row(nx);
        for (std::int64_t k = begin; k < end; ++k)
        {
          slice(first + static_cast<int>(k), plane, row);
        }
      });
  }
  for (int k = 0; k < slices; ++k)
  {
    report.power += sums[k];
    report.badVoxel = report.badVoxel < 0 ? bad[k] : report.badVoxel;
  }
  report.power *= grid.voxelVolume();
  report.cancelled = progress && !progress(1.);
  return report;
}
} // namespace lighttransport
