"""How far beside its path a car's futures keep: as far as it is now, if nothing stands there."""

from __future__ import annotations

import numpy as np

from foretwin.sim_worker.scenarios.impact import MovingBox
from foretwin.sim_worker.scenarios.walls import Walls

ROOM_M = 0.2
"""So much is left on either side: the line is not driven exactly."""
_PARTS = 8
_EVERY_M = 1.0


def kept_offset_m(walls: Walls, car: MovingBox, *, from_m: float, upto_m: float) -> float:
    """Return the car's offset to the left of its path, or as many eighths of it as touch nothing
    that stands beside its way between two arc lengths.

    Nobody aims at a kerb: what takes a car there is its bend, or where the map has things. Where
    the path itself leads into something, the map is wrong about it, and the offset stays.
    """
    arcs_m, roomy = np.arange(from_m, upto_m, _EVERY_M), car.with_room(ROOM_M)
    for parts in range(_PARTS, -1, -1):
        offset_m = car.offset_m * parts / _PARTS
        if not walls.stop(roomy._replace(offset_m=offset_m).rectangles(arcs_m)):
            return offset_m
    return car.offset_m
