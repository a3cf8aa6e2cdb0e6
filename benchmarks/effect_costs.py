"""What effects cost: that those which are off cost nothing, and what each that is on adds to a step.

    python benchmarks/effect_costs.py count [EFFECT ...]
    python benchmarks/effect_costs.py chart [FILE.png]

`count` prints the instructions of a step with an effect off beside those of an engine whose table lacks its row; it
needs valgrind and a C compiler. It builds the engine's sources anew, without Python, and for each effect once more
without its line in csrc/effects/table.c; both run the scene of effect_costs.c with all other effects on. Callgrind
counts what is executed inside `ces_scene_step` and nothing else, so the figures do not depend on the machine's load.

`chart` draws the time of a step as the effects are added one by one, all measured in turn in one run.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import cesim

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / "csrc"
FLAGS = ("-std=c17", "-O3", "-ffp-contract=off")
STEPS = 5
BOUND = 0.005  # of the instructions of a step
CHARTED = 3000  # grains
PICTURE = ROOT / "docs" / "images" / "effect_costs.png"


# ---- instructions ----------------------------------------------------------------------------------------------------


def missing_tools() -> str:
    """What the count needs and this machine lacks, or ""."""
    tools = {"valgrind": shutil.which("valgrind"), "a C compiler (CC)": shutil.which(compiler())}
    return " and ".join(name for name, path in tools.items() if path is None)


def compiler() -> str:
    return os.environ.get("CC", "cc").split()[-1]


def table_rows() -> list[str]:
    """The effects in the order of the table."""
    return re.findall(r"^ {4}&ces_(\w+),$", (SOURCES / "effects" / "table.c").read_text(encoding="utf-8"), re.MULTILINE)


class Engines:
    """The engine without Python, and copies of it whose table lacks a row; built in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        files = [
            path for layer in ("base", "data", "field", "contact", "effects", "scene") for path in layer_files(layer)
        ]
        self._objects = [self._compile(path, path.relative_to(SOURCES).as_posix().replace("/", "_")) for path in files]
        self._objects.append(self._compile(Path(__file__).with_suffix(".c"), "driver"))
        self._whole = self._link("whole", self._objects)

    def _compile(self, source: Path, name: str, *more: str) -> Path:
        target = self.folder / f"{name}.o"
        subprocess.run([compiler(), *FLAGS, *more, "-c", str(source), "-o", str(target)], check=True)
        return target

    def _link(self, name: str, objects: Sequence[Path]) -> Path:
        program = self.folder / name
        subprocess.run([compiler(), *map(str, objects), "-lm", "-o", str(program)], check=True)
        return program

    def without(self, effect: str) -> Path:
        """The program whose table lacks the row."""
        text = (SOURCES / "effects" / "table.c").read_text(encoding="utf-8")
        shorter = text.replace(f"    &ces_{effect},\n", "")
        assert shorter != text, f"the table has no row {effect}"
        source = self.folder / f"table_without_{effect}.c"
        source.write_text(shorter, encoding="utf-8")
        table = self._compile(source, source.stem, "-I", str(SOURCES / "effects"))
        return self._link(f"without_{effect}", [table, *(o for o in self._objects if o.name != "effects_table.c.o")])

    def count(self, program: Path, effects: Sequence[str]) -> tuple[int, str]:
        """Instructions a step, and the hash of the state after the last."""
        record = self.folder / "callgrind.out"
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={record}", "--toggle-collect=ces_scene_step"]
        done = subprocess.run(
            [*command, str(program), str(STEPS), *effects], check=True, capture_output=True, text=True, timeout=300
        )
        total = re.search(r"^(?:summary|totals): (\d+)", record.read_text(encoding="utf-8"), re.MULTILINE)
        assert total is not None
        return int(total[1]) // STEPS, done.stdout.strip()

    def compare(self, effect: str) -> tuple[int, int, int, bool]:
        """Instructions a step with the effect on, with it off, and of an engine without its row.

        And whether the states of the last two are the same to the last bit.
        """
        others = [name for name in table_rows() if name != effect]
        on, _ = self.count(self._whole, table_rows())
        off, state = self.count(self._whole, others)
        lacking, same = self.count(self.without(effect), others)
        return on, off, lacking, state == same


def layer_files(layer: str) -> list[Path]:
    return sorted((SOURCES / layer).glob("*.c"))


def count(effects: Sequence[str]) -> int:
    """Prints the comparison; 1 where an effect that is off costs more than the bound."""
    lack = missing_tools()
    if lack:
        print(f"not counted: this machine lacks {lack}")
        return 0
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        engines = Engines(Path(folder))
        print(f"{'instructions a step':20}{'on':>12}{'off':>12}{'no row':>12}{'off/no row - 1':>16}  same state")
        for effect in effects or table_rows():
            on, off, lacking, same = engines.compare(effect)
            worst = max(worst, abs(off / lacking - 1.0))
            print(
                f"{effect:20}{on:12d}{off:12d}{lacking:12d}{off / lacking - 1.0:16.2e}  {'yes' if same else 'NO'}",
                flush=True,
            )
    print(f"worst {worst:.1e}, bound {BOUND:.1e}: {'holds' if worst <= BOUND else 'BROKEN'}")
    return int(worst > BOUND)


