# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""The filters' library loads where there is no OpenGL: nothing of it in what it needs."""

import argparse
import re
import subprocess
import sys

parser = argparse.ArgumentParser()
parser.add_argument("--library", required=True)
parser.add_argument("--control", required=True)
arguments = parser.parse_args()

graphics = re.compile(r"lib(GL|OpenGL|GLX|EGL|GLEW|GLdispatch|X11|Xext|xcb)[-.\d]*\.so|Rendering")


def needed(library):
    """All libraries that the loader takes for this one, direct or not."""
    text = subprocess.run(["ldd", library], check=True, capture_output=True, text=True).stdout
    return [line.split()[0] for line in text.splitlines() if line.strip()]


found = [name for name in needed(arguments.library) if graphics.search(name)]
# The same question to a library that does need OpenGL shows that it can find something.
control = [name for name in needed(arguments.control) if graphics.search(name)]
if found:
    print("libvtkLightTransportFilters needs", ", ".join(found))
if not control:
    print("the check is blind: no OpenGL found in what", arguments.control, "needs")
sys.exit(1 if found or not control else 0)
