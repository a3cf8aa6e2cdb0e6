"""The composites of a scene: which there are, and the materials that their grains are of."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..errors import InputError, show
from ..materials import Material
from .electrics import kind_of
from .shapes import Composite, Shape

if TYPE_CHECKING:
    from ..shapes import Template
    from .scene import Scene

Place = tuple[str | int, ...]


def composites(scene: Scene) -> dict[str, Composite]:
    """By name: those of `scene.shapes`, then those that families of the feed name by their material."""
    found: dict[str, Composite] = {}
    for name, shape, place in _described(scene):
        if name in scene.materials:
            raise InputError(
                f"is {show(name)}, a material of the scene; a composite has a name of its own", value=name
            ).at(*place)
        if found.setdefault(name, shape) != shape:
            raise InputError(f"is {show(name)}, the name of another composite", value=name).at(*place)
    return found


def _described(scene: Scene) -> list[tuple[str, Composite, Place]]:
    named: list[tuple[str, Shape, Place]] = [(name, shape, ("shapes", name)) for name, shape in scene.shapes.items()]
    for i, family in enumerate((scene.feed.families if scene.feed is not None else None) or []):
        named.append((family.material, family.shape, ("feed", "families", i, "material")))
    return [(name, shape, place) for name, shape, place in named if isinstance(shape, Composite)]


def pure_materials(scene: Scene) -> dict[str, Material]:
    """The scene's materials, each of the kind as which the scene takes it."""
    found = {}
    for name, material in scene.materials.items():
        kind = kind_of(scene, material)
        change: dict[str, object] = {"kind": kind}
        if kind == "middling":
            change["permittivity"] = material.permittivity or 1.0
        else:
            change |= {"decay_time": None, "resistivity": None}
        found[name] = material.model_copy(update=change)
    return found


def composite_templates(scene: Scene) -> dict[str, Template]:
    """The template of each composite, under its name."""
    from .definition import template_of

    found = composites(scene)
    if not found:
        return {}
    pure = pure_materials(scene)
    places = {name: ("shapes", name) if name in scene.shapes else ("feed", "families", name) for name in found}
    return {
        name: replace(template_of(shape, *places[name], materials=pure), name=name) for name, shape in found.items()
    }


def grain_materials(scene: Scene) -> dict[str, Material]:
    """The materials that grains may be of: the scene's, then one for each composite, under its name.

    A composite's has its mean density and, of its phases, the averages of a mixture of the same contents; the
    coefficients of its contacts are those of the spheres that touch.
    """
    templates = composite_templates(scene)
    if not templates:
        return scene.materials
    pure = pure_materials(scene)
    made = {
        name: Material.mixture(
            dict(template.contents),
            pure,
            density=template.density,
            source="composite by mass: "
            + ", ".join(f"{100.0 * share:.3g} % {content}" for content, share in template.contents.items()),
        )
        for name, template in templates.items()
    }
    return {**scene.materials, **made}


def contents(scene: Scene) -> dict[str, dict[str, float]]:
    """Mass fractions of what mixtures and composites are made of, by name, where all of it is in the scene."""
    materials = grain_materials(scene)
    return {
        name: dict(material.contents)
        for name, material in materials.items()
        if material.contents and all(content in materials for content in material.contents)
    }
