// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Visibility.h"

#include "Core/Buffer.h"
#include "Core/Kernel.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#if defined(__GNUC__) || defined(__clang__)
#define LIGHTTRANSPORT_INLINE inline __attribute__((always_inline))
#else
#define LIGHTTRANSPORT_INLINE inline
#endif

namespace lighttransport
{
namespace
{
constexpr double Pi = 3.14159265358979323846;
constexpr int MaxHarmonics = NumberOfHarmonics(HighestVisibilityOrder);
constexpr int RowsPerTask = 16;

//------------------------------------------------------------------------------
// Kernels over a row of voxels or rays.

/** exp(-t) for t >= 0, to 2e-7; exactly 1 at 0, and a number above 0 however large t is. */
LIGHTTRANSPORT_INLINE float expMinus(float t)
{
  // The lesser of t and 86 by their bits, which order as the numbers do: a comparison of
  // floats could trap, and would keep the compiler from doing several at once.
  std::int32_t bits;
  std::memcpy(&bits, &t, sizeof(bits));
  bits = bits < 0x42ac0000 ? bits : 0x42ac0000;
  float x;
  std::memcpy(&x, &bits, sizeof(x));
  x *= -1.44269504f;
  const int n = static_cast<int>(x - 0.5f); // rounds, as x <= 0
  const float f = x - static_cast<float>(n);
  const float p = 1.f +
    f *
      (0.693147181f +
        f *
          (0.240226507f +
            f *
              (0.0555041087f + f * (0.00961812911f + f * (0.00133335581f + f * 0.000154035304f)))));
  bits = (n + 127) << 23;
  float scale;
  std::memcpy(&scale, &bits, sizeof(scale));
  return p * scale;
}

/** out = (1 - w) a + w b */
LIGHTTRANSPORT_SIMD
void blend(int n, float w, const float* a, const float* b, float* LIGHTTRANSPORT_RESTRICT out)
{
  const float u = 1.f - w;
  for (int i = 0; i < n; ++i)
  {
    out[i] = u * a[i] + w * b[i];
  }
}

/**
 * How much of a ray's step lies within the border, which is `inside` (voxels, negative: beyond)
 * away across the plane, while the ray moves by `slope` per step.
 */
double coverage(double inside, double slope)
{
  const double moved = std::abs(slope);
  return moved > 1e-6 ? std::min(1., std::max(0., inside / moved + 0.5)) : (inside > 0. ? 1. : 0.);
}

/**
 * The n rays of a row cross a plane: `sigma` are n + 1 values, the rays lie a
 * fraction f behind them. U holds the optical depth with a whole step for each
 * plane so far, so that depth = U + step sigma / 2 is the trapezoidal rule's.
 */
LIGHTTRANSPORT_SIMD
void crossPlane(int n, float f, float step, const float* sigma, const float* before,
  float* LIGHTTRANSPORT_RESTRICT U, float* LIGHTTRANSPORT_RESTRICT depth)
{
  const float lower = (1.f - f) * step;
  const float upper = f * step;
  for (int i = 0; i < n; ++i)
  {
    const float s = lower * sigma[i] + upper * sigma[i + 1];
    const float u = before[i];
    depth[i] = u + 0.5f * s;
    U[i] = u + s;
  }
}

/** depth -= (1 - w) a + w b: what lies beyond the radius. */
LIGHTTRANSPORT_SIMD
void forget(int n, float w, const float* a, const float* b, float* LIGHTTRANSPORT_RESTRICT depth)
{
  for (int i = 0; i < n; ++i)
  {
    const float left = depth[i] - ((1.f - w) * a[i] + w * b[i]);
    depth[i] = left > 0.f ? left : 0.f;
  }
}

/**
 * v continued by a part t in [0, 1/2] of the way from `far` to `near`, as a depth would be that
 * grows evenly: near (near / far)^t, the power by its Pade approximant.
 */
LIGHTTRANSPORT_INLINE float continued(float t, float near, float far)
{
  const float half = 0.5f * (near - far);
  const float v = near * (far + (1.f + t) * half) / (far + (1.f - t) * half + 1e-30f);
  return v < 1.f ? v : 1.f;
}

/** v = exp(-depth), then from n + 1 rays to the n voxels between, a fraction f behind. */
LIGHTTRANSPORT_SIMD
void seeRow(int n, float f, const float* depth, float* LIGHTTRANSPORT_RESTRICT e,
  float* LIGHTTRANSPORT_RESTRICT out)
{
  for (int i = 0; i <= n; ++i)
  {
    e[i] = expMinus(depth[i]);
  }
  for (int i = 0; i < n; ++i)
  {
    out[i] = f * e[i] + (1.f - f) * e[i + 1];
  }
  // A ray beyond the border knows nothing of the outermost voxel.
  if (f < 0.5f)
  {
    out[0] = n > 1 ? continued(f, e[1], e[2]) : e[1];
  }
  else if (f > 0.5f)
  {
    out[n - 1] = n > 1 ? continued(1.f - f, e[n - 1], e[n - 2]) : e[0];
  }
}

void continueRow(int n, float t, const float* near, const float* far, float* out)
{
  for (int i = 0; i < n; ++i)
  {
    out[i] = continued(t, near[i], far[i]);
  }
}

LIGHTTRANSPORT_SIMD
void expRow(int n, const float* depth, float* LIGHTTRANSPORT_RESTRICT e)
{
  for (int i = 0; i < n; ++i)
  {
    e[i] = expMinus(depth[i]);
  }
}

/** out[i] = what the table interpolates from `in` */
LIGHTTRANSPORT_SIMD
void gather(int n, const int* LIGHTTRANSPORT_RESTRICT at, const float* LIGHTTRANSPORT_RESTRICT w,
  const float* in, float* LIGHTTRANSPORT_RESTRICT out)
{
  for (int i = 0; i < n; ++i)
  {
    const float a = in[at[i]];
    out[i] = a + w[i] * (in[at[i] + 1] - a);
  }
}

/** As crossPlane, with a step per ray; `first` scales the first step and adds what came before. */
LIGHTTRANSPORT_SIMD
void crossOpening(int n, const float* LIGHTTRANSPORT_RESTRICT step,
  const float* LIGHTTRANSPORT_RESTRICT sigma, float* LIGHTTRANSPORT_RESTRICT U,
  float* LIGHTTRANSPORT_RESTRICT depth)
{
  for (int i = 0; i < n; ++i)
  {
    const float s = step[i] * sigma[i];
    depth[i] = U[i] + 0.5f * s;
    U[i] += s;
  }
}

/** The first plane, `part` of a step behind a place with the extinction `start`. */
LIGHTTRANSPORT_SIMD
void startOpening(int n, float part, float start, const float* LIGHTTRANSPORT_RESTRICT step,
  const float* LIGHTTRANSPORT_RESTRICT sigma, float* LIGHTTRANSPORT_RESTRICT U,
  float* LIGHTTRANSPORT_RESTRICT depth)
{
  for (int i = 0; i < n; ++i)
  {
    depth[i] = 0.5f * part * step[i] * (start + sigma[i]);
    U[i] = depth[i] + 0.5f * step[i] * sigma[i];
  }
}

/** sh[i] (+)= sum_d v_d[i] Y_d, N coefficients side by side. */
template <int N>
LIGHTTRANSPORT_INLINE void projectN(int n, int directions, const float* v, std::ptrdiff_t stride,
  const float* Y, bool add, float* sh, std::ptrdiff_t shStride)
{
  for (int i = 0; i < n; ++i)
  {
    float* LIGHTTRANSPORT_RESTRICT out = sh + i * shStride;
    float sum[N];
    for (int c = 0; c < N; ++c)
    {
      sum[c] = add ? out[c] : 0.f;
    }
    for (int d = 0; d < directions; ++d)
    {
      const float vd = v[d * stride + i];
      for (int c = 0; c < N; ++c)
      {
        sum[c] += vd * Y[d * MaxHarmonics + c];
      }
    }
    for (int c = 0; c < N; ++c)
    {
      out[c] = sum[c];
    }
  }
}

LIGHTTRANSPORT_SIMD
void project(int order, int n, int directions, const float* v, std::ptrdiff_t stride,
  const float* Y, bool add, float* sh, std::ptrdiff_t shStride)
{
  switch (order)
  {
    case 0:
      projectN<1>(n, directions, v, stride, Y, add, sh, shStride);
      break;
    case 1:
      projectN<4>(n, directions, v, stride, Y, add, sh, shStride);
      break;
    case 2:
      projectN<9>(n, directions, v, stride, Y, add, sh, shStride);
      break;
    case 3:
      projectN<16>(n, directions, v, stride, Y, add, sh, shStride);
      break;
    default:
      projectN<25>(n, directions, v, stride, Y, add, sh, shStride);
      break;
  }
}

//------------------------------------------------------------------------------
/** The grid as rows (X, contiguous) of planes (B) that are swept (S). */
struct View
{
  std::array<int, 3> axis{ { 0, 1, 2 } }; // of X, B, S in the grid
  std::array<int, 3> n{ { 0, 0, 0 } };
  std::array<double, 3> h{ { 1., 1., 1. } };
  const float* sigma = nullptr;
  std::int64_t strideB = 0; // of sigma; that of X is 1
  std::int64_t strideS = 0;
  std::array<std::int64_t, 3> out{ { 0, 0, 0 } }; // strides in the grid

