"""Where a receiver's antenna sits and how late its stamps are: learnt beside the filter, and told.

Wheels and gyro give the path of base_link by themselves. Over a stretch with a turn the fixes
differ from it by a shift and a rotation, which say nothing, by the antenna's place, which turns
with the body, and by the way driven in the time that their clocks differ, which grows with the
speed. So a turn shows the antenna, and turns at different speeds part it from the clock. Each
stretch is fitted by least squares and what it knows of the three is added up; nothing of it moves
the car.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.telemetry.estimator.motion_noise import SLIP_RADPMPS2, SPEED_SCALE_STD
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

_PRIOR = np.array([2.0, 0.7, 0.2])
"""Standard deviations of antenna forward and left (m) and of the stamps' lateness (s) before any
turn: half of a car's length and width; what receivers take at most."""
_LEARNT = 0.25
"""Of the prior's: a value less well known counts as not observable."""
_LONGEST_S, _LEAST_FIXES = 12.0, 12
_LEAST_TURN_RAD, _LEAST_MPS = 0.5, 1.0
_STEP_NS, _LONGEST_GAP_NS = 38_000_000, 500_000_000
"""Turning is smooth over hundredths of a second: few samples of a gyro are enough."""
_PATH_STD_M = 0.03
"""Of dead reckoning over a stretch, beyond wheels' scale and gyro's bias. Chosen."""
_BIAS_STD_RADPS = 5e-4
_ALIKE_FIXES = 3.0
"""Errors of fixes in a row are alike: so many of them count as one. Chosen."""
_CLOCK_STD_S = 0.01
"""Of the stamps' lateness: a wheel's speed is that of half its period ago. Chosen: of 50 Hz."""
_SHARED = 5
"""Parameters of a stretch alone: shift (2), rotation, wheels' scale, gyro's bias."""


class Learnt(NamedTuple):
    """A value and its standard deviation; `observable` where the drive tells of it."""

    value: float
    std: float
    observable: bool


class Mounting(NamedTuple):
    """Where the antenna is in base_link's axes, and how late its fixes are stamped."""

    antenna_forward_m: Learnt
    antenna_left_m: Learnt
    fixes_late_s: Learnt
    turns: int


class _Reckoned(NamedTuple):
    """A fix and where wheels and gyro lead to it: path, heading, speed, and the bias's effect."""

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    bias_x: float
    bias_y: float
    fix_x_m: float
    fix_y_m: float
    std_m: float


class MountingLearner:
    """Takes yaw rates, speeds and fixes in the order of their stamps."""

    def __init__(self) -> None:
        self._stamp_ns: int | None = None
        self._rate_radps = 0.0
        self._here = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        """Time, path (2), heading, and the derivative of the path by the gyro's bias (2)."""
        self._stretch: tuple[_Reckoned, ...] = ()
        self._information: Array = np.diag(1.0 / _PRIOR**2)
        self._vector: Array = np.zeros(3)
        self._misfit = self._squares = 0.0
        self._turns = 0

    def copy(self) -> MountingLearner:
        """Return another one that goes on from here by itself."""
        return shallow_copy(self)

    def turn(self, stamp_ns: int, rate_radps: float, speed_mps: float) -> None:
        """Go on by a yaw rate without bias at a measured speed."""
        before_ns = self._stamp_ns
        if before_ns is not None and 0 <= stamp_ns - before_ns < _STEP_NS:
            return
        before_radps, self._rate_radps, self._stamp_ns = self._rate_radps, rate_radps, stamp_ns
        if before_ns is None or not 0 < stamp_ns - before_ns <= _LONGEST_GAP_NS:
            self._begin()
            return
        time_s, x, y, yaw, bias_x, bias_y = self._here
        step_s = (stamp_ns - before_ns) * 1e-9
        rate_radps = 0.5 * (before_radps + rate_radps)
        # The rear axle moves outwards of where the body points, the more the harder it turns.
        heading = yaw + 0.5 * rate_radps * step_s - SLIP_RADPMPS2[0] * speed_mps * rate_radps
        way = speed_mps * step_s
        cos, sin = way * math.cos(heading), way * math.sin(heading)
        since = time_s + 0.5 * step_s
        self._here = (
            time_s + step_s, x + cos, y + sin, yaw + rate_radps * step_s,
            bias_x - since * sin, bias_y + since * cos,
        )  # fmt: skip

    def take(self, stamp_ns: int, xy_m: Array, std_m: float, speed_mps: float) -> None:
        """Take a believed fix at `xy_m` (2,) with white noise of `std_m`."""
        if self._stamp_ns is None or abs(stamp_ns - self._stamp_ns) > _LONGEST_GAP_NS:
            self._begin()
            return
        if speed_mps < _LEAST_MPS:
            return
        # The last yaw rate is a little older than the fix.
        ahead_m = speed_mps * (stamp_ns - self._stamp_ns) * 1e-9
        time_s, x, y, yaw, bias_x, bias_y = self._here
        x, y = x + ahead_m * math.cos(yaw), y + ahead_m * math.sin(yaw)
        one = _Reckoned(
            time_s, x, y, yaw, speed_mps, bias_x, bias_y, float(xy_m[0]), float(xy_m[1]), std_m
        )
        self._stretch = (*self._stretch, one)
        if time_s > _LONGEST_S:
            self._learn()
            self._begin()

    def _begin(self) -> None:
        self._here, self._stretch = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), ()

    def _learn(self) -> None:
        table = np.array(self._stretch)
        if len(table) < _LEAST_FIXES or np.ptp(table[:, 3]) < _LEAST_TURN_RAD:
            return
        solved = _fit(table)
        if solved is None:
            return
        information, vector, misfit = solved
        self._information = self._information + information
        self._vector = self._vector + vector
        self._misfit += misfit
        self._squares += float(np.mean(table[:, 4] ** 2))
        self._turns += 1

    @property
    def mounting(self) -> Mounting:
        """What is known so far; spreads are as wide as the turns contradict each other."""
        covariance = np.linalg.inv(self._information)
        value = covariance @ self._vector
        against = self._misfit - float(value @ self._vector)
        wide = max(1.0, against / max(1, 3 * (self._turns - 1)))
        # The axle's slip looks like an antenna farther back, the more so the faster the turns.
        slip_m = SLIP_RADPMPS2[1] * self._squares / max(1, self._turns)
        shared = np.array([slip_m, 0.0, _CLOCK_STD_S])
        std = np.sqrt(np.minimum(np.diag(covariance) * wide + shared**2, _PRIOR**2))
        known = [
            Learnt(float(v), float(s), bool(s < _LEARNT * p))
            for v, s, p in zip(value, std, _PRIOR, strict=True)
        ]
        return Mounting(known[0], known[1], known[2], self._turns)


