"""Several electrodes and models of the field in a scene: decisions, checks, pictures, text, restarts."""

import math

import numpy as np
import pytest
from scenes import assert_goes_on_bit_for_bit

import cesim
from cesim import InputError
from cesim.fields import Conductors, Grid, TwoCylinders
from cesim.scene import ConductorsField, Electrode, Scene
from cesim.scene.field import ion_source

WIRE = {"kind": "corona", "radius": 2e-4, "distance": 0.21, "angle": 1.2, "voltage": -30e3}


@pytest.fixture
def scene():
    """The reference drum and tube and a corona wire."""
    scene = cesim.scenes.single_particle()
    scene.field = "conductors"
    scene.electrodes = [Electrode(**WIRE)]
    return scene


def strongest(scene):
    return scene.electric_field().largest_on_circle(scene.drum.radius)[0]


def test_a_model_is_named_by_a_word_a_table_or_a_grid(scene):
    assert isinstance(scene.electric_field(), Conductors)
    scene.electrodes, scene.field = [], "two_cylinders"
    assert isinstance(scene.electric_field(), TwoCylinders)
    scene.field = Grid.sample(scene.electric_field(), (-0.3, -0.3), (0.5, 0.5), (41, 41))
    assert isinstance(scene.electric_field(), Grid)
    with pytest.raises(InputError, match="must be 'two_cylinders', 'conductors'"):
        scene.field = "finite"


def test_the_field_of_an_electrode_is_the_same_in_the_list_and_alone():
    alone, listed = cesim.scenes.single_particle(), cesim.scenes.single_particle()
    listed.electrodes, listed.electrode = [listed.electrode], None
    points = np.random.default_rng(1).uniform(-0.4, 0.4, (100, 3))
    assert np.array_equal(alone.electric_field()(points), listed.electric_field()(points))
    assert [row.on for row in alone.effects()] == [row.on for row in listed.effects()]
    assert cesim.Simulation(alone, threads=1).state_hash() == cesim.Simulation(listed, threads=1).state_hash()


def test_two_cylinders_refuse_a_second_electrode(scene):
    scene.field = "two_cylinders"
    with pytest.raises(InputError, match=r"^field.kind is 'two_cylinders', which is for one electrode, .* has 2"):
        scene.check()


def test_a_scene_of_several_electrodes_survives_its_text_form(scene):
    scene.field = {"kind": "conductors", "enclosure": {"lower": ("-60 cm", -0.5), "upper": (0.7, 0.8)}}
    again = Scene.from_toml(scene.to_toml())
    assert again == scene
    assert again.field == ConductorsField(enclosure={"lower": (-0.6, -0.5), "upper": (0.7, 0.8)})


def test_electrodes_that_touch_are_refused(scene):
    scene.electrodes.append(Electrode(**WIRE | {"angle": 1.2005}))
    with pytest.raises(InputError, match=r"^electrodes\[1\] touches electrodes\[0\]: they overlap by"):
        scene.check()
    scene.electrodes[1] = Electrode(**WIRE | {"distance": 0.16})
    with pytest.raises(InputError, match=r"^electrodes\[1\].distance is 0.16 m, the electrode touches the drum"):
        scene.check()


def test_an_electrode_outside_the_enclosure_is_refused(scene):
    scene.field = {"kind": "conductors", "enclosure": {"lower": (-0.2, -0.2), "upper": (0.2, 0.3)}}
    with pytest.raises(InputError, match=r"^field.kind .*beyond the enclosure"):
        scene.check()


def test_the_decisions_follow_the_field_of_all_electrodes(scene):
    scene.electrodes = [Electrode(**WIRE)]
    scene.electrode = None
    assert scene.effects()["electric_force"].on
    scene.electrodes[0].voltage = 0.0
    assert not scene.effects()["electric_force"].on
    assert scene.effects()["electric_force"].why == "the voltage is 0"
    scene.electrodes = []
    assert scene.effects()["electric_force"].why == "the scene has no electrode"


def test_ions_come_from_the_wire_though_the_tube_is_at_a_higher_voltage(scene):
    assert ion_source(scene) is scene.electrodes[0]
    scene.electrodes[0].kind = "static"
    assert ion_source(scene) is scene.electrode


def test_the_size_of_an_effect_uses_the_strongest_field_on_the_drum(scene):
    both = scene.effects()["electric_force"].size
    one = cesim.scenes.single_particle()
    assert both / one.effects()["electric_force"].size == pytest.approx(
        (strongest(scene) / strongest(one)) ** 2, rel=1e-9
    )


def test_breakdown_is_warned_of_at_each_conductor_but_the_wires(scene):
    assert [warning.name for warning in scene.check()] == []
    scene.electrode.voltage = -150e3
    texts = [str(warning) for warning in scene.check()]
    assert any(text.startswith("breakdown: the field on the electrode is") for text in texts)
    scene.electrode.voltage, scene.electrodes[0].kind = -35e3, "static"
    assert any("on the electrodes[0]" in str(warning) for warning in scene.check())


def test_level_0_is_doubted_where_the_arc_reaches_far_from_the_electrode():
    scene = cesim.scenes.reference_machine("spheres")
    assert "field" not in [warning.name for warning in scene.check()]
    scene.corona.arc = ("-60 deg", "60 deg")
    assert any("twice the field of a machine in a grounded box" in str(w) for w in scene.check() if w.name == "field")
    scene.field = "conductors"
    assert "field" not in [warning.name for warning in scene.check()]


def test_a_drum_beyond_the_grid_is_warned_of():
    scene = cesim.scenes.single_particle()
    scene.field = Grid.sample(scene.electric_field(), (0.0, -0.3), (0.5, 0.5), (61, 81))
    assert any("of the drum's surface lie beyond the grid" in str(w) for w in scene.check() if w.name == "field")


@pytest.mark.parametrize("box", [None, {"lower": (-0.6, -0.5), "upper": (0.7, 0.8)}])
def test_a_run_in_the_field_of_conductors_goes_on_bit_for_bit(scene, box, tmp_path):
    scene.field = {"kind": "conductors", **({"enclosure": box} if box else {})}
    scene.effects["electric_force"] = "on"
    assert_goes_on_bit_for_bit(scene, [[0.0, 0.17, 0.0], [0.1, 0.15, 0.05]], [1e-10, -1e-10], tmp_path / "restart.h5")


def test_a_run_remembers_and_draws_all_electrodes(scene):
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    from cesim.plots import draw_machine

    scene.feed = cesim.scenes.reference_machine("spheres").feed
    run = cesim.run(scene, until="0.01 s", progress=False)
    assert [row["kind"] for row in run.definition["electrodes"]] == ["static", "corona"]
    figure, ax = plt.subplots()
    draw_machine(run.definition, ax)
    texts = [text.get_text() for text in ax.texts]
    assert "electrode\n-35 kV" in texts
    assert "wire\n-30 kV" in texts
    plt.close(figure)
    assert math.isfinite(run.time)


def test_the_step_that_is_recommended_does_not_hang_on_where_an_electrode_is_listed():
    from cesim.accuracy.rules import recommend

    alone, listed = cesim.scenes.reference_machine("spheres"), cesim.scenes.reference_machine("spheres")
    listed.electrodes, listed.electrode = [listed.electrode], None
    assert str(recommend(listed)) == str(recommend(alone))
    listed.electrodes = []
    assert str(recommend(listed)) != str(recommend(alone))
