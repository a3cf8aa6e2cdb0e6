"""Nothing passes through anything, and nothing bounces off air (docs/numerics.md 3, cases 22, 23, 24).

Shots are fired at a blade whose faces are at x = -t/2 and x = t/2, with its edges at y = +-50 mm and z = +-150 mm.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..scene import Drum, Mesh, Scene, Splitter
from ..simulation import Simulation
from .rows import Case, Rows, Size, at_least, at_most, equal
from .scenes import Array, bare, grain, wall
from .watch import Watch

D = 1e-4  # m, diameter of the shots
HALF = np.array([0.0, 0.05, 0.15])  # m, half the blade's edges; x is its thickness
STEP = 1e-3  # s


def shooting_range(
    thickness: float | None,
    *,
    friction: float = 0.0,
    restitution: float = 0.0,
    gravity: float = 0.0,
    grain_contact: bool = False,
) -> Scene:
    """One blade, or none."""
    shared: dict[str, Any] = {"friction": friction, "restitution": restitution}
    blades = []
    if thickness is not None:
        blades = [Splitter(tip=(0.0, 0.05), length=0.1, width=0.3, thickness=thickness, **shared)]
    return bare(
        (0.0, -gravity, 0.0),
        splitters=blades,
        materials={"shot": grain(**shared)},
        numerics={"step": STEP, "grain_contact": grain_contact},
    )


def fired(scene: Scene, position: ArrayLike, velocity: ArrayLike) -> Simulation:
    """Shots on their way."""
    sim = Simulation(scene, threads=1)
    sim.add(position, velocity=velocity, material="shot", diameter=D)
    return sim


def blade_distance(points: Array, thickness: float) -> Array:
    """Signed distance (n,) from the blade."""
    beyond = np.abs(points) - HALF - (0.5 * thickness, 0.0, 0.0)
    distance = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return np.asarray(np.where(distance > 0.0, distance, beyond.max(axis=1)))


def crosses(start: Array, end: Array) -> NDArray[np.bool_]:
    """Which of the straight ways pass through the middle plane of the blade, inside its edges."""
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = -start[:, 0] / (end[:, 0] - start[:, 0])
        there = start + fraction[:, None] * (end - start)
    inside = (np.abs(there[:, 1:]) <= HALF[1:]).all(axis=1)
    return np.asarray((fraction >= 0.0) & (fraction <= 1.0) & inside)


def shots(thickness: float, stride: float, count: int, seed: int = 1) -> tuple[Array, Array]:
    """Positions on the left of the blade, within a stride of it, and flights (m) of one step, most of them at it."""
    rng = np.random.default_rng(seed)
    away, y, z = rng.uniform(0.0, stride, count), rng.uniform(-0.055, 0.055, count), rng.uniform(-0.155, 0.155, count)
    position = np.column_stack([-0.5 * (thickness + D) - away, y, z])
    up, aside = rng.uniform(-1.4, 1.4, count), rng.uniform(-0.6, 0.6, count)
    way = np.column_stack([np.cos(up) * np.cos(aside), np.sin(up) * np.cos(aside), np.sin(aside)])
    return position, stride * way


# ---- blades (22) -----------------------------------------------------------------------------------------------------


def blades(size: Size) -> Rows:
    """Shots of 30 and 100 diameters a step at a thick and at a thin blade."""
    count = 100_000 if size == "full" else 20_000
    watch = Watch(work=None)  # friction of a blow is solved to a tolerance of its own: 1e-9 m/s
    for thickness in (0.5e-3, 0.0):
        for stride in (3e-3, 10e-3):
            through, aimed, deepest = 0, 0, 0.0
            for restitution in (0.0, 0.5):
                position, flight = shots(thickness, stride, count)
                aimed += int(crosses(position, position + flight).sum())
                sim = fired(shooting_range(thickness, friction=0.3, restitution=restitution), position, flight / STEP)
                for _ in range(3):
                    before = sim.position.copy()
                    watch.step(sim)
                    now, hits = sim.position.copy(), sim.contacts
                    corner = before.copy()  # the way is the one to the hit, and the one from there
                    corner[hits["a"]] = hits["point"] + 0.5 * D * hits["normal"]
                    through += int((crosses(before, corner) | crosses(corner, now)).sum())
                    deepest = max(deepest, 0.5 - float(blade_distance(now, thickness).min()) / D)
            name = f"blade of {1e3 * thickness:.1f} mm, {1e3 * stride:.0f} mm a step"
            yield equal(f"{name}: pass through it", through, 0, "shots", f"of {aimed} on their way through it")
            yield at_most(f"{name}: overlap afterwards", deepest, 1e-6, "d")
    for gravity in (0.0, 9.81):
        worst, hit = points_of_hits(watch, gravity, count // 5)
        bound = 1e-3 + gravity * STEP**2 / 8.0 / D
        note = "a flight is met on its chord: g h²/8 beside the parabola" if gravity else ""
        yield at_most(f"g = {gravity} m/s²: error of the point of a hit", worst, bound, "d", note)
        yield at_least(f"g = {gravity} m/s²: hits compared", hit, count // 20)
    yield watch.row()


def points_of_hits(watch: Watch, gravity: float, count: int) -> tuple[float, int]:
    """Worst error over d of where shots hit a face, against the plane in closed form; and how many did."""
    thickness = 0.5e-3
    position, flight = shots(thickness, 3e-3, count)
    position[:, 1:] *= 0.9  # away from the edges
    sim = fired(shooting_range(thickness, gravity=gravity), position, flight / STEP)
    watch.step(sim)
    hits = sim.contacts[np.linalg.norm(sim.contacts["impulse"], axis=1) > 0.0]
    hits = hits[np.abs(hits["normal"][:, 0]) == 1.0]
    start, way = position[hits["a"]], flight[hits["a"]]
    fraction = (-0.5 * (thickness + D) - start[:, 0]) / way[:, 0]
    exact = start + way * fraction[:, None]
    exact[:, 1] -= 0.5 * gravity * (STEP * fraction) ** 2
    exact[:, 0] = -0.5 * thickness
    return float(np.linalg.norm(hits["point"] - exact, axis=1).max()) / D, len(hits)


# ---- grains that meet (23) -------------------------------------------------------------------------------------------


def meetings(impact: Array, seed: int, speed: float = 6.0) -> tuple[Array, Array, Array, Array]:
    """Pairs in cells of their own that fly at each other: positions and velocities (2 n, 3) by turns, way, across."""
    rng = np.random.default_rng(seed)
    count = len(impact)
    cells = (np.indices((22, 22, 22)).reshape(3, -1).T[:count] - 10.5) * 0.05
    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    across = np.cross(way, rng.normal(size=(count, 3)))
    across /= np.linalg.norm(across, axis=1)[:, None]
    ahead = rng.uniform(1.5 * D, 0.9 * speed * STEP, count)
    offset = ahead[:, None] * way + impact[:, None] * across
    position = np.stack([cells - 0.5 * offset, cells + 0.5 * offset], axis=1).reshape(-1, 3)
    velocity = np.stack([0.5 * speed * way, -0.5 * speed * way], axis=1).reshape(-1, 3)
    return position, velocity, way, across


def pairs(size: Size) -> Rows:
    """Pairs that close by 60 diameters a step."""
    count = 10_000 if size == "full" else 5_000
    watch = Watch()
    for restitution in (0.0, 0.9, 1.0):
        impact = D * np.sqrt(np.random.default_rng(2).uniform(0.0, 0.999**2, count))
        position, velocity, way, across = meetings(impact, 3)
        sim = fired(shooting_range(None, restitution=restitution, grain_contact=True), position, velocity)
        watch.step(sim)
        normal = (impact[:, None] * across + np.sqrt(D**2 - impact**2)[:, None] * way) / D
        approach = 6.0 * np.sqrt(1.0 - (impact / D) ** 2)
        change = 0.5 * (1.0 + restitution) * approach[:, None] * normal
        wanted = velocity.reshape(-1, 2, 3) + np.stack([-change, change], axis=1)
        error = np.abs(sim.velocity.reshape(-1, 2, 3) - wanted).max(axis=(1, 2)) / 6.0
        yield equal(
            f"e = {restitution}: pairs that should meet and do not", count - len(sim.contacts), 0, f"of {count}"
        )
        yield at_most(
            f"e = {restitution}: error of how they leave",
            error.max(),
            1e-5,
            "of the speed",
            "the touch is found to 1e-7 r, which a graze turns into 1e-5 of the direction",
        )
    impact = D * np.random.default_rng(4).uniform(1.001, 1.2, count)
    position, velocity, *_ = meetings(impact, 5)
    sim = fired(shooting_range(None, grain_contact=True), position, velocity)
    watch.step(sim, 3)
    felt = int((np.abs(sim.velocity - velocity).max(axis=1) > 1e-9).sum())
    yield equal("pass by 1.001 d or more, and feel it", felt, 0, f"of {2 * count}")
    yield watch.row()


# ---- bounces off air (24) --------------------------------------------------------------------------------------------


def nearest_on_way(position: Array, flight: Array, thickness: float) -> Array:
    """Least distance of straight ways from the blade: it has one minimum, so by trisection."""
    low, high = np.zeros(len(position)), np.full(len(position), 3.0)
    for _ in range(60):
        third = (high - low) / 3.0
        one = blade_distance(position + (low + third)[:, None] * flight, thickness)
        other = blade_distance(position + (high - third)[:, None] * flight, thickness)
        low, high = np.where(one > other, low + third, low), np.where(one > other, high, high - third)
    return blade_distance(position + low[:, None] * flight, thickness)


def skimming(count: int) -> tuple[Scene, Array, Array]:
    """Tangents to a drum's side and over the rims of its caps, a thousandth of a radius away: touch points, ways."""
    rng = np.random.default_rng(7)
    radius = 0.16
    gap = 0.5 * D * rng.uniform(1.001, 1.1, count)
    at, lean = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(-1.0, 1.0, count)
    out = np.column_stack([np.cos(at), np.sin(at), np.zeros(count)])
    along = np.column_stack([-np.sin(at) * np.cos(lean), np.cos(at) * np.cos(lean), np.sin(lean)])
    side = np.column_stack([np.zeros((count, 2)), rng.uniform(-0.14, 0.14, count)])
    touch = (radius + gap)[:, None] * out + side
    rim, slope = rng.random(count) < 0.3, rng.uniform(0.3, 1.2, count)
    axis = np.array([0.0, 0.0, 1.0])
    tilted = np.cos(slope)[:, None] * out + np.sin(slope)[:, None] * axis
    touch[rim] = (radius * out + 0.15 * axis + gap[:, None] * tilted)[rim]
    along[rim] = (np.cos(slope)[:, None] * axis - np.sin(slope)[:, None] * out)[rim]
    scene = bare(
        (0.0, 0.0, 0.0),
        drum=Drum(friction=0.5, restitution=0.5, speed=0.0),
        materials={"shot": grain()},
        numerics={"grain_contact": False},
    )
    return scene, touch, along


