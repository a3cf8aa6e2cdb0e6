"""The force on a conducting sphere at a grounded plane: F = a Q E - b Q^2/(4 pi eps0 r^2) + c 4 pi eps0 r^2 E^2.

Held against the derivative of the energy in bispherical coordinates, which shares no force formula with the engine.
Source: docs/physics.md 2.1; Davis, Q. J. Mech. Appl. Math. 17 (1964) 499; Lebedev & Skal'skaya (1962).
"""

import functools
import math

import mpmath as mp
import numpy as np
import pytest
from scenes import EPS0, GRAVITY, TILT, VOLTAGE, bare_drum, drum_field, set_on_drum, simulation

import cesim

K_Q = math.pi**2 / 6.0
K_F = 1.2020569031595942 + 1.0 / 6.0


@functools.cache
def by_energy(s):
    """(a, b, c) at a centre distance of s radii, as derivatives of the energy at constant charge.

    In units of r, with q = Q/(4 pi eps0): W = q^2/(2 C) - (K/C) q E - alpha E^2/2. With cosh xi = s, k = sinh xi and
    w_n = 1/(exp((2n+1) xi) - 1): C = 2 k S0, K = 2 k^2 S1, alpha = 2 k^3 S2 - K^2/C, S_p = sum (2n+1)^p w_n.
    """
    with mp.workdps(40):

        def terms(s):
            xi = mp.acosh(s)
            k = mp.sinh(xi)
            odd = [2 * n + 1 for n in range(int(mp.mpf(100) / xi) + 5)]
            w = [1 / mp.expm1(m * xi) for m in odd]
            sums = [mp.fsum(m**p * v for m, v in zip(odd, w, strict=True)) for p in range(3)]
            capacity, induced = 2 * k * sums[0], 2 * k**2 * sums[1]
            return induced / capacity, 1 / (2 * capacity), (2 * k**3 * sums[2] - induced**2 / capacity) / 2

        step = mp.mpf("1e-4") * (s - 1)
        # Fourth-order differences; the truncation is 1e-16 of the third power of the scale s - 1 at the most.
        around = {i: terms(mp.mpf(s) + i * step) for i in (-2, -1, 1, 2)}
        slopes = [(8 * (around[1][j] - around[-1][j]) - (around[2][j] - around[-2][j])) / (12 * step) for j in range(3)]
        return float(slopes[0]), float(slopes[1]), float(slopes[2])


def factors(s):
    return cesim.engine.sphere_plane_factors(np.atleast_1d(np.asarray(s, dtype=float)))


def force(s, q, table=None):
    """In units of 4 pi eps0 r^2 E^2, for a charge of q in units of 4 pi eps0 r^2 E."""
    a, b, c = factors(s)[0] if table is None else table
    return a * q - b * q * q + c


@pytest.mark.parametrize(("s", "stated"), [(1.0, 0.8321), (1.1, 0.8589), (2.0, 0.9427), (5.0, 0.9871)])
def test_the_force_on_the_charge_of_contact_over_q_e_is_the_tabulated_one(s, stated):
    """docs/physics.md 2.1; the point image gives 0.589, 0.660, 0.897 and 0.984 instead."""
    assert force(s, K_Q) / K_Q == pytest.approx(stated, abs=6e-5)


def test_at_contact_the_force_is_zeta_of_three_and_a_sixth():
    """Lebedev & Skal'skaya: k_F = zeta(3) + 1/6; F/(QE) = 0.832084."""
    assert force(1.0, K_Q) == pytest.approx(K_F, rel=1e-12)
    assert force(1.0, K_Q) / K_Q == pytest.approx(0.832084, abs=5e-7)
    assert force(1.001, K_Q, by_energy(1.001)) == pytest.approx(K_F, rel=2e-3)


