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
using Weights = MultigridWeights;

/** A row's values and its four neighbouring rows; rows outside are zeros. */
struct RowView
{
  const float *x, *xS, *xN, *xB, *xT;
};
struct RowFaces
{
  const float *gx, *gy, *gyS, *gz, *gzB, *s;
};

RowView viewRow(const DiffusionOperator& A, const float* x, std::int64_t row, std::int64_t begin)
{
  const std::int64_t nx = A.dims[0];
  const std::int64_t ny = A.dims[1];
  const std::int64_t nz = A.dims[2];
  const std::int64_t j = row % ny;
  const std::int64_t k = row / ny;
  const float* zeros = A.zeros.data();
  return { x + begin, j > 0 ? x + begin - nx : zeros, j + 1 < ny ? x + begin + nx : zeros,
    k > 0 ? x + begin - nx * ny : zeros, k + 1 < nz ? x + begin + nx * ny : zeros };
}

RowFaces facesOfRow(const DiffusionOperator& A, std::int64_t row, std::int64_t begin)
{
  const std::int64_t nx = A.dims[0];
  const std::int64_t ny = A.dims[1];
  const std::int64_t j = row % ny;
  const std::int64_t k = row / ny;
  const float* zeros = A.zeros.data();
  return { A.g[0].data() + begin, A.g[1].data() + begin, j > 0 ? A.g[1].data() + begin - nx : zeros,
    A.g[2].data() + begin, k > 0 ? A.g[2].data() + begin - nx * ny : zeros, A.s.data() + begin };
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
 * The lines through the faces f = first, first + step, ... < last of a row, from
 * coarse centre to coarse centre: half the inner face on either side (`below`,
 * `above`) in series with the face between. Where the voxel above is its own centre
 * (f >= paired, or no `above`), there is no inner face there. Writes the weight of the
 * other parent for both voxels at the face.
 */
LIGHTTRANSPORT_SIMD
void lineRow(int first, int last, int step, int paired, const float* between, const float* below,
  const float* above, std::uint8_t* w, std::uint8_t* wNext)
{
  for (int i = first; i < last; i += step)
  {
    const float g = between[i];
    const float here = halfResistance(below[i]);
    const float there = above && i < paired ? halfResistance(above[i]) : 0.f;
    const float whole = here + 1.f / (g > 1e-30f ? g : 1e-30f) + there;
    const float open = g > 1e-30f ? 255.f / whole : 0.f;
    w[i] = static_cast<std::uint8_t>(here * open + 0.5f);
    wNext[i] = static_cast<std::uint8_t>(there * open + 0.5f);
  }
}

/**
 * Adds the conductance of the lines along one axis from a voxel to its parent
 * (half the inner face) and to its parent's neighbour (the face between in
 * series with half the neighbour's inner face). Null: no such face; a voxel that is
 * its own centre has no inner face and is tied to its parent without resistance.
 */
LIGHTTRANSPORT_SIMD
void tieRow(int first, int last, int step, const float* inner, const float* between,
  const float* beyond, float* tie)
{
  for (int i = first; i < last; i += step)
  {
    const float parent = inner ? 2.f * inner[i] : 1e30f;
    const float far = between && between[i] > 1e-30f
      ? 1.f / (1.f / between[i] + (beyond ? halfResistance(beyond[i]) : 0.f))
      : 0.f;
    tie[i] += parent + far;
  }
}

/** kept = G / (G + s), what is left of a sink seen from the parents is s kept. */
LIGHTTRANSPORT_SIMD
void keepRow(int n, const float* LIGHTTRANSPORT_RESTRICT tie,
  const float* LIGHTTRANSPORT_RESTRICT s, std::uint8_t* LIGHTTRANSPORT_RESTRICT kept,
  float* LIGHTTRANSPORT_RESTRICT sink)
{
  for (int i = 0; i < n; ++i)
  {
    const float sum = tie[i] + s[i];
    const float part = sum > 1e-30f ? tie[i] / sum : 1.f;
    kept[i] = static_cast<std::uint8_t>(255.f * part + 0.5f);
    sink[i] = s[i] * part;
  }
}

/** own += v kept fy fz (1 - wx), next += v kept fy fz wx; kept may be null: 1 */
LIGHTTRANSPORT_SIMD
void gatherRow(int n, const float* LIGHTTRANSPORT_RESTRICT v, const std::uint8_t* kept,
  const Weights& x, const Weights& y, const Weights& z, float* LIGHTTRANSPORT_RESTRICT own,
  float* LIGHTTRANSPORT_RESTRICT next)
{
  constexpr float unit = 1.f / 255.f;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT x0 = x.here;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT x1 = x.there;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT y0 = y.here;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT y1 = y.there;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT z0 = z.here;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT z1 = z.there;
  const float cy = y.factor, sy = y.slope, cz = z.factor, sz = z.slope;
  for (int i = 0; i < n; ++i)
  {
    const float t = v[i] * (kept ? unit * static_cast<float>(kept[i]) : 1.f) *
      (cy + sy * static_cast<float>(y0[i] + y1[i])) * (cz + sz * static_cast<float>(z0[i] + z1[i]));
    const float u = t * (static_cast<float>(x0[i] + x1[i]) * (0.5f / 255.f));
    own[i] += t - u;
    next[i] += u;
  }
}

/** gatherRow for the face between coarse voxels and the inner faces below and above it. */
LIGHTTRANSPORT_SIMD
void gatherFacesRow(int n, const float* LIGHTTRANSPORT_RESTRICT between,
  const float* LIGHTTRANSPORT_RESTRICT below, const float* LIGHTTRANSPORT_RESTRICT above,
  const Weights& x, const Weights& y, const Weights& z, float* LIGHTTRANSPORT_RESTRICT own,
  float* LIGHTTRANSPORT_RESTRICT next, std::size_t room)
{
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT x0 = x.here;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT x1 = x.there;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT y0 = y.here;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT y1 = y.there;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT z0 = z.here;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT z1 = z.there;
  const float cy = y.factor, sy = y.slope, cz = z.factor, sz = z.slope;
  float* LIGHTTRANSPORT_RESTRICT own1 = own + room;
  float* LIGHTTRANSPORT_RESTRICT own2 = own + 2 * room;
  float* LIGHTTRANSPORT_RESTRICT next1 = next + room;
  float* LIGHTTRANSPORT_RESTRICT next2 = next + 2 * room;
  for (int i = 0; i < n; ++i)
  {
    const float t =
      (cy + sy * static_cast<float>(y0[i] + y1[i])) * (cz + sz * static_cast<float>(z0[i] + z1[i]));
    const float u = t * (static_cast<float>(x0[i] + x1[i]) * (0.5f / 255.f));
    const float p = t - u;
    own[i] += between[i] * p;
    next[i] += between[i] * u;
    own1[i] += below[i] * p;
    next1[i] += below[i] * u;
    own2[i] += above[i] * p;
    next2[i] += above[i] * u;
  }
}

/** x += kept times the tensor product of the three weights on eight coarse values. */
LIGHTTRANSPORT_SIMD
void prolongRow(int n, const std::uint8_t* LIGHTTRANSPORT_RESTRICT wx,
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT wy, const std::uint8_t* LIGHTTRANSPORT_RESTRICT wz,
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT kept, const float* const* up,
  const float* const* side, float* LIGHTTRANSPORT_RESTRICT x)
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
    x[i] += unit * static_cast<float>(kept[i]) * (y0 + c * (y1 - y0));
  }
}

