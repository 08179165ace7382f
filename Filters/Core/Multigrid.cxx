// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Multigrid.h"

#include "Core/Kernel.h"

#include <algorithm>
#include <cmath>

namespace lighttransport
{
namespace
{
/** A row's values and its four neighbouring rows; rows outside are zeros. */
struct RowView
{
  const float *x, *xS, *xN, *xB, *xT;
};
struct RowFaces
{
  const float *gx, *gy, *gyS, *gz, *gzB, *s;
};

RowView viewRow(const DiffusionOperator& A, const float* x, std::int64_t r)
{
  const std::int64_t nx = A.dims[0];
  const std::int64_t ny = A.dims[1];
  const std::int64_t nz = A.dims[2];
  const std::int64_t j = r % ny;
  const std::int64_t k = r / ny;
  const std::int64_t o = r * nx;
  const float* zeros = A.zeros.data();
  return { x + o, j > 0 ? x + o - nx : zeros, j + 1 < ny ? x + o + nx : zeros,
    k > 0 ? x + o - nx * ny : zeros, k + 1 < nz ? x + o + nx * ny : zeros };
}

RowFaces facesOfRow(const DiffusionOperator& A, std::int64_t r)
{
  const std::int64_t nx = A.dims[0];
  const std::int64_t ny = A.dims[1];
  const std::int64_t j = r % ny;
  const std::int64_t k = r / ny;
  const std::int64_t o = r * nx;
  const float* zeros = A.zeros.data();
  return { A.g[0].data() + o, A.g[1].data() + o, j > 0 ? A.g[1].data() + o - nx : zeros,
    A.g[2].data() + o, k > 0 ? A.g[2].data() + o - nx * ny : zeros, A.s.data() + o };
}

/** x = (b + sum g x_j) / (sum g + s) on the voxels i of the row with (i + parity) even. */
LIGHTTRANSPORT_SIMD
void relaxRow(int n, int parity, const RowFaces& f, const float* LIGHTTRANSPORT_RESTRICT xS,
  const float* LIGHTTRANSPORT_RESTRICT xN, const float* LIGHTTRANSPORT_RESTRICT xB,
  const float* LIGHTTRANSPORT_RESTRICT xT, const float* LIGHTTRANSPORT_RESTRICT b,
  float* LIGHTTRANSPORT_RESTRICT tmp, float* x)
{
  const float* LIGHTTRANSPORT_RESTRICT gx = f.gx;
  const float* LIGHTTRANSPORT_RESTRICT gy = f.gy;
  const float* LIGHTTRANSPORT_RESTRICT gyS = f.gyS;
  const float* LIGHTTRANSPORT_RESTRICT gz = f.gz;
  const float* LIGHTTRANSPORT_RESTRICT gzB = f.gzB;
  const float* LIGHTTRANSPORT_RESTRICT s = f.s;
  const float* xc = x;
  for (int i = 0; i < n; ++i)
  {
    const float num = b[i] + gx[i] * xc[i + 1] + gx[i - 1] * xc[i - 1] + gy[i] * xN[i] +
      gyS[i] * xS[i] + gz[i] * xT[i] + gzB[i] * xB[i];
    const float den = gx[i] + gx[i - 1] + gy[i] + gyS[i] + gz[i] + gzB[i] + s[i];
    tmp[i] = num / den;
  }
  for (int i = 0; i < n; ++i)
  {
    x[i] = ((i + parity) & 1) ? x[i] : tmp[i];
  }
}

/** The first half-sweep from zero: x = b / diagonal on one colour, 0 on the other. */
LIGHTTRANSPORT_SIMD
void startRow(int n, int parity, const RowFaces& f, const float* LIGHTTRANSPORT_RESTRICT b,
  float* LIGHTTRANSPORT_RESTRICT x)
{
  const float* LIGHTTRANSPORT_RESTRICT gx = f.gx;
  const float* LIGHTTRANSPORT_RESTRICT gy = f.gy;
  const float* LIGHTTRANSPORT_RESTRICT gyS = f.gyS;
  const float* LIGHTTRANSPORT_RESTRICT gz = f.gz;
  const float* LIGHTTRANSPORT_RESTRICT gzB = f.gzB;
  const float* LIGHTTRANSPORT_RESTRICT s = f.s;
  for (int i = 0; i < n; ++i)
  {
    const float den = gx[i] + gx[i - 1] + gy[i] + gyS[i] + gz[i] + gzB[i] + s[i];
    const float v = b[i] / den;
    x[i] = ((i + parity) & 1) ? 0.f : v;
  }
}

/** r = b - A x */
LIGHTTRANSPORT_SIMD
void residualRow(int n, const RowFaces& f, const RowView& v, const float* LIGHTTRANSPORT_RESTRICT b,
  float* LIGHTTRANSPORT_RESTRICT r)
{
  const float* LIGHTTRANSPORT_RESTRICT gx = f.gx;
  const float* LIGHTTRANSPORT_RESTRICT gy = f.gy;
  const float* LIGHTTRANSPORT_RESTRICT gyS = f.gyS;
  const float* LIGHTTRANSPORT_RESTRICT gz = f.gz;
  const float* LIGHTTRANSPORT_RESTRICT gzB = f.gzB;
  const float* LIGHTTRANSPORT_RESTRICT s = f.s;
  const float* x = v.x;
  const float* xS = v.xS;
  const float* xN = v.xN;
  const float* xB = v.xB;
  const float* xT = v.xT;
  for (int i = 0; i < n; ++i)
  {
    const float c = x[i];
    r[i] = b[i] -
      (gx[i] * (c - x[i + 1]) + gx[i - 1] * (c - x[i - 1]) + gy[i] * (c - xN[i]) +
        gyS[i] * (c - xS[i]) + gz[i] * (c - xT[i]) + gzB[i] * (c - xB[i]) + s[i] * c);
  }
}

/** y = A x; returns x . y */
LIGHTTRANSPORT_SIMD
double applyRow(int n, const RowFaces& f, const RowView& v, float* LIGHTTRANSPORT_RESTRICT y)
{
  const float* LIGHTTRANSPORT_RESTRICT gx = f.gx;
  const float* LIGHTTRANSPORT_RESTRICT gy = f.gy;
  const float* LIGHTTRANSPORT_RESTRICT gyS = f.gyS;
  const float* LIGHTTRANSPORT_RESTRICT gz = f.gz;
  const float* LIGHTTRANSPORT_RESTRICT gzB = f.gzB;
  const float* LIGHTTRANSPORT_RESTRICT s = f.s;
  const float* x = v.x;
  const float* xS = v.xS;
  const float* xN = v.xN;
  const float* xB = v.xB;
  const float* xT = v.xT;
  for (int i = 0; i < n; ++i)
  {
    const float c = x[i];
    y[i] = gx[i] * (c - x[i + 1]) + gx[i - 1] * (c - x[i - 1]) + gy[i] * (c - xN[i]) +
      gyS[i] * (c - xS[i]) + gz[i] * (c - xT[i]) + gzB[i] * (c - xB[i]) + s[i] * c;
  }
  double dot[8] = { 0., 0., 0., 0., 0., 0., 0., 0. };
  int i = 0;
  for (; i + 8 <= n; i += 8)
  {
    for (int l = 0; l < 8; ++l)
    {
      dot[l] += static_cast<double>(x[i + l]) * static_cast<double>(y[i + l]);
    }
  }
  for (; i < n; ++i)
  {
    dot[0] += static_cast<double>(x[i]) * static_cast<double>(y[i]);
  }
  return ((dot[0] + dot[4]) + (dot[1] + dot[5])) + ((dot[2] + dot[6]) + (dot[3] + dot[7]));
}

std::int64_t rowsOf(const DiffusionOperator& A)
{
  return static_cast<std::int64_t>(A.dims[1]) * A.dims[2];
}

/** One half-sweep over the voxels with (i + j + k + colour) even. */
void relax(
  const DiffusionOperator& A, int colour, const float* b, float* x, const ParallelFor& parallelFor)
{
  const int nx = A.dims[0];
  ForRows(parallelFor, rowsOf(A), A.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      Buffer<float> tmp(nx);
      for (std::int64_t r = begin; r < end; ++r)
      {
        const RowView v = viewRow(A, x, r);
        const std::int64_t o = r * nx;
        const int parity = static_cast<int>((r % A.dims[1] + r / A.dims[1] + colour) & 1);
        relaxRow(nx, parity, facesOfRow(A, r), v.xS, v.xN, v.xB, v.xT, b + o, tmp.data(), x + o);
      }
    });
}

void start(
  const DiffusionOperator& A, int colour, const float* b, float* x, const ParallelFor& parallelFor)
{
  const int nx = A.dims[0];
  ForRows(parallelFor, rowsOf(A), A.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        const std::int64_t o = r * nx;
        const int parity = static_cast<int>((r % A.dims[1] + r / A.dims[1] + colour) & 1);
        startRow(nx, parity, facesOfRow(A, r), b + o, x + o);
      }
    });
}
} // namespace

