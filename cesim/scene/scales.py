"""Numbers of a scene that say how large an effect is, beside those that stand in its parts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..fields.base import circle

if TYPE_CHECKING:
    from .scene import Scene

RING = 180  # points around the drum


def least_sphericity(scene: Scene) -> float:
    """The least of all grains that are fed or described, by surface: 1 if all are spheres."""
    from .definition import grain_shapes

    return min(min(template.sphericity, 1.0) for template in grain_shapes(scene))


def surface_speed(scene: Scene) -> float:
    """Of the drum, m/s."""
    return abs(scene.drum.speed) * scene.drum.radius if scene.drum is not None else 0.0


def square_gradient(scene: Scene) -> float:
    """Largest gradient of the field's square just above the drum, V2/m3, by central differences."""
    if scene.drum is None or scene.field.lacks(scene):
        return 0.0
    field, gap = scene.electric_field(), 2e-3 * scene.drum.radius
    angle = np.linspace(0.0, 2.0 * np.pi, RING, endpoint=False)
    ring = circle(scene.drum.radius + 1.5 * gap, angle)
    ahead, behind = ([(field(ring + sign * gap * axis) ** 2).sum(axis=1) for axis in np.eye(3)[:2]] for sign in (1, -1))
    return float(np.hypot(*(np.subtract(ahead, behind) / (2.0 * gap))).max())


def rolling_speed(scene: Scene) -> float:
    """Speed in m/s of a sphere's surface about its centre when it leaves the drum rolling; 0 where nothing can roll.

    The sphere comes with the drum's speed and rolls from where the slope outweighs rolling friction c: with the square
    of its speed w in units of g R, dw/dtheta = (10/7) [sin theta - c (cos theta - w)], up to w = cos theta, where it
    leaves. Without rolling friction that is cos theta = (10 + 7 Fr)/17 (docs/physics.md 2.3).
    """
    drum, gravity = scene.drum, math.hypot(*scene.gravity)
    if (
        drum is None
        or gravity == 0.0
        or drum.friction == 0.0
        or scene.numerics.rotation == "off"
        or not _feeds_spheres(scene)
    ):
        return 0.0
    w = drum.speed**2 * drum.radius / gravity
    angle, turn = 0.0, 2e-3
    while w < math.cos(angle):
        angle += turn
        w += 10.0 / 7.0 * turn * max(math.sin(angle) - drum.rolling_friction * (math.cos(angle) - w), 0.0)
    return max(math.sqrt(w * gravity * drum.radius) - surface_speed(scene), 0.0)


def _feeds_spheres(scene: Scene) -> bool:
    return scene.feed is None or any(family.shape.kind == "sphere" for family in scene.feed.all_families())
