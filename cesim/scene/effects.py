"""Which effects a scene calls for: each decision with its number and its reason."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, MutableMapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from .. import engine
from ..errors import InputError, engine_errors, unknown
from ..materials import Material
from ..units import Doc, Part, to_si
from .choices import CHOICES, Choice, Finding, coverage
from .composites import grain_materials
from .electrics import behaves_as, behaviour, decay_reasons, faces, residence
from .field import largest_field, most_voltage
from .ions import charging_field, corona_parameters
from .joints import Motor
from .scales import least_sphericity, rolling_speed, square_gradient, surface_speed

if TYPE_CHECKING:
    import pandas as pd

    from ..effects import Audit
    from .scene import Scene

THRESHOLD = 0.0035  # of the weight: a quarter of what moves a landing by one splitter step
FLIGHT_SHIFT = 0.24  # m, how far a force of one weight moves a landing at most: half g t^2 of the free flight
UNFED_RADIUS = 5e-5  # m, of the grains that somebody may add to a scene without a feed
SLOWEST_FLIGHT = 0.5  # m/s, no grain falls through a machine more slowly
BRUSH_RATIO = 1.5  # of the surface speeds of brush and drum, where the brush has none of its own
DROP = 0.25  # m, of the fall of a grain where the scene has no drum or no landing plane to measure it by


class EffectSetting(Part):
    """What a scene says about one effect."""

    where: ClassVar[str] = "effects"
    state: Annotated[Literal["auto", "on", "off"], Doc("'auto': on where it matters")] = "auto"
    parameters: Annotated[dict[str, float], Doc("parameters that differ from what the scene implies")] = Field(
        default_factory=dict
    )


@dataclass(frozen=True)
class Needs:
    """What an effect cannot act without."""

    parts: tuple[str, ...] = ()  # of the scene
    kind: str = ""  # of material
    voltage: bool = False
    effect: str = ""


NEEDS: Mapping[str, Needs] = {
    "electric_force": Needs(("field",), voltage=True),
    "sphere_plane": Needs(("drum", "field"), kind="conductor", voltage=True, effect="electric_force"),
    "image_force": Needs(("drum",), kind="insulator"),
    "corona_charging": Needs(("drum", "field", "corona"), kind="insulator", voltage=True),
    "contact_charging": Needs(("drum", "field"), kind="conductor", voltage=True),
    "charge_decay": Needs(("drum", "field"), kind="middling"),
    "brush_discharge": Needs(("brush",)),
    "pair_coulomb": Needs(voltage=True),
    "wind": Needs(("drum",), effect="drag"),
    "magnus": Needs(effect="drag"),
    "shape_drag": Needs(effect="drag"),
    "dielectrophoresis": Needs(("field",), voltage=True),
}
THRESHOLDS = {  # of effects whose laws are good to a factor of two at best: one splitter step
    "wind": 0.014,
    "magnus": 0.014,
    "adhesion": 0.1,  # known to an order of magnitude; plastics below 0.34 mm
}
CROWD = frozenset({"grain_contact", "pair_coulomb"})  # what grains do to each other, which a single one does not feel
DRAG_LAWS = {"schiller_naumann": 0.0, "stokes": 1.0}


@dataclass(frozen=True)
class Decision:
    """One effect: whether it is on, how large it is, and why.

    Attributes
    ----------
    name, doc : str
        The effect.
    setting : str
        What the scene says: "auto", "on" or "off".
    on : bool
        The decision.
    size : float
        Ratio to the weight, of the material it is largest for.
    material : str
        That material.
    threshold : float
        Size from which it is on by itself.
    shift : float
        How far it is expected to move the mean landing of the material it moves most, in m; NaN: not known.
    why : str
        The reason.
    parameters : dict
        Its parameters in SI units; NaN: the engine takes it from the scene.
    kind : str
        "effect", a row of the engine's table, or "choice", a decision about the model (cesim.scene.choices).
    shifts : dict
        Material -> expected landing x with it less that without it, in m, from single flights
        (cesim.effects.predict); empty: `shift` is the most that a force of this size can do.
    cost : float
        Measured share of the time of a step; NaN: not measured (cesim.effects.measure).
    """

    name: str
    doc: str
    setting: str
    on: bool
    size: float
    material: str
    threshold: float
    shift: float
    why: str
    parameters: dict[str, float]
    kind: str = "effect"
    shifts: dict[str, float] = dataclasses.field(default_factory=dict)
    cost: float = math.nan


class Decisions:
    """The decisions for all effects, in the order in which they act, and `choices` after them. Prints as a table."""

    def __init__(self, rows: list[Decision], materials: list[str]) -> None:
        self._rows = {row.name: row for row in rows}
        self.materials = materials  #: names of the materials that were taken into account

    @classmethod
    def of(cls, rows: list[dict[str, Any]], materials: list[str]) -> Decisions:
        """Those that a result file holds, as `Run.effects` gives them."""
        known = {field.name for field in dataclasses.fields(Decision)}
        return cls([Decision(**{key: row[key] for key in known & row.keys()}) for row in rows], materials)

    def __iter__(self) -> Iterator[Decision]:
        return (row for row in self._rows.values() if row.kind == "effect")

    def __len__(self) -> int:
        return sum(row.kind == "effect" for row in self._rows.values())

    @property
    def choices(self) -> list[Decision]:
        """The decisions that are no effects."""
        return [row for row in self._rows.values() if row.kind == "choice"]

    @property
    def rows(self) -> list[Decision]:
        """Effects, then choices."""
        return list(self._rows.values())

    def replaced(self, changes: Mapping[str, Mapping[str, Any]]) -> Decisions:
        """The same decisions with other values in some rows: name -> attribute -> value."""
        rows = [dataclasses.replace(row, **changes.get(row.name, {})) for row in self.rows]
        return Decisions(rows, self.materials)

    def __getitem__(self, name: str) -> Decision:
        if name not in self._rows:
            raise unknown("effect", name, self._rows)
        return self._rows[name]

    def to_pandas(self) -> pd.DataFrame:
        """One row per effect and per choice."""
        import pandas

        return pandas.DataFrame([dataclasses.asdict(row) for row in self.rows])

    def __str__(self) -> str:
        head = ("on?", "size", "threshold", "shift of landing x", "cost", "why")
        effects = [_cells(row) for row in self]
        choices = [_cells(row) for row in self.choices]
        table = [("effect", *head), *effects, *([("choice", *head)] if choices else []), *choices]
        widths = [max(len(cell) for cell in column) for column in zip(*table, strict=True)]
        lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in table]
        if choices:
            lines.insert(1 + len(effects), "")
        return "\n".join(line.rstrip() for line in lines)

    __repr__ = __str__


class SceneEffects(MutableMapping[str, EffectSetting]):
    """A scene's effects: a mapping of settings that, called, gives the decisions."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene

    def __call__(self) -> Decisions:
        """Decides for every effect and every choice, says why, and how far each is expected to move a landing."""
        from ..effects import predict

        return predict(self._scene)

    def measure(self, **options: Any) -> Decisions:
        """The same with the share of the run time that each takes; options as in `cesim.effects.measure`."""
        from ..effects import measure

        return measure(self._scene, **options)

    def audit(self, **options: Any) -> Audit:
        """Toggles each on a sample of the feed and measures its shift; options as in `cesim.effects.audit`."""
        from ..effects import audit

        return audit(self._scene, **options)

    def __getitem__(self, name: str) -> EffectSetting:
        return self._scene.effect_settings[name]

    def __setitem__(self, name: str, setting: Any) -> None:
        self._scene.effect_settings = {**self._scene.effect_settings, name: setting}

    def __delitem__(self, name: str) -> None:
        self._scene.effect_settings = {key: value for key, value in self.items() if key != name}

    def __iter__(self) -> Iterator[str]:
        return iter(self._scene.effect_settings)

    def __len__(self) -> int:
        return len(self._scene.effect_settings)

    def __repr__(self) -> str:
        return f"{dict(self)!r}"


