"""What accuracy costs: quantities and their intervals, differences, verdicts, rules, and the report."""

from __future__ import annotations

import copy
import functools
import math
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import cesim
from cesim.accuracy import PRESETS, Quantity, difference, measure, pooled, recommend
from cesim.accuracy.converged import Watch
from cesim.accuracy.measure import extrapolated
from cesim.accuracy.picture import draw_panel
from cesim.accuracy.report import Report, wall_time
from cesim.accuracy.rules import round_down
from cesim.cli import main
from cesim.statistics import draws, mean, student, time_blocks

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import accuracy_machines

STEP = 2e-3


def fast_scene(step: float = STEP, rate: str = "300 1/s") -> cesim.Scene:
    """The reference machine, thinly fed with spheres; splitters through both materials."""
    scene = cesim.scenes.sphere_machine()
    scene.feed.rate = rate
    scene.numerics.step = step
    scene.collect.splitters = ("155 mm", "225 mm")
    return scene


@functools.cache
def run_of(seed: int = 1, step: float = STEP, until: float = 3.5) -> cesim.Run:
    return cesim.run(fast_scene(step), seed, until=until, progress=False, frames=None, threads=1)


@functools.cache
def report_of() -> Report:
    return cesim.accuracy_report(
        fast_scene(4e-3), "mean_x[ABS]", vary=("step", "solver", "law"), until="4 s", progress=False
    )


# ---- quantities ------------------------------------------------------------------------------------------------------


def test_a_quantity_by_name_is_the_number_of_the_run():
    run = run_of()
    assert run.estimate("recovery[ABS]") == run.recovery("ABS")
    assert run.estimate("grade[copper]", warmup="1 s").low == run.grade("copper", warmup="1 s").low
    assert run.estimate("middling") == run.middlings()
    rows = run.landings[run.landings["material"] == run.material_names.index("ABS")]
    middle = np.average(rows["position"][:, 0], weights=rows["mass"])
    assert run.estimate("mean_x[ABS]") == pytest.approx(middle, rel=1e-13)
    spread = math.sqrt(np.average((rows["position"][:, 0] - middle) ** 2, weights=rows["mass"]))
    assert run.estimate("spread_x[ABS]") == pytest.approx(spread, rel=1e-9)


@pytest.mark.parametrize("name", ["recovery", "recovery[copper", "mean[ABS]", "middling[ABS]", "", 3, None])
def test_a_quantity_that_is_none_is_refused_with_the_names_there_are(name):
    with pytest.raises(cesim.InputError, match=r"mean_x|quantity"):
        Quantity(name)


def test_the_interval_of_a_mean_is_that_of_independent_grains_where_they_hardly_meet():
    """Of so thin a feed it is sqrt(sum m^2 (x - mean)^2)/sum m; a variance from thirty blocks is known to an eighth."""
    run = run_of(3, 4e-3, 16.0)
    estimate, sample = run.estimate("mean_x[ABS]", warmup="auto"), run.sample("auto")
    mine = sample.material == sample.index("ABS")
    x, mass = sample.x[mine], sample.mass[mine]
    error = math.sqrt(np.sum((mass * (x - float(estimate))) ** 2)) / mass.sum()
    assert estimate.halfwidth == pytest.approx(2.05 * error, rel=0.4)
    assert 0.2 * len(x) < estimate.n_eff <= len(x)


def test_the_statistical_error_falls_as_one_over_the_square_root_of_the_time():
    """Of a run cut into 8, 4, 2 and 1 windows: the mean standard error of a window against its length."""
    run = run_of(3, 4e-3, 16.0)
    sample = run.sample("auto")
    mine = sample.material == sample.index("ABS")
    lengths, errors = [], []
    for windows in (8, 4, 2, 1):
        edges = np.linspace(run.warmup, run.time, windows + 1)
        found = []
        for low, high in pairwise(edges):
            chosen = mine & (sample.time >= low) & (sample.time < high)
            blocks = time_blocks(sample.time[chosen], sample.birth[chosen])[1]
            found.append(mean(sample.x, sample, chosen).halfwidth / student(blocks, 0.95))
        lengths.append(edges[1] - edges[0])
        errors.append(np.mean(found))
    assert np.polyfit(np.log(lengths), np.log(errors), 1)[0] == pytest.approx(-0.5, abs=0.15)