  const float* row(int j, int k) const
  {
    return this->sigma + j * this->strideB + k * this->strideS;
  }
};

/** `transposed` has x and z exchanged; needed to sweep along x. */
View MakeView(const VisibilityMedium& medium, int sweep, const float* transposed)
{
  const std::array<int, 3>& n = medium.grid.dims;
  const std::int64_t nx = n[0];
  const std::int64_t ny = n[1];
  const std::int64_t nz = n[2];
  View view;
  view.axis = sweep == 2 ? std::array<int, 3>{ { 0, 1, 2 } }
    : sweep == 1         ? std::array<int, 3>{ { 0, 2, 1 } }
                         : std::array<int, 3>{ { 2, 1, 0 } };
  view.sigma = sweep == 0 ? transposed : medium.sigma_t;
  const std::array<std::int64_t, 3> strides = { { 1, nx, nx * ny } };
  for (int a = 0; a < 3; ++a)
  {
    view.n[a] = n[view.axis[a]];
    view.h[a] = medium.grid.spacing[view.axis[a]];
    view.out[a] = strides[view.axis[a]];
  }
  view.strideB = sweep == 0 ? nz : view.out[1];
  view.strideS = sweep == 0 ? nz * ny : view.out[2];
  return view;
}

/** A grid's values with x and z exchanged, in tiles; from and to every `stride` values. */
void Transpose(const std::array<int, 3>& dims, const float* in, std::int64_t inStride, float* out,
  std::int64_t outStride, const ParallelFor& parallel)
{
  const std::int64_t nx = dims[0];
  const std::int64_t ny = dims[1];
  const std::int64_t nz = dims[2];
  constexpr std::int64_t tile = 16;
  ForRows(parallel, ny, nx * ny * nz,
    [&](std::int64_t begin, std::int64_t end)
    {
      // A tile passes through here, so that each line of memory is visited once: rows a power
      // of 2 apart evict each other.
      float block[tile][tile];
      for (std::int64_t j = begin; j < end; ++j)
      {
        for (std::int64_t k0 = 0; k0 < nz; k0 += tile)
        {
          const std::int64_t k1 = std::min(nz, k0 + tile);
          for (std::int64_t i0 = 0; i0 < nx; i0 += tile)
          {
            const std::int64_t i1 = std::min(nx, i0 + tile);
            for (std::int64_t k = k0; k < k1; ++k)
            {
              for (std::int64_t i = i0; i < i1; ++i)
              {
                block[i - i0][k - k0] = in[inStride * (i + nx * (j + ny * k))];
              }
            }
            for (std::int64_t i = i0; i < i1; ++i)
            {
              for (std::int64_t k = k0; k < k1; ++k)
              {
                out[outStride * (k + nz * (j + ny * i))] = block[i - i0][k - k0];
              }
            }
          }
        }
      }
    });
}

int SweepAxis(const Grid& grid, const std::array<double, 3>& w)
{
  int sweep = 2;
  double most = -1.;
  for (int a = 2; a >= 0; --a)
  {
    const double crossed = std::abs(w[a]) / grid.spacing[a];
    if (crossed > most)
    {
      most = crossed;
      sweep = a;
    }
  }
  return sweep;
}

//------------------------------------------------------------------------------
/** A lattice that shears with a direction: where its rays lie in the planes. */
struct Shear
{
  bool up = false;             // looks towards higher planes: these come first
  float step = 1.f;            // length between planes
  std::array<double, 2> shift; // of the rays from plane to plane, in X and B, in [-1, 1]

