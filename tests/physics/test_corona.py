"""Corona: onset at wires, field and current of the ions against exact and published ones (docs/physics.md 1.4)."""

import math

import numpy as np
import pytest
from scenes import EPS0, SPEED, VOLTAGE, bare_drum, exact_coaxial_current, pauthenier_charge, set_on_drum, simulation

import cesim
from cesim.corona import IonisedField, Wire, along_lines, coaxial, onset, relative_density

WIRE, CYLINDER, MOBILITY = 1e-4, 0.05, 1.8e-4  # m, m, m2/(V s)
ABS_PERMITTIVITY = 2.87
GRIP = {"friction": 10.0, "rolling": 10.0}


def between_cylinders(voltage):
    """The field without ions about a wire in a grounded cylinder."""

    def field(points):
        square = np.sum(points[:, :2] ** 2, axis=1)
        return voltage / math.log(CYLINDER / WIRE) * (points * (1.0, 1.0, 0.0)) / square[:, None]

    return field


def in_cylinder(voltage, **rest):
    return IonisedField(between_cylinders(voltage), [Wire((0.0, 0.0), WIRE, voltage)], CYLINDER, **rest)


# ---- onset -----------------------------------------------------------------------------------------------------------


def test_the_onset_of_wires_is_peeks():
    """30 kV/cm m d (1 + 0.301/sqrt(d a[cm])), by hand: Peek 1929, ch. III."""
    assert onset("1 cm") == pytest.approx(39.03e5, rel=1e-12)
    assert onset("0.1 cm") == pytest.approx(30e5 * (1.0 + 0.301 * math.sqrt(10.0)), rel=1e-12)
    assert onset("0.1 mm", roughness=0.93) == pytest.approx(0.93 * 120.4e5 + 0.93 * -0.1e5, rel=1e-12)
    thin = relative_density("323.15 K", 0.8 * 101325.0)
    assert thin == pytest.approx(3.92 * 0.8 * 76.0 / (273.0 + 50.0), rel=1e-3)  # cm of mercury, degrees Celsius
    assert onset("0.1 mm", density=thin) == pytest.approx(30e5 * thin * (1.0 + 0.301 / math.sqrt(0.01 * thin)))


def test_the_onset_voltage_between_cylinders_is_the_field_times_a_ln_b_over_a():
    found = in_cylinder(-20e3)
    assert found.onset_voltage == pytest.approx([onset(WIRE) * WIRE * math.log(CYLINDER / WIRE)], rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [({"radius": -1.0}, "radius"), ({"radius": 1e-4, "roughness": 1.2}, "roughness"), ({"radius": "1 kg"}, "radius")],
)
def test_an_onset_of_nonsense_is_refused_by_name(arguments, name):
    with pytest.raises(cesim.InputError, match=name):
        onset(**arguments)


# ---- ions between coaxial cylinders, exact ---------------------------------------------------------------------------


@pytest.mark.parametrize(("sign", "voltage"), [(-1.0, 8e3), (-1.0, 25e3), (1.0, 25e3), (-1.0, 60e3)])
def test_current_and_field_between_coaxial_cylinders_are_the_exact_ones(sign, voltage):
    """E(r) = (1/r) sqrt(I'(r^2 - a^2)/(2 pi eps0 b) + (E_c a)^2), Townsend 1914."""
    found = in_cylinder(sign * voltage)
    current = exact_coaxial_current(voltage, WIRE, CYLINDER)
    assert found.current == pytest.approx(current, rel=1e-7)
    exact = coaxial(CYLINDER, current, WIRE, onset(WIRE), MOBILITY)
    assert found.field == pytest.approx(np.full(len(found.angle), exact), rel=1e-7)
    assert np.ptp(found.current_density) <= 1e-9 * found.current_density.max()


def test_the_current_rises_with_the_voltage_as_between_coaxial_cylinders():
    """The exact curve at every voltage; near the onset Townsend's I' = 8 pi eps0 b U (U - U0)/(R^2 ln(R/a))."""
    found = in_cylinder(-25e3)
    voltages = np.array([8e3, 12e3, 25e3, 40e3])
    assert found.currents(-voltages) == pytest.approx(
        [exact_coaxial_current(voltage, WIRE, CYLINDER) for voltage in voltages], rel=1e-7
    )
    first = float(found.onset_voltage[0])
    assert found.currents([0.99 * first, 0.5 * first, 0.0]) == pytest.approx([0.0] * 3, abs=0.0)
    near = 1.001 * first
    townsend = 8.0 * math.pi * EPS0 * MOBILITY * near * (near - first) / (CYLINDER**2 * math.log(CYLINDER / WIRE))
    assert found.currents([near]) == pytest.approx([townsend], rel=5e-3)


# ---- Deutsch's assumption where it is one ----------------------------------------------------------------------------


