"""Models of the electric field: one class a model, all called by the same names."""

from __future__ import annotations

import json
import math
import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from ..errors import InputError
from ..fields.stored import StoredArray
from ..units import Doc, Part, Quantity, Whole
from .dielectrics import Dielectric, plain
from .machine import Electrode, Point2, Point3

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

if TYPE_CHECKING:
    from ..fields import ElectricField, FiniteElement, Grid
    from .scene import Scene

Spacing = Annotated[float, Quantity("m", 1e-7, 1000.0, "distance of nodes")]
Share = Annotated[float, Quantity("", 0.0, 1e6, "relative difference")]


class FieldModel(Part, ABC):
    """How the electric field is computed."""

    where: ClassVar[str] = "field"

    def lacks(self, scene: Scene) -> str:
        """What a scene lacks for this model: "the scene has no drum"; "" where it has all."""
        if not all_electrodes(scene):
            return "the scene has no electrode"
        return "" if scene.drum is not None else "the scene has no drum"

    @abstractmethod
    def build(self, scene: Scene) -> ElectricField:
        """The field of a scene that lacks nothing."""

    def record(self, scene: Scene) -> dict[str, Any]:
        """What a result file stores of it beside the scene: arrays, numbers and text by name."""
        return {}


class TwoCylindersField(FieldModel):
    """Drum and one electrode, in closed form."""

    kind: Literal["two_cylinders"] = "two_cylinders"

    def build(self, scene: Scene) -> ElectricField:
        from ..fields import TwoCylinders

        electrodes = all_electrodes(scene)
        if len(electrodes) != 1:
            raise InputError(
                f"is 'two_cylinders', which is for one electrode, and the scene has {len(electrodes)}",
                path="field.kind",
                value=self.kind,
                allowed="'conductors', 'finite_element' or 'grid'",
            )
        assert scene.drum is not None
        electrode = electrodes[0]
        return TwoCylinders(
            drum_radius=scene.drum.radius,
            electrode_radius=electrode.radius,
            distance=electrode.distance,
            angle=electrode.angle,
            voltage=electrode.voltage,
        )


class Enclosure(Part):
    """A grounded box around the conductors, along the axes of the scene."""

    where: ClassVar[str] = "field.enclosure"
    lower: Annotated[Point2, Doc("x and y of its lower corner [m]")]
    upper: Annotated[Point2, Doc("x and y of its upper corner [m]")]

    @model_validator(mode="after")
    def _corners_are_ordered(self) -> Enclosure:
        if not all(low < high for low, high in zip(self.lower, self.upper, strict=True)):
            raise InputError("must be above lower in x and y", path="upper", value=self.upper, unit="m")
        return self


class ConductorsField(FieldModel):
    """The drum and any number of electrodes, exact in the plane, with or without a grounded box around them."""

    kind: Literal["conductors"] = "conductors"
    enclosure: Annotated[Enclosure | None, Doc("a grounded box, or None: the conductors stand alone")] = None

    def build(self, scene: Scene) -> ElectricField:
        assert scene.drum is not None
        rows = ((e.center(), e.radius, e.voltage) for e in all_electrodes(scene))
        box = None if self.enclosure is None else (self.enclosure.lower, self.enclosure.upper)
        try:
            return _conductors((((0.0, 0.0), scene.drum.radius, 0.0), *rows), box)
        except InputError as error:
            raise InputError(f"is 'conductors': {error}", path="field.kind", value=self.kind) from None


class Room(Enclosure):
    """A grounded box of any length around the machine, along the axes of the scene and about the middle of the drum."""

    length: (
        Annotated[float, Quantity("m", 1e-3, 100.0, "length along z, in three dimensions; None: no end walls")] | None
    ) = None


