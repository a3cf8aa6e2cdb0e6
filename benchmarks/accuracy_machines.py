"""What accuracy costs on five machines: the reference machine, a dense feed, a dilute one, fine powder, flakes.

    python benchmarks/accuracy_machines.py --docs docs             # the page and its picture, about ten minutes
    python benchmarks/accuracy_machines.py --reports DIR           # keeps the reports, and takes those that are there
    python benchmarks/accuracy_machines.py flakes "fine powder"    # some machines, as text

Each machine is the reference machine (`cesim.scenes.reference_machine`), or a strip of it between smooth walls that
stand for the neighbours in a wider stream, and gets an accuracy report with every knob that it has. Two machines are
measured at a time, each by one thread. Answers are the same on every machine, times are not: compare ratios.
"""

from __future__ import annotations

import argparse
import functools
import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from matplotlib.ticker import NullFormatter

import cesim
from cesim.accuracy.picture import draw_panel
from cesim.accuracy.report import OWN, SEED, Choice, Point, Report
from cesim.plots import new_figure

PAGE, PICTURE = "accuracy-machines.md", "images/accuracy_machines.png"
PER_WIDTH = 6.0 / 0.182  # kg/h per m, of the reference machine's feed over its outlet
COPPER, ABS = "copper", "ABS"
WANTED = ("5 mm", "2 mm", "1 mm")  # errors that settings are recommended for


# ---- the machines ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Machine:
    """A scene, what is asked of it, and for how long it runs."""

    name: str
    about: str
    scene: Callable[[], cesim.Scene]
    quantity: str
    until: float  # s of simulated time of each run


def strip(scene: cesim.Scene, width: float, largest: float) -> cesim.Scene:
    """A strip of the stream, m wide, between walls without friction; `largest` is how wide a grain may be."""
    scene.walls = [
        cesim.Wall(position=(0.0, 0.0, side * width / 2.0), normal=(0.0, 0.0, -side), friction=0.0)
        for side in (-1.0, 1.0)
    ]
    assert scene.feed is not None
    scene.feed.outlet = cesim.Outlet(width=width - largest)
    return scene


def reference() -> cesim.Scene:
    """15 mm of the reference machine."""
    scene = cesim.scenes.reference_machine()
    scene.feed.rate = f"{15e-3 * PER_WIDTH} kg/h"
    return strip(scene, 15e-3, 4e-3)


def dense() -> cesim.Scene:
    """Five times the reference machine's rate per width, as spheres."""
    scene = cesim.scenes.reference_machine("spheres")
    scene.feed.rate = f"{5.0 * 12e-3 * PER_WIDTH} kg/h"
    return strip(scene, 12e-3, 2e-3)


def dilute() -> cesim.Scene:
    """A tenth of the reference machine's rate, as spheres over its whole width."""
    scene = cesim.scenes.reference_machine("spheres")
    scene.feed.rate = "250 1/s"
    return scene


def powder() -> cesim.Scene:
    """Copper and aluminium of 0.2 mm; no brush, in front of which so fine grains would jam."""
    scene = cesim.scenes.reference_machine("spheres")
    size = cesim.LogNormal(median=0.2e-3, gsd=1.25, least=0.11e-3, most=0.36e-3)
    scene.feed = cesim.Feed(rate="300 1/s", mix={COPPER: 0.5, "aluminium": 0.5}, size=size)
    scene.numerics.step = 0.25e-3
    scene.brush = None
    return strip(scene, 20e-3, 0.4e-3)


def flakes() -> cesim.Scene:
    """Flakes three times as wide as thick, of five spheres."""
    scene = cesim.scenes.reference_machine()
    size = scene.feed.families[0].size
    shape = cesim.Flake(width=3.0, spheres=5)
    scene.feed = cesim.Feed(rate="150 1/s", mix={COPPER: 0.6, ABS: 0.4}, size=size, shape=shape)
    return strip(scene, 30e-3, 5e-3)


