"""Do spheres land farther than slender grains of equal volume? How much of it is rolling, how much is electric.

One size, one material and a thin feed on the reference machine, with the electrode at 35 kV and at 0 V, for a sphere
that rolls freely, a sphere with the rolling friction 0.35 that stands for an irregular shape, a flake, a rod with round
ends and a cylinder. Only that second sphere has rolling friction: a shape needs no stand-in. The difference of the mean
landing positions, sphere less slender, is parted in two: what is left without field (rolling, sliding, and where the
centre of mass rides), and the electric rest. Intervals come from a block bootstrap over landing time.

The plate and the outlet stand 50 mm farther forward than in the reference machine, so that grains meet the drum at its
top. Where the original drops them, 18 degrees before the top, a sphere without rolling friction rolls back and jams
between plate and drum.

The electric forces have the factors of an ellipsoid with the grain's moments of inertia, which lies on the drum as the
grain does: a flake flat on it takes less charge of contact, and is pulled less, than a sphere of its volume.

What comes out for 1 mm copper, sphere less slender: the sphere with 0.35 lands 0.9 to 1.4 mm farther than flake and
cylinder, less than a splitter step, and 2 mm nearer than the rod. The sphere that rolls lands 4 to 8 mm nearer than all
of them: it leaves the belt with little of its speed and spinning backwards, rolls slowly over the top and leaves the
drum slower than what slides and is dragged along. (Spheres that come at the drum's speed without spin, from a belt at
0.75 m/s with rolling friction on the plate alone, land 7 mm farther than the flake instead.) The electric part is 1.3
mm for the flake, and less than its interval for rod and cylinder.

Rods hit the drum with one end first and spin at some 600 rad/s. The step is therefore 0.25 ms; at the machine's 1 ms
rods land 3 mm farther, over twice the width. Half the step changes no mean by more than its interval.

Takes about a minute on one core.

    python examples/slender_and_spherical.py
    python examples/slender_and_spherical.py --material ABS --until 6
"""

import argparse
import math
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy import stats

import cesim
from cesim.statistics import DRAWS, time_blocks

FORWARD = 0.05  # m, of plate and outlet
WARMUP = 1.0  # s, until the stream over the drum is steady
SHAPES = {  # name: shape, rolling friction
    "sphere, rolls": (cesim.Sphere(), 0.0),
    "sphere, 0.35": (cesim.Sphere(), 0.35),
    "flake 3:1": (cesim.Flake(width=3.0), 0.0),
    "rod 4:1": (cesim.Rod(aspect=4.0), 0.0),
    "cylinder 4:1": (cesim.Cylinder(aspect=4.0, model="convex", sides=12), 0.0),
}
SPHERES = list(SHAPES)[:2]


def machine(shape, rolling_friction, voltage, options):
    """The reference machine without splitters, fed with one shape at the top of the drum."""
    scene = cesim.scenes.reference_machine("spheres")
    scene.splitters = []
    scene.electrode.voltage = voltage
    scene.numerics.step = options.step * 1e-3
    scene.collect = cesim.Collect(y=-0.10)
    plate = scene.plates[0]
    plate.end = (plate.end[0] + FORWARD, plate.end[1])
    plate.motion = {"kind": "belt", "speed": options.belt}
    for part in (scene.drum, scene.brush, plate, *scene.walls):
        part.rolling_friction = rolling_friction
    x, y, z = cesim.Outlet().center
    scene.feed = cesim.Feed(
        rate=f"{options.rate} 1/s",
        mix={options.material: 1.0},
        size=cesim.Constant(diameter=options.diameter * 1e-3),
        shape=shape,
        outlet=cesim.Outlet(center=(x + FORWARD, y, z)),
    )
    return scene


class Mean:
    """A mean, or a difference of means, with its standard error and degrees of freedom."""

    def __init__(self, value, error, freedom):
        self.value, self.error, self.freedom = value, error, freedom

    @classmethod
    def of(cls, rows):
        """Of x in mm, by drawing whole blocks of landing time."""
        x = 1e3 * rows["position"][:, 0]
        block, blocks = time_blocks(rows["t"], rows["birth"])
        sums, counts = np.bincount(block, x, blocks), np.bincount(block, minlength=blocks)
        times_drawn = np.random.default_rng(1).multinomial(blocks, np.full(blocks, 1 / blocks), size=DRAWS)
        means = (times_drawn @ sums) / (times_drawn @ counts)
        return cls(x.mean(), means.std() * math.sqrt(blocks / (blocks - 1)), blocks - 1)

    def __sub__(self, other):
        freedom = min(self.freedom, other.freedom)
        return Mean(self.value - other.value, math.hypot(self.error, other.error), freedom)

    @property
    def half(self):
        """Half the 95 % interval."""
        return self.error * stats.t.ppf(0.975, self.freedom)

    def __str__(self):
        return f"{self.value:8.2f} ± {self.half:4.2f}"


