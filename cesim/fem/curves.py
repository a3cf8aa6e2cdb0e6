"""Outlines in the plane of the drum's cross-section: distances to them, and points along them at a given spacing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Spacing = Callable[[Array], Array]  # points (n, 2) m -> distance wanted between neighbours (n,) m

FEWEST_ON_CIRCLE = 16
PROBES = 64  # of the spacing along an edge or a quarter of a circle


class Curve(Protocol):
    """A closed outline."""

    @property
    def reach(self) -> float:
        """Distance of its farthest point from the origin, m."""
        ...

    @property
    def size(self) -> float:
        """Its smallest width, m."""
        ...

    def signed(self, points: Array) -> Array:
        """Distance of points (n, 2) m from the outline, negative inside: (n,) m."""
        ...

    def place(self, spacing: Spacing) -> Array:
        """Points along the outline, anticlockwise: (k, 2) m."""
        ...

    def project(self, points: Array) -> Array:
        """The nearest points of the outline, of points (n, 2) m next to it."""
        ...


class Circle:
    """A circle."""

    def __init__(self, x: float, y: float, radius: float) -> None:
        self.center, self.radius = np.array([x, y]), radius

    @property
    def reach(self) -> float:
        """See `Curve`."""
        return float(np.hypot(*self.center)) + self.radius

    @property
    def size(self) -> float:
        """See `Curve`."""
        return 2.0 * self.radius

    def signed(self, points: Array) -> Array:
        """See `Curve`."""
        return np.asarray(np.hypot(*(points - self.center).T) - self.radius)

    def place(self, spacing: Spacing) -> Array:
        """See `Curve`."""
        share = _shares(lambda s: spacing(self._at(s)), 2.0 * np.pi * self.radius, 4 * PROBES, FEWEST_ON_CIRCLE)
        return self._at(share[:-1])

    def project(self, points: Array) -> Array:
        """See `Curve`."""
        off = points - self.center
        return np.asarray(self.center + off * (self.radius / np.hypot(*off.T))[:, None])

    def _at(self, share: Array) -> Array:
        angle = 2.0 * np.pi * share
        return np.asarray(self.center + self.radius * np.column_stack([np.cos(angle), np.sin(angle)]))


class Polygon:
    """A convex polygon, its corners anticlockwise."""

    def __init__(self, corners: Array) -> None:
        self.corners = np.asarray(corners, float)

    @property
    def reach(self) -> float:
        """See `Curve`."""
        return float(np.hypot(*self.corners.T).max())

    @property
    def size(self) -> float:
        """See `Curve`."""
        start, way, length = self._edges()
        across = (self.corners[None] - start[:, None]) @ np.array([[0.0, 1.0], [-1.0, 0.0]])
        return float(np.abs((across * (way / length[:, None])[:, None]).sum(axis=2)).max(axis=1).min())

    def signed(self, points: Array) -> Array:
        """See `Curve`."""
        start, way, length = self._edges()
        off = points[:, None] - start[None]
        along = np.clip((off * way).sum(axis=2) / length**2, 0.0, 1.0)
        distance = np.hypot(*np.moveaxis(off - along[..., None] * way, 2, 0)).min(axis=1)
        inside = ((way[:, 0] * off[..., 1] - way[:, 1] * off[..., 0]) > 0.0).all(axis=1)
        return np.asarray(np.where(inside, -distance, distance))

    def place(self, spacing: Spacing) -> Array:
        """See `Curve`."""
        found = []
        for start, way, length in zip(*self._edges(), strict=True):

            def along(s: Array, start: Array = start, way: Array = way) -> Array:
                return spacing(start + s[:, None] * way)

            share = _shares(along, length, PROBES, 1)
            found.append(start + share[:-1, None] * way)
        return np.concatenate(found)

    def project(self, points: Array) -> Array:
        """See `Curve`; the points that are asked for lie on an edge."""
        return points

    def clipped(self, room: Polygon) -> Polygon | None:
        """The part of it inside a room with its faces along the axes; None: there is none."""
        corners = self.corners
        for axis in (0, 1):
            for sign, limit in ((1.0, room.corners[:, axis].min()), (-1.0, -room.corners[:, axis].max())):
                height = sign * corners[:, axis] - limit
                after = np.roll(corners, -1, axis=0)
                above = np.roll(height, -1)
                kept: list[Array] = []
                for p, q, h, k in zip(corners, after, height, above, strict=True):
                    if h >= 0.0:
                        kept.append(p)
                    if h * k < 0.0:
                        crossing = p + (q - p) * (h / (h - k))
                        crossing[axis] = sign * limit
                        kept.append(crossing)
                corners = np.array(kept)
                if len(corners) < 3:
                    return None
        return Polygon(corners)

    def with_corners(self, points: Array) -> Polygon:
        """The same outline with further corners, those of the points (n, 2) m that lie on an edge."""
        start, way, length = self._edges()
        corners: list[Array] = []
        for a, b, n in zip(start, way, length, strict=True):
            off = points - a
            along = off @ b / n**2
            on = (np.abs(off[:, 0] * b[1] - off[:, 1] * b[0]) < 1e-12 * n) & (along > 1e-9) & (along < 1.0 - 1e-9)
            corners += [a, *points[on][np.argsort(along[on])]]
        fresh = np.array(corners)
        keep = np.hypot(*(fresh - np.roll(fresh, 1, axis=0)).T) > 1e-12 * length.max()
        return Polygon(fresh[keep])

    def _edges(self) -> tuple[Array, Array, Array]:
        """Where each edge begins, its vector and its length, m."""
        way = np.roll(self.corners, -1, axis=0) - self.corners
        return self.corners, way, np.hypot(*way.T)


def _shares(spacing: Callable[[Array], Array], length: float, probes: int, fewest: int) -> Array:
    """Places in [0, 1] along a line of a length in m, neighbours as far from each other as the spacing wants there."""
    middle = (np.arange(probes) + 0.5) / probes
    count = np.concatenate([[0.0], np.cumsum(length / probes / spacing(middle))])
    n = max(int(np.ceil(count[-1])), fewest)
    return np.interp(np.linspace(0.0, count[-1], n + 1), count, np.linspace(0.0, 1.0, probes + 1))
