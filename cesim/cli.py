"""The command line. An input that cannot be used ends in one line on stderr and exit code 2, never in a traceback."""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from .fields import ElectricField
    from .result import Run
    from .scene import Scene

AddCommand = Callable[[str, Any, str], argparse.ArgumentParser]
DEFAULT_SCENE = "reference_machine"
COMPARE = (
    "another model: its name, a file with a grid, or a table such as "
    """'{kind = "finite_element", dimension = 3, enclosure = {lower = [-0.5, -0.5], upper = [0.5, 0.5]}}'"""
)


class Parser(argparse.ArgumentParser):
    """argparse, with its complaints on one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"cesim: {message} (see {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code: 0, 1 (simulation failed), 2 (input), 130 (Ctrl-C), 143 (terminated)."""
    options = parser().parse_args(arguments)
    try:
        from . import engine
    except ImportError as error:
        print(f"cesim: the engine is not built: {error}", file=sys.stderr)
        return 1
    try:
        return int(options.command(options))
    except engine.InputError as error:
        return fail(error, 2)
    except (engine.SimulationError, MemoryError) as error:
        return fail(error, 1)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # the reader of our output has gone, as in `cesim bins run.h5 | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def fail(error: BaseException, code: int) -> int:
    """One line on stderr."""
    print("cesim: " + " ".join((str(error) or "out of memory").split()), file=sys.stderr)
    return code


def parser() -> Parser:
    """All commands and their options."""
    from . import __version__

    top = Parser(prog="cesim", description="Simulate a corona electrostatic separator.")
    top.add_argument("--version", action="version", version=f"cesim {__version__}")
    commands = top.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, function: Any, text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text)
        sub.set_defaults(command=function)
        return sub

    for add in (commands_that_run, commands_on_scenes, commands_on_results, commands_on_cesim):
        add(command)
    return top


def take_scene(sub: argparse.ArgumentParser, kinds: str = "SCENE.toml|NAME") -> None:
    """The arguments of a command that works on a scene."""
    sub.add_argument("scene", nargs="?", default=DEFAULT_SCENE, metavar=kinds, help="default: %(default)s")
    settings = 'such as --set drum.speed="60 rpm"; repeatable'
    sub.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help=settings)


def commands_that_run(command: AddCommand) -> None:
    """Commands that simulate what a user waits for."""
    run = command("run", run_command, "Run a scene; write run.h5 and run.png, print grade, recovery and health.")
    take_scene(run)
    run.add_argument("--until", metavar="TIME", help='simulated time, such as "4 s"')
    run.add_argument("--seed", type=int, default=1, help="default: 1")
    run.add_argument(
        "--threads",
        type=int,
        help="default: the scene's; else one for a thin feed, all processors this process may use for a dense one",
    )
    run.add_argument("--save", metavar="FILE", help="result file; default: run.h5, or run-2.h5, ... where that exists")
    run.add_argument("--figure", metavar="FILE", help="picture; default: the result file's name with .png")
    run.add_argument("--force", action="store_true", help="replace files of the names given by --save and --figure")
    run.add_argument("--no-figure", action="store_true", help="draw no picture")
    run.add_argument("--no-progress", action="store_true", help="show no progress bar")
    run.add_argument(
        "--accuracy", choices=("draft", "standard", "fine"), help="step by rule, for 4, 1.5 or 0.4 mm of landing x"
    )

    accuracy = command("accuracy", accuracy_command, "Measure what accuracy costs: error against time for each knob.")
    take_scene(accuracy, "SCENE.toml|NAME|FILE.h5")
    accuracy.add_argument("-q", "--quantity", default="", help='such as "recovery[copper]" or "mean_x[ABS]"')
    accuracy.add_argument(
        "--budget", default="2 min", metavar="TIME", help="wall time to spend, about; default: %(default)s"
    )
    accuracy.add_argument("--vary", nargs="+", metavar="KNOB", help="default: all that the scene has")
    accuracy.add_argument("--until", metavar="TIME", help="simulated time of each run, in place of the budget's")
    accuracy.add_argument("--seed", type=int, default=1, help="default: 1")
    accuracy.add_argument("--max-error", metavar="ERROR", help="recommend settings for it, such as 0.01 or '1 mm'")
    accuracy.add_argument("--save", metavar="FILE", default="accuracy.h5", help="default: %(default)s")
    accuracy.add_argument("--figure", metavar="FILE", help="picture; default: the file's name with .png")
    accuracy.add_argument("--no-progress", action="store_true", help="show no progress bar")


