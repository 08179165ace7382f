// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Diffusion.h"

#include "Core/ActiveRegion.h"
#include "Core/Kernel.h"
#include "Core/SlowError.h"
#include "Core/Stall.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <sstream>
#include <tuple>

namespace lighttransport
{
namespace
{
/** A sink at or below this (relative to the largest diagonal) is none. */
constexpr float NoSink = 1e-30f;

/**
 * An active region may have so many voxels before it is solved on for the first time, but no
 * larger a part of the volume: what light that fills it costs more.
 */
constexpr std::int64_t FirstRegion = 32768;
constexpr std::int64_t FirstPart = 192;
/**
 * What the search for an active region costs, in voxels of a whole volume's solve (measured: 90 ns
 * in easy media): a voxel that the front takes, one that is solved for roughly and looked at, and
 * a solve on however few.
 */
constexpr double FrontCost = 2.;
constexpr double RoughCost = 4.;
constexpr double RoundCost = 4000.;

/** Where nothing can change, a step is no longer than this allows: NoSink does not show in it. */
constexpr double NoDiagonal = 1e-10;

/** Of the power that is emitted, what may leave an active region through its rim. */
constexpr double MostLeaked = 1e-2;

/** Explicit steps on so many values go through the memory together, where nobody need be asked. */
constexpr std::int64_t SeveralStepsFrom = std::int64_t(1) << 19;
constexpr int StepsInOnePass = 4;
/** Where somebody need be: voxels times steps in a pass, some 30 ms. */
constexpr std::int64_t AskedAfter = std::int64_t(1) << 25;

/** By which seven floats, summed in float, may be more. */
constexpr double SumInFloat = 1. + 5e-7;

/** Of the largest value: what six decades of a picture do not show. */
constexpr double Unseen = 1e-7;

/** From this tolerance on, memory counts more than the last few per cent of speed. */
constexpr double FrugalTolerance = 1e-4;

/**
 * With more iterations left than this, the set-up of the aggregation (as long as some ten) and its
 * own iterations (ten to fifteen) are fewer.
 */
constexpr double ManyIterations = 24.;

/** Of the aggregation: so much in all is allowed, per voxel; and so much however few they are. */
constexpr std::int64_t AllowedBytes = 64;
constexpr std::int64_t AllowedAnyhow = std::int64_t(1) << 24;

/** F_dr's integrand is smooth in the angle of refraction side of the critical angle. */
double unpolarisedFresnel(double cosInside, double eta)
{
  const double sin2Outside = eta * eta * (1. - cosInside * cosInside);
  if (sin2Outside >= 1.)
  {
    return 1.;
  }
  const double cosOutside = std::sqrt(1. - sin2Outside);
  const double rs = (eta * cosInside - cosOutside) / (eta * cosInside + cosOutside);
  const double rp = (cosInside - eta * cosOutside) / (cosInside + eta * cosOutside);
  return 0.5 * (rs * rs + rp * rp);
}

/** sum g (x_i - x_j) + s x_i of one row in double; rows outside are null. */
struct DoubleRow
{
  int n;
  const float *gx, *gy, *gyS, *gz, *gzB, *s;
  const double *x, *xS, *xN, *xB, *xT;
};

DoubleRow doubleRow(
  const DiffusionOperator& A, const double* x, std::int64_t row, std::int64_t begin, int n)
{
  const std::int64_t nx = A.dims[0];
  const std::int64_t ny = A.dims[1];
  const std::int64_t nz = A.dims[2];
  const std::int64_t j = row % ny;
  const std::int64_t k = row / ny;
  const float* zeros = A.zeros.data();
  const double* own = x + begin;
  // The face to a row outside has conductance 0: the row itself can stand for it.
  return { n, A.g[0].data() + begin, A.g[1].data() + begin,
    j > 0 ? A.g[1].data() + begin - nx : zeros, A.g[2].data() + begin,
    k > 0 ? A.g[2].data() + begin - nx * ny : zeros, A.s.data() + begin, own,
    j > 0 ? own - nx : own, j + 1 < ny ? own + nx : own, k > 0 ? own - nx * ny : own,
    k + 1 < nz ? own + nx * ny : own };
}

LIGHTTRANSPORT_SIMD
void applyDouble(const DoubleRow& row, double* LIGHTTRANSPORT_RESTRICT y)
{
  const int n = row.n;
  const float* LIGHTTRANSPORT_RESTRICT gx = row.gx;
  const float* LIGHTTRANSPORT_RESTRICT gy = row.gy;
  const float* LIGHTTRANSPORT_RESTRICT gyS = row.gyS;
  const float* LIGHTTRANSPORT_RESTRICT gz = row.gz;
  const float* LIGHTTRANSPORT_RESTRICT gzB = row.gzB;
  const float* LIGHTTRANSPORT_RESTRICT s = row.s;
  const double *x = row.x, *xS = row.xS, *xN = row.xN, *xB = row.xB, *xT = row.xT;
  for (int i = 0; i < n; ++i)
  {
    const double c = x[i];
    y[i] = double(gy[i]) * (c - xN[i]) + double(gyS[i]) * (c - xS[i]) +
      double(gz[i]) * (c - xT[i]) + double(gzB[i]) * (c - xB[i]) + double(s[i]) * c;
  }
  for (int i = 0; i + 1 < n; ++i)
  {
    y[i] += double(gx[i]) * (x[i] - x[i + 1]);
  }
  for (int i = 1; i < n; ++i)
  {
    y[i] += double(gx[i - 1]) * (x[i] - x[i - 1]);
  }
}

/** tau = step / diagonal, 0 where there is none. Reads the face before the row, which is 0. */
LIGHTTRANSPORT_SIMD
void localSteps(const DoubleRow& row, double step, double* LIGHTTRANSPORT_RESTRICT tau)
{
  const int n = row.n;
  const float *gx = row.gx, *gy = row.gy, *gyS = row.gyS, *gz = row.gz, *gzB = row.gzB, *s = row.s;
  for (int i = 0; i < n; ++i)
  {
    const double diagonal = double(gx[i]) + double(gx[i - 1]) + double(gy[i]) + double(gyS[i]) +
      double(gz[i]) + double(gzB[i]) + double(s[i]);
    tau[i] = diagonal > 0. ? step / diagonal : 0.;
  }
}

LIGHTTRANSPORT_SIMD
void twoDots(std::int64_t n, const float* LIGHTTRANSPORT_RESTRICT a,
  const float* LIGHTTRANSPORT_RESTRICT b, const float* LIGHTTRANSPORT_RESTRICT c, double* sums)
{
  double ab[8] = { 0., 0., 0., 0., 0., 0., 0., 0. };
  double ac[8] = { 0., 0., 0., 0., 0., 0., 0., 0. };
  std::int64_t i = 0;
  for (; i + 8 <= n; i += 8)
  {
    for (int l = 0; l < 8; ++l)
    {
      ab[l] += double(a[i + l]) * double(b[i + l]);
      ac[l] += double(a[i + l]) * double(c[i + l]);
    }
  }
  for (; i < n; ++i)
  {
    ab[0] += double(a[i]) * double(b[i]);
    ac[0] += double(a[i]) * double(c[i]);
  }
  sums[0] = ((ab[0] + ab[4]) + (ab[1] + ab[5])) + ((ab[2] + ab[6]) + (ab[3] + ab[7]));
  sums[1] = ((ac[0] + ac[4]) + (ac[1] + ac[5])) + ((ac[2] + ac[6]) + (ac[3] + ac[7]));
}

/** phi += step p; r -= alpha Ap; returns r . r */
LIGHTTRANSPORT_SIMD
double update(std::int64_t n, double step, float alpha, const float* LIGHTTRANSPORT_RESTRICT p,
  const float* LIGHTTRANSPORT_RESTRICT Ap, double* LIGHTTRANSPORT_RESTRICT phi,
  float* LIGHTTRANSPORT_RESTRICT r)
{
  double rr[8] = { 0., 0., 0., 0., 0., 0., 0., 0. };
  std::int64_t i = 0;
  for (; i + 8 <= n; i += 8)
  {
    for (int l = 0; l < 8; ++l)
    {
      phi[i + l] += step * double(p[i + l]);
      const float v = r[i + l] - alpha * Ap[i + l];
      r[i + l] = v;
      rr[l] += double(v) * double(v);
    }
  }
  for (; i < n; ++i)
  {
    phi[i] += step * double(p[i]);
    r[i] -= alpha * Ap[i];
    rr[0] += double(r[i]) * double(r[i]);
  }
  return ((rr[0] + rr[4]) + (rr[1] + rr[5])) + ((rr[2] + rr[6]) + (rr[3] + rr[7]));
}

/** to = scale q - mean, and a[i] - b[i] times previous more, where given */
template <class T>
LIGHTTRANSPORT_INLINE void rightHandSide(int n, const T* LIGHTTRANSPORT_RESTRICT q, double scale,
  double mean, const float* LIGHTTRANSPORT_RESTRICT a, const float* LIGHTTRANSPORT_RESTRICT b,
  const double* LIGHTTRANSPORT_RESTRICT previous, double* LIGHTTRANSPORT_RESTRICT to)
{
  for (int i = 0; i < n; ++i)
  {
    to[i] = q ? scale * static_cast<double>(q[i]) - mean : 0.;
  }
  for (int i = 0; previous && i < n; ++i)
  {
    to[i] += (static_cast<double>(a[i]) - static_cast<double>(b[i])) * previous[i];
  }
}

LIGHTTRANSPORT_SIMD
void rightHandSideRow(int n, const float* q, double scale, double mean, const float* a,
  const float* b, const double* previous, double* to)
{
  rightHandSide(n, q, scale, mean, a, b, previous, to);
}
LIGHTTRANSPORT_SIMD
void rightHandSideRow(int n, const double* q, double scale, double mean, const float* a,
  const float* b, const double* previous, double* to)
{
  rightHandSide(n, q, scale, mean, a, b, previous, to);
}

/** The sum of value(i), i < n, in eight strands. */
template <class Value>
LIGHTTRANSPORT_INLINE double inStrands(std::int64_t n, const Value& value)
{
  double sums[8] = { 0., 0., 0., 0., 0., 0., 0., 0. };
  std::int64_t i = 0;
  for (; i + 8 <= n; i += 8)
  {
    for (int l = 0; l < 8; ++l)
    {
      sums[l] += value(i + l);
    }
  }
  for (; i < n; ++i)
  {
    sums[0] += value(i);
  }
  return ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
}
/** The sum of (scale q - mean)^2 */
template <class T>
LIGHTTRANSPORT_INLINE double squaresOf(int n, const T* q, double scale, double mean)
{
  return inStrands(n,
    [=](std::int64_t i)
    {
      const double v = scale * static_cast<double>(q[i]) - mean;
      return v * v;
    });
}
LIGHTTRANSPORT_SIMD
double squaresRow(int n, const float* q, double scale, double mean)
{
  return squaresOf(n, q, scale, mean);
}
LIGHTTRANSPORT_SIMD
double squaresRow(int n, const double* q, double scale, double mean)
{
  return squaresOf(n, q, scale, mean);
}
/** 1: there are values above 0, 2: below; by their bits, for a NaN must not be compared. */
template <class Bits, class T>
LIGHTTRANSPORT_INLINE std::uint8_t signsIn(int n, const T* LIGHTTRANSPORT_RESTRICT q)
{
  Bits above = 0;
  Bits below = 0;
  for (int i = 0; i < n; ++i)
  {
    const T value = q[i];
    Bits bits;
    std::memcpy(&bits, &value, sizeof(T));
    above |= bits > 0 ? 1 : 0;
    below |= bits < 0 && bits != std::numeric_limits<Bits>::min() ? 1 : 0; // -0 is 0
  }
  return static_cast<std::uint8_t>((above ? 1 : 0) | (below ? 2 : 0));
}
LIGHTTRANSPORT_SIMD
std::uint8_t signsOf(int n, const float* q)
{
  return signsIn<std::int32_t>(n, q);
}
LIGHTTRANSPORT_SIMD
std::uint8_t signsOf(int n, const double* q)
{
  return signsIn<std::int64_t>(n, q);
}

/** The least and the largest of a row that holds numbers, and of what is given. */
LIGHTTRANSPORT_SIMD
void extremes(int n, const double* LIGHTTRANSPORT_RESTRICT a, double& least, double& most)
{
  double low[8];
  double high[8];
  std::fill(low, low + 8, least);
  std::fill(high, high + 8, most);
  int i = 0;
  for (; i + 8 <= n; i += 8)
  {
    for (int l = 0; l < 8; ++l)
    {
      low[l] = a[i + l] < low[l] ? a[i + l] : low[l];
      high[l] = a[i + l] > high[l] ? a[i + l] : high[l];
    }
  }
  for (; i < n; ++i)
  {
    low[0] = a[i] < low[0] ? a[i] : low[0];
    high[0] = a[i] > high[0] ? a[i] : high[0];
  }
  for (int l = 0; l < 8; ++l)
  {
    least = low[l] < least ? low[l] : least;
    most = high[l] > most ? high[l] : most;
  }
}

/** The sum of a, or of a b where b is given. */
template <class T>
LIGHTTRANSPORT_INLINE double totalOf(int n, const T* a, const double* b)
{
  return b ? inStrands(n, [=](std::int64_t i) { return static_cast<double>(a[i]) * b[i]; })
           : inStrands(n, [=](std::int64_t i) { return static_cast<double>(a[i]); });
}
LIGHTTRANSPORT_SIMD
double totalRow(int n, const float* a, const double* b)
{
  return totalOf(n, a, b);
}
LIGHTTRANSPORT_SIMD
double totalRow(int n, const double* a, const double* b)
{
  return totalOf(n, a, b);
}

/** to = (b - y) factor, returns the sum of squares of b - y; to may be null. */
LIGHTTRANSPORT_SIMD
double subtract(int n, const double* LIGHTTRANSPORT_RESTRICT b,
  const double* LIGHTTRANSPORT_RESTRICT y, double factor, float* LIGHTTRANSPORT_RESTRICT to)
{
  double sums[8] = { 0., 0., 0., 0., 0., 0., 0., 0. };
  int i = 0;
  for (; i + 8 <= n; i += 8)
  {
    for (int l = 0; l < 8; ++l)
    {
      const double v = b[i + l] - y[i + l];
      sums[l] += v * v;
    }
  }
  for (; i < n; ++i)
  {
    sums[0] += (b[i] - y[i]) * (b[i] - y[i]);
  }
  for (i = 0; to && i < n; ++i)
  {
    to[i] = static_cast<float>((b[i] - y[i]) * factor);
  }
  return ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
}

/**
 * The explicit step of one row: out = x + tau (b - A x), and the sum of squares of b - A x;
 * b = scale q - mean, tau the same everywhere or a row of them. q may be null: 0.
 *
 * Reads x one before and one after the row: the faces there are 0, and a loop without ends of
 * its own, in lines of the cache, is three times as fast.
 */
template <bool Lit, bool Local, class T>
LIGHTTRANSPORT_INLINE double explicitStep(const DoubleRow& row, const T* LIGHTTRANSPORT_RESTRICT q,
  double scale, double mean, double step, const double* LIGHTTRANSPORT_RESTRICT tau,
  double* LIGHTTRANSPORT_RESTRICT out)
{
  const int n = row.n;
  const float *gx = row.gx, *gy = row.gy, *gyS = row.gyS, *gz = row.gz, *gzB = row.gzB, *s = row.s;
  const double *x = row.x, *xS = row.xS, *xN = row.xN, *xB = row.xB, *xT = row.xT;
  for (int i = 0; i < n; ++i)
  {
    const double c = x[i];
    const double b = Lit ? scale * static_cast<double>(q[i]) - mean : 0.;
    out[i] = b + double(gy[i]) * (xN[i] - c) + double(gyS[i]) * (xS[i] - c) +
      double(gz[i]) * (xT[i] - c) + double(gzB[i]) * (xB[i] - c) - double(s[i]) * c +
      double(gx[i]) * (x[i + 1] - c) + double(gx[i - 1]) * (x[i - 1] - c);
  }
  double sums[8] = { 0., 0., 0., 0., 0., 0., 0., 0. };
  int i = 0;
  for (; i + 8 <= n; i += 8)
  {
    for (int l = 0; l < 8; ++l)
    {
      sums[l] += out[i + l] * out[i + l];
    }
  }
  for (; i < n; ++i)
  {
    sums[0] += out[i] * out[i];
  }
  for (i = 0; i < n; ++i)
  {
    out[i] = x[i] + (Local ? tau[i] : step) * out[i];
  }
  return ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
}
template <class T>
LIGHTTRANSPORT_INLINE double explicitStepOf(const DoubleRow& row, const T* q, double scale,
  double mean, double step, const double* tau, double* out)
{
  if (q)
  {
    return tau ? explicitStep<true, true>(row, q, scale, mean, step, tau, out)
               : explicitStep<true, false>(row, q, scale, mean, step, tau, out);
  }
  return tau ? explicitStep<false, true>(row, q, scale, mean, step, tau, out)
             : explicitStep<false, false>(row, q, scale, mean, step, tau, out);
}
LIGHTTRANSPORT_SIMD
double explicitRow(const DoubleRow& row, const float* q, double scale, double mean, double step,
  const double* tau, double* out)
{
  return explicitStepOf(row, q, scale, mean, step, tau, out);
}
LIGHTTRANSPORT_SIMD
double explicitRow(const DoubleRow& row, const double* q, double scale, double mean, double step,
  const double* tau, double* out)
{
  return explicitStepOf(row, q, scale, mean, step, tau, out);
}

LIGHTTRANSPORT_SIMD
void combine(std::int64_t n, float beta, const float* LIGHTTRANSPORT_RESTRICT z,
  float* LIGHTTRANSPORT_RESTRICT p)
{
  if (beta == 0.f)
  {
    std::copy(z, z + n, p); // fresh memory is not read
    return;
  }
  for (std::int64_t i = 0; i < n; ++i)
  {
    p[i] = z[i] + beta * p[i];
  }
}

/** H(a, b), the harmonic mean of what is >= 0. */
LIGHTTRANSPORT_INLINE double harmonic(double a, double b)
{
  constexpr double least = std::numeric_limits<double>::min();
  const double sum = a + b;
  return 2. * a * (b / (sum > least ? sum : least));
}

/** The medium, and phi = x, in a row and its neighbours; where there is none, the row itself. */
template <class T>
struct ExactRow
{
  const T *D, *DS, *DN, *DB, *DT;
  const double *x, *xS, *xN, *xB, *xT;
  double fx, fy, fz;  ///< 1 / (scale spacing^2)
  bool before, after; ///< whether there are voxels beside the row's first and last
};

/** y += A x of n voxels, but for sigma_a and the border; all in double. */
template <class T>
LIGHTTRANSPORT_INLINE void exactFacesOf(
  int n, const ExactRow<T>& row, double* LIGHTTRANSPORT_RESTRICT y)
{
  const T *D = row.D, *DS = row.DS, *DN = row.DN, *DB = row.DB, *DT = row.DT;
  const double *x = row.x, *xS = row.xS, *xN = row.xN, *xB = row.xB, *xT = row.xT;
  const double fx = row.fx;
  const double fy = row.fy;
  const double fz = row.fz;
  for (int i = 0; i < n; ++i)
  {
    const double d = static_cast<double>(D[i]);
    const double c = x[i];
    y[i] += fy *
        (harmonic(d, static_cast<double>(DS[i])) * (c - xS[i]) +
          harmonic(d, static_cast<double>(DN[i])) * (c - xN[i])) +
      fz *
        (harmonic(d, static_cast<double>(DB[i])) * (c - xB[i]) +
          harmonic(d, static_cast<double>(DT[i])) * (c - xT[i]));
  }
  for (int i = row.before ? 0 : 1; i < n; ++i)
  {
    y[i] +=
      fx * harmonic(static_cast<double>(D[i]), static_cast<double>(D[i - 1])) * (x[i] - x[i - 1]);
  }
  const int last = row.after ? n : n - 1;
  for (int i = 0; i < last; ++i)
  {
    y[i] +=
      fx * harmonic(static_cast<double>(D[i]), static_cast<double>(D[i + 1])) * (x[i] - x[i + 1]);
  }
}
LIGHTTRANSPORT_SIMD
void addExactFaces(int n, const ExactRow<float>& row, double* y)
{
  exactFacesOf(n, row, y);
}
LIGHTTRANSPORT_SIMD
void addExactFaces(int n, const ExactRow<double>& row, double* y)
{
  exactFacesOf(n, row, y);
}

/** y = factor sigma x */
template <class T>
LIGHTTRANSPORT_INLINE void absorbedOf(int n, double factor, const T* LIGHTTRANSPORT_RESTRICT sigma,
  const double* LIGHTTRANSPORT_RESTRICT x, double* LIGHTTRANSPORT_RESTRICT y)
{
  for (int i = 0; i < n; ++i)
  {
    y[i] = static_cast<double>(sigma[i]) * factor * x[i];
  }
}
LIGHTTRANSPORT_SIMD
void absorbedRow(int n, double factor, const float* sigma, const double* x, double* y)
{
  absorbedOf(n, factor, sigma, x, y);
}
LIGHTTRANSPORT_SIMD
void absorbedRow(int n, double factor, const double* sigma, const double* x, double* y)
{
  absorbedOf(n, factor, sigma, x, y);
}

/** g = factor H(a, b), H the harmonic mean in double */
template <class T>
LIGHTTRANSPORT_INLINE void facesOf(int n, double factor, const T* LIGHTTRANSPORT_RESTRICT a,
  const T* LIGHTTRANSPORT_RESTRICT b, float* LIGHTTRANSPORT_RESTRICT g)
{
  constexpr double least = std::numeric_limits<double>::min();
  for (int i = 0; i < n; ++i)
  {
    const double x = static_cast<double>(a[i]);
    const double y = static_cast<double>(b[i]);
    const double sum = x + y;
    g[i] = static_cast<float>(factor * (2. * x * (y / (sum > least ? sum : least))));
  }
}
LIGHTTRANSPORT_SIMD
void faceRow(int n, double factor, const float* a, const float* b, float* g)
{
  facesOf(n, factor, a, b, g);
}
LIGHTTRANSPORT_SIMD
void faceRow(int n, double factor, const double* a, const double* b, float* g)
{
  facesOf(n, factor, a, b, g);
}

/** s = factor sigma, at least NoSink: a voxel without faces divides by it. sigma may be null. */
template <class T>
LIGHTTRANSPORT_INLINE void sinkOf(
  int n, const T* LIGHTTRANSPORT_RESTRICT sigma, double factor, float* LIGHTTRANSPORT_RESTRICT s)
{
  for (int i = 0; i < n; ++i)
  {
    const float v = sigma ? static_cast<float>(factor * static_cast<double>(sigma[i])) : 0.f;
    s[i] = v > NoSink ? v : NoSink;
  }
}
LIGHTTRANSPORT_SIMD
void sinkRow(int n, const float* sigma, double factor, float* s)
{
  sinkOf(n, sigma, factor, s);
}
LIGHTTRANSPORT_SIMD
void sinkRow(int n, const double* sigma, double factor, float* s)
{
  sinkOf(n, sigma, factor, s);
}

/**
 * The largest of a row; below 0 where one is negative or not finite. By their bits, which are
 * in the order of the values: comparing a NaN would raise an exception.
 */
template <class T, class Bits>
LIGHTTRANSPORT_INLINE double largestOf(std::int64_t n, const T* LIGHTTRANSPORT_RESTRICT a)
{
  const T greatest = std::numeric_limits<T>::max();
  Bits top;
  std::memcpy(&top, &greatest, sizeof(T));
  constexpr Bits minusZero = Bits(1) << (8 * sizeof(T) - 1);
  Bits most = 0;
  for (std::int64_t i = 0; i < n; ++i)
  {
    const T value = a[i];
    Bits bits;
    std::memcpy(&bits, &value, sizeof(T));
    bits &= static_cast<Bits>(0) - static_cast<Bits>(bits != minusZero); // no branch: vectors
    most = bits > most ? bits : most; // what is not finite or below 0 is above the greatest
  }
  T largest;
  std::memcpy(&largest, &most, sizeof(T));
  return most > top ? -1. : static_cast<double>(largest);
}
LIGHTTRANSPORT_SIMD
double largestRow(std::int64_t n, const float* a)
{
  return largestOf<float, std::uint32_t>(n, a);
}
LIGHTTRANSPORT_SIMD
double largestRow(std::int64_t n, const double* a)
{
  return largestOf<double, std::uint64_t>(n, a);
}

/** Whether all values are the first one. */
template <class T>
LIGHTTRANSPORT_INLINE bool sameAs(std::int64_t n, const T* LIGHTTRANSPORT_RESTRICT a, T first)
{
  int others = 0;
  for (std::int64_t i = 0; i < n; ++i)
  {
    others |= a[i] != first ? 1 : 0;
  }
  return others == 0;
}
LIGHTTRANSPORT_SIMD
bool isSame(std::int64_t n, const float* a, float first)
{
  return sameAs(n, a, first);
}
LIGHTTRANSPORT_SIMD
bool isSame(std::int64_t n, const double* a, double first)
{
  return sameAs(n, a, first);
}

/** What the solvers ask of the operator's rows. */
struct OperatorSummary
{
  float diagonal = 0.f, gershgorin = 0.f;
  bool sink = false, noSink = false, wall = false;

