"""Which motion a lattice planner chooses: candidates along and across the path, all of them rated.

The polynomials are those of Werling, Ziegler, Kammel, Thrun (2010), Optimal trajectory generation
for dynamic street scenarios in a Frenet frame, ICRA.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker import driver_model as driver
from foretwin.sim_worker.planner_interface import PlannerView
from foretwin.sim_worker.planners.giving_way import wait_arcs
from foretwin.sim_worker.planners.lattice_rating import (
    CANDIDATE_ACCEL_MPS2,
    collisions,
    rate_across,
    rate_along,
)
from foretwin.sim_worker.planners.polynomials import (
    Floats,
    Motions,
    braked,
    joined,
    to_place,
    to_speed,
)
from foretwin.sim_worker.planners.prediction import Changes
from foretwin.sim_worker.vehicle.reference_points import front_from_base_m

_SPEED_SHARES = np.array([1.0, 0.8, 0.6, 0.35, 0.0])
_SPEED_TIMES_S = np.array([2.5, 5.0])
_ASIDE_M = np.array([0.0, -0.5, 0.5, -1.0, 1.0, -1.5, 1.5])
_ASIDE_TIMES_S = np.array([2.0, 3.5])

Planned = tuple[Floats, Floats, Floats, Floats]
"""What the last plan has for now: acceleration along; place, speed, acceleration across."""


def choose(
    view: PlannerView, before: Planned | None = None, changing: Changes | None = None
) -> tuple[Motions, Motions]:
    """Return the best motions of S cars along and across the path, from now on.

    `before` is what the last plan has for now: acceleration along, and place, speed, acceleration
    across the path; `changing` is how others change their motion.
    """
    states = view.states
    slant = states[:, 2] - view.path.yaw_at(view.arc_m)
    speed = np.maximum(states[:, 3] * np.cos(slant), 0.0)
    accel: Floats = states[:, 7]
    offset: Floats = view.offset_m
    slide: Floats = states[:, 3] * np.sin(slant)
    push: Floats = np.zeros_like(slide)
    if before is not None:
        accel = before[0]
        keeps = np.abs(before[1] - offset) < 0.4
        offset, slide, push = (
            np.where(keeps, planned, present)
            for planned, present in zip(before[1:], (offset, slide, push), strict=True)
        )
    accel = np.where(speed < 0.1, np.maximum(accel, 0.0), accel)
    accel = np.minimum(np.maximum(accel, -driver.MAX_DECEL_MPS2), CANDIDATE_ACCEL_MPS2)
    stop = _stop_places(view)
    along = _along(view, speed, accel, stop)
    across = _across(view, offset, slide, push)
    along_cost, places, speeds = rate_along(view, along, stop)
    across_cost, offsets = rate_across(view, across, speed)
    total = along_cost[:, :, None] + across_cost[:, None, :]
    total += collisions(view, places, speeds, offsets, changing)
    best = total.reshape(len(total), -1).argmin(axis=1)
    rows = np.arange(len(total))
    first, second = np.divmod(best, total.shape[2])
    return along.of(rows, first), across.of(rows, second)


def _stop_places(view: PlannerView) -> Array:
    """Return (S,) where base_link has to stand for a light or for others, infinite for nothing."""
    stop = wait_arcs(view)
    if view.stop_arc_m is not None:
        stop = np.minimum(stop, view.stop_arc_m)
    stop = stop - front_from_base_m(view.vehicle)
    # Who cannot stop any more goes on.
    way = np.maximum(stop - view.arc_m, 0.1)
    needs = np.square(np.maximum(view.states[:, 3], 0.0)) / (2.0 * way)
    return np.where(needs < 4.0, stop, np.inf)


def _along(view: PlannerView, speed: Array, accel: Floats, stop: Array) -> Motions:
    """Return (S, L) motions along the path."""
    arc, speed, accel = view.arc_m[:, None], speed[:, None], accel[:, None]
    profile = view.path.speed_profile(
        lateral_accel_mps2=driver.LATERAL_ACCEL_MPS2, decel_mps2=driver.COMFORT_DECEL_MPS2
    )
    bend = view.path.at_nodes(profile, arc + speed * _SPEED_TIMES_S)
    wanted = np.minimum(view.target_speed_mps[:, None], view.speed_factor[:, None] * bend)
    ends = (wanted[:, :, None] * _SPEED_SHARES).reshape(len(arc), -1)
    times = np.repeat(_SPEED_TIMES_S, len(_SPEED_SHARES))
    keeping = to_speed(arc, speed, accel, end_speed=ends, end_s=times)

    brake_s = np.maximum(speed / np.array([6.0, 3.5]) * 1.3, 0.5)
    braking = to_speed(arc, speed, accel, end_speed=np.zeros_like(brake_s), end_s=brake_s)
    emergency = braked(arc, speed, decel=driver.MAX_DECEL_MPS2)

    way = np.minimum(np.maximum(stop[:, None] - driver.LINE_GAP_M - arc, 0.0), 150.0)
    stop_s = np.clip(2.0 * way / np.maximum(speed, 2.0), 1.0, 12.0) * np.array([1.0, 1.4])
    stopping = to_place(
        arc, speed, accel, end_place=arc + way, end_speed=np.zeros_like(stop_s), end_s=stop_s
    )

    lead = np.maximum(view.lead_speed_mps, 0.0)[:, None]
    gap = np.minimum(view.lead_gap_m, 150.0)[:, None]
    room = gap + lead * _SPEED_TIMES_S - driver.STANDSTILL_GAP_M - driver.BRISK_TIME_GAP_S * lead
    place, pace = arc + np.maximum(room, 0.0), np.broadcast_to(lead, room.shape)
    following = to_place(arc, speed, accel, end_place=place, end_speed=pace, end_s=_SPEED_TIMES_S)
    return joined(keeping, braking, stopping, following, emergency)


def _across(view: PlannerView, offset: Floats, slide: Floats, push: Floats) -> Motions:
    """Return (S, D) motions across the path: to offsets beside the wanted one, and to stay."""
    offset, slide, push = offset[:, None], slide[:, None], push[:, None]
    aside = np.repeat(_ASIDE_M, len(_ASIDE_TIMES_S))
    times = np.append(np.tile(_ASIDE_TIMES_S, len(_ASIDE_M)), 2.0)
    ends = np.concatenate([view.desired_offset_m[:, None] + aside, offset], axis=1)
    rest = np.zeros_like(ends)
    return to_place(offset, slide, push, end_place=ends, end_speed=rest, end_s=times)
