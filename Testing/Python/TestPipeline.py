# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""From numpy to light and back: the filters in Python, checked against closed forms."""

import sys
import unittest

import numpy
from lighttransport import vtkLightDiffusionFilter, vtkLightSeedFilter, vtkOpticalMediumFilter
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData


def image_of(spacing=(1.0, 1.0, 1.0), **arrays):
    """An image with point arrays from numpy's [z, y, x]; the first is the active one."""
    image = vtkImageData()
    shape = next(iter(arrays.values())).shape
    image.SetDimensions(shape[2], shape[1], shape[0])
    image.SetSpacing(spacing)
    for name, values in arrays.items():
        array = numpy_to_vtk(numpy.ascontiguousarray(values).ravel(), deep=True)
        array.SetName(name)
        image.GetPointData().AddArray(array)
    image.GetPointData().SetActiveScalars(next(iter(arrays)))
    return image


def array_of(image, name):
    values = vtk_to_numpy(image.GetPointData().GetArray(name))
    x, y, z = image.GetDimensions()
    return values.reshape(z, y, x)


class TestPipeline(unittest.TestCase):
    def test_uniform(self):
        """Uniform source, absorption and mirrors all round: phi = q / sigma_a everywhere."""
        shape = (5, 6, 7)
        light = vtkLightDiffusionFilter()
        light.SetBoundary(vtkLightDiffusionFilter.ZeroFlux)
        light.SetInputData(
            image_of(
                DiffusionCoefficient=numpy.full(shape, 0.3, numpy.float32),
                Absorption=numpy.full(shape, 0.25, numpy.float32),
                Source=numpy.full(shape, 2.0, numpy.float32),
            )
        )
        light.Update()
        self.assertEqual(light.GetStopReason(), vtkLightDiffusionFilter.Converged)
        fluence = array_of(light.GetOutput(), "Fluence")
        numpy.testing.assert_allclose(fluence, 8.0, rtol=1e-5)

    def test_ball(self):
        """All stages: the light stays in the ball that the lamp stands in; power is balanced."""
        z, y, x = numpy.mgrid[-12:13, -12:13, -12:13]
        inside = x**2 + y**2 + z**2 < 6**2
        image = image_of(spacing=(0.5, 0.5, 0.5), Grey=numpy.where(inside, 30.0, 100.0))
        medium = vtkOpticalMediumFilter()
        medium.SetInputData(image)
        medium.SetDiffusionMapping(vtkOpticalMediumFilter.FromScalarGradient)
        seeds = vtkLightSeedFilter()
        seeds.SetInputConnection(medium.GetOutputPort())
        seeds.AddSphere((6.0, 6.0, 6.0), 1.0, 3.0)
        light = vtkLightDiffusionFilter()
        light.SetInputConnection(seeds.GetOutputPort())
        light.Update()
        self.assertEqual(light.GetStopReasonAsString(), "Converged")
        self.assertAlmostEqual(light.GetEmittedPower(), 3.0, delta=3e-6)
        balance = light.GetAbsorbedPower() + light.GetEscapedPower() - light.GetEmittedPower()
        self.assertLess(abs(balance), 3e-6)
        output = light.GetOutput()
        for name in ("Grey", "DiffusionCoefficient", "Absorption", "Source", "Fluence"):
            self.assertIsNotNone(output.GetPointData().GetArray(name), name)
        fluence = array_of(output, "Fluence")
        core = fluence[x**2 + y**2 + z**2 < 4**2]
        far = fluence[x**2 + y**2 + z**2 > 9**2]
        self.assertGreater(core.min(), 100 * far.max())
        # a named error chooses, and says what: the field is right where it was
        light.SetTargetError(0.01)
        light.Update()
        self.assertEqual(light.GetStopReasonAsString(), "Converged")
        self.assertTrue(0.0 < light.GetEstimatedError() <= 0.01)
        self.assertTrue(0.0 <= light.GetEstimatedErrorL2() <= 0.1)
        self.assertTrue(0.0 < light.GetActiveFraction() <= 1.0)
        self.assertIn(light.GetUsedCoarseningFactor(), (1, 2))
        rough = array_of(light.GetOutput(), "Fluence")
        seen = fluence > 1e-6 * fluence.max()
        errors = numpy.abs(rough - fluence)[seen] / fluence[seen]
        self.assertLessEqual(numpy.percentile(errors, 95), 0.01)

    def test_strength_of_a_lamp(self):
        """phi is linear in q: twice the power, twice the light; and its negative cancels it."""
        shape = (9, 9, 9)
        image = image_of(
            DiffusionCoefficient=numpy.full(shape, 1.0, numpy.float32),
            Absorption=numpy.full(shape, 0.01, numpy.float32),
        )
        fields = []
        for powers in ((1.0,), (2.0,), (1.0, -1.0)):
            seeds = vtkLightSeedFilter()
            seeds.SetInputData(image)
            for power in powers:
                seeds.AddSphere((4.0, 4.0, 4.0), 1.5, power)
            light = vtkLightDiffusionFilter()
            light.SetInputConnection(seeds.GetOutputPort())
            light.Update()
            fields.append(array_of(light.GetOutput(), "Fluence").copy())
        numpy.testing.assert_allclose(fields[1], 2 * fields[0], rtol=1e-5)
        self.assertEqual(numpy.abs(fields[2]).max(), 0.0)


if __name__ == "__main__":
    # The build's options (-T, -B, -D) are not unittest's.
    unittest.main(argv=sys.argv[:1])
