"""Every bad argument is an InputError of one line that names it, and the simulation is as if it had not been made."""

import math

import numpy as np
import pytest
from streams import stream

import cesim
from cesim import InputError

GOOD = {"position": [[0.0, 0.3, 0.0], [0.01, 0.3, 0.0]]}
NO_NUMBERS = [None, "1", "1 mm", b"1", True, 1j, object(), {}, [], [1, None], ["a"], np.array(["1"]), np.array([1j])]
NO_NUMBERS += [np.datetime64("2026-01-01"), np.array([True]), np.ma.masked_array([1e-3, 1e-3], [True, False])]
NOT_FINITE = [math.nan, math.inf, -math.inf, np.float32("nan"), 10**400, [math.nan, 0, 0], [[0, 0, math.inf]] * 2]


@pytest.fixture
def sim():
    simulation = cesim.Simulation(cesim.scenes.single_particle(), seed=1, threads=1)
    simulation.add([0, 0.2, 0])
    simulation.step(3)
    return simulation


def refuse(sim, call, *words):
    before = (sim.state_hash(), sim.count, sim.time)
    with pytest.raises(InputError) as error:
        call()
    text = str(error.value)
    assert "\n" not in text
    assert len(text) < 400
    for word in words:
        assert word in text
    assert (sim.state_hash(), sim.count, sim.time) == before


@pytest.mark.parametrize("name", ["position", "velocity", "angular_velocity", "diameter", "charge"])
@pytest.mark.parametrize("value", [*NO_NUMBERS, *NOT_FINITE], ids=repr)
def test_what_is_no_finite_number_is_refused(sim, name, value):
    refuse(sim, lambda: sim.add(**(GOOD | {name: value})), name)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("diameter", 0.0),
        ("diameter", -1e-3),
        ("diameter", 1e-12),
        ("diameter", 5.0),
        ("diameter", [1e-3, 0.0]),
        ("velocity", [3e8, 0, 0]),
        ("angular_velocity", [0, 0, 1e9]),
        ("charge", 1.0),
        ("position", [1e6, 0, 0]),
        ("position", [[0, 0.3, 0], [0, 1e300, 0]]),
        ("position", np.array([2**63, 0, 0], dtype="u8")),
    ],
)
def test_what_is_out_of_range_is_refused_with_value_and_range(sim, name, value):
    refuse(sim, lambda: sim.add(**(GOOD | {name: value})), name, "outside [")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("position", 0.0),
        ("position", [0.0, 0.0]),
        ("position", np.zeros((2, 2))),
        ("position", np.zeros((2, 3, 1))),
        ("position", [[0, 0, 0], [0, 0]]),
        ("velocity", 1.0),
        ("velocity", np.zeros((3, 3))),
        ("velocity", np.zeros((2, 3, 1))),
        ("angular_velocity", np.zeros(2)),
        ("diameter", np.full(3, 1e-3)),
        ("diameter", np.full((2, 1), 1e-3)),
        ("charge", np.zeros((1, 2))),
        ("material", ["copper"] * 3),
        ("material", []),
    ],
)
def test_a_shape_that_does_not_fit_is_refused(sim, name, value):
    refuse(sim, lambda: sim.add(**(GOOD | {name: value})), name)


@pytest.mark.parametrize(
    ("value", "word"),
    [
        ("coper", "copper"),
        ("Copper", "did you mean"),
        ("unobtainium", "unobtainium"),
        ("", "material"),
        (-1, "outside"),
        (99, "outside"),
        (1.0, "whole number"),
        (True, "whole number"),
        (None, "whole number"),
        (["copper", None], "whole number"),
        (b"copper", "whole number"),
    ],
)
def test_an_unknown_material_is_refused_with_a_suggestion(sim, value, word):
    refuse(sim, lambda: sim.add(**GOOD, material=value), "material", word)


def test_an_unknown_shape_is_refused(sim):
    refuse(sim, lambda: sim.add(**GOOD, shape="cube"), "shape")


@pytest.mark.parametrize("n", [-1, 1.0, "1", None, True, 2**31, 10**30, math.nan, [1]])
def test_a_number_of_steps_must_be_a_whole_number(sim, n):
    refuse(sim, lambda: sim.step(n), "n is")


@pytest.mark.parametrize(
    "until", [-1, "1 m", "1", "", "soon", math.nan, math.inf, None, True, 1e30, "1e400 s", [1], 1j]
)
def test_until_must_be_a_time(sim, until):
    refuse(sim, lambda: sim.run(until), "until")
    with pytest.raises(InputError, match="until"):
        cesim.run(stream(), until=until, progress=False)


@pytest.mark.parametrize("seed", [-1, 2**64, 1.5, "1", None, True, math.nan])
def test_a_seed_must_be_a_whole_number(seed):
    with pytest.raises(InputError, match="seed"):
        cesim.Simulation(stream(), seed=seed)


@pytest.mark.parametrize("threads", [0, -1, 1.5, "2", True, 10**9])
def test_threads_must_be_a_whole_number(threads):
    with pytest.raises(InputError, match="threads"):
        cesim.Simulation(stream(), threads=threads)


@pytest.mark.parametrize("value", [math.nan, math.inf])
@pytest.mark.parametrize("name", ["position", "velocity", "angular_velocity", "charge"])
def test_a_number_written_into_a_view_that_is_not_finite_stops_the_step_with_a_reason(sim, name, value):
    getattr(sim, name)[0] = value
    with pytest.raises((cesim.SimulationError, InputError)) as error:
        sim.step()
    assert "\n" not in str(error.value)
    assert sim.count == 1


@pytest.fixture(scope="module")
def run():
    return cesim.run(stream(), seed=5, threads=1, until="0.2 s", progress=False)


@pytest.mark.parametrize(
    "splitters", ["a", (0.0, 0.1, 0.2), (0.1, 0.0), (math.nan, 0.1), ("1 s", "2 s"), (None, 1), [], {}, True]
)
def test_splitters_must_be_rising_positions(run, splitters):
    for quantity in (run.recovery, run.grade):
        with pytest.raises(InputError, match="splitters"):
            quantity("copper", splitters)


@pytest.mark.parametrize("material", ["coper", "PE", 0, None, ""])
def test_a_material_that_was_not_fed_is_refused(run, material):
    with pytest.raises(InputError, match="material"):
        run.recovery(material)


def test_other_arguments_of_a_result(run):
    for call, word in (
        (lambda: run.recovery("copper", product="metal"), "product"),
        (lambda: run.share("left"), "product"),
        (lambda: run.bins(0), "n is"),
        (lambda: run.bins(2.5), "n is"),
        (lambda: run.bins(10, x=(0.1, 0.1)), "x "),
        (lambda: run.bins(10, x="0 mm"), "x is"),
        (lambda: run.bins(10, x=("0 mm", "1 kg")), r"x\[1\]"),
        (lambda: run.bins(10, datum="1 s"), "datum"),
        (lambda: run.bins(10, ci=95), "ci"),
        (lambda: run.bins(10, by="size"), "by"),
        (lambda: run.splitters(10**7), "n is"),
        (lambda: run.grade("copper", warmup=-1), "warmup"),
    ):
        with pytest.raises(InputError, match=word) as error:
            call()
        assert "\n" not in str(error.value)
