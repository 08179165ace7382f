// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// The 2-D transfer function: what the thesis says of each preset, product, table.
#include "LightTransportFilterTesting.h"

#include "vtkCurvatureOpacityFunction.h"
#include "vtkLightTransportArrays.h"

#include "vtkPiecewiseFunction.h"

#include <limits>

using namespace lighttransport::testing;
using Function = vtkCurvatureOpacityFunction;

namespace
{
const double NaN = std::numeric_limits<double>::quiet_NaN();

void presets(Suite& suite)
{
  vtkNew<Function> function;
  LT_CHECK(suite, function->GetKind() == Function::CurvatureOnly); // clear at any depth
  for (int kind = Function::FocusFront; kind <= Function::CurvatureOnly; ++kind)
  {
    function->SetKind(kind);
    LT_CHECK(suite, function->GetProblem().empty());
    // Flat and near is clear, curved and near opaque, whatever the sign.
    LT_CHECK_NEAR(suite, function->Evaluate(0., 0.), 0.05, 1e-15);
    LT_CHECK_NEAR(suite, function->Evaluate(1., 0.), 0.95, 1e-15);
    LT_CHECK_NEAR(suite, function->Evaluate(-1., 0.), 0.95, 1e-15);
    // Monotone in curvature at all depths; clamped outside.
    for (double z : { 0., 0.3, 0.7, 1. })
    {
      double before = 0.;
      for (double c = 0.; c <= 1.; c += 0.125)
      {
        const double now = function->Evaluate(c, z);
        LT_CHECK(suite, now >= before && now == function->Evaluate(-c, z));
        before = now;
      }
      LT_CHECK(suite, function->Evaluate(7., z) == function->Evaluate(1., z));
    }
    LT_CHECK(suite, function->Evaluate(0.5, -3.) == function->Evaluate(0.5, 0.));
    LT_CHECK(suite, function->Evaluate(0.5, 3.) == function->Evaluate(0.5, 1.));
    LT_CHECK(suite, function->Evaluate(NaN, 0.) == 0. && function->Evaluate(0., NaN) == 0.);
  }
  const auto at = [&function](int kind, double c, double z)
  {
    function->SetKind(kind);
    return function->Evaluate(c, z);
  };
  // More opaque with distance (2.9), less so (2.10 d), or not at all.
  LT_CHECK_NEAR(suite, at(Function::FocusFront, 0., 1.), 0.95, 1e-15);
  LT_CHECK_NEAR(suite, at(Function::WideDepth, 0., 1.), 0.95, 1e-15);
  LT_CHECK_NEAR(suite, at(Function::FrontOpaque, 1., 1.), 0.05, 1e-15);
  LT_CHECK(suite, at(Function::CurvatureOnly, .4, 1.) == at(Function::CurvatureOnly, .4, 0.));
  // It grows quickly in the first, slowly in the second, at half the depth.
  LT_CHECK(suite, at(Function::FocusFront, 0., .5) > .8 && at(Function::WideDepth, 0., .5) < .3);
  // The focus in front: slight curvature is told from flat more in the first.
  LT_CHECK(suite, at(Function::FocusFront, .3, 0.) > at(Function::WideDepth, .3, 0.) + .1);

  function->SetMinimumOpacity(0.2);
  function->SetMaximumOpacity(0.6);
  LT_CHECK_NEAR(suite, at(Function::WideDepth, .5, 0.), 0.4, 1e-15);
  LT_CHECK_NEAR(suite, Function::Kappa(.5, .25, 2.), -std::tanh(1.5), 1e-15);
  LT_CHECK_NEAR(suite, Function::Kappa(-500., -250., .002), std::tanh(1.5), 1e-15);
}

void product(Suite& suite)
{
  vtkNew<Function> function;
  function->SetKindToProduct();
  LT_CHECK(suite, function->GetProblem().empty() && function->Evaluate(.1, .9) == 1.);
  vtkNew<vtkPiecewiseFunction> curvature;
  curvature->AddPoint(0., 0.2);
  curvature->AddPoint(1., 1.);
  vtkNew<vtkPiecewiseFunction> depth;
  depth->AddPoint(0., 1.);
  depth->AddPoint(1., 0.5);
  function->SetCurvatureFunction(curvature);
  function->SetDepthFunction(depth);
  LT_CHECK_NEAR(suite, function->Evaluate(-.5, .5), .6 * .75, 1e-12);
  const vtkMTimeType before = function->GetMTime();
  depth->AddPoint(0.5, 1.5);
  LT_CHECK(suite, function->GetMTime() > before);
  LT_CHECK(suite, function->GetProblem().find("DepthFunction has the value 1.5") == 0);
  depth->RemoveAllPoints();
  LT_CHECK(suite, function->GetProblem().find("DepthFunction is without points") == 0);
}

void table(Suite& suite)
{
  // What is exported comes back in, as floats and as RGBA bytes.
  vtkNew<Function> preset;
  preset->SetKindToWideDepth();
  vtkNew<vtkImageData> exported;
  preset->ExportTable(exported, 33, 17);
  LT_CHECK(suite, exported->GetDimensions()[0] == 33 && exported->GetDimensions()[1] == 17);
  vtkDataArray* values = exported->GetPointData()->GetScalars();
  LT_CHECK(suite, values && std::string(values->GetName()) == vtkLightTransportArrays::Opacity);
  LT_CHECK_NEAR(suite, values->GetComponent(16 + 33 * 4, 0), preset->Evaluate(.5, .25), 1e-7);

  auto bytes = makeImage(33, 17, 1, VTK_UNSIGNED_CHAR, [](int, int, int) { return 0.; });
  bytes->AllocateScalars(VTK_UNSIGNED_CHAR, 4);
  for (vtkIdType i = 0; i < values->GetNumberOfTuples(); ++i)
  {
    const double alpha = std::round(255. * values->GetComponent(i, 0));
    bytes->GetPointData()->GetScalars()->SetTuple4(i, 9., 9., 9., alpha);
  }
  for (vtkImageData* image : { exported.Get(), bytes.Get() })
  {
    vtkNew<Function> function;
    function->SetKindToTable();
    LT_CHECK(suite, function->GetProblem().find("TableImage is not set") == 0);
    LT_CHECK(suite, function->Evaluate(.5, .5) == 0.);
    function->SetTableImage(image);
    LT_CHECK(suite, function->GetProblem().empty());
    double error = 0.;
    for (double c = 0.; c <= 1.; c += 0.01)
    {
      for (double z = 0.; z <= 1.; z += 0.03)
      {
        error = std::max(error, std::abs(function->Evaluate(-c, z) - preset->Evaluate(c, z)));
      }
    }
    // The kind is bilinear in c and quadratic in z: 0.9 h^2/4 at h = 1/16, half a byte.
    LT_CHECK_NEAR(suite, error, 0., 0.9 / 16. / 16. / 4. + (image == bytes ? 0.5 / 255. : 1e-6));
  }

  // A single column does not depend on curvature; a volume is not a table.
  vtkNew<Function> function;
  function->SetKindToTable();
  auto column = makeImage(1, 2, 1, VTK_FLOAT, [](int, int j, int) { return .25 + .5 * j; });
  function->SetTableImage(column);
  LT_CHECK_NEAR(suite, function->Evaluate(.3, .5), .5, 1e-7);
  LT_CHECK_NEAR(suite, function->Evaluate(1., 1.), .75, 1e-7);
  auto volume = makeImage(2, 2, 2, VTK_FLOAT, [](int, int, int) { return 1.; });
  function->SetTableImage(volume);
  LT_CHECK(suite, function->GetProblem().find("TableImage has dimensions 2 2 2") == 0);
  vtkNew<vtkImageData> empty;
  function->SetTableImage(empty);
  LT_CHECK(suite, !function->GetProblem().empty() && function->Evaluate(0., 0.) == 0.);
}

void problems(Suite& suite)
{
  vtkNew<Function> function;
  function->SetKind(6);
  LT_CHECK(suite, function->GetProblem() == "Kind is 6, expected 0 to 5");
  LT_CHECK(suite, function->Evaluate(1., 1.) == 0.);
  LT_CHECK(suite, std::string(function->GetKindAsString()) == "(unknown)");
  function->SetKindToFrontOpaque();
  LT_CHECK(suite, std::string(function->GetKindAsString()) == "FrontOpaque");
  function->SetMaximumOpacity(1.5);
  LT_CHECK(suite, function->GetProblem() == "MaximumOpacity is 1.5, expected a value in [0, 1]");
  function->SetMinimumOpacity(NaN);
  LT_CHECK(suite, function->GetProblem().find("MinimumOpacity is") == 0);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  presets(suite);
  product(suite);
  table(suite);
  problems(suite);
  return suite.result();
}
