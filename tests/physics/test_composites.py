"""Composites: grains of several materials, rigid, with the charges of each phase at its own place.

Sources: docs/physics.md 2.7. The closed forms of mass, centre and moments are those of balls, lenses and
shells; motions are held against Lagrange's equation and against independent integrations (scipy's DOP853).
"""

import math

import numpy as np
import pytest
from scenes import (
    GRAVITY,
    OPEN,
    VOLTAGE,
    bare_drum,
    contact_charge,
    drum_field,
    pauthenier_charge,
    plane_scene,
    simulation,
)
from scipy.integrate import solve_ivp

import cesim
from cesim import engine
from cesim.scene import Numerics
from cesim.scene.composites import grain_materials

COPPER, ABS = 8960.0, 1050.0
PERMITTIVITY = 2.87  # of ABS
UP = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # turns x to y


def dumbbell(first="copper", second="ABS", distance=2.0, **fields):
    return cesim.Composite(spheres=[(0, 0, 0, 1), (distance, 0, 0, 1)], materials=[first, second], **fields)


def ball(density):
    """Mass and moment of a ball of radius 1."""
    mass = 4.0 / 3.0 * math.pi * density
    return mass, 0.4 * mass


def lens(distance):
    """Volume that two balls of radius 1 share."""
    return math.pi * (4.0 + distance) * (2.0 - distance) ** 2 / 12.0


# ---- mass, centre, inertia -------------------------------------------------------------------------------------------


def test_two_balls_that_touch_have_the_mass_the_centre_and_the_moments_of_the_closed_form():
    template = cesim.shapes.template(dumbbell())
    (m1, i1), (m2, i2) = ball(COPPER), ball(ABS)
    d = 2.0 ** (4.0 / 3.0)  # of equal volume, over the radius
    assert template.scale == pytest.approx(d, rel=1e-12)
    assert template.density == pytest.approx(0.5 * (COPPER + ABS), rel=1e-12)
    assert template.contents == pytest.approx({"copper": m1 / (m1 + m2), "ABS": m2 / (m1 + m2)}, rel=1e-12)
    offset = 2.0 * m2 / (m1 + m2) / d
    assert template.spheres[:, 0] == pytest.approx([-offset, 2.0 / d - offset], abs=1e-12)
    across = i1 + i2 + 4.0 * m1 * m2 / (m1 + m2)
    moments = np.sort([i1 + i2, across, across]) / ((m1 + m2) * d * d)
    assert np.sort(template.moments) == pytest.approx(moments, rel=1e-10)
    assert template.mass_error < 1e-10


def test_what_two_balls_share_belongs_to_the_first():
    distance = 1.2
    template = cesim.shapes.template(dumbbell(distance=distance))
    whole, shared = ball(1.0)[0], lens(distance)
    copper, plastic = COPPER * whole, ABS * (whole - shared)
    assert template.contents["copper"] == pytest.approx(copper / (copper + plastic), rel=1e-9)
    assert template.phases[0]["volume"] == pytest.approx(whole / (2.0 * whole - shared), rel=1e-9)
    # First moment of the second ball without the lens, about its own centre: the lens' centre is in the middle.
    off = shared * 0.5 * distance / (whole - shared)
    center = plastic * (distance + off) / (copper + plastic)
    assert template.spheres[0, 0] * template.scale == pytest.approx(-center, rel=1e-9)


def test_a_core_before_its_cover_is_a_ball_in_a_shell_and_after_it_is_refused():
    core = [(0.0, 0.0, 0.0, 0.6), (0.0, 0.0, 0.0, 1.0)]
    template = cesim.shapes.template(cesim.Composite(spheres=core, materials=["copper", "ABS"]))
    mass = 4.0 / 3.0 * math.pi * (COPPER * 0.6**3 + ABS * (1.0 - 0.6**3))
    moment = 8.0 / 15.0 * math.pi * (COPPER * 0.6**5 + ABS * (1.0 - 0.6**5))
    assert template.materials == ("ABS",)  # the core touches nothing
    assert template.moments == pytest.approx(np.full(3, moment / (4.0 * mass)), rel=1e-9)
    with pytest.raises(cesim.InputError, match=r"materials\[1\].*core stands before"):
        cesim.shapes.template(cesim.Composite(spheres=core[::-1], materials=["ABS", "copper"]))


