// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "DiffusionProblem.h"

#include "Core/Medium.h"

#include <algorithm>
#include <cstdio>

namespace lighttransport
{
namespace benchmark
{
namespace
{
std::uint32_t hash(std::uint32_t x)
{
  // Wellons' lowbias32
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return x;
}

std::uint32_t hash(int i, int j, int k, std::uint32_t seed)
{
  return hash(static_cast<std::uint32_t>(i) +
    hash(static_cast<std::uint32_t>(j) + hash(static_cast<std::uint32_t>(k) + 0x9e3779b9u * seed)));
}

/** [0, 1) */
double unit(std::uint32_t h)
{
  return h * (1. / 4294967296.);
}

double smooth(double t)
{
  t = std::min(1., std::max(0., t));
  return t * t * (3. - 2. * t);
}

double valueNoise(double x, double y, double z, std::uint32_t seed)
{
  const int i = static_cast<int>(std::floor(x));
  const int j = static_cast<int>(std::floor(y));
  const int k = static_cast<int>(std::floor(z));
  const double u = smooth(x - i);
  const double v = smooth(y - j);
  const double w = smooth(z - k);
  double sum = 0.;
  for (int c = 0; c < 8; ++c)
  {
    const int a = c & 1;
    const int b = (c >> 1) & 1;
    const int d = c >> 2;
    sum += (a ? u : 1. - u) * (b ? v : 1. - v) * (d ? w : 1. - w) *
      unit(hash(i + a, j + b, k + d, seed));
  }
  return 2. * sum - 1.;
}

struct Blob
{
  double x, y, z, radius, value;
};
struct Tube
{
  int axis;
  double b, c, swing, turns, phase, radius, value;
  std::vector<std::array<double, 2>> centre; ///< across, for each voxel along

  std::array<double, 2> centreAt(double p) const
  {
    const double along = 6.283185307 * this->turns * p + this->phase;
    return { { this->b + this->swing * std::sin(along),
      this->c + this->swing * std::cos(1.3 * along) } };
  }
};

struct Scene
{
  std::vector<Blob> blobs;
  std::vector<Tube> tubes;
  double voxel; ///< of the unit cube

  explicit Scene(int n)
    : voxel(1. / n)
  {
    std::uint32_t state = 20180917u;
    const auto random = [&state](double low, double high)
    {
      state = hash(state + 0x9e3779b9u);
      return low + (high - low) * unit(state);
    };
    this->blobs.push_back({ .52, .47, .5, .17, 70. }); // the light's
    for (int i = 0; i < 27; ++i)
    {
      const double x = random(.15, .85);
      const double y = random(.15, .85);
      const double z = random(.15, .85);
      const double radius = random(.04, .14);
      this->blobs.push_back({ x, y, z, radius, random(20., 120.) });
    }
    for (int i = 0; i < 9; ++i)
    {
      Tube t;
      t.axis = i % 3;
      t.b = random(.25, .75);
      t.c = random(.25, .75);
      t.swing = random(.03, .12);
      t.turns = random(.5, 2.);
      t.phase = random(0., 6.28);
      t.radius = std::max(random(.008, .03), 1.5 * this->voxel);
      t.value = random(150., 220.);
      for (int j = 0; j < n; ++j)
      {
        t.centre.push_back(t.centreAt((j + 0.5) * this->voxel));
      }
      this->tubes.push_back(t);
    }
  }

  /** 1 inside, 0 outside, over two voxels. */
  double inside(double depth) const { return smooth(0.5 + 0.5 * depth / this->voxel); }

