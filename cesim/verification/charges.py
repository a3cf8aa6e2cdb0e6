"""Charged grains that meet (docs/numerics.md 3, case 19)."""

from __future__ import annotations

import math

import numpy as np

from ..constants import VACUUM_PERMITTIVITY as EPS0
from ..simulation import Simulation
from .rows import Case, Rows, Size, at_most, equal, relative, within
from .scenes import Array, bare, grain
from .watch import Watch

D = 1e-3  # m
COULOMB = 1.0 / (4.0 * math.pi * EPS0)  # N m2/C2
CHARGE = 5e-11  # C, some 16 uC/m2 on such a grain
GAPS = (1e-2, 1e-4, 1e-8, 0.0, -1e-4, -0.1, -0.5, -1.0)  # over a diameter; below 0 they overlap
METHODS = {"tree": 0.0, "cut-off": 1.0, "direct": 2.0}


def charged(signs: tuple[float, ...], method: float, step: float = 1e-4, **numerics: str) -> Simulation:
    """A pair, or a row of grains, in empty space; their places come with `add`."""
    scene = bare(
        (0.0, 0.0, 0.0),
        materials={"grain": grain(restitution=0.0)},
        numerics={"step": step, **numerics},
        effects={"drag": "off", "pair_coulomb": {"state": "on", "parameters": {"method": method}}},
    )
    sim = Simulation(scene, threads=1)
    x = np.zeros((len(signs), 3))
    x[:, 0] = np.arange(len(signs)) * D
    sim.add(x, material="grain", diameter=D, charge=CHARGE * np.asarray(signs))
    return sim


def first_push(sim: Simulation, gap: float) -> Array:
    """Momentum that one step gives each of a pair, this far apart, in kg m/s; contacts are off."""
    sim.position[:] = [(0.0, 0.0, 0.0), (D + gap * D, 0.0, 0.0)]
    sim.velocity[:] = 0.0
    sim.step()
    pushes: Array = sim.mass[:, None] * np.asarray(sim.velocity)
    return pushes


def law(gap: float) -> float:
    """Magnitude of the force on one of a pair, N."""
    distance = D + gap * D
    return COULOMB * CHARGE**2 * distance / max(distance, D) ** 3


def pairs_at_overlap(size: Size) -> Rows:
    """Like and unlike pairs from far to one point; a pair that falls together; a row that flies apart."""
    watch = Watch(work=None, momentum=False)  # what charges do is no contact's
    for name, method in METHODS.items():
        error = net = 0.0
        for signs in ((1.0, 1.0), (1.0, -1.0)):
            sim = charged(signs, method, 1e-9, grain_contact="off")
            for gap in GAPS:
                push = first_push(sim, gap)
                wanted = signs[0] * signs[1] * law(gap) * sim.step_size
                error = max(error, abs(push[1, 0] - wanted) / (law(0.0) * sim.step_size))
                net = max(net, float(np.abs(push.sum(axis=0)).max()) / (law(0.0) * sim.step_size))
        yield at_most(f"{name}: error of the force, gaps from 0.01 d to -d", error, 1e-6, "of that at contact")
        yield equal(f"{name}: net momentum of a pair", net, 0.0, "", "equal and opposite to the last bit")

    sim = charged((1.0, -1.0), 0.0)
    sim.position[1, 0] = 3.0 * D
    speed = 0.0
    for _ in range(2000 if size == "full" else 600):
        watch.step(sim)
        speed = max(speed, float(np.abs(sim.velocity).max()))
    fall = math.sqrt(2.0 * COULOMB * CHARGE**2 * (1.0 / D - 1.0 / (3.0 * D)) / float(sim.mass[0]) * 0.5)
    hold = float(abs(sim.contacts["impulse"][0, 0])) / sim.step_size if len(sim.contacts) else math.nan
    yield within("unlike pair: speed at which it meets, over energy's", speed / fall, 0.97, 1.001, "", "a step before")
    yield at_most("unlike pair at rest: its contact bears the pull, error", relative(hold, law(0.0)), 1e-3)
    yield at_most("unlike pair at rest: off touch by", abs(float(np.diff(sim.position[:, 0])[0]) / D - 1.0), 1e-4, "d")
    yield at_most("unlike pair: momentum", float(np.abs((sim.mass[:, None] * sim.velocity).sum(axis=0)).max()), 1e-20)

    row = charged((1.0,) * 20, 0.0)
    watch.step(row, 200)
    momentum = float(np.abs((row.mass[:, None] * row.velocity).sum(axis=0)).max())
    share = momentum / float((row.mass[:, None] * np.abs(row.velocity)).sum())
    yield at_most("20 like grains that touch fly apart: net momentum", share, 1e-14, "of the sum")
    yield watch.row()


CASES = (
    Case(
        "19",
        "charged grains that touch",
        "1/r² has no bound where grains overlap, and sums that are not by pairs push the crowd",
        "Coulomb, softened at the sum of the radii; momentum and energy of a pair",
        pairs_at_overlap,
    ),
)
