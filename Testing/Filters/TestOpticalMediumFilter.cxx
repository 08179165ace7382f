// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// vtkOpticalMediumFilter: every scalar type, grids of all kinds, walls, bad input.
#include "LightTransportFilterTesting.h"

#include "vtkBitArray.h"
#include "vtkCallbackCommand.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkLightTransportArrays.h"
#include "vtkMatrix3x3.h"
#include "vtkOpticalMediumFilter.h"
#include "vtkPiecewiseFunction.h"
#include "vtkRTAnalyticSource.h"
#include "vtkSOADataArrayTemplate.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkUnsignedCharArray.h"

#include <limits>

using namespace lighttransport::testing;
using Filter = vtkOpticalMediumFilter;
using Image = vtkSmartPointer<vtkImageData>;

namespace
{
const double NaN = std::numeric_limits<double>::quiet_NaN();
const double Infinity = std::numeric_limits<double>::infinity();

vtkDataArray* dOf(vtkAlgorithm* filter)
{
  return pointArray(filter, vtkLightTransportArrays::DiffusionCoefficient);
}
vtkDataArray* sigmaOf(vtkAlgorithm* filter)
{
  return pointArray(filter, vtkLightTransportArrays::Absorption);
}

double largestDifference(vtkDataArray* a, vtkDataArray* b)
{
  double difference = a && b && a->GetNumberOfTuples() == b->GetNumberOfTuples() ? 0. : Infinity;
  for (vtkIdType i = 0; difference < Infinity && i < a->GetNumberOfTuples(); ++i)
  {
    difference = std::max(difference, std::abs(a->GetComponent(i, 0) - b->GetComponent(i, 0)));
  }
  return difference;
}

vtkNew<vtkPiecewiseFunction> ramp(double x0, double y0, double x1, double y1)
{
  vtkNew<vtkPiecewiseFunction> function;
  function->AddPoint(x0, y0);
  function->AddPoint(x1, y1);
  return function;
}

int bump(int i, int j, int k)
{
  return (i * 5 + j * j + 3 * k) % 100;
}

void scalarTypes(Suite& suite)
{
  vtkNew<Filter> reference;
  reference->SetInputData(makeImage(9, 8, 7, VTK_DOUBLE, bump));
  reference->Update();
  vtkNew<Filter> mapped;
  const auto function = ramp(10., 0.1, 90., 1.);
  mapped->SetDiffusionMappingToFromTransferFunction();
  mapped->SetDiffusionFunction(function);
  mapped->SetInputData(makeImage(9, 8, 7, VTK_DOUBLE, bump));
  mapped->Update();
  for (int type : { VTK_CHAR, VTK_SIGNED_CHAR, VTK_UNSIGNED_CHAR, VTK_SHORT, VTK_UNSIGNED_SHORT,
         VTK_INT, VTK_UNSIGNED_INT, VTK_LONG, VTK_UNSIGNED_LONG, VTK_LONG_LONG,
         VTK_UNSIGNED_LONG_LONG, VTK_ID_TYPE, VTK_FLOAT })
  {
    for (Filter* expected : { reference.Get(), mapped.Get() })
    {
      vtkNew<Filter> filter;
      filter->SetDiffusionMapping(expected->GetDiffusionMapping());
      filter->SetDiffusionFunction(expected->GetDiffusionFunction());
      filter->SetInputData(makeImage(9, 8, 7, type, bump));
      filter->Update();
      suite.check(largestDifference(dOf(filter), dOf(expected)) == 0. &&
          largestDifference(sigmaOf(filter), sigmaOf(expected)) == 0.,
        "scalar type " + std::to_string(type), __FILE__, __LINE__);
      LT_CHECK(suite, dOf(filter) && dOf(filter)->GetDataType() == VTK_FLOAT);
    }
  }
  // Negative integers; integers of a range too long for a table.
  for (double factor : { -1., 1e7 })
  {
    vtkNew<Filter> filter;
    const auto scaled = factor < 0. ? ramp(-90., 1., -10., 0.1) : ramp(10e7, 0.1, 90e7, 1.);
    filter->SetDiffusionMappingToFromTransferFunction();
    filter->SetDiffusionFunction(scaled);
    filter->SetInputData(makeImage(
      9, 8, 7, VTK_INT, [factor](int i, int j, int k) { return factor * bump(i, j, k); }));
    filter->Update();
    LT_CHECK_NEAR(suite, largestDifference(dOf(filter), dOf(mapped)), 0., 1e-7);
  }
  // A step, on floats: exact on either side, not interpolated by a table.
  vtkNew<vtkPiecewiseFunction> step;
  step->AddPoint(0., 0.);
  step->AddPoint(50., 0.);
  step->AddPoint(50.0001, 1.);
  vtkNew<Filter> filter;
  filter->SetDiffusionMappingToFromTransferFunction();
  filter->SetDiffusionFunction(step);
  filter->SetInputData(
    makeImage(2, 1, 1, VTK_DOUBLE, [](int i, int, int) { return i == 0 ? 49.9999 : 50.0002; }));
  filter->Update();
  LT_CHECK(suite, dOf(filter)->GetComponent(0, 0) < 1.1e-6);
  LT_CHECK(suite, dOf(filter)->GetComponent(1, 0) == 1.);

  // Bits and structure-of-arrays go too; so does another component.
  Image image = makeImage(9, 8, 7, VTK_UNSIGNED_CHAR, [](int i, int, int) { return i > 4; });
  vtkNew<Filter> bytes;
  bytes->SetInputData(image);
  bytes->Update();
  Image bits = Image::New();
  bits->SetDimensions(9, 8, 7);
  vtkNew<vtkBitArray> bitArray;
  vtkNew<vtkSOADataArrayTemplate<double>> soa;
  soa->SetNumberOfComponents(3);
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    const double value = image->GetPointData()->GetScalars()->GetComponent(i, 0);
    bitArray->InsertNextValue(static_cast<int>(value));
    const double tuple[3] = { -5., 7. * double(i), value };
    soa->InsertNextTuple(tuple);
  }
  bits->GetPointData()->SetScalars(bitArray);
  vtkNew<Filter> other;
  other->SetInputData(bits);
  other->Update();
  LT_CHECK(suite, largestDifference(dOf(other), dOf(bytes)) == 0.);
  soa->SetName("three");
  bits->GetPointData()->AddArray(soa);
  other->SetInputArrayToProcess(0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, "three");
  other->SetComponent(2);
  other->Update();
  LT_CHECK(suite, largestDifference(dOf(other), dOf(bytes)) == 0.);
}

