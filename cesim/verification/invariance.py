"""Physics that must not depend on place, direction, speed, size or order (docs/numerics.md 3, cases 02, 31-33, 35)."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import engine
from ..scene import Drum, Scene
from ..simulation import Simulation
from .rows import Case, Rows, Size, at_most, equal
from .scenes import GRAVITY, Array, bare, grain, plane, wall
from .watch import Watch

GRAIN = grain(friction=0.3, restitution=0.4, rolling_friction=0.05)
Turn = NDArray[np.float64]


def trough(scale: float = 1.0, step: float = 1e-3, shift: Any = (0.0, 0.0, 0.0), turn: Turn | None = None) -> Scene:
    """A floor between two walls: scaled, then turned or mirrored by a matrix, then moved."""
    turn = np.eye(3) if turn is None else turn
    sides = [
        ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        ((-5e-3, 0.0, 0.0), (1.0, 0.0, 0.0)),
        ((5e-3, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    ]
    walls = []
    for point, normal in sides:
        place, way = turn @ np.array(point) * scale + np.asarray(shift), turn @ np.array(normal)
        walls.append(wall(place, way, friction=0.4, restitution=0.3, rolling_friction=0.05))
    return bare(turn @ (0.0, -GRAVITY, 0.0), walls=walls, materials={"grain": GRAIN}, numerics={"step": step})


def start(count: int = 12, seed: int = 3) -> tuple[Array, Array, Array]:
    """Positions, velocities and diameters of grains that are about to fall onto each other."""
    rng = np.random.default_rng(seed)
    cells = np.indices((3, 3, 3)).reshape(3, -1).T[:count] * 1.4e-3 + (-1.4e-3, 1e-3, -1.4e-3)
    shaken = cells + rng.uniform(-1e-4, 1e-4, (count, 3))
    return shaken, rng.normal(0.0, 0.2, (count, 3)), rng.uniform(0.6e-3, 1.2e-3, count)


def fall(watch: Watch, scene: Scene, position: Array, velocity: Array, diameter: Array, steps: int = 60) -> Simulation:
    """The grains after some steps, in which they have collided."""
    sim = Simulation(scene, threads=1)
    sim.add(position, velocity=velocity, material="grain", diameter=diameter)
    watch.step(sim, steps)
    return sim


# ---- sizes (02) ------------------------------------------------------------------------------------------------------


def sizes(size: Size) -> Rows:
    """Fine grains beside a large drum and among large grains."""
    watch = Watch(work=None)
    rng = np.random.default_rng(8)
    for radius in (0.15, 5.0):
        r, n = 2.5e-5, 400
        angle, depth = rng.uniform(0.0, 2.0 * math.pi, n), r * rng.uniform(-0.5, 0.005, n)
        reach = radius + r + depth
        position = np.column_stack([reach * np.cos(angle), reach * np.sin(angle), rng.uniform(-0.1, 0.1, n)])
        scene = bare((0.0, 0.0, 0.0), drum=Drum(radius=radius, speed=0.0), numerics={"grain_contact": False})
        sim = Simulation(scene, threads=1)
        sim.add(position, diameter=2.0 * r)
        watch.step(sim)
        contacts = sim.contacts
        with localcontext() as context:
            context.prec = 40
            exact = [
                float((Decimal(x) ** 2 + Decimal(y) ** 2).sqrt() - Decimal(radius) - Decimal(r))
                for x, y, _ in position[contacts["a"]].tolist()
            ]
        worst = float(np.abs(contacts["gap"] - exact).max())
        yield equal(f"drum of {radius} m: contacts found", len(contacts), n)
        yield at_most(
            f"drum of {radius} m: error of the gap of 0.05 mm grains", worst / radius, 1e-15, "R", "against 40 digits"
        )
    missed = ghosts = 0
    for seed in (1, 2, 3):
        gone, more = against_brute_force(watch, seed)
        missed, ghosts = missed + gone, ghosts + more
    yield equal("cloud of 1:400: touching pairs that are not found", missed, 0)
    yield equal("cloud of 1:400: contacts that are not near", ghosts, 0)
    yield watch.row()


def against_brute_force(watch: Watch, seed: int, count: int = 1500) -> tuple[int, int]:
    """Touching pairs of a random cloud that have no contact, and contacts farther than a tenth of the diameters."""
    rng = np.random.default_rng(seed)
    d = 1e-3 * 400.0 ** -rng.random(count)
    d[: count // 50], d[-1] = 1e-3, 1e-3 / 400.0
    d = rng.permutation(d)
    side = 1.3 * (count * float(np.mean(d**3))) ** (1.0 / 3.0)
    position = rng.uniform(-0.5 * side, 0.5 * side, (count, 3)) + rng.uniform(-1.0, 1.0, 3)  # cells of either sign
    sim = Simulation(bare((0.0, 0.0, 0.0), materials={"grain": grain()}), threads=1)
    sim.add(position, material="grain", diameter=d)
    watch.step(sim)
    a, b = np.triu_indices(count, 1)
    gap = np.linalg.norm(position[a] - position[b], axis=1) - 0.5 * (d[a] + d[b])
    code = a * count + b
    found = sim.contacts["a"] * count + sim.contacts["b"]
    near = code[gap <= 0.1 * (d[a] + d[b])]
    return int(np.setdiff1d(code[gap <= 0.0], found).size), int(np.setdiff1d(found, near).size)


# ---- motion, direction, mirror (31) ----------------------------------------------------------------------------------


def symmetry(size: Size) -> Rows:
    """The same scene moving, turned and mirrored."""
    watch = Watch()
    position, velocity, diameter = start(24)
    velocity[:12, 1], velocity[12:, 1] = 0.3, -0.3
    scene = bare((0.0, 0.0, 0.0), materials={"grain": GRAIN})
    rest, moving = (
        fall(watch, scene, position, velocity + np.array([v, 0.0, 0.0]), diameter, 40) for v in (0.0, 100.0)
    )
    drift = np.array([100.0 * rest.time, 0.0, 0.0])
    yield at_most(
        "100 m/s added: positions differ by", np.abs(moving.position - drift - rest.position).max(), 1e-9, "m"
    )
    position, velocity, diameter = start()
    one = fall(watch, trough(), position, velocity, diameter)
    for name, turn, bound in (
        ("mirrored in x", np.diag([-1.0, 1.0, 1.0]), 1e-12),
        ("mirrored in z", np.diag([1.0, 1.0, -1.0]), 1e-12),
        ("mirrored in y", np.diag([1.0, -1.0, 1.0]), 1e-12),
        ("turned by a third about the diagonal", np.eye(3)[[1, 2, 0]], 1e-12),
        ("turned by an arbitrary angle", some_turn(), 1e-9),
    ):
        other = fall(watch, trough(turn=turn), position @ turn.T, velocity @ turn.T, diameter)
        yield at_most(f"{name}: positions differ by", np.abs(other.position @ turn - one.position).max(), bound, "m")
        spin = other.angular_velocity @ turn * np.linalg.det(turn)
        yield at_most(f"{name}: spins differ by", np.abs(spin - one.angular_velocity).max(), 1e6 * bound, "rad/s")
    yield watch.row()


def some_turn() -> Turn:
    """A rotation that no axis is special to."""
    q, r = np.linalg.qr(np.random.default_rng(11).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return np.asarray(q * np.sign(np.linalg.det(q)))


# ---- far away (32) ---------------------------------------------------------------------------------------------------


def far(size: Size) -> Rows:
    """The same scene metres and a kilometre away; a million metres are refused."""
    watch = Watch()
    position, velocity, diameter = start()
    shift = np.array([8.0, -8.0, 8.0])
    one = fall(watch, trough(), position, velocity, diameter)
    other = fall(watch, trough(shift=shift), position + shift, velocity, diameter)
    yield at_most("8 m away: positions differ by", np.abs(other.position - shift - one.position).max(), 1e-9, "m")
    definition = plane(friction=0.3).definition()
    definition["lower"], definition["upper"] = (-1e4,) * 3, (1e4,) * 3
    definition["surfaces"][0]["position"] = (1e3,) * 3
    scene = engine.Scene(definition)
    nothing, kind = np.zeros((1, 3)), np.zeros(1, np.int32)
    scene.add([[1e3, 1e3 + 0.6e-3, 1e3]], nothing, nothing, kind, [1e-3], [0.0])
    scene.step(300)
    yield at_most(
        "1 km away: height of a grain at rest, off by",
        abs(float(scene.position[0, 1]) - 1e3 - 0.5e-3),
        1e-9,
        "m",
        "doubles there are 1.1e-13 m apart",
    )
    yield at_most("1 km away: its speed", np.abs(scene.velocity).max(), 1e-9, "m/s")
    refused = 0
    definition["surfaces"][0]["position"] = (1e6,) * 3
    for attempt in (
        lambda: engine.Scene(definition),
        lambda: scene.add([[2e6, 0.0, 0.0]], nothing, nothing, kind, [1e-3], [0.0]),
    ):
        try:
            attempt()
        except engine.InputError:
            refused += 1
    yield equal("1000 km away: surfaces and grains refused", refused, 2)
    yield watch.row()


# ---- scale (33) ------------------------------------------------------------------------------------------------------


def scale(size: Size) -> Rows:
    """Froude's law: lengths by s, times and velocities by its root."""
    watch = Watch()
    for s in (1e-2, 1e-3, 1e3):
        position, velocity, diameter = start(12 if s < 1.0 else 2)
        if s > 1.0:
            diameter *= 0.5  # the engine takes grains of up to 1 m
        one = fall(watch, trough(), position, velocity, diameter)
        root = math.sqrt(s)
        other = fall(watch, trough(s, 1e-3 * root), position * s, velocity * root, diameter * s)
        yield at_most(
            f"lengths by {s:.0e}: positions differ by",
            np.abs(other.position / s - one.position).max(),
            1e-12,
            "m, unscaled",
        )
        sweeps = other.health.total_iterations - one.health.total_iterations
        yield equal(f"lengths by {s:.0e}: sweeps differ by", sweeps, 0)
    yield watch.row()


