"""Many at a time: elastic heaps, cradles, time reversed, settling, collapse (numerics.md 3: 26, 27, 34, 38, 42)."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

import numpy as np

from ..scene import Splitter
from ..simulation import Simulation
from .rows import Case, Rows, Size, at_least, at_most, equal, relative
from .scenes import GRAVITY, Array, bare, box, energy, floor_force, grain, wall
from .watch import Watch

D = 1e-3


def rise(watch: Watch, sim: Simulation, steps: int, gravity: float = GRAVITY) -> tuple[float, float]:
    """Greatest rise of the energy over any time in it, and its change from start to end, over the start."""
    values = [energy(sim, gravity)]
    for _ in range(steps):
        watch.step(sim)
        values.append(energy(sim, gravity))
    found = np.array(values)
    return float((found - np.minimum.accumulate(found)).max() / found[0]), float(found[-1] / found[0] - 1.0)


def elastic(size: Size) -> Rows:
    """Energy of heaps and clouds."""
    count, steps = (500, 400) if size == "full" else (200, 300)
    watch = Watch(work=None)
    for friction, gravity in ((0.0, 0.0), (0.0, GRAVITY), (0.3, GRAVITY)):
        name = f"e = 1, {count} grains, µ = {friction}, g = {gravity}"
        up, end = rise(watch, box(count, friction=friction, restitution=1.0, gravity=gravity), steps, gravity)
        yield at_most(
            f"{name}: energy rises by at most",
            up,
            0.01,
            "of the start",
            "the wish was none: a grain that is hit may push a neighbour that leaves it already (Newton's "
            "law for simultaneous impacts), and overlaps taken back lift grains",
        )
        yield at_most(f"{name}: at the end", end, 0.0, "of the start")
    up, _ = rise(watch, box(200), 150)
    yield at_most("e = 0, 200 grains: energy rises by at most", up, 1e-4, "of the start", "overlaps taken back")
    still = box(150, spread=0.1)
    still.step(150)
    resting = box(150, restitution=1.0, spread=0.1)
    resting.position[:] = still.position
    resting.velocity[:] = 0.0
    before, highest = energy(resting), 0.0
    for _ in range(150):
        watch.step(resting)
        highest = max(highest, energy(resting) - before)
    weight = float(resting.mass.sum()) * GRAVITY * D
    yield at_most("a resting heap with e = 1: energy rises by at most", highest / weight, 1e-4, "m g d")
    motion = resting.health.kinetic_energy / weight
    yield at_most("a resting heap with e = 1: kinetic energy 0.15 s later", motion, 1e-4, "m g d")
    moved = float(np.abs(resting.position - still.position).max()) / D
    yield at_most("a resting heap with e = 1: a grain moves by", moved, 0.2, "d")
    yield watch.row()


def row_of_grains(count: int, gap: float, step: float) -> Simulation:
    """Equal elastic spheres on a line, a gap in diameters apart; the first a diameter away from the others."""
    sim = Simulation(
        bare((0.0, 0.0, 0.0), materials={"grain": grain(friction=0.0, restitution=1.0)}, numerics={"step": step}),
        threads=1,
    )
    x = np.arange(count) * D * (1.0 + gap)
    x[0] -= D
    sim.add(np.column_stack([x, np.zeros(count), np.zeros(count)]), material="grain", diameter=D)
    return sim


def cradle(size: Size) -> Rows:
    """Newton's cradle of five."""
    watch = Watch(work=None)
    for gap, step, speed, steps in ((0.01, 1e-4, 0.05, 800), (0.0, 1e-3, 1.0, 5)):
        sim = row_of_grains(5, gap, step)
        sim.velocity[0, 0] = speed
        watch.step(sim, steps)
        v = sim.velocity[:, 0] / speed
        name = f"gaps of {gap} d"
        yield at_most(f"{name}: error of the momentum", abs(v.sum() - 1.0), 1e-9, "of the start")
        yield at_most(f"{name}: energy", float(np.square(v).sum()), 1.0 + 1e-9, "of the start")
        if gap:
            wanted = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
            yield at_most(f"{name}: the last leaves with the first's speed, but for", np.abs(v - wanted).max(), 1e-7)
    yield watch.row()