MACHINES = (
    Machine(
        "reference machine",
        "angular copper and irregular flakes of ABS, 0.5 to 1.6 mm, 33 kg/h per metre",
        reference,
        "mean_x[ABS]",
        5.0,
    ),
    Machine(
        "dense feed",
        "the same sizes as spheres, 165 kg/h per metre: grains lie on each other",
        dense,
        "mean_x[ABS]",
        4.0,
    ),
    Machine("dilute feed", "the same spheres, 250 a second over 0.3 m: they hardly meet", dilute, "mean_x[ABS]", 8.0),
    Machine(
        "fine powder",
        "spheres of copper and aluminium, 0.11 to 0.36 mm, no brush",
        powder,
        "mean_x[copper]",
        5.0,
    ),
    Machine(
        "flakes",
        "flakes of copper and ABS, three times as wide as thick, 0.5 to 1.6 mm",
        flakes,
        "mean_x[ABS]",
        6.0,
    ),
)


def measure(machine: Machine, until: float | None = None) -> Report:
    """The accuracy report of a machine."""
    return cesim.accuracy_report(machine.scene(), machine.quantity, until=until or machine.until, progress=False)


# ---- the page --------------------------------------------------------------------------------------------------------


def scale_of(report: Report) -> tuple[float, str]:
    """Factor and unit in which a report's numbers are told."""
    return (1e3, " mm") if report.quantity.unit == "m" else (1.0, "")


def told(report: Report, estimate: cesim.Estimate, sign: str = "+") -> str:
    """A number with its interval."""
    scale = scale_of(report)[0]
    return f"{scale * float(estimate):{sign}.3g} ± {scale * estimate.halfwidth:.2g}"


def ratio(report: Report, point: Point) -> str:
    """Time over that of the scene as it is."""
    return f"{point.wall / report.own.wall:.2f}"


def row(report: Report, point: Point) -> str:
    """A setting as a row of the machine's table."""
    if point.failure:
        return f"| {point.knob} | {point.label} | | | | **failed**: {point.failure} | |"
    # Against another seed there is no error of numerics: what differs are the grains.
    error = "" if point.knob == SEED else told(report, point.error)
    change = "" if point.knob == OWN else told(report, point.change)
    left = f"; {point.unconverged} of {point.steps} steps not converged" if point.unconverged else ""
    verdict = "" if point.knob == OWN else point.verdict
    work = f"{point.iterations / report.own.iterations:.2f} | {point.grain_steps / report.own.grain_steps:.2f}"
    return f"| {point.knob} | {point.label} | {ratio(report, point)} | {work} | {error} | {change} {verdict}{left} |"


def dominant(report: Report) -> str:
    """The largest resolved share of the error, with its size; sampling is one of them."""
    share = max((share for share in report.split if share.resolved), key=lambda share: abs(share.size))
    scale, unit = scale_of(report)
    return f"{share.source} ({scale * abs(share.size):.2g}{unit})"


def order_of(report: Report) -> str:
    """Order of the error in the step."""
    return "not resolved" if math.isnan(report.order) else f"{report.order:.2f}"


def choice_of(report: Report, wanted: str) -> Choice | None:
    """Settings for an error, or None where no step that was tried is good enough."""
    try:
        return report.recommend(wanted)
    except cesim.InputError:
        return None


def told_choice(report: Report, choice: Choice) -> str:
    """Step, length and time of a choice."""
    needed = "".join(f", {setting.label}" for setting in choice.with_settings)
    times = choice.wall / report.own.wall
    return f"h = {1e3 * choice.step:g} ms{needed}, {choice.until:.3g} s simulated, {times:.2g} times the time"