//------------------------------------------------------------------------------
void DiffusionOperator::allocate(const std::array<int, 3>& n)
{
  this->dims = n;
  for (auto& faces : this->g)
  {
    faces.allocate(this->size());
  }
  this->s.allocate(this->size());
  this->zeros.allocate(n[0]);
}

std::int64_t DiffusionOperator::bytes() const
{
  return this->g[0].bytes() + this->g[1].bytes() + this->g[2].bytes() + this->s.bytes();
}

double Apply(const DiffusionOperator& A, const float* x, float* y, const ParallelFor& parallelFor)
{
  const int nx = A.dims[0];
  return SumRows(parallelFor, rowsOf(A), A.size(),
    [&](std::int64_t r) { return applyRow(nx, facesOfRow(A, r), viewRow(A, x, r), y + r * nx); });
}

//------------------------------------------------------------------------------
void Multigrid::release()
{
  this->levels.clear();
  this->finest = nullptr;
}

std::int64_t Multigrid::bytes() const
{
  std::int64_t sum = 0;
  for (const Level& level : this->levels)
  {
    sum += level.A.bytes() + level.x.bytes() + level.b.bytes() + level.r.bytes() +
      level.w[0].bytes() + level.w[1].bytes() + level.w[2].bytes();
  }
  return sum;
}

