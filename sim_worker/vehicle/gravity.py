"""What gravity does to a vehicle on a slope, along its heading."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.slopes import Slopes
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2


def climb_mps2(slopes: Slopes | None, states: Array, heading: Array | None = None) -> Array | None:
    """Return the deceleration (S,) by the slope under base_link `states` (S, 8); None where flat.

    A command has to undo it. `heading` (2, S) is the cosine and sine of their yaw, where these are
    known. What the slope takes of the load, 1 % at a grade of 14 %, is not modelled.
    """
    if slopes is None:
        return None
    columns = states.T
    if heading is None:
        heading = np.array([np.cos(columns[2]), np.sin(columns[2])])
    return lost_to_grade_mps2(slopes.grade_at(columns[:2], heading))


def lost_to_grade_mps2(grade: Array) -> Array:
    """Return what gravity takes of the acceleration along a grade (N,), rise over run: g sin."""
    return np.asarray(GRAVITY_MPS2 * grade / np.sqrt(1.0 + np.square(grade)))
