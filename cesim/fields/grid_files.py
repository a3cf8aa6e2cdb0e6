"""Reads a potential or a field on a grid from a file of the user's: HDF5, VTK, CSV.

What is read is data: sizes are looked at before memory is taken, and pickles, links and references to other files are
refused or never followed.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, number, show
from .base import Array
from .grid import LEAST_NODES
from .stored import MOST_NODES
from .vtk_files import read_vti, read_vtk, read_vtr

if TYPE_CHECKING:
    import h5py

LARGEST_FILE = 1_000_000_000  # bytes
EVEN = 1e-6  # of a spacing: nodes this near to even ones are even
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
UNITS = {"": 1.0, "V": 1.0, "kV": 1e3, "mV": 1e-3, "V/m": 1.0, "kV/m": 1e3, "V/cm": 1e2, "kV/cm": 1e5, "V/mm": 1e3}
POTENTIAL = ("v", "potential", "phi", "electric_potential")
FIELD = {"ex": 0, "ey": 1, "ez": 2}


@dataclass(frozen=True)
class GridData:
    """What a file holds, on even nodes.

    Attributes
    ----------
    origin, spacing : (3,) floats
        The first node and the distance of nodes [m].
    values : (nx, ny, nz) array
        Potential [V].
    curl_residual : float
        What no potential explains of a field, over it; 0 where the file gave the potential.
    source : str
        Name of the file.
    """

    origin: tuple[float, float, float]
    spacing: tuple[float, float, float]
    values: Array
    curl_residual: float
    source: str


@dataclass(frozen=True)
class Raw:
    """Axes in m, and by lower-case name arrays (nx, ny, nz) in SI units."""

    axes: tuple[Array, Array, Array]
    arrays: Mapping[str, Array]


def read_grid(path: str | os.PathLike[str]) -> GridData:
    """The potential in a file.

    Parameters
    ----------
    path : str or path
        - ``.h5``, ``.hdf5``: data sets ``x``, ``y`` (and ``z``) with the nodes [m] or ``origin`` and ``spacing`` [m],
          and ``V`` (nx, ny[, nz]) [V] or ``Ex``, ``Ey`` (and ``Ez``) [V/m]; at the root or in a group ``field``.
        - ``.vti``, ``.vtr``, legacy ``.vtk``: point data on image data or a rectilinear grid, named likewise.
        - ``.csv``, ``.txt``: as COMSOL exports it, header lines with %, the last of which names the columns: x, y (and
          z), and V or Ex, Ey (and Ez), units in brackets; the points make a rectilinear grid in any order.

    Notes
    -----
    Nodes that are not even are interpolated to even ones by cubic splines. From a field without a potential the
    potential is that whose differences come nearest to its line integrals along the edges of the grid, by least
    squares (a Poisson equation, solved by cosine transform); its constant makes the first node 0.
    """
    file = Path(path)
    kind = file.suffix.lower()
    if kind not in READERS:
        raise InputError(f"is {show(file.name)}, must end in {', '.join(READERS)}", path="file", value=file.name)
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise InputError(f"is larger than {LARGEST_FILE // 1_000_000} MB")
        return _finished(READERS[kind](file), file.name)
    except InputError as error:
        raise InputError(f"{show(file.name)} {error}", path="file", value=file.name) from None
    except (OSError, ValueError, KeyError, RuntimeError, MemoryError) as error:
        reason = getattr(error, "strerror", None) or str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{show(file.name)} cannot be read: {reason}", path="file", value=file.name) from None


# ---- from what was read to a potential on even nodes ---------------------------------------------------------------


def _finished(raw: Raw, source: str) -> GridData:
    for name, axis in zip("xyz", raw.axes, strict=True):
        if not np.isfinite(axis).all() or not (np.diff(axis) > 0.0).all():
            raise InputError(f"has nodes along {name} that do not ascend")
        if len(axis) < LEAST_NODES and not (name == "z" and len(axis) == 1):
            raise InputError(f"has {len(axis)} nodes along {name}, must have {LEAST_NODES} at least")
    potential = next((raw.arrays[name] for name in POTENTIAL if name in raw.arrays), None)
    parts = [raw.arrays[name] for name in FIELD if name in raw.arrays]
    if potential is None and len(parts) < (2 if len(raw.axes[2]) == 1 else 3):
        found = ", ".join(raw.arrays) or "nothing"
        raise InputError(f"has {found}, must have V, or Ex, Ey (and Ez on a grid in three dimensions)")
    given = [potential] if potential is not None else parts
    shape = tuple(map(len, raw.axes))
    for array in given:
        if array.shape != shape:
            raise InputError(f"has values of shape {array.shape} on nodes of shape {shape}")
        if wrong := int((~np.isfinite(array)).sum()):
            raise InputError(f"has {wrong} nodes without a finite number: fill in the conductors' potentials, too")
    axes, given = _even(raw.axes, given)
    origin = tuple(float(axis[0]) for axis in axes)
    spacing = tuple(float((axis[-1] - axis[0]) / (len(axis) - 1)) if len(axis) > 1 else 1.0 for axis in axes)
    values, residual = (given[0], 0.0) if potential is not None else reconstruct(given, spacing)
    return GridData(origin, spacing, values, residual, source)  # type: ignore[arg-type]


def _even(axes: tuple[Array, Array, Array], arrays: list[Array]) -> tuple[list[Array], list[Array]]:
    """The same on even nodes, as close as the closest of the given ones as far as memory goes."""
    from scipy.interpolate import make_interp_spline

    made = []
    for k, axis in enumerate(axes):
        even = np.linspace(axis[0], axis[-1], len(axis))
        if len(axis) == 1 or np.abs(axis - even).max() <= EVEN * (axis[-1] - axis[0]) / (len(axis) - 1):
            made.append(even)
            continue
        wanted = int(np.ceil((axis[-1] - axis[0]) / np.diff(axis).min() - EVEN)) + 1
        others = arrays[0].size // len(axis)
        even = np.linspace(axis[0], axis[-1], max(len(axis), min(wanted, 4 * len(axis), MOST_NODES // others)))
        arrays = [make_interp_spline(axis, array, k=3, axis=k)(even) for array in arrays]
        made.append(even)
    return made, arrays


def reconstruct(field: list[Array], spacing: tuple[float, ...]) -> tuple[Array, float]:
    """The potential (nx, ny, nz) V that comes nearest to a field, and what is left of the field, relative.

    Minimises the sum over the edges of the grid of [(V_j - V_i + integral of E along the edge)/h]^2. The normal
    equations are Poisson's on the grid with the field's own flux at the border, which the cosine transform makes
    diagonal (W. H. Press et al., Numerical Recipes, 3rd ed., Cambridge 2007, 20.4).
    """
    from scipy.fft import dctn, idctn
    from scipy.interpolate import make_interp_spline

    shape = field[0].shape
    axes = [k for k in range(len(field)) if shape[k] > 1]
    source, symbol = np.zeros(shape), np.zeros(shape)
    edges = {}
    for k in axes:
        h = spacing[k]
        integral = make_interp_spline(h * np.arange(shape[k]), field[k], k=3, axis=k).antiderivative()
        edges[k] = -np.diff(integral(h * np.arange(shape[k])), axis=k)  # V_j - V_i as the field has it
        pad = [(0, 0)] * 3
        pad[k] = (1, 1)
        source += np.diff(np.pad(edges[k], pad), axis=k) / h**2
        wave = (2.0 * np.cos(np.pi * np.arange(shape[k]) / shape[k]) - 2.0) / h**2
        symbol = symbol + wave.reshape([-1 if i == k else 1 for i in range(3)])
    transformed = dctn(source, axes=axes)
    symbol[0, 0, 0] = 1.0
    transformed[0, 0, 0] = 0.0
    values = np.asarray(idctn(transformed / symbol, axes=axes))
    left = sum(np.square((np.diff(values, axis=k) - edges[k]) / spacing[k]).sum() for k in axes)
    whole = sum(np.square(edges[k] / spacing[k]).sum() for k in axes)
    return values - values.flat[0], float(np.sqrt(left / whole)) if whole > 0.0 else 0.0


# ---- HDF5 ----------------------------------------------------------------------------------------------------------


def _read_hdf5(path: Path) -> Raw:
    import h5py

    with h5py.File(path, "r") as file:
        holder = file["field"] if "field" in file and isinstance(file["field"], h5py.Group) else file
        known = {"x", "y", "z", "origin", "spacing", "values", *POTENTIAL, *FIELD}
        sets = {name.lower(): _dataset(holder, name) for name in holder if name.lower() in known}
        if "values" in sets:
            sets["v"] = sets.pop("values")
        main = next((sets[name] for name in (*POTENTIAL, *FIELD) if name in sets), None)
        if main is None:
            raise InputError(f"has {', '.join(map(show, list(holder)[:10])) or 'nothing'}, must have V, or Ex and Ey")
        arrays = {name: _solid(array) for name, array in sets.items() if name in POTENTIAL or name in FIELD}
        shape = next(iter(arrays.values())).shape
        if "x" in sets and "y" in sets:
            z = sets.get("z", np.zeros(1))
            return Raw((sets["x"].ravel(), sets["y"].ravel(), z.ravel()), arrays)
        if "origin" not in sets or "spacing" not in sets:
            raise InputError("must have x and y, or origin and spacing")
        return Raw(_image_axes(sets["origin"].ravel(), sets["spacing"].ravel(), shape), arrays)


def _dataset(holder: h5py.Group, name: str) -> Array:
    import h5py

    if not isinstance(holder.get(name, getlink=True), h5py.HardLink) or not isinstance(holder[name], h5py.Dataset):
        raise InputError(f"has a {show(name)} that is no data set of its own")
    data = holder[name]
    if data.external or data.is_virtual:
        raise InputError(f"has a {show(name)} that lies in another file")
    if data.dtype.kind not in "iuf":
        raise InputError(f"has a {show(name)} of {data.dtype}, must be numbers")
    if data.size > MOST_NODES:
        raise InputError(f"has {number(float(data.size))} numbers in {show(name)}, at most {MOST_NODES} may be")
    return np.asarray(data[()], dtype=np.float64)


def _solid(array: Array) -> Array:
    """With three axes."""
    if array.ndim not in (2, 3):
        raise InputError(f"has values of {array.ndim} axes, must be two or three")
    return array[:, :, None] if array.ndim == 2 else array


def _image_axes(origin: Array, spacing: Array, shape: tuple[int, ...]) -> tuple[Array, Array, Array]:
    low, step = [*origin, 0.0, 0.0, 0.0][:3], [*spacing, 1.0, 1.0, 1.0][:3]
    x, y, z = (low[k] + step[k] * np.arange(shape[k]) for k in range(3))
    return x, y, z


# ---- VTK -----------------------------------------------------------------------------------------------------------


def _from_vtk(read: Any) -> Any:
    def reader(path: Path) -> Raw:
        axes, arrays = read(path.read_bytes())
        solid: dict[str, Array] = {}
        for name, array in arrays.items():
            low = name.lower()
            if array.shape[-1] == 3 and low in ("e", "field", "electric_field"):
                solid |= {part: array[..., i] for part, i in FIELD.items()}
            elif array.shape[-1] == 1:
                solid[low] = array[..., 0]
        # VTK counts x fastest.
        return Raw(axes, {name: np.ascontiguousarray(array.transpose(2, 1, 0)) for name, array in solid.items()})

    return reader


# ---- CSV -----------------------------------------------------------------------------------------------------------

COLUMN = re.compile(r"\s*(?:[A-Za-z]\w*\.)?([A-Za-z]\w*)\s*(?:\(([^)]*)\))?.*")
HEADER_SPLIT = re.compile(r"\s{2,}|\t|(?<=\))\s+|(?<=^[xyz])\s+|(?<=\s[xyz])\s+")


def _read_csv(path: Path) -> Raw:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is not text") from None
    names, length, begin = _header(text)
    body = text[begin:]
    if not body.strip():
        raise InputError("has no rows of numbers")
    delimiter = "," if "," in body[:2000] else ";" if ";" in body[:2000] else None
    try:
        table = np.loadtxt(io.StringIO(body), delimiter=delimiter, comments="%", ndmin=2)
    except ValueError as error:
        raise InputError(f"has a line that is no row of numbers: {str(error)[:80]}") from None
    if table.shape[1] != len(names):
        raise InputError(f"names {len(names)} columns and has {table.shape[1]}")
    columns: dict[str, Array] = {}
    for k, (name, unit) in enumerate(names):
        known = LENGTHS if name in ("x", "y", "z") else UNITS
        scale = length if known is LENGTHS and not unit else known.get(unit)
        if scale is None:
            raise InputError(f"has {name} in {show(unit)}, must be in {', '.join(filter(None, known))}")
        columns.setdefault(name, table[:, k] * scale)
    return _rectilinear(columns)


def _header(text: str) -> tuple[list[tuple[str, str]], float, int]:
    """Names and units of the columns, the unit of length in m, and where the numbers begin."""
    length, last, begin = 1.0, "", 0
    for line in io.StringIO(text):
        bare = line.strip()
        if bare.startswith("%"):
            last = bare.lstrip("% ")
            if match := re.match(r"length unit\s*[:,]?\s*\"?(\w+)", last, re.IGNORECASE):
                if match[1] not in LENGTHS:
                    raise InputError(f"has lengths in {show(match[1])}, must be in {', '.join(LENGTHS)}")
                length = LENGTHS[match[1]]
        elif (bare and bare[0] in "+-.0123456789") or bare.lower().startswith("nan"):
            break
        elif bare:
            last = bare
        begin += len(line)
    separator = "," if "," in last else ";" if ";" in last else None
    parts = next(csv.reader([last], delimiter=separator)) if separator else HEADER_SPLIT.split(last)
    names = []
    for part in parts:
        match = COLUMN.fullmatch(part.strip())
        names.append((match[1].lower(), (match[2] or "").strip()) if match else (part.strip().lower(), ""))
    if [name for name, _ in names[:2]] != ["x", "y"]:
        raise InputError("has no line that names its columns, x, y (and z) first, then V or Ex, Ey (and Ez)")
    return names, length, begin


def _rectilinear(columns: Mapping[str, Array]) -> Raw:
    places = [columns.get(name, np.zeros(len(columns["x"]))) for name in "xyz"]
    if not all(np.isfinite(place).all() for place in places):
        raise InputError("has a point without finite coordinates")
    axes, index = [], []
    for place in places:
        near = 1e-9 * max(float(np.abs(place).max(initial=0.0)), 1e-9)
        ordered = np.unique(place)
        axis = ordered[np.concatenate([[True], np.diff(ordered) > near])]
        axes.append(axis)
        index.append(np.clip(np.searchsorted(axis, place + near) - 1, 0, None))
    shape = (len(axes[0]), len(axes[1]), len(axes[2]))
    flat = np.ravel_multi_index((index[0], index[1], index[2]), shape) if np.prod(shape, dtype=float) < 1e12 else None
    rows = len(places[0])
    if flat is None or np.prod(shape) != rows or len(np.unique(flat)) != rows:
        raise InputError(f"has {rows} points, which are no grid of {shape[0]} x {shape[1]} x {shape[2]} nodes")
    arrays = {}
    for name, column in columns.items():
        if name not in ("x", "y", "z"):
            arrays[name] = np.empty(shape)
            arrays[name].flat[flat] = column
    return Raw((axes[0], axes[1], axes[2]), arrays)


READERS: Mapping[str, Any] = {
    ".h5": _read_hdf5,
    ".hdf5": _read_hdf5,
    ".vti": _from_vtk(read_vti),
    ".vtr": _from_vtk(read_vtr),
    ".vtk": _from_vtk(read_vtk),
    ".csv": _read_csv,
    ".txt": _read_csv,
}
