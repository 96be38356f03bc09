"""The crossroads of `places` on a slope that climbs evenly to the east."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.elevation import Elevation, HeightProfile
from foretwin.contracts.world import Road, World
from foretwin.geometry.polyline import arc_lengths
from tests.sim_worker.places import crossroads


def hilly(grade: float, *, world: World | None = None) -> World:
    """Return a World whose lanes climb by `grade` eastwards, and not at all northwards."""
    flat = crossroads() if world is None else world
    lanes = tuple(msgspec.structs.replace(lane, road_id=lane.id) for lane in flat.lanes)
    roads = tuple(
        Road(
            id=lane.id,
            osm_way=1,
            name="",
            road_class="residential",
            reference_line=lane.centerline,
            left_m=1.5,
            right_m=-1.5,
            lane_ids=(lane.id,),
        )
        for lane in lanes
    )
    elevation = Elevation(
        source="drawn",
        base_m=0.0,
        grade_std=0.0,
        roads=tuple(_profile(road.id, road.reference_line, grade) for road in roads),
        connections=tuple(_profile(one.id, one.centerline, grade) for one in flat.connections),
        ground_from_m=(-200.0, -200.0),
        ground_step_m=400.0,
        ground_m=grade * np.array([[-200.0, 200.0], [-200.0, 200.0]]),
    )
    return msgspec.structs.replace(flat, lanes=lanes, roads=roads, elevation=elevation)


def _profile(name: str, line: Array, grade: float) -> HeightProfile:
    arc = arc_lengths(line)
    ahead = (line[-1] - line[0]) / arc[-1]
    return HeightProfile(
        id=name,
        along_m=arc[[0, -1]],
        height_m=grade * line[[0, -1], 0],
        grade=np.full(2, grade * ahead[0]),
    )
