"""A planner that drives backwards along the path: into parking bays."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.driver_model import HOLD_MPS2
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.planners.tracking import steer_towards
from foretwin.sim_worker.vehicle.reference_points import front_from_base_m
from foretwin.sim_worker.vehicle.resistance import resistance_mps2

_LOOKAHEAD_M, _LOOKAHEAD_S, _LOOKAHEAD_ASIDE = 1.2, 0.7, 1.0
_ACCEL_MPS2, _DECEL_MPS2, _MAX_DECEL_MPS2 = 1.0, 1.0, 6.0
_GAP_M = 0.6
"""From the rear to whoever is behind, or crosses behind, where it stops for them."""
_TIME_CONSTANT_S = 0.5
_HOLD_MPS = 0.2


class ReversePursuit:
    """Leads base_link backwards along the path at its target speed and stops at the path's end,
    or for who is in the way behind. The car's yaw is against the path's heading."""

    drives_backwards = True

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick; accelerations are along the direction of travel."""
        speed = np.maximum(-view.states[:, 3], 0.0)
        aside = np.abs(view.offset_m - view.desired_offset_m)
        lookahead = _LOOKAHEAD_M + _LOOKAHEAD_S * speed + _LOOKAHEAD_ASIDE * aside
        goal = view.path.point_at(view.arc_m + lookahead, view.desired_offset_m)
        room = np.minimum(view.path.length_m - view.arc_m, self._free_m(view))
        allowed = np.sqrt(2.0 * _DECEL_MPS2 * np.maximum(room, 0.0))
        wanted = np.minimum(np.maximum(view.target_speed_mps, 0.0), allowed)
        accel = (wanted - speed) / _TIME_CONSTANT_S
        braking = np.square(speed) / (2.0 * np.maximum(room, 0.05))
        accel = np.where(braking > _DECEL_MPS2, np.minimum(accel, -braking), accel)
        accel = np.minimum(np.maximum(accel, -_MAX_DECEL_MPS2), _ACCEL_MPS2)
        hold = (speed < _HOLD_MPS) & (accel <= _HOLD_MPS)
        hold &= (wanted < _HOLD_MPS) | (room <= 0.0)
        command = accel + resistance_mps2(view.vehicle, speed, view.climb_mps2)
        return PlannerOutput(np.where(hold, HOLD_MPS2, command), steer_towards(view, goal))

    def _free_m(self, view: PlannerView) -> Array:
        """Return (S,) how far the rear may go: gaps are given for a front that leads."""
        behind = view.lead_gap_m + front_from_base_m(view.vehicle)
        behind = behind - view.vehicle.rear_overhang_m.value - _GAP_M
        return np.where(view.lead_speed_mps > 0.0, behind + view.lead_speed_mps, behind)
