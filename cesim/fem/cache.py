"""Unit solutions kept on disk, under a hash of everything that shapes them."""

from __future__ import annotations

import hashlib
import json
import math
import os
import sys
import zipfile
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

import numpy as np

from .geometry import Machine
from .grids import Nodes, UnitGrids

VERSION = 1  # of the method: a change of it makes other numbers
ARRAYS = ("values", "points", "field", "coarse_field", "capacitance")


def cache_folder() -> Path:
    """Where solutions are kept: $CESIM_CACHE, or the folder for caches of this platform."""
    if given := os.environ.get("CESIM_CACHE"):
        return Path(given)
    home = Path.home()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return base / "cesim" / "finite_element"


def key_of(machine: Machine, dimension: int, resolution: int, nodes: Nodes) -> str:
    """SHA-256 of the geometry, the mesh and the grid; names and voltages do not matter."""
    content = {
        "version": VERSION,
        "conductors": [_numbers(part) for part in machine.conductors],
        "dielectrics": [_numbers(part) for part in machine.dielectrics],
        "enclosure": None if machine.enclosure is None else _numbers(machine.enclosure),
        "dimension": dimension,
        "resolution": resolution,
        "nodes": _numbers(nodes),
    }
    if dimension == 2:  # lengths do not matter either
        for part in (*content["conductors"], *content["dielectrics"], content["enclosure"] or {}):  # type: ignore[misc]
            part.pop("length", None)
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _numbers(part: object) -> dict[str, object]:
    content: dict[str, object] = {"kind": type(part).__name__}
    for name, value in asdict(part).items():  # type: ignore[call-overload]
        if name != "name":
            content[name] = "infinite" if isinstance(value, float) and math.isinf(value) else value
    return content


def load(key: str, nodes: Nodes, folder: Path) -> UnitGrids | None:
    """What is kept under a key; None: nothing, or a file that is damaged."""
    try:
        with open(folder / f"{key}.npz", "rb") as opened, np.load(opened, allow_pickle=False) as file:
            arrays = {name: np.asarray(file[name]) for name in ARRAYS}
            unknowns = int(file["unknowns"])
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, TypeError):
        return None
    values = arrays["values"]
    if values.shape[1:] != nodes.counts or not all(np.isfinite(array).all() for array in arrays.values()):
        return None
    return UnitGrids(nodes, unknowns=unknowns, **arrays)


def store(key: str, grids: UnitGrids, folder: Path) -> bool:
    """Keep a solution; whether that was possible. A cache that cannot be written is no reason to stop."""
    part = folder / f"{key}.{os.getpid()}.part"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with open(part, "wb") as file:
            np.savez_compressed(file, unknowns=grids.unknowns, **{name: getattr(grids, name) for name in ARRAYS})
        os.replace(part, folder / f"{key}.npz")
    except OSError:
        with suppress(OSError):
            part.unlink()
        return False
    return True
