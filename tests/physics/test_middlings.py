"""What is neither metal nor plastic: charges that decay on the drum, and grains that were not liberated.

Sources: docs/physics.md 2.2; mixtures: Critelli, Tasora, Degiorgi & Colledani, SIMUL 2014 (the weighted average of the
metal and the non-metal force). Charges are some 1e-12 C, so comparisons say abs=0.
"""

import math

import numpy as np
import pytest
from scenes import (
    EPS0,
    SPEED,
    VOLTAGE,
    bare_drum,
    contact_charge,
    drum_field,
    pauthenier_charge,
    set_on_drum,
    simulation,
)

import cesim
from cesim import engine
from cesim.scene.electrics import behaviour, kind_of, residence
from cesim.shapes.electric import contact_factors, semi_axes

GRIP = {"friction": 10.0, "rolling_friction": 10.0}
DIAMETER, PERMITTIVITY = 0.5e-3, 4.0


def middling(decay_time, **fields):
    return cesim.Material(kind="middling", density=1500.0, permittivity=PERMITTIVITY, decay_time=decay_time, **fields)


def board(share, **fields):
    return cesim.Material(kind="insulator", density=2000.0, permittivity=PERMITTIVITY, conductor_share=share, **fields)


def riding(material, speed=0.0, step=1e-3, charge=0.0, **parts):
    scene = bare_drum(-VOLTAGE, speed=speed, step=step, landing=None, **GRIP, **parts)
    scene.materials["it"] = material
    sim = simulation(scene)
    set_on_drum(sim, "it", DIAMETER, charge=charge)
    return sim


# ---- one law for all -------------------------------------------------------------------------------------------------


def test_the_decay_time_is_measured_or_the_permittivity_times_the_resistivity():
    of = {"kind": "middling", "density": 1500.0, "permittivity": 4.65}
    assert cesim.Material(resistivity="2e9 ohm m", **of).relaxation_time == pytest.approx(EPS0 * 4.65 * 2e9)
    assert cesim.Material(decay_time="80 ms", **of).relaxation_time == 0.08
    assert cesim.Material(kind="conductor", density=8960.0, resistivity=1.7e-8).relaxation_time < 1e-18
    for wrong in ({}, {"resistivity": 1e9, "decay_time": 1.0}):
        with pytest.raises(cesim.InputError, match="decay_time"):
            cesim.Material(**of, **wrong)


def test_the_time_on_the_drum_over_the_decay_time_makes_conductor_middling_and_insulator():
    """Below 0.005 nothing decays, above 2000 all has (docs/physics.md 2.2); some 1.01 s from top to brush."""
    scene = cesim.scenes.reference_machine("spheres")
    scene.corona = None
    time = residence(scene)
    assert time == pytest.approx(math.radians(271.5) / SPEED, rel=1e-3)
    kinds = [kind_of(scene, middling(time / ratio)) for ratio in (0.00499, 0.00501, 1.0, 1990.0, 2010.0)]
    assert kinds == ["insulator", "middling", "middling", "middling", "conductor"]
    ends = [behaviour(scene, middling(time / ratio))["conducting"] for ratio in (0.00501, 1990.0)]
    assert ends == pytest.approx([0.00500, 1.0], rel=1e-3)
    for kind in ("conductor", "insulator"):  # what has a decay time follows it, what has none its kind
        plain = cesim.Material(kind=kind, density=1500.0, permittivity=3.0)
        assert kind_of(scene, plain) == kind
        assert kind_of(scene, plain.model_copy(update={"decay_time": 0.1})) == "middling"
    scene.effects["charge_decay"] = "off"
    assert [kind_of(scene, middling(time / ratio)) for ratio in (0.9, 1.1)] == ["insulator", "conductor"]
    scene.effects["charge_decay"] = "on"
    assert kind_of(scene, middling(1e-9)) == "middling"


