// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Media that a geometric coarse grid does not see, because a coarse voxel joins what is not
 * connected: the aggregation takes over there. Iterations are bounded, answers are compared with a
 * direct solver's.
 */
#include "Core/Aggregation.h"
#include "Core/Diffusion.h"
#include "HardMedia.h"
#include "LightTransportTesting.h"
#include "ThreadedFor.h"

#include <fstream>
#include <limits>
#include <random>

#if defined(__linux__)
#include <sys/resource.h>
#include <unistd.h>
#endif

using namespace lighttransport;
using lighttransport::testing::DiffusionScene;
using lighttransport::testing::MediumAndSource;
using lighttransport::testing::Suite;

namespace
{
struct Hard
{
  std::string name;
  DiffusionScene scene;

  Hard(const std::string& what, const MediumAndSource<double>& medium)
    : name(what)
    , scene(medium)
  {
  }
  Hard(const std::string& what, std::array<int, 3> dims, std::array<double, 3> spacing)
    : Hard(what, MediumAndSource<double>(dims, spacing))
  {
  }
};

/**
 * The steady state by Cholesky's factorisation of the band, in double: voxels in the order of the
 * axes, the shortest first. Zero flux or Robin with equal indices; walls fixed to 0.
 */
std::vector<double> direct(const DiffusionScene& scene)
{
  const std::array<int, 3>& n = scene.grid.dims;
  std::array<int, 3> order{ { 0, 1, 2 } };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return n[a] < n[b]; });
  std::size_t step[3];
  step[order[0]] = 1;
  step[order[1]] = static_cast<std::size_t>(n[order[0]]);
  step[order[2]] = step[order[1]] * static_cast<std::size_t>(n[order[1]]);
  const std::size_t band = step[order[2]];
  const std::size_t size = scene.q.size();
  const std::size_t width = band + 1;
  std::vector<double> L(size * width, 0.); // L[i * width + band + j - i], j <= i
  std::vector<double> x(size);
  std::vector<std::size_t> numberOf(size);
  const auto D = [&](std::size_t v) { return scene.conducts(v); };
  for (int k = 0; k < n[2]; ++k)
  {
    for (int j = 0; j < n[1]; ++j)
    {
      for (int i = 0; i < n[0]; ++i)
      {
        const int at[3] = { i, j, k };
        const std::size_t v = scene.index(i, j, k);
        const std::size_t stride[3] = { 1, static_cast<std::size_t>(n[0]),
          static_cast<std::size_t>(n[0]) * static_cast<std::size_t>(n[1]) };
        std::size_t row = 0;
        for (int d = 0; d < 3; ++d)
        {
          row += step[d] * static_cast<std::size_t>(at[d]);
        }
        numberOf[v] = row;
        x[row] = scene.q[v];
        double* own = L.data() + row * width + band;
        *own += D(v) > 0. ? scene.sigma_a[v] : 1.;
        for (int d = 0; d < 3; ++d)
        {
          const double h = scene.grid.spacing[static_cast<std::size_t>(d)];
          if (n[d] == 1)
          {
            continue;
          }
          for (int side = -1; side <= 1; side += 2)
          {
            if (at[d] + side >= 0 && at[d] + side < n[d])
            {
              const double other = D(side < 0 ? v - stride[d] : v + stride[d]);
              const double g =
                D(v) > 0. && other > 0. ? 2. * D(v) * (other / (D(v) + other)) / (h * h) : 0.;
              *own += g;
              if (side < 0)
              {
                own[-static_cast<std::ptrdiff_t>(step[d])] -= g;
              }
            }
            else if (scene.boundary == Boundary::Robin)
            {
              *own += D(v) / (0.5 * h + 2. * D(v)) / h;
            }
          }
        }
      }
    }
  }
  for (std::size_t i = 0; i < size; ++i)
  {
    double* row = L.data() + i * width;
    const std::size_t first = i > band ? i - band : 0;
    for (std::size_t j = first; j <= i; ++j)
    {
      const double* other = L.data() + j * width;
      double sum = row[band + j - i];
      for (std::size_t k = std::max(first, j > band ? j - band : 0); k < j; ++k)
      {
        sum -= row[band + k - i] * other[band + k - j];
      }
      row[band + j - i] = i == j ? std::sqrt(sum) : sum / other[band];
      x[i] -= i == j ? 0. : row[band + j - i] * x[j];
    }
    x[i] /= row[band];
  }
  for (std::size_t i = size; i-- > 0;)
  {
    const double* row = L.data() + i * width;
    x[i] /= row[band];
    for (std::size_t j = i > band ? i - band : 0; j < i; ++j)
    {
      x[j] -= row[band + j - i] * x[i];
    }
  }
  std::vector<double> phi(size);
  for (std::size_t v = 0; v < size; ++v)
  {
    phi[v] = x[numberOf[v]];
  }
  return phi;
}

