# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Makes the documents' figures from the demo's pictures:

bash Examples/demo.sh && /usr/bin/python3 Module/Documentation/figures.py
"""

import os

from vtkmodules.vtkImagingCore import vtkImageResize
from vtkmodules.vtkIOImage import vtkPNGReader, vtkPNGWriter

LARGEST = 300
FIGURES = {
    "1-head": "head",
    "2-ventricle": "ventricle",
    "3-ventricle-slices": "slices",
    "5-too-much-absorption": "too-much-absorption",
    "6-leak": "leak",
    "7-dam": "dam",
    "8-painted": "painted",
    "9-flux-direction": "flux-direction",
    "11-anisotropic": "anisotropic",
}

here = os.path.dirname(os.path.abspath(__file__))
gallery = os.path.join(here, "..", "..", "gallery")
folder = os.path.join(here, "figures")
os.makedirs(folder, exist_ok=True)
for source, name in FIGURES.items():
    reader = vtkPNGReader()
    reader.SetFileName(os.path.join(gallery, source + ".png"))
    reader.Update()
    x, y, _ = reader.GetOutput().GetDimensions()
    scale = LARGEST / max(x, y)
    resize = vtkImageResize()  # averages when it makes smaller
    resize.SetInputConnection(reader.GetOutputPort())
    resize.SetResizeMethodToOutputDimensions()
    resize.SetOutputDimensions(round(x * scale), round(y * scale), 1)
    writer = vtkPNGWriter()
    writer.SetInputConnection(resize.GetOutputPort())
    writer.SetFileName(os.path.join(folder, name + ".png"))
    writer.Write()
    print(os.path.relpath(writer.GetFileName()))