# ---- order (35) ------------------------------------------------------------------------------------------------------


def order(size: Size) -> Rows:
    """The same grains, added in another order."""
    watch = Watch(work=None)
    rng = np.random.default_rng(4)
    count = 500
    position = rng.uniform((-0.1, 0.2, -0.1), (0.1, 0.3, 0.1), (count, 3))
    shuffled = rng.permutation(count)
    flights = []
    for rows in (np.arange(count), shuffled):
        sim = Simulation(bare(numerics={"grain_contact": False}), threads=1)
        sim.add(position[rows], velocity=(0.1, 0.0, 0.0), material="copper", diameter=0.3e-3)
        watch.step(sim, 30)
        flights.append(sim.position.copy())
    yield at_most("free flight: positions differ by", np.abs(flights[0][shuffled] - flights[1]).max(), 0.0, "m")
    heights, contacts = [], []
    for seed in (None, 1, 2):
        sim = heap(seed, 150)
        watch.step(sim, 150)
        heights.append(float((sim.mass * sim.position[:, 1]).sum() / sim.mass.sum()))
        contacts.append(sim.health.contacts)
    note = "sweeps go in the order of ids: single grains differ, heaps do not"
    yield at_most("heaps: heights of their centre differ by", max(heights) / min(heights) - 1.0, 0.05, "", note)
    yield at_most("heaps: numbers of contacts differ by", max(contacts) / min(contacts) - 1.0, 0.15)
    yield watch.row()


