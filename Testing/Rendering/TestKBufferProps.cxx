// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * What else than translucent surfaces vtkBucketedKBufferPass meets: opaque surfaces that
 * are to be stylised, lines and points, image slices, text, 2-D actors, and props that
 * keep their parts to themselves.
 */
#include "KBufferScene.h"

#include "vtkActor2D.h"
#include "vtkBillboardTextActor3D.h"
#include "vtkCurvatureOpacityFunction.h"
#include "vtkCurvatureOpacityPolyDataMapper.h"
#include "vtkCurvatureOpacityProperty.h"
#include "vtkFloatArray.h"
#include "vtkGPUVolumeRayCastMapper.h"
#include "vtkHardwareSelector.h"
#include "vtkImageData.h"
#include "vtkImageProperty.h"
#include "vtkImageSlice.h"
#include "vtkImageSliceMapper.h"
#include "vtkObjectFactory.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPolyDataMapper2D.h"
#include "vtkProperty2D.h"
#include "vtkSelection.h"
#include "vtkSphereSource.h"
#include "vtkTextActor3D.h"
#include "vtkTextProperty.h"
#include "vtkVolume.h"

using namespace lighttransport::testing;

namespace
{
vtkSmartPointer<vtkActor> sphereActor(
  double x, double z, double radius, vtkPolyDataMapper* given = nullptr)
{
  vtkNew<vtkSphereSource> sphere;
  sphere->SetCenter(x, .5, z);
  sphere->SetRadius(radius);
  sphere->SetThetaResolution(60);
  sphere->SetPhiResolution(40);
  vtkSmartPointer<vtkPolyDataMapper> mapper = given;
  if (!given)
  {
    mapper = vtkSmartPointer<vtkPolyDataMapper>::New();
  }
  mapper->SetInputConnection(sphere->GetOutputPort());
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  return actor;
}

/** Depth of the middle pixel, in DC. */
double depthAt(KBufferScene& scene, int column, int row)
{
  vtkNew<vtkFloatArray> depth;
  scene.window->GetZbufferData(column, row, column, row, depth);
  return depth->GetValue(0);
}

/** Opaque surfaces are stylised as if they had been forced to be translucent. */
void testOpaque(Suite& suite)
{
  for (const bool own : { false, true })
  {
    std::vector<unsigned char> pictures[3];
    double depths[3] = { 0., 0., 0. };
    enum Way
    {
      Plain,
      Forced,
      Taken
    };
    for (const Way way : { Plain, Forced, Taken })
    {
      KBufferScene scene(60, 60);
      vtkNew<vtkCurvatureOpacityPolyDataMapper> mapper;
      auto sphere = sphereActor(.5, 0., .3, own ? mapper.Get() : nullptr);
      sphere->SetForceTranslucent(way == Forced);
      auto* property =
        own ? mapper->GetCurvatureOpacityProperty() : scene.pass->GetCurvatureOpacityProperty();
      property->SetCurvatureShading(way != Plain);
      property->SetOccludingContours(way != Plain);
      scene.pass->SetCurvatureScale(.1);
      scene.renderer->AddActor(sphere);
      // A translucent layer in front, an opaque one behind and one across.
      Layer film;
      film.z = 2.;
      film.color = { .1, .2, .9, .4 };
      film.box = { .52, 2., -1., 2. };
      Layer wall;
      wall.color = { .9, .7, .3, 1. };
      wall.z = -2.;
      Layer across = wall;
      across.z = .25;
      across.box = { -1., .4, -1., 2. };
      for (const Layer& layer : { film, wall, across })
      {
        auto actor = makeLayer(layer);
        actor->SetForceOpaque(layer.color[3] == 1.); // left alone
        scene.renderer->AddActor(actor);
      }
      pictures[way] = scene.capture();
      const vtkMTimeType before = sphere->GetMTime();
      LT_CHECK(suite, largestDifference(pictures[way], scene.capture()) == 0);
      depths[way] = depthAt(scene, 34, 30);
      LT_CHECK(suite, sphere->GetMTime() == before);
      LT_CHECK(suite, sphere->GetForceTranslucent() == (way == Forced));
      LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());

      // Seen by selection as before.
      vtkNew<vtkHardwareSelector> selector;
      selector->SetRenderer(scene.renderer);
      selector->SetArea(0, 0, 59, 59);
      auto selection = vtkSmartPointer<vtkSelection>::Take(selector->Select());
      LT_CHECK(suite, selection->GetNumberOfNodes() == 4);
    }
    LT_CHECK(suite, largestDifference(pictures[Forced], pictures[Taken]) == 0);
    LT_CHECK(suite, largestDifference(pictures[Plain], pictures[Taken]) > 30);
    // The left side is hidden by the layer across.
    const std::size_t hidden = 4 * (30 * 60 + 14);
    LT_CHECK(suite, pictures[Plain][hidden] == pictures[Taken][hidden]);
    // The depth is that of the opaque surface, for who picks by it.
    LT_CHECK_NEAR(suite, depths[Taken], depths[Plain], 1e-6);
    LT_CHECK(suite, depths[Plain] < .6);
  }
}

