"""What a step costs: nanoseconds per grain and per contact visit, stage by stage, and wall time per simulated second.

    python benchmarks/costs.py [--threads 1 2] [--repeats 3]

Every figure is a median over repeats of the same steps in one process, all taken in one run on one machine: compare
lines of one table with each other, not tables of two machines.
"""

from __future__ import annotations

import argparse
import platform
import statistics
import sys
from pathlib import Path

import numpy as np

import cesim

STAGES = ("feed", "charge", "force", "detect", "solve", "move", "collect")


def falling(count: int) -> cesim.Simulation:
    """Grains in free flight through the field, too far apart to meet: what flight costs."""
    sim = cesim.Simulation(cesim.scenes.single_particle(), seed=1, threads=1)
    side = int(np.ceil(count ** (1 / 3)))
    cells = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)[:count]
    sim.add(np.array([0.3, 0.1, -0.14]) + 0.004 * cells, material="copper", diameter=1e-3)
    return sim


def settling(count: int, threads: int) -> cesim.Simulation:
    """A bed of spheres that has almost settled: what contacts cost."""
    sim = cesim.Simulation(cesim.scenes.settling_box(), seed=1, threads=threads)
    across = 38
    index = np.arange(count)
    cells = np.stack([index % across, index // across**2, index // across % across], -1)
    jitter = 1e-4 * np.random.default_rng(1).uniform(-1, 1, (count, 3))
    sim.add(np.array([-0.0488, 0.0012, -0.0488]) + 0.0025 * cells + jitter, material="ABS", diameter=2e-3)
    sim.step(100)
    return sim


def reference(rate: float, threads: int) -> cesim.Simulation:
    """The reference machine with spheres of 0.5 to 1 mm at this rate, 1/s, in its steady state."""
    scene = cesim.scenes.reference_machine("spheres")
    assert scene.feed is not None
    scene.feed.rate = f"{rate} 1/s"
    scene.feed.size = cesim.Uniform(least=0.5e-3, most=1e-3)
    sim = cesim.Simulation(scene, seed=1, threads=threads)
    sim.step(1500)
    return sim


def shredded(rolling_friction: float) -> cesim.Simulation:
    """The reference machine with shredded grains, in its steady state: contacts of bodies that roll, or roll freely."""
    scene = cesim.scenes.reference_machine()
    scene.drum.rolling_friction = rolling_friction
    sim = cesim.Simulation(scene, seed=1, threads=1)
    sim.step(1500)
    return sim


def measure(sim: cesim.Simulation, steps: int, repeats: int) -> dict[str, float]:
    """Median seconds per stage of so many steps, and the work that was in them."""
    seconds: dict[str, list[float]] = {stage: [] for stage in STAGES}
    grains, visits, rows = [], [], []
    for _ in range(repeats):
        before, health = sim.engine.stage_seconds, sim.engine.health
        sim.step(steps)
        after, now = sim.engine.stage_seconds, sim.engine.health
        for stage in STAGES:
            seconds[stage].append(after[stage] - before[stage])
        grains.append(sim.count * steps)
        visits.append(now["visits"] - health["visits"])
        rows.append(now["contact_rows"] - health["contact_rows"])
    work = {"grain_steps": grains, "visits": visits, "rows": rows}
    return {name: statistics.median(values) for name, values in (seconds | work).items()}


def stage_table(repeats: int) -> None:
    print(f"\n{'scene (1 thread)':28}{'grains':>8}{'rows':>8}{'force':>10}{'detect':>10}{'visit':>10}{'move':>10}")
    print(f"{'':44}{'ns/grain':>10}{'ns/grain':>10}{'ns':>10}{'ns/grain':>10}")
    for name, sim, steps in (
        ("free flight", falling(5000), 50),
        ("bed of 1 000", settling(1000, 1), 20),
        ("reference, 5 000 1/s", reference(5000.0, 1), 200),
        ("shredded, rolling freely", shredded(0.0), 200),
        ("shredded, rolling friction", shredded(0.35), 200),
    ):
        found = measure(sim, steps, repeats)
        per_grain = {stage: 1e9 * found[stage] / found["grain_steps"] for stage in ("force", "detect", "move")}
        visit = 1e9 * found["solve"] / found["visits"] if found["visits"] else float("nan")
        rows = found["rows"] / steps
        print(
            f"{name:28}{sim.count:8d}{rows:8.0f}{per_grain['force']:10.0f}{per_grain['detect']:10.0f}{visit:10.1f}"
            f"{per_grain['move']:10.0f}"
        )
    print("visit: all of the solve stage, with building the problem and measuring its residual, per contact and sweep")


def wall_table(threads: list[int], repeats: int) -> None:
    print(f"\n{'reference machine, h = 1 ms':28}{'threads':>8}{'alive':>8}{'rows':>8}{'s wall / s simulated':>22}")
    for rate in (1000.0, 2500.0, 5000.0, 10000.0):
        for count in threads:
            sim = reference(rate, count)
            found = measure(sim, 250, repeats)
            wall = sum(found[stage] for stage in STAGES) / (250 * sim.engine.step_size)
            print(f"{f'{rate:.0f} grains/s':28}{count:8d}{sim.count:8d}{found['rows'] / 250:8.0f}{wall:22.2f}")


def processor() -> str:
    """Name of the processor, where the system tells."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    return next(
        (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.processor()
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    build = cesim.engine.build_info()
    print(f"cesim {cesim.__version__}, {build['compiler']}, {build['processors']} processors, {processor()}")
    stage_table(arguments.repeats)
    wall_table(arguments.threads, arguments.repeats)
    return 0


if __name__ == "__main__":
    sys.exit(main())
