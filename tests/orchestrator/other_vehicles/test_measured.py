"""Samples of a vehicle beside the car become states of it, which say who drives it."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.drive import (
    ControlCommand,
    ControlMode,
    GnssFix,
    SpeedSample,
    VehicleInfo,
    VehicleStatus,
)
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.contracts.roles import OtherVehicle
from foretwin.orchestrator.other_vehicles.measured import OtherVehicleStates
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.estimator.estimator import estimator_of

FRAME = LocalFrame(GeoPoint(52.5, 13.4))


def van() -> OtherVehicleStates:
    info = VehicleInfo(vehicle_id="van", time_base="utc", start_stamp_ns=0)
    return OtherVehicleStates("van", estimator_of(info, load_vehicle()))


def driven_on(states: OtherVehicleStates, *, from_s: float, to_s: float) -> list[OtherVehicle]:
    """Let it drive east at 10 m/s, told to brake at each fix."""
    found = []
    for k in range(round(10 * from_s), round(10 * to_s)):
        ns = k * 100_000_000
        lat, lon = geo_from_local(FRAME, np.array([1.0 * k, 0.0])).tolist()
        for channel, message in (
            ("control", ControlCommand(stamp_ns=ns, accel_mps2=-1.0, tire_angle_rad=0.0)),
            ("speed", SpeedSample(stamp_ns=ns, speed_mps=10.0)),
            ("gnss", GnssFix(stamp_ns=ns, position=GeoPoint(lat, lon))),
        ):
            found.append(states.take(channel, message))
    return [one for one in found if one is not None]


def test_states_say_who_drives() -> None:
    states = van()
    said: tuple[ControlMode | None, ...] = (None, "manual", "autonomous")
    for second, mode in enumerate(said):
        if mode is not None:
            status = VehicleStatus(stamp_ns=second * 1_000_000_000, control_mode=mode)
            states.take("status", status)
        found = driven_on(states, from_s=second, to_s=second + 1.0)
        assert {one.state.control_mode for one in found} == {mode or "unknown"}


def test_each_state_brings_what_was_told_since_the_one_before() -> None:
    found = driven_on(van(), from_s=0.0, to_s=3.0)
    assert {one.state.vehicle_id for one in found} == {"van"}
    told_ns = [command.stamp_ns for one in found for command in one.commands]
    assert told_ns == sorted(set(told_ns))
    assert told_ns[-1] == found[-1].state.stamp_ns
