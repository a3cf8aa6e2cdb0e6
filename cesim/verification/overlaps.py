"""Grains that overlap from the start (docs/numerics.md 3, cases 20, 21)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..simulation import Simulation
from .rows import Case, Rows, Size, at_least, at_most
from .scenes import bare, energy, grain, kinetic, overlap, plane
from .watch import Watch

D = 1e-3


def cloud(position: ArrayLike, step: float, restitution: float = 0.0, diameter: ArrayLike = D) -> Simulation:
    """Grains alone in space."""
    material = grain(friction=0.2, restitution=restitution)
    sim = Simulation(bare((0.0, 0.0, 0.0), materials={"grain": material}, numerics={"step": step}), threads=1)
    sim.add(position, material="grain", diameter=diameter)
    return sim


def coincident(size: Size) -> Rows:
    """Two to a thousand grains in one point."""
    watch = Watch(work=None)  # there is no energy to compare with
    for count in (2, 10, 30):
        speed = drift = left = 0.0
        for restitution in (0.0, 1.0):
            sim = cloud(np.full((count, 3), 0.01), 1e-3, restitution)
            for _ in range(200):
                watch.step(sim)
                speed = max(speed, float(np.abs(sim.velocity).max()))
            left = max(left, overlap(sim))
            center = (sim.mass[:, None] * sim.position).sum(axis=0) / sim.mass.sum()
            drift = max(drift, float(np.abs(center - 0.01).max()) / D)
        yield at_most(f"{count} grains: fastest in 200 steps, e = 0 and 1", speed, 1e-12, "m/s")
        yield at_most(f"{count} grains: their centre of mass moves by", drift, 1e-9, "d")
        yield at_most(f"{count} grains: overlap after 200 steps", left, 1e-5, "d")
    sim = cloud(np.zeros((1000, 3)), 1e-3)
    watch.step(sim, 50 if size == "full" else 10)
    yield at_most("1000 grains: fastest", np.abs(sim.velocity).max(), 1e-12, "m/s")
    yield at_least("1000 grains: spread over", np.ptp(sim.position[:, 1]) / D, 5.0, "d")
    sim = cloud([(0.0, 0.0, 0.0), (0.5 * D, 0.0, 0.0)], 1e-3)
    watch.step(sim, 5)
    yield at_most("half overlapping pair: energy afterwards", energy(sim, 0.0), 0.0, "J")
    yield watch.row()


def recovery(size: Size) -> Rows:
    """Ten micrometres of overlap, of a pair and in the floor, at steps over two decades."""
    watch = Watch(work=None)
    for step in (1e-3, 1e-4, 1e-5):
        sim = cloud([(0.0, 0.0, 0.0), (D - 1e-5, 0.0, 0.0)], step)
        watch.step(sim, 20)
        yield at_most(f"h = {step:.0e} s, a pair: kinetic energy", kinetic(sim), 1e-6, "m g d")
        yield at_most(f"h = {step:.0e} s, a pair: overlap left", overlap(sim), 1e-6, "d")
        scene = plane(friction=0.2, restitution=0.9, step=step, materials={"grain": grain(restitution=0.9)})
        sim = Simulation(scene, threads=1)
        sim.add((0.0, 0.5 * D - 1e-5, 0.0), material="grain", diameter=D)
        watch.step(sim, 20)
        yield at_most(f"h = {step:.0e} s, in the floor: kinetic energy", kinetic(sim), 1e-6, "m g d")
        yield at_most(f"h = {step:.0e} s, in the floor: off it by", abs(sim.position[0, 1] / D - 0.5), 1e-6, "d")
    yield watch.row()


CASES = (
    Case(
        "20",
        "grains in one point",
        "no normal is defined, and overlap taken back through velocities explodes",
        "momentum and energy of what is at rest",
        coincident,
    ),
    Case(
        "21",
        "overlap of 10 µm",
        "a velocity of overlap over step grows without bound as the step shrinks",
        "energy of what is at rest",
        recovery,
    ),
)
