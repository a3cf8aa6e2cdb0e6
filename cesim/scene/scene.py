"""The scene: the whole tree, and its text form."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeGuard

from pydantic import BeforeValidator, Field, model_validator

from ..errors import InputError, join_path, show
from ..fields.stored import StoredArray
from ..materials import Material, with_library
from ..units import Doc, Part, Quantity, Whole
from .choices import Choosable
from .effects import EffectSetting, SceneEffects, check_settings
from .feed import Feed, Rate, Table
from .field import AnyField, TwoCylindersField, all_electrodes, read_grid_file
from .joints import Joint, RigidPart
from .machine import Air, Brush, Coordinate, Corona, Drum, Electrode, Plate, Point3, Splitter, Wall
from .mesh import Mesh, read_mesh
from .shapes import AnyShape, ClosedMesh

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

if TYPE_CHECKING:
    from ..corona import IonisedField
    from ..fields import ElectricField
    from .check import Warnings

VERSION = 1  # of the text form
LARGEST_FILE = 10_000_000  # bytes
NUMBERS = re.compile(r"= \[\n((?: +[-+0-9.e]+,\n){1,4})\]")  # short arrays, which read better on one line
ROWS = re.compile(r"(?<=^ {4})\[\n((?: +[-+0-9.e]+,\n){3,4}) +\]", re.MULTILINE)  # of a table in an array
OMITTED = (
    "charges",
    "contents",
    "effects",
    "electrodes",
    "pairs",
    "parameters",
    "shapes",
)  # need not be written when they are empty


class Bins(Part):
    """The boxes under the machine that the landing histogram counts."""

    where: ClassVar[str] = "bins"
    n: Annotated[int, Whole(1, 100_000, "number of bins")] = 200
    x: Annotated[tuple[Coordinate, Coordinate], Doc("(from, to), counted from the datum [m]")] = (-0.4, 0.6)

    @model_validator(mode="after")
    def _range_is_ordered(self) -> Bins:
        if not self.x[0] < self.x[1]:
            raise InputError("must begin below its end", path="x", value=self.x, unit="m")
        return self


class Collect(Part):
    """Where grains are counted: a horizontal landing plane."""

    where: ClassVar[str] = "collect"
    y: Annotated[float, Quantity("m", -10.0, 10.0, "height of the landing plane")] = -0.10
    splitters: Annotated[
        tuple[Coordinate, Coordinate] | None, Doc("x of the two virtual splitters, counted from the datum [m]")
    ] = None
    bins: Annotated[Bins, Doc("bins of the landing histogram")] = Field(default_factory=Bins)
    datum: Annotated[float, Quantity("m", -10.0, 10.0, "x that splitters and bins count from")] = 0.0

    @model_validator(mode="after")
    def _splitters_are_ordered(self) -> Collect:
        if self.splitters is not None and self.splitters[0] > self.splitters[1]:
            raise InputError("must ascend", path="splitters", value=self.splitters, unit="m")
        return self


class Bounds(Part):
    """The box outside which a grain counts as lost."""

    where: ClassVar[str] = "bounds"
    lower: Annotated[Point3, Doc("lower corner [m]")] = (-1.0, -0.5, -0.2)
    upper: Annotated[Point3, Doc("upper corner [m]")] = (1.5, 1.0, 0.2)

    @model_validator(mode="after")
    def _corners_are_ordered(self) -> Bounds:
        if not all(low < high for low, high in zip(self.lower, self.upper, strict=True)):
            raise InputError("must be above lower in x, y and z", path="upper", value=self.upper, unit="m")
        return self


class Numerics(Part):
    """How the equations are solved."""

    where: ClassVar[str] = "numerics"
    step: Annotated[float, Quantity("s", 1e-9, 1.0, "time step")] = 1e-3
    contact_law: Annotated[
        Literal["coulomb", "ccp"], Doc("'coulomb', or 'ccp': the convex relaxation of the founding papers")
    ] = "coulomb"
    solver: Annotated[
        Literal["auto", "pgs", "apgs", "apgd", "spg", "jacobi", "direct"],
        Doc("a row of the table of solvers (cesim.engine.contact_solvers()); 'auto' chooses island by island"),
    ] = "auto"
    tolerance: (
        Annotated[float, Quantity("m/s", 1e-15, 1.0, "residual that counts as solved; None: 1e-3 max(g h, 0.01 v)")]
        | None
    ) = None
    max_iterations: Annotated[int, Whole(1, 1_000_000, "sweeps a step; tenfold over islands of few contacts")] = 1000
    threads: Annotated[int, Whole(1, 1024, "threads; None: one for a thin feed, else all cores")] | None = None
    gyroscopic: Annotated[
        Choosable,
        Doc("'auto', 'on' or 'off': free grains keep their angular momentum, not just their angular velocity"),
    ] = "auto"
    grain_contact: Annotated[
        Choosable,
        Doc("'auto', 'on' or 'off': grains collide; 'auto': unless the feed is so thin that they do not meet"),
    ] = "auto"
    rotation: Annotated[Choosable, Doc("'auto', 'on' or 'off': grains turn; without it they slide as blocks")] = "auto"


Acceleration = Annotated[float, Quantity("m/s2", -1000.0, 1000.0, "gravity")]


class Scene(Part):
    """A machine with its feed, air and settings. A part that is None, or not listed in a file, is not there."""

    name: Annotated[str, Field(max_length=200), Doc("title")] = "scene"
    drum: Annotated[Drum | None, Doc("the grounded drum")] = None
    electrode: Annotated[Electrode | None, Doc("the electrode")] = None
    electrodes: Annotated[list[Electrode], Doc("further electrodes")] = Field(default_factory=list, max_length=50)
    field: AnyField = Field(default_factory=TwoCylindersField)
    corona: Annotated[Corona | None, Doc("the charging arc")] = None
    plates: Annotated[list[Plate], Doc("feeder plates")] = Field(default_factory=list, max_length=100)
    splitters: Annotated[list[Splitter], Doc("splitter blades")] = Field(default_factory=list, max_length=100)
    brush: Annotated[Brush | None, Doc("the brush")] = None
    walls: Annotated[list[Wall], Doc("walls")] = Field(default_factory=list, max_length=100)
    meshes: Annotated[list[Mesh], Doc("sheets of triangles")] = Field(default_factory=list, max_length=100)
    parts: Annotated[list[RigidPart], Doc("further parts that move by forces")] = Field(
        default_factory=list, max_length=100
    )
    joints: Annotated[list[Joint], Doc("joints between parts, or to the ground")] = Field(
        default_factory=list, max_length=100
    )
    feed: Annotated[Feed | None, Doc("the feed")] = None
    materials: Annotated[
        dict[str, Material], BeforeValidator(with_library), Doc("name -> material; those of the library are there")
    ] = Field(default_factory=dict, validate_default=True)
    shapes: Annotated[
        dict[str, AnyShape], Doc("name -> shape of grains that are added by hand; the feed has its own")
    ] = Field(default_factory=dict, max_length=1000)
    collect: Annotated[Collect | None, Doc("landing plane, virtual splitters and bins")] = None
    air: Annotated[Air, Doc("the air")] = Field(default_factory=Air)
    effect_settings: Annotated[
        dict[str, EffectSetting], BeforeValidator(check_settings), Doc("effect -> 'auto', 'on', 'off', or a table")
    ] = Field(default_factory=dict, alias="effects")
    numerics: Annotated[Numerics, Doc("step, contact law, solver")] = Field(default_factory=Numerics)
    bounds: Annotated[Bounds, Doc("the box outside which a grain is lost")] = Field(default_factory=Bounds)
    gravity: Annotated[tuple[Acceleration, Acceleration, Acceleration], Doc("acceleration of gravity [m/s2]")] = (
        0.0,
        -9.81,
        0.0,
    )

    @property
    def effects(self) -> SceneEffects:
        """Effects: `scene.effects()` explains the decisions, `scene.effects["drag"] = "off"` makes one."""
        return SceneEffects(self)

    @effects.setter
    def effects(self, settings: Any) -> None:
        self.effect_settings = settings

    def validated(self) -> Scene:
        """The same scene read anew, so that what was appended to a list or put into a dict is checked, too."""
        scene: Scene = Scene.model_validate(self.tree())
        return scene

    def tree(self) -> dict[str, Any]:
        """Nested dicts and lists of plain SI numbers and text; what is None is left out."""
        return self.model_dump(by_alias=True, exclude_none=True, warnings=False)

    def definition(self) -> dict[str, Any]:
        """What the engine takes."""
        from .definition import definition

        return definition(self.validated())

    def check(self) -> Warnings:
        """Checks the whole scene. Errors are raised; what is legal but doubtful physics comes back as warnings."""
        from .check import check
        from .definition import definition

        scene = self.validated()
        return check(scene, definition(scene))

    def electric_field(self) -> ElectricField:
        """The field as a function of points, by the model that `field` names."""
        if self.field.lacks(self):
            part = "drum" if all_electrodes(self) else "electrode"
            raise InputError("is missing: the field needs a drum and an electrode", path=part)
        return self.field.build(self)

    def ionised_field(self) -> IonisedField:
        """Field and ion current of the corona wires along the drum, solved for whatever ``corona.model`` is."""
        from .ions import ionised_field

        return ionised_field(self.validated())

    def to_toml(self) -> str:
        """The scene as TOML text, which `Scene.from_toml` and `cesim.load` read."""
        import tomli_w

        text = tomli_w.dumps({"cesim": VERSION, **_plain(self.tree())})
        text = ROWS.sub(lambda match: f"[{', '.join(match[1].replace(',', ' ').split())}]", text)
        return NUMBERS.sub(lambda match: f"= [{', '.join(match[1].replace(',', ' ').split())}]", text)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the scene as a TOML file."""
        Path(path).write_text(self.to_toml(), encoding="utf-8")

    @classmethod
    def from_toml(cls, text: str) -> Scene:
        """Reads TOML text that names no files."""
        tree = _parse(text)
        if _names_a_file(tree.get("field"), "grid"):
            raise InputError("names a file, which cesim.load reads and a text does not", path="field.file")
        return _from_tree(tree)

    def __str__(self) -> str:
        return self.to_toml()


