"""Numbers far out of every scene are refused, or leave it and are counted (docs/numerics.md 3, cases 32, 37).

What else breaks careless numbers is in the table of hard cases: test_hard_cases.py.
"""

import numpy as np
import pytest
from scenes import plane_scene

import cesim


def far_engine(offset):
    """A floor at y = offset, at (offset, offset, offset); the tree of scenes ends at 10 m, the engine at 1000 m."""
    definition = plane_scene(friction=0.3).definition()
    definition["surfaces"][0]["position"] = (offset, offset, offset)
    definition["lower"], definition["upper"] = (-1e4,) * 3, (1e4,) * 3
    return cesim.engine.Scene(definition)


def test_a_million_metres_from_the_origin_is_refused():
    with pytest.raises(cesim.engine.InputError, match="position"):
        far_engine(1e6)
    scene = far_engine(0.0)
    row = (np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1, np.int32), [1e-3], [0.0])
    with pytest.raises(cesim.engine.InputError, match="position of grain 0"):
        scene.add([[2e6, 0.0, 0.0]], *row)
    assert scene.count == 0


def test_a_grain_at_three_times_the_speed_of_light_leaves_the_bounds_and_is_counted():
    sim = cesim.Simulation(plane_scene(), threads=1)
    sim.add([(0.0, 1e-3, 0.0)], velocity=(0.0, 0.0, 9e3), material="copper", diameter=1e-3)
    sim.velocity[0, 2] = 9e8  # finite, and out of every scene in one step
    sim.step(5)
    assert sim.count == 0
    assert len(sim.lost) == 1
    assert sim.balance.closed
