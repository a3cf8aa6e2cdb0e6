"""A run on a page of text."""

from __future__ import annotations

import numpy as np

from .accuracy.converged import verdict
from .accuracy.rules import MEASURED
from .errors import InputError, percent
from .result import Run
from .statistics import Estimate

MOST_TURN = 1.0  #: rad in a step, of a grain that is no sphere: beyond it the run's contacts are coarse


def table(run: Run) -> str:
    """Grade, recovery, middlings, balance, health and notes."""
    step = float(run.attrs["step"])
    lines = [
        f"{run.name}, seed {run.seed}: {run.time:.4g} s in steps of {1e3 * step:.3g} ms",
        f"computed in {run.wall_time:.3g} s with {run.threads} thread{'s' if run.threads != 1 else ''}",
    ]
    if "accuracy" in run.attrs:
        name, wanted = str(run.attrs["accuracy"]), 1e3 * run.attrs["accuracy_error"]
        lines.append(
            f"accuracy {name}: made for {wanted:g} mm of mean landing x; on the sphere machine it has "
            f"{1e3 * MEASURED[name]:g} mm of ABS"
        )
    lines += separation(run)
    lines += ["", f"balance       {run.balance}", *str(run.health).splitlines()]
    lines += motors(run)
    lines += field(run)
    lines += [f"waited for    {verdict(run)}"] if verdict(run) else []
    lines += [f"note          {note}" for note in notes(run)]
    return "\n".join(lines)


def field(run: Run) -> list[str]:
    """What is known of the errors of a field on a grid."""
    record = run.definition.get("field") or {}
    if "interpolation_error" not in record:
        return []
    source, error = record["source"] or "arrays", record["interpolation_error"]
    lines = [f"field         grid of {source}: interpolation error {error:.2g}"]
    if record["curl_residual"] > 0.0:
        lines.append(f"field         {record['curl_residual']:.2g} of the field in the file has no potential")
    return lines


def motors(run: Run) -> list[str]:
    """What each motor gave, in the mean over the run."""
    lines = []
    for joint in run.definition.get("joints") or []:
        rows = run.joints[joint["name"]]
        if not joint.get("law") or not len(rows):
            continue
        unit, rate = ("N m", "rad/s") if joint["kind"] == "revolute" else ("N", "m/s")
        last, time = rows[-1], rows["time"][-1]
        effort, power = last["impulse"] / time, last["energy"] / time
        limited = np.count_nonzero(rows["at_limit"])
        lines.append(
            f"motor         {joint['name']}: {effort:.4g} {unit} and {power:.4g} W in the mean, "
            f"{last['speed']:.4g} {rate} at the end"
            + (f", at its limit in {limited} of {len(rows)} output steps" if limited else "")
        )
    return lines


def separation(run: Run) -> list[str]:
    """Grade and recovery per material, and the middlings."""
    if not len(run.landings):
        return ["", "nothing has landed"]
    try:
        left, right = run.default_splitters
    except InputError:
        counts = [int(np.count_nonzero(run.sample().share(name))) for name in run.materials]
        return [""] + [f"{name:<13} {count} landed" for name, count in zip(run.materials, counts, strict=True)]
    lines = [f"splitters at {1e3 * left:.4g} and {1e3 * right:.4g} mm; intervals of 95 %", ""]
    lines.append(f"{'material':<13} {'product':<12} {'grade':<26} {'recovery':<26} landed [g]")
    sample = run.sample()
    for name, product in run.products.items():
        mass = 1e3 * float((sample.mass * sample.share(name)).sum())
        lines.append(
            f"{name:<13} {product:<12} {interval(run.grade(name)):<26} {interval(run.recovery(name)):<26} {mass:.4g}"
        )
    lines.append(f"{'middlings':<26} {interval(run.middlings())} of the mass landed")
    return lines


def interval(estimate: Estimate) -> str:
    """An estimate with its interval, in four digits."""
    if np.isnan(estimate):
        return "-"
    if np.isnan(estimate.low):
        return f"{float(estimate):.4f}"
    return f"{float(estimate):.4f} [{estimate.low:.4f}, {estimate.high:.4f}]"


def notes(run: Run) -> list[str]:
    """What a reader of the figures must know."""
    health, balance = run.health, run.balance
    found = []
    if not run.complete:
        found.append("the run was stopped before its end")
    if step := too_large(run):
        found.append(step)
    if not health.converged:
        left = f"at worst with {health.worst_residual:.2g} m/s left"
        found.append(f"{health.unconverged} of {health.steps} steps ran out of iterations, {left}")
    if health.worst_turn > MOST_TURN:
        found.append(
            f"a grain turned by {health.worst_turn:.2g} rad in a step, farther than contacts see ahead: try steps of "
            f"{MOST_TURN / health.worst_turn:.2g} of this one"
        )
    if balance.lost.count:
        found.append(f"{balance.lost.count} grains left the bounds of the scene without landing")
    if not balance.closed:
        found.append("the mass balance is not closed: please report this")
    if balance.fed.kg > 0 and balance.resident.kg > 0.02 * balance.fed.kg:
        found.append(f"{percent(balance.resident.kg / balance.fed.kg)} of the feed is still inside and not counted")
    return found + startup(run)


def too_large(run: Run) -> str:
    """Says so where the step is too large for the finest grain."""
    step, longest = float(run.attrs["step"]), float(run.attrs.get("longest_step", np.inf))
    if step <= longest:
        return ""
    return f"steps of {1e3 * step:.3g} ms are too large for the finest grains, which ask for {1e3 * longest:.3g} ms"


def startup(run: Run) -> list[str]:
    """Slow materials arrive late: says so where leaving out the start shifts a grade beyond its interval."""
    if len(run.landings) < 100 or run.definition["collect"] is None or run.definition["collect"]["splitters"] is None:
        return []
    warmup = run.warmup
    if warmup > run.time / 2:
        return [f"one grain in a hundred stays {warmup:.2g} s: run for longer than {2 * warmup:.2g} s"]
    found = []
    for name in run.materials:
        whole, later = run.grade(name), run.grade(name, warmup=warmup)
        if later < whole.low or later > whole.high:  # neither where too few landed for an interval
            how = f"grade({name!r}, warmup={warmup:.2g})"
            found.append(f"without the first {warmup:.2g} s (start-up) the grade of {name} is {interval(later)}: {how}")
    return found
