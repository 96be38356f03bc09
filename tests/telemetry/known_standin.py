"""The stand-in car, of which it is known where it truly is, and whose tyres can be changed."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, geo_from_local, geo_from_local_yaw
from foretwin.geometry.steering import SteeringColumn
from foretwin.telemetry.estimator.measured import Steering
from foretwin.telemetry.standin.car import CarMotion
from foretwin.telemetry.standin.sensors import PERIOD_MS
from foretwin.telemetry.standin.source import START_STAMP_NS, StandinSource

TRUTH_NS = PERIOD_MS["imu"] * 1_000_000


class KnownStandin(StandinSource):
    """Remembers the true motion at every sample of the IMU."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._truth: list[CarMotion] = []

    def _sample(self, channel: str, stamp_ns: int, motion: CarMotion) -> Any:
        if channel == "imu":
            self._truth.append(motion)
        return super()._sample(channel, stamp_ns, motion)

    @property
    def steering(self) -> Steering:
        """What its maker says of it."""
        ratio = self._parameters.car.steering_ratio
        return Steering(self._car.wheelbase_m, SteeringColumn(ratio, offset_rad=0.0))

    def change_tyres(self, *, softness_rad_per_mps2: float = 0.0, stiffness: float = 1.0) -> None:
        """Drive on with softer front tyres, or with another stiffness of all four."""
        self._car.become(
            msgspec.structs.replace(
                self._parameters.car,
                steering_compliance_rad_per_mps2=softness_rad_per_mps2,
                tyre_stiffness=stiffness,
            )
        )

    def truth(self, stamp_ns: int) -> VehicleState:
        """Return the true state of base_link, without noise or lag; linear between 10 ms instants.

        Raises ValueError outside of what has been simulated.
        """
        at = (stamp_ns - START_STAMP_NS) / TRUTH_NS
        index = int(at)
        if not 0 <= at <= len(self._truth) - 1:
            raise ValueError(f"no truth at stamp {stamp_ns}: not simulated")
        before = np.array(self._truth[index])
        after = np.array(self._truth[min(index + 1, len(self._truth) - 1)])
        motion = CarMotion(*(before + (at - index) * (after - before)).tolist())
        xy = np.array([motion.x_m, motion.y_m])
        lat, lon = geo_from_local(self._path.frame, xy)
        return VehicleState(
            vehicle_id=self.info.vehicle_id,
            stamp_ns=stamp_ns,
            position=GeoPoint(float(lat), float(lon)),
            yaw_rad=float(geo_from_local_yaw(self._path.frame, motion.yaw_rad, xy)),
            speed_mps=motion.vx_mps,
            yaw_rate_radps=motion.yaw_rate_radps,
            accel_mps2=motion.accel_x_mps2,
            tire_angle_rad=motion.tire_angle_rad,
        )
