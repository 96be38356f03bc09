"""How high the roads and the ground of a World lie, from the heights of the map's roads."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy.spatial
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.elevation import Elevation, HeightProfile
from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.world import Connection, Lane, Road
from foretwin.geometry.polyline import evenly, length, points_at
from foretwin.world_gen.elevation.profiles import RoadProfiles
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.roads.road_graph import RoadEdge

_KNOTS_M = 20.0
_GROUND_STEP_M, _MOST_STEPS = 10.0, 250
_BESIDE_M = 20.0
"""So far beside a road the ground follows it rather than the raster. Chosen: embankments."""
STEEPEST = 0.30
"""Connections that climb more join what does not meet: no street is much steeper."""


class WorldElevation(NamedTuple):
    """The heights of a World, and what is not to be believed of them."""

    elevation: Elevation
    notes: tuple[str, ...]


class _Height(NamedTuple):
    height_m: float
    grade: float


def world_elevation(
    around: Surroundings,
    profiles: RoadProfiles,
    edge_of_road: Mapping[str, int],
    roads: Sequence[Road],
    lanes: Iterable[Lane],
    connections: Sequence[Connection],
) -> WorldElevation:
    """Return the heights of a World's roads, connections and ground; edges by road id."""
    found = {
        road.id: _along_edge(
            road,
            around.edges[edge_of_road[road.id]],
            _of_edge(edge_of_road[road.id], around, profiles),
        )
        for road in roads
        if edge_of_road.get(road.id) in profiles.of_edge
    }
    base_m = _base(roads, found)
    of_roads = [_above(profile, base_m) for profile in found.values()]
    known = {profile.id: profile for profile in of_roads}
    ends = {
        (lane.id, at_end): _at_end(known[lane.road_id], reverse=lane.reverse, at_end=at_end)
        for lane in lanes
        if lane.road_id in known
        for at_end in (False, True)
    }
    joined, notes = _connections(connections, ends)
    corner, step_m, ground, unknown = _ground(around, profiles, roads, known, base_m)
    if unknown:
        notes.append(
            f"the elevation model knows no height of {math.ceil(100.0 * unknown)} % of the ground"
        )
    return WorldElevation(
        Elevation(
            source=profiles.dem.name,
            base_m=base_m,
            grade_std=round(profiles.grade_std, 4),
            roads=tuple(of_roads),
            connections=tuple(joined),
            ground_from_m=corner,
            ground_step_m=step_m,
            ground_m=ground,
        ),
        tuple(notes),
    )


def _of_edge(index: int, around: Surroundings, profiles: RoadProfiles) -> HeightProfile:
    """Return the heights along an edge, one after the other of those joined in it."""
    parts = [profiles.of_edge[i] for i in around.joined.parts.get(index, (index,))]
    if len(parts) == 1:
        return parts[0]
    begin_m = np.cumsum([0.0, *(part.along_m[-1] for part in parts[:-1])])
    return HeightProfile(
        id=parts[0].id,
        along_m=np.concatenate([p.along_m + m for p, m in zip(parts, begin_m, strict=True)]),
        height_m=np.concatenate([part.height_m for part in parts]),
        grade=np.concatenate([part.grade for part in parts]),
    )


def _along_edge(road: Road, edge: RoadEdge, profile: HeightProfile) -> HeightProfile:
    """Return the heights of a road, which is a part of an edge, above the sea."""
    line = road.reference_line
    at = evenly(length(line), spacing_m=_KNOTS_M)
    points = shapely.points(points_at(line, at))
    on_edge = shapely.line_locate_point(shapely.LineString(edge.xy_m), points)
    # The edge's length in the map's frame and in the World's differ by parts in a million.
    on_edge *= profile.along_m[-1] / max(edge.length_m, 1e-9)
    height, grade = profile.height_at(on_edge), profile.grade_at(on_edge)
    return HeightProfile(id=road.id, along_m=at, height_m=height, grade=grade)


def _base(roads: Sequence[Road], found: Mapping[str, HeightProfile]) -> float:
    """Return how high the road nearest to the origin lies there, above the sea."""
    origin = shapely.Point(0.0, 0.0)
    lines = [
        (shapely.LineString(road.reference_line), road.id) for road in roads if road.id in found
    ]
    if not lines:
        return 0.0
    line, name = min(lines, key=lambda one: (shapely.distance(one[0], origin), one[1]))
    along = np.array([shapely.line_locate_point(line, origin)])
    return round(float(found[name].height_at(along)[0]), 3)


