"""The scene tree: what it takes, what it refuses, its text form, and what the engine gets."""

import copy
import math
import os
import pickle

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import cesim.scenes
from cesim.errors import InputError, show
from cesim.scene import (
    Bounds,
    Collect,
    Constant,
    Corona,
    Drum,
    Electrode,
    Family,
    Feed,
    LogNormal,
    Material,
    Normal,
    Plate,
    Rate,
    Scene,
    Splitter,
    Table,
    Uniform,
    Vibration,
    Wall,
    Weibull,
    load,
)
from cesim.scene.surfaces import surfaces

NAMED = list(cesim.scenes.NAMES.values())


@pytest.fixture
def scene():
    return cesim.scenes.reference_machine("spheres")


# ---- assignment ----------------------------------------------------------------------------------------------------


def test_quantities_take_text_and_stay_si_floats(scene):
    scene.drum.speed = "45 rpm"
    scene.electrode.voltage = "-23 kV"
    scene.electrode.angle = "30 deg"
    scene.collect.bins.x = ("0 mm", "200 mm")
    assert scene.drum.speed == pytest.approx(4.71238898)
    assert type(scene.drum.speed) is float
    assert scene.electrode.voltage == -23e3
    assert scene.collect.bins.x == (0.0, 0.2)


def test_an_error_names_path_value_and_range(scene):
    with pytest.raises(InputError) as caught:
        scene.drum.speed = 1e9
    error = caught.value
    assert str(error) == "drum.speed is 1e9 rad/s, outside [-1000, 1000] rad/s"
    assert (error.path, error.key, error.value, error.unit) == ("drum.speed", "speed", 1e9, "rad/s")
    assert isinstance(error, ValueError)


BAD_NUMBERS = [math.nan, math.inf, 1j, True, None, "fast", "3 kg", 10**400, [1.0], np.array([1.0]), -1e300]


@pytest.mark.parametrize("value", BAD_NUMBERS, ids=show)
@pytest.mark.parametrize(
    ("part", "field"),
    [("drum", "speed"), ("drum", "radius"), ("drum", "friction"), ("electrode", "voltage"), ("numerics", "step"),
     ("numerics", "max_iterations"), ("air", "density"), ("brush", "radius"), ("collect", "y"), ("corona", "height")],
)  # fmt: skip
def test_bad_numbers_are_refused_and_change_nothing(scene, part, field, value):
    before = scene.model_copy(deep=True)
    with pytest.raises(InputError) as caught:
        setattr(getattr(scene, part), field, value)
    assert caught.value.path == f"{part}.{field}"
    assert "\n" not in str(caught.value)
    assert scene == before


@pytest.mark.parametrize(
    ("part", "field", "value"),
    [
        ("drum", "radius", 0.0), ("drum", "radius", -0.1), ("drum", "friction", -0.1), ("drum", "restitution", 1.1),
        ("drum", "restitution", -0.1), ("drum", "rolling_friction", -1e-9), ("numerics", "step", 0.0),
        ("numerics", "step", -1e-3), ("numerics", "max_iterations", 0), ("numerics", "max_iterations", 1.5),
        ("numerics", "threads", 0), ("numerics", "contact_law", "newton"), ("numerics", "grain_contact", 1),
        ("air", "law", "newton"), ("air", "viscosity", 0.0), ("feed", "rate", -1.0), ("feed", "rate", "1 m"),
        ("feed", "mix", {"copper": 0.5}), ("feed", "mix", {"copper": math.nan, "ABS": 1.0}), ("feed", "size", {}),
        ("feed", "size", {"kind": "cauchy"}), ("feed", "size", {"kind": "constant", "diameter": 0.0}),
        ("feed", "size", {"kind": "constant", "diameter": "1 m"}), ("feed", "stop", -1.0), ("feed", "velocity", (0, 1)),
        ("corona", "arc", ("60 deg", "10 deg")), ("collect", "splitters", (0.2, 0.1)), ("collect", "splitters", 0.2),
        ("bounds", "lower", (5.0, -1.0, -1.0)),
    ],
)  # fmt: skip
def test_bad_values_are_refused_and_change_nothing(scene, part, field, value):
    before = scene.model_copy(deep=True)
    with pytest.raises(InputError) as caught:
        setattr(getattr(scene, part), field, value)
    assert caught.value.path.startswith(part)
    assert scene == before


