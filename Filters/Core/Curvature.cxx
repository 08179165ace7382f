// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Curvature.h"

#include "Core/Cholesky.h"
#include "Core/Kernel.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>

// GCC 12 inlines neither templates nor std::sqrt into the clones of a function by itself.
#if defined(__GNUC__) || defined(__clang__)
#define ALWAYS_INLINE inline __attribute__((always_inline))
#define BUILTIN(name) __builtin_##name
#else
#define ALWAYS_INLINE inline
#define BUILTIN(name) std::name
#endif

namespace lighttransport
{
namespace
{
constexpr double SmallestSigma = 0.4;    // voxels: well conditioned with three points
constexpr double FlatBelow = 3.;         // times the gradient's noise; twice this shows in full
constexpr double LargestCurvature = 2.;  // per smallest spacing
constexpr double SmallestValue = 1e-300; // a smaller range cannot be scaled to 1
constexpr double LargestNoise = 1e3;     // of the largest value: nothing is left
constexpr double Ridge = 1e-7;           // of the fit around holes
constexpr int ProgressSteps = 16;
constexpr std::int64_t MinimumTiles = 64; // enough for many threads
constexpr int NumberOfNoiseSamples = 1 << 14;

/** Rows are handled in blocks of this many values, which stay in registers. */
template <class Real>
constexpr int Block = 64 / sizeof(Real);

// clang-format off
ALWAYS_INLINE float Sqrt(float x) { return BUILTIN(sqrtf)(x); }
ALWAYS_INLINE double Sqrt(double x) { return BUILTIN(sqrt)(x); }
ALWAYS_INLINE float Abs(float x) { return BUILTIN(fabsf)(x); }
ALWAYS_INLINE double Abs(double x) { return BUILTIN(fabs)(x); }
ALWAYS_INLINE float SignOf(float x) { return BUILTIN(copysignf)(1.f, x); }
ALWAYS_INLINE double SignOf(double x) { return BUILTIN(copysign)(1., x); }
// clang-format on

//------------------------------------------------------------------------------
// The passes. A block of values is kept in registers while the taps go by.

/** z[0..2][i] = sum_t k[0..2][t] planes[t][i], i in [0, n), n a multiple of the block. */
template <class Real>
ALWAYS_INLINE void alongZ(std::int64_t n, int taps, const Real* const* planes, const Real* k0,
  const Real* k1, const Real* k2, Real* const* z)
{
  constexpr int B = Block<Real>;
  for (std::int64_t i = 0; i < n; i += B)
  {
    Real a[3][B] = {};
    for (int t = 0; t < taps; ++t)
    {
      const Real* p = planes[t] + i;
      for (int l = 0; l < B; ++l)
      {
        a[0][l] += k0[t] * p[l];
        a[1][l] += k1[t] * p[l];
        a[2][l] += k2[t] * p[l];
      }
    }
    for (int m = 0; m < 3; ++m)
    {
      for (int l = 0; l < B; ++l)
      {
        z[m][i + l] = a[m][l];
      }
    }
  }
}

/**
 * Rows after the pass along y, named by the derivatives along y and z: 00, 10, 20
 * from z[0], 01, 11 from z[1], 02 from z[2]; z[m] points at the first tap's row.
 */
template <class Real>
ALWAYS_INLINE void alongY(int n, int taps, std::int64_t pitch, const Real* const* z, const Real* k0,
  const Real* k1, const Real* k2, Real* const* y)
{
  constexpr int B = Block<Real>;
  for (int i = 0; i < n; i += B)
  {
    Real a[6][B] = {};
    for (int t = 0; t < taps; ++t)
    {
      const Real* p0 = z[0] + t * pitch + i;
      const Real* p1 = z[1] + t * pitch + i;
      const Real* p2 = z[2] + t * pitch + i;
      for (int l = 0; l < B; ++l)
      {
        a[0][l] += k0[t] * p0[l];
        a[1][l] += k1[t] * p0[l];
        a[2][l] += k2[t] * p0[l];
        a[3][l] += k0[t] * p1[l];
        a[4][l] += k1[t] * p1[l];
        a[5][l] += k0[t] * p2[l];
      }
    }
    for (int m = 0; m < 6; ++m)
    {
      for (int l = 0; l < B; ++l)
      {
        y[m][i + l] = a[m][l];
      }
    }
  }
}

/**
 * Derivatives x, y, z, xx, xy, xz, yy, yz, zz from the rows of alongY; y[m] points
 * at the first tap of output 0. All positions use the same kernel.
 */
template <class Real>
ALWAYS_INLINE void alongX(int n, int taps, const Real* const* y, const Real* k0, const Real* k1,
  const Real* k2, Real* const* d)
{
  constexpr int B = Block<Real> / 2;
  for (int i = 0; i < n; i += B)
  {
    Real a[9][B] = {};
    for (int t = 0; t < taps; ++t)
    {
      const int at = i + t;
      for (int l = 0; l < B; ++l)
      {
        a[0][l] += k1[t] * y[0][at + l];
        a[3][l] += k2[t] * y[0][at + l];
        a[1][l] += k0[t] * y[1][at + l];
        a[4][l] += k1[t] * y[1][at + l];
        a[6][l] += k0[t] * y[2][at + l];
        a[2][l] += k0[t] * y[3][at + l];
        a[5][l] += k1[t] * y[3][at + l];
        a[7][l] += k0[t] * y[4][at + l];
        a[8][l] += k0[t] * y[5][at + l];
      }
    }
    for (int m = 0; m < 9; ++m)
    {
      for (int l = 0; l < B; ++l)
      {
        d[m][i + l] = a[m][l];
      }
    }
  }
}

/** What turns derivatives into curvatures. */
template <class Real>
struct Scale
{
  Real flat; ///< 3 noise_g, > 0
  Real flat2;
  Real sign; ///< of the normal
  Real unit; ///< 1/h
};

/**
 * Rows of k1, k2, mean and Gaussian curvature and of what is 0 where there is no
 * surface, from rows of derivatives.
 */
template <class Real>
ALWAYS_INLINE void curvatures(int n, const Real* LIGHTTRANSPORT_RESTRICT d, std::int64_t pitch,
  const Scale<Real>& scale, float* LIGHTTRANSPORT_RESTRICT out)
{
  const Real* gx = d;
  const Real* gy = d + pitch;
  const Real* gz = d + 2 * pitch;
  const Real* hxx = d + 3 * pitch;
  const Real* hxy = d + 4 * pitch;
  const Real* hxz = d + 5 * pitch;
  const Real* hyy = d + 6 * pitch;
  const Real* hyz = d + 7 * pitch;
  const Real* hzz = d + 8 * pitch;
  float* k1 = out;
  float* k2 = out + pitch;
  float* mean = out + 2 * pitch;
  float* gaussian = out + 3 * pitch;
  float* surface = out + 4 * pitch;
  const Real flat = scale.flat;
  const Real flat2 = scale.flat2;
  const Real unit = scale.unit;
  const Real sign = scale.sign;
  const Real one = 1;
  const Real half = Real(0.5);
  const Real two = 2;
  const Real atFlat = Real(1.99999); // 2, less the rounding of flat / length
  const Real most = Real(LargestCurvature);
  for (int i = 0; i < n; ++i)
  {
    const Real squared = gx[i] * gx[i] + gy[i] * gy[i] + gz[i] * gz[i];
    // No selects, of which GCC 12 makes branches: max(a, b) = (a + b + |a - b|) / 2.
    const Real length = Sqrt(half * (squared + flat2 + Abs(squared - flat2)));
    const Real inverse = one / length;
    const Real t = atFlat - two * flat * inverse;
    const Real t0 = half * (t + Abs(t));
    const Real t1 = half * (t0 + one - Abs(t0 - one));
    const Real up = t1 * t1 * (Real(3) - t1 - t1);
    // Tangents u, v (Duff et al., Building an orthonormal basis, revisited, JCGT 2017).
    const Real nx = gx[i] * inverse;
    const Real ny = gy[i] * inverse;
    const Real nz = gz[i] * inverse;
    const Real s = SignOf(nz);
    const Real a = -one / (s + nz);
    const Real b = nx * ny * a;
    const Real ux = one + s * nx * nx * a;
    const Real uy = s * b;
    const Real uz = -s * nx;
    const Real vx = b;
    const Real vy = s + ny * ny * a;
    const Real vz = -ny;
    // H u and H v, then G on the tangents.
    const Real px = hxx[i] * ux + hxy[i] * uy + hxz[i] * uz;
    const Real py = hxy[i] * ux + hyy[i] * uy + hyz[i] * uz;
    const Real pz = hxz[i] * ux + hyz[i] * uy + hzz[i] * uz;
    const Real qx = hxx[i] * vx + hxy[i] * vy + hxz[i] * vz;
    const Real qy = hxy[i] * vx + hyy[i] * vy + hyz[i] * vz;
    const Real qz = hxz[i] * vx + hyz[i] * vy + hzz[i] * vz;
    const Real f = -sign * inverse * up;
    const Real A = f * (ux * px + uy * py + uz * pz);
    const Real B = f * (ux * qx + uy * qy + uz * qz);
    const Real C = f * (vx * qx + vy * qy + vz * qz);
    const Real middle = (A + C) * half;
    const Real difference = (A - C) * half;
    const Real root = Sqrt(difference * difference + B * B);
    const Real largest = Abs(middle) + root;
    const Real bounded = half * (largest + most + Abs(largest - most));
    const Real shrink = most / bounded;
    const Real larger = (middle + root) * shrink;
    const Real smaller = (middle - root) * shrink;
    k1[i] = static_cast<float>(larger * unit);
    k2[i] = static_cast<float>(smaller * unit);
    mean[i] = static_cast<float>((larger + smaller) * half * unit);
    gaussian[i] = static_cast<float>(larger * unit * (smaller * unit));
    surface[i] = static_cast<float>(up);
  }
}

// A template has no clones: two overloads of each pass have.
#define PASSES(Real)                                                                               \
  LIGHTTRANSPORT_SIMD                                                                              \
  void passZ(std::int64_t n, int taps, const Real* const* planes, const Real* k0, const Real* k1,  \
    const Real* k2, Real* const* z)                                                                \
  {                                                                                                \
    alongZ<Real>(n, taps, planes, k0, k1, k2, z);                                                  \
  }                                                                                                \
  LIGHTTRANSPORT_SIMD                                                                              \
  void passY(int n, int taps, std::int64_t pitch, const Real* const* z, const Real* k0,            \
    const Real* k1, const Real* k2, Real* const* y)                                                \
  {                                                                                                \
    alongY<Real>(n, taps, pitch, z, k0, k1, k2, y);                                                \
  }                                                                                                \
  LIGHTTRANSPORT_SIMD                                                                              \
  void passX(int n, int taps, const Real* const* y, const Real* k0, const Real* k1,                \
    const Real* k2, Real* const* d)                                                                \
  {                                                                                                \
    alongX<Real>(n, taps, y, k0, k1, k2, d);                                                       \
  }                                                                                                \
  LIGHTTRANSPORT_SIMD                                                                              \
  void passCurvature(                                                                              \
    int n, const Real* d, std::int64_t pitch, const Scale<Real>& scale, float* out)                \
  {                                                                                                \
    curvatures<Real>(n, d, pitch, scale, out);                                                     \
  }
PASSES(float)
PASSES(double)
#undef PASSES

//------------------------------------------------------------------------------
} // namespace

//------------------------------------------------------------------------------
LevelSetCurvature::LevelSetCurvature(const Grid& grid, double sigma)
  : grid(grid)
  , h(grid.smallestSpacing())
{
  for (int axisIndex = 0; axisIndex < 3; ++axisIndex)
  {
    Axis& axis = this->axes[axisIndex];
    const int n = grid.dims[axisIndex];
    axis.unit = this->h / grid.spacing[axisIndex];
    const double s = std::min(std::max(sigma / grid.spacing[axisIndex], SmallestSigma), 1e3 * n);
    axis.radius =
      static_cast<int>(std::min<double>(std::max(2., std::ceil(3. * s)), std::max(n - 1, 0)));
    const int r = axis.radius;
    const int taps = 2 * r + 1;
    axis.weight.resize(taps);
    for (int t = 0; t < taps; ++t)
    {
      const double x = (t - r) / s;
      axis.weight[t] = std::exp(-0.5 * x * x);
    }
    axis.smooth.assign(static_cast<std::size_t>(n) * taps, 0.);
    axis.slope.assign(static_cast<std::size_t>(n) * taps, 0.);
    axis.curve.assign(static_cast<std::size_t>(n) * taps, 0.);
    for (int i = 0; i < n; ++i)
    {
      // Orthogonal polynomials 1, q1, q2 under the weights that lie inside.
      const int first = std::max(0, r - i);
      const int last = std::min(taps, n + r - i);
      const auto sumOf = [&](const auto& f)
      {
        double sum = 0.;
        for (int t = first; t < last; ++t)
        {
          sum += axis.weight[t] * f((t - r) / s);
        }
        return sum;
      };
      const double m0 = sumOf([](double) { return 1.; });
      const double mean = sumOf([](double u) { return u; }) / m0;
      const double m2 = sumOf([&](double u) { return (u - mean) * (u - mean); });
      const double m3 = sumOf([&](double u) { return (u - mean) * (u - mean) * (u - mean); });
      const bool linear = last - first >= 2;
      const bool quadratic = last - first >= 3;
      const double c = linear ? m3 / m2 : 0.;
      const auto q2 = [&](double u) { return (u - mean) * (u - mean - c) - m2 / m0; };
      const double norm2 = quadratic ? sumOf([&](double u) { return q2(u) * q2(u); }) : 1.;
      const double perUnit = axis.unit / s;
      for (int t = first; t < last; ++t)
      {
        const std::size_t at = static_cast<std::size_t>(i) * taps + t;
        const double u = (t - r) / s;
        const double w = axis.weight[t];
        const double a1 = linear ? w * (u - mean) / m2 : 0.;
        const double a2 = quadratic ? w * q2(u) / norm2 : 0.;
        axis.smooth[at] = w / m0 - a1 * mean;
        axis.slope[at] = (a1 - a2 * (2. * mean + c)) * perUnit;
        axis.curve[at] = 2. * a2 * perUnit * perUnit;
      }
      // Constants to the last digit, also where one-sided weights are ill-conditioned.
      const std::size_t row = static_cast<std::size_t>(i) * taps;
      const auto total = [&](const std::vector<double>& kernel)
      { return std::accumulate(kernel.begin() + row, kernel.begin() + row + taps, 0.); };
      axis.smooth[row + r] -= total(axis.smooth) - 1.;
      axis.slope[row + r] -= total(axis.slope);
      axis.curve[row + r] -= total(axis.curve);
    }
  }
}

//------------------------------------------------------------------------------
double LevelSetCurvature::gradientNoise() const
{
  double smooth[3];
  double slope[3];
  for (int a = 0; a < 3; ++a)
  {
    const Axis& axis = this->axes[a];
    const int taps = 2 * axis.radius + 1;
    const std::size_t at = static_cast<std::size_t>(this->grid.dims[a] / 2) * taps;
    smooth[a] = slope[a] = 0.;
    for (int t = 0; t < taps; ++t)
    {
      smooth[a] += axis.smooth[at + t] * axis.smooth[at + t];
      slope[a] += axis.slope[at + t] * axis.slope[at + t];
    }
  }
  const double largest = std::max({ slope[0] * smooth[1] * smooth[2],
    smooth[0] * slope[1] * smooth[2], smooth[0] * smooth[1] * slope[2] });
  return std::sqrt(largest) / this->h;
}

//------------------------------------------------------------------------------
/** A block of rows and slices, and the planes of values around one slice of it. */
template <class Real>
struct LevelSetCurvature::Tile
{
  int j0 = 0, j1 = 0;   ///< rows to compute
  int jr0 = 0, jr1 = 0; ///< rows that are read
  int ring = 1;         ///< planes kept
  std::int64_t pitch = 0;
  std::int64_t planeSize = 0;
  std::vector<double> read;
  std::vector<Real> values; ///< a ring of planes
  std::vector<Real> z;      ///< 3 planes after the pass along z
  std::vector<Real> y;      ///< 6 rows after the pass along y
  std::vector<Real> d;      ///< 9 rows of derivatives
  std::vector<float> k;     ///< 5 rows of curvatures
  std::vector<char> hole;   ///< does a plane of the ring have holes
  std::vector<char> redo;   ///< voxels of a row with holes within the kernel

