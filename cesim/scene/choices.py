"""Decisions about the model that are no effects of their own: who meets whom, what turns, which law.

A choice is a row of the table of `scene.effects()`, after the effects. It is taken once, when a run begins, from a
number of the scene; `grain_contact`, `rotation` and `gyroscopic` are set in ``scene.numerics``, the others elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator

from .. import engine
from ..errors import number, percent
from .electrics import INSTANT, behaviour, decays, follows_charging
from .field import GridField, all_electrodes
from .machine import Belt

if TYPE_CHECKING:
    from .scene import Scene

COVERAGE = 0.01  # of the barest surface, below which grains hardly ever meet
STOKES = 0.05  # relative error of Stokes' drag that nobody would notice
BEYOND = 0.05  # of the feed's width that may fly where the drum's ends weaken the field
SAMPLE = 400  # grains of the feed that the coverage is taken from

State = Literal["auto", "on", "off"]


def _read_state(given: Any) -> Any:
    """True and False, as older files have them, are "on" and "off"."""
    return {True: "on", False: "off"}[given] if isinstance(given, bool) else given


Choosable = Annotated[State, BeforeValidator(_read_state)]


@dataclass(frozen=True)
class Finding:
    """What a scene says about a choice.

    Attributes
    ----------
    setting : "auto", or what the scene sets
    auto : bool
        What is chosen where nothing is set.
    size : float
        The number behind it; NaN where there is none.
    why : str
    """

    setting: str
    auto: bool
    size: float
    why: str

    @property
    def on(self) -> bool:
        """The choice."""
        return self.auto if self.setting == "auto" else self.setting == "on"


@dataclass(frozen=True)
class Choice:
    """A row of the table of choices."""

    name: str
    doc: str
    threshold: float
    find: Callable[[Scene, Mapping[str, float]], Finding | None]  # of a scene and its smallest radii; None: no matter


# ---- grain on grain --------------------------------------------------------------------------------------------------


def births(scene: Scene, count: int = SAMPLE) -> NDArray[np.void]:
    """The first grains of a scene's feed, as `cesim.engine.feed_stream` gives them; empty without a feed."""
    feed = scene.feed
    if feed is None or not float(feed.rate) > 0.0:
        return np.zeros(0, [("diameter", "f8"), ("material", "i4"), ("time", "f8")])
    from .composites import grain_materials
    from .definition import feed_of, grain_shapes

    shapes, materials = grain_shapes(scene), grain_materials(scene)
    return engine.feed_stream(
        feed_of(feed, list(materials), shapes),
        [behaviour(scene, material) for material in materials.values()],
        scene.gravity,
        1,
        count,
        [shape.definition(list(materials)) for shape in shapes],
    )


def grain_rate(scene: Scene) -> float:
    """Grains a second that the feed gives."""
    feed, fed = scene.feed, births(scene)
    if feed is None or not len(fed):
        return 0.0
    if feed.rate.kind == "count":
        return float(feed.rate)
    from .composites import grain_materials

    density = np.array([material.density for material in grain_materials(scene).values()])[fed["material"]]
    return float(feed.rate) / float(np.mean(density * math.pi / 6.0 * fed["diameter"] ** 3))


def coverage(scene: Scene) -> dict[str, float]:
    """Share of each conveying surface that the feed would cover if every grain went with it, side by side.

    A grain of diameter d covers (pi/4) d^2, so a mass flow per width m' of one size covers
    m' / ((2/3) rho d v) of a surface that moves at v (docs/physics.md 4).

    Returns
    -------
    dict
        Name of the surface (drum, belts) -> coverage; empty without a feed.
    """
    feed, fed = scene.feed, births(scene)
    if feed is None or not len(fed):
        return {}
    per_second = grain_rate(scene) * 0.25 * math.pi * float(np.mean(fed["diameter"] ** 2))  # m2/s
    speeds = {f"plates[{i}]": p.motion.speed for i, p in enumerate(scene.plates) if isinstance(p.motion, Belt)}
    if scene.drum is not None:
        speeds["drum"] = scene.drum.speed * scene.drum.radius
    return {name: per_second / max(abs(v) * feed.outlet.width, 1e-12) for name, v in speeds.items()}


def _where_grains_pile_up(scene: Scene) -> str:
    """A part on which grains may gather whatever the feed rate is, or ""."""
    for i, plate in enumerate(scene.plates):
        if not isinstance(plate.motion, Belt):
            return f"plates[{i}]"
    return "meshes[0]" if scene.meshes else "" if scene.drum is not None else "what they land on"


