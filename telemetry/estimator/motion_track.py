"""A car's motion from samples in the order of their stamps: pure and causal."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix, HeadingSample, SpeedSample, VehicleInfo, VehicleState
from foretwin.contracts.frames import GeoPoint, base_from_sensor
from foretwin.telemetry.estimator.filter_state import GYRO_BIAS, SPEED, YAW
from foretwin.telemetry.estimator.innovations import SurpriseCount
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.local_place import LocalPlace
from foretwin.telemetry.estimator.map_aid import MapAid, RoadLine
from foretwin.telemetry.estimator.measured import (
    CLOCK_LEAP_NS,
    USUAL_STEERING,
    MotionSamples,
    Steering,
)
from foretwin.telemetry.estimator.motion_corrections import MotionCorrections
from foretwin.telemetry.estimator.position_corrections import PositionCorrections
from foretwin.telemetry.estimator.position_gate import MAX_SPEED_MPS, PositionGate, Verdict
from foretwin.telemetry.estimator.reported_state import (
    StateConsistency,
    consistency_of,
    moving_state,
    unmoved_state,
)
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

_COURSE_STD_RAD, _SPEED_STD_MPS = 0.15, 1.0
"""At the least, of a course between fixes and of a speed: a car turns and pulls away. Chosen."""
_CREEPS_MPS, _ELSEWHERE_M = 0.5, 20.0
"""Who was slower as it fell silent stood: it heads as before, unless it is heard of farther off."""
_MOST_FASTER_MPS = 5.0
"""A second and a half of a car's hardest pulling away (0.35 g)."""


