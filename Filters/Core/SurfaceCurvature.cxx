// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/SurfaceCurvature.h"

#include "Core/Cholesky.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace lighttransport
{
namespace
{
constexpr int ProgressSteps = 16;
constexpr int MaximumNeighbours = 512;
constexpr int TableSize = 2048; // a power of two, several times the neighbours
constexpr int NeighboursForCubic = 14;
constexpr int NeighboursForQuadratic = 6;
constexpr double Rim = 1.2;         // where weights vanish, of the farthest neighbour
constexpr double Ridge = 1e-9;      // keeps a degenerate fit solvable
constexpr double CubicRidge = 1e-5; // a preference for no cubic terms where they are loose
constexpr double MostFloat = 3e38;

using Vector = std::array<double, 3>;

Vector Cross(const Vector& a, const Vector& b)
{
  return { { a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0] } };
}
double Dot(const Vector& a, const Vector& b)
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vector Minus(const Vector& a, const Vector& b)
{
  return { { a[0] - b[0], a[1] - b[1], a[2] - b[2] } };
}
/** Does nothing to a vector of length 0. */
void Normalize(Vector& v)
{
  const double most = std::max({ std::abs(v[0]), std::abs(v[1]), std::abs(v[2]) });
  if (most > 0.)
  {
    for (double& x : v)
    {
      x /= most;
    }
    const double length = std::sqrt(Dot(v, v));
    for (double& x : v)
    {
      x /= length;
    }
  }
}

/** Which polygons a point is in, and the normals of the points. */
struct Surroundings
{
  const SurfaceMesh& mesh;
  double unit = 1.; ///< the mesh's size: lengths are divided by it
  std::vector<char> finite;
  std::vector<std::int64_t> first; ///< of a point in `polygons`, and the end
  std::vector<std::int64_t> polygons;
  std::vector<Vector> normals; ///< unit length, or 0

  explicit Surroundings(const SurfaceMesh& theMesh)
    : mesh(theMesh)
  {
    const std::int64_t n = mesh.numberOfPoints();
    this->finite.resize(static_cast<std::size_t>(n));
    double low[3] = { 1e300, 1e300, 1e300 };
    double high[3] = { -1e300, -1e300, -1e300 };
    for (std::int64_t i = 0; i < n; ++i)
    {
      const double* p = &mesh.points[3 * i];
      this->finite[i] = std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
      for (int a = 0; this->finite[i] && a < 3; ++a)
      {
        low[a] = std::min(low[a], p[a]);
        high[a] = std::max(high[a], p[a]);
      }
    }
    const double size = std::max(
      { high[0] / 2. - low[0] / 2., high[1] / 2. - low[1] / 2., high[2] / 2. - low[2] / 2. });
    this->unit = size > 0. && size < 1e300 ? size : 1.;

    this->first.assign(static_cast<std::size_t>(n) + 1, 0);
    for (const std::int64_t corner : mesh.corners)
    {
      ++this->first[corner + 1];
    }
    for (std::int64_t i = 0; i < n; ++i)
    {
      this->first[i + 1] += this->first[i];
    }
    this->polygons.resize(mesh.corners.size());
    std::vector<std::int64_t> next(this->first.begin(), this->first.end() - 1);
    for (std::size_t polygon = 0; polygon + 1 < mesh.offsets.size(); ++polygon)
    {
      for (std::int64_t c = mesh.offsets[polygon]; c < mesh.offsets[polygon + 1]; ++c)
      {
        this->polygons[next[mesh.corners[c]]++] = static_cast<std::int64_t>(polygon);
      }
    }
  }

  Vector at(std::int64_t point) const
  {
    const double* p = &this->mesh.points[3 * point];
    return { { p[0] / this->unit, p[1] / this->unit, p[2] / this->unit } };
  }

  /** The sum over corners at the point of e1 x e2 / (|e1|^2 |e2|^2): exact for spheres. */
  Vector normalOf(std::int64_t point) const
  {
    Vector sum{ { 0., 0., 0. } };
    const Vector p = this->at(point);
    for (std::int64_t l = this->first[point]; l < this->first[point + 1]; ++l)
    {
      const std::int64_t begin = this->mesh.offsets[this->polygons[l]];
      const std::int64_t size = this->mesh.offsets[this->polygons[l] + 1] - begin;
      for (std::int64_t c = 0; c < size; ++c)
      {
        const std::int64_t before = this->mesh.corners[begin + (c + size - 1) % size];
        const std::int64_t after = this->mesh.corners[begin + (c + 1) % size];
        if (this->mesh.corners[begin + c] != point || !this->finite[before] || !this->finite[after])
        {
          continue;
        }
        const Vector e1 = Minus(this->at(after), p);
        const Vector e2 = Minus(this->at(before), p);
        const double weight = Dot(e1, e1) * Dot(e2, e2);
        if (weight > 1e-60)
        {
          const Vector cross = Cross(e1, e2);
          for (int a = 0; a < 3; ++a)
          {
            sum[a] += cross[a] / weight;
          }
        }
      }
    }
    Normalize(sum);
    return sum;
  }
};

/** The points around a point, each once. */
class Neighbourhood
{
public:
  std::vector<std::int64_t> points; ///< the point itself first

  void gather(const Surroundings& around, std::int64_t point, double radius)
  {
    std::fill(std::begin(this->table), std::end(this->table), -1);
    this->points.clear();
    this->add(point);
    const Vector p = around.at(point);
    std::size_t begin = 0;
    for (int ring = 1; begin < this->points.size(); ++ring)
    {
      const std::size_t end = this->points.size();
      for (; begin < end; ++begin)
      {
        const std::int64_t from = this->points[begin];
        for (std::int64_t l = around.first[from]; l < around.first[from + 1]; ++l)
        {
          const std::int64_t polygon = around.polygons[l];
          for (std::int64_t c = around.mesh.offsets[polygon]; c < around.mesh.offsets[polygon + 1];
               ++c)
          {
            const std::int64_t corner = around.mesh.corners[c];
            if (!around.finite[corner])
            {
              continue;
            }
            const Vector d = Minus(around.at(corner), p);
            if ((ring <= 2 || Dot(d, d) <= radius * radius) && !this->add(corner))
            {
              return;
            }
          }
        }
      }
      if (ring >= 2 && !(radius > 0.))
      {
        return;
      }
    }
  }

private:
  /** False once it is full. */
  bool add(std::int64_t point)
  {
    std::uint64_t slot = (static_cast<std::uint64_t>(point) * 0x9E3779B97F4A7C15ull) >> 40;
    for (slot &= TableSize - 1; this->table[slot] >= 0; slot = (slot + 1) & (TableSize - 1))
    {
      if (this->table[slot] == point)
      {
        return true;
      }
    }
    this->table[slot] = point;
    this->points.push_back(point);
    return this->points.size() <= MaximumNeighbours;
  }
  std::int64_t table[TableSize];
};

/** Mean and Gaussian curvature, times the unit of length and its square. */
void Fit(
  const Surroundings& around, const Neighbourhood& neighbourhood, double& mean, double& gaussian)
{
  mean = gaussian = 0.;
  const std::int64_t point = neighbourhood.points[0];
  const Vector n = around.normals[point];
  const std::size_t count = neighbourhood.points.size() - 1;
  if (count + 1 < NeighboursForQuadratic || Dot(n, n) == 0.)
  {
    return;
  }
  // Tangents (Duff et al. 2017).
  const double s = std::copysign(1., n[2]);
  const double q = -1. / (s + n[2]);
  const double r = n[0] * n[1] * q;
  const Vector u{ { 1. + s * n[0] * n[0] * q, s * r, -s * n[0] } };
  const Vector v{ { r, s + n[1] * n[1] * q, -n[1] } };

  const Vector p = around.at(point);
  double farthest2 = 0.;
  for (const std::int64_t neighbour : neighbourhood.points)
  {
    const Vector d = Minus(around.at(neighbour), p);
    farthest2 = std::max(farthest2, Dot(d, d));
  }
  if (!(farthest2 > 1e-200))
  {
    return;
  }
  const double size = std::sqrt(farthest2);
  const int terms = count >= NeighboursForCubic ? 10 : 6;
  double A[10][10] = {};
  double b[10] = {};
  double total = 0.;
  for (const std::int64_t neighbour : neighbourhood.points)
  {
    const Vector d = Minus(around.at(neighbour), p);
    const double near = 1. - Dot(d, d) / (Rim * Rim * farthest2);
    const double w =
      near * near * std::max(neighbour == point ? 1. : Dot(n, around.normals[neighbour]), 0.);
    const double x = Dot(d, u) / size;
    const double y = Dot(d, v) / size;
    const double z = Dot(d, n) / size;
    const double basis[10] = { 1., x, y, 0.5 * x * x, x * y, 0.5 * y * y, x * x * x, x * x * y,
      x * y * y, y * y * y };
    for (int i = 0; i < terms; ++i)
    {
      for (int j = 0; j <= i; ++j)
      {
        A[i][j] += w * basis[i] * basis[j];
      }
      b[i] += w * basis[i] * z;
    }
    total += w;
  }
  for (int i = 0; i < terms; ++i)
  {
    A[i][i] += (i < 6 ? Ridge : CubicRidge) * total;
  }
  SolvePositive(terms, A, b);
  const double w2 = 1. + b[1] * b[1] + b[2] * b[2];
  mean = -((1. + b[2] * b[2]) * b[3] - 2. * b[1] * b[2] * b[4] + (1. + b[1] * b[1]) * b[5]) /
    (2. * w2 * std::sqrt(w2)) / size;
  gaussian = (b[3] * b[5] - b[4] * b[4]) / (w2 * w2) / size / size;
}

float ToFloat(double value)
{
  return static_cast<float>(std::min(std::max(value, -MostFloat), MostFloat));
}
} // namespace