  Real* plane(int k) { return &this->values[(k % this->ring) * this->planeSize]; }
  const Real* plane(int k) const { return &this->values[(k % this->ring) * this->planeSize]; }
};

//------------------------------------------------------------------------------
CurvatureReport LevelSetCurvature::compute(const ValueReader& read,
  const CurvatureParameters& parameters, const CurvatureFields& fields, const ParallelFor& parallel,
  const ProgressFunction& progress) const
{
  return parameters.singlePrecision
    ? this->computeAs<float>(read, parameters, fields, parallel, progress)
    : this->computeAs<double>(read, parameters, fields, parallel, progress);
}

//------------------------------------------------------------------------------
template <class Real>
CurvatureReport LevelSetCurvature::computeAs(const ValueReader& read,
  const CurvatureParameters& parameters, const CurvatureFields& fields, const ParallelFor& parallel,
  const ProgressFunction& progress) const
{
  CurvatureReport report;
  const auto& dims = this->grid.dims;
  const int nx = dims[0];
  const Axis& ax = this->axes[0];
  const Axis& ay = this->axes[1];
  const Axis& az = this->axes[2];

  // Values are divided by the largest, lengths by h: all is of the order of 1.
  const double unitValue = parameters.largest > SmallestValue ? parameters.largest : 1.;
  const double perValue = 1. / unitValue;
  const double stored =
    std::min(std::max(parameters.noise, parameters.rounding) / unitValue, LargestNoise);
  const double noise = std::max(stored, 64. * std::numeric_limits<Real>::epsilon());
  const double gradientNoise = noise * this->gradientNoise() * this->h;
  const double flatBelow = std::max(FlatBelow * gradientNoise, 1e-15);
  Scale<Real> scale;
  scale.flat = static_cast<Real>(flatBelow);
  scale.flat2 = static_cast<Real>(flatBelow * flatBelow);
  scale.sign = static_cast<Real>(parameters.insideIsHigh ? 1. : -1.);
  scale.unit = static_cast<Real>(1. / this->h);
  report.threshold = FlatBelow * gradientNoise * unitValue / this->h;

  // The passes run over taps that exist; kernels in the precision of the passes.
  const auto converted = [](const std::vector<double>& kernel)
  { return std::vector<Real>(kernel.begin(), kernel.end()); };
  std::vector<Real> kernels[3][3];
  for (int a = 0; a < 3; ++a)
  {
    kernels[a][0] = converted(this->axes[a].smooth);
    kernels[a][1] = converted(this->axes[a].slope);
    kernels[a][2] = converted(this->axes[a].curve);
  }

  int edge = 32;
  const auto tilesOf = [&dims](int e)
  { return std::int64_t((dims[1] + e - 1) / e) * ((dims[2] + e - 1) / e); };
  while (edge > 8 && tilesOf(edge) < MinimumTiles)
  {
    edge /= 2;
  }
  const int rows = (dims[1] + edge - 1) / edge;
  const std::int64_t tiles = tilesOf(edge);
  std::atomic<std::int64_t> flats{ 0 };
  std::atomic<std::int64_t> holes{ 0 };

  const auto computeTile = [&](Tile<Real>& tile, int j0, int k0)
  {
    constexpr int B = Block<Real>;
    const int k1 = std::min(k0 + edge, dims[2]);
    tile.j0 = j0;
    tile.j1 = std::min(j0 + edge, dims[1]);
    tile.jr0 = std::max(0, j0 - ay.radius);
    tile.jr1 = std::min(dims[1], tile.j1 + ay.radius);
    tile.ring = 2 * az.radius + 1;
    tile.pitch = (nx + B - 1) / B * B;
    tile.planeSize = (tile.jr1 - tile.jr0) * tile.pitch;
    tile.read.resize(static_cast<std::size_t>(nx));
    tile.values.resize(tile.ring * tile.planeSize);
    tile.z.resize(3 * tile.planeSize);
    // Rows of y and d are read and written in blocks, a kernel's reach further.
    const std::int64_t pitch = tile.pitch + 2 * ax.radius + B;
    tile.y.resize(6 * pitch);
    tile.d.resize(9 * pitch);
    tile.k.resize(5 * pitch);
    tile.hole.resize(static_cast<std::size_t>(tile.ring));
    tile.redo.resize(static_cast<std::size_t>(nx));

    std::int64_t flat = 0;
    std::int64_t missing = 0;
    std::vector<const Real*> planes(static_cast<std::size_t>(tile.ring));
    int next = std::max(0, k0 - az.radius);
    for (int k = k0; k < k1; ++k)
    {
      for (; next < std::min(dims[2], k + az.radius + 1); ++next)
      {
        bool holed = false;
        for (int j = tile.jr0; j < tile.jr1; ++j)
        {
          read(this->grid.index(0, j, next), nx, tile.read.data());
          Real* row = tile.plane(next) + (j - tile.jr0) * tile.pitch;
          for (int i = 0; i < nx; ++i)
          {
            const double value = (tile.read[i] - parameters.reference) * perValue;
            row[i] = static_cast<Real>(value);
            holed |= !(value == value);
          }
        }
        tile.hole[next % tile.ring] = holed;
      }
      bool holed = false;
      for (int kk = std::max(0, k - az.radius); kk < next; ++kk)
      {
        holed = holed || tile.hole[kk % tile.ring];
      }
      // Along z.
      const int firstZ = std::max(0, az.radius - k);
      const int tapsZ = std::min(tile.ring, dims[2] + az.radius - k) - firstZ;
      for (int t = 0; t < tapsZ; ++t)
      {
        planes[t] = tile.plane(k + firstZ + t - az.radius);
      }
      Real* z[3];
      const Real* kz[3];
      for (int m = 0; m < 3; ++m)
      {
        z[m] = &tile.z[m * tile.planeSize];
        kz[m] = &kernels[2][m][static_cast<std::size_t>(k) * tile.ring + firstZ];
      }
      passZ(tile.planeSize, tapsZ, planes.data(), kz[0], kz[1], kz[2], z);

      for (int j = tile.j0; j < tile.j1; ++j)
      {
        // Along y.
        const int ringY = 2 * ay.radius + 1;
        const int firstY = std::max(0, ay.radius - j);
        const int tapsY = std::min(ringY, dims[1] + ay.radius - j) - firstY;
        const Real* zRows[3];
        const Real* ky[3];
        for (int m = 0; m < 3; ++m)
        {
          zRows[m] = z[m] + (j + firstY - ay.radius - tile.jr0) * tile.pitch;
          ky[m] = &kernels[1][m][static_cast<std::size_t>(j) * ringY + firstY];
        }
        Real* y[6];
        for (int m = 0; m < 6; ++m)
        {
          y[m] = &tile.y[m * pitch];
        }
        passY(static_cast<int>(tile.pitch), tapsY, tile.pitch, zRows, ky[0], ky[1], ky[2], y);

        // Along x: one kernel inside, one per position at the borders.
        const int ringX = 2 * ax.radius + 1;
        Real* d[9];
        for (int m = 0; m < 9; ++m)
        {
          d[m] = &tile.d[m * pitch];
        }
        const int inner = std::max(0, nx - 2 * ax.radius);
        const auto kx = [&](int m, int i)
        { return &kernels[0][m][static_cast<std::size_t>(i) * ringX]; };
        if (inner > 0)
        {
          Real* shifted[9];
          for (int m = 0; m < 9; ++m)
          {
            shifted[m] = d[m] + ax.radius;
          }
          passX(inner, ringX, y, kx(0, ax.radius), kx(1, ax.radius), kx(2, ax.radius), shifted);
        }
        for (int i = 0; i < nx; ++i)
        {
          if (i == ax.radius && inner > 0)
          {
            i += inner;
          }
          const int first = std::max(0, ax.radius - i);
          const int last = std::min(ringX, nx + ax.radius - i);
          Real sums[9] = {};
          for (int t = first; t < last; ++t)
          {
            const int at = i + t - ax.radius;
            const Real smooth = kx(0, i)[t];
            const Real slope = kx(1, i)[t];
            sums[0] += slope * y[0][at];
            sums[1] += smooth * y[1][at];
            sums[2] += smooth * y[3][at];
            sums[3] += kx(2, i)[t] * y[0][at];
            sums[4] += slope * y[1][at];
            sums[5] += slope * y[3][at];
            sums[6] += smooth * y[2][at];
            sums[7] += smooth * y[4][at];
            sums[8] += smooth * y[5][at];
          }
          for (int m = 0; m < 9 && i < nx; ++m)
          {
            d[m][i] = sums[m];
          }
        }

        // A hole within the kernel left a NaN.
        if (holed)
        {
          for (int i = 0; i < nx; ++i)
          {
            Real sum = 0;
            for (int m = 0; m < 9; ++m)
            {
              sum += d[m][i];
            }
            tile.redo[i] = !(sum == sum); // NaN; NOLINT(misc-redundant-expression)
            for (int m = 0; tile.redo[i] && m < 9; ++m)
            {
              d[m][i] = 0;
            }
          }
          for (int i = 0; i < nx; ++i)
          {
            const Real own = tile.plane(k)[(j - tile.jr0) * tile.pitch + i];
            if (!(own == own)) // NaN; NOLINT(misc-redundant-expression)
            {
              ++missing;
            }
            else if (tile.redo[i])
            {
              double fitted[9];
              this->fitAround(tile, i, j, k, fitted);
              for (int m = 0; m < 9; ++m)
              {
                d[m][i] = static_cast<Real>(fitted[m]);
              }
            }
          }
        }
        passCurvature(nx, d[0], pitch, scale, tile.k.data());
        float* const wanted[4] = { fields.principal1, fields.principal2, fields.mean,
          fields.gaussian };
        for (int m = 0; m < 4; ++m)
        {
          if (wanted[m])
          {
            std::copy_n(&tile.k[m * pitch], nx, wanted[m] + this->grid.index(0, j, k));
          }
        }
        const auto surface = tile.k.begin() + 4 * pitch;
        flat += std::count(surface, surface + nx, 0.f);
      }
    }
    flats += flat;
    holes += missing;
  };

  for (int step = 0; step < ProgressSteps; ++step)
  {
    if (progress && !progress(double(step) / ProgressSteps))
    {
      report.cancelled = true;
      return report;
    }
    const std::int64_t first = tiles * step / ProgressSteps;
    parallel(tiles * (step + 1) / ProgressSteps - first,
      [&](std::int64_t begin, std::int64_t end)
      {
        const FlushDenormals flush;
        Tile<Real> tile;
        for (std::int64_t t = first + begin; t < first + end; ++t)
        {
          computeTile(tile, static_cast<int>(t % rows) * edge, static_cast<int>(t / rows) * edge);
        }
      });
  }
  report.cancelled = progress && !progress(1.);
  report.numberOfFlat = flats;
  report.numberOfHoles = holes;
  return report;
}

//------------------------------------------------------------------------------
// A quadratic function fitted to the values within the kernel that exist, with
// offsets in units of h. Moments of the weights w to order 4 and of w S to order 2.
template <class Real>
void LevelSetCurvature::fitAround(
  const Tile<Real>& tile, int i, int j, int k, double derivatives[9]) const
{
  static const int powers[10][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 },
    { 2, 0, 0 }, { 1, 1, 0 }, { 1, 0, 1 }, { 0, 2, 0 }, { 0, 1, 1 }, { 0, 0, 2 } };
  const auto& dims = this->grid.dims;
  const Axis& ax = this->axes[0];
  const Axis& ay = this->axes[1];
  const Axis& az = this->axes[2];
  // Offsets are measured in the weights' own width along each axis.
  double width[3];
  for (int a = 0; a < 3; ++a)
  {
    const int r = this->axes[a].radius;
    double sum = 0.;
    double sum2 = 0.;
    for (int t = 0; t <= 2 * r; ++t)
    {
      sum += this->axes[a].weight[t];
      sum2 += this->axes[a].weight[t] * (t - r) * (t - r);
    }
    width[a] = r > 0 ? std::sqrt(sum2 / sum) : 1.;
  }
  double moments[5][5][5] = {};
  double values[3][3][3] = {};
  for (int tz = std::max(0, az.radius - k);
       tz < std::min(2 * az.radius + 1, dims[2] + az.radius - k); ++tz)
  {
    const Real* plane = tile.plane(k + tz - az.radius);
    const double uz = (tz - az.radius) / width[2];
    for (int ty = std::max(0, ay.radius - j);
         ty < std::min(2 * ay.radius + 1, dims[1] + ay.radius - j); ++ty)
    {
      const Real* row = plane + (j + ty - ay.radius - tile.jr0) * tile.pitch;
      double w[5] = {};
      double s[3] = {};
      for (int tx = std::max(0, ax.radius - i);
           tx < std::min(2 * ax.radius + 1, dims[0] + ax.radius - i); ++tx)
      {
        const Real value = row[i + tx - ax.radius];
        if (value == value) // no NaN; NOLINT(misc-redundant-expression)
        {
          const double u = (tx - ax.radius) / width[0];
          const double weight = ax.weight[tx];
          const double u2 = u * u;
          w[0] += weight;
          w[1] += weight * u;
          w[2] += weight * u2;
          w[3] += weight * u2 * u;
          w[4] += weight * u2 * u2;
          s[0] += weight * value;
          s[1] += weight * value * u;
          s[2] += weight * value * u2;
        }
      }
      const double uy = (ty - ay.radius) / width[1];
      double wz = ay.weight[ty] * az.weight[tz];
      for (int pz = 0; pz < 5; ++pz, wz *= uz)
      {
        double wyz = wz;
        for (int py = 0; py + pz < 5; ++py, wyz *= uy)
        {
          for (int px = 0; px + py + pz < 5; ++px)
          {
            moments[px][py][pz] += wyz * w[px];
          }
          for (int px = 0; px + py + pz < 3; ++px)
          {
            values[px][py][pz] += wyz * s[px];
          }
        }
      }
    }
  }
  double A[10][10];
  double b[10];
  for (int m = 0; m < 10; ++m)
  {
    for (int n = 0; n <= m; ++n)
    {
      A[m][n] = moments[powers[m][0] + powers[n][0]][powers[m][1] + powers[n][1]]
                       [powers[m][2] + powers[n][2]];
    }
    // A ridge far below the weights' moments bounds directions without values.
    A[m][m] += m > 0 ? Ridge * moments[0][0][0] : 0.;
    b[m] = values[powers[m][0]][powers[m][1]][powers[m][2]];
  }
  SolvePositive(10, A, b);
  for (int m = 1; m < 10; ++m)
  {
    double factor = 1.;
    for (int a = 0; a < 3; ++a)
    {
      for (int p = 0; p < powers[m][a]; ++p)
      {
        factor *= this->axes[a].unit / width[a];
      }
    }
    const bool square = powers[m][0] == 2 || powers[m][1] == 2 || powers[m][2] == 2;
    derivatives[m - 1] = b[m] * factor * (square ? 2. : 1.);
  }
}

