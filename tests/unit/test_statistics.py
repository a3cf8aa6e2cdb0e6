"""Bins, grade and recovery add up exactly, equal a recount, and their intervals cover what they promise."""

import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cesim import Estimate, InputError
from cesim.statistics import Sample, bins, fraction, splitters, time_blocks, whole_masses, wilson

PRODUCTS = {"copper": "conductor", "ABS": "insulator"}


def sample(n, seed=1, *, spread=0.05, blocks=None):
    """A landed stream: copper lands right, ABS left; with blocks, whole stretches of it lie left or right together."""
    rng = np.random.default_rng(seed)
    material = rng.integers(0, 2, n)
    t = np.sort(rng.uniform(0, 10, n))
    shift = np.zeros(n) if blocks is None else rng.normal(0, spread, blocks)[(t / 10 * blocks).astype(int)]
    x = np.where(material == 0, 0.13, 0.07) + rng.normal(0, spread, n) + shift
    mass = rng.lognormal(math.log(1e-6), 0.5, n)
    return Sample(x, mass, material, t, t - 0.1, ("copper", "ABS"))


@given(st.lists(st.floats(1e-14, 1e-2), min_size=1, max_size=300))
def test_whole_masses_add_up_to_the_rounded_total(masses):
    units, unit = whole_masses(np.array(masses))
    assert np.array_equal(units, np.rint(units))
    assert units.sum() * unit == math.fsum(masses)
    assert np.all(np.abs(units * unit - masses) <= 1.5 * unit)


def test_nothing_landed_has_no_mass():
    units, _ = whole_masses(np.empty(0))
    assert units.sum() == 0.0


@pytest.mark.parametrize("by", ["material", None])
def test_bins_and_what_fell_outside_are_the_landed_mass_exactly(by):
    grains = sample(5000)
    result = bins(grains, np.linspace(0.05, 0.15, 61), by=by, ci=0.95, datum=0.01)
    total = 0.0
    for name, mass in result.mass.items():
        assert mass.sum() + result.underflow[name] + result.overflow[name] == result.landed[name]
        assert result.underflow[name] > 0
        assert result.overflow[name] > 0
        total += result.landed[name]
    assert total == math.fsum(grains.mass)


def test_a_grain_on_an_edge_is_in_the_bin_to_its_right():
    grains = Sample(np.array([0.0, 1.0, 2.0]), np.ones(3), np.zeros(3, int), np.arange(3.0), np.zeros(3), ("copper",))
    result = bins(grains, np.array([0.0, 1.0, 2.0]), by="material", ci=0.95, datum=0.0)
    assert result.count["copper"].tolist() == [1, 1]
    assert result.overflow["copper"] == 1.0


def test_splitter_tables_equal_a_recount_grain_by_grain():
    """T4 of the founding papers: 60 positions for each of two virtual splitters, with a datum."""
    grains, positions, datum = sample(700, seed=4), np.linspace(0.0, 0.2, 60), 0.011
    grains.x[:60] = positions + datum  # grains exactly on a splitter
    table = splitters(grains, positions, PRODUCTS, datum)
    mass, _ = whole_masses(grains.mass)
    x = grains.x - datum
    for i, left in enumerate(positions):
        for j, right in enumerate(positions):
            if i > j:
                assert np.isnan(table.recovery["copper"][i, j])
                continue
            place = np.where(x < left, 0, np.where(x < right, 1, 2))
            for name, product in PRODUCTS.items():
                mine = grains.material == grains.names.index(name)
                here = place == (2 if product == "conductor" else 0)
                assert table.recovery[name][i, j] == mass[mine & here].sum() / mass[mine].sum()
                if mass[here].sum() > 0:
                    assert table.grade[name][i, j] == mass[mine & here].sum() / mass[here].sum()
                else:
                    assert np.isnan(table.grade[name][i, j])
            assert table.middling[i, j] == mass[place == 1].sum() / mass.sum()


def test_pareto_set_is_that_of_all_pairs_compared():
    table = splitters(sample(400), np.linspace(0, 0.2, 25), PRODUCTS, 0.0)
    front = table.pareto(maximize=("recovery[copper]", "grade[copper]"))
    goals = np.stack([table.recovery["copper"], table.grade["copper"]], axis=-1).reshape(-1, 2)
    goals = goals[np.isfinite(goals).all(axis=1)]
    beaten = [((goals >= g).all(axis=1) & (goals > g).any(axis=1)).any() for g in goals]
    expected = {tuple(g) for g, b in zip(goals, beaten, strict=True) if not b}
    assert {(row["recovery[copper]"], row["grade[copper]"]) for row in front} == expected
    assert len(front) == len(expected) > 3


