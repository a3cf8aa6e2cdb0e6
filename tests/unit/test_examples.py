"""Every example runs as a user calls it, with settings that make it short, and says something that must hold."""

import csv
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image

EXAMPLES = Path(__file__).parents[2] / "examples"

pytestmark = pytest.mark.skipif(not EXAMPLES.is_dir(), reason="an installed package has no examples/")


def example(name, *arguments, cwd, code=0):
    """Run an example in a folder; return what it printed."""
    command = [sys.executable, str(EXAMPLES / name), *map(str, arguments)]
    environment = os.environ | {"MPLBACKEND": "agg"}
    done = subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=environment, timeout=240, check=False)
    assert done.returncode == code, done.stderr[-3000:]
    return done.stdout if code == 0 else done.stderr


def assert_is_a_picture(path):
    """A PNG of some size in which something is drawn, in colour."""
    pixels = image.imread(path)[..., :3]
    assert min(pixels.shape[:2]) > 300
    assert pixels.std() > 0.05
    assert (pixels.max(axis=-1) - pixels.min(axis=-1) > 0.2).mean() > 1e-3


def test_one_metal_grain_leaves_earlier_and_lands_farther_than_one_of_plastic(tmp_path):
    text = example("one_particle.py", cwd=tmp_path)
    number = r"[-+]?[\d.]+"
    line = rf"(\w+) +leaves the drum at ({number}) s, ({number}) degrees .* with ({number}) pC; .* x = ({number}) mm"
    found = {name: [float(v) for v in values] for name, *values in re.findall(line, text)}
    (time, angle, charge, x), (time_abs, angle_abs, charge_abs, x_abs) = found["copper"], found["ABS"]
    assert time < time_abs
    assert 0 < angle < angle_abs
    assert charge > 0 > charge_abs  # by the drum, against the electrode's sign; by its ions, with it
    assert x > x_abs
    assert_is_a_picture(tmp_path / "one_particle.png")


def test_composites_of_more_copper_land_farther_and_by_their_pose(tmp_path):
    text = example("composites.py", "--grains", 4, cwd=tmp_path)
    rows = re.findall(r"(\d+)% copper: composites land at (\d+) mm \((\d+) to (\d+)\), mixtures at (\d+) mm", text)
    shares, middles, nearest, farthest, mixtures = np.array(rows, float).T
    plastic, copper = (float(re.search(rf"{name} spheres land at (\d+)", text)[1]) for name in ("PVC", "copper"))
    assert np.all(np.diff(shares) > 0)
    assert np.all(np.diff(middles) > 0)
    assert farthest[0] > nearest[0]
    assert np.all((middles > plastic) & (middles < copper))
    assert np.all((mixtures > plastic) & (mixtures < copper))
    assert_is_a_picture(tmp_path / "composites.png")


def test_the_sweep_writes_a_map_and_a_table_in_the_order_of_the_grid(tmp_path):
    arguments = ("--speeds", 30, 60, "--voltages", 10, 35, "--until", 1.6, "--workers", 2, "--out", "map.png")
    assert "written map.png, map.csv" in example("drum_speed_voltage.py", *arguments, cwd=tmp_path)
    assert_is_a_picture(tmp_path / "map.png")
    with (tmp_path / "map.csv").open(newline="") as file:
        rows = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]
    assert [(row["speed_rpm"], row["voltage_kV"]) for row in rows] == [(30, -10), (30, -35), (60, -10), (60, -35)]
    for row in rows:
        for name in ("recovery[copper]", "recovery[ABS]"):
            assert 0 <= row[f"{name}.low"] <= row[name] <= row[f"{name}.high"] <= 1
    slow_weak, slow_strong, fast_weak, fast_strong = rows
    assert slow_strong["recovery[ABS]"] > slow_weak["recovery[ABS]"]  # voltage holds plastic
    assert fast_strong["recovery[ABS]"] > fast_weak["recovery[ABS]"]
    assert fast_strong["recovery[copper]"] > slow_weak["recovery[copper]"]  # speed throws metal


