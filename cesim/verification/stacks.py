"""Grains on top of each other: columns, towers, heavy on light (docs/numerics.md 3, cases 03, 04, 05)."""

from __future__ import annotations

import numpy as np

from ..scene import Numerics, Scene
from ..simulation import Simulation
from .rows import Case, Rows, Size, at_least, at_most, relative
from .scenes import GRAVITY, RADIUS, Array, floor_force, grain, kinetic, plane
from .watch import Watch

D = 2.0 * RADIUS


def standing(scene: Scene, n: int, offset: float = 0.0) -> tuple[Simulation, Array]:
    """A column of n copper grains; every other one is off the axis by an offset in m."""
    sim = Simulation(scene, threads=1)
    start = np.column_stack([offset * np.arange(n), RADIUS + D * np.arange(n), np.zeros(n)])
    sim.add(start, material="copper", diameter=D)
    return sim, start


def loaded(ratio: float, solver: str, tolerance: float | None) -> Simulation:
    """A light grain on the floor and a heavy one on it, densities and sizes apart."""
    heavy = min(30_000.0, ratio)
    wide = (ratio / heavy) ** (1.0 / 3.0)
    materials = {name: grain(rho, friction=0.0) for name, rho in (("light", 1.0), ("heavy", heavy))}
    scene = plane(friction=0.3, materials=materials)
    scene.numerics = Numerics.model_validate({"solver": solver, "tolerance": tolerance})
    sim = Simulation(scene, threads=1)
    d = 1e-3
    sim.add([(0.0, 0.5 * d, 0.0)], material="light", diameter=d)
    sim.add([(0.0, d + 0.5 * d * wide, 0.0)], material="heavy", diameter=d * wide)
    return sim


def heavy_on_light(size: Size) -> Rows:
    """What the floor bears, until a step says that it is not solved; by default, and by the solver for such cases."""
    watch = Watch()
    for ratio, solver, tolerance in (
        (1e3, "auto", None),
        (1e6, "auto", None),
        (1e3, "direct", 1e-7),
        (1e6, "direct", 1e-7),
    ):
        sim = loaded(ratio, solver, tolerance)
        wrong = worst = 0.0
        for _ in range(300):
            watch.step(sim)
            error = relative(floor_force(sim), float(sim.mass.sum()) * GRAVITY)
            worst = max(worst, error)
            if not sim.health.unconverged:  # afterwards the grains move, and what the floor bears is another force
                wrong = max(wrong, error)
        how = "default" if tolerance is None else f"solver {solver}, tolerance {tolerance:.0e} m/s"
        note = f"worst of all steps {worst:.1e}; {sim.health.unconverged} of 300 say not solved"
        if tolerance is None:
            yield at_most(
                f"ratio {ratio:.0e}, {how}: error of the force on the floor, until told", wrong, 1e-3, "", note
            )
        else:
            yield at_most(f"ratio {ratio:.0e}, {how}: error of the force on the floor", worst, 1e-3, "", note)
    yield watch.row()


def column(size: Size) -> Rows:
    """Fifty grains on top of each other for two seconds."""
    watch = Watch()
    scene = plane(friction=0.3)
    scene.numerics.max_iterations = 20_000
    for tolerance, drift, motion, force in (
        (None, 1e-3, 1e-6, 1e-3),
        (1e-9, 1e-6, 1e-12, 1e-6),
        (1e-12, 1e-9, 1e-12, 1e-9),
    ):
        scene.numerics.tolerance = tolerance
        name = "default tolerance" if tolerance is None else f"tolerance {tolerance:.0e} m/s"
        sim, start = standing(scene, 50)
        watch.step(sim, 2000)
        weight = float(sim.mass.sum()) * GRAVITY
        yield at_most(f"drift in 2 s, {name}", np.abs(sim.position - start).max() / D, drift, "d")
        note = "the sweeps stop at a residual of 1e-3 g h, which is the motion left; the wish of 1e-12 is the row below"
        yield at_most(f"kinetic energy a grain, {name}", kinetic(sim), motion, "m g d", "" if tolerance else note)
        yield at_most(f"error of the force on the floor, {name}", relative(floor_force(sim), weight), force)
    yield watch.row()


def tower(size: Size) -> Rows:
    """Twenty grains exactly on top of each other, and a billionth of a diameter off."""
    watch = Watch()
    sim, _ = standing(plane(friction=0.3), 20)
    watch.step(sim, 1000)
    yield at_most("sideways drift in 1 s, exactly upright", np.abs(sim.position[:, [0, 2]]).max() / D, 1e-9, "d")
    for side in (1.0, -1.0):
        sim, _ = standing(plane(friction=0.3), 20, side * 1e-9 * D)
        watch.step(sim, 600)
        top = float(sim.position[np.argmax(sim.position[:, 1]), 1])
        yield at_most(f"height after 0.6 s, leaning by {side:+.0e} nd a grain", top / D, 19.0, "d", "it falls")
        middle = float((sim.position[:, 0] * sim.mass).sum() / sim.mass.sum())
        yield at_least("the centre of mass has gone to that side, by", side * middle / D, 0.1, "d")
    yield watch.row()


CASES = (
    Case(
        "03",
        "heavy on light",
        "iterations pass a weight on by the ratio of the masses, and engines sag unsaid",
        "statics: the floor bears the weight",
        heavy_on_light,
    ),
    Case("04", "column of fifty", "information climbs one grain a sweep", "statics", column),
    Case(
        "05",
        "tower on a knife's edge",
        "rounding decides where it falls, unless the code is symmetric",
        "unstable equilibrium",
        tower,
    ),
)