def test_a_composite_of_one_material_is_the_cluster():
    spheres = [(0, 0, 0, 1), (1.3, 0, 0, 0.8), (0.4, 1.1, 0.2, 0.7)]
    cluster = cesim.shapes.template(cesim.Cluster(spheres=spheres))
    composite = cesim.shapes.template(cesim.Composite(spheres=spheres, materials=["ABS"] * 3))
    assert composite.moments == pytest.approx(cluster.moments, rel=1e-9)
    assert np.abs(composite.spheres) == pytest.approx(np.abs(cluster.spheres), abs=1e-9)


# ---- contacts --------------------------------------------------------------------------------------------------------


def test_a_ball_with_a_heavy_core_beside_its_centre_swings_about_its_heavy_side():
    """Small swings, rolling without slipping: Lagrange's equation with the potential energy m g e (1 - cos a)."""
    offset, core = 0.35, 0.5
    shape = cesim.Composite(spheres=[(offset, 0, 0, core), (0, 0, 0, 1)], materials=["copper", "ABS"])
    template = cesim.shapes.template(shape)
    scene = plane_scene(friction=1000.0, step=2e-4)
    scene.shapes["loaded"] = shape
    sim = cesim.Simulation(scene)
    diameter, tilt = 4e-3, 0.05
    eccentric = np.linalg.norm(template.spheres[0, :3]) * diameter
    radius = template.spheres[0, 3] * diameter
    down = math.copysign(1.0, -template.spheres[0, 0])  # side of the body's x axis on which the copper is
    angle = -0.5 * math.pi * down + tilt  # of that axis above the horizontal
    place = (0.0, radius - eccentric * math.cos(tilt), 0.0)
    sim.add(place, shape="loaded", diameter=diameter, orientation=(math.cos(angle / 2), 0, 0, math.sin(angle / 2)))
    mass, moment = sim.mass[0], sim.mass[0] * diameter**2 * template.moments[2]
    omega = math.sqrt(mass * GRAVITY * eccentric / (moment + mass * (radius - eccentric) ** 2))
    spins = []
    for _ in range(round(2.2 * 2.0 * math.pi / omega / 2e-4)):
        sim.step()
        spins.append(sim.angular_velocity[0, 2])
    spins = np.array(spins)
    crossing = np.flatnonzero(np.diff(np.sign(spins[10:]))) + 10
    period = 2.0 * np.diff(crossing).mean() * 2e-4
    assert period == pytest.approx(2.0 * math.pi / omega, rel=0.01)


def test_a_bimetal_dumbbell_on_a_ridge_falls_to_its_heavy_side():
    scene = plane_scene(friction=0.3)
    scene.walls.append(cesim.Wall(position=(0.0, 0.0, 0.0), normal=(0.0, 1.0, 0.0), friction=0.3))
    scene.splitters = [cesim.Splitter(tip=(0.0, 0.01), tilt=0.0)]
    scene.shapes["heavy"] = dumbbell("copper", "aluminium")
    sim = cesim.Simulation(scene)
    template = sim.shapes[-1]
    middle = template.spheres[:, 0].mean() * 2e-3  # of the two balls, from the centre of mass
    # Its middle stands over the ridge: the centre of mass, towards the copper, does not.
    sim.add((-middle, 0.01 + template.spheres[0, 3] * 2e-3, 0.0), shape="heavy", diameter=2e-3)
    sim.run("0.03 s")
    copper = np.flatnonzero([name == "copper" for name in template.materials])[0]
    side = math.copysign(1.0, template.spheres[copper, 0])
    assert -side * sim.angular_velocity[0, 2] > 1.0  # clockwise where the copper is at +x


@pytest.mark.parametrize(("down", "restitution"), [("copper", 0.8), ("ABS", 0.3)])
def test_the_sphere_that_touches_brings_the_coefficients_of_its_own_material(down, restitution):
    scene = plane_scene(restitution=0.5)
    for name, value in (("copper", 0.8), ("ABS", 0.3)):
        scene.materials[name].pairs["walls"] = cesim.Pair(restitution=value)
    scene.shapes["it"] = dumbbell()
    sim = cesim.Simulation(scene)
    names = sim.shapes[-1].materials
    low = names.index(down)
    axis = math.copysign(1.0, sim.shapes[-1].spheres[low, 0])
    orientation = UP if axis < 0.0 else (UP[0], 0.0, 0.0, -UP[0])
    sim.add((0, 3e-3, 0), velocity=(0, -1.0, 0), shape="it", diameter=1e-3, orientation=orientation)
    before = 1.0
    while sim.velocity[0, 1] < 0.0:
        before = -sim.velocity[0, 1]
        sim.step()
    assert sim.velocity[0, 1] == pytest.approx(restitution * before, abs=0.02)


