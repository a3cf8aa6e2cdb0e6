"""Dielectric bodies, which only the field sees."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from ..units import Doc, Part, Quantity
from .machine import Point2

Permittivity = Annotated[float, Quantity("", 1.0, 1e5, "relative permittivity")]
Length = Annotated[float, Quantity("m", 1e-4, 100.0, "length along z, about the middle of the drum; None: endless")]


class DielectricBox(Part):
    """A dielectric box, such as a plate, a cover or a wall; what sticks out of the enclosure is cut off."""

    where: ClassVar[str] = "dielectric"
    kind: Literal["box"] = "box"
    center: Annotated[Point2, Doc("x and y of its middle [m]")]
    width: Annotated[float, Quantity("m", 1e-5, 200.0, "size along its own x")]
    height: Annotated[float, Quantity("m", 1e-5, 200.0, "size along its own y")]
    tilt: Annotated[float, Quantity("rad", -2.0 * math.pi, 2.0 * math.pi, "turn from x upwards")] = 0.0
    permittivity: Permittivity
    length: Length | None = None


class DielectricCylinder(Part):
    """A dielectric cylinder along z; it may hold a conductor, as the cover of a wire."""

    where: ClassVar[str] = "dielectric"
    kind: Literal["cylinder"] = "cylinder"
    center: Annotated[Point2, Doc("x and y of its axis [m]")]
    radius: Annotated[float, Quantity("m", 1e-6, 100.0, "radius")]
    permittivity: Permittivity
    length: Length | None = None


Dielectric = Annotated[DielectricBox | DielectricCylinder, Field(discriminator="kind")]


def plain(part: Part) -> dict[str, Any]:
    """The numbers of a dielectric, as `cesim.fields.FiniteElement` takes them."""
    return {name: value for name, value in part.model_dump(exclude_none=True).items() if name != "kind"}
