"""Recovery over drum speed and voltage: a sweep on several processes that ends in a heat map.

Every point of the grid is a run of the reference machine with the same stream of grains and splitters at fixed places.
One map shows how much of the copper flies beyond the right splitter, the other how much of the ABS stays before the
left one: speed and voltage both send copper farther; voltage holds plastic back, and speed throws it off. The CSV file
beside the picture has the grades as well.

The grains are few, so that a point takes seconds; what a crowded drum loses is not in these maps. Virtual splitters cut
the landing plane: blades would stand in the way of some settings.

Takes 50 to 80 s on two cores. Other settings:

    python examples/drum_speed_voltage.py --speeds 30 60 90 --voltages 15 25 35 --until 6 --workers 8
"""

import argparse
import csv
import itertools
import multiprocessing
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from tqdm import tqdm

import cesim

SPLITTERS = (0.175, 0.228)  # m: plastic lands left of the first, copper right of the second
WARMUP = 1.0  # s until the stream over the drum is steady; what lands before does not count
MAPS = {"recovery[copper]": "copper right of {1:.0f} mm", "recovery[ABS]": "ABS left of {0:.0f} mm"}


def machine(rpm, kilovolt):
    """The reference machine at one setting, with a dilute feed of many sizes."""
    scene = cesim.scenes.reference_machine("spheres")
    scene.drum.speed = f"{rpm} rpm"
    scene.electrode.voltage = f"{-kilovolt} kV"
    scene.splitters = []
    scene.feed = cesim.Feed(
        rate="1000 1/s",
        mix={"copper": 0.3, "ABS": 0.7},
        size=cesim.LogNormal(median="0.9 mm", gsd=1.35, least="0.4 mm", most="1.8 mm"),
    )
    return scene


def point(rpm, kilovolt, until):
    """Run one setting; return its row of the table. One thread: the processes share the cores among them."""
    run = cesim.run(machine(rpm, kilovolt), seed=1, threads=1, until=until, progress=False, frames=None)
    row = {"speed_rpm": rpm, "voltage_kV": -kilovolt, "landed": len(run.landings)}
    for quantity, material in itertools.product(("recovery", "grade"), ("copper", "ABS")):
        estimate = getattr(run, quantity)(material, splitters=SPLITTERS, warmup=WARMUP)
        name = f"{quantity}[{material}]"
        row |= {name: float(estimate), f"{name}.low": estimate.low, f"{name}.high": estimate.high}
    return row


def sweep(speeds, voltages, until, workers):
    """All settings, on a pool of fresh processes, in the order of the grid."""
    grid = list(itertools.product(speeds, voltages))
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        jobs = {pool.submit(point, rpm, kilovolt, until): (rpm, kilovolt) for rpm, kilovolt in grid}
        done = {jobs[job]: job.result() for job in tqdm(as_completed(jobs), total=len(jobs), unit=" runs")}
    return [done[setting] for setting in grid]


def draw(rows, speeds, voltages, path):
    """One heat map per product, each cell with its number and, below, its interval."""
    figure, axes = plt.subplots(1, 2, sharey=True, layout="constrained")
    figure.set_size_inches(3.0 + 1.4 * len(speeds), 1.8 + 0.5 * len(voltages))
    shape = (len(speeds), len(voltages))
    for ax, (name, title) in zip(axes, MAPS.items(), strict=True):
        value, low, high = (np.reshape([row[name + end] for row in rows], shape).T for end in ("", ".low", ".high"))
        image = ax.imshow(100 * value, origin="lower", aspect="auto", vmin=0, vmax=100, cmap="viridis")
        for (j, i), p in np.ndenumerate(value):
            style = {"ha": "center", "color": "white" if p < 0.6 else "black"}
            ax.text(i, j, f"{100 * p:.0f}", va="bottom", fontsize=10, **style)
            ax.text(
                i,
                j - 0.08,
                f"{np.floor(100 * low[j, i]):.0f}–{np.ceil(100 * high[j, i]):.0f}",
                va="top",
                fontsize=7,
                **style,
            )
        ax.set_title("recovery of " + title.format(*1e3 * np.array(SPLITTERS)) + " [%]", fontsize=11)
        ax.set_xticks(range(len(speeds)), [f"{rpm:g}" for rpm in speeds])
        ax.set_yticks(range(len(voltages)), [f"{-kilovolt:g}" for kilovolt in voltages])
        ax.set_xlabel("drum speed [rpm]")
    axes[0].set_ylabel("electrode voltage [kV]")
    figure.colorbar(image, ax=axes, label="recovery [%]; below: 95 % interval", pad=0.01)
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description="Sweep drum speed and voltage; draw maps of recovery.")
    parser.add_argument("--speeds", type=float, nargs="+", default=[36, 40, 44, 48, 52, 56], metavar="RPM")
    parser.add_argument("--voltages", type=float, nargs="+", default=[15, 20, 25, 30, 35, 40], metavar="KV")
    parser.add_argument("--until", type=float, default=3.5, metavar="S", help="simulated time; default: 3.5 s")
    parser.add_argument("--workers", type=int, default=2, help="processes; default: 2")
    parser.add_argument("--out", type=Path, default=Path("drum_speed_voltage.png"), metavar="PNG")
    options = parser.parse_args()
    if options.until <= WARMUP:
        parser.error(f"--until must be more than the {WARMUP:g} s that do not count")
    rows = sweep(options.speeds, options.voltages, options.until, options.workers)
    with options.out.with_suffix(".csv").open("w", newline="") as file:
        table = csv.DictWriter(file, rows[0])
        table.writeheader()
        table.writerows(rows)
    draw(rows, options.speeds, options.voltages, options.out)
    best = max(rows, key=lambda row: sum(row[name] for name in MAPS))
    print("most of both at {speed_rpm:g} rpm and {voltage_kV:g} kV: ".format_map(best), end="")
    print(f"copper {best['recovery[copper]']:.1%}, ABS {best['recovery[ABS]']:.1%} recovered")
    print(f"written {options.out}, {options.out.with_suffix('.csv')}")


if __name__ == "__main__":  # the processes of the pool import this file, too
    main()
