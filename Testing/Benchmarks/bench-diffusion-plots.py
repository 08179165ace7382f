# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws what bench-diffusion left in a folder: bench-diffusion-plots.py FOLDER.

Each CSV that is there becomes a PNG beside it: solve, scaling, faster, floor, step, error. Rows
without a time (not run, failed) and values that are unknown are left out.
"""

import csv
import os
import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter  # noqa: E402

# Okabe and Ito's colours, told apart by everyone; one per solver in all figures.
COLOURS = {
    "lighttransport": "#0072B2",
    "lighttransport, iterating": "#56B4E9",
    "hypre PCG+PFMG": "#D55E00",
    "hypre PCG+BoomerAMG": "#E69F00",
    "Eigen CG+IC": "#009E73",
    "OpenVDB poisson": "#CC79A7",
    "200 Jacobi sweeps": "#777777",
}
MEDIUM_STYLES = ("-", "--", ":")
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


def number(text):
    """None where nothing is known."""
    return float(text) if text else None


def read(name, needed):
    """The rows that have a number in the column `needed`."""
    path = os.path.join(folder, name + ".csv")
    if not os.path.isfile(path):
        return []
    with open(path, encoding="utf-8", newline="") as file:
        return [row for row in csv.DictReader(file) if number(row[needed]) is not None]


def save(figure, name, caption, handles=()):
    """Below the axes: the legend of the figure, if it has one, and the caption."""
    inch = 1 / figure.get_figheight()
    columns = max(1, int(figure.get_figwidth() / 2.2))
    lines = -(-len(handles) // columns)
    below = (0.22 + 0.18 * lines + (0.1 if lines else 0)) * inch
    figure.get_layout_engine().set(rect=(0, below, 1, 1 - below))
    figure.text(0.01, 0.06 * inch, caption, fontsize=8, color="#444444")
    if handles:
        figure.legend(
            handles=handles, loc="lower center", bbox_to_anchor=(0.5, 0.22 * inch), ncol=columns,
            fontsize=8, borderaxespad=0, handlelength=2.5,
        )
    path = os.path.join(folder, name + ".png")
    figure.savefig(path)
    pyplot.close(figure)
    print(path)


def unique(rows, key):
    return list(dict.fromkeys(row[key] for row in rows))


def where(rows, **wanted):
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def threads_of(count):
    return f"{count} thread" + ("" if int(count) == 1 else "s")


def size_axis(axis, rows):
    sizes = sorted({int(row["size"]) for row in rows})
    axis.set_xscale("log")
    axis.set_xlim(sizes[0] / 1.15, sizes[-1] * 1.15)
    axis.set_xticks(sizes, [f"{size}³" for size in sizes], fontsize=8)
    axis.set_xticks([], minor=True)
    axis.set_xlabel("voxels")


def plain_numbers(axis):
    """1e-3 as 0.001: times are read, not orders of magnitude."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def solve():
    """Seconds against size, a panel per medium."""
    rows = read("solve", "seconds")
    if not rows:
        return
    media = unique(rows, "medium")
    figure, axes = pyplot.subplots(
        1, len(media), figsize=(4.2 * len(media), 4.9), sharey=True, squeeze=False
    )
    counts = sorted(unique(rows, "threads"), key=int)
    styles = dict(zip(counts[::-1], ("-", "--", ":")))
    for axis, medium in zip(axes[0], media):
        here = where(rows, medium=medium)
        for solver in unique(here, "solver"):
            for count in unique(where(here, solver=solver), "threads"):
                line = where(here, solver=solver, threads=count)
                y = [float(r["seconds"]) for r in line]
                spread = [
                    [max(0, s - float(r["seconds_min"])) for s, r in zip(y, line)],
                    [max(0, float(r["seconds_max"]) - s) for s, r in zip(y, line)],
                ]
                axis.errorbar(
                    [int(r["size"]) for r in line],
                    y,
                    spread,
                    color=COLOURS.get(solver, "black"),
                    linestyle=styles[count],
                    marker="o",
                    markersize=3.5,
                    linewidth=1.4,
                    elinewidth=0.7,
                )
        size_axis(axis, rows)
        axis.set_yscale("log")
        plain_numbers(axis.yaxis)
        axis.set_title(medium, fontsize=9)
    axes[0][0].set_ylabel("set-up + solve, s")
    handles = [
        Line2D([], [], color=COLOURS.get(solver, "black"), label=solver)
        for solver in unique(rows, "solver")
    ] + [Line2D([], [], color="black", linestyle=styles[c], label=threads_of(c)) for c in counts]
    save(
        figure, "solve", "Steady solve from fresh memory: medians, bars from least to most.", handles
    )


