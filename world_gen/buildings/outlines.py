"""Outlines of a map's buildings: a table of rings, from which polygons are made when asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import Polygon

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import local_from_geo
from foretwin.world_gen.buildings.tags import is_part, stands_above_ground
from foretwin.world_gen.osm.osm_map import OsmMap, OsmRelation, boxes_deg

MIN_PIECE_M2 = 0.05
"""Smaller pieces of a mended outline are left out."""

Indices = npt.NDArray[np.intp]


class OutlineTable(msgspec.Struct, frozen=True, kw_only=True):
    """Every building and building part of a map, as it stands there.

    Entry `k` is made of the rings from `first_ring[k]` to before `first_ring[k + 1]`: one for a
    way, one for each member of a relation. Ring `r` has the points from `first_point[r]` to before
    `first_point[r + 1]` of `latlon_deg` (N, 2). `boxes_deg` (K, 4) holds south, west, north, east.
    """

    names: tuple[str, ...]
    tags: tuple[Mapping[str, str], ...]
    is_part: tuple[bool, ...]
    is_way: npt.NDArray[np.bool_]
    first_ring: Indices
    inner: npt.NDArray[np.bool_]
    first_point: Indices
    latlon_deg: Array
    boxes_deg: Array
    notes: tuple[str, ...]


class BuildingOutlines(NamedTuple):
    """Polygons (M,), the entry asked for that each belongs to (M,), and what had to be mended.

    `owner` and the keys of `notes` count the entries as they were asked for; `owner` ascends.
    """

    polygons: npt.NDArray[np.object_]
    owner: Indices
    notes: Mapping[int, str]


def outline_table(osm: OsmMap) -> OutlineTable:
    """Collect a map's buildings: relations in the order of their ids, then ways in theirs.

    What cannot be an outline is left out and named in the table's notes.
    """
    notes: list[str] = []
    names: list[str] = []
    tags: list[Mapping[str, str]] = []
    rings: list[Sequence[int]] = []
    inner: list[bool] = []
    first_ring = [0]
    taken: set[int] = set()
    for relation in _building_relations(osm, notes):
        taken.update(m.ref for m in relation.members if m.kind == "w" and m.role != "inner")
        members = _members(osm, relation, notes)
        if members:
            names.append(f"r{relation.id}")
            tags.append(relation.tags)
            inner.extend(member_is_inner for member_is_inner, _ in members)
            rings.extend(nodes for _, nodes in members)
            first_ring.append(len(rings))
    relations = len(names)
    for way in osm.ways.values():
        about = way.tags
        if "building" not in about and "building:part" not in about:
            continue
        if way.id in taken and not is_part(about):
            continue
        nodes = way.nodes
        if not stands_above_ground(about):
            if about.get("building", "no") != "no" and "layer" in about:
                notes.append(f"way {way.id}: building below the road; left out")
            continue
        if nodes[0] != nodes[-1] or len(nodes) < 4:
            why = "is not closed" if nodes[0] != nodes[-1] else "has fewer than three corners"
            notes.append(f"way {way.id}: building outline {why}; left out")
            continue
        names.append(f"w{way.id}")
        tags.append(about)
        rings.append(nodes)
        inner.append(False)
        first_ring.append(len(rings))
    latlon, first_point = osm.points_of(rings)
    return OutlineTable(
        names=tuple(names),
        tags=tuple(tags),
        is_part=tuple(is_part(t) for t in tags),
        is_way=np.arange(len(names)) >= relations,
        first_ring=np.array(first_ring, dtype=np.intp),
        inner=np.array(inner, dtype=bool),
        first_point=first_point,
        latlon_deg=latlon,
        boxes_deg=boxes_deg(latlon, first_point[np.array(first_ring, dtype=np.intp)]),
        notes=tuple(notes),
    )


def _building_relations(osm: OsmMap, notes: list[str]) -> list[OsmRelation]:
    found = []
    for relation in osm.relations.values():
        if relation.tags.get("type") != "multipolygon":
            continue
        if stands_above_ground(relation.tags):
            found.append(relation)
        elif relation.tags.get("building", "no") != "no":
            notes.append(f"relation {relation.id}: building below the road; left out")
    return sorted(found, key=lambda relation: relation.id)


def _members(
    osm: OsmMap, relation: OsmRelation, notes: list[str]
) -> list[tuple[bool, Sequence[int]]]:
    found: list[tuple[bool, Sequence[int]]] = []
    for member in relation.members:
        if member.kind != "w" or member.role in ("part", "outline"):
            continue
        way = osm.ways.get(member.ref)
        if way is None or len(way.nodes) < 2:
            notes.append(f"relation {relation.id}: way {member.ref} is missing in the map")
            continue
        found.append((member.role == "inner", way.nodes))
    return found


def outlines(osm: OsmMap, table: OutlineTable, entries: Indices) -> BuildingOutlines:
    """Return the polygons of entries of a table in the map's frame, mended where they need it."""
    single = table.is_way[entries]
    at = np.flatnonzero(single)
    xy, ring = _projected(osm, table, table.first_ring[entries[at]])
    polygons = shapely.polygons(shapely.linearrings(xy, indices=ring))
    sound = shapely.is_valid(polygons)
    found: list[tuple[int, shapely.Geometry]] = []
    notes: dict[int, str] = {}
    for k, polygon in zip(at[~sound].tolist(), polygons[~sound].tolist(), strict=True):
        pieces = valid_polygons(shapely.make_valid(polygon))
        found.extend((k, piece) for piece in pieces)
        notes[k] = "outline crosses itself; mended" if pieces else "encloses no area; left out"
    for k in np.flatnonzero(~single).tolist():
        pieces, notes[k] = _relation_outline(osm, table, int(entries[k]))
        found.extend((k, piece) for piece in pieces)
    owner = np.concatenate([at[sound], np.array([k for k, _ in found], dtype=np.intp)])
    order = np.argsort(owner, kind="stable")
    odd = np.empty(len(found), dtype=object)
    odd[:] = [polygon for _, polygon in found]
    return BuildingOutlines(np.concatenate([polygons[sound], odd])[order], owner[order], notes)


