"""Forces of charged grains on each other (docs/physics.md 2.6): the law, its sums, and what they do to motion.

Sums are coded here anew in NumPy, pair by pair. The law of two charges is Coulomb's with k = 1/(4 pi eps0).
"""

import math

import numpy as np
import pytest
from scenes import EPS0, OPEN, bare_drum

import cesim
from cesim import engine
from cesim.scene import Numerics

K = 1.0 / (4.0 * math.pi * EPS0)
TREE, CUTOFF, DIRECT = 0.0, 1.0, 2.0


def law(x, q, r, images=None, cutoff=math.inf):
    """Force on each charge, N, by the sum over all others; images: (axis, radius) of a grounded cylinder along z."""
    force = np.zeros_like(x)
    for i in range(len(x)):
        others = np.arange(len(x)) != i
        d = x[i] - x
        distance = np.linalg.norm(d, axis=1)
        near = others & (distance <= cutoff)
        contact = r[i] + r
        force[i] = (K * q[i] * q / np.maximum(distance, contact) ** 3 * near) @ d
        if images is not None:
            axis, radius = images
            out = x[:, :2] - axis
            mirrored = np.column_stack([axis + out * radius**2 / np.sum(out**2, axis=1, keepdims=True), x[:, 2]])
            d = x[i] - mirrored
            force[i] -= (K * q[i] * q / np.maximum(np.linalg.norm(d, axis=1), contact) ** 3 * near) @ d
    return force


def cloud(count, seed=1):
    """Charges of both signs in a box of 0.1 m: position, charge, diameter."""
    random = np.random.default_rng(seed)
    return (
        random.uniform(0.0, 0.1, (count, 3)),
        random.normal(0.0, 1e-12, count),
        random.uniform(0.2e-3, 1e-3, count),
    )


