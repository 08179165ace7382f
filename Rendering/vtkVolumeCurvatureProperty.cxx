// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkVolumeCurvatureProperty.h"

#include "vtkCurvatureOpacityFunction.h"

#include "vtkNew.h"
#include "vtkObjectFactory.h"

#include <algorithm>

vtkStandardNewMacro(vtkVolumeCurvatureProperty);
vtkCxxSetObjectMacro(vtkVolumeCurvatureProperty, OpacityFunction, vtkCurvatureOpacityFunction);

//------------------------------------------------------------------------------
vtkVolumeCurvatureProperty::vtkVolumeCurvatureProperty()
{
  vtkNew<vtkCurvatureOpacityFunction> function;
  this->SetOpacityFunction(function);
}

//------------------------------------------------------------------------------
vtkVolumeCurvatureProperty::~vtkVolumeCurvatureProperty()
{
  this->SetOpacityFunction(nullptr);
}

//------------------------------------------------------------------------------
void vtkVolumeCurvatureProperty::SetCurvatureScale(double scale)
{
  const double length = scale > 0. && scale <= VTK_DOUBLE_MAX ? scale : 0.;
  if (this->CurvatureScale != length)
  {
    this->CurvatureScale = length;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkVolumeCurvatureProperty::SetStrength(double strength)
{
  const double clamped = strength > 0. ? std::min(strength, 1.) : 0.;
  if (this->Strength != clamped)
  {
    this->Strength = clamped;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
vtkMTimeType vtkVolumeCurvatureProperty::GetMTime()
{
  const vtkMTimeType time = this->Superclass::GetMTime();
  return this->OpacityFunction ? std::max(time, this->OpacityFunction->GetMTime()) : time;
}

//------------------------------------------------------------------------------
void vtkVolumeCurvatureProperty::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "OpacityFunction: " << this->OpacityFunction << "\n";
  os << indent << "CurvatureScale: " << this->CurvatureScale << "\n";
  os << indent << "Strength: " << this->Strength << "\n";
}
