"""Who stands in the stand-in's way, or is about to: seen along its path, a car's width wide."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.drive import RoadUser
from foretwin.contracts.frames import local_pose
from foretwin.telemetry.standin.path import DrivenPath, PathPiece

FRONT_M, HALF_WIDTH_M = 3.54, 0.81
"""From the rear axle to the front bumper, and half the width: CommonRoad's vehicle 2 (length 4.508,
width 1.610, wheelbase 2.579 m), its overhangs alike."""
_BESIDE_M = 0.4
"""Room that is left to either side; chosen."""
_SHORT_OF_M = 2.0
"""As far before somebody the bumper stops; chosen."""
_AHEAD_M, _AHEAD_S, _STEP_S = 80.0, 3.0, 0.25
"""So far along the path, and so far into the future, straight on at their speed."""


class Hindrance(NamedTuple):
    """Where base_link must have slowed down to a speed, as a distance along the path."""

    user: RoadUser
    s_m: float
    speed_mps: float

    def gap_m(self, s_m: float) -> float:
        """Return how far the bumper is from them where base_link is `s_m` along the path."""
        return self.s_m + _SHORT_OF_M - s_m


def hindrance(
    path: DrivenPath, s_m: float, users: Sequence[RoadUser], *, age_s: float = 0.0
) -> Hindrance | None:
    """Return the nearest of `users`, seen `age_s` ago, in the way of a car `s_m` along its path."""
    ahead = path.piece(s_m, s_m + _AHEAD_M) if users else None
    if ahead is None:
        return None
    found = [
        one for user in users if (one := _of_one(path, s_m, ahead, user, age_s=age_s)) is not None
    ]
    return min(found, key=lambda one: one.s_m, default=None)


def _of_one(
    path: DrivenPath, s_m: float, ahead: PathPiece, user: RoadUser, *, age_s: float
) -> Hindrance | None:
    x_m, y_m, yaw_rad = local_pose(path.frame, user.position, user.yaw_rad)
    way_m = user.speed_mps * (age_s + np.arange(0.0, _AHEAD_S + _STEP_S, _STEP_S))
    going = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
    at_m, left_m, along_rad = ahead.locate(np.array([x_m, y_m]) + way_m[:, None] * going)
    turned = np.abs(np.cos(yaw_rad - along_rad)), np.abs(np.sin(yaw_rad - along_rad))
    half_along_m = 0.5 * (user.length_m * turned[0] + user.width_m * turned[1])
    half_aside_m = 0.5 * (user.length_m * turned[1] + user.width_m * turned[0])
    in_the_way = np.abs(left_m) <= HALF_WIDTH_M + _BESIDE_M + half_aside_m
    # Whom the bumper has passed is beside the car, not before it.
    in_the_way &= at_m + half_along_m > s_m + FRONT_M
    if not in_the_way.any():
        return None
    reached_m = np.where(in_the_way, at_m - half_along_m, np.inf)
    first = int(np.argmin(reached_m))
    speed_mps = max(0.0, user.speed_mps * float(np.cos(yaw_rad - along_rad[first])))
    return Hindrance(user, float(reached_m[first]) - FRONT_M - _SHORT_OF_M, speed_mps)
