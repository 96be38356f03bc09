"""The planner under test that comes with foretwin: pure pursuit, intelligent-driver model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.sim_worker import driver_model as driver
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.planners import compiled, tracking
from foretwin.sim_worker.vehicle.reference_points import front_from_base_m
from foretwin.sim_worker.vehicle.resistance import resistance_mps2

TURNING_ACCEL_MPS2 = 4.0
"""Of the wheels' own curvature: more than that of the path, which alone governs on it."""


_TRACKING = (
    tracking.LOOKAHEAD_TIME_S,
    tracking.MIN_LOOKAHEAD_M,
    tracking.KEPT_M,
    tracking.LOOKAHEAD_ASIDE,
    tracking.MAX_LATERAL_ACCEL_MPS2,
    tracking.MAX_TURN_RAD,
    TURNING_ACCEL_MPS2,
    driver.CURVE_TIME_S,
)


class _Wishes(NamedTuple):
    """What drivers want on a free road, each (S,), of `target_speed_mps` and `speed_factor`.

    To go at `speed_mps`, beginning with `accel_mps2`; `exponent` is of how they slow down to it.
    `change_mps2` is how the wish itself changes.
    """

    target_speed_mps: Array
    speed_factor: Array
    speed_mps: Array
    change_mps2: Array
    accel_mps2: Array
    exponent: Array
    stand: Flags | None


class PurePursuitIdm:
    """Keeps its lane, slows for curves, follows what is ahead, stops at lights, and holds there."""

    looks_at_users = False

    def __init__(self) -> None:
        self._wished: _Wishes | None = None

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick.

        Free-road acceleration: Treiber, Hennecke, Helbing (2000), Phys. Rev. E 62, eq. 2; above the
        target speed the improved form of Treiber and Kesting (2013), Traffic Flow Dynamics, eq.
        11.22, which approaches the comfortable deceleration.
        """
        path, vehicle = view.path, view.vehicle
        states = np.asarray(view.states, dtype=np.float64).T
        speed = np.maximum(states[3], 0.0)
        heading = view.heading
        if heading is None:
            heading = np.array([np.cos(states[2]), np.sin(states[2])])
        accel, angle = np.empty(len(speed)), np.empty(len(speed))
        limits = vehicle.wheelbase_m, vehicle.max_tire_angle_rad, vehicle.max_tire_rate_radps
        compiled.curve(
            states,
            heading,
            np.asarray(view.arc_m, dtype=np.float64),
            np.asarray(view.offset_m, dtype=np.float64),
            np.asarray(view.desired_offset_m, dtype=np.float64),
            np.asarray(view.speed_factor, dtype=np.float64),
            path.with_curve_speeds(view.bend_accel_mps2, driver.COMFORT_DECEL_MPS2),
            path.first_arc_m,
            tuple(float(part.value) for part in limits),
            _TRACKING,
            accel,
            angle,
        )
        wishes = self._wishes(view)
        compiled.free_road(
            states,
            wishes.speed_mps,
            wishes.change_mps2,
            wishes.accel_mps2,
            wishes.exponent,
            driver.COMFORT_DECEL_MPS2,
            accel,
        )
        if wishes.stand is not None:
            accel = np.where(wishes.stand, np.minimum(accel, -driver.COMFORT_DECEL_MPS2), accel)
        if view.stop_arc_m is not None or np.count_nonzero(view.lead_gap_m < np.inf):
            accel -= self._interaction(view, speed)
        np.maximum(accel, -driver.MAX_DECEL_MPS2, out=accel)
        command = accel + resistance_mps2(view.vehicle, speed, view.climb_mps2)
        slow = speed < driver.HOLD_SPEED_MPS
        if np.count_nonzero(slow):
            command = np.where(slow & (accel <= 0.0), driver.HOLD_MPS2, command)
        return PlannerOutput(command, angle)

    def _wishes(self, view: PlannerView) -> _Wishes:
        """Return what drivers want; some of that stays the same from tick to tick."""
        known, target, factor = self._wished, view.target_speed_mps, view.speed_factor
        if known is None or known.speed_factor is not factor:
            start = driver.MAX_ACCEL_MPS2 * np.minimum(
                np.maximum(factor, driver.HASTE[0], dtype=np.float64), driver.HASTE[1]
            )
            exponent = -start * driver.ACCEL_EXPONENT / driver.COMFORT_DECEL_MPS2
            none = np.zeros(len(start))
            known = _Wishes(none, factor, none, none, start, exponent, None)
        if known.target_speed_mps is not target:
            stand, change = target < 0.05, view.target_accel_mps2
            known = self._wished = known._replace(
                target_speed_mps=target,
                speed_mps=np.maximum(target, 0.1, dtype=np.float64),
                change_mps2=np.zeros(len(target)) if change is None else change,
                stand=stand if stand.any() else None,
            )
        return known

    def _interaction(self, view: PlannerView, speed: Array) -> Array:
        """IDM deceleration for what is ahead: a (s* / s)², s* = s0 + v T + v Δv / (2 √(a b))."""
        gap = np.maximum(view.lead_gap_m, 0.1)
        wanted = driver.STANDSTILL_GAP_M + driver.dynamic_gap_m(
            speed,
            view.lead_speed_mps,
            driver.CALM_TIME_GAP_S,
            driver.MAX_ACCEL_MPS2,
            driver.COMFORT_DECEL_MPS2,
        )
        following = np.asarray(driver.MAX_ACCEL_MPS2 * np.square(wanted / gap))
        if view.stop_arc_m is None:
            return following
        return np.asarray(np.maximum(following, self._stopping(view, view.stop_arc_m, speed)))

    def _stopping(self, view: PlannerView, stop_arc_m: Array, speed: Array) -> Array:
        """IDM deceleration for a line, as for a standing lead a little behind it."""
        ahead = np.maximum(stop_arc_m - view.arc_m - front_from_base_m(view.vehicle), 0.1)
        wanted = driver.STANDSTILL_GAP_M + speed * (
            driver.CALM_TIME_GAP_S
            + speed / (2.0 * np.sqrt(driver.MAX_ACCEL_MPS2 * driver.COMFORT_DECEL_MPS2))
        )
        braking = driver.MAX_ACCEL_MPS2 * np.square(
            wanted / (ahead + driver.STANDSTILL_GAP_M - driver.LINE_GAP_M)
        )
        stops = np.square(speed) < 2.0 * driver.LINE_DECEL_MPS2 * ahead
        return np.where(stops, braking, 0.0)
