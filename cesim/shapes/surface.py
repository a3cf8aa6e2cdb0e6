"""Closed surfaces of triangles: reading them from files, and refusing those that enclose nothing."""

from __future__ import annotations

import os

import numpy as np

from ..errors import InputError, show
from .mass import Array, signed_volume
from .polyhedra import Indices

LARGEST_FILE = 50_000_000  # bytes
MERGED = 1e-6  # of the extent: corners nearer than that are one


def read(path: str | os.PathLike[str]) -> tuple[Array, Indices]:
    """Corners (n, 3) and triangles (m, 3) of an STL, OBJ or PLY file, of which the longest side has length 1."""
    from ..scene.mesh import read_mesh

    name = show(os.path.basename(os.fspath(path)))
    try:
        size = os.path.getsize(path)
    except (OSError, ValueError) as error:
        raise InputError(f"{name} cannot be read: {error}", path="file", value=str(path)) from None
    if size > LARGEST_FILE:
        raise InputError(f"{name} is larger than {LARGEST_FILE // 1_000_000} MB", path="file")
    points, faces = read_mesh(path)
    try:
        return merged(points, faces.astype(np.int64))
    except InputError as error:
        error.path, error.reason = "file", f"{name} {error.reason}"
        raise


def merged(points: Array, faces: Indices) -> tuple[Array, Indices]:
    """Corners that coincide become one; triangles without extent go, and corners that no triangle has."""
    used = points[faces].reshape(-1, 3)
    extent = float(np.ptp(used, axis=0).max())
    if not 0.0 < extent < 1e100:
        raise InputError("has no extent, or an infinite one", path="points")
    cells = np.round((used - used.min(axis=0)) / (MERGED * extent)).astype(np.int64)
    _, first, index = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    triangles = index.reshape(-1, 3)
    a, b, c = triangles.T
    return used[first] / extent, triangles[(a != b) & (b != c) & (c != a)]


def refuse_open(points: Array, faces: Indices) -> None:
    """Raises InputError unless the triangles are the surface of one body, all seen anticlockwise from outside."""
    if faces.min() < 0 or faces.max() >= len(points):
        raise InputError(f"names a corner that is not among the {len(points)} points", path="faces")
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    if (edges[:, 0] == edges[:, 1]).any():
        raise InputError("has a triangle with the same corner twice", path="faces")
    forward = edges[:, 0] * len(points) + edges[:, 1]
    backward = edges[:, 1] * len(points) + edges[:, 0]
    _, counts = np.unique(forward, return_counts=True)
    lonely = int((~np.isin(forward, backward)).sum())
    if lonely:
        raise InputError(
            f"is not closed, or triangles face opposite ways: {lonely} edges have no partner", path="faces"
        )
    if (counts > 1).any():
        raise InputError(f"has {int((counts > 1).sum())} edges where more than two triangles meet", path="faces")
    volumes = _volumes(points, faces)
    if (volumes > 0.0).sum() > 1:
        raise InputError(f"is {int((volumes > 0.0).sum())} separate bodies, must be one", path="faces")
    extent = float(np.ptp(points[faces].reshape(-1, 3), axis=0).max())
    total = float(volumes.sum())
    if total < 0.0:
        raise InputError("is inside out: its triangles are counted clockwise from outside", path="faces")
    if not total > 1e-6 * extent**3:
        raise InputError("encloses no volume, or next to none", path="faces")


def _volumes(points: Array, faces: Indices) -> Array:
    """Of each connected piece of the surface; a cavity counts negative."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a, b = np.concatenate([faces[:, 0], faces[:, 1]]), np.concatenate([faces[:, 1], faces[:, 2]])
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(points), len(points)))
    _, label = connected_components(graph, directed=False)
    pieces = label[faces[:, 0]]
    return np.array([signed_volume(points, faces[pieces == piece]) for piece in np.unique(pieces)])
