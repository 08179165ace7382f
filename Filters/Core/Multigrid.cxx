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

/** A tile of rows has so many values per plane, and so many planes: see skew(). */
constexpr std::int64_t TileValues = 4096;
constexpr int TilePlanes = 16;

/** The set-up goes through so many coarse planes, or values of them, at a time. */
constexpr int SlabPlanes = 8;
constexpr std::int64_t SlabValues = 32768;

/** A coarse diagonal is at least this part of Galerkin's, see Multigrid::raise. */
constexpr float LeastPart = 0.3f;

/** Levels 1 to this take two steps of conjugate gradients, see Multigrid::solveCoarse. */
constexpr std::size_t AcceleratedLevels = 2;

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

/**
 * x = (b + sum g x_j) / (sum g + s) on the voxels i of the row with (i + parity) even. All are
 * computed, into tmp, which keeps the loops straight; and a loop in place would read values
 * that are still on their way to the cache.
 */
LIGHTTRANSPORT_SIMD
void relaxRow(int n, int parity, const RowFaces& f, const RowView& v,
  const float* LIGHTTRANSPORT_RESTRICT b, float* LIGHTTRANSPORT_RESTRICT tmp, float* x)
{
  const float* LIGHTTRANSPORT_RESTRICT gx = f.gx;
  const float* LIGHTTRANSPORT_RESTRICT gy = f.gy;
  const float* LIGHTTRANSPORT_RESTRICT gyS = f.gyS;
  const float* LIGHTTRANSPORT_RESTRICT gz = f.gz;
  const float* LIGHTTRANSPORT_RESTRICT gzB = f.gzB;
  const float* LIGHTTRANSPORT_RESTRICT s = f.s;
  const float* LIGHTTRANSPORT_RESTRICT xS = v.xS;
  const float* LIGHTTRANSPORT_RESTRICT xN = v.xN;
  const float* LIGHTTRANSPORT_RESTRICT xB = v.xB;
  const float* LIGHTTRANSPORT_RESTRICT xT = v.xT;
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

LIGHTTRANSPORT_SIMD
double dotRow(int n, const float* LIGHTTRANSPORT_RESTRICT a, const float* LIGHTTRANSPORT_RESTRICT b)
{
  double dot[8] = { 0., 0., 0., 0., 0., 0., 0., 0. };
  int i = 0;
  for (; i + 8 <= n; i += 8)
  {
    for (int l = 0; l < 8; ++l)
    {
      dot[l] += static_cast<double>(a[i + l]) * static_cast<double>(b[i + l]);
    }
  }
  for (; i < n; ++i)
  {
    dot[0] += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  }
  return ((dot[0] + dot[4]) + (dot[1] + dot[5])) + ((dot[2] + dot[6]) + (dot[3] + dot[7]));
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
  return dotRow(n, x, y);
}

/** p = z + beta p, y = A z + beta y; returns p . y */
LIGHTTRANSPORT_SIMD
double advanceRow(int n, const RowFaces& f, const RowView& v, float beta,
  float* LIGHTTRANSPORT_RESTRICT p, float* LIGHTTRANSPORT_RESTRICT y)
{
  const float* LIGHTTRANSPORT_RESTRICT gx = f.gx;
  const float* LIGHTTRANSPORT_RESTRICT gy = f.gy;
  const float* LIGHTTRANSPORT_RESTRICT gyS = f.gyS;
  const float* LIGHTTRANSPORT_RESTRICT gz = f.gz;
  const float* LIGHTTRANSPORT_RESTRICT gzB = f.gzB;
  const float* LIGHTTRANSPORT_RESTRICT s = f.s;
  const float* z = v.x;
  const float* zS = v.xS;
  const float* zN = v.xN;
  const float* zB = v.xB;
  const float* zT = v.xT;
  for (int i = 0; i < n; ++i)
  {
    const float c = z[i];
    p[i] = c + beta * p[i];
    y[i] = gx[i] * (c - z[i + 1]) + gx[i - 1] * (c - z[i - 1]) + gy[i] * (c - zN[i]) +
      gyS[i] * (c - zS[i]) + gz[i] * (c - zT[i]) + gzB[i] * (c - zB[i]) + s[i] * c + beta * y[i];
  }
  return dotRow(n, p, y);
}

LIGHTTRANSPORT_SIMD
double sumRow(int n, const float* LIGHTTRANSPORT_RESTRICT a)
{
  double sums[8] = { 0., 0., 0., 0., 0., 0., 0., 0. };
  int i = 0;
  for (; i + 8 <= n; i += 8)
  {
    for (int l = 0; l < 8; ++l)
    {
      sums[l] += static_cast<double>(a[i + l]);
    }
  }
  for (; i < n; ++i)
  {
    sums[0] += static_cast<double>(a[i]);
  }
  return ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
}

/** b -= t v */
LIGHTTRANSPORT_SIMD
void subtractRow(
  int n, float t, const float* LIGHTTRANSPORT_RESTRICT v, float* LIGHTTRANSPORT_RESTRICT b)
{
  for (int i = 0; i < n; ++i)
  {
    b[i] -= t * v[i];
  }
}

/** y = c1 x + c2 y */
LIGHTTRANSPORT_SIMD
void mixRow(int n, float c1, const float* LIGHTTRANSPORT_RESTRICT x, float c2,
  float* LIGHTTRANSPORT_RESTRICT y)
{
  for (int i = 0; i < n; ++i)
  {
    y[i] = c1 * x[i] + c2 * y[i];
  }
}

LIGHTTRANSPORT_SIMD
void closeRow(int n, const RowFaces& f, float isolated, float* LIGHTTRANSPORT_RESTRICT s)
{
  const float* gx = f.gx;
  const float* gy = f.gy;
  const float* gyS = f.gyS;
  const float* gz = f.gz;
  const float* gzB = f.gzB;
  for (int i = 0; i < n; ++i)
  {
    const float den = gx[i] + gx[i - 1] + gy[i] + gyS[i] + gz[i] + gzB[i] + s[i];
    s[i] = den > 1e-30f ? s[i] : isolated;
  }
}

/** Resistance of half a face; a closed one is as good as infinite. */
inline float halfResistance(float g)
{
  return 0.5f / (g > 1e-30f ? g : 1e-30f);
}

/** What the two halves of a line and the face between them weigh. */
struct Line
{
  float here, there, open;
};
LIGHTTRANSPORT_INLINE Line lineThrough(float between, float below, float above, bool paired)
{
  Line line;
  line.here = halfResistance(below);
  line.there = paired ? halfResistance(above) : 0.f;
  const float whole = line.here + 1.f / (between > 1e-30f ? between : 1e-30f) + line.there;
  line.open = between > 1e-30f ? 255.f / whole : 0.f;
  return line;
}

/**
 * The lines through the faces after the odd voxels i of a row, first <= i < last, from coarse
 * centre to coarse centre: half the inner face on either side in series with the face between.
 * From `paired` on the voxel above is its own centre: there is no inner face there. Writes the
 * weight of the other parent for both voxels at the face.
 */
LIGHTTRANSPORT_SIMD
void lineAlong(int first, int last, int paired, const float* g, std::uint8_t* w)
{
  for (int i = first; i < last; i += 2)
  {
    const Line line = lineThrough(g[i], g[i - 1], g[i + 1], i < paired);
    w[i] = static_cast<std::uint8_t>(line.here * line.open + 0.5f);
    w[i + 1] = static_cast<std::uint8_t>(line.there * line.open + 0.5f);
  }
}

/** The same across rows, for the voxels below (or above) the faces; `above` may be null. */
LIGHTTRANSPORT_SIMD
void lineAcross(int n, const float* between, const float* below, const float* above, bool isAbove,
  std::uint8_t* LIGHTTRANSPORT_RESTRICT w)
{
  const bool paired = above != nullptr;
  const float* top = paired ? above : below;
  for (int i = 0; i < n; ++i)
  {
    const Line line = lineThrough(between[i], below[i], top[i], paired);
    w[i] = static_cast<std::uint8_t>((isAbove ? line.there : line.here) * line.open + 0.5f);
  }
}

/** The red voxels 2 I + odd of a row, first <= I < last. */
LIGHTTRANSPORT_SIMD
void packRow(int first, int last, int odd, const std::uint8_t* LIGHTTRANSPORT_RESTRICT all,
  std::uint8_t* LIGHTTRANSPORT_RESTRICT red)
{
  const std::uint8_t* from = all + odd;
  for (int I = first; I < last; ++I)
  {
    red[I] = from[2 * I];
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
  constexpr float unit = 1.f / 510.f;
  const int cy = 2 * y.whole, sy = y.sign, cz = 2 * z.whole, sz = z.sign;
  for (int i = 0; i < n; ++i)
  {
    const float t = v[i] * (unit * static_cast<float>(cy + sy * (y0[i] + y1[i]))) *
      (unit * static_cast<float>(cz + sz * (z0[i] + z1[i])));
    own[i] += t * (unit * static_cast<float>(510 - x0[i] - x1[i]));
    next[i] += t * (unit * static_cast<float>(x0[i] + x1[i]));
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
  constexpr float unit = 1.f / 510.f;
  const int cy = 2 * y.whole, sy = y.sign, cz = 2 * z.whole, sz = z.sign;
  float* LIGHTTRANSPORT_RESTRICT own1 = own + room;
  float* LIGHTTRANSPORT_RESTRICT own2 = own + 2 * room;
  float* LIGHTTRANSPORT_RESTRICT next1 = next + room;
  float* LIGHTTRANSPORT_RESTRICT next2 = next + 2 * room;
  for (int i = 0; i < n; ++i)
  {
    const float t = (unit * static_cast<float>(cy + sy * (y0[i] + y1[i]))) *
      (unit * static_cast<float>(cz + sz * (z0[i] + z1[i])));
    const float u = t * (unit * static_cast<float>(x0[i] + x1[i]));
    const float p = t * (unit * static_cast<float>(510 - x0[i] - x1[i]));
    own[i] += between[i] * p;
    next[i] += between[i] * u;
    own1[i] += below[i] * p;
    next1[i] += below[i] * u;
    own2[i] += above[i] * p;
    next2[i] += above[i] * u;
  }
}

/**
 * The faces after odd voxels of a row, which alone lie between coarse ones, and their inner
 * faces. x is the first voxel's coordinate of n.
 */
LIGHTTRANSPORT_SIMD
void maskFacesRow(int count, int x, int n, const float* g, float* LIGHTTRANSPORT_RESTRICT masked,
  float* LIGHTTRANSPORT_RESTRICT below, float* LIGHTTRANSPORT_RESTRICT above)
{
  for (int i = 0; i < count; ++i)
  {
    const float face = static_cast<float>((x + i) & 1);
    masked[i] = face * g[i];
    below[i] = face * g[i - 1];
    above[i] = face * g[i + 1];
  }
  if (x + count == n)
  {
    masked[count - 1] = below[count - 1] = above[count - 1] = 0.f; // no face there
  }
}

/** The weights of a row's voxels for their own coarse column (a) and its neighbour's (b). */
LIGHTTRANSPORT_SIMD
void weightRow(int n, const std::uint8_t* LIGHTTRANSPORT_RESTRICT kept, const Weights& x,
  const Weights& y, const Weights& z, float* LIGHTTRANSPORT_RESTRICT a,
  float* LIGHTTRANSPORT_RESTRICT b)
{
  constexpr float unit = 1.f / 255.f;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT wx = x.here;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT wy = y.here;
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT wz = z.here;
  const int cy = y.whole, sy = y.sign, cz = z.whole, sz = z.sign;
  for (int i = 0; i < n; ++i)
  {
    const float t = unit * static_cast<float>(kept[i]) *
      (unit * static_cast<float>(cy + sy * wy[i])) * (unit * static_cast<float>(cz + sz * wz[i]));
    a[i] = t * (unit * static_cast<float>(255 - wx[i]));
    b[i] = t * (unit * static_cast<float>(wx[i]));
  }
}

/** The energy of two rows' weights on the faces g between them. */
LIGHTTRANSPORT_SIMD
void energyAcross(int n, const float* LIGHTTRANSPORT_RESTRICT g,
  const float* LIGHTTRANSPORT_RESTRICT a0, const float* LIGHTTRANSPORT_RESTRICT b0,
  const float* LIGHTTRANSPORT_RESTRICT a1, const float* LIGHTTRANSPORT_RESTRICT b1,
  float* LIGHTTRANSPORT_RESTRICT own, float* LIGHTTRANSPORT_RESTRICT next)
{
  for (int i = 0; i < n; ++i)
  {
    const float a = a0[i] - a1[i];
    const float b = b0[i] - b1[i];
    own[i] += g[i] * a * a;
    next[i] += g[i] * b * b;
  }
}

/** The energy of a row's weights on the faces along it, where no voxels are joined along it. */
LIGHTTRANSPORT_SIMD
void energyAlong(int n, const float* LIGHTTRANSPORT_RESTRICT g,
  const float* LIGHTTRANSPORT_RESTRICT a, float* LIGHTTRANSPORT_RESTRICT own)
{
  for (int i = 0; i < n; ++i)
  {
    own[i] += (g[i] + g[i - 1]) * a[i] * a[i];
  }
}

/**
 * The energy of a row's weights on the faces after its voxels, of all three axes, and on its sinks.
 * N and T: the rows beyond along y and z. Along x voxels are joined in pairs.
 */
LIGHTTRANSPORT_SIMD
void energyRow(int n, const float* LIGHTTRANSPORT_RESTRICT gx,
  const float* LIGHTTRANSPORT_RESTRICT gy, const float* LIGHTTRANSPORT_RESTRICT gz,
  const float* LIGHTTRANSPORT_RESTRICT s, const float* LIGHTTRANSPORT_RESTRICT a,
  const float* LIGHTTRANSPORT_RESTRICT b, const float* LIGHTTRANSPORT_RESTRICT aN,
  const float* LIGHTTRANSPORT_RESTRICT bN, const float* LIGHTTRANSPORT_RESTRICT aT,
  const float* LIGHTTRANSPORT_RESTRICT bT, float* LIGHTTRANSPORT_RESTRICT own,
  float* LIGHTTRANSPORT_RESTRICT next)
{
  for (int i = 0; i < n; ++i)
  {
    // the face above an odd voxel lies between columns, the one above an even voxel inside one
    const float odd = static_cast<float>(i & 1);
    const float ai = a[i];
    const float bi = b[i];
    const float above = ai - (odd * b[i + 1] + (1.f - odd) * a[i + 1]);
    const float below = (1.f - odd) * (b[i - 1] - ai);
    const float yOwn = ai - aN[i];
    const float yNext = bi - bN[i];
    const float zOwn = ai - aT[i];
    const float zNext = bi - bT[i];
    own[i] += gx[i] * above * above + gx[i - 1] * below * below + s[i] * ai * ai +
      gy[i] * yOwn * yOwn + gz[i] * zOwn * zOwn;
    next[i] += (odd * gx[i - 1] + (1.f - odd) * gx[i] + s[i]) * bi * bi + gy[i] * yNext * yNext +
      gz[i] * zNext * zNext;
  }
}

/** A coarse row from what its fine rows gave to their own columns and to the next ones. */
LIGHTTRANSPORT_SIMD
void columnRow(int begin, int end, bool halved, const float* own, const float* next,
  float* LIGHTTRANSPORT_RESTRICT out)
{
  if (!halved)
  {
    std::copy(own + begin, own + end, out + begin);
    return;
  }
  for (int i = begin; i < end; ++i)
  {
    out[i] = own[2 * i] + own[2 * i + 1] + next[2 * i - 1] + next[2 * i + 2];
  }
}

/** Raises a row's sinks where its diagonal is below a part of the energy. */
LIGHTTRANSPORT_SIMD
void raiseRow(int n, float part, const float* LIGHTTRANSPORT_RESTRICT energy, const RowFaces& f,
  float* LIGHTTRANSPORT_RESTRICT s)
{
  const float* gx = f.gx;
  const float* gy = f.gy;
  const float* gyS = f.gyS;
  const float* gz = f.gz;
  const float* gzB = f.gzB;
  for (int i = 0; i < n; ++i)
  {
    const float diagonal = gx[i] + gx[i - 1] + gy[i] + gyS[i] + gz[i] + gzB[i] + s[i];
    const float missing = part * energy[i] - diagonal;
    s[i] += missing > 0.f ? missing : 0.f;
  }
}

/** The coarse faces from the sums over the lines, see gatherFacesRow. */
LIGHTTRANSPORT_SIMD
void seriesRow(int n, const float* between, const float* below, const float* above,
  float* LIGHTTRANSPORT_RESTRICT out)
{
  constexpr float least = 1e-25f;
  for (int i = 0; i < n; ++i)
  {
    const float b = between[i];
    const float l = below[i];
    const float u = above[i];
    const float resistance =
      0.5f / (l > least ? l : 1.f) + 1.f / (b > least ? b : 1.f) + 0.5f / (u > least ? u : 1.f);
    const float smallest = l < b ? (l < u ? l : u) : (b < u ? b : u);
    out[i] = smallest > least ? 1.f / resistance : 0.f;
  }
}

/**
 * What the voxels 2 I + odd with first <= I < last of a residual give to four coarse rows:
 * own[m] goes to I, next[m] to I's neighbour along x.
 */
LIGHTTRANSPORT_SIMD
void depositRow(int first, int last, const MultigridLine& v, const float* LIGHTTRANSPORT_RESTRICT r,
  float* LIGHTTRANSPORT_RESTRICT o0, float* LIGHTTRANSPORT_RESTRICT o1,
  float* LIGHTTRANSPORT_RESTRICT o2, float* LIGHTTRANSPORT_RESTRICT o3,
  float* LIGHTTRANSPORT_RESTRICT n0, float* LIGHTTRANSPORT_RESTRICT n1,
  float* LIGHTTRANSPORT_RESTRICT n2, float* LIGHTTRANSPORT_RESTRICT n3)
{
  constexpr float unit = 1.f / 255.f;
  const std::uint8_t* wx = v.wx;
  const std::uint8_t* wy = v.wy;
  const std::uint8_t* wz = v.wz;
  const std::uint8_t* kept = v.kept;
  const float* value = r + v.odd;
  for (int I = first; I < last; ++I)
  {
    const float t = value[2 * I] * unit * static_cast<float>(kept[I]);
    const float u = t * (unit * static_cast<float>(wx[I]));
    const float p = t * (unit * static_cast<float>(255 - wx[I]));
    const float b1 = unit * static_cast<float>(wy[I]);
    const float b0 = unit * static_cast<float>(255 - wy[I]);
    const float c1 = unit * static_cast<float>(wz[I]);
    const float c0 = unit * static_cast<float>(255 - wz[I]);
    const float f0 = b0 * c0;
    const float f1 = b1 * c0;
    const float f2 = b0 * c1;
    const float f3 = b1 * c1;
    o0[I] = p * f0;
    n0[I] = u * f0;
    o1[I] = p * f1;
    n1[I] = u * f1;
    o2[I] = p * f2;
    n2[I] = u * f2;
    o3[I] = p * f3;
    n3[I] = u * f3;
  }
}

LIGHTTRANSPORT_SIMD
void addTwo(int n, const float* LIGHTTRANSPORT_RESTRICT a, const float* LIGHTTRANSPORT_RESTRICT b,
  float* LIGHTTRANSPORT_RESTRICT to)
{
  for (int i = 0; i < n; ++i)
  {
    to[i] += a[i] + b[i];
  }
}

/** x[2 I + odd] += kept times the tensor product of the three weights on eight coarse values. */
LIGHTTRANSPORT_SIMD
void prolongRow(int first, int last, const MultigridLine& v, const float* const* coarse,
  float* LIGHTTRANSPORT_RESTRICT to)
{
  constexpr float unit = 1.f / 255.f;
  const std::uint8_t* wx = v.wx;
  const std::uint8_t* wy = v.wy;
  const std::uint8_t* wz = v.wz;
  const std::uint8_t* kept = v.kept;
  const int side = v.odd ? 1 : -1;
  const float* u0 = coarse[0];
  const float* u1 = coarse[1];
  const float* u2 = coarse[2];
  const float* u3 = coarse[3];
  const float* s0 = u0 + side;
  const float* s1 = u1 + side;
  const float* s2 = u2 + side;
  const float* s3 = u3 + side;
  for (int I = first; I < last; ++I)
  {
    const float a1 = unit * static_cast<float>(wx[I]);
    const float a0 = unit * static_cast<float>(255 - wx[I]);
    const float b1 = unit * static_cast<float>(wy[I]);
    const float b0 = unit * static_cast<float>(255 - wy[I]);
    const float c1 = unit * static_cast<float>(wz[I]);
    const float c0 = unit * static_cast<float>(255 - wz[I]);
    const float v0 = a0 * u0[I] + a1 * s0[I];
    const float v1 = a0 * u1[I] + a1 * s1[I];
    const float v2 = a0 * u2[I] + a1 * s2[I];
    const float v3 = a0 * u3[I] + a1 * s3[I];
    const float y0 = b0 * v0 + b1 * v1;
    const float y1 = b0 * v2 + b1 * v3;
    to[I] = unit * static_cast<float>(kept[I]) * (c0 * y0 + c1 * y1);
  }
}

/** x[2 I + odd] += v[I] */
LIGHTTRANSPORT_SIMD
void spreadRow(int first, int last, int odd, const float* LIGHTTRANSPORT_RESTRICT v,
  float* LIGHTTRANSPORT_RESTRICT x)
{
  const float even = odd ? 0.f : 1.f;
  const float other = odd ? 1.f : 0.f;
  for (int I = first; I < last; ++I)
  {
    x[2 * I] += even * v[I];
    x[2 * I + 1] += other * v[I];
  }
}

/** Room for the rows of a kernel, per thread, with a line of zeros on either side. */
float* scratch(std::size_t rows, std::size_t length, std::size_t& pitch)
{
  static thread_local std::vector<float> store;
  pitch = (length + 47) / 16 * 16;
  if (store.size() < rows * pitch + 16)
  {
    store.resize(rows * pitch + 16);
  }
  return store.data() + 16;
}
/** From row to row of what is kept of the red voxels alone. */
std::int64_t redPitch(const DiffusionOperator& A)
{
  return (A.dims[0] + 1) / 2;
}

/** (i + j + k + colour) & 1 of the first value of a row's span. */
int parityOf(const DiffusionOperator& A, std::int64_t row, std::int64_t begin, int colour)
{
  return static_cast<int>(
    (begin - row * A.dims[0] + row % A.dims[1] + row / A.dims[1] + colour) & 1);
}

/**
 * body(stage, row) for each row of the domain and each stage, as if the stages came one after
 * the other, while the rows in between stay in the cache. A stage may read the row itself and
 * its four neighbours, and of these only what the next stage leaves alone (the other colour).
 *
 * Tiles of rows; within one, a wave runs along z, each stage a plane behind the one before. From
 * stage to stage an even tile gives up a row at either end, which the odd tile beside it takes
 * over when all even ones are done: no row is done twice, and no two tiles that run at a time
 * have rows that are neighbours, in space or in memory (that is why their number along y is 1 or
 * even). The tiles depend on the grid alone.
 */
using SkewBody = std::function<void(int stage, std::int64_t row, const RowFaces& faces)>;

/** The faces and sinks of a tile's planes in turn, where they are not stored. */
class FaceRing
{
public:
  /** Room for `planes` planes of the rows [low, high). */
  FaceRing(const DiffusionOperator& op, int planes, int low, int high)
    : A(op)
    , depth(planes)
    , first(low)
    , last(high)
    , pitch((static_cast<std::size_t>(op.dims[0]) + 47) / 16 * 16)
  {
    static thread_local std::vector<float> room;
    const std::size_t size =
      4 * this->pitch * static_cast<std::size_t>(planes) * static_cast<std::size_t>(high - low) +
      32;
    if (room.size() < size)
    {
      room.assign(size, 0.f);
    }
    this->store = room.data() + 16;
  }

  void compute(int k)
  {
    for (int j = this->first; j < this->last; ++j)
    {
      float* const g[3] = { this->row(0, j, k), this->row(1, j, k), this->row(2, j, k) };
      g[0][-1] = 0.f;
      this->A.compute(j + static_cast<std::int64_t>(this->A.dims[1]) * k, g, this->row(3, j, k));
    }
  }
  RowFaces faces(int j, int k) const
  {
    const float* zeros = this->A.zeros.data();
    return { this->row(0, j, k), this->row(1, j, k), j > 0 ? this->row(1, j - 1, k) : zeros,
      this->row(2, j, k), k > 0 ? this->row(2, j, k - 1) : zeros, this->row(3, j, k) };
  }

private:
  float* row(int array, int j, int k) const
  {
    const std::size_t at = (static_cast<std::size_t>(k % this->depth) *
                               static_cast<std::size_t>(this->last - this->first) +
                             static_cast<std::size_t>(j - this->first)) *
        4 +
      static_cast<std::size_t>(array);
    return this->store + at * this->pitch;
  }
  const DiffusionOperator& A;
  int depth, first, last;
  std::size_t pitch;
  float* store;
};

/** The rows or planes of a tile at a stage, see skew. */
struct TileRange
{
  int n, tile, tiles;
  int at(int stage, bool end) const
  {
    const int edge = this->tile + (end ? 1 : 0);
    if (edge == 0 || edge == this->tiles)
    {
      return edge == 0 ? 0 : this->n;
    }
    const int border = static_cast<int>(static_cast<std::int64_t>(this->n) * edge / this->tiles);
    // odd tiles grow, even ones shrink; of two thin ones the odd one may come to have it all
    const int moved = border + ((this->tile % 2 == 1) == end ? stage : -stage);
    return std::min(std::max(moved, 0), this->n);
  }
};

void skewTile(const DiffusionOperator& A, int stages, const TileRange& y, const TileRange& z,
  const SkewBody& body)
{
  const bool stored = A.isStored();
  const int most = stages - 1;
  const int first = std::min(z.at(0, false), z.at(most, false));
  const int last = std::max(z.at(0, true), z.at(most, true));
  const int low = std::max(0, std::min(y.at(0, false), y.at(most, false)) - 1);
  const int high = std::max(y.at(0, true), y.at(most, true));
  FaceRing ring(A, stored ? 0 : stages + 1, low, high);
  if (!stored && first > 0)
  {
    ring.compute(first - 1);
  }
  for (int front = first; front < last + most; ++front)
  {
    if (!stored && front < last)
    {
      ring.compute(front);
    }
    for (int stage = 0; stage < stages; ++stage)
    {
      const int k = front - stage;
      if (k < z.at(stage, false) || k >= z.at(stage, true))
      {
        continue;
      }
      for (int j = y.at(stage, false); j < y.at(stage, true); ++j)
      {
        const std::int64_t row = j + static_cast<std::int64_t>(A.dims[1]) * k;
        const Span span = A.span(row);
        if (span.begin < span.end)
        {
          body(stage, row,
            stored ? facesOfRow(A, row, row * A.dims[0] + span.begin) : ring.faces(j, k));
        }
      }
    }
  }
}

void skew(
  const DiffusionOperator& A, int stages, const ParallelFor& parallelFor, const SkewBody& body)
{
  const int ny = A.dims[1];
  const int nz = A.dims[2];
  int tiles[2] = { 1, 1 }; // along y and z
  const int least = 2 * stages + 4;
  if (A.size() >= ParallelGrain)
  {
    const int height = std::max<int>(least, static_cast<int>(TileValues / A.dims[0]));
    if (ny >= 2 * height || nz < 2 * least)
    {
      tiles[0] = std::max(1, ny / std::max(1, std::min(height, ny / 2)) / 2 * 2);
    }
    tiles[1] = std::max(1, nz / std::max(least, TilePlanes));
  }
  for (int phase = 0; phase < 4; ++phase)
  {
    const int odd[2] = { phase & 1, phase >> 1 };
    const int along[2] = { (tiles[0] + 1 - odd[0]) / 2, (tiles[1] + 1 - odd[1]) / 2 };
    ForRows(parallelFor, along[0] * along[1], A.activeSize,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t t = begin; t < end; ++t)
        {
          skewTile(A, stages, { ny, 2 * static_cast<int>(t % along[0]) + odd[0], tiles[0] },
            { nz, 2 * static_cast<int>(t / along[0]) + odd[1], tiles[1] }, body);
        }
      });
  }
}

/** body(row, begin, n, faces) for each row of the domain. */
template <class Body>
void forEachFaces(const DiffusionOperator& A, const ParallelFor& parallelFor, const Body& body)
{
  if (A.isStored())
  {
    ForEachRow(A, parallelFor,
      [&](std::int64_t r, std::int64_t o, int n) { body(r, o, n, facesOfRow(A, r, o)); });
  }
  else
  {
    skew(A, 1, parallelFor,
      [&](int, std::int64_t r, const RowFaces& faces)
      { body(r, r * A.dims[0], A.dims[0], faces); });
  }
}

/** The sum of what row(row, begin, n, faces) returns, in an order that threads do not change. */
template <class Row>
double sumFaces(const DiffusionOperator& A, const ParallelFor& parallelFor, const Row& row)
{
  std::vector<double> partial(
    static_cast<std::size_t>(A.dims[1]) * static_cast<std::size_t>(A.dims[2]), 0.);
  forEachFaces(A, parallelFor,
    [&](std::int64_t r, std::int64_t o, int n, const RowFaces& faces)
    { partial[static_cast<std::size_t>(r)] = row(r, o, n, faces); });
  double sum = 0.;
  for (const double p : partial)
  {
    sum += p;
  }
  return sum;
}
} // namespace

