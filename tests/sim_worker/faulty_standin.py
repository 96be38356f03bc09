"""The stand-in car with a fault: wrapped where commands go in and where samples come out.

Faults of the model are parameters given to the monitor; the car is then as it always is.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.drive import (
    ControlCommand,
    ImuSample,
    SpeedSample,
    SteeringSample,
    VehicleInfo,
)
from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.standin.car import STEP_S
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.source import START_STAMP_NS, StandinSource
from tests.sim_worker.driving import altered
from tests.telemetry.standin_drive import FRAME

Sample = tuple[str, Any]
DURATION_S = 32.0


class FaultyDrive(NamedTuple):
    """What a car sent, and what is known of it beforehand."""

    info: VehicleInfo
    samples: list[Sample]

    def with_fault(self, change: Exit) -> FaultyDrive:
        """Return the drive as a car says it whose samples leave it changed."""
        return self._replace(samples=[(name, change(m)) for name, m in self.samples])


def source_of(
    seed: int, *, end_s: float = DURATION_S, steering_delay_s: float | None = None
) -> StandinSource:
    """Return a car on a way with bends to both sides and a stop; the seed varies both."""
    random = np.random.default_rng(seed)
    x, y, yaw = 0.0, 0.0, 0.0
    points = [(x, y)]
    stop = 0
    for turn in range(8):
        radius = random.uniform(13.0, 24.0) * (-1.0) ** (turn + seed)
        for length, curvature in ((random.uniform(12.0, 30.0), 0.0), (18.0, 1.0 / radius)):
            count = round(length)
            step = length / count
            for _ in range(count):
                x += step * math.cos(yaw + 0.5 * step * curvature)
                y += step * math.sin(yaw + 0.5 * step * curvature)
                yaw += step * curvature
                points.append((x, y))
        if turn == 2:
            stop = len(points) - 2
    geo = geo_from_local(FRAME, np.array(points))
    wish = np.full(len(points), random.uniform(8.5, 11.0))
    wish[stop] = 0.0
    parameters = read_parameters()
    if steering_delay_s is not None:
        car = msgspec.structs.replace(parameters.car, steering_delay_s=steering_delay_s)
        parameters = msgspec.structs.replace(parameters, car=car)
    path = DrivenPath(geo[:, 0], geo[:, 1], wish, driver=parameters.driver)
    return StandinSource(path, parameters, vehicle_id="standin", seed=seed, end_s=end_s)


Entry = Callable[[float, float, int], tuple[float, float]]
"""(accel_mps2, steering_wheel_rad, tick) as commanded -> as they reach the car."""
Exit = Callable[[Any], Any]


def _steering_gain(accel: float, wheel: float, tick: int) -> tuple[float, float]:
    return accel, 0.7 * wheel


def _steering_saturated(accel: float, wheel: float, tick: int) -> tuple[float, float]:
    return accel, min(max(wheel, -1.1), 1.1)


def _brake_saturated(accel: float, wheel: float, tick: int) -> tuple[float, float]:
    return max(accel, -0.7), wheel


def _drive_low(accel: float, wheel: float, tick: int) -> tuple[float, float]:
    return (0.55 * accel if accel > 0.0 else accel), wheel


def _brake_fade() -> Entry:
    heat = [0.0]

    def fade(accel: float, wheel: float, tick: int) -> tuple[float, float]:
        heat[0] += max(-accel, 0.0) * STEP_S
        return (accel if accel > 0.0 else accel * max(0.45, 1.0 - 0.5 * heat[0])), wheel

    return fade


def said_as(kind: type, change: Callable[[Any], dict[str, Any]]) -> Exit:
    """Return a fault of one sensor: what `change` gives replaces that of its samples."""

    def told(message: Any) -> Any:
        if not isinstance(message, kind):
            return message
        return msgspec.structs.replace(message, **change(message))

    return told


def gyro_as(scale: float, bias: float) -> Exit:
    """Return the fault of a gyro."""
    return said_as(
        ImuSample,
        lambda m: {"rate_radps": (*m.rate_radps[:2], scale * m.rate_radps[2] + bias)},
    )


ENTRY_FAULTS: dict[str, Callable[[], Entry]] = {
    "steering_gain": lambda: _steering_gain,
    "saturated_steering": lambda: _steering_saturated,
    "saturated_brake": lambda: _brake_saturated,
    "low_drive": lambda: _drive_low,
    "brake_fade": _brake_fade,
}
EXIT_FAULTS: dict[str, Exit] = {
    "steering_read_in_degrees": said_as(
        SteeringSample, lambda m: {"steering_wheel_rad": math.degrees(m.steering_wheel_rad)}
    ),
    # The car takes the number for degrees: a driver who knows sends them, and so it is recorded.
    "steering_commanded_in_degrees": said_as(
        ControlCommand, lambda m: {"steering_wheel_rad": math.degrees(m.steering_wheel_rad)}
    ),
    "steering_sign": said_as(
        ControlCommand, lambda m: {"steering_wheel_rad": -m.steering_wheel_rad}
    ),
    "offset_steering_sensor": said_as(
        SteeringSample, lambda m: {"steering_wheel_rad": m.steering_wheel_rad + 0.5}
    ),
    "offset_gyro": gyro_as(1.0, 0.1),
    "scaled_gyro": gyro_as(0.65, 0.0),
    "scaled_speed": said_as(SpeedSample, lambda m: {"speed_mps": 1.3 * m.speed_mps}),
    "offset_speed": said_as(SpeedSample, lambda m: {"speed_mps": m.speed_mps + 1.5}),
}
CAR_FAULTS = ("slow_steering", *ENTRY_FAULTS, *EXIT_FAULTS)
MODEL_FAULTS: dict[str, dict[str, float]] = {
    "wheelbase": {"wheelbase_m": 3.7, "cog_from_rear_axle_m": 2.0},
    "steering_ratio": {"steering_ratio": 22.0},
    "steering_limit": {"max_tire_angle_rad": 0.08},
    "steering_offset": {"steering_offset_rad": 0.045},
    "inertia": {"yaw_inertia_kgm2": 14000.0},
    "friction": {"friction": 0.12},
    "cornering_stiffness": {"front_cornering_stiffness_npr": 18000.0},
    "drag": {"drag_npv2": 20.0},
    "drive_gain": {"drive_gain": 1.7},
    "brake_gain": {"brake_gain": 0.5},
    "steering_delay": {"steering_delay_s": 0.5},
}


@functools.cache
def drive_of(seed: int, fault: str | None = None, *, end_s: float = DURATION_S) -> FaultyDrive:
    """Return one drive of the car with a fault of CAR_FAULTS, or without; simulated once."""
    if fault in EXIT_FAULTS:
        return drive_of(seed, end_s=end_s).with_fault(EXIT_FAULTS[fault])
    # Its driver knows of the delay: one who did not would leave the road within seconds.
    slow = 0.4 if fault == "slow_steering" else None
    source = source_of(seed, end_s=end_s, steering_delay_s=slow)
    if fault in ENTRY_FAULTS:
        _wrap_entry(source, ENTRY_FAULTS[fault]())
    return FaultyDrive(
        source.info, list(source.advance(START_STAMP_NS + round(end_s * 1e9) + 1_000_000_000))
    )


def _wrap_entry(source: StandinSource, entry: Entry) -> None:
    car = source._car
    whole, ticks = car.step, [0]

    def step(*, accel_mps2: float, steering_wheel_rad: float, grade: float = 0.0) -> None:
        accel, wheel = entry(accel_mps2, steering_wheel_rad, ticks[0])
        ticks[0] += 1
        whole(accel_mps2=accel, steering_wheel_rad=wheel, grade=grade)

    car.step = step  # type: ignore[method-assign]


def model_with(fault: str | None) -> VehicleParameters:
    """Return the twin's parameters with a fault of MODEL_FAULTS, or as they are."""
    return load_vehicle() if fault is None else altered(load_vehicle(), **MODEL_FAULTS[fault])
