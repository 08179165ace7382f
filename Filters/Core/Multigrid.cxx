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

/** Resistance of half a face; a closed one is as good as infinite. */
inline float halfResistance(float g)
{
  return 0.5f / (g > 1e-30f ? g : 1e-30f);
}

/**
 * The lines through the faces f = first, first + step, ... of a row, from coarse
 * centre to coarse centre: half the inner face on either side (`below`, `above`) in
 * series with the face between; above is null where the voxel there is its own
 * centre. Writes the weight of the other parent for both voxels at the face,
 * and the line's conductance (0 elsewhere) where that is asked for.
 */
LIGHTTRANSPORT_SIMD
void lineRow(int n, int first, int step, int end, const float* between, const float* below,
  const float* above, std::uint8_t* w, std::uint8_t* wNext, float* conductance)
{
  if (conductance && step > 1)
  {
    for (int i = 0; i < n; ++i)
    {
      conductance[i] = 0.f;
    }
  }
  for (int i = first; i < end; i += step)
  {
    const float g = between[i];
    const float here = halfResistance(below[i]);
    // along x (step 2) the last voxel of an odd row is its own centre
    const float there = above && (step == 1 || i + 2 < n) ? halfResistance(above[i]) : 0.f;
    const float whole = here + 1.f / (g > 1e-30f ? g : 1e-30f) + there;
    const float open = g > 1e-30f ? 255.f / whole : 0.f;
    if (conductance)
    {
      conductance[i] = whole < 1e25f ? open * (1.f / 255.f) : 0.f;
    }
    w[i] = static_cast<std::uint8_t>(here * open + 0.5f);
    wNext[i] = static_cast<std::uint8_t>(there * open + 0.5f);
  }
}

/** (factor + slope (here + there)) is a voxel's or a line's weight for a coarse row. */
struct Weights
{
  const std::uint8_t *here, *there;
  float factor, slope;
};

/** own += v fy fz (1 - wx), next += v fy fz wx */
LIGHTTRANSPORT_SIMD
void gatherRow(int n, const float* LIGHTTRANSPORT_RESTRICT v, const Weights& x, const Weights& y,
  const Weights& z, float* LIGHTTRANSPORT_RESTRICT own, float* LIGHTTRANSPORT_RESTRICT next)
{
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT x0 = x.here;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT x1 = x.there;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT y0 = y.here;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT y1 = y.there;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT z0 = z.here;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT z1 = z.there;
  const float cy = y.factor, sy = y.slope, cz = z.factor, sz = z.slope;
  for (int i = 0; i < n; ++i)
  {
    const float t = v[i] * (cy + sy * static_cast<float>(y0[i] + y1[i])) *
      (cz + sz * static_cast<float>(z0[i] + z1[i]));
    const float u = t * (static_cast<float>(x0[i] + x1[i]) * (0.5f / 255.f));
    own[i] += t - u;
    next[i] += u;
  }
}

/** x += the tensor product of the three weights on eight coarse values. */
LIGHTTRANSPORT_SIMD
void prolongRow(int n, const std::uint8_t* LIGHTTRANSPORT_RESTRICT wx,
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT wy, const std::uint8_t* LIGHTTRANSPORT_RESTRICT wz,
  const float* const* up, const float* const* side, float* LIGHTTRANSPORT_RESTRICT x)
{
  const float* LIGHTTRANSPORT_RESTRICT u0 = up[0];
  const float* LIGHTTRANSPORT_RESTRICT u1 = up[1];
  const float* LIGHTTRANSPORT_RESTRICT u2 = up[2];
  const float* LIGHTTRANSPORT_RESTRICT u3 = up[3];
  const float* LIGHTTRANSPORT_RESTRICT s0 = side[0];
  const float* LIGHTTRANSPORT_RESTRICT s1 = side[1];
  const float* LIGHTTRANSPORT_RESTRICT s2 = side[2];
  const float* LIGHTTRANSPORT_RESTRICT s3 = side[3];
  constexpr float unit = 1.f / 255.f;
  for (int i = 0; i < n; ++i)
  {
    const float a = unit * static_cast<float>(wx[i]);
    const float b = unit * static_cast<float>(wy[i]);
    const float c = unit * static_cast<float>(wz[i]);
    const float v0 = u0[i] + a * (s0[i] - u0[i]);
    const float v1 = u1[i] + a * (s1[i] - u1[i]);
    const float v2 = u2[i] + a * (s2[i] - u2[i]);
    const float v3 = u3[i] + a * (s3[i] - u3[i]);
    const float y0 = v0 + b * (v1 - v0);
    const float y1 = v2 + b * (v3 - v2);
    x[i] += y0 + c * (y1 - y0);
  }
}

