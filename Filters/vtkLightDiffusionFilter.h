// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkLightDiffusionFilter
 * @brief   diffuse light through an image: its fluence, and on request its flux
 *
 * Input: an image with the point arrays of vtkOpticalMediumFilter and
 * vtkLightSeedFilter (names in vtkLightTransportArrays.h),
 *
 *   DiffusionCoefficient  D        length          >= 0; 0 is a wall
 *   Absorption            sigma_a  1/length        >= 0
 *   Source                q        power/length^3  either sign
 *
 * Output: the same image, its arrays passed through, with
 *
 *   Fluence  phi              power/length^2  either sign where a source is negative
 *   Flux     E = -D grad phi  power/length^2  three world components, on request
 *
 * which solves
 *
 *   (1/c) d(phi)/dt = div(D grad phi) - sigma_a phi + q.
 *
 * "length" is the unit of the image's spacing. Image points are voxel centres;
 * the domain ends half a spacing beyond the outermost. An axis with a single
 * point carries no flux: the image is taken as invariant along it. Hidden points
 * (vtkGhostType) are no part of the domain: light neither enters nor starts there.
 *
 * Stages, as in the code:
 *   1. check the input;
 *   2. build the operator: conservative finite volumes, harmonic means of D on the
 *      faces (a symmetric M-matrix: emitted = absorbed + escaped); kept until the
 *      medium changes;
 *   3. solve: Steady by conjugate gradients with one multigrid cycle as
 *      preconditioner (of aggregates where that stalls; a constant medium directly), until
 *      the residual, recomputed in double precision, is below the tolerance; or time
 *      steps, Explicit (forward Euler) or Implicit (backward Euler or SDIRK2, both
 *      L-stable), from phi = 0 or from the last state;
 *   4. write the arrays, and the report into getters and field data
 *      (`LightDiffusionReport.*`), so that a saved file says how it was made.
 *
 * Model AnisotropicDiffusion is Perona and Malik's, the thesis's proof of concept
 * (Murray 2018, sec. 3.1.3): Source is the field at time 0 and is smoothed
 * without absorption by D = length * C(|grad S|), C from the input's scalars S (never
 * from phi), for a bounded number of steps. Fluence then has Source's unit.
 *
 * Model FirstMoment lets light travel: diffusion is at once everywhere, while the system of
 * fluence and flux that it comes from (the thesis's eq. 3.23 and 3.24),
 *
 *   (1/c) d(phi)/dt = -div E - sigma_a phi + q
 *   (1/c) dE/dt     = -(1/3) grad phi - E / (3 D),
 *
 * has fronts that move at c / sqrt(3), and ends in the same steady state. On a staggered grid
 * (phi on the points, E between them) it has none of the grid patterns for which the thesis
 * gave it up. Behind a front that spreads, phi may be negative: so it is in the exact solution.
 *
 * Murray, D.: Legible Visualization of Semi-Transparent Objects using Light
 * Transport. PhD thesis, Bordeaux 2018, ch. 3 and 4 (eq. 4.3 and 4.4 there have
 * the sign of grad D . grad phi wrong). Perona, P. and Malik, J.: Scale-space and edge
 * detection using anisotropic diffusion. PAMI 12(7), 1990.
 *
 * Not for radiometry of strongly forward-scattering thin slabs: diffusion is
 * the first-order (P1) approximation of the transfer equation.
 *
 * @sa vtkOpticalMediumFilter vtkLightSeedFilter
 */
#ifndef vtkLightDiffusionFilter_h
#define vtkLightDiffusionFilter_h

#include "vtkImageAlgorithm.h"
#include "vtkLightTransportFiltersModule.h" // for the export macro
#include "vtkSmartPointer.h"                // for the intermediate output

#include <memory> // for the solver's state
#include <string> // for the report's message

class vtkImageData;

class VTKLIGHTTRANSPORTFILTERS_EXPORT vtkLightDiffusionFilter : public vtkImageAlgorithm
{
public:
  static vtkLightDiffusionFilter* New();
  vtkTypeMacro(vtkLightDiffusionFilter, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  enum ModelType
  {
    Diffusion = 0,
    AnisotropicDiffusion = 1,
    FirstMoment = 2
  };
  ///@{
  /**
   * What moves the light; default Diffusion. FirstMoment differs from it in Mode Explicit alone:
   * its Steady is the same, and Implicit is an error.
   */
  vtkSetMacro(Model, int);
  vtkGetMacro(Model, int);
  ///@}

  enum ModeType
  {
    Steady = 0,
    Explicit = 1,
    Implicit = 2
  };
  ///@{
  /**
   * Steady (default) finds the state that no longer changes. Explicit and Implicit make
   * NumberOfSteps time steps per execution (fewer when the steady state is reached to
   * Tolerance). Steady is an error with AnisotropicDiffusion, which has no absorption and
   * would end in a constant.
   */
  vtkSetMacro(Mode, int);
  vtkGetMacro(Mode, int);
  ///@}

  enum BoundaryType
  {
    Robin = 0,
    ZeroFlux = 1,
    Absorbing = 2
  };
  ///@{
  /**
   * At the border of the image. Robin (default): light leaves and none comes in, partial
   * current phi + 2 A D d(phi)/dn = 0. ZeroFlux: a mirror. Absorbing: phi = 0.
   */
  vtkSetMacro(Boundary, int);
  vtkGetMacro(Boundary, int);
  ///@}

  ///@{
  /**
   * Refractive index inside over outside, of the Robin boundary: A = (1 + F_dr) / (1 - F_dr)
   * with the diffuse Fresnel reflectance F_dr. Above 0, finite; default 1 (A = 1). Tissue in
   * air: 1.4.
   */
  vtkSetMacro(RefractiveIndexRatio, double);
  vtkGetMacro(RefractiveIndexRatio, double);
  ///@}

  ///@{
  /**
   * Accepted |b - A phi| / |b|, Euclidean norms, of the steady equation (Implicit: of each
   * step's). In (0, 1); default 1e-8, with which six decades below the maximum are right.
   * Below about 1e-15 double precision cannot follow: the stop reason then is Breakdown.
   */
  vtkSetMacro(Tolerance, double);
  vtkGetMacro(Tolerance, double);
  ///@}

  ///@{
  /** Of the linear solver (Implicit: in each step); >= 1, default 500. 5 to 40 are usual. */
  vtkSetMacro(MaximumNumberOfIterations, int);
  vtkGetMacro(MaximumNumberOfIterations, int);
  ///@}

  ///@{
  /** Time steps per execution, Explicit and Implicit; >= 1, default 100. */
  vtkSetMacro(NumberOfSteps, int);
  vtkGetMacro(NumberOfSteps, int);
  ///@}

  ///@{
  /**
   * The step c dt as a fraction of the positivity bound that is computed from the data
   * (GetPositivityBound). Above 0; default 1. Explicit: above the stability bound (between 1
   * and 2 times that) the execution is refused. Implicit: any; 1000 is fast. FirstMoment: as a
   * fraction of sqrt(3 / sum 1/h^2), the c dt in which light goes as far as a step can carry it;
   * stable up to 1 in any medium.
   */
  vtkSetMacro(CourantNumber, double);
  vtkGetMacro(CourantNumber, double);
  ///@}

  ///@{
  /** The step c dt itself, a length; >= 0, default 0: from CourantNumber. */
  vtkSetMacro(TimeStep, double);
  vtkGetMacro(TimeStep, double);
  ///@}

  ///@{
  /**
   * Explicit steps of Diffusion in which each point has its own c dt, CourantNumber (here at most
   * 1) times its own positivity bound, so that dense parts need not wait for clear ones. Reaches
   * only the steady state, where contrast is high many times sooner: the fields on the way belong
   * to no time (Murray 2018, sec. 4.1.3: "clearly not realistic"). TimeStep must be 0. Default
   * off; Steady and Implicit ignore it.
   */
  vtkSetMacro(LocalTimeStep, bool);
  vtkGetMacro(LocalTimeStep, bool);
  vtkBooleanMacro(LocalTimeStep, bool);
  ///@}

  enum ImplicitSchemeType
  {
    BackwardEuler = 0,
    SecondOrder = 1
  };
  ///@{
  /**
   * How Implicit steps. BackwardEuler (default): first order in time, positive for any step.
   * SecondOrder: SDIRK2 (Alexander 1977), two solves a step; steps far above the positivity bound
   * may undershoot for a while. Both are L-stable: what a large step cannot follow, it damps.
   */
  vtkSetMacro(ImplicitScheme, int);
  vtkGetMacro(ImplicitScheme, int);
  ///@}

  enum FluxFunctionType
  {
    Exponential = 0,
    Rational = 1
  };
  ///@{
  /**
   * AnisotropicDiffusion's C: Exponential (default) exp(-(|grad S|/sigma)^2), keeps sharp edges;
   * Rational 1 / (1 + (|grad S|/sigma)^2), prefers wide regions. Perona and Malik 1990; Murray
   * 2018, eq. 3.2 and 3.3.
   */
  vtkSetMacro(FluxFunction, int);
  vtkGetMacro(FluxFunction, int);
  ///@}

  ///@{
  /**
   * sigma of AnisotropicDiffusion, in scalar units per length; >= 0, default 0: chosen from the
   * data. GetComputedGradientScale tells which was used.
   */
  vtkSetMacro(GradientScale, double);
  vtkGetMacro(GradientScale, double);
  vtkGetMacro(ComputedGradientScale, double);
  ///@}

  ///@{
  /** Also write the array Flux; default off. */
  vtkSetMacro(ComputeFlux, bool);
  vtkGetMacro(ComputeFlux, bool);
  vtkBooleanMacro(ComputeFlux, bool);
  ///@}

  ///@{
  /**
   * Start from the last state when nothing but Source has changed: a steady solve gets there
   * in fewer iterations, time steps go on from where they were (call Modified() for another
   * NumberOfSteps, to show progress). Keeps 8 bytes per point. Default off.
   */
  vtkSetMacro(Continue, bool);
  vtkGetMacro(Continue, bool);
  vtkBooleanMacro(Continue, bool);
  ///@}
  ///@{
  /**
   * Steady only: keep one solution per sphere of vtkLightSeedFilter (8 bytes per point each, at
   * most MaximumNumberOfKeptSolutions), for a power of 1. Light is linear in its sources: what
   * switches, dims or turns the sign of a light is then a sum and a check of its residual, not a
   * solve; a new or moved one costs its own solve only. Default off. Not with an active region.
   */
  vtkSetMacro(KeepSolutions, bool);
  vtkGetMacro(KeepSolutions, bool);
  vtkBooleanMacro(KeepSolutions, bool);
  vtkSetMacro(MaximumNumberOfKeptSolutions, int);
  vtkGetMacro(MaximumNumberOfKeptSolutions, int);
  ///@}

  /** Forget the last state, so that the next execution starts from phi = 0. */
  void ResetState();

  ///@{
  /**
   * Steady only: solve on the points that light reaches from the sources, foretold by a front and
   * grown while more than ActiveThreshold (of the largest |phi|) would stand beyond, with phi = 0
   * there: light that stays in a vessel does not cost the whole volume; where the region would be a
   * tenth of it, or takes longer to find than 8 % of a whole solve, that goes on from what the
   * search came to. With
   * TargetError the threshold is at most 1e-6 sqrt(TargetError), so that the cut does not show in
   * it. Fluence is 0 outside. Default off: the residual's equations
   * hold everywhere.
   */
  vtkSetMacro(ActiveRegion, bool);
  vtkGetMacro(ActiveRegion, bool);
  vtkBooleanMacro(ActiveRegion, bool);
  ///@}

  ///@{
  /** In (0, 1); default 1e-7: an order below the six decades that are shown. */
  vtkSetMacro(ActiveThreshold, double);
  vtkGetMacro(ActiveThreshold, double);
  ///@}

  ///@{
  /**
   * Steady only: solve on cells of so many points of the finest axis, 1 (default), 2 or 4. D and
   * sigma_a are not resampled: cells are joined by the resistance of the points between them, so
   * that walls of one point stay walls, and three corrections by the full grid's own equations
   * follow. Fluence is on the input's grid, GetEstimatedError against its answer. 2: errors of a
   * percent in a fraction of the time and half the memory; 4: a preview, tens of percent.
   * Not with KeepSolutions or ActiveRegion, which it overrules; Residual is that before the last
   * correction, and the stop reason MaxIterations unless that, or TargetError, is met.
   */
  vtkSetMacro(CoarseningFactor, int);
  vtkGetMacro(CoarseningFactor, int);
  /** What the last execution used: CoarseningFactor, or what a named error had it choose. */
  vtkGetMacro(UsedCoarseningFactor, int);
  ///@}

  ///@{
  /**
   * The error that is accepted, in [0, 1): the 95th percentile of |phi - phi*| / |phi*| over the
   * voxels within six decades of the largest |phi*|, with phi* the exact solution of the discrete
   * equations on the full grid. Where above 0, a steady solve chooses what does, in this order:
   * from the last state, with Continue, cells of two points and corrections by the full grid's
   * equations; where light stays in some per cent of the volume, that region alone (to find out
   * costs less than a tenth of a solve); the full grid, with as many iterations as it takes.
   * GetEstimatedError tells what was reached, GetActiveFraction, GetUsedCoarseningFactor and
   * GetNumberOfIterationsUsed what was chosen; Tolerance only ends it earlier. Default 0: Tolerance
   * decides.
   */
  vtkSetMacro(TargetError, double);
  vtkGetMacro(TargetError, double);
  ///@}

  ///@{
  /**
   * Seconds after which a steady solve gives its best answer, chosen as with TargetError, with an
   * estimate of its error; the stop reason is then MaxIterations. >= 0; default 0: no limit. It
   * counts from the start of the execution, output included. Where it is too short for the full
   * grid's set-up (128^3: some 0.1 s), cells of four points serve as a preview:
   * GetUsedCoarseningFactor is 4. Where there is no time for a correction by the full grid's
   * equations, the estimate is 1, a guess, and GetMessage says so. The preview is the least that is
   * done, some 20 ns per point on the two cores of measured.md: GetMessage says where that floor,
   * or a step that cannot be cut short, took more than a tenth, and 10 ms, beyond the budget.
   * With TargetError too, what comes first ends the solve.
   */
  vtkSetMacro(TimeBudget, double);
  vtkGetMacro(TimeBudget, double);
  ///@}

  /** Invoked with the field that was reached, see IntermediateInterval. */
  static constexpr unsigned long IntermediateEvent = 1000 + 5311; // vtkCommand::UserEvent is 1000
  ///@{
  /**
   * Progressive display: where above 0, IntermediateEvent is invoked during a solve at most once
   * per so many seconds, and GetIntermediateOutput holds the Fluence reached. Default 0: never.
   */
  vtkSetMacro(IntermediateInterval, double);
  vtkGetMacro(IntermediateInterval, double);
  vtkImageData* GetIntermediateOutput();
  ///@}

  ///@{
  /**
   * Of Fluence and Flux: vtkAlgorithm::SINGLE_PRECISION (float, default), DOUBLE_PRECISION, or
   * DEFAULT_PRECISION: double where TargetError is below 1e-6, which float cannot hold, else float.
   * The solution is in double; a value beyond float's range is an error that says so. VTK 9.1 has
   * no array of halves: vtkLightFieldProperty stores them on the GPU.
   */
  vtkSetMacro(OutputPrecision, int);
  vtkGetMacro(OutputPrecision, int);
  ///@}

  enum StopReasonType
  {
    Converged = 0,
    MaxIterations = 1,
    Breakdown = 2,
    NotFinite = 3,
    Diverged = 4,
    Cancelled = 5,
    NoSteadyState = 6,
    BadInput = 7
  };
  ///@{
  /**
   * The report of the last execution. Only Converged says that the tolerance is met. MaxIterations
   * of time steps says that all of them were made. After Cancelled, MaxIterations and Breakdown the
   * output holds the best answer reached; after Cancelled, without Flux and powers, and where
   * nothing was reached yet the last state (with Continue) or darkness. Cancelled comes within a
   * tenth of a second of AbortExecute up to 256^3 points on the two cores of measured.md; at 512^3
   * writing the output alone takes that long.
   */
  vtkGetMacro(StopReason, int);
  const char* GetStopReasonAsString() const;
  /** What the reason alone does not say; may be empty. */
  const char* GetMessage() const { return this->Message.c_str(); }
  /** Iterations of the linear solver; Explicit: steps. */
  vtkGetMacro(NumberOfIterationsUsed, int);
  /**
   * |b - A phi| / |b| of the steady equation, recomputed in double from the answer; after Cancelled
   * not recomputed. Negative (-1) where it is not known: before there is an answer, and of a
   * preview in haste (TimeBudget). So ask for 0 <= residual <= tolerance.
   */
  vtkGetMacro(Residual, double);
  vtkGetMacro(SolveSeconds, double);
  /** Held at the most while solving, beyond the input's and output's arrays. */
  vtkGetMacro(Bytes, vtkIdType);
  /** Applications of the operator on the full grid, or sweeps that cost as much. */
  vtkGetMacro(FineGridApplications, double);
  /**
   * The error as TargetError defines it, and the relative Euclidean norm, both estimated from the
   * last iteration (see Core/SlowError.h) or correction, rounding to OutputPrecision included;
   * negative where none of TargetError, TimeBudget and
   * CoarseningFactor is set.
   */
  vtkGetMacro(EstimatedError, double);
  vtkGetMacro(EstimatedErrorL2, double);
  /** The part of the voxels that was solved for; 1 without an active region. */
  vtkGetMacro(ActiveFraction, double);
  ///@}
  ///@{
  /**
   * Power: the integrals of q, of sigma_a phi, and of the flux through the border. 0 after
   * Cancelled, which ends at once.
   */
  vtkGetMacro(EmittedPower, double);
  vtkGetMacro(AbsorbedPower, double);
  vtkGetMacro(EscapedPower, double);
  /** What left an active region: the power that its border costs. */
  vtkGetMacro(LeakedPower, double);
  ///@}
  ///@{
  /** Of the medium of the last execution, c dt as a length: up to which an explicit step keeps
   * positive fields positive (0 with FirstMoment, which keeps no sign), and up to which it is
   * stable (Gershgorin). */
  vtkGetMacro(PositivityBound, double);
  vtkGetMacro(StabilityBound, double);
  /** The c dt that was used; 0 where each point has its own. */
  vtkGetMacro(UsedTimeStep, double);
  ///@}

protected:
  vtkLightDiffusionFilter();
  ~vtkLightDiffusionFilter() override;

  int FillInputPortInformation(int port, vtkInformation* info) override;
  int RequestInformation(vtkInformation* request, vtkInformationVector** inputVector,
    vtkInformationVector* outputVector) override;
  int RequestUpdateExtent(vtkInformation* request, vtkInformationVector** inputVector,
    vtkInformationVector* outputVector) override;
  int RequestData(vtkInformation* request, vtkInformationVector** inputVector,
    vtkInformationVector* outputVector) override;

private:
  vtkLightDiffusionFilter(const vtkLightDiffusionFilter&) = delete;
  void operator=(const vtkLightDiffusionFilter&) = delete;

  bool CheckParameters(std::string& problem) const;
  bool Solve(vtkImageData* input, vtkImageData* output, std::string& problem);
  /** The output of an execution that was cancelled before there was a field. */
  void WriteStart(vtkImageData* input, vtkImageData* output);
  void PassAbort(vtkObject* inner, unsigned long event, void* data);
  void WriteReport(vtkImageData* output) const;
  void ClearReport();

  int Model = Diffusion;
  int Mode = Steady;
  int Boundary = Robin;
  double RefractiveIndexRatio = 1.;
  double Tolerance = 1e-8;
  int MaximumNumberOfIterations = 500;
  int NumberOfSteps = 100;
  double CourantNumber = 1.;
  double TimeStep = 0.;
  bool LocalTimeStep = false;
  int ImplicitScheme = BackwardEuler;
  int FluxFunction = Exponential;
  double GradientScale = 0.;
  double ComputedGradientScale = 0.;
  bool ComputeFlux = false;
  bool Continue = false;
  bool KeepSolutions = false;
  int MaximumNumberOfKeptSolutions = 16;
  bool ActiveRegion = false;
  double ActiveThreshold = 1e-7;
  double TargetError = 0.;
  double TimeBudget = 0.;
  double IntermediateInterval = 0.;
  vtkSmartPointer<vtkImageData> IntermediateOutput;
  int OutputPrecision = SINGLE_PRECISION;
  int CoarseningFactor = 1;
  int UsedCoarseningFactor = 1;

  int StopReason = BadInput;
  std::string Message;
  int NumberOfIterationsUsed = 0;
  double Residual = -1.;
  double SolveSeconds = 0.;
  vtkIdType Bytes = 0;
  double FineGridApplications = 0.;
  double EmittedPower = 0.;
  double AbsorbedPower = 0.;
  double EscapedPower = 0.;
  double LeakedPower = 0.;
  double EstimatedError = -1.;
  double EstimatedErrorL2 = -1.;
  double ActiveFraction = 1.;
  double PositivityBound = 0.;
  double StabilityBound = 0.;
  double UsedTimeStep = 0.;

  struct State;
  std::unique_ptr<State> Kept;
};

#endif