  void add(const OperatorSummary& other)
  {
    this->diagonal = std::max(this->diagonal, other.diagonal);
    this->gershgorin = std::max(this->gershgorin, other.gershgorin);
    this->sink = this->sink || other.sink;
    this->noSink = this->noSink || other.noSink;
    this->wall = this->wall || other.wall;
  }
};

LIGHTTRANSPORT_SIMD
void summarise(int n, const float* gx, const float* gy, const float* gyS, const float* gz,
  const float* gzB, const float* s, OperatorSummary& summary)
{
  // values >= 0 are in the order of their bits, whose extremes are found in vectors
  const auto bitsOf = [](float value)
  {
    std::int32_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    return bits;
  };
  std::int32_t diagonal = 0;
  std::int32_t gershgorin = 0;
  std::int32_t most = 0;
  std::int32_t least = std::numeric_limits<std::int32_t>::max();
  for (int i = 0; i < n; ++i)
  {
    const float faces = gx[i] + gx[i - 1] + gy[i] + gyS[i] + gz[i] + gzB[i];
    const std::int32_t all = bitsOf(faces + s[i]);
    const std::int32_t twice = bitsOf(faces + (faces + s[i]));
    const std::int32_t sink = bitsOf(s[i]);
    diagonal = all > diagonal ? all : diagonal;
    gershgorin = twice > gershgorin ? twice : gershgorin;
    most = sink > most ? sink : most;
    least = sink < least ? sink : least;
  }
  const auto valueOf = [](std::int32_t bits)
  {
    float value;
    std::memcpy(&value, &bits, sizeof(value));
    return value;
  };
  summary.diagonal = valueOf(diagonal);
  summary.gershgorin = valueOf(gershgorin);
  summary.sink = valueOf(most) > NoSink;
  summary.noSink = !(least > bitsOf(NoSink));
}

template <class T>
double harmonicMean(T a, T b)
{
  const double x = static_cast<double>(a);
  const double y = static_cast<double>(b);
  return x > 0. && y > 0. ? 2. * x * (y / (x + y)) : 0.;
}
} // namespace

//------------------------------------------------------------------------------
const char* ToString(StopReason reason)
{
  switch (reason)
  {
    case StopReason::Converged:
      return "Converged";
    case StopReason::MaxIterations:
      return "MaxIterations";
    case StopReason::Breakdown:
      return "Breakdown";
    case StopReason::NotFinite:
      return "NotFinite";
    case StopReason::Diverged:
      return "Diverged";
    case StopReason::Cancelled:
      return "Cancelled";
    case StopReason::NoSteadyState:
      return "NoSteadyState";
    case StopReason::BadInput:
      return "BadInput";
  }
  return "Unknown";
}

//------------------------------------------------------------------------------
Showing::Showing(const DiffusionControl& how)
  : control(how)
  , last(this->now())
{
}

double Showing::now() const
{
  return this->control.clock ? this->control.clock() : lighttransport::now();
}

bool Showing::isDue() const
{
  return this->control.intermediate &&
    this->now() - this->last >= this->control.intermediateInterval;
}

void Showing::operator()(const double* phi)
{
  if (this->isDue())
  {
    this->control.intermediate(phi);
    this->last = this->now();
  }
}

//------------------------------------------------------------------------------
double DiffuseFresnelReflectance(double eta)
{
  if (eta == 1.)
  {
    return 0.;
  }
  // 2 int F mu dmu = int F d(mu^2); beyond the critical angle F = 1. Inside the
  // cone, u = mu^2 - critical >= 0 has a square-root kink at 0: u = t^2.
  const double critical = eta > 1. ? 1. - 1. / (eta * eta) : 0.;
  constexpr int intervals = 2000; // Simpson
  const double length = std::sqrt(1. - critical);
  double sum = 0.;
  for (int i = 0; i <= intervals; ++i)
  {
    const double t = length * i / intervals;
    const double weight = i == 0 || i == intervals ? 1. : (i % 2 ? 4. : 2.);
    const double mu = std::sqrt(std::min(1., critical + t * t));
    sum += weight * unpolarisedFresnel(mu, eta) * 2. * t;
  }
  return critical + sum * length / (3. * intervals);
}

double BoundaryFactor(double eta)
{
  const double F = DiffuseFresnelReflectance(eta);
  return (1. + F) / (1. - F);
}

//------------------------------------------------------------------------------
DiffusionSolver::DiffusionSolver(ParallelFor how)
  : parallelFor(std::move(how))
{
}

std::int64_t DiffusionSolver::rows() const
{
  return static_cast<std::int64_t>(this->box.dims[1]) * this->box.dims[2];
}

std::int64_t DiffusionSolver::bytesHeld() const
{
  return this->A.bytes() + this->multigrid.bytes() + this->aggregation.bytes() +
    this->sinkWithoutShift.bytes() + this->constant.bytes();
}

//------------------------------------------------------------------------------
template <class T>
DiffusionReport DiffusionSolver::setMedium(
  const DiffusionMedium<T>& medium, const ProgressFunction& progress)
{
  return this->interruptible(progress,
    [&](DiffusionReport& report)
    {
      report = this->check(medium);
      if (report.reason != StopReason::Converged)
      {
        return;
      }
      if (this->isConstant)
      {
        this->describe(medium);
      }
      else
      {
        this->assemble(medium, {});
      }
      report.bytes = this->bytesHeld();
    });
}

template <class Solve>
DiffusionReport DiffusionSolver::interruptible(const ProgressFunction& progress, const Solve& solve)
{
  const double began = now();
  const WatchedFor::Asking asking(this->parallelFor, progress);
  DiffusionReport report;
  try
  {
    solve(report);
  }
  catch (const Interrupted&)
  {
    if (!this->multigridReady)
    {
      this->multigrid.release(); // half of it
    }
    report.reason = StopReason::Cancelled;
    if (report.message.empty())
    {
      report.message = report.iterations > 0
        ? "cancelled; the residual is that of the last iteration, not recomputed"
        : "cancelled before the first iteration; the field is the one before";
    }
  }
  report.seconds = now() - began;
  return report;
}

template <class T>
DiffusionReport DiffusionSolver::check(const DiffusionMedium<T>& medium)
{
  DiffusionReport report;
  this->volume = this->box = medium.grid;
  this->corner = { { 0, 0, 0 } };
  this->shift = 0.;
  this->sinkWithoutShift.release();
  this->dropHierarchies();
  this->isConstant = false;
  this->constant.release();

  const std::array<int, 3>& n = this->box.dims;
  const std::array<double, 3>& h = this->box.spacing;
  const std::int64_t size = this->box.size();
  const auto bad = [&report](const std::string& what)
  {
    report.reason = StopReason::BadInput;
    report.message = what;
    return report;
  };
  for (int d = 0; d < 3; ++d)
  {
    if (n[d] < 1)
    {
      return bad("the grid is empty");
    }
    if (!std::isfinite(h[d]) || !(h[d] > 0.))
    {
      return bad("the spacing is not positive");
    }
  }
  if (!std::isfinite(medium.refractiveIndexRatio) || !(medium.refractiveIndexRatio > 0.))
  {
    return bad("the refractive index ratio is not positive");
  }

  // 1. check, and find the scale: no diagonal is above it
  const T* D = medium.D;
  const std::uint8_t* outside = medium.outside;
  struct Extremes
  {
    std::int64_t badD = -1, badSigma = -1;
    double D = 0., sigma = 0.;
  };
  std::vector<Extremes> extremes(static_cast<std::size_t>(this->rows()));
  ForRows(this->parallelFor, this->rows(), size,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        Extremes& e = extremes[static_cast<std::size_t>(r)];
        if (!outside)
        {
          e.D = largestRow(n[0], D + r * n[0]);
          e.sigma = medium.sigma_a ? largestRow(n[0], medium.sigma_a + r * n[0]) : 0.;
          if (e.D >= 0. && e.sigma >= 0.)
          {
            continue;
          }
          e = Extremes(); // find where
        }
        for (std::int64_t i = r * n[0]; i < (r + 1) * n[0]; ++i)
        {
          if (outside && outside[i])
          {
            continue;
          }
          if (!std::isfinite(D[i]) || D[i] < T(0))
          {
            e.badD = e.badD < 0 ? i : e.badD;
            continue;
          }
          e.D = std::max(e.D, static_cast<double>(D[i]));
          if (medium.sigma_a)
          {
            if (!std::isfinite(medium.sigma_a[i]) || medium.sigma_a[i] < T(0))
            {
              e.badSigma = e.badSigma < 0 ? i : e.badSigma;
              continue;
            }
            e.sigma = std::max(e.sigma, static_cast<double>(medium.sigma_a[i]));
          }
        }
      }
    });
  Extremes all;
  for (const Extremes& e : extremes)
  {
    all.badD = all.badD < 0 ? e.badD : all.badD;
    all.badSigma = all.badSigma < 0 ? e.badSigma : all.badSigma;
    all.D = std::max(all.D, e.D);
    all.sigma = std::max(all.sigma, e.sigma);
  }
  extremes = std::vector<Extremes>();
  const auto describe = [&](const char* name, std::int64_t i, double value, const char* unit)
  {
    std::ostringstream text;
    text << name << " is " << value << " at voxel (" << i % n[0] << ", " << (i / n[0]) % n[1]
         << ", " << i / (static_cast<std::int64_t>(n[0]) * n[1])
         << "); expected a finite value >= 0 (" << unit << ")";
    return text.str();
  };
  if (all.badD >= 0)
  {
    return bad(
      describe("the diffusion coefficient", all.badD, static_cast<double>(D[all.badD]), "length"));
  }
  if (all.badSigma >= 0)
  {
    return bad(describe("the absorption", all.badSigma,
      static_cast<double>(medium.sigma_a[all.badSigma]), "1/length"));
  }
  // An axis with one voxel carries no flux: the image is invariant along it.
  double perD = 0.;
  for (int d = 0; d < 3; ++d)
  {
    perD += n[d] > 1 ? 4. / (h[d] * h[d]) : 0.;
  }
  this->scale = all.D * perD + all.sigma;
  if (!(this->scale > 0.))
  {
    this->scale = 1.;
  }
  if (!std::isfinite(this->scale))
  {
    return bad("D / spacing^2 is too large for double precision");
  }
  // A row that varies ends the search.
  std::atomic<bool> same{ !outside && D[0] > T(0) && ConstantMedium::suits(this->box) };
  if (same)
  {
    ForRows(this->parallelFor, this->rows(), size,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t r = begin; r < end && same; ++r)
        {
          if (!isSame(n[0], D + r * n[0], D[0]) ||
            (medium.sigma_a && !isSame(n[0], medium.sigma_a + r * n[0], medium.sigma_a[0])))
          {
            same = false;
          }
        }
      });
  }
  this->isConstant = same;
  report.reason = StopReason::Converged;
  return report;
}

