"""The hard cases of `cesim verify` keep their bounds (docs/numerics.md 3); they stand in cesim/verification."""

import math

import numpy as np
import pytest

import cesim
from cesim.verification import Case, cases, measure
from cesim.verification.rows import at_least, at_most, equal, within
from cesim.verification.watch import Watch

TABLE = cases()


def named(case):
    return case.id


@pytest.mark.parametrize("case", [case for case in TABLE if case.quick], ids=named)
def test_a_hard_case_keeps_its_bounds(case):
    result = measure(case, "quick")
    assert result.passed, str(result)


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("case", TABLE, ids=named)
def test_a_hard_case_in_full_size_keeps_its_bounds(case):
    result = measure(case, "full")
    assert result.passed, str(result)


def test_the_table_is_in_order_and_says_why_and_by_what():
    ids = [case.id for case in TABLE]
    assert ids == sorted(set(ids))
    assert all(case.title and case.hard and case.source for case in TABLE)


# ---- the ruler ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("row", "passes"),
    [
        (at_most("x", 1.0, 1.0), True),
        (at_most("x", 1.1, 1.0), False),
        (at_least("x", 1.0, 1.0), True),
        (at_least("x", 0.9, 1.0), False),
        (equal("x", 3, 3), True),
        (equal("x", 3, 4), False),
        (within("x", 2.0, 1.0, 2.0), True),
        (within("x", 2.1, 1.0, 2.0), False),
        *((make("x", math.nan, 1.0), False) for make in (at_most, at_least, equal)),
        (within("x", math.nan, 0.0, 1.0), False),
    ],
)
def test_a_row_passes_inside_its_bound_and_never_without_a_number(row, passes):
    assert row.passed is passes


def test_a_case_that_raises_is_a_row_that_failed():
    def broken(size):
        yield at_most("fine", 0.0, 1.0)
        raise cesim.SimulationError("step 3: it burst")

    result = measure(Case("99", "broken", "it bursts", "none", broken))
    assert [row.passed for row in result.rows] == [True, False]
    assert "it burst" in result.rows[1].note
    assert not result.passed


def test_a_case_without_a_row_has_not_passed():
    assert not measure(Case("99", "empty", "nothing", "none", lambda size: [])).passed


# ---- what is watched in every step -----------------------------------------------------------------------------------


class Meddler:
    """A simulation in which something happens behind the contacts' back."""

    def __init__(self, sim, meddle):
        self.sim, self.meddle = sim, meddle

    def __getattr__(self, name):
        return getattr(self.sim, name)

    def step(self, n=1):
        self.sim.step(n)
        self.meddle(self.sim)


def resting(friction=0.5):
    from cesim.verification.scenes import grain, plane

    sim = cesim.Simulation(plane(friction=friction, materials={"grain": grain(friction=friction)}), threads=1)
    sim.add([(0.0, 0.5e-3, 0.0), (0.9e-3, 0.5e-3, 0.0)], material="grain", diameter=1e-3, velocity=(0.3, 0.0, 0.0))
    return sim


def push(sim):
    sim.velocity[0, 2] += 1e-9


def spin(sim):
    sim.angular_velocity[0] += 1e-5


def stretch(sim):
    sim.orientation[0] *= 1.0 + 1e-11


def spoil(sim):
    sim.charge[0] = np.nan


@pytest.mark.parametrize("meddle", [push, spin, stretch, spoil])
def test_the_watch_sees_what_no_contact_explains(meddle):
    watch = Watch()
    watch.step(resting(), 5)
    assert watch.row().passed, watch.row()
    watch.step(Meddler(resting(), meddle), 1)
    assert not watch.row().passed


def test_the_watch_sees_contacts_that_do_work():
    """A contact that throws a grain up faster than it came: as if restitution were above one."""
    watch = Watch()
    sim = resting(0.0)
    sim.position[0, 1] += 1e-4
    sim.velocity[:] = (0.0, -1.0, 0.0)

    def throw(sim):
        impulses = sim.contacts
        factor = 1.0 + 1e-6
        a = np.searchsorted(sim.ids, impulses["a"])
        before = sim.velocity[a] - impulses["impulse"] / sim.mass[a, None]
        sim.velocity[a] = before + factor * (sim.velocity[a] - before) - 2.0 * before * (0.0, 1.0, 0.0)

    watch.step(Meddler(sim, throw), 1)
    assert not watch.row().passed


# ---- the report ------------------------------------------------------------------------------------------------------


def test_a_report_says_the_same_in_text_data_and_markdown(tmp_path):
    import json

    report = cesim.verify([13, "07"])
    assert report.passed
    assert [result.case.id for result in report.results] == ["07", "13"]
    frame = report.to_pandas()
    assert len(frame) == len(report.rows)
    assert frame["passed"].all()
    for name in ("table.json", "table.md"):
        report.save(tmp_path / name)
    tree = json.loads((tmp_path / "table.json").read_text())
    assert [row["quantity"] for row in tree["rows"]] == frame["quantity"].tolist()
    page = (tmp_path / "table.md").read_text(encoding="utf-8")
    for row in report.rows:
        assert row["quantity"].replace("|", "\\|") in page
        assert row["quantity"] in str(report)
    assert "Known limits" in page
    assert cesim.__version__ in page


def test_an_unknown_case_is_refused_with_the_known_ones():
    with pytest.raises(cesim.InputError, match="not a known case"):
        cesim.verify(["00"])
