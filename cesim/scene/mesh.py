"""Triangle meshes as parts of the machine, and the files they come from."""

from __future__ import annotations

import io
import math
import os
import re
import warnings
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, PlainValidator, model_validator

from ..errors import InputError, number
from ..units import Doc, Part, Quantity
from .machine import Carrier, Component, Point3, Surface, Vibration

Vertices = NDArray[np.float64]
Triangles = NDArray[np.uint32]

FARTHEST = 10.0  # m, of a vertex from the mesh's own origin
MOST_TRIANGLES = 1_000_000  # in a scene, whose numbers are kept as text
LARGEST_FILE = 500_000_000  # bytes
KINDS = ("stl", "obj", "ply")


class Rotation(Part):
    """A steady rotation of the whole body about the z axis of its own frame."""

    where: ClassVar[str] = "motion"
    kind: Literal["rotation"] = "rotation"
    speed: Annotated[float, Quantity("rad/s", -1000.0, 1000.0, "speed, positive: from its x axis to its y axis")]


def _rows(value: Any, what: str, kinds: str) -> NDArray[Any]:
    """(n, 3) numbers of the kinds that are legal ('i' integers, 'f' floats)."""
    try:
        array = np.asarray(value)
    except (ValueError, TypeError, OverflowError):
        raise InputError(f"is no table of {what}") from None
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        raise InputError(f"has shape {array.shape}, must be (n, 3): {what}", allowed="(n, 3)")
    if array.dtype.kind not in kinds:
        raise InputError(f"is an array of {array.dtype}, must be {what}")
    return array


def _vertices(value: Any) -> list[list[float]]:
    array = _rows(value, "coordinates", "iuf").astype(np.float64)
    wrong = np.argwhere(~np.isfinite(array))
    if len(wrong):
        row, column = wrong[0]
        raise InputError(f"is {array[row, column]} at [{row}, {column}], must be finite")
    return array.tolist()  # type: ignore[no-any-return]


def _triangles(value: Any) -> list[list[int]]:
    array = _rows(value, "whole numbers, indices of vertices", "iu")
    if len(array) > MOST_TRIANGLES:
        raise InputError(f"has {len(array)} rows, at most {MOST_TRIANGLES} are allowed", allowed=f"{MOST_TRIANGLES}")
    if array.min() < 0:
        raise InputError(f"names vertex {array.min()}, must not be negative", value=int(array.min()))
    return array.tolist()  # type: ignore[no-any-return]


def _unit_alone(value: Any) -> Any:
    """A unit alone is one of it: 'mm' is '1 mm'."""
    return f"1 {value.strip()}" if isinstance(value, str) and re.match(r"\s*[a-zA-Zµμ]", value) else value


