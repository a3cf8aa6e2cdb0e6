"""Quantities: a plain SI number or text with a unit goes in, an SI float comes out; and models made of them.

pint is imported when the first text with a unit is read, never before.
"""

from __future__ import annotations

import inspect
import math
import numbers
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, ValidationError, ValidationInfo, model_validator
from pydantic_core import CoreSchema, core_schema

from .errors import InputError, join_path, number, show, unknown, with_unit

# A number, then a unit. Kept this narrow so that reading text can neither run nor compute anything.
TEXT = re.compile(
    r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?)\s*([^0-9].*|(?<=\s)1\s*/.*)?", re.DOTALL
)
UNIT = re.compile(r"[A-Za-z0-9µμΩ°%²³·*/^() +-]{1,40}")
LARGE_POWER = re.compile(r"[0-9]{2,}|[*^]\s*[-+(]*\s*[A-Za-z0-9]+\s*(\*\*|\^)")


def to_si(value: object, unit: str, least: float = -math.inf, most: float = math.inf) -> float:
    """A quantity as a float in the SI unit given.

    Parameters
    ----------
    value : number or str
        A plain number is in the unit already; text is a number with any unit of the same kind ("45 rpm", "0.9 mm").
    unit : str
        The SI unit, "" for a pure number. An angle is not a pure number: "Hz" is no unit of "rad/s".
    least, most : float
        Legal range, both ends included.
    """
    result = _parse(value, unit) if isinstance(value, str) else _plain(value, unit)
    if not math.isfinite(result):
        raise InputError(f"is {show(value)}, must be finite", value=value, unit=unit)
    if not least <= result <= most:
        allowed = with_unit(f"[{number(least)}, {number(most)}]", unit)
        raise InputError(
            f"is {with_unit(number(result), unit)}, outside {allowed}", value=value, unit=unit, allowed=allowed
        )
    return result


def _plain(value: object, unit: str) -> float:
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            return math.inf
    allowed = f"a number in {unit}, or text with a unit such as '1 {unit}'" if unit else "a number"
    raise InputError(f"is {show(value)}, must be {allowed}", value=value, unit=unit, allowed=allowed)


def _parse(text: str, unit: str) -> float:
    match = TEXT.fullmatch(text)
    if match is None:
        allowed = f"a number with a unit such as '1 {unit}'" if unit else "a number"
        raise InputError(f"is {show(text)}, must be {allowed}", value=text, unit=unit, allowed=allowed)
    magnitude, given = float(match[1]), (match[2] or "").strip()
    if not given and unit:
        raise InputError(f"is {show(text)}: the unit is missing, e.g. '{match[1]} {unit}'", value=text, unit=unit)
    try:
        factor = conversion(given, unit)
    except InputError as error:
        error.reason, error.value = f"is {show(text)}: {error.reason}", text
        raise
    # 1/0.001 is exact where 0.001 is not: "1.1 mm" becomes 0.0011 to the last bit.
    return magnitude * factor if factor >= 1.0 else magnitude / (1.0 / factor)


@lru_cache(maxsize=1)
def registry() -> Any:
    """The pint registry that every quantity shares."""
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=1024)
def conversion(given: str, unit: str) -> float:
    """How many of the SI unit one of the given unit is."""
    if given == unit:
        return 1.0
    factor, kind = _root(given)
    si_factor, si_kind = _root(unit)
    if kind != si_kind:
        raise InputError(f"{given!r} cannot be converted to {unit or 'a pure number'}", unit=unit)
    return factor / si_factor


def _root(unit: str) -> tuple[float, object]:
    """Size of a unit in root units, in which an angle differs from a pure number."""
    if not unit:
        return 1.0, registry().Unit("")
    if UNIT.fullmatch(unit) is None or LARGE_POWER.search(unit):
        raise InputError(f"{show(unit)} is not a unit")
    expression = re.sub(r"([A-Za-zµμΩ])([0-9])", r"\1**\2", unit.replace("·", "*"))
    quantity = registry().Quantity
    try:
        parsed = registry().parse_units(expression)
        one, zero = (quantity(magnitude, parsed).to_root_units() for magnitude in (1.0, 0.0))
    except Exception:  # pint fails in many ways on text that is no unit; to the user they are one
        raise InputError(f"{show(unit)} is not a known unit") from None
    if zero.magnitude != 0.0 or not one.magnitude > 0.0:
        raise InputError(f"{unit!r} has an offset or a logarithm and cannot be used here")
    return float(one.magnitude), one.units


# ---- fields of models ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Quantity:
    """Declares a float field once: unit, legal range, meaning. Used as Annotated[float, Quantity(...)]."""

    unit: str
    least: float
    most: float
    doc: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.parse, core_schema.float_schema())

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: Any) -> dict[str, Any]:
        plain = {"type": "number", "minimum": self.least, "maximum": self.most}
        return {"anyOf": [plain, {"type": "string"}], "description": self.line}

    def parse(self, value: object) -> float:
        return to_si(value, self.unit, self.least, self.most)

    @property
    def line(self) -> str:
        return f"{self.doc} [{with_unit(f'{number(self.least)} to {number(self.most)}', self.unit)}]"


