"""Scene -> the dict of plain numbers that the engine takes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..materials import Material, Pair, library
from .assembly import assembly
from .charges import TableCharge
from .check import refuse_contradictions
from .composites import composite_templates, grain_materials
from .effects import Decisions, decide, reference_speed
from .electrics import behaviour
from .feed import Family, Feed, Table
from .field import field_definition
from .ions import effect_definition
from .shapes import Composite, Shape, Sphere
from .surfaces import Body, surfaces

if TYPE_CHECKING:
    from ..shapes import Template
    from .scene import Scene


def definition(scene: Scene, decisions: Decisions | None = None) -> dict[str, Any]:
    """What `engine.Scene` takes. The scene must be validated; decisions other than its own may be given."""
    refuse_contradictions(scene)
    bodies = surfaces(scene)
    built = assembly(scene, bodies)
    grains = {name: grain_matrix(scene, name) for name in COEFFICIENTS}
    against = {name: surface_matrix(scene, bodies, name) for name in COEFFICIENTS}
    numerics, shapes, decisions = scene.numerics, grain_shapes(scene), decisions or decide(scene)
    materials = grain_materials(scene)
    return {
        "step": numerics.step,
        "gravity": scene.gravity,
        "drum_axis": (0.0, 0.0),
        "drum_radius": scene.drum.radius if scene.drum is not None else 0.0,
        "contact_law": numerics.contact_law,
        "tolerance": numerics.tolerance or 0.0,
        "reference_speed": reference_speed(scene),
        "max_iterations": numerics.max_iterations,
        "grain_contact": decisions["grain_contact"].on,
        "solver": numerics.solver,
        "gyroscopic": numerics.gyroscopic != "off",  # the engine asks it of grains that are no spheres only
        "rotation": decisions["rotation"].on,
        "landing_height": scene.collect.y if scene.collect is not None else -math.inf,
        "lower": scene.bounds.lower,
        "upper": scene.bounds.upper,
        "materials": [behaviour(scene, material) for material in materials.values()],
        "surfaces": [_carried(body.row, built.carriers) for body in bodies],
        "parts": built.parts,
        "joints": built.joints,
        "grain_friction": grains["friction"],
        "grain_restitution": grains["restitution"],
        "grain_rolling": grains["rolling_friction"],
        "grain_spinning": grains["spinning_friction"],
        "surface_friction": against["friction"],
        "surface_restitution": against["restitution"],
        "surface_rolling": against["rolling_friction"],
        "surface_spinning": against["spinning_friction"],
        "field": field_definition(scene),
        "effects": [effect_definition(scene, row) for row in decisions if row.on],
        "shapes": [template.definition(list(materials)) for template in shapes],
        "feed": feed_of(scene.feed, list(materials), shapes) if scene.feed is not None else None,
    }


def _carried(row: dict[str, Any], carriers: dict[str, int]) -> dict[str, Any]:
    """A surface of a dynamic part has no motion of its own."""
    return {**row, "part": carriers[row["name"]], "angular_speed": 0.0} if row["name"] in carriers else row


# ---- coefficients of contacts --------------------------------------------------------------------------------------

COEFFICIENTS = ("friction", "restitution", "rolling_friction", "spinning_friction")


def grain_matrix(scene: Scene, name: str) -> NDArray[np.float64]:
    """Between grains: the geometric mean of the two materials', unless either names the other."""
    materials = grain_materials(scene)
    own = np.array([getattr(material, name) for material in materials.values()])
    matrix = np.sqrt(np.outer(own, own))
    names = list(materials)
    for row, material in enumerate(materials.values()):
        for partner, pair in material.pairs.items():
            if partner in materials and getattr(pair, name) is not None:
                column = names.index(partner)
                matrix[row, column] = matrix[column, row] = getattr(pair, name)
    return matrix


