"""Pictures: the machine with its trajectories, and what landed where beneath it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .statistics import Bins

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .corona import IonisedField
    from .result import Run
    from .scene import Scene

# Okabe and Ito's palette, told apart with any kind of colour vision; told apart in grey by line style and hatch, too.
COLORS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
HATCHES = ("", "////", "....", "\\\\\\\\", "xxxx", "oo", "++")
STYLES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), "-.", (0, (3, 1, 1, 1, 1, 1)), "--", ":")
STEEL, DARK = "#d0d4d8", "#4a4f55"
THINNEST_WIRE = 0.002  # m, radius in which a thinner wire is drawn
PAPER = {"facecolor": "white", "edgecolor": "none", "alpha": 0.6, "pad": 0.8}  # behind labels
MOST_EDGES = 20_000  # drawn of a mesh
MOST_PATHS = 120  # drawn per material


def draw_bins(bins: Bins, splitters: Sequence[Any] = (), ax: Axes | None = None, *, scale: bool = True) -> Axes:
    """Mass per bin as steps with the interval as a band; splitters as vertical lines.

    Parameters
    ----------
    splitters : positions from the datum, m or text with a unit
    scale : whether to label the axes
    """
    from .result import length

    if ax is None:
        import matplotlib.pyplot as plt

        _, ax = plt.subplots(figsize=(8, 4), layout="constrained")
    edges = 1e3 * bins.edges
    for i, name in enumerate(bins.mass):
        color = COLORS[i % len(COLORS)]
        mass, low, high = (1e3 * table[name] for table in (bins.mass, bins.ci_low, bins.ci_high))
        ax.stairs(mass, edges, color=color, linewidth=1.6, linestyle=STYLES[i % len(STYLES)], label=name)
        ax.stairs(
            mass, edges, fill=True, facecolor=color, alpha=0.18, hatch=HATCHES[i % len(HATCHES)], edgecolor=color, lw=0
        )
        full = np.isfinite(low) & (bins.count[name] > 0)
        ax.vlines(1e3 * bins.centers[full], low[full], high[full], color=color, linewidth=1.0, alpha=0.8)
    for position in splitters:
        ax.axvline(1e3 * length("splitters", position), color=DARK, linestyle="--", linewidth=1.2)
        where = (1e3 * length("splitters", position), 1.0)
        label(
            ax,
            f"{where[0]:.4g} mm",
            where,
            (3, -3),
            ha="left",
            va="top",
            rotation=90,
            xycoords=("data", "axes fraction"),
        )
    ax.set_ylim(bottom=0)
    if scale:
        zero = "" if bins.datum == 0 else f" from {1e3 * bins.datum:g} mm"
        ax.set_xlabel(f"landing position x{zero} [mm]")
        ax.set_ylabel(f"mass per {edges[1] - edges[0]:.3g} mm [g]")
        if bins.mass:
            ax.legend(title=f"bars: {100 * bins.ci:g} % interval" if bins.ci else None, fontsize=9, title_fontsize=8)
    return ax


def draw_run(run: Run, path: Path | None = None, splitters: Sequence[Any] | None = None) -> Figure:
    """The machine with trajectories, and beneath it the landing histogram, over the same x."""
    frame = window(run)
    low, high, floor, ceiling = frame
    tall = min(max(8.0 * (ceiling - floor) / (high - low), 3.0), 9.0)  # inches
    figure = new_figure((9, tall + 3.4), on_screen=path is None)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(tall, 2.6))
    draw_machine(run.definition, top)
    shown = draw_paths(run, top)
    try:
        marks = list(run.default_splitters if splitters is None else splitters)
    except InputError:
        marks = []
    if run.definition["collect"] is not None:
        draw_bins(run.bins(), marks, bottom)
    top.set_ylabel("height y [mm]")
    top.tick_params(labelbottom=False)
    if shown:
        top.legend(loc="lower left", fontsize=9, title=f"paths of {shown} grains", title_fontsize=8)
    top.set_title(f"{run.name}: {run.time:.3g} s, {run.balance.landed.count} grains landed", fontsize=11)
    equal_scales(figure, top, frame)
    if path is not None:
        from .files import writing

        with writing(path):
            figure.savefig(path, dpi=150)
    return figure


def draw_ions(found: IonisedField, ax: Axes | None = None) -> Axes:
    """Field on the drum with and without ions, and their current density, against the angle from the drum's top."""
    if ax is None:
        import matplotlib.pyplot as plt

        _, ax = plt.subplots(figsize=(8, 4), layout="constrained")
    degrees = np.degrees(found.angle)
    twin = ax.twinx()
    lines = [
        *ax.plot(degrees, 1e-3 * found.laplacian_field, color=COLORS[1], linestyle=STYLES[1], label="E without ions"),
        *ax.plot(degrees, 1e-3 * found.field, color=COLORS[1], linewidth=1.8, label="E with ions"),
        *twin.plot(degrees, 1e3 * found.current_density, color=COLORS[0], linewidth=1.8, label="J of the ions"),
    ]
    seen = found.current_density > 1e-3 * found.current_density.max()
    if seen.any():
        ax.set_xlim(degrees[seen].min(), degrees[seen].max())
    ax.set_ylim(bottom=0)
    twin.set_ylim(bottom=0)
    ax.set_xlabel("angle from the drum's top, clockwise [degrees]")
    ax.set_ylabel("field on the drum [kV/m]")
    twin.set_ylabel("current density [mA/m$^2$]")
    ax.legend(handles=lines, fontsize=9)
    ax.set_title(f"{1e3 * found.current:.3g} mA per metre of drum", fontsize=10)
    return ax