//------------------------------------------------------------------------------
void DiffusionOperator::allocate(const std::array<int, 3>& n, Pages size)
{
  this->pages = size;
  this->compute = nullptr;
  this->dims = n;
  for (auto& faces : this->g)
  {
    faces.allocate(this->size(), this->pages);
  }
  this->s.allocate(this->size(), this->pages);
  this->zeros.allocate(n[0]);
  this->activeRows.clear();
  this->spans.clear();
  this->activeSize = this->size();
}

void DiffusionOperator::forget(ComputeRow how)
{
  this->compute = std::move(how);
  for (auto& faces : this->g)
  {
    faces.release();
  }
  this->s.release();
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
  return (this->isStored() ? 4 : 0) * static_cast<std::int64_t>(sizeof(float)) * this->activeSize +
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
  return sumFaces(A, parallelFor,
    [&](std::int64_t row, std::int64_t o, int n, const RowFaces& f)
    { return applyRow(n, f, viewRow(A, x, row, o), y + o); });
}

double Advance(const DiffusionOperator& A, const float* z, float beta, float* p, float* y,
  const ParallelFor& parallelFor)
{
  return sumFaces(A, parallelFor,
    [&](std::int64_t row, std::int64_t o, int n, const RowFaces& f)
    { return advanceRow(n, f, viewRow(A, z, row, o), beta, p + o, y + o); });
}