template <class T>
void DiffusionSolver::describe(const DiffusionMedium<T>& medium)
{
  const std::array<int, 3>& n = this->box.dims;
  const std::array<double, 3>& h = this->box.spacing;
  this->twoA =
    medium.boundary == Boundary::Robin ? 2. * BoundaryFactor(medium.refractiveIndexRatio) : 0.;
  this->floatMedium = DiffusionMedium<float>();
  this->doubleMedium = DiffusionMedium<double>();
  std::get<DiffusionMedium<T>&>(std::tie(this->floatMedium, this->doubleMedium)) = medium;
  this->A.allocate(n); // never touched
  this->anyWall = false;
  this->forgetFaces();

  const double D = static_cast<double>(medium.D[0]);
  const double inverse = 1. / this->scale;
  this->boundaryOf(medium.boundary);
  std::array<double, 3> out{ { 0., 0., 0. } };
  for (int d = 0; d < 3; ++d)
  {
    for (auto& side : this->border[d])
    {
      out[d] =
        medium.boundary == Boundary::ZeroFlux ? 0. : 1. / (0.5 * h[d] + this->twoA * D) / h[d];
      std::fill(side.begin(), side.end(), static_cast<float>(D * out[d] * inverse));
    }
  }
  this->constant.setup(this->box, D * inverse,
    medium.sigma_a ? static_cast<double>(medium.sigma_a[0]) * inverse : 0., out);

  // the same rows come again and again: at the borders and between
  OperatorSummary total;
  total.noSink = false;
  const std::size_t pitch = static_cast<std::size_t>(n[0]) + 1;
  std::vector<float> store(2 * 4 * pitch, 0.f);
  for (const int k : { 0, 1, n[2] - 1 })
  {
    for (const int j : { 0, 1, n[1] - 1 })
    {
      if (j >= n[1] || k >= n[2])
      {
        continue;
      }
      float* row = store.data() + 1;
      float* const g[3] = { row, row + pitch, row + 2 * pitch };
      float* s = row + 3 * pitch;
      this->computeRow(medium, j + static_cast<std::int64_t>(n[1]) * k, g, s);
      // the faces below are those above, where there is a voxel
      float* below[2] = { row + 4 * pitch, row + 5 * pitch };
      for (int d = 1; d < 3; ++d)
      {
        const double face = D * inverse / (h[d] * h[d]);
        std::fill(
          below[d - 1], below[d - 1] + n[0], (d == 1 ? j : k) > 0 ? static_cast<float>(face) : 0.f);
      }
      OperatorSummary part;
      summarise(n[0], g[0], g[1], below[0], g[2], below[1], s, part);
      total.add(part);
    }
  }
  this->largestDiagonal = static_cast<double>(total.diagonal);
  this->gershgorin = static_cast<double>(total.gershgorin);
  this->anySink = total.sink;
  this->everySink = !total.noSink;
}

template <class T>
void DiffusionSolver::assemble(const DiffusionMedium<T>& medium, std::vector<Span> spans, bool anew)
{
  const std::array<int, 3>& n = this->box.dims;
  const std::array<double, 3>& h = this->box.spacing;
  // A voxel outside the domain is a wall; so is one whose D is 0.
  const T* D = medium.D;
  const std::uint8_t* outside = medium.outside;
  const auto diffusion = [D, outside](std::int64_t i)
  { return outside && outside[i] ? T(0) : D[i]; };

  // 2. the operator
  if (anew)
  {
    this->dropHierarchies();
  }
  const bool whole = spans.empty();
  this->A.allocate(n, whole ? Pages::Large : Pages::Small);
  if (!whole)
  {
    this->A.restrictTo(std::move(spans));
  }
  this->boundaryOf(medium.boundary);
  this->twoA =
    medium.boundary == Boundary::Robin ? 2. * BoundaryFactor(medium.refractiveIndexRatio) : 0.;
  this->floatMedium = DiffusionMedium<float>();
  this->doubleMedium = DiffusionMedium<double>();
  std::get<DiffusionMedium<T>&>(std::tie(this->floatMedium, this->doubleMedium)) = medium;
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  const double inverse = 1. / this->scale;
  ForRows(this->parallelFor, this->A.numberOfRows(), this->A.activeSize,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t t = begin; t < end; ++t)
      {
        const std::int64_t r = this->A.row(t);
        const Span span = this->A.span(r);
        int at[3] = { 0, static_cast<int>(r % n[1]), static_cast<int>(r / n[1]) };
        // a row inside needs no second look but at its ends
        const bool inside = whole && !outside && n[0] > 1 && at[1] > 0 && at[1] + 1 < n[1] &&
          at[2] > 0 && at[2] + 1 < n[2];
        if (inside)
        {
          const std::int64_t o = r * n[0];
          for (int d = 0; d < 3; ++d)
          {
            faceRow(d == 0 ? n[0] - 1 : n[0], inverse / (h[d] * h[d]), D + o, D + o + stride[d],
              this->A.g[d].data() + o);
          }
          for (std::int64_t i = o; medium.sigma_a && i < o + n[0]; ++i)
          {
            this->A.s[i] = static_cast<float>(static_cast<double>(medium.sigma_a[i]) * inverse);
          }
        }
        for (at[0] = span.begin; at[0] < span.end; at[0] += inside ? n[0] - 1 : 1)
        {
          const std::int64_t i = at[0] + r * n[0];
          const T Di = diffusion(i);
          double sink = medium.sigma_a && !(outside && outside[i])
            ? static_cast<double>(medium.sigma_a[i]) * inverse
            : 0.;
          for (int d = 0; d < 3; ++d)
          {
            if (at[d] + 1 < n[d])
            {
              const double g = harmonicMean(Di, diffusion(i + stride[d])) * inverse / (h[d] * h[d]);
              if (whole || this->isActive(d, at, 1))
              {
                this->A.g[d][i] = static_cast<float>(g);
              }
              else
              {
                sink += g; // beyond the active region phi is 0
              }
            }
            if (!whole && at[d] > 0 && !this->isActive(d, at, -1))
            {
              sink += harmonicMean(Di, diffusion(i - stride[d])) * inverse / (h[d] * h[d]);
            }
            if (n[d] > 1 && medium.boundary != Boundary::ZeroFlux)
            {
              for (int side = 0; side < 2; ++side)
              {
                if (at[d] == (side ? n[d] - 1 : 0))
                {
                  const double Dd = static_cast<double>(Di);
                  const double out = Dd / (0.5 * h[d] + this->twoA * Dd) / h[d] * inverse;
                  this->border[d][side][static_cast<std::size_t>(this->borderIndex(d, at))] =
                    static_cast<float>(out);
                  sink += out;
                }
              }
            }
          }
          this->A.s[i] = static_cast<float>(sink);
        }
      }
    });

  // 3. what the solvers ask of it
  using Summary = OperatorSummary;
  std::vector<Summary> summaries(static_cast<std::size_t>(this->A.numberOfRows()));
  ForRows(this->parallelFor, this->A.numberOfRows(), this->A.activeSize,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t t = begin; t < end; ++t)
      {
        const std::int64_t r = this->A.row(t);
        const Span span = this->A.span(r);
        Summary& summary = summaries[static_cast<std::size_t>(t)];
        const int at[3] = { 0, static_cast<int>(r % n[1]), static_cast<int>(r / n[1]) };
        // voxels outside the domain have no say
        int first = span.begin;
        while (first < span.end)
        {
          const auto isOut = [&](int x) { return outside && outside[r * n[0] + x]; };
          int last = outside ? first : span.end;
          while (last < span.end && !isOut(last))
          {
            ++last;
          }
          if (first < last)
          {
            const std::int64_t o = r * n[0] + first;
            Summary part;
            const float* none = this->A.zeros.data();
            summarise(last - first, this->A.g[0].data() + o, this->A.g[1].data() + o,
              at[1] > 0 ? this->A.g[1].data() + o - stride[1] : none, this->A.g[2].data() + o,
              at[2] > 0 ? this->A.g[2].data() + o - stride[2] : none, this->A.s.data() + o, part);
            for (std::int64_t i = o; i < o + last - first && !summary.wall; ++i)
            {
              summary.wall = !(D[i] > T(0));
            }
            summary.add(part);
          }
          first = last + 1;
        }
      }
    });
  Summary total;
  for (const Summary& summary : summaries)
  {
    total.add(summary);
  }
  this->largestDiagonal = static_cast<double>(total.diagonal);
  this->gershgorin = static_cast<double>(total.gershgorin);
  this->anySink = total.sink;
  this->everySink = !total.noSink;
  this->anyWall = total.wall || outside;
  CloseIsolated(this->A, NoSink, this->parallelFor);
}

void DiffusionSolver::setOperator(const Grid& grid, DiffusionOperator&& op, double operatorScale)
{
  this->dropHierarchies();
  this->isConstant = false;
  this->shift = 0.;
  this->sinkWithoutShift.release();
  this->volume = this->box = grid;
  this->corner = { { 0, 0, 0 } };
  this->scale = operatorScale;
  this->A = std::move(op);
  this->floatMedium = DiffusionMedium<float>(); // the residual is that of this operator
  this->doubleMedium = DiffusionMedium<double>();
  this->boundaryOf(Boundary::ZeroFlux);
  this->anySink = false;
  this->everySink = true;
  for (std::int64_t i = 0; i < this->A.size(); ++i)
  {
    const bool sink = this->A.s[i] > NoSink;
    this->anySink = this->anySink || sink;
    this->everySink = this->everySink && sink;
  }
  this->anyWall = true;
  CloseIsolated(this->A, NoSink, this->parallelFor);
}

bool DiffusionSolver::isActive(int d, const int at[3], int step) const
{
  int other[3] = { at[0], at[1], at[2] };
  other[d] += step;
  const Span span =
    this->A.span(other[1] + static_cast<std::int64_t>(this->box.dims[1]) * other[2]);
  return other[0] >= span.begin && other[0] < span.end;
}

void DiffusionSolver::boundaryOf(Boundary boundary)
{
  for (int d = 0; d < 3; ++d)
  {
    const std::int64_t faces = this->box.dims[d] > 1 && boundary != Boundary::ZeroFlux
      ? this->box.size() / this->box.dims[d]
      : 0;
    for (auto& side : this->border[d])
    {
      side.assign(static_cast<std::size_t>(faces), 0.f);
    }
  }
}

std::int64_t DiffusionSolver::borderIndex(int d, const int at[3]) const
{
  const int u = d == 0 ? 1 : 0;
  const int v = d == 2 ? 1 : 2;
  return at[u] + static_cast<std::int64_t>(this->box.dims[u]) * at[v];
}

//------------------------------------------------------------------------------
double DiffusionSolver::positivityBound() const
{
  return 1. / (this->scale * std::max(this->largestDiagonal * SumInFloat, NoDiagonal));
}

double DiffusionSolver::stabilityBound() const
{
  return 2. / (this->scale * std::max(this->gershgorin * SumInFloat, NoDiagonal));
}

//------------------------------------------------------------------------------
void DiffusionSolver::setShift(double value)
{
  if (value == this->shift)
  {
    return;
  }
  if (this->shift != 0.)
  {
    std::swap(this->A.s, this->sinkWithoutShift);
    this->sinkWithoutShift.release();
    this->shift = 0.;
    this->dropHierarchies();
  }
  if (value != 0.)
  {
    this->storeFaces();
    const std::int64_t size = this->box.size();
    const float* s = this->A.s.data();
    Buffer<float> shifted(size);
    ForRows(this->parallelFor, size, size,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t i = begin; i < end; ++i)
        {
          shifted[i] = static_cast<float>(static_cast<double>(s[i]) + value);
        }
      });
    this->sinkWithoutShift = std::move(this->A.s);
    this->A.s = std::move(shifted);
    this->shift = value;
    this->dropHierarchies();
  }
}

void DiffusionSolver::prepareMultigrid(const ParallelFor& loop)
{
  if (!this->multigridReady && this->aggregation.empty())
  {
    this->multigrid.setup(this->A, loop);
    this->multigridReady = true;
  }
}