def _grain_contact(scene: Scene, radii: Mapping[str, float]) -> Finding:
    covered, setting = coverage(scene), scene.numerics.grain_contact
    if not covered:
        return Finding(setting, True, math.nan, "grains are added by hand, who knows how many")
    densest = max(covered, key=lambda name: covered[name])
    size = covered[densest]
    why = f"the feed covers {percent(size)} of {densest}"
    if pile := _where_grains_pile_up(scene):
        return Finding(setting, True, size, f"{why}, and grains may gather on {pile}")
    if size < COVERAGE:
        return Finding(setting, False, size, f"{why}: grains hardly meet, each flies as if alone")
    return Finding(setting, True, size, why)


# ---- turning ---------------------------------------------------------------------------------------------------------


def _rotation(scene: Scene, radii: Mapping[str, float]) -> Finding:
    from .definition import COEFFICIENTS, grain_matrix, grain_shapes, surface_matrix
    from .surfaces import surfaces

    setting = scene.numerics.rotation
    if len(grain_shapes(scene)) > 1:
        return Finding(setting, True, 1.0, "grains are no spheres: they turn by being pushed off their centres")
    turning = [name for name in COEFFICIENTS if name != "restitution"]
    bodies = surfaces(scene)
    largest = max(
        float(matrix.max(initial=0.0))
        for name in turning
        for matrix in (grain_matrix(scene, name), surface_matrix(scene, bodies, name))
    )
    why = f"spheres; the largest coefficient of friction is {number(largest)}"
    return Finding(setting, largest > 0.0, largest, why if largest > 0.0 else "nothing turns a sphere without friction")


def _gyroscopic(scene: Scene, radii: Mapping[str, float]) -> Finding:
    from .definition import grain_shapes

    unlike = max(float(1.0 - shape.moments.min() / shape.moments.max()) for shape in grain_shapes(scene))
    why = f"moments of inertia differ by up to {percent(unlike)}" if unlike > 0.0 else "spheres have none"
    return Finding(scene.numerics.gyroscopic, unlike > 0.0, unlike, why)


# ---- laws ------------------------------------------------------------------------------------------------------------


def _drag_law(scene: Scene, radii: Mapping[str, float]) -> Finding | None:
    from .effects import flight_speed

    if scene.air.density == 0.0 or not radii:
        return None
    speed = flight_speed(scene)
    reynolds = scene.air.density * speed * 2.0 * min(radii.values()) / scene.air.viscosity
    excess = 0.15 * reynolds**0.687
    law = scene.air.law
    why = f"Re = {reynolds:.3g} of the smallest grain at {speed:.2g} m/s: drag is {percent(excess)} above Stokes'"
    if law == "stokes":
        return Finding("off", True, excess, f"air.law is 'stokes'; {why}")
    return Finding("auto", True, excess, f"{law}; {why}")


def _charging_kinetics(scene: Scene, radii: Mapping[str, float]) -> Finding | None:
    from .ions import has_ions, time_to_charge

    if scene.corona is None or scene.drum is None or scene.field.lacks(scene):
        return None
    found = time_to_charge(scene)
    if found is None:
        why = "the corona has no current density: it charges at once"
        why += f", what decays in {INSTANT:g} of the time in the arc" if decays(scene) else ""
        return Finding("auto", False, math.nan, why)
    (time, way), setting = found, "on" if has_ions(scene) else scene.corona.kinetics
    size = time / way
    why = f"time constant {1e3 * time:.2g} ms over {1e3 * way:.3g} ms in the arc"
    why += "; a charge decays at the same time" if decays(scene) else ""
    return Finding(setting, follows_charging(scene, auto=True), size, why)


def _field_ends(scene: Scene, radii: Mapping[str, float]) -> Finding | None:
    live = [electrode for electrode in all_electrodes(scene) if electrode.voltage != 0.0]
    if scene.drum is None or not live or scene.feed is None:
        return None
    if isinstance(scene.field, GridField) and scene.field.values.values.shape[2] > 1:
        return Finding("on", True, math.nan, "the grid of the field has three dimensions")
    gap = min(electrode.distance - electrode.radius for electrode in live) - scene.drum.radius
    good, half = 0.5 * scene.drum.length - gap, 0.5 * scene.feed.outlet.width
    beyond = min(max(1.0 - good / half, 0.0), 1.0) if half > 0.0 else 0.0
    why = f"{percent(beyond)} of the feed's width is nearer to the drum's ends than the gap of {1e3 * gap:.3g} mm"
    return Finding("auto", False, beyond, f"the field is that of endless cylinders; {why}")


CHOICES: tuple[Choice, ...] = (
    Choice("grain_contact", "grains collide with each other; off: single particles", COVERAGE, _grain_contact),
    Choice("rotation", "grains turn", 0.0, _rotation),
    Choice("gyroscopic", "free grains keep their angular momentum, not just their angular velocity", 0.0, _gyroscopic),
    Choice("drag_law", "drag beyond Stokes' law", STOKES, _drag_law),
    Choice("charging_kinetics", "the corona charges in time, not at once", INSTANT, _charging_kinetics),
    Choice("field_ends", "the field's weakening at the drum's ends", BEYOND, _field_ends),
)
