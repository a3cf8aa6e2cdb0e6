"""Numbers and parameters at the edge of what is legal (docs/numerics.md 3, cases 36, 37, 39, 40, 41)."""

from __future__ import annotations

import itertools
import math
import re
import time

import numpy as np

from ..errors import SimulationError
from ..scene import Numerics, Scene
from ..simulation import Simulation
from .invariance import GRAIN, start, trough
from .rows import Case, Rows, Size, at_most, equal, relative
from .scenes import GRAVITY, Array, bare, grain, plane
from .watch import Watch

# ---- denormals (36) --------------------------------------------------------------------------------------------------


def seconds_for(velocity: float, diameter: float, steps: int = 300) -> tuple[float, float]:
    """Best of three times, and the change of velocity, of a thousand grains in the air over a plane."""
    scene = plane(materials={"grain": GRAIN})
    scene.gravity = (0.0, 0.0, 0.0)
    best, change = math.inf, 0.0
    for _ in range(3):
        sim = Simulation(scene, threads=1)
        cells = np.indices((10, 10, 10)).reshape(3, -1).T * 1e-2 + 1e-2
        sim.add(cells, velocity=(velocity, velocity, 0.0), material="grain", diameter=diameter)
        before = time.process_time()
        sim.step(steps)
        best = min(best, time.process_time() - before)
        change = max(change, float(np.abs(sim.velocity[:, 0] - velocity).max()) / velocity)
    return best, change


def denormals(size: Size) -> Rows:
    """Velocities below the smallest normal number, and grains of a tenth of a micrometre."""
    normal, _ = seconds_for(1e-3, 1e-3)
    slow, change = seconds_for(1e-310, 1e-7)
    yield at_most(
        "time at v = 1e-310 m/s over that at 1e-3 m/s",
        slow / normal,
        12.0,
        "",
        "the wish was 2: processors compute such numbers in microcode, and the engine does not flush them to "
        "zero, so that no result hangs on a flag of the processor; no grain of a separator has one",
    )
    yield at_most("v = 1e-310 m/s in free flight: changes by", change, 1e-12)
    watch = Watch(momentum=True)
    sim = Simulation(plane(friction=0.3, step=1e-5, materials={"grain": GRAIN}), threads=1)
    sim.add([0.0, 0.8e-7, 0.0], velocity=(1e-3, 0.0, 0.0), material="grain", diameter=1e-7)
    watch.step(sim, 2000)
    push = float(sim.contacts["impulse"][0, 1]) / sim.step_size if len(sim.contacts) else math.nan
    yield at_most("grain of 0.1 µm at rest: error of its height", relative(float(sim.position[0, 1]), 0.5e-7), 1e-6)
    yield at_most("grain of 0.1 µm at rest: error of its weight", relative(push, float(sim.mass[0]) * GRAVITY), 1e-6)
    yield watch.row()


# ---- not finite (37) -------------------------------------------------------------------------------------------------

COLUMNS = ("position", "velocity", "angular_velocity", "orientation", "charge")


def poison(column: str, value: float) -> tuple[bool, bool, bool]:
    """Written at step 7: whether the error names step, grain and quantity; the state is kept; a mended run goes on."""
    position, velocity, diameter = start()

    def fresh() -> Simulation:
        sim = Simulation(trough(), threads=1)
        sim.add(position, velocity=velocity, material="grain", diameter=diameter)
        return sim

    sim, twin = fresh(), fresh()
    sim.step(7)
    view = getattr(sim, column)
    good = view[5].copy()
    view[5] = value
    before = sim.state_hash()
    try:
        sim.step(3)
        return False, False, False
    except SimulationError as error:
        named = re.search(rf"step 7\b.*\b{column}\b.*grain {sim.ids[5]}\b", str(error)) is not None
    kept = sim.state_hash() == before
    view[5] = good
    sim.step(10)
    twin.step(17)
    return named, kept, sim.state_hash() == twin.state_hash()


def not_finite(size: Size) -> Rows:
    """NaN, infinities and 1e300 in every column."""
    tried = list(itertools.product(COLUMNS, (math.nan, math.inf, -math.inf, 1e300)))
    named, kept, mended = (sum(column) for column in zip(*(poison(*each) for each in tried), strict=True))
    yield equal("stopped, naming step, grain and quantity", named, len(tried), f"of {len(tried)}")
    yield equal("state as before the step", kept, len(tried), f"of {len(tried)}")
    yield equal("mended, it goes on bit for bit", mended, len(tried), f"of {len(tried)}")


# ---- nothing there (39) ----------------------------------------------------------------------------------------------


def nothing(size: Size) -> Rows:
    """Empty scenes, one grain, grains without contacts."""
    watch = Watch()
    empty = Simulation(Scene(), threads=1)
    watch.step(empty, 1000)
    yield equal("an empty scene: time after 1000 steps", empty.time, 1.0, "s")
    yield equal(
        "an empty scene: grains, contacts and landings", empty.count + len(empty.contacts) + len(empty.landings), 0
    )
    yield equal("no grains added: ids given", len(empty.add(np.zeros((0, 3)))), 0)
    alone = Simulation(bare(), threads=1)
    alone.add((0.0, 0.0, 0.0))
    watch.step(alone, 100)
    error = relative(float(alone.position[0, 1]), -0.5 * GRAVITY * 0.1**2)
    yield at_most("one grain without a machine: error of its fall", error, 1e-12)
    count = 20_000
    sim = Simulation(bare(), threads=1)
    cells = np.indices((28, 28, 28)).reshape(3, -1).T[:count] * 0.05 - 0.7
    sim.add(cells, diameter=1e-3)
    sim.step(3)
    before = time.process_time()
    sim.step(20)
    spent = (time.process_time() - before) / 20 / count
    yield at_most(f"a step of {count} grains without contacts", 1e6 * spent, 1.0, "µs a grain", "on one thread")
    yield watch.row()


