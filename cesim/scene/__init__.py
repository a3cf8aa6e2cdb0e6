"""The scene: a tree of typed parts with units, ranges and defaults."""

from ..materials import Material, Pair
from .check import Warning, Warnings
from .effects import Decision, Decisions, EffectSetting
from .feed import Constant, Family, Feed, LogNormal, Normal, Outlet, Rate, Sphere, Table, Uniform, Weibull
from .joints import Joint, LinearMotor, Motor, RigidPart, Slide
from .machine import (
    Air,
    Belt,
    Brush,
    Corona,
    Drum,
    Electrode,
    FieldModel,
    Plate,
    Splitter,
    Vibration,
    Wall,
)
from .mesh import Mesh, Rotation
from .scene import Bins, Bounds, Collect, Numerics, Scene, load

__all__ = [
    "Air",
    "Belt",
    "Bins",
    "Bounds",
    "Brush",
    "Collect",
    "Constant",
    "Corona",
    "Decision",
    "Decisions",
    "Drum",
    "EffectSetting",
    "Electrode",
    "Family",
    "Feed",
    "FieldModel",
    "Joint",
    "LinearMotor",
    "LogNormal",
    "Material",
    "Mesh",
    "Motor",
    "Normal",
    "Numerics",
    "Outlet",
    "Pair",
    "Plate",
    "Rate",
    "RigidPart",
    "Rotation",
    "Scene",
    "Slide",
    "Sphere",
    "Splitter",
    "Table",
    "Uniform",
    "Vibration",
    "Wall",
    "Warning",
    "Warnings",
    "Weibull",
    "load",
]
