"""Elevation models for a map that was opened, and what they make of its roads."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from foretwin.contracts.elevation import RoadSlopes
from foretwin.contracts.frames import LocalFrame, target_from_source_m
from foretwin.geometry.polyline import length, stretches
from foretwin.geometry.slopes import SPACING_M
from foretwin.world_gen.elevation.dem import DemSet
from foretwin.world_gen.elevation.profiles import RoadProfiles
from foretwin.world_gen.opening import OpenMap
from foretwin.world_gen.roads.road_graph import RoadGraph


def heights_for(opened: OpenMap, dem: Path | None) -> DemSet | None:
    """Read an elevation model where one is named; raises UserError where it does not fit the map.

    Of a folder of tiles those that lie elsewhere are not kept.
    """
    if dem is None:
        return None
    # Imported here: most Worlds are flat.
    from foretwin.world_gen.elevation.read_dem import read_dem

    return read_dem(dem, around=opened.osm.bounds)


def profiles_of(opened: OpenMap, dem: Path | None) -> RoadProfiles | None:
    """Return heights along all car roads of a map, as its Worlds have them; None without a model.

    Raises UserError where the model does not fit the map.
    """
    heights = heights_for(opened, dem)
    if heights is None:
        return None
    from foretwin.world_gen.elevation.road_profiles import road_profiles

    edges = [edge.index for edge in opened.graph.edges if edge.drivable]
    return road_profiles(opened.graph, edges, heights, opened.osm.node_tags)


def slopes_in(frame: LocalFrame, graph: RoadGraph, profiles: RoadProfiles) -> RoadSlopes:
    """Return how the roads of a map climb, at places in `frame`."""
    places, directions, grades = [], [], []
    for index, profile in profiles.of_edge.items():
        xy = target_from_source_m(frame, graph.frame, graph.edges[index].xy_m)
        pieces = stretches(xy, spacing_m=SPACING_M)
        places.append(pieces.xy_m)
        directions.append(pieces.direction)
        # The edge's length in the map's frame and in this one differ by parts in a million.
        scale = profile.along_m[-1] / max(length(xy), 1e-9)
        grades.append(profile.grade_at(pieces.at_m * scale))
    return RoadSlopes(
        xy_m=np.concatenate(places),
        direction=np.concatenate(directions),
        grade=np.concatenate(grades),
        grade_std=profiles.grade_std,
    )
