"""What the car itself did: through junctions, changes of lane, stops and standing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.frames import wrap_angle
from foretwin.sim_worker.analysis.occurred.driven_way import DrivenWay, runs_of
from foretwin.sim_worker.analysis.occurred.roads import Roads
from foretwin.sim_worker.analysis.occurred.scene import STEP_S

STRAIGHT_RAD, BACK_RAD = np.radians(35.0), np.radians(140.0)
"""Chosen: a turn changes the heading by more, a turn back by more still."""
_BESIDE_M = 12.0
"""Before and behind a junction's ground the heading counts that one comes and leaves with."""
_BEND_M, _LEAST_BEND_M = 40.0, 10.0
"""Away from known junctions, who changes the heading within so short a way turns."""
_LEAST_MOVED_M, _MOST_MOVED_M = 2.0, 6.0
_LEAST_RATE, _LONGEST_S = 0.02, 12.0
"""A change of lane: so far aside, at so much sideways for each metre on average, in so long."""
_SLANT_RAD = np.radians(0.6)
_STOOD_MPS, _STOOD_S = 0.3, 1.0
_DROVE_MPS = 2.0
_OTHER_SIDE = {"left": "right", "right": "left"}
_BRAKING_S = 12.0


class EgoStretch(NamedTuple):
    """What the car did from row `first` to before `after`."""

    kind: str
    first: int
    after: int
    junction_id: str = ""
    side: str = ""


def ego_stretches(way: DrivenWay, roads: Roads) -> list[EgoStretch]:
    """Return all that the car did by itself, by kind and time."""
    passed = list(_passages(way, roads))
    found = [*passed, *_bends(way, passed), *_stops(way)]
    found += lane_changes(way, roads, passed)
    return sorted(found, key=lambda one: (one.first, one.kind))


def _turned(change_rad: float) -> tuple[str, str]:
    side = "left" if change_rad > 0.0 else "right"
    if abs(change_rad) >= BACK_RAD:
        return "u_turn", side
    if abs(change_rad) >= STRAIGHT_RAD:
        return f"turn_{side}", side
    return "through_straight", ""


def _passages(way: DrivenWay, roads: Roads) -> Iterator[EgoStretch]:
    """Yield passages of junctions, whole ones only: the car came from outside and left."""
    for junction_id, place in roads.junctions.items():
        for rows in runs_of(within(place.outline_m, way.centre_m), over_holes_s=1.0):
            if rows.start == 0 or rows.stop == len(way.arc_m):
                continue
            enters, leaves = way.arc_m[rows.start], way.arc_m[rows.stop - 1]
            if not leaves - enters > 2.0:
                continue
            change = _change(way, enters - _BESIDE_M, leaves + _BESIDE_M)
            kind, side = _turned(change)
            yield EgoStretch(kind, rows.start, rows.stop, junction_id, side)


def _change(way: DrivenWay, from_arc_m: float, to_arc_m: float) -> float:
    """Return by how much the heading changes, turns counted as driven."""
    at = np.arange(max(from_arc_m, 0.0), min(to_arc_m, way.length_m) + 1.0, 1.0)
    heading = np.unwrap(way.path.yaw_at(at))
    return float(heading[-1] - heading[0]) if len(heading) else 0.0


def _bends(way: DrivenWay, passed: list[EgoStretch]) -> Iterator[EgoStretch]:
    """Yield turns where no junction is known."""
    at = np.arange(0.0, way.length_m, 1.0)
    if len(at) < _LEAST_BEND_M:
        return
    heading = np.unwrap(way.path.yaw_at(at))
    ahead = np.minimum(np.arange(len(at)) + round(_BEND_M), len(at) - 1)
    turns = np.abs(heading[ahead] - heading) >= np.radians(45.0)
    for rows in runs_of(turns):
        first, last = rows.start, int(ahead[rows.stop - 1])
        steep = np.abs(np.gradient(heading[first : last + 1])) > np.radians(1.0)
        within_bend = np.flatnonzero(steep) + first
        if not len(within_bend):
            continue
        rows_of = [way.when_row(float(at[k])) for k in (within_bend[0], within_bend[-1])]
        if not np.isfinite(rows_of).all():
            continue
        begin, after = int(rows_of[0]), int(rows_of[1]) + 1
        if any(one.first < after and begin < one.after for one in passed):
            continue
        change = float(heading[within_bend[-1]] - heading[within_bend[0]])
        kind, side = _turned(change)
        if kind != "through_straight":
            yield EgoStretch(kind, begin, after, "", side)


