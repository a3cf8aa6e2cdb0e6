"""What every electric field can do."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import engine
from ..errors import InputError, engine_errors
from ..units import to_si

Array = NDArray[np.float64]
RING = 720  # points on a circle among which the largest field is looked for


class ElectricField(ABC):
    """A field of the engine's table: field strength and potential at points.

    Attributes
    ----------
    definition : dict
        What the engine takes, in SI units: the kind of field and its numbers.
    """

    def __init__(self, definition: Mapping[str, Any]) -> None:
        self.definition = dict(definition)
        with engine_errors():
            self._field = engine.Field(self.definition)

    def __call__(self, points: ArrayLike) -> Array:
        """Field strength at points (n, 3) in m: (n, 3) in V/m."""
        with engine_errors():
            return self._field.field(read_points(points))

    def potential(self, points: ArrayLike) -> Array:
        """Potential at points (n, 3) in m: (n,) in V."""
        with engine_errors():
            return self._field.potential(read_points(points))

    def inside_conductors(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which points (n, 3) in m lie inside a conductor, where the field is that of its surface: (n,) bool."""
        return np.zeros(len(read_points(points)), bool)

    @abstractmethod
    def largest(self) -> float:
        """Largest field strength in V/m, where this field has it: on its conductors, or between its nodes."""

    def largest_on_circle(self, radius: float, center: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
        """Where on a circle in the plane z = 0 the field is strongest.

        Parameters
        ----------
        radius : float
            [m].
        center : (x, y)
            [m].

        Returns
        -------
        strength, angle : float
            [V/m], and [rad] about the center, above the horizontal.
        """
        angle = np.linspace(0.0, 2.0 * np.pi, RING, endpoint=False)
        strength = np.linalg.norm(self(circle(radius, angle, center)), axis=1)
        first = int(np.argmax(strength))
        return float(strength[first]), float(angle[first])

    def __repr__(self) -> str:
        return f"<cesim.fields.{type(self).__name__}>"


def circle(radius: float, angle: Array, center: tuple[float, float] = (0.0, 0.0)) -> Array:
    """Points (n, 3) in m of a circle about an axis along z."""
    return np.column_stack(
        [center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle), np.zeros(len(angle))]
    )


def relative(difference: Array, own: Array) -> float:
    """Root mean square of a difference of fields, over that of the field; 0 where there is none."""
    scale = float(np.sqrt(np.mean(np.square(own)))) if len(own) else 0.0
    return float(np.sqrt(np.mean(np.square(difference)))) / scale if scale > 0.0 else 0.0


def read_points(points: ArrayLike) -> Array:
    """Points (n, 3) as the engine takes them."""
    try:
        array = np.asarray(points)
        if array.dtype.kind not in "iuf":
            raise TypeError
        array = np.ascontiguousarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("must be real numbers", path="points", allowed="(n, 3)") from None
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"have shape {array.shape}, must have (n, 3)", path="points", allowed="(n, 3)")
    if not np.isfinite(array).all():
        raise InputError("must be finite", path="points", allowed="finite")
    return array


def read_quantities(given: Mapping[str, tuple[Any, str, float, float]]) -> dict[str, float]:
    """Name -> (value, unit, least, most) as name -> SI number; an error names the quantity."""
    numbers = {}
    for name, rule in given.items():
        try:
            numbers[name] = to_si(*rule)
        except InputError as error:
            raise error.at(name) from None
    return numbers