void geometry(Suite& suite)
{
  // |grad| of a world ramp: 3 along x', 4 along y' of the grid's own axes; sigma = 5.
  const double h[3] = { 0.5, 2., 1.25 };
  const auto f = [&h](int i, int j, int) { return 3. * h[0] * i + 4. * h[1] * j; };
  const double beta = std::exp(-1.);
  for (int turned = 0; turned < 2; ++turned)
  {
    Image image = makeImage(11, 10, 9, VTK_FLOAT, f);
    image->SetSpacing(h);
    image->SetOrigin(-7., 1e3, 3.);
    if (turned)
    {
      // Extents that do not start at 0, and a rotation by 30 degrees with a mirrored axis.
      image->SetExtent(-4, 6, 100, 109, 7, 15);
      image->SetDirectionMatrix(std::cos(0.5236), -std::sin(0.5236), 0., std::sin(0.5236),
        std::cos(0.5236), 0., 0., 0., -1.);
    }
    vtkNew<vtkDoubleArray> note;
    note->SetName("note");
    note->InsertNextValue(1.);
    image->GetFieldData()->AddArray(note);
    vtkNew<Filter> filter;
    filter->SetGradientScale(5.);
    filter->SetDiffusionLength(2.);
    filter->SetInputData(image);
    filter->Update();
    vtkImageData* output = filter->GetOutput();
    double worst = 0.;
    for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
    {
      worst = std::max(worst, std::abs(dOf(filter)->GetComponent(i, 0) - 2. * beta));
      worst = std::max(worst, std::abs(sigmaOf(filter)->GetComponent(i, 0) - (1. - beta) / 2.));
    }
    LT_CHECK_NEAR(suite, worst, 0., 1e-6);
    LT_CHECK(suite, filter->GetComputedGradientScale() == 5.);

    // The grid and the arrays pass through; the input itself is left alone.
    LT_CHECK(suite, std::equal(output->GetExtent(), output->GetExtent() + 6, image->GetExtent()));
    LT_CHECK(suite, std::equal(output->GetSpacing(), output->GetSpacing() + 3, h));
    LT_CHECK(suite, output->GetOrigin()[1] == 1e3);
    for (int i = 0; i < 9; ++i)
    {
      LT_CHECK(suite,
        output->GetDirectionMatrix()->GetData()[i] == image->GetDirectionMatrix()->GetData()[i]);
    }
    LT_CHECK(suite, output->GetPointData()->GetScalars() == image->GetPointData()->GetScalars());
    LT_CHECK(suite, image->GetPointData()->GetNumberOfArrays() == 1);
    LT_CHECK(suite, image->GetFieldData()->GetNumberOfArrays() == 1);
    vtkDataArray* scale = output->GetFieldData()->GetArray("OpticalMedium.GradientScale");
    vtkDataArray* ell = output->GetFieldData()->GetArray("OpticalMedium.DiffusionLength");
    LT_CHECK(suite, scale && scale->GetComponent(0, 0) == 5.);
    LT_CHECK(suite, ell && ell->GetComponent(0, 0) == 2.);
    LT_CHECK(suite, output->GetFieldData()->GetArray("note") == note.Get());

    // The scale point is a world point: the centre of the last voxel, then one outside.
    double corner[3];
    const double last[3] = { double(image->GetExtent()[1]), double(image->GetExtent()[3]),
      double(image->GetExtent()[5]) };
    image->TransformContinuousIndexToPhysicalPoint(last, corner);
    filter->SetGradientScale(0.);
    filter->SetScalePoint(corner);
    LT_CHECK(suite, errorsOfUpdate(filter).empty());
    // All gradients are 5: sqrt(2) 1.4826 of it.
    LT_CHECK_CLOSE(suite, filter->GetComputedGradientScale(), std::sqrt(2.) * 1.4826 * 5., 1e-5);
    filter->SetScalePoint(corner[0], corner[1], corner[2] + (turned ? -3. : 3.));
    LT_CHECK_FAILS(suite, filter, "ScalePoint", "inside the volume");
    filter->ClearScalePoint();
    LT_CHECK(suite, errorsOfUpdate(filter).empty());
  }

  // Thin and single: the smallest spacing is that of the axes with more than one point.
  for (const auto& dims : { std::array<int, 3>{ { 1, 6, 7 } }, { { 1, 1, 6 } }, { { 1, 1, 1 } } })
  {
    Image image = makeImage(dims[0], dims[1], dims[2], VTK_SHORT, bump);
    image->SetSpacing(0.01, 2., 3.);
    vtkNew<Filter> filter;
    filter->SetInputData(image);
    LT_CHECK(suite, errorsOfUpdate(filter).empty());
    const double ell = dims[1] > 1 ? 2. : dims[2] > 1 ? 3. : 0.01;
    vtkDataArray* length =
      filter->GetOutput()->GetFieldData()->GetArray("OpticalMedium.DiffusionLength");
    LT_CHECK(suite, length && length->GetComponent(0, 0) == ell);
    LT_CHECK(suite, dOf(filter) && dOf(filter)->GetComponent(0, 0) > 0.);
  }
  // A constant lets all light pass.
  vtkNew<Filter> filter;
  filter->SetInputData(makeImage(5, 5, 5, VTK_FLOAT, [](int, int, int) { return 1e30; }));
  filter->Update();
  LT_CHECK(suite, dOf(filter)->GetRange()[0] == 1. && sigmaOf(filter)->GetRange()[1] == 0.);
  LT_CHECK(suite, filter->GetComputedGradientScale() == 0.);
}

