// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Gradient.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

namespace lighttransport
{
namespace
{
constexpr int TileRows = 16;
constexpr int TileSlices = 16;
constexpr int ProgressSteps = 8;
constexpr std::int64_t ReadLength = 4096;

/** out[i] += sum_t kernel(i)[t] in[i + t - radius], the taps that lie inside. */
void ConvolveRow(int n, int radius, const double* kernels, const double* in, double* out)
{
  const int taps = 2 * radius + 1;
  const auto border = [&](int begin, int end)
  {
    for (int i = begin; i < end; ++i)
    {
      const double* kernel = kernels + std::size_t(i) * taps;
      const int first = std::max(0, radius - i);
      const int last = std::min(taps, n + radius - i);
      double sum = 0.;
      for (int t = first; t < last; ++t)
      {
        sum += kernel[t] * in[i + t - radius];
      }
      out[i] = sum;
    }
  };
  if (n <= 2 * radius)
  {
    border(0, n);
    return;
  }
  border(0, radius);
  const double* kernel = kernels + std::size_t(radius) * taps;
  std::fill(out + radius, out + n - radius, 0.);
  for (int t = 0; t < taps; ++t)
  {
    const double weight = kernel[t];
    for (int i = radius; i < n - radius; ++i)
    {
      out[i] += weight * in[i + t - radius];
    }
  }
  border(n - radius, n);
}

void AddScaled(int n, double factor, const double* in, double* out)
{
  for (int i = 0; i < n; ++i)
  {
    out[i] += factor * in[i];
  }
}
} // namespace

//------------------------------------------------------------------------------
ValueRange FindValueRange(std::int64_t size, const ValueReader& read, const ParallelFor& parallel)
{
  ValueRange range;
  range.min = std::numeric_limits<double>::infinity();
  range.max = -std::numeric_limits<double>::infinity();
  std::mutex mutex;
  parallel(size,
    [&](std::int64_t begin, std::int64_t end)
    {
      ValueRange mine;
      mine.min = std::numeric_limits<double>::infinity();
      mine.max = -std::numeric_limits<double>::infinity();
      std::vector<double> values(static_cast<std::size_t>(std::min(ReadLength, end - begin)));
      for (std::int64_t i = begin; i < end; i += ReadLength)
      {
        const std::int64_t n = std::min(ReadLength, end - i);
        read(i, n, values.data());
        for (std::int64_t l = 0; l < n; ++l)
        {
          const double value = values[l];
          if (std::isnan(value))
          {
            ++mine.numberOfNaN;
            mine.firstNaN = mine.firstNaN < 0 ? i + l : mine.firstNaN;
          }
          else if (std::isinf(value))
          {
            mine.firstInfinite = mine.firstInfinite < 0 ? i + l : mine.firstInfinite;
          }
          else
          {
            ++mine.numberOfFinite;
            mine.min = std::min(mine.min, value);
            mine.max = std::max(mine.max, value);
          }
        }
      }
      const std::lock_guard<std::mutex> lock(mutex);
      range.min = std::min(range.min, mine.min);
      range.max = std::max(range.max, mine.max);
      range.numberOfFinite += mine.numberOfFinite;
      range.numberOfNaN += mine.numberOfNaN;
      const auto first = [](std::int64_t a, std::int64_t b) {
        return a < 0 ? b : b < 0 ? a : std::min(a, b);
      };
      range.firstNaN = first(range.firstNaN, mine.firstNaN);
      range.firstInfinite = first(range.firstInfinite, mine.firstInfinite);
    });
  if (range.numberOfFinite == 0)
  {
    range.min = range.max = 0.;
  }
  return range;
}

//------------------------------------------------------------------------------
GradientMagnitude::GradientMagnitude(const Grid& grid, double sigma)
  : grid(grid)
{
  for (int a = 0; a < 3; ++a)
  {
    Axis& axis = this->axes[a];
    const int n = grid.dims[a];
    const double h = grid.spacing[a];
    // In voxels; beyond the volume's size the weights are as good as flat.
    const double s = std::min(std::max(sigma / h, 1. / 6.), 1e3 * n);
    axis.radius = static_cast<int>(std::min<double>(std::max(1., std::ceil(3. * s)), n - 1));
    const int taps = 2 * axis.radius + 1;
    axis.weight.resize(taps);
    axis.offset.resize(taps);
    double sum = 0.;
    double sum2 = 0.;
    for (int t = 0; t < taps; ++t)
    {
      const double x = t - axis.radius;
      axis.weight[t] = std::exp(-0.5 * (x / s) * (x / s));
      sum += axis.weight[t];
      sum2 += axis.weight[t] * x * x;
    }
    axis.unit = axis.radius > 0 ? std::sqrt(sum2 / sum) : 1.;
    for (int t = 0; t < taps; ++t)
    {
      axis.offset[t] = (t - axis.radius) / axis.unit;
    }
    axis.unit *= h;

    axis.smooth.assign(static_cast<std::size_t>(n) * taps, 0.);
    axis.slope.assign(static_cast<std::size_t>(n) * taps, 0.);
    for (int i = 0; i < n; ++i)
    {
      const int first = std::max(0, axis.radius - i);
      const int last = std::min(taps, n + axis.radius - i);
      double m0 = 0.;
      double m1 = 0.;
      double m2 = 0.;
      for (int t = first; t < last; ++t)
      {
        m0 += axis.weight[t];
        m1 += axis.weight[t] * axis.offset[t];
        m2 += axis.weight[t] * axis.offset[t] * axis.offset[t];
      }
      const double mean = m1 / m0;
      const double variance = m2 / m0 - mean * mean;
      for (int t = first; t < last; ++t)
      {
        const std::size_t at = static_cast<std::size_t>(i) * taps + t;
        axis.smooth[at] = axis.weight[t] / m0;
        axis.slope[at] =
          axis.radius > 0 ? axis.smooth[at] * (axis.offset[t] - mean) / (variance * axis.unit) : 0.;
      }
    }
  }
}

//------------------------------------------------------------------------------
/** A block of rows and slices, and the planes of values around one slice of it. */
struct GradientMagnitude::Tile
{
  int j0 = 0, j1 = 0;   ///< rows to compute
  int jr0 = 0, jr1 = 0; ///< rows that are read
  int nx = 0;
  std::int64_t planeSize = 0;
  std::vector<double> values; ///< a ring of 2 radius + 1 planes
  std::vector<char> hole;     ///< does a plane of the ring have holes
  std::vector<double> z;      ///< planes after the pass along z
  std::vector<double> y;      ///< rows after the pass along y
  std::vector<double> x;      ///< rows after the pass along x

