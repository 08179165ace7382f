// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The whole way: a phantom head with two ventricles, its optical medium, a seed
 * in either, the solver, the mapper. The lit ventricle is warm, the one with the
 * negative seed cold, the rest stays grey; a moved seed shows at the next Render.
 */
#include "VolumeMapperScene.h"

#include "vtkColorTransferFunction.h"
#include "vtkLightDiffusionFilter.h"
#include "vtkLightFieldProperty.h"
#include "vtkLightSeedFilter.h"
#include "vtkOpticalMediumFilter.h"

using namespace lighttransport::testing;

namespace
{
constexpr int N = 44;
const Point Head = { 21.5, 21.5, 21.5 };
const Point Right = { 14.5, 20., 23. }; // middles of the ventricles
const Point Left = { 28.5, 20., 23. };

double inEllipsoid(const Point& p, const Point& c, double rx, double ry, double rz)
{
  return std::hypot((p[0] - c[0]) / rx, (p[1] - c[1]) / ry, (p[2] - c[2]) / rz);
}

/** Skin and skull 200, brain 110, ventricles 20, smooth over a voxel or so. */
double phantom(const Point& p)
{
  const auto soft = [](double r, double width) { return .5 - .5 * std::tanh((r - 1.) / width); };
  const double outer = soft(inEllipsoid(p, Head, 17., 20., 20.), .06);
  const double inner = soft(inEllipsoid(p, Head, 15., 18., 18.), .06);
  const double hollow =
    soft(inEllipsoid(p, Right, 4., 10., 5.), .2) + soft(inEllipsoid(p, Left, 4., 10., 5.), .2);
  return 200. * outer - 90. * inner - 90. * hollow;
}

double warmth(const Color& c)
{
  return c[0] - c[2];
}

/** The same head in micrometres, millimetres and kilometres: the same picture. */
void rescaledUnits(Suite& suite)
{
  vtkSmartPointer<vtkImageData> reference;
  for (const double u : { 1., 1e3, 1e-6 })
  {
    auto head = makeGrid(N, N, N);
    setScalars(head, phantom);
    head->SetSpacing(u, u, u);
    vtkNew<vtkOpticalMediumFilter> medium;
    medium->SetInputData(head);
    medium->SetGradientScale(12. / u);
    vtkNew<vtkLightSeedFilter> seeds;
    seeds->SetInputConnection(medium->GetOutputPort());
    seeds->AddSphere(Right[0] * u, Right[1] * u, Right[2] * u, 1.5 * u, 1.);
    seeds->AddSphere(Left[0] * u, Left[1] * u, Left[2] * u, 1.5 * u, -1.);
    vtkNew<vtkLightDiffusionFilter> diffusion;
    diffusion->SetInputConnection(seeds->GetOutputPort());
    LitScene scene(head, 120, 120);
    scene.mapper->SetLightFieldConnection(diffusion->GetOutputPort());
    scene.mapper->SetSampleDistance(static_cast<float>(.5 * u));
    scene.property->SetScalarOpacityUnitDistance(u);
    scene.opacity->RemoveAllPoints();
    scene.opacity->AddPoint(30., 0.);
    scene.opacity->AddPoint(200., .08);
    scene.look({ .2, 1., .4 });
    const vtkSmartPointer<vtkImageData> picture = scene.capture();
    if (!reference)
    {
      reference = picture;
      double range[2];
      picture->GetScalarRange(range);
      LT_CHECK(suite, range[1] > 100.); // there is something to see
    }
    const Difference d = difference(picture, reference);
    std::cout << "unit " << u << ": mean difference " << d.mean << ", largest " << d.largest
              << "\n";
    LT_CHECK(suite, d.mean < 0.2 && d.largest <= 6.);
  }
}
/**
 * Positive light alone has no negative colour anywhere, however early the solve ends: another
 * colour for negative values leaves the picture as it is, and with a negative seed does not.
 */
void noNegativeColour(Suite& suite)
{
  auto head = makeGrid(N, N, N);
  setScalars(head, phantom);
  vtkNew<vtkOpticalMediumFilter> medium;
  medium->SetInputData(head);
  medium->SetGradientScale(12.);
  vtkNew<vtkLightSeedFilter> seeds;
  seeds->SetInputConnection(medium->GetOutputPort());
  seeds->AddSphere(Right.data(), 1.5, 1.);
  vtkNew<vtkLightDiffusionFilter> diffusion;
  diffusion->SetInputConnection(seeds->GetOutputPort());
  LitScene scene(head, 120, 120);
  scene.mapper->SetLightFieldConnection(diffusion->GetOutputPort());
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(30., 0.);
  scene.opacity->AddPoint(200., .08);
  scene.look({ .2, 1., .4 });
  vtkNew<vtkColorTransferFunction> blue;
  blue->AddRGBPoint(0., 0., 0., .2);
  blue->AddRGBPoint(1., 0., .5, 1.);
  vtkNew<vtkColorTransferFunction> green;
  green->AddRGBPoint(0., 0., 1., 0.);
  green->AddRGBPoint(1., 0., 1., 0.);
  const auto change = [&]
  {
    scene.mapper->GetLightFieldProperty()->SetNegativeColorMap(blue);
    const vtkSmartPointer<vtkImageData> one = scene.capture();
    scene.mapper->GetLightFieldProperty()->SetNegativeColorMap(green);
    return difference(scene.capture(), one).largest;
  };
  for (const double tolerance : { 0.1, 1e-2, 1e-4, 1e-8 })
  {
    diffusion->SetTolerance(tolerance);
    LT_CHECK(suite, change() == 0.);
    vtkDataArray* phi = diffusion->GetOutput()->GetPointData()->GetArray("Fluence");
    double range[2];
    phi->GetRange(range);
    std::cout << "tolerance " << tolerance << ": fluence from " << range[0] / range[1]
              << " of the largest\n";
    LT_CHECK(suite, range[0] >= -1e-7 * range[1] && range[1] > 0.);
  }
  seeds->AddSphere(Left.data(), 1.5, -1.);
  LT_CHECK(suite, change() > 50.);
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
  noNegativeColour(suite);
  auto head = makeGrid(N, N, N);
  setScalars(head, phantom);
  vtkNew<vtkOpticalMediumFilter> medium;
  medium->SetInputData(head);
  medium->SetGradientScale(12.);
  vtkNew<vtkLightSeedFilter> seeds;
  seeds->SetInputConnection(medium->GetOutputPort());
  seeds->AddSphere(Right.data(), 1.5, 1.);
  seeds->AddSphere(Left.data(), 1.5, -1.);
  vtkNew<vtkLightDiffusionFilter> diffusion;
  diffusion->SetInputConnection(seeds->GetOutputPort());
  diffusion->SetComputeFlux(true);

  LitScene scene(head, 200, 200);
  scene.mapper->SetLightFieldConnection(diffusion->GetOutputPort());
  auto observer = observe(scene.mapper);
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(30., 0.);
  scene.opacity->AddPoint(110., .02);
  scene.opacity->AddPoint(200., .08);
  scene.color->RemoveAllPoints();
  scene.color->AddRGBPoint(0., .1, .1, .1);
  scene.color->AddRGBPoint(200., .95, .93, .9);
  scene.renderer->SetBackground(.08, .08, .1);
  scene.look({ .2, 1., .4 });
  scene.renderer->GetActiveCamera()->Zoom(1.4);

  const auto at = [&](vtkImageData* picture, const Point& p)
  {
    scene.renderer->SetWorldPoint(p[0], p[1], p[2], 1.);
    scene.renderer->WorldToDisplay();
    const double* d = scene.renderer->GetDisplayPoint();
    const int x = static_cast<int>(d[0]);
    const int y = static_cast<int>(d[1]);
    return regionMean(picture, x - 2, y - 2, x + 2, y + 2);
  };
  const Point elsewhere = { Head[0], Head[1], 33. };

  const Picture overlay = scene.capture();
  LT_CHECK(suite, warmth(at(overlay, Right)) > 60.);
  LT_CHECK(suite, warmth(at(overlay, Left)) < -60.);
  LT_CHECK(suite, std::abs(warmth(at(overlay, elsewhere))) < 25.);
  compareWithBaseline(suite, overlay, "VolumeMapperOverlay");

  scene.property->ShadeOn();
  scene.mapper->GetLightFieldProperty()->SetModeToFluxDirection();
  scene.look({ 0., 0., 1. });
  scene.renderer->GetActiveCamera()->Zoom(1.4);
  const Picture flux = scene.capture();
  // Beside the seed light flows along x, before it along y.
  const Color besides = at(flux, { Right[0] + 2.5, Right[1], Right[2] });
  const Color before = at(flux, { Right[0], Right[1] + 5., Right[2] });
  LT_CHECK(suite, besides[0] > besides[1] + 20.);
  LT_CHECK(suite, before[1] > before[0] + 20.);
  compareWithBaseline(suite, flux, "VolumeMapperFluxDirection");

  scene.property->ShadeOff();
  scene.mapper->GetLightFieldProperty()->SetModeToOverlay();
  scene.mapper->SetBlendModeToMaximumIntensity();
  scene.opacity->AddPoint(200., .7);
  scene.look({ .2, 1., .4 });
  scene.renderer->GetActiveCamera()->Zoom(1.4);
  const Picture maximum = scene.capture();
  LT_CHECK(suite, warmth(at(maximum, Right)) > 60. && warmth(at(maximum, Left)) < -20.);
  compareWithBaseline(suite, maximum, "VolumeMapperMaximum");

  // The seeds change sides: a Render is enough, and only the field goes to the GPU.
  scene.mapper->SetBlendModeToComposite();
  const int builds = scene.mapper->GetNumberOfShaderBuilds();
  scene.window->Render();
  const int uploads = scene.mapper->GetNumberOfLightFieldUploads();
  seeds->SetSphere(0, Left.data(), 1.5, 1.);
  seeds->SetSphere(1, Right.data(), 1.5, -1.);
  const Picture swapped = scene.capture();
  LT_CHECK(suite, warmth(at(swapped, Right)) < -60. && warmth(at(swapped, Left)) > 60.);
  LT_CHECK(suite, scene.mapper->GetNumberOfLightFieldUploads() == uploads + 1);
  LT_CHECK(suite, scene.mapper->GetNumberOfShaderBuilds() == builds + 1); // the blend mode's

  // The darkness of Illuminate, and the light in it: where there is tissue to see it.
  scene.opacity->RemoveAllPoints();
  scene.opacity->AddPoint(0., .01);
  scene.opacity->AddPoint(15., .06);
  scene.opacity->AddPoint(200., .06);
  scene.color->RemoveAllPoints();
  scene.color->AddRGBPoint(0., .5, .5, .5);
  scene.mapper->GetLightFieldProperty()->SetModeToIlluminate();
  const Picture lit = scene.capture();
  writePicture(suite, lit, "VolumeMapperIlluminate");
  LT_CHECK(suite, at(lit, Left)[1] > 1.2 * at(lit, Right)[1]);
  LT_CHECK(suite, observer->all().empty());
  rescaledUnits(suite);
  LT_CHECK(suite, openGLErrors().empty());
  return suite.result();
}