def seams(watch: Watch, friction: float, count: int = 20) -> tuple[float, int]:
    """How much a seam of a flat sheet of irregular triangles changes the motion of balls that run over it, m/s.

    Against the same balls on an endless plane; and the number of triangles.
    """
    n, width = 60, 0.6
    rng = np.random.default_rng(9)
    i, j = np.indices((n + 1, n + 1)).reshape(2, -1)
    inside = (i > 0) & (i < n) & (j > 0) & (j < n)
    corners = np.column_stack([i, np.zeros(i.size), j]) * width / n - (0.5 * width, 0.0, 0.5 * width)
    corners[inside] += rng.uniform(-0.3, 0.3, (int(inside.sum()), 3)) * (width / n, 0.0, width / n)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    triangles = np.vstack([np.column_stack([a, a + 1, a + n + 2]), np.column_stack([a, a + n + 2, a + n + 1])])
    sheet = Mesh(vertices=corners.tolist(), triangles=triangles.tolist(), friction=friction)
    way = rng.uniform(0.0, 2.0 * np.pi, count)
    place = np.column_stack([rng.uniform(-0.1, 0.1, count), np.full(count, 0.5e-3), rng.uniform(-0.1, 0.1, count)])
    velocity = np.column_stack([np.cos(way), np.zeros(count), np.sin(way)])
    sims = []
    material = {"ball": grain(friction=friction)}
    for parts in ({"meshes": [sheet]}, {"walls": [wall((0, 0, 0), (0, 1, 0), friction=friction)]}):
        sim = Simulation(bare(**parts, materials=material, numerics={"grain_contact": False}), threads=1)
        sim.add(place, velocity=velocity, material="ball", diameter=1e-3)
        sims.append(sim)
    worst = 0.0
    for _ in range(180):
        for sim in sims:
            watch.step(sim)
        worst = max(worst, float(np.abs(sims[0].velocity - sims[1].velocity).max()))
    return worst, len(triangles)


