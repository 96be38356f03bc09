"""The gap while driving: samples and states in; gap samples, alarms and verdicts out."""

from __future__ import annotations

from collections import deque
from typing import Any

from foretwin.contracts.drive import VehicleInfo, VehicleState
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.gap import GapAlarm, GapSample, Verdict
from foretwin.contracts.simulation import HORIZONS_S
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.slopes import Slopes
from foretwin.sim_worker.analysis.gap.errors import GapLimits, GapMeter
from foretwin.sim_worker.analysis.gap.free_run import FreeRunner
from foretwin.sim_worker.analysis.gap.measured_motion import motion_on_grid
from foretwin.sim_worker.analysis.gap.verdict import KEPT_S, FaultDetector, without_manual_commands

_SECOND_NS = 1_000_000_000
_MOST_STATES_HZ = 120.0
_STATE = "state"
SHORT_S, LONG_EVERY = 2.0, 4
"""Longer runs overlap by most of their length: every fourth says the same at half the cost."""


class GapMonitor:
    """Watches one vehicle: pure, its time is that of the messages, bounded whatever comes.

    `handle` takes every sample under its channel, and the estimated VehicleStates under "state".
    Once a second of driving the model runs freely over each short horizon that ends now, every
    four seconds over the long ones too.
    """

    def __init__(
        self,
        info: VehicleInfo,
        vehicle: VehicleParameters,
        *,
        frame: LocalFrame,
        roads: Slopes | None = None,
    ) -> None:
        """`roads` in `frame` are those of the map, where it is known not to be flat."""
        self._roads = roads
        self._vehicle_id = info.vehicle_id
        self._frame = frame
        self._detector = FaultDetector(info, vehicle, frame=frame, roads=roads)
        self._meter = GapMeter(FreeRunner(vehicle, roads=self._roads), vehicle_id=info.vehicle_id)
        self._limits = GapLimits()
        self._recorder = self._detector.recorder
        self._states: deque[VehicleState] = deque(maxlen=round(KEPT_S * _MOST_STATES_HZ))
        self._next_ns: int | None = None
        self._measured = 0

    def use_vehicle(self, vehicle: VehicleParameters) -> None:
        """Compare with a model of other parameters from now on."""
        self._meter = GapMeter(FreeRunner(vehicle, roads=self._roads), vehicle_id=self._vehicle_id)
        self._detector.use_vehicle(vehicle)

    def handle(self, channel: str, message: Any) -> list[GapSample | GapAlarm | Verdict]:
        """Take one message; return what follows from it, in time order."""
        if channel != _STATE:
            verdict = self._detector.handle(channel, message)
            return [] if verdict is None else [verdict]
        if not isinstance(message, VehicleState):
            return []
        if self._states and message.stamp_ns <= self._states[-1].stamp_ns:
            return []
        self._states.append(message)
        if self._next_ns is None:
            self._next_ns = message.stamp_ns + round(HORIZONS_S[0] * 1e9)
        if message.stamp_ns < self._next_ns or self._recorder.newest_stamp_ns is None:
            return []
        self._next_ns = message.stamp_ns + _SECOND_NS
        return self._measure(message.stamp_ns)

    def _measure(self, now_ns: int) -> list[GapSample | GapAlarm | Verdict]:
        """Run the model over each horizon that ends at the newest state."""
        first_ns = self._states[0].stamp_ns
        self._measured += 1
        horizons = [
            horizon
            for horizon in HORIZONS_S
            if now_ns - round(horizon * 1e9) >= first_ns
            and (horizon <= SHORT_S or self._measured % LONG_EVERY == 0)
        ]
        if not horizons:
            return []
        # One second more before the start: what the delayed steering was found.
        from_ns = now_ns - round(horizons[-1] * 1e9) - _SECOND_NS
        record = without_manual_commands(self._recorder.record(from_ns, now_ns))
        motion = motion_on_grid(self._states, record.stamp_ns, frame=self._frame)
        found: list[GapSample | GapAlarm | Verdict] = []
        for sample in self._meter.latest(record, motion, horizons_s=horizons):
            found.append(sample)
            found.extend(self._limits.handle(sample))
        return found