# ---- charges ---------------------------------------------------------------------------------------------------------

DIAMETER = 1e-3  # of equal volume; each ball of the dumbbell has
HALF = DIAMETER / 2.0 ** (1.0 / 3.0)


def standing(first_down, voltage=-VOLTAGE, materials=("copper", "ABS"), **parts):
    """A dumbbell that stands on the top of the drum on its first or second ball."""
    scene = bare_drum(voltage, speed=0.0, landing=None, **parts)
    scene.shapes["it"] = dumbbell(*materials)
    sim = simulation(scene)
    row = 0 if first_down else 1
    axis = sim.shapes[-1].spheres[row, 0]
    orientation = UP if axis < 0.0 else (UP[0], 0.0, 0.0, -UP[0])
    sim.add((0, 0.16 + 0.5 * HALF + abs(axis) * DIAMETER, 0), shape="it", diameter=DIAMETER, orientation=orientation)
    return sim


def test_metal_that_touches_the_drum_takes_the_charge_of_a_ball_of_its_size_and_no_other_does():
    sim = standing(True)
    sim.step(2)
    assert sim.conducted[0] == pytest.approx(contact_charge(HALF, drum_field(0.0, -VOLTAGE)), rel=1e-6, abs=0.0)
    assert sim.charge[0] == sim.conducted[0]
    other = standing(False)
    other.step(2)
    assert len(other.contacts) == 1  # with its plastic
    assert other.charge.tolist() == other.conducted.tolist() == [0.0]


def test_the_corona_charges_the_plastic_as_a_ball_of_its_size_whichever_touches():
    field = 400e3
    for down in (True, False):
        sim = standing(down, corona={"arc": (-0.5, 0.5), "field": field, "height": "5 mm"})
        sim.step(2)
        plastic = -pauthenier_charge(HALF, PERMITTIVITY, field)
        assert sim.charge[0] - sim.conducted[0] == pytest.approx(plastic, rel=1e-6, abs=0.0)
        assert (sim.conducted[0] > 0.0) == down


def test_two_metals_are_one_conductor_with_all_of_its_volume():
    sim = standing(True, materials=("copper", "aluminium"))
    assert grain_materials(sim_scene(sim))["it"].kind == "conductor"
    sim.step(2)
    assert sim.charge[0] == sim.conducted[0] > contact_charge(DIAMETER, drum_field(0.0, -VOLTAGE))  # it stands


def sim_scene(sim):
    return cesim.Scene.from_toml(sim.toml)


def test_a_charged_dumbbell_in_the_field_moves_as_two_charges_on_a_rigid_rod():
    """Against Newton's and Euler's equations with Q E at either ball, by DOP853; second order in the step."""
    charges = np.array([4e-12, -6e-12])

    def run(step):
        scene = bare_drum(-VOLTAGE, step=step, landing=None, effects={"sphere_plane": "off", "image_force": "off"})
        scene.shapes["it"] = dumbbell()
        sim = simulation(scene)
        sim.add((0.1925, 0.075, 0.0), shape="it", diameter=DIAMETER, angular_velocity=(0, 0, 5.0))
        sim.conducted[0], sim.charge[0] = charges[0], charges.sum()
        sim.run(0.032)
        return sim

    fine = run(1e-3)
    template, field = fine.shapes[-1], sim_scene(fine).electric_field()
    order = [template.materials.index(name) for name in ("copper", "ABS")]
    along = template.spheres[order, 0] * DIAMETER
    mass, moment = fine.mass[0], fine.mass[0] * DIAMETER**2 * template.moments[2]

    def rates(t, state):
        x, y, vx, vy, angle, spin = state
        axis = np.array([math.cos(angle), math.sin(angle)])
        points = np.array([x, y]) + along[:, None] * axis
        E = field(np.column_stack([points, np.zeros(2)]))[:, :2]
        force = charges[:, None] * E
        turn = (along * (axis[0] * force[:, 1] - axis[1] * force[:, 0])).sum()
        ax, ay = force.sum(axis=0) / mass
        return [vx, vy, ax, ay - GRAVITY, spin, turn / moment]

    exact = solve_ivp(rates, (0.0, 0.032), [0.1925, 0.075, 0, 0, 0, 5.0], method="DOP853", rtol=1e-11, atol=1e-14).y[
        :, -1
    ]
    errors = []
    for sim in (fine, run(2e-3)):
        angle = 2.0 * math.atan2(sim.orientation[0, 3], sim.orientation[0, 0])
        errors.append(
            (
                np.linalg.norm(sim.position[0, :2] - exact[:2]),
                abs(angle - exact[4]),
                abs(sim.angular_velocity[0, 2] - exact[5]),
            )
        )
    small, large = np.array(errors)
    assert abs(exact[5] - 5.0) > 3.0  # the field does turn it
    assert np.all(small < [2e-6, 4e-3, 0.1])
    assert np.all(large / small > 3.0)
    assert np.all(large / small < 5.5)


