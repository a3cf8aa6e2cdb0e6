"""Named scenes."""

from __future__ import annotations

import math
from typing import Any, Literal

from .errors import InputError, show
from .scene import (
    Angular,
    Belt,
    Bounds,
    Brush,
    Collect,
    Corona,
    Drum,
    Electrode,
    Family,
    Feed,
    Flake,
    LogNormal,
    Plate,
    Rate,
    Scene,
    Splitter,
    Wall,
)

Grains = Literal["shredded", "spheres"]

# Stands for the irregular shape of shredded grains, which spheres lack: half the mean eccentricity of the contacts,
# after Wensrich & Katterfeld, Powder Technology 217 (2012) 409. An order of magnitude; calibrate it on your material.
# Below tan 18 degrees = 0.32, the slope of the drum where the plate drops its grains, fine ones roll back behind it.
IRREGULAR = 0.35


def reference_machine(grains: Grains = "shredded") -> Scene:
    """The reference machine at 35 kV, with a feed of shredded copper and plastic.

    Parameters
    ----------
    grains : "shredded" or "spheres"
        What the copper and the plastic are: angular grains and irregular flakes, three of each, as clusters of five
        spheres; or spheres, which are several times faster and whose rolling friction stands for their shape.

    Geometry, speed, voltage and friction are those of the machine in Critelli, Tasora, Degiorgi & Colledani, "Particle
    Simulation of Granular Flows in Electrostatic Separation Processes", SIMUL 2014, and of its authors' program,
    measured from the drum's axis: drum 0.320 x 0.300 m at 44.8 rpm, electrode 0.038 m wide at 0.267 m and 30 degrees,
    brush, two splitters, a plate of 0.388 x 0.4 m at 5.7 degrees, an outlet of 0.1 x 0.182 m, walls at z = +-0.15 m;
    friction 0.5 on the drum, 0.2 on the plate and between grains, 0.1 on splitters, 0.9 on the brush; restitution 0.

    The brush reaches half a millimetre into the drum, as in the original: it is meant to touch.

    Ours, where the sources are silent:

    - the electrode is negative, as in practice;
    - the brush turns in the drum's sense with a surface half as fast again as the drum's (see `cesim.Brush`);
    - rolling friction 0.35 of spheres, which stands for an irregular shape (order of magnitude, calibrate it); none of
      shredded grains, which have one;
    - the plate is 10 mm thick, and a belt at 0.4 m/s stands for a vibratory conveyor; with the default feed all grains
      reach the drum 17.6 degrees before its top, at 0.37 m/s forwards and 0.58 m/s downwards;
    - the outlet lies 40 mm above the plate at x = -0.15 m, grains leave it at 0.3 m/s downwards;
    - the feed: 6 kg/h, 30 % copper and 70 % ABS by mass, log-normal sizes with median 0.9 mm and geometric standard
      deviation 1.25, cut off at 0.5 and 1.6 mm;
    - splitter blades 0.15 m long and 1 mm thick, the tilted one leaning outwards;
    - the landing plane at y = -0.098 m, 2 mm above the upright blade's tip so that no grain meets it first (the other
      bin layout of the sources lies at -0.10 m): there splitters can still be moved after the run; of the blades only
      the tilted one's last 25 mm stand above it (`scene.splitters = []` takes them away). The two virtual splitters are
      where the blades, prolonged, meet the plane;
    - the corona charges between 10 and 60 degrees from the drum's top in a layer of 5 mm, at once, in the electrodes'
      field.
    """
    if grains not in ("shredded", "spheres"):
        raise InputError(f"is {show(grains)}, must be 'shredded' or 'spheres'", path="grains", value=grains)
    rolling = IRREGULAR if grains == "spheres" else 0.0
    size = LogNormal(median=0.9e-3, gsd=1.25, least=0.5e-3, most=1.6e-3)
    kinds: dict[str, Any] = {"mix": {"copper": 0.30, "ABS": 0.70}, "size": size}
    if grains == "shredded":
        kinds = {"families": shredded_copper(0.30, size) + shredded_plastic(0.70, size)}
    return Scene(
        name="reference machine",
        drum=Drum(rolling_friction=rolling),
        electrode=Electrode(),
        corona=Corona(),
        plates=[Plate(motion=Belt(), rolling_friction=rolling)],
        splitters=[
            Splitter(tip=(0.149, -0.100), rolling_friction=rolling),
            Splitter(tip=(0.205, -0.073), tilt=math.radians(27.0), rolling_friction=rolling),
        ],
        brush=Brush(rolling_friction=rolling),
        walls=[Wall(position=(0.0, 0.0, z), normal=(0.0, 0.0, -math.copysign(1.0, z))) for z in (-0.15, 0.15)],
        feed=Feed(rate=Rate(6.0 / 3600.0), **kinds),
        collect=Collect(y=-0.098),
    )


