# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Every public class says what it is, and is in the Python package."""

import argparse
import os
import re
import sys

import lighttransport

parser = argparse.ArgumentParser()
parser.add_argument("--source", required=True)
source = parser.parse_args().source

failures = []
count = 0
for room in ("Filters", "Rendering", "Module"):
    with open(os.path.join(source, room, "CMakeLists.txt"), encoding="utf-8") as file:
        text = file.read()
    lists = re.findall(r"(?:set\s*\(classes|CLASSES)\s+([^)$]*?)(?=[)$]|\n\s*[A-Z_]{4,})", text)
    classes = sorted(set(re.findall(r"\bvtk\w+", " ".join(lists))))
    if not classes:
        failures.append(f"{room}: no classes found in its CMakeLists.txt")
    for name in classes:
        count += 1
        with open(os.path.join(source, room, name + ".h"), encoding="utf-8") as file:
            header = file.read()
        if not re.search(r"@class\s+" + name + r"\b", header) or "@brief" not in header:
            failures.append(f"{room}/{name}.h: no @class {name} with @brief")
        wrapped = getattr(lighttransport, name, None)
        if wrapped is None:
            failures.append(f"{name}: not in the Python package")
        elif not (wrapped.__doc__ or "").strip():
            failures.append(f"{name}: no documentation in Python")

print("\n".join(failures) or f"{count} classes are documented and in the Python package")
sys.exit(1 if failures else 0)
