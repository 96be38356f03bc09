"""How the vehicle's clock stands to the receiver's, from stamps and times of receipt alone."""

from __future__ import annotations

import itertools
from collections import deque
from typing import NamedTuple

import numpy as np

_EXCESSES = 512
_STRETCH_S, _STRETCHES = 0.25, 120
"""The least delayed samples of so many stretches are the window."""
_LEAST_SPAN_S = _STRETCHES * _STRETCH_S / 3.0
"""The drift is taken as zero until points are so far apart."""
_MOST_DRIFT = 200e-6


class _Earliest(NamedTuple):
    """The least delayed sample of one stretch of time; seconds after the first sample's."""

    stretch: int
    stamp_s: float
    delay_s: float


class ClockEstimator:
    """Estimates offset and drift of a foreign clock from the least delayed samples.

    Delays only add: a line below all points (stamp, receipt - stamp) that comes nearest to them is
    the clock, up to the least transport delay, which one-way data cannot tell from an offset. The
    line is an edge of the lower convex hull over a sliding window (Moon, Skelly, Towsley 1999,
    Estimation and removal of clock skew from network delay measurements). Stamps are expected
    without steps; `ClockSteps` takes them out.
    """

    def __init__(self) -> None:
        self._origin: tuple[int, int] | None = None
        self._earliest: deque[_Earliest] = deque()
        self._excess_s: deque[float] = deque(maxlen=_EXCESSES)
        self._level_s, self._slope = 0.0, 0.0
        self._newest_s = 0.0

    def handle(self, stamp_ns: int, received_ns: int) -> None:
        """Take one sample's stamp and its receipt by the receiver's monotonic clock."""
        if self._origin is None:
            self._origin = (stamp_ns, received_ns)
        stamp_s = (stamp_ns - self._origin[0]) * 1e-9
        received_s = (received_ns - self._origin[1]) * 1e-9
        delay_s = received_s - stamp_s
        self._newest_s = max(self._newest_s, stamp_s)
        stretch = int(received_s // _STRETCH_S)
        point = _Earliest(stretch, stamp_s, delay_s)
        if not self._earliest or stretch > self._earliest[-1].stretch:
            self._earliest.append(point)
            while self._earliest[0].stretch <= stretch - _STRETCHES:
                self._earliest.popleft()
            self._fit()
        elif delay_s - self._slope * stamp_s < self._earliest[-1].delay_s - (
            self._slope * self._earliest[-1].stamp_s
        ):
            self._earliest[-1] = point._replace(stretch=self._earliest[-1].stretch)
            if delay_s < self._line_s(stamp_s):
                self._fit()
        self._excess_s.append(delay_s - self._line_s(stamp_s))

    def _line_s(self, stamp_s: float) -> float:
        return self._level_s + self._slope * stamp_s

    def _fit(self) -> None:
        points = sorted((point.stamp_s, point.delay_s) for point in self._earliest)
        slope = 0.0
        if points[-1][0] - points[0][0] >= _LEAST_SPAN_S:
            slope = _supporting_slope(points)
        self._slope = min(max(slope, -_MOST_DRIFT), _MOST_DRIFT)
        self._level_s = min(delay - self._slope * stamp for stamp, delay in points)

    @property
    def known(self) -> bool:
        """Whether any sample has come."""
        return self._origin is not None

    @property
    def offset_ns(self) -> int:
        """Receipt minus stamp at the newest stamp, the least transport delay included.

        0 before there is a sample.
        """
        if self._origin is None:
            return 0
        return self._origin[1] - self._origin[0] + round(self._line_s(self._newest_s) * 1e9)

    @property
    def drift_ppm(self) -> float:
        """How much faster the vehicle's clock runs than the receiver's, in millionths."""
        return -self._slope * 1e6

    def spread_s(self, percent: float = 95.0) -> float:
        """Return that percentile of the latest delays beyond the least one, 0 of none."""
        if not self._excess_s:
            return 0.0
        return float(np.percentile(np.array(self._excess_s), percent))

    def stamp_at(self, received_ns: int) -> int:
        """Return what an undelayed sample's stamp would be that is received now."""
        return received_ns - self.offset_ns


def _supporting_slope(points: list[tuple[float, float]]) -> float:
    """Return the slope of the lower hull's edge above which the mean of N sorted points lies."""
    hull: list[tuple[float, float]] = []
    for point in points:
        while len(hull) >= 2 and _turns_down(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    middle = sum(stamp for stamp, _ in points) / len(points)
    for (x0, y0), (x1, y1) in itertools.pairwise(hull):
        if x1 >= middle and x1 > x0:
            return (y1 - y0) / (x1 - x0)
    return 0.0


def _turns_down(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) <= (c[0] - a[0]) * (b[1] - a[1])
