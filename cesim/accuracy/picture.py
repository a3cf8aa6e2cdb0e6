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
HUES = dict(zip(MARKS, (*COLORS[:6], "#6B4C9A"), strict=True))
UNRESOLVED, FAILED = "#9aa0a6", "#b00020"
LOWEST = 0.02  # of the sampling error: what is at most this is drawn there, and not far below everything else
NAMED = 0.1  # of the error, that a setting changes at least whose name is written
HALVINGS = 4  # of the run's length, that the line of the sampling error is drawn back


def draw_report(report: Report, path: Path | None = None) -> Figure:
    """`draw_panel` with a legend, as a figure of its own."""
    figure = new_figure((7.5, 5.0), on_screen=path is None)
    ax = figure.subplots()
    draw_panel(ax, report)
    ax.set_xlabel(f"wall time [s] of {report.own.simulated:.3g} s simulated")
    ax.set_ylabel(f"error of {report.quantity.name}{_scale(report)[1]}")
    ax.legend(fontsize=8, ncols=2)
    if path is not None:
        from ..files import writing

        with writing(path):
            figure.savefig(path, dpi=150)
    return figure


def draw_panel(ax: Axes, report: Report, *, names: bool = True) -> None:
    """Error of each setting against its wall time, with the sampling error of the scene as it is as a band.

    Settings that change nothing that could be resolved are drawn hollow and grey, with an arrow, at the end of the
    interval of their change: it is at most that. Failures are crosses at the upper edge.

    Parameters
    ----------
    names : bool
        Whether each setting is named beside its mark.
    """
    scale = _scale(report)[0]
    floor = LOWEST * scale * max(report.own.answer.halfwidth, 0.0)
    _sampling(report, ax, scale)
    for knob in [knob for knob in MARKS if any(point.knob == knob for point in report.points)]:
        points = [point for point in report.points if point.knob == knob and not point.failure]
        if knob == "step":
            points.append(report.own)
            _ladder(ax, report, points, scale)
        for point in points:
            _mark(ax, point, scale, floor, MARKS[knob], HUES[knob], names)
        ax.plot([], [], MARKS[knob], color=HUES[knob], label=knob)
    _mark(ax, report.own, scale, floor, "*", "black", names, size=13)
    ax.plot([], [], "*", color="black", ms=11, label="the scene as it is")
    if any(point.verdict == "not resolved" and point.knob in MARKS for point in report.points):
        ax.plot([], [], "o", mfc="none", color=UNRESOLVED, label="not resolved: at most")
    ax.set_xscale("log")
    ax.set_yscale("log")
    _failures(ax, report)
    ax.grid(True, which="both", color="#e4e7ea", lw=0.6)
    ax.set_axisbelow(True)


def _ladder(ax: Axes, report: Report, points: list[Point], scale: float) -> None:
    """A line from step to step, through those that are resolved."""
    steps = {(report.own_step if point is report.own else point.value): point for point in points}
    drawn = [steps[step] for step in sorted(steps) if steps[step].verdict != "not resolved"]
    ax.plot([p.wall for p in drawn], [scale * abs(p.error) for p in drawn], color=HUES["step"], lw=1)


def _scale(report: Report) -> tuple[float, str]:
    return (1e3, " [mm]") if report.quantity.unit == "m" else (1.0, "")


def _failures(ax: Axes, report: Report) -> None:
    """A cross for each at the upper edge, below each other, with its name: a failure has no time and no error."""
    failures = [point for point in report.points if point.failure]
    for i, point in enumerate(failures):
        height = 0.97 - 0.06 * i
        ax.plot(0.03, height, "x", color=FAILED, mew=2, transform=ax.transAxes)
        text = f"{point.knob} {point.label}: failed"
        ax.text(0.06, height, text, color=FAILED, fontsize=8, va="center", transform=ax.transAxes)


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


def _mark(
    ax: Axes, point: Point, scale: float, floor: float, mark: str, color: str, names: bool = True, size: float = 7
) -> None:
    if point.verdict == "not resolved":
        most = max(scale * max(abs(point.change.low), abs(point.change.high)), floor)
        arrow = {"arrowstyle": "->", "color": UNRESOLVED}
        ax.plot(point.wall, most, mark, ms=size, mfc="none", color=UNRESOLVED)
        ax.annotate("", (point.wall, 0.6 * most), (point.wall, most), arrowprops=arrow)
        return
    low, high = sorted((scale * abs(point.error.low), scale * abs(point.error.high)))
    if point.error.low < 0.0 < point.error.high:
        low = min(floor, scale * abs(point.error))
    ax.plot(point.wall, scale * abs(point.error), mark, ms=size, color=color)
    ax.vlines(point.wall, low, high, color=color, lw=1)
    # Others would cover the star's name.
    if names and point.knob != OWN and abs(point.change) > NAMED * abs(point.error):
        ax.annotate(point.label, (point.wall, scale * abs(point.error)), (5, 3), textcoords="offset points", fontsize=7)
