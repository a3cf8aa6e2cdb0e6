"""Drag of still air: exact for Stokes, stable and monotone for Schiller-Naumann at any step.

Source: docs/physics.md 3; the case is that of docs/numerics.md 3.
"""

import math

import numpy as np
import pytest
from scenes import GRAVITY, schiller_naumann, simulation, sphere_mass, still_air
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

VISCOSITY = 1.81e-5
DENSITY = {"ABS": 1050.0, "copper": 8960.0}


def fall(scene, material, diameter, steps, velocity=0.0):
    """Downward speed after each step, (steps + 1,) m/s."""
    sim = simulation(scene)
    sim.add((0.0, 0.0, 0.0), velocity=(0.0, -velocity, 0.0), material=material, diameter=diameter)
    speeds = [velocity]
    for _ in range(steps):
        sim.position[:] = 0.0  # so that it never leaves the bounds
        sim.step()
        speeds.append(-sim.velocity[0, 1])
    return np.array(speeds)


def terminal(material, diameter):
    weight = sphere_mass(DENSITY[material], diameter) * GRAVITY
    return brentq(lambda v: schiller_naumann(v, diameter) - weight, 1e-9, 50.0, xtol=1e-15, rtol=1e-14)


def relaxation(material, diameter):
    return sphere_mass(DENSITY[material], diameter) / (3.0 * math.pi * VISCOSITY * diameter)


@pytest.mark.parametrize("diameter", [10e-6, 30e-6, 100e-6, 300e-6, 1e-3, 2e-3])
@pytest.mark.parametrize("material", DENSITY)
def test_a_falling_grain_ends_at_the_speed_where_drag_balances_weight(material, diameter):
    """Force balance with C_D = 24/Re (1 + 0.15 Re^0.687), 0.44 from Re = 1000 (Schiller & Naumann 1933)."""
    end = terminal(material, diameter)
    step = 0.05 * end / GRAVITY
    speeds = fall(still_air(step), material, diameter, 1200)
    assert speeds[-1] == pytest.approx(end, rel=1e-9)


@pytest.mark.parametrize("ratio", [1e-4, 0.01, 0.1, 1.0, 10.0, 1e3])
def test_stokes_drag_is_exact_at_any_step(ratio):
    """v(t) = v_t (1 - exp(-t/tau)), to 1e-12, for h/tau over seven decades (case 28)."""
    diameter = 10e-6
    tau = relaxation("ABS", diameter)
    step = ratio * tau
    speeds = fall(still_air(step, law="stokes"), "ABS", diameter, 40)
    exact = -GRAVITY * tau * np.expm1(-ratio * np.arange(41))
    assert speeds == pytest.approx(exact, rel=1e-12, abs=1e-15 * GRAVITY * tau)


def test_the_path_under_stokes_drag_is_exact_at_any_step():
    """y(t) = v_t (t - tau (1 - exp(-t/tau))): an engine exact in velocity alone drifts in position."""
    diameter = 50e-6
    tau = relaxation("ABS", diameter)
    for ratio in (1e-4, 0.1, 1.0, 100.0):
        sim = simulation(still_air(ratio * tau, law="stokes"))
        sim.add((0.0, 0.0, 0.0), material="ABS", diameter=diameter)
        sim.step(20)
        t = 20 * ratio * tau
        exact = GRAVITY * tau * (t + tau * math.expm1(-t / tau))
        assert -sim.position[0, 1] == pytest.approx(exact, rel=1e-8 if ratio < 1e-3 else 1e-12, abs=0.0)


@pytest.mark.parametrize("diameter", [1e-6, 10e-6, 50e-6, 200e-6, 1e-3])
@pytest.mark.parametrize("ratio", [0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0, 1e3])
def test_a_grain_from_rest_never_falls_faster_than_it_can_nor_slows_down(diameter, ratio):
    """Case 28: monotone, no overshoot, at h/tau from 0.01 to 1000 (explicit Euler fails at 2)."""
    end = terminal("ABS", diameter)
    step = min(ratio * relaxation("ABS", diameter), 1.0)
    speeds = fall(still_air(step), "ABS", diameter, 300)
    assert np.all(np.diff(speeds) >= -1e-12 * end)
    assert np.max(speeds) <= end * (1.0 + 1e-9)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0, 1e3])
def test_a_grain_shot_faster_than_it_can_fall_slows_down_and_stays_above(ratio):
    """From ten times its terminal speed, of a 10 um grain (case 28)."""
    end = terminal("ABS", 10e-6)
    step = ratio * relaxation("ABS", 10e-6)
    speeds = fall(still_air(step), "ABS", 10e-6, 300, velocity=10.0 * end)
    assert np.all(np.diff(speeds) <= 1e-12 * end)
    assert np.min(speeds) >= end * (1.0 - 1e-9)


@pytest.mark.parametrize("material", DENSITY)
def test_the_error_of_a_fall_through_air_shrinks_with_the_square_of_the_step(material):
    """0.5 mm grains over 0.2 s against DOP853, with Schiller-Naumann coded here; case 28: 1e-3 at 1 ms."""
    diameter = 0.5e-3
    mass = sphere_mass(DENSITY[material], diameter)

    def slopes(_, state):
        velocity = state[2:]
        speed = float(np.hypot(*velocity))
        drag = schiller_naumann(speed, diameter) / (mass * speed) if speed > 0.0 else 0.0
        return np.concatenate([velocity, np.array([0.0, -GRAVITY]) - drag * velocity])

    exact = solve_ivp(slopes, (0.0, 0.2), [0.0, 0.0, 1.5, 0.5], method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    steps, errors = np.array([8e-3, 4e-3, 2e-3, 1e-3]), []
    for step in steps:
        sim = simulation(still_air(step))
        sim.add((0.0, 0.0, 0.0), velocity=(1.5, 0.5, 0.0), material=material, diameter=diameter)
        sim.step(round(0.2 / step))
        errors.append(np.hypot(*(sim.position[0, :2] - exact[:2])))
        if step == 1e-3:
            assert sim.velocity[0, :2] == pytest.approx(exact[2:], rel=1e-3)
    assert errors[-1] < 2e-6
    assert 1.8 < np.polyfit(np.log(steps), np.log(errors), 1)[0] < 2.2
