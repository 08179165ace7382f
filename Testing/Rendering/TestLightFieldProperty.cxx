// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/** The property's arithmetic, limits and times. No window. */
#include "VolumeMapperScene.h"

#include <limits>
#include <sstream>

using namespace lighttransport::testing;

namespace
{
void testScale(Suite& suite)
{
  vtkNew<vtkLightFieldProperty> p;
  double window[2];
  LT_CHECK(suite, p->GetEffectiveWindow(20., window));
  LT_CHECK_CLOSE(suite, window[1], 20., 1e-12);
  LT_CHECK_CLOSE(suite, window[0], 20e-6, 1e-12);
  for (int k = 0; k <= 6; ++k)
  {
    LT_CHECK_NEAR(suite, p->GetPosition(20. * std::pow(10., -k), window), 1. - k / 6., 1e-12);
    LT_CHECK_NEAR(suite, p->GetPosition(-20. * std::pow(10., -k), window), 1. - k / 6., 1e-12);
  }
  LT_CHECK(suite, p->GetPosition(0., window) == 0.);
  LT_CHECK(suite, p->GetPosition(std::numeric_limits<double>::quiet_NaN(), window) == 0.);
  LT_CHECK(suite, p->GetPosition(1e300, window) == 1.);
  LT_CHECK(suite, p->GetPosition(1e-300, window) == 0.);

  // No light is not a window, whatever the scale.
  LT_CHECK(suite, !p->GetEffectiveWindow(0., window));
  LT_CHECK(suite, window[0] == 0. && window[1] == 0. && p->GetPosition(1., window) == 0.);

  p->SetScaleToLinear();
  LT_CHECK(suite, p->GetEffectiveWindow(20., window));
  LT_CHECK_NEAR(suite, p->GetPosition(5., window), .25, 1e-12);

  p->SetWindow(1., 3.);
  LT_CHECK(suite, !p->GetAutomaticWindow());
  p->GetEffectiveWindow(20., window);
  LT_CHECK_NEAR(suite, p->GetPosition(2., window), .5, 1e-12);
  LT_CHECK(suite, p->GetPosition(.5, window) == 0.);

  // A window from 0 has no logarithm: the decades count from its top.
  p->SetWindow(0., 1.);
  p->SetScaleToLogarithmic();
  p->SetDecades(2.);
  p->GetEffectiveWindow(20., window);
  LT_CHECK_NEAR(suite, p->GetPosition(.1, window), .5, 1e-12);
}

void testColors(Suite& suite)
{
  vtkNew<vtkLightFieldProperty> p;
  double rgba[4];
  double expected[3];
  p->MapValue(7., 7., rgba);
  p->GetPositiveColorMap()->GetColor(1., expected);
  LT_CHECK_NEAR(suite, rgba[0], expected[0], 1e-12);
  LT_CHECK_NEAR(suite, rgba[3], p->GetLightOpacity(), 1e-12);
  p->MapValue(-7e-3, 7., rgba);
  p->GetNegativeColorMap()->GetColor(.5, expected);
  LT_CHECK_NEAR(suite, rgba[2], expected[2], 1e-9);
  p->SetStrength(.5);
  p->MapValue(7., 7., rgba);
  LT_CHECK_NEAR(suite, rgba[3], .5 * p->GetLightOpacity(), 1e-12);
  p->MapValue(0., 7., rgba);
  LT_CHECK(suite, rgba[3] == 0.);

  // Both maps grow in luminance, and stay apart as the colour-blind see them: the
  // blue-yellow axis (b - (r+g)/2) separates them for red-green deficiency.
  double last[2] = { -1., -1. };
  for (double t = 0.; t <= 1.; t += .05)
  {
    double c[2][3];
    p->GetPositiveColorMap()->GetColor(t, c[0]);
    p->GetNegativeColorMap()->GetColor(t, c[1]);
    for (int m = 0; m < 2; ++m)
    {
      const double luminance = .2126 * c[m][0] + .7152 * c[m][1] + .0722 * c[m][2];
      LT_CHECK(suite, luminance > last[m]);
      last[m] = luminance;
    }
    const double warm = c[0][2] - (c[0][0] + c[0][1]) / 2.;
    const double cold = c[1][2] - (c[1][0] + c[1][1]) / 2.;
    LT_CHECK(suite, cold - warm > .25);
  }
}

void testLimits(Suite& suite)
{
  vtkNew<vtkLightFieldProperty> p;
  auto observer = observe(p);
  p->SetStrength(2.);
  LT_CHECK(suite, p->GetStrength() == 1.);
  p->SetStrength(-1.);
  LT_CHECK(suite, p->GetStrength() == 0.);
  LT_CHECK(suite, observer->errors.empty());
  p->SetStrength(std::numeric_limits<double>::quiet_NaN());
  LT_CHECK(suite, p->GetStrength() == 0. && observer->hasError("Strength is NaN"));
  p->SetMode(3);
  LT_CHECK(suite, p->GetMode() == 0 && observer->hasError("Mode is 3"));
  p->SetScale(-1);
  LT_CHECK(suite, p->GetScale() == 0 && observer->hasError("Scale is -1"));
  p->SetWindow(2., 1.);
  LT_CHECK(suite, p->GetAutomaticWindow() && observer->hasError("Window is (2, 1)"));
  p->SetWindow(0., std::numeric_limits<double>::infinity());
  LT_CHECK(suite, p->GetAutomaticWindow() && observer->hasError("Window is (0, inf)"));
  p->SetLightOpacityUnitDistance(-1.);
  LT_CHECK(suite, observer->hasError("LightOpacityUnitDistance is -1"));
  LT_CHECK(suite, observer->errors.size() == 6);

  // Times: the table's only with the functions.
  const vtkMTimeType table = p->GetTableMTime();
  vtkMTimeType before = p->GetMTime();
  p->SetStrength(.3);
  LT_CHECK(suite, p->GetMTime() > before && p->GetTableMTime() == table);
  before = p->GetMTime();
  p->SetStrength(.3);
  LT_CHECK(suite, p->GetMTime() == before);
  p->GetNegativeColorMap()->AddRGBPoint(.5, 1., 0., 1.);
  LT_CHECK(suite, p->GetMTime() > before && p->GetTableMTime() > table);
  p->SetNegativeColorMap(nullptr);
  p->SetPositiveColorMap(nullptr);
  p->SetLightOpacityFunction(nullptr);
  LT_CHECK(suite, p->GetNegativeColorMap() && p->GetPositiveColorMap());
  LT_CHECK(suite, p->GetLightOpacityFunction() != nullptr);
  std::ostringstream text;
  p->Print(text);
  LT_CHECK(suite, text.str().find("Strength: 0.3") != std::string::npos);
}
} // namespace

int main(int argc, char* argv[])
{
  Suite suite(argc, argv);
  testScale(suite);
  testColors(suite);
  testLimits(suite);
  return suite.result();
}