Hard winding(int n, double wall)
{
  return { "winding corridor, walls " + std::to_string(wall),
    lighttransport::testing::WindingCorridor(n, wall) };
}

/** Rooms of one voxel, doors between them here and there. */
Hard rooms(int nx, int ny, int nz, double wall, double sigma, unsigned int seed)
{
  Hard hard("rooms, walls " + std::to_string(wall), { { nx, ny, nz } }, { { 1., 1., 1. } });
  std::mt19937 random(seed);
  hard.scene.fill(hard.scene.D,
    [&](double x, double y, double z)
    {
      const int walls = static_cast<int>(x) % 2 + static_cast<int>(y) % 2 + static_cast<int>(z) % 2;
      const bool door = random() % 2 == 0;
      return walls == 0 || (walls == 1 && door) ? 1. : wall;
    });
  for (std::size_t i = 0; i < hard.scene.q.size(); ++i)
  {
    hard.scene.sigma_a[i] = sigma + (hard.scene.D[i] < 1. ? 0.1 : 0.);
  }
  hard.scene.q[hard.scene.index(nx / 4 * 2, ny / 4 * 2, nz / 4 * 2)] = 1.;
  return hard;
}

Hard layers(unsigned int seed, int n)
{
  return { "layers " + std::to_string(seed), lighttransport::testing::Layers<double>(seed, n, 6.) };
}

/** Threads that cross each other diagonally: no straight line leads along them. */
Hard threads(double contrast, std::array<double, 3> spacing)
{
  Hard hard("threads 1e" + std::to_string(static_cast<int>(std::log10(contrast))) + ", spacing 1 " +
      std::to_string(spacing[1] / spacing[0]) + " " + std::to_string(spacing[2] / spacing[0]),
    { { 9, 9, 40 } }, spacing);
  std::size_t v = 0;
  for (int k = 0; k < 40; ++k)
  {
    for (int j = 0; j < 9; ++j)
    {
      for (int i = 0; i < 9; ++i, ++v)
      {
        const int along = i + j + k;
        const bool open = (i - j + 12) % 4 < 2 && (along / 2 % 4 == 0 || (j - k + 40) % 5 == 0);
        hard.scene.D[v] = open ? 1. : contrast;
        hard.scene.sigma_a[v] = open ? 1e-6 : 0.;
      }
    }
  }
  hard.scene.q[hard.scene.index(4, 4, 20)] = 1.;
  return hard;
}

void expectRight(Suite& suite, Hard& hard, int iterations)
{
  const DiffusionReport report = hard.scene.solve(1e-9);
  const std::vector<double> exact = direct(hard.scene);
  double most = 0.;
  double least = 0.;
  double error = 0.;
  double norm = 0.;
  for (std::size_t i = 0; i < exact.size(); ++i)
  {
    const double phi = hard.scene.phi[i];
    most = std::max(most, phi);
    least = std::min(least, phi);
    error += (phi - exact[i]) * (phi - exact[i]);
    norm += exact[i] * exact[i];
  }
  std::cout << hard.name << ": " << ToString(report.reason) << ", " << report.iterations
            << " iterations, error " << std::sqrt(error / norm) << ", min/max " << least / most
            << "\n";
  suite.check(report.reason == StopReason::Converged, hard.name + " converges", __FILE__, __LINE__);
  suite.check(report.iterations <= iterations, hard.name + ": iterations", __FILE__, __LINE__);
  suite.check(std::sqrt(error / norm) < 1e-5, hard.name + " is right", __FILE__, __LINE__);
  suite.check(-least <= 1e-7 * most, hard.name + ": positive", __FILE__, __LINE__);
}

