"""Buildings: footprints with courtyards, heights from tags, and their convex parts."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from contracts.arrays import Array
from contracts.frames import LocalFrame, local_from_geo, target_from_source
from contracts.world import Building, Quantity
from world_gen.osm_map import OsmMap, OsmRelation
from world_gen.polyline import without_repeats

LEVEL_HEIGHT_M = 3.0
DEFAULT_HEIGHT_M = 6.0
MAX_HEIGHT_M = 900.0
GRID_M = 0.001
"""Outlines are written in millimetres."""
SILHOUETTE_TOLERANCE_M = 0.25
_FEET = re.compile(r"^\s*(\d+)\s*'\s*(?:(\d+)\s*\")?\s*$")
_METRES = re.compile(r"^\s*(\d+(?:[.,]\d+)?)\s*(?:m|metres?|meters?)?\s*$")


class Footprint(NamedTuple):
    """A building in the map's frame."""

    id: str
    polygon: Polygon
    height_m: Quantity
    min_height_m: float
    is_part: bool


def height_in_m(text: str | None) -> float | None:
    """Return a height tag such as `12`, `12.5 m` or `40'6"` in metres, else None."""
    if not text:
        return None
    if found := _METRES.match(text):
        value = float(found[1].replace(",", "."))
    elif found := _FEET.match(text):
        value = 0.3048 * (int(found[1]) + int(found[2] or 0) / 12.0)
    else:
        return None
    return value if 0.0 <= value <= MAX_HEIGHT_M else None


def building_height(tags: Mapping[str, str]) -> tuple[Quantity, float]:
    """Return height and min_height above the road: tagged, else 3 m a level, else 6 m."""
    height = height_in_m(tags.get("height")) or height_in_m(tags.get("building:height"))
    levels, roof = height_in_m(tags.get("building:levels")), height_in_m(tags.get("roof:levels"))
    if height:
        quantity = Quantity(height, "tagged")
    elif levels is not None and 0 < levels + (roof or 0.0) <= 200:
        quantity = Quantity((levels + (roof or 0.0)) * LEVEL_HEIGHT_M, "inferred")
    else:
        quantity = Quantity(DEFAULT_HEIGHT_M, "default")
    low = height_in_m(tags.get("min_height")) or height_in_m(tags.get("building:min_height"))
    if low is None:
        low = (height_in_m(tags.get("building:min_level")) or 0.0) * LEVEL_HEIGHT_M
    return quantity, low if low < quantity.value else 0.0


def _is_building(tags: Mapping[str, str]) -> bool:
    value = tags.get("building") or tags.get("building:part")
    under_ground = tags.get("location") == "underground" or tags.get("tunnel") == "yes"
    return value is not None and value != "no" and not under_ground


def footprints(osm: OsmMap, notes: list[str]) -> tuple[Footprint, ...]:
    """Return all buildings of a map; outlines that parts describe give way to their parts."""
    ids = list(osm.locations)
    latlon = np.array([osm.locations[i] for i in ids], dtype=np.float64).reshape(-1, 2)
    position = dict(zip(ids, local_from_geo(osm.frame, latlon[:, 0], latlon[:, 1]), strict=True))
    found: list[Footprint] = []
    taken: set[int] = set()
    for relation in sorted(osm.relations.values(), key=lambda r: r.id):
        if relation.tags.get("type") == "multipolygon" and _is_building(relation.tags):
            rings = _relation_polygons(osm, relation, position, notes)
            taken.update(m.ref for m in relation.members if m.kind == "w" and m.role != "inner")
            found.extend(_footprints_of(f"r{relation.id}", rings, relation.tags))
    for way in sorted(osm.ways.values(), key=lambda w: w.id):
        if not _is_building(way.tags) or way.id in taken:
            continue
        ring = _ring(way.nodes, position)
        if ring is None or way.nodes[0] != way.nodes[-1]:
            notes.append(f"way {way.id}: building outline is not closed; left out")
            continue
        found.extend(_footprints_of(f"w{way.id}", _valid(Polygon(ring)), way.tags))
    return _parts_before_outlines(found)


def _footprints_of(
    name: str, polygons: Sequence[Polygon], tags: Mapping[str, str]
) -> list[Footprint]:
    height, low = building_height(tags)
    is_part = "building" not in tags or tags["building"] == "no"
    return [
        Footprint(name if i == 0 else f"{name}.{i}", polygon, height, low, is_part)
        for i, polygon in enumerate(polygons)
    ]


def _ring(nodes: Sequence[int], position: Mapping[int, Array]) -> Array | None:
    points = [position[node] for node in nodes if node in position]
    if len(points) < 3:
        return None
    ring = without_repeats(np.array(points))
    return ring if len(ring) >= 4 else None


def _valid(shape: shapely.Geometry) -> list[Polygon]:
    """Return the polygons of a shape, made valid, without slivers under 1 m²."""
    if not shape.is_valid:
        shape = shapely.make_valid(shape)
    return [p for p in _polygons(shape) if p.area >= 1.0]


