#!/usr/bin/python3
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Opacity that follows curvature: curvature_transparency.py [PICTURE.png [MESH.ply...]]

Without meshes, a rounded box around a ring. Headless machines need nothing more.
"""

import sys

import lighttransport as lt  # first: it decides how windows are made
from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
from vtkmodules.vtkFiltersSources import vtkSuperquadricSource
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkIOPLY import vtkPLYReader
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkWindowToImageFilter,
)
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 (registers VTK's OpenGL)

sources = []
for file in sys.argv[2:]:
    sources.append(vtkPLYReader())
    sources[-1].SetFileName(file)
if not sources:
    for ring, size in ((False, 1.0), (True, 0.9)):
        sources.append(vtkSuperquadricSource())
        sources[-1].SetToroidal(ring)
        sources[-1].SetSize(0.5 * size)
        sources[-1].SetPhiRoundness(1.0 if ring else 0.2)
        sources[-1].SetThetaRoundness(1.0 if ring else 0.2)
        sources[-1].SetThetaResolution(128)
        sources[-1].SetPhiResolution(128)

# What makes the difference: a pass, and its curvature opacity.
surfaces = lt.vtkBucketedKBufferPass()
surfaces.GetCurvatureOpacityProperty().CurvatureShadingOn()
surfaces.GetCurvatureOpacityProperty().CurvatureOpacityOn()
renderer = vtkRenderer()
renderer.SetPass(surfaces)
renderer.SetBackground(1.0, 1.0, 1.0)

for source, color in zip(sources, ((0.4, 0.55, 0.85), (0.9, 0.6, 0.2)) * len(sources)):
    normals = vtkPolyDataNormals()  # curvature is the turn of the normals
    normals.SetInputConnection(source.GetOutputPort())
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(normals.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*color)
    actor.GetProperty().SetOpacity(0.4)  # less than 1: takes part
    renderer.AddActor(actor)

window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetMultiSamples(0)
window.SetSize(300, 300)
window.AddRenderer(renderer)
renderer.GetActiveCamera().SetPosition(1.0, 0.7, 2.0)
renderer.ResetCamera()
window.Render()
print(surfaces.GetNumberOfFragments(), "fragments")

if len(sys.argv) > 1:
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    writer = vtkPNGWriter()
    writer.SetInputConnection(grab.GetOutputPort())
    writer.SetFileName(sys.argv[1])
    writer.Write()
