// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/FirstMoment.h"

#include "Core/Kernel.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <sstream>

namespace lighttransport
{
namespace
{
/** E += relaxation (conductance (phi - next) - E) */
LIGHTTRANSPORT_SIMD
void relax(int n, const float* LIGHTTRANSPORT_RESTRICT conductance,
  const float* LIGHTTRANSPORT_RESTRICT relaxation, const double* phi, const double* next,
  double* LIGHTTRANSPORT_RESTRICT E)
{
  for (int i = 0; i < n; ++i)
  {
    E[i] += double(relaxation[i]) * (double(conductance[i]) * (phi[i] - next[i]) - E[i]);
  }
}

/** out += (high - low) / h */
LIGHTTRANSPORT_SIMD
void diverge(int n, double perH, const double* LIGHTTRANSPORT_RESTRICT high,
  const double* LIGHTTRANSPORT_RESTRICT low, double* LIGHTTRANSPORT_RESTRICT out)
{
  for (int i = 0; i < n; ++i)
  {
    out[i] += perH * (high[i] - low[i]);
  }
}

/**
 * The step of phi in one row, from q - div E = q - out; adds the sums of the squares of its rate,
 * of what is absorbed and of what is stored.
 */
template <bool Lit, class T>
LIGHTTRANSPORT_INLINE void advanceOf(int n, double cdt, const float* LIGHTTRANSPORT_RESTRICT sigma,
  const float* LIGHTTRANSPORT_RESTRICT weight, const T* LIGHTTRANSPORT_RESTRICT q,
  const double* LIGHTTRANSPORT_RESTRICT out, double* LIGHTTRANSPORT_RESTRICT phi, double* sums)
{
  constexpr int strands = 8;
  double all[3][strands] = {};
  const auto one = [&](int i, int l)
  {
    const double gain = (Lit ? static_cast<double>(q[i]) : 0.) - out[i];
    const double change = gain - static_cast<double>(sigma[i]) * phi[i];
    const double mean = static_cast<double>(weight[i]) * change; // over the step
    phi[i] += cdt * mean;
    all[0][l] += change * change;
    all[1][l] += gain - mean; // not from the loss, of which a long step leaves nothing
    all[2][l] += mean;
  };
  int i = 0;
  for (; i + strands <= n; i += strands)
  {
    for (int l = 0; l < strands; ++l)
    {
      one(i + l, l);
    }
  }
  for (; i < n; ++i)
  {
    one(i, 0);
  }
  for (int k = 0; k < 3; ++k)
  {
    const double* s = all[k];
    sums[k] += ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7]));
  }
}
LIGHTTRANSPORT_SIMD
void advanceRow(int n, double cdt, const float* sigma, const float* weight, const float* q,
  const double* out, double* phi, double* sums)
{
  q ? advanceOf<true>(n, cdt, sigma, weight, q, out, phi, sums)
    : advanceOf<false>(n, cdt, sigma, weight, q, out, phi, sums);
}
LIGHTTRANSPORT_SIMD
void advanceRow(int n, double cdt, const float* sigma, const float* weight, const double* q,
  const double* out, double* phi, double* sums)
{
  q ? advanceOf<true>(n, cdt, sigma, weight, q, out, phi, sums)
    : advanceOf<false>(n, cdt, sigma, weight, q, out, phi, sums);
}

/** The rate at which a face goes to Fick's flux: 1 / (3 D_f), the border's half voxel twice. */
double rate(double conductance, double h, bool border)
{
  return (border ? 2. : 1.) / (3. * h * conductance);
}

/** 1 - exp(-rate length), 1 for a wall. */
double relaxationOf(double conductance, double h, bool border, double length)
{
  return conductance > 0. ? -std::expm1(-rate(conductance, h, border) * length) : 1.;
}
} // namespace

/** What a row of voxels has along one axis. */
struct FirstMomentSolver::Row
{
  bool none = false;      // the axis has one voxel
  double h = 1.;          //
  std::int64_t next = 0;  // stride to the next voxel
  bool first = false;     // y, z: this row lies at the low border
  bool last = false;      // y, z: and at the high one
  std::int64_t begin = 0; // the row's first voxel
  std::int64_t low = 0;   // index of the row's first low face, where it has one

