"""What a material does with charge in a scene: conductor, insulator, or between, by one law of relaxation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ..materials import Material

if TYPE_CHECKING:
    from .scene import Scene

# Beyond these a landing moves by less than 1 mm if nothing is followed any more (docs/physics.md 2.2).
INSULATES, CONDUCTS = 0.005, 2000.0  # of time on the drum over decay time: below and above
OUTRUNS = 1000.0  # of charging time squared over decay time and time on the drum: above, ions leave no charge
INSTANT = 2e-4  # of charging time over time in the arc: below, charging is at once
USUAL_RESIDENCE = 1.0  # s, where the drum stands; about that of the reference machine
TURN = 1.5 * math.pi  # rad, from the top to the brush of a machine that has none


def residence(scene: Scene) -> float | None:
    """Time in s that a grain which sticks spends on the drum, from its top to the brush; None where the drum stands."""
    if scene.drum is None or scene.drum.speed == 0.0:
        return None
    turn = TURN
    if scene.brush is not None:
        x, y = scene.brush.center
        turn = math.atan2(math.copysign(x, x * scene.drum.speed), y) % (2.0 * math.pi)
    return turn / abs(scene.drum.speed)


def kind_of(scene: Scene, material: Material) -> str:
    """ "conductor", "insulator" or "middling", as the scene takes it.

    A material without a decay time is what its kind says. With one the ratio of the time on the drum to it decides, or
    the setting of the effect "charge_decay": "on" follows every decay, "off" none. What conducts must do so before the
    ions of a corona: those that stay on it, and those that it collects in flight.
    """
    tau = material.relaxation_time
    if tau is None:
        return str(material.kind)
    setting = scene.effect_settings.get("charge_decay")
    state = setting.state if setting is not None else "auto"
    time = residence(scene)
    if state == "on" or (state == "auto" and time is None):
        return "middling"
    ratio = (time or USUAL_RESIDENCE) / tau
    if state == "off":
        kind = material.kind if material.kind != "middling" else "conductor" if ratio > 1.0 else "insulator"
        return str(kind)
    if ratio < INSULATES:
        return "insulator"
    return "conductor" if ratio > CONDUCTS and _outruns_ions(scene, tau, ratio) else "middling"


def _outruns_ions(scene: Scene, tau: float, ratio: float) -> bool:
    """Whether ions leave nothing on what decays in tau, `ratio` times shorter than the time on the drum.

    On the drum they leave the share tau/ion_time of their charge, and as much of their current flows in flight.
    """
    from .ions import least_ion_time

    ions = least_ion_time(scene)
    return ions is None or (ions / tau) ** 2 > OUTRUNS * ratio


def behaviour(scene: Scene, material: Material) -> dict[str, Any]:
    """What the engine takes of a material: its kind as the scene takes it, and the numbers behind it.

    `conducting` is the share of a conductor's polarisation near the drum that a middling has, 1 - exp(-t/tau) with its
    time on the drum.
    """
    kind, tau = kind_of(scene, material), material.relaxation_time
    middling = kind == "middling" and tau is not None
    share = material.conductor_share if kind != "conductor" else 0.0
    return {
        "kind": kind,
        "density": material.density,
        "permittivity": material.permittivity or 1.0,
        "decay_time": tau if middling else 0.0,
        "conducting": -math.expm1(-(residence(scene) or USUAL_RESIDENCE) / tau) if middling and tau else 0.0,
        "conductor_share": share,
    }


def faces(behaves: dict[str, Any]) -> list[dict[str, Any]]:
    """The pure materials that a behaviour is averaged over: itself, or its conducting share and its rest."""
    pure = {**behaves, "conductor_share": 0.0}
    if behaves["conductor_share"] == 0.0:
        return [pure]
    return [{**pure, "kind": "conductor", "decay_time": 0.0, "conducting": 0.0}, pure]


def behaves_as(behaves: dict[str, Any], kind: str) -> bool:
    """Whether an effect on materials of this kind acts on it. A middling has a bit of either side."""
    return any(face["kind"] in (kind, "middling") for face in faces(behaves))


def decay_reasons(scene: Scene, materials: Mapping[str, tuple[Material, float]]) -> Iterator[str]:
    """Why each material with a decay time is taken for what it is taken for."""
    time = residence(scene)
    for name, (material, _) in materials.items():
        if (tau := material.relaxation_time) is not None:
            ratio = "the drum stands" if time is None else f"t_drum/tau {time / tau:.3g}"
            yield f"{name}: tau {tau:.3g} s, {ratio}, {kind_of(scene, material)}"


def decays(scene: Scene) -> bool:
    """Whether some material of the scene is followed while its charge decays."""
    return any(kind_of(scene, material) == "middling" for material in scene.materials.values())


def follows_charging(scene: Scene, auto: bool = False) -> bool:
    """Whether charging takes its time: as the corona says, else unless that is next to nothing of the time in the arc.

    Where a charge decays at the same time, the two rates decide together, so neither is taken for infinite. auto: what
    would be if the corona said nothing.
    """
    from .ions import time_to_charge

    found = time_to_charge(scene)
    if found is None or scene.corona is None or scene.drum is None:
        return False
    if not auto and scene.corona.kinetics != "auto":
        return scene.corona.kinetics == "on"
    return scene.drum.speed == 0.0 or found[0] >= INSTANT * found[1] or decays(scene)
