// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Coarse.h"

#include "Core/Kernel.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <sstream>
#include <type_traits>

namespace lighttransport
{
namespace
{
/** In parts of the largest D: below it a voxel is a wall. Its inverse and sums of it are floats. */
constexpr float LeastD = 1e-30f;

/**
 * The conductance of a network between its bounds: most of the light stays on its line.
 */
inline float between(float lower, float upper)
{
  return 0.75f * lower + 0.25f * upper;
}

/**
 * What makes a sink of t = s / g per voxel damp as much per length on cells of f voxels as on
 * voxels: (cosh(f kappa) - 1) / (f^2 (cosh kappa - 1)), 2 (cosh kappa - 1) = t, along an axis.
 * Light that goes askew is damped less by the voxels' grid: 0.7 of it.
 */
inline float fitted(float t, int f)
{
  float product = 1.f;
  for (int k = 1; k < f; k *= 2)
  {
    product *= 1.f + 0.25f * t;
    t = std::min(4.f * t * (1.f + 0.25f * t), 1e9f);
  }
  return 1.f + 0.7f * (std::min(product, 1e9f) - 1.f);
}

/** to = from * factor, which is within float's range. */
LIGHTTRANSPORT_SIMD
void scaleFloats(
  int n, const float* LIGHTTRANSPORT_RESTRICT from, float factor, float* LIGHTTRANSPORT_RESTRICT to)
{
  for (int i = 0; i < n; ++i)
  {
    to[i] = from[i] * factor;
  }
}

void scaleRow(int n, const float* from, double factor, float* to)
{
  if (factor > 1e-30 && factor < 1e30)
  {
    scaleFloats(n, from, static_cast<float>(factor), to);
    return;
  }
  for (int i = 0; i < n; ++i)
  {
    to[i] = static_cast<float>(static_cast<double>(from[i]) * factor);
  }
}

void scaleRow(int n, const double* from, double factor, float* to)
{
  for (int i = 0; i < n; ++i)
  {
    to[i] = static_cast<float>(from[i] * factor);
  }
}

/** g = factor H(a, b), H the harmonic mean. */
LIGHTTRANSPORT_SIMD
void facesOf(int n, float factor, const float* LIGHTTRANSPORT_RESTRICT a,
  const float* LIGHTTRANSPORT_RESTRICT b, float* LIGHTTRANSPORT_RESTRICT g)
{
  for (int i = 0; i < n; ++i)
  {
    const float sum = a[i] + b[i];
    g[i] = 2.f * factor * a[i] * (b[i] / (sum > LeastD ? sum : LeastD));
  }
}

/** R += weight / D, and into slab the sums of D over the cells. */
LIGHTTRANSPORT_SIMD
void addResistance(
  int n, float weight, const float* LIGHTTRANSPORT_RESTRICT D, float* LIGHTTRANSPORT_RESTRICT R)
{
  for (int i = 0; i < n; ++i)
  {
    R[i] += weight / (D[i] > LeastD ? D[i] : LeastD);
  }
}

/** w = 255 (walked + part / D) / R, and walked += weight / D. */
LIGHTTRANSPORT_SIMD
void weighRow(int n, float part, float weight, const float* LIGHTTRANSPORT_RESTRICT D,
  const float* LIGHTTRANSPORT_RESTRICT R, float* LIGHTTRANSPORT_RESTRICT walked,
  std::uint8_t* LIGHTTRANSPORT_RESTRICT w)
{
  for (int i = 0; i < n; ++i)
  {
    const float r = 1.f / (D[i] > LeastD ? D[i] : LeastD);
    w[i] = static_cast<std::uint8_t>(255.f * ((walked[i] + part * r) / R[i]) + 0.5f);
    walked[i] += weight * r;
  }
}

} // namespace

//------------------------------------------------------------------------------
/** The rows around one, with a value to spare at either end: D, and the faces to them. */
struct CoarseDiffusion::Around
{
  explicit Around(int n)
    : store(12 * (static_cast<std::size_t>(n) + 2), 0.f)
    , length(static_cast<std::size_t>(n) + 2)
  {
  }
  float* at(int i) { return this->store.data() + 1 + static_cast<std::size_t>(i) * this->length; }
  float* D() { return this->at(0); }
  float* s() { return this->at(1); }
  float* other() { return this->at(2); }
  float* unused() { return this->at(3); }
  float* west() { return this->at(4); }
  float* east() { return this->at(5); }
  float* south() { return this->at(6); }
  float* north() { return this->at(7); }
  float* bottom() { return this->at(8); }
  float* top() { return this->at(9); }
  float* den() { return this->at(10); }

  std::vector<float> store;
  std::size_t length;
};

CoarseDiffusion::CoarseDiffusion(ParallelFor how)
  : parallelFor(how)
  , solver(std::move(how))
{
}

std::int64_t CoarseDiffusion::bytes() const
{
  return this->w[0].bytes() + this->w[1].bytes() + this->w[2].bytes() + this->psi.bytes() +
    this->cellSource.bytes() + this->cellPhi.bytes() + this->before.bytes();
}

void CoarseDiffusion::load(std::int64_t row, float* D, float* s) const
{
  const int n = this->fine.dims[0];
  const std::int64_t o = row * n;
  const auto from = [&](const auto& medium)
  {
    scaleRow(n, medium.D + o, 1. / this->largestD, D);
    if (s && medium.sigma_a)
    {
      scaleRow(n, medium.sigma_a + o, 1. / this->scale, s);
    }
    else if (s)
    {
      std::fill(s, s + n, 0.f);
    }
    if (medium.outside)
    {
      for (int i = 0; i < n; ++i)
      {
        if (medium.outside[o + i])
        {
          D[i] = 0.f;
          if (s)
          {
            s[i] = 0.f;
          }
        }
      }
    }
  };
  if (this->floatMedium.D)
  {
    from(this->floatMedium);
  }
  else
  {
    from(this->doubleMedium);
  }
}

//------------------------------------------------------------------------------
template <class T>
DiffusionReport CoarseDiffusion::setMedium(
  const DiffusionMedium<T>& medium, int factor, bool inHaste, const ProgressFunction& progress)
{
  const WatchedFor::Asking asking(this->parallelFor, progress);
  const WatchedFor::Asking inner(this->solver.parallelFor, progress);
  try
  {
    return this->prepare(medium, factor, inHaste);
  }
  catch (const Interrupted&)
  {
    DiffusionReport report;
    report.reason = StopReason::Cancelled;
    report.message = "cancelled while setting up";
    return report;
  }
}

template <class T>
DiffusionReport CoarseDiffusion::prepare(const DiffusionMedium<T>& medium, int factor, bool inHaste)
{
  const double began = now();
  DiffusionReport report = this->solver.check(medium);
  if (report.reason != StopReason::Converged)
  {
    return report;
  }
  this->fine = this->coarse = medium.grid;
  this->hasty = inHaste;
  this->scale = this->solver.scale;
  this->floatMedium = DiffusionMedium<float>();
  this->doubleMedium = DiffusionMedium<double>();
  if constexpr (std::is_same_v<T, float>)
  {
    this->floatMedium = medium;
  }
  else
  {
    this->doubleMedium = medium;
  }
  const std::array<int, 3>& n = this->fine.dims;
  const std::array<double, 3>& h = this->fine.spacing;
  const double smallest = this->fine.smallestSpacing();
  const double longest = factor * smallest * (1. + 1e-6);
  for (int d = 0; d < 3; ++d)
  {
    this->factors[d] = 1;
    while (n[d] > 1 && 2 * this->factors[d] <= factor && 2. * this->factors[d] * h[d] <= longest)
    {
      this->factors[d] *= 2;
    }
    this->coarse.dims[d] = (n[d] + this->factors[d] - 1) / this->factors[d];
    this->coarse.spacing[d] = this->factors[d] * h[d];
  }
  for (this->shift = 0; 1 << this->shift < this->factors[0];)
  {
    ++this->shift;
  }

  std::vector<double> most(static_cast<std::size_t>(n[1]) * n[2]);
  std::atomic<bool> walls{ medium.outside != nullptr };
  ForRows(this->parallelFor, static_cast<std::int64_t>(most.size()), this->fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        T m = T(0);
        bool wall = false;
        for (std::int64_t i = r * n[0]; i < (r + 1) * n[0]; ++i)
        {
          m = medium.outside && medium.outside[i] ? m : std::max(m, medium.D[i]);
          wall = wall || (!medium.outside && !(medium.D[i] > T(0)));
        }
        most[static_cast<std::size_t>(r)] = static_cast<double>(m);
        walls = walls || wall;
      }
    });
  this->anyWall = walls;
  this->largestD = *std::max_element(most.begin(), most.end());
  if (!(this->largestD > 0.))
  {
    this->largestD = 1.;
  }
  const double twoA =
    medium.boundary == Boundary::Robin ? 2. * BoundaryFactor(medium.refractiveIndexRatio) : 0.;
  for (int d = 0; d < 3; ++d)
  {
    this->perD[d] =
      n[d] > 1 ? static_cast<float>(this->largestD / (h[d] * h[d] * this->scale)) : 0.f;
    this->beyond[d] = n[d] == 1 || medium.boundary == Boundary::ZeroFlux
      ? -1.f
      : static_cast<float>(std::min(1e30, twoA * this->largestD / h[d]));
    this->w[d].allocate(this->factors[d] > 1 ? this->fine.size() : 0);
  }
  this->psi.allocate(this->fine.size());

  DiffusionOperator C;
  C.allocate(this->coarse.dims);
  this->facesAlongX(C);
  this->facesAcross(1, C);
  this->facesAcross(2, C);
  this->sinks(C);
  // a cell's equation is the sum of its voxels'
  this->solver.setOperator(this->coarse, std::move(C), this->scale);
  report.bytes = this->bytes();
  report.seconds = now() - began;
  return report;
}

