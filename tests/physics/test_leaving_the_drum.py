"""Where a grain leaves the drum: docs/physics.md 2.3, closed forms and equations of motion, to 0.1 degree at 0.1 ms.

theta is the angle from the top of the drum, clockwise. A grain leaves after the last step in which the drum pressed it.
"""

import math

import numpy as np
import pytest
from scenes import (
    EPS0,
    GRAVITY,
    R1,
    SPEED,
    VOLTAGE,
    angle_of,
    bare_drum,
    contact_charge,
    drum_field,
    field,
    leave_drum,
    pauthenier_charge,
    set_on_drum,
    simulation,
    sphere_mass,
)
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import cesim

FINE = 1e-4  # s
TENTH = math.radians(0.1)
K_F = 1.2020569031595942 + 1.0 / 6.0
NO_SLIP = 1000.0  # the largest friction a scene allows
DENSITY = {"copper": 8960.0, "aluminium": 2700.0, "ABS": 1050.0}
ABS_PERMITTIVITY = 2.87


def froude(diameter, speed=SPEED):
    return speed**2 * (R1 + 0.5 * diameter) / GRAVITY


def leaving_angle(diameter=1e-3, material="ABS", charge=0.0, step=FINE, angle=0.0, **scene):
    sim = simulation(bare_drum(step=step, landing=None, **scene))
    set_on_drum(sim, material, diameter, angle=angle, charge=charge)
    return leave_drum(sim)


# ---- without a field: closed forms -----------------------------------------------------------------------------------


@pytest.mark.parametrize("diameter", [0.5e-3, 4e-3])
@pytest.mark.parametrize("speed", [SPEED, 0.6 * SPEED, 1.5 * SPEED])
def test_without_friction_a_grain_leaves_at_two_thirds_and_a_third_of_its_froude_number(diameter, speed):
    """cos theta = (2 + Fr)/3, started at the drum's speed (docs/physics.md 2.3)."""
    exact = math.acos((2.0 + froude(diameter, speed)) / 3.0)
    assert leaving_angle(diameter, speed=speed, friction=0.0) == pytest.approx(exact, abs=TENTH)


@pytest.mark.parametrize("diameter", [0.5e-3, 4e-3])
@pytest.mark.parametrize("speed", [SPEED, 0.6 * SPEED, 1.5 * SPEED])
def test_a_grain_that_rolls_freely_leaves_where_ten_and_seven_seventeenths_say(diameter, speed):
    """cos theta = (10 + 7 Fr)/17, started at the drum's speed (docs/physics.md 2.3)."""
    exact = math.acos((10.0 + 7.0 * froude(diameter, speed)) / 17.0)
    assert leaving_angle(diameter, speed=speed, friction=NO_SLIP) == pytest.approx(exact, abs=TENTH)


def slips_off(mu, fr):
    """Angles at which a carried grain that cannot roll starts to slip, and leaves: docs/physics.md 2.3."""
    onset = brentq(lambda t: math.sin(t) - mu * (math.cos(t) - fr), 0.0, math.acos(fr))

    def particular(t):
        return ((4.0 * mu**2 - 2.0) * math.cos(t) - 6.0 * mu * math.sin(t)) / (1.0 + 4.0 * mu**2)

    def excess(t):
        return (fr - particular(onset)) * math.exp(2.0 * mu * (t - onset)) + particular(t) - math.cos(t)

    beyond = np.linspace(onset, math.acos(fr), 2000)
    first = next(i for i in range(1, 2000) if excess(beyond[i]) >= 0.0)
    return onset, brentq(excess, beyond[first - 1], beyond[first])


@pytest.mark.parametrize("mu", [0.3, 1.0, NO_SLIP])
@pytest.mark.parametrize("speed", [SPEED, 1.4 * SPEED])
def test_a_carried_grain_slips_and_leaves_where_the_slip_law_says(mu, speed):
    """sin theta = mu (cos theta - Fr) at the onset, then w(theta) = u^2/(g R') up to cos theta: docs/physics.md 2.3."""
    exact = slips_off(mu, froude(1e-3, speed))[1]
    measured = leaving_angle(friction=mu, rolling_friction=NO_SLIP, speed=speed)
    assert measured == pytest.approx(exact, abs=TENTH)