void mappings(Suite& suite)
{
  // f(S) has the slope 1/100 where the ramp rises: its gradient is that of S / 100 there.
  const auto f = [](int i, int j, int) { return 20. + 2. * i + 1.5 * j; };
  Image image = makeImage(15, 15, 5, VTK_FLOAT, f);
  const auto opacity = ramp(0., 0., 100., 1.);
  vtkNew<Filter> filter;
  filter->SetInputData(image);
  filter->SetDiffusionFunction(opacity);
  filter->SetDiffusionMappingToFromTransferFunctionGradient();
  filter->SetGradientScale(0.025);
  filter->Update();
  LT_CHECK_NEAR(suite, dOf(filter)->GetRange()[0], std::exp(-1.), 1e-6);
  LT_CHECK_NEAR(suite, dOf(filter)->GetRange()[1], std::exp(-1.), 1e-6);
  filter->SetGradientFunction(Filter::Rational);
  filter->Update();
  LT_CHECK_NEAR(suite, dOf(filter)->GetRange()[0], 0.5, 1e-6);
  filter->SetGradientFunction(Filter::Exponential);
  filter->DiffusionComplementOn();
  filter->Update();
  LT_CHECK_NEAR(suite, dOf(filter)->GetRange()[1], 1. - std::exp(-1.), 1e-6);
  // A change of the function is seen: its edge outside of the data leaves nothing to stop light.
  filter->DiffusionComplementOff();
  opacity->RemoveAllPoints();
  opacity->AddPoint(200., 0.);
  opacity->AddPoint(300., 1.);
  filter->Update();
  LT_CHECK(suite, dOf(filter)->GetRange()[0] == 1.);

  // Absorption by a function of the scalar, with the reach on top.
  const auto absorption = ramp(20., 0.5, 70., 5.5);
  filter->SetDiffusionMappingToFromTransferFunction();
  opacity->RemoveAllPoints();
  opacity->AddPoint(0., 0.5);
  opacity->AddPoint(100., 0.5);
  filter->SetAbsorptionFunction(absorption);
  filter->SetAbsorptionMappingToFromFunction();
  filter->SetReach(5.);
  filter->Update();
  LT_CHECK_CLOSE(suite, sigmaOf(filter)->GetComponent(0, 0), 0.5 + 0.5 / 25., 1e-6);
  LT_CHECK_CLOSE(suite, sigmaOf(filter)->GetComponent(10, 0), 2.5 + 0.5 / 25., 1e-6);
  filter->SetReach(0.);
  filter->SetAbsorptionMappingToFromAlbedo();
  filter->SetAlbedo(0.9);
  filter->SetAnisotropy(0.5);
  filter->Update();
  LT_CHECK_CLOSE(suite, sigmaOf(filter)->GetComponent(0, 0), 0.1 / (3. * 0.55 * 0.5), 1e-6);
  filter->SetAlbedo(1.);
  filter->Update();
  LT_CHECK(suite, sigmaOf(filter)->GetRange()[1] == 0.);
}

