// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * Shapes of vtkBucketedKBufferPass: an actor, a block, values of a cell or a point
 * array; each mapper's own property; very many actors and shapes; bad arrays.
 */
#include "KBufferScene.h"

#include "vtkAppendPolyData.h"
#include "vtkCellData.h"
#include "vtkCompositeDataDisplayAttributes.h"
#include "vtkCompositePolyDataMapper2.h"
#include "vtkCurvatureOpacityFunction.h"
#include "vtkCurvatureOpacityPolyDataMapper.h"
#include "vtkCurvatureOpacityProperty.h"
#include "vtkIntArray.h"
#include "vtkMultiBlockDataSet.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPointData.h"
#include "vtkPolyDataNormals.h"

using namespace lighttransport::testing;

namespace
{
/** Flat parts vanish, outlines of shapes are opaque. */
void showOutlines(vtkCurvatureOpacityProperty* property)
{
  vtkNew<vtkPiecewiseFunction> ramp;
  ramp->AddPoint(.1, 0.);
  ramp->AddPoint(.9, 1.);
  property->GetOpacityFunction()->SetKindToProduct();
  property->GetOpacityFunction()->SetCurvatureFunction(ramp);
  property->CurvatureOpacityOn();
}

/** n x n squares of two triangles on [0,1]^2. */
vtkSmartPointer<vtkPolyData> grid(int n)
{
  auto data = vtkSmartPointer<vtkPolyData>::New();
  vtkNew<vtkPoints> points;
  vtkNew<vtkCellArray> cells;
  for (int y = 0; y <= n; ++y)
  {
    for (int x = 0; x <= n; ++x)
    {
      points->InsertNextPoint(double(x) / n, double(y) / n, 0.);
    }
  }
  for (int y = 0; y < n; ++y)
  {
    for (int x = 0; x < n; ++x)
    {
      const vtkIdType i = x + y * (n + 1);
      const vtkIdType lower[3] = { i, i + 1, i + n + 2 };
      const vtkIdType upper[3] = { i, i + n + 2, i + n + 1 };
      cells->InsertNextCell(3, lower);
      cells->InsertNextCell(3, upper);
    }
  }
  data->SetPoints(points);
  data->SetPolys(cells);
  return data;
}

vtkSmartPointer<vtkActor> actorOf(vtkMapper* mapper)
{
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  actor->GetProperty()->SetAmbient(1.);
  actor->GetProperty()->SetDiffuse(0.);
  actor->GetProperty()->SetOpacity(.99);
  return actor;
}

/** How many of the columns 2 to n - 3 of the middle row are drawn. */
int drawnColumns(KBufferScene& scene)
{
  const auto pixels = scene.capture();
  const int* size = scene.window->GetActualSize();
  int drawn = 0;
  for (int column = 2; column < size[0] - 2; ++column)
  {
    drawn += pixels[4 * (std::size_t(size[1] / 2 + 1) * size[0] + column)] > 128;
  }
  return drawn;
}

/** Two halves of a square, left and right: a line between them if they are two shapes. */
void testShapes(Suite& suite)
{
  struct Case
  {
    const char* name;
    const char* array;
    bool ofCells;
    bool exists;
    int shapes;
  };
  const Case cases[] = { { "actor", "", true, false, 1 }, { "cells", "Part", true, true, 2 },
    { "points", "Part", false, true, 2 }, { "missing", "Part", true, false, 1 } };
  for (const Case& c : cases)
  {
    KBufferScene scene(40, 40);
    scene.renderer->SetBackground(0., 0., 0.);
    auto data = grid(2);
    vtkNew<vtkIntArray> part;
    part->SetName("Part");
    if (c.ofCells)
    {
      for (vtkIdType i = 0; i < 8; ++i)
      {
        part->InsertNextValue((i / 2) % 2 == 0 ? -7 : 123456789);
      }
    }
    else
    {
      for (vtkIdType i = 0; i < 9; ++i)
      {
        part->InsertNextValue(i % 3 == 0 ? 5 : 6); // of a cell's first point
      }
    }
    if (c.exists)
    {
      (c.ofCells ? static_cast<vtkFieldData*>(data->GetCellData())
                 : static_cast<vtkFieldData*>(data->GetPointData()))
        ->AddArray(part);
    }
    vtkNew<vtkCurvatureOpacityPolyDataMapper> mapper;
    mapper->SetInputData(data);
    mapper->ScalarVisibilityOff();
    mapper->SetShapeIdArray(c.array);
    vtkNew<MessageLog> log;
    mapper->AddObserver(vtkCommand::ErrorEvent, log);
    showOutlines(mapper->GetCurvatureOpacityProperty());
    scene.renderer->AddActor(actorOf(mapper));
    const int drawn = drawnColumns(scene);
    const bool two = c.shapes > 1;
    suite.check(drawn == (two ? 2 : 0),
      std::string(c.name) + ": " + std::to_string(drawn) + " columns of a line", __FILE__,
      __LINE__);
    LT_CHECK(suite, drawnColumns(scene) == drawn);
    LT_CHECK(suite, mapper->GetNumberOfShapes() == c.shapes);
    const bool bad = *c.array && !c.exists;
    LT_CHECK(suite, log->messages.size() == (bad ? 1U : 0U));
    LT_CHECK(suite, !bad || log->messages[0].find("\"Part\"") != std::string::npos);
    LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());
  }