class MotionTrack:
    """Takes samples one by one and says where base_link is, and how it moves.

    Positions whose source states no standard deviation, or only positions of at most 5 cm, are
    passed through unchanged at their own stamp; rougher ones, and those with other sensors, fused.
    """

    def __init__(self, info: VehicleInfo, *, steering: Steering = USUAL_STEERING) -> None:
        self._info = info
        self._lever = info.body_from_antenna_m or (0.0, 0.0, 0.0)
        self._gate = PositionGate()
        self._measured = MotionSamples(steering, skipped=self._gate.skipped)
        self._surprises = SurpriseCount()
        self._corrections = MotionCorrections(self._measured, self._surprises)
        self._positions = PositionCorrections(
            self._measured, self._gate, self._surprises, self._lever[:2]
        )
        self._aid = MapAid()
        self._place: LocalPlace | None = None
        self._filter: KinematicFilter | None = None
        self._start_ns = self._filter_stamp_ns = 0
        self._fix: GnssFix | None = None
        self._standing = self._unheard = False

    @property
    def skipped(self) -> Counter[str]:
        """How many samples were refused, by reason."""
        return self._gate.skipped

    def copy(self) -> MotionTrack:
        """Return another track that goes on from here by itself."""
        other = shallow_copy(self)
        other._gate = self._gate.copy()
        other._measured = self._measured.copy(skipped=other._gate.skipped)
        other._surprises = self._surprises.copy()
        other._corrections = self._corrections.copy(other._measured, other._surprises)
        other._positions = self._positions.copy(other._measured, other._gate, other._surprises)
        other._aid = shallow_copy(self._aid)
        other._filter = None if self._filter is None else self._filter.copy()
        return other

    def take(self, channel: str, message: Any) -> bool:
        """Take a sample; returns whether it was believed. Channels without motion are ignored."""
        if channel == "gnss":
            return self._position(message)
        if channel == "map":
            return self._road(message)
        if not self._measured.take(channel, message):
            return False
        self._motion(channel, message)
        return True

    @property
    def fix(self) -> GnssFix | None:
        """The last position that was believed."""
        return self._fix

    @property
    def started(self) -> bool:
        """Whether there is a state to speak of between positions: a place and a heading."""
        return self._filter is not None

    # Samples beside positions.

    def _motion(self, channel: str, message: Any) -> None:
        filter_ = self._advance(message.stamp_ns)
        if not self._corrections.watch(channel, message, standing=self._standing):
            return
        if isinstance(message, SpeedSample):
            self._standing = self._corrections.stands(message, filter_)
        if filter_ is not None:
            self._corrections.correct(filter_, message, convergence_rad=self._convergence_rad)
            self._give_up_unsound(filter_)
        elif isinstance(message, HeadingSample):
            self._start(message.stamp_ns, message.yaw_rad + self._convergence_rad, yaw_std_rad=0.02)

    def _road(self, line: RoadLine) -> bool:
        """Take a map's line where positions say of themselves how far they can be off."""
        filter_, fix, place = self._filter, self._fix, self._place
        if filter_ is None or fix is None or place is None or fix.std_m is None:
            return False
        std = fix.std_m if self._positions.noise.wanders(fix) else 0.0
        return self._aid.take(filter_, place, line, receiver_std_m=std)

    # Positions.

    def _position(self, fix: GnssFix) -> bool:
        if not self._gate.plausible(fix):
            return False
        if self._place is None:
            self._place = LocalPlace.around(fix.position)
            self._start_ns = fix.stamp_ns
        xy = self._place.xy_m(fix.position)
        time_s = (fix.stamp_ns - self._start_ns) * 1e-9
        filter_ = self._advance(fix.stamp_ns)
        speed_mps = self._corrections.known_speed_mps(fix.stamp_ns, filter_)
        if self._gate.frozen(time_s, xy, speed_mps=speed_mps):
            self.skipped["gnss_repeated"] += 1  # a receiver's last answer, sent once more
            return False
        expected, lost = self._gate.recent[-1].xy_m if self._gate.recent else None, False
        if filter_ is not None:
            expected = filter_.sensor_xy(self._lever[:2])
            late_ns = self._filter_stamp_ns - fix.stamp_ns
            if late_ns > 0:
                xy = xy + filter_.way_m(late_ns * 1e-9)
            elsewhere_m = _ELSEWHERE_M + 3.0 * self._positions.noise.std_m(fix)
            lost = self._unheard and math.dist(xy, expected) > elsewhere_m
        verdict = self._gate.judge(time_s, xy, expected)
        if verdict == "skip":
            return False
        if lost or (verdict == "relocate" and not self._place.reaches(xy)):
            # What went before was wrong, or another place: begin anew, with a frame of this one.
            self._place, xy = LocalPlace.around(fix.position), np.zeros(2)
            self._gate.restart(time_s, xy)
            filter_ = self._filter = None
        self._fix, self._unheard = fix, False
        self._place = self._place.at(fix.position, antenna_up_m=self._lever[2])
        self._positions.noise.take(time_s, xy)
        sure_m, turned_rad = self._positions.noise.sure_white_std_m(fix), self._convergence_rad
        if self._corrections.watch_fix(fix.stamp_ns, xy, sure_m, convergence_rad=turned_rad):
            filter_, self._filter, self._standing = None, None, False  # a sensor led it astray
        if filter_ is None:
            self._start_from_course(fix)
        else:
            self._correct(filter_, xy, fix, verdict)
            self._give_up_unsound(filter_)
        if self._filter is not None:
            self._positions.check_told(self._filter, fix, time_s, xy)
        return True

    def _correct(self, filter_: KinematicFilter, xy: Array, fix: GnssFix, verdict: Verdict) -> None:
        if verdict == "relocate":
            self._positions.move(filter_, fix, xy)
            return
        found = self._positions.correct(filter_, fix, xy, aid=self._aid, standing=self._standing)
        self._standing = found.standing
        if found.course_rad is not None:
            self._start(self._filter_stamp_ns, found.course_rad, yaw_std_rad=0.3)

    def _start_from_course(self, fix: GnssFix) -> None:
        noise = self._positions.noise
        least_m = max(1.0, 5.0 * noise.std_m(fix))
        course = self._gate.course(least_m)
        measured = self._measured.fresh("speed_mps", fix.stamp_ns)
        speed_mps = self._measured.speed_mps if measured else math.inf
        if course is None or abs(speed_mps) < 0.3:
            return
        std_rad = max(_COURSE_STD_RAD, math.sqrt(2.0) * noise.apart_std_m(fix) / least_m)
        yaw_rad = course if speed_mps > 0.0 else course + math.pi
        self._start(fix.stamp_ns, yaw_rad, yaw_std_rad=std_rad)

    def _start(self, stamp_ns: int, yaw_rad: float, *, yaw_std_rad: float) -> None:
        measured = self._measured.fresh("speed_mps", stamp_ns)
        if len(self._gate.recent) < (1 if measured else 2):
            return  # a heading alone does not tell how fast the car goes
        noise, fix = self._positions.noise, self._fix
        assert fix is not None  # the gate has it
        speed_mps, shown_mps = self._measured.speed_mps, 0.0
        if not measured:
            speed_mps = self._gate.speed_mps()
            shown_mps = self._gate.speed_std_mps(noise.apart_std_m(fix))
            if self._filter is not None:
                # Lost or not: no car has become so much faster since it was known.
                speed_mps = min(speed_mps, abs(self._filter.mean.item(SPEED)) + _MOST_FASTER_MPS)
        since_s, at = self._gate.gone_on((stamp_ns - self._start_ns) * 1e-9, yaw_rad, speed_mps)
        xy = base_from_sensor(at, yaw_rad, self._lever)
        self._filter = KinematicFilter(
            xy_m=xy,
            yaw_rad=yaw_rad,
            yaw_std_rad=yaw_std_rad,
            speed_mps=speed_mps,
            speed_std_mps=max(_SPEED_STD_MPS, shown_mps),
        )
        self._filter.doubt_motion(min(since_s, 1.0), 0.0, since_s)
        self._corrections.begin(self._filter)
        self._filter_stamp_ns = stamp_ns
        if noise.wanders(fix):
            std_m, white_m = noise.std_m(fix), noise.white_std_m(fix)
            self._filter.begin_beside(at, self._lever[:2], std_m=std_m, white_m=white_m)

    def _give_up_unsound(self, filter_: KinematicFilter) -> None:
        """Begin anew with the next fix or heading where a correction led to no motion of a car."""
        if filter_ is self._filter and not filter_.is_sound:
            self.skipped["motion_contradicted"] += 1
            self._filter = None

    def _advance(self, stamp_ns: int) -> KinematicFilter | None:
        if self._filter is not None and stamp_ns > self._filter_stamp_ns:
            silent_ns = stamp_ns - self._filter_stamp_ns
            if silent_ns > CLOCK_LEAP_NS and abs(self._filter.mean.item(SPEED)) > _CREEPS_MPS:
                self._filter, self._standing = None, False  # it heads anywhere by now
                self._gate.recent.clear()
                return None
            # After a long silence the motion is unknown: two seconds of it are enough.
            self._filter.predict(min(silent_ns * 1e-9, 2.0))
            if silent_ns > CLOCK_LEAP_NS:
                self._unheard = True
                self._filter.doubt_position(MAX_SPEED_MPS * silent_ns * 1e-9)
            self._filter_stamp_ns = stamp_ns
        return self._filter

    @property
    def _convergence_rad(self) -> float:
        return 0.0 if self._place is None else self._place.convergence_rad

    # What comes out.

    def _position_out(self, fix: GnssFix | None) -> GeoPoint:
        assert self._place is not None
        if self._filter is None:
            assert self._fix is not None
            return self._fix.position
        if fix is not None and self._positions.at_its_word(fix, alone=not self._measured.anything):
            if not any(self._lever):
                return fix.position
            xy = base_from_sensor(self._gate.recent[-1].xy_m, self._filter.mean[YAW], self._lever)
        else:
            xy = self._filter.mean[:2]
        return self._place.position(xy)

    def state(self, stamp_ns: int, *, fix: GnssFix | None = None) -> VehicleState:
        """Return the state at `stamp_ns`, at or after all samples taken.

        `fix` is the position of this very stamp, if any. Raises ValueError before the first one.
        """
        if self._fix is None:
            raise ValueError("no position has come yet: there is no state")
        self._advance(stamp_ns)
        known = self._measured, self._info.vehicle_id, stamp_ns, self._position_out(fix)
        if self._filter is None:
            return unmoved_state(*known, self._fix.std_m)
        return moving_state(
            *known,
            self._filter,
            convergence_rad=self._convergence_rad,
            standing=self._standing,
            map_shift_m=self._aid.shift_m,
            overconfidence=self._positions.overconfidence,
            stretched=self._positions.stretched,
            hidden_std_m=self._positions.noise.hidden_std_m(self._fix),
        )

    @property
    def gyro_bias_radps(self) -> float:
        """The gyro's bias as learnt so far; 0 before the heading is known."""
        return 0.0 if self._filter is None else float(self._filter.mean[GYRO_BIAS])

    @property
    def left_out(self) -> frozenset[str]:
        """See `StateEstimator.left_out`."""
        return self._corrections.trust.left_out

    @property
    def consistency(self) -> StateConsistency:
        """Whether the states were as sure of themselves as they turned out to be."""
        found, mounting = self._positions, self._corrections.mounting.mounting
        return consistency_of(found, self._fix, surprises=self._surprises, mounting=mounting)
