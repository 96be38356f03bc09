"""Others that drive the car's way, or stand on it: followed, cutting in and out, passed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.frames import wrap_angle
from foretwin.sim_worker.analysis.occurred.driven_way import DrivenWay, OnWay, runs_of
from foretwin.sim_worker.analysis.occurred.ego_manoeuvres import aside
from foretwin.sim_worker.analysis.occurred.roads import Roads
from foretwin.sim_worker.analysis.occurred.scene import STEP_S, OtherCourse

_ALIKE_RAD = np.radians(30.0)
_OVERLAP_M = 0.3
"""So much of both widths overlaps where one is in the other's way."""
_FOLLOWS_S, _FOLLOWS_LEAST_M, _FOLLOWED_S = 3.0, 8.0, 3.0
"""Chosen: who keeps at most this headway for at least so long follows."""
_NOTICED_S, _NOTICED_M = 5.0, 25.0
"""Chosen: whom is ahead within this headway, or so near, matters to the car."""
_BRAKES_MPS2, _LOST_MPS = 0.8, 2.5
"""Chosen: the one ahead brakes where its speed falls by so much, at more than that."""
_EVEN_S = 1.1
_SLANT_RAD = np.radians(1.0)
_MOVES_MPS = 2.0
_STANDS_AHEAD_M, _BESIDE_M = 50.0, 1.2
_STOOD_S, _STOOD_M = 2.0, 1.5
_EVER_S = 60.0
_PASSED_WITHIN_M = 5.5


class Encounter(NamedTuple):
    """What a course was to the car from row `first` to before `after` of the drive.

    `at_row` is the instant that makes it what it is, such as where ways cross.
    """

    kind: str
    course: OtherCourse
    first: int
    after: int
    side: str = ""
    at_row: float = np.nan


def along_way(way: DrivenWay, roads: Roads, courses: Sequence[OtherCourse]) -> list[Encounter]:
    """Return what those were who drove or stood along the car's way."""
    seen = [(course, way.see(course)) for course in courses if course.kind != "pedestrian"]
    nearest = np.full(len(way.arc_m), np.inf)
    for course, on in seen:
        ahead = np.where(_leads(way, course, on), on.gap_m, np.inf)
        np.minimum.at(nearest, course.rows, ahead)
    found: list[Encounter] = []
    for course, on in seen:
        found += _standing(way, course, on)
        if course.standing.all():
            continue
        first = _leads(way, course, on) & (on.gap_m <= nearest[course.rows] + 1e-6)
        found += _followed(way, course, on, first)
        found += _braking(way, course, on, first)
        found += _cuts(way, roads, course, on)
        found += _passing(way, course, on)
    return found


def _limit_m(way: DrivenWay, course: OtherCourse) -> float:
    return float(way.half_m[1] + course.size_m[1] / 2.0 - _OVERLAP_M)


def _ego_mps(way: DrivenWay, course: OtherCourse) -> Array:
    return np.abs(np.nan_to_num(way.ego.speed_mps[course.rows]))


def _leads(way: DrivenWay, course: OtherCourse, on: OnWay) -> Flags:
    in_way = np.abs(on.left_m) <= _limit_m(way, course)
    alike = (np.abs(on.turned_rad) <= _ALIKE_RAD) | course.standing
    return np.asarray(in_way & alike & (on.gap_m > 0.0) & np.isfinite(on.gap_m))


def _followed(way: DrivenWay, course: OtherCourse, on: OnWay, leads: Flags) -> Iterator[Encounter]:
    ego = _ego_mps(way, course)
    near = on.gap_m <= np.maximum(_FOLLOWS_S * ego, _FOLLOWS_LEAST_M)
    both = (ego > _MOVES_MPS) & (course.speed_mps > 1.0)
    for rows in runs_of(leads & near & both, least_s=_FOLLOWED_S, over_holes_s=1.0):
        yield _encounter("following", course, rows)


def _braking(way: DrivenWay, course: OtherCourse, on: OnWay, leads: Flags) -> Iterator[Encounter]:
    ego = _ego_mps(way, course)
    matters = leads & (on.gap_m <= np.maximum(_NOTICED_S * ego, _NOTICED_M))
    even = uniform_filter1d(course.speed_mps, round(_EVEN_S / STEP_S), mode="nearest")
    slows = -np.gradient(even, STEP_S) > _BRAKES_MPS2 if len(even) > 1 else even < 0.0
    for rows in runs_of(slows, over_holes_s=0.5):
        lost = even[rows.start] - even[rows.stop - 1]
        if lost >= _LOST_MPS and matters[rows].mean() > 0.5 and ego[rows.start] > _MOVES_MPS:
            yield _encounter("lead_decelerates", course, rows)


