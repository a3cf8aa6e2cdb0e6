"""A potential on a grid: from a file, from another field, or from arrays."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .. import engine
from ..errors import InputError, number
from .base import Array, ElectricField, circle, read_points, relative
from .stored import MOST_NODES

LEAST_NODES = 4  # along an axis, for a cubic spline
MIRROR_DEPTH = 12  # spacings under the drum's surface in which nodes get the mirrored potential
INNER = 0.8  # of the drum's radius: nodes within it tell the drum's own potential
MIRROR_SWEEPS = 60  # the sweeps halve their error at least
SAMPLE = 20_000  # points at which an error is measured
SPREAD = (0.8191725134, 0.6710436067, 0.5497004779)  # powers of the root of x^4 = x + 1, inverse: an even sequence


class Grid(ElectricField):
    """A potential on equidistant nodes, interpolated by the cubic spline through them; E = -grad V.

    Parameters
    ----------
    origin : (3,) or (2,) floats
        The first node [m].
    spacing : (3,) or (2,) floats
        Distance of neighbouring nodes along x, y, z [m].
    values : (nx, ny, nz), (nx, ny, 1) or (nx, ny) array
        Potential [V]; at least four nodes along an axis, or one along z: the field is then the same at every z.
    drum_radius : float
        Radius [m] of the grounded drum about the z axis, 0: none. Nodes under its surface are given the potential that
        continues the one outside, V(r) = 2 V0 - V(R^2/r), as a grounded cylinder does exactly (Kelvin's inversion): a
        file has 0 there, and the kink at the surface would halve the field on it. Points inside the drum see its
        surface.
    interpolation_error, curl_residual : float
        What is known of them; None: measured, 0.
    source : str
        Where the values come from, for the record.

    Attributes
    ----------
    interpolation_error : float
        Root mean square difference, over that of the field, between the field of all nodes and that of every second one
        along each axis (or the function that was sampled). Where the potential is smooth the error of the grid itself
        is about an eighth of it.
    curl_residual : float
        Where the file gave a field and no potential: root mean square of what no potential explains, over that of the
        field.

    Notes
    -----
    The spline meets a cubic exactly; its error is of order h^4 in the potential and h^3 in the field (C. de Boor, A
    Practical Guide to Splines, Springer 1978). Beyond the grid the potential is that of the nearest point of its
    border: what `outside` tells. Within a spacing or two of an edge of a conductor in the file the field is rounded
    off.
    """

    def __init__(
        self,
        origin: ArrayLike,
        spacing: ArrayLike,
        values: ArrayLike,
        *,
        drum_radius: float = 0.0,
        interpolation_error: float | None = None,
        curl_residual: float = 0.0,
        source: str = "",
    ) -> None:
        self.values = _read_values(values)
        self.origin, self.spacing = _three("origin", origin, 0.0), _three("spacing", spacing, 1.0)
        self.drum_radius, self.curl_residual, self.source = float(drum_radius), float(curl_residual), source
        super().__init__(self._definition(self.values))
        if drum_radius > 0.0:
            self.values = _mirrored(self)
            super().__init__(self._definition(self.values))
        self.values.flags.writeable = False
        self.interpolation_error = self._against_half() if interpolation_error is None else float(interpolation_error)

    def _definition(self, values: Array) -> dict[str, object]:
        return {
            "kind": "grid",
            "origin": self.origin,
            "spacing": self.spacing,
            "values": values,
            "drum_radius": self.drum_radius,
            "drum_center": (0.0, 0.0),
        }

    @classmethod
    def read(cls, path: str | os.PathLike[str], *, drum_radius: float = 0.0) -> Grid:
        """The grid of a file: HDF5, VTK (.vti, .vtr, legacy .vtk) or CSV as COMSOL exports it.

        Parameters
        ----------
        path : path
            What it may hold stands in `cesim.fields.grid_files.read_grid`.
        drum_radius : float
            As for `Grid` [m].

        Raises
        ------
        InputError
            With the file's name: where it cannot be read, or holds neither a potential nor a field on a grid.
        """
        from .grid_files import read_grid

        data = read_grid(path)
        return cls(
            data.origin,
            data.spacing,
            data.values,
            drum_radius=drum_radius,
            curl_residual=data.curl_residual,
            source=data.source,
        )

    @classmethod
    def sample(
        cls,
        field: ElectricField,
        lower: Sequence[float],
        upper: Sequence[float],
        counts: Sequence[int],
        *,
        drum_radius: float = 0.0,
    ) -> Grid:
        """Another field on a grid, its error measured against that field.

        Parameters
        ----------
        field : ElectricField
            The field to sample.
        lower, upper : (2,) or (3,) floats
            Corners of the grid [m].
        counts : (2,) or (3,) ints
            Nodes along each axis.
        drum_radius : float
            As for `Grid`.
        """
        low, high = _three("lower", lower, 0.0), _three("upper", upper, 0.0)
        n = (*counts, 1)[:3]
        axes = [np.linspace(low[k], high[k], n[k]) for k in range(3)]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        spacing = [(high[k] - low[k]) / (n[k] - 1) if n[k] > 1 else 1.0 for k in range(3)]
        values = field.potential(nodes).reshape(n)
        grid = cls(low, spacing, values, drum_radius=drum_radius, interpolation_error=0.0, source=repr(field))
        grid.interpolation_error = grid.difference(field)
        return grid

    def difference(self, field: ElectricField) -> float:
        """Root mean square difference to another field at points between the nodes, over that of this field."""
        points = self._probes()
        points = points[~field.inside_conductors(points)]
        own = self(points)
        return relative(own - field(points), own)

    def nodes(self) -> Array:
        """Places of the nodes, (nx, ny, nz, 3) m."""
        axes = [self.origin[k] + self.spacing[k] * np.arange(self.values.shape[k]) for k in range(3)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)

    def limits(self) -> tuple[Array, Array]:
        """Corners of the grid, (3,) m; infinite along z where the field is the same at every z."""
        count = np.array(self.values.shape)
        lower, upper = np.array(self.origin), np.array(self.origin) + np.array(self.spacing) * (count - 1)
        if count[2] == 1:
            lower[2], upper[2] = -np.inf, np.inf
        return lower, upper

    def outside(self, points: ArrayLike) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Which points (n, 3) in m lie beyond the grid, where the potential is that of its border: (n,) bool."""
        place = read_points(points)
        lower, upper = self.limits()
        return np.asarray(((place < lower) | (place > upper)).any(axis=1))

    def largest(self) -> float:
        """Largest field strength in V/m between the nodes."""
        return float(np.linalg.norm(self(self._probes()), axis=1).max())

    def _probes(self) -> Array:
        """Points outside the drum, at most SAMPLE of them, in cells that are evenly picked.

        Spread over their cells: at nodes and in the middle between two the field of a spline is better than elsewhere.
        """
        shape = [max(n - 1, 1) for n in self.values.shape]
        total = int(np.prod(shape))
        pick = np.unique(np.linspace(0, total - 1, min(total, SAMPLE)).astype(np.int64))
        index = np.stack(np.unravel_index(pick, shape), axis=-1) + np.outer(np.arange(len(pick)), SPREAD) % 1.0
        if self.values.shape[2] == 1:
            index[:, 2] = 0.0
        points = np.asarray(self.origin) + np.asarray(self.spacing) * index
        return np.asarray(points[np.hypot(points[:, 0], points[:, 1]) > self.drum_radius])

    def _against_half(self) -> float:
        half = self.values[tuple(slice(None, None, 2 if n > 1 else 1) for n in self.values.shape)]
        if min(n for n in half.shape if n > 1) < LEAST_NODES:
            return float("nan")
        spacing = [2.0 * h for h in self.spacing]
        coarse = engine.Field(self._definition(half) | {"spacing": spacing})
        points = self._probes()
        last = np.asarray(self.origin) + np.asarray(spacing) * (np.array(half.shape) - 1)
        points = points[(points[:, :2] <= last[:2]).all(axis=1) & ((points[:, 2] <= last[2]) | (half.shape[2] == 1))]
        own = self(points)
        return relative(own - coarse.field(np.ascontiguousarray(points)), own)

    def __repr__(self) -> str:
        nodes = " x ".join(str(n) for n in self.values.shape if n > 1)
        return f"<cesim.fields.Grid: {nodes} nodes{f' of {self.source}' if self.source else ''}>"


def _three(name: str, given: ArrayLike, third: float) -> tuple[float, float, float]:
    try:
        array = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("must be three numbers", path=name, unit="m") from None
    if array.shape not in ((2,), (3,)) or not np.isfinite(array).all():
        raise InputError("must be two or three finite numbers", path=name, unit="m")
    x, y, z = (*array.tolist(), third)[:3]
    return x, y, z


def _read_values(values: ArrayLike) -> Array:
    """A fresh array of three axes; refuses what the spline cannot take."""
    try:
        array = np.array(values, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise InputError("must be numbers", path="values", unit="V") from None
    if array.ndim == 2:
        array = array[:, :, None]
    if array.ndim != 3:
        raise InputError(f"have {array.ndim} axes, must have two or three", path="values", unit="V")
    short = [f"{n} along {axis}" for axis, n in zip("xyz", array.shape, strict=True) if n < LEAST_NODES]
    if short and not (array.shape[2] == 1 and len(short) == 1):
        raise InputError(f"have {short[0]}, must be at least {LEAST_NODES} (along z, or 1)", path="values", unit="V")
    if array.size > MOST_NODES:
        raise InputError(f"have {number(array.size)} nodes, at most {MOST_NODES} may be", path="values", unit="V")
    wrong = ~np.isfinite(array)
    if wrong.any():
        first = ", ".join(map(str, np.argwhere(wrong)[0]))
        raise InputError(
            f"have {int(wrong.sum())} nodes without a finite number, the first at [{first}]", path="values", unit="V"
        )
    return array


def _mirrored(grid: Grid) -> Array:
    """The values with those under the drum's surface made to continue the ones outside, V(r) = 2 V0 - V(R^2/r).

    The right side is interpolated and so depends on the nodes sought: the mean of old and new is a contraction, at the
    surface, where the mirror image falls on the node itself, as well as far from it.
    """
    radius, nodes = grid.drum_radius, grid.nodes().reshape(-1, 3)
    rho = np.hypot(nodes[:, 0], nodes[:, 1])
    inside = np.flatnonzero(rho < radius)
    if not len(inside):
        return grid.values
    depth = MIRROR_DEPTH * max(grid.spacing[:2])
    farthest = radius + min(depth, radius)
    rho = rho[inside, None]
    toward = np.where(rho > 0.0, nodes[inside, :2] / np.maximum(rho, 1e-300), np.array([1.0, 0.0]))
    reach = np.minimum(radius * radius / np.maximum(rho, radius * radius / farthest), farthest)
    images = np.column_stack([reach * toward, nodes[inside, 2]])
    values = grid.values.copy()
    flat = values.reshape(-1)
    level = _drum_potential(grid, flat[inside[rho[:, 0] < INNER * radius]])
    flat[inside] = level
    for _ in range(MIRROR_SWEEPS):
        mirrored = 2.0 * level - engine.Field(grid._definition(values)).potential(images)
        flat[inside] = 0.5 * (flat[inside] + mirrored)
    return values


def _drum_potential(grid: Grid, within: Array) -> float:
    """V0, which a file counts from anywhere: that of the nodes well inside, or of the surface where they differ."""
    extent = float(np.ptp(grid.values))
    if len(within) and np.ptp(within) <= 1e-3 * extent:
        return float(np.median(within))
    return float(grid.potential(circle(grid.drum_radius, np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False))).mean())