  Shear(const View& view, const std::array<double, 3>& w)
  {
    double length = 0.;
    for (const double component : w)
    {
      length += component * component;
    }
    length = std::sqrt(length);
    const double along = std::abs(w[view.axis[2]]) / view.h[2]; // planes per length, times length
    this->up = w[view.axis[2]] > 0.;
    this->step = static_cast<float>(length / along);
    for (int a = 0; a < 2; ++a)
    {
      this->shift[a] = -w[view.axis[a]] / view.h[a] / along;
      this->shift[a] = std::min(1., std::max(-1., this->shift[a]));
    }
  }
  int plane(const View& view, int m) const { return this->up ? view.n[2] - 1 - m : m; }
  /** Ray r lies at r - 1 + frac in plane m, and was ray r - moved in the plane before. */
  int whole(int a, int m) const { return static_cast<int>(std::floor(m * this->shift[a])); }
  float frac(int a, int m) const
  {
    return static_cast<float>(m * this->shift[a] - this->whole(a, m));
  }
  int moved(int a, int m) const { return m > 0 ? this->whole(a, m) - this->whole(a, m - 1) : 0; }
};

/** What a thread needs for its rows. */
struct Scratch
{
  std::vector<float> zeros;
  std::vector<float> sigma;
  std::vector<float> depth;
  std::vector<float> e;
  std::vector<float> rows;  // 3 per direction
  std::vector<float> v;     // 1 per direction
  std::vector<float> first; // 1 per direction

  Scratch(int n, int directions)
    : zeros(n + 4)
    , sigma(n + 4)
    , depth(n + 4)
    , e(n + 4)
    , rows(std::size_t(3) * directions * n)
    , v(std::size_t(directions) * n)
    , first(std::size_t(directions) * n)
  {
  }
};

/** sigma_t at the ray row r of a plane, n values from the second on. */
const float* SigmaOfRow(const View& view, int k, int r, float g, double slope, Scratch& scratch)
{
  const float* zeros = scratch.zeros.data();
  const bool first = r == 0;
  const bool last = r == view.n[1];
  const float weight = first ? static_cast<float>(coverage(g - 0.5, slope))
    : last                   ? static_cast<float>(1. - coverage(0.5 - g, slope))
                             : g;
  blend(view.n[0], weight, first ? zeros : view.row(r - 1, k), last ? zeros : view.row(r, k),
    scratch.sigma.data() + 1);
  return scratch.sigma.data();
}

//------------------------------------------------------------------------------
/**
 * All directions that sweep one way along one axis, plane by plane: the rays' state
 * of two planes (of as many as the radius spans), a task per block of rows.
 */
class Batch
{
public:
  Batch(const View& v, const std::vector<Shear>& s,
    const std::vector<std::array<float, MaxHarmonics>>& y, double radius)
    : view(v)
    , shears(s)
    , Y(y)
    , stride(v.n[0] + 3)
    , planeSize(static_cast<std::int64_t>(v.n[1] + 1) * this->stride)
  {
    this->planes = 2;
    if (radius > 0.)
    {
      for (const Shear& shear : this->shears)
      {
        const double steps = radius / shear.step;
        this->reach.push_back(steps < view.n[2] ? steps : -1.);
        this->planes = std::max(this->planes, steps < view.n[2] ? static_cast<int>(steps) + 3 : 2);
      }
    }
    const std::int64_t size = this->planeSize * static_cast<std::int64_t>(this->shears.size());
    this->state.allocate(2 * size);
    this->past.allocate(this->reach.empty() ? 0 : this->planes * size);
    this->flatY.resize(this->Y.size() * MaxHarmonics);
    for (std::size_t d = 0; d < this->Y.size(); ++d)
    {
      std::copy(this->Y[d].begin(), this->Y[d].end(), this->flatY.begin() + d * MaxHarmonics);
    }
  }