# ---- differences -----------------------------------------------------------------------------------------------------


def test_a_run_differs_by_nothing_from_itself():
    found = difference(Quantity("mean_x[ABS]"), [run_of()], [run_of()])
    assert (float(found.value), found.value.low, found.value.high) == (0.0, 0.0, 0.0)
    assert found.correlation == pytest.approx(1.0)


def test_runs_of_one_feed_are_paired_and_resolve_what_two_seeds_cannot():
    quantity = Quantity("mean_x[ABS]")
    paired = difference(quantity, [run_of()], [run_of(1, STEP / 2)], warmup=1.0)
    assert paired.correlation > 0.9
    assert paired.value.low > 0.0  # the larger step throws farther
    seeds = difference(quantity, [run_of()], [run_of(2)], warmup=1.0)
    assert math.isnan(seeds.correlation)
    assert seeds.value.halfwidth > 5.0 * paired.value.halfwidth
    assert seeds.value.low < 0.0 < seeds.value.high


def test_a_share_that_is_1_in_both_runs_still_has_an_interval():
    found = difference(Quantity("recovery[copper]"), [run_of()], [run_of(2)], splitters=("0.1 m", "0.15 m"))
    assert float(found.value) == 0.0
    assert found.value.low < -0.005
    assert found.value.high > 0.005


def test_seeds_pool_to_a_narrower_interval():
    quantity = Quantity("mean_x[ABS]")
    one, both = quantity.of(run_of(), warmup=1.0), pooled(quantity, [run_of(), run_of(2)], warmup=1.0)
    assert both.halfwidth == pytest.approx(one.halfwidth / math.sqrt(2.0), rel=0.35)
    assert both.n_eff > 1.5 * one.n_eff


def test_draws_of_another_stream_are_others_and_the_same_every_time():
    assert not np.array_equal(draws(20), draws(20, 1))
    assert np.array_equal(draws(20, 1), draws(20, 1))


# ---- compare ---------------------------------------------------------------------------------------------------------


def test_the_verdicts_are_same_different_and_not_resolved():
    a, b, finer = run_of(), run_of(2), run_of(1, STEP / 2)
    assert cesim.compare(a, finer, ["mean_x[ABS]"], tolerance="0.1 mm").verdict == "different"
    assert cesim.compare(a, finer, ["mean_x[ABS]"], tolerance="5 mm").verdict == "same"
    row = cesim.compare(a, b, ["mean_x[ABS]"], tolerance="0.01 mm")["mean_x[ABS]"]
    assert row.verdict == "not resolved"
    assert row.more > 10.0


def test_measured_bins_of_the_same_run_are_the_same_and_of_another_machine_are_different(tmp_path):
    a, path = run_of(), tmp_path / "bins.csv"
    bins = {"n": 60, "x": ("100 mm", "300 mm"), "warmup": a.warmup}
    a.bins(**bins).to_pandas().to_csv(path, index=False)
    same = cesim.compare(a, path, tolerance="3 mm")
    assert same["w1[ABS]"].difference == pytest.approx(0.0, abs=1e-15)
    assert same.verdict == "same"
    frame = a.bins(**bins).to_pandas()
    frame[["left", "right"]] += 5e-3  # another machine: everything lands 5 mm farther
    frame.to_csv(path, index=False)
    other = cesim.compare(a, path)
    assert other.verdict == "different"
    # What both histograms share of the line is compared; the shift is found to a bin.
    assert float(other["mean_x[copper]"].difference) == pytest.approx(-5e-3, abs=1e-3)
    assert "together: different" in str(other)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no rows"),
        ("left,right\n0,1\n", "'mass'"),
        ("left,right,mass\n0,1,x\n", "row 1, mass"),
        ("left,right,mass\n0,1,-1\n", "not below 0"),
        ("left,right,mass\n0,1,nan\n", "finite"),
        ("left,right,mass\n0,0.1,1\n0.2,0.3,1\n", "gaps"),
        ("left,right,mass\n0,0.1,0\n", "no mass"),
        ("left,right,mass,material\n0,0.1,1,gold\n", "gold"),
    ],
)
def test_a_file_of_bins_that_cannot_be_used_is_refused_with_what_is_wrong(tmp_path, text, said):
    path = tmp_path / "bins.csv"
    path.write_text(text)
    with pytest.raises(cesim.InputError, match=said):
        cesim.compare(run_of(), path)
    with pytest.raises(cesim.InputError, match="cannot be read"):
        cesim.compare(run_of(), tmp_path / "none.csv")


