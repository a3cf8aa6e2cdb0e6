"""Corona: onset at wires, and the field and the current of the ions on the drum (docs/physics.md 1.4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .constants import VACUUM_PERMITTIVITY as VACUUM_PERMITTIVITY
from .errors import InputError
from .units import to_si

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

BREAKDOWN = 30e5  # V/m, Peek's strength of air between parallel wires
SHARE = 0.301  # sqrt(cm), Peek's for parallel wires
PEEK_DENSITY = 1.184  # kg/m3, of dry air at 25 degrees Celsius and 76 cm of mercury, Peek's relative density 1
MOBILITY = 1.8e-4  # m2/(V s), of negative ions in air
STEPS = 480  # along a field line, equal in potential
MISS = 0.05  # of a wire's radius, within which a line has reached it
LONGEST = 1e4  # m, that a line may go at its rate in the whole of the voltage: it has left the machine


def relative_density(temperature: float | str = 298.15, pressure: float | str = 101325.0) -> float:
    """Peek's relative density of air, 1 at 25 degrees Celsius and 101 325 Pa.

    Parameters
    ----------
    temperature : quantity
        [K].
    pressure : quantity
        [Pa].

    Returns
    -------
    float
        3.92 b/(273 + t) with b in cm of mercury and t in degrees Celsius: proportional to pressure over temperature
        (F. W. Peek, *Dielectric Phenomena in High-Voltage Engineering*, McGraw-Hill, 3rd ed. 1929).
    """
    kelvin = _number("temperature", temperature, "K", 100.0, 2000.0)
    return _number("pressure", pressure, "Pa", 1.0, 1e8) / 101325.0 * 298.15 / kelvin


def onset(radius: float | str, roughness: float = 1.0, density: float = 1.0) -> float:
    """Field on a wire in air at which its corona begins, V/m.

    Parameters
    ----------
    radius : quantity
        Of the wire [m].
    roughness : float
        1 for a polished wire, 0.93 to 0.98 for a weathered one.
    density : float
        Relative density of the air, see `relative_density`.

    Returns
    -------
    float
        30 kV/cm m d (1 + 0.301/sqrt(d a)), a in cm.

    Raises
    ------
    InputError
        Where a number is outside its range.

    Notes
    -----
    F. W. Peek, *Dielectric Phenomena in High-Voltage Engineering*, McGraw-Hill, 3rd ed. 1929; measured with peaks of
    alternating voltage, which begin on the negative half. Negative and positive onset differ by some per cent.
    """
    a = _number("radius", radius, "m", 1e-7, 10.0)
    m = _number("roughness", roughness, "", 0.1, 1.0)
    d = _number("density", density, "", 1e-3, 100.0)
    return BREAKDOWN * m * d * (1.0 + SHARE / float(np.sqrt(d * 100.0 * a)))


@dataclass(frozen=True)
class Wire:
    """A corona wire parallel to the z axis.

    Attributes
    ----------
    center : (float, float)
        x and y of its axis [m].
    radius : float
        [m].
    voltage : float
        Against the drum [V].
    """

    center: tuple[float, float]
    radius: float
    voltage: float


def coaxial(radius: ArrayLike, current: float, wire_radius: float, onset_field: float, mobility: float) -> Array:
    """Field in V/m about a wire in a cylinder that carries a current of ions, exact.

    Parameters
    ----------
    radius : array_like
        Distances from the axis, any shape [m].
    current : float
        Of a metre of wire [A/m].
    wire_radius, onset_field, mobility : float
        [m], [V/m] on the wire, [m2/(V s)].

    Notes
    -----
    (1/r) sqrt(I'(r^2 - a^2)/(2 pi eps0 b) + (E_c a)^2): J. S. Townsend, Phil. Mag. 28 (1914) 83. Deutsch's assumption
    is exact here.
    """
    r = np.asarray(radius, dtype=float)
    charge = current * (r**2 - wire_radius**2) / (2.0 * np.pi * VACUUM_PERMITTIVITY * mobility)
    return np.asarray(np.sqrt(charge + (onset_field * wire_radius) ** 2) / r)


def along_lines(thickness: Array, onset_ratio: Array) -> tuple[Array, Array]:
    """Deutsch's assumption along field lines without ions.

    Parameters
    ----------
    thickness : (lines, 2 n + 1) array
        Integral of dt/e^2 from the wire on, at equal steps of the share t of the voltage that is used up from wire to
        drum; e is the field without ions over the voltage [m2].
    onset_ratio : (lines,) array
        Onset field over the field without ions at the wire's end of the line.

    Returns
    -------
    rate, raise_ : (lines,) arrays
        K = 2 rho x/(eps0 U) [1/m2], the same all along a line; and x at the drum, the factor by which the ions raise
        the field there. Where there is no corona (ratio 1 and above): 0 and 1.

    Notes
    -----
    With E = x E_L along a line, div E = rho/eps0 and div(rho b E) = 0 give rho x = const and x^2 = x_w^2 + K G, where
    G is ``thickness``. K follows from the voltage, the integral of x dt = 1: concave and rising in K, so that Newton's
    iteration from a lower bound rises to the root. W. Deutsch, Ann. Phys. 408 (1933) 588; V. I. Popkov, Elektrichestvo
    (1949); M. P. Sarma & W. Janischewskyj, Proc. IEE 116 (1969) 161.
    """
    count = thickness.shape[1]
    weights = np.full(count, 2.0 / (3.0 * (count - 1)))  # Simpson's
    weights[1:-1:2] *= 2.0
    weights[[0, -1]] *= 0.5
    burns = onset_ratio < 1.0
    G, start = thickness[burns], onset_ratio[burns, None] ** 2
    K = (1.0 - start[:, 0]) / (G @ weights)
    for _ in range(60):
        x = np.sqrt(start + K[:, None] * G)
        step = (1.0 - x @ weights) / ((0.5 * G / x) @ weights)
        K += step
        if np.all(np.abs(step) <= 1e-15 * K):
            break
    rate, raise_ = np.zeros(len(onset_ratio)), np.ones(len(onset_ratio))
    rate[burns], raise_[burns] = K, np.sqrt(start[:, 0] + K * G[:, -1])
    return rate, raise_


class IonisedField:
    """Field and ion current along a grounded drum under corona wires, by Deutsch's assumption.

    Parameters
    ----------
    field : callable
        The field without ions: points (n, 3) in m to (n, 3) in V/m, with all electrodes at their voltages. The drum,
        about the z axis, is at 0 V.
    wires : sequence of Wire
        The electrodes in corona; the others are part of ``field``.
    drum_radius : quantity
        [m].
    roughness : float
        Of the wires, see `onset`.
    density : float
        Relative density of the air, see `relative_density`.
    mobility : quantity
        Of the ions [m2/(V s)].
    angles : int
        Points along the drum.

    Attributes
    ----------
    angle : (n,) array
        From the drum's top, clockwise, -pi to pi [rad].
    laplacian_field, field : (n,) arrays
        Strength on the drum without and with ions [V/m].
    current_density : (n,) array
        Of the ions on the drum, positive whatever their sign [A/m2].
    wire : (n,) int array
        Index of the wire from which the line to this point comes, -1: from none that burns.
    onset_field, onset_voltage : (wires,) arrays
        Of each wire, the latter with all other voltages in proportion, infinite for a wire at 0 V [V/m], [V].
    current : float
        To the drum, per metre of its length [A/m].

    Notes
    -----
    Deutsch: the ions change the strength of the field, not its direction. Kaptzov: in corona the field on the wire
    stays at its onset. The first is exact between coaxial cylinders; docs/physics.md 1.4 says what it costs here.
    """

    def __init__(
        self,
        field: Callable[[Array], Array],
        wires: Sequence[Wire],
        drum_radius: float | str,
        *,
        roughness: float = 1.0,
        density: float = 1.0,
        mobility: float | str = MOBILITY,
        angles: int = 721,
    ) -> None:
        self.drum_radius = _number("drum_radius", drum_radius, "m", 1e-6, 100.0)
        self.mobility = _number("mobility", mobility, "m2/(V s)", 1e-7, 1.0)
        if not 8 <= angles <= 100_000:
            raise InputError(f"is {angles}, must be from 8 to 100000", path="angles", value=angles)
        if not wires:
            raise InputError("is empty: without a wire there is no corona", path="wires")
        self.wires = tuple(wires)
        self.onset_field = np.array([onset(wire.radius, roughness, density) for wire in self.wires])
        unit = np.array([_most_unit_field(field, wire) for wire in self.wires])
        self.onset_voltage = np.divide(self.onset_field, unit, out=np.full(len(unit), np.inf), where=unit > 0.0)
        self.angle = np.linspace(-np.pi, np.pi, angles)
        feet = self.drum_radius * np.column_stack([np.sin(self.angle), np.cos(self.angle)])
        self.laplacian_field = _strength(field, feet)
        self.wire = np.full(angles, -1)
        self._thickness = np.ones((angles, STEPS + 1))
        self._onset_ratio = np.full(angles, np.inf)
        for i, wire in enumerate(self.wires):
            if wire.voltage == 0.0:
                continue
            ends, thickness = _trace(field, feet, wire.voltage)
            reached = np.abs(np.hypot(*(ends - wire.center).T) / wire.radius - 1.0) < MISS
            self.wire[reached] = i
            self._thickness[reached] = thickness[reached]
            self._onset_ratio[reached] = self.onset_field[i] / _strength(field, ends[reached])
        self._voltage = np.abs(np.array([wire.voltage for wire in self.wires] + [0.0])[self.wire])
        self.field, self.current_density = self._solve(1.0)
        self.current = self._total(self.current_density)
        self.wire[self.current_density == 0.0] = -1

    def _solve(self, scale: float) -> tuple[Array, Array]:
        """Field and current density along the drum with all voltages times a scale."""
        rate, raise_ = along_lines(self._thickness, self._onset_ratio / scale)
        without = scale * self.laplacian_field
        # C = K eps0 U/2 is the charge density times x, so J = b rho x E_L = b C E_L.
        return raise_ * without, 0.5 * self.mobility * VACUUM_PERMITTIVITY * rate * scale * self._voltage * without

    def _total(self, current_density: Array) -> float:
        middle = 0.5 * (current_density[1:] + current_density[:-1])
        return float(self.drum_radius * np.sum(middle * np.diff(self.angle)))

    def currents(self, voltages: ArrayLike) -> Array:
        """Current per metre of the drum in A/m for voltages (n,) of the first wire in V, all others in proportion."""
        first = abs(self.wires[0].voltage)
        if first == 0.0:
            raise InputError("is 0 V: voltages in proportion to it mean nothing", path="wires[0].voltage", value=0.0)
        scales = np.abs(np.atleast_1d(np.asarray(voltages, dtype=float))) / first
        return np.array([self._total(self._solve(scale)[1]) if scale > 0.0 else 0.0 for scale in scales.tolist()])

    def draw(self, ax: Axes | None = None) -> Axes:
        """Draws field and current density along the drum, against the angle from its top where ions arrive.

        Parameters
        ----------
        ax : matplotlib axes, optional
            Where to; a twin of it takes the current density.

        Returns
        -------
        matplotlib axes
        """
        from .plots import draw_ions

        return draw_ions(self, ax)

    def table(self) -> Array:
        """Angle [rad], field [V/m] and current density [A/m2] along the drum, (n, 3): as the engine takes it."""
        return np.column_stack([self.angle, self.field, self.current_density])


def _number(name: str, value: float | str, unit: str, least: float, most: float) -> float:
    try:
        return to_si(value, unit, least, most)
    except InputError as error:
        raise error.at(name) from None


def _strength(field: Callable[[Array], Array], points: Array) -> Array:
    """Field strength in V/m at points (n, 2) in m."""
    flat = np.column_stack([points, np.zeros(len(points))])
    return np.asarray(np.linalg.norm(field(flat), axis=1))


def _most_unit_field(field: Callable[[Array], Array], wire: Wire) -> float:
    """Largest field on a wire over its voltage, 1/m; 0 V: 0."""
    angle = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)
    ring = wire.radius * np.column_stack([np.cos(angle), np.sin(angle)]) + wire.center
    return float(_strength(field, ring).max()) / abs(wire.voltage) if wire.voltage != 0.0 else 0.0


def _trace(field: Callable[[Array], Array], feet: Array, voltage: float) -> tuple[Array, Array]:
    """Follows field lines from the drum up to a voltage.

    Returns
    -------
    ends : (lines, 2) array
        Where that voltage is reached [m].
    thickness : (lines, STEPS + 1) array
        Integral of dt/e^2 from there back to each of the steps [m2].

    Notes
    -----
    The potential is the independent variable, dx/dV = -E/E^2: near a wire the distance from its axis then changes by
    a factor a step, so that a wire a thousandth of the gap is no harder than another.
    """

    def slope(points: Array) -> tuple[Array, Array]:
        strength = field(np.column_stack([points, np.zeros(len(points))]))[:, :2]
        square = np.maximum(np.sum(strength**2, axis=1) / voltage**2, LONGEST**-2)
        return -strength / (voltage * square[:, None]), 1.0 / square

    h, points = 1.0 / STEPS, feet.copy()
    thickness = np.zeros((len(feet), STEPS + 1))
    for k in range(STEPS):
        v1, g1 = slope(points)
        v2, g2 = slope(points + 0.5 * h * v1)
        v3, g3 = slope(points + 0.5 * h * v2)
        v4, g4 = slope(points + h * v3)
        points = points + h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4)
        thickness[:, k + 1] = thickness[:, k] + h / 6.0 * (g1 + 2.0 * g2 + 2.0 * g3 + g4)
    return points, (thickness[:, -1:] - thickness)[:, ::-1]
