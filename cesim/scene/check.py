"""What makes a scene impossible (errors), and what is legal but doubtful physics (warnings)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .. import engine
from ..constants import VACUUM_PERMITTIVITY
from ..errors import InputError, engine_errors, number, percent, unknown
from ..fields.base import circle
from .choices import births, coverage
from .composites import grain_materials
from .effects import Decisions, counted_materials, decide, reference_speed
from .electrics import behaves_as, behaviour
from .field import ConductorsField, GridField, TwoCylindersField, electrode_paths, ion_source
from .ions import charging_field, has_ions
from .mesh import flaws
from .scales import rolling_speed
from .surfaces import GROUPS, surfaces

if TYPE_CHECKING:
    from .scene import Scene

BREAKDOWN_FIELD = 3e6  # V/m, of air between smooth electrodes
BREAKDOWN_CHARGE = 26.6e-6  # C/m2, on the surface of a grain in air
USUAL_DIAMETER = 1e-3  # m, assumed where nothing is fed
UNLIKELY_SIZES = (1e-6, 20e-3)  # m, beyond which a unit was probably mistaken
LONGEST_STRIDE = 30.0  # diameters a step, as far as the contact tests go
FARTHEST_ARC = math.radians(60.0)  # from the electrode: there level 0 is wrong by a factor (docs/physics.md 1.1)
FAST_SPIN = 300.0  # rad/s, from which the lift on a sphere lighter than LIGHT counts
LIGHT = 2000.0  # kg/m3
SAMPLE = 2000  # grains of the feed that the rules look at


@dataclass(frozen=True)
class Warning:
    """Something doubtful: a short name for the kind, and a sentence."""

    name: str
    text: str

    def __str__(self) -> str:
        return f"{self.name}: {self.text}"


class Warnings(list[Warning]):
    """The warnings of a check. Prints one a line."""

    def __str__(self) -> str:
        return "\n".join(map(str, self)) or "no warnings"

    __repr__ = __str__


# ---- errors --------------------------------------------------------------------------------------------------------


def refuse_contradictions(scene: Scene) -> None:
    """Raises InputError where parts that are legal by themselves cannot stand together."""
    for rule in (_electrodes_clear, _boxes_clear_drum, _everything_is_inside_bounds, _names_are_known):
        rule(scene)


def _electrodes_clear(scene: Scene) -> None:
    """Each electrode stands clear of the drum and of the others."""
    placed = electrode_paths(scene)
    if placed and scene.drum is None:
        raise InputError("is missing: an electrode needs a grounded drum", path="drum")
    for i, (path, electrode) in enumerate(placed):
        assert scene.drum is not None
        least = scene.drum.radius + electrode.radius
        if electrode.distance <= least:
            raise InputError(
                f"is {number(electrode.distance)} m, the electrode touches the drum; it must be above "
                f"drum.radius + {path}.radius = {number(least)} m",
                path=f"{path}.distance",
                value=electrode.distance,
                unit="m",
                allowed=f"above {number(least)} m",
            )
        for other_path, other in placed[:i]:
            apart = math.dist(electrode.center(), other.center()) - electrode.radius - other.radius
            if apart <= 0.0:
                raise InputError(f"touches {other_path}: they overlap by {number(-apart)} m", path=path, unit="m")


def _boxes_clear_drum(scene: Scene) -> None:
    if scene.drum is None:
        return
    for body in surfaces(scene):
        if body.row["shape"] == "box" and body.distance_from_drum_axis() < scene.drum.radius:
            raise InputError(
                f"cuts into the drum: it comes within {number(body.distance_from_drum_axis())} m of the axis, "
                f"the drum's radius is {number(scene.drum.radius)} m",
                path=body.row["name"],
                unit="m",
            )


def _everything_is_inside_bounds(scene: Scene) -> None:
    lower, upper = scene.bounds.lower, scene.bounds.upper
    points = [(f"splitters[{i}].tip", (*splitter.tip, 0.0)) for i, splitter in enumerate(scene.splitters)]
    points += [(f"plates[{i}].end", (*plate.end, 0.0)) for i, plate in enumerate(scene.plates)]
    if scene.feed is not None:
        points += [("feed.outlet", corner) for corner in _outlet_points(scene, 2).tolist()]
    if scene.collect is not None:
        points.append(("collect.y", (0.5 * (lower[0] + upper[0]), scene.collect.y, 0.5 * (lower[2] + upper[2]))))
    for path, point in points:
        for axis, low, value, high in zip("xyz", lower, point, upper, strict=True):
            if not low <= value <= high:
                allowed = f"[{number(low)}, {number(high)}] m"
                raise InputError(
                    f"lies at {axis} = {number(value)} m, outside the bounds {allowed}",
                    path=path,
                    value=value,
                    unit="m",
                    allowed=allowed,
                )


def _names_are_known(scene: Scene) -> None:
    counted_materials(scene)
    partners = {*scene.materials, *GROUPS}
    for name, material in scene.materials.items():
        for partner in material.pairs:
            if partner not in partners:
                raise unknown("partner", partner, partners).at("materials", name, "pairs")


# ---- warnings ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Situation:
    """What the rules look at."""

    scene: Scene
    decisions: Decisions
    births: NDArray[np.void]  # the first grains of the feed, empty without one
    redundant_rows: int = 0  # of the joints

    @property
    def least_diameter(self) -> float:
        return float(self.births["diameter"].min()) if len(self.births) else USUAL_DIAMETER

    @property
    def gravity(self) -> float:
        return math.hypot(*self.scene.gravity)


def check(scene: Scene, definition: dict[str, Any]) -> Warnings:
    """Lets the engine check the definition of a validated scene, then applies the rules."""
    with engine_errors():
        redundant_rows = int(engine.Scene(definition).health["redundant_rows"])
        fed = births(scene, SAMPLE)
    situation = Situation(scene, decide(scene, unfed_radius=0.5 * USUAL_DIAMETER), fed, redundant_rows)
    return Warnings(Warning(name, text) for name, rule in RULES for text in rule(situation))


def _breakdown(situation: Situation) -> Iterator[str]:
    scene = situation.scene
    for path, field in _conductor_fields(scene):
        if field > BREAKDOWN_FIELD:
            yield f"the field on {path} is {number(field)} V/m; air breaks down at about {number(BREAKDOWN_FIELD)} V/m"
    if scene.corona is not None:
        field = charging_field(scene)
        for name, (material, _) in counted_materials(scene).items():
            if behaves_as(behaviour(scene, material), "insulator") and material.permittivity is not None:
                k = material.permittivity / (material.permittivity + 2.0)
                charge = 3.0 * VACUUM_PERMITTIVITY * field * k
                if charge > BREAKDOWN_CHARGE:
                    yield (
                        f"{name} would carry {number(charge * 1e6)} uC/m2 after the corona; air holds no more than "
                        f"{number(BREAKDOWN_CHARGE * 1e6)} uC/m2, to which it is limited"
                    )


def _conductor_fields(scene: Scene) -> Iterator[tuple[str, float]]:
    """Largest field in V/m on each conductor but the corona wires, which are there to break it down.

    A grid rounds a conductor off, so there its largest field stands for all but the drum.
    """
    if scene.field.lacks(scene):
        return
    field = scene.electric_field()
    if isinstance(scene.field, GridField):
        yield "a node of the grid", field.largest()
    else:
        for path, electrode in electrode_paths(scene):
            if electrode.kind != "corona":
                yield f"the {path}", field.largest_on_circle(electrode.radius, electrode.center())[0]
    if scene.drum is not None:
        yield "the drum", field.largest_on_circle(scene.drum.radius)[0]


def _field(situation: Situation) -> Iterator[str]:
    """Where the model of the field is not good."""
    scene = situation.scene
    source, drum = ion_source(scene), scene.drum
    if scene.field.lacks(scene) or drum is None:
        return
    if isinstance(scene.field, TwoCylindersField) and scene.corona is not None and scene.corona.field is None:
        if has_ions(scene):
            return
        assert source is not None
        facing = 0.5 * math.pi - source.angle
        beyond = max(abs(angle - facing) for angle in scene.corona.arc)
        if beyond > FARTHEST_ARC:
            yield (
                f"the corona's arc reaches {number(math.degrees(beyond))} degrees from the electrode; beyond "
                f"{number(math.degrees(FARTHEST_ARC))} the two cylinders give about twice the field of a machine in a "
                "grounded box"
            )
    box = scene.field.enclosure if isinstance(scene.field, ConductorsField) else None
    if box is not None and scene.collect is not None and scene.collect.y < box.lower[1]:
        yield "the landing plane lies beyond field.enclosure: under its floor grains fly without a field"
    if isinstance(scene.field, GridField):
        ring = circle(drum.radius, np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False))
        outside = scene.field.build(scene).outside(ring).mean()
        if outside > 0.0:
            share = f"{100.0 * outside:.0f} %"
            yield f"{share} of the drum's surface lie beyond the grid, where the potential is that of its border"


def _onset(situation: Situation) -> Iterator[str]:
    """Wires that do not burn, tubes that do; a grid shows no wire."""
    from ..corona import PEEK_DENSITY, onset

    scene = situation.scene
    if scene.field.lacks(scene) or isinstance(scene.field, GridField):
        return
    field = scene.electric_field()
    density = max(scene.air.density, 1e-3 * PEEK_DENSITY) / PEEK_DENSITY
    for path, electrode in electrode_paths(scene):
        wire = electrode.kind == "corona"
        limit = onset(electrode.radius, scene.corona.roughness if wire and scene.corona is not None else 1.0, density)
        strength = field.largest_on_circle(electrode.radius, electrode.center())[0]
        if wire and strength < limit:
            yield (
                f"{path} is a corona wire, and its {number(strength)} V/m are below the onset of {number(limit)} V/m "
                f"(Peek): it sends no ions; they would begin at {number(abs(electrode.voltage) * limit / strength)} V"
                if strength > 0.0
                else f"{path} is a corona wire without a field: it sends no ions"
            )
        elif not wire and strength > limit:
            yield (
                f"{path} is static, and its {number(strength)} V/m are above the onset of its corona, {number(limit)} "
                "V/m (Peek): it sends ions, too"
            )


def _step(situation: Situation) -> Iterator[str]:
    decisions, step = situation.decisions, situation.scene.numerics.step
    pull = sum(row.size for row in decisions if row.on and row.name in ("electric_force", "image_force"))
    acceleration = situation.gravity * (1.0 + pull)
    if acceleration > 0.0 and step > (limit := math.sqrt(0.4 * situation.least_diameter / acceleration)):
        yield (
            f"numerics.step is {number(step)} s; grains of {number(situation.least_diameter * 1e3)} mm that accelerate "
            f"at {number(acceleration)} m/s2 ask for {number(limit)} s or less"
        )


def _tunnelling(situation: Situation) -> Iterator[str]:
    scene = situation.scene
    bottom = scene.collect.y if scene.collect is not None else scene.bounds.lower[1]
    top = max(
        scene.drum.radius if scene.drum is not None else bottom,
        scene.feed.outlet.center[1] if scene.feed is not None else bottom,
    )
    speed = math.sqrt(reference_speed(scene) ** 2 + 2.0 * situation.gravity * max(top - bottom, 0.0))
    stride = speed * scene.numerics.step / situation.least_diameter
    if stride > LONGEST_STRIDE:
        yield (
            f"at numerics.step = {number(scene.numerics.step)} s grains move up to {number(stride)} diameters a step; "
            f"contacts are tested up to {number(LONGEST_STRIDE)}"
        )


def _units(situation: Situation) -> Iterator[str]:
    least, most = UNLIKELY_SIZES
    diameters = situation.births["diameter"]
    for diameter in {float(d) for d in (diameters.min(), diameters.max())} if len(diameters) else set():
        if not least <= diameter <= most:
            yield f"grains of {number(diameter)} m are fed; was a unit mistaken?"


def _outlet(situation: Situation) -> Iterator[str]:
    if situation.scene.feed is None:
        return
    points = _outlet_points(situation.scene, 9)
    for body in surfaces(situation.scene):
        if body.contains(points).any():
            yield f"the feed outlet reaches into {body.row['name']}"


def _crowding(situation: Situation) -> Iterator[str]:
    for name, covered in coverage(situation.scene).items():
        if covered > 1.0:
            yield f"the feed covers {name} {number(covered)} times over; grains will lie on each other"


def _centrifuge(situation: Situation) -> Iterator[str]:
    drum = situation.scene.drum
    if drum is not None and abs(drum.speed) > (limit := math.sqrt(situation.gravity / drum.radius)):
        yield (f"drum.speed is {number(drum.speed)} rad/s; above {number(limit)} rad/s nothing uncharged stays on top")


def _spin(situation: Situation) -> Iterator[str]:
    """Light spheres that roll off the drum fast, and whose lift is left out."""
    scene, row = situation.scene, situation.decisions["magnus"]
    spin = rolling_speed(scene) / (0.5 * situation.least_diameter)
    if (
        not row.on
        and row.size >= row.threshold
        and spin > FAST_SPIN
        and grain_materials(scene)[row.material].density < LIGHT
    ):
        yield (
            f"spheres of {row.material} roll off the drum at up to {number(spin)} rad/s; the lift of the air on them, "
            f"which is off (effects.magnus), is about {percent(row.size)} of their weight"
        )


def _meshes(situation: Situation) -> Iterator[str]:
    for i, mesh in enumerate(situation.scene.meshes):
        yield from (f"meshes[{i}] {flaw}" for flaw in flaws(mesh))


def _redundant(situation: Situation) -> Iterator[str]:
    if situation.redundant_rows:
        yield (
            f"{situation.redundant_rows} rows of the joints hold what others hold already; the motion is determined, "
            "the forces in the joints are one choice of many"
        )


RULES: tuple[tuple[str, Callable[[Situation], Iterator[str]]], ...] = (
    ("breakdown", _breakdown),
    ("field", _field),
    ("onset", _onset),
    ("step", _step),
    ("tunnelling", _tunnelling),
    ("unit", _units),
    ("outlet", _outlet),
    ("crowding", _crowding),
    ("centrifuge", _centrifuge),
    ("spin", _spin),
    ("mesh", _meshes),
    ("redundant", _redundant),
)


def _outlet_points(scene: Scene, n: int) -> NDArray[np.float64]:
    """n x n points of the feed outlet, its corners among them: (n^2, 3) m."""
    if scene.feed is None:
        return np.zeros((0, 3))
    outlet, line = scene.feed.outlet, np.linspace(-0.5, 0.5, n)
    u, v = np.meshgrid(line * outlet.length, line * outlet.width)
    return np.asarray(outlet.center) + np.column_stack([u.ravel(), np.zeros(n * n), v.ravel()])
