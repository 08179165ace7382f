// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** The diffusion filter in time: the first-moment model, local steps, second-order steps. */
#include "LightTransportFilterTesting.h"

#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkLightDiffusionFilter.h"
#include "vtkMatrix3x3.h"
#include "vtkStringArray.h"

#include <cmath>
#include <functional>

using lighttransport::testing::makeImage;
using lighttransport::testing::pointArray;
using lighttransport::testing::Suite;
using lighttransport::testing::sumOf;
using Filter = vtkLightDiffusionFilter;

namespace
{
using Function = std::function<double(int i, int j, int k)>;

vtkSmartPointer<vtkImageData> scene(
  int nx, int ny, int nz, const Function& D, const Function& sigma_a, const Function& q)
{
  auto image = makeImage(nx, ny, nz, VTK_UNSIGNED_CHAR, [](int i, int, int) { return i % 7; });
  image->GetPointData()->GetScalars()->SetName("Anatomy");
  const auto add = [&](const char* name, const Function& f)
  {
    vtkNew<vtkDoubleArray> array;
    array->SetName(name);
    array->SetNumberOfTuples(image->GetNumberOfPoints());
    vtkIdType at = 0;
    for (int k = 0; k < nz; ++k)
    {
      for (int j = 0; j < ny; ++j)
      {
        for (int i = 0; i < nx; ++i)
        {
          array->SetValue(at++, f(i, j, k));
        }
      }
    }
    image->GetPointData()->AddArray(array);
  };
  add("DiffusionCoefficient", D);
  add("Absorption", sigma_a);
  add("Source", q);
  return image;
}

Function constant(double value)
{
  return [value](int, int, int) { return value; };
}

Function lamp(int i, int j, int k)
{
  return [=](int x, int y, int z) { return x == i && y == j && z == k ? 1. : 0.; };
}

double field(Filter* filter, const char* name)
{
  vtkDataArray* array = filter->GetOutput()->GetFieldData()->GetArray(name);
  return array ? array->GetComponent(0, 0) : std::nan("");
}

std::string word(Filter* filter, const char* name)
{
  auto* array =
    vtkStringArray::SafeDownCast(filter->GetOutput()->GetFieldData()->GetAbstractArray(name));
  return array ? array->GetValue(0) : "";
}

/** A pulse in a line of voxels: exactly dark ahead of the front, and the balance of energy. */
void firstMoment(Suite& suite)
{
  vtkNew<Filter> filter;
  filter->SetInputData(scene(101, 1, 1, constant(10.), constant(0.01), lamp(50, 0, 0)));
  filter->SetModel(Filter::FirstMoment);
  filter->SetMode(Filter::Explicit);
  filter->SetNumberOfSteps(20);
  filter->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
  filter->ComputeFluxOn();
  filter->Update();
  LT_CHECK(suite, filter->GetStopReason() == Filter::MaxIterations);
  LT_CHECK(suite, filter->GetNumberOfIterationsUsed() == 20);
  LT_CHECK_CLOSE(suite, filter->GetUsedTimeStep(), std::sqrt(3.), 1e-12);
  LT_CHECK(suite, filter->GetPositivityBound() == 0.);
  LT_CHECK(suite, filter->GetStabilityBound() >= std::sqrt(3.) * (1. - 1e-6));
  vtkDataArray* phi = pointArray(filter, "Fluence");
  bool dark = true;
  for (int i = 0; i < 101; ++i)
  {
    dark = dark && (std::abs(i - 50) < 20 || phi->GetComponent(i, 0) == 0.);
  }
  LT_CHECK(suite, dark);
  LT_CHECK(suite, phi->GetComponent(69, 0) > 0. && phi->GetComponent(31, 0) > 0.);
  // away from the lamp, and faster than Fick
  vtkDataArray* E = pointArray(filter, "Flux");
  LT_CHECK(suite, E->GetComponent(65, 0) > 0. && E->GetComponent(35, 0) < 0.);
  const double emitted = 20. * std::sqrt(3.);
  LT_CHECK_CLOSE(suite, field(filter, "LightDiffusionReport.EmittedEnergy"), emitted, 1e-12);
  LT_CHECK_CLOSE(suite, field(filter, "LightDiffusionReport.StoredEnergy"), sumOf(phi), 1e-12);
  LT_CHECK(suite, field(filter, "LightDiffusionReport.EscapedEnergy") == 0.);
  LT_CHECK_CLOSE(suite,
    field(filter, "LightDiffusionReport.AbsorbedEnergy") +
      field(filter, "LightDiffusionReport.StoredEnergy"),
    emitted, 1e-12);
  LT_CHECK(suite, word(filter, "LightDiffusionReport.Model") == "FirstMoment");

  // goes on where it was, E included: 20 steps are 4 times 5
  vtkNew<Filter> parts;
  parts->SetInputData(filter->GetInput());
  parts->SetModel(Filter::FirstMoment);
  parts->SetMode(Filter::Explicit);
  parts->SetNumberOfSteps(5);
  parts->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
  parts->ContinueOn();
  const auto difference = [&]
  {
    double worst = 0.;
    for (int i = 0; i < 101; ++i)
    {
      worst = std::max(worst,
        std::abs(phi->GetComponent(i, 0) - pointArray(parts, "Fluence")->GetComponent(i, 0)));
    }
    return worst;
  };
  for (int part = 0; part < 4; ++part)
  {
    parts->Modified();
    parts->Update();
  }
  LT_CHECK(suite, difference() == 0.);
  // starts anew, with E = 0
  parts->ResetState();
  parts->SetNumberOfSteps(20);
  parts->Update();
  LT_CHECK(suite, difference() == 0.);
}

/** Steady is Diffusion's, time steps end there, and after another model the operator is remade. */
void sameSteadyState(Suite& suite)
{
  const auto D = [](int i, int j, int k) { return (i + j + k) % 5 == 0 ? 0.05 : 1.; };
  vtkNew<Filter> filter;
  auto input = scene(11, 10, 9, D, constant(0.1), lamp(4, 5, 6));
  input->SetDirectionMatrix(0., 1., 0., 0., 0., 1., 1., 0., 0.);
  filter->SetInputData(input);
  filter->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
  filter->ComputeFluxOn();
  filter->Update();
  vtkNew<vtkDoubleArray> phi;
  vtkNew<vtkDoubleArray> E;
  phi->DeepCopy(pointArray(filter, "Fluence"));
  E->DeepCopy(pointArray(filter, "Flux"));
  const double escaped = filter->GetEscapedPower();
  const auto same = [&](double tolerance)
  {
    double worst[2] = { 0., 0. };
    double largest[2] = { 0., 0. };
    for (vtkIdType i = 0; i < phi->GetNumberOfValues(); ++i)
    {
      worst[0] = std::max(
        worst[0], std::abs(phi->GetValue(i) - pointArray(filter, "Fluence")->GetComponent(i, 0)));
      largest[0] = std::max(largest[0], phi->GetValue(i));
    }
    for (vtkIdType i = 0; i < E->GetNumberOfValues(); ++i)
    {
      worst[1] = std::max(worst[1],
        std::abs(E->GetValue(i) - pointArray(filter, "Flux")->GetComponent(i / 3, int(i % 3))));
      largest[1] = std::max(largest[1], std::abs(E->GetValue(i)));
    }
    return worst[0] <= tolerance * largest[0] && worst[1] <= tolerance * largest[1];
  };
  filter->SetModel(Filter::FirstMoment);
  filter->Update();
  LT_CHECK(suite, filter->GetStopReason() == Filter::Converged && same(0.));
  filter->SetMode(Filter::Explicit);
  filter->SetNumberOfSteps(5000);
  filter->Update();
  LT_CHECK(suite, filter->GetStopReason() == Filter::Converged);
  LT_CHECK(suite, filter->GetResidual() <= filter->GetTolerance() && same(1e-6));
  LT_CHECK_CLOSE(suite, filter->GetEscapedPower(), escaped, 1e-6);
  const int wave = filter->GetNumberOfIterationsUsed();

  filter->SetModel(Filter::Diffusion);
  filter->Update();
  LT_CHECK(suite, filter->GetStopReason() == Filter::Converged && same(1e-6));
  LT_CHECK(suite, filter->GetPositivityBound() > 0.);
  const int global = filter->GetNumberOfIterationsUsed();
  filter->LocalTimeStepOn();
  filter->Update();
  LT_CHECK(suite, filter->GetStopReason() == Filter::Converged && same(1e-6));
  LT_CHECK(suite, filter->GetUsedTimeStep() == 0.);
  LT_CHECK(suite, field(filter, "LightDiffusionReport.LocalTimeStep") == 1.);
  LT_CHECK(suite, filter->GetNumberOfIterationsUsed() <= global);
  std::cout << "to the steady state: " << wave << " first-moment steps, " << global
            << " explicit ones, " << filter->GetNumberOfIterationsUsed() << " local ones\n";

  filter->SetMode(Filter::Implicit);
  filter->SetImplicitScheme(Filter::SecondOrder);
  filter->SetCourantNumber(1000.);
  filter->SetNumberOfSteps(100);
  filter->Update();
  LT_CHECK(suite, filter->GetStopReason() == Filter::Converged && same(1e-6));
  LT_CHECK(suite, field(filter, "LightDiffusionReport.LocalTimeStep") == 0.);
  LT_CHECK(suite, word(filter, "LightDiffusionReport.ImplicitScheme") == "SecondOrder");
}

/** phi decays as exp(-sigma_a ct) between mirrors: the error of both schemes. */
void implicitOrder(Suite& suite)
{
  const double sigma = 0.5;
  vtkNew<Filter> filter;
  // one execution lights the even field, the next lets it decay
  auto lit = scene(4, 4, 4, constant(1.), constant(sigma), constant(sigma));
  filter->SetInputData(lit);
  filter->SetBoundary(Filter::ZeroFlux);
  filter->SetMode(Filter::Implicit);
  filter->SetOutputPrecision(vtkAlgorithm::DOUBLE_PRECISION);
  filter->SetNumberOfSteps(10);
  filter->SetTimeStep(0.2);
  double errors[2];
  for (const int scheme : { Filter::BackwardEuler, Filter::SecondOrder })
  {
    filter->SetImplicitScheme(scheme);
    filter->Update();
    errors[scheme] =
      std::abs(pointArray(filter, "Fluence")->GetComponent(0, 0) - (1. - std::exp(-sigma * 2.)));
  }
  LT_CHECK_NEAR(suite, errors[0], std::pow(1.1, -10.) - std::exp(-1.), 1e-5);
  LT_CHECK(suite, errors[1] < 0.02 * errors[0]);
}

void badInput(Suite& suite)
{
  vtkNew<Filter> filter;
  filter->SetInputData(scene(5, 5, 5, constant(1.), constant(0.), lamp(2, 2, 2)));
  filter->SetModel(3);
  LT_CHECK_FAILS(suite, filter, "Model is 3", "FirstMoment");
  filter->SetModel(Filter::FirstMoment);
  filter->SetMode(Filter::Implicit);
  LT_CHECK_FAILS(suite, filter, "Implicit", "FirstMoment");
  filter->SetMode(Filter::Explicit);
  filter->SetTimeStep(5.);
  LT_CHECK_FAILS(suite, filter, "unstable", "5");
  filter->LocalTimeStepOn();
  LT_CHECK_FAILS(suite, filter, "LocalTimeStep", "FirstMoment");
  filter->SetModel(Filter::Diffusion);
  LT_CHECK_FAILS(suite, filter, "LocalTimeStep", "TimeStep 5");
  filter->SetTimeStep(0.);
  filter->SetCourantNumber(1.5);
  LT_CHECK_FAILS(suite, filter, "LocalTimeStep", "1.5");
  filter->SetCourantNumber(1.);
  filter->SetBoundary(Filter::ZeroFlux);
  LT_CHECK_FAILS(suite, filter, "no steady state");
  filter->SetBoundary(Filter::Robin);
  filter->SetImplicitScheme(2);
  LT_CHECK_FAILS(suite, filter, "ImplicitScheme is 2", "SecondOrder");
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  firstMoment(suite);
  sameSteadyState(suite);
  implicitOrder(suite);
  badInput(suite);
  return suite.result();
}