bool DiffusionSolver::aggregate(std::int64_t vectors, std::int64_t& bytes)
{
  this->mayAggregate = false; // is not tried again
  const bool stored = this->A.isStored();
  try
  {
    this->storeFaces();
    const std::int64_t held = this->bytesHeld() + vectors;
    const bool made = this->aggregation.setup(this->A,
      std::max(AllowedBytes * this->A.activeSize - held, AllowedAnyhow), this->parallelFor);
    bytes = held + this->aggregation.bytes();
    if (!stored)
    {
      this->forgetFaces();
    }
    if (made)
    {
      this->multigrid.release();
      this->multigridReady = false;
    }
    return made;
  }
  catch (const std::bad_alloc&)
  {
    this->aggregation.release();
    if (!stored)
    {
      this->forgetFaces();
    }
    return false;
  }
  catch (const Interrupted&)
  {
    this->aggregation.release(); // half of it
    this->mayAggregate = true;
    throw;
  }
}

void DiffusionSolver::dropHierarchies()
{
  this->multigrid.release();
  this->multigridReady = false;
  this->aggregation.release();
  this->mayAggregate = true;
}

void DiffusionSolver::storeFaces()
{
  if (!this->A.isStored())
  {
    const bool ready = this->multigridReady; // it depends on the operator's values alone
    const auto again = [this](const auto& medium)
    {
      if (medium.D)
      {
        const auto same = medium;
        try
        {
          this->assemble(same, {}, false);
        }
        catch (const Interrupted&)
        {
          this->forgetFaces(); // half of them
          throw;
        }
      }
    };
    again(this->floatMedium);
    again(this->doubleMedium);
    this->multigridReady = ready;
  }
}

template <class T>
void DiffusionSolver::computeRow(
  const DiffusionMedium<T>& medium, std::int64_t row, float* const g[3], float* s) const
{
  const std::array<int, 3>& n = this->box.dims;
  const std::array<double, 3>& h = this->box.spacing;
  const std::int64_t o = row * n[0];
  const T* D = medium.D + o;
  const int at[3] = { 0, static_cast<int>(row % n[1]), static_cast<int>(row / n[1]) };
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  const double inverse = 1. / this->scale;
  for (int d = 0; d < 3; ++d)
  {
    const int open = d == 0 ? n[0] - 1 : at[d] + 1 < n[d] ? n[0] : 0;
    faceRow(open, inverse / (h[d] * h[d]), D, D + stride[d], g[d]);
    std::fill(g[d] + open, g[d] + n[0], 0.f);
  }
  sinkRow(n[0], medium.sigma_a ? medium.sigma_a + o : nullptr, inverse, s);
  for (int d = 0; d < 3; ++d)
  {
    for (int side = 0; side < 2 && !this->border[d][side].empty(); ++side)
    {
      const float* out = this->border[d][side].data();
      if (d == 0)
      {
        s[side ? n[0] - 1 : 0] += out[row];
      }
      else if (at[d] == (side ? n[d] - 1 : 0))
      {
        const float* along = out + static_cast<std::int64_t>(n[0]) * at[3 - d];
        for (int i = 0; i < n[0]; ++i)
        {
          s[i] += along[i];
        }
      }
    }
  }
}

double DiffusionSolver::face(int d, std::int64_t i) const
{
  if (this->A.isStored())
  {
    return static_cast<double>(this->A.g[d][i]);
  }
  const std::array<int, 3>& n = this->box.dims;
  const std::int64_t next = i +
    (d == 0      ? 1
        : d == 1 ? n[0]
                 : static_cast<std::int64_t>(n[0]) * n[1]);
  const double H = this->floatMedium.D
    ? harmonicMean(this->floatMedium.D[i], this->floatMedium.D[next])
    : harmonicMean(this->doubleMedium.D[i], this->doubleMedium.D[next]);
  return H / (this->scale * this->box.spacing[d] * this->box.spacing[d]);
}

void DiffusionSolver::forgetFaces()
{
  // active regions, walls, time steps and grounded voxels keep them
  if (this->A.isStored() && this->A.spans.empty() && !this->anyWall && this->shift == 0. &&
    !this->grounded)
  {
    this->A.forget(
      [this](std::int64_t row, float* const g[3], float* s)
      {
        if (this->floatMedium.D)
        {
          this->computeRow(this->floatMedium, row, g, s);
        }
        else
        {
          this->computeRow(this->doubleMedium, row, g, s);
        }
      });
  }
}

//------------------------------------------------------------------------------
template <class T>
void DiffusionSolver::RightHandSide<T>::row(std::int64_t o, int n, double* to) const
{
  rightHandSideRow(n, this->q ? this->q + o : nullptr, this->qScale, this->mean,
    this->previous ? this->shifted + o : nullptr, this->previous ? this->unshifted + o : nullptr,
    this->previous ? this->previous + o : nullptr, to);
}

template <class T>
void DiffusionSolver::measure(RightHandSide<T>& b) const
{
  const bool plain = b.q && !b.previous;
  std::vector<std::uint8_t> signs(static_cast<std::size_t>(plain ? this->rows() : 0), 0);
  b.norm = std::sqrt(SumEachRow(this->A, this->parallelFor,
    [&](std::int64_t row, std::int64_t o, int n)
    {
      if (plain)
      {
        signs[static_cast<std::size_t>(row)] = signsOf(n, b.q + o); // while it is in the cache
        return squaresRow(n, b.q + o, b.qScale, b.mean);
      }
      static thread_local std::vector<double> store;
      store.assign(2 * static_cast<std::size_t>(n), 0.);
      b.row(o, n, store.data());
      return subtract(n, store.data(), store.data() + n, 1., nullptr);
    }));
  int any = 0;
  for (const std::uint8_t one : signs)
  {
    any |= one;
  }
  b.sign = b.mean != 0. ? 0 : any == 1 ? 1 : any == 2 ? -1 : 0;
}

/**
 * A phi of one row in double from the medium itself: the stored faces are float, which is
 * enough to move phi and not to judge it. Beyond an active region phi is 0.
 */
template <class T>
void DiffusionSolver::applyExactly(const DiffusionMedium<T>& medium, const double* phi,
  std::int64_t row, std::int64_t o, int n, double* y) const
{
  const std::array<int, 3>& dims = this->box.dims;
  const std::array<double, 3>& h = this->box.spacing;
  const std::int64_t stride[3] = { 1, dims[0], static_cast<std::int64_t>(dims[0]) * dims[1] };
  const int at[3] = { static_cast<int>(o - row * dims[0]), static_cast<int>(row % dims[1]),
    static_cast<int>(row / dims[1]) };
  const double inverse = 1. / this->scale;
  const bool before = at[0] > 0;
  const bool after = at[0] + n < dims[0];
  // rows of D: itself, south, north, below, above
  const std::int64_t to[5] = { 0, at[1] > 0 ? -stride[1] : 0, at[1] + 1 < dims[1] ? stride[1] : 0,
    at[2] > 0 ? -stride[2] : 0, at[2] + 1 < dims[2] ? stride[2] : 0 };
  const T* D[5];
  static thread_local std::vector<T> store;
  const std::size_t pitch = static_cast<std::size_t>(n) + 2;
  store.resize(medium.outside ? 5 * pitch : 0);
  for (std::size_t r = 0; r < 5; ++r)
  {
    D[r] = medium.D + o + to[r];
    if (medium.outside)
    {
      T* masked = store.data() + r * pitch + 1; // 0 outside
      for (int i = before ? -1 : 0; i < (after ? n + 1 : n); ++i)
      {
        masked[i] = medium.outside[o + to[r] + i] ? T(0) : D[r][i];
      }
      D[r] = masked;
    }
  }
  const double* x = phi + o;
  if (medium.sigma_a && !medium.outside)
  {
    absorbedRow(n, inverse, medium.sigma_a + o, x, y);
  }
  else
  {
    for (int i = 0; i < n; ++i)
    {
      const bool absorbs = medium.sigma_a && !medium.outside[o + i]; // elsewhere it may be anything
      y[i] = absorbs ? static_cast<double>(medium.sigma_a[o + i]) * inverse * x[i] : 0.;
    }
  }
  addExactFaces(n,
    ExactRow<T>{ D[0], D[1], D[2], D[3], D[4], x, x + to[1], x + to[2], x + to[3], x + to[4],
      inverse / (h[0] * h[0]), inverse / (h[1] * h[1]), inverse / (h[2] * h[2]), before, after },
    y);
  for (int d = 0; d < 3 && medium.boundary != Boundary::ZeroFlux; ++d)
  {
    for (int side = 0; side < 2 && dims[d] > 1; ++side)
    {
      const int edge = side ? dims[d] - 1 : 0;
      const int first = d == 0 ? edge - at[0] : 0;
      const int last = d == 0 ? first + 1 : n;
      if (d == 0 ? first >= 0 && first < n : at[d] == edge)
      {
        for (int i = first; i < last; ++i)
        {
          const double own = static_cast<double>(D[0][i]);
          y[i] += own / (0.5 * h[d] + this->twoA * own) / h[d] * inverse * x[i];
        }
      }
    }
  }
}

template <class T>
double DiffusionSolver::residual(
  const RightHandSide<T>& b, const double* phi, float* out, double rScale, bool exactly) const
{
  const double inverse = 1. / rScale;
  return std::sqrt(SumEachRow(this->A, this->parallelFor,
    [&](std::int64_t row, std::int64_t o, int n)
    {
      static thread_local std::vector<double> store;
      store.resize(2 * static_cast<std::size_t>(n));
      double* right = store.data();
      double* y = right + n;
      b.row(o, n, right);
      if (!phi)
      {
        std::fill(y, y + n, 0.);
      }
      else if ((exactly || !this->A.isStored()) && !b.ofSteps && this->floatMedium.D)
      {
        this->applyExactly(this->floatMedium, phi, row, o, n, y);
      }
      else if ((exactly || !this->A.isStored()) && !b.ofSteps && this->doubleMedium.D)
      {
        this->applyExactly(this->doubleMedium, phi, row, o, n, y);
      }
      else
      {
        applyDouble(doubleRow(this->A, phi, row, o, n), y); // what the steps step with
      }
      return subtract(n, right, y, inverse, out ? out + o : nullptr);
    }));
}

//------------------------------------------------------------------------------
void DiffusionSolver::estimateError(const double* phi, const float* z, double scaled, double factor,
  int sign, DiffusionReport& report) const
{
  const DiffusionOperator& op = this->A;
  struct Row
  {
    double largest = 0., errors = 0., values = 0.;
  };
  std::vector<Row> rows(static_cast<std::size_t>(op.numberOfRows()));
  const auto forRows = [&](std::int64_t every, auto&& action)
  {
    const std::int64_t some = (op.numberOfRows() + every - 1) / every;
    ForRows(this->parallelFor, some, op.activeSize / every,
      [&](std::int64_t begin, std::int64_t end) { action(begin * every, end * every); });
  };
  const auto inRow = [&op](std::int64_t t, auto&& action)
  {
    const std::int64_t row = op.row(t);
    const Span span = op.span(row);
    for (std::int64_t i = row * op.dims[0] + span.begin; i < row * op.dims[0] + span.end; ++i)
    {
      action(i);
    }
  };
  forRows(1,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t t = begin; t < end; ++t)
      {
        Row one;
        inRow(t,
          [&](std::int64_t i)
          {
            const double error = factor * scaled * static_cast<double>(z[i]);
            const double value = phi[i] + error;
            one.largest = std::max(one.largest, std::abs(value));
            one.errors += error * error;
            one.values += value * value;
          });
        rows[static_cast<std::size_t>(t)] = one;
      }
    });
  Row total;
  for (const Row& one : rows)
  {
    total.largest = std::max(total.largest, one.largest);
    total.errors += one.errors;
    total.values += one.values;
  }
  report.estimatedErrorL2 = total.values > 0. ? std::sqrt(total.errors / total.values) : 0.;
  // Some hundred thousand voxels tell the percentile. |error| / |phi| in bins of a sixteenth of an
  // octave: the top 13 bits of a float.
  const std::int64_t every = std::max<std::int64_t>(1, op.activeSize / 300000) | 1;
  constexpr int shift = 19;
  // Slow components fill a part of the voxels, which the percentile sees or not.
  const double step = std::sqrt(factor) * scaled;
  std::vector<std::int64_t> counts(std::size_t(1) << (31 - shift), 0);
  std::mutex guard;
  forRows(every,
    [&](std::int64_t begin, std::int64_t end)
    {
      std::vector<std::uint32_t> bins;
      for (std::int64_t t = begin; t < std::min(end, op.numberOfRows()); t += every)
      {
        inRow(t,
          [&](std::int64_t i)
          {
            const double error = step * static_cast<double>(z[i]);
            double before = phi[i];
            double value = before + error;
            if (sign != 0)
            {
              // what has the wrong sign becomes 0
              before = std::max(0., sign * before);
              value = std::max(0., sign * value);
            }
            if (std::abs(value) >= 1e-6 * total.largest && value != 0.)
            {
              const float ratio =
                static_cast<float>(std::min(std::abs((value - before) / value), 1e30));
              std::uint32_t bits;
              std::memcpy(&bits, &ratio, sizeof(bits));
              bins.push_back(bits >> shift);
            }
          });
      }
      const std::lock_guard<std::mutex> lock(guard);
      for (const std::uint32_t bin : bins)
      {
        ++counts[bin];
      }
    });
  std::int64_t all = 0;
  for (const std::int64_t count : counts)
  {
    all += count;
  }
  if (all == 0)
  {
    report.estimatedError = total.values > 0. ? 1. : 0.;
    return;
  }
  std::int64_t above = 0;
  std::size_t bin = counts.size();
  while (bin > 0 && (above + counts[bin - 1]) * 20 <= all)
  {
    above += counts[--bin];
  }
  const std::uint32_t bits = static_cast<std::uint32_t>(bin) << shift; // upper edge of that bin
  float ratio;
  std::memcpy(&ratio, &bits, sizeof(ratio));
  report.estimatedError = static_cast<double>(ratio);
}

void DiffusionSolver::addCut(const std::vector<std::pair<std::int64_t, double>>& missing,
  double beyond, const double* phi, DiffusionReport& report)
{
  double largest = 0.;
  for (const auto& source : missing)
  {
    largest = std::max(largest, std::abs(source.second));
  }
  if (report.estimatedError < 0. || !(largest > 0.) ||
    (!this->multigridReady && this->aggregation.empty()))
  {
    return;
  }
  // A e = what is missing; near the rim, where it shows, one cycle is as good as a solve
  Buffer<float> b(this->box.size(), this->A.pages);
  Buffer<float> e(this->box.size(), this->A.pages);
  const std::array<int, 3>& n = this->volume.dims;
  for (const auto& source : missing)
  {
    const std::int64_t row = source.first / n[0];
    const std::int64_t i =
      this->box.index(static_cast<int>(source.first - row * n[0]) - this->corner[0],
        static_cast<int>(row % n[1]) - this->corner[1],
        static_cast<int>(row / n[1]) - this->corner[2]);
    b[i] = static_cast<float>(source.second / largest);
  }
  if (this->aggregation.empty())
  {
    this->multigrid.cycle(b.data(), e.data(), this->parallelFor);
  }
  else
  {
    this->aggregation.cycle(this->A, b.data(), e.data(), this->parallelFor, nullptr);
  }
  DiffusionReport cut;
  this->estimateError(phi, e.data(), largest / this->scale, 1., 0, cut);
  report.estimatedError += cut.estimatedError;
  report.estimatedErrorL2 += cut.estimatedErrorL2 + beyond;
}

//------------------------------------------------------------------------------
bool DiffusionSolver::isZero(const double* phi) const
{
  std::atomic<bool> zero{ true };
  ForEachRow(this->A, this->parallelFor,
    [&](std::int64_t, std::int64_t o, int n)
    {
      if (zero && std::any_of(phi + o, phi + o + n, [](double v) { return v != 0.; }))
      {
        zero = false;
      }
    });
  return zero;
}