  /** Plane m, voxel rows [begin, end); with two rows or more in all, the first two go together. */
  void rows(int m, int begin, int end, int order, bool add, float* sh, std::int64_t shStride,
    Scratch& scratch)
  {
    const int n = this->view.n[0];
    const int count = this->view.n[1];
    const int k = this->shears[0].plane(this->view, m);
    const int directions = static_cast<int>(this->shears.size());
    const auto rowOf = [&](int d, int r) { return scratch.rows.data() + (3 * d + r % 3) * n; };
    const auto write = [&](int row, const float* v)
    {
      float* out = sh + shStride * (k * this->view.out[2] + row * this->view.out[1]);
      project(
        order, n, directions, v, n, this->flatY.data(), add, out, shStride * this->view.out[0]);
    };
    // The last row may continue what the two rows of rays before it have.
    for (int r = begin == count - 1 && begin > 0 ? begin - 1 : begin; r <= end; ++r)
    {
      for (int d = 0; d < directions; ++d)
      {
        this->crossRow(m, k, d, r, r >= begin && (r < end || r == count), rowOf(d, r), scratch);
      }
      if (r <= begin)
      {
        continue;
      }
      for (int d = 0; d < directions; ++d)
      {
        const float g = this->shears[d].frac(1, m);
        float* v = scratch.v.data() + d * n;
        float* first = scratch.first.data() + d * n;
        if (r == 1 && (g >= 0.5f || count == 1))
        {
          blend(n, g < 0.5f ? 1.f : (count == 1 && g > 0.5f ? 0.f : 1.f - g), rowOf(d, 0),
            rowOf(d, 1), first);
        }
        else if (r == 2 && g < 0.5f)
        {
          continueRow(n, g, rowOf(d, 1), rowOf(d, 2), first);
        }
        if (r > 1 && r == count && g > 0.5f)
        {
          continueRow(n, 1.f - g, rowOf(d, r - 1), rowOf(d, r - 2), v);
        }
        else if (r > 1)
        {
          blend(n, 1.f - g, rowOf(d, r - 1), rowOf(d, r), v);
        }
      }
      if ((r == 2 && begin == 0) || count == 1)
      {
        write(0, scratch.first.data());
      }
      if (r > 1)
      {
        write(r - 1, scratch.v.data());
      }
    }
  }

private:
  /** The rays of row r meet plane m (k); v at the voxels' columns goes to `seen`. */
  void crossRow(int m, int k, int d, int r, bool own, float* seen, Scratch& scratch)
  {
    const int n = this->view.n[0];
    const Shear& shear = this->shears[d];
    const float f = shear.frac(0, m);
    const float* sigma = SigmaOfRow(this->view, k, r, shear.frac(1, m), shear.shift[1], scratch);
    const float* before = this->stateRow(this->state, 2, d, m - 1, r - shear.moved(1, m));
    before = before ? before - shear.moved(0, m) : scratch.zeros.data() + 1;
    // A row of another task is needed here, but not kept.
    float* U = own ? this->stateRow(this->state, 2, d, m, r) : scratch.e.data() + 1;
    float* depth = scratch.depth.data();
    crossPlane(n + 1, f, shear.step, sigma, before, U, depth);
    // The outermost rays: within the border as dense as the outermost voxel.
    for (const int edge : { 0, n })
    {
      const double inside = edge == 0 ? f - 0.5 : 0.5 - f;
      const float s = shear.step * sigma[edge == 0 ? 1 : n] *
        static_cast<float>(coverage(inside, shear.shift[0]));
      depth[edge] = before[edge] + 0.5f * s;
      U[edge] = before[edge] + s;
    }
    if (!this->reach.empty())
    {
      if (own)
      {
        std::copy(depth, depth + n + 1, this->stateRow(this->past, this->planes, d, m, r));
      }
      if (this->reach[d] >= 0.)
      {
        this->forgetRow(d, m, r, depth, scratch);
      }
    }
    seeRow(n, f, depth, scratch.e.data(), seen);
  }

  /** Ray 0 of a row; null where there is none yet. A zero lies on either side. */
  float* stateRow(Buffer<float>& buffer, int depth, int d, int m, int r)
  {
    if (m < 0 || r < 0 || r > this->view.n[1])
    {
      return nullptr;
    }
    return buffer.data() + (static_cast<std::int64_t>(d) * depth + m % depth) * this->planeSize +
      r * this->stride + 1;
  }

  /** Takes away what was crossed more than the radius ago. */
  void forgetRow(int d, int m, int r, float* depth, Scratch& scratch)
  {
    const Shear& shear = this->shears[d];
    const int near = static_cast<int>(this->reach[d]);
    const float w = static_cast<float>(this->reach[d] - near);
    const int n = this->view.n[0] + 1;
    const float* rows[2];
    std::vector<float>* copies[2] = { &scratch.e, &scratch.sigma };
    for (int s = 0; s < 2; ++s)
    {
      // Where these rays were then; with whole rays outside, a copy with zeros.
      const int then = m - near - s;
      rows[s] = scratch.zeros.data();
      if (then < 0)
      {
        continue;
      }
      const int movedX = shear.whole(0, m) - shear.whole(0, then);
      const int movedB = shear.whole(1, m) - shear.whole(1, then);
      const float* row =
        then == m ? depth : this->stateRow(this->past, this->planes, d, then, r - movedB);
      if (!row)
      {
        continue;
      }
      std::vector<float>& copy = *copies[s];
      const int first = std::min(n, std::max(0, movedX));
      const int last = std::max(first, std::min(n, n + movedX));
      std::fill(copy.begin(), copy.end(), 0.f);
      std::copy(row + first - movedX, row + last - movedX, copy.begin() + first);
      rows[s] = copy.data();
    }
    forget(n, w, rows[0], rows[1], depth);
  }

  const View& view;
  const std::vector<Shear>& shears;
  const std::vector<std::array<float, MaxHarmonics>>& Y;
  std::vector<float> flatY;
  std::int64_t stride;
  std::int64_t planeSize;
  int planes = 2;
  std::vector<double> reach; // in planes; negative: to the border
  Buffer<float> state;
  Buffer<float> past;
};

/** Sweeps a batch; `done` of `total` planes were finished before. */
bool Sweep(const View& view, Batch& batch, int directions, int order, bool add, float* sh,
  std::int64_t stride, const ParallelFor& parallel, const ProgressFunction& progress,
  std::int64_t& done, std::int64_t total)
{
  const int rows = view.n[1];
  const std::int64_t values = static_cast<std::int64_t>(rows) * view.n[0] * directions;
  const std::int64_t tasks = (rows + RowsPerTask - 1) / RowsPerTask;
  for (int m = 0; m < view.n[2]; ++m)
  {
    ForRows(parallel, tasks, values,
      [&](std::int64_t begin, std::int64_t end)
      {
        Scratch scratch(view.n[0], directions);
        batch.rows(m, static_cast<int>(begin) * RowsPerTask,
          std::min(rows, static_cast<int>(end) * RowsPerTask), order, add, sh, stride, scratch);
      });
    done += directions;
    if (progress && !progress(static_cast<double>(done) / static_cast<double>(total)))
    {
      return false;
    }
  }
  return true;
}

//------------------------------------------------------------------------------
/** Where a position lies between entries of a padded row: entry and fraction. */
void Locate(double at, int last, int& entry, float& w)
{
  const double floor = std::floor(at);
  entry = static_cast<int>(std::min(std::max(floor, 0.), static_cast<double>(last)));
  w = static_cast<float>(std::min(std::max(at - entry, 0.), 1.));
}

/** The rays of a point light within a pyramid: the slopes of its rows and columns. */
struct Slopes
{
  double first = 0.;
  double step = 1.;
  int n = 0;

