# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""README's Python example runs as it stands, and what it and the documents point to is there:
files, tests and their functions."""

import argparse
import glob
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

tests = {}
for file in glob.glob(os.path.join(source, "Testing", "*", "Test*")):
    with open(file, encoding="utf-8") as text:
        tests[os.path.splitext(os.path.basename(file))[0]] = text.read()
pages = os.path.join(source, "Module", "Documentation", "**", "*.md")
for document in glob.glob(pages, recursive=True):
    name = os.path.relpath(document, source)
    with open(document, encoding="utf-8") as file:
        text = file.read()
    for link in re.findall(r"\]\((?!https?:|#)([^)#]+)", text):
        if not os.path.exists(os.path.join(os.path.dirname(document), link)):
            failures.append(f"{name} points to {link}, which is not there")
    for test, functions in re.findall(r"\b(Test[A-Z]\w+)`?(?: \(([^)]*)\))?", text):
        if test not in tests:
            failures.append(f"{name} names {test}, which is not there")
            continue
        for function in re.findall(r"^\w+(?:, \w+)*$", functions):
            for one in function.split(", "):
                if not re.search(rf"\b{one}\(", tests[test]):
                    failures.append(f"{name}: {test} has no function {one}")

print("\n".join(failures) or "README and the documents are right")
sys.exit(1 if failures else 0)
