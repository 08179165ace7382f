# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws the figures of Module/Documentation/curvature.md:

PYTHONPATH=build/dev/lib/python3/dist-packages /usr/bin/python3 Testing/Benchmarks/bench-curvature.py

from the engine and the turbine blade of ../shared/data; without them those alone that need no data.
"""

import os
import sys
import time

import lighttransport as lt
import numpy
from vtkmodules import vtkRenderingOpenGL2, vtkRenderingVolumeOpenGL2  # noqa: F401
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkImagingCore import vtkImageResample
from vtkmodules.vtkIOImage import vtkNIFTIImageReader, vtkPNGWriter
from vtkmodules.vtkIOPLY import vtkPLYReader
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkColorTransferFunction,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkVolume,
    vtkVolumeProperty,
    vtkWindowToImageFilter,
)

root = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
folder = os.path.join(root, "Module", "Documentation", "figures")
data = os.path.join(root, "..", "shared", "data")
SIZE = 280
Function = lt.vtkCurvatureOpacityFunction


def write(image, name):
    writer = vtkPNGWriter()
    writer.SetFileName(os.path.join(folder, name + ".png"))
    writer.SetInputData(image)
    writer.Write()
    print(os.path.relpath(writer.GetFileName()), os.path.getsize(writer.GetFileName()), "bytes")


def functions():
    """The four presets side by side: |kappa| to the right, depth upwards."""
    side, gap = 64, 8
    picture = vtkImageData()
    picture.SetDimensions(4 * side + 3 * gap, side, 1)
    picture.AllocateScalars(VTK_UNSIGNED_CHAR, 3)
    pixels = picture.GetPointData().GetScalars()
    pixels.Fill(255)
    function = Function()
    for kind in range(4):
        function.SetKind(kind)
        for j in range(side):
            for i in range(side):
                grey = round(255 * function.Evaluate(i / (side - 1), j / (side - 1)))
                pixels.SetTuple3(
                    kind * (side + gap) + i + j * (4 * side + 3 * gap), grey, grey, grey
                )
    write(picture, "curvature-functions")


def noise():
    """Mean curvature of a noisy ball: noise of 2 and 10 grey; the slice, sigma = 1, 1.5, 2, 3 h.
    White is 0, full red twice that of the ball, blue concave."""
    n, radius, zoom, gap = 48, 16.0, 2, 4
    places = numpy.indices((n, n, n)) - numpy.array((23.9, 23.6, 23.3)).reshape(3, 1, 1, 1)
    ball = 50.0 * (1.0 - numpy.tanh((numpy.sqrt((places**2).sum(axis=0)) - radius) / 2.0))
    random = numpy.random.default_rng(5)
    panels = []
    for deviation in (10.0, 2.0):  # the picture's rows go upwards
        values = ball + deviation * random.standard_normal(ball.shape)
        image = vtkImageData()
        image.SetDimensions(n, n, n)
        image.GetPointData().SetScalars(numpy_to_vtk(values.ravel(), deep=True))
        grey = numpy.clip(55 + 1.5 * values[n // 2], 0, 255)
        row = [numpy.repeat(grey[..., None], 3, axis=2)]
        for sigma in (1.0, 1.5, 2.0, 3.0):
            curvature = lt.vtkVolumeCurvatureFilter()
            curvature.SetInputData(image)
            curvature.SetDerivativeScale(sigma)
            curvature.Update()
            mean = curvature.GetOutput().GetPointData().GetArray("MeanCurvature")
            x = vtk_to_numpy(mean).reshape(n, n, n)[n // 2] * radius / 2.0
            red = numpy.clip(1.0 + x, 0.0, 1.0)
            blue = numpy.clip(1.0 - x, 0.0, 1.0)
            row.append(255 * numpy.stack((red, numpy.minimum(red, blue), blue), axis=2))
        panels.append(row)
    side = zoom * n
    pixels = numpy.full((2 * side + gap, 5 * side + 4 * gap, 3), 255, numpy.uint8)
    for j, row in enumerate(panels):
        for i, panel in enumerate(row):
            large = panel.repeat(zoom, axis=0).repeat(zoom, axis=1)
            y, x = j * (side + gap), i * (side + gap)
            pixels[y : y + side, x : x + side] = large
    picture = vtkImageData()
    picture.SetDimensions(pixels.shape[1], pixels.shape[0], 1)
    picture.GetPointData().SetScalars(numpy_to_vtk(pixels.reshape(-1, 3), deep=True))
    write(picture, "curvature-noise")


def show(prop, position, up, zoom, name, more=(), render_pass=None):
    renderer = vtkRenderer()
    renderer.AddViewProp(prop)
    for another in more:
        renderer.AddViewProp(another)
    renderer.SetPass(render_pass)
    renderer.SetBackground(0, 0, 0)
    renderer.SetUseDepthPeeling(not more)
    renderer.SetMaximumNumberOfPeels(50)
    renderer.SetOcclusionRatio(0)
    window = vtkRenderWindow()
    window.SetMultiSamples(0)
    window.SetAlphaBitPlanes(True)
    window.SetSize(SIZE, SIZE)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(*position)
    camera.SetViewUp(*up)
    renderer.ResetCamera()
    camera.Zoom(zoom)
    renderer.ResetCameraClippingRange()
    window.Render()
    begin = time.perf_counter()
    window.Render()
    print(f"{name}: {1e3 * (time.perf_counter() - begin):.0f} ms")
    shot = vtkWindowToImageFilter()
    shot.SetInput(window)
    shot.ReadFrontBufferOff()
    shot.Update()
    write(shot.GetOutput(), name)


def engine():
    reader = vtkNIFTIImageReader()
    reader.SetFileName(os.path.join(data, "engine.nii.gz"))
    resample = vtkImageResample()
    resample.SetInputConnection(reader.GetOutputPort())
    resample.SetMagnificationFactors(0.5, 0.5, 0.5)
    resample.Update()
    image = resample.GetOutput()
    spacing = min(image.GetSpacing())
    curvature = lt.vtkVolumeCurvatureFilter()
    curvature.SetInputData(image)
    curvature.SetDerivativeScale(1.5 * spacing)
    curvature.ComputePrincipalCurvaturesOff()
    curvature.ComputeGaussianCurvatureOff()
    metal, light = (1.0, 0.6, 0.2), (0.75, 0.8, 0.9)
    cases = (
        ("surfaces-constant", True, None, True),
        ("surfaces-curvature", True, Function.CurvatureOnly, True),
        ("surfaces-wide-depth", True, Function.WideDepth, True),
        ("surfaces-along-ray", True, Function.CurvatureOnly, False),
        ("dense-constant", False, None, True),
        ("dense-curvature", False, Function.CurvatureOnly, True),
        ("dense-along-ray", False, Function.CurvatureOnly, False),
        ("dense-front-opaque", False, Function.FrontOpaque, True),
    )
    for name, surfaces, kind, field in cases:
        mapper = lt.vtkLightTransportVolumeMapper()
        mapper.SetInputData(image)
        mapper.SetAutoAdjustSampleDistances(False)
        mapper.SetSampleDistance(0.25 * spacing)
        prop = vtkVolumeProperty()
        prop.SetInterpolationTypeToLinear()
        prop.ShadeOn()
        prop.SetAmbient(0.15)
        prop.SetDiffuse(0.85)
        prop.SetScalarOpacityUnitDistance(spacing)
        color = vtkColorTransferFunction()
        opacity = vtkPiecewiseFunction()
        if surfaces:
            mapper.SetBlendModeToIsoSurface()
            for i, (value, rgb, alpha) in enumerate(((90, light, 0.5), (190, metal, 0.8))):
                prop.GetIsoSurfaceValues().SetValue(i, value)
                color.AddRGBPoint(value, *rgb)
                opacity.AddPoint(value, alpha)
        else:
            color.AddRGBPoint(180, *light)
            color.AddRGBPoint(210, *metal)
            for value, alpha in ((0, 0), (70, 0), (90, 0.03), (180, 0.05), (200, 0.4), (255, 0.6)):
                opacity.AddPoint(value, alpha)
        prop.SetColor(color)
        prop.SetScalarOpacity(opacity)
        if kind is not None:
            how = lt.vtkVolumeCurvatureProperty()
            how.GetOpacityFunction().SetKind(kind)
            mapper.SetCurvatureProperty(how)
            if field:
                mapper.SetCurvatureFieldConnection(curvature.GetOutputPort())
        volume = vtkVolume()
        volume.SetMapper(mapper)
        volume.SetProperty(prop)
        show(volume, (0.7, 1, 0.45), (0, 0, 1), 1.5, "curvature-" + name)
        if name == "dense-constant":
            balls = spheres(image)
            for after, render_pass in (("default", None), ("k-buffer", lt.vtkBucketedKBufferPass())):
                name = "volume-among-surfaces-" + after
                show(volume, (0.7, 1, 0.45), (0, 0, 1), 1.5, name, balls, render_pass)


def spheres(image):
    low_x, high_x, low_y, high_y, low_z, high_z = image.GetBounds()
    actors = []
    for color, side in (((0.2, 0.9, 0.3), -1), ((0.3, 0.4, 1), 1)):
        source = vtkSphereSource()
        source.SetRadius(60)
        source.SetThetaResolution(40)
        source.SetPhiResolution(40)
        source.SetCenter(
            (low_x + high_x) / 2 + 48 * side, (low_y + high_y) / 2 + 24 * side, (low_z + high_z) / 2
        )
        mapper = vtkPolyDataMapper()
        mapper.SetInputConnection(source.GetOutputPort())
        actor = vtkActor()
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(*color)
        actor.GetProperty().SetOpacity(0.35)
        actors.append(actor)
    return actors


def blade():
    reader = vtkPLYReader()
    reader.SetFileName(os.path.join(data, "turbineblade.ply"))
    reader.Update()
    edge = reader.GetOutput().GetLength() / 300
    curvature = lt.vtkSurfaceCurvatureFilter()
    curvature.SetInputConnection(reader.GetOutputPort())
    curvature.SetRadius(edge)
    for name, kind in (("constant", None), ("opacity", Function.CurvatureOnly)):
        opacity = lt.vtkCurvatureOpacityFilter()
        opacity.SetInputConnection(curvature.GetOutputPort())
        opacity.MakeColorsOn()
        opacity.SetColor(0.85, 0.88, 0.95)
        function = opacity.GetOpacityFunction()
        if kind is None:
            function.SetMinimumOpacity(0.3)
            function.SetMaximumOpacity(0.3)
        else:
            function.SetKind(kind)
        mapper = vtkPolyDataMapper()
        mapper.SetInputConnection(opacity.GetOutputPort())
        actor = vtkActor()
        actor.SetMapper(mapper)
        actor.ForceTranslucentOn()
        actor.GetProperty().SetAmbient(0.2)
        show(actor, (1, 0.5, 0.4), (0, 0, 1), 1.0, "curvature-blade-" + name)


functions()
noise()
if not os.path.exists(os.path.join(data, "engine.nii.gz")):
    print("no ../shared/data: without the other figures")
    sys.exit(0)
engine()
blade()
