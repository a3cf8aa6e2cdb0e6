"""Volume, centre and second moments of bodies of unit density."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mass:
    """Volume, centre, and second moments about the centre, of a body of unit density in its own lengths."""

    volume: float
    center: Array  # (3,)
    second: Array  # (3, 3): integral of (x - center)(x - center)^T

    @classmethod
    def about_origin(cls, volume: float, first: Array, second: Array) -> Mass:
        """From the integrals of 1, x and x x^T."""
        center = first / volume
        return cls(volume, center, second - volume * np.outer(center, center))

    @property
    def diameter(self) -> float:
        """Of the sphere of equal volume."""
        return float(np.cbrt(6.0 / np.pi * self.volume))

    @property
    def unit_inertia(self) -> Array:
        """Inertia over mass and squared diameter of equal volume, (3, 3); a sphere has 0.1 on the diagonal."""
        second = self.second / (self.volume * self.diameter**2)
        return np.asarray(np.trace(second) * np.eye(3) - second)

    def principal_axes(self) -> Array:
        """A rotation whose columns are the principal axes; where the axes are principal already, no rotation."""
        inertia = self.unit_inertia
        beside = np.abs(inertia - np.diag(np.diag(inertia))).max()
        if beside < 1e-12 * np.trace(inertia):
            return np.eye(3)
        axes = np.linalg.eigh(inertia)[1]
        axes *= np.where(axes[np.abs(axes).argmax(axis=0), range(3)] < 0.0, -1.0, 1.0)  # not up to the library
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        return np.asarray(axes)


def of_box(edges: Array) -> Mass:
    """A box around the origin."""
    volume = float(np.prod(edges))
    return Mass(volume, np.zeros(3), np.diag(volume * edges**2 / 12.0))


def of_ellipsoid(semiaxes: Array) -> Mass:
    """An ellipsoid around the origin."""
    volume = 4.0 / 3.0 * np.pi * float(np.prod(semiaxes))
    return Mass(volume, np.zeros(3), np.diag(volume * semiaxes**2 / 5.0))


def of_cylinder(a: float, b: float, height: float) -> Mass:
    """A cylinder around the origin along z over an ellipse of semiaxes a and b."""
    volume = np.pi * a * b * height
    return Mass(volume, np.zeros(3), np.diag(volume * np.array([a * a / 4.0, b * b / 4.0, height**2 / 12.0])))


def of_cone(radius: float, height: float) -> Mass:
    """A cone along z whose base lies at z = 0."""
    volume = np.pi * radius**2 * height / 3.0
    across = 3.0 / 20.0 * radius**2
    return Mass(
        volume, np.array([0.0, 0.0, height / 4.0]), np.diag(volume * np.array([across, across, 3.0 / 80.0 * height**2]))
    )


def signed_volume(points: Array, faces: NDArray[np.int64]) -> float:
    """Inside triangles that are counted anticlockwise from outside; negative if clockwise."""
    return float(np.linalg.det((points - points.mean(axis=0))[faces]).sum()) / 6.0


def of_polyhedron(points: Array, faces: NDArray[np.int64]) -> Mass:
    """A body inside a closed surface of triangles that are counted anticlockwise from outside.

    Each triangle and a point inside span a tetrahedron with a sign; their integrals are exact.
    """
    shift = points.mean(axis=0)
    corners = (points - shift)[faces]  # (m, 3, 3)
    six = np.linalg.det(corners)  # six times the volume
    total = corners.sum(axis=1)
    first = (six[:, None] * total).sum(axis=0) / 24.0
    second = np.einsum("m,mki,mkj->ij", six, corners, corners) + np.einsum("m,mi,mj->ij", six, total, total)
    mass = Mass.about_origin(float(six.sum()) / 6.0, first, second / 120.0)
    return Mass(mass.volume, mass.center + shift, mass.second)
