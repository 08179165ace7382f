// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * A homogeneous ball, lit: single scattering as its closed forms have it, in every
 * mode of shadows, on any side, in any units; under an even environment nothing is
 * brighter than that; the light's direction does not change the mean.
 */
#include "VolumeMapperScene.h"

#include "vtkLight.h"
#include "vtkMatrix4x4.h"
#include "vtkTransform.h"
#include "vtkVolumeLightingProperty.h"

using namespace lighttransport::testing;

namespace
{
constexpr int N = 33;
constexpr double Radius = 14.; // voxels
constexpr double Middle = 16.;
constexpr int Size = 21;

/** From the eye at the far left of a chord to its end; s and everything in voxels. */
template <typename F>
double integrate(double end, F f)
{
  constexpr int steps = 4000;
  double sum = 0.;
  for (int i = 0; i < steps; ++i)
  {
    sum += f((i + .5) * end / steps);
  }
  return sum * end / steps;
}

/** Optical depth per voxel, and how far light goes in the ball from a place on its axis. */
struct Ball
{
  double sigma;

  /** Along the direction whose cosine with the axis is mu, from x on the axis (0 the middle). */
  static double path(double x, double mu)
  {
    return -x * mu + std::sqrt(std::max(Radius * Radius - x * x * (1. - mu * mu), 0.));
  }
  /** Radiance of the middle pixel, light from the direction with cosine mu to the eye's. */
  double scattered(double mu, double share = 1.) const
  {
    // The eye is at +x; s is the way into the ball. Light in a colour has its share of sigma.
    return integrate(2. * Radius,
      [&](double s)
      { return this->sigma * std::exp(-this->sigma * (s + share * path(Radius - s, mu))); });
  }
  double underEvenSky() const
  {
    return integrate(2. * Radius,
      [&](double s)
      {
        double mean = 0.;
        constexpr int directions = 200;
        for (int i = 0; i < directions; ++i)
        {
          const double mu = 2. * (i + .5) / directions - 1.;
          mean += std::exp(-this->sigma * path(Radius - s, mu)) / directions;
        }
        return this->sigma * std::exp(-this->sigma * s) * mean;
      });
  }
};

struct BallScene : LitScene
{
  explicit BallScene(vtkImageData* image)
    : LitScene(image, Size, Size)
  {
    this->color->RemoveAllPoints();
    this->color->AddRGBPoint(0., 1., 1., 1.);
    this->property->SetAmbient(0.);
    this->property->SetDiffuse(1.);
    this->property->SetSpecular(0.);
    this->renderer->AutomaticLightCreationOff();
    this->renderer->AddLight(this->sun);
    this->sun->SetLightTypeToSceneLight();
    this->lighting->SetGradientThreshold(1e9); // all is a medium
    this->mapper->SetLightingProperty(this->lighting);
  }
  void setDepth(double sigmaPerVoxel, double voxel)
  {
    // An opacity of .5 over the unit distance.
    this->opacity->RemoveAllPoints();
    this->opacity->AddPoint(49.9, 0.);
    this->opacity->AddPoint(50.1, .5);
    this->property->SetScalarOpacityUnitDistance(std::log(2.) / sigmaPerVoxel * voxel);
    this->mapper->SetSampleDistance(static_cast<float>(.25 * voxel));
  }
  /** The sun at the angle whose cosine to the eye is mu, turned about the view. */
  void setSun(double mu, double turn = 0.)
  {
    vtkCamera* camera = this->renderer->GetActiveCamera();
    camera->OrthogonalizeViewUp();
    double eye[3];
    camera->GetDirectionOfProjection(eye);
    double up[3];
    camera->GetViewUp(up);
    vtkNew<vtkTransform> transform;
    transform->RotateWXYZ(turn, eye);
    const double* side = transform->TransformVector(up);
    const double s = std::sqrt(std::max(1. - mu * mu, 0.));
    this->sun->SetFocalPoint(0., 0., 0.);
    this->sun->SetPosition(
      -mu * eye[0] + s * side[0], -mu * eye[1] + s * side[1], -mu * eye[2] + s * side[2]);
  }
  /** Of the pixel in the middle. */
  Color middle() { return pixel(this->capture(), Size / 2, Size / 2); }
  double green() { return this->middle()[1] / 255.; }

