"""Mass properties of unions of balls and of the bodies that shapes describe, against closed forms and counting."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cesim.shapes import bodies, packing, polyhedra, union

# ---- unions of balls -------------------------------------------------------------------------------------------------


def union_of(*spheres):
    return union.of_balls(np.array(spheres, dtype=float))


def lens(r, s, d):
    """Volume that two balls share."""
    return math.pi * (r + s - d) ** 2 * (d * d + 2 * d * (r + s) - 3 * (r - s) ** 2) / (12 * d)


def test_one_ball_wherever_it_is():
    found = union_of((1, -2, 3, 0.5))
    assert found.mass.volume == pytest.approx(math.pi / 6, rel=1e-13)
    assert found.mass.center == pytest.approx([1, -2, 3], abs=1e-13)
    assert found.mass.unit_inertia == pytest.approx(0.1 * np.eye(3), abs=1e-13)
    assert found.area == pytest.approx(math.pi, rel=1e-13)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 0, 1), (0.6, 0.48, 0.64), (1e-9, 0, 1)], ids=str)
@pytest.mark.parametrize("r", [1.0, 0.7, 0.3])
def test_two_overlapping_balls_are_both_less_the_lens(axis, r):
    distance = 0.9
    axis = np.array(axis) / np.linalg.norm(axis)
    found = union_of((0, 0, 0, 1), (*(distance * axis), r))
    assert found.error < 1e-9
    assert found.mass.volume == pytest.approx(4 / 3 * math.pi * (1 + r**3) - lens(1, r, distance), rel=1e-11)
    # the sphere's part above z = h has area 2 pi r (r - h)
    height = (distance**2 + 1 - r * r) / (2 * distance)
    other = distance - height
    assert found.area == pytest.approx(2 * math.pi * (1 + height) + 2 * math.pi * r * (r + other), rel=1e-11)
    # second moment along the axis, by slices of a body of revolution
    z, w = np.polynomial.legendre.leggauss(60)
    parts = [(-1.0, height, 0.0, 1.0), (height, distance + r, distance, r)]
    slices = [
        (0.5 * (b - a) * w * math.pi * (s**2 - (x - c) ** 2), x)
        for a, b, c, s in parts
        for x in [0.5 * (a + b) + 0.5 * (b - a) * z]
    ]
    volume = sum(dv.sum() for dv, _ in slices)
    center = sum((dv * x).sum() for dv, x in slices) / volume
    along = sum((dv * (x - center) ** 2).sum() for dv, x in slices)
    assert axis @ found.mass.center == pytest.approx(center, abs=1e-11)
    assert axis @ found.mass.second @ axis == pytest.approx(along, rel=1e-10)


def test_balls_that_touch_or_stand_apart_add_up():
    centers = [(0, 0, 0), (2, 0, 0), (4, 0, 0), (0, 7, 1)]
    found = union_of(*((*c, 1) for c in centers))
    assert found.mass.volume == pytest.approx(4 * 4 / 3 * math.pi, rel=1e-12)
    assert found.mass.center == pytest.approx(np.mean(centers, axis=0), abs=1e-12)
    about = np.array(centers) - np.mean(centers, axis=0)
    second = 4 / 3 * math.pi * (about.T @ about + 4 * 0.2 * np.eye(3))
    assert found.mass.second == pytest.approx(second, abs=1e-11)


def test_what_is_hidden_or_repeated_counts_once():
    spheres = [(0, 0, 0, 1), (0, 0, 1, 1), (0.5, 0, 2, 0.8)]
    once = union_of(*spheres)
    more = union_of(*spheres, *spheres, (0, 0, 0, 0.3), (1e-13, 0, 0, 1), (0, 0, 0.5, 0.5))
    assert more.mass.volume == pytest.approx(once.mass.volume, rel=1e-10)
    assert more.mass.second == pytest.approx(once.mass.second, abs=1e-9)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(1, 12))
def test_a_union_does_not_depend_on_its_attitude_within_its_stated_error(seed, n):
    rng = np.random.default_rng(seed)
    spheres = np.column_stack([rng.normal(size=(n, 3)), rng.uniform(0.2, 1.0, n)])
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turned = np.column_stack([spheres[:, :3] @ rotation.T, spheres[:, 3]])
    one, other = union.of_balls(spheres), union.of_balls(turned)
    allowed = 2 * (one.error + other.error) + 1e-13
    assert other.mass.volume == pytest.approx(one.mass.volume, rel=allowed)
    assert other.area == pytest.approx(one.area, rel=allowed)
    back = rotation.T @ other.mass.second @ rotation
    assert np.abs(back - one.mass.second).max() < allowed * np.trace(one.mass.second)
    assert max(one.error, other.error) < 1e-6


def test_a_crowded_union_agrees_with_monte_carlo():
    rng = np.random.default_rng(5)
    spheres = np.column_stack([0.7 * rng.normal(size=(20, 3)), rng.uniform(0.3, 0.8, 20)])
    points = rng.uniform(-4, 4, size=(1_000_000, 3))
    inside = np.zeros(len(points), bool)
    for *center, radius in spheres:
        inside |= ((points - center) ** 2).sum(axis=1) < radius**2
    hits, found = points[inside], union.of_balls(spheres).mass
    share = inside.mean()
    assert found.volume == pytest.approx(512 * share, rel=4 / math.sqrt(len(hits)))
    scatter = hits.std(axis=0) / math.sqrt(len(hits))
    assert (np.abs(hits.mean(axis=0) - found.center) < 4 * scatter).all()
    assert np.abs(np.cov(hits.T) - found.second / found.volume).max() < 0.01 * np.trace(found.second / found.volume)


# ---- bodies ----------------------------------------------------------------------------------------------------------

L = polyhedra.Polyhedron(  # an L: not convex
    np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2))], dtype=float),
    np.array(
        [(a, b, c) for a, b, c in ((0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 5, 4))]
        + [(a + 6, b + 6, c + 6) for a, b, c in ((0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5))]
        + [f for i in range(6) for j in [(i + 1) % 6] for f in ((i, j, j + 6), (i, j + 6, i + 6))]
    ),
)
BODIES = {
    "ellipsoid": bodies.Ellipsoid(np.array([3.0, 2.0, 1.0])),
    "cylinder": bodies.Cylinder(1.0, 1.0, 2.0),
    "plate": bodies.Cylinder(2.0, 1.0, 0.5),
    "cone": bodies.Cone(1.0, 2.0),
    "rod": bodies.Tube(0.5, 5.0),
    "helix": bodies.Tube(0.5, 14.0, 1.5, 0.25),
    "hull": polyhedra.convex_hull(np.random.default_rng(1).normal(size=(30, 3))),
    "L": L,
}


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_mass_properties_of_bodies_agree_with_counting_points(body):
    lattice = packing.around(body, 150_000)
    points, cell = lattice.points[body.occupied(lattice)], lattice.step**3
    assert len(points) * cell == pytest.approx(body.mass.volume, rel=3e-3)
    assert np.abs(points.mean(axis=0) - body.mass.center).max() < 2e-3 * body.mass.diameter
    second = np.cov(points.T, bias=True) * len(points) * cell
    assert np.abs(second - body.mass.second).max() < 3e-3 * np.trace(second)


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_depth_area_and_samples_of_the_surface_agree(body):
    from scipy.spatial import cKDTree

    d = body.mass.diameter
    samples, covering = body.surface(d / 150)
    assert covering < d / 150
    lattice = packing.around(body, 300)
    points = lattice.points[body.occupied(lattice)]
    distance = cKDTree(samples).query(points)[0]
    assert (distance - body.depth(points) < 1.01 * covering).all()
    assert (body.depth(points) - distance < body.slack + 1e-9 * d).all()
    # a shell of thickness 2 h around the surface has the volume 2 h area + O(h^2)
    h = 0.02 * d
    low, high = body.lower - h, body.upper + h
    points = np.random.default_rng(2).uniform(low, high, size=(400_000, 3))
    near = (cKDTree(samples).query(points, distance_upper_bound=h)[0] < h).mean()
    assert near * np.prod(high - low) / (2 * h) == pytest.approx(body.area, rel=0.03)


def test_a_coil_of_many_turns_weighs_what_its_length_says():
    body = bodies.Tube(0.5, 40.0, 2.0, 0.3)
    assert body.mass.volume == pytest.approx(math.pi * 0.25 * 40 + math.pi / 6, rel=1e-12)
