# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""The medium and seed filters as a Python user calls them."""

import math

from lighttransport import vtkLightSeedFilter, vtkOpticalMediumFilter
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR

image = vtkImageData()
image.SetDimensions(16, 12, 10)
image.SetSpacing(0.5, 1.0, 2.0)
image.AllocateScalars(VTK_UNSIGNED_CHAR, 1)
scalars = image.GetPointData().GetScalars()
for n in range(image.GetNumberOfPoints()):
    scalars.SetValue(n, 10 * (n % 16))

medium = vtkOpticalMediumFilter()
medium.SetInputData(image)
assert medium.GetDiffusionMapping() == vtkOpticalMediumFilter.FromScalarGradient
medium.SetGradientScale(20.0)
medium.SetScalePoint((1.0, 2.0, 3.0))
assert medium.GetHasScalePoint() and medium.GetScalePoint() == (1.0, 2.0, 3.0)
medium.ClearScalePoint()
medium.Update()
D = medium.GetOutput().GetPointData().GetArray("DiffusionCoefficient")
# A slope of 20 with sigma 20, ell the smallest spacing.
assert abs(D.GetValue(100) - 0.5 * math.exp(-1)) < 1e-6, D.GetValue(100)

opacity = vtkPiecewiseFunction()
opacity.AddPoint(0, 0)
opacity.AddPoint(150, 1)
medium.SetDiffusionMapping(vtkOpticalMediumFilter.FromTransferFunction)
medium.SetDiffusionFunction(opacity)
medium.SetAbsorptionMapping(vtkOpticalMediumFilter.FromAlbedo)
medium.SetAlbedo(1.0)
medium.SetReach(10.0)
medium.AddNoDataValue(0)
medium.Update()
D = medium.GetOutput().GetPointData().GetArray("DiffusionCoefficient")
sigma_a = medium.GetOutput().GetPointData().GetArray("Absorption")
assert D.GetValue(0) == 0 and sigma_a.GetValue(0) == 2
assert abs(D.GetValue(15) - 0.5) < 1e-6 and abs(sigma_a.GetValue(15) - 0.005) < 1e-8

seeds = vtkLightSeedFilter()
seeds.SetInputConnection(medium.GetOutputPort())
assert seeds.AddSphere((4.0, 5.0, 6.0), 2.0, 3.0) == 0
assert seeds.AddSphere(2.0, 5.0, 6.0, 0.0, -1.0) == 1
seeds.Update()
assert abs(seeds.GetTotalPower() - 2.0) < 1e-6
center = [0.0, 0.0, 0.0]
seeds.GetSphereCenter(0, center)
assert center == [4.0, 5.0, 6.0]
seeds.SetSphere(1, (2.0, 5.0, 6.0), 0.0, 1.0)
painted = vtkImageData()
painted.DeepCopy(seeds.GetOutput())
seeds.SetPaintedImageData(painted)
seeds.Update()
assert abs(seeds.GetTotalPower() - 6.0) < 1e-6, seeds.GetTotalPower()
print(medium, seeds)