def air(size: Size) -> Rows:
    """Shots that pass edges, drum and rims by a thousandth of a diameter or of a radius."""
    watch = Watch()
    for thickness in (0.5e-3, 0.0):
        position, flight = shots(thickness, 3e-3, 60_000, seed=6)
        edge = 0.05 * np.sign(position[:, 1])
        position[:, 1] = edge + (position[:, 1] - edge) * 0.05
        nearest = nearest_on_way(position, flight, thickness)
        misses = (nearest > 1.001 * 0.5 * D) & (nearest < 1.5 * 0.5 * D)
        velocity = flight[misses] / STEP
        sim = fired(shooting_range(thickness, friction=0.5, restitution=0.5), position[misses], velocity)
        watch.step(sim, 3)
        name = f"past an edge of a blade of {1e3 * thickness:.1f} mm"
        yield at_most(
            f"{name}: change of velocity",
            np.abs(sim.velocity - velocity).max(),
            1e-9,
            "m/s",
            f"{int(misses.sum())} shots",
        )
    count = 5000
    scene, touch, along = skimming(count)
    velocity = 3.0 * along
    ahead = np.random.default_rng(8).uniform(0.2e-3, 2.8e-3, count)[:, None]
    sim = fired(scene, touch - velocity * ahead, velocity)
    watch.step(sim, 3)
    yield at_most(
        "over a drum and its rims: change of velocity",
        np.abs(sim.velocity - velocity).max(),
        1e-9,
        "m/s",
        f"{count} shots",
    )
    for friction in (0.0, 0.3):
        change, triangles = seams(watch, friction)
        name = f"over seams of a flat mesh, µ = {friction}: change of velocity"
        yield at_most(name, change, 1e-9, "m/s", f"{triangles} irregular triangles; against a plane")
    yield watch.row()


CASES = (
    Case(
        "22",
        "tunnelling through blades",
        "30 and 100 diameters a step, at a blade that may have no thickness",
        "straight ways against a box in closed form",
        blades,
    ),
    Case("23", "tunnelling of grains", "60 diameters a step: both move", "u' = u − (1 + e)(u·n) n/2", pairs),
    Case("24", "bounces off air", "looking ahead sees contacts that never come", "straight flight", air),
)
