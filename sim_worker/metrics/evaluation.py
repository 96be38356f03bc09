"""The functions that compute the metrics of the table, and the call for those asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from foretwin.sim_worker.metrics import (
    comfort,
    displacement,
    encroachment,
    extended_score,
    following,
    impact,
    progress,
    score,
    threat,
    time_to_collision,
    violations,
    worst_case,
)
from foretwin.sim_worker.metrics.rollout import Context, Measure, Rollout, RolloutView
from foretwin.sim_worker.metrics.table import METRICS, Need

COMPUTED: Mapping[str, Callable[[RolloutView], Measure]] = MappingProxyType(
    {
        "ade": displacement.ade,
        "fde": displacement.fde,
        "lateral": displacement.lateral,
        "longitudinal": displacement.longitudinal,
        "heading": displacement.heading,
        "ape": displacement.ape,
        "rpe": displacement.rpe,
        "frechet": displacement.frechet,
        "dtw": displacement.dtw,
        "ttc": time_to_collision.ttc,
        "ttc_series": time_to_collision.ttc_series,
        "time_exposed": time_to_collision.time_exposed,
        "time_integrated": time_to_collision.time_integrated,
        "wttc": worst_case.worst_time_to_collision,
        "pet": encroachment.post_encroachment_time,
        "et": encroachment.encroachment_time,
        "psd": encroachment.proportion_of_stopping_distance,
        "thw": following.time_headway,
        "drac": following.drac,
        "required_deceleration": following.required_deceleration,
        "required_lateral_acceleration": following.required_lateral_acceleration,
        "required_acceleration": following.required_acceleration,
        "btn": threat.brake_threat_number,
        "stn": threat.steer_threat_number,
        "ttb": threat.time_to_brake,
        "tts": threat.time_to_steer,
        "ttr": threat.time_to_react,
        "rss_distance": threat.rss_distance,
        "rss_margin": threat.rss_margin,
        "min_clearance": impact.minimum_clearance,
        "collided": impact.collided,
        "at_fault_collision": impact.at_fault_collision,
        "collision_time": impact.collision_time,
        "impact_speed": impact.impact_speed,
        "closing_speed": impact.closing_speed,
        "delta_v": impact.delta_v,
        "max_acceleration": comfort.max_acceleration,
        "max_deceleration": comfort.max_deceleration,
        "max_lateral_acceleration": comfort.max_lateral_acceleration,
        "max_jerk": comfort.max_jerk,
        "max_longitudinal_jerk": comfort.max_longitudinal_jerk,
        "max_yaw_rate": comfort.max_yaw_rate,
        "max_yaw_acceleration": comfort.max_yaw_acceleration,
        "comfortable": comfort.comfortable,
        "progress": progress.progress,
        "backwards": progress.backwards,
        "off_road_share": progress.off_road_share,
        "on_road": progress.on_road,
        "red_light_violations": violations.red_light_violations,
        "right_of_way_violations": violations.right_of_way_violations,
        "driving_score": score.driving_score,
        "epdms": extended_score.extended_score,
        "epdms_no_fault": extended_score.no_at_fault,
        "epdms_direction": extended_score.driving_direction,
        "epdms_lights": extended_score.traffic_lights,
        "epdms_ttc": extended_score.time_to_collision_kept,
        "epdms_lane": extended_score.lane_keeping,
    }
)
"""How each metric of the table is computed."""


def computable(context: Context) -> tuple[str, ...]:
    """Return the names of all metrics that `context` suffices for, in the table's order."""
    return tuple(name for name in METRICS if not _missing(name, context))


def evaluate(
    rollout: Rollout, names: Sequence[str] | None = None, *, context: Context | None = None
) -> dict[str, Measure]:
    """Return the named metrics of a rollout, by default all that `context` suffices for.

    Values are NaN where the mask is false: for futures that are not valid, and where a metric says
    so. Raises ValueError for an unknown name, for a metric whose needs `context` lacks, and for
    arrays whose shapes do not fit.
    """
    given = context or Context()
    chosen = computable(given) if names is None else tuple(names)
    unknown = [name for name in chosen if name not in METRICS]
    if unknown:
        raise ValueError(f"unknown metric {', '.join(unknown)}; known: {', '.join(METRICS)}")
    for name in chosen:
        if missing := _missing(name, given):
            raise ValueError(f"metric {name} needs {', '.join(missing)}, which is not given")
    view = RolloutView(rollout, given)
    return {name: COMPUTED[name](view) for name in chosen}


def _missing(name: str, context: Context) -> tuple[Need, ...]:
    return tuple(need for need in METRICS[name].needs if getattr(context, need) is None)
