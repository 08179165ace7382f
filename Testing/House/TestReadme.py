# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""README's Python example runs as it stands, and what README points to is there."""

import argparse
import os
import re
import subprocess
import sys

parser = argparse.ArgumentParser()
parser.add_argument("--source", required=True)
source = parser.parse_args().source

failures = []
for document in ("README.md", "CONTRIBUTING.md"):
    with open(os.path.join(source, document), encoding="utf-8") as file:
        text = file.read()
    for link in re.findall(r"\]\((?!https?:|#)([^)#]+)", text):
        if not os.path.exists(os.path.join(source, link)):
            failures.append(f"{document} points to {link}, which is not there")
    for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        done = subprocess.run([sys.executable, "-B", "-c", code], capture_output=True, text=True)
        print(done.stdout, end="")
        if done.returncode != 0 or done.stderr or not done.stdout.startswith("Converged"):
            failures.append(f"{document}: the Python example fails:\n{done.stderr}{done.stdout}")

print("\n".join(failures) or "README is right")
sys.exit(1 if failures else 0)
