"""How a run is doing: the health of its contact problems, and its mass balance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields

from . import engine
from .errors import percent

SOLVERS = ("closed form", *(row["name"] for row in engine.contact_solvers()))  #: all that may appear in a health


@dataclass(frozen=True)
class SolverUse:
    """What one solver did, summed over steps."""

    islands: int  #: contact problems
    contacts: int  #: in them
    iterations: int  #: in sum
    unconverged: int  #: contact problems that ran out of iterations
    residual: float  #: m/s, worst
    seconds: float  #: of work, over all threads; 0 for the closed form, which takes less than a look at the clock


@dataclass(frozen=True)
class Health:
    """How well the contact problems were solved, and where the time went."""

    contacts: int  #: contacts with an impulse in the last step
    iterations: int  #: sweeps of the last step
    residual: float  #: m/s, of the last step
    penetration: float  #: m, deepest in the last step
    kinetic_energy: float  #: J, now
    steps: int  #: so far
    unconverged: int  #: steps so far that ran out of iterations
    worst_residual: float  #: m/s, so far
    worst_penetration: float  #: m, deepest so far
    penetration_ratio: float  #: deepest so far, over the radius of its grain
    contact_rows: int  #: contacts looked at, summed over steps
    active_contacts: int  #: contacts with an impulse, summed over steps
    total_iterations: int  #: sweeps, summed over steps
    islands: int  #: independent contact problems, summed over steps
    redundant_rows: int = 0  #: of joints: what other rows hold already
    joint_drift: float = 0.0  #: m, by how far a joint was apart at the end of a step, worst so far
    pair_error: float = 0.0  #: relative error of the forces between charges, over a sample of all steps so far
    worst_turn: float = 0.0  #: rad, of a grain that is no sphere in one step, largest so far
    limited_charges: int = 0  #: charges that reached what air can hold, 26.6 uC/m2: fed with more, or by ions
    solvers: Mapping[str, SolverUse] = field(default_factory=dict)  #: those that ran, by name
    seconds: Mapping[str, float] = field(default_factory=dict)  #: s of wall time per stage, so far

    @property
    def converged(self) -> bool:
        """Every step so far met its tolerance."""
        return self.unconverged == 0

    @classmethod
    def of(cls, scene: engine.Scene) -> Health:
        """The health of an engine's scene now."""
        now = scene.health
        return cls(
            contacts=int(now["last_contacts"]),
            iterations=int(now["last_iterations"]),
            residual=float(now["last_residual"]),
            penetration=float(now["last_penetration"]),
            kinetic_energy=float(now["kinetic_energy"]),
            steps=int(now["steps"]),
            unconverged=int(now["unconverged"]),
            worst_residual=float(now["residual"]),
            worst_penetration=float(now["penetration"]),
            penetration_ratio=float(now["penetration_ratio"]),
            contact_rows=int(now["contact_rows"]),
            active_contacts=int(now["active_contacts"]),
            total_iterations=int(now["iterations"]),
            islands=int(now["islands"]),
            redundant_rows=int(now["redundant_rows"]),
            joint_drift=float(now["joint_drift"]),
            pair_error=math.sqrt(now["pair_defect"] / now["pair_force"]) if now["pair_force"] else 0.0,
            worst_turn=float(now["turn"]),
            limited_charges=int(now["limited_charges"]),
            solvers={name: SolverUse(**use) for name, use in now["solvers"].items()},
            seconds=dict(scene.stage_seconds),
        )

    def __str__(self) -> str:
        steps = max(self.steps, 1)
        total = sum(self.seconds.values())
        stages = ", ".join(
            f"{name} {1e3 * s / steps:.2g} ms" for name, s in self.seconds.items() if s > 0.02 * max(total, 1e-9)
        )
        deepest = f"{1e6 * self.worst_penetration:.3g} um, {percent(self.penetration_ratio)} of a radius at most"
        lines = [
            f"contacts      {self.active_contacts / steps:.1f} a step, {self.total_iterations / steps:.1f} sweeps",
            f"residual      {self.residual:.2g} m/s now, worst {self.worst_residual:.2g} m/s",
            f"penetration   {deepest}",
            f"solved by     {', '.join(f'{name} {use.islands}' for name, use in self.solvers.items()) or 'nothing'}",
            *([f"turn          {self.worst_turn:.2g} rad a step at most"] if self.worst_turn > 0.0 else []),
            f"converged     {self.steps - self.unconverged} of {self.steps} steps",
            *([f"pair forces   {percent(self.pair_error)} off, on a sample"] if self.pair_error else []),
            f"time a step   {1e3 * total / steps:.3g} ms" + (f": {stages}" if stages else ""),
        ]
        if self.limited_charges:
            lines.append(f"charges       {self.limited_charges} reached what air can hold, 26.6 uC/m2")
        return "\n".join(lines)


@dataclass(frozen=True)
class Amount:
    """Grains and their mass."""

    count: int
    kg: float


@dataclass(frozen=True)
class Balance:
    """Where the feed is. fed = landed + resident + lost, exactly, in count and in mass."""

    fed: Amount
    landed: Amount
    resident: Amount
    lost: Amount
    closed: bool  #: the engine, which adds masses as integers, found no difference

    @classmethod
    def of(cls, scene: engine.Scene) -> Balance:
        """The balance of an engine's scene now."""
        now = scene.balance
        amounts = {
            name: Amount(int(now[f"{name}_count"]), float(now[f"{name}_mass"]))
            for name in ("fed", "landed", "resident", "lost")
        }
        return cls(**amounts, closed=bool(now["closed"]))

    def __str__(self) -> str:
        parts = [
            f"{f.name} {getattr(self, f.name).count} ({1e3 * getattr(self, f.name).kg:.4f} g)" for f in fields(self)[:4]
        ]
        return f"{parts[0]} = {' + '.join(parts[1:])}" + ("" if self.closed else "  NOT CLOSED")
