"""Whether states are as good as they say, by what the fixes around them show.

Seven fixes show place and motion in their middle by the cubic through them, without filter, wheels
or gyro. So each state is checked when three more fixes have come, and what is told of place, speed
and heading from then on is wider or narrower, until 95 of 100 lie within their 95 % (Gibbs, Candes
2021). Where fixes are too rough or too far apart to show it, spreads stay as the filter has them.
What all fixes err alike shows nowhere: places are never told better than the filter has them, nor
is the heading where one is measured, which may differ from every course.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from foretwin.contracts.arrays import Array
from foretwin.telemetry.estimator.filter_state import CURVATURE, SPEED, YAW, X, Y
from foretwin.telemetry.estimator.innovations import LINE_95, PLANE_95
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

_PLACE_NOISE, _SLOPE_NOISE = math.sqrt(7.0 / 21.0), math.sqrt(16_674.0) / 252.0
"""Of each fix's white noise, what is left in `_cubic`'s value and slope."""
_LEAST_S, _LONGEST_S = 0.15, 0.3
"""Fixes that come more often are left out; between some that come more seldom much may happen."""
_UNEVEN = 0.25
"""So much of a step may a fix come beside its time. Chosen."""
_MOVING_MPS, _COURSE_MPS = 0.5, 2.0
"""A slower car has no course that its fixes would tell."""
_CLEAR = 0.7
"""What fixes show must be better known than the state, by so much. Chosen."""
_UP, _DOWN = 1.1, 1.1 ** (-1.0 / 19.0)
"""What of 100 checks the 5 beyond the 95 % bound and the 95 within it make of a spread: less than
of single fixes, for neighbouring checks share most of theirs. Chosen."""
_LEAST, _MOST = 0.3, 30.0
_LEAST_NOISE_M = 0.003
"""Of a survey receiver's fixes among each other: seen so on six of them."""


class _Told(NamedTuple):
    """A fix, and what the state at it said of the antenna's motion."""

    time_s: float
    x_m: float
    y_m: float
    at_x_m: float
    at_y_m: float
    speed_mps: float
    course_rad: float
    place_std_m: float
    speed_std_mps: float
    yaw_std_rad: float


class _Middle(NamedTuple):
    value: float
    slope: float


class Stretched(NamedTuple):
    """By how much the filter's own spreads of place, speed and yaw are to be multiplied."""

    place: float
    speed: float
    yaw: float


class ToldSpreads:
    """Checks each state by the fixes around it. Without them nothing is stretched."""

    def __init__(self) -> None:
        self.stretched = Stretched(1.0, 1.0, 1.0)
        self._told: tuple[_Told, ...] = ()

    def copy(self) -> ToldSpreads:
        """Return another one that goes on from here by itself."""
        return shallow_copy(self)

    def take(
        self,
        time_s: float,
        xy_m: Array,
        filter_: KinematicFilter,
        lever_m: tuple[float, float],
        *,
        noise_m: float | None,
        overconfidence: float,
        heading: bool,
    ) -> None:
        """Take a fix at `xy_m` (2,) that has just corrected the filter.

        `noise_m` is what was seen of the fixes' white noise, `overconfidence` what already
        stretches the spreads; `heading` says that one is measured.
        """
        before = self._told
        if before and time_s - before[-1].time_s < _LEAST_S:
            return
        speed, curvature = filter_.mean.item(SPEED), filter_.mean.item(CURVATURE)
        at = filter_.sensor_xy(lever_m)
        ahead, beside = 1.0 - lever_m[1] * curvature, lever_m[0] * curvature
        variance = filter_.covariance
        one = _Told(
            time_s,
            xy_m.item(0),
            xy_m.item(1),
            at.item(0),
            at.item(1),
            speed * math.hypot(ahead, beside),
            filter_.mean.item(YAW) + math.atan2(beside, ahead) + (math.pi if speed < 0.0 else 0.0),
            overconfidence * math.sqrt(0.5 * (variance.item(X, X) + variance.item(Y, Y))),
            overconfidence * math.sqrt(variance.item(SPEED, SPEED)),
            overconfidence * math.sqrt(variance.item(YAW, YAW)),
        )
        self._told = (*before[-6:], one)
        if noise_m is None or len(before) < 6:
            return
        self._check(max(noise_m, _LEAST_NOISE_M), least_yaw=1.0 if heading else _LEAST)

    def _check(self, noise_m: float, *, least_yaw: float) -> None:
        told = self._told
        first_s = told[0].time_s
        step_s = (told[6].time_s - first_s) / 6.0
        if step_s > _LONGEST_S:
            return
        for k, one in enumerate(told):
            if abs(one.time_s - first_s - k * step_s) > _UNEVEN * step_s:
                return
        middle, now = told[3], self.stretched
        place_std_m = math.hypot(now.place * middle.place_std_m, _PLACE_NOISE * noise_m)
        x_m, vx = _cubic(*(one.x_m for one in told))
        y_m, vy = _cubic(*(one.y_m for one in told))
        off_m = math.hypot(x_m - middle.at_x_m, y_m - middle.at_y_m)
        place = _stretched(now.place, off_m * off_m > PLANE_95 * place_std_m**2, least=1.0)
        speed_mps, noise_mps = math.hypot(vx, vy) / step_s, _SLOPE_NOISE * noise_m / step_s
        speed, std_mps = now.speed, now.speed * middle.speed_std_mps
        if speed_mps > _MOVING_MPS and noise_mps < _CLEAR * std_mps:
            off = speed_mps - abs(middle.speed_mps)
            beyond = off * off > LINE_95 * (std_mps**2 + noise_mps**2)
            speed = _stretched(speed, beyond, least=_LEAST)
        yaw, std_rad = now.yaw, now.yaw * middle.yaw_std_rad
        noise_rad = noise_mps / max(speed_mps, _COURSE_MPS)
        if speed_mps > _COURSE_MPS and noise_rad < _CLEAR * std_rad:
            off = math.remainder(math.atan2(vy, vx) - middle.course_rad, math.tau)
            beyond = off * off > LINE_95 * (std_rad**2 + noise_rad**2)
            yaw = _stretched(yaw, beyond, least=least_yaw)
        self.stretched = Stretched(place, speed, yaw)


def _cubic(a: float, b: float, c: float, d: float, e: float, f: float, g: float) -> _Middle:
    """Return value and slope per step, at the middle one, of the cubic through seven even values.

    Savitzky, Golay 1964, tables I and IV.
    """
    return _Middle(
        (7.0 * d + 6.0 * (c + e) + 3.0 * (b + f) - 2.0 * (a + g)) / 21.0,
        (58.0 * (e - c) + 67.0 * (f - b) - 22.0 * (g - a)) / 252.0,
    )


def _stretched(by: float, beyond: bool, *, least: float) -> float:
    return min(max(by * (_UP if beyond else _DOWN), least), _MOST)
