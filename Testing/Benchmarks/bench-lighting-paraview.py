# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""VTK 9.2's own secondary rays (ParaView 5.11) on the scene of bench-lighting.

    pvpython bench-lighting-paraview.py VOLUME.vti PIXELS FRAMES PICTURE.png

Draws what bench-lighting draws: prints the milliseconds of a shaded frame and of one with
GlobalIlluminationReach 1, medians. VolumetricScatteringBlending 1 is the secondary rays alone.
"""

import sys
import time

from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkIOXML import vtkXMLImageDataReader
from vtkmodules.vtkRenderingCore import (
    vtkColorTransferFunction,
    vtkLight,
    vtkRenderer,
    vtkRenderWindow,
    vtkVolume,
    vtkVolumeProperty,
    vtkWindowToImageFilter,
)
from vtkmodules.vtkRenderingVolumeOpenGL2 import vtkOpenGLGPUVolumeRayCastMapper
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401

LIGHTS = [
    ((-1.0, 0.5, 1.0), (1.0, 0.9, 0.8)),
    ((1.0, 1.0, 0.2), (0.5, 0.6, 1.0)),
    ((0.0, -1.0, 0.5), (0.6, 0.6, 0.6)),
]

reader = vtkXMLImageDataReader()
reader.SetFileName(sys.argv[1])
reader.Update()
pixels, frames, picture = int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]

mapper = vtkOpenGLGPUVolumeRayCastMapper()
mapper.SetInputConnection(reader.GetOutputPort())
mapper.AutoAdjustSampleDistancesOff()
mapper.SetSampleDistance(reader.GetOutput().GetSpacing()[0])
color = vtkColorTransferFunction()
color.AddRGBPoint(0, 0, 0, 0)
color.AddRGBPoint(255, 1, 0.9, 0.8)
opacity = vtkPiecewiseFunction()
opacity.AddPoint(0, 0)
opacity.AddPoint(255, 0.15)
volume_property = vtkVolumeProperty()
volume_property.SetColor(color)
volume_property.SetScalarOpacity(opacity)
volume_property.SetScalarOpacityUnitDistance(0.1)
volume_property.SetInterpolationTypeToLinear()
volume_property.ShadeOn()
volume_property.SetAmbient(0)
volume_property.SetDiffuse(1)
volume_property.SetSpecular(0)
volume = vtkVolume()
volume.SetMapper(mapper)
volume.SetProperty(volume_property)
renderer = vtkRenderer()
renderer.AddVolume(volume)
for position, rgb in LIGHTS:
    light = vtkLight()
    light.SetLightTypeToSceneLight()
    light.SetPosition(*position)
    light.SetFocalPoint(0, 0, 0)
    light.SetColor(*rgb)
    light.SetIntensity(0.6)
    renderer.AddLight(light)
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetMultiSamples(0)
window.SetSize(pixels, pixels)
window.AddRenderer(renderer)
camera = renderer.GetActiveCamera()
renderer.ResetCamera()
camera.Azimuth(30)
camera.Elevation(20)
camera.Zoom(1.6)
renderer.ResetCameraClippingRange()


def median():
    times = []
    for _ in range(frames + 1):
        begin = time.perf_counter()
        window.Render()
        window.GetPixelData(0, 0, 0, 0, 1, vtkUnsignedCharArray(), 0)
        times.append(1000 * (time.perf_counter() - begin))
    return sorted(times[1:])[(len(times) - 1) // 2]  # the first builds the shader


shaded = median()
mapper.SetGlobalIlluminationReach(1)
mapper.SetVolumetricScatteringBlending(1)
print(f"{shaded:.0f} {median():.0f}")
grab = vtkWindowToImageFilter()
grab.SetInput(window)
grab.ReadFrontBufferOff()
writer = vtkPNGWriter()
writer.SetInputConnection(grab.GetOutputPort())
writer.SetFileName(picture)
writer.Write()
