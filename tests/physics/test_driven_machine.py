"""Grains on parts that move by forces: momenta and energies that must close, and the drum on its motor."""

import math

import numpy as np
import pytest

import cesim
from cesim import Joint, Motor, RigidPart, Scene, Simulation, Slide, Splitter

OPEN = {"lower": (-5.0, -5.0, -5.0), "upper": (5.0, 5.0, 5.0)}
STILL = (0.0, 0.0, 0.0)
AXIS = (0.0, 0.0, 1.0)
PLATE = {"tip": (0.0, 0.05), "length": 0.1, "thickness": 0.01, "width": 0.1}  # centred at the origin, upright


def machine(joints=(), *, friction=0.5, restitution=1.0, gravity=STILL, mass=0.01, step=1e-3, numerics=None, **part):
    """A plate of some mass, 10 cm high and 1 cm thick, which joints may hold."""
    body = RigidPart(name="plate", mass=mass, inertia=(1e-5, 2e-6, 1e-5), **part)
    return Scene(
        parts=[body],
        joints=list(joints),
        splitters=[Splitter(**PLATE, part="plate", friction=friction, restitution=restitution)],
        gravity=gravity,
        bounds=OPEN,
        effects={"drag": "off"},
        numerics={"step": step, "threads": 1, **(numerics or {})},
    )


def grain_moments(sim):
    """Momentum of all grains, and angular momentum about the origin; they are spheres."""
    momentum = sim.mass[:, None] * sim.velocity
    own = 0.1 * (sim.mass * sim.diameter**2)[:, None] * sim.angular_velocity
    return momentum.sum(axis=0), (np.cross(sim.position, momentum) + own).sum(axis=0)


def part_moments(sim):
    """The same of the part, which has turned about z only."""
    row, part = sim.definition["parts"][0], sim.parts[0]
    momentum = row["mass"] * part["velocity"]
    spin = np.asarray(row["inertia"]) * part["angular_velocity"]
    return momentum, np.cross(part["position"], momentum) + spin


# ---- hits ----------------------------------------------------------------------------------------------------------


def shot_at_plate(joints=(), height=0.03, speed=3.0, diameter=5e-3, **options):
    """Sum of momenta before and after, and the simulation, of a grain shot at the plate."""
    sim = Simulation(machine(joints, **options))
    sim.add((-0.05, height, 0.0), velocity=(speed, 0.4, 0.0), diameter=diameter, angular_velocity=(0, 0, 30.0))
    before = np.add(grain_moments(sim), part_moments(sim)), sim.health.kinetic_energy
    sim.step(40)
    assert sim.health.active_contacts > 0
    return before, (np.add(grain_moments(sim), part_moments(sim)), sim.health.kinetic_energy), sim


@pytest.mark.parametrize("mass", [1e-4, 1e-2, 1.0])  # of one problem with the grain, and by turns with it
def test_a_hit_keeps_momentum_and_angular_momentum_of_grain_and_part(mass):
    (before, energy), (after, left), sim = shot_at_plate(mass=mass)
    assert after == pytest.approx(before, rel=1e-11, abs=1e-14)
    assert np.abs(sim.parts["angular_velocity"][0, 2]) > 1.0
    assert left < energy  # by friction
    assert sim.health.converged


def test_a_hit_without_friction_keeps_the_energy():
    (_, energy), (_, left), _ = shot_at_plate(friction=0.0)
    assert left == pytest.approx(energy, rel=1e-11)


def test_a_hit_on_a_hinged_part_keeps_the_angular_momentum_about_the_hinge_and_the_energy():
    (before, energy), (after, left), sim = shot_at_plate([Joint(kind="revolute", a="plate", axis=AXIS)], friction=0.0)
    assert after[1, 2] == pytest.approx(before[1, 2], rel=1e-11)
    assert abs(after[0, 0] - before[0, 0]) > 1e-3  # the hinge takes momentum
    assert left == pytest.approx(energy, rel=1e-11)
    assert sim.joints["travel"][0] != 0.0


