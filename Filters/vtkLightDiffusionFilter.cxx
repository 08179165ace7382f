// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightDiffusionFilter.h"

#include "Core/Coarse.h"
#include "Core/Diffusion.h"
#include "Core/FirstMoment.h"
#include "Core/Seeds.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportCompat.h"
#include "vtkLightTransportInternal.h"
#include "vtkOpticalMediumFilter.h"

#include "vtkCellData.h"
#include "vtkCommand.h"
#include "vtkDataArrayRange.h"
#include "vtkDataSetAttributes.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkIntArray.h"
#include "vtkMatrix3x3.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkSmartPointer.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkStringArray.h"
#include "vtkUnsignedCharArray.h"
#include "vtkWeakPointer.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <list>
#include <new>
#include <sstream>
#include <vector>

vtkStandardNewMacro(vtkLightDiffusionFilter);

namespace
{
using lighttransport::ParallelFor;
using lighttransport::WatchedFor;

static_assert(
  static_cast<int>(lighttransport::StopReason::BadInput) == vtkLightDiffusionFilter::BadInput,
  "the filter's reasons are the core's");
static_assert(
  static_cast<int>(lighttransport::Boundary::Absorbing) == vtkLightDiffusionFilter::Absorbing,
  "the filter's boundaries are the core's");

/** What the operator was made of: enough to tell whether it still holds. */
struct MediumKey
{
  vtkWeakPointer<vtkDataArray> arrays[3];
  vtkMTimeType times[3] = { 0, 0, 0 };
  int dims[3] = { 0, 0, 0 };
  double spacing[3] = { 0., 0., 0. };
  int boundary = -1;
  double refractiveIndexRatio = 0.;
  bool moment = false; // for the first-moment solver

  void setArray(int i, vtkDataArray* array)
  {
    this->arrays[i] = array;
    this->times[i] = array ? array->GetMTime() : 0;
  }
  bool operator==(const MediumKey& other) const
  {
    for (int i = 0; i < 3; ++i)
    {
      if (this->arrays[i] != other.arrays[i] || this->times[i] != other.times[i] ||
        this->dims[i] != other.dims[i] || this->spacing[i] != other.spacing[i])
      {
        return false;
      }
    }
    return this->boundary == other.boundary && this->moment == other.moment &&
      this->refractiveIndexRatio == other.refractiveIndexRatio;
  }
};

/** The largest magnitude; bad: the first value that is not finite, if any. */
template <class T>
double largestOf(
  const T* values, vtkIdType size, const lighttransport::ParallelFor& parallel, vtkIdType& bad)
{
  constexpr vtkIdType piece = 65536;
  struct Found
  {
    double largest = 0.;
    vtkIdType bad = -1;
  };
  std::vector<Found> pieces(static_cast<std::size_t>((size + piece - 1) / piece));
  parallel(static_cast<std::int64_t>(pieces.size()),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t p = begin; p < end; ++p)
      {
        const vtkIdType last = std::min<vtkIdType>(size, (p + 1) * piece);
        T most = T(0);
        Found& found = pieces[static_cast<std::size_t>(p)];
        for (vtkIdType i = p * piece; i < last; ++i)
        {
          const bool finite = std::isfinite(values[i]); // a NaN must not be compared
          const T v = finite ? std::abs(values[i]) : T(0);
          most = v > most ? v : most;
          found.bad = finite || found.bad >= 0 ? found.bad : i;
        }
        found.largest = static_cast<double>(most);
      }
    });
  Found all;
  for (const Found& found : pieces)
  {
    all.largest = std::max(all.largest, found.largest);
    all.bad = all.bad < 0 ? found.bad : all.bad;
  }
  bad = all.bad;
  return all.largest;
}

/** The array's values as they lie in memory, or converted where their type is another. */
template <class T, class ArrayT>
const T* valuesOf(
  vtkDataArray* array, lighttransport::Buffer<T>& converted, const WatchedFor& parallel)
{
  if (auto typed = ArrayT::FastDownCast(array))
  {
    return typed->GetPointer(0);
  }
  converted.allocate(array->GetNumberOfTuples());
  parallel(converted.size(),
    [&](std::int64_t begin, std::int64_t end)
    {
      const auto range = vtk::DataArrayValueRange<1>(array, begin, end);
      std::transform(range.begin(), range.end(), converted.data() + begin,
        [](double value) { return static_cast<T>(value); });
    });
  return converted.data();
}

/**
 * The field in the array that the output gets, and its largest magnitude; what float cannot hold
 * is cut off there.
 */
template <class ArrayT>
double fill(ArrayT* array, const double* phi, vtkIdType size, const ParallelFor& parallel)
{
  using Value = typename ArrayT::ValueType;
  array->SetNumberOfTuples(size);
  Value* to = array->GetPointer(0);
  lighttransport::PreferLargePages(to, static_cast<std::size_t>(size) * sizeof(Value));
  constexpr double limit = static_cast<double>(std::numeric_limits<Value>::max());
  constexpr vtkIdType piece = 16384;
  std::vector<double> most(static_cast<std::size_t>((size + piece - 1) / piece), 0.);
  parallel(static_cast<std::int64_t>(most.size()),
    [&](std::int64_t begin, std::int64_t end)
    {
      for (std::int64_t p = begin; p < end; ++p)
      {
        double above = 0.;
        double below = 0.;
        for (vtkIdType i = p * piece; i < std::min<vtkIdType>(size, (p + 1) * piece); ++i)
        {
          const double v = phi[i];
          above = v > above ? v : above;
          below = v < below ? v : below;
          to[i] = static_cast<Value>(v > limit ? limit : v < -limit ? -limit : v);
        }
        most[static_cast<std::size_t>(p)] = std::max(above, -below);
      }
    });
  return *std::max_element(most.begin(), most.end());
}
} // namespace

//------------------------------------------------------------------------------
struct vtkLightDiffusionFilter::State
{
  /** The fluence of one sphere of power 1. */
  struct Solution
  {
    lighttransport::SphereSource sphere; // of power 1
    lighttransport::Buffer<double> phi;
  };
  std::list<Solution> solutions; // the last used first; of the operator that is kept

  /** phi = the sum of the spheres' fields, those that are not kept solved for first. */
  lighttransport::DiffusionReport superpose(vtkDataArray* spheres, double* phi,
    const lighttransport::DiffusionControl& control, int most, const WatchedFor& parallel);

  State()
    : solver(vtkLightTransportParallelFor())
  {
  }

  lighttransport::DiffusionSolver solver;
  std::unique_ptr<lighttransport::FirstMomentSolver> moment; // where the model is FirstMoment
  std::unique_ptr<lighttransport::CoarseDiffusion> coarse;   // where the grid is coarser
  MediumKey coarseKey;
  int coarseFactor = 0;
  // What the solver looks at again while the key holds, where the arrays themselves do not serve.
  lighttransport::Buffer<std::uint8_t> outside;
  lighttransport::Buffer<double> storedD, storedSigma;
  MediumKey key;
  bool valid = false;                 // the solver's operator is that of the key
  lighttransport::Buffer<double> phi; // the last state, where Continue asks for it
  // of AnisotropicDiffusion, made from the scalars
  vtkNew<vtkOpticalMediumFilter> conductance;
  MediumKey scalarsKey;
};