# ---- converged -------------------------------------------------------------------------------------------------------


def test_a_run_goes_on_until_its_interval_is_narrow_enough(tmp_path):
    goal = cesim.Converged("mean_x[ABS]", halfwidth="1 mm")
    run = cesim.run(fast_scene(), 4, until=goal, progress=False, frames=None, threads=1, save=tmp_path / "run.h5")
    assert run.complete
    estimate = run.estimate("mean_x[ABS]", warmup="auto")
    assert estimate.halfwidth <= 1e-3
    assert run.time < 60.0
    assert "mean_x[ABS] = " in str(cesim.open(tmp_path / "run.h5"))
    assert "NOT reached" not in str(run)


def test_a_run_that_does_not_converge_in_time_says_so():
    goal = cesim.Converged("mean_x[ABS]", halfwidth="0.001 mm", most="3 s")
    run = cesim.run(fast_scene(), until=goal, progress=False, frames=None, threads=1)
    assert run.time == pytest.approx(3.0)
    assert "NOT reached" in str(run)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("mean_x[ABS]", 0.0), "above 0"),
        (("mean_x[ABS]", "1 s"), "halfwidth"),
        (("nonsense", 0.1), "quantity"),
        (("mean_x[ABS]", 0.1, 2.0), "between 0 and 1"),
        (("mean_x[gold]", 0.1), "gold"),
    ],
)
def test_a_goal_that_cannot_be_reached_is_refused_before_the_run(arguments, said):
    with pytest.raises(cesim.InputError, match=said):
        cesim.run(fast_scene(), until=cesim.Converged(*arguments), progress=False)


def test_a_share_needs_splitters_and_a_feed():
    scene = fast_scene()
    scene.collect.splitters, scene.splitters = None, []
    with pytest.raises(cesim.InputError, match="no splitters"):
        cesim.run(scene, until=cesim.Converged("recovery[ABS]", 0.1), progress=False)
    with pytest.raises(cesim.InputError, match="no feed"):
        cesim.run(cesim.scenes.single_particle(), until=cesim.Converged("mean_x[ABS]", 0.1), progress=False)


def landed(seed: int, until: float) -> np.ndarray:
    """Landings of independent grains, 220 a second, each 0.8 s under way; the mean is 0."""
    random = np.random.default_rng(seed)
    rows = np.zeros(round(220 * until), run_of().landings.dtype)
    rows["t"] = np.sort(random.uniform(0.0, until, len(rows)))
    rows["birth"] = rows["t"] - random.normal(0.8, 0.05, len(rows))
    rows["material"] = run_of().material_names.index("ABS")
    rows["mass"] = random.lognormal(0.0, 0.6, len(rows))
    rows["position"][:, 0] = random.normal(0.0, 8e-3, len(rows))
    return rows


def stopped(seed: int, goal: cesim.Converged, longest: float = 80.0) -> cesim.Run:
    """A run of such landings, as long as the goal asks for."""
    rows, watch = landed(seed, longest), Watch(goal)
    while watch.look < longest:
        run = copy.copy(run_of())
        run.time = watch.look
        run.__dict__["warmup"] = 0.9
        run.landings = rows[rows["t"] <= run.time]
        if watch.is_satisfied(run):
            return run
    raise AssertionError("never narrow enough")


def test_stopping_when_the_interval_is_narrow_costs_little_of_its_coverage():
    """Intervals of 95 % after 400 runs: those of the first narrow look hold the truth in 91.5 %, these in 95 %."""
    goal = cesim.Converged("mean_x[ABS]", halfwidth="0.4 mm")
    found = [goal.estimate(stopped(seed, goal)) for seed in range(400)]
    assert max(estimate.halfwidth for estimate in found) <= 0.4e-3
    assert sum(estimate.low <= 0.0 <= estimate.high for estimate in found) >= 0.93 * 400


