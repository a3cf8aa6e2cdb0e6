"""Convex bodies: distance, depth and normal against closed forms and an independent method, contact points, paths."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from cesim import engine

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
CUBE = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
FLOOR = ("plane", (0.0, 0.0, 0.0), UPRIGHT, (0.0, 0.0, 0.0))


# ---- bodies, and the same answers in another way ---------------------------------------------------------------------


def body(vertices, position=(0.0, 0.0, 0.0), orientation=UPRIGHT, scale=1.0, rounding=0.0):
    return (np.asarray(vertices, dtype=float), tuple(position), tuple(orientation), scale, rounding)


def box(edges, position=(0.0, 0.0, 0.0), orientation=UPRIGHT, scale=1.0):
    return body(CUBE * np.asarray(edges, dtype=float), position, orientation, scale)


def ball(radius, position=(0.0, 0.0, 0.0)):
    return body(np.zeros((1, 3)), position, UPRIGHT, 1.0, radius)


def prism(corners, radius, length):
    """A cylinder along z as the hull of its rims, a corner of it at the bottom (-y)."""
    angle = 2.0 * math.pi * np.arange(corners) / corners - 0.5 * math.pi
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return np.vstack([np.column_stack([rim, np.full(corners, z)]) for z in (-0.5 * length, 0.5 * length)])


def turned(axis, angle):
    axis = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    return (math.cos(0.5 * angle), *(math.sin(0.5 * angle) * axis))


def matrix_of(orientation):
    w, x, y, z = orientation
    return Rotation.from_quat([x, y, z, w])


def world(shape):
    vertices, position, orientation, scale, _ = shape
    return scale * matrix_of(orientation).apply(vertices) + np.asarray(position)


def moved(shape, rotation=None, shift=(0.0, 0.0, 0.0), factor=1.0):
    vertices, position, orientation, scale, rounding = shape
    if rotation is None:
        rotation = Rotation.identity()
    x, y, z, w = (rotation * matrix_of(orientation)).as_quat()
    place = factor * (rotation.apply(position) + np.asarray(shift))
    return (vertices, tuple(place), (w, x, y, z), factor * scale, factor * rounding)


def random_hull(rng, count, aspect=0.3):
    vertices = rng.normal(size=(count, 3))
    vertices *= 0.5 * rng.uniform(aspect, 1.0, 3) / np.linalg.norm(vertices, axis=1)[:, None]
    vertices = vertices[ConvexHull(vertices).vertices]
    return vertices - vertices.mean(axis=0)


def random_body(rng, spread, **rest):
    q = rng.normal(size=4)
    return body(random_hull(rng, rng.integers(6, 30), **rest), spread * rng.normal(size=3), q / np.linalg.norm(q))


def difference(a, b):
    points = (world(b)[:, None] - world(a)[None]).reshape(-1, 3)
    return ConvexHull(points)


def depth_by_brute_force(a, b):
    """Signed distance of the origin to the nearest face plane of the Minkowski difference: negative inside."""
    return difference(a, b).equations[:, 3].max()


def nearest_on_triangles(triangles):
    """Distance of the origin to each of (n, 3, 3) triangles: plane, edges, corners, all by formula."""
    p, q, r = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(q - p, r - p)
    unit = normal / np.linalg.norm(normal, axis=1)[:, None]
    height = np.einsum("ij,ij->i", p, unit)
    foot = height[:, None] * unit
    inside = np.ones(len(p), dtype=bool)
    best = np.full(len(p), np.inf)
    for start, end in ((p, q), (q, r), (r, p)):
        edge = end - start
        inside &= np.einsum("ij,ij->i", np.cross(edge, foot - start), unit) >= 0.0
        t = np.clip(-np.einsum("ij,ij->i", start, edge) / np.einsum("ij,ij->i", edge, edge), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(start + t[:, None] * edge, axis=1))
    return np.where(inside, np.abs(height), best)


def distance_by_brute_force(a, b):
    hull = difference(a, b)
    return nearest_on_triangles(hull.points[hull.simplices]).min()


def assert_consistent(a, b, tolerance=1e-12):
    """Gap, normal and points of one answer belong together, whatever the right gap is; gives gap and normal."""
    gap, normal, point_a, point_b = engine.convex_distance(a, b)
    normal = np.array(normal)
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(np.array(point_a) - point_b, gap * normal, atol=tolerance)
    between = (world(a) @ normal).min() - a[4] - (world(b) @ normal).max() - b[4]
    assert gap == pytest.approx(between, abs=tolerance)
    return gap, normal


# ---- distance --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [0.5, 1e-6, 0.0, -0.1, -1.2])
def test_balls_are_apart_by_their_centres_less_their_radii(gap):
    direction = np.array([0.36, -0.48, 0.8])
    found, normal, point_a, point_b = engine.convex_distance(ball(1.0, (3.0 + gap) * direction), ball(2.0))
    assert found == pytest.approx(gap, abs=1e-15)
    np.testing.assert_allclose(normal, direction, atol=1e-15)
    np.testing.assert_allclose(point_b, 2.0 * direction, atol=1e-15)
    np.testing.assert_allclose(point_a, (2.0 + gap) * direction, atol=1e-15)


@pytest.mark.parametrize(
    ("center", "gap", "normal"),
    [
        ((0.1, 0.9, -0.2), 0.3, (0.0, 1.0, 0.0)),  # before a face
        ((0.1, 0.8, 0.9), 0.5 - 0.1, (0.0, 0.6, 0.8)),  # before an edge
        ((-1.1, 0.8, 1.1), math.sqrt(0.81) - 0.1, (-2.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0)),  # before a corner
        ((0.4, 0.05, 0.0), -0.1 - 0.1, (1.0, 0.0, 0.0)),  # inside
        ((0.1, 0.55, 0.0), 0.05 - 0.1, (0.0, 1.0, 0.0)),  # its centre outside, overlapping
    ],
)
def test_a_ball_before_a_cube(center, gap, normal):
    found, n, *_ = engine.convex_distance(ball(0.1, center), box((1.0, 1.0, 1.0)))
    assert found == pytest.approx(gap, abs=1e-14)
    np.testing.assert_allclose(n, normal, atol=1e-13)


@pytest.mark.parametrize("seed", range(5))
def test_cubes_meet_face_edge_and_corner_first_however_the_pair_is_turned(seed):
    rng = np.random.default_rng(seed)
    rotation, shift = Rotation.random(random_state=seed), rng.normal(size=3)
    eighth = math.pi / 4.0
    on_corner = Rotation.align_vectors([[0.0, -1.0, 0.0]], [[1.0, 1.0, 1.0]])[0].as_quat()
    cases = [
        (box((1, 1, 1), (0.3, 1.2, -0.4)), 0.2),
        (box((1, 1, 1), (0.2, 0.5 + math.sqrt(0.5) + 0.1, 0.1), turned((0, 0, 1), eighth)), 0.1),
        (box((1, 1, 1), (0.1, 0.5 + math.sqrt(0.75) + 0.1, 0.1), (on_corner[3], *on_corner[:3])), 0.1),
        (box((1, 1, 1), (0.1, 0.4, 0.2)), -0.6),
        (box((1, 1, 1), (0.2, 0.5 + math.sqrt(0.5) - 0.1, 0.1), turned((0, 0, 1), eighth)), -0.1),
    ]
    for other, gap in cases:
        found, normal = assert_consistent(moved(other, rotation, shift), moved(box((1, 1, 1)), rotation, shift))
        assert found == pytest.approx(gap, abs=1e-14)
        np.testing.assert_allclose(normal, rotation.apply((0.0, 1.0, 0.0)), atol=1e-12)


@pytest.mark.parametrize("gap", [0.3, 1e-9, -1e-9, -0.05])
def test_crossing_edges_meet_along_their_common_normal(gap):
    lower = box((1, 1, 4), (0.0, 0.0, 0.0), turned((0, 0, 1), math.pi / 4))
    standing = Rotation.from_euler("y", 90, degrees=True) * Rotation.from_euler("z", 45, degrees=True)
    x, y, z, w = standing.as_quat()
    upper = box((1, 1, 4), (0.3, math.sqrt(2.0) + gap, 0.2), (w, x, y, z))
    found, normal = assert_consistent(upper, lower)
    assert found == pytest.approx(gap, abs=2e-15)
    np.testing.assert_allclose(normal, (0.0, 1.0, 0.0), atol=1e-6 if 0 < gap < 1e-6 else 1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_random_hulls_are_as_far_apart_as_brute_force_says(seed):
    rng = np.random.default_rng(seed)
    apart = 0
    for _ in range(100):
        a, b = random_body(rng, 0.5), random_body(rng, 0.5)
        if depth_by_brute_force(a, b) <= 0.0:
            continue
        gap, _ = assert_consistent(a, b)
        assert gap == pytest.approx(distance_by_brute_force(a, b), abs=1e-13)
        apart += 1
    assert apart > 30


@pytest.mark.parametrize("seed", range(4))
def test_random_overlaps_are_as_deep_as_brute_force_says(seed):
    """Every depth up to a twentieth of the diameter, and 99 of 100 of the deeper ones, where it is an upper bound."""
    rng = np.random.default_rng(100 + seed)
    shallow = deep = missed = 0
    for _ in range(250):
        a, b = random_body(rng, 0.2), random_body(rng, 0.2)
        expected = depth_by_brute_force(a, b)
        if expected > 0.0:
            continue
        gap, _ = assert_consistent(a, b)
        assert gap <= expected + 1e-12
        if expected > -0.05:
            assert gap == pytest.approx(expected, abs=1e-12)
            shallow += 1
        else:
            missed += gap < expected - 1e-10
            deep += 1
    assert shallow > 20
    assert deep > 50
    assert missed <= 0.01 * deep + 1


def touching(a, b, direction, gap):
    """The body a moved along a direction until it is as far as gap from b, by bisection on brute force planes."""
    low, high = 0.0, 10.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        trial = (a[0], tuple(np.asarray(b[1]) + middle * direction), *a[2:])
        low, high = (middle, high) if depth_by_brute_force(trial, b) < gap else (low, middle)
    return (a[0], tuple(np.asarray(b[1]) + high * direction), *a[2:])


@pytest.mark.parametrize("gap", [-1e-4, -1e-8, -1e-12, 0.0])
def test_hulls_that_barely_touch_have_a_depth_that_brute_force_confirms(gap):
    rng = np.random.default_rng(7)
    for _ in range(10):
        a, b = random_body(rng, 0.0), random_body(rng, 0.0)
        direction = rng.normal(size=3)
        a = touching(a, b, direction / np.linalg.norm(direction), gap)
        found, _ = assert_consistent(a, b)
        assert found == pytest.approx(gap, abs=1e-13)


def test_a_grain_on_a_body_four_hundred_times_its_size_is_as_exact_as_among_its_like():
    """To 1e-9 of the grain, at any size ratio up to 400 (docs/numerics.md 3, case 02)."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        small = random_body(rng, 0.0)
        gap = rng.uniform(-0.05, 0.05)
        lowest = world(small)[:, 1].min()
        small = (small[0], (rng.uniform(-100, 100), 200.0 + gap - lowest, rng.uniform(-100, 100)), *small[2:])
        found, normal, *_ = engine.convex_distance(small, box((400.0, 400.0, 400.0)))
        assert found == pytest.approx(gap, abs=1e-12)
        np.testing.assert_allclose(normal, (0.0, 1.0, 0.0), atol=1e-10)


