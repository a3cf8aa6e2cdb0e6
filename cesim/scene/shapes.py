"""Shapes of grains, as a user describes them. All lengths are ratios: the size comes from the diameter.

The diameter of a grain is that of the sphere of equal volume, for every shape. `model` says what the engine gets: a
"cluster" of spheres, or one "convex" polyhedron. `cesim.shapes.template` builds it and states its errors.
"""

from __future__ import annotations

import math
import os
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from ..errors import InputError, number, show
from ..units import Doc, Part, Quantity, Whole

MOST_SPHERES = 400
MOST_FACETS = 20_000
MOST_CORNERS = 128  # of a convex polyhedron
MOST_RATIO = 30.0  # of the longest to the shortest edge

Edge = Annotated[float, Quantity("", 1e-3, 1e3, "length in any unit")]
Number = Annotated[float, Quantity("", -1e6, 1e6, "coordinate in any unit")]
Radius = Annotated[float, Quantity("", 1e-6, 1e6, "radius in the same unit")]
Point = tuple[Number, Number, Number]
Model = Annotated[Literal["cluster", "convex"], Doc("'cluster': overlapping spheres; 'convex': one polyhedron")]
Spheres = Annotated[int, Whole(1, MOST_SPHERES, "spheres of the cluster, at most")]
Sides = Annotated[int, Whole(3, MOST_CORNERS // 2, "sides of the polygon that stands for a circle, if convex")]
Seed = Annotated[int, Whole(0, 2**63 - 1, "of what is random")]


def _rows(value: Any) -> Any:
    """NumPy's arrays as lists."""
    return value.tolist() if isinstance(value, np.ndarray) else value


class Shape(Part):
    """A shape without a size."""

    where: ClassVar[str] = "shape"
    kind: str


class Sphere(Shape):
    """A sphere."""

    kind: Literal["sphere"] = "sphere"


class Box(Shape):
    """A box with sharp edges."""

    kind: Literal["box"] = "box"
    proportions: Annotated[tuple[Edge, Edge, Edge], Doc("the three edges, to each other")] = (1.5, 1.2, 1.0)
    model: Model = "cluster"
    spheres: Spheres = 9

    @model_validator(mode="after")
    def _edges_are_alike(self) -> Box:
        _not_too_thin("proportions", self.proportions)
        return self


class Flake(Shape):
    """A flat piece with parallel faces: equal spheres side by side, as thick as the flake."""

    kind: Literal["flake"] = "flake"
    width: Annotated[float, Quantity("", 1.0, MOST_RATIO, "width over thickness")] = 3.0
    elongation: Annotated[float, Quantity("", 1.0, 5.0, "length over width")] = 1.0
    outline: Annotated[
        Literal["round", "rectangle", "irregular"], Doc("'round', 'rectangle' or 'irregular': a random polygon")
    ] = "round"
    spheres: Spheres = 9
    corners: Annotated[int, Whole(3, 64, "corners of an irregular outline")] = 6
    seed: Seed = 1


class Cylinder(Shape):
    """A cylinder with flat ends."""

    kind: Literal["cylinder"] = "cylinder"
    aspect: Annotated[float, Quantity("", 0.04, 25.0, "length over diameter")] = 1.0
    model: Model = "cluster"
    spheres: Spheres = 9
    sides: Sides = 24


class Rod(Shape):
    """A rod with round ends, such as a piece of wire: a chain of equal spheres."""

    kind: Literal["rod"] = "rod"
    aspect: Annotated[float, Quantity("", 1.0, 50.0, "length, ends included, over diameter")] = 4.0
    spheres: Annotated[int, Whole(1, MOST_SPHERES, "spheres; None: a radius apart, or less")] | None = None


class Cone(Shape):
    """A cone with a sharp tip and a flat base."""

    kind: Literal["cone"] = "cone"
    aspect: Annotated[float, Quantity("", 0.05, 20.0, "height over diameter of the base")] = 1.0
    model: Model = "cluster"
    spheres: Spheres = 12
    sides: Sides = 24


class Ellipsoid(Shape):
    """An ellipsoid."""

    kind: Literal["ellipsoid"] = "ellipsoid"
    axes: Annotated[tuple[Edge, Edge, Edge], Doc("the three axes, to each other")] = (2.0, 1.5, 1.0)
    spheres: Spheres = 9

    @model_validator(mode="after")
    def _axes_are_alike(self) -> Ellipsoid:
        _not_too_thin("axes", self.axes)
        return self


class Shaving(Shape):
    """A shaving: a thread wound to a helix, made of a twisted chain of equal spheres. Lengths over its thickness."""

    kind: Literal["shaving"] = "shaving"
    length: Annotated[float, Quantity("", 0.5, 100.0, "length along the thread, without its round ends")] = 12.0
    coil: Annotated[float, Quantity("", 1.05, 100.0, "diameter of the helix that its middle follows")] = 3.0
    pitch: Annotated[float, Quantity("", 0.0, 1000.0, "advance of the helix in one turn")] = 2.0
    spheres: Annotated[int, Whole(2, MOST_SPHERES, "spheres; None: a radius apart, or less")] | None = None

    @model_validator(mode="after")
    def _thread_is_clear_of_itself(self) -> Shaving:
        radius, rise = 0.5 * self.coil, self.pitch / (2.0 * math.pi)
        end = self.length / math.hypot(radius, rise)
        if end < math.pi:
            return self
        # Two points of the thread an angle apart; below half a turn they come no nearer than their arc allows.
        angle = np.arange(math.pi, min(end, 4.0 * math.pi) + 0.01, 0.01)
        nearest = float(np.sqrt(2.0 * radius**2 * (1.0 - np.cos(angle)) + (rise * angle) ** 2).min())
        if nearest < 1.0:
            raise InputError(
                f"is {number(self.pitch)}: turns come within {number(nearest)} thicknesses and would run into each "
                "other; take a larger pitch, or a shorter length",
                path="pitch",
                value=self.pitch,
                allowed="turns at least one thickness apart",
            )
        return self


class Angular(Shape):
    """A random angular grain: the hull of points scattered over an ellipsoid. Convex."""

    kind: Literal["angular"] = "angular"
    corners: Annotated[int, Whole(4, MOST_CORNERS, "points that are scattered")] = 16
    elongation: Annotated[float, Quantity("", 1.0, 5.0, "longest over middle axis of the ellipsoid")] = 1.3
    flatness: Annotated[float, Quantity("", 1.0, 5.0, "middle over shortest axis of the ellipsoid")] = 1.3
    roughness: Annotated[float, Quantity("", 0.0, 1.0, "0: spread evenly; 1: depth and place random by half")] = 0.5
    seed: Seed = 1
    model: Model = "cluster"
    spheres: Spheres = 9


class Hull(Shape):
    """The convex hull of points."""

    kind: Literal["hull"] = "hull"
    points: Annotated[list[Point], BeforeValidator(_rows), Field(min_length=4, max_length=1000), Doc("(n, 3) points")]
    model: Model = "convex"
    spheres: Spheres = 9


SphereRows = Annotated[
    list[tuple[Number, Number, Number, Radius]],
    BeforeValidator(_rows),
    Field(min_length=1, max_length=MOST_SPHERES),
    Doc("(n, 4): centres x, y, z and radii"),
]


class Cluster(Shape):
    """Your own spheres, fixed to each other; where they overlap, what they share counts once."""

    kind: Literal["cluster"] = "cluster"
    spheres: SphereRows

    @model_validator(mode="after")
    def _is_meant(self) -> Cluster:
        _sizes_are_alike(self.spheres)
        return self


class Composite(Shape):
    """A grain that was not liberated: spheres of several materials, fixed to each other.

    What spheres of different materials share belongs to the one that comes first, so a core stands before its cover.
    A composite is fed as a family whose ``material`` is its name, and added by the name in ``scene.shapes``; results
    count it under that name, and its contents in the materials that they are. The rest is in docs/physics.md 2.7.

    Examples
    --------
    >>> end = cesim.Composite(spheres=[(0, 0, 0, 1), (1.5, 0, 0, 1)], materials=["copper", "PVC"])
    """

    kind: Literal["composite"] = "composite"
    spheres: SphereRows
    materials: Annotated[list[str], Field(min_length=1, max_length=MOST_SPHERES), Doc("(n,): material of each sphere")]

    @model_validator(mode="after")
    def _is_whole(self) -> Composite:
        _sizes_are_alike(self.spheres)
        if len(self.materials) != len(self.spheres):
            raise InputError(
                f"has {len(self.materials)} names for {len(self.spheres)} spheres; there must be as many",
                path="materials",
                value=self.materials,
            )
        return self


class ClosedMesh(Shape):
    """The body inside a closed surface of triangles, packed with spheres. `ClosedMesh.read` takes a file.

    A scene file may say `file = "grain.stl"` in place of points and faces; the file is then read from its folder.
    """

    kind: Literal["mesh"] = "mesh"
    points: Annotated[list[Point], BeforeValidator(_rows), Field(max_length=3 * MOST_FACETS), Doc("(n, 3) corners")]
    faces: Annotated[
        list[tuple[int, int, int]],
        BeforeValidator(_rows),
        Field(min_length=4, max_length=MOST_FACETS),
        Doc("(m, 3) corners of each triangle by index, anticlockwise from outside"),
    ]
    model: Model = "cluster"
    spheres: Spheres = 40
    corners: Annotated[int, Whole(4, MOST_CORNERS, "corners of the hull, at most, if convex")] = 64

    @model_validator(mode="after")
    def _surface_is_closed(self) -> ClosedMesh:
        from ..shapes.surface import refuse_open

        refuse_open(np.array(self.points, dtype=np.float64).reshape(-1, 3), np.array(self.faces, dtype=np.int64))
        return self

    @classmethod
    def read(cls, path: str | os.PathLike[str], **fields: Any) -> ClosedMesh:
        """Reads an STL, OBJ or PLY file (needs trimesh: `pip install "cesim[cad]"`).

        Parameters
        ----------
        path : str or path
            Of at most 50 MB and 20 000 triangles; corners nearer than a millionth of the extent become one.
        fields
            The other fields: model, spheres, corners.
        """
        from ..shapes.surface import read

        points, faces = read(path)
        return cls(points=points.tolist(), faces=faces.tolist(), **fields)


AnyShape = Annotated[
    Sphere
    | Box
    | Flake
    | Cylinder
    | Rod
    | Cone
    | Ellipsoid
    | Shaving
    | Angular
    | Hull
    | Cluster
    | Composite
    | ClosedMesh,
    Field(discriminator="kind"),
    Doc("shape of the grains"),
]


def _not_too_thin(name: str, edges: tuple[float, ...]) -> None:
    if max(edges) > MOST_RATIO * min(edges):
        raise InputError(
            f"is {show(edges)}: the longest is more than {number(MOST_RATIO)} times the shortest",
            path=name,
            value=edges,
        )


def _sizes_are_alike(spheres: list[tuple[float, float, float, float]]) -> None:
    block = np.array(spheres)
    least, most = float(block[:, 3].min()), float(np.abs(block).max())
    if least < 1e-4 * most:
        raise InputError(
            f"has a radius of {number(least)} beside lengths of {number(most)}: too small to be meant",
            path="spheres",
            value=least,
            allowed=f"at least {number(1e-4 * most)}",
        )