class FiniteElementField(FieldModel):
    """Drum and electrodes of their lengths, dielectric parts, a grounded room: solved by finite elements, once."""

    kind: Literal["finite_element"] = "finite_element"
    dimension: Annotated[Literal[2, 3], Doc("2: the cross-section; 3: with the ends of drum and electrodes")] = 2
    resolution: (
        Annotated[int, Whole(4, 96, "elements along a quarter of each circle; None: 24 in 2-D, 12 in 3-D")] | None
    ) = None
    spacing: (
        Annotated[float, Quantity("m", 1e-6, 1.0, "distance of the nodes of the grid; None: by the machine")] | None
    ) = None
    enclosure: Annotated[Room | None, Doc("a grounded box, or None: free space")] = None
    dielectrics: Annotated[list[Dielectric], Doc("dielectric boxes and cylinders")] = Field(
        default_factory=list, max_length=100
    )
    electrode_length: (
        Annotated[float, Quantity("m", 1e-3, 10.0, "length of the electrodes along z; None: that of the drum")] | None
    ) = None

    def build(self, scene: Scene) -> FiniteElement:
        drum = scene.drum
        assert drum is not None
        length = drum.length if self.electrode_length is None else self.electrode_length
        cylinders = [(0.0, 0.0, drum.radius, 0.0, drum.length)]
        cylinders += [(*e.center(), e.radius, e.voltage, length) for e in all_electrodes(scene)]
        try:
            return _elements(tuple(cylinders), self.model_dump_json(exclude_none=True))
        except InputError as error:
            raise InputError(f"is 'finite_element': {error}", path="field.kind", value=self.kind) from None

    def record(self, scene: Scene) -> dict[str, Any]:
        field = self.build(scene)
        return {
            "origin": field.origin,
            "spacing": field.spacing,
            "values": field.values,
            "interpolation_error": field.interpolation_error,
            "discretisation_error": field.discretisation_error,
            "unknowns": field.unknowns,
            "source": repr(field),
        }


class GridField(FieldModel):
    """A potential on a grid, of a file or of arrays; in x, y, z of the scene. `cesim.fields.Grid` says how it is
    read."""

    kind: Literal["grid"] = "grid"
    source: Annotated[str, Field(max_length=500), Doc("where the values come from")] = ""
    origin: Annotated[Point3, Doc("the first node [m]")]
    spacing: Annotated[tuple[Spacing, Spacing, Spacing], Doc("distance of nodes along x, y, z [m]")]
    values: Annotated[StoredArray, Doc("potential (nx, ny, nz) [V]; nz = 1: the same at every z")]
    interpolation_error: Annotated[Share | None, Doc("of the field, against every second node or the source")] = None
    curl_residual: Annotated[Share, Doc("what no potential explains of the field in the file")] = 0.0

    @classmethod
    def of(cls, grid: Grid) -> GridField:
        """The model that holds a grid."""
        error = grid.interpolation_error
        return cls(
            source=grid.source,
            origin=grid.origin,
            spacing=grid.spacing,
            values=StoredArray(grid.values),
            interpolation_error=error if math.isfinite(error) else None,
            curl_residual=grid.curl_residual,
        )

    def lacks(self, scene: Scene) -> str:
        return ""

    def build(self, scene: Scene) -> Grid:
        return _grid(self.origin, self.spacing, self.values, scene.drum.radius if scene.drum is not None else 0.0)

    def record(self, scene: Scene) -> dict[str, Any]:
        return {
            "origin": self.origin,
            "spacing": self.spacing,
            "values": self.values.values,
            "interpolation_error": math.nan if self.interpolation_error is None else self.interpolation_error,
            "curl_residual": self.curl_residual,
            "source": self.source,
        }


@lru_cache(maxsize=16)
def _conductors(
    cylinders: tuple[tuple[tuple[float, float], float, float], ...],
    box: tuple[tuple[float, float], tuple[float, float]] | None,
) -> ElectricField:
    """Kept, because the decisions about effects ask for it many times."""
    from ..fields import Conductors, Cylinder

    return Conductors([Cylinder(*row) for row in cylinders], box)


@lru_cache(maxsize=8)
def _elements(cylinders: tuple[tuple[float, ...], ...], settings: str) -> FiniteElement:
    """Kept, as `_grid` is; the settings are those of a model, as JSON."""
    from ..fields import FiniteElement

    model = FiniteElementField(**json.loads(settings))
    names = ("radius", "voltage", "length")
    room = model.enclosure
    return FiniteElement(
        [{"center": (x, y), **dict(zip(names, rest, strict=True))} for x, y, *rest in cylinders],
        None if room is None else (room.lower, room.upper),
        [plain(part) for part in model.dielectrics],
        dimension=model.dimension,
        resolution=model.resolution,
        spacing=model.spacing,
        enclosure_length=None if room is None else room.length,
    )


