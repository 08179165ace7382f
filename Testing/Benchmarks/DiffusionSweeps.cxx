// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "DiffusionSweeps.h"

#include "Core/Kernel.h"

#include <chrono>
#include <cstring>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace lighttransport
{
namespace benchmark
{
namespace
{
LIGHTTRANSPORT_SIMD
void triad(std::int64_t n, double* LIGHTTRANSPORT_RESTRICT a,
  const double* LIGHTTRANSPORT_RESTRICT b, const double* LIGHTTRANSPORT_RESTRICT c)
{
  for (std::int64_t i = 0; i < n; ++i)
  {
    a[i] = b[i] + 3. * c[i];
  }
}

struct JacobiRow
{
  const float *gx, *gy, *gyS, *gz, *gzB, *inverse, *q;
  const float *x, *xS, *xN, *xB, *xT;
};

/** Reads one value before and after the row, where the faces are 0. */
LIGHTTRANSPORT_SIMD
void jacobi(int n, const JacobiRow& row, float* LIGHTTRANSPORT_RESTRICT out)
{
  const float *gx = row.gx, *gy = row.gy, *gyS = row.gyS, *gz = row.gz, *gzB = row.gzB;
  const float *inverse = row.inverse, *q = row.q;
  const float *x = row.x, *xS = row.xS, *xN = row.xN, *xB = row.xB, *xT = row.xT;
  for (int i = 0; i < n; ++i)
  {
    out[i] = inverse[i] *
      (q[i] + gy[i] * xN[i] + gyS[i] * xS[i] + gz[i] * xT[i] + gzB[i] * xB[i] + gx[i] * x[i + 1] +
        gx[i - 1] * x[i - 1]);
  }
}
} // namespace

Triad::Triad(std::int64_t n, const ParallelFor& parallelFor)
  : a(static_cast<std::size_t>(n), 1.)
  , b(static_cast<std::size_t>(n), 2.)
  , c(static_cast<std::size_t>(n), 0.5)
{
  this->pass(parallelFor);
}

double Triad::pass(const ParallelFor& parallelFor)
{
  constexpr std::int64_t block = 4096;
  const std::int64_t n = static_cast<std::int64_t>(this->a.size());
  const auto began = std::chrono::steady_clock::now();
  parallelFor((n + block - 1) / block,
    [&](std::int64_t begin, std::int64_t end)
    {
      const std::int64_t first = begin * block;
      triad(std::min(end * block, n) - first, this->a.data() + first, this->b.data() + first,
        this->c.data() + first);
    });
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
}

Jacobi::Jacobi(const Problem& p, const ParallelFor& parallelFor)
  : problem(p)
  , inverse(p.grid.size())
  , from(p.grid.size())
  , to(p.grid.size())
  , zeros(p.grid.dims[0])
{
  const std::array<int, 3>& n = p.grid.dims;
  const std::int64_t stride[3] = { 1, n[0], static_cast<std::int64_t>(n[0]) * n[1] };
  for (Buffer<float>& faces : this->g)
  {
    faces.allocate(p.grid.size());
  }
  parallelFor(static_cast<std::int64_t>(n[1]) * n[2],
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t i = begin * n[0]; i < end * n[0]; ++i)
      {
        const int at[3] = { static_cast<int>(i % n[0]), static_cast<int>(i / n[0] % n[1]),
          static_cast<int>(i / stride[2]) };
        const double D = static_cast<double>(p.D[static_cast<std::size_t>(i)]);
        double diagonal = static_cast<double>(p.sigma_a[static_cast<std::size_t>(i)]);
        for (int d = 0; d < 3; ++d)
        {
          for (int side = -1; side <= 1; side += 2)
          {
            if (at[d] + side < 0 || at[d] + side >= n[d])
            {
              diagonal += BorderSink(D, p.boundary);
              continue;
            }
            const double face = FaceConductance(
              D, static_cast<double>(p.D[static_cast<std::size_t>(i + side * stride[d])]));
            diagonal += face;
            if (side > 0)
            {
              this->g[d][i] = static_cast<float>(face);
            }
          }
        }
        this->inverse[i] = static_cast<float>(1. / diagonal);
      }
    });
}

void Jacobi::sweep(const ParallelFor& parallelFor)
{
  const std::array<int, 3>& n = this->problem.grid.dims;
  const std::int64_t nx = n[0];
  const std::int64_t plane = nx * n[1];
  parallelFor(static_cast<std::int64_t>(n[1]) * n[2],
    [&](std::int64_t begin, std::int64_t end)
    {
      const FlushDenormals flush;
      for (std::int64_t r = begin; r < end; ++r)
      {
        const std::int64_t j = r % n[1];
        const std::int64_t k = r / n[1];
        const std::int64_t o = r * nx;
        const float* x = this->from.data() + o;
        const float* none = this->zeros.data();
        const JacobiRow row{ this->g[0].data() + o, this->g[1].data() + o,
          j > 0 ? this->g[1].data() + o - nx : none, this->g[2].data() + o,
          k > 0 ? this->g[2].data() + o - plane : none, this->inverse.data() + o,
          this->problem.q.data() + o, x, j > 0 ? x - nx : none, j + 1 < n[1] ? x + nx : none,
          k > 0 ? x - plane : none, k + 1 < n[2] ? x + plane : none };
        jacobi(n[0], row, this->to.data() + o);
      }
    });
  std::swap(this->from, this->to);
}

std::pair<double, double> TouchSeconds(
  std::size_t bytes, TouchedPages pages, const ParallelFor& parallelFor)
{
  std::pair<double, double> seconds(-1., -1.);
#if defined(__linux__)
#if !defined(MADV_POPULATE_WRITE)
  constexpr int MADV_POPULATE_WRITE = 23;
#endif
  constexpr std::size_t large = std::size_t(1) << 21;
  auto began = std::chrono::steady_clock::now();
  const auto passed = [&began]()
  {
    const auto now = std::chrono::steady_clock::now();
    const double s = std::chrono::duration<double>(now - began).count();
    began = now;
    return s;
  };
  void* mapped =
    mmap(nullptr, bytes + large, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapped == MAP_FAILED)
  {
    return seconds;
  }
  const std::size_t aside = large - reinterpret_cast<std::uintptr_t>(mapped) % large;
  char* memory = static_cast<char*>(mapped) + aside;
  if ((pages != TouchedPages::Small && madvise(memory, bytes, MADV_HUGEPAGE) != 0) ||
    (pages == TouchedPages::Populated && madvise(memory, bytes, MADV_POPULATE_WRITE) != 0))
  {
    munmap(mapped, bytes + large);
    return seconds;
  }
  const std::int64_t blocks = static_cast<std::int64_t>(bytes / large);
  parallelFor(blocks,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (char* p = memory + begin * std::int64_t(large); p < memory + end * std::int64_t(large);
           p += 4096)
      {
        *p = 1;
      }
    });
  seconds.first = passed();
  parallelFor(blocks,
    [&](std::int64_t begin, std::int64_t end)
    {
      std::memset(
        memory + begin * std::int64_t(large), 1, static_cast<std::size_t>(end - begin) * large);
    });
  seconds.second = passed();
  munmap(mapped, bytes + large);
#else
  (void)bytes, (void)pages, (void)parallelFor;
#endif
  return seconds;
}
} // namespace benchmark
} // namespace lighttransport
