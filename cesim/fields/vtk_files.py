"""Reads point data on image data and rectilinear grids from VTK files, XML and legacy.

After "VTK File Formats", VTK User's Guide, 11th ed., Kitware 2010: text, inline base64 and appended data, plain or
compressed by zlib.
"""

from __future__ import annotations

import binascii
import re
import zlib
from collections.abc import Callable, Iterator
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..errors import InputError, show
from .base import Array
from .stored import MOST_NODES

TYPES = {
    **{f"Float{b}": f"f{b // 8}" for b in (32, 64)},
    **{f"Int{b}": f"i{b // 8}" for b in (8, 16, 32, 64)},
    **{f"UInt{b}": f"u{b // 8}" for b in (8, 16, 32, 64)},
}
LEGACY = {"float": "f4", "double": "f8", "int": "i4", "long": "i8", "short": "i2", "char": "i1", "vtkIdType": "i8"}
Axes = tuple[Array, Array, Array]
Found = tuple[Axes, dict[str, Array]]  # arrays (nz, ny, nx, components)


def read_vti(content: bytes) -> Found:
    """Image data in XML."""
    return _read_xml(content, "ImageData")


def read_vtr(content: bytes) -> Found:
    """A rectilinear grid in XML."""
    return _read_xml(content, "RectilinearGrid")


# ---- XML -----------------------------------------------------------------------------------------------------------