def test_the_decision_on_decay_says_why():
    scene = cesim.scenes.reference_machine("spheres")
    scene.materials["slag"] = middling(0.1)
    scene.feed.mix = {"slag": 0.5, "ABS": 0.5}
    row = scene.effects()["charge_decay"]
    assert row.on
    assert row.material == "slag"
    assert "t_drum/tau 10.1, middling" in row.why
    scene.materials["slag"] = middling(1e3)
    assert not scene.effects()["charge_decay"].on
    assert "insulator" in scene.effects()["charge_decay"].why


def test_what_conducts_does_so_before_the_ions_of_the_corona_come():
    """Else they leave tau/ion_time of their charge on it: ion_time^2 > 1000 tau times the time on the drum."""
    scene = cesim.scenes.reference_machine("spheres")
    E, time = scene.electric_field().on_line(scene.drum.radius), residence(scene)
    for current in (1e-3, 1e-2):
        scene.corona.current_density = current
        limit = (4.0 * EPS0 * E / current) ** 2 / (1000.0 * time)
        assert [kind_of(scene, middling(limit * share)) for share in (0.99, 1.01)] == ["conductor", "middling"]
    copper = cesim.Material(kind="conductor", density=8960.0, resistivity=1.7e-8)
    scene.corona.current_density = None
    assert [kind_of(scene, material) for material in (copper, middling(1e-9))] == ["conductor", "middling"]


def test_charging_is_at_once_where_it_takes_a_fiftieth_of_a_percent_of_the_time_in_the_arc():
    """Unless the corona says so, or a charge decays at the same time."""
    scene = cesim.scenes.reference_machine("spheres")
    time = (scene.corona.arc[1] - scene.corona.arc[0]) / scene.drum.speed
    E = scene.electric_field().on_line(scene.drum.radius)
    for ratio, in_time in ((1.9e-4, False), (2.1e-4, True)):
        scene.corona.current_density = 4.0 * EPS0 * E / (ratio * time)
        assert math.isfinite(scene.effects()["corona_charging"].parameters["current_density"]) == in_time
        assert scene.effects()["charging_kinetics"].on == in_time
        scene.corona.kinetics = "off" if in_time else "on"
        assert math.isfinite(scene.effects()["corona_charging"].parameters["current_density"]) != in_time
        scene.corona.kinetics = "auto"
    scene.corona.current_density = 1.0
    scene.materials["slag"] = middling(0.1)
    assert scene.effects()["charging_kinetics"].on


# ---- decay on the drum -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tau", [1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 1.0])
def test_a_grain_at_rest_on_the_drum_relaxes_to_its_charge_of_contact_exactly(tau):
    """Steps of a tenth to a hundred million decay times: to 1e-12."""
    rest = contact_charge(DIAMETER, drum_field(0.0, -VOLTAGE))
    for step in (1e-3, 2.5e-4):
        sim = riding(middling(tau), step=step, charge=-3e-12)
        sim.step()  # in which it comes to touch
        assert sim.charge[0] == -3e-12
        for n in (1, 7, 20):
            sim.step(n - round(sim.time / step) + 1)
            exact = rest + (-3e-12 - rest) * math.exp(-n * step / tau)
            assert sim.charge[0] == pytest.approx(exact, rel=1e-12, abs=1e-12 * rest)


def test_ions_and_conduction_are_followed_together_in_a_scene():
    """A middling at rest in the arc: in one step of 20 ms what an integrator gives, and the same in 200 steps."""
    from scipy.integrate import solve_ivp

    field, tau, current = 400e3, 0.01, 2e-3
    full = -pauthenier_charge(DIAMETER, PERMITTIVITY, field)
    rest = contact_charge(DIAMETER, drum_field(0.0, -VOLTAGE))
    ions = 4.0 * EPS0 * field / current
    corona = {"arc": (-0.5, 0.5), "field": field, "current_density": current}
    for step in (1e-4, 1e-3, 0.02):
        sim = riding(middling(tau), step=step, corona=corona)
        sim.step()
        before = sim.charge[0]
        flight = ions * (1.0 + ions / tau)  # it does not touch yet
        assert before == pytest.approx(full * step / (step + flight), rel=1e-12, abs=0.0)
        sim.step(round(0.02 / step))
        exact = solve_ivp(
            lambda _, x: [(1.0 - x[0]) ** 2 / ions - (x[0] - rest / full) / tau],
            (0.0, 0.02), [before / full], "DOP853", rtol=1e-12, atol=1e-14,
        )  # fmt: skip
        assert sim.charge[0] == pytest.approx(full * exact.y[0, -1], rel=1e-9, abs=0.0)