@pytest.mark.parametrize("speed", [SPEED, 1.4 * SPEED])
def test_a_grain_that_neither_slips_nor_rolls_leaves_at_its_froude_number(speed):
    """cos theta = Fr (docs/physics.md 2.3). Every finite friction slips first, 10 by 2.5 degrees: so 1000 here."""
    measured = leaving_angle(friction=NO_SLIP, rolling_friction=NO_SLIP, speed=speed)
    assert measured == pytest.approx(math.acos(froude(1e-3, speed)), abs=TENTH)


def test_the_three_ways_to_leave_are_far_apart():
    """docs/physics.md 0.1: carried, rolling and frictionless grains land up to 100 mm apart; here on y = -0.10 m."""
    x = []
    for friction, rolling in ((0.0, 0.0), (NO_SLIP, 0.0), (NO_SLIP, NO_SLIP)):
        sim = simulation(bare_drum(step=1e-3, friction=friction, rolling_friction=rolling))
        set_on_drum(sim, "ABS", 1e-3)
        sim.run(1.0)
        x.append(sim.landings[0]["position"][0])
    slides, rolls, carried = x
    assert slides > rolls > carried
    assert 0.04 < slides - carried < 0.12


def test_the_leaving_angle_converges_with_the_step():
    """At 1 ms a step is 0.27 degrees; the angle is right to that, and to a tenth of it at a tenth of the step."""
    exact = math.acos((2.0 + froude(1e-3)) / 3.0)
    for step in (1e-3, 1e-4, 1e-5):
        assert leaving_angle(friction=0.0, step=step) == pytest.approx(exact, abs=1.5 * SPEED * step)


@pytest.mark.parametrize(("friction", "rolling"), [(0.0, 0.0), (0.3, NO_SLIP), (NO_SLIP, 0.0)])
def test_a_grain_that_leaves_lands_where_it_should_to_second_order(friction, rolling):
    """Flight starts with the velocity of a step's end (docs/decisions/014); of its middle: 0.3 mm off at 1 ms."""
    steps = np.array([4e-3, 2e-3, 1e-3, 2e-5])
    *x, exact = (landing(step, friction, rolling) for step in steps)
    error = np.abs(np.array(x) - exact)
    assert error[2] < 0.04e-3
    assert (error <= 0.04e-3 * (steps[:3] / 1e-3) ** 2).all()


def landing(step, friction, rolling):
    sim = simulation(bare_drum(step=step, friction=friction, rolling_friction=rolling))
    set_on_drum(sim, "ABS", 1e-3)
    sim.run(1.0)
    return sim.landings[0]["position"][0]


@pytest.mark.parametrize(("material", "diameter"), [("copper", 1.2e-3), ("ABS", 1.2e-3), ("ABS", 0.5e-3)])
def test_a_charged_grain_that_leaves_lands_where_it_should_at_1_ms(material, diameter):
    """The reference drum and field: 0.33, 0.89 and 1.2 mm at 1 ms if flight started along the last chord."""
    coarse, exact = (charged_landing(material, diameter, step) for step in (1e-3, 1e-4))
    assert abs(coarse - exact) < {1.2e-3: 0.25e-3, 0.5e-3: 0.75e-3}[diameter]


def charged_landing(material, diameter, step):
    scene = cesim.scenes.single_particle()
    scene.numerics.step = step
    sim = cesim.Simulation(scene)
    set_on_drum(sim, material, diameter)
    while not len(sim.landings):
        sim.step()
    return sim.landings["position"][0, 0]


# ---- the sphere's equations ------------------------------------------------------------------------------------------


