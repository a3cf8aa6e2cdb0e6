"""The field of a drum, a corona wire and a static electrode, alone and in a grounded box.

The two-cylinder formula knows one electrode and no box. A machine has a wire whose ions charge the plastic, a tube that
pulls the metal off, and a grounded case around them. The field of all of them is solved once; from then on any voltages
are a sum. Left: potential and field strength in the box. Right: the field on the drum from its top to its foot, by the
formula for the tube alone, and by all conductors without and with the box. Then one copper and one plastic grain show
what it does to where they land.

Takes a few seconds. Other settings:

    python examples/drum_wire_tube.py --wire -25 --tube -35 --diameter 0.8
"""

import argparse
import math
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

import cesim
from cesim.plots import draw_scene

BOX = {"lower": (-0.45, -0.45), "upper": (0.55, 0.50)}  # m
LABELS = {"tube alone, formula": "#999999", "wire and tube": "#1f5fa8", "wire and tube, in a box": "#c0392b"}


def machine(wire, tube, box):
    """The reference drum with the tube where it was and a wire above it; voltages in kV."""
    scene = cesim.scenes.single_particle()
    scene.electrode.voltage = 1e3 * tube
    scene.electrodes = [
        cesim.Electrode(kind="corona", radius="0.1 mm", distance="0.21 m", angle="65 deg", voltage=1e3 * wire)
    ]
    scene.field = {"kind": "conductors", **({"enclosure": BOX} if box else {})}
    return scene


def on_drum(scene, theta):
    """Field strength in V/m on the drum at angles from its top, towards the electrodes."""
    radius = scene.drum.radius
    points = radius * np.column_stack([np.sin(theta), np.cos(theta), np.zeros(len(theta))])
    return np.linalg.norm(scene.electric_field()(points), axis=1)


def landing(scene, material, diameter):
    """Where a grain put on the drum behind its top lands, in m; NaN: not within two seconds."""
    sim = cesim.Simulation(scene, threads=1)
    height = scene.drum.radius + 0.5e-3 * diameter
    start = math.radians(-5.0)
    speed = scene.drum.speed * scene.drum.radius
    sim.add(
        [height * math.sin(start), height * math.cos(start), 0.0],
        velocity=[speed * math.cos(start), -speed * math.sin(start), 0.0],
        material=material,
        diameter=1e-3 * diameter,
    )
    sim.run(until="2 s")
    return float(sim.landings["position"][0, 0]) if len(sim.landings) else math.nan


def draw(boxed, theta, curves, path):
    """Equipotentials and field strength; field on the drum."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(12.0, 5.2), layout="constrained")
    field = boxed.electric_field()
    x = np.linspace(BOX["lower"][0], BOX["upper"][0], 400)
    y = np.linspace(BOX["lower"][1], BOX["upper"][1], 380)
    points = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], axis=-1).reshape(-1, 3)
    strength = 1e-3 * np.linalg.norm(field(points), axis=1).reshape(len(y), len(x))
    extent = [1e3 * x[0], 1e3 * x[-1], 1e3 * y[0], 1e3 * y[-1]]
    image = left.imshow(strength, extent=extent, origin="lower", norm=LogNorm(10, 1000), cmap="magma")
    potential = 1e-3 * field.potential(points).reshape(len(y), len(x))
    left.contour(1e3 * x, 1e3 * y, potential, levels=np.arange(-40, 0, 2.5), colors="white", linewidths=0.6)
    draw_scene(boxed, left)
    left.set(xlim=extent[:2], ylim=extent[2:], xlabel="x [mm]", ylabel="y [mm]")
    left.set_title("the grounded box, which frames the picture; a line every 2.5 kV", fontsize=10)
    figure.colorbar(image, ax=left, label="|E| [kV/m]", extend="both", shrink=0.85)
    for name, values in curves.items():
        right.plot(np.degrees(theta), 1e-3 * values, color=LABELS[name], linewidth=1.8, label=name)
    for electrode, name in ((boxed.electrodes[0], "wire"), (boxed.electrode, "tube")):
        right.axvline(90.0 - math.degrees(electrode.angle), color="#555555", linestyle=":", linewidth=1.0)
        right.text(90.5 - math.degrees(electrode.angle), 5.0, name, fontsize=9, color="#555555")
    right.set(xlabel="angle from the drum's top [deg]", ylabel="|E| on the drum [kV/m]", ylim=(0, None))
    right.legend(fontsize=9)
    right.grid(alpha=0.3)
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description="Field of a drum, a corona wire and a static electrode.")
    parser.add_argument("--wire", type=float, default=-30.0, metavar="KV", help="voltage of the wire; default: -30")
    parser.add_argument("--tube", type=float, default=-35.0, metavar="KV", help="voltage of the tube; default: -35")
    parser.add_argument("--diameter", type=float, default=0.7, metavar="MM", help="of the grains; default: 0.7")
    parser.add_argument("--out", type=Path, default=Path("drum_wire_tube.png"), metavar="PNG")
    options = parser.parse_args()

    theta = np.radians(np.linspace(-20.0, 180.0, 401))
    formula = cesim.scenes.single_particle()
    formula.electrode.voltage = 1e3 * options.tube
    scenes = dict(
        zip(LABELS, [formula, *(machine(options.wire, options.tube, box) for box in (False, True))], strict=True)
    )
    curves = {name: on_drum(scene, theta) for name, scene in scenes.items()}
    print(f"{'|E| on the drum [kV/m]':<26} {'at the wire':>12} {'at the tube':>12} {'at the foot':>12}")
    for name, values in curves.items():
        shown = [1e-3 * np.interp(math.radians(angle), theta, values) for angle in (25.0, 60.0, 180.0)]
        print(f"{name:<26} {shown[0]:>12.1f} {shown[1]:>12.1f} {shown[2]:>12.1f}")

    boxed = scenes["wire and tube, in a box"]
    field = boxed.electric_field()
    print(f"largest error of the potential, of the voltage: {field.boundary_error:.1e}")
    began = time.perf_counter()
    for voltage in np.linspace(-40e3, -10e3, 31):
        field.with_voltages([0.0, voltage, 1e3 * options.wire])
    print(f"31 voltages of the tube, nothing solved again: {1e3 * (time.perf_counter() - began):.0f} ms")

    print(f"{'landing x [mm]':<26} {'copper':>12} {'ABS':>12}")
    for name, scene in scenes.items():
        found = [1e3 * landing(scene, material, options.diameter) for material in ("copper", "ABS")]
        print(f"{name:<26} {found[0]:>12.1f} {found[1]:>12.1f}")
    draw(boxed, theta, curves, options.out)
    print(f"written {options.out}")


if __name__ == "__main__":
    main()
