"""From a machine to its unit solutions: one for each live conductor, at 1 V while all else is at 0."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from .geometry import Machine
from .mesh import Grading, build
from .sample import in_plane, on_line, slopes_in_plane
from .solve import Line, Matrix, Plane, solve_by_gradients, solve_directly

Array = NDArray[np.float64]
FAR = {2: 3000.0, 3: 20.0}  # radius of the circle that stands for infinity, in reaches of the parts
GROWTH = 4.0  # growth of the size of the elements, times the elements along a quarter of a circle


@dataclass
class Units:
    """The unit solutions of a machine.

    Attributes
    ----------
    capacitance : (n, n) F/m in two dimensions, F in three: charges of the conductors at unit voltages, over epsilon_0
    unknowns, iterations : the size of the problem, and the work of each solution
    """

    machine: Machine
    plane: Plane
    line: Line | None
    values: Array  # (conductors, nodes) or (conductors, nodes of the plane, nodes along z)
    capacitance: Array
    unknowns: int
    iterations: tuple[int, ...] = field(default=())

    def sample(self, points: Array, z: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Potentials at points (p, 2) m times z (k,) m: (conductors, p, k), and which points lie in the mesh."""
        across, found = in_plane(self.plane, points)
        if self.line is None:
            return np.array([np.outer(across @ value, np.ones(len(z))) for value in self.values]), found
        along, _ = on_line(self.line, z)
        return np.array([(along @ (across @ value).T).T for value in self.values]), found

    def field(self, points: Array, z: Array) -> Array:
        """Field of the elements at points in the mesh (p, 2) m times z (k,) m: (conductors, p, k, 3) 1/m."""
        value, _ = in_plane(self.plane, points)
        along_x, along_y = slopes_in_plane(self.plane, points)
        result = np.zeros((len(self.values), len(points), len(z), 3))
        for unit, v in zip(result, self.values, strict=True):
            if self.line is None:
                unit[:, :, 0], unit[:, :, 1] = -(along_x @ v)[:, None], -(along_y @ v)[:, None]
            else:
                along, slope = on_line(self.line, z)
                for k, (plane, line) in enumerate(((along_x, along), (along_y, along), (value, slope))):
                    unit[:, :, k] = -(line @ (plane @ v).T).T
        return result


def solve_units(machine: Machine, dimension: int, resolution: int, tick: Callable[[], Any] = lambda: None) -> Units:
    """The unit solutions.

    Parameters
    ----------
    machine : Machine
    dimension : 2 or 3
    resolution : elements along a quarter of each circle
    tick : called as the work goes on
    """
    machine.check()
    three = dimension == 3
    grading = Grading(resolution, GROWTH / resolution, max(resolution / 5.0, 1.5))
    conductors = [conductor.curve for conductor in machine.conductors]
    parts = [*conductors, *(part.curve for part in machine.dielectrics)]
    hollow = [c.curve for c in machine.conductors if not three or math.isinf(c.length)]
    mesh = build(parts, machine.outer(FAR[dimension]), grading, hollow)
    plane = Plane(mesh)
    tick()
    line = _line(machine, resolution) if three else None
    matrix = _matrix(machine, plane, line)
    where = _conductor_nodes(machine, plane, line)
    known: NDArray[np.bool_] = np.asarray(where.any(axis=0))
    if machine.enclosure is not None:
        known |= _spread(plane.on_rim(), line)
        if line is not None and math.isfinite(machine.enclosure.length):
            known |= _spread(np.ones(len(plane.nodes), bool), line, line.nodes >= line.ends[-1])
    tick()
    given = where[machine.live].astype(float)
    if line is None:
        values, iterations = solve_directly(matrix, known, given), (1,) * len(given)
    else:
        linear = sparse.csr_matrix(sparse.kron(plane.linear(), line.linear()))
        values, iterations = solve_by_gradients(matrix, linear, known, given, tick)
    capacitance = values @ (matrix @ values.T) * (2.0 if three else 1.0)
    shape = (len(values), -1) if line is None else (len(values), len(plane.nodes), len(line.nodes))
    return Units(machine, plane, line, values.reshape(shape), capacitance, int((~known).sum()), iterations)


