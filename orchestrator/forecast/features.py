"""What a forecast of progress is made from: how the car moved lately, and what lies ahead of it.

All of it is known as a round begins. What nobody knows, such as a bend where there is no map, is no
number, and a table that was learnt without it goes on without it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import SeenRoadUser
from foretwin.contracts.world import Control
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.orchestrator.forecast.motion_history import MotionHistory

CURVE_ACCEL_MPS2 = 2.0
"""Across the car, as drivers take bends in towns (Reymond et al. 2001, Human Factors 43 (3))."""
EASE_DECEL_MPS2 = 1.5
"""As drivers slow down for a bend without need (Treiber, Kesting 2013, ch. 11: comfortable)."""
BENDS_WITHIN_M = (10.0, 25.0, 50.0, 100.0)
FASTEST_MPS = 40.0
"""A bend that may be taken at more is none."""
LEAD_ASIDE_M = 1.6
"""Who is nearer to the path's centre than about half a lane drives on it."""
CONTROLS: tuple[Control, ...] = (
    "uncontrolled",
    "roundabout",
    "give_way",
    "all_way_stop",
    "stop",
    "signals",
)
"""Controls of a junction, by about how often one stops there; the feature is the place in it."""
DIFFERENCES_S = (0.5, 1.0, 2.0, 4.0, 8.0)
"""So long ago the car was so much slower: what it is now less what it was."""
RECENT_S = (10.0, 30.0)

FEATURES = (
    "time_s",
    "speed_mps",
    "accel_mps2",
    *(f"speed_gain_{ago_s:g}s_mps" for ago_s in DIFFERENCES_S),
    *(f"speed_most_{within_s:g}s_mps" for within_s in RECENT_S),
    "since_standing_s",
    "lateral_accel_mps2",
    *(f"bend_{within_m:g}m_mps" for within_m in BENDS_WITHIN_M),
    "ease_mps",
    "limit_mps",
    "junction_m",
    "control",
    "lead_gap_m",
    "lead_speed_mps",
)
"""Names of what a forecast is made from; the first is the instant that it is for."""


class AheadFacts(NamedTuple):
    """What lies ahead; no number where it is not known.

    `bend_mps` are the slowest speeds of the bends within `BENDS_WITHIN_M`, `ease_mps` is what
    bends ahead allow here, `junction_m` how far the next junction is, and `control` how it is
    controlled.
    """

    bend_mps: tuple[float, ...] = (math.nan,) * len(BENDS_WITHIN_M)
    ease_mps: float = math.nan
    limit_mps: float = math.nan
    junction_m: float = math.nan
    control: float = math.nan
    lead_gap_m: float = math.nan
    lead_speed_mps: float = math.nan


def bends_ahead(path: FrenetPath, arc_m: float) -> AheadFacts:
    """Return what a path says of its bends and its limit at a place."""
    bent = np.maximum(np.abs(path.curvature_pm), CURVE_ACCEL_MPS2 / FASTEST_MPS**2)
    speeds = np.sqrt(CURVE_ACCEL_MPS2 / bent)
    eased = path.speed_profile(lateral_accel_mps2=CURVE_ACCEL_MPS2, decel_mps2=EASE_DECEL_MPS2)
    here = int(np.clip(round(arc_m - path.first_arc_m), 0, len(speeds) - 1))
    slowest = np.minimum.accumulate(speeds[here : here + int(BENDS_WITHIN_M[-1]) + 1])
    bends = tuple(float(slowest[min(int(m), len(slowest) - 1)]) for m in BENDS_WITHIN_M)
    limit = float(path.speed_limit_mps[here])
    return AheadFacts(
        bend_mps=bends,
        ease_mps=float(min(eased[here], FASTEST_MPS)),
        limit_mps=limit if math.isfinite(limit) else math.nan,
    )


def lead_on(path: FrenetPath, arc_m: float, users: tuple[SeenRoadUser, ...]) -> tuple[float, float]:
    """Return how far ahead on the path the next road user is, and its speed along it."""
    if not users:
        return math.nan, math.nan
    xy = np.array([(user.x_m, user.y_m) for user in users])
    place = path.locate(xy)
    off_rad = np.array([user.yaw_rad for user in users]) - path.yaw_at(place.arc_m)
    speed = np.array([user.speed_mps for user in users]) * np.cos(off_rad)
    gap = place.arc_m - arc_m
    on_path = (np.abs(place.offset_m) < LEAD_ASIDE_M) & (gap > 2.0)
    if not on_path.any():
        return math.nan, math.nan
    nearest = int(np.argmin(np.where(on_path, gap, np.inf)))
    return float(gap[nearest]), float(speed[nearest])


def feature_row(
    history: MotionHistory, *, accel_mps2: float, yaw_rate_radps: float, ahead: AheadFacts
) -> Array:
    """Return (F,) the features of the history's newest moment; the instant is left at 0."""
    assert history.now is not None
    speed = history.now.speed_mps
    return np.array(
        [
            0.0,
            speed,
            accel_mps2,
            *(speed - history.speeds_mps(np.array(DIFFERENCES_S))),
            *(max(speed, float(history.recent_mps(within).max())) for within in RECENT_S),
            history.since_standing_s,
            speed * abs(yaw_rate_radps),
            *ahead.bend_mps,
            ahead.ease_mps,
            ahead.limit_mps,
            ahead.junction_m,
            ahead.control,
            ahead.lead_gap_m,
            ahead.lead_speed_mps,
        ]
    )
