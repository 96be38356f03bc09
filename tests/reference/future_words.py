"""What the columns of rounds, jobs and their futures say; the other tables are in `table_words`."""

from __future__ import annotations

from collections.abc import Mapping

OF_A_PLACE = {
    "x_m": "east of {0} in the drive's frame",
    "y_m": "north of {0} in the drive's frame",
    "yaw_rad": "yaw of {0}, counter-clockwise from east",
    "speed_mps": "speed of {0}",
}
"""Columns of a place, and how one is told of what."""


def each_of(words: Mapping[str, str], of: Mapping[str, str]) -> dict[str, str]:
    """Return the words of columns for each of several things, by the prefix of its columns."""
    return {
        f"{prefix}{name}": text.format(what)
        for prefix, what in of.items()
        for name, text in words.items()
    }


COLUMNS: Mapping[str, Mapping[str, str]] = {
    "rounds": {
        "futures": "how many were run",
        "distinct": "how many of them end apart from each other",
        "collided": "how many of them collided",
        "cruise_speed_mps": "speed that the nominal future aims at",
        "latency_ms": "from when the round began to its last result",
        "sim_seconds": "seconds simulated, all futures together",
        "cpu_seconds": "processor time of the workers",
        "sha256": "hash of all results of the round",
        "late": "whether it took longer than its period",
    },
    "futures": {
        "future_id": "its id for ever, from the hash of its job and its place in it",
        "index": "its place in its job",
        "name": "what it is called, such as its scenario or speed",
        "stamp_ns": "of the measured state with which it begins; null where a case says where",
        "planner": "who drove the ego",
        "vehicle": "the vehicle's name",
        "seed": "of what was drawn in it",
        "horizon_s": "how long it was to be played",
        "scenario": "what was to happen",
        "place": "at which place of the junction",
        "cell": "of a sweep, its number among all",
        "case": "the scenario's case",
        "values": "every number drawn for it, by name",
        "seen_road_users": "how many others the car saw as it began",
        "replayed_road_users": "how many others go where they were recorded",
        "valid": "whether it was played to its end; null where nothing is known",
        "failure": "why it was not played to its end",
        "remark": "what its planner says",
        "left_out": "why its case cannot happen there",
        "planned_impact_time_s": "of a staged case, when it touches if nobody intervenes",
        "planned_impact_with": "whom",
        "planned_impact_off_m": "how far from there the ego was hit",
        "collided": "whether it hit a road user or what stands",
        "collision_time_s": "when",
        "collision_with": "road_user or static",
        "likelihood": "how likely it is, 1 as likely as any",
        "criticality": "likelihood times the risk that somebody dies",
        "min_clearance_m": "the least distance to any road user",
        "progress_m": "how far along its path it came",
        **each_of(OF_A_PLACE, {"end_": "the ego at its end"}),
        "end_yaw_rad": "yaw of the ego at its end; turns count on beyond π",
        "end_difference_from_nominal_m": "from the end of the nominal future of its round",
        "max_difference_from_nominal_m": "the greatest at any instant",
        "accident_with": "with whom: an actor, recorded ID or seen ID",
        "accident_kind": "what that one is",
        "accident_time_s": "when",
        "accident_x_m": "where, east in the World's frame",
        "accident_y_m": "where, north in the World's frame",
        "accident_angle_rad": "angle between the two",
        "accident_closing_mps": "closing speed across the touching faces",
        "accident_ego_delta_v_mps": "change of the ego's velocity",
        "accident_user_delta_v_mps": "change of the other's velocity",
        "trajectory_sha256": "hash of the ego's states and everybody's poses",
        "worker_id": "of a drive, who computed it",
    },
    "road_users": {
        "name": "recorded ID or seen ID",
        "kind": "what it is",
        **each_of(OF_A_PLACE, {"": "it"}),
        "length_m": "its length, null where nobody said",
        "width_m": "its width, null where nobody said",
    },
    "jobs": {
        "stamp_ns": "of the measured state with which it begins; 0 where cases say where",
        "vehicle": "digest of the vehicle's parameters; their file lies in vehicles/",
        "futures": "how many it has",
        "engine": "by what it was simulated",
        "job": "the job itself, from which foretwin repeat plays it again",
    },
    "metrics": {
        "name": "the metric",
        "unit": "its unit, 1 for counts, shares and verdicts",
        "better": "which direction is better: lower, higher or neither",
    },
}
"""By table and column."""
