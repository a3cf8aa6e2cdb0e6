"""Mass properties of a union of overlapping balls, each part counted once.

By the divergence theorem the integrals of 1, x and x x^T over the union are integrals of polynomials over its surface:
what each sphere shows outside all others. On a sphere that part is described, at each height z, by arcs of the circle
of latitude. The arcs and the integrals over them are exact; what is left is an integral over z that is analytic
between the heights where the set of arcs changes, with roots at the ends. Taken as z = sin(t) shapes it, Gauss's rule
converges geometrically there. The order is doubled until two orders agree, and their difference is the stated error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .mass import Array, Mass

ORDERS = (6, 12, 24, 48, 96)  # of Gauss's rule between two heights
ENOUGH = 1e-10  # relative difference between two orders
MONOMIALS = [(p, q, m) for p in range(4) for q in range(4 - p) for m in range(4 - p - q)]  # of x, y, z on a sphere
MANY = 40  # balls, from which a search tree pays
TWO_PI = 2.0 * np.pi


@dataclass(frozen=True)
class Union:
    """A union of balls: mass properties, surface, and the relative error of both."""

    mass: Mass
    area: float
    error: float


def of_balls(spheres: Array) -> Union:
    """The union of (n, 4) balls x, y, z, r, with at least one of positive radius."""
    balls = without_hidden(spheres)
    shift = balls[:, :3].mean(axis=0)
    balls = balls - np.append(shift, 0.0)
    rows = [_neighbours(balls, i) for i in range(len(balls))]
    heights = [_heights(axes, cosine) for axes, cosine in rows]
    before, error = _integrals(balls, rows, heights, ORDERS[0]), np.inf
    for order in ORDERS[1:]:
        integrals = _integrals(balls, rows, heights, order)
        scale = np.array([integrals[0], integrals[1]] + [np.trace(integrals[5:].reshape(3, 3))] * 9)
        change = np.delete(integrals - before, [2, 3, 4]) / scale
        error, before = float(np.abs(change).max()), integrals
        if error < ENOUGH:
            break
    mass = Mass.about_origin(float(before[0]), before[2:5], before[5:].reshape(3, 3))
    return Union(Mass(mass.volume, mass.center + shift, mass.second), float(before[1]), max(error, 1e-14))


def without_hidden(spheres: Array) -> Array:
    """The balls that are not inside another one; of equal ones, the first."""
    return np.asarray(spheres[visible(spheres)])


def visible(spheres: Array) -> list[int]:
    """Which balls are not inside another one, ascending; of equal ones, the first."""
    order = np.argsort(-spheres[:, 3], kind="stable")
    kept: list[int] = []
    for i in order:
        others = spheres[kept]
        distance = np.linalg.norm(others[:, :3] - spheres[i, :3], axis=1)
        if not (distance + spheres[i, 3] <= others[:, 3] * (1.0 + 1e-14)).any():
            kept.append(int(i))
    return sorted(kept)


def _neighbours(balls: Array, i: int) -> tuple[Array, Array]:
    """Caps that other balls cut from sphere i: axes (k, 3), and cosines (k,) of their half-angles."""
    radius = balls[i, 3]
    offset = np.delete(balls, i, axis=0) - balls[i]
    offset[:, 3] += radius
    distance = np.linalg.norm(offset[:, :3], axis=1)
    near = distance < radius + offset[:, 3]
    offset, distance = offset[near], distance[near]
    # r_i^2 - r_j^2 as a product: spheres of nearly one radius and centre stay exact
    cosine = (distance + (radius - offset[:, 3]) * (radius + offset[:, 3]) / distance) / (2.0 * radius)
    axes, cosine = offset[cosine < 1.0, :3] / distance[cosine < 1.0, None], np.maximum(cosine[cosine < 1.0], -1.0)
    half = np.arccos(cosine)
    between = 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(axes[:, None] - axes, axis=2), 1.0))
    covers = between + half[:, None] <= half[None, :]
    covers &= ~(covers.T & (np.arange(len(half))[:, None] < np.arange(len(half))))  # of two equal caps the first stays
    np.fill_diagonal(covers, False)
    kept = ~covers.any(axis=1)
    return axes[kept], cosine[kept]


def _heights(axes: Array, cosine: Array) -> Array:
    """Heights on the unit sphere between which the free arcs change smoothly: ascending, from -1 to 1."""
    sine, level = np.sqrt(1.0 - cosine**2), np.hypot(axes[:, 0], axes[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        upwards = np.where(level[:, None] > 0.0, (np.array([0.0, 0.0, 1.0]) - axes[:, 2:] * axes) / level[:, None], 0.0)
    ends = [cosine[:, None] * axes + sign * sine[:, None] * upwards for sign in (1.0, -1.0)]
    candidates = np.concatenate([*ends, _corners(axes, cosine)])
    hidden = (candidates @ axes.T > cosine + 1e-9).any(axis=1)  # inside another cap
    return np.unique(np.concatenate([[-1.0], np.clip(candidates[~hidden, 2], -1.0, 1.0), [1.0]]))


def _corners(axes: Array, cosine: Array) -> Array:
    """Where the rims of two caps meet: (m, 3) points of the unit sphere."""
    j, k = np.triu_indices(len(cosine), 1)
    along = np.einsum("ij,ij->i", axes[j], axes[k])
    cross = np.cross(axes[j], axes[k])
    square = np.einsum("ij,ij->i", cross, cross)
    with np.errstate(divide="ignore", invalid="ignore"):
        foot = (cosine[j] - cosine[k] * along)[:, None] * axes[j] + (cosine[k] - cosine[j] * along)[:, None] * axes[k]
        foot /= square[:, None]
        reach = np.sqrt((1.0 - np.einsum("ij,ij->i", foot, foot)) / square)
        corners = np.concatenate([foot + reach[:, None] * cross, foot - reach[:, None] * cross])
    return np.asarray(corners[np.isfinite(corners).all(axis=1)])


def _integrals(balls: Array, rows: list[tuple[Array, Array]], heights: list[Array], order: int) -> Array:
    """Volume, area, integral of x (3), integral of x x^T (9)."""
    result = np.zeros(14)
    for ball, (axes, cosine), levels in zip(balls, rows, heights, strict=True):
        m0, m1, m2, m3 = _tensors(_exposed(axes, cosine, levels, order))
        c, r = ball[:3], ball[3]
        flux, turned = c @ m1 + r * m0, m2 @ c  # of x . n
        mixed = np.outer(c, r * turned + r * r * m1)
        result[0] += r * r / 3.0 * flux
        result[1] += r * r * m0
        result[2:5] += r * r / 4.0 * (flux * c + r * turned + r * r * m1)
        second = flux * np.outer(c, c) + mixed + mixed.T + r * r * (m3 @ c) + r**3 * m2
        result[5:] += (r * r / 5.0 * second).ravel()
    return result


def _exposed(axes: Array, cosine: Array, levels: Array, order: int) -> Array:
    """Integrals of MONOMIALS over the part of the unit sphere outside all caps."""
    t, weight = np.polynomial.legendre.leggauss(order)
    half, middle = 0.5 * np.diff(levels), 0.5 * (levels[1:] + levels[:-1])
    z = (middle[:, None] + half[:, None] * np.sin(0.5 * np.pi * t)).ravel()
    weights = (half[:, None] * (0.5 * np.pi * np.cos(0.5 * np.pi * t) * weight)).ravel()
    rho = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    low, high = _free_arcs(axes, cosine, z, rho)
    trig = _primitives(high) - _primitives(low)  # (10, nodes, arcs)
    trig = trig.sum(axis=2)
    names = [(p, q) for p in range(4) for q in range(4 - p)]
    return np.array([(weights * z**m * rho ** (p + q)) @ trig[names.index((p, q))] for p, q, m in MONOMIALS])


def _free_arcs(axes: Array, cosine: Array, z: Array, rho: Array) -> tuple[Array, Array]:
    """Ends of the arcs at each height that no cap covers, each (nodes, k + 1); empty ones have equal ends."""
    level = rho[:, None] * np.hypot(axes[:, 0], axes[:, 1])
    needed = cosine - z[:, None] * axes[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(level > 0.0, needed / level, np.where(needed >= 0.0, 1.0, -1.0))
    width = np.arccos(np.clip(ratio, -1.0, 1.0))
    start = np.mod(np.arctan2(axes[:, 1], axes[:, 0]) - width, TWO_PI)
    start = np.where(width > 0.0, start, TWO_PI)
    end = np.where(width > 0.0, start + 2.0 * width, TWO_PI)
    order = np.argsort(start, axis=1)
    start, end = np.take_along_axis(start, order, axis=1), np.take_along_axis(end, order, axis=1)
    wrapped = np.maximum((end - TWO_PI).max(axis=1, initial=0.0), 0.0)[:, None]
    low = np.minimum(np.maximum.accumulate(np.concatenate([wrapped, end], axis=1), axis=1), TWO_PI)
    high = np.concatenate([start, np.full((len(z), 1), TWO_PI)], axis=1)
    return low, np.maximum(low, high)


def _primitives(phi: Array) -> Array:
    """Of cos^p sin^q over the angle, for p + q <= 3 in the order (0,0) (0,1) (0,2) (0,3) (1,0) ... (3,0)."""
    c, s = np.cos(phi), np.sin(phi)
    cs = c * s
    return np.stack(
        [
            *(phi, -c, 0.5 * (phi - cs), c**3 / 3.0 - c),
            *(s, 0.5 * s * s, s**3 / 3.0),
            *(0.5 * (phi + cs), -(c**3) / 3.0),
            s - s**3 / 3.0,
        ]
    )


def _where(rank: int) -> NDArray[np.int64]:
    """Index into MONOMIALS of each entry of the tensor u u ... of a rank."""
    shape = (3,) * rank
    found = [MONOMIALS.index(tuple(np.bincount(entry, minlength=3).tolist())) for entry in np.ndindex(shape)]
    return np.array(found).reshape(shape)


TENSORS = [_where(rank) for rank in (1, 2, 3)]


def _tensors(values: Array) -> tuple[Any, ...]:
    """Integrals of 1, u, u u^T and u u u from those of the monomials."""
    return float(values[MONOMIALS.index((0, 0, 0))]), *(values[where] for where in TENSORS)


def signed_gap(points: Array, spheres: Array) -> Array:
    """How far points (m, 3) lie outside the union of (n, 4) balls; inside it, negative, how far from a sphere."""
    from scipy.spatial import cKDTree

    gap = np.full(len(points), np.inf)
    radii, group = np.unique(spheres[:, 3], return_inverse=True)
    for i, radius in enumerate(radii):
        centers = spheres[group == i, :3]
        if len(centers) > MANY:  # of balls of one radius, the nearest centre decides
            np.minimum(gap, cKDTree(centers).query(points)[0] - radius, out=gap)
            continue
        for x, y, z in centers:
            distance = np.sqrt((points[:, 0] - x) ** 2 + (points[:, 1] - y) ** 2 + (points[:, 2] - z) ** 2)
            np.minimum(gap, distance - radius, out=gap)
    return gap
