"""The field of two parallel cylinders, held against the closed form in high precision and against another method.

Source: docs/physics.md 1.1; Li, Lu, Xu & Zhou, J. Hazard. Mater. 151 (2008) 52.
"""

import math

import mpmath as mp
import numpy as np
import pytest
from scenes import R1, R2, TILT, VOLTAGE, L

import cesim

CENTER = np.array([L * math.cos(TILT), L * math.sin(TILT)])
CASES = {
    "reference": {"drum_radius": R1, "electrode_radius": R2, "distance": L},
    "wire": {"drum_radius": 0.16, "electrode_radius": 1e-4, "distance": 0.2},
    "thin gap": {"drum_radius": 0.16, "electrode_radius": 0.019, "distance": 0.1795},
}


def engine_field(voltage=-VOLTAGE, angle=TILT, **geometry):
    definition = CASES["reference"] | geometry
    return cesim.engine.Field(
        {"kind": "two_cylinders", **definition, "angle": angle, "voltage": voltage, "drum_center": (0.0, 0.0)}
    )


def at(points):
    points = np.atleast_2d(points)
    return np.column_stack([points, np.zeros(len(points))])


def along(angles, radius, center=(0.0, 0.0)):
    return np.asarray(center) + radius * np.column_stack([np.cos(angles), np.sin(angles)])


def outside(n, clearance):
    """Points between and around the conductors, no nearer to them than the clearance."""
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (20 * n, 2))
    free = (np.hypot(*points.T) > R1 + clearance) & (np.hypot(*(points - CENTER).T) > R2 + clearance)
    return points[free][:n]


def closed_form(x, y, voltage, geometry):
    """(Ex, Ey, V) in the frame of the line of centres, in 40 digits, letter by letter as in docs/physics.md 1.1."""
    with mp.workdps(40):
        r1, r2, length = (mp.mpf(geometry[name]) for name in ("drum_radius", "electrode_radius", "distance"))
        h1 = (length**2 + r1**2 - r2**2) / (2 * length)
        h2 = length - h1
        c = mp.sqrt(h1**2 - r1**2)
        f = voltage / mp.log((h1 + c - r1) * (h2 + c - r2) / ((r1 + c - h1) * (r2 + c - h2)))
        k1 = (r1 + c - h1) / (h1 + c - r1)
        left, right = mp.mpf(x) - (h1 - c), mp.mpf(x) - (h1 + c)
        y = mp.mpf(y)
        minus, plus = left**2 + y**2, right**2 + y**2
        potential = f * (mp.log(minus / plus) / 2 - mp.log(k1))
        return -f * (left / minus - right / plus), -f * (y / minus - y / plus), potential