  double* plane(int k) { return &this->values[(k % int(this->hole.size())) * this->planeSize]; }
};

//------------------------------------------------------------------------------
bool GradientMagnitude::compute(const ValueReader& read, double reference, double factor,
  float* magnitude, const ParallelFor& parallel, const ProgressFunction& progress) const
{
  const auto& dims = this->grid.dims;
  const int rows = (dims[1] + TileRows - 1) / TileRows;
  const int slices = (dims[2] + TileSlices - 1) / TileSlices;
  const std::int64_t tiles = std::int64_t(rows) * slices;
  for (int step = 0; step < ProgressSteps; ++step)
  {
    if (progress && !progress(double(step) / ProgressSteps))
    {
      return false;
    }
    const std::int64_t first = tiles * step / ProgressSteps;
    parallel(tiles * (step + 1) / ProgressSteps - first,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t tile = first + begin; tile < first + end; ++tile)
        {
          const int j0 = static_cast<int>(tile % rows) * TileRows;
          const int k0 = static_cast<int>(tile / rows) * TileSlices;
          this->computeTile(read, reference, factor, magnitude, j0,
            std::min(j0 + TileRows, dims[1]), k0, std::min(k0 + TileSlices, dims[2]));
        }
      });
  }
  return !progress || progress(1.);
}

//------------------------------------------------------------------------------
void GradientMagnitude::computeTile(const ValueReader& read, double reference, double factor,
  float* magnitude, int j0, int j1, int k0, int k1) const
{
  const auto& dims = this->grid.dims;
  const int ry = this->axes[1].radius;
  const int rz = this->axes[2].radius;
  Tile tile;
  tile.j0 = j0;
  tile.j1 = j1;
  tile.jr0 = std::max(0, j0 - ry);
  tile.jr1 = std::min(dims[1], j1 + ry);
  tile.nx = dims[0];
  tile.planeSize = std::int64_t(tile.jr1 - tile.jr0) * tile.nx;
  tile.hole.resize(2 * rz + 1);
  tile.values.resize(tile.hole.size() * tile.planeSize);

  const auto readPlane = [&](int k)
  {
    double* plane = tile.plane(k);
    read(this->grid.index(0, tile.jr0, k), tile.planeSize, plane);
    char hole = 0;
    for (std::int64_t i = 0; i < tile.planeSize; ++i)
    {
      plane[i] -= reference;
      hole |= static_cast<char>(std::isnan(plane[i]));
    }
    tile.hole[k % tile.hole.size()] = hole;
  };

  int read1 = std::max(0, k0 - rz);
  for (int k = k0; k < k1; ++k)
  {
    const int last = std::min(dims[2], k + rz + 1);
    for (; read1 < last; ++read1)
    {
      readPlane(read1);
    }
    bool holes = false;
    for (int kk = std::max(0, k - rz); kk < last; ++kk)
    {
      holes = holes || tile.hole[kk % tile.hole.size()];
    }
    if (holes)
    {
      this->fitHoles(tile, k, factor, magnitude);
    }
    else
    {
      this->fitWhole(tile, k, factor, magnitude);
    }
  }
}

