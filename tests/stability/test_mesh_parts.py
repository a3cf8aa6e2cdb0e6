"""Meshes as parts of the machine: no seam is felt, nothing passes through (docs/numerics.md 3, cases 22, 24)."""

import math

import numpy as np
import pytest
from meshes import box, distances, scattered_sheet, sheet, tube
from scenes import GRAVITY, OPEN

import cesim

D = 1e-3  # m, of the balls


def scene(*parts, friction=0.0, restitution=0.0, gravity=GRAVITY, step=1e-3, grain_contact=False, **rest):
    """Parts in still air; a part is a mesh from tests/meshes.py or a part of the machine."""
    meshes = [p for p in parts if isinstance(p, cesim.Mesh)]
    return cesim.Scene(
        meshes=meshes,
        walls=[p for p in parts if isinstance(p, cesim.Wall)],
        drum=next((p for p in parts if isinstance(p, cesim.Drum)), None),
        splitters=[p for p in parts if isinstance(p, cesim.Splitter)],
        materials={"ball": {"kind": "conductor", "density": 2500.0, "friction": friction, "restitution": restitution}},
        numerics={"step": step, "grain_contact": grain_contact},
        gravity=(0.0, -gravity, 0.0),
        bounds=OPEN,
        effects={"drag": "off"},
        **rest,
    )


def mesh(shape, **fields):
    return cesim.Mesh(vertices=shape[0].tolist(), triangles=shape[1].tolist(), **fields)


def with_balls(tree, position, velocity, diameter=D, threads=1, spin=0.0):
    sim = cesim.Simulation(tree, threads=threads)
    sim.add(position, velocity=velocity, material="ball", diameter=diameter, angular_velocity=spin)
    return sim


def history(sim, steps):
    """(steps, count, 9): positions, velocities, angular velocities."""
    rows = []
    for _ in range(steps):
        sim.step()
        rows.append(np.concatenate([sim.position, sim.velocity, sim.angular_velocity], axis=1))
    return np.array(rows)


