"""What the engine gets of a shape, and how far it is from the shape described.

A template is in units of the diameter of the sphere of equal volume, in its principal frame, with its centre of mass in
the origin. Mass, centre and moments are those of the body described, by closed forms; those of a cluster given sphere
by sphere are those of the union of its spheres. How far spheres or corners are from that body is stated beside it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ..errors import InputError, show
from .bodies import Body
from .electric import electric_factors
from .mass import Array, Mass
from .packing import Coverage, around
from .polyhedra import Convex
from .union import of_balls, signed_gap

Kind = Literal["sphere", "cluster", "convex"]
FINENESS = 70  # points of a surface along the diameter of equal volume, when deviations are measured
COUNTED = 48_000  # points inside a body, when volumes are
ROUNDING = 1e-14
LONGEST_NAME = 40  # that the engine keeps


@dataclass(frozen=True, eq=False)
class Template:
    """A shape for the engine, over the diameter d of the sphere of equal volume, in its principal frame.

    Attributes
    ----------
    name : str
    kind : "sphere", "cluster" or "convex"
    moments : (3,) principal moments of inertia over m d^2; a sphere has 0.1
    spheres : (n, 4) centres and radii over d, of a cluster
    vertices : (n, 3) corners over d, of a convex polyhedron
    reach : farthest point from the centre over d
    sphericity : surface of the sphere of equal volume over the surface of the body
    volume_error : of the spheres' union (or the hull), less the body's, over the body's; negative: too small
    inertia_error : greatest difference of a moment for equal masses, over the largest moment
    center_error : distance of the centres of mass over d
    shape_error : volume in only one of the two, over the body's volume; an upper bound
    deviation : farthest that the surface of either is from the other, over d; an upper bound
    mass_error : relative error of volume and moments themselves
    scale : d in the lengths in which the shape was described
    materials : (n,) of each sphere, of a composite
    contents : material -> mass fraction, of a composite
    density : kg/m3, of a composite
    phases : what the engine takes of that which conducts and of the rest, of a composite
    """

    name: str
    kind: Kind
    moments: Array
    spheres: Array
    vertices: Array
    reach: float
    sphericity: float
    volume_error: float
    inertia_error: float
    center_error: float
    shape_error: float
    deviation: float
    mass_error: float
    scale: float
    materials: tuple[str, ...] = ()
    contents: Mapping[str, float] = field(default_factory=dict)
    density: float = math.nan
    phases: tuple[dict[str, Any], ...] = ()

    def __post_init__(self) -> None:
        a, b, c = np.sort(self.moments)
        if not (np.isfinite([*self.moments, self.reach]).all() and a > 0.0 and c <= (a + b) * (1.0 + 1e-9)):
            raise InputError(f"has moments of inertia {show(self.moments.tolist())}, which no body has")
        for block in (self.moments, self.spheres, self.vertices):
            block.setflags(write=False)

    def definition(self, materials: Sequence[str] = ()) -> dict[str, Any]:
        """What the engine takes; of a composite by the indices of these materials, of which its name is one."""
        composite: dict[str, Any] = {}
        if self.phases:
            composite["sphere_materials"] = np.array([materials.index(name) for name in self.materials], np.uint32)
            composite |= {"phases": list(self.phases), "material": materials.index(self.name)}
        return {
            "name": self.name[:LONGEST_NAME],
            "kind": self.kind,
            "moments": self.moments,
            "sphericity": min(self.sphericity, 1.0),  # that of a sphere may be above by rounding
            "spheres": self.spheres,
            "vertices": self.vertices,
            **(electric_factors(self.moments) if self.kind != "sphere" else {}),
            **composite,
        }


@dataclass(frozen=True)
class Errors:
    """How far a stand-in is from its body, in the body's lengths."""

    mass: Mass
    difference: float = 0.0
    deviation: float = 0.0


