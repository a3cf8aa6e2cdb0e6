"""The bodies that clusters stand for: what is inside, how far inside, points of the surface, mass properties.

Each has `mass`, `area`, `lower` and `upper` (corners of its box), and

    occupied(lattice)  which points of a lattice lie inside, (nx, ny, nz)
    depth(points)      how far points inside lie from the surface, (m,)
    slack              by how much `depth` may be too large
    surface(spacing)   points of the surface, and the farthest that any other point of it is from them
    flats              outward normals (k, 3) and offsets (k,) of its flat sides
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from . import mass as masses
from .mass import Array, Mass

Flags = NDArray[np.bool_]
EVEN = np.array(
    [0.8191725133961645, 0.6710436067037893, 0.5497004779019703]
)  # multiples' fractions fill the cube evenly


@dataclass(frozen=True, eq=False)
class Lattice:
    """One point in each cell of a regular grid: in its middle, or scattered so that no flat side hides a layer."""

    lower: Array  # corner of the first cell
    step: float
    counts: tuple[int, int, int]
    scattered: bool = True

    @cached_property
    def points(self) -> Array:
        """(nx, ny, nz, 3)"""
        cell = np.stack(np.meshgrid(*map(np.arange, self.counts), indexing="ij"), axis=-1)
        turn = np.arange(cell.size // 3).reshape(*self.counts, 1)
        shift = np.mod(0.5 + turn * EVEN, 1.0) if self.scattered else 0.5
        return np.asarray(self.lower + self.step * (cell + shift))


class Body(Protocol):
    """What packing and measuring ask of a body."""

    @property
    def slack(self) -> float: ...
    @property
    def mass(self) -> Mass: ...
    @property
    def area(self) -> float: ...
    @property
    def lower(self) -> Array: ...
    @property
    def upper(self) -> Array: ...
    def occupied(self, lattice: Lattice) -> Flags: ...
    def depth(self, points: Array) -> Array: ...
    def surface(self, spacing: float) -> tuple[Array, float]: ...
    @property
    def flats(self) -> tuple[Array, Array]: ...


NO_FLATS = (np.zeros((0, 3)), np.zeros(0))


def _mesh(u: Array, v: Array) -> tuple[Array, Array]:
    a, b = np.meshgrid(u, v, indexing="ij")
    return a.ravel(), b.ravel()


def _line(length: float, spacing: float) -> tuple[Array, float]:
    """Points from 0 to a length, ends included, and their distance."""
    n = max(int(np.ceil(length / spacing)), 1)
    return np.linspace(0.0, length, n + 1), length / n


# ---- round bodies ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """An ellipsoid around the origin."""

    semiaxes: Array

    @property
    def slack(self) -> float:
        return float(1e-8 * self.semiaxes.max())

    @property
    def mass(self) -> Mass:
        return masses.of_ellipsoid(self.semiaxes)

    @property
    def area(self) -> float:
        from scipy.special import elliprg

        return float(4.0 * np.pi * np.prod(self.semiaxes) * elliprg(*self.semiaxes**-2.0))

    @property
    def flats(self) -> tuple[Array, Array]:
        return NO_FLATS

    @property
    def lower(self) -> Array:
        return -self.semiaxes

    @property
    def upper(self) -> Array:
        return self.semiaxes

    def occupied(self, lattice: Lattice) -> Flags:
        return np.asarray(((lattice.points / self.semiaxes) ** 2).sum(axis=-1) < 1.0)

    def depth(self, points: Array) -> Array:
        return distance_to_ellipsoid(points, self.semiaxes)

    def surface(self, spacing: float) -> tuple[Array, float]:
        largest = self.semiaxes.max()
        angle = max(spacing / largest, 0.01)  # the grid is as fine where nothing bends
        polar, step = _line(np.pi, angle)
        around, turn = _line(2.0 * np.pi, angle)
        p, a = _mesh(polar, around)
        unit = np.column_stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)])
        return unit * self.semiaxes, float(0.5 * np.hypot(step, turn) * largest)


def distance_to_ellipsoid(points: Array, semiaxes: Array) -> Array:
    """Distance of points (m, k) inside an ellipse or ellipsoid (k semiaxes) from its surface.

    The nearest point is e^2 p / (e^2 - s) for the s in [0, e_least^2) that puts it on the surface; s by bisection.
    """
    square, least = semiaxes**2, float(semiaxes.min()) ** 2
    p = np.maximum(np.abs(points), 1e-9 * semiaxes)  # on a plane of symmetry the root would be at the very end
    low, high = np.zeros(len(p)), np.full(len(p), least)  # of t = e_least^2 - s
    for _ in range(80):
        t = 0.5 * (low + high)
        inside = ((semiaxes * p / (t[:, None] + (square - least))) ** 2).sum(axis=1) < 1.0
        high, low = np.where(inside, t, high), np.where(inside, low, t)
    t = 0.5 * (low + high)
    nearest = square * p / (t[:, None] + (square - least))
    return np.asarray(np.linalg.norm(nearest - p, axis=1))


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A cylinder around the origin along z over an ellipse of semiaxes a and b."""

    a: float
    b: float
    height: float

    @property
    def slack(self) -> float:
        return 1e-8 * max(self.a, self.b)

    @property
    def mass(self) -> Mass:
        return masses.of_cylinder(self.a, self.b, self.height)

    @property
    def area(self) -> float:
        from scipy.special import ellipe

        large, small = max(self.a, self.b), min(self.a, self.b)
        around = 4.0 * large * ellipe(1.0 - (small / large) ** 2)
        return float(2.0 * np.pi * self.a * self.b + around * self.height)

    @property
    def flats(self) -> tuple[Array, Array]:
        return np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]), np.full(2, 0.5 * self.height)

    @property
    def lower(self) -> Array:
        return -self.upper

    @property
    def upper(self) -> Array:
        return np.array([self.a, self.b, 0.5 * self.height])

    def occupied(self, lattice: Lattice) -> Flags:
        x, y, z = np.moveaxis(lattice.points / np.array([self.a, self.b, 0.5 * self.height]), -1, 0)
        return np.asarray((x * x + y * y < 1.0) & (abs(z) < 1.0))

    def depth(self, points: Array) -> Array:
        if self.a == self.b:
            across = self.a - np.hypot(points[:, 0], points[:, 1])
        else:
            across = distance_to_ellipsoid(points[:, :2], np.array([self.a, self.b]))
        return np.minimum(across, 0.5 * self.height - np.abs(points[:, 2]))

    def surface(self, spacing: float) -> tuple[Array, float]:
        largest = max(self.a, self.b)
        around, turn = _line(2.0 * np.pi, spacing / largest)
        up, step = _line(self.height, spacing)
        out, ring = _line(1.0, spacing / largest)
        angle, z = _mesh(around, up - 0.5 * self.height)
        side = np.column_stack([self.a * np.cos(angle), self.b * np.sin(angle), z])
        angle, rho = _mesh(around, out)
        end = np.column_stack([self.a * rho * np.cos(angle), self.b * rho * np.sin(angle), 0.0 * rho])
        half = np.array([0.0, 0.0, 0.5 * self.height])
        covering = 0.5 * max(np.hypot(largest * turn, step), np.hypot(largest * turn, largest * ring))
        return np.concatenate([side, end - half, end + half]), float(covering)


