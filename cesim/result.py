"""What a run reports, from memory or from its file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import files, statistics
from .arguments import seconds, whole
from .errors import InputError, show, unknown
from .health import Balance, Health
from .simulation import LANDED
from .statistics import PRODUCTS, Bins, Estimate, Sample, Splitters
from .units import to_si

if TYPE_CHECKING:
    import h5py
    import pandas as pd
    from matplotlib.figure import Figure

    from .scene import Scene
    from .scene.effects import Decisions

Lengths = Sequence[float | str]


class Run:
    """The result of `cesim.run`, or of a file by `cesim.open`.

    Grade and recovery are by mass, over what landed on the landing plane. Grains still inside at the end are not in
    them (the balance counts them), nor are grains that were lost. Splitters cut the landing plane into products, left
    to right: "insulator", "middling", "conductor". A material's product is by default the one named like its kind.
    ``recovery(m)`` is the mass of m in its product over the mass of m that landed; ``grade(m)`` is that same mass over
    all the mass in the product. Of mixtures and composites it is the mass of their grains; what they are made of counts
    in the materials that it is, so that the copper of ``recovery("copper")`` is all of it. Nothing is dropped for
    start-up unless ``warmup`` says so: a grain counts when it landed at ``warmup`` or later; "auto" finds the time.
    `notes` says when start-up shifts a grade by more than its interval.

    Attributes
    ----------
    landings : structured array, fields as in `Simulation.landings`
    health : Health at the end;  health_history : structured array, one row per output step
    joints : dict of structured arrays, name -> one row per output step: time, travel, speed, effort, power, energy, ...
        as in `Simulation.joints`
    balance : Balance at the end
    contents : name -> mass fractions of what a mixture or composite is made of
    material_names, surface_names : names behind the indices in landings
    time : simulated time, s;  wall_time : s
    seed, threads, complete, version, attrs : of the run
    effects : list of dict, one per effect and per choice: decision, size, reason, expected shift
    path : of the file, or None
    """

    def __init__(self, data: dict[str, Any], path: Path | None, frames: dict[str, NDArray[Any]] | None) -> None:
        self.path, self._frames = path, frames
        self.attrs: dict[str, Any] = data["attrs"]
        self.toml: str = data["toml"]
        self.definition: dict[str, Any] = data["resolved"]
        self.effects: list[dict[str, Any]] = data["effects"]
        self.citations: list[str] = data["citations"]
        self.name: str = self.definition["name"]
        self.material_names = tuple(self.definition["material_names"])
        self.contents: dict[str, dict[str, float]] = self.definition.get("contents") or {}
        self.surface_names = tuple(surface["name"] for surface in self.definition["surfaces"])
        self.landings, self.lost = (_landed(data["landings"], lost) for lost in (0, 1))
        # A run that was killed has no particles yet: then those that landed are known.
        self.particles: NDArray[np.void] = data["particles"] if len(data["particles"]) else data["landings"]
        self.health_history: NDArray[np.void] = data["health"]
        self.health: Health = files.health_of(self.health_history)
        self.joint_names = tuple(joint["name"] for joint in self.definition.get("joints") or [])
        self.joints: dict[str, NDArray[np.void]] = {
            name: data["joints"][i :: len(self.joint_names)] for i, name in enumerate(self.joint_names)
        }
        self.balance: Balance = files.balance_of(data)
        self.seed, self.threads = int(self.attrs["seed"]), int(self.attrs["threads"])
        self.complete, self.version = bool(self.attrs["complete"]), str(self.attrs["version"])
        self.wall_time = float(self.attrs["wall_time"]) or sum(self.health.seconds.values())
        self.time = float(self.health_history["time"][-1]) if len(self.health_history) else 0.0

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Run:
        """Read a result file, also one of a run that goes on or was killed."""
        where = Path(path)
        with files.opened(where, (files.RUN,)) as file:
            return cls(files.read_run(file), where, None)

    @classmethod
    def from_file(cls, file: h5py.File | None) -> Run:
        """Take over a result that was recorded in memory, frames and all."""
        assert file is not None
        with file:
            return cls(files.read_run(file), None, files.read_frames(file))

    # ---- what landed where -------------------------------------------------------------------------------------------

    def landings_frame(self) -> pd.DataFrame:
        """Landings as a DataFrame: material and surface by name, x, y, z [m], vx, vy, vz [m/s], SI units throughout."""
        import pandas as pd

        rows = self.landings
        columns: dict[str, Any] = {
            "id": rows["id"],
            "material": np.array(self.material_names, object)[rows["material"]],
        }
        columns |= {"t": rows["t"]}
        columns |= {axis: rows["position"][:, i] for i, axis in enumerate("xyz")}
        columns |= {f"v{axis}": rows["velocity"][:, i] for i, axis in enumerate("xyz")}
        columns |= {name: rows[name] for name in ("charge", "mass", "diameter", "birth")}
        surfaces = np.array([*self.surface_names, "none"], object)
        columns |= {"surface": surfaces[rows["surface"]], "collisions": rows["collisions"]}
        return pd.DataFrame(columns)

    @cached_property
    def materials(self) -> tuple[str, ...]:
        """Names of the materials that were fed or landed, as grains or within them."""
        rows = set(np.unique(self.landings["material"]).tolist())
        rows |= {family["material"] for family in (self.definition["feed"] or {"families": []})["families"]}
        used = {self.material_names[row] for row in rows}
        used |= {content for name in used for content in self.contents.get(name, {})}
        return tuple(name for name in self.material_names if name in used)

    @cached_property
    def warmup(self) -> float:
        """Time in s from which landings are as in the long run: 99 of 100 grains of the slowest material are this fast.

        Fast materials arrive first, so landings before it overstate them. The stay of a grain is its landing less its
        birth; materials of fewer than 20 landings do not count. It is what ``warmup="auto"`` stands for.
        """
        stay = self.landings["t"] - self.landings["birth"]
        groups = [stay[self.landings["material"] == i] for i in np.unique(self.landings["material"])]
        start = float(self.definition["feed"]["start"]) if self.definition["feed"] else 0.0
        return start + max((float(np.quantile(group, 0.99)) for group in groups if len(group) >= 20), default=0.0)

    def sample(self, warmup: float | str = 0.0) -> Sample:
        """The landings that count, as columns."""
        first = self.warmup if warmup == "auto" else seconds(warmup, "warmup")
        rows = self.landings[self.landings["t"] >= first]
        index = np.array([self.materials.index(n) if n in self.materials else -1 for n in self.material_names])
        x = np.ascontiguousarray(rows["position"][:, 0])
        return Sample(
            x,
            rows["mass"].copy(),
            index[rows["material"]],
            rows["t"].copy(),
            rows["birth"].copy(),
            self.materials,
            self.contents,
        )

    def bins(
        self,
        n: int | None = None,
        x: Lengths | None = None,
        by: str | None = "material",
        ci: float = 0.95,
        datum: float | str | None = None,
        warmup: float | str = 0.0,
    ) -> Bins:
        """Landed mass in n equal bins over a range of x; defaults from ``scene.collect``.

        Parameters
        ----------
        n : int
        x : (from, to), m or text with a unit, counted from the datum
        by : "material", "grain" (mixtures and composites under their own names), or None for all together
        ci : coverage of the intervals
        datum : m or text with a unit
        """
        collect = self._collect()
        count = whole("n", collect["bins"]["n"] if n is None else n, 1, 100_000)
        low, high = rising("x", collect["bins"]["x"] if x is None else x, 2)
        if low == high:
            raise InputError("must begin below its end", path="x", value=x, unit="m")
        edges = np.linspace(low, high, count + 1)
        return statistics.bins(self.sample(warmup), edges, by=by, ci=ci, datum=self._datum(datum))

    def splitters(
        self,
        n: int = 60,
        x: Lengths | None = None,
        datum: float | str | None = None,
        warmup: float | str = 0.0,
    ) -> Splitters:
        """Recovery and grade for every pair of two virtual splitters, each at n positions in x (ends included).

        Parameters
        ----------
        n : int
            Positions of each.
        x : two lengths, optional
            Range from the datum, m or text with a unit; default: that of the scene's bins.
        datum : length, optional
            x that positions count from; default: the scene's.
        warmup : text with a unit, s, or "auto"
            Landings before it are left out.

        Raises
        ------
        InputError
            Where the scene has no landing plane, or an argument is outside its range.
        """
        low, high = rising("x", self._collect()["bins"]["x"] if x is None else x, 2)
        positions = np.linspace(low, high, whole("n", n, 1, 2000))
        return statistics.splitters(self.sample(warmup), positions, self.products, self._datum(datum))

    # ---- grade and recovery ------------------------------------------------------------------------------------------

    @property
    def products(self) -> dict[str, str]:
        """Material -> its product: "conductor" or "insulator"."""
        kinds = {
            name: "middling" if material.get("conductor_share", 0.0) > 0.0 else material["kind"]
            for name, material in zip(self.material_names, self.definition["materials"], strict=True)
        }
        return {name: kinds[name] for name in self.materials}

    def recovery(
        self,
        material: str,
        splitters: Lengths | float | str | None = None,
        *,
        product: str | None = None,
        ci: float = 0.95,
        datum: float | str | None = None,
        warmup: float | str = 0.0,
    ) -> Estimate:
        """Mass of a material in its product over the mass of it that landed, with its interval.

        Parameters
        ----------
        material : name
        splitters : (left, right) or one position, m or text with a unit, from the datum; default: those of the scene
        product : "insulator", "middling" or "conductor"; default: by the material's kind
        """
        sample, place = self._cut(splitters, datum, warmup)
        whole_of = sample.share(material)
        return statistics.fraction(sample, place == self._product(material, product), whole_of, ci)

    def grade(
        self,
        material: str,
        splitters: Lengths | float | str | None = None,
        *,
        product: str | None = None,
        ci: float = 0.95,
        datum: float | str | None = None,
        warmup: float | str = 0.0,
    ) -> Estimate:
        """Mass of a material in its product over all mass in that product; parameters as `recovery`."""
        sample, place = self._cut(splitters, datum, warmup)
        whole_of = place == self._product(material, product)
        return statistics.fraction(sample, sample.share(material), whole_of, ci)

    def share(
        self,
        product: str = "middling",
        splitters: Lengths | float | str | None = None,
        *,
        ci: float = 0.95,
        datum: float | str | None = None,
        warmup: float | str = 0.0,
    ) -> Estimate:
        """Share of a product in the landed mass, with its interval."""
        sample, place = self._cut(splitters, datum, warmup)
        if product not in PRODUCTS:
            raise unknown("product", product, PRODUCTS).at("product")
        everything = np.full(len(place), True)
        return statistics.fraction(sample, place == PRODUCTS.index(product), everything, ci)

    def middlings(self, splitters: Lengths | float | str | None = None, **options: Any) -> Estimate:
        """Share of the landed mass that landed between the splitters; options as `share`."""
        return self.share("middling", splitters, **options)

    def estimate(
        self, quantity: str, splitters: Lengths | None = None, *, ci: float = 0.95, warmup: float | str = 0.0
    ) -> Estimate:
        """A quantity by name, with its interval.

        Parameters
        ----------
        quantity : str
            "recovery[copper]", "grade[copper]", "middling", "mean_x[copper]" or "spread_x[copper]" (both in m).
        warmup : text with a unit, s, or "auto" (see `warmup`)
        """
        from .accuracy.quantity import Quantity

        return Quantity(quantity).of(self, ci, warmup, splitters)

    def places(self, splitters: Lengths | None = None, warmup: float | str = 0.0) -> NDArray[np.intp]:
        """For each grain of `sample`, the index in `cesim.statistics.PRODUCTS` of the product it landed in."""
        return self._cut(splitters, None, warmup)[1]

    def _product(self, material: str, product: str | None) -> int:
        name = product or self.products.get(material, "conductor")
        if name not in PRODUCTS:
            raise unknown("product", name, PRODUCTS).at("product")
        return PRODUCTS.index(name)

    def _cut(self, splitters: Any, datum: Any, warmup: Any) -> tuple[Sample, NDArray[np.intp]]:
        """The sample, and for each grain the row of PRODUCTS that it landed in."""
        given = self.default_splitters if splitters is None else splitters
        if isinstance(given, str) or np.ndim(given) == 0:
            given = (given, given)
        left, right = rising("splitters", tuple(given) * (3 - len(given)) if len(given) == 1 else given, 2)
        sample = self.sample(warmup)
        return sample, np.searchsorted(np.array([left, right]), sample.x - self._datum(datum), side="right")

    @property
    def default_splitters(self) -> tuple[float, float]:
        """The scene's splitters, m from the datum: ``collect.splitters``, or blades prolonged to the landing plane."""
        chosen = self._collect()["splitters"]
        if chosen is None:
            raise InputError("are not in this scene: give two positions, such as ('80 mm', '140 mm')", path="splitters")
        return float(chosen[0]), float(chosen[1])

    def _collect(self) -> dict[str, Any]:
        collect: dict[str, Any] | None = self.definition["collect"]
        if collect is None:
            raise InputError("is missing: this scene has no landing plane", path="collect")
        return collect

    def _datum(self, datum: Any) -> float:
        return float(self._collect()["datum"]) if datum is None else length("datum", datum)

    # ---- more --------------------------------------------------------------------------------------------------------

    @property
    def frames(self) -> dict[str, NDArray[Any]]:
        """Recorded positions, flat: frame f is rows offset[f]:offset[f + 1] of the columns.

        time (F,) [s], offset (F + 1,), id (n,), position (n, 3) [m], orientation (n, 4), velocity (n, 3) [m/s],
        charge (n,) [C].
        """
        if self._frames is None:
            assert self.path is not None
            with files.opened(self.path, (files.RUN,)) as file:
                self._frames = files.read_frames(file)
        return self._frames

    def trajectories(self) -> dict[int, tuple[NDArray[np.float64], NDArray[np.float32]]]:
        """Recorded paths, to the landing where there was one: id -> (time (k,) [s], position (k, 3) [m])."""
        frames, ends = self.frames, self.landings[np.isin(self.landings["id"], self.frames["id"])]
        ids = np.concatenate([frames["id"], ends["id"]])
        when = np.concatenate([np.repeat(frames["time"], np.diff(frames["offset"])), ends["t"]])
        position = np.concatenate([frames["position"], ends["position"].astype(np.float32)])
        order = np.argsort(ids, kind="stable")
        names, starts = np.unique(ids[order], return_index=True)
        pieces = zip(names.tolist(), np.split(order, starts[1:]), strict=False) if len(names) else ()
        return {i: (when[rows], position[rows]) for i, rows in pieces}

    def materials_of(self, ids: NDArray[np.int64]) -> list[str]:
        """Names of the materials of some grains, "" where the file does not know them."""
        order = np.argsort(self.particles["id"], kind="stable")
        known = self.particles["id"][order]
        row = np.minimum(np.searchsorted(known, ids), max(len(known) - 1, 0))
        found = known[row] == ids if len(known) else np.full(len(ids), False)
        index = self.particles["material"][order][row] if len(known) else np.zeros(len(ids), int)
        return [self.material_names[m] if ok else "" for m, ok in zip(index, found, strict=True)]

    @property
    def scene(self) -> Scene:
        """The scene that was run."""
        from .scene import Scene

        return Scene.from_toml(self.toml)

    @property
    def decisions(self) -> Decisions:
        """The decisions of this run, as `scene.effects()` gave them when it began."""
        from .scene.effects import Decisions

        return Decisions.of(self.effects, list(self.materials))

    @property
    def notes(self) -> list[str]:
        """What a reader of the figures must know."""
        from .table import notes

        return notes(self)

    def plot(self, path: str | os.PathLike[str] | None = None, splitters: Lengths | None = None) -> Figure:
        """Machine, trajectories and landing histogram; written to ``path`` (png, svg, pdf) if given."""
        from .plots import draw_run

        return draw_run(self, None if path is None else Path(path), splitters)

    def __str__(self) -> str:
        from .table import table

        return table(self)

    def __repr__(self) -> str:
        end = "" if self.complete else ", incomplete"
        return f"<cesim.Run of {self.name!r}, seed {self.seed}: {self.time:.4g} s, {len(self.landings)} landed{end}>"


def length(name: str, value: Any) -> float:
    """A position in m from text with a unit or a number."""
    try:
        return to_si(value, "m", -1e3, 1e3)
    except InputError as error:
        raise error.at(name) from None


def rising(name: str, value: Any, n: int) -> list[float]:
    """n positions in m that do not fall."""
    if isinstance(value, str) or np.ndim(value) != 1 or len(value) != n:
        raise InputError(f"is {show(value)}, must be {n} positions", path=name, value=value, unit="m")
    positions = [length(f"{name}[{i}]", v) for i, v in enumerate(value)]
    if any(b < a for a, b in pairwise(positions)):
        raise InputError(f"is {show(value)}, must rise", path=name, value=value, unit="m")
    return positions


def _landed(rows: NDArray[np.void], lost: int) -> NDArray[np.void]:
    kept = rows[rows["lost"] == lost]
    result = np.empty(len(kept), LANDED)
    for name in LANDED.names or ():
        result[name] = np.stack([kept[a] for a in "xyz"], axis=-1) if name == "position" else kept[name]
    return result


def open_run(path: str | os.PathLike[str]) -> Run:
    """Read a result file, also one of a run that goes on or was killed: `Run.load`."""
    return Run.load(path)
