"""Harmonic potentials outside circles in a plane: line charges, multipoles about each circle, mirror images in a box.

The potential is V = Re Phi(z), z = x + i y,

    Phi = C - sum_p s_p log(z - z_p) + sum_k sum_m a_km (r_k/(z - z_k))^m + sum_n b_n ((z - z_0)/r_0)^n

with line charges s_p, multipoles a_km about the axis of conductor k (complex series: exact for circles, geometric
convergence), and in a box their mirror images in its walls, and a polynomial for the images that are left out. The
unknowns are found by least squares of V on the surfaces. By the maximum principle the error of V is nowhere larger
than on the surfaces, where it is measured.

Each charge of a conductor comes with its images in the others, at the limit points of the pencil of circles that two
of them span (docs/physics.md 1.1: x- and x+): for two cylinders that is the whole solution, and for more the
multipoles become small.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Circle = tuple[float, float, float]  # x, y, radius [m]
Box = tuple[float, float, float, float]  # x and y of the lower, then of the upper corner [m]

LEAST_ORDER, MOST_ORDER = 8, 120
DIGITS = 1e-16  # to which a series is taken
DEGREE = 48  # of the polynomial: the images it stands for are twice as far as the corners, 2^-48 = 4e-15
WALL_POINTS = 96  # on each wall
FAR_IMAGES = 2.0  # half diagonals: mirror images nearer than that to the middle of the box are there one by one


@dataclass(frozen=True)
class Expansion:
    """Terms c_m w^m, m = 1, 2, ... of Phi; w = radius/(z - center), or its inverse where growing; |w| <= nearest."""

    center: complex
    radius: float
    coefficients: Complex
    nearest: float = 1.0
    growing: bool = False


@dataclass(frozen=True)
class Solution:
    """A potential per volt of one conductor.

    Attributes
    ----------
    poles : (p,) complex
        Places of the line charges [m].
    strengths : (p,) array
        Of the charges: lambda/(2 pi eps0) [V/V].
    expansions : tuple of Expansion
        Multipoles, and in a box the polynomial.
    constant : float
        C [V/V].
    charges : (n,) array
        Charge of each conductor per length over 2 pi eps0 [V/V].
    boundary_error : float
        Largest error of the potential on the surfaces [V/V], between the points at which it was fitted.
    """

    poles: Complex
    strengths: Array
    expansions: tuple[Expansion, ...]
    constant: float
    charges: Array
    boundary_error: float


# ---- images ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Image:
    """A reflection of the plane: z -> turn z + shift, or turn conj(z) + shift where mirrored."""

    turn: float
    shift: complex
    mirrored: bool

    def place(self, z: Complex) -> Complex:
        return np.asarray(self.turn * (z.conj() if self.mirrored else z) + self.shift)

    def multipoles(self, orders: Array, coefficients: Complex) -> Complex:
        """Coefficients of the image of an expansion, for a grounded wall: an odd number of reflections turns the
        sign."""
        flipped = np.power(self.turn, orders) * (coefficients.conj() if self.mirrored else coefficients)
        return np.asarray(self.sign * flipped)

    @property
    def sign(self) -> float:
        return -1.0 if self.mirrored else 1.0


def images_of(box: Box | None) -> list[Image]:
    """The plane itself, then its images in the walls of the box out to FAR_IMAGES."""
    if box is None:
        return [Image(1.0, 0.0j, False)]
    middle, half = complex(box[0] + box[2], box[1] + box[3]) / 2.0, ((box[2] - box[0]) / 2.0, (box[3] - box[1]) / 2.0)
    reach = FAR_IMAGES * math.hypot(*half)
    counts = [max(1, math.ceil((reach / h - 1.0) / 2.0)) for h in half]
    cells = [(i, j) for i in range(-counts[0], counts[0] + 1) for j in range(-counts[1], counts[1] + 1)]
    cells.sort(key=lambda cell: (cell != (0, 0), cell))
    found = []
    for i, j in cells:
        # In x: x' = 2 half i + (-1)^i x about the middle, and likewise in y.
        odd_x, odd_y = i % 2 == 1, j % 2 == 1
        turn = -1.0 if odd_x else 1.0
        mirrored = odd_x != odd_y
        shift = complex(2.0 * half[0] * i, 2.0 * half[1] * j)
        about = turn * (middle.conjugate() if mirrored else middle)
        found.append(Image(turn, shift + middle - about, mirrored))
    return found


# ---- the system ------------------------------------------------------------------------------------------------------


def _limit_point(circle: Circle, other: Circle) -> complex:
    """Where the charge of another conductor has its image inside this one."""
    own, far = complex(*circle[:2]), complex(*other[:2])
    distance = abs(far - own)
    r, s = circle[2], other[2]
    h = 0.5 * (distance + (r - s) * (r + s) / distance)
    gap = distance - r - s
    c = math.sqrt(gap * (distance - r + s)) * math.sqrt((distance + r - s) * (distance + r + s)) / (2.0 * distance)
    return own + (far - own) / distance * (r * r / (h + c))


def _order(k: int, circles: tuple[Circle, ...], box: Box | None) -> int:
    """Terms after which the series of a conductor has converged: by how deep its outermost image lies."""
    x, y, r = circles[k]
    others = [other for i, other in enumerate(circles) if i != k]
    ratios = [abs(_limit_point(circles[k], other) - complex(x, y)) / r for other in others]
    if box is not None:
        for wall in (x - box[0], y - box[1], box[2] - x, box[3] - y):
            ratios.append(r / (wall + math.sqrt((wall - r) * (wall + r))))
    ratio = max(ratios, default=0.0)
    terms = math.ceil(math.log(DIGITS) / math.log(ratio)) if ratio > 0.0 else 0
    return min(max(terms, LEAST_ORDER), MOST_ORDER)


class _System:
    """The columns of the least-squares problem, one an unknown, and what each stands for."""

    def __init__(self, circles: tuple[Circle, ...], box: Box | None) -> None:
        self.circles, self.box = circles, box
        self.images = images_of(box)
        self.orders = [_order(k, circles, box) for k in range(len(circles))]
        self.centers = np.array([complex(x, y) for x, y, _ in circles])
        self.middle, self.reach, self.degree = 0.0j, 1.0, 0
        if box is not None:
            self.middle = complex(box[0] + box[2], box[1] + box[3]) / 2.0
            self.reach = 0.5 * math.hypot(box[2] - box[0], box[3] - box[1])
            self.degree = DEGREE
        pairs = [(j, k) for k in range(len(circles)) for j in range(len(circles)) if j != k]
        inner = [_limit_point(circles[j], circles[k]) for j, k in pairs]
        self.sources = np.concatenate([self.centers, np.array(inner, complex)])
        # Row k: line charges at all sources for a unit charge of conductor k.
        self.weights = np.zeros((len(circles), len(self.sources)))
        for k in range(len(circles)):
            self.weights[k, k] = 1.0
        for place, (j, k) in enumerate(pairs):
            self.weights[k, j] += 1.0
            self.weights[k, len(circles) + place] -= 1.0

    def columns(self, z: Complex) -> Array:
        """V at points of each unknown: C, charges, real and imaginary parts of multipoles, and of the polynomial."""
        logs = np.zeros((len(z), len(self.sources)))
        for image in self.images:
            logs -= image.sign * np.log(np.abs(z[:, None] - image.place(self.sources)[None, :]))
        blocks = [np.ones((len(z), 1)), np.einsum("zs,ks->zk", logs, self.weights)]
        for center, order, (_, _, r) in zip(self.centers, self.orders, self.circles, strict=True):
            m = np.arange(1.0, order + 1.0)
            real, imaginary = np.zeros((len(z), order)), np.zeros((len(z), order))
            for image in self.images:
                w = r / (z - image.place(np.array([center]))[0])
                powers = _powers(w, order)
                real += (powers * image.multipoles(m, np.ones(order, complex))).real
                imaginary += (powers * image.multipoles(m, np.full(order, 1.0j))).real
            blocks += [real, imaginary]
        if self.degree:
            powers = _powers((z - self.middle) / self.reach, self.degree)
            blocks += [powers.real, -powers.imag]
        return np.hstack(blocks)

    def surfaces(self, shift: float) -> list[Complex]:
        """Points of each conductor, then of the walls; shift, in points, moves them along."""
        found = []
        for center, order, (_, _, r) in zip(self.centers, self.orders, self.circles, strict=True):
            n = 3 * order + 8
            found.append(center + r * np.exp(2.0j * np.pi * (np.arange(n) + shift) / n))
        if self.box is not None:
            low, high = complex(*self.box[:2]), complex(*self.box[2:])
            n = WALL_POINTS
            # Chebyshev's points, closer towards the corners.
            t = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n) + 0.5 + 0.5 * shift) / (n + 0.5))
            x, y = low.real + t * (high - low).real, low.imag + t * (high - low).imag
            walls = [x + 1j * low.imag, x + 1j * high.imag, low.real + 1j * y, high.real + 1j * y]
            found.append(np.concatenate(walls))
        return found


def _powers(w: Complex, order: int) -> Complex:
    """w, w^2, ..., w^order in columns."""
    return np.asarray(np.cumprod(np.broadcast_to(w[:, None], (len(w), order)), axis=1), dtype=np.complex128)


@lru_cache(maxsize=64)
def unit_solutions(circles: tuple[Circle, ...], box: Box | None) -> tuple[Solution, ...]:
    """For each conductor the potential where it is at 1 V and all others, and the box, at 0. Solved once a geometry."""
    system = _System(circles, box)
    surfaces = system.surfaces(0.0)
    matrix = system.columns(np.concatenate(surfaces))
    unknowns = _least_squares(*_constrained(matrix, _unit_potentials(surfaces, len(circles)), len(circles), box))
    if box is None:  # the total charge is zero: that of the first conductor is what balances the others
        first = -unknowns[1 : len(circles)].sum(axis=0)
        unknowns = np.vstack([unknowns[:1], first[None, :], unknowns[1:]])
    between = system.surfaces(0.5)
    check = system.columns(np.concatenate(between))
    wanted = _unit_potentials(between, len(circles))
    errors = np.abs(np.einsum("zu,uk->zk", check, unknowns) - wanted).max(axis=0)
    return tuple(_solution(system, unknowns[:, k], float(errors[k])) for k in range(len(circles)))


def _unit_potentials(surfaces: list[Complex], n: int) -> Array:
    """Potential of all points, in the column of each of n conductors: 1 on its own surface, 0 elsewhere."""
    owner = np.repeat(np.arange(len(surfaces)), [len(points) for points in surfaces])
    return np.equal.outer(owner, np.arange(n)).astype(float)


def _constrained(matrix: Array, target: Array, n: int, box: Box | None) -> tuple[Array, Array]:
    """Without a box: the first conductor's charge is minus the sum of the others'."""
    if box is not None:
        return matrix, target
    charges = matrix[:, 2 : n + 1] - matrix[:, 1:2]
    return np.hstack([matrix[:, :1], charges, matrix[:, n + 1 :]]), target


def _least_squares(matrix: Array, target: Array) -> Array:
    """By Householder's reflections, written out: the bits then depend on no library and no number of threads."""
    scale = np.sqrt(np.einsum("ij,ij->j", matrix, matrix))
    scale[scale == 0.0] = 1.0
    a = np.hstack([matrix / scale, target])
    n = matrix.shape[1]
    for k in range(n):
        v = a[k:, k].copy()
        norm = math.sqrt(float(np.einsum("i,i->", v, v)))
        if norm == 0.0:
            continue
        v[0] += math.copysign(norm, v[0])
        beta = 2.0 / float(np.einsum("i,i->", v, v))
        a[k:, k:] -= np.multiply.outer(v, beta * np.einsum("i,ij->j", v, a[k:, k:]))
    x = a[:n, n:].copy()
    for k in range(n - 1, -1, -1):
        x[k] = (x[k] - np.einsum("j,jc->c", a[k, k + 1 : n], x[k + 1 :])) / a[k, k] if abs(a[k, k]) > 1e-15 else 0.0
    return np.asarray(x / scale[:, None])