/** (i + j + k + colour) & 1 of the first value of a row's span. */
int parityOf(const DiffusionOperator& A, std::int64_t row, std::int64_t begin, int colour)
{
  return static_cast<int>(
    (begin - row * A.dims[0] + row % A.dims[1] + row / A.dims[1] + colour) & 1);
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
  const int ny = A.dims[1];
  const int nz = A.dims[2];
  const bool alongZ = nz >= ny;
  const std::int64_t length = alongZ ? nz : ny;
  const std::int64_t pairs = std::max<std::int64_t>(1, length / (2 * thickness));
  for (int odd = 0; odd < 2; ++odd)
  {
    ForRows(parallelFor, pairs, A.activeSize,
      [&](std::int64_t begin, std::int64_t end)
      {
        std::vector<float> tmp(static_cast<std::size_t>(A.dims[0]));
        for (std::int64_t pair = begin; pair < end; ++pair)
        {
          const int from = static_cast<int>(length * (2 * pair + odd) / (2 * pairs));
          const int to = static_cast<int>(length * (2 * pair + odd + 1) / (2 * pairs));
          for (int k = alongZ ? from : 0; k < (alongZ ? to : nz); ++k)
          {
            for (int j = alongZ ? 0 : from; j < (alongZ ? ny : to); ++j)
            {
              const std::int64_t row = j + static_cast<std::int64_t>(ny) * k;
              const Span span = A.span(row);
              if (span.begin < span.end)
              {
                const std::int64_t o = row * A.dims[0] + span.begin;
                const RowView v = viewRow(A, x, row, o);
                relaxRow(span.end - span.begin, parityOf(A, row, o, colour), facesOfRow(A, row, o),
                  v.xS, v.xN, v.xB, v.xT, b + o, tmp.data(), x + o);
              }
            }
          }
        }
      });
  }
}

