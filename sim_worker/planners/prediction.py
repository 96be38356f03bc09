"""Where other road users will be along the ego's path if they keep their speed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from contracts.arrays import Array
from contracts.frames import wrap_angle
from sim_worker.planners.base import PlannerView, SeenUsers

_KEEPS_LANE_RAD = 0.35
_SIGHT_M = 60.0
_WAY_M, _BEYOND_M, _GAINS_MPS = 7.0, 15.0, 3.0
"""Who stays farther beside the way, or beyond what a car can reach of it, is no matter."""
_TURNS_ON_S, _TURNS_OFF_RADPS = 1.5, 0.12
_LEAST_SCALE = 0.2
"""Of distances along the path seen from the inside of a bend, where they lose their meaning."""


class Courses(NamedTuple):
    """Box centres of N others of S cars at K instants along the path, infinite where none.

    `arc_m` and `offset_m` (K, S, N), `along_mps` and `across_mps` likewise; half extents along and
    across the path `half_along_m`, `half_across_m` (S, N).
    """

    arc_m: Array
    offset_m: Array
    along_mps: Array
    across_mps: Array
    half_along_m: Array
    half_across_m: Array


class Changes(NamedTuple):
    """How others are changing their motion, each (S, R): braking, and yaw rate."""

    brakes_mps2: Array
    yaw_rate_radps: Array


def changes(before: SeenUsers, now: SeenUsers, *, passed_s: float) -> Changes | None:
    """Return what changed between two looks at the same others."""
    if before.poses.shape != now.poses.shape or passed_s <= 0.0:
        return None
    brakes = np.maximum(before.speed_mps - now.speed_mps, 0.0) / passed_s
    turns = wrap_angle(now.poses[..., 2] - before.poses[..., 2]) / passed_s
    known = np.isfinite(turns)
    return Changes(np.where(known, brakes, 0.0), np.where(known, turns, 0.0))


def _may_meet(view: PlannerView, users: SeenUsers, within_s: float) -> npt.NDArray[np.bool_]:
    """(S, R) bool: who could come near the car's way, by present speeds, in that time."""
    along = within_s * users.speed_mps * np.cos(users.turned_rad)
    aside = within_s * np.abs(users.speed_mps * np.sin(users.turned_rad))
    ahead = users.arc_m - view.arc_m[:, None]
    reach = within_s * (view.states[:, 3] + _GAINS_MPS) + _BEYOND_M
    meets = np.abs(users.offset_m - view.offset_m[:, None]) < _WAY_M + aside
    meets &= ahead + np.minimum(along, 0.0) < reach[:, None]
    return np.asarray(meets & (ahead + np.maximum(along, 0.0) > -_BEYOND_M))


def courses(
    view: PlannerView, instants_s: Array, *, nearest: int, changing: Changes | None = None
) -> Courses | None:
    """Predict the `nearest` others of each car at even instants; None where nobody is near.

    Those along the path keep their angle to it, as lanes do; the rest go straight on, and those
    seen `changing` brake or turn on for a while. Who follows in the car's own lane is left out:
    not to be hit from behind is not the car's part.
    """
    users = view.users
    if users is None or users.poses.shape[1] == 0:
        return None
    away = np.square(users.poses[..., 0] - view.states[:, None, 0])
    away += np.square(users.poses[..., 1] - view.states[:, None, 1])
    turned = wrap_angle(users.turned_rad)
    along_lane = (np.abs(turned) < _KEEPS_LANE_RAD) & ~users.walks
    behind = along_lane & (users.arc_m < view.arc_m[:, None])
    behind &= np.abs(users.offset_m - view.offset_m[:, None]) < 2.0
    counts = (away < _SIGHT_M**2) & ~behind & _may_meet(view, users, float(instants_s[-1]))
    if not counts.any():
        return None
    away = np.where(counts, away, np.inf)
    chosen = np.argsort(away, axis=1, kind="stable")[:, : min(nearest, int(counts.sum(1).max()))]

    def pick(values: Array) -> Array:
        return np.take_along_axis(values, chosen, axis=1)

    there = np.take_along_axis(counts, chosen, axis=1)
    arc = np.where(there, pick(users.arc_m), np.inf)
    offset, turned = pick(users.offset_m), pick(turned)
    speed = np.where(there, pick(users.speed_mps), 0.0)
    keeps = np.take_along_axis(along_lane, chosen, axis=1)
    cos, sin = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    length, width = pick(users.size_m[..., 0]), pick(users.size_m[..., 1])
    turned = np.where(there, turned, 0.0)
    offset = np.where(there, offset, 0.0)
    brakes, yaw_rate = np.zeros_like(speed), np.zeros_like(speed)
    if changing is not None:
        brakes, yaw_rate = pick(changing.brakes_mps2), pick(changing.yaw_rate_radps)
    rows: list[list[Array]] = []
    for k, passed_s in enumerate(np.diff(instants_s, prepend=0.0).tolist()):
        after = np.maximum(speed - passed_s * brakes, 0.0)
        mean, speed = 0.5 * (speed + after), after
        # The bend changes slowly: every second step is as the one before.
        if k % 2 == 0:
            bend = view.path.at_nodes(view.path.curvature_pm, np.where(there, arc, 0.0))
            along = np.cos(turned) / np.maximum(1.0 - bend * offset, _LEAST_SCALE)
            across = np.sin(turned)
            goes_on = yaw_rate if instants_s[k] < _TURNS_ON_S else 0.0
            off_the_road = goes_on - bend * along * mean
            if k == 0 and changing is not None:
                keeps = keeps & (np.abs(off_the_road) < _TURNS_OFF_RADPS)
            turning = np.where(keeps, 0.0, off_the_road)
        ahead, aside = along * mean, across * mean
        arc = arc + passed_s * ahead
        offset = offset + passed_s * aside
        turned = turned + passed_s * turning
        rows.append([arc, offset, ahead, aside])
    found = [np.stack(column) for column in zip(*rows, strict=True)]
    return Courses(
        found[0], found[1], found[2], found[3],
        0.5 * (length * cos + width * sin), 0.5 * (length * sin + width * cos),
    )  # fmt: skip
