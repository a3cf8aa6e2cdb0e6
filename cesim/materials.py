"""Materials by name, with the sources of their numbers."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from .errors import InputError
from .units import Doc, Part, Quantity

Friction = Annotated[float, Quantity("", 0.0, 1000.0, "Coulomb friction")]
Restitution = Annotated[float, Quantity("", 0.0, 1.0, "normal restitution (Newton)")]
RollingFriction = Annotated[
    float, Quantity("", 0.0, 1000.0, "rolling friction: moment <= coefficient x grain radius x normal impulse")
]
SpinningFriction = Annotated[
    float, Quantity("", 0.0, 1000.0, "the same against spinning about the normal of the contact")
]


class Pair(Part):
    """Contact of a material with one partner, where it differs from the rule; what is None follows the rule."""

    where: ClassVar[str] = "pair"
    friction: Friction | None = None
    restitution: Restitution | None = None
    rolling_friction: RollingFriction | None = None
    spinning_friction: SpinningFriction | None = None


class Material(Part):
    """What grains are made of.

    Two grains touch with the geometric mean of their materials' coefficients, a grain and a surface with the surface's.
    `pairs` overrides both: its keys are names of materials, or "drum", "brush", "plates", "splitters", "walls".
    Friction 0.2 and restitution 0 between grains are those of Critelli et al., SIMUL 2014.
    """

    where: ClassVar[str] = "material"
    kind: Annotated[Literal["conductor", "insulator"], Doc("'conductor' or 'insulator'")]
    density: Annotated[float, Quantity("kg/m3", 1.0, 30_000.0, "density")]
    permittivity: Annotated[float, Quantity("", 1.0, 1e4, "relative permittivity; insulators need it")] | None = None
    friction: Friction = 0.2
    restitution: Restitution = 0.0
    rolling_friction: RollingFriction = 0.0
    spinning_friction: SpinningFriction = 0.0
    pairs: Annotated[dict[str, Pair], Doc("partner -> coefficients that differ")] = Field(default_factory=dict)
    source: Annotated[str, Doc("where the numbers come from")] = ""

    @model_validator(mode="after")
    def _insulators_have_a_permittivity(self) -> Material:
        if self.kind == "insulator" and self.permittivity is None:
            raise InputError("is missing: an insulator needs one", path="permittivity", allowed="[1, 1e4]")
        return self


CRC = "density: CRC Handbook of Chemistry and Physics"
GRADES = "middle of the usual range of commercial grades ({}); take your own supplier's data where it matters"

LIBRARY: dict[str, dict[str, Any]] = {
    "copper": {"kind": "conductor", "density": 8960.0, "source": CRC},
    "aluminium": {"kind": "conductor", "density": 2700.0, "source": CRC},
    "solder": {"kind": "conductor", "density": 8400.0, "source": "Sn-Pb near 60/40, rounded"},
    "PVC": {
        "kind": "insulator",
        "density": 1375.0,
        "permittivity": 3.1,
        "source": GRADES.format("1300-1450 kg/m3, 2.8-3.4"),
    },
    "PE": {
        "kind": "insulator",
        "density": 940.0,
        "permittivity": 2.385,
        "source": GRADES.format("920-960 kg/m3, 2.27-2.5"),
    },
    "PP": {
        "kind": "insulator",
        "density": 923.0,
        "permittivity": 2.25,
        "source": GRADES.format("900-946 kg/m3"),
    },
    "ABS": {
        "kind": "insulator",
        "density": 1050.0,
        "permittivity": 2.87,
        "source": GRADES.format("1030-1070 kg/m3"),
    },
    "FR4": {
        "kind": "insulator",
        "density": 1875.0,
        "permittivity": 4.65,
        "source": GRADES.format("epoxy and glass, 1800-1950 kg/m3, 4.3-5.0"),
    },
}


def named(name: str) -> Material:
    """A material of the library, as a copy of one's own."""
    return Material(**LIBRARY[name])


def with_library(given: Any) -> Any:
    """The given materials, each on top of the library's of the same name, then the rest of the library."""
    if not isinstance(given, dict):
        return given
    mine = {
        name: {**LIBRARY.get(name, {}), **material} if isinstance(material, dict) else material
        for name, material in given.items()
    }
    return {**mine, **{name: material for name, material in LIBRARY.items() if name not in mine}}
