"""Small scenes for tests and benchmarks, and the closed forms that they are held against.

The closed forms are written anew from `docs/physics.md` and its sources, on purpose in another way than in the engine.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad
from scipy.optimize import brentq

import cesim
from cesim.corona import MOBILITY, coaxial, onset
from cesim.scene import Bounds, Numerics

EPS0 = 8.8541878188e-12  # F/m, CODATA 2022
GRAVITY = 9.81  # m/s2
SPEED = 44.8 * math.pi / 30.0  # rad/s, of the reference drum
R1, R2, L, TILT, VOLTAGE = 0.160, 0.019, 0.267, math.radians(30.0), 35e3  # of the reference machine, SI

OPEN = Bounds(lower=(-9.0, -9.0, -9.0), upper=(9.0, 9.0, 9.0))


# ---- scenes ----------------------------------------------------------------------------------------------------------


def bare_drum(
    voltage: float | None = None,
    *,
    speed: float = SPEED,
    friction: float = 0.5,
    rolling_friction: float = 0.0,
    step: float = 1e-3,
    landing: float | None = -0.10,
    corona: Mapping[str, Any] | None = None,
    effects: Mapping[str, Any] | None = None,
    **rest: Any,
) -> cesim.Scene:
    """The reference drum, with the electrode at a voltage (None: no electrode), alone in still air.

    Nothing is fed; effects are on only where named: gravity always, the electric ones as the parts allow.
    """
    return cesim.Scene(
        name="bare drum",
        drum=cesim.Drum(speed=speed, friction=friction, rolling_friction=rolling_friction),
        electrode=None if voltage is None else cesim.Electrode(voltage=voltage),
        corona=None if corona is None else cesim.Corona(**corona),
        collect=None if landing is None else cesim.Collect(y=landing),
        numerics=Numerics(step=step, threads=1),
        bounds=OPEN,
        effects={"drag": "off", **(effects or {})},
        **rest,
    )


def flight_scene(step: float = 1e-3, voltage: float = -VOLTAGE, **rest: Any) -> cesim.Scene:
    """The reference drum and electrode, in still air: weight, drag, Q E, sphere-plane and image force."""
    acting = ("drag", "electric_force", "sphere_plane", "image_force")
    effects = dict.fromkeys(acting, "on") | {"wind": "off", "magnus": "off"}
    return bare_drum(voltage, step=step, effects=effects, **rest)


def still_air(step: float, law: str = "schiller_naumann", gravity: float = GRAVITY) -> cesim.Scene:
    """Air under gravity, and nothing else."""
    return cesim.Scene(
        name="still air",
        air=cesim.Air(law=law),
        numerics=Numerics(step=step, threads=1),
        bounds=OPEN,
        gravity=(0.0, -gravity, 0.0),
        effects={"drag": "on"},
    )


def plane_scene(
    slope: float = 0.0,
    *,
    friction: float = 0.0,
    restitution: float = 0.0,
    rolling_friction: float = 0.0,
    step: float = 1e-3,
    contact_law: str = "coulomb",
    **rest: Any,
) -> cesim.Scene:
    """An endless plane through the origin without air; gravity leans by the slope in rad, towards +x."""
    coefficients = {"friction": friction, "restitution": restitution, "rolling_friction": rolling_friction}
    return cesim.Scene(
        name="plane",
        walls=[cesim.Wall(position=(0.0, 0.0, 0.0), normal=(0.0, 1.0, 0.0), **coefficients)],
        numerics=Numerics(step=step, contact_law=contact_law, threads=1),
        bounds=OPEN,
        gravity=(GRAVITY * math.sin(slope), -GRAVITY * math.cos(slope), 0.0),
        effects={"drag": "off"},
        **rest,
    )


def simulation(scene: cesim.Scene, **coefficients: float) -> cesim.Simulation:
    """A simulation whose grain-surface coefficients may exceed what a scene allows: friction=1e4 stands for no slip."""
    sim = cesim.Simulation(scene, threads=1)
    if coefficients:
        for name, value in coefficients.items():
            sim.definition[f"surface_{name}"] = np.full_like(sim.definition[f"surface_{name}"], value)
        sim.engine = cesim.engine.Scene(sim.definition, seed=1, threads=1)
    return sim


def set_on_drum(sim: cesim.Simulation, material: str, diameter: float, angle: float = 0.0, charge: float = 0.0) -> None:
    """Adds a grain that rides on the drum, at an angle in rad from its top, clockwise."""
    speed = -sim.definition["surfaces"][0]["angular_speed"]
    reach = sim.definition["drum_radius"] + 0.5 * diameter
    outward, along = (
        np.array([math.sin(angle), math.cos(angle), 0.0]),
        np.array([math.cos(angle), -math.sin(angle), 0.0]),
    )
    sim.add(
        reach * outward,
        velocity=speed * reach * along,
        material=material,
        diameter=diameter,
        charge=charge,
        angular_velocity=(0.0, 0.0, -speed),
    )


def angle_of(position: ArrayLike) -> float:
    """Angle in rad from the top of the drum, clockwise, of a point; from 0 to 2 pi."""
    x, y = np.asarray(position, dtype=float).ravel()[:2]
    return math.atan2(x, y) % (2.0 * math.pi)


def leave_drum(sim: cesim.Simulation, longest: float = 2.0) -> float:
    """Steps until the only grain has left the drum; the angle in rad of the last step in which the drum pressed it.

    It has left when the drum has not pressed it for 20 ms. Fails when that takes more than ``longest`` seconds.
    """
    last, since = angle_of(sim.position), 0.0
    while since < 0.020:
        sim.step()
        assert sim.time < longest, f"the grain is still on the drum, at {math.degrees(last):.2f} degrees"
        pushes = sim.contacts
        if any(np.dot(push["impulse"], push["normal"]) > 0.0 for push in pushes if push["b"] == -1):
            last, since = angle_of(sim.position), 0.0
        else:
            since += sim.step_size
    return last


# ---- closed forms ----------------------------------------------------------------------------------------------------


def field(points: ArrayLike, voltage: float) -> NDArray[np.float64]:
    """Field of the reference machine in V/m at points (n, 2) m: two line charges (docs/physics.md 1.1)."""
    x, y = np.asarray(points, dtype=float).reshape(-1, 2).T
    u, v = x * math.cos(TILT) + y * math.sin(TILT), y * math.cos(TILT) - x * math.sin(TILT)
    h1 = (L**2 + R1**2 - R2**2) / (2.0 * L)
    c = math.sqrt(h1**2 - R1**2)
    f = voltage / math.acosh((L**2 - R1**2 - R2**2) / (2.0 * R1 * R2))
    minus, plus = (u - h1 + c) ** 2 + v**2, (u - h1 - c) ** 2 + v**2
    eu, ev = -f * ((u - h1 + c) / minus - (u - h1 - c) / plus), -f * (v / minus - v / plus)
    return np.column_stack([eu * math.cos(TILT) - ev * math.sin(TILT), eu * math.sin(TILT) + ev * math.cos(TILT)])


def drum_field(angle: float, voltage: float) -> float:
    """Outward field in V/m on the reference drum, at an angle in rad from its top, clockwise."""
    normal = np.array([math.sin(angle), math.cos(angle)])
    return float(field(R1 * normal, voltage)[0] @ normal)


def contact_charge(diameter: float, normal_field: float) -> float:
    """Charge in C of a conducting sphere on a grounded plane: (2/3) pi^3 eps0 r^2 E (Felici)."""
    return 2.0 / 3.0 * math.pi**3 * EPS0 * (0.5 * diameter) ** 2 * normal_field


def pauthenier_charge(diameter: float, permittivity: float, normal_field: float) -> float:
    """Charge in C at which a sphere in an ion flow saturates (Pauthenier & Moreau-Hanot 1932)."""
    return 12.0 * math.pi * EPS0 * (0.5 * diameter) ** 2 * normal_field * permittivity / (permittivity + 2.0)


def schiller_naumann(speed: float, diameter: float, density: float = 1.204, viscosity: float = 1.81e-5) -> float:
    """Drag in N on a sphere (Schiller & Naumann 1933)."""
    if speed == 0.0:
        return 0.0
    reynolds = density * speed * diameter / viscosity
    coefficient = 24.0 / reynolds * (1.0 + 0.15 * reynolds**0.687) if reynolds < 1000.0 else 0.44
    return coefficient * 0.5 * density * speed**2 * math.pi * diameter**2 / 4.0


def sphere_mass(density: float, diameter: float) -> float:
    """Mass in kg."""
    return density * math.pi * diameter**3 / 6.0


def assert_goes_on_bit_for_bit(scene, position, charge, path):
    """On one thread and two, and from a restart file after 20 of 40 steps."""
    sims = [cesim.Simulation(scene, threads=threads) for threads in (1, 2)]
    for sim in sims:
        sim.add(position, charge=charge)
        sim.step(20)
    assert sims[0].state_hash() == sims[1].state_hash()
    sims[0].save(path)
    again = cesim.Simulation.restore(path)
    for sim in (again, sims[1]):
        sim.step(20)
    assert again.state_hash() == sims[1].state_hash()


def exact_coaxial_current(voltage, wire, cylinder):
    """Current of a metre of wire, A/m, at which the exact field adds up to the voltage; radii in m."""

    def short_by(current):
        def field(u):
            return math.exp(u) * coaxial(math.exp(u), current, wire, onset(wire), MOBILITY)

        return quad(field, math.log(wire), math.log(cylinder), epsabs=0.0, epsrel=1e-12)[0] - voltage

    return brentq(short_by, 0.0, 1.0, xtol=1e-18, rtol=1e-14)
