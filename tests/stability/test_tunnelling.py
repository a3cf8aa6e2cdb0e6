"""Nothing passes through anything, and nothing bounces off air (docs/numerics.md 3, cases 22, 23, 24).

Shots are fired at a blade whose faces are at x = -t/2 and x = t/2, with its edges at y = +-50 mm and z = +-150 mm.
"""

import numpy as np
import pytest
from scenes import OPEN

import cesim

SHOTS = 100_000
D = 1e-4  # m, diameter of the shots
HALF = np.array([0.0, 0.05, 0.15])  # m, half the blade's edges; x is its thickness


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


def blade_distance(points, thickness):
    """Signed distance (n,) from the blade, and the normals (n, 3) where it is positive."""
    beyond = np.abs(points) - HALF - (0.5 * thickness, 0.0, 0.0)
    outside = np.maximum(beyond, 0.0)
    distance = np.linalg.norm(outside, axis=1)
    with np.errstate(invalid="ignore"):
        normals = np.copysign(outside, points) / distance[:, None]
    return np.where(distance > 0.0, distance, beyond.max(axis=1)), normals


def crosses(start, end, thickness):
    """Which of the straight ways pass through the middle plane of the blade, inside its edges."""
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = -start[:, 0] / (end[:, 0] - start[:, 0])
        there = start + fraction[:, None] * (end - start)
    inside = (np.abs(there[:, 1:]) <= HALF[1:]).all(axis=1)
    return (fraction >= 0.0) & (fraction <= 1.0) & inside


def shots(thickness, stride, count=SHOTS, seed=1):
    """Positions on the left of the blade, within a stride of it, and flights (m) of one step, most of them at it."""
    rng = np.random.default_rng(seed)
    reach = 0.5 * (thickness + D)
    position = np.column_stack(
        [-reach - rng.uniform(0.0, stride, count), rng.uniform(-0.055, 0.055, count), rng.uniform(-0.155, 0.155, count)]
    )
    up, aside = rng.uniform(-1.4, 1.4, count), rng.uniform(-0.6, 0.6, count)
    way = np.column_stack([np.cos(up) * np.cos(aside), np.sin(up) * np.cos(aside), np.sin(aside)])
    return position, stride * way


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("stride", [3e-3, 10e-3])
@pytest.mark.parametrize("thickness", [0.5e-3, 0.0])
def test_not_one_of_1e5_shots_passes_through_a_blade(thickness, stride, restitution):
    """Case 22: 0.1 mm at 30 and at 100 diameters a step. The way is the one to the hit, and the one from there."""
    position, flight = shots(thickness, stride)
    scene = range_scene(thickness, friction=0.3, restitution=restitution)
    sim = fired(scene, position, flight / scene.numerics.step)
    assert crosses(position, position + flight, thickness).sum() > 0.4 * SHOTS
    for _ in range(3):
        before = sim.position.copy()
        sim.step()
        now, hits = sim.position.copy(), sim.contacts
        corner = before.copy()
        corner[hits["a"]] = hits["point"] + 0.5 * D * hits["normal"]
        through = crosses(before, corner, thickness) | crosses(corner, now, thickness)
        assert through.sum() == 0
        assert blade_distance(now, thickness)[0].min() > 0.5 * D * (1.0 - 2e-6)


@pytest.mark.parametrize("gravity", [0.0, 9.81])
@pytest.mark.parametrize("thickness", [0.5e-3, 0.0])
def test_the_point_of_a_hit_is_exact_up_to_the_fall_of_half_a_step(thickness, gravity):
    """Against the plane face in closed form: 1e-3 d, and g h^2/8 for the parabola that is taken as its chord."""
    position, flight = shots(thickness, 3e-3, 20_000)
    position[:, 1:] *= 0.9  # away from the edges
    step = 1e-3
    sim = fired(range_scene(thickness, gravity=gravity), position, flight / step)
    sim.step()
    hits = sim.contacts[np.linalg.norm(sim.contacts["impulse"], axis=1) > 0.0]
    hits = hits[np.abs(hits["normal"][:, 0]) == 1.0]
    assert len(hits) > 5000
    start, way = position[hits["a"]], flight[hits["a"]]
    time = step * (-0.5 * (thickness + D) - start[:, 0]) / way[:, 0]
    exact = start + way * (time / step)[:, None]
    exact[:, 1] -= 0.5 * gravity * time**2
    exact[:, 0] = -0.5 * thickness
    assert np.linalg.norm(hits["point"] - exact, axis=1).max() < 1e-3 * D + gravity * step**2 / 8.0


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


# ---- grains that meet (23) -------------------------------------------------------------------------------------------


def meetings(impact, seed, step=1e-3, speed=6.0, count=10_000):
    """Pairs in cells of their own that fly at each other: positions and velocities, (2 count, 3), by turns."""
    rng = np.random.default_rng(seed)
    cells = (np.indices((22, 22, 22)).reshape(3, -1).T[:count] - 10.5) * 0.05
    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    across = np.cross(way, rng.normal(size=(count, 3)))
    across /= np.linalg.norm(across, axis=1)[:, None]
    ahead = rng.uniform(1.5 * D, 0.9 * speed * step, count)
    offset = ahead[:, None] * way + impact[:, None] * across
    position = np.stack([cells - 0.5 * offset, cells + 0.5 * offset], axis=1).reshape(-1, 3)
    velocity = np.stack([0.5 * speed * way, -0.5 * speed * way], axis=1).reshape(-1, 3)
    return position, velocity, way, across


