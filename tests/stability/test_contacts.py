"""One grain, one pair, one column against closed forms: sticking, sliding, rolling, bouncing, drum, both laws.

Sliding dilation, oblique impact, bounces without end and a column at rest are hard cases: test_hard_cases.py.

Sources: docs/numerics.md 1 and 3 (numbers in brackets are its cases), docs/physics.md 2.3.

A sphere that must not turn ("a block") has a rolling friction of 10: the moment that would turn it is at most µ r N.
"""

import math

import numpy as np
import pytest
from scenes import GRAVITY, OPEN, plane_scene, set_on_drum
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import cesim

BLOCK = 10.0
RADIUS = 1e-3
LAWS = ("coulomb", "ccp")


def on_plane(scene, height=0.0, velocity=(0, 0, 0), radius=RADIUS, **rest):
    """A grain over the plane y = 0, by the height of its lowest point."""
    sim = cesim.Simulation(scene, threads=1)
    sim.add((0.0, radius + height, 0.0), velocity=velocity, material="copper", diameter=2.0 * radius, **rest)
    return sim


def spin(sim):
    return sim.angular_velocity[0, 2]


# ---- incline ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("share", [0.5, 0.99, 0.9999])
def test_a_block_sticks_on_an_incline_below_the_friction_angle(share, law):
    slope = math.atan(0.5 * share)
    sim = on_plane(plane_scene(slope, friction=0.5, rolling_friction=BLOCK, contact_law=law))
    sim.step(1000)
    assert np.abs(sim.position - (0.0, RADIUS, 0.0)).max() < 1e-12 * RADIUS
    assert np.abs(sim.velocity).max() < 1e-12


@pytest.mark.parametrize("share", [1.0001, 1.01, 1.5])
def test_a_block_slides_down_an_incline_with_g_sin_minus_mu_g_cos(share):
    slope = math.atan(0.5 * share)
    sim = on_plane(plane_scene(slope, friction=0.5, rolling_friction=BLOCK))
    sim.step(1000)
    acceleration = GRAVITY * (math.sin(slope) - 0.5 * math.cos(slope))
    # Sliding and rolling discs are solved by turns, to the tolerance of 1e-3 g h: nearest the angle that shows.
    assert sim.velocity[0, 0] == pytest.approx(acceleration * sim.time, rel=1e-9, abs=1e-5)
    assert sim.position[0, 1] == pytest.approx(RADIUS, abs=1e-9 * RADIUS)
    assert np.abs(sim.angular_velocity).max() * RADIUS < 1e-5


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("share", [0.0, 0.99, 1.01, 1.5])
def test_with_rotation_off_a_grain_is_a_block(law, share):
    """`numerics.rotation`: the tangential mobility is that of the normal, and there is no rolling row."""
    slope = math.atan(0.5 * share)
    scene = plane_scene(slope, friction=0.5, contact_law=law)
    scene.numerics.rotation = False
    sim = cesim.Simulation(scene, threads=1)
    speed = 0.2 if law == "coulomb" else 0.0
    sim.add((0.0, RADIUS, 0.0), velocity=(speed, 0.0, 0.0), material="copper", diameter=2.0 * RADIUS)
    sim.step(30)
    acceleration = GRAVITY * (math.sin(slope) - 0.5 * math.cos(slope))
    if law == "ccp" and share > 1.0:
        assert sim.velocity[0, 0] > 0.0  # it hops
        return
    moving = max(speed + acceleration * sim.time, 0.0) if speed or share > 1.0 else 0.0
    assert sim.velocity[0, 0] == pytest.approx(moving, rel=1e-9, abs=1e-12)
    assert sim.position[0, 1] == pytest.approx(RADIUS, abs=1e-9 * RADIUS)
    assert np.abs(sim.angular_velocity).max() == 0.0


