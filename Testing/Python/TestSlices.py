# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""The slices from Python: by connections, in a plain window, without a display."""

import sys
import unittest

from lighttransport import vtkLightFieldSlices, vtkLightTransportEGLRenderWindow
from vtkmodules.vtkCommonCore import vtkFloatArray, vtkUnsignedCharArray
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer
from vtkmodules.vtkRenderingCore import vtkRenderWindow


def image(name, function):
    data = vtkImageData()
    data.SetDimensions(16, 16, 16)
    data.SetOrigin(-7.5, -7.5, -7.5)
    array = vtkFloatArray()
    array.SetName(name)
    array.SetNumberOfTuples(data.GetNumberOfPoints())
    for i in range(data.GetNumberOfPoints()):
        array.SetValue(i, function(*data.GetPoint(i)))
    data.GetPointData().SetScalars(array)
    producer = vtkTrivialProducer()
    producer.SetOutput(data)
    return producer


class TestSlices(unittest.TestCase):
    def test_render(self):
        if not vtkLightTransportEGLRenderWindow.IsAvailable():
            self.skipTest("no EGL here")
        anatomy = image("Grey", lambda x, y, z: 1.0 if abs(z) < 7 else 0.0)
        light = image(
            "Fluence", lambda x, y, z: 1.0 / (0.1 + (x - 4.5) ** 2 + (y + 3.5) ** 2 + z * z)
        )
        slices = vtkLightFieldSlices()
        slices.SetInputConnection(anatomy.GetOutputPort())
        slices.SetLightFieldConnection(light.GetOutputPort())
        slices.SetPatientAxes(vtkLightFieldSlices.RAS)
        slices.GetLightFieldProperty().SetDecades(2)
        window = vtkRenderWindow()
        window.SetSize(200, 200)
        slices.AddToRenderWindow(window)
        window.Render()
        self.assertEqual(slices.GetNumberOfBuilds(), 1)
        self.assertEqual(slices.GetMarks(vtkLightFieldSlices.Axial), "RLPA")
        self.assertEqual(slices.GetPosition()[:2], (4.5, -3.5))

        # The strongest colour is where the light is: right, posterior.
        pixels = vtkUnsignedCharArray()
        window.GetPixelData(0, 0, 199, 199, 1, pixels, 0)
        viewport = slices.GetSliceRenderer(vtkLightFieldSlices.Axial).GetViewport()
        world = [0.0, 0.0, 0.0]
        best = (-1.0, None)
        for y in range(int(200 * viewport[1]), int(200 * viewport[3])):
            for x in range(int(200 * viewport[0]), int(200 * viewport[2])):
                r, _, b = pixels.GetTuple3(200 * y + x)
                if slices.DisplayToWorld(x, y, world) and r - b > best[0]:
                    best = (r - b, tuple(world))
        self.assertGreater(best[0], 60)
        self.assertLess((best[1][0] - 4.5) ** 2 + (best[1][1] + 3.5) ** 2, 3.0**2)

        window.Render()
        self.assertEqual(slices.GetNumberOfBuilds(), 1)
        slices.SetConvention(vtkLightFieldSlices.Neurological)
        window.Render()
        self.assertEqual(slices.GetNumberOfBuilds(), 2)
        self.assertEqual(slices.GetMarks(0), "LRPA")


if __name__ == "__main__":
    # The build's options (-T, -B, -D) are not unittest's.
    unittest.main(argv=sys.argv[:1])
