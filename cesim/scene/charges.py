"""The charges that grains are fed with (tribocharging on the way): laws per mass or per surface of a grain."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from ..errors import InputError, show
from ..units import Doc, Part, Quantity, to_si

UNITS = {"mass": "C/kg", "surface": "C/m2"}
MOST = 1.0  # C/kg or C/m2
Density = Annotated[float, Quantity("", -MOST, MOST, "charge per mass or surface, in C/kg or C/m2")]


class Charge(Part):
    """A law of charges; `kind` is its row in the engine's table.

    Numbers are per mass or per surface as `per` says; text says it by its unit ("-20 nC/g", "5 uC/m2"). The surface is
    that of the sphere of equal volume. What air would not hold, beyond 26.6 uC/m2, is cut off and counted.
    """

    where: ClassVar[str] = "charge"
    numbers: ClassVar[tuple[str, ...]] = ()
    kind: str
    per: Annotated[Literal["mass", "surface"], Doc("what the numbers are for: C/kg or C/m2")] = "mass"

    @model_validator(mode="before")
    @classmethod
    def _units_say_per_what(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        read, found = dict(data), {data["per"]} if "per" in data else set()
        for name in cls.numbers:
            value = read.get(name)
            if isinstance(value, str):
                read[name], per = _density(value, name)
                found.add(per)
            elif isinstance(value, list | tuple) and any(isinstance(one, str) for one in value):
                pairs = [_density(one, name) if isinstance(one, str) else (one, "mass") for one in value]
                read[name] = [pair[0] for pair in pairs]
                found |= {pair[1] for pair in pairs}
        if len(found) > 1:
            raise InputError("mixes charges per mass and per surface", path="per", value=sorted(found))
        return {**read, "per": next(iter(found), "mass")}

    def parameters(self) -> dict[str, float]:
        """What the engine's row takes."""
        return {name: float(getattr(self, name)) for name in self.numbers}


class ConstantCharge(Charge):
    """All grains alike."""

    numbers: ClassVar[tuple[str, ...]] = ("value",)
    kind: Literal["constant"] = "constant"
    value: Density


class UniformCharge(Charge):
    """Every charge between two is as likely."""

    numbers: ClassVar[tuple[str, ...]] = ("least", "most")
    kind: Literal["uniform"] = "uniform"
    least: Density
    most: Density

    @model_validator(mode="after")
    def _ends_are_ordered(self) -> UniformCharge:
        if self.least > self.most:
            raise InputError(f"is {show(self.least)}, above most = {show(self.most)}", path="least", value=self.least)
        return self


class NormalCharge(Charge):
    """The normal distribution."""

    numbers: ClassVar[tuple[str, ...]] = ("mean", "deviation")
    kind: Literal["normal"] = "normal"
    mean: Density
    deviation: Annotated[float, Quantity("", 0.0, MOST, "standard deviation, in C/kg or C/m2")]


class TableCharge(Charge):
    """A measured distribution: cumulative number fraction over charge, linear in between."""

    numbers: ClassVar[tuple[str, ...]] = ("value",)
    kind: Literal["table"] = "table"
    value: Annotated[list[Density], Doc("charges, ascending")]
    fraction: Annotated[
        list[Annotated[float, Quantity("", 0.0, 1.0, "fraction")]],
        Doc("fraction of the grains with no larger charge; ends at 1"),
    ]

    @model_validator(mode="after")
    def _rows_ascend(self) -> TableCharge:
        if len(self.value) != len(self.fraction) or not self.value:
            raise InputError(f"has {len(self.fraction)} fractions for {len(self.value)} charges", path="fraction")
        for name, column in (("value", self.value), ("fraction", self.fraction)):
            if any(after < before for before, after in itertools.pairwise(column)):
                raise InputError("must ascend", path=name, value=column)
        if abs(self.fraction[-1] - 1.0) > 1e-9:
            raise InputError(f"ends at {show(self.fraction[-1])}, must end at 1", path="fraction", value=self.fraction)
        return self

    def parameters(self) -> dict[str, float]:
        return {}


AnyCharge = Annotated[
    ConstantCharge | UniformCharge | NormalCharge | TableCharge,
    Field(discriminator="kind"),
    Doc("law of the charges that grains are fed with"),
]


def _density(text: str, name: str) -> tuple[float, str]:
    """A charge per mass or per surface in SI units, and which of the two."""
    for per, unit in UNITS.items():
        try:
            return to_si(text, unit, -MOST, MOST), per
        except InputError as error:
            if error.allowed:
                raise error.at(name) from None
    raise InputError(
        f"is {show(text)}, must be a charge per mass or per surface such as '-20 nC/g' or '5 uC/m2'",
        path=name,
        value=text,
        allowed="C/kg or C/m2",
    )
