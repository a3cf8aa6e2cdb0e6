"""Contact problems for the tests of the solvers, and what an answer must fulfil, independently of the engine."""

import numpy as np
from scipy import sparse

import cesim
from cesim import engine

SOLVERS = ("auto", "pgs", "apgs", "apgd", "spg", "jacobi", "direct")
LAWS = ("coulomb", "ccp")


def random_problem(rng, contacts, bodies, friction=0.3):
    """Contacts between random bodies of six coordinates and the ground; W has full rank where bodies are many."""
    D = np.zeros((3 * contacts, 6 * bodies))
    for i in range(contacts):
        for body in rng.choice(bodies, size=min(2, bodies), replace=False):
            D[3 * i : 3 * i + 3, 6 * body : 6 * body + 6] = rng.normal(size=(3, 6))
    mass = np.repeat(rng.uniform(0.5, 2.0, bodies), 6)
    W = D / mass @ D.T
    return 0.5 * (W + W.T), rng.normal(size=3 * contacts), np.full(contacts, friction)


def column(count, top_mass=1.0, opening=0):
    """Spheres of 1 kg and 1 m on each other and on the ground, the top one heavier, after 1 ms of gravity.

    The normal impulses are known: what each contact carries. Behind these contacts so many more may stand, of spheres
    that leave a wall at 1 m/s, which carry nothing.
    """
    rng = np.random.default_rng(3)
    contacts = count + opening
    D = np.zeros((3 * contacts, 6 * count))
    for i in range(contacts):  # contact i is below sphere i
        frame = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], float)  # N, T1, T2
        bodies = ((i, 1.0), (i - 1, -1.0))
        if i >= count:
            frame = np.linalg.qr(rng.normal(size=(3, 3)))[0].T
            bodies = ((rng.integers(count), 1.0),)
        for body, sign in bodies:
            if body >= 0:
                D[3 * i : 3 * i + 3, 6 * body : 6 * body + 3] = sign * frame
                arm = -0.5 * sign * frame[0]
                D[3 * i : 3 * i + 3, 6 * body + 3 : 6 * body + 6] = sign * np.cross(arm, frame)
    mass = np.ones(count)
    mass[-1] = top_mass
    inverse = np.concatenate([[1 / m] * 3 + [1 / (0.1 * m)] * 3 for m in mass])
    gravity = np.zeros(6 * count)
    gravity[1::6] = -9.81e-3
    load = 9.81e-3 * np.cumsum(mass[::-1])[::-1]
    q = D @ gravity
    q[3 * count :: 3] = 1.0
    return D * inverse @ D.T, q, np.full(contacts, 0.5), np.r_[load, np.zeros(opening)]


def box_stack(boxes, push=0.0):
    """Unit cubes of 1 kg on each other, four contacts a face: hyperstatic, W has half its rank. push: m/s along x."""
    D = np.zeros((12 * boxes, 6 * boxes))
    frame = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], float)
    for i in range(boxes):
        for corner, (x, z) in enumerate([(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)]):
            row = 12 * i + 3 * corner
            for body, sign in ((i, 1.0), (i - 1, -1.0)):
                if body >= 0:
                    D[row : row + 3, 6 * body : 6 * body + 3] = sign * frame
                    arm = np.array([x, -0.5 * sign, z])
                    D[row : row + 3, 6 * body + 3 : 6 * body + 6] = sign * np.cross(arm, frame)
    inverse = np.tile([1, 1, 1, 6, 6, 6], boxes)
    free = np.zeros(6 * boxes)
    free[1::6] = -9.81e-3
    free[0::6] = push
    return D * inverse @ D.T, D @ free, np.full(4 * boxes, 0.5)


# ---- what an answer must fulfil --------------------------------------------------------------------------------------


def project(mu, p):
    """The nearest point of the friction cone, by its three cases."""
    normal, length = p[0], np.hypot(p[1], p[2])
    if normal >= 0 and length <= mu * normal:
        return p.copy()
    if mu * length <= -normal:
        return np.zeros(3)
    push = (normal + mu * length) / (1 + mu**2)
    return np.array([push, mu * push * p[1] / length, mu * push * p[2] / length])


def residual(W, q, mu, law, impulse):
    """m/s, docs/numerics.md 2."""
    W = W.toarray() if sparse.issparse(W) else W
    u = (W @ impulse + q).reshape(-1, 3)
    worst = 0.0
    for i, gamma in enumerate(np.reshape(impulse, (-1, 3))):
        rho = 3 / np.trace(W[3 * i : 3 * i + 3, 3 * i : 3 * i + 3])
        lifted = u[i] + [mu[i] * np.hypot(*u[i, 1:]) if law == "coulomb" else 0.0, 0.0, 0.0]
        worst = max(worst, np.linalg.norm(gamma - project(mu[i], gamma - rho * lifted)) / rho)
    return worst


