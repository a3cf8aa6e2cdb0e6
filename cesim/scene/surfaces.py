"""The machine's surfaces as shapes in space."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .effects import brush_speed
from .joints import Slide
from .machine import Belt, Brush, Drum, Plate, Splitter, Surface, Vibration, Wall
from .mesh import Mesh, Rotation

if TYPE_CHECKING:
    from .scene import Scene

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Body:
    """A surface of the machine: which part of the tree it comes from, and what the engine takes."""

    group: str
    part: Surface
    row: dict[str, Any]

    def local(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) in the body's own frame."""
        w, *axis = self.row["orientation"]
        turn = -np.asarray(axis)  # the inverse rotation
        shifted = points - np.asarray(self.row["position"])
        across = np.cross(turn, shifted)
        return np.asarray(shifted + 2.0 * (w * across + np.cross(turn, across)))

    def contains(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which of the points (n, 3) lie inside the body."""
        return INSIDE[self.row["shape"]](self.local(points).T, np.asarray(self.row["size"]))

    def distance_from_drum_axis(self) -> float:
        """Least distance in m, in the xy plane, of a box from the origin."""
        excess = np.abs(self.local(np.zeros((1, 3)))[0]) - 0.5 * np.asarray(self.row["size"])
        return float(np.hypot(*np.maximum(excess[:2], 0.0)))


# Which points (3, n) of a body's own frame lie inside it, by shape and size.
INSIDE: dict[str, Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.bool_]]] = {
    "plane": lambda p, size: np.less(p[1], 0.0),
    "box": lambda p, size: np.logical_and.reduce(np.abs(p) < 0.5 * size[:, None]),
    "cylinder": lambda p, size: np.less(np.hypot(p[0], p[1]), size[0]) & np.less(np.abs(p[2]), 0.5 * size[2]),
    "mesh": lambda p, size: np.zeros(p.shape[1], dtype=np.bool_),  # a sheet has no inside
}


def _surface(shape: str, position: Vector, size: Vector, **rest: Any) -> dict[str, Any]:
    still = {
        "role": "inert",
        "orientation": (1.0, 0.0, 0.0, 0.0),
        "angular_speed": 0.0,
        "belt_velocity": (0.0, 0.0, 0.0),
        "vibration": (0.0, 0.0, 0.0),
        "vibration_frequency": 0.0,
        "part": -1,
    }
    return {"shape": shape, "position": position, "size": size, **still, **rest}


def _drum(drum: Drum) -> dict[str, Any]:
    size = (drum.radius, drum.radius, drum.length)
    # The axis is +z; the top moves to +x when the drum turns about -z.
    return _surface("cylinder", (0.0, 0.0, 0.0), size, name="drum", role="ground", angular_speed=-drum.speed)


def _brush(brush: Brush, speed: float) -> dict[str, Any]:
    size = (brush.radius, brush.radius, brush.length)
    return _surface("cylinder", (*brush.center, 0.0), size, name="brush", role="brush", angular_speed=-speed)


def _plate(plate: Plate) -> dict[str, Any]:
    down = np.array([math.cos(plate.slope), -math.sin(plate.slope), 0.0])
    normal = np.array([math.sin(plate.slope), math.cos(plate.slope), 0.0])
    center = np.array([*plate.end, 0.0]) - 0.5 * plate.length * down - 0.5 * plate.thickness * normal
    motion = _motion(plate.motion)
    if isinstance(plate.motion, Belt):
        motion = {"belt_velocity": _vector(plate.motion.speed * down)}
    size = (plate.length, plate.thickness, plate.width)
    return _surface("box", _vector(center), size, orientation=_about_z(-plate.slope), **motion)


def _splitter(splitter: Splitter) -> dict[str, Any]:
    down = np.array([math.sin(splitter.tilt), -math.cos(splitter.tilt), 0.0])
    center = np.array([*splitter.tip, 0.0]) + 0.5 * splitter.length * down
    size = (splitter.thickness, splitter.length, splitter.width)
    return _surface("box", _vector(center), size, orientation=_about_z(splitter.tilt))


def _wall(wall: Wall) -> dict[str, Any]:
    return _surface(
        "plane", wall.position, (0.0, 0.0, 0.0), orientation=_from_y_to(wall.normal), **_motion(wall.motion)
    )


def _mesh(mesh: Mesh) -> dict[str, Any]:
    norm = math.hypot(*mesh.orientation)
    turning = {"angular_speed": mesh.motion.speed} if isinstance(mesh.motion, Rotation) else {}
    return _surface(
        "mesh",
        mesh.position,
        (0.0, 0.0, 0.0),
        role=mesh.role,
        orientation=tuple(component / norm for component in mesh.orientation),
        vertices=mesh.corners(),
        triangles=np.asarray(mesh.triangles, dtype=np.uint32),
        **turning,
        **_motion(mesh.motion),
    )


def _motion(motion: Belt | Vibration | Rotation | Slide | None) -> dict[str, Any]:
    if not isinstance(motion, Vibration):
        return {}
    x, y = motion.amplitude * math.cos(motion.direction), motion.amplitude * math.sin(motion.direction)
    return {"vibration": (x, y, 0.0), "vibration_frequency": motion.frequency}


def _about_z(angle: float) -> tuple[float, float, float, float]:
    """Unit quaternion (w, x, y, z) of a rotation about z."""
    return math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)


def _from_y_to(direction: Vector) -> tuple[float, float, float, float]:
    """Unit quaternion (w, x, y, z) of the shortest rotation that takes +y to a direction."""
    x, y, z = (component / math.hypot(*direction) for component in direction)
    norm = math.sqrt(2.0 + 2.0 * abs(y))
    if y < 0.0:  # half a turn about x leads to -y, from where the way is short
        return z / norm, (1.0 - y) / norm, x / norm, 0.0
    return (1.0 + y) / norm, z / norm, 0.0, -x / norm


def _vector(array: NDArray[np.float64]) -> Vector:
    return float(array[0]), float(array[1]), float(array[2])


LISTS: dict[str, Callable[[Any], dict[str, Any]]] = {
    "plates": _plate,
    "splitters": _splitter,
    "walls": _wall,
    "meshes": _mesh,
}
GROUPS = ("drum", "brush", *LISTS)


def surfaces(scene: Scene) -> list[Body]:
    """All surfaces, in the order of their indices: drum, brush, plates, splitters, walls, meshes."""
    bodies = []
    if scene.drum is not None:
        bodies.append(Body("drum", scene.drum, _drum(scene.drum)))
    if scene.brush is not None:
        bodies.append(Body("brush", scene.brush, _brush(scene.brush, brush_speed(scene))))
    for group, shape in LISTS.items():
        for i, part in enumerate(getattr(scene, group)):
            bodies.append(Body(group, part, {"name": f"{group}[{i}]", **shape(part)}))
    return bodies
