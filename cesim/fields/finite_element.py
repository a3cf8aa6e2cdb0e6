"""The field of finite elements: ends, dielectric parts, a grounded room."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..constants import VACUUM_PERMITTIVITY
from ..errors import InputError
from ..fem import Box, Conductor, Cylinder, Machine, Slab
from ..fem.cache import cache_folder, key_of, load, store
from ..fem.grids import LEAST_RESOLUTION, Nodes, UnitGrids, unit_grids
from .base import Array, ElectricField, read_points, read_quantities, relative
from .grid import Grid

RESOLUTION = {2: 24, 3: 12}  # elements along a quarter of a circle, unless said
FINEST = 96
NODES_PER_REACH = {2: 150.0, 3: 80.0}  # nodes of the grid to the distance of the farthest part, unless said
FREE_SPACE = 2.0  # half the width of the grid around conductors in free space, in reaches
BEYOND_ENDS = 0.35  # of the reach: how far the grid goes on past the ends of the longest conductor


class FiniteElement(ElectricField):
    """Field of cylinders and wires of any length with dielectric parts, in free space or a grounded room.

    Solved once by finite elements, kept on disk under a hash of geometry, mesh and grid, sampled to a potential grid,
    and interpolated from there by the engine as `Grid` is. Voltages only weigh the solutions kept: a sweep solves
    nothing.

    Parameters
    ----------
    cylinders : sequence of cylinders or of mappings
        Conductors along z, each with `center` (x, y) [m], `radius` [m], `voltage` [V], and in three dimensions `length`
        [m], which without one is endless. The first is the drum where it is at 0 V about the origin.
    enclosure : ((x, y), (x, y)), optional
        Lower and upper corner of a grounded box [m]. Without one space is free: in two dimensions the total charge is
        then zero, in three the potential far away is.
    enclosure_length : quantity, optional
        Length of that box along z [m]; None: its end walls are mirrors, twice as far off as the conductors' ends.
    dielectrics : sequence of mappings
        Parts of a relative `permittivity`: boxes with `center`, `width`, `height`, `tilt`; cylinders with `center`,
        `radius`; both with an optional `length`. A box may stick out of the enclosure; a cylinder may hold a conductor.
    dimension : 2 or 3
    resolution : int, optional
        Elements along a quarter of each circle; 24 in two dimensions, 12 in three.
    spacing : quantity, optional
        Distance of the nodes of the grid [m]; twice that along z.
    lower, upper : (x, y) or (x, y, z), optional
        Corners of the grid [m].
    cache : bool or path
        Whether, or in which folder, solutions are kept; True: $CESIM_CACHE or the platform's folder for caches.
    progress : bool, optional
        Whether to show a bar while solving; None: on a terminal.

    Attributes
    ----------
    machine : cesim.fem.Machine
    values, origin, spacing : the grid: potential (nx, ny, nz) [V], first node [m], distance of nodes [m]
    discretisation_error : float
        Root mean square difference between the field of these elements and that of elements twice as large, over that
        of the field, at points all over the grid; the error of these elements is about a third of it.
    interpolation_error : float
        The same between the spline that the run reads and the elements.
    unknowns : int
        Size of the linear system.

    Notes
    -----
    Quadratic elements that follow the circles (docs/physics.md 1.5). Under the surface of a conductor the nodes
    continue the potential outside, so the spline has no kink there; near a wire thinner than the spacing, near the
    drum's edge and near the surface of a dielectric it is rounded off over a spacing or two.
    """

    def __init__(
        self,
        cylinders: Iterable[Any],
        enclosure: Sequence[Sequence[float | str]] | None = None,
        dielectrics: Iterable[Mapping[str, Any]] = (),
        *,
        dimension: int = 2,
        resolution: int | None = None,
        spacing: float | str | None = None,
        lower: Sequence[float] | None = None,
        upper: Sequence[float] | None = None,
        enclosure_length: float | str | None = None,
        cache: bool | str | Path = True,
        progress: bool | None = None,
    ) -> None:
        if dimension not in (2, 3):
            raise InputError(f"is {dimension!r}, must be 2 or 3", path="dimension", value=dimension, allowed="2 or 3")
        resolution = RESOLUTION[dimension] if resolution is None else resolution
        if not LEAST_RESOLUTION <= resolution <= FINEST:
            raise InputError(f"is {resolution}, outside [{LEAST_RESOLUTION}, {FINEST}]", path="resolution")
        read = [_read_cylinder(i, given) for i, given in enumerate(cylinders)]
        self.voltages = np.array([voltage for _, voltage in read])
        self.machine = Machine(
            tuple(conductor for conductor, _ in read),
            tuple(_read_dielectric(k, given) for k, given in enumerate(dielectrics)),
            _read_room(enclosure, enclosure_length),
        )
        self.machine.check()
        self.dimension, self.resolution = dimension, resolution
        self._nodes = _nodes(self.machine, dimension, spacing, lower, upper)
        folder = None if cache is False else cache_folder() if cache is True else Path(cache)
        self._units = _solved(self.machine, dimension, resolution, self._nodes, folder, progress)
        self._weigh()

    def _weigh(self) -> None:
        units, machine = self._units, self.machine
        live = np.array([u for u, c in zip(self.voltages, machine.conductors, strict=True) if c.live])
        self.values: Array = np.einsum("u,uxyz->xyz", live, units.values)
        self.values.flags.writeable = False
        self.origin, self.spacing, self.unknowns = units.nodes.origin, units.nodes.spacing, units.unknowns
        drum = machine.conductors[0]
        super().__init__(
            {
                "kind": "grid",
                "origin": self.origin,
                "spacing": self.spacing,
                "values": self.values,
                "drum_radius": drum.radius if not drum.live else 0.0,
                "drum_center": (drum.x, drum.y) if not drum.live else (0.0, 0.0),
            }
        )
        elements = np.einsum("u,upk->pk", live, units.field)
        self.discretisation_error = relative(elements - np.einsum("u,upk->pk", live, units.coarse_field), elements)
        self.interpolation_error = relative(self(units.points) - elements, elements)

    def with_voltages(self, voltages: Sequence[float]) -> FiniteElement:
        """The same machine at other voltages [V]; nothing is solved. A drum at 0 V stays there."""
        given = np.asarray(voltages, np.float64)
        if given.shape != self.voltages.shape:
            raise InputError(f"are {given.size}, must be {len(self.voltages)}", path="voltages", unit="V")
        dead = [not conductor.live for conductor in self.machine.conductors]
        if given[dead].any():
            raise InputError("of the drum must be 0", path="voltages[0]", unit="V")
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.voltages = given
        other._weigh()
        return other

    def grid(self) -> Grid:
        """The potential as a `Grid`, whose numbers a scene can hold: `scene.field = field.grid()`."""
        return Grid(
            self.origin,
            self.spacing,
            self.values,
            interpolation_error=self.interpolation_error,
            source=repr(self),
        )

    def capacitances(self) -> Array:
        """Charges of the conductors, but for a drum at 0 V, at 1 V on each: F/m in two dimensions, F in three."""
        return VACUUM_PERMITTIVITY * self._units.capacitance

    def inside_conductors(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which points (n, 3) in m lie inside a conductor: (n,) bool."""
        place = read_points(points)
        inside = np.zeros(len(place), bool)
        for conductor in self.machine.conductors:
            long = self.dimension == 2 or np.abs(place[:, 2]) <= 0.5 * conductor.length
            inside |= (conductor.curve.signed(place[:, :2]) < 0.0) & long
        return inside

    def largest(self) -> float:
        """Largest field strength on the conductors, half-way along them [V/m]."""
        return max(self.largest_on_circle(c.radius, (c.x, c.y))[0] for c in self.machine.conductors)

    def __repr__(self) -> str:
        nodes = " x ".join(str(n) for n in self.values.shape if n > 1)
        return f"<cesim.fields.FiniteElement: {self.dimension}-D, {self.unknowns} unknowns, {nodes} nodes>"


