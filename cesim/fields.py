"""Electric fields as functions of points."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import engine
from .errors import InputError, engine_errors
from .units import to_si


class TwoCylinders:
    """Field between a grounded drum at the origin and a parallel electrode, in closed form.

    Parameters
    ----------
    drum_radius, electrode_radius : quantity
        Radii [m].
    distance : quantity
        Distance of the axes [m].
    angle : quantity
        Angle of the line of centres above the horizontal [rad].
    voltage : quantity
        Voltage of the electrode [V]; the drum is at 0.

    Notes
    -----
    Two line charges inside the conductors (Li, Lu, Xu & Zhou, J. Hazard. Mater. 151 (2008) 52), no other conductor
    near: good to a few per cent facing the electrode, far too strong behind the drum of a machine in a grounded box.
    """

    def __init__(
        self,
        drum_radius: float | str,
        electrode_radius: float | str,
        distance: float | str,
        angle: float | str,
        voltage: float | str,
    ) -> None:
        given: dict[str, tuple[float | str, str, float, float]] = {
            "drum_radius": (drum_radius, "m", 1e-6, 100.0),
            "electrode_radius": (electrode_radius, "m", 1e-6, 100.0),
            "distance": (distance, "m", 1e-6, 1000.0),
            "angle": (angle, "rad", -2.0 * np.pi, 2.0 * np.pi),
            "voltage": (voltage, "V", -1e7, 1e7),
        }
        numbers = {}
        for name, rule in given.items():
            try:
                numbers[name] = to_si(*rule)
            except InputError as error:
                raise error.at(name) from None
        self.drum_radius, self.electrode_radius = numbers["drum_radius"], numbers["electrode_radius"]
        self.distance, self.angle, self.voltage = numbers["distance"], numbers["angle"], numbers["voltage"]
        least = self.drum_radius + self.electrode_radius
        if not self.distance > least:
            raise InputError(
                f"is {self.distance:.6g} m, must be above the sum of the radii, {least:.6g} m",
                path="distance",
                value=distance,
                unit="m",
            )
        with engine_errors():
            self._field = engine.Field({"kind": "two_cylinders", "drum_center": (0.0, 0.0), **numbers})

    def __call__(self, points: ArrayLike) -> NDArray[np.float64]:
        """Field strength at points (n, 3) in m: (n, 3) in V/m."""
        with engine_errors():
            return self._field.field(_points(points))

    def potential(self, points: ArrayLike) -> NDArray[np.float64]:
        """Potential at points (n, 3) in m: (n,) in V."""
        with engine_errors():
            return self._field.potential(_points(points))

    def on_line(self, radius: float) -> float:
        """Field strength in V/m on the line of centres, at a distance from the drum's axis in m."""
        point = [radius * np.cos(self.angle), radius * np.sin(self.angle), 0.0]
        return float(np.linalg.norm(self([point])[0]))

    def __repr__(self) -> str:
        return (
            f"TwoCylinders(drum_radius={self.drum_radius!r}, electrode_radius={self.electrode_radius!r}, "
            f"distance={self.distance!r}, angle={self.angle!r}, voltage={self.voltage!r})"
        )


def _points(points: ArrayLike) -> NDArray[np.float64]:
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
