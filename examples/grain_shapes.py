"""Grains that are not spheres: what can be described, what the engine gets of it, and how far that is from the shape.

Each shape becomes a template: overlapping spheres, or one convex polyhedron, over the diameter of the sphere of equal
volume. Mass, centre and moments of inertia are those of the shape described; the table says how far the spheres are
from it. More spheres come nearer and make contacts dearer: the second half of the picture shows what they buy.

Takes about 20 s on one core.

    python examples/grain_shapes.py
    python examples/grain_shapes.py --spheres 20 --seed 3
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import LogLocator

import cesim
from cesim.shapes import template

COUNTS = (3, 4, 6, 8, 12, 16, 24, 32, 48)  # of spheres, for the errors
COLORS = {"cluster": "#0072B2", "convex": "#E69F00", "sphere": "#009E73"}
VIEW = (0.35, -0.55)  # turned by so much about y and then about x before it is looked at, rad
LIGHT = np.array([-0.4, 0.6, 0.7])


def shapes(spheres, seed):
    """One of each kind, with a title."""
    return {
        "sphere": cesim.Sphere(),
        "box": cesim.Box(proportions=(3, 2, 1.5), spheres=spheres),
        "box, convex": cesim.Box(proportions=(3, 2, 1.5), model="convex"),
        "flake": cesim.Flake(width=3, spheres=spheres),
        "irregular flake": cesim.Flake(width=3, elongation=1.3, outline="irregular", seed=seed, spheres=spheres),
        "cylinder": cesim.Cylinder(aspect=1.2, spheres=spheres),
        "cylinder, convex": cesim.Cylinder(aspect=1.2, model="convex"),
        "cone": cesim.Cone(spheres=spheres),
        "ellipsoid": cesim.Ellipsoid(spheres=spheres),
        "rod": cesim.Rod(aspect=4),
        "shaving": cesim.Shaving(length=16),
        "angular": cesim.Angular(seed=seed, spheres=spheres),
        "angular, convex": cesim.Angular(seed=seed, model="convex"),
        "own spheres": cesim.Cluster(spheres=[(0, 0, 0, 1), (1.2, 0, 0, 0.8), (0.4, 1.1, 0, 0.6)]),
    }


def table(found):
    """One line a template."""
    print(f"{'':<17} {'parts':>5} {'volume':>8} {'shape':>7} {'deviation':>9} {'inertia':>8}   moments [m d2]")
    for title, one in found.items():
        parts = len(one.vertices) if one.kind == "convex" else len(one.spheres)
        moments = " ".join(f"{moment:.4f}" for moment in one.moments)
        print(
            f"{title:<17} {parts:>5} {one.volume_error:>+8.1%} {one.shape_error:>7.1%} {one.deviation:>7.3f} d "
            f"{one.inertia_error:>8.1%}   {moments}"
        )


def turned(points):
    """Points (n, 3) as seen: x to the right, y up, z to the viewer."""
    (cy, sy), (cx, sx) = ((np.cos(angle), np.sin(angle)) for angle in VIEW)
    about_y, about_x = [[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]], [[1, 0, 0], [0, cx, sx], [0, -sx, cx]]
    return points @ (np.array(about_x) @ np.array(about_y)).T


def seen(one, pixels=240):
    """Normals (pixels, pixels, 3) of what each ray meets first, NaN where it meets nothing, and half the width."""
    half = 1.05 * one.reach
    x, y = np.meshgrid(np.linspace(-half, half, pixels), np.linspace(half, -half, pixels))
    normals = np.full((pixels, pixels, 3), np.nan)
    if one.kind == "convex":
        enter, leave = np.full(x.shape, np.inf), np.full(x.shape, -np.inf)  # z of the ray, from the front to the back
        for normal, offset in planes(turned(one.vertices)):
            if abs(normal[2]) < 1e-12:
                enter[normal[0] * x + normal[1] * y > offset] = -np.inf
                continue
            z = (offset - normal[0] * x - normal[1] * y) / normal[2]
            if normal[2] > 0:
                normals[z < enter] = normal
                enter = np.minimum(enter, z)
            else:
                leave = np.maximum(leave, z)
        normals[enter < leave] = np.nan
        return normals, half
    front = np.full(x.shape, -np.inf)
    for (a, b, c), r in zip(turned(one.spheres[:, :3]), one.spheres[:, 3], strict=True):
        square = r * r - (x - a) ** 2 - (y - b) ** 2
        z = c + np.sqrt(np.maximum(square, 0.0))
        nearer = (square > 0.0) & (z > front)
        front[nearer] = z[nearer]
        normals[nearer] = (np.stack([x - a, y - b, z - c], axis=-1) / r)[nearer]
    return normals, half


def planes(vertices):
    """Outward normals and offsets of a convex polyhedron's sides."""
    from scipy.spatial import ConvexHull

    return [(row[:3], -row[3]) for row in ConvexHull(vertices).equations]


