"""Others whose way crosses the car's, or leads into it from another road."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.geometry.polyline import arc_lengths
from foretwin.sim_worker.analysis.occurred.along_way import Encounter
from foretwin.sim_worker.analysis.occurred.driven_way import DrivenWay, runs_of
from foretwin.sim_worker.analysis.occurred.scene import STEP_S, OtherCourse

ENCOUNTER_S = 3.0
"""Chosen: two meet where at most so much parts them in time at the place where ways cross, as it
came or as it would have come at the speed held before: time advantage, as Laureshyn, Svensson and
Hydén (2010), Evaluation of traffic safety, based on micro-level behavioural data, define it."""
_WAITED_S, _WAITS_WITHIN_M = 8.0, 15.0
"""Or where the car waits so near, and goes on within so long."""
_PARTS_SIN = np.sin(np.radians(20.0))
"""Ways that cross at less lead into each other, or pass."""
_LOOKS_BACK_M, _LOOKS_BACK_SLOW_M, _LOOKS_ON_M = 25.0, 8.0, 18.0
_SIDE_RAD, _ONCOMING_RAD, _TURNED_RAD = np.radians(50.0), np.radians(135.0), np.radians(40.0)
_GOES_ON_S = 2.0
_CREEPS_MPS, _ROLLS_MPS = 0.3, 0.8
_AROUND_S = 20.0
_BESIDE_S, _BESIDE_M = 6.0, 1.5
_JOINED_M, _JOINED_RAD, _JOINED_S = 1.4, np.radians(25.0), 1.0
_BEFORE_S = 4.0


class _Crossing(NamedTuple):
    """Where a course crosses the car's way: arc length there, row of the course, and how apart in
    time (`apart_s`)."""

    arc_m: float
    row: float
    apart_s: float


def across_way(way: DrivenWay, courses: Sequence[OtherCourse]) -> list[Encounter]:
    """Return what those were who came from another road, or on foot."""
    found = []
    for course in courses:
        if course.standing.all():
            continue
        crossing = _nearest_crossing(way, course)
        kind, side = _crossing_kind(way, course, crossing) if crossing else ("", "")
        if crossing and kind:
            found.append(_around(way, course, crossing, kind, side))
        elif course.kind != "pedestrian" and (joined := _joins(way, course)) is not None:
            found.append(joined)
    return found


def _line(course: OtherCourse, rows: int) -> Array:
    """Return a course's points; who is there as the record ends goes on for a moment."""
    if course.first + len(course.xy_m) < rows - round(1.0 / STEP_S) or course.standing[-1]:
        return course.xy_m
    steps = np.arange(1, round(_GOES_ON_S / STEP_S) + 1)[:, None] * STEP_S
    return np.concatenate([course.xy_m, course.xy_m[-1] + steps * course.velocity_mps[-1]])


def _nearest_crossing(way: DrivenWay, course: OtherCourse) -> _Crossing | None:
    rows = len(way.arc_m)
    around = round(_AROUND_S / STEP_S)
    window = way.arc_m[max(course.first - around, 0) : course.first + len(course.xy_m) + around]
    if not np.isfinite(window).any():
        return None
    arcs = np.arange(np.nanmin(window), np.nanmax(window) + 15.0, 1.0)
    ego, other = way.path.point_at(arcs.copy()), _line(course, rows)
    near = np.hypot(*(ego[:, None] - other[None]).transpose(2, 0, 1)).min(axis=0) < 6.0
    if not near.any():
        return None
    step, move = np.diff(ego, axis=0), np.diff(other, axis=0)
    start = other[None, :-1] - ego[:-1, None]
    turn = step[:, None, 0] * move[None, :, 1] - step[:, None, 1] * move[None, :, 0]
    long = np.hypot(*step.T)[:, None] * np.maximum(np.hypot(*move.T), 1e-9)[None]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (start[..., 0] * move[None, :, 1] - start[..., 1] * move[None, :, 0]) / turn
        when = (start[..., 0] * step[:, None, 1] - start[..., 1] * step[:, None, 0]) / turn
    hits = (share >= 0.0) & (share < 1.0) & (when >= 0.0) & (when < 1.0)
    hits &= np.abs(turn) >= _PARTS_SIN * long
    # Where somebody stands, noise alone leads to and fro.
    slow = _CREEPS_MPS if course.kind == "pedestrian" else _ROLLS_MPS
    hits &= (np.hypot(*move.T) / STEP_S >= slow)[None]
    found = [
        _Crossing(arc, row, _apart_s(way, course, arc, row))
        for a, b in np.argwhere(hits).tolist()
        for arc in [float(arcs[a] + share[a, b])]
        for row in [float(course.first + b + when[a, b])]
    ]
    met = [one for one in found if one.apart_s <= ENCOUNTER_S]
    return min(met, key=lambda one: (one.apart_s, one.row), default=None)


def _apart_s(way: DrivenWay, course: OtherCourse, arc_m: float, row: float) -> float:
    """Return how many seconds part both at a place: as it came, or would have."""
    came = way.when_row(arc_m)
    apart = abs(came - row) * STEP_S
    last = int(min(row, came, len(way.arc_m) - 1))
    rows = np.arange(max(last - round(_BEFORE_S / STEP_S), course.first, 0), last + 1)
    if not len(rows):
        return apart
    speed, left = np.abs(way.ego.speed_mps[rows]), arc_m - way.arc_m[rows] - way.half_m[0]
    with np.errstate(invalid="ignore"):
        moves = (speed > 1.5) & (left > 0.0)
    if moves.any():
        until = left[moves] / speed[moves]
        apart = min(apart, float(np.abs(until - (row - rows[moves]) * STEP_S).min()))
    waits = bool(0.0 < left[-1] <= _WAITS_WITHIN_M and speed[-1] <= 1.5)
    if waits and 0.0 < (came - row) * STEP_S <= _WAITED_S:
        apart = min(apart, ENCOUNTER_S)
    return apart


