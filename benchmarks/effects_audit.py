"""Are effects dropped rightly? Ten machines from 0.05 to 5 mm, 0 to 45 kV and 5 to 500 kg/h per metre, each audited.

    python benchmarks/effects_audit.py                        # the table
    python benchmarks/effects_audit.py --page docs/effects.md # the same, put into the page between its marks
    python benchmarks/effects_audit.py 3 7 --grains 4000      # some scenes, with larger samples

For every decision to leave something out (of four scenes: for every decision) the feed's first grains run twice, with
the effect and without, and the mean landing of each material is compared (`cesim.effects.audit`). All of it takes some
minutes.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import cesim
from cesim.effects import Audit, audit
from cesim.effects.audits import IDLE, LEAST_SHIFT

BEGIN, END = "<!-- audit: begin -->", "<!-- audit: end -->"
BRUSHED = 0.5  # mm; smaller ones jam in front of a rigid brush, and ride on
SLIP = {"friction": 0.0}  # of the walls, which stand for the neighbours in a wider stream


@dataclass(frozen=True)
class Case:
    """A machine that feeds grains of about one diameter."""

    diameter: float  # mm, the median
    voltage: float  # kV
    rate: float  # kg/h per metre of width
    mix: dict[str, float]  # by mass; chosen so that materials have some hundred grains each
    width: float  # mm, of the strip of the stream that is simulated
    step: float  # ms
    grains: int
    rpm: float = 44.8
    full: bool = False  # whether what is kept is switched over, too
    amplify: float = 1.0  # how many times as strong dielectrophoresis is, where charged grains scatter each other

    @property
    def name(self) -> str:
        """What the table calls it."""
        materials = " + ".join(self.mix)
        return f"{materials}, {self.diameter:g} mm, {self.voltage:g} kV, {self.rate:g} kg/h per m, {self.rpm:g} rpm"

    def scene(self) -> cesim.Scene:
        """The reference drum, electrode and brush; the feed comes down on the top of the drum at the drum's speed."""
        diameter, half = 1e-3 * self.diameter, 0.5e-3 * self.width
        speed = self.rpm * math.pi / 30.0
        outlet = cesim.Outlet(
            center=(-0.02, 0.160 + max(4.0 * diameter, 2e-3), 0.0),
            length=max(0.01, 2.0 * diameter),
            width=2.0 * half - 1.5 * diameter,
        )
        return cesim.Scene(
            name=self.name,
            drum=cesim.Drum(speed=speed, rolling_friction=0.35),
            electrode=cesim.Electrode(voltage=-1e3 * self.voltage),
            corona=cesim.Corona(),
            brush=cesim.Brush() if self.diameter >= BRUSHED else None,
            walls=[
                cesim.Wall(position=(0.0, 0.0, -half), normal=(0.0, 0.0, 1.0), **SLIP),
                cesim.Wall(position=(0.0, 0.0, half), normal=(0.0, 0.0, -1.0), **SLIP),
            ],
            feed=cesim.Feed(
                rate=f"{self.rate * (2.0 * half - 1.5 * diameter)} kg/h",
                mix=self.mix,
                size=cesim.LogNormal(median=diameter, gsd=1.2, least=diameter / 1.5, most=1.5 * diameter),
                outlet=outlet,
                velocity=(0.16 * speed, -0.3, 0.0),
            ),
            collect=cesim.Collect(y=-0.10),
            numerics={"step": 1e-3 * self.step},
        )


CASES = (
    Case(0.05, 0.0, 5.0, {"copper": 0.9, "PE": 0.1}, 0.5, 0.25, 100),
    Case(0.05, 45.0, 5.0, {"copper": 0.9, "PE": 0.1}, 0.5, 0.2, 100, amplify=50.0),
    Case(0.1, 30.0, 20.0, {"aluminium": 0.7, "PVC": 0.3}, 1.0, 0.25, 150, amplify=50.0),
    Case(0.2, 20.0, 50.0, {"copper": 0.9, "ABS": 0.1}, 3.0, 0.5, 300, 60.0, amplify=50.0),
    Case(0.5, 45.0, 100.0, {"copper": 0.8, "FR4": 0.2}, 20.0, 0.5, 400),
    Case(1.0, 35.0, 5.0, {"copper": 0.9, "ABS": 0.1}, 280.0, 1.0, 600, full=True),
    Case(1.0, 10.0, 500.0, {"aluminium": 0.7, "PP": 0.3}, 60.0, 1.0, 1000, 70.0),
    Case(2.0, 23.0, 200.0, {"copper": 1.0}, 100.0, 1.0, 600, 60.0, full=True),
    Case(5.0, 5.0, 5.0, {"copper": 0.9, "ABS": 0.1}, 280.0, 1.0, 200, full=True),
    Case(5.0, 45.0, 500.0, {"solder": 0.8, "PVC": 0.2}, 200.0, 1.0, 400, 30.0, full=True),
)