template <class T>
void DiffusionSolver::conjugateGradients(const RightHandSide<T>& b, double* phi,
  const DiffusionControl& control, double progressBegin, double progressEnd,
  DiffusionReport& report)
{
  const double began = now();
  const std::int64_t size = this->box.size();
  const double bNorm = b.norm;
  const auto darken = [&]
  {
    ForRows(this->parallelFor.whole(), size, size,
      [phi](std::int64_t begin, std::int64_t end) { std::fill(phi + begin, phi + end, 0.); });
  };
  if (bNorm == 0.)
  {
    darken();
    report.residual = 0.;
    report.reason = StopReason::Converged;
    return;
  }
  if (!std::isfinite(bNorm))
  {
    report.reason = StopReason::NotFinite;
    report.message = "the source is not finite";
    return;
  }
  const double goal = control.tolerance * bNorm;

  // From darkness the residual is b.
  if (this->A.spans.empty())
  {
    Touch(phi, size, this->parallelFor);
  }
  const bool dark = this->isZero(phi);
  Buffer<float> r(size, this->A.pages);
  double rScale = bNorm; // r holds the residual divided by it
  double rNorm = this->residual<T>(b, dark ? nullptr : phi, r.data(), rScale);
  report.fineApplications += dark ? 0. : 1.;
  if (!std::isfinite(rNorm))
  {
    report.reason = StopReason::NotFinite;
    report.message = "the field to start from is not finite";
    return;
  }
  report.residual = rNorm / bNorm;
  const bool named = control.targetError > 0. || control.timeBudget > 0.;
  const int sign = named ? b.sign : 0;
  if (rNorm <= goal && !named) // else the first cycle tells the error
  {
    report.reason = StopReason::Converged;
    return;
  }
  if (control.progress && !control.progress(progressBegin))
  {
    throw Interrupted();
  }

  // Passes ask whether to go on; those that change phi do not.
  const ParallelFor& loop = this->parallelFor;
  this->parallelFor.tell(progressBegin);

  // A rough answer is had with less memory: faces are computed, and z and A p share theirs.
  const bool frugal = control.tolerance >= FrugalTolerance;
  if (frugal)
  {
    this->forgetFaces();
  }
  else
  {
    this->storeFaces();
  }
  this->prepareMultigrid(loop);
  const DiffusionOperator& op = this->A;
  Buffer<float> Ap(size, this->A.pages);
  Buffer<float> p(size, this->A.pages);
  Buffer<float> own(frugal ? 0 : size, this->A.pages);
  Buffer<float>& z = frugal ? Ap : own;
  report.bytes = std::max(report.bytes, this->bytesHeld() + op.activeSize * (frugal ? 20 : 24));

  const double rStart = rNorm;
  double replaced = rNorm; // the last recomputed norm
  double best = rNorm;
  int stalls = 0;
  double rz = 0.;
  double rp = 0.;
  double least = std::numeric_limits<double>::infinity(); // r . z of phi, so far
  bool careful = false;
  double alpha = 0.;
  double pScale = rScale; // p's unit
  bool restart = false;
  bool fresh = true;
  std::vector<double> partial(2 * static_cast<std::size_t>(this->rows()), 0.);
  Showing show(control);
  SlowError slow;
  Stall stall;
  double lastEstimate = began;
  double rEstimated = 0.; // the residual's norm when the error was estimated
  // The estimate is of the iterate before: no better than by what the residual has shrunk.
  const auto renew = [&]
  {
    if (rEstimated > 0.)
    {
      report.estimatedError *= std::min(1., rNorm / rEstimated);
      report.estimatedErrorL2 *= std::min(1., rNorm / rEstimated);
      rEstimated = rNorm;
    }
  };
  const auto finish = [&](StopReason reason)
  {
    renew();
    const double last = this->residual<T>(b, phi, nullptr, 1.);
    report.fineApplications += 1.;
    report.residual = last / bNorm;
    report.reason = last <= goal ? StopReason::Converged : reason;
    if (!std::isfinite(last))
    {
      report.reason = StopReason::NotFinite;
    }
  };

  for (int iteration = 0;; ++iteration)
  {
    if (iteration >= control.maxIterations)
    {
      finish(StopReason::MaxIterations);
      return;
    }
    // Where the multigrid does not see what is slow, the other way takes over: a new beginning for
    // the iteration, and for what it tells of the error.
    if (this->mayAggregate && control.aggregation)
    {
      double misses = rNorm / std::max(goal, 1e-14 * bNorm); // double's end
      if (control.targetError > 0. && report.estimatedError >= 0.)
      {
        misses = std::min(misses, report.estimatedError / (0.5 * control.targetError));
      }
      stall.add(std::max(misses, 1.));
      // within a budget only where there is time for it
      const double spent = now() - began;
      const bool inTime = !(control.timeBudget > 0.) ||
        control.timeBudget - spent > ManyIterations * spent / (iteration + 1);
      if (stall.iterationsLeft() > ManyIterations && inTime)
      {
        std::int64_t bytes = 0;
        if (this->aggregate(op.activeSize * (frugal ? 20 : 24), bytes))
        {
          restart = true;
          slow = SlowError();
          least = std::numeric_limits<double>::infinity();
        }
        report.bytes = std::max(report.bytes, bytes);
      }
    }
    // 1. z = B r, and z . r and z . Ap of its rows as they come
    const RowBody dots = [&](std::int64_t row, std::int64_t o, int n)
    { twoDots(n, z.data() + o, r.data() + o, Ap.data() + o, partial.data() + 2 * row); };
    if (this->aggregation.empty())
    {
      this->multigrid.cycle(r.data(), z.data(), loop, dots);
    }
    else
    {
      this->aggregation.cycle(op, r.data(), z.data(), loop, dots);
    }
    report.fineApplications += 1. + 2. * this->multigrid.sweeps;
    // 2. p = z + beta p, beta = z . (r - r_old) / (r_old . z_old): the flexible form,
    //    since a cycle in float is not quite linear
    double rzNew = 0.;
    double zAp = 0.;
    const auto sumUp = [&]
    {
      rzNew = zAp = 0.;
      for (std::size_t i = 0; i < partial.size(); i += 2)
      {
        rzNew += partial[i];
        zAp += partial[i + 1];
      }
    };
    sumUp();
    if (std::isfinite(rzNew) && !(rzNew > 0.))
    {
      // The coarse operators are not Galerkin's: where one is far too weak, the correction
      // overshoots. A step along r / diagonal always gains.
      DivideByDiagonal(op, r.data(), z.data(), loop);
      restart = true;
      ForEachRow(op, loop,
        [&](std::int64_t row, std::int64_t o, int n)
        { twoDots(n, z.data() + o, r.data() + o, Ap.data() + o, partial.data() + 2 * row); });
      sumUp();
    }
    if (!std::isfinite(rzNew) || !(rzNew > 0.))
    {
      finish(std::isfinite(rzNew) ? StopReason::Breakdown : StopReason::NotFinite);
      report.message = "the preconditioned residual is not positive";
      return;
    }
    // (where z has overwritten A p, Fletcher and Reeves's form; r was perhaps rescaled since)
    const double beta = restart || iteration == 0 ? 0.
      : frugal                                    ? rzNew / rz * (rScale / pScale)
                                                  : -alpha * zAp / rp;
    pScale = rScale;
    const bool restarted = restart;
    restart = false;
    rz = rzNew;
    // 3. how far off is phi? B r is the error that a cycle sees; the iteration tells what it
    // misses.
    const double rzOfPhi = rz * rScale * rScale;
    if (named)
    {
      this->estimateError(phi, z.data(), rScale, slow.factor(rzOfPhi), sign, report);
      rEstimated = rNorm;
      if (rNorm <= goal) // where it started
      {
        report.reason = StopReason::Converged;
        return;
      }
      if (iteration > 0 && control.targetError > 0. &&
        report.estimatedError <= 0.5 * control.targetError)
      {
        finish(StopReason::Converged);
        return;
      }
      // another iteration, and the last look at the residual
      const double perIteration = now() - lastEstimate;
      lastEstimate = now();
      if (iteration > 0 && control.timeBudget > 0. &&
        lastEstimate - began + 1.5 * perIteration > control.timeBudget)
      {
        finish(StopReason::MaxIterations);
        report.message = "the time budget is used up";
        return;
      }
    }
    // 4. alpha = r . p / p . A p, with A p = A z + beta A p_old but where the residual was
    //    recomputed: there A p is as well, and r . p, which is r . z else
    double pAp = 0.;
    // What grows has lost its directions to float's rounding.
    least = std::min(least, rzOfPhi);
    careful = careful || rzOfPhi > 4. * least;
    // A recomputed r has parts along p that the last step should have taken, as has one that
    // was rounded: with r . z the step would be too long by far, and every one after it again.
    const bool measured = (fresh || careful) && beta != 0.;
    const auto alongResidual = [&]
    {
      return SumEachRow(op, loop,
        [&](std::int64_t, std::int64_t o, int n)
        {
          double sums[2];
          twoDots(n, p.data() + o, r.data() + o, r.data() + o, sums);
          return sums[0];
        });
    };
    if (fresh || frugal)
    {
      const auto combineWith = [&](float factor)
      {
        ForEachRow(op, loop,
          [&](std::int64_t, std::int64_t o, int n)
          { combine(n, factor, z.data() + o, p.data() + o); });
      };
      combineWith(static_cast<float>(beta));
      rp = measured ? alongResidual() : rz;
      if (frugal && measured && !(rp > 0.5 * rz && rp < 2. * rz))
      {
        // Fletcher and Reeves's form never comes back from a direction across the residual
        // (Powell 1977, Math. Program. 12, 241): steps along it are short, and the next one is the
        // same again.
        combineWith(0.f);
        rp = rz;
      }
      pAp = Apply(op, p.data(), Ap.data(), loop);
    }
    else
    {
      pAp = Advance(op, z.data(), static_cast<float>(beta), p.data(), Ap.data(), loop);
      rp = measured ? alongResidual() : rz;
    }
    fresh = false;
    report.fineApplications += 1.;
    if (!frugal && beta != 0. && std::isfinite(pAp) && (!(pAp > 1e-2 * rz) || !(rp > 0.)))
    {
      // z is hardly more than the direction before (where a step leaves nothing but rounding):
      // what is conjugate to that is noise, and a step along it would be huge. Along z alone.
      ForEachRow(op, loop,
        [&](std::int64_t, std::int64_t o, int n) { combine(n, 0.f, z.data() + o, p.data() + o); });
      pAp = Apply(op, p.data(), Ap.data(), loop);
      rp = rz;
      report.fineApplications += 1.;
    }
    if (!std::isfinite(pAp) || !(pAp > 0.))
    {
      finish(std::isfinite(pAp) ? StopReason::Breakdown : StopReason::NotFinite);
      report.message = "a search direction has no energy";
      return;
    }
    alpha = rp / pAp;
    restart = !(rp > 0.);
    if (!restart)
    {
      slow.add(alpha, rzOfPhi, restarted);
    }
    // 5. phi += alpha p, r -= alpha A p; not interrupted: phi stays a whole
    rNorm = rScale *
      std::sqrt(SumEachRow(op, this->parallelFor.whole(),
        [&](std::int64_t, std::int64_t o, int n)
        {
          return update(n, alpha * rScale, static_cast<float>(alpha), p.data() + o, Ap.data() + o,
            phi + o, r.data() + o);
        }));
    ++report.iterations;
    report.residual = rNorm / bNorm;

    // 6. trust only the recomputed residual, and refresh float's before its rounding shows
    if (!std::isfinite(rNorm))
    {
      finish(StopReason::NotFinite);
      return;
    }
    const bool claims = rNorm <= goal;
    if (claims || rNorm < 1e-3 * replaced)
    {
      const double recurred = rNorm;
      rScale = std::max(recurred, 1e-12 * replaced); // a claim of exactly 0 is none
      rNorm = this->residual<T>(b, phi, r.data(), rScale, claims || rNorm < 1e-5 * bNorm);
      report.fineApplications += 1.;
      report.residual = rNorm / bNorm;
      fresh = true;
      if (claims && rNorm <= goal)
      {
        renew();
        report.reason = StopReason::Converged;
        return;
      }
      if (!std::isfinite(rNorm))
      {
        report.reason = StopReason::NotFinite;
        return;
      }
      // Where float's recursion has lost the residual, its directions are lost too.
      restart = restart || rNorm > 1.5 * recurred;
      // Double itself is at its end when the recomputed norm no longer follows.
      stalls = rNorm > 0.5 * best && recurred < 0.5 * rNorm ? stalls + 1 : 0;
      best = std::min(best, rNorm);
      if (stalls >= 3)
      {
        report.reason = StopReason::Breakdown;
        report.message = "the tolerance is below what double precision reaches here";
        return;
      }
      replaced = rNorm;
    }
    if (rNorm > 1e8 * rStart)
    {
      finish(StopReason::Diverged);
      return;
    }
    const double done =
      std::log(rStart / std::max(rNorm, goal)) / std::log(std::max(rStart / goal, 1. + 1e-9));
    const double fraction =
      progressBegin + (progressEnd - progressBegin) * std::min(1., std::max(0., done));
    this->parallelFor.tell(fraction);
    show(phi);
    if (control.progress && !control.progress(fraction))
    {
      throw Interrupted();
    }
  }
}

void DiffusionSolver::add(double sign, const double* x, double* phi) const
{
  ForEachRow(this->A, this->parallelFor.whole(),
    [&](std::int64_t, std::int64_t o, int n)
    {
      for (std::int64_t i = o; i < o + n; ++i)
      {
        phi[i] += sign * x[i];
      }
    });
}

template <class T>
void DiffusionSolver::residualOfConstant(
  const RightHandSide<T>& b, const double* phi, double* x) const
{
  ForEachRow(this->A, this->parallelFor,
    [&](std::int64_t row, std::int64_t o, int n)
    {
      b.row(o, n, x + o);
      if (phi)
      {
        static thread_local std::vector<double> store;
        store.resize(static_cast<std::size_t>(n));
        if (this->floatMedium.D)
        {
          this->applyExactly(this->floatMedium, phi, row, o, n, store.data());
        }
        else
        {
          this->applyExactly(this->doubleMedium, phi, row, o, n, store.data());
        }
        for (int i = 0; i < n; ++i)
        {
          x[o + i] -= store[static_cast<std::size_t>(i)];
        }
      }
    });
}

template <class T>
void DiffusionSolver::solveConstant(
  const RightHandSide<T>& b, double* phi, const DiffusionControl& control, DiffusionReport& report)
{
  const std::int64_t size = this->box.size();
  const double bNorm = b.norm;
  if (bNorm == 0.)
  {
    ForRows(this->parallelFor.whole(), size, size,
      [phi](std::int64_t begin, std::int64_t end) { std::fill(phi + begin, phi + end, 0.); });
    report.residual = 0.;
    report.reason = StopReason::Converged;
    return;
  }
  Touch(phi, size, this->parallelFor);
  const bool dark = this->isZero(phi);
  double rNorm = dark || !std::isfinite(bNorm) ? bNorm : this->residual<T>(b, phi, nullptr, 1.);
  report.fineApplications += dark ? 0. : 1.;
  report.residual = rNorm / bNorm;
  if (!std::isfinite(rNorm))
  {
    report.reason = StopReason::NotFinite;
    report.message =
      std::isfinite(bNorm) ? "the field to start from is not finite" : "the source is not finite";
    return;
  }
  const double goal = control.tolerance * bNorm;
  if (rNorm <= goal)
  {
    report.reason = StopReason::Converged;
    return;
  }
  // An error is told from the step that follows the last one that was needed.
  bool estimate = control.targetError > 0. || control.timeBudget > 0.;
  Buffer<double> x(size);
  report.bytes = std::max(report.bytes, this->bytesHeld() + 2 * x.bytes()); // and phi
  for (;;)
  {
    if (report.iterations >= control.maxIterations)
    {
      report.reason = rNorm <= goal ? StopReason::Converged : StopReason::MaxIterations;
      return;
    }
    // 1. x = b - A phi, in double
    this->residualOfConstant(b, dark && report.iterations == 0 ? nullptr : phi, x.data());
    // 2. x = A^-1 x
    this->constant.solve(x.data(), this->parallelFor,
      [&](double done)
      {
        this->parallelFor.tell(done);
        if (control.progress && !control.progress(done))
        {
          throw Interrupted();
        }
        return true;
      });
    if (report.iterations > 0 && estimate)
    {
      Buffer<float> z(size);
      ForRows(this->parallelFor, size, size,
        [&](std::int64_t begin, std::int64_t end)
        { std::copy(x.data() + begin, x.data() + end, z.data() + begin); });
      this->estimateError(phi, z.data(), 1., 1., 0, report);
      if (rNorm <= goal)
      {
        report.reason = StopReason::Converged;
        return;
      }
    }
    // 3. phi += x, where that is better
    this->add(1., x.data(), phi);
    const double last = rNorm;
    rNorm = this->residual<T>(b, phi, nullptr, 1.);
    report.fineApplications += 1.;
    ++report.iterations;
    if (!std::isfinite(rNorm))
    {
      report.residual = rNorm / bNorm;
      report.reason = StopReason::NotFinite;
      return;
    }
    if (rNorm > goal && rNorm > 0.5 * last)
    {
      if (rNorm > last)
      {
        this->add(-1., x.data(), phi);
        rNorm = last;
      }
      report.residual = rNorm / bNorm;
      report.reason = StopReason::Breakdown;
      report.message = "the tolerance is below what double precision reaches here";
      return;
    }
    report.residual = rNorm / bNorm;
    if (rNorm <= goal && !estimate)
    {
      report.reason = StopReason::Converged;
      return;
    }
  }
}

