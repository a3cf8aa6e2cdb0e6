"""From a description to a template: one row a kind, and the arrangements that need no search."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..scene.shapes import MOST_CORNERS, MOST_SPHERES
from . import packing, templates
from .bodies import Body, Cone, Cylinder, Ellipsoid, Tube
from .mass import Array
from .packing import Candidates, Orbit, anywhere, mirrored, packed, turned, uniform
from .polyhedra import Convex, Polyhedron, convex_hull, prism
from .templates import Template
from .union import without_hidden

if TYPE_CHECKING:
    from ..scene.shapes import Shape

NEAREST_PITCH = 1.8  # balls of a chain stand at most so many radii apart
USUAL_PITCH = 1.0  # if their number is not given


def of(shape: Shape) -> Template:
    """The template of a shape; the same shape gives the same object."""
    return _of(type(shape), shape.model_dump_json())


@lru_cache(maxsize=256)
def _of(model: type[Shape], text: str) -> Template:
    shape = model.model_validate_json(text)
    return BUILDERS[shape.kind](shape)


def _cluster(kind: str, body: Body, spheres: Array) -> Template:
    return templates.of_cluster(f"{kind}, {len(spheres)} spheres", body, spheres)


def _convex(kind: str, body: Body, hull: Convex) -> Template:
    if len(hull.points) > MOST_CORNERS:
        raise InputError(
            f"has {len(hull.points)} corners, more than {MOST_CORNERS}; leave some out, or take model = 'cluster'",
            path="points",
        )
    return templates.of_polyhedron(f"{kind}, {len(hull.points)} corners", body, hull)


def _sphere(_: Any) -> Template:
    return replace(templates.of_union("sphere", np.array([[0.0, 0.0, 0.0, 0.5]])), moments=np.full(3, 0.1))


def _explicit(shape: Any) -> Template:
    spheres = without_hidden(np.array(shape.spheres, dtype=np.float64))
    return templates.of_union("sphere" if len(spheres) == 1 else f"cluster of {len(spheres)} spheres", spheres)


# ---- bodies with a closed form ---------------------------------------------------------------------------------------


def _box(shape: Any) -> Template:
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * shape.proportions
    body = convex_hull(corners)
    if shape.model == "convex":
        return _convex("box", body, body)
    return _cluster("box", body, packed(body, mirrored(body), shape.spheres))


def _ellipsoid(shape: Any) -> Template:
    body = Ellipsoid(0.5 * np.array(shape.axes))
    return _cluster("ellipsoid", body, packed(body, mirrored(body), shape.spheres))


def _cylinder(shape: Any) -> Template:
    body = Cylinder(0.5, 0.5, shape.aspect)
    if shape.model == "convex":
        rim = 0.5 * _polygon(shape.sides)
        return _convex("cylinder", body, prism(rim, shape.aspect))
    return _cluster("cylinder", body, packed(body, turned(body), shape.spheres))


def _cone(shape: Any) -> Template:
    body = Cone(0.5, shape.aspect)
    if shape.model == "convex":
        rim = np.hstack([0.5 * _polygon(shape.sides), np.zeros((shape.sides, 1))])
        return _convex("cone", body, convex_hull(np.vstack([rim, [0.0, 0.0, shape.aspect]])))
    return _cluster("cone", body, packed(body, turned(body), shape.spheres))


def _polygon(sides: int) -> Array:
    """A regular polygon with the area of the unit circle, so that volumes agree: (sides, 2)."""
    turn = 2.0 * np.pi / sides
    angle = turn * np.arange(sides)
    return np.asarray(np.sqrt(turn / np.sin(turn)) * np.column_stack([np.cos(angle), np.sin(angle)]))


# ---- chains ----------------------------------------------------------------------------------------------------------


def _rod(shape: Any) -> Template:
    return _chain("rod", Tube(0.5, shape.aspect - 1.0), shape.spheres)


def _shaving(shape: Any) -> Template:
    coil, rise = 0.5 * shape.coil, shape.pitch / (2.0 * np.pi)
    return _chain("shaving", Tube(0.5, shape.length, coil, rise), shape.spheres)


def _chain(kind: str, body: Tube, count: int | None) -> Template:
    """Equal balls at equal distances along the axis, grown to fill part of the dimples between them."""
    if body.length == 0.0:
        return _sphere(None)
    least = int(np.ceil(body.length / (NEAREST_PITCH * body.radius) - 1e-9)) + 1
    if count is None:
        count = min(int(np.ceil(body.length / (USUAL_PITCH * body.radius) - 1e-9)) + 1, MOST_SPHERES)
    elif count < least:
        raise InputError(
            f"is {count}, too few for a chain without gaps: it takes at least {least}", path="spheres", value=count
        )
    centers, _, _ = body.curve(np.linspace(-0.5, 0.5, count) * body.length)
    spheres = np.column_stack([centers, np.full(count, body.radius)])
    return _cluster(kind, body, packing.grown(body, spheres))


# ---- flakes ----------------------------------------------------------------------------------------------------------


def _flake(shape: Any) -> Template:
    """Balls as thick as the flake side by side, so that both its faces are flat and it lies as high as it should."""
    a, b = 0.5 * shape.width * shape.elongation, 0.5 * shape.width
    if shape.outline == "irregular":
        plate = prism(_irregular(shape.corners, shape.seed) * [a, b], 1.0)
        return _cluster("flake", plate, packed(plate, _layer(plate), shape.spheres))
    if shape.outline == "round":
        body: Body = Cylinder(a, b, 1.0)
        layouts = _rings(shape.spheres)
    else:
        body = prism(np.array([[a, b], [-a, b], [-a, -b], [a, -b]]), 1.0)
        layouts = _rows(shape.spheres)
    inner = np.array([max(a - 0.5, 0.0), max(b - 0.5, 0.0)])
    clusters = [_layered(layout * inner) for layout in layouts]
    differences = [packing.Coverage.of(body, spheres, inside=8000).missed for spheres in clusters]
    return _cluster("flake", body, clusters[int(np.argmin(differences))])


def _layered(centers: Array) -> Array:
    n = len(centers)
    return without_hidden(np.column_stack([centers, np.zeros(n), np.full(n, 0.5)]))


def _rings(count: int) -> list[Array]:
    """Layouts (n <= count, 2) in the unit circle: rings, with a ball in the middle or not."""
    layouts = [np.zeros((1, 2))]
    for rings, middle in itertools.product(range(1, 7), (0, 1)):
        numbers = [(count - middle) * 2 * j // (rings * (rings + 1)) for j in range(1, rings + 1)]
        numbers = [n - n % 2 for n in numbers]  # its own mirror image to both sides
        if numbers[0] < 4 - 2 * middle:
            continue
        circles = [np.zeros((middle, 2))]
        for j, n in enumerate(numbers, 1):
            angle = 2.0 * np.pi * (np.arange(n) + 0.5 * (j % 2)) / n
            circles.append(j / rings * np.column_stack([np.cos(angle), np.sin(angle)]))
        layouts.append(np.concatenate(circles))
    return layouts


def _rows(count: int) -> list[Array]:
    """Layouts (n <= count, 2) in the square from -1 to 1."""
    layouts = []
    for rows in range(1, count + 1):
        u, v = (np.linspace(-1.0, 1.0, n) if n > 1 else np.zeros(1) for n in (count // rows, rows))
        layouts.append(np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2))
    return layouts


def _irregular(corners: int, seed: int) -> Array:
    """Corners of a convex polygon on the unit circle, at random angles that leave the centre inside: (n, 2)."""
    angle = 2.0 * np.pi * (np.arange(corners) + 0.8 * uniform(seed, corners)) / corners
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _layer(body: Convex) -> Candidates:
    """Candidates in the middle plane of a flake."""
    found = anywhere(body)
    points = packing.around(body, 12_000).points[:, :, 0].reshape(-1, 3) * np.array([1.0, 1.0, 0.0])
    radii = body.depth(points)
    thick = np.flatnonzero(radii > 0.8 * radii.max())
    order = thick[np.argsort(uniform(0, len(thick)), kind="stable")][: packing.CANDIDATES]
    orbits = [Orbit(points[i], np.eye(3)[None], float(radii[i])) for i in order]
    return replace(found, orbits=orbits, kept=(2,), grow=False)


# ---- angular grains, hulls and surfaces ------------------------------------------------------------------------------


def _angular(shape: Any) -> Template:
    """The hull of points scattered over an ellipsoid, evenly (a spiral) but for the roughness."""
    n = shape.corners
    draws = uniform(shape.seed, 3 * n + 3)
    height = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(n) + 2.0 * np.pi * draws[0]
    spread = shape.roughness / np.sqrt(n)  # up to about half the distance of neighbours
    height = np.clip(height + spread * (2.0 * draws[3 : n + 3] - 1.0), -1.0, 1.0)
    angle = angle + 2.0 * spread * (2.0 * draws[n + 3 : 2 * n + 3] - 1.0)
    across = np.sqrt(1.0 - height**2)
    directions = np.column_stack([across * np.cos(angle), across * np.sin(angle), height])
    points = directions @ _rotation(draws[:3]) * (1.0 - 0.5 * shape.roughness * draws[2 * n + 3 :])[:, None]
    points *= np.array([shape.elongation * shape.flatness, shape.flatness, 1.0])
    return _polyhedral("angular", convex_hull(points), shape)


def _rotation(draws: Array) -> Array:
    """A rotation uniform over all rotations, from three uniform numbers (Shoemake's quaternion)."""
    u, v, w = draws[0], 2.0 * np.pi * draws[1], 2.0 * np.pi * draws[2]
    s, c = np.sqrt(1.0 - u), np.sqrt(u)
    x, y, z, q = s * np.sin(v), s * np.cos(v), c * np.sin(w), c * np.cos(w)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * q), 2 * (x * z + y * q)],
            [2 * (x * y + z * q), 1 - 2 * (x * x + z * z), 2 * (y * z - x * q)],
            [2 * (x * z - y * q), 2 * (y * z + x * q), 1 - 2 * (x * x + y * y)],
        ]
    )