  /** The slopes under which positions 0 to last are seen between two distances. */
  Slopes(double light, int last, double nearest, double farthest)
  {
    const auto slope = [](double offset, double distance)
    { return std::min(1., std::max(-1., offset / distance)); };
    const double low = std::min(slope(-light, nearest), slope(-light, farthest));
    const double high = std::max(slope(last - light, nearest), slope(last - light, farthest));
    this->step = 1. / farthest;
    this->first = low;
    this->n = static_cast<int>(std::ceil((high - low) / this->step)) + 2;
  }
  double at(int i) const { return this->first + i * this->step; }
  double ray(double slope) const { return (slope - this->first) / this->step; }
  int clamped(double ray) const
  {
    return static_cast<int>(std::min(std::max(ray, 0.), this->n - 1.));
  }
};

/** sigma_t at a place, in voxels; zero a voxel beyond the border. */
double SigmaAt(const View& view, const std::array<double, 3>& place)
{
  double sum = 0.;
  std::array<int, 3> low{};
  for (int a = 0; a < 3; ++a)
  {
    if (!(place[a] > -1. && place[a] < view.n[a]))
    {
      return 0.;
    }
    low[a] = static_cast<int>(std::floor(place[a]));
  }
  for (int corner = 0; corner < 8; ++corner)
  {
    double weight = 1.;
    std::array<int, 3> at{};
    bool inside = true;
    for (int a = 0; a < 3; ++a)
    {
      const int high = (corner >> a) & 1;
      at[a] = low[a] + high;
      inside = inside && at[a] >= 0 && at[a] < view.n[a];
      const double w = place[a] - low[a];
      weight *= high ? w : 1. - w;
    }
    if (inside)
    {
      sum += weight * static_cast<double>(view.row(at[1], at[2])[at[0]]);
    }
  }
  return sum;
}

/** The pyramid behind a point light along one axis and sense. */
class Pyramid
{
public:
  Pyramid(const View& v, const std::array<double, 3>& l, bool upwards)
    : view(v)
    , light(l)
    , up(upwards)
  {
    const int n = this->view.n[2];
    // Planes behind the light, nearest first, that hold voxels of the pyramid.
    for (int m = 0; m < n; ++m)
    {
      const int k = this->up ? m : n - 1 - m;
      const double z = std::abs(k - this->light[2]);
      const bool behind = this->up ? k > this->light[2] : k < this->light[2];
      if (behind && z > 1e-6)
      {
        this->planes.push_back(k);
      }
    }
    if (this->planes.empty())
    {
      return;
    }
    this->nearest = std::abs(this->planes.front() - this->light[2]);
    this->farthest = std::abs(this->planes.back() - this->light[2]);
    bool some = true;
    for (int a = 0; a < 2; ++a)
    {
      int first;
      int last;
      this->voxels(a, this->farthest, first, last);
      some = some && first <= last;
    }
    if (!some)
    {
      this->planes.clear();
    }
  }

  bool empty() const { return this->planes.empty(); }

  /** The voxels of an axis within the pyramid. */
  void voxels(int a, double z, int& first, int& last) const
  {
    const double low = std::ceil(this->light[a] - z - 1e-9);
    const double high = std::floor(this->light[a] + z + 1e-9);
    first = static_cast<int>(std::min(std::max(low, 0.), static_cast<double>(this->view.n[a])));
    last = static_cast<int>(std::max(std::min(high, this->view.n[a] - 1.), -1.));
  }

  bool run(float* v, std::int64_t stride, const ParallelFor& parallel) const
  {
    const Slopes rays(this->light[0], this->view.n[0] - 1, this->nearest, this->farthest);
    const Slopes rows(this->light[1], this->view.n[1] - 1, this->nearest, this->farthest);
    const std::int64_t tasks = (rows.n - 1 + RowsPerTask - 1) / RowsPerTask;
    ForRows(parallel, tasks,
      static_cast<std::int64_t>(rows.n) * rays.n * static_cast<std::int64_t>(this->planes.size()),
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t task = begin; task < end; ++task)
        {
          const int first = static_cast<int>(task) * RowsPerTask;
          this->rowsOf(rays, rows, first, std::min(rows.n - 1, first + RowsPerTask), v, stride);
        }
      });
    return true;
  }

private:
  /** The ray rows [begin, end] through all planes; the voxels between them. */
  void rowsOf(
    const Slopes& rays, const Slopes& rows, int begin, int end, float* v, std::int64_t stride) const
  {
    const int n = this->view.n[0];
    const int height = end - begin + 1;
    const std::size_t width = static_cast<std::size_t>(rays.n);
    std::vector<float> U(width * height);
    std::vector<float> e(width * height);
    std::vector<float> steps(width * height);
    std::vector<float> zeros(static_cast<std::size_t>(n) + 2);
    std::vector<float> line(std::max(width, static_cast<std::size_t>(n)) + 2);
    std::vector<float> sigma(width);
    std::vector<float> depth(width);
    std::vector<int> at(width);
    std::vector<float> w(width);
    std::vector<int> rayAt(static_cast<std::size_t>(n));
    std::vector<float> rayW(static_cast<std::size_t>(n));
    std::vector<float> seen(static_cast<std::size_t>(n));
    for (int r = 0; r < height; ++r)
    {
      const double y = rows.at(begin + r) * this->view.h[1];
      for (int i = 0; i < rays.n; ++i)
      {
        const double x = rays.at(i) * this->view.h[0];
        steps[width * r + i] =
          static_cast<float>(std::sqrt(x * x + y * y + this->view.h[2] * this->view.h[2]));
      }
    }
    // A light farther than a voxel from the first plane has nothing before it.
    const double part = std::min(1., this->nearest);
    const float start =
      this->nearest <= 1. ? static_cast<float>(SigmaAt(this->view, this->light)) : 0.f;
    bool isFirst = true;
    for (const int k : this->planes)
    {
      const double z = std::abs(k - this->light[2]);
      // Rays beside the volume are left alone: no voxel lies between them, and once they
      // left it they do not come back.
      const int i0 = rays.clamped(std::floor(rays.ray((-1. - this->light[0]) / z)));
      const int i1 = rays.clamped(std::ceil(rays.ray((n - this->light[0]) / z))) + 1;
      for (int i = i0; i < i1; ++i)
      {
        // `line` has a zero before and after the row.
        const double x = this->light[0] + rays.at(i) * z;
        Locate(x + 1., n, at[i], w[i]);
        if (x < 0.)
        {
          w[i] = static_cast<float>(coverage(x + 0.5, rays.at(i)));
        }
        else if (x > n - 1.)
        {
          w[i] = static_cast<float>(1. - coverage(n - 0.5 - x, rays.at(i)));
        }
      }
      for (int r = 0; r < height; ++r)
      {
        const double y = this->light[1] + rows.at(begin + r) * z;
        if (!(y > -1.001 && y < this->view.n[1] + 0.001))
        {
          continue;
        }
        const double low = std::floor(y);
        const auto row = [&](double j) {
          return j >= 0. && j < this->view.n[1] ? this->view.row(static_cast<int>(j), k)
                                                : zeros.data();
        };
        const double last = this->view.n[1] - 1.;
        const double weight = y < 0. ? coverage(y + 0.5, rows.at(begin + r))
          : y > last                 ? 1. - coverage(last + 0.5 - y, rows.at(begin + r))
                                     : y - low;
        blend(n, static_cast<float>(weight), row(low), row(low + 1.), line.data() + 1);
        line[0] = 0.f;
        line[n + 1] = 0.f;
        gather(i1 - i0, at.data() + i0, w.data() + i0, line.data(), sigma.data());
        const std::size_t first = width * r + i0;
        float* u = U.data() + first;
        const float* step = steps.data() + first;
        if (isFirst)
        {
          startOpening(
            i1 - i0, static_cast<float>(part), start, step, sigma.data(), u, depth.data());
        }
        else
        {
          crossOpening(i1 - i0, step, sigma.data(), u, depth.data());
        }
        expRow(i1 - i0, depth.data(), e.data() + first);
      }
      isFirst = false;
      this->seePlane(rays, rows, begin, end, k, z, e, line, rayAt, rayW, seen, v, stride);
    }
  }

