// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Whatever is wrong with a light field is one error, however many frames are
 * drawn, and the stock picture; when it is put right there is light again.
 */
#include "LightSource.h"

#include "vtkCellData.h"
#include "vtkContourValues.h"
#include "vtkIntArray.h"
#include "vtkMultiVolume.h"
#include "vtkSphereSource.h"
#include "vtkTextureObject.h"

#include <limits>

using namespace lighttransport::testing;

namespace
{
vtkSmartPointer<vtkImageData> volume()
{
  auto image = makeGrid(20, 20, 20);
  setScalars(image, [](const Point& p) { return ball(p, { 9.5, 9.5, 9.5 }, 9.); });
  return image;
}

double phi(const Point& p)
{
  return glow(p, { 7., 8., 11. }, 1.);
}

/** Bad in one way; a part of the error that says so. */
struct Case
{
  const char* name;
  const char* error;
  int mode;
  std::function<void(vtkImageData*)> spoil;
};

void testFields(Suite& suite)
{
  const auto rename = [](vtkImageData* f, const char* name)
  { f->GetPointData()->GetArray(vtkLightTransportArrays::Fluence)->SetName(name); };
  const auto put = [](vtkImageData* f, double value)
  {
    f->GetPointData()->GetArray(vtkLightTransportArrays::Fluence)->SetTuple1(17, value);
    f->GetPointData()->GetArray(vtkLightTransportArrays::Fluence)->Modified();
  };
  const std::vector<Case> cases = {
    { "no array", "no point array \"Fluence\"", 0, [=](vtkImageData* f) { rename(f, "fluence"); } },
    { "no flux", "SetComputeFlux", 2, [](vtkImageData*) {} },
    { "cell array", "vtkCellDataToPointData", 0,
      [=](vtkImageData* f)
      {
        rename(f, "other");
        vtkNew<vtkFloatArray> cells;
        cells->SetName("Fluence");
        cells->SetNumberOfTuples(f->GetNumberOfCells());
        f->GetCellData()->AddArray(cells);
      } },
    { "components", "has 2 components, expected 1", 0,
      [](vtkImageData* f)
      {
        vtkNew<vtkFloatArray> array;
        array->SetName("Fluence");
        array->SetNumberOfComponents(2);
        array->SetNumberOfTuples(f->GetNumberOfPoints());
        array->Fill(1.);
        f->GetPointData()->AddArray(array);
      } },
    { "tuples", "has 5 tuples, expected 8000", 0,
      [](vtkImageData* f) { f->GetPointData()->GetArray("Fluence")->SetNumberOfTuples(5); } },
    { "NaN", "NaN or infinite", 0,
      [=](vtkImageData* f) { put(f, std::numeric_limits<double>::quiet_NaN()); } },
    { "infinity", "NaN or infinite", 0,
      [=](vtkImageData* f) { put(f, -std::numeric_limits<double>::infinity()); } },
    { "spacing", "spacing is (0, 1, 1)", 0, [](vtkImageData* f) { f->SetSpacing(0., 1., 1.); } },
    { "empty", "has no points", 0, [](vtkImageData* f) { f->Initialize(); } },
  };
  StockScene stock(volume());
  const Picture expected = stock.capture();
  for (const Case& c : cases)
  {
    LitScene lit(volume());
    auto observer = observe(lit.mapper);
    auto field = makeGrid(20, 20, 20);
    setFluence(field, phi);
    c.spoil(field);
    lit.mapper->SetLightFieldData(field);
    lit.mapper->GetLightFieldProperty()->SetMode(c.mode);
    const auto check = [&](bool ok, const std::string& what)
    { suite.check(ok, std::string(c.name) + ": " + what, __FILE__, __LINE__); };
    for (int i = 0; i < 3; ++i)
    {
      check(difference(expected, lit.capture()).largest == 0., "the stock picture");
    }
    check(observer->errors.size() == 1 && observer->hasError(c.error),
      "one error with '" + std::string(c.error) + "', not " +
        std::to_string(observer->errors.size()) + ": " + observer->all());
    auto good = makeGrid(20, 20, 20);
    setFluence(good, phi);
    lit.mapper->GetLightFieldProperty()->SetMode(0);
    lit.mapper->SetLightFieldData(good);
    check(difference(expected, lit.capture()).largest > 20., "light after it is put right");
    check(observer->errors.size() == 1, "no further error");
    // The same again is told again.
    lit.mapper->SetLightFieldData(field);
    lit.mapper->GetLightFieldProperty()->SetMode(c.mode);
    lit.window->Render();
    check(observer->errors.size() == 2, "told again");
    check(openGLErrors().empty(), "OpenGL error");
  }

  // Integers and doubles are fine.
  LitScene lit(volume());
  auto observer = observe(lit.mapper);
  auto field = makeGrid(20, 20, 20);
  setFluence(field, phi);
  lit.mapper->SetLightFieldData(field);
  const Picture reference = lit.capture();
  setFluence<vtkDoubleArray>(field, phi);
  LT_CHECK(suite, difference(reference, lit.capture()).largest <= 1.);
  setFluence<vtkIntArray>(field, [](const Point& p) { return 1e9 * phi(p); });
  LT_CHECK(suite, difference(reference, lit.capture()).largest <= 1.);
  LT_CHECK(suite, observer->errors.empty());
}

void testProducers(Suite& suite)
{
  StockScene stock(volume());
  const Picture expected = stock.capture();
  LitScene lit(volume());
  auto observer = observe(lit.mapper);
  vtkNew<LightSource> source;
  auto upstream = observe(source);
  // The executive says it too: taken here, so that nothing is printed.
  auto executive = observe(source->GetExecutive());
  source->SetFail(true);
  lit.mapper->SetLightFieldConnection(source->GetOutputPort());
  for (int i = 0; i < 3; ++i)
  {
    LT_CHECK(suite, difference(expected, lit.capture()).largest == 0.);
  }
  LT_CHECK(suite, observer->errors.size() == 1 && observer->hasError("LightSource"));
  LT_CHECK(suite, upstream->errors.size() == 1 && source->Runs == 1);
  source->SetFail(false);
  LT_CHECK(suite, difference(expected, lit.capture()).largest > 20.);
  LT_CHECK(suite, observer->errors.size() == 1 && source->Runs == 2);
  source->SetEmpty(true);
  lit.window->Render();
  LT_CHECK(suite, difference(expected, lit.capture()).largest == 0.);
  LT_CHECK(suite, observer->errors.size() == 2 && observer->hasError("has no points"));

  vtkNew<vtkSphereSource> sphere;
  lit.mapper->SetLightFieldConnection(sphere->GetOutputPort());
  lit.window->Render();
  LT_CHECK(suite, difference(expected, lit.capture()).largest == 0.);
  LT_CHECK(suite, observer->errors.size() == 3 && observer->hasError("vtkPolyData"));
}

/** One error that says what to do where a texture would be too large. */
void testSizes(Suite& suite)
{
  LitScene lit(volume());
  auto observer = observe(lit.mapper);
  lit.window->Render();
  const int limit =
    vtkTextureObject::GetMaximumTextureSize3D(vtkOpenGLRenderWindow::SafeDownCast(lit.window));
  LT_CHECK(suite, limit >= 256);
  auto field = makeGrid(limit + 1, 2, 2);
  setFluence(field, [](const Point&) { return 1.; });
  lit.mapper->SetLightFieldData(field);
  lit.window->Render();
  lit.window->Render();
  LT_CHECK(suite, observer->errors.size() == 1 && observer->hasError("vtkImageResize"));
  LT_CHECK(suite, observer->hasError(std::to_string(limit)));

  auto large = makeGrid(limit + 1, 2, 2);
  setScalars<vtkUnsignedCharArray>(large, [](const Point&) { return 100.; });
  LitScene tooLarge(large);
  auto observer2 = observe(tooLarge.mapper);
  tooLarge.window->Render();
  const Picture picture = tooLarge.capture();
  LT_CHECK(suite, observer2->errors.size() == 1 && observer2->hasError("SetPartitions"));
  LT_CHECK(suite, regionMean(picture, 0, 0, 63, 63)[0] == 0.);
  LT_CHECK(suite, openGLErrors().empty());
}

/** Where the light has no place: one warning. */
void testWarnings(Suite& suite)
{
  auto field = makeGrid(20, 20, 20);
  setFluence(field, phi);
  {
    vtkNew<vtkLightTransportVolumeMapper> mapper;
    vtkNew<vtkOpenGLGPUVolumeRayCastMapper> stockMapper;
    Picture pictures[2];
    auto observer = observe(mapper);
    mapper->SetLightFieldData(field);
    for (int i = 0; i < 2; ++i)
    {
      vtkGPUVolumeRayCastMapper* m = i == 0 ? stockMapper.Get() : mapper.Get();
      LitScene scene(volume());
      vtkNew<vtkMultiVolume> multi;
      multi->SetMapper(m);
      for (int port = 0; port < 2; ++port)
      {
        m->SetInputDataObject(port, volume());
        vtkNew<vtkVolume> part;
        part->SetProperty(scene.property);
        part->SetPosition(4. * port, 0., 0.);
        multi->SetVolume(part, port);
      }
      scene.renderer->RemoveAllViewProps();
      scene.renderer->AddVolume(multi);
      pictures[i] = scene.capture();
      pictures[i] = scene.capture();
    }
    LT_CHECK(suite, difference(pictures[0], pictures[1]).largest == 0.);
    LT_CHECK(suite, regionMean(pictures[0], 0, 0, 63, 63)[0] > 1.);
    LT_CHECK(suite, observer->warnings.size() == 1 && observer->errors.empty());
  }
  LitScene lit(volume());
  auto observer = observe(lit.mapper);
  lit.mapper->SetLightFieldData(field);
  lit.mapper->UseDepthPassOn();
  lit.mapper->GetDepthPassContourValues()->SetValue(0, 40.);
  lit.window->Render();
  lit.window->Render();
  LT_CHECK(suite, observer->warnings.size() == 1 && observer->errors.empty());
  openGLErrors(); // VTK's own
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  if (!canRender())
  {
    return Suite::skipped();
  }
  KeepDisplay keep;
  testFields(suite);
  testProducers(suite);
  testSizes(suite);
  testWarnings(suite);
  return suite.result();
}
