"""Where grains land that are neither metal nor plastic: by their decay time, and by how much of them is metal.

On the left grains between copper and plastic by the law of relaxation: a charge that the corona gives decays on the
drum in the time tau, towards the charge of contact. With tau far below the time on the drum (top to brush) they are
thrown off like metals, far above it they are pinned like plastics; between, conduction competes with the ions of the
corona. The curve is continuous: grains count as metal or plastic only where that moves them by less than 1 mm. On the
right grains that were not liberated, by the share of metal in them. All have one size and one density, so that only
the charge differs; the lines are a conductor and an insulator.

Takes 20 s.

    python examples/middlings.py
    python examples/middlings.py --diameter 0.8 --grains 8
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cesim
from cesim.scene.electrics import kind_of

DENSITY, PERMITTIVITY = 1900.0, 4.65
TIMES = np.geomspace(1e-9, 1e3, 25)  # s
SHARES = np.linspace(0.0, 0.95, 9)


def between(tau):
    """A material whose charges decay in tau."""
    return cesim.Material(kind="middling", density=DENSITY, permittivity=PERMITTIVITY, decay_time=tau)


def machine(material):
    """The reference machine with spheres, which meet nothing but drum, brush and air, and this material."""
    scene = cesim.scenes.single_particle()
    scene.corona = cesim.Corona(current_density=2e-3, kinetics="on")
    scene.brush = cesim.scenes.reference_machine().brush
    scene.drum.rolling_friction = 0.35
    scene.materials["it"] = material
    return scene


def landings(material, diameter, grains):
    """x in m where grains land that start on the top of the drum, spread over a step's way."""
    scene = machine(material)
    sim = cesim.Simulation(scene, threads=1)
    radius = scene.drum.radius + diameter / 2
    angle = np.linspace(-0.02, 0.02, grains)
    width = np.linspace(-0.1, 0.1, grains)
    position = np.column_stack([radius * np.sin(angle), radius * np.cos(angle), width])
    velocity = scene.drum.speed * np.column_stack([position[:, 1], -position[:, 0], 0.0 * angle])
    sim.add(position, velocity=velocity, material="it", diameter=diameter)
    sim.run("3 s")
    return sim.landings["position"][:, 0] if len(sim.landings) else np.array([np.nan])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--diameter", type=float, default=1.0, metavar="MM", help="of the grains [mm]")
    parser.add_argument("--grains", type=int, default=6, metavar="N", help="of each kind")
    parser.add_argument("--out", type=Path, default=Path("middlings.png"), help="picture to write")
    options = parser.parse_args()
    diameter = options.diameter * 1e-3

    def place(**fields):
        x = landings(cesim.Material(density=DENSITY, **fields), diameter, options.grains)
        return 1e3 * float(np.mean(x))

    metal = place(kind="conductor")
    plastic = place(kind="insulator", permittivity=PERMITTIVITY)
    by_time = [1e3 * float(np.mean(landings(between(tau), diameter, options.grains))) for tau in TIMES]
    by_share = [place(kind="insulator", permittivity=PERMITTIVITY, conductor_share=share) for share in SHARES]
    print(f"conductor lands at x = {metal:.0f} mm, insulator at x = {plastic:.0f} mm")
    for tau, x in zip(TIMES, by_time, strict=True):
        print(f"decay time {tau:.3g} s: x = {x:.0f} mm")
    for share, x in zip(SHARES, by_share, strict=True):
        print(f"metal share {share:.2f}: x = {x:.0f} mm")

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), sharey=True, layout="constrained")
    for axes in (left, right):
        axes.axhline(metal, color="#D55E00", lw=1.5, label="conductor")
        axes.axhline(plastic, color="#0072B2", lw=1.5, label="insulator")
        axes.grid(alpha=0.3)
    left.semilogx(TIMES, by_time, "o-", color="#009E73", label="middling")
    scene = machine(cesim.Material(kind="conductor", density=DENSITY))
    followed = [tau for tau in np.geomspace(1e-9, 1e3, 400) if kind_of(scene, between(tau)) == "middling"]
    left.axvspan(followed[0], followed[-1], color="0.9", zorder=0, label="its decay is followed")
    left.set_xlabel("decay time [s]")
    left.set_ylabel("landing x [mm]")
    left.legend(loc="center right")
    right.plot(SHARES, by_share, "s-", color="#CC79A7", label="mixture")
    right.set_xlabel("share of metal, by volume")
    right.legend(loc="center right")
    figure.suptitle(f"Grains of {options.diameter:g} mm and {DENSITY:g} kg/m³ between metal and plastic")
    figure.savefig(options.out, dpi=120)
    print(f"written {options.out}")


if __name__ == "__main__":
    main()
