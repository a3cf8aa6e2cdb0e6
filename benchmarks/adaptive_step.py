"""Would a step that changes in time pay? Where a grain's error is made, and what a rule that knows the future gains.

    python benchmarks/adaptive_step.py [--markdown FILE]     # both tables, some minutes

1. Single grains: the step is coarse up to some time before the grain leaves the drum and fine from there, and the
   other way round. So it is seen where the error of the landing is made, and how long the fine step is needed.
2. Machines: in which share of the time some grain is that near to leaving. Whatever a rule looks at, it has to be fine
   then; so 1/(share + (1 - share)/k) bounds what any rule can gain over the fine step everywhere, with a coarse step k
   times as long. Time is weighted by the grains that are inside: grain-steps, not seconds.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import accuracy_machines
import numpy as np

import cesim

COARSE, FINE = 1e-3, 1e-3 / 16.0  # s
BEFORE, AFTER = 20e-3, 5e-3  # s round the last touch in which the fine step is needed: the first table shows it
GRAINS = (("copper", 1.2e-3), ("ABS", 0.5e-3), ("ABS", 1.2e-3))
LEADS = (100.0, 50.0, 20.0, 12.0, 8.0, 4.0, 0.0, -5.0)  # ms before the last touch
SETTLED, TO = 1.0, 2.5  # s: what of a machine that is fed without end is looked at


# ---- single grains ---------------------------------------------------------------------------------------------------


def begun(step: float, material: str, diameter: float) -> cesim.Simulation:
    """A grain on top of the drum, at its speed."""
    scene = cesim.scenes.single_particle()
    scene.numerics.step = step
    sim = cesim.Simulation(scene)
    radius = scene.drum.radius
    sim.add((0.0, radius + diameter / 2.0, 0.0), (scene.drum.speed * radius, 0.0, 0.0), material, diameter)
    return sim


def handed_over(sim: cesim.Simulation, step: float, material: str, diameter: float) -> cesim.Simulation:
    """The same grain, in the same state, in steps of another length."""
    scene = cesim.scenes.single_particle()
    scene.numerics.step = step
    other = cesim.Simulation(scene)
    other.add(
        sim.position,
        sim.velocity,
        material,
        diameter,
        sim.charge,
        angular_velocity=sim.angular_velocity,
        orientation=sim.orientation,
    )
    return other


def landing(material: str, diameter: float, first: float, then: float | None = None, switch: float = 0.0) -> float:
    """Landing x in m, in steps of `first` up to the time `switch` and of `then` from there."""
    sim = begun(first, material, diameter)
    if then is not None:
        sim.run(until=switch)
        if not len(sim.landings):
            sim = handed_over(sim, then, material, diameter)
    while not len(sim.landings):
        sim.step()
    return float(sim.landings["position"][0, 0])


def last_touch(material: str, diameter: float) -> float:
    """When the grain touches the drum for the last time, s."""
    sim, last = begun(FINE, material, diameter), 0.0
    while not len(sim.landings):
        sim.step()
        if len(sim.contacts):
            last = sim.time
    return last


def single(material: str, diameter: float) -> str:
    """One row: errors in mm of the coarse step, then of coarse and fine by the lead of the change."""
    truth, left = landing(material, diameter, FINE), last_touch(material, diameter)
    cells = [f"{1e3 * (landing(material, diameter, COARSE) - truth):+.3f}"]
    for lead in LEADS:
        switch = round((left - 1e-3 * lead) / COARSE) * COARSE
        pair = [
            landing(material, diameter, first, then, switch) - truth for first, then in ((COARSE, FINE), (FINE, COARSE))
        ]
        cells.append(" / ".join(f"{1e3 * error:+.3f}" for error in pair))
    return f"| {material} {1e3 * diameter:g} mm | {' | '.join(cells)} |"


# ---- machines --------------------------------------------------------------------------------------------------------


def batch(stop: float) -> Callable[[], cesim.Scene]:
    """The dilute machine, fed for some time only."""

    def scene() -> cesim.Scene:
        machine = accuracy_machines.dilute()
        machine.feed.stop = stop
        return machine

    return scene


def busy(scene: cesim.Scene) -> tuple[float, float, float]:
    """Share of time, and of grain-steps, with a grain about to leave; departures a second."""
    sim = cesim.Simulation(scene, threads=1)
    carriers = [-1 - i for i, name in enumerate(sim.surface_names) if name in ("drum", "brush")]
    times, counts, last = [], [], {}
    endless = scene.feed is not None and scene.feed.stop is None
    while sim.time < TO and (sim.time < 0.1 or sim.count or endless):
        sim.step()
        touching = sim.contacts
        times.append(sim.time)
        counts.append(sim.count)
        last.update(dict.fromkeys(touching["a"][np.isin(touching["b"], carriers)].tolist(), sim.time))
    clock, grains = np.array(times), np.array(counts, float)
    left = np.array([when for when in last.values() if when < clock[-1] - BEFORE])
    fine = np.zeros(len(clock), bool)
    for when in left:
        fine |= (clock >= when - BEFORE) & (clock <= when + AFTER)
    # At the end of a run that goes on, who is about to leave is not known yet.
    counted = (clock >= SETTLED) & (clock < clock[-1] - 2.0 * BEFORE) if endless else grains > 0
    span = float(clock[counted][-1] - clock[counted][0])
    inside = (left >= clock[counted][0]) & (left <= clock[counted][-1])
    share = float(np.sum(grains[counted & fine]) / np.sum(grains[counted]))
    return float(np.mean(fine[counted])), share, float(np.sum(inside)) / span


def alone(material: str, diameter: float) -> tuple[float, float, float]:
    """As `busy`, for a grain that starts on top of the drum."""
    sim, last = begun(COARSE, material, diameter), 0.0
    while not len(sim.landings):
        sim.step()
        if len(sim.contacts):
            last = sim.time
    share = (BEFORE + min(AFTER, sim.time - last)) / sim.time
    return share, share, 1.0 / sim.time


def gain(share: float, ratio: float) -> str:
    """The most that changing the step gains over the fine step everywhere."""
    return f"{1.0 / (share + (1.0 - share) / ratio):.2f}"


def machine(name: str, found: tuple[float, float, float]) -> str:
    """One row of the second table."""
    share, weighted, rate = found
    return f"| {name} | {rate:.0f} | {share:.3f} | {weighted:.3f} | {gain(weighted, 4.0)} | {gain(weighted, 16.0)} |"


def main() -> None:
    """See the top of this file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--markdown", type=Path, help="where the tables go, too")
    options = parser.parse_args()
    lines = []

    def say(line: str) -> None:
        lines.append(line)
        print(line, flush=True)

    say(f"| grain | {1e3 * COARSE:g} ms always | {' | '.join(f'{lead:+g} ms' for lead in LEADS)} |")
    say("|---|---|" + len(LEADS) * "---|")
    for material, diameter in GRAINS:
        say(single(material, diameter))
    say("")
    say("| machine | leave a second | share of the time | of the grain-steps | gain at most, k = 4 | k = 16 |")
    say("|---|---|---|---|---|---|")
    for material, diameter in GRAINS:
        say(machine(f"one grain, {material} {1e3 * diameter:g} mm", alone(material, diameter)))
    for stop in (0.02, 0.1, 0.4):
        say(machine(f"dilute feed for {stop:g} s, {250 * stop:.0f} grains", busy(batch(stop)())))
    for row in accuracy_machines.MACHINES:
        say(machine(row.name, busy(row.scene())))
    if options.markdown is not None:
        options.markdown.write_text("\n".join([*lines, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
