"""The contacts that the engine finds are those that brute force finds in NumPy (docs/numerics.md 1; 3, case 02)."""

import numpy as np
import pytest
from scenes import OPEN

import cesim


def cloud_scene(**parts):
    return cesim.Scene(
        materials={"grain": {"kind": "conductor", "density": 2500.0, "friction": 0.0}},
        gravity=(0.0, 0.0, 0.0),
        bounds=OPEN,
        effects={"drag": "off"},
        **parts,
    )


def one_step(scene, position, diameter, velocity=0.0, threads=2):
    """Contacts of one step from the given state."""
    scene.numerics.max_iterations = 1  # which contacts there are is asked, not what they do
    sim = cesim.Simulation(scene, threads=threads)
    sim.add(position, velocity=np.broadcast_to(velocity, position.shape), material="grain", diameter=diameter)
    sim.step()
    return sim.contacts


def pairs_of(contacts):
    return set(zip(contacts["a"].tolist(), contacts["b"].tolist(), strict=True))


def sizes(rng, count, ratio):
    """Diameters that span a ratio, most of them small, a few large."""
    d = 1e-3 * ratio ** -rng.random(count)
    d[: max(1, count // 50)] = 1e-3
    d[-1] = 1e-3 / ratio
    return rng.permutation(d)


def brute_force(position, diameter):
    """Index pairs (a < b), gaps and normals from b to a, of all pairs."""
    a, b = np.triu_indices(len(position), 1)
    offset = position[a] - position[b]
    distance = np.linalg.norm(offset, axis=1)
    return a, b, distance - 0.5 * (diameter[a] + diameter[b]), offset / distance[:, None]


@pytest.mark.parametrize("ratio", [1.0, 4.0, 40.0, 400.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_contacts_of_a_random_cloud_are_those_of_brute_force(ratio, seed):
    """Every touching pair once, with its gap and normal; nothing that is farther than a tenth of a radius."""
    rng = np.random.default_rng(seed)
    n = 1500
    diameter = sizes(rng, n, ratio)
    box = (n * np.mean(diameter**3)) ** (1.0 / 3.0) * 1.3
    position = rng.uniform(-0.5 * box, 0.5 * box, (n, 3)) + rng.uniform(-1.0, 1.0, 3)  # cells of either sign
    contacts = one_step(cloud_scene(), position, diameter)
    a, b, gap, normal = brute_force(position, diameter)
    touching = gap <= 0.0
    assert touching.sum() > 500
    found = pairs_of(contacts)
    assert len(found) == len(contacts)
    assert set(zip(a[touching].tolist(), b[touching].tolist(), strict=True)) <= found
    index = {pair: k for k, pair in enumerate(zip(a.tolist(), b.tolist(), strict=True))}
    k = np.array([index[pair] for pair in zip(contacts["a"].tolist(), contacts["b"].tolist(), strict=True)])
    assert np.abs(contacts["gap"] - gap[k]).max() < 1e-15
    assert np.abs(contacts["normal"] - normal[k]).max() < 1e-9
    assert (gap[k] <= 0.1 * diameter[a[k]] + 0.1 * diameter[b[k]]).all()
    order = np.lexsort((contacts["b"], contacts["a"]))
    assert (order == np.arange(len(order))).all()  # canonical, whatever found them


@pytest.mark.parametrize("stride", [0.5, 10.0])
@pytest.mark.parametrize("ratio", [1.0, 40.0])
def test_the_collisions_of_a_flying_cloud_are_those_of_brute_force(ratio, stride):
    """Swept spheres: every pair whose straight ways come nearer than the sum of the radii within the step is there."""
    rng = np.random.default_rng(7)
    n = 800
    diameter = sizes(rng, n, ratio)
    box = (n * np.mean(diameter**3)) ** (1.0 / 3.0) * (3.0 if stride < 1.0 else 5.0)
    position = rng.uniform(-0.5 * box, 0.5 * box, (n, 3))
    way = rng.normal(size=(n, 3)) * stride * np.mean(diameter)
    contacts = one_step(cloud_scene(), position, diameter, way / 1e-3)
    a, b, *_ = brute_force(position, diameter)
    offset, path = position[a] - position[b], way[a] - way[b]
    fraction = np.clip(-(offset * path).sum(axis=1) / np.square(path).sum(axis=1), 0.0, 1.0)
    nearest = np.linalg.norm(offset + fraction[:, None] * path, axis=1) - 0.5 * (diameter[a] + diameter[b])
    meet = nearest < -1e-6 * np.minimum(diameter[a], diameter[b])
    assert meet.sum() > 40
    assert set(zip(a[meet].tolist(), b[meet].tolist(), strict=True)) <= pairs_of(contacts)


def test_clustered_far_and_aligned_grains_are_found_too():
    """What a grid can get wrong: all in one cell, exactly on cell borders, distant clusters with colliding hashes."""
    lattice = np.indices((8, 8, 8)).reshape(3, -1).T * 1e-3
    position = np.concatenate([lattice + shift for shift in ((0, 0, 0), (-7.5, 3.25, 1.0), (8.0, -8.0, 8.0))])
    diameter = np.full(len(position), 1.0000001e-3)
    contacts = one_step(cloud_scene(), position, diameter)
    a, b, gap, _ = brute_force(position, diameter)
    expected = set(zip(a[gap <= 0.0].tolist(), b[gap <= 0.0].tolist(), strict=True))
    assert len(expected) == 3 * 3 * 7 * 64
    assert pairs_of(contacts) == expected


# ---- surfaces --------------------------------------------------------------------------------------------------------


def plane(point, normal):
    normal = np.asarray(normal) / np.linalg.norm(normal)

    def distance(points):
        return (points - point) @ normal

    return distance


def cylinder(center, radius, length):
    def distance(points):
        side = np.hypot(*(points[:, :2] - center).T) - radius
        cap = np.abs(points[:, 2]) - 0.5 * length
        outside = np.hypot(np.maximum(side, 0.0), np.maximum(cap, 0.0))
        return np.where(outside > 0.0, outside, np.maximum(side, cap))

    return distance


def box(center, angle, size):
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    up = np.array([-np.sin(angle), np.cos(angle), 0.0])
    axes = np.stack([along, up, (0.0, 0.0, 1.0)])

    def distance(points):
        beyond = np.abs((points - center) @ axes.T) - 0.5 * np.asarray(size)
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return np.where(outside > 0.0, outside, beyond.max(axis=1))

    return distance


def machine():
    """Every shape, lying askew, and its distance in NumPy, in the order of the engine's surfaces."""
    tilt, tip = 0.47, np.array([0.26, 0.1])
    foot = np.array([np.sin(tilt), -np.cos(tilt)]) * 0.15
    scene = cloud_scene(
        drum=cesim.Drum(),
        brush=cesim.Brush(),
        splitters=[cesim.Splitter(tip=tuple(tip), tilt=tilt)],
        walls=[cesim.Wall(position=(0.3, 0.1, 0.0), normal=(-1.0, 0.4, 0.2))],
        numerics={"grain_contact": False},
    )
    distances = [
        cylinder((0.0, 0.0), 0.160, 0.300),
        cylinder((-0.2124, 0.0057), 0.053, 0.300),
        box((*(tip + 0.5 * foot), 0.0), tilt, (1e-3, 0.15, 0.3)),
        plane((0.3, 0.1, 0.0), (-1.0, 0.4, 0.2)),
    ]
    return scene, distances


@pytest.mark.parametrize("velocity", [0.0, 2.0])
def test_the_contacts_with_surfaces_are_those_of_brute_force(velocity):
    scene, distances = machine()
    rng = np.random.default_rng(3)
    n = 400_000
    position = rng.uniform((-0.3, -0.2, -0.17), (0.35, 0.25, 0.17), (n, 3))
    diameter = 1e-2 * 400.0 ** -rng.random(n)
    gaps = np.stack([distance(position) for distance in distances], axis=1) - 0.5 * diameter[:, None]
    near = (gaps > -0.5 * diameter[:, None]).all(axis=1)  # a centre inside a body has no normal to speak of
    near &= gaps.min(axis=1) < 3e-3
    position, diameter, gaps = position[near], diameter[near], gaps[near]
    motion = velocity * rng.normal(size=position.shape)
    contacts = one_step(scene, position, diameter, motion)
    surface = -1 - contacts["b"]
    found = pairs_of(contacts)
    assert len(found) == len(contacts)
    touching = np.argwhere(gaps <= 0.0)
    assert {(int(i), -1 - int(s)) for i, s in touching} <= found
    assert np.bincount(touching[:, 1], minlength=4).min() > 80
    assert np.abs(contacts["gap"] - gaps[contacts["a"], surface]).max() < 1e-15
    if velocity == 0.0:
        radius = 0.5 * diameter[contacts["a"]]
        assert (contacts["gap"] <= 0.1 * radius).all()
        foot = contacts["point"] + contacts["normal"] * radius[:, None]
        assert np.abs(foot - position[contacts["a"]]).max() < 1e-15
    else:
        ways = np.linspace(0.0, 1e-3, 201)
        for s, distance in enumerate(distances):
            nearest = np.min([distance(position + t * motion) for t in ways], axis=0) - 0.5 * diameter
            deep = np.flatnonzero(nearest < -1e-6 * diameter)
            assert {(int(i), -1 - s) for i in deep} <= found