@dataclass(frozen=True)
class Whole:
    """Declares a field that is a whole number. Used as Annotated[int, Whole(...)]."""

    least: int
    most: int
    doc: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(
            self.parse, core_schema.int_schema(ge=self.least, le=self.most)
        )

    def parse(self, value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, numbers.Integral):
            raise InputError(f"is {show(value)}, must be a whole number", value=value, allowed=self.allowed)
        whole = int(value)
        if not self.least <= whole <= self.most:
            raise InputError(f"is {show(whole)}, outside {self.allowed}", value=value, allowed=self.allowed)
        return whole

    @property
    def allowed(self) -> str:
        return f"[{self.least}, {self.most}]"

    @property
    def line(self) -> str:
        return f"{self.doc} [{self.least} to {self.most}]"


@dataclass(frozen=True)
class Doc:
    """The meaning of a field that is no number."""

    doc: str

    @property
    def line(self) -> str:
        return self.doc


class Part(BaseModel):
    """A branch of the scene tree: unknown keys are errors, assignment is checked at once, errors are InputErrors."""

    model_config = ConfigDict(extra="forbid", validate_assignment=True, defer_build=True, populate_by_name=True)
    where: ClassVar[str] = ""  # path of such a part in the tree, for errors at assignment

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        cls.__doc__ = f"{inspect.cleandoc(cls.__doc__ or '')}\n\nParameters\n----------\n{_parameters(cls)}"

    def __init__(self, **data: Any) -> None:
        with _input_errors(type(self)):
            super().__init__(**data)

    # Branches inside a tree are built by pydantic-core; only the outermost call comes through here.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in type(self).model_fields and not isinstance(getattr(type(self), name, None), property):
            raise unknown("key", name, self.field_names()).at(self.where)
        before = dict(self.__dict__)
        try:
            with _input_errors(type(self)):
                super().__setattr__(name, value)
        except InputError:
            self.__dict__.update(before)  # a rule over several fields is checked after the field was set
            raise

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Any:
        with _input_errors(cls):
            return super().model_validate(obj, **options)

    @classmethod
    def field_names(cls) -> list[str]:
        """Names of the fields, as they stand in a file."""
        return [field.alias or name for name, field in cls.model_fields.items()]

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any, info: ValidationInfo) -> Any:
        if isinstance(data, Mapping):
            known = cls.field_names()
            for key in data:
                if key not in known and key not in cls.model_fields:
                    raise unknown("key", key, known)
        return data


def _parameters(part: type[Part]) -> str:
    lines = []
    for name, field in part.model_fields.items():
        declared = [item for item in _metadata(field) if isinstance(item, Quantity | Whole | Doc)]
        plain = not field.is_required() and field.default_factory is None
        default = f", default {show(field.default)}" if plain else ""
        kind = {Quantity: "quantity", Whole: "int"}.get(type(declared[0]), "") if declared else ""
        lines.append(f"{field.alias or name}{' : ' if kind else ''}{kind}{default if kind else ''}")
        lines += [f"    {item.line}" for item in declared[:1]]
    return "\n".join(lines)


def _metadata(field: Any) -> Iterator[Any]:
    yield from field.metadata
    for argument in getattr(field.annotation, "__args__", ()):
        yield from getattr(argument, "__metadata__", ())


# ---- pydantic's errors -> InputError -------------------------------------------------------------------------------

TAGGED = ("size", "motion", "shape", "charge", "field")  # hold one of several models: pydantic puts the tag behind them
TAGGED_TABLES = ("shapes", "charges")  # and such that hold them by name


@contextmanager
def _input_errors(part: type[Part]) -> Iterator[None]:
    try:
        yield
    except ValidationError as error:
        raise _input_error(error, part) from None


def _input_error(error: ValidationError, part: type[Part]) -> InputError:
    where, first = part.where, error.errors(include_url=False)[0]
    location: list[str | int] = []
    before: str | int = ""
    previous: str | int = ""
    for step in first["loc"]:
        if (previous not in TAGGED and before not in TAGGED_TABLES) or isinstance(step, int):
            location.append(step)
        before, previous = previous, step
    if location and location[0] in part.model_fields:
        location[0] = part.model_fields[str(location[0])].alias or location[0]
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, InputError):
        return cause.at(where, *location)
    value = first["input"]
    if first["type"] == "missing":
        return InputError("is missing", path=join_path(where, *location))
    allowed = str(first.get("ctx", {}).get("expected") or first.get("ctx", {}).get("expected_tags") or "")
    rule = f"must be {allowed}" if allowed else first["msg"][0].lower() + first["msg"][1:]
    return InputError(f"is {show(value)}, {rule}", path=join_path(where, *location), value=value, allowed=allowed)