def test_a_rule_over_two_fields_names_the_field(scene):
    with pytest.raises(InputError, match=r"^feed\.mix sums to 0\.9, must sum to 1$"):
        scene.feed.mix = {"copper": 0.3, "ABS": 0.6}
    with pytest.raises(InputError, match=r"^feed\.size\.least is 0\.002 m, above most"):
        scene.feed.size = {"kind": "lognormal", "median": 1e-3, "gsd": 1.2, "least": 2e-3, "most": 1e-3}


def test_unknown_keys_get_a_suggestion(scene):
    with pytest.raises(InputError, match=r"^drum 'sped' is not a known key; did you mean 'speed'\?$"):
        scene.drum.sped = 3.0
    with pytest.raises(InputError, match=r"did you mean 'radius'\?"):
        Drum(radios=0.1)
    with pytest.raises(InputError, match=r"^feed\.size 'medain' .* did you mean 'median'\?"):
        Scene.from_toml('[feed]\nrate = 1.0\nmix = {ABS = 1.0}\nsize = {kind = "lognormal", medain = 1e-3, gsd = 1.1}')
    with pytest.raises(InputError, match=r"did you mean 'drum'\?"):
        Scene(drom={})


def test_errors_deep_in_the_tree_carry_their_path():
    with pytest.raises(InputError) as caught:
        Scene.from_toml('[[plates]]\n[[plates]]\nlength = "1 kg"')
    assert caught.value.path == "plates[1].length"
    assert caught.value.key == "length"
    with pytest.raises(InputError) as caught:
        Scene.from_toml('[[plates]]\nmotion = {kind = "belt", speed = 1e9}')
    assert caught.value.path == "plates[0].motion.speed"
    with pytest.raises(InputError, match=r"^splitters\[0\]\.tip is missing$"):
        Scene.from_toml("[[splitters]]")


def test_input_errors_survive_a_process_border():
    error = InputError("is 3 m, outside [0, 1] m", path="drum.radius", value=3.0, unit="m", allowed="[0, 1] m")
    twin = pickle.loads(pickle.dumps(error))
    assert str(twin) == str(error)
    assert (twin.path, twin.value, twin.unit, twin.allowed) == ("drum.radius", 3.0, "m", "[0, 1] m")


def test_wrong_things_slipped_into_a_list_or_dict_are_found_before_use(scene):
    scene.plates.append(3)
    with pytest.raises(InputError, match=r"^plates\[1\]"):
        scene.definition()
    scene.plates.pop()
    scene.materials["sand"] = {"kind": "insulator", "density": 2650.0, "permittivity": 4.0}
    assert scene.definition()["materials"][list(scene.materials).index("sand")]["density"] == 2650.0
    scene.materials["sand"] = {"kind": "insulator", "density": -1.0}
    with pytest.raises(InputError, match=r"^materials\.sand"):
        scene.definition()


def test_every_part_says_its_fields_with_units_and_ranges():
    assert "speed, positive: the top moves to +x [-1000 to 1000 rad/s]" in Drum.__doc__
    for part in (Scene, Drum, Electrode, Corona, Plate, Splitter, Wall, Feed, LogNormal, Material, Bounds, Collect):
        for field in part.field_names():
            assert f"\n{field}" in part.__doc__
    schema = Scene.model_json_schema()
    assert schema["$defs"]["Drum"]["properties"]["radius"]["anyOf"][0]["maximum"] == 5.0


# ---- feed and materials --------------------------------------------------------------------------------------------


