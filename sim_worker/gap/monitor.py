"""The gap while driving: samples and states in; gap samples, alarms and verdicts out."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from contracts.drive import VehicleInfo, VehicleState
from contracts.frames import LocalFrame
from contracts.gap import GapAlarm, GapSample, Verdict
from contracts.vehicle import VehicleParameters
from sim_worker.gap.errors import HORIZONS_S, GapMeter
from sim_worker.gap.free_run import FreeRunner
from sim_worker.gap.limits import LIMITS_PER_S, GapLimits
from sim_worker.gap.measured_motion import motion_on_grid
from sim_worker.gap.verdict import Judge, without_manual_commands
from sim_worker.motion_record import MotionRecorder

_SECOND_NS = 1_000_000_000
_STATE = "state"


class GapMonitor:
    """Watches one vehicle: pure, its time is that of the messages, bounded whatever comes.

    `handle` takes every sample under its channel, and the estimated VehicleStates under "state".
    Once a second of driving the model runs freely over each horizon that ends now.
    """

    def __init__(
        self,
        info: VehicleInfo,
        vehicle: VehicleParameters,
        *,
        frame: LocalFrame,
        horizons_s: Sequence[float] = HORIZONS_S,
        limits_per_s: Mapping[str, float] = LIMITS_PER_S,
    ) -> None:
        self._frame = frame
        self._horizons_s = tuple(sorted(horizons_s))
        self._judge = Judge(info, vehicle, frame=frame)
        self._meter = GapMeter(FreeRunner(vehicle), vehicle_id=info.vehicle_id)
        self._limits = GapLimits(limits_per_s=limits_per_s)
        keep_s = self._horizons_s[-1] + 2.0
        self._recorder = MotionRecorder(frame=frame, keep_s=keep_s, depth=4000)
        self._states: deque[VehicleState] = deque(maxlen=round(keep_s * 120.0))
        self._next_ns: int | None = None

    @property
    def judge(self) -> Judge:
        """Who weighs the signals."""
        return self._judge

    def handle(self, channel: str, message: Any) -> list[GapSample | GapAlarm | Verdict]:
        """Take one message; return what follows from it, in time order."""
        if channel != _STATE:
            newest = self._recorder.newest_stamp_ns
            stamp_ns = getattr(message, "stamp_ns", None)
            if stamp_ns is None or (newest is not None and stamp_ns < newest - 2 * _SECOND_NS):
                return []
            self._recorder.handle(channel, message)
            verdict = self._judge.handle(channel, message)
            return [] if verdict is None else [verdict]
        if not isinstance(message, VehicleState):
            return []
        if self._states and message.stamp_ns <= self._states[-1].stamp_ns:
            return []
        self._states.append(message)
        if self._next_ns is None:
            self._next_ns = message.stamp_ns + round(self._horizons_s[0] * 1e9)
        if message.stamp_ns < self._next_ns or self._recorder.newest_stamp_ns is None:
            return []
        self._next_ns = message.stamp_ns + _SECOND_NS
        return self._measure(message.stamp_ns)

    def _measure(self, now_ns: int) -> list[GapSample | GapAlarm | Verdict]:
        """Run the model over each horizon that ends at the newest state."""
        first_ns = self._states[0].stamp_ns
        told: list[GapSample | GapAlarm | Verdict] = []
        for horizon in self._horizons_s:
            from_ns = now_ns - round(horizon * 1e9)
            if from_ns < first_ns:
                break
            # One second more before the start: what the delayed steering was told.
            record = self._recorder.record(from_ns - _SECOND_NS, now_ns)
            record = without_manual_commands(record)
            motion = motion_on_grid(self._states, record.stamp_ns, frame=self._frame)
            samples = self._meter.samples(
                record, motion, horizons_s=(horizon,), from_index=round(1e9 / 2e7),
                every_s=2.0 * horizon,
            )  # fmt: skip
            for sample in samples:
                told.append(sample)
                told.extend(self._limits.handle(sample))
        return told
