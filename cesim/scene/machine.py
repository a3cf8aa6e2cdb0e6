"""The machine: what the grains touch, the field they fly in, the air between.

Frame: the drum's centre is the origin; x to the electrode's side, y up, z along the drum's axis.
Numbers given as defaults are those of the reference machine (`cesim.scenes.reference_machine` names their source).
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from ..errors import InputError
from ..materials import Friction, Restitution, RollingFriction, SpinningFriction
from ..units import Doc, Part, Quantity
from .joints import Motor, Slide, read_drive

Coordinate = Annotated[float, Quantity("m", -10.0, 10.0, "coordinate")]
Point2 = tuple[Coordinate, Coordinate]
Point3 = tuple[Coordinate, Coordinate, Coordinate]
Component = Annotated[float, Quantity("", -1e6, 1e6, "component of a direction")]
Angle = Annotated[float, Quantity("rad", -math.pi, math.pi, "angle")]


class Belt(Part):
    """A belt: the surface runs, the body stays."""

    where: ClassVar[str] = "motion"
    kind: Literal["belt"] = "belt"
    speed: Annotated[float, Quantity("m/s", -20.0, 20.0, "speed of the top surface down the plate")] = 0.4

    def greatest_speed(self) -> float:
        """Of the surface, m/s."""
        return abs(self.speed)


class Vibration(Part):
    """A sinusoidal vibration of the whole body, amplitude sin(2 pi frequency t)."""

    where: ClassVar[str] = "motion"
    kind: Literal["vibration"] = "vibration"
    amplitude: Annotated[float, Quantity("m", 0.0, 0.1, "amplitude, half the stroke")]
    frequency: Annotated[float, Quantity("Hz", 0.0, 1000.0, "frequency")]
    direction: Annotated[
        float, Quantity("rad", -2.0 * math.pi, 2.0 * math.pi, "direction in the xy plane, from x upwards")
    ] = 0.5 * math.pi

    def greatest_speed(self) -> float:
        """Of the surface, m/s."""
        return 2.0 * math.pi * self.frequency * self.amplitude


class Surface(Part):
    """What every surface has: the coefficients of its contacts with grains."""

    friction: Friction = 0.2
    restitution: Restitution = 0.0
    rolling_friction: RollingFriction = 0.0
    spinning_friction: SpinningFriction = 0.0


Carrier = Annotated[str | None, Doc("name of the entry of parts[] that carries it, or None")]


class Drum(Surface):
    """The grounded drum, at a prescribed speed or driven by a motor. Its centre is the origin, its axis z."""

    where: ClassVar[str] = "drum"
    radius: Annotated[float, Quantity("m", 1e-3, 5.0, "radius")] = 0.160
    length: Annotated[float, Quantity("m", 1e-3, 10.0, "length along the axis")] = 0.300
    speed: Annotated[float, Quantity("rad/s", -1000.0, 1000.0, "speed, positive: the top moves to +x")] = (
        44.8 * math.pi / 30.0
    )
    friction: Friction = 0.5
    drive: Annotated[
        Literal["prescribed"] | Motor,
        BeforeValidator(read_drive),
        Doc("'prescribed', or a Motor: the drum is then a body on its axle, loaded by the grains"),
    ] = "prescribed"

    @model_validator(mode="after")
    def _motor_has_a_drum(self) -> Drum:
        if isinstance(self.drive, Motor) and self.drive.mass is None:
            raise InputError("is missing: a drum that a motor drives has a mass", path="drive.mass", unit="kg")
        return self


class Electrode(Part):
    """An electrode, a cylinder parallel to the drum: a tube or a wire. Grains do not collide with it."""

    where: ClassVar[str] = "electrode"
    kind: Annotated[Literal["static", "corona"], Doc("'static', or 'corona': a wire whose ions charge insulators")] = (
        "static"
    )
    radius: Annotated[float, Quantity("m", 1e-5, 1.0, "radius")] = 0.019
    distance: Annotated[float, Quantity("m", 1e-3, 10.0, "distance of its axis from the drum's")] = 0.267
    angle: Annotated[
        float, Quantity("rad", -2.0 * math.pi, 2.0 * math.pi, "angle of the line of centres above the horizontal")
    ] = math.radians(30.0)
    voltage: Annotated[float, Quantity("V", -2e5, 2e5, "voltage against the grounded drum")] = -35e3

    def center(self) -> tuple[float, float]:
        """x and y of its axis [m]."""
        return self.distance * math.cos(self.angle), self.distance * math.sin(self.angle)


class Corona(Part):
    """The stretch of the drum on which ions charge insulators."""

    where: ClassVar[str] = "corona"
    arc: Annotated[
        tuple[Angle, Angle], Doc("(from, to), angles from the drum's top, clockwise: towards the electrode [rad]")
    ] = (math.radians(10.0), math.radians(60.0))
    height: Annotated[float, Quantity("m", 0.0, 1.0, "thickness of the charging layer over the drum")] = 0.005
    field: (
        Annotated[float, Quantity("V/m", 0.0, 3e6, "strength of the charging field; None: that of the electrodes")]
        | None
    ) = None
    current_density: (
        Annotated[float, Quantity("A/m2", 1e-9, 1.0, "ion current density at the drum; None: charges at once")] | None
    ) = None
    model: Annotated[
        Literal["arc", "deutsch", "drift"],
        Doc(
            "'arc': as given above; 'deutsch': field and current along the drum follow from the wires; 'drift': the "
            "same from one wire, ions along their own field"
        ),
    ] = "arc"
    roughness: Annotated[float, Quantity("", 0.1, 1.0, "of the wires, in Peek's law: 1 polished, 0.93 weathered")] = 1.0
    mobility: Annotated[float, Quantity("m2/(V s)", 1e-7, 1.0, "of the ions")] = 1.8e-4
    shielding: Annotated[
        float, Quantity("", 0.0, 10.0, "by neighbours on the drum; 0: none, 1: captured areas overlap at random")
    ] = 0.0
    scatter: Annotated[
        float, Quantity("", 0.0, 1.0, "each grain's charge is multiplied by 1 - scatter U(0, 1), once for all")
    ] = 0.0
    kinetics: Annotated[
        Literal["auto", "on", "off"],
        Doc("'auto': charging takes its time unless that is 0.02 % of the time in the arc"),
    ] = "auto"

    @model_validator(mode="after")
    def _arc_is_ordered(self) -> Corona:
        if not self.arc[0] < self.arc[1]:
            raise InputError("must begin at a smaller angle than it ends", path="arc", value=self.arc, unit="rad")
        return self

    @model_validator(mode="after")
    def _ions_are_given_once(self) -> Corona:
        for name in ("field", "current_density") if self.model != "arc" else ():
            if getattr(self, name) is not None:
                raise InputError(f"stands beside model = {self.model!r}, from which it follows", path=name)
        return self


class Plate(Surface):
    """A feeder plate: a box whose top surface slopes down to +x."""

    where: ClassVar[str] = "plate"
    end: Annotated[Point2, Doc("x and y of the lower end of the top surface [m]")] = (-0.071, 0.171)
    slope: Annotated[float, Quantity("rad", -0.5 * math.pi, 0.5 * math.pi, "slope below the horizontal")] = (
        math.radians(5.7)
    )
    length: Annotated[float, Quantity("m", 1e-4, 10.0, "length along the slope")] = 0.388
    width: Annotated[float, Quantity("m", 1e-4, 10.0, "width along z")] = 0.400
    thickness: Annotated[float, Quantity("m", 0.0, 1.0, "thickness")] = 0.010
    motion: (
        Annotated[
            Belt | Vibration | Slide,
            Field(discriminator="kind"),
            Doc("belt, vibration, slide, or None: it stands still"),
        ]
        | None
    ) = None
    part: Carrier = None


class Splitter(Surface):
    """A splitter blade, a thin box hanging below its tip."""

    where: ClassVar[str] = "splitter"
    tip: Annotated[Point2, Doc("x and y of the middle of the upper edge [m]")]
    tilt: Annotated[
        float, Quantity("rad", -0.5 * math.pi, 0.5 * math.pi, "tilt off the vertical, positive: the foot leans to +x")
    ] = 0.0
    length: Annotated[float, Quantity("m", 1e-4, 10.0, "length from tip to foot")] = 0.150
    width: Annotated[float, Quantity("m", 1e-4, 10.0, "width along z")] = 0.300
    thickness: Annotated[float, Quantity("m", 0.0, 1.0, "thickness")] = 0.001
    friction: Friction = 0.1
    motion: Annotated[Slide | None, Doc("a slide, or None: it stands still")] = None
    part: Carrier = None


class Brush(Surface):
    """The brush, a cylinder that sweeps the drum and takes the charge of what it touches.

    It turns in the drum's sense, so at the nip it moves against the drum. Were its surface the slower one, the two
    would roll a grain into the nip, as a mill does; without a speed of its own its surface therefore runs half as
    fast again as the drum's.
    """

    where: ClassVar[str] = "brush"
    center: Annotated[Point2, Doc("x and y of its axis [m]")] = (-0.2124, 0.0057)
    radius: Annotated[float, Quantity("m", 1e-3, 5.0, "radius")] = 0.053
    length: Annotated[float, Quantity("m", 1e-3, 10.0, "length along the axis")] = 0.300
    speed: (
        Annotated[float, Quantity("rad/s", -1000.0, 1000.0, "speed, in the drum's sense; None: from the drum's")] | None
    ) = None
    friction: Friction = 0.9


class Wall(Surface):
    """A plane without end; grains stay on the side its normal points to."""

    where: ClassVar[str] = "wall"
    position: Annotated[Point3, Doc("a point of the plane [m]")]
    normal: Annotated[tuple[Component, Component, Component], Doc("direction into the free side, of any length")]
    motion: Annotated[Vibration | None, Doc("vibration, or None: it stands still")] = None

    @model_validator(mode="after")
    def _normal_has_a_direction(self) -> Wall:
        if math.hypot(*self.normal) < 1e-9:
            raise InputError("must not be zero", path="normal", value=self.normal)
        return self


class Air(Part):
    """The air the grains fly through (20 degrees Celsius, 1 atm)."""

    where: ClassVar[str] = "air"
    density: Annotated[float, Quantity("kg/m3", 0.0, 100.0, "density")] = 1.204
    viscosity: Annotated[float, Quantity("Pa s", 1e-7, 1.0, "dynamic viscosity")] = 1.81e-5
    law: Annotated[
        Literal["schiller_naumann", "stokes"],
        Doc("drag law of spheres: 'schiller_naumann' or 'stokes'; of other grains see the effect shape_drag"),
    ] = "schiller_naumann"
    wind: Annotated[
        Literal["auto", "on", "off"], Doc("air that the drum drags along; effects.wind, where given, goes first")
    ] = "auto"
