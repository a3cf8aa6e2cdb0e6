"""The same scene with one decision the other way round."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from ..scene.effects import Decision, EffectSetting, impossible

if TYPE_CHECKING:
    from ..scene import Scene


STRENGTH = "strength"  # the parameter of an effect that multiplies its law


def toggled(scene: Scene, row: Decision, amplified: float = 1.0) -> Scene | None:
    """A copy of the scene in which this decision is the other one; None where there is no other.

    Whatever else the scene decides it decides again, so what goes with an effect goes with it. What comes on comes on
    so many times as strong.
    """
    other = scene.model_copy(deep=True)
    if row.kind == "choice":
        turn = CHOICES.get(row.name)
        return other if turn is not None and turn(other, row.on) else None
    if not row.on and impossible(scene, row.name):
        return None
    parameters = dict(scene.effects[row.name].parameters) if row.name in scene.effects else {}
    if amplified != 1.0 and not row.on:
        parameters[STRENGTH] = amplified * parameters.get(STRENGTH, 1.0)
    other.effects[row.name] = EffectSetting(state="off" if row.on else "on", parameters=parameters)
    return other


def can_act(row: Decision) -> bool:
    """Whether switching this decision over can change anything: what is off with the size 0 has nothing to act on."""
    return row.on or row.size > 0.0


def _numerics(name: str) -> Callable[[Scene, bool], bool]:
    def turn(scene: Scene, on: bool) -> bool:
        setattr(scene.numerics, name, "off" if on else "on")
        return True

    return turn


def _drag_law(scene: Scene, on: bool) -> bool:
    scene.air.law = "stokes" if on else "schiller_naumann"
    return True


def _charging_kinetics(scene: Scene, on: bool) -> bool:
    if scene.corona is None or scene.corona.model != "arc" or scene.corona.current_density is None:
        return False  # in time, but with which current? and what follows from the wires has one
    scene.corona.kinetics = "off" if on else "on"
    return True


CHOICES: Mapping[str, Callable[[Scene, bool], bool]] = {
    "grain_contact": _numerics("grain_contact"),
    "rotation": _numerics("rotation"),
    "gyroscopic": _numerics("gyroscopic"),
    "drag_law": _drag_law,
    "charging_kinetics": _charging_kinetics,
}
