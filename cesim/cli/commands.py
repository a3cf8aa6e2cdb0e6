"""What each command does; gives its exit code."""

from __future__ import annotations

import argparse
import signal
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from .settings import factors, run_of, scene_of

if TYPE_CHECKING:
    from ..fields import ElectricField


def run_command(options: argparse.Namespace) -> int:
    """`cesim run`."""
    from ..runner import DEFAULT_UNTIL, Interrupt, run

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
    from ..accuracy import accuracy_report
    from ..errors import InputError

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
    from ..errors import InputError

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
    from ..errors import InputError

    run = run_of(options.scene)
    if run is not None and options.set:
        raise InputError("cannot change what was run", path="--set", value=options.set)
    what = run.scene if run is not None else scene_of(options.scene, options.set)
    if options.audit:
        from ..effects import audit

        result = audit(run or what, grains=options.grains, seed=options.seed, amplify=factors(options.amplify))
        print(result)
        if options.save is not None:
            result.save(options.save)
        return 1 if result.wrong else 0
    for name, given in (("--save", options.save), ("--amplify", options.amplify)):
        if given:
            raise InputError("goes with --audit", path=name, value=given)
    print(what.effects.measure() if options.measure else run.decisions if run is not None else what.effects())
    return 0


def bins_command(options: argparse.Namespace) -> int:
    """`cesim bins`."""
    from ..result import Run

    bins = Run.load(options.file).bins(options.n, x=quantities(options.x), datum=quantity(options.datum))
    print(bins.to_pandas().to_csv(index=False).rstrip() if options.csv else bins)
    return 0


def field_command(options: argparse.Namespace) -> int:
    """`cesim field`."""
    from ..errors import InputError, percent
    from ..fields.compare import field_map
    from ..scene.field import read_model
    from ..units import to_si

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
    from ..field_plots import SPACING, compare_on_drum, draw_field, machine_window

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
    from ..result import Run

    path = Path(options.output) if options.output else Path(options.file).with_suffix(".png")
    Run.load(options.file).plot(path)
    print(path)
    return 0


def info_command(options: argparse.Namespace) -> int:
    """`cesim info`."""
    from ..result import Run

    run = Run.load(options.file)
    print(run)
    names = ("version", "until", "complete", "build", "host")
    print("\n" + "\n".join(f"{name:<13} {run.attrs[name]}" for name in names if name in run.attrs))
    print(f"{'frames':<13} {len(run.frames['time'])}, {len(run.trajectories())} grains followed")
    print(f"{'effects':<13} {', '.join(row.name for row in run.decisions if row.on)}")
    return 0


def cite_command(options: argparse.Namespace) -> int:
    """`cesim cite`."""
    from ..citations import citations, cite

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
    from ..errors import InputError
    from ..verification import verify

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
    from ..doctor import report

    print(report())
    return 0
