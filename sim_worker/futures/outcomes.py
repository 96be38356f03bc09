"""What became of each future: collisions, clearance, progress, and why one failed."""

from __future__ import annotations

from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.futures import Outcome
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.batch.accident import Accidents
from foretwin.sim_worker.batch.collision_detection import Touches, first_touches
from foretwin.sim_worker.futures.closed_loop import DriveRecord

NOTHING, ROAD_USER, STATIC = 0, 1, 2
"""Values of Outcome.collision_with."""


def judge(
    vehicle: VehicleParameters,
    drive: DriveRecord,
    user_size_m: Array,
    clearance_m: Array,
    *,
    tick_s: float,
) -> tuple[Outcome, Touches]:
    """Judge a recorded drive; returns the first touches of road users that count as collisions.

    `user_size_m` (S, R, 2); `clearance_m` (S,) the least distance seen to any of them, infinite
    where there is none. A touch after the car met something static, or of a future that is not
    valid, does not count.
    """
    # The contract has one array type; flags stay numpy booleans in it.
    valid: Any = drive.valid.all(axis=1)
    count = len(drive.states)
    touches = first_touches(vehicle, drive.states, drive.users, user_size_m, tick_s=tick_s)
    user_s = np.full(count, np.inf)
    user_s[touches.future] = touches.time_s
    static_s = np.where(
        drive.static_contact.any(axis=1), drive.static_contact.argmax(axis=1) * tick_s, np.inf
    )
    time_s = np.minimum(user_s, static_s)
    collided: Any = np.isfinite(time_s) & valid
    counts = (user_s <= static_s) & collided
    # Between two instants they may have been nearer than at either.
    clearance = np.where(np.isfinite(user_s), 0.0, clearance_m)
    outcome = Outcome(
        collided=collided,
        collision_time_s=np.where(collided, time_s, np.nan),
        collision_with=np.where(collided, np.where(counts, ROAD_USER, STATIC), NOTHING),
        min_clearance_m=np.where(valid, clearance, np.nan),
        progress_m=np.where(valid, drive.progress_m, np.nan),
        valid=valid,
        failures=drive.failures if any(drive.failures) else (),
        remarks=drive.remarks if any(drive.remarks) else (),
    )
    kept = counts[touches.future]
    return outcome, Touches._make(field[kept] for field in touches)


def with_collisions(
    states: Array32, outcome: Outcome, accidents: Accidents | None, *, step_s: float
) -> Array32:
    """Return states (S, N, 8) in which a car moves as its accident has it, then stands.

    Where no accident was computed, it stands from its collision with a road user on. A building or
    island stops the car as it should: nothing is changed there.
    """
    found = np.array(states)
    times = step_s * np.arange(states.shape[1])
    computed: dict[int, int] = {}
    if accidents is not None:
        computed = {int(accidents.future[i]): int(i) for i in np.flatnonzero(accidents.valid)}
    for row in np.flatnonzero(np.asarray(outcome.collision_with) == ROAD_USER).tolist():
        first = int(np.ceil(outcome.collision_time_s[row] / step_s - 1e-6))
        first = min(first, len(times) - 1)
        after, end = found[row, first:], found[row, first].astype(np.float64)
        if accidents is not None and row in computed:
            one = computed[row]
            known = accidents.time_s[one] + accidents.after_time_s
            motion = accidents.ego_states[one]
            for column in range(8):
                after[:, column] = np.interp(times[first:], known, motion[:, column])
            over = times[first:] > known[-1]
            after, end = after[over], motion[-1]
        after[:] = end
        after[:, [3, 4, 5, 7]] = 0.0
    return found
