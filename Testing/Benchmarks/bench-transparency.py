# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws figure 2.12 of the thesis from bench-transparency -o FILE.csv:

bench-transparency.py FILE.csv FILE.png
"""

import csv
import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

with open(sys.argv[1], encoding="utf-8") as file:
    buckets = [row for row in csv.DictReader(file) if row["section"] == "buckets"]
times = {row["what"]: float(row["value"]) for row in buckets}
objects = sorted({int(what.split()[0]) for what in times if what.split()[0].isdigit()})
stages = {"geometry": "#56B4E9", "order": "#009E73", "search": "#D55E00", "blending": "#CCCCCC"}
figure, axes = pyplot.subplots(figsize=(3, 2.4), dpi=100, constrained_layout=True)
axes.stackplot(
    objects,
    [[times[f"{n} {stage}"] for n in objects] for stage in stages],
    labels=list(stages),
    colors=list(stages.values()),
)
axes.axhline(times["brute force frame"], color="black", linestyle=":", label="brute force")
axes.set_xlim(1, 32)
axes.set_ylim(0, None)
axes.set_xlabel("objects", fontsize=8)
axes.set_ylabel("ms per frame", fontsize=8)
axes.tick_params(labelsize=7)
axes.legend(fontsize=6, frameon=False, loc="upper right", bbox_to_anchor=(1.0, 0.95))
figure.savefig(sys.argv[2])