  Row(const Grid& box, int d, std::int64_t r)
  {
    const std::array<int, 3>& n = box.dims;
    const std::int64_t j = r % n[1];
    const std::int64_t k = r / n[1];
    this->none = n[d] < 2;
    this->h = box.spacing[d];
    this->next = d == 0 ? 1 : (d == 1 ? n[0] : static_cast<std::int64_t>(n[0]) * n[1]);
    this->first = d == 1 ? j == 0 : (d == 2 && k == 0);
    this->last = d == 1 ? j + 1 == n[1] : (d == 2 && k + 1 == n[2]);
    this->begin = r * n[0];
    this->low = d == 0 ? r : n[0] * (d == 1 ? k : j);
  }
};

struct FirstMomentSolver::Sums
{
  double rate2 = 0.;    // of the squares of d(phi)/d(ct)
  double absorbed = 0.; // over the step, divided by the voxels' volume and c dt
  double escaped = 0.;
  double stored = 0.;

  Sums& operator+=(const Sums& other)
  {
    this->rate2 += other.rate2;
    this->absorbed += other.absorbed;
    this->escaped += other.escaped;
    this->stored += other.stored;
    return *this;
  }
};

//------------------------------------------------------------------------------
FirstMomentSolver::FirstMomentSolver(ParallelFor how)
  : parallelFor(std::move(how))
{
}

std::int64_t FirstMomentSolver::rows() const
{
  return static_cast<std::int64_t>(this->box.dims[1]) * this->box.dims[2];
}

std::int64_t FirstMomentSolver::bytes() const
{
  std::int64_t sum = this->sigma_a.bytes() + this->weight.bytes();
  for (const Faces& f : this->faces)
  {
    sum += f.conductance.bytes() + f.relaxation.bytes() + f.E.bytes() + f.lowConductance.bytes() +
      f.lowRelaxation.bytes() + f.lowE.bytes();
  }
  return sum;
}

//------------------------------------------------------------------------------
template <class T>
DiffusionReport FirstMomentSolver::setMedium(
  const DiffusionMedium<T>& medium, const ProgressFunction& progress)
{
  const double began = now();
  const WatchedFor::Asking asking(this->parallelFor, progress);
  DiffusionReport report;
  try
  {
    // knows what a medium may be, and says what is wrong
    report = DiffusionSolver(this->parallelFor).check(medium);
    if (report.reason != StopReason::Converged)
    {
      return report;
    }
    this->prepare(medium);
  }
  catch (const Interrupted&)
  {
    report.reason = StopReason::Cancelled;
    report.message = "cancelled while setting up";
  }
  report.seconds = now() - began;
  report.bytes = this->bytes();
  return report;
}