def clusters(count, seed=2):
    """Charges of one sign in a hundred clots of very different sizes, and a few at the same points."""
    random = np.random.default_rng(seed)
    middles, sizes = random.uniform(-1.0, 1.0, (100, 3)), 10.0 ** random.uniform(-4.0, -1.0, 100)
    which = random.integers(0, 100, count)
    x = middles[which] + sizes[which, None] * random.normal(size=(count, 3))
    x[: count // 20] = x[count // 2]
    return x, random.uniform(0.1e-12, 1e-12, count), np.full(count, 1e-4)


def sheet(count, seed=3):
    """Charges of one sign in a flat stream of one diameter's thickness."""
    random = np.random.default_rng(seed)
    return (
        random.uniform(0.0, 1.0, (count, 3)) * (0.2, 0.5e-3, 0.3),
        np.full(count, 1e-12),
        np.full(count, 0.5e-3),
    )


def relative_error(force, exact):
    return float(np.linalg.norm(force - exact) / np.linalg.norm(exact))


def net(force):
    """Net force over the sum of the magnitudes."""
    return float(np.abs(force.sum(axis=0)).max() / np.abs(force).sum())


# ---- the law ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", [TREE, CUTOFF, DIRECT])
def test_two_charges_have_coulombs_force_equal_and_opposite_to_the_last_bit(method):
    x = np.array([[0.01, 0.02, 0.03], [0.013, 0.016, 0.03]])
    force, error = engine.pair_forces(x, [2e-12, -3e-12], [1e-3, 0.7e-3], {"method": method})
    wanted = K * 2e-12 * -3e-12 / 0.005**2 * np.array([-0.6, 0.8, 0.0])
    assert force[0] == pytest.approx(wanted, rel=1e-13, abs=1e-25)
    assert (force[0] == -force[1]).all()
    assert error == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("method", [TREE, CUTOFF, DIRECT])
def test_nearer_than_the_sum_of_the_radii_the_force_falls_linearly_to_nothing(method):
    charges, diameters, contact = [1e-11, 2e-11], [1e-3, 3e-3], 2e-3
    most = K * 2e-22 / contact**2
    for part in (1.0 + 1e-12, 1.0, 0.5, 1e-3, 1e-9, 0.0):
        force, _ = engine.pair_forces([[0, 0, 0], [part * contact, 0, 0]], charges, diameters, {"method": method})
        assert force[1, 0] == pytest.approx(most * part, rel=1e-11)
        assert (force[0] == -force[1]).all()


def test_charges_that_are_none_or_not_finite_neither_act_nor_feel():
    x, q, d = cloud(50)
    q[::2] = 0.0
    force, _ = engine.pair_forces(x, q, d)
    assert not force[::2].any()
    assert force[1::2] == pytest.approx(law(x[1::2], q[1::2], 0.5 * d[1::2]), rel=1e-9)
    x[3], q[5] = math.nan, math.inf
    marred, _ = engine.pair_forces(x, q, d)
    assert np.isfinite(marred).all()
    assert not marred[[3, 5]].any()


# ---- sums over pairs -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("crowd", [cloud, clusters, sheet])
def test_the_direct_sum_is_the_sum_over_pairs(crowd):
    x, q, d = crowd(300)
    force, _ = engine.pair_forces(x, q, d, {"method": DIRECT})
    assert relative_error(force, law(x, q, 0.5 * d)) < 1e-13


@pytest.mark.parametrize("crowd", [cloud, clusters, sheet])
def test_the_tree_is_as_near_as_its_opening_says_and_keeps_the_momentum(crowd):
    x, q, d = crowd(4000)
    exact, _ = engine.pair_forces(x, q, d, {"method": DIRECT})
    errors = []
    for opening in (0.8, 0.6, 0.4):
        force, _ = engine.pair_forces(x, q, d, {"method": TREE, "opening": opening})
        errors.append(relative_error(force, exact))
        assert net(force) < 1e-15
    assert errors[1] < 2e-3
    assert errors[2] < 0.3 * errors[1] < 0.3 * errors[0]


def test_the_error_of_the_tree_falls_with_the_fourth_power_of_the_opening():
    """Fourth-order moments leave the fifth power of the potential, the fourth of the force."""
    x = np.concatenate([np.random.default_rng(5).uniform(-0.5, 0.5, (40, 3)), np.zeros((40, 3))])
    q, d = np.full(80, 1e-12), np.full(80, 1e-4)
    x[40:] = x[:40]
    errors = []
    for far in (4.0, 8.0):
        x[40:, 0] = x[:40, 0] + far
        exact, _ = engine.pair_forces(x, q, d, {"method": DIRECT})
        alone, _ = engine.pair_forces(x[:40], q[:40], d[:40], {"method": DIRECT})
        force, _ = engine.pair_forces(x, q, d, {"method": TREE, "opening": 0.9})
        errors.append(relative_error(force[:40] - alone, exact[:40] - alone))
    assert 0.0 < errors[1] < errors[0] < 1e-2
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.7)


def test_the_cut_off_leaves_out_what_is_farther_and_nothing_else():
    x, q, d = cloud(500)
    force, _ = engine.pair_forces(x, q, d, {"method": CUTOFF, "cutoff": 0.02})
    assert relative_error(force, law(x, q, 0.5 * d, cutoff=0.02)) < 1e-13
    assert net(force) < 1e-15
    everything, _ = engine.pair_forces(x, q, d, {"method": CUTOFF, "cutoff": 1.0})
    assert relative_error(everything, law(x, q, 0.5 * d)) < 1e-13


@pytest.mark.parametrize("parameters", [{"method": TREE, "opening": 0.8}, {"method": CUTOFF, "cutoff": 0.03}])
def test_the_error_that_a_step_reports_is_that_of_all_charges(parameters):
    """A sample of four a step, over 200 steps."""
    x, q, d = cloud(2000)
    exact, _ = engine.pair_forces(x, q, d, {"method": DIRECT})
    force, _ = engine.pair_forces(x, q, d, parameters)
    told = [engine.pair_forces(x, q, d, parameters, step=step)[1] for step in range(200)]
    assert np.median(told) < 2.0 * relative_error(force, exact)
    assert max(told) > 0.5 * relative_error(force, exact)


def test_charges_with_random_signs_leave_the_root_of_spacing_over_cut_off():
    """Force of what is beyond over that of what is near, both random: sqrt(sum of 1/d^4 beyond over that of all)."""
    x, q, d = cloud(6000)
    for cutoff in (0.01, 0.02):
        exact, _ = engine.pair_forces(x, q, d, {"method": DIRECT})
        force, _ = engine.pair_forces(x, q, d, {"method": CUTOFF, "cutoff": cutoff})
        left = []
        for i in range(0, 6000, 20):
            away = np.delete(np.linalg.norm(x - x[i], axis=1), i)
            left.append((q[i] ** 2 * np.sum(away[away > cutoff] ** -4.0), q[i] ** 2 * np.sum(away**-4.0)))
        beyond, everything = np.sum(left, axis=0)
        assert relative_error(force, exact) == pytest.approx(math.sqrt(beyond / everything), rel=0.35)