def load(path: str | os.PathLike[str], *, allow_outside: bool = False) -> Scene:
    """Reads a scene file. It is data: nothing in it is executed.

    Parameters
    ----------
    path : str or path
        A TOML file of at most 10 MB.
    allow_outside : bool
        Whether files that the scene names (tables of measured sizes, meshes) may lie outside its own folder.
    """
    file = Path(path)
    try:
        with file.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
        text = content.decode("utf-8")
    except (OSError, ValueError) as error:
        raise InputError(f"{show(str(path))} cannot be read: {error}", value=str(path)) from None
    if len(content) > LARGEST_FILE:
        raise InputError(f"{show(str(path))} is larger than {LARGEST_FILE // 1_000_000} MB", value=str(path))
    tree = _parse(text)
    _read_files(tree, file.resolve().parent, allow_outside)
    _read_meshes(tree, file.resolve().parent, allow_outside)
    _read_grid(tree, file.resolve().parent, allow_outside)
    return _from_tree(tree)


def _parse(text: str) -> dict[str, Any]:
    try:
        tree: dict[str, Any] = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"the text is not TOML: {error}") from None
    return tree


def _from_tree(tree: dict[str, Any]) -> Scene:
    version = tree.pop("cesim", VERSION)
    if type(version) is not int or not 1 <= version <= VERSION:
        raise InputError(
            f"is {show(version)}, but this version of cesim reads files of version 1 to {VERSION}",
            path="cesim",
            value=version,
            allowed=f"[1, {VERSION}]",
        )
    scene: Scene = Scene.model_validate(tree)
    return scene