void right(Suite& suite)
{
  for (const double wall : { 1e-2, 1e-4, 1e-6, 0. })
  {
    Hard hard = winding(33, wall);
    expectRight(suite, hard, 40);
  }
  for (const double wall : { 1e-4, 1e-8 })
  {
    Hard hard = rooms(9, 11, 60, wall, 1e-4, 3);
    expectRight(suite, hard, 40);
  }
  for (unsigned int seed = 0; seed < 6; ++seed)
  {
    Hard hard = layers(seed, 11);
    expectRight(suite, hard, 40);
  }
  for (const double contrast : { 1e-2, 1e-5, 1e-8 })
  {
    for (const std::array<double, 3>& spacing :
      { std::array<double, 3>{ { 1., 1., 1. } }, std::array<double, 3>{ { 1., 1., 1000. } },
        std::array<double, 3>{ { 1e-3, 1., 1e-3 } } })
    {
      Hard hard = threads(contrast, spacing);
      expectRight(suite, hard, 40);
    }
  }
}

/** Many layered media, to a high accuracy: all are solved. */
void layered(Suite& suite)
{
  int most = 0;
  const int runs = lighttransport::testing::LookingForRaces ? 10 : 60;
  for (int run = 0; run < runs; ++run)
  {
    Hard hard = layers(static_cast<unsigned int>(run), 16 + run % 12);
    const DiffusionReport report = hard.scene.solve(1e-8);
    suite.check(report.reason == StopReason::Converged, hard.name, __FILE__, __LINE__);
    most = std::max(most, report.iterations);
  }
  std::cout << runs << " layered media: at most " << most << " iterations\n";
  LT_CHECK(suite, most <= 60);
}

DiffusionOperator poisson(int n)
{
  DiffusionOperator A;
  A.allocate({ { n, n, n } });
  for (std::int64_t i = 0; i < A.size(); ++i)
  {
    A.g[0][i] = i % n + 1 < n ? 1.f : 0.f;
    A.g[1][i] = i / n % n + 1 < n ? 1.f : 0.f;
    A.g[2][i] = i / n / n + 1 < n ? 1.f : 0.f;
    A.s[i] = 1e-3f;
  }
  return A;
}

/** The cycle alone: repeated, it solves; and the same whatever the threads. */
void cycles(Suite& suite)
{
  const DiffusionOperator A = poisson(40);
  const std::int64_t size = A.size();
  const ParallelFor three = lighttransport::testing::ThreadedFor(3);
  std::vector<std::vector<float>> answers;
  for (const ParallelFor& loop : { ParallelFor(SerialFor), three })
  {
    Aggregation aggregation;
    LT_CHECK(suite, !aggregation.setup(A, 1000, loop) && aggregation.empty());
    LT_CHECK(suite, aggregation.setup(A, 40 * size, loop));
    LT_CHECK(suite, aggregation.numberOfLevels() >= 3);
    LT_CHECK(suite, aggregation.bytes() > 4 * size && aggregation.bytes() < 40 * size);
    Buffer<float> r(size), z(size), Az(size), x(size);
    for (std::int64_t i = 0; i < size; ++i)
    {
      r[i] = static_cast<float>(i % 7) - 3.f;
    }
    const auto norm = [&]
    {
      double sum = 0.;
      for (std::int64_t i = 0; i < size; ++i)
      {
        sum += static_cast<double>(r[i]) * static_cast<double>(r[i]);
      }
      return std::sqrt(sum);
    };
    const double before = norm();
    for (int i = 0; i < 10; ++i)
    {
      std::int64_t told = 0;
      aggregation.cycle(
        A, r.data(), z.data(), SerialFor, [&](std::int64_t, std::int64_t, int n) { told += n; });
      LT_CHECK(suite, told == size);
      Apply(A, z.data(), Az.data(), SerialFor);
      for (std::int64_t v = 0; v < size; ++v)
      {
        x[v] += z[v];
        r[v] -= Az[v];
      }
    }
    std::cout << "ten cycles leave " << norm() / before << "\n";
    LT_CHECK(suite, norm() < 1e-3 * before);
    answers.emplace_back(x.data(), x.data() + size);
  }
  LT_CHECK(suite, answers[0] == answers[1]);
}

