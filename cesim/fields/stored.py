"""An array of numbers that a scene holds and its text form carries."""

from __future__ import annotations

import base64
import binascii
import hashlib
import re
import zlib
from typing import Any

import numpy as np
from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from ..errors import InputError, show
from .base import Array

MOST_NODES = 50_000_000
HEAD = re.compile(r"f8 ([0-9]{1,9}) ([0-9]{1,9}) ([0-9]{1,9}) ([A-Za-z0-9+/=]*)")


class StoredArray:
    """A read-only array (nx, ny, nz) of finite doubles, compared by content.

    Its text is "f8 nx ny nz ..." with the bytes of the numbers, little-endian, first byte of each first, packed by
    zlib and written in base64.
    """

    def __init__(self, values: Any) -> None:
        """extremes: the least and the greatest number; digest: SHA-256 of shape and numbers."""
        self.values: Array = np.array(values, dtype="<f8", order="C")
        if self.values.ndim != 3 or not np.isfinite(self.values).all():
            raise InputError("must be finite numbers (nx, ny, nz)")
        self.values.flags.writeable = False
        self.extremes = (float(self.values.min()), float(self.values.max()))
        self.digest = hashlib.sha256(f"{self.values.shape}".encode() + self.values.tobytes()).hexdigest()

    def text(self) -> str:
        """The text form."""
        shuffled = np.ascontiguousarray(self.values.reshape(-1).view(np.uint8).reshape(-1, 8).T).tobytes()
        shape = " ".join(map(str, self.values.shape))
        return f"f8 {shape} {base64.b64encode(zlib.compress(shuffled, 6)).decode()}"

    @classmethod
    def read(cls, given: Any) -> StoredArray:
        """From text, or from anything that is an array."""
        if isinstance(given, StoredArray):
            return given
        if not isinstance(given, str):
            try:
                return cls(given)
            except (TypeError, ValueError):
                raise InputError(f"is {show(given)}, must be an array of numbers") from None
        match = HEAD.fullmatch(given)
        shape = [int(n) for n in match.groups()[:3]] if match else []
        if match is None or not 0 < float(np.prod([float(n) for n in shape])) <= MOST_NODES:
            raise InputError(f"is {show(given)}, not the text of an array")
        size = 8 * int(np.prod(shape))
        try:
            shuffled = zlib.decompressobj().decompress(base64.b64decode(match[4], validate=True), size)
        except (binascii.Error, zlib.error, ValueError):
            shuffled = b""
        if len(shuffled) != size:
            raise InputError(f"is {show(given)}, a damaged array")
        numbers = np.ascontiguousarray(np.frombuffer(shuffled, np.uint8).reshape(8, -1).T).view("<f8")
        return cls(numbers.reshape(shape))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, StoredArray) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"<array {' x '.join(map(str, self.values.shape))}, {self.digest[:8]}>"

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(cls.read)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: Any) -> dict[str, Any]:
        return {"type": "string", "description": "f8 nx ny nz and the packed numbers in base64"}