def test_a_rate_knows_whether_it_is_mass_or_count():
    mass, count, plain = Rate("120 kg/h"), Rate("5000 1/s"), Rate(0.01)
    assert (mass.kind, count.kind, plain.kind) == ("mass", "count", "mass")
    assert mass == pytest.approx(120.0 / 3600.0)
    assert count == 5000.0
    assert Rate("1 kg/s") != Rate("1 1/s")
    assert pickle.loads(pickle.dumps(count)).kind == "count"
    assert copy.deepcopy(count).kind == "count"
    with pytest.raises(InputError, match="outside"):
        Rate("1e9 1/s")
    with pytest.raises(InputError, match="mass or a count"):
        Rate("3 m")


def test_a_mix_and_families_say_the_same():
    size = Constant(diameter="1 mm")
    mix = Feed(rate=1.0, mix={"copper": 0.25, "ABS": 0.75}, size=size)
    families = Feed(
        rate=1.0,
        families=[
            Family(material="copper", fraction=0.25, size=size),
            Family(material="ABS", fraction=0.75, size=size),
        ],
    )
    assert mix.all_families() == families.all_families()
    with pytest.raises(InputError):
        Feed(rate=1.0, mix={"copper": 1.0}, size=size, families=families.families)
    with pytest.raises(InputError):
        Feed(rate=1.0)
    with pytest.raises(InputError):
        Feed(rate=1.0, mix={"copper": 1.0})


def test_a_material_of_the_library_needs_only_what_differs():
    scene = Scene(
        materials={"copper": {"friction": 0.4}, "sand": Material(kind="insulator", density=2650, permittivity=4)}
    )
    assert scene.materials["copper"].density == 8960.0
    assert scene.materials["copper"].friction == 0.4
    assert {"sand", "ABS"} <= set(scene.materials)
    with pytest.raises(InputError, match=r"permittivity is missing"):
        Material(kind="insulator", density=1000.0)
    assert cesim.scenes.single_particle().materials["copper"].friction == 0.2  # the library itself is untouched


def test_smallest_diameters_match_the_distributions():
    assert LogNormal(median=1e-3, gsd=1.4).smallest() == pytest.approx(1e-3 * 1.4**-3.0902, rel=1e-3)
    assert LogNormal(median=1e-3, gsd=1.4, least=8e-4).smallest() == 8e-4
    assert Weibull(scale=1e-3, shape=2.0).smallest() == pytest.approx(1e-3 * math.sqrt(1.0005e-3), rel=1e-3)
    assert Uniform(least=1e-4, most=1e-3).smallest() == 1e-4
    assert Normal(mean=1e-3, deviation=1e-3).limits()[0] > 0.0
    with pytest.raises(InputError):
        Uniform(least=2e-3, most=1e-3)


@pytest.mark.parametrize(
    ("diameter", "fraction"),
    [
        ([1e-3], []),
        ([], []),
        ([2e-3, 1e-3], [0.5, 1.0]),
        ([1e-3, 2e-3], [1.0, 0.5]),
        ([1e-3], [0.5]),
        ([math.nan], [1.0]),
    ],
)
def test_impossible_tables_of_sizes_are_refused(diameter, fraction):
    with pytest.raises(InputError):
        Table(diameter=diameter, fraction=fraction)


# ---- text form -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("named", NAMED)
def test_named_scenes_survive_a_round_trip_through_toml(named, tmp_path):
    scene = named()
    assert Scene.from_toml(scene.to_toml()) == scene
    scene.save(tmp_path / "scene.toml")
    twin = load(tmp_path / "scene.toml")
    assert twin == scene
    assert list(twin.materials) == list(scene.materials)


def reals(least, most):
    return st.floats(least, most, allow_nan=False, allow_subnormal=False)


