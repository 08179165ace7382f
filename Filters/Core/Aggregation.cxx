// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Aggregation.h"

#include "Core/Kernel.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace lighttransport
{
namespace
{
/** Sets are sought within bricks of the finest grid, and within so many rows of the others. */
constexpr int Brick[3] = { 16, 8, 8 };
constexpr std::int32_t RowsTogether = 1024;
constexpr int FinestSweeps = 2; // before and after each coarse correction
/** Gauss-Seidel goes along so many rows, see 5. in the header. */
constexpr std::int32_t RowsInChunk = 8192;
/** So many parts between two looks at the clock. */
constexpr std::int64_t PartsAtATime = 64;

/**
 * Of the sets. The finest grid is smoothed well, which allows larger ones than Napov and Notay's 8
 * to 10: fewer rows, in less time and memory, for hardly more iterations.
 */
constexpr double FinestQuality = 20.;
constexpr double FrugalQuality = 60.; // where the memory would not do
constexpr double CoarseQuality = 12.;

constexpr int Rounds = 3; // of pairing
constexpr int LargestSet = 1 << Rounds;
/** Sets may not extend over more rows than this: rows that far apart are restricted at a time. */
constexpr int LargestExtent = 6;
constexpr std::int32_t SolvedDirectly = 128;
constexpr float NoFace = 1e-30f;
constexpr std::int64_t BytesPerEntry = 8, BytesPerRow = 40; // of a level

/**
 * The voxels of the finest grid. Its parts are bricks, in which a voxel's local number is its
 * place.
 */
struct VoxelGraph
{
  const DiffusionOperator& A;
  std::int64_t stride[3];
  int bricks[3];

  explicit VoxelGraph(const DiffusionOperator& op)
    : A(op)
    , stride{ 1, op.dims[0], static_cast<std::int64_t>(op.dims[0]) * op.dims[1] }
  {
    for (int d = 0; d < 3; ++d)
    {
      this->bricks[d] = (op.dims[d] + Brick[d] - 1) / Brick[d];
    }
  }
  std::int64_t parts() const
  {
    return static_cast<std::int64_t>(this->bricks[0]) * this->bricks[1] * this->bricks[2];
  }
  static constexpr int room = Brick[0] * Brick[1] * Brick[2];
  std::int64_t values() const { return this->A.activeSize; }
  float sink(std::int64_t v) const { return this->A.s[v]; }
  template <class Action>
  void forNeighbours(std::int64_t v, const Action& action) const
  {
    for (int d = 0; d < 3; ++d)
    {
      const std::int64_t below = v - this->stride[d];
      if (below >= 0 && this->A.g[d][below] > NoFace)
      {
        action(below, this->A.g[d][below]);
      }
      if (this->A.g[d][v] > NoFace)
      {
        action(v + this->stride[d], this->A.g[d][v]);
      }
    }
  }
  /** action(local number, conductance) of the neighbours in the same part. */
  template <class Action>
  void forLocal(std::int64_t, std::int64_t v, std::int32_t local, const Action& action) const
  {
    constexpr std::int32_t steps[3] = { 1, Brick[0], Brick[0] * Brick[1] };
    for (int d = 0; d < 3; ++d)
    {
      const int at = local / steps[d] % Brick[d];
      if (at > 0 && this->A.g[d][v - this->stride[d]] > NoFace)
      {
        action(local - steps[d], this->A.g[d][v - this->stride[d]]);
      }
      if (at + 1 < Brick[d] && this->A.g[d][v] > NoFace)
      {
        action(local + steps[d], this->A.g[d][v]);
      }
    }
  }
  /** action(voxel, local number) */
  template <class Action>
  void forPart(std::int64_t part, const Action& action) const
  {
    const int at[3] = { static_cast<int>(part % this->bricks[0]) * Brick[0],
      static_cast<int>(part / this->bricks[0] % this->bricks[1]) * Brick[1],
      static_cast<int>(part / this->bricks[0] / this->bricks[1]) * Brick[2] };
    for (int k = at[2]; k < std::min(at[2] + Brick[2], this->A.dims[2]); ++k)
    {
      for (int j = at[1]; j < std::min(at[1] + Brick[1], this->A.dims[1]); ++j)
      {
        const std::int64_t row = j + static_cast<std::int64_t>(this->A.dims[1]) * k;
        const Span span = this->A.span(row);
        const int end = std::min(at[0] + Brick[0], span.end);
        const int local = Brick[0] * (j - at[1] + Brick[1] * (k - at[2])) - at[0];
        for (int i = std::max(at[0], span.begin); i < end; ++i)
        {
          action(row * this->A.dims[0] + i, local + i);
        }
      }
    }
  }
  /** Whether two voxels of a part may belong to one set. */
  static bool near(std::int32_t v, std::int32_t w)
  {
    const auto row = [](std::int32_t local) { return local / Brick[0]; };
    return std::abs(row(v) % Brick[1] - row(w) % Brick[1]) < LargestExtent &&
      std::abs(row(v) / Brick[1] - row(w) / Brick[1]) < LargestExtent;
  }
};

/** The rows of a coarse grid. */
struct RowGraph
{
  std::int32_t rows;
  const std::int64_t* start;
  const std::int32_t* column;
  const float *g, *s;

  std::int64_t parts() const { return (this->rows + RowsTogether - 1) / RowsTogether; }
  static constexpr int room = RowsTogether;
  std::int64_t values() const { return this->rows; }
  float sink(std::int64_t v) const { return this->s[v]; }
  template <class Action>
  void forNeighbours(std::int64_t v, const Action& action) const
  {
    for (std::int64_t e = this->start[v]; e < this->start[v + 1]; ++e)
    {
      action(static_cast<std::int64_t>(this->column[e]), this->g[e]);
    }
  }
  template <class Action>
  void forLocal(std::int64_t part, std::int64_t v, std::int32_t, const Action& action) const
  {
    const std::int64_t first = part * RowsTogether;
    for (std::int64_t e = this->start[v]; e < this->start[v + 1]; ++e)
    {
      const std::int64_t local = this->column[e] - first;
      if (local >= 0 && local < RowsTogether)
      {
        action(static_cast<std::int32_t>(local), this->g[e]);
      }
    }
  }
  template <class Action>
  void forPart(std::int64_t part, const Action& action) const
  {
    const std::int64_t end = std::min<std::int64_t>((part + 1) * RowsTogether, this->rows);
    for (std::int64_t v = part * RowsTogether; v < end; ++v)
    {
      action(v, static_cast<std::int32_t>(v - part * RowsTogether));
    }
  }
  static bool near(std::int32_t, std::int32_t) { return true; }
};

/** What a thread works with to find the sets of a part. */
class Matching
{
public:
  template <class Graph>
  void run(const Graph& graph, std::int64_t part, double wanted)
  {
    this->quality = wanted;
    this->setOf.assign(Graph::room, -1);
    this->place.assign(Graph::room, -1);
    this->diagonal.resize(Graph::room);
    this->sink.resize(Graph::room);
    this->voxel.resize(Graph::room);
    this->sets.clear();
    this->count = 0;
    graph.forPart(part,
      [&](std::int64_t v, std::int32_t local)
      {
        // in double: what a set's inner faces leave of it is a difference
        double sum = 0.;
        graph.forNeighbours(v, [&](std::int64_t, float g) { sum += static_cast<double>(g); });
        const std::size_t at = static_cast<std::size_t>(local);
        this->sink[at] = static_cast<double>(graph.sink(v));
        this->diagonal[at] = sum + this->sink[at];
        this->voxel[at] = v;
        // 2. where the sink is strong, smoothing is enough
        if (this->sink[at] * (wanted - 2.) < 2. * sum)
        {
          this->setOf[at] = static_cast<std::int32_t>(this->sets.size());
          this->sets.push_back({ { local }, 1, false, this->diagonal[at] });
        }
      });
    if (this->sets.empty())
    {
      return;
    }
    this->slot.assign(this->sets.size(), -1);
    for (int round = 0; round < Rounds; ++round)
    {
      this->pair(graph, part, 1 << round);
    }
    // numbers without gaps
    for (const Set& set : this->sets)
    {
      for (int m = 0; m < set.size; ++m)
      {
        this->setOf[static_cast<std::size_t>(set.node[m])] = this->count;
      }
      this->count += set.size > 0 ? 1 : 0;
    }
  }

  std::vector<std::int32_t> setOf; // of each local number, -1: none
  std::int32_t count = 0;          // of sets

private:
  struct Set
  {
    std::int32_t node[LargestSet];
    int size;
    bool taken;      // in this round
    double diagonal; // of P' A P
  };
  struct Candidate
  {
    std::int32_t set;
    double g, cost;
  };

  /** One round: each set of at most `most` nodes looks for another such one. */
  template <class Graph>
  void pair(const Graph& graph, std::int64_t part, int most)
  {
    for (Set& set : this->sets)
    {
      set.taken = set.size == 0 || set.size > most;
    }
    for (std::size_t t = 0; t < this->sets.size(); ++t)
    {
      Set& own = this->sets[t];
      if (own.taken)
      {
        continue;
      }
      this->candidates.clear();
      for (int m = 0; m < own.size; ++m)
      {
        const std::int32_t local = own.node[m];
        graph.forLocal(part, this->voxel[static_cast<std::size_t>(local)], local,
          [&](std::int32_t other, float g)
          {
            const std::int32_t u = this->setOf[static_cast<std::size_t>(other)];
            if (u < 0 || u == static_cast<std::int32_t>(t) ||
              this->sets[static_cast<std::size_t>(u)].taken)
            {
              return;
            }
            std::int32_t& at = this->slot[static_cast<std::size_t>(u)];
            if (at < 0)
            {
              at = static_cast<std::int32_t>(this->candidates.size());
              this->candidates.push_back({ u, 0., 0. });
            }
            this->candidates[static_cast<std::size_t>(at)].g += static_cast<double>(g);
          });
      }
      for (Candidate& c : this->candidates)
      {
        this->slot[static_cast<std::size_t>(c.set)] = -1;
        const double theirs = this->sets[static_cast<std::size_t>(c.set)].diagonal;
        c.cost = own.diagonal / c.g * (theirs / (own.diagonal + theirs));
      }
      for (int tries = 0; tries < 3 && !this->candidates.empty(); ++tries)
      {
        const auto best = std::min_element(this->candidates.begin(), this->candidates.end(),
          [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
        Set& other = this->sets[static_cast<std::size_t>(best->set)];
        if (this->fits(graph, part, own, other, best->g))
        {
          for (int m = 0; m < other.size; ++m)
          {
            own.node[own.size++] = other.node[m];
            this->setOf[static_cast<std::size_t>(other.node[m])] = static_cast<std::int32_t>(t);
          }
          const double sum = own.diagonal + other.diagonal;
          own.diagonal = std::max(sum - 2. * best->g, 1e-15 * sum);
          own.taken = true;
          other.size = 0;
          other.taken = true;
          break;
        }
        this->candidates.erase(best);
      }
    }
  }

  /** The bound of 1. in the header: is quality / 2 A_G - M (1 - mean) positive semidefinite? */
  template <class Graph>
  bool fits(const Graph& graph, std::int64_t part, const Set& a, const Set& b, double between)
  {
    const double factor = 0.5 * this->quality;
    if (a.size + b.size == 2)
    {
      const std::size_t i = static_cast<std::size_t>(a.node[0]);
      const std::size_t j = static_cast<std::size_t>(b.node[0]);
      const auto half = [](double x, double y) { return x + y > 0. ? x * (y / (x + y)) : 0.; };
      return half(this->diagonal[i], this->diagonal[j]) <=
        factor * (between + half(this->sink[i], this->sink[j]));
    }
    std::int32_t node[LargestSet];
    const int n = a.size + b.size;
    std::copy(a.node, a.node + a.size, node);
    std::copy(b.node, b.node + b.size, node + a.size);
    for (int i = 0; n > LargestExtent && i < a.size; ++i)
    {
      for (int j = 0; j < b.size; ++j)
      {
        if (!Graph::near(a.node[i], b.node[j]))
        {
          return false;
        }
      }
    }
    double Z[LargestSet][LargestSet];
    double total = 0.;
    for (int i = 0; i < n; ++i)
    {
      this->place[static_cast<std::size_t>(node[i])] = i;
      total += this->diagonal[static_cast<std::size_t>(node[i])];
    }
    for (int i = 0; i < n; ++i)
    {
      const std::size_t v = static_cast<std::size_t>(node[i]);
      const double Mi = this->diagonal[v];
      for (int j = 0; j <= i; ++j)
      {
        Z[i][j] = Mi * (this->diagonal[static_cast<std::size_t>(node[j])] / total);
      }
      Z[i][i] += factor * this->sink[v] - Mi;
      graph.forLocal(part, this->voxel[v], node[i],
        [&](std::int32_t other, float g)
        {
          const std::int32_t j = this->place[static_cast<std::size_t>(other)];
          if (j >= 0)
          {
            Z[i][i] += factor * static_cast<double>(g);
            if (j < i)
            {
              Z[i][j] -= factor * static_cast<double>(g);
            }
          }
        });
    }
    for (int i = 0; i < n; ++i)
    {
      this->place[static_cast<std::size_t>(node[i])] = -1;
    }
    // by Cholesky's factorisation
    for (int j = 0; j < n; ++j)
    {
      const double rounding = 1e-9 * this->diagonal[static_cast<std::size_t>(node[j])];
      if (j + 1 == n) // without sinks the last row is minus the sum of the others
      {
        return Z[j][j] > -rounding;
      }
      if (!(Z[j][j] > rounding))
      {
        return false;
      }
      const double inverse = 1. / Z[j][j];
      for (int i = j + 1; i < n; ++i)
      {
        const double l = Z[i][j] * inverse;
        for (int k = j + 1; k <= i; ++k)
        {
          Z[i][k] -= l * Z[k][j];
        }
      }
    }
    return true;
  }

  double quality = 0.;
  std::vector<double> diagonal, sink;
  std::vector<std::int64_t> voxel;
  std::vector<std::int32_t> slot;  // of each set, among the candidates
  std::vector<std::int32_t> place; // of each node, in the set that is looked at
  std::vector<Set> sets;
  std::vector<Candidate> candidates;
};

/** body(begin, end) of the parts, some at a time. */
void forParts(
  const ParallelFor& parallelFor, std::int64_t parts, std::int64_t values, const RangeBody& body)
{
  for (std::int64_t first = 0; first < parts; first += PartsAtATime)
  {
    ForRows(parallelFor, std::min(PartsAtATime, parts - first), values,
      [&](std::int64_t begin, std::int64_t end) { body(first + begin, first + end); });
  }
}

double dot(std::int64_t n, const float* a, const float* b)
{
  double sums[4] = { 0., 0., 0., 0. };
  std::int64_t i = 0;
  for (; i + 4 <= n; i += 4)
  {
    for (int l = 0; l < 4; ++l)
    {
      sums[l] += static_cast<double>(a[i + l]) * static_cast<double>(b[i + l]);
    }
  }
  for (; i < n; ++i)
  {
    sums[0] += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  }
  return (sums[0] + sums[2]) + (sums[1] + sums[3]);
}
} // namespace

//------------------------------------------------------------------------------
void Aggregation::release()
{
  this->parent.release();
  this->levels.clear();
}

std::int64_t Aggregation::Level::bytes() const
{
  return this->start.bytes() + this->column.bytes() + this->g.bytes() + this->s.bytes() +
    this->diagonal.bytes() + this->x.bytes() + this->b.bytes() + this->r.bytes() +
    this->first.bytes() + this->firstImage.bytes() + this->parent.bytes() +
    static_cast<std::int64_t>(this->factor.size() * sizeof(double));
}

std::int64_t Aggregation::bytes() const
{
  std::int64_t sum = this->parent.bytes();
  for (const Level& level : this->levels)
  {
    sum += level.bytes();
  }
  return sum;
}

//------------------------------------------------------------------------------
template <class Graph>
bool Aggregation::coarsen(const Graph& graph, double quality, std::int64_t bytes,
  Buffer<std::int32_t>& to, const ParallelFor& parallelFor)
{
  const std::int64_t parts = graph.parts();
  // 1., 2. the sets, numbered within each part, then in all
  std::vector<std::int32_t> first(static_cast<std::size_t>(parts) + 1, 0);
  forParts(parallelFor, parts, graph.values(),
    [&](std::int64_t begin, std::int64_t end)
    {
      static thread_local Matching matching;
      for (std::int64_t part = begin; part < end; ++part)
      {
        matching.run(graph, part, quality);
        graph.forPart(part,
          [&](std::int64_t v, std::int32_t local)
          { to[v] = matching.setOf[static_cast<std::size_t>(local)]; });
        first[static_cast<std::size_t>(part) + 1] = matching.count;
      }
    });
  for (std::size_t part = 0; part + 1 < first.size(); ++part)
  {
    first[part + 1] += first[part];
  }
  this->levels.emplace_back();
  Level& coarse = this->levels.back();
  coarse.rows = first.back();
  forParts(parallelFor, parts, graph.values(),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t part = begin; part < end; ++part)
      {
        graph.forPart(part,
          [&](std::int64_t v, std::int32_t)
          {
            if (to[v] >= 0)
            {
              to[v] += first[static_cast<std::size_t>(part)];
            }
          });
      }
    });

  // 3. P' A P: counted, then written
  coarse.start.allocate(static_cast<std::int64_t>(coarse.rows) + 1);
  coarse.s.allocate(coarse.rows);
  coarse.diagonal.allocate(coarse.rows);
  for (const bool counting : { true, false })
  {
    if (!counting)
    {
      for (std::int32_t i = 0; i < coarse.rows; ++i)
      {
        coarse.start[i + 1] += coarse.start[i];
      }
      if (BytesPerEntry * coarse.start[coarse.rows] + BytesPerRow * coarse.rows > bytes)
      {
        this->levels.pop_back();
        return false;
      }
      coarse.column.allocate(coarse.start[coarse.rows]);
      coarse.g.allocate(coarse.start[coarse.rows]);
    }
    forParts(parallelFor, parts, graph.values(),
      [&](std::int64_t begin, std::int64_t end)
      {
        struct Entry
        {
          std::int32_t column;
          float g;
        };
        static thread_local std::vector<std::int64_t> members;
        static thread_local std::vector<std::int32_t> heads;
        static thread_local std::vector<Entry> row;
        for (std::int64_t part = begin; part < end; ++part)
        {
          const std::int32_t base = first[static_cast<std::size_t>(part)];
          const std::int32_t sets = first[static_cast<std::size_t>(part) + 1] - base;
          members.assign(static_cast<std::size_t>(sets) * LargestSet, -1);
          heads.assign(static_cast<std::size_t>(sets), 0);
          graph.forPart(part,
            [&](std::int64_t v, std::int32_t)
            {
              if (to[v] >= 0)
              {
                const std::size_t set = static_cast<std::size_t>(to[v] - base);
                members[set * LargestSet + static_cast<std::size_t>(heads[set]++)] = v;
              }
            });
          for (std::int32_t set = 0; set < sets; ++set)
          {
            const std::int32_t I = base + set;
            row.clear();
            double sink = 0.;
            double diagonal = 0.;
            for (std::int32_t m = 0; m < heads[static_cast<std::size_t>(set)]; ++m)
            {
              const std::int64_t v =
                members[static_cast<std::size_t>(set) * LargestSet + static_cast<std::size_t>(m)];
              sink += static_cast<double>(graph.sink(v));
              graph.forNeighbours(v,
                [&](std::int64_t w, float g)
                {
                  const std::int32_t J = to[w];
                  if (J == I)
                  {
                    return;
                  }
                  if (J < 0)
                  {
                    sink += static_cast<double>(g);
                    return;
                  }
                  diagonal += static_cast<double>(g);
                  for (Entry& entry : row)
                  {
                    if (entry.column == J)
                    {
                      entry.g += g;
                      return;
                    }
                  }
                  row.push_back({ J, g });
                });
            }
            if (counting)
            {
              coarse.start[I + 1] = static_cast<std::int64_t>(row.size());
              continue;
            }
            std::sort(row.begin(), row.end(),
              [](const Entry& a, const Entry& b) { return a.column < b.column; });
            std::int64_t e = coarse.start[I];
            for (const Entry& entry : row)
            {
              coarse.column[e] = entry.column;
              coarse.g[e++] = entry.g;
            }
            coarse.s[I] = static_cast<float>(sink);
            coarse.diagonal[I] = std::max(static_cast<float>(sink + diagonal), NoFace);
          }
        }
      });
  }
  return true;
}

bool Aggregation::setup(
  const DiffusionOperator& A, std::int64_t bytes, const ParallelFor& parallelFor)
{
  this->release();
  this->parent.allocate(A.size(), A.pages);
  // the other levels take a fifth of what the first of them does
  const std::int64_t most = (bytes - A.activeSize * std::int64_t(sizeof(std::int32_t))) / 6 * 5;
  const VoxelGraph voxels(A);
  if (!this->coarsen(voxels, FinestQuality, most, this->parent, parallelFor) &&
    !this->coarsen(voxels, FrugalQuality, most, this->parent, parallelFor))
  {
    this->release();
    return false;
  }
  for (;;)
  {
    Level& level = this->levels.back();
    const std::int32_t n = level.rows;
    level.x.allocate(n);
    level.b.allocate(n);
    if (n <= SolvedDirectly)
    {
      this->factorise(level);
      return true;
    }
    level.r.allocate(n);
    level.first.allocate(n);
    level.firstImage.allocate(n);
    level.parent.allocate(n);
    const RowGraph graph{ n, level.start.data(), level.column.data(), level.g.data(),
      level.s.data() };
    if (!this->coarsen(graph, CoarseQuality, bytes, level.parent, parallelFor))
    {
      level.parent.release();
      return true;
    }
    if (this->levels.back().rows == 0 || this->levels.back().rows * 5 > n * 4)
    {
      // hardly anything joined: smoothing is all that is left
      this->levels.pop_back();
      level.parent.release();
      return true;
    }
  }
}

void Aggregation::factorise(Level& level) const
{
  const std::size_t n = static_cast<std::size_t>(level.rows);
  std::vector<double>& L = level.factor;
  L.assign(n * n, 0.);
  for (std::size_t i = 0; i < n; ++i)
  {
    L[i * n + i] = static_cast<double>(level.s[static_cast<std::int64_t>(i)]);
    for (std::int64_t e = level.start[static_cast<std::int64_t>(i)];
         e < level.start[static_cast<std::int64_t>(i) + 1]; ++e)
    {
      const double g = static_cast<double>(level.g[e]);
      L[i * n + i] += g;
      L[i * n + static_cast<std::size_t>(level.column[e])] -= g;
    }
  }
  for (std::size_t j = 0; j < n; ++j)
  {
    const double before = L[j * n + j];
    for (std::size_t k = 0; k < j; ++k)
    {
      L[j * n + j] -= L[j * n + k] * L[j * n + k];
    }
    // what has no way out is fixed up to a constant: one of its values is 0
    L[j * n + j] = L[j * n + j] > 1e-14 * before ? std::sqrt(L[j * n + j]) : 1e30;
    for (std::size_t i = j + 1; i < n; ++i)
    {
      for (std::size_t k = 0; k < j; ++k)
      {
        L[i * n + j] -= L[i * n + k] * L[j * n + k];
      }
      L[i * n + j] /= L[j * n + j];
    }
  }
}

//------------------------------------------------------------------------------
void Aggregation::cycle(const DiffusionOperator& A, const float* b, float* x,
  const ParallelFor& parallelFor, const RowBody& done)
{
  Level& coarse = this->levels.front();
  std::fill(coarse.b.data(), coarse.b.data() + coarse.rows, 0.f);
  CoarseCorrection correction;
  const std::int64_t nx = A.dims[0];
  const auto firstRed = [&](std::int64_t row, int begin)
  {
    const int odd = static_cast<int>((row % A.dims[1] + row / A.dims[1]) & 1);
    return begin + ((begin + odd) & 1);
  };
  correction.restrictRow = [&](std::int64_t row, float* r, std::size_t)
  {
    const Span span = A.span(row);
    const std::int32_t* to = this->parent.data() + row * nx;
    float* out = coarse.b.data();
    for (int i = firstRed(row, span.begin); i < span.end; i += 2)
    {
      if (to[i] >= 0)
      {
        out[to[i]] += r[i];
      }
    }
  };
  correction.solve = [&]
  {
    if (coarse.rows > 0)
    {
      this->solveCoarse(0, parallelFor);
    }
  };
  correction.prolongRow = [&](std::int64_t row, float* to)
  {
    const Span span = A.span(row);
    const std::int32_t* from = this->parent.data() + row * nx;
    const float* e = coarse.x.data();
    for (int i = firstRed(row, span.begin); i < span.end; i += 2)
    {
      to[row * nx + i] += from[i] >= 0 ? e[from[i]] : 0.f;
    }
  };
  SmoothAround(A, FinestSweeps, b, x, &correction, parallelFor, done);
}

namespace
{
/** body(begin, end) for each chunk of rows. */
void forChunks(std::int32_t rows, const ParallelFor& parallelFor, const RangeBody& body)
{
  ForRows(parallelFor, (rows + RowsInChunk - 1) / RowsInChunk, rows,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t c = begin; c < end; ++c)
      {
        body(c * RowsInChunk, std::min<std::int64_t>((c + 1) * RowsInChunk, rows));
      }
    });
}

