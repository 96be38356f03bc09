"""How far a receiver's fixes are off: what it states, checked, and what is learnt without it.

Two witnesses tell the noise from fix to fix. Four fixes in a row leave, after the quadratic through
them, nothing but noise and what the car jerks: a bound that needs no filter, so that nothing it
believes can mislead. Below that bound, where wheels are heard, the filter's surprises tell, less
what it expected of itself. Medians of both: a slip spoils few. What lies under all fixes alike no
witness sees: that is as large as the receiver states; of one that states nothing, as of its like.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix
from foretwin.telemetry.estimator.motion_noise import GNSS_CORRELATION_S
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

UNKNOWN_STD_M = 0.05
"""Of fixes that state none, before the car has moved enough to tell. Chosen: between survey
receivers with corrections, which mostly leave it out, and others."""
UNSEEN_STD_M = 2.0
"""The same, where other sensors are held against them. Chosen: ways of 30 m count then, which a
receiver between houses seldom jumps. As much lies at least under all fixes of a receiver without
corrections (u-blox M8, data sheet: half of them within 2.5 m)."""
LEAST_STD_M = 0.012
"""No receiver on a moving car is better (NovAtel OEM7 with RTK: 1 cm + 1 ppm)."""
WANDER_M = 0.5
"""From this stated error on, a receiver has no corrections, and its error wanders slowly."""
_LEAST_STATED_M, _MOST_STATED_M = 1e-3, 1e4
_WHITE_SHARE = 0.1
"""Of the stated error of a receiver that wanders: what changes from fix to fix."""
_SHOWN, _SURELY = 25, 50
"""So many more fixes must bear out than deny that a receiver has corrections, of the latest. Of 26
recordings with them all did within 13 s of driving, at 4 to 50 Hz; of seven without, none."""
_JERK_MPS3 = 4.0
_NOT_JERKED = 0.6
"""So much of what fixes leave that come too seldom to part noise from jerks may be noise. Chosen:
with 1 survey receivers' speeds are 10 % worse, with 0 others turn the car twice as far."""
_REMEMBERED, _LEAST_SEEN = 24, 6
_LATEST, _CLEAN = 8, 2
"""Four fixes' worth of the latest; a slip leaves two of them clean, more noise none."""
_MOVING_MPS = 0.5
_CLEAR = 0.2
"""So small a share of what is looked for may the car's own jerk be to be told apart from it."""
_LIES = 2.0
"""So many times what was stated may what is seen be before it is believed instead."""
_LINE_MEDIAN, _PLANE_MEDIAN = 0.4549, 1.3863
"""Medians of chi-square with one and two degrees of freedom."""
_MEDIAN_SCATTERS = 2.0 / _PLANE_MEDIAN
"""Of itself: one standard deviation of the median of N such squares, times the root of N (1 over
twice the density there, which is a quarter)."""


class _TimedPlace(NamedTuple):
    time_s: float
    x_m: float
    y_m: float


def stated_m(fix: GnssFix) -> float | None:
    """Return the error that a fix states, within what one may be; None where it states none."""
    if fix.std_m is None or not math.isfinite(fix.std_m):
        return None
    return min(max(fix.std_m, _LEAST_STATED_M), _MOST_STATED_M)