def _fit(table: Array) -> tuple[Array, Array, float] | None:
    """Return what a stretch (N, 10) knows of the three values: information, vector and misfit.

    The misfit is the square of its own best values in their own information.
    """
    _, x, y, yaw, speed, bias_x, bias_y, fix_x, fix_y, std = table.T
    path = np.stack([x, y], axis=1) - [x.mean(), y.mean()]
    fixes = np.stack([fix_x, fix_y], axis=1)
    fixes = fixes - fixes.mean(axis=0)
    dot, cross = (path * fixes).sum(), (path[:, 0] * fixes[:, 1] - path[:, 1] * fixes[:, 0]).sum()
    if math.hypot(dot, cross) == 0.0:
        return None
    angle = math.atan2(cross, dot)
    cos, sin = math.cos(angle), math.sin(angle)
    rotation = np.array([[cos, -sin], [sin, cos]])
    body = np.stack([np.cos(yaw), np.sin(yaw)], axis=1) @ rotation.T
    left = np.stack([-body[:, 1], body[:, 0]], axis=1)
    turned = path @ rotation.T
    drift = np.stack([bias_x, bias_y], axis=1) @ rotation.T
    ones, nothing = np.ones(len(x)), np.zeros(len(x))
    columns = [
        np.stack([ones, nothing], axis=1),
        np.stack([nothing, ones], axis=1),
        np.stack([-turned[:, 1], turned[:, 0]], axis=1),
        turned,
        drift,
        body,
        left,
        -speed[:, None] * body,
    ]
    design = np.stack(columns, axis=2).reshape(-1, len(columns))
    rest = (fixes - turned).reshape(-1)
    noise = np.repeat(std * std + _PATH_STD_M**2, 2)
    own = design.T @ (design / noise[:, None])
    own[3, 3] += 1.0 / SPEED_SCALE_STD**2
    own[4, 4] += 1.0 / _BIAS_STD_RADPS**2
    pull = design.T @ (rest / noise)
    try:
        best = np.linalg.solve(own + np.diag(np.r_[np.zeros(_SHARED), 1.0 / _PRIOR**2]), pull)
        inner = np.linalg.solve(
            own[:_SHARED, :_SHARED], np.c_[own[:_SHARED, _SHARED:], pull[:_SHARED]]
        )
    except np.linalg.LinAlgError:
        return None
    square = float(np.sum((rest - design @ best) ** 2 / noise)) / max(1, len(rest) - len(columns))
    scale = 1.0 / (_ALIKE_FIXES * max(1.0, square))
    information = scale * (own[_SHARED:, _SHARED:] - own[_SHARED:, :_SHARED] @ inner[:, :-1])
    vector = scale * (pull[_SHARED:] - own[_SHARED:, :_SHARED] @ inner[:, -1])
    inverse = np.linalg.inv(information + np.diag(1.0 / _PRIOR**2))
    return information, vector, float(vector @ inverse @ vector)
