// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightFieldProperty.h"

#include "vtkObjectFactory.h"

vtkStandardNewMacro(vtkLightFieldProperty);

//------------------------------------------------------------------------------
void vtkLightFieldProperty::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
}
