"""Tram tracks as lanes of their own: where they lie, and which roads they cross."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Quantity
from foretwin.contracts.world import Lane, Road
from foretwin.geometry.polyline import cut, length, without_repeats
from foretwin.world_gen.extent import stretches_inside
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.osm.osm_map import OsmMap, OsmWay
from foretwin.world_gen.roads.beside_roads import BesideRoads, in_frame
from foretwin.world_gen.roads.road_tags import in_tunnel, on_bridge, road_layer
from foretwin.world_gen.roads.speed_limits import speed_limit

TRAM_WIDTH_M = 2.65
"""Width of a usual tram (BOStrab: no wider)."""


class TramTracks(NamedTuple):
    """Roads of class `tram` with one lane each, and notes on the car roads that they cross."""

    roads: tuple[Road, ...]
    lanes: tuple[Lane, ...]
    notes: tuple[str, ...]


def tram_tracks(around: Surroundings, osm: OsmMap, beside: BesideRoads) -> TramTracks:
    """Return the tracks within a World; cars neither drive on these lanes nor yield to them.

    A track is driven along its way's nodes: most tracks are mapped one by one, in the direction
    in which trams run.
    """
    roads: list[Road] = []
    lanes: list[Lane] = []
    on_roads = {node: edge for edge in around.edges.values() for node in edge.node_ids}
    notes: list[str] = []
    for way, xy in zip(beside.tracks, in_frame(beside.tracks, osm, around.frame), strict=True):
        line = without_repeats(xy)
        if len(line) < 2:
            continue
        pieces = stretches_inside(line, around.extent)
        total = length(line)
        for i, (begin, stop) in enumerate(pieces):
            inside = line if (begin, stop) == (0.0, total) else cut(line, begin, stop)
            road, lane = _laid(way, inside, i)
            roads.append(road)
            lanes.append(lane)
        if pieces:
            crossed = {on_roads[n].way_id for n in way.nodes if n in on_roads}
            notes.extend(
                f"way {crossed_way}: crossed by a tram line, way {way.id}, in nobody's conflicts"
                for crossed_way in sorted(crossed)
            )
    return TramTracks(tuple(roads), tuple(lanes), tuple(notes))


def _laid(way: OsmWay, line: Array, piece: int) -> tuple[Road, Lane]:
    name = f"w{way.id}.tram" if piece == 0 else f"w{way.id}.tram#{piece + 1}"
    tags, rounded = way.tags, np.round(line, 3)
    lane = Lane(
        id=f"{name}.f0",
        osm_way=way.id,
        name=tags.get("name", ""),
        kind="tram",
        centerline=rounded,
        width_m=Quantity(TRAM_WIDTH_M, "default"),
        speed_limit_mps=speed_limit(tags),
        role="other",
        direction_source="default",
        change="none",
        road_id=name,
        layer=road_layer(tags),
    )
    road = Road(
        id=name,
        osm_way=way.id,
        name=lane.name,
        road_class="tram",
        reference_line=rounded,
        left_m=TRAM_WIDTH_M / 2,
        right_m=-TRAM_WIDTH_M / 2,
        lane_ids=(lane.id,),
        layer=lane.layer,
        bridge=on_bridge(tags),
        tunnel=in_tunnel(tags),
    )
    return road, lane