void start(
  const DiffusionOperator& A, int colour, const float* b, float* x, const ParallelFor& parallelFor)
{
  ForEachRow(A, parallelFor,
    [&](std::int64_t row, std::int64_t o, int n)
    { startRow(n, parityOf(A, row, o, colour), facesOfRow(A, row, o), b + o, x + o); });
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
  this->activeRows.clear();
  this->spans.clear();
  this->activeSize = this->size();
}

void DiffusionOperator::restrictTo(std::vector<Span> rowSpans)
{
  this->spans = std::move(rowSpans);
  this->activeRows.clear();
  this->activeSize = 0;
  for (std::size_t r = 0; r < this->spans.size(); ++r)
  {
    if (this->spans[r].begin < this->spans[r].end)
    {
      this->activeRows.push_back(static_cast<std::int64_t>(r));
      this->activeSize += this->spans[r].end - this->spans[r].begin;
    }
  }
}

std::int64_t DiffusionOperator::bytes() const
{
  return 4 * static_cast<std::int64_t>(sizeof(float)) * this->activeSize +
    static_cast<std::int64_t>(
      this->spans.size() * sizeof(Span) + this->activeRows.size() * sizeof(std::int64_t));
}

void ForEachRow(const DiffusionOperator& A, const ParallelFor& parallelFor, const RowBody& body)
{
  ForRows(parallelFor, A.numberOfRows(), A.activeSize,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t t = begin; t < end; ++t)
      {
        const std::int64_t row = A.row(t);
        const Span span = A.span(row);
        body(row, row * A.dims[0] + span.begin, span.end - span.begin);
      }
    });
}

double SumEachRow(const DiffusionOperator& A, const ParallelFor& parallelFor, const RowSum& body)
{
  return SumRows(parallelFor, A.numberOfRows(), A.activeSize,
    [&](std::int64_t t)
    {
      const std::int64_t row = A.row(t);
      const Span span = A.span(row);
      return body(row, row * A.dims[0] + span.begin, span.end - span.begin);
    });
}

