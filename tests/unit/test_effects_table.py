"""The table of `scene.effects()`: choices, predicted shifts, measured costs and the audit."""

import dataclasses
import json
import math

import numpy as np
import pytest

import cesim
from cesim import Brush, Collect, Constant, Corona, Drum, Electrode, Feed, InputError, Outlet, Plate, Scene
from cesim.cli import main
from cesim.cli.settings import factors
from cesim.effects import Audit, audit, cost, measure
from cesim.effects.audits import END, LEAST_SHIFT, _compared
from cesim.scene.choices import COVERAGE, coverage
from cesim.statistics import Sample, mean

DROP = Outlet(center=(0.0, 0.164, 0.0), length="10 mm", width="100 mm")


def thin(rate="0.1 kg/h", diameter="1 mm", mix=None, **parts):
    """A feed that falls straight on the drum, so thin that grains hardly meet."""
    feed = Feed(
        rate=rate,
        mix=mix or {"copper": 0.5, "ABS": 0.5},
        size=Constant(diameter=diameter),
        outlet=DROP,
        velocity=(0.7, 0.0, 0.0),
    )
    machine = {
        "drum": Drum(rolling_friction=0.35),
        "electrode": Electrode(),
        "corona": Corona(),
        "brush": Brush(),
        "collect": Collect(y=-0.10),
    }
    return Scene(name="thin", feed=feed, **machine | parts)


# ---- choices ---------------------------------------------------------------------------------------------------------


def test_coverage_is_that_of_the_formula():
    scene = thin(rate="3 kg/h", diameter="0.8 mm", mix={"copper": 1.0})
    density, speed = scene.materials["copper"].density, scene.drum.speed * scene.drum.radius
    expected = 3.0 / 3600.0 / 0.1 / (2.0 / 3.0 * density * 0.8e-3 * speed)
    assert coverage(scene) == {"drum": pytest.approx(expected, rel=1e-9)}
    scene.plates = [Plate(motion={"kind": "belt", "speed": 0.5 * speed})]
    assert coverage(scene)["plates[0]"] == pytest.approx(2.0 * expected, rel=1e-9)
    grain = density * math.pi / 6.0 * 0.8e-3**3
    scene.feed.rate = f"{3.0 / 3600.0 / grain} 1/s"
    assert coverage(scene)["drum"] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("share", "on"), [(0.9, False), (1.1, True)])
def test_below_a_coverage_of_one_percent_grains_fly_alone(share, on):
    scene = thin(rate="1 kg/h", mix={"copper": 1.0})
    scene.feed.rate = float(scene.feed.rate) * share * COVERAGE / coverage(scene)["drum"]
    row = scene.effects()["grain_contact"]
    assert (row.on, row.threshold) == (on, COVERAGE)
    assert row.size == pytest.approx(share * COVERAGE)
    assert scene.definition()["grain_contact"] is on
    assert f"{share:.1f} % of drum" in row.why


def test_grains_may_meet_wherever_they_can_gather_and_where_nobody_knows_how_many_come():
    assert not thin().effects()["grain_contact"].on
    resting = thin(plates=[Plate()]).effects()["grain_contact"]
    assert resting.on
    assert "gather on plates[0]" in resting.why
    by_hand = cesim.scenes.single_particle().effects()["grain_contact"]
    assert by_hand.on
    assert "by hand" in by_hand.why
    assert thin(drum=None, electrode=None, corona=None).effects()["grain_contact"].on


def test_choices_are_set_like_effects_and_as_true_and_false():
    scene = thin()
    for given, stored in ((True, "on"), (False, "off"), ("on", "on"), ("off", "off")):
        scene.numerics.grain_contact = given
        assert scene.numerics.grain_contact == stored
        assert scene.definition()["grain_contact"] is (stored == "on")
        assert f"set {stored}" in scene.effects()["grain_contact"].why
    assert Scene.from_toml("[numerics]\nrotation = false\n").numerics.rotation == "off"
    with pytest.raises(InputError, match=r"numerics\.rotation"):
        scene.numerics.rotation = "perhaps"


