// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkCurvatureOpacityProperty.h"

#include "vtkColorTransferFunction.h"
#include "vtkCurvatureOpacityFunction.h"
#include "vtkObjectFactory.h"
#include "vtkPiecewiseFunction.h"

#include <algorithm>

vtkStandardNewMacro(vtkCurvatureOpacityProperty);

//------------------------------------------------------------------------------
vtkCurvatureOpacityProperty::vtkCurvatureOpacityProperty()
{
  this->SetShadingFunction(nullptr);
  this->SetOpacityFunction(nullptr);
}

//------------------------------------------------------------------------------
vtkCurvatureOpacityProperty::~vtkCurvatureOpacityProperty() = default;

//------------------------------------------------------------------------------
void vtkCurvatureOpacityProperty::SetShadingFunction(vtkPiecewiseFunction* function)
{
  if (function && function == this->ShadingFunction)
  {
    return;
  }
  this->ShadingFunction = function;
  if (!function)
  {
    this->ShadingFunction = vtkSmartPointer<vtkPiecewiseFunction>::New();
    this->ShadingFunction->AddPoint(-1., 1.5);
    this->ShadingFunction->AddPoint(0., 1.);
    this->ShadingFunction->AddPoint(1., .25);
  }
  this->Modified();
}

//------------------------------------------------------------------------------
vtkPiecewiseFunction* vtkCurvatureOpacityProperty::GetShadingFunction()
{
  return this->ShadingFunction;
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityProperty::SetShadingColors(vtkColorTransferFunction* colors)
{
  if (colors != this->ShadingColors)
  {
    this->ShadingColors = colors;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
vtkColorTransferFunction* vtkCurvatureOpacityProperty::GetShadingColors()
{
  return this->ShadingColors;
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityProperty::SetOpacityFunction(vtkCurvatureOpacityFunction* function)
{
  if (function && function == this->OpacityFunction)
  {
    return;
  }
  this->OpacityFunction = function;
  if (!function)
  {
    this->OpacityFunction = vtkSmartPointer<vtkCurvatureOpacityFunction>::New();
  }
  this->Modified();
}

//------------------------------------------------------------------------------
vtkCurvatureOpacityFunction* vtkCurvatureOpacityProperty::GetOpacityFunction()
{
  return this->OpacityFunction;
}

//------------------------------------------------------------------------------
bool vtkCurvatureOpacityProperty::HasEffect()
{
  return this->CurvatureShading || this->CurvatureOpacity || this->RadianceScaling > 0. ||
    this->HasLines();
}

//------------------------------------------------------------------------------
bool vtkCurvatureOpacityProperty::HasLines()
{
  return this->OccludingContours || this->SuggestiveContours || this->RidgesAndValleys ||
    this->DemarcatingCurves;
}

//------------------------------------------------------------------------------
std::array<float, 16> vtkCurvatureOpacityProperty::GetParameters()
{
  const auto width = [this](bool on) { return on ? static_cast<float>(this->LineWidth) : 0.F; };
  return { this->CurvatureShading ? 1.F : 0.F, this->CurvatureOpacity ? 1.F : 0.F,
    static_cast<float>(this->RadianceScaling), static_cast<float>(this->LineThreshold),
    width(this->OccludingContours), width(this->SuggestiveContours), width(this->RidgesAndValleys),
    width(this->DemarcatingCurves), static_cast<float>(this->LineColor[0]),
    static_cast<float>(this->LineColor[1]), static_cast<float>(this->LineColor[2]),
    static_cast<float>(this->LineOpacity) };
}

//------------------------------------------------------------------------------
vtkMTimeType vtkCurvatureOpacityProperty::GetMTime()
{
  vtkMTimeType time = this->Superclass::GetMTime();
  for (vtkObject* object :
    { static_cast<vtkObject*>(this->ShadingFunction), static_cast<vtkObject*>(this->ShadingColors),
      static_cast<vtkObject*>(this->OpacityFunction) })
  {
    time = object ? std::max(time, object->GetMTime()) : time;
  }
  return time;
}

//------------------------------------------------------------------------------
void vtkCurvatureOpacityProperty::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "CurvatureShading: " << this->CurvatureShading << "\n";
  os << indent << "ShadingFunction: " << this->ShadingFunction.Get() << "\n";
  os << indent << "ShadingColors: " << this->ShadingColors.Get() << "\n";
  os << indent << "CurvatureOpacity: " << this->CurvatureOpacity << "\n";
  os << indent << "OpacityFunction: " << this->OpacityFunction.Get() << "\n";
  os << indent << "RadianceScaling: " << this->RadianceScaling << "\n";
  os << indent << "OccludingContours: " << this->OccludingContours << "\n";
  os << indent << "SuggestiveContours: " << this->SuggestiveContours << "\n";
  os << indent << "RidgesAndValleys: " << this->RidgesAndValleys << "\n";
  os << indent << "DemarcatingCurves: " << this->DemarcatingCurves << "\n";
  os << indent << "LineWidth: " << this->LineWidth << "\n";
  os << indent << "LineColor: " << this->LineColor[0] << " " << this->LineColor[1] << " "
     << this->LineColor[2] << "\n";
  os << indent << "LineOpacity: " << this->LineOpacity << "\n";
  os << indent << "LineThreshold: " << this->LineThreshold << "\n";
}