void walls(Suite& suite)
{
  // NaN, two no-data values (one an infinity) and a hidden point.
  const auto f = [](int i, int j, int k) -> double {
    return i == 3 && j == 3 ? NaN : i == 5 && k == 2 ? -999.25 : i == 7 && j == 1 ? Infinity : 10.;
  };
  Image image = makeImage(9, 8, 7, VTK_FLOAT, f);
  vtkNew<vtkUnsignedCharArray> ghosts;
  ghosts->SetName(vtkDataSetAttributes::GhostArrayName());
  ghosts->SetNumberOfTuples(image->GetNumberOfPoints());
  ghosts->Fill(0);
  const vtkIdType hidden = 8 + 9 * (7 + 8 * 6);
  ghosts->SetValue(hidden, vtkDataSetAttributes::HIDDENPOINT);
  ghosts->SetValue(0, vtkDataSetAttributes::DUPLICATEPOINT); // no wall
  image->GetPointData()->AddArray(ghosts);
  image->GetPointData()->GetScalars()->SetComponent(hidden, 0, 1e9);
  vtkNew<Filter> filter;
  filter->SetInputData(image);
  filter->AddNoDataValue(-999.25);
  filter->AddNoDataValue(Infinity);
  filter->AddNoDataValue(1e300); // no float can hold it
  filter->SetDiffusionLength(4.);
  for (int mapping : { Filter::FromScalarGradient, Filter::FromTransferFunction })
  {
    const auto function = ramp(0., 1., 1., 1.);
    filter->SetDiffusionFunction(function);
    filter->SetDiffusionMapping(mapping);
    LT_CHECK(suite, errorsOfUpdate(filter).empty());
    bool right = true;
    for (int k = 0; k < 7; ++k)
    {
      for (int j = 0; j < 8; ++j)
      {
        for (int i = 0; i < 9; ++i)
        {
          // What is not a wall is constant, up to the wall: D = ell, no absorption.
          const vtkIdType at = i + 9 * (j + 8 * k);
          const bool wall = f(i, j, k) != 10. || at == hidden;
          right = right && dOf(filter)->GetComponent(at, 0) == (wall ? 0. : 4.) &&
            sigmaOf(filter)->GetComponent(at, 0) == (wall ? 0.25 : 0.);
        }
      }
    }
    LT_CHECK(suite, right);
  }
  filter->RemoveAllNoDataValues();
  LT_CHECK_FAILS(suite, filter, "infinity", "point 16", "ImageScalars");

  // In the scalars' own type: -32768 of a short, 255 of bytes, 0.1 of floats.
  for (const auto& typed :
    { std::pair<int, double>{ VTK_SHORT, -32768. }, { VTK_UNSIGNED_CHAR, 255. }, { VTK_FLOAT, 0.1 },
      { VTK_UNSIGNED_LONG_LONG, 18446744073709551615. } })
  {
    vtkNew<Filter> own;
    own->SetInputData(makeImage(4, 4, 4, typed.first,
      [&](int i, int, int) { return i == 2 && typed.second < 1e19 ? typed.second : 1.; }));
    own->AddNoDataValue(typed.second);
    own->AddNoDataValue(0.5); // no integer is equal to it
    LT_CHECK(suite, errorsOfUpdate(own).empty());
    LT_CHECK(suite, dOf(own)->GetComponent(1, 0) == 1.);
    LT_CHECK(suite, dOf(own)->GetComponent(2, 0) == (typed.second < 1e19 ? 0. : 1.));
  }
  // Nothing but walls.
  vtkNew<Filter> none;
  none->SetInputData(makeImage(4, 4, 4, VTK_DOUBLE, [](int, int, int) { return NaN; }));
  LT_CHECK(suite, errorsOfUpdate(none).empty());
  LT_CHECK(suite, dOf(none)->GetRange()[1] == 0.);
}

