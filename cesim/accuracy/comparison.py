"""Two answers beside each other: the same, different, or not resolved with this number of grains."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, show
from ..statistics import DRAWS, Array, Estimate, draws, sums, time_blocks
from ..units import to_si
from .quantity import Difference, Quantity, difference

if TYPE_CHECKING:
    import pandas as pd

    from ..result import Run

SHARE_TOLERANCE, LENGTH_TOLERANCE = 0.01, 1e-3  # m
LARGEST_FILE = 10_000_000  # bytes


@dataclass(frozen=True)
class Row:
    """One quantity of a comparison."""

    quantity: str
    unit: str
    first: float
    second: float
    difference: Estimate
    correlation: float  #: of the two over the draws, NaN: not paired
    tolerance: float
    verdict: str  #: "same", "different" or "not resolved"
    more: float  #: how many times as many grains would resolve it, about; 1 where it is resolved

    def __str__(self) -> str:
        scale, unit = (1e3, " mm") if self.unit == "m" else (1.0, "")
        low, high = scale * self.difference.low, scale * self.difference.high
        more = f", about {self.more:.0f} times the grains would" if self.more > 1.0 else ""
        return (
            f"{self.quantity:<18} {scale * self.first:10.4f} {scale * self.second:10.4f}   "
            f"{scale * float(self.difference):+.4f} [{low:+.4f}, {high:+.4f}]{unit}, tolerance "
            f"{scale * self.tolerance:g}{unit}: {self.verdict}{more}"
        )


@dataclass(frozen=True)
class Comparison:
    """The outcome of `compare`.

    Attributes
    ----------
    rows : one per quantity
    ci : coverage of the intervals, all of them together
    """

    rows: tuple[Row, ...]
    ci: float

    @property
    def verdict(self) -> str:
        """ "different" if any quantity is, "same" if all are, else "not resolved"."""
        verdicts = {row.verdict for row in self.rows}
        return "different" if "different" in verdicts else "same" if verdicts == {"same"} else "not resolved"

    def __getitem__(self, quantity: str) -> Row:
        for row in self.rows:
            if row.quantity == quantity:
                return row
        raise KeyError(quantity)

    def to_pandas(self) -> pd.DataFrame:
        """One row per quantity; lengths in m."""
        import pandas

        ends = [{"low": row.difference.low, "high": row.difference.high} for row in self.rows]
        return pandas.DataFrame([{**vars(row), **end} for row, end in zip(self.rows, ends, strict=True)])

    def __str__(self) -> str:
        head = f"{'':<18} {'first':>10} {'second':>10}   difference [{100 * self.ci:g} %, all together]"
        return "\n".join([head, *map(str, self.rows), f"together: {self.verdict}"])


def compare(
    a: Run,
    b: Run | str | os.PathLike[str],
    quantities: Sequence[str] | None = None,
    *,
    tolerance: float | str | Mapping[str, float | str] | None = None,
    ci: float = 0.95,
    warmup: float | str = "auto",
) -> Comparison:
    """Compare two runs, or a run with measured bins.

    Parameters
    ----------
    a : Run
    b : Run, or path of a CSV file
        The file has the columns left, right (m from the run's datum), mass (any unit) and, unless all materials were
        weighed together, material; as `Bins.to_pandas` and `cesim bins --csv` write them. A column count or n_eff tells
        how many grains (independent ones) stand behind a bin; without, the masses are taken as exact.
    quantities : names, optional
        Default: for two runs recovery and grade of each material and the middlings, where there are splitters, and the
        mean landing x; for a file the Wasserstein distance W1 of each material's distribution over the bins, and its
        mean landing x ("w1[copper]", "mean_x[copper]").
    tolerance : number, text with a unit, or quantity -> either
        What counts as the same. Default: 0.01 of a share, 1 mm of a length.
    ci : coverage of the intervals, for all quantities together (Bonferroni)
    warmup : as in `Run.recovery`

    Returns
    -------
    Comparison
        Per quantity "same": the whole interval of the difference is within the tolerance (two one-sided tests,
        Schuirmann, J. Pharmacokinet. Biopharm. 15 (1987) 657); "different": it excludes 0; "not resolved" else.

    Raises
    ------
    InputError
        Where a file cannot be used, or a quantity is unknown.

    Notes
    -----
    Runs of one feed and seed are paired grain by grain in blocks (`cesim.accuracy.difference`). The interval of W1
    comes from the triangle inequality: the run's distribution is as near to its own truth as W1(draw, run) says.
    """
    if isinstance(b, str | os.PathLike):
        rows = _with_file(a, read_bins(b), ci, warmup, quantities)
    else:
        names = _names(a, b) if quantities is None else list(quantities)
        each = 1.0 - (1.0 - ci) / max(len(names), 1)
        rows = [_of_runs(Quantity(name), a, b, each, warmup) for name in names]
    return Comparison(tuple(_judged(row, tolerance) for row in rows), ci)


def _names(a: Run, b: Run) -> list[str]:
    if set(a.materials) != set(b.materials):
        raise InputError(f"differ: {', '.join(a.materials)} and {', '.join(b.materials)}", path="materials")
    names = [f"mean_x[{name}]" for name in a.materials]
    if all((run.definition["collect"] or {}).get("splitters") is not None for run in (a, b)):
        names += [f"{kind}[{name}]" for kind in ("recovery", "grade") for name in a.materials] + ["middling"]
    return names


@dataclass(frozen=True)
class _Measured:
    """A quantity of both sides, before the verdict."""

    quantity: str
    unit: str
    first: float
    second: float
    difference: Difference


def _of_runs(quantity: Quantity, a: Run, b: Run, ci: float, warmup: float | str) -> _Measured:
    # One warm-up for both, the longer: else the same grains would not be in both.
    first = max(a.warmup, b.warmup) if warmup == "auto" else warmup
    found = difference(quantity, [a], [b], ci=ci, warmup=first)
    values = [float(quantity.of(run, ci, first)) for run in (a, b)]
    return _Measured(quantity.name, quantity.unit, values[0], values[1], found)


def _judged(row: _Measured, tolerance: Any) -> Row:
    given = tolerance.get(row.quantity) if isinstance(tolerance, Mapping) else tolerance
    if given is None:
        given = LENGTH_TOLERANCE if row.unit == "m" else SHARE_TOLERANCE
    try:
        allowed = to_si(given, row.unit, 0.0, 1e3)
    except InputError as error:
        raise error.at("tolerance") from None
    estimate, verdict = row.difference.value, row.difference.verdict(allowed)
    more = 1.0
    if verdict == "not resolved":
        room = abs(allowed - abs(float(estimate)))
        more = math.ceil((estimate.halfwidth / room) ** 2) if room > 0.0 and estimate.halfwidth >= 0.0 else math.inf
    return Row(
        row.quantity, row.unit, row.first, row.second, estimate, row.difference.correlation, allowed, verdict, more
    )


# ---- measured bins ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class MeasuredBins:
    """One material of a file: edges (k + 1,) m, mass (k,), and the grains behind each bin, or None."""

    edges: Array
    mass: Array
    count: Array | None


def read_bins(path: str | os.PathLike[str]) -> dict[str, MeasuredBins]:
    """Measured bins by material; "all" where the file has no column material.

    Raises
    ------
    InputError
        With the file and the line: no such file, a missing column, a number that is none, bins that do not join.
    """
    file = Path(path)
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise InputError(f"is larger than {LARGEST_FILE // 1_000_000} MB", path=str(file))
        with file.open(encoding="utf-8-sig", newline="") as stream:
            rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot be read: {error}", path=str(file)) from None
    if not rows:
        raise InputError("has no rows", path=str(file))
    missing = [name for name in ("left", "right", "mass") if name not in rows[0]]
    if missing:
        raise InputError(f"lacks the column {missing[0]!r}; needed are left, right, mass", path=str(file))
    groups: dict[str, list[tuple[float, ...]]] = {}
    counted = next((name for name in ("n_eff", "count") if name in rows[0]), None)
    for i, row in enumerate(rows):
        names = ["left", "right", "mass", *([counted] if counted else [])]
        groups.setdefault(row.get("material") or "all", []).append(
            tuple(_number(row[name], file, i, name) for name in names)
        )
    return {name: _joined(np.array(sorted(group)), file, name) for name, group in groups.items()}


def _number(text: Any, file: Path, row: int, name: str) -> float:
    try:
        value = float(text)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value) or (value < 0.0 and name not in ("left", "right")):
        raise InputError(
            f"is {show(text)}, must be a finite number, a mass not below 0", path=f"{file}, row {row + 1}, {name}"
        )
    return value


def _joined(table: Array, file: Path, name: str) -> MeasuredBins:
    left, right, mass = table[:, 0], table[:, 1], table[:, 2]
    if not (right > left).all() or not np.allclose(left[1:], right[:-1], rtol=0.0, atol=1e-9):
        raise InputError(f"has bins of {name} that overlap, or leave gaps", path=str(file))
    if not mass.sum() > 0.0:
        raise InputError(f"has no mass of {name}", path=str(file))
    return MeasuredBins(np.append(left, right[-1]), mass, table[:, 3] if table.shape[1] > 3 else None)


def _with_file(
    run: Run, measured: Mapping[str, MeasuredBins], ci: float, warmup: float | str, wanted: Sequence[str] | None
) -> list[_Measured]:
    strangers = [name for name in measured if name not in (*run.materials, "all")]
    if strangers:
        raise InputError(f"has {strangers[0]!r}, the run has {', '.join(run.materials)}", path="material")
    names = [f"{kind}[{name}]" for name in measured for kind in ("w1", "mean_x")]
    chosen = names if wanted is None else list(wanted)
    for name in chosen:
        if name not in names:
            raise InputError(f"is {show(name)}, of bins there are {', '.join(names)}", path="quantities")
    each = 1.0 - (1.0 - ci) / max(len(chosen), 1)
    found: dict[str, _Measured] = {}
    for name, bins in measured.items():
        found |= _bins_apart(run, name, bins, each, warmup)
    return [found[name] for name in chosen]


def _bins_apart(run: Run, name: str, bins: MeasuredBins, ci: float, warmup: float | str) -> dict[str, _Measured]:
    """W1 and the mean of one material, run against file, both counted into the file's bins."""
    sample = run.sample(warmup)
    share = np.ones(len(sample.x)) if name == "all" else sample.share(name)
    datum = float(run.definition["collect"]["datum"])
    k = len(bins.mass)
    slot = np.searchsorted(bins.edges, sample.x - datum, side="right") - 1
    mine = (share > 0) & (slot >= 0) & (slot < k)
    if not mine.any():
        raise InputError(f"has no grain of {name} within the bins of the file", path="run")
    block, blocks = time_blocks(sample.time, sample.birth)
    table = sums(block[mine] * k + slot[mine], (sample.mass * share)[mine], blocks * k).reshape(blocks, k)
    own, theirs = table.sum(axis=0) / table.sum(), bins.mass / bins.mass.sum()
    drawn = draws(blocks) @ table
    drawn = drawn[drawn.sum(axis=1) > 0.0]
    drawn /= drawn.sum(axis=1, keepdims=True)
    others = _redrawn(theirs, bins.count)
    width, middle = np.diff(bins.edges), 0.5 * (bins.edges[1:] + bins.edges[:-1])

    def w1(p: Array, q: Array) -> Array:
        distance: Array = np.abs(np.cumsum(p - q, axis=-1)) @ width
        return distance

    distance = float(w1(own, theirs))
    band = float(np.quantile(w1(drawn, own), ci) + np.quantile(w1(others, theirs), ci))
    mean, other = float(own @ middle), float(theirs @ middle)
    half = float(np.quantile(np.abs((drawn - own) @ middle), ci) + np.quantile(np.abs((others - theirs) @ middle), ci))
    apart = mean - other
    low = max(distance - band, 0.0)
    return {
        f"w1[{name}]": _Measured(
            f"w1[{name}]", "m", distance, 0.0, Difference(Estimate(distance, low, distance + band), math.nan)
        ),
        f"mean_x[{name}]": _Measured(
            f"mean_x[{name}]", "m", mean, other, Difference(Estimate(apart, apart - half, apart + half), math.nan)
        ),
    }


def _redrawn(share: Array, count: Array | None) -> Array:
    """Measured shares drawn anew from the grains behind them, (DRAWS, k); the same where their number is not known."""
    if count is None:
        return np.broadcast_to(share, (2, len(share)))
    n = max(int(np.sum(count)), 1)
    return np.random.default_rng(20140724).multinomial(n, share, size=DRAWS) / n
