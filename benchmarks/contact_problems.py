"""What each solver needs for a contact problem given as W, q and mu: iterations and time to a tolerance.

    CESIM_FCLIB=folder python benchmarks/contact_problems.py [--repeats 3] [--iterations 10000] [--plot FILE]

Problems: those of the Frictional Contact Library where CESIM_FCLIB names their folder, a hyperstatic stack of boxes,
and a bed of spheres that settles and shears; for the last two also accuracy against time. All of it takes some seven
minutes. A time is the median over repeats in one run on one machine: compare lines of one table, not tables of two
machines. What a solver did not reach is shown as a failure, with the error it was left with. The contact problems of
whole scenes are in solvers.py.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

import cesim
from cesim.contact import Solution, read_fclib, solve, solvers

FCLIB = ("CubeH8", "Box_Stacks-i0122-82-5", "local_problem_test", "spheres-in-a-box-98-i10000-256-10")
TOLERANCES = (1e-4, 1e-8)
BUDGETS = (10, 20, 40, 80, 160, 320, 640, 1280, 2560)


class Problem(NamedTuple):
    name: str
    W: Any
    q: Any
    mu: Any


# ---- generated problems --------------------------------------------------------------------------------------------


def contact_rows(normal: Any, arms: list[Any], bodies: list[Any], count: int) -> Any:
    """D' (3n, 6 count): rows (N, T1, T2) of contacts between bodies[0] and bodies[1] (-1: the ground)."""
    reference = np.where(np.abs(normal[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 0, 1.0]])
    first = np.cross(normal, reference)
    first /= np.linalg.norm(first, axis=1)[:, None]
    frame = np.stack([normal, first, np.cross(normal, first)], 1)
    rows, columns, values = [], [], []
    for body, arm, sign in zip(bodies, arms, (1.0, -1.0), strict=True):
        real = np.nonzero(body >= 0)[0]
        block = sign * np.concatenate([frame[real], np.cross(arm[real][:, None, :], frame[real])], 2)
        shape = np.zeros((1, 3, 6), dtype=int)
        rows.append((3 * real[:, None, None] + np.arange(3)[None, :, None] + shape).ravel())
        columns.append((6 * body[real][:, None, None] + np.arange(6)[None, None, :] + shape).ravel())
        values.append(block.ravel())
    places = (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_array((np.concatenate(values), places), shape=(3 * len(normal), 6 * count))


def local_form(D: Any, inverse_mass: Any, velocity: Any) -> tuple[Any, Any]:
    W = D @ sparse.diags_array(inverse_mass) @ D.T
    return sparse.csr_array(0.5 * (W + W.T)), D @ velocity.ravel()


def box_stack(boxes: int, push: float) -> Problem:
    """Cubes of 1 mm on each other, four contacts a face, after 1 ms of gravity and a push, m/s: W has half its rank."""
    edge, mass, step = 1e-3, 1e-6, 1e-3
    corners = 0.5 * edge * np.array([(x, y, z) for y in (-1,) for x in (-1, 1) for z in (-1, 1)])
    upper = np.repeat(np.arange(boxes), 4)
    arm = np.tile(corners, (boxes, 1))
    normal = np.tile([0.0, 1.0, 0.0], (4 * boxes, 1))
    D = contact_rows(normal, [arm, arm * [1, -1, 1]], [upper, upper - 1], boxes)
    velocity = np.tile([push, -9.81 * step, 0, 0, 0, 0], (boxes, 1))
    inverse = np.tile([1 / mass] * 3 + [6 / (mass * edge**2)] * 3, boxes)
    return Problem(f"stack of {boxes} boxes", *local_form(D, inverse, velocity), 0.5)


def bed(layers: int, shear: float) -> Problem:
    """Spheres of 1 mm in a loose, jittered close packing, after 1 ms of gravity; layers move over each other, 1/s."""
    d, density, step, reach = 1e-3, 1000.0, 1e-3, 0.03
    across = np.arange(10)
    j, i, k = np.meshgrid(np.arange(layers), across, across, indexing="ij")
    cells = [i + 0.5 * (k % 2) + 0.5 * (j % 2), 0.5 + j * np.sqrt(2 / 3), (k + (j % 2) / 3) * np.sqrt(3) / 2]
    place = d * np.stack(cells, -1).reshape(-1, 3)
    place += 0.01 * d * np.random.default_rng(1).normal(size=place.shape)
    pairs = cKDTree(place).query_pairs((1 + reach) * d, output_type="ndarray")
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    floor = np.nonzero(place[:, 1] < (0.5 + reach) * d)[0]
    across_gap = place[pairs[:, 0]] - place[pairs[:, 1]]
    distance = np.linalg.norm(across_gap, axis=1)
    normal = np.concatenate([across_gap / distance[:, None], np.tile([0.0, 1.0, 0.0], (len(floor), 1))])
    gap = np.maximum(np.concatenate([distance - d, place[floor, 1] - 0.5 * d]), 0.0)
    bodies = [np.concatenate([pairs[:, 0], floor]), np.concatenate([pairs[:, 1], np.full(len(floor), -1)])]
    D = contact_rows(normal, [-0.5 * d * normal, 0.5 * d * normal], bodies, len(place))
    mass = density * np.pi / 6 * d**3
    velocity = np.zeros((len(place), 6))
    velocity[:, 0] = shear * place[:, 1]
    velocity[:, 1] = -9.81 * step
    inverse = np.tile([1 / mass] * 3 + [10 / (mass * d**2)] * 3, len(place))
    W, q = local_form(D, inverse, velocity)
    q[::3] += gap / step
    return Problem(f"bed of spheres, shear {shear:g}/s", W, q, 0.4)


def generated() -> list[Problem]:
    return [box_stack(20, 0.01), bed(5, 0.0), bed(5, 200.0)]


def from_fclib() -> list[Problem]:
    folder = os.environ.get("CESIM_FCLIB", "")
    if not folder:
        print("CESIM_FCLIB names no folder: FCLib's problems are left out")
        return []
    given = {name: read_fclib(Path(folder, f"{name}.hdf5")) for name in FCLIB}
    return [Problem(name, problem.W, problem.q, problem.mu) for name, problem in given.items()]


# ---- measuring -----------------------------------------------------------------------------------------------------


def repeated(problem: Problem, repeats: int, **options: Any) -> tuple[Solution, float]:
    """The answer, which is the same each time, and the median time, s."""
    answers = [solve(problem.W, problem.q, problem.mu, **options) for _ in range(repeats)]
    return answers[0], statistics.median(answer.seconds for answer in answers)


def cell(answer: Solution, seconds: float) -> str:
    if not answer.converged:
        return f"FAILED, {answer.natural_map:.0e} {1e3 * seconds:8.1f} ms"
    return f"{answer.iterations:6d} {1e3 * seconds:10.2f} ms"


def table(problem: Problem, law: str, repeats: int, iterations: int) -> None:
    print(f"\n{problem.name}, {len(problem.q) // 3} contacts, {law}")
    print(
        f"  {'solver':8}" + "".join(f"{f'to {tolerance:g}':>28}" for tolerance in TOLERANCES) + "  (iterations, time)"
    )
    for solver in solvers():
        cells, ran = [], ""
        for tolerance in TOLERANCES:
            options = {"law": law, "solver": solver, "tolerance": tolerance, "max_iterations": iterations}
            answer, seconds = repeated(problem, repeats, **options)
            cells.append(cell(answer, seconds))
            ran = answer.solver if solver == "auto" else ""
        print(f"  {solver:8}" + "".join(f"{text:>28}" for text in cells) + (f"  {ran}" if ran else ""))


def work_precision(problem: Problem, law: str, repeats: int) -> dict[str, list[tuple[float, float, float]]]:
    """For each solver (s, residual in m/s, energy gap as part of the least energy) at budgets of iterations."""
    best = min(
        solve(problem.W, problem.q, problem.mu, law=law, solver=solver, tolerance=1e-11).objective
        for solver in ("apgs", "apgd")
    )
    curves: dict[str, list[tuple[float, float, float]]] = {}
    for solver in solvers():
        for budget in BUDGETS:
            options = {"law": law, "solver": solver, "tolerance": 0.0, "max_iterations": budget}
            answer, seconds = repeated(problem, repeats, **options)
            gap = (answer.objective - best) / abs(best)
            curves.setdefault(solver, []).append((seconds, answer.residual, gap))
    return curves


def print_curves(problem: Problem, curves: dict[str, list[tuple[float, float, float]]]) -> None:
    print(f"\n{problem.name}, ccp: residual in m/s and energy gap after so many iterations")
    print(f"  {'solver':8}" + "".join(f"{budget:>20}" for budget in BUDGETS[1::2]))
    for solver, points in curves.items():
        shown = "".join(f"{f'{residual:.1e} {gap:9.1e}':>20}" for _, residual, gap in points[1::2])
        print(f"  {solver:8}{shown}")


def plot(panels: list[tuple[Problem, dict[str, list[tuple[float, float, float]]]]], path: str) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, len(panels), figsize=(5 * len(panels), 8), sharex="col", squeeze=False)
    for column, (problem, curves) in enumerate(panels):
        for solver, points in curves.items():
            seconds, residuals, gaps = (np.array(values) for values in zip(*points, strict=True))
            axes[0, column].loglog(1e3 * seconds, residuals, "o-", ms=3, label=solver)
            axes[1, column].loglog(1e3 * seconds, np.maximum(gaps, 1e-13), "o-", ms=3)
        axes[0, column].set_title(f"{problem.name}, {len(problem.q) // 3} contacts, ccp")
        axes[1, column].set_xlabel("time [ms]")
    axes[0, 0].set_ylabel("residual [m/s]")
    axes[1, 0].set_ylabel("energy above the least, relative")
    axes[0, 0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    print(f"\nwritten: {path}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--iterations", type=int, default=10_000, help="at most, for the tables")
    parser.add_argument("--plot", metavar="FILE", help="work against precision, as a picture")
    arguments = parser.parse_args()
    print(f"cesim {cesim.__version__}, {platform.machine()}, one thread, median of {arguments.repeats}")
    problems = generated()
    for problem in [*from_fclib(), *problems]:
        for law in ("coulomb", "ccp"):
            table(problem, law, arguments.repeats, arguments.iterations)
    panels = [(problem, work_precision(problem, "ccp", arguments.repeats)) for problem in problems]
    for problem, curves in panels:
        print_curves(problem, curves)
    if arguments.plot:
        plot(panels, arguments.plot)


if __name__ == "__main__":
    main()
