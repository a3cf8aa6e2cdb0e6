"""Simulation of corona electrostatic separators: what lands where, and with what certainty.

>>> import cesim
>>> run = cesim.run(cesim.scenes.reference_machine(), until="4 s")
>>> print(run)
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import accuracy as accuracy
    from . import contact as contact
    from . import effects as effects
    from . import engine as engine
    from . import fields as fields
    from . import materials as materials
    from . import plots as plots
    from . import scenes as scenes
    from . import shapes as shapes
    from . import testing as testing
    from . import verification as verification
    from .accuracy import Comparison as Comparison
    from .accuracy import Converged as Converged
    from .accuracy import accuracy_report as accuracy_report
    from .accuracy import compare as compare
    from .accuracy import recommend as recommend
    from .citations import cite as cite
    from .errors import InputError as InputError
    from .errors import SimulationError as SimulationError
    from .materials import Material as Material
    from .materials import Pair as Pair
    from .result import Run as Run
    from .result import open_run as open  # noqa: F401
    from .runner import Fed as Fed
    from .runner import Frames as Frames
    from .runner import run as run
    from .scene import Air as Air
    from .scene import Angular as Angular
    from .scene import Belt as Belt
    from .scene import Box as Box
    from .scene import Brush as Brush
    from .scene import ClosedMesh as ClosedMesh
    from .scene import Cluster as Cluster
    from .scene import Collect as Collect
    from .scene import Composite as Composite
    from .scene import Cone as Cone
    from .scene import Constant as Constant
    from .scene import ConstantCharge as ConstantCharge
    from .scene import Corona as Corona
    from .scene import Cylinder as Cylinder
    from .scene import Drum as Drum
    from .scene import Electrode as Electrode
    from .scene import Ellipsoid as Ellipsoid
    from .scene import Family as Family
    from .scene import Feed as Feed
    from .scene import Flake as Flake
    from .scene import Hull as Hull
    from .scene import Joint as Joint
    from .scene import LinearMotor as LinearMotor
    from .scene import LogNormal as LogNormal
    from .scene import Mesh as Mesh
    from .scene import Motor as Motor
    from .scene import Normal as Normal
    from .scene import NormalCharge as NormalCharge
    from .scene import Outlet as Outlet
    from .scene import Plate as Plate
    from .scene import RigidPart as RigidPart
    from .scene import Rod as Rod
    from .scene import Rotation as Rotation
    from .scene import Scene as Scene
    from .scene import Shaving as Shaving
    from .scene import Slide as Slide
    from .scene import Sphere as Sphere
    from .scene import Splitter as Splitter
    from .scene import Table as Table
    from .scene import TableCharge as TableCharge
    from .scene import Uniform as Uniform
    from .scene import UniformCharge as UniformCharge
    from .scene import Vibration as Vibration
    from .scene import Wall as Wall
    from .scene import Weibull as Weibull
    from .scene import load as load
    from .simulation import Simulation as Simulation
    from .statistics import Bins as Bins
    from .statistics import Estimate as Estimate
    from .verification import verify as verify

__version__ = "0.1.0"

# OpenMP's threads wait between the loops of a step: spinning for tens of microseconds saves waking them, spinning for
# longer takes the core from others. libgomp reads this when the engine is loaded; what the user has set stays.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ.setdefault("GOMP_SPINCOUNT", "20000")

# Where each name lives. It is imported when first used, so that `import cesim` stays fast.
_HOMES = {
    "accuracy": "Comparison Converged accuracy_report compare recommend",
    "citations": "cite",
    "errors": "InputError SimulationError",
    "materials": "Material Pair",
    "result": "Run open",
    "runner": "Fed Frames run",
    "scene": "Air Angular Belt Box Brush ClosedMesh Cluster Collect Composite Cone Constant ConstantCharge Corona "
    "Cylinder Drum Electrode Ellipsoid Family Feed Flake Hull Joint LinearMotor LogNormal Mesh Motor Normal "
    "NormalCharge Outlet Plate RigidPart Rod Rotation Scene Shaving Slide Sphere Splitter Table TableCharge Uniform "
    "UniformCharge Vibration Wall Weibull load",
    "simulation": "Simulation",
    "statistics": "Bins Estimate",
    "verification": "verify",
}
_HOME = {name: home for home, names in _HOMES.items() for name in names.split()}
_MODULES = (
    "accuracy",
    "contact",
    "corona",
    "effects",
    "engine",
    "fields",
    "materials",
    "plots",
    "scenes",
    "shapes",
    "testing",
    "verification",
)

__all__ = ["__version__", *_HOME, *_MODULES]


def __getattr__(name: str) -> Any:
    if name == "engine":
        return _engine()
    if name in _MODULES:
        return import_module(f".{name}", __name__)
    if name not in _HOME:
        raise AttributeError(f"module 'cesim' has no attribute {name!r}")
    home = import_module(f".{_HOME[name]}", __name__)
    value = globals()[name] = getattr(home, "open_run" if name == "open" else name)
    return value


def _engine() -> Any:
    try:
        return import_module(".engine", __name__)
    except ModuleNotFoundError as error:
        if error.name != f"{__name__}.engine":
            raise
        where = os.path.dirname(__file__)
        raise ImportError(
            f"the sources of cesim in {where} stand before the installed package, and their engine is not built: "
            "work in another folder, or build it there with pip install -e ."
        ) from None


def __dir__() -> list[str]:
    return sorted(__all__)
