"""What became of each future: collisions, clearance, progress."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from contracts.arrays import Array, Array32
from contracts.simulation import Outcome
from contracts.vehicle import VehicleParameters
from sim_worker.overlap import Rectangles, clearance
from sim_worker.stage_model import ROAD_USER_LENGTH_M, ROAD_USER_WIDTH_M
from sim_worker.vehicle.planar import box_centre_from_base_m

Flags = npt.NDArray[np.bool_]

NOTHING, ROAD_USER, STATIC = 0, 1, 2
"""Values of Outcome.collision_with."""


class DriveRecord(NamedTuple):
    """What a job recorded at T control ticks: states (S, T, 8), contacts and validity (S, T)."""

    states: Array
    static_contact: Flags
    user_contact: Flags
    valid: Flags
    progress_m: Array


def judge(
    vehicle: VehicleParameters, drive: DriveRecord, poses: Array, *, tick_s: float
) -> Outcome:
    """Judge a recorded drive against road users `poses` (S, T, 3) and its static contacts.

    `min_clearance_m` is infinite where a future has no road user.
    """
    states = drive.states
    # The contract has one array type; flags stay numpy booleans in it.
    valid: Any = drive.valid.all(axis=1)
    count, ticks = states.shape[:2]
    distance = np.full((count, ticks), np.inf)
    there = np.flatnonzero(np.isfinite(poses[:, 0, 0]) & valid)
    if len(there):
        distance[there] = clearance(
            ego_rectangles(vehicle, states[there]),
            Rectangles(
                poses[there, :, :2], poses[there, :, 2], ROAD_USER_LENGTH_M, ROAD_USER_WIDTH_M
            ),
        )
    distance[drive.user_contact] = 0.0
    hit_user, hit_static = distance <= 0.0, drive.static_contact
    hit = hit_user | hit_static
    collided: Any = hit.any(axis=1) & valid
    first = hit.argmax(axis=1)
    rows = np.arange(count)
    with_what = np.where(hit_user[rows, first], ROAD_USER, STATIC)
    return Outcome(
        collided=collided,
        collision_time_s=np.where(collided, first * tick_s, np.nan),
        collision_with=np.where(collided, with_what, NOTHING),
        min_clearance_m=np.where(valid, distance.min(axis=1), np.nan),
        progress_m=np.where(valid, drive.progress_m, np.nan),
        valid=valid,
    )


def ego_rectangles(vehicle: VehicleParameters, states: Array) -> Rectangles:
    """Return the car's outline at base_link states (…, 8)."""
    ahead = box_centre_from_base_m(vehicle)
    yaw = states[..., 2]
    centre = states[..., :2] + ahead * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    return Rectangles(centre, yaw, vehicle.length_m.value, vehicle.width_m.value)


def held_from_collision(states: Array32, outcome: Outcome, *, step_s: float) -> Array32:
    """Return states (S, N, 8) in which a car stands from its collision with a road user on.

    Road users are kinematic, so to speak of infinite mass: what they would do to the car after
    the first touch means nothing. A building or island stops the car as it should.
    """
    held = np.array(states)
    for row in np.flatnonzero(np.asarray(outcome.collision_with) == ROAD_USER):
        first = min(int(np.ceil(outcome.collision_time_s[row] / step_s - 1e-6)), held.shape[1] - 1)
        held[row, first:] = held[row, first]
        held[row, first:, [3, 4, 5, 7]] = 0.0
    return held
