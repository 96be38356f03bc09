"""Drawn streets and the tracks of drives along them, in metres around one place."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, geo_from_local, local_from_geo
from foretwin.contracts.tracks import DrivenTrack, TrackSet, track_id
from foretwin.contracts.world import World
from foretwin.world_gen.build import build_region
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.osm_map import LatLonBounds
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.sketch import NORTH_SEA_COAST, Sketch

FRAME = LocalFrame(NORTH_SEA_COAST)
_BOX = geo_from_local(FRAME, np.array([[-320.0, -320.0], [320.0, 320.0]]))


def track(line: Array, *, name: str = "drive") -> DrivenTrack:
    """A drive along places (N, 2) in metres, 10 m/s, a place each metre."""
    step = np.hypot(*np.diff(line, axis=0).T)
    at_m = np.concatenate([[0.0], np.cumsum(step)])
    every_m = np.arange(0.0, at_m[-1], 1.0)
    xy_m = np.stack([np.interp(every_m, at_m, line[:, k]) for k in (0, 1)], axis=1)
    geo = geo_from_local(FRAME, xy_m)
    stamp_ns = (every_m * 1e8).astype(np.int64)
    return DrivenTrack(
        id=track_id(geo[:, 0], geo[:, 1], stamp_ns),
        name=name,
        added_utc="2026-11-23T00:00:00+00:00",
        stamp_ns=stamp_ns,
        lat_deg=geo[:, 0],
        lon_deg=geo[:, 1],
        speed_mps=np.full(len(xy_m), 10.0),
    )


def street(**tags: str) -> Sketch:
    """One street of 600 m from west to east along y = 0."""
    sketch = Sketch()
    sketch.road(1, [sketch.node(1, -300.0, 0.0), sketch.node(2, 300.0, 0.0)], "Long Street", **tags)
    return sketch


def crossing(**tags: str) -> Sketch:
    """Two streets of 600 m that cross at the origin."""
    sketch = Sketch()
    sketch.node(1, 0.0, 0.0)
    for node, (x, y) in enumerate(((-300, 0), (300, 0), (0, -300), (0, 300)), start=2):
        sketch.node(node, float(x), float(y))
    sketch.road(1, [2, 1, 3], "Long Street", **tags)
    sketch.road(2, [4, 1, 5], "Cross Street", **tags)
    return sketch


def world_of(sketch: Sketch, folder: Path, *tracks: DrivenTrack, ground: bool = False) -> World:
    """Build the World of a whole sketch, corrected by tracks."""
    osm = sketch.read(folder)
    graph = build_road_graph(osm)
    known = TrackSet.of(tracks) if tracks else None
    index = index_map(osm, graph, find_intersections(osm, graph), tracks=known)
    (south, west), (north, east) = _BOX.tolist()
    return build_region(
        osm, graph, LatLonBounds(south, west, north, east), index=index, ground=ground
    )


def moved(world: World, line: Array) -> Array:
    """Return a World's line in metres of the sketch."""
    geo = geo_from_local(world.frame, line)
    return local_from_geo(FRAME, geo[:, 0], geo[:, 1])


def height_at(world: World, lane: str, x_m: float) -> float:
    """Return y of a lane that runs from west to east, or back, where it passes x."""
    found = next(one for one in world.lanes if one.id.endswith(lane))
    xy = moved(world, found.centerline)
    xy = xy[np.argsort(xy[:, 0])]
    return float(np.interp(x_m, xy[:, 0], xy[:, 1]))
