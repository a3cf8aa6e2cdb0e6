"""Were the decisions right? Each one switched over on a sample of the feed, with the same random numbers."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .. import statistics
from ..arguments import seconds, whole
from ..errors import InputError, show, unknown
from ..result import Run
from ..scene.choices import grain_rate
from ..scene.composites import grain_materials
from ..scene.effects import FLIGHT_SHIFT, THRESHOLD, Decision
from ..simulation import Simulation
from ..statistics import Estimate, Sample
from .prediction import predict
from .toggle import STRENGTH, can_act, toggled

if TYPE_CHECKING:
    import pandas as pd

    from ..scene import Scene

LEAST_SHIFT = FLIGHT_SHIFT * THRESHOLD  # m, a quarter of a splitter step: what a dropped choice must stay below
SPLITTER_STEP = 4.0 * LEAST_SHIFT  # m, what no dropped effect may shift, however uncertain its law
MOST_AMPLIFIED = 1e3  # beyond, hardly anything answers in proportion
LOOK = 0.05  # s between two looks at whether all grains have landed
FORMAT = "cesim-audit"
IDLE = "nothing to switch"
END = np.dtype(
    [("id", "i8"), ("material", "i4"), ("mass", "f8"), ("birth", "f8"), ("t", "f8"), ("x", "f8"), ("landed", "?")]
)
Ends = NDArray[np.void]


@dataclass(frozen=True)
class AuditRow:
    """What one decision does to one material.

    Attributes
    ----------
    name, kind, on : of the decision, as in `Decision`
    size, threshold : dimensionless
    material : str
    predicted : float
        Expected mean landing x with the effect less that without it, in m; NaN: only the bound is known.
    measured, low, high : float
        The same, measured, in m, weighted by mass, with its interval; NaN: nothing was there to measure.
    least : float
        What counts as a shift for this decision, in m: 0.24 m x the threshold of an effect, at most a splitter step.
    pairs : int
        Grains compared.
    landed : float
        Share of them that landed both times; the others count where they were lost or still inside at the end.
    verdict : str
        Of what is off: "confirmed", "wrong" or "not resolved"; of what is on: "needed", "spare" or "not resolved";
        "nothing to switch" where there is no other way.
    amplified : float
        How many times as strong the effect was when it was switched on; what was measured is divided by it.
    """

    name: str
    kind: str
    on: bool
    size: float
    threshold: float
    material: str
    predicted: float
    measured: float
    low: float
    high: float
    least: float
    pairs: int
    landed: float
    verdict: str
    amplified: float = 1.0


class Audit:
    """The result of an audit: one row per decision and material. Prints as a table.

    Attributes
    ----------
    scene : str
        Name of the scene.
    seed, grains : int
    rows : list of AuditRow
    """

    def __init__(self, scene: str, seed: int, grains: int, rows: list[AuditRow]) -> None:
        self.scene, self.seed, self.grains, self.rows = scene, seed, grains, rows

    def __iter__(self) -> Iterator[AuditRow]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def having(self, verdict: str) -> list[AuditRow]:
        """The rows with a verdict."""
        return [row for row in self.rows if row.verdict == verdict]

    @property
    def wrong(self) -> list[AuditRow]:
        """Decisions to drop an effect that shifts a landing by more than the least that counts."""
        return self.having("wrong")

    @property
    def unresolved(self) -> list[AuditRow]:
        """Decisions to drop an effect on which this sample cannot say; ask for more grains."""
        return [row for row in self.having("not resolved") if not row.on]

    def to_pandas(self) -> pd.DataFrame:
        """One row per decision and material; the columns are those of `AuditRow`."""
        import pandas

        return pandas.DataFrame([dataclasses.asdict(row) for row in self.rows])

    def to_json(self) -> str:
        """All of it as JSON text; what is not known is null."""
        rows = [
            {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in dataclasses.asdict(row).items()}
            for row in self.rows
        ]
        head = {"format": FORMAT, "scene": self.scene, "seed": self.seed, "grains": self.grains}
        return json.dumps(head | {"rows": rows}, indent=1) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Audit:
        """Reads `to_json`."""
        try:
            data = json.loads(text)
            if data["format"] != FORMAT:
                raise KeyError(data["format"])
            rows = [_read_row(row) for row in data["rows"]]
            return cls(data["scene"], data["seed"], data["grains"], rows)
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"the text is not an audit: {error}") from None

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the audit: HDF5 (attribute ``audit`` of the file) for .h5 and .hdf5, JSON text for any other ending."""
        target = Path(path)
        if target.suffix in (".h5", ".hdf5"):
            import h5py

            with h5py.File(target, "w") as file:
                file.attrs["filetype"] = FORMAT
                file.create_dataset("audit", data=self.to_json())
        else:
            target.write_text(self.to_json(), encoding="utf-8")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Audit:
        """Read what `save` wrote."""
        source = Path(path)
        try:
            if source.suffix in (".h5", ".hdf5"):
                import h5py

                with h5py.File(source, "r") as file:
                    return cls.from_json(file["audit"][()].decode("utf-8"))
            return cls.from_json(source.read_text(encoding="utf-8"))
        except (OSError, KeyError) as error:
            raise InputError(f"{show(str(path))} is not an audit: {error}", value=str(path)) from None

    def __str__(self) -> str:
        head = (
            "decision",
            "on?",
            "size",
            "material",
            "predicted",
            "measured shift of landing x",
            "counts from",
            "verdict",
        )
        table = [head, *(_cells(row) for row in self.rows)]
        widths = [max(len(cell) for cell in column) for column in zip(*table, strict=True)]
        lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in table]
        title = f"{self.scene}, seed {self.seed}: {self.grains} grains, each decision switched over"
        return "\n".join([title, *(line.rstrip() for line in lines), self.summary()])

    def summary(self) -> str:
        """One line: how many decisions were confirmed, and which were wrong."""
        off = [row for row in self.rows if not row.on and row.verdict != IDLE]
        wrong = ", ".join(f"{row.name} ({row.material})" for row in self.wrong)
        return (
            f"of {len(off)} decisions to leave out, {len([r for r in off if r.verdict == 'confirmed'])} confirmed, "
            f"{len(self.unresolved)} not resolved, {len(self.wrong)} wrong" + (f": {wrong}" if wrong else "")
        )

    __repr__ = __str__


