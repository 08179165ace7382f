// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Diffusion in a constant medium, steady or in implicit steps, solved at once: with D and sigma_a
 * the same in every voxel the operator is a sum over the axes,
 *
 *   A = D (T_x + T_y + T_z) + sigma_a,
 *
 * T_d acting along axis d alone. Its eigenvectors are products of the T_d's (Lynch, Rice and
 * Thomas 1964, Numer. Math. 6, 185), and phi = V (V' q / eigenvalues), an axis at a time.
 *
 * An implicit step multiplies what is missing to the steady state by R(lambda) along each
 * eigenvector, N steps by R^N: all of them are one look at the eigenvalues,
 *
 *   phi_N = phi_0 + V (S_N V' (q - A phi_0)),  S_N = (1 - R^N) / lambda = (1 + R + .. + R^(N-1))
 * S_1,
 *
 * with rho = shift / (lambda + shift), R = rho (1 - ahead (1 - rho)) and
 * S_1 = (1 + ahead rho) / (lambda + shift), which need no lambda above 0; R^N and S_N by doubling.
 *
 * T_d is tridiagonal, 2 on the diagonal and -1 beside it over h^2, and ends in 1 + kappa instead
 * of 2: kappa = h^2 times the border's conductance per D, 0 at a mirror, 2 where phi = 0 in the
 * border, between these for Robin's condition. Eigenvector k is a cosine (k even) or a sine (k
 * odd) around the axis's middle, of a wave number theta between k pi / n and (k + 1) pi / n; its
 * eigenvalue is (2 sin(theta / 2) / h)^2.
 *
 * Steps of solve():
 *   1. every plane: along x, then along y
 *   2. every column of planes: along z, division by the eigenvalues (or times S_N), back along z
 *   3. every plane: back along y, then along x
 * A transform is a product with two dense matrices of half the axis's length, one for the even
 * and one for the odd part: 2 sum(n_d) operations per voxel for both ways.
 */
#ifndef LightTransport_Core_ConstantMedium_h
#define LightTransport_Core_ConstantMedium_h

#include "Core/Grid.h"
#include "Core/Parallel.h"

#include <array>
#include <functional>
#include <vector>

namespace lighttransport
{
class ConstantMedium
{
public:
  /** Whether the transforms along a grid's axes cost less than iterations do. */
  static bool suits(const Grid& grid);

  /**
   * D > 0 and sigma_a >= 0 in any unit; `border` is the conductance of a border face along each
   * axis, divided by D and the spacing (1/length^2): 0 .. 2 / h^2. An axis with one voxel carries
   * no flux.
   */
  void setup(const Grid& grid, double D, double sigma_a, const std::array<double, 3>& border);
  void release();

  /**
   * x = A^-1 x; where an eigenvalue is 0 (mirrors and no absorption), the part of x along it, its
   * mean, becomes 0. `goOn` is asked between pieces of some milliseconds; false ends, and x is
   * neither.
   */
  bool solve(
    double* x, const ParallelFor& parallelFor, const std::function<bool(double done)>& goOn) const
  {
    return this->solve(x, nullptr, parallelFor, goOn, nullptr);
  }

  /** Implicit time steps, backward Euler or SDIRK2. */
  struct Steps
  {
    std::int64_t count = 1; ///< >= 1
    double shift = 1.;      ///< 1 / (c dt) of a solve, > 0, in the unit of D / length^2
    double ahead = 0.;      ///< SDIRK2: how far the second solve starts ahead, (1 - gamma) / gamma
  };
  /**
   * x = S_N x: what the steps add, where x was q - A phi. `rest` becomes the Euclidean norm of
   * R^N x, what the steps leave of that; the rest is as in solve.
   */
  bool march(double* x, const Steps& steps, const ParallelFor& parallelFor,
    const std::function<bool(double done)>& goOn, double& rest) const
  {
    return this->solve(x, &steps, parallelFor, goOn, &rest);
  }
  /** By how much steps can lengthen x at most: S_N of the smallest eigenvalue, or a little more. */
  double growth(const Steps& steps) const;

  std::int64_t bytes() const;

private:
  /** V of an axis, even modes and odd ones apart, in rows of `size` padded to whole blocks. */
  struct Axis
  {
    int n = 1;
    std::vector<double> eigenvalues; ///< even modes first; times D
    struct Half
    {
      int count = 0, padded = 0;
      std::vector<double> modes;      ///< [mode][voxel of the lower half]
      std::vector<double> transposed; ///< [voxel][mode]
    };
    std::array<Half, 2> half;
    std::size_t rows() const
    {
      return static_cast<std::size_t>(this->half[0].padded) +
        static_cast<std::size_t>(this->half[1].padded);
    }
  };
  bool solve(double* x, const Steps* steps, const ParallelFor& parallelFor,
    const std::function<bool(double done)>& goOn, double* rest) const;
  /** Along the first axis of some rows, in place; modes stand where voxels did. */
  void alongRows(const Axis& axis, double* x, std::int64_t rows, bool forward) const;
  /** Along the second axis of a plane, whose rows are `stride` long. */
  void alongColumns(const Axis& axis, double* x, std::int64_t stride, bool forward) const;
  /** Step 2 of some columns from `first` on; answers the sum of squares of R^N x. */
  double throughPlanes(double* x, const Steps* steps, std::int64_t first, int columns) const;
  /** The even and odd part of a block of columns, and a block from these. */
  void toHalves(
    const Axis& axis, const double* x, std::int64_t stride, int columns, double* to) const;
  void fromHalves(
    const Axis& axis, const double* from, int columns, double* x, std::int64_t stride) const;
  /** From halves of voxels to modes or back. */
  void transform(const Axis& axis, const double* in, int columns, bool forward, double* out) const;

  std::array<Axis, 3> axes; ///< those with more than one voxel come first
  double sigma_a = 0.;
};
} // namespace lighttransport

#endif