//------------------------------------------------------------------------------
void CoarseDiffusion::facesAlongX(DiffusionOperator& C)
{
  const std::array<int, 3>& n = this->fine.dims;
  const std::array<int, 3>& nc = this->coarse.dims;
  const int f = this->factors[0];
  if (n[0] == 1)
  {
    return;
  }
  const std::int64_t rows = static_cast<std::int64_t>(nc[1]) * nc[2];
  ForRows(this->parallelFor, rows, this->fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      const std::size_t cells = static_cast<std::size_t>(nc[0]);
      std::vector<float> store(static_cast<std::size_t>(n[0]) + 2);
      std::vector<float> layers(static_cast<std::size_t>(n[0]));
      // resistance from the middle of a cell to its ends, the sum of lines without exchange
      std::vector<float> below(cells), above(cells), parallel(cells + 1);
      float* D = store.data() + 1;
      for (std::int64_t row = begin; row < end; ++row)
      {
        const int J = static_cast<int>(row % nc[1]);
        const int K = static_cast<int>(row / nc[1]);
        std::fill(layers.begin(), layers.end(), 0.f);
        std::fill(parallel.begin(), parallel.end(), 0.f);
        int lines = 0;
        for (int k = K * this->factors[2]; k < K * this->factors[2] + this->cells(2, K); ++k)
        {
          for (int j = J * this->factors[1]; j < J * this->factors[1] + this->cells(1, J); ++j)
          {
            const std::int64_t fineRow = j + static_cast<std::int64_t>(n[1]) * k;
            this->load(fineRow, D, nullptr);
            ++lines;
            for (int I = 0; I < nc[0]; ++I)
            {
              const int m = this->cells(0, I);
              float lowR = 0.f;
              float highR = 0.f;
              for (int p = 0; p < m; ++p)
              {
                const float r = 1.f / std::max(D[I * f + p], LeastD);
                lowR += low(p, m) * r;
                highR += (1.f - low(p, m)) * r;
                layers[static_cast<std::size_t>(std::int64_t{ f } * I + p)] += D[I * f + p];
              }
              below[static_cast<std::size_t>(I)] = lowR;
              above[static_cast<std::size_t>(I)] = highR;
            }
            for (int I = -1; I < nc[0]; ++I)
            {
              const bool inside = I >= 0 && I + 1 < nc[0];
              if (!inside && this->beyond[0] < 0.f)
              {
                continue;
              }
              const float R = (I >= 0 ? above[static_cast<std::size_t>(I)] : this->beyond[0]) +
                (I + 1 < nc[0] ? below[static_cast<std::size_t>(I) + 1] : this->beyond[0]);
              parallel[static_cast<std::size_t>(I) + 1] += 1.f / R;
              if (f == 1)
              {
                continue;
              }
              std::uint8_t* weights = this->w[0].data() + fineRow * n[0];
              float walked = 0.f;
              for (int p = 0; I >= 0 && p < this->cells(0, I); ++p)
              {
                const float part = 1.f - low(p, this->cells(0, I));
                if (part > 0.5f)
                {
                  const float r = 1.f / std::max(D[I * f + p], LeastD);
                  weights[I * f + p] =
                    static_cast<std::uint8_t>(255.f * ((walked + (part - 0.5f) * r) / R) + 0.5f);
                }
                walked += part / std::max(D[I * f + p], LeastD);
              }
              walked = 0.f;
              for (int p = I + 1 < nc[0] ? this->cells(0, I + 1) - 1 : -1; p >= 0; --p)
              {
                const float part = low(p, this->cells(0, I + 1));
                const int i = (I + 1) * f + p;
                if (part > 0.5f)
                {
                  const float r = 1.f / std::max(D[i], LeastD);
                  weights[i] =
                    static_cast<std::uint8_t>(255.f * ((walked + (part - 0.5f) * r) / R) + 0.5f);
                }
                walked += part / std::max(D[i], LeastD);
              }
            }
          }
        }
        for (int I = -1; I < nc[0]; ++I)
        {
          const bool inside = I >= 0 && I + 1 < nc[0];
          if (!inside && this->beyond[0] < 0.f)
          {
            continue;
          }
          float series = 0.f;
          for (int side = 0; side < 2; ++side)
          {
            const int cell = I + side;
            if (cell < 0 || cell >= nc[0])
            {
              series += this->beyond[0] / static_cast<float>(lines);
              continue;
            }
            const int m = this->cells(0, cell);
            for (int p = 0; p < m; ++p)
            {
              const float part = side ? low(p, m) : 1.f - low(p, m);
              series += part /
                std::max(layers[static_cast<std::size_t>(std::int64_t{ f } * cell + p)], LeastD);
            }
          }
          const float g = this->perD[0] *
            between(parallel[static_cast<std::size_t>(I) + 1], 1.f / std::max(series, LeastD));
          const std::int64_t c = row * nc[0];
          (inside ? C.g[0][c + I] : C.s[c + (I < 0 ? 0 : I)]) += g;
        }
      }
    });
}

