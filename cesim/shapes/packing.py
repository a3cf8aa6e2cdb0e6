"""Fills bodies with overlapping balls.

Candidates are points inside the body, each with the largest ball around it that stays inside. Greedily the candidate is
taken that covers most volume not yet covered, for each ball that it costs. Where a body is symmetric a candidate is
a point with all its images, so that the cluster has the same symmetry. A few balls are then moved to where the cluster
differs least from the body; each stays as large as it can be inside. Those of a symmetric body then touch the flat
sides that they nearly touched. At last all balls grow by one length, for which the volume that the cluster lacks and
the volume by which it protrudes are least together. So a flat side stays flat: all balls that touched it have their
tops in one plane.
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .bodies import Body, Cone, Cylinder, Lattice
from .mass import Array
from .union import signed_gap

TARGETS = 3000  # points that stand for the volume to be covered
CANDIDATES = 2500
SECTION = 200  # of them in a section through a body of revolution
SMALLEST = 0.04  # radius of a candidate over the diameter of equal volume
FOLDS = (3, 4, 5, 6, 8, 12)  # balls on a ring around an axis
MEASURED = 40_000  # points inside the body that tell how much a cluster covers
SEARCHED = 2500  # while balls are moved
MOVED = 24  # at most, times the symmetry of the body
NEARLY = 0.04  # of the diameter
MOST_POINTS = 200_000  # inside and around


@dataclass(frozen=True)
class Orbit:
    """A point and its images under symmetries of the body, and the largest ball around it inside."""

    point: Array  # (3,)
    images: Array  # (k, 3, 3)
    radius: float

    @property
    def centers(self) -> Array:
        """(k, 3)"""
        return np.asarray(self.images @ self.point)

    @property
    def spheres(self) -> Array:
        """(k, 4)"""
        return np.column_stack([self.centers, np.full(len(self.images), self.radius)])


@dataclass(frozen=True)
class Candidates:
    """Where balls may be, and what they are to cover."""

    orbits: list[Orbit]
    targets: Array  # (m, 3); of a symmetric body, in the part of it where the coordinates `halved` are positive
    halved: tuple[int, ...]
    kept: tuple[int, ...]  # coordinates that stay zero where they are, and positive where they are not
    cell: float  # volume that a target stands for
    grow: bool = True


def around(body: Body, inside: int, margin: float = 0.0, scattered: bool = True) -> Lattice:
    """Points around a body, about so many of them inside."""
    lower, upper = body.lower - margin, body.upper + margin
    room = float(np.prod(upper - lower))
    step = (room / min(inside * room / body.mass.volume, MOST_POINTS)) ** (1.0 / 3.0)
    step = min(step, float((upper - lower).min()) / 4.0)
    x, y, z = (int(n) for n in np.ceil((upper - lower) / step))
    return Lattice(0.5 * (lower + upper) - 0.5 * step * np.array([x, y, z]), step, (x, y, z), scattered)


def uniform(seed: int, count: int) -> Array:
    """Numbers in [0, 1) that only depend on the seed, with any version of NumPy."""
    raw = np.random.PCG64(seed).random_raw(count)
    return np.asarray((raw >> np.uint64(11)) * 2.0**-53)


def packed(body: Body, candidates: Candidates, budget: int) -> Array:
    """At most so many balls (n, 4) that stand for a body: the best of greedy choices, moved and grown."""
    best, least = np.zeros((0, 4)), np.inf
    for thrift in (1.0, 0.5, 0.0) if candidates.halved or len(candidates.orbits[0].images) > 1 else (1.0,):
        chosen = pack(candidates, budget, thrift)
        if sum(len(orbit.images) for orbit in chosen) <= MOVED * 2 ** len(candidates.halved):
            chosen = improve(body, chosen, candidates)
        if candidates.kept:
            chosen = [_settled(body, orbit, candidates.kept) for orbit in chosen]
        spheres = np.concatenate([orbit.spheres for orbit in chosen])
        if candidates.grow:
            spheres = grown(body, spheres)
        difference = Coverage.of(body, spheres).difference()
        if difference < least:
            best, least = spheres, difference
    return best


def pack(candidates: Candidates, budget: int, thrift: float = 1.0) -> list[Orbit]:
    """Orbits with at most so many balls together, the most useful first: volume covered over balls^thrift."""
    halved = list(candidates.halved)
    price = [len(orbit.images) ** thrift / 2 ** len(halved) for orbit in candidates.orbits]
    open_ = candidates.targets  # not yet covered

    def covered(orbit: Orbit) -> NDArray[np.bool_]:
        centers = orbit.centers
        centers = centers[(centers[:, halved] > -orbit.radius).all(axis=1)]  # those that reach where targets are
        hits = np.zeros(len(open_), dtype=bool)
        for center in centers:
            offset = open_ - center
            hits |= np.einsum("ij,ij->i", offset, offset) < orbit.radius**2
        return hits

    # A heap of upper bounds: what a candidate adds only falls, so most need not be looked at again.
    room = len(open_)
    heap = []
    for i, orbit in enumerate(candidates.orbits):
        balls = len(orbit.images) * 4.0 / 3.0 * np.pi * orbit.radius**3 / candidates.cell / 2 ** len(candidates.halved)
        heap.append((-min(1.2 * balls + 5.0, room) / price[i], i))
    heapq.heapify(heap)
    chosen: list[Orbit] = []
    left = budget
    while heap and left > 0:
        _, i = heapq.heappop(heap)
        orbit = candidates.orbits[i]
        if len(orbit.images) > left:
            continue
        hits = covered(orbit)
        score = np.count_nonzero(hits) / price[i]
        if heap and 0.0 < score < -heap[0][0]:
            heapq.heappush(heap, (-score, i))
        elif score > 0.0:
            open_ = open_[~hits]
            left -= len(orbit.images)
            chosen.append(orbit)
    return chosen


# ---- candidates ------------------------------------------------------------------------------------------------------


def mirrored(body: Body) -> Candidates:
    """For a body that is its own mirror image in the planes x = 0, y = 0 and z = 0."""
    step = (float(np.prod(body.upper)) / CANDIDATES) ** (1.0 / 3.0)
    counts = [max(round(edge / step), 3) for edge in body.upper]
    axes = [np.arange(n) / n * edge for n, edge in zip(counts, body.upper, strict=True)]
    points, radii = _deep_enough(body, np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3))
    orbits = []
    for point, radius in zip(points, radii, strict=True):
        signs = itertools.product(*((1.0, -1.0) if x > 0.0 else (1.0,) for x in point))
        orbits.append(Orbit(point, np.array([np.diag(sign) for sign in signs]), radius))
    return _candidates(body, orbits, (0, 1, 2), (0, 1, 2))


def turned(body: Cylinder | Cone) -> Candidates:
    """For a body of revolution around z; a cylinder is its own mirror image in z = 0, too."""
    halved = (2,) if isinstance(body, Cylinder) else ()
    radius, low, high = float(body.upper[0]), 0.0 if halved else float(body.lower[2]), float(body.upper[2])
    step = np.sqrt(radius * (high - low) / SECTION)
    z = low + (high - low) * np.arange(n := max(round((high - low) / step), 6)) / n
    rho = radius * np.arange(n := max(round(radius / step), 6)) / n
    section = np.stack(np.meshgrid(rho, z, indexing="ij"), axis=-1).reshape(-1, 2)
    points, radii = _deep_enough(body, np.column_stack([section[:, 0], 0.0 * section[:, 0], section[:, 1]]))
    orbits = []
    for point, r in zip(points, radii, strict=True):
        for fold in FOLDS if point[0] > 0.0 else (1,):
            images = np.array([_turn(2.0 * np.pi * i / fold) for i in range(fold)])
            if halved and point[2] > 0.0:
                images = np.concatenate([images, images * np.array([1.0, 1.0, -1.0])])
            orbits.append(Orbit(point, images, r))
    return _candidates(body, orbits, halved, (0, 1, *halved))


def anywhere(body: Body) -> Candidates:
    """For a body without symmetry: candidates lie where the depth has a ridge."""
    from scipy.ndimage import maximum_filter

    lattice = around(body, 6 * TARGETS, scattered=False)
    step, inside = lattice.step, body.occupied(lattice)
    points = lattice.points[inside]
    depth = np.zeros(inside.shape)
    depth[inside] = body.depth(points)
    # Off the ridges a neighbour is deeper by a spacing or more; 0.75 leaves room for ridges between the points.
    chosen = (maximum_filter(depth, size=3) - depth < 0.75 * step)[inside]
    radii = depth[inside]
    chosen &= radii > min(SMALLEST * body.mass.diameter, 0.5 * float(radii.max()))
    few = np.flatnonzero(chosen)
    few = few[:: int(np.ceil(len(few) / CANDIDATES))]
    ridge, higher = _climb(body, points[few], radii[few], step)  # the points themselves reach into corners
    places, sizes = np.concatenate([ridge, points[few]]), np.concatenate([higher, radii[few]])
    order = np.argsort(uniform(0, len(places)), kind="stable")  # where balls are equal, they should not come in rows
    orbits = [Orbit(places[i], np.eye(3)[None], float(sizes[i])) for i in order]
    return Candidates(orbits, points[::2], (), (), 2.0 * step**3)


def _climb(body: Body, points: Array, depth: Array, step: float) -> tuple[Array, Array]:
    """Moves points of a grid onto the ridges between them, by less than a spacing."""
    points, depth = points.copy(), depth.copy()
    for length in (0.5 * step, 0.25 * step, 0.125 * step):
        for side in np.concatenate([np.eye(3), -np.eye(3)]):
            moved = points + length * side
            deeper = body.depth(moved)
            better = (deeper > depth) & (depth > length)
            points[better], depth[better] = moved[better], deeper[better]
    return points, depth


def _turn(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _deep_enough(body: Body, points: Array) -> tuple[Array, Array]:
    radii = body.depth(points)
    kept = radii > min(SMALLEST * body.mass.diameter, 0.5 * float(radii.max()))
    return points[kept], radii[kept]


def _candidates(body: Body, orbits: list[Orbit], halved: tuple[int, ...], kept: tuple[int, ...]) -> Candidates:
    lattice = around(body, TARGETS * 2 ** len(halved))
    targets = lattice.points[body.occupied(lattice)]
    return Candidates(orbits, targets[(targets[:, halved] > 0.0).all(axis=1)], halved, kept, lattice.step**3)


# ---- moving and growing ----------------------------------------------------------------------------------------------


def improve(body: Body, chosen: list[Orbit], candidates: Candidates) -> list[Orbit]:
    """Moves each orbit to where the cluster, grown, differs least from the body: a search by steps that are halved."""
    spheres = np.concatenate([orbit.spheres for orbit in chosen])
    coverage = Coverage.of(body, spheres, SEARCHED * 2 ** len(candidates.halved), candidates.halved)
    gaps = [signed_gap(coverage.points, orbit.spheres) for orbit in chosen]
    growth, best = coverage.best_growth() if candidates.grow else (0.0, coverage.missed)
    chosen, step = list(chosen), 0.1 * body.mass.diameter
    while step > 0.005 * body.mass.diameter:
        moved = False
        for i in range(len(chosen)):
            others = np.min([gap for j, gap in enumerate(gaps) if j != i], axis=0, initial=np.inf)
            for trial in _around(body, chosen[i], step, candidates.kept):
                gap = signed_gap(coverage.points, trial.spheres)
                missed = int(((np.minimum(others, gap) < growth) != coverage.inside).sum())
                if missed < best:
                    best, chosen[i], gaps[i], moved = missed, trial, gap, True
        if candidates.grow:
            growth, best = replace(coverage, gap=np.min(gaps, axis=0)).best_growth()
        if not moved:
            step *= 0.5
    return chosen


def _settled(body: Body, orbit: Orbit, kept: tuple[int, ...]) -> Orbit:
    """A ball that touches the flat sides that it nearly touched, so that the body rests on several.

    It moves there; where symmetry holds it, it moves away from the sides that it touches and becomes larger.
    """
    normals, offsets = body.flats
    free = np.array([axis not in kept or orbit.point[axis] != 0.0 for axis in range(3)])
    best = orbit
    for _ in range(len(offsets)):
        room = offsets - normals @ best.point - best.radius
        near = np.flatnonzero(_nearly(body, room))
        if not len(near):
            break
        away = -normals[np.abs(room) < 1e-9 * body.mass.diameter].sum(axis=0)
        trials = [best.point + side * free for k in near for side in (room[k] * normals[k], room[k] * away)]
        radii = body.depth(np.array(trials))
        found = [Orbit(p, orbit.images, float(r)) for p, r in zip(trials, radii, strict=True)]
        left = [int(_nearly(body, offsets - normals @ one.point - one.radius).sum()) for one in found]
        left = [n if one.radius > best.radius * (1.0 - 1e-9) else len(near) for n, one in zip(left, found, strict=True)]
        if min(left) >= len(near):
            break
        best = found[int(np.argmin(left))]
    return best


def _nearly(body: Body, room: Array) -> NDArray[np.bool_]:
    d = body.mass.diameter
    return np.asarray((room > 1e-9 * d) & (room < NEARLY * d))


def _around(body: Body, orbit: Orbit, step: float, kept: tuple[int, ...]) -> list[Orbit]:
    """The orbit moved by a step to all sides that keep its symmetry."""
    free = [axis not in kept or orbit.point[axis] > 0.0 for axis in range(3)]
    choices = itertools.product(*((-1.0, 0.0, 1.0) if is_free else (0.0,) for is_free in free))
    points = np.array([orbit.point + step * np.array(choice) for choice in choices if any(choice)]).reshape(-1, 3)
    inside = np.linalg.norm(points - orbit.point, axis=1) < orbit.radius  # as its ball is
    inside &= np.all([points[:, axis] > 0.0 for axis in kept if free[axis]], axis=0)
    points = points[inside]
    return [Orbit(p, orbit.images, float(r)) for p, r in zip(points, body.depth(points), strict=True) if r > 0.0]


def grown(body: Body, spheres: Array) -> Array:
    """The same balls, larger by the length that makes the cluster differ least from the body."""
    growth, _ = Coverage.of(body, spheres).best_growth()
    return np.asarray(spheres + np.array([0.0, 0.0, 0.0, growth]))


@dataclass(frozen=True)
class Coverage:
    """How points around a body lie to it and to a cluster."""

    points: Array  # (n, 3)
    inside: NDArray[np.bool_]  # (n,) the body
    gap: Array  # (n,) from the cluster, negative inside
    step: float

    @classmethod
    def of(cls, body: Body, spheres: Array, inside: int = MEASURED, halved: tuple[int, ...] = ()) -> Coverage:
        """With about so many points inside; only those with positive coordinates `halved`."""
        margin = max(float((spheres[:, 3] - body.depth(spheres[:, :3])).max()), 0.0) + 0.1 * body.mass.diameter
        lattice = around(body, inside, margin)
        points = lattice.points.reshape(-1, 3)
        part = (points[:, halved] > 0.0).all(axis=1)
        points = points[part]
        return cls(points, body.occupied(lattice).ravel()[part], signed_gap(points, spheres), lattice.step)

    @property
    def missed(self) -> int:
        """Points that are in one of the two only."""
        return int(((self.gap <= 0.0) != self.inside).sum())

    def difference(self) -> float:
        """Volume that is either lacking or protruding."""
        return float(self.missed * self.step**3)

    def best_growth(self) -> tuple[float, int]:
        """The length by which all balls should grow (it may be zero, not negative), and the points then missed."""
        order = np.argsort(self.gap, kind="stable")
        gap, gain = self.gap[order], np.where(self.inside[order], -1, 1)
        outside = gap > 0.0
        change = np.concatenate([[0], np.cumsum(gain[outside])])
        # between the last point that the balls take in and the next
        ends = np.concatenate([[0.0], gap[outside], [gap[-1]]])
        best = int(change.argmin())
        growth = 0.0 if best == 0 else 0.5 * (ends[best] + ends[best + 1])
        return float(growth), self.missed + int(change[best])
