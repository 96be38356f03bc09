"""A driving stack in another process as planner under test: what it is shown, what it answers.

In lock step: the worker publishes a `PlannerScene` and waits for the `PlannedMotions` of the same
job and question before it simulates on.
"""

from __future__ import annotations

import msgspec

from foretwin.contracts.arrays import Array


class PlannerScene(msgspec.Struct, frozen=True, kw_only=True):
    """S futures at one instant, in the World's frame; base_link is the rear axle's centre.

    `states` (S, 8) as `futures.STATE_COLUMNS`. `road_users` (S, R, 7): x, y, yaw of box
    centres, speed, length, width, and 1 for those who walk; NaN where there is none. `path_xy_m`
    (N, 2), about 1 m apart, and `speed_limit_mps` (N,), infinite where unknown, are where the
    navigation leads; `arc_m` and `offset_m` (S,) place base_link on it. `stop_arc_m` (S,) is
    where the front has to stand for a light, infinite without one.
    """

    run_id: str
    worker_id: str
    job: int
    """Counts the jobs of this worker: what was before is of no use any more."""
    question: int
    futures: tuple[int, ...]
    """Which futures of the job; the answer names those it is for."""
    time_s: float
    """From the job's start."""
    answer_within_s: float
    states: Array
    road_users: Array
    path_xy_m: Array
    speed_limit_mps: Array
    arc_m: Array
    offset_m: Array
    target_speed_mps: Array
    stop_arc_m: Array
    length_m: float
    width_m: float
    rear_overhang_m: float
    """From the rear bumper to base_link."""
    wheelbase_m: float


class PlannedMotions(msgspec.Struct, frozen=True, kw_only=True):
    """What the cars are to do from the question's instant on: base_link at N instants.

    `time_s` (N,) from that instant, rising; `xy_m` (S, N, 2), `yaw_rad` and `speed_mps` (S, N).
    """

    job: int
    question: int
    futures: tuple[int, ...]
    time_s: Array
    xy_m: Array
    yaw_rad: Array
    speed_mps: Array
