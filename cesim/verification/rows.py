"""What a case is, and what it measures: a row is a number, its bound, and whether it keeps it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

Size = Literal["quick", "full"]


@dataclass(frozen=True)
class Row:
    """One measured number beside its bound.

    Attributes
    ----------
    quantity : what was measured
    measured : the number
    comparison : "<=", ">=", "==" or "within"
    bound : the bound; for "within" the least and the greatest value allowed
    unit : of both
    note : why the bound is what it is, where that is not plain
    seconds : it took
    """

    quantity: str
    measured: float
    comparison: str
    bound: float | tuple[float, float]
    unit: str = ""
    note: str = ""
    seconds: float = 0.0

    @property
    def passed(self) -> bool:
        """Whether the number keeps its bound. A number that is not one never does."""
        if isinstance(self.bound, tuple):
            return self.bound[0] <= self.measured <= self.bound[1]
        compare = {"<=": self.measured <= self.bound, ">=": self.measured >= self.bound}
        return compare.get(self.comparison, self.measured == self.bound)

    @property
    def bound_text(self) -> str:
        """The bound with its comparison: "<= 0.001", "0.9 to 1.1"."""
        if isinstance(self.bound, tuple):
            return f"{self.bound[0]:.6g} to {self.bound[1]:.6g}"
        return f"{self.comparison} {self.bound:.6g}"


Rows = Iterable[Row]


@dataclass(frozen=True)
class Case:
    """A hard case: a row of the table of cases.

    Attributes
    ----------
    id : two digits, as in docs/numerics.md 3
    title : in a few words
    hard : why it breaks careless code
    source : of the number it is held against
    measure : gives its rows, for "quick" or "full" size
    quick : whether it is part of the quick set; the others take minutes
    """

    id: str
    title: str
    hard: str
    source: str
    measure: Callable[[Size], Rows]
    quick: bool = True


def at_most(quantity: str, measured: float, bound: float, unit: str = "", note: str = "") -> Row:
    """A row that passes while measured <= bound."""
    return Row(quantity, float(measured), "<=", bound, unit, note)


def at_least(quantity: str, measured: float, bound: float, unit: str = "", note: str = "") -> Row:
    """A row that passes while measured >= bound."""
    return Row(quantity, float(measured), ">=", bound, unit, note)


def equal(quantity: str, measured: float, bound: float, unit: str = "", note: str = "") -> Row:
    """A row that passes if measured == bound, to the last bit."""
    return Row(quantity, float(measured), "==", bound, unit, note)


def within(quantity: str, measured: float, least: float, most: float, unit: str = "", note: str = "") -> Row:
    """A row that passes while least <= measured <= most."""
    return Row(quantity, float(measured), "within", (least, most), unit, note)


def relative(measured: float, wanted: float) -> float:
    """Error of a number over what it should be."""
    return abs(measured / wanted - 1.0) if wanted else math.inf
