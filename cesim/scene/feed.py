"""The feed: how much of what, of which sizes, from where."""

from __future__ import annotations

import csv
import itertools
import math
import os
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, GetCoreSchemaHandler, model_validator
from pydantic_core import CoreSchema, core_schema

from .. import engine
from ..errors import InputError, engine_errors, show, unknown
from ..units import Doc, Part, Quantity, to_si
from .charges import AnyCharge
from .machine import Point3
from .shapes import AnyShape, Composite, Sphere

LEAST_DIAMETER, MOST_DIAMETER = 1e-7, 0.05  # m
Diameter = Annotated[float, Quantity("m", LEAST_DIAMETER, MOST_DIAMETER, "diameter")]
Fraction = Annotated[float, Quantity("", 0.0, 1.0, "fraction")]


# ---- size distributions, all by number of grains -------------------------------------------------------------------


class Size(Part):
    """A distribution of the diameter by number of grains; `kind` is its row in the engine's table."""

    where: ClassVar[str] = "size"
    kind: str

    def parameters(self) -> dict[str, float]:
        """What the engine's row takes."""
        return {name: value for name, value in self if name not in ("kind", "least", "most")}

    def limits(self) -> tuple[float, float]:
        """Where the distribution is cut off; (0, 0): nowhere."""
        return 0.0, 0.0

    def smallest(self) -> float:
        """A diameter that one grain in a thousand stays below, for judging how large an effect can be."""
        with engine_errors():
            return max(engine.quantile(self.kind, list(self.parameters().values()), 1e-3), self.limits()[0])


class Truncated(Size):
    """A distribution that may be cut off at both ends."""

    least: Annotated[float, Quantity("m", LEAST_DIAMETER, MOST_DIAMETER, "smallest diameter; None: no cut")] | None = (
        None
    )
    most: Annotated[float, Quantity("m", LEAST_DIAMETER, MOST_DIAMETER, "largest diameter; None: no cut")] | None = None

    @model_validator(mode="after")
    def _limits_are_ordered(self) -> Truncated:
        _ordered(*self.limits())
        return self

    def limits(self) -> tuple[float, float]:
        if self.least is None and self.most is None:
            return 0.0, 0.0
        return self.least or 0.0, self.most or MOST_DIAMETER


class Constant(Size):
    """All grains of one diameter."""

    kind: Literal["constant"] = "constant"
    diameter: Diameter

    def smallest(self) -> float:
        return self.diameter


class Uniform(Size):
    """Every diameter between two is as likely."""

    kind: Literal["uniform"] = "uniform"
    least: Annotated[float, Quantity("m", LEAST_DIAMETER, MOST_DIAMETER, "smallest diameter")]
    most: Annotated[float, Quantity("m", LEAST_DIAMETER, MOST_DIAMETER, "largest diameter")]

    @model_validator(mode="after")
    def _ends_are_ordered(self) -> Uniform:
        _ordered(self.least, self.most)
        return self

    def parameters(self) -> dict[str, float]:
        return {"least": self.least, "most": self.most}

    def smallest(self) -> float:
        return self.least


class Normal(Truncated):
    """The normal distribution; cut off four deviations off the mean (or a hundredth of it) unless said otherwise."""

    kind: Literal["normal"] = "normal"
    mean: Annotated[float, Quantity("m", LEAST_DIAMETER, MOST_DIAMETER, "mean diameter, before the cut")]
    deviation: Annotated[float, Quantity("m", 0.0, MOST_DIAMETER, "standard deviation, before the cut")]

    def limits(self) -> tuple[float, float]:
        least = self.least or max(self.mean - 4.0 * self.deviation, 0.01 * self.mean)
        return least, self.most or min(self.mean + 4.0 * self.deviation, MOST_DIAMETER)


class LogNormal(Truncated):
    """The log-normal distribution, usual for crushed material."""

    kind: Literal["lognormal"] = "lognormal"
    median: Annotated[float, Quantity("m", LEAST_DIAMETER, MOST_DIAMETER, "median diameter, before the cut")]
    gsd: Annotated[float, Quantity("", 1.0, 10.0, "geometric standard deviation: 84 % are below gsd x median")]


