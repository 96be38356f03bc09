"""Whether a message of a recording is stamped by the clock of its positions.

Sensors stamp by clocks of their own, such as TAI, which is 37 s ahead of UTC, or GPS's, 18 s; and a
stamp may be damaged. In the order of stamps one that is ahead would make the positions look late.
When a message came, by the recorder's one clock, tells them apart.
"""

from __future__ import annotations

OTHER_CLOCK = "stamp ahead of the positions' clock"


class FixClock:
    """Follows how far the recorder's clock is ahead of the positions' stamps."""

    def __init__(self, lag_ns: int, *, most_ahead_ns: int) -> None:
        """`lag_ns` is that of the first position; stamps may be ahead by `most_ahead_ns`."""
        self._lag_ns, self._most_ns = lag_ns, most_ahead_ns
        self._doubted_lag_ns: int | None = None

    def takes(self, stamp_ns: int, log_time_ns: int, *, is_fix: bool) -> bool:
        """Return whether to take a message, given in the order in which they came.

        A position that is ahead is one of a clock that stepped where the next one bears it out.
        """
        lag_ns = log_time_ns - stamp_ns
        if not is_fix:
            return self._lag_ns - lag_ns <= self._most_ns
        if self._lag_ns - lag_ns > self._most_ns:
            before_ns, self._doubted_lag_ns = self._doubted_lag_ns, lag_ns
            if before_ns is None or abs(before_ns - lag_ns) > self._most_ns:
                return False
        self._doubted_lag_ns = None
        self._lag_ns = min(self._lag_ns, lag_ns)
        return True
