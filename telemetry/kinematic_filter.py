"""An extended Kalman filter of a car's planar motion in a local frame: arithmetic, no messages.

State: x, y, yaw, speed, acceleration, curvature, gyro bias, accelerometer bias. Turning is a
curvature times a speed, so that a car that stands cannot turn, whatever its positions jitter; and
the gyro's bias is learnt for free while it stands.
"""

from __future__ import annotations

import math

import numpy as np

from contracts.arrays import Array

X, Y, YAW, SPEED, ACCEL, CURVATURE, GYRO_BIAS, ACCEL_BIAS = range(8)

MAX_CURVATURE_PM = 0.25
"""A turning circle of 8 m across: tighter than any passenger car's."""
_MAX_STEP_S = 0.05
_DRIFT_M = 0.03
_STANDING_CURVATURE_PM = 0.1
_LEAST_TURN_RAD = 0.002
_KNOWN_YAW_VAR = 0.15**2
_JERK_DENSITY = 4.0**2
"""(m/s³)² s: acceleration wanders by 4 m/s² in one second."""
_CURVATURE_RATE_PMPS = 0.25
"""Of a fast turn of the wheel at walking speed; less would make the yaw rate lag by over 0.2 s."""
_LATERAL_JERK_MPS3 = 5.0
"""Limits how fast the curvature changes at speed: v² dκ/dt."""
_SLIP_DENSITY = 0.01**2
"""rad² / s: the body's direction differs from the path's by the rear tyres' slip."""
_IDENTITY = np.eye(8)