//------------------------------------------------------------------------------
// All weights are there: one kernel per axis and position.
void GradientMagnitude::fitWhole(Tile& tile, int k, double factor, float* magnitude) const
{
  const int nx = tile.nx;
  const std::int64_t np = tile.planeSize;
  const Axis& ax = this->axes[0];
  const Axis& ay = this->axes[1];
  const Axis& az = this->axes[2];

  // Along z: smoothed values and slope.
  tile.z.assign(2 * np, 0.);
  double* zSmooth = tile.z.data();
  double* zSlope = zSmooth + np;
  for (int t = std::max(0, az.radius - k);
       t < std::min(2 * az.radius + 1, this->grid.dims[2] + az.radius - k); ++t)
  {
    const double* plane = tile.plane(k + t - az.radius);
    AddScaled(static_cast<int>(np), az.smoothAt(k)[t], plane, zSmooth);
    AddScaled(static_cast<int>(np), az.slopeAt(k)[t], plane, zSlope);
  }

  tile.x.resize(3 * std::size_t(nx));
  double* gx = tile.x.data();
  double* gy = gx + nx;
  double* gz = gy + nx;
  for (int j = tile.j0; j < tile.j1; ++j)
  {
    // Along y.
    tile.y.assign(3 * std::size_t(nx), 0.);
    double* both = tile.y.data();
    double* ySlope = both + nx;
    double* zSlopeSmooth = ySlope + nx;
    for (int t = std::max(0, ay.radius - j);
         t < std::min(2 * ay.radius + 1, this->grid.dims[1] + ay.radius - j); ++t)
    {
      const std::int64_t row = std::int64_t(j + t - ay.radius - tile.jr0) * nx;
      AddScaled(nx, ay.smoothAt(j)[t], zSmooth + row, both);
      AddScaled(nx, ay.slopeAt(j)[t], zSmooth + row, ySlope);
      AddScaled(nx, ay.smoothAt(j)[t], zSlope + row, zSlopeSmooth);
    }
    // Along x.
    ConvolveRow(nx, ax.radius, ax.slope.data(), both, gx);
    ConvolveRow(nx, ax.radius, ax.smooth.data(), ySlope, gy);
    ConvolveRow(nx, ax.radius, ax.smooth.data(), zSlopeSmooth, gz);
    float* out = magnitude + this->grid.index(0, j, k);
    for (int i = 0; i < nx; ++i)
    {
      out[i] =
        static_cast<float>(factor * std::sqrt(gx[i] * gx[i] + gy[i] * gy[i] + gz[i] * gz[i]));
    }
  }
}