@dataclass(frozen=True, eq=False)
class Cone:
    """A cone along z whose base lies at z = 0."""

    radius: float
    height: float
    slack: float = 0.0

    @property
    def mass(self) -> Mass:
        return masses.of_cone(self.radius, self.height)

    @property
    def slant(self) -> float:
        """Length of the side."""
        return float(np.hypot(self.radius, self.height))

    @property
    def area(self) -> float:
        return float(np.pi * self.radius * (self.radius + self.slant))

    @property
    def flats(self) -> tuple[Array, Array]:
        return np.array([[0.0, 0.0, -1.0]]), np.zeros(1)

    @property
    def lower(self) -> Array:
        return np.array([-self.radius, -self.radius, 0.0])

    @property
    def upper(self) -> Array:
        return np.array([self.radius, self.radius, self.height])

    def occupied(self, lattice: Lattice) -> Flags:
        x, y, z = np.moveaxis(lattice.points, -1, 0)
        return np.asarray((np.hypot(x, y) < self.radius * (1.0 - z / self.height)) & (z > 0.0))

    def depth(self, points: Array) -> Array:
        rho, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
        return np.minimum(((self.height - z) * self.radius - rho * self.height) / self.slant, z)

    def surface(self, spacing: float) -> tuple[Array, float]:
        around, turn = _line(2.0 * np.pi, spacing / self.radius)
        along, step = _line(1.0, spacing / self.slant)
        angle, rho = _mesh(around, along)
        across = self.radius * rho[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        side = np.column_stack([across, self.height * (1.0 - rho)])
        base = np.column_stack([across, 0.0 * rho])
        return np.concatenate([side, base]), float(0.5 * np.hypot(self.radius * turn, self.slant * step))


@dataclass(frozen=True, eq=False)
class Tube:
    """What a ball sweeps along a helix (or, with `coil` 0, along a straight line) that keeps clear of itself.

    The helix has radius `coil`, rises by `rise` a radian and has the given arc length. Over an arc ds of curvature k
    the element of volume, x nearer to the centre of curvature, is (1 - k x) dA ds; a half ball closes either end.
    """

    radius: float
    length: float
    coil: float = 0.0
    rise: float = 1.0
    slack: float = 0.0

    @property
    def speed(self) -> float:
        """Arc length a radian."""
        return float(np.hypot(self.coil, self.rise))

    @property
    def curvature(self) -> float:
        """1 / length."""
        return self.coil / self.speed**2

    def curve(self, s: Array) -> tuple[Array, Array, Array]:
        """Points, tangents and normals (to the axis), each (m, 3), at arc lengths from the middle."""
        angle = s / self.speed
        c, n, o = np.cos(angle), np.sin(angle), np.ones_like(angle)
        points = np.column_stack([self.coil * c, self.coil * n, self.rise * angle])
        tangents = np.column_stack([-self.coil * n, self.coil * c, self.rise * o]) / self.speed
        return points, tangents, np.column_stack([-c, -n, 0.0 * o])

    @property
    def mass(self) -> Mass:
        r, pieces = self.radius, int(np.ceil(self.length / self.speed)) + 1
        t, w = np.polynomial.legendre.leggauss(16)
        edges = np.linspace(-0.5 * self.length, 0.5 * self.length, pieces + 1)
        half = 0.5 * np.diff(edges)[:, None]
        s, ds = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * t).ravel(), (half * w).ravel()
        x, tangent, normal = self.curve(s)
        disc, fourth = np.pi * r**2, 0.25 * np.pi * r**4
        bent = self.curvature * fourth * normal
        first = ds @ (disc * x - bent)
        second = np.einsum("s,si,sj->ij", ds, disc * x - bent, x) - np.einsum("s,si,sj->ij", ds, x, bent)
        second += fourth * (self.length * np.eye(3) - np.einsum("s,si,sj->ij", ds, tangent, tangent))
        ends, tangent, _ = self.curve(np.array([-0.5, 0.5]) * self.length)
        for end, outwards in zip(ends, (-tangent[0], tangent[1]), strict=True):
            cap = 2.0 / 3.0 * np.pi * r**3
            first = first + cap * end + fourth * outwards
            mixed = fourth * np.outer(end, outwards)
            second += cap * np.outer(end, end) + mixed + mixed.T + 2.0 / 15.0 * np.pi * r**5 * np.eye(3)
        return Mass.about_origin(disc * self.length + 4.0 / 3.0 * np.pi * r**3, first, second)

    @property
    def area(self) -> float:
        return 2.0 * np.pi * self.radius * (self.length + 2.0 * self.radius)

    @cached_property
    def _axis(self) -> Array:
        s, _ = _line(self.length, 0.02 * self.radius)
        return self.curve(s - 0.5 * self.length)[0]

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self._axis)

    @property
    def flats(self) -> tuple[Array, Array]:
        return NO_FLATS

    @property
    def lower(self) -> Array:
        return np.asarray(self._axis.min(axis=0) - self.radius)

    @property
    def upper(self) -> Array:
        return np.asarray(self._axis.max(axis=0) + self.radius)

    def occupied(self, lattice: Lattice) -> Flags:
        distance, _ = self._tree.query(lattice.points, distance_upper_bound=self.radius)  # infinite beyond
        return np.asarray(np.isfinite(distance))

    def depth(self, points: Array) -> Array:
        return np.asarray(self.radius - self._tree.query(points)[0])

    def surface(self, spacing: float) -> tuple[Array, float]:
        along, step = _line(self.length, spacing / (1.0 + self.curvature * self.radius))
        around, turn = _line(2.0 * np.pi, spacing / self.radius)
        x, tangent, normal = self.curve(along - 0.5 * self.length)
        binormal = np.cross(tangent, normal)
        ring = np.cos(around)[:, None, None] * normal + np.sin(around)[:, None, None] * binormal
        parts = [(x + self.radius * ring).reshape(-1, 3)]
        polar, tilt = _line(0.5 * np.pi, spacing / self.radius)
        for i, sign in ((0, -1.0), (-1, 1.0)):
            up = sign * np.cos(polar)[:, None, None] * tangent[i]
            parts.append((x[i] + self.radius * (up + np.sin(polar)[:, None, None] * ring[:, i])).reshape(-1, 3))
        longest = step * (1.0 + self.curvature * self.radius)
        covering = 0.5 * max(np.hypot(longest, self.radius * turn), self.radius * np.hypot(tilt, turn))
        return np.concatenate(parts), float(covering)
