"""Which positions may be believed: one decision per fix, from what came before it alone."""

from __future__ import annotations

import math
from collections import Counter, deque
from typing import Literal, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix
from foretwin.telemetry.estimator.measured import CLOCK_LEAP_NS
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

MAX_SPEED_MPS = 70.0
"""A position that asks for more than this is no motion of a road vehicle. Chosen: 252 km/h."""
_JUMP_CONFIRM_S = 1.0
_HISTORY_S = 6.0
_STANDING_FIXES, _STANDING_S = 4, 0.55
_UNSEEN_BRAKING_MPS2 = 3.0
"""So hard may a car brake within two fixes that are the same to the bit. Chosen: harder braking
shows in the fixes before."""
_LONGEST_FROZEN_S = 3.0
_CREEPING_MPS = 0.5
_STANDING_MPS = 0.06
_STEP_DEVIATIONS = 4.0
"""Two fixes of a car that stands lie farther apart once in fifty times."""

Verdict = Literal["use", "relocate", "skip"]


class LocalFix(NamedTuple):
    """A fix in seconds since the first one and metres (2,) in the local frame."""

    time_s: float
    xy_m: Array


class PositionGate:
    """Sorts fixes into those to use, those that move the whole track, and those to skip.

    `skipped` counts what was refused by reason. `recent` holds the believed fixes of some seconds.
    """

    def __init__(self) -> None:
        self.skipped: Counter[str] = Counter()
        self.recent: deque[LocalFix] = deque()
        self._last_stamp_ns: int | None = None
        self._leap_stamp_ns: int | None = None
        self._elsewhere: list[LocalFix] = []
        self._anew_s: float | None = None
        self._held: LocalFix | None = None
        """The first of fixes that have not changed by a bit."""

    def copy(self) -> PositionGate:
        """Return another gate that goes on from here by itself."""
        other = shallow_copy(self)
        other.skipped, other.recent = self.skipped.copy(), self.recent.copy()
        other._elsewhere = self._elsewhere.copy()
        return other

    def plausible(self, fix: GnssFix) -> bool:
        """Return whether the fix is a position on Earth with a stamp after the last one's."""
        lat, lon = fix.position.lat_deg, fix.position.lon_deg
        if not (math.isfinite(lat) and math.isfinite(lon)):
            return self._refuse("gnss_not_finite")
        if lat == 0.0 and lon == 0.0:
            return self._refuse("gnss_zero")
        if abs(lat) > 90.0 or abs(lon) > 180.0:
            return self._refuse("gnss_off_earth")
        if self._last_stamp_ns is not None:
            if fix.stamp_ns <= self._last_stamp_ns:
                return self._refuse("gnss_time_backwards")
            if fix.stamp_ns - self._last_stamp_ns > CLOCK_LEAP_NS:
                # One wild stamp must not make all later ones look late: wait for a second.
                leap, self._leap_stamp_ns = self._leap_stamp_ns, fix.stamp_ns
                if leap is None or not 0 < fix.stamp_ns - leap <= CLOCK_LEAP_NS:
                    return self._refuse("gnss_time_leap")
        self._last_stamp_ns = fix.stamp_ns
        self._leap_stamp_ns = None
        return True

    def _refuse(self, reason: str) -> bool:
        self.skipped[reason] += 1
        return False

    def judge(self, time_s: float, xy_m: Array, expected_xy_m: Array | None) -> Verdict:
        """Decide on a plausible fix at `xy_m` (2,), where the filter expected `expected_xy_m`.

        A jump is skipped until fixes have agreed with one another for a second; then the track
        is relocated there.
        """
        if expected_xy_m is not None and self.recent:
            last = self.recent[-1]
            elapsed = max(time_s - last.time_s, 0.02)
            # Where the filter is astray, a fix that follows from the last one is still no jump.
            away = min(_distance(xy_m, expected_xy_m), _distance(xy_m, last.xy_m))
            if away > MAX_SPEED_MPS * elapsed:
                return self._judge_jump(LocalFix(time_s, xy_m))
        self._elsewhere.clear()
        self._remember(LocalFix(time_s, xy_m))
        return "use"

    def _judge_jump(self, fix: LocalFix) -> Verdict:
        if self._elsewhere:
            last = self._elsewhere[-1]
            elapsed = max(fix.time_s - last.time_s, 0.02)
            if _distance(fix.xy_m, last.xy_m) > MAX_SPEED_MPS * elapsed:
                self._elsewhere.clear()
        self._elsewhere.append(fix)
        if fix.time_s - self._elsewhere[0].time_s < _JUMP_CONFIRM_S - 1e-6:
            self.skipped["gnss_jump"] += 1
            return "skip"
        self.recent.clear()
        for earlier in self._elsewhere:
            self._remember(earlier)
        self._elsewhere.clear()
        return "relocate"

    def restart(self, time_s: float, xy_m: Array) -> None:
        """Forget all fixes but this one: the local frame is another."""
        self.recent.clear()
        self._elsewhere.clear()
        self._remember(LocalFix(time_s, xy_m))

    def frozen(self, time_s: float, xy_m: Array, *, speed_mps: float) -> bool:
        """Whether a receiver gives its last answer once more while the car cannot have stopped.

        `speed_mps` is what is known of the car's speed without this fix.
        """
        held = self._held
        if held is None or held.xy_m[0] != xy_m[0] or held.xy_m[1] != xy_m[1]:
            self._held = LocalFix(time_s, xy_m)
            return False
        since_s = time_s - held.time_s
        if since_s > _LONGEST_FROZEN_S:
            return False
        return speed_mps - _UNSEEN_BRAKING_MPS2 * since_s > _CREEPING_MPS

    def hold_back(self) -> LocalFix:
        """Leave the last fix out of what shows the motion, and return it."""
        return self.recent.pop()

    def begin_anew(self, fixes: tuple[LocalFix, ...], *, after_s: float = 0.0) -> None:
        """Let these show the motion, and none before them but those begun anew just before."""
        if self._anew_s is None or fixes[0].time_s - self._anew_s > after_s:
            self.recent.clear()
        self.recent.extend(fixes)
        self._anew_s = fixes[-1].time_s

    def slip(self, by_m: Array, last: LocalFix) -> None:
        """Move all fixes by (2,), and go on with `last`: the receiver moved, the car did not."""
        self.recent = deque(LocalFix(fix.time_s, fix.xy_m + by_m) for fix in self.recent)
        self.recent.append(last)

    def _remember(self, fix: LocalFix) -> None:
        self.recent.append(fix)
        while fix.time_s - self.recent[0].time_s > _HISTORY_S:
            self.recent.popleft()

    def standing(self, std_m: float) -> bool:
        """Return whether the last fixes show nothing but jitter of `std_m` about one point.

        Where they are rare the newest may show alone that the car has begun to roll.
        """
        last: list[LocalFix] = []
        for fix in reversed(self.recent):
            last.append(fix)
            span_s = last[0].time_s - fix.time_s
            if span_s >= _STANDING_S and len(last) >= _STANDING_FIXES:
                break
        else:
            return False
        step_s = last[0].time_s - last[1].time_s
        if self.last_step_m > _STANDING_MPS * step_s + _STEP_DEVIATIONS * std_m:
            return False
        # Point by point: of a handful numpy takes five times as long.
        points = [(float(fix.xy_m[0]), float(fix.xy_m[1])) for fix in last]
        middle = sum(x for x, _ in points) / len(points), sum(y for _, y in points) / len(points)
        spread = max(math.dist(point, middle) for point in points)
        return spread < _STANDING_MPS * span_s + 1.5 * std_m

    def course(self, min_distance_m: float, *, within_s: float = _HISTORY_S) -> float | None:
        """Return the direction of the latest stretch of `min_distance_m`, None if too short."""
        if not self.recent:
            return None
        now = self.recent[-1]
        for fix in reversed(self.recent):
            if now.time_s - fix.time_s > within_s:
                return None
            if _distance(now.xy_m, fix.xy_m) >= min_distance_m:
                dx, dy = now.xy_m - fix.xy_m
                return math.atan2(dy, dx)
        return None

    def gone_on(self, time_s: float, yaw_rad: float, speed_mps: float) -> tuple[float, Array]:
        """Return how old the latest fix is by then, and where (2,) it lies for a car going so."""
        last = self.recent[-1]
        since_s = max(time_s - last.time_s, 0.0)
        ahead = np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
        return since_s, last.xy_m + since_s * speed_mps * ahead

    @property
    def last_step_m(self) -> float:
        """How far the last two believed fixes lie apart."""
        if len(self.recent) < 2:
            return 0.0
        return _distance(self.recent[-1].xy_m, self.recent[-2].xy_m)

    def speed_mps(self) -> float:
        """Return the speed between the last two believed fixes, 0 before there are two."""
        if len(self.recent) < 2:
            return 0.0
        return self.last_step_m / self._last_step_s

    def speed_std_mps(self, std_m: float) -> float:
        """Return how well two fixes of `std_m` tell that speed."""
        return math.sqrt(2.0) * std_m / self._last_step_s if len(self.recent) > 1 else 0.0

    @property
    def _last_step_s(self) -> float:
        return max(self.recent[-1].time_s - self.recent[-2].time_s, 0.02)


def _distance(a: Array, b: Array) -> float:
    return math.hypot(a[0] - b[0], a[1] - b[1])