class KinematicFilter:
    """Predicts with constant acceleration and curvature, and is corrected by each measurement.

    `mean` (8,) and `covariance` (8, 8) are in SI units, in the order of the module's indices. The
    point is base_link. Speed stays at or above zero unless `may_reverse`.
    """

    def __init__(
        self, *, xy_m: Array, yaw_rad: float, speed_mps: float, yaw_std_rad: float
    ) -> None:
        self.mean: Array = np.array([xy_m[0], xy_m[1], yaw_rad, speed_mps, 0.0, 0.0, 0.0, 0.0])
        self.covariance: Array = np.diag([0.1, 0.1, yaw_std_rad, 1.0, 1.0, 0.05, 0.01, 0.1]) ** 2
        self.may_reverse = speed_mps < 0.0

    @property
    def yaw_rate_radps(self) -> float:
        """Speed times curvature."""
        return float(self.mean[SPEED] * self.mean[CURVATURE])

    def predict(self, duration_s: float) -> None:
        """Move the state on by `duration_s`, in steps short enough for the linearisation."""
        steps = max(1, math.ceil(duration_s / _MAX_STEP_S - 1e-9))
        for _ in range(steps):
            self._step(duration_s / steps)

    def _step(self, dt: float) -> None:
        x, y, yaw, speed, accel, curvature, gyro_bias, accel_bias = self.mean.tolist()
        if not self.may_reverse and speed + accel * dt < 0.0:
            accel = min(0.0, -speed / dt)  # it stops within the step
        distance = (speed + 0.5 * accel * dt) * dt
        heading = yaw + 0.5 * curvature * distance
        cos, sin = math.cos(heading), math.sin(heading)
        jacobian = _IDENTITY.copy()
        half = 0.5 * dt * dt
        side = 0.5 * distance * curvature
        jacobian[X, YAW] = -distance * sin
        jacobian[Y, YAW] = distance * cos
        jacobian[X, SPEED] = dt * (cos - side * sin)
        jacobian[Y, SPEED] = dt * (sin + side * cos)
        jacobian[X, ACCEL] = half * (cos - side * sin)
        jacobian[Y, ACCEL] = half * (sin + side * cos)
        jacobian[X, CURVATURE] = -0.5 * distance * distance * sin
        jacobian[Y, CURVATURE] = 0.5 * distance * distance * cos
        jacobian[YAW, SPEED] = curvature * dt
        jacobian[YAW, ACCEL] = curvature * half
        jacobian[YAW, CURVATURE] = distance
        jacobian[SPEED, ACCEL] = dt
        self.mean = np.array(
            [
                x + distance * cos,
                y + distance * sin,
                yaw + curvature * distance,
                speed + accel * dt,
                accel,
                curvature,
                gyro_bias,
                accel_bias,
            ]
        )
        turning = min(_CURVATURE_RATE_PMPS, _LATERAL_JERK_MPS3 / max(speed * speed, 1e-6))
        covariance = jacobian @ self.covariance @ jacobian.T
        covariance[YAW, YAW] += _SLIP_DENSITY * min(1.0, abs(speed) / 10.0) * dt
        covariance[ACCEL, ACCEL] += _JERK_DENSITY * dt
        covariance[CURVATURE, CURVATURE] += turning * turning * dt
        covariance[GYRO_BIAS, GYRO_BIAS] += 1e-4**2 * dt
        covariance[ACCEL_BIAS, ACCEL_BIAS] += 0.02**2 * dt
        self.covariance = covariance

    def correct(self, row: Array, residual: float, std: float) -> None:
        """Apply one scalar measurement: `row` (8,) is its derivative by the state."""
        gain = self.covariance @ row
        gain = gain / (float(row @ gain) + std * std)
        self.mean = self.mean + gain * residual
        covariance = self.covariance - gain[:, None] * (row @ self.covariance)
        self.covariance = 0.5 * (covariance + covariance.T)
        self._limit()

    def _limit(self) -> None:
        if not self.may_reverse and self.mean[SPEED] < 0.0:
            self.mean[SPEED] = 0.0
        self.mean[CURVATURE] = min(max(self.mean[CURVATURE], -MAX_CURVATURE_PM), MAX_CURVATURE_PM)

    def sensor_xy(self, lever_m: tuple[float, float]) -> Array:
        """Return where a sensor at `lever_m` (forward, left) of base_link is, shape (2,)."""
        cos, sin = math.cos(self.mean[YAW]), math.sin(self.mean[YAW])
        forward, left = lever_m
        offset: Array = np.array([cos * forward - sin * left, sin * forward + cos * left])
        return self.mean[:2] + offset

    def position_spread_m(self, std_m: float) -> float:
        """Return one standard deviation of the distance between prediction and measurement."""
        return math.sqrt(self.covariance[X, X] + self.covariance[Y, Y] + 2.0 * std_m * std_m)

    def correct_position(self, xy_m: Array, std_m: float, lever_m: tuple[float, float]) -> None:
        """Apply a position (2,) of a sensor at `lever_m`."""
        offset = self.sensor_xy(lever_m) - self.mean[:2]
        rows = np.zeros((2, 8))
        rows[0, X] = rows[1, Y] = 1.0
        rows[0, YAW], rows[1, YAW] = -offset[1], offset[0]
        cross = self.covariance @ rows.T
        spread = rows @ cross + std_m * std_m * np.eye(2)
        gain = np.linalg.solve(spread, cross.T).T
        self.mean = self.mean + gain @ (xy_m - self.mean[:2] - offset)
        covariance = self.covariance - gain @ cross.T
        self.covariance = 0.5 * (covariance + covariance.T)
        self._limit()

    def move_position(self, xy_m: Array, std_m: float, lever_m: tuple[float, float]) -> None:
        """Put the sensor at `xy_m` and leave yaw and motion as they are: the source jumped."""
        self.mean[:2] += xy_m - self.sensor_xy(lever_m)
        self.covariance[:2, :] = 0.0
        self.covariance[:, :2] = 0.0
        self.covariance[X, X] = self.covariance[Y, Y] = std_m * std_m

    def drift_sideways(self, xy_m: Array, std_m: float, lever_m: tuple[float, float]) -> None:
        """Take a step across the car as the receiver's own: a car that creeps cannot go there."""
        cos, sin = math.cos(self.mean[YAW]), math.sin(self.mean[YAW])
        step = xy_m - self.sensor_xy(lever_m)
        along, across = cos * step[0] + sin * step[1], -sin * step[0] + cos * step[1]
        if abs(across) > max(abs(along), _DRIFT_M) and self.covariance[YAW, YAW] < _KNOWN_YAW_VAR:
            sideways: Array = across * np.array([-sin, cos])
            self.move_position(self.sensor_xy(lever_m) + sideways, std_m, lever_m)

    def limit_turn(self, yaw_before_rad: float, *, moved_m: float) -> None:
        """Undo what a correction turned beyond the tightest bend over `moved_m`.

        Positions that shift under a car that hardly moves must not turn it round.
        """
        if self.covariance[YAW, YAW] > _KNOWN_YAW_VAR:
            return
        reach = MAX_CURVATURE_PM * moved_m + _LEAST_TURN_RAD
        change = math.remainder(self.mean[YAW] - yaw_before_rad, math.tau)
        self.mean[YAW] = yaw_before_rad + min(max(change, -reach), reach)

    def correct_speed(self, speed_mps: float, std_mps: float) -> None:
        """Apply a measured speed."""
        row = np.zeros(8)
        row[SPEED] = 1.0
        self.correct(row, speed_mps - self.mean[SPEED], std_mps)

    def correct_yaw(self, yaw_rad: float, std_rad: float) -> None:
        """Apply a measured yaw in the local frame."""
        row = np.zeros(8)
        row[YAW] = 1.0
        self.correct(row, math.remainder(yaw_rad - self.mean[YAW], math.tau), std_rad)

    def correct_yaw_rate(self, rate_radps: float, std_radps: float, *, biased: bool) -> None:
        """Apply a measured yaw rate; `biased` for a gyro, whose bias is estimated."""
        row = np.zeros(8)
        row[SPEED], row[CURVATURE] = self.mean[CURVATURE], self.mean[SPEED]
        expected = self.yaw_rate_radps
        if biased:
            row[GYRO_BIAS] = 1.0
            expected += self.mean[GYRO_BIAS]
        self.correct(row, rate_radps - expected, std_radps)

    def correct_accel(self, accel_mps2: float, std_mps2: float) -> None:
        """Apply a forward specific force: acceleration plus a slow bias, such as the grade's."""
        row = np.zeros(8)
        row[ACCEL] = row[ACCEL_BIAS] = 1.0
        self.correct(
            row, accel_mps2 - self.mean[ACCEL] - self.mean[ACCEL_BIAS], std_mps2
        )  # fmt: skip

    def correct_curvature(self, curvature_pm: float, std_pm: float) -> None:
        """Apply the curvature that the measured steering implies."""
        row = np.zeros(8)
        row[CURVATURE] = 1.0
        self.correct(row, curvature_pm - self.mean[CURVATURE], std_pm)

    def stand(self) -> None:
        """Apply that the car stands: no speed and no acceleration; yaw stays as it is."""
        row = np.zeros(8)
        row[SPEED] = 1.0
        self.correct(row, -self.mean[SPEED], 0.01)
        row[SPEED], row[ACCEL] = 0.0, 1.0
        self.correct(row, -self.mean[ACCEL], 0.05)
        # What positions said of the curvature in the last moments before a stop is mostly noise.
        self.correct_curvature(0.0, _STANDING_CURVATURE_PM)
