"""The command line: what it writes and prints, its exit codes, and one line for every mistake."""

import json
import os
import subprocess
import sys

import h5py
import pytest
from streams import stream

import cesim
from cesim import cli
from cesim.cli.settings import apply
from cesim.verification import Case, Row
from cesim.verification import table as verification_table


def cesim_command(*arguments, cwd, code=0):
    command = [sys.executable, "-m", "cesim", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=120, check=False)
    assert done.returncode == code, done.stderr[-2000:]
    assert "Traceback" not in done.stderr
    if code in (1, 2):
        assert done.stderr.startswith("cesim: ")
        assert done.stderr.count("\n") == 1
    return done


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a scene, and one run of it."""
    path = tmp_path_factory.mktemp("cli")
    stream().save(path / "stream.toml")
    cesim_command("run", "stream.toml", "--until", "0.2 s", "--threads", 1, cwd=path)
    return path


def test_run_writes_result_and_picture_and_prints_the_table(folder, tmp_path):
    done = cesim_command("run", folder / "stream.toml", "--until", "100 ms", "--seed", 7, "--threads", 1, cwd=tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.h5", "run.png"]
    for word in ("stream, seed 7", "recovery", "middlings", "balance", "written       run.h5, run.png"):
        assert word in done.stdout
    assert done.stderr == ""
    assert cesim.open(tmp_path / "run.h5").seed == 7


def test_a_second_run_takes_the_next_free_name(folder, tmp_path):
    for _ in range(3):
        cesim_command("run", folder / "stream.toml", "--until", "0.01", "--no-figure", cwd=tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run-2.h5", "run-3.h5", "run.h5"]


def test_a_name_that_was_asked_for_is_replaced_only_by_force(folder, tmp_path):
    (tmp_path / "x.h5").write_text("precious")
    arguments = ("run", folder / "stream.toml", "--until", "0.01 s", "--save", "x.h5", "--no-figure")
    assert "--force" in cesim_command(*arguments, cwd=tmp_path, code=2).stderr
    assert (tmp_path / "x.h5").read_text() == "precious"
    cesim_command(*arguments, "--force", cwd=tmp_path)
    assert h5py.is_hdf5(tmp_path / "x.h5")


def test_a_machine_without_a_feed_runs_and_is_drawn(tmp_path):
    (tmp_path / "empty.toml").write_text('name = "empty"\n[drum]\n[collect]\n', encoding="utf-8")
    assert cesim_command("run", "empty.toml", "--until", "0.01 s", cwd=tmp_path).stderr == ""
    assert (tmp_path / "run.png").exists()
    assert cesim_command("bins", "run.h5", "-n", 3, cwd=tmp_path).stdout.startswith("x from")


def test_settings_change_the_scene(folder, tmp_path):
    arguments = ("--set", "feed.rate=1000 1/s", "--set", "feed.outlet.length=0.08", "--set", "numerics.step=5e-4")
    more = ("--set", 'effects.drag="off"', "--set", "collect.splitters=[-0.01, 0.02]", "--set", "feed.stop=null")
    cesim_command("run", folder / "stream.toml", "--until", "0.1 s", "--no-figure", *arguments, *more, cwd=tmp_path)
    run = cesim.open(tmp_path / "run.h5")
    assert 50 < run.balance.fed.count < 150
    assert run.definition["step"] == 5e-4
    assert run.scene.feed.outlet.length == 0.08
    assert run.default_splitters == (-0.01, 0.02)
    assert [row["on"] for row in run.effects if row["name"] == "drag"] == [False]


def test_settings_reach_into_lists_and_materials():
    scene = cesim.scenes.reference_machine("spheres")
    for setting in ("plates[0].slope=6 deg", "drum.speed=60 rpm", "materials.copper.density=8000", "brush=null"):
        apply(scene, setting)
    assert scene.plates[0].slope == pytest.approx(0.10472, rel=1e-4)
    assert scene.drum.speed == pytest.approx(6.28319, rel=1e-5)
    assert scene.materials["copper"].density == 8000
    assert scene.brush is None


@pytest.mark.parametrize(
    ("setting", "word"),
    [
        ("drum.sped=1", "speed"),
        ("drun.speed=1", "drum"),
        ("drum.speed=1 m", "drum.speed"),
        ("drum.speed", "KEY=VALUE"),
        ("=1", "KEY=VALUE"),
        ("plates[7].slope=0", "index"),
        ("plates[x].slope=0", "index"),
        ("materials.coper.density=1", "copper"),
        ("effects.drga=off", "drag"),
        ("walls[0].motion.frequency=1", "motion"),
        ("feed.mix=[1", "feed.mix"),
        ("__class__=1", "key"),
        ("drum.__init__.x=1", "key"),
        ("name.x=1", "key"),
    ],
)
def test_a_bad_setting_is_one_line(tmp_path, setting, word):
    done = cesim_command("check", "reference_machine", "--set", setting, cwd=tmp_path, code=2)
    assert word in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "referense_machine"],
        ["run", "missing.toml"],
        ["run", "."],
        ["run", "single_particle", "--until", "soon"],
        ["run", "single_particle", "--until", "-1"],
        ["run", "single_particle", "--seed", "-1"],
        ["run", "single_particle", "--threads", "0"],
        ["run", "single_particle", "--save", "no/such/folder/run.h5"],
        ["run", "--seed", "x"],
        ["bins", "missing.h5"],
        ["bins", "bad.h5"],
        ["plot", "bad.h5"],
        ["info", "bad.h5"],
        ["cite", "bad.h5"],
        ["fly"],
        [],
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(tmp_path, arguments):
    (tmp_path / "bad.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    cesim_command(*arguments, cwd=tmp_path, code=2)
    assert [p.name for p in tmp_path.iterdir()] == ["bad.h5"]


def test_a_simulation_that_fails_is_one_line_and_exit_code_1(folder, tmp_path):
    arguments = ("--until", "1 s", "--set", "feed.rate=7e6 1/s", "--no-figure")
    done = cesim_command("run", folder / "stream.toml", *arguments, cwd=tmp_path, code=1)
    assert "run.h5.part" in done.stderr
    assert not cesim.open(tmp_path / "run.h5.part").complete


def test_check_and_effects_speak_of_the_scene(folder):
    assert cesim_command("check", cwd=folder).stdout
    done = cesim_command("effects", "single_particle", "--set", "effects.drag=off", cwd=folder)
    assert "off (set)" in done.stdout
    assert "image_force" in done.stdout


def test_bins_as_a_table_and_as_csv(folder):
    done = cesim_command("bins", "run.h5", "-n", 10, "--x", "-50 mm", "0.05", cwd=folder)
    assert done.stdout.count("\n") == 13
    lines = cesim_command("bins", "run.h5", "-n", 10, "--csv", cwd=folder).stdout.splitlines()
    assert lines[0].startswith("left,right,material,mass")
    assert len(lines) == 21


def test_info_plot_and_cite(folder, tmp_path):
    assert "frames" in cesim_command("info", "run.h5", cwd=folder).stdout
    cesim_command("plot", "run.h5", "-o", tmp_path / "x.svg", cwd=folder)
    assert "<svg" in (tmp_path / "x.svg").read_text()
    assert "Critelli" in cesim_command("cite", "run.h5", cwd=folder).stdout
    assert "Davis" in cesim_command("cite", cwd=folder).stdout


def test_verify_prints_numbers_with_their_bounds_and_writes_them(tmp_path):
    done = cesim_command("verify", "13", "8", "--markdown", "page.md", "--json", "table.json", cwd=tmp_path)
    assert done.stdout.index("08  ") < done.stdout.index("13  ")
    assert "all pass" in done.stdout
    assert "| quantity | measured | bound |" in (tmp_path / "page.md").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "table.json").read_text())["passed"] is True
    assert "not a known case" in cesim_command("verify", "77", cwd=tmp_path, code=2).stderr
    assert "not a folder" in cesim_command("verify", "13", "--json", "no/where.json", cwd=tmp_path, code=2).stderr


def test_verify_ends_with_1_when_a_number_does_not_keep_its_bound(monkeypatch, capsys):
    def broken(size):
        yield Row("height", 2.0, "<=", 1.0, "m", "it is too high")
        raise ZeroDivisionError("and then it bursts")

    monkeypatch.setattr(verification_table, "CASES", (Case("01", "broken", "it bursts", "none", broken),))
    assert cli.main(["verify"]) == 1
    printed = capsys.readouterr().out
    for word in ("FAILED", "it is too high", "and then it bursts"):
        assert word in printed


def test_doctor_runs_the_engine(tmp_path):
    done = cesim_command("doctor", cwd=tmp_path)
    assert "same bits   yes" in done.stdout
    assert "numpy" in done.stdout


def test_a_reader_that_goes_away_is_no_error(folder):
    command = f"{sys.executable} -m cesim bins run.h5 -n 5000 | head -1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, cwd=folder, check=False)
    assert done.stderr == ""


@pytest.mark.parametrize("value", ["0", "abc", "1000", "-3", ""])
def test_strange_environments_are_survived(tmp_path, value):
    environment = {k: v for k, v in os.environ.items() if k not in ("HOME", "LANG", "LC_ALL")}
    environment |= {"OMP_NUM_THREADS": value, "LC_ALL": "C"}
    folder = tmp_path / "ein Ordner mit ümlaut"
    folder.mkdir()
    stream().save(folder / "scène.toml")
    command = [sys.executable, "-m", "cesim", "run", "scène.toml", "--until", "0.02 s", "--no-figure"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=environment, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert (folder / "run.h5").exists()