@pytest.mark.parametrize("limit", [None, "1 N m", "1 mN m"])
def test_the_energy_of_grain_and_part_grows_by_the_work_of_the_motor(limit):
    motor = Motor(speed=5.0, torque_limit=limit)
    hinge = Joint(kind="revolute", a="plate", axis=AXIS, motor=motor)
    turning = (0.0, 0.0, 5.0)  # a motor at work in the very step of a hit is exact to first order only
    (_, energy), (_, left), sim = shot_at_plate([hinge], friction=0.0, speed=1.0, angular_velocity=turning)
    assert sim.joints["energy"][0] != 0.0
    assert left == pytest.approx(energy + float(sim.joints["energy"][0]), rel=1e-10)
    assert sim.health.converged


def test_a_motor_too_weak_for_a_hit_is_at_its_limit_and_recovers():
    hinge = Joint(kind="revolute", a="plate", axis=AXIS, motor=Motor(speed=1.0, torque_limit="1 mN m"))
    sim = Simulation(machine([hinge], angular_velocity=(0, 0, 1.0)))
    sim.add((-0.05, 0.03, 0.0), velocity=(3.0, 0.0, 0.0), diameter=5e-3)
    limited = []
    for _ in range(400):
        sim.step()
        limited.append(int(sim.joints["at_limit"][0]))
    assert 0 < sum(limited) < 399
    assert sim.joints["speed"][0] == pytest.approx(1.0, abs=1e-9)


def test_a_turning_plate_lets_no_grain_through():
    """Its tip makes 2 mm a step; the grains are 0.5 mm, at rest."""
    hinge = Joint(kind="revolute", a="plate", axis=AXIS, motor=Motor(speed=40.0))
    sim = Simulation(
        machine([hinge], restitution=0.0, angular_velocity=(0, 0, 40.0), numerics={"grain_contact": False})
    )
    radii, angles = np.meshgrid(np.linspace(0.02, 0.049, 30), np.linspace(2.0, 2.9, 12))
    places = np.column_stack([(radii * np.cos(angles)).ravel(), (radii * np.sin(angles)).ravel(), np.zeros(radii.size)])
    sim.add(places, diameter=0.5e-3)
    sim.step(25)  # it turns by 1 rad
    hand = sim.joints["travel"][0]
    side = sim.position[:, 0] * math.cos(hand) + sim.position[:, 1] * math.sin(hand)  # off its middle plane
    beside = np.hypot(*sim.position[:, :2].T) < 0.049  # the others were thrown off its end
    assert beside.sum() > 200
    assert side[beside].max() < -0.005 - 0.25e-3 * 0.99
    assert sim.health.penetration_ratio < 1e-3


def test_a_grain_rests_on_a_part_that_hangs_on_its_motor():
    """A level plate, held up by a motor: the torque is that of the plate's end and the grain."""
    hinge = Joint(kind="revolute", a="plate", axis=AXIS, anchor=(-0.06, 0, 0), motor=Motor(speed=0.0, torque_limit=1))
    scene = machine(
        [hinge], gravity=(0.0, -9.81, 0.0), orientation=(math.sqrt(0.5), 0, 0, math.sqrt(0.5)), restitution=0.0
    )
    scene.splitters[0].tip, scene.splitters[0].tilt = (-0.05, 0.0), 0.5 * math.pi
    sim = Simulation(scene)
    sim.add((0.03, 0.005 + 2.5e-3, 0.0), diameter=5e-3)
    sim.step(300)
    grain = float(sim.mass[0])
    assert sim.joints["effort"][0] == pytest.approx(9.81 * (0.01 * 0.06 + grain * 0.09), rel=1e-4)
    assert sim.position[0, 1] == pytest.approx(0.0075, abs=1e-5)
    assert sim.health.converged


# ---- the drum ------------------------------------------------------------------------------------------------------


def drum(drive="prescribed", rate="3 kg/h", **numerics):
    scene = cesim.scenes.reference_machine("spheres")
    scene.feed.rate = rate
    scene.drum.drive = drive
    for name, value in {"threads": 1, **numerics}.items():
        setattr(scene.numerics, name, value)
    return scene


def landings(scene, steps=900):
    sim = Simulation(scene, seed=3)
    sim.step(steps)
    rows = sim.landings
    return dict(zip(rows["id"].tolist(), rows["position"][:, 0].tolist(), strict=True)), sim


def shifts(one, other):
    """Differences of the landing places of the grains that landed in both."""
    common = sorted(one.keys() & other.keys())
    assert len(common) > 100
    assert len(common) >= 0.98 * max(len(one), len(other))
    return np.array([one[i] - other[i] for i in common])


@pytest.fixture(scope="module")
def prescribed():
    return landings(drum())


