"""The planner under test that comes with foretwin: pure pursuit, intelligent-driver model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from contracts.arrays import Array
from sim_worker.planners.base import PlannerOutput, PlannerView
from sim_worker.planners.tracking import (
    aside_m,
    front_from_base_m,
    lookahead_m,
    steer_towards,
    turning_speed,
)
from sim_worker.vehicle.resistance import resistance_mps2

MAX_ACCEL_MPS2 = 1.5
COMFORT_DECEL_MPS2 = 2.0
MAX_DECEL_MPS2 = 8.0
TIME_GAP_S = 1.5
STANDSTILL_GAP_M = 2.0
LATERAL_ACCEL_MPS2 = 2.5
TURNING_ACCEL_MPS2 = 4.0
"""Of the wheels' own curvature: more than that of the path, which alone governs on it."""
EXPONENT = 4.0
LINE_GAP_M = 1.0
"""Between the front and the line at which it has stopped."""
LINE_DECEL_MPS2 = 4.0
"""Who would have to brake harder for a line goes on, as behind a light that has just changed."""
_CURVE_TIME_S = 0.5
_HOLD_SPEED_MPS = 0.3
_HOLD_MPS2 = -2.0


class _Wishes(NamedTuple):
    """What drivers want on a free road, each (S,), of `target_speed_mps` and `speed_factor`.

    To go at `speed_mps`, beginning with `accel_mps2`; `exponent` is of how they slow down to it.
    """

    target_speed_mps: Array
    speed_factor: Array
    speed_mps: Array
    accel_mps2: Array
    exponent: Array
    stand: npt.NDArray[np.bool_] | None


class PurePursuitIdm:
    """Keeps its lane, slows for curves, follows what is ahead, stops at lights, and holds there."""

    def __init__(self) -> None:
        self._wished: _Wishes | None = None

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""
        speed = np.maximum(view.states[:, 3], 0.0)
        # Where to steer for, and where the speed is looked up.
        arcs = np.empty((2, len(speed)))
        arcs[0] = lookahead_m(speed, aside_m(view))
        np.multiply(speed, _CURVE_TIME_S, out=arcs[1])
        arcs += view.arc_m
        goal, allowed = view.path.goal_and_speed(
            arcs,
            view.desired_offset_m,
            lateral_accel_mps2=LATERAL_ACCEL_MPS2,
            decel_mps2=COMFORT_DECEL_MPS2,
        )
        angle = steer_towards(view, goal.T)
        accel = self._curves(view, speed, angle, allowed)
        np.minimum(accel, self._free(view, speed), out=accel)
        if view.stop_arc_m is not None or np.count_nonzero(view.lead_gap_m < np.inf):
            accel -= self._interaction(view, speed)
        np.maximum(accel, -MAX_DECEL_MPS2, out=accel)
        command = accel + resistance_mps2(view.vehicle, speed)
        slow = speed < _HOLD_SPEED_MPS
        if np.count_nonzero(slow):
            command = np.where(slow & (accel <= 0.0), _HOLD_MPS2, command)
        return PlannerOutput(command, angle)

    def _free(self, view: PlannerView, speed: Array) -> Array:
        """Free-road acceleration; above the target speed it approaches the comfortable one.

        Treiber, Hennecke, Helbing (2000), Phys. Rev. E 62, eq. 2; above the target speed the
        improved form of Treiber and Kesting (2013), Traffic Flow Dynamics, eq. 11.22.
        """
        wishes = self._wishes(view)
        ratio = speed / wishes.speed_mps
        below = np.minimum(ratio, 1.0)
        below *= below
        below *= below
        np.subtract(1.0, below, out=below)
        below *= wishes.accel_mps2
        # At the target speed either is zero, and so they add up.
        above = np.maximum(ratio, 1.0, out=ratio)
        np.power(above, wishes.exponent, out=above)
        above -= 1.0
        above *= COMFORT_DECEL_MPS2
        above += below
        return above if wishes.stand is None else np.where(wishes.stand, -COMFORT_DECEL_MPS2, above)

    def _wishes(self, view: PlannerView) -> _Wishes:
        """Return what drivers want; mostly, that stays the same from tick to tick."""
        known, target, factor = self._wished, view.target_speed_mps, view.speed_factor
        if (
            known is None
            or known.target_speed_mps is not target
            or known.speed_factor is not factor
        ):
            start = MAX_ACCEL_MPS2 * np.minimum(np.maximum(factor, 0.3), 2.0)
            stand = target < 0.05
            known = self._wished = _Wishes(
                target,
                factor,
                speed_mps=np.maximum(target, 0.1),
                accel_mps2=start,
                exponent=-start * EXPONENT / COMFORT_DECEL_MPS2,
                stand=stand if stand.any() else None,
            )
        return known

    def _curves(self, view: PlannerView, speed: Array, angle: Array, profile_mps: Array) -> Array:
        """Acceleration that follows the speed profile of the curves ahead and of the wheels."""
        allowed = profile_mps * view.speed_factor
        turning = turning_speed(view, angle, lateral_accel_mps2=TURNING_ACCEL_MPS2)
        np.minimum(allowed, turning, out=allowed)
        allowed -= speed
        allowed /= _CURVE_TIME_S
        return allowed

    def _interaction(self, view: PlannerView, speed: Array) -> Array:
        """IDM deceleration for what is ahead: a (s* / s)², s* = s0 + v T + v Δv / (2 √(a b))."""
        gap = np.maximum(view.lead_gap_m, 0.1)
        approach = speed * (speed - view.lead_speed_mps)
        wanted = STANDSTILL_GAP_M + np.maximum(
            speed * TIME_GAP_S + approach / (2.0 * np.sqrt(MAX_ACCEL_MPS2 * COMFORT_DECEL_MPS2)),
            0.0,
        )
        following = np.asarray(MAX_ACCEL_MPS2 * np.square(wanted / gap))
        if view.stop_arc_m is None:
            return following
        return np.asarray(np.maximum(following, self._stopping(view, view.stop_arc_m, speed)))

    def _stopping(self, view: PlannerView, stop_arc_m: Array, speed: Array) -> Array:
        """IDM deceleration for a line, as for somebody who stands a little behind it."""
        ahead = np.maximum(stop_arc_m - view.arc_m - front_from_base_m(view.vehicle), 0.1)
        wanted = STANDSTILL_GAP_M + speed * (
            TIME_GAP_S + speed / (2.0 * np.sqrt(MAX_ACCEL_MPS2 * COMFORT_DECEL_MPS2))
        )
        braking = MAX_ACCEL_MPS2 * np.square(wanted / (ahead + STANDSTILL_GAP_M - LINE_GAP_M))
        stops = np.square(speed) < 2.0 * LINE_DECEL_MPS2 * ahead
        return np.where(stops, braking, 0.0)