void whatTheThreads(Suite& suite)
{
  Hard one = rooms(40, 41, 42, 1e-6, 1e-4, 5);
  Hard three = one;
  const DiffusionReport a = one.scene.solve(1e-8);
  const DiffusionReport b = three.scene.solve(1e-8, lighttransport::testing::ThreadedFor(3));
  LT_CHECK(suite, a.reason == StopReason::Converged && b.reason == StopReason::Converged);
  LT_CHECK(suite, a.iterations == b.iterations && a.iterations < 60);
  LT_CHECK(suite, one.scene.phi == three.scene.phi);
  const double perVoxel = static_cast<double>(a.bytes) / static_cast<double>(one.scene.q.size());
  std::cout << "rooms: " << a.iterations << " iterations, " << perVoxel << " bytes per voxel\n";
  LT_CHECK(suite, perVoxel > 50.); // it was used
}

/** A winding corridor in an active region, which is a part of the box. */
void region(Suite& suite)
{
  const Hard maze = winding(33, 1e-6);
  Hard hard("region", { { 100, 90, 80 } }, { { 1., 1., 1. } });
  hard.scene.D.assign(hard.scene.q.size(), 1e-6);
  hard.scene.sigma_a.assign(hard.scene.q.size(), 0.1);
  for (int k = 0; k < 3; ++k)
  {
    for (int j = 0; j < 33; ++j)
    {
      for (int i = 0; i < 33; ++i)
      {
        const std::size_t from = maze.scene.index(i, j, k);
        const std::size_t to = hard.scene.index(i + 30, j + 20, k + 40);
        hard.scene.D[to] = maze.scene.D[from];
        hard.scene.sigma_a[to] = maze.scene.D[from] < 1. ? 0.1 : 1e-4;
        hard.scene.q[to] = maze.scene.q[from];
      }
    }
  }
  DiffusionSolver solver;
  DiffusionControl control;
  control.tolerance = 1e-8;
  const DiffusionReport report =
    solver.solveActive(hard.scene.medium(), hard.scene.q.data(), hard.scene.phi.data(), control);
  std::cout << "region: " << report.iterations << " iterations, " << report.activeFraction
            << " of the voxels\n";
  LT_CHECK(suite, report.reason == StopReason::Converged);
  LT_CHECK(suite, report.activeFraction < 0.25 && report.iterations < 100);
  Hard whole = hard;
  whole.scene.phi.assign(whole.scene.phi.size(), 0.);
  LT_CHECK(suite, whole.scene.solve(1e-10).reason == StopReason::Converged);
  double error = 0.;
  double norm = 0.;
  for (std::size_t i = 0; i < whole.scene.phi.size(); ++i)
  {
    const double difference = hard.scene.phi[i] - whole.scene.phi[i];
    error += difference * difference;
    norm += whole.scene.phi[i] * whole.scene.phi[i];
  }
  LT_CHECK_NEAR(suite, std::sqrt(error / norm), 0., 1e-5);
}

