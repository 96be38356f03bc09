"""The vehicle's state from whatever it has sent so far: pure and causal.

The same messages with the same times of receipt in the same order give the same states, and no
state depends on what came later.
"""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.drive import VehicleInfo, VehicleState
from foretwin.contracts.keys import CHANNELS
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.steering import column_of
from foretwin.telemetry.estimator.clock import ClockEstimator
from foretwin.telemetry.estimator.clock_steps import ClockStep, ClockSteps
from foretwin.telemetry.estimator.fix_rhythm import FixRhythm
from foretwin.telemetry.estimator.map_aid import RoadLine
from foretwin.telemetry.estimator.measured import USUAL_STEERING, Steering
from foretwin.telemetry.estimator.motion_track import MotionTrack
from foretwin.telemetry.estimator.reordering import Reordering
from foretwin.telemetry.estimator.reported_state import StateConsistency
from foretwin.telemetry.estimator.staleness import Staleness

STATE_PERIOD_NS = 20_000_000
"""The next sample after so long gives a new state; a position gives one at once, and where one
follows at the very stamp it alone does."""
_MOTION = ("gnss", "imu", "speed", "heading", "steering")
"""Channels that say how the car moves."""
_KINDS: dict[str, type] = {name: CHANNELS[name].kind for name in _MOTION}


class ClockReport(NamedTuple):
    """What is known of the vehicle's clock; None where samples had no time of receipt.

    `offset_ns` is receipt minus stamp, the least transport delay included; `drift_ppm` how much
    faster the vehicle's clock runs; `spread_s` the 95th percentile of delays beyond the least.
    """

    offset_ns: int | None
    drift_ppm: float | None
    spread_s: float | None
    steps: tuple[ClockStep, ...]