  double value(int i, int j, int k) const
  {
    const int at[3] = { i, j, k };
    const double p[3] = { (i + 0.5) * this->voxel, (j + 0.5) * this->voxel,
      (k + 0.5) * this->voxel };
    const auto mix = [](double& to, double value, double weight) { to += weight * (value - to); };
    double s = 0.;
    const double body[3] = { (p[0] - .5) / .47, (p[1] - .5) / .44, (p[2] - .5) / .48 };
    const double r = std::sqrt(body[0] * body[0] + body[1] * body[1] + body[2] * body[2]);
    mix(s, 45., this->inside((1. - r) * .46));
    for (auto b = this->blobs.rbegin(); b != this->blobs.rend(); ++b)
    {
      const double d[3] = { p[0] - b->x, p[1] - b->y, p[2] - b->z };
      const double reach = b->radius + 2. * this->voxel;
      const double dd = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
      if (dd < reach * reach)
      {
        mix(s, b->value, this->inside(b->radius - std::sqrt(dd)));
      }
    }
    for (const Tube& t : this->tubes)
    {
      const std::array<double, 2>& centre = t.centre[static_cast<std::size_t>(at[t.axis])];
      const double u = p[(t.axis + 1) % 3] - centre[0];
      const double v = p[(t.axis + 2) % 3] - centre[1];
      mix(s, t.value, this->inside(t.radius - std::sqrt(u * u + v * v)));
    }
    s += 5. * valueNoise(24. * p[0], 24. * p[1], 24. * p[2], 1) +
      3. * valueNoise(60. * p[0], 60. * p[1], 60. * p[2], 2);
    return s + 30. * (unit(hash(i, j, k, 3)) - 0.5);
  }
};
} // namespace

DiffusionMedium<float> Problem::medium() const
{
  DiffusionMedium<float> m;
  m.grid = this->grid;
  m.D = this->D.data();
  m.sigma_a = this->sigma_a.data();
  m.boundary = this->boundary;
  return m;
}

std::vector<float> MakeVolume(int n, const ParallelFor& parallelFor)
{
  std::vector<float> S(
    static_cast<std::size_t>(n) * static_cast<std::size_t>(n) * static_cast<std::size_t>(n));
  const Scene scene(n);
  parallelFor(static_cast<std::int64_t>(n) * n,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        for (int i = 0; i < n; ++i)
        {
          S[static_cast<std::size_t>(r * n + i)] =
            static_cast<float>(scene.value(i, static_cast<int>(r % n), static_cast<int>(r / n)));
        }
      }
    });
  return S;
}

Problem MakeProblem(
  int n, const std::vector<float>& S, const MediumRecipe& recipe, const ParallelFor& parallelFor)
{
  Problem p;
  p.grid.dims = { { n, n, n } };
  const std::int64_t size = p.grid.size();
  const std::size_t count = static_cast<std::size_t>(size);
  p.q.assign(count, 0.f);
  if (recipe.contrast == 0.)
  {
    p.name = "constant";
    p.constant = true;
    p.boundary = Boundary::Absorbing;
    p.D.assign(count, 1.f);
    p.sigma_a.assign(count, 0.f);
    p.seed = p.grid.index(n / 2, n / 2, n / 2);
    p.q[static_cast<std::size_t>(p.seed)] = 1.f;
    return p;
  }
  char text[80];
  std::snprintf(text, sizeof text, "contrast 1e%ld, albedo %g",
    std::lround(std::log10(recipe.contrast)), recipe.albedo);
  p.name = text;

  const ValueReader read = [&S](std::int64_t begin, std::int64_t m, double* values)
  { std::copy(S.begin() + begin, S.begin() + begin + m, values); };
  p.D.resize(count);
  p.sigma_a.resize(count);
  MediumParameters parameters;
  parameters.gradientScale = 6.;
  parameters.derivativeScale = 1.;
  parameters.betaFloor = 1. / recipe.contrast;
  parameters.absorption = AbsorptionRule::Albedo;
  parameters.albedo = recipe.albedo;
  ComputeMedium(p.grid, read, FindValueRange(size, read, parallelFor), ValueReader(), parameters,
    p.D.data(), p.sigma_a.data(), parallelFor, ProgressFunction());

  // Open tissue: the voxel near the middle whose neighbourhood diffuses best.
  double best = -1.;
  const int low = static_cast<int>(.3 * n);
  const int high = static_cast<int>(.7 * n);
  for (int k = low; k <= high; ++k)
  {
    for (int j = low; j <= high; ++j)
    {
      for (int i = low; i <= high; ++i)
      {
        float worst = 2.f;
        for (int c = 0; c < 27; ++c)
        {
          worst = std::min(worst,
            p.D[static_cast<std::size_t>(
              p.grid.index(i + c % 3 - 1, j + c / 3 % 3 - 1, k + c / 9 - 1))]);
        }
        if (static_cast<double>(worst) > best)
        {
          best = static_cast<double>(worst);
          p.seed = p.grid.index(i, j, k);
        }
      }
    }
  }
  p.q[static_cast<std::size_t>(p.seed)] = 1.f;
  return p;
}

