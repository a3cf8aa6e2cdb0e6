"""Wire ends that were not liberated: copper at one end, PVC at the other, and where they land by their share of copper.

On the left one of them, in steps of some milliseconds: it rides on the drum on whatever side it lies, its copper takes
charge where it touches, the field pulls it off by that end, and it turns as it flies. On the right the landings of rods
whose first spheres are copper, from many poses, beside spheres of the same contents that are averaged to mixtures:
a mixture has one place to land, a composite lands by how it lay. All have one volume.

Takes ten seconds.

    python examples/composites.py
    python examples/composites.py --diameter 1 --grains 10
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cesim

SPHERES = 6
COPPER, PVC = "#D55E00", "#0072B2"
LARGER = 4


def rod(copper):
    """Six spheres in a row, the first ones of copper."""
    centers = [(0.9 * k, 0.0, 0.0, 0.5) for k in range(SPHERES)]
    return cesim.Composite(spheres=centers, materials=["copper"] * copper + ["PVC"] * (SPHERES - copper))


def machine():
    """The reference machine, whose grains meet nothing but drum, brush and air."""
    scene = cesim.scenes.single_particle()
    reference = cesim.scenes.reference_machine()
    scene.corona, scene.brush = reference.corona, reference.brush
    for copper in range(1, SPHERES):
        scene.shapes[f"{copper} of {SPHERES}"] = rod(copper)
        contents = cesim.shapes.template(rod(copper)).contents
        scene.materials[f"mixture {copper}"] = cesim.Material.mixture(contents, friction=0.2)
    return scene


def start(sim, grains, diameter, seed=5):
    """Places on the drum near its top, with its speed, and poses at random: arguments of `Simulation.add`."""
    random = np.random.default_rng(seed)
    speed = sim.definition["surfaces"][0]["angular_speed"]
    angle = np.linspace(-0.15, 0.05, grains)
    height = sim.definition["drum_radius"] + 1.3 * diameter
    position = np.column_stack([height * np.sin(angle), height * np.cos(angle), np.linspace(-0.1, 0.1, grains)])
    turn = random.uniform(0.0, 2.0 * np.pi, grains)
    orientation = np.column_stack([np.cos(turn / 2), 0.0 * turn, np.sin(turn / 2), 0.0 * turn])  # lying, any way
    velocity = abs(speed) * np.column_stack([position[:, 1], -position[:, 0], 0.0 * angle])
    return {"position": position, "velocity": velocity, "orientation": orientation, "diameter": diameter}


def landings(scene, grains, diameter, **what):
    """x in mm where grains land."""
    sim = cesim.Simulation(scene, seed=1)
    sim.add(**start(sim, grains, diameter), **what)
    sim.run("2.5 s")
    return 1e3 * sim.landings["position"][:, 0]


def draw_flight(axes, scene, diameter):
    """A rod of half copper at some instants, seen along the drum's axis."""
    sim = cesim.Simulation(scene, seed=1)
    row = [template.name for template in sim.shapes].index("3 of 6")
    template = sim.shapes[row]
    arguments = {name: value[:1] if np.ndim(value) else value for name, value in start(sim, 9, diameter).items()}
    arguments["orientation"] = (1.0, 0.0, 0.0, 0.0)  # across the drum's axis
    sim.add(shape="3 of 6", **arguments)
    axes.add_patch(plt.Circle((0.0, 0.0), 1e3 * scene.drum.radius, color="0.85"))
    for instant in range(60):
        if not sim.count or sim.position[0, 1] < -0.1:
            break
        if instant % 2 == 0:
            w, vector = sim.orientation[0, 0], sim.orientation[0, 1:]
            arms = template.spheres[:, :3]
            turned = arms + 2.0 * np.cross(vector, np.cross(vector, arms) + w * arms)
            for place, radius, name in zip(turned, template.spheres[:, 3], template.materials, strict=True):
                x, y, _ = 1e3 * (sim.position[0] + LARGER * diameter * place)
                color = COPPER if name == "copper" else PVC
                axes.add_patch(plt.Circle((x, y), 1e3 * LARGER * radius * diameter, color=color, lw=0))
        sim.run(sim.time + 6e-3)
    axes.set(xlim=(60, 250), ylim=(-105, 150), aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    axes.set_title(f"half copper (orange), half PVC (blue), drawn {LARGER} times as large")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--diameter", type=float, default=1.5, metavar="MM", help="of the sphere of equal volume [mm]")
    parser.add_argument("--grains", type=int, default=24, metavar="N", help="of each kind")
    parser.add_argument("--out", type=Path, default=Path("composites.png"), help="picture to write")
    options = parser.parse_args()
    scene, diameter = machine(), 1e-3 * options.diameter

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
    draw_flight(left, scene, diameter)
    for copper in range(1, SPHERES):
        share = cesim.shapes.template(rod(copper)).contents["copper"]
        rods = landings(scene, options.grains, diameter, shape=f"{copper} of {SPHERES}")
        spheres = landings(scene, options.grains, diameter, material=f"mixture {copper}")
        print(f"{share:.0%} copper: composites land at {spread(rods)}, mixtures at {spread(spheres)}")
        for x, color, marker, shift, label in (
            (rods, "#009E73", "o", -0.006, "composite rods"),
            (spheres, "#CC79A7", "s", 0.006, "mixtures (spheres)"),
        ):
            right.plot(
                np.full(len(x), share + shift),
                x,
                marker,
                color=color,
                ms=5,
                alpha=0.6,
                label=label if copper == 1 else "",
            )
    for name, color in (("copper", COPPER), ("PVC", PVC)):
        x = landings(scene, options.grains, diameter, material=name)
        print(f"{name} spheres land at {spread(x)}")
        right.axhline(np.median(x) if len(x) else np.nan, color=color, lw=1.2, label=f"{name} spheres")
    right.set(xlabel="mass fraction of copper", ylabel="landing x [mm]", title="where they land")
    right.grid(alpha=0.3)
    right.legend()
    figure.savefig(options.out, dpi=120)
    print(f"written {options.out}")


def spread(x):
    """Median and range, or what there is to say."""
    return f"{np.median(x):.0f} mm ({x.min():.0f} to {x.max():.0f})" if len(x) else "nowhere"


if __name__ == "__main__":
    main()