def check_settings(given: Any) -> Any:
    """Checks names and ranges of effects and their parameters against the engine's table; "on" means {state = "on"}."""
    if not isinstance(given, Mapping):
        return given
    rows = {row["name"]: row for row in engine.effects()}
    checked = {}
    for name, setting in given.items():
        if name not in rows:
            raise unknown("effect", name, rows)
        plain = setting.model_dump() if isinstance(setting, EffectSetting) else setting
        plain = {"state": plain} if isinstance(plain, str) else plain
        if isinstance(plain, Mapping) and isinstance(plain.get("parameters"), Mapping):
            plain = {**plain, "parameters": _checked_parameters(rows[name], plain["parameters"])}
        checked[name] = plain
    return checked


def _checked_parameters(row: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, float]:
    known = {parameter["name"]: parameter for parameter in row["parameters"]}
    result = {}
    for name, value in given.items():
        if name not in known:
            raise unknown("parameter", name, known).at(row["name"], "parameters")
        unit = "" if known[name]["unit"] in ("1", "-") else known[name]["unit"]
        try:
            result[name] = to_si(value, unit, known[name]["least"], known[name]["most"])
        except InputError as error:
            raise error.at(row["name"], "parameters", name) from None
    return result


def counted_materials(scene: Scene, unfed_radius: float = UNFED_RADIUS) -> dict[str, tuple[Material, float]]:
    """Materials that decisions are about, with the radius in m of their smallest grains: those fed, else all."""
    materials = grain_materials(scene)
    if scene.feed is None:
        return {name: (material, unfed_radius) for name, material in materials.items()}
    counted: dict[str, tuple[Material, float]] = {}
    for family in scene.feed.all_families():
        if family.material not in materials:
            raise unknown("material", family.material, materials).at("feed")
        radius = min(0.5 * family.size.smallest(), counted.get(family.material, (None, math.inf))[1])
        counted[family.material] = (materials[family.material], radius)
    return counted


