// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkLightTransportVersion
 * @brief   version of the LightTransport module
 *
 * The numbers are those of the CMake project, as in vtkVersion.
 */
#ifndef vtkLightTransportVersion_h
#define vtkLightTransportVersion_h

#include "vtkLightTransportModule.h" // for the export macro
#include "vtkObject.h"

class VTKLIGHTTRANSPORT_EXPORT vtkLightTransportVersion : public vtkObject
{
public:
  static vtkLightTransportVersion* New();
  vtkTypeMacro(vtkLightTransportVersion, vtkObject);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  /** "major.minor.patch" of the library that is loaded. */
  static const char* GetLightTransportVersion();

protected:
  vtkLightTransportVersion() = default;
  ~vtkLightTransportVersion() override = default;

private:
  vtkLightTransportVersion(const vtkLightTransportVersion&) = delete;
  void operator=(const vtkLightTransportVersion&) = delete;
};

#endif
