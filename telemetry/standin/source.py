"""The stand-in car as a source of samples: deterministic from its path, parameters and seed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.drive import ControlCommand, VehicleInfo, VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, geo_from_local, geo_from_local_yaw
from foretwin.telemetry.standin.car import STEP_S, CarMotion, MultiBodyCar
from foretwin.telemetry.standin.driver import Driver, DriverCommand
from foretwin.telemetry.standin.parameters import StandinParameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.sensors import SCHEDULE, Sensors, planned_trajectory, status

START_STAMP_NS = 1_767_225_600_000_000_000
"""2026-01-01T00:00:00Z: every stand-in drive begins then, so that its stamps repeat."""
_TICK_NS = round(STEP_S * 1e9)
_CONTROL_TICKS = round(0.020 / STEP_S)
_TRUTH_TICKS = round(0.010 / STEP_S)


class StandinSource:
    """Simulates the car as far as it is asked for; see VehicleSource."""

    def __init__(
        self,
        path: DrivenPath,
        parameters: StandinParameters,
        *,
        vehicle_id: str,
        seed: int = 0,
        end_s: float | None = None,
        plan_shift_m: float = 0.0,
    ) -> None:
        """Place the car at rest at the path's beginning; raises UserError for an end before it."""
        if end_s is not None and not end_s > 0.0:
            raise UserError(f"end {end_s} s must be after the start")
        start = path.at(0.0)
        self._path = path
        self._parameters = parameters
        self._plan_shift_m = plan_shift_m
        self._car = MultiBodyCar(
            parameters.car, x_m=start.x_m, y_m=start.y_m, yaw_rad=start.yaw_rad
        )
        self._driver = Driver(
            path=path,
            parameters=parameters.driver,
            car=parameters.car,
            wheelbase_m=self._car.wheelbase_m,
            period_s=_CONTROL_TICKS * STEP_S,
        )
        self._sensors = Sensors(parameters.sensors, parameters.car, frame=path.frame, seed=seed)
        self._command = DriverCommand(0.0, 0.0)
        self._tick = 0
        self._last_tick = None if end_s is None else round(end_s / STEP_S)
        self._truth: list[CarMotion] = []
        self.first_stamp_ns = START_STAMP_NS
        self.ended = False
        self.skipped_invalid = 0
        self.info = VehicleInfo(
            vehicle_id=vehicle_id,
            time_base="utc",
            start_stamp_ns=START_STAMP_NS,
            end_stamp_ns=None if end_s is None else START_STAMP_NS + round(end_s * 1e9),
            source="stand-in car: CommonRoad multi-body model, BMW 320i",
            reference_point="GNSS antenna",
            body_from_antenna_m=parameters.sensors.body_from_antenna_m,
            sends=tuple(row.channel for row in SCHEDULE),
        )

    @property
    def wheelbase_m(self) -> float:
        """The true wheelbase."""
        return self._car.wheelbase_m

    def advance(self, until_stamp_ns: int) -> Iterator[tuple[str, Any]]:
        """Simulate up to and including the stamp; yield every sample once, in stamp order."""
        while not self.ended and START_STAMP_NS + self._tick * _TICK_NS <= until_stamp_ns:
            stamp_ns = START_STAMP_NS + self._tick * _TICK_NS
            motion = self._car.motion()
            if self._path.altitude_m is not None:
                s_m = self._driver.s_m
                motion = motion._replace(
                    altitude_m=self._path.altitude_at(s_m), grade=self._path.grade_at(s_m)
                )
            if self._tick % _CONTROL_TICKS == 0:
                self._command = self._driver.command(motion)
            if self._tick % _TRUTH_TICKS == 0:
                self._truth.append(motion)
            # Time goes on before samples leave: a caller may stop between two of them.
            due = [
                row.channel
                for row in SCHEDULE
                if self._tick * _TICK_NS % (row.period_ms * 1_000_000) == 0
            ]
            samples = [(channel, self._sample(channel, stamp_ns, motion)) for channel in due]
            self._car.step(
                accel_mps2=self._command.accel_mps2,
                steering_wheel_rad=self._command.steering_wheel_rad,
                grade=motion.grade,
            )
            self.ended = self._driver.arrived or self._tick == self._last_tick
            self._tick += 1
            yield from samples

    def _sample(self, channel: str, stamp_ns: int, motion: CarMotion) -> Any:
        match channel:
            case "control":
                return ControlCommand(
                    stamp_ns=stamp_ns,
                    accel_mps2=self._command.accel_mps2,
                    steering_wheel_rad=self._command.steering_wheel_rad,
                )
            case "plan":
                return planned_trajectory(
                    stamp_ns,
                    self._driver.plan(motion.vx_mps),
                    self._path,
                    step_s=self._parameters.driver.plan_step_s,
                    shift_m=self._plan_shift_m,
                )
            case "status":
                return status(stamp_ns)
            case _:
                return getattr(self._sensors, channel)(stamp_ns, motion)

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
        at = (stamp_ns - START_STAMP_NS) / (_TRUTH_TICKS * _TICK_NS)
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
