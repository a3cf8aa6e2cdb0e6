"""The same bits for any number of threads, after a restore, when repeated (docs/numerics.md 2)."""

import numpy as np
import pytest

import cesim
import cesim.scenes

THREADS = [1, 2, 3, 5, 8]


def dense(threads, order=None, count=1200):
    """Grains that fall into a heap in a box 20 mm wide: one island, hundreds of contacts."""
    scene = cesim.scenes.settling_box()
    for wall in scene.walls:
        wall.friction, wall.restitution, wall.rolling_friction = 0.4, 0.3, 0.05
    for wall, (x, z) in zip(scene.walls[1:], ((-1, 0), (1, 0), (0, -1), (0, 1)), strict=True):
        wall.position = (0.01 * x, 0.0, 0.01 * z)
    scene.materials["ABS"].friction, scene.materials["ABS"].rolling_friction = 0.3, 0.05
    scene.numerics.max_iterations = 40
    sim = cesim.Simulation(scene, threads=threads)
    rng = np.random.default_rng(5)
    cells = np.indices((12, 12, 12)).reshape(3, -1).T[:, [1, 0, 2]][:count] * 1.5e-3
    position = cells + np.array([-8.2e-3, 1e-3, -8.2e-3]) + rng.uniform(-1e-4, 1e-4, (count, 3))
    diameter = rng.uniform(0.6e-3, 1.2e-3, count)
    velocity = rng.normal(0.0, 0.2, (count, 3))
    order = np.arange(count) if order is None else order
    material = np.where(rng.random(count) < 0.5, "ABS", "copper")
    sim.add(position[order], velocity[order], list(material[order]), diameter[order])
    return sim


def reference(threads, seed=1):
    """The reference machine at ten times its feed."""
    scene = cesim.scenes.reference_machine("spheres")
    scene.feed.rate = "10000 1/s"
    return cesim.Simulation(scene, seed, threads)


def hashes(make, threads, steps, every):
    sim, seen = make(threads), []
    for _ in range(steps // every):
        sim.step(every)
        seen.append(sim.state_hash())
    return seen


SCENES = {"dense": (dense, 80, 20), "reference": (reference, 700, 100)}


@pytest.fixture(scope="module")
def serial():
    """Hashes of both scenes on one thread."""
    return {name: hashes(make, 1, steps, every) for name, (make, steps, every) in SCENES.items()}


@pytest.mark.parametrize("threads", THREADS)
@pytest.mark.parametrize("name", SCENES)
def test_bits_do_not_depend_on_threads(name, threads, serial):
    """And on nothing else: one thread is run again, too."""
    make, steps, every = SCENES[name]
    assert hashes(make, threads, steps, every) == serial[name]
    assert len(set(serial[name])) == len(serial[name])


def test_the_hash_sees_one_bit_of_one_grain():
    one, other = dense(1), dense(1)
    assert one.state_hash() == other.state_hash()
    other.velocity[700, 1] = np.nextafter(other.velocity[700, 1], 1.0)
    assert one.state_hash() != other.state_hash()


def test_the_seed_changes_the_feed_and_nothing_else_does():
    one, other, third = reference(1, seed=1), reference(2, seed=1), reference(1, seed=2)
    for sim in (one, other, third):
        sim.step(50)
    assert one.state_hash() == other.state_hash() != third.state_hash()


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("at", [0, 1, 7, 60, 500])
def test_a_restored_state_goes_on_bit_for_bit_with_other_threads(name, at, tmp_path):
    """Warm-start impulses, feed and clock are part of the state: saved at k, loaded afresh, other number of threads."""
    make, steps, _ = SCENES[name]
    if at > steps:
        pytest.skip("the heap is at rest by then")
    sim = make(2)
    sim.step(at)
    sim.save(tmp_path / "state.h5")
    fresh = cesim.Simulation.restore(tmp_path / "state.h5", threads=3)
    assert fresh.state_hash() == sim.state_hash()
    for further in (1, 1, 30):
        sim.step(further)
        fresh.step(further)
        assert fresh.state_hash() == sim.state_hash()
    np.testing.assert_array_equal(fresh.contacts, sim.contacts)
    np.testing.assert_array_equal(fresh.landings, sim.landings)
    assert fresh.balance == sim.balance
    assert fresh.time == sim.time


def test_a_state_goes_back_in_time_in_the_scene_that_made_it():
    sim = reference(2)
    sim.step(40)
    state, then = sim.engine.state(), sim.state_hash()
    sim.step(60)
    later = sim.state_hash()
    sim.engine.restore(state)
    assert sim.state_hash() == then
    sim.step(60)
    assert sim.state_hash() == later
