"""Dielectrophoresis and van der Waals adhesion (docs/physics.md 2.4 and 2.5)."""

import math

import numpy as np
import pytest
from scenes import (
    EPS0,
    GRAVITY,
    OPEN,
    R1,
    R2,
    SPEED,
    VOLTAGE,
    L,
    bare_drum,
    field,
    leave_drum,
    plane_scene,
    set_on_drum,
    simulation,
    sphere_mass,
)

import cesim
from cesim.fields import Grid
from cesim.scene import GridField, Numerics

PERMITTIVITY = {"ABS": 2.87, "copper": math.inf}
DENSITY = {"ABS": 1050.0, "copper": 8960.0}
PULL = 1e-19 * 0.2e-6 / (6.0 * 0.4e-9**2)  # N, of a contact


def factor(material):
    """(eps_r - 1)/(eps_r + 2), of a conductor 1."""
    eps = PERMITTIVITY[material]
    return 1.0 if math.isinf(eps) else (eps - 1.0) / (eps + 2.0)


# ---- dielectrophoresis -----------------------------------------------------------------------------------------------


def alone(scene, name, **parameters):
    """The scene with this effect on and all others off but weight, of which there is none."""
    scene.effects = dict.fromkeys((row.name for row in scene.effects() if row.kind == "effect"), "off")
    scene.effects["gravity"] = "on"
    scene.effects[name] = {"state": "on", "parameters": parameters}
    return scene


def push(scene, place, material, diameter):
    """Force (3,) in N on an uncharged grain at rest."""
    sim = simulation(scene)
    sim.add(place, material=material, diameter=diameter)
    sim.step()
    return sphere_mass(DENSITY[material], diameter) * sim.velocity[0] / sim.step_size


@pytest.mark.parametrize("material", PERMITTIVITY)
@pytest.mark.parametrize("place", [(0.0, 0.1605, 0.0), (0.165, 0.06, 0.1), (0.19, 0.15, 0.0), (-0.2, 0.3, 0.0)])
def test_between_the_cylinders_an_uncharged_grain_is_pulled_by_the_gradient_of_the_fields_square(place, material):
    """2 pi r^3 eps0 K grad E^2, the gradient by Richardson's differences of the two line charges' field."""
    place, diameter = np.array(place), 0.5e-3

    def square(shift):
        return float((field(place[:2] + shift, -VOLTAGE)[0] ** 2).sum())

    gradient = []
    for axis in np.eye(2):
        coarse, fine = ((square(h * axis) - square(-h * axis)) / (2.0 * h) for h in (2e-4, 1e-4))
        gradient.append((4.0 * fine - coarse) / 3.0)
    expected = 2.0 * math.pi * (0.5 * diameter) ** 3 * EPS0 * factor(material) * np.array([*gradient, 0.0])
    scene = alone(bare_drum(-VOLTAGE, landing=None, gravity=(0.0, 0.0, 0.0), step=1e-5), "dielectrophoresis")
    found = push(scene, place, material, diameter)
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())


def test_in_a_coaxial_field_the_pull_falls_with_the_cube_of_the_distance():
    """E = V/(r ln(b/a)), so F = -4 pi R^3 eps0 K [V/ln(b/a)]^2/r^3; by differences over R in a grid's field."""
    a, b, volts, diameter = 0.5e-3, 0.08, 10e3, 0.2e-3
    strength = volts / math.log(b / a)
    x, y = np.arange(0.02, 0.0401, 0.25e-3), np.arange(-0.01, 0.0101, 0.25e-3)
    grid = Grid((x[0], y[0]), (0.25e-3, 0.25e-3), strength * np.log(b / np.hypot(*np.meshgrid(x, y, indexing="ij"))))
    scene = cesim.Scene(
        name="coaxial",
        field=GridField.of(grid),
        bounds=OPEN,
        gravity=(0.0, 0.0, 0.0),
        numerics=Numerics(step=1e-5, threads=1),
    )
    for r in (0.025, 0.03, 0.035):
        place = r * np.array([math.cos(0.1), math.sin(0.1), 0.0])
        expected = -4.0 * math.pi * (0.5 * diameter) ** 3 * EPS0 * factor("ABS") * strength**2 / r**3
        found = push(alone(scene, "dielectrophoresis"), place, "ABS", diameter)
        assert found @ place / r == pytest.approx(expected, rel=2e-3)
        assert abs(found[0] * place[1] - found[1] * place[0]) < 2e-3 * abs(expected) * r


def test_dielectrophoresis_is_too_small_on_the_reference_drum_and_its_size_says_so():
    """1.5 eps0 K |grad E^2|/(rho g), with 2 E^2 |1/(z - x-) + 1/(z - x+)| on the drum, the largest of all angles."""
    row = cesim.scenes.reference_machine("spheres").effects()["dielectrophoresis"]
    h1 = (L**2 + R1**2 - R2**2) / (2.0 * L)
    c = math.sqrt(h1**2 - R1**2)
    z = R1 * np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 2000))
    square = np.abs(2.0 * c * VOLTAGE / math.acosh((L**2 - R1**2 - R2**2) / (2.0 * R1 * R2))) ** 2
    square = square / np.abs((z - h1 + c) * (z - h1 - c)) ** 2
    gradient = (2.0 * square * np.abs(1.0 / (z - h1 + c) + 1.0 / (z - h1 - c))).max()
    sizes = [1.5 * EPS0 * factor(name) * gradient / (DENSITY[name] * GRAVITY) for name in PERMITTIVITY]
    assert row.size == pytest.approx(max(sizes), rel=0.03)
    assert not row.on
    assert 4e-4 < row.size < 4e-3