std::int64_t rowsOf(const DiffusionOperator& A)
{
  return static_cast<std::int64_t>(A.dims[1]) * A.dims[2];
}

/**
 * One half-sweep over the voxels with (i + j + k + colour) even. relaxRow reads
 * and rewrites a row's other colour as well, which keeps its loop straight; and it
 * reads the value before the row and the one after it. So no two rows that are
 * neighbours, in space or in memory, may be in two threads at a time. Slabs, a few
 * rows thick along the longer of y and z, see to it: first all even ones in
 * parallel, then the odd ones. Their number is even: along y the last slab's rows
 * are followed, in memory, by the first slab's.
 */
void relax(
  const DiffusionOperator& A, int colour, const float* b, float* x, const ParallelFor& parallelFor)
{
  constexpr int thickness = 4;
  const int nx = A.dims[0];
  const int ny = A.dims[1];
  const int nz = A.dims[2];
  const bool alongZ = nz >= ny;
  const std::int64_t length = alongZ ? nz : ny;
  const std::int64_t pairs = std::max<std::int64_t>(1, length / (2 * thickness));
  for (int odd = 0; odd < 2; ++odd)
  {
    ForRows(parallelFor, pairs, A.size(),
      [&](std::int64_t begin, std::int64_t end)
      {
        Buffer<float> tmp(nx);
        for (std::int64_t pair = begin; pair < end; ++pair)
        {
          const int from = static_cast<int>(length * (2 * pair + odd) / (2 * pairs));
          const int to = static_cast<int>(length * (2 * pair + odd + 1) / (2 * pairs));
          for (int k = alongZ ? from : 0; k < (alongZ ? to : nz); ++k)
          {
            for (int j = alongZ ? 0 : from; j < (alongZ ? ny : to); ++j)
            {
              const std::int64_t r = j + static_cast<std::int64_t>(ny) * k;
              const RowView v = viewRow(A, x, r);
              const std::int64_t o = r * nx;
              relaxRow(nx, (j + k + colour) & 1, facesOfRow(A, r), v.xS, v.xN, v.xB, v.xT, b + o,
                tmp.data(), x + o);
            }
          }
        }
      });
  }
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
  fine.noWeight.allocate(n[0]);
  fine.r.allocate(A.size());
  coarse.A.allocate(nc);
  coarse.x.allocate(coarse.A.size());
  coarse.b.allocate(coarse.A.size());
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };

  // 3. the weights, from the lines through the coarse faces
  const auto forLines = [&](int d, float* conductance)
  {
    ForRows(parallelFor, rowsOf(A), A.size(),
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t row = begin; row < end; ++row)
        {
          const int at = d == 1 ? static_cast<int>(row % n[1]) : static_cast<int>(row / n[1]);
          const std::int64_t o = row * n[0];
          const float* g = A.g[d].data() + o;
          if (d == 0)
          {
            lineRow(n[0], 1, 2, n[0] - 1, g, g - 1, g + 1, fine.w[0].data() + o,
              fine.w[0].data() + o + 1, conductance ? conductance + o : nullptr);
          }
          else if (at % 2 == 1 && at + 1 < n[d])
          {
            // a lone last voxel is its own centre: an inner face that resists nothing
            const float* there = at + 2 < n[d] ? g + stride[d] : nullptr;
            lineRow(n[0], 0, 1, n[0], g, g - stride[d], there, fine.w[d].data() + o,
              fine.w[d].data() + o + stride[d], conductance ? conductance + o : nullptr);
          }
          else if (conductance)
          {
            std::fill(conductance + o, conductance + o + n[0], 0.f);
          }
        }
      });
  };
  for (int d = 0; d < 3; ++d)
  {
    if (fine.halved[d])
    {
      forLines(d, nullptr);
    }
  }
  // 2. each line's conductance goes to the coarse columns that its voxels are put between
  for (int d = 0; d < 3; ++d)
  {
    const float* lines = A.g[d].data();
    if (fine.halved[d])
    {
      forLines(d, fine.r.data());
      lines = fine.r.data();
    }
    gather(A, fine, coarse.A, lines, d, coarse.A.g[d].data(), parallelFor);
  }
  // Sinks stay with the parent: a strong one pulls its own voxel down, not the neighbour's.
  ForRows(parallelFor, rowsOf(coarse.A), A.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t row = begin; row < end; ++row)
      {
        const int J[3] = { 0, static_cast<int>(row % nc[1]), static_cast<int>(row / nc[1]) };
        int first[3];
        int last[3];
        for (int d = 1; d < 3; ++d)
        {
          first[d] = fine.halved[d] ? 2 * J[d] : J[d];
          last[d] = fine.halved[d] ? std::min(2 * J[d] + 1, n[d] - 1) : J[d];
        }
        float* sink = coarse.A.s.data() + row * nc[0];
        for (int k = first[2]; k <= last[2]; ++k)
        {
          for (int j = first[1]; j <= last[1]; ++j)
          {
            const float* s = A.s.data() + stride[1] * j + stride[2] * k;
            for (int i = 0; i < n[0]; ++i)
            {
              sink[fine.halved[0] ? i / 2 : i] += s[i];
            }
          }
        }
      }
    });
  // Where light has nowhere to go (a singular part), the coarsest voxel has neither.
  CloseIsolated(coarse.A, 1.f, parallelFor);
}

