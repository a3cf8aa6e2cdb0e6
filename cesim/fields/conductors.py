"""The field of any number of parallel cylinders and wires, alone or in a grounded box."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..constants import VACUUM_PERMITTIVITY
from ..errors import InputError, number
from .base import Array, ElectricField, read_points, read_quantities

MOST_CONDUCTORS = 60
DROPPED = 1e-12  # of the field on the conductors: terms that are smaller everywhere are not evaluated
POORLY_SOLVED = 1e-6  # of the highest voltage: an error of the potential on a surface that is refused


@dataclass(frozen=True)
class Cylinder:
    """A conducting cylinder or wire along z.

    Attributes
    ----------
    center : (float, float)
        x and y of its axis [m].
    radius : float
        Radius [m].
    voltage : float
        Voltage [V].
    """

    center: tuple[float, float]
    radius: float
    voltage: float = 0.0


class Conductors(ElectricField):
    """Field of parallel cylinders and wires at their voltages, exact to rounding in the plane.

    Parameters
    ----------
    cylinders : sequence of Cylinder or of mappings with its fields
        The conductors; the drum is one at 0 V. Quantities may be text with a unit.
    enclosure : ((x, y), (x, y)), optional
        Lower and upper corner of a grounded box around them [m]. Without one the total charge is zero and the
        potential far away floats, as in the closed form of two cylinders.

    Attributes
    ----------
    cylinders : tuple of Cylinder
        The conductors.
    charges : (n,) array
        Charge of each per length [C/m].
    boundary_error : float
        Largest error of the potential on the surfaces over the highest voltage. By the maximum principle it is nowhere
        larger.

    Notes
    -----
    Line charges with their images, multipoles about each axis, mirror images in the walls: docs/physics.md 1.2. A
    geometry is solved once for each conductor at 1 V and the others at 0 (`cesim.fields.multipoles.unit_solutions`
    keeps the last ones); any voltages are then sums, E = sum_i U_i e_i. Points inside a conductor see its surface;
    beyond the box there is no field.
    """

    def __init__(
        self,
        cylinders: Iterable[Cylinder | Mapping[str, Any]],
        enclosure: Sequence[Sequence[float | str]] | None = None,
    ) -> None:
        from .multipoles import unit_solutions

        self.cylinders = tuple(_read_cylinder(i, given) for i, given in enumerate(cylinders))
        self.enclosure = _read_box(enclosure)
        _refuse_overlaps(self.cylinders, self.enclosure)
        circles = tuple((*c.center, c.radius) for c in self.cylinders)
        box = None if self.enclosure is None else (*self.enclosure[0], *self.enclosure[1])
        self._units = unit_solutions(circles, box)
        voltages = np.array([c.voltage for c in self.cylinders])
        self.charges = (
            2.0
            * np.pi
            * VACUUM_PERMITTIVITY
            * sum((u * unit.charges for u, unit in zip(voltages, self._units, strict=True)), np.zeros(len(voltages)))
        )
        highest = float(np.abs(voltages).max())
        errors = np.array([unit.boundary_error for unit in self._units])
        self.boundary_error = float(np.abs(voltages) @ errors) / highest if highest > 0.0 else float(errors.max())
        if not self.boundary_error < POORLY_SOLVED:
            raise InputError(
                f"stand too near to each other: the potential is found to {self.boundary_error:.1g} of the voltage, "
                f"must be {POORLY_SOLVED:.0g}",
                path="cylinders",
            )
        super().__init__(self._definition(voltages, box))

    def _definition(self, voltages: Array, box: tuple[float, ...] | None) -> dict[str, Any]:
        first = self._units[0]
        strengths = sum(
            (u * unit.strengths for u, unit in zip(voltages, self._units, strict=True)), 0.0 * first.strengths
        )
        scale = max(
            (
                abs(q) / (c.radius * 2.0 * np.pi * VACUUM_PERMITTIVITY)
                for q, c in zip(self.charges, self.cylinders, strict=True)
            ),
            default=0.0,
        )
        series, terms = [], []
        for k, expansion in enumerate(first.expansions):
            total = sum(
                (u * unit.expansions[k].coefficients for u, unit in zip(voltages, self._units, strict=True)),
                0.0 * expansion.coefficients,
            )
            count = _terms_that_count(total, expansion.radius, expansion.growing, expansion.nearest, scale)
            if count:
                center = expansion.center
                series.append((center.real, center.imag, expansion.radius, count, float(expansion.growing)))
                terms.append(np.column_stack([total.real, total.imag])[:count])
        return {
            "kind": "conductors",
            "circles": np.array([(*c.center, c.radius, c.voltage) for c in self.cylinders]),
            "poles": np.column_stack([first.poles.real, first.poles.imag, strengths])[strengths != 0.0],
            "series": np.array(series).reshape(-1, 5),
            "terms": np.concatenate([np.zeros((0, 2)), *terms]),
            "constant": float(sum(u * unit.constant for u, unit in zip(voltages, self._units, strict=True))),
            "box": box or (0.0, 0.0, 0.0, 0.0),
            "drum_radius": self.cylinders[0].radius,
            "drum_center": self.cylinders[0].center,
        }

    def with_voltages(self, voltages: Sequence[float]) -> Conductors:
        """The same conductors at other voltages [V]; nothing is solved again."""
        if len(voltages) != len(self.cylinders):
            raise InputError(f"are {len(voltages)}, must be {len(self.cylinders)}", path="voltages", unit="V")
        moved = [Cylinder(c.center, c.radius, u) for c, u in zip(self.cylinders, voltages, strict=True)]
        return Conductors(moved, self.enclosure)

    def capacitances(self) -> Array:
        """Charge per length of conductor i for 1 V on conductor j, (n, n) F/m."""
        return 2.0 * np.pi * VACUUM_PERMITTIVITY * np.column_stack([unit.charges for unit in self._units])

    def inside_conductors(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which points (n, 3) in m lie inside a conductor, where the field is that of its surface: (n,) bool."""
        x, y, _ = read_points(points).T
        inside = [np.hypot(x - c.center[0], y - c.center[1]) < c.radius for c in self.cylinders]
        return np.asarray(np.any(inside, axis=0))

    def largest(self) -> float:
        """Largest field strength in V/m: on one of the conductors, for no wall in front of them has more."""
        return max(self.largest_on_circle(c.radius, c.center)[0] for c in self.cylinders)

    def __repr__(self) -> str:
        box = "" if self.enclosure is None else f", enclosure={self.enclosure!r}"
        return f"Conductors({list(self.cylinders)!r}{box})"