/** Curvature decides the opacity of opaque surfaces too; ForceOpaque keeps one out. */
void testOpaqueOpacity(Suite& suite)
{
  Layer back;
  back.color = { .9, .1, .2, 1. };
  back.z = -2.;
  Layer front;
  front.color = { .1, .8, .3, 1. };
  for (const bool keptOut : { false, true })
  {
    KBufferScene scene;
    auto actor = makeLayer(front);
    actor->SetForceOpaque(keptOut);
    scene.renderer->AddActor(actor);
    auto wall = makeLayer(back);
    wall->ForceOpaqueOn();
    scene.renderer->AddActor(wall);
    vtkNew<vtkPiecewiseFunction> constant;
    constant->AddPoint(0., .25);
    constant->AddPoint(1., .25);
    auto* property = scene.pass->GetCurvatureOpacityProperty();
    property->GetOpacityFunction()->SetKindToProduct();
    property->GetOpacityFunction()->SetCurvatureFunction(constant);
    property->CurvatureOpacityOn();
    Layer expected = front;
    expected.color[3] = keptOut ? 1. : .25;
    LT_CHECK(suite, scene.differenceFromOver(scene.capture(), { back, expected }, false) <= 1.);
    LT_CHECK(suite, (scene.pass->GetNumberOfFragments() > 0) == !keptOut);
    // Where volumes can't be among the layers, opaque surfaces stay as VTK draws them.
    vtkNew<vtkImageData> image;
    image->SetDimensions(3, 3, 3);
    image->SetOrigin(0., 0., 5.);
    image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
    std::fill_n(static_cast<unsigned char*>(image->GetScalarPointer()), 27, 0);
    vtkNew<vtkGPUVolumeRayCastMapper> mapper;
    mapper->SetInputData(image);
    mapper->SetImageSampleDistance(2.F);
    mapper->SetAutoAdjustSampleDistances(0);
    vtkNew<vtkVolume> volume;
    volume->SetMapper(mapper);
    scene.renderer->AddVolume(volume);
    scene.capture();
    LT_CHECK(suite, scene.pass->GetNumberOfFragments() == 0);
    LT_CHECK(suite, openGLErrors().empty());
  }
}

/** A surface and, in the same data, a line or a point at another place. */
vtkSmartPointer<vtkPolyData> surfaceWith(bool line, bool point)
{
  auto data = vtkSmartPointer<vtkPolyData>::New();
  vtkNew<vtkPoints> points;
  vtkNew<vtkCellArray> polys;
  vtkNew<vtkCellArray> lines;
  vtkNew<vtkCellArray> verts;
  for (const auto& p : { std::array<double, 3>{ -1., -1., -1. }, { 2., -1., -1. }, { 2., 2., -1. },
         { -1., 2., -1. }, { -1., .5, 0. }, { 2., .5, 0. } })
  {
    points->InsertNextPoint(p.data());
  }
  const vtkIdType quad[4] = { 0, 1, 2, 3 };
  polys->InsertNextCell(4, quad);
  data->SetPoints(points);
  data->SetPolys(polys);
  const vtkIdType ends[2] = { 4, 5 };
  if (line)
  {
    lines->InsertNextCell(2, ends);
    data->SetLines(lines);
  }
  if (point)
  {
    points->SetPoint(4, .5, .5, 0.);
    verts->InsertNextCell(1, ends);
    data->SetVerts(verts);
  }
  return data;
}