template <class Term>
double DiffusionSolver::sumOf(const Term& term) const
{
  return SumEachRow(this->A, this->parallelFor,
    [&](std::int64_t, std::int64_t o, int n)
    {
      double s = 0.;
      for (std::int64_t i = o; i < o + n; ++i)
      {
        s += term(i);
      }
      return s;
    });
}

template <class T>
void DiffusionSolver::balance(const T* q, const double* phi, DiffusionReport& report) const
{
  const double V = this->box.voxelVolume();
  const auto sum = [this](const auto& term) { return this->sumOf(term); };
  const auto total = [this](const auto* a, const double* b)
  {
    return SumEachRow(this->A, this->parallelFor,
      [&](std::int64_t, std::int64_t o, int n) { return totalRow(n, a + o, b ? b + o : nullptr); });
  };
  // an active region holds all sources
  report.emitted = !q ? 0. : V * total(q, nullptr);
  // from the medium itself, as the residual
  const auto weigh = [&](const auto& medium)
  {
    if (!medium.D)
    {
      return;
    }
    const auto inside = [&](std::int64_t i) { return !(medium.outside && medium.outside[i]); };
    if (medium.sigma_a)
    {
      report.absorbed = V *
        (medium.outside
            ? sum([&](std::int64_t i)
                { return inside(i) ? static_cast<double>(medium.sigma_a[i]) * phi[i] : 0.; })
            : total(medium.sigma_a, phi));
    }
    double escaped = 0.;
    const std::array<int, 3>& n = this->box.dims;
    for (int d = 0; d < 3; ++d)
    {
      const double h = this->box.spacing[d];
      for (int side = 0; side < 2; ++side)
      {
        if (n[d] == 1 || medium.boundary == Boundary::ZeroFlux)
        {
          continue;
        }
        const int u = d == 0 ? 1 : 0;
        const int v = d == 2 ? 1 : 2;
        int at[3];
        at[d] = side ? n[d] - 1 : 0;
        for (at[v] = 0; at[v] < n[v]; ++at[v])
        {
          for (at[u] = 0; at[u] < n[u]; ++at[u])
          {
            const std::int64_t i = this->box.index(at[0], at[1], at[2]);
            const double D = inside(i) ? static_cast<double>(medium.D[i]) : 0.;
            escaped += D / (0.5 * h + this->twoA * D) / h * phi[i];
          }
        }
      }
    }
    report.escaped = escaped * V;
  };
  weigh(this->floatMedium);
  weigh(this->doubleMedium);
}

//------------------------------------------------------------------------------
template <class T>
bool DiffusionSolver::steadyStateExists(const T* q, bool& singular, std::vector<std::uint8_t>& seen,
  std::vector<ClosedPart>& closed, DiffusionReport& report) const
{
  singular = false;
  if (this->everySink || (this->anySink && !this->anyWall))
  {
    return true;
  }
  const auto refuse = [&report](double sum, double magnitude, const std::string& where)
  {
    std::ostringstream text;
    text << "no steady state: " << where
         << " light is neither absorbed nor can it escape, and its sources sum to " << sum
         << " instead of 0 (the sum of magnitudes is " << magnitude
         << "); expected absorption > 0 somewhere, or an open boundary, or sources of both signs "
            "that cancel";
    report.reason = StopReason::NoSteadyState;
    report.message = text.str();
    return false;
  };
  const std::int64_t size = this->box.size();
  constexpr double balanced = 1e-6; // float sources
  if (!this->anyWall)
  {
    const double sum = this->sumOf([q](std::int64_t i) { return static_cast<double>(q[i]); });
    const double magnitude =
      this->sumOf([q](std::int64_t i) { return std::abs(static_cast<double>(q[i])); });
    const double V = this->box.voxelVolume();
    singular = true;
    return std::abs(sum) <= balanced * magnitude || refuse(sum * V, magnitude * V, "here");
  }
  // Walls may close a part off: flood each part through its open faces.
  const std::array<int, 3>& n = this->box.dims;
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  seen.assign(static_cast<std::size_t>(size), 0);
  std::vector<std::int64_t> front;
  std::int64_t visited = 0;
  const auto visits = [&]
  {
    if (++visited % 65536 == 0)
    {
      this->parallelFor.poll();
    }
  };
  const auto flood = [&](std::int64_t seed, std::uint8_t mark, const auto& action)
  {
    seen[static_cast<std::size_t>(seed)] = mark;
    front.assign(1, seed);
    while (!front.empty())
    {
      const std::int64_t i = front.back();
      front.pop_back();
      visits();
      action(i);
      const int at[3] = { static_cast<int>(i % n[0]), static_cast<int>((i / n[0]) % n[1]),
        static_cast<int>(i / stride[2]) };
      for (int d = 0; d < 3; ++d)
      {
        const auto visit = [&](std::int64_t j)
        {
          if (seen[static_cast<std::size_t>(j)] != mark)
          {
            seen[static_cast<std::size_t>(j)] = mark;
            front.push_back(j);
          }
        };
        if (at[d] + 1 < n[d] && this->A.g[d][i] > 0.f)
        {
          visit(i + stride[d]);
        }
        if (at[d] > 0 && this->A.g[d][i - stride[d]] > 0.f)
        {
          visit(i - stride[d]);
        }
      }
    }
  };
  for (std::int64_t seed = 0; seed < size; ++seed)
  {
    if (seen[static_cast<std::size_t>(seed)] || q[seed] == T(0))
    {
      continue; // only the parts with a source matter
    }
    double sum = 0.;
    double magnitude = 0.;
    bool sink = false;
    flood(seed, 1,
      [&](std::int64_t i)
      {
        sum += static_cast<double>(q[i]);
        magnitude += std::abs(static_cast<double>(q[i]));
        sink = sink || this->A.s[i] > NoSink;
      });
    if (!sink && std::abs(sum) > balanced * magnitude)
    {
      const double V = this->box.voxelVolume();
      std::ostringstream where;
      where << "in the closed part around voxel (" << seed % n[0] << ", " << (seed / n[0]) % n[1]
            << ", " << seed / stride[2] << ")";
      return refuse(sum * V, magnitude * V, where.str());
    }
    if (!sink)
    {
      closed.emplace_back();
      flood(seed, 2, [&](std::int64_t i) { closed.back().push_back(i); });
    }
  }
  return true;
}

std::vector<std::pair<std::int64_t, float>> DiffusionSolver::ground(
  bool singular, const std::vector<ClosedPart>& closed)
{
  std::vector<std::pair<std::int64_t, float>> before;
  if (!singular && closed.empty())
  {
    return before;
  }
  this->storeFaces();
  const std::array<int, 3>& n = this->box.dims;
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  const auto faces = [&](std::int64_t i)
  {
    float sum = 0.f;
    for (int d = 0; d < 3; ++d)
    {
      sum += this->A.g[d][i] + (i / stride[d] % n[d] > 0 ? this->A.g[d][i - stride[d]] : 0.f);
    }
    return sum;
  };
  const auto sinkAt = [&](std::int64_t i)
  {
    before.emplace_back(i, this->A.s[i]);
    this->A.s[i] = faces(i);
  };
  if (singular)
  {
    std::int64_t best = 0;
    for (std::int64_t i = 1; i < this->box.size(); ++i)
    {
      best = faces(i) > faces(best) ? i : best;
    }
    sinkAt(best);
  }
  for (const ClosedPart& part : closed)
  {
    sinkAt(*std::max_element(part.begin(), part.end(),
      [&](std::int64_t a, std::int64_t b) { return faces(a) < faces(b); }));
  }
  this->dropHierarchies();
  return before;
}

//------------------------------------------------------------------------------
const std::uint8_t* DiffusionSolver::outsideOfDomain() const
{
  return this->floatMedium.D ? this->floatMedium.outside : this->doubleMedium.outside;
}

template <class T>
bool DiffusionSolver::startsInside(const T* q, DiffusionReport& report) const
{
  const std::uint8_t* outside = this->outsideOfDomain();
  if (!outside || !q)
  {
    return true;
  }
  std::atomic<std::int64_t> bad{ -1 };
  ForEachRow(this->A, this->parallelFor,
    [&](std::int64_t, std::int64_t o, int n)
    {
      for (std::int64_t i = o; i < o + n; ++i)
      {
        if (outside[i] && q[i] != T(0))
        {
          bad = i;
        }
      }
    });
  if (bad < 0)
  {
    return true;
  }
  const std::array<int, 3>& n = this->box.dims;
  std::ostringstream text;
  text << "the source is " << q[bad] << " at voxel (" << bad % n[0] << ", " << (bad / n[0]) % n[1]
       << ", " << bad / (static_cast<std::int64_t>(n[0]) * n[1])
       << "), outside the domain; expected 0 there";
  report.reason = StopReason::BadInput;
  report.message = text.str();
  return false;
}

//------------------------------------------------------------------------------
template <class T>
DiffusionReport DiffusionSolver::solveSteady(
  const T* q, double* phi, const DiffusionControl& control)
{
  return this->interruptible(
    control.progress, [&](DiffusionReport& report) { this->steady(q, phi, control, report); });
}

template <class T>
void DiffusionSolver::steady(
  const T* q, double* phi, const DiffusionControl& control, DiffusionReport& report)
{
  this->parallelFor.tell(0.);
  this->setShift(0.);
  bool singular = false;
  std::vector<std::uint8_t> reached;
  std::vector<ClosedPart> closed;
  if (this->startsInside(q, report) &&
    this->steadyStateExists(q, singular, reached, closed, report))
  {
    const std::int64_t size = this->box.size();
    std::atomic<bool> changed{ false };
    const auto darken = [&]
    {
      const std::int64_t flags = static_cast<std::int64_t>(reached.size());
      ForRows(this->parallelFor.whole(), flags, flags,
        [&](std::int64_t begin, std::int64_t end)
        {
          for (std::int64_t i = begin; i < end; ++i)
          {
            if (!reached[static_cast<std::size_t>(i)] && phi[i] != 0.)
            {
              phi[i] = 0.;
              changed = true;
            }
          }
        });
    };
    darken(); // a start from elsewhere
    if (const std::uint8_t* outside = this->outsideOfDomain())
    {
      ForEachRow(this->A, this->parallelFor,
        [&](std::int64_t, std::int64_t o, int n)
        {
          for (std::int64_t i = o; i < o + n; ++i)
          {
            phi[i] = outside[i] ? 0. : phi[i];
          }
        });
    }
    RightHandSide<T> b{ q, 1. / this->scale, false };
    if (singular)
    {
      b.mean = b.qScale * this->sumOf([q](std::int64_t i) { return static_cast<double>(q[i]); }) /
        static_cast<double>(size);
    }
    this->measure(b);
    if (this->isConstant)
    {
      this->solveConstant(b, phi, control, report);
    }
    else
    {
      const auto before = this->ground(singular, closed);
      this->grounded = !before.empty();
      const auto restore = [&]
      {
        for (const auto& voxel : before)
        {
          this->A.s[voxel.first] = voxel.second;
          this->dropHierarchies();
        }
        this->grounded = false;
      };
      try
      {
        this->conjugateGradients(b, phi, control, 0., 1., report);
      }
      catch (...)
      {
        restore();
        throw;
      }
      restore();
    }
    this->keepSign(b, phi, control, report);
    changed = !closed.empty();
    for (const ClosedPart& part : closed)
    {
      double sum = 0.;
      for (const std::int64_t i : part)
      {
        sum += phi[i];
      }
      for (const std::int64_t i : part)
      {
        phi[i] -= sum / static_cast<double>(part.size());
      }
    }
    darken(); // a closed part without sink may hold any constant: it holds none
    if (changed && report.reason != StopReason::Cancelled && report.reason != StopReason::NotFinite)
    {
      // what such a part had left is gone
      report.residual = this->residual<T>(b, phi, nullptr, 1.) / (b.norm > 0. ? b.norm : 1.);
      report.fineApplications += 1.;
    }
    if (singular)
    {
      const double mean =
        this->sumOf([phi](std::int64_t i) { return phi[i]; }) / static_cast<double>(size);
      ForRows(this->parallelFor.whole(), size, size,
        [&](std::int64_t begin, std::int64_t end)
        {
          for (std::int64_t i = begin; i < end; ++i)
          {
            phi[i] -= mean;
          }
        });
    }
    this->balance(q, phi, report);
  }
}

//------------------------------------------------------------------------------
template <class T>
DiffusionMedium<T> DiffusionSolver::cut(const DiffusionMedium<T>& medium, std::vector<Span>& spans)
{
  const std::array<int, 3>& n = this->volume.dims;
  // at even corners, so that cells of the first coarse grid are whole; and no farther out, since
  // the coarser ones do worse where they begin with cells that are partly outside
  constexpr int step = 2;
  int low[3] = { n[0], n[1], n[2] };
  int high[3] = { 0, 0, 0 };
  for (std::size_t r = 0; r < spans.size(); ++r)
  {
    if (spans[r].begin < spans[r].end)
    {
      const int j = static_cast<int>(r % static_cast<std::size_t>(n[1]));
      const int k = static_cast<int>(r / static_cast<std::size_t>(n[1]));
      low[0] = std::min(low[0], spans[r].begin);
      high[0] = std::max(high[0], spans[r].end);
      low[1] = std::min(low[1], j);
      high[1] = std::max(high[1], j + 1);
      low[2] = std::min(low[2], k);
      high[2] = std::max(high[2], k + 1);
    }
  }
  // with a voxel around the region, where the volume goes on
  this->box = this->volume;
  for (int d = 0; d < 3; ++d)
  {
    this->corner[d] = std::max(0, low[d] - 1) / step * step;
    this->box.dims[d] = std::min(n[d], high[d] + 1) - this->corner[d];
  }
  const std::array<int, 3>& m = this->box.dims;
  std::vector<Span> inside(static_cast<std::size_t>(this->rows()));
  for (std::size_t r = 0; r < inside.size(); ++r)
  {
    const std::int64_t j = static_cast<std::int64_t>(r) % m[1] + this->corner[1];
    const std::int64_t k = static_cast<std::int64_t>(r) / m[1] + this->corner[2];
    const Span& whole = spans[static_cast<std::size_t>(j + k * n[1])];
    if (whole.begin < whole.end)
    {
      inside[r] = { whole.begin - this->corner[0], whole.end - this->corner[0] };
    }
  }
  // the medium, of the region and of the voxels around it
  auto& piece = std::get<Piece<T>&>(std::tie(this->floatPiece, this->doublePiece));
  const std::int64_t size = this->box.size();
  piece.D.allocate(size, Pages::Small);
  piece.sigma_a.allocate(medium.sigma_a ? size : 0, Pages::Small);
  piece.outside.allocate(medium.outside ? size : 0, Pages::Small);
  ForRows(this->parallelFor, this->rows(), size,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        Span span{ m[0], 0 };
        const int at[2] = { static_cast<int>(r % m[1]), static_cast<int>(r / m[1]) };
        const auto join = [&](int j, int k, int more)
        {
          if (j >= 0 && j < m[1] && k >= 0 && k < m[2])
          {
            const Span& other =
              inside[static_cast<std::size_t>(j + static_cast<std::int64_t>(m[1]) * k)];
            if (other.begin < other.end)
            {
              span.begin = std::min(span.begin, std::max(0, other.begin - more));
              span.end = std::max(span.end, std::min(m[0], other.end + more));
            }
          }
        };
        join(at[0], at[1], 1);
        join(at[0] - 1, at[1], 0);
        join(at[0] + 1, at[1], 0);
        join(at[0], at[1] - 1, 0);
        join(at[0], at[1] + 1, 0);
        if (span.begin >= span.end)
        {
          continue;
        }
        const std::int64_t from = this->volume.index(
          span.begin + this->corner[0], at[0] + this->corner[1], at[1] + this->corner[2]);
        const std::int64_t to = span.begin + r * m[0];
        const std::int64_t length = span.end - span.begin;
        std::copy(medium.D + from, medium.D + from + length, piece.D.data() + to);
        if (medium.sigma_a)
        {
          std::copy(
            medium.sigma_a + from, medium.sigma_a + from + length, piece.sigma_a.data() + to);
        }
        if (medium.outside)
        {
          std::copy(
            medium.outside + from, medium.outside + from + length, piece.outside.data() + to);
        }
      }
    });
  DiffusionMedium<T> part = medium;
  part.grid = this->box;
  part.D = piece.D.data();
  part.sigma_a = medium.sigma_a ? piece.sigma_a.data() : nullptr;
  part.outside = medium.outside ? piece.outside.data() : nullptr;
  spans = std::move(inside);
  return part;
}

