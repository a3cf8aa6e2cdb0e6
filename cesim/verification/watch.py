"""What must hold in every case and every step: the stepping of the cases goes through here.

Finite numbers, quaternions of norm 1, grains counted, residuals told, the balance of momentum and of angular momentum
(what the contacts report is what the grains got), and contacts that do no work.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .rows import Row

if TYPE_CHECKING:
    from ..simulation import Simulation

Array = NDArray[np.float64]

#: Bounds of the common invariants.
NORM, MOMENTUM, WORK = 1e-12, 1e-12, 1e-10


@dataclass
class State:
    """A copy of what moves."""

    ids: NDArray[np.int64]
    velocity: Array
    spin: Array
    on_cylinder: NDArray[np.bool_]

    @classmethod
    def of(cls, sim: Simulation) -> State:
        """The state now."""
        return cls(sim.ids.copy(), sim.velocity.copy(), sim.angular_velocity.copy(), on_cylinders(sim))


class Watch:
    """Steps simulations and keeps the worst that it saw.

    Parameters
    ----------
    work : float or None
        Bound on the work of the contacts in a step, over the energy that moves in it. None: not looked at (for e = 1
        and many contacts at a time, where Newton's law of impact itself gives energy).
    momentum : bool
        Whether weight and contacts are all that acts, so that their balance can be drawn from outside.
    """

    def __init__(self, *, work: float | None = WORK, momentum: bool = True) -> None:
        self.work_bound, self.momentum = work, momentum
        self.steps = 0
        self.norm = self.impulse = self.torque = 0.0
        self.work = -np.inf
        self.broken: list[str] = []

    def step(self, sim: Simulation, n: int = 1) -> None:
        """Take n steps; look at each."""
        for _ in range(n):
            before = State.of(sim)
            sim.step()
            self.steps += 1
            if sim.count:
                self._look(sim)
                if self.momentum and np.array_equal(before.ids, sim.ids):
                    self._balance(sim, before)

    def _look(self, sim: Simulation) -> None:
        for name in ("position", "velocity", "angular_velocity", "orientation", "charge"):
            if not np.isfinite(getattr(sim, name)).all():
                self._break(f"{name} is not finite")
        self.norm = max(self.norm, float(np.abs(np.linalg.norm(sim.orientation, axis=1) - 1.0).max()))
        health = sim.health
        if (health.unconverged > 0) != (health.worst_residual > sim.engine.tolerance):
            self._break("a step ran out of sweeps unsaid")
        if not sim.balance.closed:
            self._break("the mass balance is open")

    def _break(self, what: str) -> None:
        if what not in self.broken:
            self.broken.append(what)

    def _balance(self, sim: Simulation, before: State) -> None:
        step, mass = sim.step_size, sim.mass[:, None]
        free = before.velocity + step * np.asarray(sim.definition["gravity"])
        given = mass * (sim.velocity - free)
        a, b, pushes, arms, radius = ends(sim)
        got = np.zeros_like(given)
        np.add.at(got, a, pushes)
        np.add.at(got, b[b >= 0], -pushes[b >= 0])
        flow = mass * (np.abs(free) + np.abs(sim.velocity))
        scale = float(flow.max() + np.abs(pushes).max(initial=0.0)) or 1.0
        # Who leaves a cylinder gets half a step more of its weight (docs/decisions/014).
        half = 0.5 * mass * step * np.asarray(sim.definition["gravity"])
        left = before.on_cylinder & ~got.any(axis=1)
        left &= np.linalg.norm(given - half, axis=1) < np.linalg.norm(given, axis=1)
        given[left] -= half[left]
        self.impulse = max(self.impulse, float(np.abs(given - got).max()) / scale)
        if not turns_by_contacts_alone(sim):
            return
        inertia = 0.4 * mass * radius[:, None] ** 2
        turned = inertia * (sim.angular_velocity - before.spin)
        twist = np.cross(arms, pushes)
        wanted = np.zeros_like(turned)
        np.add.at(wanted, a, radius[a, None] * twist)
        np.add.at(wanted, b[b >= 0], radius[b[b >= 0], None] * twist[b >= 0])
        spinning = inertia * (np.abs(before.spin) + np.abs(sim.angular_velocity))
        whole = float(spinning.max() + (radius[a, None] * np.abs(pushes)).max(initial=0.0)) or 1.0
        self.torque = max(self.torque, float(np.abs(turned - wanted).max()) / whole)
        self._work(sim, before, free, (a, b, pushes, arms, radius))

    def _work(self, sim: Simulation, before: State, free: Array, contacts: tuple[Any, ...]) -> None:
        """Impulse times the mean of the relative velocity before and after it, summed over the step's contacts."""
        a, b, pushes, arms, radius = contacts
        if not len(a):
            return
        velocity, spin = 0.5 * (free + sim.velocity), 0.5 * (before.spin + sim.angular_velocity)
        slip = velocity[a] + np.cross(spin[a], radius[a, None] * arms)
        pair = b >= 0
        slip[pair] -= velocity[b[pair]] - np.cross(spin[b[pair]], radius[b[pair], None] * arms[pair])
        slip[~pair] -= surface_velocity(sim)[~pair]
        mass = sim.mass[:, None]
        energy = float((mass * (free**2 + sim.velocity**2)).sum() + np.abs(pushes * slip).sum())
        self.work = max(self.work, float((pushes * slip).sum()) / (energy or 1.0))

    def row(self) -> Row:
        """The common invariants on one row: the worst of them over its bound."""
        shares = [self.norm / NORM, self.impulse / MOMENTUM, self.torque / MOMENTUM]
        told = f"|q| - 1: {self.norm:.1e}"
        if self.momentum:
            told += f", momentum: {self.impulse:.1e}, angular: {self.torque:.1e}"
        if self.work_bound is not None and np.isfinite(self.work):
            shares.append(self.work / self.work_bound)
            told += f", work of contacts: {self.work:.1e}"
        worst = float("nan") if self.broken else max(*shares, 0.0)
        note = "; ".join([f"{told}; {self.steps} steps", *self.broken])
        return Row("common invariants, worst over its bound", worst, "<=", 1.0, "", note)


def ends(sim: Simulation) -> tuple[Any, ...]:
    """Of the last step's contacts: rows a and b (-1: a surface), impulses on a, arms from a over its radius; radii."""
    contacts = sim.contacts
    a = np.searchsorted(sim.ids, contacts["a"])
    b = np.where(contacts["b"] >= 0, np.searchsorted(sim.ids, np.maximum(contacts["b"], 0)), -1)
    return a, b, contacts["impulse"], -contacts["normal"], 0.5 * sim.diameter


def on_cylinders(sim: Simulation) -> NDArray[np.bool_]:
    """Which grains a cylinder pressed in the last step."""
    cylinders = [-1 - i for i, surface in enumerate(sim.definition["surfaces"]) if surface["shape"] == "cylinder"]
    contacts = sim.contacts
    return np.isin(sim.ids, contacts["a"][np.isin(contacts["b"], cylinders)])


def turns_by_contacts_alone(sim: Simulation) -> bool:
    """Spheres that may turn, without the moments of rolling and spinning friction, which contacts do not report."""
    tree = sim.definition
    names = ("grain_rolling", "surface_rolling", "grain_spinning", "surface_spinning")
    moments = max(float(np.max(tree[name], initial=0.0)) for name in names)
    return moments == 0.0 and bool(tree["rotation"]) and not sim.engine.shape.any()


def surface_velocity(sim: Simulation) -> Array:
    """Velocity (n, 3) m/s of the surfaces' matter at the last step's contacts; zero where b is a grain."""
    contacts = sim.contacts
    velocity = np.zeros((len(contacts), 3))
    for index, surface in enumerate(sim.definition["surfaces"]):
        mine = contacts["b"] == -1 - index
        if mine.any():
            axis = np.array([0.0, 0.0, surface["angular_speed"]])
            moving = np.cross(axis, contacts["point"][mine] - np.asarray(surface["position"]))
            moving += np.asarray(surface["belt_velocity"])
            normal = contacts["normal"][mine]
            velocity[mine] = moving - (moving * normal).sum(axis=1)[:, None] * normal
    return velocity
