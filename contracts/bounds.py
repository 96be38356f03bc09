"""The one table of what numbers, texts and arrays of a message may be; `guard` holds them to it.

These are wide on purpose: beyond them a number is a fault of who sends it. What is merely
implausible for a road vehicle is for the estimator to weigh.
"""

from __future__ import annotations

from typing import NamedTuple

import msgspec

from foretwin.contracts import (
    drive,
    futures,
    gap,
    placement,
    planner_link,
    point_cloud,
    radar_list,
    side_by_side,
    simulation,
)
from foretwin.contracts.tuning import (
    UNDERSTEER_GRADIENT,
    ParameterChange,
    ParameterEstimate,
    SteeringMapBin,
)
from foretwin.contracts.vehicle import VehicleParameters

MOST_BYTES = 32 * 2**20
"""Of one message: some fifty times the largest answer of a worker that was measured, 0.6 MB."""
MOST_SAMPLE_BYTES = 2**20
"""Of what a vehicle sends or a process is told of it: 5,000 road users fit, twice."""
MOST_ROS_BYTES = 4 * 2**20
"""Of a message of ROS 2 that is no cloud: to read 2,000 objects takes a second."""
MOST_TEXT = 20_000
"""Characters of one text: a line to tell, with room for a quoted input."""
MOST_IDENTIFIER = 200
"""Characters of what names a World or a process: with its ending it still names a file."""
MOST_USERS = 5_000
"""Road users in one message; a crowded crossing has some hundreds in a sensor's reach."""
MOST_INTEGER = 2**62
"""Stamps in ns until the year 2116, and differences of any two of them fit 64 bits."""

FAR = {
    "lat_deg": 90.0,
    "lon_deg": 180.0,
    "m": 1e9,
    "mps": 1e4,
    "mps2": 1e5,
    "rad": 1e5,
    "radps": 1e4,
    "radps2": 1e5,
}
"""The greatest size of a number, by its name or by its unit, which ends the name."""

IDENTIFIERS = frozenset({"world_id", "worker_id"})
"""Fields that become part of a file's name or of a key."""

MAY_BE_UNKNOWN: frozenset[type] = frozenset(
    {
        futures.FuturesResult,
        futures.Outcome,
        futures.Trajectory,
        futures.RoadUserTracks,
        futures.PlannedImpacts,
        futures.PathAhead,
        gap.Evidence,
        SteeringMapBin,
        planner_link.PlannerScene,
        planner_link.PlannedMotions,
        side_by_side.Disagreement,
        simulation.RoundView,
        placement.RecordedStart,
    }
)
"""Types whose own numbers are NaN or infinite where there is nothing to tell, and what lies in
them; `PlannedMotions` are judged by who tracks them, who can say what was wrong."""

SHAPES: dict[type[msgspec.Struct], dict[str, str]] = {
    drive.PlannedTrajectory: dict.fromkeys(
        ("time_from_stamp_s", "lat_deg", "lon_deg", "yaw_rad", "speed_mps"), "N"
    ),
    drive.OthersAround: {"users.users": "N", "known_for_s": "N"},
    futures.FuturesResult: {
        "future_indices": "S",
        "left_out": "S",
        "trajectory.time_s": "N",
        "trajectory.states": "S N 8",
        **{
            f"outcome.{name}": "S"
            for name in (
                "collided", "collision_time_s", "collision_with", "min_clearance_m", "progress_m",
                "valid",
            )
        },
        "outcome.failures": "S?",
        "outcome.remarks": "S?",
        "road_users.poses": "S N R 3",
        "road_users.speed_mps": "S N R",
        "road_users.size_m": "S R 2",
        "road_users.kinds": "S R",
        "metrics.*": "S",
    },
    simulation.RoundView: {
        "xy_m": "S M 2",
        "criticality": "S",
        "likelihood": "S",
        "names": "S",
        "user_xy_m": "K M 2",
        "met": "K?",
        "touch_xy_m": "C 2",
        "touch_names": "C",
    },
    point_cloud.PointCloud: {"points": "N 6"},
    radar_list.RadarList: {"returns": "N 5"},
}  # fmt: skip
"""Arrays that belong together: equal letters are equal lengths; with ? one may be empty instead."""


_PARAMETERS = frozenset({*VehicleParameters.__struct_fields__, UNDERSTEER_GRADIENT} - {"name"})
ONE_OF: dict[tuple[type[msgspec.Struct], str], frozenset[str]] = {
    (ParameterEstimate, "name"): _PARAMETERS,
    (ParameterChange, "name"): _PARAMETERS,
    (gap.GapAlarm, "quantity"): frozenset(gap.ALARM_LIMITS_PER_S),
}
"""Texts that are one of a table's names."""

ALL_OR_NONE: dict[type[msgspec.Struct], tuple[str, ...]] = {
    ParameterEstimate: ("value", "low", "high"),
}
"""Fields that are None together, or none of them is."""


class Within(NamedTuple):
    """A range, both ends included."""

    low: float
    high: float


ROAD_USER = {
    "speed_mps": Within(-120.0, 120.0),
    "length_m": Within(0.05, 100.0),
    "width_m": Within(0.05, 30.0),
    "yaw_rad": Within(-100.0, 100.0),
}
"""What a road user may be: a child's arm to the longest tram with its trailer, in any haste."""
