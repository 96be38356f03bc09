"""Where a car has to wait: ground of others, ground it could not leave, those who walk.

Gap acceptance: who waits enters once the next of those with priority is farther away in time than
the critical gap, and than the own way out takes; behind a car that has just entered, than the
follow-up time. Brilon, Wu, Bondzio (1997), Unsignalized Intersections in Germany: at entries of
compact roundabouts 4.1 s and 2.9 s; Highway Capacity Manual, 6th ed., exhibits 20-11 and 20-12:
4.1 s and 2.2 s for turns across oncoming traffic. Other manoeuvres take longer to clear, which the
own way out accounts for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.frames import wrap_angle
from foretwin.sim_worker import driver_model as driver
from foretwin.sim_worker.planner_interface import PlannerView, SeenUsers, SharedGround, rows_of
from foretwin.sim_worker.vehicle.reference_points import front_from_base_m

CRITICAL_GAP_S = 4.1
FOLLOW_UP_S = 2.9
_LOOKS_M = 15.0
"""Beyond its way to a stop a car looks so far for ground where it has to wait."""
_AIMS_BESIDE_M = 2.0
_AIMS_WITHIN_RAD = 0.6
_BEARS_WITHIN_RAD = 1.2
_OWN_LANE_M, _OWN_LANE_RAD = 2.0, 0.6
_ROOM_M = 1.5
_CHAIN_M = 25.0
"""Ground follows ground without room to stop between for no longer than this."""
_SLOW_MPS = 3.0
_VULNERABLE_WIDTH_M = 1.0
_VULNERABLE_MPS = 8.0
_WALKER_MARGIN_M = 0.6
_WALKER_AHEAD_S = 4.0


class GroundLines(NamedTuple):
    """For each of C pieces of shared ground (C,): where to stop before it, where all is left."""

    stop_arc_m: Array
    clear_arc_m: Array


def ground_lines(ground: SharedGround, *, length_m: float) -> GroundLines:
    """Join pieces of ground between which a car of that length has no room to stand."""
    stop: list[float] = []
    clear: list[float] = []
    begins: list[int] = []
    first, far = 0.0, -np.inf
    for enter, leave in zip(ground.enter_arc_m.tolist(), ground.leave_arc_m.tolist(), strict=True):
        if enter - far >= length_m + _ROOM_M or enter - first >= _CHAIN_M:
            first, far = enter, leave
            begins.append(len(stop))
        far = max(far, leave)
        stop.append(first)
        clear.append(far)
    ends = [*begins[1:], len(stop)]
    for begin, end in zip(begins, ends, strict=True):
        clear[begin:end] = [clear[end - 1]] * (end - begin)
    return GroundLines(np.array(stop), np.array(clear))


def wait_arcs(view: PlannerView) -> Array:
    """Return (S,) the arc length before which a car's front has to wait, infinite where it may go.

    Who is past the line, or can no more stop before it, has to be out of the way: it goes on.
    """
    arcs = np.full(len(view.arc_m), np.inf)
    if view.ground is None or not len(view.ground.enter_arc_m):
        return arcs
    lines = ground_lines(view.ground, length_m=view.vehicle.length_m.value)
    front = view.arc_m + front_from_base_m(view.vehicle)
    ahead = lines.stop_arc_m - front[:, None]
    speed = np.maximum(view.states[:, 3], 0.0)
    reach = np.square(speed) / (2.0 * driver.COMFORT_DECEL_MPS2) + _LOOKS_M
    concerns = (ahead > 0.0) & (ahead < reach[:, None])
    rows = np.flatnonzero(concerns.any(axis=1))
    if not len(rows):
        return arcs
    some = rows_of(view, rows)
    waits = concerns[rows] & _no_room_beyond(some, lines, front[rows])
    if view.users is not None:
        waits |= concerns[rows] & view.ground.waits & _taken(some, view.ground, front[rows])
    arcs[rows] = np.where(waits, lines.stop_arc_m, np.inf).min(axis=1)
    return arcs


def _no_room_beyond(view: PlannerView, lines: GroundLines, front_arc_m: Array) -> Flags:
    """(S, C) bool: whether who drives slowly ahead leaves no room beyond the ground."""
    rear = (front_arc_m + view.lead_gap_m + view.lead_speed_mps)[:, None]
    full = rear < lines.clear_arc_m + view.vehicle.length_m.value + _ROOM_M
    return np.asarray(full & (view.lead_speed_mps < _SLOW_MPS)[:, None])


def _taken(view: PlannerView, ground: SharedGround, front_arc_m: Array) -> Flags:
    """(S, C) bool: whether a road user with priority needs the ground too soon."""
    users = view.users
    assert users is not None
    taken = np.zeros((len(front_arc_m), len(ground.enter_arc_m)), dtype=bool)
    pieces = np.flatnonzero(ground.waits)
    row, user = np.nonzero(_near(users, front_arc_m, ground.point_m[pieces]))
    if not len(row) or not len(pieces):
        return taken
    speed = np.maximum(view.states[:, 3], 0.0)
    pace = _pace(view, ground, pieces)
    enter_s = _time_to(ground.enter_arc_m[pieces] - front_arc_m[:, None], speed, pace)
    left_m = ground.leave_arc_m[pieces] + view.vehicle.length_m.value - front_arc_m[:, None]
    needed_s = _time_to(left_m, speed, pace) + driver.LAG_S
    stands = (speed < driver.STANDING_MPS)[:, None]
    follows = ((view.lead_gap_m < 12.0) & (view.lead_speed_mps > 1.0))[:, None]
    least_s = np.where(stands, np.where(follows, FOLLOW_UP_S, CRITICAL_GAP_S), 0.0)
    needed_s = np.maximum(needed_s, least_s)
    course = _courses(users, ground, pieces, row, user)
    meets = course.heads & (course.arrive_s < needed_s[row])
    meets &= course.gone_s > enter_s[row] - driver.LEAD_S
    pair, piece = np.nonzero(meets)
    taken[row[pair], pieces[piece]] = True
    return taken


def _near(users: SeenUsers, front_arc_m: Array, points_m: Array) -> Flags:
    """(S, R) bool: who could matter, being near the ground, on wheels and not in the own lane."""
    if not len(points_m):
        return np.zeros(users.speed_mps.shape, dtype=bool)
    low, high = points_m.min(axis=0) - driver.SIGHT_M, points_m.max(axis=0) + driver.SIGHT_M
    x, y = users.poses[..., 0], users.poses[..., 1]
    near = (x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1]) & ~users.walks
    near &= (
        (np.abs(users.offset_m) > _OWN_LANE_M)
        | (np.abs(wrap_angle(users.turned_rad)) > _OWN_LANE_RAD)
        | (users.arc_m > front_arc_m[:, None] + users.size_m[..., 0])
    )
    return np.asarray(near)


def _pace(view: PlannerView, ground: SharedGround, pieces: Indices) -> Array:
    """Return (S, W) the speed at which pieces of the ground are crossed, as bends allow."""
    middle = 0.5 * (ground.enter_arc_m + ground.leave_arc_m)[pieces]
    profile = view.path.speed_profile(
        lateral_accel_mps2=view.bend_accel_mps2, decel_mps2=driver.COMFORT_DECEL_MPS2
    )
    bend = view.path.at_nodes(profile, middle)
    pace = np.minimum(view.target_speed_mps[:, None], view.speed_factor[:, None] * bend)
    return np.asarray(np.maximum(pace, 1.0))


def _time_to(distance_m: Array, speed_mps: Array, pace_mps: Array) -> Array:
    """Return (S, C) the time for a way that begins at a speed and goes on at a pace."""
    speed = speed_mps[:, None]
    pace = np.maximum(pace_mps, speed)
    distance = np.maximum(distance_m, 0.0)
    gaining = (np.square(pace) - np.square(speed)) / (2.0 * driver.MAX_ACCEL_MPS2)
    short = (
        np.sqrt(np.square(speed) + 2.0 * driver.MAX_ACCEL_MPS2 * distance) - speed
    ) / driver.MAX_ACCEL_MPS2
    long = (pace - speed) / driver.MAX_ACCEL_MPS2 + (distance - gaining) / pace
    return np.where(distance < gaining, short, long)


class _Courses(NamedTuple):
    """Of P others to W pieces of ground (P, W): who heads there, arrives when, and has left."""

    heads: Flags
    arrive_s: Array
    gone_s: Array


def _courses(
    users: SeenUsers, ground: SharedGround, pieces: Indices, row: Indices, user: Indices
) -> _Courses:
    """Predict others at their present speed.

    They head for ground that lies on their straight course or, where it is known how the ground
    is crossed, on a circular arc that ends in that direction.
    """
    x, y, yaw = users.poses[row, user].T[..., None]
    dx, dy = ground.point_m[pieces, 0] - x, ground.point_m[pieces, 1] - y
    cos, sin = np.cos(yaw), np.sin(yaw)
    ahead, beside = cos * dx + sin * dy, np.abs(cos * dy - sin * dx)
    half = 0.5 * users.size_m[row, user, 0][:, None]
    extent = 0.5 * (ground.leave_arc_m - ground.enter_arc_m)[pieces]
    reach = half + np.minimum(np.maximum(extent, 1.0), 6.0)
    far = np.hypot(dx, dy)
    speed = users.speed_mps[row, user][:, None]
    if ground.their_yaw_rad is None:
        heads = (ahead > 0.0) & (beside < _AIMS_BESIDE_M)
    else:
        bearing = np.arctan2(dy, dx)
        arrives = wrap_angle(2.0 * bearing - yaw - ground.their_yaw_rad[pieces])
        heads = np.abs(arrives) < _AIMS_WITHIN_RAD
        heads &= np.abs(wrap_angle(bearing - yaw)) < _BEARS_WITHIN_RAD
    moves = speed > driver.STANDING_MPS
    pace = np.maximum(speed, driver.STANDING_MPS)
    within = far < reach
    arrive_s = np.where(within, 0.0, (far - reach) / pace)
    gone_s = np.where(moves, (ahead + reach) / pace, np.inf)
    return _Courses(np.asarray((heads & moves) | (within & (gone_s > 0.0))), arrive_s, gone_s)


def walker_gap_m(view: PlannerView) -> Array:
    """Return (S,) from the front to who walks or rides over the path, infinite where it is free.

    It counts who is in the car's way, or will be within 4 s and before the car has passed.
    """
    users = view.users
    if users is None:
        return np.full(len(view.arc_m), np.inf)
    slow = (users.size_m[..., 1] < _VULNERABLE_WIDTH_M) & (users.speed_mps < _VULNERABLE_MPS)
    sideways = users.speed_mps * np.sin(users.turned_rad)
    counts = users.walks | (slow & (np.abs(sideways) > 0.5 * users.speed_mps))
    if not counts.any():
        return np.full(len(view.arc_m), np.inf)
    vehicle = view.vehicle
    half = 0.5 * users.size_m.max(axis=2)
    front = view.arc_m + front_from_base_m(vehicle)
    ahead = users.arc_m - half - front[:, None]
    left = users.offset_m - view.offset_m[:, None]
    corridor = 0.5 * vehicle.width_m.value + half + _WALKER_MARGIN_M
    away, rate = np.abs(left), np.abs(sideways)
    comes = left * sideways < 0.0
    inside = away < corridor
    with np.errstate(divide="ignore", invalid="ignore"):
        in_s = np.where(inside, 0.0, np.where(comes, (away - corridor) / rate, np.inf))
        out_s = np.where(comes, corridor + away, corridor - away) / rate
    speed = np.maximum(view.states[:, 3], 1.5)[:, None]
    passed_s = (ahead + 2.0 * half + vehicle.length_m.value) / speed
    meets = counts & (ahead > -1.0) & (in_s < _WALKER_AHEAD_S)
    meets &= (in_s < passed_s + driver.LAG_S) & (out_s > ahead / speed - driver.LEAD_S)
    return np.asarray(np.where(meets, np.maximum(ahead, 0.1), np.inf).min(axis=1))
