"""What the drum's motor gives: torque and power while the feed comes up, runs and ends.

The drum of the reference machine is a steel shell of 20 kg on its axle, driven by a motor that keeps its speed as
long as that takes no more than its torque. Grains that fall on the drum take angular momentum until they leave it.
The picture shows the torque of the motor and the power that it gives, and beside them what the feed would take if
every grain left at the speed of the drum's surface: the feed rate times that speed times the radius.

Takes about 10 s. Other settings:

    python examples/drum_motor.py --rate "30 kg/h" --mass 20 --limit 5 --until 2.5
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cesim

FEED = (0.0, 1.0)  # s


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


def draw(run, carried, path):
    """Torque and power over time."""
    rows, radius = run.joints["drum"], run.scene.drum.radius
    time, torque, power = in_the_mean(rows, 0.05)
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7.0, 5.0), layout="constrained")
    for ax, values, full, label in (
        (axes[0], 1e3 * torque, 1e3 * carried * radius, "torque [mN m]"),
        (axes[1], 1e3 * power, 1e3 * carried * run.scene.drum.speed * radius, "power [mW]"),
    ):
        ax.axvspan(*FEED, color="#f0c419", alpha=0.25, label="feed")
        ax.axhline(full, color="#555555", linestyle="--", linewidth=1.2, label="rate × surface speed")
        ax.plot(time, values, color="#1f5fa8", linewidth=1.8, label="motor, means over 50 ms")
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
    speed = scene.drum.speed * scene.drum.radius  # m/s, of the drum's surface
    carried = float(scene.feed.rate) * speed  # N
    time, torque, power = in_the_mean(run.joints["drum"], 0.05)
    busy = (time > 0.6) & (time < FEED[1])
    print(f"with the feed on: {1e3 * torque[busy].mean():.2f} mN m, {1e3 * power[busy].mean():.2f} mW")
    print(f"rate x surface speed: {1e3 * carried * scene.drum.radius:.2f} mN m, {1e3 * carried * speed:.2f} mW")
    print(f"energy given: {1e3 * run.joints['drum']['energy'][-1]:.2f} mJ to {1e3 * run.balance.fed.kg:.2f} g of feed")
    print(f"slowest: {1.0 - np.abs(run.joints['drum']['speed']).min() / scene.drum.speed:.1e} below its speed")
    draw(run, carried, options.out)
    print(f"written {options.out}")


if __name__ == "__main__":
    main()