def decide(scene: Scene, unfed_radius: float = UNFED_RADIUS) -> Decisions:
    """The decision for each row of the engine's table, and for each choice."""
    materials = counted_materials(scene, unfed_radius)
    rows: list[Decision] = []
    scale = _scale(scene)
    scales = {name: [scale | face for face in _grain_scales(scene, *grain)] for name, grain in materials.items()}
    with engine_errors():
        for effect in engine.effects():
            on = {row.name for row in rows if row.on}
            rows.append(_decide_one(scene, effect, materials, scales, on))
        radii = {name: radius for name, (_, radius) in materials.items()}
        for choice in CHOICES:
            finding = choice.find(scene, radii)
            if finding is not None:
                rows.append(_chosen(choice, finding))
    return Decisions(rows, list(materials))


def _chosen(choice: Choice, finding: Finding) -> Decision:
    why = finding.why if finding.setting == "auto" else f"set {finding.setting}; {finding.why}"
    return Decision(
        choice.name,
        choice.doc,
        finding.setting,
        finding.on,
        finding.size,
        "",
        choice.threshold,
        math.nan,
        why,
        {},
        kind="choice",
    )


def _decide_one(
    scene: Scene,
    effect: Mapping[str, Any],
    materials: Mapping[str, tuple[Material, float]],
    scales: Mapping[str, list[dict[str, Any]]],
    on: set[str],
) -> Decision:
    name = effect["name"]
    setting = scene.effect_settings.get(name, EffectSetting())
    if name == "wind" and name not in scene.effect_settings:
        setting = EffectSetting(state=scene.air.wind)
    threshold = THRESHOLDS.get(name, THRESHOLD)
    parameters = {row["name"]: float(row["default"]) for row in effect["parameters"]}
    parameters |= _from_scene(scene, name) | setting.parameters
    missing_part, missing = _lacks(scene, name, materials, on)
    if setting.state == "on" and missing_part:
        raise InputError(f"is 'on', but {missing_part}", path=f"effects.{name}", value="on", allowed="'auto' or 'off'")

    lacking = missing_part or missing
    # An image is that of the charge, which the corona's own field has brought.
    own = {"field": charging_field(scene)} if name == "image_force" else {}
    sizes = {
        key: max(engine.effect_size(name, face | own, parameters) for face in pure)
        for key, pure in ({} if lacking else scales).items()
    }
    largest = max(sizes, key=lambda key: sizes[key], default="")
    size = sizes.get(largest, 0.0)
    measured = f"{size:.3g} x the weight ({largest})" if sizes else lacking or "nothing is fed"
    if setting.state != "auto":
        is_on, why = setting.state == "on", f"set {setting.state}; {measured}"
    elif sizes:
        is_on = size >= threshold
        why = f"{measured}, {'above' if is_on else 'below'} the threshold"
    else:
        is_on, why = False, measured
    if name == "charge_decay" and scene.drum is not None:
        why += "".join(f"; {note}" for note in decay_reasons(scene, materials))
    shift = FLIGHT_SHIFT * min(size, 1.0)
    return Decision(name, effect["doc"], setting.state, is_on, size, largest, threshold, shift, why, parameters)


