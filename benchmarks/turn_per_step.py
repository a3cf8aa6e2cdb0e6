"""How far may a grain that is no sphere turn in a step? Error of the mean landing x against the step, by shape.

    python benchmarks/turn_per_step.py [--markdown FILE] [--until 4]

Grains of one diameter d, half copper and half ABS, on a strip of the reference machine. The rule of thumb is h0, a
radian at omega = 2 v/d. Each step is paired with the finest over the same grains. Spheres look the same however they
turn: what is larger than their error comes from the shape. *turn* is the largest in one step.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import accuracy_machines

import cesim
from cesim.accuracy import Quantity, difference
from cesim.scene.effects import reference_speed

DIAMETER = 0.6e-3  # m: the finer, the stricter is the rule; finer grains jam in front of the brush
STEPS = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25)  # of h0; the last is what the others are compared with
SHAPES = {
    "sphere": cesim.Sphere(),
    "angular": cesim.Angular(seed=1, spheres=5),
    "flake, 3 wide": cesim.Flake(width=3.0, spheres=5),
    "flake, 6 wide": cesim.Flake(width=6.0, spheres=9),
    "rod, 5 long": cesim.Rod(aspect=5.0),
}
MATERIALS = ("copper", "ABS")


def machine(shape: object) -> cesim.Scene:
    """Grains of one shape and size on a strip of the reference machine."""
    spheres = isinstance(shape, cesim.Sphere)
    scene = cesim.scenes.reference_machine("spheres" if spheres else "shredded")
    size = cesim.Constant(diameter=DIAMETER)
    # By mass: about as many grains of each.
    scene.feed = cesim.Feed(rate="150 1/s", mix={"copper": 0.9, "ABS": 0.1}, size=size, shape=shape)
    return accuracy_machines.strip(scene, 30e-3, 5e-3)


def rows(name: str, shape: object, until: float) -> Iterator[str]:
    """A row per step."""
    scene = machine(shape)
    h0 = DIAMETER / (2.0 * reference_speed(scene))
    runs = {}
    for factor in sorted(STEPS):
        scene.numerics.step = factor * h0
        runs[factor] = cesim.run(scene, 1, until=until, threads=1, progress=False, frames=None)
    warmup = max(run.warmup for run in runs.values())
    for factor in STEPS[:-1]:
        cells = []
        for material in MATERIALS:
            found = difference(Quantity(f"mean_x[{material}]"), [runs[factor]], [runs[STEPS[-1]]], warmup=warmup).value
            cells.append(f"{1e3 * float(found):+.2f} ± {1e3 * found.halfwidth:.2f}")
        turn = runs[factor].health.worst_turn
        yield f"| {name} | {factor:g} | {1e3 * factor * h0:.2f} | {turn:.1f} | {' | '.join(cells)} |"


def main() -> None:
    """See the top of this file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--markdown", type=Path, help="where the table goes, too")
    parser.add_argument("--until", type=float, default=4.0, help="s of simulated time of each run")
    parser.add_argument("shapes", nargs="*", help=f"of {', '.join(SHAPES)}; default: all")
    options = parser.parse_args()
    heads = ("shape", "h/h0", "h [ms]", "turn [rad]", *(f"{name} [mm]" for name in MATERIALS))
    lines = [f"| {' | '.join(heads)} |", "|" + len(heads) * "---|"]
    print("\n".join(lines), flush=True)
    for name in options.shapes or SHAPES:
        for line in rows(name, SHAPES[name], options.until):
            lines.append(line)
            print(line, flush=True)
    if options.markdown is not None:
        options.markdown.write_text("\n".join([*lines, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