//------------------------------------------------------------------------------
lighttransport::DiffusionReport vtkLightDiffusionFilter::State::superpose(vtkDataArray* spheres,
  double* phi, const lighttransport::DiffusionControl& control, int most,
  const WatchedFor& parallel)
{
  using namespace lighttransport;
  DiffusionReport all;
  all.reason = StopReason::Converged;
  const Grid grid = this->solver.grid();
  const std::int64_t size = grid.size();
  parallel.whole()(
    size, [phi](std::int64_t begin, std::int64_t end) { std::fill(phi + begin, phi + end, 0.); });
  Showing show(control);
  int used = 0;
  for (vtkIdType s = 0; s < spheres->GetNumberOfTuples() && used < most; ++s)
  {
    SphereSource sphere;
    for (int d = 0; d < 3; ++d)
    {
      sphere.center[d] = spheres->GetComponent(s, d);
    }
    sphere.radius = spheres->GetComponent(s, 3);
    sphere.power = 1.;
    const double power = spheres->GetComponent(s, 4);
    auto found = std::find_if(this->solutions.begin(), this->solutions.end(),
      [&](const Solution& one)
      { return one.sphere.center == sphere.center && one.sphere.radius == sphere.radius; });
    if (found == this->solutions.end())
    {
      if (power == 0.)
      {
        continue;
      }
      Solution one;
      one.sphere = sphere;
      one.phi.allocate(size);
      Buffer<float> q(size);
      const SourceReport sources = ComputeSources(grid, { sphere }, {}, q.data(), parallel, {});
      if (sources.badSphere >= 0 || sources.badVoxel >= 0)
      {
        continue; // the sum of all is solved for as it is
      }
      DiffusionControl own = control;
      own.tolerance = 0.3 * control.tolerance;
      own.targetError = own.timeBudget = 0.; // a part of many sums to come
      own.intermediate = nullptr;
      const DiffusionReport report = this->solver.solveSteady(q.data(), one.phi.data(), own);
      all.iterations += report.iterations;
      all.seconds += report.seconds;
      all.fineApplications += report.fineApplications;
      if (report.reason != StopReason::Converged)
      {
        all.reason = report.reason;
        break; // cancelled, or no better: the solve of the sum tells
      }
      this->solutions.push_front(std::move(one));
    }
    else
    {
      this->solutions.splice(this->solutions.begin(), this->solutions, found);
    }
    ++used;
    const double* field = this->solutions.front().phi.data();
    parallel.whole()(size,
      [&](std::int64_t begin, std::int64_t end)
      {
        for (std::int64_t i = begin; i < end; ++i)
        {
          phi[i] += power * field[i];
        }
      });
    parallel.poll();
    show(phi);
  }
  while (static_cast<int>(this->solutions.size()) > most)
  {
    this->solutions.pop_back();
  }
  return all;
}

//------------------------------------------------------------------------------
vtkLightDiffusionFilter::vtkLightDiffusionFilter()
  : Kept(new State)
{
  this->SetInputArrayToProcess(
    0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, vtkDataSetAttributes::SCALARS);
}

vtkLightDiffusionFilter::~vtkLightDiffusionFilter() = default;

//------------------------------------------------------------------------------
void vtkLightDiffusionFilter::ResetState()
{
  if (!this->Kept->phi.empty())
  {
    this->Kept->phi.release();
    this->Modified();
  }
}

//------------------------------------------------------------------------------
vtkImageData* vtkLightDiffusionFilter::GetIntermediateOutput()
{
  return this->IntermediateOutput;
}

//------------------------------------------------------------------------------
int vtkLightDiffusionFilter::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkImageData");
  return 1;
}

int vtkLightDiffusionFilter::RequestInformation(
  vtkInformation*, vtkInformationVector** inputVector, vtkInformationVector* outputVector)
{
  // Light reaches everywhere: the whole image is asked for and made.
  vtkInformation* in = inputVector[0]->GetInformationObject(0);
  int whole[6] = { 0, -1, 0, -1, 0, -1 };
  in->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), whole);
  outputVector->GetInformationObject(0)->Set(
    vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), whole, 6);
  return 1;
}

int vtkLightDiffusionFilter::RequestUpdateExtent(
  vtkInformation*, vtkInformationVector** inputVector, vtkInformationVector* outputVector)
{
  vtkInformation* in = inputVector[0]->GetInformationObject(0);
  int whole[6] = { 0, -1, 0, -1, 0, -1 };
  in->Get(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), whole);
  in->Set(vtkStreamingDemandDrivenPipeline::UPDATE_EXTENT(), whole, 6);
  vtkInformation* out = outputVector->GetInformationObject(0);
  out->Set(vtkStreamingDemandDrivenPipeline::UPDATE_EXTENT(), whole, 6);
  return 1;
}

//------------------------------------------------------------------------------
void vtkLightDiffusionFilter::ClearReport()
{
  this->StopReason = BadInput;
  this->Message.clear();
  this->NumberOfIterationsUsed = 0;
  this->Residual = -1.;
  this->SolveSeconds = 0.;
  this->Bytes = 0;
  this->FineGridApplications = 0.;
  this->EmittedPower = this->AbsorbedPower = this->EscapedPower = this->LeakedPower = 0.;
  this->EstimatedError = this->EstimatedErrorL2 = -1.;
  this->ActiveFraction = 1.;
  this->PositivityBound = this->StabilityBound = this->UsedTimeStep = 0.;
  this->ComputedGradientScale = 0.;
  this->UsedCoarseningFactor = 1;
}

