"""Any number of cylinders and wires: against the closed form, finite differences, a line charge and its image, and a
box.

Sources: docs/physics.md 1.1 and 1.2; W. R. Smythe, Static and Dynamic Electricity, 3rd ed., McGraw-Hill 1968, chapter
IV.
"""

import math

import numpy as np
import pytest
from scenes import EPS0, R1, R2, TILT, VOLTAGE, L
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

import cesim
from cesim import InputError
from cesim.fields import Conductors, Cylinder, Grid, TwoCylinders
from cesim.fields.base import circle
from cesim.fields.multipoles import unit_solutions

DRUM = Cylinder((0.0, 0.0), R1)
TUBE = Cylinder((L * math.cos(TILT), L * math.sin(TILT)), R2, -VOLTAGE)
WIRE = Cylinder((0.21 * math.cos(1.2), 0.21 * math.sin(1.2)), 1e-4, -30e3)
BOX = ((-0.45, -0.4), (0.5, 0.55))
ROUND = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)


def at(*xy):
    return np.atleast_2d([*xy, 0.0])


# ---- without a box -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("radius", "distance"), [(R2, L), (1e-4, 0.2), (R2, R1 + R2 + 5e-4), (0.3, 0.5), (1e-5, 0.17)],
    ids=["reference", "wire", "thin gap", "larger electrode", "near thin wire"],
)  # fmt: skip
def test_two_conductors_are_the_two_cylinders_of_the_closed_form(radius, distance):
    exact = TwoCylinders(R1, radius, distance, TILT, -VOLTAGE)
    center = (distance * math.cos(TILT), distance * math.sin(TILT))
    field = Conductors([DRUM, Cylinder(center, radius, -VOLTAGE)])
    points = np.random.default_rng(1).uniform(-0.7, 0.7, (2000, 3))
    points = np.concatenate([points, circle(R1 + 1e-9, ROUND), circle(radius * (1 + 1e-9), ROUND, center)])
    largest = np.linalg.norm(exact(points), axis=1).max()
    assert np.abs(field(points) - exact(points)).max() < 1e-10 * largest
    assert np.abs(field.potential(points) - exact.potential(points)).max() < 1e-10 * VOLTAGE
    assert field.boundary_error < 1e-10


def test_each_surface_has_its_voltage_and_a_field_along_its_normal():
    field = Conductors([DRUM, TUBE, WIRE])
    for cylinder in field.cylinders:
        points = circle(cylinder.radius * (1.0 + 1e-12), ROUND, cylinder.center)
        assert field.potential(points) == pytest.approx(np.full(400, cylinder.voltage), abs=1e-5)
        normal = circle(1.0, ROUND)
        along = field(points) @ np.array([0, 0, 1.0]), np.cross(field(points), normal)[:, 2]
        assert np.abs(along).max() < 1e-9 * np.linalg.norm(field(points), axis=1).max()


def test_gauss_counts_the_charges_and_without_a_box_they_sum_to_zero():
    field = Conductors([DRUM, TUBE, WIRE])
    for cylinder, charge in zip(field.cylinders, field.charges, strict=True):
        radius = 1.02 * cylinder.radius
        flux = np.sum(field(circle(radius, ROUND, cylinder.center)) * circle(1.0, ROUND)) * 2.0 * np.pi * radius / 400
        assert EPS0 * flux == pytest.approx(charge, rel=1e-9)
    assert abs(field.charges.sum()) < 1e-12 * np.abs(field.charges).max()
    assert field.capacitances() == pytest.approx(field.capacitances().T, abs=1e-12 * field.capacitances().max())


def test_a_thin_wire_is_a_line_charge_with_its_image():
    """docs/physics.md 1.2: lambda = 2 pi eps0 U / acosh[(d^2 - R1^2 - a^2)/(2 R1 a)], image at R1^2/d."""
    d, a, voltage = 0.21, 5e-5, -30e3
    field = Conductors([DRUM, Cylinder((d, 0.0), a, voltage)])
    line = 2.0 * np.pi * EPS0 * voltage / math.acosh((d**2 - R1**2 - a**2) / (2.0 * R1 * a))
    assert field.charges[1] == pytest.approx(line, rel=1e-9)
    x, y, _ = circle(R1, ROUND).T
    z, image = x + 1j * y, R1**2 / d
    expected = np.abs(line / (2.0 * np.pi * EPS0) * (1.0 / (z - d) - 1.0 / (z - image)))
    assert np.linalg.norm(field(circle(R1, ROUND)), axis=1) == pytest.approx(expected, rel=1e-5)


def test_the_integral_of_the_field_across_each_gap_is_its_voltage():
    field = Conductors([DRUM, TUBE, WIRE])
    u, w = np.polynomial.legendre.leggauss(60)
    for cylinder in (TUBE, WIRE):
        distance = math.hypot(*cylinder.center)
        direction = np.array([*cylinder.center, 0.0]) / distance
        # Even in log of the distance from the axis: near a thin wire the field rises steeply.
        low, high = math.log(cylinder.radius), math.log(distance - R1)
        away = np.exp(low + 0.5 * (high - low) * (u + 1.0))
        across = 0.5 * (high - low) * np.sum(w * away * (field((distance - away)[:, None] * direction) @ direction))
        assert across == pytest.approx(-cylinder.voltage, rel=1e-9)


