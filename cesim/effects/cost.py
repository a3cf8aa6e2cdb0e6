"""The share of the run time that each effect takes, measured by leaving it out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .. import engine
from ..arguments import seconds, whole
from ..scene.effects import Decision, Decisions
from .prediction import predict
from .toggle import toggled

if TYPE_CHECKING:
    from ..scene import Scene

COLUMNS = ("position", "velocity", "angular_velocity", "material", "diameter", "charge", "orientation", "shape")
EFFECT_STAGES = ("charge", "force")  # where effects are computed; the others only feel what they did
STEPS = 5  # between two readings of the clock


def measure(scene: Scene, *, at: float | str = "0.8 s", repeats: int = 15, seed: int = 1) -> Decisions:
    """The decisions with the measured share of the time per step that each effect takes: `Decision.cost`.

    The machine is filled up to a moment; from there a few steps are taken with everything as decided, and with one
    effect left out, in turns. The quickest readings of each count, since a busy computer only ever adds. An effect's
    cost is that of the stages charge and force; a choice's is that of the whole step. What is off costs 0.

    Parameters
    ----------
    at : text with a unit, or s
        The moment.
    repeats : int
        Readings of each.
    seed : int
        Of the feed.

    Returns
    -------
    Decisions
        NaN as cost where there is no other way to decide, or there are no grains.
    """
    from ..simulation import Simulation

    moment, readings = seconds(at, "at"), whole("repeats", repeats, 1, 10_000)
    scene = scene.validated()
    decisions = predict(scene)
    sim = Simulation(scene, seed, threads=1)
    sim.run(moment)
    if not sim.count:
        return decisions
    grains = {name: np.array(getattr(sim, name)) for name in COLUMNS}
    others = {row.name: toggled(scene, row) for row in decisions.rows if row.on}
    engines = {name: _filled(other, grains) for name, other in others.items() if other is not None}
    quickest = _race({"": _filled(scene, grains)} | engines, readings)
    total = sum(quickest[""].values())
    costs = {row.name: _cost(row, quickest, total) for row in decisions.rows}
    return decisions.replaced({name: {"cost": cost} for name, cost in costs.items()})


def _cost(row: Decision, quickest: dict[str, dict[str, float]], total: float) -> float:
    if not row.on:
        return 0.0
    if row.name not in quickest:
        return math.nan
    stages = EFFECT_STAGES if row.kind == "effect" else tuple(quickest[""])
    spent = sum(quickest[""][stage] - quickest[row.name][stage] for stage in stages)
    return max(spent / total, 0.0)


def _filled(scene: Scene, grains: dict[str, NDArray[Any]]) -> engine.Scene:
    """An engine with these grains and no feed; what a feed decides stays decided."""
    sim = engine.Scene(scene.definition() | {"feed": None}, seed=1, threads=1)
    sim.add(*(grains[name] for name in COLUMNS))
    sim.step(2)  # touches and multipliers settle
    return sim


def _race(engines: dict[str, engine.Scene], repeats: int) -> dict[str, dict[str, float]]:
    """The least seconds that a few steps took, stage by stage."""
    least: dict[str, dict[str, float]] = {name: {} for name in engines}
    for _ in range(repeats):
        for name, sim in engines.items():
            before = sim.stage_seconds
            sim.step(STEPS)
            for stage, after in sim.stage_seconds.items():
                least[name][stage] = min(least[name].get(stage, math.inf), after - before[stage])
    return least
