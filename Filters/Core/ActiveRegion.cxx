// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/ActiveRegion.h"

#include "Core/Kernel.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lighttransport
{
namespace
{
/** Costs within it are taken as equal: of the order of what a voxel costs in a vessel. */
constexpr double QueueStep = 0.05;
/** Even without absorption light decays, if only by spreading or through the sides. */
constexpr double LeastStep = 0.02;
/** A voxel is given up when it is so much darker than needed, and taken again when so much brighter
 * than it was. */
constexpr double Spare = 2.3;
constexpr double Brighter = 1.;
/** A first look takes a voxel of so many along each axis. */
constexpr int Pitch = 4;
/** What light may lose by spreading, which the costs don't hold: it goes as 1 / r at the most. */
constexpr double Spreading = 4.;
/** The part of a region that is not worth another solve when it turns out to be lit as well. */
constexpr double Few = 0.005;

/** c of 2 (cosh c - 1) = x */
double decay(double x)
{
  const float half = static_cast<float>(1. + 0.5 * std::min(x, 1e30));
  const float c = x < 1e-2 ? std::sqrt(static_cast<float>(x))
    : x > 1e6              ? std::log(2.f * half)
                           : std::log(half + std::sqrt(half * half - 1.f));
  return std::max(static_cast<double>(c), LeastStep);
}

/**
 * T of sum over the axes of ((T - from) / along)^2 = 1, over those that it comes along; `from` is
 * infinite where there is no neighbour.
 */
template <class Value>
double Arrival(const Value from[3], const Value along[3])
{
  int order[3] = { 0, 1, 2 };
  const auto later = [&](int a, int b)
  {
    if (from[order[b]] < from[order[a]])
    {
      std::swap(order[a], order[b]);
    }
  };
  later(0, 1);
  later(1, 2);
  later(0, 1);
  const double first = static_cast<double>(from[order[0]]);
  double result = first + static_cast<double>(along[order[0]]);
  double w = 0.;
  double wf = 0.;
  double wff = 0.;
  for (int d = 0; d < 3 && static_cast<double>(from[order[d]]) < result; ++d)
  {
    const double c = static_cast<double>(along[order[d]]);
    const double wd = 1. / (c * c);
    const double f = static_cast<double>(from[order[d]]) - first;
    w += wd;
    wf += wd * f;
    wff += wd * f * f;
    if (d == 0)
    {
      continue; // along one axis: the result as it stands
    }
    const double root = wf * wf - w * (wff - 1.);
    if (!(root >= 0.))
    {
      break;
    }
    result = std::min(result, first + (wf + std::sqrt(root)) / w);
  }
  return result;
}
} // namespace

//------------------------------------------------------------------------------
template <class T>
ActiveRegion<T>::ActiveRegion(const DiffusionMedium<T>& what, double threshold)
  : medium(what)
  , budget(-std::log(threshold))
  , cost(what.grid.size(), Pages::Small)
  , state(what.grid.size(), Pages::Small)
  , queue(static_cast<std::size_t>(this->budget / QueueStep) + 1)
{
  const std::array<int, 3>& n = what.grid.dims;
  this->stride[0] = 1;
  this->stride[1] = n[0];
  this->stride[2] = static_cast<std::int64_t>(n[0]) * n[1];
  for (int d = 0; d < 3; ++d)
  {
    const double h = what.grid.spacing[d];
    this->perArea[d] = n[d] > 1 ? 1. / (h * h) : 0.;
  }
  this->tilesAlongY = (n[1] + Tile - 1) / Tile;
  this->hull.resize(this->tileRow(0, n[2] + Tile - 1));
  this->solved.resize(this->hull.size());
}

template <class T>
double ActiveRegion<T>::damping(std::int64_t i, std::int64_t j, int d) const
{
  if (!this->open(i) || !this->open(j))
  {
    return std::numeric_limits<double>::infinity();
  }
  const double a = static_cast<double>(this->medium.D[i]);
  const double b = static_cast<double>(this->medium.D[j]);
  const double sigma = this->medium.sigma_a ? static_cast<double>(this->medium.sigma_a[j]) : 0.;
  // sigma h^2 / (2 a b / (a + b)), with no product that could underflow
  return 0.5 * sigma * (1. / a + 1. / b) / this->perArea[d];
}

template <class T>
double ActiveRegion<T>::step(std::int64_t i, std::int64_t j, int d) const
{
  const double x = this->damping(i, j, d);
  return x < 1e30 ? decay(x) : std::numeric_limits<double>::infinity();
}

template <class T>
double ActiveRegion<T>::foretell(std::int64_t j, const Index& at) const
{
  const std::array<int, 3>& n = this->medium.grid.dims;
  // along each axis the better of two neighbours
  constexpr double never = std::numeric_limits<double>::infinity();
  double from[3] = { never, never, never };
  double along[3] = { 0., 0., 0. };
  for (int d = 0; d < 3; ++d)
  {
    for (int side = -1; side <= 1; side += 2)
    {
      const std::int64_t i = j + side * this->stride[d];
      if (at[d] + side >= 0 && at[d] + side < n[d] && this->state[i] == Lit)
      {
        const double way = this->step(i, j, d);
        if (static_cast<double>(this->cost[i]) + way < from[d] + along[d])
        {
          from[d] = static_cast<double>(this->cost[i]);
          along[d] = way;
        }
      }
    }
  }
  return Arrival(from, along);
}

template <class T>
void ActiveRegion<T>::push(std::int64_t i, double value)
{
  if (value <= this->budget)
  {
    this->state[i] = Trial;
    this->cost[i] = static_cast<float>(value);
    this->queue[static_cast<std::size_t>(std::max(0., value) / QueueStep)].push_back(i);
  }
}

template <class T>
void ActiveRegion<T>::widen(const Index& at)
{
  const std::array<int, 3>& n = this->medium.grid.dims;
  Span& span = this->hull[this->tileRow(at[1], at[2])];
  const int x = at[0];
  if (span.begin >= span.end)
  {
    span = { x, x };
  }
  if (x < span.begin || x >= span.end)
  {
    span.begin = std::min(span.begin, x / Tile * Tile);
    span.end = std::max(span.end, std::min(n[0], (x / Tile + 1) * Tile));
  }
}

template <class T>
std::vector<Span> ActiveRegion<T>::spansOf(const std::vector<Span>& tiles) const
{
  const std::array<int, 3>& n = this->medium.grid.dims;
  std::vector<Span> spans;
  spans.reserve(static_cast<std::size_t>(n[1]) * n[2]);
  for (int k = 0; k < n[2]; ++k)
  {
    for (int j = 0; j < n[1]; ++j)
    {
      spans.push_back(tiles[this->tileRow(j, k)]);
    }
  }
  return spans;
}

template <class T>
std::int64_t ActiveRegion<T>::size() const
{
  const std::array<int, 3>& n = this->medium.grid.dims;
  std::int64_t sum = 0;
  for (int k = 0; k < n[2]; k += Tile)
  {
    for (int j = 0; j < n[1]; j += Tile)
    {
      const Span& span = this->hull[this->tileRow(j, k)];
      sum += static_cast<std::int64_t>(span.end - span.begin) * std::min(Tile, n[1] - j) *
        std::min(Tile, n[2] - k);
    }
  }
  return sum;
}

//------------------------------------------------------------------------------
template <class T>
template <class Q>
bool ActiveRegion<T>::start(const Q* q, double largest, const ParallelFor& parallelFor)
{
  const std::array<int, 3>& n = this->medium.grid.dims;
  const std::int64_t size = this->medium.grid.size();
  const std::int64_t rows = static_cast<std::int64_t>(n[1]) * n[2];
  std::vector<std::uint8_t> lit(static_cast<std::size_t>(rows), 0);
  ForRows(parallelFor, rows, size,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        bool any = false;
        for (std::int64_t i = r * n[0]; i < (r + 1) * n[0]; ++i)
        {
          any |= q[i] != Q(0);
        }
        lit[static_cast<std::size_t>(r)] = any;
      }
    });
  // What a source does to its own voxel tells how they compare.
  std::vector<double> own;
  double most = 0.;
  for (std::int64_t r = 0; r < rows; ++r)
  {
    for (std::int64_t i = r * n[0]; lit[static_cast<std::size_t>(r)] && i < (r + 1) * n[0]; ++i)
    {
      if (q[i] == Q(0))
      {
        continue;
      }
      double diagonal = this->medium.sigma_a ? static_cast<double>(this->medium.sigma_a[i]) : 0.;
      for (int d = 0; d < 3; ++d)
      {
        diagonal += 4. * static_cast<double>(this->medium.D[i]) * this->perArea[d];
      }
      this->sources.push_back(i);
      own.push_back(diagonal > 1e-150 ? std::abs(static_cast<double>(q[i])) / diagonal
                                      : std::numeric_limits<double>::max());
      most = std::max(most, own.back());
      if (static_cast<double>(this->sources.size()) > largest * static_cast<double>(size))
      {
        return false;
      }
    }
  }
  for (std::size_t s = 0; s < own.size(); ++s)
  {
    const double dimmer = own[s] > 0. ? std::log(most) - std::log(own[s]) : this->budget;
    this->push(this->sources[s], std::min(dimmer, this->budget));
  }
  return !this->fills(largest);
}