  /**
   * The ray before a voxel and the weight of the next. At the border, where one of the two would
   * lie beyond it, the two rays within: their line is continued, with a weight outside [0, 1].
   */
  void between(int a, int voxel, double z, const Slopes& rays, int& ray, float& w) const
  {
    Locate(rays.ray((voxel - this->light[a]) / z), rays.n - 2, ray, w);
    if (voxel == 0 && ray < rays.n - 2 && this->light[a] + rays.at(ray) * z < -0.5)
    {
      ++ray;
      w -= 1.f;
    }
    else if (voxel == this->view.n[a] - 1 && ray > 0 &&
      this->light[a] + rays.at(ray + 1) * z > this->view.n[a] - 0.5)
    {
      --ray;
      w += 1.f;
    }
  }

  /** The voxels of a plane between the ray rows [begin, end]. */
  void seePlane(const Slopes& rays, const Slopes& rows, int begin, int end, int k, double z,
    const std::vector<float>& e, std::vector<float>& line, std::vector<int>& rayAt,
    std::vector<float>& rayW, std::vector<float>& seen, float* v, std::int64_t stride) const
  {
    int i0;
    int i1;
    int j0;
    int j1;
    this->voxels(0, z, i0, i1);
    this->voxels(1, z, j0, j1);
    const double low = std::floor(this->light[1] + z * rows.at(begin)) - 1.;
    const double high = std::ceil(this->light[1] + z * rows.at(end)) + 1.;
    j0 = static_cast<int>(std::max(static_cast<double>(j0), std::min(low, j1 + 1.)));
    j1 = static_cast<int>(std::min(static_cast<double>(j1), std::max(high, j0 - 1.)));
    const std::size_t width = static_cast<std::size_t>(rays.n);
    bool located = false;
    int from = 0;
    int to = 0;
    for (int j = j0; j <= j1; ++j)
    {
      int r;
      float g;
      this->between(1, j, z, rows, r, g);
      if (r < begin || r >= end)
      {
        continue;
      }
      if (!located)
      {
        for (int i = i0; i <= i1; ++i)
        {
          this->between(0, i, z, rays, rayAt[i - i0], rayW[i - i0]);
        }
        located = true;
        const auto ends = std::minmax_element(rayAt.begin(), rayAt.begin() + (i1 - i0 + 1));
        from = i0 <= i1 ? *ends.first : 0;
        to = i0 <= i1 ? *ends.second + 2 : 0;
      }
      const float* lower = e.data() + width * (r - begin) + from;
      blend(to - from, g, lower, lower + width, line.data() + from);
      gather(i1 - i0 + 1, rayAt.data(), rayW.data(), line.data(), seen.data());
      float* out = v + stride * (k * this->view.out[2] + j * this->view.out[1]);
      for (int i = i0; i <= i1; ++i)
      {
        out[i * stride * this->view.out[0]] = std::min(1.f, std::max(0.f, seen[i - i0]));
      }
    }
  }

  const View& view;
  const std::array<double, 3> light; // in voxels, X, B, S
  const bool up;
  std::vector<int> planes;
  double nearest = 1.;
  double farthest = 1.;
};
} // namespace

//------------------------------------------------------------------------------
void SphericalHarmonics(int order, const std::array<double, 3>& w, double* Y)
{
  // Legendre functions without the factor sin^m, which makes with cos(m phi), sin(m phi)
  // the polynomials Re, Im (x + i y)^m.
  double re = 1.;
  double im = 0.;
  double diagonal = std::sqrt(1. / (4. * Pi));
  for (int m = 0; m <= order; ++m)
  {
    double last = 0.;
    double here = diagonal;
    for (int l = m; l <= order; ++l)
    {
      const double scale = m > 0 ? std::sqrt(2.) : 1.;
      Y[l * (l + 1) + m] = scale * here * re;
      if (m > 0)
      {
        Y[l * (l + 1) - m] = scale * here * im;
      }
      const double l1 = l + 1.;
      const double a = std::sqrt((4. * l1 * l1 - 1.) / (l1 * l1 - m * m));
      const double b =
        l > m ? std::sqrt((double(l) * l - double(m) * m) / (4. * double(l) * l - 1.)) : 0.;
      const double next = a * (w[2] * here - b * last);
      last = here;
      here = next;
    }
    const double x = re * w[0] - im * w[1];
    im = re * w[1] + im * w[0];
    re = x;
    diagonal *= std::sqrt((2. * m + 3.) / (2. * m + 2.));
  }
}

