"""Normals of contacts between convex bodies: one where faces or crossed edges give it, a choice where they do not."""

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cesim import engine

CUBE = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))


def box(edges, rotation, position=(0.0, 0.0, 0.0)):
    x, y, z, w = rotation.as_quat()
    return (CUBE * np.asarray(edges, dtype=float), tuple(position), (w, x, y, z), 1.0, 0.0)


def normals_of(a, b):
    """(n, 3) of the points of contact, from b to a."""
    return np.array([point[1] for point in engine.convex_manifold(a, b, 0.0)])


def corners(shape):
    w, x, y, z = shape[2]
    return Rotation.from_quat([x, y, z, w]).apply(shape[0]) + np.asarray(shape[1])


def roof(lean):
    """A long box with an edge up, along z; its sides fall by 45 degrees less and more the lean."""
    return Rotation.from_euler("z", 0.25 * math.pi + lean)


@pytest.mark.parametrize("angle", [0.5 * math.pi, 0.5, 0.1])
@pytest.mark.parametrize("gap", [1e-2, 1e-6, 1e-12, 0.0, -1e-12, -1e-6, -1e-3])
def test_crossed_edges_push_along_the_cross_product_of_both(angle, gap):
    rng = np.random.default_rng(1)
    for _ in range(6):
        low = box((1, 1, 4), roof(rng.uniform(-0.4, 0.4)))
        high = box((1, 1, 4), Rotation.from_euler("y", angle) * roof(rng.uniform(-0.4, 0.4)))
        below = corners(low)[np.argsort(corners(low)[:, 1])[-2:]]
        above = corners(high)[np.argsort(corners(high)[:, 1])[:2]]
        normal = np.cross(below[1] - below[0], above[1] - above[0])
        normal *= np.sign(normal[1]) / np.linalg.norm(normal)
        meet = below.mean(axis=0) + rng.uniform(-0.2, 0.2) * (below[1] - below[0])
        meet_above = above.mean(axis=0) + rng.uniform(-0.2, 0.2) * (above[1] - above[0])
        high = (high[0], tuple(meet + gap * normal - meet_above), *high[2:])
        assert engine.convex_distance(high, low)[0] == pytest.approx(gap, abs=1e-14)
        np.testing.assert_allclose(normals_of(high, low), [normal], atol=1e-14)


@pytest.mark.parametrize("jitter", [0.0, 1e-12, 1e-9, 1e-7])
@pytest.mark.parametrize(("aside", "lean"), [(0.0, 0.0), (0.1, 0.2), (-0.2, -0.3)])
def test_parallel_edges_push_along_the_line_of_centres(aside, lean, jitter):
    """However they lie to each other by rounding, and wherever along the edges."""
    rng = np.random.default_rng(2)
    for _ in range(6):
        low, high = box((1, 1, 4), roof(lean)), box((1, 1.2, 3), Rotation.from_euler("z", 0.25 * math.pi + aside))
        place = corners(low)[:, :2].max(axis=0)[1] - corners(high)[:, 1].min()
        top = corners(low)[np.argmax(corners(low)[:, 1]), 0]
        bottom = corners(high)[np.argmin(corners(high)[:, 1]), 0]
        offset = np.array([top - bottom, place, rng.uniform(-1.0, 1.0)])
        high = (high[0], tuple(offset + np.append(rng.uniform(-jitter, jitter, 2), 0.0)), *high[2:])
        line = np.array([offset[0], offset[1], 0.0]) / np.hypot(offset[0], offset[1])
        found = normals_of(high, low)
        assert len(found) >= 2
        np.testing.assert_allclose(found, np.tile(line, (len(found), 1)), atol=1e-14 + 30.0 * jitter)


@pytest.mark.parametrize("jitter", [0.0, 1e-9])
def test_corners_that_meet_push_along_the_line_of_centres(jitter):
    rng = np.random.default_rng(3)
    for _ in range(6):
        low = box((1, 1, 1), Rotation.from_euler("xz", rng.uniform(0.4, 0.9, 2)))
        high = box((1, 0.9, 1.1), Rotation.from_euler("zx", rng.uniform(0.4, 0.9, 2)))
        place = corners(low)[np.argmax(corners(low)[:, 1])] - corners(high)[np.argmin(corners(high)[:, 1])]
        high = (high[0], tuple(place + rng.uniform(-jitter, jitter, 3)), *high[2:])
        found = normals_of(high, low)
        np.testing.assert_allclose(found, [place / np.linalg.norm(place)], atol=1e-14 + 30.0 * jitter)


def test_where_no_face_allows_the_line_of_centres_the_nearest_normal_that_one_allows_is_taken():
    """The centre of a box that leans over the end of a long slab lies flatter than its side is steep."""
    slab = box((4, 1, 4), Rotation.identity(), (0.0, -0.5, 0.0))
    turned = Rotation.from_euler("z", 0.6)
    lowest = corners(box((1, 1, 4), turned))
    lowest = lowest[np.argmin(lowest[:, 1])]
    high = box((1, 1, 4), turned, (2.0 - lowest[0], -lowest[1], 0.0))
    side = turned.apply([1.0, 0.0, 0.0])
    assert (0.5 - lowest[1]) / (2.0 - lowest[0]) < side[1] / side[0]
    found = normals_of(high, slab)
    np.testing.assert_allclose(found, np.tile(side, (len(found), 1)), atol=1e-12)


@pytest.mark.parametrize("inside", [0.3, 0.01, 1e-3, 1e-4])
@pytest.mark.parametrize("gap", [0.0, 1e-7, -1e-7])
def test_a_corner_just_inside_of_a_face_pushes_along_the_face_s_normal(inside, gap):
    slab = box((4, 1, 4), Rotation.identity(), (0.0, -0.5, 0.0))
    turned = Rotation.from_euler("zx", [0.5, 0.6])
    lowest = corners(box((1, 1, 1), turned))
    lowest = lowest[np.argmin(lowest[:, 1])]
    high = box((1, 1, 1), turned, (2.0 - inside - lowest[0], gap - lowest[1], 0.3))
    np.testing.assert_array_equal(normals_of(high, slab)[0], [0.0, 1.0, 0.0])
