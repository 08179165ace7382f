// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightTransportVersion.h"

#include "vtkObjectFactory.h"

vtkStandardNewMacro(vtkLightTransportVersion);

//------------------------------------------------------------------------------
const char* vtkLightTransportVersion::GetLightTransportVersion()
{
  return LIGHTTRANSPORT_VERSION;
}

//------------------------------------------------------------------------------
void vtkLightTransportVersion::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "Version: " << LIGHTTRANSPORT_VERSION << "\n";
}