def test_spheres_without_friction_need_not_turn():
    scene = thin(drum=Drum(friction=0.0), brush=None)
    for material in scene.materials.values():
        material.friction = material.rolling_friction = material.spinning_friction = 0.0
    assert not scene.effects()["rotation"].on
    assert not scene.effects()["gyroscopic"].on
    scene.drum.friction = 0.1
    assert scene.effects()["rotation"].on
    scene.drum.friction = 0.0
    scene.feed.shape = cesim.Rod(aspect=3)
    decisions = scene.effects()
    assert decisions["rotation"].on
    assert decisions["gyroscopic"].on
    assert 0.0 < decisions["gyroscopic"].size < 1.0
    definition = scene.definition()
    assert definition["rotation"] is definition["gyroscopic"] is True
    scene.numerics.gyroscopic = "off"
    assert scene.definition()["gyroscopic"] is False


def test_the_drag_law_has_the_error_of_stokes_law():
    row = thin(diameter="0.5 mm").effects()["drag_law"]
    speed = math.sqrt((44.8 * math.pi / 30.0 * 0.16) ** 2 + 2.0 * 9.81 * 0.26)
    reynolds = 1.204 * speed * 0.5e-3 / 1.81e-5
    assert row.size == pytest.approx(0.15 * reynolds**0.687, rel=1e-6)
    assert row.on
    scene = thin()
    scene.air.law = "stokes"
    assert not scene.effects()["drag_law"].on
    assert "above Stokes'" in scene.effects()["drag_law"].why


def test_charging_takes_its_time_where_the_time_constant_is_no_sliver_of_the_arc():
    scene = thin(corona=Corona(arc=("10 deg", "60 deg"), field="400 kV/m", current_density="1 mA/m2"))
    row = scene.effects()["charging_kinetics"]
    stay = math.radians(50.0) / (44.8 * math.pi / 30.0)
    assert row.size == pytest.approx(4.0 * 8.8541878188e-12 * 4e5 / 1e-3 / stay, rel=1e-6)
    assert row.on
    scene.corona.current_density = None
    assert not scene.effects()["charging_kinetics"].on
    assert math.isnan(scene.effects()["charging_kinetics"].size)


def test_the_ends_of_the_drum_are_a_gap_wide():
    row = thin().effects()["field_ends"]  # good for |z| < 150 - 88 mm, the feed is 100 mm wide
    assert (row.size, row.on) == (0.0, False)
    scene = thin()
    scene.feed.outlet.width = "300 mm"
    assert scene.effects()["field_ends"].size == pytest.approx(88.0 / 150.0)


# ---- the table -------------------------------------------------------------------------------------------------------


def test_the_table_has_effects_and_choices_and_says_how_far_each_moves_a_landing():
    decisions = thin().effects()
    text = str(decisions)
    assert [line.split()[0] for line in text.splitlines() if " on? " in line] == ["effect", "choice"]
    assert list(decisions.to_pandas()["name"]) == [row.name for row in (*decisions, *decisions.choices)]
    assert {row.name for row in decisions.choices} >= {"grain_contact", "rotation", "gyroscopic", "drag_law"}
    force = decisions["electric_force"]
    assert force.shifts["copper"] > 0.0 > force.shifts["ABS"]
    assert force.shift == max(abs(shift) for shift in force.shifts.values())
    assert f"{1e3 * max(force.shifts.values(), key=abs):+.3g} mm" in text


def test_a_result_file_has_the_decisions_it_began_with(tmp_path):
    scene = thin()
    run = cesim.run(scene, until="20 ms", save=tmp_path / "run.h5", progress=False)
    assert str(cesim.Run.load(tmp_path / "run.h5").decisions) == str(scene.effects())
    assert {row["name"]: row["on"] for row in run.effects}["grain_contact"] is False


def test_without_a_landing_plane_only_the_bound_is_known():
    drag = thin(collect=None).effects()["drag"]
    assert drag.shifts == {}
    assert drag.shift == pytest.approx(0.24 * min(drag.size, 1.0))


def test_an_effect_shifts_no_farther_than_its_size_allows():
    """docs/physics.md 0.5: half g t^2 times the size, for uncharged grains in the same air."""
    for diameter in ("10 mm", "3 mm", "1 mm"):
        drag = thin(diameter=diameter, mix={"copper": 1.0}, electrode=None, corona=None).effects()["drag"]
        assert 0.1 * 0.24 * drag.size < drag.shift < 0.24 * drag.size


# ---- costs -----------------------------------------------------------------------------------------------------------


