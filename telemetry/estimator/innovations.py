"""Innovations: what a measurement says beyond what was expected, and whether that was believable.

Of an honest filter the normalised squares are chi-square distributed (Bar-Shalom, Li, Kirubarajan
2001, 5.4): 95 of 100 lie below its 95 % bound. More beyond it: the filter believes too much.

A sensor that states no noise is used with one learnt from its surprises, the latest among them, and
wider on purpose: within that nearly all lie, whatever it does. So it is judged by the surprises
before alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from foretwin.contracts.arrays import Array
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

LINE_95, PLANE_95 = 3.841, 5.991
"""95 % of chi-square with one and two degrees of freedom."""
_LEAST_SEEN, _LATEST = 20, 0.02
"""Surprises that tell what to expect of the next: so many are not judged themselves, and of later
ones that share of each counts, as `measured.Doubt` has it. Of 20, by Student's t, 93.6 of 100 lie
within 1.96 of their deviations."""


class Surprises(NamedTuple):
    """How many measurements of a kind were taken, and how many of them were no surprise.

    `within` counts those with normalised squares below their 95 % bound: of an honest filter 95 of
    100. Of a sensor that states no noise the first 20 are not among the taken.
    """

    taken: int
    within: int


class LineInnovation(NamedTuple):
    """How far a number lies off the expected one, and the filter's own variance of that."""

    residual: float
    variance: float


class SurpriseCount:
    """Counts surprises by channel."""

    def __init__(self) -> None:
        self._counts: dict[str, list[int]] = {}
        self._before: dict[str, tuple[int, float]] = {}

    def copy(self) -> SurpriseCount:
        """Return another count that goes on from here by itself."""
        other = shallow_copy(self)
        other._counts = {channel: count.copy() for channel, count in self._counts.items()}
        other._before = self._before.copy()
        return other

    def take(self, channel: str, square: float, bound: float) -> None:
        """Take a measurement's normalised square, which 95 of 100 have below `bound`."""
        count = self._counts.get(channel)
        if count is None:
            count = self._counts[channel] = [0, 0]
        count[0] += 1
        if square <= bound:
            count[1] += 1

    def take_line(
        self,
        channel: str,
        innovation: LineInnovation,
        *,
        least_std: float,
        most_std: float = math.inf,
        usual: float = 1.0,
    ) -> None:
        """Take a number of a sensor that states no noise, judged by its surprises before.

        Its noise is between `least_std` and `most_std`, and no more of its surprises is taken for
        noise than one part in `usual`.
        """
        seen, mean_square = self._before.get(channel, (0, 0.0))
        square = innovation.residual**2
        if seen >= _LEAST_SEEN:
            least, most = (innovation.variance + std**2 for std in (least_std, most_std))
            self.take(channel, square / min(max(mean_square / usual**2, least), most), LINE_95)
        seen += 1
        mean_square += max(1.0 / seen, _LATEST) * (square - mean_square)
        self._before[channel] = seen, mean_square

    @property
    def counts(self) -> dict[str, Surprises]:
        """What was counted so far, by channel."""
        return {channel: Surprises(*count) for channel, count in sorted(self._counts.items())}


class PositionInnovation(NamedTuple):
    """How far a position lies off the expected one (2,), and what was expected of that.

    `cross` (n, 2) is the covariance of state and place, the others that of the place alone.
    """

    residual_m: Array
    cross: Array
    xx_m2: float
    xy_m2: float
    yy_m2: float

    @property
    def away_m(self) -> float:
        """How far the position lies off."""
        return math.hypot(self.residual_m[0], self.residual_m[1])

    def variance_m2(self, std_m: float) -> float:
        """Return the variance of that on each axis, with white noise of `std_m`."""
        return 0.5 * (self.xx_m2 + self.yy_m2) + std_m * std_m

    def square(self, std_m: float) -> float:
        """Return the normalised square for white noise of `std_m`: chi-square with two degrees."""
        a, d = self.xx_m2 + std_m * std_m, self.yy_m2 + std_m * std_m
        x, y = self.residual_m.tolist()
        return float((d * x * x - 2.0 * self.xy_m2 * x * y + a * y * y) / (a * d - self.xy_m2**2))
