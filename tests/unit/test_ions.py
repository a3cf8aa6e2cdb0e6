"""The corona of a scene: onset warnings, the ion flow from its wires, its decisions and its shielding."""

import math

import numpy as np
import pytest

import cesim
from cesim.corona import IonisedField, Wire, onset
from cesim.errors import InputError
from cesim.scene import Constant, Corona, Electrode, Feed
from cesim.scene.ions import captured, ion_table, shielding, time_to_charge

EPS0 = 8.8541878188e-12


@pytest.fixture
def scene():
    """The reference machine with a wire in the place of its tube."""
    scene = cesim.scenes.reference_machine("spheres")
    scene.electrode = Electrode(kind="corona", radius="0.15 mm", distance="230 mm", angle="60 deg", voltage="-30 kV")
    scene.corona = Corona(model="deutsch")
    return scene


def charging(scene):
    return next(effect for effect in scene.definition()["effects"] if effect["name"] == "corona_charging")


def test_the_ion_flow_reaches_the_engine_as_a_table(scene):
    """Angle, field and current of cesim.corona.IonisedField, with the air's density and the wire's roughness."""
    scene.corona.roughness = 0.95
    scene.air.density = 1.1
    center = (0.230 * math.cos(math.radians(60.0)), 0.230 * math.sin(math.radians(60.0)))
    wires = [Wire(center, 0.15e-3, -30e3)]
    by_hand = IonisedField(scene.electric_field(), wires, 0.160, roughness=0.95, density=1.1 / 1.184)
    np.testing.assert_allclose(charging(scene)["table"], by_hand.table(), rtol=1e-12)
    assert scene.ionised_field().current == pytest.approx(by_hand.current)
    facing = by_hand.angle[np.argmax(by_hand.current_density)]
    assert facing == pytest.approx(math.radians(30.0), abs=math.radians(0.5))


def test_ions_charge_a_grain_under_the_wire_by_the_field_that_they_raise(scene):
    sim = cesim.Simulation(scene, threads=1)
    found, angle = scene.ionised_field(), math.radians(30.0)
    reach = 0.160 + 0.25e-3
    sim.add((reach * math.sin(angle), reach * math.cos(angle), 0.0), material="ABS", diameter=0.5e-3)
    sim.step()
    E, J = (np.interp(angle, found.angle, column) for column in (found.field, found.current_density))
    assert E / np.interp(angle, found.angle, found.laplacian_field) > 2.0
    k, step = 2.87 / 4.87, sim.step_size
    saturation = 12.0 * math.pi * EPS0 * 0.25e-3**2 * E * k
    assert sim.charge[0] == pytest.approx(-saturation * step / (step + 4.0 * EPS0 * E / J), rel=1e-4, abs=0.0)


def test_an_arc_has_no_table_and_stays_the_default(scene):
    scene.corona = Corona()
    assert scene.corona.model == "arc"
    assert "table" not in charging(scene)


def test_the_same_state_comes_back_from_a_snapshot_under_an_ion_flow(scene, tmp_path):
    """Bit for bit, and a charge more or less would show in the hash."""
    sim = cesim.Simulation(scene, seed=3, threads=1)
    sim.step(150)
    sim.save(tmp_path / "state.h5")
    sim.step(50)
    twin = cesim.Simulation.restore(tmp_path / "state.h5")
    twin.step(50)
    assert twin.state_hash() == sim.state_hash()
    table = {effect["name"]: effect for effect in twin.definition["effects"]}["corona_charging"]["table"]
    np.testing.assert_array_equal(table, charging(scene)["table"])


def test_a_tube_beside_the_wire_takes_the_ions_off_the_drum_that_faces_it(scene):
    """By the model of many conductors, which for one wire alone gives what two cylinders give."""
    alone = scene.ionised_field()
    scene.field = "conductors"
    np.testing.assert_allclose(scene.ionised_field().table(), alone.table(), rtol=1e-8, atol=1e-12)
    scene.electrodes = [Electrode(radius="19 mm", distance="250 mm", angle="15 deg", voltage="-30 kV")]
    found = scene.ionised_field()
    assert found.onset_voltage[0] > alone.onset_voltage[0]  # a neighbour at the same voltage shields the wire
    assert found.current < alone.current
    facing = np.abs(found.angle - math.radians(75.0)) < math.radians(15.0)
    assert np.all(found.current_density[facing] == 0.0)
    np.testing.assert_array_equal(found.field[facing], found.laplacian_field[facing])
    assert found.currents([-30e3])[0] == pytest.approx(found.current, rel=1e-12)


# ---- what cannot be, and what is doubtful ----------------------------------------------------------------------------


def test_ions_need_a_wire(scene):
    scene.electrode.kind = "static"
    with pytest.raises(InputError, match="no electrode is of kind 'corona'"):
        scene.definition()