  vtkNew<vtkLight> sun;
  vtkNew<vtkVolumeLightingProperty> lighting;
};

vtkSmartPointer<vtkImageData> makeBall(double voxel)
{
  auto image = makeGrid(N, N, N);
  setScalars(image,
    [](const Point& p)
    {
      const double r = std::hypot(p[0] - Middle, p[1] - Middle, p[2] - Middle);
      return 50. + 50. * std::min(std::max(Radius - r, -1.), 1.);
    });
  image->SetSpacing(voxel, voxel, voxel);
  return image;
}

void closedForms(Suite& suite)
{
  for (const double voxel : { 1., 1e3 })
  {
    auto image = makeBall(voxel);
    BallScene scene(image);
    scene.look({ 1., 0., 0. }, true);
    auto observer = observe(scene.mapper);
    for (const double sigma : { .01, .05, .2 })
    {
      const Ball ball{ sigma };
      scene.setDepth(sigma, voxel);
      for (const double mu : { 1., 0., -1. })
      {
        scene.setSun(mu, 30.);
        // The integral itself has closed forms in front and behind.
        const double tau = 2. * Radius * sigma;
        const double expected = ball.scattered(mu);
        if (mu == 1.)
        {
          LT_CHECK_CLOSE(suite, expected, (1. - std::exp(-2. * tau)) / 2., 1e-4);
        }
        if (mu == -1.)
        {
          LT_CHECK_CLOSE(suite, expected, tau * std::exp(-tau), 1e-4);
        }
        for (const int mode :
          { vtkVolumeLightingProperty::Precomputed, vtkVolumeLightingProperty::RayTraced })
        {
          scene.lighting->SetShadowMode(mode);
          const double value = scene.green();
          std::cout << "voxel " << voxel << ", sigma " << sigma << ", mu " << mu << ", mode "
                    << mode << ": " << value << ", closed form " << expected << "\n";
          // The visibility's grid knows the ball's edge to half a voxel.
          const double edge = mode == vtkVolumeLightingProperty::Precomputed ? .5 * sigma : 0.;
          LT_CHECK_NEAR(suite, value, expected, (.03 + edge) * expected + .005);
        }
        // The harmonics soften the contrast of v, which is largest where the ball is dense.
        scene.lighting->SetShadowModeToPrecomputed();
        scene.lighting->SetNumberOfExactLights(0);
        LT_CHECK_NEAR(suite, scene.green(), expected, .1 * expected + .3 * sigma);
        scene.lighting->SetNumberOfExactLights(4);
      }
    }
    // Henyey and Greenstein: 6 times forward, 2/9 backward for g = 1/2.
    scene.setDepth(.01, voxel);
    scene.lighting->SetAnisotropy(.5);
    scene.setSun(-1.);
    scene.sun->SetIntensity(.5);
    LT_CHECK_CLOSE(suite, scene.green(), 3. * Ball{ .01 }.scattered(-1.), .03);
    scene.setSun(1.);
    scene.sun->SetIntensity(4.);
    LT_CHECK_CLOSE(suite, scene.green(), 8. / 9. * Ball{ .01 }.scattered(1.), .03);
    scene.lighting->SetAnisotropy(0.);

    // An even sky of 1/2: its closed form, and nothing brighter.
    scene.sun->SwitchOff();
    scene.lighting->SetEnvironmentStrength(.5);
    for (const double sigma : { .01, .05, .2 })
    {
      scene.setDepth(sigma, voxel);
      const double expected = .5 * Ball{ sigma }.underEvenSky();
      const double value = scene.green();
      std::cout << "sky, sigma " << sigma << ": " << value << ", closed form " << expected << "\n";
      LT_CHECK_NEAR(suite, value, expected, (.02 + .5 * sigma) * expected + .005);
    }
    LT_CHECK(suite, observer->all().empty());
  }
}

/** From medium to surface: w = smoothstep(1/2, 2) of the gradient over the threshold, in data
 * units. */
void threshold(Suite& suite)
{
  // A ramp of 3 per length 2 along the view, opaque from within on.
  auto image = makeGrid(9, 9, 9);
  setScalars(image, [](const Point& p) { return 100. - 3. * p[0]; });
  image->SetSpacing(2., 2., 2.);
  BallScene scene(image);
  scene.look({ 1., 0., 0. }, true);
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(85., 0.);
  scene.opacity->AddPoint(85.01, 1.);
  scene.lighting->SetShadowModeToNoShadows();
  scene.setSun(.5);
  for (const double ratio : { .1, .5, .8, 1., 1.25, 1.6, 2., 9. })
  {
    scene.lighting->SetGradientThreshold(1.5 / ratio);
    const double t = std::min(std::max((ratio - .5) / 1.5, 0.), 1.);
    const double w = t * t * (3. - 2. * t);
    // Of the surface cos 60 degrees, of the medium everything.
    LT_CHECK_NEAR(suite, scene.green(), 1. - .5 * w, .01);
  }
}

/** Light takes the transport colour of the ball: each channel's closed form. */
void colors(Suite& suite)
{
  auto image = makeBall(1.);
  BallScene scene(image);
  scene.color->RemoveAllPoints();
  const double rgb[3] = { .9, .5, .2 };
  scene.color->AddRGBPoint(0., rgb[0], rgb[1], rgb[2]);
  scene.look({ 1., 0., 0. }, true);
  scene.setDepth(.08, 1.);
  scene.setSun(0., 30.);
  auto observer = observe(scene.mapper);
  scene.lighting->SetColoredShadows(true);
  const double sum = 3. * 1.1 - rgb[0] - rgb[1] - rgb[2];
  for (const int mode :
    { vtkVolumeLightingProperty::Precomputed, vtkVolumeLightingProperty::RayTraced })
  {
    scene.lighting->SetShadowMode(mode);
    const Color mean = scene.middle();
    for (int c = 0; c < 3; ++c)
    {
      const double share = 3. * (1.1 - rgb[c]) / sum;
      const double expected = rgb[c] * Ball{ .08 }.scattered(0., share);
      std::cout << "colour " << c << ", mode " << mode << ": " << mean[c] / 255. << ", closed form "
                << expected << "\n";
      LT_CHECK_NEAR(suite, mean[c] / 255., expected, .07 * expected + .005);
    }
    // The fifth of five has no field in colours, and grey shadows.
    for (int i = 0; i < 4; ++i)
    {
      vtkNew<vtkLight> more;
      more->SetLightTypeToSceneLight();
      more->SetPosition(scene.sun->GetPosition());
      more->SetFocalPoint(0., 0., 0.);
      more->SetIntensity(.2);
      scene.renderer->AddLight(more);
    }
    scene.sun->SetIntensity(.2);
    const Color five = scene.middle();
    LT_CHECK_NEAR(suite, five[0], mean[0], .15 * mean[0]);
    scene.sun->SetIntensity(1.);
    scene.renderer->RemoveAllLights();
    scene.renderer->AddLight(scene.sun);
  }
  LT_CHECK(suite, observer->all().empty());
}

/** Albedo 1, opaque or not, surface or medium, shadows or none: not brighter than the sky. */
void energy(Suite& suite)
{
  auto image = makeBall(1.);
  BallScene scene(image);
  scene.look({ 1., .5, .3 }, false);
  scene.sun->SwitchOff();
  scene.lighting->SetEnvironmentStrength(.5);
  for (const double sigma : { .05, 5. })
  {
    scene.setDepth(sigma, 1.);
    for (const double threshold : { 1e-6, 1e9 })
    {
      scene.lighting->SetGradientThreshold(threshold);
      for (const int mode :
        { vtkVolumeLightingProperty::NoShadows, vtkVolumeLightingProperty::Precomputed })
      {
        scene.lighting->SetShadowMode(mode);
        const Picture picture = scene.capture();
        double range[2];
        picture->GetScalarRange(range);
        LT_CHECK(suite, range[1] <= 128.);
        LT_CHECK(suite, range[1] > 10.);
        if (mode == vtkVolumeLightingProperty::NoShadows && sigma > 1.)
        {
          LT_CHECK_NEAR(suite, pixel(picture, Size / 2, Size / 2)[0], 127.5, 1.);
        }
      }
    }
  }
}

/** Turned about the view, or turned with it, or the ball turned: the same light in all. */
void rotation(Suite& suite)
{
  auto image = makeBall(1.);
  BallScene scene(image);
  scene.setDepth(.1, 1.);
  for (const int exact : { 4, 0 })
  {
    scene.lighting->SetNumberOfExactLights(exact);
    double least = 1e9;
    double most = 0.;
    const Point views[] = { { 1., 0., 0. }, { -.6, .5, .4 }, { .1, -.2, 1. } };
    for (const Point& view : views)
    {
      scene.look(view, true);
      scene.renderer->GetActiveCamera()->SetParallelScale(20.);
      for (const double turn : { 0., 75., 200. })
      {
        scene.setSun(.5, turn);
        scene.volume->SetOrientation(turn, 0., 0.);
        scene.volume->SetOrigin(Middle, Middle, Middle);
        const double mean = regionMean(scene.capture(), 0, 0, Size - 1, Size - 1)[0];
        least = std::min(least, mean);
        most = std::max(most, mean);
      }
    }
    std::cout << "means with " << exact << " exact lights: " << least << " to " << most << "\n";
    LT_CHECK(suite, least > 5. && most < 1.02 * least);
  }
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
  closedForms(suite);
  threshold(suite);
  colors(suite);
  energy(suite);
  rotation(suite);
  LT_CHECK(suite, openGLErrors().empty());
  return suite.result();
}
