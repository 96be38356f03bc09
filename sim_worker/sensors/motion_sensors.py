"""What satellite receivers and inertial sensors measure on a car, with errors that wander."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_pose
from foretwin.contracts.point_cloud import base_from_mount, origin_m
from foretwin.contracts.sensed_motion import SensedFix, SensedImu
from foretwin.contracts.sensor_drift import NoisyError
from foretwin.sim_worker.sensors.base_motion import BaseMotion, moved, sensor_motion
from foretwin.sim_worker.sensors.kinds import Gnss, Imu
from foretwin.sim_worker.sensors.sensor_file import SensorFile

GRAVITY_MPS2 = 9.80665
"""Standard gravity, as the stand-in car's."""


class MotionSensor:
    """One sensor, whose error goes on from sample to sample: stamps must not run backwards.

    It measures an estimated state: the error of that is in it too. Raises UserError for a sensor
    of another kind.
    """

    def __init__(self, sensor: SensorFile, *, seed: int | Sequence[int] = 0) -> None:
        self.sensor = sensor
        self._begun_ns: int | None = None
        streams = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(5))
        self._up, *rest = streams
        kind = sensor.kind if isinstance(sensor.kind, Gnss) else sensor.measures(Imu)
        if isinstance(kind, Gnss):
            of_axes = [(kind.std_m, kind.drift, 2)]
        else:
            of_axes = [
                (kind.accel_std_mps2, kind.accel_drift, 3),
                (kind.gyro_std_radps, kind.gyro_drift, 3),
            ]
        self._errors = [
            NoisyError(std, drift, axes, white=rest[2 * k], wandering=rest[2 * k + 1])
            for k, (std, drift, axes) in enumerate(of_axes)
        ]

    def sample(self, state: VehicleState, *, at_ns: int | None = None) -> SensedFix | SensedImu:
        """Return what it measures of a car at a state, or at a stamp near it: led there with steady
        speed and yaw rate."""
        stamp_ns = state.stamp_ns if at_ns is None else at_ns
        kind = self.sensor.kind
        if isinstance(kind, Gnss):
            return self._fix(kind, state, stamp_ns)
        return self._inertial(self.sensor.measures(Imu), state, stamp_ns)

    def _fix(self, gnss: Gnss, state: VehicleState, stamp_ns: int) -> SensedFix:
        frame = LocalFrame(state.position)
        pose = local_pose(frame, state.position, state.yaw_rad)
        motion = BaseMotion(pose, state.speed_mps, state.yaw_rate_radps)
        motion = moved(motion, (stamp_ns - state.stamp_ns) * 1e-9)
        at_m = sensor_motion(motion, self.sensor.mount).at_m
        lat_deg, lon_deg = geo_from_local(frame, at_m[:2] + self._errors[0].at(stamp_ns)).tolist()
        up_m = float(at_m[2] + self._up.normal(0.0, gnss.up_std_m))
        if self._begun_ns is None:
            self._begun_ns = stamp_ns
        walked_s = max(stamp_ns - self._begun_ns, 0) * 1e-9
        walk_m = gnss.drift.walk_per_sqrt_s * math.sqrt(walked_s)
        return SensedFix(
            stamp_ns=stamp_ns,
            position=GeoPoint(lat_deg, lon_deg, state.position.alt_m + up_m),
            std_m=math.hypot(gnss.std_m, gnss.drift.std, walk_m),
            up_std_m=gnss.up_std_m,
            sensor=self.sensor.name,
        )

    def _inertial(self, imu: Imu, state: VehicleState, stamp_ns: int) -> SensedImu:
        """A rigid car on level ground; how its turning changes is not known, and left out."""
        force, rate = _at_lever(state, origin_m(self.sensor.mount))
        sensor_from_base = base_from_mount(self.sensor.mount).T
        accel, gyro = self._errors
        accel_mps2 = sensor_from_base @ force + imu.accel_bias_mps2 + accel.at(stamp_ns)
        rate_radps = sensor_from_base @ rate + imu.gyro_bias_radps + gyro.at(stamp_ns)
        return SensedImu(
            stamp_ns=stamp_ns,
            accel_mps2=tuple(accel_mps2.tolist()),
            rate_radps=tuple(rate_radps.tolist()),
            sensor=self.sensor.name,
        )


def _at_lever(state: VehicleState, lever_m: Array) -> tuple[Array, Array]:
    """Return specific force and rates (3,), (3,) in base_link's axes where a sensor is on the car.

    The rear axle's middle goes where it points: it has `accel_mps2` along and speed times yaw rate
    across; a place beside it has what turning adds, the yaw rate squared towards it.
    """
    turning = state.yaw_rate_radps
    force = np.array(
        [
            state.accel_mps2 - turning**2 * lever_m[0],
            state.speed_mps * turning - turning**2 * lever_m[1],
            GRAVITY_MPS2,
        ]
    )
    return force, np.array([0.0, 0.0, turning])