void pipeline(Suite& suite)
{
  // The filter asks for the whole, whatever is asked of it.
  vtkNew<vtkRTAnalyticSource> source;
  source->SetWholeExtent(-8, 9, -7, 8, -6, 9);
  vtkNew<Filter> whole;
  whole->SetInputConnection(source->GetOutputPort());
  whole->Update();
  vtkNew<vtkRTAnalyticSource> again;
  again->SetWholeExtent(-8, 9, -7, 8, -6, 9);
  vtkNew<Filter> part;
  part->SetInputConnection(again->GetOutputPort());
  const int some[6] = { 0, 2, -1, 1, 3, 3 };
  part->UpdateExtent(some);
  LT_CHECK(suite, part->GetOutput()->GetNumberOfPoints() == 18 * 16 * 16);
  LT_CHECK(suite, largestDifference(dOf(part), dOf(whole)) == 0.);

  // Aborted: no error, nothing half done. Progress rises to 1.
  struct Watch
  {
    double last = 0.;
    bool rises = true;
    bool abort = false;
  } watch;
  vtkNew<vtkCallbackCommand> observer;
  observer->SetClientData(&watch);
  observer->SetCallback(
    [](vtkObject* caller, unsigned long, void* client, void* data)
    {
      auto* w = static_cast<Watch*>(client);
      const double progress = *static_cast<double*>(data);
      w->rises = w->rises && progress >= w->last;
      w->last = progress;
      if (w->abort && progress > 0.3)
      {
        static_cast<vtkAlgorithm*>(caller)->SetAbortExecute(1);
      }
    });
  whole->AddObserver(vtkCommand::ProgressEvent, observer);
  whole->Modified();
  whole->Update();
  LT_CHECK(suite, watch.rises && watch.last == 1.);
  watch.abort = true;
  watch.last = 0.;
  whole->Modified();
  LT_CHECK(suite, errorsOfUpdate(whole).empty());
  LT_CHECK(suite, watch.last < 0.9);
  LT_CHECK(suite, whole->GetOutput()->GetPointData()->GetNumberOfArrays() == 0);
  watch.abort = false;
  watch.last = 0.;
  whole->Modified();
  whole->Update();
  LT_CHECK(suite, largestDifference(dOf(part), dOf(whole)) == 0.);
}

