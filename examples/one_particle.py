"""One grain of copper and one of plastic, followed step by step from the top of the drum to the landing plane.

Both ride on the drum. The copper grain takes charge from the drum it touches, more the nearer it comes to the
electrode, and is pulled off. The plastic grain is showered with ions of the electrode's sign in the corona's arc,
between 10 and 60 degrees from the top; that charge presses it to the drum, which it leaves later, if at all. The
picture shows the paths over the machine and its equipotential lines, and against time the height over the drum, the
charge and the speed of each grain.

Takes 2 s.

    python examples/one_particle.py
    python examples/one_particle.py --speed 60 --voltage 25 --diameter 0.5
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cesim
from cesim.plots import draw_scene

MATERIALS = {"copper": "#D55E00", "ABS": "#0072B2"}


def follow(scene, material, diameter):
    """Path of one grain: time, position, charge and speed at every step, and when it last touched the drum."""
    sim = cesim.Simulation(scene, threads=1)
    radius = scene.drum.radius + diameter / 2
    sim.add([0, radius, 0], velocity=[scene.drum.speed * radius, 0, 0], material=material, diameter=diameter)
    rows, left = [], 0
    while sim.count and sim.time < 2.0:
        rows.append((sim.time, *sim.position[0], sim.charge[0], np.linalg.norm(sim.velocity[0])))
        sim.step()
        if np.any(sim.contacts["impulse"]):
            left = len(rows)  # it is still pressed against the drum
    if not len(sim.landings):
        raise SystemExit(f"the {material} grain did not land within {sim.time:.1f} s")
    end = sim.landings[0]
    rows.append((end["t"], *end["position"], end["charge"], np.linalg.norm(end["velocity"])))
    t, x, y, _, charge, speed = np.transpose(rows)
    return {"t": t, "x": x, "y": y, "charge": charge, "speed": speed, "left": left}


def draw_potential(scene, ax):
    """Equipotential lines between drum and electrodes, every 5 kV."""
    field = scene.electric_field()
    x, y = np.meshgrid(np.linspace(-0.175, 0.335, 256), np.linspace(-0.175, 0.225, 201))
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    potential = np.where(field.inside_conductors(points), np.nan, 1e-3 * field.potential(points)).reshape(x.shape)
    lines = ax.contour(1e3 * x, 1e3 * y, potential, np.arange(-100, 101, 5), colors="#c9b458", linewidths=0.7)
    ax.clabel(lines, fmt="%g kV", fontsize=7)


def draw(scene, paths, path):
    """The paths over the machine, and height, charge and speed against time."""
    figure = plt.figure(figsize=(12, 6.3), layout="constrained")
    axes = figure.subplot_mosaic(
        [["machine", "height"], ["machine", "charge"], ["machine", "speed"]], width_ratios=(1.35, 1)
    )
    draw_potential(scene, axes["machine"])
    draw_scene(scene, axes["machine"])
    axes["machine"].set(xlabel="x [mm]", ylabel="y [mm]", xlim=(-175, 335), ylim=(-175, 225), aspect="equal")
    panels = {
        "height": ("height over drum [mm]", lambda p, d: 1e3 * (np.hypot(p["x"], p["y"]) - scene.drum.radius - d / 2)),
        "charge": ("charge [pC]", lambda p, d: 1e12 * p["charge"]),
        "speed": ("speed [m/s]", lambda p, d: p["speed"]),
    }
    for material, (diameter, p) in paths.items():
        color, left = MATERIALS[material], p["left"]
        axes["machine"].plot(1e3 * p["x"], 1e3 * p["y"], color=color, linewidth=1.8, label=material, zorder=4)
        axes["machine"].plot(1e3 * p["x"][left], 1e3 * p["y"][left], "o", color=color, zorder=5)
        for name, (title, value) in panels.items():
            axes[name].plot(p["t"], value(p, diameter), color=color, linewidth=1.8)
            axes[name].plot(p["t"][left], value(p, diameter)[left], "o", color=color)
            axes[name].set_ylabel(title)
    axes["machine"].plot([], [], "o", color="#4a4f55", label="leaves the drum")
    axes["machine"].legend(loc="lower left", fontsize=9)
    axes["speed"].set_xlabel("time [s]")
    axes["charge"].axhline(0, color="#4a4f55", linewidth=0.8)
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description="Follow a copper and a plastic grain through the separator.")
    parser.add_argument("--speed", type=float, default=44.8, metavar="RPM", help="of the drum; default: 44.8")
    parser.add_argument("--voltage", type=float, default=35.0, metavar="KV", help="default: 35")
    parser.add_argument("--diameter", type=float, default=0.9, metavar="MM", help="of both grains; default: 0.9")
    parser.add_argument("--out", type=Path, default=Path("one_particle.png"), metavar="PNG")
    options = parser.parse_args()

    scene = cesim.scenes.single_particle()
    scene.drum.speed = f"{options.speed} rpm"
    scene.electrode.voltage = f"{-options.voltage} kV"
    diameter = 1e-3 * options.diameter
    paths = {material: (diameter, follow(scene, material, diameter)) for material in MATERIALS}
    for material, (_, p) in paths.items():
        x, y, t = (p[name][p["left"]] for name in "xyt")
        print(
            f"{material:<7} leaves the drum at {t:.3f} s, {np.degrees(np.arctan2(x, y)):.1f} degrees from its top,",
            end=" ",
        )
        print(f"with {1e12 * p['charge'][-1]:+.2f} pC; lands at {p['t'][-1]:.3f} s, x = {1e3 * p['x'][-1]:.1f} mm")
    draw(scene, paths, options.out)
    print(f"written {options.out}")


if __name__ == "__main__":
    main()
