"""What is printed under the table of a run."""

from types import SimpleNamespace

import numpy as np
import pytest

from cesim.statistics import Estimate
from cesim.table import startup


def run_with_grades(whole, later):
    return SimpleNamespace(
        landings=np.zeros(500),
        definition={"collect": {"splitters": (0.1, 0.2)}},
        warmup=0.5,
        time=2.0,
        materials=["ABS"],
        grade=lambda name, warmup=0.0: later if warmup else whole,
    )


@pytest.mark.parametrize("later", [0.95, 0.71])
def test_a_start_that_shifts_a_grade_beyond_its_interval_is_told(later):
    (note,) = startup(run_with_grades(Estimate(0.8, 0.75, 0.85), Estimate(later, later - 0.02, later + 0.02)))
    assert f"{later}" in note
    assert "0.5 s" in note


@pytest.mark.parametrize(
    ("whole", "later"),
    [
        (Estimate(0.8, 0.75, 0.85), Estimate(0.84, 0.8, 0.88)),
        (Estimate(0.8), Estimate(0.3, 0.2, 0.4)),
        (Estimate(0.8, 0.75, 0.85), Estimate(np.nan)),
    ],
)
def test_a_shift_within_the_interval_or_of_too_few_grains_is_not(whole, later):
    assert startup(run_with_grades(whole, later)) == []
