"""The finite elements themselves: meshes that follow their outlines, closed forms in two and three dimensions.

Sources: docs/physics.md 1.1 and 1.3; J. D. Jackson, Classical Electrodynamics, 3rd ed., Wiley 1999, section 4.4
(dielectric bodies in a uniform field); W. R. Smythe, J. Appl. Phys. 33 (1962) 2966 (charged right circular cylinder).
"""

import math

import numpy as np
import pytest
import scipy.sparse as sparse
from scenes import R1, R2, TILT, L

import cesim

pytest.importorskip("skfem", reason="needs the extra fem: scikit-fem and pyamg")
pytest.importorskip("pyamg", reason="needs the extra fem: scikit-fem and pyamg")

from cesim.fem import Box, Conductor, Cylinder, Machine, Slab
from cesim.fem.curves import Circle, Polygon
from cesim.fem.mesh import Grading, build
from cesim.fem.problem import solve_units
from cesim.fem.sample import in_plane, on_line, slopes_in_plane
from cesim.fem.solve import Line, Plane, solve_by_gradients, solve_directly

ELECTRODE = (L * math.cos(TILT), L * math.sin(TILT))
DRUM = Conductor(0.0, 0.0, R1, 0.3, "drum")
TUBE = Conductor(*ELECTRODE, R2, 0.3, "electrode")
WIRE = Conductor(0.09, 0.2, 1e-4, 0.3, "wire")
ROOM = Box(-0.5, 0.5, -0.45, 0.55, 0.9)


def grading(n):
    return Grading(n, 4.0 / n, max(n / 5.0, 1.5))


def outside(n, radius=0.4, clearance=1e-3, parts=(DRUM, TUBE)):
    """Points around the conductors, no nearer to them than the clearance: (n, 2)."""
    points = np.random.default_rng(1).uniform(-radius, radius, (20 * n, 2))
    free = np.ones(len(points), bool)
    for part in parts:
        free &= part.curve.signed(points) > clearance
    return points[free][:n]


def flat(points):
    return np.column_stack([points, np.zeros(len(points))])


# ---- meshes --------------------------------------------------------------------------------------------------------


