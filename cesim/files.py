"""Result and restart files (HDF5): their layout, writing of restarts, and reading.

What is read is data: links, object types and pickles are refused, and sizes are checked first. A run is written as
``NAME.part`` in HDF5's single-writer mode, in which a file is readable after a crash at any instant, and gets its name
when it is whole. All groups, tables and attributes are made at the start; afterwards tables only grow.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import astuple, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .health import SOLVERS, Amount, Balance, Health, SolverUse

if TYPE_CHECKING:
    import h5py

RUN, RESTART = "cesim-run", "cesim-restart"
SCHEMA = (1, 0)
FORMAT = ("v110", "v110")  # readable by HDF5 1.10 and later; its metadata carry checksums
UNWRITTEN = 2**26  # bytes of a table that may be announced before they are there
STAGES = ("feed", "charge", "force", "detect", "solve", "move", "collect")

LANDING = np.dtype(
    [
        *(("id", "i8"), ("t", "f8"), ("birth", "f8"), ("x", "f8"), ("y", "f8"), ("z", "f8"), ("velocity", "f8", (3,))),
        *(("charge", "f8"), ("mass", "f8"), ("diameter", "f8")),
        *(("material", "i4"), ("surface", "i4"), ("collisions", "i4"), ("lost", "i4")),
    ]
)
PARTICLE = np.dtype(
    [("id", "i8"), ("birth", "f8"), ("material", "i4"), ("mass", "f8"), ("diameter", "f8"), ("permittivity", "f8")]
)
JOINT = np.dtype(
    [
        *(("time", "f8"), ("joint", "i4"), ("at_limit", "i4"), ("at_stop", "i4")),
        *((name, "f8") for name in ("travel", "speed", "effort", "power", "energy", "impulse")),
        *(("force", "f8", (3,)), ("moment", "f8", (3,))),
    ]
)
_FLOATS = {"residual", "penetration", "kinetic_energy", "worst_residual", "worst_penetration", "penetration_ratio"} | {
    "joint_drift",
    "pair_error",
    "worst_turn",
}


def _solver_column(name: str) -> str:
    return f"solver_{name.replace(' ', '_')}"


_PER_NAME = ("solvers", "seconds")
SOLVER_USE = [(f.name, "f8" if f.name in ("residual", "seconds") else "i8") for f in fields(SolverUse)]
HEALTH = np.dtype(
    [("time", "f8")]
    + [(f.name, "f8" if f.name in _FLOATS else "i8") for f in fields(Health) if f.name not in _PER_NAME]
    + [(_solver_column(name), SOLVER_USE) for name in SOLVERS]
    + [(f"seconds_{stage}", "f8") for stage in STAGES]
)
FRAME_COLUMNS = {
    "id": ("i8", 0),
    "position": ("f4", 3),
    "orientation": ("f4", 4),
    "velocity": ("f4", 3),
    "charge": ("f4", 0),
}


# ---- writing ---------------------------------------------------------------------------------------------------------


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Failures of a disk become an InputError that names the file."""
    try:
        yield
    except InputError:
        raise
    except (OSError, RuntimeError) as error:
        raise InputError(f"cannot be written: {_reason(error)}", path=str(path)) from None


def _reason(error: BaseException) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return str(text).splitlines()[0]


def replace(part: Path, path: Path) -> None:
    """Give a finished file its name, durably."""
    with open(part, "rb+") as file:
        os.fsync(file.fileno())
    os.replace(part, path)
    if hasattr(os, "O_DIRECTORY"):
        folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def in_memory() -> h5py.File:
    """A new file that lives in memory only."""
    import h5py

    return h5py.File("cesim", "w", driver="core", backing_store=False, libver=FORMAT)


def write_text(group: h5py.Group, name: str, text: str) -> None:
    import h5py

    data = text.encode()  # of fixed length, so that it lies under the checksum of its object
    group.create_dataset(name, data=np.array(data, dtype=h5py.string_dtype("utf-8", max(len(data), 1))))


def state_digest(toml: str, seed: int, state: Mapping[str, NDArray[Any]]) -> bytes:
    """SHA-256 of all that a restart rests on."""
    digest = hashlib.sha256(f"{seed}\n{toml}".encode())
    for name in sorted(state):
        block = np.ascontiguousarray(state[name])
        digest.update(f"\n{name} {block.dtype.str} {block.shape}\n".encode())
        digest.update(block.tobytes())
    return digest.hexdigest().encode()


def write_restart(path: Path, toml: str, seed: int, state: Mapping[str, NDArray[Any]]) -> None:
    """Write scene and state; the file appears under its name only when it is whole."""
    with in_memory() as file:  # HDF5 crashes when it cannot close a file on a full disk, so it never sees the disk
        file.attrs.update({"filetype": RESTART, "schema": np.array(SCHEMA), "seed": np.uint64(seed)})
        write_text(file.create_group("scene"), "toml", toml)
        group = file.create_group("restart")
        for name, block in state.items():
            group.create_dataset(name, data=block)
        group.attrs["digest"] = np.bytes_(state_digest(toml, seed, state))
        file.flush()
        image = file.id.get_file_image()
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    with writing(path):
        try:
            part.write_bytes(image)
            replace(part, path)
        finally:
            part.unlink(missing_ok=True)