//------------------------------------------------------------------------------
void Multigrid::setup(const DiffusionOperator& A, const ParallelFor& parallelFor)
{
  this->release();
  this->finest = &A;
  this->levels.emplace_back();
  const DiffusionOperator* fine = &A;
  for (;;)
  {
    Level& level = this->levels.back();
    // 1. which axes to halve: those whose mean conductance is not far below the largest
    double mean[3] = { 0., 0., 0. };
    double largest = 0.;
    for (int d = 0; d < 3; ++d)
    {
      if (fine->dims[d] > 1)
      {
        const float* g = fine->g[d].data();
        const int nx = fine->dims[0];
        mean[d] = SumRows(parallelFor, rowsOf(*fine), fine->size(),
                    [&](std::int64_t r)
                    {
                      double sum = 0.;
                      for (std::int64_t i = r * nx; i < (r + 1) * nx; ++i)
                      {
                        sum += static_cast<double>(g[i]);
                      }
                      return sum;
                    }) *
          fine->dims[d] / (static_cast<double>(fine->size()) * (fine->dims[d] - 1));
        largest = std::max(largest, mean[d]);
      }
    }
    bool any = false;
    for (int d = 0; d < 3; ++d)
    {
      level.halved[d] = fine->dims[d] > 1 && mean[d] > 0.3 * largest;
      any = any || level.halved[d];
    }
    if (!any)
    {
      break;
    }
    this->levels.emplace_back();
    Level& coarse = this->levels.back();
    this->coarsen(*fine, this->levels[this->levels.size() - 2], coarse, parallelFor);
    fine = &coarse.A;
  }
}

