// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightDiffusionFilter.h"
#include "vtkLightFieldProperty.h"
#include "vtkLightTransportArrays.h"
#include "vtkLightTransportVersion.h"

#include "vtkNew.h"

#include <iostream>

int main()
{
  vtkNew<vtkLightDiffusionFilter> filter;
  vtkNew<vtkLightFieldProperty> property;
  std::cout << vtkLightTransportVersion::GetLightTransportVersion() << " " << filter->GetClassName()
            << " " << property->GetClassName() << " writes " << vtkLightTransportArrays::Fluence
            << "\n";
  return 0;
}
