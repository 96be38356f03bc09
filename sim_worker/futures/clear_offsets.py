"""How far beside its path a car's futures aim: as far as it is now or a little else, if nothing
stands there."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.scenarios.impact import MovingBox
from foretwin.sim_worker.scenarios.walls import Walls

ROOM_M = 0.2
"""So much is left on either side: the line is not driven exactly."""
_PARTS = 8
_EVERY_M = 1.0


def clear_offsets_m(
    walls: Walls, car: MovingBox, offset_m: Array, *, from_m: float, upto_m: float
) -> Array:
    """Return offsets (S,) to the left of the car's path, those to either side at most as many
    eighths of the widest as touch nothing that stands between two arc lengths.

    Nobody aims at a kerb: what takes a car there is its bend, or where the map has things.
    """
    arcs_m, roomy = np.arange(from_m, upto_m, _EVERY_M), car.with_room(ROOM_M)

    def clear_m(widest_m: float) -> float:
        for parts in range(_PARTS, -1, -1):
            aside_m = widest_m * parts / _PARTS
            if not walls.stop(roomy._replace(offset_m=aside_m).rectangles(arcs_m)):
                return aside_m
        return widest_m  # The path itself leads into something: the map is wrong about it.

    least_m, most_m = float(offset_m.min()), float(offset_m.max())
    right_m = clear_m(least_m) if least_m < 0.0 else least_m
    left_m = clear_m(most_m) if most_m > 0.0 else most_m
    return np.asarray(np.clip(offset_m, right_m, left_m))