def natural_map(W, q, mu, law, impulse):
    """The error of FCLib."""
    u = (W @ impulse + q).reshape(-1, 3)
    error = 0.0
    for i, gamma in enumerate(np.reshape(impulse, (-1, 3))):
        lifted = u[i] + [mu[i] * np.hypot(*u[i, 1:]) if law == "coulomb" else 0.0, 0.0, 0.0]
        error += np.sum((gamma - project(mu[i], gamma - lifted)) ** 2)
    return np.sqrt(error) / np.linalg.norm(q)


def solve_blocks(
    W,
    q,
    rows,
    limits,
    law="coulomb",
    solver="auto",
    least=None,
    most=None,
    tolerance=1e-12,
    start=None,
    iterations=50_000,
):
    """A problem with blocks of any kind, by the engine's own function."""
    matrix = sparse.csr_array(W)
    unbounded = np.full(len(q), np.inf)
    return engine.solve_cone(
        row_start=matrix.indptr.astype(np.int64),
        column=matrix.indices.astype(np.int32),
        value=matrix.data,
        q=np.asarray(q, float),
        rows=np.asarray(rows, np.int32),
        limits=np.asarray(limits, float),
        least=-unbounded if least is None else np.asarray(least, float),
        most=unbounded if most is None else np.asarray(most, float),
        start=np.zeros(len(q)) if start is None else start,
        law=law,
        solver=solver,
        tolerance=tolerance,
        max_iterations=iterations,
    )


def solve(*arguments, **options):
    return cesim.contact.solve(*arguments, **options)


# A flake of five spheres falls flat on a vibrating plate, five points where three bear it: the lower triangle of W in
# 1/kg, row by row, and q in m/s, to five digits. Sweeps all but stop at 3e-5 m/s, and Newton's steps circle.
FLAT_FALL = (
    """
    5.8635e6 -8481.8 6.8687e6 61469 4.0221e5 3.784e6 1.8126e6 7707.8 -55264 5.4553e6 -2.6304e5 1.1976e6 -3.3257e5
    2.3756e5 9.6951e6 2.0612e6 -3.3408e5 3.7482e6 -1.8534e6 5.0733e5 5.8203e6 5.1187e6 -5705.2 39981 2.4823e6
    -1.7354e5 1.3412e6 4.634e6 -3.3301e5 6.122e6 2.9693e5 3.0084e5 6.5431e6 32981 -2.1989e5 1.1292e7 2.6008e6
    2.9822e5 3.8451e6 -2.3386e6 32973 6.2893e6 1.6923e6 5.5841e5 7.0259e6 2.292e6 5958.9 -41428 5.0242e6 1.8044e5
    -1.3898e6 2.7944e6 2.2868e5 -1.7537e6 4.7009e6 -698.98 1.6213e6 -2.7054e5 600.18 5.5262e6 2.3019e5 -389.77
    2.2356e6 -1.9396e5 387.6 5.1507e6 8740.3 -2.7317e5 3.6958e6 -7863.3 2.314e5 3.7689e6 5696.7 -1.9499e5 3.7163e6
    -5905.9 1.8388e5 3.7545e6 2.632e6 4216.5 -31679 4.7185e6 1.3355e5 -1.0619e6 3.0156e6 1.6892e5 -1.3399e6
    4.4716e6 413.51 -4494.8 4.2964e6 -5.1208e5 2.6651e6 -1.5168e5 4.6254e5 1.207e7 5.6693e5 -3.3798e5 1.1968e7
    4.2096e5 3.5144e5 4.6242e6 1.1356e5 2.5988e5 1.8364e7 4.0068e6 -1.5118e5 3.8287e6 -3.6028e6 5.659e5 7.7387e6
    2.607e6 4.2184e5 8.7506e6 -2.7016e6 1.1215e5 3.7617e6 -2.0642e6 8.9826e5 1.1496e7
    """,
    """
    -0.86543 -0.31207 0.031149 -0.86543 -0.31207 0.031149 -0.86543 -0.31207 0.031149 -0.86543 -0.31207 0.031149
    -0.86543 -0.31207 0.031149
    """,
)


def flat_fall():
    """W (15, 15), q (15,), mu (5,) of FLAT_FALL."""
    triangle, q = (np.array(text.split(), float) for text in FLAT_FALL)
    W = np.zeros((15, 15))
    W[np.tril_indices(15)] = triangle
    return W + np.tril(W, -1).T, q, np.full(5, 0.2)
