"""A report as text and as a file."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import writing
from ..statistics import Estimate
from .quantity import Quantity
from .report import Point, Report

FILETYPE = "cesim-accuracy"


def text_of(report: Report) -> str:
    """The table, the split of the error, the Pareto set and the command."""
    scale, unit = (1e3, " mm") if report.quantity.unit == "m" else (1.0, "")
    own = report.own
    best = scale * float(report.best)
    order = "not resolved, taken as 1" if math.isnan(report.order) else f"{report.order:.2f}"
    answer, wide = (
        f"{scale * float(own.answer):.5g} +- {scale * own.answer.halfwidth:.2g}",
        scale * report.best.halfwidth,
    )
    lines = [
        f"{report.quantity.name}: {answer}{unit} (95 %) in {own.wall:.3g} s; best answer {best:.5g} +- {wide:.2g}{unit}"
    ]
    lines += [f"{own.simulated:.4g} s simulated, {report.warmup:.2g} s of warm-up cut; order in the step: {order}", ""]
    numbers = f"{'time [s]':>9} {'sweeps':>9} {'grain-steps':>12} {'error' + unit:>10}"
    lines.append(f"{'knob':<10} {'setting':<22} {numbers}   change{unit}")
    for point in report.points:
        if point.failure:
            lines.append(f"{point.knob:<10} {point.label:<22} {'failed':>9}   {point.failure}")
            continue
        change = (
            f"{scale * float(point.change):+.3g} [{scale * point.change.low:+.3g}, {scale * point.change.high:+.3g}]"
        )
        said = "" if point is own else f"{change} {point.verdict}"
        left = f", {point.unconverged} of {point.steps} steps not converged" if point.unconverged else ""
        lines.append(
            f"{point.knob:<10} {point.label:<22} {point.wall:9.3g} {point.iterations:9d} {point.grain_steps:12d} "
            f"{scale * float(point.error):+10.3g}   {said}{left}"
        )
    lines += ["", "where the error of the scene as it is comes from:"]
    for share in report.split:
        size = f"{scale * abs(share.size):.3g}{unit}"
        if not share.resolved:
            size = f"not resolved, below {scale * max(abs(share.size.low), abs(share.size.high)):.3g}{unit}"
        lines.append(f"  {share.source:<36} {size}")
    front = ", ".join(f"{point.label} ({point.wall:.3g} s)" for point in report.pareto)
    lines += ["", f"Pareto set: {front or 'nothing was resolved'}", f"again: {report.command}"]
    return "\n".join(lines)


POINT = np.dtype(
    [
        *(("knob", "S16"), ("label", "S64"), ("value", "f8"), ("answer", "f8", (4,)), ("error", "f8", (4,))),
        *(("change", "f8", (4,)), ("correlation", "f8"), ("wall", "f8"), ("simulated", "f8"), ("steps", "i8")),
        *(("iterations", "i8"), ("grain_steps", "i8"), ("unconverged", "i8"), ("failure", "S200")),
    ]
)
ESTIMATES, TEXTS = ("answer", "error", "change"), ("knob", "label", "failure")


def tuple_of(estimate: Estimate) -> tuple[float, float, float, float]:
    """As four numbers."""
    return float(estimate), estimate.low, estimate.high, estimate.n_eff


def write_report(report: Report, path: Path) -> None:
    """Write a report as HDF5."""
    import h5py

    rows = np.zeros(len(report.points), POINT)
    for row, point in zip(rows, report.points, strict=True):
        for name, value in asdict(point).items():
            if name in ESTIMATES:
                row[name] = tuple_of(value)
            else:
                row[name] = value.encode() if name in TEXTS else value
    with writing(path), h5py.File(path, "w") as file:
        file.attrs.update({"filetype": FILETYPE, "quantity": report.quantity.name, "order": report.order})
        file.attrs.update({"warmup": report.warmup, "seed": np.uint64(report.seed), "best": tuple_of(report.best)})
        file.attrs["command"] = report.command
        file.create_dataset("scene", data=np.frombuffer(report.toml.encode(), np.uint8))
        file.create_dataset("points", data=rows)
        for i, (step, (error, course)) in enumerate(report.steps.items()):
            table = file.create_dataset(f"steps/{i}", data=course)
            table.attrs.update({"step": step, "error": error})
        finer = [[setting.knob, setting.label] for setting in report.tried if setting.finer]
        file.attrs["finer"] = json.dumps(finer)


def read_report(path: Path) -> Report:
    """Read a report. Its settings are those that the scene in the file gives."""
    import h5py

    from ..scene import Scene
    from .knobs import settings

    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("filetype") != FILETYPE:
                raise InputError("is not an accuracy report", path=str(path))
            attrs = dict(file.attrs)
            toml = bytes(file["scene"][()]).decode()
            rows = file["points"][()]
            steps = {
                float(table.attrs["step"]): (float(table.attrs["error"]), table[()])
                for table in (file["steps"][str(i)] for i in range(len(file["steps"])))
            }
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"cannot be read: {error}", path=str(path)) from None
    if rows.dtype != POINT:
        raise InputError("was written by another version", path=str(path))
    points = []
    for row in rows:
        values = {name: row[name] if name in ESTIMATES else row[name].item() for name in POINT.names or ()}
        values |= {name: Estimate(*map(float, values[name])) for name in ESTIMATES}
        values |= {name: values[name].decode() for name in TEXTS}
        points.append(Point(**values))
    scene = Scene.from_toml(toml)
    labels = {(point.knob, point.label) for point in points}
    return Report(
        quantity=Quantity(str(attrs["quantity"])),
        points=points,
        best=Estimate(*map(float, attrs["best"])),
        order=float(attrs["order"]),
        toml=toml,
        command=str(attrs["command"]),
        warmup=float(attrs["warmup"]),
        seed=int(attrs["seed"]),
        steps=steps,
        tried=[setting for setting in settings(scene, None) if (setting.knob, setting.label) in labels],
    )
