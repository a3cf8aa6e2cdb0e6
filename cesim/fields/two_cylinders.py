"""The field of two parallel cylinders, in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from .base import ElectricField, read_points, read_quantities


class TwoCylinders(ElectricField):
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
        numbers = read_quantities(
            {
                "drum_radius": (drum_radius, "m", 1e-6, 100.0),
                "electrode_radius": (electrode_radius, "m", 1e-6, 100.0),
                "distance": (distance, "m", 1e-6, 1000.0),
                "angle": (angle, "rad", -2.0 * np.pi, 2.0 * np.pi),
                "voltage": (voltage, "V", -1e7, 1e7),
            }
        )
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
        super().__init__({"kind": "two_cylinders", "drum_center": (0.0, 0.0), **numbers})

    def inside_conductors(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which points (n, 3) in m lie inside the drum or the electrode: (n,) bool."""
        x, y, _ = read_points(points).T
        far_x, far_y = x - self.distance * np.cos(self.angle), y - self.distance * np.sin(self.angle)
        return np.asarray((np.hypot(x, y) < self.drum_radius) | (np.hypot(far_x, far_y) < self.electrode_radius))

    def largest_on_circle(self, radius: float, center: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
        """Largest field strength in V/m on a circle in m, and its angle in rad; on a conductor that is on the line."""
        x, y = self.distance * np.cos(self.angle), self.distance * np.sin(self.angle)
        if (radius, *center) == (self.drum_radius, 0.0, 0.0):
            return self.on_line(radius), self.angle
        if (radius, *center) == (self.electrode_radius, x, y):
            return self.on_line(self.distance - radius), self.angle + np.pi
        return super().largest_on_circle(radius, center)

    def largest(self) -> float:
        """Largest field strength in V/m: where the line of centres leaves the thinner of the two."""
        return max(self.on_line(self.drum_radius), self.on_line(self.distance - self.electrode_radius))

    def on_line(self, radius: float) -> float:
        """Field strength in V/m on the line of centres, at a distance from the drum's axis in m."""
        point = [radius * np.cos(self.angle), radius * np.sin(self.angle), 0.0]
        return float(np.linalg.norm(self([point])[0]))

    def __repr__(self) -> str:
        return (
            f"TwoCylinders(drum_radius={self.drum_radius!r}, electrode_radius={self.electrode_radius!r}, "
            f"distance={self.distance!r}, angle={self.angle!r}, voltage={self.voltage!r})"
        )
