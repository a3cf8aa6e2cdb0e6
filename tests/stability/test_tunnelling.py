"""Nothing passes through anything, and nothing bounces off air (docs/numerics.md 1): edges, and crowds.

Cases 22, 23 and 24 of docs/numerics.md 3 are in test_hard_cases.py.

Shots are fired at a blade whose faces are at x = -t/2 and x = t/2, with its edges at y = +-50 mm and z = +-150 mm.
"""

import numpy as np
import pytest
from scenes import OPEN

import cesim

D = 1e-4  # m, diameter of the shots


def range_scene(thickness=None, *, friction=0.0, restitution=0.0, gravity=0.0, step=1e-3, grain_contact=False, **rest):
    """A shooting range without air: one blade, or none."""
    blade = {"friction": friction, "restitution": restitution}
    splitters = []
    if thickness is not None:
        splitters = [cesim.Splitter(tip=(0.0, 0.05), length=0.1, width=0.3, thickness=thickness, **blade)]
    return cesim.Scene(
        splitters=splitters,
        materials={"shot": {"kind": "conductor", "density": 2500.0, "restitution": restitution, "friction": friction}},
        numerics={"step": step, "grain_contact": grain_contact},
        gravity=(0.0, -gravity, 0.0),
        bounds=OPEN,
        effects={"drag": "off"},
        **rest,
    )


def fired(scene, position, velocity, diameter=D):
    sim = cesim.Simulation(scene, threads=2)
    sim.add(position, velocity=velocity, material="shot", diameter=diameter)
    return sim


def test_a_shot_that_hits_an_edge_meets_it_where_the_closest_approach_says():
    """Flights past the upper edge of a blade of no thickness: a sphere against a line, in closed form."""
    rng = np.random.default_rng(5)
    n = 20_000
    aim = rng.uniform(-1.5, 1.5, n) * 0.5 * D  # of the straight way above the edge
    tilt = rng.uniform(-0.4, 0.4, n)
    way = np.column_stack([np.cos(tilt), np.sin(tilt), np.zeros(n)])
    across = np.column_stack([-np.sin(tilt), np.cos(tilt), np.zeros(n)])
    start = np.array([0.0, 0.05, 0.0]) + aim[:, None] * across - 1.5e-3 * way
    sim = fired(range_scene(0.0), start, 3.0 * way)
    sim.step()
    hit = np.zeros(n, bool)
    hits = sim.contacts[np.linalg.norm(sim.contacts["impulse"], axis=1) > 0.0]
    hit[hits["a"]] = True
    near = np.abs(np.abs(aim) - 0.5 * D) < 1e-6 * D
    assert (hit | near)[aim < 0.5 * D].all()
    assert not (hit & ~near)[aim > 0.5 * D].any()
    on_edge = hits[(aim[hits["a"]] > 0.0) & (tilt[hits["a"]] < 0.0)]  # the others meet the face first
    assert len(on_edge) > 1000
    where = aim[on_edge["a"]]
    center = where[:, None] * across[on_edge["a"]] - np.sqrt((0.5 * D) ** 2 - where**2)[:, None] * way[on_edge["a"]]
    assert np.abs(on_edge["normal"] - center / (0.5 * D)).max() < 1e-3


# ---- crowds ----------------------------------------------------------------------------------------------------------


def through_after_crush(thickness, seed=0, speed=1.0):
    """1500 grains of 0.2-0.5 mm, close together, run into a blade: how many are behind it after 10 steps."""
    rng = np.random.default_rng(seed)
    cells = np.indices((10, 30, 5)).reshape(3, -1).T * 6e-4
    position = np.array([-3e-4 - 0.5 * thickness, -0.02, 0.0]) + cells * (-1.0, 1.0, 1.0)
    position += rng.uniform(-4e-5, 4e-5, position.shape)
    velocity = np.column_stack([speed * rng.uniform(0.3, 1.0, 1500), rng.normal(0.0, 0.3 * speed, (1500, 2))])
    scene = range_scene(thickness, friction=0.2, grain_contact=True)
    sim = fired(scene, position, velocity, rng.uniform(2e-4, 5e-4, 1500))
    sim.step(10)
    return int(((sim.position[:, 0] > 0.0) & (np.abs(sim.position[:, 1]) < 0.045)).sum())


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_a_crowd_is_not_pushed_through_a_blade_of_half_a_millimetre(seed):
    assert through_after_crush(0.5e-3, seed) == 0


@pytest.mark.parametrize(("restitution", "thickness"), [(1.0, 0.0), (1.0, 0.5e-3), (0.0, 0.0)])
def test_a_grain_that_is_hit_in_mid_step_stops_at_the_blade(restitution, thickness):
    """One grain at rest before the blade, one of its size comes from behind at 0.6 m/s, on the normal of the blade.

    Found: with e = 1 it ends 0.1 mm behind a blade of no thickness, with e = 0 it sinks in by 30 % of its radius.
    """
    face, d = -0.5 * thickness, 0.5e-3
    scene = range_scene(thickness, restitution=restitution, grain_contact=True)
    rest = face - 0.5 * d - 0.2e-3
    sim = fired(scene, [(rest, 0.0, 0.0), (rest - d - 0.05e-3, 0.0, 0.0)], [(0.0, 0.0, 0.0), (0.6, 0.0, 0.0)], d)
    for _ in range(5):
        sim.step()
        assert (face - sim.position[0, 0]) / (0.5 * d) > 0.99


@pytest.mark.slow
def test_a_crowd_is_not_pushed_through_a_blade_of_no_thickness():
    assert sum(through_after_crush(0.0, seed) for seed in range(3)) == 0