//------------------------------------------------------------------------------
std::vector<double> VisibilityWindow(int order)
{
  // The squares of the Christoffel-Darboux kernel at the largest root of P_n+1 (even
  // orders 2 n), of the Jacobi polynomial P^(0,1)_n+1, with a factor 1 + t (odd ones, 2 n + 1).
  const int n = order / 2;
  const bool odd = order % 2 != 0;
  const int points = order + 2; // of the Gauss rule, exact to 2 order + 3
  const auto legendre = [](int l, double t)
  {
    double last = 0.;
    double here = 1.;
    for (int i = 0; i < l; ++i)
    {
      const double next = ((2. * i + 1.) * t * here - i * last) / (i + 1.);
      last = here;
      here = next;
    }
    return here;
  };
  // (1 + t) P^(0,1)_l = P_l + P_l+1.
  const auto orthogonal = [&](int l, double t)
  {
    return odd ? (t > -1. ? (legendre(l, t) + legendre(l + 1, t)) / (1. + t) : 0.) : legendre(l, t);
  };
  const auto root = [&](const auto& f, double high, double low)
  {
    for (int i = 0; i < 200; ++i)
    {
      const double middle = 0.5 * (low + high);
      ((f(middle) > 0.) == (f(high) > 0.) ? high : low) = middle;
    }
    return 0.5 * (low + high);
  };
  // The largest root lies below the first sign change seen from 1.
  const auto f = [&](double t) { return orthogonal(n + 1, t); };
  double low = 1.;
  while (f(low) > 0.)
  {
    low -= 1e-3;
  }
  const double largest = root(f, low + 1e-3, low);

  std::vector<double> window(static_cast<std::size_t>(order) + 1);
  // Gauss-Legendre points by Newton's method.
  for (int i = 0; i < points; ++i)
  {
    double t = std::cos(Pi * (i + 0.75) / (points + 0.5));
    double slope = 1.;
    for (int step = 0; step < 50; ++step)
    {
      const double p = legendre(points, t);
      slope = points * (legendre(points - 1, t) - t * p) / (1. - t * t);
      t -= p / slope;
    }
    const double weight = 2. / ((1. - t * t) * slope * slope);
    double kernel = 0.;
    for (int l = 0; l <= n; ++l)
    {
      kernel += (odd ? 2. * l + 2. : 2. * l + 1.) * orthogonal(l, largest) * orthogonal(l, t);
    }
    kernel *= odd ? kernel * (1. + t) : kernel;
    for (int l = 0; l <= order; ++l)
    {
      window[l] += weight * kernel * legendre(l, t);
    }
  }
  for (int l = order; l >= 0; --l)
  {
    window[l] /= window[0];
  }
  return window;
}

//------------------------------------------------------------------------------
DirectionSet MakeDirections(int n, int degree)
{
  DirectionSet set;
  const double golden = Pi * (3. - std::sqrt(5.));
  for (int i = 0; i < n; ++i)
  {
    const double z = 1. - (2. * i + 1.) / n;
    const double s = std::sqrt(1. - z * z);
    set.directions.push_back({ { s * std::cos(golden * i), s * std::sin(golden * i), z } });
  }
  for (int d = degree; d > 0; --d)
  {
    // w = w0 + A^T (A A^T)^-1 (b - A w0) by Cholesky's method.
    const int size = NumberOfHarmonics(d);
    if (size > n)
    {
      continue;
    }
    std::vector<double> A(static_cast<std::size_t>(size) * n);
    std::vector<double> Y(static_cast<std::size_t>(size));
    std::vector<double> rest(static_cast<std::size_t>(size));
    std::vector<double> L(static_cast<std::size_t>(size) * size);
    rest[0] = std::sqrt(4. * Pi);
    for (int i = 0; i < n; ++i)
    {
      SphericalHarmonics(d, set.directions[i], Y.data());
      for (int r = 0; r < size; ++r)
      {
        A[std::size_t(r) * n + i] = Y[r];
        rest[r] -= Y[r] * 4. * Pi / n;
        for (int c = 0; c <= r; ++c)
        {
          L[std::size_t(r) * size + c] += Y[r] * Y[c];
        }
      }
    }
    bool good = true;
    for (int r = 0; r < size && good; ++r)
    {
      for (int c = 0; c <= r; ++c)
      {
        double sum = L[std::size_t(r) * size + c];
        for (int q = 0; q < c; ++q)
        {
          sum -= L[std::size_t(r) * size + q] * L[std::size_t(c) * size + q];
        }
        if (c < r)
        {
          L[std::size_t(r) * size + c] = sum / L[std::size_t(c) * size + c];
        }
        else
        {
          good = sum > 1e-6 * n / (4. * Pi);
          L[std::size_t(r) * size + r] = good ? std::sqrt(sum) : 1.;
        }
      }
    }
    for (int r = 0; r < size; ++r)
    {
      for (int q = 0; q < r; ++q)
      {
        rest[r] -= L[std::size_t(r) * size + q] * rest[q];
      }
      rest[r] /= L[std::size_t(r) * size + r];
    }
    for (int r = size - 1; r >= 0; --r)
    {
      for (int q = r + 1; q < size; ++q)
      {
        rest[r] -= L[std::size_t(q) * size + r] * rest[q];
      }
      rest[r] /= L[std::size_t(r) * size + r];
    }
    set.weights.assign(static_cast<std::size_t>(n), 4. * Pi / n);
    for (int i = 0; i < n; ++i)
    {
      for (int r = 0; r < size; ++r)
      {
        set.weights[i] += A[std::size_t(r) * n + i] * rest[r];
      }
      good = good && set.weights[i] > 0.;
    }
    if (good)
    {
      set.degree = d;
      return set;
    }
  }
  set.weights.assign(static_cast<std::size_t>(n), 4. * Pi / n);
  return set;
}

//------------------------------------------------------------------------------
int DefaultNumberOfDirections(int order)
{
  constexpr int numbers[] = { 32, 48, 64, 96, 144 };
  return numbers[std::min(std::max(order, 0), HighestVisibilityOrder)];
}

