"""What became of each future: collisions, clearance, progress, and why one failed."""

from __future__ import annotations

from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Array32, Flags, Indices
from foretwin.contracts.futures import Outcome
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.batch.accident import Accidents
from foretwin.sim_worker.batch.collision_detection import Touches, first_touches
from foretwin.sim_worker.futures.closed_loop import DriveRecord
from foretwin.sim_worker.futures.measuring import JobMetrics

OVERLAP_STEPS = 0.2
"""Of the result, for which outlines overlap where a future's metrics end: those that look at its
instants alone then see the touch too."""
NOTHING, ROAD_USER, STATIC = 0, 1, 2
"""Values of Outcome.collision_with."""


class Collisions(NamedTuple):
    """When futures first hit anything, `time_s` (S,), infinite where they do not, and whether that
    is a road user, `with_user` (S,); `touches` are the first ones of road users, `counts` (A,)
    whether they are the collision."""

    time_s: Array
    with_user: Flags
    touches: Touches
    counts: Flags

    def last_instants(self, count: int, *, step_s: float, after_steps: float = 0.0) -> Indices:
        """Return the first of `count` instants (S,) at which futures have hit a road user for so
        many steps, else the last of all."""
        last = np.full(len(self.time_s), count - 1)
        hit = np.ceil(self.time_s[self.with_user] / step_s + after_steps - 1e-6)
        last[self.with_user] = np.minimum(hit, count - 1)
        return last


def find_collisions(
    vehicle: VehicleParameters, drive: DriveRecord, user_size_m: Array, *, tick_s: float
) -> Collisions:
    """Find the collisions of a recorded drive with road users of sizes (S, R, 2), and with what is
    static.

    A touch after the car met something static, or of a future that is not valid, does not count.
    """
    valid = drive.valid.all(axis=1)
    count = len(drive.states)
    touches = first_touches(vehicle, drive.states, drive.users, user_size_m, tick_s=tick_s)
    user_s = np.full(count, np.inf)
    user_s[touches.future] = touches.time_s
    static_s = np.where(
        drive.static_contact.any(axis=1), drive.static_contact.argmax(axis=1) * tick_s, np.inf
    )
    time_s = np.where(valid, np.minimum(user_s, static_s), np.inf)
    with_user = (user_s <= static_s) & np.isfinite(time_s)
    return Collisions(time_s, with_user, touches, with_user[touches.future])


def judge(drive: DriveRecord, collisions: Collisions, measured: JobMetrics) -> Outcome:
    """Say what became of each future of a recorded drive."""
    # The contract has one array type; flags stay numpy booleans in it.
    valid: Any = drive.valid.all(axis=1)
    collided: Any = np.isfinite(collisions.time_s)
    hit_what = np.where(collisions.with_user, ROAD_USER, STATIC)
    # Between two instants they may have been nearer than at either.
    clearance = measured.clearance_m.copy()
    clearance[collisions.touches.future] = 0.0
    return Outcome(
        collided=collided,
        collision_time_s=np.where(collided, collisions.time_s, np.nan),
        collision_with=np.where(collided, hit_what, NOTHING),
        min_clearance_m=np.where(valid, clearance, np.nan),
        progress_m=np.where(valid, measured.progress_m, np.nan),
        valid=valid,
        failures=drive.failures if any(drive.failures) else (),
        remarks=drive.remarks if any(drive.remarks) else (),
        lost=drive.lost or msgspec.UNSET,
    )


def with_collisions(
    states: Array32, collisions: Collisions, accidents: Accidents | None, *, step_s: float
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
    last = collisions.last_instants(len(times), step_s=step_s)
    for row in np.flatnonzero(collisions.with_user).tolist():
        first = int(last[row])
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
