"""The reference machine at 5 000 grains/s of 0.5-1 mm spheres, h = 1e-3, default tolerance (docs/numerics.md 3)."""

import math

import numpy as np
import pytest

import cesim
import cesim.scenes

DRUM = 0.160
DURATION = 1.5  # s: the first grains land after 0.9 s


def machine(rate="5000 1/s"):
    scene = cesim.scenes.reference_machine("spheres")
    scene.feed.rate = rate
    scene.feed.size = cesim.Uniform(least="0.5 mm", most="1 mm")
    scene.collect = cesim.Collect(y=-0.26)  # below both blades, so that they are hit
    assert scene.numerics.step == 1e-3
    assert scene.numerics.tolerance is None
    return scene


def blade_of(splitter):
    """Centre and axes (along the thickness, down) in the xy plane."""
    down = np.array([math.sin(splitter.tilt), -math.cos(splitter.tilt)])
    across = np.array([math.cos(splitter.tilt), math.sin(splitter.tilt)])
    return np.array(splitter.tip) + 0.5 * splitter.length * down, across, down


def sides_of(splitter, position):
    """Signed distance of centres from the middle plane of a blade, and whether they are beside it."""
    center, across, down = blade_of(splitter)
    offset = position[:, :2] - center
    return offset @ across, np.abs(offset @ down) < 0.5 * splitter.length


class Watch:
    """What is looked at in every step of the run."""

    def __init__(self, duration=DURATION):
        self.scene = machine()
        self.sim = cesim.Simulation(self.scene, threads=2)
        self.in_drum, self.in_blade, self.through, self.unconverged = [], [], 0, []
        self.drum_slip = []
        self.residuals = []
        before = {}
        for _ in range(round(duration / 1e-3)):
            self.sim.step()
            before = self.look(before)

    def look(self, before):
        sim = self.sim
        health = sim.health
        self.residuals.append(health.residual)
        self.unconverged.append(health.unconverged)
        if sim.count == 0:
            return {}
        x, r, ids = sim.position, 0.5 * sim.diameter, sim.ids
        over = np.abs(x[:, 2]) <= 0.15
        self.in_drum.append(float((1.0 - (np.hypot(x[:, 0], x[:, 1]) - DRUM) / r)[over].max(initial=-np.inf)))
        sides = {}
        for k, splitter in enumerate(self.scene.splitters):
            side, beside = sides_of(splitter, x)
            depth = (1.0 - (np.abs(side) - 0.5 * splitter.thickness) / r)[beside]
            self.in_blade.append(float(depth.max(initial=-np.inf)))
            for grain, s in zip(ids[beside].tolist(), side[beside].tolist(), strict=True):
                sides[k, grain] = s
                self.through += before.get((k, grain), s) * s < 0.0
        return sides


@pytest.fixture(scope="module")
def watch():
    return Watch()


def test_no_grain_sinks_into_the_drum_by_more_than_a_percent_of_its_radius(watch):
    """Found: 1e-5 of a radius over 5 s. Contacts that were sought too narrowly made it 1.07 % once in 1.5 s."""
    depth = np.array(watch.in_drum)
    assert depth.max() < 0.01
    assert (depth > 1e-7).any(), "nothing ever pressed on the drum"


def test_no_grain_passes_a_splitter_nor_sinks_into_it(watch):
    assert watch.through == 0
    assert max(watch.in_blade) < 0.01
    names = watch.sim.surface_names
    landings = watch.sim.landings
    hit = landings[np.isin(landings["surface"], [names.index("splitters[0]"), names.index("splitters[1]")])]
    assert len(hit) > 100, "the blades were not hit"


