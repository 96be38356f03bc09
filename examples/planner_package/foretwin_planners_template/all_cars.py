"""A planner that decides for all cars of a job at once."""

from __future__ import annotations

import numpy as np

from foretwin import PlannerOutput, PlannerView, front_from_base_m, pure_pursuit

ACCEL_MPS2, DECEL_MPS2, MOST_MPS2 = 1.0, 1.5, 6.0
GAIN_PS = 3.0
GAP_M = 3.0


class Calm:
    """Keeps its lane and a speed from which it can always stop gently."""

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick; every field of `view` has one row for each car."""
        speed = view.states[:, 3]
        room = view.lead_gap_m - GAP_M
        if view.stop_arc_m is not None:
            line = view.stop_arc_m - view.arc_m - front_from_base_m(view.vehicle) - 1.0
            room = np.minimum(room, line)
        bends = view.path.speed_profile(lateral_accel_mps2=1.5, decel_mps2=DECEL_MPS2)
        safe = np.sqrt(2.0 * DECEL_MPS2 * np.maximum(room, 0.0))
        wanted = np.minimum(view.target_speed_mps, view.path.at_nodes(bends, view.arc_m + speed))
        accel = np.clip(GAIN_PS * (np.minimum(wanted, safe) - speed), -MOST_MPS2, ACCEL_MPS2)
        return PlannerOutput(accel, pure_pursuit(view))