sizes = st.one_of(
    st.builds(Constant, diameter=reals(1e-6, 0.05)),
    st.builds(lambda a, b: Uniform(least=min(a, b), most=max(a, b)), reals(1e-6, 0.05), reals(1e-6, 0.05)),
    st.builds(LogNormal, median=reals(1e-6, 0.05), gsd=reals(1, 10), most=st.none() | reals(1e-2, 0.05)),
    st.builds(Weibull, scale=reals(1e-6, 0.05), shape=reals(0.1, 100)),
    st.builds(
        lambda d: Table(diameter=sorted(d), fraction=[0.5] * (len(d) - 1) + [1.0]),
        st.lists(reals(1e-6, 0.05), min_size=1),
    ),
)
rates = st.builds(
    lambda value, unit: Rate(f"{value!r} {unit}"), reals(0, 100), st.sampled_from(["kg/s", "1/s", "kg/h"])
)
points = st.tuples(reals(-10, 10), reals(-10, 10))
motions = st.none() | st.builds(Vibration, amplitude=reals(0, 0.1), frequency=reals(0, 1000))
effect_settings = st.dictionaries(st.sampled_from(["drag", "image_force"]), st.sampled_from(["auto", "on", "off"]))
scenes = st.builds(
    Scene,
    name=st.text(st.characters(codec="utf-8"), max_size=50),
    drum=st.none() | st.builds(Drum, radius=reals(1e-3, 5), speed=reals(-1000, 1000), friction=reals(0, 10)),
    electrode=st.none() | st.builds(Electrode, distance=reals(1e-3, 10), voltage=reals(-2e5, 2e5)),
    corona=st.none() | st.builds(Corona, height=reals(0, 1), field=st.none() | reals(0, 3e6)),
    plates=st.lists(st.builds(Plate, end=points, motion=motions), max_size=3),
    splitters=st.lists(st.builds(Splitter, tip=points), max_size=3),
    feed=st.none() | st.builds(Feed, rate=rates, mix=st.just({"copper": 0.25, "ABS": 0.75}), size=sizes),
    materials=st.dictionaries(
        st.text(st.characters(codec="utf-8"), min_size=1, max_size=10),
        st.builds(Material, kind=st.just("conductor"), density=reals(1, 30_000), pairs=st.just({"drum": {}})),
        max_size=3,
    ),
    collect=st.none() | st.builds(Collect, y=reals(-10, 10), datum=reals(-10, 10)),
    effects=effect_settings,
)


@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(scenes)
def test_any_scene_survives_a_round_trip_through_toml(scene):
    twin = Scene.from_toml(scene.to_toml())
    assert twin == scene
    assert twin.to_toml() == scene.to_toml()
    if scene.feed is not None:
        assert twin.feed.rate.kind == scene.feed.rate.kind


def test_a_hand_written_file_is_short(tmp_path):
    text = """
    cesim = 1
    name = "my machine"
    [drum]
    speed = "60 rpm"
    [electrode]
    voltage = "-28 kV"
    [[plates]]
    motion = {kind = "vibration", amplitude = "0.5 mm", frequency = "50 Hz", direction = "60 deg"}
    [feed]
    rate = "5000 1/s"
    mix = {copper = 0.3, PVC = 0.7}
    size = {kind = "lognormal", median = "0.9 mm", gsd = 1.4}
    [effects]
    drag = "off"
    image_force = {state = "on", parameters = {kappa = 1.5}}
    """
    (tmp_path / "ümlaut scene.toml").write_text(text, encoding="utf-8")
    scene = load(tmp_path / "ümlaut scene.toml")
    assert scene.drum.speed == pytest.approx(2.0 * math.pi)
    assert scene.feed.rate.kind == "count"
    assert scene.brush is None
    assert scene.effects["drag"].state == "off"
    assert scene.effects["image_force"].parameters == {"kappa": 1.5}


@pytest.mark.parametrize("version", ["2", "0", '"1"', "true", "1.0", "99999999999999999999"])
def test_a_file_of_another_version_is_refused(version):
    with pytest.raises(InputError, match=r"^cesim is"):
        Scene.from_toml(f"cesim = {version}")