def test_a_ride_under_the_corona_and_on_does_not_depend_on_the_step():
    """Through the arc and 10 degrees beyond, where its charge decays: off by the part of a step at the edges."""
    charges = []
    for step in (1e-3, 5e-4, 1e-4):
        corona = {"arc": (math.radians(10.0), math.radians(40.0)), "field": 400e3, "current_density": 2e-3}
        sim = riding(middling(0.1), speed=SPEED, step=step, corona=corona)
        sim.run(math.radians(50.0) / SPEED)
        charges.append(sim.charge[0] / pauthenier_charge(DIAMETER, PERMITTIVITY, 400e3))
    assert abs(charges[0] - charges[2]) < 0.01
    assert abs(charges[1] - charges[2]) < 0.005


def test_a_grazing_contact_does_not_make_the_charge_jump_to_and_fro():
    """A grain that hops by a thousand millionth of its size: its charge only ever comes nearer to that of contact."""
    for tau in (1e-9, 1e-3, 0.1):
        sim = riding(middling(tau), charge=-3e-12)
        sim.position[:, :2] *= 1.0 + 1e-9
        charges = []
        for _ in range(200):
            sim.step()
            charges.append(sim.charge[0])
        assert (np.diff(charges) >= 0.0).all()
        assert charges[-1] > 0.0


def test_near_the_drum_a_relaxed_middling_feels_what_a_conductor_feels_and_a_slow_one_what_an_insulator_feels():
    """At the charge of contact, 0.3 radii off the drum; between them in proportion to 1 - exp(-t/tau), t = 1 s."""
    place = (0.0, 0.16 + 0.65 * DIAMETER, 0.0)
    pushed = {}
    for name, material in (
        ("conductor", cesim.Material(kind="conductor", density=1500.0)),
        ("insulator", cesim.Material(kind="insulator", density=1500.0, permittivity=PERMITTIVITY)),
        ("fast", middling(1e-3)),
        ("between", middling(2.0)),
        ("slow", middling(1e9)),
    ):
        scene = bare_drum(-VOLTAGE, speed=0.0, step=1e-5, landing=None)
        scene.materials["it"] = material
        sim = simulation(scene)
        E = float(scene.electric_field()([place])[0, 1])
        sim.add(place, material="it", diameter=DIAMETER, charge=contact_charge(DIAMETER, E))
        sim.step()
        pushed[name] = sim.velocity[0, 1]
    assert pushed["fast"] == pytest.approx(pushed["conductor"], rel=1e-4)
    assert pushed["slow"] == pytest.approx(pushed["insulator"], rel=1e-4)
    share = -math.expm1(-0.5)
    average = share * pushed["fast"] + (1.0 - share) * pushed["slow"]
    assert pushed["between"] == pytest.approx(average, rel=1e-6)
    assert pushed["conductor"] > pushed["insulator"] + 1e-7


# ---- from conductor to insulator -------------------------------------------------------------------------------------


def landing_on(scene, material, diameter):
    """x in m where a grain lands that starts on the top of the drum, at its speed."""
    scene.materials["it"] = material
    sim = simulation(scene)
    set_on_drum(sim, "it", diameter)
    sim.run(2.0)
    return float(sim.landings["position"][0, 0])


def swept_machine(corona):
    return bare_drum(-VOLTAGE, corona=corona, rolling_friction=0.35, effects={"drag": "on"})


def switch(scene, kind, least, most):
    """Decay time in s at which a scene takes a material for a middling instead of a conductor or for an insulator."""
    low, high = math.log(least), math.log(most)
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        beyond = (kind_of(scene, middling(math.exp(middle))) == "middling") == (kind == "conductor")
        low, high = (low, middle) if beyond else (middle, high)
    return math.exp(low)