template <class T>
void FirstMomentSolver::prepare(const DiffusionMedium<T>& medium)
{
  this->box = medium.grid;
  const std::array<int, 3>& n = this->box.dims;
  const std::int64_t size = this->box.size();
  this->zeros.assign(static_cast<std::size_t>(n[0]), 0.);
  this->sigma_a.allocate(size);
  this->weight.allocate(size);
  for (int d = 0; d < 3; ++d)
  {
    Faces& f = this->faces[static_cast<std::size_t>(d)];
    const std::int64_t all = n[d] > 1 ? size : 0;
    const std::int64_t low = n[d] > 1 ? size / n[d] : 0;
    f.conductance.allocate(all);
    f.relaxation.allocate(all);
    f.E.allocate(all);
    f.lowConductance.allocate(low);
    f.lowRelaxation.allocate(low);
    f.lowE.allocate(low);
  }
  this->lag = this->relaxedOver = this->cdt = this->stability = 0.;
  this->stepped = 0;

  const bool closed = medium.boundary == Boundary::ZeroFlux;
  const double twoA =
    medium.boundary == Boundary::Robin ? 2. * BoundaryFactor(medium.refractiveIndexRatio) : 0.;
  const auto D = [&medium](std::int64_t i)
  { return medium.outside && medium.outside[i] ? 0. : static_cast<double>(medium.D[i]); };
  ForRows(this->parallelFor, this->rows(), size,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        for (int d = 0; d < 3; ++d)
        {
          const Row row(this->box, d, r);
          if (row.none)
          {
            continue;
          }
          Faces& f = this->faces[static_cast<std::size_t>(d)];
          // phi is 0 beyond the border; its value on the face itself is eliminated
          const auto border = [&](std::int64_t i)
          { return closed ? 0.f : static_cast<float>(D(i) / (0.5 * row.h + twoA * D(i))); };
          for (int x = 0; x < n[0]; ++x)
          {
            const std::int64_t i = row.begin + x;
            const double a = D(i);
            if (d == 0 ? x + 1 == n[0] : row.last)
            {
              f.conductance[i] = border(i);
            }
            else
            {
              const double b = D(i + row.next);
              f.conductance[i] =
                a > 0. && b > 0. ? static_cast<float>(2. * a * (b / (a + b)) / row.h) : 0.f;
            }
            if (d == 0 ? x == 0 : row.first)
            {
              f.lowConductance[row.low + x] = border(i);
            }
          }
        }
        for (std::int64_t i = r * n[0]; i < (r + 1) * n[0]; ++i)
        {
          this->sigma_a[i] = medium.sigma_a && !(medium.outside && medium.outside[i])
            ? static_cast<float>(medium.sigma_a[i])
            : 0.f;
        }
      }
    });
}

//------------------------------------------------------------------------------
void FirstMomentSolver::reset()
{
  for (Faces& f : this->faces)
  {
    if (this->lag != 0. || this->stepped > 0) // else no step has touched them
    {
      f.E.allocate(f.E.size());
      f.lowE.allocate(f.lowE.size());
    }
  }
  this->lag = 0.;
  this->stepped = 0;
}

//------------------------------------------------------------------------------
double FirstMomentSolver::courantBound() const
{
  double sum = 0.;
  for (int d = 0; d < 3; ++d)
  {
    const double perH = this->box.dims[d] > 1 ? 1. / this->box.spacing[d] : 0.;
    sum += perH * perH;
  }
  // A single voxel's step is exact, whatever its length.
  return sum > 0. ? std::sqrt(3. / sum) : std::sqrt(3.) * this->box.smallestSpacing();
}