/** Lines and points are layers at their depth, as wide as asked for, and have no curvature. */
void testLinesAndPoints(Suite& suite)
{
  for (const bool line : { true, false })
  {
    for (const bool styled : { false, true })
    {
      KBufferScene scene(41, 41);
      vtkNew<vtkPolyDataMapper> mapper;
      mapper->SetInputData(surfaceWith(line, !line));
      vtkNew<vtkActor> actor;
      actor->SetMapper(mapper);
      actor->GetProperty()->LightingOff();
      actor->GetProperty()->SetColor(.9, .2, .1);
      actor->GetProperty()->SetOpacity(.5);
      actor->GetProperty()->SetLineWidth(5.F);
      actor->GetProperty()->SetPointSize(5.F);
      scene.renderer->AddActor(actor);
      Layer front;
      front.color = { .1, .3, .9, .4 };
      front.z = 2.;
      scene.add({ front });
      if (styled)
      {
        // All surfaces at 0.7; only what has no curvature keeps its own opacity.
        vtkNew<vtkPiecewiseFunction> constant;
        constant->AddPoint(0., .7);
        constant->AddPoint(1., .7);
        auto* property = scene.pass->GetCurvatureOpacityProperty();
        property->GetOpacityFunction()->SetKindToProduct();
        property->GetOpacityFunction()->SetCurvatureFunction(constant);
        property->CurvatureOpacityOn();
      }
      const auto pixels = scene.capture();
      Layer surface;
      surface.z = -1.;
      surface.color = { .9, .2, .1, styled ? .7 : .5 };
      Layer thin = surface;
      thin.z = 0.;
      thin.color[3] = .5;
      front.color[3] = styled ? .7 : .4;
      const Rgba background = { toByte(.2), toByte(.4), toByte(.1), 1. };
      const Rgba without = over({ surface, front }, .5, background);
      const Rgba with = over({ surface, thin, front }, .5, background);
      int covered = 0;
      int wrong = 0;
      for (int row = 0; row < 41; ++row)
      {
        const unsigned char* pixel = &pixels[4 * (row * 41 + 20)];
        bool isWith = true;
        bool isWithout = true;
        for (int c = 0; c < 3; ++c)
        {
          isWith = isWith && std::abs(pixel[c] - 255. * with[c]) <= 1.;
          isWithout = isWithout && std::abs(pixel[c] - 255. * without[c]) <= 1.;
        }
        covered += isWith;
        wrong += !isWith && !isWithout;
      }
      suite.check(covered == 5 && wrong == 0,
        std::string(line ? "line" : "point") + ", styled " + std::to_string(styled) + ": " +
          std::to_string(covered) + " pixels wide, " + std::to_string(wrong) + " wrong",
        __FILE__, __LINE__);
      LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());
    }
  }
}

vtkSmartPointer<vtkImageSlice> sliceOf(double z, int grey)
{
  vtkNew<vtkImageData> image;
  image->SetDimensions(4, 4, 1);
  image->SetOrigin(-1., -1., z);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  std::fill_n(static_cast<unsigned char*>(image->GetScalarPointer()), 16, grey);
  vtkNew<vtkImageSliceMapper> mapper;
  mapper->SetInputData(image);
  mapper->BorderOn();
  auto slice = vtkSmartPointer<vtkImageSlice>::New();
  slice->SetMapper(mapper);
  slice->GetProperty()->SetColorWindow(255.);
  slice->GetProperty()->SetColorLevel(127.5);
  slice->GetProperty()->SetAmbient(1.);
  slice->GetProperty()->SetDiffuse(0.);
  return slice;
}

/** A slice that is forced to be translucent is a layer; else VTK draws it with what is opaque. */
void testImageSlice(Suite& suite)
{
  for (const bool forced : { true, false })
  {
    for (const bool styled : { false, true })
    {
      KBufferScene scene(30, 30);
      std::vector<Layer> layers(3);
      layers[0].z = 1.;
      layers[0].color = { .9, .1, .2, .4 };
      layers[1].z = -1.;
      layers[1].color = { .1, .9, .4, .5 };
      layers[2].z = 0.;
      layers[2].color = { .8, .8, .8, forced ? .6 : 1. };
      scene.add({ layers[0], layers[1] });
      auto slice = sliceOf(0., 204);
      slice->SetForceTranslucent(forced);
      slice->GetProperty()->SetOpacity(layers[2].color[3]);
      scene.renderer->AddViewProp(slice);
      vtkNew<vtkPiecewiseFunction> one;
      one->AddPoint(-1., 1.);
      one->AddPoint(1., 1.);
      scene.pass->GetCurvatureOpacityProperty()->SetShadingFunction(one);
      scene.pass->GetCurvatureOpacityProperty()->SetCurvatureShading(styled);
      const auto pixels = scene.capture();
      const double d = scene.differenceFromOver(pixels, layers, false);
      suite.check(d <= 1.,
        "image slice, forced " + std::to_string(forced) + ", styled " + std::to_string(styled) +
          ": " + std::to_string(d) + "/255 from over",
        __FILE__, __LINE__);
      LT_CHECK(suite, largestDifference(pixels, scene.capture()) == 0);
      LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());
    }
  }
}

/** A prop that keeps its part to itself, as many widgets do. */
class Stranger : public vtkProp
{
public:
  static Stranger* New();
  vtkTypeMacro(Stranger, vtkProp);
  double* GetBounds() override { return this->Part->GetBounds(); }
  vtkTypeBool HasTranslucentPolygonalGeometry() override { return 1; }
  int RenderTranslucentPolygonalGeometry(vtkViewport* viewport) override
  {
    return this->Part->RenderTranslucentPolygonalGeometry(viewport);
  }
  void ReleaseGraphicsResources(vtkWindow* window) override
  {
    this->Part->ReleaseGraphicsResources(window);
  }

