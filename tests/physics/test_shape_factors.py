"""Electric factors of shapes: conductors that lie or stand on the drum, ellipsoids in an ion flow.

Sources: docs/physics.md 2.1 (its table, and the closed forms of an endless cylinder and an endless flake), 2.2.
"""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scenes import EPS0, VOLTAGE, bare_drum, drum_field, simulation
from scipy import integrate, special

import cesim
from cesim.shapes.electric import contact_factors, depolarization, electric_factors, semi_axes

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
K_Q, K_F = math.pi**2 / 6.0, 1.368724


def spheroid(aspect):
    """Semi-axes over d of a spheroid whose axis z is aspect times the others."""
    a = 0.5 * aspect ** (-1.0 / 3.0)
    return np.array([a, a, aspect * a])


def by_rings(aspect, panels):
    """(k_Q, F/(Q E)) of a spheroid on a plane, axis along the normal: point charges of rings on its axis of symmetry.

    Independent of the table's method: a boundary integral over rings, whose potential is a complete elliptic integral,
    with the own ring's logarithm integrated over its panel.
    """
    a, _, c = spheroid(aspect) * 2.0  # r = 1
    t = np.pi * (np.arange(panels) + 0.5) / panels
    rho, z = a * np.sin(t), c * (1.0 + np.cos(t))
    length = np.hypot(a * np.cos(t), c * np.sin(t)) * np.pi / panels

    def potential(rho, z, ring, height):
        """Of a ring of unit charge."""
        far = (rho + ring) ** 2 + (z - height) ** 2
        return 2.0 / np.pi * special.ellipk(4.0 * rho * ring / far) / np.sqrt(far)

    matrix = np.empty((panels, panels))
    for i in range(panels):
        with np.errstate(divide="ignore"):
            matrix[i] = potential(rho[i], z[i], rho, z) - potential(rho[i], z[i], rho, -z)
        own = (np.log(16.0 * rho[i] / length[i]) + 1.0) / (np.pi * rho[i])  # mean of ln(8 rho/x) over the panel
        matrix[i, i] = own - potential(rho[i], z[i], rho[i], -z[i])
    charge = np.linalg.solve(matrix, z)  # of each ring, in 4 pi eps0 E
    density = charge / (2.0 * np.pi * rho * length)
    upward = (z - c) / c**2 / np.sqrt((rho / a**2) ** 2 + ((z - c) / c**2) ** 2)
    return charge.sum(), 2.0 * np.pi * (density * charge * upward).sum() / charge.sum()


@pytest.mark.parametrize("aspect", [0.22, 0.5, 1.0, 2.2, 5.0])
def test_the_table_of_contact_factors_is_met_by_an_independent_method(aspect):
    """Charge within 0.3 %, force within 1 %; the sphere's are exact (Felici; Lebedev & Skal'skaya)."""
    charge, force = contact_factors(spheroid(aspect))[:, 2]
    coarse, fine = np.array(by_rings(aspect, 200)), np.array(by_rings(aspect, 400))
    extrapolated = 2.0 * fine - coarse
    assert charge == pytest.approx(extrapolated[0], rel=0.003)
    assert force == pytest.approx(extrapolated[1], rel=0.01)
    if aspect == 1.0:
        assert (charge, force) == pytest.approx((K_Q, K_F / K_Q), rel=1e-4)


def test_the_table_is_that_of_the_boundary_integrals_and_of_the_literature():
    """docs/physics.md 2.1: standing 2:1, 3:1, 5:1 and lying 1:2, 1:5, 1:10."""
    from contact_factors import factors_once

    for aspect, charge, force in (
        (2.0, 2.333, 0.877), (3.0, 3.064, 0.897), (5.0, 4.576, 0.916),
        (0.5, 1.376, 0.773), (0.2, 1.419, 0.686), (0.1, 1.719, 0.627),
    ):  # fmt: skip
        assert contact_factors(spheroid(aspect))[:, 2] == pytest.approx((charge, force), rel=0.015)
    for height, slender in ((1.5, 2.2), (0.5, 5.0)):
        axes = np.array([math.sqrt(slender), 1.0 / math.sqrt(slender), height]) / height ** (1.0 / 3.0) * 0.5
        assert factors_once(height, slender, 24, 12) == pytest.approx(contact_factors(axes)[:, 2], rel=2e-3)


def test_a_long_lying_ellipsoid_comes_near_the_endless_cylinder():
    """Q' = 2 pi eps0 R E and F/(Q E) = 0.71498 of the cylinder.

    Per length the ellipsoid has the charge of the cylinder of its local radius, on the mean pi/4 of the largest.
    """
    slender = 10.0
    R = 0.5 * slender ** (-1.0 / 3.0)
    axes = np.array([slender * R, R, R])
    charge, force = contact_factors(axes)[:, 2]
    local = 2.0 * math.pi * (math.pi / 4.0 * R) * 2.0 * slender * R / (4.0 * math.pi * 0.25)
    assert charge == pytest.approx(local, rel=0.25)
    assert 0.71498 < force < K_F / K_Q