def reversal(size: Size) -> Rows:
    """Run, turn all velocities round, run as long: back to the start."""
    watch = Watch(work=None)
    rng = np.random.default_rng(3)
    sim = Simulation(bare(), threads=1)
    start = rng.uniform(-0.1, 0.1, (20, 3))
    sim.add(start, velocity=rng.normal(0.0, 1.0, (20, 3)), diameter=1e-4)
    for _ in range(2):
        watch.step(sim, 100)
        sim.velocity[:] *= -1.0
    yield at_most("free flight under gravity: off its start by", np.abs(sim.position - start).max(), 1e-12, "m")
    for count, bound in ((2, 1e-9), (20, 1.0)):
        sim = Simulation(bare((0.0, 0.0, 0.0), materials={"grain": grain(friction=0.0, restitution=1.0)}), threads=1)
        place = np.indices((3, 3, 3)).reshape(3, -1).T[:count] * 1.3 * D
        sim.add(place, velocity=-2.0 * (place - place.mean(axis=0)) / 0.05, material="grain", diameter=D)
        for _ in range(2):
            watch.step(sim, 100)
            sim.velocity[:] *= -1.0
        off = float(np.abs(sim.position - place).max()) / D
        note = (
            "one collision is exact to rounding"
            if count == 2
            else ("documented: a collision seen one step late is not undone, and chaos multiplies what is left")
        )
        yield at_most(f"{count} elastic spheres that collide: off their start by", off, bound, "d", note)
    yield watch.row()


def deepest(sim: Simulation, width: float) -> float:
    """Largest overlap over a radius: of pairs, and with floor and walls."""
    contacts = sim.contacts
    a = np.searchsorted(sim.ids, contacts["a"])
    pair = contacts["b"] >= 0
    b = np.searchsorted(sim.ids, contacts["b"][pair])
    x, r = sim.position, 0.5 * sim.diameter
    first = a[pair]
    gap = np.linalg.norm(x[first] - x[b], axis=1) - r[first] - r[b]
    pairs = float((-gap / np.minimum(r[first], r[b])).max()) if len(gap) else 0.0
    sides = np.column_stack([x[:, 1], 0.5 * width - np.abs(x[:, 0]), 0.5 * width - np.abs(x[:, 2])]).min(axis=1)
    return max(pairs, float((1.0 - sides / r).max()))


def settling(size: Size) -> Rows:
    """A heap comes to rest; in full size, a packing of 200 000 with a million contacts is stepped, too."""
    count, steps = (2000, 300) if size == "full" else (500, 200)
    watch = Watch(work=None)
    sim = box(count)
    worst, motion = 0.0, 0.0
    for _ in range(steps):
        watch.step(sim)
        worst = max(worst, deepest(sim, 0.02))
    motion = sim.health.kinetic_energy / (float(sim.mass.sum()) * GRAVITY * D)
    yield at_most(f"{count} grains: deepest on the way", worst, 0.02, "r")
    yield at_most(f"{count} grains: deepest at the end", deepest(sim, 0.02), 1e-3, "r")
    yield at_most(f"{count} grains: kinetic energy at the end", motion, 1e-3, "m g d a grain")
    yield at_most(
        "error of the force on floor and walls", relative(floor_force(sim), float(sim.mass.sum()) * GRAVITY), 0.02
    )
    yield watch.row()
    if size == "full":
        yield from million()


def million() -> Rows:
    """A close packing of 200 000 spheres, ten steps of at most 100 sweeps."""
    before = resident()
    n = (58, 60, 58)
    i, j, k = np.indices(n).reshape(3, -1)
    place = np.column_stack(
        [i + 0.5 * ((j + k) % 2), np.sqrt(2.0 / 3.0) * j, np.sqrt(0.75) * k + (j % 2) / np.sqrt(12)]
    )
    x = D * place + (0.0, 0.5 * D, 0.0)
    high = x.max(axis=0) + 0.5 * D
    low = x.min(axis=0) - 0.5 * D
    walls = [wall((0, 0, 0), (0, 1, 0), friction=0.3)]
    for axis in (0, 2):
        for edge, side in ((low, 1.0), (high, -1.0)):
            normal = side * np.eye(3)[axis]
            walls.append(wall(np.abs(normal) * edge, normal, friction=0.3))
    scene = bare(walls=walls, materials={"grain": grain(friction=0.3)}, numerics={"max_iterations": 100})
    sim = Simulation(scene, threads=2)
    sim.add(x, material="grain", diameter=D)
    sim.step()
    used = resident() - before
    watch, rows = Watch(work=None), len(sim.contacts)
    for _ in range(9):
        watch.step(sim)
        rows = max(rows, len(sim.contacts))
    health = sim.health
    yield at_least(f"{sim.count} spheres: contacts", rows, 1e6)
    yield at_most("their memory, over the contacts", used / rows, 3000.0, "bytes a contact", "grains included")
    yield at_most(
        "their penetration in 10 steps",
        health.penetration_ratio,
        0.02,
        "r",
        f"{health.unconverged} of 10 steps ran out of their 100 sweeps and say so, residual "
        f"{health.worst_residual:.1e} m/s",
    )
    yield watch.row()


