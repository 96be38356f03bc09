"""Corrects the filter with positions, as far as a car can have gone where they say.

A fix that surprises beyond what motion and noise explain is held back. The next one decides: back
on the way, the first was a glitch; as far off as the first, the receiver has slipped, and the place
moves while the motion stays; farther off still, the motion was misjudged, and begins anew.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix
from foretwin.telemetry.estimator.facing import BACKING_MPS, CREEPING_MPS, Facing
from foretwin.telemetry.estimator.filter_state import SPEED, YAW
from foretwin.telemetry.estimator.innovations import (
    PLANE_95,
    PositionInnovation,
    SurpriseCount,
)
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.map_aid import MapAid
from foretwin.telemetry.estimator.measured import MotionSamples
from foretwin.telemetry.estimator.motion_noise import CALMEST
from foretwin.telemetry.estimator.position_gate import LocalFix, PositionGate
from foretwin.telemetry.estimator.position_noise import PositionNoise, stated_m
from foretwin.telemetry.estimator.shallow_copy import shallow_copy
from foretwin.telemetry.estimator.slow_motion import drift_sideways, limit_turn
from foretwin.telemetry.estimator.sparse_fixes import bear_anew, follow_fixes, sparse, turned_m
from foretwin.telemetry.estimator.told_spreads import Stretched, ToldSpreads

_DOUBTFUL, _UNBELIEVABLE = 9.0, 25.0
"""Normalised squares (three and five standard deviations) from which a fix counts for less, and
for nothing until the next one bears it out."""
_IMPOSSIBLE = 25.0
"""The same where fixes are alone: how hard a driver may brake and turn is in what is expected."""
_BY_CHANCE = 1.5
"""So much of what is usual. Where sources contradict each other all the time, no single fix is a
glitch, and no spread is as small as said."""
_UP, _DOWN = 1.2, 1.2 ** (-1.0 / 19.0)
"""What of 100 fixes the 5 beyond their 95 % bound, and the 95 within it, make of what is usual
(Gibbs, Candes 2021)."""
_LEAST_SLIP_M = 0.1
_SHOWS_TURNING_M = 0.2
"""Fixes rougher than this show no wheel being turned, only the bend that comes of it. Chosen."""
_NIMBLE = 1.5
"""Where nothing but fixes tells of turning, a turn must not lag behind them. Chosen."""
_CALMING = 0.1
"""How fast, fix by fix, a calm driver is believed to stay calm."""
_MISJUDGED_MPS2 = 4.0
_MOST_MPS2 = 10.0
"""No car on tyres accelerates, brakes or turns harder (1 g)."""
_SINCE_S, _SHORTLY_S = 0.2, 0.6
_LOST_S = 2.0
"""So long may fixes contradict each other before the newest is as good as any."""
_STANDING_SPEED_STD_MPS, _STANDING_ACCEL_STD_MPS2 = 0.1, 1.0
"""How well fixes alone tell that a car stands: it may have begun to roll. Chosen."""
_ASTRAY = 3
"""So many fixes in a row that agree neither with it nor with each other: the filter is lost."""
_PASSED_ON_M = 0.05


class Corrected(NamedTuple):
    """Whether the car stands, and the course (rad) along which the motion has to begin anew."""

    standing: bool
    course_rad: float | None = None


class _Doubted(NamedTuple):
    """A fix, and how far it lay off what was expected (2,)."""

    fix: LocalFix
    off_m: Array


class PositionCorrections:
    """Gives each fix its weight; what is refused is counted by the gate."""

    def __init__(
        self,
        measured: MotionSamples,
        gate: PositionGate,
        surprises: SurpriseCount,
        lever_m: tuple[float, float],
    ) -> None:
        self._measured = measured
        self._gate = gate
        self._lever = lever_m
        self.noise = PositionNoise()
        self._doubted: tuple[_Doubted, ...] = ()
        """The latest fixes in a row that were held back."""
        self._usual = 1.0
        self._surprises = surprises
        self._facing = Facing(gate)
        self._spreads = ToldSpreads()
        self.slips = 0
        """How often the receiver has slipped."""

    def copy(
        self, measured: MotionSamples, gate: PositionGate, surprises: SurpriseCount
    ) -> PositionCorrections:
        """Return others with the same doubts, which read and count in what is given."""
        other = shallow_copy(self)
        other._measured, other._gate = measured, gate
        other.noise, other._surprises = self.noise.copy(), surprises
        other._facing, other._spreads = self._facing.copy(gate), self._spreads.copy()
        return other

    @property
    def overconfidence(self) -> float:
        """So many times smaller than it turned out does the filter say that its errors are."""
        return math.sqrt(max(self._usual / _BY_CHANCE, 1.0))

    @property
    def stretched(self) -> Stretched:
        """How large errors were found to be of what states told."""
        return self._spreads.stretched

    def check_told(
        self, filter_: KinematicFilter, fix: GnssFix, time_s: float, xy_m: Array
    ) -> None:
        """Let a fix, which the filter has taken, show how good the states before it were."""
        self._spreads.take(
            time_s,
            xy_m,
            filter_,
            self._lever,
            noise_m=self.noise.seen_m,
            overconfidence=self.overconfidence,
            heading=self._measured.fresh("yaw_rad", fix.stamp_ns),
        )

    def at_its_word(self, fix: GnssFix, *, alone: bool) -> bool:
        """Whether a fix is passed on unchanged; `alone` where nothing else tells of the motion."""
        unstated = stated_m(fix) is None
        noise_m = (self.noise.seen_m or 0.0) if unstated and alone else self.noise.std_m(fix)
        return not self._doubted and noise_m <= _PASSED_ON_M and (unstated or alone)

    def correct(
        self, filter_: KinematicFilter, fix: GnssFix, xy_m: Array, *, aid: MapAid, standing: bool
    ) -> Corrected:
        """Correct a filter already predicted to the fix, which lies at `xy_m` (2,)."""
        std, white = self.noise.std_m(fix), self.noise.white_std_m(fix)
        if wander := self.noise.wanders(fix):
            filter_.expect_wander(std)
        wheels = self._measured.fresh("speed_mps", fix.stamp_ns)
        unturned = not self._measured.tells_turning(fix.stamp_ns)
        unseen = wheels and unturned and not self._measured.fresh("yaw_rad", fix.stamp_ns)
        sharp = unseen and not standing and (not wander or white > 0.5 * std)
        if sharp and bear_anew(filter_, self._gate.recent, std, white, self._lever):
            self._facing.take(filter_)
            self._doubted = ()
            return Corrected(standing)
        innovation = filter_.position_innovation(xy_m, self._lever, wander=wander)
        square = innovation.square(white)
        if wheels:
            self.noise.surprised(innovation.away_m, innovation.variance_m2(0.0))
        alone = not wheels and not self._measured.anything
        unfelt = not wheels and not self._measured.fresh("accel_mps2", fix.stamp_ns)
        self._surprises.take("gnss", square, PLANE_95 * self.overconfidence**2)
        usual = 1.0 if wander or alone else self._usual
        impossible = _IMPOSSIBLE if alone else _UNBELIEVABLE * usual
        least_m = max(_LEAST_SLIP_M, turned_m(self._gate.recent) if unfelt or unturned else 0.0)
        astray = square > impossible and innovation.away_m > least_m
        if alone and not wander and square > PLANE_95 and innovation.away_m > _LEAST_SLIP_M:
            astray = astray or self._facing.goes_sideways(white)
        if astray or (self._doubted and self._slipped(innovation, white, standing=standing)):
            held = self._doubt(filter_, fix, xy_m, innovation, standing=standing)
            if held is not None:
                return held
            innovation = filter_.position_innovation(xy_m, self._lever, wander=wander)
            square = innovation.square(white)
        borne_out, self._doubted = bool(self._doubted), ()
        self._usual = max(self._usual * (_UP if square > PLANE_95 * self._usual else _DOWN), 1.0)
        shown = _SHOWS_TURNING_M / white
        filter_.steady = min(_NIMBLE, shown) if alone else min(1.0, shown) if unseen else 1.0
        self._expect_pedals(filter_, square, unfelt=unfelt)
        yaw_before = filter_.mean[YAW]
        if (
            abs(filter_.mean[SPEED]) < CREEPING_MPS
            and not wander
            and drift_sideways(filter_, xy_m, std, self._lever)
        ):
            innovation = filter_.position_innovation(xy_m, self._lever)
        doubt, noise = square / (_DOUBTFUL * usual), white
        if doubt > 1.0 and not borne_out:
            noise = math.sqrt(white * white + (doubt - 1.0) * innovation.variance_m2(white))
        filter_.correct_position(innovation, noise, hold_yaw=wheels and standing)
        limit_turn(filter_, yaw_before, moved_m=self._gate.last_step_m)
        self._facing.take(filter_)
        if wander and aid.astray(filter_, receiver_std_m=self.noise.most_std_m(fix)):
            filter_.move_position(xy_m, std, self._lever)
            filter_.forget_wander()
        if not wheels:
            stood, standing = standing, self._gate.standing(self.noise.still_std_m(fix))
            standing = standing and abs(filter_.mean[SPEED]) < CREEPING_MPS / 2.0
            if stood and not standing:
                filter_.doubt_motion(CREEPING_MPS, _MISJUDGED_MPS2, 0.0)
            if standing:
                filter_.stand(_STANDING_SPEED_STD_MPS, _STANDING_ACCEL_STD_MPS2)
                filter_.calm = 1.0  # it may pull away at any time
        if not standing and (unfelt or (wheels and unturned)) and sparse(self._gate.recent):
            apart = self.noise.apart_std_m(fix)
            follow_fixes(filter_, self._gate.recent, apart, turning=unturned, pace=not wheels)
        if standing:
            filter_.mean[YAW] = yaw_before
            return Corrected(standing)
        faces = self._alone(fix) or (filter_.may_reverse and not wheels)
        course = self._facing.turned(filter_, yaw_before, std) if faces else None
        return Corrected(standing, course)

    def move(self, filter_: KinematicFilter, fix: GnssFix, xy_m: Array) -> None:
        """Put the place where the fix says, and leave the motion: the receiver has jumped."""
        filter_.move_position(xy_m, self.noise.std_m(fix), self._lever)
        if self.noise.wanders(fix):
            filter_.forget_wander()
        self.noise.restart()
        self._doubted = ()

    def _expect_pedals(self, filter_: KinematicFilter, square: float, *, unfelt: bool) -> None:
        """Let surprises say how calmly the car is driven, where fixes alone tell of pedals."""
        if not unfelt or square > _DOUBTFUL:
            filter_.calm = 1.0
            return
        pace = math.exp(_CALMING * (0.5 * min(square, _DOUBTFUL) - 1.0))
        filter_.calm = min(max(filter_.calm * pace, CALMEST), 1.0)

    def _slipped(self, innovation: PositionInnovation, white_m: float, *, standing: bool) -> bool:
        """Whether a fix, believable by itself, lies off as the one before it that was held back."""
        before, now = self._doubted[-1], self._gate.recent[-1]
        moved = innovation.residual_m - before.off_m
        step_s = now.time_s - before.fix.time_s
        far = innovation.away_m > 0.5 * math.hypot(*before.off_m)
        return far and self._alike(moved, step_s, white_m, standing=standing)

    @staticmethod
    def _alike(moved_m: Array, step_s: float, white_m: float, *, standing: bool) -> bool:
        """Whether two fixes lie off alike, as far as noise and the motion between them allow."""
        allowed_m = 0.5 * _LEAST_SLIP_M + 3.0 * white_m
        if not standing:
            allowed_m += 0.5 * _MISJUDGED_MPS2 * step_s * step_s
        return math.hypot(*moved_m) < allowed_m

    def _doubt(
        self,
        filter_: KinematicFilter,
        fix: GnssFix,
        xy_m: Array,
        innovation: PositionInnovation,
        *,
        standing: bool,
    ) -> Corrected | None:
        """Hold back a fix that cannot be, or decide what the ones before it were.

        Returns None where it may correct the filter after all.
        """
        now = _Doubted(self._gate.hold_back(), innovation.residual_m)
        before, self._doubted = self._doubted, (*self._doubted, now)
        if before:
            moved = now.off_m - before[-1].off_m
            step_s = now.fix.time_s - before[-1].fix.time_s
            alike = self._alike(moved, step_s, self.noise.white_std_m(fix), standing=standing)
            if alike and (len(before) >= _ASTRAY - 1 or not self.noise.wanders(fix)):
                self._gate.slip(innovation.residual_m, now.fix)
                self.move(filter_, fix, xy_m)
                self.slips += 1
                return Corrected(standing)
            cos, sin = math.cos(filter_.mean[YAW]), math.sin(filter_.mean[YAW])
            along = cos * moved[0] + sin * moved[1]
            ahead = abs(along) > abs(cos * moved[1] - sin * moved[0])
            can = abs(along) / step_s < CREEPING_MPS + _MOST_MPS2 * (step_s + _SINCE_S)
            if not alike and ahead and can and self._alone(fix):
                # The car goes on along its heading, faster or slower than was thought.
                self._gate.begin_anew(tuple(one.fix for one in self._doubted))
                filter_.doubt_motion(abs(along) / step_s, _MISJUDGED_MPS2, step_s)
                if filter_.mean[SPEED] + along / step_s < -BACKING_MPS:
                    self._facing.reverse(filter_, along / step_s)
                return None
        lasts_s = now.fix.time_s - self._doubted[0].fix.time_s
        if len(self._doubted) < _ASTRAY or (lasts_s < _LOST_S and self._erratic(fix)):
            self._gate.skipped["gnss_outlier"] += 1
            return Corrected(standing)
        self._gate.begin_anew(tuple(one.fix for one in self._doubted), after_s=_SHORTLY_S)
        self.move(filter_, fix, xy_m)
        return Corrected(standing, self._facing.backed_course(2.0 * self.noise.std_m(fix)))

    def _erratic(self, fix: GnssFix) -> bool:
        """Whether no car can go through the latest three fixes that were held back."""
        one, two, three = (doubted.fix for doubted in self._doubted[-3:])
        before_s, after_s = two.time_s - one.time_s, three.time_s - two.time_s
        bend = three.xy_m - two.xy_m - (two.xy_m - one.xy_m) * (after_s / before_s)
        allowed_m = 0.5 * _MOST_MPS2 * after_s * (before_s + after_s)
        return math.hypot(*bend) > allowed_m + 4.0 * self.noise.white_std_m(fix)

    def _alone(self, fix: GnssFix) -> bool:
        """Whether nothing but positions tells of the direction."""
        fresh = self._measured.fresh
        return not (fresh("speed_mps", fix.stamp_ns) or fresh("yaw_rad", fix.stamp_ns))
