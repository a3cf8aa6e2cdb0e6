"""The knobs that a scene has: what its accuracy can be bought with, each with the settings to try."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..errors import number, unknown

if TYPE_CHECKING:
    from ..scene import Scene

Change = Callable[["Scene"], None]

STEPS = (0.25, 0.5, 2.0, 4.0)  # of the scene's own step; the finest is the reference of the knob
COARSE_GRID = 5e-3  # m, nodes of a grid to try in place of an exact field
LOOSER = 100.0  # and tighter by its root: the tolerances to try, times the scene's own


@dataclass(frozen=True)
class Setting:
    """One thing to try.

    Attributes
    ----------
    knob : str
        "step", "tolerance", "solver", "law", "field", "shape", "effects".
    label : str
        What is set, such as "h = 0.5 ms".
    change : callable
        Does it to a scene.
    finer : bool
        Whether it is the better answer of the two, that the scene's own setting is measured against.
    cost : float
        Expected time over that of the scene's own setting.
    value : float
        Of the number that is turned, NaN where it is none.
    """

    knob: str
    label: str
    change: Change
    finer: bool
    cost: float
    value: float = float("nan")


def _steps(scene: Scene) -> Iterator[Setting]:
    for factor in STEPS:
        step = scene.numerics.step * factor

        def change(scene: Scene, step: float = step) -> None:
            scene.numerics.step = step

        yield Setting("step", f"h = {number(1e3 * step)} ms", change, factor == min(STEPS), 1.0 / factor, step)


def tolerance_of(scene: Scene) -> float:
    """The solver's tolerance in m/s, that of the engine where the scene names none."""
    from ..scene.effects import reference_speed

    if scene.numerics.tolerance is not None:
        return scene.numerics.tolerance
    gravity = math.hypot(*scene.gravity)
    return 1e-3 * max(gravity * scene.numerics.step, 0.01 * reference_speed(scene))


def _tolerances(scene: Scene) -> Iterator[Setting]:
    own = tolerance_of(scene)
    for factor, cost in ((1.0 / LOOSER**0.5, 2.0), (LOOSER, 0.9)):
        tolerance = max(own * factor, 1e-12)

        def change(scene: Scene, tolerance: float = tolerance) -> None:
            scene.numerics.tolerance = tolerance

        yield Setting("tolerance", f"{tolerance:.2g} m/s", change, factor < 1.0, cost, tolerance)


def _solvers(scene: Scene) -> Iterator[Setting]:
    for name in ("pgs", "apgd"):
        if name != scene.numerics.solver:

            def change(scene: Scene, name: str = name) -> None:
                scene.numerics.solver = name  # type: ignore[assignment]

            yield Setting("solver", name, change, False, 1.5)


def _laws(scene: Scene) -> Iterator[Setting]:
    other = "ccp" if scene.numerics.contact_law == "coulomb" else "coulomb"

    def change(scene: Scene) -> None:
        scene.numerics.contact_law = other  # type: ignore[assignment]

    yield Setting("law", other, change, other == "coulomb", 1.0)


def _effects(scene: Scene) -> Iterator[Setting]:
    """Each effect that was left out though it acts, switched on: what the decision costs."""
    for row in scene.effects():
        if row.on or row.setting != "auto" or not row.size > 0.0:
            continue

        def change(scene: Scene, name: str = row.name) -> None:
            scene.effects[name] = "on"

        yield Setting("effects", f"with {row.name}", change, True, 1.1)


def _shapes(scene: Scene) -> Iterator[Setting]:
    """Clusters of twice as many spheres, where the number was given."""
    if not any(_spheres(owner) for owner in _shaped(scene)):
        return

    def change(scene: Scene) -> None:
        for owner in _shaped(scene):
            if _spheres(owner):
                owner.shape = owner.shape.model_copy(update={"spheres": 2 * _spheres(owner)})

    yield Setting("shape", "twice the spheres", change, True, 2.0)


def _shaped(scene: Scene) -> list[Any]:
    """What in a scene's feed has a shape."""
    if scene.feed is None:
        return []
    return list(scene.feed.families) if scene.feed.families is not None else [scene.feed]


def _spheres(owner: Any) -> int:
    """The number of spheres of its shape, 0 where none was asked for."""
    count = getattr(owner.shape, "spheres", None)
    return count if isinstance(count, int) else 0


def _fields(scene: Scene) -> Iterator[Setting]:
    """The exact field from a coarse grid instead: what a grid would cost. Of a grid, half its nodes."""
    from ..fields import Grid
    from ..scene.field import GridField, all_electrodes

    model = scene.field
    if isinstance(model, GridField):
        values = model.values.values
        keep = tuple(slice(None, None, 2 if n > 2 else 1) for n in values.shape)

        def thin(scene: Scene) -> None:
            spacing = tuple(2.0 * d if n > 2 else d for d, n in zip(model.spacing, values.shape, strict=True))
            scene.field = GridField.of(Grid(values[keep], model.origin, spacing))

        yield Setting("field", "every second node", thin, False, 1.0)
    elif not model.lacks(scene) and any(electrode.voltage for electrode in all_electrodes(scene)):

        def sample(scene: Scene) -> None:
            lower, upper = scene.bounds.lower[:2], scene.bounds.upper[:2]
            counts = [math.ceil((high - low) / COARSE_GRID) + 1 for low, high in zip(lower, upper, strict=True)]
            radius = scene.drum.radius if scene.drum is not None else 0.0
            scene.field = GridField.of(Grid.sample(scene.electric_field(), lower, upper, counts, drum_radius=radius))

        yield Setting("field", f"on nodes of {number(1e3 * COARSE_GRID)} mm", sample, False, 1.0)


#: Knob -> the settings to try of a scene, in the order of the split of the error.
KNOBS: dict[str, Callable[[Scene], Iterable[Setting]]] = {
    "step": _steps,
    "tolerance": _tolerances,
    "solver": _solvers,
    "law": _laws,
    "field": _fields,
    "shape": _shapes,
    "effects": _effects,
}


def settings(scene: Scene, vary: Iterable[str] | None) -> list[Setting]:
    """All settings to try, of the knobs asked for.

    Raises
    ------
    InputError
        Where there is no such knob.
    """
    wanted = list(KNOBS) if vary is None else [vary] if isinstance(vary, str) else list(vary)
    for name in wanted:
        if name not in KNOBS:
            raise unknown("knob", name, KNOBS).at("vary")
    return [setting for name in wanted for setting in KNOBS[name](scene)]


def changed(scene: Scene, setting: Setting | None) -> Scene:
    """A copy of a scene with a setting."""
    copy = scene.validated()
    if setting is not None:
        setting.change(copy)
    return copy