class Weibull(Truncated):
    """The distribution of Weibull, or of Rosin and Rammler."""

    kind: Literal["weibull"] = "weibull"
    scale: Annotated[float, Quantity("m", LEAST_DIAMETER, MOST_DIAMETER, "diameter that 63.2 % stay below")]
    shape: Annotated[float, Quantity("", 0.1, 100.0, "uniformity: the larger, the narrower")]


class Table(Size):
    """A measured distribution: cumulative number fraction over diameter, linear in between.

    A scene file may say `file = "sizes.csv"` instead: two columns, diameter in m (or text with a unit) and fraction.
    """

    kind: Literal["table"] = "table"
    diameter: Annotated[list[Diameter], Doc("diameters, ascending [m]")]
    fraction: Annotated[list[Fraction], Doc("fraction of the grains not larger; ends at 1")]

    @model_validator(mode="after")
    def _rows_ascend(self) -> Table:
        if len(self.diameter) != len(self.fraction) or not self.diameter:
            raise InputError(
                f"has {len(self.fraction)} values for {len(self.diameter)} diameters; there must be as many, and some",
                path="fraction",
            )
        for name, column in (("diameter", self.diameter), ("fraction", self.fraction)):
            if any(after < before for before, after in itertools.pairwise(column)):
                raise InputError("must ascend", path=name, value=column)
        if abs(self.fraction[-1] - 1.0) > 1e-9:
            raise InputError(f"ends at {show(self.fraction[-1])}, must end at 1", path="fraction", value=self.fraction)
        return self

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Table:
        """Reads the two columns of a CSV file; lines that begin with # are skipped."""
        try:
            with open(path, newline="", encoding="utf-8") as file:
                rows = [row for row in csv.reader(file) if row and not row[0].lstrip().startswith("#")]
        except (OSError, ValueError, csv.Error) as error:
            raise InputError(f"{show(str(path))} cannot be read: {error}") from None
        if any(len(row) != 2 for row in rows):
            raise InputError(f"{show(str(path))} must have two columns, diameter and cumulative fraction")
        return cls(diameter=[_number(row[0]) for row in rows], fraction=[_number(row[1]) for row in rows])

    def parameters(self) -> dict[str, float]:
        return {}

    def smallest(self) -> float:
        return self.diameter[0]


AnySize = Annotated[
    Constant | Uniform | Normal | LogNormal | Weibull | Table, Field(discriminator="kind"), Doc("size distribution")
]


def _ordered(least: float, most: float) -> None:
    if least > most:
        raise InputError(f"is {show(least)} m, above most = {show(most)} m", path="least", value=least, unit="m")


def _number(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text


# ---- the feed ------------------------------------------------------------------------------------------------------


LARGEST_RATE = {"kg/s": 100.0, "1/s": 1e7}


class Rate(float):
    """A feed rate: a float that knows whether it counts kilograms or grains a second."""

    unit: str

    def __new__(cls, value: object) -> Rate:
        """From a plain number (kg/s) or text with a unit of mass or count per time."""
        if isinstance(value, Rate):
            return value
        for unit, most in LARGEST_RATE.items():
            try:
                return cls._make(to_si(value, unit, 0.0, most), unit)
            except InputError as error:
                if error.allowed or not isinstance(value, str):
                    raise  # not a matter of the unit
        allowed = "a mass or a count per time such as '120 kg/h' or '5000 1/s'"
        raise InputError(f"is {show(value)}, must be {allowed}", value=value, allowed=allowed)

    @classmethod
    def _make(cls, value: float, unit: str) -> Rate:
        rate = super().__new__(cls, value)
        rate.unit = unit
        return rate

    @property
    def kind(self) -> str:
        """ "mass" or "count"."""
        return "mass" if self.unit == "kg/s" else "count"

    def __str__(self) -> str:
        return f"{float(self)!r} {self.unit}"

    def __repr__(self) -> str:
        return f"Rate('{self}')"

    def __eq__(self, other: object) -> bool:
        return float(self) == other and (not isinstance(other, Rate) or self.unit == other.unit)

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash(float(self))

    def __reduce__(self) -> tuple[Any, ...]:
        return Rate, (str(self),)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(cls)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: Any) -> dict[str, Any]:
        return {"anyOf": [{"type": "number", "minimum": 0}, {"type": "string"}]}


