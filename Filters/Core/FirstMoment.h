// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The first two moments of light in time (the P1 system; Murray 2018, eq. 3.23 and 3.24),
 *
 *   (1/c) d(phi)/dt = -div E - sigma_a phi + q
 *   (1/c) dE/dt     = -(1/3) grad phi - sigma_t' E,       sigma_t' = 1 / (3 D).
 *
 * Light moves at the finite speed c/sqrt(3); where it scatters much, E relaxes at once to
 * Fick's -D grad phi, and diffusion is left. The steady state is that of diffusion.
 * (Ishimaru 1978, ch. 9. Eq. 3.25 of the thesis has sigma_t phi in place of sigma_a phi.)
 *
 * Discretised on a staggered grid (Yee 1966; Harlow and Welch 1965): phi at the centres, the
 * normal component of E on the faces. Each difference then spans one voxel, and phi and E of
 * one parity do not lose sight of the other, which is what made the grid patterns of the
 * thesis (fig. 3.6). In time they leapfrog, and both losses are integrated exactly
 * (exponential differencing, Petropoulos 1997), with tau = c t, h the spacing:
 *
 *   E_f   += (1 - exp(-dtau / (3 D_f))) (F_f - E_f),     F_f = -D_f (phi_next - phi) / h
 *   phi_i += (1 - exp(-sigma_a dtau)) / sigma_a (q - sigma_a phi - div E)_i
 *
 * D_f is the harmonic mean, so sigma_t' of a face is the mean of its two voxels', and the fixed
 * point is to the letter that of DiffusionSolver. Second order in space and time.
 *
 * At the border the same partial-current condition as in diffusion: E_n = phi_face / (2 A)
 * (Marshak), over the half voxel before it: F = D phi / (h/2 + 2 A D), relaxed at the rate
 * 2 / (3 h) phi / F. A front that meets it head on is reflected by (1/sqrt(3) - 1/(2A)) /
 * (1/sqrt(3) + 1/(2A)): 7 % for A = 1.
 *
 * Stable for any sigma_a and D, walls (D = 0) included, if dtau sqrt(sum 1/h^2) <= sqrt(3):
 * with M = sigma_a/2 coth(sigma_a dtau/2) >= 1/dtau, m = 3 sigma_t'/2 coth(sigma_t' dtau/2) >=
 * 3/dtau, the energy M phi^2 - |grad phi|^2 / (4m) + (m/4 + 1/(16 m D^2)) (E+ + E-)^2 does not
 * grow, and it is positive if |grad|^2 <= 4 m M. stabilityBound evaluates that from the data; it
 * is larger where light scatters within a voxel, and ends in that of explicit diffusion.
 *
 * Unlike diffusion, the system has no maximum principle: behind a front that spreads in 2-D or
 * 3-D its own exact solution is negative. That is P1, not the scheme.
 */
#ifndef LightTransport_Core_FirstMoment_h
#define LightTransport_Core_FirstMoment_h

#include "Core/Buffer.h"
#include "Core/Diffusion.h"
#include "Core/Grid.h"
#include "Core/Parallel.h"

#include <array>
#include <cstdint>
#include <vector>

namespace lighttransport
{
/**
 * Beside the powers of the last state: what happened during the call, as energy times c
 * [power length]. emitted = absorbed + escaped + stored, to rounding.
 */
struct FirstMomentReport : DiffusionReport
{
  double emittedEnergy = 0.;
  double absorbedEnergy = 0.;
  double escapedEnergy = 0.;
  double storedEnergy = 0.; ///< the growth of the integral of phi
};

/** phi is the caller's, E stays here between calls. Throws std::bad_alloc. */
class FirstMomentSolver
{
public:
  explicit FirstMomentSolver(ParallelFor parallelFor = SerialFor);

  /** Reads the medium once, and sets E to 0. 56 bytes per voxel. Answers as DiffusionSolver's. */
  template <class T>
  DiffusionReport setMedium(
    const DiffusionMedium<T>& medium, const ProgressFunction& progress = {});

  /**
   * Time steps of length c dt (a length, > 0, up to stabilityBound) from phi and the E that an
   * earlier call left, or 0. q may be null: none. Each call may have its own c dt. MaxIterations
   * says that all steps were made, Converged that the steady state came first: both the residual
   * of diffusion, |q - A phi| / |q|, and the same with E in place of Fick's flux are at or below
   * the tolerance. After Cancelled, phi is that of the last whole step, and a call with it goes on
   * from there as if nothing had been.
   */
  template <class T>
  FirstMomentReport step(
    const T* q, double* phi, int steps, double cdt, const DiffusionControl& control);

  /** E = 0 again, for a phi that starts anew. */
  void reset();

  /** c dt at which a step goes as far as the wave: sqrt(3 / sum 1/h^2). Stable in any medium. */
  double courantBound() const;
  /** c dt up to which a step is stable in this medium; at least courantBound. 0: cancelled. */
  double stabilityBound(const ProgressFunction& progress = {});

  /**
   * E at phi's time and the voxels' centres, along the grid's axes; 3 values per voxel. False where
   * `progress` ended it.
   */
  template <class T>
  bool flux(const double* phi, T* E, const ProgressFunction& progress = {}) const;

  std::int64_t bytes() const;
  const Grid& grid() const { return this->box; }

private:
  /** All faces along an axis; empty where the axis has one voxel. */
  struct Faces
  {
    /**
     * The face above each voxel, D_f / h; above the last, phi beyond being 0, the border's.
     * How far E goes to Fick's flux in a step. E itself.
     */
    Buffer<float> conductance, relaxation;
    Buffer<double> E;
    /** The border's low face. */
    Buffer<float> lowConductance, lowRelaxation;
    Buffer<double> lowE;
  };
  struct Row;
  struct Sums;

  template <class T>
  void prepare(const DiffusionMedium<T>& medium);
  template <class T>
  void march(const T* q, double* phi, int steps, double cdt, const DiffusionControl& control,
    FirstMomentReport& report);

  std::int64_t rows() const;
  /** Fills the relaxations for a step of E over `length`. */
  void relaxOver(double length);
  void weighAbsorption(double cdt);
  /**
   * E goes over steppingOver. Interrupted, it is there in the rows before `stepped`, and the next
   * call goes on from these.
   */
  void stepE(const double* phi);
  /** c t by which E of a row is behind phi; negative: cancelled between them. */
  double lagOf(std::int64_t row) const;
  template <class T>
  Sums stepPhi(const T* q, double* phi);
  /** |q - A phi| with Fick's flux; q may be null. */
  template <class T>
  double residual(const T* q, const double* phi) const;

  WatchedFor parallelFor;
  Grid box;
  std::array<Faces, 3> faces;
  Buffer<float> sigma_a, weight; // (1 - exp(-sigma_a c dt)) / (sigma_a c dt)
  std::vector<double> zeros;     // a row of phi beyond the border
  double lag = 0.;               // of the rows from `stepped` on, see lagOf
  double steppingOver = 0.;
  std::int64_t stepped = 0;
  double relaxedOver = 0.; // what the relaxations are made for
  double cdt = 0.;         // what the weights are made for
  double stability = 0.;   // 0: not known yet
};
} // namespace lighttransport

#endif