void badInput(Suite& suite)
{
  Image image = makeImage(4, 4, 4, VTK_FLOAT, bump);
  vtkNew<Filter> filter;
  filter->SetInputData(image);
  const auto good = ramp(0., 0., 100., 1.);
  // Each is set, fails with its name, value and what was expected, and is set back.
  const auto fails = [&](auto set, double bad, double fine, const char* name, const char* expected)
  {
    set(bad);
    LT_CHECK_FAILS(suite, filter, name, expected);
    set(fine);
    LT_CHECK(suite, errorsOfUpdate(filter).empty());
  };
  for (double bad : { 0., -1e-6, 1.5, NaN })
  {
    fails([&](double v) { filter->SetBetaFloor(v); }, bad, 1e-6, "BetaFloor", "(0, 1]");
  }
  for (double bad : { -0.1, 1.1, NaN })
  {
    fails([&](double v) { filter->SetAlbedo(v); }, bad, 0.9, "Albedo", "[0, 1]");
  }
  for (double bad : { -1., 1., NaN })
  {
    fails([&](double v) { filter->SetAnisotropy(v); }, bad, 0., "Anisotropy", "(-1, 1)");
  }
  for (double bad : { -1., Infinity, NaN })
  {
    fails([&](double v) { filter->SetGradientScale(v); }, bad, 0., "GradientScale", ">= 0");
    fails([&](double v) { filter->SetDiffusionLength(v); }, bad, 0., "DiffusionLength", ">= 0");
    fails([&](double v) { filter->SetReach(v); }, bad, 0., "Reach", ">= 0");
  }
  fails([&](double v) { filter->SetDerivativeScale(v); }, NaN, -1., "DerivativeScale", "finite");
  fails([&](double v) { filter->SetDerivativeScale(v); }, 33., 32., "DerivativeScale is 33",
    "at most 32");
  fails([&](double v) { filter->SetDiffusionLength(v); }, 1e200, 0., "DiffusionLength", "float32");
  fails([&](double v) { filter->SetBetaFloor(v); }, 1e-300, 1e-6, "BetaFloor", "float32");
  fails([&](double v) { filter->SetReach(v); }, 1e-200, 0., "Reach", "float32");
  fails([&](double v) { filter->SetComponent(int(v)); }, 1., 0., "Component is 1", "0 to 0");
  fails([&](double v) { filter->SetComponent(int(v)); }, -1., 0., "Component is -1", "0 to 0");
  fails([&](double v) { filter->SetDiffusionMapping(int(v)); }, 7., 1., "DiffusionMapping is 7",
    "0 to 2");
  fails([&](double v) { filter->SetAbsorptionMapping(int(v)); }, -1., 0., "AbsorptionMapping is -1",
    "0 to 2");
  fails([&](double v) { filter->SetGradientFunction(int(v)); }, 2., 0., "GradientFunction is 2",
    "0 or 1");

  for (int mapping : { Filter::FromTransferFunction, Filter::FromTransferFunctionGradient })
  {
    filter->SetDiffusionMapping(mapping);
    filter->SetDiffusionFunction(nullptr);
    LT_CHECK_FAILS(suite, filter, "DiffusionFunction", "not set");
    vtkNew<vtkPiecewiseFunction> empty;
    filter->SetDiffusionFunction(empty);
    LT_CHECK_FAILS(suite, filter, "DiffusionFunction", "without points");
    const auto high = ramp(0., 0., 1., 1.5);
    filter->SetDiffusionFunction(high);
    LT_CHECK_FAILS(suite, filter, "DiffusionFunction", "1.5 at 1", "[0, 1]");
    filter->SetDiffusionFunction(good);
    LT_CHECK(suite, errorsOfUpdate(filter).empty());
  }
  filter->SetAbsorptionMappingToFromFunction();
  LT_CHECK_FAILS(suite, filter, "AbsorptionFunction", "not set");
  const auto negative = ramp(0., 1., 5., -2.);
  filter->SetAbsorptionFunction(negative);
  LT_CHECK_FAILS(suite, filter, "AbsorptionFunction", "-2 at 5", ">= 0");
  filter->SetAbsorptionMappingToFromComplement();

  // Arrays.
  filter->SetInputArrayToProcess(0, 0, 0, vtkDataObject::FIELD_ASSOCIATION_POINTS, "no such");
  LT_CHECK_FAILS(suite, filter, "\"no such\"", "SetInputArrayToProcess");
  vtkNew<Filter> bare;
  vtkNew<vtkImageData> noScalars;
  noScalars->SetDimensions(3, 3, 3);
  bare->SetInputData(noScalars);
  LT_CHECK_FAILS(suite, bare, "no point array", "expected");
  vtkNew<vtkFloatArray> shortArray;
  shortArray->SetName("short");
  shortArray->SetNumberOfTuples(5);
  noScalars->GetPointData()->SetScalars(shortArray);
  LT_CHECK_FAILS(suite, bare, "\"short\" has 5 tuples", "27");

  // Geometry. An empty image, spacings, an origin, directions.
  vtkNew<vtkImageData> nothing;
  bare->SetInputData(nothing);
  LT_CHECK_FAILS(suite, bare, "empty", "at least one point");
  for (double bad : { 0., -1., NaN, Infinity })
  {
    Image other = makeImage(4, 4, 4, VTK_FLOAT, bump);
    other->SetSpacing(1., bad, 1.);
    bare->SetInputData(other);
    LT_CHECK_FAILS(suite, bare, "spacing", "positive finite");
  }
  Image moved = makeImage(4, 4, 4, VTK_FLOAT, bump);
  moved->SetOrigin(1., NaN, 1.);
  bare->SetInputData(moved);
  LT_CHECK_FAILS(suite, bare, "origin", "finite");
  Image sheared = makeImage(4, 4, 4, VTK_FLOAT, bump);
  sheared->SetDirectionMatrix(1., 0.3, 0., 0., 1., 0., 0., 0., 1.);
  bare->SetInputData(sheared);
  LT_CHECK_FAILS(suite, bare, "direction matrix", "orthonormal");

  // Scalars that no double range can hold.
  bare->SetInputData(
    makeImage(2, 1, 1, VTK_DOUBLE, [](int i, int, int) { return i == 0 ? -1.7e308 : 1.7e308; }));
  LT_CHECK_FAILS(suite, bare, "reaches from", "double");
  // Infinities.
  bare->SetInputData(
    makeImage(4, 1, 1, VTK_DOUBLE, [](int i, int, int) { return i == 2 ? -Infinity : 0.; }));
  LT_CHECK_FAILS(suite, bare, "infinity at point 2", "no-data");

  // After an error, good input works again.
  bare->SetInputData(image);
  LT_CHECK(suite, errorsOfUpdate(bare).empty());
  LT_CHECK(suite, dOf(bare) != nullptr);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  Suite::trapFloatingPoint();
  scalarTypes(suite);
  geometry(suite);
  mappings(suite);
  walls(suite);
  pipeline(suite);
  allowFloatingPointExceptions();
  badInput(suite);
  return suite.result();
}
