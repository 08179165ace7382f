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
constexpr double SmallestFit = 1.;       // and beside holes with four on one side
constexpr double FlatBelow = 3.;         // times the gradient's noise; twice this shows in full
constexpr double LargestCurvature = 2.;  // per smallest spacing
constexpr double SmallestValue = 1e-300; // a smaller range cannot be scaled to 1
constexpr double LargestNoise = 1e3;     // of the largest value: nothing is left
constexpr double Ridge = 1e-9;           // of the fit around holes
constexpr double CubicRidge = 1e-6;      // and of its terms of third order
constexpr double Cubic = 0.02;           // a term of third order, of the values' deviation
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
  Real sign; ///< of the normal
  Real unit; ///< 1/h
};

/**
 * Rows of k1, k2, mean and Gaussian curvature and of what is 0 where there is no
 * surface, from rows of derivatives and of flat = 3 noise_g, > 0.
 */
template <class Real>
ALWAYS_INLINE void curvatures(int n, const Real* LIGHTTRANSPORT_RESTRICT d,
  const Real* LIGHTTRANSPORT_RESTRICT flats, std::int64_t pitch, const Scale<Real>& scale,
  float* LIGHTTRANSPORT_RESTRICT out)
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
    const Real flat = flats[i];
    const Real flat2 = flat * flat;
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
  void passCurvature(int n, const Real* d, const Real* flat, std::int64_t pitch,                   \
    const Scale<Real>& scale, float* out)                                                          \
  {                                                                                                \
    curvatures<Real>(n, d, flat, pitch, scale, out);                                               \
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
    const int r =
      static_cast<int>(std::min<double>(std::max(3., std::ceil(3. * s)), std::max(n - 1, 0)));
    const int taps = std::min(2 * r + 1, n);
    axis.size = n;
    axis.radius = r;
    axis.taps = taps;
    axis.narrow = std::ceil(3. * s) < r;
    for (std::vector<double>* kernel : { &axis.weight, &axis.smooth, &axis.slope, &axis.curve })
    {
      kernel->assign(static_cast<std::size_t>(n) * taps, 0.);
    }
    for (int i = 0; i < n; ++i)
    {
      const int own = i - axis.start(i); // the tap of the position itself
      const double wide = s * std::max(1., double(std::max(own, taps - 1 - own)) / std::max(r, 1));
      const std::size_t row = static_cast<std::size_t>(i) * taps;
      // Orthogonal polynomials under the weights, by their recurrence
      // q_(m+1) = (u - a_m) q_m - b_m q_(m-1); with their derivatives at the position.
      std::vector<double> u(taps);
      std::vector<double> weight(taps, 0.);
      std::vector<double> q(taps, 1.);
      std::vector<double> before(taps, 0.);
      for (int t = 0; t < taps; ++t)
      {
        u[t] = (t - own) / wide;
        const double x = (t - own) / std::max(wide, SmallestFit);
        axis.weight[row + t] = std::exp(-0.5 * x * x);
      }
      for (int t = axis.skip(i); t < taps - axis.skip(i); ++t)
      {
        weight[t] = std::exp(-0.5 * u[t] * u[t]);
      }
      const double perUnit = axis.unit / wide;
      double at[3] = { 1., 0., 0. }; // q, q', q'' at the position
      double atBefore[3] = { 0., 0., 0. };
      double normBefore = 1.;
      for (int degree = 0; degree <= 3 && degree < taps; ++degree)
      {
        double norm = 0.;
        double first = 0.;
        for (int t = 0; t < taps; ++t)
        {
          const double w = weight[t] * q[t] * q[t];
          norm += w;
          first += w * u[t];
        }
        for (int t = 0; t < taps; ++t)
        {
          const double part = weight[t] * q[t] / norm;
          axis.smooth[row + t] += degree <= 1 ? part * at[0] : 0.;
          axis.slope[row + t] += degree <= 2 ? part * at[1] * perUnit : 0.;
          axis.curve[row + t] += part * at[2] * perUnit * perUnit;
        }
        const double a = first / norm;
        const double b = degree > 0 ? norm / normBefore : 0.;
        const double next[3] = { -a * at[0] - b * atBefore[0], at[0] - a * at[1] - b * atBefore[1],
          2. * at[1] - a * at[2] - b * atBefore[2] };
        for (int t = 0; t < taps; ++t)
        {
          const double value = (u[t] - a) * q[t] - b * before[t];
          before[t] = q[t];
          q[t] = value;
        }
        std::copy_n(at, 3, atBefore);
        std::copy_n(next, 3, at);
        normBefore = norm;
      }
      // Constants to the last digit, also where one-sided weights are ill-conditioned.
      const auto total = [&](const std::vector<double>& kernel)
      { return std::accumulate(kernel.begin() + row, kernel.begin() + row + taps, 0.); };
      axis.smooth[row + own] -= total(axis.smooth) - 1.;
      axis.slope[row + own] -= total(axis.slope);
      axis.curve[row + own] -= total(axis.curve);
    }
  }
}