def test_a_needle_over_a_plane_spreads_its_ions_as_warburg_measured_at_the_edge_and_too_narrowly_between():
    """J/J0 = cos^4.82: Warburg's measurements after Sigmond, J. Appl. Phys. 53 (1982) 891.

    The lines of a hyperboloid's field are ellipses, in closed form. Deutsch's assumption is right at 60 degrees and a
    third too low at 30: the ions' own field would spread them. This is what it costs where it is worst.
    """
    needle, angle = np.arctanh(1.0 - 1e-5), np.radians([0.0, 30.0, 60.0])
    eta, xi = np.tanh(np.linspace(needle, 0.0, 2001)), 1.0 / np.cos(angle)

    def primitive(eta):
        return xi[:, None] ** 2 * eta - eta**3 / 3.0

    thickness = needle * (primitive(eta[:1]) - primitive(eta[None, :]))
    rate, _ = along_lines(thickness, np.full(3, 0.02))
    ratio = rate / xi / (rate[0] * np.cos(angle) ** 4.82)
    assert ratio[2] == pytest.approx(1.0, abs=0.1)
    assert 0.65 < ratio[1] < 0.75


def test_charge_on_a_line_to_the_drum_thins_by_its_own_repulsion():
    """1/rho = 1/rho_wire + b t/eps0 along the drift, Sigmond 1982; the time from E by another integrator."""
    R, distance, a, voltage = 0.16, 0.22, 1e-4, -30e3
    field = cesim.fields.TwoCylinders(R, a, distance, 0.5 * math.pi, voltage)
    found = IonisedField(field, [Wire((0.0, distance), a, voltage)], R)
    top = int(np.argmin(np.abs(found.angle)))
    steps = 40_000  # of the straight line from the wire down, equal in the logarithm of the distance from its axis
    r = np.geomspace(a, distance - R, steps + 1)
    points = np.column_stack([0.0 * r, distance - r, 0.0 * r])
    without = np.linalg.norm(field(points), axis=1)
    C = found.current_density[top] / (found.mobility * found.laplacian_field[top])
    x, density = found.onset_field[0] / without[0], []
    time, previous = 0.0, None
    for k in range(steps + 1):  # d(x)/ds = rho/(eps0 E_L), rho = C/x
        if previous is not None:
            ds = r[k] - r[k - 1]
            half = x + 0.5 * ds * C / (x * EPS0 * without[k - 1])
            x += ds * C / (half * EPS0 * 0.5 * (without[k - 1] + without[k]))
            time += 0.5 * ds * (previous + 1.0 / (found.mobility * x * without[k]))
        previous = 1.0 / (found.mobility * x * without[k])
        density.append(C / x)
    assert x * without[-1] == pytest.approx(found.field[top], rel=1e-5)
    assert 1.0 / density[-1] - 1.0 / density[0] == pytest.approx(found.mobility * time / EPS0, rel=1e-4)


def test_no_ions_come_from_a_wire_below_its_onset_nor_from_a_tube():
    for radius, voltage in ((1e-4, -8e3), (0.019, -35e3)):
        field = cesim.fields.TwoCylinders(0.16, radius, 0.267, 0.5, voltage)
        center = (0.267 * math.cos(0.5), 0.267 * math.sin(0.5))
        found = IonisedField(field, [Wire(center, radius, voltage)], 0.16, angles=181)
        assert abs(voltage) < found.onset_voltage[0]
        assert found.current == 0.0
        assert found.field == pytest.approx(found.laplacian_field, rel=1e-12)
        assert (found.wire == -1).all()


# ---- charging by local field and current -----------------------------------------------------------------------------


def with_table(rows, step=1e-3, speed=SPEED, **grain):
    """A grain of ABS on a drum whose ion flow stands in a table."""
    sim = simulation(bare_drum(-VOLTAGE, speed=speed, step=step, corona={}, landing=None))
    for effect in sim.definition["effects"]:
        if effect["name"] == "corona_charging":
            effect["parameters"] |= {"from": math.nan, "to": math.nan}
            effect["table"] = np.asarray(rows, dtype=float)
    for name, value in GRIP.items():
        sim.definition[f"surface_{name}"] = np.full_like(sim.definition[f"surface_{name}"], value)
    sim.engine = cesim.engine.Scene(sim.definition, seed=1, threads=1)
    set_on_drum(sim, "ABS", 0.3e-3, **grain)
    return sim


def ride(E, J, arc):
    """Charge in C after a ride through an arc: Q' = J (Qs - Q)^2/(4 eps0 E Qs) with the local Qs, by quadrature."""
    from scipy.integrate import solve_ivp

    def slope(t, q):
        angle = arc[0] + SPEED * t
        full = pauthenier_charge(0.3e-3, ABS_PERMITTIVITY, E(angle)) / scale
        return [J(angle) * max(full - q[0], 0.0) ** 2 / (4.0 * EPS0 * E(angle) * full)]

    scale = pauthenier_charge(0.3e-3, ABS_PERMITTIVITY, 400e3)
    time = (arc[1] - arc[0]) / SPEED
    return -scale * solve_ivp(slope, (0.0, time), [0.0], rtol=1e-10, atol=1e-12, max_step=time / 200).y[0, -1]


