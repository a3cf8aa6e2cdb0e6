"""How far each effect moves a landing, from flights of single grains off the drum with the effect and without it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .. import engine
from ..errors import SimulationError
from ..scene.choices import births
from ..scene.composites import composites, grain_materials
from ..scene.definition import definition, grain_shapes
from ..scene.effects import CROWD, UNFED_RADIUS, Decision, Decisions, counted_materials, decide
from ..scene.ions import effect_definition
from .toggle import can_act, toggled

if TYPE_CHECKING:
    from ..scene import Scene

Array = NDArray[np.float64]
GRAINS = 4  # of each material: one for each quarter of its mass
STEP = 1e-3  # s, the least step of these flights; differences need no finer one
LONGEST = 2.0  # s, after which a grain that still rides on the drum counts where it is
CHUNK = 100  # steps between two looks at whether all have landed


@dataclass(frozen=True)
class Grains:
    """The grains that fly: columns of n rows, in the order of materials."""

    material: NDArray[np.int32]  # index into the scene's materials
    diameter: Array  # m
    shape: NDArray[np.int32]
    reach: Array  # m, from the centre to the farthest point


def predict(scene: Scene) -> Decisions:
    """The decisions of a scene with the expected shift of the mean landing point by each effect.

    A few grains of each material fly one by one: from the drum, at its speed, where the feed comes down on it, to the
    landing plane; with each effect, and with this one decision the other way round. The mean over the grains of a
    material of the landing x with the effect, less that without, is the prediction. It knows nothing of other grains,
    plates and splitters; effects between grains, and scenes without a drum or a landing plane, keep the bound
    0.24 m x size (docs/physics.md 0.5).

    Returns
    -------
    Decisions
        With ``shift`` and ``shifts`` in m.
    """
    scene = scene.validated()
    decisions = decide(scene)
    if scene.drum is None or scene.collect is None or not decisions.materials:
        return decisions
    bare = _bare(scene)
    grains = _grains(scene)
    start = _start_angle(scene)
    try:
        here = _landings(_definition(scene, bare), bare, grains, start)
        changes = {
            row.name: _change(scene, bare, row, grains, here, start)
            for row in decisions.rows
            if row.name not in CROWD and row.name != "gravity" and can_act(row)
        }
    except SimulationError:  # a scene that cannot be flown is for the run to complain about
        return decisions
    return decisions.replaced({name: change for name, change in changes.items() if change})


def _change(scene: Scene, bare: Scene, row: Decision, grains: Grains, here: Array, start: float) -> dict[str, Any]:
    other = toggled(scene, row)
    if other is None:
        return {}
    there = _landings(_definition(other, _bare(other)), bare, grains, start)
    moved = (here - there) * (1.0 if row.on else -1.0)
    names = list(grain_materials(scene))
    shifts = {names[m]: float(moved[grains.material == m].mean()) for m in np.unique(grains.material)}
    return {"shift": max(abs(shift) for shift in shifts.values()), "shifts": shifts}


def _bare(scene: Scene) -> Scene:
    """Drum, brush, field and air alone; the feed has been asked what it feeds."""
    assert scene.drum is not None
    nothing: dict[str, Any] = {name: [] for name in ("plates", "splitters", "walls", "meshes", "parts", "joints")}
    drum = scene.drum.model_copy(update={"drive": "prescribed"})
    return scene.model_copy(
        update={**nothing, "drum": drum, "feed": None, "shapes": {**scene.shapes, **composites(scene)}}
    )


def _definition(scene: Scene, bare: Scene) -> dict[str, Any]:
    """What the engine takes: the bare machine with the decisions and the shapes of the whole one."""
    decisions = decide(scene)
    return definition(bare, decisions) | {
        "step": max(scene.numerics.step, STEP),
        "grain_contact": False,
        "effects": [effect_definition(scene, row) for row in decisions if row.on and row.name not in CROWD],
        "shapes": [shape.definition(list(grain_materials(scene))) for shape in grain_shapes(scene)],
    }


def _grains(scene: Scene) -> Grains:
    """The grains in the middle of each quarter of a material's mass; without a feed a small grain of each."""
    names = list(grain_materials(scene))
    if not len(fed := births(scene)):
        counted = counted_materials(scene)
        index = np.array([names.index(name) for name in counted], np.int32)
        radius = np.full(len(index), UNFED_RADIUS)
        return Grains(index, 2.0 * radius, np.zeros(len(index), np.int32), radius)
    rows: list[int] = []
    for material in np.unique(fed["material"]):
        mine = np.flatnonzero(fed["material"] == material)
        mine = mine[np.argsort(fed["diameter"][mine], kind="stable")]
        share = np.cumsum(fed["diameter"][mine] ** 3)
        middles = (np.arange(GRAINS) + 0.5) / GRAINS * share[-1]
        rows += mine[np.searchsorted(share, middles)].tolist()
    material, diameter, shape = (np.ascontiguousarray(fed[name][rows]) for name in ("material", "diameter", "shape"))
    return Grains(material, diameter, shape, np.array([each.reach for each in grain_shapes(scene)])[shape] * diameter)


def _start_angle(scene: Scene) -> float:
    """Where the feed comes down on the drum, in rad from its top, clockwise."""
    assert scene.drum is not None
    ends = [plate.end[0] for plate in scene.plates]
    x = max(ends) if ends else scene.feed.outlet.center[0] if scene.feed is not None else 0.0
    return math.asin(min(max(x / scene.drum.radius, -0.9), 0.9))


def _landings(given: dict[str, Any], scene: Scene, grains: Grains, angle: float) -> Array:
    """x in m at which each grain lands, or where it is after a while."""
    assert scene.drum is not None
    n, speed = len(grains.diameter), scene.drum.speed
    outward = np.array([math.sin(angle), math.cos(angle), 0.0])
    along = np.array([math.cos(angle), -math.sin(angle), 0.0])
    radius = scene.drum.radius + grains.reach
    sim = engine.Scene(given, seed=1, threads=1)
    sim.add(
        radius[:, None] * outward,
        speed * radius[:, None] * along,
        np.tile([0.0, 0.0, -speed], (n, 1)),
        grains.material,
        grains.diameter,
        np.zeros(n),
        np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        grains.shape,
    )
    while sim.count and sim.time < LONGEST:
        sim.step(CHUNK)
    x = np.empty(n)
    x[sim.id] = sim.position[:, 0]
    ends = sim.landings()
    x[ends["id"]] = ends["position"][:, 0]
    return x
