"""From what a learner answers, each entry between -1 and 1, to commands."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.sim_worker.driver_model import MAX_DECEL_MPS2
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.planners.tracking import pure_pursuit
from foretwin.sim_worker.vehicle.resistance import resistance_mps2

Control = Literal["free", "along_path"]
"""`free`: acceleration and tyre angle; `along_path`: acceleration, steered by pure pursuit."""

MAX_ACCEL_MPS2 = 3.0
"""What 1 stands for, as -1 does for `MAX_DECEL_MPS2`; 0 keeps the speed. Chosen: a quick car's."""


def action_size(control: Control) -> int:
    """Return how many numbers an action has; raises UserError for an unknown kind of control."""
    if control not in get_args(Control):
        raise UserError(f"control {control!r} is none of {', '.join(get_args(Control))}")
    return 2 if control == "free" else 1


def commands(actions: Array, view: PlannerView, *, control: Control) -> PlannerOutput:
    """Return what actions (S, A) command."""
    wanted = np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0)
    accel = wanted[:, 0] * np.where(wanted[:, 0] < 0.0, MAX_DECEL_MPS2, MAX_ACCEL_MPS2)
    accel = accel + resistance_mps2(view.vehicle, view.states[:, 3], view.climb_mps2)
    if control == "free":
        return PlannerOutput(accel, wanted[:, 1] * view.vehicle.max_tire_angle_rad.value)
    return PlannerOutput(accel, pure_pursuit(view))