class _Xml:
    """The root of a file, and how its arrays are encoded."""

    def __init__(self, content: bytes) -> None:
        self.appended, self.raw = b"", False
        mark = re.search(rb"<AppendedData[^>]*encoding\s*=\s*[\"'](\w+)[\"'][^>]*>\s*_", content)
        if mark:
            end = content.rfind(b"</AppendedData>")
            self.appended, self.raw = content[mark.end() : end], mark[1] == b"raw"
            content = content[: mark.end()] + content[end:]
        if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
            raise InputError("declares entities, which a VTK file has no use for")
        try:
            self.root = ElementTree.fromstring(content)
        except ElementTree.ParseError as error:
            raise InputError(f"is not XML: {error}") from None
        self.order = ">" if self.root.get("byte_order") == "BigEndian" else "<"
        self.head = self.order + TYPES.get(self.root.get("header_type", "UInt32"), "u4")
        self.packed = self.root.get("compressor")
        if self.packed not in (None, "vtkZLibDataCompressor"):
            raise InputError(f"is compressed by {show(self.packed)}, must be plain or by vtkZLibDataCompressor")

    def array(self, element: ElementTree.Element, count: int) -> Array:
        """The numbers of a DataArray, so many."""
        kind = TYPES.get(element.get("type", ""))
        if kind is None:
            raise InputError(f"has an array of {show(element.get('type'))}, must be of numbers")
        form = element.get("format", "ascii")
        if form == "ascii":
            values = np.array((element.text or "").split(), dtype=np.float64)
        else:
            dtype = np.dtype(self.order + kind)
            values = np.frombuffer(self._bytes(element, form, count * dtype.itemsize), dtype).astype(np.float64)
        if len(values) != count:
            raise InputError(f"has {len(values)} numbers in {show(element.get('Name'))}, must be {count}")
        return values

    def _bytes(self, element: ElementTree.Element, form: str, wanted: int) -> bytes:
        if form == "appended":
            data = self.appended[int(element.get("offset", "0")) :]
            if self.raw:
                return self._unpacked(data, wanted, lambda part: part)
            return self._unpacked(data, wanted, _base64)
        if form != "binary":
            raise InputError(f"has an array in {show(form)}, must be ascii, binary or appended")
        return self._unpacked("".join((element.text or "").split()).encode(), wanted, _base64)

    def _unpacked(self, data: bytes, wanted: int, decoded: Any) -> bytes:
        """The bytes of an array behind its header of sizes. In base64 the header is encoded by itself where packed."""
        size = np.dtype(self.head).itemsize

        def spread(n: int) -> int:
            return n if decoded is not _base64 else 4 * ((n + 2) // 3)

        if self.packed is None:
            whole = decoded(data[: spread(size + wanted)])
            return bytes(whole[size : size + wanted])
        first = np.frombuffer(decoded(data[: spread(3 * size)])[: 3 * size], self.head)
        blocks = int(first[0])
        if blocks > MOST_NODES:
            raise InputError(f"declares {blocks} blocks in an array")
        length = (3 + blocks) * size
        sizes = np.frombuffer(decoded(data[: spread(length)])[:length], self.head)[3:]
        packed = decoded(data[spread(length) : spread(length) + spread(int(sizes.sum()))])
        parts, place = [], 0
        for n in sizes.tolist():
            parts.append(zlib.decompressobj().decompress(packed[place : place + n], wanted))
            place += n
        return b"".join(parts)[:wanted]


def _base64(data: bytes) -> bytes:
    return binascii.a2b_base64(data + b"=" * (-len(data) % 4))


def _read_xml(content: bytes, kind: str) -> Found:
    try:
        file = _Xml(content)
        grid = file.root.find(kind)
        piece = grid.find("Piece") if grid is not None else None
        if grid is None or piece is None or len(grid.findall("Piece")) > 1:
            raise InputError(f"has no {kind} of one piece")
        extent = [int(word) for word in (piece.get("Extent") or grid.get("WholeExtent") or "").split()]
        shape = _shape([extent[2 * k + 1] - extent[2 * k] + 1 for k in range(3)] if len(extent) == 6 else [])
        if kind == "ImageData":
            low = [float(word) for word in grid.get("Origin", "0 0 0").split()]
            step = [float(word) for word in grid.get("Spacing", "1 1 1").split()]
            axes = _image(low, step, shape, [extent[0], extent[2], extent[4]])
        else:
            arrays = piece.findall("Coordinates/DataArray")
            if len(arrays) != 3:
                raise InputError("must have three arrays of coordinates")
            x, y, z = (file.array(array, n) for array, n in zip(arrays, shape, strict=True))
            axes = (x, y, z)
        found = {}
        for array in piece.findall("PointData/DataArray"):
            parts = int(array.get("NumberOfComponents", "1"))
            if parts in (1, 3):
                values = file.array(array, parts * int(np.prod(shape)))
                found[array.get("Name", "")] = values.reshape(*shape[::-1], parts)
        return axes, found
    except (binascii.Error, zlib.error, ValueError, IndexError) as error:
        raise InputError(f"is damaged: {error}") from None


def _shape(counts: list[int]) -> tuple[int, int, int]:
    if len(counts) != 3 or min(counts) < 1:
        raise InputError("has no extent of three axes")
    if float(np.prod([float(n) for n in counts])) > MOST_NODES:
        raise InputError(f"declares {' x '.join(map(str, counts))} nodes, at most {MOST_NODES} may be")
    return counts[0], counts[1], counts[2]


def _image(low: list[float], step: list[float], shape: tuple[int, int, int], first: list[int]) -> Axes:
    if len(low) != 3 or len(step) != 3:
        raise InputError("has no origin and spacing of three axes")
    x, y, z = (low[k] + step[k] * np.arange(first[k], first[k] + shape[k], dtype=np.float64) for k in range(3))
    return x, y, z


# ---- legacy --------------------------------------------------------------------------------------------------------


def read_vtk(content: bytes) -> Found:
    """STRUCTURED_POINTS or RECTILINEAR_GRID of a legacy file, text or binary."""
    if not content.startswith(b"# vtk DataFile"):
        raise InputError("does not begin as a legacy VTK file")
    lines = content.split(b"\n", 3)
    if len(lines) < 4:
        raise InputError("ends within its header")
    binary = lines[2].strip().upper() == b"BINARY"
    try:
        return _read_legacy(_Words(lines[3], binary))
    except (ValueError, StopIteration, IndexError, UnicodeDecodeError) as error:
        raise InputError(f"is damaged: {error or 'it ends too early'}") from None


class _Words:
    """A cursor: words, and arrays of numbers as text or big-endian bytes."""

    def __init__(self, data: bytes, binary: bool) -> None:
        self.data, self.place, self.binary = data, 0, binary

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        match = re.compile(rb"\s*(\S+)").match(self.data, self.place)
        if match is None:
            raise StopIteration
        self.place = match.end()
        return match[1].decode("ascii")

    def numbers(self, count: int, kind: str) -> Array:
        if kind not in LEGACY:
            raise InputError(f"has an array of {show(kind)}, must be of numbers")
        if not self.binary:
            return np.array([float(next(self)) for _ in range(count)])
        begin = self.data.index(b"\n", self.place) + 1
        dtype = np.dtype(">" + LEGACY[kind])
        self.place = begin + count * dtype.itemsize
        if self.place > len(self.data):
            raise InputError("ends within an array")
        return np.frombuffer(self.data[begin : self.place], dtype).astype(np.float64)


class _Legacy:
    """What the sections of a legacy file have said so far; each keyword has a method that reads on behind it."""

    def __init__(self, words: _Words) -> None:
        self.words = words
        self.shape, self.nodes = (0, 0, 0), -1
        self.image: dict[str, list[float]] = {"ORIGIN": [0.0] * 3, "SPACING": [1.0] * 3}
        self.axes: dict[str, Array] = {}
        self.found: dict[str, Array] = {}

    def dataset(self, key: str) -> None:
        kind = next(self.words).upper()
        if kind not in ("STRUCTURED_POINTS", "RECTILINEAR_GRID"):
            raise InputError(f"has a {show(kind)}, must be STRUCTURED_POINTS or RECTILINEAR_GRID")

    def dimensions(self, key: str) -> None:
        self.shape = _shape([int(next(self.words)) for _ in range(3)])

    def corner(self, key: str) -> None:
        self.image["ORIGIN" if key == "ORIGIN" else "SPACING"] = [float(next(self.words)) for _ in range(3)]

    def coordinates(self, key: str) -> None:
        n, wanted = int(next(self.words)), self.shape["XYZ".index(key[0])]
        if n != wanted:
            raise InputError(f"has {n} {key.lower()}, must be {wanted}")
        self.axes[key[0]] = self.words.numbers(n, next(self.words))

    def point_data(self, key: str) -> None:
        self.nodes = int(next(self.words))
        if self.nodes != int(np.prod(self.shape)) or self.nodes == 0:
            raise InputError(f"has data at {self.nodes} points, must be {int(np.prod(self.shape))}")

    def scalars(self, key: str) -> None:
        name, kind, parts = next(self.words), next(self.words), 1
        if (after := next(self.words)).upper() != "LOOKUP_TABLE":
            parts = int(after)
            next(self.words)
        next(self.words)  # name of the lookup table
        self._array(name, kind, parts)

    def vectors(self, key: str) -> None:
        self._array(next(self.words), next(self.words), 3)

    def _array(self, name: str, kind: str, parts: int) -> None:
        if self.nodes <= 0:
            return  # of no points: what follows is read as words that mean nothing
        if parts not in (1, 3):
            raise InputError(f"has {parts} numbers a point in {show(name)}, must be 1 or 3")
        self.found[name] = self.words.numbers(parts * self.nodes, kind).reshape(*self.shape[::-1], parts)


SECTIONS: dict[str, Callable[[_Legacy, str], None]] = {
    "DATASET": _Legacy.dataset,
    "DIMENSIONS": _Legacy.dimensions,
    **dict.fromkeys(("ORIGIN", "SPACING", "ASPECT_RATIO"), _Legacy.corner),
    **dict.fromkeys(("X_COORDINATES", "Y_COORDINATES", "Z_COORDINATES"), _Legacy.coordinates),
    "POINT_DATA": _Legacy.point_data,
    "SCALARS": _Legacy.scalars,
    "VECTORS": _Legacy.vectors,
}


def _read_legacy(words: _Words) -> Found:
    file = _Legacy(words)
    for word in words:
        key = word.upper()
        if key == "CELL_DATA":
            break
        if key in SECTIONS:
            SECTIONS[key](file, key)
    if len(file.axes) == 3:
        return (file.axes["X"], file.axes["Y"], file.axes["Z"]), file.found
    return _image(file.image["ORIGIN"], file.image["SPACING"], file.shape, [0, 0, 0]), file.found