//------------------------------------------------------------------------------
bool vtkLightDiffusionFilter::CheckParameters(std::string& problem) const
{
  std::ostringstream text;
  if (this->Model != Diffusion && this->Model != AnisotropicDiffusion && this->Model != FirstMoment)
  {
    text << "Model is " << this->Model
         << "; expected Diffusion, AnisotropicDiffusion or FirstMoment";
  }
  else if (this->Mode != Steady && this->Mode != Explicit && this->Mode != Implicit)
  {
    text << "Mode is " << this->Mode << "; expected Steady, Explicit or Implicit";
  }
  else if (this->Model == AnisotropicDiffusion && this->Mode == Steady)
  {
    text << "Mode is Steady with the model AnisotropicDiffusion, which has no absorption and ends "
            "in a constant; expected Explicit or Implicit with a bounded NumberOfSteps";
  }
  else if (this->Model == FirstMoment && this->Mode == Implicit)
  {
    text << "Mode is Implicit with the model FirstMoment; expected Explicit, or Steady";
  }
  else if (this->LocalTimeStep && this->Mode == Explicit &&
    (this->Model != Diffusion || this->TimeStep != 0. || this->CourantNumber > 1.))
  {
    text << "LocalTimeStep is on with the model "
         << (this->Model == FirstMoment
                ? "FirstMoment"
                : (this->Model == Diffusion ? "Diffusion" : "AnisotropicDiffusion"))
         << ", TimeStep " << this->TimeStep << " and CourantNumber " << this->CourantNumber
         << "; expected Diffusion, 0 and a number in (0, 1]";
  }
  else if (this->ImplicitScheme != BackwardEuler && this->ImplicitScheme != SecondOrder)
  {
    text << "ImplicitScheme is " << this->ImplicitScheme
         << "; expected BackwardEuler or SecondOrder";
  }
  else if (this->Boundary != Robin && this->Boundary != ZeroFlux && this->Boundary != Absorbing)
  {
    text << "Boundary is " << this->Boundary << "; expected Robin, ZeroFlux or Absorbing";
  }
  else if (this->FluxFunction != Exponential && this->FluxFunction != Rational)
  {
    text << "FluxFunction is " << this->FluxFunction << "; expected Exponential or Rational";
  }
  else if (!std::isfinite(this->Tolerance) || this->Tolerance <= 0. || this->Tolerance >= 1.)
  {
    text << "Tolerance is " << this->Tolerance << "; expected a number in (0, 1)";
  }
  else if (this->MaximumNumberOfIterations < 1)
  {
    text << "MaximumNumberOfIterations is " << this->MaximumNumberOfIterations
         << "; expected at least 1";
  }
  else if (this->Mode != Steady && this->NumberOfSteps < 1)
  {
    text << "NumberOfSteps is " << this->NumberOfSteps << "; expected at least 1";
  }
  else if (!std::isfinite(this->CourantNumber) || this->CourantNumber <= 0.)
  {
    text << "CourantNumber is " << this->CourantNumber << "; expected a number > 0";
  }
  else if (!std::isfinite(this->TimeStep) || this->TimeStep < 0.)
  {
    text << "TimeStep is " << this->TimeStep << "; expected a length >= 0 (0: from CourantNumber)";
  }
  else if (!std::isfinite(this->RefractiveIndexRatio) || this->RefractiveIndexRatio <= 0.)
  {
    text << "RefractiveIndexRatio is " << this->RefractiveIndexRatio << "; expected a number > 0";
  }
  else if (!std::isfinite(this->GradientScale) || this->GradientScale < 0.)
  {
    text << "GradientScale is " << this->GradientScale
         << "; expected a number >= 0 (0: chosen from the data)";
  }
  else if (this->MaximumNumberOfKeptSolutions < 1)
  {
    text << "MaximumNumberOfKeptSolutions is " << this->MaximumNumberOfKeptSolutions
         << "; expected at least 1";
  }
  else if (!std::isfinite(this->ActiveThreshold) || this->ActiveThreshold <= 0. ||
    this->ActiveThreshold >= 1.)
  {
    text << "ActiveThreshold is " << this->ActiveThreshold << "; expected a number in (0, 1)";
  }
  else if (this->CoarseningFactor != 1 && this->CoarseningFactor != 2 &&
    this->CoarseningFactor != 4)
  {
    text << "CoarseningFactor is " << this->CoarseningFactor << "; expected 1, 2 or 4";
  }
  else if (!std::isfinite(this->TargetError) || this->TargetError < 0. || this->TargetError >= 1.)
  {
    text << "TargetError is " << this->TargetError
         << "; expected a number in [0, 1) (0: Tolerance)";
  }
  else if (!std::isfinite(this->TimeBudget) || this->TimeBudget < 0.)
  {
    text << "TimeBudget is " << this->TimeBudget << "; expected seconds >= 0 (0: no limit)";
  }
  else if (!std::isfinite(this->IntermediateInterval) || this->IntermediateInterval < 0.)
  {
    text << "IntermediateInterval is " << this->IntermediateInterval
         << "; expected seconds >= 0 (0: never)";
  }
  else if (this->OutputPrecision != SINGLE_PRECISION && this->OutputPrecision != DOUBLE_PRECISION &&
    this->OutputPrecision != DEFAULT_PRECISION)
  {
    text << "OutputPrecision is " << this->OutputPrecision
         << "; expected SINGLE_PRECISION, DOUBLE_PRECISION or DEFAULT_PRECISION";
  }
  problem = text.str();
  return problem.empty();
}

//------------------------------------------------------------------------------
int vtkLightDiffusionFilter::RequestData(
  vtkInformation*, vtkInformationVector** inputVector, vtkInformationVector* outputVector)
{
  vtkImageData* input = vtkImageData::GetData(inputVector[0]);
  vtkImageData* output = vtkImageData::GetData(outputVector);
  this->ClearReport();
  std::string problem;
  bool ok = false;
  if (!input)
  {
    problem = "there is no input; expected an image";
  }
  else
  {
    try
    {
      const auto solve = [&]
      {
        try
        {
          return this->Solve(input, output, problem);
        }
        catch (const lighttransport::Interrupted&)
        {
          this->WriteStart(input, output);
          return true;
        }
      };
      ok = this->CheckParameters(problem) && solve();
    }
    catch (const std::bad_alloc&)
    {
      const double megabytes = 64e-6 * static_cast<double>(input->GetNumberOfPoints());
      std::ostringstream text;
      text << "not enough memory to solve on " << input->GetNumberOfPoints()
           << " points; expected about " << std::ceil(megabytes)
           << " MB free. Solve on a coarser image (vtkImageResample) or on a part of it "
              "(vtkExtractVOI)";
      problem = text.str();
      this->Kept.reset(new State);
    }
  }
  if (!ok)
  {
    this->Message = problem;
    output->Initialize();
    vtkErrorMacro(<< problem);
    return 0;
  }
  return 1;
}