def test_what_is_off_costs_nothing_and_what_is_on_is_timed():
    scene = thin(rate="2 kg/h")
    scene.effects["drag"] = "off"
    decisions = measure(scene, at="0.3 s", repeats=2)
    assert decisions["drag"].cost == 0.0
    assert all(0.0 <= row.cost < 1.0 for row in decisions)
    assert math.isnan(scene.effects()["drag"].cost)


def test_a_cost_is_what_a_step_without_it_saves():
    quickest = {
        "": {"charge": 1.0, "force": 3.0, "detect": 4.0, "solve": 2.0},
        "drag": {"charge": 1.0, "force": 1.0, "detect": 9.0, "solve": 9.0},
        "grain_contact": {"charge": 1.0, "force": 3.0, "detect": 1.0, "solve": 1.0},
    }
    decisions = thin(rate="20 kg/h").effects()
    assert cost._cost(decisions["drag"], quickest, 10.0) == pytest.approx(0.2)
    assert cost._cost(decisions["grain_contact"], quickest, 10.0) == pytest.approx(0.4)
    assert math.isnan(cost._cost(decisions["electric_force"], quickest, 10.0))


# ---- audit -----------------------------------------------------------------------------------------------------------


def test_an_audit_finds_the_effect_that_was_dropped_wrongly():
    scene = thin(diameter="0.3 mm")
    scene.effects["drag"] = "off"
    found = audit(scene, grains=150, effects=["drag", "electric_force"], progress=False)
    assert {(row.name, row.material) for row in found.wrong} == {("drag", "copper"), ("drag", "ABS")}
    assert {row.verdict for row in found if row.name == "electric_force"} == {"needed"}
    assert "wrong: drag (copper)" in found.summary()


def test_an_audit_confirms_what_was_dropped_rightly():
    scene = thin(rate="20 kg/h", diameter="10 mm", mix={"copper": 1.0})
    scene.feed.outlet.center = (0.0, 0.17, 0.0)
    found = audit(scene, grains=60, effects=["drag"], progress=False)
    (drag,) = found
    assert not drag.on
    assert drag.verdict == "confirmed"
    assert abs(drag.measured) < LEAST_SHIFT == pytest.approx(0.84e-3)


def test_the_prediction_is_near_what_the_audit_measures():
    found = audit(thin(), grains=200, effects=["drag", "electric_force", "image_force", "drag_law"], progress=False)
    for row in found:
        assert row.predicted == pytest.approx(row.measured, rel=0.15, abs=0.3e-3)


def test_an_audit_compares_the_same_grains_with_the_effect_and_without():
    """By hand: two simulations of one seed, differences by id, weighted by mass."""
    scene = thin(rate="1 kg/h", mix={"ABS": 1.0})
    (row,) = audit(scene, grains=40, seed=3, effects=["drag"], progress=False)
    scene.feed.stop = 40 / (1.0 / 3600.0 / (scene.materials["ABS"].density * math.pi / 6.0 * 1e-9))
    landed = {}
    for state in ("on", "off"):
        scene.effects["drag"] = state
        sim = cesim.Simulation(scene, seed=3)
        sim.run("2 s")
        landed[state] = np.sort(sim.landings, order="id")
        assert sim.count == 0
    assert (landed["on"]["id"] == landed["off"]["id"]).all()
    moved = landed["on"]["position"][:, 0] - landed["off"]["position"][:, 0]
    assert row.pairs == len(moved)
    assert row.landed == 1.0
    assert row.measured == pytest.approx(np.average(moved, weights=landed["on"]["mass"]), rel=1e-12)


@pytest.mark.parametrize(("on", "sign"), [(True, 1.0), (False, -1.0)])
def test_a_shift_common_to_all_grains_is_found_exactly_with_the_sign_of_the_effect(on, sign):
    rng = np.random.default_rng(2)
    here = np.zeros(300, END)
    here["id"], here["mass"], here["x"] = np.arange(300), 1e-6, rng.normal(0.2, 0.1, 300)
    here["birth"] = np.arange(300) * 0.01
    here["t"] = here["birth"] + 0.5
    there = rng.permutation(here)
    there["x"] -= 1e-3
    decision = dataclasses.replace(thin().effects()["drag"], on=on)
    row = _compared(decision, "copper", 0, here, there, 0.95)
    assert (row.low, row.measured, row.high) == pytest.approx((1e-3 * sign,) * 3, rel=1e-9)
    assert row.verdict == ("needed" if on else "wrong")