@lru_cache(maxsize=4)
def _solved(
    machine: Machine, dimension: int, resolution: int, nodes: Nodes, folder: Path | None, progress: bool | None
) -> UnitGrids:
    key = key_of(machine, dimension, resolution, nodes)
    known = load(key, nodes, folder) if folder is not None else None
    if known is not None:
        return known
    missing = [name for module, name in (("skfem", "scikit-fem"), ("pyamg", "pyamg")) if find_spec(module) is None]
    if missing:
        raise InputError(f"needs {' and '.join(missing)}: pip install 'cesim[fem]'", path="field.kind")
    from tqdm import tqdm

    with tqdm(desc="finite elements", unit="", disable=None if progress is None else not progress) as bar:

        def tick(stage: str) -> None:
            bar.set_postfix_str(stage, refresh=False)
            bar.update()

        grids = unit_grids(machine, dimension, resolution, nodes, tick)
    if folder is not None:
        store(key, grids, folder)
    return grids


def _nodes(
    machine: Machine,
    dimension: int,
    spacing: float | str | None,
    lower: Sequence[float] | None,
    upper: Sequence[float] | None,
) -> Nodes:
    """The grid: over the room, or around the parts; along z past the ends."""
    reach, room = max(conductor.curve.reach for conductor in machine.conductors), machine.enclosure
    h = reach / NODES_PER_REACH[dimension]
    if spacing is not None:
        h = read_quantities({"spacing": (spacing, "m", 1e-6, 10.0)})["spacing"]
    longest = max((c.length for c in machine.conductors if math.isfinite(c.length)), default=2.0 * reach)
    end = 0.5 * longest + BEYOND_ENDS * reach
    if room is not None:
        end = min(end, 0.5 * room.length)
        low, high = [room.left, room.bottom, -end], [room.right, room.top, end]
    else:
        wide = FREE_SPACE * reach
        low, high = [-wide, -wide, -end], [wide, wide, end]
    for given, corner, name in ((lower, low, "lower"), (upper, high, "upper")):
        if given is not None:
            rule = ("m", -100.0, 100.0)
            found = read_quantities({f"{name}[{k}]": (value, *rule) for k, value in enumerate(given)})
            corner[: len(found)] = found.values()
    if not all(a < b for a, b in zip(low, high, strict=True)):
        raise InputError("must be above lower", path="upper", value=upper, unit="m")
    return Nodes.over(tuple(low), tuple(high), h, 2.0 * h if dimension == 3 else None)


