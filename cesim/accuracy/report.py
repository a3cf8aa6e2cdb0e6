"""Error against time: what each knob of a scene does to an answer, and what it costs."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, number, with_unit
from ..statistics import Array, Estimate
from ..units import to_si
from .knobs import Setting
from .quantity import Quantity

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from ..scene import Scene

PILOT = 1.5  # s of simulated time of the first look
LEAST_STAYS = 4.0  # warm-ups that a run must be long
STRETCHES, SURE = 8, 3.0  # parts in which the pace of a run is measured; standard errors that are beyond doubt
OWN, SEED = "own", "seed"  # what stands for a knob where nothing is turned


@dataclass(frozen=True)
class Point:
    """One setting: what it answered, how wrong that is, and what it cost.

    Attributes
    ----------
    knob, label : str
        "own" is the scene as it is.
    value : float
        Of the number that is turned, NaN where it is none.
    answer : Estimate
        The quantity, with its sampling interval.
    error : Estimate
        Answer less the best one (`Report.best`), paired where the runs are; NaN for a failure.
    change : Estimate
        Answer less that of the scene as it is, paired.
    correlation : float
        Between these two over the bootstrap.
    wall, simulated : float
        s
    steps, iterations, grain_steps : int
        Machine-independent work: steps, solver sweeps, grains times steps.
    unconverged : int
        Steps that ran out of iterations.
    failure : str
        What went wrong; "" where nothing did.
    """

    knob: str
    label: str
    value: float
    answer: Estimate
    error: Estimate
    change: Estimate
    correlation: float
    wall: float
    simulated: float
    steps: int
    iterations: int
    grain_steps: int
    unconverged: int
    failure: str = ""

    @property
    def verdict(self) -> str:
        """ "own", "failed", or what a setting changes: "different" from the scene as it is, or "not resolved"."""
        if self.failure or self.knob == OWN:
            return "failed" if self.failure else OWN
        return "different" if self.change.low > 0.0 or self.change.high < 0.0 else "not resolved"


@dataclass(frozen=True)
class Share:
    """What one source contributes to the error of the scene as it is."""

    source: str
    size: Estimate  #: signed for what was turned; the half width of the interval for sampling
    resolved: bool


@dataclass(frozen=True)
class Choice:
    """Settings that should keep an error, the time they should take, and why.

    Attributes
    ----------
    max_error : float
        That was asked for.
    step : float
        s
    until : float
        s of simulated time.
    wall : float
        s, predicted.
    error : float
        Predicted: of the numerics, and half the sampling interval.
    reason : str
    with_settings : tuple of Setting
        Finer settings than the scene's own that the error needs.
    unit : str
        Of the errors.
    """

    max_error: float
    step: float
    until: float
    wall: float
    error: float
    reason: str
    with_settings: tuple[Setting, ...] = ()
    unit: str = ""

    def apply(self, scene: Scene) -> Scene:
        """A copy of the scene with these settings; run it ``until=choice.until``."""
        copy = scene.validated()
        for setting in self.with_settings:
            setting.change(copy)
        copy.numerics.step = self.step
        return copy

    def __str__(self) -> str:
        return (
            f"numerics.step = {number(self.step)} s, until {self.until:.3g} s: "
            f"an error of {sized(self.error, self.unit)} in {self.wall:.3g} s; {self.reason}"
        )


@dataclass
class Report:
    """The outcome of `accuracy_report`.

    Attributes
    ----------
    quantity : Quantity
    points : list of Point
        The scene as it is first.
    best : Estimate
        The answer that errors are counted from: that of the scene as it is, and the paired change to the finest step,
        extrapolated to none. Its interval holds sampling, that change's, and half of what was extrapolated.
    order : float
        Of the error in the step, NaN where it was not resolved.
    toml, command : str
        The scene, and the command that makes this report again.
    steps : dict
        Step in s -> (error that it makes, course of its run: (n, 2) s of simulated time, s of wall time).
    warmup : float
        s, cut from each run.
    """

    quantity: Quantity
    points: list[Point]
    best: Estimate
    order: float
    toml: str
    command: str
    warmup: float
    seed: int
    steps: dict[float, tuple[float, Array]]
    tried: list[Setting]

    @property
    def own(self) -> Point:
        """The scene as it is."""
        return self.points[0]

    @property
    def own_step(self) -> float:
        """s, of the scene as it is: the first that stands in `steps`."""
        return next(iter(self.steps))

    @property
    def split(self) -> list[Share]:
        """Where the error of the scene as it is comes from, sampling first."""
        own = self.own
        shares = [Share("sampling", Estimate(own.answer.halfwidth), True)]
        finer = {(setting.knob, setting.label) for setting in self.tried if setting.finer}
        for point in self.points[1:]:
            if point.failure or (point.knob, point.label) not in finer:
                continue
            size = Estimate(-float(point.change), -point.change.high, -point.change.low)
            if point.knob == "step":  # what the finest step leaves is known, too
                size = own.error
            shares.append(Share(f"{point.knob}: {point.label}", size, size.low > 0.0 or size.high < 0.0))
        return shares

    @property
    def pareto(self) -> list[Point]:
        """Points that no other beats in both time and error, fastest first.

        What failed, what changes nothing that could be resolved, and the other seed are not ranked.
        """
        ranked = [point for point in self.points if point.verdict in (OWN, "different") and point.knob != SEED]
        ranked.sort(key=lambda point: (point.wall, abs(point.error)))
        front: list[Point] = []
        for point in ranked:
            if not front or abs(point.error) < abs(front[-1].error):
                front.append(point)
        return front

    def recommend(self, max_error: float | str) -> Choice:
        """Settings for an error of the quantity, at the least predicted time.

        Parameters
        ----------
        max_error : number, or text with a unit
            Of the quantity: numerics and half the 95 % interval together, in which how well the error of the step is
            known counts, too.

        Raises
        ------
        InputError
            Where no step that was tried is good enough.
        """
        try:
            allowed = to_si(max_error, self.quantity.unit, 0.0, 1e3)
        except InputError as error:
            raise error.at("max_error") from None
        needed = tuple(
            setting
            for setting, share in self._finer()
            if setting.knob != "step" and share.resolved and abs(share.size) > 0.25 * allowed
        )
        dearer = math.prod(max(self._dearer(setting), 1.0) for setting in needed)
        best: Choice | None = None
        for step, (bias, course) in self.steps.items():
            room, unsure = 0.9 * (allowed - abs(bias)), self._unsure(step)
            if room <= max(0.1 * allowed, unsure):
                continue
            sampling = math.sqrt(room**2 - unsure**2)
            until = self._until(sampling)
            wall = dearer * wall_time(course, until)
            if best is None or wall < best.wall:
                dominant = "sampling" if room > abs(bias) else "the step"
                added, known, left = (sized(size, self.quantity.unit) for size in (abs(bias), unsure, sampling))
                reason = f"{dominant} dominates: the step adds {added} (known to {known}), sampling {left}"
                if needed:
                    reason += f"; needed: {', '.join(setting.label for setting in needed)}"
                best = Choice(allowed, step, until, wall, abs(bias) + room, reason, needed, self.quantity.unit)
        if best is None:
            least = min(abs(bias) for bias, _ in self.steps.values())
            raise InputError(
                f"is {sized(allowed, self.quantity.unit)}, below what the steps tried can reach, "
                f"{sized(least, self.quantity.unit)}",
                path="max_error",
                value=max_error,
                unit=self.quantity.unit,
            )
        return best

    def _finer(self) -> Iterable[tuple[Setting, Share]]:
        shares = {share.source: share for share in self.split}
        for setting in self.tried:
            share = shares.get(f"{setting.knob}: {setting.label}")
            if setting.finer and share is not None:
                yield setting, share

    def _unsure(self, step: float) -> float:
        """How well the error that a step makes is known: half its interval."""
        known = {self.own_step: self.own} | {point.value: point for point in self.points if point.knob == "step"}
        return known[step].error.halfwidth

    def _dearer(self, setting: Setting) -> float:
        for point in self.points:
            if (point.knob, point.label) == (setting.knob, setting.label) and not point.failure:
                return point.wall / self.own.wall
        return 1.0

    def _until(self, halfwidth: float) -> float:
        """Simulated time for half an interval, by the law of 1/sqrt(time)."""
        useful = self.own.simulated - self.warmup
        wanted = useful * (self.own.answer.halfwidth / halfwidth) ** 2
        return self.warmup + max(wanted, LEAST_STAYS * self.warmup, PILOT)

    def to_pandas(self) -> pd.DataFrame:
        """One row per point."""
        import pandas

        plain = ("knob", "label", "value", "wall", "simulated", "steps", "iterations", "grain_steps", "unconverged")
        rows = [
            {name: getattr(point, name) for name in (*plain, "correlation", "verdict", "failure")}
            for point in self.points
        ]
        for row, point in zip(rows, self.points, strict=True):
            for name in ("answer", "error", "change"):
                value = getattr(point, name)
                row |= {name: float(value), f"{name}_low": value.low, f"{name}_high": value.high}
        return pandas.DataFrame(rows)

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """Error against wall time, log-log; written to ``path`` if given."""
        from .picture import draw_report

        return draw_report(self, None if path is None else Path(path))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything as HDF5; `cesim accuracy` makes the report again from it."""
        from .storage import write_report

        write_report(self, Path(path))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Report:
        """Read what `save` wrote."""
        from .storage import read_report

        return read_report(Path(path))

    def __str__(self) -> str:
        from .storage import text_of

        return text_of(self)