def test_a_grain_that_rides_through_an_uneven_ion_flow_collects_what_the_equation_says():
    """Second order in the step: the middle of each step counts, and the edges lie inside steps."""
    arc = (0.2, 0.9)

    def field(angle):
        return 500e3 - 300e3 * abs(angle - 0.5)

    def current(angle):
        return 2e-3 * math.exp(-((angle - 0.5) ** 2) / 0.02) + 1e-4

    angles = np.linspace(*arc, 2001)
    rows = np.column_stack([angles, np.vectorize(field)(angles), np.vectorize(current)(angles)])
    exact, errors = ride(field, current, arc), []
    for step in (4e-3, 1e-3):
        sim = with_table(rows, step, angle=0.05)
        sim.run(1.0 / SPEED)
        errors.append(abs(sim.charge[0] / exact - 1.0))
    assert errors[0] < 2e-4
    assert errors[1] < 2e-5


@pytest.mark.parametrize("step", [7e-3, 2e-3, 1e-3])
@pytest.mark.parametrize("start", [-0.1, -0.0931, 0.0])
def test_the_edges_of_an_even_flow_lie_where_they_are_whatever_the_step(step, start):
    """Q = Qs t/(t + tau), t = arc/omega: exact though no edge is where a step ends, but for the chord in each."""
    arc, E, J = (0.2, 0.9), 400e3, 1e-3
    sim = with_table([(arc[0], E, J), (arc[1], E, J)], step, angle=start)
    sim.run(1.1 / SPEED)
    time, tau = (arc[1] - arc[0]) / SPEED, 4.0 * EPS0 * E / J
    exact = -pauthenier_charge(0.3e-3, ABS_PERMITTIVITY, E) * time / (time + tau)
    assert sim.charge[0] == pytest.approx(exact, rel=3e-6 + 0.05 * (SPEED * step) ** 2, abs=0.0)


def test_an_arc_all_around_the_drum_has_no_edge():
    """The angle jumps from pi to -pi at the drum's bottom, inside a step."""
    E, J = 400e3, 1e-3
    sim = with_table([(-math.pi, E, J), (math.pi, E, J)], 7e-3, angle=3.1)
    sim.step()
    tau = 4.0 * EPS0 * E / J
    exact = -pauthenier_charge(0.3e-3, ABS_PERMITTIVITY, E) * 7e-3 / (7e-3 + tau)
    assert sim.charge[0] == pytest.approx(exact, rel=1e-3, abs=0.0)
    twin = with_table([(-math.pi, E, J), (math.pi, E, J)], 7e-3, angle=1.0)
    twin.step()
    assert sim.charge[0] == pytest.approx(float(twin.charge[0]), rel=1e-9, abs=0.0)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([(0.0, 4e5, 1e-3)], "at least 2"),
        ([(0.0, 4e5, 1e-3), (0.0, 4e5, 1e-3)], "angles must rise"),
        ([(0.0, 4e5, 1e-3), (4.0, 4e5, 1e-3)], "angles must rise"),
        ([(0.0, 4e5, -1e-3), (1.0, 4e5, 1e-3)], r"\[0, 1000\] A/m2"),
        ([(0.0, math.nan, 1e-3), (1.0, 4e5, 1e-3)], r"\[0, 1e8\] V/m"),
        ([(math.nan, 4e5, 1e-3), (1.0, 4e5, 1e-3)], "angles must rise"),
    ],
)
def test_a_table_of_nonsense_is_refused(rows, message):
    with pytest.raises(cesim.engine.InputError, match=message):
        with_table(rows)


def test_an_effect_without_a_table_refuses_one():
    sim = simulation(bare_drum(-VOLTAGE, landing=None))
    definition = dict(sim.definition)
    definition["effects"] = [{"name": "gravity", "parameters": {}, "table": np.zeros((2, 3))}]
    with pytest.raises(cesim.engine.InputError, match="'gravity' takes no table"):
        cesim.engine.Scene(definition, seed=1, threads=1)


def test_a_wire_at_no_voltage_never_burns():
    drum = cesim.Drum()
    live = {"kind": "corona", "radius": 1.5e-4, "distance": 0.23, "angle": "60 deg", "voltage": -30e3}
    dead = live | {"angle": "100 deg", "voltage": 0.0}
    scene = cesim.Scene(name="two wires", drum=drum, electrodes=[live, dead], field="conductors", corona=cesim.Corona())
    found = scene.ionised_field()
    assert np.isfinite(found.onset_voltage[0])
    assert found.onset_voltage[1] == np.inf
    assert found.current > 0.0
    assert set(found.wire[found.current_density > 0.0]) == {0}