double Apply(const DiffusionOperator& A, const float* x, float* y, const ParallelFor& parallelFor)
{
  return SumEachRow(A, parallelFor,
    [&](std::int64_t row, std::int64_t o, int n)
    { return applyRow(n, facesOfRow(A, row, o), viewRow(A, x, row, o), y + o); });
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
    // what the domain touches of each: the rest of the memory stays with the system
    const DiffusionOperator& A = &level == &this->levels.front() ? *this->finest : level.A;
    const std::int64_t perVoxel = (level.x.empty() ? 0 : 8) + (level.r.empty() ? 0 : 5) +
      static_cast<std::int64_t>(!level.w[0].empty()) + !level.w[1].empty() + !level.w[2].empty();
    sum += level.A.bytes() + A.activeSize * perVoxel;
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
        mean[d] = SumEachRow(*fine, parallelFor,
                    [&](std::int64_t, std::int64_t o, int n)
                    {
                      double sum = 0.;
                      for (std::int64_t i = o; i < o + n; ++i)
                      {
                        sum += static_cast<double>(g[i]);
                      }
                      return sum;
                    }) *
          fine->dims[d] / (fine->dims[d] - 1.);
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
  fine.kept.allocate(A.size());
  fine.r.allocate(A.size());
  coarse.A.allocate(nc);
  coarse.x.allocate(coarse.A.size());
  coarse.b.allocate(coarse.A.size());
  if (!A.spans.empty())
  {
    std::vector<Span> spans(static_cast<std::size_t>(nc[1]) * nc[2], Span{ nc[0], 0 });
    for (const std::int64_t row : A.activeRows)
    {
      const std::int64_t J = row % n[1] / (fine.halved[1] ? 2 : 1);
      const std::int64_t K = row / n[1] / (fine.halved[2] ? 2 : 1);
      Span& span = spans[static_cast<std::size_t>(J + nc[1] * K)];
      const Span child = A.span(row);
      span.begin = std::min(span.begin, fine.halved[0] ? child.begin / 2 : child.begin);
      span.end = std::max(span.end, fine.halved[0] ? (child.end + 1) / 2 : child.end);
    }
    coarse.A.restrictTo(std::move(spans));
  }
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };

  // 3. the weights, from the lines through the coarse faces
  const auto forLines = [&](int d)
  {
    ForEachRow(A, parallelFor,
      [&](std::int64_t row, std::int64_t o, int length)
      {
        if (d == 0)
        {
          // faces after the odd voxels; the last voxel of an odd row is its own centre
          const std::int64_t begin = row * n[0];
          const int first = static_cast<int>(o - begin) | 1;
          const int last = std::min(static_cast<int>(o - begin) + length, n[0] - 1);
          const float* g = A.g[0].data() + begin;
          lineRow(first, last, 2, n[0] - 2, g, g - 1, g + 1, fine.w[0].data() + begin,
            fine.w[0].data() + begin + 1);
          return;
        }
        const int at = d == 1 ? static_cast<int>(row % n[1]) : static_cast<int>(row / n[1]);
        if (at % 2 == 1 && at + 1 < n[d])
        {
          const float* g = A.g[d].data() + o;
          const float* above = at + 2 < n[d] ? g + stride[d] : nullptr;
          lineRow(0, length, 1, length, g, g - stride[d], above, fine.w[d].data() + o,
            fine.w[d].data() + o + stride[d]);
        }
      });
  };
  for (int d = 0; d < 3; ++d)
  {
    if (fine.halved[d])
    {
      forLines(d);
    }
  }
  // 2. faces go to the coarse columns that their voxels are put between
  for (int d = 0; d < 3; ++d)
  {
    if (fine.halved[d])
    {
      this->gatherFaces(A, fine, coarse.A, d, coarse.A.g[d].data(), parallelFor);
    }
    else
    {
      gather(A, fine, coarse.A, A.g[d].data(), nullptr, d, coarse.A.g[d].data(), parallelFor);
    }
  }
  // A sink pulls its own voxel down, and the parents only as far as the voxel is tied to them:
  // the balance of flux there has the sink beside the lines.
  ForEachRow(A, parallelFor,
    [&](std::int64_t row, std::int64_t o, int length)
    {
      static thread_local std::vector<float> store;
      store.assign(static_cast<std::size_t>(n[0]), 0.f);
      const int begin = static_cast<int>(o - row * n[0]);
      const int at[3] = { 0, static_cast<int>(row % n[1]), static_cast<int>(row / n[1]) };
      float* tie = store.data() + begin;
      for (int d = 0; d < 3; ++d)
      {
        if (!fine.halved[d])
        {
          continue;
        }
        const float* g = A.g[d].data() + o;
        if (d > 0)
        {
          const bool odd = at[d] % 2 == 1;
          const std::int64_t t = stride[d];
          const float* inner = odd ? g - t : at[d] + 1 < n[d] ? g : nullptr;
          const float* between = odd ? (at[d] + 1 < n[d] ? g : nullptr)
            : at[d] > 0              ? g - t
                                     : nullptr;
          const float* beyond = odd ? (at[d] + 2 < n[d] ? g + t : nullptr)
            : at[d] > 1             ? g - 2 * t
                                    : nullptr;
          tieRow(0, length, 1, inner, between, beyond, tie);
          continue;
        }
        const int lone = n[0] % 2 == 1 ? n[0] - 1 : n[0]; // its own centre
        const float* whole = A.g[0].data() + row * n[0];
        float* all = store.data();
        // odd voxels, then even ones; faces outside the row are 0
        tieRow(begin | 1, std::min(begin + length, n[0] - 2), 2, whole - 1, whole, whole + 1, all);
        for (int i = std::max(begin | 1, n[0] - 2 + (n[0] % 2 == 0 ? 0 : 1)); i < begin + length;
             i += 2)
        {
          tieRow(i, i + 1, 2, whole - 1, i + 1 < n[0] ? whole : nullptr, nullptr, all);
        }
        for (int i = begin + (begin & 1); i < begin + length; i += 2)
        {
          tieRow(i, i + 1, 2, i == lone ? nullptr : whole, i > 0 ? whole - 1 : nullptr,
            i > 1 ? whole - 2 : nullptr, all);
        }
      }
      keepRow(length, tie, A.s.data() + o, fine.kept.data() + o, fine.r.data() + o);
    });
  gather(A, fine, coarse.A, fine.r.data(), nullptr, -1, coarse.A.s.data(), parallelFor);
  // Where light has nowhere to go (a singular part), the coarsest voxel has neither.
  CloseIsolated(coarse.A, 1.f, parallelFor);
}

