"""What the drum's motor gives: torque and power while the feed comes up, runs and ends.

The drum of the reference machine is a steel shell of 20 kg on its axle, driven by a motor that keeps its speed as long
as that takes no more than its torque. Grains fall on the drum before its top: they are brought to its speed, and their
weight is a load until they are over the top. From there it drives the drum. So the motor works most when the first
grains arrive, little while as many go up as go down, and brakes when only those beyond the top are left.

Takes 5 to 15 s. Other settings:

    python examples/drum_motor.py --rate "30 kg/h" --mass 20 --limit 5 --until 2.5
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cesim

FEED = (0.0, 1.0)  # s
WINDOW = 0.05  # s, over which means are taken


def machine(rate, mass, limit):
    """The reference machine with its drum on a motor, fed for a second."""
    scene = cesim.scenes.reference_machine("spheres")
    scene.drum.drive = cesim.Motor(mass=mass, torque_limit=limit)
    scene.feed.rate = rate
    scene.feed.start, scene.feed.stop = FEED
    return scene


def in_the_mean(rows, window):
    """Times, mean torques and mean powers over windows of some output steps; the drum's motor turns it backwards."""
    ends = rows[:: round(window / (rows["time"][1] - rows["time"][0]))]
    span = np.diff(ends["time"])
    return ends["time"][1:] - 0.5 * span, -np.diff(ends["impulse"]) / span, np.diff(ends["energy"]) / span


def draw(run, path):
    """Torque and power over time."""
    time, torque, power = in_the_mean(run.joints["drum"], WINDOW)
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7.0, 5.0), layout="constrained")
    for ax, values, label in ((axes[0], 1e3 * torque, "torque [mN m]"), (axes[1], 1e3 * power, "power [mW]")):
        ax.axvspan(*FEED, color="#f0c419", alpha=0.25, label="feed")
        ax.axhline(0.0, color="#555555", linewidth=1.0)
        ax.plot(time, values, color="#1f5fa8", linewidth=1.8, label=f"motor, means over {1e3 * WINDOW:.0f} ms")
        ax.set_ylabel(label)
        ax.grid(alpha=0.3)
    axes[0].legend(loc="upper right", fontsize=9)
    axes[1].set_xlabel("time [s]")
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description="Torque and power of the drum's motor under feed.")
    parser.add_argument("--rate", default="20 kg/h", help="of the feed; default: 20 kg/h")
    parser.add_argument("--mass", type=float, default=20.0, metavar="KG", help="of the drum; default: 20")
    parser.add_argument("--limit", type=float, default=5.0, metavar="NM", help="of the motor; default: 5")
    parser.add_argument("--until", type=float, default=2.0, metavar="S", help="simulated time; default: 2 s")
    parser.add_argument("--out", type=Path, default=Path("drum_motor.png"), metavar="PNG")
    options = parser.parse_args()
    scene = machine(options.rate, options.mass, options.limit)
    run = cesim.run(scene, until=options.until, progress=False, frames=None)
    rows = run.joints["drum"]
    time, torque, power = in_the_mean(rows, WINDOW)
    for name, k in (("most", torque.argmax()), ("least", torque.argmin())):
        print(f"{name}: {1e3 * torque[k]:+.3f} mN m and {1e3 * power[k]:+.3f} mW at {time[k]:.2f} s")
    print(f"energy given in all: {1e3 * rows['energy'][-1]:+.3f} mJ, to {1e3 * run.balance.fed.kg:.2f} g of feed")
    print(f"slowest: {1.0 - np.abs(rows['speed']).min() / scene.drum.speed:.1e} below its speed")
    draw(run, options.out)
    print(f"written {options.out}")


if __name__ == "__main__":
    main()
