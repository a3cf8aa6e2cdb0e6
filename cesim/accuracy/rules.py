"""Which settings an accuracy asks for, by rules that need no run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..errors import InputError, number, show
from ..units import to_si

if TYPE_CHECKING:
    from ..scene import Scene

# Of a diameter, that the largest force may bend a path by within a step; as measured (docs/accuracy-machines.md):
# spheres land 1.2 mm off at 2 ms, powder 0.1 mm at 1 ms.
FREE_PATH = 0.4
FIELD_SHARE = 0.25  # of the length over which the field changes, that a grain may fly in a step
# rad a step at omega = 2 v/d, by the kind of shape, as measured (docs/accuracy.md): flakes slide and lie, rods spin
# about their axis several times as fast as that.
LARGEST_TURN = {"flake": 4.0, "rod": 0.5}
USUAL_TURN = 1.0  # of all other shapes
# Of the error of landing, in (v h)^2/d with the drum's speed v, at most, as measured: 0.3 to 0.7 (decision 014).
LEAVING = 1.0
FLIGHT_TIME = 0.3  # s, of the free flight: what a velocity left over by a solver is multiplied by
SOLVER_SHARE = 0.02  # of the error asked for, that may come from the contact solver
COARSEST, FINEST = 4e-3, 1e-5  # s, steps that are ever recommended

#: The error of mean landing x that each preset is made for, in m; and what it was measured to have of ABS on the sphere
#: machine (docs/accuracy.md).
PRESETS = {"draft": 4e-3, "standard": 1.5e-3, "fine": 0.4e-3}
MEASURED = {"draft": 0.83e-3, "standard": 0.36e-3, "fine": 0.08e-3}
Preset = Literal["draft", "standard", "fine"]


@dataclass(frozen=True)
class Rule:
    """One rule and the longest step it allows.

    Attributes
    ----------
    name, formula : str
    step : float
        s; infinite where the scene has nothing the rule is about.
    """

    name: str
    formula: str
    step: float


@dataclass(frozen=True)
class Recommendation:
    """Settings for an accuracy.

    Attributes
    ----------
    tol : float
        m, the error of a mean landing x that was asked for.
    step, tolerance : float
        s and m/s, of ``scene.numerics``.
    contact_law, solver : str
    binding : Rule
        The one that asks for the shortest step.
    rules : tuple of Rule
    """

    tol: float
    step: float
    tolerance: float
    contact_law: str
    solver: str
    binding: Rule
    rules: tuple[Rule, ...]

    def apply(self, scene: Scene) -> Scene:
        """A copy of a scene with these settings."""
        copy = scene.validated()
        for name in ("step", "tolerance", "contact_law", "solver"):
            setattr(copy.numerics, name, getattr(self, name))
        return copy

    def __str__(self) -> str:
        head = (
            f"for {1e3 * self.tol:g} mm of mean landing x: numerics.step = {number(self.step)} s, "
            f"tolerance {number(self.tolerance)} m/s, {self.contact_law}, solver {self.solver}"
        )
        lines = [head]
        for rule in sorted(self.rules, key=lambda rule: rule.step):
            limit = f"{number(rule.step)} s" if math.isfinite(rule.step) else "any"
            lines.append(f"{rule.name:<10} {limit:<14} {rule.formula}{'  <- binds' if rule is self.binding else ''}")
        return "\n".join(lines)


def recommend(scene: Scene, tol: float | str = "1 mm") -> Recommendation:
    """Settings for an accuracy by rules known beforehand, within milliseconds; `accuracy_report` measures instead.

    Parameters
    ----------
    scene : Scene
    tol : text with a unit, or m
        Error of the mean landing x of a material that numerics may make. A recovery changes by about tol times the
        share of the grains that land per length at the splitter.

    Returns
    -------
    Recommendation
        With all rules, and the one that binds.

    Notes
    -----
    path: a force a bends a path by no more than 0.4 of the smallest diameter in a step, h <= sqrt(0.4 d/a). field:
    a grain flies no more than a quarter of the length over which the field changes, h <= L/(4 v). leaving: what a
    grain does before it leaves the drum has an error of up to 0.7 (v h)^2/d of landing, v of the drum, as measured (the
    finest grains, decision 014); h <= sqrt(tol d)/v. rotation: at
    omega = 2 v/d grains that are no spheres turn by a radian a step at most, flakes by 4 and rods by half of one; of
    0.6 mm, beyond it, angular grains land 2 to 3 mm off and rods farther, flakes where they should (docs/accuracy.md).
    The solver's tolerance, over the time of flight, is a fiftieth of tol.
    """
    try:
        wanted = to_si(tol, "m", 1e-7, 1.0)
    except InputError as error:
        raise error.at("tol") from None
    valid = scene.validated()
    rules = tuple(rule(valid, wanted) for rule in RULES)
    binding = min(rules, key=lambda rule: rule.step)
    step = round_down(min(max(binding.step, FINEST), COARSEST))
    tolerance = min(max(SOLVER_SHARE * wanted / FLIGHT_TIME, 1e-9), 1e-2)
    return Recommendation(wanted, step, round_down(tolerance), "coulomb", "auto", binding, rules)


def preset(scene: Scene, name: str) -> Recommendation:
    """The settings of `accuracy="draft" | "standard" | "fine"` for a scene."""
    if name not in PRESETS:
        raise InputError(
            f"is {show(name)}, must be {', '.join(map(repr, PRESETS))} or None", path="accuracy", value=name
        )
    return recommend(scene, PRESETS[name])


def round_down(value: float) -> float:
    """The next lower number of the series 1, 1.25, 1.6, 2, 2.5, 3.2, 4, 5, 6.3, 8 with a power of ten."""
    series = np.array([1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0, 5.0, 6.3, 8.0])
    power = 10.0 ** math.floor(math.log10(value) + 1e-9)
    return float(f"{series[series <= value / power * (1.0 + 1e-9)][-1] * power:.6g}")


# ---- the rules -------------------------------------------------------------------------------------------------------


def smallest(scene: Scene) -> float:
    """Smallest diameter in m that is fed; 1 mm where nothing is."""
    if scene.feed is None:
        return 1e-3
    return min(family.size.smallest() for family in scene.feed.all_families())


def _path(scene: Scene, tol: float) -> Rule:
    from ..scene.effects import decide

    pull = sum(row.size for row in decide(scene) if row.on and row.name in ("electric_force", "image_force"))
    acceleration = math.hypot(*scene.gravity) * (1.0 + pull)
    formula = f"sqrt({FREE_PATH:g} d/a), d = {number(1e3 * smallest(scene))} mm, a = {number(acceleration)} m/s2"
    return Rule("path", formula, math.sqrt(FREE_PATH * smallest(scene) / acceleration) if acceleration else math.inf)


def _field(scene: Scene, tol: float) -> Rule:
    from ..scene.effects import flight_speed
    from ..scene.field import all_electrodes

    live = [electrode for electrode in all_electrodes(scene) if electrode.voltage != 0.0]
    if scene.drum is None or not live or scene.field.lacks(scene):
        return Rule("field", "no field", math.inf)
    # Along the line to each electrode, on the drum's side, where grains fly.
    field, radius = scene.electric_field(), scene.drum.radius
    lengths = []
    for electrode in live:
        gap = electrode.distance - electrode.radius - radius
        r = radius + np.linspace(0.0, 0.5, 51) * gap
        points = np.column_stack([r * math.cos(electrode.angle), r * math.sin(electrode.angle), 0.0 * r])
        strength = np.linalg.norm(field(points), axis=1)
        lengths.append((strength[1:] / np.maximum(np.abs(np.diff(strength)) / np.diff(r), 1e-300)).min())
    length = float(min(lengths))
    speed = flight_speed(scene)
    return Rule(
        "field",
        f"L/(4 v), L = {number(1e3 * length)} mm, v = {number(speed)} m/s",
        FIELD_SHARE * length / speed,
    )


def _leaving(scene: Scene, tol: float) -> Rule:
    speed = abs(scene.drum.speed) * scene.drum.radius if scene.drum is not None else 0.0
    if speed == 0.0:
        return Rule("leaving", "no drum that turns", math.inf)
    d = smallest(scene)
    formula = f"sqrt(tol d)/v, d = {number(1e3 * d)} mm, v = {number(speed)} m/s on the drum"
    return Rule("leaving", formula, math.sqrt(tol * d / LEAVING) / speed)


def _rotation(scene: Scene, tol: float) -> Rule:
    from ..scene.effects import reference_speed

    families = [] if scene.feed is None else scene.feed.all_families()
    speed = max(reference_speed(scene), 0.1)
    limits = [
        (turn * family.size.smallest() / (2.0 * speed), turn, family.shape.kind)
        for family in families
        if family.shape.kind != "sphere"
        for turn in [LARGEST_TURN.get(family.shape.kind, USUAL_TURN)]
    ]
    if not limits:
        return Rule("rotation", "spheres look the same however they turn", math.inf)
    step, turn, kind = min(limits)
    return Rule("rotation", f"{turn:g} rad/omega ({kind}), omega = 2 v/d = {number(turn / step)} rad/s", step)


RULES: tuple[Callable[[Scene, float], Rule], ...] = (_path, _field, _leaving, _rotation)


def limit(scene: Scene) -> Rule:
    """The longest step that the finest grain of a scene allows, whatever accuracy is asked for."""
    return _path(scene, math.inf)


__all__: list[Any] = ["MEASURED", "PRESETS", "Preset", "Recommendation", "Rule", "limit", "preset", "recommend"]