def run_shape(name, voltage, options):
    """Rows of what landed after the start-up, and the health of the run."""
    scene = machine(*SHAPES[name], voltage, options)
    run = cesim.run(scene, options.seed, threads=1, until=options.until, progress=False, frames=None)
    return run.landings[run.landings["t"] >= WARMUP], run.health


def part_differences(means):
    """(sphere, slender): total, without field, electric."""
    table = {}
    for sphere in SPHERES:
        for slender in SHAPES:
            if slender not in SPHERES:
                total = means[sphere][0] - means[slender][0]
                still = means[sphere][1] - means[slender][1]
                table[sphere, slender] = (total, still, total - still)
    return table


def draw(rows, table, path):
    """Where each shape landed with and without field; the differences in their two parts."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5), layout="constrained")
    for place, name in enumerate(SHAPES):
        for x, color, side, label in zip(rows[name], ("#D55E00", "#0072B2"), (0.12, -0.12), ("on", "off"), strict=True):
            jitter = np.random.default_rng(1).uniform(-0.08, 0.08, len(x))
            left.plot(x, place + side + jitter, ".", color=color, alpha=0.35, markersize=4)
            left.plot(x.mean(), place + side, "|", color="black", markersize=16, markeredgewidth=2)
            left.plot([], [], "o", color=color, label=f"field {label}" if place == 0 else None)
    left.set_yticks(range(len(SHAPES)), SHAPES)
    left.set(xlabel="landing x [mm]", title="where they land; bars: means")
    left.legend(fontsize=9)

    parts = (("total", "#4a4f55"), ("without field", "#0072B2"), ("electric", "#D55E00"))
    for k, (label, color) in enumerate(parts):
        values = [row[k] for row in table.values()]
        at = np.arange(len(values)) + 0.27 * (1 - k)
        right.barh(at, [v.value for v in values], 0.25, xerr=[v.half for v in values], color=color, label=label)
    right.axvline(0.0, color="black", linewidth=1)
    right.set_yticks(range(len(table)), [f"{a}\nless {b}" for a, b in table], fontsize=9)
    right.set(xlabel="sphere farther by [mm]", title="sphere less slender, 95 % intervals")
    right.legend(fontsize=9)
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description="Landing of spheres and slender grains of equal volume.")
    parser.add_argument("--material", default="copper", help="of the scene's materials; default: copper")
    parser.add_argument("--diameter", type=float, default=1.0, metavar="MM", help="of equal volume; default: 1 mm")
    parser.add_argument("--rate", type=float, default=100.0, metavar="1/S", help="of the feed; default: 100 grains/s")
    parser.add_argument("--until", type=float, default=3.0, metavar="S", help="simulated time; default: 3 s")
    parser.add_argument(
        "--belt", type=float, default=0.4, metavar="M/S", help="speed of the plate's belt; default: 0.4"
    )
    parser.add_argument("--step", type=float, default=0.25, metavar="MS", help="time step; default: 0.25 ms")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("slender_and_spherical.png"), metavar="PNG")
    options = parser.parse_args()
    least = WARMUP + 20.0 / options.rate  # s, for two grains a block
    if not options.until > least:
        parser.error(f"--until must be more than {least:g} s: what lands in the first second does not count")

    drum = cesim.Drum()
    width = cesim.Outlet().width
    area = math.pi / 4.0 * (1e-3 * options.diameter) ** 2
    print(f"coverage of the drum: {options.rate * area / (width * drum.speed * drum.radius):.1e}")
    rows, means = {}, {}
    print(f"{'landing x [mm]':<16} {'field on':>15} {'field off':>15} {'unconverged':>12} {'overlap/radius':>15}")
    for name in SHAPES:
        runs = [run_shape(name, voltage, options) for voltage in ("-35 kV", 0.0)]
        rows[name] = [1e3 * landed["position"][:, 0] for landed, _ in runs]
        means[name] = on, off = [Mean.of(landed) for landed, _ in runs]
        failed = max(health.unconverged / health.steps for _, health in runs)
        overlap = max(health.penetration_ratio for _, health in runs)
        print(f"{name:<16} {on} {off} {failed:>11.1%} {overlap:>15.1e}")
    table = part_differences(means)
    print(f"\n{'sphere farther than slender by [mm]':<36} {'total':>15} {'without field':>15} {'electric':>15}")
    for (sphere, slender), parts in table.items():
        print(f"{sphere + ' less ' + slender:<36} {' '.join(map(str, parts))}")
    draw(rows, table, options.out)
    print(f"written {options.out}")


if __name__ == "__main__":
    main()
