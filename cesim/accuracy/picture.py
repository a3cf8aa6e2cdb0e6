"""A report as a picture: error against time, log-log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..plots import COLORS, DARK, new_figure
from .report import OWN, Point, Report, wall_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = {"step": "o", "tolerance": "s", "solver": "D", "law": "^", "field": "v", "shape": "P", "effects": "X"}
NAMED = 0.1  # of the error, that a setting changes at least whose name is written
HALVINGS = 4  # of the run's length, that the line of the sampling error is drawn back


def draw_report(report: Report, path: Path | None = None) -> Figure:
    """Error of each setting against its wall time, with the sampling error of the scene as it is as a band.

    Settings that change nothing that could be resolved are drawn hollow, with an arrow, at the end of the interval of
    their change: it is at most that. Failures stand at the upper edge.
    """
    figure = new_figure((7.5, 5.0), on_screen=path is None)
    ax = figure.subplots()
    scale, unit = (1e3, " [mm]") if report.quantity.unit == "m" else (1.0, "")
    _sampling(report, ax, scale)
    knobs = [knob for knob in MARKS if any(point.knob == knob for point in report.points)]
    for i, knob in enumerate(knobs):
        points = [point for point in report.points if point.knob == knob and not point.failure]
        if knob == "step":
            points = sorted([report.own, *points], key=lambda point: point.wall)
            ladder = ([p.wall for p in points], [scale * abs(p.error) for p in points])
            ax.plot(*ladder, color=COLORS[i % len(COLORS)], lw=1)
        for point in points:
            _mark(ax, point, scale, MARKS[knob], COLORS[i % len(COLORS)])
        ax.plot([], [], MARKS[knob], color=COLORS[i % len(COLORS)], label=knob)
    _mark(ax, report.own, scale, "*", "black", size=13)
    ax.plot([], [], "*", color="black", ms=11, label="the scene as it is")
    ax.set_xscale("log")
    ax.set_yscale("log")
    failures = [point for point in report.points if point.failure]
    if failures:
        where = ax.get_xlim()[0]
        names = ", ".join(f"{point.knob} {point.label}" for point in failures)
        ax.annotate(
            f"failed: {names}",
            (where, 1.0),
            (4, -4),
            xycoords=("data", "axes fraction"),
            color="#b00020",
            textcoords="offset points",
            va="top",
            fontsize=8,
        )
    ax.set_xlabel(f"wall time [s] of {report.own.simulated:.3g} s simulated")
    ax.set_ylabel(f"error of {report.quantity.name}{unit}")
    ax.grid(True, which="both", color="#e4e7ea", lw=0.6)
    ax.set_axisbelow(True)
    ax.legend(fontsize=8, ncols=2)
    if path is not None:
        from ..files import writing

        with writing(path):
            figure.savefig(path, dpi=150)
    return figure


def _sampling(report: Report, ax: Axes, scale: float) -> None:
    """Half the interval against the time it takes, by the law of 1/sqrt(time), from shorter to longer runs."""
    own = report.own
    useful = own.simulated - report.warmup
    if not own.answer.halfwidth > 0.0:
        return
    factor = 2.0 ** np.arange(-HALVINGS, HALVINGS + 1.0)
    course = report.steps[report.own_step]
    wall = [wall_time(course[1], report.warmup + useful * f) for f in factor]
    half = scale * own.answer.halfwidth / np.sqrt(factor)
    ax.plot(wall, half, color=DARK, lw=1.2, ls="--", label="sampling, half of 95 %")
    ax.axhspan(0.0, scale * own.answer.halfwidth, color=DARK, alpha=0.08, lw=0)


def _mark(ax: Axes, point: Point, scale: float, mark: str, color: str, size: float = 7) -> None:
    if point.verdict == "not resolved":
        most = scale * max(abs(point.change.low), abs(point.change.high))
        ax.plot(point.wall, most, mark, ms=size, mfc="none", color=color)
        ax.annotate("", (point.wall, 0.6 * most), (point.wall, most), arrowprops={"arrowstyle": "->", "color": color})
        return
    low, high = sorted((scale * abs(point.error.low), scale * abs(point.error.high)))
    ax.plot(point.wall, scale * abs(point.error), mark, ms=size, color=color)
    ax.vlines(point.wall, low, high, color=color, lw=1)
    if point.knob != OWN and abs(point.change) > NAMED * abs(point.error):  # others would cover the star's name
        ax.annotate(point.label, (point.wall, scale * abs(point.error)), (5, 3), textcoords="offset points", fontsize=7)
