# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""The short examples in Python and C++ draw the same picture: TestCurvatureTransparency.py
SCRIPT PROGRAM FOLDER. In it the ring within the box keeps its colour."""

import os
import subprocess
import sys

from vtkmodules.vtkIOImage import vtkPNGReader

script, program, folder = sys.argv[1:]
pictures = []
for name, command in (("python", [sys.executable, "-B", script]), ("cxx", [program])):
    file = os.path.join(folder, f"curvature_transparency-{name}.png")
    done = subprocess.run([*command, file], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and not done.stderr, done.stderr
    assert int(done.stdout.split()[0]) > 50000, done.stdout  # box and ring, both sides
    reader = vtkPNGReader()
    reader.SetFileName(file)
    reader.Update()
    pictures.append(reader.GetOutput())


def pixel(picture, x, y):
    return [picture.GetScalarComponentAsDouble(x, y, 0, c) for c in range(3)]


width, height, _ = pictures[0].GetDimensions()
assert (width, height) == (300, 300)
orange = 0
apart = 0
for y in range(0, height, 3):
    for x in range(0, width, 3):
        one, other = pixel(pictures[0], x, y), pixel(pictures[1], x, y)
        apart = max(apart, max(abs(a - b) for a, b in zip(one, other)))
        orange += one[0] > 150 and one[0] > one[2] + 80
assert apart <= 1, apart
assert pixel(pictures[0], 2, 2) == [255, 255, 255]
assert orange > 500, orange  # of 10000: curved, so opaque, behind the box's flat and clear side
print("alike,", orange, "orange")
