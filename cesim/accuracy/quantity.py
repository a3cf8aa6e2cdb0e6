"""What a run is asked for, by name: "recovery[copper]", "grade[ABS]", "middling", "mean_x[copper]", "spread_x[ABS]".

Every quantity is a function of sums over grains. So one bootstrap serves them all: the sums are kept per block of time,
blocks are drawn, and the spread of the function over the draws is the sampling error. Two runs of the same feed are
drawn with the same blocks of births, which leaves of the sampling error only what the runs do not share; how much they
share is measured (`Difference.correlation`), not assumed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, show, unknown
from ..statistics import FEWEST_FOR_INTERVAL, PRODUCTS, Array, Estimate, draws, kish, student, time_blocks

if TYPE_CHECKING:
    from ..result import Run

PATTERN = re.compile(r"(\w+)(?:\[([^\[\]]+)\])?")


@dataclass(frozen=True)
class Kind:
    """A family of quantities."""

    doc: str
    unit: str
    of_material: bool
    columns: Callable[[Array, Array, Array, Array], tuple[Array, ...]]  # (x, mass, mine, product) -> (n,) each
    value: Callable[[Array], Array]  # sums (..., k) -> (...)


def _ratio(sums: Array) -> Array:
    return sums[..., 0] / sums[..., 1]


def _spread(sums: Array) -> Array:
    mean = sums[..., 1] / sums[..., 0]
    return np.sqrt(np.maximum(sums[..., 2] / sums[..., 0] - mean**2, 0.0))


KINDS: dict[str, Kind] = {
    "recovery": Kind(
        "mass of the material in its product over its mass landed",
        "",
        True,
        lambda x, mass, mine, product: (mass * mine * product, mass * mine),
        _ratio,
    ),
    "grade": Kind(
        "mass of the material in its product over all mass in that product",
        "",
        True,
        lambda x, mass, mine, product: (mass * mine * product, mass * product),
        _ratio,
    ),
    "middling": Kind(
        "share of the landed mass between the splitters",
        "",
        False,
        lambda x, mass, mine, product: (mass * product, mass),
        _ratio,
    ),
    "mean_x": Kind(
        "mean landing x of the material, by mass",
        "m",
        True,
        lambda x, mass, mine, product: (mass * mine * x, mass * mine),
        _ratio,
    ),
    "spread_x": Kind(
        "standard deviation of the landing x of the material, by mass",
        "m",
        True,
        lambda x, mass, mine, product: (mass * mine, mass * mine * x, mass * mine * x * x),
        _spread,
    ),
}


@dataclass(frozen=True)
class Quantity:
    """A number that a run has, such as "recovery[copper]".

    Parameters
    ----------
    name : str
        One of KINDS, with the name of a material in brackets where it belongs to one.

    Raises
    ------
    InputError
        Where there is no such quantity.
    """

    name: str

    def __post_init__(self) -> None:
        match = PATTERN.fullmatch(self.name) if isinstance(self.name, str) else None
        if match is None or match[1] not in KINDS or KINDS[match[1]].of_material != (match[2] is not None):
            names = [f"{name}[material]" if kind.of_material else name for name, kind in KINDS.items()]
            if isinstance(self.name, str) and match is not None:
                raise unknown("quantity", self.name, names)
            raise InputError(f"is {show(self.name)}, must be one of {', '.join(names)}", path="quantity")

    @property
    def kind(self) -> Kind:
        """Its family."""
        return KINDS[self.name.partition("[")[0]]

    @property
    def unit(self) -> str:
        """ "" or "m"."""
        return self.kind.unit

    @property
    def material(self) -> str | None:
        """Name of the material, or None."""
        return self.name.partition("[")[2].rstrip("]") or None

    @property
    def is_share(self) -> bool:
        """Whether it lies between 0 and 1."""
        return self.unit == ""

    def of(self, run: Run, ci: float = 0.95, warmup: float | str = 0.0, splitters: Any = None) -> Estimate:
        """Its value in a run, with its interval from a block bootstrap over time."""
        if self.name == "middling":
            return run.middlings(splitters, ci=ci, warmup=warmup)
        material = self.material or ""
        if self.is_share:
            measure = run.grade if self.name.startswith("grade") else run.recovery
            return measure(material, splitters, ci=ci, warmup=warmup)
        estimate = self._estimate(block_sums(self, [run], warmup, splitters), ci)
        sample = run.sample(warmup)
        share = sample.share(material)
        mine = share > 0
        return effective(estimate, ci, sample.x[mine], (sample.mass * share)[mine], mean=self.name.startswith("mean"))

    def _estimate(self, sums: Array, ci: float) -> Estimate:
        with np.errstate(invalid="ignore", divide="ignore"):
            value = float(self.kind.value(sums.sum(axis=0)))
            if len(sums) < FEWEST_FOR_INTERVAL:
                return Estimate(value)
            half = student(len(sums), ci) * deviation(self.kind.value(draws(len(sums)) @ sums), value, len(sums))
        return Estimate(value, value - half, value + half)


def deviation(drawn: Array, value: float, blocks: int) -> float:
    """Standard error of a value from its draws; a draw without any grain says nothing."""
    spread = np.where(np.isfinite(drawn), drawn - value, 0.0)
    return float(np.sqrt(np.mean(spread**2) * blocks / (blocks - 1)))


def effective(estimate: Estimate, ci: float, x: Array, mass: Array, *, mean: bool) -> Estimate:
    """An estimate with the number of independent grains that would give its interval, at most Kish's number.

    The mean of n independent grains has a standard error of s/sqrt(n), their standard deviation one of s/sqrt(2 n).
    """
    from scipy.special import ndtri

    most = kish(mass)
    if not estimate.halfwidth > 0.0:
        return Estimate(float(estimate), estimate.low, estimate.high, most)
    spread = np.sqrt(np.average((x - np.average(x, weights=mass)) ** 2, weights=mass))
    error = estimate.halfwidth / float(ndtri(0.5 + ci / 2))
    return Estimate(
        float(estimate), estimate.low, estimate.high, min(most, (spread / error) ** 2 / (1.0 if mean else 2.0))
    )


def block_sums(
    quantity: Quantity,
    runs: Sequence[Run],
    warmup: float | str = 0.0,
    splitters: Any = None,
    births: Sequence[Array] | None = None,
) -> Array:
    """The sums behind a quantity per block of time, (blocks of all runs, k).

    Parameters
    ----------
    births : for each run (b + 1,) s, edges of blocks of birth time, by which two runs of one feed have the same grains
        in the same block; default: blocks of landing time. Blocks of birth time are no fair draws of a single run: of
        the first and the last of them only the slow and the fast grains landed in time.
    """
    edges = [None] * len(runs) if births is None else births
    parts = [_sums_of(quantity, run, warmup, splitters, e) for run, e in zip(runs, edges, strict=True)]
    return np.concatenate(parts)


def _sums_of(quantity: Quantity, run: Run, warmup: float | str, splitters: Any, edges: Array | None) -> Array:
    sample = run.sample(warmup)
    mine = np.ones(len(sample.x))
    if quantity.material is not None:
        mine = sample.share(quantity.material)
    product = np.full(len(sample.x), True)
    if quantity.is_share:
        name = "middling" if quantity.material is None else run.products[quantity.material]
        product = run.places(splitters, warmup) == PRODUCTS.index(name)
    columns = quantity.kind.columns(sample.x, sample.mass, mine, product)
    if edges is None:
        block, blocks = time_blocks(sample.time, sample.birth)
    else:
        blocks = len(edges) - 1
        block = np.clip(np.searchsorted(edges, sample.birth, side="right") - 1, 0, blocks - 1)
    return np.stack([np.bincount(block, column, blocks) for column in columns], axis=-1)


def birth_edges(run: Run, warmup: float | str = 0.0) -> Array:
    """Edges of equal blocks of birth time, as many as there are blocks of landing time."""
    sample = run.sample(warmup)
    if not len(sample.x):
        return np.array([0.0, max(run.time, 1e-9)])
    blocks = time_blocks(sample.time, sample.birth)[1]
    return np.linspace(float(sample.birth.min()), np.nextafter(float(sample.birth.max()), np.inf), blocks + 1)


# ---- differences -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Difference:
    """By how much a quantity differs between two settings.

    Attributes
    ----------
    value : Estimate
        First less second, with its interval.
    correlation : float
        Between the two, over the draws; NaN where the runs are not paired, or one of them does not vary.
    """

    value: Estimate
    correlation: float

    def verdict(self, tolerance: float) -> str:
        """ "same": the whole interval is within +-tolerance; "different": it excludes 0; else "not resolved".

        An interval that is within the tolerance and excludes 0 is "same": as good as asked for.
        """
        if np.isnan(self.value.low):
            return "not resolved"
        if -tolerance <= self.value.low and self.value.high <= tolerance:
            return "same"
        return "different" if self.value.low > 0.0 or self.value.high < 0.0 else "not resolved"


def difference(
    quantity: Quantity,
    first: Sequence[Run],
    second: Sequence[Run],
    *,
    ci: float = 0.95,
    warmup: float | str = 0.0,
    splitters: Any = None,
) -> Difference:
    """A quantity over some runs less the same over others, with its interval.

    Runs of the same seeds, in the same order, are paired: their blocks hold the same grains and are drawn together.
    """
    pairs = [a.seed for a in first] == [b.seed for b in second] and all(
        same_feed(a, b) for a, b in zip(first, second, strict=True)
    )
    births = [birth_edges(run, warmup) for run in first] if pairs else None
    one = block_sums(quantity, first, warmup, splitters, births)
    other = block_sums(quantity, second, warmup, splitters, births)
    value = quantity.kind.value
    with np.errstate(invalid="ignore", divide="ignore"):
        best = [float(value(sums.sum(axis=0))) for sums in (one, other)]
        drawn = [value(draws(len(one)) @ one), value(draws(len(other), 0 if pairs else 1) @ other)]
    blocks = min(len(one), len(other))
    spread = [np.where(np.isfinite(d), d - b, 0.0) for d, b in zip(drawn, best, strict=True)]
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = float(np.corrcoef(spread[0], spread[1])[0, 1]) if pairs else np.nan
    if blocks < FEWEST_FOR_INTERVAL:
        return Difference(Estimate(best[0] - best[1]), correlation)
    half = student(blocks, ci) * deviation(spread[0] - spread[1], 0.0, blocks)
    low, high = best[0] - best[1] - half, best[0] - best[1] + half
    if quantity.is_share and any(b in (0.0, 1.0) for b in best):
        # Blocks that all say 0 or 1 do not vary, and the bootstrap is blind. Newcombe's interval from the two Wilson
        # intervals is not (Statistics in Medicine 17 (1998) 873, method 10); it takes no profit from the pairing.
        ends = [_wilson(quantity, runs, ci, warmup, splitters) for runs in (first, second)]
        low = min(low, best[0] - best[1] - np.hypot(best[0] - ends[0].low, ends[1].high - best[1]))
        high = max(high, best[0] - best[1] + np.hypot(ends[0].high - best[0], best[1] - ends[1].low))
    return Difference(Estimate(best[0] - best[1], low, high), correlation)


def _wilson(quantity: Quantity, runs: Sequence[Run], ci: float, warmup: float | str, splitters: Any) -> Estimate:
    """Interval of a share over several runs: that of the first, narrowed as grains add up."""
    parts = [quantity.of(run, ci, warmup, splitters) for run in runs]
    value = float(np.mean(parts))
    narrow = 1.0 / np.sqrt(len(parts))
    low = value - narrow * float(np.mean([part - part.low for part in parts]))
    high = value + narrow * float(np.mean([part.high - part for part in parts]))
    return Estimate(value, low, high)


def same_feed(a: Run, b: Run) -> bool:
    """Whether two runs were fed the same grains at the same times: ids, births and masses agree as far as both go."""
    one, other = a.particles, b.particles
    n = min(len(one), len(other))
    return n > 0 and all(np.array_equal(one[name][:n], other[name][:n]) for name in ("birth", "mass"))


def pooled(quantity: Quantity, runs: Sequence[Run], *, ci: float = 0.95, warmup: float | str = 0.0) -> Estimate:
    """A quantity over runs of several seeds together: the blocks of all of them are drawn."""
    single = [quantity.of(run, ci, warmup) for run in runs]
    if len(runs) == 1:
        return single[0]
    n_eff = float(np.sum([part.n_eff for part in single]))
    result = quantity._estimate(block_sums(quantity, runs, warmup), ci)
    if not quantity.is_share:
        return Estimate(float(result), result.low, result.high, n_eff)
    if float(result) in (0.0, 1.0):
        ends = _wilson(quantity, runs, ci, warmup, None)
        return Estimate(float(result), ends.low, ends.high, n_eff)
    return Estimate(float(result), max(result.low, 0.0), min(result.high, 1.0), n_eff)