def _hull(shape: Any) -> Template:
    return _polyhedral("hull", convex_hull(np.array(shape.points, dtype=np.float64)), shape)


def _polyhedral(kind: str, body: Convex, shape: Any) -> Template:
    if shape.model == "convex":
        return _convex(kind, body, body)
    return _cluster(kind, body, packed(body, anywhere(body), shape.spheres))


def _mesh(shape: Any) -> Template:
    body = Polyhedron(np.array(shape.points, dtype=np.float64), np.array(shape.faces, dtype=np.int64))
    if shape.model == "convex":
        return _convex("mesh", body, _with_corners(convex_hull(body.points), shape.corners))
    return _cluster("mesh", body, packed(body, anywhere(body), shape.spheres))


def _with_corners(hull: Convex, most: int) -> Convex:
    """The hull of the corners that are farthest in evenly spread directions: at most so many."""
    if len(hull.points) <= most:
        return hull
    n = np.arange(most)
    height, angle = 1.0 - (2.0 * n + 1.0) / most, np.pi * (3.0 - np.sqrt(5.0)) * n
    across = np.sqrt(1.0 - height**2)
    directions = np.column_stack([across * np.cos(angle), across * np.sin(angle), height])
    farthest = np.unique((hull.points @ directions.T).argmax(axis=0))
    return convex_hull(hull.points[farthest])


BUILDERS: dict[str, Callable[[Any], Template]] = {
    "sphere": _sphere,
    "cluster": _explicit,
    "box": _box,
    "flake": _flake,
    "cylinder": _cylinder,
    "rod": _rod,
    "cone": _cone,
    "ellipsoid": _ellipsoid,
    "shaving": _shaving,
    "angular": _angular,
    "hull": _hull,
    "mesh": _mesh,
}
