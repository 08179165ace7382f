// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** Small dense systems, of the fits behind the curvatures. */
#ifndef LightTransport_Core_Cholesky_h
#define LightTransport_Core_Cholesky_h

#include <algorithm>
#include <cmath>

namespace lighttransport
{
/** Cholesky: b becomes x of A x = b; A is positive definite, n <= N, its lower half used up. */
template <int N>
inline void SolvePositive(int n, double (&A)[N][N], double (&b)[N])
{
  for (int j = 0; j < n; ++j)
  {
    for (int i = j; i < n; ++i)
    {
      double sum = A[i][j];
      for (int k = 0; k < j; ++k)
      {
        sum -= A[i][k] * A[j][k];
      }
      A[i][j] = i == j ? std::sqrt(std::max(sum, 1e-30)) : sum / A[j][j];
    }
  }
  for (int i = 0; i < n; ++i)
  {
    for (int k = 0; k < i; ++k)
    {
      b[i] -= A[i][k] * b[k];
    }
    b[i] /= A[i][i];
  }
  for (int i = n - 1; i >= 0; --i)
  {
    for (int k = i + 1; k < n; ++k)
    {
      b[i] -= A[k][i] * b[k];
    }
    b[i] /= A[i][i];
  }
}
} // namespace lighttransport

#endif