def _standing(way: DrivenWay, course: OtherCourse, on: OnWay) -> Iterator[Encounter]:
    ego = _ego_mps(way, course)
    clear = np.abs(on.left_m) - way.half_m[1] - course.size_m[1] / 2.0
    ahead = (on.gap_m > 0.0) & (on.gap_m <= _STANDS_AHEAD_M) & (ego > _MOVES_MPS)
    in_way = np.abs(on.left_m) <= _limit_m(way, course)
    for rows in runs_of(ahead & in_way & course.standing, least_s=1.0, over_holes_s=1.0):
        # Who has just driven there before the car's eyes is somebody who brakes ahead.
        since = max(rows.start - round(_STOOD_S / STEP_S), 0)
        if np.hypot(*(course.xy_m[rows.start] - course.xy_m[since])) <= _STOOD_M:
            yield _encounter("stationary_ahead", course, rows)
    if not course.standing.all():
        return
    beside = ~in_way & (clear <= _BESIDE_M)
    passed = beside & (on.gap_m == 0.0) & (ego > _MOVES_MPS)
    for rows in runs_of(passed, over_holes_s=_EVER_S):
        side = "left" if on.left_m[rows.start] > 0.0 else "right"
        yield _encounter("parked_beside", course, rows, side)


def _cuts(way: DrivenWay, roads: Roads, course: OtherCourse, on: OnWay) -> Iterator[Encounter]:
    """Yield changes of lane of others ahead, by their own motion aside from the way that lanes
    lead: a change of the car's lane is none of theirs."""
    ego, limit = _ego_mps(way, course), _limit_m(way, course)
    lead = roads.heading_at(course.xy_m, np.asarray(wrap_angle(course.yaw_rad)))
    along = way.path.yaw_at(on.arc_m.copy())
    lead = np.where(np.isnan(lead), along, lead)
    slant = np.asarray(wrap_angle(course.yaw_rad - lead))
    sideways = uniform_filter1d(course.speed_mps * np.sin(slant), 15, mode="nearest")
    even = np.arcsin(np.clip(sideways / np.maximum(course.speed_mps, _MOVES_MPS), -1.0, 1.0))
    alike = (np.abs(on.turned_rad) <= _ALIKE_RAD) & (course.speed_mps > _MOVES_MPS)
    step = course.speed_mps * STEP_S
    for rows, moved in aside(even, step, alike, least_rad=_SLANT_RAD):
        last = rows.stop - 1
        before, after = on.left_m[rows.start], on.left_m[last]
        if abs((after - before) - moved) > 2.0:
            continue
        near = max(_NOTICED_S * ego[last], _NOTICED_M)
        came_from = "left" if moved < 0.0 else "right"
        # It counts from where it is in the way: who is hit then has cut in as well.
        enters = rows.start + int(np.argmax(np.abs(on.left_m[rows]) <= limit))
        if abs(after) <= limit < abs(before) - 0.2 and 0.0 < on.gap_m[enters] <= near:
            yield _encounter("cut_in", course, rows, came_from)
        elif abs(before) <= limit < abs(after) - 0.2 and 0.0 < on.gap_m[rows.start] <= near:
            yield _encounter("cut_out", course, rows, "left" if moved > 0.0 else "right")


def _passing(way: DrivenWay, course: OtherCourse, on: OnWay) -> Iterator[Encounter]:
    ego = _ego_mps(way, course)
    alike = np.abs(on.turned_rad) <= _ALIKE_RAD
    near = (np.abs(on.left_m) <= _PASSED_WITHIN_M) & (np.abs(on.gap_m) < 1e3)
    both = (ego > _MOVES_MPS) & (course.speed_mps > _MOVES_MPS)
    sign = np.sign(on.gap_m)
    for rows in runs_of(alike & near & both, least_s=1.0, over_holes_s=0.5):
        ahead, behind = np.flatnonzero(sign[rows] > 0), np.flatnonzero(sign[rows] < 0)
        if not len(ahead) or not len(behind):
            continue
        beside = on.left_m[rows][len(sign[rows]) // 2]
        side = "left" if beside > 0.0 else "right"
        first = rows.start + min(int(ahead[-1]), int(behind[-1]))
        if behind[0] < ahead[-1] and behind[-1] < ahead[-1]:
            yield _encounter("overtakes_ego", course, slice(first, rows.stop), side)
        elif ahead[-1] < behind[-1]:
            yield _encounter("ego_overtakes", course, slice(first, rows.stop), side)


def _encounter(kind: str, course: OtherCourse, rows: slice, side: str = "") -> Encounter:
    first = course.first + rows.start
    return Encounter(kind, course, first, course.first + rows.stop, side, float(first))