double FirstMomentSolver::stabilityBound(const ProgressFunction& progress)
{
  if (this->stability > 0.)
  {
    return this->stability;
  }
  const WatchedFor::Asking asking(this->parallelFor, progress);
  const double courant = this->courantBound();
  // Gershgorin's bound of the eigenvalues of M^-1 grad^T m^-1 grad, over 4: it grows with c dt.
  const auto load = [](double t, const double(&G)[6], const double(&h)[3], const bool(&border)[6],
                      double sigma, double (*tanh)(double))
  {
    double sum = 0.;
    for (int f = 0; f < 6; ++f)
    {
      if (G[f] > 0.)
      {
        const double step = h[f / 2];
        sum += (border[f] ? 2. : 4.) * G[f] / step * tanh(0.5 * rate(G[f], step, border[f]) * t);
      }
    }
    const double x = 0.5 * sigma * t;
    return 0.25 * sum * (x > 1e-8 ? tanh(x) / x * t : t);
  };
  const auto exact = [](double x) { return std::tanh(x); };
  // at most 5 % above it, and far cheaper: most voxels pass
  const auto above = [](double x) { return std::min(1., x / std::sqrt(1. + 2. / 3. * x * x)); };
  const std::array<int, 3>& n = this->box.dims;
  const double h[3] = { this->box.spacing[0], this->box.spacing[1], this->box.spacing[2] };
  // Beyond this no step is worth its name; the search starts from it in each row.
  const double most = 1e6 * courant;
  std::vector<double> bounds(static_cast<std::size_t>(this->rows()));
  const auto search = [&](std::int64_t begin, std::int64_t end)
  {
    for (std::int64_t r = begin; r < end; ++r)
    {
      const Row rows[3] = { Row(this->box, 0, r), Row(this->box, 1, r), Row(this->box, 2, r) };
      double bound = most;
      for (int x = 0; x < n[0]; ++x)
      {
        double G[6] = { 0., 0., 0., 0., 0., 0. };
        bool border[6] = { false, false, false, false, false, false };
        for (int d = 0; d < 3; ++d)
        {
          const Row& row = rows[d];
          const Faces& f = this->faces[static_cast<std::size_t>(d)];
          if (row.none)
          {
            continue;
          }
          const std::int64_t i = row.begin + x;
          border[2 * d] = d == 0 ? x == 0 : row.first;
          border[2 * d + 1] = d == 0 ? x + 1 == n[0] : row.last;
          G[2 * d] = static_cast<double>(
            border[2 * d] ? f.lowConductance[row.low + x] : f.conductance[i - row.next]);
          G[2 * d + 1] = static_cast<double>(f.conductance[i]);
        }
        const double sigma = static_cast<double>(this->sigma_a[rows[0].begin + x]);
        if (load(bound, G, h, border, sigma, above) <= 1. ||
          load(bound, G, h, border, sigma, exact) <= 1.)
        {
          continue; // does not lower the bound
        }
        double low = courant; // stable by construction
        double high = bound;
        while (high - low > 1e-6 * low)
        {
          const double middle = std::sqrt(low * high);
          (load(middle, G, h, border, sigma, exact) <= 1. ? low : high) = middle;
        }
        bound = low;
      }
      bounds[static_cast<std::size_t>(r)] = bound;
    }
  };
  try
  {
    ForRows(this->parallelFor, this->rows(), this->box.size(), search);
  }
  catch (const Interrupted&)
  {
    return 0.;
  }
  this->stability = *std::min_element(bounds.begin(), bounds.end());
  return this->stability;
}

//------------------------------------------------------------------------------
void FirstMomentSolver::relaxOver(double length)
{
  if (length == this->relaxedOver)
  {
    return;
  }
  this->relaxedOver = -1.; // until it is done
  const int nx = this->box.dims[0];
  ForRows(this->parallelFor, this->rows(), this->box.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        for (int d = 0; d < 3; ++d)
        {
          const Row row(this->box, d, r);
          if (row.none)
          {
            continue;
          }
          Faces& f = this->faces[static_cast<std::size_t>(d)];
          const auto relaxation = [&](float conductance, bool border)
          {
            return static_cast<float>(
              relaxationOf(static_cast<double>(conductance), row.h, border, length));
          };
          for (int x = 0; x < nx; ++x)
          {
            const std::int64_t i = row.begin + x;
            f.relaxation[i] = relaxation(f.conductance[i], d == 0 ? x + 1 == nx : row.last);
          }
          const int low = d == 0 ? 1 : (row.first ? nx : 0);
          for (std::int64_t i = row.low; i < row.low + low; ++i)
          {
            f.lowRelaxation[i] = relaxation(f.lowConductance[i], true);
          }
        }
      }
    });
  this->relaxedOver = length;
}

void FirstMomentSolver::weighAbsorption(double length)
{
  if (length == this->cdt)
  {
    return;
  }
  this->cdt = -1.; // until it is done
  const int nx = this->box.dims[0];
  ForRows(this->parallelFor, this->rows(), this->box.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t i = begin * nx; i < end * nx; ++i)
      {
        const double depth = static_cast<double>(this->sigma_a[i]) * length;
        this->weight[i] = depth > 0. ? static_cast<float>(-std::expm1(-depth) / depth) : 1.f;
      }
    });
  this->cdt = length;
}