/** The same along y or z, a row at a time. */
void CoarseDiffusion::facesAcross(int d, DiffusionOperator& C)
{
  const std::array<int, 3>& n = this->fine.dims;
  const std::array<int, 3>& nc = this->coarse.dims;
  const int f = this->factors[d];
  const int other = 3 - d;
  if (n[d] == 1)
  {
    return;
  }
  ForRows(this->parallelFor, nc[other], this->fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      const std::size_t length = static_cast<std::size_t>(n[0]);
      std::vector<float> D(static_cast<std::size_t>(2 * f) * length), R(length), walked(length);
      std::vector<float> layers(static_cast<std::size_t>(2 * f) * static_cast<std::size_t>(nc[0]));
      std::vector<float> parallel(static_cast<std::size_t>(nc[0]));
      for (int O = static_cast<int>(begin); O < static_cast<int>(end); ++O)
      {
        for (int at = -1; at < nc[d]; ++at)
        {
          const bool inside = at >= 0 && at + 1 < nc[d];
          if (!inside && this->beyond[d] < 0.f)
          {
            continue;
          }
          // the layers of the line: the upper half of this cell, the lower of the next
          struct Layer
          {
            int position;
            float weight;
            bool below; // of the face
          };
          std::vector<Layer> line;
          for (int side = 0; side < 2; ++side)
          {
            const int cell = at + side;
            const int m = cell >= 0 && cell < nc[d] ? this->cells(d, cell) : 0;
            for (int p = 0; p < m; ++p)
            {
              const float part = side ? low(p, m) : 1.f - low(p, m);
              if (part > 0.f)
              {
                line.push_back({ cell * f + p, part, side == 0 });
              }
            }
          }
          std::fill(layers.begin(), layers.end(), 0.f);
          std::fill(parallel.begin(), parallel.end(), 0.f);
          const int lines = this->cells(other, O);
          for (int o = O * this->factors[other]; o < O * this->factors[other] + lines; ++o)
          {
            const auto rowOf = [&](int position)
            {
              return d == 1 ? position + static_cast<std::int64_t>(n[1]) * o
                            : o + static_cast<std::int64_t>(n[1]) * position;
            };
            std::fill(R.begin(), R.end(), inside ? 0.f : this->beyond[d]);
            for (std::size_t l = 0; l < line.size(); ++l)
            {
              float* row = D.data() + l * length;
              this->load(rowOf(line[l].position), row, nullptr);
              addResistance(n[0], line[l].weight, row, R.data());
              float* layer = layers.data() + l * static_cast<std::size_t>(nc[0]);
              for (int i = 0; i < n[0]; ++i)
              {
                layer[i >> this->shift] += row[i];
              }
            }
            for (int i = 0; i < n[0]; ++i)
            {
              parallel[static_cast<std::size_t>(i >> this->shift)] +=
                1.f / R[static_cast<std::size_t>(i)];
            }
            if (f == 1)
            {
              continue;
            }
            // away from each middle
            const auto weigh = [&](std::size_t l)
            {
              if (line[l].weight > 0.5f)
              {
                weighRow(n[0], line[l].weight - 0.5f, line[l].weight, D.data() + l * length,
                  R.data(), walked.data(), this->w[d].data() + rowOf(line[l].position) * n[0]);
              }
              else
              {
                addResistance(n[0], line[l].weight, D.data() + l * length, walked.data());
              }
            };
            std::fill(walked.begin(), walked.end(), 0.f);
            for (std::size_t l = 0; l < line.size() && line[l].below; ++l)
            {
              weigh(l);
            }
            std::fill(walked.begin(), walked.end(), 0.f);
            for (std::size_t l = line.size(); l > 0 && !line[l - 1].below; --l)
            {
              weigh(l - 1);
            }
          }
          const int J = d == 1 ? std::max(at, 0) : O;
          const int K = d == 1 ? O : std::max(at, 0);
          const std::int64_t c = nc[0] * (J + static_cast<std::int64_t>(nc[1]) * K);
          for (int I = 0; I < nc[0]; ++I)
          {
            float series = 0.f;
            for (std::size_t l = 0; l < line.size(); ++l)
            {
              series += line[l].weight /
                std::max(layers[l * static_cast<std::size_t>(nc[0]) + static_cast<std::size_t>(I)],
                  LeastD);
            }
            if (!inside)
            {
              series += this->beyond[d] / static_cast<float>(lines * this->cells(0, I));
            }
            const float g = this->perD[d] *
              between(parallel[static_cast<std::size_t>(I)], 1.f / std::max(series, LeastD));
            (inside ? C.g[d][c + I] : C.s[c + I]) += g;
          }
        }
      }
    });
}

//------------------------------------------------------------------------------
namespace
{
/** The faces of row r to all six sides, 0 beyond the box. */
template <class Around, class Load>
void facesAround(Around& a, const Grid& grid, const std::array<float, 3>& perD, std::int64_t r,
  bool sinks, const Load& load)
{
  const std::array<int, 3>& n = grid.dims;
  const int at[3] = { 0, static_cast<int>(r % n[1]), static_cast<int>(r / n[1]) };
  float* D = a.D();
  load(r, D, sinks ? a.s() : nullptr);
  D[-1] = D[n[0]] = 0.f;
  facesOf(n[0], perD[0], D, D - 1, a.west());
  facesOf(n[0], perD[0], D, D + 1, a.east());
  float* const faces[2][2] = { { a.south(), a.north() }, { a.bottom(), a.top() } };
  for (int d = 1; d < 3; ++d)
  {
    for (int side = 0; side < 2; ++side)
    {
      float* g = faces[d - 1][side];
      const int to = at[d] + (side ? 1 : -1);
      if (to < 0 || to >= n[d])
      {
        std::fill(g, g + n[0], 0.f);
        continue;
      }
      load(
        r + (side ? 1 : -1) * (d == 1 ? 1 : static_cast<std::int64_t>(n[1])), a.other(), nullptr);
      facesOf(n[0], perD[d], D, a.other(), g);
    }
  }
}

LIGHTTRANSPORT_SIMD
void sumFaces(int n, const float* LIGHTTRANSPORT_RESTRICT w, const float* LIGHTTRANSPORT_RESTRICT e,
  const float* LIGHTTRANSPORT_RESTRICT s, const float* LIGHTTRANSPORT_RESTRICT nn,
  const float* LIGHTTRANSPORT_RESTRICT b, const float* LIGHTTRANSPORT_RESTRICT t,
  float* LIGHTTRANSPORT_RESTRICT sum)
{
  for (int i = 0; i < n; ++i)
  {
    sum[i] = ((w[i] + e[i]) + (s[i] + nn[i])) + (b[i] + t[i]);
  }
}
} // namespace