# ---- in a box ------------------------------------------------------------------------------------------------------


def test_the_walls_are_grounded_and_beyond_them_there_is_no_field():
    field = Conductors([DRUM, TUBE, WIRE], BOX)
    (left, low), (right, high) = BOX
    t = np.linspace(0.0, 1.0, 200)
    x, y = left + t * (right - left), low + t * (high - low)
    walls = np.column_stack([np.append(x, 0 * t + left), np.append(0 * t + low, y), np.zeros(400)])
    assert np.abs(field.potential(walls)).max() < 1e-9 * VOLTAGE
    beyond = at(0.51, 0.1)
    assert (field(beyond) == 0.0).all()
    assert field.potential(beyond) == [0.0]
    assert field.boundary_error < 1e-11


@pytest.mark.parametrize(
    ("half", "ratios"),
    [((0.5, 0.475), (0.96, 0.94, 0.83, 0.69, 0.52, 0.25)), ((1.0, 1.0), (0.98, 0.97, 0.89, 0.81, 0.69, 0.47))],
    ids=["small box", "2 m box"],
)
def test_a_box_weakens_the_field_on_the_drum_by_the_ratios_of_theory(half, ratios):
    """docs/physics.md 1.1, at 0, 15, 30, 45, 60 and 90 degrees from the line of centres; the small box is about its
    middle."""
    middle = 0.5 * L if half[0] < 1.0 else 0.0
    box = ((middle - half[0], -half[1]), (middle + half[0], half[1]))
    ring = circle(R1 * (1.0 + 1e-9), np.radians([0.0, 15.0, 30.0, 45.0, 60.0, 90.0]))
    boxed = Conductors([DRUM, Cylinder((L, 0.0), R2, VOLTAGE)], box)
    alone = TwoCylinders(R1, R2, L, 0.0, VOLTAGE)
    found = np.linalg.norm(boxed(ring), axis=1) / np.linalg.norm(alone(ring), axis=1)
    assert found == pytest.approx(ratios, abs=0.02)


def finite_differences(cylinders, box, n):
    """Laplace on n x n nodes, the conductors' edges by the arms of Shortley & Weller, J. Appl. Phys. 9 (1938) 334."""
    (left, low), (right, high) = box
    x, y = np.linspace(left, right, n), np.linspace(low, high, n)
    X, Y = np.meshgrid(x, y, indexing="ij")
    fixed = np.full((n, n), np.nan)
    fixed[0] = fixed[-1] = fixed[:, 0] = fixed[:, -1] = 0.0
    for c in cylinders:
        fixed[(X - c.center[0]) ** 2 + (Y - c.center[1]) ** 2 <= c.radius**2] = c.voltage
    free = np.isnan(fixed)
    number = np.cumsum(free.ravel()).reshape(n, n) - 1
    rows, columns, entries, right_side = [], [], [], np.zeros(free.sum())
    i, j = np.nonzero(free)
    place = number[i, j]
    for axis, h in ((0, x[1] - x[0]), (1, y[1] - y[0])):
        arms, ends = [], []
        for sign in (-1, 1):
            length, end = np.full(len(i), h), np.full(len(i), np.nan)
            ni, nj = i + sign * (axis == 0), j + sign * (axis == 1)
            for c in cylinders:
                along = (X[i, j], Y[i, j])[axis] - c.center[axis]
                across = (X[i, j], Y[i, j])[1 - axis] - c.center[1 - axis]
                chord = np.sqrt(np.maximum(c.radius**2 - across**2, 0.0))
                gap = -sign * along - chord
                hit = (np.abs(across) < c.radius) & (gap > 0.0) & (gap < h)
                length, end = np.where(hit, gap, length), np.where(hit, c.voltage, end)
            at_wall = np.isnan(end) & ~free[ni, nj]
            end = np.where(at_wall, fixed[ni, nj], end)
            arms.append(length)
            ends.append((end, number[ni, nj]))
        for own, other, (end, neighbour) in zip(arms, arms[::-1], ends, strict=True):
            weight = 2.0 / (own * (own + other))
            rows.append(place), columns.append(place), entries.append(-weight)
            inner = np.isnan(end)
            rows.append(place[inner]), columns.append(neighbour[inner]), entries.append(weight[inner])
            np.subtract.at(right_side, place[~inner], weight[~inner] * end[~inner])
    matrix = coo_matrix((np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns)))).tocsr()
    fixed[free] = spsolve(matrix, right_side)
    return X[free], Y[free], fixed[free]