@pytest.mark.parametrize("shift", [(1e3, -2e3, 5e2), (1e5, 1e5, 1e5)])
def test_far_from_the_origin_only_the_places_themselves_are_rounded(shift):
    rng = np.random.default_rng(5)
    for _ in range(30):
        a, b = random_body(rng, 0.5), random_body(rng, 0.5)
        # Places that are exact in both frames, so that the offset is the same number.
        snap = [tuple(np.round(np.asarray(x[1]) * 2**10) / 2**10) for x in (a, b)]
        a, b = ((x[0], place, *x[2:]) for x, place in zip((a, b), snap, strict=True))
        near = engine.convex_distance(a, b)
        far = engine.convex_distance(moved(a, shift=shift), moved(b, shift=shift))
        assert far[0] == pytest.approx(near[0], abs=1e-14)
        np.testing.assert_allclose(far[1], near[1], atol=1e-9)


@settings(deadline=None, max_examples=100)
@given(seed=st.integers(0, 2**31), spread=st.sampled_from([0.15, 0.3, 0.6]), exponent=st.sampled_from([-3, 3]))
def test_the_answer_follows_exchange_scale_and_rotation(seed, spread, exponent):
    rng = np.random.default_rng(seed)
    a, b = random_body(rng, spread), random_body(rng, spread)
    gap, normal, point_a, point_b = engine.convex_distance(a, b)

    swapped = engine.convex_distance(b, a)
    assert swapped[0] == pytest.approx(gap, abs=1e-14)
    np.testing.assert_allclose(swapped[1], -np.array(normal), atol=1e-10)
    np.testing.assert_allclose(swapped[2], point_b, atol=1e-10)

    factor = 10.0**exponent
    scaled = engine.convex_distance(moved(a, factor=factor), moved(b, factor=factor))
    assert scaled[0] / factor == pytest.approx(gap, abs=1e-12)
    np.testing.assert_allclose(scaled[1], normal, atol=1e-10)
    np.testing.assert_allclose(np.array(scaled[2]) / factor, point_a, atol=1e-10)

    rotation = Rotation.random(random_state=seed)
    rotated = engine.convex_distance(moved(a, rotation), moved(b, rotation))
    if gap > -0.05:  # deeper, another of several ways out may be taken
        assert rotated[0] == pytest.approx(gap, abs=1e-13)
        np.testing.assert_allclose(rotated[1], rotation.apply(normal), atol=1e-9)


