// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * How much longer the error of conjugate gradients is than one preconditioning of the residual.
 *
 * z = B r is the error itself where the preconditioner B is the inverse of A. Slow components, of
 * eigenvalue theta < 1 of B A, are theta times too small in it. Two things that the iteration
 * knows anyway tell how many there are:
 *
 *   1. The energy of the error falls by alpha r.z in each iteration (Hestenes and Stiefel 1952,
 *      theorem 6:1; Strakos and Tichy 2002), so that over some iterations
 *      a = (what the energy lost) / (what r.z lost) is the mean of 1 / theta, weighted by r.z.
 *   2. alpha and beta make Lanczos's tridiagonal matrix, whose least eigenvalue is theta's.
 *
 * If a part f of r.z lies in components of theta and the rest in fast ones, a = 1 - f + f / theta,
 * and |e|^2 / |z|^2 = 1 - f + f / theta^2 = 1 + (a - 1) (1 + 1 / theta).
 */
#ifndef LightTransport_Core_SlowError_h
#define LightTransport_Core_SlowError_h

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace lighttransport
{
class SlowError
{
public:
  /** After an iteration: its step, its r.z, and whether it went along z alone. */
  void add(double alpha, double rz, bool restarted)
  {
    const std::size_t k = this->alphas.size();
    const double beta =
      k == 0 || restarted || !(this->rzs[k - 1] > 0.) ? 0. : rz / this->rzs[k - 1];
    const double before = k ? this->alphas[k - 1] : 1.;
    this->diagonal.push_back(1. / alpha + beta / before);
    this->beside.push_back(beta / (before * before)); // squared, to the entry before
    this->alphas.push_back(alpha);
    this->rzs.push_back(rz);
  }

  /**
   * |e| / |z| with r.z as it is now, to be asked once per iteration. What an iteration gained tells
   * of the slow components before it, and they come and go: the most of the last three counts.
   */
  double factor(double rz)
  {
    this->last[0] = this->last[1];
    this->last[1] = this->last[2];
    this->last[2] = this->now(rz);
    return std::max({ this->last[0], this->last[1], this->last[2] });
  }

private:
  double now(double rz) const
  {
    const std::size_t k = this->alphas.size();
    if (k == 0)
    {
      return 1.;
    }
    // over as many iterations as it takes to lose most of r.z
    double energy = 0.;
    std::size_t j = k;
    do
    {
      --j;
      energy += this->alphas[j] * this->rzs[j];
    } while (j > 0 && this->rzs[j] < 4. * rz);
    const double lost = std::max(this->rzs[j] - rz, 0.1 * this->rzs[j]);
    const double theta = std::min(1., this->least());
    const double mean = std::min(1. / theta, std::max(1., energy / lost));
    return std::sqrt(1. + (mean - 1.) * (1. + 1. / theta));
  }

  /** The least eigenvalue of the tridiagonal matrix, by bisection (Sturm). */
  double least() const
  {
    double low = 0.;
    double high = *std::min_element(this->diagonal.begin(), this->diagonal.end());
    for (int i = 0; i < 30 && high - low > 0.01 * high; ++i)
    {
      const double middle = 0.5 * (low + high);
      double pivot = 1.;
      bool below = false; // an eigenvalue below the middle
      for (std::size_t j = 0; j < this->diagonal.size() && !below; ++j)
      {
        pivot = this->diagonal[j] - middle - (j ? this->beside[j] / pivot : 0.);
        below = !(pivot > 0.);
      }
      (below ? high : low) = middle;
    }
    return std::max(0.5 * (low + high), 1e-6);
  }

  double last[3] = { 1., 1., 1. };
  std::vector<double> alphas, rzs, diagonal, beside;
};
} // namespace lighttransport

#endif
