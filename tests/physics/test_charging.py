"""Charges: from the drum, from the corona at once or in time, to the brush, and none in flight.

Source: docs/physics.md 2.1, 2.2. A charge is some 1e-12 C, so comparisons say abs=0: approx has 1e-12 by default.
"""

import math

import numpy as np
import pytest
from scenes import (
    EPS0,
    R1,
    SPEED,
    VOLTAGE,
    angle_of,
    bare_drum,
    contact_charge,
    drum_field,
    pauthenier_charge,
    set_on_drum,
    simulation,
)

import cesim

ABS_PERMITTIVITY, PE_PERMITTIVITY = 2.87, 2.385
EVERYWHERE = (-math.pi, math.pi)
GRIP = {"friction": 10.0, "rolling_friction": 10.0}


def resting(corona, step=1e-3, material="ABS", diameter=0.3e-3, charge=0.0, voltage=-VOLTAGE):
    """A grain at rest on top of a drum at rest."""
    sim = simulation(bare_drum(voltage, speed=0.0, step=step, corona=corona, landing=None, **GRIP))
    set_on_drum(sim, material, diameter, charge=charge)
    return sim


# ---- corona ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("voltage", [-VOLTAGE, VOLTAGE])
@pytest.mark.parametrize(("material", "permittivity"), [("ABS", ABS_PERMITTIVITY), ("PE", PE_PERMITTIVITY)])
def test_instant_charging_gives_the_saturation_charge_in_one_step(material, permittivity, voltage):
    """Q = 12 pi eps0 r^2 E k, k = eps_r/(eps_r + 2), E on the drum below the grain, with the sign of the electrode."""
    sim = resting({"arc": (-0.1, 0.1)}, material=material, voltage=voltage)
    sim.step()
    saturation = math.copysign(pauthenier_charge(0.3e-3, permittivity, abs(drum_field(0.0, VOLTAGE))), voltage)
    assert sim.charge[0] == pytest.approx(saturation, rel=1e-12, abs=0.0)
    sim.step(10)
    assert sim.charge[0] == pytest.approx(saturation, rel=1e-12, abs=0.0)