def _above(profile: HeightProfile, base_m: float) -> HeightProfile:
    return HeightProfile(
        id=profile.id,
        along_m=np.round(profile.along_m, 3),
        height_m=np.round(profile.height_m - base_m, 3),
        grade=np.round(profile.grade, 5),
    )


def _at_end(profile: HeightProfile, *, reverse: bool, at_end: bool) -> _Height:
    """Return height and grade, as the lane is driven, where a lane begins or ends."""
    i = -1 if at_end != reverse else 0
    grade = float(profile.grade[i])
    return _Height(float(profile.height_m[i]), -grade if reverse else grade)


def _connections(
    connections: Sequence[Connection], ends: Mapping[tuple[str, bool], _Height]
) -> tuple[list[HeightProfile], list[str]]:
    found, notes = [], []
    for connection in connections:
        begin = ends.get((connection.from_lane_id, True))
        end = ends.get((connection.to_lane_id, False))
        if begin is None or end is None:
            continue
        along = round(length(connection.centerline), 3)
        rise_m = end.height_m - begin.height_m
        if abs(rise_m) > STEEPEST * max(along, 1.0):
            notes.append(
                f"lane {connection.from_lane_id}: leads {rise_m:+z.1f} m up within {along:.1f} m, "
                f"into {connection.to_lane_id}: the map joins what does not meet"
            )
            continue
        found.append(
            HeightProfile(
                id=connection.id,
                along_m=np.array([0.0, along]),
                height_m=np.array([begin.height_m, end.height_m]),
                grade=np.array([begin.grade, end.grade]),
            )
        )
    return found, notes


def _ground(
    around: Surroundings,
    profiles: RoadProfiles,
    roads: Sequence[Road],
    known: Mapping[str, HeightProfile],
    base_m: float,
) -> tuple[tuple[float, float], float, Array, float]:
    """Return where the raster of open ground begins, its step, its heights (rows, columns), and of
    which share of them the model knows nothing.

    It is that of the elevation model, drawn to roads that lie on it.
    """
    west, south, east, north = around.extent.polygon.bounds
    widest = max(east - west, north - south)
    step_m = max(_GROUND_STEP_M, 5.0 * math.ceil(widest / _MOST_STEPS / 5.0))
    corner = step_m * math.floor(west / step_m), step_m * math.floor(south / step_m)
    columns = math.ceil((east - corner[0]) / step_m) + 1
    rows = math.ceil((north - corner[1]) / step_m) + 1
    x, y = np.meshgrid(
        np.arange(columns) * step_m + corner[0], np.arange(rows) * step_m + corner[1]
    )
    xy = np.column_stack([x.ravel(), y.ravel()])

    def model(places: Array) -> Array:
        return profiles.dem.at(*geo_from_local(around.frame, places).T) - base_m

    heights = model(xy)
    unknown = float(np.isnan(heights[around.extent.holds(xy)]).mean())
    places, above = [np.zeros((0, 2))], [np.zeros(0)]
    for road in roads:
        if road.id in known and not (road.bridge or road.tunnel):
            at = evenly(length(road.reference_line), spacing_m=step_m / 2)
            places.append(points_at(road.reference_line, at))
            above.append(known[road.id].height_at(at))
    points, road_m = np.concatenate(places), np.concatenate(above)
    if len(points):
        tree = scipy.spatial.cKDTree(points)
        far, near = tree.query(xy, k=min(8, len(points)))
        far, near = far.reshape(len(xy), -1), near.reshape(len(xy), -1)
        weight = np.exp(-0.5 * np.square((far - far[:, :1]) / (step_m / 2)))
        beside = (weight * road_m[near]).sum(axis=1) / weight.sum(axis=1)
        share = np.exp(-0.5 * np.square(np.maximum(far[:, 0] - step_m, 0.0) / _BESIDE_M))
        heights = np.where(np.isnan(heights), beside, share * beside + (1.0 - share) * heights)
    heights = np.nan_to_num(heights).reshape(rows, columns)
    return corner, step_m, np.asarray(np.round(heights, 2)), unknown
