"""The stand-in car as a source of samples: deterministic from its path, parameters and seed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from foretwin.contracts.anchor import Anchor
from foretwin.contracts.drive import ControlCommand, RoadUser, VehicleInfo
from foretwin.contracts.errors import UserError
from foretwin.contracts.lights import ShownLights
from foretwin.telemetry.standin.car import STEP_S, CarMotion, MultiBodyCar
from foretwin.telemetry.standin.driver import Driver, DriverCommand
from foretwin.telemetry.standin.lights_ahead import STALE_NS, lights_ahead
from foretwin.telemetry.standin.obstacles import Hindrance, hindrance
from foretwin.telemetry.standin.parameters import StandinParameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.sensors import PERIOD_MS, Sensors, planned_trajectory, status

START_STAMP_NS = 1_767_225_600_000_000_000
"""2026-01-01T00:00:00Z: every stand-in drive begins then, so that its stamps repeat."""
_TICK_NS = round(STEP_S * 1e9)
_CONTROL_TICKS = round(0.020 / STEP_S)
_PERIOD_NS = {channel: period_ms * 1_000_000 for channel, period_ms in PERIOD_MS.items()}
_SOONEST_NS = math.gcd(*_PERIOD_NS.values())


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
        anchor: Anchor | None = None,
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
        self._users: tuple[RoadUser, ...] = ()
        self._seen_ns = START_STAMP_NS
        self._known_for_s: Sequence[float] = ()
        self._anchor, self._lights = anchor, ShownLights(stamp_ns=0, world_id=None)
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
            sends=tuple(PERIOD_MS),
        )

    def see(
        self, users: tuple[RoadUser, ...], *, stamp_ns: int, known_for_s: Sequence[float] = ()
    ) -> None:
        """Take who is there at a stamp: the driver brakes for whom it finds in its way, and forgets
        each of them `known_for_s` after it, where that is given."""
        self._users, self._seen_ns = users, stamp_ns
        self._known_for_s = known_for_s or (math.inf,) * len(users)

    def heed(self, lights: ShownLights) -> None:
        """Take what lights of the World show: the driver stands before those that let nobody pass,
        until other word comes, or none for a second."""
        self._lights = lights

    def hold(self, held: bool) -> None:
        """Let the driver stand, or go on."""
        self._driver.held = held

    @property
    def next_stamp_ns(self) -> int:
        """When the next sample is due."""
        return START_STAMP_NS - (-self._tick * _TICK_NS // _SOONEST_NS) * _SOONEST_NS

    @property
    def ahead(self) -> Hindrance | None:
        """Who is in the way now."""
        return self._driver.ahead

    @property
    def brakes(self) -> bool:
        """Whether the driver brakes for who is in the way, comfortably or harder."""
        least_mps2 = 0.5 * self._parameters.driver.comfort_decel_mps2
        return self.ahead is not None and self._command.accel_mps2 <= -least_mps2

    @property
    def s_m(self) -> float:
        """How far along the path the car is."""
        return self._driver.s_m

    @property
    def speed_mps(self) -> float:
        """How fast the car is."""
        return self._car.motion().vx_mps

    def advance(self, until_stamp_ns: int) -> Iterator[tuple[str, Any]]:
        """Simulate up to and including the stamp; yield every sample once, in stamp order."""
        until_ns = until_stamp_ns - START_STAMP_NS
        while not self.ended and (elapsed_ns := self._tick * _TICK_NS) <= until_ns:
            stamp_ns = START_STAMP_NS + elapsed_ns
            motion = self._car.motion()
            if self._path.altitude_m is not None:
                s_m = self._driver.s_m
                motion = motion._replace(
                    altitude_m=self._path.altitude_at(s_m), grade=self._path.grade_at(s_m)
                )
            if self._tick % _CONTROL_TICKS == 0:
                age_s = (stamp_ns - self._seen_ns) * 1e-9
                left = zip(self._users, self._known_for_s, strict=True)
                users = [user for user, known_s in left if age_s <= known_s]
                self._driver.ahead = hindrance(self._path, self._driver.s_m, users, age_s=age_s)
                fresh = stamp_ns - self._lights.stamp_ns <= STALE_NS
                self._driver.lights = (
                    lights_ahead(self._path, self._driver.s_m, self._lights, anchor=self._anchor)
                    if fresh
                    else ()
                )
                self._command = self._driver.command(motion)
            # Time goes on before samples leave: a caller may stop between two of them.
            due = [
                channel for channel, period_ns in _PERIOD_NS.items() if elapsed_ns % period_ns == 0
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