//------------------------------------------------------------------------------
bool vtkLightDiffusionFilter::Solve(vtkImageData* input, vtkImageData* output, std::string& problem)
{
  namespace names = vtkLightTransportArrays;
  using lighttransport::DiffusionReport;
  State& kept = *this->Kept;

  const auto began = std::chrono::steady_clock::now();
  // Told and asked while anything lasts: Interrupted where the answer is to stop.
  const lighttransport::ProgressFunction progress = [this](double fraction)
  {
    this->UpdateProgress(std::max(fraction, this->GetProgress()));
    return !vtkLightTransportCheckAbort(this);
  };
  const WatchedFor parallel(vtkLightTransportParallelFor());
  const WatchedFor::Asking asking(parallel, progress);

  // 1. check the input
  std::ostringstream text;
  const vtkIdType size = input->GetNumberOfPoints();
  if (size < 1)
  {
    problem = "the image is empty; expected at least one point";
    return false;
  }
  double spacing[3];
  input->GetSpacing(spacing);
  for (const double s : spacing)
  {
    if (!std::isfinite(s) || s <= 0.)
    {
      text << "the spacing is (" << spacing[0] << ", " << spacing[1] << ", " << spacing[2]
           << "); expected three lengths > 0";
      problem = text.str();
      return false;
    }
  }
  const bool anisotropic = this->Model == AnisotropicDiffusion;
  const bool moment = this->Model == FirstMoment && this->Mode == Explicit;
  const auto find = [&](vtkImageData* image, const char* name) -> vtkDataArray*
  {
    vtkDataArray* array = image->GetPointData()->GetArray(name);
    if (!array)
    {
      text << "the point array " << name << " is missing";
      if (image->GetCellData()->GetArray(name))
      {
        text << " (a cell array has that name)";
      }
      text << "; expected one of "
           << (std::string(name) == names::Source ? "vtkLightSeedFilter"
                                                  : "vtkOpticalMediumFilter");
    }
    else if (array->GetNumberOfComponents() != 1 || array->GetNumberOfTuples() != size)
    {
      text << "the point array " << name << " has " << array->GetNumberOfTuples() << " tuples of "
           << array->GetNumberOfComponents() << " components; expected " << size << " of 1";
      array = nullptr;
    }
    problem = text.str();
    return array;
  };
  vtkDataArray* source = find(input, names::Source);
  if (!source)
  {
    return false;
  }
  vtkDataArray* D = nullptr;
  vtkDataArray* sigma_a = nullptr;
  if (anisotropic)
  {
    // The conductance is the gradient mapping of the static scalars, with their own filter.
    vtkDataArray* scalars = this->GetInputArrayToProcess(0, input);
    if (!scalars || !scalars->GetName())
    {
      problem = "AnisotropicDiffusion found no named point scalars; expected the volume whose "
                "gradient guides the light (SetInputArrayToProcess)";
      return false;
    }
    vtkOpticalMediumFilter* medium = kept.conductance;
    MediumKey scalarsKey;
    scalarsKey.setArray(0, scalars);
    scalarsKey.setArray(1, input->GetPointGhostArray());
    input->GetDimensions(scalarsKey.dims);
    std::copy(spacing, spacing + 3, scalarsKey.spacing);
    if (!(scalarsKey == kept.scalarsKey))
    {
      vtkNew<vtkImageData> volume;
      volume->CopyStructure(input);
      volume->GetPointData()->SetScalars(scalars);
      if (vtkUnsignedCharArray* hiding = input->GetPointGhostArray())
      {
        volume->GetPointData()->AddArray(hiding);
      }
      medium->SetInputData(volume);
      kept.scalarsKey = scalarsKey;
    }
    medium->SetDiffusionMapping(vtkOpticalMediumFilter::FromScalarGradient);
    medium->SetGradientFunction(this->FluxFunction == Rational
        ? vtkOpticalMediumFilter::Rational
        : vtkOpticalMediumFilter::Exponential);
    medium->SetGradientScale(this->GradientScale);
    const unsigned long tag =
      medium->AddObserver(vtkCommand::ProgressEvent, this, &vtkLightDiffusionFilter::PassAbort);
    medium->Update();
    medium->RemoveObserver(tag);
    if (medium->GetAbortExecute())
    {
      medium->Modified(); // half of it
      throw lighttransport::Interrupted();
    }
    this->ComputedGradientScale = medium->GetComputedGradientScale();
    D = medium->GetOutput()->GetPointData()->GetArray(names::DiffusionCoefficient);
    if (!D)
    {
      problem = "no conductance could be made from the scalars";
      return false;
    }
  }
  else
  {
    D = find(input, names::DiffusionCoefficient);
    sigma_a = D ? find(input, names::Absorption) : nullptr;
    if (!sigma_a)
    {
      return false;
    }
  }
  vtkUnsignedCharArray* ghosts = input->GetPointGhostArray();
  const std::uint8_t* outside = nullptr;
  if (ghosts && ghosts->GetNumberOfTuples() == size)
  {
    const unsigned char* flags = ghosts->GetPointer(0);
    constexpr unsigned char hidden = vtkDataSetAttributes::HIDDENPOINT;
    std::atomic<bool> any{ false };
    parallel(size,
      [&](std::int64_t begin, std::int64_t end)
      {
        any = any ||
          std::any_of(flags + begin, flags + end, [](unsigned char f) { return f & hidden; });
      });
    if (any)
    {
      // in place: a solver that is kept looks at it
      if (kept.outside.size() != size)
      {
        kept.outside.allocate(size);
      }
      parallel.whole()(size,
        [&](std::int64_t begin, std::int64_t end)
        {
          std::transform(flags + begin, flags + end, kept.outside.data() + begin,
            [](unsigned char f) { return static_cast<std::uint8_t>(f & hidden ? 1 : 0); });
        });
      outside = kept.outside.data();
    }
  }

  // Double sources stay double; all others are float.
  const bool doubleSource = source->GetDataType() != VTK_FLOAT;
  lighttransport::Buffer<float> floatStore;
  lighttransport::Buffer<double> doubleStore;
  const float* qFloat = nullptr;
  const double* qDouble = nullptr;
  if (doubleSource)
  {
    qDouble = valuesOf<double, vtkDoubleArray>(source, doubleStore, parallel);
  }
  else
  {
    qFloat = valuesOf<float, vtkFloatArray>(source, floatStore, parallel);
  }
  vtkIdType bad = -1;
  const double largest =
    doubleSource ? largestOf(qDouble, size, parallel, bad) : largestOf(qFloat, size, parallel, bad);
  if (bad >= 0)
  {
    int dims[3];
    input->GetDimensions(dims);
    const int* extent = input->GetExtent();
    text << "the source is " << (doubleSource ? qDouble[bad] : static_cast<double>(qFloat[bad]))
         << " at voxel (" << extent[0] + bad % dims[0] << ", "
         << extent[2] + (bad / dims[0]) % dims[1] << ", "
         << extent[4] + bad / (static_cast<vtkIdType>(dims[0]) * dims[1])
         << "); expected finite values (power/length^3)";
    problem = text.str();
    return false;
  }
  if (largest > 1e100)
  {
    text << "the source reaches " << largest << " power/length^3; expected at most 1e100";
    problem = text.str();
    return false;
  }
  if (outside)
  {
    // Light does not start outside the domain.
    const auto cut = [&](const auto*& q, auto& store)
    {
      using Value = std::decay_t<decltype(*q)>;
      lighttransport::Buffer<Value> inside(size);
      parallel(size,
        [&](std::int64_t begin, std::int64_t end)
        {
          for (std::int64_t i = begin; i < end; ++i)
          {
            inside[i] = outside[i] ? Value(0) : q[i];
          }
        });
      store = std::move(inside);
      q = store.data();
    };
    if (doubleSource)
    {
      cut(qDouble, doubleStore);
    }
    else
    {
      cut(qFloat, floatStore);
    }
  }

  // 2. the operator, unless the last one still holds
  MediumKey key;
  key.setArray(0, D);
  key.setArray(1, sigma_a);
  key.setArray(2, ghosts);
  input->GetDimensions(key.dims);
  std::copy(spacing, spacing + 3, key.spacing);
  key.boundary = this->Boundary;
  key.refractiveIndexRatio = this->RefractiveIndexRatio;
  key.moment = moment;
  // A named error or a time budget lets the filter choose. From the last state, cells of two voxels
  // and corrections by the full grid's equations come first: what has moved is smooth.
  const bool named = this->TargetError > 0. || this->TimeBudget > 0.;
  const bool chosen = this->Mode == Steady && named && !this->ActiveRegion &&
    this->CoarseningFactor == 1 && !this->KeepSolutions;
  const bool warm = chosen && this->Continue && kept.phi.size() == size &&
    ((kept.coarse && key == kept.coarseKey) || (kept.valid && key == kept.key));
  const bool coarse = this->Mode == Steady && (this->CoarseningFactor > 1 || warm);
  const bool active = this->Mode == Steady && !coarse && this->ActiveRegion;
  const auto withMedium = [&](auto&& action) -> DiffusionReport
  {
    const auto act = [&](auto zero, const auto* d, const auto* s) -> DiffusionReport
    {
      lighttransport::DiffusionMedium<decltype(zero)> medium;
      medium.grid.dims = { { key.dims[0], key.dims[1], key.dims[2] } };
      medium.grid.spacing = { { spacing[0], spacing[1], spacing[2] } };
      medium.D = d;
      medium.sigma_a = s;
      medium.outside = outside;
      medium.boundary = static_cast<lighttransport::Boundary>(this->Boundary);
      medium.refractiveIndexRatio = this->RefractiveIndexRatio;
      return action(medium);
    };
    // What a kept solver looks at again must lie in the arrays themselves, or be kept with it.
    vtkFloatArray* floatD = vtkFloatArray::FastDownCast(D);
    vtkFloatArray* floatSigma = vtkFloatArray::FastDownCast(sigma_a);
    if (floatD && (floatSigma || !sigma_a))
    {
      return act(0.f, floatD->GetPointer(0), floatSigma ? floatSigma->GetPointer(0) : nullptr);
    }
    return act(0., valuesOf<double, vtkDoubleArray>(D, kept.storedD, parallel),
      sigma_a ? valuesOf<double, vtkDoubleArray>(sigma_a, kept.storedSigma, parallel) : nullptr);
  };
  const auto orInterrupt = [](const DiffusionReport& report)
  {
    if (report.reason == lighttransport::StopReason::Cancelled)
    {
      throw lighttransport::Interrupted();
    }
  };
  double setupSeconds = 0.;
  const auto setUp = [&](auto& solver)
  {
    const DiffusionReport report =
      withMedium([&](const auto& medium) { return solver.setMedium(medium, progress); });
    orInterrupt(report);
    setupSeconds += report.seconds;
    problem = report.reason == lighttransport::StopReason::Converged ? "" : report.message;
    return problem.empty();
  };
  const auto setUpFull = [&]
  {
    if (kept.valid && key == kept.key)
    {
      return true;
    }
    kept.valid = false;
    kept.solutions.clear();
    kept.moment.reset(
      moment ? new lighttransport::FirstMomentSolver(vtkLightTransportParallelFor()) : nullptr);
    kept.valid = moment ? setUp(*kept.moment) : setUp(kept.solver);
    kept.key = key;
    return kept.valid;
  };
  const int factor = chosen ? 2 : this->CoarseningFactor;
  if (!(coarse && kept.coarse && key == kept.coarseKey) && !(kept.valid && key == kept.key))
  {
    kept.phi.release(); // of another medium
  }
  if (coarse)
  {
    if (!kept.coarse || factor != kept.coarseFactor || !(key == kept.coarseKey))
    {
      kept.coarse.reset();
      auto made = std::make_unique<lighttransport::CoarseDiffusion>(vtkLightTransportParallelFor());
      const DiffusionReport report = withMedium(
        [&](const auto& medium) { return made->setMedium(medium, factor, false, progress); });
      orInterrupt(report);
      if (report.reason != lighttransport::StopReason::Converged)
      {
        problem = report.message;
        return false;
      }
      setupSeconds = report.seconds;
      kept.coarse = std::move(made);
      kept.coarseKey = key;
      kept.coarseFactor = factor;
    }
  }
  else if (!active && !chosen && !setUpFull())
  {
    return false;
  }
  const bool bounds = !moment && !coarse && !active && !chosen;
  this->PositivityBound = bounds ? kept.solver.positivityBound() : 0.;
  this->StabilityBound = moment ? kept.moment->stabilityBound(progress)
    : bounds                    ? kept.solver.stabilityBound()
                                : 0.;
  if (moment && this->StabilityBound == 0.)
  {
    throw lighttransport::Interrupted();
  }

  // 3. solve
  lighttransport::Buffer<double> phi;
  bool started = false; // from the last state
  if (active)
  {
    phi.allocate(size);
    kept.valid = false; // the operator becomes the region's
  }
  else if (this->Continue && kept.phi.size() == size)
  {
    phi = std::move(kept.phi);
    started = true;
  }
  else
  {
    phi.allocate(size);
    if (moment)
    {
      kept.moment->reset();
    }
    if (anisotropic)
    {
      parallel(size,
        [&](std::int64_t begin, std::int64_t end)
        {
          for (std::int64_t i = begin; i < end; ++i)
          {
            phi[i] = doubleSource ? qDouble[i] : static_cast<double>(qFloat[i]);
          }
        });
    }
  }
  kept.phi.release();
  lighttransport::DiffusionControl control;
  control.tolerance = this->Tolerance;
  control.maxIterations = this->MaximumNumberOfIterations;
  control.implicitScheme = static_cast<lighttransport::ImplicitScheme>(this->ImplicitScheme);
  control.progress = progress;
  control.targetError = this->TargetError;
  // what is left of the budget, but for writing the output
  const auto timeLeft = [&]
  {
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - began;
    return std::max(1e-9, this->TimeBudget - spent.count() - 2e-9 * static_cast<double>(size));
  };
  if (this->IntermediateInterval > 0.)
  {
    control.intermediateInterval = this->IntermediateInterval;
    control.intermediate = [this, input, size, &parallel](const double* reached)
    {
      vtkNew<vtkFloatArray> array;
      array->SetName(names::Fluence);
      fill(array.Get(), reached, size, parallel.whole());
      this->IntermediateOutput = vtkSmartPointer<vtkImageData>::New();
      this->IntermediateOutput->CopyStructure(input);
      this->IntermediateOutput->GetPointData()->SetScalars(array);
      this->InvokeEvent(IntermediateEvent);
    };
  }
  const bool local = this->LocalTimeStep && this->Mode == Explicit;
  const double bound = moment ? kept.moment->courantBound() : this->PositivityBound;
  this->UsedTimeStep = this->Mode == Steady || local ? 0.
    : this->TimeStep > 0.                            ? this->TimeStep
                                                     : this->CourantNumber * bound;
  bool previewed = false; // as the least that can be done
  // What does for a named error or within a budget, in this order.
  const auto choose = [&](const auto* q) -> DiffusionReport
  {
    DiffusionReport before;
    before.reason = lighttransport::StopReason::BadInput;
    const double perPoint = this->TimeBudget / static_cast<double>(size);
    // Light that stays where it is: its region alone. To find out costs some per cent of a solve,
    // which goes on from what that came to.
    // A constant medium is solved for at once, where that is found out.
    const bool known = kept.valid && key == kept.key;
    const bool constant = known && kept.solver.hasConstantMedium();
    if (!constant && !(this->TimeBudget > 0. && this->TimeBudget < 0.06))
    {
      lighttransport::DiffusionSolver beside(vtkLightTransportParallelFor());
      lighttransport::DiffusionSolver& regional = known ? beside : kept.solver;
      kept.valid = known;
      lighttransport::DiffusionControl own = control;
      own.timeBudget = this->TimeBudget > 0. ? timeLeft() : 0.;
      own.regionOrNothing = true;
      own.fromZero = !started;
      own.largestRegion = 0.125;
      before = withMedium([&](const auto& medium)
        { return regional.solveActive(medium, q, phi.data(), own, this->ActiveThreshold); });
      if (regional.hasConstantMedium())
      {
        kept.solutions.clear();
        kept.moment.reset();
        kept.valid = true;
        kept.key = key;
        return before;
      }
      using lighttransport::StopReason;
      const bool whole = before.activeFraction == 1. && before.reason == StopReason::MaxIterations;
      const bool failed = before.reason == StopReason::NotFinite ||
        before.reason == StopReason::Breakdown || before.reason == StopReason::Diverged;
      if (!whole && !failed)
      {
        return before;
      }
      if (failed)
      {
        parallel.whole()(size,
          [&](std::int64_t begin, std::int64_t end)
          { std::fill(phi.data() + begin, phi.data() + end, 0.); });
      }
      setupSeconds += before.seconds;
      before.reason = lighttransport::StopReason::BadInput;
    }
    // A budget that the full grid's set-up may exceed. How fast this machine is today, its first
    // part tells: the rest, and one iteration, takes nine times as long.
    bool hasty = this->TimeBudget > 0. && perPoint < 25e-9 && !(kept.valid && key == kept.key);
    if (!hasty && this->TimeBudget > 0. && perPoint < 150e-9 && !(kept.valid && key == kept.key))
    {
      const double beforeSeconds = setupSeconds;
      if (!setUpFull())
      {
        before.message = problem;
        return before;
      }
      hasty = timeLeft() < 9. * (setupSeconds - beforeSeconds);
    }
    if (hasty)
    {
      std::fill(phi.data(), phi.data() + size, 0.); // what a region came to
      lighttransport::CoarseDiffusion preview(vtkLightTransportParallelFor());
      before = withMedium(
        [&](const auto& medium) { return preview.setMedium(medium, 4, true, progress); });
      if (before.reason != lighttransport::StopReason::Converged)
      {
        return before;
      }
      setupSeconds += before.seconds;
      this->UsedCoarseningFactor = 4;
      previewed = true;
      control.timeBudget = timeLeft();
      return preview.solve(q, phi.data(), control, false);
    }
    if (!setUpFull())
    {
      before.message = problem;
      return before;
    }
    control.timeBudget = this->TimeBudget > 0. ? timeLeft() : 0.;
    return kept.solver.solveSteady(q, phi.data(), control);
  };
  const bool toDouble = this->OutputPrecision == DOUBLE_PRECISION ||
    (this->OutputPrecision == DEFAULT_PRECISION && this->TargetError > 0. &&
      this->TargetError < 1e-6);
  const vtkSmartPointer<vtkDataArray> fluence =
    vtk::TakeSmartPointer(vtkDataArray::CreateDataArray(toDouble ? VTK_DOUBLE : VTK_FLOAT));
  if (moment || coarse)
  {
    // Little is freed before it is filled: who cancels does not wait for fresh memory.
    const auto touch = [&](auto* array)
    {
      array->SetNumberOfTuples(size);
      lighttransport::PreferLargePages(array->GetPointer(0),
        static_cast<std::size_t>(size) * static_cast<std::size_t>(array->GetDataTypeSize()));
      lighttransport::Touch(array->GetPointer(0), size, parallel);
    };
    toDouble ? touch(vtkDoubleArray::FastDownCast(fluence))
             : touch(vtkFloatArray::FastDownCast(fluence));
  }
  lighttransport::FirstMomentReport energies;
  const auto solve = [&](const auto* q) -> DiffusionReport
  {
    control.timeBudget = this->TimeBudget > 0. ? timeLeft() : 0.;
    if (moment)
    {
      energies = kept.moment->step(q, phi.data(), this->NumberOfSteps, this->UsedTimeStep, control);
      return energies;
    }
    if (local)
    {
      return kept.solver.stepLocal(q, phi, this->NumberOfSteps, this->CourantNumber, control);
    }
    if (coarse)
    {
      this->UsedCoarseningFactor = factor;
      DiffusionReport first = kept.coarse->solve(q, phi.data(), control, started && chosen);
      const bool stuck = first.reason != lighttransport::StopReason::Converged &&
        first.reason != lighttransport::StopReason::Cancelled;
      if (!chosen || !stuck || (this->TimeBudget > 0. && timeLeft() < 2. * setupSeconds))
      {
        return first;
      }
      // Where cells of two voxels do not do, the full grid goes on from what they have reached.
      this->UsedCoarseningFactor = 1;
      kept.coarse.reset();
      if (first.reason != lighttransport::StopReason::MaxIterations)
      {
        std::fill(phi.data(), phi.data() + size, 0.);
      }
      if (!setUpFull())
      {
        first.reason = lighttransport::StopReason::BadInput;
        return first;
      }
      control.timeBudget = this->TimeBudget > 0. ? timeLeft() : 0.;
      DiffusionReport full = kept.solver.solveSteady(q, phi.data(), control);
      full.iterations += first.iterations;
      full.fineApplications += first.fineApplications;
      full.seconds += first.seconds;
      full.bytes = std::max(full.bytes, first.bytes);
      return full;
    }
    if (chosen)
    {
      return choose(q);
    }
    if (active)
    {
      control.fromZero = true;
      return withMedium([&](const auto& medium)
        { return kept.solver.solveActive(medium, q, phi.data(), control, this->ActiveThreshold); });
    }
    switch (this->Mode)
    {
      case Explicit:
        return kept.solver.stepExplicit(q, phi, this->NumberOfSteps, this->UsedTimeStep, control);
      case Implicit:
        return kept.solver.stepImplicit(
          q, phi.data(), this->NumberOfSteps, this->UsedTimeStep, control);
      default:
      {
        vtkDataArray* spheres = input->GetFieldData()->GetArray(names::LightSeeds);
        if (!this->KeepSolutions || outside || !spheres || spheres->GetNumberOfComponents() != 5 ||
          spheres->GetNumberOfTuples() == 0)
        {
          return kept.solver.solveSteady(q, phi.data(), control);
        }
        const DiffusionReport parts = kept.superpose(
          spheres, phi.data(), control, this->MaximumNumberOfKeptSolutions, parallel);
        orInterrupt(parts);
        // The rest (paint, strokes) and the check of the residual.
        DiffusionReport sum = kept.solver.solveSteady(q, phi.data(), control);
        sum.iterations += parts.iterations;
        sum.seconds += parts.seconds;
        sum.fineApplications += parts.fineApplications;
        sum.bytes += static_cast<std::int64_t>(kept.solutions.size()) * size * 8;
        return sum;
      }
    }
  };
  DiffusionReport report;
  try
  {
    if (anisotropic)
    {
      report = solve(static_cast<const float*>(nullptr));
    }
    else
    {
      report = doubleSource ? solve(qDouble) : solve(qFloat);
    }
  }
  catch (const lighttransport::Interrupted&)
  {
    report.reason = lighttransport::StopReason::Cancelled;
    report.message = "cancelled between two solves";
  }
  this->StopReason = static_cast<int>(report.reason);
  this->Message = report.message;
  this->NumberOfIterationsUsed = report.iterations;
  this->Residual = report.residual;
  this->SolveSeconds = report.seconds + setupSeconds;
  this->Bytes = static_cast<vtkIdType>(report.bytes);
  this->FineGridApplications = report.fineApplications;
  this->EmittedPower = report.emitted;
  this->AbsorbedPower = report.absorbed;
  this->EscapedPower = report.escaped;
  this->LeakedPower = report.leaked;
  // what rounding the output adds: 2^-24 at the most
  const auto rounded = [toDouble](double estimate, double rounding)
  { return estimate < 0. || toDouble ? estimate : std::hypot(estimate, rounding); };
  this->EstimatedError = rounded(report.estimatedError, 5.5e-8);
  this->EstimatedErrorL2 = rounded(report.estimatedErrorL2, 3e-8);
  this->ActiveFraction = report.activeFraction;

  const bool usable = this->StopReason == Converged || this->StopReason == MaxIterations ||
    this->StopReason == Breakdown || this->StopReason == Cancelled;
  if (!usable)
  {
    text << this->GetStopReasonAsString() << " after " << this->NumberOfIterationsUsed
         << " iterations";
    problem = report.message.empty() ? text.str() : report.message;
    return false;
  }
  if (this->StopReason == Converged && this->TargetError > 0. &&
    this->EstimatedError > this->TargetError)
  {
    text << (this->Message.empty() ? "" : "; ")
         << "the tolerance ended the solve before the named error was reached";
    this->Message += text.str();
    text.str("");
  }
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - began;
  if (this->TimeBudget > 0. &&
    spent.count() > this->TimeBudget + std::max(0.1 * this->TimeBudget, 0.01))
  {
    text << (this->Message.empty() ? "" : "; ") << "the time budget is "
         << (previewed ? "below the floor: the least that is done took " : "overrun: it took ")
         << spent.count() << " s instead of " << this->TimeBudget;
    this->Message += text.str();
    text.str("");
  }
  const bool stepsDone = this->Mode != Steady && this->StopReason == MaxIterations &&
    (this->Mode == Explicit || report.message.empty());
  // a coarser grid's answer has an estimated error instead of the tolerance
  const bool asAsked = stepsDone ||
    ((this->TimeBudget > 0. || (coarse && !chosen && this->TargetError == 0.)) &&
      this->EstimatedError >= 0.);
  if (this->StopReason == Breakdown || (this->StopReason == MaxIterations && !asAsked))
  {
    std::ostringstream residual;
    if (this->Residual < 0.)
    {
      residual << "not known";
    }
    else
    {
      residual << this->Residual << " instead of <= " << this->Tolerance;
    }
    vtkWarningMacro(<< this->GetStopReasonAsString() << " after " << this->NumberOfIterationsUsed
                    << " iterations: the relative residual is " << residual.str()
                    << (report.message.empty() ? "" : " (") << report.message
                    << (report.message.empty() ? "" : ")") << "; the best answer is kept");
  }

  // 4. the arrays
  if (toDouble)
  {
    fill(vtkDoubleArray::FastDownCast(fluence), phi.data(), size, parallel.whole());
  }
  else
  {
    const double extreme =
      fill(vtkFloatArray::FastDownCast(fluence), phi.data(), size, parallel.whole());
    if (extreme > static_cast<double>(std::numeric_limits<float>::max()))
    {
      text << "the fluence reaches " << extreme
           << ", which float cannot hold; expected OutputPrecision = DOUBLE_PRECISION, or less "
              "power";
      problem = text.str();
      this->StopReason = NotFinite; // as a float
      return false;
    }
  }
  output->ShallowCopy(input);
  fluence->SetName(names::Fluence);
  output->GetPointData()->AddArray(fluence);
  // Who cancels gets the fluence at once, and it alone.
  const auto addFlux = [&](auto&& array)
  {
    if ((coarse || chosen) && !setUpFull()) // the faces
    {
      return false;
    }
    array->SetName(names::Flux);
    array->SetNumberOfComponents(3);
    array->SetNumberOfTuples(size);
    auto* E = array->GetPointer(0);
    using Value = std::remove_pointer_t<decltype(E)>;
    lighttransport::PreferLargePages(E, 3 * static_cast<std::size_t>(size) * sizeof(Value));
    if (!(moment ? kept.moment->flux(phi.data(), E, progress)
                 : kept.solver.flux(phi.data(), E, progress)))
    {
      throw lighttransport::Interrupted();
    }
    vtkMatrix3x3* direction = input->GetDirectionMatrix();
    if (!direction->IsIdentity())
    {
      parallel(size,
        [&](std::int64_t begin, std::int64_t end)
        {
          for (std::int64_t i = begin; i < end; ++i)
          {
            const double along[3] = { static_cast<double>(E[3 * i]),
              static_cast<double>(E[3 * i + 1]), static_cast<double>(E[3 * i + 2]) };
            double world[3];
            direction->MultiplyPoint(along, world);
            for (int d = 0; d < 3; ++d)
            {
              E[3 * i + d] = static_cast<Value>(world[d]);
            }
          }
        });
    }
    output->GetPointData()->AddArray(array);
    return true;
  };
  if (this->ComputeFlux && this->StopReason != Cancelled)
  {
    try
    {
      if (!(toDouble ? addFlux(vtkSmartPointer<vtkDoubleArray>::New())
                     : addFlux(vtkSmartPointer<vtkFloatArray>::New())))
      {
        return false;
      }
    }
    catch (const lighttransport::Interrupted&)
    {
      this->StopReason = Cancelled;
      this->Message = "cancelled before the flux was there; the fluence is the one solved for";
    }
  }
  output->GetPointData()->SetActiveScalars(names::Fluence);
  this->WriteReport(output);
  if (moment)
  {
    // over this execution, as energy times c; emitted = absorbed + escaped + stored
    const auto number = [output](const char* name, double value)
    {
      vtkNew<vtkDoubleArray> array;
      array->SetName(name);
      array->InsertNextValue(value);
      output->GetFieldData()->AddArray(array);
    };
    number("LightDiffusionReport.EmittedEnergy", energies.emittedEnergy);
    number("LightDiffusionReport.AbsorbedEnergy", energies.absorbedEnergy);
    number("LightDiffusionReport.EscapedEnergy", energies.escapedEnergy);
    number("LightDiffusionReport.StoredEnergy", energies.storedEnergy);
  }
  if (this->Continue)
  {
    kept.phi = std::move(phi);
  }
  return true;
}

