"""Joints, motors and dynamic parts against closed forms, another integrator, and ledgers that must close."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import cesim
from cesim import Joint, LinearMotor, Motor, RigidPart, Scene, Simulation, Slide, Splitter

G = 9.81
OPEN = {"lower": (-5.0, -5.0, -5.0), "upper": (5.0, 5.0, 5.0)}
HINGE = (0.0, 0.0, 1.0)


def machine(parts=(), joints=(), step=1e-3, gravity=(0.0, -G, 0.0), **rest):
    numerics = {"step": step, **rest.pop("numerics", {})}
    return Scene(parts=list(parts), joints=list(joints), numerics=numerics, gravity=gravity, bounds=OPEN, **rest)


def hanging(angle, length):
    """The place of what hangs at an angle from straight down."""
    return (length * math.sin(angle), -length * math.cos(angle), 0.0)


def rod(name, angle, length, mass=1.0, moment=1e-3, start=(0.0, 0.0, 0.0), **rest):
    place = tuple(np.add(start, hanging(angle, length)))
    return RigidPart(name=name, mass=mass, inertia=(moment, moment, moment), position=place, **rest)


def energy(sim):
    """Kinetic, and that of the parts in gravity."""
    masses = np.array([part["mass"] for part in sim.definition["parts"]])
    heights = -np.asarray(sim.definition["gravity"]) @ sim.parts["position"].T
    return sim.health.kinetic_energy + float(masses @ heights)


# ---- the pendulum ---------------------------------------------------------------------


def swing(step, amplitude=1.0, time=8.0, length=0.2, moment=1e-3):
    """Relative error of the period, energies over m g L, and the simulation."""
    sim = Simulation(
        machine([rod("rod", amplitude, length, moment=moment)], [Joint(kind="revolute", a="rod", axis=HINGE)], step)
    )
    travel, energies = [], []
    for _ in range(round(time / step)):
        sim.step()
        travel.append(float(sim.joints["travel"][0]))
        energies.append(energy(sim) / (G * length))
    angle = amplitude + np.array(travel)
    before = np.flatnonzero(np.diff(np.sign(angle)))
    crossings = step * (before + angle[before] / (angle[before] - angle[before + 1]))
    period = 2.0 * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    exact = 4.0 * ellipk(math.sin(0.5 * amplitude) ** 2) * math.sqrt((moment + length**2) / (G * length))
    return period / exact - 1.0, np.array(energies) + math.cos(amplitude), sim


def test_a_pendulum_has_its_period_to_second_order():
    coarse, fine = (swing(step)[0] for step in (4e-3, 2e-3))
    assert abs(coarse) < 1e-4
    assert coarse / fine == pytest.approx(4.0, rel=0.05)


def test_the_energy_of_a_pendulum_does_not_drift():
    _, energies, _ = swing(2e-3, time=20.0)
    first, last = np.split(np.abs(energies), [len(energies) // 2])
    assert first.max() < 5e-5
    assert last.max() < 1.01 * first.max()


def test_a_joint_stays_together_to_rounding():
    _, _, sim = swing(4e-3)
    assert sim.health.joint_drift < 1e-15  # of 0.2 m


# ---- motors ---------------------------------------------------------------------


def flywheel(motor, step=1e-3):
    wheel = RigidPart(name="wheel", mass=20.0, inertia=(0.3, 0.3, 0.4))
    return Simulation(machine([wheel], [Joint(kind="revolute", a="wheel", axis=HINGE, motor=motor)], step))


def test_a_motor_reaches_its_speed_in_inertia_times_speed_over_torque():
    sim = flywheel(Motor(speed=4.7, torque_limit="5 N m"))
    sim.step(375)
    joint = sim.joints[0]
    assert joint["at_limit"] == 1
    assert joint["effort"] == pytest.approx(5.0, rel=1e-12)
    assert joint["speed"] == pytest.approx(5.0 * 0.375 / 0.4, rel=1e-12)
    assert joint["travel"] == pytest.approx(0.5 * 5.0 / 0.4 * 0.375**2, rel=1e-12)
    sim.step(5)
    joint = sim.joints[0]
    assert joint["at_limit"] == 0
    assert joint["speed"] == pytest.approx(4.7, abs=1e-12)
    assert joint["energy"] == pytest.approx(0.5 * 0.4 * 4.7**2, rel=1e-12)
    assert joint["energy"] == pytest.approx(sim.health.kinetic_energy, rel=1e-12)
    assert joint["impulse"] == pytest.approx(0.4 * 4.7, rel=1e-12)


@pytest.mark.parametrize("limit", [None, "50 N m"])
def test_a_motor_keeps_a_law_in_time(limit):
    sim = flywheel(Motor(law=[("0 s", 0.0), ("0.2 s", 3.0), ("0.3 s", 3.0), ("0.5 s", "-60 rpm")], torque_limit=limit))
    sim.step(100)
    assert sim.joints["speed"][0] == pytest.approx(1.5, abs=1e-12)
    assert sim.joints["effort"][0] == pytest.approx(0.4 * 15.0, rel=1e-9)
    assert sim.joints["power"][0] == pytest.approx(0.4 * 15.0 * (1.5 - 0.5 * 0.015), rel=1e-9)  # mean of the step
    sim.step(900)
    assert sim.joints["speed"][0] == pytest.approx(-2.0 * math.pi, abs=1e-12)
    travel = 0.5 * 0.2 * 3.0 + 0.1 * 3.0 + 0.5 * 0.2 * (3.0 - 2.0 * math.pi) - 0.5 * 2.0 * math.pi
    assert sim.joints["travel"][0] == pytest.approx(travel, abs=1e-12 if limit is None else 1e-5)


@pytest.mark.parametrize("limit", [None, "3 N m"])
def test_a_motor_that_holds_a_load_reports_its_torque(limit):
    arm = rod("arm", 0.5 * math.pi, 0.25)
    sim = Simulation(
        machine([arm], [Joint(kind="revolute", a="arm", axis=HINGE, motor=Motor(torque_limit=limit, speed=0))])
    )
    sim.step(100)
    joint = sim.joints[0]
    assert joint["effort"] == pytest.approx(G * 0.25, rel=1e-12)
    assert joint["power"] == pytest.approx(0.0, abs=1e-12)
    assert joint["force"] == pytest.approx((0.0, G, 0.0), abs=1e-10)
    assert abs(joint["travel"]) < 1e-5  # a motor with a limit takes a step to find its torque


def test_a_motor_too_weak_for_its_load_slips_at_its_limit():
    arm = rod("arm", 0.5 * math.pi, 0.25)
    motor = Motor(speed=0.0, torque_limit="2 N m")
    sim = Simulation(machine([arm], [Joint(kind="revolute", a="arm", axis=HINGE, motor=motor)], step=1e-4))
    sim.step(100)
    sinking = (2.0 - G * 0.25) / (1e-3 + 0.25**2)
    assert sim.joints["at_limit"][0] == 1
    assert sim.joints["effort"][0] == pytest.approx(2.0, rel=1e-12)
    assert sim.joints["speed"][0] == pytest.approx(0.01 * sinking, rel=1e-4)  # while the arm is level


# ---- slides and stops ---------------------------------------------------------------------


def test_a_slide_falls_freely_to_its_stop_and_rests_there():
    block = RigidPart(name="block", mass=0.5, inertia=(1e-3, 1e-3, 1e-3))
    joint = Joint(kind="prismatic", a="block", axis=(1.0, 1.0, 0.0), stops=("-10 cm", "30 cm"))
    sim = Simulation(machine([block], [joint]))
    sim.step(150)
    assert sim.joints["travel"][0] == pytest.approx(-0.5 * G / math.sqrt(2.0) * 0.15**2, rel=1e-12)
    assert sim.joints["at_stop"][0] == 0
    lowest = 0.0
    for _ in range(250):
        sim.step()
        lowest = min(lowest, float(sim.joints["travel"][0]))
    joint = sim.joints[0]
    assert lowest > -0.1 - 1e-15
    assert joint["travel"] == pytest.approx(-0.1, abs=1e-15)
    assert abs(joint["speed"]) < 1e-12
    assert joint["at_stop"] == -1
    assert joint["force"] == pytest.approx((0.0, 0.5 * G, 0.0), abs=1e-10)


def test_a_splitter_on_a_driven_slide_carries_its_weight():
    slide = Slide(
        axis=(0, 2, 0), mass="200 g", motor=LinearMotor(law=[(0, 0), ("0.1 s", "0.1 m/s")], force_limit="10 N")
    )
    sim = Simulation(machine(splitters=[Splitter(tip=(0.0, 0.0), motion=slide)]))
    assert sim.joint_names == sim.part_names == ("splitters[0]",)
    sim.step(50)
    assert sim.joints["effort"][0] == pytest.approx(0.2 * (G + 1.0), rel=1e-9)
    sim.step(150)
    assert sim.joints["effort"][0] == pytest.approx(0.2 * G, rel=1e-9)
    assert sim.joints["speed"][0] == pytest.approx(0.1, abs=1e-12)
    assert sim.parts["position"][0] == pytest.approx((0.0, -0.075 + 0.015, 0.0), abs=2e-6)


# ---- three dimensions ---------------------------------------------------------------------


def top_precession(step, lean=0.5, spin=300.0):
    """Mean rate of precession of a heavy top started in steady precession, over the exact one; and how far it nods."""
    mass, arm, across, along = 0.1, 0.05, 5e-5, 4e-5
    about_tip = across + mass * arm**2
    root = math.sqrt((along * spin) ** 2 - 4.0 * about_tip * math.cos(lean) * mass * G * arm)
    exact = (along * spin - root) / (2.0 * about_tip * math.cos(lean))
    axis = np.array([math.sin(lean), math.cos(lean), 0.0])
    turning = np.array([0.0, exact, 0.0]) + (spin - exact * math.cos(lean)) * axis
    part = RigidPart(
        name="top",
        mass=mass,
        inertia=(across, along, across),
        position=tuple(arm * axis),
        orientation=(math.cos(0.5 * lean), 0.0, 0.0, -math.sin(0.5 * lean)),
        velocity=tuple(np.cross(turning, arm * axis)),
        angular_velocity=tuple(turning),
    )
    sim = Simulation(machine([part], [Joint(kind="spherical", a="top")], step))
    angles, leans = [0.0], []
    for _ in range(round(0.5 / step)):
        sim.step()
        x, y, z = sim.parts["position"][0]
        angles.append(math.atan2(-z, x))
        leans.append(math.acos(y / arm))
    return np.unwrap(angles)[-1] / 0.5 / exact, max(abs(np.array(leans) - lean))


def test_a_heavy_top_precesses_at_its_rate_to_second_order():
    (coarse, nod), (fine, _) = (top_precession(step) for step in (1e-3, 5e-4))
    assert coarse == pytest.approx(1.0, abs=1e-4)
    assert nod < 1e-4
    assert (coarse - 1.0) / (fine - 1.0) == pytest.approx(4.0, rel=0.1)


def test_a_free_part_keeps_its_momenta_and_energy():
    part = RigidPart(
        name="brick", mass=2.0, inertia=(1e-3, 2e-3, 2.7e-3), velocity=(1, 2, 3), angular_velocity=(3, 20, 1)
    )
    sim = Simulation(machine([part], gravity=(0.0, 0.0, 0.0)))
    start = sim.health.kinetic_energy
    moment = [3e-3, 40e-3, 2.7e-3]
    for _ in range(50):
        sim.step(20)
        assert sim.health.kinetic_energy == pytest.approx(start, rel=2e-3)
        assert spin_momentum(sim, 0) == pytest.approx(moment, rel=1e-12)
    assert sim.parts["position"][0] == pytest.approx((1.0, 2.0, 3.0), rel=1e-12)


def spin_momentum(sim, part):
    """Angular momentum of a part about its centre of mass, world."""
    w, x, y, z = sim.parts["orientation"][part]
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    inertia = np.diag(sim.definition["parts"][part]["inertia"])
    return turn @ inertia @ turn.T @ sim.parts["angular_velocity"][part]


# ---- several parts ---------------------------------------------------------------------


def double_pendulum(step, time=1.0):
    """Two rods of 1 kg and 10 g; angles of both at the end."""
    length, first, second = 0.2, 0.1, 0.05
    parts = [
        rod("upper", 1.0, first, 1.0, 4e-3),
        rod("lower", 2.0, second, 0.01, 2e-5, start=hanging(1.0, length)),
    ]
    joints = [
        Joint(kind="revolute", a="upper", axis=HINGE),
        Joint(kind="revolute", a="lower", b="upper", anchor=hanging(1.0, length), axis=HINGE),
    ]
    sim = Simulation(machine(parts, joints, step))
    sim.run(time)
    one, other = sim.joints["travel"]
    return np.array([1.0 + one, 2.0 + one + other]), sim


def double_pendulum_reference(time=1.0):
    length, c1, c2, m1, m2, i1, i2 = 0.2, 0.1, 0.05, 1.0, 0.01, 4e-3, 2e-5

    def rates(_, y):
        a, b, p, q = y
        coupling = m2 * length * c2
        mass = [
            [i1 + m1 * c1**2 + m2 * length**2, coupling * math.cos(a - b)],
            [coupling * math.cos(a - b), i2 + m2 * c2**2],
        ]
        force = [
            -coupling * math.sin(a - b) * q * q - (m1 * c1 + m2 * length) * G * math.sin(a),
            coupling * math.sin(a - b) * p * p - m2 * c2 * G * math.sin(b),
        ]
        return [p, q, *np.linalg.solve(mass, force)]

    return solve_ivp(rates, (0.0, time), [1.0, 2.0, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-12).y[:2, -1]


def test_a_double_pendulum_follows_another_integrator_to_second_order():
    exact = double_pendulum_reference(0.5)
    coarse, fine = (double_pendulum(step, 0.5)[0] - exact for step in (1e-3, 5e-4))
    assert np.abs(fine).max() < 2e-3
    assert coarse / fine == pytest.approx((4.0, 4.0), rel=0.1)


def test_a_fixed_joint_makes_one_body_of_two():
    parts = [
        RigidPart(name="near", mass=1.0, inertia=(1e-3, 1e-3, 1e-3), position=(0.1, 0, 0)),
        RigidPart(name="far", mass=2.0, inertia=(1e-3, 2e-3, 2e-3), position=(0.3, 0, 0)),
    ]
    weld = Joint(kind="fixed", a="far", b="near", anchor=(0.2, 0, 0))
    pair = Simulation(machine(parts, [Joint(kind="revolute", a="near", axis=HINGE), weld], 5e-4))
    middle = 0.7 / 3.0
    moment = 3e-3 + (0.1 - middle) ** 2 + 2.0 * (0.3 - middle) ** 2
    body = RigidPart(name="both", mass=3.0, inertia=(moment, moment, moment), position=(middle, 0, 0))
    single = Simulation(machine([body], [Joint(kind="revolute", a="both", axis=HINGE)], 5e-4))
    pair.step(2000)
    single.step(2000)
    assert pair.joints["travel"][0] == pytest.approx(single.joints["travel"][0], abs=5e-6)
    assert pair.joints["force"][0] == pytest.approx(single.joints["force"][0], abs=1e-3)
    assert pair.health.joint_drift < 1e-15


CORNERS = np.array([(0.0, 0.0, 0.0), (0.05, 0.1, 0.0), (0.25, 0.15, 0.0), (0.2, 0.0, 0.0)])


def four_bar(step=1e-3, motor=None, **last):
    """Crank, coupler and rocker; the fourth bar is the ground."""

    def bar(name, start, end):
        along = end - start
        length, angle = float(np.linalg.norm(along)), math.atan2(along[1], along[0])
        return RigidPart(
            name=name,
            mass=length,
            inertia=(1e-5, length**3 / 12.0 + 1e-5, length**3 / 12.0 + 1e-5),
            position=tuple(0.5 * (start + end)),
            orientation=(math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)),
        )

    a, b, c, d = CORNERS
    joints = [
        Joint(kind="revolute", name="crank", a="crank", anchor=tuple(a), axis=HINGE, motor=motor),
        Joint(kind="revolute", a="coupler", b="crank", anchor=tuple(b), axis=HINGE),
        Joint(kind="revolute", a="rocker", b="coupler", anchor=tuple(c), axis=HINGE),
        Joint(kind="revolute", a="rocker", anchor=tuple(d), axis=HINGE, **last),
    ]
    return machine([bar("crank", a, b), bar("coupler", b, c), bar("rocker", d, c)], joints, step)


def test_a_closed_loop_solves_and_its_redundant_rows_are_reported():
    scene = four_bar()
    assert "3 rows of the joints" in str(scene.check())
    sim = Simulation(scene)
    start = energy(sim)
    sim.step(1000)
    assert sim.health.redundant_rows == 3  # 20 rows hold 18 coordinates and leave one free
    assert sim.health.kinetic_energy > 0.1
    assert energy(sim) == pytest.approx(start, abs=2e-6)
    assert sim.health.joint_drift < 1e-15
    assert sim.health.converged


@pytest.mark.parametrize("limit", [None, "5 N m", "0.15 N m"])
def test_the_energy_of_a_driven_loop_is_the_work_of_its_motor_to_second_order(limit):
    gaps = []
    for step in (1e-3, 5e-4):
        sim = Simulation(four_bar(step, Motor(law=[(0, 0), (0.1, 3.0)], torque_limit=limit)))
        start = energy(sim)
        sim.run(0.5)
        gaps.append(energy(sim) - start - float(sim.joints["energy"][0]))
    assert abs(gaps[0]) < 1e-5  # of 0.06 J
    assert gaps[0] / gaps[1] == pytest.approx(4.0, rel=0.15)


def test_joints_on_one_axis_and_a_joint_beside_a_fixed_one_are_solved_and_reported():
    arm = rod("arm", 0.7, 0.2)
    once, twice = (Joint(kind="revolute", a="arm", axis=HINGE, anchor=(0, 0, z)) for z in (0.0, 0.1))
    single, double = (Simulation(machine([arm], joints)) for joints in ([once], [once, twice]))
    single.step(300)
    double.step(300)
    assert double.health.redundant_rows == 5
    assert double.joints["travel"][1] == pytest.approx(single.joints["travel"][0], abs=1e-12)
    assert double.joints["force"].sum(axis=0) == pytest.approx(single.joints["force"][0], rel=1e-9, abs=1e-9)
    held = Simulation(machine([arm], [Joint(kind="fixed", a="arm"), Joint(kind="spherical", a="arm")]))
    held.step(10)
    assert held.health.redundant_rows == 3
    assert held.health.kinetic_energy < 1e-25


# ---- what cannot be ---------------------------------------------------------------------


def revolute(a="arm", **rest):
    return Joint(kind="revolute", a=a, axis=HINGE, **rest)


IMPOSSIBLE = {
    "a loop that does not close": (lambda: four_bar(anchor_b=(1.0, 0.0, 0.0)), "cannot be met"),
    "the ground on the ground": (lambda: machine([], [Joint(kind="fixed", name="odd", a="ground")]), "odd"),
    "a part on itself": (lambda: machine([rod("arm", 0, 1)], [revolute(b="arm")]), r"joints\[0\]"),
    "two motors on one axis": (
        lambda: machine([rod("arm", 0, 1)], [revolute(motor=Motor(speed=1)), revolute(motor=Motor(speed=2))]),
        "nothing to move",
    ),
    "a weak motor on what is fixed": (
        lambda: machine(
            [rod("arm", 0, 1)], [revolute(motor=Motor(speed=1, torque_limit=1)), Joint(kind="fixed", a="arm")]
        ),
        "nothing to move",
    ),
    "stops that nothing can enforce": (
        lambda: machine([rod("arm", 0, 1)], [revolute(motor=Motor(speed=1), stops=(-1, 1))]),
        "stops",
    ),
    "a start that the joint forbids": (
        lambda: machine([rod("arm", 0, 1, velocity=(0, 1, 0))], [revolute()]),
        "start as they are said to",
    ),
    "an unknown part": (lambda: machine([], [revolute("leg")]), "leg"),
    "a second part of the name": (lambda: machine([rod("arm", 0, 1), rod("arm", 0, 1)]), "another part has"),
}


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_an_impossible_assembly_is_an_input_error(case):
    scene, words = IMPOSSIBLE[case]
    with pytest.raises(cesim.InputError, match=words):
        scene().check()


@pytest.mark.parametrize(
    "make",
    [
        lambda: RigidPart(name="p", mass=0, inertia=(1, 1, 1)),
        lambda: RigidPart(name="p", mass=1, inertia=(1, 1, 3)),
        lambda: Joint(kind="fixed", a="p", motor=Motor(speed=1)),
        lambda: Joint(kind="prismatic", a="p", motor=Motor(speed=1)),
        lambda: Joint(kind="revolute", a="p", axis=(0, 0, 0)),
        lambda: Joint(kind="revolute", a="p", stops=("10 deg", "20 deg")),
        lambda: Motor(law=[(1, 0), (0, 0)]),
        lambda: Motor(torque_limit="5 N"),
        lambda: cesim.Drum(drive=Motor(torque_limit="5 N m")),
        lambda: cesim.Drum(drive="engine"),
        lambda: Slide(axis=(0, 0, 0), mass=1),
    ],
)
def test_what_is_no_joint_is_refused(make):
    with pytest.raises(cesim.InputError):
        make()


def test_a_scene_with_joints_survives_its_text():
    scene = four_bar(motor=Motor(law=[(0, 0), (0.1, 3.0)], torque_limit="5 N m"))
    scene.drum = cesim.Drum(drive=Motor(mass="20 kg"), radius=0.01, length=0.01)
    scene.splitters = [Splitter(tip=(0.5, 0.0), motion=Slide(axis=(1, 0, 0), mass=1, stops=("-1 cm", "1 cm")))]
    again = Scene.from_toml(scene.to_toml())
    assert again.to_toml() == scene.to_toml()
    assert again.definition()["joints"] == scene.definition()["joints"]
    assert [joint["name"] for joint in scene.definition()["joints"][:2]] == ["drum", "splitters[0]"]
