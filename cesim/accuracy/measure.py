"""Measure what accuracy costs: turn each knob of a scene by itself, over the same grains."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arguments import seconds, whole
from ..errors import InputError, SimulationError, number
from ..statistics import Array, Estimate
from .knobs import Setting, changed, settings
from .quantity import Difference, Quantity, difference
from .report import LEAST_STAYS, OWN, PILOT, SEED, Point, Report

if TYPE_CHECKING:
    from ..result import Run
    from ..scene import Scene

LONGEST_WARMUP = 0.6  # of a run: what is left must do for an interval
RESERVE = 1.15  # of the pilot's time: a machine that is full costs more than one that fills


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
        Wall time to spend, about; it decides how long each run is. No run is shorter than four warm-ups, so that a
        budget too small for them is exceeded.
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
    if base.feed is None:
        raise InputError("is missing: nothing would land", path="feed")
    if not quantity:
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
    if until is None and LEAST_STAYS * own.warmup > duration:  # some stay longer than the pilot could see
        duration = round(LEAST_STAYS * own.warmup, 2)
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
    runs = [(setting, run if isinstance(run, str) else _long_enough(run, duration)) for setting, run in runs]
    good = [(setting, run) for setting, run in runs if not isinstance(run, str)]
    warmup = max(run.warmup for run in [own, other, *(run for _, run in good)])
    if warmup > LONGEST_WARMUP * duration:
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


def _long_enough(run: Run, duration: float) -> Run | str:
    """The run; or why it says nothing: grains that stay about as long as it lasts."""
    if run.warmup <= LONGEST_WARMUP * duration:
        return run
    return f"one grain in a hundred stays {number(run.warmup)} s, too long for runs of {number(duration)} s"


def course_of(run: Run) -> Array:
    """Simulated against wall time, (n, 2) s: the stages as measured, and what is around them in equal parts."""
    history = run.health_history
    stages = np.sum([history[name] for name in history.dtype.names or () if name.startswith("seconds_")], axis=0)
    rest = max(run.wall_time - float(stages[-1]), 0.0)
    return np.column_stack([history["time"], stages + rest * history["time"] / run.time])


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
