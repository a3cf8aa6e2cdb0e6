"""Rigid bodies of the hard cases: clusters of spheres, and plates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import engine
from ..scene import Scene
from ..simulation import Simulation
from .scenes import Array


@dataclass(frozen=True)
class Body:
    """A rigid body of equal spheres that do not overlap, in its principal frame, its centre of mass at the origin.

    Attributes
    ----------
    centers : (n, 3) m
    radius : m
    moments : (3,) of inertia, m2, over the mass
    diameter : of the sphere of equal volume, m
    """

    centers: Array
    radius: float
    moments: Array
    diameter: float

    @classmethod
    def of(cls, centers: ArrayLike, radius: float) -> Body:
        """From its spheres; the axes must be its principal ones already."""
        place = np.asarray(centers, float)
        square = np.square(place)
        moments = (square.sum(axis=1)[:, None] - square).mean(axis=0) + 0.4 * radius**2
        return cls(place, radius, moments, 2.0 * radius * len(place) ** (1.0 / 3.0))

    def shape(self, name: str) -> dict[str, Any]:
        """What the engine takes: in units of the diameter."""
        d = self.diameter
        spheres = np.column_stack([self.centers / d, np.full(len(self.centers), self.radius / d)])
        return {"name": name, "kind": "cluster", "moments": tuple(self.moments / d**2), "spheres": spheres}


@dataclass(frozen=True)
class Plate:
    """A box with sharp edges.

    Attributes
    ----------
    edges : (3,) m, full lengths
    """

    edges: Array

    @property
    def moments(self) -> Array:
        """(3,) of inertia over the mass, m2."""
        return np.asarray((np.square(self.edges).sum() - np.square(self.edges)) / 12.0)

    @property
    def diameter(self) -> float:
        """Of the sphere of equal volume, m."""
        return float(np.cbrt(6.0 / np.pi * self.edges.prod()))

    def shape(self, name: str) -> dict[str, Any]:
        """What the engine takes: in units of the diameter."""
        signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        d = self.diameter
        corners = 0.5 * self.edges * signs / d
        return {"name": name, "kind": "convex", "moments": tuple(self.moments / d**2), "vertices": corners}


@dataclass(frozen=True)
class Block:
    """A convex polygon in the x-y plane, drawn out along z, its centre of mass at the origin.

    Attributes
    ----------
    corners : (n, 2) m, anticlockwise
    depth : m, along z
    moments : (3,) of inertia over the mass, m2
    diameter : of the sphere of equal volume, m
    """

    corners: Array
    depth: float
    moments: Array
    diameter: float

    @classmethod
    def of(cls, corners: ArrayLike, depth: float) -> Block:
        """From its corners; x and y must be its principal directions already. Moments by Green's theorem."""
        place = np.asarray(corners, float)

        def sums(p: Array) -> tuple[Array, Array]:
            q = np.roll(p, -1, axis=0)
            return p + q, p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]

        both, cross = sums(place)
        area = 0.5 * float(cross.sum())
        place = place - (both * cross[:, None]).sum(axis=0) / (6.0 * area)
        both, cross = sums(place)
        squares = both**2 - place * np.roll(place, -1, axis=0)
        x, y = (squares * cross[:, None]).sum(axis=0) / (12.0 * area)
        z = depth**2 / 12.0
        diameter = float(np.cbrt(6.0 / np.pi * area * depth))
        return cls(place, depth, np.array([y + z, x + z, x + y]), diameter)

    def shape(self, name: str) -> dict[str, Any]:
        """What the engine takes: in units of the diameter."""
        d = self.diameter
        ends = [
            np.column_stack([self.corners, np.full(len(self.corners), z)])
            for z in (-0.5 * self.depth, 0.5 * self.depth)
        ]
        return {"name": name, "kind": "convex", "moments": tuple(self.moments / d**2), "vertices": np.vstack(ends) / d}


SPHERE = {"name": "sphere", "kind": "sphere", "moments": (0.1, 0.1, 0.1), "spheres": np.zeros((0, 4))}


def with_bodies(scene: Scene, *shapes: dict[str, Any]) -> Simulation:
    """A simulation whose grains may have these shapes, by their index from 1 on."""
    sim = Simulation(scene, threads=1)
    sim.definition["shapes"] = [SPHERE, *shapes]
    sim.engine = engine.Scene(sim.definition, seed=1, threads=1)
    return sim


def put(
    sim: Simulation,
    body: Body | Plate | Block,
    position: ArrayLike,
    *,
    turn: ArrayLike = (1, 0, 0, 0),
    spin: ArrayLike = 0.0,
    shape: int = 1,
) -> None:
    """Add bodies of the grain material."""
    where = np.atleast_2d(np.asarray(position, float))
    n = len(where)
    turns, spins = (np.broadcast_to(np.asarray(a, float), (n, k)).copy() for a, k in ((turn, 4), (spin, 3)))
    material = np.full(n, sim.material_names.index("grain"), np.int32)
    sim.engine.add(
        where,
        np.zeros((n, 3)),
        spins,
        material,
        np.full(n, body.diameter),
        np.zeros(n),
        turns,
        np.full(n, shape, np.int32),
    )


def axes(sim: Simulation) -> Array:
    """Of the first grain, its principal axes in the world, as rows."""
    w, x, y, z = sim.orientation[0]
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def momentum(sim: Simulation, moments: Array) -> Array:
    """Angular momentum over mass of the first grain, m2/s."""
    frame = axes(sim)
    return np.asarray((moments * (frame @ sim.angular_velocity[0])) @ frame)
