"""Ions that drift along the field that they make themselves, from a wire to the drum (docs/physics.md 1.4).

A conformal map makes a strip of the air between wire and drum: s runs from one to the other, v around. There Poisson's
equation has constant coefficients, d2V/ds2 + d2V/dv2 = -h^2 rho/eps0 with the metric h, and is solved by Fourier
series around and differences across. The ions are followed along the field: div(rho E) = 0 makes E . grad(1/rho) =
1/eps0, which begins on the wire. What they leave it with is what keeps the field there at its onset (Kaptzov), or
nothing where the field stays below it.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .constants import VACUUM_PERMITTIVITY
from .corona import MOBILITY, Array, IonisedField, Wire
from .errors import InputError
from .fem.cache import cache_folder

VERSION = 1  # of the method: a change of it makes other numbers
FARTHEST = 2.0  # m, the metric at most: infinity is a point of the strip
LEAST_SHARE = 1e-3  # of the mean field across: ions go to the drum, however weak the field is
LEAST_VOLTAGE = 1.4  # over its onset: nearer, what the wire gives on its far side has next to no effect on its field
SWEEPS = 200  # after which there is no hope
DEPTH = 10  # sweeps that Anderson's extrapolation remembers
PLAIN = 4  # sweeps in which the ions settle before the wire follows
RELAXATION, EXPONENT = 0.5, 0.4  # of the potential, and of the wire's charge in its field over the onset
NEAR = 0.3  # of its onset: here the wire's field is linear enough in its charge to extrapolate
SPENT = 7.0  # of the logarithm of the charge: where the wire gives a thousandth of its most it does not burn
LARGEST_STEP = 1.0  # of the logarithm of the wire's charge


@dataclass(frozen=True)
class Strip:
    """The air between two conductors, mapped on a strip.

    Attributes
    ----------
    metric : (across + 1, around) array
        h, the scale of the map, from wire to drum and around [m].
    spacing : float
        Of the rows; the columns lie 2 pi/around apart, periodic, at the middles of their cells.
    """

    metric: Array
    spacing: float

    @classmethod
    def coaxial(cls, wire_radius: float, cylinder_radius: float, across: int, around: int) -> Strip:
        """A wire in a cylinder: s = ln(r/a), h = r."""
        s = np.linspace(0.0, math.log(cylinder_radius / wire_radius), across + 1)
        return cls(np.repeat(wire_radius * np.exp(s)[:, None], around, axis=1), float(s[1]))

    @classmethod
    def beside(cls, wire_radius: float, drum_radius: float, distance: float, across: int, around: int) -> Strip:
        """A wire beside a drum: bipolar coordinates about the limit points of 1.1."""
        c, _, drum, wire = _bipolar(wire_radius, drum_radius, distance)
        s = np.linspace(0.0, wire + drum, across + 1)
        h = c / (np.cosh(wire - s)[:, None] - np.cos(_around(around)))
        return cls(np.minimum(h, FARTHEST), float(s[1]))


@dataclass(frozen=True)
class Flow:
    """Ions that flow steadily through a strip.

    Attributes
    ----------
    potential : (across + 1, around) array
        [V], of the wire's sign taken away: positive.
    wire_charge : (around,) array
        Logarithm of 1/rho on the wire [m3/C].
    field, density : (around,) arrays
        Field [V/m] and charge of the ions [C/m3] at the drum.
    wire_error : float
        How far the field on the wire is from its onset, relative, where it is farthest.
    sweeps : int
        It took.
    """

    potential: Array
    wire_charge: Array
    field: Array
    density: Array
    wire_error: float
    sweeps: int


def _around(count: int) -> Array:
    return -np.pi + (np.arange(count) + 0.5) * 2.0 * np.pi / count


def _bipolar(wire_radius: float, drum_radius: float, distance: float) -> tuple[float, float, float, float]:
    """c and h1 of docs/physics.md 1.1, and the coordinates of drum and wire, both positive."""
    h1 = (distance**2 + drum_radius**2 - wire_radius**2) / (2.0 * distance)
    c = math.sqrt((h1 - drum_radius) * (h1 + drum_radius))
    return c, h1, math.asinh(c / drum_radius), math.asinh(c / wire_radius)


def _poisson(source: Array, voltage: float, spacing: float) -> Array:
    """Potential with d2V/ds2 + d2V/dv2 = -source, `voltage` in the first row and 0 in the last."""
    around = source.shape[1]
    modes = np.fft.rfft(source, axis=1)
    stiff = 1.0 / spacing**2
    diagonal = -2.0 * stiff - np.arange(modes.shape[1]) ** 2
    inner = -modes[1:-1]
    inner[0, 0] -= voltage * around * stiff
    above = np.empty((len(inner), modes.shape[1]))
    above[0] = stiff / diagonal
    inner[0] /= diagonal
    for i in range(1, len(inner)):  # Thomas' algorithm, for all harmonics at once
        pivot = 1.0 / (diagonal - stiff * above[i - 1])
        above[i] = stiff * pivot
        inner[i] = (inner[i] - stiff * inner[i - 1]) * pivot
    for i in range(len(inner) - 2, -1, -1):
        inner[i] -= above[i] * inner[i + 1]
    solution = np.zeros_like(modes)
    solution[0, 0] = voltage * around
    solution[1:-1] = inner
    return np.asarray(np.fft.irfft(solution, around, axis=1))


def _moved(row: Array, cells: Array) -> Array:
    """A periodic row at places so many cells before each column, by cubics through four points."""
    count = len(row)
    place = np.arange(count) - cells
    low = np.floor(place).astype(int)
    t = place - low
    a, b, c, d = (row[(low + k) % count] for k in (-1, 0, 1, 2))
    return np.asarray(
        -t * (t - 1.0) * (t - 2.0) / 6.0 * a
        + (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0 * b
        - (t + 1.0) * t * (t - 2.0) / 2.0 * c
        + (t + 1.0) * t * (t - 1.0) / 6.0 * d
    )


def _slope(potential: Array, spacing: float) -> Array:
    """-dV/ds, second order, also at the ends."""
    return np.asarray(-np.gradient(potential, spacing, axis=0, edge_order=2))


def _followed(strip: Strip, potential: Array, wire_charge: Array) -> tuple[Array, Array]:
    """-dV/ds, and 1/rho of the ions that leave the wire with exp(wire_charge), along the field of a potential."""
    rows, around = strip.metric.shape
    cell = 2.0 * np.pi / around
    along = np.maximum(_slope(potential, strip.spacing), LEAST_SHARE * potential[0, 0] / (rows * strip.spacing))
    drift = (np.roll(potential, 1, axis=1) - np.roll(potential, -1, axis=1)) / (2.0 * cell) / along  # dv/ds
    growth = 0.5 * strip.spacing * strip.metric**2 / along / VACUUM_PERMITTIVITY
    sparse = np.empty_like(potential)
    sparse[0] = np.exp(wire_charge)
    for k in range(rows - 1):
        cells = 0.5 * (drift[k] + drift[k + 1]) * strip.spacing / cell
        came = np.maximum(_moved(sparse[k] + growth[k], cells), sparse[k].min())
        sparse[k + 1] = came + growth[k + 1]
    return along, sparse


def _extrapolated(before: list[Array], after: list[Array], head: int) -> Array:
    """Anderson's next guess from the last guesses and what a sweep made of each; the first `head` numbers move little.

    D. G. Anderson, J. ACM 12 (1965) 547.
    """
    steps = np.array(after) - np.array(before)
    change = np.diff(steps, axis=0).T
    weights = np.linalg.lstsq(change, steps[-1], rcond=1e-8)[0]
    guess = after[-1] - np.diff(np.array(after), axis=0).T @ weights
    far = float(np.abs(guess[:head] - before[-1][:head]).max()) / LARGEST_STEP
    return np.asarray(before[-1] + (guess - before[-1]) / max(far, 1.0))


def flow(
    strip: Strip, voltage: float, onset_field: float, density: float, tolerance: float, start: Flow | None = None
) -> Flow:
    """The steady flow of ions between a wire in corona and a grounded conductor.

    Parameters
    ----------
    strip : Strip
        The air.
    voltage, onset_field : float
        Of the wire, positive [V]; on its surface [V/m].
    density : float
        First guess of the ions' charge at the wire [C/m3].
    tolerance : float
        Of the field on the wire over its onset, less 1, and of the potential over the voltage.
    start : Flow, optional
        One on half as many cells each way, to begin with.

    Returns
    -------
    Flow

    Raises
    ------
    InputError
        Where `SWEEPS` sweeps do not reach the tolerance.
    """
    rows, around = strip.metric.shape
    if start is None:
        charge, potential = (
            np.full(around, -math.log(density)),
            _poisson(np.zeros((rows, around)), voltage, strip.spacing),
        )
    else:
        charge, potential = _refined(start)
    before: list[Array] = []
    after: list[Array] = []
    for sweep in range(SWEEPS):
        along, sparse = _followed(strip, potential, charge)
        made = _poisson(strip.metric**2 / (sparse * VACUUM_PERMITTIVITY), voltage, strip.spacing)
        on_wire = _slope(made[:3], strip.spacing)[0] / strip.metric[0] / onset_field
        burns = (charge < charge.min() + SPENT) | (on_wire > 1.0)
        off = float(np.abs(on_wire - 1.0).max(where=burns, initial=0.0))
        if off < tolerance and np.abs(made - potential).max() < tolerance * voltage:
            field = along[-1] / strip.metric[-1]
            return Flow(potential, charge, field, 1.0 / sparse[-1], off, sweep + 1)
        follows = sweep >= PLAIN or start is not None
        next_charge = charge - EXPONENT * np.log(np.maximum(on_wire, LEAST_SHARE)) if follows else charge
        next_charge = np.minimum(next_charge, next_charge.min() + 1.2 * SPENT)
        next_potential = potential + RELAXATION * (made - potential)
        before.append(np.concatenate([charge, potential.ravel() / voltage]))
        after.append(np.concatenate([next_charge, next_potential.ravel() / voltage]))
        memory = DEPTH if follows and off < NEAR else 1
        before, after = before[-memory:], after[-memory:]
        guess = _extrapolated(before, after, around) if memory > 1 and len(before) > 1 else after[-1]
        charge, potential = guess[:around], voltage * guess[around:].reshape(rows, around)
    raise InputError(
        f"is 'drift', which does not converge here: after {SWEEPS} sweeps the wire's field is {off:.2g} off its onset",
        path="corona.model",
        value="drift",
        allowed="'deutsch', or a voltage farther above the onset",
    )


def _refined(coarse: Flow) -> tuple[Array, Array]:
    """Charge of the wire and potential of a flow on twice as many cells each way."""
    rows, around = coarse.potential.shape
    old, new = _around(around), _around(2 * around)
    charge = np.interp(new, old, coarse.wire_charge, period=2.0 * np.pi)
    potential = np.empty((2 * rows - 1, 2 * around))
    for k in range(rows):
        potential[2 * k] = np.interp(new, old, coarse.potential[k], period=2.0 * np.pi)
    potential[1::2] = 0.5 * (potential[:-1:2] + potential[2::2])
    return charge, potential


class DriftingIons(IonisedField):
    """Field and ion current along a grounded drum under one corona wire, of ions that drift along their own field.

    Parameters
    ----------
    drum_radius : quantity
        [m]; the drum's axis is that of z.
    wire : Wire
        The only electrode. There is no box.
    roughness, density, mobility, angles
        As of `cesim.corona.IonisedField`.
    across, around : int
        Cells from wire to drum and around, even.
    cache : bool
        Whether solutions are kept on disk: in $CESIM_CACHE, or the platform's folder for caches.

    Attributes
    ----------
    discretisation_error : float
        Root mean square difference of the current density to that on half as many cells each way, over its root mean
        square; 0 without ions.
    wire_error : float
        How far the field on the wire is from its onset, relative.
    deutsch : IonisedField
        The same by Deutsch's assumption.

    Raises
    ------
    InputError
        Where a number is outside its range, the voltage above the onset and below `LEAST_VOLTAGE` times it, or the
        iteration does not converge.
    """

    def __init__(
        self,
        drum_radius: float,
        wire: Wire,
        *,
        roughness: float = 1.0,
        density: float = 1.0,
        mobility: float | str = MOBILITY,
        angles: int = 721,
        across: int = 200,
        around: int = 64,
        cache: bool = True,
    ) -> None:
        from .fields import TwoCylinders

        if across % 2 or around % 2 or not (16 <= across <= 4000 and 16 <= around <= 1024):
            raise InputError(
                f"are {across} and {around}: even numbers, from 16 to 4000 and to 1024", path="across, around"
            )
        self._cells, self._cache = (across, around), cache
        self.discretisation_error, self.wire_error = 0.0, 0.0
        self._distance, toward = math.hypot(*wire.center), math.atan2(wire.center[1], wire.center[0])
        field = TwoCylinders(drum_radius, wire.radius, self._distance, toward, wire.voltage)
        given = {"roughness": roughness, "density": density, "mobility": mobility, "angles": angles}
        self.deutsch = IonisedField(field, [wire], drum_radius, **given)  # type: ignore[arg-type]
        self._facing = 0.5 * math.pi - toward  # from the drum's top, clockwise
        super().__init__(field, [wire], drum_radius, **given)  # type: ignore[arg-type]

    def _solve(self, scale: float) -> tuple[Array, Array]:
        without, guess = super()._solve(scale)
        voltage, onset_field = abs(self.wires[0].voltage) * scale, float(self.onset_field[0])
        if not guess.max() > 0.0:
            return without, guess
        if voltage < LEAST_VOLTAGE * self.onset_voltage[0]:
            least = LEAST_VOLTAGE * float(self.onset_voltage[0])
            raise InputError(
                f"is 'drift', but the wire's {voltage:.6g} V are too near its onset: the iteration would not converge",
                path="corona.model",
                value="drift",
                allowed=f"'deutsch', or from {least:.6g} V on",
            )
        top = int(np.argmax(guess))
        # rho x is constant along Deutsch's middle line, x is its least at the wire: onset over the field without ions.
        density = guess[top] / (self.mobility * scale * self.laplacian_field[top])
        density *= voltage / float(self.onset_voltage[0])
        solved = self._kept(voltage, onset_field, density)
        if scale == 1.0:
            self.discretisation_error, self.wire_error = float(solved[3, 0]), float(solved[3, 1])
        turned = np.mod(self.angle - self._facing + np.pi, 2.0 * np.pi) - np.pi
        field, ions = (np.exp(np.interp(turned, solved[0], np.log(row), period=2.0 * np.pi)) for row in solved[1:3])
        return field, self.mobility * field * ions

    def _kept(self, voltage: float, onset_field: float, density: float) -> Array:
        """Angle from the wire's, field and charge along the drum, and the two errors: from the cache, or solved."""
        shape = {
            "version": VERSION,
            "cells": self._cells,
            "lengths": [self.wires[0].radius, self.drum_radius, self._distance],
            "voltage": voltage,
            "onset": onset_field,
        }
        name = "ions-" + hashlib.sha256(json.dumps(shape, sort_keys=True).encode()).hexdigest() + ".npy"
        found = _load(cache_folder() / name, self._cells[1]) if self._cache else None
        if found is None:
            found = self._drift(voltage, onset_field, density)
            if self._cache:
                _store(cache_folder() / name, found)
        return found

    def _drift(self, voltage: float, onset_field: float, density: float) -> Array:
        """The solution on all cells, and its errors, in four rows."""
        a, R, (across, around) = self.wires[0].radius, self.drum_radius, self._cells
        # Which side of the wire burns more depends on what its field differs by from side to side, a over the gap, and
        # the ions that make up for it weigh the less, the nearer the voltage is to its onset.
        excess = voltage / float(self.onset_voltage[0]) - 1.0
        tolerance = 0.01 * a / (self._distance - R) * min(excess, 1.0)
        coarse = flow(
            Strip.beside(a, R, self._distance, across // 2, around // 2), voltage, onset_field, density, tolerance
        )
        fine = flow(
            Strip.beside(a, R, self._distance, across, around), voltage, onset_field, density, tolerance, coarse
        )
        c, h1, drum, _ = _bipolar(a, R, self._distance)

        def angle(count: int) -> Array:
            v = _around(count)
            scale = c / (math.cosh(drum) - np.cos(v))
            return np.arctan2(scale * np.sin(v), h1 - scale * math.sinh(drum))

        order = np.argsort(angle(around))
        place = angle(around)[order]
        current = (fine.field * fine.density)[order]
        rough = angle(around // 2)
        other = np.interp(place, np.sort(rough), (coarse.field * coarse.density)[np.argsort(rough)], period=2.0 * np.pi)
        weights = np.gradient(place)
        error = math.sqrt(float(np.sum(weights * (other - current) ** 2) / np.sum(weights * current**2)))
        errors = np.zeros(around)
        errors[:2] = error, fine.wire_error
        return np.array([place, fine.field[order], fine.density[order], errors])


def _load(path: Path, around: int) -> Array | None:
    """What is kept in a file; None: nothing, or a file that is damaged."""
    try:
        found = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError, zipfile.BadZipFile):
        return None
    good = getattr(found, "shape", None) == (4, around) and bool(np.isfinite(found).all()) and (found[1:3] > 0.0).all()
    return np.asarray(found, dtype=float) if good else None


def _store(path: Path, solved: Array) -> None:
    """Keep a solution. A cache that cannot be written is no reason to stop."""
    part = path.with_suffix(f".{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(part, "wb") as file:
            np.save(file, solved)
        os.replace(part, path)
    except OSError:
        with suppress(OSError):
            part.unlink()
