// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef vtkLightFieldProperty_h
#define vtkLightFieldProperty_h

#include "vtkLightTransportRenderingModule.h" // for the export macro
#include "vtkObject.h"

class VTKLIGHTTRANSPORTRENDERING_EXPORT vtkLightFieldProperty : public vtkObject
{
public:
  static vtkLightFieldProperty* New();
  vtkTypeMacro(vtkLightFieldProperty, vtkObject);
  void PrintSelf(ostream& os, vtkIndent indent) override;

protected:
  vtkLightFieldProperty() = default;
  ~vtkLightFieldProperty() override = default;

private:
  vtkLightFieldProperty(const vtkLightFieldProperty&) = delete;
  void operator=(const vtkLightFieldProperty&) = delete;
};

#endif