def test_a_setting_with_which_grains_stay_too_long_is_a_failure_of_its_own(monkeypatch):
    original = measure._run

    def slow_ccp(scene, seed, until):
        run = original(scene, seed, until)
        if scene.numerics.contact_law == "ccp":
            monkeypatch.setitem(run.__dict__, "warmup", 3.9)
        return run

    monkeypatch.setattr(measure, "_run", slow_ccp)
    report = cesim.accuracy_report(fast_scene(4e-3), "mean_x[ABS]", vary="law", until="4 s", progress=False)
    (law,) = [point for point in report.points if point.knob == "law"]
    assert law.failure == "one grain in a hundred stays 3.9 s, too long for runs of 4 s"
    assert report.warmup < 2.0


def test_runs_are_lengthened_where_grains_stay_longer_than_the_pilot_sees(monkeypatch):
    monkeypatch.setattr(measure, "_duration", lambda *_: 1.5)
    report = cesim.accuracy_report(fast_scene(4e-3), "mean_x[ABS]", "1 s", ("law",), progress=False)
    assert report.own.simulated == report.points[1].simulated > 3.0
    assert report.warmup < 0.6 * report.own.simulated


@pytest.mark.slow
def test_a_converged_run_holds_the_truth_in_at_least_90_of_100_repeats():
    """The truth is the mean of the repeats, each known to 0.5 mm: together they know it ten times better."""
    goal = cesim.Converged("mean_x[ABS]", halfwidth="0.5 mm")
    found = [
        cesim.run(fast_scene(4e-3), seed, until=goal, progress=False, frames=None, threads=1).estimate(
            "mean_x[ABS]", warmup="auto"
        )
        for seed in range(1000, 1100)
    ]
    truth = np.mean(found)
    held = sum(estimate.low <= truth <= estimate.high for estimate in found)
    assert held >= 90


# ---- rules -----------------------------------------------------------------------------------------------------------


def test_the_rule_that_binds_is_named_and_is_the_shortest():
    scene = cesim.scenes.sphere_machine()
    fine = recommend(scene, "0.2 mm")
    assert fine.binding.name == "leaving"
    assert fine.step <= fine.binding.step == min(rule.step for rule in fine.rules)
    scene.feed.size = cesim.Constant(diameter="0.1 mm")
    powder = recommend(scene, "20 mm")
    assert powder.binding.name == "path"
    assert "<- binds" in str(powder)
    assert powder.apply(scene).numerics.step == powder.step
    assert scene.numerics.step == 1e-3  # a copy was changed


def test_flakes_may_turn_farther_in_a_step_than_angular_grains_and_rods_less():
    """Limits as measured: benchmarks/turn_per_step.py, docs/accuracy.md."""

    def limit(shape):
        scene = cesim.scenes.reference_machine()
        scene.feed = cesim.Feed(rate="100 1/s", mix={"ABS": 1.0}, size=cesim.Constant(diameter="0.6 mm"), shape=shape)
        return next(rule.step for rule in recommend(scene, "1 mm").rules if rule.name == "rotation")

    angular = limit(cesim.Angular(seed=1))
    assert angular == pytest.approx(0.6e-3 / (2.0 * 1.126), rel=0.01)  # 1.126 m/s: 1.5 times the drum's 0.751
    assert limit(cesim.Flake()) == pytest.approx(4.0 * angular)
    assert limit(cesim.Rod()) == pytest.approx(0.5 * angular)
    assert math.isinf(limit(cesim.Sphere()))


def test_the_step_shortens_with_the_error_asked_for_and_the_presets_with_it():
    scene = cesim.scenes.sphere_machine()
    assert recommend(scene, "0.1 mm").step == pytest.approx(recommend(scene, "0.4 mm").step / 2.0, rel=0.2)
    found = [(preset.step, preset.tolerance) for preset in (cesim.accuracy.preset(scene, name) for name in PRESETS)]
    assert found == sorted(found, reverse=True)
    assert len(set(found)) == 3
    assert found[0][0] > found[-1][0]


def test_steps_are_rounded_down_to_a_short_series():
    assert [round_down(x) for x in (9.99e-4, 1e-3, 6.29e-4, 1.9e-5)] == [8e-4, 1e-3, 5e-4, 1.6e-5]


