// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * What the kernels' sources share: run-time choice of instruction set, denormals,
 * running over the rows of a box.
 */
#ifndef LightTransport_Core_Kernel_h
#define LightTransport_Core_Kernel_h

#include "Core/Parallel.h"

#include <vector>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define LIGHTTRANSPORT_SANITIZED 1
#endif

// One build runs on any x86-64 and uses AVX2 or AVX-512 where the machine has it:
// the loader picks the clone. Its resolvers run before a sanitizer is ready.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__linux__) &&       \
  !defined(LIGHTTRANSPORT_SANITIZED)
#define LIGHTTRANSPORT_SIMD                                                                        \
  __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define LIGHTTRANSPORT_SIMD
#endif

// INLINE: for what a clone calls. Left alone it would be the default one's code.
#if defined(__GNUC__) || defined(__clang__)
#define LIGHTTRANSPORT_RESTRICT __restrict__
#define LIGHTTRANSPORT_INLINE inline __attribute__((always_inline))
#else
#define LIGHTTRANSPORT_RESTRICT
#define LIGHTTRANSPORT_INLINE inline
#endif

namespace lighttransport
{
/**
 * Treats denormals as zero while it lives. Light decays exponentially, and a
 * denormal costs a hundred times the arithmetic of a number.
 */
class FlushDenormals
{
public:
#if defined(__SSE2__)
  FlushDenormals()
    : state(_mm_getcsr())
  {
    _mm_setcsr(this->state | 0x8040u); // flush to zero, denormals are zero
  }
  ~FlushDenormals()
  {
    _mm_setcsr(this->state);
  }
#else
  FlushDenormals() = default;
#endif
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

private:
#if defined(__SSE2__)
  unsigned int state;
#endif
};

/** Below this many values a loop is not worth a thread. */
constexpr std::int64_t ParallelGrain = 8192;

/** body(begin, end) over [0, rows) of rows that hold `values` values in all. */
inline void ForRows(
  const ParallelFor& parallelFor, std::int64_t rows, std::int64_t values, const RangeBody& body)
{
  const auto flushed = [&body](std::int64_t begin, std::int64_t end)
  {
    const FlushDenormals flush;
    body(begin, end);
  };
  if (values < ParallelGrain)
  {
    SerialFor(rows, flushed);
  }
  else
  {
    parallelFor(rows, flushed);
  }
}

/** The sum of what row(r) returns, in an order that threads do not change. */
template <class Row>
double SumRows(
  const ParallelFor& parallelFor, std::int64_t rows, std::int64_t values, const Row& row)
{
  std::vector<double> partial(static_cast<std::size_t>(rows));
  ForRows(parallelFor, rows, values,
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t r = begin; r < end; ++r)
      {
        partial[static_cast<std::size_t>(r)] = row(r);
      }
    });
  double sum = 0.;
  for (const double p : partial)
  {
    sum += p;
  }
  return sum;
}
} // namespace lighttransport

#endif
