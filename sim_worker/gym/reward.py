"""What a step is worth: progress, less discomfort, and much less for breaking rules and cars."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.gym.rows import StepFacts

Reward = Callable[[StepFacts], Array]
"""From what happened to S cars in a step to what it is worth to each, (S,)."""

PROGRESS_PER_M = 0.2
PER_S = -0.2
COMFORT_PER_S = -0.05
COMFORT_ACCEL_MPS2, COMFORT_JERK_MPS3 = 3.0, 5.0
"""So much acceleration, or jerk, costs the weight of comfort each second, twice as much four."""
SPEEDING_PER_M = -0.4
COLLISION, OFF_ROAD, RAN_RED, DID_NOT_WAIT, ARRIVED = -20.0, -20.0, -5.0, -2.0, 5.0


def default_reward(step: StepFacts) -> Array:
    """Return (S,) the sum of what is named in this module, each where it applies.

    Metres along the path count; those driven faster than 1.1 times the speed aimed at cost.
    """
    accel = np.hypot(step.accel_mps2, step.lateral_accel_mps2) / COMFORT_ACCEL_MPS2
    jerk = step.jerk_mps3 / COMFORT_JERK_MPS3
    over = np.maximum(step.speed_mps - 1.1 * step.target_speed_mps, 0.0)
    worth = PROGRESS_PER_M * step.progress_m + SPEEDING_PER_M * over * step.dt_s
    worth += step.dt_s * (
        PER_S + COMFORT_PER_S * (np.square(accel) + np.square(np.minimum(np.abs(jerk), 4.0)))
    )
    worth += COLLISION * step.collided + OFF_ROAD * (step.off_road | step.failed)
    worth += RAN_RED * step.ran_red + DID_NOT_WAIT * step.did_not_wait + ARRIVED * step.arrived
    return np.asarray(worth)