def commands_on_scenes(command: AddCommand) -> None:
    """Commands that say what a scene is before it runs."""
    check = command("check", check_command, "Check a scene: schema, units, ranges, and doubtful physics.")
    take_scene(check)
    effects = command("effects", effects_command, "Show which effects a scene calls for, and why.")
    take_scene(effects, "SCENE.toml|NAME|RUN.h5")
    effects.add_argument("--measure", action="store_true", help="measure the share of the run time of each")
    effects.add_argument(
        "--audit", action="store_true", help="switch each over on a sample of the feed; 1 if a decision was wrong"
    )
    effects.add_argument("--grains", type=int, default=2000, help="size of the audit's sample; default: %(default)s")
    effects.add_argument("--seed", type=int, help="default: the run's, or 1")
    effects.add_argument("--save", metavar="FILE", help="write the audit as JSON, or as HDF5 for a name with .h5")

    field = command("field", field_command, "Draw the field over the machine; compare two models of it on the drum.")
    take_scene(field)
    field.add_argument("--compare", metavar="MODEL", help=COMPARE)
    field.add_argument("--z", default="0 m", help="plane that is drawn, along the drum from its middle; default: 0")
    field.add_argument("-o", "--output", metavar="FILE", help="picture; default: field.png")
    field.add_argument("--no-figure", action="store_true", help="draw no picture")
    field.add_argument("--csv", metavar="FILE", help="write the field on the drum, degree by degree")
    field.add_argument("--hdf5", metavar="FILE", help="write field and potential over the machine, as shown")


def commands_on_results(command: AddCommand) -> None:
    """Commands that read what a run has written."""
    bins = command("bins", bins_command, "Print the mass landed per bin, with intervals.")
    bins.add_argument("file", metavar="RUN.h5")
    bins.add_argument("-n", type=int, help="number of bins; default: the scene's")
    bins.add_argument("--x", nargs=2, metavar=("FROM", "TO"), help='range, such as --x "0 mm" "200 mm"')
    bins.add_argument("--datum", help="x that the range counts from")
    bins.add_argument("--csv", action="store_true", help="comma-separated values in SI units")

    plot = command("plot", plot_command, "Draw machine, trajectories and landing histogram of a run.")
    plot.add_argument("file", metavar="RUN.h5")
    plot.add_argument("-o", "--output", metavar="FILE", help="default: the result file's name with .png")

    info = command("info", info_command, "Print what a result file holds.")
    info.add_argument("file", metavar="RUN.h5")
    cite = command("cite", cite_command, "List what to cite for a run or a scene.")
    cite.add_argument("what", nargs="?", default=DEFAULT_SCENE, metavar="RUN.h5|SCENE.toml|NAME")


def commands_on_cesim(command: AddCommand) -> None:
    """Commands about this installation."""
    verify = command(
        "verify", verify_command, "Measure the hard cases on this machine, beside their bounds and sources."
    )
    verify.add_argument("ids", nargs="*", metavar="ID", help="cases, such as 04 22; default: all of the size")
    verify.add_argument("--full", action="store_true", help="the sizes of the documentation, which take minutes")
    verify.add_argument("--markdown", metavar="FILE", help="write the table as a page of documentation")
    verify.add_argument("--json", metavar="FILE", help="write the table as data")
    command("doctor", doctor_command, "Show versions, processors, compiler and OpenMP; try the engine.")


# ---- scenes ----------------------------------------------------------------------------------------------------------


def scene_of(name: str, settings: Sequence[str]) -> Scene:
    """A named scene, or one from a file, with settings applied."""
    from . import scenes
    from .errors import unknown
    from .scene import load

    if name in scenes.NAMES:
        scene = scenes.NAMES[name]()
    elif name.endswith(".h5") and Path(name).exists():
        scene = scene_in(Path(name))
    elif name.endswith(".toml") or Path(name).exists():
        scene = load(name)
    else:
        raise unknown("scene", name, scenes.NAMES)
    for setting in settings:
        apply(scene, setting)
    return scene


def scene_in(path: Path) -> Scene:
    """The scene of a result file or of an accuracy report."""
    from .accuracy import Report
    from .errors import InputError
    from .result import Run
    from .scene import Scene

    try:
        return Scene.from_toml(Report.load(path).toml)
    except InputError:
        return Run.load(path).scene


def apply(scene: Scene, setting: str) -> None:
    """Apply "drum.speed=60 rpm" or "plates[0].slope=6 deg"; null takes a part away, other values are as in JSON."""
    from .errors import InputError, show, unknown

    key, equals, text = setting.partition("=")
    steps = re.findall(r"[^.\[\]]+", key.strip())
    if not equals or not steps:
        raise InputError(f"is {show(setting)}, must be KEY=VALUE", path="--set", value=setting)
    try:
        value = json.loads(text)
    except ValueError:
        value = text.strip()
    branch: Any = scene
    for step in steps[:-1]:
        branch = member(branch, step, key)
    last = steps[-1]
    if isinstance(branch, list):
        member(branch, last, key)
        branch[int(last)] = value
    elif hasattr(branch, "__setitem__"):
        branch[last] = value
    elif hasattr(type(branch), "model_fields"):
        setattr(branch, last, value)
    else:
        raise unknown("key", last, [])