def test_pareto_minimizes_too():
    table = splitters(sample(400), np.linspace(0, 0.2, 25), PRODUCTS, 0.0)
    front = table.pareto(maximize="grade[copper]", minimize="middling")
    assert front["middling"].min() == 0.0
    with pytest.raises(InputError, match="did you mean"):
        table.pareto(maximize="grade[coper]")


def test_splitters_as_a_frame_have_one_row_per_pair():
    frame = splitters(sample(100), np.linspace(0, 0.2, 7), PRODUCTS, 0.0).to_pandas()
    assert len(frame) == 7 * 8 // 2
    assert (frame["left"] <= frame["right"]).all()


def right_of(grains, position=0.1):
    copper = grains.material == 0
    return fraction(grains, grains.x >= position, copper)


def test_intervals_of_independent_grains_cover_the_truth():
    # Copper right of 0.1 m: x is normal about 0.13 with deviation 0.05.
    truth = 0.5 * (1 + math.erf(0.6 / math.sqrt(2)))
    hits = sum(e.low <= truth <= e.high for e in (right_of(sample(400, seed)) for seed in range(400)))
    assert 0.92 <= hits / 400 <= 0.99


def test_intervals_of_a_correlated_stream_cover_the_truth_where_those_over_grains_do_not():
    truth = 0.5 * (1 + math.erf(0.03 / math.hypot(0.05, 0.05) / math.sqrt(2)))
    hits = naive = 0
    for seed in range(200):
        estimate = right_of(sample(4000, seed, blocks=100))
        hits += estimate.low <= truth <= estimate.high
        low, high = wilson(np.array([float(estimate)]), np.array([2000.0]), 1.96)
        naive += bool(low[0] <= truth <= high[0])
    assert hits / 200 >= 0.88
    assert naive / 200 <= 0.6


def test_a_perfect_separation_is_not_certain():
    grains = sample(300, spread=1e-4)
    estimate = right_of(grains)
    assert float(estimate) == estimate.high == 1.0
    assert 0.9 < estimate.low < 1.0


def test_intervals_are_the_same_every_time():
    first, second = (right_of(sample(500)) for _ in range(2))
    assert (first.low, first.high, first.n_eff) == (second.low, second.high, second.n_eff)


def test_few_grains_give_a_number_without_an_interval():
    estimate = right_of(sample(6))
    assert np.isnan(estimate.low)
    assert np.isnan(estimate.high)
    assert "no interval" in repr(estimate)


def test_unequal_masses_lower_the_effective_number_of_grains():
    grains = sample(2000)
    assert right_of(grains).n_eff < 0.9 * np.count_nonzero(grains.material == 0)


def test_number_of_blocks_follows_the_stay():
    t = np.linspace(0, 10, 1000)
    assert time_blocks(t, t - 0.5)[1] == 20
    assert time_blocks(t, t - 5.0)[1] == 10
    assert time_blocks(t, t - 1e-3)[1] == 100
    assert time_blocks(t[:10], t[:10] - 1e-3)[1] == 5
    assert time_blocks(np.zeros(50), np.zeros(50))[1] == 1


def test_an_estimate_is_a_float():
    estimate = Estimate(0.5, 0.4, 0.6, 100)
    assert estimate + 1 == 1.5
    assert f"{estimate:.2f}" == "0.50"
    assert estimate.halfwidth == pytest.approx(0.1)
    assert isinstance(estimate, float)
    for twin in (copy.deepcopy(estimate), pickle.loads(pickle.dumps(estimate))):
        assert (twin, twin.low, twin.high, twin.n_eff) == (0.5, 0.4, 0.6, 100)


@pytest.mark.parametrize("ci", [0, 1, 95, -0.5, math.nan, True, "0.95", None])
def test_a_coverage_must_lie_between_0_and_1(ci):
    with pytest.raises(InputError, match="ci is"):
        fraction(sample(100), np.full(100, True), np.full(100, True), ci)


def test_bins_as_text_and_frame():
    result = bins(sample(500), np.linspace(0, 0.2, 11), by="material", ci=0.9, datum=0.0)
    frame = result.to_pandas()
    assert len(frame) == 20
    assert frame["count"].sum() <= 500
    assert (frame["ci_low"] <= frame["mass"]).all()
    assert (frame["mass"] <= frame["ci_high"]).all()
    assert str(result).count("\n") == 12
    with pytest.raises(InputError, match="by is"):
        bins(sample(10), np.linspace(0, 1, 3), by="colour", ci=0.9, datum=0.0)
