"""Materials by name, with the sources of their numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from .constants import VACUUM_PERMITTIVITY
from .errors import InputError, show, unknown
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


COEFFICIENTS = ("friction", "restitution", "rolling_friction", "spinning_friction")


class Material(Part):
    """What grains are made of.

    Two grains touch with the geometric mean of their materials' coefficients, a grain and a surface with the surface's.
    `pairs` overrides both: its keys are names of materials, or "drum", "brush", "plates", "splitters", "walls".
    Friction 0.2 and restitution 0 between grains are those of Critelli et al., SIMUL 2014.

    A `resistivity` or a `decay_time` makes one law of all kinds: on the drum a charge relaxes with that time, and the
    scene takes for a conductor or an insulator what has nothing left to follow (docs/physics.md 2.2). A
    `conductor_share` makes a mixture, whose rest the other numbers describe: see `mixture`.
    """

    where: ClassVar[str] = "material"
    kind: Annotated[
        Literal["conductor", "insulator", "middling"],
        Doc("'conductor', 'insulator', or between: a 'middling' needs a resistivity or a decay_time"),
    ]
    density: Annotated[float, Quantity("kg/m3", 1.0, 30_000.0, "density")]
    permittivity: Annotated[float, Quantity("", 1.0, 1e4, "relative permittivity; insulators need it")] | None = None
    resistivity: (
        Annotated[float, Quantity("ohm m", 1e-9, 1e20, "volume resistivity; its charges decay in eps0 eps_r times it")]
        | None
    ) = None
    decay_time: Annotated[float, Quantity("s", 1e-12, 1e12, "measured decay time of a charge, instead")] | None = None
    conductor_share: Annotated[float, Quantity("", 0.0, 0.999, "share of a mixture that conducts, by volume")] = 0.0
    contents: Annotated[
        dict[str, Annotated[float, Quantity("", 0.0, 1.0, "mass fraction")]],
        Doc("material -> mass fraction of what a mixture is made of, by which results count it; they sum to 1"),
    ] = Field(default_factory=dict)
    friction: Friction = 0.2
    restitution: Restitution = 0.0
    rolling_friction: RollingFriction = 0.0
    spinning_friction: SpinningFriction = 0.0
    pairs: Annotated[dict[str, Pair], Doc("partner -> coefficients that differ")] = Field(default_factory=dict)
    source: Annotated[str, Doc("where the numbers come from")] = ""

    @model_validator(mode="after")
    def _numbers_suffice(self) -> Material:
        if self.kind != "conductor" and self.permittivity is None:
            article = "an insulator" if self.kind == "insulator" else "a middling"
            raise InputError(f"is missing: {article} needs one", path="permittivity", allowed="[1, 1e4]")
        if self.resistivity is not None and self.decay_time is not None:
            raise InputError("stands beside resistivity: give one or the other", path="decay_time", unit="s")
        if self.kind == "middling" and self.relaxation_time is None:
            raise InputError(
                "is missing: a middling needs one, or a resistivity",
                path="decay_time",
                unit="s",
                allowed="[1e-12, 1e12] s",
            )
        if self.contents and abs(math.fsum(self.contents.values()) - 1.0) > 1e-6:
            raise InputError(f"sums to {show(math.fsum(self.contents.values()))}, must sum to 1", path="contents")
        if self.kind == "conductor" and self.conductor_share > 0.0:
            raise InputError(
                f"is {show(self.conductor_share)}, but the rest of a mixture is no conductor", path="conductor_share"
            )
        return self

    @property
    def relaxation_time(self) -> float | None:
        """Time in s in which a charge on the drum falls to 1/e: measured, or eps0 eps_r times the resistivity."""
        if self.decay_time is not None or self.resistivity is None:
            return self.decay_time
        return VACUUM_PERMITTIVITY * (self.permittivity or 1.0) * self.resistivity

    @classmethod
    def mixture(
        cls, contents: Mapping[str, float], materials: Mapping[str, Material] | None = None, **fields: Any
    ) -> Material:
        """A grain that was not liberated: the weighted average of what it would be if each content were all of it.

        Density, permittivity and conductivity are averages by volume. The conductors among the contents are its
        `conductor_share`, by volume: of so much of it the force is a conductor's, of the rest an insulator's, each with
        a charge of its own (Critelli et al., SIMUL 2014: the average of the metal and the non-metal force). Results
        count its grains under its name, and its contents in the materials that they are.

        Parameters
        ----------
        contents : name -> mass fraction, summing to 1
        materials : by name; default: those of the library
        fields
            Of the result, where they are not the averages, such as friction or conductor_share.

        Examples
        --------
        >>> scene.materials["board"] = cesim.Material.mixture({"copper": 0.3, "FR4": 0.7})
        """
        known = {name: named(name) for name in LIBRARY} | dict(materials or {})
        for name, fraction in contents.items():
            if name not in known:
                raise unknown("material", name, known).at("mixture")
            if not 0.0 <= fraction <= 1.0:
                raise InputError(f"is {show(fraction)}, outside [0, 1]", path=f"mixture.{name}", value=fraction)
        if not contents or abs(sum(contents.values()) - 1.0) > 1e-6:
            raise InputError(f"sums to {show(sum(contents.values()))}, must sum to 1", path="mixture", allowed="sum 1")
        volumes = {name: fraction / known[name].density for name, fraction in contents.items() if fraction > 0.0}
        whole = sum(volumes.values())

        def mean(field: str, names: list[str]) -> float:
            part = math.fsum(volumes[n] for n in names)
            return math.fsum(volumes[n] * float(getattr(known[n], field)) for n in names) / part

        rest = [name for name in volumes if known[name].kind != "conductor"]
        words = ", ".join(f"{100.0 * fraction:g} % {name}" for name, fraction in contents.items())
        averages: dict[str, Any] = {
            "kind": "insulator" if rest else "conductor",
            "density": 1.0 / whole,
            "contents": {name: contents[name] for name in volumes},
            "source": f"mixture by mass: {words}",
            **{name: mean(name, list(volumes)) for name in COEFFICIENTS},
        }
        if rest:
            times = [(volumes[name], known[name].relaxation_time, known[name].permittivity or 1.0) for name in rest]
            leaks = sum(volume * eps / tau for volume, tau, eps in times if tau)
            averages["permittivity"] = mean("permittivity", rest)
            if leaks > 0.0:
                averages["kind"] = "middling"
                averages["decay_time"] = averages["permittivity"] * sum(v for v, _, _ in times) / leaks
            averages["conductor_share"] = 1.0 - sum(volumes[name] for name in rest) / whole
        return cls(**{**averages, **fields})


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


def library() -> dict[str, Material]:
    """All materials of the library, as copies."""
    return {name: named(name) for name in LIBRARY}


def with_library(given: Any) -> Any:
    """The given materials, each on top of the library's of the same name, then the rest of the library."""
    if not isinstance(given, dict):
        return given
    mine = {
        name: {**LIBRARY.get(name, {}), **material} if isinstance(material, dict) else material
        for name, material in given.items()
    }
    return {**mine, **{name: material for name, material in LIBRARY.items() if name not in mine}}
