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
/** The part of a region that is not worth another solve when it turns out to be lit as well. */
constexpr double Few = 0.005;

/** c of 2 (cosh c - 1) = x */
double decay(double x)
{
  const double half = 1. + 0.5 * x;
  const double c = x < 1e-2 ? std::sqrt(x) : std::log(half + std::sqrt(half * half - 1.));
  return std::max(c, LeastStep);
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
double ActiveRegion<T>::step(std::int64_t i, std::int64_t j, int d) const
{
  if (!this->open(i) || !this->open(j))
  {
    return std::numeric_limits<double>::infinity();
  }
  const double a = static_cast<double>(this->medium.D[i]);
  const double b = static_cast<double>(this->medium.D[j]);
  const double sigma = this->medium.sigma_a ? static_cast<double>(this->medium.sigma_a[j]) : 0.;
  // sigma h^2 / (2 a b / (a + b)), with no product that could underflow
  const double x = 0.5 * sigma * (1. / a + 1. / b) / this->perArea[d];
  return x < 1e30 ? decay(x) : std::numeric_limits<double>::infinity();
}

template <class T>
double ActiveRegion<T>::foretell(std::int64_t j) const
{
  const std::array<int, 3>& n = this->medium.grid.dims;
  const int at[3] = { static_cast<int>(j % n[0]), static_cast<int>(j / n[0] % n[1]),
    static_cast<int>(j / this->stride[2]) };
  // along each axis the better of two neighbours
  double from[3];
  double c[3];
  int axes = 0;
  for (int d = 0; d < 3; ++d)
  {
    double best = std::numeric_limits<double>::infinity();
    double bestStep = 0.;
    for (int side = -1; side <= 1; side += 2)
    {
      const std::int64_t i = j + side * this->stride[d];
      if (at[d] + side >= 0 && at[d] + side < n[d] && this->state[i] == Lit)
      {
        const double along = this->step(i, j, d);
        if (static_cast<double>(this->cost[i]) + along < best + bestStep)
        {
          best = static_cast<double>(this->cost[i]);
          bestStep = along;
        }
      }
    }
    if (std::isfinite(best + bestStep))
    {
      int p = axes++;
      for (; p > 0 && from[p - 1] > best; --p)
      {
        from[p] = from[p - 1];
        c[p] = c[p - 1];
      }
      from[p] = best;
      c[p] = bestStep;
    }
  }
  if (axes == 0)
  {
    return std::numeric_limits<double>::infinity();
  }
  double result = from[0] + c[0];
  // sum w (T - from)^2 = 1 over the axes that it comes along
  double w = 0.;
  double wf = 0.;
  double wff = 0.;
  for (int d = 0; d < axes && from[d] < result; ++d)
  {
    const double wd = 1. / (c[d] * c[d]);
    const double f = from[d] - from[0];
    w += wd;
    wf += wd * f;
    wff += wd * f * f;
    const double root = wf * wf - w * (wff - 1.);
    if (root < 0.)
    {
      break;
    }
    result = std::min(result, from[0] + (wf + std::sqrt(root)) / w);
  }
  return result;
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
void ActiveRegion<T>::widen(std::int64_t i)
{
  const std::array<int, 3>& n = this->medium.grid.dims;
  const std::int64_t row = i / n[0];
  Span& span =
    this->hull[this->tileRow(static_cast<int>(row % n[1]), static_cast<int>(row / n[1]))];
  const int x = static_cast<int>(i - row * n[0]);
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
bool ActiveRegion<T>::start(const Q* q, const ParallelFor& parallelFor)
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
  std::int64_t brightest = -1;
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
      if (own.back() > most)
      {
        most = own.back();
        brightest = i;
      }
      if (8 * static_cast<std::int64_t>(this->sources.size()) > size)
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
  if (brightest < 0)
  {
    return true;
  }
  // Straight ways from the brightest: along the axes and the diagonals.
  int ways = 0;
  int clear = 0;
  for (int way = 0; way < 27; ++way)
  {
    const int along[3] = { way % 3 - 1, way / 3 % 3 - 1, way / 9 - 1 };
    double perStep = 0.;
    std::int64_t ahead = 0;
    bool usable = way != 13;
    for (int d = 0; d < 3; ++d)
    {
      usable = usable && (along[d] == 0 || n[d] > 1);
      perStep += along[d] != 0 && n[d] > 1 ? 1. / this->perArea[d] : 0.;
      ahead += along[d] * this->stride[d];
    }
    if (!usable)
    {
      continue;
    }
    ++ways;
    int at[3] = { static_cast<int>(brightest % n[0]), static_cast<int>(brightest / n[0] % n[1]),
      static_cast<int>(brightest / this->stride[2]) };
    std::int64_t i = brightest;
    double sum = 0.;
    for (;;)
    {
      bool inside = true;
      for (int d = 0; d < 3; ++d)
      {
        at[d] += along[d];
        inside = inside && at[d] >= 0 && at[d] < n[d];
      }
      if (!inside || sum > 0.5 * this->budget || !this->open(i))
      {
        clear += !inside && sum <= 0.5 * this->budget;
        break;
      }
      const double a = static_cast<double>(this->medium.D[i]);
      i += ahead;
      const double b = static_cast<double>(this->medium.D[i]);
      const double sigma = this->medium.sigma_a ? static_cast<double>(this->medium.sigma_a[i]) : 0.;
      sum += b > 1e-150 ? decay(std::min(1e30, 0.5 * sigma * (1. / a + 1. / b) * perStep))
                        : this->budget;
    }
  }
  return 4 * clear < 3 * ways;
}

//------------------------------------------------------------------------------
template <class T>
void ActiveRegion<T>::spread(std::int64_t i)
{
  if (!this->open(i))
  {
    return;
  }
  const std::array<int, 3>& n = this->medium.grid.dims;
  const int at[3] = { static_cast<int>(i % n[0]), static_cast<int>(i / n[0] % n[1]),
    static_cast<int>(i / this->stride[2]) };
  for (int d = 0; d < 3; ++d)
  {
    for (int side = -1; side <= 1; side += 2)
    {
      const std::int64_t j = i + side * this->stride[d];
      if (at[d] + side < 0 || at[d] + side >= n[d] || this->state[j] == Lit || !this->open(j))
      {
        continue;
      }
      const double now = this->foretell(j);
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
bool ActiveRegion<T>::advance(std::int64_t limit)
{
  const std::array<int, 3>& n = this->medium.grid.dims;
  std::int64_t taken = 0;
  bool ended = true;
  this->outgrown = 0;
  for (std::size_t bucket = 0; bucket < this->queue.size(); ++bucket)
  {
    std::vector<std::int64_t>& same = this->queue[bucket];
    // grows while it is read
    for (std::size_t p = 0; p < same.size(); ++p)
    {
      const std::int64_t i = same[p];
      if (this->state[i] != Trial)
      {
        continue; // came by a shorter way
      }
      if (taken == limit)
      {
        ended = false;
        this->state[i] = Unknown; // the rim will tell
        continue;
      }
      ++taken;
      ++this->numberLit;
      this->state[i] = Lit;
      this->widen(i);
      const int at[3] = { static_cast<int>(i % n[0]), static_cast<int>(i / n[0] % n[1]),
        static_cast<int>(i / this->stride[2]) };
      const Span& span = this->solved[this->tileRow(at[1], at[2])];
      this->outgrown += at[0] < span.begin || at[0] >= span.end;
      this->spread(i);
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
    for (std::size_t r = 0; r < domain.size(); ++r)
    {
      const std::int64_t o = static_cast<std::int64_t>(r) * n[0];
      for (std::int64_t i = o + domain[r].begin; i < o + domain[r].end; ++i)
      {
        action(r, i);
      }
    }
  };
  double largest = 0.;
  forEach([&](std::size_t, std::int64_t i) { largest = std::max(largest, std::abs(phi[i])); });
  if (!(largest > 0.))
  {
    return rim;
  }
  // 1. the true costs
  std::fill(this->hull.begin(), this->hull.end(), Span());
  const auto costOf = [&](std::int64_t i)
  {
    const double part = std::abs(phi[i]) / largest;
    return part > 1e-30 ? -std::log(part) : 70.;
  };
  const double keep = giveUp ? this->budget + Spare : 1e30;
  this->numberLit = 0;
  forEach(
    [&](std::size_t, std::int64_t i)
    {
      const double c = costOf(i);
      this->cost[i] = static_cast<float>(c);
      this->state[i] = c <= keep ? Lit : Dark;
      if (c <= keep)
      {
        ++this->numberLit;
        this->widen(i);
      }
    });
  for (const std::int64_t i : this->sources)
  {
    this->state[i] = Lit;
    this->widen(i);
  }
  // 2. the rim
  std::vector<std::pair<std::int64_t, double>> front;
  forEach(
    [&](std::size_t r, std::int64_t i)
    {
      const int at[3] = { static_cast<int>(i - static_cast<std::int64_t>(r) * n[0]),
        static_cast<int>(r % static_cast<std::size_t>(n[1])),
        static_cast<int>(r / static_cast<std::size_t>(n[1])) };
      double lost = 0.;
      for (int d = 0; d < 3; ++d)
      {
        for (int side = -1; side <= 1; side += 2)
        {
          if (at[d] + side < 0 || at[d] + side >= n[d])
          {
            continue;
          }
          const int x = at[0] + (d == 0 ? side : 0);
          const Span& there =
            domain[d == 0 ? r : r + static_cast<std::size_t>(d == 1 ? side : side * n[1])];
          const std::int64_t j = i + side * this->stride[d];
          if ((x >= there.begin && x < there.end) || !this->open(i) || !this->open(j))
          {
            continue;
          }
          const double a = static_cast<double>(this->medium.D[i]);
          const double b = static_cast<double>(this->medium.D[j]);
          rim.leaked += 2. * a * (b / (a + b)) * this->perArea[d] * phi[i];
          // phi goes as sinh there: the voxel behind tells how fast
          const std::int64_t behind = i - side * this->stride[d];
          const bool known = at[d] - side >= 0 && at[d] - side < n[d];
          const double before = known ? 0.5 * std::abs(phi[behind]) : 0.;
          const double here = std::abs(phi[i]);
          const double ratio = before > here && before < 1e100 * here ? before / here : 1.;
          const double measured = std::log(ratio + std::sqrt(ratio * ratio - 1.));
          const double c = std::max({ 0.1, measured, this->step(i, j, d) });
          lost = std::max(lost, -std::log(-std::expm1(-2. * c)));
        }
      }
      if (lost > 0. && this->state[i] == Lit &&
        static_cast<double>(this->cost[i]) - lost <= this->budget)
      {
        front.emplace_back(i, lost);
      }
    });
  rim.leaked *= this->medium.grid.voxelVolume();
  double sum = 0.;
  for (const auto& voxel : front)
  {
    sum += static_cast<double>(this->cost[voxel.first]);
    this->cost[voxel.first] -= static_cast<float>(voxel.second);
  }
  // 3. in a vessel N(c) grows as c, in open matter as c^3
  rim.expected = static_cast<double>(this->numberLit);
  if (!front.empty())
  {
    const double mean = std::max(sum / static_cast<double>(front.size()), 0.1);
    std::int64_t all = 0;
    std::int64_t half = 1;
    forEach(
      [&](std::size_t, std::int64_t i)
      {
        all += static_cast<double>(this->cost[i]) <= mean;
        half += static_cast<double>(this->cost[i]) <= 0.5 * mean;
      });
    const double power = std::min(3.,
      std::max(
        1., std::log2(static_cast<double>(std::max(all, half)) / static_cast<double>(half))));
    rim.expected = std::max(
      rim.expected, static_cast<double>(all) * std::pow(std::max(1., this->budget / mean), power));
  }
  for (const auto& voxel : front)
  {
    this->spread(voxel.first);
  }
  return rim;
}

//------------------------------------------------------------------------------
#define LIGHTTRANSPORT_INSTANTIATE(T)                                                              \
  template class ActiveRegion<T>;                                                                  \
  template bool ActiveRegion<T>::start<float>(const float*, const ParallelFor&);                   \
  template bool ActiveRegion<T>::start<double>(const double*, const ParallelFor&);
LIGHTTRANSPORT_INSTANTIATE(float)
LIGHTTRANSPORT_INSTANTIATE(double)
#undef LIGHTTRANSPORT_INSTANTIATE
} // namespace lighttransport