@pytest.mark.parametrize("threads", [2, 3, 5, 8])
@pytest.mark.parametrize("method", [TREE, CUTOFF, DIRECT])
def test_bits_of_the_forces_do_not_depend_on_threads(method, threads):
    x, q, d = clusters(3000)
    parameters, drum = {"method": method, "cutoff": 0.3}, {"drum_axis": (0.0, -5.0), "drum_radius": 2.0}
    one, _ = engine.pair_forces(x, q, d, parameters, **drum)
    many, _ = engine.pair_forces(x, q, d, parameters, **drum, threads=threads)
    assert (one == many).all()


# ---- space charge ----------------------------------------------------------------------------------------------------


def test_a_ball_of_charges_has_the_field_of_gauss():
    """The mean field of a stream is the same sum: at radius s of a ball, Q(s)/(4 pi eps0 s^2)."""
    random = np.random.default_rng(7)
    x = random.uniform(-1.0, 1.0, (60000, 3))
    x = 0.1 * x[np.sum(x**2, axis=1) < 1.0]
    q = np.full(len(x), 1e-13)
    force, _ = engine.pair_forces(x, q, np.full(len(x), 1e-4))
    s = np.linalg.norm(x, axis=1)
    outward = np.sum(force * x, axis=1) / s / q
    for low, high in ((0.03, 0.04), (0.06, 0.07), (0.09, 0.1)):
        shell = (s > low) & (s < high)
        inside = q[0] * np.searchsorted(np.sort(s), s[shell])
        assert np.mean(outward[shell]) == pytest.approx(np.mean(K * inside / s[shell] ** 2), rel=0.01)


# ---- images ----------------------------------------------------------------------------------------------------------

DRUM = {"drum_axis": (0.0, 0.0), "drum_radius": 0.16}


def over_drum(count, height, seed=4):
    """Charges over the drum, at heights of their surface up to a height."""
    random = np.random.default_rng(seed)
    d = random.uniform(0.2e-3, 1e-3, count)
    distance = 0.16 + 0.5 * d + random.uniform(0.0, height, count)
    angle = random.uniform(0.0, 1.5, count)
    z = random.uniform(-0.15, 0.15, count)
    return np.column_stack([distance * np.sin(angle), distance * np.cos(angle), z]), random.normal(0, 1e-12, count), d


@pytest.mark.parametrize("parameters", [{"method": DIRECT}, {"method": CUTOFF, "cutoff": 0.01}, {"method": TREE}])
def test_the_drum_mirrors_every_charge_but_its_own(parameters):
    x, q, d = over_drum(400, 0.02)
    cutoff = parameters.get("cutoff", math.inf)
    force, _ = engine.pair_forces(x, q, d, parameters, **DRUM)
    exact = law(x, q, 0.5 * d, (np.zeros(2), 0.16), cutoff)
    assert relative_error(force, exact) < (4e-3 if parameters["method"] == TREE else 1e-12)


def test_a_large_drum_is_the_plane_of_the_method_of_images():
    x = np.array([[0.0, 1.0e3 + 0.01, 0.0], [0.03, 1.0e3 + 0.01, 0.0]])
    force, _ = engine.pair_forces(x, [1e-12, 1e-12], [1e-3, 1e-3], drum_axis=(0.0, 0.0), drum_radius=1.0e3)
    away = math.hypot(0.03, 0.02)
    wanted = K * 1e-24 * np.array([1.0 / 0.03**2 - 0.03 / away**3, -0.02 / away**3])
    assert force[1, :2] == pytest.approx(wanted, rel=1e-3)


