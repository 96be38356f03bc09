"""An extended Kalman filter of a car's planar motion in a local frame: arithmetic, no messages.

State: x, y, yaw, speed, acceleration, curvature, and what the sensors have of their own: the
gyro's and the accelerometer's bias, a satellite receiver's wandering error (x, y), the speed
sensor's scale, and the slip of the rear axle; where a map helps, also how far the car drives from
the line that it draws. Turning is a curvature times a speed, so that a car that stands cannot turn,
whatever its positions jitter; and the gyro's bias is learnt for free while it stands.
"""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.steering import MAX_CURVATURE_PM
from foretwin.telemetry.estimator import compiled, motion_noise
from foretwin.telemetry.estimator.filter_state import (
    ACCEL,
    ACCEL_BIAS,
    CURVATURE,
    GNSS_X,
    GNSS_Y,
    GYRO_BIAS,
    SIZE,
    SLIP,
    SPEED,
    SPEED_SCALE,
    YAW,
    X,
    Y,
)
from foretwin.telemetry.estimator.innovations import LineInnovation, PositionInnovation
from foretwin.telemetry.estimator.measured import MOST_SPEED_MPS
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

_MAX_STEP_S = 0.05
_HARDEST_MPS2 = 10.0
"""No car on tyres turns harder (1 g)."""
_STANDING_CURVATURE_PM = 0.1
_UNKNOWN_PLACE_M = 1000.0


