"""Arches: wedges stand while a line of thrust fits into them, spheres cannot (docs/numerics.md 3, case 08)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linprog

from ..simulation import Simulation
from .bodies import Block, put, with_bodies
from .rows import Rows, Size, at_least, at_most, relative
from .scenes import Array, bare, grain, plane, wall
from .watch import Watch

RADIUS = 20e-3  # m, of the arches that are built
LEAST_THICKNESS = 0.107426  # over the radius, of a semicircle of endlessly many wedges with friction to spare


@dataclass(frozen=True)
class Arch:
    """A semicircle of equal wedges with radial joints that springs from a floor.

    Attributes
    ----------
    count : of wedges
    thickness : over the mean radius of the joints
    """

    count: int
    thickness: float

    @property
    def joints(self) -> Array:
        """(count + 1, 2, 2) inner and outer end of each joint, mean radius 1, anticlockwise from the right."""
        angle = np.linspace(0.0, math.pi, self.count + 1)
        radius = 1.0 + self.thickness * np.array([-0.5, 0.5])
        return np.asarray(radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])[:, None, :])

    @property
    def wedge(self) -> Array:
        """(4, 2) corners, anticlockwise, of the wedge whose middle would be on the y axis."""
        half = 0.5 * math.pi / self.count
        inner, outer = 1.0 - 0.5 * self.thickness, 1.0 + 0.5 * self.thickness
        x, y = math.sin(half), math.cos(half)
        return np.array(
            [[-inner * x, inner * y], [inner * x, inner * y], [outer * x, outer * y], [-outer * x, outer * y]]
        )

    @property
    def middles(self) -> Array:
        """(count,) angle of each wedge from the x axis, rad."""
        return (np.arange(self.count) + 0.5) * math.pi / self.count


def can_stand(arch: Arch, friction: float) -> bool:
    """Whether forces at the ends of the joints can bear the wedges' weight within Coulomb's cones, in the plane.

    No arch stands without (statics); with enough friction it does stand (Heyman, Int. J. Solids Struct. 2 (1966) 249).
    """
    joints, n = arch.joints, arch.count
    corners = arch.wedge
    height = float(np.abs(_centroid(corners)[1]))
    equations = np.zeros((3 * n, 4 * (n + 1)))  # of forces and moment; normal and shear at both ends of each joint
    for j, ends in enumerate(joints):
        angle = j * math.pi / n
        along, across = np.array([-math.sin(angle), math.cos(angle)]), np.array([math.cos(angle), math.sin(angle)])
        for end, place in enumerate(ends):
            for kind, direction in enumerate((along, across)):
                # A joint pushes the wedge behind it onwards, and the one before it back.
                column = 4 * j + 2 * end + kind
                turn = place[0] * direction[1] - place[1] * direction[0]
                for wedge, sign in ((j, 1.0), (j - 1, -1.0)):
                    if 0 <= wedge < n:
                        equations[3 * wedge : 3 * wedge + 3, column] = sign * np.array([*direction, turn])
    weight = np.column_stack([np.zeros(n), np.ones(n), height * np.cos(arch.middles)]).ravel()
    cones = np.zeros((4 * (n + 1), 4 * (n + 1)))
    for row in range(2 * (n + 1)):
        cones[2 * row, 2 * row : 2 * row + 2] = -friction, 1.0
        cones[2 * row + 1, 2 * row : 2 * row + 2] = -friction, -1.0
    bounds = [(0.0, None), (None, None)] * (2 * (n + 1))
    found = linprog(np.zeros(4 * (n + 1)), cones, np.zeros(len(cones)), equations, weight, bounds)
    return bool(found.status == 0)


def least(stands: Callable[[float], bool], low: float, high: float) -> float:
    """The number between two from which on something stands, to 1e-5 of it."""
    while high - low > 1e-5 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if stands(middle) else (middle, high)
    return high


def _centroid(corners: Array) -> Array:
    following = np.roll(corners, -1, axis=0)
    cross = corners[:, 0] * following[:, 1] - following[:, 0] * corners[:, 1]
    return np.asarray(((corners + following) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum()))


def built(arch: Arch, friction: float) -> Simulation:
    """The arch as convex grains on a floor, all joints closed."""
    block = Block.of(RADIUS * arch.wedge, depth=0.3 * RADIUS)
    scene = plane(friction=friction, materials={"grain": grain(friction=friction)})
    sim = with_bodies(scene, block.shape("wedge"))
    height = RADIUS * float(_centroid(arch.wedge)[1])
    for angle in arch.middles:
        turn = 0.5 * (angle - 0.5 * math.pi)
        place = (height * math.cos(angle), height * math.sin(angle), 0.0)
        put(sim, block, place, turn=(math.cos(turn), 0.0, 0.0, math.sin(turn)))
    return sim


def wedges(size: Size, watch: Watch) -> Rows:
    """Nine wedges stand from the least thickness, and the least friction, of their statics on."""
    many = Arch(81, 0.0)
    yield at_most(
        "arch of 81 wedges: error of its least thickness over radius by statics",
        relative(least(lambda thick: can_stand(replace(many, thickness=thick), 1.0), 0.05, 0.2), LEAST_THICKNESS),
        1e-3,
        note="0.107426 (Cocchetti & Rizzi, Frattura ed Integrità Strutturale 51 (2020) 356), of wedges without number",
    )
    steps = 200 if size == "quick" else 2000
    nine, thick = Arch(9, 0.16), 0.16
    least_thickness = least(lambda thick: can_stand(replace(nine, thickness=thick), 1.0), 0.05, 0.2)
    least_friction = least(lambda friction: can_stand(nine, friction), 0.1, 1.0)
    trials = (
        ("thickness 0.08 of the radius", 0.08, 1.0, False),
        ("0.95 of the least thickness", 0.95 * least_thickness, 1.0, False),
        ("1.05 of the least thickness", 1.05 * least_thickness, 1.0, True),
        ("thickness 0.16 of the radius", thick, 1.0, True),
        ("thickness 0.16, 0.95 of the least friction", thick, 0.95 * least_friction, False),
        ("thickness 0.16, 1.05 of the least friction", thick, 1.05 * least_friction, True),
    )
    for name, thickness, friction, stands in trials:
        sim = built(replace(nine, thickness=thickness), friction)
        start = sim.position.copy()
        watch.step(sim, steps)
        moved = float(np.abs(sim.position - start).max()) / RADIUS
        note = f"of nine wedges: thickness {least_thickness:.4f} at µ = 1, friction {least_friction:.4f} at 0.16"
        kind, bound = (at_most, 5e-3) if stands else (at_least, 0.1)
        yield kind(f"arch, {name}: one moves in {1e-3 * steps} s by", moved, bound, "of the radius", note)


def spheres(watch: Watch) -> Rows:
    """Five spheres in the line of thrust of their own weights between two walls: no friction makes them an arch."""
    r, steepness = 1e-3, 0.8  # slope of a link over the number of weights that it bears
    slopes = steepness * (2.5 - np.arange(6.0))
    links = 2.0 * r * np.column_stack([np.ones(6), slopes]) / np.hypot(1.0, slopes)[:, None]
    places = np.cumsum(links[:5], axis=0)
    down = 0.5 * links[0]  # half a link before the first sphere
    foot = places[0] - down
    far = places[-1] + 0.5 * links[-1]
    for friction in (0.6, 10.0):
        walls = [
            wall((*foot, 0.0), (*(links[0] / (2.0 * r)), 0.0), friction=friction),
            wall((*far, 0.0), (*(-links[-1] / (2.0 * r)), 0.0), friction=friction),
        ]
        sim = Simulation(bare(walls=walls, materials={"grain": grain(friction=friction)}), threads=1)
        start = np.column_stack([places, np.zeros(5)])
        sim.add(start, material="grain", diameter=2.0 * r)
        watch.step(sim, 600)
        moved = float(np.abs(sim.position - start).max()) / r
        name = f"arch of five spheres, friction {friction}: one has moved after 0.6 s by"
        yield at_least(name, moved, 1.0, "radii", "in equilibrium, and at the top of its energy")