def _polygons(shape: shapely.Geometry) -> list[Polygon]:
    if isinstance(shape, Polygon):
        return [] if shape.is_empty else [shape]
    return [p for part in getattr(shape, "geoms", ()) for p in _polygons(part)]


def _relation_polygons(
    osm: OsmMap, relation: OsmRelation, position: Mapping[int, Array], notes: list[str]
) -> list[Polygon]:
    """Return the multipolygon's areas; pieces of rings are joined end to end."""
    lines: dict[bool, list[shapely.LineString]] = {True: [], False: []}
    for member in relation.members:
        way = osm.ways.get(member.ref) if member.kind == "w" else None
        if member.kind != "w" or member.role in ("part", "outline"):
            continue
        points = [position[n] for n in way.nodes if n in position] if way else []
        if len(points) < 2:
            notes.append(f"relation {relation.id}: way {member.ref} is missing in the map")
            continue
        lines[member.role == "inner"].append(shapely.LineString(points))
    outer = _closed_areas(lines[False])
    if not outer:
        notes.append(f"relation {relation.id}: building outline does not close; left out")
        return []
    inner = _closed_areas(lines[True])
    area = shapely.union_all(outer)
    return _valid(area.difference(shapely.union_all(inner)) if inner else area)


def _closed_areas(lines: list[shapely.LineString]) -> list[Polygon]:
    if not lines:
        return []
    noded = shapely.unary_union(lines)
    return [p for p in shapely.polygonize([noded]).geoms if p.area > 0.0]


def _parts_before_outlines(found: list[Footprint]) -> tuple[Footprint, ...]:
    """Drop outlines that their parts cover by nine tenths, and parts of outlines that stay."""
    parts = [f for f in found if f.is_part]
    outlines = [f for f in found if not f.is_part]
    if not parts:
        return tuple(outlines)
    tree = shapely.STRtree([p.polygon for p in parts])
    pairs = tree.query([o.polygon for o in outlines], predicate="intersects")
    of_outline: dict[int, list[int]] = {}
    for outline, part in pairs.T.tolist():
        of_outline.setdefault(outline, []).append(part)
    kept: list[Footprint] = []
    used: set[int] = set()
    for i, outline in enumerate(outlines):
        mine = of_outline.get(i, [])
        inside = [
            j
            for j in mine
            if parts[j].polygon.intersection(outline.polygon).area > 0.5 * parts[j].polygon.area
        ]
        cover = shapely.union_all([parts[j].polygon for j in inside])
        if inside and cover.intersection(outline.polygon).area >= 0.9 * outline.polygon.area:
            used.update(inside)
        else:
            kept.append(outline)
    kept.extend(parts[j] for j in sorted(used))
    return tuple(kept)


def buildings_in_frame(
    near: Sequence[Footprint], frame: LocalFrame, map_frame: LocalFrame, keep_free: shapely.Geometry
) -> tuple[tuple[Building, ...], tuple[str, ...]]:
    """Return buildings in the World's frame, cut back where they stand on `keep_free`.

    Lanes run through passages and under overhangs, and inferred lane widths can reach into a
    facade: a car must not collide there. Notes name the buildings that were cut.
    """
    if not near:
        return (), ()
    shapes = np.array([f.polygon for f in near], dtype=object)
    moved = shapely.transform(shapes, lambda xy: target_from_source(frame, map_frame, xy, 0.0).xy_m)
    moved = shapely.simplify(moved, 0.05, preserve_topology=True)
    moved = shapely.set_precision(moved, GRID_M)
    shapely.prepare(keep_free)
    hit = shapely.intersects(keep_free, moved)
    buildings: list[Building] = []
    cut: list[str] = []
    for footprint, shape, blocked in zip(near, moved, hit, strict=True):
        polygons = _valid(shape)
        if blocked and footprint.min_height_m < 2.5:
            free = [shapely.difference(p, keep_free, grid_size=GRID_M) for p in polygons]
            polygons = [p for shape in free for p in _valid(shape)]
            cut.append(footprint.id)
        for i, polygon in enumerate(polygons):
            buildings.append(
                _building(footprint, polygon, footprint.id if i == 0 else f"{footprint.id}-{i}")
            )
    if not cut:
        return tuple(buildings), ()
    return tuple(buildings), (f"buildings cut back where a lane passes: {', '.join(cut)}",)


def _building(footprint: Footprint, polygon: Polygon, name: str) -> Building:
    ring = orient(polygon)
    return Building(
        id=name,
        outline=_ring_of(ring.exterior),
        holes=tuple(_ring_of(hole) for hole in ring.interiors),
        height_m=footprint.height_m,
        min_height_m=footprint.min_height_m,
    )


def _ring_of(ring: shapely.LinearRing) -> Array:
    points: Array = np.round(shapely.get_coordinates(ring)[:-1], 3)
    return points
