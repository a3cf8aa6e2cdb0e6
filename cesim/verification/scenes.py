"""Scenes of the hard cases, small and built in code, without air unless said."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..scene import Bounds, Drum, Numerics, Scene, Wall
from ..simulation import Simulation

Array = NDArray[np.float64]

GRAVITY = 9.81  # m/s2
OPEN = Bounds(lower=(-9.0, -9.0, -9.0), upper=(9.0, 9.0, 9.0))
BLOCK = 10.0  #: rolling friction with which a sphere cannot turn: the moment that would turn it is at most mu r N
RADIUS = 1e-3  # m


def bare(gravity: ArrayLike = (0.0, -GRAVITY, 0.0), **parts: Any) -> Scene:
    """Nothing but what is named; no air."""
    x, y, z = (float(component) for component in np.asarray(gravity))
    return Scene(**{"gravity": (x, y, z), "bounds": OPEN, "effects": {"drag": "off"}, **parts})


def wall(point: ArrayLike, normal: ArrayLike, **coefficients: float) -> Wall:
    """An endless plane, by a point of it and its outward normal."""
    place = {"position": np.asarray(point, float).tolist(), "normal": np.asarray(normal, float).tolist()}
    made: Wall = Wall.model_validate({**place, **coefficients})
    return made


def grain(density: float = 2500.0, **coefficients: float) -> dict[str, Any]:
    """A material of conducting grains."""
    return {"kind": "conductor", "density": density, **coefficients}


def plane(
    slope: float = 0.0,
    *,
    friction: float = 0.0,
    restitution: float = 0.0,
    rolling_friction: float = 0.0,
    step: float = 1e-3,
    contact_law: str = "coulomb",
    materials: Mapping[str, Any] | None = None,
) -> Scene:
    """An endless plane through the origin; gravity leans by the slope in rad, towards +x."""
    return bare(
        (GRAVITY * math.sin(slope), -GRAVITY * math.cos(slope), 0.0),
        walls=[
            wall((0, 0, 0), (0, 1, 0), friction=friction, restitution=restitution, rolling_friction=rolling_friction)
        ],
        numerics=Numerics.model_validate({"step": step, "contact_law": contact_law}),
        materials=dict(materials or {}),
    )


def on_plane(scene: Scene, height: float = 0.0, radius: float = RADIUS, **rest: Any) -> Simulation:
    """A copper grain over the plane y = 0, by the height of its lowest point."""
    sim = Simulation(scene, threads=1)
    sim.add((0.0, radius + height, 0.0), material="copper", diameter=2.0 * radius, **rest)
    return sim


def drum(
    speed: float, *, friction: float = 0.5, rolling_friction: float = 0.0, restitution: float = 0.0, **parts: Any
) -> Scene:
    """A turning drum of 0.32 m, long enough to need no care at its ends."""
    shape = Drum(speed=speed, friction=friction, rolling_friction=rolling_friction, restitution=restitution, length=1.0)
    return bare(drum=shape, **parts)


def set_on_drum(sim: Simulation, material: str, diameter: float, angle: float = 0.0, charge: float = 0.0) -> None:
    """Add a grain that rides on the drum, at an angle in rad from its top, clockwise."""
    speed = -float(sim.definition["surfaces"][0]["angular_speed"])
    reach = float(sim.definition["drum_radius"]) + 0.5 * diameter
    outward = np.array([math.sin(angle), math.cos(angle), 0.0])
    along = np.array([math.cos(angle), -math.sin(angle), 0.0])
    sim.add(
        reach * outward,
        velocity=speed * reach * along,
        material=material,
        diameter=diameter,
        charge=charge,
        angular_velocity=(0.0, 0.0, -speed),
    )


def box(
    count: int,
    *,
    friction: float = 0.3,
    restitution: float = 0.0,
    spread: float = 0.2,
    width: float = 0.02,
    gravity: float = GRAVITY,
    threads: int = 1,
) -> Simulation:
    """Grains of 0.8-1.2 mm in loose layers over the floor of a square box, falling."""
    shared = {"friction": friction, "restitution": restitution}
    sides = [wall((0, 0, 0), (0, 1, 0), **shared)]
    for x, z in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        sides.append(wall((-0.5 * width * x, 0, -0.5 * width * z), (x, 0, z), **shared))
    sim = Simulation(bare((0.0, -gravity, 0.0), walls=sides, materials={"grain": grain(**shared)}), threads=threads)
    rng = np.random.default_rng(1)
    pitch = 1.3e-3
    k, i = int(width / pitch), np.arange(count)
    position = np.column_stack([i % k - 0.5 * (k - 1), i // (k * k), (i // k) % k - 0.5 * (k - 1)]) * pitch
    position[:, 1] += 1e-3
    velocity = rng.normal(0.0, 0.5 * spread, (count, 3))
    diameter = 1e-3 * (1.0 + spread * rng.uniform(-1.0, 1.0, count))
    sim.add(position, velocity=velocity, material="grain", diameter=diameter)
    return sim


# ---- what is read off a simulation -----------------------------------------------------------------------------------


def kinetic(sim: Simulation) -> float:
    """Kinetic energy of translation of the fastest grain over its m g d."""
    fastest = np.square(sim.velocity).sum(axis=1) / (2.0 * GRAVITY * sim.diameter)
    return float(fastest.max())


def energy(sim: Simulation, gravity: float = GRAVITY) -> float:
    """Of translation, of rotation and of height, J."""
    r = 0.5 * sim.diameter
    motion = np.square(sim.velocity).sum(axis=1) + 0.4 * np.square(r[:, None] * sim.angular_velocity).sum(axis=1)
    return float((sim.mass * (0.5 * motion + gravity * sim.position[:, 1])).sum())


def floor_force(sim: Simulation) -> float:
    """Upward force in N of all surfaces in the last step."""
    contacts = sim.contacts
    return float(contacts["impulse"][contacts["b"] < 0, 1].sum()) / sim.step_size


def overlap(sim: Simulation) -> float:
    """Deepest overlap of a pair of grains over the smaller diameter, by brute force."""
    x, r = sim.position, 0.5 * sim.diameter
    first, second = np.triu_indices(sim.count, 1)
    if not len(first):
        return 0.0
    gap = np.linalg.norm(x[first] - x[second], axis=1) - r[first] - r[second]
    return float((-gap / (2.0 * np.minimum(r[first], r[second]))).max())


def sphere_mass(density: float, diameter: float) -> float:
    """Mass, kg."""
    return density * math.pi * diameter**3 / 6.0