/** The sums over the chunks of what body(begin, end, sums) adds, in an order of their own. */
template <std::size_t N, class Body>
std::array<double, N> sumChunks(std::int32_t rows, const ParallelFor& parallelFor, const Body& body)
{
  std::vector<std::array<double, N>> partial(
    static_cast<std::size_t>((rows + RowsInChunk - 1) / RowsInChunk));
  forChunks(rows, parallelFor,
    [&](std::int64_t begin, std::int64_t end)
    {
      std::array<double, N> sums{};
      body(begin, end, sums);
      partial[static_cast<std::size_t>(begin / RowsInChunk)] = sums;
    });
  std::array<double, N> all{};
  for (const auto& sums : partial)
  {
    for (std::size_t i = 0; i < N; ++i)
    {
      all[i] += sums[i];
    }
  }
  return all;
}
} // namespace

void Aggregation::cycleCoarse(std::size_t l, float* x, const ParallelFor& parallelFor)
{
  Level& level = this->levels[l];
  const std::int32_t rows = level.rows;
  const std::int64_t* start = level.start.data();
  const std::int32_t* column = level.column.data();
  const float* g = level.g.data();
  const float* s = level.s.data();
  const float* diagonal = level.diagonal.data();
  const float* b = level.b.data();
  float* r = level.r.data();
  if (!level.factor.empty())
  {
    const std::size_t n = static_cast<std::size_t>(rows);
    const double* L = level.factor.data();
    double y[SolvedDirectly];
    for (std::size_t i = 0; i < n; ++i)
    {
      y[i] = static_cast<double>(b[i]);
      for (std::size_t k = 0; k < i; ++k)
      {
        y[i] -= L[i * n + k] * y[k];
      }
      y[i] /= L[i * n + i];
    }
    for (std::size_t i = n; i-- > 0;)
    {
      y[i] /= L[i * n + i];
      x[i] = static_cast<float>(y[i]);
      for (std::size_t k = 0; k < i; ++k)
      {
        y[k] -= L[i * n + k] * y[i];
      }
    }
    return;
  }
  // 5. forwards from zero, within each chunk
  forChunks(rows, parallelFor,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t i = begin; i < end; ++i)
      {
        float sum = b[i];
        for (std::int64_t e = start[i]; e < start[i + 1] && column[e] < i; ++e)
        {
          sum += column[e] >= begin ? g[e] * x[column[e]] : 0.f;
        }
        x[i] = sum / diagonal[i];
      }
    });
  const auto residual = [&](std::int64_t i)
  {
    float sum = b[i] - s[i] * x[i];
    for (std::int64_t e = start[i]; e < start[i + 1]; ++e)
    {
      sum -= g[e] * (x[i] - x[column[e]]);
    }
    return sum;
  };
  Level* coarse = l + 1 < this->levels.size() ? &this->levels[l + 1] : nullptr;
  if (coarse)
  {
    const std::int32_t* parents = level.parent.data();
    std::fill(coarse->b.data(), coarse->b.data() + coarse->rows, 0.f);
    // a set lies within one chunk
    static_assert(RowsInChunk % RowsTogether == 0, "sets do not cross chunks");
    forChunks(rows, parallelFor,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t i = begin; i < end; ++i)
        {
          if (parents[i] >= 0)
          {
            coarse->b[parents[i]] += residual(i);
          }
        }
      });
    this->solveCoarse(l + 1, parallelFor);
    forChunks(rows, parallelFor,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t i = begin; i < end; ++i)
        {
          x[i] += parents[i] >= 0 ? coarse->x[parents[i]] : 0.f;
        }
      });
  }
  // backwards
  forChunks(rows, parallelFor,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t i = begin; i < end; ++i)
      {
        r[i] = residual(i);
      }
    });
  forChunks(rows, parallelFor,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t i = end; i-- > begin;)
      {
        float sum = r[i];
        for (std::int64_t e = start[i + 1]; e-- > start[i] && column[e] > i;)
        {
          sum += column[e] < end ? g[e] * r[column[e]] : 0.f;
        }
        r[i] = sum / diagonal[i];
        x[i] += r[i];
      }
    });
}

