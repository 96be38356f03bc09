"""All metrics in one table: what each is called, measured in, and needs.

How they are computed stands in `evaluation.py`, so that who only names them loads nothing that
computes.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Literal, NamedTuple

Need = Literal["path", "ground", "rules", "lanes", "reference", "user_mass_kg"]
"""Fields of `Context` without which a metric cannot be computed."""
Better = Literal["lower", "higher", "neither"]


class Metric(NamedTuple):
    """One row: its unit ("1" for counts, shares and verdicts), which direction is better, what it
    needs, and whether it has a value for each instant (S, N)."""

    unit: str
    better: Better
    needs: tuple[Need, ...] = ()
    series: bool = False


_DRIVEN: tuple[Need, ...] = ("path", "ground")
_ROUTED: tuple[Need, ...] = ("path", "ground", "rules", "lanes")

METRICS = MappingProxyType(
    {
        "ade": Metric("m", "lower", ("reference",)),
        "fde": Metric("m", "lower", ("reference",)),
        "lateral": Metric("m", "neither", ("reference",)),
        "longitudinal": Metric("m", "neither", ("reference",)),
        "heading": Metric("rad", "neither", ("reference",)),
        "ape": Metric("m", "lower", ("reference",)),
        "rpe": Metric("m", "lower", ("reference",)),
        "frechet": Metric("m", "lower", ("reference",)),
        "dtw": Metric("m", "lower", ("reference",)),
        "ttc": Metric("s", "higher"),
        "ttc_series": Metric("s", "higher", series=True),
        "time_exposed": Metric("s", "lower"),
        "time_integrated": Metric("s²", "lower"),
        "wttc": Metric("s", "higher"),
        "pet": Metric("s", "higher"),
        "et": Metric("s", "lower"),
        "psd": Metric("1", "higher"),
        "thw": Metric("s", "higher"),
        "drac": Metric("m/s²", "lower"),
        "required_deceleration": Metric("m/s²", "lower"),
        "required_lateral_acceleration": Metric("m/s²", "lower"),
        "required_acceleration": Metric("m/s²", "lower"),
        "btn": Metric("1", "lower"),
        "stn": Metric("1", "lower"),
        "ttb": Metric("s", "higher"),
        "tts": Metric("s", "higher"),
        "ttr": Metric("s", "higher"),
        "rss_distance": Metric("m", "lower"),
        "rss_margin": Metric("m", "higher"),
        "min_clearance": Metric("m", "higher"),
        "collided": Metric("1", "lower"),
        "at_fault_collision": Metric("1", "lower"),
        "collision_time": Metric("s", "higher"),
        "impact_speed": Metric("m/s", "lower"),
        "closing_speed": Metric("m/s", "lower"),
        "delta_v": Metric("m/s", "lower", ("user_mass_kg",)),
        "max_acceleration": Metric("m/s²", "lower"),
        "max_deceleration": Metric("m/s²", "lower"),
        "max_lateral_acceleration": Metric("m/s²", "lower"),
        "max_jerk": Metric("m/s³", "lower"),
        "max_longitudinal_jerk": Metric("m/s³", "lower"),
        "max_yaw_rate": Metric("rad/s", "lower"),
        "max_yaw_acceleration": Metric("rad/s²", "lower"),
        "comfortable": Metric("1", "higher"),
        "progress": Metric("m", "higher", ("path",)),
        "backwards": Metric("m", "lower", ("path",)),
        "off_road_share": Metric("1", "lower", ("ground",)),
        "on_road": Metric("1", "higher", ("ground",)),
        "red_light_violations": Metric("1", "lower", ("rules",)),
        "right_of_way_violations": Metric("1", "lower", ("rules",)),
        "driving_score": Metric("1", "higher", _DRIVEN),
        "epdms": Metric("1", "higher", _ROUTED),
        "epdms_no_fault": Metric("1", "higher", ("ground", "lanes")),
        "epdms_direction": Metric("1", "higher", ("path", "lanes")),
        "epdms_lights": Metric("1", "higher", ("rules",)),
        "epdms_ttc": Metric("1", "higher", ("ground", "lanes")),
        "epdms_lane": Metric("1", "higher", ("path", "lanes")),
    }
)

ROW_METRICS = tuple(
    name for name, row in METRICS.items() if not row.series and "reference" not in row.needs
)
"""Metrics that are one number of one future, without a drive to compare it with."""
