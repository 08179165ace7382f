// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkCurvatureOpacityFilter: closed forms on images and polydata, depth, units, bad input.
#include "LightTransportFilterTesting.h"

#include "vtkCurvatureOpacityFilter.h"
#include "vtkCurvatureOpacityFunction.h"
#include "vtkLightTransportArrays.h"

#include "vtkCallbackCommand.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkMatrix3x3.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkUnsignedCharArray.h"

#include <limits>

using namespace lighttransport::testing;
using Filter = vtkCurvatureOpacityFilter;
using Function = vtkCurvatureOpacityFunction;

namespace
{
const double NaN = std::numeric_limits<double>::quiet_NaN();

/** A row of points along z with mean curvatures; z = 10, 20, ... */
vtkSmartPointer<vtkPolyData> row(const std::vector<double>& curvatures, double unit = 1.)
{
  auto data = vtkSmartPointer<vtkPolyData>::New();
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkFloatArray> mean;
  mean->SetName(vtkLightTransportArrays::MeanCurvature);
  for (std::size_t i = 0; i < curvatures.size(); ++i)
  {
    points->InsertNextPoint(3. * unit, 4. * unit, 10. * unit * double(i + 1));
    mean->InsertNextValue(static_cast<float>(curvatures[i] / unit));
  }
  data->SetPoints(points);
  data->GetPointData()->AddArray(mean);
  return data;
}

vtkDataArray* opacityOf(vtkAlgorithm* filter)
{
  return vtkDataSet::SafeDownCast(filter->GetOutputDataObject(0))
    ->GetPointData()
    ->GetArray(vtkLightTransportArrays::Opacity);
}

void closedForms(Suite& suite)
{
  const std::vector<double> curvatures{ 0., 0.5, -0.5, 2., -100. };
  vtkNew<Filter> filter;
  filter->SetInputData(row(curvatures));
  filter->SetCurvatureScale(0.4);
  filter->GetOpacityFunction()->SetKindToWideDepth();
  filter->SetDepthSourceToAlongDirection();
  filter->SetDirection(0., 0., 7.);
  filter->Update();
  vtkDataArray* opacity = opacityOf(filter);
  for (int i = 0; i < 5; ++i)
  {
    const double c = std::tanh(0.4 * 2. * std::abs(curvatures[i]));
    const double z = i / 4.;
    LT_CHECK_NEAR(
      suite, opacity->GetComponent(i, 0), 0.05 + 0.9 * (1. - (1. - c) * (1. - z * z)), 1e-6);
  }
  vtkFieldData* field = filter->GetOutput()->GetFieldData();
  LT_CHECK(suite, field->GetArray("CurvatureOpacity.CurvatureScale")->GetComponent(0, 0) == 0.4);
  LT_CHECK(suite, field->GetArray("CurvatureOpacity.DepthRange")->GetComponent(1, 0) == 50.);

  // Depth the other way round, from a range, from a point, from an array, and none.
  filter->SetDirection(0., 0., -2.);
  filter->Update();
  LT_CHECK_NEAR(suite, opacityOf(filter)->GetComponent(0, 0), 0.95, 1e-6);
  filter->SetDirection(0., 0., 1.);
  filter->SetDepthRange(10., 20.);
  filter->Update();
  LT_CHECK_NEAR(suite, opacityOf(filter)->GetComponent(0, 0), 0.05, 1e-6);
  LT_CHECK_NEAR(suite, opacityOf(filter)->GetComponent(2, 0), 0.95, 1e-6);
  filter->SetDepthSourceToFromViewPoint();
  filter->SetViewPoint(3., 4., 10.);
  filter->SetDepthRange(0., 80.);
  filter->Update();
  const double c = std::tanh(0.4);
  LT_CHECK_NEAR(suite, opacityOf(filter)->GetComponent(2, 0),
    0.05 + 0.9 * (1. - (1. - c) * (1. - 0.0625)), 1e-6);
  auto data = row(curvatures);
  vtkNew<vtkDoubleArray> second;
  second->SetName("Age");
  for (double value : { 0., 0., 5., 10., NaN })
  {
    second->InsertNextValue(value);
  }
  data->GetPointData()->AddArray(second);
  filter->SetInputData(data);
  filter->SetDepthSourceToFromArray();
  filter->SetInputArrayToProcess(1, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, "Age");
  filter->SetDepthRange(0., 0.);
  filter->Update();
  LT_CHECK_NEAR(
    suite, opacityOf(filter)->GetComponent(2, 0), 0.05 + 0.9 * (1. - (1. - c) * 0.75), 1e-6);
  LT_CHECK(suite, opacityOf(filter)->GetComponent(4, 0) == 0.);
  filter->SetDepthSourceToNoDepth();
  filter->Update();
  LT_CHECK_NEAR(suite, opacityOf(filter)->GetComponent(2, 0), 0.05 + 0.9 * c, 1e-6);

  // The function is part of the pipeline.
  filter->GetOpacityFunction()->SetMaximumOpacity(0.5);
  filter->Update();
  LT_CHECK_NEAR(suite, opacityOf(filter)->GetComponent(4, 0), 0.5, 1e-6);

  // Colours for a mapper.
  filter->MakeColorsOn();
  filter->SetColor(1., 0.5, 2.);
  filter->Update();
  auto* colors = vtkUnsignedCharArray::SafeDownCast(
    vtkDataSet::SafeDownCast(filter->GetOutputDataObject(0))->GetPointData()->GetScalars());
  LT_CHECK(suite, colors && colors->GetNumberOfComponents() == 4);
  LT_CHECK(suite,
    colors->GetComponent(4, 0) == 255. && colors->GetComponent(4, 1) == 128. &&
      colors->GetComponent(4, 2) == 255. && colors->GetComponent(4, 3) == 128.);
}

void scale(Suite& suite)
{
  // Chosen from the data: 0.5 at the upper quartile of what is curved, in any unit.
  std::vector<double> curvatures(100, 0.);
  for (int i = 1; i <= 5; ++i)
  {
    curvatures[i] = 0.1 * i;
  }
  for (double unit : { 1., 1e-6, 1e6 })
  {
    vtkNew<Filter> filter;
    filter->SetInputData(row(curvatures, unit));
    filter->Update();
    LT_CHECK_CLOSE(suite, filter->GetComputedCurvatureScale(), unit * std::atanh(.5) / .8, 1e-6);
    const double flat = 1. - 0.5;
    LT_CHECK_NEAR(
      suite, opacityOf(filter)->GetComponent(4, 0), 0.05 + 0.9 * (1. - flat * flat), 1e-6);
  }
  vtkNew<Filter> filter;
  filter->SetInputData(row({ 0., 0., 0. }));
  filter->Update();
  LT_CHECK(suite, filter->GetComputedCurvatureScale() == 0.);
  LT_CHECK_NEAR(suite, opacityOf(filter)->GetComponent(1, 0), 0.05, 1e-6);
}

void images(Suite& suite)
{
  auto image = makeImage(3, 2, 4, VTK_FLOAT, [](int i, int, int) { return i - 1.; });
  image->SetSpacing(1., 2., 0.5);
  image->GetPointData()->GetScalars()->SetName("H");
  vtkNew<Filter> filter;
  filter->SetInputData(image);
  filter->SetInputArrayToProcess(0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, "H");
  filter->SetCurvatureScale(0.5);
  filter->SetDepthSourceToAlongDirection();
  filter->GetOpacityFunction()->SetKindToFocusFront();
  filter->Update();
  LT_CHECK(suite, vtkImageData::SafeDownCast(filter->GetOutput()) != nullptr);
  vtkDataArray* opacity = opacityOf(filter);
  LT_CHECK(suite, opacity && opacity->GetNumberOfTuples() == 24);
  // Seen along -z the last slice is nearest: there FocusFront is 1 - (1 - c)^2.
  const double c = std::tanh(1.);
  LT_CHECK_NEAR(suite, opacity->GetComponent(18, 0), 0.05 + 0.9 * (1. - (1. - c) * (1. - c)), 1e-6);
  LT_CHECK_NEAR(suite, opacity->GetComponent(19, 0), 0.05, 1e-6);
  LT_CHECK_NEAR(suite, opacity->GetComponent(1, 0), 0.95, 1e-6);
}

/** Curvatures in any scalar type; a single voxel; an image that is turned. */
void typesAndGrids(Suite& suite)
{
  for (int type : { VTK_SIGNED_CHAR, VTK_UNSIGNED_CHAR, VTK_SHORT, VTK_UNSIGNED_SHORT, VTK_INT,
         VTK_LONG_LONG, VTK_FLOAT, VTK_DOUBLE })
  {
    auto image = makeImage(3, 2, 2, type, [](int i, int, int) { return 2. * i; });
    vtkNew<vtkMatrix3x3> direction; // z points along x: depth along +x is the slices'
    const double m[9] = { 0., 0., 1., 1., 0., 0., 0., 1., 0. };
    direction->DeepCopy(m);
    image->SetDirectionMatrix(direction);
    image->GetPointData()->GetScalars()->SetName(vtkLightTransportArrays::MeanCurvature);
    vtkNew<Filter> filter;
    filter->SetInputData(image);
    filter->SetCurvatureScale(0.1);
    filter->SetDepthSourceToAlongDirection();
    filter->SetDirection(1., 0., 0.);
    filter->GetOpacityFunction()->SetKindToWideDepth();
    filter->Update();
    const double c = std::tanh(0.1 * 2. * 2.);
    LT_CHECK_NEAR(suite, opacityOf(filter)->GetComponent(1, 0), 0.05 + 0.9 * c, 1e-6);
    LT_CHECK_NEAR(suite, opacityOf(filter)->GetComponent(7, 0), 0.95, 1e-6);
  }
  auto one = makeImage(1, 1, 1, VTK_FLOAT, [](int, int, int) { return 0.; });
  one->GetPointData()->GetScalars()->SetName(vtkLightTransportArrays::MeanCurvature);
  vtkNew<Filter> filter;
  filter->SetInputData(one);
  filter->SetDepthSourceToAlongDirection();
  filter->Update();
  LT_CHECK_NEAR(suite, opacityOf(filter)->GetComponent(0, 0), 0.05, 1e-6);
}

void checkFails(Suite& suite, Filter* filter, const char* words, int line)
{
  const std::vector<std::string> errors = errorsOfUpdate(filter);
  suite.check(errors.size() == 1 && errors[0].find(words) != std::string::npos,
    std::string("one error with \"") + words + "\"" + (errors.empty() ? "" : ": " + errors[0]),
    __FILE__, line);
  suite.check(vtkDataSet::SafeDownCast(filter->GetOutputDataObject(0))->GetNumberOfPoints() == 0,
    "an empty output", __FILE__, line);
}

void badInput(Suite& suite)
{
  vtkNew<Filter> filter;
  filter->SetInputData(vtkNew<vtkPolyData>());
  checkFails(suite, filter, "no points", __LINE__);
  auto data = row({ 0., 1., NaN });
  filter->SetInputData(data);
  filter->Update();
  LT_CHECK(suite, opacityOf(filter)->GetComponent(2, 0) == 0.);
  filter->SetInputArrayToProcess(0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, "No");
  checkFails(suite, filter, "\"No\"", __LINE__);
  filter->SetInputArrayToProcess(
    0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, vtkLightTransportArrays::MeanCurvature);
  filter->SetCurvatureScale(-1.);
  checkFails(suite, filter, "CurvatureScale is -1", __LINE__);
  filter->SetCurvatureScale(1.);
  filter->SetDepthSource(4);
  checkFails(suite, filter, "DepthSource is 4", __LINE__);
  filter->SetDepthSourceToFromArray();
  checkFails(suite, filter, "DepthSource is FromArray", __LINE__);
  filter->SetDepthSourceToAlongDirection();
  filter->SetDirection(0., 0., 0.);
  checkFails(suite, filter, "Direction is 0 0 0", __LINE__);
  filter->SetDirection(1., 0., 0.);
  filter->SetDepthRange(NaN, 0.);
  checkFails(suite, filter, "DepthRange", __LINE__);
  filter->SetDepthRange(0., 0.);
  filter->GetOpacityFunction()->SetMinimumOpacity(2.);
  checkFails(suite, filter, "MinimumOpacity is 2", __LINE__);
  filter->SetOpacityFunction(nullptr);
  checkFails(suite, filter, "OpacityFunction is not set", __LINE__);
  filter->SetOpacityFunction(vtkNew<Function>());
  filter->SetDepthSourceToNoDepth();
  vtkNew<vtkDoubleArray> vectors;
  vectors->SetName("Vectors");
  vectors->SetNumberOfComponents(3);
  vectors->SetNumberOfTuples(3);
  vectors->Fill(1.);
  vtkNew<vtkDoubleArray> few;
  few->SetName("Few");
  few->InsertNextValue(1.);
  data->GetPointData()->AddArray(vectors);
  data->GetPointData()->AddArray(few);
  filter->SetInputArrayToProcess(0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, "Vectors");
  checkFails(suite, filter, "\"Vectors\" has 3 components", __LINE__);
  filter->SetInputArrayToProcess(0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, "Few");
  checkFails(suite, filter, "\"Few\" has 1 tuples", __LINE__);

  // Asked to stop: an empty output, no error.
  filter->SetInputArrayToProcess(
    0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, vtkLightTransportArrays::MeanCurvature);
  vtkNew<vtkCallbackCommand> stop;
  stop->SetCallback(
    [](vtkObject* caller, unsigned long, void*, void*)
    {
      auto* algorithm = vtkAlgorithm::SafeDownCast(caller);
      if (algorithm->GetProgress() > 0.3)
      {
        algorithm->SetAbortExecute(1);
      }
    });
  const unsigned long tag = filter->AddObserver(vtkCommand::ProgressEvent, stop);
  LT_CHECK(suite, errorsOfUpdate(filter).empty());
  LT_CHECK(
    suite, vtkDataSet::SafeDownCast(filter->GetOutputDataObject(0))->GetNumberOfPoints() == 0);
  filter->RemoveObserver(tag);
  filter->SetAbortExecute(0);
  filter->Modified();
  filter->Update();
  LT_CHECK(suite, opacityOf(filter) != nullptr);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  closedForms(suite);
  scale(suite);
  images(suite);
  typesAndGrids(suite);
  badInput(suite);
  return suite.result();
}
