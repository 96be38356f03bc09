"""The chain of lanes and connections that a route is driven along, and a path led onto it."""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import interpolated
from foretwin.orchestrator.routing.rounding import (
    TURN_ROOM_M,
    evenly_spaced,
    normals,
    with_driven_turns,
)
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.world_lanes import Followed, WorldLanes

CHANGE_M = 30.0
"""A change of lanes takes so long, and is no longer begun where less of the lane is left."""
BLEND_M = 20.0
"""Over which a path goes from beside lanes onto them, and from one lane to the next."""
# What a chain costs, against a metre without lanes.
_GAP, _CHANGE, _LATER_CHANGE = 20.0, 30.0, 5.0
_ASIDE, _CAR_ASIDE_M = 3.0, 5.0
"""For each metre beside the car, up to so many: less than a change; or beside the lane before."""
_PATH_ASIDE = 0.005


class LaneRun(NamedTuple):
    """Pieces that follow one another without a change of lanes or a gap.

    Points (N, 2) and the path's s (N,) beside them, rising.
    """

    ids: tuple[str, ...]
    xy_m: Array
    s_m: Array


def chain(
    pieces: Sequence[Followed],
    *,
    begin_m: float,
    end_m: float,
    car_s_m: float,
    car_xy_m: Array,
    turn_radii_m: tuple[float, float],
) -> tuple[LaneRun, ...]:
    """Return the chain of lanes to follow from `begin_m` to `end_m` of a path.

    It leaves as little as can be without lanes, then changes lanes as rarely, and then takes the
    lane that the car is in; a change that has to come soon is made where the chain begins.
    `turn_radii_m` is that of driven turns to the left and to the right.
    """
    by_id = {one.piece.id: one for one in pieces}
    driven = _driven_lines(by_id, car_s_m, turn_radii_m)
    own = {name: _own_cost(by_id[name], driven.get(name), car_s_m, car_xy_m) for name in by_id}
    best: dict[str, float] = {}
    came: dict[str, str] = {}
    heap = [(max(0.0, by_id[name].begin_m - begin_m) + own[name], name, "") for name in by_id]
    heapq.heapify(heap)
    while heap:
        cost, name, before = heapq.heappop(heap)
        if name in best:
            continue
        best[name], came[name] = cost, before
        here = by_id[name]
        for other in by_id:
            step = _step(here, by_id[other], car_s_m)
            if other not in best and step is not None:
                heapq.heappush(heap, (cost + step + own[other], other, name))
    if not best:
        return ()
    last = min(by_id, key=lambda name: (best[name] + max(0.0, end_m - by_id[name].end_m), name))
    names = []
    while last:
        names.append(last)
        last = came[last]
    return _runs([by_id[name] for name in reversed(names)])


def _driven_lines(
    by_id: Mapping[str, Followed], car_s_m: float, turn_radii_m: tuple[float, float]
) -> dict[str, Array]:
    """Return the lines (N, 2) that pieces in and beside a turn near the car are driven along.

    A tight connection is driven inside of its line (`with_driven_turns`), so far that a car may lie
    nearer to that of the next lane than to that of its own.
    """
    lines: dict[str, list[Array]] = {}
    for one in by_id.values():
        near = one.begin_m - TURN_ROOM_M <= car_s_m <= one.end_m + TURN_ROOM_M
        if near and one.piece.joins:
            before, after = (by_id[name] for name in one.piece.joins)
            run = _joined([before, one, after])
            line, _ = with_driven_turns(*evenly_spaced(run.xy_m, run.s_m), turn_radii_m)
            for name in (before.piece.id, one.piece.id, after.piece.id):
                lines.setdefault(name, []).append(line)
    return {name: np.concatenate(found) for name, found in lines.items()}


def _own_cost(one: Followed, driven: Array | None, car_s_m: float, car_xy_m: Array) -> float:
    cost = _PATH_ASIDE * one.aside_m * (one.end_m - one.begin_m)
    if one.begin_m <= car_s_m <= one.end_m:
        line = one.xy_m if driven is None else driven
        aside = float(np.hypot(*(line - car_xy_m).T).min())
        cost += _ASIDE * min(aside, _CAR_ASIDE_M)
    return cost


