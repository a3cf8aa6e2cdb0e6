"""Bodies inside closed surfaces of triangles, convex or not."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, number
from . import mass as masses
from .bodies import NO_FLATS, Flags, Lattice
from .mass import Array, Mass

Indices = NDArray[np.int64]
SHIFTS = (0.1234567, 0.3456789, 0.2718281, 0.4142135)  # of the columns, so that they meet no corner
AT_ONCE = 500_000  # points that are tried against triangles
SAMPLES = 60  # points of the surface along the diameter of equal volume, for distances


def _extent(points: Array) -> tuple[Array, Array]:
    return points.min(axis=1), points.max(axis=1)


def _crossing(triangles: Array, points: Array) -> tuple[Array, Indices]:
    """Where lines along z through points (n, k, 3) cross triangles (n, 3, 3): height, and +1 in, -1 out, 0 never."""
    a, b, c = triangles.transpose(1, 0, 2)[:, :, None, :]
    x, y = points[..., 0], points[..., 1]

    def side(p: Array, q: Array) -> Array:
        return np.asarray((q[..., 0] - p[..., 0]) * (y - p[..., 1]) - (q[..., 1] - p[..., 1]) * (x - p[..., 0]))

    u, v, w = side(b, c), side(c, a), side(a, b)
    total = u + v + w
    hit = (np.sign(u) == np.sign(v)) & (np.sign(v) == np.sign(w)) & (total != 0.0)
    height = (u * a[..., 2] + v * b[..., 2] + w * c[..., 2]) / np.where(hit, total, 1.0)
    return height, np.where(hit, np.where(total > 0.0, -1, 1), 0)


def _even_rows(k: int) -> tuple[Array, Array]:
    """Weights of two sides of a triangle, for the corners of k^2 like triangles in it."""
    i, j = (index.ravel() for index in np.mgrid[0 : k + 1, 0 : k + 1])
    kept = i + j <= k
    return i[kept] / k, j[kept] / k


def _slender_rows(k: int, m: int) -> tuple[Array, Array]:
    """The same for k rows across it, each of m pieces."""
    s, t = (index.ravel() for index in np.meshgrid(np.arange(k + 1) / k, np.arange(m + 1) / m))
    return s * (1.0 - t), s * t


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """A body inside a closed surface of triangles that are counted anticlockwise from outside."""

    points: Array  # (n, 3)
    faces: Indices  # (m, 3)

    @cached_property
    def mass(self) -> Mass:
        return masses.of_polyhedron(self.points, self.faces)

    @property
    def area(self) -> float:
        a, b, c = self.points[self.faces].transpose(1, 0, 2)
        return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    @property
    def lower(self) -> Array:
        return np.asarray(self.points[self.faces].min(axis=(0, 1)))

    @property
    def upper(self) -> Array:
        return np.asarray(self.points[self.faces].max(axis=(0, 1)))

    def surface(self, spacing: float) -> tuple[Array, float]:
        corners = self.points[self.faces]
        lengths = np.linalg.norm(
            np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1), axis=2
        )  # opposite a corner
        apex = lengths.argmin(axis=1)
        a, b, c = (corners[np.arange(len(apex)), (apex + k) % 3] for k in range(3))
        longest, shortest = lengths.max(axis=1), lengths.min(axis=1)
        slender = shortest < longest / 3.0
        fine = np.where(slender, spacing / np.sqrt(3.0), spacing)
        rows = np.maximum(np.ceil(longest / fine), 1.0).astype(np.int64)
        across = np.where(slender, np.maximum(np.ceil(shortest / fine), 1.0), 0.0).astype(np.int64)
        parts = []
        for k, m in np.unique(np.column_stack([rows, across]), axis=0):
            u, v = _slender_rows(k, m) if m else _even_rows(k)
            same = (rows == k) & (across == m)
            sides = np.stack([b[same] - a[same], c[same] - a[same]], axis=1)
            parts.append((a[same][:, None] + np.einsum("ks,mki->msi", np.stack([u, v]), sides)).reshape(-1, 3))
        # Of the corners of a triangle, one is at most longest edge / sqrt(3) from any of its points; in rows across a
        # slender one, half a row along and half a piece across.
        with np.errstate(divide="ignore", invalid="ignore"):
            gaps = np.where(slender, 0.5 * (longest / rows + shortest / across), longest / rows / np.sqrt(3.0))
        return np.concatenate(parts), float(gaps.max())

    @cached_property
    def _samples(self) -> tuple[Array, float]:
        return self.surface(self.mass.diameter / SAMPLES)

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self._samples[0])

    @property
    def slack(self) -> float:
        return self._samples[1]

    @cached_property
    def flats(self) -> tuple[Array, Array]:
        return NO_FLATS

    def depth(self, points: Array) -> Array:
        """To the nearest sample of the surface: at most `slack` too large."""
        return np.asarray(self._tree.query(points)[0])

    def occupied(self, lattice: Lattice) -> Flags:
        """How often a line downwards from each point leaves the surface more often than it enters: once inside."""
        for shift in SHIFTS:
            winding, total = self._windings(lattice, 1e-6 * shift * lattice.step)
            if total.any():
                continue  # a line met an edge
            if winding.min() < 0 or winding.max() > 1:
                raise InputError(
                    "encloses a place more than once or from the wrong side: it crosses itself", path="faces"
                )
            return np.asarray(winding.reshape(lattice.counts) == 1)
        raise InputError("cannot be told from its outside: its surface folds or crosses itself", path="faces")

    def _windings(self, lattice: Lattice, shift: float) -> tuple[Indices, Indices]:
        """Crossings below each point, and all on its line: +1 where it enters going up. Points are shifted a little."""
        nx, ny, nz = lattice.counts
        corners = self.points[self.faces]
        low, high = ((side - lattice.lower[:2]) / lattice.step for side in _extent(corners[..., :2]))
        most = np.array([nx, ny])
        first = np.maximum(np.clip(np.floor(low - 1e-5), -1, most).astype(np.int64), 0)
        last = np.minimum(np.clip(np.floor(high + 1e-5), -1, most).astype(np.int64), most - 1)
        wide = np.maximum(last - first + 1, 0)
        many = wide[:, 0] * wide[:, 1]  # cells of the plane that a triangle may cover
        face = np.repeat(np.arange(len(corners)), many)
        turn = np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
        column = (first[face, 0] + turn // wide[face, 1]) * ny + first[face, 1] + turn % wide[face, 1]
        columns = lattice.points.reshape(nx * ny, nz, 3) + np.array([shift, shift, 0.0])
        below, total = np.zeros(nx * ny * nz, dtype=np.int64), np.zeros(nx * ny * nz, dtype=np.int64)
        block = max(AT_ONCE // nz, 1)
        for start in range(0, len(face), block):
            some, where = face[start : start + block], column[start : start + block]
            height, sense = _crossing(corners[some], columns[where])
            point = where[:, None] * nz + np.arange(nz)
            np.add.at(total, point, sense)
            np.add.at(below, point, np.where(height < columns[where, :, 2], sense, 0))
        return below, total


@dataclass(frozen=True, eq=False)
class Convex(Polyhedron):
    """A convex polyhedron: distances inside are exact."""

    @cached_property
    def flats(self) -> tuple[Array, Array]:
        """Outward normals (m, 3) and offsets (m,) of the faces."""
        a, b, c = self.points[self.faces].transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        length = np.linalg.norm(normal, axis=1)
        normal = normal[length > 0.0] / length[length > 0.0, None]
        offset = (normal * a[length > 0.0]).sum(axis=1)
        rows = np.column_stack([normal, offset / self.mass.diameter])
        _, first = np.unique(np.round(rows, 9), axis=0, return_index=True)  # triangles of one side have one plane
        return normal[first], offset[first]

    @property
    def slack(self) -> float:
        return 0.0

    def depth(self, points: Array) -> Array:
        result = np.full(len(points), np.inf)
        for normal, offset in zip(*self.flats, strict=True):
            np.minimum(result, offset - points @ normal, out=result)
        return result

    def occupied(self, lattice: Lattice) -> Flags:
        return (self.depth(lattice.points.reshape(-1, 3)) > 0.0).reshape(lattice.counts)


def convex_hull(points: Array) -> Convex:
    """The hull of points, as triangles over the points that are its corners."""
    from scipy.spatial import ConvexHull, QhullError

    extent = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    if len(points) < 4 or not extent > 0.0:
        raise InputError(f"has {len(points)} points that differ too little; a hull needs four that span a volume")
    try:
        hull = ConvexHull((points - points.mean(axis=0)) / extent)
    except (QhullError, ValueError):
        raise InputError("spans no volume: all points lie in a plane") from None
    if hull.volume < 1e-6:
        raise InputError(f"is too flat: its hull fills {number(float(hull.volume))} of the cube around it")
    corners, faces = hull.points[hull.simplices], hull.simplices.astype(np.int64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = (normal * hull.equations[:, :3]).sum(axis=1) < 0.0
    faces[inwards] = faces[inwards][:, ::-1]
    kept = np.unique(hull.vertices)
    place = np.full(len(points), -1, dtype=np.int64)
    place[kept] = np.arange(len(kept))
    return Convex(points[kept], place[faces])


def prism(outline: Array, height: float) -> Convex:
    """A convex polygon (n, 2), drawn out along z around z = 0."""
    half = np.full((len(outline), 1), 0.5 * height)
    return convex_hull(np.concatenate([np.hstack([outline, -half]), np.hstack([outline, half])]))