def test_a_drum_on_a_motor_without_a_limit_is_the_prescribed_drum(prescribed):
    driven, sim = landings(drum(Motor(mass="20 kg")))
    assert np.median(np.abs(shifts(prescribed[0], driven))) < 1e-6
    assert sim.joints["speed"][0] == pytest.approx(-sim.scene.drum.speed, abs=1e-12)
    assert sim.joints["at_limit"][0] == 0


def test_a_drum_on_a_motor_with_a_limit_is_the_prescribed_drum_within_the_load(prescribed):
    driven, sim = landings(drum(Motor(mass="20 kg", torque_limit="5 N m")))
    shift = shifts(prescribed[0], driven)
    assert np.median(np.abs(shift)) < 1e-4
    assert abs(shift.mean()) < 3e-3
    assert sim.joints["at_limit"][0] == 0
    assert sim.joints["speed"][0] == pytest.approx(-sim.scene.drum.speed, abs=1e-9)
    assert sim.health.converged  # grains of 1e-6 kg on 20 kg


def torque_ledger(sim, steps):
    """Moment impulses about the axis in each step: of the motor, on the grains, and what the drum kept."""
    inertia = sim.definition["parts"][0]["inertia"][2]
    speed, rows = sim.joints["speed"][0], []
    for _ in range(steps):
        sim.step()
        contacts = sim.contacts[sim.contacts["b"] == -1 - sim.surface_names.index("drum")]
        radius = np.hypot(contacts["point"][:, 0], contacts["point"][:, 1])
        levers = radius[:, None] * contacts["normal"]  # a grain that rides has the normal of the start of its path
        on_grains = float(np.cross(levers, contacts["impulse"])[:, 2].sum())
        now = sim.joints[0]
        rows.append((float(now["effort"]) * sim.step_size, on_grains, inertia * (now["speed"] - speed)))
        speed = now["speed"]
    return np.array(rows)


@pytest.mark.parametrize("limit", [None, "5 N m", "20 uN m"])
def test_the_torque_of_the_motor_is_what_grains_and_drum_take(limit):
    scene = drum(Motor(mass="2 kg", torque_limit=limit))
    scene.drum.rolling_friction = 0.0  # its moments are not among the contacts' impulses
    sim = Simulation(scene, seed=3)
    sim.step(300)
    given, on_grains, kept = torque_ledger(sim, 50).T
    assert np.abs(on_grains).min() > 0.9e-9
    assert given == pytest.approx(on_grains + kept, rel=1e-9, abs=1e-15)
    assert (np.abs(kept).max() > 1e-9) == (limit == "20 uN m")  # too weak: it slows down
    assert given.mean() < 0.0  # a drum that turns about -z drives grains that way


@pytest.mark.parametrize(("heavy", "grain"), [("20 kg", 0.7e-3), ("200 kg", 0.3e-3)])
def test_a_mass_ratio_of_a_million_is_solved_to_its_tolerance(heavy, grain):
    scene = drum(Motor(mass=heavy, torque_limit="5 N m"))
    scene.feed = None
    sim = Simulation(scene)
    angles = np.linspace(0.0, 0.4, 60)
    radius = scene.drum.radius + 0.5 * grain
    sim.add(
        np.column_stack([radius * np.sin(angles), radius * np.cos(angles), 0.0 * angles]),
        velocity=(0.3, 0.0, 0.0),
        material="copper",
        diameter=grain,
    )
    assert float(sim.definition["parts"][0]["mass"]) / float(sim.mass[0]) > 1e6
    sim.step(200)
    assert sim.health.converged
    assert sim.joints["speed"][0] == pytest.approx(-scene.drum.speed, abs=1e-10)


def test_a_light_gate_under_heavy_grains_is_solved_or_said_not_to_be():
    """A million times lighter than what lies on it."""
    slide = Slide(axis=(0, 1, 0), mass="1 mg", stops=("-20 mm", "0 mm"))
    scene = Scene(
        splitters=[Splitter(tip=(-0.05, 0.0), tilt=0.5 * math.pi, length=0.1, width=0.1, motion=slide)],
        bounds=OPEN,
        numerics={"threads": 1},
    )
    sim = Simulation(scene)
    sim.add([(x, 0.0105, 0.0) for x in (-0.03, 0.0, 0.03)], diameter=20e-3)  # 37 g each
    sim.step(300)
    weight = 9.81 * (float(sim.mass.sum()) + 1e-6)
    resting = sim.joints["at_stop"][0] == -1 and sim.joints["force"][0, 1] == pytest.approx(weight, rel=1e-3)
    assert resting or not sim.health.converged