@pytest.mark.parametrize("degrees", [5.0, 20.0, 40.0])
def test_a_sphere_rolls_down_an_incline_with_five_sevenths_of_g_sin(degrees):
    """Rolling without slip while tan(slope) <= 7/2 mu (any textbook of mechanics)."""
    slope = math.radians(degrees)
    sim = on_plane(plane_scene(slope, friction=0.5))
    sim.step(500)
    assert sim.velocity[0, 0] == pytest.approx(5.0 / 7.0 * GRAVITY * math.sin(slope) * sim.time, rel=1e-12)
    assert spin(sim) * RADIUS == pytest.approx(-sim.velocity[0, 0], rel=1e-12)


def test_a_sphere_on_a_steep_incline_slips_and_spins_by_the_friction_it_gets():
    slope = math.radians(65.0)  # tan > 7/2 mu
    sim = on_plane(plane_scene(slope, friction=0.5))
    sim.step(300)
    acceleration = GRAVITY * (math.sin(slope) - 0.5 * math.cos(slope))
    assert sim.velocity[0, 0] == pytest.approx(acceleration * sim.time, rel=1e-12)
    assert spin(sim) == pytest.approx(-2.5 * 0.5 * GRAVITY * math.cos(slope) * sim.time / RADIUS, rel=1e-12)


@pytest.mark.parametrize("step", [1e-3, 1e-4])
@pytest.mark.parametrize("law", LAWS)
def test_a_sliding_sphere_ends_rolling_with_five_sevenths_of_its_speed(step, law):
    """Angular momentum about the contact is conserved; rolling begins at t = 2 v / (7 mu g)."""
    sim = on_plane(plane_scene(friction=0.2, step=step, contact_law=law), velocity=(1.0, 0.0, 0.0))
    begins = None
    for _ in range(round(0.4 / step)):
        sim.step()
        if begins is None and abs(sim.velocity[0, 0] + spin(sim) * RADIUS) < 1e-9:
            begins = sim.time
    assert sim.velocity[0, 0] == pytest.approx(5.0 / 7.0, rel=1e-12)
    assert spin(sim) * RADIUS == pytest.approx(-5.0 / 7.0, rel=1e-12)
    assert begins == pytest.approx(2.0 / (7.0 * 0.2 * GRAVITY), abs=1.001 * step)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("share", [0.9, 0.999, 1.001, 1.1, 2.0])
def test_rolling_friction_holds_below_its_angle_and_brakes_above_it(share, law):
    """Moment mu_r r N against the weight's r m g sin: at rest while tan(slope) <= mu_r, else 5/7 g (sin - mu_r cos)."""
    slope = math.atan(0.1 * share)
    sim = on_plane(plane_scene(slope, friction=0.5, rolling_friction=0.1, contact_law=law))
    sim.step(500)
    acceleration = 5.0 / 7.0 * GRAVITY * (math.sin(slope) - 0.1 * math.cos(slope))
    # The discs are solved by turns, to the tolerance of 1e-5 m/s: nearest the threshold that is most of the motion.
    expected = max(acceleration, 0.0) * sim.time
    assert sim.velocity[0, 0] == pytest.approx(expected, rel=1e-9, abs=1e-5 if share > 1.0 else 1e-12)


# ---- bouncing (25) ---------------------------------------------------------------------------------------------------


def bounce(restitution, step, duration, height=0.01):
    """Heights and velocities of every step of a drop."""
    sim = on_plane(plane_scene(restitution=restitution, step=step), height)
    rows = np.empty((round(duration / step), 2))
    for row in rows:
        sim.step()
        row[:] = sim.position[0, 1] - RADIUS, sim.velocity[0, 1]
    return rows


