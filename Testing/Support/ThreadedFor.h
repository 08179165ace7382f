// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A parallel-for on std::thread, for tests of the kernels without VTK: under
 * ThreadSanitizer each access is seen, which inside TBB (not instrumented) it is
 * not. The ranges are uneven on purpose.
 */
#ifndef ThreadedFor_h
#define ThreadedFor_h

#include "Core/Parallel.h"

#include <thread>
#include <vector>

namespace lighttransport
{
namespace testing
{
/** [0, n) in `threads` ranges of different lengths, each in its own thread. */
inline ParallelFor ThreadedFor(int threads)
{
  return [threads](std::int64_t n, const RangeBody& body)
  {
    // Lengths 1 : 2 : ... : threads.
    const std::int64_t parts = static_cast<std::int64_t>(threads) * (threads + 1) / 2;
    std::vector<std::thread> running;
    std::int64_t begin = 0;
    std::int64_t part = 0;
    for (int t = 1; t <= threads; ++t)
    {
      part += t;
      const std::int64_t end = t == threads ? n : n * part / parts;
      if (begin < end)
      {
        running.emplace_back(body, begin, end);
      }
      begin = end;
    }
    for (std::thread& thread : running)
    {
      thread.join();
    }
  };
}
} // namespace testing
} // namespace lighttransport

#endif