def _crossing_kind(way: DrivenWay, course: OtherCourse, at: _Crossing) -> tuple[str, str]:
    """Return kind and side of a crossing, ("", "") where it is none of ours."""
    own, after = way.heading_at(max(at.arc_m - _LOOKS_BACK_M, 0.0)), at.arc_m + _LOOKS_ON_M
    own_after = way.heading_at(min(after, way.length_m))
    came, went = _headings(course, at.row)
    here = int(np.clip(round(at.row) - course.first, 0, len(course.yaw_rad) - 1))
    velocity, lead = course.velocity_mps[here], way.heading_at(at.arc_m)
    goes_left = np.cos(lead) * velocity[1] - np.sin(lead) * velocity[0] > 0.0
    side = "right" if goes_left else "left"
    if course.kind in ("pedestrian", "bicycle"):
        return ("pedestrian" if course.kind == "pedestrian" else "cyclist") + "_crossing", side
    relation = float(wrap_angle(came - own))
    ego_turns = abs(float(wrap_angle(own_after - own))) > _TURNED_RAD
    other_turns = abs(float(wrap_angle(went - came))) > _TURNED_RAD
    same_end = abs(float(wrap_angle(went - own_after))) <= _JOINED_RAD
    if abs(relation) >= _ONCOMING_RAD:
        # One of them turns, since ways cross; the record may end before the turn does.
        own_share = abs(float(wrap_angle(lead - own)))
        its_share = abs(float(wrap_angle(course.yaw_rad[here] - came)))
        if ego_turns or own_share > its_share:
            return "ego_turns_across_oncoming", side
        return "oncoming_turns_across", side
    if abs(relation) >= _SIDE_RAD:
        from_side = "right" if relation > 0.0 else "left"
        if same_end and (ego_turns or other_turns):
            return ("ego_turns_into_path" if ego_turns else "turns_into_path"), from_side
        return f"crossing_from_{from_side}", from_side
    if not _came_beside(way, course, here):
        return "", ""
    if ego_turns and not other_turns:
        return "ego_turns_across_same_direction", side
    return ("same_direction_turns_across", side) if other_turns and not ego_turns else ("", "")


def _came_beside(way: DrivenWay, course: OtherCourse, here: int) -> bool:
    """Whether somebody was beside the car's way before, not on it, as who is followed is."""
    before = way.see(course).left_m[max(here - round(_BESIDE_S / STEP_S), 0) : here + 1]
    return float(np.abs(before).max()) >= _BESIDE_M


def _headings(course: OtherCourse, row: float) -> tuple[float, float]:
    """Return where somebody headed well before a row, and well after it."""
    arc = arc_lengths(course.xy_m)
    here = float(np.interp(row - course.first, np.arange(len(arc)), arc))
    back = _LOOKS_BACK_SLOW_M if course.kind == "bicycle" else _LOOKS_BACK_M
    before = int(np.searchsorted(arc, here - back))
    after = min(int(np.searchsorted(arc, here + _LOOKS_ON_M)), len(arc) - 1)
    return float(course.yaw_rad[before]), float(course.yaw_rad[after])


def _around(way: DrivenWay, course: OtherCourse, at: _Crossing, kind: str, side: str) -> Encounter:
    """Return the encounter from when both could matter to each other to when both are past."""
    came = way.when_row(at.arc_m)
    later = max(at.row, came) if np.isfinite(came) else at.row
    before = round(_BEFORE_S / STEP_S)
    first = max(int(min(at.row, came)) - before, course.first, 0)
    after = min(int(later) + 2, len(way.arc_m))
    return Encounter(kind, course, min(first, after - 1), after, side, at.row)


def _joins(way: DrivenWay, course: OtherCourse) -> Encounter | None:
    """Return who turned into the car's way from another road, or into whose way the car turned."""
    on = way.see(course)
    limit = min(_JOINED_M, way.half_m[1] + course.size_m[1] / 2.0)
    together = (np.abs(on.left_m) <= limit) & (np.abs(on.turned_rad) <= _JOINED_RAD)
    together &= ~course.standing & (np.abs(on.gap_m) < 1e3)
    for rows in runs_of(together, least_s=_JOINED_S, over_holes_s=0.5):
        row, arc = course.first + rows.start, float(on.arc_m[rows.start])
        own = way.heading_at(max(arc - _LOOKS_BACK_M, 0.0))
        came, _ = _headings(course, row)
        relation = float(wrap_angle(came - own))
        if abs(relation) < _SIDE_RAD:
            continue
        apart_s = _apart_s(way, course, arc, float(row))
        if apart_s > ENCOUNTER_S:
            continue
        turned = abs(float(wrap_angle(way.heading_at(arc) - own)))
        other = abs(float(wrap_angle(course.yaw_rad[rows.start] - came)))
        side = "right" if relation > 0.0 else "left"
        kind = "ego_turns_into_path" if turned > other else "turns_into_path"
        if kind == "turns_into_path" and on.gap_m[rows.start] < 0.0:
            continue
        return _around(way, course, _Crossing(arc, float(row), apart_s), kind, side)
    return None
