"""What this machine has, and whether the engine works on it."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import subprocess
import time

LIBRARIES = ("numpy", "scipy", "h5py", "matplotlib", "pandas", "pydantic", "pint", "tqdm")


def report() -> str:
    """One line per finding."""
    from . import __version__, engine

    build = engine.build_info()
    lines = [
        ("cesim", f"{__version__}, engine {engine.__file__}"),
        ("python", f"{platform.python_version()} on {platform.platform()}"),
        ("libraries", ", ".join(f"{name} {version(name)}" for name in LIBRARIES)),
        ("processors", f"{os.cpu_count()}, of which this process may use {usable()}"),
        ("compiler", compiler()),
        ("engine", f"{build['compiler']}, OpenMP {build['openmp'] or 'missing: one thread only'}"),
        *trial(),
    ]
    return "\n".join(f"{name:<11} {text}" for name, text in lines)


def version(library: str) -> str:
    """Version of an installed library."""
    try:
        return importlib.metadata.version(library)
    except importlib.metadata.PackageNotFoundError:
        return "missing"


def usable() -> int:
    """Processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def compiler() -> str:
    """The C compiler that building from source would use."""
    path = next(filter(None, (shutil.which(name) for name in (os.environ.get("CC", "cc"), "gcc", "clang"))), None)
    if path is None:
        return "none found (needed only to build from source)"
    answer = subprocess.run([path, "--version"], capture_output=True, text=True, check=False, timeout=20)
    return answer.stdout.splitlines()[0] if answer.stdout else path


def trial() -> list[tuple[str, str]]:
    """Runs the reference machine for a moment, with one and with two threads, and compares the bits."""
    from . import scenes
    from .simulation import Simulation

    lines, hashes = [], set()
    for threads in (1, 2):
        sim = Simulation(scenes.reference_machine("spheres"), seed=1, threads=threads)
        start = time.perf_counter()
        sim.step(200)
        lines.append((f"{threads} thread{'s' * (threads > 1)}", f"{5 * (time.perf_counter() - start):.2g} ms a step"))
        hashes.add(sim.state_hash())
    lines.append(("same bits", "yes" if len(hashes) == 1 else "NO: please report this"))
    return lines