@pytest.mark.parametrize("corona", [None, {"current_density": 5e-4}, {"current_density": 2e-3}, {}])
def test_a_landing_is_continuous_where_a_middling_becomes_a_conductor_or_an_insulator(corona):
    """Within 1 mm, without ions, with a current and with charging at once.

    A grain of 1 mm under a current would jump by 66 mm if ions reached it in flight and not a conductor, and by 10 mm
    without ions if t/tau > 20 were enough for one.
    """
    scene = swept_machine(corona)
    for kind, least, most in (("conductor", 1e-12, 1.0), ("insulator", 1.0, 1e5)):
        tau = switch(scene, kind, least, most)
        for diameter in (0.4e-3, 1e-3):
            x = [landing_on(scene, middling(tau * share), diameter) for share in (1.0 - 1e-6, 1.0 + 1e-6)]
            assert abs(x[1] - x[0]) < 1e-3


def test_the_longer_a_charge_takes_to_decay_the_nearer_a_grain_lands():
    """From conductor to insulator over 10 decades of resistivity, without ions: no step back, none above a fifth."""
    scene = swept_machine(None)
    x = [landing_on(scene, middling(tau), 0.5e-3) for tau in np.geomspace(1e-6, 1e4, 41)]
    assert (np.diff(x) <= 3e-4).all()
    assert np.abs(np.diff(x)).max() < 0.2 * (x[0] - x[-1])


def test_a_relaxed_flake_that_lifts_off_feels_what_a_metal_flake_feels():
    """A tenth of its diameter over the drum, at its charge of contact there; a sphere's excess is another by a half."""
    pushed = []
    for material in (middling(1e-9), cesim.Material(kind="conductor", density=1500.0)):
        scene = bare_drum(-VOLTAGE, speed=0.0, step=1e-5, landing=None, effects={"gravity": "off"})
        scene.materials["it"], scene.shapes["it"] = material, cesim.Ellipsoid(axes=(3.0, 3.0, 1.0))
        sim = simulation(scene)
        axes = semi_axes(next(shape for shape in sim.shapes if shape.kind != "sphere").moments)
        place = (0.0, 0.16 + (axes[2] + 0.1) * DIAMETER, 0.0)
        E = float(scene.electric_field()([place])[0, 1])
        charge = contact_factors(axes)[0, 2] * math.pi * EPS0 * DIAMETER**2 * E
        quarter = (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0)
        sim.add(place, material="it", diameter=DIAMETER, charge=charge, shape="it", orientation=quarter)
        sim.step()
        pushed.append(sim.velocity[0, 1] * sim.mass[0] / (1e-5 * charge * E))
    assert pushed[0] == pytest.approx(pushed[1], rel=1e-9)
    assert pushed[1] < 0.9


# ---- mixtures --------------------------------------------------------------------------------------------------------


def test_a_mixture_averages_its_contents_by_volume():
    copper, fr4 = cesim.materials.named("copper"), cesim.materials.named("FR4")
    mixed = cesim.Material.mixture({"copper": 0.3, "FR4": 0.7})
    volumes = np.array([0.3 / copper.density, 0.7 / fr4.density])
    assert mixed.density == pytest.approx(1.0 / volumes.sum())
    assert mixed.conductor_share == pytest.approx(volumes[0] / volumes.sum())
    assert (mixed.kind, mixed.permittivity) == ("insulator", fr4.permittivity)
    assert cesim.Material.mixture({"copper": 1.0}).kind == "conductor"
    assert cesim.Material.mixture({"copper": 0.3, "FR4": 0.7}, conductor_share=0.3).conductor_share == 0.3
    leaky = cesim.Material.mixture({"copper": 0.1, "it": 0.5, "ABS": 0.4}, {"it": middling(0.1)})
    share = (0.5 / 1500.0) / (0.5 / 1500.0 + 0.4 / 1050.0)
    permittivity = share * PERMITTIVITY + (1.0 - share) * 2.87
    assert leaky.kind == "middling"
    assert leaky.relaxation_time == pytest.approx(permittivity / (share * PERMITTIVITY / 0.1))  # conductivities add
    for wrong in ({"copper": 0.3}, {"coper": 1.0}, {}):
        with pytest.raises(cesim.InputError, match="mixture"):
            cesim.Material.mixture(wrong)