/** What is easy pays nothing. */
void easy(Suite& suite)
{
  Hard hard("easy", { { 40, 40, 40 } }, { { 1., 1., 1. } });
  hard.scene.fill(hard.scene.D,
    [](double x, double y, double z) {
      return std::pow(10., -2. + 2. * std::sin(0.3 * x) * std::sin(0.2 * y) * std::cos(0.25 * z));
    });
  hard.scene.sigma_a.assign(hard.scene.q.size(), 1e-3);
  hard.scene.q[32020] = 1.;
  const DiffusionReport report = hard.scene.solve(1e-8);
  LT_CHECK(suite, report.reason == StopReason::Converged && report.iterations < 16);
  LT_CHECK(suite, report.bytes < 48 * static_cast<std::int64_t>(hard.scene.q.size()));
}

/** Stopped at any call, also amid the set-up: the field is a whole, and it goes on from there. */
void cancelled(Suite& suite)
{
  Hard hard = rooms(64, 56, 48, 1e-6, 1e-4, 5);
  DiffusionSolver solver;
  LT_CHECK(suite, solver.setMedium(hard.scene.medium()).reason == StopReason::Converged);
  DiffusionControl control;
  control.tolerance = 1e-6;
  int calls = 0;
  control.progress = [&](double)
  {
    ++calls;
    return true;
  };
  std::vector<double> phi(hard.scene.q.size(), 0.);
  DiffusionReport report = solver.solveSteady(hard.scene.q.data(), phi.data(), control);
  LT_CHECK(suite, report.reason == StopReason::Converged);
  const int all = calls;
  for (int stop = 4; stop < all; stop += std::max(1, all / 8))
  {
    solver.setMedium(hard.scene.medium());
    calls = 0;
    control.progress = [&](double) { return ++calls < stop; };
    phi.assign(phi.size(), 0.);
    report = solver.solveSteady(hard.scene.q.data(), phi.data(), control);
    // (calls depend on the clock)
    LT_CHECK(suite, report.reason == StopReason::Cancelled || calls < stop);
    bool finite = true;
    for (const double value : phi)
    {
      finite = finite && std::isfinite(value);
    }
    LT_CHECK(suite, finite);
    control.progress = nullptr;
    report = solver.solveSteady(hard.scene.q.data(), phi.data(), control);
    LT_CHECK(suite, report.reason == StopReason::Converged);
  }
}

#if defined(__linux__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
/** No memory for the second hierarchy: the first one goes on alone. */
void refused(Suite& suite)
{
  Hard hard = rooms(80, 81, 82, 1e-4, 1e-3, 5);
  DiffusionSolver solver;
  LT_CHECK(suite, solver.setMedium(hard.scene.medium()).reason == StopReason::Converged);
  DiffusionControl control;
  rlimit before;
  getrlimit(RLIMIT_AS, &before);
  int calls = 0;
  control.intermediateInterval = 0.;
  control.intermediate = [&](const double*) // the first hierarchy is there
  {
    if (++calls == 2)
    {
      long pages = 0;
      std::ifstream("/proc/self/statm") >> pages;
      rlimit limit = before;
      limit.rlim_cur = static_cast<rlim_t>(pages * sysconf(_SC_PAGESIZE)) + (1 << 20);
      setrlimit(RLIMIT_AS, &limit);
    }
  };
  const DiffusionReport report =
    solver.solveSteady(hard.scene.q.data(), hard.scene.phi.data(), control);
  setrlimit(RLIMIT_AS, &before);
  std::cout << "refused: " << ToString(report.reason) << ", " << report.iterations
            << " iterations\n";
  LT_CHECK(suite, report.reason == StopReason::Converged);
  LT_CHECK(suite, report.bytes < 50 * static_cast<std::int64_t>(hard.scene.q.size()));
  hard.scene.phi.assign(hard.scene.phi.size(), 0.);
  const DiffusionReport again = hard.scene.solve(control.tolerance);
  LT_CHECK(suite, again.iterations < report.iterations);
}
#else
void refused(Suite&) {}
#endif
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  refused(suite); // first: what others have freed could be had again
  right(suite);
  layered(suite);
  cycles(suite);
  whatTheThreads(suite);
  region(suite);
  easy(suite);
  cancelled(suite);
  return suite.result();
}
