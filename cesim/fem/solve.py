"""Laplace's equation, div(permittivity grad V) = 0, by quadratic finite elements that follow the curved outlines.

In two dimensions the elements are triangles of six nodes. In three they are prisms over those triangles, quadratic
along z too: the matrices are sums of Kronecker products of what scikit-fem assembles over the cross-section and along
z,

    K3 = sum over slices of  K2(permittivity) x M1 + M2(permittivity) x K1,

so that the elements of the cross-section stay as curved as the parts are. Everything is symmetric about z = 0: half is
solved.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyamg
import scipy.sparse as sparse
import skfem
from numpy.typing import NDArray
from pyamg.relaxation.relaxation import gauss_seidel
from scipy.sparse.linalg import splu
from skfem.helpers import dot, grad

from ..errors import SimulationError
from .curves import Circle, Curve
from .mesh import Mesh

Array = NDArray[np.float64]
Matrix = sparse.csr_matrix
TOLERANCE = 1e-10  # of the residual, relative
MOST_ITERATIONS = 500


class Plane:
    """Quadratic elements over the cross-section.

    Attributes
    ----------
    nodes : (n, 2) m, the corners first, then the middles of the edges
    elements : (6, m) nodes of each triangle: corners, then middles of the edges 01, 12, 02
    neighbours : (3, m) the triangles beyond those edges, -1: none
    curved : (m,) bool, which triangles have a curved edge
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        straight = skfem.MeshTri1(mesh.points.T.copy(), mesh.triangles.T.copy())
        curved = skfem.MeshTri2.from_mesh(straight)
        straight_places = curved.doflocs
        places = straight_places.copy()
        self.edge_nodes, self.edge_owner = _edges_of(straight, mesh)
        for k, curve in enumerate(mesh.curves):
            mine = self.edge_nodes[self.edge_owner == k]
            if isinstance(curve, Circle) and len(mine):
                places[:, mine] = curve.project(places[:, mine].T).T
        self.skfem_mesh = skfem.MeshTri2(places, curved.t)
        self.basis = skfem.Basis(self.skfem_mesh, skfem.ElementTriP2(), intorder=4)
        self.nodes: Array = places.T
        self.elements: NDArray[np.int64] = self.basis.element_dofs
        self.neighbours = _neighbours(straight)
        bent = np.zeros(len(self.nodes), bool)
        bent[self.edge_nodes] = np.hypot(*(places - straight_places)[:, self.edge_nodes]) > 0.0
        self.curved: NDArray[np.bool_] = bent[self.elements].any(axis=0)

    def matrices(self, permittivity: Array) -> tuple[Matrix, Matrix]:
        """Stiffness and mass matrix weighted with a permittivity per triangle (m,)."""
        weight = np.broadcast_to(permittivity[:, None], self.basis.dx.shape)
        return _stiffness.assemble(self.basis, c=weight), _mass.assemble(self.basis, c=weight)

    def mass_of(self, weight: Callable[[Array], Array]) -> Matrix:
        """Mass matrix with a weight at (2, ...) m."""
        return sparse.csr_matrix(_mass.assemble(self.basis, c=weight(np.asarray(self.basis.global_coordinates()))))

    def rim_mass(self) -> Matrix:
        """Mass matrix along the outer outline."""
        rim = len(self.mesh.curves) - 1
        facets = self.edge_nodes[self.edge_owner == rim] - len(self.mesh.points)
        basis = skfem.FacetBasis(self.skfem_mesh, skfem.ElementTriP2(), facets=facets, intorder=4)
        return sparse.csr_matrix(_mass.assemble(basis, c=np.ones(basis.dx.shape)))

    def linear(self) -> Matrix:
        """Values at the nodes of the functions of linear elements: (n, corners)."""
        n = len(self.mesh.points)
        middles = np.unique(np.column_stack([self.elements[3:].ravel(), *self._ends()]), axis=0)
        rows = np.concatenate([np.arange(n), np.repeat(middles[:, 0], 2)])
        columns = np.concatenate([np.arange(n), middles[:, 1:].ravel()])
        weight = np.concatenate([np.ones(n), np.full(2 * len(middles), 0.5)])
        return sparse.csr_matrix((weight, (rows, columns)), (len(self.nodes), n))

    def _ends(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The corners between which the middles of the edges of each element lie, in ascending order."""
        a, b = self.elements[[0, 1, 0]].ravel(), self.elements[[1, 2, 2]].ravel()
        return np.minimum(a, b), np.maximum(a, b)

    def within(self, curve: Curve) -> NDArray[np.bool_]:
        """Which nodes lie in or on an outline: (n,) bool."""
        return np.asarray(curve.signed(self.nodes) < 1e-9 * curve.size)

    def on_rim(self) -> NDArray[np.bool_]:
        """Which nodes lie on the outer outline: (n,) bool."""
        rim = len(self.mesh.curves) - 1
        on = np.zeros(len(self.nodes), bool)
        on[self.mesh.segments[self.mesh.owner == rim].ravel()] = True
        on[self.edge_nodes[self.edge_owner == rim]] = True
        return on


class Line:
    """Quadratic elements along z.

    Attributes
    ----------
    ends : (k,) m, borders of the elements, ascending from 0
    nodes : (2 k - 1,) m, ascending
    """

    def __init__(self, ends: Array) -> None:
        self.ends = ends
        self.nodes: Array = np.sort(np.concatenate([ends, 0.5 * (ends[1:] + ends[:-1])]))
        cells = np.arange(len(ends) - 1)
        mesh = skfem.MeshLine1(ends[None], np.array([cells, cells + 1]))
        self.basis = skfem.Basis(mesh, skfem.ElementLineP2(), intorder=4)
        self.order = np.argsort(self.basis.doflocs[0])  # scikit-fem counts the ends first, then the middles

    def matrices(self, weight: Array | Callable[[Array], Array]) -> tuple[Matrix, Matrix]:
        """Stiffness and mass matrix with a weight per element (k - 1,), or at (1, ...) m."""
        if callable(weight):
            factor = weight(np.asarray(self.basis.global_coordinates()))
        else:
            factor = np.broadcast_to(weight[:, None], self.basis.dx.shape)
        pick = np.ix_(self.order, self.order)
        stiffness, mass = (form.assemble(self.basis, c=factor)[pick] for form in (_stiffness, _mass))
        return sparse.csr_matrix(stiffness), sparse.csr_matrix(mass)

    def linear(self) -> Matrix:
        """Values at the nodes of the functions of linear elements: (n, ends)."""
        n = len(self.ends)
        k = np.arange(n - 1)
        rows = np.concatenate([2 * np.arange(n), 2 * k + 1, 2 * k + 1])
        weight = np.concatenate([np.ones(n), np.full(2 * n - 2, 0.5)])
        return sparse.csr_matrix((weight, (rows, np.concatenate([np.arange(n), k, k + 1]))), (len(self.nodes), n))


def _stiffness_form(u: Any, v: Any, w: Any) -> Any:
    return w["c"] * dot(grad(u), grad(v))


def _mass_form(u: Any, v: Any, w: Any) -> Any:
    return w["c"] * u * v


_stiffness, _mass = skfem.BilinearForm(_stiffness_form), skfem.BilinearForm(_mass_form)


def _edges_of(straight: Any, mesh: Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The nodes in the middle of the edges that lie on outlines, and whose outlines they are."""
    n = len(mesh.points)
    keys = np.sort(straight.facets, axis=0)
    known = keys[0].astype(np.int64) * n + keys[1]
    order = np.argsort(known)
    wanted = np.sort(mesh.segments, axis=1)
    wanted = wanted[:, 0] * n + wanted[:, 1]
    found = np.minimum(np.searchsorted(known[order], wanted), len(known) - 1)
    there = known[order][found] == wanted
    return n + order[found[there]], mesh.owner[there]


def _neighbours(straight: Any) -> NDArray[np.int64]:
    """The triangle beyond the edges 01, 12, 02 of each triangle, -1: none. (3, m)."""
    both = straight.f2t[:, straight.t2f]
    own = np.arange(straight.t.shape[1])[None]
    return np.asarray(np.where(both[0] == own, both[1], both[0]))


# ---- systems -------------------------------------------------------------------------------------------------------


def solve_directly(matrix: Matrix, known: NDArray[np.bool_], given: Array) -> Array:
    """Values at all nodes from those at the known ones, by factors.

    Parameters
    ----------
    matrix : (n, n) of Laplace's equation
    known : (n,) bool
    given : (sets, n) values, 0 where they are not known
    """
    free = ~known
    values = given.copy()
    factors = splu(sparse.csc_matrix(matrix[free][:, free]))
    for row in values:
        row[free] = factors.solve(-(matrix[free] @ row))
    return values


def solve_by_gradients(
    matrix: Matrix, linear: Matrix, known: NDArray[np.bool_], given: Array, tick: Callable[[], Any]
) -> tuple[Array, tuple[int, ...]]:
    """The same by conjugate gradients, and the iterations of each set.

    The preconditioner is a cycle of two levels: a sweep of Gauss-Seidel, linear elements on the same mesh by smoothed
    aggregation, a sweep back.

    Parameters
    ----------
    linear : (n, m) values of the m linear elements' functions at the nodes
    tick : called at every iteration
    """
    free = np.flatnonzero(~known)
    inner = sparse.csr_matrix(matrix[free][:, free])
    corners = np.flatnonzero(np.asarray(abs(linear[known]).sum(axis=0)).ravel() == 0.0)
    prolong = sparse.csr_matrix(linear[free][:, corners])
    restrict = sparse.csr_matrix(prolong.T)
    coarse = pyamg.smoothed_aggregation_solver(restrict @ inner @ prolong, coarse_solver="splu", max_coarse=300)
    coarse_cycle = coarse.aspreconditioner(cycle="V").matvec

    def cycle(right: Array) -> Array:
        x = np.zeros_like(right)
        gauss_seidel(inner, x, right, sweep="forward")
        x += prolong @ coarse_cycle(restrict @ (right - inner @ x))
        gauss_seidel(inner, x, right, sweep="backward")
        return x

    values = given.copy()
    iterations = []
    for row in values:
        row[free], count = _conjugate_gradients(inner, -(matrix[free] @ row), cycle, tick)
        iterations.append(count)
    return values, tuple(iterations)


def _conjugate_gradients(
    matrix: Matrix, right: Array, precondition: Callable[[Array], Array], tick: Callable[[], Any]
) -> tuple[Array, int]:
    """Hestenes & Stiefel, J. Res. NBS 49 (1952) 409. Sums by einsum: a BLAS's threads would wait for each other."""
    x, r = np.zeros_like(right), right.copy()
    z = precondition(r)
    p, rz = z, _dot(r, z)
    enough = TOLERANCE**2 * _dot(right, right)
    for count in range(MOST_ITERATIONS):
        if _dot(r, r) <= enough:
            return x, count
        q = matrix @ p
        alpha = rz / _dot(p, q)
        x = x + alpha * p
        r = r - alpha * q
        z = precondition(r)
        rz, before = _dot(r, z), rz
        p = z + (rz / before) * p
        tick()
    raise SimulationError(f"the finite elements were not solved in {MOST_ITERATIONS} iterations")


def _dot(a: Array, b: Array) -> float:
    return float(np.einsum("i,i->", a, b))