@pytest.mark.parametrize("charge", [0.0, 0.5, K_Q, 3.0, -1.0])
def test_the_force_of_any_charge_is_minus_the_slope_of_the_energy(charge):
    """The table is within 1e-7 of the terms that make the force up, from a gap of r/1000 to 31 radii and beyond it."""
    for s in (1.0011, 1.005, 1.02, 1.1, 1.37, 2.0, 3.3, 5.0, 9.0, 20.0, 31.9, 40.0):
        exact = by_energy(s)
        scale = abs(charge) + exact[1] * charge**2 + abs(exact[2])
        assert force(s, charge) == pytest.approx(force(s, charge, exact), abs=1e-7 * scale)


def test_each_factor_is_that_of_the_energy():
    for s in (1.01, 1.1, 1.5, 2.0, 4.0, 10.0, 30.0):
        assert factors(s)[0] == pytest.approx(by_energy(s), rel=1e-7, abs=0.0)


def test_far_from_the_plane_only_q_e_and_the_point_image_are_left():
    """docs/physics.md 2.1: a -> 1, b -> r^2/(4 s^2), and c fades with the fourth power."""
    for s in (50.0, 200.0, 1e4):
        a, b, c = factors(s)[0]
        assert a == pytest.approx(1.0, abs=0.6 / s**3)
        assert 4.0 * s**2 * b == pytest.approx(1.0, abs=0.6 / s**3)
        assert abs(c) < 0.4 / s**4


def test_the_factors_join_smoothly_where_table_and_asymptotes_meet():
    """At a gap of r/1000, below which slope and b are held, and at 32 radii."""
    for joint in (1.001, 32.0):
        for charge in (0.0, K_Q, 1.0):
            below, above = force(joint * (1.0 - 1e-12), charge), force(joint * (1.0 + 1e-12), charge)
            assert below == pytest.approx(above, rel=1e-6, abs=1e-12)


def test_a_grain_pressed_into_the_plane_has_the_force_of_contact():
    assert np.array_equal(factors(0.9), factors(1.0))


# ---- from contact to ten radii, and off ------------------------------------------------------------------------------


def by_series(s, q):
    """Force by Davis's series (docs/physics.md 2.1), in units of 4 pi eps0 r^2 E^2; terms below 1e-17 are left out."""
    xi = math.acosh(s)
    c0, odd = math.sinh(xi), 2.0 * np.arange(int(40.0 / xi) + 3) + 1.0
    w = 1.0 / np.expm1(odd * xi)
    # q = Q/(4 pi eps0 r^2 E) = sum A_n c0/sqrt(2), A_n = 2 sqrt(2) (V + c0 odd) w_n, all for E = r = 1
    V = (q / (2.0 * c0) - c0 * np.sum(odd * w)) / np.sum(w)
    A = 2.0 * math.sqrt(2.0) * (V + c0 * odd) * w
    n = 0.5 * (odd - 1.0)
    return q - 0.25 * float(np.sum((n + 0.5) * A * A - (n + 1.0) * A * np.append(A[1:], 0.0)))


def test_the_charge_of_contact_is_the_limit_of_a_grounded_sphere_that_nears_the_plane():
    """pi^2/6 = 1.6449 (Felici; Lebedev & Skal'skaya 1962), from the bispherical series: Q = 8 pi eps0 E c0^2 sum ..."""
    charges = []
    for gap in (1e-4, 1e-6, 1e-8):
        xi = math.acosh(1.0 + gap)
        odd = 2.0 * np.arange(int(40.0 / xi) + 3) + 1.0
        charges.append(2.0 * math.sinh(xi) ** 2 * float(np.sum(odd / np.expm1(odd * xi))))
    assert np.all(np.diff(np.abs(np.array(charges) - K_Q)) < 0.0)
    assert charges[-1] == pytest.approx(K_Q, rel=1e-7)
    radius = 0.4e-3
    sim = simulation(bare_drum(-VOLTAGE, speed=0.0, landing=None, friction=10.0, rolling_friction=10.0))
    set_on_drum(sim, "copper", 2.0 * radius)
    sim.step(3)
    E = float(np.linalg.norm(sim.scene.electric_field()([[0.0, 0.160, 0.0]])[0]))
    assert sim.charge[0] / (4.0 * math.pi * EPS0 * radius**2 * E) == pytest.approx(charges[-1], rel=1e-7)


