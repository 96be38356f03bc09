"""What metrics are computed from: S futures of N instants with R other road users each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters

Flags = npt.NDArray[np.bool_]


class Rollout(NamedTuple):
    """Simulated or recorded motion, all in one plane frame.

    `time_s` (N,); `states` (S, N, 8) of base_link as `futures.STATE_COLUMNS`; `users`
    (S, N, R, 3) x, y, yaw of box centres, NaN where a road user is not there; `user_speed_mps`
    (S, N, R) along their yaw; `user_size_m` (S, R, 2) length and width; `valid` (S,) false where
    the simulation diverged or its planner failed.
    """

    time_s: Array
    states: Array
    users: Array
    user_speed_mps: Array
    user_size_m: Array
    valid: Flags
    vehicle: VehicleParameters


class Measure(NamedTuple):
    """A metric's values (S,), or (S, N) where it says so, NaN wherever `valid` is false."""

    values: Array
    valid: Flags