def new_figure(size: tuple[float, float], *, on_screen: bool) -> Figure:
    """A figure that pyplot shows, or one that is only for a file."""
    if on_screen:
        import matplotlib.pyplot as plt

        return plt.figure(figsize=size, layout="constrained")
    from matplotlib.figure import Figure

    return Figure(figsize=size, layout="constrained")


def equal_scales(figure: Figure, ax: Axes, frame: tuple[float, float, float, float]) -> None:
    """Show at least a frame (low, high, floor, ceiling) with the same scale in x and y."""
    low, high, floor, ceiling = frame
    ax.set_xlim(low, high)
    ax.set_ylim(floor, ceiling)
    figure.draw_without_rendering()  # now the axes have their size
    figure.set_layout_engine("none")
    box = ax.get_window_extent()
    scale = max((high - low) / box.width, (ceiling - floor) / box.height)
    x, y = (low + high) / 2, (floor + ceiling) / 2
    ax.set_xlim(x - scale * box.width / 2, x + scale * box.width / 2)
    ax.set_ylim(y - scale * box.height / 2, y + scale * box.height / 2)


def window(run: Run) -> tuple[float, float, float, float]:
    """What to show, mm: all of the machine that is near the drum and the landing plane, and where the grains landed."""
    corners = [outline(s) for s in run.definition["surfaces"] if s["shape"] != "plane"]
    corners += [circle(np.asarray(center), radius) for center, radius, _ in electrodes(run.definition)]
    landed = run.landings["position"][:, :2]
    if len(landed):
        corners.append(np.quantile(landed, [0.002, 0.998], axis=0))
    if not corners:
        return -100.0, 100.0, -100.0, 100.0
    points = 1e3 * np.concatenate(corners)
    (low, floor), (high, ceiling) = points.min(axis=0), points.max(axis=0)
    height = run.definition["landing_height"]
    floor = min(floor, 1e3 * height) if np.isfinite(height) else floor
    pad = 0.04 * (high - low)
    return low - pad, high + pad, floor - pad, ceiling + pad


def draw_scene(scene: Scene, ax: Axes) -> None:
    """The machine of a scene with all of its electrodes, as `draw_machine` does of a result."""
    from .scene.field import drawn_electrodes

    draw_machine(scene.definition() | {"electrodes": drawn_electrodes(scene)}, ax)


def draw_machine(definition: dict[str, Any], ax: Axes) -> None:
    """Drum, brush, plates, splitters, meshes, electrodes and landing plane, seen along the drum's axis, in mm."""
    from matplotlib.patches import Polygon

    for surface in definition["surfaces"]:
        if surface["shape"] == "plane":
            continue  # the side walls lie in the plane of the picture
        if surface["shape"] == "mesh":
            draw_mesh(surface, ax)
            continue
        points = 1e3 * outline(surface)
        ax.add_patch(Polygon(points, facecolor=STEEL, edgecolor=DARK, linewidth=1.0, zorder=1))
        cylinder = surface["shape"] == "cylinder"
        x, y = points.mean(axis=0) if cylinder else points[np.argmax(points[:, 1])]
        label(ax, surface["name"], (x, y), (0, 0) if cylinder else (0, 4), va="center" if cylinder else "bottom")
        speed = surface["angular_speed"]
        if surface.get("part", -1) >= 0:
            speed = definition["parts"][surface["part"]].get("angular_velocity", (0.0, 0.0, 0.0))[2]
        if cylinder and speed:
            turn_arrow(surface, speed, ax)
    for (x, y), radius, text in electrodes(definition):
        shown = max(radius, THINNEST_WIRE)
        outside = 1e3 * circle(np.array([x, y]), shown)
        ax.add_patch(Polygon(outside, facecolor="#f0c419", edgecolor=DARK, linewidth=1.0, zorder=1))
        label(ax, text, (1e3 * x, 1e3 * (y + shown)), (0, 4))
    if np.isfinite(definition["landing_height"]):
        y = 1e3 * definition["landing_height"]
        ax.axhline(y, color=DARK, linestyle=":", linewidth=1.2)
        label(ax, "landing plane", (0.995, y), (0, 3), ha="right", xycoords=("axes fraction", "data"))