def wait(case: Case) -> float:
    """How long the last grain may take, s: fine plastic falls at some 10 cm/s, in the end straight down."""
    return 2.0 if case.diameter < 0.2 else 1.5


def dropped(audits: list[tuple[int, Audit]]) -> list[str]:
    """The decisions to leave something out, as rows of a Markdown table."""
    lines = [
        "| | left out | size | material | predicted [mm] | measured [mm], 95 % | counts from | verdict |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for number, found in audits:
        for row in found:
            if not row.on and row.verdict != IDLE:
                predicted = "" if math.isnan(row.predicted) else f"{1e3 * row.predicted:+.2g}"
                measured = f"{1e3 * row.measured:+.2g} [{1e3 * row.low:+.2g}, {1e3 * row.high:+.2g}]"
                verdict = row.verdict if row.verdict == "confirmed" else f"**{row.verdict}**"
                size = f"{row.size:.2g}"
                cells = (
                    number,
                    row.name if row.amplified == 1.0 else f"{row.name} x {row.amplified:g}",
                    size,
                    row.material,
                    predicted,
                    measured,
                    f"{1e3 * row.least:.2g}",
                    verdict,
                )
                lines.append(f"| {' | '.join(map(str, cells))} |")
    return lines


def scenes(audits: list[tuple[int, Audit]]) -> list[str]:
    """One row of a Markdown table per scene: how its decisions turned out."""
    lines = [
        "| | scene | grains | left out: confirmed, not resolved, wrong | kept: needed, not resolved, spare | neither |",
        "|---|---|---|---|---|---|",
    ]
    for number, found in audits:
        off = Counter(row.verdict for row in found if not row.on)
        on = Counter(row.verdict for row in found if row.on)
        counts = [f"{c[v]}" for c, names in ((off, OFF), (on, ON)) for v in names]
        lines.append(
            f"| {number} | {found.scene} | {found.grains} | {', '.join(counts[:3])} | {', '.join(counts[3:])} "
            f"| {off[IDLE]} |"
        )
    return lines


OFF, ON = ("confirmed", "not resolved", "wrong"), ("needed", "not resolved", "spare")


def agreement(audits: list[tuple[int, Audit]]) -> str:
    """How near the predictions are, in a sentence."""
    pairs = [(r.predicted, r.measured) for _, found in audits for r in found if math.isfinite(r.predicted + r.measured)]
    large = [(p, m) for p, m in pairs if abs(m) > LEAST_SHIFT]
    near = sum(0.5 <= p / m <= 2.0 for p, m in large)
    sign = sum(p * m > 0.0 for p, m in large)
    return (
        f"Of {len(large)} shifts above {1e3 * LEAST_SHIFT:.2g} mm that single flights predict, {near} are "
        f"within a factor of 2 of what was measured, and {sign} have its sign."
    )


def page(audits: list[tuple[int, Audit]]) -> str:
    """The tables as Markdown."""
    off = [row for _, found in audits for row in found if not row.on and row.verdict != IDLE]
    counts = Counter(row.verdict for row in off)
    summary = (
        f"Of {len(off)} decisions to leave something out, each for one material, {counts['confirmed']} are confirmed, "
        f"{counts['not resolved']} not resolved by these samples, {counts['wrong']} wrong."
    )
    return "\n".join([summary, agreement(audits), "", *scenes(audits), "", *dropped(audits)])


def main() -> None:
    """See the top of this file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("numbers", nargs="*", type=int, help=f"scenes, 1 to {len(CASES)}; default: all")
    parser.add_argument("--grains", type=int, help="instead of the samples of the table")
    parser.add_argument("--page", type=Path, help="a page with the two marks to write between")
    options = parser.parse_args()
    audits = []
    for number in options.numbers or range(1, len(CASES) + 1):
        case, started = CASES[number - 1], time.perf_counter()
        scene = case.scene()
        names = None if case.full else [row.name for row in scene.effects().rows if not row.on]
        count = options.grains or case.grains
        amplify = {"dielectrophoresis": case.amplify} if case.amplify > 1.0 else None
        found = audit(scene, grains=count, effects=names, amplify=amplify, longest=wait(case), threads=1)
        print(f"{number}. {found}\n   {time.perf_counter() - started:.0f} s\n", flush=True)
        audits.append((number, found))
    text = page(audits)
    print(text)
    if options.page is not None:
        old = options.page.read_text(encoding="utf-8")
        if BEGIN not in old or END not in old:
            sys.exit(f"{options.page} has no {BEGIN} and {END}")
        head, tail = old.split(BEGIN)[0], old.split(END)[1]
        options.page.write_text(f"{head}{BEGIN}\n{text}\n{END}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main()
