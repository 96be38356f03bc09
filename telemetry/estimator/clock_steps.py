"""Takes steps out of a vehicle's clock, so that time goes on where its stamps leap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from foretwin.contracts.running import MOST_LISTED, FirstOf
from foretwin.telemetry.estimator.clock import ClockEstimator
from foretwin.telemetry.estimator.measured import CLOCK_LEAP_NS

CONFIRM_NS = 1_000_000_000
"""A clock that stepped is believed after this long of stamps that agree with one another."""
_LEAST_SAMPLES = 3
_AHEAD_NS = 300_000_000
"""No sample overtakes the fastest by more, whatever the network does."""
_BEHIND_NS = 1_000_000_000
"""Late samples are dropped; older ones than this raise the doubt that the clock stepped."""
_SAME_STEP_NS = 250_000_000
_GAP_NS = 5_000_000_000
_SETTLING_NS = 2_000_000_000


class ClockStep(NamedTuple):
    """A step that was believed: the channel that told, the old stamp, and the step in ns."""

    channel: str
    stamp_ns: int
    step_ns: int


@dataclass(slots=True)
class _Doubt:
    """A run of samples that do not fit the clock as known, but one another."""

    first_ns: int
    last_ns: int
    last_received_ns: int
    least_delay_ns: int
    count: int = 1


@dataclass(slots=True)
class _ChannelTime:
    shift_ns: int = 0
    """Continuous minus stamped time."""
    last_ns: int | None = None
    """The newest believed sample, in continuous time."""
    period_ns: int = 0
    least_excess_ns: int | None = None
    doubt: _Doubt | None = None


class ClockSteps:
    """Maps stamps to a continuous time; `steps` lists every step that was believed.

    Each channel is watched by itself, but a step that one has confirmed the others take over. With
    times of receipt a step ahead is seen as well, and its size is measured; without them a run
    that goes back is joined on one period after the last sample.
    """

    def __init__(self, clock: ClockEstimator) -> None:
        """`clock` is fed by the caller with continuous stamps."""
        self._clock = clock
        self._channels: dict[str, _ChannelTime] = {}
        self._first_received_ns: int | None = None
        self.steps: FirstOf[ClockStep] = FirstOf(MOST_LISTED)

    def shift_ns(self, channel: str) -> int:
        """Return what is added to this channel's stamps."""
        known = self._channels.get(channel)
        return known.shift_ns if known else 0

    def place(self, channel: str, stamp_ns: int, received_ns: int | None) -> int | None:
        """Return the sample's continuous stamp.

        With `received_ns` None is returned for one that is in doubt; without, such a stamp is
        returned as it is and lies before the last one.
        """
        known = self._channels.get(channel)
        if known is None:
            known = self._channels[channel] = _ChannelTime()
        placed_ns = stamp_ns + known.shift_ns
        if known.last_ns is None and received_ns is None:
            known.last_ns = placed_ns
            return placed_ns
        if received_ns is not None and self._first_received_ns is None:
            self._first_received_ns = received_ns
        if self._fits(known, placed_ns, received_ns):
            return self._believe(known, placed_ns, received_ns)
        for other in self._channels.values():
            if other.shift_ns != known.shift_ns and self._fits(
                known, stamp_ns + other.shift_ns, received_ns
            ):
                known.shift_ns = other.shift_ns
                return self._believe(known, stamp_ns + other.shift_ns, received_ns)
        if received_ns is None and known.last_ns is not None and placed_ns > known.last_ns:
            # A leap ahead without a witness: the track decides; a second one makes it the time.
            doubt = known.doubt
            if doubt is not None and 0 <= stamp_ns - doubt.last_ns <= CLOCK_LEAP_NS:
                return self._believe(known, placed_ns, None)
            known.doubt = _Doubt(stamp_ns, stamp_ns, 0, 0)
            return placed_ns
        if not self._confirmed(known, stamp_ns, received_ns):
            return placed_ns if received_ns is None else None
        return self._step(channel, known, stamp_ns, received_ns)

    def _fits(self, known: _ChannelTime, placed_ns: int, received_ns: int | None) -> bool:
        if received_ns is None:
            assert known.last_ns is not None
            return 0 <= placed_ns - known.last_ns <= CLOCK_LEAP_NS
        if known.last_ns is not None and placed_ns < known.last_ns - _BEHIND_NS:
            return False
        if not self._clock.known:
            return True
        if known.last_ns is not None and (
            placed_ns - known.last_ns <= _AHEAD_NS + 2 * known.period_ns
        ):
            return True  # it follows the last one: if it seems early, those before it were late
        ahead_ns = placed_ns - self._clock.stamp_at(received_ns)
        settled = received_ns - (self._first_received_ns or 0) > _SETTLING_NS
        # What came first may have waited for the connection: then others may be ahead of it.
        return ahead_ns <= (_AHEAD_NS if settled else CLOCK_LEAP_NS)

    def _believe(self, known: _ChannelTime, placed_ns: int, received_ns: int | None) -> int:
        if known.last_ns is not None and 0 < placed_ns - known.last_ns < _GAP_NS:
            step_ns = placed_ns - known.last_ns
            known.period_ns += (step_ns - known.period_ns) // 8 if known.period_ns else step_ns
        known.last_ns = placed_ns if known.last_ns is None else max(known.last_ns, placed_ns)
        known.doubt = None
        if received_ns is not None and self._clock.known:
            excess_ns = received_ns - placed_ns - self._clock.offset_ns
            least = known.least_excess_ns
            known.least_excess_ns = excess_ns if least is None else min(least, excess_ns)
        return placed_ns

    def _confirmed(self, known: _ChannelTime, stamp_ns: int, received_ns: int | None) -> bool:
        doubt = known.doubt
        delay_ns = 0 if received_ns is None else received_ns - stamp_ns
        if doubt is None or not _agrees(doubt, stamp_ns, received_ns):
            known.doubt = _Doubt(stamp_ns, stamp_ns, received_ns or 0, delay_ns)
            return False
        doubt.last_ns = max(doubt.last_ns, stamp_ns)
        doubt.last_received_ns = received_ns or 0
        doubt.least_delay_ns = min(doubt.least_delay_ns, delay_ns)
        doubt.count += 1
        return doubt.count >= _LEAST_SAMPLES and doubt.last_ns - doubt.first_ns >= CONFIRM_NS

    def _step(
        self, channel: str, known: _ChannelTime, stamp_ns: int, received_ns: int | None
    ) -> int:
        doubt, last_ns = known.doubt, known.last_ns
        assert doubt is not None
        if received_ns is None:
            assert last_ns is not None
            shift_ns = last_ns + known.period_ns - doubt.first_ns
        else:
            least_ns = self._clock.offset_ns + max(known.least_excess_ns or 0, 0)
            shift_ns = doubt.least_delay_ns - least_ns
        for other in self._channels.values():
            if (
                other is not known
                and other.shift_ns
                and (abs(other.shift_ns - shift_ns) < _SAME_STEP_NS)
            ):
                shift_ns = other.shift_ns
        self.steps.append(ClockStep(channel, stamp_ns, known.shift_ns - shift_ns))
        known.shift_ns = shift_ns
        if last_ns is not None and stamp_ns + shift_ns < last_ns - _BEHIND_NS:
            known.last_ns = None
        return self._believe(known, stamp_ns + shift_ns, received_ns)


def _agrees(doubt: _Doubt, stamp_ns: int, received_ns: int | None) -> bool:
    step_ns = stamp_ns - doubt.last_ns
    if received_ns is None:
        return 0 <= step_ns <= _GAP_NS
    elapsed_ns = received_ns - doubt.last_received_ns
    return step_ns >= -_AHEAD_NS and abs(step_ns - elapsed_ns) <= _BEHIND_NS // 2