//------------------------------------------------------------------------------
// Some weights are 0: the moments of the weights w and of w S about the voxel,
// offsets u in each axis' unit, then the centred normal equations.
void GradientMagnitude::fitHoles(Tile& tile, int k, double factor, float* magnitude) const
{
  const int nx = tile.nx;
  const std::int64_t np = tile.planeSize;
  const Axis& ax = this->axes[0];
  const Axis& ay = this->axes[1];
  const Axis& az = this->axes[2];

  // Along z: sums of w u^p (p = 0, 1, 2) and of w S u^p (p = 0, 1).
  tile.z.assign(5 * np, 0.);
  double* zw[3] = { tile.z.data(), tile.z.data() + np, tile.z.data() + 2 * np };
  double* zs[2] = { tile.z.data() + 3 * np, tile.z.data() + 4 * np };
  for (int t = std::max(0, az.radius - k);
       t < std::min(2 * az.radius + 1, this->grid.dims[2] + az.radius - k); ++t)
  {
    const double* plane = tile.plane(k + t - az.radius);
    const double w = az.weight[t];
    const double u = az.offset[t];
    for (std::int64_t i = 0; i < np; ++i)
    {
      if (!std::isnan(plane[i]))
      {
        zw[0][i] += w;
        zw[1][i] += w * u;
        zw[2][i] += w * u * u;
        zs[0][i] += w * plane[i];
        zs[1][i] += w * u * plane[i];
      }
    }
  }

  // Moments by powers of u along (y, z), then along (x, y, z).
  struct Moment
  {
    int px, py, pz;
  };
  static const Moment yz[9] = { { 0, 0, 0 }, { 0, 0, 1 }, { 0, 0, 2 }, { 0, 1, 0 }, { 0, 1, 1 },
    { 0, 2, 0 }, { 0, 0, 0 }, { 0, 0, 1 }, { 0, 1, 0 } };
  tile.x.resize(14 * std::size_t(nx));
  std::vector<double> kernel(2 * std::size_t(ax.radius) + 1);
  const auto alongX = [&](int power, const double* in, double* out)
  {
    for (int i = 0; i < nx; ++i)
    {
      double sum = 0.;
      for (int t = std::max(0, ax.radius - i); t < std::min(2 * ax.radius + 1, nx + ax.radius - i);
           ++t)
      {
        const double u = ax.offset[t];
        const double w = ax.weight[t] * (power == 0 ? 1. : power == 1 ? u : u * u);
        sum += w * in[i + t - ax.radius];
      }
      out[i] = sum;
    }
  };
  const double* here = tile.plane(k);
  for (int j = tile.j0; j < tile.j1; ++j)
  {
    tile.y.assign(9 * std::size_t(nx), 0.);
    for (int t = std::max(0, ay.radius - j);
         t < std::min(2 * ay.radius + 1, this->grid.dims[1] + ay.radius - j); ++t)
    {
      const std::int64_t row = std::int64_t(j + t - ay.radius - tile.jr0) * nx;
      const double u = ay.offset[t];
      for (int m = 0; m < 9; ++m)
      {
        const double* in = (m < 6 ? zw[yz[m].pz] : zs[yz[m].pz]) + row;
        const int p = yz[m].py;
        const double w = ay.weight[t] * (p == 0 ? 1. : p == 1 ? u : u * u);
        AddScaled(nx, w, in, &tile.y[std::size_t(m) * nx]);
      }
    }
    const auto y = [&](int m) { return &tile.y[std::size_t(m) * nx]; };
    const auto x = [&](int m) { return &tile.x[std::size_t(m) * nx]; };
    alongX(0, y(0), x(0));  // w
    alongX(1, y(0), x(1));  // w ux
    alongX(0, y(3), x(2));  // w uy
    alongX(0, y(1), x(3));  // w uz
    alongX(2, y(0), x(4));  // w ux ux
    alongX(1, y(3), x(5));  // w ux uy
    alongX(1, y(1), x(6));  // w ux uz
    alongX(0, y(5), x(7));  // w uy uy
    alongX(0, y(4), x(8));  // w uy uz
    alongX(0, y(2), x(9));  // w uz uz
    alongX(0, y(6), x(10)); // w S
    alongX(1, y(6), x(11)); // w S ux
    alongX(0, y(8), x(12)); // w S uy
    alongX(0, y(7), x(13)); // w S uz

    float* out = magnitude + this->grid.index(0, j, k);
    const double* centre = here + std::int64_t(j - tile.jr0) * nx;
    for (int i = 0; i < nx; ++i)
    {
      if (std::isnan(centre[i]))
      {
        out[i] = -1.f;
        continue;
      }
      // The weights of the voxel itself are 1, so w >= 1.
      const double w = x(0)[i];
      const double m[3] = { x(1)[i] / w, x(2)[i] / w, x(3)[i] / w };
      const double s = x(10)[i] / w;
      // A ridge far below the variances (1 in the interior) bounds degenerate directions.
      constexpr double ridge = 1e-9;
      const double xx = x(4)[i] / w - m[0] * m[0] + ridge;
      const double xy = x(5)[i] / w - m[0] * m[1];
      const double xz = x(6)[i] / w - m[0] * m[2];
      const double yy = x(7)[i] / w - m[1] * m[1] + ridge;
      const double yzz = x(8)[i] / w - m[1] * m[2];
      const double zz = x(9)[i] / w - m[2] * m[2] + ridge;
      const double cx = x(11)[i] / w - m[0] * s;
      const double cy = x(12)[i] / w - m[1] * s;
      const double cz = x(13)[i] / w - m[2] * s;
      // L D L^T of the 3x3 matrix.
      const double l10 = xy / xx;
      const double l20 = xz / xx;
      const double d1 = std::max(yy - l10 * xy, ridge);
      const double l21 = (yzz - l20 * xy) / d1;
      const double d2 = std::max(zz - l20 * xz - l21 * l21 * d1, ridge);
      const double ry = cy - l10 * cx;
      const double rz = cz - l20 * cx - l21 * ry;
      const double bz = rz / d2;
      const double by = ry / d1 - l21 * bz;
      const double bx = cx / xx - l10 * by - l20 * bz;
      const double gx = bx / ax.unit;
      const double gy = by / ay.unit;
      const double gz = bz / az.unit;
      out[i] = static_cast<float>(factor * std::sqrt(gx * gx + gy * gy + gz * gz));
    }
  }
}
} // namespace lighttransport
