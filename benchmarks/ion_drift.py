"""What Deutsch's assumption costs between a wire and the drum: against ions that drift along their own field.

Both are models of a scene, `corona.model`. Takes 10 s; less where the solution is in the cache.

    python benchmarks/ion_drift.py
    python benchmarks/ion_drift.py --voltage 20 --across 400 --around 128
"""

import argparse

import numpy as np

from cesim.corona import Wire
from cesim.ion_drift import DriftingIons

DRUM, WIRE, DISTANCE = 0.160, 0.15e-3, 0.230  # m


def main():
    parser = argparse.ArgumentParser(description="Deutsch's assumption against the drift of ions, wire over drum.")
    parser.add_argument("--voltage", type=float, default=30.0, metavar="KV", help="default: 30")
    parser.add_argument("--across", type=int, default=200, help="cells from wire to drum; default: 200")
    parser.add_argument("--around", type=int, default=64, help="cells around; default: 64")
    options = parser.parse_args()

    wire = Wire((0.0, DISTANCE), WIRE, -1e3 * options.voltage)
    drift = DriftingIons(DRUM, wire, density=1.204 / 1.184, across=options.across, around=options.around)
    deutsch = drift.deutsch
    print(
        f"current density off that of half as many cells by {drift.discretisation_error:.1%}, "
        f"field on the wire off its onset by {drift.wire_error:.1e}"
    )
    print("degrees  field by drift, Deutsch [kV/m]  current density by drift, Deutsch [mA/m2]")
    for degrees in (0, 10, 20, 30, 40, 60):
        at = np.radians(degrees)
        E, E2 = (np.interp(at, found.angle, found.field) for found in (drift, deutsch))
        J, J2 = (np.interp(at, found.angle, found.current_density) for found in (drift, deutsch))
        print(f"{degrees:7d}  {1e-3 * E:14.1f} {1e-3 * E2:8.1f}       {1e3 * J:20.4f} {1e3 * J2:8.4f}")
    print(f"current {1e3 * drift.current:.4f} mA/m by drift, {1e3 * deutsch.current:.4f} by Deutsch's assumption")


if __name__ == "__main__":
    main()