//------------------------------------------------------------------------------
void FirstMomentSolver::stepE(const double* phi)
{
  this->relaxOver(this->steppingOver);
  const int nx = this->box.dims[0];
  const double* beyond = this->zeros.data();
  const std::int64_t from = this->stepped;
  std::atomic<std::int64_t> done{ from };
  const auto rest = [&](std::int64_t begin, std::int64_t end)
  {
    for (std::int64_t r = from + begin; r < from + end; ++r)
    {
      for (int d = 0; d < 3; ++d)
      {
        const Row row(this->box, d, r);
        if (row.none)
        {
          continue;
        }
        Faces& f = this->faces[static_cast<std::size_t>(d)];
        const std::int64_t o = row.begin;
        const float* G = f.conductance.data() + o;
        const float* R = f.relaxation.data() + o;
        double* E = f.E.data() + o;
        int low = row.first ? nx : 0;
        if (d == 0)
        {
          relax(nx - 1, G, R, phi + o, phi + o + 1, E);
          relax(1, G + nx - 1, R + nx - 1, phi + o + nx - 1, beyond, E + nx - 1);
          low = 1;
        }
        else
        {
          relax(nx, G, R, phi + o, row.last ? beyond : phi + o + row.next, E);
        }
        if (low > 0)
        {
          relax(low, f.lowConductance.data() + row.low, f.lowRelaxation.data() + row.low, beyond,
            phi + o, f.lowE.data() + row.low);
        }
      }
    }
    std::int64_t before = done;
    while (before < from + end && !done.compare_exchange_weak(before, from + end))
    {
    }
  };
  try
  {
    ForRows(this->parallelFor, this->rows() - from, (this->rows() - from) * nx, rest);
  }
  catch (const Interrupted&)
  {
    this->stepped = done; // pieces come in order
    throw;
  }
  this->stepped = 0;
  this->lag -= this->steppingOver;
}

double FirstMomentSolver::lagOf(std::int64_t row) const
{
  return row < this->stepped ? this->lag - this->steppingOver : this->lag;
}

//------------------------------------------------------------------------------
template <class T>
FirstMomentSolver::Sums FirstMomentSolver::stepPhi(const T* q, double* phi)
{
  const int nx = this->box.dims[0];
  std::vector<Sums> partial(static_cast<std::size_t>(this->rows()));
  ForRows(this->parallelFor.whole(), this->rows(), this->box.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      std::vector<double> divergence(static_cast<std::size_t>(nx));
      for (std::int64_t r = begin; r < end; ++r)
      {
        Sums& sums = partial[static_cast<std::size_t>(r)];
        std::fill(divergence.begin(), divergence.end(), 0.);
        double* out = divergence.data();
        for (int d = 0; d < 3; ++d)
        {
          const Row row(this->box, d, r);
          if (row.none)
          {
            continue;
          }
          const Faces& f = this->faces[static_cast<std::size_t>(d)];
          const double* E = f.E.data() + row.begin;
          const double* lowE = f.lowE.data() + row.low;
          const double perH = 1. / row.h;
          if (d == 0)
          {
            out[0] += perH * (E[0] - lowE[0]);
            diverge(nx - 1, perH, E + 1, E, out + 1);
            sums.escaped += perH * (E[nx - 1] - lowE[0]);
          }
          else
          {
            diverge(nx, perH, E, row.first ? lowE : E - row.next, out);
            for (int x = 0; x < nx && (row.first || row.last); ++x)
            {
              sums.escaped += perH * ((row.last ? E[x] : 0.) - (row.first ? lowE[x] : 0.));
            }
          }
        }
        const std::int64_t o = r * nx;
        double three[3] = { 0., 0., 0. };
        advanceRow(nx, this->cdt, this->sigma_a.data() + o, this->weight.data() + o,
          q ? q + o : nullptr, out, phi + o, three);
        sums.rate2 = three[0];
        sums.absorbed = three[1];
        sums.stored = three[2];
      }
    });
  Sums all;
  for (const Sums& sums : partial)
  {
    all += sums;
  }
  return all;
}