def test_mass_is_balanced_exactly(watch):
    balance = watch.sim.balance
    assert balance.closed
    assert balance.fed.count == balance.landed.count + balance.resident.count + balance.lost.count
    assert balance.fed.kg == pytest.approx(balance.landed.kg + balance.resident.kg + balance.lost.kg, rel=1e-15)
    assert balance.landed.count == len(watch.sim.landings) > 500
    assert balance.resident.count == watch.sim.count
    assert balance.lost.count == len(watch.sim.lost) == 0
    assert balance.fed.count == pytest.approx(5000 * DURATION, abs=10)
    assert balance.landed.kg == pytest.approx(watch.sim.landings["mass"].sum(), rel=1e-12)


def test_grains_land_on_the_plane_inside_a_step(watch):
    """The crossing is located within the step: at 2 m/s a whole step would be 2 mm."""
    landings = watch.sim.landings
    assert np.abs(landings["position"][:, 1] + 0.26).max() < 1e-12
    share = (landings["t"] / 1e-3) % 1.0
    assert np.histogram(share, 10, (0.0, 1.0))[0].min() > 0.05 * len(landings)
    assert (np.diff(np.floor(landings["t"] / 1e-3)) >= 0).all()


def test_every_step_converged_or_is_counted(watch):
    tolerance = watch.sim.engine.tolerance
    fastest = 1.5 * watch.scene.drum.speed * watch.scene.drum.radius  # the brush
    assert tolerance == pytest.approx(1e-3 * max(9.81e-3, 0.01 * fastest), rel=1e-12)  # 1e-3 max(g h, 0.01 v)
    counted = np.diff([0, *watch.unconverged])
    np.testing.assert_array_equal(counted == 1, np.array(watch.residuals) > tolerance)
    assert watch.unconverged[-1] == watch.sim.health.unconverged < 0.01 * len(watch.residuals)
    assert max(watch.residuals) == watch.sim.health.worst_residual < 0.05


def test_the_drum_turns_at_its_speed_under_the_load(watch):
    """It is prescribed. What can be seen: grains that stick to it, where it carries them, move with its surface."""
    sim, speed = watch.sim, watch.scene.drum.speed
    contacts = sim.contacts[sim.contacts["b"] == -1]
    push = (contacts["impulse"] * contacts["normal"]).sum(axis=1)
    drag = np.linalg.norm(contacts["impulse"] - push[:, None] * contacts["normal"], axis=1)
    stick = contacts[(push > 0.0) & (drag < 0.4 * push)]
    rows = np.searchsorted(sim.ids, stick["a"])
    kept = sim.ids[np.minimum(rows, sim.count - 1)] == stick["a"]
    rows, stick = rows[kept], stick[kept]
    assert len(rows) > 20
    turn = np.cross([0.0, 0.0, -speed], stick["point"])
    arm = -0.5 * sim.diameter[rows][:, None] * stick["normal"]
    slip = sim.velocity[rows] + np.cross(sim.angular_velocity[rows], arm) - turn
    slip -= (slip * stick["normal"]).sum(axis=1)[:, None] * stick["normal"]
    assert np.median(np.linalg.norm(slip, axis=1)) < 1e-4 * speed * DRUM
    assert np.linalg.norm(slip, axis=1).max() < 0.01 * speed * DRUM


def test_no_two_grains_share_a_fifth_of_their_radius(watch):
    """Found: 8 % over 5 s, where a grain that is hit in mid-step meets a third one: that is seen one step late."""
    assert watch.sim.health.penetration_ratio < 0.2


@pytest.mark.slow
def test_no_grain_sinks_into_the_drum_at_half_the_step():
    scene = machine()
    scene.numerics.step = 5e-4
    sim = cesim.Simulation(scene, threads=2)
    worst = 0.0
    for _ in range(2400):
        sim.step()
        if sim.count > 0:
            over = np.abs(sim.position[:, 2]) <= 0.15
            depth = 1.0 - (np.hypot(*sim.position[:, :2].T) - DRUM) / (0.5 * sim.diameter)
            worst = max(worst, float(depth[over].max(initial=0.0)))
    assert worst < 0.01
    assert sim.balance.closed
