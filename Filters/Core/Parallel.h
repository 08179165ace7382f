// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Parallel_h
#define LightTransport_Core_Parallel_h

#include <cstdint>
#include <functional>

namespace lighttransport
{
/**
 * How the kernels run in parallel: the caller gives a function that splits
 * [0, n) into disjoint ranges, calls the body on each, and returns when all
 * are done. The kernels' results do not depend on how it splits.
 */
using RangeBody = std::function<void(std::int64_t begin, std::int64_t end)>;
using ParallelFor = std::function<void(std::int64_t n, const RangeBody& body)>;

/** Told the fraction done, in [0, 1], from the calling thread; false means stop. */
using ProgressFunction = std::function<bool(double fraction)>;

/** The whole range in the calling thread. */
inline void SerialFor(std::int64_t n, const RangeBody& body)
{
  if (n > 0)
  {
    body(0, n);
  }
}
} // namespace lighttransport

#endif