def test_a_preset_sets_step_and_solver_and_is_told_in_the_result():
    run = cesim.run(fast_scene(), until="0.2 s", accuracy="draft", progress=False, frames=None)
    assert run.attrs["step"] == cesim.accuracy.preset(fast_scene(), "draft").step
    assert "accuracy draft: made for 4 mm of mean landing x; on the sphere machine it has" in str(run)
    with pytest.raises(cesim.InputError, match="'draft', 'standard', 'fine'"):
        cesim.run(fast_scene(), accuracy="best")


def test_a_step_too_large_for_the_finest_grain_is_told_with_numbers():
    scene = fast_scene()
    scene.feed.size = cesim.Constant(diameter="0.1 mm")
    text = str(cesim.run(scene, until="0.05 s", progress=False, frames=None))
    assert "steps of 2 ms are too large for the finest grains" in text


# ---- report ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_the_order_and_what_is_left_beyond_the_finest_step_are_found(order):
    changes = {h: 3.0 * h**order - 3.0 * 4.0**order for h in (1.0, 2.0, 4.0, 8.0)}
    left, found = extrapolated(changes)
    assert found == pytest.approx(order)
    assert left == pytest.approx(-3.0)


def test_an_order_that_cannot_be_is_not_told():
    left, order = extrapolated({1.0: 0.3, 2.0: 0.1, 4.0: 0.2})
    assert math.isnan(order)
    assert left == pytest.approx(0.2)  # as of first order


def test_wall_time_goes_on_at_the_pace_of_the_second_half():
    course = np.array([[1.0, 1.0], [2.0, 3.0], [3.0, 5.0], [4.0, 7.0]])
    assert wall_time(course, 1.5) == 2.0
    assert wall_time(course, 6.0) == pytest.approx(11.0)


def test_where_grains_gather_the_pace_goes_on_to_rise_and_noise_is_no_rise():
    time = np.linspace(0.1, 4.0, 40)
    assert wall_time(np.column_stack([time, time**2]), 8.0) == pytest.approx(64.0, rel=1e-2)
    noise = np.random.default_rng(1).uniform(0.9, 1.1, len(time))
    assert wall_time(np.column_stack([time, np.cumsum(0.1 * noise)]), 40.0) == pytest.approx(40.0, rel=0.1)


def test_the_error_of_the_step_is_of_second_order():
    assert report_of().order == pytest.approx(2.0, abs=0.5)


def test_a_knob_without_effect_is_not_ranked_and_the_law_is_different():
    report = report_of()
    verdicts = {point.label: point.verdict for point in report.points}
    assert verdicts["pgs"] == "not resolved"
    assert verdicts["ccp"] == "different"
    assert verdicts["seed 2"] == "not resolved"
    assert "pgs" not in {point.label for point in report.pareto}
    times = [point.wall for point in report.pareto]
    assert times == sorted(times)
    errors = [abs(point.error) for point in report.pareto]
    assert errors == sorted(errors, reverse=True)


def test_the_split_names_sampling_and_the_step():
    shares = {share.source.partition(":")[0]: share for share in report_of().split}
    assert shares["sampling"].size == report_of().own.answer.halfwidth
    assert shares["step"].resolved
    assert shares["step"].size == report_of().own.error


def test_a_recommendation_keeps_the_error_by_its_own_numbers():
    report = report_of()
    choice = report.recommend("6 mm")
    assert choice.error <= 6e-3
    assert choice.wall > 0.0
    assert choice.apply(fast_scene()).numerics.step == choice.step
    finer = report.recommend("3 mm")
    assert finer.wall > choice.wall
    with pytest.raises(cesim.InputError, match="below what the steps tried can reach"):
        report.recommend("0.0001 mm")


def test_a_report_comes_back_from_its_file_and_draws(tmp_path):
    report = report_of()
    report.save(tmp_path / "accuracy.h5")
    again = Report.load(tmp_path / "accuracy.h5")
    assert str(again) == str(report)
    assert str(again.recommend("6 mm")) == str(report.recommend("6 mm"))
    again.plot(tmp_path / "accuracy.png")
    assert (tmp_path / "accuracy.png").stat().st_size > 10_000
    with pytest.raises(cesim.InputError, match="cannot be read"):
        Report.load(tmp_path / "none.h5")
    assert len(report.to_pandas()) == len(report.points)