@pytest.mark.parametrize("restitution", [0.0, 1.0])
def test_grains_that_meet_at_60_diameters_a_step_never_miss(restitution):
    """Case 23, and how they leave: the velocity along the line of centres turns, u' = u - (1 + e)(u n) n/2."""
    rng = np.random.default_rng(2)
    impact = D * np.sqrt(rng.uniform(0.0, 0.999**2, 10_000))
    position, velocity, way, across = meetings(impact, 3)
    sim = fired(range_scene(restitution=restitution, grain_contact=True), position, velocity)
    sim.step()
    normal = (impact[:, None] * across + np.sqrt(D**2 - impact**2)[:, None] * way) / D  # from the first to the second
    approach = 6.0 * np.sqrt(1.0 - (impact / D) ** 2)
    change = 0.5 * (1.0 + restitution) * approach[:, None] * normal
    expected = velocity.reshape(-1, 2, 3) + np.stack([-change, change], axis=1)
    assert len(sim.contacts) == 10_000
    error = np.abs(sim.velocity.reshape(-1, 2, 3) - expected)
    assert error.max() < 1e-5 * 6.0  # the touch is found to 1e-7 of a radius
    assert error[impact < 0.99 * D].max() < 1e-6 * 6.0


def test_grains_that_pass_each_other_by_a_thousandth_of_a_diameter_do_not_feel_it():
    """Ghost hits: 0 of 1e4 at more than 1.001 d (cases 23, 24)."""
    impact = D * np.random.default_rng(4).uniform(1.001, 1.2, 10_000)
    position, velocity, *_ = meetings(impact, 5)
    sim = fired(range_scene(grain_contact=True), position, velocity)
    for _ in range(3):
        sim.step()
    assert np.abs(sim.velocity - velocity).max() < 1e-9


@pytest.mark.parametrize("thickness", [0.5e-3, 0.0])
def test_a_shot_that_passes_a_blade_by_a_thousandth_of_a_diameter_does_not_feel_it(thickness):
    """Case 24. The distance of a point on a straight way from a convex body has one minimum: by trisection."""
    position, flight = shots(thickness, 3e-3, 60_000, seed=6)
    edge = 0.05 * np.sign(position[:, 1])
    position[:, 1] = edge + (position[:, 1] - edge) * 0.05
    low, high = np.zeros(len(position)), np.full(len(position), 3.0)
    for _ in range(60):
        third = (high - low) / 3.0
        one = blade_distance(position + (low + third)[:, None] * flight, thickness)[0]
        other = blade_distance(position + (high - third)[:, None] * flight, thickness)[0]
        low, high = np.where(one > other, low + third, low), np.where(one > other, high, high - third)
    nearest = blade_distance(position + low[:, None] * flight, thickness)[0]
    misses = (nearest > 1.001 * 0.5 * D) & (nearest < 1.5 * 0.5 * D)
    assert misses.sum() > 50
    sim = fired(range_scene(thickness, friction=0.5, restitution=0.5), position[misses], flight[misses] / 1e-3)
    sim.step(3)
    assert np.abs(sim.velocity - flight[misses] / 1e-3).max() < 1e-9
    assert sim.health.active_contacts == 0


def test_grains_skim_the_drum_and_its_rim_without_feeling_it():
    """Tangents to the drum's side and over the rim of its caps, a thousandth of a radius away."""
    rng = np.random.default_rng(7)
    n, radius = 5000, 0.16
    scene = cesim.Scene(
        drum=cesim.Drum(friction=0.5, restitution=0.5),
        materials={"shot": {"kind": "conductor", "density": 2500.0}},
        numerics={"grain_contact": False},
        gravity=(0.0, 0.0, 0.0),
        bounds=OPEN,
        effects={"drag": "off"},
    )
    gap = 0.5 * D * rng.uniform(1.001, 1.1, n)
    at, lean = rng.uniform(0.0, 2.0 * np.pi, n), rng.uniform(-1.0, 1.0, n)
    out = np.column_stack([np.cos(at), np.sin(at), np.zeros(n)])
    along = np.column_stack([-np.sin(at) * np.cos(lean), np.cos(at) * np.cos(lean), np.sin(lean)])
    touch = (radius + gap)[:, None] * out + np.column_stack([np.zeros((n, 2)), rng.uniform(-0.14, 0.14, n)])
    rim = rng.random(n) < 0.3
    slope = rng.uniform(0.3, 1.2, n)
    tilted = np.cos(slope)[:, None] * out + np.sin(slope)[:, None] * (0.0, 0.0, 1.0)
    over = np.cos(slope)[:, None] * (0.0, 0.0, 1.0) - np.sin(slope)[:, None] * out
    touch[rim] = (radius * out + (0.0, 0.0, 0.15) + gap[:, None] * tilted)[rim]
    along[rim] = over[rim]
    velocity = 3.0 * along
    sim = fired(scene, touch - velocity * rng.uniform(0.2e-3, 2.8e-3, n)[:, None], velocity)
    sim.step(3)
    assert np.abs(sim.velocity - velocity).max() < 1e-9


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
