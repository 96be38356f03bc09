"""CommonRoad's multi-body car (BMW 320i) with actuators, from standstill on.

Althoff, Würsching (2020), CommonRoad: Vehicle Models. The model's point is the centre of gravity;
everything that leaves this module is of base_link, the rear-axle centre.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

from foretwin.geometry.steering import SteeringColumn
from foretwin.telemetry.standin.multi_body_steps import car_numbers, runge_kutta
from foretwin.telemetry.standin.parameters import CarParameters

STEP_S = 0.005
"""One Runge-Kutta step of a fast car; samples fall on its multiples."""
_STEPS_BELOW_FAST, _FAST_MPS = 2, 8.0
"""Slip and wheel spin die away the faster the slower the car: below, two half steps."""
_SLOW_MPS = 0.8
_ROLLING_MPS = 1.0
MAX_TIRE_RATE_RADPS = 0.4
_GRAVITY_MPS2 = 9.81
_COMPLIANCE_LAG_S = 0.02
"""With which a column that gives springs back."""
_MAX_TIRE_ANGLE_RAD = 0.6
_X, _Y, _ANGLE, _VX, _YAW, _YAW_RATE, _VY = 0, 1, 2, 3, 4, 5, 10


class CarMotion(NamedTuple):
    """The true motion of base_link in the local frame; velocities in body axes."""

    x_m: float
    y_m: float
    yaw_rad: float
    vx_mps: float
    vy_mps: float
    yaw_rate_radps: float
    tire_angle_rad: float
    accel_x_mps2: float
    """Forward acceleration of the centre of gravity, as an accelerometer on level ground reads."""
    accel_y_mps2: float
    steered_rad: float
    """The tyre angle that the steering wheel stands for: more than the true one if it gives."""
    altitude_m: float = 0.0
    grade: float = 0.0
    """Rise over run of the road underneath."""


class MultiBodyCar:
    """Integrates one car; `step` takes what the driver asks for and applies it with delay and gain.

    The tyres' slip is divided by the speed, so below 0.8 m/s (above 1 m/s when speeding up) the
    wheels roll without slip instead: the kinematic bicycle.
    """

    def __init__(
        self,
        parameters: CarParameters,
        *,
        x_m: float,
        y_m: float,
        yaw_rad: float,
        speed_mps: float = 0.0,
    ) -> None:
        """Place base_link at (x_m, y_m)."""
        self._parameters = parameters
        self._model = parameters_vehicle2()
        self._own_stiffness: float = self._model.tire.p_ky1
        self._cog_m = self._model.b
        self.wheelbase_m: float = self._model.a + self._model.b
        self._state = [0.0] * 29
        self._accel = (0.0, 0.0)
        self._gives = False
        self._steered_rad = 0.0
        self._steering_queue = [0.0] * max(1, round(parameters.steering_delay_s / STEP_S))
        self._drive_queue = [0.0] * max(1, round(parameters.drive_delay_s / STEP_S))
        self._tick = 0
        self._multi_body = speed_mps > _ROLLING_MPS
        self._place(
            x_m + self._cog_m * math.cos(yaw_rad),
            y_m + self._cog_m * math.sin(yaw_rad),
            yaw_rad,
            speed_mps,
            0.0,
        )
        self.become(parameters)

    def become(self, parameters: CarParameters) -> None:
        """Go on as a car of other parameters, as after a change of tyres; delays stay."""
        if not self._gives:
            self._steered_rad = self._state[_ANGLE]
        self._parameters = parameters
        self._column = SteeringColumn(parameters.steering_ratio, parameters.steering_offset_rad)
        self._gives = parameters.steering_compliance_rad_per_mps2 != 0.0
        self._model.tire.p_ky1 = self._own_stiffness * parameters.tyre_stiffness
        self._numbers = car_numbers(self._model)

    def _place(self, x: float, y: float, yaw: float, speed: float, angle: float) -> None:
        """Put the centre of gravity at (x, y), rolling; `speed` is the rear axle's."""
        yaw_rate = speed * math.tan(angle) / self.wheelbase_m
        slip = math.atan(self._cog_m * math.tan(angle) / self.wheelbase_m)
        core = [x, y, angle, speed / math.cos(slip), yaw, yaw_rate, slip]
        self._state = [float(value) for value in init_mb(core, self._model)]

    def motion(self) -> CarMotion:
        """Return the true motion of base_link."""
        state = self._state
        yaw = state[_YAW]
        return CarMotion(
            x_m=state[_X] - self._cog_m * math.cos(yaw),
            y_m=state[_Y] - self._cog_m * math.sin(yaw),
            yaw_rad=yaw,
            vx_mps=state[_VX],
            vy_mps=state[_VY] - self._cog_m * state[_YAW_RATE],
            yaw_rate_radps=state[_YAW_RATE],
            tire_angle_rad=state[_ANGLE],
            accel_x_mps2=self._accel[0],
            accel_y_mps2=self._accel[1],
            steered_rad=self._steered_rad if self._gives else state[_ANGLE],
        )

    def step(self, *, accel_mps2: float, steering_wheel_rad: float, grade: float = 0.0) -> None:
        """Go on by STEP_S with the demanded acceleration and steering-wheel angle."""
        slot = self._tick % len(self._steering_queue)
        wheel, self._steering_queue[slot] = self._steering_queue[slot], steering_wheel_rad
        slot = self._tick % len(self._drive_queue)
        demanded, self._drive_queue[slot] = self._drive_queue[slot], accel_mps2
        self._tick += 1
        given, state = self._parameters, self._state
        target = self._column.tire_rad(wheel)
        target = min(max(target, -_MAX_TIRE_ANGLE_RAD), _MAX_TIRE_ANGLE_RAD)
        steered = self._steered_rad if self._gives else state[_ANGLE]
        rate = given.steering_gain_ps * (target - steered)
        rate = min(max(rate, -MAX_TIRE_RATE_RADPS), MAX_TIRE_RATE_RADPS)
        if self._gives:
            self._steered_rad = steered + rate * STEP_S
            wanted = self._steered_rad - given.steering_compliance_rad_per_mps2 * self._accel[1]
            rate = (wanted - state[_ANGLE]) / _COMPLIANCE_LAG_S
        speed = state[_VX]
        accel = demanded * (given.drive_gain if demanded > 0.0 else given.brake_gain)
        if speed > 0.05:
            drag = given.drag_npv2 * speed * speed + given.rolling_resistance_n
            accel -= drag / self._model.m
            accel -= _GRAVITY_MPS2 * math.sin(math.atan(grade))
        before = (state[_VX], state[_VY], state[_YAW_RATE])
        if self._multi_body and speed < _SLOW_MPS:
            self._multi_body = False
        elif not self._multi_body and speed > _ROLLING_MPS:
            self._multi_body = True
        if self._multi_body:
            self._step_multi_body(rate, accel)
        else:
            self._step_rolling(rate, accel)
        after = self._state
        spin = after[_YAW_RATE]
        self._accel = (
            (after[_VX] - before[0]) / STEP_S - spin * after[_VY],
            (after[_VY] - before[1]) / STEP_S + spin * after[_VX],
        )

    def _step_multi_body(self, rate: float, accel: float) -> None:
        state = np.array(self._state)
        steps = 1 if state[_VX] > _FAST_MPS else _STEPS_BELOW_FAST
        runge_kutta(state, rate, accel, steps, STEP_S / steps, *self._numbers)
        if not np.isfinite(state).all():
            raise ArithmeticError("the stand-in's multi-body model diverged")
        self._state = state.tolist()

    def _step_rolling(self, rate: float, accel: float) -> None:
        motion = self.motion()
        speed = max(0.0, motion.vx_mps + accel * STEP_S)
        # A tyre that stands is turned by the same motor as one that rolls.
        angle = motion.tire_angle_rad + rate * STEP_S
        distance = 0.5 * (motion.vx_mps + speed) * STEP_S
        turn = distance * math.tan(angle) / self.wheelbase_m
        yaw = motion.yaw_rad + turn
        middle = motion.yaw_rad + 0.5 * turn
        x = motion.x_m + distance * math.cos(middle)
        y = motion.y_m + distance * math.sin(middle)
        self._place(
            x + self._cog_m * math.cos(yaw), y + self._cog_m * math.sin(yaw), yaw, speed, angle
        )