class StateEstimator:
    """Turns samples into VehicleStates of base_link, as MotionTrack sees the motion.

    Samples with a time of receipt may come late, out of order, doubled or not at all, with a
    foreign clock; those without are taken in the order in which they come (recordings, lock
    step). `skipped` counts refused input by reason, `late` and `doubled` what came too late or
    twice, by channel.
    """

    def __init__(self, info: VehicleInfo, *, steering: Steering = USUAL_STEERING) -> None:
        self._track = MotionTrack(info, steering=steering)
        self._reordering: Reordering | None = None
        self._clock = ClockEstimator()
        self._steps = ClockSteps(self._clock)
        self._staleness = Staleness(info.sends)
        self._refused: Counter[str] = Counter()
        self._state_ns: int | None = None
        self._fixes = FixRhythm()
        self._newest_ns: int | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the motion where it is computed from the samples that are kept."""
        return self.__dict__ if self._reordering is None else self.__dict__ | {"_track": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if self._reordering is not None:
            self._track = self._reordering.track()

    @property
    def skipped(self) -> Counter[str]:
        """How many samples were refused, by reason."""
        return self._track.skipped + self._refused

    @property
    def refused(self) -> Counter[str]:
        """Those of `skipped` that never came as far as the motion."""
        return self._refused

    @property
    def clock_steps(self) -> int:
        """How often the vehicle's clock has stepped."""
        return len(self._steps.steps) + self._steps.steps.left_out

    @property
    def late(self) -> Counter[str]:
        """How many samples came too late to count, by channel."""
        return Counter() if self._reordering is None else self._reordering.late

    @property
    def doubled(self) -> Counter[str]:
        """How many samples came once more, by channel."""
        return Counter() if self._reordering is None else self._reordering.doubled

    @property
    def clock(self) -> ClockReport:
        """What is known of the vehicle's clock."""
        steps = tuple(self._steps.steps)
        if not self._clock.known:
            return ClockReport(None, None, None, steps)
        return ClockReport(
            self._clock.offset_ns, self._clock.drift_ppm, self._clock.spread_s(), steps
        )

    @property
    def clock_offset_ns(self) -> int | None:
        """The `offset_ns` of the clock alone, which costs less than all of it."""
        return self._clock.offset_ns if self._clock.known else None

    @property
    def consistency(self) -> StateConsistency:
        """Whether the states were as sure of themselves as they turned out to be."""
        return self._track.consistency

    @property
    def left_out(self) -> frozenset[str]:
        """The channels whose samples do not go with positions, as far as these tell."""
        return self._track.left_out

    def handle(
        self, channel: str, message: Any, *, received_ns: int | None = None
    ) -> VehicleState | None:
        """Take one message; return the new state where one is due, None otherwise.

        `received_ns` is the receiver's monotonic clock, at the pace of the vehicle's. Channels
        that say nothing of the motion are watched for staleness alone.
        """
        kind = _KINDS.get(channel)
        if kind is not None and not isinstance(message, kind):
            self._refused[f"{channel}_wrong_type"] += 1
            return None
        stamp_ns = getattr(message, "stamp_ns", None)
        if stamp_ns is None:
            return None
        if kind is None:
            self._watch(channel, stamp_ns + self._steps.shift_ns(channel), received_ns)
            return None
        placed_ns = self._steps.place(channel, stamp_ns, received_ns)
        if placed_ns is None:
            self._refused[f"{channel}_clock_doubtful"] += 1
            return None
        if received_ns is not None:
            self._clock.handle(placed_ns, received_ns)
        if placed_ns != stamp_ns:
            message = msgspec.structs.replace(message, stamp_ns=placed_ns)
        self._watch(channel, placed_ns, received_ns)
        self._fixes = self._fixes.after(channel, placed_ns)
        if received_ns is None:
            state = self._in_order(channel, message)
        else:
            state = self._as_received(channel, message, received_ns)
        if state is not None and placed_ns != stamp_ns:
            # Inside time goes on; what leaves carries the vehicle's own clock.
            own_ns = state.stamp_ns - (placed_ns - stamp_ns)
            state = msgspec.structs.replace(state, stamp_ns=own_ns)
        return state

    def take_line(self, line: RoadLine) -> None:
        """Take the line of a map along which the newest state drives; counts from the next on."""
        if self._state_ns is None:
            return
        line = line._replace(stamp_ns=self._state_ns)
        if self._reordering is None:
            self._track.take("map", line)
        else:
            self._reordering.add("map", line)

    def overdue(self, received_ns: int) -> tuple[str, ...]:
        """Return the channels that are overdue now, for when nothing at all comes any more."""
        if not self._clock.known:
            return ()
        return self._staleness.overdue(self._clock.stamp_at(received_ns))

    def _watch(self, channel: str, placed_ns: int, received_ns: int | None) -> None:
        if received_ns is not None:
            now_ns = self._clock.stamp_at(received_ns) if self._clock.known else placed_ns
        else:
            now_ns = placed_ns if self._newest_ns is None else max(self._newest_ns, placed_ns)
            if placed_ns - (self._newest_ns or placed_ns) > 0 or self._newest_ns is None:
                self._newest_ns = placed_ns
        self._staleness.take(channel, placed_ns, now_ns)

    # Recordings and lock step: in the order of the stamps.

    def _in_order(self, channel: str, message: Any) -> VehicleState | None:
        if not self._track.take(channel, message):
            return None
        stamp_ns = message.stamp_ns
        if channel == "gnss":
            stamp_ns = max(stamp_ns, self._state_ns or 0)
            return self._leave(self._track.state(stamp_ns, fix=message), stamp_ns)
        if not self._track.started or self._state_ns is None:
            return None
        if stamp_ns - self._state_ns < STATE_PERIOD_NS or self._fixes.due:
            return None
        return self._leave(self._track.state(stamp_ns), stamp_ns)

    # A network: as they come.

    def _as_received(self, channel: str, message: Any, received_ns: int) -> VehicleState | None:
        if self._reordering is None:
            self._reordering = Reordering(self._track)
        reordering = self._reordering
        if not reordering.add(channel, message):
            return None
        newest = reordering.newest
        assert newest is not None
        is_newest = newest.message is message
        due = self._state_ns is None or newest.stamp_ns - self._state_ns >= STATE_PERIOD_NS
        due = due and not self._fixes.due
        if not due and not (is_newest and channel == "gnss"):
            return None
        self._track = reordering.track()
        fix = newest.message if newest.channel == "gnss" else None
        if fix is not None and self._track.fix is not fix:
            return None  # refused: the next sample gives the state
        if self._track.fix is None or (fix is None and not self._track.started):
            return None
        state = self._track.state(newest.stamp_ns, fix=fix)
        return self._leave(state, self._clock.stamp_at(received_ns))

    def _leave(self, state: VehicleState, now_ns: int) -> VehicleState:
        self._state_ns = state.stamp_ns
        stale = self._staleness.overdue(now_ns)
        return msgspec.structs.replace(state, stale=stale) if stale else state


def estimator_of(info: VehicleInfo, vehicle: VehicleParameters) -> StateEstimator:
    """Return the estimator of the state of a vehicle with these parameters."""
    steering = Steering(vehicle.wheelbase_m.value, column_of(vehicle))
    return StateEstimator(info, steering=steering)