Multigrid::Footprint Multigrid::footprint(
  const Level& fine, const std::array<int, 3>& n, const int J[3], int along) const
{
  Footprint rows;
  for (int d = 1; d < 3; ++d)
  {
    rows.first[d] = !fine.halved[d] ? J[d] : d == along ? 2 * J[d] + 1 : std::max(0, 2 * J[d] - 1);
    rows.last[d] = !fine.halved[d] ? J[d]
      : d == along                 ? std::min(2 * J[d] + 1, n[d] - 1)
                                   : std::min(2 * J[d] + 2, n[d] - 1);
  }
  return rows;
}

void Multigrid::weigh(const Level& fine, const int at[3], const int J[3], std::int64_t f, int along,
  std::int64_t other, Weights weights[3]) const
{
  for (int d = 0; d < 3; ++d)
  {
    if (fine.halved[d] && d != along)
    {
      const std::uint8_t* w = fine.w[d].data() + f;
      const bool parent = d == 0 || at[d] / 2 == J[d];
      weights[d] = { w, w + other, parent ? 1.f : 0.f, (parent ? -0.5f : 0.5f) / 255.f };
    }
    else
    {
      weights[d] = { fine.noWeight.data(), fine.noWeight.data(), 1.f, 0.f };
    }
  }
}

void Multigrid::gather(const DiffusionOperator& A, const Level& fine, const DiffusionOperator& C,
  const float* v, const std::uint8_t* kept, int along, float* out,
  const ParallelFor& parallelFor) const
{
  const std::array<int, 3>& n = A.dims;
  const std::array<int, 3>& nc = C.dims;
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  ForEachRow(C, parallelFor,
    [&](std::int64_t row, std::int64_t o, int length)
    {
      // own: what goes to the parent; next: to its neighbour along x. Two zeros on either side.
      static thread_local std::vector<float> store;
      store.assign(2 * static_cast<std::size_t>(n[0] + 4), 0.f);
      float* own = store.data() + 2;
      float* next = own + n[0] + 4;
      const int J[3] = { 0, static_cast<int>(row % nc[1]), static_cast<int>(row / nc[1]) };
      const Footprint rows = this->footprint(fine, n, J, along);
      for (int k = rows.first[2]; k <= rows.last[2]; ++k)
      {
        for (int j = rows.first[1]; j <= rows.last[1]; ++j)
        {
          const Span span = A.span(j + static_cast<std::int64_t>(n[1]) * k);
          if (span.begin >= span.end)
          {
            continue;
          }
          const std::int64_t f = span.begin + stride[1] * j + stride[2] * k;
          const int at[3] = { 0, j, k };
          // a face's weights are the mean of those at its two ends
          const bool ends = along >= 0 && at[along] + 1 < n[along];
          Weights weights[3];
          this->weigh(fine, at, J, f, along, ends ? stride[along] : 0, weights);
          gatherRow(span.end - span.begin, v + f, kept ? kept + f : nullptr, weights[0], weights[1],
            weights[2], own + span.begin, next + span.begin);
        }
      }
      const int begin = static_cast<int>(o - row * nc[0]);
      for (int i = begin; i < begin + length; ++i)
      {
        out[row * nc[0] + i] =
          fine.halved[0] ? own[2 * i] + own[2 * i + 1] + next[2 * i - 1] + next[2 * i + 2] : own[i];
      }
    });
}

