#!/usr/bin/python3
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Surfaces that one sees through: transparent_surfaces.py [--data FOLDER] [--size N] FOLDER

For each scene a picture in FOLDER: constant opacity | shading by curvature | opacity by
curvature, with the transfer functions drawn in (shading over kappa from -1 to 1; opacity
over |kappa| to the right and depth upwards); and the four kinds of lines. The assembly is
made here; the others need turbineblade.ply, cortex_left.ply, ct_avm.nii.gz,
mr_head.nii.gz and bunny.ply in --data. Headless
machines need nothing more.
"""

import argparse
import math
import os

import lighttransport as lt  # first: it decides how windows are made
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkImageData, vtkPolyData
from vtkmodules.vtkCommonTransforms import vtkTransform
from vtkmodules.vtkFiltersCore import (
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
from vtkmodules.vtkImagingCore import vtkImageResize
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
    vtkWindowToImageFilter,
)
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 (registers VTK's OpenGL)

arguments = argparse.ArgumentParser(description=__doc__)
arguments.add_argument("--data", default="../shared/data")
arguments.add_argument("--size", type=int, default=300)
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


def spring(radius, height, turns):
    points = vtkPoints()
    line = vtkCellArray()
    steps = 40 * turns
    line.InsertNextCell(steps)
    for i in range(steps):
        angle = 2.0 * math.pi * turns * i / steps
        line.InsertCellPoint(
            points.InsertNextPoint(
                radius * math.cos(angle), radius * math.sin(angle), height * (i / steps - 0.5)
            )
        )
    data = vtkPolyData()
    data.SetPoints(points)
    data.SetLines(line)
    tube = vtkTubeFilter()
    tube.SetInputData(data)
    tube.SetRadius(0.06)
    tube.SetNumberOfSides(24)
    return tube


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


def assembly():
    """A gearbox: housing, two shafts, gears, bearings, bolts, a spring."""
    housing = vtkSuperquadricSource()
    housing.SetPhiRoundness(0.25)
    housing.SetThetaRoundness(0.25)
    housing.SetThetaResolution(160)
    housing.SetPhiResolution(160)
    housing.SetScale(4.6, 3.0, 2.6)
    steel, brass, blue = (0.75, 0.78, 0.82), (0.9, 0.72, 0.35), (0.45, 0.6, 0.85)
    parts = [(with_normals(housing, 180.0), blue)]
    for x, teeth, radius in ((-0.85, 22, 0.95), (1.02, 18, 0.78)):
        parts.append((with_normals(cylinder(0.16, 3.6), 40.0), steel))
        parts[-1] = (placed(parts[-1][0], x=x), steel)
        for z in (-0.45, 0.35):
            parts.append((placed(with_normals(gear(teeth, radius, 0.28)), x=x, z=z), brass))
        for z in (-1.15, 1.15):
            parts.append((placed(ring(0.3), x=x, z=z, scale=(0.5, 0.5, 0.5)), steel))
    for x in (-2.0, 2.0):
        for y in (-1.15, 1.15):
            parts.append((placed(with_normals(cylinder(0.14, 2.9)), x=x, y=y), steel))
    parts.append((placed(spring(0.28, 1.6, 6), x=0.1, y=-1.05, turn=(0.0, 90.0, 0.0)), steel))
    return parts


def mesh(name):
    reader = vtkPLYReader()
    reader.SetFileName(os.path.join(options.data, name))
    return reader


def surface_of(file, value, smooth=1.0):
    """An isosurface of a NIfTI volume at half resolution, its largest piece."""
    reader = vtkNIFTIImageReader()
    reader.SetFileName(os.path.join(options.data, file))
    half = vtkImageResize()
    half.SetInputConnection(reader.GetOutputPort())
    half.SetResizeMethodToMagnificationFactors()
    half.SetMagnificationFactors(0.5, 0.5, 0.5)
    blur = vtkImageGaussianSmooth()
    blur.SetInputConnection(half.GetOutputPort())
    blur.SetStandardDeviation(smooth)
    contour = vtkFlyingEdges3D()
    contour.SetInputConnection(blur.GetOutputPort())
    contour.SetValue(0, value)
    contour.ComputeNormalsOff()
    largest = vtkPolyDataConnectivityFilter()
    largest.SetInputConnection(contour.GetOutputPort())
    largest.SetExtractionModeToLargestRegion()
    fair = vtkWindowedSincPolyDataFilter()
    fair.SetInputConnection(largest.GetOutputPort())
    fair.SetNumberOfIterations(30)
    fair.SetPassBand(0.05)
    return with_normals(fair, 180.0)


def fit(source, bounds):
    """Moves and scales one surface into the bounds of another."""
    source.Update()
    own = source.GetOutput().GetBounds()
    size = max(own[2 * a + 1] - own[2 * a] for a in range(3))
    scale = min(bounds[2 * a + 1] - bounds[2 * a] for a in range(3)) / size
    transform = vtkTransform()
    transform.Translate(*(0.5 * (bounds[2 * a] + bounds[2 * a + 1]) for a in range(3)))
    transform.Scale(scale, scale, scale)
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
        actor.GetProperty().SetSpecular(0.2)
        actor.GetProperty().SetSpecularPower(30.0)
        result.append(actor)
    return result


def draw_in(renderer, image, x, y):
    """A grey image of values from 0 to 1 as it is, with its corner at a pixel."""
    mapper = vtkImageMapper()
    mapper.SetInputData(image)
    mapper.SetColorWindow(1.0)
    mapper.SetColorLevel(0.5)
    actor = vtkActor2D()
    actor.SetMapper(mapper)
    actor.SetPosition(x, y)
    renderer.AddActor2D(actor)


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


def picture_of(name, parts, camera, kind, scale=0.0, opacity=0.4):
    size = options.size
    window = vtkRenderWindow()
    window.SetMultiSamples(0)
    window.SetSize(3 * size, size)
    passes = []
    for i in range(3):
        renderer = vtkRenderer()
        renderer.SetViewport(i / 3.0, 0.0, (i + 1) / 3.0, 1.0)
        renderer.SetBackground(1.0, 1.0, 1.0)
        the_pass = lt.vtkBucketedKBufferPass()
        the_pass.SetNumberOfLayers(32)
        the_pass.SetCurvatureScale(scale)
        renderer.SetPass(the_pass)
        passes.append(the_pass)
        style = the_pass.GetCurvatureOpacityProperty()
        style.SetCurvatureShading(i >= 1)
        style.SetCurvatureOpacity(i == 2)
        style.GetOpacityFunction().SetKind(kind)
        for actor in actors_of(parts, opacity):
            renderer.AddActor(actor)
        view_from(renderer, camera)
        if i >= 1:
            ramp = vtkImageData()
            ramp.SetDimensions(64, 8, 1)
            ramp.AllocateScalars(10, 1)
            for x in range(64):
                factor = style.GetShadingFunction().GetValue(-1.0 + 2.0 * x / 63.0)
                for y in range(8):
                    ramp.SetScalarComponentFromDouble(x, y, 0, 0, factor / 1.5)
            draw_in(renderer, ramp, 6, 6)
        if i == 2:
            table = vtkImageData()
            style.GetOpacityFunction().ExportTable(table, 64, 64)
            draw_in(renderer, table, 6, 20)
        window.AddRenderer(renderer)
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
        for actor in actors_of([(source, (0.9, 0.9, 0.85), True)], 1.0):
            actor.ForceTranslucentOn()  # opaque ones take part so
            renderer.AddActor(actor)
        view_from(renderer, camera)
        window.AddRenderer(renderer)
    write(window, name)


os.makedirs(options.folder, exist_ok=True)
picture_of(
    "assembly",
    assembly(),
    {"from": (3.0, 4.0, 8.0), "up": (0.0, 1.0, 0.0), "zoom": 1.25},
    Opacity.WideDepth,
)
if os.path.exists(os.path.join(options.data, "turbineblade.ply")):
    picture_of(
        "turbine-blade",
        [(with_normals(mesh("turbineblade.ply"), 40.0), (0.7, 0.72, 0.78))],
        {"from": (0.6, -1.0, 0.5), "up": (0.0, 0.0, 1.0), "zoom": 1.4},
        Opacity.WideDepth,
    )
if os.path.exists(os.path.join(options.data, "cortex_left.ply")):
    cortex = with_normals(mesh("cortex_left.ply"), 180.0)
    cortex.Update()
    vessels = fit(surface_of("ct_avm.nii.gz", 60.0), cortex.GetOutput().GetBounds())
    picture_of(  # the vessels are another person's, fitted into the cortex
        "cortex",
        [(cortex, (0.9, 0.85, 0.8)), (vessels, (0.85, 0.1, 0.1), True)],
        {"from": (-1.0, 0.0, 0.15), "up": (0.0, 0.0, 1.0), "zoom": 1.45},
        Opacity.CurvatureOnly,
        0.7,
        0.25,
    )
if os.path.exists(os.path.join(options.data, "mr_head.nii.gz")):
    picture_of(
        "head",
        [
            (surface_of("mr_head.nii.gz", 35.0), (0.95, 0.8, 0.7)),
            (surface_of("mr_head.nii.gz", 110.0), (0.8, 0.85, 0.95)),
        ],
        {"from": (0.8, 1.0, 0.2), "up": (0.0, 0.0, 1.0), "zoom": 1.45},
        Opacity.CurvatureOnly,
        2.0,
        0.3,
    )
if os.path.exists(os.path.join(options.data, "bunny.ply")):
    lines_of(
        "lines",
        with_normals(mesh("bunny.ply"), 180.0),
        {"from": (0.0, 0.0, 1.0), "up": (0.0, 1.0, 0.0), "zoom": 1.4},
    )
