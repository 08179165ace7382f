# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""An installation stands on its own: moved elsewhere, another project finds, builds and runs
against it, its Python package imports, and none of its libraries remembers the build folder."""

import argparse
import glob
import os
import shutil
import subprocess
import sys

parser = argparse.ArgumentParser()
for name in ("source", "build", "temporary", "cmake", "compiler", "libraries"):
    parser.add_argument("--" + name, required=True)
parser.add_argument("--launcher", default="")
parser.add_argument("--python-destination", required=True)
a = parser.parse_args()

root = os.path.join(a.temporary, "TestInstall")
shutil.rmtree(root, ignore_errors=True)
first, prefix = os.path.join(root, "first"), os.path.join(root, "moved here")
failures = []


def run(what, command, **environment):
    """Runs a command; its output is shown where it fails."""
    done = subprocess.run(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, **environment},
    )
    if done.returncode != 0:
        failures.append(f"{what} failed ({done.returncode}): {command}\n{done.stdout[-4000:]}")
    return done.stdout


run("install", [a.cmake, "--install", a.build, "--prefix", first])
if not failures:
    os.rename(first, prefix)
    libraries = glob.glob(os.path.join(prefix, "**", "*.so*"), recursive=True)
    for library in libraries + glob.glob(os.path.join(prefix, "bin", "*")):
        for line in run("ldd", ["ldd", library]).splitlines():
            if "not found" in line:
                failures.append(f"{library} does not find {line.strip()}")
        dynamic = subprocess.run(
            ["readelf", "-d", library], check=True, capture_output=True, text=True
        ).stdout
        if a.build in dynamic:
            failures.append(f"{library} knows the build folder:\n{dynamic}")
    for path in glob.glob(os.path.join(prefix, "**", "*.cmake"), recursive=True):
        with open(path, encoding="utf-8") as file:
            text = file.read()
        for folder in (a.build, first):
            if folder in text:
                failures.append(f"{path} names {folder}")
    headers = os.listdir(os.path.join(prefix, "include", "lighttransport"))
    for header in ("vtkLightDiffusionFilter.h", "vtkLightTransportArrays.h"):
        if header not in headers:
            failures.append(f"{header} is not installed")
    for header in ("vtkLightTransportInternal.h", "vtkLightTransportCompat.h"):
        if header in headers:
            failures.append(f"{header} is private, but installed")

# Every project that a user may build against the installation.
projects = [os.path.join(a.source, "Testing", "House", "External")]
projects += [os.path.join(a.source, "Examples", n) for n in ("Minimal", "CurvatureTransparency")]
for project in projects:
    if failures:
        break
    name = os.path.basename(project)
    build = os.path.join(root, name)
    run(
        f"configuring {name}",
        [a.cmake, "-G", "Ninja", "-S", project, "-B", build]
        + [f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_CXX_COMPILER={a.compiler}"]
        + [f"-DCMAKE_CXX_COMPILER_LAUNCHER={a.launcher}", "-DCMAKE_BUILD_TYPE=Release"],
    )
    if not failures:
        run(f"building {name}", [a.cmake, "--build", build])
    if not failures:
        program = os.path.join(build, name)
        if not os.path.isfile(program):
            failures.append(f"{name} builds no program of that name")
        else:
            print(run(f"running {name}", [program], DISPLAY="").strip())

if not failures:
    code = "import lighttransport as l; print(l.__file__, l.__version__, len(l.__all__))"
    path = os.path.join(prefix, a.python_destination)
    text = run("import", [sys.executable, "-B", "-c", code], PYTHONPATH=path, DISPLAY="")
    print(text.strip())
    if not text.startswith(prefix):
        failures.append("the Python package came from elsewhere: " + text)

print("\n".join(failures) or "the installation works")
sys.exit(1 if failures else 0)