def test_the_same_question_has_the_same_bits():
    rng = np.random.default_rng(11)
    for _ in range(20):
        a, b = random_body(rng, 0.2), random_body(rng, 0.2)
        assert engine.convex_distance(a, b) == engine.convex_distance(a, b)
        assert engine.convex_manifold(a, b) == engine.convex_manifold(a, b)


# ---- degenerate bodies -----------------------------------------------------------------------------------------------

FLAT = {
    "point": np.zeros((1, 3)),
    "points in one place": np.zeros((5, 3)),
    "needle": np.array([[-0.5, 0, 0], [0.5, 0, 0]]),
    "needle of four": np.array([[-0.5, 0, 0], [-0.1, 0, 0], [0.1, 0, 0], [0.5, 0, 0]]),
    "plate": np.array([[-0.5, 0, -0.5], [0.5, 0, -0.5], [0.5, 0, 0.5], [-0.5, 0, 0.5]]),
    "tilted needle": np.array([[-0.3, 0.1, 0.2], [0.3, -0.1, -0.2]]),
    "cube": CUBE,
    "sliver": np.array([[-0.5, 0, 0], [0.5, 0, 0], [0.0, 1e-13, 0.0], [0.1, 0.0, 1e-14]]),
}


@pytest.mark.parametrize("first", FLAT)
@pytest.mark.parametrize("second", FLAT)
@pytest.mark.parametrize("offset", [(0, 0, 0), (0.1, 0, 0), (0, 0.25, 0), (1.0, 0.0, 0.0), (0.2, 1e-14, -0.3)])
def test_degenerate_bodies_get_a_finite_and_consistent_answer(first, second, offset):
    a, b = body(FLAT[first], offset), body(FLAT[second])
    gap, normal = assert_consistent(a, b, 1e-9)
    assert np.isfinite(gap)
    assert engine.convex_distance(b, a)[0] == pytest.approx(gap, abs=1e-9)
    for point, n, own, *_ in engine.convex_manifold(a, b):
        assert np.isfinite([*point, *n, own]).all()
        assert own >= gap - 1e-9
    assert np.isfinite(normal).all()