@pytest.mark.parametrize(
    "content",
    [
        b"\xff\xfe",
        b"[drum",
        b"drum = 3",
        b"[[drum]]",
        b"name = 3",
        b"x = " + b"[" * 100_000,
        b"drum = 1979-05-27",
        b"a: 1",
        b"[drum]\nspeed = nan",
        b"[drum]\nspeed = " + b"9" * 6000,
        b"[drum]\nspeed = true",
        b"plates = {}",
        b"materials = 3",
        b"effects = 3",
        b"[effects]\ndrag = 3",
        b"[materials]\ncopper = 3",
        b"[feed]\nrate = 1\nmix = 3\nsize = 4",
    ],
    ids=lambda content: repr(content[:20]),
)
def test_text_that_is_no_scene_is_refused_in_one_line(content, tmp_path):
    (tmp_path / "scene.toml").write_bytes(content)
    with pytest.raises(InputError) as caught:
        load(tmp_path / "scene.toml")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_files_that_cannot_be_read_or_are_huge_are_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path / "missing.toml")
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        load("a\0b")
    (tmp_path / "huge.toml").write_bytes(b"# " + b"x" * 10_000_000)
    with pytest.raises(InputError, match="larger than 10 MB"):
        load(tmp_path / "huge.toml")


@pytest.fixture
def inside(tmp_path):
    """A folder with a scene file writer, and a table of sizes inside and outside of it."""
    folder = tmp_path / "inside"
    folder.mkdir()
    for place in (folder, tmp_path):
        (place / "sizes.csv").write_text("# diameter, fraction\n0.5 mm, 0.2\n0.001, 1.0\n")
    os.symlink(tmp_path / "sizes.csv", folder / "link.csv")

    def write(name):
        text = f'[feed]\nrate = 1.0\nmix = {{copper = 1.0}}\nsize = {{kind = "table", file = "{name}"}}\n'
        (folder / "scene.toml").write_text(text)
        return folder / "scene.toml"

    return write


def test_a_table_of_measured_sizes_is_read_from_the_folder_of_the_scene(inside):
    scene = load(inside("sizes.csv"))
    assert scene.feed.size == Table(diameter=[0.5e-3, 1e-3], fraction=[0.2, 1.0])
    assert Scene.from_toml(scene.to_toml()) == scene


@pytest.mark.parametrize("name", ["../sizes.csv", "link.csv", "/etc/passwd", "x/../../sizes.csv"])
def test_no_path_is_followed_outside_the_folder(inside, name):
    with pytest.raises(InputError, match="outside the scene's folder"):
        load(inside(name))


@pytest.mark.parametrize("name", ["../sizes.csv", "link.csv"])
def test_a_path_outside_is_followed_when_the_user_says_so(inside, name):
    assert load(inside(name), allow_outside=True).feed.size.fraction == [0.2, 1.0]


@pytest.mark.parametrize("table", ["", "a,b\n", "1,2,3\n", "0.001\n", "0.001,2\n"])
def test_files_that_are_no_table_are_refused(inside, table):
    file = inside("sizes.csv")
    (file.parent / "sizes.csv").write_text(table)
    with pytest.raises(InputError):
        load(file)


def test_text_that_names_a_file_is_refused_where_there_is_no_folder():
    with pytest.raises(InputError, match="file"):
        Scene.from_toml('[feed]\nrate = 1.0\nmix = {copper = 1.0}\nsize = {kind = "table", file = "sizes.csv"}')


# ---- named scenes and what the engine gets -------------------------------------------------------------------------


@pytest.mark.parametrize("named", NAMED)
def test_named_scenes_say_their_source_and_what_is_ours(named):
    assert len(named.__doc__) > 100
    assert "ours" in named.__doc__ or "Ours" in named.__doc__
    assert named() is not named()