def _read_files(tree: dict[str, Any], folder: Path, allow_outside: bool) -> None:
    """Puts measured sizes and surfaces of grains in the place of the files named for them."""
    feed, shapes = tree.get("feed"), tree.get("shapes")
    owners: list[tuple[str, Any]] = [("feed", feed)]
    if isinstance(feed, dict) and isinstance(feed.get("families"), list):
        owners += [(f"feed.families[{i}]", family) for i, family in enumerate(feed["families"])]
    for place, owner in owners:
        if isinstance(owner, dict) and _names_a_file(size := owner.get("size"), "table"):
            owner["size"] = Table.read(_inside(size["file"], folder, allow_outside, f"{place}.size.file")).model_dump()
    places = [(f"{place}.shape", owner, "shape") for place, owner in owners]
    if isinstance(shapes, dict):
        places += [(join_path("shapes", name), shapes, name) for name in shapes]
    for place, owner, key in places:
        if isinstance(owner, dict) and _names_a_file(shape := owner.get(key), "mesh"):
            path = _inside(shape["file"], folder, allow_outside, f"{place}.file")
            owner[key] = _read_mesh(path, shape, place)


def _read_meshes(tree: dict[str, Any], folder: Path, allow_outside: bool) -> None:
    """Puts vertices and triangles in the place of the files named for them."""
    meshes = tree.get("meshes")
    for i, mesh in enumerate(meshes if isinstance(meshes, list) else []):
        if not isinstance(mesh, dict) or not isinstance(mesh.get("file"), str):
            continue
        where = f"meshes[{i}].file"
        if "vertices" in mesh or "triangles" in mesh:
            raise InputError("stands beside vertices or triangles: give one or the other", path=where)
        try:
            vertices, triangles = read_mesh(_inside(mesh.pop("file"), folder, allow_outside, where))
        except InputError as error:
            error.path = where
            raise
        mesh["vertices"], mesh["triangles"] = vertices.tolist(), triangles.tolist()