template <class Action>
void DiffusionSolver::forRegion(const ParallelFor& loop, const Action& action) const
{
  ForEachRow(this->A, loop,
    [&](std::int64_t row, std::int64_t o, int n)
    {
      const std::array<int, 3>& m = this->box.dims;
      const int i = static_cast<int>(o - row * m[0]) + this->corner[0];
      const int j = static_cast<int>(row % m[1]) + this->corner[1];
      const int k = static_cast<int>(row / m[1]) + this->corner[2];
      action(this->volume.index(i, j, k), o, n);
    });
}

template <class T, class Q>
DiffusionReport DiffusionSolver::solveActive(const DiffusionMedium<T>& medium, const Q* q,
  double* phi, const DiffusionControl& control, double threshold)
{
  return this->interruptible(control.progress,
    [&](DiffusionReport& report)
    {
      this->parallelFor.tell(0.);
      report = this->active(medium, q, phi, control, threshold);
    });
}

template <class T, class Q>
DiffusionReport DiffusionSolver::active(const DiffusionMedium<T>& medium, const Q* q, double* phi,
  const DiffusionControl& control, double threshold)
{
  const double began = now();
  Showing show(control);
  DiffusionReport report = this->check(medium);
  if (report.reason != StopReason::Converged)
  {
    return report;
  }
  const std::int64_t size = this->volume.size();
  // A field to start from is none of this solve's. What is dark is not written to: memory that
  // nobody has touched yet costs nothing.
  const auto darken = [&]
  {
    constexpr std::int64_t piece = 4096;
    ForRows(this->parallelFor.whole(), (size + piece - 1) / piece, size,
      [phi, size](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t i = begin * piece; i < std::min(size, end * piece); i += piece)
        {
          const std::int64_t last = std::min(size, i + piece);
          if (std::any_of(phi + i, phi + last, [](double v) { return v != 0.; }))
          {
            std::fill(phi + i, phi + last, 0.);
          }
        }
      });
  };
  if (!control.fromZero)
  {
    darken();
  }
  if (this->isConstant)
  {
    this->describe(medium); // solved at once: no part of it costs less
    report = this->solveSteady(q, phi, control);
    report.seconds = now() - began;
    return report;
  }
  if (control.targetError > 0.)
  {
    threshold = std::min(threshold, 1e-6 * std::sqrt(control.targetError));
  }
  if (control.timeBudget > 0.)
  {
    threshold = std::min(threshold, 1e-7); // the estimate knows no voxel that is cut off
  }

  double spent = 0.; // applications, in parts of the volume's
  int iterations = 0;
  std::int64_t bytes = 0;
  const double quarter = control.largestRegion * static_cast<double>(size);
  const auto remaining = [&]
  {
    DiffusionControl rest = control;
    if (control.timeBudget > 0.)
    {
      rest.timeBudget = std::max(1e-6, control.timeBudget - (now() - began));
    }
    return rest;
  };
  const auto finish = [&](double fraction)
  {
    report.activeFraction = fraction;
    report.iterations = iterations;
    report.fineApplications = spent;
    report.bytes = std::max(bytes, report.bytes);
    report.seconds = now() - began;
    return report;
  };
  // Light that fills the volume is better solved for on the volume.
  const auto wholeVolume = [&](bool asked = false)
  {
    if (control.regionOrNothing && !asked)
    {
      report.reason = StopReason::MaxIterations;
      report.message = "light fills the volume";
      return finish(1.);
    }
    this->box = this->volume;
    this->corner = { { 0, 0, 0 } };
    this->assemble(medium, {});
    report = this->solveSteady(q, phi, remaining());
    iterations += report.iterations;
    spent += report.fineApplications;
    return finish(1.);
  };

  // 1. where light is likely to get
  ActiveRegion<T> region(medium, threshold);
  if (!region.start(q, 0.4 * control.largestRegion, this->parallelFor))
  {
    return wholeVolume();
  }
  double searched = 0.; // in voxels of a whole volume's solve
  const double mostSearch = control.regionSearch * static_cast<double>(size);
  // true: it has come to its end
  const auto advance = [&](std::int64_t most, std::int64_t more)
  {
    const bool ended = region.advance(most, more);
    searched += FrontCost * static_cast<double>(region.taken());
    return ended;
  };
  const auto affordable = [&]
  { return static_cast<std::int64_t>(std::max(0., mostSearch - searched) / FrontCost); };
  const std::int64_t first = std::min(FirstRegion, std::max<std::int64_t>(1024, size / FirstPart));
  // as many again cost less than to solve for the first and to begin again
  const std::int64_t once = std::min(first, affordable());
  bool complete = advance(once, std::min(first, affordable() - once));
  DiffusionControl rough;
  rough.tolerance = std::max(control.tolerance, 1e-8);
  rough.targetError = std::max(control.targetError, 0.3);
  rough.maxIterations = std::min(control.maxIterations, 2);
  if (control.progress)
  {
    rough.progress = [&control](double) { return control.progress(0.); };
  }
  Buffer<Q> source;
  Buffer<double> field;
  bool rebuild = true;
  for (int round = 0;; ++round)
  {
    std::int64_t active = region.size();
    if (active == 0)
    {
      return wholeVolume(true); // no light
    }
    if (!complete)
    {
      searched += RoughCost * static_cast<double>(active) + RoundCost;
    }
    if (static_cast<double>(active) > quarter || (!complete && searched > mostSearch))
    {
      return wholeVolume();
    }
    // 2. solve there: roughly, until the region is known
    if (rebuild)
    {
      std::vector<Span> spans = region.spans();
      const DiffusionMedium<T> part = this->cut(medium, spans);
      this->assemble(part, std::move(spans));
      source.allocate(this->box.size(), Pages::Small);
      field.allocate(this->box.size(), Pages::Small);
      this->forRegion(this->parallelFor,
        [&](std::int64_t from, std::int64_t to, int n)
        {
          std::copy(q + from, q + from + n, source.data() + to);
          if (round == 0)
          {
            std::fill(field.data() + to, field.data() + to + n, 0.); // as phi is
          }
          else
          {
            std::copy(phi + from, phi + from + n, field.data() + to);
          }
        });
      const std::int64_t nx = this->volume.dims[0];
      const std::vector<Span> domain = region.domain();
      for (std::size_t r = 0; r < domain.size(); ++r)
      {
        const Span& last = domain[r];
        double* row = phi + static_cast<std::int64_t>(r) * nx;
        std::fill(row + last.begin, row + last.end, 0.);
      }
    }
    if (!this->anySink)
    {
      return wholeVolume(); // nowhere to go: the whole volume tells
    }
    const auto publish = [&](const double* reached)
    {
      this->forRegion(this->parallelFor.whole(),
        [&](std::int64_t to, std::int64_t from, int n)
        { std::copy(reached + from, reached + from + n, phi + to); });
    };
    const bool late = control.timeBudget > 0. && now() - began > 0.5 * control.timeBudget;
    DiffusionControl how = complete || late ? remaining() : rough;
    if (control.intermediate)
    {
      how.intermediateInterval = 0.;
      how.intermediate = [&](const double* reached)
      {
        if (show.isDue())
        {
          publish(reached);
          show(phi);
        }
      };
    }
    report = this->solveSteady(source.data(), field.data(), how);
    active = this->A.activeSize;
    iterations += report.iterations;
    spent += report.fineApplications * static_cast<double>(active) / static_cast<double>(size);
    bytes = std::max(bytes,
      report.bytes +
        active *
          static_cast<std::int64_t>(
            2 * sizeof(T) + sizeof(Q) + sizeof(double) + sizeof(float) + 1));
    const double fraction = static_cast<double>(active) / static_cast<double>(size);
    if (report.reason == StopReason::NoSteadyState || report.reason == StopReason::NotFinite ||
      report.reason == StopReason::Diverged)
    {
      darken();
      return wholeVolume(); // it tells why, or does without the coarse grids of a region
    }
    publish(field.data());
    if (report.reason == StopReason::Cancelled ||
      (report.reason == StopReason::Breakdown && complete))
    {
      return finish(fraction);
    }
    // 3. what stands at its rim
    const auto rim = region.learn(phi, round < 3); // then it only grows: there is an end
    report.leaked = rim.leaked;
    // Measured: regions become two or three times what is expected early on.
    const bool large = rim.expected > 0.4 * quarter;
    if (large && !complete && !late)
    {
      return wholeVolume();
    }
    const std::int64_t before = region.size();
    const std::int64_t next = std::max(first, region.lit());
    std::int64_t most = next;
    if (!complete && !late)
    {
      // as far as it may, where another rough solve is out of the question
      const double round = FrontCost * static_cast<double>(next) +
        RoughCost * static_cast<double>(active + next) + RoundCost;
      most = searched + round > mostSearch ? affordable() : next;
    }
    const bool ended = advance(most, 0);
    if ((complete && !region.grown()) || late)
    {
      // Light that decays slowly, or not at all, may leave through a rim that looks dark.
      const double magnitude = this->box.voxelVolume() *
        SumEachRow(this->A, this->parallelFor,
          [&](std::int64_t, std::int64_t o, int n)
          {
            double sum = 0.;
            for (std::int64_t i = o; i < o + n; ++i)
            {
              sum += std::abs(static_cast<double>(source[i]));
            }
            return sum;
          });
      if (!late && std::abs(report.leaked) > MostLeaked * magnitude)
      {
        return wholeVolume();
      }
      this->addCut(rim.missing, rim.beyond, field.data(), report);
      if (!complete || region.grown())
      {
        report.estimatedError = std::max(1., report.estimatedError); // light had yet to get there
      }
      spent += report.estimatedError < 0. ? 0. : (1. + 2. * this->multigrid.sweeps) * fraction;
      return finish(fraction);
    }
    if (large || (!ended && most != next))
    {
      return wholeVolume();
    }
    // rows of the last operator do for a region that is hardly smaller
    rebuild = region.grown() || 4 * before < 3 * active;
    complete = ended || !region.grown();
  }
}

//------------------------------------------------------------------------------
template <class T>
DiffusionReport DiffusionSolver::stepImplicit(
  const T* q, double* phi, int steps, double cdt, const DiffusionControl& control)
{
  DiffusionReport report = this->interruptible(control.progress,
    [&](DiffusionReport& inner) { this->implicit(q, phi, steps, cdt, control, inner); });
  this->setShift(0.);
  return report;
}

template <class T>
void DiffusionSolver::implicit(const T* q, double* phi, int steps, double cdt,
  const DiffusionControl& control, DiffusionReport& report)
{
  const std::int64_t size = this->box.size();
  // SDIRK2 is two backward Euler steps of length gamma c dt, the second from where the slope of
  // the first leads.
  const int stages = control.implicitScheme == ImplicitScheme::SecondOrder ? 2 : 1;
  const double gamma = stages == 2 ? 1. - std::sqrt(0.5) : 1.;
  const double shifted = 1. / (gamma * cdt * this->scale);
  if (!std::isfinite(cdt) || !(cdt > 0.) || !std::isfinite(shifted) || shifted > 1e30)
  {
    report.message = "the time step c dt is not a positive length";
    return;
  }
  if (!this->startsInside(q, report))
  {
    return;
  }
  if (this->isConstant && steps > 0)
  {
    RightHandSide<T> exact{ q, 1. / this->scale, false };
    this->measure(exact);
    const ConstantMedium::Steps all{ steps, shifted, stages == 2 ? (1. - gamma) / gamma : 0. };
    this->marchConstant(exact, phi, all, control, report);
    this->balance(q, phi, report);
    return;
  }
  RightHandSide<T> steady{ q, 1. / this->scale, true };
  this->measure(steady);
  const double qNorm = steady.norm;
  this->setShift(shifted);
  Buffer<double> previous(size);
  report.reason = StopReason::MaxIterations;
  const std::int64_t solves = static_cast<std::int64_t>(stages) * steps;
  DiffusionControl sharper = control;
  sharper.targetError = sharper.timeBudget = 0.; // of a steady answer, not of a step
  sharper.intermediate = nullptr;
  Showing show(control);
  for (std::int64_t solve = 0; solve < solves; ++solve)
  {
    const double ahead = solve % stages == 0 ? 1. : (1. - gamma) / gamma;
    ForRows(this->parallelFor, size, size,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t i = begin; i < end; ++i)
        {
          previous[i] = ahead == 1. ? phi[i] : previous[i] + ahead * (phi[i] - previous[i]);
        }
      });
    RightHandSide<T> b{ q, 1. / this->scale, true, 0., previous.data(), this->A.s.data(),
      this->sinkWithoutShift.data() };
    this->measure(b);
    const double part = 1. / static_cast<double>(solves);
    try
    {
      this->conjugateGradients(b, phi, sharper, static_cast<double>(solve) * part,
        static_cast<double>(solve + 1) * part, report);
    }
    catch (const Interrupted&)
    {
      report.residual = -1.;
      report.message = "cancelled amid a step; the field is between two";
      if (solve % stages == 0)
      {
        ForRows(this->parallelFor.whole(), size, size,
          [&](std::int64_t begin, std::int64_t end)
          { std::copy(previous.data() + begin, previous.data() + end, phi + begin); });
        report.message = "cancelled amid a step; the field is that before it";
      }
      throw;
    }
    if (report.reason != StopReason::Converged)
    {
      if (report.reason == StopReason::NotFinite && solve % stages == 0)
      {
        report.message = "a value is not finite; the field is that before the step";
        ForRows(this->parallelFor.whole(), size, size,
          [&](std::int64_t begin, std::int64_t end)
          { std::copy(previous.data() + begin, previous.data() + end, phi + begin); });
      }
      if (report.reason == StopReason::MaxIterations) // else the reason of steps that are all made
      {
        std::ostringstream text;
        text << "the linear solver of step " << solve / stages + 1 << " of " << steps
             << " used up its iterations: the field is of a time before";
        report.reason = StopReason::Breakdown;
        report.message = text.str();
      }
      break;
    }
    report.reason = StopReason::MaxIterations;
    if ((solve + 1) % stages != 0)
    {
      continue;
    }
    show(phi);
    // b - A phi of the steady equation is shift (phi - previous), up to this solve's tolerance
    const double change = shifted *
      std::sqrt(SumRows(this->parallelFor, this->rows(), size,
        [&](std::int64_t r)
        {
          double sum = 0.;
          for (std::int64_t i = r * this->box.dims[0]; i < (r + 1) * this->box.dims[0]; ++i)
          {
            sum += (phi[i] - previous[i]) * (phi[i] - previous[i]);
          }
          return sum;
        }));
    if (change <= control.tolerance * qNorm)
    {
      std::swap(this->A.s, this->sinkWithoutShift);
      const double last = this->residual<T>(steady, phi, nullptr, 1.);
      std::swap(this->A.s, this->sinkWithoutShift);
      report.fineApplications += 1.;
      if (last <= control.tolerance * qNorm)
      {
        report.reason = StopReason::Converged;
        break;
      }
      // What is left is the solves' own error: |b| of a step may be far above |q|.
      sharper.tolerance =
        std::max(1e-14, sharper.tolerance * 0.3 * control.tolerance * qNorm / last);
    }
  }
  report.bytes += previous.bytes();
  this->setShift(0.);
  const double last = this->residual<T>(steady, phi, nullptr, 1.);
  report.residual = qNorm > 0. ? last / qNorm : last;
  this->balance(q, phi, report);
}

