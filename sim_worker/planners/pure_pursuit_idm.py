"""The planner under test that comes with foretwin: pure pursuit, intelligent-driver model."""

from __future__ import annotations

import numpy as np

from contracts.arrays import Array
from sim_worker.planners.base import PlannerOutput, PlannerView
from sim_worker.planners.tracking import front_from_base_m, pure_pursuit, turning_speed
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


class PurePursuitIdm:
    """Keeps its lane, slows for curves, follows what is ahead, stops at lights, and holds there."""

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""
        speed = np.maximum(view.states[:, 3], 0.0)
        angle = pure_pursuit(view)
        turning = turning_speed(view, angle, lateral_accel_mps2=TURNING_ACCEL_MPS2)
        accel = np.minimum(self._free(view, speed), self._curves(view, speed, turning))
        accel = accel - self._interaction(view, speed)
        accel = np.maximum(accel, -MAX_DECEL_MPS2)
        command = accel + resistance_mps2(view.vehicle, speed)
        hold = (speed < _HOLD_SPEED_MPS) & (accel <= 0.0)
        return PlannerOutput(np.where(hold, _HOLD_MPS2, command), angle)

    def _free(self, view: PlannerView, speed: Array) -> Array:
        """Free-road acceleration; above the target speed it approaches the comfortable one.

        Treiber, Hennecke, Helbing (2000), Phys. Rev. E 62, eq. 2; above the target speed the
        improved form of Treiber and Kesting (2013), Traffic Flow Dynamics, eq. 11.22.
        """
        start = MAX_ACCEL_MPS2 * np.minimum(np.maximum(view.speed_factor, 0.3), 2.0)
        target = np.maximum(view.target_speed_mps, 0.0)
        allowed = np.maximum(target, 0.1)
        ratio = speed / allowed
        fourth = np.square(np.square(ratio))
        below = start * (1.0 - fourth)
        above = -COMFORT_DECEL_MPS2 * (
            1.0 - np.maximum(ratio, 1.0) ** (-start * EXPONENT / COMFORT_DECEL_MPS2)
        )
        return np.where(target < 0.05, -COMFORT_DECEL_MPS2, np.where(ratio <= 1.0, below, above))

    def _curves(self, view: PlannerView, speed: Array, turning_mps: Array) -> Array:
        """Acceleration that follows the speed profile of the curves ahead and of the wheels."""
        profile = view.path.speed_profile(
            lateral_accel_mps2=LATERAL_ACCEL_MPS2, decel_mps2=COMFORT_DECEL_MPS2
        )
        ahead = view.arc_m + _CURVE_TIME_S * speed
        allowed = view.speed_factor * view.path.at_nodes(profile, ahead)
        return np.asarray((np.minimum(allowed, turning_mps) - speed) / _CURVE_TIME_S)

    def _interaction(self, view: PlannerView, speed: Array) -> Array:
        """IDM deceleration for what is ahead: a (s* / s)², s* = s0 + v T + v Δv / (2 √(a b))."""
        if view.stop_arc_m is None and view.lead_gap_m.min() == np.inf:
            return np.zeros(len(speed))
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
