"""The ions of a corona wire: field and current density along the drum, current against voltage, and charging by them.

A wire above the drum burns from its onset on, by Peek's law. Its ions raise the field on the drum to several times that
without them, and spread over an arc that follows from the wire's place, not from a number in the scene. The picture
shows both along the drum for a set of voltages, and the current of the wire; in its last panel grains of plastic ride
under the wire, and what they collect is set against instant charging by the field without ions.

Takes 5 s.

    python examples/corona_current.py
    python examples/corona_current.py --radius 0.1 --gap 60 --voltages 20 30 40
"""

import argparse
import math
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cesim

COLORS = ("#0072B2", "#009E73", "#D55E00", "#CC79A7", "#E69F00")
DIAMETER = 0.5e-3  # m, of the grains of plastic


def machine(radius, gap, voltage, model="deutsch"):
    """The reference drum under a wire, 30 degrees from its top."""
    drum = cesim.Drum(friction=0.5, rolling_friction=0.5)
    wire = {"kind": "corona", "radius": radius, "distance": drum.radius + gap, "angle": "60 deg", "voltage": voltage}
    corona = cesim.Corona(model=model, arc=("-20 deg", "80 deg"))
    return cesim.Scene(name="corona", drum=drum, electrode=wire, corona=corona, numerics={"step": "0.5 ms"})


def ride(scene, angle=-0.9):
    """Angle from the top [rad] and charge [C] of a grain of plastic that the drum carries under the wire."""
    sim = cesim.Simulation(scene, threads=1)
    reach = scene.drum.radius + DIAMETER / 2
    sim.add(
        (reach * math.sin(angle), reach * math.cos(angle), 0.0),
        velocity=(scene.drum.speed * reach * math.cos(angle), -scene.drum.speed * reach * math.sin(angle), 0.0),
        angular_velocity=(0.0, 0.0, -scene.drum.speed),
        material="ABS",
        diameter=DIAMETER,
    )
    rows = []
    while sim.time < 0.45:
        rows.append((math.atan2(sim.position[0, 0], sim.position[0, 1]), sim.charge[0]))
        sim.step()
    return np.transpose(rows)


def main():
    parser = argparse.ArgumentParser(description="Field and ion current of a corona wire along the drum.")
    parser.add_argument("--radius", type=float, default=0.15, metavar="MM", help="of the wire; default: 0.15")
    parser.add_argument("--gap", type=float, default=70.0, metavar="MM", help="from wire to drum; default: 70")
    parser.add_argument("--voltages", type=float, nargs="+", default=[15.0, 20.0, 30.0], metavar="KV")
    parser.add_argument("--out", type=Path, default=Path("corona_current.png"), metavar="PNG")
    options = parser.parse_args()

    figure, axes = plt.subplots(2, 2, figsize=(11, 7.5), layout="constrained")
    (field, density), (curve, charge) = axes
    for kilovolts, color in zip(options.voltages, COLORS * 9, strict=False):
        scene = machine(1e-3 * options.radius, 1e-3 * options.gap, -1e3 * kilovolts)
        found = scene.ionised_field()
        degrees, name = np.degrees(found.angle), f"{kilovolts:g} kV"
        field.plot(degrees, 1e-3 * found.laplacian_field, color=color, linestyle=":")
        field.plot(degrees, 1e-3 * found.field, color=color, label=name)
        density.plot(degrees, 1e3 * found.current_density, color=color, label=name)
        top = np.argmax(found.field)
        print(
            f"{kilovolts:g} kV: onset {1e-3 * found.onset_voltage[0]:.2f} kV; {1e3 * found.current:.3g} mA/m; under "
            f"the wire {1e-3 * found.laplacian_field[top]:.0f} kV/m without ions, {1e-3 * found.field[top]:.0f} with, "
            f"{1e3 * found.current_density[top]:.3g} mA/m2"
        )
        angle, collected = ride(scene)
        charge.plot(np.degrees(angle), -1e12 * collected, color=color, label=name)
        arc = ride(machine(1e-3 * options.radius, 1e-3 * options.gap, -1e3 * kilovolts, model="arc"))
        charge.plot(np.degrees(arc[0]), -1e12 * arc[1], color=color, linestyle=":")
    voltages = np.linspace(0.0, 1.2e3 * max(options.voltages), 121)
    curve.plot(1e-3 * voltages, 1e3 * found.currents(voltages), color="#4a4f55")
    curve.set(xlabel="voltage [kV]", ylabel="current [mA/m]", title="current of the wire", ylim=(0, None))
    field.set(ylabel="|E| [kV/m]", title="field on the drum; dotted: without ions", ylim=(0, None))
    density.set(ylabel="current density [mA/m$^2$]", title="ions that arrive on the drum", ylim=(0, None))
    charge.set(
        ylabel="-charge [pC]", title="charge that a grain collects; dotted: without the ions' field", ylim=(0, None)
    )
    for ax in (field, density, charge):
        ax.set(xlabel="angle from the drum's top [degrees]", xlim=(-50, 50 if ax is charge else 110))
        ax.legend(fontsize=9)
    figure.savefig(options.out, dpi=150)
    print(f"written {options.out}")


if __name__ == "__main__":
    main()
