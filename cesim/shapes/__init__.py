"""Shapes of grains: from a description (`cesim.Box`, `cesim.Shaving`, ...) to what the engine takes.

>>> template = cesim.shapes.template(cesim.Box(proportions=(3, 2, 1), spheres=12))
>>> template.shape_error  # volume in only one of box and cluster, over the box's
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from .templates import Template

if TYPE_CHECKING:
    from ..materials import Material
    from ..scene.shapes import Shape

__all__ = ["Template", "template"]


def template(shape: Shape, materials: Mapping[str, Material] | None = None) -> Template:
    """The template of a shape.

    Parameters
    ----------
    shape : Sphere, Box, Flake, Cylinder, Rod, Cone, Ellipsoid, Shaving, Angular, Hull, ClosedMesh, Cluster or Composite
    materials : by name, of a composite; default: those of the library

    Returns
    -------
    Template
        Read-only; equal shapes share one.
    """
    from ..errors import InputError, show
    from ..scene.definition import template_of
    from ..scene.shapes import Shape

    if not isinstance(shape, Shape):
        raise InputError(f"is {show(shape)}, must be a shape such as cesim.Box()", path="shape", value=shape)
    return template_of(shape, materials=materials)