@pytest.mark.parametrize("given", [{"field": "400 kV/m"}, {"current_density": 1e-3}])
def test_what_follows_from_the_wires_is_not_given_as_well(given):
    with pytest.raises(InputError, match="stands beside model = 'deutsch'"):
        Corona(model="deutsch", **given)


def onset_warnings(scene):
    return [warning.text for warning in scene.check() if warning.name == "onset"]


def test_a_wire_below_its_onset_and_a_tube_above_its_own_are_warned_of(scene):
    """Peek's voltage of this wire is 11.04 kV in air of 1.184 kg/m3."""
    scene.air.density = 1.184
    first = scene.ionised_field().onset_voltage[0]
    assert first == pytest.approx(11.0e3, rel=0.01)
    assert onset_warnings(scene) == []
    scene.electrode.voltage = -0.99 * first
    (text,) = onset_warnings(scene)
    assert "electrode is a corona wire" in text
    assert "it sends no ions" in text
    scene.electrode.voltage = -1.01 * first
    assert onset_warnings(scene) == []
    scene.electrode.kind, scene.corona = "static", None
    (text,) = onset_warnings(scene)
    assert "above the onset" in text
    scene.electrode.voltage = -0.99 * first
    assert onset_warnings(scene) == []


def test_the_tube_of_the_reference_machine_is_far_from_its_onset():
    assert onset_warnings(cesim.scenes.reference_machine("spheres")) == []


# ---- decisions -------------------------------------------------------------------------------------------------------


def test_kinetics_are_explained_by_the_dose_in_the_ion_flow(scene):
    """4 eps0 over the mean of J/E, against the time between the ends of the flow; docs/physics.md 4."""
    row = scene.effects()["charging_kinetics"]
    time, way = time_to_charge(scene)
    assert row.size == pytest.approx(time / way)
    angle, field, current = ion_table(scene).T
    dose = float(np.sum((current / field)[1:] * np.diff(angle)))
    assert way / time == pytest.approx(dose / (4.0 * EPS0 * scene.drum.speed), rel=0.1)
    scene.electrode.voltage = "-12 kV"  # a weak current: charging takes its time
    weak = scene.effects()["charging_kinetics"]
    assert weak.size > 0.05 > row.size
    assert row.on
    assert weak.on


def test_the_size_of_the_image_force_is_that_of_the_charge_the_ions_bring(scene):
    """6.75 k^2 eps0 E^2/(r rho g) with the field that charges, not the one without ions."""
    with_ions = scene.effects()["image_force"].size
    scene.corona = Corona()
    without = scene.effects()["image_force"].size
    found = cesim.Scene.ionised_field(scene)
    assert with_ions / without == pytest.approx((found.field.max() / found.laplacian_field.max()) ** 2, rel=1e-6)


# ---- shielding -------------------------------------------------------------------------------------------------------


def crowded(scene, rate):
    scene.feed = Feed(rate=rate, mix={"ABS": 1.0}, size=Constant(diameter="1 mm"))
    return scene


def test_grains_that_are_few_do_not_shield_each_other_and_many_share_what_there_is(scene):
    """K = 3 k coverage, by hand; share (1 - exp(-K))/K: 1 - K/2 for few, 1/K for many."""
    speed = scene.drum.speed * 0.160
    for rate in (10.0, 3000.0, 300_000.0):
        crowded(scene, f"{rate} 1/s")
        covered = rate * 0.25 * math.pi * 1e-6 / (speed * scene.feed.outlet.width)
        K = 3.0 * 2.87 / 4.87 * covered
        assert captured(scene) == pytest.approx(K, rel=0.02)
        assert shielding(scene) == 1.0  # off unless asked for
        scene.corona.shielding = 1.0
        assert shielding(scene) == pytest.approx((1.0 - math.exp(-K)) / K, rel=0.02)
        assert shielding(scene) * K <= 1.0  # together no more than arrives
        scene.corona.shielding = 0.0


def test_shielding_weakens_the_current_and_not_the_field(scene):
    crowded(scene, "30000 1/s")
    alone = charging(scene)["table"]
    scene.corona.shielding = 1.0
    shared = charging(scene)["table"]
    np.testing.assert_array_equal(shared[:, :2], alone[:, :2])
    np.testing.assert_allclose(shared[:, 2], shielding(scene) * alone[:, 2], rtol=1e-12)
    scene.corona = Corona(current_density=1e-3, shielding=1.0, kinetics="on")
    assert charging(scene)["parameters"]["current_density"] == pytest.approx(1e-3 * shielding(scene))


def test_thin_wires_begin_at_a_higher_field():
    radii = np.array([0.05e-3, 0.2e-3, 1e-3, 19e-3])
    fields = [onset(radius) for radius in radii.tolist()]
    assert np.all(np.diff(fields) < 0.0)
    assert np.all(np.diff(fields * radii) > 0.0)
