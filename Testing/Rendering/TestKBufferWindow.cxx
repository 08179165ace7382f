// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * vtkBucketedKBufferPass in all sorts of windows and scenes: viewports, sizes,
 * multisampling, another window, released resources, hardware selection, somebody
 * else's sequence of passes, and all that VTK's mappers can draw, compared with
 * vtkDualDepthPeelingPass. No OpenGL error, as KHR_debug tells it too.
 */
#include "KBufferScene.h"

#include "vtkAssembly.h"
#include "vtkCompositeDataDisplayAttributes.h"
#include "vtkCompositePolyDataMapper2.h"
#include "vtkCubeSource.h"
#include "vtkCurvatureOpacityProperty.h"
#include "vtkElevationFilter.h"
#include "vtkHardwareSelector.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkLineSource.h"
#include "vtkMultiBlockDataSet.h"
#include "vtkPlane.h"
#include "vtkPlaneSource.h"
#include "vtkPointSource.h"
#include "vtkSelection.h"
#include "vtkSelectionNode.h"
#include "vtkSphereSource.h"
#include "vtkTexture.h"

#include <functional>
#include <string>

using namespace lighttransport::testing;

namespace
{
void testSizes(Suite& suite)
{
  const auto layers = randomLayers(6, 3);
  KBufferScene scene(20, 20);
  scene.add(layers);
  const int sizes[][2] = { { 1, 1 }, { 1, 50 }, { 70, 1 }, { 33, 17 }, { 200, 150 }, { 2, 2 } };
  for (const auto& size : sizes)
  {
    scene.window->SetSize(size[0], size[1]);
    const auto pixels = scene.capture();
    LT_CHECK(suite, pixels.size() == std::size_t(4) * size[0] * size[1]);
    LT_CHECK(suite, scene.differenceFromOver(pixels, layers, false) <= 1.);
    LT_CHECK(suite, scene.pass->GetNumberOfFragments() == 6 * size[0] * size[1]);
  }
  LT_CHECK(suite, scene.log->messages.empty());
  LT_CHECK(suite, openGLErrors().empty());
}

void testViewports(Suite& suite)
{
  // One pass for two renderers of different sizes, and one renderer without.
  const auto layers = randomLayers(6, 3);
  KBufferScene scene(100, 60);
  scene.add(layers);
  scene.renderer->SetViewport(.5, 0., 1., .5);
  vtkNew<vtkRenderer> second;
  second->SetPass(scene.pass);
  second->SetViewport(0., .2, .3, 1.);
  second->SetBackground(.2, .4, .1);
  vtkNew<vtkRenderer> third;
  third->SetViewport(.5, .5, 1., 1.);
  third->SetBackground(1., 0., 0.);
  for (vtkRenderer* r : { second.Get(), third.Get() })
  {
    KBufferScene::lookAtUnitSquare(r);
    scene.window->AddRenderer(r);
  }
  for (const Layer& layer : layers)
  {
    second->AddActor(makeLayer(layer));
  }
  const auto pixels = scene.capture();
  const Rgba expected = over(layers, 0., { .2, .4, .1, 1. });
  const auto near = [&](int column, int row, const Rgba& color)
  {
    double largest = 0.;
    for (int c = 0; c < 3; ++c)
    {
      largest = std::max(largest, std::abs(pixels[4 * (row * 100 + column) + c] - 255. * color[c]));
    }
    return largest <= 1.;
  };
  for (const auto& p :
    { std::array<int, 2>{ 50, 0 }, { 99, 29 }, { 75, 15 }, { 0, 12 }, { 29, 59 }, { 15, 30 } })
  {
    suite.check(near(p[0], p[1], expected),
      "layers at " + std::to_string(p[0]) + ", " + std::to_string(p[1]), __FILE__, __LINE__);
  }
  LT_CHECK(suite, near(50, 30, { 1., 0., 0., 1. }) && near(99, 59, { 1., 0., 0., 1. }));
  LT_CHECK(suite, near(40, 40, { 0., 0., 0., 1. }) && near(15, 5, { 0., 0., 0., 1. }));
  LT_CHECK(suite, openGLErrors().empty());
}

void testWindows(Suite& suite)
{
  const auto layers = randomLayers(6, 3);
  KBufferScene scene;
  scene.add(layers);
  const auto expected = scene.capture();

  scene.pass->ReleaseGraphicsResources(scene.window);
  LT_CHECK(suite, scene.pass->GetMemoryInBytes() == 0);
  LT_CHECK(suite, largestDifference(expected, scene.capture()) == 0);

  // Another window, with multisampling, and back.
  vtkNew<vtkRenderWindow> other;
  other->SetMultiSamples(4);
  other->SetAlphaBitPlanes(1);
  other->SetSize(40, 30);
  scene.window->RemoveRenderer(scene.renderer);
  other->AddRenderer(scene.renderer);
  LT_CHECK(suite, largestDifference(expected, captureRgba(other)) <= 1);
  LT_CHECK(suite, openGLErrors().empty());
  other->RemoveRenderer(scene.renderer);
  scene.window->AddRenderer(scene.renderer);
  LT_CHECK(suite, largestDifference(expected, scene.capture()) == 0);

  // Somebody else's sequence.
  vtkNew<vtkRenderStepsPass> steps;
  steps->SetTranslucentPass(scene.pass);
  scene.renderer->SetPass(steps);
  LT_CHECK(suite, largestDifference(expected, scene.capture()) == 0);

  // The window closes before the pass goes.
  scene.renderer->SetPass(scene.pass);
  scene.window->Render();
  scene.window->Finalize();
  LT_CHECK(suite, scene.pass->GetMemoryInBytes() == 0);
  LT_CHECK(suite, scene.log->messages.empty());
}

/** Buffers, textures and framebuffers of the context that is current. */
std::array<int, 3> countObjects()
{
  std::array<int, 3> count = { 0, 0, 0 };
  for (GLuint name = 1; name < 3000; ++name)
  {
    count[0] += glIsBuffer(name);
    count[1] += glIsTexture(name);
    count[2] += glIsFramebuffer(name);
  }
  return count;
}

/** Whatever was on and whatever the size was: a release leaves nothing of the pass. */
void testRelease(Suite& suite)
{
  KBufferScene scene;
  scene.add(randomLayers(6, 3));
  scene.capture();
  scene.pass->ReleaseGraphicsResources(scene.window);
  const auto expected = countObjects();
  auto* property = scene.pass->GetCurvatureOpacityProperty();
  for (int round = 0; round < 4; ++round)
  {
    property->SetCurvatureShading(round == 1);
    property->SetOccludingContours(round == 2);
    scene.pass->SetColorPrecision(round % 2);
    scene.pass->SetMemoryLimit(round == 3 ? 1 << 20 : 1 << 30);
    scene.capture();
    const auto used = countObjects();
    LT_CHECK(suite, used[0] > expected[0] + 3 && used[1] > expected[1] + 3);
    LT_CHECK(suite, scene.pass->GetMemoryInBytes() > 0);
    scene.pass->ReleaseGraphicsResources(scene.window);
    LT_CHECK(suite, countObjects() == expected);
    LT_CHECK(suite, scene.pass->GetMemoryInBytes() == 0);
  }
  LT_CHECK(suite, openGLErrors().empty());
}

void testMultisamples(Suite& suite)
{
  // Opaque and translucent spheres: same as without samples but for edges.
  std::vector<unsigned char> pictures[2];
  for (const int samples : { 0, 8 })
  {
    KBufferScene scene(80, 80);
    scene.window->SetMultiSamples(samples);
    for (const bool opaque : { true, false })
    {
      vtkNew<vtkSphereSource> sphere;
      sphere->SetCenter(opaque ? .3 : .6, .5, 0.);
      sphere->SetRadius(.25);
      sphere->SetThetaResolution(40);
      sphere->SetPhiResolution(40);
      vtkNew<vtkPolyDataMapper> mapper;
      mapper->SetInputConnection(sphere->GetOutputPort());
      vtkNew<vtkActor> actor;
      actor->SetMapper(mapper);
      actor->GetProperty()->SetOpacity(opaque ? 1. : .5);
      scene.renderer->AddActor(actor);
    }
    pictures[samples > 0] = scene.capture();
    LT_CHECK(suite, scene.log->messages.empty());
  }
  int differing = 0;
  for (std::size_t i = 0; i < pictures[0].size(); i += 4)
  {
    differing += std::abs(int(pictures[0][i]) - int(pictures[1][i])) > 8;
  }
  LT_CHECK(suite, differing < 80 * 80 / 25);
  LT_CHECK(suite, openGLErrors().empty());
}

void testSelection(Suite& suite)
{
  for (const bool withPass : { false, true })
  {
    KBufferScene scene;
    Layer back;
    back.color = { 0., 1., 0., .5 };
    Layer front;
    front.z = 1.;
    front.box = { -1., .5, -1., 2. };
    scene.add({ back, front });
    if (!withPass)
    {
      scene.renderer->SetPass(nullptr);
    }
    const auto before = scene.capture();
    vtkNew<vtkHardwareSelector> selector;
    selector->SetRenderer(scene.renderer);
    selector->SetArea(0, 0, 39, 29);
    auto selection = vtkSmartPointer<vtkSelection>::Take(selector->Select());
    LT_CHECK(suite, selection->GetNumberOfNodes() == 2);
    selector->SetArea(2, 2, 3, 3);
    selection.TakeReference(selector->Select());
    LT_CHECK(suite, selection->GetNumberOfNodes() == 1);
    if (selection->GetNumberOfNodes() == 1)
    {
      LT_CHECK(suite,
        selection->GetNode(0)->GetProperties()->Get(vtkSelectionNode::PROP()) ==
          scene.renderer->GetActors()->GetLastItem());
    }
    LT_CHECK(suite, largestDifference(before, scene.capture()) == 0);
    LT_CHECK(suite, scene.log->messages.empty());
  }
}

vtkSmartPointer<vtkActor> actorOf(vtkAlgorithm* source)
{
  vtkNew<vtkPolyDataMapper> mapper;
  mapper->SetInputConnection(source->GetOutputPort());
  auto actor = vtkSmartPointer<vtkActor>::New();
  actor->SetMapper(mapper);
  actor->GetProperty()->SetOpacity(.4);
  return actor;
}

vtkSmartPointer<vtkSphereSource> sphereAt(double x, double radius, int resolution = 24)
{
  auto sphere = vtkSmartPointer<vtkSphereSource>::New();
  sphere->SetCenter(x, .5, 0.);
  sphere->SetRadius(radius);
  sphere->SetThetaResolution(resolution);
  sphere->SetPhiResolution(resolution);
  return sphere;
}

/** Whatever VTK's mappers draw, as vtkDualDepthPeelingPass draws it. */
void testMappers(Suite& suite)
{
  using Fill = std::function<void(vtkRenderer*)>;
  struct Case
  {
    const char* name;
    Fill fill;
  };
  const std::vector<Case> cases = {
    { "vertex colours",
      [](vtkRenderer* r)
      {
        vtkNew<vtkElevationFilter> elevation;
        auto sphere = sphereAt(.4, .4);
        elevation->SetInputConnection(sphere->GetOutputPort());
        elevation->SetHighPoint(0., 1., 0.);
        r->AddActor(actorOf(elevation));
        r->AddActor(actorOf(sphereAt(.7, .3)));
      } },
    { "texture",
      [](vtkRenderer* r)
      {
        vtkNew<vtkImageData> image;
        image->SetDimensions(8, 8, 1);
        image->AllocateScalars(VTK_UNSIGNED_CHAR, 4);
        auto* p = static_cast<unsigned char*>(image->GetScalarPointer());
        for (int i = 0; i < 256; ++i)
        {
          p[i] = static_cast<unsigned char>((i * 37) % 256);
        }
        vtkNew<vtkTexture> texture;
        texture->SetInputData(image);
        vtkNew<vtkPlaneSource> plane;
        auto actor = actorOf(plane);
        actor->SetTexture(texture);
        r->AddActor(actor);
        r->AddActor(actorOf(sphereAt(.5, .3)));
      } },
    { "edges, flat shading, back faces",
      [](vtkRenderer* r)
      {
        auto actor = actorOf(sphereAt(.5, .4));
        actor->GetProperty()->EdgeVisibilityOn();
        actor->GetProperty()->SetEdgeColor(1., 0., 0.);
        r->AddActor(actor);
        auto flat = actorOf(sphereAt(.2, .3));
        flat->GetProperty()->SetInterpolationToFlat();
        vtkNew<vtkProperty> back;
        back->SetColor(0., 1., 0.);
        back->SetOpacity(.4);
        flat->SetBackfaceProperty(back);
        r->AddActor(flat);
      } },
    { "lines",
      [](vtkRenderer* r)
      {
        auto wire = actorOf(sphereAt(.5, .4, 8));
        wire->GetProperty()->SetRepresentationToWireframe();
        r->AddActor(wire);
        r->AddActor(actorOf(sphereAt(.3, .3)));
      } },
    { "points",
      [](vtkRenderer* r)
      {
        auto points = actorOf(sphereAt(.5, .4, 8));
        points->GetProperty()->SetRepresentationToPoints();
        points->GetProperty()->SetPointSize(6);
        r->AddActor(points);
        r->AddActor(actorOf(sphereAt(.3, .3)));
      } },
    { "points as spheres",
      [](vtkRenderer* r)
      {
        auto balls = actorOf(sphereAt(.8, .4, 8));
        balls->GetProperty()->SetRepresentationToPoints();
        balls->GetProperty()->RenderPointsAsSpheresOn();
        balls->GetProperty()->SetPointSize(8);
        r->AddActor(balls);
        r->AddActor(actorOf(sphereAt(.3, .3)));
      } },
    { "lines as tubes",
      [](vtkRenderer* r)
      {
        auto tubes = actorOf(sphereAt(.4, .4, 8));
        tubes->GetProperty()->SetRepresentationToWireframe();
        tubes->GetProperty()->RenderLinesAsTubesOn();
        tubes->GetProperty()->SetLineWidth(5);
        r->AddActor(tubes);
        r->AddActor(actorOf(sphereAt(.3, .3)));
      } },
    { "not lit",
      [](vtkRenderer* r)
      {
        auto dark = actorOf(sphereAt(.5, .2));
        dark->GetProperty()->LightingOff();
        r->AddActor(dark);
        r->AddActor(actorOf(sphereAt(.3, .3)));
      } },
    { "physically based",
      [](vtkRenderer* r)
      {
        auto actor = actorOf(sphereAt(.5, .4));
        actor->GetProperty()->SetInterpolationToPBR();
        actor->GetProperty()->SetRoughness(.2);
        r->AddActor(actor);
        r->AddActor(actorOf(sphereAt(.3, .3)));
      } },
    { "clipping planes",
      [](vtkRenderer* r)
      {
        auto actor = actorOf(sphereAt(.5, .4));
        vtkNew<vtkPlane> plane;
        plane->SetOrigin(.5, .5, 0.);
        plane->SetNormal(1., .3, .2);
        actor->GetMapper()->AddClippingPlane(plane);
        r->AddActor(actor);
        r->AddActor(actorOf(sphereAt(.3, .3)));
      } },
    { "assembly, scaled and turned",
      [](vtkRenderer* r)
      {
        vtkNew<vtkAssembly> assembly;
        assembly->AddPart(actorOf(sphereAt(.5, .3)));
        assembly->AddPart(actorOf(sphereAt(.2, .3)));
        assembly->SetScale(1., .5, .8);
        assembly->RotateZ(10.);
        r->AddActor(assembly);
      } },
    { "composite",
      [](vtkRenderer* r)
      {
        vtkNew<vtkMultiBlockDataSet> blocks;
        for (unsigned b = 0; b < 3; ++b)
        {
          auto sphere = sphereAt(.3 + .2 * b, .25);
          sphere->Update();
          blocks->SetBlock(b, sphere->GetOutput());
        }
        vtkNew<vtkCompositePolyDataMapper2> mapper;
        mapper->SetInputDataObject(blocks);
        vtkNew<vtkCompositeDataDisplayAttributes> attributes;
        mapper->SetCompositeDataDisplayAttributes(attributes);
        mapper->SetBlockOpacity(1, .3);
        mapper->SetBlockOpacity(2, .6);
        mapper->SetBlockColor(3, std::array<double, 3>{ 1., 0., 0. }.data());
        mapper->SetBlockOpacity(3, .5);
        vtkNew<vtkActor> actor;
        actor->SetMapper(mapper);
        r->AddActor(actor);
      } },
    { "opaque and translucent",
      [](vtkRenderer* r)
      {
        auto opaque = actorOf(sphereAt(.5, .2));
        opaque->GetProperty()->SetOpacity(1.);
        r->AddActor(opaque);
        r->AddActor(actorOf(sphereAt(.4, .4)));
      } },
  };
  for (const Case& c : cases)
  {
    KBufferScene ours(90, 80);
    ours.pass->SetNumberOfLayers(64);
    KBufferScene peeled(90, 80);
    peeled.peel();
    for (KBufferScene* scene : { &ours, &peeled })
    {
      vtkCamera* camera = scene->renderer->GetActiveCamera();
      camera->ParallelProjectionOff();
      camera->SetPosition(1.2, 1.1, 2.5);
      c.fill(scene->renderer);
      scene->renderer->ResetCameraClippingRange();
    }
    const auto a = ours.capture();
    const auto b = peeled.capture();
    // Peeling rounds to 8 bits after each layer, ours once.
    int most = 0;
    int differing = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
    {
      const int d = std::abs(int(a[i]) - int(b[i]));
      most = std::max(most, d);
      differing += i % 4 != 3 && d > 3;
    }
    // A wireframe's tubes are drawn once per triangle, at depths that differ by rounding.
    suite.check(differing <= 40,
      std::string(c.name) + ": " + std::to_string(differing) +
        " channels differ from vtkDualDepthPeelingPass by more than 3, up to " +
        std::to_string(most),
      __FILE__, __LINE__);
    suite.check(ours.pass->GetNumberOfFragments() > 500 && ours.log->messages.empty(),
      std::string(c.name) + ": fragments", __FILE__, __LINE__);
    LT_CHECK(suite, openGLErrors().empty());
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
  testSizes(suite);
  testViewports(suite);
  testWindows(suite);
  testRelease(suite);
  testMultisamples(suite);
  testSelection(suite);
  testMappers(suite);
  LT_CHECK(suite, openGLDebugErrors() == 0);
  return suite.result();
}
