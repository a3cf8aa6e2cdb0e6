"""Hard cases, measured on the machine they run on: `cesim.verify()`, and `cesim verify` on the command line.

A case is a function that yields rows: a measured number, its bound, and why the bound is what it is. It uses what users
use, `cesim.Simulation` and scenes built in code. The cases stand in rooms by theme, `table.CASES` lists them.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from ..errors import unknown
from .report import Report, Result, about
from .rows import Case, Row, Size

__all__ = ["Case", "Report", "Result", "Row", "cases", "measure", "verify"]


def cases(ids: Iterable[str | int] | None = None, *, full: bool = True) -> list[Case]:
    """The hard cases, by id.

    Parameters
    ----------
    ids : such as "04" or 4; default: all of the size
    full : whether those that take minutes are among them; cases named by id always are
    """
    from .table import CASES

    table = {case.id: case for case in CASES}
    if ids is None:
        return [case for case in CASES if full or case.quick]
    names = list(dict.fromkeys(str(name).zfill(2) for name in ids))
    for name in names:
        if name not in table:
            raise unknown("case", name, table)
    return [table[name] for name in sorted(names)]


def measure(case: Case, size: Size = "quick") -> Result:
    """Measure a case. What stops it is a row that failed, not an exception."""
    return Result(case, tuple(timed(case, size)))


def timed(case: Case, size: Size) -> Iterator[Row]:
    """The rows of a case, each with its time."""
    before = time.perf_counter()
    try:
        for row in case.measure(size):
            now = time.perf_counter()
            yield replace(row, seconds=now - before)
            before = now
    except Exception as error:  # whatever it is: a table with a row that failed says more than a traceback
        text = " ".join(f"{type(error).__name__}: {error}".split())
        yield Row("runs to its end", float("nan"), "==", 1.0, "", text, time.perf_counter() - before)


def verify(
    ids: Iterable[str | int] | None = None,
    *,
    full: bool = False,
    show: Callable[[Result], object] | None = None,
) -> Report:
    """Measure the hard cases on this machine.

    Parameters
    ----------
    ids : of cases, such as ["04", "22"]; default: all of the size
    full : the sizes of the documentation, which take minutes, instead of the quick ones
    show : called with each result as it comes, such as ``print``

    Returns
    -------
    Report : print it; ``report.passed`` says whether every number keeps its bound

    Examples
    --------
    >>> report = cesim.verify(["25"])
    >>> report.passed
    True
    """
    size: Size = "full" if full else "quick"
    results = []
    for case in cases(ids, full=full):
        if show is not None and sys.stderr.isatty():
            print(f"{case.id}  {case.title} ...", end="\r", file=sys.stderr, flush=True)
        results.append(measure(case, size))
        if show is not None:
            show(results[-1])
    return Report(tuple(results), size, about())