//------------------------------------------------------------------------------
double EstimateNoise(const Grid& grid, const ValueReader& read, double reference, double largest)
{
  // The axes that have three points, at most two of them.
  int axes[2] = { -1, -1 };
  int found = 0;
  for (int a = 0; a < 3 && found < 2; ++a)
  {
    if (grid.dims[a] >= 3)
    {
      axes[found++] = a;
    }
  }
  if (found == 0 || !(largest > SmallestValue))
  {
    return 0.;
  }
  const std::int64_t strides[3] = { 1, grid.dims[0], std::int64_t(grid.dims[0]) * grid.dims[1] };
  const std::int64_t size = grid.size();
  const double perValue = 1. / largest;
  // A stride that is a large odd part of the size visits all rows and columns.
  const std::int64_t stride = std::max<std::int64_t>(1, size / NumberOfNoiseSamples) | 1;
  std::vector<double> samples;
  std::int64_t finite = 0;
  for (std::int64_t at = 0; at < size; at += stride)
  {
    const int index[3] = { static_cast<int>(at % grid.dims[0]),
      static_cast<int>(at / strides[1] % grid.dims[1]), static_cast<int>(at / strides[2]) };
    bool inside = true;
    for (int f = 0; f < found; ++f)
    {
      inside = inside && index[axes[f]] > 0 && index[axes[f]] < grid.dims[axes[f]] - 1;
    }
    if (!inside)
    {
      continue;
    }
    static const double second[3] = { 1., -2., 1. };
    double sum = 0.;
    for (int a = -1; a <= 1; ++a)
    {
      for (int b = found > 1 ? -1 : 0; b <= (found > 1 ? 1 : 0); ++b)
      {
        double value;
        read(at + a * strides[axes[0]] + (found > 1 ? b * strides[axes[1]] : 0), 1, &value);
        sum += second[a + 1] * (found > 1 ? second[b + 1] : 1.) * ((value - reference) * perValue);
      }
    }
    if (!std::isnan(sum))
    {
      ++finite;
      if (sum != 0.)
      {
        samples.push_back(std::abs(sum));
      }
    }
  }
  if (samples.empty() || 5 * static_cast<std::int64_t>(samples.size()) < finite)
  {
    return 0.;
  }
  const auto middle = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() / 2);
  std::nth_element(samples.begin(), middle, samples.end());
  return *middle * largest / 0.6745 / (found > 1 ? 6. : std::sqrt(6.));
}
} // namespace lighttransport