def label(ax: Axes, text: str, where: tuple[float, float], offset: tuple[float, float], **style: Any) -> None:
    """Small text beside a point, offset in typographic points."""
    style = dict[str, Any](ha="center", va="bottom", fontsize=8, color=DARK, zorder=6, bbox=PAPER) | style
    ax.annotate(text, where, xytext=offset, textcoords="offset points", **style)


def outline(surface: dict[str, Any]) -> NDArray[np.float64]:
    """Corners of a box, a cylinder or a mesh in the xy plane, (k, 2) m."""
    if surface["shape"] == "mesh":
        return mesh_places(surface)[:, :2]
    position, size = np.asarray(surface["position"][:2], float), surface["size"]
    if surface["shape"] == "cylinder":
        return circle(position, size[0])
    w, _, _, z = surface["orientation"]
    angle = 2 * np.arctan2(z, w)
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.asarray(size[:2], float) / 2
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return np.asarray(half @ turn + position)


def mesh_places(surface: dict[str, Any]) -> NDArray[np.float64]:
    """Vertices of a mesh where they are at time 0, (n, 3) m."""
    w, *rest = surface["orientation"]
    axis, vertices = np.asarray(rest, float), np.asarray(surface["vertices"], float)
    across = np.cross(axis, vertices)
    return np.asarray(surface["position"] + vertices + 2.0 * (w * across + np.cross(axis, across)))


def draw_mesh(surface: dict[str, Any], ax: Axes) -> None:
    """The edges of a mesh at time 0; of a large one, those at which it ends."""
    from matplotlib.collections import LineCollection

    from .scene.mesh import seams

    places = mesh_places(surface)
    edges, count = seams(places, np.asarray(surface["triangles"], np.uint32))
    shown = edges if len(edges) <= MOST_EDGES else edges[count == 1]
    lines = 1e3 * places[shown[:MOST_EDGES], :2]
    ax.add_collection(LineCollection(list(lines), colors=DARK, linewidths=0.4, zorder=1))
    x, y = 1e3 * places[np.argmax(places[:, 1]), :2]
    label(ax, surface["name"], (x, y), (0, 4))


def electrodes(definition: dict[str, Any]) -> list[tuple[tuple[float, float], float, str]]:
    """Center [m], radius [m] and label of each electrode."""
    rows = definition.get("electrodes")
    if rows is None:  # a result of before there were several
        field = definition["field"]
        if field is None or "distance" not in field:
            return []
        x, y = field["distance"] * np.cos(field["angle"]), field["distance"] * np.sin(field["angle"])
        rows = [{"kind": "static", "center": (x, y), "radius": field["electrode_radius"], "voltage": field["voltage"]}]
    names = {"static": "electrode", "corona": "wire"}
    return [(tuple(r["center"]), r["radius"], f"{names[r['kind']]}\n{1e-3 * r['voltage']:g} kV") for r in rows]


def circle(center: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """A polygon that looks like a circle, (90, 2)."""
    angle = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    return center + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def turn_arrow(surface: dict[str, Any], speed: float, ax: Axes) -> None:
    """An arrow inside a cylinder, the way it turns."""
    from matplotlib.patches import FancyArrowPatch

    x, y = 1e3 * np.asarray(surface["position"][:2])
    radius = 0.75e3 * surface["size"][0]
    way = 1 if speed > 0 else -1
    start, end = np.pi / 2 - 0.5 * way, np.pi / 2 + 0.5 * way
    points = [(x + radius * np.cos(a), y + radius * np.sin(a)) for a in (start, end)]
    style: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 10, "color": DARK, "zorder": 2}
    ax.add_patch(FancyArrowPatch(*points, connectionstyle=f"arc3,rad={0.25 * way}", **style))


def draw_paths(run: Run, ax: Axes) -> int:
    """Recorded trajectories by material; returns how many."""
    from matplotlib.collections import LineCollection

    paths = run.trajectories()
    material = run.materials_of(np.array(list(paths), np.int64))
    shown = 0
    for i, name in enumerate(run.materials):
        mine = [paths[key][1] for key, m in zip(paths, material, strict=True) if m == name]
        long = [1e3 * path[:, :2] for path in mine if len(path) > 2]
        chosen = [long[k] for k in np.linspace(0, len(long) - 1, min(len(long), MOST_PATHS)).astype(int)]
        shown += len(chosen)
        if chosen:
            color, style = COLORS[i % len(COLORS)], STYLES[i % len(STYLES)]
            lines = LineCollection(chosen, linewidths=0.6, alpha=0.55, zorder=3, colors=color, linestyles=[style])
            ax.add_collection(lines)
            ax.plot([], [], color=color, linestyle=style, linewidth=1.6, label=name)
    return shown