def test_weight_does_not_turn_a_composite_in_free_fall():
    sim = cesim.Simulation(flying())
    sim.add((0, 0, 0), shape="it", diameter=DIAMETER, angular_velocity=(0, 0, 3.0))
    sim.run(0.1)
    assert sim.angular_velocity[0] == pytest.approx([0, 0, 3.0], abs=1e-12)
    assert sim.velocity[0, 1] == pytest.approx(-GRAVITY * 0.1, rel=1e-12)


def flying():
    scene = cesim.Scene(numerics=Numerics(threads=1), bounds=OPEN, effects={"drag": "off"})
    scene.shapes["it"] = dumbbell()
    return scene


# ---- runs ------------------------------------------------------------------------------------------------------------


def machine():
    scene = cesim.scenes.reference_machine("spheres")
    size = cesim.Constant(diameter=1e-3)
    families = [
        cesim.Family(material="copper", fraction=0.3, size=size),
        cesim.Family(material="joint", fraction=0.4, size=size, shape=dumbbell()),
        cesim.Family(material="ABS", fraction=0.3, size=size),
    ]
    scene.feed = cesim.Feed(rate="300 1/s", families=families, outlet=scene.feed.outlet, velocity=scene.feed.velocity)
    return cesim.Scene.from_toml(scene.validated().to_toml())


def test_runs_with_composites_restore_bit_for_bit_with_any_number_of_threads(tmp_path):
    scene = bare_drum(-VOLTAGE, corona={"arc": (-0.5, 0.5), "field": 400e3})
    scene.shapes["joint"] = dumbbell()
    scene = cesim.Scene.from_toml(scene.to_toml())
    sim, n = cesim.Simulation(scene, seed=3, threads=1), 600  # more than two blocks of rows
    place = np.column_stack([np.linspace(-0.02, 0.02, n), np.full(n, 0.163), 3e-3 * (np.arange(n) % 30)])
    spin = np.column_stack([np.linspace(-9.0, 9.0, n), np.full(n, 2.0), np.linspace(20.0, -20.0, n)])
    sim.add(place, shape="joint", diameter=DIAMETER, angular_velocity=spin)
    sim.add(place + np.array([0, 0.003, 0]), material="ABS", diameter=DIAMETER)
    sim.step(30)
    assert np.unique(sim.conducted).size > 10
    sim.save(tmp_path / "state.h5")
    again = cesim.Simulation.restore(tmp_path / "state.h5", threads=3)
    for one in (sim, again):
        one.step(10)
    assert sim.state_hash() == again.state_hash()