# ---- extremes (40) ---------------------------------------------------------------------------------------------------


def extremes(size: Size) -> Rows:
    """The corners of the legal box."""
    steps = (1e-9, 1e-6, 1e-2, 1.0) if size == "full" else (1e-9, 1e-2, 1.0)
    corners = list(itertools.product(steps, (0.0, 1e-12, 10.0), (0.0, 1.0), (0.0, 1e-9, 1000.0)))
    bad = below = 0
    watch = Watch(work=None)
    for step, friction, restitution, gravity in corners:
        sim = corner(step, friction, restitution, gravity)
        for _ in range(10):
            watch.step(sim)
            good = all(np.isfinite(a).all() for a in (sim.position, sim.velocity, sim.angular_velocity))
            bad, below = bad + (not good), below + int((sim.position[:, 1] <= 0.0).sum())
    yield equal(f"{len(corners)} corners of h, µ, e and g: steps with a number that is not finite", bad, 0)
    yield equal(f"{len(corners)} corners of h, µ, e and g: grains below the floor", below, 0)
    worst = 0.0
    for density in (1.0, 30_000.0):
        sim = Simulation(plane(materials={"grain": {**GRAIN, "density": density}}), threads=1)
        sim.add([(0.0, 0.5e-3, 0.0), (0.0, 1.5e-3, 0.0)], material="grain", diameter=1e-3)
        watch.step(sim, 300)
        worst = max(worst, float(np.abs(sim.position[:, 1] - (0.5e-3, 1.5e-3)).max()))
    yield at_most("densities of 1 and 30 000 kg/m³: two grains at rest move by", worst, 1e-8, "m")
    yield watch.row()


def corner(step: float, friction: float, restitution: float, gravity: float) -> Simulation:
    """A dozen grains over a plane."""
    material = grain(friction=friction, restitution=restitution, rolling_friction=friction)
    scene = plane(
        friction=friction, restitution=restitution, rolling_friction=friction, step=step, materials={"grain": material}
    )
    scene.gravity = (0.0, -gravity, 0.0)
    sim = Simulation(scene, threads=1)
    position, velocity, diameter = start()
    sim.add(position, velocity=velocity, material="grain", diameter=diameter)
    return sim


# ---- long runs (41) --------------------------------------------------------------------------------------------------


def long_run(size: Size) -> Rows:
    """Fifty grains that spin for ever."""
    steps = 1_000_000 if size == "full" else 20_000
    scene = bare((0.0, 0.0, 0.0))
    scene.numerics = Numerics(step=1e-3)
    sim = Simulation(scene, threads=1)
    rng = np.random.default_rng(2)
    cells = np.indices((5, 5, 2)).reshape(3, -1).T * 0.1
    sim.add(cells, diameter=1e-3, angular_velocity=rng.normal(0.0, 300.0, (50, 3)))
    turn: Array = sim.angular_velocity.copy()
    watch = Watch()
    sim.step(steps - 500)
    watch.step(sim, 500)
    off = float(np.abs(np.linalg.norm(sim.orientation, axis=1) - 1.0).max())
    yield at_most(f"quaternions after {steps} steps: | |q| − 1 |", off, 1e-12)
    yield equal("the clock, less steps times h", sim.time - steps * 1e-3, 0.0, "s", "a product, not a sum")
    angle = 0.5 * np.linalg.norm(turn, axis=1) * sim.time
    axis = turn / np.linalg.norm(turn, axis=1)[:, None]
    exact = np.column_stack([np.cos(angle), np.sin(angle)[:, None] * axis])
    error = np.abs(np.abs((exact * sim.orientation).sum(axis=1)) - 1.0).max()
    yield at_most("orientation against cos(ω t/2): 1 − |q·q'|", error, 1e-9)
    yield at_most("angular velocities change by", np.abs(sim.angular_velocity - turn).max(), 0.0, "rad/s")
    spoilt = Simulation(scene, threads=1)
    spoilt.add((0.0, 0.0, 0.0), diameter=1e-3, angular_velocity=(1.0, -2.0, 3.0))
    spoilt.orientation[:] *= 1.01
    spoilt.step()
    norm = float(np.linalg.norm(spoilt.orientation[0]))
    yield at_most("a quaternion 1 % too long, one step later: | |q| − 1 |", abs(norm - 1.0), 1e-15)
    yield watch.row()


CASES = (
    Case("36", "denormal numbers", "a hundred times slower, or rounded to zero", "free flight; statics", denormals),
    Case("37", "not finite", "a NaN spreads without a word", "the state before the step", not_finite),
    Case("39", "nothing there", "loops over nothing", "free fall", nothing),
    Case("40", "extreme parameters", "0/0, overflow, steps of a second", "finite, above the floor", extremes),
    Case("41", "a long run", "quaternions drift, sums of h gather rounding", "uniform rotation; t = k h", long_run),
)