//------------------------------------------------------------------------------
/**
 * Fast marching from the sources over every fourth voxel along each axis: what is between two of
 * them on the line counts. Vessels that the lines miss are walls to it: it says so too seldom.
 */
template <class T>
bool ActiveRegion<T>::fills(double largest) const
{
  const std::array<int, 3>& n = this->medium.grid.dims;
  int m[3];
  for (int d = 0; d < 3; ++d)
  {
    m[d] = (n[d] + Pitch - 1) / Pitch;
  }
  const std::int64_t jump[3] = { 1, m[0], static_cast<std::int64_t>(m[0]) * m[1] };
  const auto voxelOf = [&](int d, int node)
  { return std::min(n[d] - 1, Pitch * node + Pitch / 2); };
  struct Node
  {
    float cost = std::numeric_limits<float>::infinity();
    float from[3];       // by axis: the better neighbour's cost
    float along[3] = {}; // and that of the way from it
    bool taken = false;
    Node() { std::fill_n(this->from, 3, std::numeric_limits<float>::infinity()); }
  };
  std::vector<Node> nodes(static_cast<std::size_t>(jump[2] * m[2]));
  std::vector<std::vector<std::int64_t>> waiting(this->queue.size());
  const auto wait = [&](std::int64_t at, double value)
  {
    Node& node = nodes[static_cast<std::size_t>(at)];
    if (value < static_cast<double>(node.cost) && value <= this->budget - Spreading)
    {
      node.cost = static_cast<float>(value);
      waiting[static_cast<std::size_t>(std::max(0., value) / QueueStep)].push_back(at);
    }
  };
  // from voxel i, `voxels` steps along the axis, forwards or back
  const auto way = [&](std::int64_t i, int d, int voxels)
  {
    double sum = 0.;
    const std::int64_t ahead = voxels < 0 ? -this->stride[d] : this->stride[d];
    for (int v = std::abs(voxels); v > 0 && sum < this->budget; --v, i += ahead)
    {
      sum += this->open(i + ahead) ? this->step(i, i + ahead, d) : this->budget;
    }
    return sum;
  };
  for (const std::int64_t i : this->sources)
  {
    int at[3] = { static_cast<int>(i % n[0]), static_cast<int>(i / n[0] % n[1]),
      static_cast<int>(i / this->stride[2]) };
    double value = this->open(i) ? static_cast<double>(this->cost[i]) : this->budget;
    std::int64_t node = 0;
    std::int64_t voxel = i;
    for (int d = 0; d < 3; ++d)
    {
      node += at[d] / Pitch * jump[d];
    }
    if (static_cast<double>(nodes[static_cast<std::size_t>(node)].cost) < value + 1.)
    {
      continue; // another source's: much the same
    }
    for (int d = 0; d < 3 && value < this->budget; ++d)
    {
      const int steps = voxelOf(d, at[d] / Pitch) - at[d];
      value += way(voxel, d, steps);
      voxel += steps * this->stride[d];
    }
    wait(node, value);
  }
  const double many = largest * static_cast<double>(nodes.size());
  std::int64_t taken = 0;
  for (std::vector<std::int64_t>& same : waiting)
  {
    for (std::size_t p = 0; p < same.size(); ++p) // grows while it is read
    {
      const std::int64_t i = same[p];
      Node& node = nodes[static_cast<std::size_t>(i)];
      if (node.taken)
      {
        continue;
      }
      node.taken = true;
      if (static_cast<double>(++taken) > many)
      {
        return true;
      }
      const int at[3] = { static_cast<int>(i % m[0]), static_cast<int>(i / m[0] % m[1]),
        static_cast<int>(i / jump[2]) };
      const std::int64_t voxel =
        this->medium.grid.index(voxelOf(0, at[0]), voxelOf(1, at[1]), voxelOf(2, at[2]));
      for (int d = 0; d < 3; ++d)
      {
        for (int side = -1; side <= 1; side += 2)
        {
          const std::int64_t j = i + side * jump[d];
          if (at[d] + side < 0 || at[d] + side >= m[d] || nodes[static_cast<std::size_t>(j)].taken)
          {
            continue;
          }
          Node& next = nodes[static_cast<std::size_t>(j)];
          const double along = way(voxel, d, voxelOf(d, at[d] + side) - voxelOf(d, at[d]));
          if (static_cast<double>(node.cost) + along <
            static_cast<double>(next.from[d] + next.along[d]))
          {
            next.from[d] = node.cost;
            next.along[d] = static_cast<float>(along);
            wait(j, Arrival(next.from, next.along));
          }
        }
      }
    }
    same.clear();
    same.shrink_to_fit();
  }
  return false;
}