void CoarseDiffusion::sinks(DiffusionOperator& C)
{
  const std::array<int, 3>& n = this->fine.dims;
  const std::array<int, 3>& nc = this->coarse.dims;
  const std::int64_t rows = static_cast<std::int64_t>(n[1]) * n[2];
  const auto loader = [this](std::int64_t r, float* D, float* s) { this->load(r, D, s); };
  // one sweep from 1
  Buffer<std::uint8_t> first(this->hasty ? 0 : this->fine.size());
  ForRows(this->parallelFor, this->hasty ? 0 : rows, this->fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      Around a(n[0]);
      for (std::int64_t r = begin; r < end; ++r)
      {
        facesAround(a, this->fine, this->perD, r, true, loader);
        sumFaces(n[0], a.west(), a.east(), a.south(), a.north(), a.bottom(), a.top(), a.den());
        for (int i = 0; i < n[0]; ++i)
        {
          const float sum = a.den()[i] + a.s()[i];
          first[r * n[0] + i] =
            static_cast<std::uint8_t>(sum > LeastD ? 255.f * (a.den()[i] / sum) + 0.5f : 0.f);
        }
      }
    });
  // and another; then relative to the best of the cell
  const std::int64_t coarseRows = static_cast<std::int64_t>(nc[1]) * nc[2];
  ForRows(this->parallelFor, coarseRows, this->fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      Around a(n[0]);
      const std::size_t length = static_cast<std::size_t>(n[0]);
      const int most = this->factors[1] * this->factors[2];
      std::vector<float> left(static_cast<std::size_t>(most) * length);
      std::vector<float> s(static_cast<std::size_t>(most) * length);
      std::vector<float> Ds(static_cast<std::size_t>(most) * length);
      std::vector<float> best(static_cast<std::size_t>(nc[0]));
      for (std::int64_t row = begin; row < end; ++row)
      {
        const int J = static_cast<int>(row % nc[1]);
        const int K = static_cast<int>(row / nc[1]);
        std::fill(best.begin(), best.end(), 0.f);
        const int ny = this->cells(1, J);
        const int nz = this->cells(2, K);
        for (int at = 0; at < ny * nz; ++at)
        {
          const std::int64_t r = J * this->factors[1] + at % ny +
            static_cast<std::int64_t>(n[1]) * (K * this->factors[2] + at / ny);
          float* out = left.data() + static_cast<std::size_t>(at) * length;
          float* sink = s.data() + static_cast<std::size_t>(at) * length;
          if (this->hasty)
          {
            // one sweep, were all around like the voxel itself
            float* D = Ds.data() + static_cast<std::size_t>(at) * length;
            this->load(r, D, sink);
            const float all = 2.f * (this->perD[0] + this->perD[1] + this->perD[2]);
            for (int i = 0; i < n[0]; ++i)
            {
              out[i] = all * D[i] / std::max(all * D[i] + sink[i], LeastD);
              float& b = best[static_cast<std::size_t>(i >> this->shift)];
              b = std::max(b, out[i]);
            }
            continue;
          }
          facesAround(a, this->fine, this->perD, r, true, loader);
          sumFaces(n[0], a.west(), a.east(), a.south(), a.north(), a.bottom(), a.top(), a.den());
          const std::uint8_t* own = first.data() + r * n[0];
          const std::int64_t slice = static_cast<std::int64_t>(n[0]) * n[1];
          // the faces beyond the box are 0, their voxels any that can be read
          const std::uint8_t* S = r % n[1] > 0 ? own - n[0] : own;
          const std::uint8_t* N = r % n[1] + 1 < n[1] ? own + n[0] : own;
          const std::uint8_t* B = r / n[1] > 0 ? own - slice : own;
          const std::uint8_t* T = r / n[1] + 1 < n[2] ? own + slice : own;
          std::copy(a.s(), a.s() + n[0], sink);
          std::copy(a.D(), a.D() + n[0], Ds.data() + static_cast<std::size_t>(at) * length);
          for (int i = 0; i < n[0]; ++i)
          {
            const float num = a.west()[i] * static_cast<float>(own[i - 1]) +
              a.east()[i] * static_cast<float>(own[i + 1]) +
              a.south()[i] * static_cast<float>(S[i]) + a.north()[i] * static_cast<float>(N[i]) +
              a.bottom()[i] * static_cast<float>(B[i]) + a.top()[i] * static_cast<float>(T[i]);
            const float den = a.den()[i] + sink[i];
            out[i] = den > LeastD ? num / (255.f * den) : 0.f;
            float& b = best[static_cast<std::size_t>(i >> this->shift)];
            b = std::max(b, out[i]);
          }
        }
        for (int at = 0; at < ny * nz; ++at)
        {
          const std::int64_t r = J * this->factors[1] + at % ny +
            static_cast<std::int64_t>(n[1]) * (K * this->factors[2] + at / ny);
          const float* own = left.data() + static_cast<std::size_t>(at) * length;
          const float* sink = s.data() + static_cast<std::size_t>(at) * length;
          const float* D = Ds.data() + static_cast<std::size_t>(at) * length;
          for (int i = 0; i < n[0]; ++i)
          {
            const int I = i >> this->shift;
            const float b = best[static_cast<std::size_t>(I)];
            const float part = b > 0.f ? own[i] / b : 1.f;
            this->psi[r * n[0] + i] = static_cast<std::uint8_t>(255.f * part + 0.5f);
            if (!(sink[i] > 0.f))
            {
              continue;
            }
            float fit = 0.f;
            for (int d = 0; d < 3; ++d)
            {
              const float g = std::max(this->perD[d] * D[i], LeastD);
              fit += fitted(std::min(sink[i] / g * part * part, 1e9f), this->factors[d]) / 3.f;
            }
            C.s[row * nc[0] + I] += sink[i] * part * fit;
          }
        }
      }
    });
}

//------------------------------------------------------------------------------
namespace
{
/** own += v (1 - wx), next += v wx with v = value psi fy fz; f is w or, to the own cell, 1 - w. */
LIGHTTRANSPORT_SIMD
void restrictRow(int n, const double* LIGHTTRANSPORT_RESTRICT value,
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT psi, const std::uint8_t* LIGHTTRANSPORT_RESTRICT wx,
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT wy, float y0, float y1,
  const std::uint8_t* LIGHTTRANSPORT_RESTRICT wz, float z0, float z1,
  double* LIGHTTRANSPORT_RESTRICT own, double* LIGHTTRANSPORT_RESTRICT next)
{
  constexpr float unit = 1.f / 255.f;
  for (int i = 0; i < n; ++i)
  {
    const float part = unit * static_cast<float>(psi[i]) * (y0 + y1 * static_cast<float>(wy[i])) *
      (z0 + z1 * static_cast<float>(wz[i]));
    const double v = value[i] * static_cast<double>(part);
    const double u = v * static_cast<double>(unit * static_cast<float>(wx[i]));
    own[i] += v - u;
    next[i] += u;
  }
}
} // namespace