//------------------------------------------------------------------------------
void vtkLightDiffusionFilter::WriteStart(vtkImageData* input, vtkImageData* output)
{
  const vtkIdType size = input->GetNumberOfPoints();
  this->StopReason = Cancelled;
  this->Message = "cancelled before the solve began; the field is the one before";
  this->Residual = -1.;
  vtkSmartPointer<vtkDataArray> fluence = vtk::TakeSmartPointer(vtkDataArray::CreateDataArray(
    this->OutputPrecision == DOUBLE_PRECISION ? VTK_DOUBLE : VTK_FLOAT));
  const lighttransport::Buffer<double>& last = this->Kept->phi;
  if (this->Continue && last.size() == size)
  {
    const ParallelFor parallel = vtkLightTransportParallelFor();
    auto* narrow = vtkFloatArray::FastDownCast(fluence);
    narrow ? fill(narrow, last.data(), size, parallel)
           : fill(vtkDoubleArray::FastDownCast(fluence), last.data(), size, parallel);
  }
  else
  {
    // zeros that are no memory until they are read
    void* zeros = std::calloc(
      static_cast<std::size_t>(size), static_cast<std::size_t>(fluence->GetDataTypeSize()));
    if (!zeros)
    {
      throw std::bad_alloc();
    }
    fluence->SetVoidArray(zeros, size, 0, vtkAbstractArray::VTK_DATA_ARRAY_FREE);
  }
  fluence->SetName(vtkLightTransportArrays::Fluence);
  output->ShallowCopy(input);
  output->GetPointData()->AddArray(fluence);
  output->GetPointData()->SetActiveScalars(vtkLightTransportArrays::Fluence);
  this->WriteReport(output);
}

