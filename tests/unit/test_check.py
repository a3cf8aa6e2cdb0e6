"""Contradictions are errors, doubtful physics is a warning, and every effect is decided with a reason."""

import math

import pytest

import cesim.scenes
from cesim.errors import InputError
from cesim.scene import Constant, Corona, Family, Feed, Plate, Scene, Splitter
from cesim.scene.effects import THRESHOLD


@pytest.fixture
def scene():
    return cesim.scenes.reference_machine("spheres")


def warnings_of(scene):
    return {warning.name for warning in scene.check()}


def feed(material="ABS", diameter="1 mm", rate="100 1/s"):
    return Feed(rate=rate, mix={material: 1.0}, size=Constant(diameter=diameter))


# ---- errors ----------------------------------------------------------------------------------------------------------


def break_electrode(scene):
    scene.electrode.distance = 0.179


def break_splitter(scene):
    scene.splitters[0].tip = (0.149, 0.05)


def break_plate(scene):
    scene.plates = [Plate(end=(0.0, 0.155))]


def break_tip(scene):
    scene.splitters.append(Splitter(tip=(3.0, 0.0)))


def break_landing(scene):
    scene.collect.y = -0.6


def break_outlet(scene):
    scene.feed.outlet.center = (0.0, 2.0, 0.0)


def break_drum(scene):
    scene.drum = None


def break_material(scene):
    scene.feed = feed("coper")


def break_pairs(scene):
    scene.materials["copper"].pairs = {"drumm": {"friction": 0.1}}


@pytest.mark.parametrize(
    ("break_it", "path", "text"),
    [
        (break_electrode, "electrode.distance", "touches the drum"),
        (break_splitter, "splitters[0]", "cuts into the drum"),
        (break_plate, "plates[0]", "cuts into the drum"),
        (break_tip, "splitters[2].tip", "outside the bounds"),
        (break_landing, "collect.y", "outside the bounds"),
        (break_outlet, "feed.outlet", "outside the bounds"),
        (break_drum, "drum", "needs a grounded drum"),
        (break_material, "feed", "did you mean 'copper'?"),
        (break_pairs, "materials.copper.pairs", "did you mean 'drum'?"),
    ],
)
def test_parts_that_cannot_stand_together_are_errors(scene, break_it, path, text):
    scene.definition()
    break_it(scene)
    for use in (scene.check, scene.definition):
        with pytest.raises(InputError) as caught:
            use()
        assert caught.value.path == path
        assert text in str(caught.value)


# ---- warnings --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("named", list(cesim.scenes.NAMES.values()))
def test_named_scenes_are_free_of_warnings(named):
    assert named().check() == []
    assert str(named().check()) == "no warnings"


@pytest.mark.parametrize(
    ("path", "value", "warning"),
    [
        ("electrode.voltage", "-150 kV", "breakdown"),
        ("corona.field", "2 MV/m", "breakdown"),
        ("numerics.step", "5 ms", "step"),
        ("numerics.step", "20 ms", "tunnelling"),
        ("drum.speed", "80 rpm", "centrifuge"),
        ("feed.outlet.center", (-0.15, 0.18, 0.0), "outlet"),
        ("feed.outlet.width", "0.32 m", "outlet"),
        ("drum.speed", 0.01, "crowding"),
    ],
)
def test_doubtful_physics_is_a_warning(scene, path, value, warning):
    *parents, field = path.split(".")
    part = scene
    for parent in parents:
        part = getattr(part, parent)
    assert warning not in warnings_of(scene)
    setattr(part, field, value)
    assert warning in warnings_of(scene)


@pytest.mark.parametrize(
    ("diameter", "expected"), [("25 mm", True), ("0.5 um", True), ("1 mm", False), ("15 mm", False)]
)
def test_sizes_that_look_like_a_slip_of_units_are_a_warning(scene, diameter, expected):
    scene.feed = feed(diameter=diameter, rate="1 1/s")
    assert ("unit" in warnings_of(scene)) is expected


def test_the_step_limit_is_that_of_theory(scene):
    """h = sqrt(0.4 d/g) where nothing but gravity acts."""
    scene.electrode.voltage = 0.0
    scene.feed = feed(diameter="1 mm")
    limit = math.sqrt(0.4 * 1e-3 / 9.81)
    scene.numerics.step = 0.99 * limit
    assert "step" not in warnings_of(scene)
    scene.numerics.step = 1.01 * limit
    assert "step" in warnings_of(scene)


# ---- effects ---------------------------------------------------------------------------------------------------------


def on(scene):
    return {row.name for row in scene.effects() if row.on}


ALL = {
    "gravity",
    "drag",
    "wind",
    "electric_force",
    "sphere_plane",
    "image_force",
    "corona_charging",
    "contact_charging",
}


def test_the_reference_machine_calls_for_every_effect(scene):
    assert on(scene) == ALL | {"brush_discharge", "pair_coulomb"}
    assert on(cesim.scenes.single_particle()) == ALL | {"magnus"}
    assert on(cesim.scenes.settling_box()) == {"gravity", "drag"}


