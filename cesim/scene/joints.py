"""What a machine has of parts that move by forces: motors, slides, free parts and the joints that hold them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from ..errors import InputError, show
from ..units import Doc, Part, Quantity, to_si

Time = Annotated[float, Quantity("s", 0.0, 1e9, "time")]
Turning = Annotated[float, Quantity("rad/s", -1000.0, 1000.0, "angular speed")]
Sliding = Annotated[float, Quantity("m/s", -20.0, 20.0, "speed")]
Moment = Annotated[float, Quantity("kg m2", 1e-12, 1e6, "moment of inertia")]
Place = Annotated[float, Quantity("m", -10.0, 10.0, "coordinate")]
Component = Annotated[float, Quantity("", -1e6, 1e6, "component of a direction")]
Speed = Annotated[float, Quantity("m/s", -100.0, 100.0, "velocity")]
Mass = Annotated[float, Quantity("kg", 1e-9, 1e5, "mass")]

GROUND = "ground"


def _rises(law: Sequence[tuple[float, float]] | None) -> None:
    if law is not None and any(after[0] <= before[0] for before, after in itertools.pairwise(law)):
        raise InputError("must have times that rise", path="law", value=law, unit="s")


class Motor(Part):
    """A motor that turns: it keeps its speed as long as that takes no more than its torque.

    As ``drum.drive`` it carries the drum on its axle, and needs the drum's mass.
    """

    kind: Literal["rotary_motor"] = "rotary_motor"
    speed: Annotated[float, Quantity("rad/s", -1000.0, 1000.0, "speed; None: by law, or that of the drum")] | None = (
        None
    )
    law: (
        Annotated[
            list[tuple[Time, Turning]],
            Field(min_length=1, max_length=10_000),
            Doc("rows of time [s] and speed [rad/s], linear between; None: speed, always"),
        ]
        | None
    ) = None
    torque_limit: Annotated[float, Quantity("N m", 1e-9, 1e6, "largest torque; None: whatever it takes")] | None = None
    mass: Annotated[float, Quantity("kg", 1e-6, 1e5, "mass of the drum")] | None = None
    inertia: (
        Annotated[float, Quantity("kg m2", 1e-12, 1e6, "of the drum about its axis; None: a thin hollow cylinder's")]
        | None
    ) = None

    @model_validator(mode="after")
    def _law_rises(self) -> Motor:
        _rises(self.law)
        return self

    def rows(self, speed: float = 0.0) -> list[tuple[float, float]]:
        """Its law as the engine takes it; speed: what it keeps where neither speed nor law is given."""
        return list(self.law) if self.law is not None else [(0.0, speed if self.speed is None else self.speed)]

    def limit(self) -> float:
        """N m."""
        return math.inf if self.torque_limit is None else self.torque_limit


def read_drive(value: Any) -> Any:
    """'prescribed' or a motor, which may come as a table."""
    if value == "prescribed" or isinstance(value, Motor):
        return value
    if not isinstance(value, dict):
        raise InputError(f"is {show(value)}, must be 'prescribed' or a Motor", value=value, allowed="'prescribed'")
    return Motor(**value)


class LinearMotor(Part):
    """A motor that pushes along the axis of a prismatic joint."""

    kind: Literal["linear_motor"] = "linear_motor"
    speed: Annotated[float, Quantity("m/s", -20.0, 20.0, "speed, where there is no law")] = 0.0
    law: (
        Annotated[
            list[tuple[Time, Sliding]],
            Field(min_length=1, max_length=10_000),
            Doc("rows of time [s] and speed [m/s], linear between; None: speed, always"),
        ]
        | None
    ) = None
    force_limit: Annotated[float, Quantity("N", 1e-9, 1e7, "largest force; None: whatever it takes")] | None = None

    @model_validator(mode="after")
    def _law_rises(self) -> LinearMotor:
        _rises(self.law)
        return self

    def rows(self, speed: float = 0.0) -> list[tuple[float, float]]:
        """Its law as the engine takes it."""
        return list(self.law) if self.law is not None else [(0.0, self.speed)]

    def limit(self) -> float:
        """N."""
        return math.inf if self.force_limit is None else self.force_limit


class Slide(Part):
    """The body slides along an axis: freely, or driven by a motor that keeps a speed within its force."""

    where: ClassVar[str] = "motion"
    kind: Literal["slide"] = "slide"
    axis: Annotated[tuple[Component, Component, Component], Doc("direction of positive travel, of any length")]
    mass: Annotated[float, Quantity("kg", 1e-6, 1e5, "mass of what slides")]
    motor: Annotated[LinearMotor | None, Doc("the motor, or None: it slides freely")] = None
    stops: (
        Annotated[tuple[Place, Place], Doc("(least, most) travel from where it starts [m]; None: no stops")] | None
    ) = None

    @model_validator(mode="after")
    def _axis_and_stops_make_sense(self) -> Slide:
        _has_direction(self.axis)
        _encloses_start(self.stops, "m")
        return self

    def greatest_speed(self) -> float:
        """That its motor asks for, m/s."""
        return max(abs(speed) for _, speed in self.motor.rows()) if self.motor is not None else 0.0


def _has_direction(axis: Sequence[float]) -> None:
    if math.hypot(*axis) < 1e-9:
        raise InputError("must not be zero", path="axis", value=axis)


def _encloses_start(stops: tuple[float, float] | None, unit: str) -> None:
    if stops is not None and not (stops[0] < stops[1] and stops[0] <= 0.0 <= stops[1]):
        raise InputError("must rise and have the start, 0, between them", path="stops", value=stops, unit=unit)


class RigidPart(Part):
    """A part of the machine that moves by forces. Plates, splitters and meshes that name it move with it."""

    where: ClassVar[str] = "part"
    name: Annotated[str, Field(min_length=1, max_length=40), Doc("name, for joints and surfaces")]
    mass: Annotated[float, Quantity("kg", 1e-9, 1e5, "mass")]
    inertia: Annotated[tuple[Moment, Moment, Moment], Doc("principal moments of inertia [kg m2]")]
    position: Annotated[tuple[Place, Place, Place], Doc("centre of mass [m]")] = (0.0, 0.0, 0.0)
    orientation: Annotated[
        tuple[Component, Component, Component, Component],
        Doc("quaternion (w, x, y, z) of any length, principal axes to world"),
    ] = (1.0, 0.0, 0.0, 0.0)
    velocity: Annotated[tuple[Speed, Speed, Speed], Doc("of the centre of mass at the start [m/s]")] = (0.0, 0.0, 0.0)
    angular_velocity: Annotated[tuple[Turning, Turning, Turning], Doc("at the start [rad/s]")] = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _inertia_is_one_of_a_body(self) -> RigidPart:
        if any(2.0 * one > math.fsum(self.inertia) * (1.0 + 1e-9) for one in self.inertia):
            raise InputError(
                "must have no moment above the sum of the others", path="inertia", value=self.inertia, unit="kg m2"
            )
        if math.hypot(*self.orientation) < 1e-9:
            raise InputError("must not be zero", path="orientation", value=self.orientation)
        if self.name == GROUND:
            raise InputError(f"is {show(self.name)}, which is what does not move", path="name", value=self.name)
        return self


class Joint(Part):
    """Holds part a to part b. Its travel, speed, torque and force are those of a against b."""

    where: ClassVar[str] = "joint"
    kind: Annotated[
        Literal["revolute", "prismatic", "fixed", "spherical"],
        Doc("'revolute': a turns about the axis; 'prismatic': it slides along it; 'fixed'; 'spherical'"),
    ]
    name: Annotated[str, Field(max_length=40), Doc("name; '': joints[i]")] = ""
    a: Annotated[str, Doc("name of a part, or 'ground'; the drum and what slides are parts, too: 'splitters[0]'")]
    b: Annotated[str, Doc("the other one")] = GROUND
    anchor: Annotated[tuple[Place, Place, Place], Doc("where it is at the start [m]")] = (0.0, 0.0, 0.0)
    anchor_b: (
        Annotated[tuple[Place, Place, Place], Doc("where b has it; the parts are put together; None: as a [m]")] | None
    ) = None
    axis: Annotated[tuple[Component, Component, Component], Doc("direction at the start, of any length")] = (
        0.0,
        0.0,
        1.0,
    )
    motor: Annotated[Motor | LinearMotor | None, Doc("its motor, or None: it moves freely")] = None
    stops: Annotated[tuple[float, float], Doc("(least, most) travel from the start [rad or m]")] | None = None

    @model_validator(mode="before")
    @classmethod
    def _read_what_depends_on_the_kind(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        slides, data = data.get("kind") == "prismatic", dict(data)
        path = ""
        try:
            if isinstance(data.get("stops"), list | tuple):
                path = "stops"
                data["stops"] = tuple(to_si(stop, "m" if slides else "rad", -1e3, 1e3) for stop in data["stops"])
            if isinstance(data.get("motor"), dict):
                path = "motor"
                data["motor"] = LinearMotor(**data["motor"]) if slides else Motor(**data["motor"])
        except InputError as error:
            raise error.at(path) from None
        return data

    @model_validator(mode="after")
    def _fits_its_kind(self) -> Joint:
        moves = {"revolute": Motor, "prismatic": LinearMotor}.get(self.kind)
        if moves is None and (self.motor is not None or self.stops is not None):
            raise InputError(
                f"is {self.kind}: only a revolute or prismatic joint has a motor or stops", path="kind", value=self.kind
            )
        if self.motor is not None and moves is not None and not isinstance(self.motor, moves):
            raise InputError(f"must be a {moves.__name__} in a {self.kind} joint", path="motor")
        if isinstance(self.motor, Motor) and (self.motor.mass, self.motor.inertia) != (None, None):
            raise InputError("belongs to a part, not to the motor of a joint", path="motor.mass", value=self.motor.mass)
        if moves is not None:
            _has_direction(self.axis)
        _encloses_start(self.stops, "m" if self.kind == "prismatic" else "rad")
        return self
