"""Sidewalks: strips beside the kerb where tags tell of them, and those that are mapped as ways."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Provenance
from foretwin.contracts.world import Area
from foretwin.geometry.polyline_batch import Polylines, offset
from foretwin.world_gen.ground.paved import GRID_M
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneSet
from foretwin.world_gen.lanes.lane_plans import metres
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.polygon_areas import areas_of
from foretwin.world_gen.roads.beside_roads import BesideRoads, in_frame

WIDTH_M = 2.0
"""Width of a sidewalk without a width tag."""
_SMALLEST_M2 = 1.0
_BOTH = {
    "both": ("left", "right"),
    "yes": ("left", "right"),
    "left": ("left",),
    "right": ("right",),
}


def sides_with_sidewalk(tags: Mapping[str, str]) -> tuple[str, ...]:
    """Return on which sides of a way, along its nodes, a sidewalk belongs to the road itself."""
    found = []
    for side in ("left", "right"):
        word = tags.get(f"sidewalk:{side}") or tags.get("sidewalk:both")
        if word == "yes" or (word is None and side in _BOTH.get(tags.get("sidewalk", ""), ())):
            found.append(side)
    return tuple(found)


def sidewalk_areas(
    around: Surroundings,
    lanes: LaneSet,
    road_surface: tuple[Area, ...],
    osm: OsmMap,
    beside: BesideRoads,
) -> tuple[Area, ...]:
    """Return the sidewalks of a World, none of them on a carriageway or a place where roads meet.

    Beside a road a sidewalk is 2 m wide unless tagged; mapped ways have their own geometry.
    """
    names, sources, shapes = _beside_kerbs(around, lanes)
    for name, source, shape in _of_ways(around, osm, beside):
        names.append(name)
        sources.append(source)
        shapes.append(shape)
    if not names:
        return ()
    free = _without(np.array(shapes, dtype=object), _polygons(road_surface))
    free = shapely.set_precision(shapely.simplify(free, 0.02), GRID_M)
    found = areas_of(names, free, smallest_m2=_SMALLEST_M2, sources=sources)
    return tuple(chain.from_iterable(found))


def _beside_kerbs(
    around: Surroundings, lanes: LaneSet
) -> tuple[list[str], list[Provenance], list[shapely.Geometry]]:
    names: list[str] = []
    sources: list[Provenance] = []
    edges: list[Array] = []
    widths: list[float] = []
    tags_of = {edge.way_id: edge.tags for edge in around.edges.values()}
    for road in lanes.roads:
        tags = tags_of[road.osm_way]
        for side in sides_with_sidewalk(tags):
            width = metres(
                tags.get(f"sidewalk:{side}:width")
                or tags.get("sidewalk:both:width")
                or tags.get("sidewalk:width")
            )
            names.append(f"sidewalk:{road.id}:{side}")
            sources.append("inferred" if width is None else "tagged")
            edges.append(lanes.edges[road.id][0 if side == "left" else 1])
            widths.append((width or WIDTH_M) * (1.0 if side == "left" else -1.0))
    if not names:
        return [], [], []
    inner = Polylines.of(edges)
    outer = offset(inner, np.array(widths)).split()
    rings = [np.concatenate([a, b[::-1]]) for a, b in zip(edges, outer, strict=True)]
    counts = [len(ring) for ring in rings]
    shapes = shapely.polygons(
        shapely.linearrings(np.concatenate(rings), indices=np.repeat(np.arange(len(rings)), counts))
    )
    bad = ~shapely.is_valid(shapes)
    shapes[bad] = shapely.buffer(shapes[bad], 0.0)
    return names, sources, list(shapes)


def _of_ways(
    around: Surroundings, osm: OsmMap, beside: BesideRoads
) -> list[tuple[str, Provenance, shapely.Geometry]]:
    lines = in_frame(beside.sidewalks, osm, around.frame)
    if not lines:
        return []
    counts = [len(line) for line in lines]
    drawn = [i for i, n in enumerate(counts) if n >= 2]
    ways = [beside.sidewalks[i] for i in drawn]
    if not ways:
        return []
    shapes = shapely.linestrings(
        np.concatenate([lines[i] for i in drawn]),
        indices=np.repeat(np.arange(len(drawn)), [counts[i] for i in drawn]),
    )
    near = np.nonzero(shapely.intersects(around.extent.polygon, shapes))[0]
    tagged = [metres(ways[i].tags.get("width")) for i in near.tolist()]
    strips = shapely.buffer(
        shapes[near], [(width or WIDTH_M) / 2 for width in tagged], cap_style="flat", quad_segs=2
    )
    strips = shapely.intersection(strips, around.extent.polygon)
    return [
        (f"sidewalk:w{ways[i].id}", "inferred" if width is None else "tagged", strip)
        for i, width, strip in zip(near.tolist(), tagged, strips, strict=True)
    ]


def _polygons(areas: tuple[Area, ...]) -> np.ndarray:
    if not areas:
        return np.array([], dtype=object)
    counts = [len(area.outline) for area in areas]
    found: np.ndarray = shapely.polygons(
        shapely.linearrings(
            np.concatenate([area.outline for area in areas]),
            indices=np.repeat(np.arange(len(areas)), counts),
        )
    )
    return found


def _without(strips: np.ndarray, paved: np.ndarray) -> np.ndarray:
    """Cut carriageways out of strips, for all strips at once, one neighbour each at a time."""
    tree = shapely.STRtree(paved)
    row, piece = tree.query(strips, predicate="intersects")
    order = np.argsort(row, kind="stable")
    row, piece = row[order], piece[order]
    turn = np.arange(len(row)) - np.searchsorted(row, row)
    for k in range(int(turn.max(initial=-1)) + 1):
        now = turn == k
        strips[row[now]] = shapely.difference(strips[row[now]], paved[piece[now]])
    return strips
