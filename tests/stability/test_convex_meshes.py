"""Convex grains on meshes: no seam is felt, nothing passes through, walls and ramps stop it (docs/numerics.md 1)."""

import math

import numpy as np
import pytest
from convex_grains import Box, add, engine_of, rotations
from meshes import box as mesh_box
from meshes import scattered_sheet, sheet, tube
from scenes import GRAVITY, OPEN
from scipy.spatial.transform import Rotation

import cesim
from cesim.scene import Numerics


def scene_of(*shapes, gravity=(0.0, -GRAVITY, 0.0), step=1e-3, friction=0.0, **fields):
    meshes = [
        cesim.Mesh(vertices=vertices.tolist(), triangles=triangles.tolist(), friction=friction, **fields)
        for vertices, triangles in shapes
    ]
    return cesim.Scene(
        meshes=meshes,
        materials={"grain": {"kind": "conductor", "density": 2500.0, "friction": friction, "restitution": 0.0}},
        numerics=Numerics(step=step, threads=1, grain_contact=False),
        gravity=gravity,
        bounds=OPEN,
        effects={"drag": "off"},
    )


def bent_floor(angle, n=10, size=0.1):
    """A floor along x < 0 and a ramp (or a wall) that rises from it at x = 0, each of n x n cells."""
    vertices, triangles = sheet(n, size)
    floor = vertices - np.array([0.5 * size, 0.0, 0.0])
    ramp = Rotation.from_euler("z", angle).apply(vertices + np.array([0.5 * size, 0.0, 0.0]))
    return np.concatenate([floor, ramp]), np.concatenate([triangles, triangles + len(vertices)]).astype("u4")


FLOORS = [lambda: sheet(50, 1.0), lambda: scattered_sheet(2000, 1.0), lambda: mesh_box((0.9, 0.2, 0.9))]


@pytest.mark.parametrize("make", FLOORS)
def test_a_box_lies_still_on_a_mesh_and_presses_with_its_weight(make):
    vertices, triangles = make()
    top = vertices[:, 1].max()
    box = Box(2e-3, 1e-3, 1.5e-3)
    scene = engine_of(scene_of((vertices, triangles), friction=0.5), [box])
    place = (0.001, top + 0.5e-3, 0.0005)
    add(scene, box, 1, place)
    scene.step(300)
    np.testing.assert_allclose(scene.position[0], place, atol=2e-6)
    force = scene.contacts["impulse"].sum(axis=0) / scene.step_size
    weight = scene.mass[0] * GRAVITY
    np.testing.assert_allclose(force, (0.0, weight, 0.0), atol=2e-3 * weight)


@pytest.mark.parametrize("make", FLOORS)
@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_over_seams_boxes_slide_as_on_a_plane(make, friction):
    """A grain that catches on a seam loses speed, hops or turns."""
    vertices, triangles = make()
    top = vertices[:, 1].max()
    box = Box(3e-3, 1e-3, 2e-3)
    scene = engine_of(scene_of((vertices, triangles), friction=friction), [box])
    rng = np.random.default_rng(1)
    n, speed = 10, 0.8
    turns = [Rotation.from_euler("y", angle) for angle in rng.uniform(0.0, 6.0, n)]
    heading = rng.uniform(0.0, 2.0 * math.pi, n)
    place = np.column_stack([0.1 * rng.uniform(-1, 1, n), np.full(n, top + 0.5e-3), 0.1 * rng.uniform(-1, 1, n)])
    for k in range(n):
        x, y, z, w = turns[k].as_quat()
        way = np.array([math.cos(heading[k]), 0.0, math.sin(heading[k])])
        add(scene, box, 1, place[k], speed * way, (w, x, y, z))
    scene.step(300)
    left = speed - friction * GRAVITY * 0.3
    way = np.column_stack([np.cos(heading), np.zeros(n), np.sin(heading)])
    np.testing.assert_allclose(scene.velocity, left * way, atol=2e-3 * speed)
    np.testing.assert_allclose(scene.position[:, 1], top + 0.5e-3, atol=1e-5)
    moved = 0.3 * 0.5 * (speed + left)
    np.testing.assert_allclose(scene.position - place, moved * way, atol=5e-3 * moved)


