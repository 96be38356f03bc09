"""Where telemetry comes in: counts every sample, and turns it into the estimated state."""

from __future__ import annotations

import time
from typing import Any

import msgspec

from foretwin.contracts.bus import Received
from foretwin.contracts.drive import (
    DriveEnd,
    PlannedTrajectory,
    RoadUsers,
    SignalState,
    VehicleInfo,
    VehicleState,
    VehicleStatus,
)
from foretwin.contracts.guard import Refused
from foretwin.contracts.trace import traced
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.steering import column_of
from foretwin.orchestrator.drive.telemetry_watch import TelemetryWatch, record
from foretwin.orchestrator.instructions import LatestReports, LatestState, Notice
from foretwin.orchestrator.record.bookkeeping import TelemetryCount
from foretwin.orchestrator.rounds.learnt_signals import SignalLearner
from foretwin.telemetry.estimator.estimator import StateEstimator, estimator_of
from foretwin.telemetry.estimator.map_aid import RoadLine


class Intake:
    """Takes samples one by one; the estimator behind it is pure."""

    def __init__(self, vehicle: VehicleParameters, *, pace: float | None = None) -> None:
        """`pace` is how many seconds of the vehicle pass in one of ours.

        None is lock step: samples are taken in their order and times of receipt mean nothing.
        """
        self.counts = TelemetryCount()
        self.info: VehicleInfo | None = None
        self.end: DriveEnd | None = None
        self.latest: LatestState | None = None
        self.plan: PlannedTrajectory | None = None
        self.status: VehicleStatus | None = None
        self.road_users: RoadUsers | None = None
        self.signals = SignalLearner()
        self.states = 0
        self.first_stamp_ns: int | None = None
        self.refused = 0
        self.watch = TelemetryWatch()
        self._pace = pace
        self._vehicle = self._vehicle_at_start = vehicle
        self._estimator: StateEstimator | None = None

    def take_info(self, info: VehicleInfo) -> None:
        """Begin to estimate: what the vehicle says of itself is known."""
        self.info = info
        self._estimator = estimator_of(info, self._vehicle)

    @property
    def estimator(self) -> StateEstimator | None:
        """What estimates the state, None before the vehicle has said what it is."""
        return self._estimator

    @property
    def clock_offset_ns(self) -> int | None:
        """Receipt less stamp of the least delayed sample; None before there is one."""
        return None if self._estimator is None else self._estimator.clock_offset_ns

    def go_on(self, estimator: StateEstimator) -> None:
        """Estimate on from where another orchestrator's estimator was."""
        self._estimator = estimator

    def use_vehicle(self, vehicle: VehicleParameters) -> None:
        """Turn steering wheels into tyres with these parameters from now on."""
        self._vehicle = vehicle

    @traced("take a sample")
    def take(self, item: Received) -> VehicleState | None:
        """Take one sample; returns the new state where it gives one.

        Raises Refused for a sample that the guard does not let in, which is counted.
        """
        try:
            envelope = item.envelope()
        except Refused as refused:
            self.refused += 1
            if refused.header is not None:  # it came: it is not lost as well
                numbered = {"sender": item.sender, **refused.header._asdict()}
                self.counts.came(item.channel, **numbered)
            raise
        message = envelope.message
        if self.first_stamp_ns is None:
            self.first_stamp_ns = message.stamp_ns
        if isinstance(message, DriveEnd):
            self.end = message
            return None
        self.counts.take(
            item.channel,
            sender=item.sender,
            seq=envelope.seq,
            sent_ns=envelope.sent_ns,
            now_ns=time.time_ns(),
        )
        if isinstance(message, PlannedTrajectory):
            # Stacks without a route say so by a plan without points: that is none.
            self.plan = message if len(message.time_from_stamp_s) else None
        elif isinstance(message, VehicleStatus):
            self.status = message
        elif isinstance(message, RoadUsers):
            self.road_users = message
        elif isinstance(message, SignalState):
            self.signals.take(message)
        if self._estimator is None:
            return None
        received_ns, steps = self._drive_ns(item.received_mono_ns), self._estimator.clock_steps
        state = self._estimator.handle(item.channel, message, received_ns=received_ns)
        if self._estimator.clock_steps != steps:
            self.signals = SignalLearner()  # by the old clock, they would be the newest for long
        if state is not None:
            state = self._with_mode(self._with_tire_angle(state))
            self.latest = LatestState(state, item.received_mono_ns)
            self.states += 1
        return state

    def take_line(self, line: RoadLine) -> None:
        """Take the line of the map along which the latest state drives."""
        if self._estimator is not None:
            self._estimator.take_line(line)

    def _with_tire_angle(self, state: VehicleState) -> VehicleState:
        """Return the state with the tyre angle that the parameters in force give it.

        The estimator keeps those that it began with: its motion hardly hangs on them.
        """
        wheel = state.steering_wheel_rad
        if self._vehicle is self._vehicle_at_start or wheel is None:
            return state
        if state.tire_angle_rad != column_of(self._vehicle_at_start).tire_rad(wheel):
            return state  # measured, or from the motion
        return msgspec.structs.replace(
            state, tire_angle_rad=column_of(self._vehicle).tire_rad(wheel)
        )

    def _with_mode(self, state: VehicleState) -> VehicleState:
        if self.status is None:
            return state
        return msgspec.structs.replace(state, control_mode=self.status.control_mode)

    def _drive_ns(self, mono_ns: int) -> int | None:
        """Return our monotonic clock at the vehicle's pace, None in lock step."""
        return None if self._pace is None else round(mono_ns * self._pace)

    def warnings(self, mono_ns: int) -> list[str]:
        """Return what newly went wrong with the telemetry, each thing once.

        Without a clock of ours (lock step) the newest state says what is overdue.
        """
        if self._estimator is None or self.end is not None:
            return []
        warnings = self.watch.estimator(self._estimator)
        now_ns = self._drive_ns(mono_ns)
        if now_ns is not None:
            warnings += self.watch.overdue(self._estimator.overdue(now_ns), now_ns)
        elif self.latest is not None:
            state = self.latest.state
            warnings += self.watch.overdue(state.stale, state.stamp_ns)
        return warnings

    def record(self) -> dict[str, Any]:
        """Return the `telemetry` part of run.json."""
        receiver_utc_ns = time.time_ns() - time.monotonic_ns()
        found = record(self._estimator, self.watch, receiver_utc_ns=receiver_utc_ns)
        state = None if self.latest is None else self.latest.state
        lights = self.signals.record(self.now_stamp_ns, self.start_stamp_ns)
        return {
            **self.counts.record(self.skipped_invalid),
            **found,
            **_position_record(state),
            **({"learnt_lights": lights} if lights else {}),
        }

    @property
    def surroundings(self) -> LatestReports:
        """What the car last said of its plan, of other road users and of lights."""
        learnt = self.signals.learnt(self.now_stamp_ns)
        return LatestReports(self.plan, self.road_users, self.signals.newest, learnt)

    @property
    def start_stamp_ns(self) -> int:
        """The stamp of drive time 0."""
        return self.info.start_stamp_ns if self.info else 0

    @property
    def now_stamp_ns(self) -> int:
        """The stamp of the newest state, the drive's start before the first."""
        return self.latest.state.stamp_ns if self.latest else self.start_stamp_ns

    @property
    def next_stamp_ns(self) -> int:
        """The earliest stamp of the next state; 0, which is none, before the clock is known."""
        return self.now_stamp_ns + 1 if self.info else 0

    @property
    def skipped_invalid(self) -> int:
        """Samples refused so far: by the source's reader, by the estimator, by the codec."""
        by_estimator = sum(self._estimator.skipped.values()) if self._estimator else 0
        return by_estimator + self.refused + (self.end.skipped_invalid if self.end else 0)