def test_named_scenes_have_the_parts_they_promise(scene):
    assert cesim.scenes.paper_machine("spheres").electrode.voltage == -23e3
    assert scene.electrode.voltage == -35e3
    bare = cesim.scenes.single_particle()
    assert (bare.feed, bare.brush, bare.plates, bare.splitters, bare.walls) == (None, None, [], [], [])
    assert bare.drum == scene.drum
    box = cesim.scenes.settling_box()
    assert (box.drum, box.electrode, box.feed) == (None, None, None)
    assert box.definition()["field"] is None
    assert box.definition()["landing_height"] == -math.inf


def test_the_field_faces_the_electrode_with_the_values_of_theory(scene):
    scene.electrode.voltage = "35 kV"
    field = scene.electric_field()
    direction = np.array([math.cos(math.radians(30)), math.sin(math.radians(30)), 0.0])
    drum, electrode = 0.16 * direction, (0.267 - 0.019) * direction
    strength = np.linalg.norm(field(np.array([drum, electrode])), axis=1)
    assert strength == pytest.approx([328_512, 854_335], rel=2e-6)
    assert field.potential(np.array([drum, electrode])) == pytest.approx([0.0, 35e3], abs=1e-6)
    assert field(drum[None])[0] @ direction < 0.0  # from the positive electrode to the drum
    with pytest.raises(InputError):
        field([0.0, 0.0, 0.0])
    with pytest.raises(InputError):
        field([[math.nan, 0.0, 0.0]])
    with pytest.raises(InputError, match="electrode is missing"):
        cesim.scenes.settling_box().electric_field()


def test_the_definition_turns_the_top_of_the_drum_to_the_electrode(scene):
    definition = scene.definition()
    rows = {row["name"]: row for row in definition["surfaces"]}
    assert list(rows) == ["drum", "brush", "plates[0]", "splitters[0]", "splitters[1]", "walls[0]", "walls[1]"]
    assert rows["drum"]["role"] == "ground"
    assert rows["brush"]["role"] == "brush"
    # velocity of the top = (0, 0, angular speed) x (0, R, 0)
    assert -rows["drum"]["angular_speed"] * 0.16 == pytest.approx(0.7506, abs=1e-4)
    # the brush turns in the same sense, its surface half as fast again
    assert rows["brush"]["angular_speed"] * 0.053 == pytest.approx(1.5 * rows["drum"]["angular_speed"] * 0.16)
    scene.drum.speed = "10 rpm"
    assert scene.definition()["surfaces"][1]["angular_speed"] == pytest.approx(
        -10.0 * math.pi / 30.0 * 1.5 * 0.16 / 0.053
    )
    scene.brush.speed = "30 rpm"
    assert scene.definition()["surfaces"][1]["angular_speed"] == pytest.approx(-math.pi)
    assert definition["reference_speed"] == pytest.approx(1.5 * 0.7506, abs=2e-4)
    assert definition["drum_radius"] == 0.16
    assert definition["rotation"] is True


def test_plate_and_blades_stand_where_they_should(scene):
    plate, upright, leaning = surfaces(scene)[2:5]
    angle = math.radians(5.7)
    top = plate.local(
        np.array([[-0.071, 0.171, 0.0], [-0.071 - 0.388 * math.cos(angle), 0.171 + 0.388 * math.sin(angle), 0.0]])
    )
    assert top == pytest.approx(np.array([[0.194, 0.005, 0.0], [-0.194, 0.005, 0.0]]), abs=1e-12)
    assert plate.row["belt_velocity"] == pytest.approx([0.4 * math.cos(angle), -0.4 * math.sin(angle), 0.0])
    assert upright.local(np.array([[0.149, -0.100, 0.0]]))[0] == pytest.approx([0.0, 0.075, 0.0])
    assert upright.local(np.array([[0.149, -0.250, 0.0]]))[0] == pytest.approx([0.0, -0.075, 0.0])
    foot = np.array([[0.205 + 0.15 * math.sin(math.radians(27)), -0.073 - 0.15 * math.cos(math.radians(27)), 0.0]])
    assert leaning.local(foot)[0] == pytest.approx([0.0, -0.075, 0.0])
    assert scene.collect.y == pytest.approx(upright.row["position"][1] + 0.077)  # 2 mm above its tip