def resident() -> float:
    """Memory of this process now, bytes; where the system does not tell, the most it had so far."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * (1.0 if sys.platform == "darwin" else 1024.0)
    return float(pages * resource.getpagesize())


def collapse(size: Size) -> Rows:
    """A heap behind a gate that is gone from one step to the next."""
    count = 5000 if size == "full" else 300
    width, depth = (0.05, 0.03) if size == "full" else (0.015, 0.009)
    sides = [wall((0, 0, 0), (0, 1, 0), friction=0.4)]
    for x, reach in ((1, width), (-1, 3.0 * width)):
        sides.append(wall((-reach * x, 0, 0), (x, 0, 0)))
    for z in (1, -1):
        sides.append(wall((0, 0, -0.5 * depth * z), (0, 0, z)))
    materials = {"grain": grain(friction=0.4)}
    # A bed of thousands would be solved for minutes; here it must stay whole and tell, however little it is solved.
    numerics = {"max_iterations": 200} if size == "full" else {}
    gate = Splitter(tip=(0.0, 0.2), length=0.2, width=1.0, thickness=1e-3, friction=0.4)
    behind = Simulation(bare(walls=sides, splitters=[gate], materials=materials, numerics=numerics), threads=1)
    behind.add(layers(count, width, depth), material="grain", diameter=diameters(count))
    watch = Watch(work=None)
    watch.step(behind, 120)
    yield at_least("held by the gate", int((behind.position[:, 0] < 0.0).sum()), count, "grains")
    told, spread = watch.steps, behind.position
    free = Simulation(bare(walls=sides, materials=materials, numerics=numerics), threads=1)
    free.add(
        spread,
        velocity=behind.velocity,
        angular_velocity=behind.angular_velocity,
        material="grain",
        diameter=behind.diameter,
    )
    worst = 0.0
    for _ in range(150 if size == "full" else 120):
        watch.step(free)
        worst = max(worst, free.health.penetration_ratio)
    yield equal("grains after the collapse", free.count, count)
    yield at_least("reach beyond the gate", float(free.position[:, 0].max()) / width, 0.2, "of the width")
    yield at_most(
        "deepest overlap of a step",
        worst,
        0.05,
        "r",
        f"{free.health.unconverged} of {watch.steps - told} steps ran out of sweeps and say so, residual at "
        f"worst {free.health.worst_residual:.1e} m/s",
    )
    yield watch.row()


def layers(count: int, width: float, depth: float) -> Array:
    """Loose layers behind the gate at x = 0."""
    pitch = 1.25e-3
    nx, nz = int((width - 2e-3) / pitch), int((depth - 1e-3) / pitch)
    i = np.arange(count)
    place = np.column_stack([i % nx, i // (nx * nz), (i // nx) % nz]) * pitch
    corner = np.array([-width + 1e-3, 1e-3, -0.5 * (nz - 1) * pitch])
    return np.asarray(place + corner + np.random.default_rng(5).uniform(-5e-5, 5e-5, (count, 3)))


def diameters(count: int) -> Array:
    """0.8-1.2 mm."""
    return np.random.default_rng(6).uniform(0.8e-3, 1.2e-3, count)


CASES = (
    Case("26", "elastic heaps", "restitution pumps energy into simultaneous contacts", "energy is not born", elastic),
    Case(
        "27",
        "Newton's cradle",
        "simultaneous impacts of rigid bodies are not determined",
        "a chain of single impacts; momentum and energy",
        cradle,
    ),
    Case("34", "time reversed", "a scheme that dissipates does not come back", "reversibility of mechanics", reversal),
    Case("38", "a heap comes to rest", "hundreds of contacts share every load", "statics", settling),
    Case(
        "42", "sudden collapse", "a burst of contacts after the gate has gone", "nothing is lost, all is told", collapse
    ),
)
