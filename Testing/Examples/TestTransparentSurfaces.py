# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""The gallery's car, which needs no data: TestTransparentSurfaces.py SCRIPT FOLDER. What is inside
keeps its colour under opacity by curvature, and the transfer functions lie below each view."""

import os
import subprocess
import sys

from vtkmodules.vtkIOImage import vtkPNGReader

script, folder = sys.argv[1:]
SIZE = 150
command = [sys.executable, "-B", script, "--size", str(SIZE), "--data", folder, folder]
done = subprocess.run(command, capture_output=True, text=True, check=False)
assert done.returncode == 0 and not done.stderr, done.stderr
assert "car: " in done.stdout and " 0 merged" in done.stdout, done.stdout
assert "head: left out, without mr_head.nii.gz" in done.stdout, done.stdout
reader = vtkPNGReader()
reader.SetFileName(os.path.join(folder, "car.png"))
reader.Update()
picture = reader.GetOutput()
strip = SIZE // 3
assert picture.GetDimensions() == (3 * SIZE, SIZE + strip, 1), picture.GetDimensions()


def pixel(x, y):
    return [picture.GetScalarComponentAsDouble(x, y, 0, c) for c in range(3)]


warm = []  # seats, exhaust, pistons, springs
for panel in range(3):
    columns = range(panel * SIZE, (panel + 1) * SIZE)
    pixels = [pixel(x, y) for x in columns for y in range(strip, SIZE + strip)]
    warm.append(sum(red > blue + 60 for red, _, blue in pixels))
print("warm pixels:", warm)
assert warm[2] > 200 and warm[2] > 2 * warm[0], warm

# The squares of opacity: 0.4 everywhere, and rising with curvature from 0.05 to 0.95.
left, low, side = SIZE // 20, 5 * 8 // 2, 2 * SIZE // 9
y = low + side // 2
for panel in range(2):
    for x in (left + 3, left + side - 3):
        assert abs(pixel(panel * SIZE + x, y)[0] - 0.4 * 255) < 2, (panel, x)
assert pixel(2 * SIZE + left + 2, y)[0] < 60 and pixel(2 * SIZE + left + side - 3, y)[0] > 235
