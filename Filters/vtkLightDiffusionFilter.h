// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef vtkLightDiffusionFilter_h
#define vtkLightDiffusionFilter_h

#include "vtkImageAlgorithm.h"
#include "vtkLightTransportFiltersModule.h" // for the export macro

class VTKLIGHTTRANSPORTFILTERS_EXPORT vtkLightDiffusionFilter : public vtkImageAlgorithm
{
public:
  static vtkLightDiffusionFilter* New();
  vtkTypeMacro(vtkLightDiffusionFilter, vtkImageAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

protected:
  vtkLightDiffusionFilter() = default;
  ~vtkLightDiffusionFilter() override = default;

private:
  vtkLightDiffusionFilter(const vtkLightDiffusionFilter&) = delete;
  void operator=(const vtkLightDiffusionFilter&) = delete;
};

#endif