def test_bodies_with_one_centre_are_parted_upwards_where_all_ways_are_alike():
    assert engine.convex_distance(ball(1.0), ball(2.0))[:2] == (-3.0, (0.0, 1.0, 0.0))
    gap, normal, *_ = engine.convex_distance(box((1, 1, 1)), box((1, 1, 1)))
    assert gap == pytest.approx(-1.0, abs=1e-15)
    np.testing.assert_allclose(normal, (0.0, 1.0, 0.0), atol=1e-15)


# ---- surfaces --------------------------------------------------------------------------------------------------------


def cylinder(radius, length, position=(0.0, 0.0, 0.0), orientation=UPRIGHT):
    return ("cylinder", position, orientation, (radius, radius, length))


def distance_to_cylinder(points, radius, length):
    side = np.hypot(points[:, 0], points[:, 1]) - radius
    cap = np.abs(points[:, 2]) - 0.5 * length
    outside = np.hypot(np.maximum(side, 0.0), np.maximum(cap, 0.0))
    return np.where(outside > 0.0, outside, np.maximum(side, cap))


def least_over_hull(vertices, function, rounds=40):
    """Least value of a convex function over a hull: golden sections nested over its triangles."""
    best = np.inf
    for p, q, r in vertices[ConvexHull(vertices).simplices]:
        corners = np.array([p, q, r])
        for _ in range(rounds):  # the best corner of a grid of sixteen, again and again
            s, t = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9)))
            points = (
                corners[0]
                + s[:, None] * (corners[1] - corners[0])
                + t[:, None] * (corners[2] - corners[1]) * s[:, None]
            )
            values = function(points)
            k = values.argmin()
            best = min(best, values[k])
            middle = points[k]
            corners = middle + 0.6 * (corners - corners.mean(axis=0))
            corners = np.array([clip_to_triangle(c, p, q, r) for c in corners])
    return best


