// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/ConstantMedium.h"

#include "Core/Kernel.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace lighttransport
{
namespace
{
/** The product's rows and columns that stand in registers. */
constexpr int BlockRows = 4;
constexpr int Block = 16;
/** Columns that stay in the cache while they are transformed; of whole blocks. */
constexpr int Columns = 64;
/** Rows along x at a time. */
constexpr int Rows = 32;
/** Beyond this the matrices alone are large. */
constexpr int LongestAxis = 1024;

int padded(int n, int block = Block)
{
  return (n + block - 1) / block * block;
}

/** C = A B of m x k and k x n values; m and n are multiples of the block's. */
LIGHTTRANSPORT_SIMD
void multiply(int m, int n, int k, const double* A, std::int64_t pitchA, const double* B,
  std::int64_t pitchB, double* C, std::int64_t pitchC)
{
  for (int j = 0; j < n; j += Block)
  {
    for (int i = 0; i < m; i += BlockRows)
    {
      double sum[BlockRows][Block] = {};
      const double* a0 = A + i * pitchA;
      const double* a1 = a0 + pitchA;
      const double* a2 = a1 + pitchA;
      const double* a3 = a2 + pitchA;
      const double* b = B + j;
      for (int l = 0; l < k; ++l, b += pitchB)
      {
        for (int c = 0; c < Block; ++c)
        {
          sum[0][c] += a0[l] * b[c];
          sum[1][c] += a1[l] * b[c];
          sum[2][c] += a2[l] * b[c];
          sum[3][c] += a3[l] * b[c];
        }
      }
      for (int r = 0; r < BlockRows; ++r)
      {
        std::copy(sum[r], sum[r] + Block, C + (i + r) * pitchC + j);
      }
    }
  }
}

/** even = low + high, odd = low - high; the other way round the same, without a factor. */
LIGHTTRANSPORT_SIMD
void fold(int n, const double* LIGHTTRANSPORT_RESTRICT low,
  const double* LIGHTTRANSPORT_RESTRICT high, double* LIGHTTRANSPORT_RESTRICT even,
  double* LIGHTTRANSPORT_RESTRICT odd)
{
  for (int i = 0; i < n; ++i)
  {
    even[i] = low[i] + high[i];
    odd[i] = low[i] - high[i];
  }
}

/** x /= base + eigenvalue, 0 where that is 0 */
LIGHTTRANSPORT_SIMD
void divide(int n, const double* LIGHTTRANSPORT_RESTRICT base, double eigenvalue,
  double* LIGHTTRANSPORT_RESTRICT x)
{
  for (int i = 0; i < n; ++i)
  {
    const double d = base[i] + eigenvalue;
    x[i] = d > 0. ? x[i] / d : 0.;
  }
}

/** x *= S_N of the eigenvalue base + eigenvalue; answers the sum of squares of R^N x */
LIGHTTRANSPORT_SIMD
double stepOn(int n, const double* LIGHTTRANSPORT_RESTRICT base, double eigenvalue,
  const ConstantMedium::Steps& steps, double* LIGHTTRANSPORT_RESTRICT x)
{
  double R[Columns], first[Columns], power[Columns], sum[Columns];
  for (int i = 0; i < n; ++i)
  {
    const double lambda = base[i] + eigenvalue;
    const double inverse = 1. / (lambda + steps.shift);
    const double rho = steps.shift * inverse;
    R[i] = rho * (1. - steps.ahead * lambda * inverse);
    first[i] = (1. + steps.ahead * rho) * inverse;
    power[i] = 1.;
    sum[i] = 0.;
  }
  std::int64_t bit = 1;
  while (bit <= steps.count / 2)
  {
    bit *= 2;
  }
  for (; bit > 0; bit /= 2)
  {
    for (int i = 0; i < n; ++i)
    {
      sum[i] *= 1. + power[i];
      power[i] *= power[i];
    }
    for (int i = 0; steps.count & bit && i < n; ++i)
    {
      sum[i] = sum[i] * R[i] + first[i];
      power[i] *= R[i];
    }
  }
  double squares = 0.;
  for (int i = 0; i < n; ++i)
  {
    const double rest = power[i] * x[i];
    squares += rest * rest;
    x[i] *= sum[i];
  }
  return squares;
}

/**
 * The wave number of mode k: v_j = cos or sin(theta (j - (n-1)/2)) continued by one voxel is
 * (1 - kappa) times its last value. The sums of cosines and sines that this gives are written as
 * products, so that small wave numbers are exact as well; they change sign in the bracket.
 */
double waveNumber(int k, int n, double kappa)
{
  const double pi = std::acos(-1.);
  double low = pi * k / n;
  double high = pi * (k + 1) / n;
  if (kappa <= 0.)
  {
    return low;
  }
  const bool even = k % 2 == 0;
  const auto positive = [&](double theta)
  {
    const double inner = 0.5 * theta * (n - 1);
    const double outer = 0.5 * theta * n;
    const double step = 2. * std::sin(0.5 * theta);
    const double value = even ? kappa * std::cos(inner) - step * std::sin(outer)
                              : kappa * std::sin(inner) + step * std::cos(outer);
    return value > 0.;
  };
  const bool atLow = k / 2 % 2 == 0;
  for (int i = 0; i < 200; ++i)
  {
    const double middle = 0.5 * (low + high);
    if (!(middle > low && middle < high))
    {
      break;
    }
    (positive(middle) == atLow ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/** Room for two halves of lines before and after a product, and for a row beside. */
struct Room
{
  double *in, *out, *row;
  explicit Room(std::size_t size)
  {
    static thread_local std::vector<double> store;
    if (store.size() < 2 * size + Columns)
    {
      store.resize(2 * size + Columns);
    }
    this->in = store.data();
    this->out = this->in + size;
    this->row = this->out + size;
  }
};
} // namespace

//------------------------------------------------------------------------------
bool ConstantMedium::suits(const Grid& grid)
{
  // Operations per voxel, or what columns that do not fill a block take the time of.
  // Iterations cost the same per voxel at any size; with AVX2 as much as this at 512 x 512 x 512.
  constexpr double most = 3072.;
  double work = 0.;
  double inner = 0.;
  for (int d = 0; d < 3; ++d)
  {
    const int n = grid.dims[d];
    if (n == 1)
    {
      continue;
    }
    if (n > LongestAxis)
    {
      return false;
    }
    const double columns = inner > 0. ? inner : 0.5 * n;
    work += 2. * n * std::max(1., Block / columns);
    inner = std::max(inner, 1.) * n;
  }
  return work <= most;
}

void ConstantMedium::setup(
  const Grid& grid, double D, double sigma, const std::array<double, 3>& border)
{
  this->sigma_a = sigma;
  this->axes = {};
  std::size_t next = 0;
  for (int d = 0; d < 3; ++d)
  {
    if (grid.dims[d] == 1)
    {
      continue;
    }
    Axis& axis = this->axes[next++];
    const int n = grid.dims[d];
    const double h = grid.spacing[d];
    const double kappa = std::min(2., border[d] * h * h);
    axis.n = n;
    axis.eigenvalues.assign(static_cast<std::size_t>(n), 0.);
    for (std::size_t parity = 0; parity < 2; ++parity)
    {
      Axis::Half& half = axis.half[parity];
      half.count = parity == 0 ? (n + 1) / 2 : n / 2;
      half.padded = padded(half.count);
      const std::size_t pitch = static_cast<std::size_t>(half.padded);
      half.modes.assign(pitch * pitch, 0.);
      half.transposed.assign(pitch * pitch, 0.);
      for (int m = 0; m < half.count; ++m)
      {
        const double theta = waveNumber(2 * m + static_cast<int>(parity), n, kappa);
        const double root = 2. * std::sin(0.5 * theta) / h;
        axis.eigenvalues[static_cast<std::size_t>(parity == 0 ? m : (n + 1) / 2 + m)] =
          D * root * root;
        double* mode = half.modes.data() + static_cast<std::size_t>(m) * pitch;
        double norm = 0.;
        for (int j = 0; j < half.count; ++j)
        {
          const double at = theta * (j - 0.5 * (n - 1));
          mode[j] = parity == 0 ? std::cos(at) : std::sin(at);
          norm += (2 * j + 1 == n ? 1. : 2.) * mode[j] * mode[j];
        }
        for (int j = 0; j < half.count; ++j)
        {
          mode[j] /= std::sqrt(norm);
          half.transposed[static_cast<std::size_t>(j) * pitch + static_cast<std::size_t>(m)] =
            mode[j];
        }
      }
    }
  }
  if (next == 0) // one voxel
  {
    this->axes[0].eigenvalues.assign(1, 0.);
  }
}

void ConstantMedium::release()
{
  this->axes = {};
}

std::int64_t ConstantMedium::bytes() const
{
  std::size_t values = 0;
  for (const Axis& axis : this->axes)
  {
    values += axis.eigenvalues.size();
    for (const Axis::Half& half : axis.half)
    {
      values += half.modes.size() + half.transposed.size();
    }
  }
  return static_cast<std::int64_t>(values * sizeof(double));
}

void ConstantMedium::alongRows(const Axis& axis, double* x, std::int64_t rows, bool forward) const
{
  const int n = axis.n;
  const Axis::Half& even = axis.half[0];
  const Axis::Half& odd = axis.half[1];
  const std::int64_t pitch = static_cast<std::int64_t>(axis.rows());
  const Room room(axis.rows() * Rows);
  for (std::int64_t first = 0; first < rows; first += Rows)
  {
    const int count = static_cast<int>(std::min<std::int64_t>(Rows, rows - first));
    const int all = padded(count, BlockRows);
    std::fill(room.in + count * pitch, room.in + all * pitch, 0.);
    for (int r = 0; r < count; ++r)
    {
      const double* f = x + (first + r) * n;
      double* e = room.in + r * pitch;
      double* o = e + even.padded;
      for (int j = 0; j < even.count; ++j)
      {
        e[j] = !forward ? f[j] : 2 * j + 1 == n ? f[j] : f[j] + f[n - 1 - j];
      }
      for (int j = 0; j < odd.count; ++j)
      {
        o[j] = forward ? f[j] - f[n - 1 - j] : f[even.count + j];
      }
    }
    for (const Axis::Half* half : { &even, &odd })
    {
      const std::int64_t shift = half == &odd ? even.padded : 0;
      multiply(all, half->padded, half->count, room.in + shift, pitch,
        (forward ? half->transposed : half->modes).data(), half->padded, room.out + shift, pitch);
    }
    for (int r = 0; r < count; ++r)
    {
      double* f = x + (first + r) * n;
      const double* e = room.out + r * pitch;
      const double* o = e + even.padded;
      for (int j = 0; j < even.count; ++j)
      {
        f[j] = e[j];
      }
      for (int j = 0; j < odd.count; ++j)
      {
        if (forward)
        {
          f[even.count + j] = o[j];
        }
        else
        {
          f[n - 1 - j] = e[j] - o[j];
          f[j] = e[j] + o[j];
        }
      }
    }
  }
}

// A block of columns stands in rows of `Columns` values, the even half's before the odd one's; what
// lies beyond its last column is 0.

void ConstantMedium::toHalves(
  const Axis& axis, const double* x, std::int64_t stride, int columns, double* to) const
{
  const Axis::Half& even = axis.half[0];
  const Axis::Half& odd = axis.half[1];
  double* o = to + even.padded * Columns;
  for (int j = 0; j < odd.count; ++j)
  {
    fold(columns, x + j * stride, x + (axis.n - 1 - j) * stride, to + j * Columns, o + j * Columns);
    std::fill(to + j * Columns + columns, to + j * Columns + padded(columns), 0.);
    std::fill(o + j * Columns + columns, o + j * Columns + padded(columns), 0.);
  }
  if (odd.count < even.count)
  {
    const double* middle = x + odd.count * stride;
    double* last = to + odd.count * Columns;
    std::copy(middle, middle + columns, last);
    std::fill(last + columns, last + padded(columns), 0.);
  }
}

void ConstantMedium::fromHalves(
  const Axis& axis, const double* from, int columns, double* x, std::int64_t stride) const
{
  const Axis::Half& even = axis.half[0];
  const Axis::Half& odd = axis.half[1];
  const double* o = from + even.padded * Columns;
  for (int j = 0; j < odd.count; ++j)
  {
    fold(
      columns, from + j * Columns, o + j * Columns, x + j * stride, x + (axis.n - 1 - j) * stride);
  }
  if (odd.count < even.count)
  {
    const double* middle = from + odd.count * Columns;
    std::copy(middle, middle + columns, x + odd.count * stride);
  }
}

void ConstantMedium::transform(
  const Axis& axis, const double* in, int columns, bool forward, double* out) const
{
  std::int64_t shift = 0;
  for (const Axis::Half& half : axis.half)
  {
    multiply(padded(half.count, BlockRows), padded(columns), half.count,
      (forward ? half.modes : half.transposed).data(), half.padded, in + shift, Columns,
      out + shift, Columns);
    shift += static_cast<std::int64_t>(half.padded) * Columns;
  }
}

void ConstantMedium::alongColumns(
  const Axis& axis, double* x, std::int64_t stride, bool forward) const
{
  const Room room(axis.rows() * Columns);
  const Axis::Half& even = axis.half[0];
  for (std::int64_t first = 0; first < stride; first += Columns)
  {
    const int columns = static_cast<int>(std::min<std::int64_t>(Columns, stride - first));
    double* at = x + first;
    // modes stand where voxels do, even ones first
    const auto row = [&](double* halves, int m)
    { return halves + (m < even.count ? m : even.padded + m - even.count) * Columns; };
    if (forward)
    {
      this->toHalves(axis, at, stride, columns, room.in);
      this->transform(axis, room.in, columns, true, room.out);
      for (int m = 0; m < axis.n; ++m)
      {
        std::copy(row(room.out, m), row(room.out, m) + columns, at + m * stride);
      }
    }
    else
    {
      for (int m = 0; m < axis.n; ++m)
      {
        double* line = row(room.in, m);
        std::copy(at + m * stride, at + m * stride + columns, line);
        std::fill(line + columns, line + padded(columns), 0.);
      }
      this->transform(axis, room.in, columns, false, room.out);
      this->fromHalves(axis, room.out, columns, at, stride);
    }
  }
}

double ConstantMedium::throughPlanes(
  double* x, const Steps* steps, std::int64_t first, int columns) const
{
  double squares = 0.;
  const auto scale = [&](const double* base, double eigenvalue, double* values)
  {
    if (steps)
    {
      squares += stepOn(columns, base, eigenvalue, *steps, values);
    }
    else
    {
      divide(columns, base, eigenvalue, values);
    }
  };
  const Axis& axis = this->axes[2];
  const int nx = this->axes[0].n;
  const std::int64_t plane = static_cast<std::int64_t>(nx) * this->axes[1].n;
  const Room room(axis.rows() * Columns);
  for (int c = 0; c < columns; ++c)
  {
    const auto value = [](const Axis& a, std::int64_t i)
    { return a.eigenvalues.empty() ? 0. : a.eigenvalues[static_cast<std::size_t>(i)]; };
    room.row[c] = this->sigma_a + value(this->axes[0], (first + c) % nx) +
      value(this->axes[1], (first + c) / nx);
  }
  if (axis.n == 1)
  {
    scale(room.row, 0., x + first);
    return squares;
  }
  this->toHalves(axis, x + first, plane, columns, room.in);
  this->transform(axis, room.in, columns, true, room.out);
  for (int m = 0; m < axis.n; ++m)
  {
    const int even = axis.half[0].count;
    scale(room.row, axis.eigenvalues[static_cast<std::size_t>(m)],
      room.out + (m < even ? m : axis.half[0].padded + m - even) * Columns);
  }
  this->transform(axis, room.out, columns, false, room.in);
  this->fromHalves(axis, room.in, columns, x + first, plane);
  return squares;
}

double ConstantMedium::growth(const Steps& steps) const
{
  double least = this->sigma_a;
  for (const Axis& axis : this->axes)
  {
    least += axis.eigenvalues.empty()
      ? 0.
      : *std::min_element(axis.eigenvalues.begin(), axis.eigenvalues.end());
  }
  const double diagonal = least + steps.shift;
  if (!(diagonal > 1e-280))
  {
    return std::numeric_limits<double>::infinity(); // as good as
  }
  // (1 + R + ..) S_1 with R <= shift / diagonal
  const double terms = diagonal / std::max(least, 1e-16 * diagonal);
  return std::min(static_cast<double>(steps.count), terms) * (1. + steps.ahead) / diagonal;
}

bool ConstantMedium::solve(double* x, const Steps* steps, const ParallelFor& parallelFor,
  const std::function<bool(double done)>& goOn, double* rest) const
{
  const std::int64_t nx = this->axes[0].n;
  const std::int64_t ny = this->axes[1].n;
  const std::int64_t nz = this->axes[2].n;
  const std::int64_t plane = nx * ny;
  const auto planes = [&](std::int64_t begin, std::int64_t end, bool forward)
  {
    for (std::int64_t k = begin; k < end; ++k)
    {
      double* at = x + k * plane;
      if (!forward && ny > 1)
      {
        this->alongColumns(this->axes[1], at, nx, false);
      }
      if (nx > 1)
      {
        this->alongRows(this->axes[0], at, ny, forward);
      }
      if (forward && ny > 1)
      {
        this->alongColumns(this->axes[1], at, nx, true);
      }
    }
  };
  const std::int64_t tiles = (plane + Columns - 1) / Columns;
  std::vector<double> squares(static_cast<std::size_t>(steps ? tiles : 0));
  const auto columns = [&](std::int64_t begin, std::int64_t end)
  {
    for (std::int64_t t = begin; t < end; ++t)
    {
      const double sum = this->throughPlanes(x, steps, t * Columns,
        static_cast<int>(std::min<std::int64_t>(Columns, plane - t * Columns)));
      if (steps)
      {
        squares[static_cast<std::size_t>(t)] = sum;
      }
    }
  };
  for (int step = 0; step < 3; ++step)
  {
    const std::int64_t count = step == 1 ? tiles : nz;
    // pieces of about a million values
    const std::int64_t piece = std::max<std::int64_t>(
      8, (std::int64_t(1) << 20) / std::max<std::int64_t>(1, plane * nz / count));
    for (std::int64_t from = 0; from < count; from += piece)
    {
      const std::int64_t length = std::min(piece, count - from);
      ForRows(parallelFor, length, length * (plane * nz / count),
        [&](std::int64_t begin, std::int64_t end)
        {
          if (step == 1)
          {
            columns(from + begin, from + end);
          }
          else
          {
            planes(from + begin, from + end, step == 0);
          }
        });
      if (!goOn((step + static_cast<double>(from + length) / static_cast<double>(count)) / 3.))
      {
        return false;
      }
    }
  }
  if (rest)
  {
    *rest = std::sqrt(std::accumulate(squares.begin(), squares.end(), 0.));
  }
  return true;
}
} // namespace lighttransport
