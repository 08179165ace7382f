// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightFieldProperty.h"

#include "vtkColorTransferFunction.h"
#include "vtkMath.h"
#include "vtkObjectFactory.h"
#include "vtkPiecewiseFunction.h"

#include <algorithm>
#include <cmath>

vtkStandardNewMacro(vtkLightFieldProperty);

namespace
{
struct Stop
{
  double t, r, g, b;
};

template <std::size_t N>
vtkSmartPointer<vtkColorTransferFunction> makeColors(const Stop (&stops)[N])
{
  auto map = vtkSmartPointer<vtkColorTransferFunction>::New();
  for (const Stop& stop : stops)
  {
    map->AddRGBPoint(stop.t, stop.r, stop.g, stop.b);
  }
  return map;
}

// Brightness grows along both; orange against blue is kept apart in every
// common colour deficiency.
constexpr Stop Warm[] = { { 0., .38, .14, .02 }, { .35, .75, .29, .02 }, { .7, .99, .60, .12 },
  { 1., 1., .95, .68 } };
constexpr Stop Cold[] = { { 0., .03, .12, .42 }, { .35, .06, .35, .71 }, { .7, .26, .68, .92 },
  { 1., .80, .98, 1. } };

vtkSmartPointer<vtkPiecewiseFunction> makeOpacity()
{
  auto function = vtkSmartPointer<vtkPiecewiseFunction>::New();
  function->AddPoint(0., 0.);
  function->AddPoint(.1, 0.);
  function->AddPoint(.4, .12);
  function->AddPoint(.7, .5);
  function->AddPoint(1., 1.);
  return function;
}
} // namespace

//------------------------------------------------------------------------------
vtkLightFieldProperty::vtkLightFieldProperty()
  : PositiveColorMap(makeColors(Warm))
  , NegativeColorMap(makeColors(Cold))
  , LightOpacityFunction(makeOpacity())
{
}