def test_grains_on_the_drum_see_each_other_as_dipoles():
    """Along the drum, at height s and distance d: k q^2 [1/d^2 - d/(d^2 + 4 s^2)^(3/2)] -> 6 k q^2 s^2/d^4."""
    s = 0.5e-3
    forces = []
    for d in (10.0 * s, 20.0 * s):
        x = np.array([[0.0, 0.16 + s, 0.0], [0.0, 0.16 + s, d]])
        force, _ = engine.pair_forces(x, [1e-12, 1e-12], [2 * s, 2 * s], **DRUM)
        forces.append(force[1, 2])
        assert force[1, 2] == pytest.approx(K * 1e-24 * 6.0 * s**2 / d**4, rel=0.12)
    assert forces[0] / forces[1] == pytest.approx(16.0, rel=0.08)


def test_no_force_is_left_on_a_charge_whose_partner_touches_the_drum():
    """A grounded point has no potential: the nearer to the surface, the less another charge feels."""
    x = np.array([[0.0, 0.17, 0.0], [0.004, 0.16, 0.0]])
    seen = []
    for radius in (1e-4, 1e-5):
        x[1, 1] = math.sqrt((0.16 + radius) ** 2 - x[1, 0] ** 2)
        force, _ = engine.pair_forces(x, [1e-12, 1e-12], [2 * radius, 2 * radius], **DRUM)
        seen.append(np.linalg.norm(force[0]))
    assert seen[1] == pytest.approx(0.1 * seen[0], rel=0.1)
    assert seen[0] < 0.05 * K * 1e-24 / 0.01**2


# ---- in motion -------------------------------------------------------------------------------------------------------


def free_scene(step, **parameters):
    """Nothing but the forces between grains."""
    return cesim.Scene(
        name="two charges",
        materials={"grain": cesim.Material(kind="insulator", density=1000.0, permittivity=3.0)},
        numerics=Numerics(step=step, threads=1),
        bounds=OPEN,
        gravity=(0.0, 0.0, 0.0),
        effects={"drag": "off", "pair_coulomb": {"state": "on", "parameters": parameters}},
    )


def pair(step, distance, charges, speeds=(0.0, 0.0), diameter=1e-3):
    sim = cesim.Simulation(free_scene(step), threads=1)
    sim.add(
        [[-0.5 * distance, 0.0, 0.0], [0.5 * distance, 0.0, 0.0]],
        velocity=[[0.0, speeds[0], 0.0], [0.0, speeds[1], 0.0]],
        material="grain",
        diameter=diameter,
        charge=charges,
    )
    return sim


def apart(sim):
    return float(np.linalg.norm(sim.position[1] - sim.position[0]))


def test_like_charges_from_rest_part_as_the_closed_form_says_at_second_order():
    """t(x d) = sqrt(d^3 m/(4 k q^2)) [sqrt(x(x - 1)) + ln(sqrt(x) + sqrt(x - 1))], x: distance over the first one."""
    distance, charge = 5e-3, 1e-10
    mass = 1000.0 * math.pi / 6.0 * 1e-9
    scale = math.sqrt(distance**3 * mass / (4.0 * K * charge**2))
    errors = []
    for count in (40, 80, 160):
        sim = pair(3.0 * scale / count, distance, [charge, charge])
        sim.step(count)
        x = apart(sim) / distance
        time = scale * (math.sqrt(x * (x - 1.0)) + math.log(math.sqrt(x) + math.sqrt(x - 1.0)))
        errors.append(abs(time / (3.0 * scale) - 1.0))
        assert np.abs(sim.velocity.sum(axis=0)).max() < 1e-16
    assert errors[2] < 2e-5
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
    assert math.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.2)


def test_unlike_charges_circle_each_other_at_second_order():
    """Circular orbit: each at v = sqrt(k q^2/(2 m d)), the period pi d/v."""
    distance, charge = 5e-3, 1e-10
    mass = 1000.0 * math.pi / 6.0 * 1e-9
    speed = math.sqrt(K * charge**2 / (2.0 * mass * distance))
    period = math.pi * distance / speed
    errors = []
    for count in (100, 200, 400):
        sim = pair(period / count, distance, [charge, -charge], (speed, -speed))
        sim.step(count)
        errors.append(float(np.linalg.norm(sim.position[0] - [-0.5 * distance, 0.0, 0.0])) / distance)
        energy = 0.5 * mass * float((sim.velocity**2).sum()) - K * charge**2 / apart(sim)
        assert energy == pytest.approx(-0.5 * K * charge**2 / distance, rel=20.0 / count**2)
    assert errors[2] < 1e-3
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
    assert math.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.2)


