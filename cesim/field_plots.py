"""Pictures of electric fields: strength, equipotentials, field lines over the machine, and where two models differ."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError, percent
from .fields.base import Array, ElectricField
from .fields.compare import ZONE, Comparison, FieldMap, compare, field_map
from .plots import COLORS, DARK, THINNEST_WIRE, draw_scene, electrodes, new_figure
from .scene.field import all_electrodes, drawn_electrodes, ion_source

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .scene import Scene

SPACING = 250  # nodes across the picture
EQUIPOTENTIALS = 20
LINE = "#ff8c1a"  # apart from all colours of the map, and from the white of the equipotentials
LINES = 36  # field lines from each electrode
MOST_DIFFERENCE = 10.0  # per cent, of the colours


def draw_field(scene: Scene, models: dict[str, ElectricField], path: Path | None = None, z: float = 0.0) -> Figure:
    """|E|, equipotentials and field lines over the machine; of two models also where and by how much they differ.

    Parameters
    ----------
    models : name -> field, one or two
    path : where to write the picture; None: on the screen
    z : m, of the plane shown
    """
    two = len(models) == 2
    figure = new_figure((15.0, 4.8) if two else (8.0, 6.4), on_screen=path is None)
    axes: list[Any] = list(figure.subplots(1, 3, width_ratios=(1.25, 1.0, 1.0))) if two else [figure.subplots()]
    name, field = next(iter(models.items()))
    low, high = machine_window(scene)
    whole = field_map(field, low, high, max(high[0] - low[0], high[1] - low[1]) / SPACING, z)
    draw_map(scene, whole, axes[0], name)
    if two:
        first, second = models.values()
        low, high = zone_window(scene)
        spacing = (high[0] - low[0]) / SPACING
        maps = [field_map(model, low, high, spacing, z) for model in (first, second)]
        draw_difference(scene, maps[0], maps[1], axes[1], tuple(models))
        draw_on_drum(compare_on_drum(scene, models), axes[2])
    if path is not None:
        from .files import writing

        with writing(path):
            figure.savefig(path, dpi=150)
    return figure


def compare_on_drum(scene: Scene, models: dict[str, ElectricField]) -> Comparison:
    """The models of a scene on its drum.

    Raises
    ------
    InputError
        Where the scene has no drum.
    """
    source, drum = ion_source(scene), scene.drum
    if drum is None:
        raise InputError("is missing: the field is compared on it", path="drum")
    facing = source.angle if source is not None else next(iter(models.values())).largest_on_circle(drum.radius)[1]
    return compare(models, drum.radius, facing, 0.5 * drum.length)


def machine_window(scene: Scene) -> tuple[tuple[float, float], tuple[float, float]]:
    """Corners of what is shown, m: drum and electrodes with as much around them."""
    circles = [(0.0, 0.0, scene.drum.radius)] if scene.drum is not None else []
    circles += [(*electrode.center(), electrode.radius) for electrode in all_electrodes(scene)]
    low = np.min([(x - r, y - r) for x, y, r in circles], axis=0)
    high = np.max([(x + r, y + r) for x, y, r in circles], axis=0)
    pad = 0.25 * float((high - low).max())
    return (low[0] - pad, low[1] - pad), (high[0] + pad, high[1] + pad)


def zone_window(scene: Scene) -> tuple[tuple[float, float], tuple[float, float]]:
    """Corners of the zone of interest, m: around the gap between the drum and the electrode of the ions."""
    source, drum = ion_source(scene), scene.drum
    if source is None or drum is None:
        return machine_window(scene)
    gap = source.distance - source.radius - drum.radius
    middle = drum.radius + 0.5 * gap
    x, y = middle * math.cos(source.angle), middle * math.sin(source.angle)
    half = max(0.75 * gap + source.radius, 0.4 * drum.radius)
    return (x - half, y - half), (x + half, y + half)


def draw_map(scene: Scene, field: FieldMap, ax: Axes, name: str) -> None:
    """Strength in colour, equipotentials thin, field lines as arrows, the machine above them."""
    x, y = 1e3 * field.x, 1e3 * field.y
    strength = 1e-3 * field.strength  # also inside conductors, which are drawn over it: no bare cells at their edges
    top = float(np.quantile(strength[~field.inside], 0.995))
    colors = ax.pcolormesh(x, y, strength.T, cmap="viridis", vmin=0.0, vmax=top, shading="nearest", zorder=0)
    colors.set_rasterized(True)
    ax.figure.colorbar(colors, ax=ax, label="|E| [kV/m]", extend="max", shrink=0.85)
    volts = np.ma.masked_where(field.inside, 1e-3 * field.potential)
    levels = np.linspace(float(volts.min()), float(volts.max()), EQUIPOTENTIALS + 1)[1:-1]
    if np.all(np.diff(levels) > 0.0):
        ax.contour(x, y, volts.T, levels=levels, colors="white", linewidths=0.5, linestyles="solid", zorder=0.5)
        seeds = 1e3 * seeds_of(scene, field)
        along = np.where(field.inside[..., None], np.nan, field.field)
        if len(seeds):
            lines = ax.streamplot(
                x,
                y,
                along[:, :, 0].T,
                along[:, :, 1].T,
                start_points=seeds,
                color=LINE,
                linewidth=0.7,
                arrowsize=0.7,
                density=20,
                broken_streamlines=False,
            )
            lines.lines.set_zorder(0.7)
    draw_scene(scene, ax)
    ax.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    ax.set_title(f"{name}: |E|, {EQUIPOTENTIALS - 1} equipotentials, field lines", fontsize=10)


def seeds_of(scene: Scene, field: FieldMap) -> Array:
    """Where field lines begin, (n, 2) m: around each electrode, as close as the field there is strong."""
    places = []
    for electrode in all_electrodes(scene):
        angle = np.linspace(0.0, 2.0 * np.pi, 721)
        out = np.column_stack([np.cos(angle), np.sin(angle)])
        step = max(field.x[1] - field.x[0], field.y[1] - field.y[0])
        points = np.array(electrode.center()) + (electrode.radius + 1.5 * step) * out
        i = np.clip(np.rint((points[:, 0] - field.x[0]) / step).astype(int), 0, len(field.x) - 1)
        k = np.clip(np.rint((points[:, 1] - field.y[0]) / step).astype(int), 0, len(field.y) - 1)
        flux = np.concatenate([[0.0], np.cumsum(np.abs((field.field[i, k, :2] * out).sum(axis=1))[1:])])
        if flux[-1] > 0.0:
            chosen = np.interp((np.arange(LINES) + 0.5) / LINES * flux[-1], flux, angle)
            spot = np.column_stack([np.cos(chosen), np.sin(chosen)])
            places.append(np.array(electrode.center()) + (electrode.radius + 1.5 * step) * spot)
    points = np.concatenate([*places, np.empty((0, 2))])
    shown = (points > (field.x[1], field.y[1])).all(axis=1) & (points < (field.x[-2], field.y[-2])).all(axis=1)
    return np.asarray(points[shown])


def draw_difference(scene: Scene, first: FieldMap, second: FieldMap, ax: Axes, names: tuple[str, ...]) -> None:
    """By how much the second field is stronger than the first, in per cent."""
    x, y = 1e3 * first.x, 1e3 * first.y
    inside = first.inside | second.inside
    share = np.ma.masked_where(inside, 100.0 * (second.strength / np.maximum(first.strength, 1e-300) - 1.0))
    colors = ax.pcolormesh(
        x, y, share.T, cmap="RdBu_r", vmin=-MOST_DIFFERENCE, vmax=MOST_DIFFERENCE, shading="nearest", zorder=0
    )
    colors.set_rasterized(True)
    ax.figure.colorbar(colors, ax=ax, label=f"|E| of {names[1]} over {names[0]} [%]", extend="both", shrink=0.85)
    wanted = ax.contour(x, y, share.T, levels=[-7, -5, -3, -1, 1, 3, 5, 7], colors=DARK, linewidths=0.6)
    ax.clabel(wanted, fontsize=7, fmt="%g")
    for center, radius, _ in electrodes({"electrodes": drawn_electrodes(scene)}):
        draw_circle(ax, center, max(radius, THINNEST_WIRE))
    if scene.drum is not None:
        draw_circle(ax, (0.0, 0.0), scene.drum.radius)
    source = ion_source(scene)
    if source is not None and scene.drum is not None:
        for turn in (-ZONE, ZONE):
            way = np.array([math.cos(source.angle + turn), math.sin(source.angle + turn)])
            ends = 1e3 * np.array([scene.drum.radius, source.distance])
            ax.plot(*(ends[:, None] * way).T, color=DARK, linestyle="--", linewidth=0.9)
    ax.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]), xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    ax.set_title(f"difference; dashed: {math.degrees(ZONE):g}° from the line of centres", fontsize=10)


def draw_circle(ax: Axes, center: tuple[float, float], radius: float) -> None:
    """A conductor, in mm."""
    from matplotlib.patches import Circle

    ax.add_patch(Circle((1e3 * center[0], 1e3 * center[1]), 1e3 * radius, facecolor="#d0d4d8", edgecolor=DARK))


def draw_on_drum(table: Comparison, ax: Axes) -> None:
    """The normal field on the drum over the angle, by each model."""
    angle = np.degrees(table.angle)
    for name, values, color, style in zip(table.names, table.on_drum, COLORS, ("-", "--"), strict=False):
        ax.plot(angle, 1e-3 * values, color=color, linestyle=style, linewidth=1.6, label=name)
    ax.axvspan(-math.degrees(ZONE), math.degrees(ZONE), color=DARK, alpha=0.08, lw=0)
    ax.set(xlim=(-120, 120), xlabel="angle from the line of centres [°]", ylabel="normal field on the drum [kV/m]")
    ax.set_title(f"on the drum: ≤ {percent(table.difference())} apart where shaded", fontsize=10)
    ax.legend(fontsize=9)
