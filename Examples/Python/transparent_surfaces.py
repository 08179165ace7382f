#!/usr/bin/python3
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Surfaces that one sees through:

transparent_surfaces.py [--data FOLDER] [--size N] [--only SCENE] [--kind NAME] FOLDER

For each scene a picture in FOLDER: constant opacity | shading by curvature | opacity by
curvature, with the transfer functions below (opacity over |kappa| to the right and depth
upwards, white is opaque; shading over kappa from -1 to 1); and the four kinds of lines. The
car is made here; the others need turbineblade.ply, cortex_left.ply, ct_avm.nii.gz,
mr_head.nii.gz and bunny.ply in --data. Headless machines need nothing more.
"""

import argparse
import math
import os

import lighttransport as lt  # first: it decides how windows are made
from vtkmodules.vtkCommonCore import VTK_FLOAT, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkImageData, vtkPolyData
from vtkmodules.vtkCommonTransforms import vtkTransform
from vtkmodules.vtkFiltersCore import (
    vtkCleanPolyData,
    vtkFlyingEdges3D,
    vtkPolyDataConnectivityFilter,
    vtkPolyDataNormals,
    vtkTriangleFilter,
    vtkTubeFilter,
    vtkWindowedSincPolyDataFilter,
)
from vtkmodules.vtkFiltersGeneral import vtkTransformPolyDataFilter
from vtkmodules.vtkFiltersModeling import vtkLinearExtrusionFilter
from vtkmodules.vtkFiltersSources import vtkCylinderSource, vtkSuperquadricSource
from vtkmodules.vtkImagingCore import vtkExtractVOI, vtkImageConstantPad, vtkImageResize
from vtkmodules.vtkImagingGeneral import vtkImageGaussianSmooth
from vtkmodules.vtkIOImage import vtkNIFTIImageReader, vtkPNGWriter
from vtkmodules.vtkIOPLY import vtkPLYReader
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkActor2D,
    vtkImageMapper,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkTextActor,
    vtkWindowToImageFilter,
)
import vtkmodules.vtkRenderingFreeType  # noqa: F401 (registers VTK's text)
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 (registers VTK's OpenGL)

arguments = argparse.ArgumentParser(description=__doc__)
arguments.add_argument("--data", default="../shared/data")
arguments.add_argument("--size", type=int, default=300)
arguments.add_argument("--only", help="car, turbine-blade, cortex, head or lines")
arguments.add_argument("--kind", help="another opacity function, such as WideDepth, for all")
arguments.add_argument("folder")
options = arguments.parse_args()

Opacity = lt.vtkCurvatureOpacityFunction


def placed(source, x=0.0, y=0.0, z=0.0, scale=(1.0, 1.0, 1.0), turn=(0.0, 0.0, 0.0)):
    transform = vtkTransform()
    transform.Translate(x, y, z)
    transform.RotateX(turn[0])
    transform.RotateY(turn[1])
    transform.RotateZ(turn[2])
    transform.Scale(*scale)
    result = vtkTransformPolyDataFilter()
    result.SetTransform(transform)
    result.SetInputConnection(source.GetOutputPort())
    return result


def with_normals(source, angle=40.0):
    normals = vtkPolyDataNormals()
    normals.SetInputConnection(source.GetOutputPort())
    normals.SetFeatureAngle(angle)
    return normals


def gear(teeth, radius, thickness):
    points = vtkPoints()
    outline = vtkCellArray()
    steps = 8 * teeth
    outline.InsertNextCell(steps)
    for i in range(steps):
        angle = 2.0 * math.pi * i / steps
        tooth = max(-1.0, min(1.0, 2.5 * math.cos(teeth * angle)))
        r = radius * (1.0 + 0.08 * tooth)
        outline.InsertCellPoint(
            points.InsertNextPoint(r * math.cos(angle), r * math.sin(angle), -0.5 * thickness)
        )
    data = vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(outline)
    extrusion = vtkLinearExtrusionFilter()
    extrusion.SetInputData(data)
    extrusion.SetExtrusionTypeToVectorExtrusion()
    extrusion.SetVector(0.0, 0.0, thickness)
    triangles = vtkTriangleFilter()  # OpenGL draws convex polygons only
    triangles.SetInputConnection(extrusion.GetOutputPort())
    return triangles


def tube(places, radius, sides=20):
    points = vtkPoints()
    line = vtkCellArray()
    line.InsertNextCell(len(places))
    for place in places:
        line.InsertCellPoint(points.InsertNextPoint(*place))
    data = vtkPolyData()
    data.SetPoints(points)
    data.SetLines(line)
    result = vtkTubeFilter()
    result.SetInputData(data)
    result.SetRadius(radius)
    result.SetNumberOfSides(sides)
    return result


def spring(radius, height, turns, thickness=0.06):
    steps = 40 * turns
    angles = [2.0 * math.pi * turns * i / steps for i in range(steps + 1)]
    return tube(
        [
            (radius * math.cos(a), radius * math.sin(a), height * (i / steps - 0.5))
            for i, a in enumerate(angles)
        ],
        thickness,
        24,
    )


def cylinder(radius, height):
    source = vtkCylinderSource()
    source.SetRadius(radius)
    source.SetHeight(height)
    source.SetResolution(96)
    return placed(source, turn=(90.0, 0.0, 0.0))


def ring(thickness):
    source = vtkSuperquadricSource()
    source.ToroidalOn()
    source.SetThickness(thickness)
    source.SetThetaResolution(128)
    source.SetPhiResolution(64)
    return placed(source, turn=(90.0, 0.0, 0.0))


def block(x, y, z, size, roundness=0.3):
    """A box with round edges about a place."""
    source = vtkSuperquadricSource()
    source.SetPhiRoundness(roundness)
    source.SetThetaRoundness(roundness)
    source.SetThetaResolution(96)
    source.SetPhiResolution(96)
    source.SetScale(*size)  # the superquadric's radius is 1/2
    return placed(with_normals(source, 180.0), x=x, y=y, z=z)


def shell(length, half_width, low, high, around=128, along=160):
    """A closed body along x: functions of t in [0, 1] give its width and its heights."""

    def rounded(value, power):
        return math.copysign(abs(value) ** power, value)

    points = vtkPoints()
    polygons = vtkCellArray()
    for i in range(along + 1):
        t = 0.5 - 0.5 * math.cos(math.pi * i / along)  # finer at the ends
        end = max(1.0 - abs(2.0 * t - 1.0) ** 8, 0.0) ** 0.5
        middle, half = 0.5 * (high(t) + low(t)), 0.5 * (high(t) - low(t))
        for j in range(around):
            angle = 2.0 * math.pi * j / around
            points.InsertNextPoint(
                length * (t - 0.5),
                end * half_width(t) * rounded(math.cos(angle), 0.45),
                middle + end * half * rounded(math.sin(angle), 0.55),
            )
    for i in range(along):
        for j in range(around):
            corners = (i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)
            polygons.InsertNextCell(4)
            for k, l in corners:
                polygons.InsertCellPoint(k * around + l % around)
    data = vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(polygons)
    clean = vtkCleanPolyData()  # the ends are single points
    clean.SetInputData(data)
    return with_normals(clean, 180.0)


def car():
    """Body, wheels, brakes, axles, springs, engine, gearbox, shaft, exhaust, seats, wheel."""
    paint, steel, brass = (0.4, 0.55, 0.85), (0.72, 0.75, 0.8), (0.9, 0.7, 0.3)
    rubber, leather, red = (0.35, 0.35, 0.38), (0.7, 0.45, 0.3), (0.8, 0.25, 0.2)

    def step(t, a, b):
        u = min(max((t - a) / (b - a), 0.0), 1.0)
        return u * u * (3.0 - 2.0 * u)

    def roof(t):
        cabin = step(t, 0.1, 0.32) * (1.0 - step(t, 0.52, 0.72))
        return 1.5 + 1.15 * cabin - 0.2 * step(t, 0.7, 1.0)

    body = shell(
        8.6,
        lambda t: 1.62 - 0.25 * (2.0 * t - 1.0) ** 4,
        lambda t: 0.35 + 0.15 * (2.0 * t - 1.0) ** 6,
        roof,
    )
    parts = [(body, paint)]

    def add(color, source, **place):
        parts.append((placed(source, **place) if place else source, color))

    def rod(radius, height):
        return with_normals(cylinder(radius, height))

    across, along = (90.0, 0.0, 0.0), (0.0, 90.0, 0.0)
    for x in (-2.6, 2.65):
        for side in (-1.0, 1.0):
            add(rubber, ring(0.38), x=x, y=1.5 * side, z=0.45, turn=across)
            add(steel, rod(0.42, 0.1), x=x, y=1.36 * side, z=0.45, turn=across)
            add(red, spring(0.17, 0.8, 6, 0.035), x=x, y=1.0 * side, z=0.95)
        add(steel, rod(0.09, 3.0), x=x, z=0.45, turn=across)
    add(steel, block(2.5, 0.0, 1.05, (1.5, 0.9, 0.75)))
    for i in range(4):
        add(brass, rod(0.16, 0.4), x=2.0 + 0.34 * i, z=1.42)
    add(brass, with_normals(gear(16, 0.32, 0.14)), x=3.4, z=1.0, turn=along)
    add(brass, with_normals(gear(12, 0.2, 0.14)), x=3.4, z=1.55, turn=along)
    add(steel, block(1.25, 0.0, 0.85, (1.1, 0.6, 0.55), 0.6))
    add(steel, rod(0.08, 3.4), x=-0.95, z=0.65, turn=along)
    add(steel, block(-2.6, 0.0, 0.5, (0.6, 0.6, 0.6), 1.0))
    pipe = [(2.4, -0.5, 0.9), (1.9, -0.65, 0.6), (1.3, -0.75, 0.5), (-1.2, -0.75, 0.5)]
    add(red, tube(pipe, 0.08))
    add(red, block(-1.8, -0.75, 0.5, (1.3, 0.45, 0.3), 0.5))
    add(red, tube([(-2.3, -0.75, 0.5), (-4.2, -0.75, 0.5)], 0.07))
    for x in (0.2, -1.5):
        for y in (-0.65, 0.65):
            back = block(0.0, 0.0, 0.0, (0.25, 0.85, 1.1), 0.5)
            add(leather, block(x, y, 0.85, (0.9, 0.85, 0.3), 0.5))
            add(leather, back, x=x - 0.5, y=y, z=1.4, turn=(0.0, -15.0, 0.0))
    steering = {"x": 0.95, "y": 0.65, "z": 1.6, "scale": (0.5, 0.5, 0.5)}
    add(rubber, ring(0.12), turn=(0.0, -65.0, 0.0), **steering)
    add(steel, tube([(0.95, 0.65, 1.6), (1.7, 0.65, 1.25)], 0.04))
    return parts


def mesh(name):
    reader = vtkPLYReader()
    reader.SetFileName(os.path.join(options.data, name))
    return reader


def surface_of(file, value, blur=1.0, scale=(0.5, 0.5, 0.5), least=None, x_range=None):
    """An isosurface of a NIfTI volume, of its pieces those of `least` triangles or the largest."""
    reader = vtkNIFTIImageReader()
    reader.SetFileName(os.path.join(options.data, file))
    reader.Update()
    extent = list(reader.GetOutput().GetExtent())
    extent[:2] = x_range or extent[:2]
    part = vtkExtractVOI()
    part.SetInputConnection(reader.GetOutputPort())
    part.SetVOI(extent)
    resized = vtkImageResize()
    resized.SetInputConnection(part.GetOutputPort())
    resized.SetResizeMethodToMagnificationFactors()
    resized.SetMagnificationFactors(*scale)
    smooth = vtkImageGaussianSmooth()
    smooth.SetInputConnection(resized.GetOutputPort())
    smooth.SetStandardDeviation(blur)
    contour = vtkFlyingEdges3D()
    contour.SetInputConnection(smooth.GetOutputPort())
    contour.SetValue(0, value)
    contour.ComputeNormalsOff()
    pieces = vtkPolyDataConnectivityFilter()
    pieces.SetInputConnection(contour.GetOutputPort())
    if least is None:
        pieces.SetExtractionModeToLargestRegion()
    else:
        pieces.SetExtractionModeToAllRegions()
        pieces.Update()
        sizes = pieces.GetRegionSizes()
        pieces.SetExtractionModeToSpecifiedRegions()
        for i in range(pieces.GetNumberOfExtractedRegions()):
            if sizes.GetValue(i) >= least:
                pieces.AddSpecifiedRegion(i)
    fair = vtkWindowedSincPolyDataFilter()
    fair.SetInputConnection(pieces.GetOutputPort())
    fair.SetNumberOfIterations(30)
    fair.SetPassBand(0.05)
    return with_normals(fair, 180.0)


def fit(source, bounds, part):
    """Moves and stretches one surface into a part of the bounds of another."""
    source.Update()
    own = source.GetOutput().GetBounds()
    transform = vtkTransform()
    transform.Translate(*(0.5 * (bounds[2 * a] + bounds[2 * a + 1]) for a in range(3)))
    size = [bounds[2 * a + 1] - bounds[2 * a] for a in range(3)]
    transform.Scale(*(part * size[a] / (own[2 * a + 1] - own[2 * a]) for a in range(3)))
    transform.Translate(*(-0.5 * (own[2 * a] + own[2 * a + 1]) for a in range(3)))
    result = vtkTransformPolyDataFilter()
    result.SetTransform(transform)
    result.SetInputConnection(source.GetOutputPort())
    return result


def actors_of(parts, opacity):
    """Parts are (source, colour), opaque ones (source, colour, True)."""
    result = []
    for source, color, *opaque in parts:
        mapper = vtkPolyDataMapper()
        mapper.SetInputConnection(source.GetOutputPort())
        mapper.ScalarVisibilityOff()
        actor = vtkActor()
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(*color)
        actor.GetProperty().SetOpacity(1.0 if opaque else opacity)
        actor.SetForceOpaque(opaque)  # or else it would be stylised too
        actor.GetProperty().SetSpecular(0.2)
        actor.GetProperty().SetSpecularPower(30.0)
        result.append(actor)
    return result


def text(renderer, words, x, y, size):
    actor = vtkTextActor()
    actor.SetInput(words)
    actor.SetPosition(x, y)
    actor.GetTextProperty().SetColor(0.0, 0.0, 0.0)
    actor.GetTextProperty().SetFontSize(size)
    renderer.AddActor2D(actor)


def draw_in(renderer, image, x, y):
    """A grey image of values from 0 to 1 as it is, with its corner at a pixel, framed."""
    mapper = vtkImageMapper()
    frame = vtkImageConstantPad()
    frame.SetInputData(image)
    frame.SetConstant(0.5)
    width, height, _ = image.GetDimensions()
    frame.SetOutputWholeExtent(-1, width, -1, height, 0, 0)
    mapper.SetInputConnection(frame.GetOutputPort())
    mapper.SetColorWindow(1.0)
    mapper.SetColorLevel(0.5)
    actor = vtkActor2D()
    actor.SetMapper(mapper)
    actor.SetPosition(x, y)
    renderer.AddActor2D(actor)


def grey_image(width, height, value_of):
    image = vtkImageData()
    image.SetDimensions(width, height, 1)
    image.AllocateScalars(VTK_FLOAT, 1)
    for y in range(height):
        for x in range(width):
            value = value_of(x / (width - 1), y / (height - 1))
            image.SetScalarComponentFromDouble(x, y, 0, 0, value)
    return image


def transfer_functions(viewport, shading, opacity, constant):
    """Below a picture: the opacity over |kappa| and depth, the shading; None: constant."""
    renderer = vtkRenderer()
    renderer.SetViewport(*viewport)
    renderer.SetBackground(1.0, 1.0, 1.0)
    side, font = 2 * options.size // 9, max(8, options.size // 24)
    left, low = options.size // 20, 5 * font // 2
    table = grey_image(side, side, lambda c, z: opacity.Evaluate(c, z) if opacity else constant)
    draw_in(renderer, table, left, low)
    middle = left + side + options.size // 30
    words = "opacity" if opacity else f"opacity {constant:g}"
    text(renderer, words, middle, low + side - font, font)
    if opacity:
        text(renderer, "y: depth", middle, low + side - 5 * font // 2, font)
        text(renderer, "x: curvature", middle, low + side - 4 * font, font)
    width = options.size // 3
    right = options.size - width - options.size // 20
    ramp = grey_image(
        width, side // 3, lambda x, _: shading.GetValue(2 * x - 1) / 1.5 if shading else 1 / 1.5
    )
    draw_in(renderer, ramp, right, low)
    words = "shading" if shading else "no shading"
    text(renderer, words, right, low + side // 3 + font // 2, font)
    if shading:
        text(renderer, "convex", right, low - 3 * font // 2, font)
        text(renderer, "concave", right + width - 4 * font, low - 3 * font // 2, font)
    return renderer


def view_from(renderer, camera):
    view = renderer.GetActiveCamera()
    view.SetViewUp(*camera["up"])
    view.SetFocalPoint(0.0, 0.0, 0.0)
    view.SetPosition(*camera["from"])
    renderer.ResetCamera()
    view.Zoom(camera["zoom"])
    renderer.ResetCameraClippingRange()


def write(window, name):
    window.Render()
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    writer = vtkPNGWriter()
    writer.SetFileName(os.path.join(options.folder, name + ".png"))
    writer.SetInputConnection(grab.GetOutputPort())
    writer.Write()


def picture_of(name, parts, camera, kind, scale=0.0, opacity=0.4, limits=(0.05, 0.95)):
    """Three views side by side, under each its transfer functions."""
    size, strip = options.size, options.size // 3
    window = vtkRenderWindow()
    window.SetMultiSamples(0)
    window.SetSize(3 * size, size + strip)
    low = strip / (size + strip)
    passes = []
    for i in range(3):
        renderer = vtkRenderer()
        renderer.SetViewport(i / 3.0, low, (i + 1) / 3.0, 1.0)
        renderer.SetBackground(1.0, 1.0, 1.0)
        the_pass = lt.vtkBucketedKBufferPass()
        the_pass.SetNumberOfLayers(32)
        the_pass.SetCurvatureScale(scale)
        renderer.SetPass(the_pass)
        passes.append(the_pass)
        style = the_pass.GetCurvatureOpacityProperty()
        style.SetCurvatureShading(i >= 1)
        style.SetCurvatureOpacity(i == 2)
        style.GetOpacityFunction().SetKind(getattr(Opacity, options.kind) if options.kind else kind)
        style.GetOpacityFunction().SetMinimumOpacity(limits[0])
        style.GetOpacityFunction().SetMaximumOpacity(limits[1])
        for actor in actors_of(parts, opacity):
            renderer.AddActor(actor)
        view_from(renderer, camera)
        window.AddRenderer(renderer)
        window.AddRenderer(
            transfer_functions(
                (i / 3.0, 0.0, (i + 1) / 3.0, low),
                style.GetShadingFunction() if i >= 1 else None,
                style.GetOpacityFunction() if i == 2 else None,
                opacity,
            )
        )
    write(window, name)
    print(
        f"{name}: {passes[2].GetNumberOfFragments()} fragments, "
        f"{passes[2].GetNumberOfMergedFragments()} merged"
    )


def lines_of(name, source, camera):
    """Occluding contours | suggestive contours | ridges, valleys | demarcating curves."""
    size = options.size
    window = vtkRenderWindow()
    window.SetMultiSamples(0)
    window.SetSize(4 * size, size)
    for i in range(4):
        renderer = vtkRenderer()
        renderer.SetViewport(i / 4.0, 0.0, (i + 1) / 4.0, 1.0)
        renderer.SetBackground(1.0, 1.0, 1.0)
        the_pass = lt.vtkBucketedKBufferPass()
        renderer.SetPass(the_pass)
        style = the_pass.GetCurvatureOpacityProperty()
        style.SetOccludingContours(True)
        style.SetSuggestiveContours(i == 1)
        style.SetRidgesAndValleys(i == 2)
        style.SetDemarcatingCurves(i == 3)
        for actor in actors_of([(source, (0.9, 0.9, 0.85))], 1.0):
            renderer.AddActor(actor)
        view_from(renderer, camera)
        window.AddRenderer(renderer)
    write(window, name)


def car_picture():
    camera = {"from": (0.75, -1.0, 0.6), "up": (0.0, 0.0, 1.0), "zoom": 1.2}
    picture_of("car", car(), camera, Opacity.CurvatureOnly, 0.15)


def blade_picture():
    blade = with_normals(mesh("turbineblade.ply"), 40.0)
    camera = {"from": (0.6, -1.0, 0.5), "up": (0.0, 0.0, 1.0), "zoom": 1.4}
    parts = [(blade, (0.7, 0.72, 0.78))]
    picture_of("turbine-blade", parts, camera, Opacity.CurvatureOnly, 0.4, 0.4, (0.1, 0.95))


def cortex_picture():
    """The vessels, opaque, are another person's, fitted in."""
    cortex = with_normals(mesh("cortex_left.ply"), 180.0)
    cortex.Update()
    vessels = surface_of("ct_avm.nii.gz", 55.0, 0.8, (1.0, 1.0, 1.0), 400, (0, 104))
    vessels = fit(vessels, cortex.GetOutput().GetBounds(), 0.93)
    camera = {"from": (-1.0, 0.25, 0.35), "up": (0.0, 0.0, 1.0), "zoom": 1.3}
    parts = [(cortex, (0.55, 0.62, 0.75)), (vessels, (0.85, 0.1, 0.08), True)]
    picture_of("cortex", parts, camera, Opacity.CurvatureOnly, 0.7, 0.3, (0.06, 0.5))


