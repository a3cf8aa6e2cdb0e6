"""The table of hard cases with what was measured on this machine: on a page of text, as data, as Markdown."""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .rows import Case, Row, Size

if TYPE_CHECKING:
    import pandas as pd

HEAD = """\
The hard cases of [numerics.md](numerics.md) 3 with the numbers that one machine measured, beside their bounds. This
page is written by `cesim verify --full --markdown docs/verification.md`, not by hand; `cesim verify` prints the same
table, in its quick size, for yours.
"""

INVARIANTS = """\
*Common invariants* are checked in every step: finite numbers; quaternions of norm 1 to 1e-12; momentum and, without
rolling friction, angular momentum of every grain balanced by the contacts' impulses to 1e-12; contacts do no work, to
1e-10, where e < 1; mass balance closed; a step that ran out of sweeps is counted. The number is the worst of them over
its bound.
"""

LIMITS = """\
## Known limits

What the engine does not claim, whatever the table says.

* **Contacts are rigid.** There is no contact time (no Hertz), and no micro-slip: an oblique impact below the rolling
  branch (case 11) turns as a rigid sphere turns, where measured rebounds show the elasticity of the contact.
* **`contact_law = "ccp"` dilates.** A grain that slides by the convex relaxation rides on a gap of µ v h, or hops
  (case 10). `"coulomb"`, the default, does neither.
* **Forces in a packing are not unique.** Where more contacts share a load than it takes, rigid bodies determine their
  sum, not each of them. Compare velocities, net forces and where things end, never single contact forces.
* **Simultaneous impacts are not determined** by rigid bodies and a coefficient of restitution (cases 26, 27). Momentum
  is kept; how it is shared depends on the order in which contacts are visited, and with e near 1 a step may gain
  energy.
* **Heavy on light is slow.** With mass ratios of 1e6 the default solver does not arrive, and says so;
  `solver = "direct"` does (case 03).
"""


@dataclass(frozen=True)
class Result:
    """A case and its rows."""

    case: Case
    rows: tuple[Row, ...]

    @property
    def passed(self) -> bool:
        """All its rows keep their bounds."""
        return bool(self.rows) and all(row.passed for row in self.rows)

    @property
    def seconds(self) -> float:
        """It took."""
        return math.fsum(row.seconds for row in self.rows)

    def __str__(self) -> str:
        lines = [f"{self.case.id}  {self.case.title}: {self.case.hard}"]
        for row in self.rows:
            number = f"{row.measured:.3g}"
            verdict = "ok" if row.passed else "FAILED"
            bound = f"{row.bound_text} {row.unit}".rstrip()
            lines.append(f"    {row.quantity:<58} {number:>10}  {bound:<22} {verdict:<6} {row.seconds:6.2f} s")
            if row.note and (not row.passed or row.quantity.startswith("common")):
                lines.append(f"        {row.note}")
        return "\n".join(lines)


@dataclass(frozen=True)
class Report:
    """What `cesim.verify` found; print it.

    Attributes
    ----------
    results : one a case, in the order of ids
    size : "quick" or "full"
    about : version, date, machine, compiler
    """

    results: tuple[Result, ...]
    size: Size
    about: dict[str, str] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Every row of every case keeps its bound."""
        return bool(self.results) and all(result.passed for result in self.results)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One dict a row: id, title, quantity, measured, comparison, bound, unit, passed, seconds, note, source."""
        return [row_of(result.case, row) for result in self.results for row in result.rows]

    @property
    def seconds(self) -> float:
        """All cases took."""
        return math.fsum(result.seconds for result in self.results)

    def to_pandas(self) -> pd.DataFrame:
        """One line a row, columns as in `rows`."""
        import pandas as pd

        return pd.DataFrame(self.rows)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the table: as JSON to a name that ends so, as Markdown to any other."""
        where = Path(path)
        where.write_text(self.to_json() if where.suffix == ".json" else self.to_markdown(), encoding="utf-8")

    def to_json(self) -> str:
        """About the machine, and the rows. A number that is not finite is written as text, which JSON lacks."""
        rows = [{key: plain(value) for key, value in row.items()} for row in self.rows]
        tree = {"about": self.about, "size": self.size, "passed": self.passed, "seconds": self.seconds, "rows": rows}
        return json.dumps(tree, indent=1, allow_nan=False) + "\n"

    def to_markdown(self) -> str:
        """The table as a page of documentation."""
        return "\n".join(markdown(self))

    def __str__(self) -> str:
        return "\n".join([*(str(result) for result in self.results), "", self.summary()])

    def summary(self) -> str:
        """Counts and time, on one line."""
        rows = [row for result in self.results for row in result.rows]
        failed = [result.case.id for result in self.results if not result.passed]
        verdict = f"FAILED: {', '.join(failed)}" if failed else "all pass"
        return f"{len(self.results)} cases, {len(rows)} numbers, {self.seconds:.1f} s: {verdict}"


def row_of(case: Case, row: Row) -> dict[str, Any]:
    """A row as plain data."""
    return {
        "id": case.id,
        "title": case.title,
        "quantity": row.quantity,
        "measured": row.measured,
        "comparison": row.comparison,
        "bound": row.bound,
        "unit": row.unit,
        "passed": row.passed,
        "seconds": round(row.seconds, 3),
        "note": row.note,
        "source": case.source,
    }


def plain(value: Any) -> Any:
    """A value that JSON can hold."""
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def markdown(report: Report) -> Iterator[str]:
    """Lines of the page."""
    yield "# Verification\n"
    yield HEAD
    for name, text in report.about.items():
        yield f"* {name}: {text}"
    yield f"* size: {report.size}; {report.summary()}\n"
    yield INVARIANTS
    for result in report.results:
        yield f"## {result.case.id} {result.case.title}\n"
        yield f"{result.case.hard[0].upper()}{result.case.hard[1:]}. Source: {result.case.source}.\n"
        yield "| quantity | measured | bound | unit | | s |"
        yield "|---|---|---|---|---|---|"
        for row in result.rows:
            verdict = "ok" if row.passed else "**failed**"
            bound = row.bound_text.replace("<=", "≤").replace(">=", "≥").replace("==", "=")
            quantity = row.quantity.replace("|", "\\|")
            yield f"| {quantity} | {row.measured:.3g} | {bound} | {row.unit} | {verdict} | {row.seconds:.2f} |"
        yield ""
        notes = [(row.quantity, row.note) for row in result.rows if row.note]
        for quantity, note in notes:
            yield f"* {quantity}: {note}"
        if notes:
            yield ""
    yield LIMITS


def about() -> dict[str, str]:
    """Version, date and machine."""
    from .. import __version__, engine

    return {
        "cesim": __version__,
        "date": datetime.now(timezone.utc).strftime("%Y-%m-%d"),
        "machine": f"{processor()}, {platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "engine": engine.build_info()["compiler"],
    }


def processor() -> str:
    """Name of the processor, as far as the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown processor"
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown processor"
