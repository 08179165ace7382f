// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
//
// Surfaces in a volume's shadow: VTK's picture without one, closed forms of exact lights and of the
// harmonics, floors beside the volume, turned volumes, what is uploaded, bad input.
#include "LightTransportRenderingTesting.h"

#include "vtkActor.h"
#include "vtkCamera.h"
#include "vtkColorTransferFunction.h"
#include "vtkCommand.h"
#include "vtkFloatArray.h"
#include "vtkImageResize.h"
#include "vtkLight.h"
#include "vtkLightTransportPolyDataMapper.h"
#include "vtkLightTransportVolumeMapper.h"
#include "vtkNIFTIImageReader.h"
#include "vtkPiecewiseFunction.h"
#include "vtkPlane.h"
#include "vtkPlaneSource.h"
#include "vtkPointData.h"
#include "vtkPolyDataMapper.h"
#include "vtkProperty.h"
#include "vtkRenderer.h"
#include "vtkSmartVolumeMapper.h"
#include "vtkSphereSource.h"
#include "vtkVisibilityFactorFilter.h"
#include "vtkVolume.h"
#include "vtkVolumeLightingProperty.h"
#include "vtkVolumeProperty.h"

#include <cmath>
#include <functional>
#include <vector>

using namespace lighttransport::testing;

namespace
{
constexpr int N = 32;
constexpr int Size = 60;

class Log : public vtkCommand
{
public:
  static Log* New() { return new Log; }
  void Execute(vtkObject*, unsigned long, void* text) override
  {
    this->messages.emplace_back(static_cast<const char*>(text));
  }
  std::vector<std::string> messages;
};

/** sigma_t on N^3 voxels from 0 to N along each axis. */
vtkSmartPointer<vtkImageData> medium(const std::function<double(double, double, double)>& f)
{
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(N, N, N);
  image->SetOrigin(0.5, 0.5, 0.5);
  vtkNew<vtkFloatArray> sigma_t;
  sigma_t->SetName("Extinction");
  for (int k = 0; k < N; ++k)
  {
    for (int j = 0; j < N; ++j)
    {
      for (int i = 0; i < N; ++i)
      {
        sigma_t->InsertNextValue(static_cast<float>(f(i + 0.5, j + 0.5, k + 0.5)));
      }
    }
  }
  image->GetPointData()->AddArray(sigma_t);
  return image;
}

/** A white square in the plane z, seen from above, and one scene light. */
struct Scene
{
  vtkNew<vtkRenderWindow> window;
  vtkNew<vtkRenderer> renderer;
  vtkNew<vtkPlaneSource> plane;
  vtkNew<vtkActor> actor;
  vtkNew<vtkLightTransportPolyDataMapper> mapper;
  vtkNew<vtkLight> light;
  vtkNew<vtkVisibilityFactorFilter> filter;