def _distance(z: complex, box: Box | None) -> float:
    """Distance in m of a point from the box; tiny inside it, or without one."""
    if box is None:
        return 1e-300
    x = max(box[0] - z.real, z.real - box[2], 0.0)
    y = max(box[1] - z.imag, z.imag - box[3], 0.0)
    return max(math.hypot(x, y), 1e-300)


def _solution(system: _System, unknowns: Array, error: float) -> Solution:
    n = len(system.circles)
    charges = unknowns[1 : n + 1]
    source = np.einsum("k,ks->s", charges, system.weights)
    poles = np.concatenate([image.place(system.sources) for image in system.images])
    strengths = np.concatenate([image.sign * source for image in system.images])
    place, expansions = n + 1, []
    for center, order, (_, _, r) in zip(system.centers, system.orders, system.circles, strict=True):
        coefficients = unknowns[place : place + order] + 1.0j * unknowns[place + order : place + 2 * order]
        place += 2 * order
        for image in system.images:
            middle = complex(image.place(np.array([center]))[0])
            moved = image.multipoles(np.arange(1.0, order + 1.0), coefficients)
            expansions.append(Expansion(middle, r, moved, min(1.0, r / _distance(middle, system.box))))
    if system.degree:
        degree = system.degree
        b = unknowns[place : place + degree] + 1.0j * unknowns[place + degree :]
        expansions.append(Expansion(system.middle, system.reach, b, growing=True))
    return Solution(poles, strengths, tuple(expansions), float(unknowns[0]), charges, error)
