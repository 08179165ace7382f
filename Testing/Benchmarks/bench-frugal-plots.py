#!/usr/bin/env python3
# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws what bench-frugal measured: bench-frugal-plots.py FOLDER

frugal-knobs.png   error against time, a line per knob
frugal-target.png  the estimate against the true error, a point per scene and target
"""
import csv
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.ticker import NullFormatter  # noqa: E402


def read(folder, name):
    path = os.path.join(folder, name + ".csv")
    if not os.path.exists(path):
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def draw_knobs(folder):
    rows = read(folder, "frugal-knobs")
    scenes = sorted({row["scene"] for row in rows})
    if not scenes:
        return
    figure, axes = plt.subplots(1, len(scenes), figsize=(3.4 * len(scenes), 3.6), sharey=True)
    axes = [axes] if len(scenes) == 1 else axes
    times = [1e3 * float(row["seconds"]) for row in rows]
    for axis, scene in zip(axes, scenes):
        for knob in sorted({row["knob"] for row in rows}):
            if knob in ("OutputPrecision", "ComputeFlux"):
                continue
            points = [row for row in rows if row["scene"] == scene and row["knob"] == knob]
            axis.loglog(
                [1e3 * float(row["seconds"]) for row in points],
                [max(float(row["p95"]), 1e-8) for row in points],
                marker="o", markersize=3, linewidth=1, label=knob)
        axis.set_title(scene, fontsize=8)
        ticks = [t for t in (1, 3, 10, 30, 100, 300, 1000, 3000) if min(times) < t < max(times)]
        axis.set_xticks(ticks, [str(tick) for tick in ticks])
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_xlabel("whole Update(), ms", fontsize=8)
        axis.tick_params(labelsize=7)
        axis.grid(True, which="major", linewidth=0.3)
    axes[0].set_ylabel("95th percentile of the relative error", fontsize=8)
    lines, names = axes[0].get_legend_handles_labels()
    figure.legend(lines, names, loc="lower center", bbox_to_anchor=(0.5, 0.05), ncol=3, fontsize=7,
                  frameon=False)
    size = round(float(rows[0]["voxels"]) ** (1 / 3))
    figure.text(0.01, 0.01, f"Each point a value of the knob; {size}³ voxels, two threads.",
                fontsize=7)
    figure.tight_layout(rect=(0, 0.15, 1, 1))
    figure.savefig(os.path.join(folder, "frugal-knobs.png"), dpi=90)


def draw_targets(folder):
    rows = read(folder, "frugal-target")
    if not rows:
        return
    figure, axis = plt.subplots(figsize=(3.3, 3.2))
    true = [max(float(row["p95"]), 1e-6) for row in rows]
    told = [max(float(row["estimated"]), 1e-6) for row in rows]
    axis.loglog(true, told, "k.", markersize=3)
    ends = [min(true + told), max(true + told)]
    for factor, style in ((1.0, "-"), (3.0, ":"), (1 / 3.0, ":")):
        axis.loglog(ends, [factor * end for end in ends], style, color="gray", linewidth=0.8)
    axis.set_xlabel("true error (95th percentile)", fontsize=8)
    axis.set_ylabel("estimated", fontsize=8)
    axis.tick_params(labelsize=7)
    figure.tight_layout()
    figure.savefig(os.path.join(folder, "frugal-target.png"), dpi=90)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    draw_knobs(sys.argv[1])
    draw_targets(sys.argv[1])