  vtkSmartPointer<vtkActor> Part;
};
vtkStandardNewMacro(Stranger);

/** VTK draws it after the layers, in front of them. */
void testStranger(Suite& suite)
{
  KBufferScene scene(30, 30);
  auto layers = randomLayers(5, 6);
  scene.add(layers);
  Layer part;
  part.z = -20.; // so it says, but it is drawn last
  part.color = { .3, .9, .1, .5 };
  vtkNew<Stranger> stranger;
  stranger->Part = makeLayer(part);
  stranger->Part->SetPosition(0., 0., 19.);
  scene.renderer->AddViewProp(stranger);
  part.z = 5.;
  layers.push_back(part);
  for (int frame = 0; frame < 2; ++frame)
  {
    const double d = scene.differenceFromOver(scene.capture(), layers, false);
    suite.check(d <= 1.5, "stranger: " + std::to_string(d) + "/255", __FILE__, __LINE__);
  }
  // Hidden by what is opaque, alone, and with nothing else to draw.
  Layer wall;
  wall.z = 6.;
  wall.color = { .5, .6, .7, 1. };
  scene.add({ wall });
  LT_CHECK(suite, scene.differenceFromOver(scene.capture(), { wall }, false) <= 1.);
  KBufferScene alone(30, 30);
  alone.renderer->AddViewProp(stranger);
  LT_CHECK(suite, alone.differenceFromOver(alone.capture(), { part }, false) <= 1.5);
  LT_CHECK(suite, openGLErrors().empty());
}

/** Text in space and on the screen: as many pixels of it as with VTK's own passes. */
void testText(Suite& suite)
{
  enum Kind
  {
    Billboard,
    InSpace,
    OnScreen
  };
  for (const Kind kind : { Billboard, InSpace, OnScreen })
  {
    int inked[2] = { 0, 0 };
    for (const bool ours : { false, true })
    {
      KBufferScene scene(80, 60);
      scene.renderer->SetBackground(0., 0., 0.);
      if (!ours)
      {
        scene.peel();
      }
      Layer film;
      film.color = { 0., 0., 1., .3 };
      scene.add({ film });
      if (kind == Billboard)
      {
        vtkNew<vtkBillboardTextActor3D> text;
        text->SetInput("Wb");
        text->SetPosition(.2, .3, 1.);
        text->GetTextProperty()->SetFontSize(24);
        text->GetTextProperty()->SetColor(1., 0., 0.);
        text->ForceTranslucentOn();
        scene.renderer->AddActor(text);
      }
      else if (kind == InSpace)
      {
        vtkNew<vtkTextActor3D> text;
        text->SetInput("Wb");
        text->SetPosition(.1, .3, 1.);
        text->SetScale(.02);
        text->GetTextProperty()->SetFontSize(24);
        text->GetTextProperty()->SetColor(1., 0., 0.);
        text->ForceTranslucentOn();
        scene.renderer->AddActor(text);
      }
      else
      {
        vtkNew<vtkPolyData> square;
        vtkNew<vtkPoints> points;
        points->InsertNextPoint(5., 5., 0.);
        points->InsertNextPoint(25., 5., 0.);
        points->InsertNextPoint(25., 25., 0.);
        points->InsertNextPoint(5., 25., 0.);
        vtkNew<vtkCellArray> cells;
        const vtkIdType quad[4] = { 0, 1, 2, 3 };
        cells->InsertNextCell(4, quad);
        square->SetPoints(points);
        square->SetPolys(cells);
        vtkNew<vtkPolyDataMapper2D> mapper;
        mapper->SetInputData(square);
        vtkNew<vtkActor2D> actor;
        actor->SetMapper(mapper);
        actor->GetProperty()->SetColor(1., 0., 0.);
        actor->GetProperty()->SetOpacity(.8);
        scene.renderer->AddActor2D(actor);
      }
      const auto pixels = scene.capture();
      for (std::size_t i = 0; i < pixels.size(); i += 4)
      {
        inked[ours] += pixels[i] > 100;
      }
      LT_CHECK(suite, scene.log->messages.empty() && openGLErrors().empty());
    }
    suite.check(inked[0] > 50 && std::abs(inked[1] - inked[0]) <= inked[0] / 20,
      "text " + std::to_string(kind) + ": " + std::to_string(inked[1]) + " pixels, expected " +
        std::to_string(inked[0]),
      __FILE__, __LINE__);
  }
}
} // namespace

int main(int argc, char* argv[])
{
  if (!canRender())
  {
    return Suite::skipped();
  }
  Suite suite(argc, argv);
  testOpaque(suite);
  testOpaqueOpacity(suite);
  testLinesAndPoints(suite);
  testImageSlice(suite);
  testStranger(suite);
  testText(suite);
  LT_CHECK(suite, openGLDebugErrors() == 0);
  return suite.result();
}