  // Two actors of stock mappers, and two blocks of a composite.
  for (const bool blocks : { false, true })
  {
    KBufferScene scene(40, 40);
    scene.renderer->SetBackground(0., 0., 0.);
    showOutlines(scene.pass->GetCurvatureOpacityProperty());
    vtkNew<vtkMultiBlockDataSet> both;
    for (unsigned half = 0; half < 2; ++half)
    {
      auto data = grid(3);
      for (vtkIdType i = 0; i < data->GetNumberOfPoints(); ++i)
      {
        double p[3];
        data->GetPoint(i, p);
        data->GetPoints()->SetPoint(i, .5 * (p[0] + half), p[1], 0.);
      }
      both->SetBlock(half, data);
      if (!blocks)
      {
        vtkNew<vtkPolyDataMapper> mapper;
        mapper->SetInputData(data);
        scene.renderer->AddActor(actorOf(mapper));
      }
    }
    if (blocks)
    {
      vtkNew<vtkCompositePolyDataMapper2> mapper;
      mapper->SetInputDataObject(both);
      scene.renderer->AddActor(actorOf(mapper));
    }
    const int drawn = drawnColumns(scene);
    suite.check(drawn == 2,
      std::string(blocks ? "blocks: " : "actors: ") + std::to_string(drawn) + " columns of a line",
      __FILE__, __LINE__);
  }
}

/** Two surfaces side by side, each with its own property or the pass's. */
void testProperties(Suite& suite)
{
  KBufferScene scene(60, 20);
  scene.renderer->SetBackground(0., 0., 0.);
  const double opacities[3] = { .3, .9, .6 };
  for (int i = 0; i < 3; ++i)
  {
    auto data = grid(1);
    for (vtkIdType p = 0; p < 4; ++p)
    {
      double x[3];
      data->GetPoint(p, x);
      data->GetPoints()->SetPoint(p, x[0] + i - 1., x[1], 0.);
    }
    vtkSmartPointer<vtkPolyDataMapper> mapper;
    vtkCurvatureOpacityProperty* property = scene.pass->GetCurvatureOpacityProperty();
    if (i < 2)
    {
      auto own = vtkSmartPointer<vtkCurvatureOpacityPolyDataMapper>::New();
      property = own->GetCurvatureOpacityProperty();
      mapper = own;
    }
    else
    {
      mapper = vtkSmartPointer<vtkPolyDataMapper>::New();
    }
    vtkNew<vtkPiecewiseFunction> constant;
    constant->AddPoint(0., opacities[i]);
    constant->AddPoint(1., opacities[i]);
    property->GetOpacityFunction()->SetKindToProduct();
    property->GetOpacityFunction()->SetCurvatureFunction(constant);
    property->CurvatureOpacityOn();
    mapper->SetInputData(data);
    scene.renderer->AddActor(actorOf(mapper));
  }
  const auto pixels = scene.capture();
  for (int i = 0; i < 3; ++i)
  {
    LT_CHECK_NEAR(suite, double(pixels[4 * (10 * 60 + 20 * i + 10)]), 255. * opacities[i], 1.);
  }
}

