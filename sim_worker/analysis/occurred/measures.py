"""How near it came: the project's own surrogate measures of one encounter, against thresholds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.analysis.occurred.along_way import Encounter
from foretwin.sim_worker.analysis.occurred.driven_way import DrivenWay
from foretwin.sim_worker.analysis.occurred.rows import THRESHOLDS
from foretwin.sim_worker.analysis.occurred.scene import STEP_S, OtherCourse
from foretwin.sim_worker.metrics.encroachment import post_encroachment_time
from foretwin.sim_worker.metrics.following import drac, time_headway
from foretwin.sim_worker.metrics.rollout import Rollout, RolloutView
from foretwin.sim_worker.metrics.time_to_collision import ttc

_PAST_S = 6.0
"""Ways cross and are left within so long after an encounter, or nothing is said of it."""


class Measures(NamedTuple):
    """Least or greatest values of an encounter, None where there is none."""

    ttc_s: float | None
    pet_s: float | None
    drac_mps2: float | None
    time_headway_s: float | None

    @property
    def beyond(self) -> tuple[str, ...]:
        """Return which thresholds are passed."""
        passed = []
        for name, limit in THRESHOLDS.items():
            value = getattr(self, name)
            if value is None:
                continue
            if value < limit.value if limit.beyond == "below" else value > limit.value:
                passed.append(name)
        return tuple(passed)


def measures_of(way: DrivenWay, met: Encounter, vehicle: VehicleParameters) -> Measures:
    """Return the measures of an encounter, of the car and this one other alone."""
    course = met.course
    near = _view(way, course, met.first, met.after, vehicle)
    whole = _view(way, course, met.first, met.after + round(_PAST_S / STEP_S), vehicle)
    if near is None or whole is None:
        return Measures(None, None, None, None)
    pet = float(post_encroachment_time(whole).values[0])
    return Measures(
        ttc_s=finite(float(ttc(near).values[0])),
        pet_s=finite(pet),
        drac_mps2=finite(float(drac(near).values[0])),
        time_headway_s=finite(float(time_headway(near).values[0])),
    )


def _view(
    way: DrivenWay, course: OtherCourse, first: int, after: int, vehicle: VehicleParameters
) -> RolloutView | None:
    ego = way.ego
    after = min(after, len(ego.stamp_ns))
    known = np.isfinite(ego.xy_m[first:after, 0])
    if after - first < 2 or not known.all():
        return None
    count = after - first
    states = np.zeros((1, count, 8))
    states[0, :, :2] = ego.xy_m[first:after]
    for column, values in ((2, ego.yaw_rad), (3, ego.speed_mps), (5, ego.yaw_rate_radps)):
        states[0, :, column] = values[first:after]
    states[0, :, 7] = ego.accel_mps2[first:after]
    users, speed = np.full((1, count, 1, 3), np.nan), np.full((1, count, 1), np.nan)
    begin, end = max(first, course.first), min(after, course.first + len(course.xy_m))
    if end <= begin:
        return None
    there, own = slice(begin - first, end - first), slice(begin - course.first, end - course.first)
    users[0, there, 0, :2] = course.xy_m[own]
    users[0, there, 0, 2] = course.yaw_rad[own]
    speed[0, there, 0] = np.where(course.standing[own], 0.0, course.speed_mps[own])
    return RolloutView(
        Rollout(
            time_s=np.arange(count, dtype=np.float64) * STEP_S,
            states=states,
            users=users,
            user_speed_mps=speed,
            user_size_m=np.array([[course.size_m]]),
            valid=np.ones(1, dtype=bool),
            vehicle=vehicle,
        )
    )


def finite(value: float) -> float | None:
    """Return a value, None where it is infinite or NaN: there was none."""
    return value if np.isfinite(value) else None
