// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** What not to do, to compare with: the first-moment system with phi and E on the same points. */
#ifndef CollocatedMoments_h
#define CollocatedMoments_h

#include <cstddef>
#include <vector>

namespace lighttransport
{
namespace testing
{
/**
 * Murray 2018, eq. 3.25 (with sigma_a phi, as it must be) and 3.26: forward in time, centred in
 * space, on n by n points one length apart, dark beyond; r = c dt. Differences span two points,
 * so that odd and even ones hardly know of each other.
 */
struct CollocatedMoments
{
  int n;
  std::vector<double> phi, Ex, Ey;

  explicit CollocatedMoments(int size)
    : n(size)
    , phi(static_cast<std::size_t>(size * size), 0.)
    , Ex(phi)
    , Ey(phi)
  {
  }
  std::size_t index(int i, int j) const
  {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(this->n) +
      static_cast<std::size_t>(i);
  }
  void step(const std::vector<double>& q, double sigma_a, double sigma_t, double r)
  {
    const std::vector<double> p = this->phi;
    const std::vector<double> ex = this->Ex;
    const std::vector<double> ey = this->Ey;
    const auto at = [&](const std::vector<double>& v, int i, int j)
    { return i < 0 || j < 0 || i >= this->n || j >= this->n ? 0. : v[this->index(i, j)]; };
    for (int j = 0; j < this->n; ++j)
    {
      for (int i = 0; i < this->n; ++i)
      {
        const std::size_t c = this->index(i, j);
        this->phi[c] = r * q[c] + (1. - sigma_a * r) * p[c] -
          0.5 * r * (at(ex, i + 1, j) - at(ex, i - 1, j) + at(ey, i, j + 1) - at(ey, i, j - 1));
        this->Ex[c] = (1. - sigma_t * r) * ex[c] - r / 6. * (at(p, i + 1, j) - at(p, i - 1, j));
        this->Ey[c] = (1. - sigma_t * r) * ey[c] - r / 6. * (at(p, i, j + 1) - at(p, i, j - 1));
      }
    }
  }
};
} // namespace testing
} // namespace lighttransport

#endif