def sized(value: float, unit: str) -> str:
    """An error as a reader wants it: a length in mm, to three digits."""
    scale, shown = (1e3, "mm") if unit == "m" else (1.0, unit)
    return with_unit(f"{scale * value:.3g}", shown)


def wall_time(course: Array, until: float) -> float:
    """Wall time in s of a run: on its course, and beyond it as in the course's second half.

    A machine in which grains gather gets slower and slower: where the pace of that half rises beyond doubt, it goes on
    to rise.
    """
    time, wall = course.T
    if until <= time[-1]:
        return float(np.interp(until, np.append(0.0, time), np.append(0.0, wall)))
    edges = np.linspace(0.5 * time[-1], time[-1], STRETCHES + 1)
    paces = np.diff(np.interp(edges, np.append(0.0, time), np.append(0.0, wall))) / np.diff(edges)
    middle = 0.5 * (edges[1:] + edges[:-1])
    rise, at_end = np.polyfit(middle - time[-1], paces, 1)
    scatter = paces - (at_end + rise * (middle - time[-1]))
    spread = math.sqrt(np.sum(scatter**2) / (STRETCHES - 2) / np.sum((middle - np.mean(middle)) ** 2))
    if rise <= SURE * spread:
        rise, at_end = 0.0, np.mean(paces)
    beyond = until - time[-1]
    return float(wall[-1] + at_end * beyond + 0.5 * rise * beyond**2)