def turn(quaternion, vector):
    w, *axis = quaternion
    across = np.cross(axis, vector)
    return vector + 2.0 * (w * across + np.cross(axis, across))


@given(st.tuples(reals(-1, 1), reals(-1, 1), reals(-1, 1)).filter(lambda n: math.hypot(*n) > 1e-6))
def test_a_wall_faces_the_way_its_normal_points(normal):
    (body,) = surfaces(Scene(walls=[Wall(position=(0, 0, 0), normal=normal)]))
    quaternion = np.array(body.row["orientation"])
    assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-12)
    assert turn(quaternion, np.array([0.0, 1.0, 0.0])) == pytest.approx(
        np.array(normal) / math.hypot(*normal), abs=1e-9
    )


def test_coefficients_follow_the_surface_unless_a_material_says_otherwise(scene):
    scene.materials["copper"].friction = 0.8
    scene.materials["copper"].pairs = {
        "drum": {"friction": 0.3},
        "ABS": {"restitution": 0.5},
        "splitters": {"friction": 1},
    }
    definition = scene.definition()
    copper, plastic = (list(scene.materials).index(name) for name in ("copper", "ABS"))
    assert definition["surface_friction"][:, copper].tolist() == [0.3, 0.9, 0.2, 1.0, 1.0, 0.2, 0.2]
    assert definition["surface_friction"][:, plastic].tolist() == [0.5, 0.9, 0.2, 0.1, 0.1, 0.2, 0.2]
    assert definition["grain_friction"][copper, plastic] == pytest.approx(math.sqrt(0.8 * 0.2))
    assert definition["grain_friction"][copper, copper] == pytest.approx(0.8)
    restitution = definition["grain_restitution"]
    assert restitution[copper, plastic] == restitution[plastic, copper] == 0.5
    assert restitution[copper, copper] == 0.0


def test_the_feed_reaches_the_engine_in_si(scene):
    feed = scene.definition()["feed"]
    names = list(scene.materials)
    assert (feed["rate_kind"], feed["rate"], feed["stop"]) == ("mass", pytest.approx(6.0 / 3600.0), math.inf)
    assert [(names[f["material"]], f["mass_fraction"]) for f in feed["families"]] == [("copper", 0.3), ("ABS", 0.7)]
    family = feed["families"][0]
    assert family["distribution"] == "lognormal"
    assert family["parameters"] == {"median": 0.9e-3, "gsd": 1.25}
    assert (family["least"], family["most"], family["table"]) == (0.5e-3, 1.6e-3, None)
    scene.feed.mix = {"copper": 0.3333333, "ABS": 0.6666666, "PVC": 0.0}
    fractions = [f["mass_fraction"] for f in scene.definition()["feed"]["families"]]
    assert len(fractions) == 2
    assert sum(fractions) == pytest.approx(1.0, abs=1e-15)
    scene.feed.size = Table(diameter=[1e-3, 2e-3], fraction=[0.5, 1.0])
    assert scene.definition()["feed"]["families"][0]["table"].tolist() == [[1e-3, 0.5], [2e-3, 1.0]]


def test_a_vibrating_plate_does_not_run(scene):
    scene.plates[0].motion = Vibration(amplitude="0.5 mm", frequency="50 Hz", direction="60 deg")
    row = scene.definition()["surfaces"][2]
    assert row["belt_velocity"] == (0.0, 0.0, 0.0)
    assert row["vibration"] == pytest.approx((0.25e-3, 0.5e-3 * math.sin(math.pi / 3.0), 0.0))
    assert row["vibration_frequency"] == 50.0