  explicit Scene(double z, double half = 16.)
  {
    this->window->SetSize(Size, Size);
    this->window->SetMultiSamples(0);
    this->window->AddRenderer(this->renderer);
    const double c = N / 2.;
    this->plane->SetOrigin(c - half, c - half, z);
    this->plane->SetPoint1(c + half, c - half, z);
    this->plane->SetPoint2(c - half, c + half, z);
    this->mapper->SetInputConnection(this->plane->GetOutputPort());
    this->actor->SetMapper(this->mapper);
    this->actor->GetProperty()->SetAmbient(0.);
    this->actor->GetProperty()->SetSpecular(0.);
    this->renderer->AddActor(this->actor);
    this->renderer->AutomaticLightCreationOff();
    this->renderer->AddLight(this->light);
    this->light->SetLightTypeToSceneLight();
    this->light->PositionalOff();
    this->light->SetPosition(0., 0., 1.); // towards +z
    this->light->SetFocalPoint(0., 0., 0.);
    vtkCamera* camera = this->renderer->GetActiveCamera();
    camera->ParallelProjectionOn();
    camera->SetFocalPoint(c, c, 0.);
    camera->SetPosition(c, c, 100.);
    camera->SetParallelScale(half);
    this->renderer->ResetCameraClippingRange();
    this->filter->OutputExtinctionOn();
  }
  /** Of the square's middle, 0 to 1. */
  double middle()
  {
    const Picture picture = capture(this->window);
    return regionMean(picture, Size / 2 - 3, Size / 2 - 3, Size / 2 + 2, Size / 2 + 2)[0] / 255.;
  }
  /** At a place of the plane. */
  double at(vtkImageData* picture, double x, double y, double half = 16.)
  {
    const int i = static_cast<int>((x - N / 2. + half) / (2. * half) * Size);
    const int j = static_cast<int>((y - N / 2. + half) / (2. * half) * Size);
    return pixel(picture, i, j)[0] / 255.;
  }
};

/** Without a visibility, and with its strengths 0, it is VTK's picture. */
void stock(Suite& suite)
{
  const auto box = medium([](double, double, double) { return 0.05; });
  for (int kind = 0; kind < 5; ++kind)
  {
    Picture pictures[4];
    for (int variant = 0; variant < 4; ++variant)
    {
      Scene scene(10.);
      vtkNew<vtkSphereSource> sphere;
      sphere->SetCenter(16., 16., 16.);
      sphere->SetRadius(11.);
      vtkNew<vtkPolyDataMapper> plain;
      if (variant == 0)
      {
        plain->SetInputConnection(sphere->GetOutputPort());
        scene.actor->SetMapper(plain);
      }
      scene.mapper->SetInputConnection(sphere->GetOutputPort());
      scene.filter->SetInputData(box);
      if (variant > 1)
      {
        scene.mapper->SetVisibilityConnection(scene.filter->GetOutputPort());
      }
      if (variant == 2)
      {
        scene.mapper->SetShadowStrength(0.);
        scene.mapper->SetAmbientOcclusion(0.);
      }
      scene.light->SetIntensity(0.6); // not white all over
      scene.actor->GetProperty()->SetSpecular(0.4);
      scene.actor->GetProperty()->SetAmbient(0.2);
      if (kind == 0)
      {
        scene.light->SetLightTypeToHeadlight();
      }
      else if (kind >= 2)
      {
        scene.light->PositionalOn();
        scene.light->SetPosition(40., 20., 50.);
        scene.light->SetFocalPoint(16., 16., 16.);
      }
      if (kind >= 3)
      {
        scene.actor->GetProperty()->SetInterpolationToPBR();
      }
      vtkNew<vtkLight> second;
      second->SetLightTypeToCameraLight();
      second->SetPosition(1., 0., 1.);
      if (kind == 4)
      {
        scene.renderer->AddLight(second);
      }
      scene.renderer->ResetCameraClippingRange();
      pictures[variant] = capture(scene.window);
      LT_CHECK(suite, openGLErrors().empty());
    }
    LT_CHECK(suite, regionMean(pictures[0], 25, 25, 35, 35)[0] > 40.);
    LT_CHECK(suite, difference(pictures[0], pictures[1]).largest == 0.);
    LT_CHECK(suite, difference(pictures[0], pictures[2]).largest == 0.);
    LT_CHECK(suite,
      regionMean(pictures[3], 20, 20, 40, 40)[0] <
        0.9 * regionMean(pictures[0], 20, 20, 40, 40)[0]);
  }
}

/** In a homogeneous box, from a scene light along z: e^(-sigma (N - z)). */
void exact(Suite& suite)
{
  const double sigma = 0.06;
  const auto box = medium([sigma](double, double, double) { return sigma; });
  for (double z : { 4.5, 16., 27.5 })
  {
    Scene scene(z);
    scene.filter->SetInputData(box);
    scene.filter->SphericalHarmonicsOff();
    scene.mapper->SetVisibilityConnection(scene.filter->GetOutputPort());
    LT_CHECK_NEAR(suite, scene.middle(), std::exp(-sigma * (N - z)), 0.01);
    scene.mapper->SetShadowStrength(0.5);
    LT_CHECK_NEAR(suite, scene.middle(), 0.5 + 0.5 * std::exp(-sigma * (N - z)), 0.01);
    scene.mapper->SetShadowStrength(1.);
    // A light at a place above: the same way out, and nothing between once it is inside.
    scene.light->PositionalOn();
    scene.light->SetConeAngle(120.);
    scene.light->SetPosition(16., 16., 300.);
    LT_CHECK_NEAR(suite, scene.middle(), std::exp(-sigma * (N - z)), 0.015);
    scene.light->SetPosition(16., 16., z + 8.);
    LT_CHECK_NEAR(suite, scene.middle(), std::exp(-sigma * std::min(8., N - z)), 0.02);
    // Off its own normal the surface sees cos(60 degrees) of the light, through twice the depth.
    scene.light->PositionalOff();
    scene.light->SetPosition(std::sqrt(3.), 0., 1.);
    scene.light->SetFocalPoint(0., 0., 0.);
    if (z > 25.)
    {
      LT_CHECK_NEAR(suite, scene.middle(), 0.5 * std::exp(-sigma * 2. * (N - z)), 0.01);
    }
  }

  // Two lights of different colours, each with its own shadow; the third is off.
  Scene scene(16.);
  scene.filter->SetInputData(
    medium([](double x, double, double z) { return z > 24. && z < 26. && x < 16. ? 2. : 0.; }));
  scene.mapper->SetVisibilityConnection(scene.filter->GetOutputPort());
  scene.light->SetSwitch(0);
  vtkNew<vtkLight> red;
  red->SetDiffuseColor(1., 0., 0.);
  red->PositionalOff();
  red->SetPosition(-1., 0., 1.);
  red->SetLightTypeToSceneLight();
  vtkNew<vtkLight> green;
  green->SetDiffuseColor(0., 1., 0.);
  green->PositionalOff();
  green->SetPosition(1., 0., 1.);
  green->SetLightTypeToSceneLight();
  scene.renderer->AddLight(red);
  scene.renderer->AddLight(green);
  const Picture picture = capture(scene.window);
  // Rays past the plate's edge (16, 24 to 26) rise at 45 degrees: red's shadow ends at 24 to 26,
  // green's at 6 to 8.
  const double lit = 255. * std::sqrt(0.5);
  const auto colour = [&](double x)
  { return pixel(picture, static_cast<int>(x / N * Size), Size / 2); };
  LT_CHECK_NEAR(suite, colour(12.)[0], 0., 3.);
  LT_CHECK_NEAR(suite, colour(12.)[1], lit, 3.);
  LT_CHECK_NEAR(suite, colour(28.)[0], lit, 3.);
  LT_CHECK_NEAR(suite, colour(28.)[1], lit, 3.);
  LT_CHECK_NEAR(suite, colour(4.)[1], 0., 3.);
}

/** Where there are harmonics alone, a light looks these up: what the coefficients give through the
 * window. */
void harmonics(Suite& suite)
{
  const auto shape = medium([](double x, double y, double z)
    { return (z > 20. ? 0.08 : 0.01) + (x > 20. ? 0.1 : 0.) + (y < 9. ? 0.15 : 0.); });
  for (int order = 0; order <= 4; ++order)
  {
    // The view comes from aside, so that every harmonic has its say.
    const double w[3] = { 0.48, -0.6, 0.64 };
    Scene scene(16.);
    scene.filter->SetInputData(shape);
    scene.filter->SetOrder(order);
    scene.light->SetLightTypeToHeadlight();
    // Without an extinction, with which the light would have a field of its own.
    scene.filter->Update();
    vtkNew<vtkImageData> alone;
    alone->CopyStructure(scene.filter->GetOutput());
    alone->GetPointData()->AddArray(
      scene.filter->GetOutput()->GetPointData()->GetArray("VisibilitySH"));
    scene.mapper->SetVisibilityData(alone);
    vtkCamera* camera = scene.renderer->GetActiveCamera();
    camera->SetFocalPoint(16.5, 16.5, 16.);
    camera->SetPosition(16.5 + 90. * w[0], 16.5 + 90. * w[1], 16. + 90. * w[2]);
    camera->SetViewUp(0., 1., 0.);
    scene.plane->SetCenter(16.5, 16.5, 16.);
    scene.plane->SetNormal(w[0], w[1], w[2]);
    scene.renderer->ResetCameraClippingRange();
    const double got = scene.middle();
    LT_CHECK(suite, openGLErrors().empty());

    // The middle lies between the voxels 15 and 16 along z, and at 16 along x and y.
    double window[5];
    double Y[25];
    vtkVisibilityFactorFilter::GetWindow(order, window);
    vtkVisibilityFactorFilter::GetHarmonics(order, w, Y);
    vtkDataArray* array = scene.filter->GetOutput()->GetPointData()->GetArray("VisibilitySH");
    double expected = 0.;
    for (int k : { 15, 16 })
    {
      const vtkIdType point = 16 + N * (16 + N * static_cast<vtkIdType>(k));
      for (int l = 0; l <= order; ++l)
      {
        for (int c = l * l; c < (l + 1) * (l + 1); ++c)
        {
          expected += 0.5 * window[l] * array->GetComponent(point, c) * Y[c];
        }
      }
    }
    std::cout << "order " << order << ": " << got << ", expected " << expected << "\n";
    LT_CHECK(suite, expected > 0.1 && expected < 0.9);
    LT_CHECK_NEAR(suite, got, expected, 0.008);

    // The ambient term has the mean.
    if (order == 2)
    {
      scene.actor->GetProperty()->SetAmbient(1.);
      scene.actor->GetProperty()->SetDiffuse(0.);
      const vtkIdType point = 16 + N * (16 + N * static_cast<vtkIdType>(15));
      const double mean = 0.5 *
        (array->GetComponent(point, 0) + array->GetComponent(point + N * N, 0)) /
        std::sqrt(4. * 3.14159265358979);
      LT_CHECK_NEAR(suite, scene.middle(), mean, 0.008);
      scene.mapper->SetAmbientOcclusion(0.5);
      LT_CHECK_NEAR(suite, scene.middle(), 0.5 + 0.5 * mean, 0.008);
    }
  }
}

/** A floor beside the volume has its shadow, and light where the ray misses it. */
void beside(Suite& suite)
{
  const double sigma = 0.08;
  Scene scene(-10., 40.);
  scene.filter->SetInputData(medium([sigma](double, double, double) { return sigma; }));
  scene.mapper->SetVisibilityConnection(scene.filter->GetOutputPort());
  Picture picture = capture(scene.window);
  LT_CHECK_NEAR(suite, scene.at(picture, 16., 16., 40.), std::exp(-sigma * (N - 0.5)), 0.01);
  LT_CHECK_NEAR(suite, scene.at(picture, 45., 16., 40.), 1., 0.01);
  LT_CHECK_NEAR(suite, scene.at(picture, 16., -10., 40.), 1., 0.01);
  // From a light aside the shadow moves to the other side: x from -26 to 22.
  scene.light->SetPosition(1., 0., 1.);
  picture = capture(scene.window);
  const double lit = std::sqrt(0.5);
  LT_CHECK_NEAR(suite, scene.at(picture, 28., 16., 40.), lit, 0.01);
  LT_CHECK(suite, scene.at(picture, -8., 16., 40.) < 0.2);
  // A light between the floor and the volume.
  scene.light->PositionalOn();
  scene.light->SetConeAngle(120.);
  scene.light->SetPosition(16., 16., -2.);
  picture = capture(scene.window);
  LT_CHECK_NEAR(suite, scene.at(picture, 16., 16., 40.), 1., 0.01);

  // Looked up before the surface: out of the first layer.
  Scene skin(31.4);
  skin.filter->SetInputData(medium([](double, double, double) { return 1.; }));
  skin.mapper->SetVisibilityConnection(skin.filter->GetOutputPort());
  LT_CHECK(suite, skin.middle() < 0.7);
  skin.mapper->SetSurfaceOffset(2.);
  LT_CHECK_NEAR(suite, skin.middle(), 1., 0.01);
}

/** The volume's matrix and the image's directions: shadows turn with them. */
void turned(Suite& suite)
{
  Scene straight(10.);
  straight.filter->SetInputData(
    medium([](double x, double y, double z) { return z > 16. && x < 12. && y < 20. ? 0.1 : 0.; }));
  straight.filter->SetOrder(1);
  straight.mapper->SetVisibilityConnection(straight.filter->GetOutputPort());
  straight.light->SetPosition(0.2, 0.1, 1.);
  vtkNew<vtkLight> head;
  head->SetLightTypeToHeadlight();
  head->SetIntensity(0.3);
  straight.light->SetIntensity(0.7);
  straight.renderer->AddLight(head);
  const Picture picture = capture(straight.window);
  LT_CHECK(suite, straight.at(picture, 28., 28.) > 0.8);
  LT_CHECK(suite, straight.at(picture, 5., 8.) < 0.6);

  // The data turned by a quarter about z, which the volume's matrix turns back.
  Scene moved(10.);
  moved.filter->SetInputData(medium(
    [](double x, double y, double z) { return z > 16. && y < 12. && N - x < 20. ? 0.1 : 0.; }));
  moved.filter->SetOrder(1);
  moved.mapper->SetVisibilityConnection(moved.filter->GetOutputPort());
  moved.light->SetPosition(0.2, 0.1, 1.);
  moved.light->SetIntensity(0.7);
  moved.renderer->AddLight(head);
  vtkNew<vtkVolume> volume;
  volume->SetOrigin(16., 16., 16.);
  volume->RotateZ(-90.);
  moved.mapper->SetVolume(volume);
  LT_CHECK(suite, difference(picture, capture(moved.window)).mean < 1.);
  // The same with a direction matrix: index axes x, y along the world's -y, x.
  Scene directed(10.);
  vtkNew<vtkImageData> image;
  image->ShallowCopy(moved.filter->GetInput());
  image->SetDirectionMatrix(0., 1., 0., -1., 0., 0., 0., 0., 1.);
  image->SetOrigin(0.5, 31.5, 0.5);
  directed.filter->SetInputData(image);
  directed.filter->SetOrder(1);
  directed.mapper->SetVisibilityConnection(directed.filter->GetOutputPort());
  directed.light->SetPosition(0.2, 0.1, 1.);
  directed.light->SetIntensity(0.7);
  directed.renderer->AddLight(head);
  LT_CHECK(suite, difference(picture, capture(directed.window)).mean < 1.);
}

/** From what a volume's mapper draws: its opacity, its matrix, its clipping planes. */
void drawn(Suite& suite)
{
  // Opacity 0.1 per unit distance of 2: sigma = -ln(0.9) / 2.
  const double sigma = -std::log(0.9) / 2.;
  auto image = medium([](double, double, double) { return 100.; });
  image->GetPointData()->SetActiveScalars("Extinction");
  vtkNew<vtkSmartVolumeMapper> none;
  vtkNew<vtkLightTransportVolumeMapper> volumeMapper;
  volumeMapper->SetInputData(image);
  vtkNew<vtkPiecewiseFunction> opacity;
  opacity->AddPoint(0., 0.1);
  opacity->AddPoint(200., 0.1);
  vtkNew<vtkVolume> volume;
  volume->SetMapper(volumeMapper);
  volume->GetProperty()->SetScalarOpacity(opacity);
  volume->GetProperty()->SetScalarOpacityUnitDistance(2.);
  Scene scene(8.);
  scene.mapper->SetVolume(volume);
  LT_CHECK_NEAR(suite, scene.middle(), std::exp(-sigma * 24.), 0.01);
  volume->SetPosition(0., 0., -10.);
  LT_CHECK_NEAR(suite, scene.middle(), std::exp(-sigma * 14.), 0.01);
  volume->SetPosition(0., 0., 0.);
  opacity->RemoveAllPoints();
  opacity->AddPoint(0., 0.2);
  opacity->AddPoint(200., 0.2);
  LT_CHECK_NEAR(suite, scene.middle(), std::exp(0.5 * std::log(0.8) * 24.), 0.01);
  scene.mapper->SetVisibilityResolution(16);
  LT_CHECK_NEAR(suite, scene.middle(), std::exp(0.5 * std::log(0.8) * 24.), 0.02);
  vtkNew<vtkPlane> plane;
  plane->SetOrigin(0., 0., 20.);
  plane->SetNormal(0., 0., -1.); // what lies below stays
  volumeMapper->AddClippingPlane(plane);
  LT_CHECK_NEAR(suite, scene.middle(), std::exp(0.5 * std::log(0.8) * 12.), 0.03);
  LT_CHECK(suite, openGLErrors().empty());

  // A mapper that is none of the GPU's: VTK's picture and one error.
  vtkNew<Log> log;
  scene.mapper->AddObserver(vtkCommand::ErrorEvent, log);
  volume->SetMapper(none);
  LT_CHECK_NEAR(suite, scene.middle(), 1., 0.01);
  LT_CHECK(suite, log->messages.size() == 1);
  scene.mapper->SetVolume(nullptr);
  LT_CHECK_NEAR(suite, scene.middle(), 1., 0.01);
  LT_CHECK(suite, log->messages.size() == 1);
}

void updates(Suite& suite)
{
  Scene scene(16.);
  scene.filter->SetInputData(medium([](double, double, double) { return 0.05; }));
  scene.mapper->SetVisibilityConnection(scene.filter->GetOutputPort());
  scene.middle();
  LT_CHECK(suite, scene.mapper->GetNumberOfVisibilityUploads() == 1);
  scene.renderer->GetActiveCamera()->Azimuth(10.);
  scene.light->SetIntensity(0.5);
  scene.actor->GetProperty()->SetColor(1., 0.5, 0.5);
  scene.middle();
  LT_CHECK(suite, scene.mapper->GetNumberOfVisibilityUploads() == 1);
  scene.light->SetPosition(1., 0., 1.);
  scene.middle();
  LT_CHECK(suite, scene.mapper->GetNumberOfVisibilityUploads() == 2);
  // A light of the camera's moves with it, but for panning.
  scene.light->SetLightTypeToCameraLight();
  scene.middle();
  LT_CHECK(suite, scene.mapper->GetNumberOfVisibilityUploads() == 3);
  scene.renderer->GetActiveCamera()->Azimuth(10.);
  scene.middle();
  LT_CHECK(suite, scene.mapper->GetNumberOfVisibilityUploads() == 4);
  double at[3];
  scene.renderer->GetActiveCamera()->GetPosition(at);
  scene.renderer->GetActiveCamera()->SetPosition(at[0] + 3.3, at[1], at[2]);
  scene.renderer->GetActiveCamera()->GetFocalPoint(at);
  scene.renderer->GetActiveCamera()->SetFocalPoint(at[0] + 3.3, at[1], at[2]);
  scene.middle();
  LT_CHECK(suite, scene.mapper->GetNumberOfVisibilityUploads() == 4);
  scene.light->SetLightTypeToSceneLight();
  scene.middle();
  LT_CHECK(suite, scene.mapper->GetNumberOfVisibilityUploads() == 5);
  // A second surface uploads nothing.
  {
    vtkNew<vtkLightTransportPolyDataMapper> second;
    second->SetInputConnection(scene.plane->GetOutputPort());
    second->SetVisibilityConnection(scene.filter->GetOutputPort());
    vtkNew<vtkActor> actor;
    actor->SetMapper(second);
    actor->SetPosition(0., 0., -3.);
    scene.renderer->AddActor(actor);
    scene.middle();
    LT_CHECK(suite, second->GetNumberOfVisibilityUploads() == 5);
    scene.renderer->RemoveActor(actor);
    scene.middle();
    LT_CHECK(suite, scene.mapper->GetNumberOfVisibilityUploads() >= 5);
    LT_CHECK(suite, openGLErrors().empty());
  }
  // Lights come and go; the ninth is in the harmonics.
  std::vector<vtkSmartPointer<vtkLight>> more;
  for (int i = 0; i < 9; ++i)
  {
    more.push_back(vtkSmartPointer<vtkLight>::New());
    more.back()->DeepCopy(scene.light);
    more.back()->SetIntensity(0.1);
    scene.renderer->AddLight(more.back());
    scene.middle();
    LT_CHECK(suite, openGLErrors().empty());
  }
  scene.renderer->RemoveAllLights();
  scene.renderer->AddLight(scene.light);
  scene.middle();
  scene.renderer->RemoveAllLights();
  LT_CHECK_NEAR(suite, scene.middle(), 1., 1e-9); // as VTK draws without any light
  // Another window.
  scene.window->RemoveRenderer(scene.renderer);
  vtkNew<vtkRenderWindow> other;
  other->SetSize(Size, Size);
  other->AddRenderer(scene.renderer);
  scene.renderer->AddLight(scene.light);
  scene.renderer->GetActiveCamera()->Azimuth(-10.);
  scene.light->SetPosition(0., 0., 1.);
  scene.light->SetIntensity(1.);
  scene.actor->GetProperty()->SetColor(1., 1., 1.);
  const Picture picture = capture(other);
  LT_CHECK_NEAR(suite, pixel(picture, 30, 30)[0] / 255., std::exp(-0.05 * 16.), 0.01);
  LT_CHECK(suite, openGLErrors().empty());
}

void badInput(Suite& suite)
{
  const auto failsOnce = [&](vtkImageData* image, const char* word)
  {
    Scene scene(16.);
    vtkNew<Log> log;
    scene.mapper->AddObserver(vtkCommand::ErrorEvent, log);
    scene.mapper->SetVisibilityData(image);
    LT_CHECK_NEAR(suite, scene.middle(), 1., 0.01); // VTK's picture
    scene.middle();
    LT_CHECK(suite, log->messages.size() == 1);
    suite.check(!log->messages.empty() && log->messages[0].find(word) != std::string::npos,
      std::string("\"") + word + "\" in " + (log->messages.empty() ? "" : log->messages[0]),
      __FILE__, __LINE__);
  };
  vtkNew<vtkImageData> empty;
  failsOnce(empty, "empty");
  auto image = medium([](double, double, double) { return 0.; });
  vtkDataArray* array = image->GetPointData()->GetArray(0);
  array->SetName("Something");
  failsOnce(image, "neither");
  array->SetName("Extinction");
  array->SetComponent(5, 0, -1.);
  failsOnce(image, "-1");
  vtkNew<vtkFloatArray> wrong;
  wrong->SetName("VisibilitySH");
  wrong->SetNumberOfComponents(26);
  wrong->SetNumberOfTuples(image->GetNumberOfPoints());
  wrong->Fill(1.);
  image->GetPointData()->AddArray(wrong);
  failsOnce(image, "26 components");
  Scene scene(16.);
  scene.mapper->SetShadowStrength(3.);
  scene.mapper->SetSurfaceOffset(-1.);
  LT_CHECK(
    suite, scene.mapper->GetShadowStrength() == 1. && scene.mapper->GetSurfaceOffset() == 0.);
}

/** Three balls in the MR head and a floor below it: a figure of the documentation, and numbers. */
void head(Suite& suite)
{
  if (!suite.hasData("mr_head.nii.gz"))
  {
    return;
  }
  vtkNew<vtkNIFTIImageReader> reader;
  reader->SetFileName((suite.data + "/mr_head.nii.gz").c_str());
  vtkNew<vtkImageResize> small;
  small->SetInputConnection(reader->GetOutputPort());
  small->SetOutputDimensions(48, 64, 48);
  small->Update();
  vtkNew<vtkPiecewiseFunction> opacity;
  opacity->AddPoint(25., 0.);
  opacity->AddPoint(60., 0.012);
  opacity->AddPoint(255., 0.03);
  vtkNew<vtkColorTransferFunction> colour;
  colour->AddRGBPoint(0., 0.9, 0.75, 0.6);
  colour->AddRGBPoint(255., 1., 0.95, 0.9);
  vtkNew<vtkVisibilityFactorFilter> visibility;
  visibility->SetInputConnection(small->GetOutputPort());
  visibility->SetScalarOpacity(opacity);
  visibility->OutputExtinctionOn();
  double c[3];
  double bounds[6];
  small->GetOutput()->GetCenter(c);
  small->GetOutput()->GetBounds(bounds);

  Picture pictures[2];
  for (const bool shadowed : { false, true })
  {
    vtkNew<vtkRenderWindow> window;
    window->SetSize(200, 160);
    window->SetMultiSamples(0);
    vtkNew<vtkRenderer> renderer;
    renderer->SetBackground(0.15, 0.17, 0.2);
    window->AddRenderer(renderer);
    vtkNew<vtkLightTransportVolumeMapper> volumeMapper;
    volumeMapper->SetInputConnection(small->GetOutputPort());
    vtkNew<vtkVolumeLightingProperty> lighting;
    vtkNew<vtkVolume> volume;
    volume->SetMapper(volumeMapper);
    volume->GetProperty()->SetScalarOpacity(opacity);
    volume->GetProperty()->SetColor(colour);
    volume->GetProperty()->SetInterpolationTypeToLinear();
    volume->GetProperty()->SetAmbient(0.15);
    volume->GetProperty()->SetDiffuse(0.85);
    if (shadowed)
    {
      volumeMapper->SetVisibilityConnection(visibility->GetOutputPort());
      volumeMapper->SetLightingProperty(lighting);
    }
    renderer->AddVolume(volume);
    const auto add = [&](vtkAlgorithm* source, double r, double g, double b)
    {
      vtkNew<vtkLightTransportPolyDataMapper> mapper;
      mapper->SetInputConnection(source->GetOutputPort());
      if (shadowed)
      {
        mapper->SetVisibilityConnection(visibility->GetOutputPort());
      }
      vtkNew<vtkActor> actor;
      actor->SetMapper(mapper);
      actor->GetProperty()->SetColor(r, g, b);
      actor->GetProperty()->SetAmbient(0.1);
      actor->GetProperty()->SetDiffuse(0.9);
      actor->GetProperty()->SetSpecular(0.2);
      renderer->AddActor(actor);
    };
    for (int ball = -1; ball <= 1; ++ball)
    {
      vtkNew<vtkSphereSource> sphere;
      sphere->SetCenter(c[0] + 42. * ball, c[1] + 10., c[2] + 20.);
      sphere->SetRadius(16.);
      sphere->SetThetaResolution(48);
      sphere->SetPhiResolution(32);
      add(sphere,
        ball < 0     ? 0.2
          : ball > 0 ? 0.3
                     : 1.,
        ball < 0     ? 0.6
          : ball > 0 ? 1.
                     : 0.85,
        ball < 0     ? 1.
          : ball > 0 ? 0.4
                     : 0.2);
    }
    vtkNew<vtkPlaneSource> floor;
    const double z = bounds[4] - 6.;
    floor->SetOrigin(c[0] - 180., c[1] - 180., z);
    floor->SetPoint1(c[0] + 180., c[1] - 180., z);
    floor->SetPoint2(c[0] - 180., c[1] + 180., z);
    add(floor, 0.8, 0.8, 0.8);
    renderer->AutomaticLightCreationOff();
    vtkNew<vtkLight> light;
    light->SetLightTypeToSceneLight();
    light->PositionalOff();
    light->SetPosition(-1., 0.6, 1.3); // from the right of the picture
    light->SetFocalPoint(0., 0., 0.);
    renderer->AddLight(light);
    vtkCamera* camera = renderer->GetActiveCamera();
    camera->SetFocalPoint(c);
    camera->SetPosition(c[0], c[1] + 520., c[2] + 220.);
    camera->SetViewUp(0., 0., 1.);
    camera->SetViewAngle(28.);
    renderer->ResetCameraClippingRange();
    pictures[shadowed] = capture(window);
    LT_CHECK(suite, openGLErrors().empty());
    writePicture(
      suite, pictures[shadowed], shadowed ? "PolyDataInHeadShadowed" : "PolyDataInHeadStock");
  }
  // The floor's shadow lies on the left; on the right the light has its way.
  const auto both = [&](int x0, int y0, int x1, int y1)
  {
    return std::array<double, 2>{ { regionMean(pictures[0], x0, y0, x1, y1)[0],
      regionMean(pictures[1], x0, y0, x1, y1)[0] } };
  };
  const auto shadow = both(32, 48, 48, 56);
  LT_CHECK(suite, shadow[1] < 0.6 * shadow[0]);
  const auto free = both(165, 20, 180, 40);
  LT_CHECK(suite, free[0] > 120.);
  LT_CHECK_NEAR(suite, free[1], free[0], 1.);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  if (!canRender())
  {
    return Suite::skipped();
  }
  stock(suite);
  exact(suite);
  harmonics(suite);
  beside(suite);
  turned(suite);
  drawn(suite);
  updates(suite);
  badInput(suite);
  head(suite);
  return suite.result();
}
