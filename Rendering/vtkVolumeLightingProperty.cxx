// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkVolumeLightingProperty.h"

#include "vtkMath.h"
#include "vtkObjectFactory.h"

#include <algorithm>

vtkStandardNewMacro(vtkVolumeLightingProperty);

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetClamped(
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
void vtkVolumeLightingProperty::SetNonNegative(double& member, double value, const char* name)
{
  if (!(value >= 0.) || !vtkMath::IsFinite(value))
  {
    vtkErrorMacro(<< name << " is " << value << ", expected a finite number >= 0; it stays "
                  << member << ".");
    return;
  }
  if (member != value)
  {
    member = value;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetChoice(
  int& member, int value, int highest, const char* name, const char* expected)
{
  if (value < 0 || value > highest)
  {
    vtkErrorMacro(<< name << " is " << value << ", expected " << expected << "; it stays " << member
                  << ".");
    return;
  }
  if (member != value)
  {
    member = value;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetStrength(double strength)
{
  this->SetClamped(this->Strength, strength, 0., 1., "Strength");
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetShadowMode(int mode)
{
  this->SetChoice(this->ShadowMode, mode, RayTraced, "ShadowMode",
    "NoShadows (0), Precomputed (1) or RayTraced (2)");
}

//------------------------------------------------------------------------------
const char* vtkVolumeLightingProperty::GetShadowModeAsString()
{
  constexpr const char* names[] = { "NoShadows", "Precomputed", "RayTraced" };
  return names[this->ShadowMode];
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetShadowStrength(double strength)
{
  this->SetClamped(this->ShadowStrength, strength, 0., 1., "ShadowStrength");
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetShadingModel(int model)
{
  this->SetChoice(this->ShadingModel, model, PhysicallyBased, "ShadingModel",
    "BlinnPhong (0) or PhysicallyBased (1)");
}

//------------------------------------------------------------------------------
const char* vtkVolumeLightingProperty::GetShadingModelAsString()
{
  return this->ShadingModel == BlinnPhong ? "BlinnPhong" : "PhysicallyBased";
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetRoughness(double roughness)
{
  this->SetClamped(this->Roughness, roughness, 0., 1., "Roughness");
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetMetallic(double metallic)
{
  this->SetClamped(this->Metallic, metallic, 0., 1., "Metallic");
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetAnisotropy(double g)
{
  this->SetClamped(this->Anisotropy, g, -.95, .95, "Anisotropy");
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetGradientThreshold(double threshold)
{
  this->SetNonNegative(this->GradientThreshold, threshold, "GradientThreshold");
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetSurfaceOffset(double voxels)
{
  this->SetClamped(this->SurfaceOffset, voxels, 0., 10., "SurfaceOffset");
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetAmbientOcclusion(double strength)
{
  this->SetClamped(this->AmbientOcclusion, strength, 0., 1., "AmbientOcclusion");
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetEnvironmentStrength(double strength)
{
  this->SetNonNegative(this->EnvironmentStrength, strength, "EnvironmentStrength");
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetNumberOfExactLights(int number)
{
  number = std::min(std::max(number, 0), 8);
  if (this->NumberOfExactLights != number)
  {
    this->NumberOfExactLights = number;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetVisibilityOrder(int order)
{
  order = std::min(std::max(order, 1), 4);
  if (this->VisibilityOrder != order)
  {
    this->VisibilityOrder = order;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::SetVisibilityResolution(int points)
{
  points = std::max(points, 8);
  if (this->VisibilityResolution != points)
  {
    this->VisibilityResolution = points;
    this->Modified();
  }
}

//------------------------------------------------------------------------------
void vtkVolumeLightingProperty::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Strength: " << this->Strength << "\n";
  os << indent << "ShadowMode: " << this->GetShadowModeAsString() << "\n";
  os << indent << "ShadowStrength: " << this->ShadowStrength << "\n";
  os << indent << "ColoredShadows: " << (this->ColoredShadows ? "on" : "off") << "\n";
  os << indent << "ShadingModel: " << this->GetShadingModelAsString() << "\n";
  os << indent << "Roughness: " << this->Roughness << "\n";
  os << indent << "Metallic: " << this->Metallic << "\n";
  os << indent << "Anisotropy: " << this->Anisotropy << "\n";
  os << indent << "GradientThreshold: " << this->GradientThreshold << "\n";
  os << indent << "SurfaceOffset: " << this->SurfaceOffset << "\n";
  os << indent << "AmbientOcclusion: " << this->AmbientOcclusion << "\n";
  os << indent << "EnvironmentStrength: " << this->EnvironmentStrength << "\n";
  os << indent << "Deferred: " << (this->Deferred ? "on" : "off") << "\n";
  os << indent << "NumberOfExactLights: " << this->NumberOfExactLights << "\n";
  os << indent << "VisibilityOrder: " << this->VisibilityOrder << "\n";
  os << indent << "VisibilityResolution: " << this->VisibilityResolution << "\n";
}