@pytest.mark.parametrize("charge", [K_Q, 0.0, -1.0])
def test_from_contact_to_ten_radii_the_force_is_that_of_the_series(charge):
    """Gaps from r/1000 to 9 r; below, down to a millionth, at the charge of contact, whose force is finite there."""
    for gap in np.geomspace(1.001e-3, 9.0, 40):
        exact = by_series(1.0 + gap, charge)
        up, none, down = (by_series(1.0 + gap, q) for q in (1.0, 0.0, -1.0))
        scale = abs(charge) + abs(none) + abs(0.5 * (up + down) - none) * charge**2
        assert force(1.0 + gap, charge) == pytest.approx(exact, abs=1e-7 * scale)
    for gap in (1e-6, 1e-5, 1e-4):
        assert force(1.0 + gap, K_Q) == pytest.approx(by_series(1.0 + gap, K_Q), rel=2e-3)


def under_the_electrode(voltage, material, diameter, step):
    """A sphere on the top of a drum at rest, straight under the electrode, on ground that lets nothing roll."""
    scene = bare_drum(-voltage, speed=0.0, step=step, landing=None, friction=10.0, rolling_friction=10.0)
    scene.electrode.angle = 0.5 * math.pi
    sim = simulation(scene)
    set_on_drum(sim, material, diameter)
    return sim


def lifting_voltage(density, diameter):
    """4 pi eps0 r^2 (zeta(3) + 1/6) E^2 = m g, and E in proportion to the voltage."""
    E = math.sqrt(density * GRAVITY * diameter / (6.0 * K_F * EPS0))
    return E / drum_field(0.5 * math.pi - TILT, -1.0)


@pytest.mark.parametrize(("material", "density"), [("copper", 8960.0), ("aluminium", 2700.0)])
@pytest.mark.parametrize("diameter", [0.1e-3, 0.3e-3])
def test_a_charged_sphere_lifts_off_where_the_force_of_contact_exceeds_its_weight(material, density, diameter):
    """E^2 = m g/(1.3687 4 pi eps0 r^2): within 0.5 % in the voltage. By Q E alone it would be 9 % lower, and by Q E
    and the point image it would be 19 % higher."""
    limit = lifting_voltage(density, diameter)
    for share, lifts in ((0.995, False), (1.005, True)):
        sim = under_the_electrode(limit * share, material, diameter, 1e-4)
        sim.run(0.05)
        gap = float(np.hypot(*sim.position[0, :2])) - 0.160 - 0.5 * diameter
        assert (gap > 0.1 * diameter) == lifts
        assert sim.charge[0] > 0.0


def test_the_speed_of_a_sphere_that_has_lifted_off_is_that_of_the_work_by_the_series():
    """From contact to ten radii, 2 % above the lifting voltage: v^2/2 = integral of (F/m - g), to 1 %.

    Where the excess over the weight is so small, 1 % of it is 4e-4 of the force; the point image alone would not lift.
    """
    from scipy.integrate import quad

    diameter, density = 0.4e-3, 2700.0
    radius, mass = 0.5 * diameter, density * math.pi / 6.0 * diameter**3
    voltage = 1.02 * lifting_voltage(density, diameter)
    sim = under_the_electrode(voltage, "aluminium", diameter, 5e-5)
    field = sim.scene.electric_field()

    def surplus(s):
        E = float(field([[0.0, 0.160 + s * radius, 0.0]])[0, 1])
        unit = 4.0 * math.pi * EPS0 * radius**2
        return by_series(s, sim.charge[0] / (unit * E)) * unit * E**2 / mass - GRAVITY

    places, speeds = [], []
    while not places or places[-1] < 10.0:
        sim.step()
        places.append((sim.position[0, 1] - 0.160) / radius)
        speeds.append(sim.velocity[0, 1])
        assert sim.time < 0.5
    for s in (1.1, 1.5, 2.0, 5.0, 10.0):
        work = radius * quad(surplus, 1.0 + 1e-6, s, limit=100, epsrel=1e-6)[0]
        assert np.interp(s, places, speeds) ** 2 / 2.0 == pytest.approx(work, rel=0.01)
