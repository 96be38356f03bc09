"""The map as read: nodes, ways and relations that matter to a driver, with their tags."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import LocalFrame
from foretwin.world_gen.osm.node_locations import NodeLocations


class MapError(UserError):
    """A map that cannot be used; the message names the file and what is wrong."""


class NoRoadsError(MapError):
    """A map, or what was clipped of one, without a single road."""


class OsmWay(NamedTuple):
    """One way: its id, its nodes in order, its tags."""

    id: int
    nodes: tuple[int, ...]
    tags: Mapping[str, str]


class OsmMember(msgspec.Struct, frozen=True):
    """One member of a relation; `kind` is n, w or r."""

    kind: str
    ref: int
    role: str


class OsmRelation(msgspec.Struct, frozen=True):
    """One relation: its members in order and its tags."""

    id: int
    members: tuple[OsmMember, ...]
    tags: Mapping[str, str]


class LatLonBounds(NamedTuple):
    """A box in degrees; `west` is greater than `east` where it crosses the antimeridian."""

    south: float
    west: float
    north: float
    east: float


class OsmMap(msgspec.Struct, frozen=True, kw_only=True):
    """A map file in memory.

    `locations` holds (lat, lon) of every node of a kept way; `node_tags` the tags of tagged nodes;
    `ways` those with highway, railway, building, building:part, area:highway, barrier tags or in
    a kept relation; `relations` multipolygon buildings and turn restrictions. `frame` is centred
    on the highways; all world_gen geometry of this map starts in it. `notes` say what the reader
    left out or mended, each beginning with the object: `way 10: ...`.
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
    notes: tuple[str, ...] = ()
    note_places: Mapping[str, tuple[float, float]] = msgspec.field(default_factory=dict)
    """(lat, lon) of those notes that are about a place."""

    def notes_within(self, bounds: LatLonBounds) -> tuple[str, ...]:
        """Return the notes about places in a box, the same whether or not the map is a clip."""
        near = (
            note
            for note, (lat, lon) in self.note_places.items()
            if bounds.south <= lat <= bounds.north and bounds.west <= lon <= bounds.east
        )
        return tuple(sorted(near))

    def lat_lon_deg(self, nodes: Sequence[int] | npt.NDArray[np.int64]) -> Array:
        """Return (N, 2) degrees of many nodes at once; KeyError names one without a position."""
        if isinstance(self.locations, NodeLocations):
            return self.locations.of(nodes)
        found = [self.locations[int(node)] for node in nodes]
        return np.array(found, dtype=np.float64).reshape(-1, 2)