def audit(
    what: Run | Scene,
    *,
    grains: int = 2000,
    seed: int | None = None,
    effects: Sequence[str] | None = None,
    amplify: Mapping[str, float] | None = None,
    longest: float | str = "4 s",
    ci: float = 0.95,
    threads: int | None = None,
    progress: bool = True,
) -> Audit:
    """Switch each decision over on a sample of the feed and measure how far the mean landing moves.

    The sample is the beginning of the feed, the same grains each time: random numbers depend on seed, grain and draw
    alone, so differences are taken grain by grain and need few grains. The feed stops after the sample, and the run
    goes on until all have landed. An effect that is off and shifts a material's mean landing by more than 0.24 m x its
    threshold (0.84 mm for most; for choices, too), interval and all, was dropped wrongly.

    Parameters
    ----------
    what : Run or Scene
        A run is audited with its own scene and seed.
    grains : int
        Size of the sample.
    seed : int, optional
        Default: the run's, or 1.
    effects : names, optional
        Decisions to look at; default: all.
    amplify : effect -> factor, optional
        What is off comes on so many times as strong, and the shift is divided by the factor. Where charged grains
        push each other about, the least change sends each elsewhere and drowns a small effect; the mean of many still
        answers it in proportion, so that the scatter shrinks by the factor. For effects with a parameter "strength".
    longest : text with a unit, or s
        How long after the last birth a grain is waited for.
    ci : float
        Coverage of the intervals.
    threads : int, optional
        As in `cesim.Simulation`.
    progress : bool
        Show a progress bar, where stderr is a terminal or a notebook.

    Returns
    -------
    Audit
        The same, to the last bit, for the same scene, seed and number of grains.
    """
    count, wait = whole("grains", grains, 1, 10**7), seconds(longest, "longest")
    scene = (what.scene if isinstance(what, Run) else what).validated()
    number = seed if seed is not None else what.seed if isinstance(what, Run) else 1
    decisions = predict(scene)
    sampled = _sampled(scene, count)
    chosen = [decisions[name] for name in effects] if effects is not None else decisions.rows
    chosen = [row for row in chosen if row.name != "gravity"]
    factors = _factors(amplify or {}, chosen)
    others = {row.name: toggled(sampled, row, factors[row.name]) if can_act(row) else None for row in chosen}
    rows: list[AuditRow] = []
    index = {name: list(grain_materials(scene)).index(name) for name in decisions.materials}
    with _progress(1 + sum(other is not None for other in others.values()), progress) as done:
        here = _run(sampled, number, wait, threads)
        done()
        for row in chosen:
            other = others[row.name]
            if other is None:
                rows += [_idle(row, name) for name in index]
                continue
            there = _run(other, number, wait, threads)
            rows += [
                _compared(row, name, material, here, there, ci, factors[row.name]) for name, material in index.items()
            ]
            done()
    return Audit(scene.name, number, count, rows)


def _factors(amplify: Mapping[str, float], rows: Sequence[Decision]) -> dict[str, float]:
    """How many times as strong each decision's effect comes on."""
    known = {row.name: row for row in rows}
    for name, factor in amplify.items():
        path, row = f"amplify[{name}]", known.get(name)
        if row is None:
            raise unknown("decision that is looked at", name, known).at("amplify")
        if STRENGTH not in row.parameters:
            raise InputError(f"has no parameter {STRENGTH!r}", path=path)
        if row.on:
            raise InputError("is on: only what is left out can be amplified", path=path)
        if not 1.0 <= factor <= MOST_AMPLIFIED:
            raise InputError(f"is {factor!r}, outside [1, {MOST_AMPLIFIED:g}]", path=path, value=factor)
    return {name: float(amplify.get(name, 1.0)) for name in known}


