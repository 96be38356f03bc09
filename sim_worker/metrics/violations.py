"""Rules broken at junctions: stop lines crossed at red, and right of way not given."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.drive import SignalColour
from foretwin.geometry.polyline import arc_lengths
from foretwin.sim_worker.driver_model import ALONG_COS, STANDING_MPS
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView
from foretwin.sim_worker.metrics.route_rules import PriorityConflict, RouteRules
from foretwin.world_gen.rules.signal_state import colours_at, parts_of_cycle

HARD_BRAKING_MPS2 = 2.0
"""A road user with priority that must brake harder was not given way to."""
NARROW_S = 1.0
"""Nor was one that reaches the shared ground sooner than this after the ego has left it."""
STOP_WITHIN_M = 6.0
"""A car that stands within so much before a stop line has stopped for it. Chosen."""
_AT_POINT_M = 2.5
_ON_WAY_M = 2.0
STOPS = ("red", "red_amber")
"""Colours that no front may pass a line at."""


def red_light_violations(view: RolloutView) -> Measure:
    """How many stop lines (S,) the ego's front crosses while their group shows red.

    Colours are those of the signal plans, or as heard, at the drive time of the crossing; amber is
    no violation, red and amber together is, and red is none for who has stopped before a turn that
    may then go on. Between instants the front moves straight.
    """
    rules = _rules(view)
    count = np.zeros(len(view.valid))
    for line in rules.lines:
        if line.group_id is None or line.control != "signal":
            continue
        future, time_s = line_crossings(view.front_m, line.ends_m, view.time_s)
        colours = _colours(view, line.group_id, time_s)
        ran = np.array([colour in STOPS for colour in colours], dtype=bool)
        if line.red_after_stop:
            crossings = zip(future, time_s.tolist(), strict=True)
            stood = (
                stood_before(view.front_m[row], view.speed_mps[row], view.time_s, at_s)
                for row, at_s in crossings
            )
            ran &= ~np.fromiter(stood, dtype=bool, count=len(future))
        np.add.at(count, future, ran)
    return view.measure(count)


def stood_before(front_m: Array, speed_mps: Array, time_s: Array, at_s: float) -> bool:
    """Return whether a motion, fronts (N, 2) at (N,), stopped for the line that it crosses."""
    gone_m = arc_lengths(front_m)
    line_m = float(np.interp(at_s, time_s, gone_m))
    near = (time_s <= at_s) & (gone_m >= line_m - STOP_WITHIN_M)
    return bool(np.abs(speed_mps[near]).min(initial=np.inf) <= STANDING_MPS)


def right_of_way_violations(view: RolloutView) -> Measure:
    """How many road users (S,) the ego forces to brake hard, or narrowly misses, against priority.

    Counted are those that drive on a movement that the ego must wait for, have not reached shared
    ground when the ego enters it, and would then have to brake by more than `HARD_BRAKING_MPS2`
    to arrive after the ego has left, or do arrive within `NARROW_S` of that. Constant
    deceleration from a distance d at speed v: v² / 2d to stop, 2 (v T - d) / T² to be there no
    sooner than in T. A movement whose signal is not green has no priority.
    """
    rules = _rules(view)
    futures, _, users = view.there.shape
    wronged = np.zeros((futures, users), dtype=bool)
    for conflict in rules.conflicts:
        enters, leaves = _own_passage(view, conflict)
        rows = np.flatnonzero(np.isfinite(enters) & view.valid)
        group = conflict.other_group_id
        if group is not None:
            colours = _colours(view, group, enters[rows])
            rows = rows[[colour in ("green", "unknown", "dark") for colour in colours]]
        if len(rows) and users:
            wronged[rows] |= _forced(view, conflict, rows, enters[rows], leaves[rows])
    return view.measure(wronged.sum(axis=1).astype(np.float64))


def _rules(view: RolloutView) -> RouteRules:
    if view.context.rules is None:
        raise ValueError("rules of the road need a World and a path")
    return view.context.rules


def _colours(view: RolloutView, group_id: str, at_s: Array) -> list[SignalColour]:
    """Return the colours of a group at times (K,)."""
    context, world = view.context, _rules(view).world
    if group_id in context.learnt:
        return [context.learnt[group_id].colour_at(time_s) for time_s in at_s.tolist()]
    plans = (*(junction.plan for junction in world.junctions), *world.crossing_plans)
    mine = [p for p in plans if p is not None and group_id in {group.id for group in p.groups}]
    plan = mine[-1] if mine else None
    if plan is None:
        return ["unknown"] * len(at_s)
    drive_s = context.start_s + at_s
    if context.live:
        return [colours_at(plan, time_s, context.live)[group_id] for time_s in drive_s.tolist()]
    # Colours change a few times a cycle: they are looked up once for all in between.
    _, first, part = np.unique(
        parts_of_cycle(plan, drive_s), return_index=True, return_inverse=True
    )
    found = [colours_at(plan, float(drive_s[k]))[group_id] for k in first]
    return [found[k] for k in part]


def line_crossings(front: Array, ends_m: Array, time_s: Array) -> tuple[Indices, Array]:
    """Return future (K,) and time (K,) of each crossing of a line, in the direction of travel.

    The line runs from left to right as its driver sees it: a crossing comes from its right-hand
    side, seen along it, to the left.
    """
    left, right = ends_m
    line = right - left
    length = float(np.hypot(*line))
    line = line / max(length, 1e-9)
    offset = front - left
    along = offset @ line
    beyond = offset[..., 1] * line[0] - offset[..., 0] * line[1]
    crossed = (beyond[:, :-1] < 0.0) & (beyond[:, 1:] >= 0.0)
    future, step = np.nonzero(crossed)
    share = beyond[future, step] / (beyond[future, step] - beyond[future, step + 1])
    at = along[future, step] + share * (along[future, step + 1] - along[future, step])
    within = (at >= -0.5) & (at <= length + 0.5)
    when = time_s[step] + share * (time_s[step + 1] - time_s[step])
    return future[within], when[within]


def _own_passage(view: RolloutView, conflict: PriorityConflict) -> tuple[Array, Array]:
    """Return when (S,) the ego enters shared ground, NaN where it does not or was there already,
    and when it has left it, infinite where it stays: where the rollout ends before and it moves, it
    goes on as fast."""
    offset = view.centre_m - conflict.point_m
    way = conflict.own_way
    along = offset @ way
    cos, sin = view.heading
    on_way: Flags = (np.abs(offset[..., 1] * way[0] - offset[..., 0] * way[1]) < _AT_POINT_M) & (
        cos * way[0] + sin * way[1] > ALONG_COS
    )
    enters = _first_above(along + view.half_length_m, conflict.own_from_m, view.time_s, on_way)
    rear = along - view.half_length_m
    leaves = _first_above(rear, conflict.own_until_m, view.time_s, on_way)
    along_mps = (view.speed_mps * (cos * way[0] + sin * way[1]))[:, -1]
    goes_on = on_way[:, -1] & (along_mps > STANDING_MPS)
    if view.counts is not None:
        goes_on &= view.counts[:, -1]
    left_s = (conflict.own_until_m - rear[:, -1]) / np.where(goes_on, along_mps, 1.0)
    later = np.where(goes_on & (left_s >= 0.0), view.time_s[-1] + left_s, np.inf)
    return enters, np.where(np.isnan(leaves), later, leaves)


def _first_above(values: Array, level: float, time_s: Array, counts: Flags) -> Array:
    """Return when (S,) `values` (S, N) first rise above `level` where `counts` holds, else NaN."""
    rises = (values[:, :-1] <= level) & (values[:, 1:] > level) & counts[:, 1:]
    step = rises.argmax(axis=1)
    row = np.arange(len(values))
    low, high = values[row, step], values[row, step + 1]
    rising = rises.any(axis=1)
    share = (level - low) / np.where(rising, high - low, 1.0)
    return np.where(rising, time_s[step] + share * (time_s[step + 1] - time_s[step]), np.nan)


def _forced(
    view: RolloutView, conflict: PriorityConflict, rows: Indices, enters: Array, leaves: Array
) -> Flags:
    """Return (K, R) whether road users of futures `rows` (K,) are not given way to."""
    x, y, yaw, speeds = view.users
    instant = np.searchsorted(view.time_s, enters).clip(0, len(view.time_s) - 1)
    users = x.shape[2]
    place = conflict.way.locate(
        np.stack([x[rows, instant].ravel(), y[rows, instant].ravel()], axis=-1)
    )
    direction = conflict.way.yaw_at(place.arc_m)
    along = np.cos(yaw[rows, instant].ravel() - direction)
    on_way = (np.abs(place.offset_m) < _ON_WAY_M) & (along > ALONG_COS)
    half_length = view.user_half_m[0][rows, 0].ravel()
    distance = conflict.way_from_m - place.arc_m - half_length
    candidate = np.flatnonzero(on_way & (distance > 0.0) & view.there[rows, instant].ravel())
    row, user = np.divmod(candidate, users)
    ahead, speed = distance[candidate], speeds[rows, instant].ravel()[candidate]
    needed = _needed_deceleration(ahead, speed, (leaves - enters)[row])
    arrives = _arrival(view, conflict, rows[row], user)
    narrow = (arrives < leaves[row] + NARROW_S) & (arrives > enters[row])
    found = np.zeros((len(rows), users), dtype=bool)
    found[row, user] = (needed > HARD_BRAKING_MPS2) | narrow
    return found


def _needed_deceleration(distance_m: Array, speed_mps: Array, within_s: Array) -> Array:
    """Return the constant deceleration (K,) with which a distance lasts for `within_s`."""
    stopping = np.square(speed_mps) / (2.0 * distance_m)
    known = np.isfinite(within_s)
    time_s = np.where(known, within_s, 1.0)
    late = known & (2.0 * distance_m >= speed_mps * time_s)
    time_s = np.where(late, time_s, 1.0)
    slowing = 2.0 * (speed_mps * time_s - distance_m) / np.square(time_s)
    return np.maximum(np.where(late, slowing, stopping), 0.0)


def _arrival(
    view: RolloutView, conflict: PriorityConflict, future: Indices, user: Indices
) -> Array:
    """Return when (K,) the fronts of road users reach shared ground, infinite where never: who is
    on its way there as the rollout ends goes on as fast."""
    x, y, _, speeds = view.users
    half = view.user_half_m[0][future, 0, user]
    start = conflict.way.point_at(np.array([conflict.way_from_m]))[0]
    yaw = float(conflict.way.yaw_at(np.array([conflict.way_from_m]))[0])
    dx, dy = x[future, :, user] - start[0], y[future, :, user] - start[1]
    along = np.cos(yaw) * dx + np.sin(yaw) * dy + half[:, None]
    aside = np.abs(np.cos(yaw) * dy - np.sin(yaw) * dx)
    counts = (aside < _AT_POINT_M) & view.there[future, :, user]
    arrived = _first_above(along, 0.0, view.time_s, counts)
    left_m, at_mps = -along[:, -1], speeds[future, -1, user]
    goes_on = counts[:, -1] & (left_m >= 0.0) & (at_mps > STANDING_MPS)
    later = np.where(goes_on, view.time_s[-1] + left_m / np.where(goes_on, at_mps, 1.0), np.inf)
    return np.where(np.isnan(arrived), later, arrived)
