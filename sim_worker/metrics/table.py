"""All metrics in one table: what each is called, measured in, and needs.

What computes them is named, and loaded by `evaluation.py` alone: who only names metrics loads
nothing that computes.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Literal, NamedTuple

Need = Literal["path", "ground", "rules", "lanes", "reference", "user_mass_kg"]
"""Fields of `Context` without which a metric cannot be computed."""
Better = Literal["lower", "higher", "neither"]


class Metric(NamedTuple):
    """One row: module and function here that compute it, its unit ("1" for counts, shares and
    verdicts), which direction is better, what it needs, whether it has a value for each instant
    (S, N), and whether it is relative to the other futures that are measured with it."""

    computed_by: str
    unit: str
    better: Better
    needs: tuple[Need, ...] = ()
    series: bool = False
    relative: bool = False


_DRIVEN: tuple[Need, ...] = ("path", "ground")
_ROUTED: tuple[Need, ...] = ("path", "ground", "rules", "lanes")

METRICS = MappingProxyType(
    {
        "ade": Metric("displacement.ade", "m", "lower", ("reference",)),
        "fde": Metric("displacement.fde", "m", "lower", ("reference",)),
        "lateral": Metric("displacement.lateral", "m", "neither", ("reference",)),
        "longitudinal": Metric("displacement.longitudinal", "m", "neither", ("reference",)),
        "heading": Metric("displacement.heading", "rad", "neither", ("reference",)),
        "ape": Metric("displacement.ape", "m", "lower", ("reference",)),
        "rpe": Metric("displacement.rpe", "m", "lower", ("reference",)),
        "frechet": Metric("displacement.frechet", "m", "lower", ("reference",)),
        "dtw": Metric("displacement.dtw", "m", "lower", ("reference",)),
        "ttc": Metric("time_to_collision.ttc", "s", "higher"),
        "ttc_series": Metric("time_to_collision.ttc_series", "s", "higher", series=True),
        "time_exposed": Metric("time_to_collision.time_exposed", "s", "lower"),
        "time_integrated": Metric("time_to_collision.time_integrated", "s²", "lower"),
        "wttc": Metric("worst_case.worst_time_to_collision", "s", "higher"),
        "pet": Metric("encroachment.post_encroachment_time", "s", "higher"),
        "et": Metric("encroachment.encroachment_time", "s", "lower"),
        "psd": Metric("encroachment.proportion_of_stopping_distance", "1", "higher"),
        "thw": Metric("following.time_headway", "s", "higher"),
        "drac": Metric("following.drac", "m/s²", "lower"),
        "required_deceleration": Metric("following.required_deceleration", "m/s²", "lower"),
        "required_lateral_acceleration": Metric(
            "following.required_lateral_acceleration", "m/s²", "lower"
        ),
        "required_acceleration": Metric("following.required_acceleration", "m/s²", "lower"),
        "btn": Metric("threat.brake_threat_number", "1", "lower"),
        "stn": Metric("threat.steer_threat_number", "1", "lower"),
        "ttb": Metric("threat.time_to_brake", "s", "higher"),
        "tts": Metric("threat.time_to_steer", "s", "higher"),
        "ttr": Metric("threat.time_to_react", "s", "higher"),
        "rss_distance": Metric("threat.rss_distance", "m", "lower"),
        "rss_margin": Metric("threat.rss_margin", "m", "higher"),
        "min_clearance": Metric("impact.minimum_clearance", "m", "higher"),
        "collided": Metric("impact.collided", "1", "lower"),
        "at_fault_collision": Metric("impact.at_fault_collision", "1", "lower"),
        "collision_time": Metric("impact.collision_time", "s", "higher"),
        "impact_speed": Metric("impact.impact_speed", "m/s", "lower"),
        "closing_speed": Metric("impact.closing_speed", "m/s", "lower"),
        "delta_v": Metric("impact.delta_v", "m/s", "lower", ("user_mass_kg",)),
        "max_acceleration": Metric("comfort.max_acceleration", "m/s²", "lower"),
        "max_deceleration": Metric("comfort.max_deceleration", "m/s²", "lower"),
        "max_lateral_acceleration": Metric("comfort.max_lateral_acceleration", "m/s²", "lower"),
        "max_jerk": Metric("comfort.max_jerk", "m/s³", "lower"),
        "max_longitudinal_jerk": Metric("comfort.max_longitudinal_jerk", "m/s³", "lower"),
        "max_yaw_rate": Metric("comfort.max_yaw_rate", "rad/s", "lower"),
        "max_yaw_acceleration": Metric("comfort.max_yaw_acceleration", "rad/s²", "lower"),
        "comfortable": Metric("comfort.comfortable", "1", "higher"),
        "progress": Metric("progress.progress", "m", "higher", ("path",)),
        "backwards": Metric("progress.backwards", "m", "lower", ("path",)),
        "off_road_share": Metric("progress.off_road_share", "1", "lower", ("ground",)),
        "on_road": Metric("progress.on_road", "1", "higher", ("ground",)),
        "red_light_violations": Metric("violations.red_light_violations", "1", "lower", ("rules",)),
        "right_of_way_violations": Metric(
            "violations.right_of_way_violations", "1", "lower", ("rules",)
        ),
        "driving_score": Metric("score.driving_score", "1", "higher", _DRIVEN, relative=True),
        "epdms": Metric("extended_score.extended_score", "1", "higher", _ROUTED, relative=True),
        "epdms_no_fault": Metric("extended_score.no_at_fault", "1", "higher", ("ground", "lanes")),
        "epdms_direction": Metric(
            "extended_score.driving_direction", "1", "higher", ("path", "lanes")
        ),
        "epdms_lights": Metric("extended_score.traffic_lights", "1", "higher", ("rules",)),
        "epdms_ttc": Metric(
            "extended_score.time_to_collision_kept", "1", "higher", ("ground", "lanes")
        ),
        "epdms_lane": Metric("extended_score.lane_keeping", "1", "higher", ("path", "lanes")),
    }
)

ROW_METRICS = tuple(
    name for name, row in METRICS.items() if not row.series and "reference" not in row.needs
)
"""Metrics that are one number of one future, without a drive to compare it with."""