void ForEachStage(const DiffusionOperator& A, int stages, const ParallelFor& parallelFor,
  const std::function<void(int stage, std::int64_t row)>& body)
{
  skew(A, stages, parallelFor,
    [&body](int stage, std::int64_t row, const RowFaces&) { body(stage, row); });
}

void DivideByDiagonal(
  const DiffusionOperator& A, const float* r, float* z, const ParallelFor& parallelFor)
{
  sumFaces(A, parallelFor,
    [&](std::int64_t, std::int64_t o, int n, const RowFaces& f)
    {
      for (int i = 0; i < n; ++i)
      {
        z[o + i] =
          r[o + i] / (f.gx[i] + f.gx[i - 1] + f.gy[i] + f.gyS[i] + f.gz[i] + f.gzB[i] + f.s[i]);
      }
      return 0.;
    });
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
    const std::int64_t weights = static_cast<std::int64_t>(!level.kept.empty()) +
      !level.w[0].empty() + !level.w[1].empty() + !level.w[2].empty();
    const int vectors = (level.x.empty() ? 0 : 2) + (level.first.empty() ? 0 : 2);
    sum += level.A.bytes() + A.activeSize * (8 * vectors + weights) / 2;
  }
  return sum;
}

/** Sums of the faces along each axis. */
static std::array<double, 3> sumOfFaces(const DiffusionOperator& A, const ParallelFor& parallelFor)
{
  std::vector<std::array<double, 3>> partial(
    static_cast<std::size_t>(A.dims[1]) * static_cast<std::size_t>(A.dims[2]), { { 0., 0., 0. } });
  forEachFaces(A, parallelFor,
    [&](std::int64_t r, std::int64_t, int n, const RowFaces& f)
    {
      partial[static_cast<std::size_t>(r)] = { { sumRow(n, f.gx), sumRow(n, f.gy),
        sumRow(n, f.gz) } };
    });
  std::array<double, 3> sums{ { 0., 0., 0. } };
  for (const auto& row : partial)
  {
    for (std::size_t d = 0; d < 3; ++d)
    {
      sums[d] += row[d];
    }
  }
  return sums;
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
    std::array<double, 3> mean = sumOfFaces(*fine, parallelFor);
    double largest = 0.;
    for (std::size_t d = 0; d < 3; ++d)
    {
      mean[d] *= fine->dims[d] > 1 ? fine->dims[d] / (fine->dims[d] - 1.) : 0.;
      largest = std::max(largest, mean[d]);
    }
    bool any = false;
    for (std::size_t d = 0; d < 3; ++d)
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
  for (std::size_t l = 1; l <= AcceleratedLevels && l + 1 < this->levels.size(); ++l)
  {
    Level& level = this->levels[l];
    level.first.allocate(level.A.size(), A.pages);
    level.firstImage.allocate(level.A.size(), A.pages);
  }
}

