"""Composites: clusters of spheres of several materials, each part counted once, with the phases that charges sit on.

The spheres are taken in their order, in runs of one material. What a run adds to the union of those before it is of its
material: so the mass, the centre and the moments are differences of exact unions, weighted by densities.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, show, unknown
from ..materials import Material
from .electric import electric_factors
from .mass import Array, Mass
from .templates import Errors, Template, build
from .union import Union, of_balls, visible

if TYPE_CHECKING:
    from ..scene.shapes import Composite

LEAST_SHARE = 1e-6  # of the volume that a run of spheres must add
ROUND = 1e-6  # relative difference of moments, below which a phase is a sphere to its field
SPHERE = {  # as in the engine: of a sphere on a plane, and in a field
    "contact_charge": np.full(3, math.pi**2 / 6.0),
    "contact_force": np.full(3, 0.8320841),
    "semi_axes": np.full(3, 0.5),
    "depolarization": np.full(3, 1.0 / 3.0),
}


def of(shape: Composite, materials: Mapping[str, Material]) -> Template:
    """The template of a composite of these materials; the same shape of the same materials gives the same object."""
    for i, name in enumerate(shape.materials):
        if name not in materials:
            raise unknown("material", name, materials).at("materials", i)
        if materials[name].conductor_share > 0.0:
            raise InputError(
                f"is {show(name)}, a mixture; a composite is made of pure materials", path=f"materials[{i}]", value=name
            )
    used = [materials[name] for name in shape.materials]
    return _of(
        tuple(shape.spheres),
        tuple(shape.materials),
        tuple(material.density for material in used),
        tuple(material.kind == "conductor" for material in used),
    )


@dataclass(frozen=True)
class Region:
    """What a run of spheres adds: its material, and the integrals of 1, x and x x^T over it."""

    material: str
    density: float
    conducts: bool
    spheres: Array
    volume: float
    first: Array
    second: Array


@lru_cache(maxsize=256)
def _of(
    spheres: tuple[tuple[float, ...], ...],
    names: tuple[str, ...],
    densities: tuple[float, ...],
    conducts: tuple[bool, ...],
) -> Template:
    balls = np.array(spheres, dtype=np.float64)
    balls[:, :3] -= balls[:, :3].mean(axis=0)  # integrals about a point nearby keep their digits
    regions, union, error = _regions(balls, names, densities, conducts)
    total = union.mass.volume
    weight = sum(region.density * region.volume for region in regions)
    density = weight / total
    mass = Mass.about_origin(
        total,
        np.sum([region.density * region.first for region in regions], axis=0) / density,
        np.sum([region.density * region.second for region in regions], axis=0) / density,
    )
    outside = visible(balls)
    template = build(
        f"composite of {len(outside)} spheres",
        "cluster",
        mass,
        union.area,
        Errors(mass),
        spheres=balls[outside],
        mass_error=error * max(densities) / density,
    )
    contents = {
        name: math.fsum(r.density * r.volume for r in regions if r.material == name) / weight
        for name in dict.fromkeys(names)
    }
    phases = [
        _phase([region for region in regions if region.conducts is wanted], mass, total, weight)
        for wanted in (True, False)
    ]
    return replace(
        template,
        materials=tuple(names[i] for i in outside),
        phases=tuple(phases),
        contents=contents,
        density=density,
    )


def _regions(
    balls: Array, names: tuple[str, ...], densities: tuple[float, ...], conducts: tuple[bool, ...]
) -> tuple[list[Region], Union, float]:
    """The regions, the whole union, and the relative error of the integrals."""
    regions: list[Region] = []
    before = (0.0, np.zeros(3), np.zeros((3, 3)))
    union, error = of_balls(balls), 0.0
    for _, run in groupby(range(len(balls)), key=names.__getitem__):
        rows = list(run)
        grown = of_balls(balls[: rows[-1] + 1])
        after = _integrals(grown.mass)
        volume, first, second = (now - then for now, then in zip(after, before, strict=True))
        if not volume > LEAST_SHARE * union.mass.volume:
            raise InputError(
                f"names {show(names[rows[0]])} for spheres that lie inside those before them: what is shared belongs "
                "to the sphere that comes first, so a core stands before its cover",
                path=f"materials[{rows[0]}]",
            )
        k = rows[0]
        regions.append(Region(names[k], densities[k], conducts[k], balls[rows], volume, first, second))
        before, error = after, max(error, grown.error)
    return regions, union, error


def _integrals(mass: Mass) -> tuple[Any, Any, Any]:
    center = mass.center
    return mass.volume, mass.volume * center, mass.second + mass.volume * np.outer(center, center)


def _phase(regions: list[Region], grain: Mass, volume: float, weight: float) -> dict[str, Any]:
    """What the engine takes of a phase: the regions that conduct, or the others."""
    if not regions:
        return {"volume": 0.0, "mass": 0.0}
    from scipy.spatial.transform import Rotation

    masses = np.array([region.density * region.volume for region in regions])
    center = np.sum([region.density * region.first for region in regions], axis=0) / masses.sum()
    own = Mass.about_origin(
        math.fsum(region.volume for region in regions),
        np.sum([region.first for region in regions], axis=0),
        np.sum([region.second for region in regions], axis=0),
    )
    grain_axes = grain.principal_axes()
    axes = own.principal_axes()
    moments = np.diag(axes.T @ own.unit_inertia @ axes)
    is_round = np.ptp(moments) < ROUND * moments.max()
    x, y, z, w = Rotation.from_matrix(np.eye(3) if is_round else grain_axes.T @ axes).as_quat()
    area = of_balls(np.concatenate([region.spheres for region in regions])).area
    return {
        "volume": own.volume / volume,
        "mass": float(masses.sum() / weight),
        "center": grain_axes.T @ (center - grain.center) / grain.diameter,
        "orientation": np.array([w, x, y, z]),
        "sphericity": min(np.pi * own.diameter**2 / area, 1.0),
        **(SPHERE if is_round else electric_factors(moments)),
    }