def shredded_copper(fraction: float, size: LogNormal, material: str = "copper") -> list[Family]:
    """Angular grains of three random shapes, in equal parts of a mass fraction of the feed; the shapes are ours."""
    shapes = [Angular(seed=seed, spheres=5) for seed in (1, 2, 3)]
    return [Family(material=material, fraction=fraction / 3.0, size=size, shape=shape) for shape in shapes]


def shredded_plastic(fraction: float, size: LogNormal, material: str = "ABS") -> list[Family]:
    """Irregular flakes, 2.5 times as wide as thick, of three random outlines; as `shredded_copper`."""
    shapes = [Flake(width=2.5, elongation=1.3, outline="irregular", seed=seed, spheres=5) for seed in (1, 2, 3)]
    return [Family(material=material, fraction=fraction / 3.0, size=size, shape=shape) for shape in shapes]


def paper_machine(grains: Grains = "shredded") -> Scene:
    """The reference machine at 23 kV, the voltage named in the figure of Critelli et al., SIMUL 2014.

    Everything else, and what is ours, as in `reference_machine`.
    """
    scene = reference_machine(grains)
    scene.name = "paper machine"
    scene.electrode = Electrode(voltage=-23e3)
    return scene


def single_particle() -> Scene:
    """The reference machine without feed, plate, brush, splitters and walls: for following grains one by one.

    Source, and what is ours, as in `reference_machine`. Grains are added by `Simulation.add`, of any material of
    `scene.materials`.
    """
    scene = reference_machine("spheres")
    scene.name = "single particle"
    scene.feed = scene.brush = None
    scene.plates, scene.splitters, scene.walls = [], [], []
    return scene


def sphere_machine() -> Scene:
    """The reference machine fed with spheres, by a name for the command line: `reference_machine("spheres")`.

    Source, and what is ours, as in `reference_machine`.
    """
    return reference_machine("spheres")


def settling_box() -> Scene:
    """A box of five walls, 0.1 m wide and long, open at the top, without drum, field, feed and landing plane.

    All numbers are ours: a place for grains to settle in, for tests of contacts. Grains are added by `Simulation.add`.
    """
    half = 0.05
    sides = [
        Wall(position=(sign * half * x, 0.0, sign * half * z), normal=(-sign * x, 0.0, -sign * z))
        for x, z in ((1.0, 0.0), (0.0, 1.0))
        for sign in (-1.0, 1.0)
    ]
    return Scene(
        name="settling box",
        walls=[Wall(position=(0.0, 0.0, 0.0), normal=(0.0, 1.0, 0.0)), *sides],
        bounds=Bounds(lower=(-0.1, -0.1, -0.1), upper=(0.1, 1.0, 0.1)),
    )


#: Named scenes by name, for the command line.
NAMES = {
    scene.__name__: scene for scene in (reference_machine, sphere_machine, paper_machine, single_particle, settling_box)
}