void testMany(Suite& suite)
{
  {
    // 100 000 shapes, each a triangle of about a pixel.
    KBufferScene scene(48, 48);
    auto data = grid(224);
    const vtkIdType cells = data->GetNumberOfCells();
    LT_CHECK(suite, cells > 100000);
    vtkNew<vtkIntArray> part;
    part->SetName("Part");
    part->SetNumberOfTuples(cells);
    for (vtkIdType i = 0; i < cells; ++i)
    {
      part->SetValue(i, static_cast<int>(i));
    }
    data->GetCellData()->AddArray(part);
    vtkNew<vtkCurvatureOpacityPolyDataMapper> mapper;
    mapper->SetInputData(data);
    mapper->ScalarVisibilityOff();
    mapper->SetShapeIdArray("Part");
    showOutlines(mapper->GetCurvatureOpacityProperty());
    scene.renderer->AddActor(actorOf(mapper));
    const auto pixels = scene.capture();
    LT_CHECK(suite, mapper->GetNumberOfShapes() == cells);
    // No pixel has a neighbour of its shape: all outline, opaque white.
    LT_CHECK(suite, *std::min_element(pixels.begin(), pixels.end()) >= 252);
    mapper->SetShapeIdArray("");
    const auto one = scene.capture();
    LT_CHECK(suite, std::count(one.begin(), one.end(), 255) < 48 * 48 * 2);
    LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());
  }
  {
    // 5000 actors of one triangle.
    const int side = 50;
    KBufferScene scene(side, side);
    showOutlines(scene.pass->GetCurvatureOpacityProperty());
    auto data = grid(side);
    for (vtkIdType i = 0; i < data->GetNumberOfCells(); ++i)
    {
      vtkNew<vtkPolyData> triangle;
      vtkNew<vtkPoints> points;
      vtkNew<vtkIdList> ids;
      vtkNew<vtkCellArray> cell;
      data->GetCellPoints(i, ids);
      for (int k = 0; k < 3; ++k)
      {
        points->InsertNextPoint(data->GetPoint(ids->GetId(k)));
      }
      const vtkIdType corners[3] = { 0, 1, 2 };
      cell->InsertNextCell(3, corners);
      triangle->SetPoints(points);
      triangle->SetPolys(cell);
      vtkNew<vtkPolyDataMapper> mapper;
      mapper->SetInputData(triangle);
      scene.renderer->AddActor(actorOf(mapper));
    }
    const auto pixels = scene.capture();
    LT_CHECK(suite, scene.renderer->GetActors()->GetNumberOfItems() == 5000);
    LT_CHECK(suite, scene.pass->GetNumberOfFragments() == side * side);
    LT_CHECK(suite, *std::min_element(pixels.begin(), pixels.end()) >= 252);
    LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());
  }
}

/** Without the pass it is its superclass. */
void testStock(Suite& suite)
{
  std::vector<unsigned char> pictures[2];
  for (const bool ours : { false, true })
  {
    KBufferScene scene;
    scene.renderer->SetPass(nullptr);
    auto mapper = ours
      ? vtkSmartPointer<vtkPolyDataMapper>::Take(vtkCurvatureOpacityPolyDataMapper::New())
      : vtkSmartPointer<vtkPolyDataMapper>::New();
    if (auto* own = vtkCurvatureOpacityPolyDataMapper::SafeDownCast(mapper))
    {
      showOutlines(own->GetCurvatureOpacityProperty());
    }
    mapper->SetInputData(grid(3));
    auto actor = actorOf(mapper);
    actor->GetProperty()->SetOpacity(.4);
    scene.renderer->AddActor(actor);
    pictures[ours] = scene.capture();
  }
  LT_CHECK(suite, largestDifference(pictures[0], pictures[1]) == 0);
}
} // namespace

int main(int argc, char* argv[])
{
  if (!canRender())
  {
    return Suite::skipped();
  }
  Suite suite(argc, argv);
  testShapes(suite);
  testProperties(suite);
  testStock(suite);
  testMany(suite);
  LT_CHECK(suite, openGLDebugErrors() == 0);
  return suite.result();
}
