"""A mesh of triangles around circles and polygons, fine where the parts are and coarse far from them.

Points are set along every outline, and inside at the middles of the cells of a quadtree as fine as the wanted size,
then evened out. Delaunay's triangulation of them has an edge along an outline wherever the circle over that edge is
empty of other points (J. Ruppert, J. Algorithms 18 (1995) 548): points in such circles are taken away, and where it is
the points of two outlines that crowd each other, the edge is halved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree

from ..errors import InputError
from .curves import Circle, Curve, Polygon

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MOST_POINTS = 400_000
CLOSE = 1e-9  # m: one point
CLEARANCE = 0.6  # of the wanted size, between the first points inside and an outline
SLAB = 4.0  # elements along a quarter of a circle to one across a slab
FLAT = 1e-6  # area over the square of the longest side
EVENINGS = 12  # sweeps that move each free point to the middle of its neighbours
HALVINGS = 12


@dataclass(frozen=True)
class Grading:
    """How fine a mesh is.

    Attributes
    ----------
    per_quarter : int
        Elements along a quarter of a circle; a fourth of them across a slab.
    growth : float
        Growth of the size of the elements with the distance from a part, m per m.
    across : float
        Elements across the gap between two parts, at least.
    """

    per_quarter: int
    growth: float
    across: float


@dataclass(frozen=True)
class Mesh:
    """Points (n, 2) m, triangles (m, 3), the outline of each edge on one, and for each triangle the parts around it.

    `segments` are the edges on outlines (k, 2), `owner` (k,) which outline; the last outline is the outer one.
    """

    points: Array
    triangles: Indices
    segments: Indices
    owner: Indices
    curves: tuple[Curve, ...]

    def inside(self, curve: Curve) -> NDArray[np.bool_]:
        """Which triangles lie inside an outline: (m,) bool."""
        near = 1e-9 * curve.size
        if isinstance(curve, Circle):  # its chords are edges of the mesh: all corners are on or within
            return np.asarray((curve.signed(self.points)[self.triangles] < near).all(axis=1))
        return np.asarray(curve.signed(self.points[self.triangles].mean(axis=1)) < 0.0)


def build(parts: Sequence[Curve], outer: Curve, grading: Grading, hollow: Sequence[Curve] = ()) -> Mesh:
    """The mesh of everything within the outer outline but for the hollow ones.

    Parameters
    ----------
    parts : outlines that edges of the mesh must follow; a polygon is cut off at an outer polygon
    outer : where the mesh ends
    hollow : those of the parts that are left empty
    """
    curves, touching = _cut(parts, outer)
    sizes = _Sizes(curves, touching, grading)
    points, segments, owner = _outlines(curves, sizes)
    fixed = len(points)
    free = _cells(curves, sizes, points, hollow)
    points, segments, owner = _settle(points, segments, owner, free, curves)
    for _ in range(EVENINGS):
        points[fixed:] = _evened(points, fixed)
    points, segments, owner = _settle(points[:fixed], segments, owner, points[fixed:], curves)
    mesh = Mesh(points, _delaunay(points), segments, owner, curves)
    empty = np.zeros(len(mesh.triangles), bool)
    for curve in hollow:
        empty |= mesh.inside(curve)
    outside = curves[-1].signed(points[mesh.triangles].mean(axis=1)) > 0.0
    return _without_strays(Mesh(points, mesh.triangles[~(empty | outside)], segments, owner, curves))


def _cut(parts: Sequence[Curve], outer: Curve) -> tuple[tuple[Curve, ...], set[int]]:
    """All outlines, the outer one last and with a corner where another ends on it; which of them touch it."""
    curves: list[Curve] = []
    touching: set[int] = set()
    ends = [np.empty((0, 2))]
    for part in parts:
        if isinstance(part, Polygon) and isinstance(outer, Polygon) and (outer.signed(part.corners) > -CLOSE).any():
            cut = part.clipped(outer)
            if cut is not None:
                touching.add(len(curves))
                curves.append(cut)
                ends.append(cut.corners)
        else:
            curves.append(part)
    return (*curves, outer.with_corners(np.concatenate(ends)) if isinstance(outer, Polygon) else outer), touching


class _Sizes:
    """The size wanted of the elements at a point."""

    def __init__(self, curves: Sequence[Curve], touching: set[int], grading: Grading) -> None:
        self.curves, self.grading = curves, grading
        last = len(curves) - 1
        self.pairs = [(i, k) for k in range(last + 1) for i in range(k) if not (k == last and i in touching)]
        share = [0.25 * np.pi if isinstance(curve, Circle) else SLAB for curve in curves[:-1]] + [1.0]
        self.least = np.array([s * c.size / grading.per_quarter for s, c in zip(share, curves, strict=True)])

    def __call__(self, points: Array) -> Array:
        distance = np.abs([curve.signed(points) for curve in self.curves])
        size = (self.least[:, None] + self.grading.growth * distance).min(axis=0)
        for i, k in self.pairs:
            size = np.minimum(size, (distance[i] + distance[k]) / self.grading.across)
        return np.asarray(np.maximum(size, CLOSE))


def _outlines(curves: Sequence[Curve], sizes: _Sizes) -> tuple[Array, Indices, Indices]:
    """Points along all outlines (n, 2), the edges between them (k, 2), and the outline of each edge (k,)."""
    rim = len(curves) - 1
    points, segments, owner = [], [], []
    known = 0
    for k, curve in enumerate(curves):
        placed = curve.place(sizes)
        n = len(placed)
        known += n
        if known > MOST_POINTS:
            raise InputError("has parts too close to each other to be meshed", path="field")
        edge = known - n + np.column_stack([np.arange(n), (np.arange(n) + 1) % n])
        if k < rim:  # what lies on the rim is the rim's
            on_rim = np.abs(curves[rim].signed(placed)) < CLOSE
            middle = 0.5 * (placed + np.roll(placed, -1, axis=0))
            edge = edge[~(on_rim & np.roll(on_rim, -1) & (np.abs(curves[rim].signed(middle)) < CLOSE))]
        points.append(placed)
        segments.append(edge)
        owner.append(np.full(len(edge), k))
    places, edges = np.concatenate(points), np.concatenate(segments)
    _, first, number = np.unique(np.round(places / CLOSE), axis=0, return_index=True, return_inverse=True)
    used = np.unique(number.reshape(-1)[edges])
    rank = np.full(len(first), -1)
    rank[used] = np.arange(len(used))
    return places[first[used]], rank[number.reshape(-1)[edges]], np.concatenate(owner)


def _cells(curves: Sequence[Curve], sizes: _Sizes, taken: Array, hollow: Sequence[Curve]) -> Array:
    """Middles of the cells of a quadtree that are as small as wanted and clear of the outlines."""
    low, high = taken.min(axis=0), taken.max(axis=0)
    width = float((high - low).max())
    centers = 0.5 * (low + high)[None]
    quarters = np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])
    done = []
    count = 0
    while len(centers):
        # The middle of a large cell may lie far from a part that its corner touches: the size may shrink on the way.
        fine = sizes(centers) - sizes.grading.growth * 0.71 * width > 0.85 * width
        done.append(centers[fine])
        count += len(done[-1])
        width *= 0.5
        centers = (centers[~fine][:, None] + 0.5 * width * quarters[None]).reshape(-1, 2)
        if count + len(centers) > MOST_POINTS:
            raise InputError(f"calls for more than {MOST_POINTS} points: lower the resolution", path="field")
    points = np.concatenate(done)
    distance = np.array([curve.signed(points) for curve in curves])
    keep = (distance[-1] < 0.0) & (np.abs(distance).min(axis=0) > CLEARANCE * sizes(points))
    for curve in hollow:
        keep &= curve.signed(points) > 0.0
    return np.asarray(points[keep])


def _settle(
    fixed: Array, segments: Indices, owner: Indices, free: Array, curves: Sequence[Curve]
) -> tuple[Array, Indices, Indices]:
    """All points, those of the outlines first, so that each edge of an outline is one of the triangulation."""
    for _ in range(HALVINGS):
        a, b = fixed[segments[:, 0]], fixed[segments[:, 1]]
        middle, radius = 0.5 * (a + b), 0.5 * np.hypot(*(a - b).T)
        if len(free):
            near = cKDTree(middle).query_ball_point(free, radius.max(), return_length=True) > 0
            close = np.flatnonzero(near)
            tree = cKDTree(free[close]) if len(close) else None
            crowding = tree.query_ball_point(middle, (1.0 - 1e-9) * radius) if tree is not None else []
            gone = np.unique(np.concatenate([np.asarray(c, np.int64) for c in crowding] or [np.empty(0, np.int64)]))
            free = np.delete(free, close[gone], axis=0)
        others = cKDTree(fixed).query_ball_point(middle, (1.0 - 1e-9) * radius, return_length=True)
        crowded = np.flatnonzero(others > 0)
        if not len(crowded):
            return np.concatenate([fixed, free]), segments, owner
        halves = middle[crowded]
        for k, curve in enumerate(curves):
            mine = owner[crowded] == k
            if mine.any():
                halves[mine] = curve.project(halves[mine])
        new = len(fixed) + np.arange(len(crowded))
        second = np.column_stack([new, segments[crowded, 1]])
        segments = segments.copy()
        segments[crowded, 1] = new
        segments, owner = np.concatenate([segments, second]), np.concatenate([owner, owner[crowded]])
        fixed = np.concatenate([fixed, halves])
    raise InputError("has parts that meet at too sharp an angle to be meshed", path="field")


def _evened(points: Array, fixed: int) -> Array:
    """The free points, each in the middle of its neighbours."""
    start, end = Delaunay(points).vertex_neighbor_vertices
    count = np.diff(start)
    total = np.add.reduceat(points[end], start[:-1])
    return np.asarray((total / count[:, None])[fixed:])


def _delaunay(points: Array) -> Indices:
    """Triangles, anticlockwise, but for the flat ones along straight outer edges."""
    found = Delaunay(points).simplices.astype(np.int64)
    a, b, c = points[found].transpose(1, 0, 2)
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    longest = np.max([np.hypot(*(p - q).T) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    turned = np.where((area < 0.0)[:, None], found[:, [0, 2, 1]], found)
    return np.asarray(turned[np.abs(area) > FLAT * longest**2])


def _without_strays(mesh: Mesh) -> Mesh:
    """Without the points that no triangle uses."""
    used = np.unique(mesh.triangles)
    rank = np.full(len(mesh.points), -1)
    rank[used] = np.arange(len(used))
    segments = rank[mesh.segments]
    whole = (segments >= 0).all(axis=1)
    return Mesh(mesh.points[used], rank[mesh.triangles], segments[whole], mesh.owner[whole], mesh.curves)