//------------------------------------------------------------------------------
std::array<double, 2> LevelSetCurvature::Axis::noise(int i) const
{
  std::array<double, 2> sums{ { 0., 0. } };
  for (int t = 0; t < this->taps; ++t)
  {
    const std::size_t at = static_cast<std::size_t>(i) * this->taps + t;
    sums[0] += this->smooth[at] * this->smooth[at];
    sums[1] += this->slope[at] * this->slope[at];
  }
  return { { std::sqrt(sums[0]), std::sqrt(sums[1]) } };
}

//------------------------------------------------------------------------------
double LevelSetCurvature::gradientNoise() const
{
  std::array<double, 2> n[3];
  for (int a = 0; a < 3; ++a)
  {
    n[a] = this->axes[a].noise(this->grid.dims[a] / 2);
  }
  return std::max({ n[0][1] * n[1][0] * n[2][0], n[0][0] * n[1][1] * n[2][0],
           n[0][0] * n[1][0] * n[2][1] }) /
    this->h;
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
  std::vector<Real> values;      ///< a ring of planes
  std::vector<Real> z;           ///< 3 planes after the pass along z
  std::vector<Real> y;           ///< 6 rows after the pass along y
  std::vector<Real> d;           ///< 9 rows of derivatives
  std::vector<Real> flat;        ///< a row of the gradient's thresholds
  std::array<double, 4> flatFor; ///< the noise of the other two axes behind it
  std::vector<float> k;          ///< 5 rows of curvatures
  std::vector<char> hole;        ///< does a plane of the ring have holes
  std::vector<char> redo;        ///< voxels of a row with holes within the kernel

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
  Scale<Real> scale;
  scale.sign = static_cast<Real>(parameters.insideIsHigh ? 1. : -1.);
  scale.unit = static_cast<Real>(1. / this->h);
  report.threshold = FlatBelow * noise * this->gradientNoise() * unitValue;

  // The passes run over taps that exist; kernels in the precision of the passes.
  const auto converted = [](const std::vector<double>& kernel)
  { return std::vector<Real>(kernel.begin(), kernel.end()); };
  std::vector<Real> kernels[3][3];
  std::vector<std::array<double, 2>> noises[3];
  for (int a = 0; a < 3; ++a)
  {
    kernels[a][0] = converted(this->axes[a].smooth);
    kernels[a][1] = converted(this->axes[a].slope);
    kernels[a][2] = converted(this->axes[a].curve);
    for (int i = 0; i < dims[a]; ++i)
    {
      noises[a].push_back(this->axes[a].noise(i));
    }
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
    tile.jr0 = ay.start(j0);
    tile.jr1 = ay.start(tile.j1 - 1) + ay.taps;
    tile.ring = az.taps;
    tile.pitch = (nx + B - 1) / B * B;
    tile.planeSize = (tile.jr1 - tile.jr0) * tile.pitch;
    tile.read.resize(static_cast<std::size_t>(nx));
    tile.values.resize(tile.ring * tile.planeSize);
    tile.z.resize(3 * tile.planeSize);
    // Rows of y and d are read and written in blocks, a kernel's length further.
    const std::int64_t pitch = tile.pitch + ax.taps + B;
    tile.flat.resize(pitch);
    tile.flatFor.fill(-1.);
    tile.y.resize(6 * pitch);
    tile.d.resize(9 * pitch);
    tile.k.resize(5 * pitch);
    tile.hole.resize(static_cast<std::size_t>(tile.ring));
    tile.redo.resize(static_cast<std::size_t>(nx));

    std::int64_t flat = 0;
    std::int64_t missing = 0;
    std::vector<const Real*> planes(static_cast<std::size_t>(tile.ring));
    int next = az.start(k0);
    for (int k = k0; k < k1; ++k)
    {
      const int startZ = az.start(k);
      for (; next < startZ + az.taps; ++next)
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
      for (int kk = startZ; kk < next; ++kk)
      {
        holed = holed || tile.hole[kk % tile.ring];
      }
      // Along z.
      for (int t = 0; t < az.taps; ++t)
      {
        planes[t] = tile.plane(startZ + t);
      }
      const int skipZ = az.skip(k);
      Real* z[3];
      const Real* kz[3];
      for (int m = 0; m < 3; ++m)
      {
        z[m] = &tile.z[m * tile.planeSize];
        kz[m] = &kernels[2][m][static_cast<std::size_t>(k) * az.taps + skipZ];
      }
      passZ(tile.planeSize, az.taps - 2 * skipZ, planes.data() + skipZ, kz[0], kz[1], kz[2], z);

      for (int j = tile.j0; j < tile.j1; ++j)
      {
        // Along y.
        const int skipY = ay.skip(j);
        const Real* zRows[3];
        const Real* ky[3];
        for (int m = 0; m < 3; ++m)
        {
          zRows[m] = z[m] + (ay.start(j) + skipY - tile.jr0) * tile.pitch;
          ky[m] = &kernels[1][m][static_cast<std::size_t>(j) * ay.taps + skipY];
        }
        Real* y[6];
        for (int m = 0; m < 6; ++m)
        {
          y[m] = &tile.y[m * pitch];
        }
        passY(static_cast<int>(tile.pitch), ay.taps - 2 * skipY, tile.pitch, zRows, ky[0], ky[1],
          ky[2], y);

        // Along x: one kernel inside, one per position at the borders.
        Real* d[9];
        for (int m = 0; m < 9; ++m)
        {
          d[m] = &tile.d[m * pitch];
        }
        const int inner = std::max(0, nx - 2 * ax.radius);
        const auto kx = [&](int m, int i)
        { return &kernels[0][m][static_cast<std::size_t>(i) * ax.taps]; };
        if (inner > 0)
        {
          const int skip = ax.skip(ax.radius);
          Real* shifted[9];
          const Real* from[6];
          for (int m = 0; m < 9; ++m)
          {
            shifted[m] = d[m] + ax.radius;
          }
          for (int m = 0; m < 6; ++m)
          {
            from[m] = y[m] + skip;
          }
          passX(inner, ax.taps - 2 * skip, from, kx(0, ax.radius) + skip, kx(1, ax.radius) + skip,
            kx(2, ax.radius) + skip, shifted);
        }
        for (int i = 0; i < nx; ++i)
        {
          if (i == ax.radius && inner > 0)
          {
            i += inner;
          }
          Real sums[9] = {};
          for (int t = 0; t < ax.taps && i < nx; ++t)
          {
            const int at = ax.start(i) + t;
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
              this->fitAround(tile, i, j, k, noise, fitted);
              for (int m = 0; m < 9; ++m)
              {
                d[m][i] = static_cast<Real>(fitted[m]);
              }
            }
          }
        }
        // What the kernels leave of the noise: more at borders.
        const std::array<double, 4> others{ { noises[1][j][0], noises[1][j][1], noises[2][k][0],
          noises[2][k][1] } };
        if (tile.flatFor != others)
        {
          tile.flatFor = others;
          const double slopes =
            std::max(others[0] * others[3], others[1] * others[2]) * FlatBelow * noise;
          const double smooth = others[0] * others[2] * FlatBelow * noise;
          for (int i = 0; i < nx; ++i)
          {
            tile.flat[i] = static_cast<Real>(
              std::max({ noises[0][i][0] * slopes, noises[0][i][1] * smooth, 1e-15 }));
          }
        }
        passCurvature(nx, d[0], tile.flat.data(), pitch, scale, tile.k.data());
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
// A cubic function fitted to the values within the kernel that exist, with offsets in
// units of h. Moments of the weights w to order 6 and of w S to order 3.
template <class Real>
void LevelSetCurvature::fitAround(
  const Tile<Real>& tile, int i, int j, int k, double noise, double derivatives[9]) const
{
  constexpr int N = 20;
  static const int powers[N][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 }, { 2, 0, 0 },
    { 1, 1, 0 }, { 1, 0, 1 }, { 0, 2, 0 }, { 0, 1, 1 }, { 0, 0, 2 }, { 3, 0, 0 }, { 2, 1, 0 },
    { 2, 0, 1 }, { 1, 2, 0 }, { 1, 1, 1 }, { 1, 0, 2 }, { 0, 3, 0 }, { 0, 2, 1 }, { 0, 1, 2 },
    { 0, 0, 3 } };
  const int at[3] = { i, j, k };
  int start[3];
  const double* weights[3];
  double width[3]; // offsets are measured in the weights' own width along each axis
  for (int a = 0; a < 3; ++a)
  {
    const Axis& axis = this->axes[a];
    start[a] = axis.start(at[a]);
    weights[a] = &axis.weight[static_cast<std::size_t>(at[a]) * axis.taps];
    double sum = 0.;
    double sum2 = 0.;
    for (int t = 0; t < axis.taps; ++t)
    {
      const double offset = start[a] + t - at[a];
      sum += weights[a][t];
      sum2 += weights[a][t] * offset * offset;
    }
    width[a] = axis.taps > 1 ? std::sqrt(sum2 / sum) : 1.;
  }
  double moments[7][7][7] = {};
  double values[4][4][4] = {};
  double squares = 0.;
  for (int tz = 0; tz < this->axes[2].taps; ++tz)
  {
    const Real* plane = tile.plane(start[2] + tz);
    const double uz = (start[2] + tz - k) / width[2];
    for (int ty = 0; ty < this->axes[1].taps; ++ty)
    {
      const Real* row = plane + (start[1] + ty - tile.jr0) * tile.pitch + start[0];
      double w[7] = {};
      double s[4] = {};
      double s2 = 0.;
      for (int tx = 0; tx < this->axes[0].taps; ++tx)
      {
        const Real value = row[tx];
        if (value == value) // no NaN; NOLINT(misc-redundant-expression)
        {
          const double u = (start[0] + tx - i) / width[0];
          const double weight = weights[0][tx];
          const double u2 = u * u;
          const double u3 = u2 * u;
          w[0] += weight;
          w[1] += weight * u;
          w[2] += weight * u2;
          w[3] += weight * u3;
          w[4] += weight * u2 * u2;
          w[5] += weight * u3 * u2;
          w[6] += weight * u3 * u3;
          s[0] += weight * value;
          s[1] += weight * value * u;
          s[2] += weight * value * u2;
          s[3] += weight * value * u3;
          s2 += weight * value * value;
        }
      }
      const double uy = (start[1] + ty - j) / width[1];
      double wz = weights[1][ty] * weights[2][tz];
      squares += wz * s2;
      for (int pz = 0; pz < 7; ++pz, wz *= uz)
      {
        double wyz = wz;
        for (int py = 0; py + pz < 7; ++py, wyz *= uy)
        {
          for (int px = 0; px + py + pz < 7; ++px)
          {
            moments[px][py][pz] += wyz * w[px];
          }
          for (int px = 0; px + py + pz < 4; ++px)
          {
            values[px][py][pz] += wyz * s[px];
          }
        }
      }
    }
  }
  // A ridge far below the weights' moments bounds directions without values. Terms of
  // third order are as likely as the values' deviation allows, and the values as the noise.
  const double total = moments[0][0][0];
  const double mean = values[0][0][0] / total;
  const double variance = std::max(squares / total - mean * mean, 1e-30);
  const double cubic = std::min(noise * noise / (Cubic * Cubic * variance), 1e3 * total);
  double A[N][N];
  double b[N];
  for (int m = 0; m < N; ++m)
  {
    for (int n = 0; n <= m; ++n)
    {
      A[m][n] = moments[powers[m][0] + powers[n][0]][powers[m][1] + powers[n][1]]
                       [powers[m][2] + powers[n][2]];
    }
    A[m][m] += m < 1 ? 0. : m < 10 ? Ridge * total : CubicRidge * total + cubic;
    b[m] = values[powers[m][0]][powers[m][1]][powers[m][2]];
  }
  SolvePositive(N, A, b);
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
