"""The way that the car drove as a path, and where others are on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.frames import wrap_angle
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import arc_lengths, kept_apart
from foretwin.sim_worker.analysis.occurred.scene import STEP_S, DrivenMotion, OtherCourse

_APART_M = 0.7
_BACK_M, _AHEAD_M = 45.0, 110.0
"""So far behind and ahead of the car others are looked for on its way."""


class OnWay(NamedTuple):
    """A course (K rows) as the car's way sees it: centres at arc length and to the left of it.

    `gap_m` from bumper to bumper, positive ahead, negative behind, 0 beside; `turned_rad` the
    other's heading from the way's.
    """

    arc_m: Array
    left_m: Array
    turned_rad: Array
    gap_m: Array


class DrivenWay:
    """The middle of the car's box through a drive, one piece without a hole.

    `arc_m` (N,) how far it had come at each row of the drive, NaN in holes; `half_m` of its box.
    """

    def __init__(
        self, ego: DrivenMotion, *, centre_ahead_m: float, length_m: float, width_m: float
    ) -> None:
        """Raise ValueError where the car never moved."""
        heading = np.stack([np.cos(ego.yaw_rad), np.sin(ego.yaw_rad)], axis=1)
        self.centre_m = ego.xy_m + centre_ahead_m * heading
        self.ego, self.half_m = ego, (length_m / 2.0, width_m / 2.0)
        known = np.flatnonzero(np.isfinite(self.centre_m).all(axis=1))
        kept = known[kept_apart(self.centre_m[known], least_m=_APART_M)] if len(known) else known
        line = self.centre_m[kept]
        if len(line) < 2:
            raise ValueError("the car never moves: there is no way to look along")
        # Who stands as the drive begins or ends heads where it stands.
        arc = arc_lengths(line)
        self.path = FrenetPath(line)
        row = np.arange(len(ego.stamp_ns))
        at = np.interp(row, kept, arc)
        self.arc_m = np.where(np.isfinite(self.centre_m[:, 0]), at, np.nan)
        self.length_m = float(arc[-1])

    def when_row(self, arc_m: float) -> float:
        """Return at which row the car came to an arc length first; infinite beyond the end."""
        reached = np.flatnonzero(self.arc_m >= arc_m)
        return float(reached[0]) if len(reached) else np.inf

    def heading_at(self, arc_m: float) -> float:
        """Return where the way leads."""
        return float(self.path.yaw_at(np.array([arc_m]))[0])

    def see(self, course: OtherCourse) -> OnWay:
        """Return where a course is; far away where the car's place is not known."""
        here = self.arc_m[course.rows]
        middle = (_AHEAD_M - _BACK_M) / 2.0
        near = np.nan_to_num(here, nan=0.0) + middle
        found = self.path.locate(course.xy_m, near_arc_m=near, within_m=(_AHEAD_M + _BACK_M) / 2.0)
        at = found.arc_m
        turned = np.asarray(wrap_angle(course.yaw_rad - self.path.yaw_at(at.copy())))
        reach = self.half_m[0] + course.size_m[0] / 2.0
        along = at - here
        gap = np.sign(along) * np.maximum(np.abs(along) - reach, 0.0)
        return OnWay(at, found.offset_m, turned, np.where(np.isnan(here), np.inf, gap))


def runs_of(flags: Flags, *, least_s: float = 0.0, over_holes_s: float = 0.0) -> list[slice]:
    """Return stretches of rows where `flags` hold, over holes that are short, none too short."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    found: list[list[int]] = []
    for first, after in edges.reshape(-1, 2).tolist():
        if found and (first - found[-1][1]) * STEP_S <= over_holes_s:
            found[-1][1] = after
        else:
            found.append([first, after])
    return [slice(a, b) for a, b in found if (b - a) * STEP_S >= least_s]