//------------------------------------------------------------------------------
void Multigrid::coarsen(
  const DiffusionOperator& A, Level& fine, Level& coarse, const ParallelFor& parallelFor) const
{
  const std::array<int, 3>& n = A.dims;
  std::array<int, 3> nc;
  for (int d = 0; d < 3; ++d)
  {
    nc[d] = fine.halved[d] ? (n[d] + 1) / 2 : n[d];
    if (fine.halved[d])
    {
      fine.w[d].allocate(A.size());
    }
  }
  fine.r.allocate(A.size());
  coarse.A.allocate(nc);
  coarse.x.allocate(coarse.A.size());
  coarse.b.allocate(coarse.A.size());

  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  ForRows(parallelFor, rowsOf(coarse.A), A.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t row = begin; row < end; ++row)
      {
        int C[3] = { 0, static_cast<int>(row % nc[1]), static_cast<int>(row / nc[1]) };
        for (C[0] = 0; C[0] < nc[0]; ++C[0])
        {
          int first[3];
          int last[3];
          for (int d = 0; d < 3; ++d)
          {
            first[d] = fine.halved[d] ? 2 * C[d] : C[d];
            last[d] = fine.halved[d] ? std::min(2 * C[d] + 1, n[d] - 1) : C[d];
          }
          double sink = 0.;
          double conductance[3] = { 0., 0., 0. };
          for (int k = first[2]; k <= last[2]; ++k)
          {
            for (int j = first[1]; j <= last[1]; ++j)
            {
              for (int i = first[0]; i <= last[0]; ++i)
              {
                const int at[3] = { i, j, k };
                const std::int64_t f = i + stride[1] * j + stride[2] * k;
                sink += static_cast<double>(A.s[f]);
                for (int d = 0; d < 3; ++d)
                {
                  // the voxel on this side of the upper coarse face along d, and the line through
                  // it
                  if (at[d] != last[d] || at[d] + 1 >= n[d])
                  {
                    continue;
                  }
                  const double between = static_cast<double>(A.g[d][f]);
                  if (!fine.halved[d])
                  {
                    conductance[d] += between;
                    continue;
                  }
                  if (between <= 0.)
                  {
                    continue; // the weights stay 0
                  }
                  // half of the inner face on either side; a lone last voxel is its own centre.
                  // A closed inner face stops the line: its far end is the voxel itself.
                  const auto half = [](double g) { return g > 0. ? 0.5 / g : 1e30; };
                  const double here =
                    last[d] > first[d] ? half(static_cast<double>(A.g[d][f - stride[d]])) : 0.;
                  const std::int64_t next = f + stride[d];
                  const bool pair = at[d] + 2 < n[d];
                  const double there = pair ? half(static_cast<double>(A.g[d][next])) : 0.;
                  const double face = 1. / between;
                  const double whole = here + face + there;
                  conductance[d] += 1. / whole;
                  fine.w[d][f] = static_cast<std::uint8_t>(std::lround(255. * here / whole));
                  fine.w[d][next] = static_cast<std::uint8_t>(std::lround(255. * there / whole));
                }
              }
            }
          }
          const std::int64_t c = C[0] + nc[0] * (C[1] + static_cast<std::int64_t>(nc[1]) * C[2]);
          for (int d = 0; d < 3; ++d)
          {
            coarse.A.g[d][c] = static_cast<float>(conductance[d]);
          }
          coarse.A.s[c] = static_cast<float>(sink);
        }
      }
    });
  // Where light has nowhere to go (a singular part), the coarsest voxel has neither.
  CloseIsolated(coarse.A, 1.f, parallelFor);
}

void CloseIsolated(DiffusionOperator& A, float isolated, const ParallelFor& parallelFor)
{
  const int nx = A.dims[0];
  ForRows(parallelFor, rowsOf(A), A.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        const RowFaces f = facesOfRow(A, r);
        float* s = A.s.data() + r * nx;
        for (int i = 0; i < nx; ++i)
        {
          const float den = f.gx[i] + f.gx[i - 1] + f.gy[i] + f.gyS[i] + f.gz[i] + f.gzB[i] + s[i];
          if (!(den > 1e-30f))
          {
            s[i] = isolated;
          }
        }
      }
    });
}

//------------------------------------------------------------------------------
void Multigrid::cycle(const float* b, float* x, const ParallelFor& parallelFor)
{
  this->cycle(0, *this->finest, b, x, parallelFor);
}

