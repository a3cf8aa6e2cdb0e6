"""Overlaps are taken back by moving grains, never through their velocities (docs/numerics.md 1).

Cases 20 and 21 of docs/numerics.md 3 are in test_hard_cases.py.
"""

import numpy as np
import pytest
from scenes import plane_scene

import cesim

D = 1e-3


def free_scene(step=1e-3, gravity=0.0, restitution=0.0):
    """Grains alone in space, or over a plane when there is gravity."""
    grains = {"kind": "conductor", "density": 2500.0, "friction": 0.2, "restitution": restitution}
    scene = plane_scene(friction=0.2, restitution=restitution, step=step, materials={"grain": grains})
    scene.gravity = (0.0, -gravity, 0.0)
    if gravity == 0.0:
        scene.walls = []
    return scene


def cloud(position, diameter=D, **rest):
    sim = cesim.Simulation(free_scene(**rest), threads=2)
    sim.add(position, material="grain", diameter=diameter)
    return sim


def overlaps(sim):
    """Overlap of every pair over the smaller diameter, (n (n - 1)/2,)."""
    x, r = sim.position, 0.5 * sim.diameter
    first, second = np.triu_indices(sim.count, 1)
    gap = np.linalg.norm(x[first] - x[second], axis=1) - r[first] - r[second]
    return -gap / (2.0 * np.minimum(r[first], r[second]))


@pytest.mark.parametrize("share", [0.01, 0.5, 0.99])
def test_an_overlap_is_shared_by_mass_and_leaves_no_velocity(share):
    sim = cloud([(0.0, 0.0, 0.0), (1.5 * D * (1.0 - share), 0.0, 0.0)], [D, 2.0 * D])
    sim.step()
    a, b = sim.mass
    depth = 1.5 * D * share
    assert sim.position[0, 0] == pytest.approx(-depth * b / (a + b), rel=1e-6)
    assert sim.position[1, 0] == pytest.approx(1.5 * D * (1.0 - share) + depth * a / (a + b), rel=1e-6)
    assert np.abs(sim.velocity).max() < 1e-15


@pytest.mark.parametrize("restitution", [0.0, 1.0])
def test_a_packed_cloud_of_overlapping_grains_comes_to_rest_without_gaining_energy(restitution):
    """200 spheres dropped at random into a tenth of the space they need: energy would be born of every overlap."""
    rng = np.random.default_rng(1)
    sim = cloud(rng.uniform(0.0, 3e-3, (200, 3)), rng.uniform(0.5e-3, 1e-3, 200), restitution=restitution)
    worst = overlaps(sim).max()
    for _ in range(100):
        sim.step()
        assert np.abs(sim.velocity).max() < 1e-12
    assert worst > 0.5
    assert overlaps(sim).max() < 0.02


def test_a_moving_pair_keeps_its_momentum_while_its_overlap_goes():
    sim = cloud([(0.0, 0.0, 0.0), (0.8 * D, 0.0, 0.0)])
    sim.velocity[:] = (0.3, -0.2, 0.1)
    sim.angular_velocity[:] = (0.0, 40.0, 0.0)
    sim.step(5)
    assert sim.velocity.mean(axis=0) == pytest.approx(np.array([0.3, -0.2, 0.1]), rel=1e-12)
    assert overlaps(sim).max() < 1e-6
