"""Triangle meshes for tests, as vertices (n, 3) and triangles (m, 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Shape = tuple[NDArray[np.float64], NDArray[np.uint32]]


def grid(n: int, m: int, close: bool = False) -> NDArray[np.uint32]:
    """Triangles over n x m cells of (n + 1) x (m + 1) vertices; closed: the last row is the first."""
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    after = (i + 1) % n if close else i + 1
    a, b, c, d = (row * (m + 1) + column for row, column in ((i, j), (i, j + 1), (after, j + 1), (after, j)))
    return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]).astype("u4")


def sheet(n: int, size: float) -> Shape:
    """A square in the xz plane, n x n cells."""
    line = np.linspace(-0.5 * size, 0.5 * size, n + 1)
    x, z = np.meshgrid(line, line, indexing="ij")
    return np.stack([x, np.zeros_like(x), z], -1).reshape(-1, 3), grid(n, n)


def scattered_sheet(points: int, size: float, seed: int = 1) -> Shape:
    """The same square with triangles of all sizes and forms (Delaunay's, of random points)."""
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(seed)
    edge = np.linspace(-0.5, 0.5, 11)
    rim = [np.column_stack([edge, np.full(11, s)]) for s in (-0.5, 0.5)]
    flat = size * np.concatenate([*rim, *(r[:, ::-1] for r in rim), rng.uniform(-0.5, 0.5, (points, 2))])
    flat = np.unique(flat, axis=0)
    return np.column_stack([flat[:, 0], np.zeros(len(flat)), flat[:, 1]]), Delaunay(flat).simplices.astype("u4")


def tube(radius: float, length: float, around: int, along: int = 4) -> Shape:
    """An open cylinder about z; its corners lie at the radius."""
    angle = 2.0 * np.pi * np.arange(around) / around
    a, z = np.meshgrid(angle, np.linspace(-0.5 * length, 0.5 * length, along + 1), indexing="ij")
    vertices = np.stack([radius * np.cos(a), radius * np.sin(a), z], -1).reshape(-1, 3)
    return vertices, grid(around, along, close=True)


def box(edges: tuple[float, float, float]) -> Shape:
    """A closed box round the origin, two triangles a face."""
    vertices = 0.5 * np.array(edges) * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))], dtype=np.uint32)


def soup(rng: np.random.Generator, count: int, size: float = 0.3) -> Shape:
    """Triangles at random that share nothing."""
    corners = rng.uniform(-1.0, 1.0, (count, 1, 3)) + size * rng.normal(size=(count, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)


def distances(vertices: NDArray[np.float64], triangles: NDArray[np.uint32], points: NDArray[np.float64]):
    """(points, triangles): by plane and edges, each in its own way; not the way of the engine."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    result = np.full((len(points), len(triangles)), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        along = q - p
        share = np.einsum("ntk,tk->nt", points[:, None] - p, along) / np.square(along).sum(axis=1)
        nearest = p + np.clip(share, 0.0, 1.0)[..., None] * along
        result = np.minimum(result, np.linalg.norm(points[:, None] - nearest, axis=-1))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.einsum("ntk,tk->nt", points[:, None] - a, normal)
    foot = points[:, None] - height[..., None] * normal
    inside = np.ones_like(height, dtype=bool)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("ntk,tk->nt", foot - p, np.cross(normal, q - p)) >= 0.0
    return np.where(inside, np.abs(height), result)
