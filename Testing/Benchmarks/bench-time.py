# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws what bench-time left in a folder: bench-time.py FOLDER.

stability.png: the thesis's figure 4.1 beside the sharp bounds; first-moment.png: its figure 3.6
beside the staggered grid, and a front.
"""

import csv
import math
import os
import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

folder = sys.argv[1]

# Okabe and Ito's colours, told apart by everyone.
BLUE, RED, GREEN, SKY, GREY = "#0072B2", "#D55E00", "#009E73", "#56B4E9", "#777777"
pyplot.rcParams.update(
    {
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "figure.constrained_layout.use": True,
        "savefig.dpi": 100,
    }
)


def table(name):
    with open(os.path.join(folder, name), newline="") as file:
        return list(csv.DictReader(file))


def save(figure, name):
    # few colours: a palette keeps the file small
    from PIL import Image

    path = os.path.join(folder, name)
    figure.savefig(path)
    with Image.open(path) as image:
        image.convert("RGB").quantize(128).save(path, optimize=True)
    print(path, os.path.getsize(path), "bytes")


rows = table("stability.csv")
alphas = sorted({float(row["alpha"]) for row in rows})
figure, axes = pyplot.subplots(1, len(alphas), figsize=(9.6, 3.9), sharey=True)
for axis, alpha in zip(axes, alphas):
    part = [row for row in rows if float(row["alpha"]) == alpha]
    beta = [float(row["beta"]) for row in part]
    curve = {name: [float(row[name] or "nan") for row in part] for name in part[0]}
    stable, positive = curve["stable"], curve["positive"]
    axis.fill_between(beta, 1e-3, stable, color=SKY, alpha=0.25, linewidth=0)
    axis.fill_between(beta, 1e-3, positive, color=SKY, alpha=0.35, linewidth=0)
    axis.plot(beta, curve["first moment"], color=GREEN, label="first moment: stable (data), never below 1")
    axis.plot(beta, stable, color=BLUE, label="diffusion stable: 6β/(36β²+1−α)")
    axis.plot(beta, positive, color=BLUE, linestyle="--", label="diffusion positive: 3β/(18β²+1−α)")
    axis.plot(beta, curve["thesis"], color=RED, linewidth=2, label="thesis, eq. 4.9")
    for name, marker in (("measured stable", "o"), ("measured positive", "s")):
        axis.plot(
            beta, curve[name], marker, color="black", ms=4, markerfacecolor="white", label=name
        )
    axis.set(xscale="log", yscale="log", xlim=(1e-2, 1), ylim=(1e-2, 60))
    axis.set(xlabel="β = D/Δ", title=f"albedo α = {alpha:g}")
    axis.grid(color="#e4e4e4", linewidth=0.5)
axes[0].set_ylabel("r = cΔt/Δ")
figure.get_layout_engine().set(rect=(0, 0.13, 1, 0.87))
figure.legend(*axes[0].get_legend_handles_labels(), loc="lower center", ncol=3, fontsize=8)
save(figure, "stability.png")

values = table("grid.csv")
n = math.isqrt(len(values))
figure, axes = pyplot.subplots(1, 3, figsize=(9.6, 3.2), width_ratios=(1, 1, 1.35))
for axis, name, title in (
    (axes[0], "collocated", "φ and E on the same points\n(thesis, eq. 3.25, 3.26)"),
    (axes[1], "staggered", "E between the points"),
):
    phi = [[float(values[i + n * j][name]) for i in range(n)] for j in range(n)]
    largest = max(abs(v) for line in phi for v in line)
    shown = axis.imshow(
        phi,
        cmap="PuOr",
        norm=matplotlib.colors.SymLogNorm(1e-3 * largest, vmin=-largest, vmax=largest, base=10),
        interpolation="nearest",
    )
    axis.set(title=title, xticks=[], yticks=[])
    figure.colorbar(shown, ax=axis, shrink=0.75, ticks=[-largest, 0, largest]).ax.set_yticklabels(
        ["−max", "0", "max"]
    )
rows = table("front.csv")
x = [float(row["x"]) for row in rows]
axis = axes[2]
for name, step, style, colour, label in (
    ("diffusion", 1, "-", GREY, "diffusion: at once everywhere"),
    ("exact", 1, "-", "black", "exact: at c/√3"),
    ("first moment", 4, "o", GREEN, "first moment"),
):
    phi = [float(row[name]) for row in rows]
    axis.plot(x[::step], phi[::step], style, color=colour, markersize=3, label=label)
axis.set(xlabel="x", ylabel="φ", ylim=(-0.01, 0.34))
axis.set_title("a pulse in 1-D, σa = σt' = 0.1, ct = 9")
axis.legend(loc="upper center", fontsize=7.5)
save(figure, "first-moment.png")
