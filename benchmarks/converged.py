"""Do runs that stop when they are certain hold the truth? Many runs, put together from the landings of a long one.

    python benchmarks/converged.py [--long 60] [--repeats 800] [--halfwidth "0.4 mm"]

The dilute machine runs once for long; its mean landing x is the truth. Each repeat is a stream of blocks of two seconds
of those landings, drawn with replacement, and is looked at as `cesim.Converged` looks at a run. Told are the shares of
intervals of 95 % that hold the truth: of the first narrow look, and of the one that confirms it, where a run stops.
"""

from __future__ import annotations

import argparse
import copy
import math

import accuracy_machines
import numpy as np

import cesim
from cesim.accuracy.converged import Watch

BLOCK, LONGEST = 2.0, 80.0  # s: of the blocks, longer than what one grain does to others, and of the runs
STEP = 2e-3  # s


def stream(rows: np.ndarray, start: float, end: float, random: np.random.Generator) -> np.ndarray:
    """Landings of so long a run as is ever looked at."""
    pieces = []
    for number in range(math.ceil(LONGEST / BLOCK)):
        first = random.uniform(start, end - BLOCK)
        piece = rows[(rows["t"] >= first) & (rows["t"] < first + BLOCK)].copy()
        for column in ("t", "birth"):
            piece[column] += number * BLOCK - first
        pieces.append(piece)
    return np.concatenate(pieces)


def stopped(run: cesim.Run, rows: np.ndarray, goal: cesim.Converged) -> tuple[cesim.Estimate, cesim.Estimate]:
    """The interval of the first narrow look, and that at which such a run stops."""
    watch, first = Watch(goal), None
    while watch.look < LONGEST:
        made = copy.copy(run)
        made.time = watch.look
        made.__dict__["warmup"] = run.warmup
        made.landings = rows[rows["t"] <= made.time]
        satisfied = watch.is_satisfied(made)
        if watch.narrow and first is None:
            first = goal.estimate(made)
        if satisfied:
            assert first is not None
            return first, goal.estimate(made)
    raise SystemExit(f"no interval was narrow enough within {LONGEST:g} s: ask for a wider one")


def main() -> None:
    """See the top of this file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--long", type=float, default=60.0, help="s of simulated time of the long run; %(default)s")
    parser.add_argument("--repeats", type=int, default=800)
    parser.add_argument("--quantity", default="mean_x[ABS]")
    parser.add_argument("--halfwidth", default="0.4 mm")
    options = parser.parse_args()
    scene = accuracy_machines.dilute()
    scene.numerics.step = STEP
    run = cesim.run(scene, until=options.long, frames=None)
    goal = cesim.Converged(options.quantity, options.halfwidth)
    truth = goal.estimate(run)
    held = np.zeros(2)
    lengths = []
    random = np.random.default_rng(1)
    for _ in range(options.repeats):
        found = stopped(run, stream(run.landings, run.warmup, run.time, random), goal)
        held += [estimate.low <= float(truth) <= estimate.high for estimate in found]
        lengths.append(found[1].n_eff)
    share = held / options.repeats
    error = 1.96 * np.sqrt(share * (1.0 - share) / options.repeats)
    print(f"dilute machine, {options.quantity} to {options.halfwidth}: the truth is {1e3 * float(truth):.3f} mm")
    for name, value, half in zip(("first narrow look", "where it stops"), share, error, strict=True):
        print(f"{name:18} {100 * value:.1f} +- {100 * half:.1f} % of {options.repeats} intervals hold it")
    print(f"effective grains of a run: {np.mean(lengths):.0f}")


if __name__ == "__main__":
    main()