def test_what_is_amplified_shifts_in_proportion():
    scene = thin()
    plain, strong = (
        audit(scene, grains=100, effects=["dielectrophoresis"], amplify=amplify, progress=False)
        for amplify in (None, {"dielectrophoresis": 30.0})
    )
    for one, other in zip(plain, strong, strict=True):
        assert other.measured == pytest.approx(one.measured, rel=0.1)
        assert abs(other.measured) > 1e-7
        assert (one.amplified, other.amplified) == (1.0, 30.0)
        assert other.verdict == "confirmed"
    assert "dielectrophoresis x 30" in str(strong)


@pytest.mark.parametrize(
    ("amplify", "message"),
    [
        ({"dielectrophoresis": 0.5}, r"amplify\[dielectrophoresis\].*0.5, outside \[1, 1000\]"),
        ({"magnus": 10.0}, "no parameter 'strength'"),
        ({"dielectrophoreses": 10.0}, "did you mean 'dielectrophoresis'"),
    ],
)
def test_what_cannot_be_amplified_is_refused(amplify, message):
    with pytest.raises(cesim.InputError, match=message):
        audit(thin(), grains=10, amplify=amplify, progress=False)


def test_the_command_line_amplifies_in_an_audit_alone(capsys):
    assert factors(["dielectrophoresis=50"]) == {"dielectrophoresis": 50.0}
    for arguments in (["--amplify", "dielectrophoresis=50"], ["--audit", "--amplify", "dielectrophoresis"]):
        assert main(["effects", "single_particle", *arguments]) == 2
        assert "--amplify" in capsys.readouterr().err


def test_only_what_is_off_is_amplified():
    scene = thin()
    scene.effects["dielectrophoresis"] = "on"
    with pytest.raises(cesim.InputError, match="only what is left out"):
        audit(scene, grains=10, amplify={"dielectrophoresis": 10.0}, progress=False)


def test_an_audit_is_the_same_every_time_and_with_any_number_of_threads(tmp_path):
    scene = thin(rate="3 kg/h")
    first, second = (audit(scene, grains=60, effects=["drag"], threads=n, progress=False) for n in (1, 2))
    assert first.to_json() == second.to_json()
    for name in ("audit.json", "audit.h5"):
        first.save(tmp_path / name)
        assert Audit.load(tmp_path / name).to_json() == first.to_json()
    assert list(first.to_pandas()["verdict"]) == [row.verdict for row in first]
    (tmp_path / "other.json").write_text(json.dumps({"format": "shopping"}))
    with pytest.raises(InputError, match="not an audit"):
        Audit.load(tmp_path / "other.json")


def test_what_has_no_other_way_is_not_run():
    found = thin(brush=None).effects.audit(grains=20, effects=["brush_discharge", "field_ends"], progress=False)
    assert {row.verdict for row in found} == {"nothing to switch"}


def test_an_audit_needs_a_feed_and_a_landing_plane():
    with pytest.raises(InputError, match="no feed"):
        audit(cesim.scenes.single_particle(), progress=False)
    with pytest.raises(InputError, match="no landing plane"):
        audit(thin(collect=None), progress=False)


# ---- the mean and its interval ---------------------------------------------------------------------------------------


def test_the_interval_of_a_mean_is_that_of_independent_draws():
    rng = np.random.default_rng(5)
    n = 4000
    when = np.sort(rng.random(n)) * 100.0
    sample = Sample(np.zeros(n), np.ones(n), np.zeros(n, int), when, when - 0.5, ("a",))
    everything = np.full(n, True)
    found = mean(rng.normal(2.0, 3.0, n), sample, everything)
    assert found.low < 2.0 < found.high
    assert found.halfwidth == pytest.approx(1.984 * 3.0 / math.sqrt(n), rel=0.2)
    assert mean(np.full(n, 0.25), sample, everything).halfwidth == pytest.approx(0.0, abs=1e-15)
    assert math.isnan(mean(np.zeros(n), sample, ~everything))


def test_a_mean_is_weighted_by_mass():
    sample = Sample(np.zeros(2), np.array([1.0, 3.0]), np.zeros(2, int), np.zeros(2), np.zeros(2), ("a",))
    assert float(mean(np.array([0.0, 1.0]), sample, np.full(2, True))) == pytest.approx(0.75)