//------------------------------------------------------------------------------
vtkLightFieldProperty::~vtkLightFieldProperty() = default;

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetMode(int mode)
{
  if (mode < Overlay || mode > FluxDirection)
  {
    vtkErrorMacro("Mode is " << mode << ", expected Overlay (0), Illuminate (1) or "
                             << "FluxDirection (2); it stays " << this->GetModeAsString() << ".");
    return;
  }
  if (this->Mode != mode)
  {
    this->Mode = mode;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
const char* vtkLightFieldProperty::GetModeAsString()
{
  constexpr const char* names[] = { "Overlay", "Illuminate", "FluxDirection" };
  return names[this->Mode];
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetScale(int scale)
{
  if (scale != Logarithmic && scale != Linear)
  {
    vtkErrorMacro("Scale is " << scale << ", expected Logarithmic (0) or Linear (1); it stays "
                              << this->GetScaleAsString() << ".");
    return;
  }
  if (this->Scale != scale)
  {
    this->Scale = scale;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
const char* vtkLightFieldProperty::GetScaleAsString()
{
  return this->Scale == Linear ? "Linear" : "Logarithmic";
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetClamped(
  double& member, double value, double lo, double hi, const char* name)
{
  if (vtkMath::IsNan(value))
  {
    vtkErrorMacro(<< name << " is NaN, expected a number in [" << lo << ", " << hi << "]; it stays "
                  << member << ".");
    return;
  }
  value = std::min(std::max(value, lo), hi);
  if (member != value)
  {
    member = value;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetStrength(double strength)
{
  this->SetClamped(this->Strength, strength, 0., 1., "Strength");
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetDecades(double decades)
{
  this->SetClamped(this->Decades, decades, .1, 30., "Decades");
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetLightOpacity(double opacity)
{
  this->SetClamped(this->LightOpacity, opacity, 0., 1., "LightOpacity");
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetTissueOpacity(double factor)
{
  this->SetClamped(this->TissueOpacity, factor, 0., 1., "TissueOpacity");
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetLightOpacityUnitDistance(double distance)
{
  if (!(distance >= 0.) || !vtkMath::IsFinite(distance))
  {
    vtkErrorMacro("LightOpacityUnitDistance is "
      << distance << ", expected a length >= 0; it stays " << this->LightOpacityUnitDistance
      << ".");
    return;
  }
  if (this->LightOpacityUnitDistance != distance)
  {
    this->LightOpacityUnitDistance = distance;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetWindow(double lo, double hi)
{
  if (!(lo >= 0.) || !(lo < hi) || !vtkMath::IsFinite(hi))
  {
    vtkErrorMacro("Window is (" << lo << ", " << hi << "), expected 0 <= lo < hi; it stays ("
                                << this->Window[0] << ", " << this->Window[1] << ").");
    return;
  }
  if (this->Window[0] != lo || this->Window[1] != hi || this->AutomaticWindow)
  {
    this->Window[0] = lo;
    this->Window[1] = hi;
    this->AutomaticWindow = false;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetPositiveColorMap(vtkColorTransferFunction* map)
{
  if (this->PositiveColorMap != map)
  {
    this->PositiveColorMap = map ? map : makeColors(Warm).Get();
    this->ExchangeTime.Modified();
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetNegativeColorMap(vtkColorTransferFunction* map)
{
  if (this->NegativeColorMap != map)
  {
    this->NegativeColorMap = map ? map : makeColors(Cold).Get();
    this->ExchangeTime.Modified();
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::SetLightOpacityFunction(vtkPiecewiseFunction* function)
{
  if (this->LightOpacityFunction != function)
  {
    this->LightOpacityFunction = function ? function : makeOpacity().Get();
    this->ExchangeTime.Modified();
    this->Modified();
  }
}

//------------------------------------------------------------------------------
vtkColorTransferFunction* vtkLightFieldProperty::GetPositiveColorMap()
{
  return this->PositiveColorMap;
}

//------------------------------------------------------------------------------
vtkColorTransferFunction* vtkLightFieldProperty::GetNegativeColorMap()
{
  return this->NegativeColorMap;
}

//------------------------------------------------------------------------------
vtkPiecewiseFunction* vtkLightFieldProperty::GetLightOpacityFunction()
{
  return this->LightOpacityFunction;
}

//------------------------------------------------------------------------------
bool vtkLightFieldProperty::GetEffectiveWindow(double maximum, double window[2])
{
  const bool log = this->Scale == Logarithmic;
  const double range = std::pow(10., -this->Decades);
  double lo = this->Window[0];
  double hi = this->Window[1];
  if (this->AutomaticWindow)
  {
    if (!(maximum > 0.) || !vtkMath::IsFinite(maximum))
    {
      window[0] = window[1] = 0.;
      return false;
    }
    hi = maximum;
    lo = log ? hi * range : 0.;
  }
  if (log && !(lo > 0.))
  {
    lo = hi * range;
  }
  window[0] = lo;
  window[1] = hi;
  return true;
}

//------------------------------------------------------------------------------
double vtkLightFieldProperty::GetPosition(double phi, const double window[2])
{
  const double magnitude = std::abs(phi);
  if (!(magnitude > 0.) || !(window[1] > window[0]))
  {
    return 0.;
  }
  // Logarithms of each, not of the quotient, which may overflow.
  const double t = this->Scale == Linear
    ? (magnitude - window[0]) / (window[1] - window[0])
    : (std::log(magnitude) - std::log(window[0])) / (std::log(window[1]) - std::log(window[0]));
  return std::min(std::max(t, 0.), 1.);
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::MapValue(double phi, double maximum, double rgba[4])
{
  double window[2];
  this->GetEffectiveWindow(maximum, window);
  const double t = this->GetPosition(phi, window);
  (phi < 0. ? this->NegativeColorMap : this->PositiveColorMap)->GetColor(t, rgba);
  rgba[3] =
    t > 0. ? this->Strength * this->LightOpacity * this->LightOpacityFunction->GetValue(t) : 0.;
}

//------------------------------------------------------------------------------
vtkMTimeType vtkLightFieldProperty::GetTableMTime()
{
  return std::max({ this->ExchangeTime.GetMTime(), this->PositiveColorMap->GetMTime(),
    this->NegativeColorMap->GetMTime(), this->LightOpacityFunction->GetMTime() });
}

//------------------------------------------------------------------------------
vtkMTimeType vtkLightFieldProperty::GetMTime()
{
  return std::max(this->Superclass::GetMTime(), this->GetTableMTime());
}

//------------------------------------------------------------------------------
void vtkLightFieldProperty::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Mode: " << this->GetModeAsString() << "\n";
  os << indent << "Strength: " << this->Strength << "\n";
  os << indent << "Scale: " << this->GetScaleAsString() << "\n";
  os << indent << "Decades: " << this->Decades << "\n";
  os << indent << "AutomaticWindow: " << this->AutomaticWindow << "\n";
  os << indent << "Window: " << this->Window[0] << " " << this->Window[1] << "\n";
  os << indent << "LightOpacity: " << this->LightOpacity << "\n";
  os << indent << "LightOpacityUnitDistance: " << this->LightOpacityUnitDistance << "\n";
  os << indent << "TissueOpacity: " << this->TissueOpacity << "\n";
  os << indent << "PositiveColorMap: " << this->PositiveColorMap.Get() << "\n";
  os << indent << "NegativeColorMap: " << this->NegativeColorMap.Get() << "\n";
  os << indent << "LightOpacityFunction: " << this->LightOpacityFunction.Get() << "\n";
}