class PositionNoise:
    """Learns the white noise of one receiver's fixes, from the fixes and from the surprises."""

    def __init__(self) -> None:
        self._last: tuple[_TimedPlace, ...] = ()
        self._rough: tuple[float, ...] = ()
        self._jerked_m = 0.0
        self._surprises: tuple[float, ...] = ()
        self._expected: tuple[float, ...] = ()
        self._untold_m = 0.0
        """Less than this nothing can tell: where the filter knows little, nothing surprises it;
        where fixes come seldom, the car jerks as much between them."""
        self._still: tuple[float, ...] = ()
        self._jitter_m2: float | None = None
        self._precise = -_SHOWN
        self.seen_m: float | None = None
        """The white noise that was seen; None before there is enough of it."""

    def copy(self) -> PositionNoise:
        """Return another one that goes on from here by itself."""
        return shallow_copy(self)

    def restart(self) -> None:
        """Forget the last fixes: what comes next lies elsewhere."""
        self._last = ()

    def take(self, time_s: float, xy_m: Array) -> None:
        """Take a fix at `xy_m` (2,) that is no wild one."""
        self._last = (*self._last[-3:], _TimedPlace(time_s, float(xy_m[0]), float(xy_m[1])))
        if len(self._last) < 4:
            return
        first, last = self._last[0], self._last[-1]
        span_s = last.time_s - first.time_s
        way_m = math.hypot(last.x_m - first.x_m, last.y_m - first.y_m)
        weights = _beyond_quadratic(*(one.time_s for one in self._last))
        if weights is None:
            return
        if way_m < _MOVING_MPS * span_s:
            still = math.hypot(last.x_m - self._last[-2].x_m, last.y_m - self._last[-2].y_m)
            self._still = (*self._still[1 - _LATEST :], still)
            return
        self._jerked_m = _JERK_MPS3 * (span_s / 3.0) ** 3 / math.sqrt(20.0)
        for off in (
            sum(w * one.x_m for w, one in zip(weights, self._last, strict=True)),
            sum(w * one.y_m for w, one in zip(weights, self._last, strict=True)),
        ):
            self._rough = (*self._rough[1 - _REMEMBERED :], off * off)
        self._learn()

    def surprised(self, away_m: float, expected_m2: float) -> None:
        """Take how far a fix lay off where wheels led, and the variance expected there per axis."""
        square = away_m * away_m - _PLANE_MEDIAN * expected_m2
        self._surprises = (*self._surprises[1 - _REMEMBERED :], square)
        self._expected = (*self._expected[1 - _REMEMBERED :], expected_m2)

    def _learn(self) -> None:
        if len(self._rough) < _LEAST_SEEN:
            return
        latest = self._rough[-_LATEST:]
        if len(latest) == _LATEST and sorted(latest)[_CLEAN - 1] > 2.0 * _middle(self._rough):
            self._rough = latest  # the receiver has become another one
        bound = _middle(self._rough) / _LINE_MEDIAN
        precise = self._precise + (1 if bound <= LEAST_STD_M**2 else -1)
        self._precise = min(max(precise, -_SURELY), _SURELY)
        before = bound if self._jitter_m2 is None else self._jitter_m2
        share = -math.expm1(-(self._last[-1].time_s - self._last[-2].time_s) / GNSS_CORRELATION_S)
        self._jitter_m2 = before + share * (bound - before)
        if len(self._surprises) < _LEAST_SEEN:
            square = bound - self._jerked_m * self._jerked_m
            self._untold_m = _NOT_JERKED * math.sqrt(bound) if square < 0.0 else 0.0
        else:
            square = min(bound, _middle(self._surprises) / _PLANE_MEDIAN)
            scatter = _MEDIAN_SCATTERS / math.sqrt(len(self._expected))
            self._untold_m = math.sqrt(min(bound, scatter * _middle(self._expected)))
        self.seen_m = math.sqrt(max(square, 0.0))

    def std_m(self, fix: GnssFix) -> float:
        """Return one standard deviation of a fix on each axis, all that is known together."""
        if (stated := stated_m(fix)) is not None:
            return max(stated, self._seen_beyond(stated))
        if self.seen_m is None:
            return UNKNOWN_STD_M
        return max(self.seen_m, self._untold_m, LEAST_STD_M)

    def still_std_m(self, fix: GnssFix) -> float:
        """Return how far its fixes jitter about a car that stands, as they have done lately.

        That is less than they err on the move, and what they did there says nothing of it.
        """
        white = self.white_std_m(fix)
        if len(self._still) < _LEAST_SEEN:
            return white
        return min(max(_middle(self._still), LEAST_STD_M), white)

    def white_std_m(self, fix: GnssFix) -> float:
        """Return what of it changes from fix to fix."""
        std = self.std_m(fix)
        if not self.wanders(fix):
            return std
        if self.seen_m is None:
            return std  # nobody knows yet what of it changes
        white = _WHITE_SHARE * (stated_m(fix) or _LEAST_STATED_M)
        if self._jerked_m < _CLEAR * white:
            return max(self.seen_m, LEAST_STD_M)
        # This share is nobody's word: where surprises cannot tell, as much as they leave open.
        return max(white, self._seen_beyond(white), min(self._untold_m, std))

    def apart_std_m(self, fix: GnssFix) -> float:
        """Return the white noise by which a fix differs as much from the one before as it does.

        A slow error, too, is another one after a second: by 3 m alike over 30 s, 0.8 m.
        """
        white = self.white_std_m(fix)
        if not self.wanders(fix) or len(self._last) < 2:
            return white
        changed = -math.expm1(-(self._last[-1].time_s - self._last[-2].time_s) / GNSS_CORRELATION_S)
        return math.hypot(white, self.std_m(fix) * math.sqrt(changed))

    def most_std_m(self, fix: GnssFix) -> float:
        """Return how far off a fix may be whatever it states: ten times what such fixes jitter."""
        return max(self.std_m(fix), math.sqrt(self._jitter_m2 or 0.0) / _WHITE_SHARE)

    def hidden_std_m(self, fix: GnssFix) -> float:
        """Return what may lie under all fixes alike of a receiver that states no error.

        None of those without corrections jitters as little as one that has them, and what jitters
        is a tenth of how far it is off. So this is 0 once it has shown that it is one of these.
        """
        if stated_m(fix) is not None or self._precise > 0:
            return 0.0
        return max(UNSEEN_STD_M, self.most_std_m(fix))

    def sure_white_std_m(self, fix: GnssFix) -> float:
        """Return a white noise that is surely no smaller: beyond it fixes contradict a sensor."""
        if self.seen_m is None and stated_m(fix) is None:
            return UNSEEN_STD_M
        return self.white_std_m(fix)

    def _seen_beyond(self, stated_m: float) -> float:
        """Return what was seen where it gives the lie to `stated_m`, 0 elsewhere."""
        seen = self.seen_m or 0.0
        return seen if seen > max(_LIES * stated_m, LEAST_STD_M) else 0.0

    def wanders(self, fix: GnssFix) -> bool:
        """Whether the receiver itself says that it is rough: then its error wanders slowly."""
        return (stated_m(fix) or 0.0) >= WANDER_M


def _beyond_quadratic(a: float, b: float, c: float, d: float) -> list[float] | None:
    """Return weights of four instants, of length 1, that leave nothing of a quadratic."""
    products = (
        (a - b) * (a - c) * (a - d),
        (b - a) * (b - c) * (b - d),
        (c - a) * (c - b) * (c - d),
        (d - a) * (d - b) * (d - c),
    )
    if not all(products):
        return None
    weights = [1.0 / product for product in products]
    length = math.sqrt(sum(weight * weight for weight in weights))
    return [weight / length for weight in weights]


def _middle(values: tuple[float, ...]) -> float:
    return sorted(values)[len(values) // 2]