# ---- seams -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("make", [lambda: sheet(200, 2.0), lambda: scattered_sheet(5000, 2.0)])
def test_over_hundreds_of_seams_a_ball_slides_and_rolls_as_on_a_plane(make, friction, restitution):
    """20 balls, some dropped, at 1 m/s for 0.5 s, on a sheet of 1 cm cells and on one of random triangles."""
    rng = np.random.default_rng(1)
    n = 20
    position = np.column_stack(
        [rng.uniform(-0.7, 0.2, n), 0.5 * D + rng.uniform(0, 2e-3, n), rng.uniform(-0.3, 0.3, n)]
    )
    position[: n // 2, 1] = 0.5 * D
    velocity = np.column_stack([np.full(n, 1.0), np.zeros(n), rng.uniform(-0.5, 0.5, n)])
    coefficients = {"friction": friction, "restitution": restitution}
    on_mesh = with_balls(scene(mesh(make(), **coefficients)), position, velocity)
    on_plane = with_balls(scene(cesim.Wall(position=(0, 0, 0), normal=(0, 1, 0), **coefficients)), position, velocity)
    ways = history(on_mesh, 500), history(on_plane, 500)
    assert np.ptp(ways[0][:, :, 0], axis=0).min() > 0.3
    assert np.abs(ways[0] - ways[1])[:, :, :6].max() < 1e-9
    assert np.abs(ways[0] - ways[1])[:, :, 6:].max() * 0.5 * D < 1e-9
    assert np.array_equal(on_mesh.engine.collisions, on_plane.engine.collisions)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_sheet_that_leans_any_way_is_a_plane_on_both_of_its_sides(side):
    rng = np.random.default_rng(7)
    orientation = rng.normal(size=4)
    orientation /= np.linalg.norm(orientation)
    vertices, triangles = scattered_sheet(3000, 2.0)
    part = mesh((1e3 * vertices, triangles), scale="mm", orientation=orientation.tolist(), position=(0.1, 0.2, 0.3))
    turn = cesim.scene.surfaces.surfaces(scene(part))[0].row["orientation"]
    w, axis = turn[0], np.array(turn[1:])
    rotated = [v + 2 * (w * np.cross(axis, v) + np.cross(axis, np.cross(axis, v))) for v in np.eye(3)]
    normal = side * rotated[1]
    wall = cesim.Wall(position=(0.1, 0.2, 0.3), normal=normal.tolist())
    position = np.array([0.1, 0.2, 0.3]) + 0.5 * D * normal + 0.01 * rotated[0]
    ways = []
    for one in (part, wall):
        tree = scene(one)
        tree.gravity = tuple((-GRAVITY * normal + 0.5 * rotated[0]).tolist())
        ways.append(history(with_balls(tree, position, (1.0 * rotated[2]).tolist()), 300))
    assert np.abs(ways[0] - ways[1])[:, :, :6].max() < 1e-9


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("facets", [180, 720])
def test_over_a_facetted_cylinder_no_kick_exceeds_the_kink(facets, friction):
    """From the top down the outside, and to and fro in the trough of the inside."""
    kink = 2.0 * math.pi / facets
    outside = with_balls(
        scene(mesh(tube(0.16, 0.3, facets), friction=friction)), (0.0, 0.16 + 0.5 * D, 0.01), (0.2, 0.0, 0.05)
    )
    inside = with_balls(
        scene(mesh(tube(0.1, 2.0, facets, 20), friction=friction)), (0.0, -0.1 + 0.51 * D, -0.7), (0.6, 0.0, 0.5)
    )
    for sim in (outside, inside):
        rows = history(sim, 200 if sim is outside else 800)
        speed = np.linalg.norm(rows[:, 0, 3:6], axis=1)
        kicks = np.linalg.norm(np.diff(rows[:, 0, 3:6], axis=0), axis=1)
        # Weight of a step, the turn over a facet or two of them, and friction that follows the pressure of both.
        assert (kicks < 1.01 * (1.0 + friction) * (GRAVITY * 1e-3 + 2.0 * kink * speed[:-1])).all()
        energy = (
            0.5 * speed**2 + GRAVITY * rows[:, 0, 1] + 0.2 * (0.5 * D * np.linalg.norm(rows[:, 0, 6:], axis=1)) ** 2
        )
        assert np.diff(energy).max() < 1e-6
    assert np.hypot(*rows[:, 0, :2].T).max() < 0.1 - 0.5 * D * (1.0 - 2e-6)
    assert rows[-1, 0, 2] > -0.5


def test_near_misses_of_edges_and_corners_change_no_velocity():
    """Case 24: straight ways past one triangle and past a box, at a ball's radius and a trifle."""
    rng = np.random.default_rng(3)
    triangle = np.array([[-0.02, -0.01, 0.0], [0.03, -0.02, 0.01], [0.0, 0.03, -0.01]]), np.array([[0, 1, 2]], "u4")
    for shape in (triangle, box((0.04, 0.03, 0.02))):
        n = 2000
        corners = shape[0][shape[1]]
        weights = rng.dirichlet([0.3, 0.3, 0.3], n)  # many of them at edges and corners
        target = np.einsum("nk,nkc->nc", weights, corners[rng.integers(len(corners), size=n)])
        way = rng.normal(size=(n, 3))
        way /= np.linalg.norm(way, axis=1)[:, None]
        aside = rng.normal(size=(n, 3))
        aside -= (aside * way).sum(axis=1)[:, None] * way
        aside *= (rng.uniform(0.5, 2.0, n) * D / np.linalg.norm(aside, axis=1))[:, None]
        start = target + aside - 6e-3 * way
        line = np.linspace(0.0, 12e-3, 241)
        nearest = np.min([distances(*shape, start + s * way).min(axis=1) for s in line], axis=0)
        passes = nearest > 0.5 * D + 0.5 * (line[1] - line[0])
        assert 200 < passes.sum() < n
        start, way = start[passes], way[passes]
        sim = with_balls(scene(mesh(shape, friction=0.5, restitution=0.5), gravity=0.0), start, 4.0 * way)
        for _ in range(3):
            sim.step()
            assert np.abs(sim.velocity - 4.0 * way).max() < 1e-9
        assert np.abs(sim.position - start - 12e-3 * way).max() < 1e-12


# ---- nothing passes through ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("stride", [3e-3, 10e-3])
@pytest.mark.parametrize("cells", [1, 40])
def test_not_one_of_1e4_shots_passes_through_a_sheet(cells, stride, restitution):
    """Case 22: balls of 0.1 mm at 30 and at 100 diameters a step, from both sides."""
    rng = np.random.default_rng(2)
    n, d = 10_000, 1e-4
    side = rng.choice([-1.0, 1.0], n)
    height = 0.5 * d + rng.uniform(0.0, stride, n)
    position = np.column_stack([rng.uniform(-0.08, 0.08, n), side * height, rng.uniform(-0.08, 0.08, n)])
    way = rng.normal(size=(n, 3))
    way[:, 1] = -side * np.abs(way[:, 1])
    way *= (stride / np.linalg.norm(way, axis=1))[:, None]
    part = mesh(sheet(cells, 0.2), restitution=restitution, friction=0.3)
    sim = with_balls(scene(part, gravity=0.0, restitution=restitution), position, 1e3 * way, d, threads=2)
    through = np.abs(position + way)[:, [0, 2]].max(axis=1) < 0.1
    assert (side * (position + way)[:, 1] < 0.0).sum() > 0.3 * n
    for _ in range(2):
        sim.step()
        assert (side * sim.position[:, 1])[through].min() > 0.5 * d * (1.0 - 2e-6)
    assert through.all()


@pytest.mark.parametrize("restitution", [0.0, 0.9])
@pytest.mark.parametrize("stride", [1e-3, 5e-3, 10e-3])
def test_balls_stay_in_a_box_whose_corners_they_hit_at_any_speed(stride, restitution):
    """20 mm wide, up to 100 diameters a step: a hit at one wall leads to another in the same step."""
    rng = np.random.default_rng(4)
    n, d = 1000, 1e-4
    position = rng.uniform(-0.0095, 0.0095, (n, 3))
    velocity = rng.normal(size=(n, 3))
    velocity *= (1e3 * stride / np.linalg.norm(velocity, axis=1))[:, None]
    sim = with_balls(scene(mesh(box((0.02,) * 3), restitution=restitution), gravity=0.0), position, velocity, d)
    for _ in range(50):
        sim.step()
        assert np.abs(sim.position).max() < 0.01 - 0.5 * d * (1.0 - 2e-6)
    assert np.linalg.norm(sim.velocity, axis=1).max() <= 1e3 * stride * (1.0 + 1e-9)


# ---- as the shapes that it stands for --------------------------------------------------------------------------------


@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_a_box_of_triangles_is_the_box(restitution):
    """Shots of 3 mm a step at a blade, and what becomes of them in 20 ms of weight and friction."""
    rng = np.random.default_rng(5)
    n = 3000
    coefficients = {"friction": 0.3, "restitution": restitution}
    blade = cesim.Splitter(tip=(0.0, 0.05), length=0.1, width=0.3, thickness=0.004, **coefficients)
    shape = mesh(box((0.004, 0.1, 0.3)), **coefficients)
    position = np.column_stack(
        [-rng.uniform(3e-3, 6e-3, n), rng.uniform(-0.06, 0.06, n), rng.uniform(-0.155, 0.155, n)]
    )
    position[:500, :2] = np.column_stack([rng.uniform(-0.003, 0.003, 500), rng.uniform(0.051, 0.054, 500)])
    velocity = 3.0 * rng.uniform([0.2, -1.0, -0.5], [1.0, 1.0, 0.5], (n, 3))
    velocity[:500] *= [0.1, 0.0, 0.1]
    sims = [with_balls(scene(part, restitution=restitution), position, velocity) for part in (shape, blade)]
    for step in range(20):
        for sim in sims:
            sim.step()
        off = np.abs(sims[0].velocity - sims[1].velocity).max(axis=1)
        # An edge is met to 1e-7 r: where rounding ends the search one turn earlier, its normal differs by that.
        assert (off > 1e-9).sum() <= 0.005 * n, step
        assert off.max() < 1e-6, step
    assert (np.abs(sims[0].velocity - velocity).max(axis=1) > 0.5).sum() > 500


# ---- moving ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [-20.0, 20.0])
def test_a_turning_paddle_pushes_a_ball_with_its_own_speed(speed):
    """A plate through its axis, 0.2 m wide; after the blow the ball slides out on it: r'' = speed^2 r, to O(h)."""
    paddle = mesh(
        (
            np.array([[0.0, 0.0, -0.1], [0.2, 0.0, -0.1], [0.2, 0.0, 0.1], [0.0, 0.0, 0.1]]),
            np.array([[0, 1, 2], [0, 2, 3]]),
        ),
        motion=cesim.Rotation(speed=speed),
        friction=0.0,
    )
    side = math.copysign(1.0, speed)
    rho, angle = 0.05, 0.1
    center = [rho * math.cos(angle), side * rho * math.sin(angle), 0.02]
    sim = with_balls(scene(paddle, gravity=0.0, step=1e-4), center, 0.0)
    reached, ways = None, []
    for _ in range(1000):
        sim.step()
        a = speed * sim.time
        along, across = np.array([math.cos(a), math.sin(a), 0.0]), side * np.array([-math.sin(a), math.cos(a), 0.0])
        x, v = sim.position[0], sim.velocity[0]
        if np.linalg.norm(v) > 0.0:
            reached = reached or sim.time
            assert x @ across > 0.5 * D * (1.0 - 1e-5)
            assert x @ across == pytest.approx(0.5 * D, rel=0.1)
            assert v @ across == pytest.approx(abs(speed) * (x @ along), rel=0.02)
            ways.append((sim.time, x @ along, v @ along))
    assert reached == pytest.approx((angle - 0.5 * D / rho) / abs(speed), abs=3e-4)
    t, r, _ = np.array(ways).T
    assert r[-1] > 2.0 * rho
    phase = abs(speed) * (t - t[0])
    want = r[0] * np.cosh(phase) + 0.5 * D * np.sinh(phase)  # its centre lies off the plate's line by half of D
    assert np.abs(r / want - 1.0).max() < 0.003


@pytest.mark.parametrize("speed", [-100.0, 100.0])
def test_a_paddle_that_turns_ten_diameters_a_step_sweeps_every_ball_before_it(speed):
    """Case 22 for a part that moves: 0.1 rad a step, balls of 1 mm at rest, out to 0.1 m; none is left behind."""
    rng = np.random.default_rng(8)
    n, side = 2000, math.copysign(1.0, speed)
    corners = np.array([[0.0, 0.0, -0.1], [0.1, 0.0, -0.1], [0.1, 0.0, 0.1], [0.0, 0.0, 0.1]])
    plate = mesh((corners, np.array([[0, 1, 2], [0, 2, 3]])), motion=cesim.Rotation(speed=speed), friction=0.0)
    rho, angle = rng.uniform(0.015, 0.09, n), rng.uniform(0.05, 1.3, n)
    center = np.column_stack([rho * np.cos(angle), side * rho * np.sin(angle), rng.uniform(-0.09, 0.09, n)])
    sim = with_balls(scene(plate, gravity=0.0), center, 0.0)
    for _ in range(9):
        sim.step()
        a = speed * sim.time
        along, across = np.array([math.cos(a), math.sin(a), 0.0]), side * np.array([-math.sin(a), math.cos(a), 0.0])
        on_plate = np.abs(sim.position @ along - 0.05) < 0.05
        assert (sim.position @ across)[on_plate].min() > 0.5 * D * (1.0 - 1e-4)
    pushed = np.linalg.norm(sim.velocity, axis=1) > 0.0
    assert pushed[angle < 0.85].all()
    assert not pushed[angle > 1.0].any()


def test_a_vibrating_sheet_carries_a_ball_as_a_vibrating_plane_does():
    motion = cesim.Vibration(amplitude="0.5 mm", frequency="30 Hz", direction="60 deg")
    coefficients = {"friction": 0.3, "restitution": 0.2}
    sims = [
        with_balls(scene(part), (0.0, 0.5 * D, 0.0), 0.0)
        for part in (
            mesh(scattered_sheet(2000, 0.2), motion=motion, **coefficients),
            cesim.Wall(position=(0, 0, 0), normal=(0, 1, 0), motion=motion, **coefficients),
        )
    ]
    ways = [history(sim, 500) for sim in sims]
    assert np.abs(ways[0][-1, 0, 0]) > 1e-3  # it is conveyed
    assert np.abs(ways[0] - ways[1])[:, :, :6].max() < 1e-9


def test_the_role_of_a_mesh_is_seen():
    sim = with_balls(scene(mesh(sheet(2, 0.2), role="ground")), (0.0, 0.5 * D, 0.0), 0.0)
    for _ in range(3):
        sim.step()
    assert (sim.engine.state()["touched"] & 7).tolist() == [1 << 1]


def test_a_cluster_rolls_over_seams_as_over_a_plane():
    """Two spheres in one grain, 0.4 d apart: each is met by itself."""
    size = 0.42
    spheres = np.array([[-0.2, 0.0, 0.0, size], [0.2, 0.0, 0.0, size]])
    shapes = [
        {"name": "sphere", "kind": "sphere", "moments": (0.1,) * 3},
        {"name": "pair", "kind": "cluster", "moments": (0.09, 0.13, 0.13), "spheres": spheres},
    ]
    ways = []
    for part in (
        mesh(scattered_sheet(3000, 0.5), friction=0.3),
        cesim.Wall(position=(0, 0, 0), normal=(0, 1, 0), friction=0.3),
    ):
        definition = scene(part).definition() | {"shapes": shapes}
        engine = cesim.engine.Scene(definition)
        engine.add([[-0.2, 1e-3, 0.0]], [[0.8, 0.0, 0.1]], [[0.0, 5.0, 0.0]], [0], [D], [0.0], shape=[1])
        way = []
        for _ in range(300):
            engine.step()
            way.append(np.concatenate([engine.position[0], engine.velocity[0], engine.angular_velocity[0] * D]))
        ways.append(np.array(way))
    assert np.ptp(ways[0][:, 0]) > 0.1
    # Two contacts are solved to the tolerance of the sweeps, not in closed form; the order of work is the same.
    assert np.abs(ways[0] - ways[1])[:30].max() < 1e-9
    assert np.abs(ways[0] - ways[1])[:, 0].max() < 1e-3


# ---- bits ------------------------------------------------------------------------------------------------------------


def heap(threads):
    """300 balls on a turning, facetted drum and a chute, in contact with each other."""
    rng = np.random.default_rng(6)
    parts = (
        mesh(tube(0.05, 0.2, 60), motion=cesim.Rotation(speed=5.0), friction=0.4),
        mesh(scattered_sheet(400, 0.3), position=(0.1, 0.02, 0.0), orientation=(0.95, 0.0, 0.0, 0.3), friction=0.3),
    )
    cell = np.stack(np.meshgrid(np.arange(10), np.arange(3), np.arange(10), indexing="ij"), -1).reshape(-1, 3)
    position = (0.0, 0.06, 0.0) + 3e-3 * (cell - (4.5, 0.0, 4.5)) + rng.uniform(-2e-4, 2e-4, (300, 3))
    return with_balls(scene(*parts, friction=0.3, grain_contact=True), position, 0.0, 2e-3, threads)


def test_the_bits_are_those_of_any_number_of_threads_and_of_a_restart(tmp_path):
    sims = [heap(threads) for threads in (1, 2, 3, 5)]
    for sim in sims:
        for _ in range(120):
            sim.step()
    assert (sims[0].contacts["b"] < 0).sum() > 50
    assert len({sim.state_hash() for sim in sims}) == 1
    sims[0].save(tmp_path / "state.h5")
    again = cesim.Simulation.restore(tmp_path / "state.h5")
    for sim in (again, sims[0]):
        for _ in range(30):
            sim.step()
    assert again.state_hash() == sims[0].state_hash()
