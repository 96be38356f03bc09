"""Where an ego that was driven alone touches whom it is to meet: what a case can promise."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.batch.collision_detection import first_touches
from foretwin.sim_worker.futures.driven_line import DrivenLine, time_at
from foretwin.sim_worker.scenarios.impact import ego_box
from foretwin.sim_worker.scenarios.roles import ALONG, StagedCase

AFTER_S = 1.0
"""Lines go on for so long after the last impact."""
_WATCHED_S = 1.0
"""Before it, one who drives alone is looked at for touches."""
_ON_FRONT_M, _NEAR_FRONT_M = 0.02, 0.07
"""Points of the ego's front that are so near the other touch it, or do so within a tick: a point
that is promised is met within 0.1 m however control ticks fall."""
_OTHER_SHARE, _MOVED_M = 0.12, 0.5
"""So far along the front, and on the ground, a touch is still the one that was planned: a car that
runs wide or brakes is a little aside, and late."""
_MOVED_ALONG_M = 10.0
"""Who is ahead brakes for bends as its own line bends, not the ego's: it is met a second sooner or
later, at the same place of the front."""


def met_as_driven(
    cases: Mapping[int, tuple[StagedCase, DrivenLine]], stage: BatchSimulation
) -> dict[int, StagedCase]:
    """Return the cases that meet whom they are to on their lines, by row: each with the place, time
    and share of the front of the touch as it was driven."""
    if not cases:
        return {}
    rows, tick_s = list(cases), stage.control_dt_s
    states, users, sizes, since = [], [], [], []
    for case, line in cases.values():
        from_s = time_at(line, case.ego_arc_m, case.ego_speed_mps)
        first = max(math.ceil((from_s + case.impact_time_s - _WATCHED_S) / tick_s), 0)
        ticks = first + np.arange(round((_WATCHED_S + AFTER_S / 2.0) / tick_s))
        ticks = np.minimum(ticks, len(line.states) - 1)
        actor = next(a for a in case.actors if a.name == case.impact_with)
        way = case.place.way_named(actor.way)
        box = actor.moving(way.path)
        since_s = np.asarray(ticks * tick_s - from_s, dtype=np.float64)
        at = box.rectangles(box.arc_after(actor.start_on(way), since_s))
        states.append(line.states[ticks])
        users.append(np.column_stack([at.centre_m, at.yaw_rad])[:, None])
        sizes.append([(box.length_m, box.width_m)])
        since.append(float(since_s[0]))
    touches = first_touches(
        stage.vehicle, np.stack(states), np.stack(users), np.array(sizes), tick_s=tick_s
    )
    found = {}
    for n, future in enumerate(touches.future.tolist()):
        row = rows[future]
        x, y, yaw = touches.user_poses[n]
        other = Rectangles(np.array([x, y]), yaw, *touches.user_size_m[n])
        met = _met(cases[row][0], touches.ego_states[n], other, stage.vehicle)
        if met is not None:
            found[row] = met._replace(impact_time_s=since[future] + float(touches.time_s[n]))
    return found


def _met(
    case: StagedCase, state: Array, other: Rectangles, vehicle: VehicleParameters
) -> StagedCase | None:
    """Return a case with the point of the front that touches another's box, if that is about the
    planned one."""
    shares = np.clip(case.impact_share + np.linspace(-_OTHER_SHARE, _OTHER_SHARE, 25), 0.0, 1.0)
    points = hit_point_m(case, state, vehicle, shares)
    gaps = clearance(Rectangles(points, np.full(len(points), other.yaw_rad), 0.0, 0.0), other)
    off = np.abs(shares - case.impact_share)
    touching = gaps <= _ON_FRONT_M
    # Where a front meets a flank, the least angle between them decides which end is first.
    best = int(np.where(touching, off, np.inf).argmin() if touching.any() else off.argmin())
    if gaps[best] > _NEAR_FRONT_M:
        return None
    along = any(a.name == case.impact_with and a.relation in ALONG for a in case.actors)
    if np.hypot(*(points[best] - case.impact_point_m)) > (_MOVED_ALONG_M if along else _MOVED_M):
        return None
    return case._replace(impact_point_m=points[best], impact_share=float(shares[best]))


def off_plan_m(case: StagedCase, state: Array, vehicle: VehicleParameters) -> float:
    """Return how far the point of the ego that is to be hit is from where that is planned, with
    base_link in a state (8,)."""
    point = hit_point_m(case, state, vehicle, case.impact_share)
    return float(np.hypot(*(point - case.impact_point_m)))


def hit_point_m(
    case: StagedCase, state: Array, vehicle: VehicleParameters, share: Array | float
) -> Array:
    """Return (…, 2) the points at shares (…) of the ego's leading end, with base_link in a state
    (8,)."""
    box = ego_box(vehicle, case.place.ego.path, 0.0, reverse=case.place.reverse)
    yaw = float(state[2]) + (math.pi if case.place.reverse else 0.0)
    cos, sin = math.cos(yaw), math.sin(yaw)
    left = case.place.near_sign * (np.asarray(share) - 0.5) * box.width_m
    x = float(state[0]) + box.front_m * cos - left * sin
    y = float(state[1]) + box.front_m * sin + left * cos
    return np.stack([x, y], axis=-1)