//------------------------------------------------------------------------------
template <class T>
double FirstMomentSolver::residual(const T* q, const double* phi) const
{
  const int nx = this->box.dims[0];
  return std::sqrt(SumRows(this->parallelFor, this->rows(), this->box.size(),
    [&](std::int64_t r)
    {
      const Row rows[3] = { Row(this->box, 0, r), Row(this->box, 1, r), Row(this->box, 2, r) };
      double sum = 0.;
      for (int x = 0; x < nx; ++x)
      {
        const std::int64_t i = r * nx + x;
        double v =
          (q ? static_cast<double>(q[i]) : 0.) - static_cast<double>(this->sigma_a[i]) * phi[i];
        for (int d = 0; d < 3; ++d)
        {
          const Row& row = rows[d];
          if (row.none)
          {
            continue;
          }
          const Faces& f = this->faces[static_cast<std::size_t>(d)];
          const bool first = d == 0 ? x == 0 : row.first;
          const bool last = d == 0 ? x + 1 == nx : row.last;
          const double high =
            static_cast<double>(f.conductance[i]) * (phi[i] - (last ? 0. : phi[i + row.next]));
          const double low = first
            ? static_cast<double>(f.lowConductance[row.low + x]) * phi[i]
            : static_cast<double>(f.conductance[i - row.next]) * (phi[i] - phi[i - row.next]);
          v -= (high + low) / row.h;
        }
        sum += v * v;
      }
      return sum;
    }));
}

//------------------------------------------------------------------------------
template <class T>
FirstMomentReport FirstMomentSolver::step(
  const T* q, double* phi, int steps, double length, const DiffusionControl& control)
{
  const double began = now();
  const WatchedFor::Asking asking(this->parallelFor, control.progress);
  FirstMomentReport report;
  try
  {
    this->march(q, phi, steps, length, control, report);
  }
  catch (const Interrupted&)
  {
    report.reason = StopReason::Cancelled;
    report.message = report.iterations > 0
      ? "cancelled; the residual is that of the last step, not recomputed"
      : "cancelled before the first step";
  }
  report.seconds = now() - began;
  return report;
}

template <class T>
void FirstMomentSolver::march(const T* q, double* phi, int steps, double length,
  const DiffusionControl& control, FirstMomentReport& report)
{
  // The margin is rounding's: the bound itself is allowed.
  constexpr double margin = 1. + 1e-6;
  const bool positive = std::isfinite(length) && length > 0.;
  if (!positive ||
    (length / margin > this->courantBound() && length / margin > this->stabilityBound()))
  {
    std::ostringstream text;
    text << "the first-moment step c dt = " << length << " is unstable; expected in (0, "
         << this->stabilityBound() << "] (length; a step goes as far as the light up to "
         << this->courantBound() << ")";
    report.message = text.str();
    return;
  }
  const int nx = this->box.dims[0];
  const std::int64_t size = this->box.size();
  const double V = this->box.voxelVolume();
  double q2 = 0.;
  double qSum = 0.;
  if (q)
  {
    const auto sum = [&](auto&& term)
    {
      return SumRows(this->parallelFor, this->rows(), size,
        [&](std::int64_t r)
        {
          double s = 0.;
          for (std::int64_t i = r * nx; i < (r + 1) * nx; ++i)
          {
            s += term(static_cast<double>(q[i]));
          }
          return s;
        });
    };
    q2 = sum([](double v) { return v * v; });
    qSum = sum([](double v) { return v; });
  }
  const double goal = control.tolerance * std::sqrt(q2);

  this->parallelFor.tell(0.);
  Touch(phi, size, this->parallelFor);
  for (Faces& f : this->faces)
  {
    Touch(f.E.data(), f.E.size(), this->parallelFor);
  }
  this->weighAbsorption(length);
  report.bytes = this->bytes() + size * static_cast<std::int64_t>(sizeof(double));
  report.reason = StopReason::MaxIterations;
  Showing show(control);
  if (this->stepped > 0)
  {
    this->stepE(phi); // what a call before was cancelled in
  }
  for (int i = 0; i < steps; ++i)
  {
    // E goes from where it is to half a step after phi, phi from there half a step further.
    this->steppingOver = this->lag + 0.5 * length;
    this->stepE(phi);
    this->parallelFor.poll();
    const Sums sums = this->stepPhi(q, phi);
    this->lag = 0.5 * length;
    report.emittedEnergy += qSum * V * length;
    report.absorbedEnergy += sums.absorbed * V * length;
    report.escapedEnergy += sums.escaped * V * length;
    report.storedEnergy += sums.stored * V * length;
    report.escaped = sums.escaped * V;
    report.residual = q2 > 0. ? std::sqrt(sums.rate2 / q2) : std::sqrt(sums.rate2);
    ++report.iterations;
    report.fineApplications += 1.;
    if (!std::isfinite(sums.rate2))
    {
      report.reason = StopReason::NotFinite;
      break;
    }
    if (goal > 0. && std::sqrt(sums.rate2) <= goal && this->residual(q, phi) <= goal)
    {
      report.reason = StopReason::Converged;
      break;
    }
    show(phi);
    const double fraction = static_cast<double>(i + 1) / steps;
    this->parallelFor.tell(fraction);
    if (control.progress && !control.progress(fraction))
    {
      throw Interrupted();
    }
  }
  const double last = this->residual(q, phi);
  report.residual = q2 > 0. ? last / std::sqrt(q2) : last;
  report.emitted = qSum * V;
  report.absorbed = V *
    SumRows(this->parallelFor, this->rows(), size,
      [&](std::int64_t r)
      {
        double s = 0.;
        for (std::int64_t i = r * nx; i < (r + 1) * nx; ++i)
        {
          s += static_cast<double>(this->sigma_a[i]) * phi[i];
        }
        return s;
      });
}