def test_the_field_facing_the_electrode_is_328512_on_the_drum_and_854335_on_the_electrode():
    """docs/physics.md 1.1. A slip in h1, h2, c or f (the known wrong code) is off by per cents."""
    field = engine_field(angle=0.0)
    for x, stated in ((R1, 328_512.0), (L - R2, 854_335.0)):
        exact = float(closed_form(x, 0.0, VOLTAGE, CASES["reference"])[0])
        measured = field.field(at((x, 0.0)))[0]
        assert abs(exact) == pytest.approx(stated, abs=0.5)
        assert measured == pytest.approx([-exact, 0.0, 0.0], rel=1e-13, abs=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_field_and_potential_are_the_closed_form_in_forty_digits(name):
    """docs/physics.md 1.1, also for a thin wire and a gap of half a millimetre, where differences lose digits."""
    geometry = CASES[name]
    field = engine_field(voltage=VOLTAGE, angle=0.0, **geometry)
    r1, r2, length = geometry["drum_radius"], geometry["electrode_radius"], geometry["distance"]
    angles = np.linspace(0.1, 6.2, 9)
    points = np.concatenate(
        [
            along(angles, 1.000001 * r1),
            along(angles, 1.3 * r1),
            along(angles, 1.000001 * r2, (length, 0.0)),
            along(angles, 1.3 * r2, (length, 0.0)),
            along(angles, 3.0),
        ]
    )
    points = points[(np.hypot(*points.T) > r1) & (np.hypot(points[:, 0] - length, points[:, 1]) > r2)]
    exact = np.array([[float(v) for v in closed_form(*p, VOLTAGE, geometry)] for p in points])
    error = np.linalg.norm(field.field(at(points))[:, :2] - exact[:, :2], axis=1)
    rounding = 2e-16 * length / min(r2, length - r1 - r2)  # of the coordinates themselves
    assert np.all(error <= (2e-14 + 2.0 * rounding) * np.linalg.norm(exact[:, :2], axis=1))
    assert field.potential(at(points)) == pytest.approx(exact[:, 2], abs=1e-13 * VOLTAGE)


def test_the_integral_of_the_field_across_the_gap_is_the_voltage():
    """V = -integral of E: Gauss-Legendre on the straight line, and on a path round the back of the drum."""
    field = engine_field()
    nodes, weights = np.polynomial.legendre.leggauss(80)
    direction = CENTER / L
    s = R1 + 0.5 * (L - R2 - R1) * (1.0 + nodes)
    across = field.field(at(s[:, None] * direction))[:, :2] @ direction
    assert -0.5 * (L - R2 - R1) * (weights @ across) == pytest.approx(-VOLTAGE, rel=1e-13)

    # From the back of the drum outwards, round at 0.6 m, and in to the back of the electrode.
    def straight(start, end):
        points = 0.5 * (np.outer(1.0 - nodes, start) + np.outer(1.0 + nodes, end))
        return 0.5 * weights @ (field.field(at(points))[:, :2] @ (end - start))

    angle = TILT + 0.5 * math.pi * (1.0 - nodes)
    round_about = field.field(at(along(angle, 0.6)))[:, :2]
    tangent = np.column_stack([-np.sin(angle), np.cos(angle)])
    arc = -0.5 * math.pi * 0.6 * (weights @ np.sum(round_about * tangent, axis=1))
    total = straight(-R1 * direction, -0.6 * direction) + arc + straight(0.6 * direction, (L + R2) * direction)
    assert -total == pytest.approx(-VOLTAGE, rel=1e-12)


def test_the_field_has_neither_curl_nor_divergence_and_is_minus_the_gradient_of_the_potential():
    """Central differences of eighth order, 2 mm apart; in units of the field over its own length, 30 mm."""
    field = engine_field()
    points, h = outside(400, 0.03), 1e-3
    coefficients = {1: 4.0 / 5.0, 2: -1.0 / 5.0, 3: 4.0 / 105.0, 4: -1.0 / 280.0}

    def slope(function, axis):
        step = np.eye(2)[axis] * h
        return (
            sum(
                c * (function(at(points + k * step)) - function(at(points - k * step))) for k, c in coefficients.items()
            )
            / h
        )

    dx, dy = slope(field.field, 0), slope(field.field, 1)
    here = field.field(at(points))
    scale = np.linalg.norm(here, axis=1) / 0.03
    assert np.max(np.abs(dx[:, 0] + dy[:, 1]) / scale) < 1e-9
    assert np.max(np.abs(dx[:, 1] - dy[:, 0]) / scale) < 1e-9
    gradient = np.column_stack([slope(field.potential, 0), slope(field.potential, 1)])
    assert np.max(np.abs(gradient + here[:, :2]) / (0.03 * scale[:, None])) < 1e-9


def test_flux_through_a_loop_is_zero_unless_it_holds_a_conductor():
    """Gauss: 2 pi U / Lambda round the drum, minus that round the electrode; no circulation round any loop."""
    field = engine_field()
    angles = np.arange(400) * (2.0 * math.pi / 400)
    outward = np.column_stack([np.cos(angles), np.sin(angles)])

    def loop(center, radius):
        E = field.field(at(along(angles, radius, center)))[:, :2]
        length = 2.0 * math.pi * radius / 400
        return np.sum(E * outward) * length, np.sum(E[:, 1] * outward[:, 0] - E[:, 0] * outward[:, 1]) * length

    strength = 2.0 * math.pi * VOLTAGE / math.acosh((L**2 - R1**2 - R2**2) / (2.0 * R1 * R2))
    for center, radius, flux in (
        ((0.0, 0.0), 0.2, strength),
        (CENTER, 0.05, -strength),
        ((0.0, 0.0), 0.4, 0.0),
        (0.75 * CENTER, 0.02, 0.0),
    ):
        assert loop(center, radius) == pytest.approx((flux, 0.0), abs=1e-11 * strength)


def test_drum_and_electrode_are_equipotential_and_the_field_stands_upright_on_them():
    field = engine_field()
    angles = np.linspace(0.0, 2.0 * math.pi, 721)
    for center, radius, potential in (((0.0, 0.0), R1, 0.0), (CENTER, R2, -VOLTAGE)):
        surface = along(angles, radius, center)
        assert np.max(np.abs(field.potential(at(surface)) - potential)) <= 1e-12 * VOLTAGE
        E = field.field(at(surface))[:, :2]
        tangent = np.column_stack([-np.sin(angles), np.cos(angles)])
        assert np.max(np.abs(np.sum(E * tangent, axis=1)) / np.linalg.norm(E, axis=1)) < 1e-13


def collocated(points, order=90):
    """Field and potential of two circles at 0 and U without knowing about line charges or images.

    Every potential outside two circles is c + a ln(r1/r2) + multipoles about both centres; the coefficients follow from
    the potentials on 4 x order points of each circle, by least squares.
    """
    n = np.arange(1, order + 1)

    def basis(points):
        values, gradients = [np.ones(len(points))], [np.zeros((len(points), 2))]
        z = [(points[:, 0] + 1j * points[:, 1] - shift) for shift in (0.0, L)]
        values.append(np.log(abs(z[0]) / abs(z[1])))
        log_slope = 1.0 / z[0] - 1.0 / z[1]
        gradients.append(np.column_stack([log_slope.real, -log_slope.imag]))
        for place, radius in zip(z, (R1, R2), strict=True):
            power = (radius / place[:, None]) ** n
            slope = -n * power / place[:, None]
            values += [*power.real.T, *power.imag.T]
            gradients += [np.column_stack([s.real, -s.imag]) for s in slope.T]
            gradients += [np.column_stack([s.imag, s.real]) for s in slope.T]
        return np.array(values).T, np.array(gradients)

    angles = np.arange(4 * order) * (2.0 * math.pi / (4 * order))
    boundary = np.concatenate([along(angles, R1), along(angles, R2, (L, 0.0))])
    target = np.repeat([0.0, VOLTAGE], 4 * order)
    coefficients = np.linalg.lstsq(basis(boundary)[0], target, rcond=None)[0]
    values, gradients = basis(points)
    return values @ coefficients, -np.einsum("k,kni->ni", coefficients, gradients)


def test_the_closed_form_is_the_solution_of_the_boundary_value_problem():
    """Another method: multipole collocation, which knows only Laplace, the two circles and their potentials."""
    field = engine_field(voltage=VOLTAGE, angle=0.0)
    angles = np.linspace(0.0, 2.0 * math.pi, 60)
    points = np.concatenate(
        [along(angles, 1.0001 * R1), along(angles, 0.175), along(angles, 1.001 * R2, (L, 0.0)), along(angles, 0.35)]
    )
    potential, E = collocated(points)
    assert np.max(np.abs(field.potential(at(points)) - potential)) < 1e-10 * VOLTAGE
    error = np.linalg.norm(field.field(at(points))[:, :2] - E, axis=1)
    assert np.max(error / np.linalg.norm(E, axis=1)) < 1e-9


def test_a_negative_electrode_draws_the_field_out_of_the_drum():
    """docs/physics.md 1.1: electrode negative, E points out of the drum; the other polarity is its exact mirror."""
    points = outside(200, 0.0)
    negative, positive = engine_field(-VOLTAGE), engine_field(VOLTAGE)
    assert np.array_equal(negative.field(at(points)), -positive.field(at(points)))
    assert np.array_equal(negative.potential(at(points)), -positive.potential(at(points)))
    angles = np.linspace(0.0, 2.0 * math.pi, 90)
    outward = np.column_stack([np.cos(angles), np.sin(angles)])
    assert np.all(np.sum(negative.field(at(along(angles, R1)))[:, :2] * outward, axis=1) > 0.0)


def test_a_grain_pressed_into_the_drum_feels_the_field_of_its_surface():
    """A grain a micrometre inside must not lose its force, nor blow up at a line charge."""
    field = engine_field()
    angles = np.linspace(0.0, 2.0 * math.pi, 90)
    pressed = field.field(at(along(angles, R1 - 1e-6)))
    assert pressed == pytest.approx(field.field(at(along(angles, R1))), rel=1e-12, abs=1e-4)
    assert np.all(np.isfinite(field.field(at([(0.0, 0.0), CENTER]))))


def test_the_largest_field_is_on_the_thinner_conductor_where_it_faces_the_other():
    """No point of a fine ring about either conductor is above it."""
    exact = cesim.fields.TwoCylinders(R1, R2, L, TILT, VOLTAGE)
    series = cesim.fields.Conductors(
        [{"center": (0.0, 0.0), "radius": R1}, {"center": CENTER, "radius": R2, "voltage": VOLTAGE}]
    )
    ring = np.linspace(0.0, 2.0 * np.pi, 100_001)
    on_ring = max(
        np.linalg.norm(exact(at(along(ring, r, c))), axis=1).max() for r, c in ((R1, (0.0, 0.0)), (R2, CENTER))
    )
    assert exact.largest() == pytest.approx(on_ring, rel=1e-7)
    assert series.largest() == pytest.approx(on_ring, rel=1e-4)
