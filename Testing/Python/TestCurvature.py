# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Curvature and opacity from it, as a Python user calls the filters."""

import math

from lighttransport import (
    vtkCurvatureOpacityFilter,
    vtkCurvatureOpacityFunction,
    vtkSurfaceCurvatureFilter,
    vtkVolumeCurvatureFilter,
    vtkVolumeCurvatureProperty,
)
from vtkmodules.vtkCommonCore import VTK_FLOAT
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction, vtkPolyData
from vtkmodules.vtkFiltersSources import vtkSphereSource

# A ball in an image: the mean curvature is 1 / r.
image = vtkImageData()
image.SetDimensions(24, 24, 24)
image.SetSpacing(0.5, 0.5, 0.5)
image.AllocateScalars(VTK_FLOAT, 1)
scalars = image.GetPointData().GetScalars()
for n in range(image.GetNumberOfPoints()):
    scalars.SetValue(n, -math.dist(image.GetPoint(n), (5.8, 5.7, 5.9)))
curvature = vtkVolumeCurvatureFilter()
curvature.SetInputData(image)
curvature.ComputeGaussianCurvatureOff()
curvature.Update()
output = curvature.GetOutput()
at = output.FindPoint(9.5, 5.5, 6.0)
mean = output.GetPointData().GetArray("MeanCurvature").GetValue(at)
assert abs(mean * math.dist(output.GetPoint(at), (5.8, 5.7, 5.9)) - 1) < 0.02, mean
assert not output.GetPointData().HasArray("GaussianCurvature")

opacity = vtkCurvatureOpacityFilter()
opacity.SetInputConnection(curvature.GetOutputPort())
opacity.SetCurvatureScale(2.0)
opacity.GetOpacityFunction().SetKindToCurvatureOnly()
opacity.Update()
value = opacity.GetOutput().GetPointData().GetArray("Opacity").GetValue(at)
kappa = vtkCurvatureOpacityFunction.Kappa(mean, mean, 2.0)
assert kappa < 0, "a bright ball is convex"
assert abs(value - opacity.GetOpacityFunction().Evaluate(kappa, 0.0)) < 1e-6

# A surface: the sphere of VTK, in its own units, to the pixel table.
sphere = vtkSphereSource()
sphere.SetRadius(25.0)
sphere.SetThetaResolution(64)
sphere.SetPhiResolution(64)
surface = vtkSurfaceCurvatureFilter()
surface.SetInputConnection(sphere.GetOutputPort())
opacity.SetInputConnection(surface.GetOutputPort())
opacity.MakeColorsOn()
opacity.SetCurvatureScale(25.0)
opacity.Update()
assert isinstance(opacity.GetOutput(), vtkPolyData)
array = surface.GetOutput().GetPointData().GetArray("MeanCurvature")
worst = max(abs(array.GetValue(n) * 25 - 1) for n in range(array.GetNumberOfTuples()))
assert worst < 0.02, worst
assert opacity.GetOutput().GetPointData().GetScalars().GetName() == "CurvatureOpacityColor"

# The function of a user: a product, then as a table.
function = vtkCurvatureOpacityFunction()
function.SetKindToProduct()
ramp = vtkPiecewiseFunction()
ramp.AddPoint(0, 0.1)
ramp.AddPoint(1, 0.9)
function.SetCurvatureFunction(ramp)
assert function.GetProblem() == ""
table = vtkImageData()
function.ExportTable(table, 17, 3)
assert table.GetDimensions() == (17, 3, 1)
again = vtkCurvatureOpacityFunction()
again.SetKindToTable()
again.SetTableImage(table)
assert abs(again.Evaluate(-0.3, 0.5) - (0.1 + 0.8 * 0.3)) < 1e-6

# What the volume mapper is told; nothing is drawn here.
how = vtkVolumeCurvatureProperty()
assert how.GetOpacityFunction().GetKind() == vtkCurvatureOpacityFunction.CurvatureOnly
time = how.GetMTime()
how.GetOpacityFunction().SetMinimumOpacity(0.2)
assert how.GetMTime() > time
how.SetStrength(2.0)
assert how.GetStrength() == 1.0