void Multigrid::gather(const DiffusionOperator& A, const Level& fine, const DiffusionOperator& C,
  const float* v, int along, float* out, const ParallelFor& parallelFor) const
{
  const std::array<int, 3>& n = A.dims;
  const std::array<int, 3>& nc = C.dims;
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  ForRows(parallelFor, rowsOf(C), A.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      Buffer<float> own(n[0] + 2);
      Buffer<float> next(n[0] + 2);
      for (std::int64_t row = begin; row < end; ++row)
      {
        std::fill(own.data(), own.data() + n[0], 0.f);
        std::fill(next.data(), next.data() + n[0], 0.f);
        const int J[3] = { 0, static_cast<int>(row % nc[1]), static_cast<int>(row / nc[1]) };
        int first[3];
        int last[3];
        for (int d = 1; d < 3; ++d)
        {
          first[d] = !fine.halved[d] ? J[d] : d == along ? 2 * J[d] + 1 : std::max(0, 2 * J[d] - 1);
          last[d] = !fine.halved[d] ? J[d]
            : d == along            ? std::min(2 * J[d] + 1, n[d] - 1)
                                    : std::min(2 * J[d] + 2, n[d] - 1);
        }
        for (int k = first[2]; k <= last[2]; ++k)
        {
          for (int j = first[1]; j <= last[1]; ++j)
          {
            const std::int64_t o = stride[1] * j + stride[2] * k;
            const int at[3] = { 0, j, k };
            // a line's weights are the mean of those at its two ends
            const bool ends = along >= 0 && at[along] + 1 < n[along];
            const std::int64_t other = ends ? stride[along] : 0;
            Weights weights[3];
            for (int d = 0; d < 3; ++d)
            {
              if (fine.halved[d] && d != along)
              {
                const std::uint8_t* w = fine.w[d].data() + o;
                const bool parent = d == 0 || at[d] / 2 == J[d];
                weights[d] = { w, w + other, parent ? 1.f : 0.f, (parent ? -0.5f : 0.5f) / 255.f };
              }
              else
              {
                weights[d] = { fine.noWeight.data(), fine.noWeight.data(), 1.f, 0.f };
              }
            }
            gatherRow(n[0], v + o, weights[0], weights[1], weights[2], own.data(), next.data());
          }
        }
        float* c = out + row * nc[0];
        if (fine.halved[0])
        {
          const float* p = own.data();
          const float* q = next.data();
          for (int i = 0; i < nc[0]; ++i)
          {
            c[i] = p[2 * i] + p[2 * i + 1] + q[2 * i - 1] + q[2 * i + 2];
          }
        }
        else
        {
          std::copy(own.data(), own.data() + nc[0], c);
        }
      }
    });
}

