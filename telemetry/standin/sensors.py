"""What the stand-in car sends: its sensors' samples with noise, its commands, plan and status."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.drive import (
    GnssFix,
    ImuSample,
    PlannedTrajectory,
    SpeedSample,
    SteeringSample,
    VehicleStatus,
)
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, geo_from_local_yaw
from foretwin.contracts.sensor_drift import NoisyError
from foretwin.geometry.polyline import interpolated, left_of
from foretwin.geometry.steering import SteeringColumn
from foretwin.telemetry.logs.units import STANDARD_GRAVITY_MPS2
from foretwin.telemetry.standin.car import CarMotion
from foretwin.telemetry.standin.driver import PlanPoint
from foretwin.telemetry.standin.parameters import CarParameters, SensorParameters
from foretwin.telemetry.standin.path import DrivenPath

PERIOD_MS = {
    "speed": 20,
    "imu": 10,
    "steering": 20,
    "control": 20,
    "status": 100,
    "plan": 100,
    "gnss": 100,
}
"""By channel, in the order of publishing at one stamp."""


class Sensors:
    """Turns the true motion into samples; each sensor has a random stream of its own."""

    def __init__(
        self, parameters: SensorParameters, car: CarParameters, *, frame: LocalFrame, seed: int
    ) -> None:
        self._parameters = parameters
        self._car = car
        self._frame = frame
        streams = [*map(np.random.default_rng, np.random.SeedSequence(seed).spawn(8))]
        self._gnss, self._imu, self._speed, self._steering, self._height = streams[:5]
        self._gnss_error, self._gyro_error, self._accel_error = (
            NoisyError(std, drift, axes, white=white, wandering=wandering)
            for std, drift, axes, white, wandering in (
                (parameters.gnss_std_m, parameters.gnss_drift, 2, self._gnss, streams[5]),
                (parameters.gyro_std_radps, parameters.gyro_drift, 3, self._imu, streams[6]),
                (parameters.accel_std_mps2, parameters.accel_drift, 3, self._imu, streams[7]),
            )
        )

    def gnss(self, stamp_ns: int, motion: CarMotion) -> GnssFix:
        """Return the antenna's position with noise and drift; it says its white noise alone."""
        forward, left, up = self._parameters.body_from_antenna_m
        cos, sin = math.cos(motion.yaw_rad), math.sin(motion.yaw_rad)
        x_m = motion.x_m + cos * forward - sin * left
        y_m = motion.y_m + sin * forward + cos * left
        std = self._parameters.gnss_std_m
        error_m = self._gnss_error.at(stamp_ns)
        lat, lon = geo_from_local(self._frame, np.array([x_m, y_m]) + error_m)
        height = up
        if motion.altitude_m:
            # Receivers know their height about half as well as their place.
            height += motion.altitude_m + float(self._height.normal(0.0, 2.0 * std))
        place = GeoPoint(float(lat), float(lon), height)
        return GnssFix(stamp_ns=stamp_ns, position=place, std_m=std)

    def imu(self, stamp_ns: int, motion: CarMotion) -> ImuSample:
        """Return specific force and rates at the centre of gravity, with bias and drifts."""
        given = self._parameters
        force, rate = self._accel_error.at(stamp_ns), self._gyro_error.at(stamp_ns)
        return ImuSample(
            stamp_ns=stamp_ns,
            accel_mps2=(
                motion.accel_x_mps2
                + STANDARD_GRAVITY_MPS2 * math.sin(math.atan(motion.grade))
                + float(force[0]),
                motion.accel_y_mps2 + float(force[1]),
                STANDARD_GRAVITY_MPS2 + float(force[2]),
            ),
            rate_radps=(
                float(rate[0]),
                float(rate[1]),
                motion.yaw_rate_radps + given.gyro_bias_radps + float(rate[2]),
            ),
        )

    def speed(self, stamp_ns: int, motion: CarMotion) -> SpeedSample:
        """Return the rear wheels' speed; wheels that stand give exactly 0, without noise."""
        noise = float(self._speed.normal(0.0, self._parameters.speed_std_mps))
        moving = motion.vx_mps > 0.02
        return SpeedSample(
            stamp_ns=stamp_ns, speed_mps=max(0.0, motion.vx_mps + noise) if moving else 0.0
        )

    def steering(self, stamp_ns: int, motion: CarMotion) -> SteeringSample:
        """Return the angle at the steering wheel, as the car's bus would."""
        noise = float(self._steering.normal(0.0, self._parameters.steering_wheel_std_rad))
        column = SteeringColumn(self._car.steering_ratio, self._car.steering_offset_rad)
        wheel = column.wheel_rad(motion.steered_rad)
        return SteeringSample(stamp_ns=stamp_ns, steering_wheel_rad=wheel + noise)


def status(stamp_ns: int) -> VehicleStatus:
    """Return that the car drives itself, in gear."""
    return VehicleStatus(stamp_ns=stamp_ns, control_mode="autonomous", gear="drive")


def planned_trajectory(
    stamp_ns: int, points: list[PlanPoint], path: DrivenPath, *, step_s: float, shift_m: float
) -> PlannedTrajectory:
    """Return the driver's plan on its path, moved by `shift_m` to the left."""
    s = np.array([point.s_m for point in points])
    yaw = np.interp(s, path.s_m, path.yaw_rad)
    aside = left_of(np.stack([np.cos(yaw), np.sin(yaw)], axis=1))
    xy = interpolated(s, path.s_m, path.xy_m) + shift_m * aside
    geo = geo_from_local(path.frame, xy)
    return PlannedTrajectory(
        stamp_ns=stamp_ns,
        time_from_stamp_s=np.arange(len(points), dtype=np.float64) * step_s,
        lat_deg=geo[:, 0],
        lon_deg=geo[:, 1],
        yaw_rad=geo_from_local_yaw(path.frame, yaw, xy),
        speed_mps=np.array([point.speed_mps for point in points]),
    )
