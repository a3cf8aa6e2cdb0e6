"""All hard cases, by id."""

from __future__ import annotations

from . import (
    charges,
    clusters,
    crowds,
    flight,
    impacts,
    invariance,
    overlaps,
    riding,
    robustness,
    stacks,
    towers,
    tunnelling,
)
from .rows import Case

ROOMS = (
    charges,
    stacks,
    impacts,
    overlaps,
    tunnelling,
    crowds,
    invariance,
    robustness,
    flight,
    riding,
    clusters,
    towers,
)

CASES: tuple[Case, ...] = tuple(sorted((case for room in ROOMS for case in room.CASES), key=lambda case: case.id))