//------------------------------------------------------------------------------
template <class T>
void ActiveRegion<T>::spread(std::int64_t i, const Index& at)
{
  if (!this->open(i))
  {
    return;
  }
  const std::array<int, 3>& n = this->medium.grid.dims;
  for (int d = 0; d < 3; ++d)
  {
    for (int side = -1; side <= 1; side += 2)
    {
      const std::int64_t j = i + side * this->stride[d];
      if (at[d] + side < 0 || at[d] + side >= n[d] || this->state[j] == Lit || !this->open(j))
      {
        continue;
      }
      Index there = at;
      there[d] += side;
      const double now = this->foretell(j, there);
      const bool news = this->state[j] == Unknown ||
        now < static_cast<double>(this->cost[j]) - (this->state[j] == Dark ? Brighter : 0.);
      if (news)
      {
        this->push(j, now);
      }
    }
  }
}

template <class T>
double ActiveRegion<T>::grow(double at, std::int64_t all, std::int64_t half) const
{
  const double most = static_cast<double>(std::max(all, half));
  const double power = std::log2(most / static_cast<double>(std::max<std::int64_t>(1, half)));
  return static_cast<double>(all) *
    std::pow(std::max(1., this->budget / at), std::min(3., std::max(1., power)));
}

template <class T>
bool ActiveRegion<T>::advance(std::int64_t limit, std::int64_t more)
{
  this->numberTaken = 0;
  bool ended = true;
  this->outgrown = 0;
  std::vector<std::int64_t> before; // how many were lit when a bucket's turn came
  for (std::size_t bucket = 0; bucket < this->queue.size(); ++bucket)
  {
    before.push_back(this->numberLit);
    std::vector<std::int64_t>& same = this->queue[bucket];
    // grows while it is read
    for (std::size_t p = 0; p < same.size(); ++p)
    {
      const std::int64_t i = same[p];
      if (this->state[i] != Trial)
      {
        continue; // came by a shorter way
      }
      if (this->numberTaken >= limit && more > 0)
      {
        const double reached = QueueStep * static_cast<double>(bucket + 1);
        const double all = this->grow(reached, this->numberLit, before[(bucket + 1) / 2]);
        limit += all < static_cast<double>(this->numberLit + more) ? more : 0;
        more = 0;
      }
      if (this->numberTaken >= limit)
      {
        ended = false;
        this->state[i] = Unknown; // the rim will tell
        continue;
      }
      ++this->numberTaken;
      ++this->numberLit;
      this->state[i] = Lit;
      const Index here = this->at(i);
      this->widen(here);
      const Span& span = this->solved[this->tileRow(here[1], here[2])];
      this->outgrown += here[0] < span.begin || here[0] >= span.end;
      this->spread(i, here);
    }
    same.clear();
  }
  return ended;
}