def _stops(way: DrivenWay) -> Iterator[EgoStretch]:
    """Yield standstills, and the braking before those that the car drove into."""
    speed = np.abs(way.ego.speed_mps)
    stands = speed < _STOOD_MPS
    for rows in runs_of(stands, least_s=_STOOD_S, over_holes_s=0.5):
        yield EgoStretch("standstill", rows.start, rows.stop)
        window = slice(max(rows.start - round(_BRAKING_S / STEP_S), 0), rows.start)
        before = speed[window]
        if not len(before) or not np.nanmax(before, initial=0.0) >= _DROVE_MPS:
            continue
        # Back from the standstill as long as it was the faster the earlier.
        first = rows.start
        while first > window.start and speed[first - 1] >= speed[first] - 0.02:
            first -= 1
        yield EgoStretch("stop", first, min(rows.start + 1, rows.stop))


def lane_changes(way: DrivenWay, roads: Roads, passed: list[EgoStretch]) -> list[EgoStretch]:
    """Return where the car moved to another lane: as far aside as lanes lie apart, along the way
    that they lead, outside of junctions, and where the map has a lane on that side."""
    centre, heading = way.centre_m, way.ego.yaw_rad
    lead = roads.heading_at(centre, np.asarray(wrap_angle(heading)))
    slant = np.asarray(wrap_angle(heading - lead))
    outside = np.ones(len(slant), dtype=bool)
    for one in passed:
        outside[one.first : one.after] = False
    step = np.diff(way.arc_m, append=np.nan)
    found = []
    for rows, moved in aside(slant, step, outside):
        side = "left" if moved > 0.0 else "right"
        ends = [rows.start, rows.stop - 1]
        begin, end = roads.piece_at(centre[ends], np.asarray(wrap_angle(heading[ends]))).tolist()
        if roads.neighbour(begin, side) or roads.neighbour(end, _OTHER_SIDE[side]):
            found.append(EgoStretch(f"lane_change_{side}", rows.start, rows.stop, "", side))
    return found


def aside(
    slant_rad: Array, step_m: Array, counts: Flags, *, least_rad: float = _SLANT_RAD
) -> list[tuple[slice, float]]:
    """Return where somebody goes aside by a lane, and how far to the left.

    `slant_rad` (K,) from the way that lanes lead, NaN where that is not known, `step_m` (K,) to
    the next row.
    """
    found = []
    sideways = np.nan_to_num(np.sin(slant_rad) * step_m)
    for sign in (1.0, -1.0):
        slanted = (sign * slant_rad > least_rad) & counts
        for rows in runs_of(slanted, over_holes_s=0.6):
            moved, driven = float(sideways[rows].sum()), float(np.nansum(step_m[rows]))
            long_s = (rows.stop - rows.start) * STEP_S
            if not _LEAST_MOVED_M <= abs(moved) <= _MOST_MOVED_M or long_s > _LONGEST_S:
                continue
            if abs(moved) >= _LEAST_RATE * driven:
                found.append((rows, moved))
    return sorted(found, key=lambda one: one[0].start)


def within(outline_m: Array, xy_m: Array) -> Flags:
    """Return which points (K, 2) lie in an outline (M, 2), by crossings of a ray to the right."""
    x, y = xy_m[:, :1], xy_m[:, 1:]
    begin, end = outline_m, np.roll(outline_m, -1, axis=0)
    spans = (begin[:, 1] > y) != (end[:, 1] > y)
    rise = end[:, 1] - begin[:, 1]
    share = (y - begin[:, 1]) / np.where(rise == 0.0, 1.0, rise)
    left = x < begin[:, 0] + share * (end[:, 0] - begin[:, 0])
    return np.asarray((spans & left).sum(axis=1) % 2 == 1)
