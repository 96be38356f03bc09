"""What a map tells of beside its roads: sidewalks, crossings drawn as ways, tracks, islands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from contracts.arrays import Array
from contracts.frames import LocalFrame, local_from_geo
from world_gen.osm_map import OsmMap, OsmWay

_RAILS = frozenset({"tram", "light_rail"})
_WALKED = frozenset({"footway", "cycleway", "path", "pedestrian"})


class BesideRoads(NamedTuple):
    """Ways of a map that are no roads for cars; `crossed_at` has crossing ways by their nodes."""

    sidewalks: tuple[OsmWay, ...]
    tracks: tuple[OsmWay, ...]
    islands: tuple[OsmWay, ...]
    crossed_at: Mapping[int, OsmWay]


def beside_roads(osm: OsmMap) -> BesideRoads:
    """Collect them in one pass over the map's ways."""
    sidewalks, tracks, islands = [], [], []
    crossed_at: dict[int, OsmWay] = {}
    for way in osm.ways.values():
        tags = way.tags
        highway = tags.get("highway")
        if highway in _WALKED:
            word = tags.get("footway") or tags.get("cycleway") or tags.get("path")
            if word == "sidewalk":
                sidewalks.append(way)
            elif word == "crossing":
                crossed_at.update(dict.fromkeys(way.nodes, way))
        elif highway is None:
            if tags.get("railway") in _RAILS:
                tracks.append(way)
            elif tags.get("area:highway") == "traffic_island":
                islands.append(way)
    return BesideRoads(tuple(sidewalks), tuple(tracks), tuple(islands), crossed_at)


def in_frame(ways: tuple[OsmWay, ...], osm: OsmMap, frame: LocalFrame) -> list[Array]:
    """Return the points (N, 2) of ways in a World's frame."""
    if not ways:
        return []
    lat_lon = np.array([osm.locations[node] for way in ways for node in way.nodes])
    xy_m = local_from_geo(frame, lat_lon[:, 0], lat_lon[:, 1])
    return np.split(xy_m, np.cumsum([len(way.nodes) for way in ways])[:-1])