def advice(report: Report) -> Iterator[str]:
    """What to set for each error, and what dominates then, one line each."""
    scale, unit = scale_of(report)
    for wanted in WANTED:
        choice = choice_of(report, wanted)
        if choice is None:
            least = scale * min(abs(bias) for bias, _ in report.steps.values())
            yield f"- {wanted}: no step that was tried; the best of them is off by {least:.2g}{unit}"
            continue
        bias = abs(report.steps[choice.step][0])
        rest = choice.error - bias
        yield (
            f"- {wanted}: {told_choice(report, choice)} of the scene as it is. "
            f"{'The step' if bias > rest else 'Sampling'} dominates: the step adds {scale * bias:.2g}{unit}, sampling "
            f"{scale * rest:.2g}{unit}"
        )


def finest(report: Report) -> tuple[str, str]:
    """The smallest of the errors that can be kept, and how."""
    for wanted in reversed(WANTED):
        choice = choice_of(report, wanted)
        if choice is not None:
            return wanted, told_choice(report, choice)
    return f"below {WANTED[0]}", "no step that was tried"


def split(report: Report) -> Iterator[str]:
    """Where the error of the scene as it is comes from, one line a source."""
    scale, unit = scale_of(report)
    for share in report.split:
        size = f"{scale * abs(share.size):.2g}{unit}"
        if not share.resolved:
            size = f"not resolved, below {scale * max(abs(share.size.low), abs(share.size.high)):.2g}{unit}"
        yield f"- {share.source}: {size}"


def section(machine: Machine, report: Report) -> list[str]:
    """A machine's part of the page."""
    own, unit = report.own, scale_of(report)[1]
    head = "| knob | setting | time | sweeps | grain-steps | error" + unit + " | change" + unit + " |"
    verdicts = [point.verdict for point in report.points if point.knob not in (OWN, SEED)]
    counts = ", ".join(
        f"{verdicts.count(name)} {text}"
        for name, text in (
            ("different", "change the answer"),
            ("not resolved", "are not resolved and not ranked"),
            ("failed", "failed"),
        )
    )
    front = ", ".join(f"{point.label} ({ratio(report, point)})" for point in report.pareto)
    about = (
        f"{machine.about[0].upper()}{machine.about[1:]}. {own.simulated:.3g} s simulated in {own.wall:.3g} s, "
        f"{report.warmup:.2g} s of warm-up cut; h = {1e3 * report.own_step:g} ms."
    )
    found = (
        f"{machine.quantity} = {told(report, own.answer, '')}{unit} (95 %, sampling); best answer "
        f"{told(report, report.best, '')}{unit}. Order of the error in the step: {order_of(report)}. "
        f"Of {len(verdicts)} settings {counts}."
    )
    return [
        f"## {machine.name[0].upper()}{machine.name[1:]}",
        "",
        about,
        "",
        found,
        "",
        head,
        "|---|---|---|---|---|---|---|",
        *(row(report, point) for point in report.points),
        "",
        "The error of the scene as it is:",
        "",
        *split(report),
        "",
        f"Not beaten in both time and error, with their times: {front}.",
        "",
        f"To keep an error of {report.quantity.name}, sampling and step together:",
        "",
        *advice(report),
        "",
    ]


ALT = (
    "Error of the mean landing x against wall time on five machines, log-log: steps, tolerances, solvers, the contact "
    "law, field, shape and effects, with the sampling error of a run as it gets longer"
)
HEAD = f"""# What accuracy costs on five machines

This page is written by one command, from one run; nothing in it is written by hand:

```sh
python benchmarks/accuracy_machines.py --docs docs
```

![{ALT}]({PICTURE})

Each machine is the reference machine or a strip of it between smooth walls, with every knob turned by itself over the
same grains ([how](accuracy.md)). *time*, *sweeps* and *grain-steps* are over those of the scene as it is, the first
row. *error* counts from the best answer, that of the finest step extrapolated to none; *change* from the scene as it
is, with its paired 95 % interval. An interval that contains 0 is *not resolved*: hollow and grey in the picture, at the
most that it can be, and ranked nowhere. Grains and answers are the same wherever this is run; times are good for
ratios.
"""