void Multigrid::cycle(std::size_t l, const DiffusionOperator& A, const float* b, float* x,
  const ParallelFor& parallelFor)
{
  Level& fine = this->levels[l];
  const bool coarsest = l + 1 == this->levels.size();
  // 4. smooth: red then black
  start(A, 0, b, x, parallelFor);
  relax(A, 1, b, x, parallelFor);
  for (int sweep = 1; sweep < this->sweeps; ++sweep)
  {
    relax(A, 0, b, x, parallelFor);
    relax(A, 1, b, x, parallelFor);
  }
  if (!coarsest)
  {
    Level& coarse = this->levels[l + 1];
    const std::array<int, 3>& n = A.dims;
    const std::array<int, 3>& nc = coarse.A.dims;
    const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
    float* r = fine.r.data();
    ForRows(parallelFor, rowsOf(A), A.size(),
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t row = begin; row < end; ++row)
        {
          residualRow(n[0], facesOfRow(A, row), viewRow(A, x, row), b + row * n[0], r + row * n[0]);
        }
      });
    // 3. restriction, the transpose of the prolongation
    const bool* halved = fine.halved.data();
    constexpr float unit = 1.f / 255.f;
    const std::uint8_t* w[3] = { fine.w[0].data(), fine.w[1].data(), fine.w[2].data() };
    const auto own = [&](std::int64_t f)
    {
      float sum = 0.f;
      for (int d = 0; d < 3; ++d)
      {
        sum += halved[d] ? unit * static_cast<float>(w[d][f]) : 0.f;
      }
      return 1.f - sum;
    };
    ForRows(parallelFor, rowsOf(coarse.A), A.size(),
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t row = begin; row < end; ++row)
        {
          int C[3] = { 0, static_cast<int>(row % nc[1]), static_cast<int>(row / nc[1]) };
          for (C[0] = 0; C[0] < nc[0]; ++C[0])
          {
            int first[3];
            int last[3];
            for (int d = 0; d < 3; ++d)
            {
              first[d] = halved[d] ? 2 * C[d] : C[d];
              last[d] = halved[d] ? std::min(2 * C[d] + 1, n[d] - 1) : C[d];
            }
            float sum = 0.f;
            for (int k = first[2]; k <= last[2]; ++k)
            {
              for (int j = first[1]; j <= last[1]; ++j)
              {
                for (int i = first[0]; i <= last[0]; ++i)
                {
                  const std::int64_t f = i + stride[1] * j + stride[2] * k;
                  sum += own(f) * r[f];
                  const int at[3] = { i, j, k };
                  for (int d = 0; d < 3; ++d)
                  {
                    if (!halved[d])
                    {
                      continue;
                    }
                    if (at[d] == first[d] && at[d] > 0)
                    {
                      const std::int64_t q = f - stride[d];
                      sum += unit * static_cast<float>(w[d][q]) * r[q];
                    }
                    if (at[d] == last[d] && at[d] + 1 < n[d])
                    {
                      const std::int64_t q = f + stride[d];
                      sum += unit * static_cast<float>(w[d][q]) * r[q];
                    }
                  }
                }
              }
            }
            coarse.b[C[0] + row * nc[0]] = sum;
          }
        }
      });
    this->cycle(l + 1, coarse.A, coarse.b.data(), coarse.x.data(), parallelFor);
    // 3. prolongation
    const std::int64_t strideC[3] = { 1, nc[0], static_cast<std::int64_t>(nc[0]) * nc[1] };
    const float* xc = coarse.x.data();
    ForRows(parallelFor, rowsOf(A), A.size(),
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t row = begin; row < end; ++row)
        {
          int at[3] = { 0, static_cast<int>(row % n[1]), static_cast<int>(row / n[1]) };
          for (at[0] = 0; at[0] < n[0]; ++at[0])
          {
            const std::int64_t f = at[0] + row * n[0];
            std::int64_t c = 0;
            for (int d = 0; d < 3; ++d)
            {
              c += strideC[d] * (halved[d] ? at[d] / 2 : at[d]);
            }
            float value = xc[c];
            for (int d = 0; d < 3; ++d)
            {
              if (halved[d] && w[d][f] != 0)
              {
                const std::int64_t q = (at[d] & 1) ? c + strideC[d] : c - strideC[d];
                value += unit * static_cast<float>(w[d][f]) * (xc[q] - xc[c]);
              }
            }
            x[f] += value;
          }
        }
      });
  }
  // 4. smooth: black then red
  for (int sweep = 0; sweep < this->sweeps; ++sweep)
  {
    relax(A, 1, b, x, parallelFor);
    relax(A, 0, b, x, parallelFor);
  }
}
} // namespace lighttransport