def head_picture():
    skin, brain = (0.95, 0.8, 0.7), (0.8, 0.85, 0.95)
    file = "mr_head.nii.gz"
    parts = [(surface_of(file, 35.0), skin), (surface_of(file, 110.0), brain)]
    camera = {"from": (0.8, 1.0, 0.2), "up": (0.0, 0.0, 1.0), "zoom": 1.45}
    picture_of("head", parts, camera, Opacity.CurvatureOnly, 2.0, 0.3)


def lines_picture():
    camera = {"from": (0.0, 0.0, 1.0), "up": (0.0, 1.0, 0.0), "zoom": 1.4}
    lines_of("lines", with_normals(mesh("bunny.ply"), 180.0), camera)


SCENES = {
    "car": (car_picture, ()),
    "turbine-blade": (blade_picture, ("turbineblade.ply",)),
    "cortex": (cortex_picture, ("cortex_left.ply", "ct_avm.nii.gz")),
    "head": (head_picture, ("mr_head.nii.gz",)),
    "lines": (lines_picture, ("bunny.ply",)),
}

os.makedirs(options.folder, exist_ok=True)
for name, (make, files) in SCENES.items():
    if options.only in (None, name):
        if all(os.path.exists(os.path.join(options.data, file)) for file in files):
            make()
        else:
            print(f"{name}: left out, without {' and '.join(files)} in {options.data}")