double Residual(
  const Problem& problem, const double* phi, double* out, const ParallelFor& parallelFor)
{
  const std::array<int, 3>& n = problem.grid.dims;
  const std::int64_t rows = static_cast<std::int64_t>(n[1]) * n[2];
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  std::vector<double> rr(static_cast<std::size_t>(rows));
  std::vector<double> qq(static_cast<std::size_t>(rows));
  parallelFor(rows,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t row = begin; row < end; ++row)
      {
        int at[3] = { 0, static_cast<int>(row % n[1]), static_cast<int>(row / n[1]) };
        double sumR = 0.;
        double sumQ = 0.;
        for (at[0] = 0; at[0] < n[0]; ++at[0])
        {
          const std::int64_t c = row * n[0] + at[0];
          const double D = static_cast<double>(problem.D[static_cast<std::size_t>(c)]);
          const double q = static_cast<double>(problem.q[static_cast<std::size_t>(c)]);
          double r = q - static_cast<double>(problem.sigma_a[static_cast<std::size_t>(c)]) * phi[c];
          for (int d = 0; d < 3; ++d)
          {
            for (int side = -1; side <= 1; side += 2)
            {
              const int next = at[d] + side;
              if (next >= 0 && next < n[d])
              {
                const std::int64_t o = c + side * stride[d];
                r +=
                  FaceConductance(D, static_cast<double>(problem.D[static_cast<std::size_t>(o)])) *
                  (phi[o] - phi[c]);
              }
              else
              {
                r -= BorderSink(D, problem.boundary) * phi[c];
              }
            }
          }
          if (out)
          {
            out[c] = r;
          }
          sumR += r * r;
          sumQ += q * q;
        }
        rr[static_cast<std::size_t>(row)] = sumR;
        qq[static_cast<std::size_t>(row)] = sumQ;
      }
    });
  double sumR = 0.;
  double sumQ = 0.;
  for (std::size_t i = 0; i < rr.size(); ++i)
  {
    sumR += rr[i];
    sumQ += qq[i];
  }
  return std::sqrt(sumR / sumQ);
}

std::vector<double> ReferenceSolution(
  const Problem& problem, double& residual, const ParallelFor& parallelFor)
{
  const std::size_t count = problem.q.size();
  std::vector<double> phi(count, 0.);
  std::vector<double> r(count);
  std::vector<double> correction(count);
  std::vector<double> best;
  DiffusionSolver solver(parallelFor);
  DiffusionMedium<float> medium = problem.medium();
  const std::vector<std::uint8_t> nothing(problem.constant ? count : 0, 0);
  medium.outside = problem.constant ? nothing.data() : nullptr; // by iterations, constant or not
  solver.setMedium(medium);
  residual = Residual(problem, phi.data(), r.data(), parallelFor);
  for (int i = 0; i < 10 && residual > 1e-12; ++i)
  {
    std::fill(correction.begin(), correction.end(), 0.);
    DiffusionControl control;
    control.tolerance = 1e-6;
    solver.solveSteady(r.data(), correction.data(), control);
    best = phi;
    for (std::size_t c = 0; c < count; ++c)
    {
      phi[c] += correction[c];
    }
    const double now = Residual(problem, phi.data(), r.data(), parallelFor);
    if (!(now < residual))
    {
      return best;
    }
    residual = now;
  }
  return phi;
}

Errors FindErrors(const double* phi, const std::vector<double>& reference)
{
  double most = 0.;
  double ee = 0.;
  double pp = 0.;
  for (std::size_t i = 0; i < reference.size(); ++i)
  {
    most = std::max(most, std::abs(reference[i]));
    const double e = phi[i] - reference[i];
    ee += e * e;
    pp += reference[i] * reference[i];
  }
  std::vector<double> relative;
  for (std::size_t i = 0; i < reference.size(); ++i)
  {
    if (std::abs(reference[i]) >= 1e-6 * most)
    {
      relative.push_back(std::abs(phi[i] - reference[i]) / std::abs(reference[i]));
    }
  }
  Errors errors;
  errors.relativeL2 = std::sqrt(ee / pp);
  const std::size_t at = (relative.size() * 95) / 100;
  std::nth_element(
    relative.begin(), relative.begin() + static_cast<std::ptrdiff_t>(at), relative.end());
  errors.p95 = relative[at];
  return errors;
}
} // namespace benchmark
} // namespace lighttransport