void Multigrid::gatherFaces(const DiffusionOperator& A, const Level& fine,
  const DiffusionOperator& C, int along, float* out, const ParallelFor& parallelFor) const
{
  const std::array<int, 3>& n = A.dims;
  const std::array<int, 3>& nc = C.dims;
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  constexpr float noResistance = 1e20f; // of the inner face of a voxel that is its own centre
  ForEachRow(C, parallelFor,
    [&](std::int64_t row, std::int64_t o, int length)
    {
      static thread_local std::vector<float> store;
      const std::size_t room = static_cast<std::size_t>(n[0]) + 4;
      store.assign(9 * room, 0.f);
      float* own = store.data() + 2;
      float* next = own + 3 * room;
      float* masked = next + 3 * room;
      const int J[3] = { 0, static_cast<int>(row % nc[1]), static_cast<int>(row / nc[1]) };
      const Footprint rows = this->footprint(fine, n, J, along);
      for (int k = rows.first[2]; k <= rows.last[2]; ++k)
      {
        for (int j = rows.first[1]; j <= rows.last[1]; ++j)
        {
          const Span span = A.span(j + static_cast<std::int64_t>(n[1]) * k);
          const int at[3] = { 0, j, k };
          if (span.begin >= span.end || (along > 0 && at[along] + 1 >= n[along]))
          {
            continue;
          }
          const std::int64_t f = span.begin + stride[1] * j + stride[2] * k;
          Weights weights[3];
          this->weigh(fine, at, J, f, along, stride[along], weights);
          const float* g = A.g[along].data() + f;
          const float* between = g;
          const float* below = g - stride[along];
          const float* above = g + stride[along];
          const int count = span.end - span.begin;
          if (along == 0)
          {
            // only the faces after odd voxels lie between coarse ones
            for (int i = 0; i < count; ++i)
            {
              const int x = span.begin + i;
              const float face = (x & 1) && x + 1 < n[0] ? 1.f : 0.f;
              masked[i] = face * g[i];
              masked[i + room] = face * g[i - 1];
              masked[i + 2 * room] = x + 2 < n[0] ? face * g[i + 1] : face * noResistance;
            }
            between = masked;
            below = masked + room;
            above = masked + 2 * room;
          }
          else if (at[along] + 2 >= n[along])
          {
            std::fill(masked, masked + count, noResistance);
            above = masked;
          }
          gatherFacesRow(count, between, below, above, weights[0], weights[1], weights[2],
            own + span.begin, next + span.begin, room);
        }
      }
      // the lines of a coarse face mix between the faces: sums in series (an upper bound, which
      // keeps bent corridors open; straight lines in parallel would be a lower one)
      const int begin = static_cast<int>(o - row * nc[0]);
      for (int i = begin; i < begin + length; ++i)
      {
        float sum[3];
        for (int s = 0; s < 3; ++s)
        {
          const float* p = own + static_cast<std::size_t>(s) * room;
          const float* q = next + static_cast<std::size_t>(s) * room;
          sum[s] = fine.halved[0] ? p[2 * i] + p[2 * i + 1] + q[2 * i - 1] + q[2 * i + 2] : p[i];
        }
        const bool open = sum[0] > 1e-25f && sum[1] > 1e-25f && sum[2] > 1e-25f;
        out[row * nc[0] + i] = open ? 1.f / (0.5f / sum[1] + 1.f / sum[0] + 0.5f / sum[2]) : 0.f;
      }
    });
}

void Multigrid::prolong(const DiffusionOperator& A, const Level& fine, const Level& coarse,
  float* x, const ParallelFor& parallelFor) const
{
  const std::array<int, 3>& n = A.dims;
  const std::array<int, 3>& nc = coarse.A.dims;
  ForEachRow(A, parallelFor,
    [&](std::int64_t row, std::int64_t o, int length)
    {
      static thread_local std::vector<float> store;
      const std::size_t room = static_cast<std::size_t>(n[0]) + 2;
      store.resize(8 * room);
      const int at[3] = { 0, static_cast<int>(row % n[1]), static_cast<int>(row / n[1]) };
      const int begin = static_cast<int>(o - row * n[0]);
      // the parent's coordinate, and its neighbour's on this voxel's side
      int J[3][2];
      const std::uint8_t* w[3];
      for (int d = 0; d < 3; ++d)
      {
        const int parent = fine.halved[d] ? at[d] / 2 : at[d];
        const int neighbour = parent + (at[d] % 2 ? 1 : -1);
        const bool inside = fine.halved[d] && neighbour >= 0 && neighbour < nc[d];
        J[d][0] = parent;
        J[d][1] = inside ? neighbour : parent;
        w[d] = fine.halved[d] ? fine.w[d].data() + o : fine.noWeight.data();
      }
      const float* up[4];
      const float* side[4];
      for (int c = 0; c < 4; ++c)
      {
        const float* xc =
          coarse.x.data() + nc[0] * (J[1][c & 1] + static_cast<std::int64_t>(nc[1]) * J[2][c >> 1]);
        float* u = store.data() + 2 * static_cast<std::size_t>(c) * room;
        float* s = u + room;
        if (fine.halved[0])
        {
          for (int i = begin / 2; i <= (begin + length - 1) / 2; ++i)
          {
            u[2 * i] = u[2 * i + 1] = xc[i];
            s[2 * i] = xc[i - 1];
            s[2 * i + 1] = xc[i + 1];
          }
        }
        else
        {
          std::copy(xc + begin, xc + begin + length, u + begin);
          std::copy(xc + begin, xc + begin + length, s + begin);
        }
        up[c] = u + begin;
        side[c] = s + begin;
      }
      prolongRow(length, w[0], w[1], w[2], fine.kept.data() + o, up, side, x + o);
    });
}