@pytest.mark.parametrize("step", [1e-3, 1e-4])
@pytest.mark.parametrize("restitution", [0.9, 0.5])
def test_bounces_reach_e_to_the_2k_of_the_height(restitution, step):
    """The touch is found inside the step, so that heights are right to O(g h / v). Read from the energy of a flight."""
    y, v = bounce(restitution, step, 0.4).T
    top = y + v**2 / (2.0 * GRAVITY)
    apex = [i for i in range(1, len(y) - 1) if y[i] >= y[i - 1] and y[i] > y[i + 1]]
    wanted = 0.01 * restitution ** (2 * np.arange(1, 7))
    slow = 2.0 * GRAVITY * step / np.sqrt(2.0 * GRAVITY * wanted)  # two steps' fall, of the speed of impact
    compared = 0
    for i, height, error in zip(apex, wanted, slow, strict=False):
        if error < 0.2:
            assert top[i] == pytest.approx(height, rel=error / 4.0)
            compared += 1
    assert compared >= (3 if step < 1e-3 or restitution > 0.8 else 2)
    assert y.min() > -1e-9 * RADIUS


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_two_grains_that_meet_head_on_leave_with_restitution_and_their_momentum(restitution):
    scene = plane_scene(materials={"copper": {"restitution": restitution, "friction": 0.0}})
    scene.walls, scene.gravity = [], (0.0, 0.0, 0.0)
    sim = cesim.Simulation(scene, threads=1)
    sim.add([(0.0, 0.0, 0.0), (2.0e-3, 0.0, 0.0)], [(1.0, 0.0, 0.0), (-0.5, 0.0, 0.0)], "copper", [1.2e-3, 2e-3])
    a, b = sim.mass
    common = (a * 1.0 - b * 0.5) / (a + b)
    sim.step(3)
    assert sim.velocity[0, 0] == pytest.approx(common - restitution * 1.5 * b / (a + b), rel=1e-12, abs=1e-15)
    assert sim.velocity[1, 0] == pytest.approx(common + restitution * 1.5 * a / (a + b), rel=1e-12, abs=1e-15)


# ---- a block on the turning drum (docs/physics.md 2.3) ---------------------------------------------------------------


def block_on_drum(rpm, friction, step, angle):
    drum = cesim.Drum(friction=friction, rolling_friction=BLOCK, speed=rpm * math.pi / 30.0, length=1.0)
    scene = cesim.Scene(drum=drum, bounds=OPEN, numerics={"step": step}, effects={"drag": "off"})
    sim = cesim.Simulation(scene, threads=1)
    set_on_drum(sim, "copper", 1e-3, angle)
    return sim


def slip_onset(rpm, friction, radius=0.1605):
    froude = (rpm * math.pi / 30.0) ** 2 * radius / GRAVITY
    return brentq(lambda t: math.sin(t) - friction * (math.cos(t) - froude), 0.0, 0.5 * math.pi), froude


@pytest.mark.parametrize(("rpm", "friction"), [(20.0, 0.3), (30.0, 0.5), (44.8, 0.5), (44.8, 0.2), (60.0, 0.8)])
def test_a_block_on_the_turning_drum_slips_where_sin_is_mu_of_cos_minus_froude(rpm, friction):
    """Onset read from the contact force, averaged over a quarter of a degree: tangential = mu normal.

    Averaged, because the normal force on a grain that rides round a drum alternates from step to step (between 0.35 and
    0.95 m g at 44.8 rpm, at any step size; its mean is right). Single steps touch the cone earlier.
    """
    onset, froude = slip_onset(rpm, friction)
    step, speed = 1e-5, rpm * math.pi / 30.0
    sim = block_on_drum(rpm, friction, step, onset - math.radians(2.0))
    sim.step(100)
    weight = float(sim.mass[0]) * GRAVITY * step
    width = max(1, round(math.radians(0.25) / (speed * step)))
    slips = None
    while slips is None:
        normal = tangential = middle = 0.0
        for _ in range(width):
            before = math.atan2(*sim.position[0, :2])
            sim.step()
            (push,) = sim.contacts["impulse"]
            (n,) = sim.contacts["normal"]
            normal += push @ n / (width * weight)
            tangential += float(np.linalg.norm(push - (push @ n) * n)) / (width * weight)
            middle += before / width
        assert middle < onset + math.radians(1.0), "it never slips"
        assert normal == pytest.approx(math.cos(middle) - froude, abs=0.01)
        if middle < onset - math.radians(0.4):
            assert tangential == pytest.approx(math.sin(middle), abs=0.003)
        elif tangential > friction * normal * (1.0 - 1e-4):
            slips = middle
    assert slips == pytest.approx(onset, abs=math.radians(0.4))