def test_a_setting_that_fails_is_a_failure_in_the_report(monkeypatch):
    run = measure._run

    def fails_at_ccp(scene, seed, until):
        if scene.numerics.contact_law == "ccp":
            raise cesim.SimulationError("step 7: position of grain 3 is nan")
        return run(scene, seed, until)

    monkeypatch.setattr(measure, "_run", fails_at_ccp)
    report = cesim.accuracy_report(fast_scene(4e-3), "mean_x[ABS]", vary="law", until="4 s", progress=False)
    (failure,) = [point for point in report.points if point.failure]
    assert failure.verdict == "failed"
    assert "grain 3 is nan" in str(report)
    assert failure not in report.pareto


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"vary": "colour"}, "knob"),
        ({"quantity": "mean_x[gold]"}, "gold"),
        ({"budget": "-1 s"}, "budget"),
        ({"until": "0.5 s"}, "too few grains|stays"),
    ],
)
def test_a_report_that_cannot_be_made_is_refused(options, said):
    with pytest.raises(cesim.InputError, match=said):
        cesim.accuracy_report(fast_scene(), **{"quantity": "mean_x[ABS]", "progress": False, **options})


def test_the_command_writes_report_and_picture_and_makes_it_again(tmp_path, capsys):
    file = tmp_path / "a.h5"
    arguments = ["-q", "mean_x[ABS]", "--vary", "law", "--until", "3 s", "--no-progress", "--save", str(file)]
    settings = ["--set", "feed.rate=300 1/s", "--set", "numerics.step=4 ms"]
    assert main(["accuracy", "sphere_machine", *settings, *arguments]) == 0
    first = capsys.readouterr().out
    assert file.with_suffix(".png").exists()
    assert f"again: cesim accuracy {file} -q 'mean_x[ABS]' --until 3 --seed 1 --vary law" in first
    assert main(["accuracy", str(file), *arguments]) == 0
    answers = [line.partition(" in ")[0] for line in (first, capsys.readouterr().out)]
    assert answers[0] == answers[1]


def test_a_panel_draws_failures_as_crosses_and_what_is_not_resolved_hollow():
    report = report_of()
    failing = replace(report, points=[*report.points, measure.failed(("solver", "apgd", math.nan), "step 7: nan")])
    figure = Figure()
    ax = figure.subplots()
    draw_panel(ax, failing)
    crosses = [line for line in ax.lines if line.get_marker() == "x"]
    assert len(crosses) == 1
    assert "solver apgd: failed" in [text.get_text() for text in ax.texts]
    hollow = [line for line in ax.lines if line.get_markerfacecolor() == "none" and len(line.get_xdata())]
    unresolved = [p for p in report.points if p.verdict == "not resolved" and p.knob != "seed"]
    assert {float(line.get_xdata()[0]) for line in hollow} == {point.wall for point in unresolved}


def test_the_page_of_machines_tells_every_setting_and_ranks_only_what_is_resolved(tmp_path, monkeypatch):
    monkeypatch.setattr(accuracy_machines, "WANTED", ("1 mm", "0.05 mm"))
    report = report_of()
    failing = replace(report, points=[*report.points, measure.failed(("solver", "apgd", math.nan), "step 7: nan")])
    machine = replace(accuracy_machines.MACHINES[0], quantity="mean_x[ABS]")
    text = accuracy_machines.page([(machine, failing)])
    for point in failing.points:
        assert f"| {point.knob} | {point.label} |" in text
    assert "**failed**: step 7: nan" in text
    (front,) = [line for line in text.splitlines() if line.startswith("Not beaten")]
    assert "pgs" not in front
    assert "- 0.05 mm: no step that was tried" in text  # 1 ms is the finest: it is off by 0.4 mm
    accuracy_machines.draw([(machine, failing)], tmp_path / "machines.png")
    assert (tmp_path / "machines.png").stat().st_size > 10_000


@pytest.mark.parametrize("machine", accuracy_machines.MACHINES, ids=lambda machine: machine.name)
def test_a_machine_of_the_page_is_legal_and_feeds_what_is_asked_of_it(machine):
    scene = machine.scene()
    scene.check()
    fed = {family.material for family in scene.feed.all_families()}
    assert Quantity(machine.quantity).material in fed
