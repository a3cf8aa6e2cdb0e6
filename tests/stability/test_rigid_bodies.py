"""Grains that are no spheres: clusters against closed forms, against spheres, and the ledgers of their collisions."""

import numpy as np
import pytest
import scenes

import cesim

ONE = cesim.Cluster(spheres=[[0.0, 0.0, 0.0, 1.0]])
PAIR = cesim.Cluster(spheres=[[-0.5, 0.0, 0.0, 0.7], [0.6, 0.0, 0.1, 0.5]])
FLAKE = cesim.Flake(spheres=7)
SHAPES = {"one": ONE, "pair": PAIR, "flake": FLAKE}


def turned(rng, n):
    q = rng.normal(size=(n, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def inertia(sim, row):
    """World inertia, (3, 3) kg m2."""
    w, x, y, z = sim.orientation[row]
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    moments = np.array(sim.shapes[sim.shape[row]].moments) * sim.mass[row] * sim.diameter[row] ** 2
    return axes @ np.diag(moments) @ axes.T


def angular_momentum(sim):
    """About the origin, kg m2/s, and its scale."""
    own = np.array([inertia(sim, row) @ sim.angular_velocity[row] for row in range(sim.count)])
    orbit = np.cross(sim.position, sim.mass[:, None] * sim.velocity)
    return (own + orbit).sum(axis=0), np.abs(own).sum() + np.abs(orbit).sum()


def weightless(friction=0.4, **numerics):
    scene = scenes.plane_scene(friction=friction, shapes=SHAPES)
    scene.gravity = (0.0, 0.0, 0.0)
    scene.walls = []
    scene.materials["copper"].friction = friction
    for name, value in numerics.items():
        setattr(scene.numerics, name, value)
    return cesim.Simulation(scene, threads=1)


@pytest.mark.parametrize("contact_law", ["coulomb", "ccp"])
def test_a_cluster_of_one_sphere_moves_as_the_sphere_does(contact_law):
    """Through impact, slip and roll on an incline: the general form of the contact problem against the kernel's."""
    paths = []
    for shape in (None, "one"):
        scene = scenes.plane_scene(0.3, friction=0.2, restitution=0.4, contact_law=contact_law, shapes=SHAPES)
        scene.numerics.tolerance = 1e-12
        sim = cesim.Simulation(scene, threads=1)
        spin = (3.0, 20.0, 40.0)
        sim.add([0.0, 2e-3, 0.0], velocity=(0.1, -0.2, 0.05), diameter=1e-3, angular_velocity=spin, shape=shape)
        path = []
        for _ in range(200):
            sim.step()
            path.append(np.concatenate([sim.position[0] * 1e3, sim.velocity[0], sim.angular_velocity[0] * 1e-3]))
        paths.append(path)
    np.testing.assert_allclose(paths[0], paths[1], atol=1e-9)


@pytest.mark.parametrize("rolling", [0.0, 0.1])
def test_the_general_form_and_the_kernel_give_spheres_the_same_motion(rolling):
    ends = []
    for solver in ("pgs", "apgd"):
        scene = scenes.plane_scene(friction=0.3, rolling_friction=rolling)
        scene.materials["copper"].friction, scene.materials["copper"].rolling_friction = 0.3, rolling
        scene.numerics.solver, scene.numerics.tolerance, scene.numerics.max_iterations = solver, 1e-11, 100_000
        sim = cesim.Simulation(scene, threads=1)
        sim.add([[0.0, 0.6e-3, 0.0], [0.9e-3, 1.4e-3, 0.1e-3]], velocity=[[0.2, 0, 0], [-0.1, -0.1, 0]], diameter=1e-3)
        sim.step(60)
        assert sim.health.converged
        ends.append(np.concatenate([sim.position.ravel() * 1e3, sim.velocity.ravel()]))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-7)


def test_a_spinning_sphere_slows_by_its_spinning_friction():
    """I dw/dt = -mu_s r m g about the normal, so dw/dt = -2.5 mu_s g/r (docs/numerics.md 1)."""
    scene = scenes.plane_scene(friction=0.3)
    scene.walls[0].spinning_friction = 0.02
    sim = cesim.Simulation(scene, threads=1)
    sim.add([0.0, 0.5e-3, 0.0], diameter=1e-3, angular_velocity=(0.0, 300.0, 0.0))
    sim.step(101)
    lost = 300.0 - sim.angular_velocity[0, 1]
    assert lost == pytest.approx(2.5 * 0.02 * 9.81 / 0.5e-3 * 0.101, rel=0.011)  # the first step may not press yet
    sim.step(400)
    assert abs(sim.angular_velocity[0, 1]) < 1e-6
    assert np.abs(sim.velocity).max() < 1e-9


def test_without_friction_a_push_off_the_centre_turns_a_grain():
    """A slanted grain lands on one end: I w = a x p, p its impulse and a its arm. No material here has friction."""
    scene = scenes.plane_scene(shapes=SHAPES)
    for material in scene.materials.values():
        material.friction = 0.0
    sim = cesim.Simulation(scene, threads=1)
    q = (np.cos(0.3), 0.0, 0.0, np.sin(0.3))
    sim.add([0.0, 1.5e-3, 0.0], velocity=(0.0, -1.0, 0.0), diameter=1e-3, orientation=q, shape="pair")
    while not sim.contacts.size or not np.any(sim.contacts["impulse"]):
        moment = inertia(sim, 0)
        sim.step()
    contact = sim.contacts[np.argmax(np.abs(sim.contacts["impulse"][:, 1]))]
    arm = contact["point"] - sim.position[0]
    assert abs(arm[0]) > 0.1e-3
    turned = np.linalg.solve(moment, np.cross(arm, contact["impulse"]))
    assert np.linalg.norm(sim.angular_velocity[0]) > 100.0
    np.testing.assert_allclose(sim.angular_velocity[0], turned, rtol=0.1, atol=5.0)  # the arm is that of the touch


def test_collisions_of_clusters_keep_momentum_and_gain_no_energy():
    sim = weightless()
    rng = np.random.default_rng(3)
    n = 40
    cells = np.indices((4, 4, 4)).reshape(3, -1).T[:n] * 2.2e-3
    sim.add(
        cells,
        velocity=rng.normal(0.0, 0.3, (n, 3)),
        diameter=1e-3,
        orientation=turned(rng, n),
        angular_velocity=rng.normal(0.0, 100.0, (n, 3)),
        shape=[("pair", "flake")[k % 2] for k in range(n)],
    )
    momentum = (sim.mass[:, None] * sim.velocity).sum(axis=0)
    energy = start = sim.health.kinetic_energy
    for _ in range(100):
        sim.step()
        # Free rotation keeps the momentum; its energy swings by the square of the turn in a step.
        assert sim.health.kinetic_energy <= energy * (1.0 + 1e-3)
        energy = sim.health.kinetic_energy
    scale = (sim.mass[:, None] * np.abs(sim.velocity)).sum()
    np.testing.assert_allclose((sim.mass[:, None] * sim.velocity).sum(axis=0), momentum, atol=1e-13 * scale)
    assert energy < 0.9 * start  # they did collide


@pytest.mark.parametrize(("friction", "bound"), [(0.0, 1e-12), (0.4, 1e-8)])
def test_a_collision_keeps_the_angular_momentum_whatever_the_step(friction, bound):
    """The impulse acts in one point at one time on both, and a body turns on with the momentum that it gave.

    With friction the gap at the touch that was found, some 1e-9 of the size, is an arm.
    """
    for step in (1e-3, 4e-4, 1e-4):
        sim = weightless(friction, step=step, tolerance=1e-11)
        sim.add(
            [[0.0, 0.0, 0.0], [1.6e-3, 0.3e-3, 0.1e-3]],
            velocity=[[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]],
            diameter=1e-3,
            angular_velocity=[[5.0, 30.0, 10.0], [0.0, -20.0, 30.0]],
            shape=["pair", "flake"],
        )
        before, scale = angular_momentum(sim)
        pushes = 0
        for _ in range(round(0.012 / step)):
            sim.step()
            pushes += np.count_nonzero(sim.contacts["impulse"].any(axis=1))
        assert pushes == 1  # they met, once and in one point
        assert np.abs(angular_momentum(sim)[0] - before).max() < bound * scale


def test_a_free_body_keeps_its_angular_momentum_to_rounding():
    sim = weightless()
    sim.add([0.0, 0.0, 0.0], diameter=1e-3, angular_velocity=(40.0, 150.0, -70.0), shape="pair")
    before, scale = angular_momentum(sim)
    sim.step(2000)
    assert np.abs(angular_momentum(sim)[0] - before).max() < 1e-12 * scale
    assert np.abs(np.linalg.norm(sim.orientation, axis=1) - 1.0).max() < 1e-12


def test_without_the_gyroscopic_term_the_angular_velocity_is_kept():
    sim = weightless(gyroscopic=False)
    sim.add([0.0, 0.0, 0.0], diameter=1e-3, angular_velocity=(40.0, 150.0, -70.0), shape="flake")
    sim.step(100)
    np.testing.assert_array_equal(sim.angular_velocity[0], (40.0, 150.0, -70.0))


def test_turns_of_more_than_a_radian_in_a_step_are_told(tmp_path):
    """In the health, the result file, the snapshot and the table of a run; spheres look the same however they turn."""
    slow, fast, ball = weightless(), weightless(), weightless()
    for sim, shape, spin in ((slow, "pair", 900.0), (fast, "pair", 1100.0), (ball, None, 5000.0)):
        sim.add([0.0, 0.0, 0.0], diameter=1e-3, angular_velocity=(spin, 0.0, 0.0), shape=shape)
        sim.step()
    assert slow.health.worst_turn == pytest.approx(0.9, rel=0.2)
    assert fast.health.worst_turn > 1.0
    assert ball.health.worst_turn == 0.0
    assert "rad a step" in str(fast.health)
    assert "rad a step" not in str(ball.health)
    fast.save(tmp_path / "now.h5")
    fast.angular_velocity[:] = 0.0
    fast.step()
    assert fast.health.worst_turn > 1.0  # so far
    assert cesim.Simulation.restore(tmp_path / "now.h5").health.worst_turn == fast.health.worst_turn


def test_a_run_whose_grains_turn_too_far_in_a_step_says_so(tmp_path):
    scene = cesim.scenes.reference_machine()
    scene.numerics.step = 4e-3
    run = cesim.run(scene, 1, until="0.4 s", progress=False, save=tmp_path / "run.h5")
    assert run.health.worst_turn > 1.0
    assert "rad in a step" in str(run)
    assert cesim.Run.load(tmp_path / "run.h5").health.worst_turn == run.health.worst_turn


def heap(threads):
    scene = scenes.plane_scene(friction=0.4, shapes=SHAPES)
    scene.materials["copper"].friction, scene.materials["copper"].spinning_friction = 0.3, 0.01
    sim = cesim.Simulation(scene, threads=threads)
    rng = np.random.default_rng(8)
    n = 120
    cells = np.indices((5, 6, 4)).reshape(3, -1).T * 1.6e-3 + np.array([0.0, 1e-3, 0.0])
    names = [("flake", "pair", None)[k % 3] for k in range(n)]
    sim.add(cells, diameter=rng.uniform(0.6e-3, 1e-3, n), orientation=turned(rng, n), shape=names)
    return sim


def test_bits_of_a_heap_of_clusters_do_not_depend_on_threads(tmp_path):
    hashes = []
    for threads in (1, 2, 3, 5, 8):
        sim = heap(threads)
        sim.step(40)
        if threads == 2:
            sim.save(tmp_path / "middle.h5")
        sim.step(20)
        hashes.append(sim.state_hash())
    assert len(set(hashes)) == 1
    restored = cesim.Simulation.restore(tmp_path / "middle.h5", threads=3)
    restored.step(20)
    assert restored.state_hash() == hashes[0]
