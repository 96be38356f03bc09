"""Elevation models for a map that was opened, and what they make of its roads."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from foretwin.contracts.elevation import RoadSlopes
from foretwin.contracts.frames import LocalFrame, target_from_source_m
from foretwin.geometry.polyline import arc_lengths
from foretwin.geometry.slopes import SPACING_M
from foretwin.orchestrator.worlds.opening import OpenMap
from foretwin.world_gen.elevation.dem import DemSet
from foretwin.world_gen.elevation.profiles import RoadProfiles
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
        arc = arc_lengths(xy)
        count = max(int(np.ceil(arc[-1] / SPACING_M)), 1)
        at = (np.arange(count) + 0.5) * (arc[-1] / count)
        piece = np.clip(np.searchsorted(arc, at, side="right") - 1, 0, len(xy) - 2)
        step = np.diff(xy, axis=0)[piece]
        places.append(np.column_stack([np.interp(at, arc, xy[:, k]) for k in (0, 1)]))
        directions.append(step / np.maximum(np.hypot(*step.T), 1e-9)[:, None])
        grades.append(profile.grade_at(at * (profile.along_m[-1] / max(arc[-1], 1e-9))))
    return RoadSlopes(
        xy_m=np.concatenate(places),
        direction=np.concatenate(directions),
        grade=np.concatenate(grades),
        grade_std=profiles.grade_std,
    )
