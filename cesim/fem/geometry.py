"""What a field is solved for: conductors, dielectric parts and the room, in SI units and centred on z = 0."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .curves import Circle, Curve, Polygon

Array = NDArray[np.float64]
LEAST_CLEARANCE = 1e-6  # m, between parts


@dataclass(frozen=True)
class Conductor:
    """A cylinder along z at a voltage of its own. The drum is the one at 0 V about the origin."""

    x: float  # m, of the axis
    y: float
    radius: float  # m
    length: float = math.inf  # m, along z; a finite one counts in three dimensions only
    name: str = "conductor"
    live: bool = True  # False: it stays at 0 V, and no unit solution is made for it

    @property
    def curve(self) -> Circle:
        """Its outline."""
        return Circle(self.x, self.y, self.radius)


@dataclass(frozen=True)
class Cylinder:
    """A dielectric cylinder along z; conductors inside it displace it."""

    x: float
    y: float
    radius: float
    permittivity: float  # relative
    length: float = math.inf

    @property
    def curve(self) -> Circle:
        """Its outline."""
        return Circle(self.x, self.y, self.radius)


@dataclass(frozen=True)
class Slab:
    """A dielectric box, turned about z; what sticks out of the room is cut off: it may be a wall or a lining."""

    x: float  # m, of its middle
    y: float
    width: float  # m, along its own x
    height: float  # m, along its own y
    permittivity: float  # relative
    tilt: float = 0.0  # rad, anticlockwise
    length: float = math.inf  # m, along z

    @property
    def curve(self) -> Polygon:
        """Its outline."""
        half = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * (0.5 * self.width, 0.5 * self.height)
        c, s = math.cos(self.tilt), math.sin(self.tilt)
        return Polygon(half @ np.array([[c, s], [-s, c]]) + (self.x, self.y))


@dataclass(frozen=True)
class Box:
    """The grounded room: a box with its faces along the axes, from -length/2 to length/2 along z."""

    left: float
    right: float
    bottom: float
    top: float
    length: float = math.inf

    @property
    def curve(self) -> Polygon:
        """Its outline."""
        x, y = (self.left, self.right), (self.bottom, self.top)
        return Polygon(np.array([[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]]))


@dataclass(frozen=True)
class Machine:
    """Everything that shapes the field, but for the voltages: those only weigh the unit solutions.

    Attributes
    ----------
    conductors : tuple of Conductor
    dielectrics : tuple of Cylinder and Slab
        Where two overlap, the later one counts.
    enclosure : Box or None
        None: free space. In two dimensions the conductors then carry no charge in all, as in the closed form of two
        cylinders, and infinity floats; in three the potential there is 0.
    """

    conductors: tuple[Conductor, ...]
    dielectrics: tuple[Cylinder | Slab, ...] = ()
    enclosure: Box | None = None

    @property
    def live(self) -> list[int]:
        """Which conductors have a unit solution."""
        return [k for k, conductor in enumerate(self.conductors) if conductor.live]

    @property
    def reach(self) -> float:
        """Distance of the farthest point of a part from the origin, m."""
        return max(part.curve.reach for part in (*self.conductors, *self.dielectrics))

    def outer(self, far: float) -> Curve:
        """Where the solution ends: the room, or a circle at a multiple of the parts' reach."""
        return self.enclosure.curve if self.enclosure is not None else Circle(0.0, 0.0, far * self.reach)

    def check(self) -> None:
        """Refuses parts that touch or cross where they must not."""
        if not self.conductors:
            raise InputError("is empty: a field needs a conductor", path="conductors")
        named: list[tuple[str, Curve]] = [(conductor.name, conductor.curve) for conductor in self.conductors]
        named += [(f"dielectrics[{k}]", part.curve) for k, part in enumerate(self.dielectrics)]
        for i, (name, curve) in enumerate(named):
            for other_name, other in named[:i]:
                if _gap(curve, other) < LEAST_CLEARANCE or (i < len(self.conductors) and _within(curve, other)):
                    raise InputError(f"touches {other_name}", path=name, unit="m")
                if i >= len(self.conductors) and _within(curve, other) and other_name[:10] != "dielectric":
                    raise InputError(f"lies inside {other_name}", path=name, unit="m")
        if self.enclosure is not None:
            self._check_room(self.enclosure)

    def _check_room(self, room: Box) -> None:
        if not (room.left < room.right and room.bottom < room.top):
            raise InputError("has no inside: its lower corner must be below its upper one", path="enclosure")
        for conductor in self.conductors:
            gap = -float(room.curve.signed(np.array([[conductor.x, conductor.y]]))[0]) - conductor.radius
            if not gap > LEAST_CLEARANCE:
                raise InputError(f"is not inside the enclosure: {gap:.3g} m from its wall", path=conductor.name)
        for k, part in enumerate(self.dielectrics):
            if isinstance(part, Cylinder) and not (room.curve.signed(_samples(part.curve)) < -LEAST_CLEARANCE).all():
                raise InputError("is not inside the enclosure", path=f"dielectrics[{k}]")
        longest = max((p.length for p in self.conductors if math.isfinite(p.length)), default=0.0)
        if not longest < room.length:
            raise InputError(
                f"is {room.length:.6g} m, must be above the length of the conductors, {longest:.6g} m",
                path="enclosure.length",
                unit="m",
            )


def _samples(curve: Curve) -> Array:
    return curve.place(lambda points: np.full(len(points), 0.02 * curve.size))


def _gap(a: Curve, b: Curve) -> float:
    """Distance of two outlines as far as samples show it, m; 0 where they cross."""
    gaps = [other.signed(_samples(curve)) for curve, other in ((a, b), (b, a))]
    if any(gap.min() < 0.0 < gap.max() for gap in gaps):
        return 0.0
    return float(min(np.abs(gap).min() for gap in gaps))


def _within(a: Curve, b: Curve) -> bool:
    """Whether one of two outlines that do not cross lies in the other."""
    return bool((a.signed(_samples(b)) < 0.0).all() if a.size > b.size else (b.signed(_samples(a)) < 0.0).all())