def ride(diameter, mu, rolls=True, push=lambda t: 0.0, mass=1.0, pull_along=lambda t: 0.0, speed=SPEED, angle=0.0):
    """Leaving angle of a sphere on the drum, by DOP853 from one event (slip, stick, lift-off) to the next.

    State (theta, u, w): u the centre's speed, w the spin, both clockwise. push: outward force, pull_along: clockwise
    force, in N, at theta. A sphere that does not roll keeps the drum's spin.
    """
    reach, radius = R1 + 0.5 * diameter, 0.5 * diameter

    def normal(s):
        return GRAVITY * math.cos(s[0]) - s[1] ** 2 / reach - push(s[0]) / mass

    def downhill(s):
        return GRAVITY * math.sin(s[0]) + pull_along(s[0]) / mass

    def slip(s):
        return s[1] - s[2] * radius - speed * R1

    def holding(s):  # friction per mass that keeps the contact from slipping
        return -downhill(s) * (2.0 / 7.0 if rolls else 1.0)

    def slopes(_, s, side):
        friction = holding(s) if side == 0 else -side * mu * max(normal(s), 0.0)
        return [s[1] / reach, downhill(s) + friction, -2.5 * friction / radius if rolls else 0.0]

    def leaves(_, s, side):
        return normal(s)

    def changes(_, s, side):
        return mu * normal(s) - abs(holding(s)) if side == 0 else slip(s)

    leaves.terminal, leaves.direction = True, -1
    changes.terminal = True
    state, time = np.array([angle, speed * reach, speed]), 0.0
    side = 0 if abs(holding(state)) <= mu * normal(state) else -math.copysign(1.0, holding(state))
    for _ in range(20):
        changes.direction = -1 if side >= 0 else 1
        path = solve_ivp(
            slopes, (time, time + 5.0), state, method="DOP853", rtol=1e-11, atol=1e-13, events=(leaves, changes),
            args=(side,), max_step=2e-3,
        )  # fmt: skip
        if len(path.t_events[0]):
            return path.y_events[0][0][0]
        assert len(path.t_events[1]), "it never leaves"
        time, state = path.t_events[1][0], path.y_events[1][0]
        if side == 0:
            side = 1 if holding(state) < 0.0 else -1
            state = state + np.array([0.0, side * 1e-12, 0.0])
        else:
            side = 0 if abs(holding(state)) <= mu * normal(state) else -side
    raise AssertionError("it neither sticks nor leaves")


def test_the_equations_give_the_closed_forms():
    """So that what the engine is held against below is itself held against something."""
    fr = froude(1e-3)
    assert ride(1e-3, 0.0) == pytest.approx(math.acos((2.0 + fr) / 3.0), abs=1e-8)
    assert ride(1e-3, 1e5) == pytest.approx(math.acos((10.0 + 7.0 * fr) / 17.0), abs=2e-5)
    for mu in (0.3, 1.0, 10.0):
        assert ride(1e-3, mu, rolls=False) == pytest.approx(slips_off(mu, fr)[1], abs=1e-7)


