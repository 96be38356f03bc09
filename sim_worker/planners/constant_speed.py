"""A planner that tracks the path at its target speed, ignoring all others: the careless driver."""

from __future__ import annotations

import numpy as np

from foretwin.sim_worker.driver_model import HASTE
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.planners.tracking import (
    MAX_LATERAL_ACCEL_MPS2,
    pure_pursuit,
    turning_speed,
)
from foretwin.sim_worker.vehicle.resistance import resistance_mps2

_TIME_CONSTANT_S = 1.0
_LIMIT_MPS2 = 2.0


class ConstantSpeed:
    """Reaches its target speed, then keeps it through curves and into other road users."""

    looks_at_users = False

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick."""
        speed = view.states[:, 3]
        angle = pure_pursuit(view)
        turning = turning_speed(view, angle, lateral_accel_mps2=MAX_LATERAL_ACCEL_MPS2)
        accel = (np.minimum(view.target_speed_mps, turning) - speed) / _TIME_CONSTANT_S
        most = _LIMIT_MPS2 * np.minimum(np.maximum(view.speed_factor, HASTE[0]), HASTE[1])
        accel = np.maximum(np.minimum(accel, most), -_LIMIT_MPS2)
        stands = (np.abs(speed) < 0.05) & (view.target_speed_mps < 0.05)
        command = accel + resistance_mps2(view.vehicle, speed, view.climb_mps2)
        return PlannerOutput(np.where(stands, -_LIMIT_MPS2, command), angle)
