"""`cesim field`: pictures, tables and files of one model of the field, or of two."""

import math

import numpy as np
import pytest

import cesim
from cesim.cli import main
from cesim.fields import Conductors, Grid, TwoCylinders
from cesim.fields.compare import compare, field_map

R1, R2, L, TILT, U = 0.16, 0.019, 0.267, math.radians(30.0), -35e3
BOX = ((-0.5, -0.45), (0.5, 0.55))


def two_models():
    drum, tube = ({"center": (0, 0), "radius": R1}, {"center": (L * math.cos(TILT), L * math.sin(TILT)), "radius": R2})
    return {
        "two_cylinders": TwoCylinders(R1, R2, L, TILT, U),
        "conductors": Conductors([drum, tube | {"voltage": U}], BOX),
    }


def test_the_table_on_the_drum_is_the_closed_form_and_its_signs_are_outwards():
    table = compare(two_models(), R1, TILT, 0.15)
    row = table.on_drum[0]
    h1 = (L**2 + R1**2 - R2**2) / (2 * L)
    c = math.sqrt(h1**2 - R1**2)
    f = U / math.acosh((L**2 - R1**2 - R2**2) / (2 * R1 * R2))
    assert row == pytest.approx(-f * c / (R1 * (h1 - R1 * np.cos(table.angle))), rel=1e-12)
    assert (row > 0.0).all()  # a negative electrode draws field out of the drum
    ratio = table.on_drum[1] / row
    near = np.abs(np.degrees(table.angle)) <= 15.0 + 1e-9
    assert table.difference() == pytest.approx(np.abs(ratio[near] - 1.0).max(), rel=1e-12)
    assert table.difference(0.0) == pytest.approx(1.0 - ratio[np.abs(table.angle) < 1e-9][0], rel=1e-9)
    text = str(table)
    assert "          15            260.19" in text
    assert "along the drum" not in text  # nothing changes along z


def test_a_map_knows_field_potential_and_where_metal_is(tmp_path):
    field = two_models()["two_cylinders"]
    drawn = field_map(field, (-0.3, -0.3), (0.3, 0.3), 0.01)
    assert drawn.strength.shape == (61, 61)
    assert drawn.inside[30, 30]
    assert not drawn.inside[0, 0]
    assert drawn.field[45, 40] == pytest.approx(field([[0.15, 0.10, 0.0]])[0])
    drawn.write_hdf5(tmp_path / "map.h5")
    grid = Grid.read(tmp_path / "map.h5")
    place = np.array([[0.15, 0.17, 0.0]])
    assert grid.potential(place) == pytest.approx(field.potential(place), rel=1e-3)


def test_one_model_is_drawn_and_told(tmp_path, capsys):
    picture = tmp_path / "field.png"
    assert (
        main(["field", "-o", str(picture), "--csv", str(tmp_path / "drum.csv"), "--hdf5", str(tmp_path / "m.h5")]) == 0
    )
    out = capsys.readouterr().out
    assert "           0            328.51" in out
    assert str(picture) in out
    assert picture.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    lines = (tmp_path / "drum.csv").read_text().splitlines()
    assert lines[0] == "angle [deg],two_cylinders [V/m]"
    assert len(lines) == 362
    assert float(lines[181].split(",")[1]) == pytest.approx(328512, abs=1)
    assert (tmp_path / "m.h5").exists()


def test_two_models_are_compared_and_drawn(tmp_path, capsys):
    model = '{kind = "conductors", enclosure = {lower = ["-0.5 m", -0.45], upper = [0.5, 0.55]}}'
    assert main(["field", "--compare", model, "-o", str(tmp_path / "both.png")]) == 0
    out = capsys.readouterr().out
    assert "conductors differs from two_cylinders by at most" in out
    assert (tmp_path / "both.png").stat().st_size > 50_000


def test_a_grid_in_a_file_is_compared_with_the_formula(tmp_path, capsys):
    grid = Grid.sample(two_models()["two_cylinders"], (-0.4, -0.4), (0.4, 0.4), (161, 161), drum_radius=R1)
    import h5py

    with h5py.File(tmp_path / "grid.h5", "w") as file:
        group = file.create_group("field")
        group["origin"], group["spacing"], group["values"] = grid.origin, grid.spacing, grid.values
    assert main(["field", "--compare", str(tmp_path / "grid.h5"), "--no-figure"]) == 0
    share = float(capsys.readouterr().out.split("by at most ")[1].split(" %")[0])
    assert share < 0.5


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--compare", "no_such_model"], "--compare"),
        (["--compare", "{kind = "], "--compare is not a table"),
        (["--z", "1 kg"], "--z"),
        (["--set", "electrode=none"], "electrode"),
        (["-o", "/no/such/folder/field.png"], "cannot be written"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_exit_code_two(arguments, words, capsys):
    assert main(["field", "--no-figure", *arguments] if "-o" not in arguments else ["field", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert len(error.strip().splitlines()) == 1


def test_the_finite_elements_of_a_machine_with_a_plate_are_drawn_in_three_dimensions(tmp_path, capsys, monkeypatch):
    pytest.importorskip("skfem", reason="needs the extra fem: scikit-fem and pyamg")
    pytest.importorskip("pyamg", reason="needs the extra fem: scikit-fem and pyamg")
    monkeypatch.setenv("CESIM_CACHE", str(tmp_path))
    scene = cesim.scenes.reference_machine("spheres")
    scene.field = {"kind": "finite_element", "dimension": 3, "resolution": 4, "spacing": 0.01}
    scene.save(tmp_path / "machine.toml")
    assert main(["field", str(tmp_path / "machine.toml"), "--z", "0.1 m", "-o", str(tmp_path / "f.png")]) == 0
    out = capsys.readouterr().out
    assert "along the drum, facing the electrode" in out
    assert "discretisation error of finite_element" in out


@pytest.mark.parametrize(
    ("parts", "options", "message"),
    [
        ({"electrode": cesim.Electrode(voltage="-30 kV")}, (), "drum is missing: the field needs a drum and an elec"),
        ({"drum": cesim.Drum()}, (), "electrode is missing: the field needs a drum and an electrode"),
        ({"field": "grid"}, ("--compare", "v.h5"), "drum is missing: the field is compared on it"),
        ({"field": "grid"}, ("--csv", "drum.csv"), "drum is missing: the field is compared on it"),
    ],
)
def test_a_scene_without_what_the_command_needs_is_one_line(tmp_path, monkeypatch, capsys, parts, options, message):
    monkeypatch.chdir(tmp_path)
    if "field" in parts:
        grid = Grid((-0.1, -0.1), (0.04, 0.04), np.outer(np.arange(6.0), np.ones(6)))
        field_map(grid, (-0.1, -0.1), (0.1, 0.1), 0.04).write_hdf5("v.h5")
        parts = {"field": grid}
    (tmp_path / "part.toml").write_text(cesim.Scene(name="part", **parts).to_toml(), encoding="utf-8")
    assert main(["field", "part.toml", "--no-figure", *options]) == 2
    assert message in capsys.readouterr().err
