"""What Deutsch's assumption costs between a wire and the drum: against ions that drift along their own field.

Bipolar coordinates make a strip of the air between the cylinders, on which Poisson's equation is solved by Fourier
series around and differences across, and the charge is marched from the wire: with p = 1/rho, div(rho E) = 0 is
E . grad p = 1/eps0, linear. Both are repeated until the field on the wire is that of its onset (Kaptzov).

Takes 10 s.

    python benchmarks/ion_drift.py
    python benchmarks/ion_drift.py --voltage 20 --across 1200 --around 256
"""

import argparse

import numpy as np
from scipy.linalg import solve_banded

import cesim
from cesim.corona import MOBILITY, VACUUM_PERMITTIVITY, IonisedField, Wire

DRUM, WIRE, DISTANCE = 0.160, 0.15e-3, 0.230  # m
FARTHEST = 2.0  # m, the scale of the coordinates at most: infinity is a point of the strip


def potential(charge, voltage, ds, eigenvalues):
    """Poisson's equation on the strip, by a tridiagonal system for each harmonic around."""
    modes = np.fft.rfft(charge, axis=1)
    result = np.zeros_like(modes)
    result[0, 0] = voltage * charge.shape[1]
    inner = len(charge) - 2
    for k, eigenvalue in enumerate(eigenvalues):
        bands = np.full((3, inner), 1.0 / ds**2)
        bands[1] = -2.0 / ds**2 - eigenvalue
        right = -modes[1:-1, k]
        right[0] -= result[0, k] / ds**2
        result[1:-1, k] = solve_banded((1, 1), bands, right)
    return np.fft.irfft(result, charge.shape[1], axis=1)


def drift(voltage, onset, start, across, around, sweeps=60):
    """Angle from the wire's [rad], field and current density on the drum, and how far the wire is from its onset."""
    h1 = (DISTANCE**2 + DRUM**2 - WIRE**2) / (2.0 * DISTANCE)
    c = np.sqrt(h1**2 - DRUM**2)
    drum, wire = -np.arcsinh(c / DRUM), np.arcsinh(c / WIRE)
    s, ds = np.linspace(0.0, wire - drum, across + 1, retstep=True)
    v, dv = -np.pi + (np.arange(around) + 0.5) * 2.0 * np.pi / around, 2.0 * np.pi / around
    h = np.minimum(c / (np.cosh(wire - s)[:, None] - np.cos(v)), FARTHEST)
    eigenvalues = (2.0 - 2.0 * np.cos(np.fft.rfftfreq(around, 1.0 / around) * dv)) / dv**2
    first, charge = np.full(around, 1.0 / start), np.zeros((across + 1, around))
    V = potential(charge, voltage, ds, eigenvalues)
    for sweep in range(sweeps):
        V = 0.5 * (V + potential(charge, voltage, ds, eigenvalues))
        along = np.maximum(-np.gradient(V, ds, axis=0, edge_order=2), 1e-3 * voltage / s[-1])
        turn = -(np.roll(V, -1, 1) - np.roll(V, 1, 1)) / (2.0 * dv) / along
        off = along[0] / h[0] / onset
        first = first if sweep < 4 else first * off**-0.4
        rise, p = h**2 / along / VACUUM_PERMITTIVITY, np.empty_like(V)
        p[0] = first
        for k in range(across):
            slope = np.where(turn[k] > 0.0, p[k] - np.roll(p[k], 1), np.roll(p[k], -1) - p[k]) / dv
            p[k + 1] = p[k] + ds * (0.5 * (rise[k] + rise[k + 1]) - turn[k] * slope)
        charge = h**2 / (p * VACUUM_PERMITTIVITY)
    place = c / (np.cosh(drum) - np.cos(v)) * np.array([np.full(around, np.sinh(drum)), np.sin(v)])
    angle, field = np.arctan2(place[1], place[0] + h1), along[-1] / h[-1]
    order = np.argsort(angle)
    return angle[order], field[order], (MOBILITY * field / p[-1])[order], float(np.abs(off - 1.0).max())


def main():
    parser = argparse.ArgumentParser(description="Deutsch's assumption against the drift of ions, wire over drum.")
    parser.add_argument("--voltage", type=float, default=30.0, metavar="KV", help="default: 30")
    parser.add_argument("--across", type=int, default=400, help="cells from wire to drum; default: 400")
    parser.add_argument("--around", type=int, default=128, help="cells around; default: 128")
    options = parser.parse_args()

    voltage = 1e3 * options.voltage
    without = cesim.fields.TwoCylinders(DRUM, WIRE, DISTANCE, 0.5 * np.pi, -voltage)
    deutsch = IonisedField(without, [Wire((0.0, DISTANCE), WIRE, -voltage)], DRUM, density=1.204 / 1.184)
    onset, top = float(deutsch.onset_field[0]), int(np.argmax(deutsch.current_density))
    constant = deutsch.current_density[top] / (MOBILITY * deutsch.laplacian_field[top])  # rho x of the middle line
    start = constant * voltage / float(deutsch.onset_voltage[0])
    angle, field, current, off = drift(voltage, onset, start, options.across, options.around)
    print(f"field on the wire off its onset by {off:.1%} at most")
    print("degrees  field by drift, Deutsch [kV/m]  current density by drift, Deutsch [mA/m2]")
    for degrees in (0, 10, 20, 30, 40, 60):
        at = np.radians(degrees)
        E, J = np.interp(at, angle, field), np.interp(at, angle, current)
        by = [np.interp(at, deutsch.angle, column) for column in (deutsch.field, deutsch.current_density)]
        print(f"{degrees:7d}  {1e-3 * E:14.1f} {1e-3 * by[0]:8.1f}       {1e3 * J:20.4f} {1e3 * by[1]:8.4f}")
    total = DRUM * float(np.sum(0.5 * (current[1:] + current[:-1]) * np.diff(angle)))
    print(f"current {1e3 * total:.4f} mA/m by drift, {1e3 * deutsch.current:.4f} by Deutsch's assumption")


if __name__ == "__main__":
    main()
