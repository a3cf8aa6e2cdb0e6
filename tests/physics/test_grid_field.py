"""A potential on a grid: what a cubic spline promises, and what a grain in it keeps.

Sources: C. de Boor, A Practical Guide to Splines, Springer 1978, chapters IV and IX; docs/physics.md 1.2; the closed
form of two cylinders (docs/physics.md 1.1) as the field that is sampled.
"""

import math

import numpy as np
import pytest
from scenes import OPEN, R1, R2, TILT, VOLTAGE, L

import cesim
from cesim.fields import Grid, TwoCylinders
from cesim.fields.base import circle
from cesim.scene import Scene

EXACT = TwoCylinders(R1, R2, L, TILT, -VOLTAGE)
FACING = circle(R1, np.linspace(0.0, 2.0 * np.pi, 360))
CUBIC = np.random.default_rng(3).normal(size=(4, 4, 4))


def cubic(x, y, z=0.0):
    return np.polynomial.polynomial.polyval3d(x, y, z, CUBIC)


def axes(low, high, counts):
    return [np.linspace(a, b, n) if n > 1 else np.zeros(1) for a, b, n in zip(low, high, counts, strict=True)]


def grid_of(function, low, high, counts, **given):
    lines = axes(low, high, counts)
    spacing = [line[1] - line[0] if len(line) > 1 else 1.0 for line in lines]
    return Grid(low, spacing, function(*np.meshgrid(*lines, indexing="ij")), **given)


@pytest.mark.parametrize("counts", [(4, 4, 1), (5, 9, 1), (4, 5, 6), (12, 7, 4)])
def test_a_cubic_in_each_coordinate_is_met_exactly_in_value_and_gradient(counts):
    low, high = (-0.3, 0.1, -0.2), (0.5, 0.6, 0.4)
    grid = grid_of(cubic, low, high, counts)
    points = np.random.default_rng(1).uniform(low, high, (200, 3))
    z = points[:, 2] if counts[2] > 1 else np.zeros(200)
    assert grid.potential(points) == pytest.approx(cubic(points[:, 0], points[:, 1], z), abs=1e-12)
    dx = np.polynomial.polynomial.polyder(CUBIC, axis=0)
    slope = np.polynomial.polynomial.polyval3d(points[:, 0], points[:, 1], z, dx)
    assert grid(points)[:, 0] == pytest.approx(-slope, abs=1e-11)


def test_the_field_is_the_gradient_of_the_potential_and_has_no_curl():
    grid = Grid.sample(EXACT, (0.0, -0.3), (0.5, 0.5), (60, 90))
    points = np.random.default_rng(2).uniform((0.02, -0.28, 0.0), (0.48, 0.48, 0.0), (100, 3))
    h = 1e-6
    steps = h * np.eye(3)
    numeric = np.stack([(grid.potential(points - s) - grid.potential(points + s)) / (2.0 * h) for s in steps], axis=1)
    scale = np.linalg.norm(grid(points), axis=1).max()
    assert np.abs(grid(points) - numeric).max() < 1e-6 * scale


def smooth(x, y, z=0.0):
    return np.exp(3.0 * x) * np.cos(3.0 * y) + 0.0 * z