def heap(seed: int | None, count: int) -> Simulation:
    """Grains that fall between four walls, in an order by the seed."""
    half = 6e-3
    sides = [((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
    for x, z in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        sides.append(((-half * x, 0.0, -half * z), (float(x), 0.0, float(z))))
    walls = [wall(point, normal, friction=0.4, restitution=0.3) for point, normal in sides]
    sim = Simulation(bare(walls=walls, materials={"grain": grain(friction=0.3)}), threads=1)
    rng = np.random.default_rng(5)
    n = 7
    i = np.arange(count)
    place = np.column_stack([i % n, i // (n * n), (i // n) % n]) * 1.5e-3 + (-4.5e-3, 1e-3, -4.5e-3)
    place += rng.uniform(-1e-4, 1e-4, (count, 3))
    diameter, velocity = rng.uniform(0.6e-3, 1.2e-3, count), rng.normal(0.0, 0.2, (count, 3))
    rows = i if seed is None else np.random.default_rng(seed).permutation(count)
    sim.add(place[rows], velocity=velocity[rows], material="grain", diameter=diameter[rows])
    return sim


CASES = (
    Case(
        "02",
        "size ratio 1:400",
        "a cell fits one size; R − d loses the digits of a small d",
        "40-digit arithmetic; brute force",
        sizes,
    ),
    Case("31", "motion, rotation, mirror", "code that prefers an axis or a frame", "invariance of mechanics", symmetry),
    Case("32", "far from the origin", "positions far off leave few digits to gaps", "the scene at the origin", far),
    Case("33", "scale", "a length, time or mass typed into the code", "Froude's law", scale),
    Case("35", "order of insertion", "sweeps go in some order", "the same grains", order),
)
