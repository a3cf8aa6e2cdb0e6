"""What can be asked for: the commands of `cesim` and their options."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any, NoReturn

from . import commands as do
from .settings import DEFAULT_SCENE

AddCommand = Callable[[str, Any, str], argparse.ArgumentParser]
COMPARE = (
    "another model: its name, a file with a grid, or a table such as "
    """'{kind = "finite_element", dimension = 3, enclosure = {lower = [-0.5, -0.5], upper = [0.5, 0.5]}}'"""
)


class Parser(argparse.ArgumentParser):
    """argparse, with its complaints on one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"cesim: {message} (see {self.prog} --help)\n")


def parser() -> Parser:
    """All commands and their options."""
    from .. import __version__

    top = Parser(prog="cesim", description="Simulate a corona electrostatic separator.")
    top.add_argument("--version", action="version", version=f"cesim {__version__}")
    subparsers = top.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, function: Any, text: str) -> argparse.ArgumentParser:
        sub = subparsers.add_parser(name, help=text, description=text)
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
    run = command("run", do.run_command, "Run a scene; write run.h5 and run.png, print grade, recovery and health.")
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

    accuracy = command(
        "accuracy", do.accuracy_command, "Measure what accuracy costs: error against time for each knob."
    )
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
    check = command("check", do.check_command, "Check a scene: schema, units, ranges, and doubtful physics.")
    take_scene(check)
    effects = command("effects", do.effects_command, "Show which effects a scene calls for, and why.")
    take_scene(effects, "SCENE.toml|NAME|RUN.h5")
    effects.add_argument("--measure", action="store_true", help="measure the share of the run time of each")
    effects.add_argument(
        "--audit", action="store_true", help="switch each over on a sample of the feed; 1 if a decision was wrong"
    )
    effects.add_argument("--grains", type=int, default=2000, help="size of the audit's sample; default: %(default)s")
    effects.add_argument(
        "--amplify",
        action="append",
        default=[],
        metavar="EFFECT=FACTOR",
        help="audit an effect that is off so many times as strong, and divide the shift by that",
    )
    effects.add_argument("--seed", type=int, help="default: the run's, or 1")
    effects.add_argument("--save", metavar="FILE", help="write the audit as JSON, or as HDF5 for a name with .h5")

    field = command("field", do.field_command, "Draw the field over the machine; compare two models of it on the drum.")
    take_scene(field)
    field.add_argument("--compare", metavar="MODEL", help=COMPARE)
    field.add_argument("--z", default="0 m", help="plane that is drawn, along the drum from its middle; default: 0")
    field.add_argument("-o", "--output", metavar="FILE", help="picture; default: field.png")
    field.add_argument("--no-figure", action="store_true", help="draw no picture")
    field.add_argument("--csv", metavar="FILE", help="write the field on the drum, degree by degree")
    field.add_argument("--hdf5", metavar="FILE", help="write field and potential over the machine, as shown")


def commands_on_results(command: AddCommand) -> None:
    """Commands that read what a run has written."""
    bins = command("bins", do.bins_command, "Print the mass landed per bin, with intervals.")
    bins.add_argument("file", metavar="RUN.h5")
    bins.add_argument("-n", type=int, help="number of bins; default: the scene's")
    bins.add_argument("--x", nargs=2, metavar=("FROM", "TO"), help='range, such as --x "0 mm" "200 mm"')
    bins.add_argument("--datum", help="x that the range counts from")
    bins.add_argument("--csv", action="store_true", help="comma-separated values in SI units")

    plot = command("plot", do.plot_command, "Draw machine, trajectories and landing histogram of a run.")
    plot.add_argument("file", metavar="RUN.h5")
    plot.add_argument("-o", "--output", metavar="FILE", help="default: the result file's name with .png")

    info = command("info", do.info_command, "Print what a result file holds.")
    info.add_argument("file", metavar="RUN.h5")
    cite = command("cite", do.cite_command, "List what to cite for a run or a scene.")
    cite.add_argument("what", nargs="?", default=DEFAULT_SCENE, metavar="RUN.h5|SCENE.toml|NAME")


def commands_on_cesim(command: AddCommand) -> None:
    """Commands about this installation."""
    verify = command(
        "verify", do.verify_command, "Measure the hard cases on this machine, beside their bounds and sources."
    )
    verify.add_argument("ids", nargs="*", metavar="ID", help="cases, such as 04 22; default: all of the size")
    verify.add_argument("--full", action="store_true", help="the sizes of the documentation, which take minutes")
    verify.add_argument("--markdown", metavar="FILE", help="write the table as a page of documentation")
    verify.add_argument("--json", metavar="FILE", help="write the table as data")
    command("doctor", do.doctor_command, "Show versions, processors, compiler and OpenMP; try the engine.")
