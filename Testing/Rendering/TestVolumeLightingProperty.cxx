// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** The lighting property's limits and times. No window. */
#include "VolumeMapperScene.h"

#include "vtkVolumeLightingProperty.h"

#include <limits>
#include <sstream>

using namespace lighttransport::testing;

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  vtkNew<vtkVolumeLightingProperty> p;
  auto observer = observe(p);

  LT_CHECK(suite, p->GetStrength() == 1. && p->GetShadowMode() == 1);
  p->SetStrength(3.);
  p->SetShadowStrength(-1.);
  p->SetRoughness(2.);
  p->SetMetallic(-2.);
  p->SetAnisotropy(1.);
  p->SetAmbientOcclusion(7.);
  p->SetSurfaceOffset(99.);
  p->SetNumberOfExactLights(9);
  p->SetVisibilityOrder(9);
  p->SetVisibilityResolution(1);
  LT_CHECK(suite, p->GetStrength() == 1. && p->GetShadowStrength() == 0.);
  LT_CHECK(suite, p->GetRoughness() == 1. && p->GetMetallic() == 0. && p->GetAnisotropy() == .95);
  LT_CHECK(suite, p->GetAmbientOcclusion() == 1. && p->GetSurfaceOffset() == 10.);
  LT_CHECK(suite, p->GetNumberOfExactLights() == 8 && p->GetVisibilityOrder() == 4);
  LT_CHECK(suite, p->GetVisibilityResolution() == 8);
  LT_CHECK(suite, observer->errors.empty());

  p->SetStrength(nan);
  LT_CHECK(suite, p->GetStrength() == 1.);
  LT_CHECK(suite, observer->hasError("Strength is NaN"));
  p->SetShadowMode(3);
  LT_CHECK(suite, p->GetShadowMode() == 1 && observer->hasError("ShadowMode is 3"));
  p->SetShadingModel(-1);
  LT_CHECK(suite, p->GetShadingModel() == 0 && observer->hasError("ShadingModel is -1"));
  p->SetGradientThreshold(-1.);
  LT_CHECK(suite, observer->hasError("GradientThreshold is -1"));
  p->SetGradientThreshold(infinity);
  LT_CHECK(suite, p->GetGradientThreshold() == 0.);
  p->SetEnvironmentStrength(nan);
  LT_CHECK(suite, p->GetEnvironmentStrength() == 0. && observer->errors.size() == 6);

  const vtkMTimeType before = p->GetMTime();
  p->SetAnisotropy(.95);
  LT_CHECK(suite, p->GetMTime() == before);
  p->SetShadowModeToRayTraced();
  p->SetShadingModelToPhysicallyBased();
  p->DeferredOn();
  LT_CHECK(suite, p->GetMTime() > before);
  std::ostringstream text;
  p->Print(text);
  LT_CHECK(suite, text.str().find("ShadowMode: RayTraced") != std::string::npos);
  LT_CHECK(suite, text.str().find("ShadingModel: PhysicallyBased") != std::string::npos);
  return suite.result();
}
