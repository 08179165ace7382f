// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** The filter around the core: pipelines, geometry, types, time, reports, bad input. */
#include "LightTransportFilterTesting.h"

#include "vtkDoubleArray.h"
#include "vtkExtentTranslator.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkImageChangeInformation.h"
#include "vtkInformation.h"
#include "vtkLightDiffusionFilter.h"
#include "vtkLightSeedFilter.h"
#include "vtkMatrix3x3.h"
#include "vtkOpticalMediumFilter.h"
#include "vtkSMPTools.h"
#include "vtkSOADataArrayTemplate.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkStringArray.h"
#include "vtkTrivialProducer.h"
#include "vtkUnsignedCharArray.h"

#include <cmath>
#include <functional>
#include <limits>

using lighttransport::testing::errorsOfUpdate;
using lighttransport::testing::makeImage;
using lighttransport::testing::MessageLog;
using lighttransport::testing::pointArray;
using lighttransport::testing::Suite;
using lighttransport::testing::sumOf;
using Filter = vtkLightDiffusionFilter;

namespace
{
using Function = std::function<double(int i, int j, int k)>;

template <class ArrayT>
void addArray(vtkImageData* image, const char* name, const Function& f)
{
  vtkNew<ArrayT> array;
  array->SetName(name);
  array->SetNumberOfComponents(1); // SOA arrays have no default
  array->SetNumberOfTuples(image->GetNumberOfPoints());
  int dims[3];
  image->GetDimensions(dims);
  vtkIdType at = 0;
  for (int k = 0; k < dims[2]; ++k)
  {
    for (int j = 0; j < dims[1]; ++j)
    {
      for (int i = 0; i < dims[0]; ++i)
      {
        array->SetComponent(at++, 0, f(i, j, k));
      }
    }
  }
  image->GetPointData()->AddArray(array);
}

/** A homogeneous medium with one source voxel. */
template <class ArrayT = vtkFloatArray>
vtkSmartPointer<vtkImageData> scene(int n, double D, double sigma, int si, int sj, int sk, double q)
{
  auto image = makeImage(n, n, n, VTK_UNSIGNED_CHAR, [](int i, int, int) { return i; });
  image->GetPointData()->GetScalars()->SetName("Anatomy");
  addArray<ArrayT>(image, "DiffusionCoefficient", [=](int, int, int) { return D; });
  addArray<ArrayT>(image, "Absorption", [=](int, int, int) { return sigma; });
  addArray<ArrayT>(
    image, "Source", [=](int i, int j, int k) { return i == si && j == sj && k == sk ? q : 0.; });
  return image;
}

/** scene, but one corner is denser: a medium that is the same everywhere takes no iterations. */
vtkSmartPointer<vtkImageData> unevenScene(int n, double D, double sigma, int s, double q)
{
  auto image = scene(n, D, sigma, s, s, s, q);
  image->GetPointData()->GetArray("DiffusionCoefficient")->SetComponent(0, 0, 0.5 * D);
  return image;
}

double fluenceAt(vtkAlgorithm* filter, int i, int j, int k)
{
  auto* image = vtkImageData::SafeDownCast(filter->GetOutputDataObject(0));
  vtkDataArray* array = image->GetPointData()->GetArray("Fluence");
  int ijk[3] = { i, j, k };
  return array ? array->GetComponent(image->ComputePointId(ijk), 0) : std::nan("");
}

void report(Suite& suite)
{
  vtkNew<Filter> filter;
  filter->SetInputData(unevenScene(15, 0.5, 0.1, 7, 2.));
  filter->Update();
  vtkImageData* output = filter->GetOutput();
  LT_CHECK(suite, filter->GetStopReason() == Filter::Converged);
  LT_CHECK(suite, std::string(filter->GetStopReasonAsString()) == "Converged");
  LT_CHECK(suite, filter->GetResidual() <= filter->GetTolerance());
  LT_CHECK(suite, filter->GetNumberOfIterationsUsed() > 0);
  LT_CHECK(suite, filter->GetSolveSeconds() > 0. && filter->GetBytes() > 15 * 15 * 15 * 16);
  LT_CHECK_CLOSE(suite, filter->GetEmittedPower(), 2., 1e-6);
  LT_CHECK_CLOSE(suite, filter->GetAbsorbedPower() + filter->GetEscapedPower(), 2., 1e-6);
  LT_CHECK(suite, filter->GetAbsorbedPower() > 0. && filter->GetEscapedPower() > 0.);
  // absorbed is the integral of sigma_a phi
  LT_CHECK_CLOSE(
    suite, 0.1 * sumOf(pointArray(filter, "Fluence")), filter->GetAbsorbedPower(), 1e-5);
  // arrays pass through as they are, fluence is active, no flux unless asked
  LT_CHECK(suite, output->GetPointData()->GetArray("Anatomy") != nullptr);
  LT_CHECK(suite, output->GetPointData()->GetArray("Source") != nullptr);
  LT_CHECK(suite, output->GetPointData()->GetScalars() == pointArray(filter, "Fluence"));
  LT_CHECK(suite, pointArray(filter, "Fluence")->GetDataType() == VTK_FLOAT);
  LT_CHECK(suite, pointArray(filter, "Flux") == nullptr);
  vtkFieldData* field = output->GetFieldData();
  auto* reason =
    vtkStringArray::SafeDownCast(field->GetAbstractArray("LightDiffusionReport.StopReason"));
  LT_CHECK(suite, reason && reason->GetValue(0) == "Converged");
  vtkDataArray* residual = field->GetArray("LightDiffusionReport.Residual");
  LT_CHECK(suite, residual && residual->GetComponent(0, 0) == filter->GetResidual());
  filter->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
  filter->ComputeFluxOn();
  filter->Update();
  LT_CHECK(suite, pointArray(filter, "Fluence")->GetDataType() == VTK_DOUBLE);
  LT_CHECK(suite, pointArray(filter, "Flux")->GetNumberOfComponents() == 3);

  // a stop before the tolerance is said, once, and the answer reached is kept
  vtkNew<MessageLog> warnings;
  filter->AddObserver(vtkCommand::WarningEvent, warnings);
  filter->SetMaximumNumberOfIterations(1);
  filter->SetTolerance(1e-12);
  filter->Update();
  LT_CHECK(suite, filter->GetStopReason() == Filter::MaxIterations);
  LT_CHECK(suite, filter->GetResidual() > filter->GetTolerance());
  LT_CHECK(suite, warnings->messages.size() == 1);
  LT_CHECK(suite, fluenceAt(filter, 7, 7, 7) > 0.);

  // a medium that is the same everywhere: at once, with a value per voxel of memory
  vtkNew<Filter> constant;
  constant->SetInputData(scene(31, 0.5, 0.1, 4, 7, 9, 2.));
  constant->SetTolerance(1e-12);
  constant->Update();
  LT_CHECK(suite, constant->GetStopReason() == Filter::Converged);
  LT_CHECK(suite, constant->GetNumberOfIterationsUsed() == 1);
  LT_CHECK(suite, constant->GetResidual() <= 1e-12 && constant->GetBytes() < 31 * 31 * 31 * 32);
  LT_CHECK_CLOSE(suite, constant->GetAbsorbedPower() + constant->GetEscapedPower(), 2., 1e-6);
}

/** Extents, origins, direction matrices and spacings change where, not what. */
void geometry(Suite& suite)
{
  auto image = scene(13, 0.5, 0.1, 4, 6, 8, 2.);
  vtkNew<Filter> plain;
  plain->ComputeFluxOn();
  plain->SetInputData(image);
  plain->Update();

  vtkNew<vtkImageData> moved;
  moved->ShallowCopy(image);
  moved->SetExtent(-5, 7, 100, 112, 3, 15);
  moved->SetOrigin(10., -20., 1e4);
  // a turn about z by 90 degrees: the image's x axis is the world's y
  const double turn[9] = { 0., -1., 0., 1., 0., 0., 0., 0., 1. };
  moved->SetDirectionMatrix(turn);
  vtkNew<Filter> filter;
  filter->ComputeFluxOn();
  filter->SetInputData(moved);
  filter->Update();
  int extent[6];
  filter->GetOutput()->GetExtent(extent);
  LT_CHECK(suite, extent[0] == -5 && extent[3] == 112 && extent[4] == 3);
  bool same = true;
  bool turned = true;
  vtkDataArray* a = pointArray(plain, "Fluence");
  vtkDataArray* b = pointArray(filter, "Fluence");
  vtkDataArray* E = pointArray(plain, "Flux");
  vtkDataArray* F = pointArray(filter, "Flux");
  for (vtkIdType i = 0; i < a->GetNumberOfTuples(); ++i)
  {
    same = same && a->GetComponent(i, 0) == b->GetComponent(i, 0);
    turned = turned && F->GetComponent(i, 0) == -E->GetComponent(i, 1) &&
      F->GetComponent(i, 1) == E->GetComponent(i, 0) &&
      F->GetComponent(i, 2) == E->GetComponent(i, 2);
  }
  LT_CHECK(suite, same);
  LT_CHECK(suite, turned);
  LT_CHECK(suite, fluenceAt(filter, -1, 106, 11) == fluenceAt(plain, 4, 6, 8));
  // away from the source: along +x at higher i
  int ijk[3] = { 8, 6, 8 };
  LT_CHECK(suite, E->GetComponent(plain->GetOutput()->ComputePointId(ijk), 0) > 0.);

  // other units: lengths in micrometres instead of millimetres
  auto small = scene(13, 500., 1e-4, 4, 6, 8, 2e-3);
  small->SetSpacing(1000., 1000., 1000.);
  vtkNew<Filter> scaled;
  scaled->SetInputData(small);
  scaled->Update();
  LT_CHECK_CLOSE(suite, fluenceAt(scaled, 9, 3, 4), fluenceAt(plain, 9, 3, 4), 1e-5);

  // a piece is asked for: the whole is made, and is right
  vtkNew<vtkTrivialProducer> producer;
  producer->SetOutput(image);
  producer->SetWholeExtent(0, 12, 0, 12, 0, 12);
  vtkNew<Filter> streamed;
  streamed->SetInputConnection(producer->GetOutputPort());
  int piece[6] = { 2, 5, 3, 6, 4, 7 };
  streamed->UpdateExtent(piece);
  LT_CHECK(suite, streamed->GetOutput()->GetNumberOfPoints() == 13 * 13 * 13);
  LT_CHECK(suite, fluenceAt(streamed, 9, 3, 4) == fluenceAt(plain, 9, 3, 4));

  // anisotropic spacing: the same slab of light, whichever axis is fine. Closed form in
  // TestDiffusionSteady; here, that spacing[d] belongs to axis d.
  for (int axis = 0; axis < 3; ++axis)
  {
    int n[3] = { 1, 1, 1 };
    n[axis] = 41;
    auto line = makeImage(n[0], n[1], n[2], VTK_FLOAT, [](int, int, int) { return 0.; });
    double spacing[3] = { 7., 7., 7. };
    spacing[axis] = 0.25;
    line->SetSpacing(spacing);
    addArray<vtkFloatArray>(line, "DiffusionCoefficient", [](int, int, int) { return 0.5; });
    addArray<vtkFloatArray>(line, "Absorption", [](int, int, int) { return 0.2; });
    addArray<vtkFloatArray>(line, "Source", [](int, int, int) { return 1.; });
    vtkNew<Filter> thin;
    thin->SetInputData(line);
    thin->Update();
    const double mu = std::sqrt(0.2 / 0.5);
    const double half = 0.5 * 41 * 0.25;
    const double exact =
      5. * (1. - 1. / (std::cosh(mu * half) + 2. * 0.5 * mu * std::sinh(mu * half)));
    LT_CHECK_CLOSE(suite, pointArray(thin, "Fluence")->GetComponent(20, 0), exact, 1e-3);
  }
}

void types(Suite& suite)
{
  vtkNew<Filter> floats;
  floats->SetInputData(scene(9, 0.5, 0.25, 4, 4, 4, 2.));
  floats->Update();
  vtkNew<Filter> doubles;
  doubles->SetInputData(scene<vtkDoubleArray>(9, 0.5, 0.25, 4, 4, 4, 2.));
  doubles->Update();
  LT_CHECK(suite, fluenceAt(floats, 2, 3, 4) == fluenceAt(doubles, 2, 3, 4));
  auto mixed = scene(9, 0.5, 0.25, 4, 4, 4, 2.);
  addArray<vtkUnsignedCharArray>(
    mixed, "Source", [](int i, int j, int k) { return i == 4 && j == 4 && k == 4 ? 2. : 0.; });
  doubles->SetInputData(mixed);
  doubles->Update();
  LT_CHECK(suite, fluenceAt(floats, 2, 3, 4) == fluenceAt(doubles, 2, 3, 4));

  // floats whose values do not lie in one block
  using Apart = vtkSOADataArrayTemplate<float>;
  for (const double error : { 0., 1e-5 })
  {
    auto apart = scene<Apart>(9, 0.5, 0.25, 4, 4, 4, 2.);
    apart->GetPointData()->GetArray("DiffusionCoefficient")->SetComponent(0, 0, 0.25);
    vtkNew<Filter> blocks;
    blocks->SetInputData(apart);
    blocks->SetTargetError(error);
    blocks->Update();
    vtkNew<Filter> plain;
    plain->SetInputData(unevenScene(9, 0.5, 0.25, 4, 2.));
    plain->Update();
    LT_CHECK_CLOSE(suite, fluenceAt(blocks, 2, 3, 4), fluenceAt(plain, 2, 3, 4), 1e-5);
  }

  // float holds neither 1e30 / 1e-10^3 nor its fluence; double does, and the error says so
  auto huge = scene<vtkDoubleArray>(5, 1., 1., 2, 2, 2, 1e60);
  LT_CHECK_FAILS(
    suite,
    [&]
    {
      floats->SetInputData(huge);
      return floats.Get();
    }(),
    "float", "DOUBLE_PRECISION");
  LT_CHECK(suite, floats->GetStopReason() == Filter::NotFinite);
  floats->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
  floats->Update();
  LT_CHECK(suite, fluenceAt(floats, 2, 2, 2) > 1e58 && std::isfinite(fluenceAt(floats, 2, 2, 2)));

  // hidden points are no part of the domain
  auto blank = scene(9, 0.5, 0.01, 1, 4, 4, 2.);
  vtkNew<vtkUnsignedCharArray> ghosts;
  ghosts->SetName(vtkDataSetAttributes::GhostArrayName());
  ghosts->SetNumberOfTuples(9 * 9 * 9);
  ghosts->FillValue(0);
  for (int k = 0; k < 9; ++k)
  {
    for (int j = 0; j < 9; ++j)
    {
      int ijk[3] = { 5, j, k };
      ghosts->SetValue(blank->ComputePointId(ijk), vtkDataSetAttributes::HIDDENPOINT);
    }
  }
  blank->GetPointData()->AddArray(ghosts);
  vtkNew<Filter> dammed;
  dammed->SetInputData(blank);
  dammed->Update();
  LT_CHECK(suite, fluenceAt(dammed, 4, 4, 4) > 0.);
  LT_CHECK(suite, fluenceAt(dammed, 5, 4, 4) == 0. && fluenceAt(dammed, 7, 4, 4) == 0.);
  // ghosts that are copies of a neighbour piece's points are ordinary points
  ghosts->FillValue(vtkDataSetAttributes::DUPLICATEPOINT);
  ghosts->Modified();
  dammed->Modified();
  dammed->Update();
  LT_CHECK(suite, fluenceAt(dammed, 7, 4, 4) > 0.);
}

void time(Suite& suite)
{
  auto image = scene(11, 0.5, 0.2, 3, 5, 7, 2.);
  vtkNew<Filter> steady;
  steady->SetInputData(image);
  steady->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
  steady->Update();
  for (const int mode : { Filter::Explicit, Filter::Implicit })
  {
    vtkNew<Filter> filter;
    filter->SetInputData(image);
    filter->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
    filter->SetMode(mode);
    filter->SetNumberOfSteps(mode == Filter::Explicit ? 2000 : 200);
    filter->SetCourantNumber(mode == Filter::Explicit ? 1. : 100.);
    filter->Update();
    LT_CHECK(suite, filter->GetStopReason() == Filter::Converged);
    LT_CHECK_CLOSE(suite, fluenceAt(filter, 8, 8, 8), fluenceAt(steady, 8, 8, 8), 1e-5);
    LT_CHECK_CLOSE(suite, filter->GetUsedTimeStep(),
      filter->GetCourantNumber() * filter->GetPositivityBound(), 1e-12);

    // going on: 5 + 5 steps are 10 steps
    vtkNew<Filter> whole;
    whole->SetInputData(image);
    whole->SetMode(mode);
    whole->SetNumberOfSteps(10);
    whole->Update();
    LT_CHECK(suite, whole->GetStopReason() == Filter::MaxIterations);
    vtkNew<Filter> parts;
    parts->SetInputData(image);
    parts->SetMode(mode);
    parts->SetNumberOfSteps(5);
    parts->ContinueOn();
    parts->Update();
    const double first = fluenceAt(parts, 3, 5, 9);
    parts->Modified();
    parts->Update();
    LT_CHECK(suite, fluenceAt(parts, 3, 5, 9) > first);
    LT_CHECK_CLOSE(suite, fluenceAt(parts, 3, 5, 9), fluenceAt(whole, 3, 5, 9), 1e-5);
    parts->ResetState();
    parts->Update();
    LT_CHECK(suite, fluenceAt(parts, 3, 5, 9) == first);
  }

  // above the stability bound: refused, the bound in the message
  vtkNew<Filter> fast;
  fast->SetInputData(image);
  fast->SetMode(Filter::Explicit);
  fast->SetCourantNumber(2.5);
  LT_CHECK_FAILS(suite, fast.Get(), "unstable", "expected in (0, ");
  LT_CHECK(suite, fast->GetStopReason() == Filter::BadInput);
  fast->SetCourantNumber(1.);
  fast->Update();
  LT_CHECK(suite, fluenceAt(fast, 3, 5, 7) > 0.);
}

/** Only what changed is done again. */
void continuing(Suite& suite)
{
  auto volume = makeImage(24, 24, 24, VTK_FLOAT,
    [](int i, int j, int k)
    { return std::hypot(std::hypot(i - 12., j - 12.), k - 12.) < 8. ? 100. : 0.; });
  vtkNew<vtkOpticalMediumFilter> medium;
  medium->SetInputData(volume);
  medium->SetReach(10.);
  vtkNew<vtkLightSeedFilter> seeds;
  seeds->SetInputConnection(medium->GetOutputPort());
  seeds->AddSphere(8., 12., 12., 1., 1.);
  seeds->AddSphere(12., 8., 12., 1., 1.);
  vtkNew<Filter> filter;
  filter->SetInputConnection(seeds->GetOutputPort());
  filter->ContinueOn();
  filter->Update();
  const int full = filter->GetNumberOfIterationsUsed();
  const vtkMTimeType mediumTime = pointArray(medium, "DiffusionCoefficient")->GetMTime();
  seeds->SetSphere(1, 12., 8.2, 12., 1., 1.);
  filter->SetTolerance(1e-4);
  filter->Update();
  const int moved = filter->GetNumberOfIterationsUsed();
  vtkNew<Filter> fresh;
  fresh->SetInputConnection(seeds->GetOutputPort());
  fresh->SetTolerance(1e-4);
  fresh->Update();
  std::cout << "iterations: " << full << " to 1e-8, " << moved << " from the last state, "
            << fresh->GetNumberOfIterationsUsed() << " from nothing to 1e-4\n";
  LT_CHECK(suite, moved < fresh->GetNumberOfIterationsUsed());
  LT_CHECK(suite, pointArray(medium, "DiffusionCoefficient")->GetMTime() == mediumTime);
  // nothing changed: nothing is done
  const vtkMTimeType before = filter->GetOutput()->GetMTime();
  filter->Update();
  LT_CHECK(suite, filter->GetOutput()->GetMTime() == before);

  // S and -S: dark
  seeds->RemoveAllSpheres();
  seeds->AddSphere(12., 12., 12., 2., 1.);
  seeds->AddSphere(12., 12., 12., 2., -1.);
  fresh->Update();
  double range[2];
  pointArray(fresh, "Fluence")->GetRange(range);
  LT_CHECK_NEAR(suite, range[0], 0., 1e-12);
  LT_CHECK_NEAR(suite, range[1], 0., 1e-12);
}

void anisotropicDiffusion(Suite& suite)
{
  // a tube of 100 in 0, the source inside: light runs along the tube
  auto volume = makeImage(32, 16, 16, VTK_SHORT,
    [](int, int j, int k) { return std::hypot(j - 8., k - 8.) < 4. ? 100. : 0.; });
  vtkNew<vtkLightSeedFilter> seeds;
  seeds->SetInputData(volume);
  seeds->AddSphere(6., 8., 8., 1.5, 1.);
  vtkNew<Filter> filter;
  filter->SetInputConnection(seeds->GetOutputPort());
  filter->SetModel(Filter::AnisotropicDiffusion);
  LT_CHECK_FAILS(suite, filter.Get(), "Steady", "expected Explicit or Implicit");
  filter->SetMode(Filter::Explicit);
  filter->SetBoundary(Filter::ZeroFlux);
  filter->SetNumberOfSteps(300);
  filter->SetGradientScale(10.);
  double leak[2];
  for (const int function : { Filter::Exponential, Filter::Rational })
  {
    filter->SetFluxFunction(function);
    filter->Update();
    // no absorption and mirrors: the sum of what was there at first
    LT_CHECK_CLOSE(suite, sumOf(pointArray(filter, "Fluence")), 1., 1e-5);
    leak[function] = fluenceAt(filter, 6, 14, 8) / fluenceAt(filter, 20, 8, 8);
    LT_CHECK(suite, fluenceAt(filter, 20, 8, 8) > 0.);
    LT_CHECK(suite, filter->GetComputedGradientScale() == 10.);
  }
  std::cout << "outside over far inside: " << leak[0] << " exponential, " << leak[1]
            << " rational\n";
  LT_CHECK(suite, leak[0] < leak[1] && leak[0] < 1e-3);

  filter->ContinueOn();
  filter->SetNumberOfSteps(150);
  filter->Update();
  filter->Modified();
  filter->Update();
  LT_CHECK_CLOSE(suite, fluenceAt(filter, 6, 14, 8) / fluenceAt(filter, 20, 8, 8), leak[1], 1e-4);
  filter->SetMode(Filter::Implicit);
  filter->ResetState();
  filter->Update();
  LT_CHECK_CLOSE(suite, sumOf(pointArray(filter, "Fluence")), 1., 1e-4);
}

void progress(Suite& suite)
{
  class Watch : public vtkCommand
  {
  public:
    static Watch* New() { return new Watch; }
    void Execute(vtkObject* caller, unsigned long, void*) override
    {
      auto* algorithm = vtkAlgorithm::SafeDownCast(caller);
      if (algorithm->GetProgress() > 0.2 && this->armed)
      {
        algorithm->AbortExecuteOn();
        this->armed = false;
      }
    }
    bool armed = true;
  };
  vtkNew<Filter> filter;
  filter->SetInputData(unevenScene(31, 0.5, 1e-4, 15, 1.));
  vtkNew<Watch> watch;
  filter->AddObserver(vtkCommand::ProgressEvent, watch);
  filter->ContinueOn();
  filter->Update();
  LT_CHECK(suite, filter->GetStopReason() == Filter::Cancelled);
  LT_CHECK(suite, fluenceAt(filter, 15, 15, 15) > 0.); // what was reached stays valid
  const int before = filter->GetNumberOfIterationsUsed();
  filter->Modified();
  filter->Update();
  LT_CHECK(suite, filter->GetStopReason() == Filter::Converged);
  LT_CHECK(suite, filter->GetNumberOfIterationsUsed() > 0 && before > 0);
}

/** Only what the scene requires, through the filter. */
void frugal(Suite& suite)
{
  // a rod of tissue in absorbing walls, so small a part that finding its region pays
  auto image = makeImage(96, 64, 64, VTK_UNSIGNED_CHAR, [](int, int, int) { return 0.; });
  const auto inside = [](int j, int k) { return std::hypot(j - 20., k - 20.) < 3.; };
  addArray<vtkFloatArray>(
    image, "DiffusionCoefficient", [&](int, int j, int k) { return inside(j, k) ? 1. : 1e-4; });
  addArray<vtkFloatArray>(
    image, "Absorption", [&](int, int j, int k) { return inside(j, k) ? 0.1 : 1.; });
  addArray<vtkFloatArray>(
    image, "Source", [](int i, int j, int k) { return i == 20 && j == 20 && k == 20 ? 1. : 0.; });
  vtkNew<Filter> full;
  full->SetInputData(image);
  full->Update();
  vtkNew<Filter> active;
  active->SetInputData(image);
  active->ActiveRegionOn();
  active->ComputeFluxOn();
  active->Update();
  LT_CHECK(suite, active->GetStopReason() == Filter::Converged);
  LT_CHECK(suite, active->GetActiveFraction() < 0.25 && full->GetActiveFraction() == 1.);
  LT_CHECK(suite, active->GetFineGridApplications() < full->GetFineGridApplications());
  LT_CHECK(suite, active->GetEstimatedError() < 0.);
  for (const int i : { 20, 24, 30, 36 })
  {
    LT_CHECK_CLOSE(suite, fluenceAt(active, i, 20, 20), fluenceAt(full, i, 20, 20), 1e-3);
  }
  LT_CHECK(suite, fluenceAt(active, 60, 2, 2) == 0.);
  LT_CHECK_NEAR(suite,
    active->GetAbsorbedPower() + active->GetEscapedPower() + active->GetLeakedPower(), 1., 1e-5);
  // and back
  active->ActiveRegionOff();
  active->Update();
  LT_CHECK(suite, fluenceAt(active, 60, 2, 2) == fluenceAt(full, 60, 2, 2));

  active->SetTargetError(0.01);
  active->Update();
  LT_CHECK(suite, active->GetStopReason() == Filter::Converged);
  LT_CHECK(suite, active->GetEstimatedError() > 0. && active->GetEstimatedError() <= 0.01);
  LT_CHECK(suite, active->GetActiveFraction() < 0.25); // the region, unasked
  LT_CHECK_CLOSE(suite, fluenceAt(active, 30, 20, 20), fluenceAt(full, 30, 20, 20), 0.02);
  LT_CHECK(suite, active->GetNumberOfIterationsUsed() > 0);
  vtkNew<MessageLog> warnings;
  active->AddObserver(vtkCommand::WarningEvent, warnings);
  active->SetTargetError(0.);
  active->SetTimeBudget(1e-9);
  active->Update();
  LT_CHECK(suite, active->GetStopReason() == Filter::MaxIterations);
  LT_CHECK(suite, active->GetEstimatedError() > 0. && warnings->messages.empty());

  class Show : public vtkCommand
  {
  public:
    static Show* New() { return new Show; }
    void Execute(vtkObject* caller, unsigned long, void*) override
    {
      auto* shown = Filter::SafeDownCast(caller)->GetIntermediateOutput();
      this->count += shown && shown->GetNumberOfPoints() == 96 * 64 * 64 &&
        shown->GetPointData()->GetArray("Fluence");
    }
    int count = 0;
  };
  vtkNew<Show> show;
  full->AddObserver(Filter::IntermediateEvent, show);
  full->SetIntermediateInterval(1e-9);
  full->Update();
  LT_CHECK(suite, show->count >= 2);
}

/** A constant medium to a named error, again with another light, and then another medium. */
void constantToAnError(Suite& suite)
{
  vtkNew<Filter> named;
  named->SetTargetError(0.01);
  const auto agree = [&](vtkImageData* image, int x, double within)
  {
    vtkNew<Filter> full;
    full->SetInputData(image);
    full->Update();
    named->SetInputData(image);
    named->Update();
    LT_CHECK(suite, named->GetStopReason() == Filter::Converged);
    LT_CHECK(suite, named->GetEstimatedError() >= 0. && named->GetEstimatedError() <= 0.01);
    LT_CHECK_CLOSE(suite, fluenceAt(named, x, 9, 9), fluenceAt(full, x, 9, 9), within);
  };
  auto image = scene(20, 0.5, 0.05, 4, 9, 9, 2.);
  agree(image, 6, 1e-6);
  LT_CHECK(suite, named->GetNumberOfIterationsUsed() == 1);
  addArray<vtkFloatArray>(
    image, "Source", [](int i, int j, int k) { return i == 15 && j == 9 && k == 9 ? 3. : 0.; });
  agree(image, 13, 1e-6);
  LT_CHECK(suite, named->GetNumberOfIterationsUsed() == 1);
  agree(unevenScene(20, 0.5, 0.05, 9, 2.), 12, 0.02);
  LT_CHECK(suite, named->GetNumberOfIterationsUsed() > 1);
  agree(image, 13, 1e-6);
}

/** Cells of two and four points, on request or because a named error has it so. */
void coarser(Suite& suite)
{
  auto image = makeImage(40, 33, 30, VTK_UNSIGNED_CHAR, [](int, int, int) { return 0.; });
  addArray<vtkFloatArray>(image, "DiffusionCoefficient",
    [](int i, int j, int) { return i == 25 ? 0. : .3 + .2 * std::sin(.5 * i + .3 * j); });
  addArray<vtkFloatArray>(image, "Absorption", [](int, int, int) { return 0.02; });
  addArray<vtkFloatArray>(
    image, "Source", [](int i, int j, int k) { return i == 12 && j == 15 && k == 16 ? 1. : 0.; });
  vtkNew<Filter> full;
  full->SetInputData(image);
  full->ComputeFluxOn();
  full->Update();
  vtkNew<Filter> coarse;
  coarse->SetInputData(image);
  coarse->ComputeFluxOn();
  vtkNew<MessageLog> warnings;
  coarse->AddObserver(vtkCommand::WarningEvent, warnings);
  for (const int factor : { 2, 4 })
  {
    coarse->SetCoarseningFactor(factor);
    coarse->Update();
    // as asked, so no warning; but the tolerance is not met, and nobody says so
    LT_CHECK(suite, coarse->GetStopReason() == Filter::MaxIterations);
    LT_CHECK(suite, coarse->GetResidual() > coarse->GetTolerance());
    LT_CHECK(suite, warnings->messages.empty());
    LT_CHECK(suite, coarse->GetUsedCoarseningFactor() == factor);
    const double most = factor == 2 ? 0.02 : 0.4;
    LT_CHECK(suite, coarse->GetEstimatedError() > 0. && coarse->GetEstimatedError() < most);
    for (const int i : { 12, 16, 20, 24 })
    {
      LT_CHECK_CLOSE(suite, fluenceAt(coarse, i, 15, 18), fluenceAt(full, i, 15, 18), most);
    }
    LT_CHECK(suite, fluenceAt(coarse, 30, 15, 16) < 1e-12); // behind the wall
    LT_CHECK_CLOSE(suite, coarse->GetAbsorbedPower() + coarse->GetEscapedPower(), 1., most);
    auto* used =
      coarse->GetOutput()->GetFieldData()->GetArray("LightDiffusionReport.CoarseningFactor");
    LT_CHECK(suite, used && used->GetTuple1(0) == factor);
  }
  LT_CHECK(suite, coarse->GetOutput()->GetPointData()->GetArray("Flux") != nullptr);
  coarse->SetCoarseningFactor(3);
  const std::vector<std::string> errors = errorsOfUpdate(coarse);
  LT_CHECK(
    suite, errors.size() == 1 && errors[0].find("CoarseningFactor is 3") != std::string::npos);

  // a budget below any set-up: a preview that says so, on this side of the wall alone
  vtkNew<Filter> hasty;
  hasty->SetInputData(image);
  hasty->SetTimeBudget(1e-9);
  hasty->Update();
  LT_CHECK(suite, hasty->GetOutput()->GetPointData()->GetArray("Flux") == nullptr);
  LT_CHECK(suite, hasty->GetStopReason() == Filter::MaxIterations);
  LT_CHECK(suite, hasty->GetUsedCoarseningFactor() == 4);
  LT_CHECK_NEAR(suite, hasty->GetEstimatedError(), 1., 1e-9);
  LT_CHECK(suite, hasty->GetResidual() < 0.); // nobody has computed it
  LT_CHECK(suite,
    hasty->GetOutput()
        ->GetFieldData()
        ->GetArray("LightDiffusionReport.Residual")
        ->GetComponent(0, 0) == hasty->GetResidual());
  LT_CHECK(suite, std::string(hasty->GetMessage()).find("guess") != std::string::npos);
  LT_CHECK_CLOSE(suite, fluenceAt(hasty, 16, 15, 18), fluenceAt(full, 16, 15, 18), 0.5);
  LT_CHECK(suite, fluenceAt(hasty, 30, 15, 16) < 1e-12);

  // a named error, and a light that moves
  coarse->SetCoarseningFactor(1);
  coarse->SetTargetError(0.01);
  coarse->ContinueOn();
  coarse->Update();
  LT_CHECK(suite, coarse->GetUsedCoarseningFactor() == 1);
  LT_CHECK_CLOSE(suite, fluenceAt(coarse, 20, 15, 18), fluenceAt(full, 20, 15, 18), 0.01);
  addArray<vtkFloatArray>(
    image, "Source", [](int i, int j, int k) { return i == 13 && j == 15 && k == 16 ? 1. : 0.; });
  coarse->Update();
  full->Update();
  LT_CHECK(suite, coarse->GetUsedCoarseningFactor() == 2); // from the last state
  LT_CHECK_CLOSE(suite, fluenceAt(coarse, 20, 15, 18), fluenceAt(full, 20, 15, 18), 0.01);
  // another medium: nothing of the last one is left
  addArray<vtkFloatArray>(image, "DiffusionCoefficient", [](int, int, int) { return 0.5; });
  coarse->Update();
  full->Update();
  LT_CHECK_CLOSE(suite, fluenceAt(coarse, 30, 15, 18), fluenceAt(full, 30, 15, 18), 0.01);
  // what cells of two points cannot reach is gone on with on the full grid
  addArray<vtkFloatArray>(
    image, "Source", [](int i, int j, int k) { return i == 14 && j == 15 && k == 16 ? 1. : 0.; });
  full->Update();
  coarse->SetTargetError(1e-12);
  coarse->Update();
  LT_CHECK(suite, coarse->GetUsedCoarseningFactor() == 1);
  LT_CHECK(suite, coarse->GetStopReason() == Filter::Converged); // to Tolerance
  LT_CHECK(suite, pointArray(coarse, "Fluence")->GetDataType() == VTK_FLOAT);
  coarse->SetOutputPrecision(vtkAlgorithm::DEFAULT_PRECISION); // float cannot hold that error
  coarse->Update();
  LT_CHECK(suite, pointArray(coarse, "Fluence")->GetDataType() == VTK_DOUBLE);
  LT_CHECK_CLOSE(suite, fluenceAt(coarse, 30, 15, 18), fluenceAt(full, 30, 15, 18), 1e-5);
}

/** Errors and budgets that no one should name, and both at once. */
void namedExtremes(Suite& suite)
{
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  auto image = scene(16, 1., 1e-3, 7, 8, 9, 1.);
  // not constant, which is solved at once
  addArray<vtkFloatArray>(image, "DiffusionCoefficient",
    [](int i, int j, int k) { return (i + j * k) % 3 == 0 ? 1e-3 : 1.; });
  vtkNew<Filter> exact;
  exact->SetInputData(image);
  exact->SetTolerance(1e-12);
  exact->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
  exact->Update();
  vtkNew<Filter> filter;
  filter->SetInputData(image);
  for (const double bad : { nan, inf, -inf, -1e-3, 1., 10. })
  {
    filter->SetTargetError(bad);
    LT_CHECK_FAILS(suite, filter.Get(), "TargetError is", "expected");
  }
  filter->SetTargetError(0.);
  for (const double bad : { nan, inf, -inf, -1e-3 })
  {
    filter->SetTimeBudget(bad);
    LT_CHECK_FAILS(suite, filter.Get(), "TimeBudget is", "expected");
  }
  // error, budget, whether an error is told
  struct Named
  {
    double error, budget;
    bool told;
  };
  for (const Named& named :
    { Named{ 0., 0., false }, Named{ 0.99, 0., true }, Named{ 1e-3, 0., true },
      Named{ 1e-12, 0., true }, Named{ 1e-300, 0., true }, Named{ 0., 1e9, true },
      Named{ 1e-3, 1e9, true }, Named{ 1e-3, 1e-9, true }, Named{ 1e-12, 1e-300, true } })
  {
    vtkNew<Filter> one;
    vtkNew<MessageLog> warnings;
    one->AddObserver(vtkCommand::WarningEvent, warnings);
    one->SetInputData(image);
    one->SetTargetError(named.error);
    one->SetTimeBudget(named.budget);
    one->SetOutputPrecision(vtkAlgorithm::DEFAULT_PRECISION);
    one->Update();
    const bool hurried = named.budget > 0. && named.budget < 1.;
    LT_CHECK(suite, one->GetStopReason() == (hurried ? Filter::MaxIterations : Filter::Converged));
    LT_CHECK(suite, warnings->messages.empty());
    LT_CHECK(suite, (one->GetEstimatedError() >= 0.) == named.told);
    LT_CHECK(suite, (one->GetEstimatedErrorL2() >= 0.) == named.told);
    const bool small = named.error > 0. && named.error < 1e-6;
    LT_CHECK(suite, pointArray(one, "Fluence")->GetDataType() == (small ? VTK_DOUBLE : VTK_FLOAT));
    // 1e-8 of the residual, where nothing ends it earlier
    const double most = hurried ? 1. : std::max(named.error, 1e-5);
    for (const int i : { 3, 7, 12 })
    {
      const double truth = fluenceAt(exact, i, 8, 8);
      const double told = fluenceAt(one, i, 8, 8);
      LT_CHECK(suite, std::isfinite(told) && told >= 0. && std::abs(told - truth) <= most * truth);
    }
    // what was not reached is said
    const std::string message = one->GetMessage();
    const bool missed = !hurried && named.error > 0. && one->GetEstimatedError() > named.error;
    LT_CHECK(suite, missed == (message.find("named error") != std::string::npos));
    LT_CHECK(suite, hurried == (message.find("time budget") != std::string::npos));
  }
}

/** Switching, dimming and turning the sign of a light is a sum, not a solve. */
void superposition(Suite& suite)
{
  auto volume = makeImage(32, 28, 24, VTK_FLOAT,
    [](int i, int j, int k)
    { return std::hypot(std::hypot(i - 16., j - 14.), k - 12.) < 9. ? 100. : 0.; });
  vtkNew<vtkOpticalMediumFilter> medium;
  medium->SetInputData(volume);
  medium->SetReach(20.);
  vtkNew<vtkLightSeedFilter> seeds;
  seeds->SetInputConnection(medium->GetOutputPort());
  seeds->AddSphere(10., 14., 12., 1.5, 1.);
  seeds->AddSphere(20., 14., 12., 0., 2.);
  seeds->AddSphere(16., 20., 12., 3., -0.5);
  vtkNew<Filter> kept;
  kept->SetInputConnection(seeds->GetOutputPort());
  kept->KeepSolutionsOn();
  kept->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
  kept->Update();
  LT_CHECK(suite, kept->GetNumberOfIterationsUsed() > 0);
  const auto compare = [&](const char* what, int iterations)
  {
    kept->Update();
    vtkNew<Filter> fresh;
    fresh->SetInputConnection(seeds->GetOutputPort());
    fresh->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
    fresh->SetTolerance(1e-11);
    fresh->Update();
    double worst = 0.;
    double most = 0.;
    vtkDataArray* a = pointArray(kept, "Fluence");
    vtkDataArray* b = pointArray(fresh, "Fluence");
    for (vtkIdType i = 0; i < a->GetNumberOfTuples(); ++i)
    {
      worst = std::max(worst, std::abs(a->GetComponent(i, 0) - b->GetComponent(i, 0)));
      most = std::max(most, std::abs(b->GetComponent(i, 0)));
    }
    std::cout << what << ": " << kept->GetNumberOfIterationsUsed() << " iterations, error "
              << worst / most << "\n";
    LT_CHECK(suite, kept->GetStopReason() == Filter::Converged);
    LT_CHECK(suite, kept->GetNumberOfIterationsUsed() <= iterations);
    LT_CHECK_NEAR(suite, worst / most, 0., 1e-6);
  };
  compare("all", 100);
  seeds->SetSphere(1, 20., 14., 12., 0., -2.);
  compare("sign turned", 0);
  seeds->SetSphere(0, 10., 14., 12., 1.5, 0.3);
  compare("dimmed", 0);
  seeds->SetSphere(2, 16., 20., 12., 3., 0.);
  compare("off", 0);
  seeds->SetSphere(2, 16., 20., 12., 3., 1.);
  compare("on", 0);
  const vtkIdType bytes = kept->GetBytes();
  seeds->SetSphere(0, 11., 14., 12., 1.5, 1.);
  compare("moved", 30);
  LT_CHECK(suite, kept->GetBytes() > bytes); // four are kept now: the old place too
  kept->SetMaximumNumberOfKeptSolutions(2);
  seeds->SetSphere(1, 20., 14., 12., 0., 1.);
  compare("two kept", 60);
  medium->SetReach(10.); // another medium: nothing holds any more
  compare("another medium", 100);
}

void badInput(Suite& suite)
{
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  vtkNew<Filter> filter;
  filter->SetInputData(vtkSmartPointer<vtkImageData>::New());
  LT_CHECK_FAILS(suite, filter.Get(), "empty");

  for (const char* name : { "Source", "DiffusionCoefficient", "Absorption" })
  {
    auto image = scene(5, 1., 1., 2, 2, 2, 1.);
    image->GetPointData()->RemoveArray(name);
    filter->SetInputData(image);
    LT_CHECK_FAILS(suite, filter.Get(), name, "missing", "expected");
  }
  {
    auto image = scene(5, 1., 1., 2, 2, 2, 1.);
    vtkNew<vtkFloatArray> vectors;
    vectors->SetName("Source");
    vectors->SetNumberOfComponents(3);
    vectors->SetNumberOfTuples(125);
    image->GetPointData()->AddArray(vectors);
    filter->SetInputData(image);
    LT_CHECK_FAILS(suite, filter.Get(), "Source", "3 components");
  }
  for (const double bad : { nan, inf, -inf })
  {
    filter->SetInputData(scene(5, 1., 1., 2, 3, 4, bad));
    LT_CHECK_FAILS(suite, filter.Get(), "source", "(2, 3, 4)", "finite");
    filter->SetInputData(scene(5, bad, 1., 2, 3, 4, 1.));
    LT_CHECK_FAILS(suite, filter.Get(), "diffusion coefficient", "(0, 0, 0)");
    filter->SetInputData(scene(5, 1., bad, 2, 3, 4, 1.));
    LT_CHECK_FAILS(suite, filter.Get(), "absorption", "(0, 0, 0)");
  }
  filter->SetInputData(scene(5, -1., 1., 2, 3, 4, 1.));
  LT_CHECK_FAILS(suite, filter.Get(), "diffusion coefficient is -1", ">= 0");
  for (const double bad : { 0., -1., nan, inf })
  {
    auto image = scene(5, 1., 1., 2, 2, 2, 1.);
    const Suite::WithoutTraps vtkInvertsIt;
    image->SetSpacing(1., bad, 1.);
    filter->SetInputData(image);
    LT_CHECK_FAILS(suite, filter.Get(), "spacing", "expected");
  }
  {
    filter->SetInputData(scene(5, 1., 0., 2, 2, 2, 1.));
    filter->SetBoundary(Filter::ZeroFlux);
    LT_CHECK_FAILS(suite, filter.Get(), "no steady state", "absorption");
    LT_CHECK(suite,
      filter->GetStopReason() == Filter::BadInput ||
        filter->GetStopReason() == Filter::NoSteadyState);
    filter->SetBoundary(Filter::Robin);
    filter->Update();
    LT_CHECK(suite, filter->GetStopReason() == Filter::Converged);
  }
  {
    filter->SetInputData(scene(1, 1., 0.5, 0, 0, 0, 1.)); // one voxel is valid
    filter->Update();
    LT_CHECK_CLOSE(suite, fluenceAt(filter, 0, 0, 0), 2., 1e-6);
  }
  filter->SetInputData(scene(5, 1., 1., 2, 2, 2, 1.));
  const auto out =
    [&](const char* name, const std::function<void()>& set, const std::function<void()>& reset)
  {
    set();
    LT_CHECK_FAILS(suite, filter.Get(), name, "expected");
    reset();
  };
  for (const double bad : { 0., 1., -1., nan })
  {
    out(
      "Tolerance", [&] { filter->SetTolerance(bad); }, [&] { filter->SetTolerance(1e-8); });
  }
  for (const double bad : { 0., -1., nan, inf })
  {
    out(
      "RefractiveIndexRatio", [&] { filter->SetRefractiveIndexRatio(bad); },
      [&] { filter->SetRefractiveIndexRatio(1.); });
    out(
      "CourantNumber", [&] { filter->SetCourantNumber(bad); },
      [&] { filter->SetCourantNumber(1.); });
  }
  out(
    "TimeStep", [&] { filter->SetTimeStep(-1.); }, [&] { filter->SetTimeStep(0.); });
  out(
    "MaximumNumberOfIterations", [&] { filter->SetMaximumNumberOfIterations(0); },
    [&] { filter->SetMaximumNumberOfIterations(500); });
  out(
    "NumberOfSteps",
    [&]
    {
      filter->SetMode(Filter::Implicit);
      filter->SetNumberOfSteps(0);
    },
    [&]
    {
      filter->SetMode(Filter::Steady);
      filter->SetNumberOfSteps(1);
    });
  out(
    "Mode", [&] { filter->SetMode(7); }, [&] { filter->SetMode(Filter::Steady); });
  out(
    "Model", [&] { filter->SetModel(-1); }, [&] { filter->SetModel(Filter::Diffusion); });
  out(
    "Boundary", [&] { filter->SetBoundary(3); }, [&] { filter->SetBoundary(Filter::Robin); });
  out(
    "FluxFunction", [&] { filter->SetFluxFunction(3); }, [&] { filter->SetFluxFunction(0); });
  out(
    "GradientScale", [&] { filter->SetGradientScale(-3); }, [&] { filter->SetGradientScale(0); });
  out(
    "OutputPrecision", [&] { filter->SetOutputPrecision(9); },
    [&] { filter->SetOutputPrecision(vtkAlgorithm::SINGLE_PRECISION); });
  filter->Update(); // and an intact filter
  LT_CHECK(suite, filter->GetStopReason() == Filter::Converged);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  report(suite);
  geometry(suite);
  types(suite);
  time(suite);
  continuing(suite);
  anisotropicDiffusion(suite);
  progress(suite);
  frugal(suite);
  constantToAnError(suite);
  coarser(suite);
  namedExtremes(suite);
  superposition(suite);
  badInput(suite);
  return suite.result();
}
