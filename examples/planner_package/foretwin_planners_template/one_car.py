"""A planner that is written for one car; foretwin asks it for each in turn."""

from __future__ import annotations

import math

import numpy as np

from foretwin import CarView

ACCEL_MPS2, DECEL_MPS2, MOST_MPS2 = 1.0, 1.5, 6.0
GAIN_PS = 3.0
GAP_M, LOOKAHEAD_M = 3.0, 6.0


class CalmOne:
    """Steers at a point of the path ahead; drives so that it can always stop gently."""

    def plan_one(self, view: CarView) -> tuple[float, float]:
        """Return acceleration and tyre angle, positive to the left, of one control tick."""
        front = view.vehicle.length_m.value - view.vehicle.rear_overhang_m.value
        room = min(view.lead_gap_m - GAP_M, view.stop_arc_m - view.arc_m - front - 1.0)
        safe = math.sqrt(2.0 * DECEL_MPS2 * max(room, 0.0))
        wanted = min(view.target_speed_mps, safe)
        accel = min(max(GAIN_PS * (wanted - view.vx_mps), -MOST_MPS2), ACCEL_MPS2)

        ahead = LOOKAHEAD_M + 0.5 * view.vx_mps
        goal = view.path.point_at(np.array([view.arc_m + ahead]), view.desired_offset_m)[0]
        dx, dy = goal[0] - view.x_m, goal[1] - view.y_m
        left = math.cos(view.yaw_rad) * dy - math.sin(view.yaw_rad) * dx
        wheelbase = view.vehicle.wheelbase_m.value
        return accel, math.atan(2.0 * wheelbase * left / (dx * dx + dy * dy))
