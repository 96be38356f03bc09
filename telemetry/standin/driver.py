"""The stand-in's own controller: feed-forward of the path's curvature, and feedback on its errors.

Deliberately another one than the planners under test: the path is followed by its curvature ahead
and by feedback along the distance (offset and heading), the speed by the profile's own slope.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from foretwin.geometry.steering import MAX_CURVATURE_PM
from foretwin.telemetry.logs.units import STANDARD_GRAVITY_MPS2
from foretwin.telemetry.standin.car import MAX_TIRE_RATE_RADPS, CarMotion
from foretwin.telemetry.standin.lights_ahead import LightAhead
from foretwin.telemetry.standin.obstacles import Hindrance
from foretwin.telemetry.standin.parameters import CarParameters, DriverParameters
from foretwin.telemetry.standin.path import DrivenPath

_NEAR_STOP_M = 0.4
_STANDING_MPS = 0.02
_SPEED_GAIN_PS = 1.2
_BEGINS = 0.8
"""Of the comfortable deceleration, from which on it brakes for somebody."""
_CLOSE_M, _CREEPS_MPS = 1.5, 0.8
"""So close behind somebody it does not set off again, or creep on."""
_HURRIED = 1.5
"""Times the sideways acceleration of its bends: what it does not exceed off its path either."""
_STRAIGHT_PM = 1e-4
_TURNED_WITHIN_M, _SLOWEST_MPS = 2.0, 0.5
_BACK_ACROSS = 0.7
"""Sine of the angle at which it comes back to its path from far off."""
_STEERING_LAG_S = 0.09
"""Of the steering motor, which the driver has learnt to anticipate."""


class DriverCommand(NamedTuple):
    """What the driver asks for."""

    accel_mps2: float
    steering_wheel_rad: float


class PlanPoint(NamedTuple):
    """Where the driver means to be: distance along the path and speed."""

    s_m: float
    speed_mps: float


@dataclass(kw_only=True)
class Driver:
    """Drives a path from its beginning, waits at each stop, and is `arrived` after the last."""

    path: DrivenPath
    parameters: DriverParameters
    car: CarParameters
    wheelbase_m: float
    period_s: float
    """Between two `command` calls."""
    s_m: float = 0.0
    """How far along the path the car was at the last command."""
    arrived: bool = False
    held: bool = False
    """Whether it stands, whatever the path says."""
    ahead: Hindrance | None = None
    """Who is in its way now."""
    lights: tuple[LightAhead, ...] = ()
    """Those that let nobody pass."""
    _next_stop: int = 0
    _waited_s: float = 0.0

    def command(self, motion: CarMotion) -> DriverCommand:
        """Return what to ask of the car, and keep track of the stops."""
        self.s_m = self.path.locate(motion.x_m, motion.y_m, near_s_m=self.s_m)
        self._wait(motion.vx_mps)
        curvature = self._curvature_pm(motion)
        accel = self._accel(self.s_m, motion.vx_mps, self._next_stop)
        tire_rad = self._tire_rad(curvature)
        accel = min(accel, self._not_off(curvature, tire_rad, motion))
        if motion.grade and motion.vx_mps > _STANDING_MPS:
            # Whoever drives uphill presses as much harder as it takes to go as on the level.
            accel += STANDARD_GRAVITY_MPS2 * math.sin(math.atan(motion.grade))
        return DriverCommand(
            accel_mps2=accel,
            steering_wheel_rad=tire_rad * self.car.steering_ratio,
        )

    def _wait(self, speed_mps: float) -> None:
        remaining = self.path.stops_m[self._next_stop] - self.s_m
        if speed_mps > _STANDING_MPS or remaining > 1.0:
            return
        self._waited_s += self.period_s
        if self._waited_s < self.parameters.dwell_s:
            return
        if self._next_stop + 1 < len(self.path.stops_m):
            self._next_stop += 1
            self._waited_s = 0.0
        else:
            self.arrived = True

    def _wished_speed(self, s_m: float, stop: int) -> float:
        """Return the speed at a place, braking for stop number `stop`."""
        remaining = self.path.stops_m[stop] - s_m
        profile = self.path.speed_at(s_m)
        braking = math.sqrt(2.0 * self.parameters.comfort_decel_mps2 * max(0.0, remaining))
        return min(profile, braking)

    def _accel(self, s_m: float, speed_mps: float, stop: int) -> float:
        given = self.parameters
        if self.held:
            return -given.comfort_decel_mps2
        if self.path.stops_m[stop] - s_m < _NEAR_STOP_M and speed_mps < 1.2:
            return -1.0 if speed_mps < 0.5 else -given.comfort_decel_mps2
        ahead = s_m + speed_mps * self.car.drive_delay_s
        wished = self._wished_speed(ahead, stop)
        later = self._wished_speed(ahead + 0.5, stop)
        slope = (later * later - wished * wished) / 1.0
        slope = min(max(slope, -given.comfort_decel_mps2), 0.0)
        accel = slope + _SPEED_GAIN_PS * (wished - speed_mps)
        accel = min(accel, self._not_into(s_m, speed_mps), self._not_over(s_m, speed_mps))
        return min(max(accel, -given.max_decel_mps2), given.max_accel_mps2)

    def _not_into(self, s_m: float, speed_mps: float) -> float:
        """Return the most acceleration with which nobody ahead is run into."""
        if self.ahead is None:
            return math.inf
        return self._braked_to(self.ahead.s_m - s_m, self.ahead.speed_mps, speed_mps)

    def _not_over(self, s_m: float, speed_mps: float) -> float:
        """Return the most acceleration with which it stands before every light that it can still
        stand before: at amber in comfort, else as hard as it brakes."""
        given, most = self.parameters, math.inf
        for light in self.lights:
            accel = self._braked_to(light.s_m - s_m, 0.0, speed_mps)
            hardest = given.comfort_decel_mps2 if light.amber else given.max_decel_mps2
            left_m = max(light.s_m - s_m - speed_mps * self.car.drive_delay_s, 0.1)
            if speed_mps * speed_mps <= 2.0 * left_m * hardest:
                most = min(most, accel)
        return most

    def _braked_to(self, left_m: float, to_mps: float, speed_mps: float) -> float:
        """Return the most acceleration with which a speed is reached in so many metres.

        It brakes as soon as comfort asks for it, by as much as it takes, and begins a little
        earlier, to be through with it where it should be.
        """
        left_m -= speed_mps * self.car.drive_delay_s
        faster = speed_mps * abs(speed_mps) - to_mps**2
        if left_m <= 0.1:
            return -self.parameters.max_decel_mps2 if faster > 0.0 else 0.0
        needed = faster / (2.0 * left_m)
        if needed < self.parameters.comfort_decel_mps2 * _BEGINS:
            return math.inf if left_m > _CLOSE_M or speed_mps > _CREEPS_MPS else -1.0
        return -needed

    def _not_off(self, curvature_pm: float, tire_rad: float, motion: CarMotion) -> float:
        """Return the most acceleration with which it turns no harder than it would ever want to,
        and with which the tyres come to where it turns them within some metres.

        On its path that is the profile's part; who has come off it slows down to come back.
        """
        most_mps2 = _HURRIED * self.parameters.lateral_accel_mps2
        fastest = math.sqrt(most_mps2 / max(abs(curvature_pm), _STRAIGHT_PM))
        behind_s = abs(tire_rad - motion.steered_rad) / MAX_TIRE_RATE_RADPS
        fastest = min(fastest, max(_TURNED_WITHIN_M / max(behind_s, 1e-3), _SLOWEST_MPS))
        accel = _SPEED_GAIN_PS * (fastest - motion.vx_mps)
        return max(accel, -self.parameters.comfort_decel_mps2)

    def _curvature_pm(self, motion: CarMotion) -> float:
        """Return the curvature that it would steer for, were there no end to the steering."""
        speed = motion.vx_mps
        here = self.path.at(self.s_m)
        lag_s = self.car.steering_delay_s + _STEERING_LAG_S
        ahead = self.path.at(self.s_m + speed * lag_s)
        offset = math.cos(here.yaw_rad) * (motion.y_m - here.y_m) - math.sin(here.yaw_rad) * (
            motion.x_m - here.x_m
        )
        turned = math.remainder(motion.yaw_rad - here.yaw_rad, math.tau)
        # Offset and heading along the distance obey e'' = κ_asked - κ: critically damped.
        stiffness = min(0.35, 2.0 / max(speed, 1.0))
        # From far off it comes back across its path, and does not turn in circles beside it.
        most = 2.0 * stiffness * _BACK_ACROSS
        back = min(max(stiffness * stiffness * offset, -most), most)
        return ahead.curvature_pm - back - 2.0 * stiffness * math.sin(turned)

    def _tire_rad(self, curvature_pm: float) -> float:
        curvature_pm = min(max(curvature_pm, -MAX_CURVATURE_PM), MAX_CURVATURE_PM)
        return math.atan(self.wheelbase_m * curvature_pm)

    def plan(self, speed_mps: float) -> list[PlanPoint]:
        """Return where the driver means to be at each `plan_step_s` over its horizon, now first."""
        given = self.parameters
        s, speed, stop, waited = self.s_m, max(0.0, speed_mps), self._next_stop, self._waited_s
        points = []
        for _ in range(round(given.plan_horizon_s / given.plan_step_s) + 1):
            points.append(PlanPoint(s, speed))
            accel = self._accel(s, speed, stop)
            faster = max(0.0, speed + accel * given.plan_step_s)
            s = min(s + 0.5 * (speed + faster) * given.plan_step_s, self.path.length_m)
            speed = faster
            if speed == 0.0 and self.path.stops_m[stop] - s < 1.0:
                waited += given.plan_step_s
                if waited >= given.dwell_s and stop + 1 < len(self.path.stops_m):
                    stop, waited = stop + 1, 0.0
        return points