# ---- reading ---------------------------------------------------------------------------------------------------------


WHAT_HDF5_RAISES = (
    OSError,
    RuntimeError,
    LookupError,
    ValueError,
    TypeError,
    AttributeError,
    ArithmeticError,
    MemoryError,
)


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Whatever a damaged file makes HDF5 say becomes an InputError that names the file."""
    try:
        yield
    except InputError:
        raise
    except WHAT_HDF5_RAISES as error:
        raise InputError(f"is damaged, or no file of cesim: {_reason(error)}", path=str(path)) from None


@contextmanager
def opened(path: Path, kinds: tuple[str, ...]) -> Iterator[h5py.File]:
    """A file of one of these kinds, also one that is still being written or whose writer was killed."""
    import h5py

    if not path.is_file():
        part = path.with_name(path.name + ".part")
        hint = f"; there is {part.name} of a run that did not end" if part.exists() else ""
        raise InputError(f"does not exist{hint}", path=str(path))
    with reading(path), h5py.File(path, "r", swmr=is_unfinished(path)) as file:
        kind = file.attrs.get("filetype")
        if not isinstance(kind, str) or kind not in kinds:
            raise InputError(f"is not a {' or '.join(kinds)} file", path=str(path))
        major = int(np.ravel(file.attrs["schema"])[0])
        if major > SCHEMA[0]:
            raise InputError(f"was written by a newer cesim (schema {major}, known: {SCHEMA[0]})", path=str(path))
        yield file


def is_unfinished(path: Path) -> bool:
    """Whether a file is being written, or its writer was killed."""
    with open(path, "rb") as file:
        head = file.read(12)
    if head[:9] != b"\x89HDF\r\n\x1a\n\x03":
        raise InputError("is not a file of cesim", path=str(path))
    return len(head) == 12 and bool(head[11] & 4)


def table(group: h5py.Group, name: str, dtype: Any = None) -> h5py.Dataset:
    """A dataset that is safe to read: no link, no foreign filter, no more data than the file can hold."""
    import h5py

    item = member(group, name)
    if not isinstance(item, h5py.Dataset) or item.is_virtual or item.external:
        raise InputError(f"{item.name} is not a plain dataset")
    plist = item.id.get_create_plist()
    filters = {plist.get_filter(i)[0] for i in range(plist.get_nfilters())}
    if not filters <= {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}:
        raise InputError(f"{item.name} uses a filter that cesim does not")
    if item.dtype.hasobject:
        raise InputError(f"{item.name} holds objects, not numbers")
    held = item.id.get_storage_size()
    packed = 1032 if h5py.h5z.FILTER_DEFLATE in filters else 1
    if item.nbytes > packed * held + UNWRITTEN or held > item.file.id.get_filesize():
        raise InputError(f"{item.name} claims {item.nbytes} bytes, the file holds {held}")
    if dtype is not None and item.dtype != np.dtype(dtype):
        raise InputError(f"{item.name} has type {item.dtype}, expected {np.dtype(dtype)}")
    return item


def member(group: h5py.Group, name: str) -> Any:
    """A member of a group, if it is one and not a link to somewhere else."""
    import h5py

    link = group.get(name, getlink=True)
    if link is None:
        raise InputError(f"{group.name} has no {name!r}")
    if not isinstance(link, h5py.HardLink):
        raise InputError(f"{group.name} has a link in place of {name!r}: links are not followed")
    return group[name]


def scene_text(file: h5py.File, name: str) -> str:
    """A text of /scene."""
    item = table(member(file, "scene"), name)
    if item.shape != () or item.dtype.kind != "S":
        raise InputError(f"{item.name} is not a text")
    return bytes(item[()]).decode()


def read_restart(path: Path) -> tuple[str, int, dict[str, NDArray[Any]]]:
    """Scene, seed and state of a restart or result file."""
    import h5py

    with opened(path, (RESTART, RUN)) as file:
        toml, seed = scene_text(file, "toml"), int(file.attrs["seed"])
        group = member(file, "restart")
        if not isinstance(group, h5py.Group):
            raise InputError("has no restart state", path=str(path))
        digest = bytes(group.attrs["digest"])
        if digest == b"0" * 64:
            raise InputError("has no restart state: its run did not end", path=str(path))
        state = {name: np.ascontiguousarray(table(group, name)[()]) for name in group}
        if digest != state_digest(toml, seed, state):
            raise InputError("is damaged: its restart state does not match its digest", path=str(path))
        return toml, seed, state


def read_run(file: h5py.File) -> dict[str, Any]:
    """The tables of a result file, checked against each other. Frames are left to `read_frames`."""
    landings = table(file, "landings", LANDING)
    resolved = json.loads(scene_text(file, "resolved"))
    materials = len(resolved["materials"])
    rows = landings[()]
    rows = rows[: written(rows["mass"])]
    numbers = [rows[name] for name, (kind, *_) in (LANDING.fields or {}).items() if kind.base.kind == "f"]
    if not all(np.isfinite(column).all() for column in numbers):
        raise InputError("/landings holds a number that is not finite")
    if len(rows) and not (rows["material"].min() >= 0 and rows["material"].max() < materials):
        raise InputError("/landings names a material that the scene does not have")
    history = table(file, "health", HEALTH)[()]
    attrs = {name: np.ravel(landings.attrs[name]) for name in ("fed", "landed", "resident", "lost")}
    return {
        "attrs": {name: value.item() if hasattr(value, "item") else value for name, value in scalars(file).items()},
        "toml": scene_text(file, "toml"),
        "resolved": resolved,
        "effects": json.loads(scene_text(file, "effects")),
        "citations": json.loads(scene_text(file, "citations")),
        "landings": rows,
        "particles": table(file, "particles", PARTICLE)[()],
        "health": history[: written(history["time"])],
        "joints": _read_joints(file, len(resolved.get("joints") or [])),
        "balance": {name: (int(value[0]), float(value[1])) for name, value in attrs.items()},
        "closed": bool(landings.attrs["closed"]),
    }


def _read_joints(file: h5py.File, count: int) -> NDArray[np.void]:
    """Rows of /joints, of whole times only; none where the machine has no joints."""
    if count == 0:
        return np.zeros(0, JOINT)
    rows: NDArray[np.void] = table(file, "joints", JOINT)[()]
    rows = rows[: written(rows["time"]) // count * count]
    if not np.array_equal(rows["joint"], np.arange(len(rows)) % count):
        raise InputError("/joints names a joint that the scene does not have")
    return np.asarray(rows)


def written(column: NDArray[Any]) -> int:
    """Rows before the first that is zero: of a run that was killed, the newest may be announced but not yet there."""
    zeros = np.flatnonzero(column == 0)
    return int(zeros[0]) if len(zeros) else len(column)


def scalars(file: h5py.File) -> dict[str, Any]:
    """The attributes of the file that are single values."""
    return {name: value for name, value in file.attrs.items() if np.ndim(value) == 0}


def read_frames(file: h5py.File) -> dict[str, NDArray[Any]]:
    """Whole frames: offset (F + 1,), time (F,) [s] and the flat columns of FRAME_COLUMNS."""
    group = member(file, "frames")
    offset, when = table(group, "offset", "i8")[()], table(group, "time", "f8")[()]
    columns = {name: table(group, name, kind) for name, (kind, _) in FRAME_COLUMNS.items()}
    if any(columns[name].shape[1:] != ((width,) if width else ()) for name, (_, width) in FRAME_COLUMNS.items()):
        raise InputError("/frames has a column of the wrong width")
    if len(offset) == 0 or offset[0] != 0:
        raise InputError("/frames/offset does not begin at 0")
    rows = min(*(len(column) for column in columns.values()), written(columns["orientation"][()].any(axis=-1)))
    falls = np.flatnonzero((np.diff(offset) < 0) | (offset[1:] > rows))  # a killed run may end inside a frame
    whole = min(int(falls[0]) if len(falls) else len(offset) - 1, written(when))
    end = int(offset[whole])
    return {"offset": offset[: whole + 1], "time": when[:whole]} | {n: c[:end] for n, c in columns.items()}


def balance_of(data: Mapping[str, Any]) -> Balance:
    """The balance that `read_run` read."""
    return Balance(**{name: Amount(*pair) for name, pair in data["balance"].items()}, closed=data["closed"])


def health_row(time: float, health: Health) -> NDArray[np.void]:
    """One row of /health."""
    row = np.zeros(1, HEALTH)
    row["time"] = time
    for f in fields(Health):
        if f.name not in _PER_NAME:
            row[f.name] = getattr(health, f.name)
    for name, use in health.solvers.items():
        row[_solver_column(name)] = astuple(use)
    for stage in STAGES:
        row[f"seconds_{stage}"] = health.seconds.get(stage, 0.0)
    return row


def joint_rows(time: float, joints: NDArray[np.void]) -> NDArray[np.void]:
    """Rows of /joints for one time: one a joint, from the engine's."""
    rows = np.zeros(len(joints), JOINT)
    rows["time"], rows["joint"] = time, np.arange(len(joints))
    for name in JOINT.names or ():
        if name not in ("time", "joint"):
            rows[name] = joints[name]
    return rows


def health_of(rows: NDArray[np.void]) -> Health:
    """The last row of /health as a Health."""
    row = rows[-1] if len(rows) else np.zeros(1, HEALTH)[0]
    values = {f.name: row[f.name].item() for f in fields(Health) if f.name not in _PER_NAME}
    uses = {name: SolverUse(*row[_solver_column(name)].item()) for name in SOLVERS}
    return Health(
        **values,
        solvers={name: use for name, use in uses.items() if use.islands > 0},
        seconds={stage: float(row[f"seconds_{stage}"]) for stage in STAGES},
    )