def _read_grid(tree: dict[str, Any], folder: Path, allow_outside: bool) -> None:
    """Puts a potential in the place of the file named for it."""
    if _names_a_file(field := tree.get("field"), "grid"):
        path = _inside(field["file"], folder, allow_outside, "field.file")
        try:
            tree["field"] = read_grid_file(path, field)
        except InputError as error:
            raise error.at("field") from None


def _read_mesh(path: Path, shape: dict[str, Any], place: str) -> dict[str, Any]:
    others = {key: value for key, value in shape.items() if key not in ("kind", "file")}
    try:
        return ClosedMesh.read(path, **others).model_dump()
    except InputError as error:
        error.path = error.path.removeprefix(ClosedMesh.where).removeprefix(".")
        raise error.at(place) from None


def _names_a_file(part: Any, kind: str) -> TypeGuard[dict[str, Any]]:
    return isinstance(part, dict) and part.get("kind") == kind and isinstance(part.get("file"), str)


def _inside(name: str, folder: Path, allow_outside: bool, where: str) -> Path:
    try:
        path = (folder / name).resolve()  # follows symbolic links
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"is {show(name)}, not a path: {error}", path=where, value=name) from None
    if not allow_outside and not path.is_relative_to(folder):
        raise InputError(
            f"is {show(name)}, outside the scene's folder; load(..., allow_outside=True) permits it",
            path=where,
            value=name,
        )
    return path


def _plain(tree: Any) -> Any:
    """Numbers and text as TOML knows them; a feed rate becomes text with its unit, an array packed text."""
    if isinstance(tree, dict):
        return {key: _plain(value) for key, value in tree.items() if value or key not in OMITTED}
    if isinstance(tree, list | tuple):
        return [_plain(value) for value in tree]
    if isinstance(tree, StoredArray):
        return tree.text()
    return str(tree) if isinstance(tree, Rate) else tree
