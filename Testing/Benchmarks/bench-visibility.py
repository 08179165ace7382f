# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws what bench-visibility left in a folder: bench-visibility.py FOLDER.

visibility-trade.png: the error of v against the number of directions, by order;
visibility-edge.png: the width of a shadow's edge by distance.
"""

import csv
import os
import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

folder = sys.argv[1]

# Okabe and Ito's colours, told apart by everyone.
COLOURS = ["#777777", "#56B4E9", "#0072B2", "#009E73", "#D55E00"]
pyplot.rcParams.update(
    {
        "font.size": 8,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "figure.constrained_layout.use": True,
        "savefig.dpi": 100,
    }
)


def table(name):
    path = os.path.join(folder, name)
    if not os.path.exists(path):
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def save(figure, name):
    # few colours: a palette keeps the file small
    from PIL import Image

    path = os.path.join(folder, name)
    figure.savefig(path)
    with Image.open(path) as image:
        image.convert("RGB").quantize(64).save(path, optimize=True)
    print(path, os.path.getsize(path), "bytes")


rows = [row for row in table("visibility-errors.csv") if row["factor"] == "1"]
for scene in ("head, translucent", "checkerboard"):
    part = [row for row in rows if row["scene"] == scene]
    if part:
        break
if rows:
    figure, axis = pyplot.subplots(figsize=(3, 2.6))
    for order in range(5):
        line = [row for row in part if row["order"] == str(order)]
        x = [int(row["directions"]) for row in line]
        axis.plot(
            x, [float(row["raw mean"]) for row in line], "o-", color=COLOURS[order], markersize=3
        )
        axis.plot(
            x, [float(row["window mean"]) for row in line], ":", color=COLOURS[order], linewidth=1
        )
        axis.annotate(
            f" {order}", (x[-1], float(line[-1]["raw mean"])), color=COLOURS[order], va="center"
        )
    axis.set_xscale("log", base=2)
    axis.set_xticks([16, 32, 64, 144], ["16", "32", "64", "144"])
    axis.minorticks_off()
    axis.set_ylim(0, None)
    axis.set_xlabel("directions")
    axis.set_title(f"mean error of v by order, {scene}\nraw (lines), windowed (dots)", fontsize=8)
    save(figure, "visibility-trade.png")

rows = table("visibility-edge.csv")
if rows:
    figure, axis = pyplot.subplots(figsize=(3, 2.6))
    x = [float(row["distance"]) for row in rows]
    for name, label, colour in (
        ("short", "short characteristics", COLOURS[4]),
        ("sheared", "sheared lattice", COLOURS[2]),
    ):
        axis.plot(x, [float(row[name]) for row in rows], "o-", color=colour, markersize=3, label=label)
    axis.set_ylim(0, None)
    axis.set_xlabel("distance from the occluder, voxels")
    axis.set_title("width of a shadow's edge, voxels", fontsize=8)
    axis.legend()
    save(figure, "visibility-edge.png")
