"""Run a scene to an end: progress bar, result file, Ctrl-C."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import platform
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .accuracy.converged import Converged, Watch
from .accuracy.rules import PRESETS, Preset, limit, preset
from .arguments import seconds, whole
from .errors import InputError, SimulationError, show
from .result import Run
from .simulation import Simulation

if TYPE_CHECKING:
    from .scene import Scene

DEFAULT_UNTIL = "4 s"
OUTPUT_EVERY = 0.01  # s of simulated time between rows of /health, unless frames say otherwise
FLUSH_EVERY = 2.0  # s of wall time
RESTART_EVERY = 30.0  # s of wall time between restart files of a run that is saved


@dataclass(frozen=True)
class Fed:
    """Run until so many grains were fed."""

    count: int

    def __post_init__(self) -> None:
        whole("Fed.count", self.count, 1, 10**12)


@dataclass(frozen=True)
class Frames:
    """Which positions a run keeps.

    Parameters
    ----------
    every : text with a unit, or s
        Simulated time between frames.
    most : int or None
        Grains followed at a time: when one lands, one that was just fed takes its place. None: all grains.
    """

    every: float | str = "10 ms"
    most: int | None = 64

    def __post_init__(self) -> None:
        if seconds(self.every, "frames.every") <= 0:
            raise InputError("is 0 s, must be longer", path="frames.every", value=self.every, unit="s")
        if self.most is not None:
            whole("frames.most", self.most, 0, 10**9)


def run(
    scene: Scene,
    seed: int = 1,
    *,
    threads: int | None = None,
    save: str | os.PathLike[str] | None = None,
    until: float | str | Fed | Converged = DEFAULT_UNTIL,
    accuracy: Preset | None = None,
    progress: bool = True,
    frames: Frames | None = Frames(),
) -> Run:
    """Run a scene and report what landed where.

    Parameters
    ----------
    scene : Scene
    seed : int
        The same seed gives the same stream and, on one type of machine, the same bits.
    threads : int, optional
        Default: those of the scene; else one for a thin feed, the processors this process may use for a dense one.
    save : path, optional
        Result file. It is ``save.part`` while the run lasts, and readable all the time; a file of that name from an
        earlier run is replaced when this one has ended. ``save.restart`` holds the newest restart state meanwhile.
    until : text with a unit, s, Fed(n), or Converged("recovery[copper]", halfwidth=0.01)
    accuracy : "draft", "standard", "fine" or None
        Step and solver by the rules of `cesim.recommend`, for an error of mean landing x of 4, 1.5 or 0.4 mm. On the
        sphere machine they were measured to have 0.83, 0.36 and 0.08 mm of ABS (docs/accuracy.md). None: what the
        scene says.
    progress : bool
        Show a progress bar, where stderr is a terminal or a notebook.
    frames : Frames or None
        Positions to keep for pictures; None keeps none.

    Returns
    -------
    Run
        After Ctrl-C too: with what was computed until then, and ``run.complete`` False.
    """
    goal = until if isinstance(until, Fed | Converged) else seconds(until)
    if frames is not None and not isinstance(frames, Frames):
        raise InputError(f"is {show(frames)}, must be cesim.Frames(...) or None", path="frames", value=frames)
    path = None if save is None else Path(save)
    if path is not None and path.is_dir():
        raise InputError("is a folder, must be a file", path=str(path))
    chosen = None if accuracy is None else preset(scene, accuracy)
    scene = scene if chosen is None else chosen.apply(scene)
    sim = Simulation(scene, seed, threads)
    if isinstance(goal, Fed) and sim.definition["feed"] is None:
        raise InputError("counts fed grains, but the scene has no feed", path="until")
    texts = texts_of(scene, sim)
    if isinstance(goal, Converged):
        goal.refuse(json.loads(texts["resolved"]))
    about: dict[str, Any] = {"longest_step": limit(scene).step}
    if accuracy is not None:
        about |= {"accuracy": accuracy, "accuracy_error": PRESETS[accuracy]}
    return drive(sim, goal, path=path, progress=progress, frames=frames, texts=texts, about=header(sim, until) | about)


def texts_of(scene: Scene, sim: Simulation) -> dict[str, str]:
    """What /scene holds: the scene as written, as the engine was given it, the effects and what to cite."""
    from .citations import citations
    from .scene.composites import contents
    from .scene.field import drawn_electrodes

    effects = [dataclasses.asdict(row) for row in scene.effects().rows]
    record = {name: value for name, value in scene.field.record(scene).items() if name != "values"}
    field = sim.definition["field"]
    resolved = sim.definition | {
        "field": None if field is None else {name: value for name, value in field.items() if name != "values"} | record,
        "electrodes": drawn_electrodes(scene),
        "name": scene.name,
        "material_names": sim.material_names,
        "contents": contents(scene),
        "collect": None if scene.collect is None else scene.collect.model_dump() | {"splitters": splitters_of(scene)},
    }
    return {
        "toml": sim.toml,
        "resolved": json.dumps(resolved, default=_plain),
        "effects": json.dumps(effects, default=_plain),
        "citations": json.dumps(citations(sim.definition, scene.field.kind)),
    }


def splitters_of(scene: Scene) -> tuple[float, float] | None:
    """x of two splitters on the landing plane, m from the datum: the virtual ones, or blades prolonged downwards."""
    if scene.collect is None or scene.collect.splitters is not None:
        return None if scene.collect is None else scene.collect.splitters
    if len(scene.splitters) != 2:
        return None
    left, right = sorted(
        blade.tip[0] + math.tan(blade.tilt) * (blade.tip[1] - scene.collect.y) - scene.collect.datum
        for blade in scene.splitters
    )
    return left, right


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else str(value)


def header(sim: Simulation, until: Any) -> dict[str, Any]:
    """Attributes of the file that do not change."""
    from . import __version__
    from .files import state_digest

    goal = {}
    if isinstance(until, Converged):
        goal = {"goal_quantity": until.quantity, "goal_halfwidth": until.target, "goal_level": float(until.level)}
    return goal | {
        "version": __version__,
        "seed": np.uint64(sim.seed),
        "threads": sim.threads,
        "step": sim.step_size,
        "until": str(until),
        "scene_hash": state_digest(sim.toml, 0, {}).decode(),
        "build": f"python {platform.python_version()}, numpy {np.__version__}, {platform.machine()}",
        "host": f"{platform.system()}, {os.cpu_count()} processors",
    }


def drive(
    sim: Simulation,
    goal: float | Fed | Converged,
    *,
    path: Path | None,
    progress: bool,
    frames: Frames | None,
    texts: Mapping[str, str],
    about: Mapping[str, Any],
) -> Run:
    """The loop: step, record, show."""
    from .files import write_restart
    from .recorder import Recorder

    every = OUTPUT_EVERY if frames is None else seconds(frames.every)
    batch = max(1, round(every / sim.step_size))
    recorder = Recorder(path, sim, about, texts)
    restart = None if path is None else path.with_name(path.name + ".restart")
    follow = Follow(frames)
    watch = Watch(goal) if isinstance(goal, Converged) else None
    started = flushed = saved = time.perf_counter()
    complete = False
    try:
        with Interrupt() as interrupt, Bar(sim, goal, progress) as bar:
            try:
                while steps_left(sim, goal) > 0:
                    with interrupt.at_once():
                        sim.step(min(batch, steps_left(sim, goal)))
                    recorder.record_health()
                    if frames is not None:
                        recorder.record_frame(follow.rows(sim.ids))
                    now = time.perf_counter()
                    if watch is not None and watch.is_due(sim.time) and watch.is_satisfied(recorder.result()):
                        complete = True
                        break
                    if now - flushed > FLUSH_EVERY:
                        recorder.record_landings()
                        recorder.flush()
                        flushed = time.perf_counter()
                    if restart is not None and now - saved > RESTART_EVERY:
                        write_restart(restart, sim.toml, sim.seed, sim.engine.state())
                        saved = time.perf_counter()
                    bar.update()
                complete = True
            except KeyboardInterrupt:
                print("cesim: stopped; what was computed is kept", file=sys.stderr)
            file = recorder.finish(complete=complete, wall_time=time.perf_counter() - started)
    except BaseException as error:
        recorder.abandon()
        if recorder.part is not None and isinstance(error, SimulationError):
            error.args = (f"{error}; what was computed until then is in {recorder.part}",)
        raise
    if restart is not None:
        restart.unlink(missing_ok=True)
    return Run.load(path) if path is not None else Run.from_file(file)


def steps_left(sim: Simulation, goal: float | Fed | Converged) -> int:
    """Steps to the end at most: 0 at it."""
    if isinstance(goal, Fed):
        return 0 if sim.balance.fed.count >= goal.count else sys.maxsize
    return sim.steps_to(goal.end if isinstance(goal, Converged) else goal)


class Interrupt:
    """Lets Ctrl-C end a step at once, but wait while something is recorded; a second Ctrl-C never waits.

    Outside the main thread, and where somebody else handles the signal, everything stays as it is.
    """

    running: ClassVar[list[Interrupt]] = []  # innermost last

    def __init__(self) -> None:
        self.asked = self.now = self.installed = False

    def __enter__(self) -> Interrupt:
        self.running.append(self)
        main = threading.current_thread() is threading.main_thread()
        if main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self.handle)
            self.installed = True
        return self

    def __exit__(self, *_: object) -> None:
        self.running.remove(self)
        if self.installed:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def handle(self, number: int, frame: FrameType | None) -> None:
        """The signal handler.

        An exception that is raised while Python clears up after an object is lost; `asked` brings it back.
        """
        again, self.asked = self.asked, True
        if self.now or again:
            raise KeyboardInterrupt

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Ctrl-C inside raises KeyboardInterrupt, as does one that has been waiting."""
        self.now = True
        try:
            if self.asked:
                raise KeyboardInterrupt
            yield
        finally:
            self.now = False