def test_a_mixture_has_the_average_of_the_metals_and_the_plastics_charge_on_the_drum():
    """Each as if it were all of the grain; the brush takes both."""
    share, field = 0.3, 400e3
    sim = riding(board(share), corona={"arc": (-0.5, 0.5), "field": field})
    sim.step(3)
    metal = contact_charge(DIAMETER, drum_field(0.0, -VOLTAGE))
    plastic = -pauthenier_charge(DIAMETER, PERMITTIVITY, field)
    assert sim.conducted[0] == pytest.approx(share * metal, rel=1e-12, abs=0.0)
    assert sim.charge[0] == pytest.approx(share * metal + (1.0 - share) * plastic, rel=1e-12, abs=0.0)


def test_the_force_on_a_mixture_is_the_average_of_the_metals_and_the_plastics_force():
    """Near the drum, where both are quadratic in charges: F = w F_metal(Q_metal) + (1 - w) F_plastic(Q_plastic)."""
    share, metal, plastic = 0.4, 6e-12, -5e-12
    pushed = []
    for material, charge, conducted in (
        (board(share), share * metal + (1.0 - share) * plastic, share * metal),
        (cesim.Material(kind="conductor", density=2000.0), metal, 0.0),
        (cesim.Material(kind="insulator", density=2000.0, permittivity=PERMITTIVITY), plastic, 0.0),
    ):
        scene = bare_drum(-VOLTAGE, speed=0.0, step=1e-5, landing=None)
        scene.materials["it"] = material
        sim = simulation(scene)
        sim.add((0.0, 0.16 + 0.8 * DIAMETER, 0.0), material="it", diameter=DIAMETER, charge=charge)
        if material.conductor_share:
            sim.conducted[:] = conducted
        sim.step()
        pushed.append(sim.velocity[0])
    assert pushed[0] == pytest.approx(share * pushed[1] + (1.0 - share) * pushed[2], rel=1e-12)


def test_runs_with_mixtures_and_middlings_restore_bit_for_bit_with_any_number_of_threads(tmp_path):
    scene = cesim.scenes.reference_machine("spheres")
    scene.materials["board"] = cesim.Material.mixture({"copper": 0.3, "FR4": 0.7})
    scene.materials["slag"] = middling(0.05)
    scene.feed.mix = {"board": 0.5, "slag": 0.2, "ABS": 0.3}
    scene = cesim.scene.Scene.from_toml(scene.to_toml())
    sim = cesim.Simulation(scene, seed=3, threads=1)
    sim.run("0.9 s")
    assert np.any(sim.conducted != 0.0)
    sim.save(tmp_path / "state.h5")
    again = cesim.Simulation.restore(tmp_path / "state.h5", threads=2)
    for one in (sim, again):
        one.step(50)
    assert sim.state_hash() == again.state_hash()


def test_a_scene_without_mixtures_has_no_column_for_them():
    sim = riding(middling(0.1))
    assert "conducted" in sim.engine.state()
    assert len(sim.engine.state()["conducted"]) == 0
    assert sim.conducted.tolist() == [0.0]


def test_what_the_engine_is_given_of_materials_is_checked():
    base = simulation(bare_drum(-VOLTAGE)).definition
    for name, value in (("decay_time", -1.0), ("decay_time", math.nan), ("conducting", 1.5), ("conductor_share", 1.0)):
        wrong = {"kind": "middling", "density": 1500.0, "permittivity": 3.0, "decay_time": 1.0, name: value}
        with pytest.raises(engine.InputError, match=name):
            engine.Scene({**base, "materials": [wrong, *base["materials"][1:]]})