def overview(reports: Sequence[tuple[Machine, Report]]) -> list[str]:
    """One row per machine."""
    lines = [
        "| machine | asked | answer, sampling (95 %) | error, step | order | largest error | can be kept | with |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for machine, report in reports:
        unit = scale_of(report)[1]
        lines.append(
            f"| [{machine.name}](#{machine.name.replace(' ', '-')}) | {machine.quantity} "
            f"| {told(report, report.own.answer, '')}{unit} | {told(report, report.own.error)}{unit} "
            f"| {order_of(report)} | {dominant(report)} | {' | '.join(finest(report))} |"
        )
    return lines


def page(reports: Sequence[tuple[Machine, Report]]) -> str:
    """Everything as Markdown."""
    lines = [HEAD, *overview(reports), ""]
    for machine, report in reports:
        lines += section(machine, report)
    return "\n".join(lines)


def draw(reports: Sequence[tuple[Machine, Report]], path: Path) -> None:
    """One panel per machine, and one for the legend."""
    columns = 3
    figure = new_figure((11.0, 3.4 * math.ceil((len(reports) + 1) / columns)), on_screen=False)
    panels = figure.subplots(math.ceil((len(reports) + 1) / columns), columns, squeeze=False).ravel()
    marks: dict[str, object] = {}
    for ax, (machine, report) in zip(panels, reports, strict=False):
        draw_panel(ax, report, names=False)
        ax.set_title(machine.name, fontsize=11)
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.set_xlabel(f"wall time [s] of {report.own.simulated:.3g} s")
        ax.set_ylabel(f"error of {report.quantity.name} [mm]")
        marks |= {label: handle for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    rest = panels[len(reports) :]
    for ax in rest:
        ax.set_axis_off()
    rest[0].legend(marks.values(), marks.keys(), loc="center", fontsize=11, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)


# ---- the command -----------------------------------------------------------------------------------------------------


def report_in(folder: Path, machine: Machine, until: float | None) -> Path:
    """A machine's report as a file, measured unless it is there."""
    file = folder / f"{machine.name.replace(' ', '-')}.h5"
    if not file.exists():
        began = time.perf_counter()
        measure(machine, until).save(file)
        print(f"{machine.name}: {time.perf_counter() - began:.0f} s", flush=True)
    return file


def reports_of(chosen: Sequence[Machine], folder: Path, until: float | None, jobs: int) -> list[Report]:
    """The reports of some machines, some of them at a time."""
    folder.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(jobs) as pool:
        files = list(pool.map(functools.partial(report_in, folder, until=until), chosen))
    return [Report.load(file) for file in files]


def main() -> None:
    """See the top of this file."""
    names = [machine.name for machine in MACHINES]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="machine", help=f"of {', '.join(names)}; default: all")
    parser.add_argument("--docs", type=Path, help=f"where {PAGE} and {PICTURE} go")
    parser.add_argument("--reports", type=Path, help="keeps the reports as HDF5, and takes those that are there")
    parser.add_argument("--until", type=float, help="s of simulated time of each run, in place of the machine's own")
    parser.add_argument("--jobs", type=int, default=2, help="machines measured at a time; default 2")
    options = parser.parse_args()
    for name in options.names:
        if name not in names:
            parser.error(f"no machine {name!r}; there are {', '.join(names)}")
    chosen = [machine for machine in MACHINES if not options.names or machine.name in options.names]
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        found = reports_of(chosen, options.reports or Path(folder), options.until, options.jobs)
    reports = list(zip(chosen, found, strict=True))
    for machine, report in reports:
        print(f"\n==== {machine.name}: {machine.about}\n{report}", *advice(report), sep="\n")
    print(f"\n{time.perf_counter() - began:.0f} s in all")
    if options.docs is not None:
        draw(reports, options.docs / PICTURE)
        (options.docs / PAGE).write_text(page(reports), encoding="utf-8")


if __name__ == "__main__":
    main()