def _from_scene(scene: Scene, name: str) -> dict[str, float]:
    """Parameters of an effect that stand elsewhere in the scene."""
    air = {"density": scene.air.density, "viscosity": scene.air.viscosity}
    if name in ("drag", "shape_drag"):
        return {"law": DRAG_LAWS[scene.air.law], **air}
    if name == "wind":
        return {"speed": scene.drum.speed if scene.drum is not None else 0.0, **air}
    if name == "magnus":
        return air
    if name == "corona_charging" and scene.corona is not None:
        return corona_parameters(scene)
    return {}


def _lacks(scene: Scene, name: str, materials: Mapping[str, Any], on: set[str]) -> tuple[str, str]:
    """What an effect lacks: a part without which it is impossible, and what leaves it without effect."""
    needs = NEEDS.get(name, Needs())
    for part in needs.parts:
        lacking = scene.field.lacks(scene) if part == "field" else ""
        if lacking or getattr(scene, part) is None:
            return lacking or f"the scene has no {part}", ""
    if needs.voltage and most_voltage(scene) == 0.0:
        return "", "the voltage is 0"
    behaves = [behaviour(scene, material) for material, _ in materials.values()]
    if needs.kind and not any(behaves_as(one, needs.kind) for one in behaves):
        return "", f"the scene has no {needs.kind}" if scene.feed is None else f"no {needs.kind} is fed"
    if name == "shape_drag" and scene.air.law == "stokes":
        return "", "the law of drag is Stokes'"
    if name == "adhesion" and scene.feed is None:
        return "", "nothing is fed whose size is known; set it 'on' for fine grains that are added"
    if needs.effect and needs.effect not in on:
        return "", f"{needs.effect} is off"
    return "", ""


def impossible(scene: Scene, name: str) -> str:
    """Why an effect cannot be "on" in a scene: what part it lacks, or ""."""
    return _lacks(scene, name, counted_materials(scene), set())[0]


def _scale(scene: Scene) -> dict[str, Any]:
    """The scene in the numbers that say how large an effect is (ces_EffectScale), the grain apart."""
    return {
        "gravity": math.hypot(*scene.gravity),
        "voltage": most_voltage(scene),
        "field": largest_field(scene),
        "speed": flight_speed(scene),
        "surface_speed": surface_speed(scene),
        "rolling_speed": rolling_speed(scene),
        "sphericity": least_sphericity(scene),
        "square_gradient": square_gradient(scene),
        "coverage": stream_coverage(scene),
        "has_drum": scene.drum is not None,
        "has_brush": scene.brush is not None,
        "has_corona": scene.corona is not None,
        "residence": residence(scene) or 0.0,
    }