//------------------------------------------------------------------------------
Multigrid::Slab::Slab(const DiffusionOperator& op, int planes)
  : A(op)
{
  const std::int64_t plane = static_cast<std::int64_t>(op.dims[0]) * op.dims[1];
  for (std::size_t i = 0; !op.isStored() && i < this->faces.size(); ++i)
  {
    this->faces[i].allocate(plane * (planes + 3), op.pages);
  }
  this->weights.allocate(4 * plane * planes, op.pages);
  this->feltSinks.allocate(plane * planes, op.pages);
}

void Multigrid::Slab::moveTo(int firstPlane, int lastPlane, const ParallelFor& parallelFor)
{
  const std::int64_t ny = this->A.dims[1];
  this->firstRow = ny * firstPlane;
  if (this->A.isStored())
  {
    return;
  }
  const std::int64_t from = ny * std::max(firstPlane - 2, 0);
  const std::int64_t rows = ny * std::min(lastPlane + 1, this->A.dims[2]) - from;
  this->firstValue = from * this->A.dims[0];
  ForRows(parallelFor, rows, rows * this->A.dims[0],
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        const std::int64_t o = r * this->A.dims[0];
        float* const g[3] = { this->faces[0].data() + o, this->faces[1].data() + o,
          this->faces[2].data() + o };
        this->A.compute(from + r, g, this->faces[3].data() + o);
      }
    });
}