//------------------------------------------------------------------------------
template <class T>
bool FirstMomentSolver::flux(const double* phi, T* E, const ProgressFunction& progress) const
{
  const WatchedFor::Asking asking(this->parallelFor, progress);
  const int nx = this->box.dims[0];
  const auto write = [&](std::int64_t begin, std::int64_t end)
  {
    for (std::int64_t r = begin; r < end; ++r)
    {
      const Row rows[3] = { Row(this->box, 0, r), Row(this->box, 1, r), Row(this->box, 2, r) };
      for (int x = 0; x < nx; ++x)
      {
        const std::int64_t i = r * nx + x;
        for (int d = 0; d < 3; ++d)
        {
          const Row& row = rows[d];
          if (row.none)
          {
            E[3 * i + d] = T(0);
            continue;
          }
          const Faces& f = this->faces[static_cast<std::size_t>(d)];
          // from E's time to phi's
          const auto advanced =
            [&](double e, float conductance, double difference, bool border, double behind)
          {
            const double G = static_cast<double>(conductance);
            return e + relaxationOf(G, row.h, border, std::max(0., behind)) * (G * difference - e);
          };
          const double own = this->lagOf(r);
          const bool first = d == 0 ? x == 0 : row.first;
          const bool last = d == 0 ? x + 1 == nx : row.last;
          const double high =
            advanced(f.E[i], f.conductance[i], phi[i] - (last ? 0. : phi[i + row.next]), last, own);
          const double low = first
            ? advanced(f.lowE[row.low + x], f.lowConductance[row.low + x], -phi[i], true, own)
            : advanced(f.E[i - row.next], f.conductance[i - row.next], phi[i - row.next] - phi[i],
                false, this->lagOf((i - row.next) / nx));
          E[3 * i + d] = static_cast<T>(0.5 * (low + high));
        }
      }
    }
  };
  try
  {
    ForRows(this->parallelFor, this->rows(), this->box.size(), write);
  }
  catch (const Interrupted&)
  {
    return false;
  }
  return true;
}

//------------------------------------------------------------------------------
#define LIGHTTRANSPORT_INSTANTIATE(T)                                                              \
  template DiffusionReport FirstMomentSolver::setMedium<T>(                                        \
    const DiffusionMedium<T>&, const ProgressFunction&);                                           \
  template FirstMomentReport FirstMomentSolver::step<T>(                                           \
    const T*, double*, int, double, const DiffusionControl&);                                      \
  template bool FirstMomentSolver::flux<T>(const double*, T*, const ProgressFunction&) const;
LIGHTTRANSPORT_INSTANTIATE(float)
LIGHTTRANSPORT_INSTANTIATE(double)
#undef LIGHTTRANSPORT_INSTANTIATE
} // namespace lighttransport
