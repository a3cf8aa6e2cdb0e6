"""Which effects a machine calls for, from fine powder to coarse scrap, and how far each moves what lands.

For feeds of one size after the other the table of `scene.effects()` is asked for each effect's size (against its
threshold) and for the expected shift of the mean landing. One of the feeds is then audited: each decision is switched
over on the same grains, and the shift that was expected stands beside the one that was measured.

Takes about 5 s on one core.

    python examples/which_effects.py
    python examples/which_effects.py --voltage -15 --audit 0.5 --grains 500
"""

import argparse
import math
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import cesim

DIAMETERS = (0.05, 0.1, 0.2, 0.35, 0.6, 1.0, 2.0, 3.5, 5.0)  # mm
SEEN = 0.05  # mm, the least shift that the picture shows


def machine(diameter, voltage):
    """The reference drum with copper and ABS that fall on its top; a stream so thin that its grains hardly meet."""
    scene = cesim.scenes.reference_machine("spheres")
    scene.name = f"copper and ABS of {diameter:g} mm"
    scene.plates, scene.splitters = [], []
    scene.electrode.voltage = f"{voltage} kV"
    scene.feed = cesim.Feed(
        rate="0.2 kg/h",
        mix={"copper": 0.9, "ABS": 0.1},
        size=cesim.LogNormal(
            median=f"{diameter} mm", gsd=1.2, least=f"{diameter / 1.5} mm", most=f"{1.5 * diameter} mm"
        ),
        outlet=cesim.Outlet(center=(-0.02, 0.161 + 5e-3 * diameter, 0.0), length="20 mm", width="100 mm"),
        velocity=(0.75, -0.3, 0.0),
    )
    return scene


def sizes_and_shifts(voltage):
    """Effect -> per diameter: size over threshold, expected shift in mm of the material it moves most, on or off."""
    found = {}
    for diameter in DIAMETERS:
        for row in machine(diameter, voltage).effects():
            if row.name != "gravity":
                shift = 1e3 * max((abs(value) for value in row.shifts.values()), default=math.nan)
                found.setdefault(row.name, []).append((row.size / row.threshold, shift, row.on))
    return {name: np.array(rows) for name, rows in found.items() if np.any([size for size, _, _ in rows])}


def draw(found, audit, path):
    """Sizes by effect and diameter; what was expected against what was measured."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(13, 5.2), width_ratios=(1.5, 1), layout="constrained")
    ratio = np.array([rows[:, 0] for rows in found.values()])
    colours = np.log10(np.clip(ratio, 1e-3, 1e3))
    image = left.imshow(colours, cmap="RdBu_r", vmin=-3, vmax=3, aspect="auto")
    for i, rows in enumerate(found.values()):
        for j, (size, shift, on) in enumerate(rows):
            digits = 0 if shift >= 10.0 else 2
            shown = "?" if math.isnan(shift) else f"{shift:.{digits}f}" if shift >= SEEN else "·"
            faint = abs(colours[i, j]) < 1.8
            left.text(
                j, i, shown if size else "–", ha="center", va="center", fontsize=9,
                color="black" if faint else "white", fontweight="bold" if on else "normal",
            )  # fmt: skip
    left.set_xticks(range(len(DIAMETERS)), [f"{d:g}" for d in DIAMETERS])
    left.set_yticks(range(len(found)), list(found))
    left.set_xlabel("median diameter [mm]")
    left.set_title(f"Expected shift of the mean landing [mm]; bold: on; · below {SEEN:g}; ? no prediction", fontsize=10)
    bar = figure.colorbar(image, ax=left, ticks=range(-3, 4), pad=0.02)
    bar.set_ticklabels(["1/1000", "1/100", "1/10", "1", "10", "100", "1000"])
    bar.set_label("size over threshold (red: on by itself)")

    for kind, colour in (("copper", "tab:orange"), ("ABS", "tab:blue")):
        rows = [row for row in audit if row.material == kind and math.isfinite(row.predicted + row.measured)]
        x, y = (1e3 * np.array([getattr(row, name) for row in rows]) for name in ("predicted", "measured"))
        error = 1e3 * np.array([[row.measured - row.low, row.high - row.measured] for row in rows]).T
        right.errorbar(x, y, error, fmt="o", color=colour, ms=5, capsize=2, label=kind)
        for row, a, b in zip(rows, x, y, strict=True):
            if (
                abs(b) > 3.0
            ):  # metal's names on the left of the line and plastic's on its right: they lie close together
                side, place = (-8, "right") if kind == "copper" else (8, "left")
                right.annotate(
                    row.name,
                    (a, b),
                    (side, 0),
                    textcoords="offset points",
                    fontsize=7,
                    color=colour,
                    ha=place,
                    va="center",
                )
    reach = 3.0 * max(abs(value) for value in (*right.get_xlim(), *right.get_ylim()))
    right.plot((-reach, reach), (-reach, reach), color="0.7", lw=1, zorder=0)
    for axis in (right.xaxis, right.yaxis):
        axis.axes.set(**{f"{axis.axis_name}scale": "symlog"})
        axis.set_ticks((-100, -10, -1, 0, 1, 10, 100), ("−100", "−10", "−1", "0", "1", "10", "100"))
    right.set(xlim=(-reach, reach), ylim=(-reach, reach), xlabel="expected shift [mm]", ylabel="measured shift [mm]")
    right.set_title(f"{audit.scene}: each decision switched over", fontsize=9)
    right.grid(alpha=0.3)
    right.legend(loc="upper left")
    figure.savefig(path, dpi=130)


def main():
    """See the top of this file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--voltage", type=float, default=-30.0, help="kV; default: %(default)s")
    parser.add_argument("--audit", type=float, default=1.0, help="median diameter of the feed to audit, mm")
    parser.add_argument("--grains", type=int, default=400, help="sample of the audit; default: %(default)s")
    parser.add_argument("--out", type=Path, default=Path("which_effects.png"))
    options = parser.parse_args()
    found = sizes_and_shifts(options.voltage)
    for name, rows in found.items():
        on = [f"{d:g}" for d, (_, _, is_on) in zip(DIAMETERS, rows, strict=True) if is_on]
        print(f"{name:<17} on at {', '.join(on) + ' mm' if on else 'none of these sizes'}")
    audit = machine(options.audit, options.voltage).effects.audit(grains=options.grains)
    print(f"\n{audit}")
    draw(found, audit, options.out)
    print(f"written {options.out}")


if __name__ == "__main__":
    main()