template <class Q>
void CoarseDiffusion::restrict(const Q* q, double* b) const
{
  const std::array<int, 3>& n = this->fine.dims;
  const std::array<int, 3>& nc = this->coarse.dims;
  const std::int64_t rows = static_cast<std::int64_t>(n[1]) * n[2];
  // rows without light are many
  std::vector<std::uint8_t> lit(static_cast<std::size_t>(rows), 0);
  ForRows(this->parallelFor, rows, this->fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        const Q* row = q + r * n[0];
        lit[static_cast<std::size_t>(r)] =
          std::any_of(row, row + n[0], [](Q v) { return v != Q(0); });
      }
    });
  ForRows(this->parallelFor, static_cast<std::int64_t>(nc[1]) * nc[2], this->fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      const std::size_t length = static_cast<std::size_t>(n[0]);
      std::vector<double> values(length), own(length), next(length);
      const std::vector<std::uint8_t> none(length, 0);
      const int f = this->factors[0];
      for (std::int64_t row = begin; row < end; ++row)
      {
        std::fill(own.begin(), own.end(), 0.);
        std::fill(next.begin(), next.end(), 0.);
        const int J[3] = { 0, static_cast<int>(row % nc[1]), static_cast<int>(row / nc[1]) };
        int first[3], last[3];
        for (int d = 1; d < 3; ++d)
        {
          // its own voxels, and the near halves of the cells beside it
          const int reach = this->factors[d] > 1 ? this->factors[d] / 2 : 0;
          first[d] = std::max(0, J[d] * this->factors[d] - reach);
          last[d] = std::min(n[d], (J[d] + 1) * this->factors[d] + reach);
        }
        for (int k = first[2]; k < last[2]; ++k)
        {
          for (int j = first[1]; j < last[1]; ++j)
          {
            const std::int64_t r = j + static_cast<std::int64_t>(n[1]) * k;
            if (!lit[static_cast<std::size_t>(r)])
            {
              continue;
            }
            const int at[3] = { 0, j, k };
            const std::uint8_t* weights[3];
            float constant[3] = { 1.f, 1.f, 1.f };
            float slope[3] = { 0.f, 0.f, 0.f };
            bool touches = true;
            for (int d = 0; d < 3; ++d)
            {
              weights[d] = this->factors[d] > 1 ? this->w[d].data() + r * n[0] : none.data();
              if (d > 0 && this->factors[d] > 1)
              {
                const bool inside = at[d] / this->factors[d] == J[d];
                touches = touches && (inside || this->neighbour(d, at[d]) == J[d]);
                constant[d] = inside ? 1.f : 0.f;
                slope[d] = (inside ? -1.f : 1.f) / 255.f;
              }
            }
            if (!touches)
            {
              continue;
            }
            const Q* source = q + r * n[0];
            std::copy(source, source + n[0], values.begin());
            restrictRow(n[0], values.data(), this->psi.data() + r * n[0], weights[0], weights[1],
              constant[1], slope[1], weights[2], constant[2], slope[2], own.data(), next.data());
          }
        }
        double* out = b + row * nc[0];
        std::fill(out, out + nc[0], 0.);
        for (int i = 0; i < n[0]; ++i)
        {
          out[i >> this->shift] += own[static_cast<std::size_t>(i)];
          const int beside = f > 1 ? this->neighbour(0, i) : -1;
          if (beside >= 0 && beside < nc[0])
          {
            out[beside] += next[static_cast<std::size_t>(i)];
          }
        }
      }
    });
}

namespace
{
/** A row of cells on its voxels: the own cell's value, and that of the cell beside it. */
void spread(int n, int cells, int f, const double* LIGHTTRANSPORT_RESTRICT x,
  double* LIGHTTRANSPORT_RESTRICT own, double* LIGHTTRANSPORT_RESTRICT beside)
{
  double before = 0.;
  for (int I = 0; I < cells; ++I)
  {
    const double here = x[I];
    const double after = I + 1 < cells ? x[I + 1] : 0.;
    const int m = std::min(f, n - I * f);
    if (f == 2 && m == 2)
    {
      own[2 * I] = own[2 * I + 1] = here;
      beside[2 * I] = before;
      beside[2 * I + 1] = after;
    }
    else
    {
      for (int p = 0; p < m; ++p)
      {
        own[I * f + p] = here;
        beside[I * f + p] = 2 * p + 1 > m ? after : before;
      }
    }
    before = here;
  }
}

/** One row of 4. from the four rows of cells around it, spread along x by `u` and `s`. */
LIGHTTRANSPORT_SIMD
void prolongRow(int n, const std::uint8_t* LIGHTTRANSPORT_RESTRICT wx, const std::uint8_t* wy,
  const std::uint8_t* wz, const std::uint8_t* LIGHTTRANSPORT_RESTRICT psi, const double* const* own,
  const double* const* next, double* LIGHTTRANSPORT_RESTRICT phi)
{
  constexpr double unit = 1. / 255.;
  const double *u0 = own[0], *u1 = own[1], *u2 = own[2], *u3 = own[3];
  const double *s0 = next[0], *s1 = next[1], *s2 = next[2], *s3 = next[3];
  for (int i = 0; i < n; ++i)
  {
    const double a = unit * wx[i];
    const double b = unit * wy[i];
    const double c = unit * wz[i];
    const double v0 = u0[i] + a * (s0[i] - u0[i]);
    const double v1 = u1[i] + a * (s1[i] - u1[i]);
    const double v2 = u2[i] + a * (s2[i] - u2[i]);
    const double v3 = u3[i] + a * (s3[i] - u3[i]);
    const double y0 = v0 + b * (v1 - v0);
    const double y1 = v2 + b * (v3 - v2);
    phi[i] += unit * psi[i] * (y0 + c * (y1 - y0));
  }
}
} // namespace

void CoarseDiffusion::prolong(const double* x, double* phi) const
{
  const std::array<int, 3>& n = this->fine.dims;
  const std::array<int, 3>& nc = this->coarse.dims;
  const std::int64_t rows = static_cast<std::int64_t>(n[1]) * n[2];
  ForRows(this->parallelFor.whole(), rows, this->fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      const std::size_t length = static_cast<std::size_t>(n[0]);
      std::vector<double> store(8 * length);
      const std::vector<std::uint8_t> none(length, 0);
      const std::vector<double> dark(static_cast<std::size_t>(nc[0]), 0.);
      for (std::int64_t r = begin; r < end; ++r)
      {
        const int at[3] = { 0, static_cast<int>(r % n[1]), static_cast<int>(r / n[1]) };
        int J[3][2];
        const std::uint8_t* weights[3];
        for (int d = 0; d < 3; ++d)
        {
          J[d][0] = at[d] / this->factors[d];
          J[d][1] = this->neighbour(d, at[d]);
          weights[d] = this->factors[d] > 1 ? this->w[d].data() + r * n[0] : none.data();
        }
        const double* own[4];
        const double* next[4];
        for (int c = 0; c < 4; ++c)
        {
          const int y = J[1][c & 1];
          const int z = J[2][c >> 1];
          const double* xc = y >= 0 && y < nc[1] && z >= 0 && z < nc[2]
            ? x + nc[0] * (y + static_cast<std::int64_t>(nc[1]) * z)
            : dark.data();
          double* u = store.data() + 2 * static_cast<std::size_t>(c) * length;
          double* s = u + length;
          spread(n[0], nc[0], this->factors[0], xc, u, s);
          own[c] = u;
          next[c] = s;
        }
        prolongRow(n[0], weights[0], weights[1], weights[2], this->psi.data() + r * n[0], own, next,
          phi + r * n[0]);
      }
    });
}

/** The full equations of row r: the faces, and in den their sum with the sinks. */
void CoarseDiffusion::equations(Around& a, std::int64_t r) const
{
  const std::array<int, 3>& n = this->fine.dims;
  const int j = static_cast<int>(r % n[1]);
  const int k = static_cast<int>(r / n[1]);
  facesAround(a, this->fine, this->perD, r, true,
    [this](std::int64_t row, float* D, float* s) { this->load(row, D, s); });
  sumFaces(n[0], a.west(), a.east(), a.south(), a.north(), a.bottom(), a.top(), a.den());
  float* den = a.den();
  const float* s = a.s();
  for (int i = 0; i < n[0]; ++i)
  {
    den[i] += s[i];
  }
  const auto border = [&](int d, int i)
  {
    if (this->beyond[d] >= 0.f)
    {
      den[i] += this->perD[d] / (0.5f / std::max(a.D()[i], LeastD) + this->beyond[d]);
    }
  };
  border(0, 0);
  border(0, n[0] - 1);
  const int borders[3] = { 0, (j == 0) + (j + 1 == n[1]), (k == 0) + (k + 1 == n[2]) };
  for (int d = 1; d < 3; ++d)
  {
    for (int side = 0; side < borders[d]; ++side)
    {
      for (int i = 0; i < n[0]; ++i)
      {
        border(d, i);
      }
    }
  }
}

