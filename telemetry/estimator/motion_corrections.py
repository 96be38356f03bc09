"""Corrects the filter with what is measured beside positions: speed, inertia, heading, steering."""

from __future__ import annotations

import math
from typing import Any

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import HeadingSample, ImuSample, SpeedSample, SteeringSample
from foretwin.telemetry.estimator.filter_state import ACCEL, ACCEL_BIAS, GYRO_BIAS, SPEED, YAW
from foretwin.telemetry.estimator.gyro import Gyro
from foretwin.telemetry.estimator.innovations import SurpriseCount
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.measured import Doubt, MotionSamples
from foretwin.telemetry.estimator.mounting import MountingLearner
from foretwin.telemetry.estimator.sensor_trust import LEFT_OUT, SensorTrust
from foretwin.telemetry.estimator.shallow_copy import shallow_copy
from foretwin.telemetry.estimator.yaw_rates import correct_gyro, correct_yaw_rate

STANDING_MPS = 0.05
"""Below this measured speed a car stands."""
_STOPPING_MPS, _STOPPING_S, _STOPPING_MPS2 = 1.0, 0.5, 4.0
"""A car that is faster than the first does not stand because wheels say so at once: they must say
it for the time that braking takes, and half a second more. Chosen."""
_LEAST_SPEED_STD_MPS, _LEAST_YAW_STD_RAD = 0.05, 0.02
"""However well a measured speed or heading agrees. Chosen."""
_MOST_SPEED_STD_MPS = 3.0
"""However much a measured speed surprises: heard less, it could not contradict a filter that forces
mislead. Chosen: with less, wheels that say nought for half a second stop a car at 9 m/s."""
_USUAL_SURPRISE = 3.0
"""A gyro's noise is known: of its surprises only one part in so many counts as a doubt. Chosen:
from 3 on no figure of `python -m tests.telemetry.estimator_figures` changes by over 2 mm or .01°;
with 1 or 2 a phone's headings lead the yaw more."""