def test_elements_follow_every_outline_and_fill_the_room():
    """Drum, tube, a wire a thousand times thinner, a tilted plate, a lining cut off at the wall."""
    plate = Slab(-0.3, 0.3, 0.25, 0.01, 4.0, tilt=-0.2)
    lining = Slab(0.0, -0.45, 3.0, 0.1, 3.0)
    machine = Machine((DRUM, TUBE, WIRE), (plate, lining), ROOM)
    machine.check()
    hollow = [conductor.curve for conductor in machine.conductors]
    mesh = build([*hollow, plate.curve, lining.curve], ROOM.curve, grading(12), hollow)
    edges = np.sort(np.concatenate([mesh.triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=1)
    n = len(mesh.points)
    outlines = np.sort(mesh.segments, axis=1)
    assert np.isin(outlines[:, 0] * n + outlines[:, 1], edges[:, 0] * n + edges[:, 1]).all()
    plane = Plane(mesh)
    area = plane.basis.dx.sum(axis=1)
    assert area.sum() == pytest.approx(1.0 - math.pi * (R1**2 + R2**2 + 1e-8), rel=1e-6)
    assert area[mesh.inside(plate.curve)].sum() == pytest.approx(0.25 * 0.01, rel=1e-12)
    assert area[mesh.inside(mesh.curves[4])].sum() == pytest.approx(0.05, rel=1e-12)
    a, b, c = mesh.points[mesh.triangles].transpose(1, 0, 2)
    sides = sum(((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a)))
    assert (4.0 * math.sqrt(3.0) * area / sides).min() > 0.25  # 1: equilateral


def test_sampling_meets_a_quadratic_and_its_slope_in_curved_elements_too():
    hollow = [DRUM.curve]
    plane = Plane(build([*hollow, Circle(0.25, 0.2, 0.05)], ROOM.curve, grading(6), hollow))
    x, y = plane.nodes.T
    points = outside(4000, 0.44, 0.0, (DRUM,))
    a, b = points.T
    matrix, found = in_plane(plane, points)
    assert found.all()
    along = np.array([m @ (1.0 + 2.0 * x - y) for m in slopes_in_plane(plane, points)])
    assert matrix @ (1.0 + 2.0 * x - y) == pytest.approx(1.0 + 2.0 * a - b, abs=1e-12)  # linear: exactly
    assert along == pytest.approx(np.array([[2.0], [-1.0]]) * np.ones(len(a)), abs=1e-9)
    error = matrix @ (x * x - x * y) - (a * a - a * b)  # quadratic: exactly where the sides are straight
    assert np.sort(np.abs(error))[: len(error) // 2].max() < 1e-13
    assert np.abs(error).max() < 1e-4
    line = Line(np.array([0.0, 0.1, 0.4, 0.5]))
    z = np.array([-0.45, 0.0, 0.07, 0.3, 0.5])
    value, slope = on_line(line, z)
    assert value @ line.nodes**2 == pytest.approx(z**2, abs=1e-15)
    assert slope @ line.nodes**2 == pytest.approx(2.0 * z, abs=1e-14)


@pytest.mark.parametrize(
    ("machine", "text"),
    [
        (Machine(()), "needs a conductor"),
        (Machine((DRUM, Conductor(0.17, 0.0, 0.02, name="tube"))), "tube touches drum"),
        (Machine((DRUM, Conductor(0.1, 0.0, 0.02, name="tube"))), "tube touches drum"),
        (Machine((DRUM,), (Slab(0.2, 0.0, 0.1, 0.1, 3.0),)), "touches drum"),
        (Machine((DRUM,), (Cylinder(0.1, 0.0, 0.02, 3.0),)), "lies inside drum"),
        (Machine((DRUM, TUBE), (), Box(-0.2, 0.2, -0.2, 0.2)), "electrode is not inside the enclosure"),
        (Machine((DRUM,), (Cylinder(0.5, 0.0, 0.02, 3.0),), ROOM), "is not inside the enclosure"),
        (Machine((DRUM,), (), Box(-0.5, 0.5, -0.5, 0.5, 0.3)), "must be above the length of the conductors"),
    ],
)
def test_parts_that_cannot_stand_together_are_refused(machine, text):
    with pytest.raises(cesim.InputError, match=text):
        machine.check()


# ---- two dimensions ------------------------------------------------------------------------------------------------


def test_two_cylinders_are_met_at_third_order_in_the_potential_and_second_in_the_field():
    """The closed form of docs/physics.md 1.1, with free space around: quadratic elements."""
    exact = cesim.fields.TwoCylinders(R1, R2, L, TILT, 1.0)
    points = outside(1500)
    errors, sizes = [], []
    for n in (6, 12, 24):
        units = solve_units(Machine((DRUM, TUBE)), 2, n)
        sizes.append(units.unknowns**-0.5)
        values, found = units.sample(points, np.zeros(1))
        assert found.all()
        field = units.field(points, np.zeros(1))[1, :, 0]
        true = exact(flat(points))
        difference = np.sqrt(((field - true) ** 2).sum() / (true**2).sum())
        errors.append((np.sqrt(((values[1, :, 0] - exact.potential(flat(points))) ** 2).mean()), difference))
        charge = 2.0 * math.pi / math.acosh((L**2 - R1**2 - R2**2) / (2.0 * R1 * R2))
        assert units.capacitance[1] == pytest.approx([-charge, charge], rel=0.02 / n**2)
    errors = np.array(errors)
    order = np.log(errors[0] / errors[-1]) / math.log(sizes[0] / sizes[-1])
    assert errors[-1, 0] < 1e-5
    assert errors[-1, 1] < 2e-3
    assert order == pytest.approx([2.8, 1.8], abs=0.3)


def solved(parts, permittivity, exact, n, hollow=()):
    """A room whose walls are at the potential of a closed form: the plane and the values at its nodes."""
    mesh = build(parts, ROOM.curve, grading(n), hollow)
    plane = Plane(mesh)
    weight = np.ones(len(mesh.triangles))
    weight[mesh.inside(mesh.curves[0])] = permittivity
    known = plane.on_rim()
    given = np.where(known, exact(plane.nodes), 0.0)[None]
    return plane, solve_directly(plane.matrices(weight)[0], known, given)[0]


def test_a_dielectric_cylinder_in_a_uniform_field_weakens_it_inside_and_bends_it_outside():
    """Jackson 4.4 in two dimensions: inside E = 2 E0/(k + 1), outside a line dipole (k - 1)/(k + 1) E0 a^2."""
    a, k = 0.08, 5.0

    def exact(points):
        x, r2 = points[:, 0], (points**2).sum(axis=1)
        return np.where(r2 <= a * a, -2.0 * x / (k + 1.0), -x * (1.0 - (k - 1.0) / (k + 1.0) * a * a / r2))

    plane, values = solved([Circle(0.0, 0.0, a)], k, exact, 16)
    points = np.random.default_rng(2).uniform(-0.2, 0.2, (2000, 2))
    matrix, found = in_plane(plane, points)
    assert found.all()
    assert matrix @ values == pytest.approx(exact(points), abs=2e-5)
    inside = points[(points**2).sum(axis=1) < 0.9 * a * a]
    along_x, along_y = slopes_in_plane(plane, inside)
    assert -(along_x @ values) == pytest.approx(2.0 / (k + 1.0) * np.ones(len(inside)), rel=2e-3)
    assert along_y @ values == pytest.approx(np.zeros(len(inside)), abs=2e-3)


def test_a_dielectric_slab_across_the_room_takes_its_share_of_the_voltage():
    """Plates at 0 and 1 V with a slab of permittivity 4: E is constant in each layer, 4 times less in the slab."""
    low, high, k = -0.10, 0.02, 4.0

    def exact(points):
        y = points[:, 1] + 0.45
        thickness = np.clip(points[:, 1], low, high) - low
        return (y - (1.0 - 1.0 / k) * thickness) / (1.0 - (1.0 - 1.0 / k) * (high - low))

    slab = Slab(0.0, 0.5 * (low + high), 4.0, high - low, k)
    plane, values = solved([slab.curve], k, exact, 6)
    assert values == pytest.approx(exact(plane.nodes), abs=1e-10)


def test_a_tilted_slab_keeps_the_tangential_field_and_divides_the_normal_one():
    """The refraction law tan(beta) = k tan(alpha), in a slab that ends at the walls at an angle."""
    k, tilt = 3.0, 0.3
    normal = np.array([-math.sin(tilt), math.cos(tilt)])
    half = 0.05

    def exact(points):
        depth = points @ normal
        return -points[:, 0] - 0.5 * depth + (1.0 - 1.0 / k) * (0.5 + normal[0]) * np.clip(depth, -half, half)

    # Outside the field is e_x + n/2, its normal part n_x + 1/2, of which the slab leaves a k-th.
    plane, values = solved([Slab(0.0, 0.0, 4.0, 2.0 * half, k, tilt).curve], k, exact, 6)
    assert values == pytest.approx(exact(plane.nodes), abs=1e-10)


def test_an_insulated_wire_has_the_charge_of_two_layers_in_series():
    """Coaxial: 2 pi/(ln(b/a)/k + ln(c/b)) per metre, over epsilon_0."""
    a, b, c, k = 0.002, 0.01, 0.15, 4.0
    mesh = build([Circle(0, 0, a), Circle(0, 0, b)], Circle(0, 0, c), grading(12), [Circle(0, 0, a)])
    plane = Plane(mesh)
    weight = np.where(mesh.inside(mesh.curves[1]), k, 1.0)
    matrix = plane.matrices(weight)[0]
    wire = plane.within(mesh.curves[0])
    values = solve_directly(matrix, wire | plane.on_rim(), wire.astype(float)[None])[0]
    assert values @ (matrix @ values) == pytest.approx(2 * math.pi / (math.log(b / a) / k + math.log(c / b)), rel=1e-4)


# ---- three dimensions ----------------------------------------------------------------------------------------------


def test_endless_conductors_in_three_dimensions_are_those_of_two():
    """The Kronecker products: nothing depends on z, so both must agree to the tolerance of the iteration."""
    room = Box(ROOM.left, ROOM.right, ROOM.bottom, ROOM.top)
    machine = Machine((Conductor(0.0, 0.0, R1), Conductor(*ELECTRODE, R2)), (Slab(-0.3, 0.3, 0.2, 0.03, 4.0),), room)
    points = outside(300)
    two, _ = solve_units(machine, 2, 5).sample(points, np.zeros(1))
    three, _ = solve_units(machine, 3, 5).sample(points, np.array([0.0, 0.05, -0.2]))
    assert three == pytest.approx(np.broadcast_to(two, three.shape), abs=1e-8)


def test_a_dielectric_that_ends_is_there_up_to_its_end():
    """Layers along z: a slab of full width, half as long as the room, against none and one throughout."""
    room = Box(-0.2, 0.2, -0.2, 0.2, 0.4)
    wire = (Conductor(0.0, 0.05, 0.02, 0.2),)

    def energy(length, permittivity=6.0):
        return solve_units(Machine(wire, (Slab(0.0, -0.1, 1.0, 0.1, permittivity, length=length),), room), 3, 5)

    none, half, full = (energy(*a).capacitance[0, 0] for a in ((0.4, 1.0), (0.1,), (math.inf,)))
    assert none < half < full
    assert half - none > 0.2 * (full - none)


def test_a_harmonic_function_in_the_room_is_met_at_third_order():
    """The potential of a point charge inside the drum, given on all walls, the drum's ends among them."""
    source = np.array([0.05, 0.02, 0.0])
    errors = []
    for n in (4, 8):
        mesh = build([DRUM.curve], ROOM.curve, grading(n))
        plane, line = (
            Plane(mesh),
            Line(np.unique(np.concatenate([np.linspace(0, 0.15, n), np.linspace(0.15, 0.45, n)]))),
        )
        x = np.repeat(plane.nodes, len(line.nodes), axis=0)
        z = np.tile(line.nodes, len(plane.nodes))
        exact = 0.1 / np.sqrt((x[:, 0] - source[0]) ** 2 + (x[:, 1] - source[1]) ** 2 + z**2 + 1e-300)
        inside = (np.hypot(*x.T) < R1 * (1 + 1e-9)) & (z <= 0.15 + 1e-9)
        known = inside | (np.repeat(plane.on_rim(), len(line.nodes))) | (z >= 0.45 - 1e-9)
        ones = np.ones(len(mesh.triangles))
        stiff, mass = plane.matrices(ones)
        stiff_z, mass_z = line.matrices(np.ones(len(line.ends) - 1))
        matrix = sparse.csr_matrix(sparse.kron(stiff, mass_z) + sparse.kron(mass, stiff_z))
        linear = sparse.csr_matrix(sparse.kron(plane.linear(), line.linear()))
        given = np.where(known, exact, 0.0)[None]
        values, _ = solve_by_gradients(matrix, linear, known, given, lambda: None)
        errors.append(np.sqrt(((values[0] - exact)[~known] ** 2).mean()))
    assert errors[1] < 1e-4
    assert math.log2(errors[0] / errors[1]) > 2.3


def test_a_free_cylinder_with_flat_ends_has_smythes_capacitance():
    """C = epsilon_0 a [8 + 6.95 (b/a)^0.76] for a cylinder of radius a and length 2 b, within 0.2 %: Smythe 1962."""
    for b in (0.5, 1.0, 2.0):
        units = solve_units(Machine((Conductor(0.0, 0.0, 0.1, 0.2 * b),)), 3, 6)
        assert units.capacitance[0, 0] == pytest.approx(0.1 * (8.0 + 6.95 * b**0.76), rel=0.008)


def test_the_field_of_the_middle_is_two_dimensional_up_to_a_gap_from_the_ends_and_dies_beyond_them():
    """docs/physics.md 4, end effect: two dimensions do for abs(z) < w/2 - gap."""
    machine = Machine((DRUM, TUBE), (), ROOM)
    facing = (R1 + 0.02) * np.array([[math.cos(TILT), math.sin(TILT)]])
    two = solve_units(machine, 2, 8).field(facing, np.zeros(1))[1, 0, 0]
    z = np.array([0.0, 0.15 - 0.088, 0.15, 0.2, 0.25, 0.3])
    three = solve_units(machine, 3, 8).field(facing, z)[1, 0]
    strength = np.linalg.norm(three, axis=1) / np.linalg.norm(two)
    assert strength[:2] == pytest.approx([1.0, 1.0], abs=0.05)
    assert (np.diff(strength[2:]) < 0.0).all()
    assert strength[-1] < 0.1


def test_polygons_are_cut_off_at_the_room():
    room = ROOM.curve
    assert Slab(2.0, 0.0, 0.1, 0.1, 2.0).curve.clipped(room) is None
    corner = Polygon(np.array([[0.3, 0.4], [0.7, 0.4], [0.7, 0.7], [0.3, 0.7]])).clipped(room)
    assert np.ptp(corner.corners, axis=0) == pytest.approx([0.2, 0.15])