namespace
{
/** What comes into a row's voxels through their faces. */
LIGHTTRANSPORT_SIMD
void inflowRow(int n, const float* LIGHTTRANSPORT_RESTRICT w,
  const float* LIGHTTRANSPORT_RESTRICT e, const float* LIGHTTRANSPORT_RESTRICT s,
  const float* LIGHTTRANSPORT_RESTRICT nn, const float* LIGHTTRANSPORT_RESTRICT b,
  const float* LIGHTTRANSPORT_RESTRICT t, const double* own, const double* S, const double* N,
  const double* B, const double* T, double* LIGHTTRANSPORT_RESTRICT in)
{
  for (int i = 0; i < n; ++i)
  {
    in[i] = double(w[i]) * own[i - 1] + double(e[i]) * own[i + 1] + double(s[i]) * S[i] +
      double(nn[i]) * N[i] + double(b[i]) * B[i] + double(t[i]) * T[i];
  }
}

/** x = (in + inverse q) / den on the voxels i with (i + parity) even. */
template <class Q>
void relaxRow(int n, int parity, const double* LIGHTTRANSPORT_RESTRICT in,
  const float* LIGHTTRANSPORT_RESTRICT den, const Q* LIGHTTRANSPORT_RESTRICT q, double inverse,
  double* LIGHTTRANSPORT_RESTRICT x)
{
  for (int i = 0; i < n; ++i)
  {
    const double d = static_cast<double>(den[i] > LeastD ? den[i] : 1.f);
    const double v = (in[i] + inverse * static_cast<double>(q[i])) / d;
    x[i] = ((i + parity) & 1) || !(den[i] > LeastD) ? x[i] : v;
  }
}
} // namespace

/** action(row, its faces, what comes in through them) for the rows [begin, end). */
template <class Action>
void CoarseDiffusion::forEquations(
  const double* phi, std::int64_t begin, std::int64_t end, const Action& action) const
{
  const std::array<int, 3>& n = this->fine.dims;
  const std::int64_t slice = static_cast<std::int64_t>(n[0]) * n[1];
  Around a(n[0]);
  std::vector<double> store(2 * (static_cast<std::size_t>(n[0]) + 2), 0.);
  double* own = store.data() + 1;
  double* in = own + n[0] + 2;
  for (std::int64_t r = begin; r < end; ++r)
  {
    this->equations(a, r);
    const int j = static_cast<int>(r % n[1]);
    const int k = static_cast<int>(r / n[1]);
    const double* row = phi + r * n[0];
    std::copy(row, row + n[0], own);
    // faces beyond the box are 0, and the row itself can stand for what is behind them
    inflowRow(n[0], a.west(), a.east(), a.south(), a.north(), a.bottom(), a.top(), own,
      j > 0 ? row - n[0] : own, j + 1 < n[1] ? row + n[0] : own, k > 0 ? row - slice : own,
      k + 1 < n[2] ? row + slice : own, in);
    action(r, a, in);
  }
}

/** r = (q - A phi), in the source's unit; returns its norm. */
template <class Q>
double CoarseDiffusion::residual(const Q* q, const double* phi, double* out) const
{
  const std::array<int, 3>& n = this->fine.dims;
  const std::int64_t rows = static_cast<std::int64_t>(n[1]) * n[2];
  std::vector<double> sums(static_cast<std::size_t>(rows));
  ForRows(this->parallelFor, rows, this->fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      this->forEquations(phi, begin, end,
        [&](std::int64_t r, Around& a, const double* in)
        {
          const float* den = a.den();
          double sum = 0.;
          for (int i = 0; i < n[0]; ++i)
          {
            const std::int64_t v = r * n[0] + i;
            const double left = static_cast<double>(q[v]) +
              this->scale * (in[i] - static_cast<double>(den[i]) * phi[v]);
            sum += left * left;
            if (out)
            {
              out[v] = left;
            }
          }
          sums[static_cast<std::size_t>(r)] = sum;
        });
    });
  double sum = 0.;
  for (const double part : sums)
  {
    sum += part;
  }
  return std::sqrt(sum);
}

template <class Q>
void CoarseDiffusion::relax(const Q* q, double* phi) const
{
  const std::array<int, 3>& n = this->fine.dims;
  // A row's loop reads and rewrites the other colour too: no two slabs that touch at a time.
  constexpr int thickness = 4;
  const std::int64_t pairs = std::max(1, n[2] / (2 * thickness));
  for (int colour = 0; colour < 2; ++colour)
  {
    for (int odd = 0; odd < 2; ++odd)
    {
      ForRows(this->parallelFor, pairs, this->fine.size(),
        [&](std::int64_t begin, std::int64_t end)
        {
          for (std::int64_t pair = begin; pair < end; ++pair)
          {
            const std::int64_t from = n[2] * (2 * pair + odd) / (2 * pairs);
            const std::int64_t to = n[2] * (2 * pair + odd + 1) / (2 * pairs);
            this->forEquations(phi, from * n[1], to * n[1],
              [&](std::int64_t r, Around& a, const double* in)
              {
                relaxRow(n[0], static_cast<int>((r % n[1] + r / n[1] + colour) & 1), in, a.den(),
                  q + r * n[0], 1. / this->scale, phi + r * n[0]);
              });
          }
        });
    }
  }
}

template <class T, class Q>
bool CoarseDiffusion::escapes(
  const DiffusionMedium<T>& medium, const Q* q, DiffusionReport& report) const
{
  const std::array<int, 3>& n = this->fine.dims;
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  const auto open = [&](std::int64_t i)
  { return !(medium.outside && medium.outside[i]) && medium.D[i] > T(0); };
  std::vector<std::uint8_t> seen(static_cast<std::size_t>(this->fine.size()), 0);
  for (std::int64_t seed = 0; seed < this->fine.size(); ++seed)
  {
    if (q[seed] == Q(0) || seen[static_cast<std::size_t>(seed)] ||
      (medium.outside && medium.outside[seed]))
    {
      continue;
    }
    // Flood the seed's part until a sink is met, or what another flood has seen: that had one.
    double sum = 0.;
    double magnitude = 0.;
    bool sink = false;
    const std::uint8_t mark = 1;
    const std::uint8_t own = 2;
    std::vector<std::int64_t> visited(1, seed);
    seen[static_cast<std::size_t>(seed)] = own;
    for (std::size_t next = 0; next < visited.size() && !sink; ++next)
    {
      const std::int64_t i = visited[next];
      if (next % 65536 == 65535)
      {
        this->parallelFor.poll();
      }
      sum += static_cast<double>(q[i]);
      magnitude += std::abs(static_cast<double>(q[i]));
      sink = medium.sigma_a && static_cast<double>(medium.sigma_a[i]) > 1e-30 * this->scale;
      const int at[3] = { static_cast<int>(i % n[0]), static_cast<int>((i / n[0]) % n[1]),
        static_cast<int>(i / stride[2]) };
      for (int d = 0; d < 3 && open(i) && !sink; ++d)
      {
        for (int side = -1; side <= 1; side += 2)
        {
          const std::int64_t j = i + side * stride[d];
          if (at[d] + side < 0 || at[d] + side >= n[d])
          {
            sink = sink || (n[d] > 1 && medium.boundary != Boundary::ZeroFlux);
          }
          else if (open(j) && seen[static_cast<std::size_t>(j)] != own)
          {
            sink = sink || seen[static_cast<std::size_t>(j)] == mark;
            seen[static_cast<std::size_t>(j)] = own;
            visited.push_back(j);
          }
        }
      }
    }
    for (const std::int64_t i : visited)
    {
      seen[static_cast<std::size_t>(i)] = mark;
    }
    if (!sink && std::abs(sum) > 1e-6 * magnitude)
    {
      std::ostringstream text;
      text << "no steady state: in the closed part around voxel (" << seed % n[0] << ", "
           << (seed / n[0]) % n[1] << ", " << seed / stride[2]
           << ") light is neither absorbed nor can it escape";
      report.reason = StopReason::NoSteadyState;
      report.message = text.str();
      return false;
    }
  }
  return true;
}

