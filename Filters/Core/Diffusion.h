// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Diffusion of light on a box of voxels,
 *
 *   (1/c) d(phi)/dt = div(D grad phi) - sigma_a phi + q,
 *
 * in conservative finite volumes: the flux through a face is
 * -D_f (phi_n - phi) / h with D_f the harmonic mean of the two voxels' D, so
 * that the matrix is symmetric, an M-matrix, and power is conserved:
 * emitted = absorbed + escaped (+ stored, in time).
 * (Ishimaru 1978, ch. 9; Stam 1995; Murray 2018, sec. 4.1, whose eq. 4.3 has the
 * sign of grad D . grad phi wrong.)
 *
 * Names: D [length], sigma_a [1/length], q [power/length^3], phi [power/length^2],
 * E = -D grad phi [power/length^2]; c dt is a length.
 */
#ifndef LightTransport_Core_Diffusion_h
#define LightTransport_Core_Diffusion_h

#include "Core/Aggregation.h"
#include "Core/ConstantMedium.h"
#include "Core/Grid.h"
#include "Core/Multigrid.h"
#include "Core/Parallel.h"
#include "Core/Watched.h"

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace lighttransport
{
/** Why a solver stopped. Only Converged is success. */
enum class StopReason
{
  Converged,     ///< the recomputed residual is at or below the tolerance
  MaxIterations, ///< the allowed iterations or steps are used up
  Breakdown,     ///< no further progress: the tolerance is below what the precision reaches
  NotFinite,     ///< a value overflowed or was not a number
  Diverged,      ///< the residual grew
  Cancelled,     ///< the caller asked to stop
  NoSteadyState, ///< light is emitted where it can neither be absorbed nor escape
  BadInput       ///< the message says which
};

const char* ToString(StopReason reason);

/** What happens at the border, half a spacing beyond the outermost voxel centres. */
enum class Boundary
{
  Robin,    ///< partial current: phi + 2 A D d(phi)/dn = 0
  ZeroFlux, ///< a mirror: d(phi)/dn = 0
  Absorbing ///< phi = 0
};

/**
 * The diffuse Fresnel reflectance inside a medium whose refractive index is eta
 * times the outside's: F_dr = 2 int_0^1 F(mu) mu dmu, by quadrature (0 for eta = 1).
 * Jensen et al. 2001 fit it by -1.440/eta^2 + 0.710/eta + 0.668 + 0.0636 eta.
 */
double DiffuseFresnelReflectance(double eta);

/** A = (1 + F_dr) / (1 - F_dr) of the Robin condition. */
double BoundaryFactor(double eta);

/** What light moves through. The arrays are the caller's and outlive their use. */
template <class T>
struct DiffusionMedium
{
  Grid grid;
  const T* D = nullptr;       ///< length; >= 0, 0 is a wall
  const T* sigma_a = nullptr; ///< 1/length; >= 0; null for none
  /** Voxels with a value other than 0 are no part of the domain; may be null. q must be 0 there. */
  const std::uint8_t* outside = nullptr;
  Boundary boundary = Boundary::Robin;
  double refractiveIndexRatio = 1.; ///< of Robin; 1/3 .. 3 is usual
};

struct DiffusionReport
{
  /**
   * Of phi against the exact solution of the discrete equations, over the voxels within
   * six decades of the largest |phi|: the 95th percentile of |error| / |phi|, and the relative
   * Euclidean norm; estimated from the last iteration, see SlowError.h. Negative where nothing was
   * estimated.
   */
  double estimatedError = -1.;
  double estimatedErrorL2 = -1.;

  StopReason reason = StopReason::BadInput;
  std::string message; ///< for a person, where the reason alone does not say all
  int iterations = 0;
  /**
   * |b - A phi| / |b|, recomputed in double from phi and the medium; in time: of the steady
   * equation, with the float faces where the steps use these. After Cancelled that of the last
   * iteration or step, not recomputed. Negative: not known, nothing has computed it.
   */
  double residual = -1.;
  double seconds = 0.;    ///< this call, the set-up that it needed included
  std::int64_t bytes = 0; ///< held while solving, beyond the caller's arrays
  /** Applications of the operator on the finest grid, or sweeps that cost as much. */
  double fineApplications = 0.;
  double emitted = 0.;        ///< power: the integral of q over the domain
  double absorbed = 0.;       ///< power: of sigma_a phi
  double escaped = 0.;        ///< power through the border
  double leaked = 0.;         ///< power that left an active region, its truncation error
  double activeFraction = 1.; ///< of the voxels that took part
};

/** How implicit steps go forward. Both are L-stable: what a large step cannot follow, it damps. */
enum class ImplicitScheme
{
  BackwardEuler, ///< first order, and positive for any step
  SecondOrder    ///< SDIRK2 (Alexander 1977): two solves a step; large steps may undershoot
};

struct DiffusionControl
{
  double tolerance = 1e-8;
  int maxIterations = 500;
  ImplicitScheme implicitScheme = ImplicitScheme::BackwardEuler;
  /** May be empty; called between iterations and every 10 ms while passes run; false cancels. */
  ProgressFunction progress;
  /**
   * Where above 0, the solve ends with Converged as soon as the estimated error (see
   * DiffusionReport) is at or below half of it, or the tolerance is met.
   */
  double targetError = 0.;
  /** Where above 0, seconds after which the best answer so far is returned (MaxIterations). */
  double timeBudget = 0.;
  /**
   * Of solveActive: the largest part of the voxels that is solved for as a region, in (0, 1]; where
   * more than 0.4 of that is expected before the region is known, the whole volume is solved.
   */
  double largestRegion = 0.25;
  /**
   * Of solveActive: what may be spent before the region is known, as a part of what the whole
   * volume is expected to cost at the least; then that is solved. Counted in voxels, not measured.
   */
  double regionSearch = 0.08;
  /**
   * Of solveActive: where the region would be larger, answer MaxIterations with an activeFraction
   * of 1 and what phi has come to, a start, instead of solving on the whole volume: the caller
   * knows another way.
   */
  bool regionOrNothing = false;
  /** Of solveActive: phi is known to be 0. Fresh memory that need not be looked at costs nothing.
   */
  bool fromZero = false;
  /**
   * Called with the field reached: after the first iteration, step or correction that ends so many
   * seconds or more after the solve began, or after the last call returned.
   */
  std::function<void(const double* phi)> intermediate;
  double intermediateInterval = 0.1;
  /** Whether aggregation may take over where the multigrid stalls; false to compare. */
  bool aggregation = true;
  std::function<double()> clock; ///< seconds, of the interval; empty: the system's steady clock
};

/** The phi of explicit steps. A Buffer may become another one: that spares a copy. */
struct SteppedField
{
  SteppedField(double* phi)
    : values(phi)
  {
  }
  SteppedField(Buffer<double>& phi)
    : values(phi.data())
    , buffer(&phi)
  {
  }
  double* values;
  Buffer<double>* buffer = nullptr;
};

/** Calls control.intermediate when it is due. */
class Showing
{
public:
  explicit Showing(const DiffusionControl& control);
  bool isDue() const;
  void operator()(const double* phi);

private:
  double now() const;
  const DiffusionControl& control;
  double last = 0.;
};

/**
 * Holds the operator of one medium, its hierarchies (made at the first steady or implicit
 * solve; of a constant medium, its transforms) and nothing else; sources and solutions are the
 * caller's. Throws std::bad_alloc.
 */
class DiffusionSolver
{
public:
  explicit DiffusionSolver(ParallelFor parallelFor = SerialFor);

  /**
   * Keeps the medium's operator, with float coefficients (16 bytes per voxel; none before the
   * first time step, where D and sigma_a are constant), and looks at the arrays again to recompute
   * steady residuals: they must outlive the solves. Answers
   * BadInput, and says where, for a D or sigma_a that is negative or not finite; Cancelled where
   * `progress` says so: then there is no operator.
   */
  template <class T>
  DiffusionReport setMedium(
    const DiffusionMedium<T>& medium, const ProgressFunction& progress = {});

  /**
   * Steady state: conjugate gradients, preconditioned by one multigrid cycle,
   * with the residual replaced by the recomputed one (van der Vorst and Ye 2000)
   * every few decades. Where D and sigma_a are constant and nothing is outside: by
   * ConstantMedium, exactly; iterations are then corrections for double's rounding.
   *
   *   q: magnitudes up to 1e100 (norms are taken in double);
   *   phi: in, the start (zeros, or an earlier solution); out, the answer reached.
   */
  template <class T>
  DiffusionReport solveSteady(const T* q, double* phi, const DiffusionControl& control);

  /**
   * The steady state on an active region (see ActiveRegion.h): the voxels that light reaches from
   * the sources, grown where more than `threshold` (of the largest |phi|) would stand beyond, with
   * phi = 0 there. Light that stays in a vessel then does not cost the whole volume; light that
   * fills more than control.largestRegion of it is solved on the whole. With a control.targetError
   * e, at most 1e-6 sqrt(e) is cut off, with a timeBudget at most 1e-7; the estimated error holds
   * what that costs. phi is out only. The operator that is kept is the region's:
   * setMedium before another kind of solve.
   */
  template <class T, class Q>
  DiffusionReport solveActive(const DiffusionMedium<T>& medium, const Q* q, double* phi,
    const DiffusionControl& control, double threshold = 1e-7);

  /**
   * Time steps of length c dt (a length > 0) from phi:
   * forward Euler, whose positivity and stability bounds are below, or those of
   * control.implicitScheme, each to `tolerance`. q may be null: none.
   * MaxIterations says that all steps were made, Converged that the steady state came first.
   * Where D and sigma_a are constant and nothing is outside, all implicit steps are made at once by
   * ConstantMedium, in the time of one steady solve, to double's rounding.
   * On half a million voxels or more, explicit steps go through the memory four at a time, with
   * the same result; convergence and progress are then asked for after each four (each two from 8
   * million voxels on, and amid each from 17 million on, where there is a progress to ask).
   */
  template <class T>
  DiffusionReport stepExplicit(
    const T* q, SteppedField phi, int steps, double cdt, const DiffusionControl& control);
  template <class T>
  DiffusionReport stepImplicit(
    const T* q, double* phi, int steps, double cdt, const DiffusionControl& control);

  /**
   * Explicit steps in which every voxel has its own c dt: the fraction `courant`, in (0, 1], of
   * its own positivity bound, so that dense parts do not wait for clear ones. phi says nothing
   * about time, but ends in the steady state: damped Jacobi. Stable and positive for any medium.
   * (Murray 2018, sec. 4.1.3.) q and the report are as in stepExplicit.
   */
  template <class T>
  DiffusionReport stepLocal(
    const T* q, SteppedField phi, int steps, double courant, const DiffusionControl& control);

  /** c dt up to which a forward Euler step keeps positive fields positive: 1 / max diagonal. */
  double positivityBound() const;
  /** c dt up to which it is stable: 2 / (Gershgorin's bound of the largest eigenvalue). */
  double stabilityBound() const;

  /**
   * E = -D grad phi at voxel centres, along the grid's axes; E has 3 values per voxel. False where
   * `progress` ended it.
   */
  template <class T>
  bool flux(const double* phi, T* E, const ProgressFunction& progress = {}) const;

  const Grid& grid() const { return this->volume; }
  /** Is the medium the same everywhere, so that it is solved for at once (ConstantMedium.h)? */
  bool hasConstantMedium() const { return this->isConstant; }

private:
  friend class CoarseDiffusion;
  friend class FirstMomentSolver;
  /** solve(report), its loops watched; Cancelled where they were interrupted. */
  template <class Solve>
  DiffusionReport interruptible(const ProgressFunction& progress, const Solve& solve);
  template <class T>
  void steady(const T* q, double* phi, const DiffusionControl& control, DiffusionReport& report);
  template <class T, class Q>
  DiffusionReport active(const DiffusionMedium<T>& medium, const Q* q, double* phi,
    const DiffusionControl& control, double threshold);
  template <class T>
  void implicit(const T* q, double* phi, int steps, double cdt, const DiffusionControl& control,
    DiffusionReport& report);
  /** Takes an operator made elsewhere, divided by operatorScale, for steady solves alone. */
  void setOperator(const Grid& grid, DiffusionOperator&& op, double operatorScale);
  /** Checks the medium and sets the scale. */
  template <class T>
  DiffusionReport check(const DiffusionMedium<T>& medium);
  /** Writes the operator, on the spans (all, where there are none). */
  template <class T>
  void assemble(const DiffusionMedium<T>& medium, std::vector<Span> spans, bool anew = true);
  /** The operator's faces in memory, for set-up and time steps; or computed when they are read. */
  void storeFaces();
  void forgetFaces();
  /** The conductance between voxel i and its next along axis d, which there is. */
  double face(int d, std::int64_t i) const;
  /** In place of assemble where D and sigma_a are constant: the operator without its faces. */
  template <class T>
  void describe(const DiffusionMedium<T>& medium);
  template <class T>
  void computeRow(
    const DiffusionMedium<T>& medium, std::int64_t row, float* const g[3], float* s) const;
  /** Makes the box the one around the spans, with the medium in it; returns the spans there. */
  template <class T>
  DiffusionMedium<T> cut(const DiffusionMedium<T>& medium, std::vector<Span>& spans);
  /** action(from, to, n): for a row of the region, its n values in the volume and in the box. */
  template <class Action>
  void forRegion(const ParallelFor& loop, const Action& action) const;
  /** Whether the voxel one step along axis d, inside the box, belongs to the active region. */
  bool isActive(int d, const int at[3], int step) const;

  /**
   * b = qScale q + shift previous - mean, in the units of the scaled operator. The shift is
   * the one that float sinks have taken up, so that implicit steps end in the steady state.
   */
  template <class T>
  struct RightHandSide
  {
    const T* q;
    double qScale;
    bool ofSteps; ///< judged with the float faces that time steps step with
    double mean = 0.;
    const double* previous = nullptr;
    const float* shifted = nullptr;
    const float* unshifted = nullptr;
    double norm = 0.; ///< set by measure, as is
    int sign = 0;     ///< 1 or -1 where all sources are of that sign, and so is the exact answer

    /** b of n voxels from o on. */
    void row(std::int64_t o, int n, double* to) const;
  };
  template <class T>
  void conjugateGradients(const RightHandSide<T>& b, double* phi, const DiffusionControl& control,
    double progressBegin, double progressEnd, DiffusionReport& report);
  template <class T>
  void solveConstant(const RightHandSide<T>& b, double* phi, const DiffusionControl& control,
    DiffusionReport& report);
  /** phi += sign x; not interrupted: phi stays a whole. */
  void add(double sign, const double* x, double* phi) const;
  /** x = b - A phi from the medium itself. */
  template <class T>
  void residualOfConstant(const RightHandSide<T>& b, const double* phi, double* x) const;
  /** All steps of stepImplicit at once; b is the steady equation's. */
  template <class T>
  void marchConstant(const RightHandSide<T>& b, double* phi, const ConstantMedium::Steps& steps,
    const DiffusionControl& control, DiffusionReport& report);
  /**
   * Where all sources are of one sign, so is the exact answer, but conjugate gradients undershoot:
   * a look at phi tells (of sources of both signs there is none). What is of the other one beyond
   * the tolerance or 1e-7 (of the largest |phi|) becomes 0, and the solve goes on from there,
   * where it was not at its end or for a named error: then the residual is told again.
   */
  template <class T>
  void keepSign(const RightHandSide<T>& b, double* phi, const DiffusionControl& control,
    DiffusionReport& report);
  /**
   * |b - A phi|, and the residual divided by rScale in r where that is asked for; from the
   * medium itself in double, or (not exactly) from the float faces that the solver works with.
   */
  template <class T>
  double residual(const RightHandSide<T>& b, const double* phi, float* r, double rScale,
    bool exactly = true) const;
  template <class T>
  void applyExactly(const DiffusionMedium<T>& medium, const double* phi, std::int64_t row,
    std::int64_t o, int n, double* y) const;
  /** Its norm, and q's sign, in one pass. */
  template <class T>
  void measure(RightHandSide<T>& b) const;
  bool isZero(const double* phi) const;
  /** The mask of what the solver works on; null for none. */
  const std::uint8_t* outsideOfDomain() const;
  /** False, with BadInput, where a source lies outside the domain. */
  template <class T>
  bool startsInside(const T* q, DiffusionReport& report) const;
  /** The sum of term(i) over the voxels, in an order that threads do not change. */
  template <class Term>
  double sumOf(const Term& term) const;
  template <class T>
  void balance(const T* q, const double* phi, DiffusionReport& report) const;
  /** Of stepExplicit (c dt = length) and, where `local`, of stepLocal (courant = length). */
  template <class T>
  DiffusionReport march(const T* q, SteppedField field, int steps, double length, bool local,
    const DiffusionControl& control);
  /** Why a step is none; empty where it is one. */
  std::string badStep(double cdt) const;
  /** What walls close off without a sink, though sources in it cancel: its voxels. */
  using ClosedPart = std::vector<std::int64_t>;
  /**
   * False, with a message, where light has nowhere to go. singular: no voxel has a sink, and
   * phi is fixed up to a constant. reached: where walls may close parts off, a flag per voxel
   * for those that light reaches; else empty. closed: parts in which phi is fixed up to a constant.
   */
  template <class T>
  bool steadyStateExists(const T* q, bool& singular, std::vector<std::uint8_t>& reached,
    std::vector<ClosedPart>& closed, DiffusionReport& report) const;
  /**
   * A sink as large as its faces for the best connected voxel of each closed part, of the volume
   * where it is all singular: the preconditioner would divide by rounding. Light that cancels does
   * not use it. Answers what stood there.
   */
  std::vector<std::pair<std::int64_t, float>> ground(
    bool singular, const std::vector<ClosedPart>& closed);
  /** Adds a constant to all sinks (1 / (c dt) of an implicit step); 0 takes it away. */
  void setShift(double shift);
  void prepareMultigrid(const ParallelFor& loop);
  /**
   * Puts the aggregation in the multigrid's place; false where there is no memory for it. vectors:
   * what is held besides; bytes: what was held in all.
   */
  bool aggregate(std::int64_t vectors, std::int64_t& bytes);
  void dropHierarchies();
  std::int64_t bytesHeld() const;
  std::int64_t rows() const;
  void boundaryOf(Boundary boundary);
  std::int64_t borderIndex(int d, const int at[3]) const;

  /**
   * 95th percentile and L2 norm of the error, were it `scaled` z times `factor` in L2, and times
   * its root in the percentile; sign: the exact answer's, or 0.
   */
  void estimateError(const double* phi, const float* z, double scaled, double factor, int sign,
    DiffusionReport& report) const;
  /**
   * Adds the error of an active region's cut: of sources at its rim that are missing in phi, and
   * what is `beyond`, relative to phi.
   */
  void addCut(const std::vector<std::pair<std::int64_t, double>>& missing, double beyond,
    const double* phi, DiffusionReport& report);

  WatchedFor parallelFor;
  Grid volume;                              ///< the medium's
  Grid box;                                 ///< the operator's: of an active region, around it
  std::array<int, 3> corner{ { 0, 0, 0 } }; ///< of the box in the volume
  DiffusionOperator A;                      // divided by `scale`, so that no diagonal is above 1
  double scale = 1.;                        // 1/length
  double largestDiagonal = 1.;
  double gershgorin = 1.; // bound of the largest eigenvalue, divided by scale
  /** The caller's arrays, one of the two: what the residual is recomputed from. */
  DiffusionMedium<float> floatMedium;
  DiffusionMedium<double> doubleMedium;
  /** The medium in the box of an active region. */
  template <class T>
  struct Piece
  {
    Buffer<T> D, sigma_a;
    Buffer<std::uint8_t> outside;
  };
  Piece<float> floatPiece;
  Piece<double> doublePiece;
  double twoA = 0.; ///< of the Robin condition
  bool anySink = false;
  bool everySink = false;
  bool anyWall = false;
  bool grounded = false; ///< sinks stand in A that the medium does not have
  /** Conductance through the border, divided by scale: [axis][low, high], a value per face. */
  std::array<std::array<std::vector<float>, 2>, 3> border;
  double shift = 0.;
  Buffer<float> sinkWithoutShift; // while shift is not 0
  Multigrid multigrid;
  bool multigridReady = false;
  Aggregation aggregation; ///< in its place where it has been seen to stall, else empty
  bool mayAggregate = true;
  bool isConstant = false; ///< D > 0 and sigma_a are the same everywhere, and it pays
  ConstantMedium constant;
};
} // namespace lighttransport

#endif