def member(branch: Any, step: str, key: str) -> Any:
    """One step down a scene tree."""
    from .errors import InputError, unknown

    if isinstance(branch, list):
        if not step.isdigit() or int(step) >= len(branch):
            raise InputError(f"is not there: {key!r} needs an index below {len(branch)}", path=f"[{step}]")
        return branch[int(step)]
    if hasattr(branch, "__getitem__"):
        if step not in branch:
            raise unknown("key", step, branch)
        return branch[step]
    fields = getattr(type(branch), "model_fields", {})
    names = [field.alias or name for name, field in fields.items()]
    if step not in names:
        raise unknown("key", step, names)
    below = getattr(branch, step)
    if below is None:
        raise InputError("is not in this scene", path=step)
    return below


# ---- commands --------------------------------------------------------------------------------------------------------


def run_command(options: argparse.Namespace) -> int:
    """`cesim run`."""
    from .runner import DEFAULT_UNTIL, Interrupt, run

    scene = scene_of(options.scene, options.set)
    save, figure = targets(options)
    terminated = False

    def terminate(number: int, frame: FrameType | None) -> None:
        nonlocal terminated
        terminated = True
        if Interrupt.running:  # with care for what is being written
            Interrupt.running[-1].handle(number, frame)
        else:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, terminate)
    try:
        result = run(
            scene,
            options.seed,
            threads=options.threads,
            save=save,
            accuracy=options.accuracy,
            until=DEFAULT_UNTIL if options.until is None else quantity(options.until) or 0.0,
            progress=not options.no_progress,
        )
        print(result)
        if figure is not None:
            result.plot(figure)
        print(f"written       {save}" + (f", {figure}" if figure is not None else ""))
    finally:
        signal.signal(signal.SIGTERM, before)
    return 0 if result.complete else 143 if terminated else 130


def accuracy_command(options: argparse.Namespace) -> int:
    """`cesim accuracy`."""
    from .accuracy import accuracy_report
    from .errors import InputError

    save = Path(options.save)
    if not save.parent.is_dir():
        raise InputError("is not a folder", path=str(save.parent))
    figure = Path(options.figure) if options.figure else save.with_suffix(".png")
    report = accuracy_report(
        scene_of(options.scene, options.set),
        options.quantity,
        quantity(options.budget) or 0.0,
        options.vary,
        until=quantity(options.until),
        seed=options.seed,
        progress=not options.no_progress,
    )
    report.save(save)
    report.plot(figure)
    print(str(report).replace("REPORT.h5", str(save)))
    if options.max_error is not None:
        print(f"for {options.max_error}: {report.recommend(quantity(options.max_error) or 0.0)}")
    print(f"written       {save}, {figure}")
    return 0


def targets(options: argparse.Namespace) -> tuple[Path, Path | None]:
    """Names of result file and picture: names that were asked for are not taken from another file without --force."""
    from .errors import InputError

    save = Path(options.save) if options.save else Path("run.h5")
    number = 2
    while not options.save and (save.exists() or (not options.no_figure and save.with_suffix(".png").exists())):
        save, number = Path(f"run-{number}.h5"), number + 1
    figure = None if options.no_figure else Path(options.figure) if options.figure else save.with_suffix(".png")
    for path in (save, figure):
        if path is not None and path.exists() and not options.force:
            raise InputError("exists already; --force replaces it", path=str(path))
        if path is not None and not path.parent.is_dir():
            raise InputError("is not a folder", path=str(path.parent))
    return save, figure


def check_command(options: argparse.Namespace) -> int:
    """`cesim check`."""
    scene = scene_of(options.scene, options.set)
    warnings = scene.check()
    print(warnings if len(warnings) else f"{scene.name}: no warnings")
    return 0


def effects_command(options: argparse.Namespace) -> int:
    """`cesim effects`, of a scene or of the scene in a result file."""
    from .errors import InputError

    run = run_of(options.scene)
    if run is not None and options.set:
        raise InputError("cannot change what was run", path="--set", value=options.set)
    what = run.scene if run is not None else scene_of(options.scene, options.set)
    if options.audit:
        from .effects import audit

        result = audit(run or what, grains=options.grains, seed=options.seed)
        print(result)
        if options.save is not None:
            result.save(options.save)
        return 1 if result.wrong else 0
    if options.save is not None:
        raise InputError("goes with --audit", path="--save", value=options.save)
    print(what.effects.measure() if options.measure else run.decisions if run is not None else what.effects())
    return 0