def _step(here: Followed, there: Followed, car_s_m: float) -> float | None:
    """Return what it costs to go on from one piece to another, None where one cannot."""
    if there.piece.id in here.piece.after:
        return 0.0
    if there.piece.id in here.piece.beside:
        room = min(here.end_m, there.end_m) - max(here.begin_m, there.begin_m, car_s_m)
        if room < CHANGE_M:
            return None
        return _CHANGE if here.begin_m <= car_s_m else _LATER_CHANGE
    gap = there.begin_m - here.end_m
    if gap < 0.0:
        return None
    away = float(np.hypot(*(there.xy_m[0] - here.xy_m[-1])))
    return _GAP + gap + _ASIDE * math.sqrt(max(0.0, away**2 - gap**2))


def _runs(found: list[Followed]) -> tuple[LaneRun, ...]:
    runs: list[list[Followed]] = []
    for one in found:
        if runs and one.piece.id in runs[-1][-1].piece.after:
            runs[-1].append(one)
        else:
            runs.append([one])
    return tuple(_joined(run) for run in runs)


def _joined(run: list[Followed]) -> LaneRun:
    xy, s = (np.concatenate(parts) for parts in zip(*((p.xy_m, p.s_m) for p in run), strict=True))
    keep = np.concatenate([[True], s[1:] > np.maximum.accumulate(s)[:-1] + 1e-6])
    return LaneRun(tuple(one.piece.id for one in run), xy[keep], s[keep])


class LaneGuide:
    """Leads the path of a route onto the lanes of a World, in which the car has its own already."""

    def __init__(self, lanes: WorldLanes, route: Route, *, car_s_m: float, car_xy_m: Array) -> None:
        self._lanes, self._route = lanes, route
        self._car_s_m, self._car_xy_m = car_s_m, car_xy_m
        self.runs: tuple[LaneRun, ...] = ()

    def onto_lanes(self, xy_m: Array, s_m: Array) -> Array:
        """Return a path (N, 2) with the route's s (N,) beside it, moved onto the lanes there."""
        self.runs = chain(
            self._lanes.beside(self._route, xy_m, s_m),
            begin_m=float(s_m[0]),
            end_m=float(s_m[-1]),
            car_s_m=self._car_s_m,
            car_xy_m=self._car_xy_m,
            turn_radii_m=self._lanes.turn_radii_m,
        )
        return on_lanes(xy_m, s_m, self.runs, car_s_m=self._car_s_m)

    def without_lanes(self, s_m: Array) -> npt.NDArray[np.bool_]:
        """Return at which positions (N,) no lane was found, to a metre."""
        without = np.ones(len(s_m), dtype=bool)
        for run in self.runs:
            without &= (s_m < run.s_m[0] - 1.0) | (s_m > run.s_m[-1] + 1.0)
        return without


def on_lanes(xy_m: Array, s_m: Array, runs: Sequence[LaneRun], *, car_s_m: float) -> Array:
    """Return a path (N, 2) led along runs; beyond their ends it comes back within `BLEND_M`."""
    led, left = xy_m.copy(), normals(xy_m)
    until_m = -math.inf
    for number, run in enumerate(runs):
        begin, end = float(run.s_m[0]), float(run.s_m[-1])
        upto_m = float(runs[number + 1].s_m[0]) if number + 1 < len(runs) else math.inf
        lane = interpolated(s_m, run.s_m, run.xy_m)
        weight = ((s_m >= begin) & (s_m <= end)).astype(np.float64)
        if begin < until_m:
            change_m = max(begin, car_s_m, until_m - 2.0 * BLEND_M)
            weight *= _smooth_step((s_m - change_m) / BLEND_M)
        led += weight[:, None] * (lane - led)
        before, after = (begin - s_m, begin - until_m, begin), (s_m - end, upto_m - end, end)
        for beyond_m, room_m, place in (before, after):
            if room_m > 0.0:
                at = int(np.abs(s_m - place).argmin())
                aside_m = float((lane[at] - xy_m[at]) @ left[at])
                back = 1.0 - _smooth_step(beyond_m / min(BLEND_M, room_m))
                tail = np.where((beyond_m > 0.0) & (beyond_m < room_m), aside_m * back, 0.0)
                led += tail[:, None] * left
        until_m = end
    return led


def _smooth_step(share: Array) -> Array:
    share = np.clip(share, 0.0, 1.0)
    return np.asarray(share * share * (3.0 - 2.0 * share))
