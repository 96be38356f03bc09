"""Sidewalks: strips beside the kerb where tags tell of them, and those that are mapped as ways."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Provenance
from foretwin.contracts.world import Area
from foretwin.geometry.polyline_batch import Polylines, offset
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneSet
from foretwin.world_gen.lanes.lane_plans import metres
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.polygon_areas import (
    GRID_M,
    areas_of,
    cut_out,
    lines_of,
    polygons_from,
    polygons_of_rings,
)
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
_Strip = tuple[str, Provenance, shapely.Geometry]
"""Name and shape of a sidewalk, and where its width is from."""


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
    strips = [*_beside_kerbs(around, lanes), *_of_ways(around, osm, beside)]
    if not strips:
        return ()
    names, sources, shapes = zip(*strips, strict=True)
    free, paved = np.array(shapes), polygons_from([(area.outline, ()) for area in road_surface])
    row, piece = shapely.STRtree(paved).query(free, predicate="intersects")
    order = np.argsort(row, kind="stable")
    cut_out(free, paved, row[order], piece[order])
    free = shapely.set_precision(shapely.simplify(free, 0.02), GRID_M)
    found = areas_of(names, free, smallest_m2=_SMALLEST_M2, sources=sources)
    return tuple(chain.from_iterable(found))


def _beside_kerbs(around: Surroundings, lanes: LaneSet) -> Iterator[_Strip]:
    names: list[str] = []
    sources: list[Provenance] = []
    edges: list[Array] = []
    widths: list[float] = []
    tags_of = {edge.way_id: edge.tags for edge in around.edges.values()}
    for road in lanes.roads:
        tags = tags_of[road.osm_way]
        for side in sides_with_sidewalk(tags):
            keys = f"sidewalk:{side}:width", "sidewalk:both:width", "sidewalk:width"
            width = metres(next((tags[key] for key in keys if tags.get(key)), None))
            names.append(f"sidewalk:{road.id}:{side}")
            sources.append("default" if width is None else "tagged")
            edges.append(lanes.edges[road.id][0 if side == "left" else 1])
            widths.append((width or WIDTH_M) * (1.0 if side == "left" else -1.0))
    outer = offset(Polylines.of(edges), np.array(widths)).split()
    rings = [np.concatenate([a, b[::-1]]) for a, b in zip(edges, outer, strict=True)]
    return zip(names, sources, polygons_of_rings(rings), strict=True)


def _of_ways(around: Surroundings, osm: OsmMap, beside: BesideRoads) -> Iterator[_Strip]:
    lines = in_frame(beside.sidewalks, osm, around.frame)
    drawn = [
        (way, line) for way, line in zip(beside.sidewalks, lines, strict=True) if len(line) >= 2
    ]
    shapes = lines_of([line for _, line in drawn])
    near = np.nonzero(shapely.intersects(around.extent.polygon, shapes))[0]
    ways = [drawn[i][0] for i in near.tolist()]
    tagged = [metres(way.tags.get("width")) for way in ways]
    half_m = [(width or WIDTH_M) / 2 for width in tagged]
    strips = shapely.buffer(shapes[near], half_m, cap_style="flat", quad_segs=2)
    strips = shapely.intersection(strips, around.extent.polygon)
    sources: list[Provenance] = ["default" if width is None else "tagged" for width in tagged]
    return zip((f"sidewalk:w{way.id}" for way in ways), sources, strips, strict=True)