class Mesh(Surface):
    """A thin sheet of triangles: a chute, a guide plate, a housing, a paddle. Grains rest on either of its sides.

    It may be open, and the order of a triangle's corners does not matter. A scene file may say `file = "chute.stl"`
    (STL, OBJ or PLY) in place of vertices and triangles; `Mesh.read` does the same.
    """

    where: ClassVar[str] = "mesh"
    vertices: Annotated[list[list[float]], PlainValidator(_vertices), Doc("(n, 3) coordinates, in units of scale")]
    triangles: Annotated[list[list[int]], PlainValidator(_triangles), Doc("(m, 3) indices of vertices, from 0")]
    scale: Annotated[
        float,
        Quantity("m", 1e-9, 1e3, "length that 1 stands for in the vertices, such as 'mm'"),
        BeforeValidator(_unit_alone),
    ] = 1.0
    position: Annotated[Point3, Doc("where its origin lies [m]")] = (0.0, 0.0, 0.0)
    orientation: Annotated[
        tuple[Component, Component, Component, Component],
        Doc("quaternion (w, x, y, z) that turns its frame into the machine's, of any length"),
    ] = (1.0, 0.0, 0.0, 0.0)
    role: Annotated[
        Literal["inert", "ground", "brush"],
        Doc("'inert', 'ground': grounded metal, or 'brush': takes the charge of what it touches"),
    ] = "inert"
    motion: (
        Annotated[
            Rotation | Vibration, Field(discriminator="kind"), Doc("rotation, vibration, or None: it stands still")
        ]
        | None
    ) = None
    part: Carrier = None

    @model_validator(mode="after")
    def _fits_together(self) -> Mesh:
        largest = max(map(max, self.triangles))
        if largest >= len(self.vertices):
            raise InputError(
                f"name vertex {largest}, but there are only {len(self.vertices)}", path="triangles", value=largest
            )
        farthest = float(np.abs(self.corners()).max())
        if farthest > FARTHEST:
            raise InputError(
                f"reach {number(farthest)} m from the origin, at most {number(FARTHEST)} m are allowed; is their unit "
                "missing, as in scale = 'mm'?",
                path="vertices",
                value=farthest,
                unit="m",
                allowed=f"[0, {number(FARTHEST)}] m",
            )
        if math.hypot(*self.orientation) < 1e-9:
            raise InputError("must not be zero", path="orientation", value=self.orientation)
        return self

    @classmethod
    def read(cls, path: str | os.PathLike[str], **fields: Any) -> Mesh:
        """A part with the triangles of an STL, OBJ or PLY file.

        Parameters
        ----------
        path : path
            Its ending tells the format.
        **fields
            The other fields of a mesh by name, such as ``scale="mm"``.

        Raises
        ------
        InputError
            Where the file cannot be read, or its triangles make no part.
        """
        vertices, triangles = read_mesh(path)
        return cls(vertices=vertices.tolist(), triangles=triangles.tolist(), **fields)

    def corners(self) -> Vertices:
        """Vertices (n, 3) in m, in the mesh's own frame."""
        return np.asarray(self.vertices, dtype=np.float64) * self.scale

    def greatest_speed(self) -> float:
        """Of the surface, m/s."""
        if isinstance(self.motion, Rotation):
            return abs(self.motion.speed) * float(np.hypot(*self.corners()[:, :2].T).max())
        return 0.0 if self.motion is None else self.motion.greatest_speed()


# ---- how triangles hang together -----------------------------------------------------------------------------------