def _position_record(state: VehicleState | None) -> dict[str, Any]:
    """Return what gave the position, and how sure of it the newest state is."""
    if state is None:
        nothing = dict.fromkeys(("position_std_m", "yaw_std_rad", "speed_std_mps"))
        return {"position_from": [], **nothing}
    stds = state.position_std_m, state.yaw_std_rad, state.speed_std_mps
    position, yaw, speed = (None if std is None else round(std, 4) for std in stds)
    return {
        "position_from": ["gnss"] if state.map_shift_m is None else ["gnss", "map"],
        "position_std_m": position,
        "yaw_std_rad": yaw,
        "speed_std_mps": speed,
    }


def unannounced(vehicle_id: str, first_stamp_ns: int) -> VehicleInfo:
    """Return what is taken for granted of a live car that does not say what it is."""
    return VehicleInfo(
        vehicle_id=vehicle_id,
        time_base="utc",
        start_stamp_ns=first_stamp_ns,
        source="live telemetry",
        reference_point="antenna",
    )


def unplaced(reference_point: str) -> Notice:
    """Return what is told of a source that does not say where on the car its positions are of."""
    return Notice(
        "warning",
        f"where on the car the positions are of ({reference_point}) is not told: taken as the "
        "middle of its rear axle, by which all of them may be off; body_from_antenna_m in a "
        "declaration, antenna_m in a mapping says it",
    )