def _terms_that_count(c: NDArray[np.complex128], radius: float, growing: bool, nearest: float, scale: float) -> int:
    """How many terms of a series make more than DROPPED of the scale (V/m) anywhere; |w| is at most nearest."""
    m = np.arange(1, len(c) + 1)
    bound = m * np.abs(c) / radius * np.power(nearest, m - 1.0 if growing else m + 1.0)
    return int(np.flatnonzero(bound > DROPPED * scale).max(initial=-1)) + 1


def _read_cylinder(i: int, given: Cylinder | Mapping[str, Any]) -> Cylinder:
    if isinstance(given, Cylinder):
        given = {"center": given.center, "radius": given.radius, "voltage": given.voltage}
    try:
        if (
            not isinstance(given, Mapping)
            or set(given) - {"voltage"} != {"center", "radius"}
            or len(given["center"]) != 2
        ):
            raise InputError("must have center (x, y), radius and voltage")
        x, y = given["center"]
        numbers = read_quantities(
            {
                "center[0]": (x, "m", -100.0, 100.0),
                "center[1]": (y, "m", -100.0, 100.0),
                "radius": (given["radius"], "m", 1e-6, 100.0),
                "voltage": (given.get("voltage", 0.0), "V", -1e7, 1e7),
            }
        )
    except InputError as error:
        raise error.at("cylinders", i) from None
    return Cylinder((numbers["center[0]"], numbers["center[1]"]), numbers["radius"], numbers["voltage"])


def _read_box(given: Sequence[Sequence[float | str]] | None) -> tuple[tuple[float, float], tuple[float, float]] | None:
    if given is None:
        return None
    try:
        (left, low), (right, high) = given
    except (TypeError, ValueError):
        raise InputError(
            "must be ((x, y), (x, y)), the lower and the upper corner", path="enclosure", unit="m"
        ) from None
    rule = ("m", -100.0, 100.0)
    corners = read_quantities(
        {"left": (left, *rule), "low": (low, *rule), "right": (right, *rule), "high": (high, *rule)}
    )
    width, height = corners["right"] - corners["left"], corners["high"] - corners["low"]
    if not (width > 0.0 and height > 0.0 and 0.1 <= width / height <= 10.0):
        raise InputError(
            f"is {number(width)} m wide and {number(height)} m high, the ratio must be from 0.1 to 10",
            path="enclosure",
            unit="m",
        )
    return (corners["left"], corners["low"]), (corners["right"], corners["high"])


def _refuse_overlaps(
    cylinders: tuple[Cylinder, ...], box: tuple[tuple[float, float], tuple[float, float]] | None
) -> None:
    if not 1 <= len(cylinders) <= MOST_CONDUCTORS:
        raise InputError(f"are {len(cylinders)}, must be 1 to {MOST_CONDUCTORS}", path="cylinders")
    for i, one in enumerate(cylinders):
        for j in range(i):
            gap = math.dist(one.center, cylinders[j].center) - one.radius - cylinders[j].radius
            if not gap > 0.0:
                raise InputError(f"overlaps cylinders[{j}] by {number(-gap)} m", path=f"cylinders[{i}]", unit="m")
        if box is not None:
            room = min(
                *(c - low for c, low in zip(one.center, box[0], strict=True)),
                *(high - c for c, high in zip(one.center, box[1], strict=True)),
            )
            if not room > one.radius:
                raise InputError(
                    f"reaches {number(one.radius - room)} m beyond the enclosure", path=f"cylinders[{i}]", unit="m"
                )