void Multigrid::prolong(const DiffusionOperator& A, const Level& fine, const Level& coarse,
  float* x, const ParallelFor& parallelFor) const
{
  const std::array<int, 3>& n = A.dims;
  const std::array<int, 3>& nc = coarse.A.dims;
  ForRows(parallelFor, rowsOf(A), A.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      Buffer<float> up[4];
      Buffer<float> side[4];
      for (int c = 0; c < 4; ++c)
      {
        up[c].allocate(n[0] + 1);
        side[c].allocate(n[0] + 1);
      }
      for (std::int64_t row = begin; row < end; ++row)
      {
        const int at[3] = { 0, static_cast<int>(row % n[1]), static_cast<int>(row / n[1]) };
        const std::int64_t o = row * n[0];
        // the parent's coordinate, and its neighbour's on this voxel's side
        int J[3][2];
        Weights weights[3];
        for (int d = 0; d < 3; ++d)
        {
          const int parent = fine.halved[d] ? at[d] / 2 : at[d];
          const int neighbour = parent + (at[d] % 2 ? 1 : -1);
          const bool inside = fine.halved[d] && neighbour >= 0 && neighbour < nc[d];
          J[d][0] = parent;
          J[d][1] = inside ? neighbour : parent;
          const std::uint8_t* w = fine.halved[d] ? fine.w[d].data() + o : fine.noWeight.data();
          weights[d] = { w, w, 1.f, -0.5f / 255.f };
        }
        for (int c = 0; c < 4; ++c)
        {
          const float* xc = coarse.x.data() +
            nc[0] * (J[1][c & 1] + static_cast<std::int64_t>(nc[1]) * J[2][c >> 1]);
          float* u = up[c].data();
          float* s = side[c].data();
          if (fine.halved[0])
          {
            for (int i = 0; i < nc[0]; ++i)
            {
              u[2 * i] = u[2 * i + 1] = xc[i];
              s[2 * i] = xc[i - 1];
              s[2 * i + 1] = xc[i + 1];
            }
          }
          else
          {
            std::copy(xc, xc + n[0], u);
          }
        }
        const float* const u[4] = { up[0].data(), up[1].data(), up[2].data(), up[3].data() };
        const float* const s[4] = { side[0].data(), side[1].data(), side[2].data(),
          side[3].data() };
        prolongRow(n[0], weights[0].here, weights[1].here, weights[2].here, u, s, x + o);
      }
    });
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
    float* r = fine.r.data();
    const int nx = A.dims[0];
    ForRows(parallelFor, rowsOf(A), A.size(),
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t row = begin; row < end; ++row)
        {
          residualRow(nx, facesOfRow(A, row), viewRow(A, x, row), b + row * nx, r + row * nx);
        }
      });
    this->gather(A, fine, coarse.A, r, -1, coarse.b.data(), parallelFor);
    this->cycle(l + 1, coarse.A, coarse.b.data(), coarse.x.data(), parallelFor);
    this->prolong(A, fine, coarse, x, parallelFor);
  }
  // 4. smooth: black then red
  for (int sweep = 0; sweep < this->sweeps; ++sweep)
  {
    relax(A, 1, b, x, parallelFor);
    relax(A, 0, b, x, parallelFor);
  }
}
} // namespace lighttransport