def test_the_moments_of_an_ellipsoid_give_back_its_axes_and_depolarization():
    axes = np.array([0.7, 0.5, 0.0])
    axes[2] = 0.125 / axes[:2].prod()
    square = axes**2
    moments = (square.sum() - square) / 5.0
    assert semi_axes(moments) == pytest.approx(axes)
    for k, factor in enumerate(depolarization(axes)):
        integral, _ = integrate.quad(
            lambda s, k=k: 1.0 / ((s + square[k]) * math.sqrt(np.prod(s + square))), 0.0, math.inf
        )
        assert factor == pytest.approx(0.5 * axes.prod() * integral, rel=1e-6)
    assert depolarization(axes).sum() == pytest.approx(1.0)
    round_one = electric_factors(np.full(3, 0.1))
    assert round_one["contact_charge"] == pytest.approx(np.full(3, K_Q), rel=1e-4)
    assert round_one["depolarization"] == pytest.approx(np.full(3, 1.0 / 3.0))


# ---- in the engine ---------------------------------------------------------------------------------------------------

FLAKE = cesim.Ellipsoid(axes=(3.0, 3.0, 1.0))


def lying():
    """A quarter turn about x: the body's z, the flake's short axis, points along the drum's normal."""
    return (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0)


def test_a_lying_flake_takes_the_charge_and_feels_the_force_of_its_shape_on_the_drum():
    """Pressed onto the drum; then F = 0.7338 Q E, where a sphere of its volume has 0.832."""
    scene = bare_drum(-VOLTAGE, speed=0.0, landing=None, effects={"gravity": "off"})
    scene.shapes["it"] = FLAKE
    sim = simulation(scene)
    template = next(shape for shape in sim.shapes if shape.kind != "sphere")
    thin = int(np.argmax(template.moments))
    assert thin == 2
    bottom = 1e-3 * float((template.spheres[:, 2] + template.spheres[:, 3]).max())
    sim.add(
        (0.0, 0.160 + bottom, 0.0), velocity=(0.0, -0.05, 0.0), diameter=1e-3, shape="it",
        orientation=lying(), material="copper",
    )  # fmt: skip
    sim.step(2)
    charge, force = contact_factors(semi_axes(template.moments))[:, 2]
    E = drum_field(0.0, -VOLTAGE)
    assert charge == pytest.approx(1.3466, rel=0.01)
    assert sim.charge[0] == pytest.approx(charge * 4.0 * math.pi * EPS0 * 0.25e-6 * E, rel=2e-3)
    before = sim.velocity[0, 1]
    sim.position[0] = (0.0, 0.160 + 1e-3 * semi_axes(template.moments)[2], 0.0)
    sim.velocity[:] = (0.0, 1e-4, 0.0)
    q = sim.charge[0]
    sim.step()
    gained = (sim.velocity[0, 1] - 1e-4) * sim.mass[0] / 1e-3
    assert gained / (q * E) == pytest.approx(force, rel=0.01)
    assert before != 0.0


def test_flat_grains_collect_more_ions_lying_than_spheres_and_fewer_standing():
    """Q_s = 4 pi eps0 a b E eps_r/(1 + (eps_r - 1) N_c), the field along c: a sphere's is Pauthenier's."""
    permittivity, field = 2.87, 200e3
    corona = {"arc": (-0.2, 0.2), "field": field}
    for orientation, axis in ((lying(), 2), ((1.0, 0.0, 0.0, 0.0), 1)):
        scene = bare_drum(-VOLTAGE, speed=0.0, landing=None, corona=corona)
        scene.shapes["it"] = FLAKE
        sim = simulation(scene)
        template = next(shape for shape in sim.shapes if shape.kind != "sphere")
        axes = semi_axes(template.moments) * 1e-3
        sim.add((0.0, 0.1615, 0.0), diameter=1e-3, shape="it", orientation=orientation, material="ABS")
        sim.step()
        across = np.prod(np.delete(axes, axis))
        inside = 1.0 + (permittivity - 1.0) * depolarization(axes)[axis]
        exact = -4.0 * math.pi * EPS0 * across * field * permittivity / inside
        assert sim.charge[0] == pytest.approx(exact, rel=1e-9, abs=0.0)
        sphere = -12.0 * math.pi * EPS0 * 0.25e-6 * field * permittivity / (permittivity + 2.0)
        assert (sim.charge[0] / sphere > 1.2) == (axis == 2)
