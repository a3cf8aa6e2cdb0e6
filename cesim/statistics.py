"""Bins, grade and recovery, with their uncertainty, from what landed where.

Masses are counted in whole numbers of a small unit, so that sums are exact: bins plus what fell outside them is the
landed mass to the last bit, and a table built from cumulative sums equals a recount grain by grain.

Intervals come from a block bootstrap over time. Neighbours in the stream collide and shadow each other, so single
grains are not independent draws, but stretches of the stream longer than a grain's stay are nearly so.

* Blocks: equal stretches of landing time, as long as the median grain is under way (landing less birth), but at least
  10 and at most 100 of them, and at least two grains a block on average. Below five blocks there is no interval (NaN).
* The bootstrap (2 000 draws of whole blocks, fixed seed) gives the variance of a fraction p; p (1 - p) / variance is
  its effective number of grains, never more than Kish's (sum m)^2 / sum m^2. The interval is Wilson's for that number,
  with Student's t for the number of blocks: it stays inside [0, 1] and keeps its width where p is 0 or 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError, show, unknown

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
LEAST_BLOCKS, MOST_BLOCKS, FEWEST_FOR_INTERVAL = 10, 100, 5
DRAWS = 2000


class Estimate(float):
    """A number with its interval; everywhere else an ordinary float.

    Attributes
    ----------
    low, high : float
        Ends of the interval, NaN where there were too few grains for one.
    n_eff : float
        Effective number of independent grains behind it.
    """

    low: float
    high: float
    n_eff: float

    def __new__(cls, value: float, low: float = np.nan, high: float = np.nan, n_eff: float = np.nan) -> Estimate:
        self = super().__new__(cls, value)
        self.low, self.high, self.n_eff = float(low), float(high), float(n_eff)
        return self

    def __getnewargs__(self) -> tuple[float, float, float, float]:  # type: ignore[override]
        return (float(self), self.low, self.high, self.n_eff)

    @property
    def halfwidth(self) -> float:
        """Half the length of the interval."""
        return (self.high - self.low) / 2

    def __repr__(self) -> str:
        if np.isnan(self.low):
            return f"{float(self):.4g} (no interval)"
        return f"{float(self):.4g} [{self.low:.4g}, {self.high:.4g}]"

    __str__ = __repr__


@dataclass(frozen=True)
class Sample:
    """What landed: one entry a grain.

    Attributes
    ----------
    x : (n,) m, landing position
    mass : (n,) kg
    material : (n,) index into names
    time, birth : (n,) s, of landing and of birth
    names : names of the materials
    contents : name -> mass fractions of what a mixture or composite is made of; its grains count in both
    """

    x: Array
    mass: Array
    material: NDArray[np.integer[Any]]
    time: Array
    birth: Array
    names: tuple[str, ...]
    contents: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def index(self, name: str) -> int:
        """Index of a material, or InputError with the names there are."""
        if name not in self.names:
            raise unknown("material", name, self.names)
        return self.names.index(name)

    def share(self, name: str) -> Array:
        """Share of each grain's mass that is of a material, (n,): 1 of its own, of others what their contents say."""
        shares = np.array([self.contents.get(grain, {}).get(name, 0.0) for grain in self.names] + [0.0])
        shares[self.index(name)] = 1.0
        return np.asarray(shares[self.material])

    @property
    def simple(self) -> tuple[str, ...]:
        """The materials that are not made of others: every grain's mass is theirs, and counted once."""
        return tuple(name for name in self.names if name not in self.contents)

    def split(self, units: Array) -> dict[str, Array]:
        """Whole numbers (n,), one a grain, as whole numbers for each simple material that sum to them."""
        parts = {name: np.where(self.material == self.index(name), units, 0.0) for name in self.simple}
        for grain, contents in self.contents.items():
            if grain not in self.names:
                continue
            mine = self.material == self.index(grain)
            *others, last = contents
            left = units[mine]
            for name in others:
                part = np.minimum(np.rint(units[mine] * contents[name]), left)
                parts[name][mine] += part
                left = left - part
            parts[last][mine] += left
        return parts