def seams(vertices: Vertices, triangles: Triangles) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The edges (k, 2) as pairs of vertices, corners in the same place being one, and how many triangles share each."""
    _, first, same = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    corners = first[same.reshape(-1)][triangles]
    corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]  # the others have no area
    pairs = np.sort(corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, count = np.unique(pairs, axis=0, return_counts=True)
    return edges, count


def flaws(mesh: Mesh) -> list[str]:
    """What is legal, and worth knowing, of how the triangles hang together."""
    vertices, triangles = mesh.corners(), np.asarray(mesh.triangles, dtype=np.uint32)
    _, count = seams(vertices, triangles)
    found = []
    if opened := int((count == 1).sum()):
        found.append(f"is open: {opened} of its {len(count)} edges belong to one triangle only")
    if shared := int((count > 2).sum()):
        found.append(f"branches: {shared} of its {len(count)} edges belong to more than two triangles")
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    longest = np.max([np.square(x - y).sum(axis=1) for x, y in ((a, b), (b, c), (c, a))], axis=0)
    if flat := int((np.linalg.norm(np.cross(b - a, c - a), axis=1) <= 1e-10 * longest).sum()):
        found.append(f"has {flat} triangles without an area, which are left out")
    _, _, same = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    kinds = np.unique(np.sort(same.reshape(-1)[triangles], axis=1), axis=0)
    if twice := len(triangles) - len(kinds):
        found.append(f"has {twice} triangles that lie on another one")
    return found


# ---- files ---------------------------------------------------------------------------------------------------------


def read_mesh(path: str | os.PathLike[str]) -> tuple[Vertices, Triangles]:
    """Vertices (n, 3), in the unit of the file, and triangles (m, 3) of an STL, OBJ or PLY file."""
    name = os.path.basename(os.fspath(path))[-100:]
    kind = name.rpartition(".")[2].lower()
    if kind not in KINDS:
        raise InputError(f"is {name!r}, must end in .{', .'.join(KINDS)}", path="file", value=name)
    try:
        with open(path, "rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        raise InputError(
            f"{name!r} cannot be read: {error.strerror if isinstance(error, OSError) else error}",
            path="file",
            value=name,
        ) from None
    try:
        if len(content) > LARGEST_FILE:
            raise InputError(f"is larger than {LARGEST_FILE // 1_000_000} MB")
        return _merged(*_parsed(content, kind, CHECKS[kind](content)))
    except InputError as error:
        raise InputError(f"{name!r} {error.reason}", path="file", value=name) from None


def _parsed(content: bytes, kind: str, count: int) -> tuple[Vertices, Triangles]:
    """What trimesh makes of it. Its readers skip what they do not understand, so they are watched."""
    try:
        import trimesh
    except ImportError:
        raise InputError("needs trimesh to be read: pip install 'cesim[cad]'") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            mesh = trimesh.load_mesh(io.BytesIO(content), file_type=kind, process=False)
            vertices = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
            triangles = np.array(mesh.faces, dtype=np.int64).reshape(-1, 3)
    except Exception as error:  # a foreign reader may fail in any way on a damaged file
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"is damaged, or no {kind.upper()} file: {reason}") from None
    if len(triangles) == 0:
        raise InputError("has no triangles")
    if len(triangles) < count:
        raise InputError(f"is damaged: it announces {count} triangles, {len(triangles)} can be read")
    return vertices, triangles  # type: ignore[return-value]


def _merged(vertices: Vertices, triangles: NDArray[Any]) -> tuple[Vertices, Triangles]:
    """The same triangles, in which corners of one place are one vertex."""
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise InputError(f"is damaged: a triangle names vertex {triangles.max()} of {len(vertices)}")
    if not np.isfinite(vertices[triangles]).all():
        raise InputError("holds a coordinate that is not finite")
    used, corners = np.unique(triangles, return_inverse=True)
    places, same = np.unique(vertices[used] + 0.0, axis=0, return_inverse=True)  # + 0.0: -0 is 0
    return places, same.reshape(-1)[corners.reshape(-1, 3)].astype(np.uint32)


def _check_stl(content: bytes) -> int:
    """Number of facets of an STL file, ASCII or binary; what it announces must be there."""
    count = int.from_bytes(content[80:84], "little")
    if len(content) >= 84 and len(content) == 84 + 50 * count:
        return count
    facets, ends = (
        len(re.findall(rb"(?<![A-Za-z])" + word + rb"\b", content, re.I)) for word in (b"facet", b"endfacet")
    )
    if not content.lstrip().lower().startswith(b"solid") or b"\0" in content or facets == 0:
        if len(content) < 84:
            raise InputError(f"is no STL file: it has {len(content)} bytes, the header alone has 84")
        if content.lstrip().lower().startswith(b"solid") and b"\0" not in content:
            raise InputError("has no triangles")
        raise InputError(
            f"is damaged, or no STL file: it announces {count} triangles, which take {84 + 50 * count} bytes; "
            f"it has {len(content)}"
        )
    corners = len(re.findall(rb"\bvertex\b", content, re.I))
    if facets != ends or corners != 3 * facets or b"endsolid" not in content.lower():
        raise InputError(
            f"is cut short or damaged: {facets} facets begin, {ends} end, with {corners} corners between them"
        )
    _refuse_commas(content)
    return facets


def _check_obj(content: bytes) -> int:
    """Number of faces; each is a triangle or more of them."""
    _refuse_commas(content)
    return len(re.findall(rb"^\s*f\s", content, re.M))


def _check_ply(content: bytes) -> int:
    """Number of faces that the header announces: no element may be announced more often than the file can hold."""
    elements = re.findall(rb"^element\s+(\S+)\s+(\d{1,18})\s*$", content[:100_000], re.M)
    for element, count in elements:
        if int(count) > len(content):
            raise InputError(f"is damaged: it announces {int(count)} of {element.decode(errors='replace')[:20]}")
    return sum(int(count) for element, count in elements if element == b"face")


def _refuse_commas(content: bytes) -> None:
    if re.search(rb"^\s*v(?:ertex)?\s[^\r\n#]*\d,\d", content, re.M | re.I):
        raise InputError("has decimal commas; numbers need a point")


CHECKS = {"stl": _check_stl, "obj": _check_obj, "ply": _check_ply}