class KinematicFilter:
    """Predicts with constant acceleration and curvature, and is corrected by each measurement.

    `mean` (12,) and `covariance` (12, 12) are in SI units, in the order of `filter_state`;
    (13,) and (13, 13) once a map helps.
    The point is base_link. Speed stays at or above zero unless `may_reverse`. What no sensor has
    spoken of yet (receiver's error, scale, slip) has no variance and so no effect.
    """

    def __init__(
        self,
        *,
        xy_m: Array,
        yaw_rad: float,
        speed_mps: float,
        yaw_std_rad: float,
        speed_std_mps: float = 1.0,
    ) -> None:
        self.mean: Array = np.zeros(SIZE)
        self.mean[: CURVATURE + 1] = xy_m[0], xy_m[1], yaw_rad, speed_mps, 0.0, 0.0
        spread = np.zeros(SIZE)
        spread[: CURVATURE + 1] = 0.1, 0.1, yaw_std_rad, speed_std_mps, 1.0, 0.05
        spread[GYRO_BIAS] = motion_noise.GYRO_BIAS_STD_RADPS
        spread[ACCEL_BIAS] = motion_noise.ACCEL_BIAS_STD_MPS2
        self.covariance: Array = np.diag(spread * spread)
        self.may_reverse = speed_mps < 0.0
        self._gnss_std_m = 0.0
        self._slip_density = motion_noise.SLIP_DENSITY
        self.calm = self.steady = 1.0
        """The shares of what a driver can do with pedals and wheel that are expected."""

    def copy(self) -> KinematicFilter:
        """Return another filter that goes on from the same state."""
        other = shallow_copy(self)
        other.mean, other.covariance = self.mean.copy(), self.covariance.copy()
        return other

    @property
    def is_sound(self) -> bool:
        """Whether this is a car's motion, and its spreads are any.

        A sensor that is wrong beyond all noise, such as a yaw rate in degrees, can end both.
        """
        speed = self.mean.item(SPEED)
        return abs(speed) <= MOST_SPEED_MPS and bool(compiled.spreads_are_any(self.covariance))

    @property
    def yaw_rate_radps(self) -> float:
        """Speed times curvature."""
        return self.mean.item(SPEED) * self.mean.item(CURVATURE)

    def predict(self, duration_s: float) -> None:
        """Move the state on by `duration_s`, in steps short enough for the linearisation."""
        steps = max(1, math.ceil(duration_s / _MAX_STEP_S - 1e-3))
        for _ in range(steps):
            self._step(duration_s / steps)

    def _step(self, dt: float) -> None:
        speed = self.mean.item(SPEED)
        densities = motion_noise.densities(
            speed, slip=self._slip_density, calm=self.calm, steady=self.steady
        )
        compiled.predict(
            self.mean, self.covariance, dt, self.may_reverse, densities, self._gnss_std_m
        )

    def correct(self, row: Array, residual: float, std: float) -> LineInnovation:
        """Apply one scalar measurement; return how far it lay off, beside the variance expected.

        `row` is its derivative by the state.
        """
        variance: float = compiled.correct(self.mean, self.covariance, row, residual, std)
        self._limit()
        return LineInnovation(residual, max(variance - std * std, 0.0))

    def _limit(self) -> None:
        mean = self.mean
        speed, curvature = mean.item(SPEED), mean.item(CURVATURE)
        if speed < 0.0 and not self.may_reverse:
            mean[SPEED] = speed = 0.0
        most = min(MAX_CURVATURE_PM, _HARDEST_MPS2 / max(speed * speed, 1.0))
        if abs(curvature) > most:
            mean[CURVATURE] = math.copysign(most, curvature)

    def sensor_xy(self, lever_m: tuple[float, float]) -> Array:
        """Return where a sensor at `lever_m` (forward, left) of base_link is, shape (2,)."""
        forward, left = lever_m
        if forward == left == 0.0:
            return self.mean[:2].copy()
        cos, sin = math.cos(self.mean[YAW]), math.sin(self.mean[YAW])
        offset: Array = np.array([cos * forward - sin * left, sin * forward + cos * left])
        return self.mean[:2] + offset

    def know_gyro_bias(self, bias_radps: float, std_radps: float) -> None:
        """Begin with a gyro's bias that was learnt while the car stood."""
        self.mean[GYRO_BIAS] = bias_radps
        self.covariance[GYRO_BIAS, GYRO_BIAS] = std_radps * std_radps

    def know_road(self) -> None:
        """Begin to tell how far beside a map's line the car drives."""
        if len(self.mean) == SIZE:
            self.mean = np.append(self.mean, 0.0)
            self.covariance = np.pad(self.covariance, (0, 1))

    def way_m(self, duration_s: float) -> Array:
        """Return how far (2,) the car goes in `duration_s`, straight on."""
        course, distance_m = self.mean.item(YAW), self.mean.item(SPEED) * duration_s
        return distance_m * np.array([math.cos(course), math.sin(course)])

    def doubt_position(self, std_m: float) -> None:
        """Make the place unknown within `std_m` and tell it apart from what else is known."""
        self.covariance[:2, :] = 0.0
        self.covariance[:, :2] = 0.0
        self.covariance[X, X] = self.covariance[Y, Y] = std_m * std_m

    def expect_wander(self, std_m: float) -> None:
        """Let positions have an error of `std_m` that stays alike for half a minute."""
        missing = std_m * std_m - self._gnss_std_m**2
        if missing > 0.0:
            self.covariance[GNSS_X, GNSS_X] += missing
            self.covariance[GNSS_Y, GNSS_Y] += missing
        self._gnss_std_m = std_m

    def forget_wander(self) -> None:
        """Begin the receiver's error anew: it has jumped."""
        for index in (GNSS_X, GNSS_Y):
            self._begin_anew(index, 0.0, self._gnss_std_m)

    def position_innovation(
        self, xy_m: Array, lever_m: tuple[float, float], *, wander: bool = False
    ) -> PositionInnovation:
        """Return how a position (2,) of a sensor at `lever_m` differs from the expected one.

        `wander` says that the receiver's own slow error lies on top, as `expect_wander` has it.
        """
        expected = self.sensor_xy(lever_m)
        rows = np.zeros((2, len(self.mean)))
        rows[0, X] = rows[1, Y] = 1.0
        rows[0, YAW], rows[1, YAW] = self.mean[Y] - expected[1], expected[0] - self.mean[X]
        if wander:
            rows[0, GNSS_X] = rows[1, GNSS_Y] = 1.0
            expected = expected + self.mean[GNSS_X : GNSS_Y + 1]
        cross = self.covariance @ rows.T
        (a, b), (_, d) = (rows @ cross).tolist()
        return PositionInnovation(xy_m - expected, cross, a, b, d)

    def correct_position(
        self, innovation: PositionInnovation, std_m: float, *, hold_yaw: bool = False
    ) -> None:
        """Apply a position with white noise of `std_m`, as it differs from the expected one now.

        With `hold_yaw` the yaw stays as it is, and so does what is known of it.
        """
        cross, noise = innovation.cross, std_m * std_m
        a, b, d = innovation.xx_m2 + noise, innovation.xy_m2, innovation.yy_m2 + noise
        gain = cross @ (np.array([[d, -b], [-b, a]]) / (a * d - b * b))
        covariance = self.covariance - gain @ cross.T
        if hold_yaw:
            # Any gain but the best one costs (K - K_best) S (K - K_best)': here in the yaw alone.
            kept = gain[YAW].copy()
            covariance[YAW, YAW] += kept @ cross[YAW]
            gain[YAW] = 0.0
        self.mean = self.mean + gain @ innovation.residual_m
        self.covariance = 0.5 * (covariance + covariance.T)
        self._limit()

    def begin_beside(
        self, xy_m: Array, lever_m: tuple[float, float], *, std_m: float, white_m: float
    ) -> None:
        """Know the place by one position alone, of which all but `white_m` of `std_m` wanders."""
        self.doubt_position(_UNKNOWN_PLACE_M)
        self.expect_wander(std_m)
        self.correct_position(self.position_innovation(xy_m, lever_m, wander=True), white_m)

    def move_position(self, xy_m: Array, std_m: float, lever_m: tuple[float, float]) -> None:
        """Put the sensor at `xy_m` and leave yaw and motion as they are: the source jumped."""
        self.mean[:2] += xy_m - self.sensor_xy(lever_m)
        self.doubt_position(std_m)

    def doubt_motion(self, speed_std_mps: float, accel_std_mps2: float, over_s: float) -> None:
        """Make speed and acceleration less known by so much, as they were for `over_s` already."""
        way = np.zeros(len(self.mean))
        way[X], way[Y] = over_s * math.cos(self.mean[YAW]), over_s * math.sin(self.mean[YAW])
        way[SPEED] = 1.0
        self.covariance += (speed_std_mps * speed_std_mps) * np.outer(way, way)
        self.covariance[ACCEL, ACCEL] += accel_std_mps2 * accel_std_mps2

    def reverse(self, speed_mps: float) -> None:
        """Go backwards from now on, or forwards again: the body points where it pointed."""
        self.may_reverse = speed_mps < 0.0
        self._begin_anew(SPEED, speed_mps, 1.0)
        self._begin_anew(ACCEL, 0.0, 1.0)

    def turn_anew(
        self, yaw_rad: float, yaw_std_rad: float, curvature_pm: float, curvature_std_pm: float
    ) -> None:
        """Face and turn so from now on, whatever was known of it."""
        self._begin_anew(YAW, yaw_rad, yaw_std_rad)
        self._begin_anew(CURVATURE, curvature_pm, curvature_std_pm)
        self._limit()

    def _begin_anew(self, index: int, value: float, std: float) -> None:
        """Forget what is known of one component and of what it hangs together with."""
        self.mean[index] = value
        self.covariance[index, :] = 0.0
        self.covariance[:, index] = 0.0
        self.covariance[index, index] = std * std

    def correct_speed(self, speed_mps: float, std_mps: float) -> LineInnovation:
        """Apply a measured speed, whose scale is estimated; return how far it lay off."""
        if self.covariance.item(SPEED_SCALE, SPEED_SCALE) == 0.0:
            self.covariance[SPEED_SCALE, SPEED_SCALE] = motion_noise.SPEED_SCALE_STD**2
        row = np.zeros(len(self.mean))
        speed, scale = self.mean.item(SPEED), 1.0 + self.mean.item(SPEED_SCALE)
        row[SPEED], row[SPEED_SCALE] = scale, speed
        return self.correct(row, speed_mps - speed * scale, std_mps)

    def correct_yaw(self, yaw_rad: float, std_rad: float) -> LineInnovation:
        """Apply a measured yaw in the local frame; return how far it lay off."""
        row = np.zeros(len(self.mean))
        row[YAW] = 1.0
        return self.correct(row, math.remainder(yaw_rad - self.mean.item(YAW), math.tau), std_rad)

    def know_slip(self) -> None:
        """Tell the body's heading from the path's: a gyro shows how they part."""
        self._slip_density = motion_noise.GYRO_SLIP_DENSITY
        if self.covariance.item(SLIP, SLIP) == 0.0:
            self.mean[SLIP], std = motion_noise.SLIP_RADPMPS2
            self.covariance[SLIP, SLIP] = std * std

    def correct_accel(self, accel_mps2: float, std_mps2: float) -> None:
        """Apply a forward specific force: acceleration plus a slow bias, such as the grade's."""
        row = np.zeros(len(self.mean))
        row[ACCEL] = row[ACCEL_BIAS] = 1.0
        mean = self.mean
        self.correct(row, accel_mps2 - mean.item(ACCEL) - mean.item(ACCEL_BIAS), std_mps2)

    def correct_curvature(self, curvature_pm: float, std_pm: float) -> None:
        """Apply the curvature that the measured steering implies."""
        row = np.zeros(len(self.mean))
        row[CURVATURE] = 1.0
        self.correct(row, curvature_pm - self.mean.item(CURVATURE), std_pm)

    def stand(self, speed_std_mps: float, accel_std_mps2: float) -> None:
        """Apply that the car stands: no speed and no acceleration; yaw stays as it is."""
        row = np.zeros(len(self.mean))
        row[SPEED] = 1.0
        self.correct(row, -self.mean.item(SPEED), speed_std_mps)
        row[SPEED], row[ACCEL] = 0.0, 1.0
        self.correct(row, -self.mean.item(ACCEL), accel_std_mps2)
        # What positions said of the curvature in the last moments before a stop is mostly noise.
        self.correct_curvature(0.0, _STANDING_CURVATURE_PM)
