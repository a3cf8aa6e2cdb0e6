"""Put each deliberate fault into a copy of the tree, build it, and see the test that must notice it fail.

python tests/faults/run.py                       all faults; prints a table in Markdown
python tests/faults/run.py --only friction       those whose description contains a word
python tests/faults/run.py --write docs/faults.md

It takes some minutes. It exits with 1 if a fault goes unnoticed, or a test fails without one.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

import numpy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from table import FAULTS, ROOT, Fault

FLAGS = ["-std=c17", "-O1", "-fPIC", "-fwrapv", "-DNDEBUG", "-ffp-contract=off", "-fvisibility=hidden", "-pthread"]

HEAD = """\
# Deliberate faults

Tests are there to fail. Each row is a fault that was put into a copy of the sources, which was then built; the test in
the second column passes without it and fails with it. `python tests/faults/run.py` does it again and prints this table.

| fault | in | noticed by |
|---|---|---|"""


def compiler() -> list[str]:
    """Compiler and flags: the optimisation is low, as every fault is built."""
    flags = list(FLAGS)
    if (
        subprocess.run(["cc", "-fopenmp", "-E", "-"], input="", capture_output=True, text=True, check=False).returncode
        == 0
    ):
        flags.append("-fopenmp")
    return ["cc", *flags, "-I" + sysconfig.get_path("include"), "-isystem", numpy.get_include()]


def build(tree: Path, sources: list[Path]) -> None:
    """Compile these sources of the tree, and link all."""
    command, objects = compiler(), tree / "objects"
    objects.mkdir(exist_ok=True)
    waiting = []
    for source in sources:
        target = objects / (source.relative_to(tree).as_posix().replace("/", "_") + ".o")
        waiting.append(subprocess.Popen([*command, "-c", str(source), "-o", str(target)]))
        if len(waiting) >= 2 * (os.cpu_count() or 1):
            finish(waiting)
    finish(waiting)
    target = tree / "cesim" / f"engine{sysconfig.get_config_var('EXT_SUFFIX')}"
    subprocess.run([*command, "-shared", *map(str, sorted(objects.glob("*.o"))), "-o", str(target), "-lm"], check=True)


def finish(waiting: list[subprocess.Popen[bytes]]) -> None:
    """Wait for compilers; all must have succeeded."""
    for process in waiting:
        if process.wait() != 0:
            raise SystemExit(f"does not compile: {' '.join(map(str, process.args))}")
    waiting.clear()


def touched(tree: Path, file: str) -> list[Path]:
    """The C sources that see a file: itself, or whoever includes it."""
    if file.endswith(".c"):
        return [tree / file]
    sources = sorted((tree / "csrc").rglob("*.c"))
    return sources if file.endswith(".h") else []


def passes(tree: Path, test: str) -> bool:
    """Whether a test passes in the tree. One that is not there is an error."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", test]
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or not re.search(r"\d+ (passed|failed|error)", done.stdout):
        raise SystemExit(f"{test} did not run:\n{done.stdout}\n{done.stderr}")
    return done.returncode == 0


def noticed(tree: Path, fault: Fault) -> bool:
    """Whether the fault's test fails with it."""
    place = tree / fault.file
    sound = place.read_text(encoding="utf-8")
    place.write_text(fault.applied(sound), encoding="utf-8")
    try:
        sources = touched(tree, fault.file)
        if sources:
            build(tree, sources)
        return not passes(tree, fault.test)
    finally:
        place.write_text(sound, encoding="utf-8")
        if sources:
            build(tree, sources)


def copy_to(tree: Path) -> None:
    """The files that git knows, as they are now."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    for name in filter(
        None, subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    ):
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, tree / name)


def row(fault: Fault) -> str:
    """A row of the table."""
    test = re.sub(r"^tests/stability/test_hard_cases.py::.*\[(.*)\]$", r"hard case \1", fault.test)
    return f"| {fault.what} | `{fault.file}` | {test} |"


def main() -> int:
    """See the top of this file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="a part of the description")
    parser.add_argument("--write", metavar="FILE", help="write the table there, too")
    options = parser.parse_args()
    chosen = [fault for fault in FAULTS if options.only in fault.what]
    for fault in chosen:  # before anything is built
        fault.applied((ROOT / fault.file).read_text(encoding="utf-8"))
    lines, failures = [HEAD], []
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        copy_to(tree)
        build(tree, sorted((tree / "csrc").rglob("*.c")))
        for test in dict.fromkeys(fault.test for fault in chosen):
            if not passes(tree, test):
                failures.append(f"{test} fails without a fault")
        print(HEAD, flush=True)
        for fault in chosen:
            if not noticed(tree, fault):
                failures.append(f"unnoticed by {fault.test}: {fault.what}")
                print(f"UNNOTICED: {fault.what}", flush=True)
                continue
            lines.append(row(fault))
            print(lines[-1], flush=True)
    if options.write:
        Path(options.write).write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(failures) or f"{len(chosen)} faults, all noticed", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
