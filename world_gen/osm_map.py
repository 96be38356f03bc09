"""The map as read: nodes, ways and relations that matter to a driver, with their tags."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from contracts.errors import UserError
from contracts.frames import LocalFrame


class MapError(UserError):
    """A map that cannot be used; the message names the file and what is wrong."""


@dataclass(frozen=True, slots=True)
class OsmWay:
    """One way: its id, its nodes in order, its tags."""

    id: int
    nodes: tuple[int, ...]
    tags: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class OsmMember:
    """One member of a relation; `kind` is n, w or r."""

    kind: str
    ref: int
    role: str


@dataclass(frozen=True, slots=True)
class OsmRelation:
    """One relation: its members in order and its tags."""

    id: int
    members: tuple[OsmMember, ...]
    tags: Mapping[str, str]


class LatLonBounds(NamedTuple):
    """A box in degrees."""

    south: float
    west: float
    north: float
    east: float


@dataclass(frozen=True, slots=True, kw_only=True)
class OsmMap:
    """A map file in memory.

    `locations` holds (lat, lon) of every node of a kept way; `node_tags` the tags of tagged nodes;
    `ways` those with highway, railway, building, building:part, area:highway, barrier tags or in
    a kept relation; `relations` multipolygon buildings and turn restrictions. `frame` is centred
    on the highways; all world_gen geometry of this map starts in it.
    """

    file: str
    sha256: str
    attribution: str
    bounds: LatLonBounds
    frame: LocalFrame
    locations: Mapping[int, tuple[float, float]]
    node_tags: Mapping[int, Mapping[str, str]]
    ways: Mapping[int, OsmWay]
    relations: Mapping[int, OsmRelation]
