# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""The visibility of a volume from Python: coefficients, window, known lights."""

import math
import sys

import numpy
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
from vtkmodules.vtkCommonCore import VTK_FLOAT

import lighttransport

failures = []


def check(condition, what):
    if not condition:
        failures.append(what)


image = vtkImageData()
image.SetDimensions(12, 10, 9)
image.AllocateScalars(VTK_FLOAT, 1)
image.GetPointData().GetScalars().Fill(1.0)
opacity = vtkPiecewiseFunction()
opacity.AddPoint(0, 0)
opacity.AddPoint(1, 0.2)

visibility = lighttransport.vtkVisibilityFactorFilter()
visibility.SetInputData(image)
visibility.SetScalarOpacity(opacity)
visibility.SetOrder(2)
visibility.AmbientOcclusionOn()
light = visibility.AddDirectionalLight(0, 0, 2)
visibility.Update()
arrays = visibility.GetOutput().GetPointData()
sh = vtk_to_numpy(arrays.GetArray("VisibilitySH")).reshape(9, 10, 12, 9)
v = vtk_to_numpy(arrays.GetArray("Visibility")).reshape(9, 10, 12)
mean = vtk_to_numpy(arrays.GetArray("AmbientOcclusion")).reshape(9, 10, 12)

# Along z: 0.8 per voxel, from the centre to half a voxel beyond the last.
expected = 0.8 ** (8.5 - numpy.arange(9))
check(numpy.abs(v - expected[:, None, None]).max() < 1e-5, "e^-depth along z")
check(numpy.allclose(mean, sh[..., 0] / math.sqrt(4 * math.pi), atol=1e-6), "the mean is band 0")

# Read through the window, brighter towards the nearer side, and in [0, 1].
window = [0.0] * 5
lighttransport.vtkVisibilityFactorFilter.GetWindow(2, window)
check(abs(window[1] - 1 / math.sqrt(3)) < 1e-12 and window[3] == 0, "window")


def read(voxel, direction):
    harmonics = [0.0] * 25
    lighttransport.vtkVisibilityFactorFilter.GetHarmonics(2, direction, harmonics)
    bands = [window[int(math.sqrt(i))] for i in range(9)]
    return sum(k * c * y for k, c, y in zip(bands, sh[voxel], harmonics))


up, down = read((8, 5, 6), (0, 0, 1)), read((8, 5, 6), (0, 0, -1))
check(0 <= down < up <= 1, f"up {up}, down {down}")

visibility.SetLightDirection(light, 0, 0, -1)
visibility.Update()
v = vtk_to_numpy(visibility.GetOutput().GetPointData().GetArray("Visibility")).reshape(9, 10, 12)
check(numpy.abs(v - expected[::-1, None, None]).max() < 1e-5, "the light moved")
check(visibility.GetHarmonicsSeconds() == 0, "the harmonics were kept")

print("\n".join(failures) or "visibility from Python works")
sys.exit(1 if failures else 0)