def run_of(name: str) -> Run | None:
    """The run in a result file; None where the name is that of a scene."""
    from . import scenes
    from .result import Run

    is_run = name not in scenes.NAMES and not name.endswith(".toml") and Path(name).is_file()
    return Run.load(name) if is_run else None


def bins_command(options: argparse.Namespace) -> int:
    """`cesim bins`."""
    from .result import Run

    bins = Run.load(options.file).bins(options.n, x=quantities(options.x), datum=quantity(options.datum))
    print(bins.to_pandas().to_csv(index=False).rstrip() if options.csv else bins)
    return 0


def field_command(options: argparse.Namespace) -> int:
    """`cesim field`."""
    from .errors import InputError, percent
    from .fields.compare import field_map
    from .scene.field import read_model
    from .units import to_si

    scene = scene_of(options.scene, options.set).validated()
    models: dict[str, ElectricField] = {scene.field.kind: scene.electric_field()}
    option = "--compare"
    try:
        if options.compare is not None:
            other = scene.model_copy()
            other.field = read_model(options.compare)
            name: str = other.field.kind
            models[name if name not in models else f"{name} (2)"] = other.electric_field()
        option = "--z"
        z = to_si(quantity(options.z), "m", -10.0, 10.0)
    except InputError as error:
        raise error.at(option) from None
    from .field_plots import SPACING, compare_on_drum, draw_field, machine_window

    if scene.drum is not None or options.compare is not None or options.csv is not None:
        table = compare_on_drum(scene, models)
        print(table)
        if options.csv is not None:
            table.write_csv(options.csv)
    for name, field in models.items():
        for what in ("discretisation_error", "interpolation_error", "boundary_error"):
            if isinstance(value := getattr(field, what, None), float):
                print(f"{what.replace('_', ' ')} of {name}: {percent(value)}")
    if options.hdf5 is not None:
        low, high = machine_window(scene)
        first = next(iter(models.values()))
        field_map(first, low, high, max(high[0] - low[0], high[1] - low[1]) / SPACING, z).write_hdf5(options.hdf5)
    if not options.no_figure:
        path = Path(options.output or "field.png")
        draw_field(scene, models, path, z)
        print(path)
    return 0


def quantity(text: str | None) -> float | str | None:
    """A plain number is in SI units, as everywhere."""
    try:
        return None if text is None else float(text)
    except ValueError:
        return text


def quantities(texts: Sequence[str] | None) -> list[float | str] | None:
    """See `quantity`."""
    return None if texts is None else [quantity(text) or 0.0 for text in texts]


def plot_command(options: argparse.Namespace) -> int:
    """`cesim plot`."""
    from .result import Run

    path = Path(options.output) if options.output else Path(options.file).with_suffix(".png")
    Run.load(options.file).plot(path)
    print(path)
    return 0


def info_command(options: argparse.Namespace) -> int:
    """`cesim info`."""
    from .result import Run

    run = Run.load(options.file)
    print(run)
    names = ("version", "until", "complete", "build", "host")
    print("\n" + "\n".join(f"{name:<13} {run.attrs[name]}" for name in names if name in run.attrs))
    print(f"{'frames':<13} {len(run.frames['time'])}, {len(run.trajectories())} grains followed")
    print(f"{'effects':<13} {', '.join(row.name for row in run.decisions if row.on)}")
    return 0


def cite_command(options: argparse.Namespace) -> int:
    """`cesim cite`."""
    from .citations import citations, cite

    run = run_of(options.what)
    if run is not None:
        lines = cite(run)
    else:
        scene = scene_of(options.what, [])
        lines = citations(scene.definition(), scene.field.kind)
    print("\n".join(lines))
    return 0


def verify_command(options: argparse.Namespace) -> int:
    """`cesim verify`: 1 if a number does not keep its bound."""
    from .errors import InputError
    from .verification import verify

    targets = [Path(name) for name in (options.markdown, options.json) if name is not None]
    for path in targets:
        if not path.parent.is_dir():
            raise InputError("is not a folder", path=str(path.parent))
    report = verify(options.ids or None, full=options.full, show=lambda result: print(result, flush=True))
    print(f"\n{report.summary()}")
    if options.markdown is not None:
        Path(options.markdown).write_text(report.to_markdown(), encoding="utf-8")
    if options.json is not None:
        Path(options.json).write_text(report.to_json(), encoding="utf-8")
    return 0 if report.passed else 1


def doctor_command(options: argparse.Namespace) -> int:
    """`cesim doctor`."""
    from .doctor import report

    print(report())
    return 0