def scaling():
    """What should be flat: time per voxel, iterations, fine-grid applications."""
    solvers = ("lighttransport", "hypre PCG+PFMG")
    rows = [r for r in read("solve", "seconds") if r["solver"] in solvers]
    if not rows:
        return
    most = max(unique(rows, "threads"), key=int)
    rows = where(rows, threads=most)
    media = unique(rows, "medium")
    figure, axes = pyplot.subplots(1, 3, figsize=(11, 4.2))
    panels = (
        ("ns per voxel, in a heap left by a solve", lambda r: number(r["again"]) and
         1e9 * number(r["again"]) / int(r["size"]) ** 3),
        ("iterations", lambda r: number(r["iterations"])),
        ("fine-grid operator applications", lambda r: number(r["applications"])),
    )
    for axis, (label, value) in zip(axes, panels):
        for solver in unique(rows, "solver"):
            for medium, style in zip(media, MEDIUM_STYLES):
                line = [r for r in where(rows, solver=solver, medium=medium) if value(r) is not None]
                axis.plot(
                    [int(r["size"]) for r in line], [value(r) for r in line], style,
                    color=COLOURS[solver], marker="o", markersize=3.5,
                )
        size_axis(axis, rows)
        axis.set_ylim(bottom=0)
        axis.yaxis.set_major_locator(MaxNLocator(integer=True))
        axis.set_title(label, fontsize=9)
    axes[2].axhline(13, color="black", linewidth=0.8)
    axes[2].annotate(
        "13: HPGMG's full multigrid", (0.02, 13), xycoords=("axes fraction", "data"), va="bottom",
        fontsize=7,
    )
    handles = [
        Line2D([], [], color=COLOURS[solver], label=solver) for solver in unique(rows, "solver")
    ] + [Line2D([], [], color="black", linestyle=s, label=m) for m, s in zip(media, MEDIUM_STYLES)]
    save(figure, "scaling", f"What should be flat, on {threads_of(most)} (hypre: ranks).", handles)


def faster():
    """How many times faster than hypre."""
    rows = read("summary", "times_faster")
    if not rows:
        return
    media, counts = unique(rows, "medium"), sorted(unique(rows, "threads"), key=int)
    figure, axes = pyplot.subplots(
        1, len(media), figsize=(4.2 * len(media), 3.9), sharey=True, squeeze=False
    )
    styles = dict(zip(counts[::-1], ("-", "--", ":")))
    kinds = {
        "times_faster": ("#0072B2", "first, in fresh memory"),
        "again_times_faster": ("#009E73", "again, in a heap left by a solve"),
    }
    for axis, medium in zip(axes[0], media):
        for count in counts:
            line = where(rows, medium=medium, threads=count)
            for kind, (colour, _) in kinds.items():
                axis.plot(
                    [int(r["size"]) for r in line], [number(r[kind]) for r in line], styles[count],
                    color=colour, marker="o", markersize=3.5,
                )
        axis.axhline(3, color="black", linewidth=0.8)
        axis.annotate(
            "aim: 3", (0.01, 3), xycoords=("axes fraction", "data"), va="bottom", fontsize=7
        )
        size_axis(axis, rows)
        axis.set_title(medium, fontsize=9)
    axes[0][0].set_ylim(bottom=0)
    axes[0][0].set_ylabel("times faster than hypre PCG+PFMG")
    handles = [Line2D([], [], color=colour, label=label) for colour, label in kinds.values()] + [
        Line2D([], [], color="black", linestyle=styles[c], label=threads_of(c)) for c in counts
    ]
    save(
        figure, "faster", "Medians of each repeat's quotient; hypre's best number of ranks.", handles
    )


