"""`cesim.testing`: its assertions hold for good runs, and fail for each way in which a run may be bad."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

import cesim
import cesim.testing
from cesim.statistics import Sample
from cesim.testing import assert_bins_equal, assert_healthy, assert_mass_balance, hard_cases


def machine(voltage=-35e3):
    scene = cesim.scenes.reference_machine("spheres")
    scene.electrode = cesim.Electrode(voltage=voltage)
    scene.feed.rate = "1500 1/s"
    return scene


@pytest.fixture(scope="module")
def runs():
    """Two seeds of the reference machine, and another voltage."""
    return [
        cesim.run(machine(voltage), seed, until="1.6 s", progress=False)
        for voltage, seed in ((-35e3, 1), (-35e3, 2), (-20e3, 3))
    ]


class Like:
    """A run with some attributes of another."""

    def __init__(self, run, **changed):
        self.run, self.changed = run, changed

    def __getattr__(self, name):
        return self.changed[name] if name in self.changed else getattr(self.run, name)


def test_a_good_run_and_a_simulation_are_balanced(runs):
    assert_mass_balance(runs[0])
    sim = cesim.Simulation(machine(), threads=1)
    sim.step(100)
    assert_mass_balance(sim)


@pytest.mark.parametrize("part", ["fed", "landed", "resident", "lost"])
@pytest.mark.parametrize("change", [{"count": 1}, {"kg": 1e-6}])
def test_a_grain_or_a_milligram_too_few_is_missed(runs, part, change):
    balance = runs[0].balance
    amount = getattr(balance, part)
    more = dataclasses.replace(amount, **{name: getattr(amount, name) + by for name, by in change.items()})
    with pytest.raises(AssertionError, match="missing"):
        assert_mass_balance(Like(runs[0], balance=dataclasses.replace(balance, **{part: more})))


def test_landings_that_are_not_listed_and_sums_that_differ_are_noticed(runs):
    with pytest.raises(AssertionError, match="listed"):
        assert_mass_balance(Like(runs[0], landings=runs[0].landings[:-1]))
    with pytest.raises(AssertionError, match="sums differ"):
        assert_mass_balance(Like(runs[0], balance=dataclasses.replace(runs[0].balance, closed=False)))


def test_a_run_is_healthy_until_steps_fail_or_grains_sink(runs):
    run = runs[0]
    assert_healthy(run, penetration=0.2)
    health = dataclasses.replace(run.health, unconverged=0, penetration_ratio=1e-3)
    assert_healthy(Like(run, health=health))
    with pytest.raises(AssertionError, match="did not converge"):
        assert_healthy(Like(run, health=dataclasses.replace(health, unconverged=health.steps // 20)))
    with pytest.raises(AssertionError, match="of a radius"):
        assert_healthy(Like(run, health=dataclasses.replace(health, penetration_ratio=0.02)))
    with pytest.raises(AssertionError, match="no step"):
        assert_healthy(cesim.Simulation(machine(), threads=1))


def test_two_seeds_land_alike_and_two_voltages_do_not(runs):
    assert_bins_equal(runs[0], runs[1])
    with pytest.raises(AssertionError, match="lands elsewhere"):
        assert_bins_equal(runs[0], runs[2])


class Sampled:
    """A run of which only the sample is known."""

    def __init__(self, seed, shift=0.0, stretch=1.0, count=3000, clump=1):
        """Grains in clumps that land together: neighbours are not independent."""
        rng = np.random.default_rng(seed)
        clumps = count // clump
        x = np.repeat(rng.normal(0.1 + shift, 0.02 * stretch, clumps), clump)
        birth = np.repeat(np.sort(rng.uniform(0.0, 10.0, clumps)), clump)
        mass = rng.lognormal(0.0, 0.5, count)
        self.columns = (x, mass, np.zeros(count, np.int64), birth + 0.1, birth, ("copper",))

    def sample(self, warmup=0.0):
        return Sample(*self.columns)


@pytest.mark.parametrize("clump", [1, 5])
def test_equal_streams_fail_as_often_as_the_level_says(clump):
    """At 95 %, over 400 pairs: 20 failures expected, 10 to 34 is three standard deviations and more."""
    failed = 0
    for seed in range(400):
        try:
            assert_bins_equal(Sampled(2 * seed, clump=clump), Sampled(2 * seed + 1, clump=clump), 0.95)
        except AssertionError:
            failed += 1
    assert 7 <= failed <= 34


@pytest.mark.parametrize("change", [{"shift": 5e-3}, {"stretch": 1.2}])
def test_a_shift_of_a_quarter_and_a_spread_of_a_fifth_are_noticed(change):
    with pytest.raises(AssertionError, match="lands elsewhere"):
        assert_bins_equal(Sampled(1), Sampled(2, **change))


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(cesim.InputError, match="level"):
        assert_bins_equal(Sampled(1), Sampled(2), 1.5)
    with pytest.raises(cesim.InputError, match="needs 20"):
        assert_bins_equal(Sampled(1, count=10), Sampled(2))
    other = Sampled(2)
    other.columns = (*other.columns[:-1], ("ABS",))
    with pytest.raises(cesim.InputError, match="differ"):
        assert_bins_equal(Sampled(1), other)


@hard_cases(["37", 8])
def test_the_hard_cases_come_as_a_parametrisation(case):
    assert case.id in ("08", "37")
    assert cesim.verification.measure(case).passed


def test_importing_it_needs_no_pytest():
    code = "import sys; sys.modules['pytest'] = None; import cesim.testing; cesim.testing.assert_healthy"
    subprocess.run([sys.executable, "-c", code], check=True)
