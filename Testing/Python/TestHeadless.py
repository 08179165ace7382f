# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Importing the package without a DISPLAY is all that a plain vtkRenderWindow needs."""

import os
import pathlib
import shutil
import subprocess
import sys
import unittest

IN_XVFB = pathlib.Path(__file__).parents[1] / "Support" / "in-xvfb.sh"

CODE = """
import lighttransport
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
renderer = vtkRenderer()
renderer.SetBackground(1, 0, 0)
window = vtkRenderWindow()
window.AddRenderer(renderer)
window.SetSize(20, 10)
window.Render()
pixels = vtkUnsignedCharArray()
window.GetPixelData(0, 0, 19, 9, 1, pixels, 0)
print(window.GetClassName(), pixels.GetTuple(0), pixels.GetNumberOfTuples())
print(lighttransport.vtkLightTransportEGLRenderWindow.IsAvailable())
"""


def run(environment, prefix=()):
    return subprocess.run(
        [*prefix, sys.executable, "-B", "-c", CODE], capture_output=True, text=True, env=environment
    )


class TestHeadless(unittest.TestCase):
    def setUp(self):
        self.environment = {k: v for k, v in os.environ.items() if k != "DISPLAY"}

    def test_egl(self):
        done = run(self.environment)
        self.assertEqual(done.returncode, 0, done.stderr)
        if "False" in done.stdout:
            self.skipTest("no EGL here")
        self.assertIn(
            "vtkLightTransportEGLRenderWindow (255.0, 0.0, 0.0) 200", done.stdout, done.stderr
        )
        self.assertNotIn("ERR", done.stderr)

    def test_neither(self):
        """One error, black pixels, exit code 0: no abort."""
        done = run(dict(self.environment, __EGL_VENDOR_LIBRARY_FILENAMES="/nonexistent"))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("vtkLightTransportEGLRenderWindow (0.0, 0.0, 0.0) 200", done.stdout)
        self.assertEqual(done.stderr.count("ERR"), 1, done.stderr)
        self.assertIn("No OpenGL without a display", done.stderr)

    @unittest.skipUnless(shutil.which("Xvfb"), "no Xvfb here")
    def test_display(self):
        """With a DISPLAY nothing changes."""
        done = run(self.environment, ("sh", IN_XVFB))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("vtkXOpenGLRenderWindow (255.0, 0.0, 0.0) 200", done.stdout, done.stderr)


if __name__ == "__main__":
    # The build's options (-T, -B, -D) are not unittest's.
    unittest.main(argv=sys.argv[:1])