//------------------------------------------------------------------------------
void vtkLightDiffusionFilter::PassAbort(vtkObject* inner, unsigned long, void*)
{
  this->UpdateProgress(this->GetProgress());
  if (vtkLightTransportCheckAbort(this))
  {
    vtkAlgorithm::SafeDownCast(inner)->SetAbortExecute(1);
  }
}

//------------------------------------------------------------------------------
void vtkLightDiffusionFilter::WriteReport(vtkImageData* output) const
{
  vtkFieldData* field = output->GetFieldData();
  const auto name = [](const char* what) { return std::string("LightDiffusionReport.") + what; };
  const auto number = [&](const char* what, double value)
  {
    vtkNew<vtkDoubleArray> array;
    array->SetName(name(what).c_str());
    array->InsertNextValue(value);
    field->AddArray(array);
  };
  const auto word = [&](const char* what, const char* value)
  {
    vtkNew<vtkStringArray> array;
    array->SetName(name(what).c_str());
    array->InsertNextValue(value);
    field->AddArray(array);
  };
  static const char* const models[] = { "Diffusion", "AnisotropicDiffusion", "FirstMoment" };
  static const char* const modes[] = { "Steady", "Explicit", "Implicit" };
  static const char* const boundaries[] = { "Robin", "ZeroFlux", "Absorbing" };
  word("Model", models[this->Model]);
  word("Mode", modes[this->Mode]);
  word("Boundary", boundaries[this->Boundary]);
  number("RefractiveIndexRatio", this->RefractiveIndexRatio);
  number("Tolerance", this->Tolerance);
  number("TimeStep", this->UsedTimeStep);
  number("LocalTimeStep", this->LocalTimeStep && this->Mode == Explicit ? 1. : 0.);
  if (this->Mode == Implicit)
  {
    word("ImplicitScheme", this->ImplicitScheme == SecondOrder ? "SecondOrder" : "BackwardEuler");
  }
  word("StopReason", this->GetStopReasonAsString());
  word("Message", this->Message.c_str());
  number("Iterations", this->NumberOfIterationsUsed);
  number("Residual", this->Residual);
  number("Seconds", this->SolveSeconds);
  number("Bytes", static_cast<double>(this->Bytes));
  number("EmittedPower", this->EmittedPower);
  number("AbsorbedPower", this->AbsorbedPower);
  number("EscapedPower", this->EscapedPower);
  number("LeakedPower", this->LeakedPower);
  number("ActiveFraction", this->ActiveFraction);
  number("CoarseningFactor", this->UsedCoarseningFactor);
  number("EstimatedError", this->EstimatedError);
  number("EstimatedErrorL2", this->EstimatedErrorL2);
}

