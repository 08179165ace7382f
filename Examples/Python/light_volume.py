#!/usr/bin/python3
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Lights a seed in a volume: light_volume.py [VOLUME.vti [X Y Z]] [PICTURE.png]

Without a volume, VTK's test source. Headless machines need nothing more.
"""

import sys

import lighttransport as lt  # first: it decides how windows are made
from vtkmodules.vtkImagingCore import vtkRTAnalyticSource
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkIOXML import vtkXMLImageDataReader
from vtkmodules.vtkRenderingCore import vtkRenderWindow, vtkWindowToImageFilter
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 (registers VTK's OpenGL)

arguments = sys.argv[1:]
picture = arguments.pop() if arguments and arguments[-1].endswith(".png") else None
if arguments:
    volume = vtkXMLImageDataReader()
    volume.SetFileName(arguments[0])
else:
    volume = vtkRTAnalyticSource()
volume.Update()
seed = [float(a) for a in arguments[1:4]] or volume.GetOutput().GetCenter()

medium = lt.vtkOpticalMediumFilter()  # edges stop light; the noise tells which are edges
medium.SetInputConnection(volume.GetOutputPort())
medium.SetScalePoint(*seed)
lamp = lt.vtkLightSeedFilter()
lamp.SetInputConnection(medium.GetOutputPort())
lamp.AddSphere(*seed, 2.0, 1.0)  # x, y, z, radius, power
light = lt.vtkLightDiffusionFilter()
light.SetInputConnection(lamp.GetOutputPort())
light.Update()
print(light.GetStopReasonAsString(), light.GetResidual(), light.GetAbsorbedPower())

if picture:
    slices = lt.vtkLightFieldSlices()
    slices.SetInputConnection(volume.GetOutputPort())
    slices.SetLightFieldConnection(light.GetOutputPort())
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(640, 512)
    slices.AddToRenderWindow(window)
    window.Render()
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    writer = vtkPNGWriter()
    writer.SetInputConnection(grab.GetOutputPort())
    writer.SetFileName(picture)
    writer.Write()