template <class T>
void DiffusionSolver::marchConstant(const RightHandSide<T>& b, double* phi,
  const ConstantMedium::Steps& steps, const DiffusionControl& control, DiffusionReport& report)
{
  Showing show(control);
  this->parallelFor.tell(0.);
  const double bNorm = b.norm;
  const double goal = control.tolerance * bNorm;
  const bool dark = this->isZero(phi);
  double rNorm = dark || !std::isfinite(bNorm) ? bNorm : this->residual<T>(b, phi, nullptr, 1.);
  report.fineApplications += dark ? 0. : 1.;
  const auto stop = [&](StopReason reason, const char* message)
  {
    report.residual = bNorm > 0. ? rNorm / bNorm : rNorm;
    report.reason = reason;
    report.message = message;
  };
  if (!std::isfinite(rNorm))
  {
    stop(StopReason::NotFinite,
      std::isfinite(bNorm) ? "the field to start from is not finite" : "the source is not finite");
    return;
  }
  if (rNorm <= goal)
  {
    stop(StopReason::Converged, "");
    return;
  }
  const double growth = this->constant.growth(steps);
  Buffer<double> x(this->box.size());
  report.bytes = std::max(report.bytes, this->bytesHeld() + 2 * x.bytes()); // and phi
  for (;;)
  {
    if (report.iterations >= control.maxIterations)
    {
      stop(StopReason::Breakdown, "the steps have used up their iterations");
      return;
    }
    if (!(rNorm < 1e300 / std::max(growth, 1.)))
    {
      stop(StopReason::NotFinite, "the field grows beyond what double precision holds");
      return;
    }
    // 1. x = what the steps add
    this->residualOfConstant(b, dark && report.iterations == 0 ? nullptr : phi, x.data());
    double rest = 0.;
    this->constant.march(
      x.data(), steps, this->parallelFor,
      [&](double done)
      {
        this->parallelFor.tell(done);
        if (control.progress && !control.progress(done))
        {
          throw Interrupted();
        }
        return true;
      },
      rest);
    Touch(phi, this->box.size(), this->parallelFor);
    // 2. phi += x
    this->add(1., x.data(), phi);
    const double last = rNorm;
    rNorm = this->residual<T>(b, phi, nullptr, 1.);
    report.fineApplications += 1.;
    ++report.iterations;
    if (!std::isfinite(rNorm))
    {
      stop(StopReason::NotFinite, "");
      return;
    }
    show(phi);
    if (rNorm <= goal)
    {
      stop(StopReason::Converged, "");
      return;
    }
    if (rest > 0.5 * goal)
    {
      stop(StopReason::MaxIterations, ""); // all steps are made
      return;
    }
    // 3. The steps end in the steady state, but for rounding: as many again take that away.
    if (report.iterations > 1 && rNorm > 0.5 * last)
    {
      if (rNorm > last)
      {
        this->add(-1., x.data(), phi);
        rNorm = last;
      }
      stop(StopReason::Breakdown, "the tolerance is below what double precision reaches here");
      return;
    }
    stop(StopReason::MaxIterations, ""); // where it is cancelled
  }
}

//------------------------------------------------------------------------------
template <class T>
void DiffusionSolver::keepSign(
  const RightHandSide<T>& b, double* phi, const DiffusionControl& control, DiffusionReport& report)
{
  // Where the matrix ties voxels weakly, a small residual says little of their signs.
  if (report.reason == StopReason::Cancelled || report.reason == StopReason::NotFinite)
  {
    return;
  }
  const int sign = b.sign;
  for (int again = 0; sign != 0; ++again)
  {
    struct Signs
    {
      double least = 0., most = 0.;
    };
    std::vector<Signs> rowSigns(static_cast<std::size_t>(this->rows()));
    ForEachRow(this->A, this->parallelFor,
      [&](std::int64_t row, std::int64_t o, int n)
      {
        Signs& signs = rowSigns[static_cast<std::size_t>(row)];
        extremes(n, phi + o, signs.least, signs.most);
      });
    Signs all;
    for (const Signs& signs : rowSigns)
    {
      all.least = std::min(all.least, signs.least);
      all.most = std::max(all.most, signs.most);
    }
    const double allowed = std::min(control.tolerance, Unseen);
    const bool kept =
      sign > 0 ? -all.least <= allowed * all.most : all.most <= allowed * -all.least;
    if (kept)
    {
      return;
    }
    ForEachRow(this->A, this->parallelFor,
      [&](std::int64_t, std::int64_t o, int n)
      {
        for (std::int64_t i = o; i < o + n; ++i)
        {
          phi[i] = sign > 0 ? std::max(phi[i], 0.) : std::min(phi[i], 0.);
        }
      });
    if (report.reason != StopReason::Converged || control.targetError > 0. || again == 3)
    {
      // The best answer so far, or (0 is nearer to the exact one) all that a named error asks for.
      report.residual = this->residual<T>(b, phi, nullptr, 1.) / b.norm;
      report.fineApplications += 1.;
      if (report.reason == StopReason::Converged && report.residual > control.tolerance &&
        !(control.targetError > 0.))
      {
        report.reason = StopReason::Breakdown;
        report.message = "the answer keeps a wrong sign, or does not meet the tolerance without";
      }
      return;
    }
    if (this->isConstant)
    {
      this->solveConstant(b, phi, control, report);
    }
    else
    {
      this->conjugateGradients(b, phi, control, 1., 1., report);
    }
    if (report.reason == StopReason::Cancelled || report.reason == StopReason::NotFinite)
    {
      return;
    }
  }
}

//------------------------------------------------------------------------------
std::string DiffusionSolver::badStep(double cdt) const
{
  // The margin is rounding's: the bound itself is allowed.
  if (std::isfinite(cdt) && cdt > 0. && cdt <= this->stabilityBound() * (1. + 1e-6))
  {
    return {};
  }
  std::ostringstream text;
  text << "the explicit step c dt = " << cdt << " is unstable; expected in (0, "
       << this->stabilityBound() << "] (length; positive fields stay positive up to "
       << this->positivityBound() << ")";
  return text.str();
}

template <class T>
DiffusionReport DiffusionSolver::stepExplicit(
  const T* q, SteppedField phi, int steps, double cdt, const DiffusionControl& control)
{
  return this->march(q, phi, steps, cdt, false, control);
}

template <class T>
DiffusionReport DiffusionSolver::stepLocal(
  const T* q, SteppedField phi, int steps, double courant, const DiffusionControl& control)
{
  return this->march(q, phi, steps, courant, true, control);
}

template <class T>
DiffusionReport DiffusionSolver::march(const T* q, SteppedField field, int steps, double length,
  bool local, const DiffusionControl& control)
{
  Buffer<double> other;
  double* fields[2] = { field.values, nullptr };
  int at = 0; // the field that phi's last state is in
  const auto keep = [&]
  {
    if (at == 1 && field.buffer)
    {
      std::swap(*field.buffer, other);
      field.values = field.buffer->data();
    }
    else if (at == 1)
    {
      ForRows(this->parallelFor.whole(), this->box.size(), this->box.size(),
        [&](std::int64_t begin, std::int64_t end)
        { std::copy(fields[1] + begin, fields[1] + end, field.values + begin); });
    }
    at = 0;
  };
  DiffusionReport all = this->interruptible(control.progress,
    [&](DiffusionReport& report)
    {
      if (local && !(length > 0. && length <= 1.))
      {
        std::ostringstream text;
        text << "the fraction of the local step is " << length << "; expected in (0, 1]";
        report.message = text.str();
        return;
      }
      report.message = local ? std::string() : this->badStep(length);
      bool singular = false;
      std::vector<std::uint8_t> reached;
      std::vector<ClosedPart> closed;
      if (!report.message.empty() || !this->startsInside(q, report) ||
        (local && q && !this->steadyStateExists(q, singular, reached, closed, report)))
      {
        return;
      }
      this->parallelFor.tell(0.);
      const std::int64_t size = this->box.size();
      const int nx = this->box.dims[0];
      this->storeFaces();
      this->setShift(0.);
      RightHandSide<T> b{ q, 1. / this->scale, true };
      this->measure(b);
      const double qNorm = b.norm;
      other.allocate(size);
      fields[1] = other.data();
      Touch(field.values, size, this->parallelFor);
      Touch(other.data(), size, this->parallelFor);
      report.bytes =
        this->bytesHeld() + other.bytes() + size * static_cast<std::int64_t>(sizeof(double));
      const double step = local ? length : length * this->scale;
      Showing show(control);
      // What does not fit the cache goes several steps in one pass over the memory. Nobody is asked
      // between these; where somebody is there to be asked they must not last.
      const int inOnePass = size < SeveralStepsFrom ? 1
        : !control.progress
        ? StepsInOnePass
        : static_cast<int>(std::clamp<std::int64_t>(AskedAfter / size, 1, StepsInOnePass));
      const std::size_t rowCount = static_cast<std::size_t>(this->rows());
      std::vector<double> squares(StepsInOnePass * rowCount);
      report.reason = StopReason::MaxIterations;
      while (report.iterations < steps)
      {
        const int stages = std::min(inOnePass, steps - report.iterations);
        const auto advance = [&](int stage, std::int64_t r)
        {
          const double* from = fields[(at + stage) % 2];
          double* to = fields[(at + stage + 1) % 2];
          DoubleRow row = doubleRow(this->A, from, r, r * nx, nx);
          static thread_local std::vector<double> room;
          room.resize(2 * static_cast<std::size_t>(nx) + 2);
          if (r == 0 || r + 1 == this->rows())
          {
            // the kernel reads one value more on either side than the caller has
            double* own = room.data() + nx + 1;
            std::copy(row.x, row.x + nx, own);
            own[-1] = own[nx] = 0.;
            row.x = own;
          }
          if (local)
          {
            localSteps(row, step, room.data());
          }
          squares[static_cast<std::size_t>(stage) * rowCount + static_cast<std::size_t>(r)] =
            explicitRow(row, q ? q + r * nx : nullptr, b.qScale, b.mean, step,
              local ? room.data() : nullptr, to + r * nx);
        };
        if (stages == 1)
        {
          // Who cancels does not wait for the step, which is dropped.
          ForRows(this->parallelFor, this->rows(), size,
            [&](std::int64_t begin, std::int64_t end)
            {
              for (std::int64_t r = begin; r < end; ++r)
              {
                advance(0, r);
              }
            });
        }
        else
        {
          ForEachStage(this->A, stages, this->parallelFor.whole(), advance);
        }
        at = (at + stages) % 2;
        report.iterations += stages;
        report.fineApplications += stages;
        double sum = 0.;
        for (std::size_t r = 0; r < rowCount; ++r)
        {
          sum += squares[static_cast<std::size_t>(stages - 1) * rowCount + r];
        }
        const double rNorm = std::sqrt(sum); // of what the last step began with
        report.residual = qNorm > 0. ? rNorm / qNorm : rNorm;
        if (!std::isfinite(rNorm))
        {
          report.reason = StopReason::NotFinite;
          break;
        }
        if (qNorm > 0. && rNorm <= control.tolerance * qNorm)
        {
          report.reason = StopReason::Converged;
          break;
        }
        show(fields[at]);
        const double fraction = static_cast<double>(report.iterations) / static_cast<double>(steps);
        this->parallelFor.tell(fraction);
        if (control.progress && !control.progress(fraction))
        {
          throw Interrupted();
        }
      }
      keep();
      const double last = this->residual<T>(b, field.values, nullptr, 1.);
      report.residual = qNorm > 0. ? last / qNorm : last;
      this->balance(q, field.values, report);
    });
  keep(); // where it was cancelled
  return all;
}

//------------------------------------------------------------------------------
template <class T>
bool DiffusionSolver::flux(const double* phi, T* E, const ProgressFunction& progress) const
{
  const WatchedFor::Asking asking(this->parallelFor, progress);
  const std::array<int, 3>& m = this->volume.dims;
  const std::int64_t stride[3] = { 1, m[0], static_cast<std::int64_t>(m[0]) * m[1] };
  const std::array<int, 3>& n = this->box.dims;
  const std::int64_t step[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  // g = D_f / (h^2 scale): the face's flux is g h scale (phi - phi_next).
  if (!this->A.spans.empty())
  {
    std::fill(E, E + 3 * this->volume.size(), T(0));
  }
  const auto write = [&]
  {
    this->forRegion(this->parallelFor,
      [&](std::int64_t to, std::int64_t o, int length)
      {
        const std::int64_t row = o / n[0];
        int at[3] = { 0, static_cast<int>(row % n[1]), static_cast<int>(row / n[1]) };
        for (int x = 0; x < length; ++x)
        {
          // the voxel in the box and in the volume
          const std::int64_t b = o + x;
          const std::int64_t i = to + x;
          at[0] = static_cast<int>(b % n[0]);
          for (int d = 0; d < 3; ++d)
          {
            double low = 0.;
            double high = 0.;
            if (at[d] > 0)
            {
              low = this->face(d, b - step[d]) * (phi[i - stride[d]] - phi[i]);
            }
            else if (!this->border[d][0].empty())
            {
              low = -static_cast<double>(
                      this->border[d][0][static_cast<std::size_t>(this->borderIndex(d, at))]) *
                phi[i];
            }
            if (at[d] + 1 < n[d])
            {
              high = this->face(d, b) * (phi[i] - phi[i + stride[d]]);
            }
            else if (!this->border[d][1].empty())
            {
              high = static_cast<double>(
                       this->border[d][1][static_cast<std::size_t>(this->borderIndex(d, at))]) *
                phi[i];
            }
            E[3 * i + d] = static_cast<T>(0.5 * (low + high) * this->box.spacing[d] * this->scale);
          }
        }
      });
  };
  try
  {
    write();
  }
  catch (const Interrupted&)
  {
    return false;
  }
  return true;
}

//------------------------------------------------------------------------------
#define LIGHTTRANSPORT_INSTANTIATE(T)                                                              \
  template DiffusionReport DiffusionSolver::setMedium<T>(                                          \
    const DiffusionMedium<T>&, const ProgressFunction&);                                           \
  template DiffusionReport DiffusionSolver::solveActive<T, float>(                                 \
    const DiffusionMedium<T>&, const float*, double*, const DiffusionControl&, double);            \
  template DiffusionReport DiffusionSolver::solveActive<T, double>(                                \
    const DiffusionMedium<T>&, const double*, double*, const DiffusionControl&, double);           \
  template DiffusionReport DiffusionSolver::solveSteady<T>(                                        \
    const T*, double*, const DiffusionControl&);                                                   \
  template DiffusionReport DiffusionSolver::stepExplicit<T>(                                       \
    const T*, SteppedField, int, double, const DiffusionControl&);                                 \
  template DiffusionReport DiffusionSolver::stepLocal<T>(                                          \
    const T*, SteppedField, int, double, const DiffusionControl&);                                 \
  template DiffusionReport DiffusionSolver::stepImplicit<T>(                                       \
    const T*, double*, int, double, const DiffusionControl&);                                      \
  template bool DiffusionSolver::flux<T>(const double*, T*, const ProgressFunction&) const;
LIGHTTRANSPORT_INSTANTIATE(float)
LIGHTTRANSPORT_INSTANTIATE(double)
#undef LIGHTTRANSPORT_INSTANTIATE
} // namespace lighttransport