//------------------------------------------------------------------------------
const char* vtkLightDiffusionFilter::GetStopReasonAsString() const
{
  return lighttransport::ToString(static_cast<lighttransport::StopReason>(this->StopReason));
}

//------------------------------------------------------------------------------
void vtkLightDiffusionFilter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Model: " << this->Model << "\n";
  os << indent << "Mode: " << this->Mode << "\n";
  os << indent << "Boundary: " << this->Boundary << "\n";
  os << indent << "RefractiveIndexRatio: " << this->RefractiveIndexRatio << "\n";
  os << indent << "Tolerance: " << this->Tolerance << "\n";
  os << indent << "MaximumNumberOfIterations: " << this->MaximumNumberOfIterations << "\n";
  os << indent << "NumberOfSteps: " << this->NumberOfSteps << "\n";
  os << indent << "CourantNumber: " << this->CourantNumber << "\n";
  os << indent << "TimeStep: " << this->TimeStep << "\n";
  os << indent << "LocalTimeStep: " << this->LocalTimeStep << "\n";
  os << indent << "ImplicitScheme: " << this->ImplicitScheme << "\n";
  os << indent << "FluxFunction: " << this->FluxFunction << "\n";
  os << indent << "GradientScale: " << this->GradientScale << "\n";
  os << indent << "ComputedGradientScale: " << this->ComputedGradientScale << "\n";
  os << indent << "ComputeFlux: " << this->ComputeFlux << "\n";
  os << indent << "Continue: " << this->Continue << "\n";
  os << indent << "OutputPrecision: " << this->OutputPrecision << "\n";
  os << indent << "StopReason: " << this->GetStopReasonAsString() << "\n";
  os << indent << "Message: " << this->Message << "\n";
  os << indent << "NumberOfIterationsUsed: " << this->NumberOfIterationsUsed << "\n";
  os << indent << "Residual: " << this->Residual << "\n";
  os << indent << "SolveSeconds: " << this->SolveSeconds << "\n";
  os << indent << "Bytes: " << this->Bytes << "\n";
  os << indent << "FineGridApplications: " << this->FineGridApplications << "\n";
  os << indent << "EmittedPower: " << this->EmittedPower << "\n";
  os << indent << "AbsorbedPower: " << this->AbsorbedPower << "\n";
  os << indent << "EscapedPower: " << this->EscapedPower << "\n";
  os << indent << "LeakedPower: " << this->LeakedPower << "\n";
  os << indent << "KeepSolutions: " << this->KeepSolutions << "\n";
  os << indent << "MaximumNumberOfKeptSolutions: " << this->MaximumNumberOfKeptSolutions << "\n";
  os << indent << "ActiveRegion: " << this->ActiveRegion << "\n";
  os << indent << "ActiveThreshold: " << this->ActiveThreshold << "\n";
  os << indent << "ActiveFraction: " << this->ActiveFraction << "\n";
  os << indent << "CoarseningFactor: " << this->CoarseningFactor << "\n";
  os << indent << "UsedCoarseningFactor: " << this->UsedCoarseningFactor << "\n";
  os << indent << "TargetError: " << this->TargetError << "\n";
  os << indent << "TimeBudget: " << this->TimeBudget << "\n";
  os << indent << "EstimatedError: " << this->EstimatedError << "\n";
  os << indent << "EstimatedErrorL2: " << this->EstimatedErrorL2 << "\n";
  os << indent << "IntermediateInterval: " << this->IntermediateInterval << "\n";
  os << indent << "PositivityBound: " << this->PositivityBound << "\n";
  os << indent << "StabilityBound: " << this->StabilityBound << "\n";
  os << indent << "UsedTimeStep: " << this->UsedTimeStep << "\n";
}
