"""Values of a World that a map can lack, each with where it came from."""

from __future__ import annotations

from typing import Literal, get_args

import msgspec

Provenance = Literal["tagged", "inferred", "default"]
"""Said by the map, following from what it says, or neither."""
PROVENANCES: tuple[Provenance, ...] = get_args(Provenance)
"""From the best known to the least."""


PlaceSource = Literal["driven"]
"""Of a lane, or of a path, that lies where the car's own passes were; else it is not told."""


class Quantity(msgspec.Struct, frozen=True):
    """A number and where it came from."""

    value: float
    source: Provenance


class Choice(msgspec.Struct, frozen=True):
    """A word and where it came from."""

    value: str
    source: Provenance