@lru_cache(maxsize=8)
def _grid(origin: tuple[float, ...], spacing: tuple[float, ...], values: StoredArray, drum_radius: float) -> Grid:
    """Kept, because the decisions about effects ask for it many times."""
    from ..fields import Grid

    return Grid(origin, spacing, values.values, drum_radius=drum_radius, interpolation_error=0.0)


def read_field(given: Any) -> Any:
    """A model's name stands for the model, a file for the grid in it, and a `cesim.fields.Grid` for itself."""
    if isinstance(given, str):
        return {"kind": given}
    if isinstance(given, FieldModel):
        return given
    if isinstance(given, Mapping):
        given = {"kind": "two_cylinders", **given}
        return read_grid_file(given["file"], given) if given["kind"] == "grid" and "file" in given else given
    from ..fields import Grid

    return GridField.of(given) if isinstance(given, Grid) else given


def read_model(text: str) -> Any:
    """A model as the command line names it: by its kind, by a file with a grid, or by a table in TOML."""
    if text.lstrip().startswith("{"):
        try:
            return tomllib.loads(f"field = {text}")["field"]
        except tomllib.TOMLDecodeError as error:
            raise InputError(f"is not a table: {error}", value=text) from None
    return {"kind": "grid", "file": text} if os.path.isfile(text) else text


def read_grid_file(path: str | os.PathLike[str], given: Mapping[str, Any]) -> GridField:
    """The grid of a file that a scene names."""
    from ..fields import Grid

    if others := sorted(set(given) - {"kind", "file"}):
        raise InputError(f"stands beside {', '.join(others)}: give one or the other", path="file")
    return GridField.of(Grid.read(path))


AnyField = Annotated[
    Annotated[TwoCylindersField | ConductorsField | FiniteElementField | GridField, Field(discriminator="kind")],
    BeforeValidator(read_field),
    Doc("model of the electric field: 'two_cylinders', 'conductors', 'finite_element', or a table with its kind"),
]


# ---- electrodes ----------------------------------------------------------------------------------------------------


def all_electrodes(scene: Scene) -> list[Electrode]:
    """`scene.electrode`, where there is one, and `scene.electrodes`."""
    return [*([scene.electrode] if scene.electrode is not None else []), *scene.electrodes]


def electrode_paths(scene: Scene) -> list[tuple[str, Electrode]]:
    """The same with their places in the tree."""
    first = [("electrode", scene.electrode)] if scene.electrode is not None else []
    return [*first, *((f"electrodes[{i}]", electrode) for i, electrode in enumerate(scene.electrodes))]


def drawn_electrodes(scene: Scene) -> list[dict[str, Any]]:
    """What a picture shows of the electrodes: kind, center [m], radius [m], voltage [V]."""
    return [
        {"kind": e.kind, "center": e.center(), "radius": e.radius, "voltage": e.voltage} for e in all_electrodes(scene)
    ]


def ion_source(scene: Scene) -> Electrode | None:
    """The electrode whose ions charge insulators: of the corona wires, else of all, the first of highest voltage."""
    electrodes = all_electrodes(scene)
    wires = [electrode for electrode in electrodes if electrode.kind == "corona"]
    return max(wires or electrodes, key=lambda electrode: abs(electrode.voltage), default=None)


def most_voltage(scene: Scene) -> float:
    """Voltage of the ion source, V; of a scene with a grid alone, its potential farthest from 0."""
    source = ion_source(scene)
    voltages = [source.voltage if source is not None else 0.0, *(e.voltage for e in all_electrodes(scene))]
    if isinstance(scene.field, GridField):
        voltages += [max(scene.field.values.extremes, key=abs)]
    return next((voltage for voltage in voltages if voltage != 0.0), 0.0)


def field_definition(scene: Scene) -> dict[str, Any] | None:
    """What the engine takes; None without a field."""
    if scene.field.lacks(scene):
        return None
    field, source = scene.electric_field(), ion_source(scene)
    if source is not None:
        angle = source.angle
    else:
        angle = field.largest_on_circle(scene.drum.radius)[1] if scene.drum is not None else 0.0
    return field.definition | {"angle": angle, "voltage": most_voltage(scene)}


def largest_field(scene: Scene) -> float:
    """Largest field in V/m on the drum, or anywhere where there is no drum."""
    if scene.field.lacks(scene):
        return 0.0
    field = scene.electric_field()
    return field.largest_on_circle(scene.drum.radius)[0] if scene.drum is not None else field.largest()
