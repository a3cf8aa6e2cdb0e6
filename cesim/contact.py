"""A contact problem by itself: cones, a matrix and a vector in, impulses out.

>>> import numpy as np, cesim
>>> answer = cesim.contact.solve(np.eye(3), [-1.0, 0.3, 0.0], mu=0.5)  # a block that lands and sticks
>>> answer.converged, answer.impulse
(True, array([ 1. , -0.3,  0. ]))
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from . import engine
from .errors import InputError, engine_errors, show, unknown

Array = NDArray[np.float64]
LAWS = ("coulomb", "ccp")
SYMMETRY = 1e-10  # of the largest entry of W: what a product H' M^-1 H may be off by rounding


@dataclass(frozen=True)
class Solution:
    """What a solver found, and how well.

    Attributes
    ----------
    impulse, velocity : (3n,) N s and m/s, rows (N, T1, T2) per contact; velocity = W impulse + q.
    residual : float
        m/s, the largest |γ - P(γ - ρ û)|/ρ of a contact, ρ = 3/tr W_ii; independent of units (docs/numerics.md 2).
    natural_map : float
        |γ - P(γ - û)|/|q|, the error that the FCLib collection uses.
    iterations : int
        Sweeps, gradient steps or Newton steps, whichever the solver makes.
    converged : bool
        Whether the tolerance was reached; never assumed.
    solver : str
        The one that gave the answer; with "auto", the one it chose.
    objective : float
        J, γ W γ/2 + q γ.
    seconds : float
        Wall time of the solver.
    """

    impulse: Array
    velocity: Array
    residual: float
    natural_map: float
    iterations: int
    converged: bool
    solver: str
    objective: float
    seconds: float


@dataclass(frozen=True)
class Problem:
    """A contact problem of the Frictional Contact Library.

    Attributes
    ----------
    W : (3n, 3n) sparse, 1/kg
    q : (3n,) m/s
    mu : (n,)
    velocity : (3n,) m/s, or None
        What the file gives as its solution.
    """

    W: sparse.csr_array[Any]
    q: Array
    mu: Array
    velocity: Array | None


def read_fclib(path: str | Path) -> Problem:
    """Reads a local or a global problem from an HDF5 file of the Frictional Contact Library.

    A global one is brought to the local form, W = H' M⁻¹ H and q = H' M⁻¹ f + w.
    """
    import h5py

    try:
        with h5py.File(path) as file:
            velocity = file["solution/u"][()].ravel() if "solution/u" in file else None
            if "fclib_local" in file:
                group = file["fclib_local"]
                W, q = _fclib_matrix(group["W"]), group["vectors/q"][()].ravel()
            else:
                group = file["fclib_global"]
                M, H = _fclib_matrix(group["M"]), _fclib_matrix(group["H"])
                force = group["vectors/f"][()].ravel()
                answer = spsolve(M.tocsc(), sparse.csc_array(sparse.hstack([H, force[:, None]])))
                local = sparse.csr_array(H.T @ answer)
                W, q = local[:, :-1], local[:, [-1]].toarray().ravel() + group["vectors/w"][()].ravel()
            mu = group["vectors/mu"][()].ravel()
    except (OSError, KeyError) as error:
        raise InputError(f"{path} is no problem of FCLib: {error}", path="path", value=str(path)) from error
    return Problem(sparse.csr_array(0.5 * (W + W.T)), q, mu, velocity)


def _fclib_matrix(group: Any) -> Any:
    """nz says how it stands: a number of triplets, -1 for compressed columns, -2 for compressed rows."""
    rows, columns, entries = (int(np.ravel(group[name][()])[0]) for name in ("m", "n", "nz"))
    p, i, x = group["p"][()], group["i"][()], group["x"][()]
    if entries >= 0:
        triplets = (x[:entries], (i[:entries], p[:entries]))
        return sparse.csr_array(sparse.coo_array(triplets, shape=(rows, columns)))
    if entries == -1:
        return sparse.csr_array(sparse.csc_array((x, i, p), shape=(rows, columns)))
    return sparse.csr_array((x, i, p), shape=(rows, columns))


def solvers() -> dict[str, str]:
    """Names of the solvers, and what each does."""
    return {row["name"]: row["doc"] for row in engine.contact_solvers()}


def solve(
    W: Any,
    q: ArrayLike,
    mu: ArrayLike,
    law: str = "coulomb",
    solver: str = "auto",
    tolerance: float = 1e-8,
    max_iterations: int = 10_000,
    *,
    impulse: ArrayLike | None = None,
) -> Solution:
    """Solves a frictional contact problem: u = W γ + q, K ∋ γ ⟂ û ∈ K*.

    Parameters
    ----------
    W : (3n, 3n) dense or scipy.sparse, 1/kg
        Symmetric, positive semi-definite, with rows (N, T1, T2) per contact.
    q : (3n,) m/s
        Velocity of the contacts without impulses.
    mu : (n,) or a number
        Coefficients of friction, K = {|γ_T| ≤ µ γ_N}.
    law : "coulomb" or "ccp"
        û = u + (µ|u_T|, 0, 0), or û = u (the convex relaxation).
    solver : str
        One of `cesim.contact.solvers()`.
    tolerance : float
        Relative: solved when residual ≤ tolerance |q|/√n max(1, ρ), with ρ the largest of the contacts in kg. Then
        `natural_map` is at most the tolerance as well.
    max_iterations : int
        Running out is told by `converged`.
    impulse : (3n,) N s, optional
        Where to start; taken only if it is better than nothing.

    Raises
    ------
    InputError
        Where an argument cannot be used.
    """
    matrix = _matrix(W)
    count = matrix.shape[0] // 3
    q_array = _vector("q", q, 3 * count)
    friction = _friction(mu, count)
    start = np.zeros(3 * count) if impulse is None else _vector("impulse", impulse, 3 * count)
    if law not in LAWS:
        raise unknown("law", law, LAWS).at("law")
    if solver not in solvers():
        raise unknown("solver", solver, solvers()).at("solver")
    tolerance = _tolerance(tolerance)
    limit = _whole("max_iterations", max_iterations, 2**32 - 1)
    steps = 3.0 / matrix.diagonal().reshape(count, 3).sum(axis=1)
    largest = float(abs(q_array).max(initial=0.0))
    norm = largest * float(np.linalg.norm(q_array / (largest or 1.0)))  # which does not overflow
    speed = norm / math.sqrt(max(count, 1)) / max(1.0, steps.max(initial=0.0))
    unbounded = np.full(3 * count, np.inf)
    limits = np.column_stack([friction, np.zeros((count, 2))])
    rows = np.full(count, 3, dtype=np.int32)
    began = time.perf_counter()
    with engine_errors():
        answer = engine.solve_cone(
            row_start=matrix.indptr.astype(np.int64),
            column=matrix.indices.astype(np.int32),
            value=matrix.data,
            q=q_array,
            rows=rows,
            limits=limits,
            least=-unbounded,
            most=unbounded,
            start=start,
            law=law,
            solver=solver,
            tolerance=tolerance * speed,
            max_iterations=limit,
        )
    return Solution(seconds=time.perf_counter() - began, **answer)


def _matrix(source: Any) -> sparse.csr_array[Any]:
    """W as compressed rows, checked."""
    try:
        matrix: sparse.csr_array[Any] = (
            sparse.csr_array(cast(Any, source)) if sparse.issparse(source) else _dense(source)
        )
    except InputError:
        raise
    except (TypeError, ValueError) as error:
        raise InputError(f"is {show(source)}, no matrix of numbers", path="W", value=source) from error
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.shape[0] % 3:
        raise InputError(
            f"has the shape {matrix.shape}, must be (3n, 3n)", path="W", value=matrix.shape, allowed="(3n, 3n)"
        )
    if matrix.dtype.kind not in "fiu":
        raise InputError(f"holds {matrix.dtype}, must hold real numbers", path="W", value=matrix.dtype)
    matrix = matrix.astype(np.float64)
    matrix.sum_duplicates()
    if not np.isfinite(matrix.data).all():
        raise InputError("holds a number that is not finite", path="W", value=np.nan, allowed="finite")
    if not (matrix.diagonal() > 0).all():
        worst = float(matrix.diagonal().min())
        raise InputError(
            f"has {worst:g} on its diagonal, must be above 0", path="W", value=worst, unit="1/kg", allowed="> 0"
        )
    skew = float(abs(matrix - matrix.T).max()) if matrix.nnz else 0.0
    if skew > SYMMETRY * float(abs(matrix).max() if matrix.nnz else 0.0):
        raise InputError(f"differs from its transpose by {skew:g}, must be symmetric", path="W", value=skew)
    return matrix


def _dense(source: Any) -> sparse.csr_array[Any]:
    array: Any = np.asarray(source)
    if array.ndim != 2:
        raise InputError(f"has the shape {array.shape}, must be (3n, 3n)", path="W", value=array.shape)
    return sparse.csr_array(array)


def _numbers(path: str, source: ArrayLike) -> Array:
    try:
        array = np.asarray(source)
        if array.dtype.kind not in "fiu":
            raise TypeError
        array = array.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"is {show(source)}, must be real numbers", path=path, value=source) from error
    if not np.isfinite(array).all():
        raise InputError("holds a number that is not finite", path=path, value=np.nan, allowed="finite")
    return array


def _vector(path: str, source: ArrayLike, length: int) -> Array:
    array = _numbers(path, source)
    if array.shape != (length,):
        raise InputError(
            f"has the shape {array.shape}, must be ({length},)", path=path, value=array.shape, allowed=f"({length},)"
        )
    return array


def _friction(mu: ArrayLike, count: int) -> Array:
    array = _numbers("mu", mu)
    if array.shape not in ((), (count,)):
        raise InputError(f"has the shape {array.shape}, must be a number or ({count},)", path="mu", value=array.shape)
    if array.size and array.min() < 0:
        raise InputError(f"is {array.min():g}, below 0", path="mu", value=float(array.min()), allowed=">= 0")
    return np.broadcast_to(array, (count,)).copy()


def _tolerance(value: float) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not 0 <= value < math.inf:
        raise InputError(f"is {show(value)}, must be a number from 0", path="tolerance", value=value, allowed=">= 0")
    return float(value)


def _whole(path: str, value: int, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not 1 <= value <= most:
        raise InputError(
            f"is {show(value)}, must be a whole number from 1 to {most}", path=path, value=value, allowed=f"1..{most}"
        )
    return int(value)