def draw(found, errors, path):
    """All templates, and below them what spheres buy."""
    figure = plt.figure(figsize=(12, 9.5), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(2.1, 1))
    for ax, (title, one) in zip(above.subplots(2, 7).ravel(), found.items(), strict=True):
        normals, half = seen(one)
        shade = np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0.0, 1.0)
        color = np.array(plt.matplotlib.colors.to_rgb(COLORS[one.kind]))
        picture = np.ones((*shade.shape, 4))
        picture[..., :3] = color * (0.25 + 0.75 * shade[..., None])
        picture[..., 3] = np.isfinite(shade)
        ax.imshow(np.nan_to_num(picture), extent=(-half, half, -half, half))
        ax.set(title=title, xlim=(-1.1, 1.1), ylim=(-1.1, 1.1))
        ax.axis("off")
        parts = f"corners: {len(one.vertices)}" if one.kind == "convex" else f"spheres: {len(one.spheres)}"
        ax.text(
            0.5, -0.02, f"{parts}\nshape {100 * one.shape_error:.1f} %", transform=ax.transAxes, ha="center", va="top"
        )
    left, right = below.subplots(1, 2)
    for (title, line), style in zip(errors.items(), ("-o", "--s", ":^", "-.v"), strict=False):
        counts = [len(one.spheres) for one in line]
        left.plot(counts, [100 * one.shape_error for one in line], style, label=title, markersize=4)
        right.plot(counts, [100 * one.inertia_error for one in line], style, label=title, markersize=4)
    left.set(xscale="log", yscale="log", xlabel="spheres", ylabel="shape error [% of the volume]")
    right.set(xscale="log", yscale="log", xlabel="spheres", ylabel="inertia error of the spheres alone [%]")
    for ax in (left, right):
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter("")
        ax.set_xticks(COUNTS[:-1], labels=map(str, COUNTS[:-1]))
        ax.grid(alpha=0.3, which="both")
    left.legend(fontsize=9)
    figure.savefig(path, dpi=130)


def main():
    parser = argparse.ArgumentParser(description="Build, measure and draw templates of grain shapes.")
    parser.add_argument("--spheres", type=int, default=9, help="of each cluster, at most; default: 9")
    parser.add_argument("--seed", type=int, default=1, help="of the random shapes; default: 1")
    parser.add_argument("--out", type=Path, default=Path("grain_shapes.png"), metavar="PNG")
    options = parser.parse_args()

    found = {title: template(shape) for title, shape in shapes(options.spheres, options.seed).items()}
    table(found)
    errors = {
        "box": [template(cesim.Box(proportions=(3, 2, 1.5), spheres=n)) for n in COUNTS],
        "ellipsoid": [template(cesim.Ellipsoid(spheres=n)) for n in COUNTS],
        "angular": [template(cesim.Angular(seed=options.seed, spheres=n)) for n in COUNTS],
        "flake": [template(cesim.Flake(width=3, spheres=n)) for n in COUNTS],
    }
    draw(found, errors, options.out)
    print(f"written {options.out}")


if __name__ == "__main__":
    main()
