"""From decoded objects to an `OsmMap`: positions looked up, gaps mended, frame laid."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.frames import LocalFrame
from foretwin.world_gen.osm.map_bounds import believed_bounds, bounds_of, centre_of
from foretwin.world_gen.osm.map_file import MapHeader
from foretwin.world_gen.osm.opl import NO_POSITION, UNITS_PER_DEG, NodePositions, WayNodes
from foretwin.world_gen.osm.osm_map import (
    BoolArray,
    IntArray,
    NodeLocations,
    NoRoadsError,
    OsmMap,
    OsmRelation,
    OsmWay,
    rows_of,
)

LONGEST_WAY_DEG = 2.0
"""A way that reaches farther has a node in the wrong place: no street spans 200 km."""
MOST_VISITS = 16
"""A road that passes one of its nodes more often than this is a mistake."""
MOST_NAMED = 3
NO_WAYS = "the map holds none of its ways; left out"


class MapObjects(msgspec.Struct, kw_only=True):
    """What a map file or an index holds for a map; ways in any order, nodes with their ways."""

    way_ids: Sequence[int]
    way_tags: Sequence[Mapping[str, str]]
    way_nodes: WayNodes
    positions: NodePositions
    """Ids ascending, each once."""
    node_tags: Mapping[int, Mapping[str, str]]
    relations: Mapping[int, OsmRelation]
    notes: list[str] = msgspec.field(default_factory=list)
    note_places: Mapping[str, tuple[float, float]] = msgspec.field(default_factory=dict)


def assemble_map(
    objects: MapObjects,
    header: MapHeader,
    *,
    file: str,
    sha256: str,
    frame: LocalFrame | None = None,
) -> OsmMap:
    """Return the map; its frame and bounds are those of its roads unless given.

    Raises `NoRoadsError` where there is no road with positions, `MapError` where roads lie all
    over the Earth.
    """
    table = objects.positions
    is_road = np.array(["highway" in tags for tags in objects.way_tags], dtype=bool)
    sound = sound_ways(objects.way_ids, is_road, objects.way_nodes, table)
    notes = [*objects.notes, *(text for text, _ in sound.notes)]
    note_places = dict(objects.note_places)
    for text, row in sound.notes:
        if row is not None:
            note_places[text] = table.at(row)
    nodes = tuple(sound.nodes.nodes.tolist())
    cuts = [0, *np.cumsum(sound.nodes.counts).tolist()]
    ids = np.array(objects.way_ids, dtype=np.int64)[sound.picked]
    order = np.argsort(ids, kind="stable")
    notes.extend(
        f"way {way}: stands in the file more than once; the last is used"
        for way in ids[order][1:][np.diff(ids[order]) == 0].tolist()
    )
    places = zip(order.tolist(), sound.picked[order].tolist(), strict=True)
    ways = {
        way: OsmWay(way, nodes[cuts[k] : cuts[k + 1]], objects.way_tags[i])
        for way, (k, i) in zip(ids[order].tolist(), places, strict=True)
    }
    of_ways = {k: r for k, r in objects.relations.items() if not ways.keys().isdisjoint(r.way_ids)}
    notes.extend(f"relation {k}: {NO_WAYS}" for k in objects.relations if k not in of_ways)
    used = np.zeros(len(table.ids), dtype=bool)
    used[sound.rows] = True
    tagged = np.array(list(objects.node_tags), dtype=np.int64)
    rows, placed = rows_of(table.ids, tagged)
    used[rows[placed]] = True
    kept = table.rows(used)
    locations = NodeLocations(kept.ids, kept.lat_lon_deg)
    road_nodes = [node for way in ways.values() if "highway" in way.tags for node in way.nodes]
    if not road_nodes:
        raise NoRoadsError(file)
    bounds = header.bounds
    if frame is None or bounds is None:
        box = bounds_of(file, locations.of(road_nodes))
        bounds, words = believed_bounds(header.bounds, box)
        notes.extend(words)
        frame = frame or LocalFrame(centre_of(box))
    return OsmMap(
        file=file,
        sha256=sha256,
        attribution=header.attribution,
        bounds=bounds,
        frame=frame,
        locations=locations,
        node_tags=objects.node_tags,
        ways=ways,
        relations=of_ways,
        notes=tuple(dict.fromkeys(notes)),
        note_places=note_places,
    )


def sorted_positions(chunks: Sequence[NodePositions], notes: list[str]) -> NodePositions:
    """Join chunks of nodes in ascending order of ids, each once and only those on the Earth."""
    found = NodePositions.joined(chunks)
    if len(found.ids) > 1 and not (found.ids[1:] > found.ids[:-1]).all():
        found = found.rows(np.argsort(found.ids, kind="stable"))
        last = np.append(found.ids[1:] != found.ids[:-1], True)
        notes.extend(
            f"node {node}: stands in the file more than once; its last position is used"
            for node in sorted(set(found.ids[~last].tolist()))
        )
        found = found.rows(last)
    there = on_earth(found)
    if there.all():
        return found
    for node, lat, lon in zip(*(column.tolist() for column in found.rows(~there)), strict=True):
        place = f"{lat / UNITS_PER_DEG:g}, {lon / UNITS_PER_DEG:g}"
        fault = "has no position" if lat == NO_POSITION else f"{place} is not on Earth"
        notes.append(f"node {node}: {fault}; left out")
    return found.rows(there)


def on_earth(nodes: NodePositions) -> BoolArray:
    """Return (N,) which of the positions are any on the Earth."""
    lat, lon = np.abs(nodes.lat_1e7), np.abs(nodes.lon_1e7)
    there: BoolArray = (lat <= 90 * UNITS_PER_DEG) & (lon <= 180 * UNITS_PER_DEG)
    return there


class WayNote(NamedTuple):
    """A note on a way, and which of the positions is its first; None where it has none."""

    text: str
    row: int | None


class SoundWays(NamedTuple):
    """The ways that can be used, and what was left out or mended."""

    picked: IntArray
    """Which of the given ways (K,)."""
    nodes: WayNodes
    rows: IntArray
    """Where each of their nodes (M,) stands among the positions."""
    notes: list[WayNote]


def sound_ways(
    way_ids: Sequence[int], is_road: BoolArray, way_nodes: WayNodes, positions: NodePositions
) -> SoundWays:
    """Return ways without gaps, of two and more nodes, with a length that a street can have."""
    nodes, counts = way_nodes
    rows, placed = rows_of(positions.ids, nodes)
    faulty = _faulty(counts, rows, placed, positions)
    begins = np.cumsum(counts) - counts
    kept = np.repeat(~faulty, counts)
    notes: list[WayNote] = []

    def note(i: int, words: str) -> None:
        known = np.flatnonzero(placed[begins[i] : begins[i] + counts[i]])
        row = int(rows[begins[i] + known[0]]) if len(known) else None
        notes.append(WayNote(f"way {way_ids[i]}: {words}", row))

    for i in np.flatnonzero(faulty).tolist():
        at = slice(int(begins[i]), int(begins[i] + counts[i]))
        spots = (
            np.stack([c[rows[at]] for c in positions[1:]], axis=-1) if placed[at].any() else None
        )
        mended = _mended(nodes[at], placed[at], spots)
        if mended.words:
            note(i, mended.words)
        if mended.part is not None:
            kept[at][mended.part] = True
    for i in np.flatnonzero(is_road & (counts > MOST_VISITS)).tolist():
        at = slice(int(begins[i]), int(begins[i] + counts[i]))
        if words := _turns_on_itself(nodes[at].tolist()):
            note(i, f"{words}; left out")
            kept[at] = False
    of_way = np.repeat(np.arange(len(counts)), counts)[kept]
    left = np.bincount(of_way, minlength=len(counts))
    picked = np.flatnonzero(left)
    return SoundWays(picked, WayNodes(nodes[kept], left[picked]), rows[kept], notes)


def _faulty(
    counts: IntArray, rows: IntArray, placed: BoolArray, positions: NodePositions
) -> BoolArray:
    """Return per way whether it has gaps, fewer than two nodes, no length or too much of it."""
    faulty: BoolArray = counts < 2
    filled = np.flatnonzero(counts > 0)
    begins = (np.cumsum(counts) - counts)[filled]
    reach = np.zeros(len(filled), dtype=np.int64)
    for column in positions[1:]:
        values = column[rows] if len(column) else np.zeros(len(rows), dtype=np.int64)
        span = np.maximum.reduceat(values, begins) - np.minimum.reduceat(values, begins)
        reach = np.maximum(reach, span)
    gaps = ~np.logical_and.reduceat(placed, begins)
    faulty[filled] |= gaps | (reach == 0) | (reach > LONGEST_WAY_DEG * UNITS_PER_DEG)
    return faulty


class _Mended(NamedTuple):
    part: slice | None
    words: str


def _mended(nodes: IntArray, placed: BoolArray, spots: IntArray | None) -> _Mended:
    """Return the longest stretch of a way whose nodes are known, or None, and what is lost."""
    absent = nodes[~placed].tolist()
    edges = [-1, *np.flatnonzero(~placed).tolist(), len(nodes)]
    begin, end = max(pairwise(edges), key=lambda pair: pair[1] - pair[0])
    part, count = slice(begin + 1, end), end - begin - 1
    lost = f"the map lacks its {_named(absent)}; " if absent else ""
    if count < 2 or spots is None:
        return _Mended(None, f"{lost or 'has fewer than two nodes; '}left out")
    known = spots[part]
    if (known == known[0]).all():
        return _Mended(None, f"{lost}has no length; left out")
    reach_deg = np.ptp(known, axis=0) / UNITS_PER_DEG
    around = known[:, 1] % (360 * UNITS_PER_DEG)
    reach_deg[1] = min(reach_deg[1], np.ptp(around) / UNITS_PER_DEG)
    near_pole = np.abs(known[:, 0]).max() > 89 * UNITS_PER_DEG
    if (reach_deg[0] if near_pole else reach_deg.max()) > LONGEST_WAY_DEG:
        return _Mended(None, f"{lost}reaches over {reach_deg.max():.0f} degrees; left out")
    return _Mended(part, f"{lost}{count} of its {len(nodes)} nodes are kept" if absent else "")


def _named(nodes: Sequence[int]) -> str:
    some = ", ".join(str(node) for node in nodes[:MOST_NAMED])
    more = f" and {len(nodes) - MOST_NAMED} more" if len(nodes) > MOST_NAMED else ""
    return f"node{'s' if len(nodes) > 1 else ''} {some}{more}"


def _turns_on_itself(nodes: Sequence[int]) -> str:
    if len(nodes) - len(set(nodes)) < MOST_VISITS:
        return ""
    node, visits = Counter(nodes).most_common(1)[0]
    return f"passes node {node} {visits} times" if visits > MOST_VISITS else ""
