"""What a map tells of a car's place: it is near the middle of its side of a road.

How far beside that line it drives (its lane, and how the map lies against the ground) is unknown
but alike for a while. So it is a state of the filter, which fades with the way driven and begins
anew round a corner: a street says once where the car is across it, however often it is asked.
Along a road a line says nothing; that comes with the next road in another direction.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.estimator.filter_state import GNSS_X, GNSS_Y, ROAD_OFFSET, SIZE, YAW, X, Y
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.local_place import LocalPlace

ALIKE_M = 0.5
"""How far the streets of a map lie off the ground all together: no street can tell."""
_ALIKE_OVER_M = 200.0
"""Over this way a street's offset stays alike: lanes change, and so do those who draw."""
_WEAVE_M = 0.3
_CORNER_RAD = 0.35
_HEADING_EVERY_M = 25.0
"""A car weaves in its lane: headings nearer than this say the same."""
_DOUBTFUL, _UNBELIEVABLE = 2.0, 5.0
"""Standard deviations beyond which a line counts for less, and for nothing."""
_ASTRAY = 4.0
"""Standard deviations that a receiver is hardly ever off: sooner is the car elsewhere."""
_DOUBT_M = 150.0


class RoadLine(NamedTuple):
    """A line that a car drives along: a point of it, and its direction from true east.

    `spread_m` is one standard deviation of how far beside it the car may be, the map's own error
    included; `yaw_std_rad` that of the car's heading against it.
    """

    position: GeoPoint
    yaw_rad: float
    spread_m: float
    yaw_std_rad: float
    stamp_ns: int = 0
    """Of the state that it is near; set by who takes it."""


class MapAid:
    """Corrects a filter with lines, as far as they know more than it does.

    `shift_m` (east, north) is what lines have moved the place by so far, None before the first.
    """

    def __init__(self) -> None:
        self.shift_m: tuple[float, float] | None = None
        self._last_xy: Array | None = None
        self._last_yaw_rad = 0.0
        self._heading_m = math.inf
        self._doubt_m = 0.0

    def take(
        self, filter_: KinematicFilter, place: LocalPlace, line: RoadLine, *, receiver_std_m: float
    ) -> bool:
        """Correct with a line; returns whether it counted.

        It does where the receiver (`receiver_std_m`, 0 where it states nothing) or the filter is
        less sure across the road than the line.
        """
        xy, yaw = place.xy_m(line.position), line.yaw_rad + place.convergence_rad
        moved_m = math.inf if self._last_xy is None else float(np.hypot(*(xy - self._last_xy)))
        turned = abs(math.remainder(yaw - self._last_yaw_rad, math.tau)) > _CORNER_RAD
        self._last_xy, self._last_yaw_rad = xy, yaw
        if self._doubt_m > 0.0:
            self._doubt_m -= moved_m
            return False
        left: Array = np.array([-math.sin(yaw), math.cos(yaw)])
        across_m = math.sqrt(max(float(left @ filter_.covariance[:2, :2] @ left), 0.0))
        if max(across_m, receiver_std_m) <= line.spread_m:
            return False
        fading = 0.0 if turned else math.exp(-moved_m / _ALIKE_OVER_M)
        _fade_offset(filter_, fading, line.spread_m)
        before = filter_.mean[:2].copy()
        if not _correct_across(filter_, xy, left):
            return False
        self._heading_m += moved_m
        if self._heading_m >= _HEADING_EVERY_M:
            self._heading_m = 0.0
            off_rad = math.remainder(yaw - filter_.mean[YAW], math.tau)
            spread = math.hypot(line.yaw_std_rad, math.sqrt(filter_.covariance[YAW, YAW]))
            if abs(off_rad) < 3.0 * spread:
                filter_.correct_yaw(yaw, line.yaw_std_rad)
        east_m, north_m = self.shift_m or (0.0, 0.0)
        step = filter_.mean[:2] - before
        self.shift_m = east_m + float(step[0]), north_m + float(step[1])
        return True

    def astray(self, filter_: KinematicFilter, *, receiver_std_m: float) -> bool:
        """Whether the place makes the receiver err as none does: a road was another, if there was
        one."""
        if math.hypot(*filter_.mean[[GNSS_X, GNSS_Y]]) <= _ASTRAY * receiver_std_m:
            return False
        if len(filter_.mean) > SIZE:
            self._doubt_m = _DOUBT_M
        return True


def _fade_offset(filter_: KinematicFilter, fading: float, spread_m: float) -> None:
    """Let the offset forget as an Ornstein-Uhlenbeck process does; `fading` 0 begins it anew."""
    filter_.know_road()
    mean, covariance = filter_.mean, filter_.covariance
    mean[ROAD_OFFSET] *= fading
    covariance[ROAD_OFFSET, :] *= fading
    covariance[:, ROAD_OFFSET] *= fading
    covariance[ROAD_OFFSET, ROAD_OFFSET] += (1.0 - fading * fading) * spread_m * spread_m


def _correct_across(filter_: KinematicFilter, xy_m: Array, left: Array) -> bool:
    """Apply that the car is `ROAD_OFFSET` to the left (2,) of a line through `xy_m` (2,)."""
    row = np.zeros(len(filter_.mean))
    row[X], row[Y], row[ROAD_OFFSET] = left[0], left[1], -1.0
    off_m = float(left @ (filter_.mean[:2] - xy_m)) - float(filter_.mean[ROAD_OFFSET])
    variance = float(row @ filter_.covariance @ row) + _WEAVE_M * _WEAVE_M
    square = off_m * off_m / variance
    if square > _UNBELIEVABLE * _UNBELIEVABLE:
        return False
    # A road far from where it was drawn is likelier than a normal distribution has it.
    doubt = math.sqrt(max(square / (_DOUBTFUL * _DOUBTFUL), 1.0) * variance - variance)
    filter_.correct(row, -off_m, math.hypot(_WEAVE_M, doubt))
    return True