def test_unlike_charges_that_meet_come_to_rest_in_touch():
    sim = pair(1e-4, 2e-3, [1e-10, -1e-10])
    sim.step(400)
    assert apart(sim) == pytest.approx(1e-3, rel=1e-3)
    assert np.abs(sim.velocity).max() < 1e-12
    push = float(sim.contacts["impulse"][0, 0]) / sim.step_size
    assert abs(push) == pytest.approx(K * 1e-20 / 1e-6, rel=2e-3)


def crowd_on_drum(threads=1, method=TREE):
    scene = bare_drum(
        -35e3,
        effects={"pair_coulomb": {"state": "on", "parameters": {"method": method}}, "electric_force": "on"},
    )
    scene.numerics.threads = threads
    x, _, d = over_drum(900, 0.02)
    sim = cesim.Simulation(scene, threads=threads)
    sim.add(x, material="copper", diameter=d, charge=np.random.default_rng(3).normal(0.0, 1e-11, len(x)))
    return sim


@pytest.mark.parametrize("threads", [2, 3, 5, 8])
def test_bits_of_a_run_do_not_depend_on_threads(threads):
    one, many = crowd_on_drum(), crowd_on_drum(threads)
    one.step(10)
    many.step(10)
    assert one.state_hash() == many.state_hash()
    assert 0.0 < one.health.pair_error < 0.01


def test_a_restored_run_goes_on_to_the_same_bits(tmp_path):
    sim = crowd_on_drum()
    sim.step(5)
    sim.save(tmp_path / "half.h5")
    twin = cesim.Simulation.restore(tmp_path / "half.h5")
    assert twin.health.pair_error == sim.health.pair_error
    sim.step(5)
    twin.step(5)
    assert twin.state_hash() == sim.state_hash()


def test_a_method_between_two_is_refused():
    with pytest.raises(engine.InputError, match=r"method is 0\.5, must be 0, 1 or 2"):
        engine.pair_forces([[0.0, 0.0, 0.0]], [0.0], [1e-3], {"method": 0.5})


# ---- the decision ----------------------------------------------------------------------------------------------------


def machine(rate, voltage="-35 kV", mix=None, size=None):
    scene = cesim.scenes.reference_machine("spheres")
    scene.electrode.voltage = voltage
    scene.feed = cesim.Feed(
        rate=rate,
        mix=mix or {"copper": 1.0},
        size=size or cesim.Constant(diameter="1 mm"),
        outlet=scene.feed.outlet,
    )
    return scene


def test_the_size_is_that_of_a_charged_sheet_two_pi_times_one_neighbour():
    """One neighbour at the mean spacing s: 1.98 (r/s)^2 of the field force on metal, 3 k (r/s)^2 of Q E on plastic."""
    r, density, field, coverage = 0.5e-3, 8960.0, 4e5, 0.03
    per_spacing2 = coverage / math.pi  # (r/s)^2 of n = 1/s^2 grains per area
    common = {"gravity": 9.81, "voltage": 35e3, "field": field, "radius": r, "density": density, "coverage": coverage}
    pressure = EPS0 * field**2 / (r * density * 9.81)
    metal = engine.effect_size("pair_coulomb", {**common, "kind": "conductor", "permittivity": 1.0})
    neighbour = 1.977 * per_spacing2 * 3.0 * 1.368724 * pressure
    assert metal == pytest.approx(2.0 * math.pi * neighbour, rel=1e-3)
    plastic = engine.effect_size("pair_coulomb", {**common, "kind": "insulator", "permittivity": 3.0})
    assert plastic == pytest.approx(2.0 * math.pi * 3.0 * 0.6 * per_spacing2 * 9.0 * 0.6 * pressure, rel=1e-9)


def test_a_dense_charged_stream_calls_for_pair_forces_and_a_thin_one_does_not():
    assert not machine("1 kg/h").effects()["pair_coulomb"].on
    assert machine("300 kg/h", mix={"ABS": 1.0}).effects()["pair_coulomb"].on
    assert not machine("300 kg/h", mix={"ABS": 1.0}, voltage="0 V").effects()["pair_coulomb"].on
