"""The random numbers of the engine: Philox4x32-10 by counter, against the published vectors and scipy."""

import numpy as np
import pytest
from scipy import stats

from cesim import engine

MASK = 0xFFFFFFFF


def philox(counter, key):
    """Philox4x32-10, written from the paper: Salmon, Moraes, Dror & Shaw, SC 2011, figure 2 and table 2."""
    c0, c1, c2, c3 = counter
    k0, k1 = key
    for _ in range(10):
        high0, low0 = divmod(0xD2511F53 * c0, 1 << 32)
        high1, low1 = divmod(0xCD9E8D57 * c2, 1 << 32)
        c0, c1, c2, c3 = high1 ^ c1 ^ k0, low1, high0 ^ c3 ^ k1, low0
        k0, k1 = (k0 + 0x9E3779B9) & MASK, (k1 + 0xBB67AE85) & MASK
    return c0, c1, c2, c3


def expected(seed, stream, identity, draw):
    first, second, _, _ = philox((draw, stream, identity & MASK, identity >> 32), (seed & MASK, seed >> 32))
    return (((first << 32) | second) >> 11) / 2**53


# The known answers that come with the paper's library, Random123.
KNOWN_ANSWERS = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((MASK,) * 4, (MASK,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN_ANSWERS)
def test_the_reference_of_this_file_gives_the_published_answers(counter, key, answer):
    assert philox(counter, key) == answer


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN_ANSWERS)
def test_the_engine_gives_the_published_answers_to_the_last_bit(counter, key, answer):
    draw, stream, low, high = counter
    number = engine.random(key[0] | key[1] << 32, stream, low | high << 32, draw)
    assert number == ((answer[0] << 32 | answer[1]) >> 11) / 2**53


@pytest.mark.parametrize(
    ("seed", "stream", "identity", "draw"),
    [(1, 0, 0, 0), (2**64 - 1, 7, 12345678901234567890, 3), (2**32, MASK, 2**32, MASK), (42, 1, 2**63, 0)],
)
def test_all_bits_of_seed_stream_id_and_draw_reach_the_number(seed, stream, identity, draw):
    assert engine.random(seed, stream, identity, draw) == expected(seed, stream, identity, draw)


def test_numbers_lie_in_the_half_open_unit_interval_on_a_grid_of_53_bits():
    numbers = np.array([engine.random(3, 0, i, 0) for i in range(10_000)])
    assert numbers.min() >= 0.0
    assert numbers.max() < 1.0
    assert np.all(numbers * 2.0**53 == np.floor(numbers * 2.0**53))


@pytest.mark.parametrize("axis", ["seed", "stream", "identity", "draw"])
def test_numbers_are_uniform_and_uncorrelated_along_every_axis_of_the_counter(axis):
    names = {"seed": 11, "stream": 2, "identity": 5, "draw": 1}
    count = 20_000
    numbers = np.empty(count)
    for i in range(count):
        names[axis] = i
        numbers[i] = engine.random(names["seed"], names["stream"], names["identity"], names["draw"])
    assert stats.kstest(numbers, "uniform").pvalue > 1e-4
    cells = np.histogram2d(numbers[:-1], numbers[1:], bins=16, range=[[0, 1], [0, 1]])[0]
    assert stats.chisquare(cells.ravel()).pvalue > 1e-4
    assert abs(np.corrcoef(numbers[:-1], numbers[1:])[0, 1]) < 4.0 / np.sqrt(count)


def test_a_number_does_not_depend_on_what_was_drawn_before():
    first = engine.random(9, 1, 100, 4)
    for i in range(10):
        engine.random(9, 1, i, 0)
    assert engine.random(9, 1, 100, 4) == first


# ---- quantiles of the diameter laws ----------------------------------------------------------------------------------

LAWS = [
    ("uniform", [0.5e-3, 2e-3], stats.uniform(0.5e-3, 1.5e-3)),
    ("normal", [1e-3, 1e-4], stats.norm(1e-3, 1e-4)),
    ("lognormal", [0.9e-3, 1.4], stats.lognorm(np.log(1.4), scale=0.9e-3)),
    ("weibull", [1e-3, 3.5], stats.weibull_min(3.5, scale=1e-3)),
]
PROBABILITIES = np.concatenate(
    [10.0 ** np.arange(-12.0, 0.0), np.linspace(0.11, 0.89, 40), 1.0 - 10.0 ** np.arange(-9.0, 0.0)]
)


@pytest.mark.parametrize(("name", "parameters", "law"), LAWS, ids=[law[0] for law in LAWS])
def test_quantiles_are_those_of_scipy_far_into_both_tails(name, parameters, law):
    quantiles = [engine.quantile(name, parameters, u) for u in PROBABILITIES]
    assert quantiles == pytest.approx(law.ppf(PROBABILITIES), rel=1e-9, abs=0.0)


def test_a_constant_law_has_one_diameter():
    assert {engine.quantile("constant", [1.5e-3], u) for u in PROBABILITIES} == {1.5e-3}


def test_a_spread_of_nothing_is_the_middle_itself():
    assert engine.quantile("lognormal", [1e-3, 1.0], 0.9) == pytest.approx(1e-3, rel=1e-15)
    assert engine.quantile("normal", [1e-3, 0.0], 0.1) == pytest.approx(1e-3, rel=1e-15)


def test_the_table_of_distributions_says_what_each_one_takes():
    rows = {row["name"]: row for row in engine.distributions()}
    assert list(rows) == ["constant", "uniform", "normal", "lognormal", "weibull", "table"]
    names = {name: [parameter["name"] for parameter in row["parameters"]] for name, row in rows.items()}
    assert names == {
        "constant": ["diameter"],
        "uniform": ["least", "most"],
        "normal": ["mean", "deviation"],
        "lognormal": ["median", "gsd"],
        "weibull": ["scale", "shape"],
        "table": [],
    }
    for row in rows.values():
        for parameter in row["parameters"]:
            assert parameter["least"] < parameter["most"]
            assert parameter["unit"] in ("m", "-")
