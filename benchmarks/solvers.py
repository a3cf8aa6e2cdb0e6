"""Work and precision of the solvers, compared within one run.

    python benchmarks/solvers.py                    # 20 000 spheres, 5 000 clusters, a hyperstatic stack: some minutes
    python benchmarks/solvers.py --small --plot solvers.png

Each scene is let fall for some steps; then every solver gets the contact problem of the next step, from no
impulses, with budgets of 10 to 1000 iterations. What is left is told as the residual [m/s] of docs/numerics.md 2
and as the energy gap: how far the convex objective (the law is ccp, so that there is one) lies above the least that
any solver found, over that least. A run that stopped before its tolerance of 1e-9 m/s is marked with a star.
"""

import argparse

import numpy as np

import cesim

BUDGETS = (10, 30, 100, 300, 1000)
TOLERANCE = 1e-9  # m/s
FRICTION = 0.3
D = 1e-3  # m


def box(width: float, shapes: dict | None = None) -> cesim.Scene:
    """Five walls, a width in m apart."""
    scene = cesim.scenes.settling_box()
    for wall, (x, z) in zip(scene.walls[1:], ((-1, 0), (1, 0), (0, -1), (0, 1)), strict=True):
        wall.position = (0.5 * width * x, 0.0, 0.5 * width * z)
    for wall in scene.walls:
        wall.friction = FRICTION
    scene.materials["ABS"].friction = FRICTION
    scene.shapes = shapes or {}
    scene.effects["drag"] = "off"
    scene.numerics.contact_law = "ccp"
    scene.numerics.max_iterations = 30  # on the way: the heap needs to be one, not to be solved
    return scene


def bed(count: int, spacing: float, shape: cesim.Flake | None, seed: int = 1) -> cesim.Simulation:
    """Grains that fall into a box as wide as six of them are high."""
    side = round((6.0 * count) ** (1.0 / 3.0))
    scene = box((side + 1) * spacing, {"flake": shape} if shape is not None else None)
    sim = cesim.Simulation(scene, threads=1)
    rng = np.random.default_rng(seed)
    place = np.indices((count // side**2 + 1, side, side)).reshape(3, -1).T[:count, [1, 0, 2]].astype(float)
    place[:, [0, 2]] -= 0.5 * (side - 1)
    place = place * spacing + np.array([0.0, 0.7 * spacing, 0.0]) + rng.uniform(-0.02, 0.02, (count, 3)) * spacing
    turned = rng.normal(size=(count, 4))
    sim.add(place, material="ABS", diameter=D, orientation=turned, shape="flake" if shape is not None else None)
    sim.step(60)
    return sim


def stack(storeys: int) -> cesim.Simulation:
    """Square plates of nine spheres on each other: nine contacts carry what three would."""
    spheres = [[x, 0.0, z, 0.5] for x in (-0.9, 0.0, 0.9) for z in (-0.9, 0.0, 0.9)]
    plate = cesim.Cluster(spheres=spheres)
    scene = box(0.05, {"plate": plate})
    sim = cesim.Simulation(scene, threads=1)
    radius = max(sim.shapes[1].spheres[:, 3]) * D
    sim.add([[0.0, radius * (1 + 2 * k), 0.0] for k in range(storeys)], material="ABS", diameter=D, shape="plate")
    sim.step(5)
    return sim


def measure(sim: cesim.Simulation) -> dict[str, list[dict]]:
    """The trials of every solver, by name, one a budget."""
    names = [row["name"] for row in cesim.engine.contact_solvers()]
    return {name: [sim.engine.try_solver(name, budget, TOLERANCE, True) for budget in BUDGETS] for name in names}


def report(title: str, trials: dict[str, list[dict]]) -> None:
    """A table, one row a solver: seconds, residual and energy gap by budget."""
    least = min(trial["objective"] for row in trials.values() for trial in row)
    print(f"\n{title}: {trials['pgs'][0]['contacts']} contacts")
    print(f"{'':8}" + "".join(f"{budget:>30} it" for budget in BUDGETS))
    for name, row in trials.items():
        cells = [
            f"{t['seconds']:9.3g} s {t['residual']:8.1e} {(t['objective'] - least) / abs(least):8.1e}"
            f"{' ' if t['converged'] else '*'}"
            for t in row
        ]
        print(f"{name:8}" + "".join(f"{cell:>33}" for cell in cells))


def draw(results: dict[str, dict[str, list[dict]]], path: str) -> None:
    """Residual and energy gap against time, log-log."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, len(results), figsize=(4.2 * len(results), 7), squeeze=False)
    for column, (title, trials) in enumerate(results.items()):
        least = min(trial["objective"] for row in trials.values() for trial in row)
        for name, row in trials.items():
            time = [trial["seconds"] for trial in row]
            gap = [max((trial["objective"] - least) / abs(least), 1e-16) for trial in row]
            axes[0, column].loglog(time, [trial["residual"] for trial in row], "o-", ms=3, label=name)
            axes[1, column].loglog(time, gap, "o-", ms=3, label=name)
        axes[0, column].set(title=title, ylabel="residual [m/s]")
        axes[1, column].set(xlabel="time in the solver [s]", ylabel="energy gap, over the least")
    axes[0, 0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spheres", type=int, default=20_000, help="grains in the box of spheres")
    parser.add_argument("--clusters", type=int, default=5_000, help="flakes in the box of clusters")
    parser.add_argument("--storeys", type=int, default=10, help="plates in the stack")
    parser.add_argument("--small", action="store_true", help="1 000 spheres and 300 clusters")
    parser.add_argument("--plot", metavar="FILE", help="draw the figure")
    options = parser.parse_args()
    spheres, clusters = (1_000, 300) if options.small else (options.spheres, options.clusters)
    scenes = {
        f"{spheres} spheres in a box": lambda: bed(spheres, 1.05 * D, None),
        f"{clusters} flakes in a box": lambda: bed(clusters, 1.6 * D, cesim.Flake(spheres=5)),
        f"stack of {options.storeys} plates": lambda: stack(options.storeys),
    }
    results = {}
    for title, make in scenes.items():
        results[title] = measure(make())
        report(title, results[title])
    if options.plot:
        draw(results, options.plot)


if __name__ == "__main__":
    main()
