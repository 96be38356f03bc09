"""What the tables of a run hold: what a row is, and what each column of it says.

Numbers of a future and metrics have their words in tables of their own; the others stand here.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.sim_worker.metrics.table import METRICS
from tests.reference.future_words import COLUMNS as FUTURE_WORDS
from tests.reference.future_words import OF_A_PLACE, each_of
from tests.reference.gap_words import COLUMNS as GAP_WORDS

_ROWS = {
    "rounds": "one round that was run",
    "futures": "one future: what it was, and what became of it",
    "road_users": "one road user that all futures of a job share, as it begins",
    "jobs": "one job, with everything that decides its futures",
    "metrics": "what a column metric_… of futures means",
    "comparisons": "the nominal future of a round against what the car did, at one horizon",
    "forecasts": "what came of a round's forecast of the car's own progress, at one instant",
    "plan_comparisons": "the car's own plan against the nominal future of a round",
    "disagreements": "a stretch on which the driving stack planned otherwise than the human drove",
    "driven_segments": "a stretch between two takeovers",
    "agreement": "one window that was simulated and then driven, judged",
    "windows": "one window, with all that judging it needs",
    "siblings": "a future of a round on a second engine, beside the same one on MuJoCo",
    "mirror": "the real car, its twin, shadow and ghost at one instant, and the gap between them",
    "mirrored": "a vehicle beside the car at one instant",
    "virtual_road_users": "a road user of virtual traffic at one instant, which nobody real met",
    "touches": "two who began to touch in the mirror",
    "encounters": "two vehicles that came within 10 m of each other, as they were measured",
    "changes": "a change that an operator asked for",
    "parameters": "one parameter of the vehicle that counted from then on",
    "identifications": "what a stretch of driving says of one parameter",
    "gaps": "model minus reality after the model ran freely for a while",
    "verdicts": "who departs from the commands, the model or the vehicle",
    "junctions": "one passage of a junction",
    "events": "something worth telling the engineer",
    "marks": "an event that somebody marked, or a note that was added to it",
}
ROWS: Mapping[str, str] = MappingProxyType(_ROWS)
"""What one row of each table is."""

_OF_A_PREDICTION = {
    "ade_m": "mean distance of {0} from the real drive up to the horizon",
    "fde_m": "distance at the horizon of {0} from the real drive",
    "lateral_m": "of that the part across the real heading, positive left: {0}",
    "longitudinal_m": "of that the part along the real heading, positive ahead: {0}",
    "heading_rad": "heading at the horizon minus the real one, of {0}",
}
_CORRECTIONS = {
    "correction_along_mps2": "acceleration along the road by which a twin that follows is drawn",
    "correction_across_mps2": "the same across the road",
    "correction_yaw_radps2": "the same in yaw",
}


_EVERYWHERE = {
    "round_id": "number of the round",
    "stamp_ns": "the vehicle's clock",
    "drive_time_s": "seconds since the drive's first stamp",
    "world_id": "World in which it was played; its file lies in worlds/",
    "intersection_id": "junction ahead, as foretwin intersections calls it",
    "junction_id": "junction, as foretwin intersections calls it",
    "horizon_s": "how far ahead",
    "vehicle_id": "whose",
    "vehicle_version": "version of the vehicle's parameters, from the table parameters",
    "job_sha256": "hash of the job's bytes",
    "job_index": "place of the job in its round",
    "independent": "false where the model was driven by commands that were estimated from the very "
    "motion it is compared with",
    "role": "role in the mirror: all, twin, shadow or ghost",
}
_COLUMNS: Mapping[str, Mapping[str, str]] = {
    **FUTURE_WORDS,
    **GAP_WORDS,
    "comparisons": {
        **each_of(
            _OF_A_PREDICTION,
            {
                "nominal_": "the nominal future",
                "constant_velocity_": "driving straight on at the same speed",
                "constant_turn_rate_": "turning on at the same rate and speed",
            },
        ),
        "weighted_ade_m": "mean distance of the mean of all futures, weighed by their likelihoods",
    },
    "forecasts": {
        "travelled_m": "how far the car came",
        "p10_m": "10 % quantile of the forecast",
        "p50_m": "its median",
        "p90_m": "its 90 % quantile",
        "share": "the part of the forecast that lay below what came",
        "crps_m": "CRPS of the forecast",
        "crps_table_m": "of the same before it was calibrated in this drive",
        "crps_futures_m": "of the round's futures, all taken as equally likely, if any is valid",
    },
    "plan_comparisons": {
        "plan_stamp_ns": "stamp of the plan",
        "ade_m": "mean distance of the plan from the nominal future",
        "fde_m": "distance at the horizon",
        "lateral_m": "of that the part across, positive where the plan lies to the left",
        "longitudinal_m": "of that the part along, positive where the plan is ahead",
        "heading_rad": "heading of the plan minus that of the nominal future, at the horizon",
        "path_offset_m": "mean distance of the plan's path from the lane's centre, positive left",
    },
    "disagreements": {
        "segment": "which stretch between takeovers, from 0",
        "aspect": "way or pace",
        "kind": "how they differ",
        "stamp_ns": "of the first plan that was departed from",
        "end_stamp_ns": "of its end",
        "duration_s": "how long it lasted",
        "lat_deg": "where the car was as it began",
        "lon_deg": "where the car was as it began",
        "junction_id": "junction at which it was, or had before it",
        "route_m": "how far along its route",
        "lateral_m": "the greatest distance of the ways, positive where the stack's is left",
        "along_m": "ahead (positive) or behind, stack minus human, at the same instants",
        "speed_mps": "speed, stack minus human, at the same instants",
    },
    "driven_segments": {
        "number": "which, from 0",
        "control_mode": "who drove",
        "from_stamp_ns": "where it begins",
        "to_stamp_ns": "where it ends",
        "plans": "plans in it",
        "ways": "of these compared across: neither plan nor car stood or hardly moved",
        "cut": "of these compared only as far as the next takeover",
        "too_short": "of these not compared at all",
        "lateral_m": "95th percentile of their greatest distances across",
        "along_m": "the same along, of all plans",
        "speed_mps": "the same of speed, of all plans",
        "disagreements": "how many began in it",
    },
    "agreement": {
        "outcome": "how simulation and reality agree on it",
        "simulated": "verdict of the simulation",
        "driven": "verdict of the drive",
        "observable": "criteria that could be seen in the drive",
        "simulated_fails": "criteria that fail in the simulation",
        "driven_fails": "criteria that fail in the drive",
        "not_observable": "criteria that were asked for and could not be seen",
        "gap_along_m": "gap between both along the road",
        "gap_across_m": "across it",
        **{
            f"flip_{way}_{name}": text.format(what)
            for way, what in (("along", "along"), ("across", "across"), ("both", "both ways"))
            for name, text in (
                ("factor", "so many times the measured gap {0} changes the verdict"),
                ("m", "that gap {0} in metres"),
                ("fails", "criteria that fail then, of a gap {0}"),
            )
        },
    },
    "windows": {
        "vehicle": "digest of the vehicle's parameters",
        "window": "all that its verdict needs, as bytes",
    },
    "mirror": {
        **each_of(
            OF_A_PLACE,
            {
                "real_": "the real car",
                "twin_": "its twin",
                "shadow_": "its shadow",
                "ghost_": "its ghost",
                "free_": "the free twin, where `twin` is corrected or among other vehicles",
            },
        ),
        "gap_m": "distance of the free twin from the real car",
        "gap_along_m": "of that the part along the real heading, positive ahead",
        "gap_across_m": "of that the part across it, positive left",
        "gap_yaw_rad": "yaw of the free twin minus the real one",
        "gap_speed_mps": "speed of the free twin minus the real one",
        "since_reset_s": "since the free twin began anew",
        **_CORRECTIONS,
    },
    "mirrored": {
        **each_of(OF_A_PLACE, {"real_": "where it was measured", "shown_": "it in its role"}),
        **_CORRECTIONS,
    },
    "virtual_road_users": {
        "user_id": "its id; futures that met it name it as `seen` and this id",
        "kind": "what it is",
        **dict.fromkeys(("lat_deg", "lon_deg"), "where the middle of its box was"),
        "yaw_rad": "its heading, from true east",
        "speed_mps": "its speed",
        "length_m": "its length",
        "width_m": "its width",
    },
    "touches": {"one": "a vehicle's id", "other": "whom it touched; world is what stands"},
    "encounters": {
        "one": "a vehicle's id",
        "other": "whom it met",
        "end_stamp_ns": "when their outlines were 20 m apart again, or one was gone",
        "least_m": "least distance between their outlines; 0 where they touched",
        "least_stamp_ns": "when that was, or when the touch began",
        "uncertain_m": "of that distance: one standard deviation, from both positions and clocks, "
        "and the bound of who was reckoned then",
        "touched": "whether their outlines overlapped",
    },
    "siblings": {
        "engine": "whose physics moved the car the second time",
        "which": "nominal or worst: of the round's, the future of the highest criticality",
        "future_id": "the round's future, in the table of futures",
        **{
            f"apart_{after}_s_m": f"distance of both engines' cars after {after} s"
            for after in (1, 2, 4)
        },
        "heading_rad": "second engine's heading minus MuJoCo's, at the last of these instants",
        "collided": "whether the car collides on MuJoCo",
        "sibling_collided": "whether it collides on the second engine",
        "matters": "whether the co-pilot was to know that engines disagree",
        "cpu_seconds": "what the second engine's process took for it, of one core",
        "took_s": "from the question to its answer",
        "motion_sha256": "hash of the second engine's motion, which foretwin repeat finds again",
    },
    "changes": {
        "asked_stamp_ns": "when it was asked for",
        "key": "what was changed",
        "before": "what it was",
        "value": "what it is from stamp_ns on",
    },
    "parameters": {
        "version": "number of the parameters as a whole",
        "name": "which parameter",
        "before": "its value before",
        "value": "its value from stamp_ns on",
        "std": "its standard deviation, null where nobody knows",
        "origin": "who gave it: file, identified, rolled_back or set",
        "pinned": "whether it stays whatever the driving says",
    },
    "identifications": {
        "from_stamp_ns": "where the stretch of driving begins",
        "name": "which parameter",
        "value": "what the stretch says; null where it says nothing",
        "low": "lower end of the 95 % interval",
        "high": "its upper end",
        "prior": "value that was in force",
        "reason": "why nothing is said, or what it would take to narrow the interval",
        "taken": "whether it counts from then on",
    },
    "junctions": {
        "id": "as foretwin intersections calls it",
        "kind": "kind of junction",
        "name": "its streets",
        "control": "how it is controlled",
        "lat": "latitude in degrees",
        "lon": "longitude in degrees",
        "seen_at_s": "drive time at which it was first ahead",
        "arrived_at_s": "drive time at which the car arrived",
        "built_at_s": "drive time at which its World was there",
        "within_radius_at_s": "drive time at which the car came within its World",
        "world_ready_before_s": "how long before that its World was ready",
    },
    "events": {"level": "info, warning or error", "source": "who says it", "text": "what"},
    "marks": {
        "mark_id": "the same for an event and its notes",
        "stamp_ns": "the event's, by the vehicle's clock",
        "drive_time_s": "the event's, in seconds of the drive",
        "utc_ns": "when it was said, by the clock of who marked",
        "by": "who marked",
        "note": "what was said of it; empty where nothing was",
        "junction_id": "the junction that the car was at, or had before it; null of a note",
        "lat_deg": "where the car was; null of a note",
        "lon_deg": "where the car was; null of a note",
    },
}


def meaning_of(table: str, column: str) -> str:
    """Return what a column of a table says; raises KeyError where nobody has written it down."""
    if column in _COLUMNS[table]:
        return _COLUMNS[table][column]
    if column in FUTURE_NUMBERS:
        return FUTURE_NUMBERS[column].meaning
    name = column.removeprefix("metric_")
    if name != column and name in METRICS:
        return f"metric {name} in {METRICS[name].unit}, {METRICS[name].better} is better"
    return _EVERYWHERE[column]
