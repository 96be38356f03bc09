"""The map as read: nodes, ways and relations that matter to a driver, with their tags."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import LocalFrame

IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


class MapError(UserError):
    """A map that cannot be used; the message names the file and what is wrong."""


class NoRoadsError(MapError):
    """A map, or what was clipped of one, without a single road."""

    def __init__(self, file: str) -> None:
        super().__init__(
            f"{file}: the map holds no roads (no way with a highway tag and positions)"
        )


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

    @property
    def way_ids(self) -> list[int]:
        """Ids of the members that are ways."""
        return [member.ref for member in self.members if member.kind == "w"]


class LatLonBounds(NamedTuple):
    """A box in degrees; `west` is greater than `east` where it crosses the antimeridian."""

    south: float
    west: float
    north: float
    east: float


class NodeLocations(Mapping[int, tuple[float, float]]):
    """(lat, lon) in degrees by node id, kept as arrays: ids (N,) ascending, positions (N, 2)."""

    def __init__(self, ids: IntArray, lat_lon_deg: Array) -> None:
        self.ids = ids
        self.lat_lon_deg = lat_lon_deg

    def of(self, nodes: Sequence[int] | IntArray) -> Array:
        """Return (M, 2) degrees of `nodes` (M,); KeyError names one that is not there."""
        wanted = np.asarray(nodes, dtype=np.int64)
        rows, known = rows_of(self.ids, wanted)
        if not known.all():
            raise KeyError(int(wanted[~known][0]))
        found: Array = self.lat_lon_deg[rows]
        return found

    def __getitem__(self, node: int) -> tuple[float, float]:
        lat, lon = self.of([node])[0].tolist()
        return lat, lon

    def __iter__(self) -> Iterator[int]:
        return iter(self.ids.tolist())

    def __len__(self) -> int:
        return len(self.ids)


def rows_of(ids: IntArray, wanted: IntArray) -> tuple[IntArray, BoolArray]:
    """Return where `wanted` (M,) stand among ascending `ids` (N,), and whether they do, (M,)."""
    if not len(ids):
        return np.zeros(len(wanted), dtype=np.int64), np.zeros(len(wanted), dtype=bool)
    rows = np.minimum(np.searchsorted(ids, wanted), len(ids) - 1)
    return rows, ids[rows] == wanted


class OsmMap(msgspec.Struct, frozen=True, kw_only=True):
    """A map file in memory.

    `locations` holds (lat, lon) of every node of a kept way; `node_tags` the tags of tagged nodes;
    `ways` those with highway, railway, building, building:part, area:highway, barrier tags or in
    a kept relation; `relations` multipolygon buildings and turn restrictions. `frame` is centred
    on the highways; all world_gen geometry of this map starts in it. `notes` are what the reader
    left out or mended, each beginning with the object: `way 10: ...`.
    """

    file: str
    sha256: str
    attribution: str
    bounds: LatLonBounds
    frame: LocalFrame
    locations: NodeLocations
    node_tags: Mapping[int, Mapping[str, str]]
    ways: Mapping[int, OsmWay]
    relations: Mapping[int, OsmRelation]
    notes: tuple[str, ...] = ()
    note_places: Mapping[str, tuple[float, float]] = msgspec.field(default_factory=dict)
    """(lat, lon) of those notes that are about a place."""

    def points_of(self, lines: Sequence[Sequence[int]]) -> tuple[Array, IntArray]:
        """Return (P, 2) degrees of lines of nodes, one line after the other, and where each of the
        L lines begins, and the last ends, (L + 1,)."""
        first = np.cumsum([0, *map(len, lines)])
        nodes = np.fromiter(chain.from_iterable(lines), dtype=np.int64, count=int(first[-1]))
        return self.locations.of(nodes), first

    def notes_within(self, bounds: LatLonBounds) -> tuple[str, ...]:
        """Return the notes about places in a box, the same whether or not the map is a clip."""
        south, west, north, east = bounds
        places = self.note_places.items()
        near = (n for n, (lat, lon) in places if south <= lat <= north and west <= lon <= east)
        return tuple(sorted(near))


def boxes_deg(lat_lon_deg: Array, first: IntArray) -> Array:
    """Return (L, 4) south, west, north and east of lines of points as of `OsmMap.points_of`."""
    low, high = (f.reduceat(lat_lon_deg, first[:-1], axis=0) for f in (np.minimum, np.maximum))
    return np.concatenate([low, high], axis=1)