class Outlet(Part):
    """The horizontal rectangle through which grains enter."""

    where: ClassVar[str] = "outlet"
    center: Annotated[Point3, Doc("its centre [m]")] = (-0.150, 0.219, 0.0)
    length: Annotated[float, Quantity("m", 1e-5, 10.0, "edge along x")] = 0.100
    width: Annotated[float, Quantity("m", 1e-5, 10.0, "edge along z")] = 0.182


class Family(Part):
    """Grains of one material, size distribution and shape."""

    where: ClassVar[str] = "family"
    material: Annotated[str, Doc("name of a material of the scene; of a composite, a name of its own")]
    fraction: Annotated[float, Quantity("", 0.0, 1.0, "mass fraction of the feed")]
    size: AnySize
    shape: AnyShape = Field(default_factory=Sphere)
    charge: AnyCharge | None = None


Velocity = Annotated[float, Quantity("m/s", -100.0, 100.0, "velocity")]


class Feed(Part):
    """A continuous feed: either `mix` with one `size` and `shape` for all, or `families` one by one."""

    where: ClassVar[str] = "feed"
    rate: Annotated[Rate, Doc("mass ('120 kg/h', a plain number in kg/s) or count ('5000 1/s') per time")]
    mix: Annotated[dict[str, Fraction], Doc("material -> mass fraction; they sum to 1")] | None = None
    size: AnySize | None = None
    shape: AnyShape = Field(default_factory=Sphere)
    charges: Annotated[
        dict[str, AnyCharge], Doc("material of the mix -> law of the charges that its grains are fed with")
    ] = Field(default_factory=dict)
    families: Annotated[list[Family], Doc("instead of mix and size; their fractions sum to 1")] | None = None
    outlet: Annotated[Outlet, Doc("where the grains enter")] = Field(default_factory=Outlet)
    velocity: Annotated[tuple[Velocity, Velocity, Velocity], Doc("of the grains at the outlet [m/s]")] = (
        0.0,
        -0.3,
        0.0,
    )
    start: Annotated[float, Quantity("s", 0.0, 1e7, "when it begins")] = 0.0
    stop: Annotated[float, Quantity("s", 0.0, 1e7, "when it ends; None: never")] | None = None

    @model_validator(mode="after")
    def _fractions_sum_to_one(self) -> Feed:
        if (self.mix is None) == (self.families is None):
            raise InputError("must have either mix and size, or families", path="")
        if (self.mix is None) != (self.size is None):
            raise InputError("goes with mix: give both or none", path="size")
        name, fractions = (
            ("mix", list(self.mix.values()))
            if self.mix is not None
            else ("families", [family.fraction for family in self.families or []])
        )
        if abs(math.fsum(fractions) - 1.0) > 1e-6:
            raise InputError(
                f"sums to {show(math.fsum(fractions))}, must sum to 1", path=name, value=fractions, allowed="sum 1"
            )
        if self.mix is not None and isinstance(self.shape, Composite):
            raise InputError(
                "is a composite, which brings its own materials; feed it as one of families, its name as the material",
                path="shape",
            )
        for material in self.charges:
            if material not in (self.mix or {}):
                raise unknown("material", material, self.mix or {}).at("charges")
        if self.stop is not None and self.stop < self.start:
            raise InputError(f"is {show(self.stop)} s, before start = {show(self.start)} s", path="stop", unit="s")
        return self

    def all_families(self) -> list[Family]:
        """The families, also where the feed is given as a mix. What has no mass is left out."""
        if self.mix is None or self.size is None:
            families = self.families or []
        else:
            families = [
                Family(
                    material=name,
                    fraction=fraction,
                    size=self.size,
                    shape=self.shape,
                    charge=self.charges.get(name),
                )
                for name, fraction in self.mix.items()
            ]
        return [family for family in families if family.fraction > 0.0]
