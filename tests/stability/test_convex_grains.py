"""Convex grains in motion: rest, sliding, tipping, stacks, impacts, drum, blades, threads (docs/numerics.md 1)."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from convex_grains import CORNERS, SPHERE, UPRIGHT, Box, add, engine_of, quaternion, rotations
from scenes import GRAVITY, OPEN, plane_scene
from scipy.spatial.transform import Rotation

import cesim
from cesim import engine
from cesim.scene import Numerics


def space(restitution=0.0, friction=0.0, step=1e-4, **parts):
    """No weight, no air."""
    return cesim.Scene(
        materials={"grain": {"kind": "conductor", "density": 2500.0, "friction": friction, "restitution": restitution}},
        gravity=(0.0, 0.0, 0.0),
        numerics=Numerics(step=step, threads=1, tolerance=1e-9),
        bounds=OPEN,
        effects={"drag": "off"},
        **parts,
    )


def momenta(scene, boxes_of_rows):
    """Momentum, angular momentum about the origin, and kinetic energy."""
    m, v, x = np.array(scene.mass), np.array(scene.velocity), np.array(scene.position)
    spin = np.zeros_like(v)
    turns = rotations(scene)
    for k, box in enumerate(boxes_of_rows):
        inertia = box.moments * m[k] * box.diameter**2
        local = turns[k].inv().apply(scene.angular_velocity[k])
        spin[k] = turns[k].apply(inertia * local)
    energy = 0.5 * (m * (v**2).sum(axis=1)).sum() + 0.5 * (spin * scene.angular_velocity).sum()
    return (m[:, None] * v).sum(axis=0), (m[:, None] * np.cross(x, v) + spin).sum(axis=0), energy


# ---- rest, sliding, tipping ------------------------------------------------------------------------------------------


def test_a_box_rests_on_a_plane_on_four_points_and_presses_with_its_weight():
    box = Box(2e-3, 1e-3, 1.5e-3)
    scene = engine_of(plane_scene(friction=0.5), [box])
    add(scene, box, 1, (0.0, 0.5e-3, 0.0))
    for _ in range(10):
        scene.step(100)
        contacts = scene.contacts
        assert len(contacts) == 4
        force = contacts["impulse"].sum(axis=0) / scene.step_size
        np.testing.assert_allclose(force, [0.0, scene.mass[0] * GRAVITY, 0.0], atol=1e-3 * scene.mass[0] * GRAVITY)
    np.testing.assert_allclose(scene.position[0], (0.0, 0.5e-3, 0.0), atol=2e-3 * box.diameter)
    assert rotations(scene).magnitude()[0] < 2e-3
    assert np.abs(scene.velocity).max() < 2e-5  # twice the tolerance of the contact problem


def slide(friction, edges, slope, duration=0.3, step=1e-3):
    """How far a box comes down a slope, and by how much it has turned."""
    box = Box(*edges)
    scene = engine_of(plane_scene(slope, step=step), [box], friction=friction)
    add(scene, box, 1, (0.0, 0.5 * edges[1], 0.0))
    for _ in range(round(duration / step)):
        scene.step()
        if rotations(scene).magnitude()[0] > 0.2:
            break
    return scene.position[0, 0], rotations(scene).magnitude()[0]


@pytest.mark.parametrize("friction", [0.3, 0.6])
def test_a_flat_box_slides_from_the_angle_of_friction_on_and_as_fast_as_coulomb_says(friction):
    edges, angle = (2e-3, 1e-3, 2e-3), math.atan(friction)
    held, turned = slide(friction, edges, angle - 0.02)
    assert abs(held) < 1e-5
    assert turned < 1e-3
    moved, turned = slide(friction, edges, angle + 0.1)
    assert turned < 1e-3
    acceleration = GRAVITY * (math.sin(angle + 0.1) - friction * math.cos(angle + 0.1))
    assert moved == pytest.approx(0.5 * acceleration * 0.3**2, rel=0.01)


def test_a_tall_box_tips_where_its_weight_leaves_its_base():
    """tan = b / h, when friction holds."""
    edges = (1e-3, 2e-3, 1e-3)
    tipping = math.atan(edges[0] / edges[1])
    assert slide(2.0, edges, tipping - 0.01)[1] < 5e-3
    assert slide(2.0, edges, tipping + 0.01)[1] > 0.2


@pytest.mark.parametrize("count", [3, 5])
def test_a_stack_of_boxes_stands(count):
    box = Box(1e-3, 1e-3, 1e-3)
    scene = engine_of(plane_scene(friction=0.5), [box], friction=0.5)
    places = [(0.05e-3 * (-1) ** k, (0.5 + k) * 1e-3, 0.03e-3 * (k % 3)) for k in range(count)]
    add(scene, box, 1, places)
    scene.step(1000)
    np.testing.assert_allclose(scene.position, places, atol=5e-3 * 1e-3)
    assert rotations(scene).magnitude().max() < 5e-3
    assert scene.health["penetration_ratio"] < 1e-3
    below = scene.contacts[scene.contacts["b"] < 0]["impulse"].sum(axis=0) / scene.step_size
    assert below[1] == pytest.approx(scene.mass.sum() * GRAVITY, rel=1e-3)


# ---- impact ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("seed", range(4))
def test_an_impact_of_two_boxes_keeps_momentum_and_angular_momentum_and_gains_no_energy(seed, friction, restitution):
    rng = np.random.default_rng(seed)
    boxes = [Box(1e-3, 2e-3, 1.5e-3), Box(2e-3, 0.7e-3, 1e-3)]
    scene = engine_of(space(restitution, friction), boxes)
    aim = rng.normal(size=3)
    aim /= np.linalg.norm(aim)
    for k, side in enumerate((1.0, -1.0)):
        place = 2.5e-3 * side * aim + 3e-4 * rng.normal(size=3)
        turn = quaternion(Rotation.random(random_state=10 * seed + k))
        add(scene, boxes[k], 1 + k, place, -0.3 * side * aim, turn, 20.0 * rng.normal(size=3))
    before = momenta(scene, boxes)
    energies = [before[2]]
    hit = False
    for _ in range(250):
        scene.step()
        hit = hit or any(np.linalg.norm(c["impulse"]) > 0.0 for c in scene.contacts)
        energies.append(momenta(scene, boxes)[2])
    after = momenta(scene, boxes)
    assert hit
    scale = scene.mass.min() * 0.3
    np.testing.assert_allclose(after[0], before[0], atol=1e-12 * scale)
    # The impulse acts at the start of the step on arms of that moment: the way of a step is the error of the moment.
    np.testing.assert_allclose(after[1], before[1], atol=0.3 * 1e-4 * scale)
    assert max(np.diff(energies)) < 0.02 * energies[0]
    assert energies[-1] <= energies[0] * 1.005


@pytest.mark.parametrize("restitution", [0.0, 0.4, 1.0])
def test_a_box_that_lands_flat_bounces_by_its_restitution_without_turning(restitution):
    box = Box(2e-3, 1e-3, 2e-3)
    scene = engine_of(plane_scene(restitution=restitution), [box], restitution=restitution)
    add(scene, box, 1, (0.0, 0.5e-3 + 0.25e-3, 0.0), (0.0, -0.5, 0.0))
    scene.step()
    speed = math.sqrt(0.5**2 + 2.0 * GRAVITY * 0.25e-3)
    flight = (speed - 0.5) / GRAVITY
    assert scene.velocity[0, 1] == pytest.approx(max(0.0, restitution * speed - GRAVITY * (1e-3 - flight)), abs=1e-4)
    assert np.abs(scene.angular_velocity).max() < 1e-2


# ---- the machine -----------------------------------------------------------------------------------------------------


def test_a_hull_on_the_rotating_drum_is_carried():
    box = Box(2e-3, 0.5e-3, 1.5e-3)
    speed, radius = 1.0, 0.160
    scene = cesim.Scene(
        drum=cesim.Drum(speed=speed, friction=0.8),
        numerics=Numerics(step=1e-3, threads=1),
        bounds=OPEN,
        effects={"drag": "off"},
    )
    sim = engine_of(scene, [box])
    add(sim, box, 1, (0.0, radius + 0.25e-3, 0.0), (speed * (radius + 0.25e-3), 0.0, 0.0), spin=(0.0, 0.0, -speed))
    for _ in range(20):
        sim.step(20)
        x, y, _ = sim.position[0]
        assert math.hypot(x, y) == pytest.approx(radius + 0.25e-3, abs=2e-5)
        assert math.atan2(x, y) == pytest.approx(speed * sim.time, abs=2e-3)
    turned = rotations(sim).as_rotvec()[0]
    np.testing.assert_allclose(turned, (0.0, 0.0, -speed * sim.time), atol=0.02)


def blade_scene(step=1e-3):
    return cesim.Scene(
        splitters=[],
        walls=[],
        gravity=(0.0, 0.0, 0.0),
        numerics=Numerics(step=step, threads=1),
        bounds=OPEN,
        effects={"drag": "off"},
    )


def engine_with_blade(boxes, threads=1, thickness=0.0):
    sim = cesim.Simulation(blade_scene(), threads=1)
    definition = sim.definition
    blade = {
        "name": "blade",
        "shape": "box",
        "role": "inert",
        "position": (0.0, 0.0, 0.0),
        "orientation": UPRIGHT,
        "size": (20e-3, 20e-3, thickness),
    }
    definition["shapes"] = [SPHERE, *(box.shape for box in boxes)]
    definition["surfaces"] = [blade]
    materials = len(definition["materials"])
    for name in ("friction", "restitution", "rolling", "spinning"):
        definition[f"surface_{name}"] = np.full((1, materials), 0.3 if name == "friction" else 0.0)
    definition["grain_contact"] = False
    return engine.Scene(definition, seed=1, threads=threads)


@pytest.mark.parametrize("travel", [3e-3, 10e-3])
def test_of_random_shots_at_a_blade_without_thickness_none_goes_through(travel):
    """And those that pass its edges keep their velocity."""
    rng = np.random.default_rng(1)
    box = Box(0.1e-3, 0.2e-3, 0.15e-3)
    scene = engine_with_blade([box])
    n = 5000
    start = np.column_stack([rng.uniform(-11e-3, 11e-3, (n, 2)), rng.uniform(0.2e-3, travel, n)])
    velocity = np.column_stack([rng.uniform(-0.5, 0.5, (n, 2)), np.full(n, -travel / 1e-3)])
    turns = Rotation.random(n, random_state=2)
    x, y, z, w = turns.as_quat().T
    add(scene, box, 1, start, velocity, np.column_stack([w, x, y, z]))
    reach = 0.5 * np.linalg.norm(box.edges)
    crossing = start + velocity * (start[:, 2] / (travel / 1e-3))[:, None]
    hits = (np.abs(crossing[:, :2]) < 10e-3 - 1.5 * reach).all(axis=1)
    passes = (np.abs(crossing[:, :2]) > 10e-3 + 1.5 * reach).any(axis=1)
    assert hits.sum() > 1000
    assert passes.sum() > 100
    scene.step(4)
    assert (scene.position[hits, 2] > -1e-6).all()
    np.testing.assert_array_equal(np.array(scene.velocity)[passes], velocity[passes])
    assert (scene.position[passes, 2] < 0.0).all()


def test_shots_past_the_edge_of_a_blade_by_a_thousandth_of_their_size_are_left_alone():
    box = Box(0.1e-3, 0.2e-3, 0.15e-3)
    scene = engine_with_blade([box])
    rng = np.random.default_rng(3)
    turns = Rotation.random(300, random_state=4)
    lowest = np.array([(turn.apply(CORNERS * box.edges))[:, 0].min() for turn in turns])
    start = np.column_stack([10e-3 - lowest + 1e-3 * box.diameter, rng.uniform(-8e-3, 8e-3, 300), np.full(300, 1e-3)])
    x, y, z, w = turns.as_quat().T
    velocity = (0.0, 0.0, -3.0)
    add(scene, box, 1, start, velocity, np.column_stack([w, x, y, z]))
    scene.step(2)
    np.testing.assert_allclose(scene.velocity, np.tile(velocity, (300, 1)), atol=1e-9)
    assert (scene.position[:, 2] < 0.0).all()


# ---- together --------------------------------------------------------------------------------------------------------


def heap(threads):
    rng = np.random.default_rng(5)
    boxes = [Box(1e-3, 1e-3, 1e-3), Box(2e-3, 0.5e-3, 1e-3)]
    scene = engine_of(plane_scene(friction=0.5), boxes, threads, friction=0.5)
    for k, index in enumerate(rng.integers(0, 3, 60)):
        place = (2e-3 * (k % 4) + 1e-4 * rng.random(), 2e-3 + 2.5e-3 * (k // 16), 2e-3 * (k // 4 % 4))
        turn = quaternion(Rotation.random(random_state=k))
        add(scene, boxes[index - 1] if index else None, index, place, orientation=turn)
    return scene


def test_a_heap_of_boxes_and_spheres_comes_to_rest_the_same_for_any_number_of_threads():
    one, *others = [heap(threads) for threads in (1, 2, 3)]
    for scene in (one, *others):
        scene.step(400)
    assert {scene.state_hash() for scene in others} == {one.state_hash()}
    assert one.health["penetration_ratio"] < 0.2
    assert np.array(one.position)[:, 1].min() > 0.2e-3
    boxes = np.array(one.diameter) != 1e-3  # spheres go on rolling
    assert np.abs(np.array(one.velocity)[boxes]).max() < 0.02


def rod(radius, length, sides=16):
    """A long prism about z as a shape of the engine, and the diameter of the sphere of its volume."""
    turn = 2.0 * math.pi / sides
    angle = turn * np.arange(sides)
    ring = [np.column_stack([np.cos(angle), np.sin(angle), np.full(sides, z)]) for z in (-0.5, 0.5)]
    diameter = (3.0 / math.pi * sides * radius**2 * math.sin(turn) * length) ** (1.0 / 3.0)
    polar = radius**2 * (2.0 + math.cos(turn)) / 6.0  # of a regular polygon
    across = 0.5 * polar + length**2 / 12.0
    moments = tuple(np.array([across, across, polar]) / diameter**2)
    vertices = np.vstack(ring) * [radius, radius, length] / diameter
    shape = {"name": "rod", "kind": "convex", "moments": moments, "vertices": vertices}
    return SimpleNamespace(diameter=diameter, shape=shape)


def test_long_cylinders_that_fall_into_a_pile_hardly_overlap():
    """They turn by up to 0.4 rad in a step, and what their ends sink in by that is taken back."""
    rng = np.random.default_rng(5)
    body = rod(0.5e-3, 10e-3)
    scene = engine_of(plane_scene(friction=0.5), [body], friction=0.5)
    for k in range(30):
        place = (3e-3 * (k % 2) + 1e-3 * rng.random(), 1.5e-3 + 2.2e-3 * k, 1e-3 * rng.random())
        turn = Rotation.from_euler("yx", [rng.uniform(0.0, 360.0), rng.uniform(-5.0, 5.0)], degrees=True)
        add(scene, body, 1, place, orientation=quaternion(turn))
    deepest = []
    for _ in range(200):
        scene.step()
        deepest.append(scene.health["last_penetration"] / (0.5 * body.diameter))
    assert max(deepest) < 2e-3
    assert np.mean(np.array(deepest) > 2e-4) < 0.02
    assert scene.health["turn"] > 0.2
