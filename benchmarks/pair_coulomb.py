"""Forces of charged grains on each other: error and cost of tree and cut-off against the direct sum.

    python benchmarks/pair_coulomb.py [--counts 100 1000 10000 100000] [--threads 1] [--picture FILE.png]

Two crowds: a cloud of charges of random sign and size, 30 grain diameters apart on average, whose forces are those of
near neighbours; and a stream of one sign, a sheet over the drum with its images, whose forces are those of the whole.
Times are the best of a few calls, all in one run on one machine: compare lines of one table with each other.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cesim import engine

Array = NDArray[np.float64]
Crowd = tuple[Array, Array, Array, dict[str, Any]]  # position, charge, diameter, drum

METHODS: dict[str, dict[str, float]] = {
    "direct": {"method": 2.0},
    "tree 0.9": {"method": 0.0, "opening": 0.9},
    "tree 0.7": {"method": 0.0, "opening": 0.7},
    "tree 0.5": {"method": 0.0, "opening": 0.5},
    "cut-off 3 s": {"method": 1.0, "cutoff": 3.0},  # in mean spacings
    "cut-off 6 s": {"method": 1.0, "cutoff": 6.0},
}


def cloud(count: int) -> tuple[Crowd, float]:
    """Charges of random sign in a cube, and their mean spacing in m."""
    random, spacing = np.random.default_rng(1), 15e-3
    edge = spacing * count ** (1 / 3)
    x = random.uniform(0.0, edge, (count, 3))
    return (x, random.normal(0.0, 1e-12, count), random.uniform(0.2e-3, 0.8e-3, count), {}), spacing


def stream(count: int) -> tuple[Crowd, float]:
    """Charges of one sign over a quarter of the drum, up to 10 mm high, and their mean spacing in m."""
    random, width, arc = np.random.default_rng(2), 0.3, 0.5 * np.pi
    angle, z = random.uniform(0.0, arc, count), random.uniform(0.0, width, count)
    d = random.uniform(0.2e-3, 0.8e-3, count)
    out = 0.16 + 0.5 * d + random.uniform(0.0, 10e-3, count)
    x = np.column_stack([out * np.sin(angle), out * np.cos(angle), z])
    drum = {"drum_axis": (0.0, 0.0), "drum_radius": 0.16}
    return (x, random.uniform(0.5e-12, 1e-12, count), d, drum), float(np.cbrt(arc * 0.165 * width * 10e-3 / count))


def timed(crowd: Crowd, parameters: dict[str, float], threads: int) -> tuple[Array, float]:
    """Forces, and the best time of a call in s."""
    x, q, d, drum = crowd
    best, spent, calls = np.inf, 0.0, 0
    while calls < 1 or (spent < 0.5 and calls < 20):
        start = time.perf_counter()
        force, _ = engine.pair_forces(x, q, d, parameters, **drum, threads=threads)
        taken = time.perf_counter() - start
        best, spent, calls = min(best, taken), spent + taken, calls + 1
    return force, best


def measure(counts: list[int], threads: int) -> list[dict[str, Any]]:
    """A row for each crowd, count and method; errors are relative, over all charges."""
    rows = []
    for make in (cloud, stream):
        for count in counts:
            crowd, spacing = make(count)
            exact, unit = timed(crowd, METHODS["direct"], threads)
            for name, given in METHODS.items():
                parameters = {k: v * spacing if k == "cutoff" else v for k, v in given.items()}
                force, seconds = (exact, unit) if name == "direct" else timed(crowd, parameters, threads)
                net = float(np.abs(force.sum(axis=0)).max() / np.abs(force).sum())
                rows.append(
                    {
                        "crowd": make.__name__,
                        "count": count,
                        "method": name,
                        "ms": 1e3 * seconds,
                        "speed": unit / seconds,
                        "error": float(np.linalg.norm(force - exact) / np.linalg.norm(exact)),
                        "net": net,
                    }
                )
                print(
                    "| {crowd} | {count} | {method} | {ms:.3g} | {speed:.3g} | {error:.1e} | {net:.0e} |".format(
                        **rows[-1]
                    ),
                    flush=True,
                )
    return rows


def draw(rows: list[dict[str, Any]], path: str) -> None:
    """Time over count, and error over count, of each method in both crowds."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(10, 7), sharex=True, layout="constrained")
    for column, crowd in enumerate(("cloud", "stream")):
        for k, name in enumerate(METHODS):
            mine = [row for row in rows if row["crowd"] == crowd and row["method"] == name]
            counts = [row["count"] for row in mine]
            style = {"color": f"C{k}", "marker": "o", "markersize": 4, "label": name}
            axes[0, column].loglog(counts, [row["ms"] for row in mine], **style)
            if name != "direct":
                axes[1, column].loglog(counts, [max(row["error"], 1e-7) for row in mine], **style)
        axes[0, column].set_title({"cloud": "random signs in a cube", "stream": "one sign over the drum"}[crowd])
        axes[1, column].set_xlabel("charges")
    axes[0, 0].set_ylabel("time of one sum [ms]")
    axes[1, 0].set_ylabel("relative error of the forces\n(below 1e-7 drawn there)")
    axes[0, 0].legend(fontsize=8)
    for axis in axes.flat:
        axis.grid(alpha=0.3)
    figure.savefig(path, dpi=120)


def main() -> None:
    """Measure, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--counts", type=int, nargs="+", default=[100, 1000, 10000, 100000])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--picture")
    arguments = parser.parse_args()
    print("| crowd | charges | method | ms | direct/this | error | net force |")
    print("|---|---|---|---|---|---|---|")
    rows = measure(arguments.counts, arguments.threads)
    if arguments.picture:
        draw(rows, arguments.picture)
        print(f"wrote {arguments.picture}")


if __name__ == "__main__":
    main()
