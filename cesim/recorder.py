"""Writes a run as it happens."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import vtk
from .errors import InputError
from .files import (
    FORMAT,
    FRAME_COLUMNS,
    HEALTH,
    JOINT,
    LANDING,
    PARTICLE,
    RUN,
    SCHEMA,
    health_row,
    in_memory,
    joint_rows,
    read_run,
    replace,
    state_digest,
    write_text,
    writing,
)

if TYPE_CHECKING:
    import h5py

    from .result import Run
    from .simulation import Simulation


BIN_COLUMNS = ("mass", "count", "ci_low", "ci_high", "n_eff")


class Recorder:
    """Writes a run as it happens: to ``path`` by way of ``path.part``, or in memory when path is None.

    Appending is idempotent: interrupted between two lines, the next call writes the same rows again.
    """

    def __init__(self, path: Path | None, sim: Simulation, header: Mapping[str, Any], texts: Mapping[str, str]) -> None:
        import h5py

        self.path, self.sim = path, sim
        self.part = path.with_name(path.name + ".part") if path else None
        self.landed = self.framed = self.frames = self.healths = 0
        self.tables: dict[str, h5py.Dataset] = {}
        self.file = in_memory()
        self._create(header, texts)
        if self.part is not None:
            self.file.flush()
            image = self.file.id.get_file_image()
            self.file.close()
            with writing(self.part):
                self.part.write_bytes(image)
                self.file = h5py.File(self.part, "r+", libver=FORMAT)
            self.file.swmr_mode = True
        self.tables = {name: self.file[name] for name in self.tables}  # held open: closing one writes, and may fail

    @contextmanager
    def _disk(self) -> Iterator[None]:
        """Turns a full disk into an InputError, and leaves the file as it is.

        HDF5 crashes when it cannot write what it still holds in memory: from here on it writes to nowhere.
        """
        try:
            with writing(self.path or Path("memory")):
                yield
        except InputError:
            if self.part is not None:
                nowhere = os.open(os.devnull, os.O_RDWR)
                os.dup2(nowhere, self.file.id.get_vfd_handle())
                os.close(nowhere)
            self.abandon()
            raise

    def _create(self, header: Mapping[str, Any], texts: Mapping[str, str]) -> None:
        file = self.file
        file.attrs.update({"filetype": RUN, "schema": np.array(SCHEMA), "complete": False, **header})
        file.attrs.update({"created": time.time(), "finished": np.nan, "wall_time": 0.0})
        scene = file.create_group("scene")
        for name, text in texts.items():
            write_text(scene, name, text)
        write_field(file, self.sim.field_record)
        tables = {"landings": LANDING, "particles": PARTICLE, "health": HEALTH, "joints": JOINT}
        for name, dtype in tables.items():
            self._table(file, name, dtype, compression="gzip", compression_opts=1, shuffle=True, fletcher32=True)
        for name in ("fed", "landed", "resident", "lost"):
            file["landings"].attrs[name] = np.zeros(2)  # count, kg
        file["landings"].attrs["closed"] = True
        collect = json.loads(texts["resolved"])["collect"]
        if collect is not None:
            self._create_bins(file.create_group("bins/landing"), collect["bins"]["n"])
        frames = file.create_group("frames")
        self._table(frames, "offset", "i8")
        self._table(frames, "time", "f8")
        for name, (kind, width) in FRAME_COLUMNS.items():
            self._table(frames, name, kind, (width,) if width else ())
        self._append("frames/offset", 0, np.zeros(1, np.int64))
        self._create_vtk(file.create_group("VTKHDF"))
        restart = file.create_group("restart")
        restart.attrs["digest"] = np.bytes_(b"0" * 64)
        for name, block in self.sim.engine.state().items():
            self._table(restart, name, block.dtype, block.shape[1:])

    def _create_vtk(self, group: h5py.Group) -> None:
        for name, kind in vtk.POINT_DATA.items():
            self._table(group, f"PointData/{name}", kind)
        for name, rows in vtk.steps(np.zeros(1, np.int64)).items():
            self._table(group, name, rows.dtype, rows.shape[1:])
        vtk.link(group)

    def _create_bins(self, group: h5py.Group, n: int) -> None:
        self._table(group, "materials", "S200")
        self._table(group, "edges", "f8")
        for name in BIN_COLUMNS:
            self._table(group, name, "i8" if name == "count" else "f8", (n,))

    def result(self) -> Run:
        """The run so far."""
        from .result import Run

        self.record_landings()
        with self._disk():
            self.file.flush()
        return Run(read_run(self.file), None, None)

    def _record_bins(self) -> None:
        bins = self.result().bins()
        self._append("bins/landing/edges", 0, bins.edges)
        self._append("bins/landing/materials", 0, np.array([name.encode()[:200] for name in bins.mass], "S200"))
        if bins.mass:  # nothing, in a scene without a feed in which nothing was put
            for name in BIN_COLUMNS:
                self._append(f"bins/landing/{name}", 0, np.stack(list(getattr(bins, name).values())))

    def _table(self, group: h5py.Group, name: str, dtype: Any, tail: tuple[int, ...] = (), **options: Any) -> None:
        chunks = (max(16, 2048 // int(np.prod(tail))), *tail)
        table = group.create_dataset(name, (0, *tail), dtype, maxshape=(None, *tail), chunks=chunks, **options)
        self.tables[table.name.lstrip("/")] = table

    def _append(self, name: str, start: int, rows: NDArray[Any]) -> int:
        table = self.tables[name]
        table.resize(start + len(rows), axis=0)
        table[start:] = rows
        return start + len(rows)

    def record_health(self) -> None:
        """One row of /health for now, and one of /joints for each joint."""
        rows = joint_rows(self.sim.time, self.sim.engine.joints)
        with self._disk():
            self._append("joints", self.healths * len(rows), rows)
            self.healths = self._append("health", self.healths, health_row(self.sim.time, self.sim.health))

    def record_landings(self) -> None:
        """What landed since the last call, and the balance now."""
        balance, rows = self.sim.balance, landing_rows(self.sim.engine.landings(self.landed))
        with self._disk():
            self.landed = self._append("landings", self.landed, rows)
            for name in ("fed", "landed", "resident", "lost"):
                amount = getattr(balance, name)
                self.tables["landings"].attrs.modify(name, np.array([amount.count, amount.kg]))
            self.tables["landings"].attrs.modify("closed", balance.closed)

    def record_frame(self, rows: NDArray[np.intp]) -> None:
        """Where the grains in some rows are now."""
        engine, end = self.sim.engine, self.framed + len(rows)
        with self._disk():
            for name in FRAME_COLUMNS:
                self._append(f"frames/{name}", self.framed, getattr(engine, name)[rows])
            for name in vtk.POINT_DATA:
                self._append(f"VTKHDF/PointData/{name}", self.framed, getattr(engine, name)[rows])
            self._append("frames/time", self.frames, np.array([engine.time]))
            self._append("frames/offset", self.frames + 1, np.array([end]))
        self.framed, self.frames = end, self.frames + 1

    def flush(self) -> None:
        """What was recorded can be read from now on, whatever happens to this process."""
        if self.part is not None:
            with self._disk():
                self.file.flush()

    def finish(self, *, complete: bool, wall_time: float) -> h5py.File | None:
        """Write particles and restart state, and give the file its name. In memory: return the open file."""
        self.record_landings()
        self.record_health()
        with self._disk():
            self._finish(complete, wall_time)
            if self.path is None or self.part is None:
                return self.file
            self.file.flush()
            self.file.close()
            replace(self.part, self.path)
        return None

    def _finish(self, complete: bool, wall_time: float) -> None:
        file, sim = self.file, self.sim
        self._append("particles", 0, particle_rows(sim))
        if "bins" in file:
            self._record_bins()
        for name, column in vtk.steps(self.tables["frames/offset"][: self.frames + 1]).items():
            self._append(f"VTKHDF/{name}", 0, column)
        file["VTKHDF/Steps"].attrs.modify("NSteps", np.int64(self.frames))
        state = sim.engine.state()
        for name, block in state.items():
            self._append(f"restart/{name}", 0, block)
        file["restart"].attrs.modify("digest", np.bytes_(state_digest(sim.toml, sim.seed, state)))
        file.attrs.modify("wall_time", wall_time)
        file.attrs.modify("finished", time.time())
        file.attrs.modify("complete", complete)

    def abandon(self) -> None:
        """Close without finishing: the .part stays, readable."""
        with suppress(OSError, RuntimeError, ValueError):
            self.file.close()


def write_field(file: h5py.File, record: Mapping[str, Any]) -> None:
    """The field that a run was given as numbers: /field, which `cesim.fields.Grid.read` reads again."""
    if not record:
        return
    group = file.create_group("field")
    for name, value in record.items():
        if isinstance(value, np.ndarray):
            group.create_dataset(name, data=value, compression="gzip", compression_opts=1, shuffle=True)
        elif isinstance(value, tuple):
            group.create_dataset(name, data=np.array(value))
        else:
            group.attrs[name] = value


def landing_rows(landings: NDArray[np.void]) -> NDArray[np.void]:
    """The engine's landings as rows of /landings."""
    rows = np.empty(len(landings), LANDING)
    for name in LANDING.names or ():
        if name in ("x", "y", "z"):
            rows[name] = landings["position"][:, "xyz".index(name)]
        else:
            rows[name] = landings["time" if name == "t" else name]
    return rows


def particle_rows(sim: Simulation) -> NDArray[np.void]:
    """One row per grain ever fed, in the order of ids."""
    gone, now = sim.engine.landings(), sim.engine
    rows = np.empty(len(gone) + now.count, PARTICLE)
    for name in ("id", "birth", "material", "mass", "diameter"):
        rows[name] = np.concatenate([gone[name], getattr(now, name)])
    permittivity = np.array([m["permittivity"] for m in sim.definition["materials"]], float)
    rows["permittivity"] = permittivity[rows["material"]]
    return rows[np.argsort(rows["id"], kind="stable")]