@pytest.mark.parametrize("mu", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("diameter", [0.5e-3, 4e-3])
def test_a_sphere_with_friction_leaves_where_its_equations_of_motion_say(mu, diameter):
    """Rolling, then slipping, then off (mu = 0.5 against its ODE)."""
    assert leaving_angle(diameter, friction=mu) == pytest.approx(ride(diameter, mu), abs=TENTH)


# ---- metals ----------------------------------------------------------------------------------------------------------


def metal_lift(diameter, voltage):
    """Outward and clockwise force in N on a conducting sphere that touches the drum, at theta.

    k_F 4 pi eps0 r^2 E^2 normally (the field is that of the centre), Q E along.
    """

    def outward(t):
        return K_F * 4.0 * math.pi * EPS0 * (0.5 * diameter) ** 2 * at_centre(t, diameter, voltage)[0] ** 2

    def clockwise(t):
        return contact_charge(diameter, drum_field(t, voltage)) * at_centre(t, diameter, voltage)[1]

    return outward, clockwise


def at_centre(t, diameter, voltage):
    """Outward and clockwise field at the centre of a grain on the drum, V/m."""
    outward, clockwise = np.array([math.sin(t), math.cos(t)]), np.array([math.cos(t), -math.sin(t)])
    E = field((R1 + 0.5 * diameter) * outward, voltage)[0]
    return E @ outward, E @ clockwise


@pytest.mark.parametrize("voltage", [-VOLTAGE, VOLTAGE])
@pytest.mark.parametrize(("material", "diameter"), [("copper", 1e-3), ("aluminium", 0.5e-3), ("aluminium", 2e-3)])
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_a_metal_leaves_where_its_equations_with_the_lift_say(material, diameter, mu, voltage):
    """docs/physics.md 2.1: lift k_F 4 pi eps0 r^2 E^2 in N = m g cos theta - m u^2/R' - F."""
    push, along = metal_lift(diameter, voltage)
    mass = sphere_mass(DENSITY[material], diameter)
    exact = ride(diameter, mu, push=push, pull_along=along, mass=mass)
    measured = leaving_angle(diameter, material, voltage=voltage, friction=mu)
    assert measured == pytest.approx(exact, abs=TENTH)


def test_a_metal_leaves_earlier_the_higher_the_voltage():
    """At either polarity; 35 kV takes 1.4 degrees off a 1 mm copper sphere and 10 off 0.3 mm aluminium."""
    for material, diameter, least in (("copper", 1e-3, 1.0), ("aluminium", 0.3e-3, 8.0)):
        angles = [
            math.degrees(leaving_angle(diameter, material, voltage=voltage)) for voltage in (0.0, -25e3, -35e3, -45e3)
        ]
        assert np.all(np.diff(angles) < -0.25 * least)
        assert angles[0] - angles[2] > least
        assert math.degrees(leaving_angle(diameter, material, voltage=35e3)) == pytest.approx(angles[2], abs=1e-9)


@pytest.mark.parametrize("voltage", [-VOLTAGE, VOLTAGE])
def test_a_metal_takes_the_charge_of_its_last_contact_with_it(voltage):
    """Q = (2/3) pi^3 eps0 r^2 E_n at lift-off, positive when the electrode is negative (docs/physics.md 1.1, 2.1)."""
    sim = simulation(bare_drum(voltage, step=FINE))
    set_on_drum(sim, "copper", 1e-3)
    angle = leave_drum(sim)
    charge = contact_charge(1e-3, drum_field(angle, voltage))
    assert math.copysign(1.0, sim.charge[0]) == -math.copysign(1.0, voltage)
    assert sim.charge[0] == pytest.approx(charge, rel=1e-3, abs=0.0)  # a step is 3e-4 of it
    assert abs(sim.charge[0]) == pytest.approx(10e-12, rel=0.2, abs=0.0)  # 1 mm at 220 kV/m: about ten picocoulombs
    flying = sim.charge[0]
    sim.run(1.0)
    assert sim.landings[0]["charge"] == flying


# ---- charged plastic -------------------------------------------------------------------------------------------------


def pinning(diameter, charge, voltage):
    """Inward force in N on a charged insulator on the drum, at theta: F_i + |Q| E, with E that of the centre."""
    image = charge**2 / (16.0 * math.pi * EPS0 * (0.5 * diameter) ** 2)
    return lambda t: image - charge * at_centre(t, diameter, voltage)[0]


def pinned_rule(diameter, charge, voltage, speed=SPEED):
    """cos theta = Fr - (F_i + |Q| E)/(m g), the first such angle past the top (docs/physics.md 2.3)."""
    press, weight = pinning(diameter, charge, voltage), sphere_mass(DENSITY["ABS"], diameter) * GRAVITY
    angles = np.linspace(0.0, 1.5 * math.pi, 3000)

    def excess(t):
        return math.cos(t) + press(t) / weight - froude(diameter, speed)

    first = next(i for i, t in enumerate(angles) if excess(t) < 0.0)
    return brentq(excess, angles[first - 1], angles[first])


PINNED = [(0.9e-3, 1.0), (1.2e-3, 1.0), (2e-3, 1.0), (0.5e-3, 0.5)]  # diameter [m], share of saturation


@pytest.mark.parametrize("voltage", [-VOLTAGE, VOLTAGE])
@pytest.mark.parametrize(("diameter", "share"), PINNED)
def test_a_pinned_grain_leaves_where_its_equations_with_the_pressing_force_say(diameter, share, voltage):
    """Charged before, carried as friction and rolling friction of 1000 allow; E varies fourfold on the way."""
    charge = share * math.copysign(
        pauthenier_charge(diameter, ABS_PERMITTIVITY, drum_field(math.pi / 3.0, VOLTAGE)), voltage
    )
    press = pinning(diameter, charge, voltage)
    exact = ride(
        diameter, NO_SLIP, rolls=False, push=lambda t: -press(t), mass=sphere_mass(DENSITY["ABS"], diameter),
        pull_along=lambda t: charge * at_centre(t, diameter, voltage)[1],
    )  # fmt: skip
    measured = leaving_angle(diameter, charge=charge, voltage=voltage, friction=NO_SLIP, rolling_friction=NO_SLIP)
    assert measured == pytest.approx(exact, abs=TENTH)


@pytest.mark.parametrize(("diameter", "share"), PINNED)
def test_a_pinned_grain_leaves_by_the_pinned_rule(diameter, share):
    """cos theta = Fr - (F_i + |Q| E)/(m g) for a grain that cannot slip (docs/physics.md 2.3)."""
    charge = -share * pauthenier_charge(diameter, ABS_PERMITTIVITY, abs(drum_field(math.pi / 3.0, VOLTAGE)))
    measured = leaving_angle(diameter, charge=charge, voltage=-VOLTAGE, friction=NO_SLIP, rolling_friction=NO_SLIP)
    assert measured == pytest.approx(pinned_rule(diameter, charge, -VOLTAGE), abs=TENTH)


def test_a_grain_that_is_pressed_harder_than_its_weight_and_inertia_stays_on_the_drum():
    """Stays to the brush if (F_i + |Q| E)/(m g) > 1 + Fr everywhere (docs/physics.md 2.3): 0.1 mm ABS, two turns."""
    diameter = 0.1e-3
    charge = -pauthenier_charge(diameter, ABS_PERMITTIVITY, abs(drum_field(math.pi / 3.0, VOLTAGE)))
    press, weight = pinning(diameter, charge, -VOLTAGE), sphere_mass(DENSITY["ABS"], diameter) * GRAVITY
    assert min(press(t) for t in np.linspace(0.0, 2.0 * math.pi, 200)) / weight > 1.0 + froude(diameter)
    sim = simulation(bare_drum(-VOLTAGE, step=FINE, friction=0.5, rolling_friction=0.5, landing=None))
    set_on_drum(sim, "ABS", diameter, charge=charge)
    sim.run(4.0 * math.pi / SPEED)
    assert np.hypot(*sim.position[0, :2]) == pytest.approx(R1 + 0.5 * diameter, abs=1e-3 * diameter)
    lag = (SPEED * sim.time - angle_of(sim.position) + math.pi) % (2.0 * math.pi) - math.pi
    assert abs(lag) * R1 < 5e-3 * diameter  # and in its place on the drum


@pytest.mark.parametrize("voltage", [-VOLTAGE, VOLTAGE])
def test_plastic_leaves_the_corona_with_the_charge_of_pauthenier(voltage):
    """Q = 12 pi eps0 r^2 E k of the strongest field on its way through the arc, with the sign of the electrode."""
    diameter, arc = 1e-3, (math.radians(10.0), math.radians(40.0))
    sim = simulation(bare_drum(voltage, step=FINE, corona={"arc": arc}, friction=NO_SLIP, rolling_friction=NO_SLIP))
    set_on_drum(sim, "ABS", diameter)
    angle = leave_drum(sim)
    assert angle > arc[1]
    saturated = pauthenier_charge(diameter, ABS_PERMITTIVITY, abs(drum_field(arc[1], voltage)))
    assert sim.charge[0] == pytest.approx(math.copysign(saturated, voltage), rel=1e-3, abs=0.0)