void CloseIsolated(DiffusionOperator& A, float isolated, const ParallelFor& parallelFor)
{
  ForEachRow(A, parallelFor,
    [&](std::int64_t row, std::int64_t o, int n)
    {
      const RowFaces f = facesOfRow(A, row, o);
      float* s = A.s.data() + o;
      for (int i = 0; i < n; ++i)
      {
        const float den = f.gx[i] + f.gx[i - 1] + f.gy[i] + f.gyS[i] + f.gz[i] + f.gzB[i] + s[i];
        if (!(den > 1e-30f))
        {
          s[i] = isolated;
        }
      }
    });
}

//------------------------------------------------------------------------------
void Multigrid::cycle(const float* b, float* x, const ParallelFor& parallelFor)
{
  this->cycle(0, b, x, true, parallelFor);
}

void Multigrid::cycle(
  std::size_t l, const float* b, float* x, bool fromZero, const ParallelFor& parallelFor)
{
  const DiffusionOperator& A = this->operatorOf(l);
  Level& fine = this->levels[l];
  // 4. smooth: red then black
  for (int sweep = 0; sweep < this->sweeps; ++sweep)
  {
    if (sweep == 0 && fromZero)
    {
      start(A, 0, b, x, parallelFor);
    }
    else
    {
      relax(A, 0, b, x, parallelFor);
    }
    relax(A, 1, b, x, parallelFor);
  }
  if (l + 1 < this->levels.size())
  {
    Level& coarse = this->levels[l + 1];
    float* r = fine.r.data();
    ForEachRow(A, parallelFor,
      [&](std::int64_t row, std::int64_t o, int n)
      { residualRow(n, facesOfRow(A, row, o), viewRow(A, x, row, o), b + o, r + o); });
    this->gather(A, fine, coarse.A, r, fine.kept.data(), -1, coarse.b.data(), parallelFor);
    this->cycle(l + 1, coarse.b.data(), coarse.x.data(), true, parallelFor);
    this->prolong(A, fine, coarse, x, parallelFor);
  }
  // 4. smooth: black then red
  for (int sweep = 0; sweep < this->sweeps; ++sweep)
  {
    relax(A, 1, b, x, parallelFor);
    relax(A, 0, b, x, parallelFor);
  }
}

void Multigrid::fullCycle(const float* b, float* x, const ParallelFor& parallelFor)
{
  const std::size_t last = this->levels.size() - 1;
  const auto rhs = [&](std::size_t l) { return l == 0 ? b : this->levels[l].b.data(); };
  const auto field = [&](std::size_t l) { return l == 0 ? x : this->levels[l].x.data(); };
  for (std::size_t l = 0; l < last; ++l)
  {
    this->gather(this->operatorOf(l), this->levels[l], this->levels[l + 1].A, rhs(l),
      this->levels[l].kept.data(), -1, this->levels[l + 1].b.data(), parallelFor);
  }
  this->cycle(last, rhs(last), field(last), true, parallelFor);
  for (std::size_t l = last; l-- > 0;)
  {
    const DiffusionOperator& A = this->operatorOf(l);
    // The coarser cycles below use the coarser right-hand sides: this one's is still in place,
    // since a cycle on level l + 1 writes those of l + 2 and beyond.
    ForEachRow(A, parallelFor,
      [&](std::int64_t, std::int64_t o, int n) { std::fill(field(l) + o, field(l) + o + n, 0.f); });
    this->prolong(A, this->levels[l], this->levels[l + 1], field(l), parallelFor);
    this->cycle(l, rhs(l), field(l), false, parallelFor);
  }
}
} // namespace lighttransport