@pytest.mark.parametrize("travel", [1e-3, 10e-3])
@pytest.mark.parametrize("make", FLOORS)
def test_of_random_shots_at_a_mesh_none_goes_through(make, travel):
    vertices, triangles = make()
    top = vertices[:, 1].max()
    box = Box(0.1e-3, 0.2e-3, 0.15e-3)
    scene = engine_of(scene_of((vertices, triangles), gravity=(0.0, 0.0, 0.0), friction=0.3), [box])
    rng = np.random.default_rng(2)
    n = 500
    start = np.column_stack(
        [rng.uniform(-0.2, 0.2, n), top + rng.uniform(0.2e-3, travel + 0.2e-3, n), rng.uniform(-0.2, 0.2, n)]
    )
    velocity = np.column_stack([rng.uniform(-1, 1, n), np.full(n, -travel / 1e-3), rng.uniform(-1, 1, n)])
    x, y, z, w = Rotation.random(n, random_state=3).as_quat().T
    add(scene, box, 1, start, velocity, np.column_stack([w, x, y, z]))
    scene.step(5)
    assert (scene.position[:, 1] > top).all()
    assert (scene.velocity[:, 1] > -0.9 * travel / 1e-3).all()  # all have met it
    assert scene.health["penetration_ratio"] < 1e-4


@pytest.mark.parametrize("angle", [0.5 * math.pi, 1.2])
def test_a_sliding_box_is_stopped_by_a_wall_and_goes_on_along_it(angle):
    box = Box(2e-3, 1e-3, 2e-3)
    scene = engine_of(scene_of(bent_floor(angle)), [box])
    add(scene, box, 1, (-8e-3, 0.5e-3, 0.0), (0.5, 0.0, 0.2))
    scene.step(60)
    if angle == 0.5 * math.pi:
        np.testing.assert_allclose(scene.velocity[0], (0.0, 0.0, 0.2), atol=2e-3)
        assert scene.position[0, 0] == pytest.approx(-1e-3, abs=5e-6)
    assert scene.position[0, 0] < 1e-3
    assert scene.position[0, 1] > 0.4e-3
    # Which corner bears the blow on a leaning wall is not determined; it turns the box on its chord.
    assert scene.health["penetration_ratio"] < (0.02 if angle == 0.5 * math.pi else 0.06)


def test_a_box_goes_up_a_ramp_that_begins_in_a_valley():
    box = Box(2e-3, 1e-3, 2e-3)
    angle = 0.4
    scene = engine_of(scene_of(bent_floor(angle)), [box])
    add(scene, box, 1, (-8e-3, 0.5e-3, 0.0), (1.0, 0.0, 0.0))
    lowest = np.inf
    for _ in range(40):
        scene.step()
        corners = rotations(scene)[0].apply(box.corners) + scene.position[0]
        floor = np.minimum(corners[:, 1], corners[:, 1] * math.cos(angle) - corners[:, 0] * math.sin(angle))
        ahead = corners[:, 0] > 0.0
        lowest = min(lowest, np.where(ahead, floor, corners[:, 1]).min())
    assert lowest > -2e-5
    assert scene.position[0, 0] > 5e-3
    assert scene.position[0, 1] > 1.5e-3


