"""Values of a World that a map can lack, each with where it came from."""

from __future__ import annotations

from typing import Literal, get_args

import msgspec

_OfMaps = Literal["tagged", "inferred", "default"]
PlaceSource = Literal["driven"]
"""Of a lane, or of a path, that lies where the car's own passes were; else it is not told."""
Provenance = Literal["tagged", "inferred", "default", "driven"]
"""Said by the map, following from what it says, neither, or learnt from the car's own passes."""
PROVENANCES: tuple[_OfMaps, ...] = get_args(_OfMaps)
"""What a map alone gives, from the best known to the least."""


class Quantity(msgspec.Struct, frozen=True):
    """A number and where it came from."""

    value: float
    source: Provenance


class Choice(msgspec.Struct, frozen=True):
    """A word and where it came from."""

    value: str
    source: Provenance