def field_error(n, margin=0.2):
    grid = grid_of(smooth, (0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (n, n, 1))
    points = np.random.default_rng(4).uniform((margin, margin, 0), (1 - margin, 1 - margin, 0), (2000, 3))
    x, y = points[:, 0], points[:, 1]
    exact = 3.0 * np.exp(3.0 * x[:, None]) * np.stack([-np.cos(3.0 * y), np.sin(3.0 * y), 0.0 * x], axis=1)
    return np.sqrt(np.mean((grid(points) - exact) ** 2)), np.sqrt(np.mean(exact**2)), grid


def test_the_field_converges_with_the_third_power_of_the_spacing():
    errors = [field_error(n)[0] for n in (11, 21, 41)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([3.0, 3.0], abs=0.25)


def test_the_error_against_every_second_node_is_about_eight_times_the_error():
    error, scale, grid = field_error(41, margin=0.0)
    assert 4.0 < grid.interpolation_error / (error / scale) < 14.0


def test_sampling_measures_the_error_against_the_source():
    grid = Grid.sample(EXACT, (-0.1, 0.17), (0.15, 0.3), (60, 60))
    points = np.random.default_rng(5).uniform((-0.1, 0.17, 0), (0.15, 0.3, 0), (1000, 3))
    direct = np.sqrt(np.mean((grid(points) - EXACT(points)) ** 2) / np.mean(EXACT(points) ** 2))
    assert grid.interpolation_error == pytest.approx(direct, rel=0.5)
    assert grid.interpolation_error < 1e-5


def test_the_field_on_the_drum_is_right_though_the_file_has_zero_inside_it():
    """Kelvin's inversion continues the potential; without it the kink takes half of the field away."""
    grid = Grid.sample(EXACT, (-0.3, -0.3), (0.5, 0.5), (161, 161), drum_radius=R1)
    strongest = np.linalg.norm(EXACT(FACING), axis=1).max()
    assert np.abs(grid(FACING) - EXACT(FACING)).max() < 1e-4 * strongest
    kinked = Grid(grid.origin, grid.spacing, EXACT.potential(grid.nodes().reshape(-1, 3)).reshape(161, 161))
    assert np.abs(kinked(FACING) - EXACT(FACING)).max() > 0.3 * strongest


def test_a_potential_counted_from_elsewhere_gives_the_same_field_on_the_drum():
    values = EXACT.potential(Grid.sample(EXACT, (-0.3, -0.3), (0.5, 0.5), (81, 81)).nodes().reshape(-1, 3))
    fields = [
        Grid((-0.3, -0.3), (0.01, 0.01), (values + shift).reshape(81, 81), drum_radius=R1)(FACING)
        for shift in (0.0, 5e3)
    ]
    assert fields[0] == pytest.approx(fields[1], abs=1e-3)


def test_the_integral_of_the_field_across_the_gap_is_the_voltage():
    grid = Grid.sample(EXACT, (-0.2, -0.2), (0.4, 0.4), (241, 241), drum_radius=R1)
    u, w = np.polynomial.legendre.leggauss(200)
    length = L - R2 - 0.004 - R1  # to where a cell of the grid no longer touches the electrode
    radius = R1 + 0.5 * length * (u + 1.0)
    direction = np.array([math.cos(TILT), math.sin(TILT), 0.0])
    across = 0.5 * length * w @ (grid(radius[:, None] * direction) @ direction)
    end = EXACT.potential([(R1 + length) * direction])[0]
    assert across == pytest.approx(-end, rel=1e-3)


def test_beyond_the_grid_the_potential_is_that_of_its_border_and_the_points_are_known():
    grid = grid_of(cubic, (0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (9, 9, 1))
    inside, outside = [[1.0, 0.4, 0.0]], [[5.0, 0.4, 7.0]]
    assert grid.potential(outside) == pytest.approx(grid.potential(inside), abs=1e-12)
    assert grid(outside)[0, 0] == 0.0
    assert grid(outside)[0, 1] == pytest.approx(grid(inside)[0, 1])
    assert grid.outside([*inside, *outside]).tolist() == [False, True]


@pytest.mark.parametrize("step", [1e-3, 5e-4])
def test_a_charged_grain_in_the_field_of_a_grid_gains_no_energy(step):
    """A saddle of a potential with walls of its own: the grain comes and goes for 5 s, and its energy stays."""
    grid = grid_of(
        lambda x, y, z: 2e3 * ((x / 0.1) ** 4 + (y / 0.1) ** 2 + x * y / 0.02) + 0.0 * z,
        (-0.2, -0.2, 0.0),
        (0.2, 0.2, 0.0),
        (81, 81, 1),
    )
    effects = {"gravity": "off", "drag": "off", "electric_force": "on"}
    scene = Scene(field=grid, effects=effects, bounds=OPEN, numerics={"step": step})
    sim = cesim.Simulation(scene, threads=1)
    charge = 1e-9
    sim.add([[0.05, 0.02, 0.0]], material="copper", diameter=1e-3, charge=charge)

    def energy():
        kinetic = 0.5 * sim.mass[0] * (sim.velocity[0] ** 2).sum()
        return kinetic + charge * grid.potential(sim.position)[0]

    deepest = charge * grid.potential([[0.0, 0.0, 0.0]])[0]
    start, worst = energy(), 0.0
    for _ in range(50):
        sim.step(round(0.1 / step))
        worst = max(worst, abs(energy() - start))
    assert worst < 20.0 * step * abs(start - deepest)
    assert abs(energy() - start) < 20.0 * step * abs(start - deepest)
