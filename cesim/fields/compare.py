"""A field, or two of them, on the drum and over the machine, as numbers."""

from __future__ import annotations

import csv
import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import percent
from .base import Array, ElectricField

ZONE = math.radians(15.0)  # from the line of centres: the zone of interest of docs/physics.md 1.1
STEP = 15.0  # degrees between the rows of the table
PLACES = 7  # along z


@dataclass(frozen=True)
class Comparison:
    """The normal field on the drum by one or two models.

    Attributes
    ----------
    names : names of the models
    angle : (n,) rad, from the line of centres, anticlockwise
    on_drum : (models, n) V/m, half-way along the drum, positive outwards
    z : (k,) m
    along : (models, k) V/m, on the drum facing the electrode
    """

    names: tuple[str, ...]
    angle: Array
    on_drum: Array
    z: Array
    along: Array

    def difference(self, within: float = ZONE) -> float:
        """Largest relative difference of the second model, up to an angle [rad] from the line of centres."""
        near = np.abs(self.angle) <= within * (1.0 + 1e-9)
        return float(np.abs(self.on_drum[1, near] / self.on_drum[0, near] - 1.0).max())

    def __str__(self) -> str:
        angle = np.degrees(self.angle)
        shown = np.flatnonzero(np.abs(angle / STEP - np.round(angle / STEP)) < 1e-6)
        lines = _lines("angle [deg]", angle[shown], self.names, self.on_drum[:, shown])
        lines.insert(0, "normal field on the drum [kV/m], angles from the line of centres")
        if np.ptp(self.along, axis=1).max() > 1e-9 * np.abs(self.along).max():
            lines += ["", "along the drum, facing the electrode [kV/m]"]
            lines += _lines("z [mm]", 1e3 * self.z, self.names, self.along)
        if len(self.names) == 2:
            most = f"{percent(self.difference())} within {math.degrees(ZONE):g} degrees of the line of centres"
            lines += ["", f"{self.names[1]} differs from {self.names[0]} by at most {most}"]
        return "\n".join(lines)

    def write_csv(self, path: str | os.PathLike[str]) -> None:
        """All angles, not only those of the table: degrees, then V/m by each model."""
        from ..files import writing

        with writing(Path(path)), open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["angle [deg]", *(f"{name} [V/m]" for name in self.names)])
            writer.writerows(
                [f"{x:.9g}" for x in row] for row in np.column_stack([np.degrees(self.angle), *self.on_drum])
            )


def _lines(head: str, place: Array, names: tuple[str, ...], values: Array) -> list[str]:
    ratio = len(names) == 2
    lines = [f"{head:>12}" + "".join(f"{name:>18}" for name in names) + ("     ratio" if ratio else "")]
    for k, where in enumerate(place):
        last = f"{values[1, k] / values[0, k]:10.3f}" if ratio and values[0, k] != 0.0 else ""
        lines.append(f"{where:12.4g}" + "".join(f"{1e-3 * row[k]:18.2f}" for row in values) + last)
    return lines


def compare(
    fields: dict[str, ElectricField], drum_radius: float, facing: float, half_length: float, step: float = 1.0
) -> Comparison:
    """One model or two on the drum.

    Parameters
    ----------
    fields : name -> field; the first is what the second is compared with
    drum_radius : m
    facing : rad, direction of the line of centres from the drum's axis, above the horizontal
    half_length : m, of the drum
    step : degrees between angles
    """
    angle = np.radians(np.arange(-180.0, 180.0 + 0.5 * step, step))
    z = np.linspace(0.0, half_length, PLACES)
    normal = np.column_stack([np.cos(facing + angle), np.sin(facing + angle), np.zeros(len(angle))])
    ahead = np.array([math.cos(facing), math.sin(facing), 0.0])
    line = drum_radius * ahead + np.column_stack([np.zeros((PLACES, 2)), z])
    on_drum = [(field(drum_radius * normal) * normal).sum(axis=1) for field in fields.values()]
    along = [field(line) @ ahead for field in fields.values()]
    return Comparison(tuple(fields), angle, np.array(on_drum), z, np.array(along))


@dataclass(frozen=True)
class FieldMap:
    """A field over a rectangle at one z: axes (nx,) and (ny,) m, field (nx, ny, 3) V/m, potential (nx, ny) V, and where
    conductors are (nx, ny) bool."""

    x: Array
    y: Array
    z: float
    field: Array
    potential: Array
    inside: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

    @property
    def strength(self) -> Array:
        """(nx, ny) V/m."""
        return np.asarray(np.linalg.norm(self.field, axis=2))

    def write_hdf5(self, path: str | os.PathLike[str]) -> None:
        """Axes, field, potential and mask, as `cesim.fields.Grid.read` reads them again."""
        import h5py

        from ..files import writing

        with writing(Path(path)), h5py.File(path, "w") as file:
            group = file.create_group("field")
            spacing = (self.x[1] - self.x[0], self.y[1] - self.y[0], 1.0)
            group.create_dataset("origin", data=np.array([self.x[0], self.y[0], self.z]))
            group.create_dataset("spacing", data=np.array(spacing))
            group.create_dataset("values", data=self.potential[:, :, None], compression="gzip", shuffle=True)
            group.create_dataset("field", data=self.field, compression="gzip", shuffle=True)
            group.create_dataset("inside", data=self.inside)
            group.attrs["units"] = "m, V, V/m"


def field_map(
    field: ElectricField, lower: tuple[float, float], upper: tuple[float, float], spacing: float, z: float = 0.0
) -> FieldMap:
    """A field over a rectangle, corners and spacing in m."""
    x, y = (np.arange(a, b + 0.5 * spacing, spacing) for a, b in zip(lower, upper, strict=True))
    points = np.stack(np.meshgrid(x, y, [z], indexing="ij"), axis=-1).reshape(-1, 3)
    shape = (len(x), len(y))
    inside = field.inside_conductors(points).reshape(shape)
    return FieldMap(x, y, z, field(points).reshape(*shape, 3), field.potential(points).reshape(shape), inside)