def test_a_box_past_the_rim_of_a_mesh_is_left_alone():
    vertices, triangles = sheet(10, 0.1)
    box = Box(1e-3, 2e-3, 1.5e-3)
    scene = engine_of(scene_of((vertices, triangles), gravity=(0.0, 0.0, 0.0)), [box])
    rng = np.random.default_rng(3)
    turns = Rotation.random(100, random_state=4)
    lowest = np.array([turn.apply(box.corners)[:, 0].min() for turn in turns])
    start = np.column_stack([0.05 - lowest + 1e-3 * box.diameter, np.full(100, 2e-3), rng.uniform(-0.04, 0.04, 100)])
    x, y, z, w = turns.as_quat().T
    add(scene, box, 1, start, (0.0, -1.0, 0.0), np.column_stack([w, x, y, z]))
    scene.step(5)
    np.testing.assert_allclose(scene.velocity, np.tile((0.0, -1.0, 0.0), (100, 1)), atol=1e-9)
    assert (scene.position[:, 1] < 0.0).all()


def test_a_convex_grain_in_a_turning_mesh_is_carried_up_its_wall():
    """In a drum of meshes with much friction it goes round with the wall as far as friction holds it."""
    radius, speed, friction = 0.05, 1.0, 0.5
    box = Box(2e-3, 1e-3, 2e-3)
    scene = engine_of(
        scene_of(tube(radius, 0.1, 64), friction=friction, motion=cesim.Rotation(speed=speed)), [box], friction=friction
    )
    # lies on the flat facets' chord; the lowest facet has its middle at an angle of half a facet
    facet = 2.0 * math.pi / 64
    inner = radius * math.cos(0.5 * facet)
    turn = Rotation.from_euler("z", 0.5 * facet)
    place = turn.apply((0.0, -(inner - 0.5e-3), 0.0))
    x, y, z, w = turn.as_quat()
    add(scene, box, 1, place, (speed * (inner - 0.5e-3), 0.0, 0.0), (w, x, y, z), spin=(0.0, 0.0, speed))
    highest = 0.0
    for _ in range(90):
        scene.step(10)
        x, y, _ = scene.position[0]
        highest = max(highest, math.atan2(x, -y))
        assert math.hypot(x, y) < radius
    assert highest == pytest.approx(math.atan(friction), abs=0.15)


@pytest.mark.parametrize("speed", [2.0, 8.0])
@pytest.mark.parametrize("angle", [0.4, 1.0, 0.5 * math.pi])
def test_fast_boxes_that_slide_into_a_valley_do_not_go_under_its_far_side(angle, speed):
    box = Box(0.4e-3, 0.2e-3, 0.3e-3)
    scene = engine_of(scene_of(bent_floor(angle), gravity=(0.0, 0.0, 0.0)), [box])
    rng = np.random.default_rng(5)
    n = 200
    place = np.column_stack([rng.uniform(-6e-3, -1e-3, n), np.full(n, 0.1e-3), rng.uniform(-0.04, 0.04, n)])
    turns = Rotation.from_euler("y", rng.uniform(0.0, 6.0, (n, 1)))
    x, y, z, w = turns.as_quat().T
    add(scene, box, 1, place, (speed, 0.0, 0.0), np.column_stack([w, x, y, z]))
    for _ in range(8):
        scene.step()
        x, y, _ = np.array(scene.position).T
        above = np.where(x > 0.0, y * math.cos(angle) - x * math.sin(angle), y)
        assert above.min() > 0.0


@pytest.mark.parametrize("height", [0.5e-3, 2e-3])
def test_boxes_that_strike_the_floor_before_a_wall_do_not_slide_through_the_wall(height):
    """In one step: down to the floor, and along it; their free paths would dive under the wall."""
    box = Box(0.4e-3, 0.2e-3, 0.3e-3)
    scene = engine_of(scene_of(bent_floor(0.5 * math.pi), gravity=(0.0, 0.0, 0.0)), [box])
    rng = np.random.default_rng(6)
    n = 200
    place = np.column_stack([rng.uniform(-9e-3, -5e-3, n), np.full(n, height), rng.uniform(-0.04, 0.04, n)])
    x, y, z, w = Rotation.random(n, random_state=7).as_quat().T
    add(scene, box, 1, place, (10.0, -10.0, 0.0), np.column_stack([w, x, y, z]))
    scene.step(4)
    assert scene.position[:, 0].max() < 0.0
    assert scene.position[:, 1].min() > 0.0
