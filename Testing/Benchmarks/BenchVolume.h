// SPDX-FileCopyrightText: The LightTransport authors
// SPDX-License-Identifier: BSD-3-Clause
#ifndef BenchVolume_h
#define BenchVolume_h

#include "vtkImageData.h"
#include "vtkSmartPointer.h"

#include <cmath>

/** What the frame benchmarks draw: a soft ball with waves in it, on [-1,1]^3; grey 0..255. */
inline vtkSmartPointer<vtkImageData> makeVolume(int n)
{
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(n, n, n);
  image->SetOrigin(-1., -1., -1.);
  image->SetSpacing(2. / (n - 1), 2. / (n - 1), 2. / (n - 1));
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  auto* grey = static_cast<unsigned char*>(image->GetScalarPointer());
  for (vtkIdType i = 0; i < image->GetNumberOfPoints(); ++i)
  {
    double p[3];
    image->GetPoint(i, p);
    const double r = std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    grey[i] = static_cast<unsigned char>(
      r > .9 ? 0. : 120. + 100. * std::sin(12. * p[0]) * std::sin(9. * p[1]) * r);
  }
  return image;
}

#endif
