# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""The package as such: it imports, its classes can be made and printed, and it lives without OpenGL."""

import os
import subprocess
import sys
import unittest

import lighttransport


class TestPackage(unittest.TestCase):
    def test_classes(self):
        """Every class can be made, printed and deleted, and is exported by name."""
        classes = [n for n in lighttransport.__all__ if isinstance(getattr(lighttransport, n), type)]
        self.assertIn("vtkLightDiffusionFilter", classes)
        self.assertIn("vtkLightTransportVersion", classes)
        for name in classes:
            with self.subTest(name=name):
                made = getattr(lighttransport, name)()
                self.assertEqual(made.GetClassName(), name)
                self.assertIn(name, str(made))

    def test_version(self):
        self.assertRegex(lighttransport.__version__, r"^\d+\.\d+\.\d+$")

    def test_unknown_name(self):
        with self.assertRaises(AttributeError):
            lighttransport.vtkNoSuchClass

    def test_without_opengl(self):
        """Where OpenGL cannot be loaded the filters work, and a mapper's absence is explained."""
        code = """
import sys
sys.modules["vtkmodules.vtkRenderingOpenGL2"] = None  # as an import that fails
from lighttransport import vtkLightDiffusionFilter
print(vtkLightDiffusionFilter().GetClassName())
try:
    from lighttransport import vtkLightFieldProperty
except ImportError as error:
    print(error)
"""
        done = subprocess.run(
            [sys.executable, "-B", "-c", code], capture_output=True, text=True, env=dict(os.environ)
        )
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("vtkLightDiffusionFilter", done.stdout)
        self.assertIn("OpenGL could not be loaded", done.stdout)


if __name__ == "__main__":
    # The build's options (-T, -B, -D) are not unittest's.
    unittest.main(argv=sys.argv[:1])