def test_drum_tube_and_rod_in_a_box_agree_with_finite_differences_at_second_order():
    rod = Cylinder(WIRE.center, 0.008, -30e3)
    field = Conductors([DRUM, TUBE, rod], BOX)
    errors = []
    for n in (101, 201):
        x, y, potential = finite_differences([DRUM, TUBE, rod], BOX, n)
        exact = field.potential(np.column_stack([x, y, 0.0 * x]))
        errors.append(np.sqrt(np.mean((potential - exact) ** 2)) / VOLTAGE)
    assert errors[-1] < 2e-4
    assert math.log2(errors[0] / errors[1]) > 1.7


# ---- what it costs -------------------------------------------------------------------------------------------------


def test_a_sweep_of_voltages_solves_nothing_again():
    scene = cesim.scenes.single_particle()
    scene.field = {"kind": "conductors", "enclosure": {"lower": (-0.6, -0.5), "upper": (0.7, 0.8)}}
    scene.electrodes.append(cesim.scene.Electrode(kind="corona", radius=2e-4, distance=0.21, angle=1.2, voltage=-30e3))
    unit_solutions.cache_clear()  # another test may have solved this machine
    fields = []
    for voltage in np.linspace(-40e3, -10e3, 12):
        scene.electrode.voltage = float(voltage)
        fields.append(scene.electric_field()(at(0.17, 0.05))[0])
    assert unit_solutions.cache_info().misses == 1
    assert np.diff(fields, 2, axis=0) == pytest.approx(np.zeros((10, 3)), abs=1e-4)  # linear in the voltage


def test_the_field_of_sums_is_the_sum_of_fields():
    both = Conductors([DRUM, TUBE, WIRE])
    points = np.random.default_rng(2).uniform(-0.4, 0.4, (500, 3))
    parts = both.with_voltages([0.0, TUBE.voltage, 0.0])(points) + both.with_voltages([0.0, 0.0, WIRE.voltage])(points)
    assert both(points) == pytest.approx(parts, abs=1e-9 * np.abs(parts).max())


def test_a_grid_sampled_from_a_box_keeps_its_field_on_the_drum():
    boxed = Conductors([DRUM, TUBE, WIRE], BOX)
    grid = Grid.sample(boxed, *BOX, (301, 301), drum_radius=R1)
    ring = circle(R1, ROUND)
    assert np.abs(grid(ring) - boxed(ring)).max() < 1e-3 * np.abs(boxed(ring)).max()


# ---- hard places and bad input -------------------------------------------------------------------------------------


@pytest.mark.parametrize("box", [None, BOX])
def test_on_axes_surfaces_corners_and_far_away_the_field_is_finite(box):
    field = Conductors([DRUM, TUBE, WIRE], box)
    centers = [(*c.center, 0.0) for c in field.cylinders]
    rims = [(c.center[0] + c.radius, c.center[1], 0.0) for c in field.cylinders]
    corners = [(*BOX[0], 0.0), (*BOX[1], 0.0), (BOX[0][0], BOX[1][1], 0.0)]
    points = [*centers, *rims, *corners, (1e3, -1e3, 0.0)]
    assert np.isfinite(field(points)).all()
    assert np.isfinite(field.potential(points)).all()
    for cylinder in field.cylinders:  # inside: the field of the nearest point of the surface
        surface = at(cylinder.center[0], cylinder.center[1] + cylinder.radius)
        inside = at(cylinder.center[0], cylinder.center[1] + 0.5 * cylinder.radius)
        assert field(inside) == pytest.approx(field(surface), rel=1e-9, abs=1e-6)
    assert field.inside_conductors(centers).all()


@pytest.mark.parametrize(
    ("cylinders", "box", "words"),
    [
        ([], None, "cylinders are 0, must be 1 to"),
        ([DRUM, Cylinder((0.1, 0.0), 0.01)], None, r"cylinders\[1\] overlaps cylinders\[0\] by 0.07 m"),
        ([DRUM, {"center": (0.3, 0.0)}], None, r"cylinders\[1\] must have center"),
        ([DRUM, Cylinder((0.3, math.nan), 0.01)], None, r"cylinders\[1\].center\[1\] is nan"),
        ([DRUM, Cylinder((0.3, 0.0), "1 kV")], None, r"cylinders\[1\].radius is '1 kV'"),
        ([DRUM, TUBE], ((-0.1, -0.4), (0.5, 0.5)), r"cylinders\[0\] reaches 0.06 m beyond the enclosure"),
        ([DRUM, TUBE], ((0.5, -0.4), (-0.5, 0.5)), "enclosure is -1 m wide"),
        ([DRUM, TUBE], (1.0, 2.0), "enclosure must be"),
    ],
)
def test_impossible_conductors_are_refused(cylinders, box, words):
    with pytest.raises(InputError, match=words):
        Conductors(cylinders, box)


def test_conductors_whose_field_is_found_too_poorly_are_refused(monkeypatch):
    monkeypatch.setattr("cesim.fields.conductors.POORLY_SOLVED", 1e-30)
    with pytest.raises(InputError, match="too near to each other: the potential is found to"):
        Conductors([DRUM, TUBE])