def test_results_count_a_composite_by_name_and_its_copper_as_copper(tmp_path):
    run = cesim.run(machine(), seed=3, until="1 s", save=tmp_path / "run.h5", threads=1)
    run = cesim.open(tmp_path / "run.h5")
    assert run.materials == ("copper", "ABS", "joint")
    assert run.products["joint"] == "middling"
    rows, names = run.landings, run.material_names
    share = run.contents["joint"]["copper"]
    of = {name: rows["mass"] * (rows["material"] == names.index(name)) for name in run.materials}
    held = of["copper"] + share * of["joint"]
    assert of["joint"].sum() > 0.0
    cut = float(np.median(rows["position"][:, 0]))
    right = rows["position"][:, 0] >= cut
    assert run.recovery("copper", cut) == pytest.approx(held[right].sum() / held.sum(), rel=1e-12)
    assert run.grade("copper", cut) == pytest.approx(held[right].sum() / rows["mass"][right].sum(), rel=1e-12)
    by_splitters = run.splitters(2, x=(cut, cut + 1e-9))
    assert by_splitters.recovery["copper"][0, 0] == pytest.approx(run.recovery("copper", cut), rel=1e-12)
    assert run.estimate("recovery[copper]", (cut, cut)) == pytest.approx(run.recovery("copper", cut), rel=1e-12)
    bins, grains = run.bins(20), run.bins(20, by="grain")
    assert set(bins.mass) == {"copper", "ABS"}
    assert bins.landed["copper"] == pytest.approx(held.sum(), rel=1e-12)
    total = sum(math.fsum(mass) for mass in bins.mass.values())
    total += sum(bins.underflow.values()) + sum(bins.overflow.values())
    assert total == pytest.approx(run.balance.landed.kg, rel=1e-15)
    assert grains.landed["joint"] == pytest.approx(of["joint"].sum(), rel=1e-12)
    assert "joint" in str(run)


def test_the_copper_of_a_mixture_counts_in_the_same_way():
    scene = cesim.scenes.reference_machine("spheres")
    scene.materials["board"] = cesim.Material.mixture({"copper": 0.25, "FR4": 0.75})
    scene.feed.mix, scene.feed.rate = {"board": 1.0}, "300 1/s"
    run = cesim.run(scene, seed=1, until="0.9 s", threads=1)
    assert run.bins(4).landed["copper"] == pytest.approx(0.25 * run.landings["mass"].sum(), rel=1e-9)


# ---- bad input -------------------------------------------------------------------------------------------------------


def composed(scene, given):
    scene.shapes["it"] = cesim.Composite(**given)
    return cesim.Simulation(scene)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"materials": ["copper"]}, "has 1 names for 2 spheres"),
        ({"materials": ["copper", "AB"]}, r"materials\[1\].*ABS"),
        ({"materials": ["copper", "board"]}, "a mixture"),
        ({"spheres": [(0, 0, 0, 1), (1, 0, 0, 1e-6)]}, "too small to be meant"),
    ],
)
def test_a_composite_that_cannot_be_is_refused(change, words):
    given = {"spheres": [(0, 0, 0, 1), (2, 0, 0, 1)], "materials": ["copper", "ABS"]} | change
    scene = plane_scene()
    scene.materials["board"] = cesim.Material.mixture({"copper": 0.3, "FR4": 0.7})
    with pytest.raises(cesim.InputError, match=words):
        composed(scene, given)


def test_a_composite_has_a_name_and_a_material_of_its_own():
    scene = plane_scene()
    scene.shapes["copper"] = dumbbell()
    with pytest.raises(cesim.InputError, match="name of its own"):
        cesim.Simulation(scene)
    scene = plane_scene()
    scene.shapes["it"] = dumbbell()
    sim = cesim.Simulation(scene)
    with pytest.raises(cesim.InputError, match="composite"):
        sim.add((0, 1, 0), shape="it", material="copper")
    mixed = cesim.scenes.reference_machine("spheres")
    with pytest.raises(cesim.InputError, match="families"):
        mixed.feed = {**mixed.feed.model_dump(), "shape": dumbbell()}


def test_what_the_engine_is_given_of_composites_is_checked():
    scene = plane_scene()
    scene.shapes["it"] = dumbbell()
    base = scene.definition()
    sphere, shape = base["shapes"]
    phases = shape["phases"]
    for wrong, words in (
        ({"sphere_materials": np.array([0, 99], np.uint32)}, "sphere 1 is of material 99"),
        ({"sphere_materials": np.array([0], np.uint32)}, "shape"),
        ({"material": 99}, "of material 99"),
        ({"phases": phases[:1]}, "two phases"),
        ({"phases": [phases[0], {**phases[1], "volume": 0.7}]}, "volume"),
        ({"phases": [phases[0], {**phases[1], "orientation": (2.0, 0, 0, 0)}]}, "unit quaternion"),
        ({"phases": [{**phases[0], "center": (0.3, 0, 0)}, phases[1]]}, "common centre"),
    ):
        with pytest.raises(engine.InputError, match=words):
            engine.Scene({**base, "shapes": [sphere, {**shape, **wrong}]})