def test_a_sweep_that_ends_before_anything_counts_is_refused(tmp_path):
    text = example("drum_speed_voltage.py", "--until", 0.5, cwd=tmp_path, code=2)
    assert "--until must be more than" in text
    assert not list(tmp_path.iterdir())


def test_the_best_splitters_reach_the_grade_and_stand_in_order(tmp_path):
    text = example("splitter_positions.py", "--until", 1.8, "--grade", 0.9, cwd=tmp_path)
    left, right = (float(v) for v in re.search(r"splitters at ([\d.]+) and ([\d.]+) mm", text).groups())
    assert 190 <= left <= right <= 230
    chosen, fresh = text.split("on fresh grains:")
    for part in (chosen, fresh):
        grades = {name: float(v) for name, v in re.findall(r"(\w+) +grade ([\d.]+) ", part)}
        assert set(grades) == {"copper", "ABS"}
        assert part is fresh or min(grades.values()) >= 0.9
    assert_is_a_picture(tmp_path / "splitter_positions.png")


def test_a_grade_out_of_reach_is_said(tmp_path):
    text = example("splitter_positions.py", "--until", 1.3, "--grade", 1.01, cwd=tmp_path)
    assert "no pair reaches a grade of 101.0%" in text
    assert_is_a_picture(tmp_path / "splitter_positions.png")


def test_each_shape_is_measured_and_drawn(tmp_path):
    text = example("grain_shapes.py", "--spheres", 8, "--out", "shapes.png", cwd=tmp_path)
    row = r"^([a-z][a-z, ]*?) +(\d+) +([-+.\d]+)% +([.\d]+)% +([.\d]+) d +([.\d]+)%   ([. \d]+)$"
    found = {name: [float(v) for v in values] for name, *values, _ in re.findall(row, text, re.MULTILINE)}
    assert {"sphere", "box", "flake", "cylinder", "cone", "ellipsoid", "rod", "shaving", "angular"} <= set(found)
    for name in ("sphere", "box, convex", "angular, convex", "own spheres"):
        assert found[name][1:] == [0, 0, 0, 0]
    assert 2 < found["ellipsoid"][2] < found["box"][2] < found["flake"][2] < 60
    assert found["flake"][0] <= 8
    assert_is_a_picture(tmp_path / "shapes.png")


def test_the_motor_works_while_grains_go_up_and_brakes_when_they_only_go_down(tmp_path):
    text = example("drum_motor.py", "--rate", "6 kg/h", "--until", 1.8, cwd=tmp_path)
    found = re.findall(r"(most|least): ([-+.\d]+) mN m and ([-+.\d]+) mW at ([\d.]+) s", text)
    (most, first), (least, last) = (((float(torque), float(power)), float(at)) for _, torque, power, at in found)
    assert 0.3 < first < 0.7
    assert 1.2 < last < 1.8
    for torque, power in (most, least):
        assert power == pytest.approx(torque * 44.8 * 3.14159 / 30.0, abs=5e-3)
    assert most[0] > 0.05
    assert least[0] < -0.05
    assert float(re.search(r"slowest: ([-.\de]+) below", text).group(1)) < 1e-9
    assert_is_a_picture(tmp_path / "drum_motor.png")


def test_a_sphere_that_rolls_lands_nearer_than_a_flake_and_one_that_cannot_farther_and_the_parts_add_up(tmp_path):
    text = example("slender_and_spherical.py", "--until", 1.7, "--rate", 80, "--step", 0.5, cwd=tmp_path)
    found = re.findall(r"^(sphere, \S+) less (\w+) \S+ +(.*)$", text, re.MULTILINE)
    parts = {(a, b): [float(v) for v in re.findall(r"([-\d.]+) ±", numbers)] for a, b, numbers in found}
    assert len(parts) == 6
    for total, still, electric in parts.values():
        assert abs(total - still - electric) < 0.02  # of rounding, mm
    assert max(parts["sphere, rolls", "flake"][:2]) < -2
    assert min(parts["sphere, 0.35", "flake"][:2]) > 0
    assert_is_a_picture(tmp_path / "slender_and_spherical.png")