def _projected(osm: OsmMap, table: OutlineTable, rings: Indices) -> tuple[Array, Indices]:
    """Return the points of rings in the map's frame, and which of the rings each belongs to."""
    counts = table.first_point[rings + 1] - table.first_point[rings]
    owner = np.repeat(np.arange(len(rings)), counts)
    offset = table.first_point[rings] - (np.cumsum(counts) - counts)
    latlon = table.latlon_deg[np.arange(len(owner)) + offset[owner]]
    return local_from_geo(osm.frame, latlon[:, 0], latlon[:, 1]), owner


def valid_polygons(shape: shapely.Geometry) -> list[Polygon]:
    """Return the polygons of a shape, made valid, without those smaller than `MIN_PIECE_M2`."""
    if not shape.is_valid:
        shape = shapely.make_valid(shape)
    parts = shapely.get_parts(shape)
    while any(part.geom_type.startswith(("Multi", "Geom")) for part in parts):
        parts = shapely.get_parts(parts)
    return [p for p in parts if isinstance(p, Polygon) and p.area >= MIN_PIECE_M2]


def _relation_outline(osm: OsmMap, table: OutlineTable, entry: int) -> tuple[list[Polygon], str]:
    """Return a multipolygon's areas, joined end to end from pieces of rings, and what is amiss."""
    rings = np.arange(table.first_ring[entry], table.first_ring[entry + 1])
    xy, owner = _projected(osm, table, rings)
    lines = shapely.linestrings(xy, indices=owner)
    outer, crossing = _closed_areas(lines[~table.inner[rings]])
    if not outer:
        return [], "outline does not close; left out"
    area = shapely.union_all(outer)
    inner, _ = _closed_areas(lines[table.inner[rings]])
    if inner:
        area = shapely.difference(area, shapely.union_all(inner))
    return valid_polygons(area), "outline crosses itself; mended" if crossing else ""


def _closed_areas(lines: npt.NDArray[np.object_]) -> tuple[list[Polygon], bool]:
    """Return the areas that lines enclose, and whether a line crosses itself."""
    if not len(lines):
        return [], False
    noded = shapely.union_all(lines)
    found = [p for p in shapely.polygonize([noded]).geoms if p.area > 0.0]
    return found, not shapely.is_simple(lines).all()
