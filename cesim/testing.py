"""Assertions for your own tests of scenes and runs, and the hard cases as tests.

>>> def test_my_machine():
...     run = cesim.run(my_scene(), until="2 s")
...     cesim.testing.assert_mass_balance(run)
...     cesim.testing.assert_healthy(run)

Nothing here needs pytest but `hard_cases`, which imports it when it is called.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError, percent, show
from .health import Health
from .statistics import Array, Sample, sums, time_blocks, whole_masses

if TYPE_CHECKING:
    from .result import Run
    from .simulation import Simulation

__all__ = ["assert_bins_equal", "assert_healthy", "assert_mass_balance", "hard_cases"]

LEAST_BLOCKS = 5  #: of time, below which the scatter of a share cannot be told


def assert_mass_balance(run: Run | Simulation) -> None:
    """Assert that what was fed has landed, is inside or was lost: exactly in grains, and in mass as the engine adds it.

    Parameters
    ----------
    run : Run or Simulation

    Raises
    ------
    AssertionError
        With the balance.
    """
    balance = run.balance
    parts = (balance.landed, balance.resident, balance.lost)
    left = balance.fed.count - sum(part.count for part in parts)
    assert left == 0, f"{left} grains are missing: {balance}"
    missing = balance.fed.kg - float(sum(part.kg for part in parts))
    assert abs(missing) <= 1e-12 * balance.fed.kg, f"{missing:.3g} kg are missing: {balance}"
    assert balance.closed, f"the engine's own sums differ: {balance}"
    told, rows = balance.landed.count, len(run.landings)
    assert told == rows, f"{told} grains are said to have landed, {rows} are listed"


def assert_healthy(run: Run | Simulation, unconverged: float = 0.01, penetration: float = 0.01) -> None:
    """Assert that the contact problems were solved, and that nothing sank into anything.

    Parameters
    ----------
    run : Run or Simulation
    unconverged : float
        Share of the steps that may have run out of sweeps.
    penetration : float
        Deepest overlap that may have been seen, over the radius of its grain.

    Raises
    ------
    AssertionError
        With the health.
    """
    health: Health = run.health
    assert health.steps > 0, "no step was taken"
    share = health.unconverged / health.steps
    assert share <= unconverged, (
        f"{health.unconverged} of {health.steps} steps did not converge, {percent(share)} where "
        f"{percent(unconverged)} are allowed\n{health}"
    )
    deepest = health.penetration_ratio
    assert deepest <= penetration, (
        f"an overlap of {percent(deepest)} of a radius, where {percent(penetration)} are allowed\n{health}"
    )


def assert_bins_equal(
    a: Run, b: Run, level: float = 0.99, *, n: int = 10, x: Any = None, warmup: float | str = 0.0
) -> None:
    """Assert that grains land alike in two runs, within their statistics.

    Each material's landed mass is counted in n bins, and the shares of the two runs are compared by a chi-square test
    of Wald. Grains are not independent draws, as neighbours in the stream shadow each other: the covariance of the
    shares comes from blocks of time (`cesim.statistics`), its loss of freedom is made good after Hotelling. Two runs
    that differ in nothing but the seed fail in one of 1/(1 - level) times.

    Parameters
    ----------
    a, b : Run
        With the same materials. More grains make the test sharper.
    level : float
        Confidence at which a difference counts, for all materials together.
    n : int
        Number of bins, of equal mass in the two runs together.
    x : (from, to), optional
        Range on the landing plane that is compared, m or text with a unit; default: wherever grains landed.
    warmup : float or str
        Landings before this time do not count.

    Raises
    ------
    AssertionError
        With the material, the chance of such a difference, and the bins.
    InputError
        Where there are too few grains or materials differ.
    """
    if isinstance(level, bool) or not isinstance(level, (int, float)) or not 0 < level < 1:
        raise InputError(f"is {show(level)}, must be a number between 0 and 1 such as 0.99", path="level", value=level)
    one, other = a.sample(warmup), b.sample(warmup)
    if set(one.names) != set(other.names):
        raise InputError(f"differ: {', '.join(one.names)} and {', '.join(other.names)}", path="materials")
    allowed = (1.0 - level) / len(one.names)  # Bonferroni: one of several materials may stray more easily
    low, high = limits(x)
    for name in one.names:
        parts = [part_of(sample, name, low, high) for sample in (one, other)]
        chance, edges, shares = compare(parts[0], parts[1], n, name)
        table = "\n".join(
            f"  {1e3 * edges[i]:8.1f} to {1e3 * edges[i + 1]:8.1f} mm: {shares[0][i]:.4f} and {shares[1][i]:.4f}"
            for i in range(len(edges) - 1)
        )
        assert chance >= allowed, (
            f"{name} lands elsewhere: by chance such a difference has a probability of {chance:.2g}, below "
            f"{allowed:.2g}; shares of its mass:\n{table}"
        )


def limits(x: Any) -> tuple[float, float]:
    """Range of x in m."""
    if x is None:
        return -np.inf, np.inf
    from .result import rising

    low, high = rising("x", x, 2)
    return float(low), float(high)


def part_of(sample: Sample, name: str, low: float, high: float) -> Sample:
    """Of a sample, one material in a range."""
    share = sample.share(name)
    mine = (share > 0) & (sample.x >= low) & (sample.x < high)
    x, mass, material = sample.x[mine], (sample.mass * share)[mine], sample.material[mine]
    return Sample(x, mass, material, sample.time[mine], sample.birth[mine], sample.names)


def compare(one: Sample, other: Sample, n: int, name: str) -> tuple[float, Array, list[Array]]:
    """Chance of the difference, edges of bins of equal mass, and the shares of both samples in them."""
    from scipy.stats import f as fisher

    for sample in (one, other):
        if len(sample.x) < 20:
            raise InputError(f"has {len(sample.x)} grains of {name} to compare, needs 20", path="run")
    together = np.concatenate([one.x, other.x])
    most = max(2, min(n, blocks_of(one) // 2, blocks_of(other) // 2))  # the covariance must have full rank, and room
    edges = np.unique(np.quantile(together, np.linspace(0.0, 1.0, most + 1)))
    edges[-1] = np.nextafter(edges[-1], np.inf)
    if len(edges) < 3:
        return (1.0 if np.array_equal(np.unique(one.x), np.unique(other.x)) else 0.0), edges, [np.ones(1), np.ones(1)]
    shares, covariances, freedom = zip(*(shares_of(sample, edges) for sample in (one, other)), strict=True)
    difference = (shares[0] - shares[1])[:-1]  # they sum to one
    covariance = (covariances[0] + covariances[1])[:-1, :-1]
    floor = 1e-12 + 1e-9 * float(np.trace(covariance))
    statistic = float(difference @ np.linalg.solve(covariance + floor * np.eye(len(covariance)), difference))
    k, degrees = len(difference), min(freedom)
    # Hotelling: T^2 (degrees - k + 1)/(degrees k) follows Fisher's F(k, degrees - k + 1).
    chance = float(fisher.sf(statistic * (degrees - k + 1) / (degrees * k), k, degrees - k + 1))
    return chance, edges, list(shares)


def blocks_of(sample: Sample) -> int:
    """Number of blocks of time in a sample."""
    blocks = time_blocks(sample.time, sample.birth)[1]
    if blocks < LEAST_BLOCKS:
        raise InputError(f"spans {blocks} blocks of time, needs {LEAST_BLOCKS}: run for longer", path="run")
    return blocks


def shares_of(sample: Sample, edges: Array) -> tuple[Array, Array, int]:
    """Shares of the mass per bin, their covariance from blocks of time, and its degrees of freedom."""
    mass, _ = whole_masses(sample.mass)
    block, blocks = time_blocks(sample.time, sample.birth)
    k = len(edges) - 1
    slot = np.searchsorted(edges, sample.x, side="right") - 1
    table = sums(block * k + slot, mass, blocks * k).reshape(blocks, k)
    total = float(table.sum())
    share = table.sum(axis=0) / total
    residual = (table - table.sum(axis=1)[:, None] * share) / total  # of a ratio, linearised
    return share, residual.T @ residual * (blocks / (blocks - 1.0)), blocks - 1


def hard_cases(ids: Iterable[str | int] | None = None, *, full: bool = False) -> Callable[[Any], Any]:
    """Parametrise a test over the hard cases of `cesim.verify`, which it gets one by one.

    Parameters
    ----------
    ids : of cases, such as ["04", "22"]; default: all of the quick set
    full : sizes that take minutes

    Returns
    -------
    decorator for a test function with an argument ``case``

    Examples
    --------
    >>> @cesim.testing.hard_cases()
    ... def test_hard_case(case):
    ...     result = cesim.verification.measure(case)
    ...     assert result.passed, str(result)
    """
    import pytest

    from .verification import cases

    chosen = cases(ids, full=full)
    mark: Callable[[Any], Any] = pytest.mark.parametrize("case", chosen, ids=[f"{c.id} {c.title}" for c in chosen])
    return mark