def clip_to_triangle(point, p, q, r):
    u, v = q - p, r - p
    g = np.array([[u @ u, u @ v], [u @ v, v @ v]])
    s, t = np.linalg.solve(g, [u @ (point - p), v @ (point - p)])
    s, t = max(s, 0.0), max(t, 0.0)
    if s + t > 1.0:
        s, t = s / (s + t), t / (s + t)
    return p + s * u + t * v


def test_the_lowest_corner_is_what_meets_a_plane():
    rng = np.random.default_rng(2)
    for _ in range(20):
        a = random_body(rng, 0.5)
        gap, normal, point, _ = engine.convex_distance(a, FLOOR)
        assert gap == pytest.approx(world(a)[:, 1].min(), abs=1e-15)
        assert normal == (0.0, 1.0, 0.0)
        assert point[1] == pytest.approx(gap, abs=1e-15)


@pytest.mark.parametrize("gap", [0.01, 0.0, -1e-9, -1e-3])
@pytest.mark.parametrize("angle", [0.0, 0.3, 2.5])
def test_a_long_hull_on_the_drum_touches_with_the_middle_of_its_edge_or_face(gap, angle):
    """Its corners alone would let it sink: they are farther from the drum than what lies between them."""
    outward = np.array([math.sin(angle), math.cos(angle), 0.0])
    lying = turned((0, 0, 1), -angle)
    grain = box((0.08, 0.01, 0.02), (0.150 + gap + 0.005) * outward, lying)
    corner = np.hypot(world(grain)[:, 0], world(grain)[:, 1]).min() - 0.150
    found, normal, point, _ = engine.convex_distance(grain, cylinder(0.150, 0.4))
    assert found == pytest.approx(gap, abs=1e-15)
    assert corner - gap > 4e-3
    np.testing.assert_allclose(normal, outward, atol=1e-12)
    np.testing.assert_allclose(np.array(point)[:2], (0.150 + gap) * outward[:2], atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_hulls_round_a_cylinder_are_as_far_as_brute_force_says(seed):
    """Side, caps and rims."""
    rng = np.random.default_rng(seed)
    for _ in range(12):
        a = random_body(rng, 0.0)
        direction = rng.normal(size=3) * np.array([1.0, 1.0, 1.5])
        place = 1.6 * direction / np.linalg.norm(direction)
        a = (a[0], tuple(place), *a[2:])
        found = engine.convex_distance(a, cylinder(0.7, 1.2))[0]
        expected = least_over_hull(world(a), lambda points: distance_to_cylinder(points, 0.7, 1.2))
        assert found == pytest.approx(expected, abs=2e-6)
        assert found <= expected + 1e-9


def test_a_grain_above_a_cap_meets_the_cap():
    grain = box((0.2, 0.2, 0.2), (0.3, -0.2, 0.75))
    gap, normal, *_ = engine.convex_distance(grain, cylinder(0.7, 1.2))
    assert gap == pytest.approx(0.05, abs=1e-14)
    np.testing.assert_allclose(normal, (0.0, 0.0, 1.0), atol=1e-15)
    sunk = box((0.2, 0.2, 0.2), (0.3, -0.2, 0.69))
    gap, normal, *_ = engine.convex_distance(sunk, cylinder(0.7, 1.2))
    assert gap == pytest.approx(-0.01, abs=1e-14)
    np.testing.assert_allclose(normal, (0.0, 0.0, 1.0), atol=1e-15)


def test_a_surface_that_is_a_box_is_the_convex_body_of_that_box():
    rng = np.random.default_rng(4)
    for _ in range(50):
        a, b = random_body(rng, 0.4), box((0.7, 0.1, 0.5), rng.normal(size=3) * 0.2, turned((1, 2, 3), 0.7))
        surface = ("box", b[1], b[2], (0.7, 0.1, 0.5))
        assert engine.convex_distance(a, surface)[0] == pytest.approx(engine.convex_distance(a, b)[0], abs=1e-14)


# ---- points of contact -----------------------------------------------------------------------------------------------


def points_of(a, b, margin=0.0):
    manifold = engine.convex_manifold(a, b, margin)
    points = np.array([m[0] for m in manifold])
    return points, np.array([m[1] for m in manifold]), np.array([m[2] for m in manifold]), [m[3:] for m in manifold]


def sorted_rows(points):
    return points[np.lexsort(np.round(points, 9).T)]


@pytest.mark.parametrize("gap", [0.01, 0.0, -1e-6])
@pytest.mark.parametrize("far", [0.0, 1e3])
def test_a_box_on_a_box_stands_on_four_points_of_one_plane(gap, far):
    lower, upper = box((1, 1, 1), (far, 0, 0)), box((0.6, 1, 0.4), (far + 0.1, 1.0 + gap, -0.1))
    points, normals, gaps, names = points_of(upper, lower)
    expected = np.array([[x, 0.5 + gap, z] for x in (-0.2, 0.4) for z in (-0.3, 0.1)]) + np.array([far, 0.0, 0.0])
    np.testing.assert_allclose(sorted_rows(points), sorted_rows(expected), atol=1e-12)
    np.testing.assert_allclose(normals, np.tile((0.0, 1.0, 0.0), (4, 1)), atol=1e-12)
    np.testing.assert_allclose(gaps, gap, atol=1e-12)
    assert len(set(names)) == 4


def test_boxes_that_overhang_each_other_stand_on_the_corners_of_the_overlap():
    lower, upper = box((1, 1, 1)), box((1, 1, 1), (0.3, 1.0, 0.4))
    points, *_ = points_of(upper, lower)
    expected = np.array([[x, 0.5, z] for x in (-0.2, 0.5) for z in (-0.1, 0.5)])
    np.testing.assert_allclose(sorted_rows(points), sorted_rows(expected), atol=1e-12)


def test_a_box_turned_on_a_like_box_touches_in_the_corners_of_an_octagon():
    lower, upper = box((1, 1, 1)), box((1, 1, 1), (0.0, 1.0, 0.0), turned((0, 1, 0), math.pi / 4))
    points, _, gaps, names = points_of(upper, lower)
    assert len(points) == len(set(names)) == 8
    np.testing.assert_allclose(np.abs(points[:, [0, 2]]).max(axis=1), 0.5, atol=1e-12)
    np.testing.assert_allclose(np.abs(points[:, 0]) + np.abs(points[:, 2]), math.sqrt(0.5), atol=1e-12)
    np.testing.assert_allclose(gaps, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    "surface", [FLOOR, ("box", (0, -0.5, 0), UPRIGHT, (9.0, 1.0, 9.0)), ("box", (0, 0, 0), UPRIGHT, (9, 0, 9))]
)
def test_a_box_on_a_floor_stands_on_its_four_corners_each_with_its_own_gap(surface):
    tilt = 0.01
    grain = box((0.6, 0.2, 0.4), (0.0, 0.1, 0.0), turned((0, 0, 1), tilt))
    points, normals, gaps, names = points_of(grain, surface)
    np.testing.assert_allclose(sorted_rows(points), sorted_rows(world(grain)[world(grain)[:, 1] < 0.1]), atol=1e-12)
    np.testing.assert_allclose(gaps, points[:, 1], atol=1e-12)
    np.testing.assert_allclose(normals, np.tile((0.0, 1.0, 0.0), (4, 1)), atol=1e-12)
    again = points_of(box((0.6, 0.2, 0.4), (1e-3, 0.1001, 1e-3), turned((0, 0, 1), tilt + 1e-3)), surface)[3]
    assert names == again


def test_a_box_far_from_level_touches_with_an_edge_or_a_corner():
    edge = points_of(box((1, 1, 1), (0, 1, 0), turned((0, 0, 1), 0.5)), FLOOR)
    assert len(edge[0]) == 2
    assert len(points_of(box((1, 1, 1), (0, 1, 0), turned((1, 0.3, 0.7), 0.7)), FLOOR)[0]) == 1


def test_a_lying_cylinder_touches_along_a_line_and_a_standing_one_on_its_rim():
    hull = prism(16, 0.5, 2.0)
    lying, normals, gaps, _ = points_of(body(hull, (0.0, 0.5, 0.0)), FLOOR)
    np.testing.assert_allclose(sorted_rows(lying), [[0, 0, -1], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(gaps, 0.0, atol=1e-12)
    standing, *_ = points_of(body(hull, (0.0, 1.0, 0.0), turned((1, 0, 0), 0.5 * math.pi)), FLOOR)
    assert len(standing) == 8
    np.testing.assert_allclose(np.hypot(standing[:, 0], standing[:, 2]), 0.5, atol=1e-12)
    angle = np.sort(np.arctan2(standing[:, 2], standing[:, 0]))
    np.testing.assert_allclose(np.diff(angle), math.pi / 4, atol=1e-9)
    assert len(normals) == 2


def test_parallel_edges_touch_at_the_ends_of_their_overlap():
    eighth = turned((0, 0, 1), math.pi / 4)
    lower, upper = box((1, 1, 2), orientation=eighth), box((1, 1, 2), (0.0, math.sqrt(2.0), 0.5), eighth)
    points, _, gaps, _ = points_of(upper, lower)
    np.testing.assert_allclose(sorted_rows(points), [[0, math.sqrt(0.5), -0.5], [0, math.sqrt(0.5), 1.0]], atol=1e-12)
    np.testing.assert_allclose(gaps, 0.0, atol=1e-12)


@pytest.mark.parametrize("thickness", [0.0, 0.02])
def test_a_box_on_the_edge_of_a_blade_rests_on_the_ends_of_the_line_between(thickness):
    blade = ("box", (0.0, -1.0, 0.0), UPRIGHT, (thickness, 2.0, 3.0))
    points, _, gaps, _ = points_of(box((1, 0.2, 1), (0.0, 0.1, 0.0)), blade)
    assert len(points) == (2 if thickness == 0.0 else 4)
    np.testing.assert_allclose(np.abs(points[:, 2]), 0.5, atol=1e-12)
    np.testing.assert_allclose(np.abs(points[:, 0]), 0.5 * thickness, atol=1e-12)
    np.testing.assert_allclose(gaps, 0.0, atol=1e-12)


def test_a_box_on_the_drum_rests_on_the_line_below_it():
    grain = box((0.02, 0.01, 0.03), (0.0, 0.155, 0.01))
    points, normals, gaps, _ = points_of(grain, cylinder(0.150, 0.4), 1.0)
    on_line = np.abs(points[:, 0]) < 1e-12
    np.testing.assert_allclose(sorted_rows(points[on_line]), [[0, 0.150, -0.005], [0, 0.150, 0.025]], atol=1e-12)
    np.testing.assert_allclose(gaps[on_line], 0.0, atol=1e-12)
    np.testing.assert_allclose(gaps, np.hypot(points[:, 0], points[:, 1]) - 0.150, atol=1e-12)
    np.testing.assert_allclose(
        normals[:, :2], points[:, :2] / np.hypot(points[:, 0], points[:, 1])[:, None], atol=1e-12
    )


def test_a_box_across_the_end_of_the_drum_rests_on_no_more_than_the_drum_has():
    grain = box((0.02, 0.01, 0.03), (0.0, 0.155, 0.2))
    points, _, gaps, _ = points_of(grain, cylinder(0.150, 0.4))
    nearest = points[gaps < 1e-9]
    np.testing.assert_allclose(sorted_rows(nearest), [[0, 0.150, 0.185], [0, 0.150, 0.2]], atol=1e-9)


def test_a_plate_larger_than_a_cap_rests_on_the_cap_s_rim():
    upright = turned((1, 0, 0), -0.5 * math.pi)
    points, _, gaps, _ = points_of(box((1, 0.1, 1), (0.0, 0.15, 0.0)), cylinder(0.2, 0.2, orientation=upright))
    near = points[np.abs(gaps) < 1e-9]
    assert len(near) == 8
    np.testing.assert_allclose(np.hypot(near[:, 0], near[:, 2]), 0.2, atol=1e-9)


def test_the_apex_of_a_blunt_cone_is_among_its_points():
    """Its corner lies inside the polygon of its neighbours, and is nearer than any of them."""
    rim = prism(8, 0.5, 0.0)[:8][:, [0, 2, 1]]
    cone = body(np.vstack([rim + np.array([0.0, 0.5, 0.0]), rim + np.array([0.0, 0.01, 0.0]), [[0.0, 0.0, 0.0]]]))
    for under in (FLOOR, box((3, 1, 3), (0.0, -0.5, 0.0))):
        points, _, gaps, _ = points_of(cone, under)
        assert gaps.min() == pytest.approx(0.0, abs=1e-14)
        np.testing.assert_allclose(points[gaps.argmin()], 0.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_no_point_is_nearer_than_the_bodies_are_and_one_is_as_near(seed):
    """So nothing is pushed before it touches, and nothing sinks in."""
    rng = np.random.default_rng(seed)
    surfaces = [FLOOR, cylinder(0.7, 1.2), ("box", (0, 0, 0), UPRIGHT, (1.0, 0.0, 2.0))]
    for k in range(150):
        a = random_body(rng, 0.4)
        b = random_body(rng, 0.4) if k % 2 else surfaces[k % 3]
        gap = engine.convex_distance(a, b)[0]
        points, normals, gaps, names = points_of(a, b)
        assert 1 <= len(points) <= 8
        assert len(set(names)) == len(names)
        assert gaps.min() == pytest.approx(gap, abs=1e-6)
        assert gaps.min() >= gap - 1e-9
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)


# ---- along a path ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("thickness", [0.0, 0.05])
@pytest.mark.parametrize("seed", range(3))
def test_no_path_goes_through_a_blade_and_none_touches_it_from_beside(seed, thickness):
    """Touch and no touch are those of the swept hull, the fraction is that of its first touch."""
    rng = np.random.default_rng(seed)
    blade = ("box", (0, 0, 0), UPRIGHT, (2.0, 2.0, thickness))
    through = beside = 0
    for _ in range(300):
        a = random_body(rng, 0.0)
        start = np.array([*rng.uniform(-1.5, 1.5, 2), 3.0])
        path = np.array([*rng.uniform(-1.0, 1.0, 2), -6.0])
        a = (a[0], tuple(start), *a[2:])
        swept = np.vstack([world(a), world(a) + path])
        slab = np.array(
            list(itertools.product((-1, 1), (-1, 1), (-0.5 * thickness, 0.5 * thickness)))
        ) + 1e-9 * rng.normal(size=(8, 3))
        meets = depth_by_brute_force(body(swept), body(slab))
        if abs(meets) < 1e-6:
            continue
        approach = engine.convex_approach(a, blade, path)
        assert approach["hit"] == (meets < 0.0)
        if approach["hit"]:
            there = (a[0], tuple(start + approach["fraction"] * path), *a[2:])
            assert engine.convex_distance(there, blade)[0] == pytest.approx(0.0, abs=1e-7)
            assert np.dot(approach["normal"], path) < 0.0
            through += 1
        else:
            assert approach["least_gap"] <= engine.convex_distance(a, blade)[0]
            beside += 1
    assert through > 50
    assert beside > 50


@pytest.mark.parametrize("seed", range(2))
def test_flying_hulls_meet_where_their_swept_bodies_do(seed):
    rng = np.random.default_rng(50 + seed)
    hits = 0
    for _ in range(300):
        a, b = random_body(rng, 0.0), random_body(rng, 0.0)
        aim = rng.normal(size=3)
        start = 2.0 * aim / np.linalg.norm(aim)
        path = -2.0 * start + 0.8 * rng.normal(size=3)
        a = (a[0], tuple(start), *a[2:])
        meets = depth_by_brute_force(body(np.vstack([world(a), world(a) + path])), b)
        if abs(meets) < 1e-6:
            continue
        approach = engine.convex_approach(a, b, path)
        assert approach["hit"] == (meets < 0.0)
        hits += approach["hit"]
        if approach["hit"]:
            there = (a[0], tuple(start + approach["fraction"] * path), *a[2:])
            assert engine.convex_distance(there, b)[0] == pytest.approx(0.0, abs=1e-7)
    assert 50 < hits < 290


def test_a_path_onto_the_drum_ends_on_its_curved_side():
    grain = box((0.002, 0.001, 0.001), (0.03, 0.2, 0.0), turned((1, 1, 0), 0.4))
    approach = engine.convex_approach(grain, cylinder(0.150, 0.4), (0.0, -0.2, 0.0))
    assert approach["hit"]
    there = (grain[0], (0.03, 0.2 - 0.2 * approach["fraction"], 0.0), *grain[2:])
    assert engine.convex_distance(there, cylinder(0.150, 0.4))[0] == pytest.approx(0.0, abs=1e-9)


# ---- input -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "bad",
    [
        body(np.zeros((0, 3))),
        body(np.zeros((129, 3))),
        body(np.zeros((4, 2))),
        body([[np.nan, 0, 0]]),
        body(CUBE, scale=0.0),
        body(CUBE, rounding=-1.0),
        body(CUBE, orientation=(1.0, 1.0, 0.0, 0.0)),
    ],
)
def test_what_is_no_convex_body_is_refused(bad):
    with pytest.raises(engine.InputError):
        engine.convex_distance(bad, box((1, 1, 1)))
