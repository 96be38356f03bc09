"""A driving stack in another process as planner under test: what it is shown, what it answers.

In lock step: the worker publishes a `PlannerScene` and waits for the `PlannedMotions` of the same
job and question before it simulates on. A stack that a sweep has started first says what it is, by
`PlannerJoined`, and is asked nothing before.
"""

from __future__ import annotations

import msgspec

from foretwin.contracts.arrays import Array

LINK_VERSION = 2
"""Of these messages: raised where one of them means something else. 1 told neither its version nor
who the road users are, and knew no reset."""
MOST_TOOK_S = 10.0
"""A stack that says that it takes longer for an answer drives no car."""


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
    """Of wall time: in a live drive another planner acts after it, in a sweep the stack is taken
    for hung."""
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
    link: int = 1
    """The version of the link that is spoken; see LINK_VERSION."""
    reset: bool = False
    """The futures begin with this scene: what is remembered of others is of no use."""
    stamp_ns: int = 0
    """The vehicle's clock at this instant, which goes on as the future does."""
    world_id: str | None = None
    future_ids: tuple[str, ...] = ()
    """(S,) as in the tables of results."""
    seeds: tuple[int, ...] = ()
    """(S,) for whatever a stack draws: the same in each planner's future of one case."""
    user_ids: tuple[tuple[str, ...], ...] = ()
    user_kinds: tuple[tuple[str, ...], ...] = ()
    user_lane_ids: tuple[tuple[str, ...], ...] = ()
    path_lane_ids: tuple[str, ...] = ()
    signals: dict[str, str] = {}
    """Colours of the World's lights by the ids of their groups; who is missing is not known."""


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
    link: int = 1
    took_s: float | None = None
    """What the stack says that it took, in simulated time: until then cars do what the answer
    before told them. None: as the sweep's spec says."""
    failure: str = ""
    """Why there is no motion, in words."""


class PlannerJoined(msgspec.Struct, frozen=True, kw_only=True):
    """A driving stack that a sweep has started is there, and says what it is."""

    name: str
    version: str
    link: int = 1


def other_link(spoken: int) -> str | None:
    """Return what is wrong with the version of the link that somebody speaks, None if nothing."""
    if spoken == LINK_VERSION:
        return None
    return (
        f"it speaks version {spoken} of the planner link, this foretwin version {LINK_VERSION}: "
        "update the older of the two"
    )