//------------------------------------------------------------------------------
bool ComputeSurfaceCurvature(const SurfaceMesh& mesh, double radius, const CurvatureFields& fields,
  const ParallelFor& parallel, const ProgressFunction& progress)
{
  Surroundings around(mesh);
  const std::int64_t n = mesh.numberOfPoints();
  around.normals.resize(static_cast<std::size_t>(n));
  parallel(n,
    [&around](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t i = begin; i < end; ++i)
      {
        around.normals[i] = around.finite[i] ? around.normalOf(i) : Vector{ { 0., 0., 0. } };
      }
    });
  for (int step = 0; step < ProgressSteps; ++step)
  {
    if (progress && !progress(double(step) / ProgressSteps))
    {
      return false;
    }
    const std::int64_t first = n * step / ProgressSteps;
    parallel(n * (step + 1) / ProgressSteps - first,
      [&](std::int64_t begin, std::int64_t end)
      {
        Neighbourhood neighbourhood;
        for (std::int64_t i = first + begin; i < first + end; ++i)
        {
          double mean = 0.;
          double gaussian = 0.;
          if (around.finite[i] && around.first[i] < around.first[i + 1])
          {
            neighbourhood.gather(around, i, radius / around.unit);
            Fit(around, neighbourhood, mean, gaussian);
          }
          const double root = std::sqrt(std::max(mean * mean - gaussian, 0.));
          const double unit = around.unit;
          float* const out[4] = { fields.principal1, fields.principal2, fields.mean,
            fields.gaussian };
          const double values[4] = { (mean + root) / unit, (mean - root) / unit, mean / unit,
            gaussian / unit / unit };
          for (int m = 0; m < 4; ++m)
          {
            if (out[m])
            {
              out[m][i] = ToFloat(values[m]);
            }
          }
        }
      });
  }
  return !progress || progress(1.);
}
} // namespace lighttransport