//------------------------------------------------------------------------------
template <class Q>
DiffusionReport CoarseDiffusion::solve(
  const Q* q, double* phi, const DiffusionControl& control, bool fromPhi)
{
  const double began = now();
  const WatchedFor::Asking asking(this->parallelFor, control.progress);
  DiffusionReport report;
  try
  {
    this->correct(q, phi, control, fromPhi, report);
  }
  catch (const Interrupted&)
  {
    report.reason = StopReason::Cancelled;
  }
  if (report.reason == StopReason::Cancelled) // at once: neither residual nor powers
  {
    report.residual = -1.;
    report.message = "cancelled; the field is that after the last correction or sweep";
  }
  report.bytes += this->bytes();
  report.seconds = now() - began;
  return report;
}

template <class Q>
void CoarseDiffusion::correct(
  const Q* q, double* phi, const DiffusionControl& control, bool fromPhi, DiffusionReport& report)
{
  const double began = now();
  const std::int64_t size = this->fine.size();
  if (this->before.size() != size)
  {
    this->cellSource.allocate(this->coarse.size());
    this->cellPhi.allocate(this->coarse.size());
    this->before.allocate(size);
  }
  Buffer<double>& b = this->cellSource;
  Buffer<double>& x = this->cellPhi;
  Buffer<double>& kept = this->before;
  const bool named = control.targetError > 0. || control.timeBudget > 0.;
  DiffusionControl own;
  own.maxIterations = control.maxIterations;
  own.progress = control.progress;
  if (this->anyWall &&
    !(this->floatMedium.D ? this->escapes(this->floatMedium, q, report)
                          : this->escapes(this->doubleMedium, q, report)))
  {
    ForRows(this->parallelFor.whole(), size, size,
      [phi](std::int64_t begin, std::int64_t end) { std::fill(phi + begin, phi + end, 0.); });
    return;
  }
  const auto solveCells = [&](double tolerance)
  {
    own.tolerance = tolerance;
    std::fill(x.data(), x.data() + x.size(), 0.);
    const DiffusionReport one = this->solver.solveSteady(b.data(), x.data(), own);
    report.iterations += one.iterations;
    report.fineApplications +=
      one.fineApplications * static_cast<double>(this->coarse.size()) / static_cast<double>(size);
    report.bytes = std::max(report.bytes, one.bytes);
    report.reason = one.reason;
    report.message = one.message;
    return one.reason == StopReason::Converged || one.reason == StopReason::MaxIterations ||
      one.reason == StopReason::Breakdown;
  };
  const auto copy = [size](const ParallelFor& loop, const double* from, double* to)
  {
    ForRows(loop, size, size,
      [from, to](std::int64_t begin, std::int64_t end)
      { std::copy(from + begin, from + end, to + begin); });
  };
  bool whole = true; // phi is a field that may be shown
  double pass = 0.;  // seconds of a simple pass over the voxels
  const auto inTime = [&](double seconds)
  { return !this->hasty || now() - began + seconds < control.timeBudget; };
  if (!fromPhi)
  {
    Touch(phi, size, this->parallelFor);
    ForRows(this->parallelFor.whole(), size, size,
      [phi](std::int64_t begin, std::int64_t end) { std::fill(phi + begin, phi + end, 0.); });
    this->restrict(q, b.data());
    whole = solveCells(named ? 1e-5 : std::max(control.tolerance, 1e-8));
    const double solved = now();
    this->prolong(x.data(), phi);
    pass = now() - solved;
    for (int i = 0; whole && i < 2 && inTime(4. * pass); ++i)
    {
      this->relax(q, phi);
      report.fineApplications += 1.;
    }
    report.fineApplications += 3.;
  }

  // What the cells' equations make of the residual that is left corrects phi (a two-grid method);
  // from how fast the corrections shrink follows what the next ones would have been.
  constexpr int most = 20;
  const int fixed = 3; // without a named error
  const double enough = control.targetError > 0. ? 0.7 * control.targetError : 1e-6;
  Change last;
  double spent = 0.; // by a correction
  Showing show(control);
  double lastRate = 0.;
  bool shrinking = true;
  bool told = false;
  // In haste a first correction takes as long as what was done before it, and some passes.
  const double first = now() - began + 3. * pass;
  for (int i = 0; whole && i < (named ? most : fixed) && (i > 0 || inTime(first)); ++i)
  {
    const double start = now();
    if (control.progress && !control.progress(static_cast<double>(i + 1) / (most + 1)))
    {
      report.reason = StopReason::Cancelled;
      break;
    }
    if (control.timeBudget > 0. && i > 0 && start - began + spent > control.timeBudget)
    {
      report.reason = StopReason::MaxIterations;
      report.message = "the time budget is used up";
      break;
    }
    report.residual = this->residual(q, phi, kept.data());
    this->restrict(kept.data(), b.data());
    whole = solveCells(1e-2);
    copy(this->parallelFor, phi, kept.data());
    this->prolong(x.data(), phi);
    this->relax(q, phi);
    report.fineApplications += 4.;
    if (!whole)
    {
      break;
    }
    const Change change = this->compare(kept.data(), phi);
    spent = now() - start;
    if (i > 0 && change.l2 > last.l2)
    {
      // The cells' equations are too far from the voxels' here: the correction overshoots.
      copy(this->parallelFor.whole(), kept.data(), phi);
      shrinking = false;
      report.estimatedError = std::max(report.estimatedError, last.p95);
      report.estimatedErrorL2 = std::max(report.estimatedErrorL2, last.l2);
      break;
    }
    // What is left is a geometric series. Dark corners that come in late may let one correction
    // of the percentile look far better, but not than the norm's.
    const auto rate = [i](double here, double there)
    { return i > 0 ? std::min(1., std::max(0.12, here / std::max(there, 1e-30))) : 0.5; };
    const double rateL2 = rate(change.l2, last.l2);
    const double rateP95 =
      std::max({ rate(change.p95, last.p95), 0.8 * rateL2, i > 1 ? 0.7 * lastRate : 0. });
    lastRate = std::min(rateP95, 0.7);
    told = true;
    report.estimatedError = 1.1 * change.p95 * rateP95 / std::max(0.1, 1. - rateP95);
    report.estimatedErrorL2 = 1.1 * change.l2 * rateL2 / std::max(0.1, 1. - rateL2);
    shrinking = i < 2 || change.p95 < 0.7 * last.p95 || change.l2 < 0.7 * last.l2;
    last = change;
    if (i > 0 && named && report.estimatedError <= enough)
    {
      break;
    }
    if (!shrinking)
    {
      break;
    }
    show(phi);
  }
  if (whole && this->hasty && !told)
  {
    // What cells of several voxels leave without a correction is of the order of the field.
    report.estimatedError = report.estimatedErrorL2 = 1.;
    report.message = "the time budget is used up before the error could be estimated: 1 is a guess";
  }
  const int nx = this->fine.dims[0];
  struct Row
  {
    double power = 0., sum = 0., magnitude = 0.;
  };
  std::vector<Row> rows(static_cast<std::size_t>(size / nx));
  ForRows(this->parallelFor, size / nx, size,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        Row& row = rows[static_cast<std::size_t>(r)];
        for (std::int64_t i = r * nx; i < (r + 1) * nx; ++i)
        {
          const double value = static_cast<double>(q[i]);
          row.power += value * value;
          row.sum += value;
          row.magnitude += std::abs(value);
        }
      }
    });
  Row all;
  for (const Row& row : rows)
  {
    all.power += row.power;
    all.sum += row.sum;
    all.magnitude += row.magnitude;
  }
  const double power = all.power;
  // Corrections overshoot: what sources of one sign cannot make, and what is outside, is dark.
  const bool above = all.sum > 0. && all.sum >= all.magnitude;
  const bool below = all.sum < 0. && -all.sum >= all.magnitude;
  const std::uint8_t* outside =
    this->floatMedium.D ? this->floatMedium.outside : this->doubleMedium.outside;
  if (above || below || outside)
  {
    ForRows(this->parallelFor, size / nx, size,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t i = begin * nx; i < end * nx; ++i)
        {
          const bool wrong = (above && phi[i] < 0.) || (below && phi[i] > 0.);
          phi[i] = wrong || (outside && outside[i]) ? 0. : phi[i];
        }
      });
  }
  if (report.residual >= 0.)
  {
    report.residual = power > 0. ? report.residual / std::sqrt(power) : 0.;
  }
  if (whole && report.reason != StopReason::Cancelled)
  {
    // Three corrections are no promise: only an error that is named and met is.
    const bool reached = named ? report.estimatedError >= 0. && report.estimatedError <= enough
                               : report.residual >= 0. && report.residual <= control.tolerance;
    report.reason =
      reached && report.message.empty() ? StopReason::Converged : StopReason::MaxIterations;
    if (!reached && report.message.empty())
    {
      report.message = named ? "the coarse grid's corrections do not reach the error that was named"
                             : "a coarse grid's answer, see the estimated error";
    }
  }
  if (report.reason == StopReason::Cancelled)
  {
    return;
  }
  this->balance(q, phi, report);
}