def test_what_cannot_act_is_off_and_says_why(scene):
    scene.feed = feed("ABS")
    assert on(scene) == ALL - {"sphere_plane", "contact_charging"} | {"brush_discharge"}
    assert "no conductor is fed" in scene.effects()["contact_charging"].why
    scene.feed = feed("copper", diameter="0.3 mm")
    assert on(scene) == ALL - {"image_force", "corona_charging"} | {"brush_discharge"}
    assert "no insulator is fed" in scene.effects()["image_force"].why
    scene.brush = scene.corona = None
    assert "no brush" in scene.effects()["brush_discharge"].why
    scene.electrode.voltage = 0.0
    assert on(scene) == {"gravity", "drag", "wind"}
    assert "the voltage is 0" in scene.effects()["electric_force"].why


def test_what_is_too_small_is_dropped_with_its_number(scene):
    scene.feed = feed("copper", diameter="10 mm")
    drag = scene.effects()["drag"]
    assert not drag.on
    assert 0.0 < drag.size < THRESHOLD == drag.threshold
    assert "below the threshold" in drag.why
    assert 0.0 < drag.shift < 0.24 * drag.size
    scene.feed = feed("copper", diameter="0.1 mm")
    assert scene.effects()["drag"].on


def test_the_smallest_fed_grain_decides(scene):
    scene.feed = feed("copper", diameter="1 mm")
    coarse = scene.effects()["contact_charging"].size
    scene.feed = feed("copper", diameter="0.5 mm")
    assert scene.effects()["contact_charging"].size == pytest.approx(2.0 * coarse)
    scene.feed = Feed(
        rate="100 1/s",
        families=[
            Family(material="copper", fraction=0.5, size=Constant(diameter=diameter)) for diameter in ("0.5 mm", "1 mm")
        ],
    )
    assert scene.effects()["contact_charging"].size == pytest.approx(2.0 * coarse)


def test_a_user_decides_against_the_numbers(scene):
    scene.effects["drag"] = "off"
    assert "drag" not in on(scene)
    assert "set off" in scene.effects()["drag"].why
    scene.effects["drag"] = {"state": "on", "parameters": {"viscosity": "2e-5 Pa s"}}
    (drag,) = [row for row in scene.definition()["effects"] if row["name"] == "drag"]
    assert drag["parameters"] == {"law": 0.0, "density": 1.204, "viscosity": 2e-5}
    del scene.effects["drag"]
    assert dict(scene.effects) == {}
    scene.effects = {"gravity": "off"}
    assert "gravity" not in on(scene)


def test_effects_that_need_a_missing_part_cannot_be_forced_on(scene):
    scene.brush = None
    scene.effects["brush_discharge"] = "on"
    with pytest.raises(InputError, match=r"^effects\.brush_discharge is 'on', but the scene has no brush$"):
        scene.definition()


def test_the_electric_correction_goes_with_the_electric_force(scene):
    scene.effects["electric_force"] = "off"
    assert "sphere_plane" not in on(scene)


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"drg": "on"}, "did you mean 'drag'?"),
        ({"drag": "maybe"}, "'maybe'"),
        ({"drag": True}, "True"),
        ({"drag": {"state": "on", "parameters": {"law": 7}}}, "effects.drag.parameters.law is 7"),
        ({"drag": {"parameters": {"densty": 1.0}}}, "did you mean 'density'?"),
        ({"drag": {"parameters": {"density": math.nan}}}, "nan"),
        ({"image_force": {"parameters": {"kappa": "1 m"}}}, "kappa"),
    ],
)
def test_bad_settings_of_effects_are_refused_at_once(scene, settings, text):
    with pytest.raises(InputError) as caught:
        Scene(effects=settings)
    assert text in str(caught.value)
    with pytest.raises(InputError) as caught:
        scene.effects = settings
    assert text in str(caught.value)
    assert dict(scene.effects) == {}


def test_the_scene_gives_the_parameters_of_drag_and_corona(scene):
    scene.air.law = "stokes"
    scene.corona = Corona(arc=("20 deg", "50 deg"), current_density="1 mA/m2")
    decisions = scene.effects()
    assert decisions["drag"].parameters["law"] == 1.0
    corona = decisions["corona_charging"].parameters
    assert corona["from"] == pytest.approx(math.radians(20.0))
    assert corona["current_density"] == pytest.approx(1e-3)
    assert math.isnan(corona["field"])


def test_decisions_print_as_a_table_and_become_a_frame(scene):
    decisions = scene.effects()
    lines = str(decisions).splitlines()
    assert lines[0].split()[:3] == ["effect", "on?", "size"]
    assert [line.split()[0] for line in lines[1 : 1 + len(decisions)]] == [row.name for row in decisions]
    frame = decisions.to_pandas()
    assert list(frame["name"])[: len(decisions)] == [row.name for row in decisions]
    assert decisions.materials == ["copper", "ABS"]
    with pytest.raises(InputError, match=r"did you mean 'drag'\?"):
        decisions["drg"]