# ---- bits ----------------------------------------------------------------------------------------------------------


def driven(threads, steps):
    """A drum on a weak motor, a splitter on a slide, a hinged plate: all of them met by grains."""
    scene = drum(Motor(mass="1 kg", torque_limit="10 uN m"), rate="6 kg/h")
    scene.drum.rolling_friction = 0.0
    scene.parts = [RigidPart(name="gate", mass="5 g", inertia=(1e-5, 1e-5, 1e-5), position=(0.21, 0.05, 0.0))]
    scene.joints = [Joint(kind="revolute", a="gate", anchor=(0.21, 0.1, 0.0), axis=AXIS)]
    scene.splitters.append(Splitter(tip=(0.21, 0.1), length=0.1, part="gate"))
    scene.splitters[0].motion = Slide(axis=(1, 0, 0), mass="10 g", stops=("-1 cm", "1 cm"))
    scene.collect.y = -0.25  # below the foot of the blade
    sim = Simulation(scene, seed=5, threads=threads)
    x, y = scene.splitters[0].tip
    for place, speed in (((0.19, 0.08), 0.3), ((x - 0.005, y - 0.02), 0.5)):
        rows = np.column_stack([np.full(20, place[0]), place[1] - 0.002 * np.arange(20), np.linspace(-0.02, 0.02, 20)])
        sim.add(rows, velocity=(speed, 0.0, 0.0), diameter=1e-3)
    sim.step(steps)
    return sim


@pytest.fixture(scope="module")
def one_thread():
    return driven(1, 400)


def test_grains_move_every_part(one_thread):
    drum_joint, slide, gate = one_thread.joints
    assert drum_joint["speed"] != pytest.approx(-one_thread.scene.drum.speed, rel=1e-6)
    assert abs(slide["travel"]) > 1e-6
    assert abs(gate["travel"]) > 1e-3
    assert one_thread.health.converged


@pytest.mark.parametrize("threads", [2, 3, 5])
def test_the_bits_do_not_depend_on_threads(one_thread, threads):
    sim = driven(threads, 400)
    assert sim.state_hash() == one_thread.state_hash()


def test_the_parts_are_in_the_hash(one_thread):
    state = one_thread.engine.state()
    other = driven(1, 0)
    state["parts"] = state["parts"].copy()
    state["parts"][0, 0] += 1e-15
    other.engine.restore(state)
    assert other.state_hash() != one_thread.state_hash()
    state["parts"] = state["parts"][:-1]
    with pytest.raises(cesim.engine.InputError, match="parts"):
        other.engine.restore(state)


def test_a_restored_run_goes_on_bit_for_bit(tmp_path):
    sim = driven(1, 300)
    sim.save(tmp_path / "machine.h5")
    again = Simulation.restore(tmp_path / "machine.h5", threads=2)
    assert np.array_equal(again.parts, sim.parts)
    assert np.array_equal(again.joints, sim.joints)
    for one in (sim, again):
        one.step(100)
    assert again.state_hash() == sim.state_hash()
    assert again.health.kinetic_energy == sim.health.kinetic_energy


# ---- results -------------------------------------------------------------------------------------------------------


def test_a_run_tells_what_its_motor_gave(tmp_path):
    path = tmp_path / "run.h5"
    run = cesim.run(drum(Motor(mass="20 kg", torque_limit="5 N m")), until="0.4 s", save=path, progress=False)
    again = cesim.open(path)
    for result in (run, again):
        rows = result.joints["drum"]
        assert rows["time"][:-1] == pytest.approx(0.01 * np.arange(1, len(rows)))
        assert rows["speed"] == pytest.approx(-result.scene.drum.speed, abs=1e-9)
        assert rows["energy"][-1] == pytest.approx(rows["impulse"][-1] * rows["speed"][-1], rel=1e-6)
    line = next(line for line in str(run).splitlines() if line.startswith("motor"))
    assert line.split()[1] == "drum:"
    assert f"{run.joints['drum']['impulse'][-1] / run.time:.4g} N m" in line
    assert np.array_equal(run.joints["drum"], again.joints["drum"])