# ---- time ------------------------------------------------------------------------------------------------------------


def flying() -> cesim.Simulation:
    """The reference drum, electrode and corona, with nothing that grains could meet."""
    scene = cesim.scenes.reference_machine()
    scene.feed = None
    scene.plates, scene.splitters, scene.walls = [], [], []
    scene.numerics.step = 1e-5
    scene.shapes = {"flake": cesim.Flake(width=3.0, spheres=5)}
    return cesim.Simulation(scene, seed=1, threads=1)


def engine_with(base: cesim.Simulation, effects: Sequence[str]) -> cesim.engine.Scene:
    """The engine with these effects at their usual parameters, and the grains in it."""
    known = {row["name"]: row for row in cesim.engine.effects()}
    rows = [
        {"name": name, "parameters": {p["name"]: p["default"] for p in known[name]["parameters"]}} for name in effects
    ]
    for row in rows:
        if row["name"] == "wind" and base.scene.drum is not None:
            row["parameters"]["speed"] = base.scene.drum.speed
    engine = cesim.engine.Scene({**base.definition, "effects": rows}, seed=1, threads=1)
    k = np.arange(CHARTED)
    angle, height = 0.02 + 1.4 * (k % 50) / 50, 0.004 + 0.003 * (k // 50 % 10)
    rho = 0.160 + height
    place = np.column_stack([rho * np.sin(angle), rho * np.cos(angle), -0.12 + 0.04 * (k // 500)])
    names = list(base.scene.materials)
    material = np.where(k % 2 == 0, names.index("copper"), names.index("ABS")).astype(np.int32)
    charge = np.where(k % 2 == 0, 1e-12, -2e-12)
    still = np.zeros((CHARTED, 3))
    spin = still + np.array([0.0, 0.0, -300.0])
    turned = np.tile([1.0, 0.0, 0.0, 0.0], (CHARTED, 1))
    velocity = np.column_stack([np.cos(angle), -np.sin(angle), 0.0 * angle])
    engine.add(place, velocity, spin, material, np.full(CHARTED, 1e-3), charge, turned, (k % 4 == 3).astype(np.int32))
    engine.step(2)
    return engine


def measure(steps: int = 2, rounds: int = 60) -> tuple[list[str], list[float]]:
    """Microseconds of processor time a grain and step with the first 0, 1, 2 ... effects; the least of many rounds.

    In the order of the table, but for pairs of charges, which come last, as they cost more than the others together.
    """
    base, names = flying(), sorted(table_rows(), key=lambda name: name == "pair_coulomb")
    engines = [engine_with(base, names[:k]) for k in range(len(names) + 1)]
    least = np.full(len(engines), np.inf)
    for _ in range(rounds):
        for k, engine in enumerate(engines):
            start = time.process_time()
            engine.step(steps)
            least[k] = min(least[k], 1e6 * (time.process_time() - start) / (steps * CHARTED))
    return names, least.tolist()


def chart(path: Path) -> int:
    """Draws the time of a step as effects are added, and prints it."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    names, times = measure()
    labels = ["no effect", *(f"+ {name}" for name in names)]
    added = np.diff(times, prepend=times[0])
    for label, total, more in zip(labels, times, added, strict=True):
        print(f"{label:24}{total:8.3f} us per grain and step{more:+8.3f}")
    figure, axes = pyplot.subplots(figsize=(8.0, 5.0), layout="constrained")
    rows, more = np.arange(len(labels)), np.maximum(added, 0.0)
    axes.barh(rows, times - more, color="#b8c4d0", label="the step without it")
    axes.barh(rows, more, left=times - more, color="#c2571a", label="what the effect adds")
    axes.set_yticks(rows, labels)
    axes.invert_yaxis()
    axes.set_xlabel(
        f"processor time of a step, \N{MICRO SIGN}s per grain ({CHARTED} grains in flight, a quarter flakes)"
    )
    axes.set_title("A step as effects are added one by one")
    axes.legend(loc="upper right")
    axes.grid(axis="x", color="#dddddd")
    axes.set_axisbelow(True)
    figure.savefig(path, dpi=120)
    print(f"wrote {path}")
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    counted = commands.add_parser("count", help="instructions of a step with an effect off, and without its row")
    counted.add_argument("effects", nargs="*", metavar="EFFECT", help="default: each of the table")
    drawn = commands.add_parser("chart", help="time of a step as the effects are added")
    drawn.add_argument("path", nargs="?", type=Path, default=PICTURE, metavar="FILE.png")
    arguments = parser.parse_args()
    return count(arguments.effects) if arguments.command == "count" else chart(arguments.path)


if __name__ == "__main__":
    sys.exit(main())