class MotionCorrections:
    """Gives each kind of sample its weight, which it loses as it surprises; a gyro's is known, and
    is lost where its surprises are beyond that."""

    def __init__(self, measured: MotionSamples, surprises: SurpriseCount) -> None:
        self._measured = measured
        self._speed_doubt = Doubt(_LEAST_SPEED_STD_MPS, _MOST_SPEED_STD_MPS)
        self._yaw_doubt = Doubt(_LEAST_YAW_STD_RAD)
        self._yaw_rate_doubt = Doubt(0.01)
        self._gyro_doubt = Doubt(0.0)
        self._accel_doubt = Doubt(0.5)
        self._gyro = Gyro()
        self.trust = SensorTrust()
        self._stands = False
        self._nought_ns: int | None = None
        self.gyro_bias_radps = 0.0
        """As the filter knows it."""
        self._surprises = surprises
        self.mounting = MountingLearner()

    def copy(self, measured: MotionSamples, surprises: SurpriseCount) -> MotionCorrections:
        """Return others with the same doubts, which read `measured` and count in `surprises`."""
        other = shallow_copy(self)
        other._measured = measured
        other._speed_doubt = shallow_copy(self._speed_doubt)
        other._yaw_doubt = shallow_copy(self._yaw_doubt)
        other._yaw_rate_doubt = shallow_copy(self._yaw_rate_doubt)
        other._gyro_doubt = shallow_copy(self._gyro_doubt)
        other._accel_doubt = shallow_copy(self._accel_doubt)
        other._gyro = shallow_copy(self._gyro)
        other.trust = self.trust.copy()
        other._surprises = surprises
        other.mounting = self.mounting.copy()
        return other

    def watch(self, channel: str, message: Any, *, standing: bool) -> bool:
        """Let a sample show what its sensor is worth; returns whether it is to be used.

        The gyro shows its noise, and its bias while measured speed says that the car stands.
        """
        stamp_ns, curvature_pm = message.stamp_ns, None
        if isinstance(message, SteeringSample):
            curvature_pm = self._measured.curvature_pm
        bias = self._gyro.bias_radps
        self.trust.take(message, gyro_bias_radps=bias, curvature_pm=curvature_pm)
        believed = channel not in self.trust.left_out
        if not believed:
            self._measured.disbelieve(*LEFT_OUT[channel])
        if not isinstance(message, ImuSample):
            return believed
        if "forces" in self.trust.left_out and message.tells_force:
            self._measured.disbelieve(*LEFT_OUT["forces"])
        moving = self._measured.fresh("speed_mps", stamp_ns)
        self._gyro.take(stamp_ns, message.rate_radps[2], standing=standing and moving)
        if believed and moving:
            rate = message.rate_radps[2] - self.gyro_bias_radps
            self.mounting.turn(stamp_ns, rate, self._measured.speed_mps)
        return True  # its forces are apart

    def stands(self, sample: SpeedSample, filter_: KinematicFilter | None) -> bool:
        """Whether the wheels say, believably, that the car stands; takes each of their samples."""
        if abs(sample.speed_mps) >= STANDING_MPS:
            self._nought_ns = None
            self._stands = False
            return False
        self._nought_ns = sample.stamp_ns if self._nought_ns is None else self._nought_ns
        faster_mps = 0.0 if filter_ is None else abs(filter_.mean.item(SPEED))
        lasts_s = (sample.stamp_ns - self._nought_ns) * 1e-9
        braked = lasts_s > _STOPPING_S + faster_mps / _STOPPING_MPS2
        self._stands = faster_mps < _STOPPING_MPS or braked
        return self._stands

    def known_speed_mps(self, stamp_ns: int, filter_: KinematicFilter | None) -> float:
        """Return the car's speed without a fix of now: the wheels', inf if any, or the filter's."""
        if self._measured.fresh("speed_mps", stamp_ns):
            return math.inf if abs(self._measured.speed_mps) > 0.5 else 0.0
        return 0.0 if filter_ is None else abs(filter_.mean.item(SPEED))

    def watch_fix(
        self, stamp_ns: int, xy_m: Array, std_m: float, *, convergence_rad: float
    ) -> bool:
        """Let a believed fix show where the antenna is, as far as wheels and gyro are heard.

        Returns whether it shows as well that a sensor has led the filter astray.
        """
        before = self.trust.left_out
        self.trust.take_fix(stamp_ns, xy_m, std_m, convergence_rad=convergence_rad)
        if self._measured.fresh("speed_mps", stamp_ns):
            self.mounting.take(stamp_ns, xy_m, std_m, self._measured.speed_mps)
        newly = self.trust.left_out - before
        for channel in newly:
            self._measured.disbelieve(*LEFT_OUT[channel])
        if "speed" in newly:
            self._gyro = Gyro()  # its bias was learnt while wheels said that the car stood
        return bool(newly)

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
                if "imu" not in self.trust.left_out:
                    self._correct_turning(filter_, rate[2])
                if "forces" in self.trust.left_out or not message.tells_force:
                    return
                expected = filter_.mean.item(ACCEL) + filter_.mean.item(ACCEL_BIAS)
                filter_.correct_accel(accel[0], self._accel_doubt.std(abs(accel[0] - expected)))
            case HeadingSample(yaw_rad=yaw, yaw_rate_radps=yaw_rate):
                local_yaw = yaw + convergence_rad
                surprise = abs(math.remainder(local_yaw - filter_.mean.item(YAW), math.tau))
                std = self._yaw_doubt.std(surprise, filter_.covariance.item(YAW, YAW))
                off = filter_.correct_yaw(local_yaw, std)
                self._surprises.take_line("heading", off, least_std=_LEAST_YAW_STD_RAD)
                if yaw_rate is not None:
                    std = self._yaw_rate_doubt.std(abs(yaw_rate - filter_.yaw_rate_radps))
                    correct_yaw_rate(filter_, yaw_rate, std)
            case SteeringSample():
                curvature_pm = self._measured.curvature_pm
                if curvature_pm is not None:
                    # Understeer and an unknown offset make steering a rough witness of the path.
                    filter_.correct_curvature(curvature_pm, 0.03)

    def _correct_turning(self, filter_: KinematicFilter, rate_radps: float) -> None:
        off = abs(rate_radps - filter_.yaw_rate_radps - filter_.mean.item(GYRO_BIAS))
        doubt = self._gyro_doubt.std(off / _USUAL_SURPRISE)
        known = self._gyro.std_radps
        innovation = correct_gyro(filter_, rate_radps, max(known, doubt))
        self._surprises.take_line("imu", innovation, least_std=known, usual=_USUAL_SURPRISE)
        self.gyro_bias_radps = filter_.mean.item(GYRO_BIAS)

    def _correct_speed(self, filter_: KinematicFilter, speed_mps: float) -> None:
        if speed_mps < -0.1:
            filter_.may_reverse = True
        elif speed_mps > 0.1:
            filter_.may_reverse = False
        if self._stands:
            filter_.stand(0.01, 0.05)
        else:
            std = self._speed_doubt.std(abs(speed_mps - filter_.mean.item(SPEED)))
            scale_std = 0.005 * abs(speed_mps)
            self._surprises.take_line(
                "speed",
                filter_.correct_speed(speed_mps, std + scale_std),
                least_std=_LEAST_SPEED_STD_MPS + scale_std,
                most_std=_MOST_SPEED_STD_MPS + scale_std,
            )
