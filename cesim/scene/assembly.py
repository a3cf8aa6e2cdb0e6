"""The dynamic parts of a scene and their joints, as the engine takes them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..errors import InputError, unknown
from .joints import GROUND, Joint, LinearMotor, Motor, RigidPart, Slide

if TYPE_CHECKING:
    from .scene import Scene
    from .surfaces import Body


@dataclass
class Assembly:
    """Parts and joints in the order of their indices, and which part carries which surface."""

    parts: list[dict[str, Any]] = field(default_factory=list)
    joints: list[dict[str, Any]] = field(default_factory=list)
    carriers: dict[str, int] = field(default_factory=dict)  # name of a surface -> index of a part

    def index(self, name: str, *path: str | int) -> int:
        """Of a part by its name, -1 for the ground."""
        if name == GROUND:
            return -1
        names = [part["name"] for part in self.parts]
        if name not in names:
            raise unknown("part", name, [GROUND, *names]).at(*path)
        return names.index(name)


def assembly(scene: Scene, bodies: list[Body]) -> Assembly:
    """The drum if a motor drives it, what slides, the entries of ``scene.parts``, and the joints of all."""
    built = Assembly()
    for body in bodies:
        name, part = body.row["name"], body.part
        drive, motion = getattr(part, "drive", None), getattr(part, "motion", None)
        if isinstance(drive, Motor):
            _add_drum(built, scene, body, drive)
        elif isinstance(motion, Slide):
            _add_slide(built, body, motion)
        if getattr(part, "part", None) is not None and motion is not None:
            raise InputError("has a motion of its own and a part that carries it", path=f"{name}.motion")
    for i, own in enumerate(scene.parts):
        if own.name in [part["name"] for part in built.parts]:
            raise InputError(f"is {own.name!r}, which another part has", path=f"parts[{i}].name", value=own.name)
        built.parts.append(_part(own))
    for body in bodies:
        carrier = getattr(body.part, "part", None)
        if carrier is not None:
            built.carriers[body.row["name"]] = built.index(carrier, f"{body.row['name']}.part")
    for i, joint in enumerate(scene.joints):
        built.joints.append(_joint(built, joint, i))
    names = [joint["name"] for joint in built.joints]
    for i, joint in enumerate(scene.joints):
        if joint.name and names.count(joint.name) > 1:
            raise InputError(f"is {joint.name!r}, which another joint has", path=f"joints[{i}].name", value=joint.name)
    return built


def _add_drum(built: Assembly, scene: Scene, body: Body, motor: Motor) -> None:
    drum = scene.drum
    assert drum is not None
    assert motor.mass is not None
    about = motor.mass * drum.radius**2 if motor.inertia is None else motor.inertia
    across = 0.5 * about + motor.mass * drum.length**2 / 12.0
    # The engine's axis is +z; the top moves to +x when the drum turns about -z.
    law = [(time, -speed) for time, speed in motor.rows(drum.speed)]
    built.carriers[body.row["name"]] = len(built.parts)
    built.joints.append(
        {
            "name": "drum",
            "kind": "revolute",
            "part_a": len(built.parts),
            "part_b": -1,
            "axis": (0.0, 0.0, 1.0),
            "law": law,
            "limit": motor.limit(),
        }
    )
    built.parts.append(
        {
            "name": "drum",
            "mass": motor.mass,
            "inertia": (across, across, about),
            "angular_velocity": (0.0, 0.0, law[0][1]),
        }
    )


def _add_slide(built: Assembly, body: Body, slide: Slide) -> None:
    row = body.row
    x, y, z = (size**2 for size in row["size"])
    law = slide.motor.rows() if slide.motor is not None else None
    axis = [component / math.hypot(*slide.axis) for component in slide.axis]
    built.carriers[row["name"]] = len(built.parts)
    built.joints.append(
        {
            "name": row["name"],
            "kind": "prismatic",
            "part_a": len(built.parts),
            "part_b": -1,
            "anchor_a": row["position"],
            "anchor_b": row["position"],
            "axis": slide.axis,
            **_drive(slide.motor, slide.stops),
        }
    )
    built.parts.append(
        {
            "name": row["name"],
            "mass": slide.mass,
            "position": row["position"],
            "orientation": row["orientation"],
            "inertia": tuple(slide.mass / 12.0 * (others + 1e-12) for others in (y + z, x + z, x + y)),
            "velocity": tuple(component * law[0][1] for component in axis) if law is not None else (0.0, 0.0, 0.0),
        }
    )


def _drive(motor: Motor | LinearMotor | None, stops: tuple[float, float] | None) -> dict[str, Any]:
    row: dict[str, Any] = {}
    if motor is not None:
        row |= {"law": motor.rows(), "limit": motor.limit()}
    if stops is not None:
        row |= {"least_travel": stops[0], "most_travel": stops[1]}
    return row


def _part(part: RigidPart) -> dict[str, Any]:
    norm = math.hypot(*part.orientation)
    return {
        "name": part.name,
        "mass": part.mass,
        "inertia": part.inertia,
        "position": part.position,
        "orientation": tuple(component / norm for component in part.orientation),
        "velocity": part.velocity,
        "angular_velocity": part.angular_velocity,
    }


def _joint(built: Assembly, joint: Joint, i: int) -> dict[str, Any]:
    return {
        "name": joint.name or f"joints[{i}]",
        "kind": joint.kind,
        "axis": joint.axis,
        "part_a": built.index(joint.a, "joints", i, "a"),
        "part_b": built.index(joint.b, "joints", i, "b"),
        "anchor_a": joint.anchor,
        "anchor_b": joint.anchor if joint.anchor_b is None else joint.anchor_b,
        **_drive(joint.motor, joint.stops),
    }