class Follow:
    """Chooses the grains that frames follow."""

    def __init__(self, frames: Frames | None) -> None:
        self.most = None if frames is None else frames.most
        self.ids: NDArray[np.int64] = np.empty(0, np.int64)
        self.seen = -1

    def rows(self, ids: NDArray[np.int64]) -> NDArray[np.intp]:
        """Rows to record, given the ids of all rows (rising)."""
        if self.most is None:
            return np.arange(len(ids))
        self.ids = self.ids[np.isin(self.ids, ids, assume_unique=True)]
        born = ids[ids > self.seen]
        room = self.most - len(self.ids)
        # Spread over the newborn, so that no corner of the outlet is preferred; a quarter of the room at a time, so
        # that the grains followed are not all of one age.
        take = min(len(born), max(room // 4, 1) if room > 0 else 0)
        if take > 0:
            self.ids = np.concatenate([self.ids, born[np.linspace(0, len(born) - 1, take).astype(int)]])
        if len(ids):
            self.seen = max(self.seen, int(ids[-1]))
        return np.searchsorted(ids, self.ids)


class Bar:
    """A progress bar over simulated time or fed grains; silent where nobody watches."""

    def __init__(self, sim: Simulation, goal: float | Fed | Converged, progress: bool) -> None:
        self.sim, self.goal = sim, goal
        self.shown = progress and (sys.stderr.isatty() or "ipykernel" in sys.modules)
        self.bar: Any = None

    def __enter__(self) -> Bar:
        if self.shown:
            from tqdm import tqdm

            fed = isinstance(self.goal, Fed)
            form = "{desc} {percentage:3.0f} %|{bar}| {n:.4g}/{total:.4g}{unit} [{elapsed}<{remaining}{postfix}]"
            goal = self.goal.end if isinstance(self.goal, Converged) else self.goal
            total = goal.count if isinstance(goal, Fed) else goal
            self.bar = tqdm(total=total, unit=" fed" if fed else " s", bar_format=form, desc="cesim", leave=False)
            self.start, self.began = self.sim.time, time.perf_counter()
        return self

    def update(self) -> None:
        """Show where the run is."""
        if self.bar is None:
            return
        fed = self.sim.balance.fed.count
        self.bar.n = min(fed if isinstance(self.goal, Fed) else self.sim.time, self.bar.total)
        rate = (time.perf_counter() - self.began) / max(self.sim.time - self.start, 1e-12)
        self.bar.set_postfix_str(
            f"{self.sim.count} grains inside, {fed} fed, {rate:.2g} s per simulated s", refresh=False
        )
        self.bar.update(0)

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()
