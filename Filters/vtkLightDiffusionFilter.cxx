// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkLightDiffusionFilter.h"

#include "Core/Diffusion.h"

#include "vtkObjectFactory.h"

vtkStandardNewMacro(vtkLightDiffusionFilter);

//------------------------------------------------------------------------------
void vtkLightDiffusionFilter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
}
