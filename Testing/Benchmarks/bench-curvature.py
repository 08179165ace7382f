# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws the figures of Module/Documentation/curvature.md:

PYTHONPATH=build/dev/lib/python3/dist-packages /usr/bin/python3 Testing/Benchmarks/bench-curvature.py

from the engine and the turbine blade of ../shared/data; without them the functions alone.
"""

import os
import sys
import time

import lighttransport as lt
from vtkmodules import vtkRenderingOpenGL2, vtkRenderingVolumeOpenGL2  # noqa: F401
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
if not os.path.exists(os.path.join(data, "engine.nii.gz")):
    print("no ../shared/data: without the other figures")
    sys.exit(0)
engine()
blade()
