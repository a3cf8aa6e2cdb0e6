"""What is raised when an input cannot be used: one line that says what, its value, its unit and what is allowed."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from . import engine

SimulationError = engine.SimulationError


class InputError(engine.InputError):
    """An input that cannot be used.

    Parameters
    ----------
    reason : str
        What is wrong, to be read after the path: "is 1e9 rad/s, outside [-1000, 1000] rad/s".
    path : str
        Where in the tree the value stands: "drum.speed", "plates[0].length"; "" where there is no tree.
    value, unit, allowed
        The value that was refused, the unit it is counted in, and the legal range or choice.
    """

    def __init__(self, reason: str, *, path: str = "", value: Any = None, unit: str = "", allowed: str = "") -> None:
        super().__init__(reason)
        self.reason, self.path, self.value, self.unit, self.allowed = reason, path, value, unit, allowed

    @property
    def key(self) -> str:
        """Last part of the path: "speed" of "drum.speed"."""
        return re.split(r"[.\[]", self.path)[-1].rstrip("]")

    def at(self, *location: str | int) -> InputError:
        """The same error further down a tree: its path is put behind the location."""
        self.path = join_path(*location, self.path)
        return self

    def __str__(self) -> str:
        return f"{self.path} {self.reason}" if self.path else self.reason


@contextmanager
def engine_errors() -> Iterator[None]:
    """Gives the engine's refusals the class that users catch."""
    try:
        yield
    except InputError:
        raise
    except engine.InputError as error:
        raise InputError(str(error)) from None


def join_path(*parts: str | int) -> str:
    """("plates", 0, "length") -> "plates[0].length"."""
    path = ""
    for part in parts:
        if isinstance(part, int):
            path += f"[{part}]"
        elif part:
            path += part if not path or part.startswith("[") else f".{part}"
    return path


def unknown(what: str, name: object, known: Iterable[str]) -> InputError:
    """The error for a name that is not among the known ones, with the nearest of them."""
    names = sorted(known)
    near = difflib.get_close_matches(str(name)[:80], names, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]!r}?" if near else f"known are: {', '.join(names) or 'none'}"
    return InputError(f"{show(name)} is not a known {what}; {hint}", value=name, allowed=", ".join(names))


def show(value: object) -> str:
    """The value in at most 60 characters of one line, whatever it is."""
    if isinstance(value, int) and value.bit_length() > 128:
        return f"an integer of {value.bit_length()} bits"
    try:
        text = number(value) if isinstance(value, float) else repr(value)
    except Exception:  # a repr may fail in any way, and a message must not
        text = f"a {type(value).__name__}"
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."


def number(value: float) -> str:
    """A number as people write it: 1e9, not 1e+09."""
    if not math.isfinite(value):
        return f"{value}"
    return re.sub(r"e\+?(-?)0*(\d)", r"e\1\2", f"{value:.6g}")


def percent(share: float) -> str:
    """0.0213 -> "2.1 %": two digits, above 100 % all of them."""
    value = 100.0 * share
    return f"{value:.0f} %" if abs(value) >= 99.5 else f"{value:.2g} %"


def with_unit(text: str, unit: str) -> str:
    """ "1" and "m" -> "1 m"; without a unit, the text alone."""
    return f"{text} {unit}".rstrip()