CoarseDiffusion::Change CoarseDiffusion::compare(const double* before, const double* phi) const
{
  const int nx = this->fine.dims[0];
  const std::int64_t rows = this->fine.size() / nx;
  struct Row
  {
    double largest = 0., changed = 0., all = 0.;
  };
  std::vector<Row> sums(static_cast<std::size_t>(rows));
  ForRows(this->parallelFor, rows, this->fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        Row row;
        for (std::int64_t i = r * nx; i < (r + 1) * nx; ++i)
        {
          const double change = phi[i] - before[i];
          row.changed += change * change;
          row.all += phi[i] * phi[i];
          row.largest = std::max(row.largest, std::abs(phi[i]));
        }
        sums[static_cast<std::size_t>(r)] = row;
      }
    });
  Row total;
  for (const Row& row : sums)
  {
    total.largest = std::max(total.largest, row.largest);
    total.changed += row.changed;
    total.all += row.all;
  }
  // a hundred thousand voxels tell the percentile
  const std::int64_t step = std::max<std::int64_t>(1, this->fine.size() / 100000) | 1;
  std::vector<float> ratios;
  for (std::int64_t r = 0; r < rows; r += step)
  {
    for (std::int64_t i = r * nx; i < (r + 1) * nx; ++i)
    {
      const double v = std::abs(phi[i]);
      if (v >= 1e-6 * total.largest && v > 0.)
      {
        ratios.push_back(static_cast<float>(std::min(std::abs(phi[i] - before[i]) / v, 1e30)));
      }
    }
  }
  Change result;
  result.l2 = total.all > 0. ? std::sqrt(total.changed / total.all) : 0.;
  if (!ratios.empty())
  {
    const auto at = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() * 95 / 100);
    std::nth_element(ratios.begin(), at, ratios.end());
    result.p95 = static_cast<double>(*at);
  }
  return result;
}

template <class Q>
void CoarseDiffusion::balance(const Q* q, const double* phi, DiffusionReport& report) const
{
  const std::array<int, 3>& n = this->fine.dims;
  const double V = this->fine.voxelVolume();
  const std::int64_t rows = static_cast<std::int64_t>(n[1]) * n[2];
  std::vector<std::array<double, 3>> sums(static_cast<std::size_t>(rows));
  ForRows(this->parallelFor, rows, this->fine.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      std::vector<float> D(static_cast<std::size_t>(n[0])), s(static_cast<std::size_t>(n[0]));
      for (std::int64_t r = begin; r < end; ++r)
      {
        this->load(r, D.data(), s.data());
        const int at[3] = { 0, static_cast<int>(r % n[1]), static_cast<int>(r / n[1]) };
        double emitted = 0.;
        double absorbed = 0.;
        double escaped = 0.;
        for (int i = 0; i < n[0]; ++i)
        {
          const std::size_t x = static_cast<std::size_t>(i);
          const double v = phi[r * n[0] + i];
          emitted += static_cast<double>(q[r * n[0] + i]);
          absorbed += static_cast<double>(s[x]) * v;
          for (int d = 0; d < 3; ++d)
          {
            const int here = d == 0 ? i : at[d];
            const int borders = (here == 0) + (here + 1 == n[d]);
            if (borders > 0 && this->beyond[d] >= 0.f)
            {
              escaped += borders * v *
                static_cast<double>(
                  this->perD[d] / (0.5f / std::max(D[x], LeastD) + this->beyond[d]));
            }
          }
        }
        sums[static_cast<std::size_t>(r)] = { { emitted, absorbed, escaped } };
      }
    });
  double total[3] = { 0., 0., 0. };
  for (const std::array<double, 3>& sum : sums)
  {
    for (int i = 0; i < 3; ++i)
    {
      total[i] += sum[static_cast<std::size_t>(i)];
    }
  }
  report.emitted = total[0] * V;
  report.absorbed = total[1] * V * this->scale;
  report.escaped = total[2] * V * this->scale;
}

#define LIGHTTRANSPORT_INSTANTIATE(T)                                                              \
  template DiffusionReport CoarseDiffusion::setMedium<T>(                                          \
    const DiffusionMedium<T>&, int, bool, const ProgressFunction&);                                \
  template DiffusionReport CoarseDiffusion::solve<T>(                                              \
    const T*, double*, const DiffusionControl&, bool);
LIGHTTRANSPORT_INSTANTIATE(float)
LIGHTTRANSPORT_INSTANTIATE(double)
#undef LIGHTTRANSPORT_INSTANTIATE
} // namespace lighttransport