//------------------------------------------------------------------------------
bool VisibilityTowards(const VisibilityMedium& medium, const std::array<double, 3>& direction,
  float* v, std::int64_t stride, const ParallelFor& parallel, const ProgressFunction& progress,
  VisibilityScratch* scratch)
{
  // Of any length: its square may be more than a number can hold.
  std::array<double, 3> w = direction;
  double largest = 0.;
  for (const double component : w)
  {
    largest = std::max(largest, std::abs(component));
  }
  for (double& component : w)
  {
    component /= largest;
  }
  // One direction, whose "coefficient" is v itself.
  const int sweep = SweepAxis(medium.grid, w);
  VisibilityScratch own;
  VisibilityScratch& kept = scratch ? *scratch : own;
  if (sweep == 0 && kept.transposed.empty())
  {
    kept.across.allocate(medium.grid.size());
    kept.transposed.allocate(medium.grid.size());
    Transpose(medium.grid.dims, medium.sigma_t, 1, kept.transposed.data(), 1, parallel);
  }
  View view = MakeView(medium, sweep, kept.transposed.data());
  // Along x the result, too, is transposed first: writing it across would take longer.
  const std::array<int, 3>& n = view.n;
  if (sweep == 0)
  {
    view.out = { { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] } };
  }
  const std::vector<Shear> shears = { Shear(view, w) };
  std::vector<std::array<float, MaxHarmonics>> Y(1);
  Y[0][0] = 1.f;
  Batch batch(view, shears, Y, medium.radius);
  std::int64_t done = 0;
  if (!Sweep(view, batch, 1, 0, false, sweep == 0 ? kept.across.data() : v, sweep == 0 ? 1 : stride,
        parallel, progress, done, n[2]))
  {
    return false;
  }
  if (sweep == 0)
  {
    Transpose(n, kept.across.data(), 1, v, stride, parallel);
  }
  return true;
}

//------------------------------------------------------------------------------
bool VisibilityTowardsPoint(const VisibilityMedium& medium, const std::array<double, 3>& place,
  float* v, std::int64_t stride, const ParallelFor& parallel, const ProgressFunction& progress)
{
  const Grid& grid = medium.grid;
  // So far away that all rays are parallel: a millionth of a voxel over the grid's length.
  double farthest = 0.;
  int longest = 1;
  for (int a = 0; a < 3; ++a)
  {
    farthest = std::max(farthest, std::abs(place[a] / grid.spacing[a]));
    longest = std::max(longest, grid.dims[a]);
  }
  if (farthest > 1e6 * longest * longest)
  {
    return VisibilityTowards({ grid, medium.sigma_t, 0. }, place, v, stride, parallel, progress);
  }

  Buffer<float> transposed;
  int done = 0;
  for (int sweep = 0; sweep < 3; ++sweep)
  {
    View view = MakeView(medium, sweep, nullptr);
    std::array<double, 3> light{};
    for (int a = 0; a < 3; ++a)
    {
      light[a] = place[view.axis[a]] / view.h[a];
    }
    for (const bool up : { true, false })
    {
      const Pyramid pyramid(view, light, up);
      if (!pyramid.empty())
      {
        if (sweep == 0 && transposed.empty())
        {
          transposed.allocate(grid.size());
          Transpose(medium.grid.dims, medium.sigma_t, 1, transposed.data(), 1, parallel);
          view.sigma = transposed.data();
        }
        pyramid.run(v, stride, parallel);
      }
      ++done;
      if (progress && !progress(done / 6.))
      {
        return false;
      }
    }
  }
  // A light in a voxel's centre.
  std::array<int, 3> at{};
  bool centre = true;
  for (int a = 0; a < 3; ++a)
  {
    const double index = place[a] / grid.spacing[a];
    const double whole = std::floor(index + 0.5);
    centre = centre && whole >= 0. && whole < grid.dims[a] && std::abs(index - whole) <= 1e-6;
    at[a] = centre ? static_cast<int>(whole) : 0;
  }
  if (centre)
  {
    v[stride * grid.index(at[0], at[1], at[2])] = 1.f;
  }
  return true;
}

//------------------------------------------------------------------------------
bool VisibilitySH(const VisibilityMedium& medium, const std::array<std::array<double, 3>, 3>& axes,
  const DirectionSet& set, int order, float* sh, std::int64_t stride, const ParallelFor& parallel,
  const ProgressFunction& progress)
{
  // Directions by sweep, 2 axis + sense.
  std::array<std::vector<std::array<double, 3>>, 6> directions;
  std::array<std::vector<std::array<float, MaxHarmonics>>, 6> coefficients;
  std::int64_t total = 0;
  for (std::size_t i = 0; i < set.directions.size(); ++i)
  {
    const std::array<double, 3>& world = set.directions[i];
    std::array<double, 3> w{};
    for (int a = 0; a < 3; ++a)
    {
      w[a] = axes[a][0] * world[0] + axes[a][1] * world[1] + axes[a][2] * world[2];
    }
    double Y[MaxHarmonics];
    SphericalHarmonics(order, world, Y);
    std::array<float, MaxHarmonics> weighted{};
    for (int c = 0; c < NumberOfHarmonics(order); ++c)
    {
      weighted[c] = static_cast<float>(set.weights[i] * Y[c]);
    }
    const int sweep = SweepAxis(medium.grid, w);
    const std::size_t group = 2 * static_cast<std::size_t>(sweep) + (w[sweep] > 0. ? 1 : 0);
    directions[group].push_back(w);
    coefficients[group].push_back(weighted);
    total += medium.grid.dims[sweep];
  }

  Buffer<float> transposed;
  if (!directions[0].empty() || !directions[1].empty())
  {
    transposed.allocate(medium.grid.size());
    Transpose(medium.grid.dims, medium.sigma_t, 1, transposed.data(), 1, parallel);
  }
  std::int64_t done = 0;
  bool add = false;
  for (std::size_t group = 0; group < 6; ++group)
  {
    if (directions[group].empty())
    {
      continue;
    }
    const View view = MakeView(medium, static_cast<int>(group / 2), transposed.data());
    std::vector<Shear> shears;
    for (const std::array<double, 3>& w : directions[group])
    {
      shears.emplace_back(view, w);
    }
    Batch batch(view, shears, coefficients[group], medium.radius);
    if (!Sweep(view, batch, static_cast<int>(shears.size()), order, add, sh, stride, parallel,
          progress, done, total))
    {
      return false;
    }
    add = true;
  }
  return true;
}
} // namespace lighttransport