# ---- adhesion --------------------------------------------------------------------------------------------------------


def size_of(share, density=DENSITY["ABS"]):
    """Diameter in m of a sphere of which the pull is this share of the weight."""
    return (6.0 * PULL / (share * density * math.pi * GRAVITY)) ** (1.0 / 3.0)


def test_the_pull_of_a_contact_is_twenty_nanonewtons():
    """A r_a/(6 z0^2) with A = 1e-19 J, r_a = 0.2 um, z0 = 0.4 nm: four times the weight of 0.1 mm of plastic."""
    assert pytest.approx(2.08e-8, rel=2e-3) == PULL
    scale = {"gravity": GRAVITY, "density": DENSITY["ABS"], "radius": 50e-6}
    assert cesim.engine.effect_size("adhesion", scale) == pytest.approx(
        PULL / (sphere_mass(DENSITY["ABS"], 1e-4) * GRAVITY), rel=1e-12
    )


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0, 1.3])
def test_a_carried_grain_leaves_the_drum_where_weight_and_swing_outweigh_adhesion(share):
    """cos(theta) = Fr - F/(m g): with F = 0 the carried form of docs/physics.md 2.3."""
    diameter = size_of(share)
    scene = alone(bare_drum(step=2e-4, friction=1000.0, rolling_friction=1000.0), "adhesion")
    sim = simulation(scene)
    set_on_drum(sim, "ABS", diameter)
    froude = SPEED**2 * (R1 + 0.5 * diameter) / GRAVITY
    assert math.degrees(leave_drum(sim)) == pytest.approx(math.degrees(math.acos(froude - share)), abs=0.3)


@pytest.mark.parametrize(("over", "stays"), [(1.02, True), (0.98, False)])
def test_a_grain_goes_all_the_way_round_only_if_adhesion_outweighs_weight_and_swing(over, stays):
    froude = SPEED**2 * R1 / GRAVITY
    diameter = size_of(over * (1.0 + froude))
    scene = alone(bare_drum(step=5e-4, landing=None, friction=1000.0, rolling_friction=1000.0), "adhesion")
    sim = simulation(scene)
    set_on_drum(sim, "ABS", diameter)
    sim.step(round(2.0 * math.pi / SPEED / sim.step_size))
    assert (abs(np.hypot(*sim.position[0, :2]) - R1 - 0.5 * diameter) < 1e-2 * diameter) == stays


def test_grains_are_pressed_together_by_what_holds_them():
    """A pillar of two on a plane: m g + F between them, 2 m g + F on the plane; without adhesion m g and 2 m g."""
    diameter = 0.2e-3
    weight = sphere_mass(DENSITY["ABS"], diameter) * GRAVITY
    for state, pull in (("on", PULL), ("off", 0.0)):
        scene = plane_scene()
        scene.effects["adhesion"] = state
        sim = simulation(scene)
        sim.add([(0.0, 0.5 * diameter, 0.0), (0.0, 1.5 * diameter, 0.0)], material="ABS", diameter=diameter)
        sim.step(50)
        pressed = {int(c["b"]): float(c["impulse"] @ c["normal"]) / sim.step_size for c in sim.contacts}
        assert pressed[-1] == pytest.approx(2.0 * weight + pull, rel=1e-6)
        assert max(pressed) >= 0
        assert pressed[max(pressed)] == pytest.approx(weight + pull, rel=1e-6)
        assert np.abs(sim.velocity).max() < 1e-6


def test_a_collision_is_no_touch():
    """A grain that bounces leaves with its restitution, with adhesion or without, to the last bit."""
    found = []
    for state in ("on", "off"):
        scene = plane_scene(restitution=0.5)
        scene.effects["adhesion"] = state
        sim = simulation(scene)
        sim.add((0.0, 5e-3, 0.0), velocity=(0.1, -0.2, 0.0), material="ABS", diameter=0.2e-3)
        sim.step(35)
        assert sim.velocity[0, 1] > 0.0
        found.append(sim.state_hash())
    assert found[0] == found[1]


def test_a_run_with_adhesion_goes_on_from_a_snapshot_to_the_last_bit():
    def start():
        scene = alone(bare_drum(step=1e-3, friction=0.5), "adhesion")
        sim = simulation(scene)
        for angle, diameter in ((0.0, 0.1e-3), (0.02, 0.15e-3), (0.05, 0.3e-3), (-0.1, 0.2e-3)):
            set_on_drum(sim, "ABS", diameter, angle=angle)
        return sim

    whole, first, second = start(), start(), start()
    whole.step(300)
    first.step(150)
    second.engine.restore(first.engine.state())
    second.step(150)
    assert any(contact["b"] == -1 for contact in second.contacts)
    assert second.state_hash() == whole.state_hash()


def test_adhesion_is_called_for_by_fine_grains_that_are_fed():
    scene = cesim.scenes.reference_machine("spheres")
    assert not scene.effects()["adhesion"].on
    scene.feed.size = cesim.Constant(diameter="0.3 mm")
    row = scene.effects()["adhesion"]
    assert row.on
    assert row.size == pytest.approx(PULL / (sphere_mass(DENSITY["ABS"], 0.3e-3) * GRAVITY), rel=1e-9)
    scene.feed = None
    assert "nothing is fed" in scene.effects()["adhesion"].why
