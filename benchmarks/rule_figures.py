"""Figures of docs/rule.md."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from rule_intervals import pairs
from rule_tables import kind_of
from rule_truth import Case, breach, holds_energy, keeps_promise, keeps_promise_up_to_n_c

mpl.use("svg")

INK, FAINT, PAPER = "#1d2733", "#8a94a3", "#fbfbfc"
STYLE = {
    "figure.facecolor": PAPER,
    "axes.facecolor": PAPER,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "font.size": 10,
    "svg.hashsalt": "suffice",
}
COLOURS = {
    "shaken box": "#0b6e99",
    "dry mill": "#d1622b",
    "wet mill": "#7a4fa3",
    "drum": "#3f8f4f",
    "fluidised bed": "#b8a000",
}
MARKS = {"position": "o", "velocity": "x", "fluid": "^"}
MOST = 100.0  # of the ratio to what is promised; where n_lr is all modes it is infinite


def draw_all(cases: Sequence[Case], coarse: Sequence[Case], folder: Path) -> None:
    """Write rule_error.svg, rule_interval.svg and rule_threshold.svg."""
    folder.mkdir(parents=True, exist_ok=True)
    draw = {
        "rule_error": lambda ax: draw_errors(ax, cases),
        "rule_interval": lambda ax: draw_intervals(ax, cases, coarse),
        "rule_threshold": lambda ax: draw_thresholds(ax, cases),
    }
    with mpl.rc_context(STYLE):
        for name, one in draw.items():
            figure, ax = plt.subplots(figsize=(7.2, 4.4), layout="constrained")
            one(ax)
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
            plt.close(figure)


def draw_errors(ax: Axes, cases: Sequence[Case]) -> None:
    """K_f of every case against the error of the best ROM on n_lr modes, in parts of what these promise."""
    for flow, colour in COLOURS.items():
        for kind, mark in MARKS.items():
            own = [c for c in cases if c["flow"] == flow and kind_of(c) == kind and (c["K_f"] or 0.0) >= 0.02]
            ratios = [min(breach(c), MOST) for c in own]
            ax.scatter([c["K_f"] for c in own], ratios, 16, colour, mark, linewidths=1.0, alpha=0.75)
        ax.scatter([], [], 30, colour, "s", label=flow)
    for kind, mark in MARKS.items():
        ax.scatter([], [], 24, INK, mark, label=kind)
    ax.axhline(1.10, color=INK, linewidth=0.9, linestyle=":")
    ax.text(0.021, 1.13, "T1: good enough below 1.10", fontsize=9, va="bottom")
    for limit, text in ((1.0, "$K_f$ = 1"), (2.0, "$K_f$ = 2")):
        ax.axvline(limit, color=INK, linewidth=0.9, linestyle=":")
        ax.text(limit * 1.04, 60, text, fontsize=9)
    ax.set(xscale="log", yscale="log", xlim=(0.02, 20), ylim=(0.9, 110))
    ax.set(xlabel="$K_f$", ylabel="ROM error at unseen times / $E_{train}$, at $n_{lr}$")
    ax.legend(frameon=False, fontsize=9, loc="upper right")


def draw_intervals(ax: Axes, cases: Sequence[Case], coarse: Sequence[Case]) -> None:
    """Δτ that K_f = 2 (full) and K_f = 1 (open) ask for against the one at which a ROM breaks its promise."""
    ends = np.array([2.0, 30.0])
    ax.plot(ends, ends, color=INK, linewidth=0.9, linestyle=":")
    ax.plot(ends, ends / 2.5, color=FAINT, linewidth=0.9, linestyle=":")
    ax.text(26, 27.5, "as needed", fontsize=9, ha="right")
    ax.text(15, 4.6, "2.5 times finer", fontsize=9)
    for case, (two, one, true) in pairs(cases, coarse):
        colour, mark = COLOURS[case["flow"]], MARKS[kind_of(case)]
        if 0 < true < np.inf:
            for asked, face in ((two, colour), (one, "none")):
                if 0 < asked < np.inf:
                    ax.scatter(true, asked, 24, marker=mark, facecolors=face, edgecolors=colour)
    for flow, colour in COLOURS.items():
        ax.scatter([], [], 30, colour, "s", label=flow)
    ax.scatter([], [], 24, facecolors=INK, edgecolors=INK, label="$K_f$ = 2")
    ax.scatter([], [], 24, facecolors="none", edgecolors=INK, label="$K_f$ = 1")
    ticks = [2, 3, 5, 10, 20, 30]
    ax.set(xscale="log", yscale="log", xlim=(1.9, 32), ylim=(1.9, 32), xticks=ticks, yticks=ticks)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(mpl.ticker.FormatStrFormatter("%g"))
        axis.set_minor_formatter(mpl.ticker.NullFormatter())
    ax.set(xlabel="Δτ at which the ROM breaks its promise (T1), in dense intervals")
    ax.set(ylabel="Δτ at the threshold of $K_f$, in dense intervals")
    ax.legend(frameon=False, fontsize=9, loc="upper left")


def draw_thresholds(ax: Axes, cases: Sequence[Case]) -> None:
    """Shares judged wrongly against the threshold of K_f, for three truths."""
    limits = np.geomspace(0.3, 6, 80)
    scores = np.array([c["K_f"] or 0.0 for c in cases])
    truths = {"T1": (keeps_promise, "#0b6e99"), "T2": (keeps_promise_up_to_n_c, "#d1622b"), "T3": (holds_energy, FAINT)}
    for name, (truth, colour) in truths.items():
        good = np.array([truth(c) for c in cases])
        strict = [100 * np.mean(scores[good] < limit) for limit in limits]
        lenient = [100 * np.mean(scores[~good] >= limit) for limit in limits]
        ax.plot(limits, strict, color=colour, label=f"{name}: good ones rejected")
        ax.plot(limits, lenient, color=colour, linestyle="--", label=f"{name}: bad ones accepted")
    ax.axvline(2.0, color=INK, linewidth=0.9, linestyle=":")
    ax.set(xscale="log", xticks=[0.3, 0.5, 1, 2, 4], xlabel="threshold of $K_f$", ylabel="%", ylim=(0, 100))
    ax.xaxis.set_major_formatter(mpl.ticker.FormatStrFormatter("%g"))
    ax.xaxis.set_minor_formatter(mpl.ticker.NullFormatter())
    ax.legend(frameon=False, fontsize=9)