def whole_masses(mass: Array) -> tuple[Array, float]:
    """Masses in whole numbers of a unit, and the unit in kg.

    The unit is the last bit of the total, so that any sum of the numbers is exact in double precision. They are rounded
    so that they add up to the correctly rounded total, which is what the engine's mass balance says.
    """
    total = math.fsum(mass)
    if total <= 0:
        return np.zeros(len(mass)), 1.0
    unit = math.ulp(total)
    exact = mass / unit
    units = np.rint(exact)
    short = round(total / unit) - int(units.astype(np.int64).sum())
    if short:
        order = np.argsort(units - exact, kind="stable")  # the most rounded down come first
        units[order[:short] if short > 0 else order[short:]] += np.sign(short)
    return units, unit


def sums(index: NDArray[np.integer[Any]], weight: Array, n: int) -> Array:
    """Sum of the weights per index, (n,)."""
    return np.bincount(index, weight, n).astype(np.float64, copy=False)


def time_blocks(time: Array, birth: Array) -> tuple[NDArray[np.int64], int]:
    """The block of each grain and the number of blocks, by the rule at the top of this file."""
    n = len(time)
    span = float(np.ptp(time)) if n else 0.0
    if span <= 0:
        return np.zeros(n, np.int64), 1
    stay = float(np.median(time - birth))
    wanted = span / stay if stay > 0 else MOST_BLOCKS
    blocks = min(int(np.clip(wanted, LEAST_BLOCKS, MOST_BLOCKS)), max(n // 2, 1))
    index = ((time - time.min()) / span * blocks).astype(np.int64)
    return np.minimum(index, blocks - 1), blocks


def draws(blocks: int, stream: int = 0) -> Array:
    """How often each block was drawn, (DRAWS, blocks); the same numbers every time for the same stream."""
    generator = np.random.default_rng(20140724 + stream)
    return generator.multinomial(blocks, np.full(blocks, 1 / blocks), size=DRAWS).astype(float)


def student(blocks: int, level: float) -> float:
    """Quantile of Student's t that bounds a two-sided interval from so many blocks."""
    from scipy.special import stdtrit

    return float(stdtrit(blocks - 1, 0.5 + level / 2))


def fractions(part: Array, whole: Array, n_kish: Array, level: float) -> tuple[Array, Array, Array, Array]:
    """Fractions of sums over blocks and their intervals.

    Parameters
    ----------
    part, whole : (blocks, k)
        Mass per block in numerator and denominator.
    n_kish : (k,)
        Kish's effective number of grains in the denominator.
    level : float
        Coverage of the interval.

    Returns
    -------
    value, low, high, n_eff : (k,)
    """
    blocks = len(part)
    total = whole.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.where(total > 0, part.sum(axis=0) / total, np.nan)
        if blocks < FEWEST_FOR_INTERVAL:
            nan = np.full_like(value, np.nan)
            return value, nan, nan.copy(), np.where(total > 0, n_kish, 0.0)
        drawn = draws(blocks)
        bottom = drawn @ whole
        # A draw without any mass in the denominator says nothing: it takes the value, and adds no variance.
        ratio = np.where(bottom > 0, (drawn @ part) / bottom, value)
        variance = np.mean((ratio - value) ** 2, axis=0) * blocks / (blocks - 1)
        n_eff = np.minimum(np.where(variance > 0, value * (1 - value) / variance, np.inf), n_kish)
        n_eff = np.where((value <= 0) | (value >= 1), n_kish, n_eff)
        low, high = wilson(value, n_eff, student(blocks, level))
    return value, low, high, np.where(total > 0, n_eff, 0.0)


def wilson(value: Array, n: Array, quantile: float) -> tuple[Array, Array]:
    """Wilson's score interval of a fraction from n grains."""
    z2 = quantile**2 / n
    middle = (value + z2 / 2) / (1 + z2)
    half = np.sqrt(z2 * value * (1 - value) + z2**2 / 4) / (1 + z2)
    low = np.where(value <= 0, 0.0, np.maximum(middle - half, 0.0))
    high = np.where(value >= 1, 1.0, np.minimum(middle + half, 1.0))
    return low, high


def kish(mass: Array) -> float:
    """Effective number of grains of unequal mass, (sum m)^2 / sum m^2."""
    squares = float(np.sum(mass * mass))
    return float(np.sum(mass)) ** 2 / squares if squares > 0 else 0.0


def fraction(sample: Sample, part: Array, whole: Array, level: float = 0.95) -> Estimate:
    """Mass in ``part`` over the mass in ``whole``: shares (n,) of the grains' masses, or which of them, as bool.

    ``part`` is counted inside ``whole`` only.
    """
    units, _ = whole_masses(sample.mass)
    block, blocks = time_blocks(sample.time, sample.birth)
    weight = units * whole
    top, bottom = sums(block, weight * part, blocks), sums(block, weight, blocks)
    result = fractions(top[:, None], bottom[:, None], np.array([kish(sample.mass * whole)]), _level(level))
    return Estimate(*(float(column[0]) for column in result))


def mean(value: Array, sample: Sample, share: Array, level: float = 0.95) -> Estimate:
    """Mean of a value, weighted by mass and shares of it, with its interval from the block bootstrap over time.

    The interval is the value give or take Student's t times the bootstrap's deviation; ``n_eff`` is Kish's number.

    Parameters
    ----------
    value : (n,)
    share : (n,) of each grain's mass, or bool
    level : coverage of the interval
    """
    chosen = share > 0
    wanted, mass = _level(level), (sample.mass * share)[chosen]
    block, blocks = time_blocks(sample.time[chosen], sample.birth[chosen])
    top, bottom = sums(block, mass * value[chosen], blocks), sums(block, mass, blocks)
    if not bottom.sum() > 0.0:
        return Estimate(np.nan)
    middle = float(top.sum() / bottom.sum())
    if blocks < FEWEST_FOR_INTERVAL:
        return Estimate(middle, n_eff=kish(mass))
    times = draws(blocks)
    weight = times @ bottom
    drawn = np.where(weight > 0.0, (times @ top) / np.where(weight > 0.0, weight, 1.0), middle)
    variance = float(np.mean((drawn - middle) ** 2)) * blocks / (blocks - 1)
    half = student(blocks, wanted) * math.sqrt(variance)
    return Estimate(middle, middle - half, middle + half, kish(mass))


def _level(ci: float) -> float:
    if isinstance(ci, bool) or not isinstance(ci, (int, float)) or not 0 < ci < 1:
        raise InputError(f"is {show(ci)}, must be a number between 0 and 1 such as 0.95", path="ci", value=ci)
    return float(ci)


# ---- bins ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Bins:
    """Landed mass per bin. A grain at x is in bin i when edges[i] <= x - datum < edges[i + 1].

    Attributes
    ----------
    edges : (k + 1,) m, from the datum
    mass, ci_low, ci_high : name -> (k,) kg; the interval is that of the share a bin takes of the mass landed
    count : name -> (k,) grains; one of several materials counts in each
    n_eff : name -> (k,) effective number of independent grains behind the interval
    underflow, overflow : name -> kg left and right of the bins; mass.sum() + underflow + overflow == landed, exactly
    landed : name -> kg
    """

    edges: Array
    mass: Mapping[str, Array]
    count: Mapping[str, NDArray[np.int64]]
    ci_low: Mapping[str, Array]
    ci_high: Mapping[str, Array]
    n_eff: Mapping[str, Array]
    underflow: Mapping[str, float]
    overflow: Mapping[str, float]
    landed: Mapping[str, float]
    datum: float
    ci: float

    @property
    def centers(self) -> Array:
        """Middles of the bins, (k,) m."""
        return (self.edges[1:] + self.edges[:-1]) / 2

    def plot(self, splitters: Sequence[Any] = (), ax: Axes | None = None) -> Axes:
        """Draw mass per bin with its interval, and splitters (text with a unit or metres) as vertical lines."""
        from .plots import draw_bins

        return draw_bins(self, splitters, ax)

    def to_pandas(self) -> pd.DataFrame:
        """One row per bin and material: left, right [m], material, mass, ci_low, ci_high [kg], count, n_eff."""
        import pandas as pd

        rows = [
            pd.DataFrame(
                {
                    "left": self.edges[:-1],
                    "right": self.edges[1:],
                    "material": name,
                    "mass": self.mass[name],
                    "ci_low": self.ci_low[name],
                    "ci_high": self.ci_high[name],
                    "count": self.count[name],
                    "n_eff": self.n_eff[name],
                }
            )
            for name in self.mass
        ]
        return pd.concat(rows, ignore_index=True)

    def __str__(self) -> str:
        names = list(self.mass)
        lines = ["x from   to [mm]  " + "".join(f"{name + ' [g]':>14}{'interval':>20}" for name in names)]
        for i in range(len(self.edges) - 1):
            cells = "".join(
                f"{1e3 * self.mass[n][i]:14.4f}{f'{1e3 * self.ci_low[n][i]:.4f}-{1e3 * self.ci_high[n][i]:.4f}':>20}"
                for n in names
            )
            lines.append(f"{1e3 * self.edges[i]:7.1f} {1e3 * self.edges[i + 1]:7.1f}  " + cells)
        for label, side in (("to the left", self.underflow), ("to the right", self.overflow)):
            lines.append(f"{label:<17}" + "".join(f"{1e3 * side[n]:14.4f}{'':20}" for n in names))
        return "\n".join(lines)


def bins(sample: Sample, edges: Array, *, by: str | None, ci: float, datum: float) -> Bins:
    """Count a sample into bins; see `Bins`. ``by`` is "material", "grain", or None for one group "all"."""
    if by not in ("material", "grain", None):
        raise InputError(f"is {show(by)}, must be 'material', 'grain' or None", path="by", value=by)
    level = _level(ci)
    k = len(edges) - 1
    mass, unit = whole_masses(sample.mass)
    block, blocks = time_blocks(sample.time, sample.birth)
    slot = np.searchsorted(edges, sample.x - datum, side="right")  # 0: left of all, 1..k: bins, k + 1: right of all
    if by is None:
        groups = {"all": mass}
    elif by == "grain":
        groups = {name: np.where(sample.material == i, mass, 0.0) for i, name in enumerate(sample.names)}
    else:
        groups = sample.split(mass)
    columns: dict[str, dict[str, Any]] = {
        key: {} for key in ("mass", "count", "ci_low", "ci_high", "n_eff", "underflow", "overflow", "landed")
    }
    for name, part in groups.items():
        mine = part > 0
        table = sums(block[mine] * (k + 2) + slot[mine], part[mine], blocks * (k + 2)).reshape(blocks, k + 2)
        total = table.sum()
        whole = np.repeat(table.sum(axis=1)[:, None], k, axis=1)
        _, low, high, n_eff = fractions(table[:, 1:-1], whole, np.full(k, kish(part[mine] * unit)), level)
        columns["mass"][name] = table[:, 1:-1].sum(axis=0) * unit
        columns["count"][name] = np.bincount(slot[mine], minlength=k + 2)[1:-1]
        columns["ci_low"][name], columns["ci_high"][name] = low * total * unit, high * total * unit
        columns["n_eff"][name] = n_eff
        columns["underflow"][name] = float(table[:, 0].sum() * unit)
        columns["overflow"][name] = float(table[:, -1].sum() * unit)
        columns["landed"][name] = float(total * unit)
    return Bins(edges=edges, datum=datum, ci=level, **columns)


# ---- splitters -------------------------------------------------------------------------------------------------------

PRODUCTS = ("insulator", "middling", "conductor")  # left to right


@dataclass(frozen=True)
class Splitters:
    """Recovery and grade for every pair of splitter positions left <= right; NaN where left > right.

    A grain lands left of a splitter at s when x - datum < s.

    Attributes
    ----------
    positions : (k,) m, from the datum
    recovery, grade : material -> (k, k), indexed [left splitter, right splitter]
    middling : (k, k), share of the landed mass between the splitters
    """

    positions: Array
    recovery: Mapping[str, Array]
    grade: Mapping[str, Array]
    middling: Array

    def quantity(self, name: str) -> Array:
        """(k, k) table of "recovery[copper]", "grade[copper]" or "middling"."""
        tables = {"middling": self.middling}
        tables |= {f"recovery[{m}]": table for m, table in self.recovery.items()}
        tables |= {f"grade[{m}]": table for m, table in self.grade.items()}
        if name not in tables:
            raise unknown("quantity", name, tables)
        return tables[name]

    def pareto(self, maximize: Sequence[str] = (), minimize: Sequence[str] = ()) -> NDArray[np.void]:
        """Splitter pairs that no other pair beats in every quantity.

        Returns
        -------
        structured array with fields left, right [m] and the quantities, best first in the first of them
        """
        names = [maximize] if isinstance(maximize, str) else list(maximize)
        lower = [minimize] if isinstance(minimize, str) else list(minimize)
        if not names + lower:
            raise InputError("pareto needs quantities, such as maximize=('recovery[copper]', 'grade[copper]')")
        values = np.stack([self.quantity(n) for n in names] + [-self.quantity(n) for n in lower], axis=-1)
        left, right = np.nonzero(np.isfinite(values).all(axis=-1))
        goals = values[left, right]
        order = np.lexsort(goals.T[::-1])[::-1]
        front = np.empty((0, goals.shape[1]))
        chosen: list[int] = []
        for row in order:
            if not (front >= goals[row]).all(axis=1).any():
                front = np.vstack([front, goals[row]])
                chosen.append(int(row))
        fields = [("left", float), ("right", float)] + [(n, float) for n in names + lower]
        result = np.empty(len(chosen), fields)
        result["left"], result["right"] = self.positions[left[chosen]], self.positions[right[chosen]]
        for name in names + lower:
            result[name] = self.quantity(name)[left[chosen], right[chosen]]
        return result

    def to_pandas(self) -> pd.DataFrame:
        """One row per pair: left, right [m], recovery and grade of each material, middling."""
        import pandas as pd

        left, right = np.triu_indices(len(self.positions))
        columns = {"left": self.positions[left], "right": self.positions[right]}
        for material in self.recovery:
            columns[f"recovery[{material}]"] = self.recovery[material][left, right]
            columns[f"grade[{material}]"] = self.grade[material][left, right]
        return pd.DataFrame(columns | {"middling": self.middling[left, right]})


def splitters(sample: Sample, positions: Array, products: Mapping[str, str], datum: float) -> Splitters:
    """Recovery and grade of each material in its product for every pair of positions, by cumulative sums.

    Parameters
    ----------
    positions : (k,) m, rising
    products : material -> row of PRODUCTS
    """
    k = len(positions)
    mass, _ = whole_masses(sample.mass)
    first = np.searchsorted(positions, sample.x - datum, side="right")  # the first splitter the grain lies left of
    left = {name: np.cumsum(sums(first, part, k + 1)) for name, part in sample.split(mass).items()}
    everything = np.sum(list(left.values()), axis=0)
    for name in sample.contents:
        if name in sample.names:
            whole = np.where(sample.material == sample.index(name), mass, 0.0)
            left[name] = np.cumsum(sums(first, whole, k + 1))
    left = {name: left[name] for name in sample.names}
    legal = np.triu(np.full((k, k), True))

    def cut(cumulated: Array, product: str) -> Array:
        below, total = cumulated[:-1], cumulated[-1]
        tables = {
            "insulator": np.broadcast_to(below[:, None], (k, k)),
            "middling": below[None, :] - below[:, None],
            "conductor": np.broadcast_to(total - below[None, :], (k, k)),
        }
        return np.where(legal, tables[product], np.nan)

    with np.errstate(invalid="ignore", divide="ignore"):
        recovery = {m: cut(left[m], products[m]) / left[m][-1] for m in left}
        grade = {m: cut(left[m], products[m]) / cut(everything, products[m]) for m in left}
        middling = cut(everything, "middling") / everything[-1]
    return Splitters(positions, recovery, grade, middling)