template <class T>
bool ActiveRegion<T>::grown() const
{
  return static_cast<double>(this->outgrown) > Few * static_cast<double>(this->size());
}

//------------------------------------------------------------------------------
template <class T>
typename ActiveRegion<T>::Rim ActiveRegion<T>::learn(const double* phi, bool giveUp)
{
  Rim rim;
  const std::array<int, 3>& n = this->medium.grid.dims;
  this->solved = this->hull;
  const std::vector<Span> domain = this->spans();
  const auto forEach = [&](auto&& action)
  {
    Index at{ { 0, 0, 0 } };
    for (std::size_t r = 0; r < domain.size(); ++r)
    {
      const std::int64_t o = static_cast<std::int64_t>(r) * n[0];
      for (at[0] = domain[r].begin; at[0] < domain[r].end; ++at[0])
      {
        action(at, o + at[0]);
      }
      at[2] += at[1] + 1 == n[1];
      at[1] = at[1] + 1 == n[1] ? 0 : at[1] + 1;
    }
  };
  double largest = 0.;
  double squares = 0.;
  forEach(
    [&](const Index&, std::int64_t i)
    {
      largest = std::max(largest, std::abs(phi[i]));
      squares += phi[i] * phi[i];
    });
  if (!(largest > 0.))
  {
    return rim;
  }
  // 1. the true costs
  std::fill(this->hull.begin(), this->hull.end(), Span());
  const auto costOf = [&](std::int64_t i)
  {
    const double part = std::abs(phi[i]) / largest;
    return part > 1e-30 ? -std::log(static_cast<float>(part)) : 70.f;
  };
  const float keep = giveUp ? static_cast<float>(this->budget + Spare) : 1e30f;
  this->numberLit = 0;
  forEach(
    [&](const Index& at, std::int64_t i)
    {
      const float c = costOf(i);
      this->cost[i] = c;
      this->state[i] = c <= keep ? Lit : Dark;
      if (c <= keep)
      {
        ++this->numberLit;
        this->widen(at);
      }
    });
  for (const std::int64_t i : this->sources)
  {
    this->state[i] = Lit;
    this->widen(this->at(i));
  }
  // 2. the rim
  std::vector<std::pair<std::int64_t, double>> front;
  forEach(
    [&](const Index& at, std::int64_t i)
    {
      double least = 1.; // of what a cut keeps of phi beside it
      double missing = 0.;
      for (int d = 0; d < 3; ++d)
      {
        for (int side = -1; side <= 1; side += 2)
        {
          Index next = at;
          next[d] += side;
          if (next[d] < 0 || next[d] >= n[d])
          {
            continue;
          }
          const Span& there =
            domain[static_cast<std::size_t>(next[1] + static_cast<std::int64_t>(n[1]) * next[2])];
          const std::int64_t j = i + side * this->stride[d];
          if ((next[0] >= there.begin && next[0] < there.end) || !this->open(i) || !this->open(j))
          {
            continue;
          }
          const double a = static_cast<double>(this->medium.D[i]);
          const double b = static_cast<double>(this->medium.D[j]);
          const double out = 2. * a * (b / (a + b)) * this->perArea[d] * phi[i];
          rim.leaked += out;
          // phi goes as sinh there: the voxel behind tells how fast, or the medium
          const std::int64_t behind = i - side * this->stride[d];
          const bool known = at[d] - side >= 0 && at[d] - side < n[d];
          const double before = known ? 0.5 * std::abs(phi[behind]) : 0.;
          const double here = std::abs(phi[i]);
          const double ratio = before > here && before < 1e100 * here ? before / here : 1.;
          const double x = std::min(1e100, this->damping(i, j, d));
          // e^-c, 0.1 the least c
          const double decayed = std::min({ 0.905, 1. / (ratio + std::sqrt(ratio * ratio - 1.)),
            1. / (1. + 0.5 * x + std::sqrt(x + 0.25 * x * x)) });
          const double kept = 1. - decayed * decayed;
          least = std::min(least, kept);
          // phi beyond, were it not cut, and farther on
          const double passed = decayed / kept;
          missing += out * passed;
          rim.beyond += phi[i] * passed * (phi[i] * passed) / kept;
        }
      }
      if (missing != 0.)
      {
        rim.missing.emplace_back(i, missing);
      }
      if (least < 1. && this->state[i] == Lit)
      {
        const double lost = -std::log(least);
        if (static_cast<double>(this->cost[i]) - lost <= this->budget)
        {
          front.emplace_back(i, lost);
        }
      }
    });
  rim.leaked *= this->medium.grid.voxelVolume();
  rim.beyond = squares > 0. ? std::sqrt(rim.beyond / squares) : 0.;
  double sum = 0.;
  for (const auto& voxel : front)
  {
    sum += static_cast<double>(this->cost[voxel.first]);
    this->cost[voxel.first] -= static_cast<float>(voxel.second);
  }
  // 3. how far it will grow
  rim.expected = static_cast<double>(this->numberLit);
  if (!front.empty())
  {
    const double mean = std::max(sum / static_cast<double>(front.size()), 0.1);
    std::int64_t all = 0;
    std::int64_t half = 1;
    forEach(
      [&](const Index&, std::int64_t i)
      {
        all += static_cast<double>(this->cost[i]) <= mean;
        half += static_cast<double>(this->cost[i]) <= 0.5 * mean;
      });
    rim.expected = std::max(rim.expected, this->grow(mean, all, half));
  }
  for (const auto& voxel : front)
  {
    this->spread(voxel.first, this->at(voxel.first));
  }
  return rim;
}

//------------------------------------------------------------------------------
#define LIGHTTRANSPORT_INSTANTIATE(T)                                                              \
  template class ActiveRegion<T>;                                                                  \
  template bool ActiveRegion<T>::start<float>(const float*, double, const ParallelFor&);           \
  template bool ActiveRegion<T>::start<double>(const double*, double, const ParallelFor&);
LIGHTTRANSPORT_INSTANTIATE(float)
LIGHTTRANSPORT_INSTANTIATE(double)
#undef LIGHTTRANSPORT_INSTANTIATE
} // namespace lighttransport
