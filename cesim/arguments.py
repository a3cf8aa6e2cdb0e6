"""Checks at the door: what may be handed to a simulation, and what is said when it may not."""

from __future__ import annotations

import operator
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import engine
from .errors import InputError, engine_errors, number, show
from .units import to_si

if TYPE_CHECKING:
    from .scene import Scene

Array = NDArray[np.float64]

# 1/s. Below it about as many grains are alive, and a second thread costs more than it saves on a busy machine.
THREADED_FEED = 4000.0

# What a grain may be given, in SI units: beyond these a number is a slip of units, not physics.
LIMITS = {
    "position": (-1e3, 1e3, "m"),
    "velocity": (-1e4, 1e4, "m/s"),
    "angular_velocity": (-1e7, 1e7, "rad/s"),
    "orientation": (-1e6, 1e6, ""),
    "diameter": (1e-7, 1.0, "m"),
    "charge": (-1e-3, 1e-3, "C"),
}


def whole(name: str, value: Any, least: int, most: int) -> int:
    """An integer within its range; True, 1.0 and "1" are not integers."""
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        result = operator.index(value)
    except TypeError:
        raise InputError(f"is {show(value)}, must be a whole number", path=name, value=value) from None
    if not least <= result <= most:
        allowed = f"[{least}, {most}]"
        raise InputError(f"is {show(result)}, outside {allowed}", path=name, value=value, allowed=allowed)
    return result


def numbers(name: str, value: Any) -> Array:
    """A float64 copy of real, finite numbers within the limits of their name."""
    least, most, unit = LIMITS[name]
    try:
        given = np.asarray(value)
    except (ValueError, TypeError, OverflowError):
        raise InputError("is not an array of numbers", path=name, unit=unit) from None
    if given.dtype.kind not in "iuf":
        kind = show(value) if given.ndim == 0 else f"an array of {given.dtype}"
        raise InputError(f"is {kind}, must be real numbers in {unit}", path=name, unit=unit)
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InputError("has masked entries", path=name, unit=unit)
    with np.errstate(over="ignore"):
        result = np.array(given, dtype=np.float64, order="C")
    wrong = ~((result >= least) & (result <= most))  # a NaN is wrong too
    if wrong.any():
        first = tuple(int(i) for i in np.argwhere(wrong)[0])
        bad, allowed = float(result[first]), f"[{number(least)}, {number(most)}] {unit}"
        place = f"[{', '.join(map(str, first))}]" if first else ""
        what = f"is {number(bad)} {unit}, outside {allowed}" if np.isfinite(bad) else f"is {bad}, must be finite"
        raise InputError(what, path=name + place, value=bad, unit=unit, allowed=allowed)
    return result


def scalars(name: str, value: Any, n: int) -> Array:
    """(n,) numbers from one number or (n,)."""
    return _fit(name, numbers(name, value), ((), (1,), (n,)), (n,), f"a number or ({n},)")


def vectors(name: str, value: Any, n: int) -> Array:
    """(n, 3) numbers from 0, (3,) or (n, 3)."""
    given = numbers(name, value)
    if given.shape == () and given == 0:
        given = np.zeros(3)
    return _fit(name, given, ((3,), (1, 3), (n, 3)), (n, 3), f"0, (3,) or ({n}, 3)")


def quaternions(name: str, value: Any, n: int) -> Array:
    """(n, 4) unit quaternions from (4,) or (n, 4) of any length but zero."""
    given = _fit(name, numbers(name, value), ((4,), (1, 4), (n, 4)), (n, 4), f"(4,) or ({n}, 4)")
    length = np.linalg.norm(given, axis=1, keepdims=True)
    if not (length > 1e-6).all():
        first = int(np.argmin(length))
        raise InputError(f"is {show(given[first].tolist())}, must not be zero", path=f"{name}[{first}]")
    return np.ascontiguousarray(given / length)


def _fit(name: str, given: Array, legal: tuple[tuple[int, ...], ...], shape: tuple[int, ...], allowed: str) -> Array:
    if given.shape not in legal:
        raise InputError(f"has shape {given.shape}, must be {allowed}", path=name, allowed=allowed)
    return np.ascontiguousarray(np.broadcast_to(given, shape))


def seconds(value: Any, name: str = "until") -> float:
    """A time in s from text with a unit or a number."""
    try:
        return to_si(value, "s", 0.0, 1e7)
    except InputError as error:
        raise error.at(name) from None


def thread_count(scene: Scene, definition: Mapping[str, Any], threads: int | None) -> int:
    """Threads asked for, or those of the scene; else one for a thin feed, and all that this process may use."""
    wanted = scene.numerics.threads if threads is None else threads
    if wanted is not None:
        return whole("threads", wanted, 1, 1024)
    if scene.feed is not None and births_per_second(definition) < THREADED_FEED:
        return 1
    return min(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1, 64)


def births_per_second(definition: Mapping[str, Any]) -> float:
    """Grains a second, from the first births of the feed."""
    some = 100
    with engine_errors():
        births = engine.feed_stream(
            definition["feed"], definition["materials"], definition["gravity"], 1, some, definition.get("shapes")
        )
    return len(births) / max(births["time"][-1] - births["time"][0], 1e-9) if len(births) == some else 0.0
