"""What a map has beside its roads: sidewalks, crossings drawn as ways, tracks, islands."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from itertools import compress
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.world_gen.extent import box_deg
from foretwin.world_gen.osm.osm_map import OsmMap, OsmWay, boxes_deg

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


class BesideIndex:
    """What lies beside a map's roads, collected once and looked up place by place."""

    def __init__(self, osm: OsmMap) -> None:
        self._osm = osm

    @cached_property
    def _all(self) -> BesideRoads:
        return beside_roads(self._osm)

    @cached_property
    def _boxes_deg(self) -> tuple[Array, ...]:
        lines = ([way.nodes for way in ways] for ways in self._all[:3])
        return tuple(boxes_deg(*self._osm.points_of(of_kind)) for of_kind in lines)

    def within(self, area: shapely.Geometry) -> BesideRoads:
        """Return the ways that may reach into `area`, a shape in the map's frame."""
        west, south, east, north = box_deg(area, self._osm.frame).bounds

        def near(ways: tuple[OsmWay, ...], corners: Array) -> tuple[OsmWay, ...]:
            apart = (corners[:, :2] > (north, east)) | (corners[:, 2:] < (south, west))
            return tuple(compress(ways, np.logical_not(apart.any(axis=1))))

        (*drawn, crossed_at), corners_of = self._all, self._boxes_deg
        sidewalks, tracks, islands = map(near, drawn, corners_of)
        return BesideRoads(sidewalks, tracks, islands, crossed_at)


def in_frame(ways: tuple[OsmWay, ...], osm: OsmMap, frame: LocalFrame) -> list[Array]:
    """Return the points (N, 2) of ways in a World's frame."""
    if not ways:
        return []
    lat_lon, first = osm.points_of([way.nodes for way in ways])
    return np.split(local_from_geo(frame, lat_lon[:, 0], lat_lon[:, 1]), first[1:-1])