def floor():
    """Bandwidth of the sweeps beside the triad's."""
    rows = read("floor", "gb_per_s")
    if not rows:
        return
    labels = [
        r["kind"] + (f", {r['size']}³" if r["size"] else "") + f", {threads_of(r['threads'])}"
        for r in rows
    ]
    values = [float(r["gb_per_s"]) for r in rows]
    figure, axis = pyplot.subplots(figsize=(7, 0.3 * len(rows) + 1.1))
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
    axis.set_xlabel("bytes that must move, GB/s")
    save(figure, "floor", "In brackets: per cent of STREAM's triad on as many threads, same run.")


def step():
    """One explicit step beside table 4.1."""
    rows = read("step", "seconds")
    if not rows:
        return
    figure, axis = pyplot.subplots(figsize=(5, 3.8))
    axis.plot(
        [int(r["size"]) for r in rows],
        [1e3 * float(r["seconds"]) for r in rows],
        "o-",
        color="#0072B2",
        label=f"here, {threads_of(rows[0]['threads'])} of a CPU (1024³ extrapolated)",
    )
    thesis = [r for r in rows if number(r["thesis_overhead_ms"])]
    axis.plot(
        [int(r["size"]) for r in thesis],
        [float(r["thesis_overhead_ms"]) for r in thesis],
        "s--",
        color="#777777",
        label="source thesis, table 4.1 (Quadro M5000M)",
    )
    size_axis(axis, rows)
    axis.set_yscale("log")
    plain_numbers(axis.yaxis)
    axis.set_ylabel("ms")
    axis.legend(fontsize=8)
    save(figure, "step", "One explicit step of the whole volume.")


def error():
    """Error against time; each point is a tolerance."""
    rows = read("error", "seconds")
    if not rows:
        return
    media = unique(rows, "medium")
    knobs = unique(rows, "knob")
    colours = dict(zip(knobs, ("#0072B2", "#D55E00", "#009E73", "#CC79A7")))
    kinds = {"p95": ("-", "95th percentile"), "relative_l2": ("--", "relative L2")}
    figure, axes = pyplot.subplots(
        1, len(media), figsize=(4.6 * len(media), 4.4), sharey=True, sharex=True, squeeze=False
    )
    for axis, medium in zip(axes[0], media):
        for knob in knobs:
            line = where(rows, medium=medium, knob=knob)
            x = [1e3 * float(r["seconds"]) for r in line]
            for kind, (style, _) in kinds.items():
                axis.plot(
                    x, [number(r[kind]) for r in line], style, color=colours[knob], marker="o",
                    markersize=3,
                )
            for r, ms in list(zip(line, x))[:: max(1, len(line) - 1)]:
                axis.annotate(
                    f"{float(r['value']):.0e}", (ms, float(r["p95"])), fontsize=7,
                    xytext=(4, 4), textcoords="offset points", color=colours[knob],
                )
        axis.set_xscale("log")
        axis.set_yscale("log")
        low, high = axis.get_xlim()
        ticks = [t for t in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)
                 if low <= t <= high]
        axis.set_xticks(ticks)
        plain_numbers(axis.xaxis)
        axis.set_xlabel("set-up + solve, ms")
        axis.set_title(medium, fontsize=9)
    axes[0][0].set_ylabel("error")
    handles = [Line2D([], [], color=colours[knob], label=knob) for knob in knobs] + [
        Line2D([], [], color="black", linestyle=s, label=text) for s, text in kinds.values()
    ]
    save(
        figure, "error",
        f"{rows[0]['size']}³, {threads_of(rows[0]['threads'])}; the first and the last tolerance "
        "stand beside their points.",
        handles,
    )


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    folder = sys.argv[1]
    solve()
    scaling()
    faster()
    floor()
    step()
    error()