void Aggregation::solveCoarse(std::size_t l, const ParallelFor& parallelFor)
{
  Level& level = this->levels[l];
  float* x = level.x.data();
  if (!level.factor.empty())
  {
    this->cycleCoarse(l, x, parallelFor);
    return;
  }
  // 4. two steps of conjugate gradients: c1 x1 + c2 x2 is the best there in A's norm
  const std::int32_t rows = level.rows;
  const std::int64_t* start = level.start.data();
  const std::int32_t* column = level.column.data();
  const float* g = level.g.data();
  const float* s = level.s.data();
  float* b = level.b.data();
  float* x1 = level.first.data();
  float* v1 = level.firstImage.data();
  const auto image = [&](const float* of, std::int64_t i)
  {
    float sum = s[i] * of[i];
    for (std::int64_t e = start[i]; e < start[i + 1]; ++e)
    {
      sum += g[e] * (of[i] - of[column[e]]);
    }
    return sum;
  };
  this->cycleCoarse(l, x1, parallelFor);
  const auto one = sumChunks<3>(rows, parallelFor,
    [&](std::int64_t begin, std::int64_t end, std::array<double, 3>& sums)
    {
      for (std::int64_t i = begin; i < end; ++i)
      {
        v1[i] = image(x1, i);
      }
      const std::int64_t n = end - begin;
      sums = { { dot(n, x1 + begin, v1 + begin), dot(n, x1 + begin, b + begin),
        dot(n, b + begin, b + begin) } };
    });
  const double a11 = one[0];
  const double t = a11 > 0. ? one[1] / a11 : 0.;
  if (!(t > 0.) || !std::isfinite(t))
  {
    std::swap(level.first, level.x);
    return;
  }
  const auto left = sumChunks<1>(rows, parallelFor,
    [&](std::int64_t begin, std::int64_t end, std::array<double, 1>& sums)
    {
      const float step = static_cast<float>(t);
      for (std::int64_t i = begin; i < end; ++i)
      {
        b[i] -= step * v1[i];
        x[i] = step * x1[i];
      }
      sums[0] = dot(end - begin, b + begin, b + begin);
    });
  if (left[0] <= 0.0625 * one[2])
  {
    return;
  }
  this->cycleCoarse(l, x, parallelFor);
  const auto two = sumChunks<3>(rows, parallelFor,
    [&](std::int64_t begin, std::int64_t end, std::array<double, 3>& sums)
    {
      for (std::int64_t i = begin; i < end; ++i)
      {
        const double v2 = static_cast<double>(image(x, i));
        sums[0] += v2 * static_cast<double>(x[i]);
        sums[1] += static_cast<double>(v1[i]) * static_cast<double>(x[i]);
        sums[2] += static_cast<double>(b[i]) * static_cast<double>(x[i]);
      }
    });
  const double rho = two[0] - two[1] * two[1] / a11;
  const bool second = rho > 1e-6 * two[0] && std::isfinite(two[2] / rho);
  const double c2 = second ? two[2] / rho : 0.;
  const double c1 = t - c2 * two[1] / a11;
  forChunks(rows, parallelFor,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t i = begin; i < end; ++i)
      {
        x[i] = static_cast<float>(c1) * x1[i] + static_cast<float>(c2) * x[i];
      }
    });
}
} // namespace lighttransport
