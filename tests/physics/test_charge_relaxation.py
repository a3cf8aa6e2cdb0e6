"""Charges that relax on the drum while ions arrive: the exact step against an integrator and against its limits.

Sources: Maxwell's relaxation dQ/dt = -(Q - rest)/tau; Pauthenier's kinetics dQ/dt = (Qs - Q)^2/(Qs tau_ion) while Q
has not reached Qs (docs/physics.md 2.2).
"""

import itertools
import math

import numpy as np
import pytest

from cesim import engine

SATURATION = -2e-12


def integrated(charge, step, saturation, ion_time, rest, decay_time):
    """The same by an integrator of high order, in units of the saturation."""
    from scipy.integrate import solve_ivp

    def slope(_, x):
        ions = max(1.0 - x[0], 0.0) ** 2 / ion_time
        return [ions - (x[0] - rest / saturation) / decay_time]

    span = solve_ivp(slope, (0.0, step), [charge / saturation], "Radau", rtol=1e-10, atol=1e-12)
    return float(span.y[0, -1]) * saturation


@pytest.mark.parametrize("ratio", [1e-9, 1e-3, 0.1, 1.0, 5.0, 700.0, 1e6])
def test_conduction_alone_is_the_exact_exponential_at_any_step(ratio):
    """To 1e-12 for times from a millionth of a step to a thousand million steps."""
    tau, rest, charge = 1e-3 / ratio, 3e-12, -1.7e-12
    exact = rest + (charge - rest) * math.exp(-ratio)
    for parts in (1, 7, 100):
        now = charge
        for _ in range(parts):
            now = engine.charge_after(now, 1e-3 / parts, 0.0, 0.0, rest, tau)
        assert now == pytest.approx(exact, rel=1e-12, abs=0.0)


@pytest.mark.parametrize(
    ("start", "rest"), [*itertools.product((-1.2, 0.0, 0.4, 1.0, 1.7), (-1.3, 0.0, 0.6, 1.0, 1.05, 1.8, 30.0))]
)
def test_ions_and_conduction_together_follow_their_equation(start, rest):
    """From below and beyond the saturation, towards a rest on either side of it; and two half steps are one step."""
    for ion_time, decay_time in ((1e-3, 3e-3), (2e-2, 1e-3), (4e-4, 0.5), (1e-3, 1e-3)):
        flow = (SATURATION, ion_time, rest * SATURATION, decay_time)
        once = engine.charge_after(start * SATURATION, 1e-3, *flow)
        half = engine.charge_after(start * SATURATION, 0.5e-3, *flow)
        scale = abs(SATURATION) * max(1.0, abs(rest), abs(start))
        assert abs(engine.charge_after(half, 0.5e-3, *flow) - once) <= 1e-13 * scale
        assert abs(once - integrated(start * SATURATION, 1e-3, *flow)) <= 2e-8 * scale


def test_the_limits_of_the_law_are_the_conductor_the_insulator_and_instant_charging():
    """T8 of docs/physics.md 6 for charging and for discharging: the gap falls as the time that is left out."""
    rest, step, start = 3e-12, 1e-3, 0.3e-12
    kinetics = engine.charge_after(start, step, SATURATION, 5e-3)
    at_once = engine.charge_after(start, step, SATURATION, 0.0)
    assert at_once == SATURATION
    for small in (1e-6, 1e-9, 1e-12):
        metal = engine.charge_after(start, step, SATURATION, 5e-3, rest, small)
        insulator = engine.charge_after(start, step, SATURATION, 5e-3, rest, 1.0 / small)
        instant = engine.charge_after(start, step, SATURATION, 5e-3 * small, 0.0, math.inf)
        assert metal == pytest.approx(rest, rel=2e3 * small, abs=0.0)
        assert insulator == pytest.approx(kinetics, rel=2e1 * small, abs=0.0)
        assert instant == pytest.approx(SATURATION, rel=6.0 * small, abs=0.0)
    assert engine.charge_after(start, step, SATURATION, 5e-3, rest, 0.0) == rest
    assert engine.charge_after(start, step) == start


def test_the_charge_of_balance_is_where_ions_and_conduction_are_equal():
    """(1 - x)^2/tau_ion = (x - c)/tau after a long time, from both sides."""
    ion_time, decay_time, c = 2e-3, 7e-3, -0.4
    a = decay_time / ion_time
    balance = (2.0 * a + 1.0 - math.sqrt((2.0 * a + 1.0) ** 2 - 4.0 * a * (a + c))) / (2.0 * a)
    for start in (c, 0.0, 1.0, 3.0):
        x = engine.charge_after(start * SATURATION, 10.0, SATURATION, ion_time, c * SATURATION, decay_time) / SATURATION
        assert x == pytest.approx(balance, rel=1e-13)


def test_a_charge_never_passes_what_it_tends_to():
    """Random flows and steps over many orders of magnitude: between start and its end, and finite."""
    random = np.random.default_rng(5)
    for _ in range(2000):
        ion_time, decay_time, step = 10.0 ** random.uniform(-12, 3, 3)
        start, rest = random.uniform(-2.0, 2.0, 2)
        x = engine.charge_after(start * SATURATION, step, SATURATION, ion_time, rest * SATURATION, decay_time)
        x /= SATURATION
        assert min(start, rest) - 1e-12 <= x <= max(start, rest, 1.0) + 1e-12
