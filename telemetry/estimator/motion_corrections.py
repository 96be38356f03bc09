"""Corrects the filter with what is measured beside positions: speed, inertia, heading, steering."""

from __future__ import annotations

import math
from typing import Any

from foretwin.contracts.drive import HeadingSample, ImuSample, SpeedSample, SteeringSample
from foretwin.telemetry.estimator.gyro import Gyro
from foretwin.telemetry.estimator.innovations import LINE_95, SurpriseCount
from foretwin.telemetry.estimator.kinematic_filter import SPEED, YAW, KinematicFilter
from foretwin.telemetry.estimator.measured import Doubt, MotionSamples
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

STANDING_MPS = 0.05
"""Below this measured speed a car stands."""
STOPPING_MPS = 1.0
"""A car that has been faster a moment ago does not stand, whatever one sample says. Chosen."""


class MotionCorrections:
    """Gives each kind of sample its weight; speeds and headings lose theirs as they surprise."""

    def __init__(self, measured: MotionSamples, *, wheelbase_m: float) -> None:
        self._measured = measured
        self._wheelbase_m = wheelbase_m
        self._speed_doubt = Doubt(0.05)
        self._yaw_doubt = Doubt(0.02)
        self._gyro = Gyro()
        self.surprises = SurpriseCount()

    def copy(self, measured: MotionSamples) -> MotionCorrections:
        """Return others with the same doubts, which read `measured`."""
        other = shallow_copy(self)
        other._measured = measured
        other._speed_doubt = shallow_copy(self._speed_doubt)
        other._yaw_doubt = shallow_copy(self._yaw_doubt)
        other._gyro = shallow_copy(self._gyro)
        other.surprises = self.surprises.copy()
        return other

    def watch(self, message: Any, *, standing: bool) -> None:
        """Let the gyro show its noise, and its bias while measured speed says the car stands."""
        if isinstance(message, ImuSample):
            standing = standing and self._measured.fresh("speed_mps", message.stamp_ns)
            self._gyro.take(message.stamp_ns, message.rate_radps[2], standing=standing)

    def begin(self, filter_: KinematicFilter) -> None:
        """Give a new filter what is known of the sensors already."""
        filter_.know_gyro_bias(self._gyro.bias_radps, self._gyro.bias_std_radps)

    def correct(self, filter_: KinematicFilter, message: Any, *, convergence_rad: float) -> None:
        """Correct a filter already predicted to the sample's stamp.

        `convergence_rad` is the angle of the filter's frame against east.
        """
        match message:
            case SpeedSample(speed_mps=speed):
                self._correct_speed(filter_, speed)
            case ImuSample(accel_mps2=accel, rate_radps=rate):
                square = filter_.correct_yaw_rate(rate[2], self._gyro.std_radps, biased=True)
                self.surprises.take("imu", square, LINE_95)
                filter_.correct_accel(accel[0], 0.5)
            case HeadingSample(yaw_rad=yaw, yaw_rate_radps=yaw_rate):
                local_yaw = yaw + convergence_rad
                surprise = abs(math.remainder(local_yaw - filter_.mean[YAW], math.tau))
                square = filter_.correct_yaw(local_yaw, self._yaw_doubt.std(surprise))
                self.surprises.take("heading", square, LINE_95)
                if yaw_rate is not None:
                    filter_.correct_yaw_rate(yaw_rate, 0.01, biased=False)
            case SteeringSample():
                angle = self._measured.tire_angle_rad
                if angle is not None:
                    # Understeer and an unknown offset make steering a rough witness of the path.
                    filter_.correct_curvature(math.tan(angle) / self._wheelbase_m, 0.03)

    def _correct_speed(self, filter_: KinematicFilter, speed_mps: float) -> None:
        if speed_mps < -0.1:
            filter_.may_reverse = True
        elif speed_mps > 0.1:
            filter_.may_reverse = False
        if abs(speed_mps) < STANDING_MPS and abs(filter_.mean[SPEED]) < STOPPING_MPS:
            filter_.stand(0.01, 0.05)
        else:
            std = self._speed_doubt.std(abs(speed_mps - filter_.mean[SPEED]))
            square = filter_.correct_speed(speed_mps, std + 0.005 * abs(speed_mps))
            self.surprises.take("speed", square, LINE_95)