void Multigrid::coarsen(
  const DiffusionOperator& A, Level& fine, Level& coarse, const ParallelFor& parallelFor) const
{
  const std::array<int, 3>& n = A.dims;
  std::array<int, 3> nc;
  const std::int64_t redSize = redPitch(A) * n[1] * n[2];
  for (int d = 0; d < 3; ++d)
  {
    nc[d] = fine.halved[d] ? (n[d] + 1) / 2 : n[d];
    if (fine.halved[d])
    {
      fine.w[d].allocate(redSize, A.pages);
    }
  }
  fine.noWeight.allocate(n[0]);
  fine.kept.allocate(redSize, A.pages);
  coarse.A.allocate(nc, A.pages);
  coarse.x.allocate(coarse.A.size(), A.pages);
  coarse.b.allocate(coarse.A.size(), A.pages);
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

  // A slab of coarse planes at a time, while what they are made of is in the cache.
  const DiffusionOperator& C = coarse.A;
  const std::int64_t plane = static_cast<std::int64_t>(nc[0]) * nc[1];
  const int planes = static_cast<int>(
    std::min<std::int64_t>(nc[2], std::max<std::int64_t>(SlabPlanes, SlabValues / plane)));
  const int step = fine.halved[2] ? 2 : 1;
  Slab slab(A, step * planes + 2);
  const auto forRows =
    [&](const DiffusionOperator& op, std::int64_t from, std::int64_t to, auto&& body)
  {
    ForRows(parallelFor, to - from, (to - from) * op.dims[0],
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t row = from + begin; row < from + end; ++row)
        {
          const Span span = op.span(row);
          if (span.begin < span.end)
          {
            body(row, row * op.dims[0] + span.begin, span.end - span.begin);
          }
        }
      });
  };
  for (int K = 0; K < nc[2]; K += planes)
  {
    const int end = std::min(K + planes, nc[2]);
    const int own[2] = { step * K, std::min(step * end, n[2]) };
    const int first = std::max(own[0] - 1, 0);
    const int last = std::min(own[1] + 1, n[2]);
    slab.moveTo(first, last, parallelFor);
    // 3. the weights, from the lines through the coarse faces, and what is felt of the sinks
    forRows(A, static_cast<std::int64_t>(n[1]) * first, static_cast<std::int64_t>(n[1]) * last,
      [&](std::int64_t row, std::int64_t o, int length)
      {
        this->weighRow(A, fine, row, slab);
        if (row < static_cast<std::int64_t>(n[1]) * own[0] ||
          row >= static_cast<std::int64_t>(n[1]) * own[1])
        {
          return; // another slab's
        }
        const int begin = static_cast<int>(o - row * n[0]);
        const int odd = static_cast<int>((row % n[1] + row / n[1]) & 1);
        const int from = (begin - odd + 1) / 2;
        const int to = (begin + length - odd + 1) / 2;
        for (int d = 0; d < 3; ++d)
        {
          if (fine.halved[d])
          {
            packRow(from, to, odd, slab.row(row, d), fine.w[d].data() + row * redPitch(A));
          }
        }
        packRow(from, to, odd, slab.row(row, 3), fine.kept.data() + row * redPitch(A));
      });
    // 2. faces go to the coarse columns that their voxels are put between
    const std::int64_t rows[2] = { static_cast<std::int64_t>(nc[1]) * K,
      static_cast<std::int64_t>(nc[1]) * end };
    forRows(C, rows[0], rows[1],
      [&](std::int64_t row, std::int64_t o, int length)
      {
        for (int d = 0; d < 3; ++d)
        {
          float* to = coarse.A.g[d].data() + o;
          if (fine.halved[d])
          {
            this->gatherFaces(A, fine, slab, C, d, row, o, length, to);
          }
          else
          {
            this->gather(A, fine, slab, C, d, row, o, length, to);
          }
        }
        this->gather(A, fine, slab, C, -1, row, o, length, coarse.A.s.data() + o);
      });
    forRows(C, rows[0], rows[1],
      [&](std::int64_t row, std::int64_t o, int length)
      { this->raise(A, fine, slab, coarse.A, row, o, length); });
  }
  // Where light has nowhere to go (a singular part), the coarsest voxel has neither.
  CloseIsolated(coarse.A, 1.f, parallelFor);
}

