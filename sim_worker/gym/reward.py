"""What a step is worth: a potential that rises along the way, events, and a part for comfort.

The potential of a car is what its metres along the path and its speed, up to the one aimed at, are
worth; a step pays what it rises by. Rewards of such a form leave the best policies as they are (Ng,
Harada, Russell 1999, Policy Invariance under Reward Transformations): over an episode they sum to
where it ends, however it got there. To a learner with a discount g they are worth (1 - g) of the
potential more in each step, so that metres soon are better than metres late.

Standing still can never pay: it is worth 0 for ever, and each metre something even at the least
comfort. Who drives on is ahead of who stands while the odds of a crash at the next conflict are
below V / (V + C), where V is what is still to come and C a crash. With g = 0.99 at 10 Hz, the
default of most learners, 60 m before the end at 6 m/s (100 steps): metres 1.5 and arrival 0.7, so
V = 2.2, C = 0.8 and the odds 0.7. Explorers crash often, and their noise is a jerky ride that
brakes more than it accelerates: with a dear crash and comfort by the second they learn to brake
first, stand before the junction, and find nothing that leads away from there. A crash is no bargain
for that: it ends the episode, and V with it. Who waits 3 s for a gap loses 1 - g^30 = 26 % of V,
less than by any crash that is likelier than one in five.

What is wrong long before it ends badly has to be worth less at once. A learner paid by metres and
crashes alone drives up to who is ahead in a ring, at 0.3 s of distance for seconds, and into it
where that one brakes; and into bends as fast as it likes. So a metre is worth the less, the shorter
the distance is that it is driven at, and speed counts up to what a brisk driver has in the bend.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.gym.rows import StepFacts

Reward = Callable[[StepFacts], Array]
"""From what happened to S cars in a step to what it is worth to each, (S,)."""

PROGRESS_PER_M, SPEED_PER_MPS = 0.04, 0.02
"""The potential: a junction of 100 m is worth 4, and to be at 6 m/s as much as 3 m of it, which
tells an explorer at once what a push of the pedal is worth. Numbers near 1 suit value functions."""
COMFORT_SHARE = 0.2
"""So much of a metre's worth discomfort may take: less than all, or standing would be better."""
COMFORT_ACCEL_MPS2, COMFORT_JERK_MPS3 = 8.5, 14.0
"""So much acceleration, or jerk, takes all of it; half as much takes a quarter."""
DISTANCE_SHARE = 0.8
"""So much of a metre's worth it takes to drive it without any distance to who is in the way. A
crash from behind is met after seconds of driving too close, of which a learner sees nothing that
was worth less until then."""
SPEEDING_PER_M = -0.04
"""For each metre that more than 1.1 times the speed aimed at has gained: it is worth no more."""
COLLISION, OFF_ROAD, RAN_RED, DID_NOT_WAIT, ARRIVED = -0.8, -0.8, -2.0, -0.4, 2.0
"""A crash also ends the episode, and what would have come. Who has priority is to be let pass as if
it were half a crash: that comes at once, whether it ends well or not. A red light takes what
arriving pays."""


def default_reward(step: StepFacts) -> Array:
    """Return (S,) the sum of what is named in this module, each where it applies."""
    accel = np.hypot(step.accel_mps2, step.lateral_accel_mps2) / COMFORT_ACCEL_MPS2
    discomfort = np.minimum(np.square(accel) + np.square(step.jerk_mps3 / COMFORT_JERK_MPS3), 1.0)
    metres = np.abs(step.speed_mps) * step.dt_s
    closeness = DISTANCE_SHARE * (1.0 - step.distance_share)
    lost = 1.0 - (1.0 - COMFORT_SHARE * discomfort) * (1.0 - closeness)
    worth = PROGRESS_PER_M * (step.progress_m - lost * metres)
    aimed, speed = step.aimed_speed_mps, step.speed_mps
    before = np.minimum(speed - step.speed_gain_mps, aimed - step.aimed_gain_mps)
    gain = np.minimum(speed, aimed) - before
    worth += SPEED_PER_MPS * np.where(step.terminated, 0.0, gain)
    over = np.maximum(speed - 1.1 * aimed, 0.0)
    worth += SPEEDING_PER_M * over * step.dt_s
    worth += COLLISION * step.collided + OFF_ROAD * (step.off_road | step.failed)
    worth += RAN_RED * step.ran_red + DID_NOT_WAIT * step.did_not_wait + ARRIVED * step.arrived
    return np.asarray(worth)
