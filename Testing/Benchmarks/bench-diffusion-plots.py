# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws what bench-diffusion left in a folder: bench-diffusion-plots.py FOLDER.

Each CSV that is there becomes a PNG beside it: solve, scaling, floor, step, error.
"""

import csv
import os
import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

folder = sys.argv[1]

# Okabe and Ito's colours, told apart by everyone; one per solver in all figures.
COLOURS = {
    "lighttransport": "#0072B2",
    "hypre PCG+PFMG": "#D55E00",
    "hypre PCG+BoomerAMG": "#E69F00",
    "Eigen CG+IC": "#009E73",
    "OpenVDB poisson": "#CC79A7",
    "200 Jacobi sweeps": "#777777",
}
pyplot.rcParams.update(
    {
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": "#dddddd",
        "legend.frameon": False,
        "figure.constrained_layout.use": True,
        "savefig.dpi": 130,
    }
)


def read(name):
    path = os.path.join(folder, name + ".csv")
    if not os.path.isfile(path):
        return []
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def save(figure, name):
    figure.savefig(os.path.join(folder, name + ".png"))
    pyplot.close(figure)
    print(os.path.join(folder, name + ".png"))


def unique(rows, key):
    return list(dict.fromkeys(row[key] for row in rows))


def sizes_axis(axis, sizes):
    sizes = sorted({int(size) for size in sizes})
    axis.set_xscale("log")
    axis.set_xticks(sizes, [f"{size}³" for size in sizes])
    axis.set_xticks([], minor=True)
    axis.set_xlabel("voxels")


def solve():
    """Seconds against size, a panel per medium."""
    rows = read("solve")
    if not rows:
        return
    media = unique(rows, "medium")
    figure, axes = pyplot.subplots(
        1, len(media), figsize=(4.2 * len(media), 4), sharey=True, squeeze=False
    )
    for axis, medium in zip(axes[0], media):
        here = [row for row in rows if row["medium"] == medium]
        for solver in unique(here, "solver"):
            for threads in unique([row for row in here if row["solver"] == solver], "threads"):
                line = [r for r in here if r["solver"] == solver and r["threads"] == threads]
                x = [int(r["size"]) for r in line]
                y = [float(r["seconds"]) for r in line]
                spread = [
                    [max(0, s - float(r["seconds_min"])) for s, r in zip(y, line)],
                    [max(0, float(r["seconds_max"]) - s) for s, r in zip(y, line)],
                ]
                axis.errorbar(
                    x,
                    y,
                    spread,
                    color=COLOURS.get(solver, "black"),
                    linestyle="--" if threads == "1" else "-",
                    marker="o",
                    markersize=3.5,
                    linewidth=1.4,
                    elinewidth=0.7,
                    label=f"{solver}, {threads}",
                )
        sizes_axis(axis, [row["size"] for row in here])
        axis.set_yscale("log")
        axis.set_title(medium, fontsize=9)
        axis.legend(fontsize=7, title="solver, threads", title_fontsize=7)
    axes[0][0].set_ylabel("set-up + solve, s (median; bars: least to most)")
    save(figure, "solve")


def scaling():
    """What should be flat: time per voxel, iterations, fine-grid applications."""
    rows = [r for r in read("solve") if r["solver"] in ("lighttransport", "hypre PCG+PFMG")]
    if not rows:
        return
    threads = max(int(row["threads"]) for row in rows)
    figure, axes = pyplot.subplots(
        1, 4, figsize=(13, 3.4), gridspec_kw={"width_ratios": (4, 4, 4, 2.6)}
    )
    panels = [
        ("ns per voxel", lambda r: 1e9 * float(r["seconds"]) / int(r["size"]) ** 3),
        ("iterations", lambda r: float(r["iterations"])),
        ("fine-grid operator applications", lambda r: float(r["applications"])),
    ]
    for axis, (label, value) in zip(axes, panels):
        for solver in unique(rows, "solver"):
            for medium, style in zip(unique(rows, "medium"), ("-", "--", ":")):
                line = [
                    r
                    for r in rows
                    if (r["solver"], r["medium"], int(r["threads"])) == (solver, medium, threads)
                    and value(r) >= 0
                ]
                if line:
                    axis.plot(
                        [int(r["size"]) for r in line],
                        [value(r) for r in line],
                        style,
                        color=COLOURS[solver],
                        marker="o",
                        markersize=3.5,
                        label=f"{solver}: {medium}",
                    )
        sizes_axis(axis, [row["size"] for row in rows])
        axis.set_ylim(bottom=0)
        axis.set_ylabel(label)
    axes[2].axhline(13, color="black", linewidth=0.8)
    axes[2].annotate(
        "13 (HPGMG)", (0.02, 13), xycoords=("axes fraction", "data"), va="bottom", fontsize=7
    )
    lines, labels = axes[0].get_legend_handles_labels()
    axes[3].axis("off")
    axes[3].legend(
        lines, labels, fontsize=7, handlelength=3.5, loc="center left", title=f"{threads} threads", title_fontsize=7
    )
    save(figure, "scaling")


def floor():
    """Bandwidth of the sweeps beside the triad's."""
    rows = read("floor")
    if not rows:
        return
    labels = [
        f"{r['kind']}{', ' + r['size'] + '³' if r['size'] else ''}, {r['threads']} thr." for r in rows
    ]
    values = [float(r["gb_per_s"]) for r in rows]
    figure, axis = pyplot.subplots(figsize=(7, 0.34 * len(rows) + 1))
    bars = axis.barh(
        labels, values, color=["#999999" if r["kind"] == "triad" else "#0072B2" for r in rows]
    )
    axis.bar_label(
        bars, [f"{v:.1f} ({float(r['percent_of_triad']):.0f} %)" for v, r in zip(values, rows)],
        fontsize=7, padding=3,
    )
    axis.margins(x=0.18)
    axis.invert_yaxis()
    axis.grid(axis="y", visible=False)
    axis.set_xlabel("GB/s that must move (percent of the triad on as many threads)")
    save(figure, "floor")