def of_cluster(name: str, body: Body, spheres: Array) -> Template:
    """Spheres that stand for a body: mass, centre and moments are the body's."""
    union = of_balls(spheres)
    points, covering = body.surface(body.mass.diameter / FINENESS)
    protrusion = float((spheres[:, 3] - body.depth(spheres[:, :3])).max()) + body.slack
    lack = float(signed_gap(points, spheres).max()) + covering
    errors = Errors(union.mass, _bound(Coverage.of(body, spheres, inside=COUNTED)), max(protrusion, lack, 0.0))
    return build(name, "cluster", body.mass, body.area, errors, spheres=spheres)


def of_union(name: str, spheres: Array) -> Template:
    """Spheres that stand for themselves."""
    union = of_balls(spheres)
    kind: Kind = "cluster" if len(spheres) > 1 else "sphere"
    return build(name, kind, union.mass, union.area, Errors(union.mass), spheres=spheres, mass_error=union.error)


def of_polyhedron(name: str, body: Body, hull: Convex) -> Template:
    """The corners of a convex polyhedron that stand for a body: mass, centre and moments are the body's."""
    if body is hull:
        errors = Errors(hull.mass)
    else:
        from scipy.spatial import cKDTree

        spacing = body.mass.diameter / FINENESS
        (points, covering), (others, covers) = body.surface(spacing), hull.surface(spacing)
        outside = points[hull.depth(points) < 0.0]
        lack = np.max(cKDTree(others).query(outside)[0], initial=-covering) + covering
        protrusion = np.max(cKDTree(points).query(others)[0]) + covers
        difference = _bound(_overlap(body, hull))
        errors = Errors(hull.mass, difference, float(max(lack, protrusion)))
    return build(name, "convex", body.mass, body.area, errors, vertices=hull.points)


def _overlap(body: Body, hull: Convex) -> Coverage:
    lattice = around(body, COUNTED, margin=max(float(np.max([body.lower - hull.lower, hull.upper - body.upper])), 0.0))
    gap = np.where(hull.occupied(lattice), -1.0, 1.0).ravel()
    return Coverage(np.zeros((0, 3)), body.occupied(lattice).ravel(), gap, lattice.step)


def _bound(coverage: Coverage) -> float:
    """The volume in only one of two bodies, and three deviations more: a count of n points varies by sqrt(n)."""
    return coverage.difference() + 3.0 * float(np.sqrt(coverage.missed + 1.0)) * coverage.step**3


def build(
    name: str,
    kind: Kind,
    mass: Mass,
    area: float,
    errors: Errors,
    spheres: Array | None = None,
    vertices: Array | None = None,
    mass_error: float = ROUNDING,
) -> Template:
    """A template of a body's mass properties, with the spheres or corners that stand for it."""
    axes, d = mass.principal_axes(), mass.diameter
    balls = np.zeros((0, 4)) if spheres is None else np.array(spheres, dtype=np.float64)
    balls[:, :3] = (balls[:, :3] - mass.center) @ axes
    corners = np.zeros((0, 3)) if vertices is None else (vertices - mass.center) @ axes
    inertia, other = axes.T @ mass.unit_inertia @ axes, errors.mass
    scaled = other.unit_inertia * (other.diameter / d) ** 2
    reaches = [np.linalg.norm(balls[:, :3], axis=1) + balls[:, 3], np.linalg.norm(corners, axis=1)]
    return Template(
        name=name,
        kind=kind,
        moments=np.diag(inertia).copy(),
        spheres=balls / d,
        vertices=corners / d,
        reach=float(np.concatenate(reaches).max()) / d,
        sphericity=np.pi * d * d / area,
        volume_error=other.volume / mass.volume - 1.0,
        inertia_error=float(np.abs(scaled - mass.unit_inertia).max() / np.diag(inertia).max()),
        center_error=float(np.linalg.norm(other.center - mass.center)) / d,
        shape_error=errors.difference / mass.volume,
        deviation=errors.deviation / d,
        mass_error=mass_error,
        scale=d,
    )