@pytest.mark.parametrize("step", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("field", [None, 413e3])
@pytest.mark.parametrize("current_density", [1e-4, 1e-3, 5e-3])
def test_charging_in_time_follows_pauthenier_at_any_step(step, field, current_density):
    """Q(t) = Qs t/(t + tau), tau = 4 eps0 E/J: exact at any step, since two half steps are one step."""
    corona = {"arc": (-0.1, 0.1), "current_density": current_density, "field": field}
    sim = resting(corona, step)
    E = abs(drum_field(0.0, VOLTAGE)) if field is None else field
    saturation, tau = -pauthenier_charge(0.3e-3, ABS_PERMITTIVITY, E), 4.0 * EPS0 * E / current_density
    for time in (0.01, 0.05, 0.2):
        sim.run(time)
        assert sim.time == pytest.approx(time)
        assert sim.charge[0] == pytest.approx(saturation * time / (time + tau), rel=1e-12, abs=0.0)


def test_the_time_constants_of_three_ion_currents():
    """docs/physics.md 2.2: J = 0.1, 1 and 5 mA/m2 at 400 kV/m charge to a half in 142, 14 and 2.8 ms."""
    for current_density, half in ((1e-4, 0.142), (1e-3, 0.014), (5e-3, 0.0028)):
        sim = resting({"arc": (-0.1, 0.1), "current_density": current_density, "field": 400e3}, step=half / 100.0)
        sim.step(100)
        assert sim.charge[0] == pytest.approx(
            -0.5 * pauthenier_charge(0.3e-3, ABS_PERMITTIVITY, 400e3), rel=0.02, abs=0.0
        )


def test_instant_charging_is_the_limit_of_a_large_current():
    """T8 of docs/physics.md 6."""
    saturation = -pauthenier_charge(0.3e-3, ABS_PERMITTIVITY, 413e3)
    off = []
    for current_density in (1e-2, 1e-1, 1.0):
        sim = resting({"arc": (-0.1, 0.1), "current_density": current_density, "field": 413e3})
        sim.step(20)
        off.append(1.0 - sim.charge[0] / saturation)
    assert off == pytest.approx([0.068, 0.0073, 0.00073], rel=0.02)


def test_the_charge_collected_in_the_arc_does_not_depend_on_the_step():
    """A ride through the arc: Q(t) at t = arc/omega, off by the part of a step at its ends and no more."""
    arc, current_density, E = (math.radians(10.0), math.radians(50.0)), 1e-3, 413e3
    time, tau = (arc[1] - arc[0]) / SPEED, 4.0 * EPS0 * E / current_density
    exact = -pauthenier_charge(0.3e-3, ABS_PERMITTIVITY, E) * time / (time + tau)
    for step in (2e-3, 1e-3, 1e-4):
        corona = {"arc": arc, "current_density": current_density, "field": E}
        sim = simulation(bare_drum(-VOLTAGE, step=step, corona=corona, landing=None, **GRIP))
        set_on_drum(sim, "ABS", 0.3e-3)
        sim.run(math.radians(60.0) / SPEED)
        assert sim.charge[0] == pytest.approx(exact, rel=1.5 * step / time * tau / (time + tau), abs=0.0)


def test_the_charging_field_may_be_given_and_counts_everywhere_in_the_arc():
    """corona.field stands for the field with its space charge; the charge scales with it."""
    for E in (200e3, 413e3):
        sim = resting({"arc": EVERYWHERE, "field": E})
        sim.step()
        assert sim.charge[0] == pytest.approx(-pauthenier_charge(0.3e-3, ABS_PERMITTIVITY, E), rel=1e-12, abs=0.0)


def test_no_grain_is_charged_beyond_what_air_can_hold():
    """26.6 uC/m2 on its surface (docs/physics.md 2.2); 3 MV/m would ask for 47."""
    sim = resting({"arc": EVERYWHERE, "field": 3e6})
    sim.step()
    assert sim.charge[0] == pytest.approx(-26.6e-6 * math.pi * 0.3e-3**2, rel=1e-12, abs=0.0)


def test_a_grain_beyond_saturation_keeps_its_charge_and_one_of_the_other_sign_is_brought_round():
    """Ions of one sign only: none is taken back, and Q runs through zero to Qs."""
    saturation = -pauthenier_charge(0.3e-3, ABS_PERMITTIVITY, 413e3)
    over = resting({"arc": EVERYWHERE, "field": 413e3, "current_density": 1e-3}, charge=1.5 * saturation)
    other = resting({"arc": EVERYWHERE, "field": 413e3, "current_density": 1e-3}, charge=-0.5 * saturation)
    history = []
    for _ in range(300):
        over.step()
        other.step()
        history.append(other.charge[0] / saturation)
    assert over.charge[0] == 1.5 * saturation
    assert np.all(np.diff(history) > 0.0)
    assert history[0] < 0.0 < 0.9 < history[-1] < 1.0


def test_only_insulators_in_the_arc_and_in_the_layer_are_charged():
    """Outside the arc, above the layer, or made of metal in flight: nothing."""
    sim = simulation(bare_drum(-VOLTAGE, corona={"arc": (0.2, 0.8), "height": 0.005}, landing=None))
    ids = {}
    for name, material, angle, gap in (
        ("in", "ABS", 0.5, 0.004), ("above", "ABS", 0.5, 0.006), ("before", "ABS", 0.15, 0.004),
        ("after", "ABS", 0.85, 0.004), ("metal", "copper", 0.5, 0.004),
    ):  # fmt: skip
        reach = R1 + 0.5e-3 + gap
        ids[name] = sim.add((reach * math.sin(angle), reach * math.cos(angle), 0.02 * len(ids)), material=material)[0]
    sim.step()
    charges = {name: sim.charge[row] for name, row in ids.items()}
    assert charges["in"] < 0.0
    assert [name for name, charge in charges.items() if charge != 0.0] == ["in"]


# ---- drum ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("voltage", [-VOLTAGE, VOLTAGE])
@pytest.mark.parametrize("angle", [0.0, math.radians(60.0), math.radians(200.0)])
def test_a_metal_on_the_drum_has_the_charge_of_induction(angle, voltage):
    """Q = (2/3) pi^3 eps0 r^2 E_n (docs/physics.md 2.1), wherever it touches and whatever it carried before."""
    diameter = 2e-3
    sim = simulation(bare_drum(voltage, speed=0.0, landing=None, **GRIP))
    set_on_drum(sim, "copper", diameter, angle=angle, charge=5e-11)
    position = sim.position[0].copy()
    sim.position[0] *= 1.0 + 1e-3 * diameter  # a whiff above, and thrown onto it
    sim.velocity[0] = -0.1 * position / np.hypot(*position[:2])
    sim.step()
    assert any(sim.contacts["b"] == -1)
    foot = angle_of(sim.position)
    sim.step()
    assert math.cos(foot - angle) > 1.0 - 1e-6
    assert sim.charge[0] == pytest.approx(contact_charge(diameter, drum_field(foot, voltage)), rel=1e-12, abs=0.0)


def test_plastic_keeps_its_charge_on_the_bare_drum():
    sim = resting(None, charge=-3e-12)
    sim.step(100)
    assert any(sim.contacts["b"] == -1)
    assert sim.charge[0] == -3e-12


# ---- brush and flight ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("material", ["ABS", "copper"])
def test_what_touches_the_brush_loses_its_charge_and_nothing_before(material):
    """A charged grain dropped on top of the brush, far from the electrode (docs/physics.md 5: the brush)."""
    brush = cesim.Brush()
    sim = simulation(
        bare_drum(-VOLTAGE, brush=brush, landing=None, effects={"electric_force": "off", "image_force": "off"})
    )
    sim.add((*brush.center[:1], brush.center[1] + brush.radius + 0.5e-3 + 5e-3, 0.0), material=material, charge=2e-12)
    touched = False
    for _ in range(100):
        sim.step()
        if touched:
            break
        assert sim.charge[0] == 2e-12
        touched = any((sim.contacts["b"] == -2) & (np.linalg.norm(sim.contacts["impulse"], axis=1) > 0.0))
    assert touched
    assert sim.charge[0] == 0.0


@pytest.mark.parametrize("material", ["ABS", "copper"])
def test_charge_is_conserved_in_flight_to_the_last_bit(material):
    """Past splitters that belong to no circuit, through the corona's height and down to the landing plane."""
    sim = simulation(bare_drum(-VOLTAGE, corona={"arc": (0.2, 1.0)}, step=1e-3))
    sim.add((0.20, 0.12, 0.0), velocity=(0.5, 0.1, 0.0), material=material, diameter=0.5e-3, charge=1.25e-12)
    sim.run(1.0)
    assert len(sim.landings) == 1
    assert sim.landings[0]["charge"] == 1.25e-12
    assert sim.landings[0]["collisions"] == 0