def test_slender_grains_that_would_not_land_in_time_are_refused(tmp_path):
    assert "--until must be more than" in example("slender_and_spherical.py", "--until", 1, cwd=tmp_path, code=2)
    assert not list(tmp_path.iterdir())


def test_ions_raise_the_field_under_the_wire_and_the_current_rises_with_the_voltage(tmp_path):
    text = example("corona_current.py", "--voltages", 9, 15, 30, cwd=tmp_path)
    number = r"([\d.e-]+)"
    line = rf"onset {number} kV; {number} mA/m; under the wire {number} kV/m without ions, {number} with, {number} mA"
    rows = [[float(value) for value in row] for row in re.findall(line, text)]
    (onset, none, without, same, nothing), (_, weak, *_), (_, strong, below, raised, _) = rows
    assert 9.0 < onset < 15.0
    assert none == nothing == 0.0
    assert same == without
    assert strong > 5.0 * weak > 0.0
    assert raised > 2.0 * below
    assert_is_a_picture(tmp_path / "corona_current.png")


def test_grains_between_metal_and_plastic_land_between_them(tmp_path):
    text = example("middlings.py", "--grains", 2, cwd=tmp_path)
    ends = re.search(r"conductor lands at x = (-?\d+) mm, insulator at x = (-?\d+) mm", text)
    metal, plastic = map(float, ends.groups())
    shares = [float(x) for x in re.findall(r"metal share [\d.]+: x = (-?\d+) mm", text)]
    times = [float(x) for x in re.findall(r"decay time \S+ s: x = (-?\d+) mm", text)]
    assert plastic < metal
    assert shares == sorted(shares)
    assert shares[0] == plastic
    assert shares[-1] <= metal
    assert times[0] == metal
    assert abs(times[-1] - plastic) <= 1.0
    assert_is_a_picture(tmp_path / "middlings.png")


def test_a_wire_and_a_box_change_the_field_on_the_drum_where_theory_says(tmp_path):
    text = example("drum_wire_tube.py", cwd=tmp_path)
    rows = re.findall(r"^(.+?) +([\d.]+) +([\d.]+) +([\d.]+)$", text, re.MULTILINE)
    fields = {name: [float(v) for v in values] for name, *values in rows}
    formula, alone, boxed = (fields[n] for n in ("tube alone, formula", "wire and tube", "wire and tube, in a box"))
    assert formula[1] == 328.5  # facing the tube, docs/physics.md 1.1
    assert alone[0] > 1.5 * formula[0]  # under the wire
    assert all(a > b for a, b in zip(alone, boxed, strict=True))
    assert boxed[2] < 0.2 * alone[2]  # at the foot, where the box takes most
    assert_is_a_picture(tmp_path / "drum_wire_tube.png")


def test_fine_grains_call_for_more_effects_and_shifts_are_as_expected(tmp_path):
    text = example("which_effects.py", "--grains", 60, cwd=tmp_path)
    on = dict(re.findall(r"^(\w+) +on at (.*)$", text, re.MULTILINE))
    assert "0.05" in on["wind"].split(", ")
    assert on["drag"].endswith(", 5 mm")
    assert not on["magnus"].endswith(", 5 mm")
    row = r"^(\w+) +on .* (copper|ABS) +([-+.\de]+) mm +([-+.\de]+) \["
    shifts = [(float(a), float(b)) for _, _, a, b in re.findall(row, text, re.MULTILINE)]
    assert len(shifts) > 10
    assert all(abs(a - b) < 0.2 * abs(b) + 0.5 for a, b in shifts)
    assert_is_a_picture(tmp_path / "which_effects.png")