@pytest.mark.parametrize(("rpm", "friction"), [(20.0, 0.3), (44.8, 0.5), (60.0, 0.8)])
def test_a_block_that_slips_on_the_drum_follows_its_equation_of_motion(rpm, friction):
    """R' a'' = g sin - mu (g cos - R' a'^2) from the onset on, integrated by scipy; compared 6 degrees later."""
    onset, _ = slip_onset(rpm, friction)
    speed, radius = rpm * math.pi / 30.0, 0.1605

    def motion(_, y):
        pull = GRAVITY * math.sin(y[0]) - friction * (GRAVITY * math.cos(y[0]) - radius * y[1] ** 2)
        return y[1], pull / radius

    carried = math.radians(3.0) / speed
    after = math.radians(6.0) / speed
    exact = solve_ivp(motion, (0.0, after), (onset, speed), rtol=1e-11, atol=1e-13).y[0, -1]
    slipped = radius * (exact - onset - speed * after)
    assert slipped > 2e-5
    errors = []
    for step in (1e-4, 1e-5):
        sim = block_on_drum(rpm, friction, step, onset - math.radians(3.0))
        sim.step(round((carried + after) / step))
        there = math.atan2(*sim.position[0, :2]) - speed * (sim.time - carried - after)
        errors.append(abs(radius * (there - exact)) / slipped)
    assert errors[0] < 0.5
    assert errors[1] < 0.05


def test_a_block_rests_on_the_drum_like_part_of_it():
    """Slow drum, far inside the cone: over a second it neither creeps nor sinks nor turns against the drum.

    It rides at the height of what its path along the tangent opens in a step, (v h)^2/2R.
    """
    speed = 5.0 * math.pi / 30.0
    sim = block_on_drum(5.0, 0.5, 1e-3, -0.26)
    sim.step(1000)
    x, y = sim.position[0, :2]
    assert 0.0 <= math.hypot(x, y) - 0.1605 < 1.01 * (speed * 0.1605 * 1e-3) ** 2 / (2.0 * 0.1605)
    assert math.atan2(x, y) == pytest.approx(-0.26 + speed, abs=1e-6)
    assert spin(sim) == pytest.approx(-speed, rel=1e-6)


def test_the_drum_keeps_its_speed_whatever_it_drags():
    """It is prescribed: a block dropped on it at rest is brought by the friction mu g to exactly its motion."""
    sim = block_on_drum(10.0, 0.5, 1e-4, 0.0)
    sim.velocity[:] = 0.0
    sim.angular_velocity[:] = 0.0
    speed = 10.0 * math.pi / 30.0
    grips = speed * 0.1605 / (0.5 * GRAVITY)
    sim.step(round(0.8 * grips / 1e-4))
    assert np.linalg.norm(sim.velocity[0]) == pytest.approx(0.5 * GRAVITY * sim.time, rel=5e-3)
    sim.step(round(1.2 * grips / 1e-4))
    assert np.linalg.norm(sim.velocity[0]) == pytest.approx(speed * 0.1605, rel=1e-4)
    assert spin(sim) == pytest.approx(-speed, rel=1e-4)


# ---- a column at rest (04) -------------------------------------------------------------------------------------------


def test_warm_starting_spares_a_column_most_of_its_sweeps():
    """The impulses of the step before are the answer from the second step on: cold, it takes thousands of sweeps."""
    n, d = 50, 2.0 * RADIUS
    scene = plane_scene(friction=0.3)
    scene.numerics.max_iterations = 20_000
    sim = cesim.Simulation(scene, threads=1)
    sim.add(np.column_stack([np.zeros(n), RADIUS + d * np.arange(n), np.zeros(n)]), material="copper", diameter=d)
    sim.step()
    cold = sim.health.iterations
    sim.step(200)
    assert cold > 500
    assert sim.health.iterations < cold / 20