def _grain_scales(scene: Scene, material: Material, radius: float) -> list[dict[str, Any]]:
    """Of a mixture: of each of the materials that it is averaged over."""
    pure = faces(behaviour(scene, material))
    return [
        {**{key: value for key, value in face.items() if key != "conductor_share"}, "radius": radius} for face in pure
    ]


def reference_speed(scene: Scene) -> float:
    """Speed in m/s of the fastest prescribed surface."""
    speeds = [drum_speed(scene)]
    if scene.brush is not None:
        speeds.append(abs(brush_speed(scene)) * scene.brush.radius)
    motions = [*(part.motion for part in scene.plates), *(part.motion for part in scene.splitters)]
    for motion in [*motions, *(part.motion for part in scene.walls)]:
        if motion is not None:
            speeds.append(motion.greatest_speed())
    speeds += [mesh.greatest_speed() for mesh in scene.meshes]
    return max(speeds)


def flight_speed(scene: Scene) -> float:
    """Speed in m/s of a grain at the end of its flight: that of the drum and of the fall from its top to the plane.

    The drum's speed alone is about half of it and makes drag, quadratic in it, four times too small.
    """
    known = scene.drum is not None and scene.collect is not None
    drop = max(scene.drum.radius - scene.collect.y, 0.0) if known else DROP  # type: ignore[union-attr]
    fall = math.sqrt(2.0 * math.hypot(*scene.gravity) * drop)
    thrown = drum_speed(scene) if scene.drum is not None else reference_speed(scene)
    return max(math.hypot(thrown, fall), SLOWEST_FLIGHT)


def drum_speed(scene: Scene) -> float:
    """Largest speed in m/s of the drum's surface, 0 without a drum."""
    if scene.drum is None:
        return 0.0
    drive = scene.drum.drive
    turns = [abs(speed) for _, speed in drive.rows(scene.drum.speed)] if isinstance(drive, Motor) else []
    return max([abs(scene.drum.speed), *turns]) * scene.drum.radius


def stream_coverage(scene: Scene) -> float:
    """Cross-sections of the grains fed over the area of their stream, where it is as fast as the drum; 0: no feed."""
    covered = coverage(scene)
    return covered.get("drum", max(covered.values(), default=0.0))


def brush_speed(scene: Scene) -> float:
    """Speed of the brush in rad/s: its own, or with a surface half as fast again as the drum's."""
    if scene.brush is None:
        return 0.0
    if scene.brush.speed is not None or scene.drum is None:
        return scene.brush.speed or 0.0
    return BRUSH_RATIO * scene.drum.speed * scene.drum.radius / scene.brush.radius


def _cells(row: Decision) -> tuple[str, ...]:
    """A row of the printed table."""
    state = ("on" if row.on else "off") + ("" if row.setting == "auto" else " (set)")
    size = "-" if math.isnan(row.size) else f"{row.size:.3g}"
    cost = "-" if math.isnan(row.cost) else f"{100.0 * row.cost:.1f} %"
    return row.name, state, size, f"{row.threshold:g}", _shift(row), cost, row.why


def _shift(row: Decision) -> str:
    if math.isnan(row.shift) or row.name == "gravity" or (not row.size and not row.shifts):
        return "-"
    if not row.shifts:
        return f"{'> ' if row.size > 1.0 else '< '}{row.shift * 1e3:.3g} mm"
    most = max(row.shifts, key=lambda name: abs(row.shifts[name]))
    return f"{1e3 * row.shifts[most]:+.3g} mm ({most})"
