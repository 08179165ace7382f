// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef LightTransport_Core_Stall_h
#define LightTransport_Core_Stall_h

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace lighttransport
{
/** Tells from the last iterations how many are left. */
class Stall
{
public:
  /** Before an iteration: by which factor (> 1) its field misses what is asked for. */
  void add(double factor) { this->logs.push_back(std::log(factor)); }

  /** At the pace of the last iterations; 0 until there are as many. */
  double iterationsLeft() const
  {
    const std::size_t n = this->logs.size();
    if (n <= Window)
    {
      return 0.;
    }
    const double gained = this->logs[n - 1 - Window] - this->logs[n - 1];
    return gained > 0. ? Window * this->logs[n - 1] / gained
                       : std::numeric_limits<double>::infinity();
  }

private:
  static constexpr std::size_t Window = 8;
  std::vector<double> logs;
};
} // namespace lighttransport

#endif