def _line(machine: Machine, resolution: int) -> Line:
    """Elements along z: fine at the ends of the parts, coarser away from them."""
    lengths = [p.length for p in (*machine.conductors, *machine.dielectrics)]
    ends = sorted({0.5 * length for length in lengths if math.isfinite(length)})
    if machine.enclosure is not None and math.isfinite(machine.enclosure.length):
        last = 0.5 * machine.enclosure.length
        ends = [end for end in ends if end < last]
    elif machine.enclosure is not None:
        last = 2.0 * max(ends, default=machine.reach)
    else:
        last = FAR[3] * machine.reach
    widest = max(conductor.radius for conductor in machine.conductors)
    least = 0.25 * np.pi * widest / resolution
    places = [0.0, *ends, last]
    found = [np.zeros(1)]
    for low, high in pairwise(places):
        z = np.linspace(low, high, 513)[:512] + 0.5 * (high - low) / 512
        off = np.min([np.abs(z - end) for end in ends] or [z], axis=0)
        size = np.minimum(least + GROWTH / resolution * off, 0.5 * (high - low))
        count = np.concatenate([[0.0], np.cumsum((high - low) / 512 / size)])
        n = max(int(np.ceil(count[-1])), 2)
        found.append(np.interp(np.linspace(0.0, count[-1], n + 1)[1:], count, np.linspace(low, high, 513)))
    return Line(np.concatenate(found))


def _permittivity(machine: Machine, plane: Plane, z: float) -> Array:
    """Of each triangle of the cross-section, in a slice at z m."""
    found = np.ones(len(plane.mesh.triangles))
    for part in machine.dielectrics:
        if z < 0.5 * part.length:
            found[plane.mesh.inside(part.curve)] = part.permittivity
    return found


def _matrix(machine: Machine, plane: Plane, line: Line | None) -> Matrix:
    if line is None:
        return plane.matrices(_permittivity(machine, plane, 0.0))[0]
    middle = 0.5 * (line.ends[1:] + line.ends[:-1])
    slices = np.array([[z < 0.5 * part.length for part in machine.dielectrics] for z in middle])
    kinds, number = np.unique(slices.reshape(len(middle), -1), axis=0, return_inverse=True)
    total: Any = 0.0
    for kind in range(max(len(kinds), 1)):
        mine = number.reshape(-1) == kind
        stiff, mass = plane.matrices(_permittivity(machine, plane, float(middle[mine][0])))
        stiff_z, mass_z = line.matrices(mine.astype(float))
        part = sparse.kron(stiff, mass_z, format="csr") + sparse.kron(mass, stiff_z, format="csr")
        total = part + total if kind else part
    if machine.enclosure is None:
        total = total + _far_field(plane, line)
    return sparse.csr_matrix(total)


def _far_field(plane: Plane, line: Line) -> Matrix:
    """Free space: V falls off as 1/distance, dV/dn = -V (n x)/|x|^2, exact for a charge at the origin."""
    radius, top = plane.mesh.curves[-1].reach, float(line.ends[-1])
    _, side = line.matrices(lambda z: radius / (radius**2 + z[0] ** 2))
    cap = plane.mass_of(lambda x: top / (x[0] ** 2 + x[1] ** 2 + top**2))
    last = sparse.csr_matrix(([1.0], ([len(line.nodes) - 1], [len(line.nodes) - 1])), (len(line.nodes),) * 2)
    return sparse.csr_matrix(sparse.kron(plane.rim_mass(), side) + sparse.kron(cap, last))


def _conductor_nodes(machine: Machine, plane: Plane, line: Line | None) -> NDArray[np.bool_]:
    """Which nodes belong to each conductor, (conductors, nodes) bool."""
    rows = []
    for conductor in machine.conductors:
        along = None if line is None else line.nodes <= 0.5 * conductor.length * (1.0 + 1e-12)
        rows.append(_spread(plane.within(conductor.curve), line, along))
    return np.array(rows)


def _spread(nodes: NDArray[np.bool_], line: Line | None, along: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
    """Nodes of the cross-section, at the places along z that are asked for: all unless said."""
    if line is None:
        return nodes
    return np.asarray((nodes[:, None] & (np.ones(len(line.nodes), bool) if along is None else along)).ravel())
