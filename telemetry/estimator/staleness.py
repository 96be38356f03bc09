"""Which of a vehicle's channels are overdue, judged in the vehicle's own time."""

from __future__ import annotations

import itertools
import math
from collections import deque

WATCHED = ("gnss", "imu", "speed", "heading", "steering", "control", "plan")
"""Channels that come at a steady rate."""
OVERDUE_NS = 150_000_000
"""A channel is overdue at the latest this long after its next sample should have come."""
_PATIENCE_NS = 100_000_000
"""And not sooner than this: senders and receivers that share a busy machine pause for as long."""
_USUAL_NS = 300_000_000
"""So late may all samples of a channel be and count as fresh; no receiver needs longer."""
_REMEMBERED = 64
_LEAST_SAMPLES = 5
_RELEARN = 16
_RARE = 1e-5
"""So seldom may samples that were merely lost one after the other make a channel look stale."""
_LONGEST_PERIOD_NS = 5_000_000_000
_MARGIN_NS = 5_000_000


class _ChannelRate:
    """The rate of one channel, how many of its samples are lost, and how late they come."""

    def __init__(self) -> None:
        self.last_ns = 0
        self.period_ns: int | None = None
        self._stamps_ns: deque[int] = deque(maxlen=_REMEMBERED)
        self._late_ns: deque[int] = deque(maxlen=_REMEMBERED)
        self._count = 0
        self._patience_ns = 0

    def take(self, stamp_ns: int, now_ns: int) -> None:
        self.last_ns = max(self.last_ns, stamp_ns) if self._count else stamp_ns
        self._stamps_ns.append(stamp_ns)
        self._late_ns.append(max(0, now_ns - stamp_ns))
        self._count += 1
        if self._count >= _LEAST_SAMPLES and (
            self._count < _RELEARN or self._count % _RELEARN == 0
        ):
            self._learn()

    def _learn(self) -> None:
        stamps = sorted(set(self._stamps_ns))
        steps = sorted(later - earlier for earlier, later in itertools.pairwise(stamps))
        if not steps:
            return
        # Losses make steps longer, never shorter: the period is among the shorter ones.
        period_ns = steps[len(steps) // 4]
        lost = 1.0 - len(steps) / max(1.0, (stamps[-1] - stamps[0]) / period_ns)
        in_a_row = math.log(_RARE) / math.log(min(lost, 0.9)) if lost > 0.02 else 1.0
        usual_ns, latest_ns = min(self._late_ns), max(self._late_ns)
        slack_ns = round((in_a_row - 1.0) * period_ns) + latest_ns - usual_ns + _MARGIN_NS
        self.period_ns = period_ns
        slack_ns = min(max(slack_ns, _PATIENCE_NS), OVERDUE_NS)
        self._patience_ns = min(usual_ns, _USUAL_NS) + period_ns + slack_ns

    def overdue(self, now_ns: int) -> bool:
        if self.period_ns is None or self.period_ns > _LONGEST_PERIOD_NS:
            return False
        return now_ns - self.last_ns > self._patience_ns


class Staleness:
    """Learns each channel's period from its stamps and says which are overdue.

    Channels that `sends` does not name are not watched; none named means all are.
    """

    def __init__(self, sends: tuple[str, ...]) -> None:
        self._watched = tuple(name for name in WATCHED if not sends or name in sends)
        self._channels: dict[str, _ChannelRate] = {}

    def take(self, channel: str, stamp_ns: int, now_ns: int) -> None:
        """Note a sample that came at `now_ns`, in the time of its stamp."""
        if channel not in self._watched:
            return
        rate = self._channels.get(channel)
        if rate is None:
            rate = self._channels[channel] = _ChannelRate()
        rate.take(stamp_ns, now_ns)

    def overdue(self, now_ns: int) -> tuple[str, ...]:
        """Return the channels that have been seen and are overdue at `now_ns`."""
        channels = self._channels.items()
        return tuple(sorted(name for name, known in channels if known.overdue(now_ns)))
