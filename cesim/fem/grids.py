"""Unit solutions on the nodes of a grid, with what is known of their errors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .curves import Curve
from .geometry import Machine

Array = NDArray[np.float64]
MIRROR_DEPTH = 12  # spacings under the surface of a conductor in which nodes get the mirrored potential
PROBES = 3000  # points at which errors are measured
CHUNK = 100_000  # points sampled at a time
MOST_NODES = 50_000_000
LEAST_RESOLUTION = 4


@dataclass(frozen=True)
class Nodes:
    """A grid: first node, distance of nodes, and how many along x, y and z; one along z: the same at every z."""

    origin: tuple[float, float, float]
    spacing: tuple[float, float, float]
    counts: tuple[int, int, int]

    @classmethod
    def over(cls, lower: tuple[float, ...], upper: tuple[float, ...], spacing: float, along_z: float | None) -> Nodes:
        """Nodes from one corner to the other, no farther apart than asked for.

        Parameters
        ----------
        lower, upper : (3,) m; in two dimensions the third is not read
        spacing : m, along x and y
        along_z : m; None: two dimensions
        """
        wanted = (spacing, spacing) if along_z is None else (spacing, spacing, along_z)
        counts = [
            max(math.ceil((high - low) / h - 1e-9), 4) + 1 for low, high, h in zip(lower, upper, wanted, strict=False)
        ]
        if math.prod(counts) > MOST_NODES:
            raise InputError(f"calls for a grid of {math.prod(counts):.3g} nodes, at most {MOST_NODES}", path="spacing")
        steps = [(high - low) / (n - 1) for low, high, n in zip(lower, upper, counts, strict=False)]
        x, y, z = (*lower[: len(counts)], 0.0)[:3]
        a, b, c = (*steps, 1.0)[:3]
        nx, ny, nz = (*counts, 1)[:3]
        return cls((x, y, z), (a, b, c), (nx, ny, nz))

    def axes(self) -> tuple[Array, Array, Array]:
        """Places along x, y and z, m."""
        x, y, z = (
            np.asarray(o + h * np.arange(n), np.float64)
            for o, h, n in zip(self.origin, self.spacing, self.counts, strict=True)
        )
        return x, y, z


@dataclass(frozen=True)
class UnitGrids:
    """For each conductor the potential on the nodes while it is at 1 V and all else at 0.

    Attributes
    ----------
    values : (conductors, nx, ny, nz)
        Under the surface of a conductor the potential goes on as outside, mirrored: V(r) = 2 V_c - V(R^2/r), which for
        a long cylinder is the harmonic continuation, so that a spline through the nodes has no kink at the surface.
    points : (p, 3) m, probes between the nodes
    field, coarse_field : (conductors, p, 3) 1/m
        Field of the elements there, and of elements twice as large.
    capacitance : (conductors, conductors), charges at unit voltages over epsilon_0: a number in 2-D, m in 3-D
    unknowns : of the linear system
    """

    nodes: Nodes
    values: Array
    points: Array
    field: Array
    coarse_field: Array
    capacitance: Array
    unknowns: int


def unit_grids(
    machine: Machine, dimension: int, resolution: int, nodes: Nodes, tick: Callable[[str], Any] = lambda stage: None
) -> UnitGrids:
    """Solve and sample.

    Parameters
    ----------
    machine : Machine
    dimension : 2 or 3
    resolution : elements along a quarter of each circle
    nodes : where to sample
    tick : called with the name of the stage as the work goes on
    """
    from .problem import solve_units

    half = max(resolution // 2, LEAST_RESOLUTION)
    coarse = solve_units(machine, dimension, half, lambda: tick("half the resolution"))
    units = solve_units(machine, dimension, resolution, lambda: tick("solution"))
    points, z = _probes(machine, nodes)
    both = [np.array(solution.field(points, z)) for solution in (units, coarse)]
    places = np.concatenate([np.repeat(points, len(z), axis=0), np.tile(z, len(points))[:, None]], axis=1)
    x, y, along = nodes.axes()
    plane = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    values = np.empty((len(machine.live), len(plane), len(along)))
    for first in range(0, len(plane), CHUNK):
        values[:, first : first + CHUNK] = _sampled(machine, units.sample, plane[first : first + CHUNK], along, nodes)
        tick("sampling")
    fields = [field.reshape(len(field), -1, 3) for field in both]
    return UnitGrids(
        nodes,
        values.reshape(len(values), *nodes.counts),
        places,
        fields[0],
        fields[1],
        units.capacitance,
        units.unknowns,
    )


def _sampled(machine: Machine, sample: Callable[..., Any], points: Array, z: Array, nodes: Nodes) -> Array:
    values, _ = sample(points, z)
    for k, conductor in enumerate(machine.conductors):
        off = points - (conductor.x, conductor.y)
        r = np.hypot(*off.T)
        inside = np.flatnonzero(r < conductor.radius)
        if not len(inside):
            continue
        farthest = conductor.radius + _depth(machine, k, nodes)
        r = np.maximum(r[inside], 1e-12 * conductor.radius)
        image = np.minimum(conductor.radius**2 / r, farthest)
        mirrored, there = sample((conductor.x, conductor.y) + off[inside] * (image / r)[:, None], z)
        within = np.abs(z) <= 0.5 * conductor.length * (1.0 + 1e-12)
        own = np.array([float(live == k) for live in machine.live])
        mirrored = 2.0 * own[:, None, None] - np.where(there[:, None], mirrored, own[:, None, None])
        values[:, inside] = np.where(within, mirrored, values[:, inside])
    return np.asarray(values)


def _depth(machine: Machine, k: int, nodes: Nodes) -> float:
    """How far above the surface of a conductor its mirror may look, m: not past the middle of a gap."""
    own = machine.conductors[k]
    here = np.array([[own.x, own.y]])
    others: list[Curve] = [part.curve for part in (*machine.conductors[:k], *machine.conductors[k + 1 :])]
    others += [machine.enclosure.curve] if machine.enclosure is not None else []
    gaps = [abs(float(curve.signed(here)[0])) - own.radius for curve in others]
    return min([MIRROR_DEPTH * max(nodes.spacing[:2]), own.radius, *(0.5 * gap for gap in gaps)])


def _probes(machine: Machine, nodes: Nodes) -> tuple[Array, Array]:
    """Points between nodes and outside conductors, (p, 2) m, and places between nodes along z, (k,) m."""
    draw = np.random.default_rng(1)
    cells = np.array(nodes.counts[:2]) - 1
    points = np.array(nodes.origin[:2]) + np.array(nodes.spacing[:2]) * (draw.integers(0, cells, (PROBES, 2)) + 0.5)
    for conductor in machine.conductors:
        points = points[conductor.curve.signed(points) > 0.0]
    n = nodes.counts[2]
    z = np.zeros(1)
    if n > 1:
        z = nodes.origin[2] + nodes.spacing[2] * (np.unique(np.linspace(n // 2, n - 2, 6).astype(int)) + 0.5)
        points = points[: PROBES // 4]
    return points, z
