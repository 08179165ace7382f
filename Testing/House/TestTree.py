# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""What is kept in the repository: licence lines, no large files, no machine's own paths."""

import argparse
import os
import re
import subprocess
import sys

parser = argparse.ArgumentParser()
parser.add_argument("--source", required=True)
source = parser.parse_args().source


def tracked():
    """The files in git, or, in an unpacked archive, all but the ignored folders."""
    git = ["git", "-c", "safe.directory=*", "-C", source, "ls-files", "-z"]
    try:
        listing = subprocess.run(git, check=True, capture_output=True, text=True).stdout
        return [name for name in listing.split("\0") if name]
    except (OSError, subprocess.CalledProcessError):
        pass
    ignored = {".git", "build", "gallery", "install", "__pycache__"}
    names = []
    for folder, folders, files in os.walk(source):
        folders[:] = [f for f in folders if f not in ignored]
        names += [os.path.relpath(os.path.join(folder, f), source) for f in files]
    return names


LARGEST = 1_000_000
# Folders of one machine or user, and addresses of package registries or mirrors.
# (Pieced together, so that this file passes its own test.)
FORBIDDEN = re.compile(
    r"(?<![\w.$}\"'-])/(?:" + "home|work|root|Users|mnt|scratch" + r")/\w"
    r"|" + "https?" + r"://[^\s\"')>]*(?:pypi|registry|artifactory|nexus|mirror|deb\.debian)"
    r"|\b\d{1,3}\.\d{1,3}\.\d{1,3}\.\d{1,3}\b"
)
SOURCES = re.compile(r"\.(h|cxx|py|sh|glsl|cmake|cmake\.in)$")
GENERATED = re.compile(r"(^|/)(build|gallery|install|__pycache__)/|\.(pyc|o|so|orig|rej|swp|log)$|~$")

failures = []
for name in sorted(tracked()):
    path = os.path.join(source, name)
    if not os.path.isfile(path):
        continue
    if GENERATED.search(name):
        failures.append(f"{name}: generated or left over")
    size = os.path.getsize(path)
    if size > LARGEST:
        failures.append(f"{name}: {size} bytes, more than {LARGEST}")
    with open(path, "rb") as file:
        data = file.read()
    if b"\0" in data:
        continue
    text = data.decode("utf-8", "replace")
    for number, line in enumerate(text.splitlines(), 1):
        found = FORBIDDEN.search(line)
        if found:
            failures.append(f"{name}:{number}: a path or address of one machine: {found.group()}")
    if SOURCES.search(name) and "SPDX-License-Identifier: BSD-3-Clause" not in text[:600]:
        failures.append(f"{name}: no SPDX-License-Identifier: BSD-3-Clause line")

print("\n".join(failures) or "the tree is in order")
sys.exit(1 if failures else 0)