void Multigrid::weighRow(
  const DiffusionOperator& A, const Level& fine, std::int64_t row, Slab& slab) const
{
  const std::array<int, 3>& n = A.dims;
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  const Span span = A.span(row);
  const int begin = span.begin;
  const int length = span.end - span.begin;
  const std::int64_t o = row * n[0] + begin;
  const int at[3] = { 0, static_cast<int>(row % n[1]), static_cast<int>(row / n[1]) };
  for (int d = 0; d < 3; ++d)
  {
    if (!fine.halved[d])
    {
      continue;
    }
    std::uint8_t* w = slab.row(row, d);
    const float* g = slab.g(d, o);
    const std::int64_t t = stride[d];
    if (d > 0 && at[d] % 2 == 1 && at[d] + 1 < n[d])
    {
      lineAcross(length, g, g - t, at[d] + 2 < n[d] ? g + t : nullptr, false, w + begin);
    }
    else if (d > 0 && at[d] % 2 == 0 && at[d] > 0)
    {
      lineAcross(length, g - t, g - 2 * t, at[d] + 1 < n[d] ? g : nullptr, true, w + begin);
    }
    else
    {
      std::fill(w + begin, w + begin + length, std::uint8_t(0));
    }
    if (d == 0)
    {
      // faces after the odd voxels; the last voxel of an odd row is its own centre
      lineAlong(begin | 1, std::min(begin + length, n[0] - 1), n[0] - 2, slab.g(0, row * n[0]), w);
    }
  }
  // A sink pulls its own voxel down, and the parents only as far as the voxel is tied to them:
  // the balance of flux there has the sink beside the lines.
  static thread_local std::vector<float> store;
  store.assign(static_cast<std::size_t>(n[0]), 0.f);
  float* tie = store.data() + begin;
  for (int d = 0; d < 3; ++d)
  {
    if (!fine.halved[d])
    {
      continue;
    }
    const float* g = slab.g(d, o);
    if (d > 0)
    {
      const bool odd = at[d] % 2 == 1;
      const std::int64_t t = stride[d];
      const float* inner = odd ? g - t : at[d] + 1 < n[d] ? g : nullptr;
      const float* between = odd ? (at[d] + 1 < n[d] ? g : nullptr) : at[d] > 0 ? g - t : nullptr;
      const float* beyond = odd ? (at[d] + 2 < n[d] ? g + t : nullptr)
        : at[d] > 1             ? g - 2 * t
                                : nullptr;
      tieRow(0, length, 1, inner, between, beyond, tie);
      continue;
    }
    const int lone = n[0] % 2 == 1 ? n[0] - 1 : n[0]; // its own centre
    const float* whole = slab.g(0, row * n[0]);
    float* ties = store.data();
    // odd voxels, then even ones; faces outside the row are 0
    tieRow(begin | 1, std::min(begin + length, n[0] - 2), 2, whole - 1, whole, whole + 1, ties);
    for (int i = std::max(begin | 1, n[0] - 2 + (n[0] % 2 == 0 ? 0 : 1)); i < begin + length;
         i += 2)
    {
      tieRow(i, i + 1, 2, whole - 1, i + 1 < n[0] ? whole : nullptr, nullptr, ties);
    }
    if (begin == 0)
    {
      tieRow(0, 1, 2, lone == 0 ? nullptr : whole, nullptr, nullptr, ties);
    }
    const int first = std::max(begin + (begin & 1), 2);
    tieRow(first, std::min(begin + length, lone), 2, whole, whole - 1, whole - 2, ties);
    if (lone >= first && lone < begin + length)
    {
      tieRow(lone, lone + 1, 2, nullptr, whole - 1, whole - 2, ties);
    }
  }
  keepRow(length, tie, slab.s(o), slab.row(row, 3) + begin, slab.felt(o));
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

void Multigrid::weigh(const DiffusionOperator& A, const Level& fine, const Slab& slab,
  const int at[3], const int J[3], int along, bool ends, Weights weights[3]) const
{
  const std::int64_t row = at[1] + static_cast<std::int64_t>(A.dims[1]) * at[2];
  const int next[3] = { 0, along == 1 && ends ? 1 : 0, along == 2 && ends ? 1 : 0 };
  const std::int64_t other = row + next[1] + static_cast<std::int64_t>(A.dims[1]) * next[2];
  const int step = along == 0 && ends ? 1 : 0;
  for (int d = 0; d < 3; ++d)
  {
    if (fine.halved[d] && d != along)
    {
      const bool parent = d == 0 || at[d] / 2 == J[d];
      weights[d] = { slab.row(row, d) + at[0], slab.row(other, d) + at[0] + step, parent ? 255 : 0,
        parent ? -1 : 1 };
    }
    else
    {
      weights[d] = { fine.noWeight.data(), fine.noWeight.data(), 255, 0 };
    }
  }
}

void Multigrid::gather(const DiffusionOperator& A, const Level& fine, const Slab& slab,
  const DiffusionOperator& C, int along, std::int64_t row, std::int64_t o, int length,
  float* out) const
{
  const std::array<int, 3>& n = A.dims;
  const std::array<int, 3>& nc = C.dims;
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
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
      const int at[3] = { span.begin, j, k };
      // a face's weights are the mean of those at its two ends
      const bool ends = along == 0 || (along > 0 && at[along] + 1 < n[along]);
      Weights weights[3];
      this->weigh(A, fine, slab, at, J, along, ends, weights);
      gatherRow(span.end - span.begin, along < 0 ? slab.felt(f) : slab.g(along, f), weights[0],
        weights[1], weights[2], own + span.begin, next + span.begin);
    }
  }
  const int begin = static_cast<int>(o - row * nc[0]);
  columnRow(begin, begin + length, fine.halved[0], own, next, out - begin);
}

void Multigrid::raise(const DiffusionOperator& A, const Level& fine, const Slab& slab,
  DiffusionOperator& C, std::int64_t row, std::int64_t o, int length) const
{
  const std::array<int, 3>& n = A.dims;
  const std::array<int, 3>& nc = C.dims;
  const std::int64_t plane = static_cast<std::int64_t>(n[0]) * n[1];
  // weights a and b of up to 4 x 4 fine rows; beyond them zeros
  static thread_local std::vector<float> store;
  const std::size_t room = static_cast<std::size_t>(n[0]) + 4;
  store.resize(std::max(store.size(), 36 * room));
  float* zeros = store.data() + 2;
  float* own = zeros + room;
  float* next = own + room;
  std::fill(store.data(), store.data() + 3 * room, 0.f);
  const int J[3] = { 0, static_cast<int>(row % nc[1]), static_cast<int>(row / nc[1]) };
  const Footprint rows = this->footprint(fine, n, J, -1);
  // jj and kk count from 1
  const auto weights = [&](int jj, int kk, int which)
  {
    const bool inside = jj >= 1 && jj <= rows.last[1] - rows.first[1] + 1 && kk >= 1 &&
      kk <= rows.last[2] - rows.first[2] + 1;
    return inside ? own + static_cast<std::size_t>(2 * (4 * (kk - 1) + jj - 1) + which + 2) * room
                  : zeros;
  };
  for (int k = rows.first[2]; k <= rows.last[2]; ++k)
  {
    for (int j = rows.first[1]; j <= rows.last[1]; ++j)
    {
      const Span span = A.span(j + static_cast<std::int64_t>(n[1]) * k);
      for (int which = 0; which < 2; ++which)
      {
        float* to = weights(j - rows.first[1] + 1, k - rows.first[2] + 1, which);
        std::fill(to - 2, to + (span.begin < span.end ? span.begin : n[0] + 2), 0.f);
        std::fill(to + (span.begin < span.end ? span.end : 0), to + n[0] + 2, 0.f);
      }
      if (span.begin < span.end)
      {
        const int at[3] = { span.begin, j, k };
        Weights w[3];
        this->weigh(A, fine, slab, at, J, -1, false, w);
        const int jj = j - rows.first[1] + 1;
        const int kk = k - rows.first[2] + 1;
        const std::int64_t fineRow = j + static_cast<std::int64_t>(n[1]) * k;
        weightRow(span.end - span.begin, slab.row(fineRow, 3) + span.begin, w[0], w[1], w[2],
          weights(jj, kk, 0) + span.begin, weights(jj, kk, 1) + span.begin);
      }
    }
  }
  for (int k = rows.first[2] - 1; k <= rows.last[2]; ++k)
  {
    for (int j = rows.first[1] - 1; j <= rows.last[1]; ++j)
    {
      if (j < 0 || k < 0)
      {
        continue; // no voxels, no faces
      }
      const int jj = j - rows.first[1] + 1;
      const int kk = k - rows.first[2] + 1;
      const std::int64_t f = static_cast<std::int64_t>(n[0]) * j + plane * k;
      const float* a = weights(jj, kk, 0);
      const float* b = weights(jj, kk, 1);
      if (jj > 0 && kk > 0 && fine.halved[0])
      {
        energyRow(n[0], slab.g(0, f), slab.g(1, f), slab.g(2, f), slab.s(f), a, b,
          weights(jj + 1, kk, 0), weights(jj + 1, kk, 1), weights(jj, kk + 1, 0),
          weights(jj, kk + 1, 1), own, next);
        continue;
      }
      if (jj > 0 && kk > 0)
      {
        energyAlong(n[0], slab.g(0, f), a, own);
        energyAcross(n[0], slab.s(f), a, b, zeros, zeros, own, next);
      }
      if (kk > 0)
      {
        energyAcross(
          n[0], slab.g(1, f), a, b, weights(jj + 1, kk, 0), weights(jj + 1, kk, 1), own, next);
      }
      if (jj > 0)
      {
        energyAcross(
          n[0], slab.g(2, f), a, b, weights(jj, kk + 1, 0), weights(jj, kk + 1, 1), own, next);
      }
    }
  }
  const int begin = static_cast<int>(o - row * nc[0]);
  float* energy = zeros;
  columnRow(begin, begin + length, fine.halved[0], own, next, energy);
  raiseRow(length, LeastPart, energy + begin, facesOfRow(C, row, o), C.s.data() + o);
}

