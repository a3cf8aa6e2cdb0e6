"""Error against time: what each knob of a scene does to an answer, and what it costs."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arguments import seconds, whole
from ..errors import InputError, SimulationError, number
from ..statistics import Array, Estimate
from ..units import to_si
from .knobs import Setting, changed, settings
from .quantity import Difference, Quantity, difference

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from ..result import Run
    from ..scene import Scene

PILOT = 1.5  # s of simulated time of the first look
LEAST_STAYS = 4.0  # warm-ups that a run must be long
RESERVE = 1.15  # of the pilot's time: a machine that is full costs more than one that fills
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
    """

    max_error: float
    step: float
    until: float
    wall: float
    error: float
    reason: str
    with_settings: tuple[Setting, ...] = ()

    def apply(self, scene: Scene) -> Scene:
        """A copy of the scene with these settings; run it ``until=choice.until``."""
        copy = scene.validated()
        for setting in self.with_settings:
            setting.change(copy)
        copy.numerics.step = self.step
        return copy

    def __str__(self) -> str:
        return (
            f"numerics.step = {number(self.step)} s, until {number(self.until)} s: an error of {number(self.error)} "
            f"in {number(self.wall)} s; {self.reason}"
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
            Of the quantity: numerics and half the 95 % interval together.

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
            room = allowed - abs(bias)
            if room <= 0.1 * allowed:
                continue
            until = self._until(0.9 * room)
            wall = dearer * wall_time(course, until)
            if best is None or wall < best.wall:
                dominant = "sampling" if room > abs(bias) else "the step"
                reason = f"{dominant} dominates: the step adds {number(abs(bias))}, sampling {number(0.9 * room)}"
                if needed:
                    reason += f"; needed: {', '.join(setting.label for setting in needed)}"
                best = Choice(allowed, step, until, wall, abs(bias) + 0.9 * room, reason, needed)
        if best is None:
            least = min(abs(bias) for bias, _ in self.steps.values())
            raise InputError(
                f"is {number(allowed)}, below what the steps tried can reach, {number(least)}",
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


# ---- making one ------------------------------------------------------------------------------------------------------


def accuracy_report(
    scene: Scene,
    quantity: str = "",
    budget: float | str = "2 min",
    vary: Sequence[str] | str | None = None,
    *,
    until: float | str | None = None,
    seed: int = 1,
    progress: bool = True,
) -> Report:
    """Measure what accuracy costs in a scene.

    Every knob is turned by itself, with the same feed; the change of the quantity is paired grain by grain, so that its
    interval is far narrower than the sampling error of either run where the motion is not chaotic.

    Parameters
    ----------
    scene : Scene
        With a feed and a landing plane.
    quantity : str
        "recovery[copper]", "grade[copper]", "middling", "mean_x[copper]" or "spread_x[copper]"; default: the mean
        landing x of the first material.
    budget : text with a unit, or s
        Wall time to spend, about; it decides how long each run is.
    vary : names of knobs, optional
        "step", "tolerance", "solver", "law", "field", "shape", "effects"; default: all that the scene has.
    until : text with a unit, or s, optional
        Simulated time of each run, in place of what the budget gives.
    seed : int
    progress : bool

    Returns
    -------
    Report

    Raises
    ------
    InputError
        Where the quantity, a knob or the scene cannot be used.

    Notes
    -----
    The best answer is that of the finest step. Where three steps resolve the order of the error it is extrapolated
    (Richardson, Phil. Trans. R. Soc. A 226 (1927) 299). A setting whose difference has 0 in its interval is "not
    resolved" and is ranked nowhere. A setting that fails is kept as a failure.
    """
    from .converged import Converged

    base = scene.validated()
    if not quantity and base.feed is not None:
        quantity = f"mean_x[{next(iter(base.feed.all_families())).material}]"
    wanted = Quantity(quantity)
    spend = seconds(budget, "budget")
    whole("seed", seed, 0, 2**64 - 2)
    tried = settings(base, vary)
    pilot = _run(base, seed, PILOT if until is None else min(PILOT, seconds(until)))
    Converged(quantity, 1.0).refuse(pilot.definition)
    duration = _duration(pilot, tried, spend) if until is None else seconds(until)
    bar = _bar(len(tried) + 2, progress)
    own = _run(base, seed, duration)
    bar.update()
    runs: list[tuple[Setting, Run | str]] = []
    for setting in tried:
        try:
            runs.append((setting, _run(changed(base, setting), seed, duration)))
        except (SimulationError, InputError, MemoryError) as error:
            runs.append((setting, str(error) or type(error).__name__))
        bar.update()
    other = _run(base, seed + 1, duration)
    bar.update()
    bar.close()
    return _report(wanted, base, own, runs, other, seed, duration, vary)


def _run(scene: Scene, seed: int, until: float) -> Run:
    from ..runner import run

    return run(scene, seed, threads=scene.numerics.threads or 1, until=until, progress=False, frames=None)


def _bar(total: int, progress: bool) -> Any:
    from tqdm import tqdm

    return tqdm(total=total, desc="accuracy", unit=" runs", leave=False, disable=None if progress else True)


def _duration(pilot: Run, tried: Sequence[Setting], budget: float) -> float:
    """Simulated time of each run, such that all of them together take the budget."""
    pace = RESERVE * pilot.wall_time / pilot.time
    longest = budget / (pace * (2.0 + sum(setting.cost for setting in tried)))
    stay = pilot.warmup if len(pilot.landings) else pilot.time
    return max(round(longest, 2), round(LEAST_STAYS * stay, 2), PILOT)


def _grain_steps(run: Run) -> int:
    """Grains times steps: how long each was inside, in steps."""
    inside = float(np.sum(run.landings["t"] - run.landings["birth"]))
    landed = np.isin(run.particles["id"], np.concatenate([run.landings["id"], run.lost["id"]]))
    inside += float(np.sum(run.lost["t"] - run.lost["birth"])) + float(
        np.sum(run.time - run.particles["birth"][~landed])
    )
    return round(inside / float(run.attrs["step"]))


def _point(
    quantity: Quantity, where: tuple[str, str, float], run: Run, warmup: float, error: Estimate, change: Difference
) -> Point:
    health = run.health
    return Point(
        *where,
        answer=quantity.of(run, warmup=warmup),
        error=error,
        change=change.value,
        correlation=change.correlation,
        wall=run.wall_time,
        simulated=run.time,
        steps=health.steps,
        iterations=health.total_iterations,
        grain_steps=_grain_steps(run),
        unconverged=health.unconverged,
    )


def failed(where: tuple[str, str, float], text: str) -> Point:
    """A setting that gave no answer."""
    nothing = Estimate(math.nan)
    return Point(*where, nothing, nothing, nothing, math.nan, math.nan, 0.0, 0, 0, 0, 0, text)


def _report(
    quantity: Quantity,
    base: Scene,
    own: Run,
    runs: Sequence[tuple[Setting, Run | str]],
    other: Run,
    seed: int,
    duration: float,
    vary: Any,
) -> Report:
    good = [(setting, run) for setting, run in runs if not isinstance(run, str)]
    warmup = max(run.warmup for run in [own, other, *(run for _, run in good)])
    if warmup > 0.6 * duration:
        raise InputError(
            f"gives runs of {number(duration)} s, but one grain in a hundred stays {number(warmup)} s; "
            f"ask for runs of {number(LEAST_STAYS * warmup)} s",
            path="budget",
        )

    if math.isnan(quantity.of(own, warmup=warmup).low):
        raise InputError(
            f"gives runs of {number(duration)} s, in which too few grains landed for an interval", path="budget"
        )

    def less(a: Run, b: Run) -> Difference:
        return difference(quantity, [a], [b], warmup=warmup)

    changes = {id(run): less(run, own) for run in [own, other, *(run for _, run in good)]}
    steps = {base.numerics.step: own} | {setting.value: run for setting, run in good if setting.knob == "step"}
    left, order = extrapolated({step: float(changes[id(run)].value) for step, run in steps.items()})
    finest = steps[min(steps)]
    to_best = float(changes[id(finest)].value) + left

    def error_of(run: Run) -> Estimate:
        """Against the finest step; what is left beyond that is believed to a half."""
        half = math.hypot(0.5 * left, 0.0 if run is finest else less(run, finest).value.halfwidth)
        value = float(changes[id(run)].value) - to_best
        return Estimate(value, value - half, value + half)

    def point_of(where: tuple[str, str, float], run: Run | str) -> Point:
        if isinstance(run, str):
            return failed(where, run)
        return _point(quantity, where, run, warmup, error_of(run), changes[id(run)])

    points = [point_of((OWN, "as it is", math.nan), own)]
    points += [point_of((setting.knob, setting.label, setting.value), run) for setting, run in runs]
    points.append(point_of((SEED, f"seed {seed + 1}", math.nan), other))
    answer = points[0].answer
    middle, half = (
        float(answer) + to_best,
        math.hypot(answer.halfwidth, changes[id(finest)].value.halfwidth, 0.5 * left),
    )
    best = Estimate(middle, middle - half, middle + half, answer.n_eff)
    knobs = "" if vary is None else " --vary " + " ".join([vary] if isinstance(vary, str) else vary)
    return Report(
        quantity=quantity,
        points=points,
        best=best,
        order=order,
        toml=base.to_toml(),
        command=f"cesim accuracy REPORT.h5 -q '{quantity.name}' --until {number(duration)} --seed {seed}{knobs}",
        warmup=warmup,
        seed=seed,
        steps={step: (float(error_of(run)), course_of(run)) for step, run in steps.items()},
        tried=[setting for setting, _ in runs],
    )


def course_of(run: Run) -> Array:
    """Simulated against wall time, (n, 2) s: the stages as measured, and what is around them in equal parts."""
    history = run.health_history
    stages = np.sum([history[name] for name in history.dtype.names or () if name.startswith("seconds_")], axis=0)
    rest = max(run.wall_time - float(stages[-1]), 0.0)
    return np.column_stack([history["time"], stages + rest * history["time"] / run.time])


def wall_time(course: Array, until: float) -> float:
    """Wall time in s of a run: on its course, and beyond it at the pace of the course's second half."""
    time, wall = course.T
    if until <= time[-1]:
        return float(np.interp(until, np.append(0.0, time), np.append(0.0, wall)))
    half = len(time) // 2
    pace = (wall[-1] - wall[half]) / max(time[-1] - time[half], 1e-9)
    return float(wall[-1] + pace * (until - time[-1]))


def extrapolated(changes: Mapping[float, float]) -> tuple[float, float]:
    """What is left between the finest step and none, and the order of the error.

    Parameters
    ----------
    changes : step -> answer less that of the scene's own step

    Returns
    -------
    correction, order
        The order comes from three steps in a row of ratio two, the finest ones; outside [0.5, 2.5] it is NaN and taken
        as one, the order of contacts.
    """
    ladder = sorted(changes)
    if len(ladder) < 2:
        return 0.0, math.nan
    fine, middle = ladder[0], ladder[1]
    ratio = middle / fine
    order = math.nan
    if len(ladder) > 2 and math.isclose(ladder[2] / middle, ratio, rel_tol=0.05):
        coarse_change, fine_change = changes[ladder[2]] - changes[middle], changes[middle] - changes[fine]
        if fine_change != 0.0 and coarse_change / fine_change > 0.0:
            order = math.log(coarse_change / fine_change) / math.log(ratio)
    if not 0.5 <= order <= 2.5:
        order = math.nan
    power = 1.0 if math.isnan(order) else order
    return (changes[fine] - changes[middle]) / (ratio**power - 1.0), order
