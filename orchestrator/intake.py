"""Where telemetry comes in: counts every sample, and turns it into the estimated state."""

from __future__ import annotations

import time
from typing import NamedTuple

from contracts.bus import Received
from contracts.codec import SchemaMismatch
from contracts.drive import (
    DriveEnd,
    PlannedTrajectory,
    RoadUsers,
    SignalState,
    VehicleInfo,
    VehicleState,
)
from contracts.vehicle import VehicleParameters
from orchestrator.bookkeeping import TelemetryCount
from telemetry.estimator import StateEstimator


class LatestState(NamedTuple):
    """The newest state, and when the sample that gave it was received."""

    state: VehicleState
    receipt_mono_ns: int


class Surroundings(NamedTuple):
    """The newest of what a car says besides its own motion; each with its own stamp."""

    plan: PlannedTrajectory | None
    road_users: RoadUsers | None
    signals: tuple[SignalState, ...]


class Intake:
    """Takes samples one by one; the estimator behind it is pure."""

    def __init__(self, vehicle: VehicleParameters) -> None:
        self.counts = TelemetryCount()
        self.info: VehicleInfo | None = None
        self.end: DriveEnd | None = None
        self.latest: LatestState | None = None
        self.plan: PlannedTrajectory | None = None
        self.road_users: RoadUsers | None = None
        self.signals: dict[str, SignalState] = {}
        """The newest of each signal group."""
        self.states = 0
        self.first_stamp_ns: int | None = None
        self.refused = 0
        self._vehicle = vehicle
        self._estimator: StateEstimator | None = None

    def take_info(self, info: VehicleInfo) -> None:
        """Begin to estimate: what the vehicle says of itself is known."""
        self.info = info
        self._estimator = StateEstimator(
            info,
            wheelbase_m=self._vehicle.wheelbase_m.value,
            steering_ratio=self._vehicle.steering_ratio.value,
            steering_offset_rad=self._vehicle.steering_offset_rad.value,
        )

    def take(self, item: Received) -> VehicleState | None:
        """Take one sample; returns the new state where it gives one.

        Raises SchemaMismatch for a sample of another schema, which is counted as refused.
        """
        try:
            envelope = item.envelope()
        except SchemaMismatch:
            self.refused += 1
            raise
        message = envelope.message
        if self.first_stamp_ns is None:
            self.first_stamp_ns = message.stamp_ns
        if isinstance(message, DriveEnd):
            self.end = message
            return None
        age_ms = max(0.0, (time.time_ns() - envelope.sent_ns) / 1e6)
        self.counts.take(key=item.key, channel=item.channel, seq=envelope.seq, age_ms=age_ms)
        if isinstance(message, PlannedTrajectory):
            self.plan = message
        elif isinstance(message, RoadUsers):
            self.road_users = message
        elif isinstance(message, SignalState):
            self.signals[message.group_id] = message
        if self._estimator is None:
            return None
        state = self._estimator.handle(item.channel, message)
        if state is not None:
            self.latest = LatestState(state, item.received_mono_ns)
            self.states += 1
        return state

    @property
    def surroundings(self) -> Surroundings:
        """What the car last said of its plan, of other road users and of lights."""
        return Surroundings(self.plan, self.road_users, tuple(self.signals.values()))

    @property
    def start_stamp_ns(self) -> int:
        """The stamp of drive time 0."""
        return self.info.start_stamp_ns if self.info else 0

    @property
    def now_stamp_ns(self) -> int:
        """The stamp of the newest state, the drive's start before the first."""
        return self.latest.state.stamp_ns if self.latest else self.start_stamp_ns

    @property
    def skipped_invalid(self) -> int:
        """Samples refused so far: by the source's reader, by the estimator, by the codec."""
        by_estimator = sum(self._estimator.skipped.values()) if self._estimator else 0
        return by_estimator + self.refused + (self.end.skipped_invalid if self.end else 0)