void Multigrid::gatherFaces(const DiffusionOperator& A, const Level& fine, const Slab& slab,
  const DiffusionOperator& C, int along, std::int64_t row, std::int64_t o, int length,
  float* out) const
{
  const std::array<int, 3>& n = A.dims;
  const std::array<int, 3>& nc = C.dims;
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  constexpr float noResistance = 1e20f; // of the inner face of a voxel that is its own centre
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
      const int at[3] = { span.begin, j, k };
      if (span.begin >= span.end || (along > 0 && at[along] + 1 >= n[along]))
      {
        continue;
      }
      const std::int64_t f = span.begin + stride[1] * j + stride[2] * k;
      Weights weights[3];
      this->weigh(A, fine, slab, at, J, along, true, weights);
      const float* g = slab.g(along, f);
      const float* between = g;
      const float* below = g - stride[along];
      const float* above = g + stride[along];
      const int count = span.end - span.begin;
      if (along == 0)
      {
        maskFacesRow(count, span.begin, n[0], g, masked, masked + room, masked + 2 * room);
        const int last = n[0] - 2 - span.begin; // its voxel above is its own centre
        if (last >= 0 && last < count && n[0] % 2 == 1)
        {
          masked[2 * room + static_cast<std::size_t>(last)] = noResistance;
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
  for (std::size_t part = 0; part < 3; ++part)
  {
    columnRow(begin, begin + length, fine.halved[0], own + part * room, next + part * room,
      masked + part * room);
  }
  const float* sums = masked + begin;
  seriesRow(length, sums, sums + room, sums + 2 * room, out);
}

MultigridLine Multigrid::lineOf(
  const DiffusionOperator& A, const Level& fine, const int at[3], std::int64_t row) const
{
  const std::uint8_t* w[3];
  for (int d = 0; d < 3; ++d)
  {
    w[d] = fine.halved[d] ? fine.w[d].data() + row * redPitch(A) : fine.noWeight.data();
  }
  return { w[0], w[1], w[2], fine.kept.data() + row * redPitch(A), fine.halved[0],
    (at[1] + at[2]) & 1 };
}
void CloseIsolated(DiffusionOperator& A, float isolated, const ParallelFor& parallelFor)
{
  ForEachRow(A, parallelFor,
    [&](std::int64_t row, std::int64_t o, int n)
    {
      const RowFaces f = facesOfRow(A, row, o);
      closeRow(n, f, isolated, A.s.data() + o);
    });
}

//------------------------------------------------------------------------------
namespace
{
/** The coarse rows that a fine row lies between: own, along y, along z, along both. */
struct Between
{
  std::int64_t row[4];
  bool inside[4];
};

Between between(const std::array<int, 3>& nc, const std::array<bool, 3>& halved, const int at[3])
{
  int J[3][2];
  bool next[3];
  for (int d = 1; d < 3; ++d)
  {
    J[d][0] = halved[d] ? at[d] / 2 : at[d];
    J[d][1] = J[d][0] + (at[d] % 2 ? 1 : -1);
    next[d] = halved[d] && J[d][1] >= 0 && J[d][1] < nc[d];
    J[d][1] = next[d] ? J[d][1] : J[d][0];
  }
  Between rows;
  for (int m = 0; m < 4; ++m)
  {
    rows.row[m] = J[1][m & 1] + static_cast<std::int64_t>(nc[1]) * J[2][m >> 1];
    rows.inside[m] = (!(m & 1) || next[1]) && (!(m >> 1) || next[2]);
  }
  return rows;
}

} // namespace

void Multigrid::restrictRow(const DiffusionOperator& A, const Level& fine, Level& coarse,
  std::int64_t row, float* r, std::size_t pitch) const
{
  const std::array<int, 3>& n = A.dims;
  const DiffusionOperator& C = coarse.A;
  const Span span = A.span(row);
  const int at[3] = { 0, static_cast<int>(row % n[1]), static_cast<int>(row / n[1]) };
  const MultigridLine line = this->lineOf(A, fine, at, row);
  const Between rows = between(C.dims, fine.halved, at);
  float* bc = coarse.b.data();
  if (!line.halved)
  {
    // no coarser along x: nothing is put between there
    constexpr float unit = 1.f / 255.f;
    for (int m = 0; m < 4; ++m)
    {
      if (!rows.inside[m])
      {
        continue;
      }
      float* to = bc + rows.row[m] * C.dims[0];
      for (int i = span.begin + ((span.begin + line.odd) & 1); i < span.end; i += 2)
      {
        const int wy = line.wy[i >> 1];
        const int wz = line.wz[i >> 1];
        to[i] += r[i] * unit * static_cast<float>(line.kept[i >> 1]) *
          (unit * static_cast<float>((m & 1) ? wy : 255 - wy)) *
          (unit * static_cast<float>((m >> 1) ? wz : 255 - wz));
      }
    }
    return;
  }
  // the red voxels 2 I + odd of the span
  const int first = (span.begin - line.odd + 1) / 2;
  const int last = (span.end - line.odd + 1) / 2;
  float *own[4], *next[4];
  const int side = line.odd ? 1 : -1;
  for (int m = 0; m < 4; ++m)
  {
    own[m] = r + static_cast<std::size_t>(1 + m) * pitch;
    next[m] = r + static_cast<std::size_t>(5 + m) * pitch;
  }
  if (first >= last)
  {
    return;
  }
  depositRow(
    first, last, line, r, own[0], own[1], own[2], own[3], next[0], next[1], next[2], next[3]);
  const int from = std::max(first - 1, 0);
  const int to = std::min(last + 1, C.dims[0]);
  for (int m = 0; m < 4; ++m)
  {
    // what is read beyond [first, last) was not written
    own[m][first - 1] = own[m][last] = 0.f;
    next[m][first - 1] = next[m][first - 2] = next[m][last] = next[m][last + 1] = 0.f;
    const Span target = C.span(rows.row[m]);
    const int f = std::max(from, target.begin);
    const int t = std::min(to, target.end);
    if (rows.inside[m] && f < t)
    {
      addTwo(t - f, own[m] + f, next[m] + f - side, bc + rows.row[m] * C.dims[0] + f);
    }
  }
}

void Multigrid::prolongRow(const DiffusionOperator& A, const Level& fine, const Level& coarse,
  std::int64_t row, float* x) const
{
  const std::array<int, 3>& n = A.dims;
  const DiffusionOperator& C = coarse.A;
  const Span span = A.span(row);
  const std::int64_t begin = row * n[0];
  const int at[3] = { 0, static_cast<int>(row % n[1]), static_cast<int>(row / n[1]) };
  const MultigridLine line = this->lineOf(A, fine, at, row);
  const Between rows = between(C.dims, fine.halved, at);
  const float* e[4];
  for (int m = 0; m < 4; ++m)
  {
    e[m] = coarse.x.data() + rows.row[m] * C.dims[0];
  }
  float* to = x + begin;
  if (!line.halved)
  {
    constexpr float unit = 1.f / 255.f;
    for (int i = span.begin + ((span.begin + line.odd) & 1); i < span.end; i += 2)
    {
      const float b1 = unit * static_cast<float>(line.wy[i >> 1]);
      const float b0 = unit * static_cast<float>(255 - line.wy[i >> 1]);
      const float c1 = unit * static_cast<float>(line.wz[i >> 1]);
      const float c0 = unit * static_cast<float>(255 - line.wz[i >> 1]);
      const float y0 = b0 * e[0][i] + b1 * e[1][i];
      const float y1 = b0 * e[2][i] + b1 * e[3][i];
      to[i] += unit * static_cast<float>(line.kept[i >> 1]) * (c0 * y0 + c1 * y1);
    }
    return;
  }
  const int first = (span.begin - line.odd + 1) / 2;
  const int last = (span.end - line.odd + 1) / 2;
  std::size_t pitch = 0;
  float* sum = scratch(1, static_cast<std::size_t>(n[0]), pitch);
  ::lighttransport::prolongRow(first, last, line, e, sum);
  // pairs (2 I, 2 I + 1), but for a last voxel without a partner
  const int pairs = 2 * (last - 1) + 1 < span.end ? last : last - 1;
  const int whole = 2 * first >= span.begin ? first : first + 1;
  if (whole > first)
  {
    to[2 * first + line.odd] += sum[first];
  }
  spreadRow(whole, std::max(pairs, whole), line.odd, sum, to);
  if (last > std::max(pairs, whole))
  {
    to[2 * (last - 1) + line.odd] += sum[last - 1];
  }
}

//------------------------------------------------------------------------------
void Multigrid::cycle(const float* b, float* x, const ParallelFor& parallelFor, const RowBody& done)
{
  this->cycle(0, b, x, parallelFor, done);
}

void Multigrid::cycle(
  std::size_t l, const float* b, float* x, const ParallelFor& parallelFor, const RowBody& done)
{
  const DiffusionOperator& A = this->operatorOf(l);
  Level& fine = this->levels[l];
  if (l + 1 == this->levels.size())
  {
    SmoothAround(A, this->sweeps, b, x, nullptr, parallelFor, done);
    return;
  }
  Level& coarse = this->levels[l + 1];
  ForEachRow(coarse.A, parallelFor,
    [&](std::int64_t, std::int64_t o, int n)
    { std::fill(coarse.b.data() + o, coarse.b.data() + o + n, 0.f); });
  CoarseCorrection correction;
  correction.restrictRow = [&](std::int64_t row, float* r, std::size_t pitch)
  { this->restrictRow(A, fine, coarse, row, r, pitch); };
  correction.solve = [&] { this->solveCoarse(l + 1, parallelFor); };
  correction.prolongRow = [&](std::int64_t row, float* to)
  { this->prolongRow(A, fine, coarse, row, to); };
  SmoothAround(A, this->sweeps, b, x, &correction, parallelFor, done);
}

void SmoothAround(const DiffusionOperator& A, int sweeps, const float* b, float* x,
  const CoarseCorrection* correction, const ParallelFor& parallelFor, const RowBody& done)
{
  const auto relax = [&](std::int64_t row, int colour, const RowFaces& faces)
  {
    const Span span = A.span(row);
    const std::int64_t o = row * A.dims[0] + span.begin;
    std::size_t pitch = 0;
    relaxRow(span.end - span.begin, parityOf(A, row, o, colour), faces, viewRow(A, x, row, o),
      b + o, scratch(1, static_cast<std::size_t>(A.dims[0]), pitch), x + o);
  };
  const int half = 2 * sweeps;
  // 4. smooth: red then black; 3. restrict what is left
  skew(A, correction ? half + 1 : half, parallelFor,
    [&](int stage, std::int64_t row, const RowFaces& faces)
    {
      const Span span = A.span(row);
      const int n = span.end - span.begin;
      const std::int64_t o = row * A.dims[0] + span.begin;
      if (stage == 0)
      {
        startRow(n, parityOf(A, row, o, 0), faces, b + o, x + o);
      }
      else if (stage < half)
      {
        relax(row, stage & 1, faces);
      }
      else
      {
        std::size_t pitch = 0;
        float* r = scratch(9, static_cast<std::size_t>(A.dims[0]), pitch);
        residualRow(n, faces, viewRow(A, x, row, o), b + o, r + span.begin);
        correction->restrictRow(row, r, pitch);
      }
    });
  if (correction)
  {
    correction->solve();
  }
  // 3. correct; 4. smooth: black then red
  const int shift = correction ? 1 : 0;
  const int stages = half + shift;
  skew(A, stages, parallelFor,
    [&](int stage, std::int64_t row, const RowFaces& faces)
    {
      if (stage < shift)
      {
        correction->prolongRow(row, x);
        return;
      }
      relax(row, (stage - shift + 1) & 1, faces);
      if (stage + 1 == stages && done)
      {
        const Span span = A.span(row);
        done(row, row * A.dims[0] + span.begin, span.end - span.begin);
      }
    });
}

void Multigrid::solveCoarse(std::size_t l, const ParallelFor& parallelFor)
{
  Level& level = this->levels[l];
  const DiffusionOperator& C = level.A;
  float* b = level.b.data();
  float* x = level.x.data();
  if (level.first.empty())
  {
    this->cycle(l, b, x, parallelFor, nullptr);
    return;
  }
  // 5. two steps of conjugate gradients: c1 x1 + c2 x2 is the best there in A's norm
  float* x1 = level.first.data();
  float* v1 = level.firstImage.data();
  double xb = 0.;
  this->cycle(l, b, x1, parallelFor, nullptr);
  double a11 = 0.;
  {
    xb = SumEachRow(C, parallelFor,
      [&](std::int64_t, std::int64_t o, int n) { return dotRow(n, x1 + o, b + o); });
    a11 = Apply(C, x1, v1, parallelFor);
  }
  const double t = a11 > 0. ? xb / a11 : 0.;
  if (!(t > 0.) || !std::isfinite(t))
  {
    std::swap(level.first, level.x);
    return;
  }
  ForEachRow(C, parallelFor,
    [&](std::int64_t, std::int64_t o, int n)
    { subtractRow(n, static_cast<float>(t), v1 + o, b + o); });
  this->cycle(l, b, x, parallelFor, nullptr);
  double a22 = 0.;
  double a12 = 0.;
  double x2b = 0.;
  std::vector<double> partial(3 * static_cast<std::size_t>(C.numberOfRows()));
  ForRows(parallelFor, C.numberOfRows(), C.activeSize,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t i = begin; i < end; ++i)
      {
        const std::int64_t row = C.row(i);
        const Span span = C.span(row);
        const int n = span.end - span.begin;
        const std::int64_t o = row * C.dims[0] + span.begin;
        std::size_t pitch = 0;
        float* v2 = scratch(1, static_cast<std::size_t>(n), pitch);
        double* sums = partial.data() + 3 * i;
        sums[0] = applyRow(n, facesOfRow(C, row, o), viewRow(C, x, row, o), v2);
        sums[1] = dotRow(n, x + o, v1 + o);
        sums[2] = dotRow(n, x + o, b + o);
      }
    });
  for (std::size_t i = 0; i < partial.size(); i += 3)
  {
    a22 += partial[i];
    a12 += partial[i + 1];
    x2b += partial[i + 2];
  }
  const double rho = a22 - a12 * a12 / a11;
  const bool second = rho > 1e-6 * a22 && std::isfinite(x2b / rho);
  const double c2 = second ? x2b / rho : 0.;
  const double c1 = t - c2 * a12 / a11;
  ForEachRow(C, parallelFor,
    [&](std::int64_t, std::int64_t o, int n)
    { mixRow(n, static_cast<float>(c1), x1 + o, static_cast<float>(c2), x + o); });
}
} // namespace lighttransport
