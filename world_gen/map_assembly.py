"""From decoded objects to an `OsmMap`: positions looked up, gaps mended, frame laid."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise

import numpy as np

from contracts.frames import GeoPoint, LocalFrame
from world_gen.node_locations import NodeLocations
from world_gen.opl import NO_POSITION, IntArray, NodePositions, WayNodes
from world_gen.osm_map import LatLonBounds, MapError, OsmMap, OsmRelation, OsmWay

UNITS_PER_DEG = 10_000_000
LONGEST_WAY_DEG = 2.0
"""A way that reaches farther has a node in the wrong place: no street spans 200 km."""
WIDEST_MAP_DEG = 60.0
"""One plane of metres serves no more of the Earth than this."""
MOST_VISITS = 16
"""A road that passes one of its nodes more often than this is a mistake."""
MOST_NAMED = 3


@dataclass(slots=True, kw_only=True)
class MapObjects:
    """What a map file or an index holds for a map; ways in any order, nodes with their ways."""

    way_ids: Sequence[int]
    way_tags: Sequence[Mapping[str, str]]
    way_nodes: WayNodes
    positions: NodePositions
    """Ids ascending, each once."""
    node_tags: Mapping[int, Mapping[str, str]]
    relations: Mapping[int, OsmRelation]
    notes: list[str] = field(default_factory=list)


def assemble_map(
    objects: MapObjects,
    *,
    file: str,
    sha256: str,
    attribution: str,
    bounds: LatLonBounds | None,
    frame: LocalFrame | None = None,
) -> OsmMap:
    """Return the map; `frame` and `bounds` are those of its roads unless given.

    Raises `MapError` where there is no road with positions, or roads all over the Earth.
    """
    notes = objects.notes
    table = objects.positions
    rows, placed = _rows_of(table, objects.way_nodes.nodes)
    ways: dict[int, OsmWay] = {}
    used = np.zeros(len(table.ids), dtype=bool)
    node_ids = objects.way_nodes.nodes.tolist()
    ends = list(accumulate(objects.way_nodes.counts.tolist(), initial=0))
    faults = _faulty(objects, rows, placed)
    order = sorted(range(len(objects.way_ids)), key=objects.way_ids.__getitem__)
    for i in order:
        way_id, begin, end = objects.way_ids[i], ends[i], ends[i + 1]
        nodes = tuple(node_ids[begin:end])
        if faults[i]:
            at = slice(begin, end)
            part = _mended(way_id, nodes, placed[at], _spots(table, rows[at]), notes)
            if part is None:
                continue
            nodes = nodes[part]
            used[rows[at][part]] = True
        elif way_id in ways:
            notes.append(f"way {way_id}: stands in the file more than once; the last is used")
        tags = objects.way_tags[i]
        if (
            len(nodes) > MOST_VISITS
            and "highway" in tags
            and _turns_on_itself(way_id, nodes, notes)
        ):
            continue
        ways[way_id] = OsmWay(way_id, nodes, tags)
    sound = np.repeat(~faults, objects.way_nodes.counts)
    used[rows[sound & placed]] = True
    tagged_rows, tagged_placed = _rows_of(table, np.array(list(objects.node_tags), dtype=np.int64))
    used[tagged_rows[tagged_placed]] = True
    lat_lon = np.stack([table.lat_1e7[used], table.lon_1e7[used]], axis=-1) / UNITS_PER_DEG
    locations = NodeLocations(table.ids[used], lat_lon)
    road_nodes = [node for way in ways.values() if "highway" in way.tags for node in way.nodes]
    if not road_nodes:
        raise MapError(f"{file}: the map holds no roads (no way with a highway tag and positions)")
    if frame is None or bounds is None:
        box = bounds_of(file, locations.of(road_nodes))
        bounds = bounds or box
        frame = frame or LocalFrame(centre_of(box))
    return OsmMap(
        file=file, sha256=sha256, attribution=attribution, bounds=bounds, frame=frame,
        locations=locations, node_tags=objects.node_tags, ways=ways, relations=objects.relations,
        notes=tuple(dict.fromkeys(notes)),
    )  # fmt: skip


def sorted_positions(chunks: Sequence[NodePositions], notes: list[str]) -> NodePositions:
    """Join chunks of nodes in ascending order of ids, each once and only those on the Earth."""
    ids, lat, lon = (
        np.concatenate([np.empty(0, dtype=np.int64), *columns])
        for columns in zip(*chunks, strict=True)
    ) if chunks else (np.empty(0, dtype=np.int64),) * 3  # fmt: skip
    if len(ids) > 1 and not (ids[1:] > ids[:-1]).all():
        order = np.argsort(ids, kind="stable")
        ids, lat, lon = ids[order], lat[order], lon[order]
        last = np.append(ids[1:] != ids[:-1], True)
        notes.extend(
            f"node {node}: stands in the file more than once; its last position is used"
            for node in np.unique(ids[~last]).tolist()
        )
        ids, lat, lon = ids[last], lat[last], lon[last]
    on_earth = (np.abs(lat) <= 90 * UNITS_PER_DEG) & (np.abs(lon) <= 180 * UNITS_PER_DEG)
    if not on_earth.all():
        for i in np.flatnonzero(~on_earth).tolist():
            place = f"{lat[i] / UNITS_PER_DEG:g}, {lon[i] / UNITS_PER_DEG:g}"
            said = "has no position" if lat[i] == NO_POSITION else f"{place} is not on Earth"
            notes.append(f"node {ids[i]}: {said}; left out")
        ids, lat, lon = ids[on_earth], lat[on_earth], lon[on_earth]
    return NodePositions(ids, lat, lon)


def _rows_of(table: NodePositions, nodes: IntArray) -> tuple[IntArray, np.ndarray]:
    if not len(table.ids):
        return np.zeros(len(nodes), dtype=np.int64), np.zeros(len(nodes), dtype=bool)
    rows = np.minimum(np.searchsorted(table.ids, nodes), len(table.ids) - 1)
    return rows, table.ids[rows] == nodes


def _spots(table: NodePositions, rows: IntArray) -> IntArray:
    return np.stack([table.lat_1e7[rows], table.lon_1e7[rows]], axis=-1)


def _faulty(objects: MapObjects, rows: IntArray, placed: np.ndarray) -> np.ndarray:
    """Return per way whether it has gaps, fewer than two nodes, no length or too much of it."""
    counts = objects.way_nodes.counts
    faulty = counts < 2
    if not len(rows):
        return faulty
    filled = np.flatnonzero(counts > 0)
    begins = (np.cumsum(counts) - counts)[filled]
    reach = np.zeros(len(filled), dtype=np.int64)
    table = objects.positions
    for column in (table.lat_1e7, table.lon_1e7):
        values = column[rows] if len(column) else np.zeros(len(rows), dtype=np.int64)
        span = np.maximum.reduceat(values, begins) - np.minimum.reduceat(values, begins)
        reach = np.maximum(reach, span)
    gaps = ~np.logical_and.reduceat(placed, begins)
    faulty[filled] |= gaps | (reach == 0) | (reach > LONGEST_WAY_DEG * UNITS_PER_DEG)
    return faulty


def _mended(
    way_id: int, nodes: tuple[int, ...], placed: np.ndarray, spots: IntArray, notes: list[str]
) -> slice | None:
    """Return the longest stretch of a way whose nodes are known, or None; say what is lost."""
    absent = [node for node, there in zip(nodes, placed.tolist(), strict=True) if not there]
    edges = [-1, *np.flatnonzero(~placed).tolist(), len(nodes)]
    begin, end = max(pairwise(edges), key=lambda pair: pair[1] - pair[0])
    part = slice(begin + 1, end)
    if absent:
        lost = f"way {way_id}: the map lacks its {_named(absent)}"
        if end - begin - 1 < 2:
            notes.append(f"{lost}; left out")
            return None
        notes.append(f"{lost}; {end - begin - 1} of its {len(nodes)} nodes are kept")
    elif len(nodes) < 2:
        notes.append(f"way {way_id}: has fewer than two nodes; left out")
        return None
    known = spots[part]
    if (known == known[0]).all():
        notes.append(f"way {way_id}: has no length; left out")
        return None
    reach = np.ptp(known, axis=0) / UNITS_PER_DEG
    reach[1] = min(reach[1], np.ptp(known[:, 1] % (360 * UNITS_PER_DEG)) / UNITS_PER_DEG)
    if reach.max() > LONGEST_WAY_DEG and np.abs(known[:, 0]).max() < 89 * UNITS_PER_DEG:
        notes.append(f"way {way_id}: reaches over {reach.max():.0f} degrees; left out")
        return None
    return part


def _named(nodes: Sequence[int]) -> str:
    some = ", ".join(str(node) for node in nodes[:MOST_NAMED])
    more = f" and {len(nodes) - MOST_NAMED} more" if len(nodes) > MOST_NAMED else ""
    return f"node{'s' if len(nodes) > 1 else ''} {some}{more}"


def _turns_on_itself(way_id: int, nodes: tuple[int, ...], notes: list[str]) -> bool:
    if len(nodes) - len(set(nodes)) < MOST_VISITS:
        return False
    node, visits = Counter(nodes).most_common(1)[0]
    if visits <= MOST_VISITS:
        return False
    notes.append(f"way {way_id}: passes node {node} {visits} times; left out")
    return True


def bounds_of(file: str, lat_lon_deg: np.ndarray) -> LatLonBounds:
    """Return the box around positions (N, 2); across the antimeridian where that is narrower.

    Raises `MapError` where it is too wide for one plane.
    """
    lat, lon = lat_lon_deg[:, 0], lat_lon_deg[:, 1]
    west, east = float(lon.min()), float(lon.max())
    if east - west > 180.0:
        beyond = np.where(lon < 0.0, lon + 360.0, lon)
        if np.ptp(beyond) < east - west:
            west, east = float(beyond.min()), float(beyond.max()) - 360.0
    box = LatLonBounds(float(lat.min()), west, float(lat.max()), east)
    width_deg = (east - west) % 360.0
    near_pole = max(abs(box.south), abs(box.north)) > 89.0
    if max(0.0 if near_pole else width_deg, box.north - box.south) > WIDEST_MAP_DEG:
        raise MapError(
            f"{file}: its roads reach over {width_deg:.0f} by {box.north - box.south:.0f} degrees; "
            f"cut out a region of less than {WIDEST_MAP_DEG:.0f}"
        )
    return box


def centre_of(box: LatLonBounds) -> GeoPoint:
    """Return the middle of a box, its longitude within ±180 degrees."""
    width_deg = (box.east - box.west) % 360.0 if box.west > box.east else box.east - box.west
    middle = box.west + width_deg / 2.0 if box.west > box.east else (box.west + box.east) / 2.0
    return GeoPoint((box.south + box.north) / 2.0, middle - 360.0 if middle > 180.0 else middle)
