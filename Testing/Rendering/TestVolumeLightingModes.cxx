// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * The lighting in every configuration of the superclass: with strength 0 the stock
 * picture to the pixel; left out where it has no meaning; else a shader that builds,
 * no error, and precomputed shadows like those that rays in the shader find.
 */
#include "VolumeMapperConfigurations.h"

#include "vtkLight.h"
#include "vtkVolumeLightingProperty.h"

using namespace lighttransport::testing;

namespace
{
/** Two suns; as scene lights they have exact fields. */
template <typename S>
void addSuns(S& scene)
{
  const Point places[2] = { { -60., 10., 70. }, { 30., -80., 20. } };
  for (const Point& place : places)
  {
    vtkNew<vtkLight> sun;
    sun->SetLightTypeToSceneLight();
    sun->SetPosition(place[0], place[1], place[2]);
    sun->SetFocalPoint(9.5, 9.5, 9.5);
    sun->SetIntensity(.7);
    scene.renderer->AddLight(sun);
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
  for (const Configuration& c : configurations())
  {
    // Shade has no say, other lights are another test's, and these make no other lighting.
    const std::string name = c.name;
    if ((name.find("shaded") != std::string::npos && name.find("four") == std::string::npos) ||
      name == "composite nearest" || name == "composite jittered" ||
      name == "composite coarse image" || name == "composite parallel")
    {
      continue;
    }
    auto image = c.components == 1 ? oneComponent() : components(c.components);
    StockScene stock(image, 32, 32);
    LitScene lit(image, 32, 32);
    auto observer = observe(lit.mapper);
    stock.mapper->SetBlendMode(c.blend);
    lit.mapper->SetBlendMode(c.blend);
    addSuns(stock);
    addSuns(lit);
    c.apply(stock.mapper, stock.property, stock.renderer);
    c.apply(lit.mapper, lit.property, lit.renderer);
    // Dense, so that there is a shadow.
    for (int k = 0; k < 4; ++k)
    {
      stock.property->SetScalarOpacityUnitDistance(k, .25);
      lit.property->SetScalarOpacityUnitDistance(k, .25);
    }
    vtkNew<vtkVolumeLightingProperty> lighting;
    lit.mapper->SetLightingProperty(lighting);
    const auto check = [&](bool ok, const std::string& what)
    { suite.check(ok, name + ": " + what, __FILE__, __LINE__); };

    const Picture expected = stock.capture();
    lighting->SetStrength(0.);
    check(difference(expected, lit.capture()).largest == 0., "strength 0 is the stock picture");
    lighting->SetStrength(1.);
    const bool meaningful =
      c.blend == vtkVolumeMapper::COMPOSITE_BLEND || c.blend == vtkVolumeMapper::ISOSURFACE_BLEND;
    const Picture shadowed = lit.capture();
    if (!meaningful)
    {
      check(difference(expected, shadowed).largest == 0., "lighting is left out");
      check(observer->all().empty(), observer->all());
      continue;
    }
    const Color mean = regionMean(shadowed, 8, 8, 23, 23);
    check(mean[0] > 2., "something is lit: " + std::to_string(mean[0]));
    lighting->SetShadowStrength(1e-6); // as without, and no shader of its own to build
    const Picture bright = lit.capture();
    lighting->SetShadowStrength(1.);
    const double darker = regionMean(bright, 8, 8, 23, 23)[0] - mean[0];
    check(darker > .5, "shadows darken by " + std::to_string(darker));
    lighting->SetShadowModeToRayTraced();
    const Picture traced = lit.capture();
    const double quality = psnr(shadowed, traced);
    const double without = psnr(bright, traced);
    std::cout << name << ": " << quality << " dB, without shadows " << without << "\n";
    check(quality >= 30., "precomputed against traced shadows " + std::to_string(quality) + " dB");
    check(quality > without + 6., "better than no shadows, " + std::to_string(without));
    if (name == "composite partitions")
    {
      // A ray would see its own block alone.
      check(difference(shadowed, traced).largest == 0., "as precomputed");
      continue;
    }
    if (name == "composite two independent components" || name == "composite 2-D" ||
      name == "composite four dependent components" || name == "composite label mask" ||
      name == "isosurface")
    {
      lighting->SetColoredShadows(true);
      const Picture tracedColors = lit.capture();
      lighting->SetShadowModeToPrecomputed();
      const double colored = psnr(lit.capture(), tracedColors);
      std::cout << name << ", coloured: " << colored << " dB, against grey "
                << psnr(shadowed, tracedColors) << "\n";
      check(colored >= 30., "coloured " + std::to_string(colored) + " dB");
      lighting->SetColoredShadows(false);
    }
    if (name == "composite" || name == "isosurface")
    {
      lighting->SetShadowModeToPrecomputed();
      lighting->SetShadingModelToPhysicallyBased();
      lighting->SetAnisotropy(.5);
      lighting->SetEnvironmentStrength(.5);
      lighting->SetStrength(.5);
      check(difference(shadowed, lit.capture()).largest > 3., "another model");
      lighting->SetDeferred(true);
      check(regionMean(lit.capture(), 8, 8, 23, 23)[0] > 2., "first hit");
      lighting->SetDeferred(false);
    }
    lighting->SetStrength(0.);
    check(difference(expected, lit.capture()).largest == 0., "strength 0 again");
    check(observer->all().empty(), observer->all());
    check(openGLErrors().empty(), "OpenGL error");
  }
  return suite.result();
}