def _sampled(scene: Scene, grains: int) -> Scene:
    """The scene with a feed that stops after so many grains."""
    rate = grain_rate(scene)
    if scene.feed is None or not rate > 0.0:
        raise InputError("has no feed to take a sample of", path=scene.name)
    if scene.collect is None:
        raise InputError("is missing: this scene has no landing plane", path="collect")
    sampled = scene.model_copy(deep=True)
    assert sampled.feed is not None
    stop = sampled.feed.start + grains / rate
    sampled.feed.stop = stop if sampled.feed.stop is None else min(stop, sampled.feed.stop)
    return sampled


def _run(scene: Scene, seed: int, wait: float, threads: int | None) -> NDArray[np.void]:
    """Where each grain of the sample came to its end: landed, lost, or where it was when the wait was over."""
    sim = Simulation(scene, seed, threads)
    assert scene.feed is not None
    assert scene.feed.stop is not None
    stop, end = scene.feed.stop, scene.feed.stop + wait
    while sim.time < stop or (sim.count and sim.time < end):
        sim.step(max(sim.steps_to(min(sim.time + LOOK, end)), 1))
    inside = np.zeros(sim.count, END)
    for name in ("id", "material", "mass", "birth"):
        inside[name] = sim.ids if name == "id" else getattr(sim, name)
    inside["x"], inside["t"] = sim.position[:, 0], sim.time
    gone = []
    for rows, landed in ((sim.landings, True), (sim.lost, False)):
        ends = np.zeros(len(rows), END)
        for name in ("id", "material", "mass", "birth", "t"):
            ends[name] = rows[name]
        ends["x"], ends["landed"] = rows["position"][:, 0], landed
        gone.append(ends)
    return np.sort(np.concatenate([*gone, inside]), order="id")


def _compared(
    row: Decision, material: str, index: int, here: Ends, there: Ends, ci: float, amplified: float = 1.0
) -> AuditRow:
    """The shift of one material, grain by grain."""
    _, a, b = np.intersect1d(here["id"], there["id"], assume_unique=True, return_indices=True)
    mine = here["material"][a] == index
    one, other = here[a[mine]], there[b[mine]]
    moved = (one["x"] - other["x"]) * (1.0 if row.on else -1.0) / amplified
    # Blocks of the stream as it was fed: grains that are still inside at the end all have the same last moment.
    earlier = 2.0 * one["birth"] - one["t"]
    sample = Sample(one["x"], one["mass"], one["material"], one["birth"], earlier, (material,))
    shift = statistics.mean(moved, sample, np.full(len(moved), True), ci)
    return AuditRow(
        **_head(row, material),
        measured=float(shift),
        low=shift.low,
        high=shift.high,
        pairs=len(moved),
        landed=float(np.mean(one["landed"] & other["landed"])) if len(moved) else math.nan,
        verdict=_verdict(row.on, shift, _least(row)),
        amplified=amplified,
    )


def _idle(row: Decision, material: str) -> AuditRow:
    nothing = math.nan
    return AuditRow(
        **_head(row, material), measured=nothing, low=nothing, high=nothing, pairs=0, landed=nothing, verdict=IDLE
    )


def _read_row(row: dict[str, Any]) -> AuditRow:
    values: dict[str, Any] = {name: math.nan if value is None else value for name, value in row.items()}
    return AuditRow(**values)


def _head(row: Decision, material: str) -> dict[str, Any]:
    columns = {name: getattr(row, name) for name in ("name", "kind", "on", "size", "threshold")}
    return columns | {"material": material, "least": _least(row), "predicted": row.shifts.get(material, math.nan)}


def _least(row: Decision) -> float:
    return min(FLIGHT_SHIFT * row.threshold, SPLITTER_STEP) if row.kind == "effect" else LEAST_SHIFT


def _verdict(on: bool, shift: Estimate, least: float) -> str:
    if shift.low > least or shift.high < -least:
        return "needed" if on else "wrong"
    if shift.low > -least and shift.high < least:
        return "spare" if on else "confirmed"
    return "not resolved"


def _cells(row: AuditRow) -> tuple[str, ...]:
    measured = "-"
    if row.verdict != IDLE:
        measured = f"{1e3 * row.measured:+.3g} [{1e3 * row.low:+.3g}, {1e3 * row.high:+.3g}] mm"
    predicted = "-" if math.isnan(row.predicted) else f"{1e3 * row.predicted:+.3g} mm"
    size = "-" if math.isnan(row.size) else f"{row.size:.3g}"
    return (
        row.name if row.amplified == 1.0 else f"{row.name} x {row.amplified:g}",
        "on" if row.on else "off",
        size,
        row.material,
        predicted,
        measured,
        f"{1e3 * row.least:.2g} mm",
        row.verdict,
    )


@contextmanager
def _progress(total: int, progress: bool) -> Iterator[Callable[[], object]]:
    """Counts runs on a bar, where somebody watches."""
    if not (progress and (sys.stderr.isatty() or "ipykernel" in sys.modules)):
        yield lambda: None
        return
    from tqdm import tqdm

    with tqdm(total=total, unit=" runs", desc="audit", leave=False) as bar:
        yield bar.update
