"""What it takes to build a World elsewhere than where its map was opened, and what comes back."""

from __future__ import annotations

import msgspec


class MapPart(msgspec.Struct, frozen=True, kw_only=True):
    """What of which map is to be read: all of a small one, of a large one what lies in `bounds`
    (south, west, north, east, degrees) or within `margin_m` of a `node`."""

    map: str
    sha256: str
    """Of the map's bytes: another file of that name is another map."""
    bounds: tuple[float, float, float, float] | None = None
    node: int | None = None
    margin_m: float = 0.0
    service_roads: bool = False
    dem: str | None = None
    """Heights of the ground under it."""


class WantedWorld(msgspec.Struct, frozen=True, kw_only=True):
    """Build the World of this junction of a map."""

    of: MapPart
    junction_id: str
    radius_m: float


class BuiltWorld(msgspec.Struct, frozen=True, kw_only=True):
    """A World as the bytes of its file, or in `failure` why there is none."""

    world_id: str = ""
    data: bytes = b""
    failure: str = ""
    of_input: bool = False
    """The failure is the map's or the heights', and so that of every World."""
    no_map: bool = False
    """The failure is that the map is not where it was to be: whoever has it can build the World."""
