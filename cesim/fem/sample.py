"""The values of a solution at given points: sparse matrices from nodes to points."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .solve import Line, Matrix, Plane

Array = NDArray[np.float64]
NEWTON = 8  # steps, which double the digits
CANDIDATES = (3, 12, 200)  # triangles tried, those with the nearest middles
HOPS = 3  # over an edge, where a curved one was taken for straight


def shape_functions(x: Array, y: Array) -> tuple[Array, Array]:
    """The six functions of a quadratic triangle at (n,) places, (6, n), and their derivatives, (2, 6, n).

    Corners (0, 0), (1, 0), (0, 1), then the middles of the edges 01, 12, 02.
    """
    o = 1.0 - x - y
    value = np.array([o * (2 * o - 1), x * (2 * x - 1), y * (2 * y - 1), 4 * o * x, 4 * x * y, 4 * o * y])
    zero = np.zeros_like(x)
    along_x = np.array([1 - 4 * o, 4 * x - 1, zero, 4 * (o - x), 4 * y, -4 * y])
    along_y = np.array([1 - 4 * o, zero, 4 * y - 1, -4 * x, 4 * x, 4 * (o - y)])
    return value, np.array([along_x, along_y])


def in_plane(plane: Plane, points: Array) -> tuple[Matrix, NDArray[np.bool_]]:
    """Matrix from the nodes of a cross-section to points (n, 2) m, and which of these lie in the mesh: (n,) bool."""
    element = find_triangles(plane, points)
    found = element >= 0
    element, place = _invert(plane, element[found], points[found])
    value, _ = shape_functions(*place)
    return _matrix(plane, value, element, found), found


def slopes_in_plane(plane: Plane, points: Array) -> tuple[Matrix, Matrix]:
    """Matrices from the nodes to the derivatives along x and y at points (n, 2) m that lie in the mesh."""
    element = find_triangles(plane, points)
    if (element < 0).any():
        raise ValueError("points outside the mesh")
    element, place = _invert(plane, element, points)
    _, slope = shape_functions(*place)
    jacobian = np.einsum("ekn,knd->nde", slope, plane.nodes[plane.elements[:, element]])
    along = np.einsum("ned,ekn->dkn", np.linalg.inv(jacobian), slope)
    everywhere = np.ones(len(points), bool)
    return _matrix(plane, along[0], element, everywhere), _matrix(plane, along[1], element, everywhere)


def _matrix(plane: Plane, weight: Array, element: NDArray[np.int64], found: NDArray[np.bool_]) -> Matrix:
    rows = np.broadcast_to(np.flatnonzero(found), weight.shape)
    columns = plane.elements[:, element]
    return sparse.csr_matrix((weight.ravel(), (rows.ravel(), columns.ravel())), (len(found), len(plane.nodes)))


def find_triangles(plane: Plane, points: Array) -> NDArray[np.int64]:
    """The straight triangle around each point (n, 2) m, -1: none. (n,)."""
    corners = plane.mesh.points[plane.mesh.triangles]
    origin = corners[:, 0]
    inverse = np.linalg.inv(np.stack([corners[:, 1] - origin, corners[:, 2] - origin], axis=2))
    tree = cKDTree(corners.mean(axis=1))
    found = np.full(len(points), -1)
    todo = np.arange(len(points))
    for count in CANDIDATES:  # a large triangle beside small ones is not the nearest
        if not len(todo):
            break
        near = np.asarray(tree.query(points[todo], k=np.arange(1, min(count, len(origin)) + 1))[1])
        for column in range(near.shape[1]):
            open_ = found[todo] < 0
            rows = todo[open_]
            mine = near[open_, column]
            place = np.einsum("nij,nj->ni", inverse[mine], points[rows] - origin[mine])
            inside = np.minimum(place.min(axis=1), 1.0 - place.sum(axis=1)) >= -1e-9
            found[rows[inside]] = mine[inside]
        todo = todo[found[todo] < 0]
    return found


def _invert(plane: Plane, element: NDArray[np.int64], points: Array) -> tuple[NDArray[np.int64], Array]:
    """Elements (n,) and places in them (2, n) of points near them, over an edge to the next where it is curved."""
    element = element.copy()
    a, b, c = plane.nodes[plane.elements[:3, element]]
    (ux, uy), (vx, vy), (x, y) = (b - a).T, (c - a).T, (points - a).T
    place = np.array([x * vy - y * vx, ux * y - uy * x]) / (ux * vy - uy * vx)  # exact where the sides are straight
    todo = np.flatnonzero(plane.curved[element])
    for _ in range(HOPS if len(todo) else 0):
        nodes = plane.nodes[plane.elements[:, element[todo]]]  # (6, n, 2)
        at = np.full((2, len(todo)), 1.0 / 3.0)
        for _ in range(NEWTON):
            value, slope = shape_functions(*at)
            off = points[todo].T - np.einsum("kn,knd->dn", value, nodes)
            jacobian = np.einsum("ekn,knd->nde", slope, nodes)
            at = at + np.linalg.solve(jacobian, off.T[..., None])[..., 0].T
        place[:, todo] = at
        beyond = np.array([at[1], 1.0 - at.sum(axis=0), at[0]])  # of the edges 01, 12, 02: negative when crossed
        edge = beyond.argmin(axis=0)
        next_element = plane.neighbours[edge, element[todo]]
        hop = (beyond.min(axis=0) < -1e-9) & (next_element >= 0)
        todo = todo[hop]
        if not len(todo):
            break
        element[todo] = next_element[hop]
    return element, place


def on_line(line: Line, z: Array) -> tuple[Matrix, Matrix]:
    """Matrices from the nodes along z to values and derivatives at places (n,) m, mirrored at 0.

    Beyond the last node the value is that of the last.
    """
    far = np.minimum(np.abs(z), line.ends[-1])
    cell = np.clip(np.searchsorted(line.ends, far, side="right") - 1, 0, len(line.ends) - 2)
    width = line.ends[cell + 1] - line.ends[cell]
    t = (far - line.ends[cell]) / width
    value = np.array([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
    slope = np.sign(z) / width * np.array([4 * t - 3, 4 - 8 * t, 4 * t - 1])
    place = np.broadcast_to(np.arange(len(z)), value.shape).ravel(), (2 * cell + np.arange(3)[:, None]).ravel()
    shape = (len(z), len(line.nodes))
    return sparse.csr_matrix((value.ravel(), place), shape), sparse.csr_matrix((slope.ravel(), place), shape)