def step():
    """One explicit step beside table 4.1."""
    rows = read("step")
    if not rows:
        return
    figure, axis = pyplot.subplots(figsize=(5, 3.6))
    axis.plot(
        [int(r["size"]) for r in rows],
        [1e3 * float(r["seconds"]) for r in rows],
        "o-",
        color="#0072B2",
        label=f"here, {rows[0]['threads']} CPU threads (1024³ extrapolated)",
    )
    thesis = [r for r in rows if float(r["thesis_overhead_ms"]) > 0]
    axis.plot(
        [int(r["size"]) for r in thesis],
        [float(r["thesis_overhead_ms"]) for r in thesis],
        "s--",
        color="#777777",
        label="source thesis, table 4.1 (Quadro M5000M)",
    )
    sizes_axis(axis, [r["size"] for r in rows])
    axis.set_yscale("log")
    axis.set_ylabel("one explicit step, ms")
    axis.legend(fontsize=7)
    save(figure, "step")


def error():
    """Error against time; each point is a value of a knob."""
    rows = read("error")
    if not rows:
        return
    media = unique(rows, "medium")
    figure, axes = pyplot.subplots(
        1, len(media), figsize=(5 * len(media), 4.2), sharey=True, squeeze=False
    )
    for axis, medium in zip(axes[0], media):
        here = [row for row in rows if row["medium"] == medium]
        for knob, colour in zip(unique(here, "knob"), ("#0072B2", "#D55E00", "#009E73", "#CC79A7")):
            line = [row for row in here if row["knob"] == knob]
            x = [float(r["seconds"]) for r in line]
            axis.plot(
                x, [float(r["p95"]) for r in line], "o-", color=colour, markersize=3.5,
                label=f"{knob}: 95th percentile",
            )
            axis.plot(
                x, [float(r["relative_l2"]) for r in line], "s--", color=colour, markersize=3,
                linewidth=1, label=f"{knob}: relative L2",
            )
            for r, seconds in zip(line, x):
                axis.annotate(
                    f"{float(r['value']):.0e}", (seconds, float(r["p95"])), fontsize=6,
                    xytext=(3, 3), textcoords="offset points", color=colour,
                )
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("set-up + solve, s")
        axis.set_title(f"{medium}, {here[0]['size']}³, {here[0]['threads']} threads", fontsize=9)
        axis.legend(fontsize=7)
    axes[0][0].set_ylabel("error")
    save(figure, "error")


solve()
scaling()
floor()
step()
error()