# ---- what is given ---------------------------------------------------------------------------------------------------


def _read_cylinder(i: int, given: Any) -> tuple[Conductor, float]:
    names = ("center", "radius", "voltage", "length")
    if not isinstance(given, Mapping):
        given = {name: getattr(given, name) for name in names if hasattr(given, name)}
    numbers = _read(f"cylinders[{i}]", given, required=("radius",), optional=("voltage", "length"))
    voltage = numbers.get("voltage", 0.0)
    x, y = numbers["center[0]"], numbers["center[1]"]
    drum = i == 0 and x == 0.0 and y == 0.0 and voltage == 0.0
    length = numbers.get("length", math.inf)
    return Conductor(x, y, numbers["radius"], length, "drum" if drum else f"cylinders[{i}]", not drum), voltage


def _read_dielectric(k: int, given: Mapping[str, Any]) -> Cylinder | Slab:
    where = f"dielectrics[{k}]"
    if isinstance(given, Cylinder | Slab):
        return given
    if "radius" in given:
        n = _read(where, given, required=("radius", "permittivity"), optional=("length",))
        return Cylinder(
            n["center[0]"], n["center[1]"], n["radius"], n["permittivity"], length=n.get("length", math.inf)
        )
    n = _read(where, given, required=("width", "height", "permittivity"), optional=("tilt", "length"))
    return Slab(
        n["center[0]"],
        n["center[1]"],
        n["width"],
        n["height"],
        n["permittivity"],
        tilt=n.get("tilt", 0.0),
        length=n.get("length", math.inf),
    )


RANGES = {
    "radius": ("m", 1e-6, 100.0),
    "voltage": ("V", -1e7, 1e7),
    "length": ("m", 1e-4, 100.0),
    "permittivity": ("", 1.0, 1e5),
    "width": ("m", 1e-5, 200.0),
    "height": ("m", 1e-5, 200.0),
    "tilt": ("rad", -2.0 * math.pi, 2.0 * math.pi),
}


def _read(where: str, given: Any, required: Sequence[str], optional: Sequence[str]) -> dict[str, float]:
    """The numbers of a part, and its center."""
    names = ("center", *required, *optional)
    wanted = f"must have {', '.join(('center', *required))}; may have {', '.join(optional)}"
    if not isinstance(given, Mapping) or set(given) - set(names) or {"center", *required} - set(given):
        raise InputError(wanted, path=where)
    center = given["center"]
    if isinstance(center, str) or not hasattr(center, "__len__") or len(center) != 2:
        raise InputError("must be (x, y)", path=f"{where}.center", unit="m")
    rules = {f"center[{i}]": (value, "m", -100.0, 100.0) for i, value in enumerate(center)}
    for name, value in given.items():
        if name != "center" and value is not None and not (name == "length" and value == math.inf):
            rules[name] = (value, *RANGES[name])
    try:
        return read_quantities(rules)
    except InputError as error:
        raise error.at(where) from None


def _read_room(enclosure: Sequence[Sequence[float | str]] | None, length: float | str | None) -> Box | None:
    if enclosure is None:
        return None
    try:
        (left, bottom), (right, top) = enclosure
    except (TypeError, ValueError):
        raise InputError("must be ((x, y), (x, y)), lower and upper corner", path="enclosure", unit="m") from None
    rule = ("m", -100.0, 100.0)
    given = {"left": (left, *rule), "right": (right, *rule), "bottom": (bottom, *rule), "top": (top, *rule)}
    try:
        numbers = read_quantities(given)
    except InputError as error:
        raise error.at("enclosure") from None
    end = math.inf
    if length is not None:
        end = read_quantities({"enclosure_length": (length, "m", 1e-3, 100.0)})["enclosure_length"]
    return Box(numbers["left"], numbers["right"], numbers["bottom"], numbers["top"], end)