def surface_matrix(scene: Scene, bodies: list[Body], name: str) -> NDArray[np.float64]:
    """Between surfaces and grains: the surface's, unless the material names the group of the surface."""
    materials = grain_materials(scene)
    rows = [
        [_override(material.pairs.get(body.group), name, getattr(body.part, name)) for material in materials.values()]
        for body in bodies
    ]
    return np.array(rows, dtype=np.float64).reshape(len(bodies), len(materials))


def _override(pair: Pair | None, name: str, rule: float) -> float:
    special = getattr(pair, name) if pair is not None else None
    return rule if special is None else special


# ---- shapes of grains ------------------------------------------------------------------------------------------------


def grain_shapes(scene: Scene) -> list[Template]:
    """The sphere, then each different shape of the feed and of `scene.shapes`, then the composites."""
    found = [template_of(Sphere())]
    for shape, place in _described(scene):
        template = template_of(shape, *place)
        if template.kind != "sphere" and template not in found:
            found.append(template)
    return found + list(composite_templates(scene).values())


def shape_index(shapes: list[Template], shape: Shape, name: str = "") -> int:
    """Where a shape stands among these, a composite by its name; -1: nowhere."""
    if isinstance(shape, Composite):
        return next((i for i, template in enumerate(shapes) if template.phases and template.name == name), -1)
    template = template_of(shape)
    if template.kind == "sphere":
        return 0
    return shapes.index(template) if template in shapes else -1


def template_of(shape: Shape, *place: str | int, materials: Mapping[str, Material] | None = None) -> Template:
    """The template of a shape; equal shapes share one. An error names the place of the shape in the tree.

    materials: of a composite; default: those of the library.
    """
    from ..shapes import builders
    from ..shapes.composites import of as of_composite

    try:
        if isinstance(shape, Composite):
            return of_composite(shape, library() if materials is None else materials)
        return builders.of(shape)
    except InputError as error:
        raise error.at(*(place or (Shape.where,))) from None


def _described(scene: Scene) -> Iterator[tuple[Shape, tuple[str | int, ...]]]:
    if scene.feed is not None and scene.feed.families is not None:
        for i, family in enumerate(scene.feed.families):
            if family.fraction > 0.0 and not isinstance(family.shape, Composite):
                yield family.shape, ("feed", "families", i, "shape")
    elif scene.feed is not None:
        yield scene.feed.shape, ("feed", "shape")
    for name, shape in scene.shapes.items():
        if not isinstance(shape, Composite):
            yield shape, ("shapes", name)


# ---- feed ----------------------------------------------------------------------------------------------------------


def feed_of(feed: Feed, materials: list[str], shapes: list[Template]) -> dict[str, Any]:
    families = feed.all_families()
    total = math.fsum(family.fraction for family in families)
    return {
        "rate_kind": feed.rate.kind,
        "rate": float(feed.rate),
        "start": feed.start,
        "stop": math.inf if feed.stop is None else feed.stop,
        "center": feed.outlet.center,
        "edge_u": (feed.outlet.length, 0.0, 0.0),
        "edge_v": (0.0, 0.0, feed.outlet.width),
        "velocity": feed.velocity,
        "families": [_family(family, materials, shapes, total) for family in families],
    }


def _charge(family: Family) -> dict[str, Any]:
    law = family.charge
    if law is None:
        return {}
    table = np.column_stack([law.value, law.fraction]) if isinstance(law, TableCharge) else None
    return {
        "charge": law.kind,
        "charge_parameters": list(law.parameters().values()),
        "charge_per_surface": law.per == "surface",
        "charge_table": table,
    }


def _family(family: Family, materials: list[str], shapes: list[Template], total: float) -> dict[str, Any]:
    size = family.size
    least, most = size.limits()
    table = np.column_stack([size.diameter, size.fraction]) if isinstance(size, Table) else None
    return {
        "material": materials.index(family.material),
        "mass_fraction": family.fraction / total,
        "distribution": size.kind,
        "parameters": size.parameters(),
        "least": least,
        "most": most,
        "table": table,
        "shape": shape_index(shapes, family.shape, family.material),
        **_charge(family),
    }
