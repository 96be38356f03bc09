"""The lines that egos leave when they drive alone: where a car really comes by, and when."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import apart, arc_lengths, unit
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.sim_worker.scenarios.ways import Way

KEEPS_SPEED, _KEEPS_TO_M = 0.35, 1.5
"""A car whose speed differs by more of what the case says, or that is farther from its path, does
something else."""


class DrivenLine(NamedTuple):
    """The line of one drive: its way, and when (T,) it came by which arc length (T,), with `states`
    (T, 8)."""

    way: Way
    time_s: Array
    arc_m: Array
    states: Array


def driven_lines(
    cases: Iterable[StagedCase], states: Array, *, tick_s: float
) -> Iterable[DrivenLine]:
    """Yield the line of each case's ego from its states (S, T, 8) at control ticks."""
    for case, driven in zip(cases, states, strict=True):
        path, way = case.place.ego.path, case.place.ego
        # A car that was lost from sight went nowhere that one could tell.
        driven = np.where(np.isfinite(driven).all(axis=1)[:, None], driven, driven[0])
        before = np.arange(0.0, max(case.ego_arc_m - 0.5, 0.0), 1.0)
        xy = np.concatenate([path.point_at(before, case.ego_lateral_m), driven[:, :2]])
        arc = arc_lengths(xy)
        moved = apart(xy, tolerance_m=1e-6)
        limit = path.at_nodes(np.minimum(path.speed_limit_mps, 1e3), arc)
        if case.ego_lateral_m:
            # The lines of egos beside their paths are moved back: casting moves them aside again.
            xy = FrenetPath(xy[moved], limit[moved]).point_at(arc, -case.ego_lateral_m)
        if len(before) > 1:
            # Chords are shorter than the bends behind it: it is to begin at the same arc length.
            missing_m = case.ego_arc_m - float(arc_lengths(xy)[len(before)])
            xy[0] += missing_m * unit(xy[0] - xy[1])
        arc = arc_lengths(xy)
        line = FrenetPath(xy[moved], limit[moved])
        yield DrivenLine(
            way=way._replace(xy_m=xy[moved], speed_limit_mps=limit[moved], path=line),
            time_s=np.arange(float(len(driven))) * tick_s,
            arc_m=arc[len(before) :],
            states=driven,
        )


def drives_as_cast(case: StagedCase, line: DrivenLine, path: FrenetPath) -> bool:
    """Return whether a car drives as a case cast on its line has it, until it meets somebody: about
    at the case's speed, and along its `path`."""
    until_m = case.ego_arc_m + case.ego_speed_mps * case.meets_s
    if until_m > line.arc_m[-1]:
        return False
    before = (line.arc_m[:-1] >= case.ego_arc_m) & (line.arc_m[:-1] < until_m)
    speed = (np.diff(line.arc_m) / np.diff(line.time_s))[before]
    off_m = path.locate(line.states[:-1, :2][before]).offset_m - case.ego_lateral_m
    keeps_speed = np.abs(speed / case.ego_speed_mps - 1.0).max(initial=0.0) < KEEPS_SPEED
    return bool(keeps_speed and np.abs(off_m).max(initial=0.0) < _KEEPS_TO_M)


def time_at(line: DrivenLine, arc_m: float, speed_mps: float) -> float:
    """Return when an ego comes by an arc length; before its start it came with its speed."""
    before_m = min(arc_m - line.arc_m[0], 0.0)
    return float(np.interp(arc_m, line.arc_m, line.time_s)) + float(before_m) / speed_mps


def arc_at(line: DrivenLine, time_s: float, speed_mps: float) -> float:
    """Return the arc length that an ego comes by at a time: what `time_at` is told."""
    before_s = min(time_s, 0.0)
    return float(np.interp(time_s, line.time_s, line.arc_m)) + before_s * speed_mps
